//! The closure: the smallest set that the rules (disabled) and (firable) make of what the goal asks for.
//!
//! Literals stand between transitions: a firable member pulls in the needers of what it flips, a member that is not
//! firable the makers of one false condition, and either list is taken once in a closure, however many members ask
//! for it. So a closure is linear in the part of the net that it reaches.
//!
//! Which false condition serves is free, and decides how well it works. Firable members are followed first; then a
//! condition whose makers are members already costs nothing; else the cheapest is taken. The price of a literal counts
//! its firable makers before the others. A *thorough* closure looks one step further: a maker costs nothing where it is
//! a member, and one that is not firable costs what its own cheapest condition does. That takes some five times as
//! long, and leaves a fortieth of the markings on some nets and more than the quick closure on others; so the
//! caller chooses. Where the goal leaves a choice too (which key, which false operand), every choice is closed and the
//! set with the fewest firable members is kept; a closure ends as soon as it is no better than the best so far. The
//! rejected alternative, to take the first key and the first false condition, visits several times as many markings.

use super::dependencies::{Dependencies, Literal, is_true, negation};
use super::marks::Marks;

/// The price of a firable maker; one that is not firable costs 1 by itself.
const FIRABLE: u64 = 1 << 32;

/// A set of transitions that the rules have closed.
#[derive(Debug)]
pub struct Set {
    /// The members as a set; empty where nothing was closed.
    pub member: Marks,
    /// The members.
    pub members: Vec<u32>,
    /// The firable ones.
    pub firable: Vec<u32>,
    /// What the goal asked for: the makers of these,
    pub literals: Vec<Literal>,
    /// and these.
    pub transitions: Vec<u32>,
}

impl Set {
    fn new(transitions: usize) -> Self {
        Set {
            member: Marks::new(transitions),
            members: Vec::new(),
            firable: Vec::new(),
            literals: Vec::new(),
            transitions: Vec::new(),
        }
    }

    fn clear(&mut self) {
        self.member.clear();
        self.members.clear();
        self.firable.clear();
        self.literals.clear();
        self.transitions.clear();
    }
}

/// Finds stubborn sets, one marking after the other.
#[derive(Debug)]
pub struct Closure<'a> {
    /// The net.
    pub net: &'a Dependencies,
    /// The transitions that are firable at the marking, ascending.
    firable: Vec<u32>,
    is_firable: Marks,
    /// For each literal how many of its makers are firable.
    makers_firable: Vec<u32>,
    needers_in: Marks,
    makers_in: Marks,
    open_firable: Vec<u32>,
    open_disabled: Vec<u32>,
    now: Set,
    /// The set that fires the fewest transitions so far; at first all that are firable.
    pub best: Set,
    /// Members looked at since `start`.
    pub work: usize,
}

impl<'a> Closure<'a> {
    /// For a net of so many places and transitions.
    pub fn new(net: &'a Dependencies, places: usize, transitions: usize) -> Self {
        let literals = 2 * places;
        Closure {
            net,
            firable: Vec::new(),
            is_firable: Marks::new(transitions),
            makers_firable: vec![0; literals],
            needers_in: Marks::new(literals),
            makers_in: Marks::new(literals),
            open_firable: Vec::new(),
            open_disabled: Vec::new(),
            now: Set::new(transitions),
            best: Set::new(transitions),
            work: 0,
        }
    }

    /// Bytes held for a net of so many places and transitions, at most.
    pub fn bytes(places: usize, transitions: usize) -> usize {
        4 * (4 * transitions + 2 * 7 * transitions + 3 * 2 * places)
    }

    /// Goes to a marking.
    pub fn start(&mut self, marking: &[u64]) {
        self.leave();
        self.net.all_firable(marking, &mut self.firable);
        self.begin();
    }

    /// Goes to a marking at which these are the firable transitions.
    pub fn start_from(&mut self, firable: &[u32]) {
        self.leave();
        self.firable.clear();
        self.firable.extend(firable);
        self.begin();
    }

    fn leave(&mut self) {
        for &t in &self.firable {
            for &l in self.net.flipped(t) {
                self.makers_firable[negation(l) as usize] = 0;
            }
        }
    }

    fn begin(&mut self) {
        self.is_firable.clear();
        for &t in &self.firable {
            self.is_firable.insert(t);
            for &l in self.net.flipped(t) {
                self.makers_firable[negation(l) as usize] += 1;
            }
        }
        self.best.clear();
        self.best.firable.clone_from(&self.firable);
        self.work = self.firable.len();
    }

    /// The transitions that are firable at the marking, ascending.
    pub fn firable(&self) -> &[u32] {
        &self.firable
    }

    /// Whether a transition is firable at the marking.
    #[inline(always)]
    pub fn is_firable(&self, t: u32) -> bool {
        self.is_firable.has(t)
    }

