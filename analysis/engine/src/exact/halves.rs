//! The table of keys in two halves, by the highest bit of the mixed key, each in the hands of one thread.
//!
//! Buckets are in the order of the mixed keys, so a half is the buckets of one side. What has to move past the end of the
//! lower half, a handful of keys, is the affair of its thread, which keeps it in a list; nobody else looks for it. When
//! nobody works on the table they are put into it.

use super::{Asked, Exact, Filling, Moving, Place, ROOM};
use crate::seat::{FACTOR, LANES, REACH, Shape, Slot};
use std::mem;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use crate::ahead::fetch;
use crate::apart::Apart;
use crate::budget::{Memory, Stop, Watch};

/// The factor that takes `FACTOR` back.
const INVERSE: u64 = {
    // Newton's iteration: an odd number is its own inverse in three bits, and each step doubles those that are right.
    let (mut inverse, mut step) = (FACTOR, 0);
    while step < 5 {
        inverse = inverse.wrapping_mul(2_u64.wrapping_sub(FACTOR.wrapping_mul(inverse)));
        step += 1;
    }
    inverse
};

/// Where a key stands in a half, or where it would.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sought {
    /// It is there.
    Known,
    /// The bucket, of the half, and the slot where it belongs.
    Free((usize, usize)),
    /// Past the end of this half.
    Past,
    /// All buckets that would be tried for it are full.
    Full,
}

/// The buckets of the keys whose mixed highest bit is 0, or 1.
pub(crate) struct HalfExact<'a, S> {
    buckets: &'a mut [[S; LANES]],
    shape: Shape,
    first: usize,
    id: usize,
}

fn halves<S: Slot>(shape: Shape, slots: &mut [S]) -> [HalfExact<'_, S>; 2] {
    let first = shape.buckets as usize / 2;
    let (low, high) = slots.as_chunks_mut().0.split_at_mut(first);
    [HalfExact { buckets: low, shape, first: 0, id: 0 }, HalfExact { buckets: high, shape, first, id: 1 }]
}

impl<S: Slot> Exact<S> {
    /// Both halves.
    pub(crate) fn halves(&mut self) -> [HalfExact<'_, S>; 2] {
        halves(self.shape, self.slots.all_mut())
    }

    /// The keys of the lower half that stand past its end.
    pub(crate) fn past(&self) -> Vec<u64> {
        let (shape, first) = (self.shape, self.shape.buckets as usize / 2);
        let past = self.buckets()[first..first + REACH].iter().zip(first..);
        past.flat_map(|(bucket, at)| bucket.iter().map(move |slot| (slot.get(), at)))
            .filter(|&(slot, at)| slot != 0 && at + 1 - ((slot & REACH as u64) as usize) < first)
            .map(|(slot, at)| shape.key(shape.mixed(at + 1 - (slot & REACH as u64) as usize, slot)))
            .collect()
    }

    /// How many keys more the table takes before it grows.
    pub(crate) fn free(&self) -> usize {
        (4 * LANES * self.shape.buckets as usize / 5).saturating_sub(self.len + ROOM)
    }

    /// Counts keys that were put into its halves.
    pub(crate) fn count(&mut self, more: usize) {
        self.len += more;
    }

