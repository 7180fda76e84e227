//! Markings on their way into the table, or asked for in it, many at a time.
//!
//! Look-ups come in batches, in passes without branches that depend on the data: first all slots of a batch are read,
//! then the candidates are sorted into those whose tag fits and those whose does not, then the markings of the first
//! are compared. So cache misses overlap without any prefetch instruction, the processor seldom guesses wrong, and the
//! usual case, a known marking in its first slot, never enters the probing loop. Only what is left is inserted one by
//! one.
//!
//! Not tried here: prefetch instructions, as where markings have keys (`ahead.rs`). A read of each slot does for that, in a
//! pass of its own.

use super::{NONE, Table};
use crate::batch::Batch;
use crate::budget::{Memory, Stop};
use crate::marking::{Width, mix};
use crate::sleep::Trail;

/// Candidates that wait before they are looked up together. Fewer than the arrays hold, whose length is that of a
/// byte, so that no index into them needs a check.
const BATCH: usize = 128;
const ROOM: usize = 256;

/// A batch of markings on their way into the table.
#[derive(Debug)]
pub struct Candidates {
    count: usize,
    /// The mixed hash of each.
    mixed: [u64; ROOM],
    /// Markings, end to end, and by which transition each was found (`sleep.rs`).
    markings: Box<[u64]>,
    lasts: [u16; ROOM],
    /// The first slot of each, as it was when the batch began.
    slots: [u32; ROOM],
    /// Those whose first slot has their tag.
    tagged: [u8; ROOM],
    /// Those not found in their first slot.
    open: [u8; ROOM],
}

impl Candidates {
    /// Room for one batch.
    pub fn new(words: usize) -> Self {
        Candidates {
            count: 0,
            mixed: [0; ROOM],
            markings: vec![0; ROOM * words].into_boxed_slice(),
            lasts: [0; ROOM],
            slots: [0; ROOM],
            tagged: [0; ROOM],
            open: [0; ROOM],
        }
    }

    /// How many wait.
    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// Adds `from ^ flip` for each marking of `fire`; true when the candidates should be looked up.
    ///
    /// The bound is soft: the 64 that one transition adds at most find room beyond it.
    #[inline(always)]
    pub fn push<W: Width>(
        &mut self,
        width: W,
        batch: &Batch,
        fire: u64,
        (flip, flip_hash): (&[u64], u64),
        last: u16,
    ) -> bool {
        let words = width.words();
        let flip = &flip[..words];
        let mut count = self.count;
        let mut rest = fire;
        while rest != 0 {
            let j = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let c = count % ROOM;
            count += 1;
            self.mixed[c] = mix(batch.hashes[j] ^ flip_hash);
            self.lasts[c] = last;
            let from = &batch.markings[j * words..(j + 1) * words];
            let to = &mut self.markings[c * words..(c + 1) * words];
            for k in 0..words {
                to[k] = from[k] ^ flip[k];
            }
        }
        self.count = count;
        count >= BATCH
    }
}

impl Table {
    /// Reads the first slots of a batch and sorts the candidates; how many are tagged and how many open.
    #[inline(always)]
    fn sort(&self, batch: &mut Candidates) -> (usize, usize) {
        let (shape, slots) = (self.shape(), self.slots.all());
        for (slot, &mixed) in batch.slots.iter_mut().zip(&batch.mixed[..batch.count]) {
            *slot = slots[shape.home(mixed)];
        }
        let (mut tagged, mut open) = (0_u8, 0_u8);
        for (c, (&slot, &mixed)) in batch.slots.iter().zip(&batch.mixed[..batch.count]).enumerate() {
            let fits = ((slot ^ shape.tag(mixed)) & !shape.index == 0) & (slot != 0);
            batch.tagged[usize::from(tagged)] = c as u8;
            batch.open[usize::from(open)] = c as u8;
            tagged = tagged.wrapping_add(u8::from(fits));
            open = open.wrapping_add(u8::from(!fits));
        }
        (usize::from(tagged), usize::from(open))
    }

    /// Inserts a batch and empties it.
    #[inline(always)]
    pub(crate) fn insert_batch<W: Width>(
        &mut self,
        width: W,
        batch: &mut Candidates,
        trail: &mut Trail,
        max: usize,
        memory: &Memory,
    ) -> Result<(), Stop> {
        let words = width.words();
        let (tagged, mut open) = self.sort(batch);
        let (shape, all) = (self.shape(), self.store.all());
        for k in 0..tagged {
            let c = batch.tagged[k % ROOM];
            let index = ((batch.slots[usize::from(c)] & shape.index) - 1) as usize;
            let marking = &batch.markings[usize::from(c) * words..(usize::from(c) + 1) * words];
            batch.open[open % ROOM] = c;
            open += usize::from(&all[index * words..(index + 1) * words] != marking);
        }
        for k in 0..open {
            let c = usize::from(batch.open[k % ROOM]);
            let marking = &batch.markings[c * words..(c + 1) * words];
            if self.insert_mixed(width, marking, batch.mixed[c], max, memory)? {
                trail.append(self.store.len() - 1, &batch.lasts[c..=c], memory);
            }
        }
        batch.count = 0;
        Ok(())
    }

    /// The indexes of a batch in its order, `NONE` for those not in the set; empties the batch.
    #[inline(always)]
    pub fn find_batch<W: Width>(&self, width: W, batch: &mut Candidates, found: &mut Vec<u32>) {
        let words = width.words();
        let (tagged, mut open) = self.sort(batch);
        let (shape, all) = (self.shape(), self.store.all());
        found.clear();
        found.resize(batch.count, NONE);
        for k in 0..tagged {
            let c = batch.tagged[k % ROOM];
            let index = (batch.slots[usize::from(c)] & shape.index) - 1;
            let marking = &batch.markings[usize::from(c) * words..(usize::from(c) + 1) * words];
            found[usize::from(c)] = index;
            batch.open[open % ROOM] = c;
            open += usize::from(&all[index as usize * words..(index as usize + 1) * words] != marking);
        }
        for k in 0..open {
            let c = usize::from(batch.open[k % ROOM]);
            let marking = &batch.markings[c * words..(c + 1) * words];
            found[c] = self.probe(width, marking, batch.mixed[c]).unwrap_or(NONE);
        }
        batch.count = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::marking::Fixed;
    use crate::samples::machines;

    #[test]
    fn markings_of_one_hash_stay_apart() {
        let memory = Memory::new(1 << 20);
        let mut table = Table::new(2, &memory).expect("fits");
        let mut candidates = Candidates::new(2);
        let mut batch = Batch::new(&machines(3, 70));
        batch.markings.extend((0..40).flat_map(|i| [i, 0]));
        batch.cut(Fixed::<2>);
        batch.hashes.fill(5);
        for round in 0..2 {
            assert!(!candidates.push(Fixed::<2>, &batch, batch.valid, (&[0, 7], 0), 0));
            table.insert_batch(Fixed::<2>, &mut candidates, &mut Trail::default(), usize::MAX, &memory).expect("fits");
            assert_eq!(table.store.len(), 40, "after round {round}");
        }
        for i in 0..40_u64 {
            assert_eq!(table.find(Fixed::<2>, &[i, 7], 5), Some(i as u32));
        }
        assert_eq!(table.find(Fixed::<2>, &[40, 7], 5), None);
    }
}
