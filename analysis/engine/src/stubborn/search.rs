//! The search: breadth first over the markings that stubborn sets lead to, until the goal is found or nothing is left.
//!
//! The markings found are those of the explicit engine's table, and each keeps the marking from which it was found
//! first, so that a firing sequence to it can be read off. Breadth first because the distance to the goal is kept (see
//! the theorem in `mod.rs`): the first goal found is a nearest one. Depth first was rejected: it finds deep goals
//! sooner by luck, which a random walk does better, and proves nothing sooner.
//!
//! What is firable at a marking on the way is known for each transition, whatever the goal. On request the stubborn set
//! of each marking is kept, so that somebody else can look through what was left out, and why.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::closure::Closure;
use super::deletion::Deletion;
use super::dependencies::{Dependencies, Literal, negation};
use super::effort::Effort;
use super::formula::Formula;
use crate::budget::{Found, Memory, Stop, Watch};
use crate::marking::{Dynamic, Width, linear_hash};
use crate::net::Net;
use crate::table::NONE;
use crate::table::Table;
use crate::with_width;

/// False operands of a formula that are tried; the cheapest first. A formula may have thousands.
const CHOICES_MAX: usize = 16;

/// What is searched for.
#[derive(Clone, Debug)]
pub enum Goal {
    /// All deadlocks, or the first one.
    Deadlock {
        /// Whether the search goes on after the first.
        all: bool,
    },
    /// A marking that satisfies a formula.
    Formula(Formula),
    /// For each of some transitions a marking at which it is firable and openable.
    Firing(Vec<u32>),
}

/// How a search is done, and its budgets.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Longer thought about each marking, for fewer markings on some nets.
    pub thorough: bool,
    /// Most markings that are stored.
    pub markings: usize,
    /// Most bytes that are held, transient copies included.
    pub memory_bytes: usize,
    /// Longest time.
    pub time: Option<Duration>,
    /// Whether the stubborn set of each marking is kept.
    pub keep_sets: bool,
}

/// The stubborn sets of a search, each once.
#[derive(Debug, Default)]
pub struct Sets {
    numbers: HashMap<Arc<[u32]>, u32>,
    /// The members of each, ascending.
    pub sets: Vec<Arc<[u32]>>,
    /// For each marking that was left behind the number of its set.
    pub chosen: Vec<u32>,
}

impl Sets {
    /// What a set takes besides its members, in both places where it is named.
    const OVERHEAD: usize = 64;

    fn keep(&mut self, members: Vec<u32>, memory: &Memory) -> Result<(), Stop> {
        let number = match self.numbers.get(members.as_slice()) {
            Some(&number) => number,
            None => {
                memory.claim(4 * members.len() + Sets::OVERHEAD)?;
                let (set, number) = (Arc::<[u32]>::from(members), self.sets.len() as u32);
                self.sets.push(Arc::clone(&set));
                self.numbers.insert(set, number);
                number
            }
        };
        memory.push(&mut self.chosen, number)
    }
}

/// A net with its dependencies, ready for any number of searches.
#[derive(Debug)]
pub struct Prepared {
    /// The net.
    pub net: Net,
    /// Its dependencies.
    pub dependencies: Dependencies,
}

impl Prepared {
    /// Reads the dependencies off a net.
    pub fn new(net: Net) -> Self {
        Prepared { dependencies: Dependencies::new(&net), net }
    }
}

/// What a search found; all of it where `stop` is none.
#[derive(Debug)]
pub struct Search {
    /// The net.
    pub prepared: Arc<Prepared>,
    /// The markings found, by index.
    pub table: Table,
    /// The index from which each was found first; `NONE` for M0.
    pub parents: Vec<u32>,
    /// Firings followed.
    pub edges: u64,
    /// The deadlocks found, ascending.
    pub deadlocks: Vec<u32>,
    /// The marking that satisfies the formula.
    pub found: Option<u32>,
    /// For each transition the first marking found at which it is firable and openable, or `NONE`.
    pub firable: Vec<u32>,
    /// The stubborn sets, where they are kept.
    pub sets: Option<Sets>,
    /// Why the search ended before the answer was known.
    pub stop: Option<Stop>,
    /// What is held, and the most that may be held.
    pub memory: Memory,
    /// How long it took.
    pub seconds: f64,
}

