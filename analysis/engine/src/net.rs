//! The net as the engine sees it: sets of places as sorted lists, and the firing rule compiled for bit slices.
//!
//! Eq. (1) as conjunctions: a transition is firable where all of `full` hold, none of `hole` and none of `out`. The
//! places of `out` are kept apart because contact is the same condition with `out` reversed: the engine tests both at
//! the price of one. Lists of places, not masks: a slice is fetched for each place, most transitions touch two to six
//! of them, and a mask over 10,000 places would be 157 words for each.
//!
//! The rule is compiled twice. `forward` is the rule itself; `backward` tests, at the marking *after*, whether the
//! marking before (the exclusive or with the same mask) enabled the transition: outputs full, inputs empty, and the
//! gates as they were before. So predecessors need no stored edges.

use crate::marking::{Dynamic, linear_hash, put, words_for};

/// One transition: sets of places and external literals, each sorted and without repetition.
#[derive(Clone, Debug, Default)]
pub struct Transition {
    /// I(t)
    pub inputs: Vec<u32>,
    /// O(t)
    pub outputs: Vec<u32>,
    /// Gp(t)
    pub permissive: Vec<u32>,
    /// Gi(t)
    pub inhibitive: Vec<u32>,
    /// X(t): signal and wanted value
    pub literals: Vec<(u32, bool)>,
}

impl Transition {
    /// Sorts the sets, as the engine expects them.
    pub fn new(
        inputs: &[u32],
        outputs: &[u32],
        permissive: &[u32],
        inhibitive: &[u32],
        literals: &[(u32, bool)],
    ) -> Self {
        Self::of([inputs, outputs, permissive, inhibitive].map(<[u32]>::to_vec), literals.to_vec())
    }

    /// The same of lists that it keeps: inputs, outputs, permissive and inhibitive gates, and literals.
    pub(crate) fn of(places: [Vec<u32>; 4], literals: Vec<(u32, bool)>) -> Self {
        let [inputs, outputs, permissive, inhibitive] = places.map(set);
        Transition { inputs, outputs, permissive, inhibitive, literals: set(literals) }
    }

    /// Whether some valuation of the signals makes every literal true.
    pub fn openable(&self) -> bool {
        self.literals.windows(2).all(|pair| pair[0].0 != pair[1].0)
    }

    /// Whether two firings compete: a place has at most one consumer and at most one producer in a step.
    pub fn conflicts(&self, other: &Transition) -> bool {
        meet(&self.inputs, &other.inputs) || meet(&self.outputs, &other.outputs)
    }
}

fn set<T: Ord>(mut items: Vec<T>) -> Vec<T> {
    items.sort_unstable();
    items.dedup();
    items
}

fn minus(left: &[u32], right: &[u32]) -> Vec<u32> {
    left.iter().copied().filter(|p| right.binary_search(p).is_err()).collect()
}

/// Whether two sorted lists share an element.
pub fn meet(left: &[u32], right: &[u32]) -> bool {
    let (mut i, mut j) = (0, 0);
    while i < left.len() && j < right.len() {
        match left[i].cmp(&right[j]) {
            std::cmp::Ordering::Less => i += 1,
            std::cmp::Ordering::Greater => j += 1,
            std::cmp::Ordering::Equal => return true,
        }
    }
    false
}

#[derive(Clone, Copy, Debug)]
struct Span {
    full: u32,
    hole: u32,
    out: u32,
    end: u32,
}

/// The conditions of all transitions, laid out for a scan over bit slices.
#[derive(Clone, Debug)]
pub struct Rules {
    places: Vec<u32>,
    spans: Vec<Span>,
    /// For each transition all ones if its condition can hold at all (it has no self-loop), else zero.
    sound: Vec<u64>,
    /// The same, and its literals do not contradict.
    edge: Vec<u64>,
}

impl Rules {
    fn new() -> Self {
        Rules { places: Vec::new(), spans: Vec::new(), sound: Vec::new(), edge: Vec::new() }
    }

