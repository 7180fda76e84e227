//! Saturation: the least fixed point from the bottom up, within a constraint if there is one.
//!
//! A node is saturated when firing any event at or below its block adds no marking to it. The children of a node are
//! saturated first; then the events of its own block are fired until nothing is added; and what an event builds on its
//! way back up is saturated at once (Ciardo, Lüttgen, Siminiscu 2001). So the intermediate diagrams stay near the final
//! one in size, where breadth-first search builds sets that are far larger than the first and the last; on rings of
//! philosophers it is a hundred times faster than firing all transitions in turn.
//!
//! A node is opened into the values of its block, with what is below each, and closed when they are found. The fixed
//! point of a block is a list of values to do: one that has grown fires every event that starts from it, into the others.
//!
//! With a *constraint* C the closure is taken within C: a marking is added only if it is in C (Zhao, Ciardo 2009). That
//! is backward reachability: the predecessors of a set among the reachable markings, without those that no run reaches,
//! of which there may be exponentially more. Then a part that is moved below another constraint is no longer closed, so
//! the identity at the end of an event becomes "saturate what is left".
//!
//! The recursion has a stack of its own, as deep as the net has blocks, and another for the values of the nodes that are
//! open. That makes three more things easy: running out of memory is a return value, the stacks are the list of roots
//! for a collection in the middle of a fixed point, and a search can be put aside and gone on with, which is how several
//! orders of places race each other. Whatever a step may fail at comes before what it changes, so it can be done again
//! when there is room.

use super::algebra::Diagram;
use super::blocks::Blocks;
use super::cache::{ANY, Op};
use super::events::{SATURATE, Suffix};
use super::parts::{Agenda, Parts};
use super::values::Value;
use super::zdd::{EMPTY, Node};
use crate::budget::{Stop, Watch};

/// How many steps take as long as a result, about.
const STEPS: u64 = 4;

#[derive(Clone, Copy, Debug)]
pub(super) enum Frame {
    /// Fires a suffix below each value of a node; `at` is the first of its values that is not done.
    Map { suffix: Suffix, node: Node, within: Node, block: u32, base: u32, at: u32 },
    /// Waits for the fixed point, which is the result.
    Store { suffix: Suffix, node: Node, within: Node },
    /// Waits for a set that is closed up to a block, to be closed up to another.
    Close { from: u32, to: u32, within: Node },
    /// Fires the events of a block from each value that has grown; the next is number `event` from 1, from value `at`;
    /// 0 where the next value has yet to be found; `added` tells whether anything was.
    Fix { block: u32, start: Node, within: Node, base: u32, at: u32, event: u32, added: bool },
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    Fire {
        suffix: Suffix,
        node: Node,
        within: Node,
    },
    Fix {
        block: u32,
        node: Node,
        within: Node,
    },
    Return(Node),
    /// Goes on with the uppermost frame.
    Go,
}

/// What a closure goes by; the results of one are not those of another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum By {
    /// All firings.
    Forward,
    /// All firings, from the marking after to the one before.
    Backward,
    /// The same, of the transitions that were chosen.
    Chosen,
}

impl By {
    /// A saturated image, and a fixed point.
    pub(super) fn ops(self) -> (Op, Op) {
        match self {
            By::Forward => (Op::Fire, Op::Fix),
            By::Backward => (Op::FireBack, Op::FixBack),
            By::Chosen => (Op::FireSome, Op::FixSome),
        }
    }
}

/// A saturation in progress.
#[derive(Debug)]
pub(super) struct Saturation {
    pub(super) frames: Vec<Frame>,
    pub(super) values: Vec<Value>,
    pub(super) step: Step,
    pub(super) by: By,
    pub(super) events: u64,
}

/// What a saturation works on and with.
pub(super) struct Workshop<'a> {
    /// Nodes and results.
    pub(super) diagram: &'a mut Diagram,
    /// The levels, in blocks.
    pub(super) blocks: &'a Blocks,
    /// What suffixes mean.
    pub(super) parts: &'a Parts,
    /// The events by block.
    pub(super) agenda: &'a Agenda,
    /// Nodes that are in use elsewhere.
    pub(super) roots: &'a [Node],
}

impl Workshop<'_> {
    pub(super) fn block(&self, node: Node) -> u32 {
        self.blocks.of(self.diagram.store.level(node))
    }

    /// The part of a constraint in which every place above a block is empty.
    #[inline]
    pub(super) fn restricted(&self, mut within: Node, block: u32) -> Node {
        if within != ANY {
            while self.block(within) > block {
                within = self.diagram.store.lo(within);
            }
        }
        within
    }

    /// What is below a value in a constraint that was restricted to its block.
    #[inline]
    pub(super) fn inside(&self, within: Node, block: u32, bits: u32) -> Node {
        if within == ANY { ANY } else { self.blocks.child(&self.diagram.store, within, block, bits) }
    }
}

impl Saturation {
    /// The closure of a set of what lies up to a block under the events up to there of an agenda, within a constraint
    /// (`ANY`: none).
    ///
    /// The agenda is that of what it goes by. All of the set outside the constraint is left out.
    pub(super) fn new(
        diagram: &Diagram,
        blocks: &Blocks,
        (set, within): (Node, Node),
        to: u32,
        by: By,
    ) -> Result<Self, Stop> {
        let mut frames = Vec::new();
        let from = blocks.of(diagram.store.level(set));
        diagram.store.memory.push(&mut frames, Frame::Close { from, to, within })?;
        let step = Step::Fire { suffix: SATURATE, node: set, within };
        Ok(Saturation { frames, values: Vec::new(), step, by, events: 0 })
    }

    /// How many events were fired on some node.
    pub(super) fn fired(&self) -> u64 {
        self.events
    }

