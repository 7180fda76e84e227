//! An order of places with the diagram in it, and what transitions are in that order.
//!
//! The search needs the firings by block; images, tests and conditions of contact go by places. Each table is made when it
//! is first asked for: of a net with half a million transitions one is as large as the diagram.

use super::algebra::Diagram;
use super::blocks::{Blocks, Literals};
use super::events::{Sense, Suffix, Suffixes, Table, contact_literals, literals};
use super::order::Order;
use super::parts::{Agenda, Parts};
use super::saturation::By;
use super::zdd::Node;
use crate::budget::{Memory, Stop};
use crate::net::Transition;

/// The tables of events that are made when they are first needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Events {
    /// The firings.
    Forward,
    /// The firings, from the marking after to the one before.
    Backward,
    /// The conditions of firing.
    Tests,
    /// The conditions of contact.
    Contacts,
}

/// An order of places, and the diagram in it.
#[derive(Debug)]
pub(super) struct Ordered {
    /// The level of each place.
    pub(super) level_of: Vec<u32>,
    /// The place of each level but 0.
    pub(super) place_at: Vec<u32>,
    pub(super) diagram: Diagram,
    pub(super) suffixes: Suffixes,
    pub(super) tables: [Option<Table>; 4],
    pub(super) blocks: Blocks,
    pub(super) parts: Parts,
    /// The firings by block, by what closures go by.
    pub(super) agendas: [Option<Agenda>; 3],
    /// The transitions of the last of them.
    chosen: Vec<usize>,
    claimed: usize,
}

impl Ordered {
    /// An empty diagram, and the firings in it.
    pub(super) fn new(transitions: &[Transition], initial: &[u32], order: &Order, bytes: usize) -> Result<Self, Stop> {
        let places = order.len();
        let mut level_of = vec![0; places];
        let mut place_at = vec![0; places + 1];
        for (at, &place) in order.iter().enumerate() {
            level_of[place as usize] = at as u32 + 1;
            place_at[at + 1] = place;
        }
        let mut marked = vec![false; places + 1];
        initial.iter().for_each(|&place| marked[level_of[place as usize] as usize] = true);
        let firings = Literals::new(transitions, &level_of, Sense::Forward);
        let blocks = Blocks::new(&firings, &marked);
        let block_of = (0..=places as u32).map(|level| blocks.of(level)).collect();
        let mut ordered = Ordered {
            diagram: Diagram::new(Memory::new(bytes), bytes, block_of)?,
            suffixes: Suffixes::default(),
            tables: [const { None }; 4],
            blocks,
            parts: Parts::default(),
            agendas: [const { None }; 3],
            chosen: Vec::new(),
            level_of,
            place_at,
            claimed: 0,
        };
        ordered.agendas[By::Forward as usize] = Some(Agenda::new(&mut ordered.parts, &firings, &ordered.blocks)?);
        ordered.claim()?;
        Ok(ordered)
    }

    /// Makes the agenda of what a closure goes by; the transitions that were chosen are those of `choose`.
    pub(super) fn agenda(&mut self, by: By, transitions: &[Transition]) -> Result<(), Stop> {
        if self.agendas[by as usize].is_none() {
            let sense = if by == By::Forward { Sense::Forward } else { Sense::Backward };
            let chosen: Vec<Transition> = match by {
                By::Chosen => self.chosen.iter().map(|&t| transitions[t].clone()).collect(),
                By::Forward | By::Backward => Vec::new(),
            };
            let its = if by == By::Chosen { &chosen } else { transitions };
            let firings = Literals::new(its, &self.level_of, sense);
            self.agendas[by as usize] = Some(Agenda::new(&mut self.parts, &firings, &self.blocks)?);
            self.claim()?;
        }
        Ok(())
    }

    /// Makes the agenda of the firings of some transitions, backwards, and forgets what was found by others.
    ///
    /// Other transitions than last time cost their parts anew, for as long as the diagram lives.
    pub(super) fn choose(&mut self, transitions: &[Transition], some: &[usize]) -> Result<(), Stop> {
        if self.chosen != some {
            let (fire, fix) = By::Chosen.ops();
            self.diagram.cache.forget(&[fire, fix]);
            self.agendas[By::Chosen as usize] = None;
            self.chosen = some.to_vec();
        }
        self.agenda(By::Chosen, transitions)
    }

    /// Claims the bytes of what was made of the transitions.
    fn claim(&mut self) -> Result<(), Stop> {
        let agendas = self.agendas.iter().flatten().map(Agenda::bytes).sum::<usize>();
        let tables = self.tables.iter().flatten().map(Table::bytes).sum::<usize>();
        let bytes = self.suffixes.bytes() + self.parts.bytes() + self.blocks.bytes() + agendas + tables;
        let more = bytes.saturating_sub(self.claimed);
        self.diagram.store.memory.claim(more)?;
        self.claimed += more;
        Ok(())
    }

    pub(super) fn levels(&self) -> u32 {
        self.level_of.len() as u32
    }

    pub(super) fn table(&mut self, which: Events, transitions: &[Transition]) -> Result<(), Stop> {
        if self.tables[which as usize].is_some() {
            return Ok(());
        }
        let mut events = Vec::new();
        for transition in transitions {
            match which {
                Events::Contacts => {
                    for output in transition.outputs.iter().filter(|place| !transition.inputs.contains(place)) {
                        if let Some(found) = contact_literals(transition, *output, &self.level_of) {
                            events.push(self.suffixes.whole(&found)?);
                        }
                    }
                }
                Events::Forward | Events::Backward => {
                    // What changes nothing adds no marking.
                    if !(transition.inputs.is_empty() && transition.outputs.is_empty()) {
                        events.extend(self.event(transition, which)?);
                    }
                }
                Events::Tests => events.extend(self.event(transition, which)?),
            }
        }
        if which != Events::Tests {
            events.sort_unstable();
            events.dedup();
        }
        self.tables[which as usize] = Some(Table::new(&self.suffixes, events, self.levels()));
        self.claim()
    }

    pub(super) fn event(&mut self, transition: &Transition, which: Events) -> Result<Option<Suffix>, Stop> {
        let sense = match which {
            Events::Forward => Sense::Forward,
            Events::Backward => Sense::Backward,
            Events::Tests | Events::Contacts => Sense::Test,
        };
        literals(transition, &self.level_of, sense).map(|found| self.suffixes.whole(&found)).transpose()
    }

    pub(super) fn single(&mut self, marked: &[u32]) -> Result<Node, Stop> {
        let mut levels: Vec<u32> = marked.iter().map(|&place| self.level_of[place as usize]).collect();
        levels.sort_unstable();
        levels.dedup();
        self.diagram.single(&levels)
    }
}
