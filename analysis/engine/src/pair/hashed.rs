//! The halves of a table of hashes: a record is a marking, before it its mixed hash where that takes work, and after it by
//! which transition it was found (`sleep.rs`).
//!
//! A slot says an index, so the threads number what they find while they find it. A thread numbers its i-th find of a
//! level as if both found equally many, 64 in turn; at the end only those by which one has found more than the other are
//! numbered anew.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use super::half::{BLOCK, End, Finds, Half, Shared, To};
use crate::apart::Apart;
use crate::batch::Batch;
use crate::budget::{Memory, Stop, Watch};
use crate::explore::Space;
use crate::known::Hashed;
use crate::marking::{Width, linear_hash, mix};
use crate::net::Net;
use crate::region::write_first;
use crate::sleep::{Sleeping, last};
use crate::store::Store;
use crate::table::{Shape, Table};

/// Records that are looked up together; as many bytes index arrays of that length without a check.
const BATCH: usize = 128;
const ROOM: usize = 256;

/// A half of the slots.
pub(crate) struct HashedHalf<'a> {
    id: usize,
    slots: &'a mut [u32],
    shape: Shape,
    /// The markings found before this level's, end to end, and how many.
    old: &'a [u64],
    base: usize,
    /// Records that wait, and how many words of them.
    mine: Vec<u64>,
    waiting: usize,
}

/// The number, from the first of this level's finds, of the i-th marking that a thread finds.
#[inline(always)]
fn number(id: usize, i: usize) -> usize {
    (i / BLOCK * 2 + id) * BLOCK + i % BLOCK
}

/// The inverse of `number`.
#[inline(always)]
fn place(number: usize) -> usize {
    number / BLOCK / 2 * BLOCK + number % BLOCK
}

#[inline(always)]
fn stride<W: Width>(width: W) -> usize {
    if width.words() == 1 { 2 } else { width.words() + 2 }
}

/// The mixed hash of a record, and its marking.
#[inline(always)]
fn read<W: Width>(width: W, record: &[u64]) -> (u64, &[u64]) {
    if width.words() == 1 { (mix(record[0]), &record[..1]) } else { (record[0], &record[1..=width.words()]) }
}

