//! Blocks: neighbouring places that answer each other, taken as one level of the search.
//!
//! Of five places of a machine one holds a token. One place a level, the diagram says so in a chain of nodes, and a
//! search that goes by places fires each event of the machine at whichever of its places stands highest, on nodes that
//! know only some of the others. So the search goes by blocks: a node of a block is opened into its *values* (which of
//! its places hold a token) and what is below each, events are fired from value to value, and the chain of nodes is made
//! when all has been found. The diagram itself keeps one place a level, so that nothing else knows of blocks.
//!
//! This is the multi-valued diagram of Ciardo's saturation, stored as a zero-suppressed one: a machine of k places takes
//! k nodes of 16 bytes in either, and nodes of one size need no allocator. Which places make a block is found by playing
//! the net on them alone, whatever the other places say: that gives at least the values there are, without invariants,
//! and a block ends where another place would add more values than it saves levels.

use std::collections::HashMap;

use super::events::{Kind, Mixed, Sense, literals_into};
use super::zdd::{EMPTY, Node, Store};
use crate::net::Transition;

/// The most places of a block.
const WIDTH_MAX: usize = 16;
/// The most values that a block may have.
const VALUES_MAX: usize = 24;
/// What a block costs besides its values, in values.
const OVERHEAD: usize = 12;
/// The moves from a value that may be looked at altogether; what is left is cut into places.
const WORK_MAX: usize = 1 << 24;

/// The literals of transitions in descending order of level; without those that never fire or change nothing.
#[derive(Debug)]
pub(super) struct Literals {
    offsets: Vec<u32>,
    all: Vec<(u32, Kind)>,
}

impl Literals {
    /// Those of these transitions, where each place has its level.
    pub(super) fn new(transitions: &[Transition], level_of: &[u32], sense: Sense) -> Self {
        let mut found = Literals { offsets: vec![0], all: Vec::new() };
        let mut own = Vec::new();
        for transition in transitions.iter().filter(|t| !(t.inputs.is_empty() && t.outputs.is_empty())) {
            if literals_into(transition, level_of, sense, &mut own) {
                found.all.extend_from_slice(&own);
                found.offsets.push(found.all.len() as u32);
            }
        }
        found
    }

    /// How many transitions.
    pub(super) fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Those of one transition.
    pub(super) fn get(&self, at: usize) -> &[(u32, Kind)] {
        &self.all[self.offsets[at] as usize..self.offsets[at + 1] as usize]
    }

    /// For each level, the transitions that have a literal there.
    fn by_level(&self, levels: usize) -> (Vec<u32>, Vec<u32>) {
        let mut offsets = vec![0; levels + 2];
        for &(level, _) in &self.all {
            offsets[level as usize + 1] += 1;
        }
        for at in 1..offsets.len() {
            offsets[at] += offsets[at - 1];
        }
        let mut next = offsets.clone();
        let mut joined = vec![0; self.all.len()];
        for at in 0..self.len() {
            for &(level, _) in self.get(at) {
                joined[next[level as usize] as usize] = at as u32;
                next[level as usize] += 1;
            }
        }
        (offsets, joined)
    }
}

/// What a transition wants and changes in a window of places: three bits for each place, the highest ones for the first. So
/// moves in ascending order stay so when their last places are left out, and those that become equal stand side by side.
type Local = u64;
const PLACE_BITS: usize = 3;
/// Of one place: it must hold a token, must hold none, changes.
const FULL: Local = 1 << 2;
const HOLE: Local = 1 << 1;
const FLIP: Local = 1;

/// The levels cut into blocks.
#[derive(Debug)]
pub(super) struct Blocks {
    /// The block of each level; 0 for level 0.
    of: Vec<u32>,
    /// The lowest level of each block, and one more at the end.
    low: Vec<u32>,
}

impl Blocks {
    /// Blocks that have few values in what can be reached from a marking, given by level.
    pub(super) fn new(literals: &Literals, marked: &[bool]) -> Self {
        let levels = marked.len() - 1;
        let (offsets, joined) = literals.by_level(levels);
        let mut widths: HashMap<(u32, Vec<Local>), usize, Mixed> = HashMap::default();
        let mut seen = vec![0_u32; literals.len()];
        let mut known = vec![0_u64; (1 << WIDTH_MAX) / 64];
        let (mut of, mut low) = (vec![0], vec![0]);
        let (mut start, mut work) = (1, 0);
        while start <= levels {
            let most = if work > WORK_MAX { 1 } else { WIDTH_MAX.min(levels + 1 - start) };
            let its = &joined[offsets[start] as usize..offsets[start + most] as usize];
            let mut window: Vec<Local> = Vec::with_capacity(its.len());
            for &t in its {
                if std::mem::replace(&mut seen[t as usize], start as u32) != start as u32 {
                    window.push(local(literals.get(t as usize), start as u32, most as u32));
                }
            }
            window.sort_unstable();
            window.dedup();
            let first = (0..most).fold(0, |value, at| value | u32::from(marked[start + at]) << at);
            let best = |(first, window): &(u32, Vec<Local>)| width(*first, window, most, &mut known, &mut work);
            let width = *widths.entry((first, window)).or_insert_with_key(best);
            of.resize(start + width, low.len() as u32);
            low.push(start as u32);
            start += width;
        }
        low.push(levels as u32 + 1);
        Blocks { of, low }
    }

