//! Sets of markings as zero-suppressed decision diagrams: the store of nodes.
//!
//! A node (level, lo, hi) is the set of markings of `lo`, in which the place of this level is empty, and of those of `hi`
//! with a token put on it; a level that is passed over is empty. So a set of markings with few tokens is a small diagram
//! (Minato, *Zero-suppressed BDDs*, 1993), where the ordinary reduction would store every empty place. Each node is
//! stored once, found again by a hash table chained through the nodes themselves: equal sets are equal numbers.
//!
//! Nodes are 16 bytes in one flat array and are named by `u32`; what is no longer used is found by marking from the
//! roots and threaded into a list of free cells, so that numbers stay valid. The rejected alternative, counting the
//! references of every node, writes to two children for each node made, and nearly all of them die within the operation.

use crate::budget::{Memory, Stop};
use crate::region::Region;

/// A set of markings: the number of its node.
pub type Node = u32;

/// The empty set.
pub const EMPTY: Node = 0;
/// The set of the empty marking alone.
pub const UNIT: Node = 1;

/// The level of the two terminal nodes; places have levels from 1, the top is the highest.
pub const TERMINAL: u32 = 0;
const FREE: u32 = u32::MAX;
/// No node: a terminal is in no chain.
const NIL: u32 = 0;
const NODES_MAX: usize = (1 << 31) - 1;
/// Below this number of nodes nothing is collected; below the second one neither, where there is memory for many times as
/// many. What no root leads to is not yet useless: a search meets it again, and with it goes what was remembered of it.
const COLLECT_FROM: usize = 1 << 20;
const COLLECT_FROM_MOST: usize = 1 << 22;
/// How many bytes there are for each of these.
const BYTES_PER_NODE: usize = 1 << 10;
/// How many chains there are for each node that is remembered as the last of its hash.
const PER_LAST: usize = 2;
/// How many chains there are at least for each node: to look into one that does not hold what is wanted costs a miss of
/// the processor's caches for each node in it.
const CHAINS: usize = 2;

#[derive(Clone, Copy, Debug)]
struct Cell {
    level: u32,
    lo: Node,
    hi: Node,
    next: u32,
}

/// All nodes of one order of places.
#[derive(Debug)]
pub struct Store {
    cells: Vec<Cell>,
    buckets: Region<u32>,
    /// The node that was last made in several steps, by a hash of what it was made of; it may be another one since.
    last: Region<u32>,
    free: u32,
    used: usize,
    collect_at: usize,
    /// The bytes that the diagram holds and may hold, stacks and cache included.
    pub memory: Memory,
}

/// Which nodes are in use: one bit for each.
#[derive(Debug)]
pub struct Marks(Vec<u64>);

impl Marks {
    /// Whether the node is in use; terminals always are.
    #[inline]
    pub fn has(&self, node: Node) -> bool {
        self.0[node as usize / 64] >> (node % 64) & 1 != 0
    }

    fn set(&mut self, node: Node) -> bool {
        let (word, bit) = (&mut self.0[node as usize / 64], 1 << (node % 64));
        let fresh = *word & bit == 0;
        *word |= bit;
        fresh
    }
}

/// The chain of a node. Nodes whose parts were made one after the other, as those of neighbours are, have their chains in
/// one line of a processor's cache.
#[inline]
fn hash(level: u32, lo: Node, hi: Node) -> u64 {
    let mixed = u64::from(lo >> 4) << 32 | u64::from(hi >> 4);
    let mixed = mixed ^ u64::from(level).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ mixed >> 32).wrapping_mul(0xd6e8_feb8_6659_fd93);
    (mixed ^ mixed >> 32) << 4 | u64::from((lo ^ hi) & 15)
}

/// The number of nodes below which nothing is collected.
fn collect_from(memory: &Memory) -> usize {
    (memory.limit() / BYTES_PER_NODE).clamp(COLLECT_FROM, COLLECT_FROM_MOST)
}

