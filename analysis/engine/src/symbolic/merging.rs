//! Places merged for the search: a smaller net, of which each marking stands for markings of the net itself.
//!
//! A token that may go from p to q by itself, at any time, makes two markings of each that has it. Where nothing else
//! sees on which of them it is, one place a does for both in the search, and what each marking with a token on a stands
//! for is put into the diagram afterwards (`Stands`). Three rules, until none applies:
//!
//! - *Rings.* Moves with one input and one output that lead from each of some places to each other: the token may be
//!   anywhere on them, whatever else is marked.
//! - *Chains.* All that puts a token on q, empty in M0, are moves from p that do nothing else. So a token comes to q over p
//!   alone: where it is on q it might as well be on p still, and where it is on p it may go to q.
//! - *Copies.* The same moves fill p and q, the same ones empty them, and both are marked in M0 or neither: they are
//!   always alike, and one does for the other.
//!
//! No gate reads the places of a ring or chain, and no transition takes or puts two tokens there; which of two copies is
//! read does not matter. Nothing is said of room on the outputs, so the smallest net must come out free of *contact*.
//!
//! Why that is enough, of one merging, and so of all, from the last to the first: the smaller net does what the net does,
//! without the moves inside of a. If it is free of contact, no two tokens ever come together on a place of it, nor on
//! those that a stands for, and the net is free of contact, too. Then both go by the ordinary rule, and each firing of
//! the smaller net can be made in the net, once the token is on that place of a from which it is taken. So the net
//! reaches exactly what the markings of the smaller one stand for.
//!
//! Source: reduction equations (Berthomieu, Le Botlan, Dal Zilio 2018, "Petri net reductions for counting markings"), by
//! which they count; here they bring the markings back, for all questions. Their agglomerations of more than one token
//! come to nothing where places hold one. Rejected: the rules of `analysis/reduction`, which keep the answer to one
//! question and not the markings.

use std::borrow::Cow;
use std::collections::HashSet;

use super::standing::Stands;
use crate::budget::{Stop, Watch};
use crate::net::{Transition, meet};

/// How often all rules are looked at; what they leave after as many is good enough.
const ROUNDS: usize = 40;
/// No place.
const NONE: u32 = u32::MAX;

/// The smaller net.
#[derive(Debug)]
pub(super) struct Merged {
    pub(super) transitions: Vec<Transition>,
    pub(super) initial: Vec<u32>,
    /// What each of its places stands for.
    pub(super) stands: Vec<Stands>,
}

/// The net with places merged, or None where there is nothing to merge.
pub(super) fn merged(
    places: usize,
    transitions: &[Transition],
    initial: &[u32],
    watch: &mut Watch<'_>,
) -> Result<Option<Merged>, Stop> {
    if transitions.iter().any(|each| meet(&each.inputs, &each.outputs)) {
        return Ok(None); // of a transition that needs room where it takes a token nothing is said here
    }
    let mut draft = Draft::new(places, transitions, initial);
    let mut changed = true;
    for _ in 0..ROUNDS {
        if !std::mem::take(&mut changed) {
            break;
        }
        for rule in [Draft::rings, Draft::chains, Draft::copies] {
            watch.tick(places + draft.moves.iter().map(size).sum::<usize>())?;
            changed |= rule(&mut draft);
        }
    }
    Ok((draft.left() < places).then(|| draft.net()))
}

fn size(transition: &Transition) -> usize {
    transition.inputs.len() + transition.outputs.len() + transition.permissive.len() + transition.inhibitive.len()
}

/// The net while it becomes smaller. The places keep their numbers, and those that are gone stand for nothing.
struct Draft<'a> {
    /// The transitions that may fire, as they came until something is merged.
    moves: Cow<'a, [Transition]>,
    stands: Vec<Option<Stands>>,
    marked: Vec<bool>,
}

/// From where to where a transition takes a token that does nothing else.
fn alone(transition: &Transition) -> Option<(u32, u32)> {
    match (&transition.inputs[..], &transition.outputs[..]) {
        (&[from], &[to]) if from != to && transition.permissive.is_empty() && transition.inhibitive.is_empty() => {
            Some((from, to))
        }
        _ => None,
    }
}

