//! Which places may be marked together, by the arcs alone.
//!
//! Two places are *concurrent* where both are marked in M0, or where a transition whose inputs and permissive gates are
//! concurrent to each other marks one of them, and marks the other one, too, or leaves it marked, as it may leave what is
//! concurrent to all that it needs and none of its inhibitive gates. The least relation of that kind has all pairs that a
//! reachable marking has; it is found in whole rows of bits, where the exact one would take the state space itself. That
//! firings wait for contact is left out: it only keeps them away.
//!
//! It does for literals as well, a place with a value: of a firing that needs some and makes others the inputs are those
//! that it makes false, and the gates those that it leaves. Which pairs of them are true together is more than which places
//! are marked together, as it knows contact and both kinds of gates (Haslum and Geffner 2000, "Admissible heuristics for
//! optimal planning": h²). What is known already of a part of the relation bounds what may be found.
//!
//! Source: the structural concurrency relation (Kovalyov 1992, "Concurrency relations and the safety problem for Petri
//! nets"), with gates, and by a worklist.

use std::collections::VecDeque;

use crate::budget::{Stop, Watch};
use crate::marking::{holds, put, words_for};
use crate::net::Transition;

/// Nets with more places are left alone: the relation is a square, then of 8 MiB.
const PLACES_MAX: usize = 1 << 13;
/// The words, pairs and transitions that are looked at, at most: some tenths of a second.
const WORDS_MAX: usize = 1 << 28;

/// A symmetric relation of places, a row of bits each.
#[derive(Debug)]
pub struct Concurrency {
    words: usize,
    rows: Vec<u64>,
    /// The places that may be marked at all.
    marked: Vec<u64>,
    /// The rows that all is known to be in, each with its own place if that may be marked.
    bound: Option<Vec<u64>>,
}

impl Concurrency {
    /// The relation of a net, or None where it would take too long.
    pub fn of(
        places: usize,
        transitions: &[Transition],
        initial: &[u32],
        watch: &mut Watch<'_>,
    ) -> Result<Option<Self>, Stop> {
        if places > PLACES_MAX {
            return Ok(None);
        }
        Self::within(WORDS_MAX, places, transitions, initial, None, watch)
    }

    /// The same of any net, looking at so many words at most, where `bound` has, for each place, the row of those that
    /// may be marked with it, itself among them.
    pub fn within(
        words_max: usize,
        places: usize,
        transitions: &[Transition],
        initial: &[u32],
        bound: Option<Vec<u64>>,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Self>, Stop> {
        let mut agenda = Agenda::new(places, transitions);
        let mut relation = Concurrency { bound, ..Concurrency::at_first(places, initial) };
        let (mut behind, mut looked) = (vec![0; relation.words], 0);
        while let Some(t) = agenda.pop() {
            let transition = &transitions[t as usize];
            let needs = needed(transition).count();
            let cost = needs * needs + relation.words * (needs + transition.outputs.len() + 1);
            looked += cost;
            if looked > words_max {
                return Ok(None);
            }
            watch.tick(cost)?;
            if !relation.may_fire(transition) {
                continue;
            }
            relation.behind(transition, &mut behind);
            for &place in &transition.outputs {
                let new = relation.mark(place, &behind, &mut agenda);
                looked += new;
                watch.tick(new)?;
            }
            looked += agenda.wake_touched(watch)?;
        }
        Ok(Some(relation))
    }

    /// The places of M0.
    fn at_first(places: usize, initial: &[u32]) -> Self {
        let words = words_for(places);
        let mut marked = vec![0; words];
        initial.iter().for_each(|&place| put(&mut marked, place));
        let mut rows = vec![0; places * words];
        for &place in initial {
            let row = &mut rows[place as usize * words..][..words];
            row.copy_from_slice(&marked);
            clear(row, place);
        }
        Concurrency { words, rows, marked, bound: None }
    }

    /// Whether two places may be marked together; a place is not concurrent to itself.
    pub fn has(&self, one: u32, other: u32) -> bool {
        holds(self.row(one), other)
    }

    /// Gives a place the row of another one besides its own.
    pub fn join(&mut self, place: u32, other: u32) {
        for at in 0..self.words {
            self.rows[place as usize * self.words + at] |= self.rows[other as usize * self.words + at];
        }
    }

    /// The rows end to end, with each place that may be marked in its own.
    pub fn into_rows(mut self) -> Vec<u64> {
        for place in 0..(self.rows.len() / self.words) as u32 {
            if holds(&self.marked, place) {
                self.relate(place, place);
            }
        }
        self.rows
    }

    /// Those of a word of other places that may be found beside a place.
    fn allowed(&self, place: u32, at: usize) -> u64 {
        self.bound.as_ref().map_or(!0, |rows| rows[place as usize * self.words + at])
    }

    fn row(&self, place: u32) -> &[u64] {
        &self.rows[place as usize * self.words..][..self.words]
    }

    fn relate(&mut self, one: u32, other: u32) {
        for (place, beside) in [(one, other), (other, one)] {
            put(&mut self.rows[place as usize * self.words..][..self.words], beside);
        }
    }

    /// Whether all that a transition needs may be marked, and together.
    fn may_fire(&self, transition: &Transition) -> bool {
        needed(transition).enumerate().all(|(at, place)| {
            holds(&self.marked, place)
                && needed(transition).take(at).all(|other| other == place || self.has(place, other))
        })
    }

    /// What may be marked behind a firing: the outputs, and what may be beside all that was needed and is not taken.
    fn behind(&self, transition: &Transition, behind: &mut [u64]) {
        behind.copy_from_slice(&self.marked);
        for place in needed(transition) {
            behind.iter_mut().zip(self.row(place)).for_each(|(all, own)| *all &= own);
        }
        transition.permissive.iter().for_each(|&place| put(behind, place));
        transition.inhibitive.iter().chain(&transition.inputs).for_each(|&place| clear(behind, place));
        transition.outputs.iter().for_each(|&place| put(behind, place));
    }

    /// Takes a place as marked beside these others; how many of them it was not known to be beside.
    fn mark(&mut self, place: u32, others: &[u64], agenda: &mut Agenda) -> usize {
        let mut found = 0;
        if self.allowed(place, place as usize / 64) >> (place % 64) & 1 == 0 {
            return 0;
        }
        if !holds(&self.marked, place) {
            put(&mut self.marked, place);
            agenda.touch(place);
            agenda.touch_nothing();
        }
        for (at, others) in others.iter().enumerate() {
            let mut new = others & !self.row(place)[at] & self.allowed(place, at);
            while new != 0 {
                let other = 64 * at as u32 + new.trailing_zeros();
                new &= new - 1;
                if other != place {
                    self.relate(place, other);
                    agenda.touch(other);
                    found += 1;
                }
            }
        }
        if found > 0 {
            agenda.touch(place);
        }
        found
    }
}

/// The transitions that are to be looked at, each once, in the order in which there was reason to.
struct Agenda {
    /// The transitions that need a place, and last those that need none.
    of: Vec<Vec<u32>>,
    waits: Vec<bool>,
    todo: VecDeque<u32>,
    /// The places of which something was found, each once, and whether it is one of them.
    touched: Vec<u32>,
    is_touched: Vec<bool>,
}

impl Agenda {
    fn new(places: usize, transitions: &[Transition]) -> Self {
        let mut of: Vec<Vec<u32>> = vec![Vec::new(); places + 1];
        for (t, transition) in (0..).zip(transitions) {
            needed(transition).for_each(|place| of[place as usize].push(t));
            if needed(transition).next().is_none() {
                of[places].push(t);
            }
        }
        let todo = (0..transitions.len() as u32).collect();
        let is_touched = vec![false; of.len()];
        Agenda { of, waits: vec![true; transitions.len()], todo, touched: Vec::new(), is_touched }
    }

