//! All markings in 5 to 8 bytes each, without their array and without indexes: for nets that no memory holds otherwise.
//!
//! The set is the table of exact keys (`exact.rs`, `span.rs`), which says of a key whether it is there and nothing
//! else; so it is exact, however many bits it saves. It grows in place, and is filled to nine tenths. The search goes
//! breadth first, and of the markings only the keys of two levels are kept beside the set, from which the markings are
//! made again (`spread.rs`). Nothing has a number, so there may be more than 2^32 markings.
//!
//! What needs no graph is answered on the way: how many markings and edges there are, what fires, contact, deadlock,
//! and at which level a state formula holds first. How a marking is reached is found afterwards, by searching again
//! (`way.rs`). What asks for a way back from markings (liveness, say) is not answered.
//!
//! Rejected: hashes in the place of keys (bit-state hashing, hash compaction), which take two markings for one now and
//! then: a net would be proved safe by a search that has left something out.

mod goal;
mod queue;
#[cfg(test)]
mod tests;
mod way;

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::batch::Batch;
use crate::budget::{Found, Memory, Stop, Watch};
use crate::exact::{Asked, Exact, ROOM};
use crate::marking::Width;
use crate::net::Net;
use crate::seat::Slot;
use crate::sleep::{Asleep, Sleep, last};
use crate::span::Span;
use crate::spread::Spread;
use crate::stubborn::formula::Formula;
use crate::with_width;
use goal::Goal;
use queue::{Queue, Spare};

/// The least table of narrow slots may take this part of the memory; where keys are too long for that, slots are wide.
const LEAST_PART: usize = 16;

/// A net, its keys, and what is asked of its markings.
pub struct Compact {
    pub(crate) net: Arc<Net>,
    span: Span,
    spread: Spread,
    goals: Vec<Goal>,
    memory_bytes: usize,
}

/// Where a search meets something first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hit {
    /// How many firings from where it began.
    pub level: usize,
    pub(crate) key: u64,
    /// The marking that the way to it goes through at the level that was asked for.
    pub(crate) origin: u64,
}

/// What a search found.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Markings found, and edges counted.
    pub found: Found,
    /// Levels that were begun.
    pub levels: usize,
    /// For each transition, the edges on which it fires, and the markings in contact.
    pub fired: Vec<u64>,
    /// See `fired`.
    pub contacts: Vec<u64>,
    /// How many markings are deadlocks.
    pub deadlocks: u64,
    /// Where the first contact and the first deadlock are met, and each goal.
    pub contact: Option<Hit>,
    /// See `contact`.
    pub deadlock: Option<Hit>,
    /// See `contact`.
    pub goals: Vec<Option<Hit>>,
    /// Why the search ended early: for want of something, or because all goals were met and no more was asked.
    pub stop: Option<Stop>,
    /// Whether it ended because all goals were met.
    pub met: bool,
    /// The most bytes that were held.
    pub bytes: usize,
    /// How long it took.
    pub seconds: f64,
}

/// How a search goes.
#[derive(Clone, Copy, Debug)]
struct Plan {
    /// The key it begins with.
    from: u64,
    /// Whether to count everything, or only look for the goals.
    all: bool,
    /// A key to look for.
    target: Option<u64>,
    /// The level whose markings are the origins of what follows.
    mark: Option<usize>,
    /// Keys of all levels that may be kept.
    keep: usize,
}

/// The levels of a search, as far as they were kept, and what it met.
struct Swept {
    outcome: Outcome,
    target: Option<Hit>,
    levels: Vec<Vec<u64>>,
}

impl Compact {
    /// A net and formulas over its places; none where more places than a key has bits tell its markings apart.
    pub fn new(net: Net, goals: Vec<Formula>, memory_bytes: usize) -> Option<Self> {
        let span = Span::new(&net)?;
        let spread = Spread::new(&net, &span);
        let goals = goals.into_iter().map(Goal::new).collect();
        Some(Compact { net: Arc::new(net), span, spread, goals, memory_bytes })
    }

