//! The markings from which a run can go on for ever inside a set: EG over infinite runs.
//!
//! It is the greatest fixed point of "in the set, with a firing into it": round by round those markings are taken away
//! from which no firing leads to one that is left. That takes as many rounds as the longest run inside which must end,
//! and what is left between two rounds, "can go on k times", has no shape that a diagram would be small for: hundreds of
//! rounds on sets of fifty thousand nodes, for a result of two thousand. Two short cuts are taken beside the rounds:
//!
//! - *Cycles.* A short search inside the set, from a marking that is drawn, comes round at one. Of what is fired between, the firings that have
//!   places to do with each other are kept, if they alone come round too. Whatever marking agrees on the places that these
//!   touch, and stays in the set while they fire, comes round as well: that is a few images of single transitions, and
//!   often a large part of the set at once. From all that leads to these inside the set, which saturation finds at once, a
//!   run goes on for ever; it is put aside, and from what is left no firing leads there.
//! - *No cycle.* A cycle puts a token back on each place that it takes one from, and takes one from each that it puts one
//!   on. So transitions that fire inside the set, but have no partner among the others that do, are on no cycle; where
//!   none is left, no run goes on for ever, and the rest of the rounds is spared.
//!
//! Both are tried after 1, 2, 4, 8 ... rounds, so that what converges at once pays nothing for them, and not before the
//! rounds have cost something: on a small diagram hundreds of them are done before one short cut is. What the short cuts
//! leave undecided the rounds decide; no answer depends on luck.
//!
//! Sources: the fixed point is that of Emerson and Clarke (1980); cycles of a set by saturation are Zhao and Ciardo,
//! "Symbolic computation of strongly connected components and fair cycles using saturation" (2011), whose transitive
//! closure, a relation over two copies of all places, was rejected: it is far larger than the sets. Rejected, too:
//! components one after the other by the closures of one marking forwards and backwards (Xie, Beerel 2000): machines that
//! do not touch each other have as many components as there are choices of where each of them has come to rest.

use std::collections::HashMap;

use super::algebra::Binary;
use super::space::{By, Events, Symbolic};
use super::walk::{Marking, Moves, holds, tokens};
use super::zdd::{EMPTY, Node, TERMINAL};
use crate::budget::{Stop, Watch};
use crate::random::Random;

/// Results of the diagram's that the rounds take before a short cut is tried.
const PLAIN: u64 = 1 << 16;
/// Searches in vain, one after the other, that are made at least.
const IN_VAIN: usize = 4;
/// Markings that one search may meet.
const MET_MAX: usize = 2_000;
/// Transitions that are tested, or places looked at, in the time of one result of the diagram's.
const PER_RESULT: u64 = 16;

impl Symbolic {
    /// The markings of a set from which a run can go on for ever inside it.
    pub fn endless(&mut self, roots: &[Node], set: Node, watch: &mut Watch<'_>) -> Result<Node, Stop> {
        self.endless_after(PLAIN, roots, set, watch)
    }

    /// The same, by rounds alone until they have taken so many results of the diagram's.
    pub fn endless_after(
        &mut self,
        plain: u64,
        roots: &[Node],
        set: Node,
        watch: &mut Watch<'_>,
    ) -> Result<Node, Stop> {
        let mut found = EMPTY;
        let mut left = set;
        let (mut rounds, mut pause) = (0, 1);
        let mut hunt: Option<Hunt> = None;
        let begun = self.diagram().cache.work;
        loop {
            let held = [roots, &[found, left]].concat();
            let before = self.before(&held, left, watch)?;
            let fewer = self.binary(&held, Binary::Intersection, left, before, watch)?;
            if fewer == left {
                return self.binary(&held, Binary::Union, found, left, watch);
            }
            left = fewer;
            rounds += 1;
            let spent = self.diagram().cache.work - begun;
            if rounds < pause || spent < plain || left == EMPTY {
                continue;
            }
            pause = 2 * rounds;
            let hunt = hunt.get_or_insert_with(|| Hunt::new(self));
            // As much as the rounds have taken may be spent in vain, and something in any case.
            let before = hunt.work as u64;
            let mut in_vain = 0;
            while left != EMPTY && (in_vain < IN_VAIN || (hunt.work as u64 - before) / PER_RESULT < spent) {
                let held = [roots, &[found, left]].concat();
                let cycling = match hunt.cycle(self, left, watch)? {
                    Some((marking, word)) => self.coming_round(&held, left, hunt, &marking, &word, watch)?,
                    None => EMPTY,
                };
                if cycling == EMPTY {
                    in_vain += 1;
                    continue;
                }
                let leading = self.closure(&[held, vec![cycling]].concat(), cycling, left, By::Backward, watch)?;
                let held = [roots, &[found, left, leading]].concat();
                found = self.binary(&held, Binary::Union, found, leading, watch)?;
                left = self.binary(&[held, vec![found]].concat(), Binary::Difference, left, leading, watch)?;
            }
            if self.has_no_cycle(&[roots, &[found, left]].concat(), left, watch)? {
                return Ok(found);
            }
        }
    }

