//! What leads where, one step or any number of them: EX, EF (E[U]) and EG over the stored markings.
//!
//! Under interleaving no edge is stored for one question. The rule runs backwards from 64 markings at a time (`Fan`), and
//! what waits is taken in the order of the indexes (`Agenda`), so a search against the edges costs about what the
//! exploration did; fifty times as much where many transitions differ only in what they ask before, as those of a cell with
//! its machines do, because most of what they come from was never reached. So who asks again and again counts what was
//! tried, and before that comes to more than it costs to store the edges, in the middle of a search or between two, or
//! before the first if it is said that many follow, they are stored (`Against`): turned round, where a search stays in a
//! set, and costs some ten nanoseconds an edge then; or as those of the components, where it goes anywhere
//! (`Condensed`), and costs two or three.
//!
//! One step back is asked from whichever side is smaller: the predecessors of few targets are computed, and of many, each
//! marking looks for one edge into them, of which it usually finds one at once.
//!
//! The greatest fixpoint EG counts for each marking the edges that stay inside; a marking with none is taken out, and its
//! predecessors count one less (Arnold and Crubille, "A linear algorithm to solve fixed-point equations on transition
//! systems", 1988). Sweeping until nothing changes was rejected: on a chain it is quadratic.
//!
//! Under steps, where the rule has no simple reverse, edges are stored for the first question already, and for each that
//! goes by some transitions alone, or for ever inside a set.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use crate::bits::{Agenda, Bits};
use crate::budget::{Memory, Stop, Watch};
use crate::condensed::Condensed;
use crate::csr::Csr;
use crate::edges::{Edges, Fired};
use crate::explore::Space;
use crate::fan::Fan;
use crate::marking::Width;
use crate::with_width;

/// What goes against the edges of a graph, once it is worth what it takes to store it.
#[derive(Debug, Default)]
pub struct Against {
    /// How many candidates for a predecessor the table was asked for.
    tried: AtomicU64,
    /// The edges turned round; none where they do not fit.
    edges: OnceLock<Option<Csr>>,
    /// The components; none where they do not fit.
    condensed: OnceLock<Option<Condensed>>,
    /// How many edges leave each marking; none where that does not fit.
    leaving: OnceLock<Option<Vec<u32>>>,
}

impl Against {
    /// The edges turned round, if they are stored.
    pub fn stored(&self) -> Option<&Csr> {
        self.edges.get().and_then(Option::as_ref)
    }

    /// The edges turned round, if they are stored or worth it now: their bytes count as held by the graph.
    fn edges(&self, space: &Space, watch: &mut Watch<'_>) -> Result<Option<&Csr>, Stop> {
        if self.edges.get().is_none() && self.is_worth_storing(space) && !is_late(space, watch) {
            self.store(space, watch)?;
        }
        Ok(self.stored())
    }

    fn store(&self, space: &Space, watch: &mut Watch<'_>) -> Result<(), Stop> {
        let memory = space.memory.clone();
        let edges = Csr::new(space, None, &memory, watch).and_then(|edges| edges.reversed(&memory, watch));
        keep(&self.edges, edges, Csr::bytes, space)
    }

    /// Counts so many questions to come as if each tried every edge once, and stores the edges where that is enough.
    pub fn expect(&self, questions: u64, space: &Space, watch: &mut Watch<'_>) -> Result<(), Stop> {
        self.tried.fetch_add(questions.saturating_mul(space.edges), Ordering::Relaxed);
        if self.edges.get().is_none() && self.is_worth_storing(space) { self.store(space, watch) } else { Ok(()) }
    }

    /// The components, likewise.
    fn condensed(&self, space: &Space, watch: &mut Watch<'_>) -> Result<Option<&Condensed>, Stop> {
        if self.condensed.get().is_none() && self.is_worth_storing(space) && !is_late(space, watch) {
            let condensed = Condensed::new(space, &space.memory.clone(), watch);
            keep(&self.condensed, condensed, Condensed::bytes, space)?;
        }
        Ok(self.condensed.get().and_then(Option::as_ref))
    }

    /// Counts the edges that leave each marking, under interleaving.
    fn count_leaving(&self, space: &Space, counts: &mut [u32], watch: &mut Watch<'_>) -> Result<(), Stop> {
        if let Some(Some(known)) = self.leaving.get() {
            counts.copy_from_slice(known);
            return watch.tick(counts.len());
        }
        with_width!(space.net.words, width => {
            let mut fan = Fan::forward(space, watch)?;
            for first in (0..space.len()).step_by(64) {
                let end = space.len().min(first + 64);
                fan.load_range(width, first, end);
                fan.count(&mut counts[first..end]);
                watch.tick(64 + space.net.transitions.len())?;
            }
        });
        keep(&self.leaving, Ok(counts.to_vec()), |known| size_of_val(known.as_slice()), space)
    }

