//! The search: values of subformulas at markings, as they are asked for.
//!
//! Each subformula that speaks of what follows keeps for each marking what is known of it, in one word: nothing, true,
//! false, open, or the time at which the search that is now under way has met it. A subformula is never asked for inside
//! a search for itself, so one word is enough.
//!
//! Runs are followed by the firings in the order of the net, or in a drawn one; and in each second round first to the
//! marking that lacks the fewest literals of what is looked for.

use std::time::{Duration, Instant};

use super::formula::{Formula, Node, Until};
use crate::budget::{Found, Memory, Stop, Watch};
use crate::marking::{Width, linear_hash};
use crate::random::Random;
use crate::stubborn::marks::Marks;
use crate::stubborn::search::Prepared;
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
pub(super) const OUTERMOST: usize = 4;

/// Whether a subformula holds in a marking; `Open` where that is not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Truth {
    True,
    False,
    Open,
}

impl Truth {
    pub(super) fn not(self) -> Self {
        match self {
            Truth::True => Truth::False,
            Truth::False => Truth::True,
            Truth::Open => Truth::Open,
        }
    }

    pub(super) fn word(self) -> u32 {
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
pub(super) const MET: u32 = 4;

pub(super) fn known(word: u32) -> Option<Truth> {
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

/// What is known of a net and a formula, and what the searches share.
pub(super) struct Local<'a> {
    pub(super) prepared: &'a Prepared,
    pub(super) formula: &'a mut Formula,
    pub(super) table: Table,
    /// For each node what is known of it, by marking.
    pub(super) words: Vec<Vec<u32>>,
    pub(super) memory: Memory,
    pub(super) edges: u64,
    most: usize,
    /// Markings that a search may meet in this round.
    pub(super) budget: usize,
    pub(super) random: Option<Random>,
    pub(super) guided: bool,
    pub(super) seen: Marks,
    /// Markings as bits, taken from here and given back.
    pub(super) spare: Vec<Vec<u64>>,
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
    pub(super) fn number<W: Width>(&mut self, width: W, marking: &[u64], watch: &mut Watch<'_>) -> Result<u32, Stop> {
        let hash = linear_hash(width, marking);
        if let Some(known) = self.table.find(width, marking, hash) {
            return Ok(known);
        }
        let number = self.table.store.len();
        self.table.make_room(width, 1, &self.memory, watch)?;
        self.table.insert(width, marking, hash, self.most, &self.memory)?;
        Ok(number as u32)
    }

    pub(super) fn word(&self, node: u32, marking: u32) -> u32 {
        self.words[node as usize].get(marking as usize).copied().unwrap_or(UNKNOWN)
    }

    pub(super) fn set(&mut self, node: u32, marking: u32, word: u32) -> Result<(), Stop> {
        let words = &mut self.words[node as usize];
        let missing = (marking as usize + 1).saturating_sub(words.len());
        self.memory.extend(words, UNKNOWN, missing)?;
        words[marking as usize] = word;
        Ok(())
    }

    /// The value of a node in a marking; `outermost` where no search is under way.
    pub(super) fn value<W: Width>(
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

    pub(super) fn marking<W: Width>(&mut self, width: W, number: u32) -> Vec<u64> {
        let mut bits = self.spare.pop().unwrap_or_default();
        bits.clear();
        bits.extend_from_slice(self.table.store.get(width, number as usize));
        bits
    }

    pub(super) fn flip(&self, bits: &mut [u64], t: u32) {
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
}
