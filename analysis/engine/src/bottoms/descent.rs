//! Reversibility by firings that go down in an order of markings, without a look at any table.
//!
//! With an order in which each transition always goes down or always up (`ranking.rs`), every marking from which one
//! goes down reaches a lower one, and in the end a *stuck* one, which has none. Which markings are stuck is read off the
//! bit slices of all markings, 64 at a time: nothing is looked up. They are few, and each of them goes up once and from
//! there down again, 64 walks at a time in the slices. If that ends at another stuck marking, it reaches this one; so they
//! are joined, as trees are in `bottoms.rs`. Of the one or two that are left, a way to M0 is sought from both ends
//! (`meeting.rs`). If all of them come to reach M0 in this way, everything does.
//!
//! A bottom component has a lowest marking, which is stuck, and what that is joined to is in the component too. So if
//! nothing is left but M0 and deadlocks, the deadlocks are the bottom components. Where another one is left, the question
//! goes to who looks edges up.
//!
//! Rejected: to number the lower markings lower, as they were found (each marking then asks the table for an edge or
//! two, which took up to one and a half times the exploration, and the table must first be given indexes).

use std::collections::HashMap;

use super::{Bottoms, meeting, ranking, top};
use crate::batch::Batch;
use crate::budget::{Memory, Stop, Watch};
use crate::explore::Space;
use crate::marking::{Width, members, unslice};
use crate::net::Net;

/// Where more than one of so many markings is stuck, going down is not the way.
const STUCK_PART: usize = 4;
/// All walks together may take a pass over the transitions for so many markings of the graph.
const PASS_PART: usize = 8;
const PASSES_LEAST: usize = 64;
/// Steps of work that an order may take to choose, even where there are fewer markings.
const RANKING_LEAST: usize = 1 << 13;
/// Bytes held for a stuck marking: its numbers, and its place in the table of them.
const STUCK_BYTES: usize = 64;

/// The transitions of a net that go down, and up.
struct Firings<'a> {
    net: &'a Net,
    downs: Vec<u32>,
    ups: Vec<u32>,
    /// Passes over those that go down that walks may still take.
    passes: usize,
}

impl Firings<'_> {
    /// Lets some of the sliced markings go down until they are stuck; false where that takes too long.
    fn descend(&mut self, slices: &mut [u64], mut pending: u64, watch: &mut Watch<'_>) -> Result<bool, Stop> {
        while pending != 0 {
            let Some(passes) = self.passes.checked_sub(1) else { return Ok(false) };
            self.passes = passes;
            let mut moved = 0;
            for t in self.downs.iter().map(|&t| t as usize) {
                let fire = self.net.forward.fire(t, slices, pending);
                if fire != 0 {
                    self.net.flip_slices(t, slices, fire);
                    moved |= fire;
                }
            }
            pending = moved;
            watch.tick(self.downs.len())?;
        }
        Ok(true)
    }
}

/// Stuck markings by their number, M0 being 0.
struct Stuck<'a> {
    indexes: Vec<u32>,
    numbers: HashMap<&'a [u64], u32>,
    /// For each number another one that it reaches, or itself.
    tops: Vec<u32>,
}

impl Stuck<'_> {
    /// Whether one is neither joined to another one nor a deadlock.
    fn is_left(&self, space: &Space, number: usize) -> bool {
        self.tops[number] as usize == number && space.deadlocks.binary_search(&self.indexes[number]).is_err()
    }
}

