//! Walks: firings drawn at random from M0, with restarts, until a goal is met. They find what is too far for a search
//! to reach and never conclude that a goal cannot be reached.
//!
//! A walk takes about twenty nanoseconds for each transition that a firing touches: how many conditions of a transition
//! are false is counted, and only the needers of what was flipped are looked at, whatever the size of the net. Every
//! fourth walk is blind; every fourth draws a few transitions and fires the one that was fired least; every fourth
//! the one after which the goal is nearest (literals that still have to become true; firable transitions, for a
//! deadlock); and every fourth follows relaxed plans, which see what has to happen long before. Every other of these
//! is strict, with as many tokens at rest as can be (`Plan::freeze`), where it goes to a formula and as long as planning
//! so takes no longer than walking. To fire what was fired least keeps a net going, so those that look for a deadlock are
//! blind in its place. The lengths follow the sequence of Luby, Sinclair and Zuckerman ("Optimal speedup of Las Vegas
//! algorithms", 1993), which is within a logarithm of the best choice of restarts, whatever that is.
//!
//! What was found is cut down before it is shown: from the end backwards, a firing is kept if it makes a literal true
//! that the goal or a kept firing later needs. What is kept can be fired without the rest, because a literal that is
//! needed is not made false between the firing that makes it and the one that needs it. Then what leads back to a
//! marking is left out.

use std::cmp::Reverse;
use std::collections::HashMap;

use super::dependencies::{Dependencies, Literal, is_true, negation};
use super::marks::Marks;
use super::relaxed::Plan;
use super::walker::{Target, Walker};
use crate::budget::{Stop, Watch};
use crate::net::Net;
use crate::random::Random;

/// Firings in the shortest walks; longer for nets with more transitions.
pub(super) const UNIT: usize = 1 << 10;
/// Firings in the longest walk.
pub(super) const LENGTH_MAX: usize = 1 << 20;
/// Words of markings that are remembered to find loops.
const REMEMBERED_MAX: usize = 1 << 24;
/// How many transitions a guided walk draws to choose from.
pub(super) const DRAWS: usize = 4;

/// How a walk chooses among the firable transitions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Guide {
    Blind,
    LeastFired,
    Nearest,
    Planned,
}

/// The i-th number, from 1, of 1, 1, 2, 1, 1, 2, 4, 1, 1, 2, ...
pub(super) fn luby(i: u64) -> u64 {
    let bits = 64 - i.leading_zeros();
    if i + 1 == 1 << bits { 1 << (bits - 1) } else { luby(i + 1 - (1 << (bits - 1))) }
}

/// Walks from M0 until the target is met: the firings that lead there, cut down, or none after `max_steps` firings.
/// Also the number of firings done.
pub fn walk(
    net: &Net,
    dependencies: &Dependencies,
    target: &mut Target,
    seed: u64,
    max_steps: u64,
    watch: &mut Watch<'_>,
) -> (Result<Option<Vec<u32>>, Stop>, u64) {
    let mut steps = 0;
    let found = find(net, dependencies, target, seed, max_steps, &mut steps, watch);
    (found, steps)
}

fn find(
    net: &Net,
    dependencies: &Dependencies,
    target: &mut Target,
    seed: u64,
    max_steps: u64,
    steps: &mut u64,
    watch: &mut Watch<'_>,
) -> Result<Option<Vec<u32>>, Stop> {
    let count = net.transitions.len();
    let mut random = Random::new(seed);
    let mut fired = vec![0u32; count];
    let mut path = Vec::new();
    let unit = UNIT.max(count.min(LENGTH_MAX / 64));
    let mut plan = Plan::new(dependencies, net.places, count);
    let evenly = if matches!(target, Target::Deadlock) { Guide::Blind } else { Guide::LeastFired };
    let guides = [evenly, Guide::Nearest, Guide::Blind, Guide::Planned];
    // The work of walking, and of planning strictly.
    let (mut walked, mut planned) = (0, 0);
    for round in 1_u64.. {
        let guide = guides[round as usize % guides.len()];
        let length = LENGTH_MAX.min(unit.saturating_mul(luby(round.div_ceil(4)) as usize));
        let mut walker = Walker::new(dependencies, &net.initial, count);
        watch.tick(count)?;
        path.clear();
        plan.forget();
        if guide == Guide::Planned
            && round / 4 % 2 == 0
            && planned <= walked
            && let Target::Formula(formula) = target
        {
            let work = plan.begin_strictly(&walker.marking, formula, &mut random);
            planned += work;
            watch.tick(work)?;
        }
        for _ in 0..length {
            if target.met(&walker) {
                let needed = cut_down(dependencies, target, &walker.marking, &path, count, net.places);
                return Ok(Some(without_loops(net, &needed)));
            }
            if walker.stuck() {
                break;
            }
            if *steps >= max_steps {
                return Ok(None);
            }
            let (t, work) = match guide {
                Guide::Planned => match plan.next(&walker, target, &mut random) {
                    (Some(t), work) => (t, work),
                    (None, work) => {
                        watch.tick(work)?;
                        break;
                    }
                },
                _ => choose(&mut walker, target, guide, &fired, &mut random),
            };
            let work = work + walker.flip(t) + target.size();
            walked += work;
            fired[t as usize] = fired[t as usize].saturating_add(1);
            path.push(t);
            *steps += 1;
            watch.tick(work)?;
        }
        if path.is_empty() {
            return Ok(None); // M0 is not the target, and there is nowhere to go
        }
    }
    Ok(None)
}

