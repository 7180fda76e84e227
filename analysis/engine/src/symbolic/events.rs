//! Transitions as the diagram sees them: literals in descending order of level, shared from below.
//!
//! At each place that it is joined to, a transition wants a token or none, and leaves one or none: four kinds of
//! literal. What is left of a transition below a level is a *suffix*; equal suffixes have one number, so that what one
//! transition did to a node is remembered for every other that does the same below.
//!
//! An event belongs to the level of its highest literal. Zero suppression hides some of them: where the highest literal
//! wants the place *empty* (an output, an inhibitive gate), the event can fire on a node that lies below its level and
//! passes it over, and a saturation that looks only at the levels where nodes are misses it. Such levels are *wakeful*.
//! To try every wakeful level above every node is quadratic in the places; but an event that wants a token somewhere
//! below cannot fire on a node that lies below that place too. So each wakeful level is filed under the lowest level a
//! node must have for one of its events to matter, and the next level to try is found in a tree of minima.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use super::cache::OPERAND_MAX;
use crate::budget::Stop;
use crate::net::Transition;

/// What a transition wants of a place and leaves on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Wants a token, leaves none: an input.
    Take,
    /// Wants none, leaves a token: an output.
    Put,
    /// Wants a token and leaves it: a permissive gate.
    Full,
    /// Wants none and leaves none: an inhibitive gate.
    Empty,
}

impl Kind {
    /// Whether the place must hold a token.
    pub fn wants(self) -> bool {
        matches!(self, Kind::Take | Kind::Full)
    }

    /// Whether the place holds a token afterwards.
    pub fn leaves(self) -> bool {
        matches!(self, Kind::Put | Kind::Full)
    }

    fn reversed(self) -> Kind {
        match self {
            Kind::Take => Kind::Put,
            Kind::Put => Kind::Take,
            other => other,
        }
    }

    fn tested(self) -> Kind {
        if self.wants() { Kind::Full } else { Kind::Empty }
    }
}

/// The number of a suffix.
pub type Suffix = u32;
/// Nothing is left to do: the identity.
pub const DONE: Suffix = 0;
/// Nothing is left to do but to saturate what is below.
pub const SATURATE: Suffix = 1;

/// A literal, and what follows below it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Literal {
    /// The level of the place; 0 for `DONE` and `SATURATE`.
    pub level: u32,
    /// What is wanted and left.
    pub kind: Kind,
    /// The suffix below.
    pub next: Suffix,
    /// The highest level, at or below this one, that must hold a token; 0 where there is none.
    pub needs: u32,
}

/// A hash of a few words that need no defence against an enemy.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mixer(u64);

/// Builds the hash of a few words.
pub type Mixed = BuildHasherDefault<Mixer>;

impl Hasher for Mixer {
    fn write(&mut self, bytes: &[u8]) {
        let (words, rest) = bytes.as_chunks::<4>();
        words.iter().for_each(|&word| self.write_u32(u32::from_ne_bytes(word)));
        rest.iter().for_each(|&byte| self.write_u32(u32::from(byte)));
    }

    fn write_u32(&mut self, word: u32) {
        self.0 = (self.0.rotate_left(23) ^ u64::from(word)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }

    fn write_isize(&mut self, word: isize) {
        self.write_u32(word as u32);
    }

    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 29
    }
}

/// All suffixes, each once.
#[derive(Debug)]
pub struct Suffixes {
    rows: Vec<Literal>,
    index: HashMap<(u32, Kind, Suffix), Suffix, Mixed>,
}

impl Default for Suffixes {
    fn default() -> Self {
        let nothing = Literal { level: 0, kind: Kind::Empty, next: DONE, needs: 0 };
        Suffixes { rows: vec![nothing, nothing], index: HashMap::default() }
    }
}

impl Suffixes {
    /// The first literal of a suffix.
    #[inline(always)]
    pub fn get(&self, suffix: Suffix) -> Literal {
        self.rows[suffix as usize]
    }