    fn pop(&mut self) -> Option<u32> {
        let first = self.todo.pop_front()?;
        self.waits[first as usize] = false;
        Some(first)
    }

    /// Something was found of a place.
    fn touch(&mut self, place: u32) {
        if !std::mem::replace(&mut self.is_touched[place as usize], true) {
            self.touched.push(place);
        }
    }

    /// The transitions that need nothing have something new beside them.
    fn touch_nothing(&mut self) {
        self.touch(self.of.len() as u32 - 1);
    }

    /// Has the transitions looked at again that need a place of which something was found; how many there are.
    fn wake_touched(&mut self, watch: &mut Watch<'_>) -> Result<usize, Stop> {
        let mut all = 0;
        for place in self.touched.drain(..) {
            self.is_touched[place as usize] = false;
            let of = &self.of[place as usize];
            watch.tick(of.len() + 1)?;
            all += of.len() + 1;
            for &t in of {
                if !std::mem::replace(&mut self.waits[t as usize], true) {
                    self.todo.push_back(t);
                }
            }
        }
        Ok(all)
    }
}

fn clear(row: &mut [u64], place: u32) {
    row[place as usize / 64] &= !(1 << (place % 64));
}

/// The places that have to be marked for a transition to fire.
fn needed(transition: &Transition) -> impl Iterator<Item = u32> + '_ {
    transition.inputs.iter().chain(&transition.permissive).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::samples::{explore, machines, random_nets};

    fn relation(places: usize, transitions: &[Transition], initial: &[u32]) -> Concurrency {
        let mut poll = unwatched;
        let found = Concurrency::of(places, transitions, initial, &mut Watch::new(None, &mut poll));
        found.expect("no budget").expect("a small net")
    }

    fn pairs(relation: &Concurrency) -> Vec<(u32, u32)> {
        let places = relation.rows.len() / relation.words;
        let all = |one| (0..=one).map(move |other| (other, one));
        (0..places as u32).flat_map(all).filter(|&(one, other)| relation.has(one, other)).collect()
    }

