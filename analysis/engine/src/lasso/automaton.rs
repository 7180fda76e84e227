//! The automaton of a search for a lasso, as the engine takes it: numbers in the place of formulas and names.
//!
//! What must hold in a marking is a *label*, of which each is evaluated once at a marking however many edges bear it.
//! What the next firing may be is said by lists of transitions, as most formulas name one or none.

use crate::stubborn::formula::Formula;

/// The most marks that an automaton may have.
pub const MARKS_MAX: u32 = 64;

/// Which firings an edge admits.
#[derive(Clone, Debug)]
pub enum Admits {
    /// These, ascending.
    Only(Vec<u32>),
    /// All but these, ascending.
    AllBut(Vec<u32>),
}

impl Admits {
    /// Whether the firing of a transition is admitted.
    #[inline(always)]
    pub fn has(&self, t: u32) -> bool {
        match self {
            Admits::Only(these) => these.binary_search(&t).is_ok(),
            Admits::AllBut(these) => these.is_empty() || these.binary_search(&t).is_err(),
        }
    }

    fn list(&self) -> &Vec<u32> {
        match self {
            Admits::Only(these) | Admits::AllBut(these) => these,
        }
    }
}

/// An edge of the automaton.
#[derive(Clone, Debug)]
pub struct Edge {
    /// The number of the formula that the marking must satisfy.
    pub label: u32,
    /// What may fire.
    pub admits: Admits,
    /// Whether it may be taken in a deadlock.
    pub stutters: bool,
    /// The state that it leads to.
    pub target: u32,
    /// Its marks, a bit for each.
    pub marks: u64,
}

/// A generalised Büchi automaton; state 0 is the first.
#[derive(Clone, Debug)]
pub struct Automaton {
    /// The formulas.
    pub labels: Vec<Formula>,
    /// The edges of each state.
    pub rows: Vec<Vec<Edge>>,
    /// All marks: a run needs each of them again and again.
    pub all_marks: u64,
}

impl Automaton {
    /// Checks that whatever an edge names is there.
    pub fn new(
        labels: Vec<Formula>,
        mut rows: Vec<Vec<Edge>>,
        n_marks: u32,
        transitions: usize,
    ) -> Result<Self, String> {
        if rows.is_empty() {
            return Err("an automaton without states".to_owned());
        }
        if n_marks > MARKS_MAX {
            return Err(format!("{n_marks} marks are more than {MARKS_MAX}"));
        }
        let all_marks = if n_marks == 0 { 0 } else { u64::MAX >> (MARKS_MAX - n_marks) };
        let states = rows.len();
        for edge in rows.iter_mut().flatten() {
            let (Admits::Only(these) | Admits::AllBut(these)) = &mut edge.admits;
            these.sort_unstable();
            if edge.label as usize >= labels.len() || edge.target as usize >= states {
                return Err("an edge names a label or a state that is not there".to_owned());
            }
            if these.last().is_some_and(|&t| t as usize >= transitions) || edge.marks & !all_marks != 0 {
                return Err("an edge names a transition or a mark that is not there".to_owned());
            }
        }
        Ok(Automaton { labels, rows, all_marks })
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let edge = |edge: &Edge| size_of::<Edge>() + 4 * edge.admits.list().capacity();
        self.labels.iter().map(Formula::bytes).sum::<usize>() + self.rows.iter().flatten().map(edge).sum::<usize>()
    }
}
