//! The markings that a net reaches, as a diagram, and the operators of temporal logic on its sets.
//!
//! An operation that ends for want of memory is tried once more with the garbage gone. The nodes in use are the caller's to
//! name, as it is the caller who knows which sets are still wanted.

use super::algebra::{Binary, Diagram};
use super::blocks::Blocks;
use super::cache::ANY;
use super::count::{self, Natural};
use super::events::{Suffix, Table};
use super::greatest::greatest;
use super::image::{All, image};
pub use super::ordered::Events;
use super::ordered::Ordered;
use super::passing::passing;
pub use super::saturation::By;
use super::saturation::{Saturation, Workshop};
use super::walk::Walks;
use super::zdd::{EMPTY, Node, Store};
use crate::budget::{Stop, Watch};
use crate::net::Transition;

/// A net with the markings that it reaches.
#[derive(Debug)]
pub struct Symbolic {
    /// The transitions, by index.
    pub transitions: Vec<Transition>,
    ordered: Ordered,
    /// The reachable markings.
    pub reach: Node,
    /// The set of M0 alone.
    pub start: Node,
    /// The places that hold a token in M0.
    pub initial: Vec<u32>,
    /// How many events the search fired on nodes.
    pub fired: u64,
    /// How many nodes were in use when the search ended, dead ones included.
    pub nodes: usize,
    /// What is remembered of the firing sequences found.
    pub(super) walks: Walks,
}

impl Symbolic {
    /// The space of a search that has ended.
    pub(super) fn found(
        (mut ordered, search, start): (Ordered, Saturation, Node),
        transitions: Vec<Transition>,
        initial: Vec<u32>,
        reach: Node,
        bytes: usize,
    ) -> Self {
        let (fired, nodes) = (search.fired(), ordered.diagram.store.used());
        search.finish(&ordered.diagram);
        ordered.diagram.store.memory.allow(bytes);
        Self::new((ordered, start), transitions, initial, reach, (fired, nodes))
    }

    /// The space of these markings, with what finding them took.
    pub(super) fn new(
        (ordered, start): (Ordered, Node),
        transitions: Vec<Transition>,
        initial: Vec<u32>,
        reach: Node,
        (fired, nodes): (u64, usize),
    ) -> Self {
        Symbolic { transitions, ordered, reach, start, initial, fired, nodes, walks: Walks::default() }
    }

    /// Nodes and results.
    pub fn diagram(&mut self) -> &mut Diagram {
        &mut self.ordered.diagram
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.ordered.diagram.store.memory.used()
    }

    pub(super) fn store(&self) -> &Store {
        &self.ordered.diagram.store
    }

    pub(super) fn blocks(&self) -> &Blocks {
        &self.ordered.blocks
    }

    /// The place of each level but 0.
    pub fn place_at(&self) -> &[u32] {
        &self.ordered.place_at
    }

    /// The level of each place.
    pub fn level_of(&self) -> &[u32] {
        &self.ordered.level_of
    }

    /// Runs an operation, and once more with the garbage gone if memory ended in it.
    fn again<T>(
        &mut self,
        roots: &[Node],
        held: &[Node],
        mut work: impl FnMut(&mut Self, &[Node]) -> Result<T, Stop>,
    ) -> Result<T, Stop> {
        let all: Vec<Node> = roots.iter().chain(held).copied().chain([self.reach, self.start]).collect();
        if self.ordered.diagram.store.due() {
            self.ordered.diagram.collect(all.iter().copied())?;
        }
        match work(self, &all) {
            Err(Stop::Memory) => {
                self.ordered.diagram.collect(all.iter().copied())?;
                work(self, &all)
            }
            result => result,
        }
    }

    /// A Boolean operation; `roots` are the nodes in use, here as in what follows.
    pub fn binary(
        &mut self,
        roots: &[Node],
        binary: Binary,
        a: Node,
        b: Node,
        watch: &mut Watch<'_>,
    ) -> Result<Node, Stop> {
        self.again(roots, &[a, b], |space, _| space.ordered.diagram.binary(binary, a, b, watch))
    }

    /// The set of one marking, given by its places.
    pub fn single(&mut self, roots: &[Node], marked: &[u32]) -> Result<Node, Stop> {
        self.again(roots, &[], |space, _| space.ordered.single(marked))
    }

    /// The markings of a set in which given places are full and others empty.
    pub fn having(
        &mut self,
        roots: &[Node],
        set: Node,
        full: &[u32],
        empty: &[u32],
        watch: &mut Watch<'_>,
    ) -> Result<Node, Stop> {
        let test = Transition::new(&[], &[], full, empty, &[]);
        self.again(roots, &[set], |space, _| {
            let Some(event) = space.ordered.event(&test, Events::Tests)? else { return Ok(EMPTY) };
            image(&mut space.ordered.diagram, &space.ordered.suffixes, event, set, watch)
        })
    }

