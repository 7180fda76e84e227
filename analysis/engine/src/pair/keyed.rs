//! A set of exact keys cut in two by a parity (`parting.rs`): each thread has a table of its own side, and grows it by itself.
//!
//! Most firings stay on their side, so most of what a thread does is what one alone would do, in a table half as
//! large. Of a firing that crosses a record is the key, and above it the transition. A marking is made of that where it is new; of one's own, of the
//! marking that is fired from, which takes less. Where something is left for one thread to do, both tables are put together.
//!
//! The set says no indexes, so nothing is numbered before the markings stand in the array, and the threads may go on from
//! level to level meanwhile.
//!
//! A thread grows its table when the other does, if it soon has to: else each would wait for the other's growth in turn.
//!
//! Rejected: to cut the one table in two by the highest bit of the mixed key, so that half of all firings cross (1.2 to 1.5
//! times as quick as one thread, where this is 1.5 to 1.9); to let both look into all of one table and hand over only what
//! they do not find (each reads what the other has just written, for which processors wait, and what is written and read at
//! once must be read word by word: no quicker than that; by vectors, which the language does not allow, 1.25 to 1.5).

use super::half::{Finds, Half, Shared, To};
use super::parting::Parting;
use crate::apart::Apart;
use crate::batch::Batch;
use crate::budget::{Memory, Stop, Watch};
use crate::exact::{Asked, Exact, ROOM};
use crate::explore::Space;
use crate::known::ByKey;
use crate::marking::Width;
use crate::net::Net;
use crate::seat::Slot;
use crate::sleep::{Sleeping, last};
use crate::span::Span;
use crate::spread::Spread;
use crate::store::Store;
use crate::table::Table;

/// How full a table is that grows before it has to, and how full one that grows because the other does.
const SOON_FULL: f64 = 0.7;
const ALSO_FULL: f64 = 0.5;

/// How a set is cut, and the tables of both sides once they are made.
pub(crate) struct Sides<S> {
    parting: Parting,
    tables: [Apart<Option<Exact<S>>>; 2],
}

/// The set as both threads have left it, with nothing more to find.
#[derive(Debug)]
pub(crate) struct Halves<S> {
    parting: Parting,
    tables: [Exact<S>; 2],
}

impl<S: Slot> Halves<S> {
    /// Whether a key is in the set.
    pub(crate) fn has(&self, key: u64) -> bool {
        self.tables[self.parting.of_key(key)].has(key)
    }

    /// Bytes claimed.
    pub(crate) fn claimed(&self) -> usize {
        self.tables.iter().map(Exact::claimed).sum()
    }

    /// All keys in one table.
    pub(crate) fn joint(&self, memory: &Memory) -> Result<Exact<S>, Stop> {
        Exact::joint([&self.tables[0], &self.tables[1]], memory)
    }
}

/// One side, in the hands of its thread.
pub(crate) struct KeyedHalf<'a, S> {
    id: usize,
    whole: &'a Exact<S>,
    table: &'a mut Option<Exact<S>>,
    parting: &'a Parting,
    span: &'a Span,
    spread: &'a Spread,
    asked: Asked<S>,
    /// The marking of the batch (low six bits) and the transition that made each.
    made: [u32; ROOM],
    /// Which markings of the batch are on this side.
    here: u64,
}

impl<W: Width, S: Slot> Half<W> for KeyedHalf<'_, S> {
    fn begin(&mut self, memory: &Memory, watch: &mut Watch<'_>) -> Result<(), Stop> {
        let is_here = |key| self.parting.of_key(key) == self.id;
        *self.table = Some(self.whole.side(is_here, memory, watch)?);
        Ok(())
    }

    #[inline(always)]
    fn stride(&self, _: W) -> usize {
        1
    }

    #[inline(always)]
    fn cut(&mut self, width: W, batch: &mut Batch) {
        batch.cut_by(width, self.span);
        let others = self.parting.of_batch(&batch.slices);
        self.here = if self.id == 0 { !others } else { others };
    }

    #[inline(always)]
    fn push(&mut self, width: W, net: &Net, batch: &Batch, t: usize, fire: u64, to: To<'_, '_>) {
        let (flip, made, told) = (self.span.flips[t], (t as u32) << 6, self.span.told(last(t)));
        let staying = if self.parting.crosses[t] { !self.here } else { self.here };
        let mut rest = fire & !staying;
        let (theirs, len) = to.theirs;
        while rest != 0 {
            theirs[*len] = batch.hashes[rest.trailing_zeros() as usize] ^ flip | told;
            *len += 1;
            rest &= rest - 1;
        }
        let note = |c: usize, j: u32| self.made[c] = made | j;
        made_before(self.table).ask(&mut self.asked, fire & staying, |j| batch.hashes[j] ^ flip, note);
        if self.asked.count >= ROOM - 64 {
            self.settle(width, net, batch, to.finds, to.watch);
        }
    }

    /// A marking is made of the one that is fired from, so nothing waits for another batch.
    #[inline(always)]
    fn end(&mut self, width: W, net: &Net, batch: &Batch, _: bool, to: To<'_, '_>) {
        self.settle(width, net, batch, to.finds, to.watch);
    }

    fn wants_room(&self, other_does: bool) -> bool {
        let full = self.table.as_ref().map_or(0.0, Exact::fullness);
        full > if other_does { ALSO_FULL } else { SOON_FULL }
    }

    fn take_room(&mut self, finds: &mut Finds, watch: &mut Watch<'_>) {
        // Without memory for that it goes on until it is full.
        match made_before(self.table).double(&finds.memory, watch) {
            Ok(()) | Err(Stop::Memory) => {}
            Err(stop) => finds.close(stop),
        }
    }

    #[inline(always)]
    fn insert(&mut self, width: W, records: &[u64], finds: &mut Finds, watch: &mut Watch<'_>) {
        let (table, asked) = (made_before(self.table), &mut self.asked);
        let (span, spread) = (self.span, self.spread);
        for keys in records.chunks(ROOM) {
            for some in keys.chunks(64) {
                table.ask(asked, !0 >> (64 - some.len()), |j| span.key_in(some[j]), |_, _| ());
            }
            take(width, (table, asked), finds, watch, |c, marking| {
                spread.marking(span.key_in(keys[c]), marking);
                span.last_in(keys[c])
            });
        }
    }
}

