//! The race of orders: the reachable markings in whichever order of places finds them first.
//!
//! Which order of places is good shows only in the search. So the candidates race: each searches for some steps, then the
//! next one; who has come less far up the levels drops out, and the steps are doubled, until two are left, of which
//! the second gets less. A saturation has its own stack and can be left and gone on with, so nothing is done twice, and
//! the race costs about two or three times the search of the winner, against a good chance to be a thousand times faster.
//! Where memory becomes short, the largest search is given up first.

use std::cmp::Reverse;

use super::cache::ANY;
use super::order::{Order, candidates};
use super::ordered::Ordered;
use super::saturation::{Saturation, Workshop};
use super::space::Symbolic;
use super::zdd::Node;
use crate::budget::{Stop, Watch};
use crate::net::Transition;

const FUEL: u64 = 1 << 17;
const FUEL_PER_LEVEL: u64 = 64;
/// The searches that are kept to the end, and how many times less than the first of them the second one gets.
const FINALISTS: usize = 2;
const RUNNER_UP: u64 = 2;

/// A search in one order, which may be left and gone on with.
struct Racer {
    order: Order,
    begun: Option<(Ordered, Saturation, Node)>,
}

impl Racer {
    fn bytes(&self) -> usize {
        self.begun.as_ref().map_or(0, |(ordered, ..)| ordered.diagram.store.memory.used())
    }

    /// Levels done (more is better), and nodes made.
    fn standing(&self) -> (Reverse<u32>, usize) {
        self.begun.as_ref().map_or((Reverse(0), 0), |(ordered, search, _)| {
            (Reverse(search.reached(&ordered.blocks, &ordered.diagram)), ordered.diagram.store.used())
        })
    }

    fn run(
        &mut self,
        transitions: &[Transition],
        initial: &[u32],
        room: usize,
        fuel: u64,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Node>, Stop> {
        let (ordered, search, start) = match &mut self.begun {
            Some(begun) => begun,
            none => {
                let mut ordered = Ordered::new(transitions, initial, &self.order, room)?;
                let start = ordered.single(initial)?;
                let search = Saturation::new(&ordered.diagram, &ordered.blocks, start, ANY, false)?;
                none.insert((ordered, search, start))
            }
        };
        ordered.diagram.store.memory.allow(room);
        let Ordered { diagram, blocks, parts, agendas, .. } = ordered;
        let Some(agenda) = &agendas[0] else { return Ok(None) };
        search.run(&mut Workshop { diagram, blocks, parts, agenda, roots: &[*start] }, fuel, watch)
    }
}

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
        let orders = orders.unwrap_or_else(|| candidates(places, &transitions));
        let mut field: Vec<Racer> = orders.into_iter().map(|order| Racer { order, begun: None }).collect();
        let mut fuel = FUEL + FUEL_PER_LEVEL * places as u64;
        while !field.is_empty() {
            let mut at = 0;
            while at < field.len() {
                let others: usize = field.iter().map(Racer::bytes).sum::<usize>() - field[at].bytes();
                let share = if at > 0 && field.len() <= FINALISTS { fuel / RUNNER_UP } else { fuel };
                match field[at].run(&transitions, &initial, bytes.saturating_sub(others), share, watch) {
                    Ok(Some(reach)) => {
                        if let Some(begun) = field.swap_remove(at).begun {
                            drop(field);
                            return Ok(Self::found(begun, transitions, initial, reach, bytes));
                        }
                    }
                    Ok(None) => at += 1,
                    Err(Stop::Memory) => {
                        // It stopped within a step. If another one is larger, that gives way and this begins again.
                        let largest = (0..field.len()).max_by_key(|&other| field[other].bytes()).unwrap_or(at);
                        field[at].begun = None;
                        field.remove(largest);
                        at -= usize::from(largest < at);
                    }
                    Err(stop) => return Err(stop),
                }
            }
            field.sort_by_key(Racer::standing);
            field.truncate(FINALISTS.max(field.len() / 2));
            fuel *= 2;
        }
        Err(Stop::Memory)
    }
}
