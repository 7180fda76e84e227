//! The diagram against sets of masks: every operation, on nets small enough to hold all their markings in a list.

use std::collections::BTreeSet;

use firable_engine::budget::{Stop, Watch, unwatched};
use firable_engine::net::Transition;
use firable_engine::symbolic::algebra::Binary;
use firable_engine::symbolic::cache::ANY;
use firable_engine::symbolic::space::{By, Events, Symbolic};
use firable_engine::symbolic::zdd::{EMPTY, Node};

type Set = BTreeSet<u32>;

/// Numbers that look random and are the same in every run (Marsaglia's xorshift).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) % bound
    }

    fn places(&mut self, places: u32, most: u64) -> Vec<u32> {
        let count = self.below(most + 1);
        (0..count).map(|_| self.below(u64::from(places)) as u32).collect()
    }
}

struct Naive {
    places: u32,
    transitions: Vec<Transition>,
    initial: Vec<u32>,
}

fn mask(places: &[u32]) -> u32 {
    places.iter().fold(0, |mask, place| mask | 1 << place)
}

impl Naive {
    fn drawn(numbers: &mut Numbers) -> Self {
        let places = 1 + numbers.below(7) as u32;
        let transitions = (0..numbers.below(9))
            .map(|_| {
                let (inputs, outputs) = (numbers.places(places, 2), numbers.places(places, 2));
                let gates = |numbers: &mut Numbers| match numbers.below(4) {
                    0 => numbers.places(places, 1),
                    _ => Vec::new(),
                };
                let (permissive, inhibitive) = (gates(numbers), gates(numbers));
                let closed = if numbers.below(12) == 0 { vec![(0, true), (0, false)] } else { Vec::new() };
                Transition::new(&inputs, &outputs, &permissive, &inhibitive, &closed)
            })
            .collect();
        Naive { places, transitions, initial: numbers.places(places, 4) }
    }

    fn firable(&self, t: usize, marking: u32) -> bool {
        let Transition { inputs, outputs, permissive, inhibitive, .. } = &self.transitions[t];
        let (full, empty) = (mask(inputs) | mask(permissive), mask(outputs) | mask(inhibitive));
        self.transitions[t].openable() && marking & full == full && marking & empty == 0
    }

    fn contact(&self, t: usize, marking: u32) -> bool {
        let Transition { inputs, outputs, permissive, inhibitive, .. } = &self.transitions[t];
        let full = mask(inputs) | mask(permissive);
        marking & full == full && marking & mask(inhibitive) == 0 && marking & mask(outputs) & !mask(inputs) != 0
    }

    fn after(&self, t: usize, marking: u32) -> u32 {
        marking & !mask(&self.transitions[t].inputs) | mask(&self.transitions[t].outputs)
    }

    fn successors(&self, marking: u32) -> impl Iterator<Item = u32> + '_ {
        (0..self.transitions.len()).filter(move |&t| self.firable(t, marking)).map(move |t| self.after(t, marking))
    }

    fn closure(&self, seeds: &Set, within: impl Fn(u32) -> bool) -> Set {
        let mut found: Set = seeds.iter().copied().filter(|&marking| within(marking)).collect();
        let mut todo: Vec<u32> = found.iter().copied().collect();
        while let Some(marking) = todo.pop() {
            for next in self.successors(marking) {
                if within(next) && found.insert(next) {
                    todo.push(next);
                }
            }
        }
        found
    }

    /// The net with these transitions alone.
    fn by(&self, some: &[usize]) -> Naive {
        let transitions = some.iter().map(|&t| self.transitions[t].clone()).collect();
        Naive { transitions, initial: self.initial.clone(), ..*self }
    }

    fn endless(&self, within: &Set) -> Set {
        let mut left = within.clone();
        while let Some(&ended) = left.iter().find(|&&m| !self.successors(m).any(|next| left.contains(&next))) {
            left.remove(&ended);
        }
        left
    }

    fn backward(&self, all: &Set, targets: &Set, within: &Set) -> Set {
        let mut found = targets.clone();
        while let Some(&more) = all.iter().find(|&&m| {
            within.contains(&m) && !found.contains(&m) && self.successors(m).any(|next| found.contains(&next))
        }) {
            found.insert(more);
        }
        found
    }
}

struct Both {
    naive: Naive,
    space: Symbolic,
}

