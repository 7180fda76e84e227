//! Laying into the array what two threads have found: in each level in turn a block of each, then what one and the other
//! have more.
//!
//! The array is new memory, which the system fills with zeros when it is first written to, and that takes longer than the
//! copying. Of much it is done by both, each a half of the array: one alone took up to a tenth of the time of all, in which
//! the other one had nothing to do.

use std::thread;

use super::half::{BLOCK, Finds};
use crate::budget::Stop;
use crate::explore::Space;
use crate::sleep::Trail;

/// Bytes from which a second thread is worth its start.
const BOTH_BYTES: usize = if cfg!(test) { 1 << 12 } else { 1 << 20 };

/// Whose markings of a level come one after the other, and how many.
fn pieces_of(a: usize, b: usize) -> impl Iterator<Item = (usize, usize)> {
    let even = a.min(b) / BLOCK;
    (0..2 * even).map(|k| (k % 2, BLOCK)).chain([(0, a - BLOCK * even), (1, b - BLOCK * even)])
}

/// The same of all levels.
fn pieces(finds: [&Finds; 2]) -> impl Iterator<Item = (usize, usize)> {
    finds[0].levels.iter().zip(&finds[1].levels).flat_map(|(&a, &b)| pieces_of(a, b))
}

/// Lays down those pieces that begin in a part of the array, `skip` words after the first.
fn lay(finds: [&Finds; 2], words: usize, skip: usize, into: &mut [u64]) {
    let (mut from, mut at) = (finds.map(|of| of.fresh.all()), 0);
    for (of, count) in pieces(finds) {
        let (markings, rest) = from[of].split_at(count * words);
        from[of] = rest;
        if at >= skip && at - skip < into.len() {
            into[at - skip..][..markings.len()].copy_from_slice(markings);
        }
        at += markings.len();
    }
}

/// Appends to the array the finds of each level, and to the trail what those of the last two say; where the last of these
/// levels begins, if there are several. Without memory for all, as many as there is memory for.
pub(super) fn append(
    space: &mut Space,
    finds: [&Finds; 2],
    trail: &mut Trail,
    max: usize,
) -> Result<Option<usize>, Stop> {
    let last = append_markings(space, finds, max)?;
    append_trail(space, finds, trail);
    Ok(last)
}

/// What the finds of the last two levels say: of the one that was expanded, and of what follows it.
fn append_trail(space: &Space, finds: [&Finds; 2], trail: &mut Trail) {
    let tail = |of: &Finds| of.levels[of.levels.len().saturating_sub(2)..].to_vec();
    let levels = finds.map(tail);
    let mut from = [0, 1].map(|id| finds[id].fresh.len() - levels[id].iter().sum::<usize>());
    let mut index = space.table.store.len() - levels.iter().flatten().sum::<usize>();
    if levels[0].len() > 1 {
        trail.forget(index);
    }
    for (&a, &b) in levels[0].iter().zip(&levels[1]) {
        for (of, count) in pieces_of(a, b) {
            trail.append(index, finds[of].trail.of(from[of], from[of] + count), &space.memory);
            from[of] += count;
            index += count;
        }
    }
}

fn append_markings(space: &mut Space, finds: [&Finds; 2], max: usize) -> Result<Option<usize>, Stop> {
    let words = space.net.words;
    let sizes: Vec<usize> = finds[0].levels.iter().zip(&finds[1].levels).map(|(a, b)| a + b).collect();
    let Some((last, before)) = sizes.split_last() else { return Ok(None) };
    let total = before.iter().sum::<usize>() + last;
    if 8 * words * total < BOTH_BYTES {
        return append_alone(space, finds, max);
    }
    let (known, mut start, mut noted) = (space.levels.len(), space.table.store.len(), Ok(()));
    for size in before {
        noted = noted.and_then(|()| space.memory.push(&mut space.levels, start as u32));
        start += size;
    }
    match noted.and_then(|()| space.table.store.extend(total, max, &space.memory)) {
        Ok(room) => lay_by_two(finds, words, room),
        Err(_) => {
            space.levels.truncate(known);
            return append_alone(space, finds, max);
        }
    }
    Ok(Some(start).filter(|_| !before.is_empty()))
}

/// Both parts at once, cut near the middle where a piece begins.
fn lay_by_two(finds: [&Finds; 2], words: usize, room: &mut [u64]) {
    let mut cut = 0;
    for (_, count) in pieces(finds) {
        if 2 * cut >= room.len() {
            break;
        }
        cut += count * words;
    }
    let (low, high) = room.split_at_mut(cut);
    let by_two = thread::scope(|scope| {
        let other = thread::Builder::new().spawn_scoped(scope, || lay(finds, words, 0, low));
        lay(finds, words, cut, high);
        other.is_ok()
    });
    // Where the system has no thread to give, one does it all.
    if !by_two {
        lay(finds, words, 0, low);
    }
}

/// One piece after the other.
fn append_alone(space: &mut Space, finds: [&Finds; 2], max: usize) -> Result<Option<usize>, Stop> {
    let words = space.net.words;
    let mut all = finds.map(|of| of.fresh.all());
    let mut end = None;
    for (&a, &b) in finds[0].levels.iter().zip(&finds[1].levels) {
        if let Some(begun) = end {
            space.memory.push(&mut space.levels, begun as u32)?;
        }
        end = Some(space.table.store.len());
        for (of, count) in pieces_of(a, b) {
            let (markings, rest) = all[of].split_at(count * words);
            all[of] = rest;
            space.table.store.append(markings, max, &space.memory)?;
        }
    }
    Ok(end.filter(|_| finds[0].levels.len() > 1))
}
