//! How few bits tell the reachable markings apart: the span of the firings over exclusive or.
//!
//! A firing is the exclusive or with a mask, so every reachable marking is M0 plus an element of the linear span of these
//! masks over GF(2). An element of a span of dimension r is told from the others by r of its places, the pivots of an
//! echelon form. So the *key* of a marking, its tokens on the pivots, is exact: two markings of the net that have one key are
//! the same. It is also linear, so a firing changes it by one exclusive or, however many words the marking has.
//!
//! The dimension is never above that of the places left over by the P-invariants (an invariant with an odd weight is a
//! linear dependency here as well), and often below: 16 philosophers of four places each need 32 bits of 64. Finding it
//! takes a pass over the transitions, each reduced by at most r masks, and ends as soon as r is beyond what keys hold.
//!
//! Rejected: P-invariants themselves (they need an integer basis, and miss what holds only modulo 2); a hash of all
//! places (nothing follows from two hashes that are equal but a look at the marking, which costs a cache miss an edge).

use crate::marking::{holds, transpose};
use crate::net::Net;

/// The longest key: it and two bits more fit a machine word, which the arithmetic of the table needs.
pub const MOST_BITS: u32 = 60;
/// The shortest: less would not be worth a case of its own.
const LEAST_BITS: u32 = 16;

/// Keys of markings.
#[derive(Clone, Debug)]
pub struct Span {
    pivots: Vec<u32>,
    /// The number of bits of a key.
    pub bits: u32,
    /// For each transition, what its firing changes in the key.
    pub flips: Vec<u64>,
}

impl Span {
    /// The keys of a net; none where they would be too long.
    pub fn new(net: &Net) -> Option<Self> {
        let words = net.words;
        let mut pivots: Vec<u32> = Vec::new();
        let mut basis: Vec<u64> = Vec::new();
        let mut rest = vec![0; words];
        for t in (0..net.transitions.len()).filter(|&t| net.forward.edge(t) != 0) {
            rest.copy_from_slice(net.flip(t, words));
            for (&pivot, element) in pivots.iter().zip(basis.chunks_exact(words)) {
                if holds(&rest, pivot) {
                    rest.iter_mut().zip(element).for_each(|(word, element)| *word ^= element);
                }
            }
            let Some(k) = rest.iter().position(|&word| word != 0) else { continue };
            if pivots.len() == MOST_BITS as usize {
                return None;
            }
            pivots.push(64 * k as u32 + rest[k].trailing_zeros());
            basis.extend_from_slice(&rest);
        }
        let bits = (pivots.len() as u32).max(LEAST_BITS);
        let mut span = Span { pivots, bits, flips: Vec::new() };
        span.flips = (0..net.transitions.len()).map(|t| span.key(net.flip(t, words))).collect();
        Some(span)
    }

    /// The key of one marking.
    pub fn key(&self, marking: &[u64]) -> u64 {
        let tokens = self.pivots.iter().enumerate().map(|(i, &place)| u64::from(holds(marking, place)) << i);
        self.scramble(tokens.sum())
    }

    /// The keys of up to 64 markings, from their slices: the rows of the pivots, transposed.
    #[inline(always)]
    pub fn keys(&self, slices: &[u64], keys: &mut [u64; 64]) {
        for (row, &place) in keys.iter_mut().zip(&self.pivots) {
            *row = slices[place as usize];
        }
        keys[self.pivots.len()..].fill(0);
        transpose(keys);
        keys.iter_mut().for_each(|key| *key = self.scramble(*key));
    }

    /// What stands above a key in one word with it: by which transition its marking was found (`sleep.rs`), if there is room
    /// for its number.
    #[inline(always)]
    pub(crate) fn told(&self, last: u16) -> u64 {
        let above = u64::from(last) << self.bits;
        if above >> self.bits == u64::from(last) { above } else { 0 }
    }