impl<'a> Draft<'a> {
    fn new(places: usize, transitions: &'a [Transition], initial: &[u32]) -> Self {
        let mut marked = vec![false; places];
        initial.iter().for_each(|&place| marked[place as usize] = true);
        let moves = if transitions.iter().all(Transition::openable) {
            Cow::Borrowed(transitions)
        } else {
            transitions.iter().filter(|each| each.openable()).cloned().collect()
        };
        let stands = (0..places as u32).map(|place| Some(Stands::Place(place))).collect();
        Draft { moves, stands, marked }
    }

    fn places(&self) -> usize {
        self.stands.len()
    }

    fn left(&self) -> usize {
        self.stands.iter().flatten().count()
    }

    /// The places that a gate reads.
    fn seen(&self) -> Vec<bool> {
        let mut seen = vec![false; self.places()];
        for transition in self.moves.iter() {
            for &place in transition.permissive.iter().chain(&transition.inhibitive) {
                seen[place as usize] = true;
            }
        }
        seen
    }

    /// Puts places into others, as one of them or all together; `to` says for each place which one does for it.
    fn put(&mut self, to: &[u32], gather: fn(Vec<Stands>) -> Stands) -> bool {
        let mut moved: Vec<u32> = (0..).zip(to).filter(|&(place, &to)| place != to).map(|(place, _)| place).collect();
        moved.sort_by_key(|&place| to[place as usize]);
        for others in moved.chunk_by(|&one, &other| to[one as usize] == to[other as usize]) {
            let place = to[others[0] as usize] as usize;
            let all = std::iter::once(place).chain(others.iter().map(|&other| other as usize));
            self.marked[place] = all.clone().any(|each| self.marked[each]);
            self.stands[place] = Some(gather(all.filter_map(|each| self.stands[each].take()).collect()));
        }
        if moved.is_empty() {
            return false;
        }
        for each in self.moves.to_mut() {
            for side in [&mut each.inputs, &mut each.outputs, &mut each.permissive, &mut each.inhibitive] {
                if side.iter().any(|&place| to[place as usize] != place) {
                    side.iter_mut().for_each(|place| *place = to[*place as usize]);
                    side.sort_unstable();
                    side.dedup();
                }
            }
            // A token that is taken from one of the merged places and put on another stays where it is.
            let stays: Vec<u32> =
                each.inputs.iter().copied().filter(|place| each.outputs.binary_search(place).is_ok()).collect();
            if !stays.is_empty() {
                each.inputs.retain(|place| stays.binary_search(place).is_err());
                each.outputs.retain(|place| stays.binary_search(place).is_err());
                each.permissive.extend(stays);
                each.permissive.sort_unstable();
                each.permissive.dedup();
            }
        }
        // What changes nothing is left out, and what another one does as well.
        let mut known = HashSet::new();
        let kept: Vec<bool> = { self.moves.iter() }
            .map(|each| {
                let does = [&each.inputs, &each.outputs, &each.permissive, &each.inhibitive];
                !(each.inputs.is_empty() && each.outputs.is_empty()) && known.insert(does)
            })
            .collect();
        let mut kept = kept.into_iter();
        self.moves.to_mut().retain(|_| kept.next() == Some(true));
        true
    }

    /// Takes those apart that some transition takes or puts tokens on together: of these one does not do for the other.
    fn part(&self, to: &mut [u32]) {
        if (0..).zip(to.iter()).all(|(place, &to)| place == to) {
            return;
        }
        let mut at: Vec<u32> = vec![NONE; self.places()];
        let mut split = HashSet::new();
        for each in self.moves.iter() {
            for side in [&each.inputs, &each.outputs] {
                for &place in side {
                    let into = to[place as usize];
                    if std::mem::replace(&mut at[into as usize], place) != NONE {
                        split.insert(into);
                    }
                }
                side.iter().for_each(|&place| at[to[place as usize] as usize] = NONE);
            }
        }
        for (place, to) in to.iter_mut().enumerate().filter(|(_, to)| split.contains(to)) {
            *to = place as u32;
        }
    }

