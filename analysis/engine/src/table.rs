//! The set of markings: an append-only array of them (`store.rs`), and a hash table of 32-bit indexes into it.
//!
//! The table holds 4 bytes a slot, open addressing with linear probing. A slot
//! of a table of 2^b slots keeps the index in its low b bits and, in the bits that are left, a tag of the hash: most
//! probes of another marking end at the tag without touching the array (at 2^24 slots one in 256 does).
//!
//! Rejected: the standard hash set (a copy of each marking, no index, 58-173 ns an edge in a prototype); markings
//! inline in the table (one cache miss less on a hit at one word, but 8 bytes a slot more, and no index for the graph
//! methods). Look-ups come in batches: first all slots of a batch are read, then the markings they point to are
//! compared, and only what that leaves open is inserted, in order: the cache misses overlap without any prefetch
//! instruction, and the usual case, a known marking in its first slot, never enters the probing loop.

use crate::budget::{Memory, Stop};
use crate::marking::{Width, linear_hash, mix};
use crate::store::Store;

/// A batch of markings on their way into the table.
#[derive(Debug, Default)]
pub struct Candidates {
    /// Linear hashes.
    hashes: Vec<u64>,
    /// Markings, end to end.
    markings: Vec<u64>,
    /// The first slot of each, as it was when the batch began.
    slots: Vec<u32>,
    /// The candidates not found in their first slot.
    open: Vec<u32>,
}

/// Stands for "no marking" where an index is stored.
pub const NONE: u32 = u32::MAX;

/// Candidates that wait before they are inserted together.
const BATCH: usize = 128;

impl Candidates {
    /// Room for one batch.
    pub fn new(words: usize) -> Self {
        Candidates {
            hashes: Vec::with_capacity(BATCH),
            markings: Vec::with_capacity(BATCH * words),
            slots: Vec::with_capacity(BATCH),
            open: Vec::with_capacity(BATCH),
        }
    }

    /// Adds `from ^ flip`; true when the batch should be inserted.
    #[inline(always)]
    pub fn push<W: Width>(&mut self, width: W, from: &[u64], flip: &[u64], hash: u64) -> bool {
        self.hashes.push(hash);
        for k in 0..width.words() {
            self.markings.push(from[k] ^ flip[k]);
        }
        self.hashes.len() >= BATCH
    }
}

/// The array and its index.
#[derive(Debug)]
pub struct Table {
    /// The markings, by index.
    pub store: Store,
    slots: Vec<u32>,
    /// The table has 2^log2 slots.
    log2: u32,
}

impl Table {
    /// An empty set of markings of so many words.
    pub fn new(words: usize, memory: &Memory) -> Result<Self, Stop> {
        const FIRST_LOG2: u32 = 6;
        Ok(Table { store: Store::new(words), slots: memory.filled(0, 1 << FIRST_LOG2)?, log2: FIRST_LOG2 })
    }

    #[inline(always)]
    fn home(&self, mixed: u64) -> usize {
        (mixed >> (64 - self.log2)) as usize
    }

    #[inline(always)]
    fn index_mask(&self) -> u64 {
        (1 << self.log2) - 1
    }

    /// The tag of a hash, in the place where a slot keeps it.
    #[inline(always)]
    fn tag(&self, mixed: u64) -> u64 {
        (mixed << self.log2) & 0xffff_ffff
    }

    /// The index of a marking, or the slot where it belongs.
    #[inline(always)]
    fn probe<W: Width>(&self, width: W, marking: &[u64], mixed: u64) -> Result<u32, usize> {
        let marking = &marking[..width.words()];
        let tag = self.tag(mixed);
        let mut at = self.home(mixed);
        loop {
            let slot = u64::from(self.slots[at]);
            if slot == 0 {
                return Err(at);
            }
            if slot & !self.index_mask() == tag {
                let index = (slot & self.index_mask()) as usize - 1;
                if self.store.get(width, index) == marking {
                    return Ok(index as u32);
                }
            }
            at = (at + 1) & (self.slots.len() - 1);
        }
    }

