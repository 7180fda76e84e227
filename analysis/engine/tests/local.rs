//! Local CTL against sets of markings, on nets small enough to hold all their markings in a list.

use std::collections::BTreeSet;
use std::time::Duration;

use firable_engine::budget::{Stop, unwatched};
use firable_engine::local::formula::{Formula, NESTING_MAX, Node};
use firable_engine::local::search::{Limits, Outcome, evaluate};
use firable_engine::net::{Net, Transition};
use firable_engine::stubborn::dependencies::literal;
use firable_engine::stubborn::formula::{Formula as State, Node as StateNode};
use firable_engine::stubborn::search::Prepared;

const LIMITS: Limits = Limits { markings: 1 << 20, memory_bytes: 1 << 24, time: None, first: 256 };

/// Numbers that look random and are the same in every run (Marsaglia's xorshift).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, bound: u32) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 11) % u64::from(bound)) as u32
    }

    fn place(&mut self, places: u32, one_in: u32) -> Vec<u32> {
        if self.below(one_in) == 0 { vec![self.below(places)] } else { Vec::new() }
    }
}

fn drawn(numbers: &mut Numbers) -> (u32, Vec<Transition>, Vec<u32>) {
    let places = 2 + numbers.below(5);
    let transitions = (0..1 + numbers.below(8))
        .map(|_| {
            let (from, to) = (vec![numbers.below(places)], vec![numbers.below(places)]);
            let (permissive, inhibitive) = (numbers.place(places, 4), numbers.place(places, 4));
            Transition::new(&from, &to, &permissive, &inhibitive, &[])
        })
        .collect();
    let initial = (0..places).filter(|_| numbers.below(2) == 0).collect();
    (places, transitions, initial)
}

/// Nodes over the labels "place is full", of which the last is the whole.
fn nodes(numbers: &mut Numbers, places: u32) -> Vec<Node> {
    let mut nodes: Vec<Node> = (0..places).map(Node::Label).collect();
    for _ in 0..8 {
        let count = nodes.len() as u32;
        let (a, b) = (numbers.below(count), numbers.below(count));
        nodes.push(match numbers.below(6) {
            0 => Node::Not(a),
            1 => Node::All(vec![a, b]),
            2 => Node::Any(vec![a, b]),
            3 => Node::Next(a),
            4 => Node::SomeUntil(a, b),
            _ => Node::EachUntil(a, b),
        });
    }
    nodes
}

fn formula(nodes: Vec<Node>, places: u32) -> Formula {
    let full =
        |place| State::new(vec![StateNode::Literal(literal(place, true))], places as usize).expect("well formed");
    Formula::new(nodes, (0..places).map(full).collect()).expect("well formed")
}

fn mask(places: &[u32]) -> u32 {
    places.iter().fold(0, |mask, place| mask | 1 << place)
}

fn next(transitions: &[Transition], marking: u32) -> Vec<u32> {
    let fires = |t: &&Transition| {
        let full = mask(&t.inputs) | mask(&t.permissive);
        let empty = mask(&t.outputs) | mask(&t.inhibitive);
        marking & full == full && marking & empty == 0
    };
    transitions.iter().filter(fires).map(|t| marking & !mask(&t.inputs) | mask(&t.outputs)).collect()
}

/// The markings in which each node holds, by unfolding, and whether M0 is in the last.
fn by_definition(nodes: &[Node], transitions: &[Transition], initial: u32) -> bool {
    let (mut all, mut todo) = (BTreeSet::from([initial]), vec![initial]);
    while let Some(marking) = todo.pop() {
        todo.extend(next(transitions, marking).into_iter().filter(|&after| all.insert(after)));
    }
    let mut holds: Vec<BTreeSet<u32>> = Vec::new();
    for node in nodes {
        let of = |node: &u32| &holds[*node as usize];
        let least = |left: &u32, right: &u32, every: bool| {
            let mut found = of(right).clone();
            loop {
                let more: Vec<u32> = { of(left).iter().copied() }
                    .filter(|&marking| {
                        let after = next(transitions, marking);
                        !after.is_empty()
                            && if every {
                                after.iter().all(|after| found.contains(after))
                            } else {
                                after.iter().any(|after| found.contains(after))
                            }
                    })
                    .filter(|marking| !found.contains(marking))
                    .collect();
                if more.is_empty() {
                    return found;
                }
                found.extend(more);
            }
        };
        let inside = |test: &dyn Fn(u32) -> bool| all.iter().copied().filter(|&marking| test(marking)).collect();
        holds.push(match node {
            Node::Label(place) => inside(&|marking| marking >> place & 1 == 1),
            Node::Not(one) => inside(&|marking| !of(one).contains(&marking)),
            Node::All(operands) => inside(&|marking| operands.iter().all(|one| of(one).contains(&marking))),
            Node::Any(operands) => inside(&|marking| operands.iter().any(|one| of(one).contains(&marking))),
            Node::Next(one) => {
                inside(&|marking| next(transitions, marking).iter().any(|after| of(one).contains(after)))
            }
            Node::SomeUntil(left, right) => least(left, right, false),
            Node::EachUntil(left, right) => least(left, right, true),
        });
    }
    holds[nodes.len() - 1].contains(&initial)
}