    /// The members of the best set, ascending: all transitions where no closure was better than to fire all.
    pub fn chosen(&self) -> Vec<u32> {
        let best = &self.best;
        if best.members.is_empty() && best.firable.len() == self.firable.len() {
            return (0..self.is_firable.len() as u32).collect();
        }
        let mut members: Vec<u32> = best.members.iter().copied().filter(|&t| best.member.has(t)).collect();
        members.sort_unstable();
        members
    }

    /// What it costs to take in the makers of a literal: the firable ones count first.
    #[inline(always)]
    pub fn price(&self, of: Literal) -> u64 {
        u64::from(self.makers_firable[of as usize]) * FIRABLE + self.net.makers.of(of).len() as u64
    }

    /// The same of the makers that are no members yet.
    fn price_of_more(&self, of: Literal) -> u64 {
        let price = |&t: &u32| match (self.now.member.has(t), self.is_firable.has(t)) {
            (true, _) => 0,
            (false, true) => FIRABLE,
            (false, false) => 1,
        };
        self.net.makers.of(of).iter().map(price).sum()
    }

    /// The same, one step further: one that is not firable also costs what its cheapest false condition does.
    fn thorough_price(&mut self, of: Literal, marking: &[u64]) -> u64 {
        let net = self.net;
        self.work += net.makers.of(of).len();
        let further = |t: u32| {
            let unmet = net.conditions(t).iter().filter(|&&l| !is_true(l, marking));
            unmet.map(|&l| if self.makers_in.has(l) { 0 } else { self.price_of_more(l) }).min().unwrap_or(0)
        };
        let more = net.makers.of(of).iter().filter(|&&t| !self.now.member.has(t) && !self.is_firable.has(t));
        self.price_of_more(of).saturating_add(more.map(|&t| further(t)).fold(0, u64::saturating_add))
    }

    /// Closes the makers of some literals and some more transitions, and keeps the set if it fires fewer than the best.
    pub fn consider(&mut self, marking: &[u64], literals: &[Literal], transitions: &[u32], thorough: bool) {
        self.consider_unless(marking, literals, transitions, thorough, |_| false);
    }

    /// The same; a set in which one that is firable is `barred` is not kept.
    pub fn consider_unless(
        &mut self,
        marking: &[u64],
        literals: &[Literal],
        transitions: &[u32],
        thorough: bool,
        barred: impl Fn(u32) -> bool,
    ) {
        self.now.clear();
        self.needers_in.clear();
        self.makers_in.clear();
        self.open_firable.clear();
        self.open_disabled.clear();
        for &l in literals {
            self.take_makers(l);
        }
        for &t in transitions {
            self.take(t);
        }
        while self.now.firable.len() < self.best.firable.len() {
            if let Some(t) = self.open_firable.pop() {
                if barred(t) {
                    return;
                }
                self.work += 1;
                for &l in self.net.flipped(t) {
                    self.take_needers(l);
                }
            } else if let Some(t) = self.open_disabled.pop() {
                self.work += 1;
                if let Some(l) = self.condition_to_serve(t, marking, thorough) {
                    self.take_makers(l);
                }
            } else {
                self.now.literals.extend(literals);
                self.now.transitions.extend(transitions);
                std::mem::swap(&mut self.now, &mut self.best);
                return;
            }
        }
    }

    /// A false condition of a transition whose makers cost least; none where the makers of one are members already.
    #[inline]
    fn condition_to_serve(&mut self, t: u32, marking: &[u64], thorough: bool) -> Option<Literal> {
        let mut cheapest = (u64::MAX, None);
        for &l in self.net.conditions(t) {
            if !is_true(l, marking) {
                if self.makers_in.has(l) {
                    return None;
                }
                let price = if thorough { self.thorough_price(l, marking) } else { self.price(l) };
                if price < cheapest.0 {
                    cheapest = (price, Some(l));
                }
            }
        }
        debug_assert!(cheapest.1.is_some() || !self.net.able(t));
        cheapest.1
    }

    fn take_makers(&mut self, l: Literal) {
        if self.makers_in.insert(l) {
            let net = self.net;
            net.makers.of(l).iter().for_each(|&t| self.take(t));
        }
    }

    fn take_needers(&mut self, l: Literal) {
        if self.needers_in.insert(l) {
            let net = self.net;
            net.needers.of(l).iter().for_each(|&t| self.take(t));
            self.makers_in.insert(negation(l)); // they are among them
        }
    }

    #[inline(always)]
    fn take(&mut self, t: u32) {
        if self.now.member.insert(t) {
            self.now.members.push(t);
            if self.is_firable.has(t) {
                self.now.firable.push(t);
                self.open_firable.push(t);
            } else {
                self.open_disabled.push(t);
            }
        }
    }
}
