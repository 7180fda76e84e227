//! Transitions as the search sees them: what they do in each block of places, from the highest block down.
//!
//! In a block a transition is three masks: what must hold a token, what must hold none, and what changes. What is left of
//! a transition below a block is a *suffix*; equal suffixes have one number, so that what one transition did to a node is
//! remembered for every other that does the same below.
//!
//! An event belongs to its highest block. Zero suppression hides some of them: where the event wants nothing but *empty*
//! places of that block (outputs, inhibitive gates), it can fire on a node that lies below the block and passes it over,
//! and a saturation that looks only at the blocks where nodes are misses it. Such blocks are *wakeful*. To try every
//! wakeful block above every node is quadratic in the places; but an event that wants a token somewhere below cannot
//! fire on a node that lies below that place too. So each wakeful block is filed under the lowest block a node must
//! have for one of its events to matter, and the next block to try is found in a tree of minima.

use std::collections::HashMap;

use super::blocks::{Blocks, Literals};
use super::cache::OPERAND_MAX;
use super::events::{DONE, Kind, Mixed, SATURATE, Suffix, Wakeful};
use crate::budget::Stop;

/// What a transition does in one block, and what follows below it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Part {
    /// The block; 0 for `DONE` and `SATURATE`.
    pub(super) block: u32,
    /// The places that must hold a token, as bits above the lowest place of the block.
    pub(super) full: u32,
    /// Those that must hold none.
    pub(super) empty: u32,
    /// Those that change.
    pub(super) flip: u32,
    /// The suffix below.
    pub(super) next: Suffix,
    /// The highest block, at or below this one, that must hold a token; 0 where there is none.
    pub(super) needs: u32,
}

impl Part {
    /// Whether the transition may fire as far as a value of this block tells.
    #[inline(always)]
    pub(super) fn fires(&self, value: u32) -> bool {
        value & self.full == self.full && value & self.empty == 0
    }
}

/// All suffixes, each once.
#[derive(Debug)]
pub(super) struct Parts {
    rows: Vec<Part>,
    /// From what a suffix does to its number; not kept while nothing is added.
    index: HashMap<Part, Suffix, Mixed>,
}

impl Default for Parts {
    fn default() -> Self {
        let nothing = Part { block: 0, full: 0, empty: 0, flip: 0, next: DONE, needs: 0 };
        Parts { rows: vec![nothing, nothing], index: HashMap::default() }
    }
}

impl Parts {
    /// The first part of a suffix.
    #[inline(always)]
    pub(super) fn get(&self, suffix: Suffix) -> &Part {
        &self.rows[suffix as usize]
    }

    fn intern(&mut self, part: Part) -> Result<Suffix, Stop> {
        let number = self.rows.len() as u32;
        if number > OPERAND_MAX {
            return Err(Stop::Memory);
        }
        let known = *self.index.entry(part).or_insert(number);
        if known == number {
            self.rows.push(part);
        }
        Ok(known)
    }

    /// The suffix of a transition, by its literals in descending order of level.
    fn whole(&mut self, literals: &[(u32, Kind)], blocks: &Blocks) -> Result<Suffix, Stop> {
        let mut next = DONE;
        for own in literals.chunk_by(|a, b| blocks.of(a.0) == blocks.of(b.0)).rev() {
            let block = blocks.of(own[0].0);
            let mut part = Part { block, full: 0, empty: 0, flip: 0, next, needs: 0 };
            for &(level, kind) in own {
                let bit = 1 << (level - blocks.low(block));
                if kind.wants() {
                    part.full |= bit;
                } else {
                    part.empty |= bit;
                }
                if kind.wants() != kind.leaves() {
                    part.flip |= bit;
                }
            }
            part.needs = if part.full != 0 { block } else { self.get(next).needs };
            next = self.intern(part)?;
        }
        Ok(next)
    }

    /// How many bytes the suffixes take.
    pub(super) fn bytes(&self) -> usize {
        self.rows.capacity() * size_of::<Part>()
    }
}

/// Events by their highest block.
#[derive(Debug)]
pub(super) struct Agenda {
    offsets: Vec<u32>,
    events: Vec<Part>,
    wakeful: Wakeful,
}

impl Agenda {
    /// The events of these transitions.
    pub(super) fn new(parts: &mut Parts, literals: &Literals, blocks: &Blocks) -> Result<Self, Stop> {
        let mut heads = Vec::with_capacity(literals.len());
        for at in 0..literals.len() {
            let head = parts.whole(literals.get(at), blocks)?;
            let Part { block, next, .. } = *parts.get(head);
            heads.push((block, next, head));
        }
        parts.index = HashMap::default();
        heads.retain(|&(.., head)| head != DONE);
        // Of the same block, those that end in it first: they are cheap and enlarge what the others see.
        heads.sort_unstable();
        heads.dedup();
        let mut offsets = vec![0; blocks.len() + 2];
        let mut needs = vec![u32::MAX; blocks.len() + 1];
        let events: Vec<Part> = heads.into_iter().map(|(.., head)| *parts.get(head)).collect();
        for event in &events {
            offsets[event.block as usize + 1] += 1;
            if event.full == 0 {
                let least = &mut needs[event.block as usize];
                *least = event.needs.min(*least);
            }
        }
        for block in 1..offsets.len() {
            offsets[block] += offsets[block - 1];
        }
        Ok(Agenda { offsets, events, wakeful: Wakeful::new(&needs) })
    }

    /// The events whose highest block is this one.
    #[inline(always)]
    pub(super) fn at(&self, block: u32) -> &[Part] {
        &self.events[self.offsets[block as usize] as usize..self.offsets[block as usize + 1] as usize]
    }

    /// The lowest block above `from`, up to `to`, with an event that may fire on a node of block `node` below it.
    #[inline]
    pub(super) fn wake(&self, from: u32, to: u32, node: u32) -> Option<u32> {
        if from >= to { None } else { self.wakeful.first(from as usize + 1, to as usize, node).map(|at| at as u32) }
    }

    /// How many bytes the agenda takes.
    pub(super) fn bytes(&self) -> usize {
        self.events.capacity() * size_of::<Part>() + 4 * self.offsets.capacity() + self.wakeful.bytes()
    }
}

const _: () = assert!(DONE == 0 && SATURATE == 1);