    /// The index of a marking, if it is in the set.
    #[inline]
    pub fn find<W: Width>(&self, width: W, marking: &[u64], hash: u64) -> Option<u32> {
        self.probe(width, marking, mix(hash)).ok()
    }

    /// Inserts a marking with its linear hash; true if it is new. More than `max` markings are refused.
    #[inline(always)]
    pub fn insert<W: Width>(
        &mut self,
        width: W,
        marking: &[u64],
        hash: u64,
        max: usize,
        memory: &Memory,
    ) -> Result<bool, Stop> {
        let mixed = mix(hash);
        let Err(mut at) = self.probe(width, marking, mixed) else { return Ok(false) };
        let index = self.store.len();
        if index >= max {
            return Err(Stop::Markings);
        }
        // At most three quarters full: the index plus one then always fits below the tag.
        if 4 * (index + 1) > 3 * self.slots.len() {
            self.grow(width, memory)?;
            at = match self.probe(width, marking, mixed) {
                Err(at) => at,
                Ok(_) => return Ok(false),
            };
        }
        self.store.push(marking, memory)?;
        self.slots[at] = (self.tag(mixed) | (index as u64 + 1)) as u32;
        Ok(true)
    }

    /// Inserts a batch in its order and empties it.
    #[inline(always)]
    pub fn insert_batch<W: Width>(
        &mut self,
        width: W,
        batch: &mut Candidates,
        max: usize,
        memory: &Memory,
    ) -> Result<(), Stop> {
        let Candidates { hashes, markings, slots, open } = batch;
        slots.clear();
        for &hash in hashes.iter() {
            slots.push(self.slots[self.home(mix(hash))]);
        }
        // Most markings are known and stand in their first slot: they end here, without a branch to mispredict.
        let mut count = 0;
        open.resize(slots.len(), 0);
        for (c, (&slot, &hash)) in slots.iter().zip(hashes.iter()).enumerate() {
            let slot = u64::from(slot);
            let known = if slot & !self.index_mask() == self.tag(mix(hash)) && slot != 0 {
                let index = (slot & self.index_mask()) as usize - 1;
                let words = width.words();
                self.store.get(width, index) == &markings[c * words..(c + 1) * words]
            } else {
                false
            };
            open[count] = c as u32;
            count += usize::from(!known);
        }
        for &c in &open[..count] {
            let (c, words) = (c as usize, width.words());
            self.insert(width, &markings[c * words..(c + 1) * words], hashes[c], max, memory)?;
        }
        hashes.clear();
        markings.clear();
        Ok(())
    }

    /// The indexes of a batch in its order, `NONE` for those not in the set; empties the batch.
    #[inline(always)]
    pub fn find_batch<W: Width>(&self, width: W, batch: &mut Candidates, found: &mut Vec<u32>) {
        let Candidates { hashes, markings, slots, open } = batch;
        let words = width.words();
        slots.clear();
        for &hash in hashes.iter() {
            slots.push(self.slots[self.home(mix(hash))]);
        }
        let mut count = 0;
        open.resize(slots.len(), 0);
        found.clear();
        for (c, (&slot, &hash)) in slots.iter().zip(hashes.iter()).enumerate() {
            let slot = u64::from(slot);
            let index = (slot & self.index_mask()).wrapping_sub(1) as u32;
            let known = slot & !self.index_mask() == self.tag(mix(hash))
                && slot != 0
                && self.store.get(width, index as usize) == &markings[c * words..(c + 1) * words];
            found.push(if known { index } else { NONE });
            open[count] = c as u32;
            count += usize::from(!known && slot != 0);
        }
        for &c in &open[..count] {
            let c = c as usize;
            if let Some(index) = self.find(width, &markings[c * words..(c + 1) * words], hashes[c]) {
                found[c] = index;
            }
        }
        hashes.clear();
        markings.clear();
    }

