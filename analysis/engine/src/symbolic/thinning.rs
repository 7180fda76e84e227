//! Who drops out of the race of orders.
//!
//! On nets of the model-checking contest the winner is as often the search with the most nodes after the first rounds as
//! the one with the fewest. So half drop out of a round, by three measures in turn, until two are left. Which of them is
//! the first is said once: to change it whenever the other seems to get on better means to pay for both. The order that
//! the net came in is spared for some rounds beside these, as what its author knew shows in no measure. The one with the
//! shortest arcs, from either end, stays to the end: on a chain of parts every search seems to be nearly done all the
//! time, and nothing else tells that it is the one that will be. The rejected alternative, to go by the levels done alone,
//! drops most winners early. Orders by units take no part in this: no measure shows that they win.
//!
//! The candidates come as an order and its reverse. Where the direction matters, it soon shows, and then it is everything;
//! where it does not, the two are *twins*: the net looks the same from both ends, and one search says what the other
//! would. Two ways to lay a ring out are twins as well, and so are two orders that have other places of the same block
//! above: the search goes by blocks, so it fires the same, and in one of them more nodes say what it finds. So where two
//! stand at the same level after as many firings, the one with more nodes drops out. The rejected alternative, to go by
//! the nodes, takes two rounds to be sure, and keeps orders that differ in nothing but them.

use super::racer::Racer;

/// The rounds for which the order that the net came in, and its reverse, are spared when others drop out.
const SPARED_ROUNDS: u32 = 2;
/// The searches that run to the end.
pub(super) const FINALISTS: usize = 2;

/// Twins differ in their firings by at most one in so many.
const TWINS_APART: u64 = 256;

/// Keeps half of the field: in turn who has the fewest rounds to go at the pace of the last one, who has come farthest,
/// and who has the fewest nodes for it. None of the three alone tells who wins. Of the last two, the first by pace leads,
/// unless the other has come half as far again. Where memory has left only who is spared, these run for the first places.
/// `thinned` counts the times; true where the last two are left, and who stays beside them.
pub(super) fn thin_out(field: &mut Vec<Racer>, thinned: u32) -> bool {
    let by_units: Vec<Racer> = field.extract_if(.., |racer| racer.is_by_units).collect();
    let mut spared: Vec<Racer> = field.extract_if(.., |racer| racer.spared).collect();
    if field.is_empty() {
        field.extend(spared.drain(..).map(|racer| Racer { spared: false, ..racer }));
    }
    if thinned == 1 || field.len() > FINALISTS {
        let keep = FINALISTS.max(field.len() / 2);
        let mut kept = Vec::new();
        while kept.len() < keep && !field.is_empty() {
            let rank = |racer: &Racer| {
                let (done, nodes) = racer.standing();
                let (left, gained) = (racer.order.len() - done as usize, done.saturating_sub(racer.before) as usize);
                match kept.len() % 3 {
                    0 if gained > 0 => (left / gained, nodes),
                    0 => (usize::MAX, nodes),
                    1 => (left, nodes),
                    _ => (nodes / (done as usize + 1), nodes),
                }
            };
            let best = (0..field.len()).min_by_key(|&at| rank(&field[at]));
            kept.extend(best.map(|at| field.remove(at)));
        }
        if let [first, second] = &mut kept[..]
            && 2 * second.standing().0 > 3 * first.standing().0
        {
            std::mem::swap(first, second);
        }
        let others = std::mem::replace(field, kept).into_iter();
        let may_stay = |racer: &Racer| racer.is_shortest || racer.is_as_given();
        spared.extend(others.filter(may_stay).map(|racer| Racer { spared: true, ..racer }));
    }
    spared.retain(|racer| racer.is_shortest || thinned <= SPARED_ROUNDS);
    field.append(&mut spared);
    let are_last = running(field) <= FINALISTS && field.iter().all(|racer| !racer.spared || racer.is_shortest);
    field.splice(0..0, by_units);
    are_last
}

/// How many run for the first places.
pub(super) fn running(field: &[Racer]) -> usize {
    field.iter().filter(|racer| !racer.spared && !racer.is_by_units).count()
}

/// Whether two searches, which have both run, stand at the same level after about as many firings.
fn are_twins(one: &Racer, other: &Racer) -> bool {
    let firings = |racer: &Racer| racer.begun.as_ref().map(|(_, search, _)| search.fired());
    let (Some(own), Some(others)) = (firings(one), firings(other)) else { return false };
    one.ran
        && other.ran
        && one.standing().0 == other.standing().0
        && own.abs_diff(others) <= own.max(others) / TWINS_APART
}