    /// Whether more was tried than it costs to store the edges.
    fn has_tried_enough(&self, space: &Space) -> bool {
        self.tried.load(Ordering::Relaxed) > WORTH * space.edges
    }

    /// Whether storing the edges costs less than to do without, and takes not the memory that later questions need for
    /// edges of their own.
    fn is_worth_storing(&self, space: &Space) -> bool {
        let left = space.memory.limit().saturating_sub(space.memory.used());
        let has_room = Csr::bytes_of(space).is_some_and(|bytes| left / ROOM >= bytes);
        has_room && (space.step || self.has_tried_enough(space)) // under steps each question would store them
    }
}

/// Whether storing edges, under interleaving, might take a question its time.
fn is_late(space: &Space, watch: &Watch<'_>) -> bool {
    let seconds = |end: Instant| end.duration_since(Instant::now()).as_secs_f64();
    !space.step && watch.deadline().is_some_and(|end| seconds(end) < STORING * space.seconds)
}

/// Keeps what was stored for later questions, and its bytes as held by the graph; nothing where it does not fit.
fn keep<T>(
    place: &OnceLock<Option<T>>,
    stored: Result<T, Stop>,
    bytes: impl Fn(&T) -> usize,
    space: &Space,
) -> Result<(), Stop> {
    let stored = match stored.and_then(|stored| space.memory.claim(bytes(&stored)).map(|()| stored)) {
        Err(Stop::Memory) => None,
        stored => Some(stored?),
    };
    if let Err(Some(second)) = place.set(stored) {
        // Somebody has done the same meanwhile.
        space.memory.release(bytes(&second));
    }
    Ok(())
}

/// As many candidates for each edge of the graph are tried at most before edges are stored, which costs as much as some
/// two.
const WORTH: u64 = 2;
/// As often as stored edges must fit into the memory that is left: twice while they are turned round, and then beside
/// those of a question that stores its own.
const ROOM: usize = 6;
/// How many times as long as the exploration took storing its edges takes at most.
const STORING: f64 = 4.0;

/// The markings from which a target can be reached, one byte each, targets included; every marking on the way before
/// the target is in `within`; with `by`, by edges that fire one of these transitions.
pub fn backward(
    space: &Space,
    targets: &[u8],
    within: Option<&[u8]>,
    by: Option<&[u32]>,
    against: &Against,
    watch: &mut Watch<'_>,
) -> Result<Vec<u8>, Stop> {
    let memory = space.memory.clone();
    if targets.iter().all(|&target| target == 0) {
        watch.tick(targets.len())?;
        return memory.filled(0u8, targets.len());
    }
    let is_anywhere = within.is_none() && by.is_none();
    if is_anywhere && let Some(condensed) = against.condensed(space, watch)? {
        return condensed.backward(targets, &memory, watch);
    }
    let mut search = Search::new(space, targets, within, &memory)?;
    let edges = match by {
        None if is_anywhere => against.stored(),
        None => against.edges(space, watch)?,
        Some(_) => None,
    };
    if let Some(edges) = edges {
        return search.along(edges, watch);
    }
    if space.step {
        let edges = match by {
            None => Csr::new(space, None, &memory, watch)?,
            Some(_) => Csr::of_steps(space, one_of(space, by), &memory, watch)?,
        };
        return search.along(&edges.reversed(&memory, watch)?, watch);
    }
    let transitions = transitions(space, by);
    let mut fan = Fan::backward(space, watch)?;
    let mut taken = Vec::with_capacity(64);
    let mut is_storing = by.is_none();
    with_width!(space.net.words, width => {
        while search.agenda.take(&mut taken) {
            let mut edges = 0;
            fan.load(width, &taken);
            fan.each(width, !0, transitions.iter().copied(), &mut |_, _, source| {
                edges += 1;
                search.meet(source);
                false
            });
            against.tried.fetch_add(if by.is_none() { fan.tried } else { 0 }, Ordering::Relaxed);
            fan.tried = 0;
            watch.tick(taken.len() + edges + transitions.len())?;
            if is_storing && against.has_tried_enough(space) {
                is_storing = false;
                if is_anywhere && let Some(condensed) = against.condensed(space, watch)? {
                    return condensed.backward(targets, &memory, watch);
                }
                if !is_anywhere && let Some(edges) = against.edges(space, watch)? {
                    return search.along(edges, watch);
                }
            }
        }
    });
    Ok(search.reach.to_bytes(space.len()))
}

