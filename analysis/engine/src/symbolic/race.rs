//! The race of orders: the reachable markings in whichever order of places finds them first.
//!
//! Which order of places is good shows only in the search, and late: on nets of the model-checking contest the winner is as
//! often the one with the most nodes after the first rounds as the one with the fewest. So the candidates race: each
//! computes some results, then the next one, and in the next round twice as many; all are kept for some rounds, which
//! ends the race on most nets, then half drop out of each, until two are left, of which the second gets less. A
//! saturation has its own stack and can be left and gone on with, so nothing is done twice, and the race costs some
//! times the search of the winner, against a good chance to be a thousand times faster. Where memory becomes short, the
//! largest search is given up first. The rejected alternative, to go by the levels done alone, drops most winners early.

use super::cache::ANY;
use super::order::{Order, candidates};
use super::ordered::Ordered;
use super::saturation::{Saturation, Workshop};
use super::space::Symbolic;
use super::zdd::Node;
use crate::budget::{Stop, Watch};
use crate::net::Transition;

/// The results that a search may compute in the first round, and more for each level.
const FUEL: u64 = 1 << 15;
const FUEL_PER_LEVEL: u64 = 16;
/// How many times that each search has before the first drops out.
const PATIENCE: u64 = 7;
/// The searches that are kept to the end, and how many times less than the first of them the others get.
const FINALISTS: usize = 2;
const RUNNER_UP: u64 = 4;

/// A search in one order, which may be left and gone on with.
struct Racer {
    order: Order,
    begun: Option<(Ordered, Saturation, Node)>,
    /// The level that was reached before the last round.
    before: u32,
}

impl Racer {
    fn bytes(&self) -> usize {
        self.begun.as_ref().map_or(0, |(ordered, ..)| ordered.diagram.store.memory.used())
    }

    /// Levels done and nodes made.
    fn standing(&self) -> (u32, usize) {
        self.begun.as_ref().map_or((0, usize::MAX), |(ordered, search, _)| {
            (search.reached(&ordered.blocks, &ordered.diagram), ordered.diagram.store.used())
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

/// Keeps half of the field: in turn who has the fewest rounds to go at the pace of the last one, who has come farthest,
/// and who has the fewest nodes for it. None of the three alone tells who wins.
fn thin_out(field: &mut Vec<Racer>) {
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
    *field = kept;
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
        let mut field: Vec<Racer> = orders.into_iter().map(|order| Racer { order, begun: None, before: 0 }).collect();
        let first = FUEL + FUEL_PER_LEVEL * places as u64;
        let (mut fuel, mut spent) = (first, 0);
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
            spent += fuel;
            if spent >= PATIENCE * first {
                thin_out(&mut field);
            }
            field.iter_mut().for_each(|racer| racer.before = racer.standing().0);
            fuel *= 2;
        }
        Err(Stop::Memory)
    }
}
