//! The markings that a net reaches, as a diagram, and the operators of temporal logic on its sets.
//!
//!
//! An operation that ends for want of memory is tried once more with the garbage gone. The nodes in use are the caller's to
//! name, as it is the caller who knows which sets are still wanted.

use super::algebra::{Binary, Diagram};
use super::cache::ANY;
use super::count::{self, Natural};
use super::events::{Sense, Suffix, Suffixes, Table, contact_literals, literals};
use super::image::{All, image};
use super::order::Order;
use super::saturation::{Saturation, Workshop};
use super::walk::LAYERS_WORK;
use super::zdd::{EMPTY, Node};
use crate::budget::{Memory, Stop, Watch};
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
    level_of: Vec<u32>,
    /// The place of each level but 0.
    place_at: Vec<u32>,
    pub(super) diagram: Diagram,
    pub(super) suffixes: Suffixes,
    pub(super) tables: [Option<Table>; 4],
    claimed: usize,
}

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
    /// What the next search for a firing sequence may spend on layers.
    pub(super) layers_work: u64,
}

impl Ordered {
    /// An empty diagram, and the firings in it.
    pub(super) fn new(places: usize, transitions: &[Transition], order: &Order, bytes: usize) -> Result<Self, Stop> {
        let mut level_of = vec![0; places];
        let mut place_at = vec![0; places + 1];
        for (at, &place) in order.iter().enumerate() {
            level_of[place as usize] = at as u32 + 1;
            place_at[at + 1] = place;
        }
        let diagram = Diagram::new(Memory::new(bytes), bytes)?;
        let tables = [const { None }; 4];
        let mut ordered = Ordered { level_of, place_at, diagram, suffixes: Suffixes::default(), tables, claimed: 0 };
        ordered.table(Events::Forward, transitions)?;
        Ok(ordered)
    }

    pub(super) fn levels(&self) -> u32 {
        self.level_of.len() as u32
    }

    fn table(&mut self, which: Events, transitions: &[Transition]) -> Result<(), Stop> {
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
        let table = Table::new(&self.suffixes, events, self.levels());
        let bytes =
            self.suffixes.bytes() + self.tables.iter().flatten().chain([&table]).map(Table::bytes).sum::<usize>();
        let more = bytes.saturating_sub(self.claimed);
        self.diagram.store.memory.claim(more)?;
        self.claimed += more;
        self.tables[which as usize] = Some(table);
        Ok(())
    }

    fn event(&mut self, transition: &Transition, which: Events) -> Result<Option<Suffix>, Stop> {
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
        Symbolic { transitions, ordered, reach, start, initial, fired, nodes, layers_work: LAYERS_WORK }
    }

    /// Nodes and results.
    pub fn diagram(&mut self) -> &mut Diagram {
        &mut self.ordered.diagram
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.ordered.diagram.store.memory.used()
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
            let mut events = Vec::with_capacity(tests.len());
            for (full, empty) in tests {
                let test = Transition::new(&[], &[], full, empty, &[]);
                events.push(space.ordered.event(&test, Events::Tests)?);
            }
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

    /// The markings of a set from which a run can go on for ever inside it (EG over infinite runs).
    pub fn endless(&mut self, roots: &[Node], set: Node, watch: &mut Watch<'_>) -> Result<Node, Stop> {
        let mut left = set;
        loop {
            let held = [roots, &[left]].concat();
            let before = self.before(&held, left, watch)?;
            let fewer = self.binary(&held, Binary::Intersection, left, before, watch)?;
            if fewer == left {
                return Ok(left);
            }
            left = fewer;
        }
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
        let levels = self.ordered.diagram.any(set)?;
        let mut places: Vec<u32> = levels.into_iter().map(|level| self.ordered.place_at[level as usize]).collect();
        places.sort_unstable();
        Some(places)
    }

    /// The closure of a set under the firings, or backwards under their reverses, within a set (`ANY`: all markings).
    pub fn closure(
        &mut self,
        roots: &[Node],
        set: Node,
        within: Node,
        back: bool,
        watch: &mut Watch<'_>,
    ) -> Result<Node, Stop> {
        let held = [set, if within == ANY { EMPTY } else { within }];
        self.again(roots, &held, |space, roots| {
            let which = if back { Events::Backward } else { Events::Forward };
            space.ordered.table(which, &space.transitions)?;
            let levels = space.ordered.levels();
            let Ordered { diagram, suffixes, tables, .. } = &mut space.ordered;
            let Some(table) = &tables[which as usize] else { return Ok(EMPTY) };
            let mut search = Saturation::new(diagram, set, within, levels, back)?;
            let mut shop = Workshop { diagram, suffixes, table, roots };
            let result = search.run(&mut shop, u64::MAX, watch);
            search.finish(diagram);
            Ok(result?.unwrap_or(EMPTY))
        })
    }

    /// The markings from which a target can be reached, every marking before it in `within`.
    pub fn backward(
        &mut self,
        roots: &[Node],
        targets: Node,
        within: Node,
        watch: &mut Watch<'_>,
    ) -> Result<Node, Stop> {
        let inside = self.binary(roots, Binary::Intersection, targets, within, watch)?;
        let mut seeds = inside;
        if inside != targets {
            // Targets outside are not gone through; their predecessors inside are where the search begins.
            let held = [roots, &[inside, targets, within]].concat();
            let before = self.before(&held, targets, watch)?;
            let before = self.binary(&held, Binary::Intersection, before, within, watch)?;
            seeds = self.binary(&held, Binary::Union, before, inside, watch)?;
        }
        let held = [roots, &[targets, within, seeds]].concat();
        let reached = self.closure(&held, seeds, within, true, watch)?;
        self.binary(&held, Binary::Union, reached, targets, watch)
    }

    /// How many markings a set holds.
    pub fn count(&self, set: Node, watch: &mut Watch<'_>) -> Result<Natural, Stop> {
        count::markings(&self.ordered.diagram, set, watch)
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
