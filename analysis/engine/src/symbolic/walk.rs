//! Firing sequences: how a marking of a set is reached, one transition after another.
//!
//! Saturation adds markings in no order that a run could follow, so it leaves no way behind. Four are tried:
//!
//! 1. layers of a breadth-first search from M0, each found by one image of all transitions, until one meets the targets; then
//!    back through the layers. The sequence is a shortest one. The work spent on it is bounded, because five thousand
//!    philosophers need as many layers to starve;
//! 2. where the targets are deadlocks, and a part of that work was in vain, firings drawn at random and by how few could
//!    fire next (`stubborn::walk`): they run into one in milliseconds, and what it does not need is cut away. If that is
//!    still long, the same deadlock is aimed at as below, with bounded work;
//! 3. downhill: of all targets the one that differs from M0 in the fewest places is aimed at, and fired is what makes the
//!    difference smaller without leaving the markings from which the target can be reached. So the walk never goes
//!    astray for good; where nothing makes the difference smaller, a bounded search by the smallest difference looks for
//!    a marking that is nearer;
//! 4. the layers again, with no bound but memory and time.
//!
//! What the second and the third find is kept, and comes before them where it leads into other targets as well.
//!
//! The rejected alternative, to keep in every node how far it is from M0 (edge-valued diagrams), gives shortest sequences by
//! saturation, at a multiple of the nodes for every net that no sequence is asked of.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap, HashSet};

use super::algebra::Binary;
use super::cache::ANY;
use super::events::{Kind, Sense, literals};
use super::space::{By, Events, Symbolic};
use super::zdd::{EMPTY, Node, Store, TERMINAL};
use crate::budget::{Stop, Watch};
use crate::marking::words_for;
use crate::net::Net;
use crate::stubborn::dependencies::Dependencies;
use crate::stubborn::walk::{Target, walk};

/// The results that the first search for layers may compute. Where the layers did not lead into one set they hardly lead
/// into the next, so each search in vain leaves a fraction of it to those after it, down to the least.
pub(super) const LAYERS_WORK: u64 = 8_000_000;
const LAYERS_WORK_LEAST: u64 = 250_000;
const IN_VAIN: u64 = 8;
/// The firings that are drawn at random, all together, and how many deadlocks that are no targets they may end in.
const DRAWN_MAX: u64 = 1 << 22;
const OTHERS_MAX: u64 = 1 << 6;
/// A sequence that was drawn is taken as it is if it has at most so many times the firings that are needed at least.
const HARDLY_LONGER: usize = 2;
/// The part of the memory that the masks of the net may take for them.
const MASKS_SHARE: usize = 8;
/// The markings that one search for a way out of a hollow may look at.
const HOLLOW_MAX: usize = 20_000;

/// A firing sequence from M0, by the indexes of transitions, and the places that hold a token after it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Walk {
    /// What fires, in turn.
    pub firings: Vec<u32>,
    /// The places that hold a token in the end, ascending.
    pub reached: Vec<u32>,
    /// Whether no other sequence into the targets is shorter.
    pub shortest: bool,
}

/// What a search downhill may take: results of the diagram, markings in all hollows, and fewer firings than these.
#[derive(Clone, Copy)]
struct Effort {
    results: u64,
    markings: usize,
    firings: usize,
}

/// Whatever it takes; each hollow has its own bound all the same.
const NO_END: Effort = Effort { results: u64::MAX, markings: usize::MAX, firings: usize::MAX };

/// A marking: for each level from 1 whether its place holds a token.
pub(super) type Marking = Vec<bool>;

/// Whether a set holds a marking of so many tokens.
pub(super) fn holds(store: &Store, set: Node, marking: &Marking, tokens: usize) -> bool {
    let (mut node, mut met) = (set, 0);
    while store.level(node) != TERMINAL {
        if marking[store.level(node) as usize] {
            met += 1;
            node = store.hi(node);
        } else {
            node = store.lo(node);
        }
    }
    node != EMPTY && met == tokens
}

