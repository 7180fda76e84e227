//! State formulas in negation normal form: what a search looks for, and which literals must become true for it.
//!
//! A formula is a list of nodes, operands before what they are operands of, so that evaluation is one pass over the list
//! whatever the depth, and a node that is shared is looked at once. Constants are the empty conjunction and the empty
//! disjunction. Nothing here knows of transitions: firable, deadlock and start come as the formulas that they are.

use super::dependencies::{Literal, is_true};
use crate::random::Random;

/// A node of a formula; operands are indexes of earlier nodes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Node {
    /// A place is full, or empty.
    Literal(Literal),
    /// All operands are true.
    All(Vec<u32>),
    /// Some operand is true.
    Any(Vec<u32>),
}

/// A formula; the last node is the whole.
#[derive(Clone, Debug)]
pub struct Formula {
    nodes: Vec<Node>,
    truth: Vec<bool>,
    price: Vec<u64>,
    seen: Vec<bool>,
    todo: Vec<u32>,
}

impl Formula {
    /// Checks that operands come first and that places exist.
    pub fn new(nodes: Vec<Node>, places: usize) -> Result<Self, String> {
        if nodes.is_empty() {
            return Err("a formula without nodes".to_owned());
        }
        for (i, node) in nodes.iter().enumerate() {
            match node {
                Node::Literal(l) if (l >> 1) as usize >= places => {
                    return Err(format!("place {} is not one of the {places} places", l >> 1));
                }
                Node::All(operands) | Node::Any(operands) if operands.iter().any(|&o| o as usize >= i) => {
                    return Err(format!("an operand of node {i} does not come before it"));
                }
                _ => {}
            }
        }
        let count = nodes.len();
        Ok(Formula { nodes, truth: vec![false; count], price: vec![0; count], seen: vec![false; count], todo: vec![] })
    }

    /// How many nodes there are.
    pub fn size(&self) -> usize {
        self.nodes.len()
    }

    /// The nodes, operands first.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let operands = |node: &Node| match node {
            Node::Literal(_) => 0,
            Node::All(operands) | Node::Any(operands) => 4 * operands.capacity(),
        };
        self.nodes.iter().map(operands).sum::<usize>() + self.nodes.len() * (size_of::<Node>() + 1 + 8 + 1 + 4)
    }

    /// Whether a marking satisfies the formula.
    pub fn holds(&mut self, marking: &[u64]) -> bool {
        for (i, node) in self.nodes.iter().enumerate() {
            self.truth[i] = match node {
                Node::Literal(l) => is_true(*l, marking),
                Node::All(operands) => operands.iter().all(|&o| self.truth[o as usize]),
                Node::Any(operands) => operands.iter().any(|&o| self.truth[o as usize]),
            };
        }
        self.truth[self.truth.len() - 1]
    }

    /// How many literals must still become true, at least, as if each could by itself; 0 where the formula holds.
    pub fn distance(&mut self, marking: &[u64]) -> u64 {
        for (i, node) in self.nodes.iter().enumerate() {
            self.price[i] = match node {
                Node::Literal(l) => u64::from(!is_true(*l, marking)),
                Node::All(operands) => operands.iter().map(|&o| self.price[o as usize]).fold(0, u64::saturating_add),
                Node::Any(operands) => operands.iter().map(|&o| self.price[o as usize]).min().unwrap_or(u64::MAX),
            };
        }
        self.price[self.price.len() - 1]
    }

    /// Literals that make the formula true if all of them are, and have the least price, as if each were paid by itself;
    /// false where all cost `u32::MAX` or more. Among equal ones one is drawn.
    pub(super) fn cheapest(
        &mut self,
        price: impl Fn(Literal) -> u64,
        random: &mut Random,
        into: &mut Vec<Literal>,
    ) -> bool {
        let never = u64::from(u32::MAX);
        for (i, node) in self.nodes.iter().enumerate() {
            self.price[i] = match node {
                Node::Literal(l) => price(*l),
                Node::All(operands) => operands.iter().map(|&o| self.price[o as usize]).fold(0, u64::saturating_add),
                Node::Any(operands) => operands.iter().map(|&o| self.price[o as usize]).min().unwrap_or(never),
            };
        }
        if self.price[self.price.len() - 1] >= never {
            return false;
        }
        let price = std::mem::take(&mut self.price);
        self.chosen(into, |any| any.iter().copied().min_by_key(|&o| (price[o as usize], random.below(1 << 16))));
        self.price = price;
        true
    }

    /// The literals below the formula, where one operand is chosen of each disjunction.
    fn chosen(&mut self, into: &mut Vec<Literal>, mut choose: impl FnMut(&[u32]) -> Option<u32>) {
        self.todo.push(self.nodes.len() as u32 - 1);
        let mut next = 0;
        while let Some(&node) = self.todo.get(next) {
            next += 1;
            if std::mem::replace(&mut self.seen[node as usize], true) {
                continue;
            }
            match &self.nodes[node as usize] {
                Node::Literal(l) => into.push(*l),
                Node::All(operands) => self.todo.extend(operands),
                Node::Any(operands) => self.todo.extend(choose(operands)),
            }
        }
        self.todo.drain(..).for_each(|node| self.seen[node as usize] = false);
    }

    /// Literals that are true at a marking which satisfies the formula, and enough to make it true.
    pub fn support(&mut self, marking: &[u64], into: &mut Vec<Literal>) {
        into.clear();
        if !self.holds(marking) {
            return;
        }
        let truth = std::mem::take(&mut self.truth);
        self.chosen(into, |any| any.iter().copied().find(|&o| truth[o as usize]));
        self.truth = truth;
    }

    /// What the makers of a false literal cost, for the choice among false operands of conjunctions; after `holds`, of
    /// the same marking, and before `wanted`.
    pub fn weigh(&mut self, price: impl Fn(Literal) -> u64) {
        for (i, node) in self.nodes.iter().enumerate() {
            if self.truth[i] {
                continue;
            }
            let mut unmet = match node {
                Node::Literal(_) => [].iter(),
                Node::All(operands) | Node::Any(operands) => operands.iter(),
            }
            .filter(|&&o| !self.truth[o as usize])
            .map(|&o| self.price[o as usize]);
            self.price[i] = match node {
                Node::Literal(l) => price(*l),
                Node::All(_) => unmet.min().unwrap_or(0),
                Node::Any(_) => unmet.try_fold(0, u64::checked_add).unwrap_or(u64::MAX),
            };
        }
    }

    /// The false nodes of which one is enough: the false operands of the whole where it is a conjunction, else itself.
    pub fn choices(&self) -> Vec<u32> {
        let whole = self.nodes.len() - 1;
        let mut choices: Vec<u32> = match &self.nodes[whole] {
            Node::All(operands) => operands.iter().copied().filter(|&o| !self.truth[o as usize]).collect(),
            _ => vec![whole as u32],
        };
        choices.sort_by_key(|&o| self.price[o as usize]);
        choices.dedup();
        choices
    }

    /// Literals of which some must become true before a false node does: the cheapest false operand of a conjunction,
    /// all operands of a disjunction.
    pub fn wanted(&mut self, node: u32, into: &mut Vec<Literal>) {
        into.clear();
        self.todo.push(node);
        let mut next = 0;
        while let Some(&node) = self.todo.get(next) {
            next += 1;
            if std::mem::replace(&mut self.seen[node as usize], true) {
                continue;
            }
            match &self.nodes[node as usize] {
                Node::Literal(l) => into.push(*l),
                Node::Any(operands) => self.todo.extend(operands),
                Node::All(operands) => {
                    let unmet = operands.iter().filter(|&&o| !self.truth[o as usize]);
                    self.todo.extend(unmet.min_by_key(|&&o| self.price[o as usize]));
                }
            }
        }
        self.todo.drain(..).for_each(|node| self.seen[node as usize] = false);
    }
}

