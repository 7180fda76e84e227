//! The halves of a set of exact keys: a record is where a key belongs and what would stand there, so that who receives it
//! has nothing left to compute. A marking is made of it where it is new.
//!
//! The set says no indexes, so nothing is numbered before the markings stand in the array, and the threads may go on from
//! level to level meanwhile.

use super::half::{End, Finds, Half, Shared};
use crate::batch::Batch;
use crate::budget::{Stop, Watch};
use crate::exact::ROOM;
use crate::exact::halves::{HalfExact, Sought, stride};
use crate::explore::Space;
use crate::known::ByKey;
use crate::marking::Width;
use crate::net::Net;
use crate::seat::Slot;
use crate::span::Span;
use crate::spread::Spread;
use crate::store::Store;
use crate::table::Table;

/// A half of the buckets.
pub(crate) struct KeyedHalf<'a, S> {
    half: HalfExact<'a, S>,
    /// Records of its own that wait, and how many words of them.
    mine: Vec<u64>,
    waiting: usize,
    span: &'a Span,
    spread: &'a Spread,
    /// New keys that there is room for.
    room: usize,
    /// The keys of this half that stood past its end before.
    past: Vec<u64>,
    marking: Vec<u64>,
}

impl<W: Width, S: Slot> Half<W> for KeyedHalf<'_, S> {
    #[inline(always)]
    fn stride(&self, _: W) -> usize {
        stride::<S>()
    }

    #[inline(always)]
    fn cut(&self, width: W, batch: &mut Batch) {
        batch.cut_by(width, self.span);
    }

    #[inline(always)]
    fn push(&mut self, _: W, _: &Net, batch: &Batch, t: usize, fire: u64, theirs: (&mut [u64], &mut usize)) {
        let flip = self.span.flips[t];
        self.half.ask(fire, |j| batch.hashes[j] ^ flip, (&mut self.mine, &mut self.waiting), theirs);
    }

    #[inline(always)]
    fn settle(&mut self, width: W, all: bool, finds: &mut Finds) {
        if all || self.waiting >= (ROOM - 64) * stride::<S>() {
            let mine = std::mem::take(&mut self.mine);
            self.put(width, &mine[..self.waiting], finds);
            (self.mine, self.waiting) = (mine, 0);
        }
    }

    #[inline(always)]
    fn insert(&mut self, width: W, records: &[u64], finds: &mut Finds) {
        for records in records.chunks((ROOM - 64) * stride::<S>()) {
            self.put(width, records, finds);
        }
    }
}

impl<S: Slot> KeyedHalf<'_, S> {
    /// Looks up fewer than `ROOM` records, and takes what is new.
    #[inline(always)]
    fn put<W: Width>(&mut self, width: W, records: &[u64], finds: &mut Finds) {
        let mut open = [0; ROOM];
        for k in 0..self.half.look(records, &mut open) {
            let c = usize::from(open[k % ROOM]) * stride::<S>();
            let record = &records[c..c + stride::<S>()];
            let sought = self.half.seek(record);
            if sought == Sought::Known {
                continue;
            }
            let key = self.half.key(record);
            if sought == Sought::Past && (self.past.contains(&key) || finds.past.contains(&key)) {
                continue;
            }
            if sought == Sought::Full || finds.fresh.len() >= self.room {
                finds.end(End::Full);
                finds.left.push(key);
                continue;
            }
            let marking = &mut self.marking[..width.words()];
            self.spread.marking(key, marking);
            let (fresh, memory) = (&mut finds.fresh, &finds.memory);
            if fresh.len() >= finds.most || fresh.push(width, marking, finds.most, memory).is_err() {
                finds.end(End::Short);
                finds.left.push(key);
                continue;
            }
            match sought {
                Sought::Free(slot) => self.half.take(record, slot),
                _ => finds.past.push(key),
            }
        }
    }
}