/// The markings that can be reached from a source, one byte each, sources included.
pub fn forward(space: &Space, sources: &[u8], watch: &mut Watch<'_>) -> Result<Vec<u8>, Stop> {
    let memory = space.memory.clone();
    let mut search = Search::new(space, sources, None, &memory)?;
    if space.step {
        return search.along(&Csr::new(space, None, &memory, watch)?, watch);
    }
    let transitions = space.net.transitions.len();
    let mut fan = Fan::forward(space, watch)?;
    let mut taken = Vec::with_capacity(64);
    with_width!(space.net.words, width => {
        while search.agenda.take(&mut taken) {
            let mut edges = 0;
            fan.load(width, &taken);
            fan.each(width, !0, 0..transitions, &mut |_, _, target| {
                edges += 1;
                search.meet(target);
                false
            });
            watch.tick(taken.len() + edges + transitions)?;
        }
    });
    Ok(search.reach.to_bytes(space.len()))
}

/// A search along or against the edges: what it has reached, and what of that it has not looked behind.
struct Search<'a> {
    reach: Bits,
    agenda: Agenda,
    within: Option<&'a [u8]>,
}

impl<'a> Search<'a> {
    fn new(space: &Space, targets: &[u8], within: Option<&'a [u8]>, memory: &Memory) -> Result<Self, Stop> {
        let reach = Bits::from_bytes(targets, memory)?;
        let mut agenda = Agenda::new(space.len(), memory)?;
        reach.iter().for_each(|index| agenda.add(index));
        Ok(Search { reach, agenda, within })
    }

    /// A marking is at the other end of an edge of one that was reached.
    #[inline(always)]
    fn meet(&mut self, index: u32) {
        let index = index as usize;
        if !self.reach.has(index) && self.within.is_none_or(|within| within[index] != 0) {
            self.reach.add(index);
            self.agenda.add(index);
        }
    }

    /// Goes on along stored edges, which are turned round where it goes against them, to the end.
    fn along(mut self, edges: &Csr, watch: &mut Watch<'_>) -> Result<Vec<u8>, Stop> {
        let mut taken = Vec::with_capacity(64);
        while self.agenda.take(&mut taken) {
            for &index in &taken {
                let others = edges.targets(index);
                others.iter().for_each(|&other| self.meet(other));
                watch.tick(1 + others.len())?;
            }
        }
        Ok(self.reach.to_bytes(edges.offsets.len() - 1))
    }
}

/// These transitions, or all.
fn transitions(space: &Space, by: Option<&[u32]>) -> Vec<usize> {
    match by {
        Some(by) => by.iter().map(|&t| t as usize).collect(),
        None => (0..space.net.transitions.len()).collect(),
    }
}

/// Whether one of these transitions fires on an edge.
fn one_of(space: &Space, by: Option<&[u32]>) -> impl Fn(Fired<'_>) -> bool {
    let marked = by.map(|by| {
        let mut marked = vec![false; space.net.transitions.len()];
        by.iter().for_each(|&t| marked[t as usize] = true);
        marked
    });
    move |fired| marked.as_ref().is_none_or(|marked| fired.any(|t| marked[t as usize]))
}

/// The markings with an edge into the targets, one byte each; with `by`, an edge that fires one of these transitions.
/// Edges that `backward` has stored are used.
pub fn before(
    space: &Space,
    targets: &[u8],
    by: Option<&[u32]>,
    against: &Against,
    watch: &mut Watch<'_>,
) -> Result<Vec<u8>, Stop> {
    let memory = space.memory.clone();
    let mut found = memory.filled(0u8, space.len())?;
    if let Some(edges) = against.stored().filter(|_| by.is_none()) {
        for target in (0..space.len() as u32).filter(|&target| targets[target as usize] != 0) {
            edges.targets(target).iter().for_each(|&source| found[source as usize] = 1);
            watch.tick(1 + edges.targets(target).len())?;
        }
        return Ok(found);
    }
    if space.step {
        let fires = one_of(space, by);
        let mut edges = Edges::new(space);
        for index in 0..space.len() as u32 {
            edges.visit(&[index], &memory, watch, &mut |source, fired, target| {
                if targets[target as usize] != 0 && found[source as usize] == 0 && fires(fired) {
                    found[source as usize] = 1;
                }
                Ok(())
            })?;
        }
        return Ok(found);
    }
    let transitions = transitions(space, by);
    let count = targets.iter().filter(|&&target| target != 0).count();
    with_width!(space.net.words, width => {
        if count < space.len() / 4 {
            into_few(width, space, targets, &transitions, &mut found, watch)?;
        } else {
            into_many(width, space, targets, transitions, &mut found, watch)?;
        }
    });
    Ok(found)
}

