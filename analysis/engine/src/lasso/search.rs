//! The search: depth first, with the components on the way and the marks that they hold.
//!
//! Vertices are numbered as they are met, so the number is the time of discovery that the algorithm needs, and the
//! vertices of a component that is still open are those from its root on that are not closed. What is firable at a vertex
//! follows from what was firable before the firing that led there: only transitions that touch what it changed are
//! looked at. These lists lie on a stack, as long as the way from M0.
//!
//! Edges of the automaton are tried in their order, which is that towards acceptance; for each the firings, in the order of
//! the net or, with a seed, in a drawn one. Neither order is better on all nets: the first keeps to few transitions and
//! so comes round soon, the second meets what is rare.

use std::time::{Duration, Instant};

use super::automaton::Automaton;
use super::product::Product;
use super::shortest::Lasso;
use super::sparing::Sparing;
use crate::budget::{Found, Memory, Stop, Watch};
use crate::marking::Width;
use crate::random::Random;
use crate::stubborn::dependencies::negation;
use crate::stubborn::marks::Marks;
use crate::stubborn::search::Prepared;
use crate::table::NONE;
use crate::with_width;

/// The budgets of a search, and the order of its firings.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Most vertices that are stored.
    pub vertices: usize,
    /// Most bytes that are held.
    pub memory_bytes: usize,
    /// Longest time.
    pub time: Option<Duration>,
    /// The seed of a drawn order of firings; none for the order of the net.
    pub seed: Option<u64>,
    /// Whether firings that can wait do (`sparing.rs`): then nothing is concluded from finding no run.
    pub sparing: bool,
}

/// What a search found.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// A run that is accepted.
    pub lasso: Option<Lasso>,
    /// Why the search ended before the answer was known.
    pub stop: Option<Stop>,
    /// Vertices met, pairs of a marking and a state of the automaton.
    pub vertices: usize,
    /// Edges followed.
    pub edges: u64,
    /// How long it took.
    pub seconds: f64,
}

/// A vertex on the way: its edges of the automaton and its firable transitions as ranges of two stacks, those of the latter
/// that are tried now, how far, and whether the rest is tried after them.
#[derive(Clone, Copy, Debug)]
struct Frame {
    vertex: u32,
    edges: (usize, usize),
    firable: (usize, usize),
    now: (usize, usize),
    edge: usize,
    next: usize,
    all: bool,
}

/// A component on the way: its first vertex, the marks of the edge into it and those of the edges inside.
#[derive(Clone, Copy, Debug)]
struct Root {
    vertex: u32,
    into: u64,
    marks: u64,
}

/// Looks for a run that the automaton accepts.
pub fn search(
    prepared: &Prepared,
    automaton: &mut Automaton,
    limits: Limits,
    poll: &mut dyn FnMut(Found) -> Result<(), Stop>,
) -> Outcome {
    let start = Instant::now();
    let mut watch = Watch::new(limits.time.and_then(|time| start.checked_add(time)), poll);
    let mut outcome = Outcome { lasso: None, stop: None, vertices: 0, edges: 0, seconds: 0.0 };
    let words = prepared.net.words + 1;
    match Search::new(prepared, automaton, limits) {
        Ok(mut search) => {
            match with_width!(words, width => search.lasso(width, &mut watch)) {
                Ok(lasso) => outcome.lasso = lasso,
                Err(stop) => outcome.stop = Some(stop),
            }
            (outcome.vertices, outcome.edges) = (search.product.len(), search.product.edges);
        }
        Err(stop) => outcome.stop = Some(stop),
    }
    outcome.seconds = start.elapsed().as_secs_f64();
    outcome
}

struct Search<'a> {
    product: Product<'a>,
    frames: Vec<Frame>,
    roots: Vec<Root>,
    /// The vertices that are not closed, as they were met.
    live: Vec<u32>,
    edges: Vec<u32>,
    firable: Vec<u32>,
    /// Transitions that were looked at for one vertex.
    seen: Marks,
    random: Option<Random>,
    sparing: Option<Sparing<'a>>,
    most: usize,
}

