//! What tells the exploration that a marking is known: exact keys where they are short enough, else hashes.
//!
//! With keys (`span.rs`, `exact.rs`) a candidate is one word, and nothing else is computed of it until it has turned
//! out not to stand where it belongs. Up to 256 are gathered from the bit slices, and as soon as the
//! bucket of one is known the processor is asked for it (`ahead.rs`), so that the cache misses of all overlap; then the
//! buckets are compared, and those that are left are noted without a branch and compared with the next bucket: new ones, and
//! few known ones, are left then. Only these are looked up by a loop, and only of new ones the marking is made, into room
//! that was asked for once for all of them. Under hashes (`table.rs`) candidates are whole markings.
//!
//! Rejected: to look up each candidate in the pass that makes it (a tenth fewer instructions,
//! but so many stand between two reads of the table that few cache misses overlap: two fifths of the time was waiting).
//! Not tried: a small table of the latest hits before the large one; sorting many candidates by their place in the
//! table. Both would cost each look-up more instructions than are left in it.

use std::sync::OnceLock;

use crate::batch::Batch;
use crate::budget::{Memory, Stop, Watch};
use crate::exact::{Asked, Exact, ROOM};
use crate::indexes::Indexes;
use crate::marking::{Width, linear_hash};
use crate::net::Net;
use crate::pair::{Halves, Sides};
use crate::seat::Slot;
use crate::sleep::{Trail, last};
use crate::span::Span;
use crate::spread::Spread;
use crate::table::{Candidates, Table};

/// The least table for keys is not larger than this, and not than this part of what is allowed.
const LEAST_BYTES: usize = 1 << 22;
const LEAST_PART: usize = 64;

/// What tells known markings.
#[derive(Debug)]
pub enum Set {
    /// The table of hashes, beside this.
    Hashed,
    /// Exact keys in slots of 32 bits.
    Narrow(Keyed<u32>),
    /// Exact keys in slots of 64 bits.
    Wide(Keyed<u64>),
}

/// A set of exact keys, and, once somebody asked for them, the indexes of its markings (`indexes.rs`).
#[derive(Debug)]
pub struct Keyed<S> {
    /// The keys.
    pub span: Span,
    spread: Spread,
    /// All keys, while the exploration goes on.
    pub(crate) exact: Exact<S>,
    /// All keys where two threads have found the last of them: nobody asks for them in one table before `indexes.rs` does.
    pub(crate) halves: Option<Halves<S>>,
    pub(crate) indexes: OnceLock<Indexes<S>>,
}

impl Set {
    /// The narrowest set for a net.
    pub fn new(net: &Net, memory: &Memory) -> Self {
        let most = LEAST_BYTES.min(memory.limit() / LEAST_PART);
        let Some(span) = Span::new(net).filter(|span| span.flips.len() < 1 << 26) else { return Set::Hashed };
        if Exact::<u32>::least_bytes(span.bits) <= most {
            return Keyed::new(net, span, memory).map_or(Set::Hashed, Set::Narrow);
        }
        Keyed::new(net, span, memory).map_or(Set::Hashed, Set::Wide)
    }

    /// The keys; none where markings are hashed.
    #[inline(always)]
    pub fn span(&self) -> Option<&Span> {
        match self {
            Set::Hashed => None,
            Set::Narrow(keyed) => Some(&keyed.span),
            Set::Wide(keyed) => Some(&keyed.span),
        }
    }
}

impl<S: Slot> Keyed<S> {
    fn new(net: &Net, span: Span, memory: &Memory) -> Result<Self, Stop> {
        let spread = Spread::new(net, &span);
        memory.claim(spread.bytes())?;
        let exact = Exact::new(span.bits, memory)?;
        Ok(Keyed { span, spread, exact, halves: None, indexes: OnceLock::new() })
    }

    /// Whether a key is in the set.
    pub(crate) fn has(&self, key: u64) -> bool {
        self.halves.as_ref().map_or_else(|| self.exact.has(key), |halves| halves.has(key))
    }

    /// The keys, the way back from them, and the set itself.
    pub(crate) fn parts(&mut self) -> (&Span, &Spread, &mut Exact<S>) {
        (&self.span, &self.spread, &mut self.exact)
    }
}

/// Candidates on their way from firing transitions into the set.
pub(crate) trait Arrivals<W: Width> {
    /// Puts M0, all that is in the batch, into the empty set.
    fn first(&mut self, width: W, batch: &mut Batch, into: Into<'_, '_>) -> Result<(), Stop>;

    /// Slices a batch, with what the candidates are told by.
    fn cut(&self, width: W, batch: &mut Batch);

    /// Takes the marking that a transition makes of each of `fire`.
    fn push(&mut self, width: W, net: &Net, batch: &Batch, t: usize, fire: u64, into: Into<'_, '_>)
    -> Result<(), Stop>;

