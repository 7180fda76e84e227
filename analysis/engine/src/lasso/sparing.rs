//! Fewer firings: of those that can be done in either order one order is followed, as long as no edge tells them apart.
//!
//! At a marking a *stubborn set* around a key is closed (`stubborn/mod.rs`): whatever fires outside of it leaves the key
//! firable, and can be done after it as well as before. Where none of its firable transitions is *seen*, which means that
//! it changes a place that a label speaks of or is named by an edge, the others can wait: a run that begins with
//! them goes through the same labels as one that begins with the key. Only labels of states that can still be entered
//! count, so after the jump into a part that waits for little, little is seen. That nothing waits for ever, a vertex with
//! an edge back to one that is open is left by all that is firable (Peled, "Combining partial order reductions with
//! on-the-fly model-checking", 1996).
//!
//! This finds runs, it proves nothing: the set depends on the state of the automaton, and with that the reduced product
//! need not hold a run although there is one (Siegel, "What's wrong with on-the-fly partial order reduction", 2019); and
//! formulas with X or about firings tell apart what is taken for the same here. So a search that spares and ends with
//! nothing has not answered the question.

use super::automaton::{Admits, Automaton};
use crate::budget::{Memory, Stop};
use crate::stubborn::closure::Closure;
use crate::stubborn::dependencies::{Literal, negation};
use crate::stubborn::effort::Effort;
use crate::stubborn::formula::Node;
use crate::stubborn::marks::Marks;
use crate::stubborn::search::Prepared;

/// So many keys are closed at a vertex.
const KEYS_MAX: usize = 8;

/// Chooses what is fired first at one vertex after the other.
pub(super) struct Sparing<'a> {
    closure: Closure<'a>,
    /// For each state of the automaton the transitions that are seen from there on.
    seen: Vec<Marks>,
    closing: Effort,
    literals: Vec<Literal>,
}

impl<'a> Sparing<'a> {
    /// For a net and an automaton.
    pub(super) fn new(prepared: &'a Prepared, automaton: &Automaton, memory: &Memory) -> Result<Self, Stop> {
        let Prepared { net, dependencies } = prepared;
        let count = net.transitions.len();
        memory.claim(Closure::bytes(net.places, count))?;
        memory.claim(4 * count * automaton.rows.len())?;
        let seen = automaton.rows.iter().map(|_| Marks::new(count));
        let mut labels = Marks::new(automaton.labels.len());
        let mut sparing = Sparing {
            closure: Closure::new(dependencies, net.places, count),
            seen: seen.collect(),
            closing: Effort::default(),
            literals: Vec::new(),
        };
        for (state, seen) in sparing.seen.iter_mut().enumerate() {
            labels.clear();
            for later in entered(automaton, state) {
                for edge in &automaton.rows[later] {
                    let (Admits::Only(these) | Admits::AllBut(these)) = &edge.admits;
                    these.iter().for_each(|&t| _ = seen.insert(t));
                    if !labels.insert(edge.label) {
                        continue;
                    }
                    for node in automaton.labels[edge.label as usize].nodes() {
                        if let &Node::Literal(l) = node {
                            let changing = dependencies.makers.of(l).iter().chain(dependencies.makers.of(negation(l)));
                            changing.for_each(|&t| _ = seen.insert(t));
                        }
                    }
                }
            }
        }
        Ok(sparing)
    }

    /// Brings to the front what may be fired alone at a vertex, and says how much that is; keys are tried in the order
    /// given.
    pub(super) fn choose(&mut self, marking: &[u64], state: usize, firable: &mut [u32]) -> usize {
        if firable.len() < 2 || !self.closing.is_worth_it() {
            return firable.len();
        }
        let (closure, seen) = (&mut self.closure, &self.seen[state]);
        closure.start_from(firable);
        for &key in firable.iter().filter(|&&key| !seen.has(key)).take(KEYS_MAX) {
            self.literals.clear();
            self.literals.extend(closure.net.conditions(key).iter().map(|&l| negation(l)));
            closure.consider_unless(marking, &self.literals, &[], false, |t| seen.has(t));
            if closure.best.firable.len() < 2 {
                break;
            }
        }
        let chosen = closure.best.firable.len();
        // A key that changes nothing need not be a member itself.
        let spares = 0 < chosen && chosen < firable.len();
        self.closing.note(spares);
        if !spares {
            return firable.len();
        }
        firable.sort_by_key(|&t| !closure.best.member.has(t));
        chosen
    }
}

/// The states that can be entered from a state, with it.
fn entered(automaton: &Automaton, from: usize) -> Vec<usize> {
    let mut met = vec![false; automaton.rows.len()];
    met[from] = true;
    let mut all = vec![from];
    let mut next = 0;
    while let Some(&state) = all.get(next) {
        next += 1;
        for edge in &automaton.rows[state] {
            if !std::mem::replace(&mut met[edge.target as usize], true) {
                all.push(edge.target as usize);
            }
        }
    }
    all
}
