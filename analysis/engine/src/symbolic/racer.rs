//! One search of the race: the markings in one order of places, left and gone on with.

use super::cache::ANY;
use super::order::Order;
use super::ordered::Ordered;
use super::saturation::{By, Saturation, Workshop};
use super::zdd::Node;
use crate::budget::{Stop, Watch};
use crate::net::Transition;

/// A search in one order, which may be left and gone on with.
pub(super) struct Racer {
    pub(super) order: Order,
    /// Whether its order is by units (`units`), and it has a share of its own.
    pub(super) is_by_units: bool,
    /// Whether no other order of places that was made has shorter arcs, but for its reverse.
    pub(super) is_shortest: bool,
    /// Whether others run for the first places, and this one beside them.
    pub(super) spared: bool,
    pub(super) begun: Option<(Ordered, Saturation, Node)>,
    /// The level that was reached before the last round.
    pub(super) before: u32,
    /// Whether it has run since twins were last looked for, and not waited.
    pub(super) ran: bool,
    /// The results that it may still compute in this round; none where it waits, or has had its turn.
    pub(super) fuel: u64,
}

impl Racer {
    pub(super) fn new(order: Order) -> Self {
        Racer {
            order,
            is_by_units: false,
            is_shortest: false,
            spared: false,
            begun: None,
            before: 0,
            ran: false,
            fuel: 0,
        }
    }

    /// Whether its order is the one that the net came in, from either end.
    pub(super) fn is_as_given(&self) -> bool {
        self.order.is_sorted() || self.order.iter().rev().is_sorted()
    }

    /// Whether the order of another one is the reverse of this one's.
    pub(super) fn is_reverse_of(&self, other: &Racer) -> bool {
        self.order.iter().eq(other.order.iter().rev())
    }

    pub(super) fn bytes(&self) -> usize {
        self.begun.as_ref().map_or(0, |(ordered, ..)| ordered.diagram.store.memory.used())
    }

    /// Levels done and nodes made.
    pub(super) fn standing(&self) -> (u32, usize) {
        self.begun.as_ref().map_or((0, usize::MAX), |(ordered, search, _)| {
            (search.reached(&ordered.blocks, &ordered.diagram), ordered.diagram.store.used())
        })
    }

    pub(super) fn run(
        &mut self,
        transitions: &[Transition],
        initial: &[u32],
        room: usize,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Node>, Stop> {
        let (ordered, search, start) = match &mut self.begun {
            Some(begun) => begun,
            none => {
                let mut ordered = Ordered::new(transitions, initial, &self.order, room)?;
                let start = ordered.single(initial)?;
                let to = ordered.blocks.len() as u32;
                let search = Saturation::new(&ordered.diagram, &ordered.blocks, (start, ANY), to, By::Forward)?;
                none.insert((ordered, search, start))
            }
        };
        self.ran = true;
        let fuel = std::mem::take(&mut self.fuel);
        ordered.diagram.store.memory.allow(room);
        let Ordered { diagram, blocks, parts, agendas, .. } = ordered;
        let Some(agenda) = &agendas[By::Forward as usize] else { return Ok(None) };
        search.run(&mut Workshop { diagram, blocks, parts, agenda, roots: &[*start] }, fuel, watch)
    }
}
