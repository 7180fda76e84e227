//! The set of markings by exact keys: 4 or 8 bytes a slot, no look at a marking to know that it is there.
//!
//! A key (`span.rs`) tells the reachable markings apart by so few bits that a table can hold it whole, by *quotienting*
//! (Knuth, TAOCP 3, exercise 6.4-13; Cleary, "Compact hash tables using bidirectional linear probing", 1984): a
//! bijection mixes the key, the high part of the product with the number of buckets says where it belongs, and only
//! what is then missing, the *tag*, is stored there. A slot that compares equal is the marking: a look-up is one cache
//! miss, not one for the table and one for the array of markings, and half as many instructions. What is found is
//! dropped at once; only for the rest does anybody ask which marking it was.
//!
//! A bucket is eight slots, filled from the first on and compared by vector instructions; at four fifths full, five
//! keys of six stand in the bucket where they belong. The others stand in a following one, and a slot says how far it
//! has moved (its low bits; 0 is an empty slot), so that its key can still be told. There are 2^k or 3 * 2^k buckets,
//! so a large table grows by a third or by half, never by two, and is never less than half full; up to some mebibytes it
//! doubles, which moves keys half as often, and so do, for as long as they last, those of two threads (`sides.rs`). Buckets
//! are in the order of the mixed keys; so growing reads one table and writes the other from end to end, and needs neither
//! the markings nor their hashes.
//!
//! The index of a marking is not needed while exploring; `indexes.rs` puts it beside the slots when somebody asks for
//! it.
//!
//! Rejected: tags of 16 bits with a look at the array on a match (two misses an edge again); a slot for each key with
//! plain linear probing (a third of the look-ups enter a loop, whose exit the processor guesses wrong); a second hash
//! where a bucket is full (one more miss for one edge in six; the next bucket is at hand); to fill seven eighths (more keys
//! stand elsewhere, and exploring takes a tenth longer).

mod in_place;
mod sides;

use std::ops::Range;

use crate::ahead::fetch;
use crate::budget::{Memory, Stop, Watch};
use crate::region::{Region, write_first};
use crate::seat::{LANES, MOVED_BITS, REACH, Shape, Slot};

/// Whether a key is in the set, and where it belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// It is in the set.
    Known,
    /// The bucket and the slot of it where it belongs.
    Free((usize, usize)),
    /// All buckets that would be tried for it are full.
    Full,
}

/// Keys that are looked up together; as many as a byte counts.
pub const ROOM: usize = 256;

/// Keys that are looked up together.
#[derive(Debug)]
pub struct Asked<S> {
    /// How many.
    pub count: usize,
    /// The bucket where each belongs, and what would stand there.
    homes: [u32; ROOM],
    wanted: [S; ROOM],
    /// Those not found there.
    pub open: [u8; ROOM],
}

impl<S: Slot> Asked<S> {
    /// None yet.
    pub fn new() -> Self {
        Asked { count: 0, homes: [0; ROOM], wanted: [S::new(0); ROOM], open: [0; ROOM] }
    }
}

impl<S: Slot> Default for Asked<S> {
    fn default() -> Self {
        Asked::new()
    }
}

/// Looks at the bucket where each key belongs, and for those that are left at the next one; how many keys were not found
/// (`open`). Loops over numbers, here and above: compilers make a fifth fewer instructions of them than of iterators joined
/// together. A function by itself: within a large one a compiler may run out of registers for the first loop, which took a
/// twelfth of the time of all.
#[inline(never)]
fn look<S: Slot>(buckets: &[[S; LANES]], asked: &mut Asked<S>) -> usize {
    let mut open = 0;
    for c in 0..asked.count {
        let (home, wanted) = (asked.homes[c % ROOM] as usize, asked.wanted[c % ROOM]);
        asked.open[open % ROOM] = c as u8;
        open += usize::from(!S::holds(&buckets[home], wanted));
    }
    // Most keys whose bucket was full stand in the next one. A loop that looks where one key stands has an end that no
    // processor guesses; this has none.
    let mut left = 0;
    for k in 0..open {
        let c = usize::from(asked.open[k % ROOM]);
        let (home, wanted) = (asked.homes[c] as usize, asked.wanted[c]);
        asked.open[left % ROOM] = c as u8;
        left += usize::from(!S::holds(&buckets[home + 1], S::new(wanted.get() + 1)));
    }
    left
}

