//! Where a key belongs in a table of buckets, and what is left of it there: the arithmetic of `exact.rs`.
//!
//! A key of r bits is mixed by an odd factor modulo 2^r. With n buckets, the mixed key times n has the number of its
//! bucket above bit r. Keys of one bucket differ below it by multiples of n, so of the low part those bits can be left
//! off that the power of two below n spans: what remains, the tag, tells them apart. For n = 2^k or 3 * 2^k, the mixed
//! key comes back from both by a division by 2 or 3.
//!
//! Rejected: powers of two alone (a table then doubles, and is three eighths full afterwards, as those of two threads are
//! for a while); any n (growth would divide by a variable).

use bytemuck::Pod;
use wide::{CmpEq, i32x4};

use crate::budget::Stop;

/// Slots of a bucket.
pub const LANES: usize = 8;
/// Low bits of a slot: how many buckets its key has moved, plus one.
pub(crate) const MOVED_BITS: u32 = 6;
/// Buckets that are tried for a key.
pub(crate) const REACH: usize = (1 << MOVED_BITS) - 1;
/// Most buckets: their numbers are kept in 32 bits (`exact.rs`), and one cut short would take two keys for
/// one.
const BUCKETS_MAX: u64 = 1 << 32;
/// A table of fewer buckets doubles: what it takes is little beside all else, and to move its keys as often as those of a
/// large one takes a twentieth of an exploration that ends soon after.
const DOUBLES_BELOW: u64 = 1 << 16;
/// Odd, so that the product is a bijection (the golden ratio).
pub(crate) const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;

/// The factor that takes `FACTOR` back.
const INVERSE: u64 = {
    // Newton's iteration: an odd number is its own inverse in three bits, and each step doubles those that are right.
    let (mut inverse, mut step) = (FACTOR, 0);
    while step < 5 {
        inverse = inverse.wrapping_mul(2_u64.wrapping_sub(FACTOR.wrapping_mul(inverse)));
        step += 1;
    }
    inverse
};

/// A slot: 32 or 64 bits.
pub trait Slot: Pod + Eq + Send + Sync {
    /// The low bits of a word.
    fn new(word: u64) -> Self;
    /// The slot as a word.
    fn get(self) -> u64;
    /// A bit for each slot of a bucket that has a value.
    fn matches(bucket: &[Self; LANES], value: Self) -> u32;
    /// Whether some slot of a bucket has a value. What each look-up asks first, so both halves of the bucket are
    /// joined before anything is made of them.
    fn holds(bucket: &[Self; LANES], value: Self) -> bool;
}

/// What the four lanes of both halves of a bucket compare to.
#[inline(always)]
fn compared(bucket: &[u32; LANES], value: u32) -> [i32x4; 2] {
    // By name: whether a compiler sees these vector instructions in a loop over the eight depends on its version.
    let halves: [i32x4; 2] = bytemuck::cast(*bucket);
    halves.map(|half| half.cmp_eq(i32x4::splat(value as i32)))
}

impl Slot for u32 {
    #[inline(always)]
    fn new(word: u64) -> Self {
        word as u32
    }

    #[inline(always)]
    fn get(self) -> u64 {
        u64::from(self)
    }

    #[inline(always)]
    fn matches(bucket: &[u32; LANES], value: u32) -> u32 {
        let [low, high] = compared(bucket, value);
        (low.move_mask() | high.move_mask() << 4) as u32
    }

    #[inline(always)]
    fn holds(bucket: &[u32; LANES], value: u32) -> bool {
        let [low, high] = compared(bucket, value);
        (low | high).move_mask() != 0
    }
}

impl Slot for u64 {
    #[inline(always)]
    fn new(word: u64) -> Self {
        word
    }

    #[inline(always)]
    fn get(self) -> u64 {
        self
    }

    #[inline(always)]
    fn matches(bucket: &[u64; LANES], value: u64) -> u32 {
        let low: [u32; LANES] = bucket.map(|slot| slot as u32);
        let high: [u32; LANES] = bucket.map(|slot| (slot >> 32) as u32);
        u32::matches(&low, value as u32) & u32::matches(&high, (value >> 32) as u32)
    }

    #[inline(always)]
    fn holds(bucket: &[u64; LANES], value: u64) -> bool {
        let low: [u32; LANES] = bucket.map(|slot| slot as u32);
        let high: [u32; LANES] = bucket.map(|slot| (slot >> 32) as u32);
        let [a, b] = compared(&low, value as u32);
        let [c, d] = compared(&high, (value >> 32) as u32);
        (a & c | b & d).move_mask() != 0
    }
}

