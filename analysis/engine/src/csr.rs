//! The edges of the reachability graph as compressed rows: an offset for each marking, and all targets end to end.
//!
//! They are stored only where a question walks over them again and again, or one question after the other does, 4 bytes an
//! edge and 8 a marking within the memory budget: for the components, and turned round for what goes against them.

use crate::batch::Batch;
use crate::budget::{CLOCK_EVERY, Memory, Stop, Watch};
use crate::edges::{Edges, Fired};
use crate::exact::ROOM;
use crate::explore::Space;
use crate::fan::Fan;
use crate::indexes::Asking;
use crate::marking::{Width, transpose};
use crate::region::Region;
use crate::span::Span;
use crate::with_width;

/// Successors as compressed rows.
#[derive(Debug)]
pub struct Csr {
    /// Where the row of each marking begins; one more than there are markings.
    pub offsets: Vec<u64>,
    /// Targets, row by row, in the order of the edges; of a whole graph in huge pages.
    pub targets: Region<u32>,
}

impl Csr {
    /// Stores the edges that stay within a set of markings (one byte each), or all.
    pub fn new(space: &Space, within: Option<&[u8]>, memory: &Memory, watch: &mut Watch<'_>) -> Result<Self, Stop> {
        let count = space.len();
        let inside = |index: u32| within.is_none_or(|within| within[index as usize] != 0);
        let mut offsets = memory.filled(0u64, count + 1)?;
        let keyed = space.set.span().filter(|_| !space.step && within.is_none() && space.stop.is_none());
        if let Some(span) = keyed {
            space.index(watch)?;
            let edges = usize::try_from(space.edges).map_err(|_| Stop::Memory)?;
            memory.claim(edges.checked_mul(4).ok_or(Stop::Memory)?)?;
            let mut targets = Region::zeroed(edges).ok_or(Stop::Memory)?;
            with_width!(space.net.words, width => {
                fill_by_key(width, space, span, &mut offsets, targets.all_mut(), watch)
            })?;
            return Ok(Csr { offsets, targets });
        }
        // Of the whole graph the number of edges is known, so nothing is claimed twice.
        let mut targets: Vec<u32> = Vec::new();
        if within.is_none() {
            let edges = usize::try_from(space.edges).map_err(|_| Stop::Memory)?;
            memory.claim(edges.checked_mul(4).ok_or(Stop::Memory)?)?;
            targets.try_reserve_exact(edges).map_err(|_| Stop::Memory)?;
        }
        if space.step {
            fill_steps(space, inside, |_| true, &mut offsets, &mut targets, memory, watch)?;
        } else {
            with_width!(space.net.words, width => {
                fill(width, space, within, &mut offsets, &mut targets, memory, watch)
            })?;
        }
        Ok(Csr { offsets, targets: Region::Heap(targets) })
    }

