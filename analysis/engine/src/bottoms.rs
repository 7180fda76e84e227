//! Bottom components without edges: what is live, whether the net is reversible, and the home markings.
//!
//! A bottom component is a strongly connected one that no edge leaves; every run can be led into one and none gets out.
//! So a transition is live exactly if it fires in every bottom component, a home marking exists exactly if there is
//! one bottom component (and then its markings are the home markings), and the net is reversible exactly if M0 is in
//! one, which then is everything. Only bottom components matter, and they are found from three observations.
//!
//! 1. Markings are numbered from M0 on. One with an edge to a lower number can go down, and on from there, until it
//!    stands on M0 or on a *stuck* marking, one without such an edge. So every marking reaches one of few, and finding
//!    out costs each marking one or two edges: nearly all have a way back if they have any (`Fan`). If nothing is
//!    stuck but M0, all is one component.
//! 2. A stuck marking with an edge to a marking that goes down to another one can be given up: it reaches that one.
//!    So trees are joined, as in union-find.
//! 3. What is left has all its edges in its own tree. Search on from it: either an edge leads into another tree, and
//!    the two are joined, or all that it reaches goes down to it again, which is a bottom component.
//!
//! Before that, an order of markings in which each transition always goes down or always up is tried (`descent.rs`): where
//! it is enough, and mostly it is, no edge is looked up at all.
//!
//! M0 reaches everything, so where another bottom component exists, M0 is in none and needs no search. The work of
//! searches that are given up is bounded: where it grows beyond the graph itself, the edges are stored and the
//! components found by Pearce's algorithm (`scc.rs`), if memory allows it. That is also the way under steps.
//!
//! The rejected way, a search against the edges from M0, tests each marking for every edge that enters it: it took
//! two to five times the exploration, this one takes about as long as it, and without the edges a twentieth.

mod descent;
mod meeting;
mod ranking;

use crate::bits::Bits;
use crate::budget::{Memory, Stop, Watch};
use crate::csr::Csr;
use crate::explore::Space;
use crate::fan::Fan;
use crate::marking::Width;
use crate::scc::{self, Scc};
use crate::table::NONE;
use crate::with_width;

/// What follows from the bottom components.
#[derive(Debug, PartialEq, Eq)]
pub struct Bottoms {
    /// Whether all markings are one component.
    pub reversible: bool,
    /// For each transition, whether it fires in every bottom component.
    pub live: Vec<bool>,
    /// The bottom component with the lowest marking, one byte for each marking; empty where all markings are one.
    pub nearest: Vec<u8>,
    /// Whether there is no other bottom component, so that its markings are the home markings.
    pub only: bool,
}

impl Bottoms {
    /// The bottom components of a whole graph.
    pub fn new(space: &Space, watch: &mut Watch<'_>) -> Result<Self, Stop> {
        if !space.step {
            let memory = space.memory.clone();
            match with_width!(space.net.words, width => descent::bottoms(width, space, &memory, watch)) {
                Ok(Some(bottoms)) => return Ok(bottoms),
                Ok(None) | Err(Stop::Memory) => {}
                Err(stop) => return Err(stop),
            }
        }
        Bottoms::within(space, 2 * space.len(), watch)
    }

    /// The same, where searches of more than `most` markings in vain are too many.
    fn within(space: &Space, most: usize, watch: &mut Watch<'_>) -> Result<Self, Stop> {
        if space.step {
            return Bottoms::of_components(space, &space.memory.clone(), watch);
        }
        let memory = space.memory.clone();
        let mut tops = memory.filled(0u32, space.len())?;
        with_width!(space.net.words, width => {
            let mut fan = Fan::forward(space, watch)?;
            let stuck = descend(width, space, &mut fan, &mut tops, &memory, watch)?;
            let left = join(width, space, &mut fan, &mut tops, stuck, watch)?;
            if left.is_empty() {
                return Ok(Bottoms::whole(space));
            }
            if let Some(bottoms) = search(width, space, &mut fan, &mut tops, &left, most, &memory, watch)? {
                return Ok(bottoms);
            }
            match Bottoms::of_components(space, &memory, watch) {
                Err(Stop::Memory) => {}
                other => return other,
            }
            let found = search(width, space, &mut fan, &mut tops, &left, usize::MAX, &memory, watch)?;
            found.ok_or(Stop::Memory)
        })
    }