impl<'a> Search<'a> {
    fn new(prepared: &'a Prepared, automaton: &'a mut Automaton, limits: Limits) -> Result<Self, Stop> {
        let memory = Memory::new(limits.memory_bytes);
        memory.claim(4 * prepared.net.transitions.len())?;
        let sparing = limits.sparing.then(|| Sparing::new(prepared, automaton, &memory)).transpose()?;
        Ok(Search {
            product: Product::new(prepared, automaton, memory)?,
            frames: Vec::new(),
            roots: Vec::new(),
            live: Vec::new(),
            edges: Vec::new(),
            firable: Vec::new(),
            seen: Marks::new(prepared.net.transitions.len()),
            random: limits.seed.map(Random::new),
            sparing,
            most: limits.vertices.clamp(1, NONE as usize),
        })
    }

    fn lasso<W: Width>(&mut self, width: W, watch: &mut Watch<'_>) -> Result<Option<Lasso>, Stop> {
        let Some(root) = self.accepting(width, watch)? else { return Ok(None) };
        // The stacks are no longer needed, and what follows needs room.
        for stack in [&mut self.edges, &mut self.firable, &mut self.live] {
            self.product.memory.drop_vec(std::mem::take(stack));
        }
        self.product.memory.drop_vec(std::mem::take(&mut self.frames));
        Lasso::shortest(&mut self.product, width, root, watch).map(Some)
    }

    /// The first vertex of a component that is accepted.
    fn accepting<W: Width>(&mut self, width: W, watch: &mut Watch<'_>) -> Result<Option<u32>, Stop> {
        let all = self.product.automaton.all_marks;
        let mut vertex = self.product.prepared.net.initial.clone();
        vertex.push(0);
        self.product.add(width, &vertex, self.most, watch)?;
        self.enter(0, &vertex, NONE, 0)?;
        while let Some(&Frame { vertex: top, .. }) = self.frames.last() {
            vertex.copy_from_slice(self.product.table.store.get(width, top as usize));
            let Some((t, number)) = self.next(&vertex) else {
                self.leave();
                continue;
            };
            let (target, marks) = {
                let edge = self.product.edge(&vertex, number);
                (edge.target, edge.marks)
            };
            self.product.edges += 1;
            self.product.step(&mut vertex, t, target);
            let Some(known) = self.product.find(width, &vertex) else {
                let new = self.product.add(width, &vertex, self.most, watch)?;
                self.enter(new, &vertex, t, marks)?;
                watch.found = Found { markings: self.product.len() as u64, edges: self.product.edges };
                let (first, end) = self.frames[self.frames.len() - 1].firable;
                watch.tick(2 + end - first + width.words())?;
                continue;
            };
            watch.tick(1)?;
            if !self.product.is_closed(known) {
                if self.join(known, marks) == all {
                    return Ok(self.roots.last().map(|root| root.vertex));
                }
                self.frames.iter_mut().rev().take(1).for_each(|frame| frame.all = true);
            }
        }
        Ok(None)
    }

    /// Makes one component of all that an edge back to a vertex goes round; the marks that it holds.
    fn join(&mut self, back_to: u32, mut marks: u64) -> u64 {
        while let Some(root) = self.roots.pop_if(|root| root.vertex > back_to) {
            marks |= root.marks | root.into;
        }
        self.roots.last_mut().map_or(0, |root| {
            root.marks |= marks;
            root.marks
        })
    }

