//! The race of orders: the reachable markings in whichever order of places finds them first.
//!
//! Which order of places is good shows only in the search, and late. So the candidates race: each computes some results,
//! then the next one, and in the next round twice as many; all are kept for some rounds, which ends the race on most nets,
//! then some drop out of each (`thinning`), until two are left, of which the second gets less, and those that stay beside
//! them. A saturation has its own stack and can be left and gone on with, so nothing is done twice, and the race costs
//! some times the search of the winner, against a good chance to be a thousand times faster. Where memory becomes short,
//! who stays beside the others gives way, then the largest search.
//!
//! An order by units (`units`) wins on most nets that take long, sometimes thirty times sooner than all others, and no
//! measure shows it before. So once a race is long, it and its reverse join in with as much as all the others together,
//! to the end. Not sooner: what is asked of a diagram later is mostly quicker where the arcs are short.
//!
//! Most nets are done in the first round in the first order that is made, so the others are made after it, and catch up:
//! where another order would have been first by its arcs, it has lost to one that is done in no time.
//!
//! Where a second processor is free, two searches run at a time from the second round on: most nets are done in the
//! first, sooner than a thread begins. A round is the same as if they had run in turn: of those that end in it the first
//! in the field wins, and the others are left. Two threads on one diagram were rejected: every node that is made would be
//! a lock, while searches in two orders share nothing but the net.

use super::abreast::abreast;
use super::order::{Candidates, Graph, Order};
use super::racer::Racer;
use super::space::Symbolic;
use super::thinning::{FINALISTS, drop_twins, running, thin_out};
use super::units::by_unit;
use super::zdd::Node;
use crate::budget::{Stop, Watch};
use crate::net::Transition;

/// The results that a search may compute in the first round, and more for each level.
const FUEL: u64 = 1 << 15;
const FUEL_PER_LEVEL: u64 = 16;
/// How many times that each search has before the first drops out.
const PATIENCE: u64 = 7;
/// How many times less than the first of the last two the second gets, and how many times less those that stay beside
/// them. These wait for some rounds, in which most leaders are done, and lose little by it: each round is as long as all
/// before it.
const RUNNER_UP: u64 = 4;
const BESIDE: u64 = 8;
const ROUNDS_ALONE: u32 = 3;
/// The span of an order by units and the shortest one, the larger to the smaller, beyond which they say different things.
const OWN_SPAN: (u64, u64) = (8, 9);

/// The searches for the markings of one net, each in an order of its own.
pub(super) struct Race {
    pub(super) transitions: Vec<Transition>,
    pub(super) initial: Vec<u32>,
    field: Vec<Racer>,
    /// What makes the other orders, until those that run without them have not ended in the first round.
    others: Option<Candidates>,
    /// The results that a search may compute in the next round, and in the first one.
    fuel: u64,
    first: u64,
    /// Those that a search had in all rounds, and with how many of them orders by units join in; none do any more at the
    /// largest number.
    spent: u64,
    units_at: u64,
    /// How often some dropped out, and whether only those who stay to the end are left.
    thinned: u32,
    settled: bool,
    /// The rounds since then.
    rounds_settled: u32,
    /// Whether two at a time have needed more memory than there is.
    apart: bool,
}

impl Race {
    /// The race before its first round; `orders` replaces the candidates of `order`.
    pub(super) fn new(
        places: usize,
        (transitions, initial): (Vec<Transition>, Vec<u32>),
        orders: Option<Vec<Order>>,
        watch: &mut Watch<'_>,
    ) -> Result<Self, Stop> {
        let (orders, others) = match orders {
            Some(orders) => (orders, None),
            None => {
                let made = Candidates::new(places, &transitions, watch)?;
                (made.first().into(), Some(made))
            }
        };
        let first = FUEL + FUEL_PER_LEVEL * places as u64;
        let mut race = Race {
            transitions,
            initial,
            field: Vec::new(),
            units_at: if others.is_some() { PATIENCE * first } else { u64::MAX },
            others,
            fuel: first,
            first,
            spent: 0,
            thinned: 0,
            settled: false,
            rounds_settled: 0,
            apart: false,
        };
        race.line_up(orders);
        Ok(race)
    }

