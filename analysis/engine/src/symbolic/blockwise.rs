//! Ways found block by block, from the highest down: a firing sequence where layers of all markings are out of reach.
//!
//! Saturation says which markings lead into a set and leaves no way behind. But it can be asked again for the events up to
//! a block alone, every place above being left as it is, and what it finds for lower blocks it has found before. So a way
//! from a marking into a set of *targets* by the events up to a block is made thus:
//!
//! - if events below the block suffice, by these alone;
//! - else the markings that lead into the targets by events below the block are the first *layer*, those that lead into
//!   these by a firing of the block, then events below it, the second, and so on, until a layer holds the marking. Each
//!   firing of the block is then due in turn, and what leads to it is a way by events below the block.
//!
//! So each block fires as seldom as it can, given what the blocks above it fire, and a layer is no step of the whole net
//! but of one block: some tens of layers of each block lead through thousands of firings. Nothing is searched in vain, as
//! a marking never leaves those that lead on.

use super::algebra::Binary;
use super::saturation::By;
use super::space::{Events, Symbolic};
use super::values::{Value, closed, opened};
use super::walk::{Marking, Moves};
use super::zdd::{EMPTY, Node};
use crate::budget::{Stop, Watch};

/// What is to be reached by the events up to a block, every marking on the way in `within`: sets of what lies up to it.
#[derive(Clone, Copy)]
struct Leg {
    targets: Node,
    within: Node,
    block: u32,
}

/// A leg on which its block must fire.
struct Stage {
    leg: Leg,
    /// The markings from which the block fires no more, once more, and so on; the last one is where the way stands.
    layers: Vec<Node>,
    /// The markings in which a firing of the block leads into each layer but the last.
    before: Vec<Node>,
}

impl Symbolic {
    /// The firings that lead from a marking into a set of reachable ones that it leads into; the marking goes with them.
    pub(super) fn block_by_block(
        &mut self,
        roots: &[Node],
        targets: Node,
        marking: &mut Marking,
        moves: &Moves,
        watch: &mut Watch<'_>,
    ) -> Result<Vec<u32>, Stop> {
        let of_block = self.by_block(moves);
        let mut leg = Leg { targets, within: self.reach, block: self.blocks().len() as u32 };
        let (mut stages, mut firings) = (Vec::<Stage>::new(), Vec::new());
        loop {
            watch.tick(marking.len() / 8)?;
            if !self.holds_up_to(leg.targets, leg.block, marking) {
                let held: Vec<Node> = stages.iter().flat_map(Stage::nodes).chain(roots.iter().copied()).collect();
                let stage = self.stage(&held, leg, marking, &of_block, watch)?;
                leg = self.below(stage.due(), marking);
                stages.push(stage);
                continue;
            }
            let Some(stage) = stages.last_mut() else { return Ok(firings) };
            let (block, layer) = (stage.leg.block, stage.advance());
            let (due, is_last) = (stage.due(), stage.before.is_empty());
            let firing = of_block[block as usize].iter().find(|&&t| {
                moves.fires(t, marking) && {
                    moves.flip(t, marking);
                    let leads = self.holds_up_to(layer, block, marking);
                    if !leads {
                        moves.flip(t, marking);
                    }
                    leads
                }
            });
            firings.push(*firing.expect("a leg ends where a firing leads into the next layer") as u32);
            if is_last {
                stages.pop();
            }
            leg = self.below(due, marking);
        }
    }

    /// The transitions that change something, by the highest block that they have to do with.
    fn by_block(&self, moves: &Moves) -> Vec<Vec<usize>> {
        let mut found = vec![Vec::new(); self.blocks().len() + 1];
        for t in (0..moves.len()).filter(|&t| moves.flipped(t).next().is_some()) {
            if let Some(level) = moves.levels(t).max() {
                found[self.blocks().of(level) as usize].push(t);
            }
        }
        found
    }

    /// What of a leg is below the value that its block has in a marking.
    fn below(&self, leg: Leg, marking: &Marking) -> Leg {
        let (blocks, store) = (self.blocks(), self.store());
        let low = blocks.low(leg.block);
        let value = (low..blocks.low(leg.block + 1)).filter(|&level| marking[level as usize]);
        let value = value.fold(0, |value, level| value | 1 << (level - low));
        let child = |set| blocks.child(store, set, leg.block, value);
        Leg { targets: child(leg.targets), within: child(leg.within), block: leg.block - 1 }
    }

    /// The markings that lead into the targets of a leg by the events up to its block.
    fn leading(&mut self, roots: &[Node], leg: Leg, watch: &mut Watch<'_>) -> Result<Node, Stop> {
        self.closure_up_to(roots, (leg.targets, leg.within), By::Backward, leg.block, watch)
    }

    /// The part of a leg, from a marking outside its targets, that is led by the highest block that must fire.
    fn stage(
        &mut self,
        roots: &[Node],
        mut leg: Leg,
        marking: &Marking,
        of_block: &[Vec<usize>],
        watch: &mut Watch<'_>,
    ) -> Result<Stage, Stop> {
        let held = [roots, &[leg.targets, leg.within]].concat();
        loop {
            let below = self.below(leg, marking);
            let leading = self.leading(&held, below, watch)?;
            if !self.holds_up_to(leading, below.block, marking) {
                break;
            }
            leg = below;
        }
        let mut stage = Stage { leg, layers: Vec::new(), before: Vec::new() };
        let mut targets = leg.targets;
        loop {
            assert!(targets != EMPTY, "a leg is made where its targets can be reached");
            let held: Vec<Node> = held.iter().copied().chain(stage.nodes()).chain([targets]).collect();
            let layer = self.layer(&held, Leg { targets, ..leg }, watch)?;
            stage.layers.push(layer);
            if self.holds_up_to(layer, leg.block, marking) {
                return Ok(stage);
            }
            let held = [held, vec![layer]].concat();
            targets = EMPTY;
            for &t in &of_block[leg.block as usize] {
                let held = [&held[..], &[targets]].concat();
                let before = self.one(&held, layer, t, Events::Backward, watch)?;
                targets = self.binary(&held, Binary::Union, targets, before, watch)?;
            }
            targets = self.binary(&held, Binary::Intersection, targets, leg.within, watch)?;
            stage.before.push(targets);
        }
    }

