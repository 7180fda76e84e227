//! Cover: walks that make as many transitions fire as they can, for quasi-liveness.
//!
//! A walk that has made an open transition firable has come to a part of the net where others wait; so the way there is
//! kept, cut down to the firings that it needs, and later walks start from there as often as from M0 (the archive of
//! Ecoffet and others, "First return, then explore", 2021). A third of the walks are drawn towards one open transition
//! by relaxed plans; a third fire what was fired least; a third are blind. Plans are strict, with as many tokens at rest as
//! can be (`Plan::freeze`) and all towards one transition until it is met, as long as making them takes no longer than
//! walking. A deadlock that is met on the way is kept.
//!
//! What comes out is a tree of firing sequences, each of which goes on from a moment of another: what a walk has met is
//! shown by one sequence, cut down to what all of it needs, so that all together are replayed in the time that their
//! firings take. What was not met may fire all the same.

use super::dependencies::{Dependencies, negation};
use super::marks::Marks;
use super::relaxed::Plan;
use super::walk::{DRAWS, LENGTH_MAX, UNIT, cut_down, luby, without_loops};
use super::walker::{Target, Walker};
use crate::budget::{Stop, Watch};
use crate::net::Net;
use crate::random::Random;

/// A moment: so many firings of a way.
type Moment = (u32, u32);

/// A firing sequence, from M0 or a moment of an earlier one.
#[derive(Debug, PartialEq, Eq)]
pub struct Way {
    /// Where it goes on from; none is M0.
    pub from: Option<Moment>,
    /// What is fired.
    pub firings: Vec<u32>,
    /// Transitions, open until then, and after how many of these firings each is firable; ascending.
    pub firable: Vec<(u32, u32)>,
}

/// What the walks have met.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Cover {
    /// Ways to the transitions that were met.
    pub ways: Vec<Way>,
    /// A firing sequence from M0 to a deadlock.
    pub deadlock: Option<Vec<u32>>,
    /// Firings made.
    pub steps: u64,
}

/// Where walks start: M0, or a moment of a way.
struct Start {
    marking: Vec<u64>,
    at: Option<Moment>,
    visits: u32,
}

/// Walks from M0 until each of the `open` transitions was firable, or `max_vain` firings in a row met none of them anew.
pub fn cover(
    net: &Net,
    dependencies: &Dependencies,
    open: &[u32],
    seed: u64,
    max_vain: u64,
    watch: &mut Watch<'_>,
) -> (Cover, Result<(), Stop>) {
    let mut search = Search::new(net, dependencies, open, seed);
    let end = search.run(max_vain, watch);
    (search.found, end)
}

struct Search<'a> {
    net: &'a Net,
    dependencies: &'a Dependencies,
    /// The open transitions, and for each transition its position among them.
    open: Vec<u32>,
    position: Vec<u32>,
    fired: Vec<u32>,
    archive: Vec<Start>,
    plan: Plan<'a>,
    /// The open transition that a strict walk goes towards.
    aimed: u32,
    random: Random,
    /// Whether no firing in M0 leads to another marking.
    nowhere_to_go: bool,
    /// The work of walking, and of planning strictly.
    walked: usize,
    planned: usize,
    /// How many firings had been made when an open transition was met last.
    met_at: u64,
    found: Cover,
}

const CLOSED: u32 = u32::MAX;
/// How often is drawn what a walk goes towards.
const TRIES: usize = 8;
/// How many times as much as walking takes, planning strictly may take.
const PLANNING: usize = 1;

impl<'a> Search<'a> {
    fn new(net: &'a Net, dependencies: &'a Dependencies, open: &[u32], seed: u64) -> Self {
        let count = net.transitions.len();
        let mut search = Search {
            net,
            dependencies,
            open: Vec::new(),
            position: vec![CLOSED; count],
            fired: vec![0; count],
            archive: vec![Start { marking: net.initial.clone(), at: None, visits: 0 }],
            plan: Plan::new(dependencies, net.places, count),
            aimed: CLOSED,
            random: Random::new(seed),
            nowhere_to_go: false,
            walked: 0,
            planned: 0,
            met_at: 0,
            found: Cover::default(),
        };
        for &t in open.iter().filter(|&&t| dependencies.able(t)) {
            if search.position[t as usize] == CLOSED {
                search.position[t as usize] = search.open.len() as u32;
                search.open.push(t);
            }
        }
        search
    }

    fn close(&mut self, t: u32) {
        let at = std::mem::replace(&mut self.position[t as usize], CLOSED);
        self.open.swap_remove(at as usize);
        if let Some(&moved) = self.open.get(at as usize) {
            self.position[moved as usize] = at;
        }
    }

    fn run(&mut self, max_vain: u64, watch: &mut Watch<'_>) -> Result<(), Stop> {
        let unit = UNIT.max(self.net.transitions.len().min(LENGTH_MAX / 64));
        for round in 1_u64.. {
            let left = self.met_at.saturating_add(max_vain).saturating_sub(self.found.steps);
            if self.open.is_empty() || self.nowhere_to_go || left == 0 {
                break;
            }
            let from = self.start(round);
            self.archive[from].visits += 1;
            let length = LENGTH_MAX.min(unit.saturating_mul(luby(round.div_ceil(6)) as usize));
            self.walk(from, round, length.min(usize::try_from(left).unwrap_or(usize::MAX)), watch)?;
        }
        Ok(())
    }