    /// Takes more buckets, which two threads fill; false where there is no memory for them. No key is lost by that, nor
    /// where time is over.
    pub(crate) fn grow_by_two(&mut self, memory: &Memory, watch: &mut Watch<'_>) -> Result<bool, Stop> {
        let Ok(shape) = self.shape.roomier() else { return Ok(false) };
        let Ok(mut room) = Self::room(shape, memory) else { return Ok(false) };
        let Ok(mut taken) = memory.filled(0, shape.buckets as usize + REACH) else {
            memory.release(Self::bytes(shape));
            return Ok(false);
        };
        let [low, high] = halves(shape, room.all_mut());
        let (taken_low, taken_high) = taken.split_at_mut(low.buckets.len());
        let (from, ended) = (&*self, Apart(AtomicBool::new(false)));
        let past = thread::scope(|scope| {
            let go_on = || if ended.0.load(Ordering::Relaxed) { Err(Stop::Cancelled) } else { Ok(()) };
            let work = move || high.refill(from, taken_high, go_on);
            // Where the system has no thread to give, all is done here.
            let other = thread::Builder::new().spawn_scoped(scope, work).ok()?;
            let past = low.refill(from, taken_low, || watch.tick(LANES));
            ended.0.store(past.is_err(), Ordering::Relaxed);
            Some((past, other.join().unwrap_or_else(|panic| resume_unwind(panic))))
        });
        memory.release(taken.len());
        let past = match past {
            Some((Ok(low), Ok(high))) => [low, high],
            Some((Err(stop), _) | (_, Err(stop))) => {
                memory.release(Self::bytes(shape));
                return Err(stop);
            }
            None => {
                drop(room);
                memory.release(Self::bytes(shape));
                return self.grow_alone(memory, watch);
            }
        };
        let old = (mem::replace(&mut self.slots, room), mem::replace(&mut self.shape, shape));
        if !past.into_iter().flatten().all(|key| self.place(key)) {
            // The old table still has all keys.
            (self.slots, self.shape) = old;
            memory.release(Self::bytes(shape));
            return self.grow_alone(memory, watch);
        }
        memory.release(Self::bytes(old.1));
        Ok(true)
    }

    fn grow_alone(&mut self, memory: &Memory, watch: &mut Watch<'_>) -> Result<bool, Stop> {
        match self.grow(memory, watch) {
            Err(Stop::Memory) => Ok(false),
            end => end.map(|()| true),
        }
    }

    /// Puts a key, which is counted already, where it belongs; false where all buckets that would be tried are full.
    pub(crate) fn place(&mut self, key: u64) -> bool {
        let (home, wanted) = self.shape.seat::<S>(self.shape.mix(key));
        let place = Self::place_of(self.buckets(), home, wanted);
        if let Place::Free((bucket, slot)) = place {
            self.slots.all_mut()[bucket * LANES + slot] = S::new(wanted.get() + (bucket - home) as u64);
        }
        place != Place::Full
    }

    /// Puts a key into the set; calls `new` before, if it is new.
    pub(crate) fn put(
        &mut self,
        asked: &mut Asked<S>,
        key: u64,
        (memory, watch): (&Memory, &mut Watch<'_>),
        mut new: impl FnMut() -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        asked.count = 0;
        self.ask(asked, 1, |_| key, |_, _| ());
        let open = self.first_look(asked);
        self.insert_open(asked, &mut 0, open, (memory, watch), |_| new())?;
        self.answered(asked, memory, watch)
    }
}

impl Shape {
    /// The key of a mixed key.
    fn key(self, mixed: u64) -> u64 {
        self.unmixed(mixed >> (64 - self.bits))
    }

    /// The same, of one in the low bits of a word.
    fn unmixed(self, mixed: u64) -> u64 {
        mixed.wrapping_mul(INVERSE) & ((1 << self.bits) - 1)
    }
}

impl<S: Slot> HalfExact<'_, S> {
    /// Writes the record of the key of each bit of `members` at the end of `mine` or of `theirs`, of which so many
    /// words are used: to both, and counts it in the one where it belongs, because which, no processor guesses.
    #[inline(always)]
    pub(crate) fn ask(
        &self,
        members: u64,
        key: impl Fn(usize) -> u64,
        mine: (&mut [u64], &mut usize),
        theirs: (&mut [u64], &mut usize),
    ) {
        let ((mine, mine_len), (theirs, len)) = (mine, theirs);
        let (shape, id) = (self.shape, self.id);
        let (mut a, mut b, mut rest) = (*mine_len, *len, members);
        while rest != 0 {
            let mixed = shape.mix(key(rest.trailing_zeros() as usize));
            rest &= rest - 1;
            let (home, wanted) = shape.seat::<S>(mixed);
            write(&mut mine[a..a + stride::<S>()], home, wanted);
            write(&mut theirs[b..b + stride::<S>()], home, wanted);
            let is_theirs = (mixed >> 63) as usize ^ id;
            a += stride::<S>() * (1 - is_theirs);
            b += stride::<S>() * is_theirs;
        }
        (*mine_len, *len) = (a, b);
    }