    /// All markings are one component.
    fn whole(space: &Space) -> Self {
        let live = space.fired.iter().map(|&edges| edges > 0).collect();
        Bottoms { reversible: true, live, nearest: Vec::new(), only: true }
    }

    fn of_components(space: &Space, memory: &Memory, watch: &mut Watch<'_>) -> Result<Self, Stop> {
        let edges = Csr::new(space, None, memory, watch)?;
        let scc = Scc::of_edges(&edges, None, memory, watch)?;
        if scc.sizes.len() == 1 {
            return Ok(Bottoms::whole(space));
        }
        let only = scc.bottom.iter().filter(|&&bottom| bottom != 0).count() == 1;
        let lowest = scc.of.iter().copied().find(|&of| scc.bottom[of as usize] != 0);
        let nearest = scc.of.iter().map(|&of| u8::from(Some(of) == lowest)).collect();
        let live = scc::live(space, &scc, watch)?;
        Ok(Bottoms { reversible: false, live, nearest, only })
    }
}

/// The marking that a marking was found to reach, at the end of the way; shortens the way.
#[inline(always)]
fn top(tops: &mut [u32], mut index: u32) -> u32 {
    while tops[index as usize] != index {
        let next = tops[tops[index as usize] as usize];
        tops[index as usize] = next;
        index = next;
    }
    index
}

/// Gives each marking a way down; returns the stuck ones, without M0.
fn descend<W: Width>(
    width: W,
    space: &Space,
    fan: &mut Fan<'_>,
    tops: &mut [u32],
    memory: &Memory,
    watch: &mut Watch<'_>,
) -> Result<Vec<u32>, Stop> {
    let count = space.net.transitions.len();
    // Transitions that led down are tried first.
    let mut order: Vec<u32> = (0..count as u32).collect();
    let mut wins = vec![0u32; count];
    let mut stuck = Vec::new();
    for (round, first) in (0..space.len()).step_by(64).enumerate() {
        let end = space.len().min(first + 64);
        fan.load_range(width, first, end);
        let pending = if first == 0 { !1 } else { !0 };
        let mut left = fan.each(width, pending, order.iter().map(|&t| t as usize), &mut |j, t, target| {
            let lower = (target as usize) < first + j;
            if lower {
                tops[first + j] = target;
                wins[t as usize] += 1;
            }
            lower
        });
        while left != 0 {
            let index = first + left.trailing_zeros() as usize;
            left &= left - 1;
            tops[index] = index as u32;
            memory.push(&mut stuck, index as u32)?;
        }
        for index in first..end {
            tops[index] = tops[tops[index] as usize];
        }
        if round.is_power_of_two() || round % 1024 == 0 {
            order.sort_by_key(|&t| std::cmp::Reverse(wins[t as usize]));
            wins.iter_mut().for_each(|wins| *wins /= 2);
        }
        watch.tick(64 + count / 4)?;
    }
    Ok(stuck)
}

/// Joins the trees of stuck markings that have an edge into another tree; returns those that have none.
fn join<W: Width>(
    width: W,
    space: &Space,
    fan: &mut Fan<'_>,
    tops: &mut [u32],
    mut stuck: Vec<u32>,
    watch: &mut Watch<'_>,
) -> Result<Vec<u32>, Stop> {
    let count = space.net.transitions.len();
    let mut kept = 0;
    for first in (0..stuck.len()).step_by(64) {
        let end = stuck.len().min(first + 64);
        fan.load(width, &stuck[first..end]);
        let mut left = fan.each(width, !0, 0..count, &mut |j, _, target| {
            let (from, other) = (stuck[first + j], top(tops, target));
            let joined = tops[from as usize] != from;
            if !joined && other != from {
                tops[from as usize] = other;
            }
            joined || other != from
        });
        while left != 0 {
            stuck[kept] = stuck[first + left.trailing_zeros() as usize];
            kept += 1;
            left &= left - 1;
        }
        watch.tick(64 + count)?;
    }
    stuck.truncate(kept);
    Ok(stuck)
}

