//! Firing sequences: how a marking of a set is reached, one transition after another.
//!
//! Saturation adds markings in no order that a run could follow, so it leaves no way behind. Two are tried:
//!
//! 1. layers of a breadth-first search from M0, each found by one image of all transitions, until one meets the targets; then
//!    back through the layers. The sequence is a shortest one. The work spent on it is bounded, because five thousand
//!    philosophers need as many layers to starve;
//! 2. block by block (`blockwise`), which is hardly longer. What it finds is kept, and comes before it where it leads into
//!    other targets as well.
//!
//! The rejected alternative, to keep in every node how far it is from M0 (edge-valued diagrams), gives shortest sequences by
//! saturation, at a multiple of the nodes for every net that no sequence is asked of. Firings at random towards a deadlock,
//! and what makes the difference to one target smaller among the markings that lead there, were done before: they run
//! into millions of firings where a deadlock is rare, and into hollows that no bounded search leaves.

use super::algebra::Binary;
use super::space::{Events, Symbolic};
use super::walk::{Marking, Moves, Walk, holds, tokens};
use super::zdd::{EMPTY, Node};
use crate::budget::{Stop, Watch};

impl Symbolic {
    /// A firing sequence into a set of reachable markings; None where the set is empty.
    pub fn walk_to(&mut self, roots: &[Node], targets: Node, watch: &mut Watch<'_>) -> Result<Option<Walk>, Stop> {
        let targets = self.binary(roots, Binary::Intersection, targets, self.reach, watch)?;
        if targets == EMPTY {
            return Ok(None);
        }
        let roots = &[roots, &[targets]].concat();
        let moves = self.moves();
        if let Some(walk) = self.by_layers(roots, targets, &moves, self.walks.layers_work, watch)? {
            return Ok(Some(walk));
        }
        self.walks.in_vain();
        if let Some(walk) = self.walks.found.iter().find(|walk| self.contains(targets, &walk.reached)) {
            return Ok(Some(walk.clone())); // verdicts ask for sets that are alike
        }
        let mut marking = self.first();
        let firings = self.block_by_block(roots, targets, &mut marking, &moves, watch)?;
        let walk = self.walk(firings, &marking, false);
        self.walks.found.push(walk.clone());
        Ok(Some(walk))
    }

    pub(super) fn moves(&self) -> Moves {
        Moves::new(&self.transitions, self.level_of())
    }

    pub(super) fn first(&self) -> Marking {
        let mut marking = vec![false; self.level_of().len() + 1];
        self.initial.iter().for_each(|&place| marking[self.level_of()[place as usize] as usize] = true);
        marking
    }

    fn walk(&self, firings: Vec<u32>, end: &Marking, shortest: bool) -> Walk {
        let marked = (1..end.len()).filter(|&level| end[level]);
        let mut reached: Vec<u32> = marked.map(|level| self.place_at()[level]).collect();
        reached.sort_unstable();
        Walk { firings, reached, shortest }
    }