    fn add(&mut self, full: &[u32], hole: &[u32], out: &[u32], sound: bool, openable: bool) {
        let mut mark = |part: &[u32]| {
            let start = self.places.len() as u32;
            self.places.extend_from_slice(part);
            start
        };
        let span = Span { full: mark(full), hole: mark(hole), out: mark(out), end: mark(&[]) };
        self.spans.push(span);
        self.sound.push(if sound { !0 } else { 0 });
        self.edge.push(if sound && openable { !0 } else { 0 });
    }

    /// Which of the sliced markings satisfy `full` and `hole`, and which have a place of `out` full.
    #[inline(always)]
    pub fn test(&self, t: usize, slices: &[u64], valid: u64) -> (u64, u64) {
        let span = self.spans[t];
        let mut base = valid;
        for &p in &self.places[span.full as usize..span.hole as usize] {
            base &= slices[p as usize];
        }
        for &p in &self.places[span.hole as usize..span.out as usize] {
            base &= !slices[p as usize];
        }
        if base == 0 {
            return (0, 0);
        }
        let mut blocked = 0;
        for &p in &self.places[span.out as usize..span.end as usize] {
            blocked |= slices[p as usize];
        }
        (base, blocked)
    }

    /// All ones unless the transition has a self-loop, which no marking satisfies.
    #[inline(always)]
    pub fn sound(&self, t: usize) -> u64 {
        self.sound[t]
    }

    /// All ones where the transition can make an edge: it has no self-loop and its literals do not contradict.
    #[inline(always)]
    pub fn edge(&self, t: usize) -> u64 {
        self.edge[t]
    }

    /// Which of some of the sliced markings have an edge by the transition.
    #[inline(always)]
    pub fn fire(&self, t: usize, slices: &[u64], pending: u64) -> u64 {
        let (base, blocked) = self.test(t, slices, pending);
        base & !blocked & self.edge[t]
    }

    /// The same test at one marking, of an openable transition; false for any other.
    pub fn test_one(&self, t: usize, holds: impl Fn(u32) -> bool) -> bool {
        let span = self.spans[t];
        let part = |start: u32, end: u32| self.places[start as usize..end as usize].iter();
        self.edge[t] != 0
            && part(span.full, span.hole).all(|&p| holds(p))
            && part(span.hole, span.end).all(|&p| !holds(p))
    }

    fn bytes(&self) -> usize {
        self.places.capacity() * 4
            + self.spans.capacity() * size_of::<Span>()
            + (self.sound.capacity() + self.edge.capacity()) * 8
    }
}

/// A net, checked and compiled.
#[derive(Clone, Debug)]
pub struct Net {
    /// How many places there are.
    pub places: usize,
    /// How many words a marking takes.
    pub words: usize,
    /// The transitions, by index.
    pub transitions: Vec<Transition>,
    /// M0.
    pub initial: Vec<u64>,
    /// The words of a marking that some firing changes, ascending; all others are those of M0.
    pub active: Vec<usize>,
    /// The rule at the marking before.
    pub forward: Rules,
    /// The rule at the marking after.
    pub backward: Rules,
    /// For each transition the places that a firing changes, `words` words each.
    pub flips: Vec<u64>,
    /// The linear hash of each flip.
    pub flip_hashes: Vec<u64>,
}