    /// The markings of a set in which a transition may fire.
    pub fn firable(&mut self, roots: &[Node], set: Node, t: usize, watch: &mut Watch<'_>) -> Result<Node, Stop> {
        self.one(roots, set, t, Events::Tests, watch)
    }

    /// The image of a set under one transition, forwards, backwards, or as a test.
    pub fn one(
        &mut self,
        roots: &[Node],
        set: Node,
        t: usize,
        which: Events,
        watch: &mut Watch<'_>,
    ) -> Result<Node, Stop> {
        self.again(roots, &[set], |space, _| {
            let Some(event) = space.ordered.event(&space.transitions[t], which)? else { return Ok(EMPTY) };
            image(&mut space.ordered.diagram, &space.ordered.suffixes, event, set, watch)
        })
    }

    /// The union of the images of a set under all events of a table.
    ///
    /// Forwards and backwards that leaves out the transitions that change nothing.
    pub fn all(&mut self, roots: &[Node], set: Node, which: Events, watch: &mut Watch<'_>) -> Result<Node, Stop> {
        self.again(roots, &[set], |space, roots| {
            space.ordered.table(which, &space.transitions)?;
            let levels = space.ordered.levels();
            let Ordered { diagram, suffixes, tables, .. } = &mut space.ordered;
            let Some(table) = &tables[which as usize] else { return Ok(EMPTY) };
            All { diagram, suffixes, table, number: which as u32, roots }.image(set, levels, watch)
        })
    }

    /// For each test, whether some marking of a set has its first places full and its second ones empty.
    pub fn which(
        &mut self,
        roots: &[Node],
        set: Node,
        tests: &[(Vec<u32>, Vec<u32>)],
        watch: &mut Watch<'_>,
    ) -> Result<Vec<bool>, Stop> {
        self.again(roots, &[set], |space, roots| {
            let events = space.events_of(tests)?;
            let all: Vec<Suffix> = events.iter().flatten().copied().collect();
            let levels = space.ordered.levels();
            let Ordered { diagram, suffixes, .. } = &mut space.ordered;
            let table = Table::new(suffixes, all, levels);
            let number = u32::MAX >> 4; // nothing is remembered of the table as a whole
            let found = All { diagram, suffixes, table: &table, number, roots }.firing(set, levels, watch)?;
            Ok(events.iter().map(|event| event.is_some_and(|event| found.contains(&event))).collect())
        })
    }

    /// The markings with a firing into a set, among the reachable ones (EX).
    pub fn before(&mut self, roots: &[Node], set: Node, watch: &mut Watch<'_>) -> Result<Node, Stop> {
        let changed = self.all(roots, set, Events::Backward, watch)?;
        let mut all = self.binary(roots, Binary::Intersection, changed, self.reach, watch)?;
        // What changes nothing is a loop at each marking where it may fire.
        let still: Vec<usize> = (0..self.transitions.len())
            .filter(|&t| self.transitions[t].inputs.is_empty() && self.transitions[t].outputs.is_empty())
            .collect();
        for t in still {
            let held = [roots, &[all, set]].concat();
            let loops = self.firable(&held, set, t, watch)?;
            all = self.binary(&held, Binary::Union, all, loops, watch)?;
        }
        Ok(all)
    }

    /// The same, of one of these transitions.
    pub fn before_by(&mut self, roots: &[Node], set: Node, by: &[usize], watch: &mut Watch<'_>) -> Result<Node, Stop> {
        let mut all = EMPTY;
        for &t in by {
            let held = [roots, &[all, set]].concat();
            let one = self.one(&held, set, t, Events::Backward, watch)?;
            all = self.binary(&held, Binary::Union, all, one, watch)?;
        }
        self.binary(&[roots, &[set]].concat(), Binary::Intersection, all, self.reach, watch)
    }

    fn levels_of(&self, marked: &[u32]) -> Vec<u32> {
        let mut levels: Vec<u32> = marked.iter().map(|&place| self.ordered.level_of[place as usize]).collect();
        levels.sort_unstable();
        levels
    }

    /// Whether a set holds the marking of these places.
    pub fn contains(&self, set: Node, marked: &[u32]) -> bool {
        self.ordered.diagram.contains(set, &self.levels_of(marked))
    }

    /// The places of some marking of a set, ascending.
    pub fn any(&self, set: Node) -> Option<Vec<u32>> {
        self.ordered.diagram.any(set).map(|levels| self.places_at(levels))
    }

    fn places_at(&self, levels: Vec<u32>) -> Vec<u32> {
        let mut places: Vec<u32> = levels.into_iter().map(|level| self.ordered.place_at[level as usize]).collect();
        places.sort_unstable();
        places
    }

    /// The places of a marking of a set with most tokens on some places, ascending; one that stands twice counts twice.
    pub fn greatest(&self, set: Node, on: &[u32], watch: &mut Watch<'_>) -> Result<Option<Vec<u32>>, Stop> {
        let mut weights = vec![0; self.ordered.place_at.len()];
        on.iter().for_each(|&place| weights[self.ordered.level_of[place as usize] as usize] += 1);
        let levels = greatest(&self.ordered.diagram, set, &weights, watch)?;
        Ok(levels.map(|levels| self.places_at(levels)))
    }

