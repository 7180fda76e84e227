//! Sets of markings as bits, and an agenda: such a set that gives out its members in the order of their indexes.
//!
//! A search that runs against the edges meets markings in any order. Taking them off a stack walks over the array of
//! markings at random; taking the next higher index, round and round, walks along it, and one bit a marking says both
//! what is on the agenda and that it is there once. So that a sparse agenda is not scanned word by word, each word has
//! a bit in a summary, each word of that one in the next (the van Emde Boas layout with a branching of 64).

use crate::budget::{Memory, Stop};

/// A set of indexes below a bound.
#[derive(Debug)]
pub struct Bits(Vec<u64>);

impl Bits {
    /// The empty set; the caller releases `bytes()`.
    pub fn new(len: usize, memory: &Memory) -> Result<Self, Stop> {
        Ok(Bits(memory.filled(0, len.div_ceil(64))?))
    }

    /// The set of the indexes whose byte is not 0.
    pub fn from_bytes(bytes: &[u8], memory: &Memory) -> Result<Self, Stop> {
        let mut all = Bits::new(bytes.len(), memory)?;
        for (word, part) in all.0.iter_mut().zip(bytes.chunks(64)) {
            for (i, &byte) in part.iter().enumerate() {
                *word |= u64::from(byte != 0) << i;
            }
        }
        Ok(all)
    }

    /// One byte for each of `len` indexes.
    pub fn to_bytes(&self, len: usize) -> Vec<u8> {
        (0..len).map(|index| u8::from(self.has(index))).collect()
    }

    /// Whether an index is in the set.
    #[inline(always)]
    pub fn has(&self, index: usize) -> bool {
        self.0[index / 64] >> (index % 64) & 1 != 0
    }

    /// Adds an index; true if it is new.
    #[inline(always)]
    pub fn add(&mut self, index: usize) -> bool {
        let (word, bit) = (&mut self.0[index / 64], 1 << (index % 64));
        let new = *word & bit == 0;
        *word |= bit;
        new
    }

    /// Takes an index out.
    #[inline(always)]
    pub fn remove(&mut self, index: usize) {
        self.0[index / 64] &= !(1 << (index % 64));
    }

    /// The 64 indexes from `64 * word` on.
    #[inline(always)]
    pub fn word(&self, word: usize) -> u64 {
        self.0[word]
    }

    /// How many indexes.
    pub fn count(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// The indexes, ascending.
    pub fn iter(&self) -> impl Iterator<Item = usize> {
        self.0.iter().enumerate().flat_map(|(w, &word)| {
            let mut rest = word;
            std::iter::from_fn(move || {
                let bit = rest.trailing_zeros() as usize;
                rest = rest.checked_sub(1).map(|less| rest & less)?;
                Some(64 * w + bit)
            })
        })
    }

    /// Bytes claimed.
    pub fn bytes(&self) -> usize {
        8 * self.0.len()
    }
}

/// Indexes that wait, given out in ascending order, round and round.
#[derive(Debug)]
pub struct Agenda {
    levels: Vec<Bits>,
    at: usize,
}

impl Agenda {
    /// Nothing waits; the caller releases `bytes()`.
    pub fn new(len: usize, memory: &Memory) -> Result<Self, Stop> {
        let mut levels = vec![Bits::new(len.max(1), memory)?];
        while let Some(words) = levels.last().map(|last| last.0.len()).filter(|&words| words > 1) {
            levels.push(Bits::new(words, memory)?);
        }
        Ok(Agenda { levels, at: 0 })
    }

    /// Adds an index.
    #[inline(always)]
    pub fn add(&mut self, index: usize) {
        let mut index = index;
        for level in &mut self.levels {
            let empty = level.0[index / 64] == 0;
            level.add(index);
            if !empty {
                return;
            }
            index /= 64;
        }
    }

    /// The lowest index that waits from `from` on.
    fn next(&self, from: usize) -> Option<usize> {
        let mut at = from;
        for height in 0..self.levels.len() {
            let found = self.levels[height].0.get(at / 64).map_or(0, |word| word & (!0 << (at % 64)));
            if found != 0 {
                at = at / 64 * 64 + found.trailing_zeros() as usize;
                for level in self.levels[..height].iter().rev() {
                    at = 64 * at + level.0[at].trailing_zeros() as usize;
                }
                return Some(at);
            }
            at = at / 64 + 1;
        }
        None
    }

    /// Moves up to 64 indexes into `taken`; false when none waits.
    pub fn take(&mut self, taken: &mut Vec<u32>) -> bool {
        taken.clear();
        while taken.len() < 64 {
            let Some(index) = self.next(self.at) else {
                if self.at == 0 || !taken.is_empty() {
                    self.at = 0;
                    break;
                }
                self.at = 0;
                continue;
            };
            taken.push(index as u32);
            self.at = index + 1;
            let mut index = index;
            for level in &mut self.levels {
                level.remove(index);
                if level.0[index / 64] != 0 {
                    break;
                }
                index /= 64;
            }
        }
        !taken.is_empty()
    }

    /// Bytes claimed.
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(Bits::bytes).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::marking::mix;

    #[test]
    fn an_agenda_gives_out_each_index_once_and_goes_round() {
        for len in [1_usize, 63, 64, 65, 5000, 300_000] {
            let memory = Memory::new(1 << 20);
            let mut agenda = Agenda::new(len, &memory).expect("fits");
            let mut waiting = std::collections::BTreeSet::new();
            let mut taken = Vec::new();
            let (mut rounds, mut at) = (0, 0);
            for seed in 0..2000_u64 {
                for k in 0..seed % 90 {
                    let index = (mix(seed * 100 + k) % len as u64) as usize;
                    agenda.add(index);
                    waiting.insert(index as u32);
                }
                if agenda.take(&mut taken) {
                    rounds += usize::from(taken[0] < at);
                    at = taken[0];
                    assert!(taken.is_sorted() && taken.len() <= 64);
                    assert!(taken.iter().all(|index| waiting.remove(index)));
                } else {
                    assert!(waiting.is_empty());
                }
            }
            while agenda.take(&mut taken) {
                assert!(taken.iter().all(|index| waiting.remove(index)));
            }
            assert!(waiting.is_empty() && (rounds > 0 || len < 64));
            memory.release(agenda.bytes());
            assert_eq!(memory.used(), 0);
        }
    }

    #[test]
    fn bits_are_the_bytes_they_came_from() {
        let memory = Memory::new(1 << 20);
        let bytes: Vec<u8> = (0..1000_u64).map(|i| (mix(i) % 3 / 2) as u8).collect();
        let bits = Bits::from_bytes(&bytes, &memory).expect("fits");
        assert_eq!(bits.to_bytes(1000), bytes);
        let members: Vec<usize> = (0..1000).filter(|&i| bytes[i] != 0).collect();
        assert_eq!(bits.iter().collect::<Vec<_>>(), members);
        assert_eq!(bits.count(), members.len());
    }
}