    /// The key in such a word.
    #[inline(always)]
    pub(crate) fn key_in(&self, word: u64) -> u64 {
        word & ((1 << self.bits) - 1)
    }

    /// By which transition the marking of such a word was found.
    #[inline(always)]
    pub(crate) fn last_in(&self, word: u64) -> u16 {
        (word >> self.bits) as u16
    }

    /// A linear bijection of keys that lets no bit stay alone, so that one product (`exact.rs`) spreads them.
    #[inline(always)]
    fn scramble(&self, mut key: u64) -> u64 {
        let mask = (1 << self.bits) - 1;
        key ^= key << (self.bits * 2 / 5) & mask;
        key ^= key >> (self.bits / 3);
        key ^ (key << (self.bits / 2) & mask)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::Batch;
    use crate::marking::{Dynamic, words_for};
    use crate::net::Transition;
    use crate::samples::{machines, random_spaces};
    use std::collections::HashMap;

    #[test]
    fn markings_of_a_net_have_one_key_only_if_they_are_the_same() {
        let mut large = 0;
        for space in random_spaces(300, false) {
            let span = Span::new(&space.net).expect("few places");
            let mut seen: HashMap<u64, usize> = HashMap::new();
            for index in 0..space.len() {
                assert_eq!(seen.insert(span.key(space.marking(index)), index), None);
            }
            assert!(seen.keys().all(|&key| key >> span.bits == 0));
            large += u32::from(space.len() > 100);
        }
        assert!(large > 20);
    }

    #[test]
    fn keys_follow_firings_and_come_out_of_slices() {
        for pad in [0, 50, 200] {
            let net = machines(10, pad);
            let (words, span) = (words_for(net.places), Span::new(&net).expect("ten bits"));
            assert_eq!((span.pivots.len(), span.bits), (10, LEAST_BITS));
            let mut batch = Batch::new(&net);
            batch.markings.extend_from_slice(&net.initial);
            for t in [0, 2, 4, 1, 8] {
                let from = batch.markings.len() - words;
                for k in 0..words {
                    batch.markings.push(batch.markings[from + k] ^ net.flip(t, words)[k]);
                }
            }
            batch.cut_by(Dynamic(words), &span);
            for (marking, key) in batch.markings.chunks_exact(words).zip(batch.hashes) {
                assert_eq!(key, span.key(marking));
            }
            assert_eq!(batch.hashes[3], batch.hashes[2] ^ span.flips[4]);
        }
    }

    #[test]
    fn a_key_and_a_transition_share_a_word_where_both_have_room() {
        let chain = |length| (0..length).map(|p| Transition::new(&[p], &[p + 1], &[], &[], &[])).collect();
        for (length, most) in [(60, 15), (50, 0x3fff), (20, u16::MAX)] {
            let span = Span::new(&Net::new(61, chain(length), &[0]).expect("well formed")).expect("few");
            assert_eq!(span.bits, length);
            let key = (1 << length) - 2;
            for last in [0, 1, 14, 15, 16, 0x3fff, 0x4000, u16::MAX] {
                let word = key | span.told(last);
                assert_eq!((span.key_in(word), span.last_in(word)), (key, if last > most { 0 } else { last }));
            }
        }
    }

    #[test]
    fn firings_that_cancel_out_need_no_bit_and_too_many_that_do_not_need_too_many() {
        let chain: Vec<Transition> = (0..99).map(|p| Transition::new(&[p], &[p + 1], &[], &[], &[])).collect();
        assert!(Span::new(&Net::new(100, chain[..60].to_vec(), &[0]).expect("well formed")).is_some());
        assert!(Span::new(&Net::new(100, chain, &[0]).expect("well formed")).is_none());
        let ring: Vec<Transition> = (0..20).map(|p| Transition::new(&[p], &[(p + 1) % 20], &[], &[], &[])).collect();
        assert_eq!(Span::new(&Net::new(20, ring, &[0]).expect("well formed")).expect("few").pivots.len(), 19);
    }
}