fn watched<T>(work: impl FnOnce(&mut Watch<'_>) -> Result<T, Stop>) -> T {
    work(&mut Watch::new(None, &mut unwatched)).expect("a small net needs no budget")
}

impl Both {
    fn drawn(numbers: &mut Numbers) -> Self {
        let naive = Naive::drawn(numbers);
        let mut order: Vec<u32> = (0..naive.places).collect();
        order.sort_by_key(|_| numbers.below(1 << 20));
        let (transitions, initial) = (naive.transitions.clone(), naive.initial.clone());
        let places = naive.places as usize;
        let space = watched(|watch| Symbolic::explore(places, transitions, initial, 1 << 24, Some(vec![order]), watch));
        Both { naive, space }
    }

    fn set(&mut self, markings: &Set) -> Node {
        let mut all = EMPTY;
        for &marking in markings {
            let places: Vec<u32> = (0..self.naive.places).filter(|place| marking >> place & 1 != 0).collect();
            let one = watched(|_| self.space.single(&[all], &places));
            all = watched(|watch| self.space.binary(&[], Binary::Union, all, one, watch));
        }
        all
    }

    fn check(&mut self, set: Node, expected: &Set, what: &str) {
        let node = self.set(expected);
        assert_eq!(node, set, "{what}: {:?} from {:?}", self.naive.transitions, self.naive.initial);
        let count = watched(|watch| self.space.count(set, watch));
        assert_eq!(count.first().copied().unwrap_or(0), expected.len() as u64, "{what}");
    }
}

fn some_of(numbers: &mut Numbers, all: &Set) -> Set {
    let every = 1 + numbers.below(4);
    all.iter().copied().filter(|_| numbers.below(every) == 0).collect()
}

/// How many times as many nets are drawn in a campaign (`make campaign`), else 1.
fn factor() -> u64 {
    std::env::var("FIRABLE_CAMPAIGN").ok().and_then(|text| text.parse().ok()).unwrap_or(1)
}

#[test]
fn every_operation_agrees_with_sets_of_masks() {
    let mut numbers = Numbers(0x1234_5678_9abc_def1);
    for _ in 0..1000 * factor() {
        let mut both = Both::drawn(&mut numbers);
        let start: Set = [mask(&both.naive.initial)].into();
        let reach = both.naive.closure(&start, |_| true);
        let root = both.space.reach;
        both.check(root, &reach, "reach");

        let firable =
            |both: &Both, m: u32| (0..both.naive.transitions.len()).filter(|&t| both.naive.firable(t, m)).count();
        let edges: usize = reach.iter().map(|&m| firable(&both, m)).sum();
        assert_eq!(watched(|watch| both.space.edges(root, watch)).first().copied().unwrap_or(0), edges as u64);

        let alive = reach.iter().copied().filter(|&m| firable(&both, m) > 0).collect();
        let found = watched(|watch| both.space.all(&[], root, Events::Tests, watch));
        both.check(found, &alive, "alive");
        let contact = |t: usize, m: u32| both.naive.contact(t, m);
        let contacts =
            reach.iter().copied().filter(|&m| (0..both.naive.transitions.len()).any(|t| contact(t, m))).collect();
        let found = watched(|watch| both.space.all(&[], root, Events::Contacts, watch));
        both.check(found, &contacts, "contacts");

        let (targets, within) = (some_of(&mut numbers, &reach), some_of(&mut numbers, &reach));
        let (targets_node, within_node) = (both.set(&targets), both.set(&within));
        let before =
            reach.iter().copied().filter(|&m| both.naive.successors(m).any(|next| targets.contains(&next))).collect();
        let found = watched(|watch| both.space.before(&[], targets_node, watch));
        both.check(found, &before, "before");
        let backward = both.naive.backward(&reach, &targets, &reach);
        let found = watched(|watch| both.space.backward(&[], targets_node, root, None, watch));
        both.check(found, &backward, "backward");
        let backward = both.naive.backward(&reach, &targets, &within);
        let found = watched(|watch| both.space.backward(&[], targets_node, within_node, None, watch));
        both.check(found, &backward, "backward within");
        // Some transitions, others, and those again: what was found by the one is not taken for what the others do.
        let halves = [0, 1].map(|odd| (0..both.naive.transitions.len()).filter(|t| t % 2 == odd).collect::<Vec<_>>());
        for by in [&halves[0], &halves[1], &halves[0], &Vec::new()] {
            let backward = both.naive.by(by).backward(&reach, &targets, &within);
            let found = watched(|watch| both.space.backward(&[], targets_node, within_node, Some(by), watch));
            both.check(found, &backward, "backward by some");
        }
        for (set, node) in [(&reach, root), (&within, within_node), (&targets, targets_node)] {
            let endless = both.naive.endless(set);
            for plain in [0, u64::MAX] {
                let found = watched(|watch| both.space.endless_after(plain, &[], node, watch));
                both.check(found, &endless, "endless");
            }
        }
        let forward = both.naive.closure(&targets, |_| true);
        let found = watched(|watch| both.space.closure(&[], targets_node, ANY, By::Forward, watch));
        both.check(found, &forward, "forward");
        let forward = both.naive.closure(&targets, |m| within.contains(&m));
        let found = watched(|watch| both.space.closure(&[], targets_node, within_node, By::Forward, watch));
        both.check(found, &forward, "forward within");

        let half = both.naive.places / 2;
        let all = both.naive.places;
        let mut places = |from: u32, to: u32| (from..to).filter(|_| numbers.below(3) == 0).collect::<Vec<u32>>();
        let tests: Vec<_> = (0..8).map(|t| (places(0, all), places(if t < 4 { half } else { 0 }, all))).collect();
        let passes =
            |(full, empty): &(Vec<u32>, Vec<u32>), m: u32| m & mask(full) == mask(full) && m & mask(empty) == 0;
        for (set, node) in [(&reach, root), (&within, within_node), (&Set::new(), EMPTY)] {
            let counts: Vec<u64> =
                tests.iter().map(|test| set.iter().filter(|&&m| passes(test, m)).count() as u64).collect();
            let found = watched(|watch| both.space.counts(&[], node, &tests, watch));
            assert_eq!(found.iter().map(|count| count.first().copied().unwrap_or(0)).collect::<Vec<_>>(), counts);
        }

        for t in 0..both.naive.transitions.len() {
            let may_fire = reach.iter().copied().filter(|&m| both.naive.firable(t, m)).collect();
            let found = watched(|watch| both.space.firable(&[], root, t, watch));
            both.check(found, &may_fire, "firable");
        }
    }
}

#[test]
fn the_algebra_agrees_with_sets_of_masks_on_every_pair_over_three_places() {
    let naive = Naive { places: 3, transitions: Vec::new(), initial: Vec::new() };
    let space = watched(|watch| Symbolic::explore(3, Vec::new(), Vec::new(), 1 << 24, None, watch));
    let mut both = Both { naive, space };
    let all: Vec<Set> = (0..256_u32).map(|bits| (0..8).filter(|m| bits >> m & 1 != 0).collect()).collect();
    let nodes: Vec<Node> = all.iter().map(|set| both.set(set)).collect();
    for (a, set_a) in all.iter().enumerate() {
        for (b, set_b) in all.iter().enumerate() {
            let expected: [(Binary, Set); 4] = [
                (Binary::Union, set_a | set_b),
                (Binary::Intersection, set_a & set_b),
                (Binary::Difference, set_a - set_b),
                (Binary::Symmetric, set_a ^ set_b),
            ];
            for (binary, set) in expected {
                let found = watched(|watch| both.space.binary(&[], binary, nodes[a], nodes[b], watch));
                let index = all.iter().position(|other| *other == set).expect("every set is listed");
                assert_eq!(found, nodes[index], "{binary:?} {set_a:?} {set_b:?}");
            }
        }
    }
}

fn philosophers(n: u32) -> (usize, Vec<Transition>, Vec<u32>) {
    let place = |i: u32, what: u32| i % n * 5 + what; // thinking, fork, left, right, eating
    let transitions = (0..n).flat_map(|i| {
        let fork = place(i + 1, 1);
        [
            Transition::new(&[place(i, 0), place(i, 1)], &[place(i, 2)], &[], &[], &[]),
            Transition::new(&[place(i, 0), fork], &[place(i, 3)], &[], &[], &[]),
            Transition::new(&[place(i, 2), fork], &[place(i, 4)], &[], &[], &[]),
            Transition::new(&[place(i, 3), place(i, 1)], &[place(i, 4)], &[], &[], &[]),
            Transition::new(&[place(i, 4)], &[place(i, 0), place(i, 1), fork], &[], &[], &[]),
        ]
    });
    (5 * n as usize, transitions.collect(), (0..n).flat_map(|i| [place(i, 0), place(i, 1)]).collect())
}

fn bits(natural: &[u64]) -> usize {
    natural.iter().rposition(|&word| word != 0).map_or(0, |at| 64 * at + 64 - natural[at].leading_zeros() as usize)
}

#[test]
fn a_thousand_philosophers_have_three_to_the_thousand_markings_and_two_deadlocks() {
    let (places, transitions, initial) = philosophers(1000);
    let mut space = watched(|watch| Symbolic::explore(places, transitions, initial, 1 << 28, None, watch));
    let count = watched(|watch| space.count(space.reach, watch));
    let mut power = vec![1_u64];
    for _ in 0..1000 {
        let mut carry = 0;
        for word in &mut power {
            let product = u128::from(*word) * 3 + carry;
            (*word, carry) = (product as u64, product >> 64);
        }
        if carry > 0 {
            power.push(carry as u64);
        }
    }
    assert_eq!(bits(&count), bits(&power));
    assert_eq!(count[..power.len()], power);
    let reach = space.reach;
    let alive = watched(|watch| space.all(&[], reach, Events::Tests, watch));
    let deadlocks = watched(|watch| space.binary(&[], Binary::Difference, reach, alive, watch));
    assert_eq!(watched(|watch| space.count(deadlocks, watch))[0], 2);
}

#[test]
fn tests_are_counted_exactly_in_128_bits_and_beyond() {
    for machines in [1, 60, 127, 128, 200] {
        let turn = |at: u32| [(at, at + 1), (at + 1, at)].map(|(p, q)| Transition::new(&[p], &[q], &[], &[], &[]));
        let transitions = (0..machines).flat_map(|machine| turn(2 * machine)).collect();
        let initial: Vec<u32> = (0..machines).map(|machine| 2 * machine).collect();
        let mut space = watched(|watch| {
            Symbolic::explore(2 * machines as usize, transitions, initial.clone(), 1 << 26, None, watch)
        });
        let reach = space.reach;
        let tests = [
            (vec![], vec![]),
            (vec![0], vec![]),
            (vec![1], vec![2 * machines - 1]),
            (vec![0, 1], vec![]),
            (vec![0], vec![0]),
            (initial.clone(), vec![]),
        ];
        let counts = watched(|watch| space.counts(&[], reach, &tests, watch));
        let powers = [Some(machines), Some(machines - 1), (machines > 1).then(|| machines - 2), None, None, Some(0)];
        for (count, power) in counts.iter().zip(powers) {
            assert_eq!(bits(count), power.map_or(0, |power| power as usize + 1), "{machines}");
            assert_eq!(count.iter().map(|word| word.count_ones()).sum::<u32>(), u32::from(power.is_some()));
        }
    }
}

/// Rings that turn for ever and chains that come to an end, side by side; some steps are gated by a place elsewhere.
fn rings_and_chains(numbers: &mut Numbers) -> Naive {
    let (mut places, mut transitions, mut initial) = (0, Vec::new(), Vec::new());
    for _ in 0..3 {
        let (length, ring) = (2 + numbers.below(4) as u32, numbers.below(2) == 0);
        for k in 0..if ring { length } else { length - 1 } {
            let gate: Vec<u32> = if places > 0 && numbers.below(4) == 0 {
                vec![numbers.below(u64::from(places)) as u32]
            } else {
                vec![]
            };
            let (permissive, inhibitive) = if numbers.below(2) == 0 { (gate, vec![]) } else { (vec![], gate) };
            let (from, to) = (places + k, places + (k + 1) % length);
            transitions.push(Transition::new(&[from], &[to], &permissive, &inhibitive, &[]));
        }
        initial.push(places);
        places += length;
    }
    Naive { places, transitions, initial }
}

#[test]
fn runs_that_go_on_for_ever_are_told_from_those_that_a_set_or_a_chain_ends() {
    let mut numbers = Numbers(0x0fed_cba9_8765_4321);
    for _ in 0..700 * factor() {
        let naive = rings_and_chains(&mut numbers);
        let (places, transitions, initial) = (naive.places as usize, naive.transitions.clone(), naive.initial.clone());
        let space = watched(|watch| Symbolic::explore(places, transitions, initial, 1 << 24, None, watch));
        let mut both = Both { naive, space };
        let mut set = both.naive.closure(&[mask(&both.naive.initial)].into(), |_| true);
        // Without the markings in which two places, now and then one, are full together.
        for _ in 0..numbers.below(5) {
            let both_full = mask(&[0, 1].map(|_| numbers.below(places as u64) as u32));
            set.retain(|&marking| marking & both_full != both_full);
        }
        let node = both.set(&set);
        let endless = both.naive.endless(&set);
        for plain in [0, 30, u64::MAX] {
            let found = watched(|watch| both.space.endless_after(plain, &[], node, watch));
            both.check(found, &endless, "endless");
        }
    }
}

/// A net that is made of processes, which do things in turn, side by side, as chosen, and over again.
struct Processes {
    naive: Naive,
    most: u32,
}

impl Processes {
    fn drawn(numbers: &mut Numbers) -> Naive {
        let mut drawn = Processes { naive: Naive { places: 0, transitions: Vec::new(), initial: Vec::new() }, most: 0 };
        for _ in 0..1 + numbers.below(2) {
            let [from, to] = [drawn.place(), drawn.place()];
            drawn.naive.initial.push(from);
            drawn.most = drawn.naive.places + 5;
            drawn.block(numbers, from, to);
            if numbers.below(2) == 0 {
                drawn.block(numbers, to, from);
            }
        }
        let places = u64::from(drawn.naive.places);
        for _ in 0..numbers.below(3) {
            let (t, place) =
                (numbers.below(drawn.naive.transitions.len() as u64) as usize, numbers.below(places) as u32);
            let changed = &mut drawn.naive.transitions[t];
            // A gate; or an arc, by which tokens may meet where they should not, or be lost, or nothing can fire.
            match numbers.below(10) {
                0..3 => changed.permissive = vec![place],
                3..6 => changed.inhibitive = vec![place],
                6 | 7 if !changed.inputs.contains(&place) => changed.inputs.push(place),
                8 if !changed.outputs.contains(&place) => changed.outputs.push(place),
                _ => changed.literals = vec![(0, false), (0, true)],
            }
            changed.inputs.sort_unstable();
            changed.outputs.sort_unstable();
        }
        if numbers.below(8) == 0 {
            drawn.naive.initial.push(numbers.below(places) as u32);
        }
        drawn.naive
    }

    fn place(&mut self) -> u32 {
        self.naive.places += 1;
        self.naive.places - 1
    }

    fn arc(&mut self, from: &[u32], to: &[u32]) {
        self.naive.transitions.push(Transition::new(from, to, &[], &[], &[]));
    }

    fn block(&mut self, numbers: &mut Numbers, from: u32, to: u32) {
        let kind = if self.naive.places < self.most { numbers.below(6) } else { 0 };
        match kind {
            1 | 2 => {
                let between = self.place();
                self.block(numbers, from, between);
                self.block(numbers, between, to);
            }
            3 => [0, 1].into_iter().for_each(|_| self.block(numbers, from, to)),
            4 => {
                let ends = [0, 1].map(|_| [self.place(), self.place()]);
                self.arc(&[from], &[ends[0][0], ends[1][0]]);
                ends.iter().for_each(|&[from, to]| self.block(numbers, from, to));
                self.arc(&[ends[0][1], ends[1][1]], &[to]);
            }
            5 => {
                self.block(numbers, from, to);
                self.arc(&[to], &[from]);
            }
            _ => self.arc(&[from], &[to]),
        }
    }
}

#[test]
fn places_that_were_merged_for_the_search_are_told_apart_in_what_it_finds() {
    let mut numbers = Numbers(0x9e37_79b9_7f4a_7c15);
    let mut merged = 0;
    for _ in 0..1000 * factor() {
        let naive = Processes::drawn(&mut numbers);
        let (places, transitions, initial) = (naive.places as usize, &naive.transitions, &naive.initial);
        let space = watched(|watch| Symbolic::explore_merged(places, transitions, initial, 1 << 24, watch));
        let Some(space) = space else { continue };
        merged += 1;
        let mut both = Both { naive, space };
        let start: Set = [mask(&both.naive.initial)].into();
        let reach = both.naive.closure(&start, |_| true);
        let root = both.space.reach;
        both.check(root, &reach, "reach");
        assert_eq!(both.set(&start), both.space.start);
        let alive = reach
            .iter()
            .copied()
            .filter(|&m| (0..both.naive.transitions.len()).any(|t| both.naive.firable(t, m)))
            .collect();
        let found = watched(|watch| both.space.all(&[], root, Events::Tests, watch));
        both.check(found, &alive, "alive");
        let targets = some_of(&mut numbers, &reach);
        let backward = both.naive.backward(&reach, &targets, &reach);
        let node = both.set(&targets);
        let found = watched(|watch| both.space.backward(&[], node, root, None, watch));
        both.check(found, &backward, "backward");
    }
    assert!(merged > 375 * factor(), "{merged}");
}

/// A lock that goes on by the right one of two moves at each of so many stages, and begins anew by the wrong one. It opens
/// onto a place that is marked. Beside it a token goes through rooms that are one place for the search.
fn lock(stages: u32) -> (usize, Vec<Transition>, Vec<u32>) {
    let (full, never, rooms) = (stages + 1, stages + 2, stages + 3);
    let kept = |from: u32, to: u32| Transition::new(&[from], &[to], &[], &[never], &[]);
    let right = (0..stages).map(|at| kept(at, at + 1));
    let wrong = (1..stages).map(|at| kept(at, 0));
    let room = (rooms..rooms + 3).map(|at| Transition::new(&[at], &[at + 1], &[], &[], &[]));
    let open = kept(stages, full);
    ((rooms + 4) as usize, right.chain(wrong).chain(room).chain([open]).collect(), vec![0, full, rooms])
}

#[test]
fn a_smaller_net_with_contact_stands_for_nothing_however_deep_the_contact_is() {
    for stages in [1, 40] {
        let (places, transitions, initial) = lock(stages);
        let found = |marked: &[u32]| {
            watched(|watch| Symbolic::explore_merged(places, &transitions, marked, 1 << 24, watch)).is_some()
        };
        assert!(!found(&initial));
        assert!(found(&[initial[0], initial[2]]));
    }
}

#[test]
fn contact_that_any_run_meets_is_seen_before_the_diagram_needs_its_memory() {
    let (places, transitions, initial) = lock(1);
    let found = watched(|watch| Symbolic::explore_merged(places, &transitions, &initial, 1, watch));
    assert!(found.is_none());
}

/// Counters that come to their end after as many steps as they have places, and beside them a ring that never does.
fn counters_and_ring(counters: u32, length: u32) -> (usize, Vec<Transition>, Vec<u32>) {
    let arc = |from: u32, to: u32| Transition::new(&[from], &[to], &[], &[], &[]);
    let first = |counter: u32| 2 + counter * length;
    let steps = (0..counters).flat_map(|i| (1..length).map(move |k| (first(i) + k - 1, first(i) + k)));
    let transitions = [(0, 1), (1, 0)].into_iter().chain(steps).map(|(from, to)| arc(from, to)).collect();
    let initial = (0..counters).map(first).chain([0]).collect();
    (2 + (counters * length) as usize, transitions, initial)
}

#[test]
fn what_goes_on_for_ever_beside_long_ways_to_an_end_is_found_without_a_round_for_each_of_their_steps() {
    let (places, transitions, initial) = counters_and_ring(40, 50);
    let mut space = watched(|watch| Symbolic::explore(places, transitions, initial, 1 << 28, None, watch));
    let reach = space.reach;
    assert_eq!(watched(|watch| space.endless(&[], reach, watch)), reach);
    // Where the ring stands still every run ends, after 40 times 49 steps at most: as many rounds of sets that are large.
    let still = watched(|watch| space.having(&[], reach, &[0], &[], watch));
    let begun = space.diagram().cache.work;
    assert_eq!(watched(|watch| space.endless(&[], still, watch)), EMPTY);
    assert!(space.diagram().cache.work - begun < 200_000);
}

#[test]
fn a_budget_that_is_too_small_is_an_answer() {
    for bytes in [0, 1 << 10, 1 << 14, 1 << 17] {
        let (places, transitions, initial) = philosophers(200);
        let mut poll = unwatched;
        let watch = &mut Watch::new(None, &mut poll);
        let stopped = Symbolic::explore(places, transitions, initial, bytes, None, watch);
        assert_eq!(stopped.err(), Some(Stop::Memory));
    }
}