    /// The block of a level; 0 for level 0.
    #[inline(always)]
    pub(super) fn of(&self, level: u32) -> u32 {
        self.of[level as usize]
    }

    /// The lowest level of a block.
    #[inline(always)]
    pub(super) fn low(&self, block: u32) -> u32 {
        self.low[block as usize]
    }

    /// How many blocks there are; they are numbered from 1.
    pub(super) fn len(&self) -> usize {
        self.low.len() - 2
    }

    /// How many bytes the blocks take.
    pub(super) fn bytes(&self) -> usize {
        4 * (self.of.capacity() + self.low.capacity())
    }

    /// What is below a value of a block in a set whose node lies at the block or below.
    pub(super) fn child(&self, store: &Store, mut node: Node, block: u32, mut value: u32) -> Node {
        let low = self.low(block);
        while store.level(node) >= low {
            let at = store.level(node) - low;
            if value >> at > 1 {
                return EMPTY;
            }
            node = if value >> at == 1 { store.hi(node) } else { store.lo(node) };
            value &= !(1 << at);
        }
        if value == 0 { node } else { EMPTY }
    }
}

/// How far the bits of a place of a window are shifted.
fn shift(place: usize) -> usize {
    PLACE_BITS * (WIDTH_MAX - 1 - place)
}

fn local(literals: &[(u32, Kind)], start: u32, width: u32) -> Local {
    let within = literals.iter().filter(|(level, _)| (start..start + width).contains(level));
    within.fold(0, |found, &(level, kind)| {
        let wants = if kind.wants() { FULL } else { HOLE };
        let own = if kind.wants() == kind.leaves() { wants } else { wants | FLIP };
        found | own << shift((level - start) as usize)
    })
}

/// The same as bits of a value, one for each place: those that matter, those of them that must hold a token, and those that
/// change.
fn masks(local: Local) -> [u32; 3] {
    [FULL | HOLE, FULL, FLIP].map(|kind| {
        let bit = |place: usize| u32::from(local >> shift(place) & kind != 0) << place;
        (0..WIDTH_MAX).fold(0, |mask, place| mask | bit(place))
    })
}

/// How many places from the first of a window make the best block; the moves are in order, and `known` is a set of values
/// that is empty.
fn width(first: u32, window: &[Local], most: usize, known: &mut [u64], work: &mut usize) -> usize {
    let (mut best, mut width) = (usize::MAX, 1);
    let window: Vec<(Local, [u32; 3])> = window.iter().map(|&local| (local, masks(local))).collect();
    let mut moves: Vec<[u32; 3]> = Vec::with_capacity(window.len());
    let mut values: Vec<u32> = Vec::with_capacity(VALUES_MAX + window.len());
    for places in 1..=most {
        let mask = u32::MAX >> (32 - places);
        let cut = |&(local, _): &(Local, [u32; 3])| local >> shift(places - 1);
        let different =
            window.chunk_by(|one, other| cut(one) == cut(other)).map(|all| all[0].1.map(|bits| bits & mask));
        moves.clear();
        moves.extend(different.filter(|[_, _, flip]| *flip != 0));
        *work += window.len();
        let mut found = |value: u32, values: &mut Vec<u32>| {
            let (word, bit) = (value as usize / 64, 1 << (value % 64));
            if known[word] & bit == 0 {
                known[word] |= bit;
                values.push(value);
            }
        };
        found(first & mask, &mut values);
        let mut at = 0;
        while at < values.len() && values.len() <= VALUES_MAX {
            let value = values[at];
            at += 1;
            *work += moves.len();
            for [matter, full, flip] in &moves {
                if value & matter == *full {
                    found(value ^ flip, &mut values);
                }
            }
        }
        let count = values.len();
        values.drain(..).for_each(|value| known[value as usize / 64] = 0);
        if count > VALUES_MAX {
            continue;
        }
        let cost = (count + OVERHEAD) * 1000 / places;
        if cost <= best {
            (best, width) = (cost, places);
        }
    }
    width
}

#[cfg(test)]
mod tests {
    use super::*;

    fn widths(marked: &[bool], transitions: &[Transition]) -> Vec<u32> {
        let level_of: Vec<u32> = (1..marked.len() as u32).collect();
        let blocks = Blocks::new(&Literals::new(transitions, &level_of, Sense::Forward), marked);
        (1..=blocks.len() as u32).map(|block| blocks.low(block + 1) - blocks.low(block)).collect()
    }

    #[test]
    fn the_places_of_a_machine_are_one_block() {
        // Two machines of eight places side by side, which meet in one transition.
        let moves = |from: u32, to: u32| Transition::new(&[from], &[to], &[], &[], &[]);
        let mut all: Vec<Transition> =
            [0, 8].into_iter().flat_map(|first| (0..7).map(move |at| moves(first + at, first + at + 1))).collect();
        all.push(Transition::new(&[7, 15], &[0, 8], &[], &[], &[]));
        let marked: Vec<bool> = (0..17).map(|level| level == 1 || level == 9).collect();
        assert_eq!(widths(&marked, &all), [8, 8]);
    }

    #[test]
    fn a_block_ends_where_its_values_would_be_too_many() {
        let all: Vec<Transition> = (0..12).map(|at| Transition::new(&[], &[at], &[], &[], &[])).collect();
        assert!(widths(&[false; 13], &all).iter().all(|&width| 1 << width <= VALUES_MAX));
    }
}
