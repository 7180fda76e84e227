//! Saturation: the least fixed point from the bottom up, within a constraint if there is one.
//!
//! A node is saturated when firing any event at or below its level adds no marking to it. The children of a node are
//! saturated first; then the events of its own level are fired until nothing is added; and what an event builds on its
//! way back up is saturated at once (Ciardo, Lüttgen, Siminiscu 2001). So the intermediate diagrams stay near the final
//! one in size, where breadth-first search builds sets that are far larger than the first and the last; on rings of
//! philosophers it is a hundred times faster than firing all transitions in turn.
//!
//! With a *constraint* C the closure is taken within C: a marking is added only if it is in C (Zhao, Ciardo 2009). That
//! is backward reachability: the predecessors of a set among the reachable markings, without those that no run reaches,
//! of which there may be exponentially more. Then a part that is moved below another constraint is no longer closed, so
//! the identity at the end of an event becomes "saturate what is left".
//!
//! The recursion has a stack of its own, as deep as the net has levels. That makes three more things easy: running out
//! of memory is a return value, the stack is the list of roots for a collection in the middle of a fixed point, and a
//! search can be put aside and gone on with, which is how several orders of places race each other.

use super::algebra::Diagram;
use super::cache::{ANY, Op};
use super::events::{DONE, SATURATE, Suffix, Suffixes, Table};
use super::zdd::{EMPTY, Node};
use crate::budget::{Stop, Watch};

#[derive(Clone, Copy, Debug)]
enum Frame {
    /// Waits for the part where the place at the node's level is empty.
    Lo { suffix: Suffix, node: Node, within: Node },
    /// Waits for the part where it is full.
    Hi { suffix: Suffix, node: Node, within: Node, lo: Node },
    /// Waits for what follows the first literal.
    Literal { suffix: Suffix, node: Node, within: Node },
    /// Waits for the fixed point, which is the result.
    Store { suffix: Suffix, node: Node, within: Node },
    /// Waits for a set that is closed up to a level, to be closed up to another.
    Close { from: u32, to: u32, within: Node },
    /// Waits for the image of one event of a level.
    Fix(Fixing),
}

/// The fixed point of the events of one level; `left` counts those in a row that must still add nothing.
#[derive(Clone, Copy, Debug)]
struct Fixing {
    level: u32,
    start: Node,
    within: Node,
    lo: Node,
    hi: Node,
    turn: u32,
    left: u32,
}

#[derive(Clone, Copy, Debug)]
enum Step {
    Fire { suffix: Suffix, node: Node, within: Node },
    Fix { level: u32, lo: Node, hi: Node, within: Node },
    Return(Node),
}

/// A saturation in progress.
#[derive(Debug)]
pub struct Saturation {
    frames: Vec<Frame>,
    step: Step,
    back: bool,
    events: u64,
}

/// What a saturation works on and with.
pub struct Workshop<'a> {
    /// Nodes and results.
    pub diagram: &'a mut Diagram,
    /// What suffixes mean.
    pub suffixes: &'a Suffixes,
    /// The events by level.
    pub table: &'a Table,
    /// Nodes that are in use elsewhere.
    pub roots: &'a [Node],
}

impl Saturation {
    /// The closure of a set under the events of a table, within a constraint (`ANY`: none).
    ///
    /// `back` keeps the results of the two directions apart. All of the set outside the constraint is left out.
    pub fn new(diagram: &Diagram, set: Node, within: Node, levels: u32, back: bool) -> Result<Self, Stop> {
        let mut frames = Vec::new();
        let close = Frame::Close { from: diagram.store.level(set), to: levels, within };
        diagram.store.memory.push(&mut frames, close)?;
        Ok(Saturation { frames, step: Step::Fire { suffix: SATURATE, node: set, within }, back, events: 0 })
    }

    /// How many events were fired on some node.
    pub fn fired(&self) -> u64 {
        self.events
    }