/// How many tokens there are.
pub(super) fn tokens(marking: &Marking) -> usize {
    marking.iter().filter(|&&token| token).count()
}

/// The moves of a net by level; a transition that never fires has none.
pub(super) struct Moves(Vec<Option<Vec<(u32, Kind)>>>);

impl Moves {
    /// The moves of a space's net.
    pub(super) fn of(space: &Symbolic) -> Self {
        Moves(space.transitions.iter().map(|t| literals(t, space.level_of(), Sense::Forward)).collect())
    }

    /// How many transitions there are.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// The levels that a transition has to do with.
    pub(super) fn levels(&self, t: usize) -> impl Iterator<Item = u32> + '_ {
        self.0[t].iter().flatten().map(|&(level, _)| level)
    }

    /// The levels that its firing changes.
    pub(super) fn flipped(&self, t: usize) -> impl Iterator<Item = u32> + '_ {
        self.0[t].iter().flatten().filter(|(_, kind)| kind.wants() != kind.leaves()).map(|&(level, _)| level)
    }

    /// Whether a transition takes a token that another one puts.
    pub(super) fn follows(&self, t: usize, other: usize) -> bool {
        let puts = |level| self.0[other].iter().flatten().any(|&(at, kind)| at == level && kind == Kind::Put);
        self.0[t].iter().flatten().any(|&(level, kind)| kind == Kind::Take && puts(level))
    }

    /// Whether a transition may fire.
    pub(super) fn fires(&self, t: usize, marking: &Marking) -> bool {
        self.0[t].as_ref().is_some_and(|all| all.iter().all(|&(level, kind)| marking[level as usize] == kind.wants()))
    }

    fn fired(&self, t: usize, marking: &Marking) -> bool {
        self.0[t].as_ref().is_some_and(|all| all.iter().all(|&(level, kind)| marking[level as usize] == kind.leaves()))
    }

    /// Fires a transition, or takes a firing back: both are the same exclusive or.
    pub(super) fn flip(&self, t: usize, marking: &mut Marking) {
        let all = self.0[t].iter().flatten();
        all.filter(|(_, kind)| kind.wants() != kind.leaves()).for_each(|&(level, _)| marking[level as usize] ^= true);
    }

    /// By how much a firing brings a marking nearer to another.
    fn gain(&self, t: usize, marking: &Marking, aim: &Marking) -> isize {
        let all = self.0[t].iter().flatten().filter(|(_, kind)| kind.wants() != kind.leaves());
        all.map(|&(level, _)| if marking[level as usize] == aim[level as usize] { -1 } else { 1 }).sum()
    }
}

impl Symbolic {
    /// A firing sequence into a set of reachable markings; None where the set is empty.
    pub fn walk_to(&mut self, roots: &[Node], targets: Node, watch: &mut Watch<'_>) -> Result<Option<Walk>, Stop> {
        if targets == EMPTY {
            return Ok(None);
        }
        let moves = Moves::of(self);
        let held = [roots, &[targets]].concat();
        if self.all(&held, targets, Events::Tests, watch)? == EMPTY {
            if let Some(walk) = self.by_some_layers(roots, targets, &moves, self.layers_work / IN_VAIN, watch)? {
                return Ok(Some(walk));
            }
            if let Some(walk) = self.known(targets) {
                return Ok(Some(walk));
            }
            if let Some(walk) = self.at_random(targets, &moves, watch)? {
                let walk = self.shortened(roots, walk, &moves, watch)?;
                self.walks.push(walk.clone());
                return Ok(Some(walk));
            }
        }
        if let Some(walk) = self.by_some_layers(roots, targets, &moves, self.layers_work, watch)? {
            return Ok(Some(walk));
        }
        self.layers_work = (self.layers_work / IN_VAIN).max(LAYERS_WORK_LEAST);
        if let Some(walk) = self.known(targets) {
            return Ok(Some(walk));
        }
        match self.downhill(roots, targets, &moves, watch)? {
            Some(walk) => {
                self.walks.push(walk.clone());
                Ok(Some(walk))
            }
            None => self.by_layers(roots, targets, &moves, u64::MAX, watch),
        }
    }

