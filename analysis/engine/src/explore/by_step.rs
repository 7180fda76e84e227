//! The exploration by synchronous steps: which transitions are firable is read off the bit slices of 64 markings, as
//! under interleaving; the steps of each marking are then made of its components' choices (`step.rs`), one by one.
//!
//! Rejected: to find the way back by rules that run backwards, as under interleaving: which transitions a step has
//! taken together, nothing says of one marking alone; so the marking from which each was found first is stored.
//! Successors are looked up as they are made. Not tried: to gather them for batches, as under interleaving.

use std::rc::Rc;

use super::Space;
use crate::batch::Batch;
use crate::budget::{Found, Stop, Watch};
use crate::marking::{Width, linear_hash};
use crate::net::Net;
use crate::step::{Factor, Steps};
use crate::table::NONE;

impl Space {
    /// Explores until all is found.
    pub(super) fn run_step<W: Width>(
        &mut self,
        width: W,
        net: &Net,
        steps: &mut Steps<'_>,
        max: usize,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        let words = width.words();
        let initial = &net.initial;
        self.table.insert(width, initial, linear_hash(width, initial), max, &self.memory)?;
        self.memory.push(&mut self.parents, NONE)?;
        let mut batch = Batch::new(net);
        let mut firable: Vec<Vec<u32>> = vec![Vec::new(); 64];
        let (mut next, mut end) = (0, 1);
        while self.level_end(next, &mut end)? {
            let stop = end.min(next + 64);
            batch.markings.clear();
            self.table.store.copy_range(next, stop, &mut batch.markings);
            batch.cut(width);
            let mut alive = 0;
            firable.iter_mut().for_each(Vec::clear);
            for t in 0..net.transitions.len() {
                let (base, blocked) = net.forward.test(t, &batch.slices, batch.valid);
                if base & blocked != 0 {
                    self.note_contact(t, next, base & blocked);
                }
                let mut fire = base & !blocked & net.forward.edge(t);
                alive |= fire;
                while fire != 0 {
                    firable[fire.trailing_zeros() as usize].push(t as u32);
                    fire &= fire - 1;
                }
            }
            self.note_deadlocks(next, batch.valid & !alive)?;
            for (j, firable) in firable.iter().enumerate().take(batch.count) {
                let marking = &batch.markings[j * words..(j + 1) * words];
                let factors = steps.factors(firable, &self.memory, watch)?;
                self.table.make_room(width, 1, &self.memory, watch)?;
                let (table, memory, parents) = (&mut self.table, &self.memory, &mut self.parents);
                let mut edges = 0;
                Steps::each(width, marking, batch.hashes[j], &factors, watch, &mut |_, after, hash| {
                    if table.insert(width, after, hash, max, memory)? {
                        memory.push(parents, (next + j) as u32)?;
                    }
                    edges += 1;
                    Ok(())
                })?;
                self.edges += edges;
                self.note_fired(&factors);
                watch.found = Found { markings: self.table.store.len() as u64, edges: self.edges };
                watch.tick(1)?;
            }
            next = stop;
        }
        Ok(())
    }

    /// Counts for each transition the combinations of choices that fire it.
    fn note_fired(&mut self, factors: &[Rc<[Factor]>]) {
        let all: u64 = factors.iter().flat_map(|part| part.iter()).map(|factor| factor.len() as u64).product();
        for factor in factors.iter().flat_map(|part| part.iter()) {
            for choice in factor {
                for &t in &choice.fired {
                    self.fired[t as usize] += all / factor.len() as u64;
                }
            }
        }
    }
}