    /// The level up to which all is closed: how far the search is, as it goes from the bottom up.
    pub fn reached(&self, diagram: &Diagram) -> u32 {
        let level = |frame: &Frame| match *frame {
            Frame::Close { to, .. } => Some(to),
            Frame::Lo { suffix: SATURATE, node, .. }
            | Frame::Hi { suffix: SATURATE, node, .. }
            | Frame::Store { suffix: SATURATE, node, .. } => Some(diagram.store.level(node)),
            _ => None,
        };
        self.frames.iter().map_while(level).last().map_or(0, |level| level.saturating_sub(1))
    }

    /// Works on, for about so many steps; the closure once it is found.
    pub fn run(&mut self, shop: &mut Workshop<'_>, fuel: u64, watch: &mut Watch<'_>) -> Result<Option<Node>, Stop> {
        for _ in 0..fuel {
            if shop.diagram.store.due() {
                self.collect(shop)?;
            }
            watch.tick(1)?;
            let (depth, top) = (self.frames.len(), self.frames.last().copied());
            if let (Step::Return(node), None) = (self.step, top) {
                return Ok(Some(node));
            }
            let next = match self.next(shop, watch) {
                Err(Stop::Memory) => {
                    // A step only pushes frames, but for the one that it takes: so it can be done again.
                    if let (Step::Return(_), Some(frame)) = (self.step, top) {
                        self.frames.truncate(depth - 1);
                        self.frames.push(frame);
                    }
                    self.frames.truncate(depth);
                    self.make_room(shop)?;
                    self.next(shop, watch)
                }
                next => next,
            };
            self.step = next?;
        }
        Ok(None)
    }

    fn next(&mut self, shop: &mut Workshop<'_>, watch: &mut Watch<'_>) -> Result<Step, Stop> {
        match self.step {
            Step::Fire { suffix, node, within } => self.fire(shop, suffix, node, within),
            Step::Fix { level, lo, hi, within } => self.fix(shop, level, lo, hi, within),
            Step::Return(node) => match self.frames.pop() {
                Some(frame) => self.resume(shop, frame, node, watch),
                None => Ok(Step::Return(node)),
            },
        }
    }

    fn collect(&self, shop: &mut Workshop<'_>) -> Result<(), Stop> {
        shop.diagram.collect(self.nodes().chain(shop.roots.iter().copied()))
    }

    /// A collection that must bring something: else every further step would collect for a few nodes.
    fn make_room(&self, shop: &mut Workshop<'_>) -> Result<(), Stop> {
        let before = shop.diagram.store.used();
        self.collect(shop)?;
        if before - shop.diagram.store.used() < before / 8 { Err(Stop::Memory) } else { Ok(()) }
    }

    /// Gives the stack's bytes back.
    pub fn finish(self, diagram: &Diagram) {
        diagram.store.memory.drop_vec(self.frames);
    }

