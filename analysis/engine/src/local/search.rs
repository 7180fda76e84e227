//! The search: values of subformulas at markings, as they are asked for.
//!
//! Each subformula that speaks of what follows keeps for each marking what is known of it, in one word: nothing, true,
//! false, open, or the time at which the search that is now under way has met it. A subformula is never asked for inside
//! a search for itself, so one word is enough.
//!
//! Runs are followed by the firings in the order of the net, or in a drawn one; and in each second round first to the
//! marking that lacks the fewest literals of what is looked for.

use std::time::{Duration, Instant};

use super::formula::{Formula, Node};
use crate::budget::{Found, Memory, Stop, Watch};
use crate::marking::{Width, linear_hash};
use crate::stubborn::dependencies::negation;
use crate::stubborn::marks::Marks;
use crate::stubborn::search::Prepared;
use crate::stubborn::walk::Random;
use crate::table::{NONE, Table};
use crate::with_width;

/// The budgets of a search.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Most markings that are stored.
    pub markings: usize,
    /// Most bytes that are held.
    pub memory_bytes: usize,
    /// Longest time.
    pub time: Option<Duration>,
    /// Markings that each search may meet in the first round.
    pub first: usize,
}

/// What was found.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Whether M0 satisfies the formula.
    pub holds: Option<bool>,
    /// Why the search ended before that was known.
    pub stop: Option<Stop>,
    /// Markings met.
    pub markings: usize,
    /// Firings followed.
    pub edges: u64,
    /// How long it took.
    pub seconds: f64,
}

/// How many times more a search may meet in each round, and how many times more the outermost one than one inside it.
const MORE: usize = 8;
const OUTERMOST: usize = 4;

/// Whether a subformula holds in a marking; `Open` where that is not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Truth {
    True,
    False,
    Open,
}

impl Truth {
    fn not(self) -> Self {
        match self {
            Truth::True => Truth::False,
            Truth::False => Truth::True,
            Truth::Open => Truth::Open,
        }
    }

    fn word(self) -> u32 {
        match self {
            Truth::True => TRUE,
            Truth::False => FALSE,
            Truth::Open => OPEN,
        }
    }
}

impl From<bool> for Truth {
    fn from(holds: bool) -> Self {
        if holds { Truth::True } else { Truth::False }
    }
}

/// What is known of a subformula in a marking: a word. From `MET` on: when it was met.
const UNKNOWN: u32 = 0;
const TRUE: u32 = 1;
const FALSE: u32 = 2;
const OPEN: u32 = 3;
const MET: u32 = 4;

fn known(word: u32) -> Option<Truth> {
    match word {
        TRUE => Some(Truth::True),
        FALSE => Some(Truth::False),
        OPEN => Some(Truth::Open),
        _ => None,
    }
}

/// Evaluates a formula in M0.
pub fn evaluate(
    prepared: &Prepared,
    formula: &mut Formula,
    limits: Limits,
    poll: &mut dyn FnMut(Found) -> Result<(), Stop>,
) -> Outcome {
    let start = Instant::now();
    let mut watch = Watch::new(limits.time.and_then(|time| start.checked_add(time)), poll);
    let mut outcome = Outcome { holds: None, stop: None, markings: 0, edges: 0, seconds: 0.0 };
    match Local::new(prepared, formula, limits) {
        Ok(mut local) => {
            match with_width!(prepared.net.words, width => local.rounds(width, limits.first, &mut watch)) {
                Ok(holds) => outcome.holds = Some(holds),
                Err(stop) => outcome.stop = Some(stop),
            }
            (outcome.markings, outcome.edges) = (local.table.store.len(), local.edges);
        }
        Err(stop) => outcome.stop = Some(stop),
    }
    outcome.seconds = start.elapsed().as_secs_f64();
    outcome
}

/// A marking on the way: its firable transitions as a range of the stack of those, how many are done, and when it was met.
#[derive(Clone, Copy, Debug)]
struct Frame {
    marking: u32,
    firable: (usize, usize),
    next: usize,
    met: u32,
}

/// A component on the way: when its first marking was met, and whether something that was left open may lead on from it.
#[derive(Clone, Copy, Debug)]
struct Root {
    met: u32,
    open: bool,
}

struct Local<'a> {
    prepared: &'a Prepared,
    formula: &'a mut Formula,
    table: Table,
    /// For each node what is known of it, by marking.
    words: Vec<Vec<u32>>,
    memory: Memory,
    edges: u64,
    most: usize,
    /// Markings that a search may meet in this round.
    budget: usize,
    random: Option<Random>,
    guided: bool,
    seen: Marks,
    /// Markings as bits, taken from here and given back.
    spare: Vec<Vec<u64>>,
}