    /// Ends a batch, and with it a level or not.
    fn end(&mut self, width: W, net: &Net, batch: &Batch, level: bool, into: Into<'_, '_>) -> Result<(), Stop>;
}

/// Where new markings go and what they say, how many there may be, of what memory, and until when.
pub(crate) type Into<'a, 'b> = (&'a mut Table, &'a mut Trail, usize, &'a Memory, &'a mut Watch<'b>);

/// Arrivals told by their hash.
pub struct Hashed(Candidates);

impl Hashed {
    /// None yet.
    pub fn new(words: usize) -> Self {
        Hashed(Candidates::new(words))
    }

    #[inline(always)]
    fn settle<W: Width>(&mut self, width: W, into: Into<'_, '_>) -> Result<(), Stop> {
        let (table, trail, max, memory, watch) = into;
        table.make_room(width, self.0.len(), memory, watch)?;
        table.insert_batch(width, &mut self.0, trail, max, memory)
    }
}

impl<W: Width> Arrivals<W> for Hashed {
    fn first(&mut self, width: W, batch: &mut Batch, into: Into<'_, '_>) -> Result<(), Stop> {
        let (table, _, max, memory, _) = into;
        table.insert(width, &batch.markings, linear_hash(width, &batch.markings), max, memory)?;
        Ok(())
    }

    #[inline(always)]
    fn cut(&self, width: W, batch: &mut Batch) {
        batch.cut(width);
    }

    #[inline(always)]
    fn push(
        &mut self,
        width: W,
        net: &Net,
        batch: &Batch,
        t: usize,
        fire: u64,
        into: Into<'_, '_>,
    ) -> Result<(), Stop> {
        if self.0.push(width, batch, fire, (net.flip(t, width.words()), net.flip_hashes[t]), last(t)) {
            self.settle(width, into)?;
        }
        Ok(())
    }

    /// What is left waits for the next batch; only a level must be whole before it is taken up.
    #[inline(always)]
    fn end(&mut self, width: W, _: &Net, _: &Batch, level: bool, into: Into<'_, '_>) -> Result<(), Stop> {
        if level { self.settle(width, into) } else { Ok(()) }
    }
}

/// Arrivals told by their key.
pub struct ByKey<'a, S> {
    pub(crate) keyed: &'a mut Keyed<S>,
    pub(crate) asked: Asked<S>,
    /// The marking of the batch (low six bits) and the transition that made each.
    made: [u32; ROOM],
    /// While two threads explore, how the set is cut, and the table of each.
    pub(crate) sides: Option<Sides<S>>,
    /// What they have left, with nothing more to find, until the array holds it too.
    pub(crate) left: Option<Halves<S>>,
}

impl<'a, S: Slot> ByKey<'a, S> {
    /// None yet.
    pub fn new(keyed: &'a mut Keyed<S>) -> Self {
        ByKey { keyed, asked: Asked::new(), made: [0; ROOM], sides: None, left: None }
    }

    /// Looks up what came, and appends what is new.
    #[inline(always)]
    fn settle<W: Width>(&mut self, width: W, net: &Net, batch: &Batch, into: Into<'_, '_>) -> Result<(), Stop> {
        let (table, trail, max, memory, watch) = into;
        let (words, exact) = (width.words(), &mut self.keyed.exact);
        let open = exact.first_look(&mut self.asked);
        let (mut done, made, flips) = (0, &self.made, &net.flips);
        let (mut lasts, mut found) = ([0; ROOM], 0);
        while done < open {
            let mut room = table.store.room(open - done, max).chunks_exact_mut(words);
            let (all, mut is_full) = (room.len(), false);
            let end = exact.insert_open(&mut self.asked, &mut done, open, (memory, watch), |c| {
                let Some(to) = room.next() else {
                    is_full = true;
                    return Err(Stop::Memory);
                };
                let (j, t) = (made[c] as usize % 64, made[c] as usize / 64);
                let (from, flip) = (&batch.markings[j * words..][..words], &flips[t * words..][..words]);
                for k in 0..words {
                    to[k] = from[k] ^ flip[k];
                }
                lasts[found % ROOM] = last(t);
                found += 1;
                Ok(())
            });
            let new = all - room.len();
            table.store.add(new);
            if is_full {
                table.store.more_room(max, memory)?;
            } else {
                end?;
            }
        }
        trail.append(table.store.len() - found, &lasts[..found], memory);
        exact.answered(&mut self.asked, memory, watch)
    }
}