    /// Stores the steps that fire such transitions.
    pub fn of_steps(
        space: &Space,
        such: impl Fn(Fired<'_>) -> bool,
        memory: &Memory,
        watch: &mut Watch<'_>,
    ) -> Result<Self, Stop> {
        let (mut offsets, mut targets) = (memory.filled(0u64, space.len() + 1)?, Vec::new());
        fill_steps(space, |_| true, such, &mut offsets, &mut targets, memory, watch)?;
        Ok(Csr { offsets, targets: Region::Heap(targets) })
    }

    /// Bytes that the rows take.
    pub fn bytes(&self) -> usize {
        size_of_val(self.offsets.as_slice()) + size_of_val(self.targets.all())
    }

    /// Bytes that the rows of all edges take, if that is a number of bytes.
    pub fn bytes_of(space: &Space) -> Option<usize> {
        let targets = usize::try_from(space.edges).ok()?.checked_mul(size_of::<u32>())?;
        (space.len() + 1).checked_mul(size_of::<u64>())?.checked_add(targets)
    }

    /// The successors of a marking.
    pub fn targets(&self, index: u32) -> &[u32] {
        &self.targets.all()[self.offsets[index as usize] as usize..self.offsets[index as usize + 1] as usize]
    }

    /// The same edges by their target.
    pub fn reversed(self, memory: &Memory, watch: &mut Watch<'_>) -> Result<Csr, Stop> {
        let count = self.offsets.len() - 1;
        let mut offsets = memory.filled(0u64, count + 2)?;
        let mut sources = memory.filled(0u32, self.targets.all().len())?;
        for part in self.targets.all().chunks(CLOCK_EVERY) {
            part.iter().for_each(|&target| offsets[target as usize + 2] += 1);
            watch.tick(part.len())?;
        }
        for index in 0..=count {
            offsets[index + 1] += offsets[index];
        }
        for source in 0..count as u32 {
            let row = self.targets(source);
            for &target in row {
                let at = &mut offsets[target as usize + 1];
                sources[*at as usize] = source;
                *at += 1;
            }
            watch.tick(1 + row.len())?;
        }
        offsets.pop();
        Ok(Csr { offsets, targets: Region::Heap(sources) })
    }
}

/// The rows under steps, of those within some markings that fire such transitions.
fn fill_steps(
    space: &Space,
    inside: impl Fn(u32) -> bool,
    such: impl Fn(Fired<'_>) -> bool,
    offsets: &mut [u64],
    targets: &mut Vec<u32>,
    memory: &Memory,
    watch: &mut Watch<'_>,
) -> Result<(), Stop> {
    let count = space.len();
    let mut edges = Edges::new(space);
    let mut sources = Vec::with_capacity(64);
    for first in (0..count).step_by(64) {
        sources.clear();
        sources.extend((first as u32..count.min(first + 64) as u32).filter(|&source| inside(source)));
        edges.visit(&sources, memory, watch, &mut |source, fired, target| {
            if inside(target) && such(fired) {
                offsets[source as usize + 1] += 1;
                memory.push(targets, target)?;
            }
            Ok(())
        })?;
    }
    edges.finish(memory);
    for index in 0..count {
        offsets[index + 1] += offsets[index];
    }
    Ok(())
}

/// All rows of a whole graph under interleaving, where markings have keys. What fires at 64 markings is turned, so that
/// edges come row by row and a key is all that is kept of one until its target is known.
fn fill_by_key<W: Width>(
    width: W,
    space: &Space,
    span: &Span,
    offsets: &mut [u64],
    targets: &mut [u32],
    watch: &mut Watch<'_>,
) -> Result<(), Stop> {
    let (count, net) = (space.len(), &space.net);
    let mut batch = Batch::new(net);
    let mut fires = vec![[0_u64; 64]; net.transitions.len().div_ceil(64)];
    let (mut keys, mut waiting, mut asking) = ([0; ROOM], 0, Asking::new());
    let mut parts = targets.chunks_mut(ROOM);
    let mut look = |keys: &[u64]| {
        if let (Some(part), Some(found)) = (parts.next(), space.set.find(keys, &mut asking)) {
            part.copy_from_slice(found);
        }
    };
    let mut edges = 0;
    for first in (0..count).step_by(64) {
        let end = count.min(first + 64);
        batch.markings.clear();
        space.table.store.copy_range(first, end, &mut batch.markings);
        batch.cut_by(width, span);
        for (block, fires) in fires.iter_mut().enumerate() {
            let transitions = 64 * block..net.transitions.len().min(64 * block + 64);
            fires.fill(0);
            for (fires, t) in fires.iter_mut().zip(transitions) {
                let (base, blocked) = net.forward.test(t, &batch.slices, batch.valid);
                *fires = base & !blocked & net.forward.edge(t);
            }
            transpose(fires);
        }
        for (j, offset) in (0..64).zip(&mut offsets[first + 1..=end]) {
            for (fires, flips) in fires.iter().zip(span.flips.chunks(64)) {
                let mut rest = fires[j];
                edges += u64::from(rest.count_ones());
                while rest != 0 {
                    keys[waiting % ROOM] = batch.hashes[j] ^ flips[rest.trailing_zeros() as usize];
                    rest &= rest - 1;
                    waiting += 1;
                    if waiting == ROOM {
                        look(&keys);
                        waiting = 0;
                    }
                }
            }
            *offset = edges;
        }
        watch.tick(64 + (edges - offsets[first]) as usize + net.transitions.len())?;
    }
    look(&keys[..waiting]);
    Ok(())
}

/// The rows under interleaving. Edges come one transition after the other for 64 markings; each is put where the row of its
/// marking stands, so that rows keep the order of the transitions.
fn fill<W: Width>(
    width: W,
    space: &Space,
    within: Option<&[u8]>,
    offsets: &mut [u64],
    targets: &mut Vec<u32>,
    memory: &Memory,
    watch: &mut Watch<'_>,
) -> Result<(), Stop> {
    let count = space.len();
    let transitions = space.net.transitions.len();
    let mut fan = Fan::forward(space, watch)?;
    let mut kept: Vec<(u8, u32)> = Vec::new();
    for first in (0..count).step_by(64) {
        let end = count.min(first + 64);
        let mut at = [0usize; 65];
        let mut sources = !0;
        if let Some(within) = within {
            sources = within[first..end].iter().rev().fold(0, |bits, &byte| bits << 1 | u64::from(byte != 0));
        }
        kept.clear();
        fan.load_range(width, first, end);
        fan.each(width, sources, 0..transitions, &mut |j, _, target| {
            if within.is_none_or(|within| within[target as usize] != 0) {
                at[j + 1] += 1;
                kept.push((j as u8, target));
            }
            false
        });
        let start = targets.len();
        for j in 0..64 {
            at[j + 1] += at[j];
        }
        for (index, end) in (first..end).zip(&at[1..]) {
            offsets[index + 1] = (start + end) as u64;
        }
        memory.extend(targets, 0, kept.len())?;
        let row = &mut targets[start..];
        for &(j, target) in &kept {
            let at = &mut at[usize::from(j)];
            row[*at] = target;
            *at += 1;
        }
        watch.tick(64 + kept.len() + transitions)?;
    }
    Ok(())
}
