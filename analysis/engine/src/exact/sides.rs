//! A table of keys cut in two by some linear function of the keys, and two tables put together, each by two threads.
//!
//! Buckets are in the order of the mixed keys, so both are what growth is: old tables are read and new ones written from end
//! to end. Whoever takes a side reads all of the old table and leaves out the keys of the other. Of a joint table each
//! thread fills half of the buckets, by the highest bit of the mixed key, from the same half of both tables; what has to move
//! past the end of the lower half, a handful of keys, is put into it when both are full.

use std::panic::resume_unwind;
use std::thread;

use super::{Asked, Exact, Filling, Moving, Place};
use crate::budget::{Memory, Stop, Watch};
use crate::seat::{LANES, REACH, Shape, Slot};

impl<S: Slot> Exact<S> {
    /// The bytes claimed for it.
    pub(crate) fn claimed(&self) -> usize {
        Self::bytes(self.shape)
    }

    /// Takes twice as many buckets, or more while they are few.
    pub(crate) fn double(&mut self, memory: &Memory, watch: &mut Watch<'_>) -> Result<(), Stop> {
        self.grow_beyond(self.shape.larger()?, memory, watch)
    }

    /// How many of its slots are taken, as a part of 1.
    pub(crate) fn fullness(&self) -> f64 {
        self.len as f64 / (LANES * self.shape.buckets as usize) as f64
    }

    /// The buckets that so many keys take, put in one after the other.
    fn roomy(bits: u32, len: usize) -> Result<Shape, Stop> {
        let mut shape = Self::least(bits).numbered()?;
        while Self::is_filled(shape, len) {
            shape = shape.roomier()?;
        }
        Ok(shape)
    }

    /// The keys of one side, in a table that has room for about as many more; the other side's are left out.
    pub(crate) fn side(
        &self,
        is_here: impl Fn(u64) -> bool,
        memory: &Memory,
        watch: &mut Watch<'_>,
    ) -> Result<Self, Stop> {
        let mut shape = Self::roomy(self.shape.bits, self.len)?;
        loop {
            let mut room = Self::room(shape, memory)?;
            let buckets = room.all_mut().as_chunks_mut().0;
            let mut len = 0;
            let filled = memory.filled(0, buckets.len()).and_then(|mut taken| {
                let filled = self.refill(shape, Filling::new(buckets, &mut taken), watch, |key| {
                    let here = is_here(shape.unmixed(key));
                    len += usize::from(here);
                    here
                });
                memory.release(taken.len());
                filled
            });
            if filled == Ok(true) {
                return Ok(Exact { slots: room, shape, len });
            }
            memory.release(Self::bytes(shape));
            filled?;
            shape = shape.roomier()?;
        }
    }

    /// The keys of two tables that have none in common.
    pub(crate) fn joint(of: [&Self; 2], memory: &Memory) -> Result<Self, Stop> {
        let len = of[0].len + of[1].len;
        let mut shape = Self::roomy(of[0].shape.bits, len)?;
        loop {
            let slots = Self::room(shape, memory)?;
            let mut joint = Exact { slots, shape, len };
            let taken = memory.filled(0, shape.buckets as usize + REACH);
            let filled = taken.map(|mut taken| {
                let past = joint.fill_by_two(of, &mut taken);
                memory.release(taken.len());
                past.into_iter().all(|key| joint.place(key))
            });
            if filled == Ok(true) {
                return Ok(joint);
            }
            memory.release(Self::bytes(shape));
            filled?;
            shape = shape.roomier()?;
        }
    }

    /// Holds these keys and no others, which are not more than it held; what it held, where the system has no memory for them.
    pub(crate) fn replace_by<I: Iterator<Item = u64>>(&mut self, keys: impl Fn() -> I, len: usize, memory: &Memory) {
        memory.release(self.claimed());
        let mut shape = Self::roomy(self.shape.bits, len);
        while let Ok(next) = shape
            && let Ok(slots) = Self::room(next, memory)
        {
            let mut these = Exact { slots, shape: next, len };
            if keys().all(|key| these.place(key)) {
                *self = these;
                return;
            }
            memory.release(these.claimed());
            shape = next.roomier();
        }
        memory.claim(self.claimed()).expect("released just now");
    }

