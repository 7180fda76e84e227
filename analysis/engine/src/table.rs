//! The set of markings: an append-only array of them (`store.rs`), and a hash table of 32-bit indexes into it.
//!
//! The table holds 4 bytes a slot, open addressing with linear probing. A slot of a table of 2^b slots keeps the index
//! plus one in its low b bits and, in the bits that are left, a tag of the hash: most probes of another marking end at
//! the tag without touching the array (at 2^24 slots one in 256 does).
//!
//! Look-ups come in batches (`table/candidates.rs`); what is new is inserted one by one.
//!
//! Rejected: the standard hash set (a copy of each marking, no index, 58-173 ns an edge in a prototype); markings
//! inline in the table (one cache miss less on a hit at one word, but 8 bytes a slot more, and no index for the graph
//! methods); buckets that grow one by one (each look-up would ask which ones have).

mod candidates;

use crate::budget::{Memory, Stop, Watch};
use crate::marking::{Width, linear_hash, mix};
use crate::region::{Region, write_first};
use crate::store::Store;

pub use candidates::Candidates;

/// Stands for "no marking" where an index is stored. So there are at most 2^32 - 1 markings.
pub const NONE: u32 = u32::MAX;

/// The array and its index.
#[derive(Debug)]
pub struct Table {
    /// The markings, by index.
    pub store: Store,
    slots: Region<u32>,
    /// The table has 2^log2 slots.
    log2: u32,
}

/// Where hashes go in a table of 2^log2 slots, and what a slot says.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    shift: u32,
    log2: u32,
    index: u32,
}

impl Shape {
    fn new(log2: u32) -> Self {
        Shape { shift: 64 - log2, log2, index: ((1_u64 << log2) - 1) as u32 }
    }

    /// The first slot of a mixed hash.
    #[inline(always)]
    pub(crate) fn home(self, mixed: u64) -> usize {
        (mixed >> self.shift) as usize
    }

    /// What stands in the slot of an index.
    #[inline(always)]
    pub(crate) fn slot(self, mixed: u64, index: usize) -> u32 {
        (self.tag(mixed) & !self.index) | (index as u32 + 1)
    }

    /// The same slot with another index.
    #[inline(always)]
    pub(crate) fn renumbered(self, slot: u32, index: usize) -> u32 {
        (slot & !self.index) | (index as u32 + 1)
    }

    /// Whether a slot is taken and has the tag of a hash.
    #[inline(always)]
    pub(crate) fn fits(self, slot: u32, mixed: u64) -> bool {
        ((slot ^ self.tag(mixed)) & !self.index == 0) & (slot != 0)
    }

    /// The index that a taken slot says.
    #[inline(always)]
    pub(crate) fn index_in(self, slot: u32) -> usize {
        ((slot & self.index) - 1) as usize
    }

    /// Whether an index fits below the tag.
    #[inline(always)]
    pub(crate) fn numbers(self, index: usize) -> bool {
        index < self.index as usize
    }

    /// The tag of a hash, in the place where a slot keeps it.
    #[inline(always)]
    fn tag(self, mixed: u64) -> u32 {
        (mixed << self.log2) as u32
    }
}

/// Slots that are to be a table's.
pub(crate) struct Slots {
    all: Region<u32>,
    log2: u32,
}

impl Slots {
    /// What they say.
    pub(crate) fn shape(&self) -> Shape {
        Shape::new(self.log2)
    }

    /// All of them.
    pub(crate) fn all_mut(&mut self) -> &mut [u32] {
        self.all.all_mut()
    }
}

impl Table {
    /// An empty set of markings of so many words.
    pub fn new(words: usize, memory: &Memory) -> Result<Self, Stop> {
        const FIRST_LOG2: u32 = 6;
        memory.claim(4 << FIRST_LOG2)?;
        let slots = Region::zeroed(1 << FIRST_LOG2).ok_or(Stop::Memory)?;
        Ok(Table { store: Store::new(words), slots, log2: FIRST_LOG2 })
    }

    #[inline(always)]
    fn shape(&self) -> Shape {
        Shape::new(self.log2)
    }