/// Takes out of each two twins the one with more nodes, but none of the shortest order for another one, nor one that runs
/// for the first places for one beside, nor one by units for one by places. Of two that wait, standing still says nothing.
pub(super) fn drop_twins(field: &mut Vec<Racer>) {
    for at in (0..field.len()).rev() {
        let racer = &field[at];
        let nodes = racer.standing().1;
        let does = |(beside, other): (usize, &Racer)| {
            (other.standing().1, beside) < (nodes, at)
                && other.is_by_units == racer.is_by_units
                && (other.is_shortest || !racer.is_shortest)
                && (racer.spared || !other.spared)
                && are_twins(other, racer)
        };
        let alike = field.iter().filter(|other| other.is_by_units == racer.is_by_units).count();
        if (racer.is_by_units || alike > FINALISTS) && field.iter().enumerate().any(does) {
            field.remove(at);
        }
    }
    field.iter_mut().for_each(|racer| racer.ran = false);
}

#[cfg(test)]
mod tests {
    use super::super::order::Order;
    use super::*;
    use crate::budget::{Watch, unwatched};
    use crate::net::Transition;
    use crate::samples::slotted_ring;

    const ROOM: usize = 1 << 26;
    /// Results that bring a search some of the way along the ring, a little farther, and far.
    const SLOW: u64 = 400;
    const NEAR: u64 = 600;
    const FAR: u64 = 2000;

    /// Searches for the markings of a ring on which tokens go either way, one for each order of its places.
    fn field(orders: &[Order]) -> (Vec<Racer>, Vec<Transition>) {
        let places = orders[0].len() as u32;
        let moves = |from: u32, to: u32| Transition::new(&[from % places], &[to % places], &[], &[], &[]);
        (
            orders.iter().cloned().map(Racer::new).collect(),
            (0..places).flat_map(|at| [moves(at, at + 1), moves(at + 1, at)]).collect(),
        )
    }

    fn round(field: &mut Vec<Racer>, transitions: &[Transition], fuel: impl Fn(usize) -> u64) {
        // The same from both ends of the ring.
        let marked: Vec<u32> = (1..transitions.len() as u32 / 2).step_by(3).collect();
        for (at, racer) in field.iter_mut().enumerate() {
            let mut poll = unwatched;
            racer.fuel = fuel(at);
            let ended = racer.run(transitions, &marked, ROOM, &mut Watch::new(None, &mut poll));
            assert_eq!(ended, Ok(None));
        }
        drop_twins(field);
    }

    fn orders() -> [Order; 4] {
        let along: Order = (0..90).collect();
        let across: Order = (0..90).map(|at| at * 7 % 90).collect();
        [along.clone(), along.into_iter().rev().collect(), across.clone(), across.into_iter().rev().collect()]
    }

    #[test]
    fn of_two_orders_that_stand_alike_the_second_drops_out() {
        let [along, back, across, _] = orders();
        let (mut racers, transitions) = field(&[along.clone(), back, across.clone()]);
        round(&mut racers, &transitions, |_| 400);
        assert_eq!(racers.iter().map(|racer| &racer.order).collect::<Vec<_>>(), [&along, &across]);
    }

    #[test]
    fn of_twins_the_one_with_fewer_nodes_stays_wherever_it_stands() {
        // In each block the places of one machine stand below those of the other, or among them.
        let net = slotted_ring(40);
        let order = |block: [u32; 8]| (0..40).flat_map(|node| block.map(|at| 8 * node + at)).collect::<Order>();
        let (apart, mixed) = (order([4, 5, 6, 7, 2, 3, 1, 0]), order([0, 1, 2, 3, 4, 5, 6, 7]));
        let back: Order = mixed.iter().rev().copied().collect();
        let marked: Vec<u32> = (0..40).flat_map(|node| [8 * node + 2, 8 * node + 4]).collect();
        for orders in [[&apart, &mixed, &back], [&mixed, &apart, &back]] {
            let mut racers: Vec<Racer> = orders.into_iter().cloned().map(Racer::new).collect();
            for racer in &mut racers {
                let mut poll = unwatched;
                racer.fuel = 30_000;
                let ended = racer.run(&net.transitions, &marked, ROOM, &mut Watch::new(None, &mut poll));
                assert_eq!(ended, Ok(None));
            }
            drop_twins(&mut racers);
            assert_eq!(racers.iter().map(|racer| &racer.order).collect::<Vec<_>>(), [&apart, &back]);
        }
    }

    #[test]
    fn of_two_that_wait_standing_still_makes_no_twins() {
        let [along, back, across, _] = orders();
        let (mut racers, transitions) = field(&[along, back]);
        round(&mut racers, &transitions, |_| 200); // the last two stay
        racers.push(Racer::new(across));
        drop_twins(&mut racers);
        assert_eq!(racers.len(), 3);
        racers.iter_mut().for_each(|racer| racer.ran = true);
        drop_twins(&mut racers);
        assert_eq!(racers.len(), 2);
    }

    #[test]
    fn two_orders_that_stand_apart_are_both_kept() {
        let (mut racers, transitions) = field(&orders());
        for _ in 0..4 {
            // The reverse orders get on less far.
            round(&mut racers, &transitions, |at| if at % 2 == 0 { 400 } else { 200 });
        }
        assert_eq!(racers.len(), 4);
    }

