//! The synchronous step: the maximal sets F of E(v), over all valuations v of the external signals.
//!
//! A set F of firable transitions is a step at M exactly if (a) no two of F share an input or an output, (b) the
//! literals of F are together satisfiable, and (c) some valuation that satisfies them closes every firable transition
//! outside F that conflicts with none of F. Valuations are so never enumerated (a gate of ten signals would cost 1,024
//! for two different outcomes): F is built by deciding one transition after the other, in or out, each F once; and (c)
//! is a small satisfiability question over the signals that (b) left free, asked as soon as a transition that is out
//! can no longer be excused by a conflict, so that hopeless branches end early. The sets are the maximal independent
//! sets of the conflict graph where there are no gates (Tsukiyama, Ide, Ariyoshi and Shirakawa, 1977).
//!
//! Firable transitions fall into components joined by conflict or by a common signal. A step is any combination of
//! one choice from each component, so components are solved alone, remembered by their set of firable transitions (the
//! choices depend on nothing else), and combined by exclusive or.
//!
//! Why exclusive or: all of F are firable at M, so every input of F is full and every output of F is empty; an input
//! of one can therefore not be an output of another, nor of itself. No input and no output is shared within F. So every
//! place is touched at most once, full to empty or empty to full, and (M minus inputs of F) plus outputs of F is M ^
//! flip(F), whatever the order.

mod choices;

use std::collections::HashMap;
use std::rc::Rc;

use crate::budget::{Memory, Stop, Watch};
use crate::marking::Width;
use crate::net::Net;
use choices::Component;

/// One choice of a component: transitions that fire together, and what their firing changes.
#[derive(Debug)]
pub struct Choice {
    /// The transitions, ascending; none where all are closed.
    pub fired: Box<[u32]>,
    /// The places changed.
    pub flip: Box<[u64]>,
    /// The linear hash of `flip`.
    pub hash: u64,
}

/// The choices of one component.
pub type Factor = Vec<Choice>;

/// Static components: transitions joined by a shared input, a shared output or a shared signal.
#[derive(Debug)]
pub struct Components(Vec<u32>);

impl Components {
    /// Joins by union-find over the sources of conflict.
    pub fn new(net: &Net) -> Self {
        let mut parent: Vec<u32> = (0..net.transitions.len() as u32).collect();
        fn root(parent: &mut [u32], mut t: u32) -> u32 {
            while parent[t as usize] != t {
                parent[t as usize] = parent[parent[t as usize] as usize];
                t = parent[t as usize];
            }
            t
        }
        let mut seen: HashMap<(u8, u32), u32> = HashMap::new();
        for (t, transition) in net.transitions.iter().enumerate() {
            let inputs = transition.inputs.iter().map(|&p| (0, p));
            let outputs = transition.outputs.iter().map(|&p| (1, p));
            let signals = transition.literals.iter().map(|&(s, _)| (2, s));
            for key in inputs.chain(outputs).chain(signals) {
                let other = *seen.entry(key).or_insert(t as u32);
                let (a, b) = (root(&mut parent, t as u32), root(&mut parent, other));
                parent[a as usize] = b;
            }
        }
        Components((0..parent.len() as u32).map(|t| root(&mut parent, t)).collect())
    }
}

/// The visitor's verdict on one step.
pub type Visit = Result<(), Stop>;

/// Enumerates the steps of one marking after another, remembering solved components.
#[derive(Debug)]
pub struct Steps<'a> {
    net: &'a Net,
    components: &'a Components,
    solved: HashMap<Box<[u32]>, Rc<[Factor]>>,
    bytes: usize,
    by_component: Vec<(u32, u32)>,
}

impl<'a> Steps<'a> {
    /// Nothing solved yet.
    pub fn new(net: &'a Net, components: &'a Components) -> Self {
        Steps { net, components, solved: HashMap::new(), bytes: 0, by_component: Vec::new() }
    }