    /// M0 for every other walk; else, of two starts that are drawn, the one that fewer walks have left from.
    fn start(&mut self, round: u64) -> usize {
        if round % 2 == 1 {
            return 0;
        }
        let (one, other) = (self.random.below(self.archive.len()), self.random.below(self.archive.len()));
        if self.archive[one].visits <= self.archive[other].visits { one } else { other }
    }

    /// One walk.
    fn walk(&mut self, from: usize, round: u64, length: usize, watch: &mut Watch<'_>) -> Result<(), Stop> {
        let count = self.net.transitions.len();
        let mut walker = Walker::new(self.dependencies, &self.archive[from].marking, count);
        watch.tick(count)?;
        let (mut path, mut met) = (Vec::new(), Vec::new());
        self.meet(&walker, &walker.firable, 0, &mut met);
        self.plan.forget();
        self.aimed = CLOSED;
        let strict = self.planned <= PLANNING * self.walked;
        while path.len() < length && !self.open.is_empty() {
            if walker.stuck() {
                self.nowhere_to_go |= from == 0 && path.is_empty();
                if walker.firable.is_empty() && self.found.deadlock.is_none() {
                    let whole = self.whole_path(self.archive[from].at, &path);
                    let (deadlock, places) = (&mut Target::Deadlock, self.net.places);
                    let needed = cut_down(self.dependencies, deadlock, &walker.marking, &whole, count, places);
                    self.found.deadlock = Some(without_loops(self.net, &needed));
                }
                break;
            }
            let mut work = 0;
            let t = match round % 3 {
                0 => self.least_fired(&walker),
                1 => {
                    if !self.plan.is_fresh(&walker) {
                        let (is_planned, more) = self.aim(&walker, strict, path.is_empty());
                        if !is_planned {
                            watch.tick(more)?;
                            break;
                        }
                        work = more;
                    }
                    self.plan.follow(&walker, &mut self.random)
                }
                _ => walker.firable[self.random.below(walker.firable.len())],
            };
            let walked = walker.flip(t);
            self.walked += walked;
            work += walked;
            path.push(t);
            self.fired[t as usize] = self.fired[t as usize].saturating_add(1);
            self.found.steps += 1;
            self.meet(&walker, &walker.fresh, path.len(), &mut met);
            if let Err(stop) = watch.tick(work) {
                self.keep(from, &path, &met);
                return Err(stop);
            }
        }
        self.keep(from, &path, &met);
        Ok(())
    }

    /// Plans a way to an open transition that is drawn, in a strict walk to the same one until it is met, with as many tokens
    /// at rest as could be at its beginning; whether there is one, and the work.
    fn aim(&mut self, walker: &Walker<'_>, strict: bool, is_first: bool) -> (bool, usize) {
        let mut work = 0;
        for _ in 0..if strict { TRIES } else { 1 } {
            let is_on_its_way = strict && self.aimed != CLOSED && self.position[self.aimed as usize] != CLOSED;
            if !is_on_its_way {
                self.aimed = self.open[self.random.below(self.open.len())];
            }
            let goal = self.dependencies.conditions(self.aimed);
            let (is_planned, more) = if strict && is_first {
                self.plan.freeze(&walker.marking, goal, &mut self.random)
            } else {
                (self.plan.towards(walker, goal, &mut self.random), self.plan.size())
            };
            work += more;
            self.planned += if strict { more } else { 0 };
            if is_planned {
                return (true, work);
            }
            self.aimed = CLOSED;
        }
        (false, work)
    }

    fn least_fired(&mut self, walker: &Walker<'_>) -> u32 {
        let among = &walker.firable;
        let mut best = among[self.random.below(among.len())];
        for _ in 1..DRAWS {
            let t = among[self.random.below(among.len())];
            if self.fired[t as usize] < self.fired[best as usize] {
                best = t;
            }
        }
        best
    }

    /// Notes those of some transitions that are open and firable, after so many firings of a walk.
    fn meet(&mut self, walker: &Walker<'_>, among: &[u32], after: usize, met: &mut Vec<(u32, usize)>) {
        for &t in among {
            if self.position[t as usize] != CLOSED && walker.may_fire(t) {
                self.close(t);
                self.met_at = self.found.steps;
                met.push((t, after));
            }
        }
    }

    /// Keeps the way to what was met on a walk, cut down to what it needs, and starts from there later.
    fn keep(&mut self, from: usize, path: &[u32], met: &[(u32, usize)]) {
        if met.is_empty() {
            return;
        }
        let (firings, firable) = self.needed(path, met);
        let mut marking = self.archive[from].marking.clone();
        let number = self.found.ways.len() as u32;
        let (mut fired, mut last) = (0, 0);
        for &(_, after) in &firable {
            for &u in &firings[fired..after as usize] {
                let flip = self.net.flip(u as usize, self.net.words);
                marking.iter_mut().zip(flip).for_each(|(word, flip)| *word ^= flip);
            }
            fired = after as usize;
            if after > last {
                self.archive.push(Start { marking: marking.clone(), at: Some((number, after)), visits: 0 });
                last = after;
            }
        }
        self.found.ways.push(Way { from: self.archive[from].at, firings, firable });
    }