/// Empty buckets that are being filled, and how many slots of each are taken. To ask a bucket itself for its first free
/// slot would be to read all of it just after one slot was written, and for that the processor waits.
struct Filling<'a, S> {
    buckets: &'a mut [[S; LANES]],
    taken: &'a mut [u8],
}

impl<'a, S: Slot> Filling<'a, S> {
    /// Buckets, and a zero for each, that nobody has read before.
    fn new(buckets: &'a mut [[S; LANES]], taken: &'a mut [u8]) -> Self {
        write_first(buckets.as_flattened_mut());
        Filling { buckets, taken }
    }

    /// Puts what stands for a key into the first bucket with a free slot from the one where it belongs on; false where all
    /// that would be tried for it are full, or past the end.
    #[inline(always)]
    fn take(&mut self, home: usize, wanted: S) -> bool {
        let taken = usize::from(self.taken[home]);
        if taken >= LANES {
            return self.take_later(home, wanted);
        }
        self.taken[home] += 1;
        self.buckets[home][taken] = wanted;
        true
    }

    /// The same where the bucket in which it belongs is full, as few are in a table that has just become larger.
    #[cold]
    fn take_later(&mut self, home: usize, wanted: S) -> bool {
        let tried = &mut self.taken[home..];
        let Some(moved) = tried.iter().take(REACH).position(|&taken| usize::from(taken) < LANES) else { return false };
        let free = usize::from(tried[moved]) % LANES;
        tried[moved] += 1;
        self.buckets[home + moved][free] = S::new(wanted.get() + moved as u64);
        true
    }
}

/// A set of keys.
#[derive(Debug)]
pub struct Exact<S> {
    slots: Region<S>,
    shape: Shape,
    len: usize,
}

impl<S: Slot> Exact<S> {
    /// The bytes that the least table for keys of so many bits takes: the fewer slots, the longer their tags.
    /// More than there are where its buckets could not be numbered.
    pub fn least_bytes(bits: u32) -> usize {
        Self::least(bits).numbered().map_or(usize::MAX, Self::bytes)
    }

    fn least(bits: u32) -> Shape {
        Shape::least(bits, 8 * size_of::<S>() as u32 - MOVED_BITS)
    }

    fn bytes(shape: Shape) -> usize {
        (shape.buckets as usize + REACH) * LANES * size_of::<S>()
    }

    /// No keys of so many bits.
    pub fn new(bits: u32, memory: &Memory) -> Result<Self, Stop> {
        let shape = Self::least(bits).numbered()?;
        Ok(Exact { slots: Self::room(shape, memory)?, shape, len: 0 })
    }

    /// No keys and no room for any, for which nothing is claimed.
    pub(crate) fn none(bits: u32) -> Self {
        Exact { slots: Region::Heap(Vec::new()), shape: Self::least(bits), len: 0 }
    }

    fn room(shape: Shape, memory: &Memory) -> Result<Region<S>, Stop> {
        let bytes = Self::bytes(shape);
        memory.claim(bytes)?;
        Region::zeroed(bytes / size_of::<S>()).ok_or_else(|| {
            memory.release(bytes);
            Stop::Memory
        })
    }

    /// The slots, bucket by bucket.
    pub(crate) fn all(&self) -> &[S] {
        self.slots.all()
    }

    /// Where keys belong.
    pub(crate) fn shape(&self) -> Shape {
        self.shape
    }

    #[inline(always)]
    fn buckets(&self) -> &[[S; LANES]] {
        self.slots.all().as_chunks().0
    }