    fn intern(&mut self, level: u32, kind: Kind, next: Suffix) -> Result<Suffix, Stop> {
        if let Some(&known) = self.index.get(&(level, kind, next)) {
            return Ok(known);
        }
        let number = self.rows.len() as u32;
        if number > OPERAND_MAX {
            return Err(Stop::Memory);
        }
        let needs = if kind.wants() { level } else { self.get(next).needs };
        self.rows.push(Literal { level, kind, next, needs });
        self.index.insert((level, kind, next), number);
        Ok(number)
    }

    /// The suffix of these literals, given in descending order of level.
    pub fn whole(&mut self, literals: &[(u32, Kind)]) -> Result<Suffix, Stop> {
        literals.iter().rev().try_fold(DONE, |next, &(level, kind)| self.intern(level, kind, next))
    }

    /// How many bytes the suffixes take, about.
    pub fn bytes(&self) -> usize {
        self.rows.capacity() * size_of::<Literal>() + self.index.capacity() * 24
    }
}

/// What the events of a table do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// The marking after a firing.
    Forward,
    /// The marking before it.
    Backward,
    /// The same marking, where the transition may fire.
    Test,
}

/// The literals of a transition in descending order of level; None where it can never fire.
///
/// `level_of` gives each place its level.
pub fn literals(transition: &Transition, level_of: &[u32], sense: Sense) -> Option<Vec<(u32, Kind)>> {
    let mut all = Vec::new();
    literals_into(transition, level_of, sense, &mut all).then_some(all)
}

/// The same in place of what is in a list; whether it can fire.
pub(super) fn literals_into(
    transition: &Transition,
    level_of: &[u32],
    sense: Sense,
    all: &mut Vec<(u32, Kind)>,
) -> bool {
    all.clear();
    if !transition.openable() {
        return false;
    }
    let lists = [
        (&transition.inputs, Kind::Take),
        (&transition.outputs, Kind::Put),
        (&transition.permissive, Kind::Full),
        (&transition.inhibitive, Kind::Empty),
    ];
    for (places, kind) in lists {
        all.extend(places.iter().map(|&place| (level_of[place as usize], kind)));
    }
    // Stable: of two literals on one place the arc comes before the gate, and the gate must agree with it.
    all.sort_by_key(|&(level, _)| std::cmp::Reverse(level));
    if all.windows(2).any(|pair| pair[0].0 == pair[1].0 && pair[0].1.wants() != pair[1].1.wants()) {
        return false;
    }
    all.dedup_by_key(|&mut (level, _)| level);
    for (_, kind) in all {
        *kind = match sense {
            Sense::Forward => *kind,
            Sense::Backward => kind.reversed(),
            Sense::Test => kind.tested(),
        };
    }
    true
}

/// The literals of contact at a transition because of one full output, in descending order; None where it cannot be.
pub fn contact_literals(transition: &Transition, output: u32, level_of: &[u32]) -> Option<Vec<(u32, Kind)>> {
    let mut all: Vec<(u32, Kind)> = Vec::new();
    let full = transition.inputs.iter().chain(&transition.permissive).chain(std::iter::once(&output));
    all.extend(full.map(|&place| (level_of[place as usize], Kind::Full)));
    all.extend(transition.inhibitive.iter().map(|&place| (level_of[place as usize], Kind::Empty)));
    all.sort_by_key(|&(level, _)| std::cmp::Reverse(level));
    all.dedup();
    all.windows(2).all(|pair| pair[0].0 != pair[1].0).then_some(all)
}

/// Events by the level of their highest literal.
#[derive(Debug)]
pub struct Table {
    offsets: Vec<u32>,
    heads: Vec<Suffix>,
    wakeful: Wakeful,
    /// How many events have no literals: they fire in every marking and change none.
    pub idle: u32,
}

