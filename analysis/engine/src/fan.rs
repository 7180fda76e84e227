//! The neighbours of 64 markings at once, under interleaving: successors by the rule, predecessors by its reverse.
//!
//! As in the exploration, a transition is tested for all 64 by bit slices, what it gives is gathered, and the table is
//! asked for a batch, so that its cache misses overlap. A question like "has it a successor in this set" is settled
//! for most markings by one or two edges; so the visitor says of each edge whether its marking is done with, and no
//! further transition is tested for that one. Storing edges was rejected, but for who asks again and again
//! (`fixpoints.rs`): they are recomputed about as fast as they are read back, and cost more than the markings.

use crate::batch::Batch;
use crate::budget::{Stop, Watch};
use crate::explore::Space;
use crate::indexes::Asking;
use crate::marking::Width;
use crate::net::Rules;
use crate::table::{Candidates, NONE};

/// Up to 64 markings and one of the two ways to go from them.
pub struct Fan<'a> {
    space: &'a Space,
    rules: &'a Rules,
    batch: Batch,
    /// What the table is asked for, where markings are hashed.
    candidates: Candidates,
    /// The same where they have keys.
    keys: Vec<u64>,
    /// For each candidate, the marking of the batch and the transition.
    edges: Vec<(u8, u32)>,
    found: Vec<u32>,
    /// The same, where they have keys.
    asking: Box<Asking>,
    /// How many candidates the table was asked for.
    pub tried: u64,
}

impl<'a> Fan<'a> {
    /// Goes along the edges.
    pub fn forward(space: &'a Space, watch: &mut Watch<'_>) -> Result<Self, Stop> {
        Fan::new(space, &space.net.forward, watch)
    }

    /// Goes against the edges.
    pub fn backward(space: &'a Space, watch: &mut Watch<'_>) -> Result<Self, Stop> {
        Fan::new(space, &space.net.backward, watch)
    }

    fn new(space: &'a Space, rules: &'a Rules, watch: &mut Watch<'_>) -> Result<Self, Stop> {
        debug_assert!(!space.step);
        space.index(watch)?;
        Ok(Fan {
            space,
            rules,
            batch: Batch::new(&space.net),
            candidates: Candidates::new(space.net.words),
            keys: Vec::new(),
            edges: Vec::new(),
            found: Vec::new(),
            asking: Box::new(Asking::new()),
            tried: 0,
        })
    }

    /// Loads up to 64 markings.
    #[inline(always)]
    pub fn load<W: Width>(&mut self, width: W, markings: &[u32]) {
        self.batch.markings.clear();
        for &index in markings {
            self.batch.markings.extend_from_slice(self.space.table.store.get(width, index as usize));
        }
        self.space.cut(width, &mut self.batch);
    }

    /// Loads up to 64 markings that follow each other.
    #[inline(always)]
    pub fn load_range<W: Width>(&mut self, width: W, first: usize, end: usize) {
        self.batch.markings.clear();
        self.space.table.store.copy_range(first, end, &mut self.batch.markings);
        self.space.cut(width, &mut self.batch);
    }

    /// Calls `visit` with the marking (of the batch), the transition and the neighbour of each edge, one transition
    /// after the other; `visit` says whether the marking is done with. Returns the markings that are not.
    ///
    /// An edge may still be visited shortly after its marking is done with. Neighbours that were not found are left out.
    #[inline(always)]
    pub fn each<W: Width>(
        &mut self,
        width: W,
        pending: u64,
        transitions: impl Iterator<Item = usize>,
        visit: &mut impl FnMut(usize, u32, u32) -> bool,
    ) -> u64 {
        let words = width.words();
        let net = &*self.space.net;
        let mut pending = pending & self.batch.valid;
        for t in transitions {
            if pending == 0 {
                break;
            }
            let (base, blocked) = self.rules.test(t, &self.batch.slices, pending);
            let mut fire = base & !blocked & self.rules.edge(t);
            if fire == 0 {
                continue;
            }
            match self.space.set.span() {
                None => {
                    self.candidates.push(width, &self.batch, fire, (net.flip(t, words), net.flip_hashes[t]), 0);
                    while fire != 0 {
                        self.edges.push((fire.trailing_zeros() as u8, t as u32));
                        fire &= fire - 1;
                    }
                }
                Some(span) => {
                    let flip = span.flips[t];
                    while fire != 0 {
                        let j = fire.trailing_zeros();
                        self.keys.push(self.batch.hashes[j as usize] ^ flip);
                        self.edges.push((j as u8, t as u32));
                        fire &= fire - 1;
                    }
                }
            }
            if self.edges.len() >= 64 {
                pending &= !self.ask(width, visit);
            }
        }
        pending & !self.ask(width, visit)
    }

    /// Looks the candidates up and visits those that are markings; returns what is done with.
    #[inline(always)]
    fn ask<W: Width>(&mut self, width: W, visit: &mut impl FnMut(usize, u32, u32) -> bool) -> u64 {
        let found = match self.space.set.find(&self.keys, &mut self.asking) {
            Some(found) => found,
            None => {
                self.space.table.find_batch(width, &mut self.candidates, &mut self.found);
                self.found.as_slice()
            }
        };
        self.tried += self.edges.len() as u64;
        let mut done = 0;
        for (&(j, t), &found) in self.edges.iter().zip(found) {
            if found != NONE && visit(usize::from(j), t, found) {
                done |= 1 << j;
            }
        }
        self.edges.clear();
        self.keys.clear();
        done
    }

    /// For each marking of the batch, how many edges leave it (enter it, backwards), without a look at the table.
    pub fn count(&self, counts: &mut [u32]) {
        counts.fill(0);
        for t in 0..self.space.net.transitions.len() {
            let (base, blocked) = self.rules.test(t, &self.batch.slices, self.batch.valid);
            let mut fire = base & !blocked & self.rules.edge(t);
            while fire != 0 {
                counts[fire.trailing_zeros() as usize] += 1;
                fire &= fire - 1;
            }
        }
    }
}