    /// Takes the key of each bit of `members` among those that are asked for, and notes its number; there must be room.
    #[inline(always)]
    pub fn ask(
        &self,
        asked: &mut Asked<S>,
        members: u64,
        key: impl Fn(usize) -> u64,
        mut note: impl FnMut(usize, u32),
    ) {
        let (shape, buckets, mut count, mut rest) = (self.shape, self.buckets(), asked.count, members);
        while rest != 0 {
            let (c, j) = (count % ROOM, rest.trailing_zeros());
            rest &= rest - 1;
            count += 1;
            let (home, wanted) = shape.seat(shape.mix(key(j as usize)));
            fetch(buckets, home);
            asked.homes[c] = home as u32;
            asked.wanted[c] = wanted;
            note(c, j);
        }
        asked.count = count;
    }

    /// Asks again, in another shape.
    #[cold]
    fn ask_again(&self, asked: &mut Asked<S>, before: Shape) {
        for c in 0..asked.count {
            let mixed = before.mixed(asked.homes[c] as usize, asked.wanted[c].get());
            let (home, wanted) = self.shape.seat(mixed);
            asked.homes[c] = home as u32;
            asked.wanted[c] = wanted;
        }
    }

    /// Looks at the bucket where each key belongs and the next one; how many keys were not found there (`open`).
    #[inline(always)]
    pub fn first_look(&self, asked: &mut Asked<S>) -> usize {
        look(self.buckets(), asked)
    }

    /// Where a key that is asked for stands, or where it belongs.
    #[inline(always)]
    fn place_of(buckets: &[[S; LANES]], home: usize, wanted: S) -> Place {
        for (moved, bucket) in buckets[home..home + REACH].iter().enumerate() {
            if S::holds(bucket, S::new(wanted.get() + moved as u64)) {
                return Place::Known;
            }
            let free = S::matches(bucket, S::new(0));
            if free != 0 {
                return Place::Free((home + moved, free.trailing_zeros() as usize % LANES));
            }
        }
        Place::Full
    }

    /// Whether a key is in the set.
    pub fn has(&self, key: u64) -> bool {
        let (home, wanted) = self.shape.seat(self.shape.mix(key));
        Self::place_of(self.buckets(), home, wanted) == Place::Known
    }

    /// Puts those of the keys that `first_look` has left open into the set that are new, each after `new` was told its
    /// number, which may refuse it. `done` are dealt with: fewer than `open` where one is refused, or where all buckets are
    /// full that would be tried for it.
    #[inline(always)]
    pub(crate) fn insert(
        &mut self,
        asked: &Asked<S>,
        done: &mut usize,
        open: usize,
        new: &mut impl FnMut(usize) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        // What is asked of the region and of the set is asked once, not for each key.
        let buckets: &mut [[S; LANES]] = self.slots.all_mut().as_chunks_mut().0;
        for k in *done..open {
            *done = k;
            let c = usize::from(asked.open[k % ROOM]);
            let (home, wanted) = (asked.homes[c] as usize, asked.wanted[c]);
            match Self::place_of(buckets, home, wanted) {
                Place::Known => {}
                Place::Free((bucket, slot)) => {
                    new(c)?;
                    buckets[bucket][slot] = S::new(wanted.get() + (bucket - home) as u64);
                    self.len += 1;
                }
                Place::Full => return Ok(()),
            }
        }
        *done = open;
        Ok(())
    }

