//! Breadth-first exploration of the reachability graph, interleaving and synchronous step.
//!
//! Markings are numbered in the order in which they are found, level by level, so that an index is also a distance
//! rank and every witness "lowest index" is a closest one. The queue is the array of markings itself. Up to 64
//! markings of one level are taken together and turned into bit slices, one word for each place; a transition is then
//! tested for all of them by one word operation for each place it touches, and contact and deadlock are read off the
//! same words. Batches end at the end of a level: a batch across levels would number a successor of the later
//! level before one of the earlier, and paths would no longer be shortest. Every firing is counted, but only those are looked up
//! that may lead to a new marking: where independent firings meet again, one order of them is enough (`sleep.rs`). So where a
//! budget ends within a level, a successor of a marking that was expanded may be missing.
//!
//! Rejected: enabledness kept incrementally from the parent marking (it lost to bit slices everywhere it was measured);
//! storing edges (they are recomputed faster than they are read back, and cost more than the markings); storing
//! parents under interleaving (the rule runs backwards, see `net.rs`).

mod by_step;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use crate::batch::Batch;
use crate::budget::{Found, Memory, Stop, Watch};
use crate::known::{Arrivals, ByKey, Hashed, Set};
use crate::marking::{Dynamic, Width, holds};
use crate::net::{Net, Rules};
use crate::pair::{MEASURED, Pair, Shared};
use crate::sleep::Sleeping;
use crate::step::{Components, Steps};
use crate::table::{NONE, Table};
use crate::with_width;

/// The discipline and the budgets of an exploration.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Maximal sets of enabled transitions instead of one transition at a time.
    pub step: bool,
    /// Most markings that are stored.
    pub markings: usize,
    /// Most bytes that are held, transient copies included.
    pub memory_bytes: usize,
    /// Longest time.
    pub time: Option<Duration>,
}

/// The part of the reachability graph that was explored; all of it where `stop` is none.
#[derive(Debug)]
pub struct Space {
    /// The net.
    pub net: Arc<Net>,
    /// Whether edges are synchronous steps.
    pub step: bool,
    /// The markings, and under steps their index.
    pub table: Table,
    /// What tells a known marking.
    pub set: Set,
    /// The index at which each level begins.
    pub levels: Vec<u32>,
    /// Edges that each transition takes part in.
    pub fired: Vec<u64>,
    /// How many edges.
    pub edges: u64,
    /// Markings in contact, for each transition.
    pub contacts: Vec<u64>,
    /// The first of them, or `NONE`.
    pub contact_witness: Vec<u32>,
    /// Markings where no transition is firable and openable, ascending.
    pub deadlocks: Vec<u32>,
    /// Under steps, the marking from which each was found first; empty under interleaving.
    pub parents: Vec<u32>,
    /// Components of the step relation.
    pub components: Arc<Components>,
    /// Why the exploration ended early.
    pub stop: Option<Stop>,
    /// What is held, and the most that may be held.
    pub memory: Memory,
    /// How long it took.
    pub seconds: f64,
}

impl Space {
    /// Explores from M0 until all is found or a budget is used up.
    pub fn explore(net: Net, limits: Limits, poll: &mut dyn FnMut(Found) -> Result<(), Stop>) -> Result<Self, Stop> {
        Space::explore_by(None, net, limits, poll)
    }

    /// The same, where a level is worth it and the flag set by two threads; steps are explored by one.
    pub fn explore_by(
        two: Option<Arc<AtomicBool>>,
        net: Net,
        limits: Limits,
        poll: &mut dyn FnMut(Found) -> Result<(), Stop>,
    ) -> Result<Self, Stop> {
        let pair = two.map(|free| Pair::new(&net, MEASURED, free));
        Space::explore_with(pair, net, limits, poll)
    }

    pub(crate) fn explore_with(
        pair: Option<Pair>,
        net: Net,
        limits: Limits,
        poll: &mut dyn FnMut(Found) -> Result<(), Stop>,
    ) -> Result<Self, Stop> {
        let start = Instant::now();
        let memory = Memory::new(limits.memory_bytes);
        let count = net.transitions.len();
        // The net itself, its statistics and the component table; a budget below that is no budget.
        memory.claim(net.bytes() + count * (8 + 8 + 4 + 4))?;
        let table = Table::new(net.words, &memory)?;
        let components = Components::new(&net);
        let set = if limits.step { Set::Hashed } else { Set::new(&net, &memory) };
        let mut space = Space {
            step: limits.step,
            set,
            table,
            levels: Vec::new(),
            fired: vec![0; count],
            edges: 0,
            contacts: vec![0; count],
            contact_witness: vec![NONE; count],
            deadlocks: Vec::new(),
            parents: Vec::new(),
            components: Arc::new(components),
            stop: None,
            memory,
            seconds: 0.0,
            net: Arc::new(net),
        };
        let mut watch = Watch::new(limits.time.and_then(|time| start.checked_add(time)), poll);
        let max = limits.markings.clamp(1, NONE as usize);
        let end = with_width!(space.net.words, width => space.run(width, pair, max, &mut watch));
        space.stop = end.err();
        space.seconds = start.elapsed().as_secs_f64();
        Ok(space)
    }

