//! Markings as bit vectors, and the arithmetic on them that every other file shares.
//!
//! A marking is `words` machine words, bit `i % 64` of word `i / 64` being place `i`. Under the contact rule a
//! firing takes tokens only from full places and puts them only on empty ones, so it is the exclusive or with a mask
//! of the transition. A hash that is *linear* over exclusive or therefore follows a firing at the cost of one more
//! exclusive or, whatever the width (Zobrist, "A new hashing method with application for game playing", 1970). Here
//! the linear map is a fold by shifts instead of a table of random keys: it needs no memory, and hashing one marking
//! from nothing costs a few operations a word instead of one look-up a token.
//!
//! The width is a type: `Fixed<N>` for the usual ones, so that loops over words are unrolled, and `Dynamic` for the
//! rest. Storage does not know of it, so only hot functions are compiled once for each width. The alternative, every
//! structure generic over an array type, compiled the whole engine six times and had no place for 10,000 places.

/// The number of machine words of a marking, known at compile time where it can be.
pub trait Width: Copy + Send + Sync {
    /// How many words one marking takes.
    fn words(self) -> usize;
}

/// A width known at compile time.
#[derive(Clone, Copy, Debug)]
pub struct Fixed<const N: usize>;

impl<const N: usize> Width for Fixed<N> {
    #[inline(always)]
    fn words(self) -> usize {
        N
    }
}

/// A width known at run time.
#[derive(Clone, Copy, Debug)]
pub struct Dynamic(pub usize);

impl Width for Dynamic {
    #[inline(always)]
    fn words(self) -> usize {
        self.0
    }
}

/// Runs an expression with the narrowest `Width` type for a number of words.
#[macro_export]
macro_rules! with_width {
    ($words:expr, $width:ident => $body:expr) => {
        match $words {
            1 => {
                let $width = $crate::marking::Fixed::<1>;
                $body
            }
            2 => {
                let $width = $crate::marking::Fixed::<2>;
                $body
            }
            3 => {
                let $width = $crate::marking::Fixed::<3>;
                $body
            }
            4 => {
                let $width = $crate::marking::Fixed::<4>;
                $body
            }
            8 => {
                let $width = $crate::marking::Fixed::<8>;
                $body
            }
            words => {
                let $width = $crate::marking::Dynamic(words);
                $body
            }
        }
    };
}

/// The number of words for so many places; a net without places still has one marking, of one word.
pub fn words_for(places: usize) -> usize {
    places.div_ceil(64).max(1)
}

/// Sets the bit of a place.
pub fn put(marking: &mut [u64], place: u32) {
    marking[place as usize / 64] |= 1 << (place % 64);
}

/// Whether a place holds a token.
#[inline(always)]
pub fn holds(marking: &[u64], place: u32) -> bool {
    marking[place as usize / 64] >> (place % 64) & 1 == 1
}

/// Two rounds of Marsaglia's xorshift: a bijection of words that is linear over exclusive or.
#[inline(always)]
fn scramble(mut x: u64) -> u64 {
    for _ in 0..2 {
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
    }
    x
}

/// The linear hash: `linear_hash(a ^ b) == linear_hash(a) ^ linear_hash(b)`. One word is its own hash.
#[inline(always)]
pub fn linear_hash<W: Width>(width: W, marking: &[u64]) -> u64 {
    let marking = &marking[..width.words()];
    if width.words() == 1 {
        return marking[0];
    }
    let mut hash = 0;
    for &word in marking {
        hash = scramble(hash ^ word);
    }
    hash
}

/// Spreads a linear hash over all 64 bits: the folded product, which is not linear, so that sets of markings that
/// are closed under exclusive or (independent parts of a net) do not fall on a subspace of the table.
#[inline(always)]
pub fn mix(hash: u64) -> u64 {
    let product = u128::from(hash ^ 0x9e37_79b9_7f4a_7c15) * 0xd1b5_4a32_d192_ed03_u128;
    (product as u64) ^ (product >> 64) as u64
}

/// Transposes a 64 by 64 bit matrix in place: bit `j` of row `i` becomes bit `i` of row `j`
/// (Warren, "Hacker's Delight", 7-3).
#[inline]
pub fn transpose(rows: &mut [u64; 64]) {
    swap_blocks::<32>(rows, 0x0000_0000_ffff_ffff);
    swap_blocks::<16>(rows, 0x0000_ffff_0000_ffff);
    swap_blocks::<8>(rows, 0x00ff_00ff_00ff_00ff);
    swap_blocks::<4>(rows, 0x0f0f_0f0f_0f0f_0f0f);
    swap_blocks::<2>(rows, 0x3333_3333_3333_3333);
    swap_blocks::<1>(rows, 0x5555_5555_5555_5555);
}

