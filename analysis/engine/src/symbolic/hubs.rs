//! Hubs: a resource and all who may hold it stand together, and the hubs alone are put in order.
//!
//! Vehicles that share zones, jobs that share machines: the file keeps together what belongs to a vehicle, and the shortest
//! arcs keep together what belongs to a zone, but with the vehicles in another order at each one. Then the diagram
//! remembers in many ways who has been met already, which no sum of spans sees. Here each hub has its places in the
//! same order, and the resource itself above them. Who holds a resource takes part in no firing without it, which shows in
//! the arcs alone; the rejected alternative, place invariants, finds the same hubs by linear algebra.

use super::order::{Graph, Order, joined};
use crate::net::Transition;

/// The transitions of a place beyond which no hub is looked for.
const HUB_DEGREE: usize = 64;

impl Graph {
    /// The places by the hubs they keep to, each hub above its own places, which stand in the order of the net; twice, with
    /// the hubs in both directions.
    ///
    /// A place keeps to another one that takes part in all its transitions, and in more. A resource and those who may
    /// hold it are so, whatever else joins them; the hubs, numbered on their own, have the order of the plant.
    pub(super) fn by_hub(&self, transitions: &[Transition]) -> Option<[Order; 2]> {
        let hub_of: Vec<u32> = (0..self.places as u32)
            .map(|place| {
                let own = self.next_to(place);
                let ends = |t: u32| self.next_to(t).iter().copied();
                let wider = |&other: &u32| {
                    self.degree(other) > own.len() && own.iter().all(|&t| self.next_to(t).contains(&other))
                };
                let least = own.iter().min_by_key(|&&t| self.degree(t)).filter(|_| own.len() <= HUB_DEGREE);
                let hubs = least.into_iter().flat_map(|&t| ends(t)).filter(wider);
                hubs.max_by_key(|&other| (self.degree(other), std::cmp::Reverse(other))).unwrap_or(place)
            })
            .collect();
        let hub = |mut place: u32| {
            while hub_of[place as usize] != place {
                place = hub_of[place as usize]; // of a higher degree each time
            }
            place
        };
        let mut members: Vec<Vec<u32>> = vec![Vec::new(); self.places];
        for place in (0..self.places as u32).filter(|&place| hub_of[place as usize] != place) {
            members[hub(place) as usize].push(place);
        }
        if members.iter().all(Vec::is_empty) {
            return None;
        }
        let joined_hubs: Vec<Transition> = transitions
            .iter()
            .map(|transition| {
                let mut hubs: Vec<u32> = joined(transition).map(hub).collect();
                hubs.sort_unstable();
                hubs.dedup();
                Transition::new(&hubs, &[], &[], &[], &[])
            })
            .collect();
        let coarse = Graph::new(self.places, &joined_hubs);
        let hubs = coarse.slide(coarse.force(coarse.sloan()));
        let whole: Order = hubs.into_iter().filter(|&place| hub_of[place as usize] == place).collect();
        let with_members = |hub: &u32| members[*hub as usize].iter().copied().chain(std::iter::once(*hub)).collect();
        let up: Vec<Order> = whole.iter().map(with_members).collect();
        Some([up.concat(), up.into_iter().rev().collect::<Vec<Order>>().concat()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_may_hold_a_resource_stands_below_it_in_one_order() {
        // Resources 0 to 3 in a ring; holder 0 of each is place 4 to 7, holder 1 is 8 to 11. In a row, the resource at an
        // end would have no more transitions than its holders.
        let moves = |holder: u32, from: u32, to: u32| {
            Transition::new(&[holder + from, to], &[holder + to, from], &[], &[], &[])
        };
        let transitions: Vec<Transition> =
            (0..4).flat_map(|at| [4, 8].map(|holder| moves(holder, at, (at + 1) % 4))).collect();
        let [up, down] = Graph::new(12, &transitions).by_hub(&transitions).unwrap();
        assert!(up.chunks(3).all(|hub| *hub == [hub[2] + 4, hub[2] + 8, hub[2]]));
        assert!(up.chunks(3).eq(down.rchunks(3)));
        let chain = [Transition::new(&[0], &[1], &[], &[], &[]), Transition::new(&[1], &[0], &[], &[], &[])];
        assert!(Graph::new(2, &chain).by_hub(&chain).is_none());
    }
}
