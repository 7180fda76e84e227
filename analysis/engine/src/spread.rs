//! The way back from a key (`span.rs`) to its marking: a linear map, so a sum of the images of its parts.
//!
//! The firings of a net span its keys, and their masks span what markings differ by. Elimination on both at once gives a
//! mask for each of some bits of the key, which together tell all of it; up to eight of these bits at a time, their sums are
//! laid out in a table, as many as the nearest cache holds beside all else. Words that no firing changes are those of M0.

use crate::net::Net;
use crate::span::Span;

/// Most bits of a part of the key, and fewest.
const PART_MOST: usize = 8;
const PART_LEAST: usize = 4;
/// Bytes of the tables, but where parts have the fewest bits.
const TABLE_BYTES: usize = 24 << 10;

/// Markings by key.
#[derive(Clone, Debug)]
pub(crate) struct Spread {
    /// M0, without the words that change.
    base: Vec<u64>,
    /// Which these are.
    active: Vec<usize>,
    /// Bits of a part of the key.
    part: usize,
    /// For each part of a key 2^part masks, of the words that change.
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
        let (active, bits) = (net.active.clone(), span.bits as usize);
        let len = |part: usize| (bits.div_ceil(part) << part) * active.len();
        let part = (PART_LEAST..=PART_MOST).rev().find(|&part| 8 * len(part) <= TABLE_BYTES).unwrap_or(PART_LEAST);
        let mut spread = Spread { base: net.initial.clone(), part, sums: vec![0; len(part)], active };
        for &k in &spread.active {
            spread.base[k] = 0;
        }
        let stride = spread.active.len();
        for (bit, _, mask) in &basis {
            let at = bit.trailing_zeros() as usize;
            for sum in (0..1 << part).filter(|sum| sum >> (at % part) & 1 != 0) {
                let start = (((at / part) << part) + sum) * stride;
                for (to, &k) in spread.sums[start..start + stride].iter_mut().zip(&spread.active) {
                    *to ^= mask[k];
                }
            }
        }
        // The first table holds what the key of M0 and M0 differ by, so that no key is special.
        let mut origin = vec![0; words];
        spread.marking(span.key(&net.initial), &mut origin);
        for sum in spread.sums.chunks_exact_mut(stride.max(1)).take(1 << part) {
            for (to, &k) in sum.iter_mut().zip(&spread.active) {
                *to ^= origin[k] ^ net.initial[k];
            }
        }
        spread
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        8 * (self.sums.len() + self.base.len())
    }

    /// The sum of the masks of a key, of as many words as are known to change.
    #[inline(always)]
    fn sum<const N: usize>(&self, key: u64) -> [u64; N] {
        let (mut sum, mut rest) = ([0; N], key as usize);
        for sums in self.sums.as_chunks::<N>().0.chunks_exact(1 << self.part) {
            for (sum, word) in sum.iter_mut().zip(sums[rest % (1 << self.part)]) {
                *sum ^= word;
            }
            rest >>= self.part;
        }
        sum
    }

    /// The marking of a key.
    #[inline(always)]
    pub(crate) fn marking(&self, key: u64, into: &mut [u64]) {
        if into.len() == 1 && self.active.len() == 1 {
            into[0] = self.sum::<1>(key)[0];
            return;
        }
        into.copy_from_slice(&self.base);
        match *self.active.as_slice() {
            [] => {}
            [k] => into[k] = self.sum::<1>(key)[0],
            [k, l] => [into[k], into[l]] = self.sum::<2>(key),
            _ => {
                let stride = self.active.len();
                for (at, sums) in self.sums.chunks_exact(stride << self.part).enumerate() {
                    let sum = (key >> (self.part * at)) as usize % (1 << self.part);
                    for (&k, word) in self.active.iter().zip(&sums[sum * stride..]) {
                        into[k] ^= word;
                    }
                }
            }
        }
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