    /// The markings that lead into the targets of a leg by the events below its block.
    fn layer(&mut self, roots: &[Node], leg: Leg, watch: &mut Watch<'_>) -> Result<Node, Stop> {
        let mut values: Vec<Value> = Vec::new();
        let node = self.layer_of(roots, leg, &mut values, watch);
        self.store().memory.drop_vec(values);
        node
    }

    fn layer_of(
        &mut self,
        roots: &[Node],
        leg: Leg,
        values: &mut Vec<Value>,
        watch: &mut Watch<'_>,
    ) -> Result<Node, Stop> {
        let low = self.blocks().low(leg.block);
        opened(self.store(), leg.targets, low, 0, values)?;
        for at in 0..values.len() {
            let within = self.blocks().child(self.store(), leg.within, leg.block, values[at].bits);
            let held: Vec<Node> = values.iter().map(|value| value.node).chain(roots.iter().copied()).collect();
            let below = Leg { targets: values[at].node, within, block: leg.block - 1 };
            values[at].node = self.leading(&held, below, watch)?;
        }
        closed(&mut self.diagram().store, values, low, leg.targets)
    }

    /// Whether a set of what lies up to a block holds a marking.
    fn holds_up_to(&self, set: Node, block: u32, marking: &Marking) -> bool {
        let (store, top) = (self.store(), self.blocks().low(block + 1) - 1);
        let mut node = set;
        for level in (1..=top).rev() {
            let token = marking[level as usize];
            if store.level(node) == level {
                node = if token { store.hi(node) } else { store.lo(node) };
            } else if token {
                return false;
            }
        }
        node != EMPTY
    }
}

impl Stage {
    /// Goes on by a firing of the block: the layer into which it leads.
    fn advance(&mut self) -> Node {
        self.layers.pop();
        self.before.pop();
        self.layers[self.layers.len() - 1]
    }

    fn nodes(&self) -> impl Iterator<Item = Node> + '_ {
        self.layers.iter().chain(&self.before).copied().chain([self.leg.targets, self.leg.within])
    }

    /// The same leg, to what leads to the next firing of its block, or to its targets where none is due.
    fn due(&self) -> Leg {
        Leg { targets: self.before.last().copied().unwrap_or(self.leg.targets), ..self.leg }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::net::Net;
    use crate::samples::{explore, random_nets, slotted_ring};
    use crate::symbolic::walk::{holds, tokens};

    /// The firings into a set, each of which may fire where it stands.
    fn way(space: &mut Symbolic, targets: Node) -> Vec<u32> {
        let (moves, mut poll) = (space.moves(), unwatched);
        let watch = &mut Watch::new(None, &mut poll);
        let (mut marking, mut end) = (space.first(), space.first());
        let firings = space.block_by_block(&[targets], targets, &mut end, &moves, watch).expect("enough room");
        for &t in &firings {
            assert!(moves.fires(t as usize, &marking));
            moves.flip(t as usize, &mut marking);
        }
        assert!(marking == end && holds(space.store(), targets, &end, tokens(&end)));
        firings
    }

    fn marked(net: &Net, marking: &[u64]) -> Vec<u32> {
        (0..net.places as u32).filter(|&place| marking[place as usize / 64] >> (place % 64) & 1 == 1).collect()
    }

    fn explored(net: &Net) -> Symbolic {
        let order: Vec<u32> = (0..net.places as u32).collect();
        let (initial, mut poll) = (marked(net, &net.initial), unwatched);
        let watch = &mut Watch::new(None, &mut poll);
        Symbolic::explore(net.places, net.transitions.clone(), initial, 1 << 28, Some(vec![order]), watch)
            .expect("enough room")
    }

    /// How many firings there are on the ways to all markings, and how many on the shortest.
    fn lengths(net: Net) -> (usize, usize) {
        let mut space = explored(&net);
        let (graph, moves, mut poll) = (explore(net, false), space.moves(), unwatched);
        let (mut found, mut least) = (0, 0);
        for at in 0..graph.len() {
            let target = space.single(&[], &marked(&graph.net, graph.marking(at))).expect("enough room");
            let watch = &mut Watch::new(None, &mut poll);
            let shortest = space.by_layers(&[target], target, &moves, u64::MAX, watch).expect("enough room");
            let shortest = shortest.expect("it is reachable").firings.len();
            let firings = way(&mut space, target).len();
            assert!(firings >= shortest);
            (found, least) = (found + firings, least + shortest);
        }
        (found, least)
    }

    #[test]
    fn a_way_leads_to_every_marking_and_is_hardly_longer_than_the_shortest() {
        let nets: Vec<Net> = random_nets(50).chain([slotted_ring(3)]).collect();
        assert!(nets.iter().any(|net| explored(net).blocks().len() > 20));
        let (found, least) = nets.into_iter().map(lengths).fold((0, 0), |all, one| (all.0 + one.0, all.1 + one.1));
        assert!(least > 30_000 && 5 * found < 6 * least, "{found} firings where {least} are enough");
    }
}
