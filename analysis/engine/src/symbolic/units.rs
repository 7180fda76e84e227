//! Units: places of which one is marked at a time stand together, and the units alone are put in order.
//!
//! What a machine is at, which step a program has come to: of such places one alone is marked, and the diagram tells them
//! apart in one bundle of nodes, however many they are and in whatever order they stand there. So the arcs within a unit
//! cost nothing, and the order that counts is that of the units. By the sum of the spans the arcs within outweigh those
//! in between, as they are many more; and what is between a few dozen units can be laid out far better than hundreds
//! of places can. Of the nets of the model-checking contest that take seconds most are found several times sooner so.
//!
//! The units are made of the net itself, by which places are concurrent (`crate::concurrency`): of two that are joined by
//! arcs those come together first that are joined by most, as long as no two of their places may be marked together. Their
//! order is the best of some, of which each is made by FORCE and then by *sifting*: unit by unit goes to wherever the
//! spans are least. (Rudell's sifting moves levels of the diagram itself; here nothing is moved but in the sum.) From one
//! start alone both end in an order that no single move betters, which may be a bad one.
//!
//! The name is that of nested-unit Petri nets (Garavel 2019), of which the safe ones have units as these are. Rejected:
//! units as a file names them. They are pieces of the program that a net was made of, of which several can be one, and
//! hardly anybody who draws a net names any.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use super::order::{FORCE_ROUNDS, Graph, Order, both, joined};
use crate::budget::{Stop, Watch};
use crate::concurrency::Concurrency;
use crate::net::Transition;
use crate::random::Random;

/// How many of four places are left as units at most: more have nothing to say that the places do not.
const LEFT_OF_FOUR: usize = 3;
/// The orders that FORCE begins with, drawn at random, beside that of Sloan and the given one.
const DRAWN: u64 = 6;
/// What laying out may look at, from all starts together.
const WORK_MAX: usize = 20_000_000;

/// Joins of units are weighed in parts of one arc to one arc.
const WEIGHT: u64 = 1 << 20;
/// How many joins may be made, and moved when units come together, before it takes too long.
const JOINS_MAX: usize = 1 << 19;

/// The places in units, each in the order of the net; None where there are hardly fewer units than places, or where it
/// would take more than so many joins.
fn units(
    places: usize,
    transitions: &[Transition],
    initial: &[u32],
    joins_max: usize,
    watch: &mut Watch<'_>,
) -> Result<Option<Vec<Vec<u32>>>, Stop> {
    let mut joins: usize = transitions.iter().map(|each| each.inputs.len() * each.outputs.len()).sum();
    if joins > joins_max {
        return Ok(None);
    }
    let Some(mut concurrent) = Concurrency::of(places, transitions, initial, watch)? else { return Ok(None) };
    let mut beside: Vec<BTreeMap<u32, u64>> = vec![BTreeMap::new(); places];
    for transition in transitions {
        let weight = WEIGHT / (transition.inputs.len() * transition.outputs.len()).max(1) as u64;
        for &from in &transition.inputs {
            watch.tick(transition.outputs.len())?;
            for &to in transition.outputs.iter().filter(|&&to| to != from && !concurrent.has(from, to)) {
                *beside[from as usize].entry(to).or_default() += weight;
                *beside[to as usize].entry(from).or_default() += weight;
            }
        }
    }
    let mut heap: BinaryHeap<(u64, Reverse<u32>, Reverse<u32>)> = BinaryHeap::new();
    for (one, others) in beside.iter().enumerate() {
        let later = others.range(one as u32 + 1..);
        heap.extend(later.map(|(&other, &weight)| (weight, Reverse(one as u32), Reverse(other))));
    }
    let mut members: Vec<Vec<u32>> = (0..places as u32).map(|place| vec![place]).collect();
    while let Some((weight, Reverse(one), Reverse(other))) = heap.pop() {
        watch.tick(1)?;
        if beside[one as usize].get(&other) != Some(&weight) {
            continue; // as it was before one of them has grown
        }
        beside[one as usize].remove(&other);
        beside[other as usize].remove(&one);
        watch.tick(members[other as usize].len() + beside[other as usize].len())?;
        if members[other as usize].iter().any(|&place| concurrent.has(one, place)) {
            continue;
        }
        joins += beside[other as usize].len();
        if joins > joins_max {
            return Ok(None);
        }
        concurrent.join(one, other);
        let gained = std::mem::take(&mut members[other as usize]);
        members[one as usize].extend(gained);
        for (third, weight) in std::mem::take(&mut beside[other as usize]) {
            beside[third as usize].remove(&other);
            let sum = beside[one as usize].entry(third).or_default();
            *sum += weight;
            let sum = *sum;
            beside[third as usize].insert(one, sum);
            heap.push((sum, Reverse(one), Reverse(third)));
        }
    }
    members.retain(|unit| !unit.is_empty());
    members.iter_mut().for_each(|unit| unit.sort_unstable());
    members.sort_unstable();
    Ok((4 * members.len() <= LEFT_OF_FOUR * places).then_some(members))
}

