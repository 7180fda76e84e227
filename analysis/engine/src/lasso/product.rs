//! The vertices of the product that were met, and what leads on from one.
//!
//! A vertex is stored as its marking with one more word, the state of the automaton, so that the table of markings is
//! the table of vertices; its number is that in which they were met. A bit tells whether it is *closed*: no run from it
//! is accepted.

use super::automaton::{Automaton, Edge};
use crate::budget::{Memory, Stop, Watch};
use crate::marking::{Width, linear_hash};
use crate::stubborn::search::Prepared;
use crate::table::{NONE, Table};

/// The net, the automaton, and the vertices met.
pub(super) struct Product<'a> {
    pub(super) prepared: &'a Prepared,
    pub(super) automaton: &'a mut Automaton,
    pub(super) table: Table,
    closed: Vec<u64>,
    /// Of each label whether it holds in the marking looked at; none where it was not evaluated.
    truth: Vec<Option<bool>>,
    pub(super) memory: Memory,
    /// Edges of the product followed.
    pub(super) edges: u64,
}

impl<'a> Product<'a> {
    /// No vertex yet.
    pub(super) fn new(prepared: &'a Prepared, automaton: &'a mut Automaton, memory: Memory) -> Result<Self, Stop> {
        let labels = automaton.labels.len();
        memory.claim(prepared.net.bytes() + prepared.dependencies.bytes() + automaton.bytes())?;
        memory.claim(labels * size_of::<Option<bool>>())?;
        let table = Table::new(prepared.net.words + 1, &memory)?;
        Ok(Product { prepared, automaton, table, closed: Vec::new(), truth: vec![None; labels], memory, edges: 0 })
    }

    /// How many vertices were met.
    pub(super) fn len(&self) -> usize {
        self.table.store.len()
    }

    /// The number of a vertex, if it was met.
    #[inline]
    pub(super) fn find<W: Width>(&self, width: W, vertex: &[u64]) -> Option<u32> {
        self.table.find(width, vertex, linear_hash(width, vertex))
    }

    /// Adds a vertex that was not met; its number.
    pub(super) fn add<W: Width>(
        &mut self,
        width: W,
        vertex: &[u64],
        most: usize,
        watch: &mut Watch<'_>,
    ) -> Result<u32, Stop> {
        let number = self.len();
        self.table.make_room(width, 1, &self.memory, watch)?;
        if number.is_multiple_of(64) {
            self.memory.push(&mut self.closed, 0)?;
        }
        self.table.insert(width, vertex, linear_hash(width, vertex), most, &self.memory)?;
        Ok(number as u32)
    }

    /// Whether no run from a vertex is accepted.
    #[inline(always)]
    pub(super) fn is_closed(&self, vertex: u32) -> bool {
        self.closed[vertex as usize / 64] >> (vertex % 64) & 1 == 1
    }

    /// Notes that no run from a vertex is accepted.
    #[inline(always)]
    pub(super) fn close(&mut self, vertex: u32) {
        self.closed[vertex as usize / 64] |= 1 << (vertex % 64);
    }

    /// Appends the edges of the automaton that may be taken in the marking of a vertex, by number.
    pub(super) fn admitted(&mut self, vertex: &[u64], into: &mut Vec<u32>) -> Result<(), Stop> {
        self.truth.fill(None);
        let Automaton { labels, rows, .. } = &mut *self.automaton;
        let words = self.prepared.net.words;
        for (number, edge) in rows[vertex[words] as usize].iter().enumerate() {
            let label = edge.label as usize;
            if *self.truth[label].get_or_insert_with(|| labels[label].holds(vertex)) {
                self.memory.push(into, number as u32)?;
            }
        }
        Ok(())
    }

    /// An edge of the automaton at a vertex.
    #[inline(always)]
    pub(super) fn edge(&self, vertex: &[u64], number: u32) -> &Edge {
        &self.automaton.rows[vertex[self.prepared.net.words] as usize][number as usize]
    }

    /// Makes of a vertex the one after it: `t` is fired, or nothing where it is `NONE`, and the state is the target.
    #[inline(always)]
    pub(super) fn step(&self, vertex: &mut [u64], t: u32, target: u32) {
        let words = self.prepared.net.words;
        if t != NONE {
            let flip = self.prepared.net.flip(t as usize, words);
            vertex.iter_mut().zip(flip).for_each(|(word, flip)| *word ^= flip);
        }
        vertex[words] = u64::from(target);
    }
}