    /// Searches all markings; or, where not `all` is asked, until every goal is met.
    pub fn search(
        &mut self,
        all: bool,
        time: Option<Duration>,
        poll: &mut dyn FnMut(Found) -> Result<(), Stop>,
    ) -> Outcome {
        let start = Instant::now();
        let mut watch = Watch::new(time.and_then(|time| start.checked_add(time)), poll);
        let plan = Plan { from: self.span.key(&self.net.initial), all, target: None, mark: None, keep: 0 };
        let mut swept = self.sweep(plan, &mut watch);
        swept.outcome.seconds = start.elapsed().as_secs_f64();
        swept.outcome
    }

    fn sweep(&mut self, plan: Plan, watch: &mut Watch<'_>) -> Swept {
        let narrow = Exact::<u32>::least_bytes(self.span.bits) <= self.memory_bytes / LEAST_PART;
        with_width!(self.net.words, width => if narrow {
            Sweep::<u32>::run(width, self, plan, watch)
        } else {
            Sweep::<u64>::run(width, self, plan, watch)
        })
    }
}

/// A search on its way.
struct Sweep<S> {
    memory: Memory,
    exact: Exact<S>,
    asked: Box<Asked<S>>,
    /// What need not be asked for.
    sleep: Sleep,
    asleep: Asleep,
    /// The keys asked for, with the transition that leads there, and the origins that they have.
    keys: [u64; ROOM],
    origins: [u64; ROOM],
    /// The keys of the next level, with the transition that they were found by, and their origins where they are asked for.
    next: [Queue; 2],
    spare: Spare,
}

impl<S: Slot> Sweep<S> {
    fn run<W: Width>(width: W, of: &mut Compact, plan: Plan, watch: &mut Watch<'_>) -> Swept {
        let count = of.net.transitions.len();
        let outcome = Outcome {
            fired: vec![0; count],
            contacts: vec![0; count],
            goals: vec![None; of.goals.len()],
            ..Outcome::default()
        };
        let mut swept = Swept { outcome, target: None, levels: vec![Vec::new()] };
        let memory = Memory::new(of.memory_bytes);
        let held = of.net.bytes() + of.spread.bytes() + of.goals.iter().map(Goal::bytes).sum::<usize>() + 16 * count;
        let begun = memory.claim(held).and_then(|()| Exact::<S>::reserving(of.span.bits, &memory));
        let exact = match begun {
            Ok(exact) => exact,
            Err(stop) => {
                swept.outcome.stop = Some(stop);
                return swept;
            }
        };
        let sleep = Sleep::new(&of.net, &memory);
        let mut sweep = Sweep {
            asleep: Asleep::new(&sleep),
            sleep,
            memory,
            exact,
            asked: Box::default(),
            keys: [0; ROOM],
            origins: [0; ROOM],
            next: Default::default(),
            spare: Spare::default(),
        };
        swept.outcome.stop = sweep.search(width, of, plan, &mut swept, watch).err();
        swept.outcome.found.markings = sweep.exact.len() as u64;
        swept.outcome.bytes = sweep.memory.used();
        swept
    }

    fn search<W: Width>(
        &mut self,
        width: W,
        of: &mut Compact,
        plan: Plan,
        swept: &mut Swept,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        (self.keys[0], self.origins[0]) = (plan.from, plan.from);
        self.exact.ask(&mut self.asked, 1, |_| plan.from, |_, _| ());
        self.settle(of, plan, 0, swept, watch)?;
        let mut batch = Batch::new(&of.net);
        let (mut kept, mut marking) = (0, vec![0; width.words()]);
        let (mut keys, mut origins) = (Vec::with_capacity(64), Vec::with_capacity(64));
        let mut lasts = Vec::with_capacity(64);
        loop {
            let [mut now, mut marked] = std::mem::take(&mut self.next);
            if now.len() == 0 || swept.target.is_some() {
                return Ok(());
            }
            let level = swept.outcome.levels;
            swept.outcome.levels += 1;
            kept += now.len();
            if kept <= plan.keep {
                let mut level = self.memory.filled(0, now.len())?;
                level.clear();
                swept.levels.push(level);
            }
            while now.len() > 0 {
                now.take(&mut keys, &mut self.spare);
                marked.take(&mut origins, &mut self.spare);
                lasts.clear();
                lasts.extend(keys.iter().map(|&told| of.span.last_in(told)));
                keys.iter_mut().for_each(|told| *told = of.span.key_in(*told));
                self.asleep.cut(&lasts);
                if kept <= plan.keep {
                    swept.levels.last_mut().into_iter().for_each(|level| level.extend_from_slice(&keys));
                }
                batch.markings.clear();
                for &key in &keys {
                    of.spread.marking(key, &mut marking);
                    batch.markings.extend_from_slice(&marking);
                }
                batch.cut_known(width, &keys);
                self.expand(of, (plan, level), &batch, &origins, swept, watch)?;
                let outcome = &swept.outcome;
                if !plan.all && plan.target.is_none() && outcome.goals.iter().all(Option::is_some) {
                    swept.outcome.met = true;
                    return Ok(());
                }
                watch.found = Found { markings: self.exact.len() as u64, edges: outcome.found.edges };
                watch.tick(64 + of.net.transitions.len() + 4 * keys.len())?;
            }
            self.settle(of, plan, level + 1, swept, watch)?;
        }
    }