fn choose(
    walker: &mut Walker<'_>,
    target: &mut Target,
    guide: Guide,
    fired: &[u32],
    random: &mut Random,
) -> (u32, usize) {
    let mut best = (u64::MAX, walker.firable[random.below(walker.firable.len())]);
    let mut work = 0;
    if guide == Guide::Blind || walker.firable.len() == 1 || random.below(16) == 0 {
        return (best.1, work);
    }
    for _ in 0..DRAWS {
        let t = walker.firable[random.below(walker.firable.len())];
        let price = if guide == Guide::LeastFired {
            u64::from(fired[t as usize])
        } else {
            work += walker.flip(t);
            let distance = target.distance(walker);
            work += walker.flip(t) + target.size();
            distance
        };
        if price < best.0 {
            best = (price, t);
        }
    }
    (best.1, work)
}

/// The firings of a path that the target needs, in their order.
pub(super) fn cut_down(
    net: &Dependencies,
    target: &mut Target,
    reached: &[u64],
    path: &[u32],
    transitions: usize,
    places: usize,
) -> Vec<u32> {
    match target {
        Target::Formula(formula) => {
            let mut literals: Vec<Literal> = Vec::new();
            formula.support(reached, &mut literals);
            needed_for(net, &literals, path, places)
        }
        Target::Deadlock => {
            let flips =
                path.iter().enumerate().flat_map(|(at, &t)| net.flipped(t).iter().map(move |&l| (negation(l), at)));
            let made: HashMap<Literal, usize> = flips.collect();
            let mut needed = Marks::new(2 * places);
            let mut literals: Vec<Literal> = Vec::new();
            for t in (0..transitions as u32).filter(|&t| net.able(t)) {
                let mut unmet = net.conditions(t).iter().copied().filter(|&l| !is_true(l, reached)).map(negation);
                // What was never made costs no firing; of the rest, the last firings are needed most likely anyway.
                let cheapest =
                    unmet.clone().min_by_key(|l| made.get(l).map_or((false, Reverse(0)), |&at| (true, Reverse(at))));
                if !unmet.any(|l| needed.has(l)) {
                    cheapest.iter().for_each(|&l| _ = needed.insert(l));
                    literals.extend(cheapest);
                }
            }
            needed_for(net, &literals, path, places)
        }
    }
}

/// The firings of a path that some literals need, which are true at its end, in their order.
fn needed_for(net: &Dependencies, literals: &[Literal], path: &[u32], places: usize) -> Vec<u32> {
    let mut needed = Marks::new(2 * places);
    literals.iter().for_each(|&l| _ = needed.insert(l));
    let mut kept = Vec::new();
    for &t in path.iter().rev() {
        if net.flipped(t).iter().any(|&l| needed.has(negation(l))) {
            net.flipped(t).iter().for_each(|&l| needed.remove(negation(l)));
            net.conditions(t).iter().for_each(|&l| _ = needed.insert(l));
            kept.push(t);
        }
    }
    kept.reverse();
    kept
}