/// A subformula that is an until, of some run or of each.
#[derive(Clone, Copy, Debug)]
struct Until {
    node: u32,
    left: u32,
    right: u32,
    some: bool,
}

/// What a search has on its way.
#[derive(Default)]
struct Way {
    frames: Vec<Frame>,
    roots: Vec<Root>,
    live: Vec<u32>,
    firable: Vec<u32>,
}

impl<'a> Local<'a> {
    fn new(prepared: &'a Prepared, formula: &'a mut Formula, limits: Limits) -> Result<Self, Stop> {
        let memory = Memory::new(limits.memory_bytes);
        memory.claim(prepared.net.bytes() + prepared.dependencies.bytes() + formula.bytes())?;
        memory.claim(4 * prepared.net.transitions.len())?;
        Ok(Local {
            table: Table::new(prepared.net.words, &memory)?,
            words: vec![Vec::new(); formula.nodes.len()],
            memory,
            edges: 0,
            most: limits.markings.clamp(1, NONE as usize),
            budget: 0,
            random: None,
            guided: false,
            seen: Marks::new(prepared.net.transitions.len()),
            spare: Vec::new(),
            prepared,
            formula,
        })
    }

    /// Round after round with larger budgets, until the value in M0 is known.
    fn rounds<W: Width>(&mut self, width: W, first: usize, watch: &mut Watch<'_>) -> Result<bool, Stop> {
        let initial = self.prepared.net.initial.clone();
        self.number(width, &initial, watch)?;
        self.budget = first.max(1);
        let whole = self.formula.nodes.len() as u32 - 1;
        for round in 0.. {
            self.guided = round % 2 == 0;
            self.random = (round % 3 != 1).then(|| Random::new(round));
            match self.value(width, whole, 0, true, watch)? {
                Truth::True => return Ok(true),
                Truth::False => return Ok(false),
                Truth::Open => {}
            }
            for word in self.words.iter_mut().flatten().filter(|word| **word >= OPEN) {
                *word = UNKNOWN;
            }
            self.budget = self.budget.saturating_mul(if round % 2 == 1 { MORE } else { 1 });
        }
        Err(Stop::Markings)
    }

    /// The number of a marking, which is added where it was not met before.
    fn number<W: Width>(&mut self, width: W, marking: &[u64], watch: &mut Watch<'_>) -> Result<u32, Stop> {
        let hash = linear_hash(width, marking);
        if let Some(known) = self.table.find(width, marking, hash) {
            return Ok(known);
        }
        let number = self.table.store.len();
        self.table.make_room(width, 1, &self.memory, watch)?;
        self.table.insert(width, marking, hash, self.most, &self.memory)?;
        Ok(number as u32)
    }

    fn word(&self, node: u32, marking: u32) -> u32 {
        self.words[node as usize].get(marking as usize).copied().unwrap_or(UNKNOWN)
    }

    fn set(&mut self, node: u32, marking: u32, word: u32) -> Result<(), Stop> {
        let words = &mut self.words[node as usize];
        let missing = (marking as usize + 1).saturating_sub(words.len());
        self.memory.extend(words, UNKNOWN, missing)?;
        words[marking as usize] = word;
        Ok(())
    }

    /// The value of a node in a marking; `outermost` where no search is under way.
    fn value<W: Width>(
        &mut self,
        width: W,
        node: u32,
        marking: u32,
        outermost: bool,
        watch: &mut Watch<'_>,
    ) -> Result<Truth, Stop> {
        match &self.formula.nodes[node as usize] {
            Node::Label(label) => {
                let label = *label as usize;
                watch.tick(self.formula.labels[label].size() / 4)?;
                Ok(self.formula.labels[label].holds(self.table.store.get(width, marking as usize)).into())
            }
            &Node::Not(one) => Ok(self.value(width, one, marking, outermost, watch)?.not()),
            Node::All(operands) | Node::Any(operands) => {
                let decisive = Truth::from(matches!(self.formula.nodes[node as usize], Node::Any(_)));
                let operands = operands.clone();
                let mut open = false;
                for one in operands {
                    let value = self.value(width, one, marking, outermost, watch)?;
                    if value == decisive {
                        return Ok(decisive);
                    }
                    open |= value == Truth::Open;
                }
                Ok(if open { Truth::Open } else { decisive.not() })
            }
            &Node::Next(one) => self.next(width, node, one, marking, outermost, watch),
            &Node::SomeUntil(left, right) => {
                self.until(width, &Until { node, left, right, some: true }, marking, outermost, watch)
            }
            &Node::EachUntil(left, right) => {
                self.until(width, &Until { node, left, right, some: false }, marking, outermost, watch)
            }
        }
    }