    /// Makes these orders the field; a search that has begun in one of them has had its turn.
    fn line_up(&mut self, orders: Vec<Order>) {
        let mut begun = std::mem::take(&mut self.field);
        for order in orders {
            let racer = match begun.iter().position(|racer| racer.order == order) {
                Some(at) => begun.swap_remove(at),
                None => Racer { fuel: self.fuel, ..Racer::new(order) },
            };
            self.field.push(racer);
        }
        for at in 0..self.field.len() {
            self.field[at].is_shortest = at == 0 || self.field[at].is_reverse_of(&self.field[0]);
        }
    }

    /// The same, with orders by units from the second round on, as it is known that the race is long.
    pub(super) fn known_to_be_long(mut self) -> Self {
        self.units_at = self.first;
        self
    }

    /// Lets an order by units and its reverse join in, where there are any.
    ///
    /// Not where their arcs are about as long as the shortest, as where the units are small and alike: the orders that
    /// there are say what they would.
    fn line_units_up(&mut self, watch: &mut Watch<'_>) -> Result<(), Stop> {
        self.units_at = u64::MAX;
        let places = self.field.first().map_or(0, |racer| racer.order.len());
        let graph = Graph::new(places, &self.transitions);
        let Some(pair) = by_unit(places, &self.transitions, &self.initial, watch)? else { return Ok(()) };
        let shortest = self.field.iter().map(|racer| graph.span(&racer.order)).min().unwrap_or(0);
        let own = graph.span(&pair[0]);
        if OWN_SPAN.0 * own.max(shortest) > OWN_SPAN.1 * own.min(shortest) {
            self.field.splice(0..0, pair.map(|order| Racer { is_by_units: true, ..Racer::new(order) }));
        }
        Ok(())
    }

    /// The net, without the searches.
    pub(super) fn into_net(self) -> (Vec<Transition>, Vec<u32>) {
        (self.transitions, self.initial)
    }

    /// Whether some drop out by now: most races are over before.
    pub(super) fn is_long(&self) -> bool {
        self.spent >= PATIENCE * self.first
    }

    /// Makes room when a search had none: who only stays beside the others gives way, else the largest.
    ///
    /// The search stopped within a step, so it begins again, unless it is the one that gives way. The position to go on at.
    fn give_way(&mut self, at: usize) -> usize {
        let largest = (0..self.field.len()).max_by_key(|&other| self.field[other].bytes()).unwrap_or(at);
        self.field[at].begun = None;
        if self.settled && !self.field[at].spared && self.field.iter().any(|racer| racer.spared) {
            self.field.retain(|racer| !racer.spared); // they stand after the others
            return at;
        }
        let gone = if self.settled && self.field[at].spared { at } else { largest };
        self.field.remove(gone);
        at - usize::from(gone < at)
    }

    /// Gives each search what it may compute in this round.
    fn hand_out(&mut self) {
        let are_last = self.others.is_none() && running(&self.field) <= FINALISTS;
        let (mut leads, mut all) = (true, 0);
        for racer in self.field.iter_mut().filter(|racer| !racer.is_by_units) {
            racer.fuel = match racer.spared {
                true if self.settled && self.rounds_settled < ROUNDS_ALONE => 0,
                true if self.settled => self.fuel / BESIDE,
                false if !leads && are_last => self.fuel / RUNNER_UP,
                _ => self.fuel,
            };
            leads = false;
            all += racer.fuel;
        }
        let by_units = self.field.iter().filter(|racer| racer.is_by_units).count() as u64;
        let share = all.max(self.fuel) / by_units.max(1);
        self.field.iter_mut().filter(|racer| racer.is_by_units).for_each(|racer| racer.fuel = share);
    }

