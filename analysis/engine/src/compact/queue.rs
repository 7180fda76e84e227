//! The keys of a level, in the order in which they were found: a queue in chunks, which are used again as soon as they
//! are read, so that two levels take the memory of little more than one.

use std::collections::VecDeque;

use crate::budget::{Memory, Stop};

/// Keys of a chunk.
const CHUNK: usize = 1 << 10;

/// Empty chunks.
#[derive(Debug, Default)]
pub(crate) struct Spare(Vec<Vec<u64>>);

/// Keys that wait.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    chunks: VecDeque<Vec<u64>>,
    /// How many keys wait, and how many of the first chunk were taken.
    len: usize,
    taken: usize,
}

impl Queue {
    /// How many keys were put into it and not yet taken.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Appends a key.
    #[inline(always)]
    pub(crate) fn push(&mut self, key: u64, spare: &mut Spare, memory: &Memory) -> Result<(), Stop> {
        if self.chunks.back().is_none_or(|last| last.len() == CHUNK) {
            self.chunks.push_back(spare.chunk(memory)?);
        }
        if let Some(last) = self.chunks.back_mut() {
            last.push(key);
        }
        self.len += 1;
        Ok(())
    }

    /// Moves up to 64 keys into `taken`, from a queue that is not pushed to meanwhile; they are 64 but at its end.
    pub(crate) fn take(&mut self, taken: &mut Vec<u64>, spare: &mut Spare) {
        taken.clear();
        let Some(first) = self.chunks.front_mut() else { return };
        let end = first.len().min(self.taken + 64);
        taken.extend_from_slice(&first[self.taken..end]);
        self.len -= taken.len();
        self.taken = end;
        if end == first.len() {
            first.clear();
            spare.0.extend(self.chunks.pop_front());
            self.taken = 0;
        }
    }
}

impl Spare {
    #[cold]
    fn chunk(&mut self, memory: &Memory) -> Result<Vec<u64>, Stop> {
        match self.0.pop() {
            Some(chunk) => Ok(chunk),
            None => {
                memory.claim(8 * CHUNK)?;
                let mut chunk = Vec::new();
                chunk.try_reserve_exact(CHUNK).map_err(|_| Stop::Memory)?;
                Ok(chunk)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_queue_gives_back_what_it_was_given_and_uses_its_chunks_again() {
        let memory = Memory::new(1 << 20);
        let (mut queue, mut other, mut spare) = (Queue::default(), Queue::default(), Spare::default());
        let mut taken = Vec::new();
        for count in [1, 64, 1000, 5000, CHUNK as u64] {
            for key in 0..count {
                queue.push(key, &mut spare, &memory).expect("fits");
            }
            let mut all = Vec::new();
            while queue.len() > 0 {
                queue.take(&mut taken, &mut spare);
                assert!(taken.len() == 64 || queue.len() == 0);
                taken.iter().for_each(|&key| other.push(key, &mut spare, &memory).expect("fits"));
                all.extend_from_slice(&taken);
            }
            assert!(all.into_iter().eq(0..count));
            while other.len() > 0 {
                other.take(&mut taken, &mut spare);
            }
        }
        // Not twice five thousand.
        assert!(memory.used() <= 8 * (5000 + 2 * CHUNK));
        let small = Memory::new(10);
        assert_eq!(Queue::default().push(1, &mut Spare::default(), &small), Err(Stop::Memory));
    }
}