    /// Doubles the slots and files every marking again.
    #[cold]
    fn grow<W: Width>(&mut self, width: W, memory: &Memory) -> Result<(), Stop> {
        if self.log2 == 32 {
            return Err(Stop::Memory);
        }
        let old = self.slots.len();
        let slots = memory.filled(0, 2 * old)?;
        self.slots = slots;
        memory.release(4 * old);
        self.log2 += 1;
        let mask = self.slots.len() - 1;
        for index in 0..self.store.len() {
            let mixed = mix(linear_hash(width, self.store.get(width, index)));
            let mut at = self.home(mixed);
            while self.slots[at] != 0 {
                at = (at + 1) & mask;
            }
            self.slots[at] = (self.tag(mixed) | (index as u64 + 1)) as u32;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::marking::{Dynamic, Fixed};

    fn filled(words: usize, count: u64, memory: &Memory) -> Table {
        let width = Dynamic(words);
        let mut table = Table::new(words, memory).expect("fits");
        for i in 0..count {
            let marking: Vec<u64> = (0..words as u64).map(|k| i * (k + 1)).collect();
            let hash = linear_hash(width, &marking);
            assert_eq!(table.insert(width, &marking, hash, usize::MAX, memory), Ok(true));
            assert_eq!(table.insert(width, &marking, hash, usize::MAX, memory), Ok(false));
        }
        table
    }

    #[test]
    fn every_marking_is_found_at_its_index_after_growth_and_over_chunks() {
        for words in [1, 2, 5, 300] {
            let count = 3000;
            let memory = Memory::new(1 << 30);
            let table = filled(words, count, &memory);
            for i in 0..count {
                let marking: Vec<u64> = (0..words as u64).map(|k| i * (k + 1)).collect();
                let hash = linear_hash(Dynamic(words), &marking);
                assert_eq!(table.find(Dynamic(words), &marking, hash), Some(i as u32));
            }
            let absent = vec![count + 1; words];
            assert_eq!(table.find(Dynamic(words), &absent, linear_hash(Dynamic(words), &absent)), None);
            let mut all = Vec::new();
            table.store.copy_range(5, 2900, &mut all);
            assert_eq!(all.len(), words * 2895);
            assert_eq!(all[0], 5);
        }
    }

    #[test]
    fn memory_that_is_not_there_is_a_return_value() {
        let memory = Memory::new(20_000);
        let width = Fixed::<1>;
        let mut table = Table::new(1, &memory).expect("fits");
        let stop = (0..1_000_000_u64).find_map(|i| table.insert(width, &[i], i, usize::MAX, &memory).err());
        assert_eq!(stop, Some(Stop::Memory));
        assert!(memory.used() <= 20_000);
        assert!(table.store.len() > 200);
        assert_eq!(table.find(width, &[17], 17), Some(17));
    }

    #[test]
    fn one_marking_too_many_is_refused() {
        let memory = Memory::new(1 << 20);
        let mut table = Table::new(1, &memory).expect("fits");
        assert_eq!(table.insert(Fixed::<1>, &[1], 1, 1, &memory), Ok(true));
        assert_eq!(table.insert(Fixed::<1>, &[1], 1, 1, &memory), Ok(false));
        assert_eq!(table.insert(Fixed::<1>, &[2], 2, 1, &memory), Err(Stop::Markings));
        assert_eq!(table.store.len(), 1);
    }

    #[test]
    fn markings_of_one_hash_stay_apart() {
        let memory = Memory::new(1 << 20);
        let mut table = Table::new(2, &memory).expect("fits");
        let mut batch = Candidates::new(2);
        for round in 0..2 {
            for i in 0..40_u64 {
                assert!(!batch.push(Fixed::<2>, &[i, 0], &[0, 7], 5));
            }
            table.insert_batch(Fixed::<2>, &mut batch, usize::MAX, &memory).expect("fits");
            assert_eq!(table.store.len(), 40, "after round {round}");
        }
        for i in 0..40_u64 {
            assert_eq!(table.find(Fixed::<2>, &[i, 7], 5), Some(i as u32));
        }
        assert_eq!(table.find(Fixed::<2>, &[40, 7], 5), None);
    }
}