    /// A shortest sequence, if so much work and the memory suffice for its layers; block by block needs less of both.
    pub(super) fn by_layers(
        &mut self,
        roots: &[Node],
        targets: Node,
        moves: &Moves,
        work: u64,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Walk>, Stop> {
        match self.layered(roots, targets, moves, work, watch) {
            Err(Stop::Memory) => Ok(None),
            result => result,
        }
    }

    fn layered(
        &mut self,
        roots: &[Node],
        targets: Node,
        moves: &Moves,
        work: u64,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Walk>, Stop> {
        let end = self.diagram().cache.work.saturating_add(work);
        let (mut layers, mut seen) = (vec![self.start], self.start);
        loop {
            let last = layers[layers.len() - 1];
            let held = [roots, &layers, &[seen, targets]].concat();
            let met = self.binary(&held, Binary::Intersection, last, targets, watch)?;
            if let Some(levels) = self.diagram().any(met) {
                return self.back_through(&layers, &levels, moves).map(Some);
            }
            if self.diagram().cache.work >= end {
                return Ok(None);
            }
            let after = self.all(&held, last, Events::Forward, watch)?;
            let held = [held, vec![after]].concat();
            let fresh = self.binary(&held, Binary::Difference, after, seen, watch)?;
            if fresh == EMPTY {
                return Ok(None); // the targets are not reachable, which the caller has excluded
            }
            let held = [held, vec![fresh]].concat();
            seen = self.binary(&held, Binary::Union, seen, fresh, watch)?;
            layers.push(fresh);
        }
    }

    fn back_through(&mut self, layers: &[Node], levels: &[u32], moves: &Moves) -> Result<Walk, Stop> {
        let mut marking: Marking = vec![false; self.level_of().len() + 1];
        levels.iter().for_each(|&level| marking[level as usize] = true);
        let walk_end = marking.clone();
        let mut firings = Vec::with_capacity(layers.len());
        for &layer in layers.iter().rev().skip(1) {
            let store = &self.diagram().store;
            let step = (0..moves.len()).find(|&t| {
                moves.fired(t, &marking) && {
                    moves.flip(t, &mut marking);
                    let found = holds(store, layer, &marking, tokens(&marking));
                    if !found {
                        moves.flip(t, &mut marking);
                    }
                    found
                }
            });
            // A layer is made of the successors of the one before.
            firings.push(step.ok_or(Stop::Interrupted)? as u32);
        }
        firings.reverse();
        Ok(self.walk(firings, &walk_end, true))
    }
}

#[cfg(test)]
mod tests {
    use super::super::walk::LAYERS_WORK_LEAST;
    use super::*;
    use crate::budget::unwatched;
    use crate::net::Transition;

    /// Philosophers who may take either fork first; both deadlocks are as many firings away as there are philosophers.
    fn philosophers(n: u32) -> Symbolic {
        let place = |i: u32, what: u32| i % n * 5 + what; // thinking, fork, left, right, eating
        let transitions = (0..n).flat_map(|i| {
            let (thinks, left, right) = (place(i, 0), place(i, 1), place(i + 1, 1));
            let takes = [(thinks, left, 2), (thinks, right, 3), (place(i, 2), right, 4), (place(i, 3), left, 4)]
                .map(|(from, fork, what)| Transition::new(&[from, fork], &[place(i, what)], &[], &[], &[]));
            takes.into_iter().chain([Transition::new(&[place(i, 4)], &[thinks, left, right], &[], &[], &[])])
        });
        let initial = (0..n).flat_map(|i| [place(i, 0), place(i, 1)]).collect();
        let (mut poll, transitions) = (unwatched, transitions.collect());
        let watch = &mut Watch::new(None, &mut poll);
        Symbolic::explore(5 * n as usize, transitions, initial, 1 << 24, None, watch).expect("enough room")
    }

    #[test]
    fn a_way_that_took_a_search_of_its_own_is_short_and_shows_no_target_that_it_does_not_lead_into() {
        let (mut space, mut poll) = (philosophers(60), unwatched);
        space.walks.layers_work = LAYERS_WORK_LEAST; // in which so many layers are not found
        let watch = &mut Watch::new(None, &mut poll);
        let reach = space.reach;
        let alive = space.all(&[], reach, Events::Tests, watch).expect("enough room");
        let deadlocks = space.binary(&[], Binary::Difference, reach, alive, watch).expect("enough room");
        let mut walk_to = |targets: Node| {
            let walk = space.walk_to(&[deadlocks, targets], targets, watch).expect("enough room");
            let walk = walk.expect("there are deadlocks");
            let reached = space.single(&[deadlocks], &walk.reached).expect("enough room");
            let held = [deadlocks, reached];
            let others = space.binary(&held, Binary::Difference, deadlocks, reached, watch).expect("enough room");
            (walk, others)
        };
        let (walk, _) = walk_to(deadlocks);
        assert_eq!((walk.firings.len(), walk.shortest), (60, false));
        let (again, other) = walk_to(deadlocks);
        assert_eq!(again, walk);
        let (away, _) = walk_to(other);
        assert!(away.firings.len() < 75 && away.reached != walk.reached);
    }
}