    /// Tests a batch of a level, and asks for the keys that follow.
    #[inline(always)]
    fn expand(
        &mut self,
        of: &mut Compact,
        (plan, level): (Plan, usize),
        batch: &Batch,
        marked: &[u64],
        swept: &mut Swept,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        let hit = |here: u64| {
            let key = batch.hashes[here.trailing_zeros() as usize];
            Hit { level, key, origin: key }
        };
        let outcome = &mut swept.outcome;
        if plan.target.is_none() {
            for (goal, found) in of.goals.iter_mut().zip(&mut outcome.goals).filter(|(_, found)| found.is_none()) {
                let here = goal.holds(&batch.slices, batch.valid);
                if here != 0 {
                    *found = Some(hit(here));
                }
            }
        }
        let (mut alive, mut contact) = (0, 0);
        for t in 0..of.net.transitions.len() {
            let (base, blocked) = of.net.forward.test(t, &batch.slices, batch.valid);
            if base == 0 {
                continue;
            }
            if base & blocked != 0 {
                contact |= base & blocked;
                swept.outcome.contacts[t] += u64::from((base & blocked).count_ones());
            }
            let fire = base & !blocked & of.net.forward.edge(t);
            if fire == 0 {
                continue;
            }
            alive |= fire;
            let edges = u64::from(fire.count_ones());
            swept.outcome.fired[t] += edges;
            swept.outcome.found.edges += edges;
            let (flip, told) = (of.span.flips[t], of.span.told(last(t)));
            let awake = fire & !self.asleep.of(&self.sleep, t);
            let (keys, origins) = (&mut self.keys, &mut self.origins);
            let from = plan.mark.is_some_and(|mark| level >= mark);
            self.exact.ask(
                &mut self.asked,
                awake,
                |j| batch.hashes[j] ^ flip,
                |c, j| {
                    keys[c] = batch.hashes[j as usize] ^ flip | told;
                    if from {
                        origins[c] = marked[j as usize];
                    }
                },
            );
            if self.asked.count >= ROOM - 64 {
                self.settle(of, plan, level + 1, swept, watch)?;
            }
        }
        let dead = batch.valid & !alive;
        swept.outcome.deadlocks += u64::from(dead.count_ones());
        if dead != 0 && swept.outcome.deadlock.is_none() {
            swept.outcome.deadlock = Some(hit(dead));
        }
        if contact != 0 && swept.outcome.contact.is_none() {
            swept.outcome.contact = Some(hit(contact));
        }
        Ok(())
    }

    /// Looks up what was asked for; what is new belongs to a level.
    #[inline(always)]
    fn settle(
        &mut self,
        of: &Compact,
        plan: Plan,
        level: usize,
        swept: &mut Swept,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        let (keys, origins, spare, memory) = (&self.keys, &self.origins, &mut self.spare, &self.memory);
        let [next, marks] = &mut self.next;
        self.exact.put_all(&mut self.asked, memory, watch, |c| {
            next.push(keys[c], spare, memory)?;
            let key = of.span.key_in(keys[c]);
            let origin = match plan.mark {
                Some(mark) if level > mark => origins[c],
                _ => key,
            };
            if plan.mark.is_some_and(|mark| level >= mark) {
                marks.push(origin, spare, memory)?;
            }
            if plan.target == Some(key) {
                swept.target = Some(Hit { level, key, origin });
            }
            Ok(())
        })
    }
}