fn into_few<W: Width>(
    width: W,
    space: &Space,
    targets: &[u8],
    transitions: &[usize],
    found: &mut [u8],
    watch: &mut Watch<'_>,
) -> Result<(), Stop> {
    let mut fan = Fan::backward(space, watch)?;
    let mut batch = Vec::with_capacity(64);
    let mut all = (0..space.len() as u32).filter(|&index| targets[index as usize] != 0);
    loop {
        batch.clear();
        batch.extend(all.by_ref().take(64));
        if batch.is_empty() {
            return Ok(());
        }
        fan.load(width, &batch);
        fan.each(width, !0, transitions.iter().copied(), &mut |_, _, source| {
            found[source as usize] = 1;
            false
        });
        watch.tick(64 + transitions.len())?;
    }
}

fn into_many<W: Width>(
    width: W,
    space: &Space,
    targets: &[u8],
    mut transitions: Vec<usize>,
    found: &mut [u8],
    watch: &mut Watch<'_>,
) -> Result<(), Stop> {
    let mut fan = Fan::forward(space, watch)?;
    let mut wins = vec![0u32; space.net.transitions.len()];
    for (round, first) in (0..space.len()).step_by(64).enumerate() {
        fan.load_range(width, first, space.len().min(first + 64));
        fan.each(width, !0, transitions.iter().copied(), &mut |j, t, target| {
            let hit = targets[target as usize] != 0;
            found[first + j] |= u8::from(hit);
            wins[t as usize] += u32::from(hit);
            hit
        });
        // Transitions that lead into the targets are tried first.
        if round.is_power_of_two() || round % 1024 == 0 {
            transitions.sort_by_key(|&t| std::cmp::Reverse(wins[t]));
            wins.iter_mut().for_each(|wins| *wins /= 2);
        }
        watch.tick(64 + transitions.len() / 4)?;
    }
    Ok(())
}

