//! The append-only array of markings: at once the set, the breadth-first queue and the numbering of markings.
//!
//! It grows by chunks, so nothing is copied and memory is what is stated. One vector that doubles was rejected: while it
//! moves, both copies exist, and after that half of it may be unused.

use crate::budget::{Memory, Stop};
use crate::marking::Width;

/// Bytes of a full chunk of the array, about.
const CHUNK_BYTES_LOG2: u32 = 21;

/// The append-only array of markings.
#[derive(Debug)]
pub struct Store {
    words: usize,
    chunk_log2: u32,
    chunks: Vec<Vec<u64>>,
    len: usize,
    /// How many more markings the last chunk takes.
    room: usize,
}

impl Store {
    /// An empty array of markings of so many words.
    pub fn new(words: usize) -> Self {
        let chunk_log2 = (CHUNK_BYTES_LOG2 - 3).saturating_sub(words.next_power_of_two().trailing_zeros()).max(4);
        Store { words, chunk_log2, chunks: Vec::new(), len: 0, room: 0 }
    }

    /// How many markings there are.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The marking of an index.
    #[inline(always)]
    pub fn get<W: Width>(&self, width: W, index: usize) -> &[u64] {
        let chunk = &self.chunks[index >> self.chunk_log2];
        let start = (index & ((1 << self.chunk_log2) - 1)) * width.words();
        &chunk[start..start + width.words()]
    }

    /// Appends the markings of a range of indexes to `into`.
    pub fn copy_range(&self, start: usize, end: usize, into: &mut Vec<u64>) {
        let mut index = start;
        while index < end {
            let chunk = index >> self.chunk_log2;
            let stop = end.min((chunk + 1) << self.chunk_log2);
            let base = chunk << self.chunk_log2;
            into.extend_from_slice(&self.chunks[chunk][(index - base) * self.words..(stop - base) * self.words]);
            index = stop;
        }
    }

    /// Appends a marking.
    #[inline(always)]
    pub fn push(&mut self, marking: &[u64], memory: &Memory) -> Result<(), Stop> {
        if self.room == 0 {
            self.make_room(memory)?;
        }
        let last = self.chunks.len() - 1;
        self.chunks[last].extend_from_slice(&marking[..self.words]);
        self.room -= 1;
        self.len += 1;
        Ok(())
    }

    /// Enlarges the last chunk, which small nets never fill, or begins another.
    #[cold]
    fn make_room(&mut self, memory: &Memory) -> Result<(), Stop> {
        let whole = self.words << self.chunk_log2;
        if self.chunks.last().is_none_or(|chunk| chunk.len() == whole) {
            self.chunks.push(Vec::new());
        }
        let first = self.chunks.len() == 1;
        let Some(chunk) = self.chunks.last_mut() else { return Err(Stop::Memory) };
        let old = chunk.len();
        let new = if first { (2 * old).clamp(16 * self.words, whole) } else { whole };
        memory.claim(8 * new)?;
        if chunk.try_reserve_exact(new - chunk.len()).is_err() {
            memory.release(8 * new);
            return Err(Stop::Memory);
        }
        memory.release(8 * old);
        self.room = (new - chunk.len()) / self.words;
        Ok(())
    }
}