/// The order of the places by units and its reverse, or None where there are none worth it.
pub(super) fn by_unit(
    places: usize,
    transitions: &[Transition],
    initial: &[u32],
    watch: &mut Watch<'_>,
) -> Result<Option<[Order; 2]>, Stop> {
    let Some(units) = units(places, transitions, initial, JOINS_MAX, watch)? else { return Ok(None) };
    let mut unit_of = vec![0; places];
    for (unit, members) in units.iter().enumerate() {
        members.iter().for_each(|&place| unit_of[place as usize] = unit as u32);
    }
    let joined_units: Vec<Transition> = transitions
        .iter()
        .map(|transition| {
            Transition::new(
                &joined(transition).map(|place| unit_of[place as usize]).collect::<Order>(),
                &[],
                &[],
                &[],
                &[],
            )
        })
        .filter(|transition| transition.inputs.len() > 1)
        .collect();
    let order = laid_out(units.len(), &joined_units, watch)?;
    Ok(Some(both(order.into_iter().flat_map(|unit| units[unit as usize].iter().copied()).collect())))
}

/// The best order of vertices found, by the sum of the spans of what joins them.
fn laid_out(vertices: usize, joins: &[Transition], watch: &mut Watch<'_>) -> Result<Order, Stop> {
    let arcs: usize = joins.iter().map(|join| join.inputs.len()).sum();
    watch.tick(arcs)?;
    let graph = Graph::new(vertices, joins);
    let spans = Spans::new(joins);
    let given: Order = (0..vertices as u32).collect();
    let mut best = (u64::MAX, given.clone());
    let drawn = (0..DRAWN).map(|seed| {
        let (mut order, mut random) = (given.clone(), Random::new(seed));
        (1..vertices).for_each(|at| order.swap(at, random.below(at + 1)));
        order
    });
    let mut left = WORK_MAX;
    for start in [graph.sloan(), given.clone()].into_iter().chain(drawn) {
        let work = FORCE_ROUNDS * (vertices + arcs);
        watch.tick(work)?;
        left = left.saturating_sub(work);
        let order = spans.sifted(graph.force(start), &mut left, watch)?;
        let span = graph.span(&order);
        if span < best.0 {
            best = (span, order);
        }
        if left == 0 {
            break;
        }
    }
    Ok(best.1)
}

/// What joins vertices, each once with how often it is there.
struct Spans {
    joins: Vec<(Vec<u32>, u64)>,
}

impl Spans {
    fn new(joins: &[Transition]) -> Self {
        let mut counted: BTreeMap<&[u32], u64> = BTreeMap::new();
        joins.iter().for_each(|each| *counted.entry(&each.inputs).or_default() += 1);
        Spans { joins: counted.into_iter().map(|(ends, count)| (ends.to_vec(), count)).collect() }
    }

    /// An order of which no vertex alone can be moved so that the sum of the spans becomes less, as far as work is left.
    fn sifted(&self, mut order: Order, left: &mut usize, watch: &mut Watch<'_>) -> Result<Order, Stop> {
        let work = order.len() + self.joins.iter().map(|(ends, _)| ends.len()).sum::<usize>();
        let (mut position, mut stands) = (vec![0; order.len()], 0);
        for vertex in (0..order.len() as u32).cycle() {
            if stands == order.len() {
                break;
            }
            watch.tick(work)?;
            *left = left.saturating_sub(work);
            if *left == 0 {
                break;
            }
            stands = if self.sift(vertex, &mut order, &mut position) { 0 } else { stands + 1 };
        }
        Ok(order)
    }