impl Search {
    /// Searches from M0 until the goal is found cannot be, or a budget is used up.
    pub fn run(
        prepared: Arc<Prepared>,
        goal: Goal,
        limits: Limits,
        poll: &mut dyn FnMut(Found) -> Result<(), Stop>,
    ) -> Result<Self, Stop> {
        let start = Instant::now();
        let (places, count) = (prepared.net.places, prepared.net.transitions.len());
        let memory = Memory::new(limits.memory_bytes);
        memory.claim(prepared.net.bytes() + prepared.dependencies.bytes())?;
        memory.claim(Closure::bytes(places, count) + Deletion::bytes(places, count))?;
        memory.claim(4 * count + goal_bytes(&goal))?;
        let mut search = Search {
            table: Table::new(prepared.net.words, &memory)?,
            parents: Vec::new(),
            edges: 0,
            deadlocks: Vec::new(),
            found: None,
            firable: vec![NONE; count],
            sets: limits.keep_sets.then(Sets::default),
            stop: None,
            memory,
            seconds: 0.0,
            prepared: Arc::clone(&prepared),
        };
        let mut watch = Watch::new(limits.time.and_then(|time| start.checked_add(time)), poll);
        let max = limits.markings.clamp(1, NONE as usize);
        let end = with_width!(prepared.net.words, width => search.follow(width, &prepared, goal, limits.thorough, max, &mut watch));
        search.stop = end.err();
        search.seconds = start.elapsed().as_secs_f64();
        Ok(search)
    }

    /// How many markings were found.
    pub fn len(&self) -> usize {
        self.table.store.len()
    }

    /// Whether none was found, which never happens.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The marking of an index.
    pub fn marking(&self, index: usize) -> &[u64] {
        self.table.store.get(Dynamic(self.prepared.net.words), index)
    }

    fn follow<W: Width>(
        &mut self,
        width: W,
        prepared: &Prepared,
        mut goal: Goal,
        thorough: bool,
        max: usize,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        let net = &prepared.net;
        let words = width.words();
        let mut chooser = Chooser::new(prepared, thorough);
        let mut marking = net.initial.clone();
        let mut after = vec![0; words];
        self.table.insert(width, &marking, linear_hash(width, &marking), max, &self.memory)?;
        self.memory.push(&mut self.parents, NONE)?;
        if let Goal::Formula(formula) = &mut goal
            && formula.holds(&marking)
        {
            self.found = Some(0);
            return Ok(());
        }
        let mut next = 0;
        while next < self.table.store.len() {
            marking.copy_from_slice(self.table.store.get(width, next));
            chooser.closure.start(&marking);
            for &t in chooser.closure.firable() {
                if self.firable[t as usize] == NONE {
                    self.firable[t as usize] = next as u32;
                }
            }
            if chooser.closure.firable().is_empty() {
                self.memory.push(&mut self.deadlocks, next as u32)?;
                if let Goal::Deadlock { all: false } = goal {
                    return Ok(());
                }
            }
            if !chooser.choose(&mut goal, &marking, &self.firable) {
                return Ok(());
            }
            if let Some(sets) = &mut self.sets {
                sets.keep(chooser.closure.chosen(), &self.memory)?;
            }
            let hash = linear_hash(width, &marking);
            for &t in &chooser.closure.best.firable {
                let flip = net.flip(t as usize, words);
                for k in 0..words {
                    after[k] = marking[k] ^ flip[k];
                }
                self.edges += 1;
                let hash = hash ^ net.flip_hashes[t as usize];
                self.table.make_room(width, 1, &self.memory, watch)?;
                if self.table.insert(width, &after, hash, max, &self.memory)? {
                    self.memory.push(&mut self.parents, next as u32)?;
                    if let Goal::Formula(formula) = &mut goal
                        && formula.holds(&after)
                    {
                        self.found = Some(self.table.store.len() as u32 - 1);
                        return Ok(());
                    }
                }
            }
            next += 1;
            watch.found = Found { markings: self.table.store.len() as u64, edges: self.edges };
            watch.tick(1 + chooser.closure.work + words)?;
        }
        Ok(())
    }