    /// Goes on to a vertex that was just met, to which `t` led from the last one.
    fn enter(&mut self, number: u32, vertex: &[u64], t: u32, into: u64) -> Result<(), Stop> {
        let (edges, firable) = (self.edges.len(), self.firable.len());
        self.product.admitted(vertex, &mut self.edges)?;
        self.find_firable(vertex, t)?;
        if let Some(random) = &mut self.random {
            let these = &mut self.firable[firable..];
            for i in (1..these.len()).rev() {
                these.swap(i, random.below(i + 1));
            }
        }
        let these = &mut self.firable[firable..];
        let state = vertex[vertex.len() - 1] as usize;
        let marking = &vertex[..vertex.len() - 1];
        let first = self.sparing.as_mut().map_or(these.len(), |sparing| sparing.choose(marking, state, these));
        let memory = &self.product.memory;
        let frame = Frame {
            vertex: number,
            edges: (edges, self.edges.len()),
            firable: (firable, self.firable.len()),
            now: (firable, firable + first),
            edge: edges,
            next: firable,
            all: false,
        };
        memory.push(&mut self.frames, frame)?;
        memory.push(&mut self.roots, Root { vertex: number, into, marks: 0 })?;
        memory.push(&mut self.live, number)
    }

    /// Leaves the last vertex; with the first of a component all of it is closed.
    fn leave(&mut self) {
        let Some(frame) = self.frames.pop() else { return };
        self.edges.truncate(frame.edges.0);
        self.firable.truncate(frame.firable.0);
        if self.roots.pop_if(|root| root.vertex == frame.vertex).is_some() {
            while let Some(one) = self.live.pop_if(|one| *one >= frame.vertex) {
                self.product.close(one);
            }
        }
    }

    /// The next firing (`NONE`: the stutter) at the last vertex, with the number of the edge of the automaton.
    fn next(&mut self, vertex: &[u64]) -> Option<(u32, u32)> {
        let frame = self.frames.last_mut()?;
        loop {
            let (first, end) = frame.now;
            while frame.edge < frame.edges.1 {
                let number = self.edges[frame.edge];
                let edge = self.product.edge(vertex, number);
                while frame.next < end {
                    let t = self.firable[frame.next];
                    frame.next += 1;
                    if edge.admits.has(t) {
                        return Some((t, number));
                    }
                }
                frame.next = first;
                frame.edge += 1;
                if first == end && edge.stutters {
                    return Some((NONE, number));
                }
            }
            if !frame.all || end == frame.firable.1 {
                return None;
            }
            frame.now = (end, frame.firable.1);
            (frame.edge, frame.next) = (frame.edges.0, end);
        }
    }