    #[test]
    fn all_pairs_that_are_marked_together_somewhere_are_concurrent() {
        let (mut marked, mut found) = (0, 0);
        for net in random_nets(400) {
            let (places, transitions) = (net.places, net.transitions.clone());
            let space = explore(net, false);
            let full = |marking: &[u64]| (0..places as u32).filter(|&p| holds(marking, p)).collect::<Vec<u32>>();
            let initial = full(space.marking(0));
            let relation = relation(places, &transitions, &initial);
            let mut together = std::collections::BTreeSet::new();
            for index in 0..space.len() {
                let of = full(space.marking(index));
                for (at, &one) in of.iter().enumerate() {
                    together.extend(of[..at].iter().map(|&other| (other, one)));
                }
            }
            assert!(together.iter().all(|&(one, other)| relation.has(one, other) && relation.has(other, one)));
            (marked, found) = (marked + together.len(), found + pairs(&relation).len());
        }
        assert!(marked < found && 2 * found < 3 * marked, "{marked} of {found}");
    }

    #[test]
    fn places_of_one_machine_are_not_concurrent_and_those_of_two_are() {
        let net = machines(2, 0);
        assert_eq!(pairs(&relation(4, &net.transitions, &[0, 2])), [(0, 2), (1, 2), (0, 3), (1, 3)]);
    }

    #[test]
    fn what_two_tokens_meet_for_is_concurrent_to_neither_that_they_left() {
        // Two tokens meet on 4, and part again.
        let transitions = [
            Transition::new(&[0], &[1], &[], &[], &[]),
            Transition::new(&[1, 2], &[4], &[], &[], &[]),
            Transition::new(&[4], &[0, 3], &[], &[], &[]),
            Transition::new(&[3], &[2], &[], &[], &[]),
        ];
        assert_eq!(pairs(&relation(5, &transitions, &[0, 2])), [(0, 2), (1, 2), (0, 3), (1, 3)]);
    }

    #[test]
    fn a_token_that_is_alone_goes_on_too() {
        let transitions = [Transition::new(&[1], &[2, 3], &[], &[], &[]), Transition::new(&[0], &[1], &[], &[], &[])];
        assert_eq!(pairs(&relation(4, &transitions, &[0])), [(2, 3)]);
    }

    #[test]
    fn a_gate_keeps_what_it_waits_for_apart() {
        // The token on 0 goes to 1 where 2 is marked, or where it is not; another one goes from 2 to 3 and stays.
        let away = Transition::new(&[2], &[3], &[], &[], &[]);
        for (permissive, inhibitive, wanted) in [
            (vec![2], vec![], vec![(0, 2), (1, 2), (0, 3), (1, 3)]),
            (vec![], vec![2], vec![(0, 2), (0, 3), (1, 3)]),
            (vec![4], vec![], vec![(0, 2), (0, 3)]),
        ] {
            let moves = Transition::new(&[0], &[1], &permissive, &inhibitive, &[]);
            assert_eq!(pairs(&relation(5, &[moves, away.clone()], &[0, 2])), wanted);
        }
    }

    #[test]
    fn what_is_bounded_is_found_within_and_what_follows_from_it() {
        // A token goes from 0 over 1 to 2, beside one on 3, of which it is known that it is not there with 1.
        let steps = [Transition::new(&[0], &[1], &[], &[], &[]), Transition::new(&[1], &[2], &[], &[], &[])];
        let all = vec![0b1111; 4];
        for (bound, wanted) in [
            (None, vec![(0, 3), (1, 3), (2, 3)]),
            (Some(all), vec![(0, 3), (1, 3), (2, 3)]),
            (Some(vec![0b1111, 0b0111, 0b1111, 0b1101]), vec![(0, 3)]),
            (Some(vec![0b1111, 0b0000, 0b1111, 0b1111]), vec![(0, 3)]),
        ] {
            let mut poll = unwatched;
            let watch = &mut Watch::new(None, &mut poll);
            let found = Concurrency::within(usize::MAX, 4, &steps, &[0, 3], bound, watch);
            let found = found.expect("no budget").expect("no limit");
            assert_eq!(pairs(&found), wanted);
            assert!(found.into_rows()[3] >> 3 & 1 == 1);
        }
    }

    #[test]
    fn a_relation_that_is_too_large_is_left_alone_and_the_watch_ends_it() {
        let mut poll = |_| Err(Stop::Cancelled);
        let net = machines(100, 0);
        let initial: Vec<u32> = (0..200).step_by(2).collect();
        let watch = &mut Watch::often(None, &mut poll);
        assert_eq!(Concurrency::of(200, &net.transitions, &initial, watch).map(|_| ()), Err(Stop::Cancelled));
        assert!(Concurrency::of(PLACES_MAX + 1, &[], &[], watch).is_ok_and(|found| found.is_none()));
        let mut poll = unwatched;
        let watch = &mut Watch::new(None, &mut poll);
        // Each of 200 transitions is looked at: one pair, and rows of 4 words for what it needs, puts, and leaves.
        for (words, is_found) in [(WORDS_MAX, true), (200 * (1 + 3 * 4) - 1, false)] {
            let found = Concurrency::within(words, 200, &net.transitions, &initial, None, watch);
            assert!(found.is_ok_and(|found| found.is_some() == is_found), "{words}");
        }
    }
}
