//! Orders of places: which place gets which level.
//!
//! The size of a diagram depends on the order as on nothing else. A good order keeps together the places that a
//! transition joins, so that little has to be remembered from one level to the next. Finding the best is intractable;
//! what works on nets (Rudell's sifting costs more than the search itself) is to make the arcs short:
//!
//! - *Sloan* numbers the graph of places and transitions from one end to the other, holding the front small (Sloan
//!   1986); *reverse Cuthill-McKee* does so by distance from one end alone, and wins on some nets.
//! - *FORCE* then moves each place to the middle of its transitions, again and again (Aloul, Markov, Sakallah 2003), as
//!   long as the sum of the spans falls and some tens of times at most: it converges slowly and at its end hardly.
//! - Last, each place *slides* along the order to where the spans are least: FORCE ends with places that have changed
//!   sides with their neighbours, and a ring whose nodes are in such disorder takes four times the time. It is left
//!   out of nets so long that it would take longer than it saves.
//!
//! All of these go by what is next to a place. Where a net is a chain of many parts that are alike, they fold some parts
//! into each other; the *spectral* order, along the slowest vibration of the net, lays it out as a whole, and slides as
//! well.
//!
//! Beside them, a resource and all who may hold it are kept together as one *hub*, and the hubs alone are put in order:
//! each hub then remembers who holds it in the same way, which matters more than spans, and which no sum of them sees.
//!
//! The order that the net came in is a candidate too, since who wrote or generated a net often kept together what
//! belongs together, even where its arcs are three times as long as the best; and so is what it slides to, where places
//! may also *sink* past others at no cost if that makes the arcs shorter in the end. Every order has two directions, which
//! cost the same by any measure of spans and differ by orders of magnitude in the search; so both are given, and raced.

use std::panic::resume_unwind;
use std::thread;

use crate::budget::{Stop, Watch};
use crate::net::Transition;

pub(super) const FORCE_ROUNDS: usize = 40;
/// The arcs that all rounds of FORCE together may visit.
const FORCE_WORK: usize = 40_000_000;

/// How far a place may slide, and the arcs that all sliding may visit.
const WINDOW: usize = 12;
const SLIDING_WORK: usize = 10_000_000;

/// The work between two looks at the clock, or more.
const BETWEEN: usize = 1 << 16;

/// An order: the places from the lowest level to the highest.
pub type Order = Vec<u32>;

/// The graph of places (first) and transitions, joined by arcs and gates.
pub(super) struct Graph {
    pub(super) places: usize,
    offsets: Vec<u32>,
    ends: Vec<u32>,
}

pub(super) fn joined(transition: &Transition) -> impl Iterator<Item = u32> + '_ {
    [&transition.inputs, &transition.outputs, &transition.permissive, &transition.inhibitive]
        .into_iter()
        .flatten()
        .copied()
}

impl Graph {
    pub(super) fn new(places: usize, transitions: &[Transition]) -> Self {
        let vertices = places + transitions.len();
        let edges = || {
            transitions
                .iter()
                .enumerate()
                .flat_map(|(t, transition)| joined(transition).map(move |place| (place as usize, places + t)))
        };
        let mut offsets = vec![0; vertices + 1];
        edges().for_each(|(place, t)| {
            offsets[place + 1] += 1;
            offsets[t + 1] += 1;
        });
        for at in 0..vertices {
            offsets[at + 1] += offsets[at];
        }
        let mut ends = vec![0; offsets[vertices] as usize];
        let mut next = offsets.clone();
        edges().for_each(|(place, t)| {
            for (from, to) in [(place, t), (t, place)] {
                ends[next[from] as usize] = to as u32;
                next[from] += 1;
            }
        });
        Graph { places, offsets, ends }
    }

    pub(super) fn vertices(&self) -> usize {
        self.offsets.len() - 1
    }

    pub(super) fn next_to(&self, vertex: u32) -> &[u32] {
        &self.ends[self.offsets[vertex as usize] as usize..self.offsets[vertex as usize + 1] as usize]
    }

    pub(super) fn degree(&self, vertex: u32) -> usize {
        self.next_to(vertex).len()
    }

    /// The sum over the transitions of how far apart their places lie.
    pub(super) fn span(&self, order: &[u32]) -> u64 {
        let mut position = vec![0.0; self.vertices()];
        order.iter().enumerate().for_each(|(at, &place)| position[place as usize] = at as f64);
        self.pull_transitions(&mut position)
    }

