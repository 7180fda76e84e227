//! How many markings of one set pass each of many tests, exactly, without making the sets.
//!
//! A marking is a path of the diagram. So as many markings go by a node as paths lead to it, times the markings below it.
//! The latter are counted once; the former are carried down from the set, once for all tests to the level at which each
//! begins. So a test costs the nodes between its highest place and its lowest one, which are few where the order keeps
//! them together.
//!
//! All this in 128 bits. Of a set with more markings each test is summed up from the top (`count`).

use std::cmp::Reverse;
use std::collections::{BTreeMap, HashMap};

use super::algebra::Diagram;
use super::count::{self, Natural};
use super::events::{DONE, Mixed, Suffix, Suffixes};
use super::zdd::{EMPTY, Node, Store, TERMINAL, UNIT};
use crate::budget::{Stop, Watch};

/// Nodes in descending order of level, and how many paths lead to each.
#[derive(Clone, Default)]
struct Ways(BTreeMap<(Reverse<u32>, Node), u128>);

impl Ways {
    fn lead(&mut self, store: &Store, node: Node, paths: u128) {
        if node != EMPTY {
            *self.0.entry((Reverse(store.level(node)), node)).or_default() += paths;
        }
    }

    /// The highest node, if it is above a level, is taken out for those below it.
    fn open(&mut self, store: &Store, level: u32) -> Option<Node> {
        let first = self.0.first_entry().filter(|first| first.key().0.0 > level)?;
        let ((_, node), paths) = first.remove_entry();
        self.lead(store, store.lo(node), paths);
        self.lead(store, store.hi(node), paths);
        Some(node)
    }

    fn descend(&mut self, store: &Store, level: u32, watch: &mut Watch<'_>) -> Result<(), Stop> {
        while self.open(store, level).is_some() {
            watch.tick(1)?;
        }
        Ok(())
    }
}

/// For each test, how many markings of a set pass it.
pub(super) fn passing(
    diagram: &Diagram,
    suffixes: &Suffixes,
    tests: &[Suffix],
    set: Node,
    watch: &mut Watch<'_>,
) -> Result<Vec<Natural>, Stop> {
    let store = &diagram.store;
    let Some(below) = below(store, set, watch)? else {
        return count::firable(diagram, suffixes, tests, set, watch);
    };
    let mut counts = vec![Natural::new(); tests.len()];
    let mut begun = Ways::default();
    begun.lead(store, set, 1);
    let mut order: Vec<usize> = (0..tests.len()).collect();
    order.sort_by_key(|&at| Reverse(suffixes.get(tests[at]).level));
    for at in order {
        let mut rest = tests[at];
        begun.descend(store, suffixes.get(rest).level, watch)?;
        let mut ways = begun.clone();
        while rest != DONE {
            let literal = suffixes.get(rest);
            ways.descend(store, literal.level, watch)?;
            for ((_, node), paths) in std::mem::take(&mut ways).0 {
                let (without, with) = store.split(node, literal.level);
                ways.lead(store, if literal.kind.wants() { with } else { without }, paths);
            }
            rest = literal.next;
        }
        let count: u128 = ways.0.iter().map(|((_, node), paths)| paths * below[node]).sum();
        counts[at] = vec![count as u64, (count >> 64) as u64];
    }
    Ok(counts)
}

/// How many markings are below each node of a set; None where 128 bits do not hold them.
fn below(store: &Store, set: Node, watch: &mut Watch<'_>) -> Result<Option<HashMap<Node, u128, Mixed>>, Stop> {
    let mut nodes = Vec::new();
    let mut ways = Ways::default();
    ways.lead(store, set, 0);
    while let Some(node) = ways.open(store, TERMINAL) {
        watch.tick(1)?;
        nodes.push(node);
    }
    let bytes = nodes.len() * size_of::<(Node, u128)>() * 2;
    store.memory.claim(bytes)?; // looked at once: nothing else grows meanwhile
    store.memory.release(bytes);
    let mut below = HashMap::with_capacity_and_hasher(nodes.len() + 2, Mixed::default());
    below.extend([(EMPTY, 0_u128), (UNIT, 1)]);
    for node in nodes.into_iter().rev() {
        let Some(sum) = below[&store.lo(node)].checked_add(below[&store.hi(node)]) else { return Ok(None) };
        below.insert(node, sum);
    }
    Ok(Some(below))
}