/// Where keys belong in a table of so many buckets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    /// Bits of a key.
    pub(crate) bits: u32,
    /// There are 2 or 3 times 2^log2 buckets.
    times: u64,
    log2: u32,
    /// The same as a number, the factor of keys, and how far tags are shifted: at hand, since it is all asked for each
    /// edge.
    pub(crate) buckets: u64,
    factor: u64,
    shift: u32,
}

impl Shape {
    /// The least for slots whose tags have no more bits than that; never fewer than 64 buckets.
    pub(crate) fn least(bits: u32, tag_bits: u32) -> Self {
        Shape::new(bits, 2, (bits - 1).saturating_sub(tag_bits).max(5))
    }

    pub(crate) fn new(bits: u32, times: u64, log2: u32) -> Self {
        Shape { bits, times, log2, buckets: times << log2, factor: FACTOR << (64 - bits), shift: 64 + log2 + 1 - bits }
    }

    /// Twice as large while it is small, else the next larger, if its buckets can be numbered.
    pub(crate) fn roomier(self) -> Result<Self, Stop> {
        let larger = self.larger()?;
        if larger.buckets < DOUBLES_BELOW { larger.larger() } else { Ok(larger) }
    }

    /// The next larger, if its buckets can be numbered.
    pub(crate) fn larger(self) -> Result<Self, Stop> {
        let (times, log2) = if self.times == 2 { (3, self.log2) } else { (2, self.log2 + 1) };
        Shape::new(self.bits, times, log2).numbered()
    }

    /// The same; an end of memory where its buckets are too many to be numbered, or more than a key has bits to tell: no
    /// set of keys needs so many.
    pub(crate) fn numbered(self) -> Result<Self, Stop> {
        if self.buckets <= BUCKETS_MAX && self.log2 + 1 < self.bits { Ok(self) } else { Err(Stop::Memory) }
    }

    /// The mixed key, in the high bits of a word.
    #[inline(always)]
    pub(crate) fn mix(self, key: u64) -> u64 {
        key.wrapping_mul(self.factor)
    }

    /// The key of a mixed key that stands in the low bits of a word.
    pub(crate) fn unmixed(self, mixed: u64) -> u64 {
        mixed.wrapping_mul(INVERSE) & ((1 << self.bits) - 1)
    }

    /// The bucket of a mixed key, and its slot there. Keys of one bucket differ, in the low half of the product, by
    /// multiples of the number of buckets, so what the power of two below that number spans can be left off.
    #[inline(always)]
    pub(crate) fn seat<S: Slot>(self, mixed: u64) -> (usize, S) {
        let product = u128::from(mixed) * u128::from(self.buckets);
        ((product >> 64) as usize, S::new((product as u64 >> self.shift) << MOVED_BITS | 1))
    }

    /// The mixed key of a slot that has not moved.
    #[inline(always)]
    pub(crate) fn mixed(self, home: usize, slot: u64) -> u64 {
        self.key_of(self.product(home, slot)) << (64 - self.bits)
    }

    /// Half of two or three times a mixed key: the number of its bucket, and below it its tag. Twice as large a table has
    /// the same products, and cuts them in two one bit further down.
    #[inline(always)]
    pub(crate) fn product(self, home: usize, slot: u64) -> u64 {
        (home as u64) << (self.bits - self.log2 - 1) | slot >> MOVED_BITS
    }

    /// The mixed key of a product, in the low bits of a word.
    #[inline(always)]
    pub(crate) fn key_of(self, product: u64) -> u64 {
        if self.times == 2 { product } else { (2 * product).div_ceil(3) }
    }

