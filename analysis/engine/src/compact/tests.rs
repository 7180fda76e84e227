//! The compact search against exploration.

use super::*;
use crate::budget::unwatched;
use crate::explore::{Limits, Space};
use crate::marking::holds;
use crate::samples::{machines, random_nets};
use crate::stubborn::dependencies::literal;
use crate::stubborn::formula::Node;
use crate::table::NONE;

fn explored(net: &Net) -> Space {
    let limits = Limits { step: false, markings: 1 << 20, memory_bytes: 1 << 28, time: None };
    Space::explore(net.clone(), limits, &mut unwatched).expect("fits")
}

/// Plays a way from M0.
fn played(net: &Net, way: &[u32]) -> Vec<u64> {
    way.iter().fold(net.initial.clone(), |marking, &t| {
        assert!(net.forward.test_one(t as usize, |p| holds(&marking, p)), "a way fires what is firable");
        let flip = net.flip(t as usize, net.words);
        marking.iter().zip(flip).map(|(word, flip)| word ^ flip).collect()
    })
}

fn way(compact: &mut Compact, hit: &Hit) -> Vec<u32> {
    let mut poll = unwatched;
    compact.way_to(hit, &mut Watch::new(None, &mut poll)).expect("in time")
}

/// Two places full, which is a goal.
fn both(places: usize, p: u32, q: u32) -> Formula {
    let nodes = vec![Node::Literal(literal(p, true)), Node::Literal(literal(q, true)), Node::All(vec![0, 1])];
    Formula::new(nodes, places).expect("well formed")
}

fn agrees(net: &Net, memory_bytes: usize) {
    let space = explored(net);
    let places = net.places as u32;
    let pairs: Vec<(u32, u32)> = (1..places).map(|p| (p, p / 2)).take(40).collect();
    let goals = pairs.iter().map(|&(p, q)| both(net.places, p, q)).collect();
    let mut compact = Compact::new(net.clone(), goals, memory_bytes).expect("few places");
    let outcome = compact.search(true, None, &mut unwatched);
    assert_eq!(outcome.stop, None);
    assert_eq!((outcome.found.markings, outcome.found.edges), (space.len() as u64, space.edges));
    assert_eq!((&outcome.fired, &outcome.contacts), (&space.fired, &space.contacts));
    assert_eq!((outcome.deadlocks, outcome.levels), (space.deadlocks.len() as u64, space.levels.len()));
    let level = |index: u32| space.levels.partition_point(|&first| first <= index) - 1;
    let first = space.deadlocks.first().map(|&index| level(index));
    assert_eq!(outcome.deadlock.map(|hit| hit.level), first);
    let nearest = space.contact_witness.iter().copied().min().filter(|&index| index != NONE);
    assert_eq!(outcome.contact.map(|hit| hit.level), nearest.map(level));
    for (hit, &(p, q)) in outcome.goals.iter().zip(&pairs) {
        let there = (0..space.len()).find(|&at| [p, q].iter().all(|&place| holds(space.marking(at), place)));
        assert_eq!(hit.map(|hit| hit.level), there.map(|at| level(at as u32)));
        if let Some(hit) = hit {
            let way = way(&mut compact, hit);
            let end = played(net, &way);
            assert!(way.len() == hit.level && holds(&end, p) && holds(&end, q));
        }
    }
}

#[test]
fn a_compact_search_counts_what_exploration_counts() {
    for net in random_nets(200) {
        agrees(&net, 1 << 22);
    }
    for pad in [0, 60, 200] {
        agrees(&machines(10, pad), 1 << 20);
    }
}

#[test]
fn a_way_too_long_to_be_kept_is_halved() {
    let net = machines(14, 0);
    let all: Vec<Node> = (0..14).map(|i| Node::Literal(literal(2 * i + 1, true))).collect();
    let nodes = [all, vec![Node::All((0..14).collect())]].concat();
    let goal = Formula::new(nodes, net.places).expect("well formed");
    // A sixty-fourth of the memory is kept as keys: fewer than the levels before the last one have.
    let mut compact = Compact::new(net.clone(), vec![goal], 300_000).expect("few places");
    let outcome = compact.search(false, None, &mut unwatched);
    assert!(outcome.met);
    let hit = outcome.goals[0].expect("all are busy once");
    let way = way(&mut compact, &hit);
    assert_eq!((way.len(), hit.level), (14, 14));
    assert!((0..14).all(|i| holds(&played(&net, &way), 2 * i + 1)));
}

#[test]
fn an_end_of_memory_or_of_patience_is_no_answer() {
    let net = machines(16, 0);
    let mut small = Compact::new(net.clone(), Vec::new(), 100_000).expect("few places");
    assert_eq!(small.search(true, None, &mut unwatched).stop, Some(Stop::Memory));
    let mut large = Compact::new(net.clone(), Vec::new(), 1 << 24).expect("few places");
    assert_eq!(large.search(true, None, &mut |_| Err(Stop::Cancelled)).stop, Some(Stop::Cancelled));
    assert_eq!(large.search(true, Some(Duration::ZERO), &mut unwatched).stop, Some(Stop::Time));
}

#[test]
fn levels_that_are_kept_are_counted_as_memory() {
    let net = machines(10, 0);
    let from = Span::new(&net).expect("few places").key(&net.initial);
    let mut compact = Compact::new(net, Vec::new(), 1 << 26).expect("few places");
    let mut bytes = |keep| {
        let plan = Plan { from, all: true, target: None, mark: None, keep };
        let mut poll = unwatched;
        let swept = compact.sweep(plan, &mut Watch::new(None, &mut poll));
        assert_eq!(swept.outcome.found.markings, 1024);
        (swept.outcome.bytes, swept.levels.iter().map(Vec::len).sum::<usize>())
    };
    let ((few, none), (many, all)) = (bytes(0), bytes(usize::MAX));
    assert_eq!((none, all, many - few), (0, 1024, 8 * 1024));
}

#[test]
fn a_way_is_found_in_the_memory_of_its_search_where_levels_do_not_fit_beside_it() {
    let net = machines(12, 0);
    let from = Span::new(&net).expect("few places").key(&net.initial);
    // All machines are busy: as far as can be.
    let mut nodes: Vec<Node> = (0..12).map(|i| Node::Literal(literal(2 * i + 1, true))).collect();
    nodes.push(Node::All((0..12).collect()));
    let busy = Formula::new(nodes, net.places).expect("well formed");
    let mut too_much = 0;
    for memory_bytes in (40_000..140_000).step_by(5_000) {
        let mut compact = Compact::new(net.clone(), vec![busy.clone()], memory_bytes).expect("few places");
        let Some(hit) = compact.search(false, None, &mut unwatched).goals[0] else { continue };
        let mut fits = |keep| {
            let plan = Plan { from, all: false, target: Some(hit.key), mark: Some(hit.level / 2), keep };
            let mut poll = unwatched;
            compact.sweep(plan, &mut Watch::new(None, &mut poll)).target.is_some()
        };
        if fits(1) {
            too_much += usize::from(!fits(memory_bytes / 64));
            assert_eq!(way(&mut compact, &hit).len(), hit.level);
        }
    }
    assert!(too_much > 0);
}