impl Net {
    /// Checks the indexes of places and compiles the rules; says which index is out of range.
    pub fn new(places: usize, transitions: Vec<Transition>, initial: &[u32]) -> Result<Self, String> {
        let check = |set: &[u32], what: &str| match set.iter().find(|&&p| p as usize >= places) {
            Some(p) => Err(format!("place {p} in {what} is not one of the {places} places")),
            None => Ok(()),
        };
        check(initial, "the initial marking")?;
        let words = words_for(places);
        let mut net = Net {
            places,
            words,
            initial: vec![0; words],
            active: Vec::new(),
            forward: Rules::new(),
            backward: Rules::new(),
            flips: vec![0; words * transitions.len()],
            flip_hashes: Vec::with_capacity(transitions.len()),
            transitions,
        };
        for &p in initial {
            put(&mut net.initial, p);
        }
        let arcs: usize = net.transitions.iter().map(|t| t.inputs.len() + t.outputs.len()).sum();
        if u32::try_from(arcs).is_err() {
            return Err("more than 2^32 arcs".to_owned());
        }
        for (t, transition) in net.transitions.iter().enumerate() {
            let Transition { inputs, outputs, permissive, inhibitive, .. } = transition;
            for part in [inputs, outputs, permissive, inhibitive] {
                check(part, &format!("transition {t}"))?;
            }
            let self_loop = meet(inputs, outputs);
            let openable = transition.openable();
            let full = set([inputs.as_slice(), permissive].concat());
            net.forward.add(&full, inhibitive, &minus(outputs, inputs), !self_loop, openable);
            // A gate that Eq. (1) can never meet: the marking before would need a place full and empty.
            let never = meet(permissive, outputs) || meet(inhibitive, inputs) || meet(permissive, inhibitive);
            net.backward.add(
                &set([outputs.as_slice(), &minus(permissive, inputs)].concat()),
                &set([inputs.as_slice(), &minus(inhibitive, outputs)].concat()),
                &[],
                !self_loop && !never,
                openable,
            );
            let flip = &mut net.flips[t * words..(t + 1) * words];
            for &p in inputs.iter().chain(outputs) {
                put(flip, p);
            }
            net.flip_hashes.push(match words {
                1 => flip[0],
                _ => linear_hash(Dynamic(words), flip),
            });
        }
        let changes =
            |k: usize| (0..net.transitions.len()).any(|t| net.forward.edge(t) != 0 && net.flip(t, words)[k] != 0);
        net.active = (0..words).filter(|&k| changes(k)).collect();
        Ok(net)
    }

    /// The places that a firing of `t` changes, as a mask.
    #[inline(always)]
    pub fn flip(&self, t: usize, words: usize) -> &[u64] {
        &self.flips[t * words..(t + 1) * words]
    }

    /// Changes some of the sliced markings as a firing of `t` does.
    #[inline(always)]
    pub fn flip_slices(&self, t: usize, slices: &mut [u64], some: u64) {
        let Transition { inputs, outputs, .. } = &self.transitions[t];
        for &p in inputs.iter().chain(outputs) {
            slices[p as usize] ^= some;
        }
    }

    /// Bytes held by the compiled net.
    pub fn bytes(&self) -> usize {
        let lists: usize = self
            .transitions
            .iter()
            .map(|t| {
                4 * (t.inputs.capacity()
                    + t.outputs.capacity()
                    + t.permissive.capacity()
                    + t.inhibitive.capacity()
                    + 2 * t.literals.capacity())
                    + size_of::<Transition>()
            })
            .sum();
        lists + self.forward.bytes() + self.backward.bytes() + 8 * (self.flips.len() + self.flip_hashes.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_out_of_range_is_refused() {
        let t = Transition::new(&[0], &[3], &[], &[], &[]);
        assert!(Net::new(3, vec![t.clone()], &[]).is_err());
        assert!(Net::new(4, vec![t], &[4]).is_err());
    }

    #[test]
    fn a_signal_wanted_both_ways_never_opens() {
        assert!(!Transition::new(&[], &[], &[], &[], &[(1, true), (0, true), (1, false)]).openable());
        assert!(Transition::new(&[], &[], &[], &[], &[(1, true), (0, true), (1, true)]).openable());
    }

    #[test]
    fn conflict_is_a_shared_input_or_a_shared_output() {
        let t = Transition::new(&[0], &[1], &[2], &[], &[]);
        assert!(t.conflicts(&Transition::new(&[0], &[3], &[], &[], &[])));
        assert!(t.conflicts(&Transition::new(&[3], &[1], &[], &[], &[])));
        assert!(!t.conflicts(&Transition::new(&[1], &[0], &[2], &[], &[])));
    }
}