    /// Moves each transition to the middle of its places; the sum over the transitions of how far apart those lie.
    fn pull_transitions(&self, position: &mut [f64]) -> u64 {
        let mut span = 0;
        for t in self.places..self.vertices() {
            let ends = self.next_to(t as u32);
            let (mut sum, mut least, mut most) = (0.0, f64::MAX, 0.0);
            for &place in ends {
                let own = position[place as usize];
                sum += own;
                least = if own < least { own } else { least };
                most = if own > most { own } else { most };
            }
            position[t] = sum / ends.len() as f64;
            span += if ends.is_empty() { 0 } else { u64::from((most - least) as u32) };
        }
        span
    }

    /// The same of each place, to the middle of its transitions.
    fn pull_places(&self, position: &mut [f64]) {
        for place in (0..self.places).filter(|&place| self.degree(place as u32) > 0) {
            let ends = self.next_to(place as u32);
            position[place] = ends.iter().map(|&end| position[end as usize]).sum::<f64>() / ends.len() as f64;
        }
    }

    pub(super) fn force(&self, order: Order) -> Order {
        let mut position: Vec<f64> = vec![0.0; self.vertices()];
        let rounds = (FORCE_WORK / (self.ends.len() + self.vertices() + 1)).clamp(2, FORCE_ROUNDS);
        let (mut best_span, mut best, mut current) = (u64::MAX, Order::new(), order);
        let (mut worse, mut sorted) = (0, Order::new());
        for round in 0..=rounds {
            current.iter().enumerate().for_each(|(at, &place)| position[place as usize] = at as f64);
            let span = self.pull_transitions(&mut position); // of the order as it is
            if span < best_span {
                (best_span, worse) = (span, 0);
                best.clone_from(&current);
            } else {
                worse += 1;
            }
            if worse == 3 || round == rounds {
                break;
            }
            self.pull_places(&mut position);
            sort_by_position(&current, &position, &mut sorted);
            std::mem::swap(&mut current, &mut sorted);
        }
        best
    }

    /// What exchanging the places at a position and the next one adds to the sum of the spans.
    fn exchange(&self, order: &[u32], level: &[u32], at: usize) -> i64 {
        let (low, high) = (order[at], order[at + 1]);
        let mut added = 0;
        for (place, other, up) in [(low, high, 1), (high, low, -1)] {
            let own = level[place as usize];
            for &t in self.next_to(place) {
                let ends = self.next_to(t);
                if !ends.contains(&other) {
                    let least = ends.iter().all(|&end| level[end as usize] >= own);
                    let most = ends.iter().all(|&end| level[end as usize] <= own);
                    added += up * (i64::from(most) - i64::from(least));
                }
            }
        }
        added
    }

    /// An order whose arcs are made shorter as long as that goes.
    fn shortened(&self, order: Order) -> Order {
        self.slide(self.force(order))
    }

    pub(super) fn slide(&self, order: Order) -> Order {
        self.slid(order, false)
    }

    /// The same, by way of places that also go down as far as that costs nothing, where the arcs come out shorter.
    ///
    /// Places that have slid stand fast where each alone costs something to move. Some that go down clear the way for
    /// others; but what a place gains nothing by may be what the order knew, so it is left where the sum stays the same.
    fn sink(&self, order: Order) -> Order {
        let [slid, sunk] = [false, true].map(|sinking| self.slid(order.clone(), sinking));
        if self.span(&sunk) < self.span(&slid) { sunk } else { slid }
    }

    fn slid(&self, mut order: Order, sinking: bool) -> Order {
        let ends = (self.places..self.vertices()).map(|t| self.degree(t as u32).pow(2)).sum::<usize>();
        let mut level = vec![0_u32; self.places];
        order.iter().enumerate().for_each(|(at, &place)| level[place as usize] = at as u32);
        let exchanged = |order: &mut Order, level: &mut [u32], at: usize| {
            order.swap(at, at + 1);
            level[order[at] as usize] = at as u32;
            level[order[at + 1] as usize] = at as u32 + 1;
        };
        for _ in 0..(SLIDING_WORK / (4 * WINDOW * ends + 1)).min(FORCE_ROUNDS) {
            let mut better = false;
            for place in 0..self.places {
                for up in [false, true] {
                    let start = level[place] as usize;
                    let (mut at, mut added, mut best, mut stop) = (start, 0, 0, start);
                    while at.abs_diff(start) < WINDOW && (if up { at + 1 < order.len() } else { at > 0 }) {
                        let lower = if up { at } else { at - 1 };
                        added += self.exchange(&order, &level, lower);
                        exchanged(&mut order, &mut level, lower);
                        at = if up { at + 1 } else { at - 1 };
                        if added < best || sinking && !up && added == best {
                            (best, stop) = (added, at);
                        }
                    }
                    while at != stop {
                        at = if up { at - 1 } else { at + 1 };
                        exchanged(&mut order, &mut level, if up { at } else { at - 1 });
                    }
                    better |= best < 0;
                }
            }
            if !better {
                break;
            }
        }
        order
    }
}

