//! Growth without a second table: keys move to later buckets of the same region, the last first.
//!
//! The region reserves at once all that the budget allows, which takes no memory where nothing was written. Buckets are
//! in the order of the mixed keys, and a larger table has each of them a third or a half further on; so from the end
//! backwards every key finds its bucket among those that were emptied before it. Only the first buckets, where a third
//! is less than a key may have moved, are taken out together.
//!
//! Such a table may also be filled further than one that is copied, to nine tenths: it is for those who have no memory
//! left.

use super::{Asked, Exact, ROOM};
use crate::budget::{Memory, Stop, Watch};
use crate::region::{Region, write_first};
use crate::seat::{LANES, REACH, Shape, Slot};

/// Buckets from which the next larger table has each of their keys in a later bucket: a third of it is more than
/// `REACH`.
const FIRST: usize = 4 * (REACH + 1);

impl<S: Slot> Exact<S> {
    /// No keys of so many bits, and room to grow into.
    pub(crate) fn reserving(bits: u32, memory: &Memory) -> Result<Self, Stop> {
        let shape = Self::least(bits).numbered()?;
        memory.claim(Self::bytes(shape))?;
        let mut bytes = memory.limit().max(Self::bytes(shape));
        loop {
            if let Some(slots) = Region::zeroed(bytes / size_of::<S>() / LANES * LANES) {
                return Ok(Exact { slots, shape, len: 0 });
            }
            if bytes == Self::bytes(shape) {
                memory.release(bytes);
                return Err(Stop::Memory);
            }
            bytes = (bytes / 2).max(Self::bytes(shape));
        }
    }

    /// How many keys there are.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Puts what was asked for into the set, and tells the numbers of those that are new.
    #[inline(always)]
    pub(crate) fn put_all(
        &mut self,
        asked: &mut Asked<S>,
        memory: &Memory,
        watch: &mut Watch<'_>,
        mut new: impl FnMut(usize) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        let (mut done, open) = (0, self.first_look(asked));
        loop {
            self.insert(asked, &mut done, open, &mut new)?;
            if done == open {
                break;
            }
            let before = self.shape;
            self.grow_in_place(memory, watch)?;
            self.ask_again(asked, before);
        }
        asked.count = 0;
        while 10 * (self.len + ROOM) > 9 * LANES * self.shape.buckets as usize {
            self.grow_in_place(memory, watch)?;
        }
        Ok(())
    }

    /// Takes more buckets of the region. An end of time leaves the set without some of its keys.
    #[cold]
    fn grow_in_place(&mut self, memory: &Memory, watch: &mut Watch<'_>) -> Result<(), Stop> {
        let mut homeless = Vec::new();
        loop {
            let (old, shape) = (self.shape, self.shape.larger()?);
            if Self::bytes(shape) > size_of_val(self.slots.all()) {
                return Err(Stop::Memory);
            }
            memory.claim(Self::bytes(shape) - Self::bytes(old))?;
            let slots = |shape| Self::bytes(shape) / size_of::<S>();
            write_first(&mut self.slots.all_mut()[slots(old)..slots(shape)]);
            self.shape = shape;
            homeless = self.move_up(old, homeless, watch)?;
            if homeless.is_empty() {
                return Ok(());
            }
        }
    }

    /// Moves all keys to where they belong now, and puts some mixed keys beside them; gives back those that find all
    /// buckets full.
    fn move_up(&mut self, old: Shape, more: Vec<u64>, watch: &mut Watch<'_>) -> Result<Vec<u64>, Stop> {
        let (shape, mut homeless) = (self.shape, Vec::new());
        let buckets: &mut [[S; LANES]] = self.slots.all_mut().as_chunks_mut().0;
        let end = old.buckets as usize + REACH;
        let mixed_at = |at: usize, slot: u64| old.mixed(at + 1 - (slot & REACH as u64) as usize, slot);
        for at in (FIRST.min(end)..end).rev() {
            let bucket = std::mem::replace(&mut buckets[at], [S::new(0); LANES]);
            for slot in bucket.iter().map(|slot| slot.get()).take_while(|&slot| slot != 0) {
                let mixed = mixed_at(at, slot);
                if !seat(shape, buckets, mixed) {
                    homeless.push(mixed);
                }
            }
            watch.tick(1)?;
        }
        let mut first = more;
        for (at, bucket) in buckets[..FIRST.min(end)].iter_mut().enumerate() {
            let slots = bucket.iter().map(|slot| slot.get()).take_while(|&slot| slot != 0);
            first.extend(slots.map(|slot| mixed_at(at, slot)));
            *bucket = [S::new(0); LANES];
        }
        homeless.extend(first.into_iter().filter(|&mixed| !seat(shape, buckets, mixed)));
        Ok(homeless)
    }
}

/// Puts a mixed key where it belongs; false where all buckets that would be tried for it are full.
#[inline(always)]
fn seat<S: Slot>(shape: Shape, buckets: &mut [[S; LANES]], mixed: u64) -> bool {
    let (home, wanted) = shape.seat::<S>(mixed);
    for (moved, bucket) in buckets[home..home + REACH].iter_mut().enumerate() {
        let free = S::matches(bucket, S::new(0));
        if free != 0 {
            bucket[free.trailing_zeros() as usize % LANES] = S::new(wanted.get() + moved as u64);
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;

    fn put(table: &mut Exact<u32>, asked: &mut Asked<u32>, key: u64, memory: &Memory) -> Result<bool, Stop> {
        let (mut new, mut poll) = (false, unwatched);
        table.ask(asked, 1, |_| key, |_, _| ());
        table.put_all(asked, memory, &mut Watch::new(None, &mut poll), |_| {
            new = true;
            Ok(())
        })?;
        Ok(new)
    }

    #[test]
    fn a_table_that_grows_in_place_keeps_every_key_and_takes_no_other() {
        for (bits, count) in [(16, 1 << 16), (30, 60_000_u64), (33, 50_000)] {
            let memory = Memory::new(1 << 24);
            let mut table = Exact::<u32>::reserving(bits, &memory).expect("fits");
            let mut asked = Asked::new();
            let key = |i: u64| i.wrapping_mul(0x1234_5677_9abc_def1) & ((1 << bits) - 1);
            for i in 0..count {
                assert_eq!(put(&mut table, &mut asked, key(i), &memory), Ok(true));
            }
            assert!((0..count).all(|i| table.has(key(i))));
            assert!((count..2 * count).all(|i| bits == 16 || !table.has(key(i))));
            assert_eq!((table.len(), memory.used()), (count as usize, Exact::<u32>::bytes(table.shape)));
        }
    }

    #[test]
    fn the_end_of_memory_is_an_end() {
        let memory = Memory::new(1 << 16);
        let mut table = Exact::<u32>::reserving(20, &memory).expect("fits");
        let mut asked = Asked::new();
        let end = (0..1 << 20).find_map(|key| put(&mut table, &mut asked, key, &memory).err());
        assert_eq!(end, Some(Stop::Memory));
        assert!(memory.used() <= 1 << 16 && table.len() > 8000);
    }
}