    /// The same, and takes more buckets where that is needed. Where one is refused, the same call goes on from there.
    #[inline(always)]
    pub fn insert_open(
        &mut self,
        asked: &mut Asked<S>,
        done: &mut usize,
        open: usize,
        (memory, watch): (&Memory, &mut Watch<'_>),
        mut new: impl FnMut(usize) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        loop {
            self.insert(asked, done, open, &mut new)?;
            if *done == open {
                return Ok(());
            }
            self.grow_asked(asked, memory, watch)?;
        }
    }

    /// Takes more buckets, and asks again.
    #[cold]
    pub(crate) fn grow_asked(
        &mut self,
        asked: &mut Asked<S>,
        memory: &Memory,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        let before = self.shape;
        self.grow(memory, watch)?;
        self.ask_again(asked, before);
        Ok(())
    }

    /// The key of one that `first_look` has left open.
    #[cold]
    pub(crate) fn asked_key(&self, asked: &Asked<S>, open: usize) -> u64 {
        let c = usize::from(asked.open[open % ROOM]);
        let mixed = self.shape.mixed(asked.homes[c] as usize, asked.wanted[c].get());
        self.shape.unmixed(mixed >> (64 - self.shape.bits))
    }

    /// Empties what was asked, and takes more buckets if as many new keys again would make the table more than four
    /// fifths full.
    #[inline(always)]
    pub fn answered(&mut self, asked: &mut Asked<S>, memory: &Memory, watch: &mut Watch<'_>) -> Result<(), Stop> {
        asked.count = 0;
        while Self::is_filled(self.shape, self.len) {
            self.grow(memory, watch)?;
        }
        Ok(())
    }

    /// Whether as many new keys as are asked for at once would make a table of so many more than four fifths full.
    #[inline(always)]
    fn is_filled(shape: Shape, len: usize) -> bool {
        5 * (len + ROOM) > 4 * LANES * shape.buckets as usize
    }

    /// Takes more buckets. Where that ends early, for want of memory or of time, all keys are where they were.
    #[cold]
    pub fn grow(&mut self, memory: &Memory, watch: &mut Watch<'_>) -> Result<(), Stop> {
        self.grow_beyond(self.shape, memory, watch)
    }

    /// Takes more buckets than that.
    fn grow_beyond(&mut self, mut shape: Shape, memory: &Memory, watch: &mut Watch<'_>) -> Result<(), Stop> {
        loop {
            shape = shape.roomier()?;
            let mut room = Self::room(shape, memory)?;
            let buckets = room.all_mut().as_chunks_mut().0;
            let filled = memory.filled(0, buckets.len()).and_then(|mut taken| {
                let filled = self.refill(shape, Filling::new(buckets, &mut taken), watch, |_| true);
                memory.release(taken.len());
                filled
            });
            if filled == Ok(true) {
                memory.release(Self::bytes(self.shape));
                (self.slots, self.shape) = (room, shape);
                return Ok(());
            }
            memory.release(Self::bytes(shape));
            filled?;
        }
    }

    /// Puts all keys, or those of whose mixed keys that is said, into other buckets; false where some of them are full. That
    /// ends with as many buckets as keep any eight keys apart, if not with memory.
    fn refill(
        &self,
        shape: Shape,
        mut filling: Filling<'_, S>,
        watch: &mut Watch<'_>,
        mut is_wanted: impl FnMut(u64) -> bool,
    ) -> Result<bool, Stop> {
        let mut moving = Moving::new();
        let mut fits = true;
        for (at, bucket) in self.buckets().iter().enumerate() {
            watch.tick(LANES)?;
            moving.take(self.shape, at, bucket, 0..usize::MAX);
            moving.leave(at + 1 == self.buckets().len(), |product| {
                let key = self.shape.key_of(product);
                let (home, wanted) = shape.seat_of(key);
                fits &= !is_wanted(key) || filling.take(home, wanted);
            });
            if !fits {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Products of keys (`seat.rs`) on their way from one table into another. They are gathered without a branch: where a
/// bucket's keys end, no processor guesses.
struct Moving {
    products: [u64; ROOM],
    count: usize,
}

impl Moving {
    fn new() -> Self {
        Moving { products: [0; ROOM], count: 0 }
    }

    /// Takes the keys of a bucket, by its number, that belong to some buckets.
    #[inline(always)]
    fn take<S: Slot>(&mut self, shape: Shape, at: usize, bucket: &[S; LANES], of: Range<usize>) {
        for slot in bucket.map(|slot| slot.get()) {
            // Of an empty slot this is nothing, and is written over.
            let home = at + 1 - (slot & REACH as u64) as usize;
            self.products[self.count % ROOM] = shape.product(home, slot);
            self.count += usize::from(slot != 0) & usize::from(of.start <= home) & usize::from(home < of.end);
        }
    }

    /// Gives away what was taken, if it is much or the last.
    #[inline(always)]
    fn leave(&mut self, last: bool, mut to: impl FnMut(u64)) {
        if self.count > ROOM - LANES || last {
            self.products[..self.count].iter().for_each(|&product| to(product));
            self.count = 0;
        }
    }
}

#[cfg(test)]
mod tests;
