//! The marking of a set that holds most tokens on some places: a longest way through the diagram.
//!
//! Each node is worth the better of its children, the one with a token more by what its place counts. So an upper bound
//! takes one pass over the nodes, whatever the number of markings, where each step of a halving would have to make a
//! diagram of those with at least so many tokens. What lies below the lowest place that counts is not looked at.

use super::algebra::Diagram;
use super::zdd::{EMPTY, Node, TERMINAL};
use crate::budget::{Stop, Watch};

const UNKNOWN: u64 = u64::MAX;

/// The levels of a marking of a set with the greatest sum of weights, ascending; None of the empty set.
///
/// `weights` are those of the levels, which the marking sums up where they hold a token.
pub(super) fn greatest(
    diagram: &Diagram,
    set: Node,
    weights: &[u64],
    watch: &mut Watch<'_>,
) -> Result<Option<Vec<u32>>, Stop> {
    let store = &diagram.store;
    let Some(lowest) = weights.iter().position(|&weight| weight > 0) else {
        return Ok(diagram.any(set));
    };
    if set == EMPTY {
        return Ok(None);
    }
    let mut worth = store.memory.filled(UNKNOWN, store.len())?;
    let bytes = size_of_val(worth.as_slice());
    let levels = fullest(diagram, set, (weights, lowest), &mut worth, watch);
    store.memory.release(bytes);
    levels.map(Some)
}

/// The same of a set that is not empty, `lowest` being the lowest level that counts, with what each node is worth.
fn fullest(
    diagram: &Diagram,
    set: Node,
    (weights, lowest): (&[u64], usize),
    worth: &mut [u64],
    watch: &mut Watch<'_>,
) -> Result<Vec<u32>, Stop> {
    let store = &diagram.store;
    // What is worth nothing: the empty set, as there is always another one beside it, and all below what counts.
    let known = |worth: &[u64], node: Node| {
        let level = store.level(node);
        let counts = level != TERMINAL && level as usize >= lowest;
        if counts { worth[node as usize] } else { 0 }
    };
    let mut todo = vec![set];
    while let Some(&node) = todo.last() {
        if known(worth, node) != UNKNOWN {
            todo.pop();
            continue;
        }
        watch.tick(1)?;
        let (lo, hi) = (store.lo(node), store.hi(node));
        let before = todo.len();
        todo.extend([lo, hi].into_iter().filter(|&child| known(worth, child) == UNKNOWN));
        if todo.len() == before {
            let more = known(worth, hi) + weights[store.level(node) as usize];
            worth[node as usize] = more.max(known(worth, lo));
            todo.pop();
        }
    }
    let (mut node, mut levels) = (set, Vec::new());
    while store.level(node) != TERMINAL {
        let (level, lo) = (store.level(node), store.lo(node));
        let more = known(worth, store.hi(node)) + weights[level as usize];
        if lo == EMPTY || known(worth, lo) < more {
            levels.push(level);
            node = store.hi(node);
        } else {
            node = lo;
        }
    }
    levels.reverse();
    Ok(levels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::marking::holds;
    use crate::random::Random;
    use crate::samples::{explore, machines, random_nets};
    use crate::symbolic::space::Symbolic;

    #[test]
    fn no_marking_of_a_set_holds_more_and_the_one_that_is_named_is_in_it() {
        let (mut random, mut open) = (Random::new(1), 0);
        for net in random_nets(300) {
            let (places, transitions) = (net.places, net.transitions.clone());
            let initial: Vec<u32> = (0..places as u32).filter(|&place| holds(&net.initial, place)).collect();
            let graph = explore(net, false);
            let mut poll = unwatched;
            let watch = &mut Watch::new(None, &mut poll);
            let order = (0..places as u32).rev().collect();
            let space = Symbolic::explore(places, transitions, initial, 1 << 28, Some(vec![order]), watch);
            let space = space.expect("enough room");
            let used = space.store().memory.used();
            for count in [0, 1, 2, 4, places, 3 * places] {
                let on: Vec<u32> = (0..count).map(|_| random.below(places) as u32).collect();
                let tokens = |marking: &[u64]| on.iter().filter(|&&place| holds(marking, place)).count();
                let wanted = (0..graph.len()).map(|at| tokens(graph.marking(at))).max().expect("M0");
                let found = space.greatest(space.reach, &on, watch).expect("enough room").expect("M0");
                assert!(space.contains(space.reach, &found) && found.is_sorted());
                assert_eq!(on.iter().filter(|place| found.contains(place)).count(), wanted);
                open += usize::from(wanted > tokens(graph.marking(0)));
            }
            assert_eq!(space.greatest(EMPTY, &[0], watch), Ok(None));
            assert_eq!(space.store().memory.used(), used);
        }
        assert!(open > 300, "{open}");
    }

    #[test]
    fn who_wants_to_end_it_is_heard_and_what_it_took_is_given_back() {
        let (net, order) = (machines(4000, 0), (0..8000).collect());
        let initial: Vec<u32> = (0..8000).step_by(2).collect();
        let mut poll = unwatched;
        let watch = &mut Watch::new(None, &mut poll);
        let space = Symbolic::explore(8000, net.transitions, initial, 1 << 28, Some(vec![order]), watch);
        let space = space.expect("enough room");
        let mut poll = |_| Err(Stop::Cancelled);
        let lowest = space.place_at()[1];
        let found = space.greatest(space.reach, &[lowest], &mut Watch::often(None, &mut poll));
        assert_eq!(found, Err(Stop::Cancelled));
        let used = space.store().memory.used();
        let mut poll = unwatched;
        let found = space.greatest(space.reach, &[1, 1, 3], &mut Watch::new(None, &mut poll)).expect("enough room");
        assert!(found.is_some_and(|full| full.contains(&1) && full.contains(&3)));
        assert_eq!(space.store().memory.used(), used);
    }
}