impl HashedHalf<'_> {
    /// Puts what waits into the half.
    #[inline(always)]
    fn settle<W: Width>(&mut self, width: W, finds: &mut Finds) {
        let mine = std::mem::take(&mut self.mine);
        self.insert_all(width, &mine[..self.waiting], finds);
        (self.mine, self.waiting) = (mine, 0);
    }

    /// Looks up records, by the same passes as in the table for one thread (`table.rs`), and takes what is new.
    #[inline(always)]
    fn insert_all<W: Width>(&mut self, width: W, records: &[u64], finds: &mut Finds) {
        let (words, stride, shape) = (width.words(), stride(width), self.shape);
        let (mut mixed, mut seen) = ([0_u64; ROOM], [0_u32; ROOM]);
        let (mut tagged, mut open) = ([0_u8; ROOM], [0_u8; ROOM]);
        for batch in records.chunks(BATCH * stride) {
            let count = batch.len() / stride;
            for (c, record) in batch.chunks_exact(stride).enumerate() {
                mixed[c % ROOM] = read(width, record).0;
                seen[c % ROOM] = self.slots[shape.home(mixed[c % ROOM]) & (self.slots.len() - 1)];
            }
            let (mut fits, mut others) = (0_u8, 0_u8);
            for c in 0..count {
                let fit = shape.fits(seen[c % ROOM], mixed[c % ROOM]);
                tagged[usize::from(fits)] = c as u8;
                open[usize::from(others)] = c as u8;
                fits = fits.wrapping_add(u8::from(fit));
                others = others.wrapping_add(u8::from(!fit));
            }
            let mut others = usize::from(others);
            let fresh = finds.fresh.all();
            for &c in &tagged[..usize::from(fits)] {
                let index = shape.index_in(seen[usize::from(c)]);
                let (_, marking) = read(width, &batch[usize::from(c) * stride..]);
                open[others % ROOM] = c;
                others += usize::from(self.marking(fresh, index, words) != marking);
            }
            for k in 0..others {
                let c = usize::from(open[k % ROOM]);
                self.insert_one(width, mixed[c], &batch[c * stride..(c + 1) * stride], finds);
            }
        }
    }

    /// The marking of an index in this half.
    #[inline(always)]
    fn marking<'b>(&'b self, fresh: &'b [u64], index: usize, words: usize) -> &'b [u64] {
        let (from, at) = if index < self.base { (self.old, index) } else { (fresh, place(index - self.base)) };
        &from[at * words..(at + 1) * words]
    }

    #[inline(always)]
    fn insert_one<W: Width>(&mut self, width: W, mixed: u64, record: &[u64], finds: &mut Finds) {
        let (_, marking) = read(width, record);
        let shape = self.shape;
        let mut at = shape.home(mixed) & (self.slots.len() - 1);
        while let Some(&slot) = self.slots.get(at) {
            if slot == 0 {
                let i = finds.fresh.len();
                let index = self.base + number(self.id, i);
                if self.base / 2 + i >= self.slots.len() / 4 * 3 || !shape.numbers(index) {
                    finds.end(End::Full);
                } else if i >= finds.most || finds.fresh.push(width, marking, finds.most, &finds.memory).is_err() {
                    finds.end(End::Short);
                } else {
                    finds.trail.append(i, &[record[record.len() - 1] as u16], &finds.memory);
                    self.slots[at] = shape.slot(mixed, index);
                    return;
                }
                break;
            }
            if shape.fits(slot, mixed)
                && self.marking(finds.fresh.all(), shape.index_in(slot), width.words()) == marking
            {
                return;
            }
            at += 1;
        }
        finds.leave(record);
    }

    /// Files those of all markings that belong here; gives back what belongs past the end. Asks now and then, with the work
    /// done since, whether to go on.
    fn file<W: Width>(
        &mut self,
        width: W,
        mut poll: impl FnMut(usize) -> Result<(), Stop>,
    ) -> Result<Vec<(u64, usize)>, Stop> {
        let words = width.words();
        write_first(self.slots);
        let mut past = Vec::new();
        let mut own = [(0_u64, 0_usize); BATCH];
        let mut count = 0;
        for (index, marking) in self.old[..self.base * words].chunks_exact(words).enumerate() {
            let mixed = mix(linear_hash(width, marking));
            own[count] = (mixed, index);
            count += usize::from(mixed >> 63 == self.id as u64);
            if count < BATCH && index + 1 < self.base {
                continue;
            }
            for &(mixed, index) in &own[..count] {
                let mut at = self.shape.home(mixed) & (self.slots.len() - 1);
                while self.slots.get(at).is_some_and(|&slot| slot != 0) {
                    at += 1;
                }
                match self.slots.get_mut(at) {
                    Some(slot) => *slot = self.shape.slot(mixed, index),
                    None => past.push((mixed, index)),
                }
            }
            poll(count)?;
            count = 0;
        }
        Ok(past)
    }
}

impl<W: Width> Half<W> for HashedHalf<'_> {
    fn begin(&mut self, _: &Memory, _: &mut Watch<'_>) -> Result<(), Stop> {
        Ok(())
    }

    #[inline(always)]
    fn stride(&self, width: W) -> usize {
        stride(width)
    }

    #[inline(always)]
    fn cut(&mut self, width: W, batch: &mut Batch) {
        batch.cut(width);
    }

    #[inline(always)]
    fn push(&mut self, width: W, net: &Net, batch: &Batch, t: usize, fire: u64, to: To<'_, '_>) {
        let (words, stride) = (width.words(), stride(width));
        let (flip, flip_hash, last) = (&net.flip(t, words)[..words], net.flip_hashes[t], u64::from(last(t)));
        if self.mine.len() < self.waiting + 64 * stride {
            self.mine.resize(self.waiting + 64 * stride, 0);
        }
        let (theirs, len) = to.theirs;
        let (mine, mut a, mut b) = (self.mine.as_mut_slice(), self.waiting, *len);
        let mut rest = fire;
        while rest != 0 {
            let j = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let mixed = mix(batch.hashes[j] ^ flip_hash);
            let from = &batch.markings[j * words..(j + 1) * words];
            let (to, copy) = (&mut mine[a..a + stride], &mut theirs[b..b + stride]);
            if words > 1 {
                to[0] = mixed;
                copy[0] = mixed;
            }
            for k in 0..words {
                let word = from[k] ^ flip[k];
                to[stride - 1 - words + k] = word;
                copy[stride - 1 - words + k] = word;
            }
            (to[stride - 1], copy[stride - 1]) = (last, last);
            let is_theirs = (mixed >> 63) as usize ^ self.id;
            a += stride * (1 - is_theirs);
            b += stride * is_theirs;
        }
        (self.waiting, *len) = (a, b);
        if self.waiting >= BATCH * stride {
            self.settle(width, to.finds);
        }
    }

    #[inline(always)]
    fn end(&mut self, width: W, _: &Net, _: &Batch, round: bool, to: To<'_, '_>) {
        if round {
            self.settle(width, to.finds);
        }
    }

    /// The whole table grows at once, when nobody works on it.
    fn wants_room(&self, _: bool) -> bool {
        false
    }

    fn take_room(&mut self, _: &mut Finds, _: &mut Watch<'_>) {}

    #[inline(always)]
    fn insert(&mut self, width: W, records: &[u64], finds: &mut Finds, _: &mut Watch<'_>) {
        self.insert_all(width, records, finds);
    }
}