    fn rings(&mut self) -> bool {
        let seen = self.seen();
        let moves = self.moves.iter().filter_map(alone);
        let steps: Vec<(u32, u32)> = moves.filter(|&(p, q)| !seen[p as usize] && !seen[q as usize]).collect();
        if steps.is_empty() {
            return false;
        }
        let mut to = rings_of(self.places(), &steps);
        let mut tokens = vec![0_u32; self.places()];
        (0..self.places()).filter(|&place| self.marked[place]).for_each(|place| tokens[to[place] as usize] += 1);
        for (place, to) in to.iter_mut().enumerate().filter(|(_, to)| tokens[**to as usize] > 1) {
            *to = place as u32;
        }
        self.part(&mut to);
        self.put(&to, one_of)
    }

    fn chains(&mut self) -> bool {
        let seen = self.seen();
        let mut to: Vec<u32> = (0..self.places() as u32).collect();
        let mut fixed = seen.clone();
        for each in self.moves.iter() {
            let from = alone(each).map(|(from, _)| from).filter(|&from| !seen[from as usize]);
            for &place in &each.outputs {
                match from {
                    Some(from) if !fixed[place as usize] && [place, from].contains(&to[place as usize]) => {
                        to[place as usize] = from;
                    }
                    _ => {
                        fixed[place as usize] = true;
                        to[place as usize] = place;
                    }
                }
            }
        }
        (0..).zip(&mut to).filter(|&(place, _)| self.marked[place as usize]).for_each(|(place, to)| *to = place);
        let mut to = ends_of(&to);
        self.part(&mut to);
        self.put(&to, one_of)
    }

    fn copies(&mut self) -> bool {
        // A number that places have in common if they have the same moves and are marked, its lowest bit, or are not. Of
        // those that have it in common, the moves are compared.
        let mut sums: Vec<u64> = self.marked.iter().map(|&marked| u64::from(marked)).collect();
        for (t, each) in self.moves.iter().enumerate() {
            for (side, kind) in [(&each.inputs, 2), (&each.outputs, 3)] {
                let number = (t as u64 * 4 + kind).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
                let number = number.wrapping_mul(0xd6e8_feb8_6659_fd93) & !1;
                side.iter().for_each(|&place| sums[place as usize] = sums[place as usize].wrapping_add(number));
            }
        }
        let mut all: Vec<u32> = (0..self.places() as u32).filter(|&place| sums[place as usize] > 1).collect();
        all.sort_unstable_by_key(|&place| (sums[place as usize], place));
        let groups = all.chunk_by(|&one, &other| sums[one as usize] == sums[other as usize]);
        let groups: Vec<&[u32]> = groups.filter(|group| group.len() > 1).collect();
        if groups.is_empty() {
            return false;
        }
        let mut around: Vec<Vec<(bool, u32)>> = vec![Vec::new(); self.places()];
        let mut is_grouped = vec![false; self.places()];
        groups.iter().copied().flatten().for_each(|&place| is_grouped[place as usize] = true);
        for (t, each) in self.moves.iter().enumerate() {
            for (side, fills) in [(&each.inputs, false), (&each.outputs, true)] {
                let its = side.iter().filter(|&&place| is_grouped[place as usize]);
                its.for_each(|&place| around[place as usize].push((fills, t as u32)));
            }
        }
        let mut to: Vec<u32> = (0..self.places() as u32).collect();
        for group in groups {
            let first = group[0] as usize;
            let like = |&&place: &&u32| around[place as usize] == around[first];
            group.iter().filter(like).for_each(|&place| to[place as usize] = first as u32);
        }
        self.put(&to, Stands::All)
    }

    /// The net of the places that are left, in their order.
    fn net(self) -> Merged {
        let mut number = vec![NONE; self.places()];
        let mut stands = Vec::new();
        for (place, of) in self.stands.into_iter().enumerate() {
            if let Some(of) = of {
                number[place] = stands.len() as u32;
                stands.push(of);
            }
        }
        let renamed = |side: &[u32]| side.iter().map(|&place| number[place as usize]).collect::<Vec<u32>>();
        let transitions = self.moves.iter().map(|each| Transition {
            inputs: renamed(&each.inputs),
            outputs: renamed(&each.outputs),
            permissive: renamed(&each.permissive),
            inhibitive: renamed(&each.inhibitive),
            literals: Vec::new(),
        });
        let initial = (0..number.len()).filter(|&place| self.marked[place] && number[place] != NONE);
        Merged { transitions: transitions.collect(), initial: initial.map(|place| number[place]).collect(), stands }
    }
}

