//! Who walks: a marking with its firable transitions, kept up firing by firing; and what is looked for.
//!
//! How many conditions of a transition are false is counted, and only the needers of what was flipped are looked at.

use super::dependencies::{Dependencies, is_true, negation};
use super::formula::Formula;

/// What a walk looks for.
#[derive(Clone, Debug)]
pub enum Target {
    /// A deadlock.
    Deadlock,
    /// A marking that satisfies a formula.
    Formula(Formula),
}

/// A marking that firings are made on, with what is firable in it.
pub(super) struct Walker<'a> {
    net: &'a Dependencies,
    pub(super) marking: Vec<u64>,
    /// For each transition how many of its conditions are false; those that never fire are not counted down.
    unmet: Vec<u32>,
    pub(super) firable: Vec<u32>,
    /// How many of the firable ones change nothing when they fire.
    idle: usize,
    position: Vec<u32>,
    /// The transitions that the last firing made firable, and some that it made so for a moment.
    pub(super) fresh: Vec<u32>,
}

impl<'a> Walker<'a> {
    pub(super) fn new(net: &'a Dependencies, initial: &[u64], transitions: usize) -> Self {
        let mut walker = Walker {
            net,
            marking: initial.to_vec(),
            unmet: vec![u32::MAX; transitions],
            firable: Vec::new(),
            idle: 0,
            position: vec![0; transitions],
            fresh: Vec::new(),
        };
        for t in (0..transitions as u32).filter(|&t| net.able(t)) {
            let unmet = net.conditions(t).iter().filter(|&&l| !is_true(l, initial)).count() as u32;
            walker.unmet[t as usize] = unmet;
            if unmet == 0 {
                walker.add(t);
            }
        }
        walker
    }

    fn add(&mut self, t: u32) {
        self.position[t as usize] = self.firable.len() as u32;
        self.firable.push(t);
        self.fresh.push(t);
        self.idle += usize::from(self.net.flipped(t).is_empty());
    }

    /// Whether a transition is firable.
    pub(super) fn may_fire(&self, t: u32) -> bool {
        self.unmet[t as usize] == 0
    }

    fn remove(&mut self, t: u32) {
        self.idle -= usize::from(self.net.flipped(t).is_empty());
        let at = self.position[t as usize];
        self.firable.swap_remove(at as usize);
        if let Some(&moved) = self.firable.get(at as usize) {
            self.position[moved as usize] = at;
        }
    }

    /// Whether no firing leads to another marking.
    pub(super) fn stuck(&self) -> bool {
        self.firable.len() == self.idle
    }

    /// Flips the places of a transition: fires it, or takes the firing back. Returns the work done.
    pub(super) fn flip(&mut self, t: u32) -> usize {
        let net = self.net;
        let mut work = 1;
        self.fresh.clear();
        for &condition in net.flipped(t) {
            let place = condition >> 1;
            let now_false = if is_true(condition, &self.marking) { condition } else { negation(condition) };
            self.marking[place as usize / 64] ^= 1 << (place % 64);
            for &u in net.needers.of(now_false) {
                self.unmet[u as usize] += 1;
                if self.unmet[u as usize] == 1 {
                    self.remove(u);
                }
            }
            for &u in net.needers.of(negation(now_false)) {
                self.unmet[u as usize] -= 1;
                if self.unmet[u as usize] == 0 {
                    self.add(u);
                }
            }
            work += net.needers.of(condition).len() + net.needers.of(negation(condition)).len();
        }
        work
    }
}

impl Target {
    /// Whether the walker stands on one.
    pub(super) fn met(&mut self, walker: &Walker<'_>) -> bool {
        match self {
            Target::Deadlock => walker.firable.is_empty(),
            Target::Formula(formula) => formula.holds(&walker.marking),
        }
    }

    /// How far the walker seems to be from one.
    pub(super) fn distance(&mut self, walker: &Walker<'_>) -> u64 {
        match self {
            Target::Deadlock => walker.firable.len() as u64,
            Target::Formula(formula) => formula.distance(&walker.marking),
        }
    }

    /// What the work of looking at it is, for whoever counts it.
    pub(super) fn size(&self) -> usize {
        match self {
            Target::Deadlock => 1,
            Target::Formula(formula) => formula.size(),
        }
    }
}