    fn marking<W: Width>(&mut self, width: W, number: u32) -> Vec<u64> {
        let mut bits = self.spare.pop().unwrap_or_default();
        bits.clear();
        bits.extend_from_slice(self.table.store.get(width, number as usize));
        bits
    }

    fn flip(&self, bits: &mut [u64], t: u32) {
        let flip = self.prepared.net.flip(t as usize, bits.len());
        bits.iter_mut().zip(flip).for_each(|(word, flip)| *word ^= flip);
    }

    /// Some next marking satisfies a node.
    fn next<W: Width>(
        &mut self,
        width: W,
        node: u32,
        one: u32,
        marking: u32,
        outermost: bool,
        watch: &mut Watch<'_>,
    ) -> Result<Truth, Stop> {
        if let Some(truth) = known(self.word(node, marking)) {
            return Ok(truth);
        }
        let mut bits = self.marking(width, marking);
        let mut firable = Vec::new();
        self.prepared.dependencies.all_firable(&bits, &mut firable);
        watch.tick(self.prepared.net.transitions.len())?;
        let mut found = Truth::False;
        for t in firable {
            self.flip(&mut bits, t);
            let after = self.number(width, &bits, watch)?;
            self.flip(&mut bits, t);
            self.edges += 1;
            match self.value(width, one, after, outermost, watch)? {
                Truth::True => {
                    found = Truth::True;
                    break;
                }
                Truth::Open => found = Truth::Open,
                Truth::False => {}
            }
        }
        self.spare.push(bits);
        self.set(node, marking, found.word())?;
        Ok(found)
    }

    /// The value of an until, of some run or of each; a search unless it is known.
    fn until<W: Width>(
        &mut self,
        width: W,
        until: &Until,
        marking: u32,
        outermost: bool,
        watch: &mut Watch<'_>,
    ) -> Result<Truth, Stop> {
        if let Some(truth) = known(self.word(until.node, marking)) {
            return Ok(truth);
        }
        let mut way = Way::default();
        let most = if outermost { self.budget.saturating_mul(OUTERMOST) } else { self.budget };
        let truth = self.search(width, until, marking, most, &mut way, watch)?;
        // Only what the search left on its way is still to be settled.
        for marking in way.live.drain(..) {
            self.words[until.node as usize][marking as usize] = truth.word();
        }
        self.memory.drop_vec(way.frames);
        self.memory.drop_vec(way.roots);
        self.memory.drop_vec(way.live);
        self.memory.drop_vec(way.firable);
        Ok(truth)
    }

    /// What a marking says of an until by itself: its value, or nothing where the search goes on from it; and whether it
    /// stays open even if the search meets nothing. A run that fails the until of each is never open on its way.
    fn here<W: Width>(
        &mut self,
        width: W,
        until: &Until,
        marking: u32,
        watch: &mut Watch<'_>,
    ) -> Result<(Option<Truth>, bool), Stop> {
        let end = self.value(width, until.right, marking, false, watch)?;
        if end == Truth::True {
            return Ok((Some(Truth::True), false));
        }
        let through = self.value(width, until.left, marking, false, watch)?;
        Ok(match (end, through) {
            (Truth::False, Truth::False) => (Some(Truth::False), false),
            (Truth::False, Truth::True) => (None, false),
            (Truth::Open, Truth::True) if until.some => (None, true),
            _ => (Some(Truth::Open), false),
        })
    }

    /// Depth first: for a marking that satisfies the until of some run, or for a run that fails the until of each.
    ///
    /// What is left in `way.live` has the value that is returned.
    fn search<W: Width>(
        &mut self,
        width: W,
        until: &Until,
        from: u32,
        most: usize,
        way: &mut Way,
        watch: &mut Watch<'_>,
    ) -> Result<Truth, Stop> {
        let (node, sought) = (until.node, Truth::from(until.some));
        if let Some(truth) = self.met(width, until, from, NONE, way, watch)? {
            return Ok(truth);
        }
        let mut count = 1;
        while let Some(&top) = way.frames.last() {
            let (first, end) = top.firable;
            if first == end && !until.some {
                return Ok(sought); // a deadlock: no run from here goes on
            }
            if top.next == end {
                way.frames.pop();
                way.firable.truncate(first);
                self.leave(node, top, sought, way);
                continue;
            }
            if let Some(frame) = way.frames.last_mut() {
                frame.next += 1;
            }
            let t = way.firable[top.next];
            let mut bits = self.marking(width, top.marking);
            self.flip(&mut bits, t);
            let after = self.number(width, &bits, watch)?;
            self.spare.push(bits);
            self.edges += 1;
            watch.found = Found { markings: self.table.store.len() as u64, edges: self.edges };
            watch.tick(1 + width.words())?;
            let word = self.word(node, after);
            let truth = match known(word) {
                None if word >= MET && !until.some => return Ok(sought), // a cycle
                None if word >= MET => {
                    join(way, word);
                    continue;
                }
                None if count >= most => return Ok(Truth::Open),
                None => {
                    count += 1;
                    self.met(width, until, after, t, way, watch)?
                }
                settled => settled,
            };
            match truth {
                Some(truth) if truth == sought => return Ok(sought),
                Some(Truth::Open) => way.roots.last_mut().into_iter().for_each(|root| root.open = true),
                _ => {}
            }
        }
        Ok(known(self.word(node, from)).unwrap_or(Truth::Open))
    }