/// Searches on from each marking that is left; none where searches of more than `most` markings were given up.
#[allow(clippy::too_many_arguments)]
fn search<W: Width>(
    width: W,
    space: &Space,
    fan: &mut Fan<'_>,
    tops: &mut [u32],
    left: &[u32],
    most: usize,
    memory: &Memory,
    watch: &mut Watch<'_>,
) -> Result<Option<Bottoms>, Stop> {
    let count = space.net.transitions.len();
    let mut seen = Bits::new(space.len(), memory)?;
    let mut nearest: Vec<u32> = Vec::new();
    let mut lowest = NONE;
    let mut live = vec![true; count];
    let mut fires = vec![false; count];
    let mut bottoms = 0;
    let mut members: Vec<u32> = Vec::new();
    let mut waiting: Vec<u32> = Vec::new();
    let mut batch = Vec::with_capacity(64);
    let mut wasted = 0;
    for &from in left {
        if space.deadlocks.binary_search(&from).is_ok() {
            bottoms += 1;
            live.fill(false);
            if from < lowest {
                lowest = from;
                nearest = vec![from];
            }
            continue;
        }
        if tops[from as usize] != from {
            continue;
        }
        members.clear();
        waiting.clear();
        fires.fill(false);
        seen.add(from as usize);
        memory.push(&mut members, from)?;
        memory.push(&mut waiting, from)?;
        let mut found = Ok(());
        // The latest first: a way out is deep rather than broad.
        while !waiting.is_empty() && tops[from as usize] == from {
            let rest = waiting.len().saturating_sub(64);
            batch.clear();
            batch.extend(waiting.drain(rest..));
            fan.load(width, &batch);
            fan.each(width, !0, 0..count, &mut |_, t, target| {
                fires[t as usize] = true;
                let other = top(tops, target);
                if other != from {
                    // Whatever it is joined to first, it is joined to no more than that.
                    tops[from as usize] = other;
                } else if seen.add(target as usize) {
                    found = found.and_then(|()| memory.push(&mut members, target));
                    found = found.and_then(|()| memory.push(&mut waiting, target));
                }
                tops[from as usize] != from
            });
            found?;
            watch.tick(batch.len() + count)?;
        }
        for &member in &members {
            seen.remove(member as usize);
        }
        if tops[from as usize] == from {
            bottoms += 1;
            for (live, &fires) in live.iter_mut().zip(&fires) {
                *live &= fires;
            }
            let low = members.iter().copied().min().unwrap_or(from);
            if low < lowest {
                lowest = low;
                std::mem::swap(&mut nearest, &mut members);
            }
        } else {
            wasted += members.len();
            if wasted > most {
                return Ok(None);
            }
        }
    }
    if bottoms == 0 {
        return Ok(Some(Bottoms::whole(space)));
    }
    let mut bytes = vec![0; space.len()];
    for member in nearest {
        bytes[member as usize] = 1;
    }
    Ok(Some(Bottoms { reversible: false, live, nearest: bytes, only: bottoms == 1 }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::samples::random_spaces;

    #[test]
    fn bottom_components_without_edges_are_those_of_pearce() {
        let (mut reversible, mut one, mut several, mut large) = (0, 0, 0, 0);
        for space in random_spaces(400, false) {
            let mut poll = unwatched;
            let mut watch = Watch::new(None, &mut poll);
            let found = Bottoms::new(&space, &mut watch).expect("fits");
            let expected = Bottoms::of_components(&space, &space.memory.clone(), &mut watch).expect("fits");
            assert_eq!(found, expected);
            *(match (found.reversible, found.only) {
                (true, _) => &mut reversible,
                (false, true) => &mut one,
                (false, false) => &mut several,
            }) += 1;
            large += u32::from(space.len() > 200);
        }
        assert!(reversible > 40 && one > 40 && several > 40 && large > 40, "{reversible} {one} {several} {large}");
    }

    #[test]
    fn searches_that_wander_are_given_up_and_without_memory_for_the_edges_taken_up_again() {
        let mut given_up = 0;
        for mut space in random_spaces(250, false) {
            let mut poll = unwatched;
            let mut watch = Watch::new(None, &mut poll);
            let expected = Bottoms::new(&space, &mut watch).expect("fits");
            let patient = Bottoms::within(&space, 0, &mut watch).expect("fits");
            assert_eq!(patient, expected);
            space.memory = Memory::new(space.memory.used() + 16 * space.len() + 2000);
            let tight = Bottoms::within(&space, 0, &mut watch);
            given_up += u32::from(tight.is_ok());
            assert!(tight.as_ref().is_ok_and(|tight| *tight == expected) || tight == Err(Stop::Memory));
        }
        assert!(given_up > 200);
    }
}
