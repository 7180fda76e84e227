//! The choices of one component of a step: which of its firable transitions may fire together.
//!
//! Each transition is decided in turn, in or out, depth first and without recursion. A branch ends where a transition
//! that is out can neither be excused by a conflict any more nor be closed by the signals that are still free; the
//! latter is asked of a small search by clauses. Why that gives the steps, each once, is said in `step.rs`.
//!
//! Rejected: to try all valuations of the signals (ten of them cost 1,024 for two different outcomes).

use std::collections::HashMap;

use super::{Choice, Factor};
use crate::budget::{Memory, Stop, Watch};
use crate::net::Net;

/// A disjunction of literals over the signals of a component.
type Clause = Vec<(usize, bool)>;

/// One component while it is solved; transitions and signals are numbered within it.
pub(super) struct Component<'a> {
    net: &'a Net,
    transitions: &'a [u32],
    conflicts: Vec<Vec<usize>>,
    literals: Vec<Vec<(usize, bool)>>,
    signals: usize,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Decision {
    Undecided,
    In,
    Out,
}

impl<'a> Component<'a> {
    pub(super) fn new(net: &'a Net, transitions: &'a [u32]) -> Self {
        let of = |i: usize| &net.transitions[transitions[i] as usize];
        let count = transitions.len();
        let conflicts =
            (0..count).map(|i| (0..count).filter(|&j| j != i && of(i).conflicts(of(j))).collect()).collect();
        let mut numbers: HashMap<u32, usize> = HashMap::new();
        let literals = (0..count)
            .map(|i| {
                of(i)
                    .literals
                    .iter()
                    .map(|&(signal, wanted)| {
                        let next = numbers.len();
                        (*numbers.entry(signal).or_insert(next), wanted)
                    })
                    .collect()
            })
            .collect();
        Component { net, transitions, conflicts, literals, signals: numbers.len() }
    }

    /// All choices, each once, in lexicographic order with "in" before "out".
    pub(super) fn choices(&self, memory: &Memory, watch: &mut Watch<'_>) -> Result<Factor, Stop> {
        let count = self.transitions.len();
        let mut decisions = vec![Decision::Undecided; count];
        let mut found = Vec::new();
        let mut level = 0;
        // Depth first without recursion: at `level` the decision is advanced undecided -> in -> out -> back.
        loop {
            watch.tick(1)?;
            let next = match decisions[level] {
                Decision::Undecided => Decision::In,
                Decision::In => Decision::Out,
                Decision::Out => {
                    decisions[level] = Decision::Undecided;
                    if level == 0 {
                        return Ok(found);
                    }
                    level -= 1;
                    continue;
                }
            };
            decisions[level] = next;
            let possible = match next {
                Decision::In => self.may_join(&decisions, level),
                _ => true,
            };
            if !possible || !self.feasible(&decisions, watch)? {
                continue;
            }
            if level + 1 < count {
                level += 1;
            } else {
                memory.claim(size_of::<Choice>() * 2 + 4 * count + 8 * self.net.words)?;
                found.push(self.choice(&decisions));
            }
        }
    }

    /// Whether `i` conflicts with none that is in and its literals agree with theirs.
    fn may_join(&self, decisions: &[Decision], i: usize) -> bool {
        if self.conflicts[i].iter().any(|&j| decisions[j] == Decision::In) {
            return false;
        }
        self.literals[i].is_empty()
            || (0..decisions.len())
                .filter(|&j| j != i && decisions[j] == Decision::In)
                .all(|j| self.literals[i].iter().all(|&(s, wanted)| !self.literals[j].contains(&(s, !wanted))))
    }