/// Where each place comes to by going on and on; those that go round, on which there is never a token, to one of them.
fn ends_of(to: &[u32]) -> Vec<u32> {
    let mut ends = vec![NONE; to.len()];
    for place in 0..to.len() {
        let (mut way, mut at) = (Vec::new(), place);
        while ends[at] == NONE {
            ends[at] = at as u32;
            way.push(at);
            at = to[at] as usize;
        }
        let end = ends[at];
        way.into_iter().for_each(|each| ends[each] = end);
    }
    ends
}

fn one_of(all: Vec<Stands>) -> Stands {
    let flat = |each| match each {
        Stands::One(all) => all,
        each => vec![each],
    };
    Stands::One(all.into_iter().flat_map(flat).collect())
}

/// The first place of the ring of each place: of those that lead to each other (Tarjan, with a stack of its own).
fn rings_of(places: usize, steps: &[(u32, u32)]) -> Vec<u32> {
    let mut offsets = vec![0_usize; places + 1];
    steps.iter().for_each(|&(from, _)| offsets[from as usize + 1] += 1);
    for at in 0..places {
        offsets[at + 1] += offsets[at];
    }
    let (mut next, mut ends) = (offsets.clone(), vec![0_u32; steps.len()]);
    for &(from, to) in steps {
        ends[next[from as usize]] = to;
        next[from as usize] += 1;
    }
    let mut ring: Vec<u32> = (0..places as u32).collect();
    let (mut found, mut low) = (vec![NONE; places], vec![NONE; places]);
    let (mut open, mut count) = (Vec::new(), 0);
    let mut is_open = vec![false; places];
    for start in (0..places).filter(|&place| offsets[place] < offsets[place + 1]) {
        if found[start] != NONE {
            continue;
        }
        let mut way = vec![(start, offsets[start])];
        while let Some((place, edge)) = way.pop() {
            if found[place] == NONE {
                (found[place], low[place], count) = (count, count, count + 1);
                open.push(place);
                is_open[place] = true;
            }
            if edge < offsets[place + 1] {
                let end = ends[edge] as usize;
                way.push((place, edge + 1));
                if found[end] == NONE {
                    way.push((end, offsets[end]));
                } else if is_open[end] {
                    low[place] = low[place].min(found[end]);
                }
                continue;
            }
            if let Some(&(before, _)) = way.last() {
                low[before] = low[before].min(low[place]);
            }
            if low[place] == found[place] {
                let from = open.iter().rposition(|&each| each == place).unwrap_or(0);
                let all: Vec<usize> = open.drain(from..).collect();
                let first = all.iter().copied().min().unwrap_or(place) as u32;
                for each in all {
                    is_open[each] = false;
                    ring[each] = first;
                }
            }
        }
    }
    ring
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;

    /// A move from some places to others, which are written as letters.
    fn arc(from: &str, to: &str) -> Transition {
        gated(from, to, "")
    }

    fn gated(from: &str, to: &str, read: &str) -> Transition {
        let places = |text: &str| text.bytes().map(|letter| u32::from(letter - b'a')).collect::<Vec<u32>>();
        Transition::new(&places(from), &places(to), &places(read), &[], &[])
    }

    fn told(stands: &Stands) -> String {
        let all = |all: &[Stands]| all.iter().map(told).collect::<Vec<_>>();
        match stands {
            Stands::Place(place) => char::from(b'a' + *place as u8).to_string(),
            Stands::One(each) => format!("({})", all(each).join("|")),
            Stands::All(each) => format!("({})", all(each).join("&")),
        }
    }

    /// What the places that are left stand for, of a net with its token on a, or why nothing was merged.
    fn left(places: usize, transitions: &[Transition]) -> String {
        let mut poll = unwatched;
        let found = merged(places, transitions, &[0], &mut Watch::new(None, &mut poll)).expect("no budget");
        found.map_or("nothing merged".into(), |net| net.stands.iter().map(told).collect::<Vec<_>>().join(" "))
    }

    #[test]
    fn a_token_that_goes_by_itself_is_on_one_of_the_places_and_a_ring_is_one_place() {
        assert_eq!(left(3, &[arc("a", "b"), arc("b", "c")]), "(a|b|c)");
        assert_eq!(left(3, &[arc("a", "b"), arc("b", "a"), arc("b", "c"), arc("c", "a")]), "(a|b|c)");
        // The ring of b and c is one place, d is always like it, and both go on together.
        assert_eq!(left(4, &[arc("a", "bd"), arc("b", "c"), arc("c", "b"), arc("cd", "a")]), "(a|((b|c)&d))");
    }

    #[test]
    fn what_is_always_alike_is_one_place_and_so_is_what_goes_on_side_by_side() {
        let side_by_side = [arc("a", "bc"), arc("b", "d"), arc("c", "e"), arc("de", "f")];
        assert_eq!(left(6, &side_by_side), "(a|((b|d)&(c|e))|f)");
    }

    #[test]
    fn copies_are_marked_both_or_neither_and_whoever_reads_one_reads_the_other() {
        assert_eq!(left(3, &[arc("c", "ab"), arc("ab", "c")]), "nothing merged");
        assert_eq!(left(4, &[arc("a", "bc"), arc("bc", "a"), gated("a", "d", "b")]), "a (b&c) d");
    }

    #[test]
    fn a_place_that_a_gate_reads_stays_for_itself() {
        assert_eq!(left(3, &[arc("a", "b"), gated("b", "c", "a")]), "nothing merged");
        assert_eq!(left(4, &[arc("a", "b"), arc("b", "a"), gated("c", "d", "b")]), "nothing merged");
    }

    #[test]
    fn a_place_that_is_filled_from_elsewhere_too_or_marked_stays_for_itself() {
        assert_eq!(left(4, &[arc("a", "b"), arc("ac", "bd")]), "nothing merged");
        assert_eq!(left(2, &[arc("b", "a")]), "nothing merged");
        assert_eq!(left(3, &[arc("a", "c"), arc("b", "c")]), "nothing merged");
    }

    #[test]
    fn places_whose_tokens_one_transition_takes_together_are_not_one() {
        assert_eq!(left(4, &[arc("a", "b"), arc("ab", "c"), arc("c", "ad")]), "nothing merged");
        assert_eq!(left(4, &[arc("a", "b"), arc("a", "c"), arc("bc", "d")]), "nothing merged");
    }

    #[test]
    fn what_needs_room_where_it_takes_a_token_is_left_alone() {
        assert_eq!(left(3, &[arc("a", "b"), arc("bc", "ab")]), "nothing merged");
    }

    #[test]
    fn a_token_that_comes_back_to_where_it_was_is_read() {
        let mut poll = unwatched;
        let transitions = [arc("a", "b"), arc("bc", "ad"), arc("d", "e")];
        let found = merged(5, &transitions, &[0, 2], &mut Watch::new(None, &mut poll)).expect("no budget");
        let net = found.expect("a and b are one");
        assert_eq!(net.stands.iter().map(told).collect::<Vec<_>>().join(" "), "(a|b) c (d|e)");
        let [only] = &net.transitions[..] else { panic!("{:?}", net.transitions) };
        assert_eq!((&only.inputs[..], &only.outputs[..], &only.permissive[..]), (&[1][..], &[2][..], &[0][..]));
        assert_eq!(net.initial, [0, 1]);
    }

    #[test]
    fn places_that_go_round_without_a_token_are_merged_and_those_with_two_are_not() {
        assert_eq!(left(3, &[arc("b", "c"), arc("c", "b")]), "a (b|c)");
        let mut poll = unwatched;
        let ring = [arc("a", "b"), arc("b", "a")];
        let found = merged(2, &ring, &[0, 1], &mut Watch::new(None, &mut poll)).expect("no budget");
        assert!(found.is_none());
    }
}
