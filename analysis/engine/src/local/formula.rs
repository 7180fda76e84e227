//! Formulas of CTL as the search takes them: a list of nodes, operands before what they are operands of.
//!
//! Three operators speak of what follows, `EX`, `E[l U r]` and `A[l U r]`; all others are made of these and of negations
//! by whoever compiles a formula. State formulas are labels, with the literals of `stubborn::formula`.

use crate::stubborn::formula::Formula as State;

/// How deep formulas may nest: the search calls itself for each level.
pub const NESTING_MAX: usize = 1_000;

/// A node of a formula; operands are indexes of earlier nodes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Node {
    /// A state formula, by its number.
    Label(u32),
    /// The operand is false.
    Not(u32),
    /// All operands are true.
    All(Vec<u32>),
    /// Some operand is true.
    Any(Vec<u32>),
    /// Some next marking satisfies the operand.
    Next(u32),
    /// On some maximal run the second holds now or later, and the first until then.
    SomeUntil(u32, u32),
    /// On every maximal run the second holds now or later, and the first until then.
    EachUntil(u32, u32),
}

/// A subformula that is an until, of some run or of each.
#[derive(Clone, Copy, Debug)]
pub(super) struct Until {
    pub(super) node: u32,
    pub(super) left: u32,
    pub(super) right: u32,
    pub(super) some: bool,
}

impl Node {
    fn operands(&self) -> Vec<u32> {
        match self {
            Node::Label(_) => Vec::new(),
            Node::Not(one) | Node::Next(one) => vec![*one],
            Node::All(operands) | Node::Any(operands) => operands.clone(),
            Node::SomeUntil(left, right) | Node::EachUntil(left, right) => vec![*left, *right],
        }
    }
}

/// A formula of CTL; the last node is the whole.
#[derive(Clone, Debug)]
pub struct Formula {
    /// The nodes, operands first.
    pub nodes: Vec<Node>,
    /// The state formulas.
    pub labels: Vec<State>,
    /// For each node a state formula such that the fewer of its literals are false, the nearer the node may be.
    pub aims: Vec<Option<u32>>,
}

impl Formula {
    /// Checks that operands come first, that labels exist, and that nesting is bounded.
    pub fn new(nodes: Vec<Node>, labels: Vec<State>) -> Result<Self, String> {
        if nodes.is_empty() {
            return Err("a formula without nodes".to_owned());
        }
        let mut depths: Vec<usize> = Vec::with_capacity(nodes.len());
        for (i, node) in nodes.iter().enumerate() {
            if let Node::Label(label) = node
                && *label as usize >= labels.len()
            {
                return Err(format!("there is no label {label} of {}", labels.len()));
            }
            let operands = node.operands();
            if operands.iter().any(|&o| o as usize >= i) {
                return Err(format!("an operand of node {i} does not come before it"));
            }
            let depth = 1 + operands.iter().map(|&o| depths[o as usize]).max().unwrap_or(0);
            if depth > NESTING_MAX {
                return Err(format!("nests more than {NESTING_MAX} levels deep"));
            }
            depths.push(depth);
        }
        let aims = aims(&nodes);
        Ok(Formula { nodes, labels, aims })
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let operands: usize = self.nodes.iter().map(|node| 4 * node.operands().len()).sum();
        operands
            + self.nodes.len() * (size_of::<Node>() + size_of::<Option<u32>>())
            + self.labels.iter().map(State::bytes).sum::<usize>()
    }
}

/// What brings a node nearer: itself where it is a state formula, else what comes first in it or ends it.
fn aims(nodes: &[Node]) -> Vec<Option<u32>> {
    let mut aims: Vec<Option<u32>> = Vec::with_capacity(nodes.len());
    for node in nodes {
        let of = |o: &u32| aims[*o as usize];
        aims.push(match node {
            Node::Label(label) => Some(*label),
            Node::Not(_) => None,
            Node::All(operands) | Node::Any(operands) => operands.iter().find_map(of),
            Node::Next(one) => of(one),
            Node::SomeUntil(_, right) | Node::EachUntil(_, right) => of(right),
        });
    }
    aims
}