impl<S: Slot> KeyedHalf<'_, S> {
    /// Looks up what a batch has made, and takes what is new.
    #[inline(always)]
    fn settle<W: Width>(&mut self, width: W, net: &Net, batch: &Batch, finds: &mut Finds, watch: &mut Watch<'_>) {
        let (words, made) = (width.words(), &self.made);
        take(width, (made_before(self.table), &mut self.asked), finds, watch, |c, marking| {
            let (j, t) = (made[c] as usize % 64, made[c] as usize / 64);
            let (from, flip) = (&batch.markings[j * words..][..words], &net.flips[t * words..][..words]);
            for k in 0..words {
                marking[k] = from[k] ^ flip[k];
            }
            last(t)
        });
    }
}

/// Looks up what is asked of a table, and takes what is new, each marking, and what it says, made of its number; then nothing is asked any
/// more. Once something found no room, nothing new goes into the table, and what is new is left over.
#[inline(always)]
fn take<W: Width, S: Slot>(
    width: W,
    (table, asked): (&mut Exact<S>, &mut Asked<S>),
    finds: &mut Finds,
    watch: &mut Watch<'_>,
    make: impl Fn(usize, &mut [u64]) -> u16,
) {
    let (open, mut done) = (table.first_look(asked), 0);
    let (mut lasts, mut found) = ([0; ROOM], 0);
    while done < open {
        let mut room = finds.fresh.room(open - done, finds.most).chunks_exact_mut(width.words());
        let (all, mut is_full) = (room.len(), false);
        let full = table.insert(asked, &mut done, open, &mut |c| {
            let Some(to) = room.next() else {
                is_full = true;
                return Err(Stop::Memory);
            };
            lasts[found % ROOM] = make(c, to);
            found += 1;
            Ok(())
        });
        let new = all - room.len();
        finds.fresh.add(new);
        if done == open {
            break;
        }
        let more = match full {
            Err(_) if is_full => finds.fresh.more_room(finds.most, &finds.memory),
            end => end.and_then(|()| table.grow_asked(asked, &finds.memory, watch)),
        };
        if let Err(stop) = more {
            finds.close(stop);
            finds.left.push(table.asked_key(asked, done));
            done += 1;
        }
    }
    finds.trail.append(finds.fresh.len() - found, &lasts[..found], &finds.memory);
    if let Err(stop) = table.answered(asked, &finds.memory, watch) {
        finds.close(stop);
    }
}

/// The table that a thread makes before anything else.
#[inline(always)]
fn made_before<S>(table: &mut Option<Exact<S>>) -> &mut Exact<S> {
    table.as_mut().expect("a thread begins with its table")
}