    #[test]
    fn two_ways_to_lay_a_ring_out_are_twins_and_the_last_two_stay() {
        let [along, back, across, _] = orders();
        let turned: Order = (45..90).chain(0..45).collect();
        for two in [[along.clone(), turned, across], [along.clone(), back.clone(), along]] {
            let (mut racers, transitions) = field(&two);
            (0..4).for_each(|_| round(&mut racers, &transitions, |_| 200));
            assert_eq!(racers.len(), 2);
        }
    }

    #[test]
    fn the_shortest_order_is_no_twin_of_another_one_nor_one_by_units() {
        let [along, back, across, _] = orders();
        let turned: Order = (45..90).chain(0..45).collect();
        for (is_shortest, left) in [(false, 2), (true, 3)] {
            let (mut racers, transitions) = field(&[along.clone(), turned.clone(), across.clone()]);
            racers.swap(0, 1);
            racers[1].is_shortest = is_shortest;
            (0..4).for_each(|_| round(&mut racers, &transitions, |_| 200));
            assert_eq!(racers.len(), left);
            assert_eq!(racers.iter().any(|racer| racer.order == along), is_shortest);
        }
        let (mut racers, transitions) = field(&[along.clone(), turned.clone(), across.clone()]);
        racers[1].is_by_units = true;
        (0..4).for_each(|_| round(&mut racers, &transitions, |_| 200));
        assert_eq!(racers.len(), 3);
        // Of two by units that are twins one is enough, and of two by places, where they are the last, both stay.
        for (by_units, left) in [([true, true, false], 2), ([false, false, true], 3)] {
            let (mut racers, transitions) = field(&[along.clone(), turned.clone(), across.clone()]);
            racers.iter_mut().zip(by_units).for_each(|(racer, is_by_units)| racer.is_by_units = is_by_units);
            (0..4).for_each(|_| round(&mut racers, &transitions, |_| 200));
            assert_eq!(racers.len(), left, "{by_units:?}");
        }
        // Of both its directions one is enough.
        let (mut racers, transitions) = field(&[along, back, across]);
        racers[..2].iter_mut().for_each(|racer| racer.is_shortest = true);
        (0..4).for_each(|_| round(&mut racers, &transitions, |_| 200));
        assert_eq!(racers.len(), 2);
    }

    #[test]
    fn of_the_last_two_the_first_by_pace_leads_unless_the_other_has_come_half_as_far_again() {
        let [along, back, ..] = orders();
        for (fuel, leader) in [(FAR, &back), (NEAR, &along)] {
            let (mut racers, transitions) = field(&[along.clone(), back.clone()]);
            round(&mut racers, &transitions, |at| if at == 0 { SLOW } else { fuel });
            let (slow, far) = (racers[0].standing().0, racers[1].standing().0);
            assert!(0 < slow && slow < far && (2 * far > 3 * slow) == (fuel == FAR), "{slow} {far}");
            // Only the first has got on in the last round.
            racers[1].before = far;
            assert!(thin_out(&mut racers, 1));
            assert_eq!((racers.len(), &racers[0].order), (2, leader));
        }
    }

    #[test]
    fn the_order_that_the_net_came_in_is_spared_for_two_rounds_beside_those_that_others_drop_out_of() {
        let [along, back, across, crossed] = orders();
        let other: Order = (0..90).map(|at| at * 11 % 90).collect();
        let (mut racers, transitions) = field(&[across, crossed, other.clone(), other, along.clone(), back.clone()]);
        // The last two have not begun, so that they are last by every measure.
        let own = racers.split_off(4);
        round(&mut racers, &transitions, |at| 400 + 100 * at as u64); // so that none are twins
        racers.extend(own);
        for (thinned, left) in [(1, 5), (2, 4), (3, 2)] {
            assert_eq!((thin_out(&mut racers, thinned), racers.len()), (thinned == 3, left));
            let spared: Vec<&Order> = racers.iter().filter(|racer| racer.spared).map(|racer| &racer.order).collect();
            assert_eq!(spared, if thinned < 3 { vec![&along, &back] } else { vec![] });
        }
    }

    #[test]
    fn where_memory_has_left_only_who_is_spared_these_run_to_the_end() {
        let [along, back, ..] = orders();
        let (mut racers, transitions) = field(&[along, back]);
        round(&mut racers, &transitions, |at| 200 * (at as u64 + 1));
        racers.iter_mut().for_each(|racer| racer.spared = true);
        assert!(thin_out(&mut racers, SPARED_ROUNDS + 1));
        assert_eq!((racers.len(), running(&racers)), (2, 2));
    }

    #[test]
    fn searches_that_have_not_begun_are_no_twins() {
        let (mut racers, _) = field(&orders());
        (0..4).for_each(|_| drop_twins(&mut racers));
        assert_eq!(racers.len(), 4);
    }
}