    /// The markings of a set that agree with one on what a word of firings touches, and come round by it inside the set.
    fn coming_round(
        &mut self,
        roots: &[Node],
        set: Node,
        hunt: &Hunt,
        marking: &Marking,
        word: &[usize],
        watch: &mut Watch<'_>,
    ) -> Result<Node, Stop> {
        let mut touched: Vec<u32> = word.iter().flat_map(|&t| hunt.moves.levels(t)).collect();
        touched.sort_unstable();
        touched.dedup();
        let (full, empty): (Vec<u32>, Vec<u32>) = touched.iter().partition(|&&level| marking[level as usize]);
        let places = |levels: Vec<u32>| levels.iter().map(|&at| self.place_at()[at as usize]).collect::<Vec<_>>();
        let (full, empty) = (places(full), places(empty));
        let agreeing = self.having(roots, set, &full, &empty, watch)?;
        let held = [roots, &[set, agreeing]].concat();
        let mut coming = agreeing;
        for &t in word.iter().rev() {
            let before = self.one(&held, coming, t, Events::Backward, watch)?;
            coming = self.binary(&held, Binary::Intersection, before, set, watch)?;
        }
        Ok(coming) // which agree as well: a word that comes round changes nothing on the whole
    }

    /// Whether it can be seen from what fires inside a set that no run comes round in it.
    fn has_no_cycle(&mut self, roots: &[Node], set: Node, watch: &mut Watch<'_>) -> Result<bool, Stop> {
        let tests: Vec<_> = { self.transitions.iter() }
            .map(|t| ([&t.inputs[..], &t.permissive].concat(), [&t.outputs[..], &t.inhibitive].concat()))
            .collect();
        let fires = self.which(roots, set, &tests, watch)?;
        let mut able: Vec<usize> = (0..fires.len()).filter(|&t| fires[t]).collect();
        if self.without_partner(&mut able) && able.is_empty() {
            return Ok(true);
        }
        let held = [roots, &[set]].concat();
        let mut inside = Vec::with_capacity(able.len());
        for &t in &able {
            let before = self.one(&held, set, t, Events::Backward, watch)?;
            if self.binary(&held, Binary::Intersection, before, set, watch)? != EMPTY {
                inside.push(t);
            }
        }
        self.without_partner(&mut inside);
        Ok(inside.is_empty())
    }

    /// Takes away the transitions that take a token none of the others puts back, or put one that none takes away.
    ///
    /// True where some were taken away.
    fn without_partner(&self, able: &mut Vec<usize>) -> bool {
        let before = able.len();
        loop {
            let (mut taken, mut put) = (vec![false; self.level_of().len()], vec![false; self.level_of().len()]);
            for &t in able.iter() {
                self.transitions[t].inputs.iter().for_each(|&p| taken[p as usize] = true);
                self.transitions[t].outputs.iter().for_each(|&p| put[p as usize] = true);
            }
            let count = able.len();
            able.retain(|&t| {
                let transition = &self.transitions[t];
                transition.inputs.iter().all(|&p| put[p as usize])
                    && transition.outputs.iter().all(|&p| taken[p as usize])
            });
            if able.len() == count {
                return count < before;
            }
        }
    }
}

/// Short searches for cycles.
struct Hunt {
    moves: Moves,
    random: Random,
    work: usize,
}

impl Hunt {
    fn new(space: &Symbolic) -> Self {
        Hunt { moves: space.moves(), random: Random::new(1), work: 0 }
    }