/// Both halves of the slots.
fn halves<'a>(table: (&'a Store, &'a mut [u32], Shape)) -> [HashedHalf<'a>; 2] {
    let (store, slots, shape) = table;
    let (low, high) = slots.split_at_mut(slots.len() / 2);
    let half =
        |id, slots| HashedHalf { id, slots, shape, old: store.all(), base: store.len(), mine: Vec::new(), waiting: 0 };
    [half(0, low), half(1, high)]
}

impl<W: Width> Shared<W> for Hashed {
    type Half<'a> = HashedHalf<'a>;
    const GOES_ON: bool = false;

    fn cut(&mut self, _: W, _: &Space, _: &Sleeping, _: f64) -> bool {
        true
    }

    fn halves<'a>(&'a mut self, table: &'a mut Table) -> (&'a Store, [HashedHalf<'a>; 2]) {
        let (store, slots, shape) = table.parts();
        (store, halves((store, slots, shape)))
    }

    fn complete(&mut self, width: W, space: &mut Space, finds: [&Finds; 2]) -> Result<(), Stop> {
        let (store, slots, shape) = space.table.parts();
        let even = finds[0].fresh.len().min(finds[1].fresh.len()) / BLOCK;
        let base = store.len();
        // All are found before the first is corrected: until then each number stands once.
        let mut moved = Vec::new();
        let mut index = base + 2 * BLOCK * even;
        for of in finds {
            for i in BLOCK * even..of.fresh.len() {
                let was = base + number(of.id, i);
                if was != index {
                    let mut at = shape.home(mix(linear_hash(width, of.fresh.get(width, i))));
                    while slots[at] == 0 || shape.index_in(slots[at]) != was {
                        at += 1;
                    }
                    space.memory.push(&mut moved, (at, index))?;
                }
                index += 1;
            }
        }
        for &(at, index) in &moved {
            slots[at] = shape.renumbered(slots[at], index);
        }
        space.memory.drop_vec(moved);
        Ok(())
    }

    fn seal(&mut self, _: &Space) {}

    fn grow(&mut self, width: W, space: &mut Space, watch: &mut Watch<'_>) -> Result<bool, Stop> {
        let Ok(mut wider) = space.table.wider(&space.memory) else { return Ok(false) };
        let (shape, bytes) = (wider.shape(), size_of_val(wider.all_mut()));
        let [mut low, mut high] = halves((&space.table.store, wider.all_mut(), shape));
        let ended = Apart(AtomicBool::new(false));
        let past = thread::scope(|scope| {
            let go_on = |_| if ended.0.load(Ordering::Relaxed) { Err(Stop::Cancelled) } else { Ok(()) };
            let other = scope.spawn(move || high.file(width, go_on));
            let past = low.file(width, |work| watch.tick(work));
            ended.0.store(past.is_err(), Ordering::Relaxed);
            (past, other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
        });
        let past = match past {
            (Ok(low), Ok(high)) => [low, high],
            (Err(stop), _) | (_, Err(stop)) => {
                space.memory.release(bytes);
                return Err(stop);
            }
        };
        space.table.replace(wider, &space.memory);
        for (mixed, index) in past.into_iter().flatten() {
            space.table.file(mixed, index);
        }
        Ok(true)
    }

    fn insert_left(
        &mut self,
        width: W,
        space: &mut Space,
        records: &[u64],
        max: usize,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        space.table.make_room(width, records.len() / stride(width), &space.memory, watch)?;
        for record in records.chunks_exact(stride(width)) {
            let (mixed, marking) = read(width, record);
            space.table.insert_mixed(width, marking, mixed, max, &space.memory)?;
        }
        Ok(())
    }

    fn forget_others(&mut self, width: W, space: &mut Space) {
        space.table.forget_others(width);
    }
}
