//! Which of two threads a marking belongs to: the parity of its tokens on a few places.
//!
//! Whatever a firing does to that parity it does everywhere, so most transitions never lead from one side to the other, and
//! the few that touch an odd number of these places always do. And the parity of tokens on a few places that have little to
//! do with each other is even in about half of the markings, even where each of them is marked in a fourth.
//!
//! The places are chosen by what was found so far: one after the other whichever lowers what a firing is expected to
//! cost most, by the markings of the last two levels and by how often each transition is looked up in the last one. If levels
//! turn out to be shared out badly later, they are chosen anew.
//!
//! A parity is linear and so is the key of a marking (`span.rs`), so the side of a key is the parity of some of its bits.

use crate::batch::Batch;
use crate::explore::Space;
use crate::marking::{Width, holds};
use crate::net::Net;
use crate::sleep::{Asleep, Sleeping};
use crate::span::Span;
use crate::spread::Spread;

/// Blocks of 64 markings that are looked at, and most bytes of them: of very wide nets fewer.
const SAMPLE: usize = 64;
const SAMPLE_BYTES: usize = 1 << 22;
/// Most places whose tokens are counted.
const PLACES_MOST: usize = 12;
/// What it costs more to hand a firing over, as a part of what a firing costs.
const HANDING_OVER: f64 = 0.2;
/// By how much of 1 a single place may divide later levels unevenly: what was found so far says little of them.
const LATER: f64 = 0.6;
/// What a place more must save, as the same part.
const LEAST_GAIN: f64 = 0.001;

/// Sides of markings.
#[derive(Clone, Debug)]
pub(crate) struct Parting {
    places: Vec<u32>,
    /// For each transition, whether it leads from one side to the other.
    pub(crate) crosses: Vec<bool>,
    /// The bits of a key whose parity is the side, and whether it is the other way round.
    mask: u64,
    odd: bool,
}

impl Parting {
    /// The best for what was found of a net, unless it loses more of the time of two threads than that. The markings from the
    /// first of `from` on are looked at; those from the second on are to be expanded.
    pub(crate) fn choose<W: Width>(
        width: W,
        space: &Space,
        (span, spread): (&Span, &Spread),
        from: [usize; 2],
        sleeping: &Sleeping,
        loss_most: f64,
    ) -> Option<Self> {
        let net = &space.net;
        let flips: Vec<Vec<u32>> = (0..net.transitions.len()).map(|t| flipped(net, t, width.words())).collect();
        let mut touching = vec![Vec::new(); 64 * width.words()];
        let sample = Sample::take(width, space, from, sleeping);
        for (t, flipped) in flips.iter().enumerate().filter(|&(t, _)| sample.asked[t] > 0) {
            flipped.iter().for_each(|&p| touching[p as usize].push(t));
        }
        let all = sample.asked.iter().sum::<i64>().max(1) as f64;
        let (mut places, mut parity) = (Vec::new(), vec![0; sample.blocks]);
        let (mut crosses, mut crossing, mut loss) = (vec![false; flips.len()], 0_i64, 1.0);
        while places.len() < PLACES_MOST {
            let may = |&p: &usize| !touching[p].is_empty() && !places.contains(&(p as u32));
            let candidates = (0..touching.len()).filter(may).map(|p| {
                let more: i64 =
                    touching[p].iter().map(|&t| if crosses[t] { -sample.asked[t] } else { sample.asked[t] }).sum();
                let imbalance = sample.imbalance(&parity, p).max(LATER.powi(places.len() as i32 + 1));
                let loss = imbalance + HANDING_OVER * (crossing + more) as f64 / all;
                (loss, p, more)
            });
            let Some((least, p, more)) = candidates.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            if least > loss - LEAST_GAIN {
                break;
            }
            (loss, crossing) = (least, crossing + more);
            places.push(p as u32);
            sample.add(&mut parity, p);
            touching[p].iter().for_each(|&t| crosses[t] = !crosses[t]);
        }
        // Of transitions that have not fired yet as well.
        for (crosses, flipped) in crosses.iter_mut().zip(&flips) {
            *crosses = flipped.iter().filter(|p| places.contains(p)).count() % 2 == 1;
        }
        let side = |key| {
            let mut marking = vec![0; width.words()];
            spread.marking(key, &mut marking);
            places.iter().filter(|&&p| holds(&marking, p)).count() % 2 == 1
        };
        let odd = side(0);
        let mask = (0..span.bits).filter(|&bit| side(1 << bit) != odd).map(|bit| 1 << bit).sum();
        (loss <= loss_most).then_some(Parting { places, crosses, mask, odd })
    }

    /// The side of a key.
    #[inline(always)]
    pub(crate) fn of_key(&self, key: u64) -> usize {
        usize::from((key & self.mask).count_ones() % 2 == 1) ^ usize::from(self.odd)
    }

    /// A bit for each marking of a batch that is on side 1; of bits that stand for no marking, nothing.
    #[inline(always)]
    pub(crate) fn of_batch(&self, slices: &[u64]) -> u64 {
        self.places.iter().fold(0, |sides, &place| sides ^ slices[place as usize])
    }
}

/// The places whose tokens a firing changes.
fn flipped(net: &Net, t: usize, words: usize) -> Vec<u32> {
    let mut flipped = Vec::new();
    for (k, &word) in net.flip(t, words).iter().enumerate() {
        let mut rest = word;
        while rest != 0 {
            flipped.push(64 * k as u32 + rest.trailing_zeros());
            rest &= rest - 1;
        }
    }
    flipped
}