    /// Looks at the bucket where each of fewer than `ROOM` records belongs, and the next one; how many were not found there
    /// (`open`).
    #[inline(always)]
    pub(crate) fn look(&self, records: &[u64], open: &mut [u8; ROOM]) -> usize {
        for record in records.chunks_exact(stride::<S>()) {
            fetch(self.buckets, read::<S>(record).0 - self.first);
        }
        let mut count = 0_u8;
        for (c, record) in records.chunks_exact(stride::<S>()).enumerate() {
            let (home, wanted) = read::<S>(record);
            open[usize::from(count)] = c as u8;
            count += u8::from(S::matches(&self.buckets[home - self.first], wanted) == 0);
        }
        // As in `exact.rs`; of the last bucket, the next one is not this half's.
        let mut left = 0;
        for k in 0..usize::from(count) {
            let c = usize::from(open[k]);
            let (home, wanted) = read::<S>(&records[c * stride::<S>()..(c + 1) * stride::<S>()]);
            let next = self.buckets.get(home - self.first + 1);
            open[left] = c as u8;
            left += usize::from(next.is_none_or(|next| S::matches(next, S::new(wanted.get() + 1)) == 0));
        }
        left
    }

    /// Puts those of all keys that belong here into this half, which is empty as are the counts of what its buckets hold;
    /// gives back those that belong past its end. Asks at each bucket whether to go on.
    fn refill(
        self,
        from: &Exact<S>,
        taken: &mut [u8],
        mut poll: impl FnMut() -> Result<(), Stop>,
    ) -> Result<Vec<u64>, Stop> {
        let old = from.shape;
        let (start, end) =
            if self.id == 0 { (0, old.buckets as usize / 2) } else { (old.buckets as usize / 2, usize::MAX) };
        let mut filling = Filling::new(self.buckets, taken);
        let mut past = Vec::new();
        // What belongs before the middle may stand past it.
        let until = (end.saturating_add(REACH)).min(from.buckets().len());
        let mut moving = Moving::new();
        for (at, bucket) in from.buckets()[..until].iter().enumerate().skip(start) {
            poll()?;
            moving.take(old, at, bucket, start..end);
            moving.leave(at + 1 == until, |product| {
                let key = old.key_of(product);
                let (home, wanted) = self.shape.seat_of::<S>(key);
                if !filling.take(home - self.first, wanted) {
                    past.push(self.shape.unmixed(key));
                }
            });
        }
        Ok(past)
    }

    /// Where the key of a record stands, or where it belongs.
    #[inline(always)]
    pub(crate) fn seek(&self, record: &[u64]) -> Sought {
        let (home, wanted) = read::<S>(record);
        let home = home - self.first;
        let end = self.buckets.len().min(home + REACH);
        for (moved, bucket) in self.buckets[home..end].iter().enumerate() {
            if S::matches(bucket, S::new(wanted.get() + moved as u64)) != 0 {
                return Sought::Known;
            }
            let free = S::matches(bucket, S::new(0));
            if free != 0 {
                return Sought::Free((home + moved, free.trailing_zeros() as usize % LANES));
            }
        }
        if home + REACH > self.buckets.len() { Sought::Past } else { Sought::Full }
    }

    /// The key of a record.
    #[inline(always)]
    pub(crate) fn key(&self, record: &[u64]) -> u64 {
        let (home, wanted) = read::<S>(record);
        self.shape.key(self.shape.mixed(home, wanted.get()))
    }