    /// A sequence that was found when others were asked for, if it leads into these: verdicts ask for sets that are alike.
    fn known(&self, targets: Node) -> Option<Walk> {
        self.walks.iter().find(|walk| self.contains(targets, &walk.reached)).cloned()
    }

    /// A sequence of firings that are drawn, if it comes to one of these deadlocks soon.
    ///
    /// Not where the masks of the net take more than a part of the memory: a diagram holds nets of any width.
    fn at_random(&mut self, targets: Node, moves: &Moves, watch: &mut Watch<'_>) -> Result<Option<Walk>, Stop> {
        let masks = size_of::<u64>() * words_for(self.level_of().len()) * self.transitions.len();
        let memory = &self.diagram().store.memory;
        if masks > memory.limit() / MASKS_SHARE || memory.claim(masks).is_err() {
            return Ok(None);
        }
        let found = self.drawn(targets, moves, watch);
        self.diagram().store.memory.release(masks);
        found
    }

    fn drawn(&mut self, targets: Node, moves: &Moves, watch: &mut Watch<'_>) -> Result<Option<Walk>, Stop> {
        let net = Net::new(self.level_of().len(), self.transitions.clone(), &self.initial);
        let net = net.expect("a net that was explored is well formed");
        let dependencies = Dependencies::new(&net);
        let mut left = DRAWN_MAX;
        for seed in 1..=OTHERS_MAX {
            let (found, steps) = walk(&net, &dependencies, &mut Target::Deadlock, seed, left, watch);
            let Some(firings) = found? else { break };
            let mut end = self.first();
            firings.iter().for_each(|&t| moves.flip(t as usize, &mut end));
            if holds(&self.diagram().store, targets, &end, tokens(&end)) {
                return Ok(Some(self.walk(firings, &end, false)));
            }
            left = left.saturating_sub(steps);
        }
        Ok(None)
    }