/// Some markings of the last two levels, a word of 64 of them for each place and block; and how often each transition is looked
/// up in those of the last.
struct Sample {
    blocks: usize,
    asked: Vec<i64>,
    slices: Vec<u64>,
    valid: Vec<u64>,
}

impl Sample {
    fn take<W: Width>(width: W, space: &Space, [first, level]: [usize; 2], sleeping: &Sleeping) -> Self {
        let end = space.len();
        let (mut batch, mut asleep) = (Batch::new(&space.net), Asleep::new(&sleeping.sleep));
        let mut asked = vec![0; space.net.transitions.len()];
        let (mut slices, mut valid) = (Vec::new(), Vec::new());
        let blocks = SAMPLE.min(SAMPLE_BYTES / (8 * 64 * width.words())).max(1);
        let step = (end - first).div_ceil(64).div_ceil(blocks).max(1);
        for first in (first..end).step_by(64 * step) {
            batch.markings.clear();
            space.table.store.copy_range(first, end.min(first + 64), &mut batch.markings);
            batch.slice(width);
            slices.push(batch.slices.clone());
            valid.push(batch.valid);
        }
        let step = (end - level).div_ceil(64).div_ceil(blocks).max(1);
        for first in (level..end).step_by(64 * step) {
            batch.markings.clear();
            space.table.store.copy_range(first, end.min(first + 64), &mut batch.markings);
            batch.slice(width);
            asleep.cut(sleeping.trail.of(first, end.min(first + 64)));
            for (t, asked) in asked.iter_mut().enumerate() {
                let fire = space.net.forward.fire(t, &batch.slices, batch.valid);
                *asked += i64::from((fire & !asleep.of(&sleeping.sleep, t)).count_ones());
            }
        }
        // Place by place.
        let by_place = (0..64 * width.words()).flat_map(|p| slices.iter().map(move |of| of[p])).collect();
        Sample { blocks: valid.len(), asked, slices: by_place, valid }
    }

    /// By how much, of 1, the sides differ in size if the tokens of a place are counted as well.
    fn imbalance(&self, parity: &[u64], place: usize) -> f64 {
        let slices = &self.slices[place * self.blocks..(place + 1) * self.blocks];
        let bits = parity.iter().zip(slices).zip(&self.valid).map(|((a, b), valid)| (a ^ b) & valid);
        let odd: u32 = bits.map(u64::count_ones).sum();
        let all: u32 = self.valid.iter().map(|valid| valid.count_ones()).sum();
        (f64::from(all) - 2.0 * f64::from(odd)).abs() / f64::from(all.max(1))
    }

    fn add(&self, parity: &mut [u64], place: usize) {
        let slices = &self.slices[place * self.blocks..(place + 1) * self.blocks];
        parity.iter_mut().zip(slices).for_each(|(parity, slice)| *parity ^= slice);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::marking::Dynamic;
    use crate::samples::{explore, machines, random_spaces};

    fn chosen(space: &Space, loss_most: f64) -> Option<(Span, Parting)> {
        let span = Span::new(&space.net).expect("few places");
        let spread = Spread::new(&space.net, &span);
        let width = Dynamic(space.net.words);
        let sleeping = Sleeping::new(&space.net, &space.memory);
        let parting = Parting::choose(width, space, (&span, &spread), [0, 0], &sleeping, loss_most);
        sleeping.leave(&space.memory);
        let parting = parting?;
        Some((span, parting))
    }

    #[test]
    fn the_side_of_a_key_a_marking_and_a_firing_are_one() {
        let mut crossings = 0;
        for space in random_spaces(300, false) {
            let Some((span, parting)) = chosen(&space, f64::INFINITY) else { panic!("any loss will do") };
            let mut batch = Batch::new(&space.net);
            for index in 0..space.len() {
                let marking = space.marking(index);
                batch.markings.clear();
                batch.markings.extend_from_slice(marking);
                batch.slice(Dynamic(space.net.words));
                let side = parting.of_key(span.key(marking));
                assert_eq!(parting.of_batch(&batch.slices) as usize & 1, side);
                for t in space.enabled_by(&space.net.forward, marking) {
                    let flip = space.net.flip(t as usize, space.net.words);
                    let after: Vec<u64> = marking.iter().zip(flip).map(|(a, b)| a ^ b).collect();
                    let crosses = parting.of_key(span.key(&after)) != side;
                    assert_eq!(parting.crosses[t as usize], crosses);
                    crossings += usize::from(crosses);
                }
            }
        }
        assert!(crossings > 1000);
    }

    #[test]
    fn independent_machines_are_cut_in_equal_halves_by_few_of_them() {
        let space = explore(machines(12, 0), false);
        let (span, parting) = chosen(&space, 0.3).expect("a good one");
        let odd = (0..space.len()).filter(|&index| parting.of_key(span.key(space.marking(index))) == 1).count();
        assert_eq!(odd, space.len() / 2);
        assert!(parting.crosses.iter().filter(|&&crosses| crosses).count() < parting.crosses.len());
    }

    #[test]
    fn what_would_lose_too_much_is_not_chosen() {
        // A token that goes round: every place halves it badly.
        let ring = (0..40).map(|p| crate::net::Transition::new(&[p], &[(p + 1) % 40], &[], &[], &[])).collect();
        let space = explore(Net::new(40, ring, &[0]).expect("well formed"), false);
        assert!(chosen(&space, 0.05).is_none() && chosen(&space, f64::INFINITY).is_some());
    }
}
