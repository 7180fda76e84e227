//! The memory of operations: what was computed before is not computed again.
//!
//! A diagram operation is linear in its diagrams only because each pair of nodes is met once; a cache that forgets makes
//! it exponential in their depth. A lossy cache sized by the number of *nodes* does forget: a saturation of a small
//! diagram fires thousands of events on each node. So this one grows by *insertions*, doubling whenever as many results
//! as it has room for were put in since it grew last, until its share of the memory is used up; only then is it lossy.
//!
//! Four entries of 16 bytes make a line of a processor's cache; a new entry goes to the front of its line and pushes out
//! the last, which is the oldest. A hash map that never forgets was rejected: it has no way to live within a budget.

use super::zdd::{EMPTY, Marks, Node};
use crate::budget::{Memory, Stop};
use crate::region::Region;

/// Which operation a result belongs to; the upper four bits of a key's first word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Op {
    /// A union; an operand is a node.
    Union = 1,
    /// An intersection.
    Intersection,
    /// A difference.
    Difference,
    /// A symmetric difference.
    Symmetric,
    /// A saturated image; the operand is a suffix, then a node, then a constraint.
    Fire,
    /// The same, of the predecessors.
    FireBack,
    /// The same, of the predecessors by some transitions alone.
    FireSome,
    /// A fixed point at a level; the operand is a level, then a node, then a constraint.
    Fix,
    /// The same, of the predecessors.
    FixBack,
    /// The same, of the predecessors by some transitions alone.
    FixSome,
    /// An image; the operand is a suffix, then a node.
    Image,
    /// The image under a whole table; the operand is the number of the table, then a node.
    Once,
}

/// The largest first operand that is no node, of a key with the table's number beside it.
pub const OPERAND_MAX: u32 = (1 << 28) - 1;
/// No constraint, in the place of a node.
pub const ANY: Node = u32::MAX;

/// The key of an operation and its operands, and the result.
type Entry = [u32; 4];

const WAYS: usize = 4;
const LINES: usize = 1 << 8;
/// How often over a cache that cannot grow may be filled anew.
const FORGOTTEN_MAX: usize = 64;
const BLANK: Entry = [0; 4];

/// Results by operation and operands.
#[derive(Debug)]
pub struct Cache {
    lines: Region<[Entry; WAYS]>,
    inserted: usize,
    grow_at: usize,
    bytes_max: usize,
    /// How many results were put in since the beginning: work done, whatever the clock says.
    pub work: u64,
}

#[inline]
fn key(op: Op, operand: u32, a: u32, b: u32) -> [u32; 3] {
    debug_assert!(operand <= OPERAND_MAX);
    [(op as u32) << 28 | operand, a, b]
}

#[inline]
fn hash(key: [u32; 3]) -> usize {
    let mixed = (u64::from(key[0]) << 32 | u64::from(key[1])) ^ u64::from(key[2]).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ mixed >> 32).wrapping_mul(0xd6e8_feb8_6659_fd93);
    (mixed ^ mixed >> 32) as usize
}

/// Empty lines, claimed.
fn blank(memory: &Memory, lines: usize) -> Result<Region<[Entry; WAYS]>, Stop> {
    let bytes = lines * size_of::<[Entry; WAYS]>();
    memory.claim(bytes)?;
    Region::zeroed(lines).ok_or(Stop::Memory).inspect_err(|_| memory.release(bytes))
}

impl Cache {
    /// An empty cache that may take so many bytes.
    pub fn new(memory: &Memory, bytes_max: usize) -> Result<Self, Stop> {
        let lines = blank(memory, LINES)?;
        Ok(Cache { lines, inserted: 0, grow_at: LINES * WAYS / 2, bytes_max, work: 0 })
    }

    /// The result, if it is still known.
    #[inline]
    pub fn get(&self, op: Op, operand: u32, a: u32, b: u32) -> Option<Node> {
        let key = key(op, operand, a, b);
        let lines = self.lines.all();
        let line = &lines[hash(key) & (lines.len() - 1)];
        line.iter().find(|entry| entry[..3] == key).map(|entry| entry[3])
    }

    /// Remembers a result; an operand or result that is a node must be one.
    #[inline]
    pub fn put(&mut self, memory: &Memory, op: Op, operand: u32, a: u32, b: u32, result: Node) -> Result<(), Stop> {
        self.inserted += 1;
        self.work += 1;
        if self.inserted > self.grow_at {
            self.grow(memory)?;
        }
        let [op, a, b] = key(op, operand, a, b);
        self.place([op, a, b, result]);
        Ok(())
    }

    #[inline]
    fn place(&mut self, entry: Entry) {
        let lines = self.lines.all_mut();
        let mask = lines.len() - 1;
        let line = &mut lines[hash([entry[0], entry[1], entry[2]]) & mask];
        line.copy_within(..WAYS - 1, 1);
        line[0] = entry;
    }

    #[cold]
    fn grow(&mut self, memory: &Memory) -> Result<(), Stop> {
        let (old, line) = (self.lines.all().len(), size_of::<[Entry; WAYS]>());
        let lines = if 2 * old * line <= self.bytes_max { blank(memory, 2 * old).ok() } else { None };
        let Some(lines) = lines else {
            // No more room: from now on it forgets, for a while.
            let patience = FORGOTTEN_MAX * old * WAYS;
            if self.grow_at == patience {
                return Err(Stop::Memory);
            }
            self.grow_at = patience;
            return Ok(());
        };
        let before = std::mem::replace(&mut self.lines, lines);
        for entry in before.all().iter().flat_map(|line| line.iter().rev()).filter(|&&entry| entry != BLANK) {
            self.place(*entry);
        }
        memory.release(old * line);
        self.inserted = 0;
        self.grow_at = old * WAYS;
        Ok(())
    }

    /// Forgets every result of some operations.
    pub fn forget(&mut self, ops: &[Op]) {
        for entry in self.lines.all_mut().iter_mut().flatten() {
            if ops.iter().any(|&op| entry[0] >> 28 == op as u32) {
                *entry = BLANK;
            }
        }
    }

    /// Forgets every result that speaks of a node no longer in use.
    pub fn sweep(&mut self, marks: &Marks) {
        for entry in self.lines.all_mut().iter_mut().flatten() {
            let known = |node: u32| node == ANY || marks.has(node);
            if !entry[1..].iter().all(|&node| known(node)) {
                *entry = BLANK;
            }
        }
    }
}

const _: () = assert!(EMPTY == 0 && size_of::<[Entry; WAYS]>() == 64);