    /// How many markings were found.
    pub fn len(&self) -> usize {
        self.table.store.len()
    }

    /// Whether none was found, which never happens.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn run<W: Width>(
        &mut self,
        width: W,
        mut pair: Option<Pair>,
        max: usize,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        self.memory.push(&mut self.levels, 0)?;
        let net = Arc::clone(&self.net);
        if self.step {
            let components = Arc::clone(&self.components);
            let mut steps = Steps::new(&net, &components);
            let result = self.run_step(width, &net, &mut steps, max, watch);
            steps.forget(&self.memory);
            result
        } else {
            // Apart from the rest while it grows.
            let mut set = std::mem::replace(&mut self.set, Set::Hashed);
            let mut sleeping = Sleeping::new(&net, &self.memory);
            let (pair, with) = (&mut pair, &mut sleeping);
            let result = match &mut set {
                Set::Hashed => {
                    self.run_interleaving(width, &net, (&mut Hashed::new(net.words), with), pair, max, watch)
                }
                Set::Narrow(keyed) => {
                    self.run_interleaving(width, &net, (&mut ByKey::new(keyed), with), pair, max, watch)
                }
                Set::Wide(keyed) => {
                    self.run_interleaving(width, &net, (&mut ByKey::new(keyed), with), pair, max, watch)
                }
            };
            sleeping.leave(&self.memory);
            self.set = set;
            if let Some(pair) = pair.take() {
                pair.finish(self);
            }
            result
        }
    }

    /// Ends a level when `next` has reached it; false when there is no other.
    fn level_end(&mut self, next: usize, end: &mut usize) -> Result<bool, Stop> {
        if next == *end {
            *end = self.table.store.len();
            if next == *end {
                return Ok(false);
            }
            self.memory.push(&mut self.levels, next as u32)?;
        }
        Ok(true)
    }

    fn run_interleaving<W: Width>(
        &mut self,
        width: W,
        net: &Net,
        (arrivals, sleeping): (&mut impl Shared<W>, &mut Sleeping),
        pair: &mut Option<Pair>,
        max: usize,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        let mut batch = Batch::new(net);
        batch.markings.extend_from_slice(&net.initial);
        arrivals.first(width, &mut batch, (&mut self.table, &mut sleeping.trail, max, &self.memory, watch))?;
        let (mut next, mut end) = (0, 1);
        while self.level_end(next, &mut end)? {
            sleeping.trail.forget(next);
            let open;
            (open, end) = match pair.as_mut().filter(|pair| pair.takes(end - next, end)) {
                Some(pair) => pair.expand(width, self, (&mut *arrivals, &mut *sleeping), next, max, watch)?,
                None => (vec![(next, end)], end),
            };
            for range in open {
                let with = (&mut batch, &mut *arrivals, &mut *sleeping);
                self.expand(width, net, range, with, max, watch)?;
            }
            next = end;
        }
        Ok(())
    }

    /// Expands the markings of a range, which lies within a level.
    fn expand<W: Width>(
        &mut self,
        width: W,
        net: &Net,
        (first, end): (usize, usize),
        (batch, arrivals, sleeping): (&mut Batch, &mut impl Arrivals<W>, &mut Sleeping),
        max: usize,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        let mut next = first;
        while next < end {
            let stop = end.min(next + 64);
            batch.markings.clear();
            self.table.store.copy_range(next, stop, &mut batch.markings);
            arrivals.cut(width, batch);
            sleeping.cut(next, stop);
            let mut alive = 0;
            let before = self.edges;
            for t in 0..net.transitions.len() {
                let (base, blocked) = net.forward.test(t, &batch.slices, batch.valid);
                if base == 0 {
                    continue;
                }
                if base & blocked != 0 {
                    self.note_contact(t, next, base & blocked);
                }
                let fire = base & !blocked & net.forward.edge(t);
                if fire == 0 {
                    continue;
                }
                alive |= fire;
                let edges = u64::from(fire.count_ones());
                self.fired[t] += edges;
                self.edges += edges;
                let awake = sleeping.awake(t, fire);
                arrivals.push(
                    width,
                    net,
                    batch,
                    t,
                    awake,
                    (&mut self.table, &mut sleeping.trail, max, &self.memory, watch),
                )?;
            }
            self.note_deadlocks(next, batch.valid & !alive)?;
            arrivals.end(
                width,
                net,
                batch,
                stop == end,
                (&mut self.table, &mut sleeping.trail, max, &self.memory, watch),
            )?;
            watch.found = Found { markings: self.table.store.len() as u64, edges: self.edges };
            watch.tick((stop - next) + (self.edges - before) as usize + net.transitions.len())?;
            next = stop;
        }
        Ok(())
    }

    #[cold]
    fn note_contact(&mut self, t: usize, first: usize, contact: u64) {
        self.contacts[t] += u64::from(contact.count_ones());
        // Two threads may have noted a later one.
        self.contact_witness[t] = self.contact_witness[t].min(first as u32 + contact.trailing_zeros());
    }

    fn note_deadlocks(&mut self, first: usize, mut dead: u64) -> Result<(), Stop> {
        while dead != 0 {
            self.memory.push(&mut self.deadlocks, first as u32 + dead.trailing_zeros())?;
            dead &= dead - 1;
        }
        Ok(())
    }

    /// The marking of an index.
    pub fn marking(&self, index: usize) -> &[u64] {
        self.table.store.get(Dynamic(self.net.words), index)
    }

    /// The openable transitions that a rule enables at one marking, by tests of single places.
    pub fn enabled_by(&self, rules: &Rules, marking: &[u64]) -> Vec<u32> {
        (0..self.net.transitions.len())
            .filter(|&t| rules.test_one(t, |p| holds(marking, p)))
            .map(|t| t as u32)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::net::Transition;
    use crate::samples::{explore, machines};

    #[test]
    fn independent_machines_multiply_at_every_width() {
        for pad in [0, 50, 60, 130, 200, 300, 500, 1000] {
            let space = explore(machines(10, pad), false);
            assert_eq!((space.len(), space.edges, space.stop), (1024, 10240, None));
            assert_eq!(space.levels, [0, 1, 11, 56, 176, 386, 638, 848, 968, 1013, 1023]);
            assert!(space.deadlocks.is_empty());
            assert_eq!(space.fired, [512; 20]);
        }
    }

    #[test]
    fn machines_without_gates_step_in_unison() {
        let space = explore(machines(10, 0), true);
        assert_eq!((space.len(), space.edges), (2, 2));
        assert_eq!(space.fired, [1; 20]);
    }

    #[test]
    fn each_budget_stops_with_its_reason() {
        let run = |limits| Space::explore(machines(16, 0), limits, &mut unwatched).expect("begins");
        let all = Limits { step: false, markings: 1 << 20, memory_bytes: 1 << 28, time: None };
        assert_eq!(run(Limits { markings: 100, ..all }).stop, Some(Stop::Markings));
        assert_eq!(run(Limits { markings: 100, ..all }).len(), 100);
        assert_eq!(run(Limits { memory_bytes: 100_000, ..all }).stop, Some(Stop::Memory));
        assert_eq!(run(Limits { time: Some(Duration::ZERO), ..all }).stop, Some(Stop::Time));
        let cancelled = Space::explore(machines(16, 0), all, &mut |_| Err(Stop::Cancelled)).expect("begins");
        assert_eq!(cancelled.stop, Some(Stop::Cancelled));
    }

    #[test]
    fn a_budget_below_the_net_is_refused() {
        let limits = Limits { step: false, markings: 10, memory_bytes: 10, time: None };
        assert_eq!(Space::explore(machines(2, 0), limits, &mut unwatched).err(), Some(Stop::Memory));
    }

    #[test]
    fn a_full_output_place_is_contact_and_blocks() {
        let net = Net::new(2, vec![Transition::new(&[0], &[1], &[], &[], &[])], &[0, 1]).expect("well formed");
        let space = explore(net, false);
        assert_eq!((space.len(), space.edges, space.deadlocks.as_slice()), (1, 0, [0].as_slice()));
        assert_eq!((space.contacts[0], space.contact_witness[0]), (1, 0));
    }

    #[test]
    fn a_self_loop_never_fires_and_is_no_contact() {
        let net = Net::new(1, vec![Transition::new(&[0], &[0], &[], &[], &[])], &[0]).expect("well formed");
        let space = explore(net, false);
        assert_eq!((space.len(), space.edges, space.contacts[0]), (1, 0, 0));
    }
}