/// Puts places in the order of their positions, those at the same one as they were; positions lie within the order.
///
/// By their whole parts first: positions are spread over the order, so that few places have one in common.
fn sort_by_position(order: &[u32], position: &[f64], sorted: &mut Order) {
    let whole = |place: u32| position[place as usize] as u32 as usize;
    let mut starts = vec![0_u32; order.len() + 1];
    order.iter().for_each(|&place| starts[whole(place) + 1] += 1);
    for at in 0..order.len() {
        starts[at + 1] += starts[at];
    }
    sorted.resize(order.len(), 0);
    let mut next = starts.clone();
    for &place in order {
        let at = &mut next[whole(place)];
        sorted[*at as usize] = place;
        *at += 1;
    }
    for range in starts.windows(2).filter(|range| range[1] - range[0] > 1) {
        let same = &mut sorted[range[0] as usize..range[1] as usize];
        same.sort_by(|&a, &b| position[a as usize].total_cmp(&position[b as usize]));
    }
}

/// What two pieces of work come to, one of them by a second thread where that is free and the system has it to give.
fn of_both<A, B: Send>(second: bool, one: impl FnOnce() -> A, other: impl Fn() -> B + Sync) -> (A, B) {
    let other = &other;
    thread::scope(|scope| {
        let beside = if second { thread::Builder::new().spawn_scoped(scope, other).ok() } else { None };
        let one = one();
        let joined = beside.map(|beside| beside.join().unwrap_or_else(|panic| resume_unwind(panic)));
        (one, joined.unwrap_or_else(other))
    })
}

/// The making of orders: one first, with which most nets are done, and the others when it is seen that this one is not.
pub(super) struct Candidates {
    graph: Graph,
    sloan: Order,
}

impl Candidates {
    pub(super) fn new(places: usize, transitions: &[Transition], watch: &mut Watch<'_>) -> Result<Self, Stop> {
        watch.tick(BETWEEN)?;
        let graph = Graph::new(places, transitions);
        let sloan = graph.shortened(graph.sloan());
        Ok(Candidates { graph, sloan })
    }

    /// The first order and its reverse.
    pub(super) fn first(&self) -> [Order; 2] {
        both(self.sloan.clone())
    }

    /// Orders worth trying, those with the shorter arcs first, each followed by its reverse.
    ///
    /// The watch is asked between two of them, each of which has work of its own that is bounded.
    pub(super) fn all(self, transitions: &[Transition], watch: &mut Watch<'_>) -> Result<Vec<Order>, Stop> {
        let Candidates { graph, sloan } = self;
        let as_given: Order = (0..graph.places as u32).collect();
        let span = |pair: &[Order; 2]| graph.span(&pair[0]);
        watch.tick(BETWEEN)?;
        let (given, (cuthill_mckee, hubs)) = of_both(
            watch.second_is_free(),
            || [graph.sink(as_given.clone()), as_given].map(both),
            || (both(graph.shortened(graph.cuthill_mckee())), graph.by_hub(transitions)),
        );
        watch.tick(BETWEEN)?;
        let mut found = vec![both(sloan), cuthill_mckee];
        let best = found.iter().min_by_key(|pair| span(pair)).map(|pair| &pair[0]);
        let spectral = best.map(|best| graph.spectral(best, watch)).transpose()?.flatten();
        let spectral = spectral.map(|order| both(graph.slide(order)));
        watch.tick(BETWEEN)?;
        if let Some(hubs) = hubs {
            // Where the hubs give the shorter arcs, what was found is as good but for disorder within the hubs.
            if found.iter().all(|pair| span(&hubs) < span(pair)) {
                found.clear();
            }
            found.push(hubs);
        }
        found.extend(given.into_iter().chain(spectral));
        found.sort_by_cached_key(span);
        let mut distinct: Vec<[Order; 2]> = Vec::new();
        for pair in found {
            if !distinct.iter().any(|other| other.contains(&pair[0])) {
                distinct.push(pair);
            }
        }
        Ok(distinct.into_iter().flatten().collect())
    }
}

