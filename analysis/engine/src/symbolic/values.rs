//! A node opened into the values of its block, and closed again.
//!
//! The values of a node stand at the end of a list that all open nodes share, one after the other, since they are closed in
//! the reverse order. In ascending order they are the paths through the block from left to right, so a node is closed by
//! cutting the list where the highest bit changes.
//!
//! To find each node of such a path by the table of all nodes is what a search would spend most of its time on, as nearly
//! every look at that table misses the processor's caches. So the last node is remembered that was closed from
//! values of the same hash, and looked at first: its nodes mostly stand side by side, as they were made in one go. Where
//! that is another one, each part is compared with the same part of the node that the search began with, of which most
//! values are left as they were.

use super::cache::ANY;
use super::zdd::{EMPTY, Node, Store};
use crate::budget::Stop;

/// A value of an open node: the places of its block that hold a token, as bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Value {
    pub(super) bits: u32,
    /// What is below it: the source of a firing, then the result.
    pub(super) node: Node,
    /// The part of a constraint below it.
    pub(super) within: Node,
    /// Whether the events that start from it are still to be fired.
    pub(super) grown: bool,
}

/// Adds the values of a node in ascending order; `low` is the lowest level of the block, `bits` those of the levels above.
pub(super) fn opened(store: &Store, node: Node, low: u32, bits: u32, values: &mut Vec<Value>) -> Result<(), Stop> {
    let level = store.level(node);
    if level >= low {
        opened(store, store.lo(node), low, bits, values)?;
        return opened(store, store.hi(node), low, bits | 1 << (level - low), values);
    }
    if node == EMPTY {
        return Ok(());
    }
    store.memory.push(values, Value { bits, node, within: ANY, grown: true })
}

/// The node of these values, which are in ascending order and not empty below; `like` is one that may share parts with it.
pub(super) fn closed(store: &mut Store, values: &[Value], low: u32, like: Node) -> Result<Node, Stop> {
    match values {
        [] => Ok(EMPTY),
        [only] if only.bits == 0 => Ok(only.node),
        _ => {
            let mix = |hash: u64, at: &Value| {
                (hash.rotate_left(23) ^ u64::from(at.bits) << 32 ^ u64::from(at.node))
                    .wrapping_mul(0x9e37_79b9_7f4a_7c15)
            };
            let hash = values.iter().fold(u64::from(low), mix);
            let hash = hash ^ hash >> 32;
            let last = store.last_of(hash);
            if same(store, last, values, low, u32::MAX) {
                return Ok(last);
            }
            let node = cut(store, values, low, u32::MAX, like)?;
            store.set_last_of(hash, node);
            Ok(node)
        }
    }
}

/// Whether a node has just these values, which differ in the bits of a mask alone.
fn same(store: &Store, node: Node, values: &[Value], low: u32, mask: u32) -> bool {
    let Some(last) = values.last().filter(|last| last.bits & mask != 0) else { return values[0].node == node };
    let at = (last.bits & mask).ilog2();
    if store.level(node) != low + at {
        return false;
    }
    let bit = 1 << at;
    let split = values.partition_point(|value| value.bits & bit == 0);
    same(store, store.hi(node), &values[split..], low, bit - 1)
        && (if split == 0 {
            store.lo(node) == EMPTY
        } else {
            same(store, store.lo(node), &values[..split], low, bit - 1)
        })
}

/// Makes the node of values that differ in the bits of a mask alone.
fn cut(store: &mut Store, values: &[Value], low: u32, mask: u32, like: Node) -> Result<Node, Stop> {
    let Some(last) = values.last().filter(|last| last.bits & mask != 0) else { return Ok(values[0].node) };
    let at = (last.bits & mask).ilog2();
    let bit = 1 << at;
    let level = low + at;
    let mut like = like;
    while store.level(like) > level {
        like = store.lo(like);
    }
    let (like_lo, like_hi) = store.split(like, level);
    let split = values.partition_point(|value| value.bits & bit == 0);
    let hi = cut(store, &values[split..], low, bit - 1, like_hi)?;
    let lo = if split == 0 { EMPTY } else { cut(store, &values[..split], low, bit - 1, like_lo)? };
    if store.is(like, level, lo, hi) { Ok(like) } else { store.node(level, lo, hi) }
}