    /// Whether the decisions so far can still become a step; exact when all are made.
    fn feasible(&self, decisions: &[Decision], watch: &mut Watch<'_>) -> Result<bool, Stop> {
        let mut valuation: Vec<Option<bool>> = vec![None; self.signals];
        for i in (0..decisions.len()).filter(|&i| decisions[i] == Decision::In) {
            for &(s, wanted) in &self.literals[i] {
                valuation[s] = Some(wanted);
            }
        }
        let mut clauses: Vec<Clause> = Vec::new();
        for i in (0..decisions.len()).filter(|&i| decisions[i] == Decision::Out) {
            let excused = self.conflicts[i].iter().any(|&j| match decisions[j] {
                Decision::In => true,
                Decision::Out => false,
                Decision::Undecided => self.may_join(decisions, j),
            });
            if excused || self.literals[i].iter().any(|&(s, wanted)| valuation[s] == Some(!wanted)) {
                continue;
            }
            // It must be closed: one of its literals is false, of those that are still free.
            let clause: Clause = self.literals[i]
                .iter()
                .filter(|&&(s, _)| valuation[s].is_none())
                .map(|&(s, wanted)| (s, !wanted))
                .collect();
            if clause.is_empty() {
                return Ok(false);
            }
            clauses.push(clause);
        }
        satisfiable(&clauses, valuation, watch)
    }

    fn choice(&self, decisions: &[Decision]) -> Choice {
        let words = self.net.words;
        let mut flip = vec![0; words];
        let mut hash = 0;
        let mut fired = Vec::new();
        for i in (0..decisions.len()).filter(|&i| decisions[i] == Decision::In) {
            let t = self.transitions[i] as usize;
            fired.push(self.transitions[i]);
            hash ^= self.net.flip_hashes[t];
            for (word, &change) in flip.iter_mut().zip(self.net.flip(t, words)) {
                *word ^= change;
            }
        }
        Choice { fired: fired.into(), flip: flip.into(), hash }
    }
}

/// Davis-Putnam-Logemann-Loveland with the shortest clause first, on a trail instead of a recursion.
fn satisfiable(clauses: &[Clause], mut valuation: Vec<Option<bool>>, watch: &mut Watch<'_>) -> Result<bool, Stop> {
    // (signal, whether the other value was already tried)
    let mut trail: Vec<(usize, bool)> = Vec::new();
    loop {
        watch.tick(1)?;
        let mut shortest: Option<(usize, (usize, bool))> = None;
        let mut conflict = false;
        for clause in clauses {
            if clause.iter().any(|&(s, value)| valuation[s] == Some(value)) {
                continue;
            }
            let mut free = clause.iter().filter(|&&(s, _)| valuation[s].is_none());
            let Some(&literal) = free.next() else {
                conflict = true;
                break;
            };
            let length = 1 + free.count();
            if shortest.is_none_or(|(best, _)| length < best) {
                shortest = Some((length, literal));
            }
        }
        if conflict {
            loop {
                let Some((s, tried)) = trail.pop() else { return Ok(false) };
                if tried {
                    valuation[s] = None;
                } else {
                    valuation[s] = valuation[s].map(|value| !value);
                    trail.push((s, true));
                    break;
                }
            }
            continue;
        }
        let Some((length, (s, value))) = shortest else { return Ok(true) };
        valuation[s] = Some(value);
        // The last literal of a clause is forced: its other value needs no trial.
        trail.push((s, length == 1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;

    #[test]
    fn satisfiability_agrees_with_every_valuation_tried() {
        let mut seed = 11_u64;
        let mut below = |n: u64| {
            seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
            (crate::marking::mix(seed) % n) as usize
        };
        let (mut yes, mut no) = (0, 0);
        for _ in 0..3000 {
            let clauses: Vec<Clause> =
                (0..below(14)).map(|_| (0..=below(3)).map(|_| (below(4), below(2) == 1)).collect()).collect();
            let expected = (0..16_u32).any(|valuation| {
                clauses.iter().all(|clause| clause.iter().any(|&(s, value)| (valuation >> s & 1 == 1) == value))
            });
            let mut poll = unwatched;
            let mut watch = Watch::new(None, &mut poll);
            assert_eq!(satisfiable(&clauses, vec![None; 4], &mut watch), Ok(expected), "{clauses:?}");
            if expected { yes += 1 } else { no += 1 }
        }
        assert!(yes > 500 && no > 500);
    }
}
