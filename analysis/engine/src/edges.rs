//! The edges that leave markings, computed again from the rule, 64 markings at a time as in the exploration.
//!
//! Storing them was rejected, but for questions that go against them again and again (`fixpoints.rs`): they are recomputed
//! faster than they are read back, and cost more than the markings.

use crate::batch::Batch;
use crate::budget::{Memory, Stop, Watch};
use crate::explore::Space;
use crate::marking::Width;
use crate::step::{Choice, Steps};
use crate::with_width;

/// What fires on an edge.
#[derive(Clone, Copy, Debug)]
pub enum Fired<'a> {
    /// One transition.
    One(u32),
    /// The choices of a step.
    Step(&'a [&'a Choice]),
}

impl Fired<'_> {
    /// Whether one of the transitions is such.
    pub fn any(self, such: impl Fn(u32) -> bool) -> bool {
        match self {
            Fired::One(t) => such(t),
            Fired::Step(choices) => choices.iter().any(|choice| choice.fired.iter().any(|&t| such(t))),
        }
    }

    /// Calls `visit` with each of the transitions.
    pub fn each(self, visit: &mut impl FnMut(u32)) {
        match self {
            Fired::One(t) => visit(t),
            Fired::Step(choices) => choices.iter().flat_map(|choice| choice.fired.iter()).for_each(|&t| visit(t)),
        }
    }

    /// The transitions, ascending.
    pub fn transitions(self) -> Vec<u32> {
        match self {
            Fired::One(t) => vec![t],
            Fired::Step(choices) => {
                let mut all: Vec<u32> = choices.iter().flat_map(|choice| choice.fired.iter().copied()).collect();
                all.sort_unstable();
                all
            }
        }
    }
}

/// The edges that leave markings, computed again from the rule.
pub struct Edges<'a> {
    space: &'a Space,
    steps: Option<Steps<'a>>,
    /// For each marking of the batch, the firable and openable transitions.
    firable: Vec<Vec<u32>>,
    batch: Batch,
}

impl<'a> Edges<'a> {
    /// Edges of a space.
    pub fn new(space: &'a Space) -> Self {
        Edges {
            space,
            steps: space.step.then(|| Steps::new(&space.net, &space.components)),
            firable: vec![Vec::new(); 64],
            batch: Batch::new(&space.net),
        }
    }

    /// Loads up to 64 markings and finds what is firable and openable at each.
    pub fn load(&mut self, sources: &[u32]) {
        let space = self.space;
        let batch = &mut self.batch;
        batch.markings.clear();
        for &source in sources {
            batch.markings.extend_from_slice(space.marking(source as usize));
        }
        with_width!(space.net.words, width => space.cut(width, batch));
        self.firable.iter_mut().for_each(Vec::clear);
        for t in 0..space.net.transitions.len() {
            let (base, blocked) = space.net.forward.test(t, &batch.slices, batch.valid);
            let mut fire = base & !blocked & space.net.forward.edge(t);
            while fire != 0 {
                self.firable[fire.trailing_zeros() as usize].push(t as u32);
                fire &= fire - 1;
            }
        }
    }

    /// What is firable and openable at marking `j` of the batch loaded last.
    pub fn firable(&self, j: usize) -> &[u32] {
        &self.firable[j]
    }

    /// Visits the edges of up to 64 markings in their order, those of one marking in the order of the transitions
    /// (interleaving) or of the choices (step). Targets that were not found, of an incomplete graph, are left out. Whoever
    /// visits many calls `Space::index` before.
    pub fn visit(
        &mut self,
        sources: &[u32],
        memory: &Memory,
        watch: &mut Watch<'_>,
        visit: &mut impl FnMut(u32, Fired<'_>, u32) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        self.load(sources);
        with_width!(self.space.net.words, width => self.visit_loaded(width, sources, memory, watch, visit))
    }

    fn visit_loaded<W: Width>(
        &mut self,
        width: W,
        sources: &[u32],
        memory: &Memory,
        watch: &mut Watch<'_>,
        visit: &mut impl FnMut(u32, Fired<'_>, u32) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        let space = self.space;
        let words = width.words();
        let mut after = vec![0; words];
        for (j, &source) in sources.iter().enumerate() {
            let marking = &self.batch.markings[j * words..(j + 1) * words];
            let hash = self.batch.hashes[j];
            match &mut self.steps {
                Some(steps) => {
                    let factors = steps.factors(&self.firable[j], memory, watch)?;
                    Steps::each(width, marking, hash, &factors, watch, &mut |chosen, after, hash| match space
                        .table
                        .find(width, after, hash)
                    {
                        Some(target) => visit(source, Fired::Step(chosen), target),
                        None => Ok(()),
                    })?;
                }
                None => {
                    for &t in &self.firable[j] {
                        let flip = space.net.flip(t as usize, words);
                        for k in 0..words {
                            after[k] = marking[k] ^ flip[k];
                        }
                        let hash = hash ^ space.flip_hash(t as usize);
                        if let Some(target) = space.find_told(width, &after, hash) {
                            visit(source, Fired::One(t), target)?;
                        }
                    }
                    watch.tick(1 + self.firable[j].len())?;
                }
            }
        }
        Ok(())
    }

    /// Gives back what solved components took.
    pub fn finish(mut self, memory: &Memory) {
        if let Some(steps) = &mut self.steps {
            steps.forget(memory);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::samples::{explore, machines};

    #[test]
    fn edges_computed_again_are_those_explored() {
        for step in [false, true] {
            let space = explore(machines(7, 60), step);
            let memory = Memory::new(1 << 20);
            let mut poll = unwatched;
            let mut watch = Watch::new(None, &mut poll);
            let mut edges = Edges::new(&space);
            let mut count = 0;
            let sources: Vec<u32> = (0..space.len() as u32).collect();
            for part in sources.chunks(64) {
                edges
                    .visit(part, &memory, &mut watch, &mut |_, _, _| {
                        count += 1;
                        Ok(())
                    })
                    .expect("fits");
            }
            edges.finish(&memory);
            assert_eq!((count, memory.used()), (space.edges, 0));
        }
    }
}