    /// The index of a marking, or the slot where it belongs.
    #[inline(always)]
    fn probe<W: Width>(&self, width: W, marking: &[u64], mixed: u64) -> Result<u32, usize> {
        let words = width.words();
        let marking = &marking[..words];
        let (shape, slots, all) = (self.shape(), self.slots.all(), self.store.all());
        let tag = shape.tag(mixed);
        let mut at = shape.home(mixed);
        loop {
            let slot = slots[at];
            if slot == 0 {
                return Err(at);
            }
            if (slot ^ tag) & !shape.index == 0 {
                let index = ((slot & shape.index) - 1) as usize;
                if &all[index * words..(index + 1) * words] == marking {
                    return Ok(index as u32);
                }
            }
            at = (at + 1) & (slots.len() - 1);
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
        self.insert_mixed(width, marking, mix(hash), max, memory)
    }

    /// The same with the mixed hash.
    #[inline(always)]
    pub(crate) fn insert_mixed<W: Width>(
        &mut self,
        width: W,
        marking: &[u64],
        mixed: u64,
        max: usize,
        memory: &Memory,
    ) -> Result<bool, Stop> {
        let Err(mut at) = self.probe(width, marking, mixed) else { return Ok(false) };
        let index = self.store.len();
        if index >= max {
            return Err(Stop::Markings);
        }
        // At most three quarters full: the index plus one then always fits below the tag.
        if index >= 3 << (self.log2 - 2) {
            self.grow(width, memory, &mut |_| Ok(()))?;
            at = match self.probe(width, marking, mixed) {
                Err(at) => at,
                Ok(_) => return Ok(false),
            };
        }
        self.store.push(width, marking, max, memory)?;
        let shape = self.shape();
        self.slots.all_mut()[at] = (shape.tag(mixed) & !shape.index) | (index as u32 + 1);
        Ok(true)
    }

    /// Makes room for so many markings more, as long as there is time: growing by itself, an insertion asks nobody.
    #[inline(always)]
    pub fn make_room<W: Width>(
        &mut self,
        width: W,
        more: usize,
        memory: &Memory,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        while self.store.len() + more > 3 << (self.log2 - 2) {
            self.grow(width, memory, &mut |work| watch.tick(work))?;
        }
        Ok(())
    }

    /// Doubles the slots and files every marking again; where that ends early, the table is what it was.
    #[cold]
    fn grow<W: Width>(
        &mut self,
        width: W,
        memory: &Memory,
        poll: &mut dyn FnMut(usize) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        const PART: usize = 1 << 12;
        let mut wider = self.wider(memory)?;
        let (shape, slots) = (wider.shape(), wider.all_mut());
        write_first(slots);
        for first in (0..self.store.len()).step_by(PART) {
            for index in first..self.store.len().min(first + PART) {
                file(shape, slots, mix(linear_hash(width, self.store.get(width, index))), index);
            }
            if let Err(stop) = poll(PART) {
                memory.release(8 << self.log2);
                return Err(stop);
            }
        }
        self.replace(wider, memory);
        Ok(())
    }

    /// Twice as many slots, all of them empty, and claimed.
    pub(crate) fn wider(&self, memory: &Memory) -> Result<Slots, Stop> {
        if self.log2 == 32 {
            return Err(Stop::Markings);
        }
        let bytes = 8 << self.log2;
        memory.claim(bytes)?;
        let Some(all) = Region::zeroed(2 << self.log2) else {
            memory.release(bytes);
            return Err(Stop::Memory);
        };
        Ok(Slots { all, log2: self.log2 + 1 })
    }

    /// Takes other slots in the place of its own, which are released.
    pub(crate) fn replace(&mut self, slots: Slots, memory: &Memory) {
        memory.release(4 << self.log2);
        self.slots = slots.all;
        self.log2 = slots.log2;
    }

    /// Files every marking into empty slots.
    fn refile<W: Width>(&mut self, width: W) {
        for index in 0..self.store.len() {
            self.file(mix(linear_hash(width, self.store.get(width, index))), index);
        }
    }

    /// Files again the markings of the array, and nothing else.
    pub(crate) fn forget_others<W: Width>(&mut self, width: W) {
        self.slots.all_mut().fill(0);
        self.refile(width);
    }

    /// Files an index under a mixed hash that no slot has.
    #[inline(always)]
    pub(crate) fn file(&mut self, mixed: u64, index: usize) {
        file(self.shape(), self.slots.all_mut(), mixed, index);
    }

    /// The array, the slots and what these say, to be worked on together.
    pub(crate) fn parts(&mut self) -> (&Store, &mut [u32], Shape) {
        let shape = self.shape();
        (&self.store, self.slots.all_mut(), shape)
    }
}

#[inline(always)]
fn file(shape: Shape, slots: &mut [u32], mixed: u64, index: usize) {
    let mut at = shape.home(mixed);
    while slots[at] != 0 {
        at = (at + 1) & (slots.len() - 1);
    }
    slots[at] = shape.slot(mixed, index);
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
    fn the_end_of_time_ends_growth_and_loses_nothing() {
        let memory = Memory::new(1 << 30);
        let mut table = filled(2, 1000, &memory);
        let (log2, used) = (table.log2, memory.used());
        let mut poll = crate::budget::unwatched;
        let mut watch = Watch::new(Some(std::time::Instant::now()), &mut poll);
        assert_eq!(table.make_room(Dynamic(2), 1 << 20, &memory, &mut watch), Err(Stop::Time));
        assert_eq!((table.log2, memory.used()), (log2, used));
        let found = |i: u64| table.find(Dynamic(2), &[i, 2 * i], linear_hash(Dynamic(2), &[i, 2 * i]));
        assert!((0..1000).all(|i| found(i) == Some(i as u32)) && found(1000).is_none());
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
    fn a_table_that_indexes_cannot_count_is_an_end_and_no_wrong_answer() {
        let memory = Memory::new(usize::MAX);
        let mut table = Table::new(1, &memory).expect("fits");
        table.log2 = 32;
        assert_eq!(table.grow(Fixed::<1>, &memory, &mut |_| Ok(())), Err(Stop::Markings));
        // The fullest table of 2^32 slots: its last index plus one is an index still, and none is `NONE`.
        assert!((3_u64 << 30) < u64::from(NONE));
    }

    #[test]
    fn a_store_keeps_its_markings_where_it_begins_to_reserve_and_where_it_claims_more() {
        for words in [1, 3] {
            let memory = Memory::new(40 << 20);
            let mut store = Store::new(words);
            let count = (8 << 20) / (8 * words);
            for i in 0..count {
                let marking: Vec<u64> = (0..words).map(|k| (i * words + k) as u64).collect();
                store.push(Dynamic(words), &marking, usize::MAX, &memory).expect("fits");
            }
            assert!(store.all()[..count * words].iter().enumerate().all(|(i, &word)| word == i as u64));
            assert!(memory.used() >= 8 << 20 && memory.used() < 11 << 20);
        }
    }
}