/// An order and its reverse.
pub(super) fn both(order: Order) -> [Order; 2] {
    [order.clone(), order.into_iter().rev().collect()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::samples::slotted_ring;

    #[test]
    fn places_at_one_position_stay_as_they_were() {
        let order: Order = (0..40).map(|at| at * 7 % 40).collect();
        for spread in [0.0, 0.25, 0.9] {
            let position: Vec<f64> = (0..40).map(|place| f64::from(place * 11 % 13) * spread + 5.5).collect();
            let mut wanted = order.clone();
            wanted.sort_by(|&a, &b| position[a as usize].total_cmp(&position[b as usize]));
            let mut sorted = Order::new();
            sort_by_position(&order, &position, &mut sorted);
            assert_eq!(sorted, wanted);
        }
    }

    fn made(places: usize, transitions: &[Transition]) -> Vec<Order> {
        let mut poll = unwatched;
        let watch = &mut Watch::new(None, &mut poll);
        Candidates::new(places, transitions, watch).and_then(|made| made.all(transitions, watch)).unwrap()
    }

    #[test]
    fn the_making_of_orders_ends_in_time() {
        let transitions = ring(1000);
        let mut polls = 0;
        let mut poll = |_| {
            polls += 1;
            Err(Stop::Cancelled)
        };
        let stopped = Candidates::new(1000, &transitions, &mut Watch::new(None, &mut poll)).map(|_| ());
        assert_eq!((stopped, polls), (Err(Stop::Cancelled), 1));
        for last in 1..4 {
            let mut polls = 0;
            let mut poll = |_| {
                polls += 1;
                if polls > last { Err(Stop::Cancelled) } else { Ok(()) }
            };
            let watch = &mut Watch::often(None, &mut poll);
            let stopped = Candidates::new(1000, &transitions, watch).and_then(|made| made.all(&transitions, watch));
            assert_eq!((stopped, polls), (Err(Stop::Cancelled), last + 1));
        }
    }

    fn ring(n: u32) -> Vec<Transition> {
        // Places far apart in number are neighbours in the ring.
        let place = |at: u32| at % n * 7 % n;
        (0..n).map(|at| Transition::new(&[place(at)], &[place(at + 1)], &[], &[], &[])).collect()
    }

    #[test]
    fn every_candidate_is_a_permutation() {
        let mut transitions = ring(20);
        transitions.push(Transition::default());
        for order in made(25, &transitions) {
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, (0..25).collect::<Vec<u32>>());
        }
        assert_eq!(made(0, &[]), vec![Vec::<u32>::new(); 2]);
    }

    #[test]
    fn sliding_never_lengthens_the_arcs_and_counts_what_an_exchange_adds() {
        let (n, transitions) = (30, ring(30));
        let graph = Graph::new(n, &transitions);
        let order: Order = (0..n as u32).map(|place| place * 11 % n as u32).collect();
        let mut level = vec![0; n];
        order.iter().enumerate().for_each(|(at, &place)| level[place as usize] = at as u32);
        for at in 0..n - 1 {
            let mut after = order.clone();
            after.swap(at, at + 1);
            let added = graph.span(&after) as i64 - graph.span(&order) as i64;
            assert_eq!(graph.exchange(&order, &level, at), added);
        }
        assert!(graph.span(&graph.slide(order.clone())) < graph.span(&order));
    }

    #[test]
    fn places_sink_past_others_where_that_makes_the_arcs_shorter_and_stay_where_it_does_not() {
        let net = slotted_ring(20);
        let graph = Graph::new(net.places, &net.transitions);
        let given: Order = (0..net.places as u32).collect();
        let (slid, sunk) = (graph.slide(given.clone()), graph.sink(given));
        assert_eq!((graph.span(&slid), graph.span(&sunk)), (859, 823));
        // Where no order is shorter, a place that could go down stays.
        let pair = [Transition::new(&[0], &[2], &[], &[], &[]), Transition::new(&[1], &[2], &[], &[], &[])];
        assert_eq!(Graph::new(3, &pair).sink(vec![0, 2, 1]), [0, 2, 1]);
    }

    #[test]
    fn a_shuffled_ring_is_laid_out_along_itself() {
        let (n, transitions) = (1000, ring(1000));
        let graph = Graph::new(n, &transitions);
        let given: Order = (0..n as u32).collect();
        assert!(graph.span(&made(n, &transitions)[0]) <= 2 * n as u64);
        assert!(graph.span(&given) > 10 * n as u64);
    }
}
