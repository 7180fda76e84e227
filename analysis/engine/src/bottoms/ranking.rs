//! Which transitions go down, in an order of all markings that is chosen for the net.
//!
//! Order the places by their weight, and compare two markings at the heaviest place where they differ: the lower one is
//! the one that agrees there with M0. A firing changes the same places wherever it happens, so it always goes down or
//! always goes up: down if it gives the heaviest of its places back what M0 has there. So no marking need be looked at to
//! know, M0 is below all others, and every sequence of firings that go down ends.
//!
//! Good is an order in which nearly every marking has a firing that goes down. Finding the best one is to find the least
//! set of arcs that breaks all cycles, so the order is made greedily, from the heaviest place on: a place that only gives
//! back costs nothing and is taken at once; else that place whose choice loses the fewest transitions for those that it
//! gains, with all places that are then free.
//!
//! Rejected: to count the edges of each transition (16 philosophers then all give up the wrong place, and one marking in
//! twenty has no firing that goes down instead of two of all).

use crate::marking::holds;
use crate::net::Net;

/// How many of the open transitions that change a place would go down by it, and up.
#[derive(Clone, Copy, Default)]
struct Weights {
    downs: u32,
    ups: u32,
}

/// The order in the making.
struct Order {
    /// For each place the transitions that change it, and whether they give it back what M0 has.
    at: Vec<Vec<(u32, bool)>>,
    /// For each transition the same, by place.
    of: Vec<Vec<(u32, bool)>>,
    /// Whether a transition is neither up nor down yet.
    open: Vec<bool>,
    weights: Vec<Weights>,
    /// Places that only give back.
    free: Vec<u32>,
    /// The transitions that went down and those that went up, in the order in which that was settled.
    settled: Vec<(u32, bool)>,
    /// Steps of work done.
    work: usize,
}

impl Order {
    fn new(net: &Net, fired: &[u64]) -> Self {
        let mut order = Order {
            at: vec![Vec::new(); net.places],
            of: vec![Vec::new(); net.transitions.len()],
            open: fired.iter().map(|&edges| edges > 0).collect(),
            weights: vec![Weights::default(); net.places],
            free: Vec::new(),
            settled: Vec::new(),
            work: 0,
        };
        for (t, transition) in net.transitions.iter().enumerate().filter(|&(t, _)| fired[t] > 0) {
            let emptied = transition.inputs.iter().map(|&p| (p, !holds(&net.initial, p)));
            let filled = transition.outputs.iter().map(|&p| (p, holds(&net.initial, p)));
            order.of[t] = emptied.chain(filled).collect();
            for &(p, back) in &order.of[t] {
                order.at[p as usize].push((t as u32, back));
            }
            order.weigh(t, 1);
        }
        order
    }

    /// Adds an open transition to the weights of its places (`sign` 1), or takes it away (-1).
    fn weigh(&mut self, t: usize, sign: i32) {
        for &(p, back) in &self.of[t] {
            let weights = &mut self.weights[p as usize];
            let count = if back { &mut weights.downs } else { &mut weights.ups };
            *count = count.wrapping_add_signed(sign);
            if weights.ups == 0 && weights.downs > 0 {
                self.free.push(p);
            }
        }
        self.work += self.of[t].len();
    }

    /// Takes a place as the next heaviest, and after it all that are free.
    fn take(&mut self, place: u32) {
        self.free.clear();
        self.free.push(place);
        while let Some(p) = self.free.pop() {
            let mut transitions = std::mem::take(&mut self.at[p as usize]);
            for &mut (t, down) in &mut transitions {
                if std::mem::replace(&mut self.open[t as usize], false) {
                    self.settled.push((t, down));
                    self.weigh(t as usize, -1);
                }
            }
            self.work += 1 + transitions.len();
            self.at[p as usize] = transitions;
        }
    }

    /// Opens again what was settled from some number on; how many were lost by it, and how many gained.
    fn undo(&mut self, from: usize) -> (usize, usize) {
        let (mut lost, mut gained) = (0, 0);
        while self.settled.len() > from {
            let Some((t, down)) = self.settled.pop() else { break };
            self.open[t as usize] = true;
            self.weigh(t as usize, 1);
            *(if down { &mut gained } else { &mut lost }) += 1;
        }
        (lost, gained)
    }

    /// The place whose choice loses least for what it gains, or none that gains anything; or so much work is done.
    fn best(&mut self, most: usize) -> Option<u32> {
        let mut best: Option<(usize, usize, u32)> = None;
        let from = self.settled.len();
        for p in 0..self.at.len() as u32 {
            if self.weights[p as usize].downs == 0 || self.work > most {
                continue;
            }
            self.take(p);
            let (lost, gained) = self.undo(from);
            if best.is_none_or(|(least, most, _)| lost * most < least * gained) {
                best = Some((lost, gained, p));
            }
        }
        best.map(|(_, _, p)| p)
    }
}

/// The transitions that go down, those that fire at the most markings first; none where to choose them is more than so
/// much work.
pub(super) fn downs(net: &Net, fired: &[u64], most: usize) -> Option<Vec<u32>> {
    let mut order = Order::new(net, fired);
    let free = std::mem::take(&mut order.free);
    for p in free {
        if order.weights[p as usize].ups == 0 {
            order.take(p);
        }
    }
    while let Some(p) = order.best(most) {
        order.take(p);
    }
    if order.work > most {
        return None;
    }
    let mut downs: Vec<u32> = order.settled.iter().filter(|&&(_, down)| down).map(|&(t, _)| t).collect();
    downs.sort_by_key(|&t| (std::cmp::Reverse(fired[t as usize]), t));
    Some(downs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::{machines, random_spaces, slotted_ring};

    #[test]
    fn every_sequence_of_firings_that_go_down_ends_and_m0_has_none() {
        let mut some = 0;
        for space in random_spaces(250, false) {
            let downs = downs(&space.net, &space.fired, 1 << 20).expect("little work");
            let (words, mut state) = (space.net.words, vec![0_u8; space.len()]);
            let below = |index: usize| -> Vec<usize> {
                let enabled = space.enabled_by(&space.net.forward, space.marking(index));
                let fire = enabled.into_iter().filter(|t| downs.contains(t)).map(|t| {
                    let flip = space.net.flip(t as usize, words);
                    let after: Vec<u64> = space.marking(index).iter().zip(flip).map(|(a, b)| a ^ b).collect();
                    space.find(&after).expect("reached") as usize
                });
                fire.collect()
            };
            assert!(below(0).is_empty());
            // Depth first: a marking that is met again while it is open is on a cycle.
            for root in 0..space.len() {
                if state[root] == 2 {
                    continue;
                }
                let mut path = vec![(root, below(root))];
                while let Some((index, rest)) = path.last_mut() {
                    state[*index] = 1;
                    let Some(next) = rest.pop() else {
                        state[*index] = 2;
                        path.pop();
                        continue;
                    };
                    assert_ne!(state[next], 1, "a cycle");
                    if state[next] == 0 {
                        path.push((next, below(next)));
                    }
                }
            }
            some += usize::from(downs.len() > 2);
        }
        assert!(some > 100);
    }

    #[test]
    fn few_transitions_go_up_and_an_order_that_takes_too_long_is_none() {
        let net = machines(5, 0);
        assert_eq!(downs(&net, &[1; 10], 1000), Some(vec![1, 3, 5, 7, 9]));
        assert_eq!(downs(&slotted_ring(3), &[1; 24], 100_000).map(|downs| downs.len()), Some(20));
        assert_eq!(downs(&net, &[1; 10], 10), None);
    }
}
