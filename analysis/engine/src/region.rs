//! Zeroed numbers end to end, in huge pages where they are many.
//!
//! A table of markings is read at random. With pages of 4 KiB most reads of a table of some hundred MiB also miss the
//! processor's table of pages, so large regions are anonymous maps that ask for pages of 2 MiB (`madvise`). A map costs
//! memory only where it was written to; so the array of markings reserves once all that its budget allows, never moves
//! and is never copied, and a new table of slots is not written twice. Where the system refuses the reservation, and
//! for small nets, a region is an ordinary vector's size and the caller copies it into a larger one.

use bytemuck::Pod;
use memmap2::{MmapMut, MmapOptions};

/// Bytes from which a region is a map.
pub const MAP_BYTES: usize = 1 << 20;

/// A fixed number of numbers, zero at first.
#[derive(Debug)]
pub enum Region<T> {
    /// Few, on the heap.
    Heap(Vec<T>),
    /// Many, in a map.
    Map(MmapMut),
}

impl<T: Pod> Region<T> {
    /// So many zeros; none where the system has not the memory.
    pub fn zeroed(len: usize) -> Option<Self> {
        let bytes = len.checked_mul(size_of::<T>())?;
        if bytes >= MAP_BYTES {
            let map = MmapOptions::new().len(bytes).no_reserve_swap().map_anon().ok()?;
            // Advice: where the system has no huge pages, small ones do.
            #[cfg(target_os = "linux")]
            let _ = map.advise(memmap2::Advice::HugePage);
            return Some(Region::Map(map));
        }
        let mut all = Vec::new();
        all.try_reserve_exact(len).ok()?;
        all.resize(len, T::zeroed());
        Some(Region::Heap(all))
    }

    /// All of them.
    #[inline(always)]
    pub fn all(&self) -> &[T] {
        match self {
            Region::Heap(all) => all,
            Region::Map(map) => bytemuck::cast_slice(map),
        }
    }

    /// All of them, to be written.
    #[inline(always)]
    pub fn all_mut(&mut self) -> &mut [T] {
        match self {
            Region::Heap(all) => all,
            Region::Map(map) => bytemuck::cast_slice_mut(map),
        }
    }
}
