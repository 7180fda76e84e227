//! Firing in a saturation: an event below each value of a node, and the fixed point of the events of a block.
//!
//! The image of a node is made from the images of its children, then closed by the events of its own block; both are
//! remembered, the first by the suffix that was fired and the second by the node that it started from, since what
//! different events leave is often the same. A result that is known needs no frame, and most are.

use super::cache::ANY;
use super::events::{DONE, SATURATE, Suffix};
use super::saturation::{Frame, Saturation, Step, Workshop};
use super::values::{Value, closed, opened};
use super::zdd::{EMPTY, Node};
use crate::budget::{Stop, Watch};

impl Saturation {
    /// The saturated image closed up to a block, if it needs no search.
    #[inline]
    pub(super) fn known(&self, shop: &Workshop<'_>, suffix: Suffix, node: Node, within: Node, to: u32) -> Option<Node> {
        if node == EMPTY || within == EMPTY {
            return Some(EMPTY);
        }
        if suffix == DONE && within == ANY {
            return Some(node); // a part of a saturated node, so closed up to there
        }
        let (part, own) = (shop.parts.get(suffix), shop.block(node));
        if part.needs > own {
            return Some(EMPTY);
        }
        let from = own.max(part.block);
        if shop.agenda.wake(from, to, from).is_some() { None } else { self.easy(shop, suffix, node, within, from) }
    }

    /// The saturated image, closed up to the block of the node or of the suffix, whichever is higher, if it is known.
    #[inline]
    fn easy(&self, shop: &Workshop<'_>, suffix: Suffix, node: Node, within: Node, block: u32) -> Option<Node> {
        if suffix <= SATURATE && within == node {
            return Some(node); // a constraint is closed within itself
        }
        let within = shop.restricted(within, block);
        if within == EMPTY || block == 0 {
            return Some(if within == EMPTY { EMPTY } else { node });
        }
        // What is moved below another constraint need not be closed there.
        shop.diagram.cache.get(self.by.ops().0, suffix.max(SATURATE), node, within)
    }

    /// Fires a suffix on a node that is to be closed up to a block.
    pub(super) fn below(
        &mut self,
        shop: &Workshop<'_>,
        suffix: Suffix,
        node: Node,
        within: Node,
        to: u32,
    ) -> Result<(), Stop> {
        let from = shop.block(node).max(shop.parts.get(suffix).block);
        if shop.agenda.wake(from, to, from).is_some() {
            shop.diagram.store.memory.push(&mut self.frames, Frame::Close { from, to, within })?;
        }
        self.step = Step::Fire { suffix, node, within };
        Ok(())
    }

    pub(super) fn fire(
        &mut self,
        shop: &mut Workshop<'_>,
        suffix: Suffix,
        node: Node,
        within: Node,
    ) -> Result<(), Stop> {
        let (part, own) = (*shop.parts.get(suffix), shop.block(node));
        let block = own.max(part.block);
        let barred = node == EMPTY || within == EMPTY || part.needs > own;
        let easy = if barred { Some(EMPTY) } else { self.easy(shop, suffix, node, within, block) };
        if let Some(known) = easy {
            self.step = Step::Return(known);
            return Ok(());
        }
        let (suffix, within) = (suffix.max(SATURATE), shop.restricted(within, block));
        let base = self.values.len();
        self.open(shop, node, block, within)?;
        if block == part.block {
            // The values from which it fires all have the same bits where it changes some, so their order stays.
            let mut kept = base;
            for at in base..self.values.len() {
                let value = self.values[at];
                if part.fires(value.bits) {
                    let bits = value.bits ^ part.flip;
                    self.values[kept] = Value { bits, within: shop.inside(within, block, bits), ..value };
                    kept += 1;
                }
            }
            self.values.truncate(kept);
        }
        let frame = Frame::Map { suffix, node, within, block, base: base as u32, at: base as u32 };
        self.enter(shop, frame, base)
    }

    /// Puts a frame over the values from `base` on.
    fn enter(&mut self, shop: &Workshop<'_>, frame: Frame, base: usize) -> Result<(), Stop> {
        let pushed = shop.diagram.store.memory.push(&mut self.frames, frame);
        match pushed {
            Ok(()) => self.step = Step::Go,
            Err(_) => self.values.truncate(base),
        }
        pushed
    }

    /// Adds the values of a node at its block or above it, in ascending order.
    fn open(&mut self, shop: &Workshop<'_>, node: Node, block: u32, within: Node) -> Result<(), Stop> {
        let base = self.values.len();
        let low = shop.blocks.low(block);
        let opened = opened(&shop.diagram.store, node, low, 0, &mut self.values);
        if opened.is_err() {
            self.values.truncate(base);
        }
        if within != ANY {
            for value in &mut self.values[base..] {
                value.within = shop.inside(within, block, value.bits);
            }
        }
        opened
    }

