//! The halves of a set of exact keys: a record is a key, and its marking is made of it where it is new.
//!
//! The set says no indexes, so nothing is numbered before the markings stand in the array.

use super::half::{End, Finds, Half, Shared};
use crate::batch::Batch;
use crate::budget::Stop;
use crate::exact::halves::{HalfExact, Sought};
use crate::exact::{Asked, ROOM};
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
    /// Keys of its own that wait, and room for those that come.
    asked: Box<Asked<S>>,
    came: Box<Asked<S>>,
    span: &'a Span,
    spread: &'a Spread,
    /// New keys that there is room for.
    room: usize,
    marking: Vec<u64>,
}

impl<W: Width, S: Slot> Half<W> for KeyedHalf<'_, S> {
    #[inline(always)]
    fn stride(&self, _: W) -> usize {
        1
    }

    #[inline(always)]
    fn cut(&self, width: W, batch: &mut Batch) {
        batch.cut_by(width, self.span);
    }

    #[inline(always)]
    fn push(&mut self, _: W, _: &Net, batch: &Batch, t: usize, fire: u64, theirs: (&mut [u64], &mut usize)) {
        let flip = self.span.flips[t];
        self.half.ask(&mut self.asked, fire, |j| batch.hashes[j] ^ flip, theirs);
    }

    #[inline(always)]
    fn settle(&mut self, width: W, all: bool, finds: &mut Finds) {
        if all || self.asked.count >= ROOM - 64 {
            let mut asked = std::mem::take(&mut self.asked);
            self.put(width, &mut asked, finds);
            self.asked = asked;
        }
    }

    #[inline(always)]
    fn insert(&mut self, width: W, records: &[u64], finds: &mut Finds) {
        let mut asked = std::mem::take(&mut self.came);
        for keys in records.chunks(ROOM - 64) {
            self.half.ask_all(&mut asked, keys);
            self.put(width, &mut asked, finds);
        }
        self.came = asked;
    }
}

impl<S: Slot> KeyedHalf<'_, S> {
    /// Looks up what was asked, and takes what is new.
    #[inline(always)]
    fn put<W: Width>(&mut self, width: W, asked: &mut Asked<S>, finds: &mut Finds) {
        for k in 0..self.half.look(asked) {
            let c = usize::from(asked.open[k % ROOM]);
            match self.half.seek(asked, c) {
                Sought::Known => {}
                Sought::Past => finds.leave(&[self.half.key(asked, c)]),
                Sought::Free(slot) if finds.fresh.len() < self.room => {
                    let key = self.half.key(asked, c);
                    let marking = &mut self.marking[..width.words()];
                    self.spread.marking(key, marking);
                    let (fresh, memory) = (&mut finds.fresh, &finds.memory);
                    if fresh.len() < finds.most && fresh.push(width, marking, finds.most, memory).is_ok() {
                        self.half.take(asked, c, slot);
                    } else {
                        finds.end(End::Short);
                        finds.left.push(key);
                    }
                }
                Sought::Free(_) => {
                    finds.end(End::Full);
                    finds.left.push(self.half.key(asked, c));
                }
            }
        }
        asked.count = 0;
    }
}

impl<W: Width, S: Slot> Shared<W> for ByKey<'_, S> {
    type Half<'a>
        = KeyedHalf<'a, S>
    where
        Self: 'a;

    fn halves<'a>(&'a mut self, table: &'a mut Table) -> (&'a Store, [KeyedHalf<'a, S>; 2]) {
        let store = &table.store;
        let (span, spread, exact) = self.keyed.parts();
        // As full as one thread would let it become, if both halves were equally full.
        let room = exact.free() / 2;
        let half = |half| {
            let (asked, came, marking) = (Box::default(), Box::default(), vec![0; spread.words()]);
            KeyedHalf { half, asked, came, span, spread, room, marking }
        };
        (store, exact.halves().map(half))
    }

    fn renumber(&mut self, _: W, _: &mut Space, finds: [&Finds; 2], _: usize) -> Result<(), Stop> {
        self.keyed.parts().2.count(finds[0].fresh.len() + finds[1].fresh.len());
        Ok(())
    }

    fn grow(&mut self, _: W, space: &mut Space) -> Result<bool, Stop> {
        self.keyed.parts().2.grow_by_two(&mut self.asked, &space.memory)
    }

    fn insert_left(&mut self, width: W, space: &mut Space, records: &[u64], max: usize) -> Result<(), Stop> {
        let (_, spread, exact) = self.keyed.parts();
        let mut marking = vec![0; width.words()];
        for &key in records {
            let store = &mut space.table.store;
            exact.put(&mut self.asked, key, &space.memory, || {
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