/// The bottom components, where they can be found in this way.
pub(super) fn bottoms<W: Width>(
    width: W,
    space: &Space,
    memory: &Memory,
    watch: &mut Watch<'_>,
) -> Result<Option<Bottoms>, Stop> {
    let count = space.len();
    let Some(downs) = ranking::downs(&space.net, &space.fired, count.max(RANKING_LEAST)) else { return Ok(None) };
    let mut is_up: Vec<bool> = space.fired.iter().map(|&edges| edges > 0).collect();
    downs.iter().for_each(|&t| is_up[t as usize] = false);
    let ups = (0..is_up.len() as u32).filter(|&t| is_up[t as usize]).collect();
    let mut firings = Firings { net: &space.net, downs, ups, passes: count / PASS_PART + PASSES_LEAST };
    let Some(indexes) = sweep(width, space, &firings, memory, watch)? else { return Ok(None) };
    memory.claim(STUCK_BYTES * indexes.len())?;
    let mut numbers = HashMap::new();
    numbers.try_reserve(indexes.len()).map_err(|_| Stop::Memory)?;
    numbers.extend(indexes.iter().zip(0..).map(|(&index, number)| (space.marking(index as usize), number)));
    let tops = (0..indexes.len() as u32).collect();
    let mut stuck = Stuck { indexes, numbers, tops };
    if !join(width, space, &mut firings, &mut stuck, watch)? {
        return Ok(None);
    }
    let left: Vec<u32> = (1..stuck.indexes.len())
        .filter(|&number| stuck.is_left(space, number))
        .map(|number| stuck.indexes[number])
        .collect();
    if !left.is_empty() && !meeting::all_return(width, space, &left, memory, watch)? {
        return Ok(None);
    }
    Ok(Some(conclude(space)))
}

/// The stuck markings, M0 first; none where they are too many.
fn sweep<W: Width>(
    width: W,
    space: &Space,
    firings: &Firings<'_>,
    memory: &Memory,
    watch: &mut Watch<'_>,
) -> Result<Option<Vec<u32>>, Stop> {
    let most = space.len() / STUCK_PART + 1;
    let mut batch = Batch::new(&space.net);
    let mut stuck = Vec::new();
    for first in (0..space.len()).step_by(64) {
        let end = space.len().min(first + 64);
        batch.markings.clear();
        space.table.store.copy_range(first, end, &mut batch.markings);
        batch.slice(width);
        let mut left = batch.valid;
        for &t in &firings.downs {
            left &= !firings.net.forward.fire(t as usize, &batch.slices, left);
            if left == 0 {
                break;
            }
        }
        while left != 0 {
            memory.push(&mut stuck, first as u32 + left.trailing_zeros())?;
            left &= left - 1;
        }
        if stuck.len() > most {
            return Ok(None);
        }
        watch.tick(64 + firings.downs.len() / 4)?;
    }
    // Nothing is below M0.
    debug_assert_eq!(stuck.first(), Some(&0));
    Ok(Some(stuck))
}

/// Joins each stuck marking to another one that it reaches by going up once and then down; false where walks are too long.
fn join<W: Width>(
    width: W,
    space: &Space,
    firings: &mut Firings<'_>,
    stuck: &mut Stuck<'_>,
    watch: &mut Watch<'_>,
) -> Result<bool, Stop> {
    let (net, words) = (firings.net, width.words());
    let mut batch = Batch::new(net);
    let mut tried = vec![0; firings.ups.len()];
    let (mut slices, mut ends) = (Vec::new(), vec![0; 64 * words]);
    for first in (1..stuck.indexes.len()).step_by(64) {
        let end = stuck.indexes.len().min(first + 64);
        batch.markings.clear();
        for &index in &stuck.indexes[first..end] {
            batch.markings.extend_from_slice(space.table.store.get(width, index as usize));
        }
        batch.slice(width);
        tried.fill(0);
        let mut pending = batch.valid;
        while pending != 0 {
            // Each goes up by the next transition that lets it.
            slices.clone_from(&batch.slices);
            let mut risen = 0;
            for (&t, tried) in firings.ups.iter().zip(&mut tried) {
                let fire = net.forward.fire(t as usize, &batch.slices, pending & !risen & !*tried);
                if fire != 0 {
                    net.flip_slices(t as usize, &mut slices, fire);
                    *tried |= fire;
                    risen |= fire;
                }
            }
            pending = risen;
            if !firings.descend(&mut slices, risen, watch)? {
                return Ok(false);
            }
            unslice(words, &slices, &mut ends);
            for j in members(risen) {
                // Of a graph that is not whole.
                let Some(&number) = stuck.numbers.get(&ends[j * words..(j + 1) * words]) else { return Ok(false) };
                let (from, other) = ((first + j) as u32, top(&mut stuck.tops, number));
                if other != from {
                    stuck.tops[from as usize] = other;
                    pending &= !(1 << j);
                }
            }
            watch.tick(64 + firings.ups.len() + firings.downs.len())?;
        }
    }
    Ok(true)
}

