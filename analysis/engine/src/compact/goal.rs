//! State formulas, evaluated at up to 64 markings at once.

use crate::stubborn::formula::{Formula, Node};

/// A formula, and room for the values of its nodes.
pub(crate) struct Goal {
    formula: Formula,
    values: Vec<u64>,
}

impl Goal {
    pub(crate) fn new(formula: Formula) -> Self {
        let values = vec![0; formula.size()];
        Goal { formula, values }
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.formula.bytes() + 8 * self.values.len()
    }

    /// At which of the sliced markings it holds.
    pub(crate) fn holds(&mut self, slices: &[u64], valid: u64) -> u64 {
        let mut last = 0;
        for (i, node) in self.formula.nodes().iter().enumerate() {
            last = match node {
                Node::Literal(l) => slices[(l >> 1) as usize] ^ if l & 1 == 1 { 0 } else { !0 },
                Node::All(operands) => operands.iter().fold(!0, |all, &o| all & self.values[o as usize]),
                Node::Any(operands) => operands.iter().fold(0, |any, &o| any | self.values[o as usize]),
            };
            self.values[i] = last;
        }
        last & valid
    }
}