impl Table {
    /// The table of these events over levels 1 to `levels`; transitions of the same effect are as many events.
    pub fn new(suffixes: &Suffixes, mut events: Vec<Suffix>, levels: u32) -> Self {
        let idle = events.iter().filter(|&&event| event == DONE).count() as u32;
        events.retain(|&event| event != DONE);
        // Of the same level, those that reach less far down first: they are cheap and enlarge what the others see.
        events.sort_by_key(|&event| (suffixes.get(event).level, std::cmp::Reverse(suffixes.get(event).next), event));
        let mut offsets = vec![0; levels as usize + 2];
        let mut needs = vec![u32::MAX; levels as usize + 1];
        for &event in &events {
            let literal = suffixes.get(event);
            offsets[literal.level as usize + 1] += 1;
            if !literal.kind.wants() {
                let least = &mut needs[literal.level as usize];
                *least = literal.needs.min(*least);
            }
        }
        for level in 1..offsets.len() {
            offsets[level] += offsets[level - 1];
        }
        Table { offsets, heads: events, wakeful: Wakeful::new(&needs), idle }
    }

    /// The events whose highest literal is at this level.
    #[inline(always)]
    pub fn at(&self, level: u32) -> &[Suffix] {
        &self.heads[self.offsets[level as usize] as usize..self.offsets[level as usize + 1] as usize]
    }

    /// The lowest level above `from`, up to `to`, with an event that may fire on a node of level `node` below it.
    #[inline]
    pub fn wake(&self, from: u32, to: u32, node: u32) -> Option<u32> {
        if from >= to { None } else { self.wakeful.first(from as usize + 1, to as usize, node).map(|at| at as u32) }
    }

    /// How many bytes the table takes.
    pub fn bytes(&self) -> usize {
        4 * (self.offsets.capacity() + self.heads.capacity()) + self.wakeful.bytes()
    }
}

/// A tree of minima over the levels, or over blocks of them.
#[derive(Debug)]
pub(super) struct Wakeful {
    size: usize,
    minima: Vec<u32>,
}

impl Wakeful {
    pub(super) fn new(values: &[u32]) -> Self {
        let size = values.len().next_power_of_two();
        let mut minima = vec![u32::MAX; 2 * size];
        minima[size..size + values.len()].copy_from_slice(values);
        for at in (1..size).rev() {
            minima[at] = minima[2 * at].min(minima[2 * at + 1]);
        }
        Wakeful { size, minima }
    }

    /// How many bytes the tree takes.
    pub(super) fn bytes(&self) -> usize {
        4 * self.minima.capacity()
    }

    /// The first index from `from` to `to` whose value is at most `value`.
    #[inline]
    pub(super) fn first(&self, from: usize, to: usize, value: u32) -> Option<usize> {
        let mut at = from + self.size;
        while self.minima[at] > value {
            // The next subtree to the right, which is a root of one as large as can be.
            at += 1;
            if at.is_power_of_two() {
                return None;
            }
            while at.is_multiple_of(2) {
                at /= 2;
            }
            if at << (self.size.ilog2() - at.ilog2()) > to + self.size {
                return None;
            }
        }
        while at < self.size {
            at *= 2;
            if self.minima[at] > value {
                at += 1;
            }
        }
        Some(at - self.size).filter(|&found| found <= to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tree_of_minima_finds_the_first() {
        let values = [5, 3, u32::MAX, 0, 3, 9, 1];
        let tree = Wakeful::new(&values);
        for from in 0..values.len() {
            for to in from..values.len() {
                for value in 0..10 {
                    let expected = (from..=to).find(|&at| values[at] <= value);
                    assert_eq!(tree.first(from, to, value), expected, "{from} {to} {value}");
                }
            }
        }
    }

    #[test]
    fn a_self_loop_and_a_contradicting_gate_are_no_event() {
        let levels = [1, 2];
        let event = |i: &[u32], o: &[u32], p: &[u32], h: &[u32]| {
            literals(&Transition::new(i, o, p, h, &[]), &levels, Sense::Forward)
        };
        assert_eq!(event(&[0], &[0], &[], &[]), None);
        assert_eq!(event(&[], &[], &[0], &[0]), None);
        assert_eq!(event(&[0], &[], &[], &[0]), None);
        assert_eq!(event(&[], &[1], &[1], &[]), None);
        assert_eq!(event(&[0], &[1], &[0], &[1]), Some(vec![(2, Kind::Put), (1, Kind::Take)]));
        let open = Transition::new(&[], &[], &[], &[], &[(0, true), (0, false)]);
        assert_eq!(literals(&open, &levels, Sense::Forward), None);
    }
}