    /// The firings of a path that the transitions met on it need, and after how many of them each is firable.
    fn needed(&self, path: &[u32], met: &[(u32, usize)]) -> (Vec<u32>, Vec<(u32, u32)>) {
        let net = self.dependencies;
        let mut needed = Marks::new(2 * self.net.places);
        let (mut kept, mut firable) = (Vec::new(), Vec::new());
        let mut met = met.iter().rev().peekable();
        for after in (0..=path.len()).rev() {
            while let Some(&(t, _)) = met.next_if(|&&(_, at)| at == after) {
                net.conditions(t).iter().for_each(|&l| _ = needed.insert(l));
                firable.push((t, kept.len() as u32));
            }
            let Some(&t) = after.checked_sub(1).map(|at| &path[at]) else { break };
            if net.flipped(t).iter().any(|&l| needed.has(negation(l))) {
                net.flipped(t).iter().for_each(|&l| needed.remove(negation(l)));
                net.conditions(t).iter().for_each(|&l| _ = needed.insert(l));
                kept.push(t);
            }
        }
        kept.reverse();
        firable.reverse();
        // They were counted from the end.
        firable.iter_mut().for_each(|(_, after)| *after = kept.len() as u32 - *after);
        (kept, firable)
    }

    /// A path from a moment, as a path from M0.
    fn whole_path(&self, at: Option<Moment>, path: &[u32]) -> Vec<u32> {
        let moments = std::iter::successors(at, |&(way, _)| self.found.ways[way as usize].from);
        let mut parts: Vec<&[u32]> =
            moments.map(|(way, fired)| &self.found.ways[way as usize].firings[..fired as usize]).collect();
        parts.reverse();
        parts.push(path);
        parts.concat()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::net::Transition;

    #[test]
    fn each_transition_of_a_chain_is_met_and_the_one_that_is_dead_is_not() {
        let arc = |from, to| Transition::new(&[from], &[to], &[], &[], &[]);
        let mut transitions: Vec<Transition> = (0..200).map(|p| arc(p, p + 1)).collect();
        transitions.push(arc(201, 0));
        let net = Net::new(202, transitions, &[0]).expect("well formed");
        let dependencies = Dependencies::new(&net);
        let all: Vec<u32> = (0..201).collect();
        let mut poll = unwatched;
        let (found, end) = cover(&net, &dependencies, &all, 1, 100_000, &mut Watch::new(None, &mut poll));
        let met: Vec<u32> = found.ways.iter().flat_map(|way| way.firable.iter().map(|&(t, _)| t)).collect();
        assert_eq!((end, met.len()), (Ok(()), 200));
        for Way { from, firings, firable } in &found.ways {
            let begin = from.map_or(0, |(way, fired)| {
                found.ways[way as usize]
                    .firable
                    .iter()
                    .find(|&&(_, after)| after == fired)
                    .expect("an archived moment")
                    .0
            });
            for &(t, after) in firable {
                assert_eq!(firings[..after as usize], (begin..t).collect::<Vec<u32>>());
            }
        }
        assert_eq!(found.deadlock.map(|path| path.len()), Some(200));
    }

    #[test]
    fn walks_end_after_so_many_firings_that_met_nothing_anew() {
        let arc = |from, to| Transition::new(&[from], &[to], &[], &[], &[]);
        let mut transitions: Vec<Transition> = (0..200).map(|p| arc(p, p + 1)).collect();
        transitions.push(arc(201, 0));
        let net = Net::new(202, transitions, &[0]).expect("well formed");
        let (mut poll, dependencies) = (unwatched, Dependencies::new(&net));
        let all: Vec<u32> = (0..201).collect();
        let (found, end) = cover(&net, &dependencies, &all, 1, 150, &mut Watch::new(None, &mut poll));
        let met: usize = found.ways.iter().map(|way| way.firable.len()).sum();
        assert_eq!((end, met), (Ok(()), 200));
        assert!((350..=2_000).contains(&found.steps), "{}", found.steps);
    }

    #[test]
    fn walks_end_where_no_firing_leads_to_another_marking() {
        let transitions = vec![Transition::new(&[], &[], &[], &[], &[]), Transition::new(&[0], &[], &[], &[], &[])];
        let net = Net::new(1, transitions, &[]).expect("well formed");
        let (mut poll, dependencies) = (unwatched, Dependencies::new(&net));
        let (found, end) = cover(&net, &dependencies, &[0, 1], 1, 100, &mut Watch::new(None, &mut poll));
        assert_eq!((end, found.steps, found.deadlock), (Ok(()), 0, None));
        assert_eq!(found.ways, [Way { from: None, firings: vec![], firable: vec![(0, 0)] }]);
    }
}
