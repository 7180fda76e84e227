//! Memory that is asked for before it is read, so that the processor has many misses of its cache under way at once.
//!
//! Who looks up many keys knows their places long before he compares what stands there. To read a word of each place, in a
//! loop so short that many reads are under way, does for that too, and needs no `unsafe`: so it was for long. But a read
//! that waits holds up all instructions after it as soon as the processor remembers no more of them, so it needed a pass of
//! its own, which took a tenth of the instructions of an exploration. A prefetch waits for nothing and can stand where the
//! place is computed.
//!
//! Of all that the engine does by itself this alone is `unsafe`: the compiler knows the instruction only for raw addresses.

/// Has the processor fetch the element of a slice that has a number, or whatever stands there, and goes on.
#[inline(always)]
pub(crate) fn fetch<T>(all: &[T], at: usize) {
    let place = all.as_ptr().wrapping_add(at);
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        #[allow(unsafe_code, reason = "a prefetch reads and writes nothing, and no address makes it fault")]
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(place.cast());
        }
    }
    // Elsewhere the address alone is computed: stable Rust has no such instruction.
    #[cfg(not(target_arch = "x86_64"))]
    std::hint::black_box(place);
}