    /// Appends what is firable at a vertex, ascending, from what was so before `t` fired.
    fn find_firable(&mut self, vertex: &[u64], t: u32) -> Result<(), Stop> {
        let Prepared { dependencies, .. } = self.product.prepared;
        let memory = &self.product.memory;
        let begin = self.firable.len();
        let Some(&Frame { firable: (first, end), .. }) = self.frames.last() else {
            let mut all = Vec::new();
            dependencies.all_firable(&vertex[..vertex.len() - 1], &mut all);
            return all.into_iter().try_for_each(|u| memory.push(&mut self.firable, u));
        };
        if t == NONE {
            return Ok(());
        }
        self.seen.clear();
        for at in first..end {
            let u = self.firable[at];
            self.seen.insert(u);
            if dependencies.firable(u, vertex) {
                memory.push(&mut self.firable, u)?;
            }
        }
        for &l in dependencies.flipped(t) {
            for &u in dependencies.needers.of(negation(l)) {
                if self.seen.insert(u) && dependencies.firable(u, vertex) {
                    memory.push(&mut self.firable, u)?;
                }
            }
        }
        self.firable[begin..].sort_unstable();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::lasso::automaton::{Admits, Edge};
    use crate::marking::Fixed;
    use crate::net::{Net, Transition};
    use crate::stubborn::dependencies::literal;
    use crate::stubborn::formula::{Formula, Node};

    fn arc(from: u32, to: u32) -> Transition {
        Transition::new(&[from], &[to], &[], &[], &[])
    }

    /// One state: an edge with mark i where place i is full.
    fn again_and_again(places: &[u32], count: usize) -> Automaton {
        let label = |&p: &u32| Formula::new(vec![Node::Literal(literal(p, true))], count).expect("well formed");
        let edge = |i: usize| Edge {
            label: i as u32,
            admits: Admits::AllBut(vec![]),
            stutters: true,
            target: 0,
            marks: 1 << i,
        };
        let mut labels: Vec<Formula> = places.iter().map(label).collect();
        labels.push(Formula::new(vec![Node::All(vec![])], count).expect("true"));
        let mut edges: Vec<Edge> = (0..places.len()).map(edge).collect();
        edges.push(Edge { marks: 0, ..edge(places.len()) });
        Automaton::new(labels, vec![edges], places.len() as u32, 9).expect("well formed")
    }

    fn outcome(net: Net, automaton: &mut Automaton, seed: Option<u64>) -> Outcome {
        let limits = Limits { vertices: 1 << 20, memory_bytes: 1 << 20, time: None, seed, sparing: false };
        search(&Prepared::new(net), automaton, limits, &mut unwatched)
    }

    /// Two rings that share place 0, one of 1 and 2, the other of 3 and 4; from 2 a way out to 5, where it ends.
    fn rings() -> Net {
        let arcs = [(0, 1), (1, 2), (2, 0), (0, 3), (3, 4), (4, 0), (2, 5)];
        Net::new(6, arcs.iter().map(|&(a, b)| arc(a, b)).collect(), &[0]).expect("well formed")
    }

    #[test]
    fn an_accepted_cycle_goes_through_each_place_that_is_asked_for() {
        for seed in [None, Some(1), Some(2), Some(3)] {
            let found = outcome(rings(), &mut again_and_again(&[2, 4], 6), seed);
            let lasso = found.lasso.expect("there is one");
            assert_eq!(lasso.cycle.len(), 6);
            assert!(lasso.cycle.contains(&1) && lasso.cycle.contains(&4));
        }
    }

    #[test]
    fn what_is_never_met_again_is_not_accepted_and_a_deadlock_stutters() {
        let found = outcome(rings(), &mut again_and_again(&[5, 0], 6), None);
        assert_eq!((found.lasso, found.stop, found.vertices), (None, None, 6));
        let found = outcome(rings(), &mut again_and_again(&[5], 6), None);
        assert_eq!(found.lasso, Some(Lasso { prefix: vec![0, 1, 6], cycle: vec![] }));
    }

    #[test]
    fn a_budget_of_vertices_or_of_memory_is_a_stop() {
        let limits = Limits { vertices: 3, memory_bytes: 1 << 20, time: None, seed: None, sparing: false };
        let mut automaton = again_and_again(&[5, 0], 6);
        let found = search(&Prepared::new(rings()), &mut automaton, limits, &mut unwatched);
        assert_eq!((found.lasso, found.stop), (None, Some(Stop::Markings)));
        let limits = Limits { vertices: 100, memory_bytes: 100, ..limits };
        let found = search(&Prepared::new(rings()), &mut automaton, limits, &mut unwatched);
        assert_eq!((found.lasso, found.stop), (None, Some(Stop::Memory)));
    }

    #[test]
    fn the_table_of_vertices_does_not_grow_past_the_end_of_time() {
        let (prepared, mut automaton) = (Prepared::new(rings()), again_and_again(&[5], 6));
        let mut product = Product::new(&prepared, &mut automaton, Memory::new(1 << 24)).expect("fits");
        let (width, mut poll) = (Fixed::<2>, unwatched);
        let mut late = Watch::new(Some(Instant::now()), &mut poll);
        let mut add = |product: &mut Product<'_>, i: u64| product.add(width, &[i, 0], usize::MAX, &mut late);
        assert_eq!((0..1 << 20).find_map(|i| add(&mut product, i).err()), Some(Stop::Time));
        // What was met before is still there, and with more time there is room for more.
        let met = product.len() as u64;
        assert!(met > 0 && (0..met).all(|i| product.find(width, &[i, 0]) == Some(i as u32)));
        let mut poll = unwatched;
        let added = product.add(width, &[met, 0], usize::MAX, &mut Watch::new(None, &mut poll));
        assert_eq!((added, product.find(width, &[met, 0])), (Ok(met as u32), Some(met as u32)));
    }
}