impl<W: Width, S: Slot> Arrivals<W> for ByKey<'_, S> {
    fn first(&mut self, width: W, batch: &mut Batch, into: Into<'_, '_>) -> Result<(), Stop> {
        let (table, _, max, memory, watch) = into;
        let key = self.keyed.span.key(&batch.markings);
        self.keyed.exact.ask(&mut self.asked, 1, |_| key, |_, _| ());
        let open = self.keyed.exact.first_look(&mut self.asked);
        let append = |_| table.store.push(width, &batch.markings, max, memory);
        self.keyed.exact.insert_open(&mut self.asked, &mut 0, open, (memory, watch), append)?;
        self.keyed.exact.answered(&mut self.asked, memory, watch)
    }

    #[inline(always)]
    fn cut(&self, width: W, batch: &mut Batch) {
        batch.cut_by(width, &self.keyed.span);
    }

    #[inline(always)]
    fn push(
        &mut self,
        width: W,
        net: &Net,
        batch: &Batch,
        t: usize,
        fire: u64,
        into: Into<'_, '_>,
    ) -> Result<(), Stop> {
        let flip = self.keyed.span.flips[t];
        let made = (t as u32) << 6;
        let note = |c: usize, j: u32| self.made[c] = made | j;
        self.keyed.exact.ask(&mut self.asked, fire, |j| batch.hashes[j] ^ flip, note);
        if self.asked.count >= ROOM - 64 { self.settle(width, net, batch, into) } else { Ok(()) }
    }

    #[inline(always)]
    fn end(&mut self, width: W, net: &Net, batch: &Batch, _: bool, into: Into<'_, '_>) -> Result<(), Stop> {
        self.settle(width, net, batch, into)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::explore::{Limits, Space};
    use crate::net::Transition;
    use crate::samples::{explore, machines};

    /// Eleven machines, and a chain that makes the keys long: their kind is that of the chain's length.
    fn chained(length: u32) -> Net {
        let mut transitions = machines(11, 0).transitions;
        transitions.extend((22..22 + length).map(|p| Transition::new(&[p], &[p + 1], &[0], &[], &[])));
        let marked: Vec<u32> = (0..12).map(|i| 2 * i).collect();
        Net::new(23 + length as usize, transitions, &marked).expect("well formed")
    }

    fn kind(set: &Set) -> u32 {
        match set {
            Set::Hashed => 0,
            Set::Narrow(_) => 32,
            Set::Wide(_) => 64,
        }
    }

    #[test]
    fn every_kind_of_set_numbers_markings_by_their_level() {
        for (length, expected) in [(20, 32), (40, 64), (60, 0)] {
            let limits = Limits { step: false, markings: 6_000, memory_bytes: 1 << 30, time: None };
            let space = Space::explore(chained(length), limits, &mut unwatched).expect("fits");
            assert_eq!((kind(&space.set), space.len()), (expected, 6_000));
            let mut poll = unwatched;
            space.index(&mut Watch::new(None, &mut poll)).expect("fits");
            // As the plain way finds them.
            let mut plain: Vec<Vec<u64>> = vec![space.net.initial.clone()];
            let mut levels = std::collections::HashMap::from([(plain[0].clone(), 0)]);
            let mut next = 0;
            while plain.len() < 18_000 && next < plain.len() {
                for t in space.enabled_by(&space.net.forward, &plain[next]) {
                    let flip = space.net.flip(t as usize, space.net.words);
                    let after: Vec<u64> = plain[next].iter().zip(flip).map(|(a, b)| a ^ b).collect();
                    let level = levels[&plain[next]] + 1;
                    levels.entry(after.clone()).or_insert_with(|| {
                        plain.push(after);
                        level
                    });
                }
                next += 1;
            }
            // The level that was not ended has no entry.
            let level_of = |index: usize| space.levels.partition_point(|&first| first as usize <= index) - 1;
            let mut last = 0;
            for index in 0..space.len() {
                let level = levels[space.marking(index)];
                assert!(level >= last && (level == level_of(index) || level == space.levels.len()));
                assert_eq!(space.find(space.marking(index)), Some(index as u32));
                last = level;
            }
        }
    }

    #[test]
    fn an_exploration_cut_short_finds_what_it_stored_and_nothing_else() {
        for most in [1, 5, 300, 777] {
            for memory_bytes in [40_000, 1 << 28] {
                let limits = Limits { step: false, markings: most, memory_bytes, time: None };
                let space = Space::explore(machines(11, 0), limits, &mut unwatched).expect("begins");
                assert!(space.stop.is_some());
                let stored: Vec<&[u64]> = (0..space.len()).map(|index| space.marking(index)).collect();
                for marking in explore(machines(11, 0), false).table.store.all().chunks(1).take(2048) {
                    let expected = stored.iter().position(|&stored| stored == marking);
                    assert_eq!(space.find(marking), expected.map(|index| index as u32));
                }
            }
        }
    }
}
