//! Images: what one transition, or all of a table at once, make of a set, without a fixed point.
//!
//! One transition is the recursion over its literals. All at once are not their images one by one: each of those copies
//! the diagram above its own level, which is quadratic in the length of the net. Instead the union is taken level by
//! level from below, as in saturation but firing each event once: the image of a node is the image of its children and
//! what the events of its own level add. With the tests of the firing rule in the place of the events, the same
//! pass gives the markings in which some transition may fire, and so the deadlocks; with the conditions of contact in their
//! place, every marking in contact.

use std::collections::HashSet;

use super::algebra::Diagram;
use super::cache::Op;
use super::events::{DONE, Suffix, Suffixes, Table};
use super::zdd::{EMPTY, Node, TERMINAL};
use crate::budget::{Stop, Watch};

enum Step<F> {
    Call(F),
    Return(Node),
}

const PENDING: Node = u32::MAX;

/// The image of a set under one event.
pub fn image(
    diagram: &mut Diagram,
    suffixes: &Suffixes,
    suffix: Suffix,
    set: Node,
    watch: &mut Watch<'_>,
) -> Result<Node, Stop> {
    let mut frames: Vec<(Suffix, Node, Node)> = Vec::new();
    let result = image_with(diagram, suffixes, suffix, set, &mut frames, watch);
    diagram.store.memory.drop_vec(frames);
    result
}

fn image_with(
    diagram: &mut Diagram,
    suffixes: &Suffixes,
    suffix: Suffix,
    set: Node,
    frames: &mut Vec<(Suffix, Node, Node)>,
    watch: &mut Watch<'_>,
) -> Result<Node, Stop> {
    frames.clear();
    let mut step = Step::Call((suffix, set));
    loop {
        step = match step {
            Step::Call((suffix, node)) => {
                let literal = suffixes.get(suffix);
                let level = diagram.store.level(node);
                if suffix == DONE {
                    Step::Return(node)
                } else if node == EMPTY || literal.needs > level {
                    Step::Return(EMPTY)
                } else if let Some(known) = diagram.cache.get(Op::Image, suffix, node, EMPTY) {
                    Step::Return(known)
                } else {
                    watch.tick(1)?;
                    diagram.store.memory.push(frames, (suffix, node, PENDING))?;
                    if level > literal.level {
                        Step::Call((suffix, diagram.store.lo(node)))
                    } else {
                        let (lo, hi) = diagram.store.split(node, literal.level);
                        Step::Call((literal.next, if literal.kind.wants() { hi } else { lo }))
                    }
                }
            }
            Step::Return(result) => {
                let Some((suffix, node, lo)) = frames.pop() else { return Ok(result) };
                let (literal, level) = (suffixes.get(suffix), diagram.store.level(node));
                let image = if level <= literal.level {
                    let (lo, hi) = if literal.kind.leaves() { (EMPTY, result) } else { (result, EMPTY) };
                    diagram.store.node(literal.level, lo, hi)?
                } else if lo == PENDING {
                    frames.push((suffix, node, result)); // into the room it came from
                    step = Step::Call((suffix, diagram.store.hi(node)));
                    continue;
                } else {
                    diagram.store.node(level, lo, result)?
                };
                diagram.cache.put(&diagram.store.memory, Op::Image, suffix, node, EMPTY, image)?;
                Step::Return(image)
            }
        };
    }
}

/// The union of the images of a set under all events of a table; `number` names the table in the cache.
pub struct All<'a> {
    /// Nodes and results.
    pub diagram: &'a mut Diagram,
    /// What suffixes mean.
    pub suffixes: &'a Suffixes,
    /// The events.
    pub table: &'a Table,
    /// A number that no other table has.
    pub number: u32,
    /// Nodes that are in use elsewhere.
    pub roots: &'a [Node],
}

/// A node whose children's images are waited for: of the empty part, and of the full part.
#[derive(Clone, Copy)]
struct Waiting {
    node: Node,
    lo: Node,
}

