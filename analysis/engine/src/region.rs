//! Zeroed numbers end to end, in huge pages where they are many.
//!
//! A table of markings is read at random. With pages of 4 KiB most reads of a table of some hundred MiB also miss the
//! processor's table of pages, so large regions are anonymous maps that ask for pages of 2 MiB (`madvise`) and begin
//! where such a page begins: the system starts a map at any small page, and of a table of 6 MiB, as likely as not, it then
//! leaves a third in small ones. What is left over at the end stays in small pages, so that no memory is taken beyond what
//! is stated. A map costs memory only where it was written to; so the array of markings reserves once all that its
//! budget allows, never moves and is never copied, and a new table of slots is not written twice. Where the system
//! refuses the reservation, and for small nets, a region is an ordinary vector's size and the caller copies it into a
//! larger one.
//!
//! A fresh page that is read first is a page of zeros which everybody shares; the first write replaces it. That is a
//! second fault, and where the process has several threads, the other processors are interrupted for it to forget the
//! page, which under a virtual machine costs microseconds. Filling tables looks for free slots before it writes, so it
//! did that for every page: up to a tenth of the time of one thread, and a third of that of two. So who fills one writes to
//! each page before (`write_first`).

use std::hint::black_box;

use bytemuck::Pod;
use memmap2::{MmapMut, MmapOptions};

/// Bytes from which a region is a map.
pub const MAP_BYTES: usize = 1 << 20;
/// Bytes of a huge page, and of a small one.
const HUGE_BYTES: usize = 1 << 21;
const PAGE_BYTES: usize = 1 << 12;

/// A fixed number of numbers, zero at first.
#[derive(Debug)]
pub enum Region<T> {
    /// Few, on the heap.
    Heap(Vec<T>),
    /// Many: so many bytes of a map, from a place on.
    Map(MmapMut, usize, usize),
}

impl<T: Pod> Region<T> {
    /// So many zeros; none where the system has not the memory.
    pub fn zeroed(len: usize) -> Option<Self> {
        let bytes = len.checked_mul(size_of::<T>())?;
        if bytes >= MAP_BYTES {
            let whole = bytes / HUGE_BYTES * HUGE_BYTES;
            let room = bytes.checked_add(if whole > 0 { HUGE_BYTES } else { 0 })?;
            let map = MmapOptions::new().len(room).no_reserve_swap().map_anon().ok()?;
            let first = if whole > 0 { map.as_ptr().align_offset(HUGE_BYTES) } else { 0 };
            // Advice: where the system has no huge pages, small ones do.
            #[cfg(target_os = "linux")]
            let _ = map.advise_range(memmap2::Advice::HugePage, first, whole);
            return Some(Region::Map(map, first, bytes));
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
            Region::Map(map, first, bytes) => bytemuck::cast_slice(&map[*first..*first + *bytes]),
        }
    }

    /// All of them, to be written.
    #[inline(always)]
    pub fn all_mut(&mut self) -> &mut [T] {
        match self {
            Region::Heap(all) => all,
            Region::Map(map, first, bytes) => bytemuck::cast_slice_mut(&mut map[*first..*first + *bytes]),
        }
    }
}

/// Writes to each page of numbers that are still zero, before anybody reads them.
pub(crate) fn write_first<T: Pod>(zeros: &mut [T]) {
    for page in zeros.chunks_mut(PAGE_BYTES / size_of::<T>()) {
        // Unseen by the compiler, which knows that a region is zero.
        page[0] = black_box(T::zeroed());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_region_is_as_long_as_asked_for_zero_and_begins_at_a_huge_page_where_it_fills_one() {
        for len in [0, 1, 1000, MAP_BYTES / 4, HUGE_BYTES / 4 - 1, HUGE_BYTES / 4, 3 * HUGE_BYTES / 4 + 504] {
            let mut region = Region::<u32>::zeroed(len).expect("fits");
            write_first(region.all_mut());
            assert!(region.all().len() == len && region.all().iter().all(|&number| number == 0));
            if 4 * len >= HUGE_BYTES {
                assert_eq!(region.all().as_ptr().align_offset(HUGE_BYTES), 0);
            }
            region.all_mut().iter_mut().zip(1..).for_each(|(number, i)| *number = i);
            assert!(region.all().iter().zip(1..).all(|(&number, i)| number == i));
        }
    }
}