fn outcome(net: Net, nodes: Vec<Node>, limits: Limits) -> Outcome {
    let places = net.places as u32;
    evaluate(&Prepared::new(net), &mut formula(nodes, places), limits, &mut unwatched)
}

#[test]
fn every_value_is_that_of_its_definition_however_little_a_search_may_meet() {
    let mut numbers = Numbers(7);
    let mut held = 0;
    for _ in 0..1_500 {
        let (places, transitions, initial) = drawn(&mut numbers);
        let nodes = nodes(&mut numbers, places);
        let expected = by_definition(&nodes, &transitions, mask(&initial));
        for first in [1, 2, 256] {
            let net = Net::new(places as usize, transitions.clone(), &initial).expect("well formed");
            let found = outcome(net, nodes.clone(), Limits { first, ..LIMITS });
            assert_eq!((found.holds, found.stop), (Some(expected), None), "{transitions:?} {initial:?} {nodes:?}");
        }
        held += u32::from(expected);
    }
    assert!((300..1_200).contains(&held)); // neither value is that of nearly all
}

/// Machines with two places each, side by side: 2^20 markings.
fn machines() -> Net {
    let moves = |from: u32, to: u32| Transition::new(&[from], &[to], &[], &[], &[]);
    let transitions = (0..20).flat_map(|at| [moves(2 * at, 2 * at + 1), moves(2 * at + 1, 2 * at)]).collect();
    Net::new(40, transitions, &(0..20).map(|at| 2 * at).collect::<Vec<u32>>()).expect("well formed")
}

#[test]
fn a_budget_of_markings_memory_or_time_is_a_stop_and_says_nothing() {
    // Each marking leads back to one with place 0 full: for that all of them have to be met.
    let always = vec![Node::Label(0), Node::All(vec![]), Node::SomeUntil(1, 0), Node::Not(2), Node::SomeUntil(1, 3)];
    for (limits, stop) in [
        (Limits { markings: 100, ..LIMITS }, Stop::Markings),
        (Limits { memory_bytes: 1 << 16, ..LIMITS }, Stop::Memory),
        (Limits { time: Some(Duration::ZERO), ..LIMITS }, Stop::Time),
    ] {
        let found = outcome(machines(), always.clone(), limits);
        assert_eq!((found.holds, found.stop), (None, Some(stop)));
    }
}

#[test]
fn a_way_to_a_marking_is_found_among_very_many() {
    let mut all: Vec<StateNode> = (0..20).map(|at| StateNode::Literal(literal(2 * at + 1, true))).collect();
    all.push(StateNode::All((0..20).collect()));
    let labels = vec![State::new(all, 40).expect("well formed")];
    let nodes = vec![Node::Label(0), Node::All(vec![]), Node::SomeUntil(1, 0)];
    let mut sought = Formula::new(nodes, labels).expect("well formed");
    let found = evaluate(&Prepared::new(machines()), &mut sought, LIMITS, &mut unwatched);
    assert!(found.markings < 1_000);
    assert_eq!(found.holds, Some(true));
}

#[test]
fn operands_come_first_labels_exist_and_nesting_is_bounded() {
    assert!(Formula::new(vec![], vec![]).is_err());
    assert!(Formula::new(vec![Node::Label(0)], vec![]).is_err());
    assert!(Formula::new(vec![Node::All(vec![]), Node::Not(1)], vec![]).is_err());
    let deep = |levels: usize| {
        let mut nodes = vec![Node::All(vec![])];
        nodes.extend((0..levels as u32 - 1).map(Node::Not));
        Formula::new(nodes, vec![])
    };
    assert!(deep(NESTING_MAX).is_ok() && deep(NESTING_MAX + 1).is_err());
}
