//! The Boolean algebra of sets of markings, and the few other operations on one diagram.
//!
//! The textbook recursion over pairs of nodes (Bryant 1986, for zero suppression Minato 1993), written with a stack of its
//! own: a net has half a million levels, and a recursion as deep ends in the stack of the thread, where running out is
//! no return value. One loop serves all four operations, which differ only in their easy cases and in what becomes of
//! a level that one operand passes over.
//!
//! A result is remembered only for the highest pair of nodes in a block of levels. A block has few paths, so what is done
//! twice inside it is little, and to remember it all would fill the cache with several times as many results.

use super::cache::{Cache, Op};
use super::zdd::{EMPTY, Node, Store, TERMINAL, UNIT};
use crate::budget::{Memory, Stop, Watch};

/// A store with the memory of what was computed in it.
#[derive(Debug)]
pub struct Diagram {
    /// The nodes.
    pub store: Store,
    /// The results.
    pub cache: Cache,
    calls: Vec<Call>,
    /// The block of each level; 0 for level 0.
    block_of: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
struct Call {
    a: Node,
    b: Node,
    lo: Node,
    level: u32,
    /// Whether the result is remembered.
    kept: bool,
}

const PENDING: Node = u32::MAX;

enum Step {
    Call(Node, Node),
    Return(Node),
}

/// A Boolean operation on two sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binary {
    /// In either.
    Union,
    /// In both.
    Intersection,
    /// In the first and not in the second.
    Difference,
    /// In exactly one.
    Symmetric,
}

impl Binary {
    fn op(self) -> Op {
        match self {
            Binary::Union => Op::Union,
            Binary::Intersection => Op::Intersection,
            Binary::Difference => Op::Difference,
            Binary::Symmetric => Op::Symmetric,
        }
    }

    /// The result where it needs no look inside.
    #[inline]
    fn easy(self, a: Node, b: Node) -> Option<Node> {
        match self {
            Binary::Union if a == b || b == EMPTY => Some(a),
            Binary::Union | Binary::Symmetric if a == EMPTY => Some(b),
            Binary::Intersection if a == b => Some(a),
            Binary::Intersection if a == EMPTY || b == EMPTY => Some(EMPTY),
            Binary::Difference | Binary::Symmetric if a == b => Some(EMPTY),
            Binary::Difference if a == EMPTY => Some(EMPTY),
            Binary::Difference | Binary::Symmetric if b == EMPTY => Some(a),
            _ => None,
        }
    }
}

impl Diagram {
    /// An empty diagram within a budget; half of it at most goes to remembered results. `block_of` gives each level from
    /// 0 its block.
    pub fn new(memory: Memory, bytes_max: usize, block_of: Vec<u32>) -> Result<Self, Stop> {
        let store = Store::new(memory)?;
        let cache = Cache::new(&store.memory, bytes_max / 2)?;
        Ok(Diagram { store, cache, calls: Vec::new(), block_of })
    }

    /// A Boolean operation on two sets.
    pub fn binary(&mut self, binary: Binary, a: Node, b: Node, watch: &mut Watch<'_>) -> Result<Node, Stop> {
        if let Some(known) = binary.easy(a, b) {
            return Ok(known);
        }
        let result = self.run(binary, a, b, watch);
        self.calls.clear(); // not empty where it stopped
        result
    }

    /// The markings in either set.
    pub fn union(&mut self, a: Node, b: Node, watch: &mut Watch<'_>) -> Result<Node, Stop> {
        self.binary(Binary::Union, a, b, watch)
    }

    fn run(&mut self, binary: Binary, a: Node, b: Node, watch: &mut Watch<'_>) -> Result<Node, Stop> {
        let op = binary.op();
        let mut step = Step::Call(a, b);
        loop {
            step = match step {
                Step::Call(a, b) => {
                    // Where the order does not matter, one of the two orders is remembered.
                    let (a, b) = if binary != Binary::Difference && a > b { (b, a) } else { (a, b) };
                    let (above, below) = (self.store.level(a), self.store.level(b));
                    if let Some(known) = binary.easy(a, b) {
                        Step::Return(known)
                    } else if binary == Binary::Intersection && above != below {
                        let (a, b) = if above > below { (self.store.lo(a), b) } else { (a, self.store.lo(b)) };
                        Step::Call(a, b)
                    } else if binary == Binary::Difference && above < below {
                        Step::Call(a, self.store.lo(b))
                    } else {
                        let level = above.max(below);
                        let block = |level: u32| self.block_of[level as usize];
                        let kept = self.calls.last().is_none_or(|up| block(up.level) != block(level));
                        if let Some(known) = if kept { self.cache.get(op, 0, a, b) } else { None } {
                            Step::Return(known)
                        } else {
                            watch.tick(1)?;
                            self.store.memory.push(&mut self.calls, Call { a, b, lo: PENDING, level, kept })?;
                            Step::Call(self.store.split(a, level).0, self.store.split(b, level).0)
                        }
                    }
                }
                Step::Return(node) => {
                    let Some(mut call) = self.calls.pop() else { return Ok(node) };
                    let level = call.level;
                    if call.lo == PENDING {
                        call.lo = node;
                        self.calls.push(call); // into the room it came from
                        Step::Call(self.store.split(call.a, level).1, self.store.split(call.b, level).1)
                    } else {
                        // Mostly one operand holds the other, so it is looked at before the table of all nodes.
                        let known = [call.a, call.b].into_iter().find(|&of| self.store.is(of, level, call.lo, node));
                        let node = known.map_or_else(|| self.store.node(level, call.lo, node), Ok)?;
                        if call.kept {
                            self.cache.put(&self.store.memory, op, 0, call.a, call.b, node)?;
                        }
                        Step::Return(node)
                    }
                }
            };
        }
    }

    /// Frees what no root leads to.
    pub fn collect(&mut self, roots: impl Iterator<Item = Node>) -> Result<(), Stop> {
        let marks = self.store.collect(roots)?;
        self.cache.sweep(&marks);
        self.store.done(marks);
        Ok(())
    }

    /// The set of one marking, given by its levels in ascending order.
    pub fn single(&mut self, levels: &[u32]) -> Result<Node, Stop> {
        levels.iter().try_fold(UNIT, |below, &level| self.store.node(level, EMPTY, below))
    }

    /// Whether a marking, given by its levels in ascending order, is in a set.
    pub fn contains(&self, set: Node, levels: &[u32]) -> bool {
        let mut node = set;
        for &level in levels.iter().rev() {
            while self.store.level(node) > level {
                node = self.store.lo(node);
            }
            if self.store.level(node) != level {
                return false;
            }
            node = self.store.hi(node);
        }
        while self.store.level(node) != TERMINAL {
            node = self.store.lo(node);
        }
        node == UNIT
    }

    /// Some marking of a set, by its levels in ascending order: the one with the highest places empty if it can be.
    pub fn any(&self, set: Node) -> Option<Vec<u32>> {
        let mut node = set;
        let mut levels = Vec::new();
        while self.store.level(node) != TERMINAL {
            if self.store.lo(node) == EMPTY {
                levels.push(self.store.level(node));
                node = self.store.hi(node);
            } else {
                node = self.store.lo(node);
            }
        }
        levels.reverse();
        (node == UNIT).then_some(levels)
    }
}