    /// Puts the key of a record where it belongs.
    #[inline(always)]
    pub(crate) fn take(&mut self, record: &[u64], (bucket, slot): (usize, usize)) {
        let (home, wanted) = read::<S>(record);
        self.buckets[bucket][slot] = S::new(wanted.get() + (self.first + bucket - home) as u64);
    }
}

/// The words of a record: the bucket where a key belongs, and what would stand there.
#[inline(always)]
pub(crate) fn stride<S>() -> usize {
    size_of::<S>() / 4
}

#[inline(always)]
fn write<S: Slot>(record: &mut [u64], home: usize, wanted: S) {
    if stride::<S>() == 1 {
        record[0] = (home as u64) << 32 | wanted.get();
    } else {
        (record[0], record[1]) = (home as u64, wanted.get());
    }
}

#[inline(always)]
fn read<S: Slot>(record: &[u64]) -> (usize, S) {
    if stride::<S>() == 1 {
        ((record[0] >> 32) as usize, S::new(record[0]))
    } else {
        (record[0] as usize, S::new(record[1]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;

    #[test]
    fn two_threads_grow_the_table_that_one_grows() {
        for (bits, count) in [(16, 60_000_u64), (30, 50_000), (44, 50_000)] {
            let memory = Memory::new(1 << 28);
            let mut table = Exact::<u64>::new(bits, &memory).expect("fits");
            let (mut asked, mut poll) = (Asked::new(), unwatched);
            let mut watch = Watch::new(None, &mut poll);
            let keys = || (0..count).map(|i| i.wrapping_mul(0x1234_5677_9abc_def1) & ((1 << bits) - 1));
            let mut distinct = 0;
            for (i, key) in keys().enumerate() {
                let count = || {
                    distinct += 1;
                    Ok(())
                };
                table.put(&mut asked, key, (&memory, &mut watch), count).expect("fits");
                if i % 20_000 == 5000 {
                    assert_eq!(table.grow_by_two(&memory, &mut watch), Ok(true));
                }
            }
            assert_eq!(table.len, distinct);
            assert!(keys().all(|key| table.has(key)));
            assert_eq!(memory.used(), Exact::<u64>::bytes(table.shape));
        }
    }

    #[test]
    fn keys_that_crowd_the_middle_are_all_there_after_any_growth_whether_or_not_there_was_memory() {
        for limit in [1 << 14, 1 << 16, 1 << 18, 1 << 24] {
            let memory = Memory::new(limit);
            let mut table = Exact::<u64>::new(20, &memory).expect("fits");
            let (mut asked, mut poll) = (Asked::new(), unwatched);
            let mut watch = Watch::new(None, &mut poll);
            let shape = table.shape;
            // Neighbours in the order of the mixed keys, most of them before the middle.
            let keys: Vec<u64> = ((1 << 19) - 900..(1 << 19) + 100).map(|mixed: u64| shape.key(mixed << 44)).collect();
            let mut put = |&key: &u64| table.put(&mut asked, key, (&memory, &mut watch), || Ok(())).is_ok();
            let kept = keys.iter().take_while(|key| put(key)).count();
            for _ in 0..12 {
                let before = table.shape.buckets;
                let grown = table.grow_by_two(&memory, &mut watch).expect("nobody ends it");
                assert_eq!(grown, table.shape.buckets > before);
                assert!(keys[..kept].iter().all(|&key| table.has(key)));
                assert!(memory.used() == Exact::<u64>::bytes(table.shape) && memory.used() <= limit);
            }
        }
    }

    #[test]
    fn a_mixed_key_gives_its_key_back() {
        for bits in [16, 33, 60] {
            let shape = Shape::new(bits, 3, 7);
            for key in (0..1000_u64).map(|i| i.wrapping_mul(FACTOR) >> (64 - bits)) {
                assert_eq!(shape.key(shape.mix(key)), key);
            }
        }
    }
}