/// Swaps, in each block of two times `D` rows, the high columns of the upper half with the low ones of the lower. The
/// shape of the loops is one that compilers make vector instructions of.
#[inline(always)]
fn swap_blocks<const D: usize>(rows: &mut [u64; 64], mask: u64) {
    for block in rows.chunks_exact_mut(2 * D) {
        let (upper, lower) = block.split_at_mut(D);
        for (a, b) in upper.iter_mut().zip(lower) {
            let moved = ((*a >> D) ^ *b) & mask;
            *a ^= moved << D;
            *b ^= moved;
        }
    }
}

/// Bit slices of up to 64 markings laid end to end, for the places of some words: bit `j` of slice `p` says whether
/// marking `j` holds place `p`.
///
/// Few markings are scattered token by token, many are transposed word by word; both leave the same slices.
#[inline]
pub fn slice<W: Width>(width: W, active: &[usize], markings: &[u64], slices: &mut [u64]) {
    let blocks = slices.as_chunks_mut::<64>().0;
    debug_assert!(markings.len() <= 64 * width.words() && blocks.len() == width.words());
    if width.words() == 1 {
        slice_word(width, 0, markings, &mut blocks[0]);
        return;
    }
    for &k in active {
        slice_word(width, k, markings, &mut blocks[k]);
    }
}

#[inline(always)]
fn slice_word<W: Width>(width: W, k: usize, markings: &[u64], block: &mut [u64; 64]) {
    let words = width.words();
    let count = markings.len() / words;
    if count > 6 {
        for (row, marking) in block.iter_mut().zip(markings.chunks_exact(words)) {
            *row = marking[k];
        }
        block[count..].fill(0);
        transpose(block);
        return;
    }
    block.fill(0);
    for (j, marking) in markings.chunks_exact(words).enumerate() {
        let mut rest = marking[k];
        while rest != 0 {
            block[rest.trailing_zeros() as usize] |= 1 << j;
            rest &= rest - 1;
        }
    }
}

/// The numbers of the bits of a word.
pub(crate) fn members(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (word != 0).then(|| word.trailing_zeros() as usize);
        word &= word.wrapping_sub(1);
        bit
    })
}

/// The markings of slices, end to end.
pub(crate) fn unslice(words: usize, slices: &[u64], markings: &mut [u64]) {
    for (k, rows) in slices.as_chunks::<64>().0.iter().enumerate() {
        let mut rows = *rows;
        transpose(&mut rows);
        for (marking, row) in markings.chunks_exact_mut(words).zip(rows) {
            marking[k] = row;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: &mut u64) -> u64 {
        *seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(*seed)
    }

    #[test]
    fn transposing_moves_bit_j_of_row_i_to_bit_i_of_row_j() {
        let mut seed = 1;
        let before: [u64; 64] = std::array::from_fn(|_| noise(&mut seed));
        let mut after = before;
        transpose(&mut after);
        for (i, row) in before.iter().enumerate() {
            for (j, column) in after.iter().enumerate() {
                assert_eq!(row >> j & 1, column >> i & 1);
            }
        }
    }

    #[test]
    fn scattered_and_transposed_slices_agree() {
        let mut seed = 2;
        let markings: Vec<u64> = (0..64 * 3).map(|_| noise(&mut seed)).collect();
        let mut all = vec![0; 64 * 3];
        slice(Fixed::<3>, &[0, 1, 2], &markings, &mut all);
        for j in 0..64 {
            let mut one = vec![7; 64 * 3];
            slice(Dynamic(3), &[0, 1, 2], &markings[3 * j..3 * j + 3], &mut one);
            for p in 0..192 {
                assert_eq!(one[p], all[p] >> j & 1);
            }
        }
    }

    #[test]
    fn the_hash_is_linear_over_exclusive_or() {
        let mut seed = 3;
        for words in [1, 2, 3, 5, 9] {
            let a: Vec<u64> = (0..words).map(|_| noise(&mut seed)).collect();
            let b: Vec<u64> = (0..words).map(|_| noise(&mut seed)).collect();
            let both: Vec<u64> = a.iter().zip(&b).map(|(x, y)| x ^ y).collect();
            let width = Dynamic(words);
            assert_eq!(linear_hash(width, &both), linear_hash(width, &a) ^ linear_hash(width, &b));
            assert_ne!(linear_hash(width, &both), 0);
        }
    }
}