impl<W: Width, S: Slot> Shared<W> for ByKey<'_, S> {
    type Half<'a>
        = KeyedHalf<'a, S>
    where
        Self: 'a;
    const GOES_ON: bool = true;

    fn cut(&mut self, width: W, space: &Space, sleeping: &Sleeping, loss_most: f64) -> bool {
        let (span, spread, _) = self.keyed.parts();
        let from = [2, 1].map(|levels| space.levels[space.levels.len().saturating_sub(levels)] as usize);
        let parting = Parting::choose(width, space, (span, spread), from, sleeping, loss_most);
        self.sides = parting.map(|parting| Sides { parting, tables: [Apart(None), Apart(None)] });
        self.sides.is_some()
    }

    fn halves<'a>(&'a mut self, table: &'a mut Table) -> (&'a Store, [KeyedHalf<'a, S>; 2]) {
        let (span, spread, whole) = self.keyed.parts();
        let whole = &*whole;
        let Sides { parting, tables: [Apart(low), Apart(high)] } = self.sides.as_mut().expect("cut before");
        let half = |(id, table)| KeyedHalf {
            id,
            whole,
            table,
            parting: &*parting,
            span,
            spread,
            asked: Asked::new(),
            made: [0; ROOM],
            here: 0,
        };
        (&table.store, [(0, low), (1, high)].map(half))
    }

    /// Time is not asked for here: without the joint table all that was found would be lost.
    fn complete(&mut self, _: W, space: &mut Space, finds: [&Finds; 2]) -> Result<(), Stop> {
        let Some(Sides { parting, tables: [Apart(low), Apart(high)] }) = self.sides.take() else { return Ok(()) };
        for (of, table) in finds.iter().zip([&low, &high]) {
            of.memory.release(table.as_ref().map_or(0, Exact::claimed));
        }
        // What was found before is in the one table, and nothing else was found.
        if finds.iter().all(|of| of.fresh.is_empty()) {
            return Ok(());
        }
        let [Some(low), Some(high)] = [low, high] else { unreachable!("who has found something has begun") };
        let (whole, memory) = (&mut self.keyed.exact, &space.memory);
        if finds.iter().all(|of| of.is_over()) {
            let halves = Halves { parting, tables: [low, high] };
            memory.claim(halves.claimed())?;
            self.left = Some(halves);
            return Ok(());
        }
        let joint = Exact::joint([&low, &high], memory)?;
        memory.release(whole.claimed());
        *whole = joint;
        Ok(())
    }

    fn seal(&mut self, space: &Space) {
        if let Some(halves) = self.left.take() {
            space.memory.release(self.keyed.exact.claimed());
            self.keyed.exact = Exact::none(self.keyed.span.bits);
            self.keyed.halves = Some(halves);
        }
    }

    fn grow(&mut self, _: W, _: &mut Space, _: &mut Watch<'_>) -> Result<bool, Stop> {
        unreachable!("each thread grows its table by itself, so none ends because it is full")
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

    fn forget_others(&mut self, width: W, space: &mut Space) {
        self.sides = None;
        let left = self.left.take();
        let (span, _, exact) = self.keyed.parts();
        if let Some(halves) = left {
            // Without memory for that, it says less than the array holds.
            if let Ok(joint) = halves.joint(&space.memory) {
                space.memory.release(exact.claimed());
                *exact = joint;
            }
            space.memory.release(halves.claimed());
        }
        let (store, words) = (&space.table.store, width.words());
        let keys = || store.all()[..store.len() * words].chunks_exact(words).map(|marking| span.key(marking));
        exact.replace_by(keys, store.len(), &space.memory);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::explore::Limits;
    use crate::known::Set;
    use crate::marking::Fixed;
    use crate::samples::{explore, machines};

    #[test]
    fn what_is_not_in_the_array_is_forgotten() {
        let limits = Limits { step: false, markings: 300, memory_bytes: 1 << 28, time: None };
        let mut space = Space::explore(machines(11, 0), limits, &mut unwatched).expect("begins");
        let Set::Narrow(mut keyed) = std::mem::replace(&mut space.set, Set::Hashed) else { panic!("few bits") };
        let (mut set, mut poll) = (ByKey::new(&mut keyed), unwatched);
        let mut watch = Watch::new(None, &mut poll);
        let all = explore(machines(11, 0), false);
        for index in 0..all.len() {
            let key = set.keyed.span.key(all.marking(index));
            set.keyed.exact.put(&mut set.asked, key, (&space.memory, &mut watch), || Ok(())).expect("fits");
        }
        for in_halves in [false, true] {
            // What was found may still be in halves when there turns out to be no room for it.
            if in_halves {
                let (sleeping, mut poll) = (Sleeping::new(&space.net, &space.memory), unwatched);
                let (span, spread, exact) = set.keyed.parts();
                let anyhow = f64::INFINITY;
                let parting = Parting::choose(Fixed::<1>, &space, (span, spread), [0, 0], &sleeping, anyhow);
                sleeping.leave(&space.memory);
                let parting = parting.expect("whatever it loses");
                let mut watch = Watch::new(None, &mut poll);
                let tables = [0, 1]
                    .map(|id| exact.side(|key| parting.of_key(key) == id, &space.memory, &mut watch).expect("fits"));
                set.left = Some(Halves { parting, tables });
            }
            Shared::<Fixed<1>>::forget_others(&mut set, Fixed::<1>, &mut space);
            assert!(set.keyed.halves.is_none() && set.left.is_none());
        }
        let stored: Vec<&[u64]> = (0..space.len()).map(|index| space.marking(index)).collect();
        assert_eq!(stored.len(), 300);
        for index in 0..all.len() {
            let marking = all.marking(index);
            assert_eq!(set.keyed.exact.has(set.keyed.span.key(marking)), stored.contains(&marking));
        }
    }
}