    /// A marking of a set, and firings that come round to it inside the set; None where the search does not come round.
    ///
    /// It goes depth first, back where it cannot go on.
    fn cycle(
        &mut self,
        space: &mut Symbolic,
        set: Node,
        watch: &mut Watch<'_>,
    ) -> Result<Option<(Marking, Vec<usize>)>, Stop> {
        let mut marking = self.drawn(space, set);
        let mut depths = HashMap::from([(marking.clone(), Some(0))]);
        let (mut word, mut untried) = (Vec::new(), vec![self.firable(&marking, watch)?]);
        while let Some(left) = untried.last_mut() {
            let last = word.last().copied();
            if left.is_empty() || depths.len() > MET_MAX {
                depths.insert(marking.clone(), None);
                untried.pop();
                word.pop().into_iter().for_each(|t| self.moves.flip(t, &mut marking));
                continue;
            }
            // What goes on with a token that was just moved comes round soonest.
            let follows = |&t: &usize| last.is_some_and(|last| self.moves.follows(t, last));
            let at = left.iter().position(follows).unwrap_or_else(|| self.random.below(left.len()));
            let t = left.swap_remove(at);
            self.moves.flip(t, &mut marking);
            self.work += marking.len();
            watch.tick(1 + marking.len() / 8)?;
            let inside = holds(&space.diagram().store, set, &marking, tokens(&marking));
            match depths.get(&marking) {
                Some(&Some(begin)) if inside => {
                    let mut round = word.split_off(begin);
                    round.push(t);
                    return Ok(Some((marking.clone(), self.least(space, set, &marking, round))));
                }
                None if inside => {
                    word.push(t);
                    depths.insert(marking.clone(), Some(word.len()));
                    untried.push(self.firable(&marking, watch)?);
                }
                _ => self.moves.flip(t, &mut marking),
            }
        }
        Ok(None)
    }

    fn firable(&mut self, marking: &Marking, watch: &mut Watch<'_>) -> Result<Vec<usize>, Stop> {
        self.work += self.moves.len();
        watch.tick(self.moves.len())?;
        Ok((0..self.moves.len()).filter(|&t| self.moves.fires(t, marking)).collect())
    }

    /// A marking of a set that is not empty, drawn.
    fn drawn(&mut self, space: &mut Symbolic, set: Node) -> Marking {
        let mut marking = vec![false; space.level_of().len() + 1];
        let store = &space.diagram().store;
        let mut node = set;
        while store.level(node) != TERMINAL {
            let full = store.lo(node) == EMPTY || self.random.below(2) == 1;
            marking[store.level(node) as usize] = full;
            node = if full { store.hi(node) } else { store.lo(node) };
        }
        marking
    }

    /// The fewest of the firings of a word that have to do with each other and come round by themselves, inside the set.
    fn least(&self, space: &mut Symbolic, set: Node, marking: &Marking, word: Vec<usize>) -> Vec<usize> {
        // Each level that is flipped belongs to the part of whoever flipped it first.
        let mut part: Vec<usize> = (0..word.len()).collect();
        let mut owner: HashMap<u32, usize> = HashMap::new();
        for (i, &t) in word.iter().enumerate() {
            for level in self.moves.flipped(t) {
                let one = *owner.entry(level).or_insert(i);
                let (from, to) = (part[i], part[one]);
                part.iter_mut().filter(|part| **part == from).for_each(|part| *part = to);
            }
        }
        let mut parts: Vec<Vec<usize>> = Vec::new();
        let mut seen: HashMap<usize, usize> = HashMap::new();
        for (i, &t) in word.iter().enumerate() {
            let at = *seen.entry(part[i]).or_insert_with(|| {
                parts.push(Vec::new());
                parts.len() - 1
            });
            parts[at].push(t);
        }
        parts.sort_by_key(Vec::len);
        let comes_round = |part: &Vec<usize>| {
            let mut at = marking.clone();
            part.iter().all(|&t| {
                let fires = self.moves.fires(t, &at);
                self.moves.flip(t, &mut at);
                fires && holds(&space.diagram().store, set, &at, tokens(&at))
            }) && at == *marking
        };
        let least = parts.into_iter().find(comes_round);
        least.unwrap_or(word)
    }
}