    /// The level up to which all is closed: how far the search is, as it goes from the bottom up.
    pub(super) fn reached(&self, blocks: &Blocks, diagram: &Diagram) -> u32 {
        let block = |frame: &Frame| match *frame {
            Frame::Close { to, .. } => Some(to),
            Frame::Map { suffix: SATURATE, block, .. } => Some(block),
            Frame::Store { suffix: SATURATE, node, .. } => Some(blocks.of(diagram.store.level(node))),
            _ => None,
        };
        self.frames.iter().map_while(block).last().map_or(0, |block| blocks.low(block).saturating_sub(1))
    }

    /// Works on until about so many results were computed; the closure once it is found.
    pub(super) fn run(
        &mut self,
        shop: &mut Workshop<'_>,
        fuel: u64,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Node>, Stop> {
        let (end, mut steps) = (shop.diagram.cache.work.saturating_add(fuel), 0);
        while shop.diagram.cache.work.saturating_add(steps / STEPS) < end {
            steps += 1;
            if let (Step::Return(node), true) = (self.step, self.frames.is_empty()) {
                return Ok(Some(node));
            }
            if shop.diagram.store.due() {
                self.collect(shop)?;
            }
            watch.tick(1)?;
            if let Err(stop) = self.next(shop, watch) {
                if stop != Stop::Memory {
                    return Err(stop);
                }
                self.make_room(shop)?;
                self.next(shop, watch)?;
            }
        }
        Ok(None)
    }

    fn next(&mut self, shop: &mut Workshop<'_>, watch: &mut Watch<'_>) -> Result<(), Stop> {
        match self.step {
            Step::Fire { suffix, node, within } => self.fire(shop, suffix, node, within),
            Step::Fix { block, node, within } => self.fix(shop, block, node, within),
            Step::Return(node) => self.resume(shop, node, watch),
            Step::Go => self.go_on(shop, watch),
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

    /// Gives the bytes of the stacks back.
    pub(super) fn finish(self, diagram: &Diagram) {
        diagram.store.memory.drop_vec(self.frames);
        diagram.store.memory.drop_vec(self.values);
    }

    /// Every node that the search still needs.
    fn nodes(&self) -> impl Iterator<Item = Node> + '_ {
        let step = match self.step {
            Step::Fire { node, within, .. } | Step::Fix { node, within, .. } => [node, within],
            Step::Return(node) => [node, EMPTY],
            Step::Go => [EMPTY; 2],
        };
        let in_frame = |frame: &Frame| match *frame {
            Frame::Map { node, within, .. } | Frame::Store { node, within, .. } => [node, within],
            Frame::Close { within, .. } => [within, EMPTY],
            Frame::Fix { start, within, .. } => [start, within],
        };
        let in_value = |value: &Value| [value.node, value.within];
        let all = self.frames.iter().flat_map(in_frame).chain(self.values.iter().flat_map(in_value));
        all.chain(step).filter(|&node| node != ANY)
    }

    /// Goes on where the result of a step was waited for.
    pub(super) fn resume(&mut self, shop: &mut Workshop<'_>, result: Node, watch: &mut Watch<'_>) -> Result<(), Stop> {
        let Some(top) = self.frames.last().copied() else { return Ok(()) };
        match top {
            Frame::Map { at, .. } => {
                self.values[at as usize].node = result;
                if let Some(Frame::Map { at, .. }) = self.frames.last_mut() {
                    *at += 1;
                }
                self.step = Step::Go;
            }
            Frame::Store { suffix, node, within } => {
                shop.diagram.cache.put(&shop.diagram.store.memory, self.by.ops().0, suffix, node, within, result)?;
                self.frames.pop();
            }
            Frame::Close { from, to, within } => {
                let wake = if result == EMPTY { None } else { shop.agenda.wake(from, to, shop.block(result)) };
                match wake {
                    Some(block) => {
                        if let Some(Frame::Close { from, .. }) = self.frames.last_mut() {
                            *from = block;
                        }
                        self.step = Step::Fix { block, node: result, within: shop.restricted(within, block) };
                    }
                    None => {
                        self.frames.pop();
                    }
                }
            }
            Frame::Fix { block, within, base, at, event, .. } => {
                let bits = self.values[at as usize].bits ^ shop.agenda.at(block)[event as usize - 1].flip;
                let more = self.add(shop, base, bits, result, shop.inside(within, block, bits), watch)?;
                self.step = Step::Go;
                if let Some(Frame::Fix { event, added, .. }) = self.frames.last_mut() {
                    *event += 1;
                    *added |= more;
                }
            }
        }
        Ok(())
    }

    fn go_on(&mut self, shop: &mut Workshop<'_>, watch: &mut Watch<'_>) -> Result<(), Stop> {
        match self.frames.last().copied() {
            Some(Frame::Map { suffix, node, within, block, base, at }) => {
                let part = shop.parts.get(suffix);
                let below = if block == part.block { part.next } else { suffix };
                for at in at as usize..self.values.len() {
                    let value = self.values[at];
                    let Some(known) = self.known(shop, below, value.node, value.within, block - 1) else {
                        if let Some(Frame::Map { at: reached, .. }) = self.frames.last_mut() {
                            *reached = at as u32;
                        }
                        return self.below(shop, below, value.node, value.within, block - 1);
                    };
                    self.values[at].node = known;
                    // What was fired may not be fired again if the rest of this fails.
                    if let Some(Frame::Map { at: reached, .. }) = self.frames.last_mut() {
                        *reached = at as u32 + 1;
                    }
                }
                self.mapped(shop, (suffix, node, within), block, base as usize)
            }
            Some(Frame::Fix { block, start, within, base, at, event, .. }) => {
                self.chain(shop, (block, start, within), base, at, event, watch)
            }
            _ => Ok(()),
        }
    }
}