impl<W: Width, S: Slot> Shared<W> for ByKey<'_, S> {
    type Half<'a>
        = KeyedHalf<'a, S>
    where
        Self: 'a;
    const GOES_ON: bool = true;

    fn halves<'a>(&'a mut self, table: &'a mut Table) -> (&'a Store, [KeyedHalf<'a, S>; 2]) {
        let store = &table.store;
        let (span, spread, exact) = self.keyed.parts();
        // As full as one thread would let it become, if both halves were equally full.
        let room = exact.free() / 2;
        let past = exact.past();
        let half = |half, past| {
            let (mine, marking) = (vec![0; ROOM * stride::<S>()], vec![0; spread.words()]);
            KeyedHalf { half, mine, waiting: 0, span, spread, room, past, marking }
        };
        let [low, high] = exact.halves();
        (store, [half(low, past), half(high, Vec::new())])
    }

    fn complete(&mut self, _: W, space: &mut Space, finds: [&Finds; 2], watch: &mut Watch<'_>) -> Result<(), Stop> {
        let exact = self.keyed.parts().2;
        for of in finds {
            exact.count(of.fresh.len());
            for &key in &of.past {
                while !exact.place(key) {
                    exact.grow(&space.memory, watch)?;
                }
            }
        }
        Ok(())
    }

    fn grow(&mut self, _: W, space: &mut Space, watch: &mut Watch<'_>) -> Result<bool, Stop> {
        self.keyed.parts().2.grow_by_two(&space.memory, watch)
    }

    fn insert_left(
        &mut self,
        width: W,
        space: &mut Space,
        records: &[u64],
        max: usize,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        let (_, spread, exact) = self.keyed.parts();
        let mut marking = vec![0; width.words()];
        for &key in records {
            let store = &mut space.table.store;
            exact.put(&mut self.asked, key, (&space.memory, watch), || {
                if store.len() >= max {
                    return Err(Stop::Markings);
                }
                spread.marking(key, &mut marking);
                store.push(width, &marking, max, &space.memory)
            })?;
        }
        Ok(())
    }

    fn forget_others(&mut self, _: W, _: &mut Space) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::explore::Limits;
    use crate::known::Set;
    use crate::marking::Fixed;
    use crate::samples::machines;

    #[test]
    fn keys_past_the_end_of_the_lower_half_are_found_once_and_known_from_then_on() {
        let limits = Limits { step: false, markings: 1, memory_bytes: 1 << 28, time: None };
        let mut space = Space::explore(machines(16, 0), limits, &mut unwatched).expect("begins");
        let Set::Narrow(mut keyed) = std::mem::replace(&mut space.set, Set::Hashed) else { panic!("sixteen bits") };
        let (mut set, width, mut poll) = (ByKey::new(&mut keyed), Fixed::<1>, unwatched);
        let mut watch = Watch::new(None, &mut poll);
        // The last before the middle; all belong to one bucket, which holds eight.
        let shape = set.keyed.exact.shape();
        let keys: Vec<u64> = (0..1 << 16).filter(|&key| shape.mix(key) >> 53 == (1 << 10) - 1).collect();
        for expected in [32, 0, 0] {
            let mut finds = [0, 1].map(|id| Finds::new(id, 1));
            finds.iter_mut().for_each(|of| of.allow(1 << 20, 1000));
            let (_, [mut low, _]) = Shared::<Fixed<1>>::halves(&mut set, &mut space.table);
            let (mut records, mut len, mut other, mut none) = (vec![0; 100], 0, vec![0; 100], 0);
            for &key in keys.iter().chain(&keys) {
                low.half.ask(1, |_| key, (&mut records, &mut len), (&mut other, &mut none));
            }
            low.put(width, &records[..len], &mut finds[0]);
            assert_eq!((finds[0].fresh.len(), finds[0].end, len, none), (expected, None, 64, 0));
            let [low, high] = &finds;
            set.complete(width, &mut space, [low, high], &mut watch).expect("fits");
            assert!(keys.iter().all(|&key| set.keyed.exact.has(key)));
        }
    }
}