    /// The bytes that all searches hold.
    fn held(&self) -> usize {
        self.field.iter().map(Racer::bytes).sum()
    }

    /// Lets those who have fuel run one after the other; who was the first to end, and with what.
    fn in_turn(&mut self, bytes: usize, watch: &mut Watch<'_>) -> Result<Option<(usize, Node)>, Stop> {
        let mut at = 0;
        while at < self.field.len() {
            if self.field[at].fuel == 0 {
                at += 1;
                continue;
            }
            let others = self.held() - self.field[at].bytes();
            let fuel = self.field[at].fuel;
            match self.field[at].run(&self.transitions, &self.initial, bytes.saturating_sub(others), watch) {
                Ok(Some(reach)) => return Ok(Some((at, reach))),
                Ok(None) => at += 1,
                Err(Stop::Memory) => {
                    self.field[at].fuel = fuel; // it begins again
                    at = self.give_way(at);
                }
                Err(stop) => return Err(stop),
            }
        }
        Ok(None)
    }

    /// The same, two at a time, as if they had run in turn; where memory was short, all go on in turn from then on.
    fn by_two(&mut self, bytes: usize, watch: &mut Watch<'_>) -> Result<Option<(usize, Node)>, Stop> {
        let left = bytes.saturating_sub(self.held());
        let (ended, short) = abreast(&mut self.field, (&self.transitions, &self.initial), left, watch)?;
        self.apart |= short;
        Ok(ended)
    }

    /// Goes on for a round; the markings, if a search has ended in it. Out of memory where none is left.
    pub(super) fn round(&mut self, bytes: usize, watch: &mut Watch<'_>) -> Result<Option<Symbolic>, Stop> {
        if self.spent >= self.units_at {
            self.line_units_up(watch)?;
        }
        self.hand_out();
        let mut ended = None;
        self.apart |= self.held() > bytes / 2; // one that was alone would have room for more than half of what is left
        if self.spent > 0 && !self.apart && self.field.len() > 1 && watch.second_is_free() {
            ended = self.by_two(bytes, watch)?;
        }
        if ended.is_none() {
            ended = self.in_turn(bytes, watch)?;
        }
        if ended.is_none()
            && let Some(others) = self.others.take()
        {
            let first = others.first();
            let mut orders = others.all(&self.transitions, watch)?;
            // One that has given way does not come again.
            orders.retain(|order| !first.contains(order) || self.field.iter().any(|racer| racer.order == *order));
            self.line_up(orders);
            ended = self.in_turn(bytes, watch)?;
        }
        if let Some((at, reach)) = ended
            && let Some(begun) = self.field.swap_remove(at).begun
        {
            self.field.clear();
            let net = (std::mem::take(&mut self.transitions), std::mem::take(&mut self.initial));
            return Ok(Some(Symbolic::found(begun, net.0, net.1, reach, bytes)));
        }
        if self.field.is_empty() {
            return Err(Stop::Memory);
        }
        self.spent += self.fuel;
        drop_twins(&mut self.field);
        self.rounds_settled += u32::from(self.settled);
        if self.is_long() && !self.settled {
            self.thinned += 1;
            self.settled = thin_out(&mut self.field, self.thinned);
        }
        self.field.iter_mut().for_each(|racer| racer.before = racer.standing().0);
        self.fuel *= 2;
        Ok(None)
    }