/// The markings from which a run can go on for ever inside a set (EG over infinite runs), one byte each.
///
/// Where most are inside, all edges are counted, and those into the others are taken off like those into what is lost.
pub fn endless(
    space: &Space,
    within: Option<&[u8]>,
    against: &Against,
    watch: &mut Watch<'_>,
) -> Result<Vec<u8>, Stop> {
    let memory = space.memory.clone();
    let count = space.len();
    let mut inside = match within {
        Some(within) => within.iter().map(|&byte| u8::from(byte != 0)).collect(),
        None => memory.filled(1u8, count)?,
    };
    // For each marking inside, its edges that stay inside; those at 0 have to go.
    let mut stay = memory.filled(0u32, count)?;
    let mut agenda = Agenda::new(count, &memory)?;
    let mut taken = Vec::with_capacity(64);
    let lose = |inside: &mut [u8], stay: &mut [u32], agenda: &mut Agenda, source: u32| {
        let source = source as usize;
        if inside[source] != 0 {
            stay[source] -= 1;
            if stay[source] == 0 {
                inside[source] = 0;
                agenda.add(source);
            }
        }
    };
    let begin = |inside: &mut [u8], stay: &[u32], are_others: bool, agenda: &mut Agenda| {
        for index in (0..count).filter(|&index| if inside[index] == 0 { are_others } else { stay[index] == 0 }) {
            agenda.add(index);
        }
        for (inside, &stay) in inside.iter_mut().zip(stay) {
            *inside &= u8::from(stay > 0);
        }
    };
    if space.step {
        let edges = Csr::new(space, Some(&inside), &memory, watch)?;
        for (stay, row) in stay.iter_mut().zip(edges.offsets.windows(2)) {
            *stay = u32::try_from(row[1] - row[0]).map_err(|_| Stop::Memory)?;
        }
        let edges = edges.reversed(&memory, watch)?;
        begin(&mut inside, &stay, false, &mut agenda);
        while agenda.take(&mut taken) {
            for &index in &taken {
                edges.targets(index).iter().for_each(|&source| lose(&mut inside, &mut stay, &mut agenda, source));
                watch.tick(1 + edges.targets(index).len())?;
            }
        }
        return Ok(inside);
    }
    let transitions = space.net.transitions.len();
    let are_few_others = 2 * inside.iter().filter(|&&byte| byte == 0).count() < count;
    with_width!(space.net.words, width => {
        if are_few_others {
            against.count_leaving(space, &mut stay, watch)?;
        } else {
            let mut fan = Fan::forward(space, watch)?;
            for first in (0..count).step_by(64) {
                let end = count.min(first + 64);
                let sources = inside[first..end].iter().rev().fold(0, |bits, &byte| bits << 1 | u64::from(byte));
                watch.tick(64)?;
                if sources == 0 {
                    continue;
                }
                fan.load_range(width, first, end);
                fan.each(width, sources, 0..transitions, &mut |j, _, target| {
                    stay[first + j] += u32::from(inside[target as usize]);
                    false
                });
                watch.tick(2 * transitions)?;
            }
        }
        begin(&mut inside, &stay, are_few_others, &mut agenda);
        let mut fan = Fan::backward(space, watch)?;
        while agenda.take(&mut taken) {
            if let Some(edges) = against.stored() {
                for &index in &taken {
                    edges.targets(index).iter().for_each(|&source| lose(&mut inside, &mut stay, &mut agenda, source));
                    watch.tick(1 + edges.targets(index).len())?;
                }
                continue;
            }
            fan.load(width, &taken);
            fan.each(width, !0, 0..transitions, &mut |_, _, source| {
                lose(&mut inside, &mut stay, &mut agenda, source);
                false
            });
            watch.tick(64 + 2 * transitions)?;
        }
    });
    Ok(inside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::samples::random_spaces;

    #[test]
    fn edges_are_stored_before_the_first_of_many_questions_and_say_the_same() {
        let mut stored = 0;
        for space in random_spaces(200, false) {
            let mut poll = unwatched;
            let mut watch = Watch::new(None, &mut poll);
            let against = Against::default();
            against.expect(WORTH, &space, &mut watch).expect("fits");
            assert!(against.stored().is_none());
            against.expect(1, &space, &mut watch).expect("fits");
            assert_eq!(against.stored().is_some(), space.edges > 0);
            stored += usize::from(against.stored().is_some());
            let bytes = |nth: usize| (1..=space.len()).map(|at| u8::from(at % nth == 0)).collect::<Vec<u8>>();
            let (targets, within) = (bytes(3), bytes(2));
            for within in [None, Some(within.as_slice())] {
                let found = backward(&space, &targets, within, None, &against, &mut watch);
                assert_eq!(found, backward(&space, &targets, within, None, &Against::default(), &mut watch));
            }
        }
        assert!(stored > 100, "{stored}");
    }

    /// The markings of a set that a run need not leave, by sweeps over all edges.
    fn staying(edges: &Csr, within: &[u8]) -> Vec<u8> {
        let mut inside = within.to_vec();
        loop {
            let left = |index: usize| edges.targets(index as u32).iter().all(|&target| inside[target as usize] == 0);
            let lost: Vec<usize> = (0..inside.len()).filter(|&index| inside[index] != 0 && left(index)).collect();
            if lost.is_empty() {
                return inside;
            }
            lost.iter().for_each(|&index| inside[index] = 0);
        }
    }

    #[test]
    fn a_run_stays_where_sweeps_say_so_whatever_is_stored_and_however_many_are_inside() {
        let (mut few, mut many, mut lost, mut stored) = (0, 0, 0, 0);
        for step in [false, true] {
            for space in random_spaces(200, step) {
                let mut poll = unwatched;
                let mut watch = Watch::new(None, &mut poll);
                let memory = Memory::new(1 << 24);
                let edges = Csr::new(&space, None, &memory, &mut watch).expect("fits");
                let against = Against::default();
                for round in 0..2 {
                    for nth in [1, 2, 3, 5, space.len(), space.len() + 1] {
                        let others = |index: usize| index.is_multiple_of(nth);
                        for most in [false, true] {
                            let within: Vec<u8> = (1..=space.len()).map(|at| u8::from(others(at) != most)).collect();
                            let expected = staying(&edges, &within);
                            let found = endless(&space, Some(&within), &against, &mut watch);
                            assert_eq!(found.as_ref(), Ok(&expected));
                            let inside = within.iter().filter(|&&byte| byte != 0).count();
                            *(if 2 * inside > space.len() { &mut many } else { &mut few }) += 1;
                            lost += usize::from(expected != within);
                        }
                    }
                    let all = vec![1; space.len()];
                    assert_eq!(endless(&space, None, &against, &mut watch), Ok(staying(&edges, &all)));
                    if round == 0 && !step {
                        against.tried.store(u64::MAX, Ordering::Relaxed);
                        against.edges(&space, &mut watch).expect("fits");
                        stored += usize::from(against.stored().is_some());
                    }
                }
            }
        }
        assert!(few > 1_000 && many > 1_000 && lost > 1_000 && stored > 100, "{few} {many} {lost} {stored}");
    }
}
