//! The table of keys in two halves, by the highest bit of the mixed key, each in the hands of one thread.
//!
//! Buckets are in the order of the mixed keys, so a half is the buckets of one side. What would have to move past the end
//! of the lower half belongs to neither thread: it is given back, and put into the whole table when nobody works on it.

use super::{Asked, Exact, ROOM, look};
use crate::seat::{FACTOR, LANES, REACH, Shape, Slot};
use std::panic::resume_unwind;
use std::thread;

use crate::budget::{Memory, Stop};

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
    /// Past the end of this half: only the whole table can tell.
    Past,
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

    /// How many keys more the table takes before it grows.
    pub(crate) fn free(&self) -> usize {
        (4 * LANES * self.shape.buckets as usize / 5).saturating_sub(self.len + ROOM)
    }

    /// Counts keys that were put into its halves.
    pub(crate) fn count(&mut self, more: usize) {
        self.len += more;
    }

    /// Takes more buckets, which two threads fill; false where there is no memory for them. An error leaves the set without
    /// some of its keys.
    pub(crate) fn grow_by_two(&mut self, asked: &mut Asked<S>, memory: &Memory) -> Result<bool, Stop> {
        let shape = self.shape.larger();
        let Ok(mut room) = Self::room(shape, memory) else { return Ok(false) };
        let [mut low, mut high] = halves(shape, room.all_mut());
        let past = thread::scope(|scope| {
            let work = || high.refill(self);
            // Where the system has no thread to give, all is done here.
            let other = thread::Builder::new().spawn_scoped(scope, work).ok()?;
            let past = low.refill(self);
            Some([past, other.join().unwrap_or_else(|panic| resume_unwind(panic))])
        });
        let Some(past) = past else {
            memory.release(Self::bytes(shape));
            return Ok(self.grow(memory).is_ok());
        };
        memory.release(Self::bytes(self.shape));
        (self.slots, self.shape) = (room, shape);
        for key in past.into_iter().flatten() {
            self.len -= 1; // it is counted already
            self.put(asked, key, memory, || Ok(()))?;
        }
        Ok(true)
    }

    /// Puts a key into the set; calls `new` before, if it is new.
    pub(crate) fn put(
        &mut self,
        asked: &mut Asked<S>,
        key: u64,
        memory: &Memory,
        new: impl FnOnce() -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        asked.count = 0;
        self.ask(asked, 1, |_| key, |_, _| ());
        self.insert(asked, 0, memory, new)?;
        self.answered(asked, memory)
    }
}

impl Shape {
    /// The key of a mixed key.
    fn key(self, mixed: u64) -> u64 {
        (mixed >> (64 - self.bits)).wrapping_mul(INVERSE) & ((1 << self.bits) - 1)
    }
}

