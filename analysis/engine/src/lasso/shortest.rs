//! The run that is shown: short, whatever the way on which the search came to it.
//!
//! Given the first vertex of a component that is accepted, three kinds of ways are looked for breadth first among the
//! vertices that are not closed: a nearest vertex of the component from M0; from there, within the component, a nearest
//! edge with a mark that is missing, until none is; and back. The whole is not the shortest lasso there is, which is
//! hard to find; each part is a shortest one among what was met.

use super::product::Product;
use crate::budget::{Stop, Watch};
use crate::marking::Width;
use crate::table::NONE;

/// A run: what is fired first, and what is fired for ever; nothing, where the first part ends in a deadlock.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lasso {
    /// The firings from M0.
    pub prefix: Vec<u32>,
    /// The firings of the cycle.
    pub cycle: Vec<u32>,
}

/// How a vertex was reached: from which one, by which firing and by which edge of the automaton.
type Step = (u32, u32, u32);

/// A way: its firings and stutters, the marks met on it, and where it ends.
struct Way {
    firings: Vec<u32>,
    marks: u64,
    end: u32,
}

impl Lasso {
    /// A short lasso into and around the component that begins with a vertex; all of it holds each mark.
    pub(super) fn shortest<W: Width>(
        product: &mut Product<'_>,
        width: W,
        root: u32,
        watch: &mut Watch<'_>,
    ) -> Result<Self, Stop> {
        let all = product.automaton.all_marks;
        let prefix = match root {
            0 => Way { firings: Vec::new(), marks: 0, end: 0 },
            _ => way(product, width, 0, 0, |_, to| to >= root, watch)?,
        };
        let begin = prefix.end;
        let mut round = Way { firings: Vec::new(), marks: 0, end: begin };
        while round.marks != all {
            let missing = all & !round.marks;
            round.follow(way(product, width, round.end, root, |marks, _| marks & missing != 0, watch)?);
        }
        if round.end != begin || round.firings.is_empty() {
            round.follow(way(product, width, round.end, root, |_, to| to == begin, watch)?);
        }
        let fired = |way: Way| way.firings.into_iter().filter(|&t| t != NONE).collect();
        Ok(Lasso { prefix: fired(prefix), cycle: fired(round) })
    }
}

impl Way {
    fn follow(&mut self, other: Way) {
        self.firings.extend(other.firings);
        self.marks |= other.marks;
        self.end = other.end;
    }
}

/// A shortest way from a vertex whose last edge has marks and leads to a vertex as `goal` wants them, through vertices
/// from `least` on that are not closed.
fn way<W: Width>(
    product: &mut Product<'_>,
    width: W,
    from: u32,
    least: u32,
    goal: impl Fn(u64, u32) -> bool,
    watch: &mut Watch<'_>,
) -> Result<Way, Stop> {
    let count = product.len();
    let steps: Vec<Step> = product.memory.filled((NONE, NONE, NONE), count)?;
    let mut wave = Wave { from, least, steps, queue: Vec::new(), edges: Vec::new() };
    let found = wave.spread(product, width, goal, watch);
    let way = found.map(|(last, end)| wave.way_to(product, width, last, end));
    product.memory.drop_vec(wave.steps);
    product.memory.drop_vec(wave.queue);
    product.memory.drop_vec(wave.edges);
    way
}

/// A search breadth first.
struct Wave {
    from: u32,
    least: u32,
    steps: Vec<Step>,
    queue: Vec<u32>,
    edges: Vec<u32>,
}

impl Wave {
    /// The last edge of the way, and where it ends.
    fn spread<W: Width>(
        &mut self,
        product: &mut Product<'_>,
        width: W,
        goal: impl Fn(u64, u32) -> bool,
        watch: &mut Watch<'_>,
    ) -> Result<(Step, u32), Stop> {
        let words = product.prepared.net.words;
        let (mut vertex, mut after, mut firable) = (vec![0; words + 1], vec![0; words + 1], Vec::new());
        product.memory.push(&mut self.queue, self.from)?;
        let mut next = 0;
        while let Some(&at) = self.queue.get(next) {
            next += 1;
            vertex.copy_from_slice(product.table.store.get(width, at as usize));
            self.edges.clear();
            product.admitted(&vertex, &mut self.edges)?;
            product.prepared.dependencies.all_firable(&vertex[..words], &mut firable);
            if firable.is_empty() {
                firable.push(NONE);
            }
            watch.tick(2 + self.edges.len() * firable.len() + words)?;
            for &number in &self.edges {
                let edge = product.edge(&vertex, number);
                for &t in &firable {
                    if !(if t == NONE { edge.stutters } else { edge.admits.has(t) }) {
                        continue;
                    }
                    after.copy_from_slice(&vertex);
                    product.step(&mut after, t, edge.target);
                    let met = product.find(width, &after);
                    let Some(to) = met.filter(|&to| to >= self.least && !product.is_closed(to)) else { continue };
                    if goal(edge.marks, to) {
                        return Ok(((at, t, number), to));
                    }
                    if to != self.from && self.steps[to as usize].0 == NONE {
                        self.steps[to as usize] = (at, t, number);
                        product.memory.push(&mut self.queue, to)?;
                    }
                }
            }
        }
        unreachable!("the search has met such a way, and all of it is open")
    }

    fn way_to<W: Width>(&self, product: &Product<'_>, width: W, last: Step, end: u32) -> Way {
        let mut way = Way { firings: Vec::new(), marks: 0, end };
        let (mut at, mut t, mut number) = last;
        loop {
            way.firings.push(t);
            way.marks |= product.edge(product.table.store.get(width, at as usize), number).marks;
            if at == self.from {
                break;
            }
            (at, t, number) = self.steps[at as usize];
        }
        way.firings.reverse();
        way
    }
}
