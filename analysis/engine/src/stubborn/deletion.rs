//! Deletion: a stubborn set is made smaller by taking out one firable member after the other, where the rules let it.
//!
//! A closure serves each disabled member by one false condition and never thinks again. Here the members are given, and
//! each of them may be served by any condition all of whose makers are members. If one is taken out, so must be, by
//! (firable), each firable member that flips a place on which it has a condition, and, by (disabled), each other one
//! that no condition serves any more; if that reaches what the goal asked for, all of them come back. What is left is
//! stubborn by the same rules, and no firable member can be taken out of it any more.
//!
//! This is Valmari's deletion algorithm ("State of the art report: Stubborn sets", 1994), begun not with all transitions
//! but with the best closure, because it looks at every member again and again. From all transitions it finds still
//! smaller sets and takes longer than the markings that they save.

use super::closure::Closure;
use super::dependencies::{is_true, negation};
use super::marks::Marks;

/// Takes members out of the best set of a closure; the room for it is kept from marking to marking.
#[derive(Debug)]
pub struct Deletion {
    /// Members that the goal asked for.
    pinned: Marks,
    /// For each disabled member how many of its false conditions serve it: all their makers are members.
    serving: Vec<u32>,
    /// For each literal how many of its makers are no members, where that is known.
    missing: Vec<u32>,
    counted: Marks,
    taken: Vec<u32>,
    order: Vec<u32>,
}

impl Deletion {
    /// For a net of so many places and transitions.
    pub fn new(places: usize, transitions: usize) -> Self {
        Deletion {
            pinned: Marks::new(transitions),
            serving: vec![0; transitions],
            missing: vec![0; 2 * places],
            counted: Marks::new(2 * places),
            taken: Vec::new(),
            order: Vec::new(),
        }
    }

    /// Bytes held for a net of so many places and transitions, at most.
    pub fn bytes(places: usize, transitions: usize) -> usize {
        4 * (2 + 4) * transitions + 4 * 2 * 2 * places
    }

    /// Makes the best set smaller; true if it fires fewer transitions after.
    pub fn shrink(&mut self, closure: &mut Closure<'_>, marking: &[u64]) -> bool {
        if closure.best.members.is_empty() || !self.count(closure, marking) {
            return false;
        }
        let net = closure.net;
        self.pinned.clear();
        for &l in &closure.best.literals {
            net.makers.of(l).iter().for_each(|&t| _ = self.pinned.insert(t));
        }
        closure.best.transitions.iter().for_each(|&t| _ = self.pinned.insert(t));
        let before = closure.best.firable.len();
        self.order.clone_from(&closure.best.firable);
        for at in 0..self.order.len() {
            let t = self.order[at];
            if closure.best.member.has(t) && !self.take_out(t, closure, marking) {
                self.bring_back(closure, marking);
            }
        }
        let member = &closure.best.member;
        closure.best.firable.retain(|&t| member.has(t));
        closure.best.firable.len() < before
    }

    /// Counts what serves the disabled members; false where none has a choice, so that nothing can be taken out.
    fn count(&mut self, closure: &mut Closure<'_>, marking: &[u64]) -> bool {
        let net = closure.net;
        let mut choice = false;
        self.counted.clear();
        for &t in &closure.best.members {
            if closure.is_firable(t) {
                continue;
            }
            let mut serving = 0;
            for &l in net.conditions(t) {
                if !is_true(l, marking) {
                    if self.counted.insert(l) {
                        let outside = |t: &&u32| !closure.best.member.has(**t);
                        self.missing[l as usize] = net.makers.of(l).iter().filter(outside).count() as u32;
                    }
                    serving += u32::from(self.missing[l as usize] == 0);
                }
            }
            self.serving[t as usize] = serving;
            choice |= serving > 1;
        }
        closure.work += closure.best.members.len();
        choice
    }

    /// Takes out a member and all that cannot stay without it; false where a pinned one would have to go.
    fn take_out(&mut self, t: u32, closure: &mut Closure<'_>, marking: &[u64]) -> bool {
        let net = closure.net;
        self.taken.clear();
        if self.pinned.has(t) {
            return false;
        }
        closure.best.member.remove(t);
        self.taken.push(t);
        let mut next = 0;
        let mut possible = true;
        while let Some(&t) = self.taken.get(next) {
            next += 1;
            closure.work += 1;
            for l in self.unmet(t, closure, marking) {
                self.missing[l as usize] += 1;
                if self.missing[l as usize] > 1 {
                    continue;
                }
                // Counted for all that are not firable, members or not: `bring_back` does the exact reverse.
                for &u in net.needers.of(l) {
                    self.serving[u as usize] = self.serving[u as usize].wrapping_sub(1);
                    let unserved = self.serving[u as usize] == 0 && !closure.is_firable(u);
                    if unserved && possible && closure.best.member.has(u) {
                        possible = self.leave(u, closure);
                    }
                }
            }
            for &l in net.conditions(t) {
                for &u in net.makers.of(negation(l)) {
                    if possible && closure.best.member.has(u) && closure.is_firable(u) {
                        possible = self.leave(u, closure);
                    }
                }
            }
            if !possible {
                for t in self.taken.drain(next..) {
                    closure.best.member.insert(t); // not counted yet
                }
            }
        }
        possible
    }

    fn bring_back(&mut self, closure: &mut Closure<'_>, marking: &[u64]) {
        let net = closure.net;
        while let Some(t) = self.taken.pop() {
            closure.best.member.insert(t);
            for l in self.unmet(t, closure, marking) {
                self.missing[l as usize] -= 1;
                if self.missing[l as usize] == 0 {
                    for &u in net.needers.of(l) {
                        self.serving[u as usize] = self.serving[u as usize].wrapping_add(1);
                    }
                }
            }
        }
    }

    /// The false literals that a transition makes true and that may serve a member.
    fn unmet(&self, t: u32, closure: &Closure<'_>, marking: &[u64]) -> impl Iterator<Item = u32> + use<> {
        let made = closure.net.flipped(t).iter().map(|&l| negation(l));
        made.filter(|&l| !is_true(l, marking) && self.counted.has(l)).collect::<Vec<_>>().into_iter()
    }

    fn leave(&mut self, t: u32, closure: &mut Closure<'_>) -> bool {
        if self.pinned.has(t) {
            return false;
        }
        closure.best.member.remove(t);
        self.taken.push(t);
        true
    }
}