impl All<'_> {
    /// The union over all events, for a diagram of so many levels.
    pub fn image(&mut self, set: Node, levels: u32, watch: &mut Watch<'_>) -> Result<Node, Stop> {
        let (mut waiting, mut frames) = (Vec::new(), Vec::new());
        let result = self.climb(set, levels, &mut waiting, &mut frames, watch);
        self.diagram.store.memory.drop_vec(waiting);
        self.diagram.store.memory.drop_vec(frames);
        result
    }

    fn climb(
        &mut self,
        set: Node,
        levels: u32,
        waiting: &mut Vec<Waiting>,
        frames: &mut Vec<(Suffix, Node, Node)>,
        watch: &mut Watch<'_>,
    ) -> Result<Node, Stop> {
        let mut step = Step::Call(set);
        loop {
            step = match step {
                Step::Call(node) => {
                    if self.diagram.store.level(node) == TERMINAL {
                        Step::Return(EMPTY)
                    } else if let Some(known) = self.diagram.cache.get(Op::Once, self.number, node, EMPTY) {
                        Step::Return(known)
                    } else {
                        if self.diagram.store.due() {
                            let held =
                                waiting.iter().flat_map(|at| [at.node, if at.lo == PENDING { EMPTY } else { at.lo }]);
                            self.diagram.collect(held.chain([node, set]).chain(self.roots.iter().copied()))?;
                        }
                        watch.tick(1)?;
                        self.diagram.store.memory.push(waiting, Waiting { node, lo: PENDING })?;
                        Step::Call(self.diagram.store.lo(node))
                    }
                }
                Step::Return(result) => {
                    let Some(at) = waiting.pop() else {
                        let mut all = self.awake(set, levels, result, frames, watch)?;
                        if self.table.idle > 0 {
                            all = self.diagram.union(all, set, watch)?;
                        }
                        return Ok(all);
                    };
                    let level = self.diagram.store.level(at.node);
                    if at.lo == PENDING {
                        let lo = self.diagram.store.lo(at.node);
                        let lo = self.awake(lo, level - 1, result, frames, watch)?;
                        waiting.push(Waiting { lo, ..at }); // into the room it came from
                        Step::Call(self.diagram.store.hi(at.node))
                    } else {
                        let hi = self.diagram.store.hi(at.node);
                        let hi = self.awake(hi, level - 1, result, frames, watch)?;
                        let mut all = self.diagram.store.node(level, at.lo, hi)?;
                        for event in self.table.at(level) {
                            let one = image_with(self.diagram, self.suffixes, *event, at.node, frames, watch)?;
                            all = self.diagram.union(all, one, watch)?;
                        }
                        self.diagram.cache.put(
                            &self.diagram.store.memory,
                            Op::Once,
                            self.number,
                            at.node,
                            EMPTY,
                            all,
                        )?;
                        Step::Return(all)
                    }
                }
            };
        }
    }

    /// The events of the table that can fire somewhere in a set: whose image is not empty.
    pub fn firing(&mut self, set: Node, levels: u32, watch: &mut Watch<'_>) -> Result<HashSet<Suffix>, Stop> {
        let (mut found, mut seen) = (HashSet::new(), HashSet::new());
        let mut frames = Vec::new();
        let mut todo = vec![(set, levels)];
        if set != EMPTY && self.table.idle > 0 {
            found.insert(DONE);
        }
        while let Some((node, to)) = todo.pop() {
            if node == EMPTY {
                continue;
            }
            let own = self.diagram.store.level(node);
            let mut at = Some(own).filter(|&own| own != TERMINAL && seen.insert(node));
            if at.is_some() {
                todo.extend([(self.diagram.store.lo(node), own - 1), (self.diagram.store.hi(node), own - 1)]);
            }
            // At the node's own level, if it is met for the first time, and at those that were passed over.
            loop {
                let from = match at {
                    Some(level) => {
                        for &event in self.table.at(level) {
                            watch.tick(1)?;
                            if !found.contains(&event)
                                && image_with(self.diagram, self.suffixes, event, node, &mut frames, watch)? != EMPTY
                            {
                                found.insert(event);
                            }
                        }
                        level
                    }
                    None => own,
                };
                at = self.table.wake(from, to, own);
                if at.is_none() {
                    break;
                }
            }
        }
        self.diagram.store.memory.drop_vec(frames);
        Ok(found)
    }

    /// Adds the images under the events of the levels above a node, up to `to`, that may fire on it.
    fn awake(
        &mut self,
        node: Node,
        to: u32,
        mut all: Node,
        frames: &mut Vec<(Suffix, Node, Node)>,
        watch: &mut Watch<'_>,
    ) -> Result<Node, Stop> {
        if node == EMPTY {
            return Ok(all);
        }
        let own = self.diagram.store.level(node);
        let mut from = own;
        while let Some(level) = self.table.wake(from, to, own) {
            for event in self.table.at(level) {
                let one = image_with(self.diagram, self.suffixes, *event, node, frames, watch)?;
                all = self.diagram.union(all, one, watch)?;
            }
            from = level;
        }
        Ok(all)
    }
}