    /// What `seat` says of a mixed key that stands in the low bits of a word.
    #[inline(always)]
    pub(crate) fn seat_of<S: Slot>(self, key: u64) -> (usize, S) {
        let (product, tag_bits) = (key * self.times / 2, self.bits - self.log2 - 1);
        let tag = product & ((1 << tag_bits) - 1);
        ((product >> tag_bits) as usize, S::new(tag << MOVED_BITS | 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seat_and_mixed_key_say_the_same_at_every_shape() {
        for bits in [16, 31, 44, 60] {
            let mut shape = Shape::least(bits, 58);
            while shape.log2 < bits.min(24) - 4 {
                for i in 0..1000_u64 {
                    let mixed = shape.mix(i.wrapping_mul(0x1234_5678_9abc_def1) % (1 << bits));
                    let (home, slot) = shape.seat::<u64>(mixed);
                    assert!((home as u64) < shape.buckets && slot >> (bits - shape.log2 - 1 + MOVED_BITS) == 0);
                    assert_eq!(shape.mixed(home, slot), mixed);
                    assert_eq!(shape.seat_of::<u64>(mixed >> (64 - bits)), (home, slot));
                }
                shape = shape.larger().expect("few buckets");
            }
        }
    }

    #[test]
    fn buckets_that_32_bits_cannot_number_are_an_end_of_memory_and_the_last_that_they_can_are_told_apart() {
        let last = Shape::new(60, 2, 31);
        assert_eq!(last.buckets, 1 << 32);
        assert!(last.numbered().is_ok());
        assert_eq!(last.larger().err(), Some(Stop::Memory));
        let before = Shape::new(60, 3, 30);
        assert_eq!(before.larger().map(|shape| shape.buckets), Ok(1 << 32));
        assert_eq!(Shape::least(60, 26).numbered().err(), Some(Stop::Memory));
        for shape in [before, last] {
            let highest = u64::MAX << 4;
            let (home, slot) = shape.seat::<u64>(highest);
            assert_eq!(home as u64, shape.buckets - 1);
            assert_eq!(shape.mixed(home as u32 as usize, slot), highest);
        }
    }

    #[test]
    fn a_table_doubles_while_it_is_small_and_takes_every_size_from_then_on() {
        let mut shape = Shape::least(44, 58);
        let mut sizes = Vec::new();
        while shape.buckets < 1 << 18 {
            sizes.push(shape.buckets);
            shape = shape.roomier().expect("few buckets");
        }
        let large = sizes.iter().position(|&size| size == DOUBLES_BELOW).expect("a power of two");
        assert!(large > 5 && sizes[..=large].windows(2).all(|two| two[1] == 2 * two[0]));
        assert_eq!(sizes[large..].iter().map(|size| size >> 15).collect::<Vec<_>>(), [2, 3, 4, 6]);
        assert_eq!(Shape::new(60, 2, 31).roomier().err(), Some(Stop::Memory));
        assert_eq!(Shape::new(16, 3, 13).roomier().map(|shape| shape.buckets), Ok(3 << 14));
        assert_eq!(Shape::new(16, 3, 14).roomier().err(), Some(Stop::Memory), "a bucket for each two keys");
        assert_eq!(Shape::new(44, 3, 10).roomier().map(|shape| shape.buckets), Ok(3 << 11));
    }

    #[test]
    fn matches_names_each_lane_that_is_equal_and_no_other() {
        let values = [7_u64, 1 << 40 | 7, 7, 0, 1 << 40, 7 << 32, 9, 7];
        for (value, expected) in [(7, 0b1000_0101), (1 << 40 | 7, 0b10), (0, 0b1000), (8, 0)] {
            assert_eq!(u64::matches(&values, value), expected);
            assert_eq!(u64::holds(&values, value), expected != 0);
        }
        assert_eq!(u32::matches(&values.map(|value| value as u32), 7), 0b1000_0111);
        for lane in 0..LANES {
            let one: [u32; LANES] = std::array::from_fn(|at| if at == lane { 9 } else { 8 });
            assert!(u32::matches(&one, 9) == 1 << lane && u32::holds(&one, 9) && !u32::holds(&one, 7));
            let wide = one.map(|slot| u64::from(slot) << 32 | 5);
            assert!(
                u64::holds(&wide, 9 << 32 | 5) && !u64::holds(&wide, 9 << 32 | 6) && !u64::holds(&wide, 7 << 32 | 5)
            );
        }
        assert_eq!(u32::matches(&[u32::MAX; LANES], u32::MAX), 0b1111_1111);
    }

    #[test]
    fn a_mixed_key_gives_its_key_back() {
        for bits in [16, 33, 60] {
            let shape = Shape::new(bits, 3, 7);
            for key in (0..1000_u64).map(|i| i.wrapping_mul(FACTOR) >> (64 - bits)) {
                assert_eq!(shape.unmixed(shape.mix(key) >> (64 - bits)), key);
            }
        }
    }
}