    /// A firing sequence from M0 to a marking: the one that found it, a shortest one of the reduced graph.
    pub fn path_to(&self, index: u32) -> Vec<u32> {
        let net = &self.prepared.net;
        let mut path = Vec::new();
        let mut firable = Vec::new();
        let mut at = index;
        while self.parents[at as usize] != NONE {
            let before = self.parents[at as usize];
            let (from, to) = (self.marking(before as usize), self.marking(at as usize));
            self.prepared.dependencies.all_firable(from, &mut firable);
            let leads =
                |&t: &u32| net.flip(t as usize, net.words).iter().zip(from).zip(to).all(|((f, a), b)| f ^ a == *b);
            path.extend(firable.iter().copied().find(leads));
            at = before;
        }
        path.reverse();
        path
    }
}

/// Chooses a stubborn set at one marking after the other.
struct Chooser<'a> {
    closure: Closure<'a>,
    deletion: Deletion,
    /// What the keys of deadlocks have brought, each closed.
    closing: Effort,
    /// What thorough closures of keys have brought beyond quick ones.
    thinking: Effort,
    /// What deletion has brought.
    deleting: Effort,
    thorough: bool,
    literals: Vec<Literal>,
}

impl<'a> Chooser<'a> {
    fn new(prepared: &'a Prepared, thorough: bool) -> Self {
        let (places, count) = (prepared.net.places, prepared.net.transitions.len());
        Chooser {
            closure: Closure::new(&prepared.dependencies, places, count),
            deletion: Deletion::new(places, count),
            closing: Effort::default(),
            thinking: Effort::default(),
            deleting: Effort::default(),
            thorough,
            literals: Vec::new(),
        }
    }

    /// Makes the best set of the closure a small stubborn set at a marking outside of the goal; false where the goal,
    /// the firing of some transitions, is reached by what has been `firable` so far.
    fn choose(&mut self, goal: &mut Goal, marking: &[u64], firable: &[u32]) -> bool {
        match goal {
            Goal::Firing(wanted) => {
                wanted.retain(|&t| firable[t as usize] == NONE);
                self.closure.work += wanted.len();
                if wanted.is_empty() {
                    return false;
                }
            }
            Goal::Formula(formula) => {
                formula.holds(marking);
                self.closure.work += formula.size();
                formula.weigh(|l| self.closure.price(l));
            }
            Goal::Deadlock { .. } => {}
        }
        self.close(goal, marking);
        if self.closure.best.firable.len() > 1 && self.deleting.is_worth_it() {
            let success = self.deletion.shrink(&mut self.closure, marking);
            self.deleting.note(success);
        }
        self.closure.best.firable.sort_unstable();
        true
    }

    /// Closes every choice that the goal leaves.
    fn close(&mut self, goal: &mut Goal, marking: &[u64]) {
        let (closure, literals, thorough) = (&mut self.closure, &mut self.literals, self.thorough);
        match goal {
            Goal::Deadlock { .. } => {
                // As many closures as transitions are firable; on some nets none of them is ever smaller than all.
                let all = closure.firable().len();
                if all < 2 || !self.closing.is_worth_it() {
                    return;
                }
                close_keys(closure, literals, marking, false);
                let quick = closure.best.firable.len();
                if thorough && self.thinking.is_worth_it() {
                    close_keys(closure, literals, marking, true);
                    self.thinking.note(closure.best.firable.len() < quick);
                }
                self.closing.note(closure.best.firable.len() < all);
            }
            Goal::Formula(formula) => {
                for choice in formula.choices().into_iter().take(CHOICES_MAX) {
                    if closure.best.firable.is_empty() {
                        break;
                    }
                    formula.wanted(choice, literals);
                    closure.consider(marking, literals, &[], thorough);
                }
            }
            Goal::Firing(wanted) => closure.consider(marking, &[], wanted, thorough),
        }
    }
}

/// Closes each key of a deadlock that may do better than the best so far.
fn close_keys(closure: &mut Closure<'_>, literals: &mut Vec<Literal>, marking: &[u64], thorough: bool) {
    for at in 0..closure.firable().len() {
        let key = closure.firable()[at];
        // A key that fires is a member itself; only one that changes nothing may leave nothing to fire.
        let least = usize::from(!closure.net.flipped(key).is_empty());
        if closure.best.firable.len() <= least {
            continue;
        }
        literals.clear();
        literals.extend(closure.net.conditions(key).iter().map(|&l| negation(l)));
        closure.consider(marking, literals, &[], thorough);
    }
}

fn goal_bytes(goal: &Goal) -> usize {
    match goal {
        Goal::Deadlock { .. } => 0,
        Goal::Formula(formula) => formula.bytes(),
        Goal::Firing(wanted) => 4 * wanted.len(),
    }
}
