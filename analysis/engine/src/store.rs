//! The append-only array of markings: at once the set, the breadth-first queue and the numbering of markings.
//!
//! A small one doubles. From a mebibyte on it reserves all that the budget allows and takes (and claims) it piece by
//! piece, so that nothing is copied any more and memory is what is stated. An array of chunks was rejected: it cost each
//! comparison of a marking two more look-ups.

use crate::budget::{Memory, Stop};
use crate::marking::Width;
use crate::region::{MAP_BYTES, Region};

/// Bytes that are claimed at once: a huge page.
const PIECE_BYTES: usize = 1 << 21;

/// The append-only array of markings.
#[derive(Debug)]
pub struct Store {
    words: usize,
    region: Region<u64>,
    len: usize,
    /// How many markings the bytes claimed hold.
    claimed: usize,
}

impl Store {
    /// An empty array of markings of so many words.
    pub fn new(words: usize) -> Self {
        Store { words, region: Region::Heap(Vec::new()), len: 0, claimed: 0 }
    }

    /// How many markings there are.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The words of all markings, end to end, and some that are not yet written.
    #[inline(always)]
    pub fn all(&self) -> &[u64] {
        self.region.all()
    }

    /// The marking of an index.
    #[inline(always)]
    pub fn get<W: Width>(&self, width: W, index: usize) -> &[u64] {
        &self.all()[index * width.words()..(index + 1) * width.words()]
    }

    /// Appends the markings of a range of indexes to `into`.
    #[inline(always)]
    pub fn copy_range(&self, start: usize, end: usize, into: &mut Vec<u64>) {
        into.extend_from_slice(&self.all()[start * self.words..end * self.words]);
    }

    /// Appends a marking; `most` is how many there may ever be.
    #[inline(always)]
    pub fn push<W: Width>(&mut self, width: W, marking: &[u64], most: usize, memory: &Memory) -> Result<(), Stop> {
        if self.len == self.claimed {
            self.make_room(most, memory)?;
        }
        let words = width.words();
        self.region.all_mut()[self.len * words..(self.len + 1) * words].copy_from_slice(&marking[..words]);
        self.len += 1;
        Ok(())
    }

    /// The room after the last marking, to be written and then told by `add`: for so many more, or as many as are claimed,
    /// and not more than `most` altogether.
    #[inline(always)]
    pub(crate) fn room(&mut self, count: usize, most: usize) -> &mut [u64] {
        let count = count.min(self.claimed.min(most) - self.len);
        &mut self.region.all_mut()[self.len * self.words..(self.len + count) * self.words]
    }

    /// Claims more of it; `most` are all that may be.
    #[cold]
    pub(crate) fn more_room(&mut self, most: usize, memory: &Memory) -> Result<(), Stop> {
        if self.len >= most { Err(Stop::Markings) } else { self.make_room(most, memory) }
    }

    /// Takes up as many markings as were written there.
    #[inline(always)]
    pub(crate) fn add(&mut self, count: usize) {
        debug_assert!(self.len + count <= self.claimed);
        self.len += count;
    }

    /// Appends markings that stand end to end.
    pub fn append(&mut self, markings: &[u64], most: usize, memory: &Memory) -> Result<(), Stop> {
        let count = markings.len() / self.words;
        while self.claimed - self.len < count {
            self.make_room(most, memory)?;
        }
        self.region.all_mut()[self.len * self.words..][..markings.len()].copy_from_slice(markings);
        self.len += count;
        Ok(())
    }

    /// Appends so many markings, which the caller writes: all of them, or none.
    pub(crate) fn extend(&mut self, count: usize, most: usize, memory: &Memory) -> Result<&mut [u64], Stop> {
        while self.claimed - self.len < count {
            self.make_room(most, memory)?;
        }
        let from = self.len;
        self.len += count;
        Ok(&mut self.region.all_mut()[from * self.words..(from + count) * self.words])
    }

    /// Forgets all markings, and keeps the memory.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    #[cold]
    fn make_room(&mut self, most: usize, memory: &Memory) -> Result<(), Stop> {
        let marking_bytes = 8 * self.words;
        let held = self.region.all().len() / self.words;
        if self.claimed < held {
            let more = (PIECE_BYTES / marking_bytes).max(16).min(held - self.claimed);
            memory.claim(more * marking_bytes)?;
            self.claimed += more;
            return Ok(());
        }
        let small = 2 * held * marking_bytes <= MAP_BYTES;
        let room = if small { (2 * held).max(16) } else { most.min(memory.limit() / marking_bytes) };
        let room = room.max(2 * held);
        let region = match Region::zeroed(room * self.words) {
            Some(region) => region,
            // All at once is refused; twice as much may not be.
            None => Region::zeroed(2 * held * self.words).ok_or(Stop::Memory)?,
        };
        // Both copies exist for a moment. What a map was not written to is not there yet.
        let claimed = if small { room } else { held + (PIECE_BYTES / marking_bytes).max(16) };
        let claimed = claimed.min(region.all().len() / self.words);
        memory.claim(claimed * marking_bytes)?;
        let old = std::mem::replace(&mut self.region, region);
        self.region.all_mut()[..old.all().len()].copy_from_slice(old.all());
        memory.release(self.claimed * marking_bytes);
        self.claimed = claimed;
        Ok(())
    }
}