#[cfg(test)]
mod tests {
    use super::super::dependencies::literal;
    use super::*;

    #[test]
    fn cheapest_operand_of_a_conjunction_and_all_of_a_disjunction_are_wanted() {
        let (a, b, c) = (literal(0, true), literal(1, false), literal(2, true));
        // (a and (b or c)) and c, at the marking {1}
        let nodes = vec![
            Node::Literal(a),
            Node::Literal(b),
            Node::Literal(c),
            Node::Any(vec![1, 2]),
            Node::All(vec![0, 3]),
            Node::Any(vec![4]),
        ];
        let mut formula = Formula::new(nodes, 3).expect("well formed");
        assert!(!formula.holds(&[0b010]));
        let mut found = Vec::new();
        for (dear, wanted) in [(a, vec![b, c]), (b, vec![a])] {
            formula.weigh(|l| if l == dear { 9 } else { 1 });
            assert_eq!(formula.choices(), [5]);
            formula.wanted(5, &mut found);
            assert_eq!(found, wanted);
        }
        assert!(formula.holds(&[0b001]) && formula.holds(&[0b111]));
    }

    #[test]
    fn constants_are_empty_conjunction_and_disjunction() {
        assert!(Formula::new(vec![Node::All(vec![])], 0).expect("true").holds(&[0]));
        let mut never = Formula::new(vec![Node::Any(vec![])], 0).expect("false");
        assert!(!never.holds(&[0]));
        never.weigh(|_| 1);
        let mut wanted = vec![1];
        never.wanted(never.choices()[0], &mut wanted);
        assert!(wanted.is_empty());
    }

    #[test]
    fn operand_that_comes_late_and_place_that_does_not_exist_are_refused() {
        assert!(Formula::new(vec![], 3).is_err());
        assert!(Formula::new(vec![Node::Any(vec![0])], 3).is_err());
        assert!(Formula::new(vec![Node::Literal(literal(3, true))], 3).is_err());
    }
}