    /// Gives back what the solved components took.
    pub fn forget(&mut self, memory: &Memory) {
        self.solved.clear();
        memory.release(self.bytes);
        self.bytes = 0;
    }

    /// The factors of the steps at a marking: `firable` are the firable and openable transitions, ascending.
    pub fn factors(
        &mut self,
        firable: &[u32],
        memory: &Memory,
        watch: &mut Watch<'_>,
    ) -> Result<Vec<Rc<[Factor]>>, Stop> {
        let mut keyed = std::mem::take(&mut self.by_component);
        keyed.clear();
        keyed.extend(firable.iter().map(|&t| (self.components.0[t as usize], t)));
        keyed.sort_unstable();
        let mut all = Vec::new();
        let mut key: Vec<u32> = Vec::new();
        for part in keyed.chunk_by(|a, b| a.0 == b.0) {
            key.clear();
            key.extend(part.iter().map(|&(_, t)| t));
            if let Some(factors) = self.solved.get(key.as_slice()) {
                all.push(Rc::clone(factors));
                continue;
            }
            let factors = match self.solve(&key, memory, watch) {
                Err(Stop::Memory) if self.bytes > 0 => {
                    self.forget(memory);
                    self.solve(&key, memory, watch)?
                }
                other => other?,
            };
            self.solved.insert(key.clone().into_boxed_slice(), Rc::clone(&factors));
            all.push(factors);
        }
        self.by_component = keyed;
        Ok(all)
    }

    /// Splits a set of firable transitions into the components it has at this marking, and solves each.
    fn solve(&mut self, firable: &[u32], memory: &Memory, watch: &mut Watch<'_>) -> Result<Rc<[Factor]>, Stop> {
        let claimed = memory.used();
        let mut rest: Vec<u32> = firable.to_vec();
        let mut factors = Vec::new();
        let result = loop {
            let Some(first) = rest.pop() else { break Ok(()) };
            let mut component = vec![first];
            let mut next = 0;
            while next < component.len() {
                let t = &self.net.transitions[component[next] as usize];
                next += 1;
                rest.retain(|&u| {
                    let other = &self.net.transitions[u as usize];
                    let joined = t.conflicts(other) || common_signal(&t.literals, &other.literals);
                    if joined {
                        component.push(u);
                    }
                    !joined
                });
            }
            component.sort_unstable();
            match Component::new(self.net, &component).choices(memory, watch) {
                Ok(factor) => factors.push(factor),
                Err(stop) => break Err(stop),
            }
        };
        let result = result.and_then(|()| memory.claim(4 * firable.len() + 96));
        match result {
            Ok(()) => {
                self.bytes += memory.used() - claimed;
                Ok(factors.into())
            }
            Err(stop) => {
                memory.release(memory.used() - claimed);
                Err(stop)
            }
        }
    }

    /// Calls `visit` with each step at a marking: its choices, the marking after and the hash of that.
    pub fn each<W: Width>(
        width: W,
        marking: &[u64],
        hash: u64,
        factors: &[Rc<[Factor]>],
        watch: &mut Watch<'_>,
        visit: &mut impl FnMut(&[&Choice], &[u64], u64) -> Visit,
    ) -> Visit {
        let factors: Vec<&Factor> = factors.iter().flat_map(|part| part.iter()).collect();
        if factors.is_empty() {
            return Ok(());
        }
        let words = width.words();
        let depth = factors.len();
        // after[d] is the marking after the choices of the first d factors: an odometer that redoes only what turned.
        let mut after = vec![0; words * (depth + 1)];
        after[..words].copy_from_slice(marking);
        let mut hashes = vec![hash; depth + 1];
        let mut wheel = vec![0; depth];
        let mut chosen: Vec<&Choice> = Vec::with_capacity(depth);
        loop {
            while chosen.len() < depth {
                let d = chosen.len();
                let choice = &factors[d][wheel[d]];
                for k in 0..words {
                    after[(d + 1) * words + k] = after[d * words + k] ^ choice.flip[k];
                }
                hashes[d + 1] = hashes[d] ^ choice.hash;
                chosen.push(choice);
            }
            watch.tick(1)?;
            if chosen.iter().any(|choice| !choice.fired.is_empty()) {
                visit(&chosen, &after[depth * words..], hashes[depth])?;
            }
            loop {
                let Some(_) = chosen.pop() else { return Ok(()) };
                let d = chosen.len();
                wheel[d] += 1;
                if wheel[d] < factors[d].len() {
                    break;
                }
                wheel[d] = 0;
                if d == 0 {
                    return Ok(());
                }
            }
        }
    }
}

