//! What can enable and disable what: for each literal its needers and its makers, for each transition its conditions.
//!
//! A literal is a number, `2 * place + 1` for full and `2 * place` for empty, so that negation flips the last bit.
//! Also here: which transitions are firable at one marking. One of the places that a transition needs full watches it,
//! and only the transitions watched from places that hold a token are looked at; a batch of 64 markings, as the explicit
//! engine takes, is not to be had where each marking is left by a set of its own.

use crate::marking::holds;
use crate::net::{Net, Transition, meet};

/// A place and a value: `2 * place + 1` is full, `2 * place` empty.
pub type Literal = u32;

/// The literal of a place and a value.
pub fn literal(place: u32, full: bool) -> Literal {
    2 * place + u32::from(full)
}

/// The same place with the other value.
pub fn negation(of: Literal) -> Literal {
    of ^ 1
}

/// Whether a marking makes a literal true.
#[inline(always)]
pub fn is_true(of: Literal, marking: &[u64]) -> bool {
    holds(marking, of >> 1) == (of & 1 == 1)
}

/// Lists of numbers end to end.
#[derive(Clone, Debug, Default)]
pub struct Lists {
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Lists {
    /// `count` lists of (list, item) pairs, in the order of the pairs within each list.
    pub fn new(count: usize, pairs: &[(u32, u32)]) -> Self {
        let mut starts = vec![0; count + 1];
        for &(list, _) in pairs {
            starts[list as usize + 1] += 1;
        }
        for i in 0..count {
            starts[i + 1] += starts[i];
        }
        let mut ends = starts.clone();
        let mut items = vec![0; pairs.len()];
        for &(list, item) in pairs {
            let end = &mut ends[list as usize];
            items[*end as usize] = item;
            *end += 1;
        }
        Lists { starts, items }
    }

    /// One list.
    #[inline(always)]
    pub fn of(&self, list: u32) -> &[u32] {
        &self.items[self.starts[list as usize] as usize..self.starts[list as usize + 1] as usize]
    }

    fn bytes(&self) -> usize {
        4 * (self.starts.capacity() + self.items.capacity())
    }
}

/// The dependencies of a net; transitions that never fire need and make nothing.
#[derive(Clone, Debug)]
pub struct Dependencies {
    /// For each transition the literals it needs; those that its firing makes false come first.
    conditions: Lists,
    flips: Vec<u32>,
    /// For each literal the transitions that need it.
    pub needers: Lists,
    /// For each literal the transitions that make it true.
    pub makers: Lists,
    /// For each place the transitions that it watches.
    watched: Lists,
    /// The transitions that need no place full.
    unwatched: Vec<u32>,
    /// For each transition whether it could fire at all.
    able: Vec<bool>,
}

impl Dependencies {
    /// Reads the dependencies off a net.
    pub fn new(net: &Net) -> Self {
        let able: Vec<bool> = net.transitions.iter().map(may_ever_fire).collect();
        let (mut conditions, mut needers, mut makers, mut watched) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (mut flips, mut unwatched) = (Vec::new(), Vec::new());
        let mut load = vec![0u32; net.places];
        for (t, transition) in net.transitions.iter().enumerate() {
            let Transition { inputs, outputs, permissive, inhibitive, .. } = transition;
            let t = t as u32;
            flips.push((inputs.len() + outputs.len()) as u32);
            let full = inputs.iter().chain(permissive);
            let changed = inputs.iter().map(|&p| literal(p, true)).chain(outputs.iter().map(|&p| literal(p, false)));
            let read =
                permissive.iter().map(|&p| literal(p, true)).chain(inhibitive.iter().map(|&p| literal(p, false)));
            let first = conditions.len();
            for l in changed {
                conditions.push((t, l));
                if able[t as usize] {
                    makers.push((negation(l), t));
                }
            }
            let read: Vec<u32> = read.filter(|&l| conditions[first..].iter().all(|&(_, other)| other != l)).collect();
            conditions.extend(read.iter().map(|&l| (t, l)));
            if !able[t as usize] {
                continue;
            }
            needers.extend(conditions[first..].iter().map(|&(t, l)| (l, t)));
            match full.min_by_key(|&&p| load[p as usize]) {
                Some(&p) => {
                    load[p as usize] += 1;
                    watched.push((p, t));
                }
                None => unwatched.push(t),
            }
        }
        let count = net.transitions.len();
        Dependencies {
            conditions: Lists::new(count, &conditions),
            flips,
            needers: Lists::new(2 * net.places, &needers),
            makers: Lists::new(2 * net.places, &makers),
            watched: Lists::new(net.places, &watched),
            unwatched,
            able,
        }
    }

