//! The nodes of some sets, as rows that anybody can read: what shows elsewhere, without this engine, which markings they hold.
//!
//! Sets of one diagram share nodes, and a row stands once. Each row is a level and the numbers of the two rows below it,
//! which stand before it; 0 is the empty set and 1 that of the empty marking, and the first row is number 2. An explicit
//! stack instead of recursion, as everywhere: a diagram is as deep as the net has places.

use std::collections::HashMap;

use super::space::Symbolic;
use super::zdd::{EMPTY, Node, UNIT};
use crate::budget::{Stop, Watch};

/// A level, and the numbers of the rows of its two parts.
pub type Line = (u32, u32, u32);
/// The rows of some sets, and the number of each set's own.
pub type Listing = (Vec<Line>, Vec<u32>);

impl Symbolic {
    /// The nodes of some sets, and the number of each set's own; None where they are more than `most`.
    pub fn listed(&mut self, sets: &[Node], most: usize, watch: &mut Watch<'_>) -> Result<Option<Listing>, Stop> {
        let store = &self.diagram().store;
        let mut number: HashMap<Node, u32> = HashMap::from([(EMPTY, 0), (UNIT, 1)]);
        let mut lines: Vec<Line> = Vec::new();
        let mut todo: Vec<Node> = sets.to_vec();
        while let Some(&node) = todo.last() {
            watch.tick(1)?;
            if number.contains_key(&node) {
                todo.pop();
                continue;
            }
            let (lo, hi) = (store.lo(node), store.hi(node));
            match (number.get(&lo), number.get(&hi)) {
                (Some(&lo), Some(&hi)) => {
                    if lines.len() == most {
                        return Ok(None);
                    }
                    lines.push((store.level(node), lo, hi));
                    number.insert(node, lines.len() as u32 + 1);
                    todo.pop();
                }
                (known, other) => {
                    todo.extend(known.is_none().then_some(lo));
                    todo.extend(other.is_none().then_some(hi));
                }
            }
        }
        Ok(Some((lines, sets.iter().map(|set| number[set]).collect())))
    }
}