/// The path without the parts that lead back to a marking; unchanged where its markings are too many to remember.
pub(super) fn without_loops(net: &Net, path: &[u32]) -> Vec<u32> {
    if path.len().saturating_mul(net.words) > REMEMBERED_MAX {
        return path.to_vec();
    }
    let mut kept = Vec::new();
    let mut markings = vec![net.initial.clone()];
    let mut depth = HashMap::from([(net.initial.clone(), 0)]);
    for &t in path {
        let mut after = markings[kept.len()].clone();
        after.iter_mut().zip(net.flip(t as usize, net.words)).for_each(|(word, flip)| *word ^= flip);
        if let Some(&back) = depth.get(&after) {
            markings.drain(back + 1..).for_each(|marking| _ = depth.remove(&marking));
            kept.truncate(back);
        } else {
            kept.push(t);
            depth.insert(after.clone(), kept.len());
            markings.push(after);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::super::dependencies::literal;
    use super::super::formula::{Formula, Node};
    use super::*;
    use crate::budget::unwatched;
    use crate::net::Transition;

    #[test]
    fn lengths_follow_the_sequence_of_luby() {
        let first: Vec<u64> = (1..=15).map(luby).collect();
        assert_eq!(first, [1, 1, 2, 1, 1, 2, 4, 1, 1, 2, 1, 1, 2, 4, 8]);
    }

    #[test]
    fn a_strict_walk_goes_where_all_others_must_be_at_rest() {
        // Three machines go up twelve levels: whoever came to a level last stays there until the others are idle, so
        // the first that starts beside another ends below the third. Whose turn it is at first makes plans hope for more.
        // That one is idle is seen by a token, or by the empty place of what it does instead.
        const MACHINES: u32 = 3;
        const LEVELS: u32 = 12;
        for busy in [false, true] {
            let (idle, mut next) = (|m: u32| m, MACHINES);
            let mut place = || {
                next += 1;
                next - 1
            };
            let at: Vec<Vec<u32>> = (0..MACHINES).map(|_| (0..=LEVELS).map(|_| place()).collect()).collect();
            let turn: Vec<Vec<u32>> = (0..LEVELS).map(|_| (0..MACHINES).map(|_| place()).collect()).collect();
            let mut transitions = Vec::new();
            for m in 0..MACHINES {
                let others = || (0..MACHINES).filter(move |&k| k != m);
                let all: Vec<u32> = others().map(idle).collect();
                let first = at[m as usize][0];
                transitions.push(match busy {
                    true => Transition::new(&[], &[idle(m), first], &[], &[], &[]),
                    false => Transition::new(&[idle(m)], &[first], &[], &[], &[]),
                });
                for (l, turn) in turn.iter().enumerate() {
                    let (from, to) = (at[m as usize][l], at[m as usize][l + 1]);
                    let (asked, tested) = (place(), place());
                    transitions.push(Transition::new(&[from], &[asked], &[turn[m as usize]], &[], &[]));
                    for k in others().map(|k| turn[k as usize]) {
                        transitions.push(Transition::new(&[from, k], &[asked, turn[m as usize]], &[], &[], &[]));
                        transitions.push(Transition::new(&[asked], &[to], &[k], &[], &[]));
                    }
                    transitions.push(Transition::new(&[asked], &[tested], &[turn[m as usize]], &[], &[]));
                    let (full, empty): (&[u32], &[u32]) = if busy { (&[], &all) } else { (&all, &[]) };
                    transitions.push(Transition::new(&[tested], &[to], full, empty, &[]));
                }
            }
            let idlers = (0..MACHINES).filter(|_| !busy).map(idle);
            let initial: Vec<u32> = idlers.chain(turn.iter().map(|turn| turn[0])).collect();
            let goals: Vec<u32> = at.iter().map(|at| at[LEVELS as usize]).collect();
            let net = Net::new(next as usize, transitions, &initial).expect("well formed");
            let dependencies = Dependencies::new(&net);
            for (seed, goal) in (0..20).flat_map(|seed| goals.iter().map(move |&goal| (seed, goal))) {
                let nodes = vec![Node::Literal(literal(goal, true))];
                let mut target = Target::Formula(Formula::new(nodes, next as usize).expect("well formed"));
                let mut poll = unwatched;
                // Two walks of other kinds end before.
                let (found, steps) =
                    walk(&net, &dependencies, &mut target, seed, 3 * UNIT as u64, &mut Watch::new(None, &mut poll));
                let path = found.expect("not stopped").expect("met");
                assert!(path.len() <= 1 + 3 * LEVELS as usize && steps <= 3 * UNIT as u64, "{} {steps}", path.len());
            }
        }
    }

    #[test]
    fn a_walk_that_only_idles_begins_again() {
        // Once place 1 is filled first, all that is left to fire reads place 0 and changes nothing.
        let fill = Transition::new(&[], &[1], &[], &[], &[]);
        let take = Transition::new(&[0], &[1], &[], &[], &[]);
        let idle = Transition::new(&[], &[], &[0], &[], &[]);
        let net = Net::new(2, vec![fill, take, idle], &[0]).expect("well formed");
        let dependencies = Dependencies::new(&net);
        for seed in 0..20 {
            let mut poll = unwatched;
            let mut watch = Watch::new(None, &mut poll);
            let (found, _) = walk(&net, &dependencies, &mut Target::Deadlock, seed, 100, &mut watch);
            assert_eq!(found, Ok(Some(vec![1])));
        }
    }

    #[test]
    fn what_a_deadlock_does_not_need_and_what_leads_back_is_cut_away() {
        // A ring of two places, and a way out of it; beside them a place that is filled and never matters.
        let arc = |from, to| Transition::new(&[from], &[to], &[], &[], &[]);
        let beside = Transition::new(&[3], &[4], &[], &[2], &[]);
        let net = Net::new(5, vec![arc(0, 1), arc(1, 0), arc(1, 2), beside], &[0, 3]).expect("well formed");
        let dependencies = Dependencies::new(&net);
        for seed in 0..20 {
            let mut poll = unwatched;
            let mut watch = Watch::new(None, &mut poll);
            let (found, _) = walk(&net, &dependencies, &mut Target::Deadlock, seed, 10_000, &mut watch);
            assert_eq!(found, Ok(Some(vec![0, 2])));
        }
    }
}