    /// The closure of a set under the firings, or backwards under their reverses, within a set (`ANY`: all markings).
    ///
    /// The chosen transitions are those of the last `backward` with some.
    pub fn closure(
        &mut self,
        roots: &[Node],
        set: Node,
        within: Node,
        by: By,
        watch: &mut Watch<'_>,
    ) -> Result<Node, Stop> {
        let all = self.blocks().len() as u32;
        self.closure_up_to(roots, (set, within), by, all, watch)
    }

    /// The same of sets of what lies up to a block, under the firings that have nothing to do with what lies above it.
    pub(super) fn closure_up_to(
        &mut self,
        roots: &[Node],
        (set, within): (Node, Node),
        by: By,
        block: u32,
        watch: &mut Watch<'_>,
    ) -> Result<Node, Stop> {
        let held = [set, if within == ANY { EMPTY } else { within }];
        self.again(roots, &held, |space, roots| {
            space.ordered.agenda(by, &space.transitions)?;
            let Ordered { diagram, blocks, parts, agendas, .. } = &mut space.ordered;
            let Some(agenda) = &agendas[by as usize] else { return Ok(EMPTY) };
            let mut search = Saturation::new(diagram, blocks, (set, within), block, by)?;
            let mut shop = Workshop { diagram, blocks, parts, agenda, roots };
            let result = search.run(&mut shop, u64::MAX, watch);
            search.finish(diagram);
            Ok(result?.unwrap_or(EMPTY))
        })
    }

    /// The markings from which a target can be reached, every marking before it in `within`, by some transitions or all.
    pub fn backward(
        &mut self,
        roots: &[Node],
        targets: Node,
        within: Node,
        by: Option<&[usize]>,
        watch: &mut Watch<'_>,
    ) -> Result<Node, Stop> {
        if let Some(by) = by {
            self.again(roots, &[targets, within], |space, _| space.ordered.choose(&space.transitions, by))?;
        }
        let inside = self.binary(roots, Binary::Intersection, targets, within, watch)?;
        let mut seeds = inside;
        if inside != targets {
            // Targets outside are not gone through; their predecessors inside are where the search begins.
            let held = [roots, &[inside, targets, within]].concat();
            let before = match by {
                None => self.before(&held, targets, watch)?,
                Some(by) => self.before_by(&held, targets, by, watch)?,
            };
            let before = self.binary(&held, Binary::Intersection, before, within, watch)?;
            seeds = self.binary(&held, Binary::Union, before, inside, watch)?;
        }
        let held = [roots, &[targets, within, seeds]].concat();
        let firings = if by.is_some() { By::Chosen } else { By::Backward };
        let reached = self.closure(&held, seeds, within, firings, watch)?;
        self.binary(&held, Binary::Union, reached, targets, watch)
    }

    /// How many markings a set holds.
    pub fn count(&self, set: Node, watch: &mut Watch<'_>) -> Result<Natural, Stop> {
        count::markings(&self.ordered.diagram, set, watch)
    }

    /// For each test, in how many markings of a set its first places are full and its second ones empty.
    pub fn counts(
        &mut self,
        roots: &[Node],
        set: Node,
        tests: &[(Vec<u32>, Vec<u32>)],
        watch: &mut Watch<'_>,
    ) -> Result<Vec<Natural>, Stop> {
        self.again(roots, &[set], |space, _| {
            let mut counts = vec![Natural::new(); tests.len()];
            let (mut at, mut events) = (Vec::new(), Vec::new());
            for (number, event) in space.events_of(tests)?.into_iter().enumerate() {
                if let Some(event) = event {
                    at.push(number);
                    events.push(event);
                }
            }
            let Ordered { diagram, suffixes, .. } = &space.ordered;
            for (number, count) in at.into_iter().zip(passing(diagram, suffixes, &events, set, watch)?) {
                counts[number] = count;
            }
            Ok(counts)
        })
    }

    /// The suffixes of tests; None where a place would have to be both full and empty.
    fn events_of(&mut self, tests: &[(Vec<u32>, Vec<u32>)]) -> Result<Vec<Option<Suffix>>, Stop> {
        let mut event = |(full, empty): &(Vec<u32>, Vec<u32>)| {
            self.ordered.event(&Transition::new(&[], &[], full, empty, &[]), Events::Tests)
        };
        tests.iter().map(&mut event).collect()
    }

    /// How many pairs there are of a marking of a set and a transition that may fire in it.
    pub fn edges(&mut self, set: Node, watch: &mut Watch<'_>) -> Result<Natural, Stop> {
        self.ordered.table(Events::Tests, &self.transitions)?;
        let levels = self.ordered.levels();
        let Ordered { diagram, suffixes, tables, .. } = &self.ordered;
        let Some(table) = &tables[Events::Tests as usize] else { return Ok(Natural::new()) };
        count::edges(diagram, suffixes, table, set, levels, watch)
    }
}
