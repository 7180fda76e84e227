//! What two threads use at once, kept out of each other's way.
//!
//! Processors hand memory to each other by lines of 64 bytes, and fetch the neighbour with each. Where one thread writes
//! into a line that another one reads, each waits for the other at every step, though they share no value: so filling the
//! two halves of a table took half as long again while the flag by which one stops the other stood beside the
//! variables of a loop. So whatever a second thread is handed by reference begins and ends a pair of lines; what is moved
//! into it is its own anyway.

/// A value with two lines of a processor's cache to itself, or as many pairs as it needs.
#[derive(Debug, Default)]
#[repr(align(128))]
pub(crate) struct Apart<T>(pub(crate) T);

const _: () = assert!(size_of::<Apart<bool>>() == 128);