    /// Moves one vertex to where the sum of the spans is least; whether that is less than it was.
    fn sift(&self, vertex: u32, order: &mut Order, position: &mut [usize]) -> bool {
        let Some(before) = order.iter().position(|&each| each == vertex) else { return false };
        order.remove(before);
        order.iter().enumerate().for_each(|(at, &each)| position[each as usize] = at);
        // What a gap adds to the joins that go over it, by differences, and the spans of its own, by differences of those.
        let (mut over, mut bends) = (vec![0_i64; order.len() + 2], vec![0_i64; order.len() + 2]);
        let mut cost = 0;
        for (ends, count) in &self.joins {
            let others = ends.iter().filter(|&&end| end != vertex).map(|&end| position[end as usize]);
            let (low, high) = others.fold((usize::MAX, 0), |(low, high), at| (low.min(at), high.max(at)));
            let count = *count as i64;
            if low == usize::MAX {
                continue;
            }
            if ends.contains(&vertex) {
                // It grows to either side of the others, and is the same among them.
                cost += count * (high as i64 + 1);
                bends[0] -= count;
                bends[low] += count;
                bends[high + 1] += count;
            } else {
                over[low + 1] += count;
                over[high + 1] -= count;
            }
        }
        let mut slope = 0;
        let costs: Vec<i64> = (0..=order.len())
            .map(|gap| {
                cost += over[gap];
                let here = cost;
                slope += bends[gap];
                cost += slope;
                here
            })
            .collect();
        let best = (0..costs.len()).min_by_key(|&gap| (costs[gap], gap.abs_diff(before))).unwrap_or(before);
        order.insert(best, vertex);
        costs[best] < costs[before]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::samples::wanderers;

    fn watched<T>(work: impl FnOnce(&mut Watch<'_>) -> Result<T, Stop>) -> T {
        let mut poll = unwatched;
        work(&mut Watch::new(None, &mut poll)).unwrap_or_else(|stop| panic!("{stop:?}"))
    }

    /// Robots of so many steps in a row, of which each hands over to the next one in its last step; step `k` of robot `r`
    /// is place `k * robots + r`.
    fn row(robots: u32, steps: u32) -> (usize, Vec<Transition>, Vec<u32>) {
        let at = |robot: u32, step: u32| step % steps * robots + robot;
        let alone = |robot: u32, step: u32| Transition::new(&[at(robot, step)], &[at(robot, step + 1)], &[], &[], &[]);
        let both = |robot: u32| {
            let (last, next) = (at(robot, steps - 1), at(robot + 1, 0));
            Transition::new(&[last, next], &[at(robot, 0), at(robot + 1, 1)], &[], &[], &[])
        };
        let moves = (0..robots).flat_map(|robot| (1..steps - 1).map(move |step| alone(robot, step)));
        let begins = Transition::new(&[at(0, 0)], &[at(0, 1)], &[], &[], &[]);
        let ends = Transition::new(&[at(robots - 1, steps - 1)], &[at(robots - 1, 0)], &[], &[], &[]);
        let transitions = moves.chain((0..robots - 1).map(both)).chain([begins, ends]).collect();
        ((robots * steps) as usize, transitions, (0..robots).collect())
    }

    #[test]
    fn the_steps_of_a_robot_are_a_unit_and_robots_that_hand_over_stand_side_by_side() {
        let (places, transitions, initial) = row(12, 5);
        let found = watched(|watch| units(places, &transitions, &initial, JOINS_MAX, watch)).expect("few units");
        let steps = |robot: u32| (0..5).map(|step| step * 12 + robot).collect::<Vec<u32>>();
        assert_eq!(found, (0..12).map(steps).collect::<Vec<_>>());
        let [order, back] = watched(|watch| by_unit(places, &transitions, &initial, watch)).expect("few units");
        assert!(order.iter().eq(back.iter().rev()));
        let robots: Vec<u32> = order.chunks(5).map(|unit| unit[0] % 12).collect();
        assert!(order.chunks(5).zip(&robots).all(|(unit, &robot)| unit == steps(robot)));
        assert!(robots.is_sorted() || robots.iter().rev().is_sorted(), "{robots:?}");
    }

    #[test]
    fn what_a_unit_is_joined_by_are_the_arcs_of_all_its_places() {
        // 2 comes of 0 or 1 together with 3, and goes back to 0: it is joined by more to 3 than to each of them.
        let some =
            |count, inputs: &[u32], outputs: &[u32]| vec![Transition::new(inputs, outputs, &[], &[], &[]); count];
        let transitions =
            [some(5, &[0], &[1]), some(4, &[0, 3], &[2]), some(4, &[1, 3], &[2]), some(1, &[2], &[0])].concat();
        let found = watched(|watch| units(4, &transitions, &[0, 3], JOINS_MAX, watch));
        assert_eq!(found, Some(vec![vec![0, 1, 2], vec![3]]));
    }

    #[test]
    fn of_places_that_are_marked_together_nothing_is_a_unit() {
        let forks: Vec<Transition> =
            (0..8).map(|at| Transition::new(&[3 * at], &[3 * at + 1, 3 * at + 2], &[], &[], &[])).collect();
        let initial: Vec<u32> = (0..8).map(|at| 3 * at).collect();
        let found = watched(|watch| units(24, &forks, &initial, JOINS_MAX, watch)).expect("two for three");
        assert!(found.iter().all(|unit| unit.len() < 3) && found.len() == 16, "{found:?}");
        let apart: Vec<Transition> = (0..8).map(|at| Transition::new(&[at], &[], &[], &[], &[])).collect();
        let initial: Vec<u32> = (0..8).collect();
        assert_eq!(watched(|watch| units(8, &apart, &initial, JOINS_MAX, watch)), None);
        assert_eq!(watched(|watch| by_unit(8, &apart, &initial, watch)), None);
    }

    #[test]
    fn units_that_would_take_too_long_are_not_made() {
        let (places, transitions, initial) = row(12, 5);
        let mut least = 0; // a join for each arc to another one, and more where units with joins come together
        while watched(|watch| units(places, &transitions, &initial, least, watch)).is_none() {
            least += 1;
        }
        let arcs: usize = transitions.iter().map(|each| each.inputs.len() * each.outputs.len()).sum();
        assert!(arcs < least && least < 3 * arcs, "{least} for {arcs}");
    }

    /// The sum of the spans, as anybody would count it.
    fn sum(joins: &[Transition], order: &[u32]) -> usize {
        let position = |vertex: &u32| order.iter().position(|each| each == vertex).expect("in the order");
        let span = |join: &Transition| {
            let at: Vec<usize> = join.inputs.iter().map(position).collect();
            at.iter().max().zip(at.iter().min()).map_or(0, |(high, low)| high - low)
        };
        joins.iter().map(span).sum()
    }

    #[test]
    fn sifting_leaves_no_vertex_that_could_be_moved_for_less_and_each_move_is_the_best() {
        for seed in 0..30 {
            let mut random = Random::new(seed);
            let joins: Vec<Transition> = (0..20)
                .map(|_| Transition::new(&[(); 3].map(|()| random.below(12) as u32), &[], &[], &[], &[]))
                .collect();
            let spans = Spans::new(&joins);
            let mut order: Order = (0..12).collect();
            let least = |vertex: u32, order: &[u32]| {
                let rest: Vec<u32> = order.iter().copied().filter(|&each| each != vertex).collect();
                let at = |gap: usize| [&rest[..gap], &[vertex], &rest[gap..]].concat();
                (0..=rest.len()).map(|gap| sum(&joins, &at(gap))).min().expect("a gap")
            };
            let mut position = vec![0; 12];
            for vertex in 0..12 {
                let (before, best) = (sum(&joins, &order), least(vertex, &order));
                assert_eq!(spans.sift(vertex, &mut order, &mut position), best < before);
                assert_eq!(sum(&joins, &order), best);
            }
            let mut left = WORK_MAX;
            let order = watched(|watch| spans.sifted(order, &mut left, watch));
            assert!((0..12).all(|vertex| least(vertex, &order) == sum(&joins, &order)) && 0 < left);
            let (mut left, start) = (1, vec![11, 0, 10, 1, 9, 2, 8, 3, 7, 4, 6, 5]);
            assert_eq!((watched(|watch| spans.sifted(start.clone(), &mut left, watch)), left), (start, 0));
        }
    }

    #[test]
    fn the_watch_ends_the_making_of_units_and_of_their_order() {
        let net = wanderers(40);
        let initial: Vec<u32> = (0..40).collect();
        let polls_of = |last: usize, work: &dyn Fn(&mut Watch<'_>) -> Result<(), Stop>| {
            let mut polls = 0;
            let mut poll = |_| {
                polls += 1;
                if polls > last { Err(Stop::Cancelled) } else { Ok(()) }
            };
            let ended = work(&mut Watch::often(None, &mut poll));
            (ended, polls)
        };
        let make = |watch: &mut Watch<'_>| units(400, &net.transitions, &initial, JOINS_MAX, watch).map(|_| ());
        let order = |watch: &mut Watch<'_>| by_unit(400, &net.transitions, &initial, watch).map(|_| ());
        let [of_units, of_all] =
            [&make as &dyn Fn(&mut Watch<'_>) -> Result<(), Stop>, &order].map(|work| polls_of(usize::MAX, work).1);
        assert!(0 < of_units && of_units < of_all, "{of_units} of {of_all}");
        for last in 0..of_all {
            assert_eq!(polls_of(last, &order), (Err(Stop::Cancelled), last + 1));
        }
    }
}