    /// Every node that the search still needs.
    pub fn nodes(&self) -> impl Iterator<Item = Node> + '_ {
        let step = match self.step {
            Step::Fire { node, within, .. } => [node, within, EMPTY],
            Step::Fix { lo, hi, within, .. } => [lo, hi, within],
            Step::Return(node) => [node, EMPTY, EMPTY],
        };
        let in_frame = |frame: &Frame| match *frame {
            Frame::Lo { node, within, .. }
            | Frame::Literal { node, within, .. }
            | Frame::Store { node, within, .. } => [node, within, EMPTY, EMPTY],
            Frame::Hi { node, within, lo, .. } => [node, within, lo, EMPTY],
            Frame::Close { within, .. } => [within, EMPTY, EMPTY, EMPTY],
            Frame::Fix(Fixing { start, within, lo, hi, .. }) => [start, within, lo, hi],
        };
        self.frames.iter().flat_map(in_frame).chain(step).filter(|&node| node != ANY)
    }

    fn push(&mut self, shop: &Workshop<'_>, frame: Frame) -> Result<(), Stop> {
        shop.diagram.store.memory.push(&mut self.frames, frame)
    }

    fn ops(&self) -> (Op, Op) {
        if self.back { (Op::FireBack, Op::FixBack) } else { (Op::Fire, Op::Fix) }
    }

    /// The next step for what follows a literal, whose result must be closed up to `to` where it is used.
    fn below(&mut self, shop: &Workshop<'_>, suffix: Suffix, node: Node, within: Node, to: u32) -> Result<Step, Stop> {
        if suffix == DONE && within == ANY {
            return Ok(Step::Return(node)); // a part of a saturated node, so closed up to there
        }
        if node == EMPTY || within == EMPTY || shop.suffixes.get(suffix).needs > shop.diagram.store.level(node) {
            return Ok(Step::Return(EMPTY));
        }
        let from = shop.diagram.store.level(node).max(shop.suffixes.get(suffix).level);
        if shop.table.wake(from, to, from).is_some() {
            self.push(shop, Frame::Close { from, to, within })?;
        }
        Ok(Step::Fire { suffix, node, within })
    }

    /// The saturated image, closed up to the level of the node or of the suffix, whichever is higher.
    fn fire(&mut self, shop: &mut Workshop<'_>, suffix: Suffix, node: Node, within: Node) -> Result<Step, Stop> {
        if node == EMPTY || within == EMPTY {
            return Ok(Step::Return(EMPTY));
        }
        // What is moved below another constraint need not be closed there; a constraint is closed within itself.
        let suffix = if suffix == DONE && within != ANY { SATURATE } else { suffix };
        if suffix == DONE || (suffix == SATURATE && within == node) {
            return Ok(Step::Return(node));
        }
        let store = &shop.diagram.store;
        let (literal, own) = (shop.suffixes.get(suffix), store.level(node));
        if literal.needs > own {
            return Ok(Step::Return(EMPTY));
        }
        let level = own.max(literal.level);
        let within = restricted(shop.diagram, within, level);
        if within == EMPTY || level == 0 {
            return Ok(Step::Return(if within == EMPTY { EMPTY } else { node }));
        }
        if let Some(known) = shop.diagram.cache.get(self.ops().0, suffix, node, within) {
            return Ok(Step::Return(known));
        }
        let (empty, full) = parts(shop.diagram, within, level);
        if own > literal.level {
            self.push(shop, Frame::Lo { suffix, node, within })?;
            return self.below(shop, suffix, shop.diagram.store.lo(node), empty, level - 1);
        }
        let (lo, hi) = store.split(node, level);
        self.push(shop, Frame::Literal { suffix, node, within })?;
        let source = if literal.kind.wants() { hi } else { lo };
        let target = if literal.kind.leaves() { full } else { empty };
        self.below(shop, literal.next, source, target, level - 1)
    }

    /// Goes on where the result of a step was waited for.
    fn resume(
        &mut self,
        shop: &mut Workshop<'_>,
        frame: Frame,
        result: Node,
        watch: &mut Watch<'_>,
    ) -> Result<Step, Stop> {
        match frame {
            Frame::Lo { suffix, node, within } => {
                let level = shop.diagram.store.level(node);
                self.frames.push(Frame::Hi { suffix, node, within, lo: result }); // into the room it came from
                let full = parts(shop.diagram, within, level).1;
                self.below(shop, suffix, shop.diagram.store.hi(node), full, level - 1)
            }
            Frame::Hi { suffix, node, within, lo } => {
                let level = shop.diagram.store.level(node);
                self.built(shop, (suffix, node, within), level, lo, result)
            }
            Frame::Literal { suffix, node, within } => {
                let literal = shop.suffixes.get(suffix);
                let (lo, hi) = if literal.kind.leaves() { (EMPTY, result) } else { (result, EMPTY) };
                self.built(shop, (suffix, node, within), literal.level, lo, hi)
            }
            Frame::Store { suffix, node, within } => {
                shop.diagram.cache.put(&shop.diagram.store.memory, self.ops().0, suffix, node, within, result)?;
                Ok(Step::Return(result))
            }
            Frame::Close { from, to, within } => {
                if result == EMPTY {
                    return Ok(Step::Return(EMPTY));
                }
                let own = shop.diagram.store.level(result);
                let from = if from == u32::MAX { own } else { from };
                match shop.table.wake(from, to, own) {
                    Some(level) => {
                        self.frames.push(Frame::Close { from: level, to, within });
                        Ok(Step::Fix { level, lo: result, hi: EMPTY, within: restricted(shop.diagram, within, level) })
                    }
                    None => Ok(Step::Return(result)),
                }
            }
            Frame::Fix(mut fixing) => {
                let events = shop.table.at(fixing.level);
                let leaves = shop.suffixes.get(events[fixing.turn as usize]).kind.leaves();
                let part = if leaves { &mut fixing.hi } else { &mut fixing.lo };
                let new = shop.diagram.union(*part, result, watch)?;
                if new == *part {
                    fixing.left -= 1;
                } else {
                    fixing.left = events.len() as u32;
                    *part = new;
                }
                fixing.turn_over(events.len());
                self.go_on(shop, fixing)
            }
        }
    }

    fn built(
        &mut self,
        shop: &mut Workshop<'_>,
        (suffix, node, within): (Suffix, Node, Node),
        level: u32,
        lo: Node,
        hi: Node,
    ) -> Result<Step, Stop> {
        if (lo == EMPTY && hi == EMPTY) || shop.table.at(level).is_empty() {
            let result = shop.diagram.store.node(level, lo, hi)?;
            shop.diagram.cache.put(&shop.diagram.store.memory, self.ops().0, suffix, node, within, result)?;
            return Ok(Step::Return(result));
        }
        self.push(shop, Frame::Store { suffix, node, within })?;
        Ok(Step::Fix { level, lo, hi, within })
    }

    /// The fixed point of the events of one level on a pair of parts that are closed up to the level below.
    fn fix(&mut self, shop: &mut Workshop<'_>, level: u32, lo: Node, hi: Node, within: Node) -> Result<Step, Stop> {
        let start = shop.diagram.store.node(level, lo, hi)?;
        if let Some(known) = shop.diagram.cache.get(self.ops().1, level, start, within) {
            return Ok(Step::Return(known));
        }
        let left = shop.table.at(level).len() as u32;
        self.go_on(shop, Fixing { level, start, within, lo, hi, turn: 0, left })
    }

    fn go_on(&mut self, shop: &mut Workshop<'_>, mut fixing: Fixing) -> Result<Step, Stop> {
        let Fixing { level, start, within, lo, hi, .. } = fixing;
        let events = shop.table.at(level);
        let (empty, full) = parts(shop.diagram, within, level);
        while fixing.left > 0 {
            let literal = shop.suffixes.get(events[fixing.turn as usize]);
            let source = if literal.kind.wants() { hi } else { lo };
            let target = if literal.kind.leaves() { full } else { empty };
            let needs = shop.suffixes.get(literal.next).needs;
            if source != EMPTY && target != EMPTY && needs <= shop.diagram.store.level(source) {
                self.events += 1;
                self.push(shop, Frame::Fix(fixing))?;
                return self.below(shop, literal.next, source, target, level - 1);
            }
            fixing.left -= 1;
            fixing.turn_over(events.len());
        }
        let result = shop.diagram.store.node(level, lo, hi)?;
        shop.diagram.cache.put(&shop.diagram.store.memory, self.ops().1, level, start, within, result)?;
        Ok(Step::Return(result))
    }
}

impl Fixing {
    /// On to the next event of the level.
    fn turn_over(&mut self, events: usize) {
        self.turn = if self.turn as usize + 1 == events { 0 } else { self.turn + 1 };
    }
}

/// The part of a constraint in which every place above a level is empty.
#[inline]
fn restricted(diagram: &Diagram, mut within: Node, level: u32) -> Node {
    if within != ANY {
        while diagram.store.level(within) > level {
            within = diagram.store.lo(within);
        }
    }
    within
}

/// Both parts of a constraint at a level.
#[inline]
fn parts(diagram: &Diagram, within: Node, level: u32) -> (Node, Node) {
    if within == ANY { (ANY, ANY) } else { diagram.store.split(restricted(diagram, within, level), level) }
}