    /// Goes on to the end.
    pub(super) fn run(mut self, bytes: usize, watch: &mut Watch<'_>) -> Result<Symbolic, Stop> {
        loop {
            if let Some(found) = self.round(bytes, watch)? {
                return Ok(found);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;
    use crate::budget::unwatched;
    use crate::marking::holds;
    use crate::samples::{slotted_ring, wanderers};

    /// Results that end no search, and none that is nearly over.
    const SLOW: u64 = 400;
    const TINY: u64 = 2;

    /// Vehicles that overtake each other on a ring of zones, of which each holds one: all ways to place them.
    fn vehicles(count: u32, zones: u32) -> (usize, Vec<Transition>, Vec<u32>) {
        let (at, free) = (|v: u32, z: u32| v * zones + z % zones, |z: u32| count * zones + z % zones);
        let moves = |(v, z, by)| Transition::new(&[at(v, z), free(z + by)], &[at(v, z + by), free(z)], &[], &[], &[]);
        let all = (0..count).flat_map(|v| (0..zones).flat_map(move |z| [1, 2].map(|by| (v, z, by))));
        let transitions = all.map(moves).collect();
        let initial = (0..count).map(|v| at(v, v)).chain((count..zones).map(free)).collect();
        (((count + 1) * zones) as usize, transitions, initial)
    }

    #[test]
    fn a_race_is_long_when_some_drop_out_and_most_are_over_before() {
        for (count, zones, ends) in [(2, 4, true), (8, 24, false)] {
            let (places, transitions, initial) = vehicles(count, zones);
            let mut poll = unwatched;
            let watch = &mut Watch::new(None, &mut poll);
            let mut race = Race::new(places, (transitions, initial), None, watch).expect("enough room");
            let (mut all, mut found) = (race.field.len(), None);
            while found.is_none() && !race.is_long() {
                assert_eq!(race.thinned, 0);
                found = race.round(1 << 30, watch).expect("enough room");
                all = all.max(race.field.len());
            }
            assert_eq!(found.is_some(), ends);
            assert_eq!((race.thinned, race.field.len() < all), (u32::from(!ends), true));
        }
    }

    #[test]
    fn orders_by_units_join_in_when_the_race_is_long_or_known_to_be_and_where_they_have_something_to_say() {
        for (net, is_known, joins_at) in [
            (wanderers(16), false, Some(PATIENCE)),
            (wanderers(16), true, Some(1)),
            (slotted_ring(40), false, None),
            (slotted_ring(40), true, None),
        ] {
            let initial: Vec<u32> = (0..net.places as u32).filter(|&place| holds(&net.initial, place)).collect();
            let mut poll = unwatched;
            let watch = &mut Watch::new(None, &mut poll);
            let has_units = by_unit(net.places, &net.transitions, &initial, watch).expect("no budget").is_some();
            let mut race = Race::new(net.places, (net.transitions, initial), None, watch).expect("enough room");
            assert_eq!(race.units_at, PATIENCE * race.first);
            (race.first, race.fuel, race.units_at) = (TINY, TINY, PATIENCE * TINY);
            if is_known {
                race = race.known_to_be_long();
            }
            let (mut before, mut joined) = (0, None);
            while race.spent < 40 * TINY && joined.is_none() {
                before = race.spent;
                assert!(race.round(1 << 30, watch).expect("enough room").is_none(), "the race is over too soon");
                joined = race.field[0].is_by_units.then_some(before / TINY);
            }
            assert_eq!((has_units, joined), (true, joins_at), "{before}");
            let by_units = |race: &Race| race.field.iter().filter(|racer| racer.is_by_units).count();
            let count = by_units(&race);
            assert_eq!(count > 0, joins_at.is_some());
            assert!(race.round(1 << 30, watch).is_ok_and(|found| found.is_none()), "the race is over too soon");
            assert!(by_units(&race) <= count, "they join in once");
        }
        // So they do where their arcs are shorter than those of all that were made.
        let net = slotted_ring(40);
        let initial: Vec<u32> = (0..40).flat_map(|node| [8 * node + 2, 8 * node + 4]).collect();
        let mut poll = unwatched;
        let watch = &mut Watch::new(None, &mut poll);
        let mut race = Race::new(net.places, (net.transitions, initial), None, watch).expect("enough room");
        race.field = vec![Racer::new((0..320).map(|at| at * 77 % 320).collect())];
        assert_eq!((race.line_units_up(watch), race.field.len()), (Ok(()), 3));
        let (places, transitions, initial) = vehicles(2, 4);
        let (given, mut poll) = ((0..places as u32).collect(), unwatched);
        let race = Race::new(places, (transitions, initial), Some(vec![given]), &mut Watch::new(None, &mut poll));
        assert!(race.is_ok_and(|race| race.units_at == u64::MAX), "a caller's orders alone are raced");
    }

    #[test]
    fn orders_by_units_have_as_much_as_all_others_together_to_the_end() {
        let (places, transitions, initial) = vehicles(6, 24);
        let mut poll = unwatched;
        let watch = &mut Watch::new(None, &mut poll);
        let mut race = Race::new(places, (transitions, initial), None, watch).expect("enough room");
        (race.first, race.fuel) = (SLOW, SLOW);
        while !race.settled || race.rounds_settled <= ROUNDS_ALONE {
            assert!(race.round(1 << 30, watch).expect("enough room").is_none(), "the race is over too soon");
            if race.spent == SLOW {
                race.field.rotate_right(2); // the last two
                race.field[..2].iter_mut().for_each(|racer| racer.is_by_units = true);
            }
            race.hand_out();
            let [own, others] = [true, false].map(|is_by_units| {
                let of = race.field.iter().filter(|racer| racer.is_by_units == is_by_units);
                of.map(|racer| racer.fuel).collect::<Vec<u64>>()
            });
            assert_eq!((own.len(), own.iter().sum::<u64>()), (2, others.iter().sum::<u64>() / 2 * 2));
            if race.settled {
                assert_eq!(others[..2], [race.fuel, race.fuel / RUNNER_UP]);
            }
        }
        // Where memory is short and nobody only stays beside the others, the largest of all gives way.
        race.field.retain(|racer| !racer.spared);
        let count = race.field.len();
        race.give_way(count - 1);
        assert_eq!(race.field.len(), count - 1);
        // Alone they share what one would have.
        race.field.retain(|racer| racer.is_by_units);
        race.hand_out();
        let share = race.fuel / race.field.len() as u64;
        assert!(!race.field.is_empty() && race.field.iter().all(|racer| racer.fuel == share));
    }

    #[test]
    fn the_other_orders_are_made_and_run_once_the_first_has_not_ended() {
        let (places, transitions, initial) = vehicles(4, 16);
        for (fuel, ends) in [(1 << 24, true), (SLOW, false)] {
            let mut poll = unwatched;
            let watch = &mut Watch::new(None, &mut poll);
            let net = (transitions.clone(), initial.clone());
            let mut race = Race::new(places, net.clone(), None, watch).expect("enough room");
            (race.first, race.fuel) = (fuel, fuel);
            let first: Vec<Order> = race.field.iter().map(|racer| racer.order.clone()).collect();
            assert_eq!(first.len(), 2);
            assert_eq!(race.round(1 << 30, watch).map(|found| found.is_some()), Ok(ends));
            assert_eq!(race.others.is_some(), ends);
            if ends {
                continue;
            }
            assert!(race.field.len() > 2 && race.field.iter().all(|racer| racer.begun.is_some() && racer.fuel == 0));
            assert!(race.field[0].is_shortest && race.field[1].is_shortest && !race.field[2].is_shortest);
            for order in first {
                // It had one turn, as long as if it had run alone.
                let mut alone = Race::new(places, net.clone(), Some(vec![order]), watch).expect("enough room");
                (alone.first, alone.fuel) = (fuel, fuel);
                assert!(alone.round(1 << 30, watch).is_ok_and(|found| found.is_none()));
                let here = race.field.iter().find(|racer| racer.order == alone.field[0].order);
                assert_eq!(here.map(Racer::standing), Some(alone.field[0].standing()));
            }
        }
    }

    #[test]
    fn who_has_given_way_before_the_other_orders_are_made_does_not_come_again() {
        let (places, transitions, initial) = vehicles(4, 16);
        let mut poll = unwatched;
        let watch = &mut Watch::new(None, &mut poll);
        let mut race = Race::new(places, (transitions, initial), None, watch).expect("enough room");
        (race.first, race.fuel) = (SLOW, SLOW);
        let gone = race.field.remove(1).order;
        assert!(race.round(1 << 30, watch).is_ok_and(|found| found.is_none()));
        assert!(race.field.len() > 2 && race.field.iter().all(|racer| racer.order != gone));
    }

    /// A race that nothing ends in the first round of, gone on with by one thread or two, with so many results in the next.
    fn raced(count: u32, bytes: usize, second: u64, by_two: bool) -> (Result<Symbolic, Stop>, bool) {
        let (places, transitions, initial) = vehicles(count, 4 * count);
        let (free, mut poll) = (AtomicBool::new(by_two), unwatched);
        let watch = &mut Watch::new(None, &mut poll).with_second(Some(&free));
        let mut race = Race::new(places, (transitions, initial), None, watch).expect("enough room");
        (race.first, race.fuel) = (SLOW, SLOW);
        loop {
            let is_first = race.spent == 0;
            match race.round(bytes, watch) {
                Ok(None) if is_first => race.fuel = second,
                Ok(None) => {}
                Ok(Some(_)) if is_first => panic!("the race is over too soon"),
                Ok(Some(found)) => return (Ok(found), race.apart),
                Err(stop) => return (Err(stop), race.apart),
            }
        }
    }

    #[test]
    fn by_two_threads_the_same_search_wins_as_by_one() {
        // Over after many rounds, after some, and all in the second.
        for second in [2 * SLOW, 40 * SLOW, 1 << 24] {
            let [one, two] = [false, true].map(|by_two| raced(4, 1 << 30, second, by_two));
            let [one, two] = [one, two].map(|(found, apart)| (found.expect("enough room"), apart));
            assert_eq!((one.0.place_at(), one.0.fired, one.0.nodes), (two.0.place_at(), two.0.fired, two.0.nodes));
            assert_eq!((one.1, two.1), (false, false));
        }
    }

    #[test]
    fn where_memory_does_not_do_for_two_at_a_time_one_goes_on_after_the_other() {
        let mut bytes = 1 << 16;
        while raced(3, bytes, 2 * SLOW, false).0.is_err() {
            bytes += bytes / 4;
        }
        let (found, apart) = raced(3, bytes, 2 * SLOW, true);
        assert_eq!((found.map(|_| ()), apart), (Ok(()), true));
    }

    #[test]
    fn two_threads_hold_no_more_than_is_allowed() {
        let (places, transitions, initial) = vehicles(6, 24);
        let other: Order = (0..places as u32).map(|at| at * 11 % places as u32).collect();
        let along: Order = (0..places as u32).collect();
        let back = |order: &Order| order.iter().rev().copied().collect::<Order>();
        let all = vec![along.clone(), back(&along), other.clone(), back(&other)];
        let (second, mut poll) = (AtomicBool::new(true), unwatched);
        let watch = &mut Watch::new(None, &mut poll).with_second(Some(&second));
        let mut race = Race::new(places, (transitions, initial), Some(all), watch).expect("enough room");
        (race.first, race.fuel) = (SLOW, SLOW);
        assert!(race.round(1 << 30, watch).is_ok_and(|found| found.is_none()));
        let bytes = 2 * race.held();
        (race.fuel, race.first) = (1 << 18, 1 << 30);
        race.hand_out();
        assert!(race.by_two(bytes, watch).is_ok_and(|found| found.is_none()));
        assert!(race.apart && race.held() <= bytes);
    }

    #[test]
    fn who_begins_again_where_another_one_has_given_way_runs_in_the_same_round() {
        let (places, transitions, initial) = vehicles(6, 24);
        let along: Order = (0..places as u32).collect();
        let (all, mut poll) = (vec![along.clone(), along.into_iter().rev().collect()], unwatched);
        let watch = &mut Watch::new(None, &mut poll);
        let mut race = Race::new(places, (transitions, initial), Some(all), watch).expect("enough room");
        (race.first, race.fuel) = (SLOW, SLOW);
        while race.field.len() == 2 {
            let bytes = if race.spent == 0 { 1 << 30 } else { race.held() + race.held() / 4 };
            assert!(race.round(bytes, watch).is_ok_and(|found| found.is_none()));
        }
        assert!(race.field[0].begun.is_some());
    }

    #[test]
    fn two_threads_end_when_the_caller_says_so() {
        let (places, transitions, initial) = vehicles(8, 24);
        let (second, mut poll) = (AtomicBool::new(true), unwatched);
        let net = (transitions, initial);
        let mut race = Race::new(places, net, None, &mut Watch::new(None, &mut poll)).expect("enough room");
        (race.first, race.fuel) = (SLOW, SLOW);
        assert!(race.round(1 << 30, &mut Watch::new(None, &mut poll)).is_ok_and(|found| found.is_none()));
        race.fuel = 1 << 40;
        let mut poll = |_| Err(Stop::Interrupted);
        let watch = &mut Watch::new(None, &mut poll).with_second(Some(&second));
        assert_eq!(race.round(1 << 30, watch).map(|_| ()), Err(Stop::Interrupted));
    }

    #[test]
    fn a_race_of_which_no_search_has_room_is_out_of_memory() {
        let (places, transitions, initial) = vehicles(8, 24);
        let mut poll = unwatched;
        let watch = &mut Watch::new(None, &mut poll);
        let race = Race::new(places, (transitions, initial), None, watch).expect("enough room");
        assert_eq!(race.run(1 << 16, watch).map(|_| ()), Err(Stop::Memory));
    }

    #[test]
    fn the_order_with_the_shortest_arcs_stays_to_the_end_with_its_reverse_beside_the_last_two() {
        let (places, transitions, initial) = vehicles(6, 24);
        let other: Order = (0..places as u32).map(|at| at * 11 % places as u32).collect();
        let (across, along): (Order, Order) =
            ((0..places as u32).map(|at| at * 5 % places as u32).collect(), (0..places as u32).collect());
        let back = |order: &Order| order.iter().rev().copied().collect::<Order>();
        let all = vec![across.clone(), back(&across), other.clone(), back(&other), along.clone(), back(&along)];
        let settled = || {
            let mut poll = unwatched;
            let watch = &mut Watch::new(None, &mut poll);
            let net = (transitions.clone(), initial.clone());
            let mut race = Race::new(places, net, Some(all.clone()), watch).expect("enough room");
            (race.first, race.fuel) = (SLOW, SLOW); // enough to tell them apart
            while !race.settled {
                assert!(race.round(1 << 30, watch).expect("enough room").is_none(), "the race is over too soon");
            }
            race
        };
        let mut race = settled();
        let stays: Vec<&Order> = race.field.iter().map(|racer| &racer.order).collect();
        assert!([&across, &back(&across)].iter().all(|order| stays.contains(order)), "{}", stays.len());
        let count = stays.len();
        assert!(count > FINALISTS && running(&race.field) == FINALISTS);
        // It waits for some rounds, in which most leaders are done.
        let beside =
            |race: &Race| race.field.iter().filter(|racer| racer.spared).map(Racer::standing).collect::<Vec<_>>();
        let (waiting, mut poll) = (beside(&race), unwatched);
        for round in 0..=ROUNDS_ALONE {
            let found = race.round(1 << 30, &mut Watch::new(None, &mut poll)).expect("enough room");
            assert!(found.is_none(), "the race is over too soon");
            assert_eq!(beside(&race) == waiting, round < ROUNDS_ALONE);
        }
        let mut race = settled();
        // Where memory is short, one that only stays gives way to any, and all of them to one that runs, then the largest.
        assert_eq!((race.give_way(count - 1), race.field.len()), (count - 1, count - 1));
        let mut race = settled();
        assert_eq!((race.give_way(0), race.field.len(), race.field[0].begun.is_none()), (0, FINALISTS, true));
        assert_eq!((race.give_way(0), race.field.len(), race.field[0].begun.is_none()), (0, 1, true));
    }
}