fn common_signal(left: &[(u32, bool)], right: &[(u32, bool)]) -> bool {
    left.iter().any(|&(s, _)| right.iter().any(|&(other, _)| s == other))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::net::Transition;

    type Row<'a> = (&'a [u32], &'a [u32], &'a [(u32, bool)]);

    fn steps(rows: &[Row<'_>]) -> Vec<Vec<u32>> {
        let transitions = rows.iter().map(|(i, o, x)| Transition::new(i, o, &[], &[], x)).collect();
        let net = Net::new(32, transitions, &[]).expect("well formed");
        let components = Components::new(&net);
        let mut enumerator = Steps::new(&net, &components);
        let memory = Memory::new(1 << 20);
        let mut poll = unwatched;
        let mut watch = Watch::new(None, &mut poll);
        let firable: Vec<u32> = (0..rows.len() as u32).collect();
        let factors = enumerator.factors(&firable, &memory, &mut watch).expect("fits");
        let mut all = Vec::new();
        let width = crate::marking::Fixed::<1>;
        Steps::each(width, &[0], 0, &factors, &mut watch, &mut |chosen, _, _| {
            let mut fired: Vec<u32> = chosen.iter().flat_map(|choice| choice.fired.iter().copied()).collect();
            fired.sort_unstable();
            all.push(fired);
            Ok(())
        })
        .expect("fits");
        all.sort();
        all
    }

    #[test]
    fn a_chain_of_conflicts_fires_its_maximal_sets() {
        let chain: &[Row<'_>] = &[(&[0], &[10], &[]), (&[0, 1], &[11], &[]), (&[1, 2], &[12], &[]), (&[2], &[13], &[])];
        assert_eq!(steps(chain), [vec![0, 2], vec![0, 3], vec![1, 3]]);
    }

    #[test]
    fn shared_outputs_exclude_each_other() {
        assert_eq!(steps(&[(&[0], &[10], &[]), (&[1], &[10], &[])]), [[0], [1]]);
    }

    #[test]
    fn a_free_gate_gives_both_outcomes_and_the_empty_step_is_left_out() {
        assert_eq!(steps(&[(&[0], &[10], &[(0, true)])]), [[0]]);
        assert_eq!(steps(&[(&[0], &[10], &[(0, true)]), (&[1], &[11], &[])]), [vec![0, 1], vec![1]]);
    }

    #[test]
    fn complementary_gates_never_fire_together_and_never_both_wait() {
        assert_eq!(steps(&[(&[0], &[10], &[(0, true)]), (&[1], &[11], &[(0, false)])]), [[0], [1]]);
    }

    #[test]
    fn a_gate_of_many_signals_has_two_outcomes() {
        let many: Vec<(u32, bool)> = (0..40).map(|s| (s, true)).collect();
        assert_eq!(steps(&[(&[0], &[10], &many), (&[1], &[11], &[])]), [vec![0, 1], vec![1]]);
    }

    #[test]
    fn what_three_gates_cannot_close_together_is_not_left_out_together() {
        // a wants s, b wants not s: one of them is open, so the empty choice of the two does not exist.
        let rows: &[Row<'_>] =
            &[(&[0], &[10], &[(0, true), (1, true)]), (&[1], &[11], &[(0, false)]), (&[2], &[12], &[(1, false)])];
        assert_eq!(steps(rows), [vec![0], vec![1], vec![1, 2], vec![2]]);
    }
}