/// Empty chains, claimed.
fn buckets(memory: &Memory, size: usize) -> Result<Region<u32>, Stop> {
    let bytes = size * size_of::<u32>();
    memory.claim(bytes)?;
    Region::zeroed(size).ok_or(Stop::Memory).inspect_err(|_| memory.release(bytes))
}

impl Store {
    /// The two terminals alone.
    pub fn new(memory: Memory) -> Result<Self, Stop> {
        let mut store = Store {
            cells: Vec::new(),
            buckets: buckets(&memory, 1 << 10)?,
            last: buckets(&memory, (1 << 10) / PER_LAST)?,
            free: NIL,
            used: 2,
            collect_at: collect_from(&memory),
            memory,
        };
        for _ in 0..2 {
            let terminal = Cell { level: TERMINAL, lo: EMPTY, hi: EMPTY, next: NIL };
            store.memory.push(&mut store.cells, terminal)?;
        }
        Ok(store)
    }

    /// The level of a node, 0 for a terminal.
    #[inline(always)]
    pub fn level(&self, node: Node) -> u32 {
        self.cells[node as usize].level
    }

    /// The markings in which the place of the node's level is empty.
    #[inline(always)]
    pub fn lo(&self, node: Node) -> Node {
        self.cells[node as usize].lo
    }

    /// The markings in which the place of the node's level is full, the token on it taken away.
    #[inline(always)]
    pub fn hi(&self, node: Node) -> Node {
        self.cells[node as usize].hi
    }

    /// Both parts of a set at a level that is not below its own.
    #[inline(always)]
    pub fn split(&self, node: Node, level: u32) -> (Node, Node) {
        let cell = &self.cells[node as usize];
        debug_assert!(cell.level <= level);
        if cell.level == level && level != TERMINAL { (cell.lo, cell.hi) } else { (node, EMPTY) }
    }

    /// Whether a node is the one of these parts at this level.
    #[inline(always)]
    pub(super) fn is(&self, node: Node, level: u32, lo: Node, hi: Node) -> bool {
        let cell = &self.cells[node as usize];
        cell.lo == lo && cell.hi == hi && cell.level == level
    }

    /// One more than the greatest number of a node.
    pub(super) fn len(&self) -> usize {
        self.cells.len()
    }

    /// How many nodes are stored, dead ones included.
    pub fn used(&self) -> usize {
        self.used
    }

    /// Whether enough nodes were made since the last collection to make another one pay.
    #[inline]
    pub fn due(&self) -> bool {
        self.used >= self.collect_at
    }

    /// The node of these parts at this level, which lies above both.
    #[inline]
    pub fn node(&mut self, level: u32, lo: Node, hi: Node) -> Result<Node, Stop> {
        if hi == EMPTY {
            return Ok(lo);
        }
        debug_assert!(self.level(lo) < level && self.level(hi) < level);
        let bucket = hash(level, lo, hi) as usize & (self.buckets.all().len() - 1);
        let mut at = self.buckets.all()[bucket];
        while at != NIL {
            let cell = &self.cells[at as usize];
            if cell.lo == lo && cell.hi == hi && cell.level == level {
                return Ok(at);
            }
            at = cell.next;
        }
        self.insert(bucket, level, lo, hi)
    }

    /// The node that was last made from values of a hash; the caller looks whether it is what is wanted.
    #[inline]
    pub(super) fn last_of(&self, hash: u64) -> Node {
        let last = self.last.all();
        last[hash as usize & (last.len() - 1)]
    }

    /// Remembers the node made from values of a hash.
    #[inline]
    pub(super) fn set_last_of(&mut self, hash: u64, node: Node) {
        let last = self.last.all_mut();
        let at = hash as usize & (last.len() - 1);
        last[at] = node;
    }