impl<S: Slot> HalfExact<'_, S> {
    /// Takes the key of each bit of `members`: one of this half among those that are asked for, where there must be room,
    /// any other at the end of `theirs`, of which so many are used.
    #[inline(always)]
    pub(crate) fn ask(
        &self,
        asked: &mut Asked<S>,
        members: u64,
        key: impl Fn(usize) -> u64,
        theirs: (&mut [u64], &mut usize),
    ) {
        let (theirs, len) = theirs;
        let (shape, first, id) = (self.shape, self.first, self.id);
        let (mut a, mut b, mut rest) = (asked.count, *len, members);
        while rest != 0 {
            let key = key(rest.trailing_zeros() as usize);
            rest &= rest - 1;
            let mixed = shape.mix(key);
            let (home, wanted) = shape.seat(mixed);
            asked.homes[a % ROOM] = home.wrapping_sub(first) as u32;
            asked.wanted[a % ROOM] = wanted;
            theirs[b] = key;
            let is_theirs = (mixed >> 63) as usize ^ id;
            a += 1 - is_theirs;
            b += is_theirs;
        }
        (asked.count, *len) = (a, b);
    }

    /// Takes keys of this half, fewer than `ROOM`, in the place of those that were asked for.
    #[inline(always)]
    pub(crate) fn ask_all(&self, asked: &mut Asked<S>, keys: &[u64]) {
        let places = asked.homes.iter_mut().zip(&mut asked.wanted);
        for ((home, wanted), &key) in places.zip(keys) {
            let (bucket, slot) = self.shape.seat(self.shape.mix(key));
            *home = (bucket - self.first) as u32;
            *wanted = slot;
        }
        asked.count = keys.len();
    }

    /// Looks at the one bucket where each key belongs; how many keys were not found there (`open`).
    #[inline(always)]
    pub(crate) fn look(&self, asked: &mut Asked<S>) -> usize {
        look(self.buckets, asked)
    }

    /// Puts those of all keys that belong here into this half; gives back those that belong past its end.
    fn refill(&mut self, from: &Exact<S>) -> Vec<u64> {
        let old = from.shape;
        let (start, end) =
            if self.id == 0 { (0, old.buckets as usize / 2) } else { (old.buckets as usize / 2, usize::MAX) };
        let mut past = Vec::new();
        // What belongs before the middle may stand past it.
        let until = (end.saturating_add(REACH)).min(from.buckets().len());
        for (at, bucket) in from.buckets()[..until].iter().enumerate().skip(start) {
            for slot in bucket.iter().map(|slot| slot.get()).take_while(|&slot| slot != 0) {
                let home = at + 1 - (slot & REACH as u64) as usize;
                if home < start || home >= end {
                    continue;
                }
                let mixed = old.mixed(home, slot);
                let (home, wanted) = self.shape.seat::<S>(mixed);
                let home = home - self.first;
                let reach = self.buckets.len().min(home + REACH);
                let tried = self.buckets[home..reach].iter_mut().enumerate();
                let free = tried
                    .map(|(moved, bucket)| (moved, S::matches(bucket, S::new(0)), bucket))
                    .find(|tried| tried.1 != 0);
                match free {
                    Some((moved, free, bucket)) => {
                        bucket[free.trailing_zeros() as usize % LANES] = S::new(wanted.get() + moved as u64);
                    }
                    None => past.push(self.shape.key(mixed)),
                }
            }
        }
        past
    }

    /// Where the key asked for as number `c` stands, or where it belongs.
    #[inline(always)]
    pub(crate) fn seek(&self, asked: &Asked<S>, c: usize) -> Sought {
        let (home, wanted) = (asked.homes[c % ROOM] as usize, asked.wanted[c % ROOM]);
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
        Sought::Past
    }

    /// The key asked for as number `c`.
    #[inline(always)]
    pub(crate) fn key(&self, asked: &Asked<S>, c: usize) -> u64 {
        let home = self.first + asked.homes[c % ROOM] as usize;
        self.shape.key(self.shape.mixed(home, asked.wanted[c % ROOM].get()))
    }

    /// Puts the key asked for as number `c` where it belongs.
    #[inline(always)]
    pub(crate) fn take(&mut self, asked: &Asked<S>, c: usize, (bucket, slot): (usize, usize)) {
        let moved = bucket - asked.homes[c % ROOM] as usize;
        self.buckets[bucket][slot] = S::new(asked.wanted[c % ROOM].get() + moved as u64);
    }
}

#[cfg(test)]
mod tests {
    use super::super::Place;
    use super::*;

    #[test]
    fn two_threads_grow_the_table_that_one_grows() {
        for (bits, count) in [(16, 60_000_u64), (30, 50_000), (44, 50_000)] {
            let memory = Memory::new(1 << 28);
            let mut table = Exact::<u64>::new(bits, &memory).expect("fits");
            let mut asked = Asked::new();
            let keys = || (0..count).map(|i| i.wrapping_mul(0x1234_5677_9abc_def1) & ((1 << bits) - 1));
            let mut distinct = 0;
            for (i, key) in keys().enumerate() {
                let count = || {
                    distinct += 1;
                    Ok(())
                };
                table.put(&mut asked, key, &memory, count).expect("fits");
                if i % 10_000 == 5000 {
                    table.grow_by_two(&mut asked, &memory).expect("fits");
                }
            }
            assert_eq!(table.len, distinct);
            assert!(keys().all(|key| matches!(table.place(key), Place::Known(_))));
            assert_eq!(memory.used(), Exact::<u64>::bytes(table.shape));
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