    /// Fills the table, which is empty, by two threads; gives back what found no place.
    fn fill_by_two(&mut self, of: [&Self; 2], taken: &mut [u8]) -> Vec<u64> {
        let (shape, middle) = (self.shape, self.shape.buckets as usize / 2);
        let buckets: &mut [[S; LANES]] = self.slots.all_mut().as_chunks_mut().0;
        let (low, high) = buckets.split_at_mut(middle);
        let (taken_low, taken_high) = taken.split_at_mut(middle);
        let (mut past, others) = thread::scope(|scope| {
            let work = move || fill_half(shape, 1, Filling::new(high, taken_high), of);
            let other = thread::Builder::new().spawn_scoped(scope, work);
            let past = fill_half(shape, 0, Filling::new(low, taken_low), of);
            (past, other.ok().map(|other| other.join().unwrap_or_else(|panic| resume_unwind(panic))))
        });
        // Where the system has no thread to give, all is done here.
        past.extend(
            others
                .unwrap_or_else(|| fill_half(shape, 1, Filling::new(&mut buckets[middle..], &mut taken[middle..]), of)),
        );
        past
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

    /// Puts a key, which is counted already, where it belongs; false where all buckets that would be tried are full.
    fn place(&mut self, key: u64) -> bool {
        let (home, wanted) = self.shape.seat::<S>(self.shape.mix(key));
        let buckets: &mut [[S; LANES]] = self.slots.all_mut().as_chunks_mut().0;
        let place = Self::place_of(buckets, home, wanted);
        if let Place::Free((bucket, slot)) = place {
            buckets[bucket][slot] = S::new(wanted.get() + (bucket - home) as u64);
        }
        place != Place::Full
    }
}

/// Puts those keys of two tables that belong to one half of the buckets of a third into it; gives back what finds no place
/// there.
fn fill_half<S: Slot>(shape: Shape, id: usize, mut filling: Filling<'_, S>, of: [&Exact<S>; 2]) -> Vec<u64> {
    let (first, mut past) = (id * shape.buckets as usize / 2, Vec::new());
    for from in of {
        let (old, middle, buckets) = (from.shape, from.shape.buckets as usize / 2, from.buckets());
        let homes = if id == 0 { 0..middle } else { middle..usize::MAX };
        // What belongs before the middle may stand past it.
        let until = homes.end.saturating_add(REACH).min(buckets.len());
        let mut moving = Moving::new();
        for (at, bucket) in buckets[..until].iter().enumerate().skip(homes.start) {
            moving.take(old, at, bucket, homes.clone());
            moving.leave(at + 1 == until, |product| {
                let key = old.key_of(product);
                let (home, wanted) = shape.seat_of::<S>(key);
                if !filling.take(home - first, wanted) {
                    past.push(shape.unmixed(key));
                }
            });
        }
    }
    past
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;

    fn table<S: Slot>(bits: u32, keys: impl Iterator<Item = u64>, memory: &Memory) -> Exact<S> {
        let (mut asked, mut poll) = (Asked::new(), unwatched);
        let mut watch = Watch::new(None, &mut poll);
        let mut table = Exact::new(bits, memory).expect("fits");
        for key in keys {
            table.put(&mut asked, key, (memory, &mut watch), || Ok(())).expect("fits");
        }
        table
    }

    fn sides<S: Slot>(table: &Exact<S>, is_here: impl Fn(u64) -> bool, memory: &Memory) -> [Exact<S>; 2] {
        [false, true].map(|side| {
            let mut poll = unwatched;
            table.side(|key| is_here(key) == side, memory, &mut Watch::new(None, &mut poll)).expect("fits")
        })
    }

    fn is_cut_and_joint<S: Slot>(bits: u32, keys: &[u64]) {
        let memory = Memory::new(1 << 28);
        let whole = table::<S>(bits, keys.iter().copied(), &memory);
        for mask in [0, 1, 0b1011, (1 << (bits - 1)) | 4] {
            let is_here = |key: u64| (key & mask).count_ones() % 2 == 1;
            let held = memory.used();
            let [even, odd] = sides(&whole, is_here, &memory);
            assert_eq!(memory.used(), held + even.claimed() + odd.claimed());
            assert_eq!(even.len() + odd.len(), whole.len());
            assert!(keys.iter().all(|&key| odd.has(key) == is_here(key) && even.has(key) != is_here(key)));
            for of in [[&even, &odd], [&odd, &even]] {
                let joint = Exact::joint(of, &memory).expect("fits");
                assert_eq!(joint.len(), whole.len());
                assert!(keys.iter().all(|&key| joint.has(key)));
                assert!((0..1000).all(|key| joint.has(key) == whole.has(key)));
                memory.release(joint.claimed());
            }
            memory.release(even.claimed() + odd.claimed());
        }
    }

    #[test]
    fn a_table_cut_in_two_and_put_together_holds_the_same_keys() {
        for (bits, count) in [(16, 10_000_u64), (30, 6_000), (44, 6_000), (60, 6_000)] {
            let keys: Vec<u64> =
                (0..count).map(|i| i.wrapping_mul(0x1234_5677_9abc_def1) & ((1 << bits) - 1)).collect();
            is_cut_and_joint::<u64>(bits, &keys);
            if bits < 32 {
                is_cut_and_joint::<u32>(bits, &keys);
            }
        }
    }

    #[test]
    fn keys_that_crowd_the_middle_are_all_there() {
        // Neighbours in the order of the mixed keys, most of them before the middle.
        let shape = Shape::new(20, 2, 5);
        let keys: Vec<u64> = ((1 << 19) - 450..(1 << 19) + 50).map(|mixed: u64| shape.unmixed(mixed)).collect();
        is_cut_and_joint::<u64>(20, &keys);
    }

    #[test]
    fn a_table_that_is_replaced_holds_the_new_keys_alone() {
        let memory = Memory::new(1 << 28);
        let mut whole = table::<u32>(24, 0..30_000, &memory);
        whole.replace_by(|| (0..30_000).step_by(3), 10_000, &memory);
        assert_eq!((whole.len(), memory.used()), (10_000, whole.claimed()));
        assert!((0..60_000).all(|key| whole.has(key) == (key < 30_000 && key % 3 == 0)));
    }

    #[test]
    fn without_memory_nothing_is_claimed_and_the_tables_are_as_before() {
        let memory = Memory::new(1 << 28);
        let keys = || (0..20_000_u64).map(|i| i.wrapping_mul(0x1234_5677_9abc_def1) & ((1 << 40) - 1));
        let whole = table::<u64>(40, keys(), &memory);
        let [even, odd] = sides(&whole, |key| key % 2 == 1, &memory);
        for limit in [0, 1 << 12, 1 << 17] {
            let small = Memory::new(limit);
            let mut poll = unwatched;
            let cut = whole.side(|key| key % 2 == 1, &small, &mut Watch::new(None, &mut poll));
            assert_eq!((cut.err(), small.used()), (Some(Stop::Memory), 0));
            assert_eq!((Exact::joint([&even, &odd], &small).err(), small.used()), (Some(Stop::Memory), 0));
        }
        assert!(keys().all(|key| even.has(key) != odd.has(key)));
    }
}
