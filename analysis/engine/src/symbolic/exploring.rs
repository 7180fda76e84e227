//! The reachable markings, found on the net itself or by way of a smaller one, and then brought back into the diagram.
//!
//! An order that was found for the net itself is the better one for what is asked later, where fixed points go on round
//! by round. So the search begins on the net itself, and goes on with the smaller one where it is not over soon, and that
//! one is so much smaller that to begin anew is worth it.

use super::merging::{Merged, merged};
use super::order::Order;
use super::ordered::{Events, Ordered};
use super::race::Race;
use super::space::Symbolic;
use super::trial::meets_contact;
use super::zdd::{EMPTY, Node, UNIT};
use crate::budget::{Stop, Watch};
use crate::net::Transition;

/// How many of four places are left at most, where the search begins anew.
const LEFT_OF_FOUR: usize = 3;

/// No node yet.
const NONE: Node = Node::MAX;

impl Symbolic {
    /// The reachable markings, or why they were not found; `orders` replaces the candidates of `order`.
    pub fn explore(
        places: usize,
        transitions: Vec<Transition>,
        initial: Vec<u32>,
        bytes: usize,
        orders: Option<Vec<Order>>,
        watch: &mut Watch<'_>,
    ) -> Result<Self, Stop> {
        let only = orders.is_some();
        let mut race = Race::new(places, (transitions, initial), orders, watch)?;
        if only {
            return race.run(bytes, watch);
        }
        let mut short = false;
        while !race.is_long() && !short {
            match race.round(bytes, watch) {
                Ok(Some(found)) => return Ok(found),
                Ok(None) => {}
                Err(Stop::Memory) => short = true,
                Err(stop) => return Err(stop),
            }
        }
        // Most nets are done by now, sooner than a smaller one is looked for.
        let smaller = merged(places, &race.transitions, &race.initial, watch)?
            .filter(|small| 4 * small.stands.len() <= LEFT_OF_FOUR * places);
        let Some(smaller) = smaller else {
            return if short { Err(Stop::Memory) } else { race.run(bytes, watch) };
        };
        let (transitions, initial) = race.into_net();
        match Self::through(smaller, &transitions, &initial, bytes, watch) {
            Ok(Some(found)) => return Ok(found),
            Ok(None) | Err(Stop::Memory) => {}
            Err(stop) => return Err(stop),
        }
        Race::new(places, (transitions, initial), None, watch)?.run(bytes, watch)
    }

    /// The same by way of the smaller net alone; None where there is none, or it does not stand for the net.
    pub fn explore_merged(
        places: usize,
        transitions: &[Transition],
        initial: &[u32],
        bytes: usize,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Self>, Stop> {
        match merged(places, transitions, initial, watch)? {
            Some(smaller) => Self::through(smaller, transitions, initial, bytes, watch),
            None => Ok(None),
        }
    }

    /// The same by way of this smaller net; None where that has contact, and so does not stand for the net.
    fn through(
        smaller: Merged,
        transitions: &[Transition],
        initial: &[u32],
        bytes: usize,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Self>, Stop> {
        if meets_contact(&smaller, watch)? {
            return Ok(None);
        }
        let Merged { transitions: its, initial: begin, stands } = smaller;
        let mut small = Race::new(stands.len(), (its, begin), None, watch)?.known_to_be_long().run(bytes, watch)?;
        let reach = small.reach;
        if small.all(&[], reach, Events::Contacts, watch)? != EMPTY {
            return Ok(None);
        }
        let mut order = Order::new();
        for &place in &small.place_at()[1..] {
            let from = order.len();
            stands[place as usize].places(&mut order);
            order[from..].reverse();
        }
        let room = bytes.saturating_sub(small.bytes());
        let mut ordered = Ordered::new(transitions, initial, &order, room)?;
        let start = ordered.single(initial)?;
        let place_at = small.place_at().to_vec();
        let of = &small.diagram().store;
        let store = &mut ordered.diagram.store;
        let mut brought = store.memory.filled(NONE, of.len())?;
        (brought[EMPTY as usize], brought[UNIT as usize]) = (EMPTY, UNIT);
        let mut todo = vec![reach];
        while let Some(&node) = todo.last() {
            watch.tick(1)?;
            let (without, with) = (brought[of.lo(node) as usize], brought[of.hi(node) as usize]);
            if brought[node as usize] != NONE {
                todo.pop();
            } else if without != NONE && with != NONE {
                let place = place_at[of.level(node) as usize];
                brought[node as usize] = stands[place as usize].over(store, &ordered.level_of, with, without)?;
                todo.pop();
            } else {
                todo.extend([of.lo(node), of.hi(node)].into_iter().filter(|&part| brought[part as usize] == NONE));
            }
        }
        let (fired, nodes, reach) = (small.fired, small.nodes, brought[reach as usize]);
        store.memory.release(brought.len() * size_of::<Node>());
        drop(small);
        ordered.diagram.store.memory.allow(bytes);
        Ok(Some(Symbolic::new((ordered, start), transitions.to_vec(), initial.to_vec(), reach, (fired, nodes))))
    }
}