    /// Settles a marking that is met for the first time by itself, or puts it on the way.
    fn met<W: Width>(
        &mut self,
        width: W,
        until: &Until,
        marking: u32,
        t: u32,
        way: &mut Way,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Truth>, Stop> {
        let (here, open) = self.here(width, until, marking, watch)?;
        if let Some(truth) = here {
            self.set(until.node, marking, truth.word())?;
            return Ok(here);
        }
        let met = MET + way.live.len() as u32;
        self.set(until.node, marking, met)?;
        let first = way.firable.len();
        self.find_firable(width, marking, t, way)?;
        self.arrange(width, until, marking, &mut way.firable[first..]);
        watch.tick(2 + way.firable.len() - first)?;
        let frame = Frame { marking, firable: (first, way.firable.len()), next: first, met };
        self.memory.push(&mut way.frames, frame)?;
        self.memory.push(&mut way.roots, Root { met, open })?;
        self.memory.push(&mut way.live, marking)?;
        Ok(None)
    }

    /// Settles the component of which a marking was the first, once all that follows it is done.
    fn leave(&mut self, node: u32, top: Frame, sought: Truth, way: &mut Way) {
        let Some(root) = way.roots.pop_if(|root| root.met == top.met) else { return };
        let truth = if root.open { Truth::Open } else { sought.not() };
        for marking in way.live.drain((top.met - MET) as usize..) {
            self.words[node as usize][marking as usize] = truth.word();
        }
        if root.open {
            way.roots.last_mut().into_iter().for_each(|root| root.open = true);
        }
    }

    /// Puts the firings from a marking in the order in which they are tried.
    fn arrange<W: Width>(&mut self, width: W, until: &Until, marking: u32, firable: &mut [u32]) {
        if let Some(random) = &mut self.random {
            for i in (1..firable.len()).rev() {
                firable.swap(i, random.below(i + 1));
            }
        }
        let guided = self.guided && until.some && firable.len() > 1;
        let Some(label) = self.formula.aims[until.right as usize].filter(|_| guided) else { return };
        let mut bits = self.marking(width, marking);
        let mut lacking = Vec::with_capacity(firable.len());
        for &t in firable.iter() {
            self.flip(&mut bits, t);
            lacking.push((self.formula.labels[label as usize].distance(&bits), t));
            self.flip(&mut bits, t);
        }
        self.spare.push(bits);
        lacking.sort_by_key(|&(distance, _)| distance);
        firable.iter_mut().zip(lacking).for_each(|(t, (_, other))| *t = other);
    }

    /// Appends what is firable at a marking, ascending, from what was so at the last one before `t` fired.
    fn find_firable<W: Width>(&mut self, width: W, marking: u32, t: u32, way: &mut Way) -> Result<(), Stop> {
        let dependencies = &self.prepared.dependencies;
        let bits = self.table.store.get(width, marking as usize);
        let begin = way.firable.len();
        let Some(&Frame { firable: (first, end), .. }) = way.frames.last() else {
            let mut all = Vec::new();
            dependencies.all_firable(bits, &mut all);
            return all.into_iter().try_for_each(|u| self.memory.push(&mut way.firable, u));
        };
        self.seen.clear();
        for at in first..end {
            let u = way.firable[at];
            self.seen.insert(u);
            if dependencies.firable(u, bits) {
                self.memory.push(&mut way.firable, u)?;
            }
        }
        for &l in dependencies.flipped(t) {
            for &u in dependencies.needers.of(negation(l)) {
                if self.seen.insert(u) && dependencies.firable(u, bits) {
                    self.memory.push(&mut way.firable, u)?;
                }
            }
        }
        way.firable[begin..].sort_unstable();
        Ok(())
    }
}

/// Makes one component of all that a firing back to what was met then goes round.
fn join(way: &mut Way, met: u32) {
    let mut open = false;
    while let Some(root) = way.roots.pop_if(|root| root.met > met) {
        open |= root.open;
    }
    way.roots.last_mut().into_iter().for_each(|root| root.open |= open);
}