    fn first(&self) -> Marking {
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

    /// A shortest sequence, if so much work and the memory suffice for its layers; other ways need less of both.
    fn by_some_layers(
        &mut self,
        roots: &[Node],
        targets: Node,
        moves: &Moves,
        work: u64,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Walk>, Stop> {
        match self.by_layers(roots, targets, moves, work, watch) {
            Err(Stop::Memory) => Ok(None),
            result => result,
        }
    }

    fn by_layers(
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
            let step = (0..moves.0.len()).find(|&t| {
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

    /// A sequence to where one leads that was drawn, or that one, if it is hardly longer than what differs there demands.
    fn shortened(&mut self, roots: &[Node], walk: Walk, moves: &Moves, watch: &mut Watch<'_>) -> Result<Walk, Stop> {
        let mut end = self.first();
        walk.firings.iter().for_each(|&t| moves.flip(t as usize, &mut end));
        let differ = self.first().iter().zip(&end).filter(|(a, b)| a != b).count();
        let most = (0..moves.len()).map(|t| moves.flipped(t).count()).max().unwrap_or(0).max(1);
        if walk.firings.len() <= HARDLY_LONGER * differ.div_ceil(most) {
            return Ok(walk);
        }
        let effort = Effort { results: LAYERS_WORK, markings: HOLLOW_MAX, firings: walk.firings.len() };
        match self.toward(roots, end, moves, effort, watch) {
            Ok(shorter) => Ok(shorter.unwrap_or(walk)),
            Err(Stop::Memory | Stop::Time) => Ok(walk), // it shows the deadlock all the same
            Err(stop) => Err(stop),
        }
    }

    fn downhill(
        &mut self,
        roots: &[Node],
        targets: Node,
        moves: &Moves,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Walk>, Stop> {
        let aim = self.nearest(targets, &self.first(), watch)?;
        self.toward(&[roots, &[targets]].concat(), aim, moves, NO_END, watch)
    }

    /// A sequence to one marking, which is reachable; None where the search is given up.
    fn toward(
        &mut self,
        roots: &[Node],
        aim: Marking,
        moves: &Moves,
        mut effort: Effort,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Walk>, Stop> {
        let places: Vec<u32> = (1..aim.len()).filter(|&level| aim[level]).map(|level| self.place_at()[level]).collect();
        let aimed = self.single(roots, &places)?;
        let held = [roots, &[aimed]].concat();
        let Some(leading) = self.closure_within(&held, (aimed, self.reach), By::Backward, effort.results, watch)?
        else {
            return Ok(None);
        };
        debug_assert!(leading != EMPTY && self.reach != ANY);
        let mut marking = self.first();
        let mut firings = Vec::new();
        loop {
            let before = firings.len();
            for t in 0..moves.0.len() {
                watch.tick(1)?;
                if moves.fires(t, &marking) && moves.gain(t, &marking, &aim) > 0 {
                    moves.flip(t, &mut marking);
                    watch.tick(marking.len() / 8)?;
                    if holds(&self.diagram().store, leading, &marking, tokens(&marking)) {
                        firings.push(t as u32);
                    } else {
                        moves.flip(t, &mut marking);
                    }
                }
            }
            if firings.len() >= effort.firings {
                return Ok(None);
            }
            if marking == aim {
                return Ok(Some(self.walk(firings, &aim, false)));
            }
            if firings.len() == before {
                let way = self.out_of_hollow(&marking, &aim, leading, moves, &mut effort.markings, watch)?;
                let Some(way) = way else { return Ok(None) };
                for &t in &way {
                    moves.flip(t as usize, &mut marking);
                }
                firings.extend(way);
            }
        }
    }

    /// A sequence to a marking that differs less from the aim; None where the search for it is given up. Of the markings
    /// that are `left` to look at those are taken that it has found.
    fn out_of_hollow(
        &mut self,
        from: &Marking,
        aim: &Marking,
        leading: Node,
        moves: &Moves,
        left: &mut usize,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Vec<u32>>, Stop> {
        let differ = |marking: &Marking| marking.iter().zip(aim).filter(|(a, b)| a != b).count();
        let (start, mut found) = (differ(from), vec![(from.clone(), 0, 0)]);
        let mut seen = HashSet::from([from.clone()]);
        let mut queue = BinaryHeap::from([(Reverse(start), Reverse(0))]);
        while let Some((_, Reverse(at))) = queue.pop() {
            for t in 0..moves.0.len() {
                watch.tick(1)?;
                let mut marking: Marking = found[at].0.clone();
                if !moves.fires(t, &marking) {
                    continue;
                }
                moves.flip(t, &mut marking);
                watch.tick(marking.len() / 4)?;
                if seen.contains(&marking) || !holds(&self.diagram().store, leading, &marking, tokens(&marking)) {
                    continue;
                }
                let distance = differ(&marking);
                seen.insert(marking.clone());
                found.push((marking, at, t as u32));
                if distance < start {
                    let (mut way, mut at) = (Vec::new(), found.len() - 1);
                    while at != 0 {
                        way.push(found[at].2);
                        at = found[at].1;
                    }
                    way.reverse();
                    return Ok(Some(way));
                }
                *left = left.saturating_sub(1);
                if found.len() == HOLLOW_MAX || *left == 0 {
                    return Ok(None);
                }
                queue.push((Reverse(distance), Reverse(found.len() - 1)));
            }
        }
        Ok(None)
    }

    /// A marking of a set that differs from another in the fewest places.
    fn nearest(&mut self, set: Node, from: &Marking, watch: &mut Watch<'_>) -> Result<Marking, Stop> {
        let mut below = vec![0_u64; from.len()]; // tokens up to a level
        for level in 1..from.len() {
            below[level] = below[level - 1] + u64::from(from[level]);
        }
        let store = &self.diagram().store;
        // What a child costs from the level below its parent: itself, and the tokens passed over.
        let from_above = |costs: &HashMap<Node, u64>, child: Node, top: u32| {
            costs.get(&child).map(|cost| cost + below[top as usize] - below[store.level(child) as usize])
        };
        let mut costs: HashMap<Node, u64> = HashMap::from([(EMPTY, u64::from(u32::MAX)), (super::zdd::UNIT, 0)]);
        let mut todo = vec![set];
        while let Some(&node) = todo.last() {
            watch.tick(1)?;
            if costs.contains_key(&node) {
                todo.pop();
                continue;
            }
            let (level, lo, hi) = (store.level(node), store.lo(node), store.hi(node));
            match (from_above(&costs, lo, level - 1), from_above(&costs, hi, level - 1)) {
                (Some(without), Some(with)) => {
                    let token = from[level as usize];
                    costs.insert(node, (without + u64::from(token)).min(with + u64::from(!token)));
                    todo.pop();
                }
                (without, with) => {
                    todo.extend(
                        [(without, lo), (with, hi)].into_iter().filter(|(cost, _)| cost.is_none()).map(|at| at.1),
                    );
                }
            }
        }
        let mut marking = vec![false; from.len()];
        let mut node = set;
        while store.level(node) != TERMINAL {
            let (level, lo, hi) = (store.level(node), store.lo(node), store.hi(node));
            let cost = |child| from_above(&costs, child, level - 1).unwrap_or(u64::MAX / 2);
            let token = from[level as usize];
            if cost(hi) + u64::from(!token) < cost(lo) + u64::from(token) {
                marking[level as usize] = true;
                node = hi;
            } else {
                node = lo;
            }
        }
        Ok(marking)
    }
}

#[cfg(test)]
mod tests {
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
        space.layers_work = LAYERS_WORK_LEAST; // in which so many layers are not found
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
        // A run that is drawn goes through many meals: it is aimed at where that has led.
        let (walk, _) = walk_to(deadlocks);
        assert_eq!((walk.firings.len(), walk.shortest), (60, false));
        let (again, other) = walk_to(deadlocks);
        assert_eq!(again, walk);
        let (away, _) = walk_to(other);
        assert!(away.firings.len() < 75 && away.reached != walk.reached);
    }

    #[test]
    fn firings_at_random_come_to_the_deadlock_that_is_wanted_and_to_no_other() {
        // A ring of two places with two ways out of it, of which one is easier to take.
        let arc = |from: &[u32], to| Transition::new(from, &[to], &[], &[], &[]);
        let mut transitions = vec![arc(&[0], 1), arc(&[1], 0), arc(&[1], 3)];
        transitions.extend((0..2).map(|_| arc(&[0], 2)));
        let (mut poll, bytes) = (unwatched, 1 << 24);
        let mut watch = Watch::new(None, &mut poll);
        let mut space = Symbolic::explore(4, transitions, vec![0], bytes, None, &mut watch).expect("enough room");
        let moves = Moves::of(&space);
        for end in [2, 3] {
            let wanted = space.single(&[], &[end]).expect("enough room");
            let walk = space.at_random(wanted, &moves, &mut watch).expect("enough room").expect("it is near");
            assert_eq!((walk.reached, walk.shortest), (vec![end], false));
        }
        // In less memory than eight times the masks nothing is drawn; what is near in layers is found without.
        let wanted = space.single(&[], &[2]).expect("enough room");
        space.diagram().store.memory.allow(8 * 8 * 5 - 1);
        assert_eq!(space.at_random(wanted, &moves, &mut watch), Ok(None));
        space.diagram().store.memory.allow(bytes);
        let elsewhere = space.single(&[], &[0]).expect("enough room");
        assert_eq!(space.at_random(elsewhere, &moves, &mut watch), Ok(None));
    }
}
