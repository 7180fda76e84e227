//! What firing sequences are made of: markings and moves by level, and what is remembered of the sequences found.

use super::events::{Kind, Sense, literals};
use super::zdd::{EMPTY, Node, Store, TERMINAL};
use crate::net::Transition;

/// The results that the first search for layers may compute. Where the layers did not lead into one set they hardly lead
/// into the next, so each search in vain leaves a fraction of it to those after it, down to the least.
const LAYERS_WORK: u64 = 1 << 18;
pub(super) const LAYERS_WORK_LEAST: u64 = 1 << 15;
const IN_VAIN: u64 = 8;

/// A firing sequence from M0, by the indexes of transitions, and the places that hold a token after it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Walk {
    /// What fires, in turn.
    pub firings: Vec<u32>,
    /// The places that hold a token in the end, ascending.
    pub reached: Vec<u32>,
    /// Whether no other sequence into the targets is shorter.
    pub shortest: bool,
}

/// What a search for a sequence leaves to the next one.
#[derive(Debug)]
pub(super) struct Walks {
    /// The sequences that were found block by block.
    pub(super) found: Vec<Walk>,
    /// The results that a search for layers may compute.
    pub(super) layers_work: u64,
}

impl Default for Walks {
    fn default() -> Self {
        Walks { found: Vec::new(), layers_work: LAYERS_WORK }
    }
}

impl Walks {
    /// The layers did not lead there.
    pub(super) fn in_vain(&mut self) {
        self.layers_work = (self.layers_work / IN_VAIN).max(LAYERS_WORK_LEAST);
    }
}

/// A marking: for each level from 1 whether its place holds a token.
pub(super) type Marking = Vec<bool>;

/// Whether a set holds a marking of so many tokens.
pub(super) fn holds(store: &Store, set: Node, marking: &Marking, tokens: usize) -> bool {
    let (mut node, mut met) = (set, 0);
    while store.level(node) != TERMINAL {
        if marking[store.level(node) as usize] {
            met += 1;
            node = store.hi(node);
        } else {
            node = store.lo(node);
        }
    }
    node != EMPTY && met == tokens
}

/// How many tokens there are.
pub(super) fn tokens(marking: &Marking) -> usize {
    marking.iter().filter(|&&token| token).count()
}

/// The moves of a net by level; a transition that never fires has none.
pub(super) struct Moves(Vec<Option<Vec<(u32, Kind)>>>);

impl Moves {
    /// The moves of these transitions, where each place has its level.
    pub(super) fn new(transitions: &[Transition], level_of: &[u32]) -> Self {
        Moves(transitions.iter().map(|t| literals(t, level_of, Sense::Forward)).collect())
    }

    /// How many transitions there are.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// The levels that a transition has to do with.
    pub(super) fn levels(&self, t: usize) -> impl Iterator<Item = u32> + '_ {
        self.0[t].iter().flatten().map(|&(level, _)| level)
    }

    /// The levels that its firing changes.
    pub(super) fn flipped(&self, t: usize) -> impl Iterator<Item = u32> + '_ {
        self.0[t].iter().flatten().filter(|(_, kind)| kind.wants() != kind.leaves()).map(|&(level, _)| level)
    }

    /// Whether a transition takes a token that another one puts.
    pub(super) fn follows(&self, t: usize, other: usize) -> bool {
        let puts = |level| self.0[other].iter().flatten().any(|&(at, kind)| at == level && kind == Kind::Put);
        self.0[t].iter().flatten().any(|&(level, kind)| kind == Kind::Take && puts(level))
    }

    /// Whether a transition may fire.
    pub(super) fn fires(&self, t: usize, marking: &Marking) -> bool {
        self.0[t].as_ref().is_some_and(|all| all.iter().all(|&(level, kind)| marking[level as usize] == kind.wants()))
    }

    /// Whether a transition may just have fired.
    pub(super) fn fired(&self, t: usize, marking: &Marking) -> bool {
        self.0[t].as_ref().is_some_and(|all| all.iter().all(|&(level, kind)| marking[level as usize] == kind.leaves()))
    }

    /// Fires a transition, or takes a firing back: both are the same exclusive or.
    pub(super) fn flip(&self, t: usize, marking: &mut Marking) {
        let all = self.0[t].iter().flatten();
        all.filter(|(_, kind)| kind.wants() != kind.leaves()).for_each(|&(level, _)| marking[level as usize] ^= true);
    }
}