/// What follows where nothing but M0 and deadlocks is left.
fn conclude(space: &Space) -> Bottoms {
    let Some(&lowest) = space.deadlocks.first().filter(|_| space.len() > 1) else { return Bottoms::whole(space) };
    let mut nearest = vec![0; space.len()];
    nearest[lowest as usize] = 1;
    Bottoms { reversible: false, live: vec![false; space.fired.len()], nearest, only: space.deadlocks.len() == 1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::marking::Fixed;
    use crate::net::Transition;
    use crate::samples::{explore, machines, random_spaces, slotted_ring};
    use crate::with_width;

    /// What is found in this way, held to Pearce's components.
    fn checked(space: &Space) -> Option<Bottoms> {
        let mut poll = unwatched;
        let mut watch = Watch::new(None, &mut poll);
        let memory = space.memory.clone();
        let found = with_width!(space.net.words, width => bottoms(width, space, &memory, &mut watch)).expect("fits");
        if let Some(found) = &found {
            assert_eq!(*found, Bottoms::of_components(space, &memory, &mut watch).expect("fits"));
        }
        found
    }

    #[test]
    fn what_is_found_without_edges_is_what_pearce_finds() {
        let (mut reversible, mut dead, mut several, mut unknown) = (0, 0, 0, 0);
        for space in random_spaces(1500, false).filter(|space| space.len() > 8) {
            *(match checked(&space) {
                Some(found) if found.reversible => &mut reversible,
                Some(found) if found.only => &mut dead,
                Some(_) => &mut several,
                None => &mut unknown,
            }) += 1;
        }
        assert!(
            reversible > 250 && dead > 1 && several > 1 && unknown > 250,
            "{reversible} {dead} {several} {unknown}"
        );
    }

    #[test]
    fn a_marking_that_comes_down_elsewhere_returns_to_m0_by_a_stroll() {
        for pad in [0, 70] {
            let ring = slotted_ring(4);
            let net = Net::new(ring.places + pad, ring.transitions, &[2, 4, 10, 12, 18, 20, 26, 28]).expect("the same");
            assert!(checked(&explore(net, false)).expect("found").reversible);
        }
    }

    #[test]
    fn nothing_is_concluded_where_a_marking_that_is_no_deadlock_does_not_return() {
        // The machines begin to work together and never stop; once they have, M0 is not reached any more.
        let mut net = machines(6, 1);
        net.transitions[0] = Transition::new(&[1, 0], &[2], &[], &[], &[]);
        net.transitions.push(Transition::new(&[2], &[1], &[], &[], &[]));
        net.transitions.push(Transition::new(&[1], &[2], &[], &[0], &[]));
        let net = Net::new(net.places, net.transitions, &[0, 1, 3, 5, 7, 9, 11]).expect("well formed");
        let space = explore(net, false);
        assert_eq!(checked(&space), None);
        let mut poll = unwatched;
        let bottoms = Bottoms::new(&space, &mut Watch::new(None, &mut poll)).expect("fits");
        assert!(!bottoms.reversible && bottoms.only);
    }

    #[test]
    fn walks_down_end_where_they_are_too_long() {
        let space = explore(machines(6, 0), false);
        let mut poll = unwatched;
        let mut watch = Watch::new(None, &mut poll);
        let downs = ranking::downs(&space.net, &space.fired, 1000).expect("little work");
        let mut last = Batch::new(&space.net);
        last.markings.extend_from_slice(space.marking(63));
        last.slice(Fixed::<1>);
        for (passes, ended) in [(0, false), (1, false), (2, true)] {
            let mut firings = Firings { net: &space.net, downs: downs.clone(), ups: Vec::new(), passes };
            let mut slices = last.slices.clone();
            assert_eq!(firings.descend(&mut slices, 1, &mut watch), Ok(ended));
            let mut end = [0; 64];
            unslice(1, &slices, &mut end);
            assert!(!ended || end[0] == space.marking(0)[0]);
        }
    }
}
