//! Up to 64 markings taken together as bit slices, one word for each place: the unit in which everything fires.

use crate::marking::{Width, holds, linear_hash, slice};
use crate::net::Net;
use crate::span::Span;

/// Up to 64 markings, sliced.
pub struct Batch {
    /// The markings, end to end.
    pub markings: Vec<u64>,
    /// What is linear over exclusive or and stands for each: its hash (`cut`) or its key (`cut_by`).
    pub hashes: [u64; 64],
    /// Bit `j` of slice `p` says whether marking `j` holds place `p`; of bits that stand for no marking, nothing.
    pub slices: Vec<u64>,
    /// A bit for each marking.
    pub valid: u64,
    /// How many markings.
    pub count: usize,
    /// The words that differ among markings; the slices of the others stand from the beginning.
    active: Vec<usize>,
}

impl Batch {
    /// An empty batch of markings that a net reaches, or that differ from those by firings.
    pub fn new(net: &Net) -> Self {
        let slices = (0..64 * net.words as u32).map(|p| if holds(&net.initial, p) { !0 } else { 0 });
        Batch {
            markings: Vec::with_capacity(64 * net.words),
            hashes: [0; 64],
            slices: slices.collect(),
            valid: 0,
            count: 0,
            active: net.active.clone(),
        }
    }

    /// Slices the markings that stand end to end in `self.markings`.
    #[inline(always)]
    pub fn cut<W: Width>(&mut self, width: W) {
        self.slice(width);
        for (hash, marking) in self.hashes.iter_mut().zip(self.markings.chunks_exact(width.words())) {
            *hash = linear_hash(width, marking);
        }
    }

    /// The same, with the keys of a span for hashes.
    #[inline(always)]
    pub fn cut_by<W: Width>(&mut self, width: W, span: &Span) {
        self.slice(width);
        span.keys(&self.slices, &mut self.hashes);
    }

    /// The same, of markings whose keys are known.
    #[inline(always)]
    pub fn cut_known<W: Width>(&mut self, width: W, keys: &[u64]) {
        self.slice(width);
        self.hashes[..keys.len()].copy_from_slice(keys);
    }

    /// The same without anything that stands for them.
    #[inline(always)]
    pub fn slice<W: Width>(&mut self, width: W) {
        self.count = self.markings.len() / width.words();
        self.valid = if self.count == 64 { !0 } else { (1 << self.count) - 1 };
        slice(width, &self.active, &self.markings, &mut self.slices);
    }
}