    /// The literals that a transition needs.
    #[inline(always)]
    pub fn conditions(&self, t: u32) -> &[Literal] {
        self.conditions.of(t)
    }

    /// The conditions that its firing makes false.
    #[inline(always)]
    pub fn flipped(&self, t: u32) -> &[Literal] {
        &self.conditions.of(t)[..self.flips[t as usize] as usize]
    }

    /// Whether a transition could fire at some marking, reachable or not.
    pub fn able(&self, t: u32) -> bool {
        self.able[t as usize]
    }

    /// Whether a transition is firable and openable at a marking.
    #[inline(always)]
    pub fn firable(&self, t: u32, marking: &[u64]) -> bool {
        self.able[t as usize] && self.conditions(t).iter().all(|&l| is_true(l, marking))
    }

    /// The transitions that are firable and openable at a marking, ascending.
    pub fn all_firable(&self, marking: &[u64], into: &mut Vec<u32>) {
        into.clear();
        for (k, &word) in marking.iter().enumerate() {
            let mut rest = word;
            while rest != 0 {
                let place = 64 * k as u32 + rest.trailing_zeros();
                rest &= rest - 1;
                into.extend(self.watched.of(place).iter().filter(|&&t| self.firable(t, marking)));
            }
        }
        into.extend(self.unwatched.iter().filter(|&&t| self.firable(t, marking)));
        into.sort_unstable();
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let lists = [&self.conditions, &self.needers, &self.makers, &self.watched];
        lists.iter().map(|lists| lists.bytes()).sum::<usize>()
            + 4 * (self.flips.capacity() + self.unwatched.capacity())
            + self.able.capacity()
    }
}

/// Whether the conditions of a transition contradict neither each other nor its literals.
fn may_ever_fire(transition: &Transition) -> bool {
    let Transition { inputs, outputs, permissive, inhibitive, .. } = transition;
    let contradiction = [inputs, permissive].iter().any(|full| meet(full, outputs) || meet(full, inhibitive));
    transition.openable() && !contradiction
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_keep_the_order_of_their_pairs() {
        let lists = Lists::new(3, &[(2, 7), (0, 5), (2, 6), (2, 7)]);
        assert_eq!((lists.of(0), lists.of(1), lists.of(2)), (&[5][..], &[][..], &[7, 6, 7][..]));
    }

    #[test]
    fn who_contradicts_itself_needs_and_makes_nothing() {
        let never = [
            Transition::new(&[0], &[0], &[], &[], &[]),
            Transition::new(&[0], &[1], &[], &[0], &[]),
            Transition::new(&[0], &[1], &[1], &[], &[]),
            Transition::new(&[], &[], &[1], &[1], &[]),
            Transition::new(&[0], &[1], &[], &[], &[(0, true), (0, false)]),
        ];
        let net = Net::new(2, never.to_vec(), &[0]).expect("well formed");
        let all = Dependencies::new(&net);
        for l in 0..4 {
            assert!(all.needers.of(l).is_empty() && all.makers.of(l).is_empty());
        }
        let mut firable = Vec::new();
        for marking in 0..4 {
            all.all_firable(&[marking], &mut firable);
            assert!(firable.is_empty());
        }
    }

    #[test]
    fn conditions_begin_with_those_that_firing_makes_false() {
        let t = Transition::new(&[0], &[2], &[0, 1], &[2, 3], &[]);
        let net = Net::new(4, vec![t], &[0, 1]).expect("well formed");
        let all = Dependencies::new(&net);
        assert_eq!(all.conditions(0), [literal(0, true), literal(2, false), literal(1, true), literal(3, false)]);
        assert_eq!(all.flipped(0), [literal(0, true), literal(2, false)]);
        assert_eq!((all.makers.of(literal(0, false)), all.makers.of(literal(2, true))), (&[0][..], &[0][..]));
        assert!(all.firable(0, &[0b0011]) && !all.firable(0, &[0b0111]));
    }
}
