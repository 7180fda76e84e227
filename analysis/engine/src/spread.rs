//! The way back from a key (`span.rs`) to its marking: a linear map, so a sum of the images of its parts.
//!
//! The firings of a net span its keys, and their masks span what markings differ by. Elimination on both at once gives a
//! mask for each of some bits of the key, which together tell all of it; four of these bits at a time (eight, where a
//! marking is one word), their sums are laid out in a table.

use crate::net::Net;
use crate::span::Span;

/// Markings by key.
#[derive(Clone, Debug)]
pub(crate) struct Spread {
    words: usize,
    /// Bits of a part of the key.
    part: usize,
    /// For each part of a key 2^part masks.
    sums: Vec<u64>,
}

impl Spread {
    /// The way back from the keys of a net.
    pub(crate) fn new(net: &Net, span: &Span) -> Self {
        let words = net.words;
        let mut basis: Vec<(u64, u64, Vec<u64>)> = Vec::new();
        let add = |to: &mut (u64, u64, Vec<u64>), from: &(u64, u64, Vec<u64>)| {
            to.1 ^= from.1;
            to.2.iter_mut().zip(&from.2).for_each(|(to, from)| *to ^= from);
        };
        for (t, &key) in span.flips.iter().enumerate().filter(|&(t, _)| net.forward.edge(t) != 0) {
            let mut rest = (0, key, net.flip(t, words).to_vec());
            for element in basis.iter().filter(|element| key & element.0 != 0) {
                add(&mut rest, element);
            }
            if rest.1 == 0 {
                continue;
            }
            // Its lowest bit stands in no other element.
            rest.0 = rest.1 & rest.1.wrapping_neg();
            for element in basis.iter_mut().filter(|element| element.1 & rest.0 != 0) {
                add(element, &rest);
            }
            basis.push(rest);
        }
        let part = if words == 1 { 8 } else { 4 };
        let parts = (span.bits as usize).div_ceil(part);
        let mut spread = Spread { words, part, sums: vec![0; (parts << part) * words] };
        for (bit, _, mask) in &basis {
            let at = bit.trailing_zeros() as usize;
            for sum in (0..1 << part).filter(|sum| sum >> (at % part) & 1 != 0) {
                let start = (((at / part) << part) + sum) * words;
                spread.sums[start..start + words].iter_mut().zip(mask).for_each(|(to, mask)| *to ^= mask);
            }
        }
        // The first table holds what the key of M0 and M0 differ by, so that no key is special.
        let mut origin = vec![0; words];
        spread.add(span.key(&net.initial), &mut origin);
        for sum in spread.sums.chunks_exact_mut(words).take(1 << part) {
            for ((to, of), initial) in sum.iter_mut().zip(&origin).zip(&net.initial) {
                *to ^= of ^ initial;
            }
        }
        spread
    }

    /// Words of a marking.
    pub(crate) fn words(&self) -> usize {
        self.words
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        8 * self.sums.len()
    }

    #[inline(always)]
    fn add(&self, key: u64, to: &mut [u64]) {
        let words = to.len();
        for (at, sums) in self.sums.chunks_exact(words << self.part).enumerate() {
            let sum = (key >> (self.part * at)) as usize % (1 << self.part);
            to.iter_mut().zip(&sums[sum * words..(sum + 1) * words]).for_each(|(to, sum)| *to ^= sum);
        }
    }

    /// The marking of a key.
    #[inline(always)]
    pub(crate) fn marking(&self, key: u64, into: &mut [u64]) {
        debug_assert_eq!(into.len(), self.words);
        into.fill(0);
        self.add(key, into);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::random_spaces;

    #[test]
    fn the_marking_of_a_key_is_the_one_it_was_taken_of() {
        for space in random_spaces(300, false) {
            let span = Span::new(&space.net).expect("few places");
            let spread = Spread::new(&space.net, &span);
            let mut marking = vec![0; space.net.words];
            for index in 0..space.len() {
                spread.marking(span.key(space.marking(index)), &mut marking);
                assert_eq!(marking, space.marking(index));
            }
        }
    }
}
