//! Firing sequences, from the markings alone.
//!
//! A shortest sequence from M0 is found backwards under interleaving: the rule is run in reverse and the lowest
//! predecessor is taken, so a path costs its length times the number of transitions. Under steps the parent
//! was stored. Between two markings it is a breadth-first search.

use crate::budget::{Memory, Stop, Watch};
use crate::edges::Edges;
use crate::explore::Space;
use crate::table::NONE;

/// What a witness may take beyond the budget: a graph that ended for want of memory must still show what it found.
pub const WITNESS_BYTES: usize = 64 << 20;

/// A firing sequence: the set fired at each edge, a single transition under interleaving.
pub type Sequence = Vec<Vec<u32>>;

/// The fired set of some edge between two markings, the first in the order of edges.
fn fired_between(space: &Space, from: u32, to: u32, memory: &Memory, watch: &mut Watch<'_>) -> Result<Vec<u32>, Stop> {
    if !space.step {
        let (words, before, after) = (space.net.words, space.marking(from as usize), space.marking(to as usize));
        let leads = |t: u32| (0..words).all(|k| before[k] ^ space.net.flip(t as usize, words)[k] == after[k]);
        let fired = space.enabled_by(&space.net.forward, before).into_iter().find(|&t| leads(t));
        return Ok(fired.into_iter().collect());
    }
    let mut edges = Edges::new(space);
    let mut found = None;
    edges.visit(&[from], memory, watch, &mut |_, fired, target| {
        if target == to && found.is_none() {
            found = Some(fired.transitions());
        }
        Ok(())
    })?;
    edges.finish(memory);
    Ok(found.unwrap_or_default())
}

/// The fired sets along a path of markings.
fn sequence(space: &Space, path: &[u32], memory: &Memory, watch: &mut Watch<'_>) -> Result<Sequence, Stop> {
    path.windows(2).map(|pair| fired_between(space, pair[0], pair[1], memory, watch)).collect()
}

/// A shortest firing sequence from M0.
pub fn path_to(space: &Space, index: u32, watch: &mut Watch<'_>) -> Result<Sequence, Stop> {
    let memory = Memory::new(WITNESS_BYTES);
    let indexed = space.step || space.index(watch).is_ok();
    let mut path = vec![index];
    let mut at = index;
    while at != 0 {
        at = if space.step { space.parents[at as usize] } else { predecessor(space, at, indexed) };
        path.push(at);
    }
    path.reverse();
    sequence(space, &path, &memory, watch)
}

/// The lowest predecessor: markings are numbered level by level, so it stands on the level before. Where there was no
/// memory to index markings, that level is searched through; a whole path then reads each marking once.
fn predecessor(space: &Space, index: u32, indexed: bool) -> u32 {
    let words = space.net.words;
    let marking = space.marking(index as usize);
    let flipped = |t: u32| -> Vec<u64> {
        marking.iter().zip(space.net.flip(t as usize, words)).map(|(word, flip)| word ^ flip).collect()
    };
    let sources: Vec<Vec<u64>> = space.enabled_by(&space.net.backward, marking).into_iter().map(flipped).collect();
    let best = if indexed {
        sources.iter().filter_map(|source| space.find(source)).min()
    } else {
        let level = space.levels.partition_point(|&first| first <= index);
        // What was found last, of a level that was not taken up, seems to stand on the level before its own.
        let start = space.levels[level.saturating_sub(2)];
        (start..index).find(|&before| sources.iter().any(|source| source == space.marking(before as usize)))
    };
    best.filter(|&best| best < index).expect("a marking other than M0 was found by a firing")
}

/// A shortest sequence from a marking to one of `targets` (one byte for each marking), and the index reached; every
/// marking before the last is in `within`. Empty where `from` is itself a target.
pub fn path_between(
    space: &Space,
    from: u32,
    targets: &[u8],
    within: Option<&[u8]>,
    watch: &mut Watch<'_>,
) -> Result<Option<(Sequence, u32)>, Stop> {
    space.index(watch)?;
    let memory = space.memory.clone();
    if targets[from as usize] != 0 {
        return Ok(Some((Vec::new(), from)));
    }
    let inside = |index: u32| within.is_none_or(|within| within[index as usize] != 0);
    if !inside(from) {
        return Ok(None);
    }
    let mut parents = memory.filled(NONE, space.len())?;
    parents[from as usize] = from;
    let mut queue = Vec::new();
    memory.push(&mut queue, from)?;
    let mut edges = Edges::new(space);
    let mut reached = None;
    let mut next = 0;
    while next < queue.len() && reached.is_none() {
        let source = queue[next];
        next += 1;
        edges.visit(&[source], &memory, watch, &mut |source, _, target| {
            if parents[target as usize] == NONE {
                parents[target as usize] = source;
                if targets[target as usize] != 0 {
                    reached = reached.or(Some(target));
                } else if inside(target) {
                    memory.push(&mut queue, target)?;
                }
            }
            Ok(())
        })?;
    }
    let Some(reached) = reached else { return Ok(None) };
    let mut path = vec![reached];
    let mut at = reached;
    while at != from {
        at = parents[at as usize];
        path.push(at);
    }
    path.reverse();
    Ok(Some((sequence(space, &path, &memory, watch)?, reached)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::explore::Limits;
    use crate::net::{Net, Transition};

    /// 0 -> 1 -> 2 -> 0 and 1 -> 3 (a dead end), as one token.
    fn lasso(step: bool) -> Space {
        let arc = |from, to| Transition::new(&[from], &[to], &[], &[], &[]);
        let net = Net::new(4, vec![arc(0, 1), arc(1, 2), arc(2, 0), arc(1, 3)], &[0]).expect("well formed");
        let limits = Limits { step, markings: 100, memory_bytes: 1 << 20, time: None };
        Space::explore(net, limits, &mut unwatched).expect("fits")
    }

    #[test]
    fn paths_are_shortest_and_backward_reach_excludes_the_dead_end() {
        for step in [false, true] {
            let space = lasso(step);
            let mut poll = unwatched;
            let mut watch = Watch::new(None, &mut poll);
            let dead = space.deadlocks[0];
            assert_eq!(path_to(&space, dead, &mut watch), Ok(vec![vec![0], vec![3]]));
            assert_eq!((predecessor(&space, dead, true), predecessor(&space, dead, false)), (1, 1));
            let two = space.find(&[0b100]).expect("reachable");
            let mut targets = vec![0; 4];
            targets[dead as usize] = 1;
            let path = path_between(&space, two, &targets, None, &mut watch);
            assert_eq!(path, Ok(Some((vec![vec![2], vec![0], vec![3]], dead))));
            let mut within = vec![1; 4];
            within[0] = 0;
            assert_eq!(path_between(&space, two, &targets, Some(&within), &mut watch), Ok(None));
            let mut start = vec![0; 4];
            start[0] = 1;
            let reach = crate::fixpoints::backward(
                &space,
                &start,
                None,
                None,
                &crate::fixpoints::Against::default(),
                &mut watch,
            )
            .expect("fits");
            assert_eq!((reach.iter().map(|&b| u32::from(b)).sum::<u32>(), reach[dead as usize]), (3, 0));
        }
    }
}