    /// Adds a set to what is below a value of the open node; whether it was new.
    pub(super) fn add(
        &mut self,
        shop: &mut Workshop<'_>,
        base: u32,
        bits: u32,
        set: Node,
        within: Node,
        watch: &mut Watch<'_>,
    ) -> Result<bool, Stop> {
        if set == EMPTY {
            return Ok(false);
        }
        match self.values[base as usize..].iter_mut().find(|value| value.bits == bits) {
            Some(value) => {
                let union = shop.diagram.union(value.node, set, watch)?;
                let more = union != value.node;
                value.grown |= more;
                value.node = union;
                Ok(more)
            }
            None => {
                shop.diagram.store.memory.push(&mut self.values, Value { bits, node: set, within, grown: true })?;
                Ok(true)
            }
        }
    }

    /// All values of a node are fired from: on to the fixed point of its block.
    pub(super) fn mapped(
        &mut self,
        shop: &mut Workshop<'_>,
        (suffix, node, within): (Suffix, Node, Node),
        block: u32,
        base: usize,
    ) -> Result<(), Stop> {
        let mut kept = base;
        for at in base..self.values.len() {
            let value = self.values[at];
            self.values[kept] = Value { grown: true, ..value };
            kept += usize::from(value.node != EMPTY);
        }
        self.values.truncate(kept);
        if let Some(Frame::Map { at, .. }) = self.frames.last_mut() {
            *at = kept as u32;
        }
        let store = &mut shop.diagram.store;
        let start = closed(store, &self.values[base..], shop.blocks.low(block), node)?;
        let fixed = if start == EMPTY || shop.agenda.at(block).is_empty() {
            Some(start)
        } else {
            shop.diagram.cache.get(self.by.ops().1, block, start, within)
        };
        if let Some(result) = fixed {
            shop.diagram.cache.put(&shop.diagram.store.memory, self.by.ops().0, suffix, node, within, result)?;
            self.leave(base, result);
            return Ok(());
        }
        let (base, depth) = (base as u32, self.frames.len());
        let fix = Frame::Fix { block, start, within, base, at: base, event: 0, added: false };
        shop.diagram.store.memory.push(&mut self.frames, fix)?;
        self.frames[depth - 1] = Frame::Store { suffix, node, within };
        Ok(())
    }

    /// The uppermost frame is done.
    pub(super) fn leave(&mut self, base: usize, result: Node) {
        self.frames.pop();
        self.values.truncate(base);
        self.step = Step::Return(result);
    }

    pub(super) fn fix(&mut self, shop: &mut Workshop<'_>, block: u32, node: Node, within: Node) -> Result<(), Stop> {
        if let Some(known) = shop.diagram.cache.get(self.by.ops().1, block, node, within) {
            self.step = Step::Return(known);
            return Ok(());
        }
        let base = self.values.len();
        self.open(shop, node, block, within)?;
        let frame =
            Frame::Fix { block, start: node, within, base: base as u32, at: base as u32, event: 0, added: false };
        self.enter(shop, frame, base)
    }

    /// The fixed point of the events of a block on an open node whose children are closed up to the block below.
    pub(super) fn chain(
        &mut self,
        shop: &mut Workshop<'_>,
        (block, start, within): (u32, Node, Node),
        base: u32,
        mut at: u32,
        mut event: u32,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        let events = shop.agenda.at(block);
        let (mut idle, to) = (0, block - 1);
        let mut added = matches!(self.frames.last(), Some(Frame::Fix { added: true, .. }));
        while idle <= self.values.len() - base as usize {
            if event == 0 && !std::mem::take(&mut self.values[at as usize].grown) {
                idle += 1;
                at = if at as usize + 1 == self.values.len() { base } else { at + 1 };
                continue;
            }
            (idle, event) = (0, event.max(1));
            while let Some(part) = events.get(event as usize - 1) {
                let value = self.values[at as usize];
                if !part.fires(value.bits) {
                    event += 1;
                    continue;
                }
                let bits = value.bits ^ part.flip;
                let target = shop.inside(within, block, bits);
                let known = self.known(shop, part.next, value.node, target, to);
                if known != Some(EMPTY) {
                    self.events += 1;
                    let Some(set) = known else {
                        self.stand_at(at, event, added);
                        return self.below(shop, part.next, value.node, target, to);
                    };
                    match self.add(shop, base, bits, set, target, watch) {
                        Ok(more) => added |= more,
                        Err(stop) => {
                            self.stand_at(at, event, added);
                            return Err(stop);
                        }
                    }
                }
                event += 1;
            }
            event = 0;
            at = if at as usize + 1 == self.values.len() { base } else { at + 1 };
        }
        self.stand_at(at, event, added); // what follows may fail
        let mut result = start;
        if added {
            let values = &mut self.values[base as usize..];
            values.sort_unstable_by_key(|value| value.bits);
            result = closed(&mut shop.diagram.store, values, shop.blocks.low(block), start)?;
        }
        shop.diagram.cache.put(&shop.diagram.store.memory, self.by.ops().1, block, start, within, result)?;
        self.leave(base as usize, result);
        Ok(())
    }

    /// How far the uppermost frame, a fixed point, has come: it is gone on with from there.
    fn stand_at(&mut self, value: u32, event: u32, added: bool) {
        if let Some(Frame::Fix { at, event: next, added: any, .. }) = self.frames.last_mut() {
            (*at, *next, *any) = (value, event, added);
        }
    }
}