    fn insert(&mut self, bucket: usize, level: u32, lo: Node, hi: Node) -> Result<Node, Stop> {
        let cell = Cell { level, lo, hi, next: self.buckets.all()[bucket] };
        let at = if self.free != NIL {
            let at = self.free;
            self.free = self.cells[at as usize].next;
            self.cells[at as usize] = cell;
            at
        } else {
            if self.cells.len() >= NODES_MAX {
                return Err(Stop::Memory);
            }
            self.memory.push(&mut self.cells, cell)?;
            self.cells.len() as u32 - 1
        };
        self.used += 1;
        self.buckets.all_mut()[bucket] = at;
        if CHAINS * self.used > self.buckets.all().len() {
            self.rehash(self.buckets.all().len() * 2)?;
        }
        Ok(at)
    }

    fn rehash(&mut self, size: usize) -> Result<(), Stop> {
        let (new, last) = (buckets(&self.memory, size)?, buckets(&self.memory, size / PER_LAST)?);
        self.memory.release((self.buckets.all().len() + self.last.all().len()) * size_of::<u32>());
        (self.buckets, self.last) = (new, last);
        self.chain();
        Ok(())
    }

    fn chain(&mut self) {
        let buckets = self.buckets.all_mut();
        let mask = buckets.len() - 1;
        for (at, cell) in self.cells.iter_mut().enumerate().skip(2).filter(|(_, cell)| cell.level != FREE) {
            let bucket = hash(cell.level, cell.lo, cell.hi) as usize & mask;
            cell.next = std::mem::replace(&mut buckets[bucket], at as u32);
        }
    }

    /// Frees every node that no root leads to, and says which ones are still in use.
    ///
    /// The marks are the caller's to look at and to hand back to `done`.
    pub fn collect(&mut self, roots: impl Iterator<Item = Node>) -> Result<Marks, Stop> {
        let mut marks = Marks(self.memory.filled(0, self.cells.len().div_ceil(64))?);
        let mut todo: Vec<Node> = Vec::new();
        marks.set(EMPTY);
        marks.set(UNIT);
        let marking = || {
            for root in roots {
                self.memory.push(&mut todo, root)?;
                while let Some(mut node) = todo.pop() {
                    while marks.set(node) {
                        let cell = self.cells[node as usize];
                        self.memory.push(&mut todo, cell.lo)?;
                        node = cell.hi;
                    }
                }
            }
            Ok(())
        };
        let marked = marking();
        self.memory.drop_vec(todo);
        if let Err(stop) = marked {
            self.done(marks);
            return Err(stop);
        }
        self.buckets.all_mut().fill(NIL);
        self.free = NIL;
        self.used = 2;
        for (at, cell) in self.cells.iter_mut().enumerate().skip(2).rev() {
            if marks.has(at as u32) {
                self.used += 1;
            } else {
                *cell = Cell { level: FREE, lo: EMPTY, hi: EMPTY, next: self.free };
                self.free = at as u32;
            }
        }
        self.chain();
        self.collect_at = collect_from(&self.memory).max(2 * self.used);
        Ok(marks)
    }

    /// Gives the marks of a collection back.
    pub fn done(&self, marks: Marks) {
        self.memory.release(marks.0.len() * size_of::<u64>());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_memory_is_ample_more_nodes_are_made_before_the_next_collection() {
        let ample = 2 * COLLECT_FROM * BYTES_PER_NODE;
        for (limit, from) in [(ample / 4, COLLECT_FROM), (ample, 2 * COLLECT_FROM), (4 * ample, COLLECT_FROM_MOST)] {
            let mut store = Store::new(Memory::new(limit)).expect("enough room");
            assert_eq!(store.collect_at, from);
            // What may be held is said anew now and then.
            store.memory.allow(ample / 2);
            store.node(1, EMPTY, UNIT).expect("enough room");
            let marks = store.collect([].into_iter()).expect("enough room");
            store.done(marks);
            assert_eq!((store.used(), store.collect_at), (2, COLLECT_FROM));
        }
    }
}
