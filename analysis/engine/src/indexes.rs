//! The indexes of markings beside their keys: what the methods that go along edges ask for.
//!
//! Exploring needs no index, so the table of keys (`exact.rs`) has none. Whoever asks first has the table copied, each
//! bucket followed by the indexes of its eight keys. Key and index then stand in one line of the cache, and a look-up
//! is one miss, as while exploring. It costs 8 bytes a slot (16 where slots have 64 bits), held for as long as the
//! graph. A set that two threads have left in halves is put together for that, and stays in halves beside it.
//!
//! Rejected: indexes in an array of their own beside the table (half the memory, but a second miss: storing all edges
//! then takes a third longer); to build them while exploring (each growth would move them, and most questions never
//! ask); a table of hashes and indexes with a look at the marking itself (no further memory, and two misses too).

use crate::ahead::fetch;
use crate::batch::Batch;
use crate::budget::{Memory, Stop, Watch};
use crate::exact::{Exact, ROOM};
use crate::explore::Space;
use crate::known::{Keyed, Set};
use crate::marking::{Width, linear_hash};
use crate::net::Net;
use crate::region::Region;
use crate::seat::{LANES, REACH, Shape, Slot};
use crate::store::Store;
use crate::table::NONE;
use crate::with_width;

/// A bucket of slots and the indexes of their keys.
const LINE: usize = 2 * LANES;

/// What is asked for together, and found: kept by whoever asks, because to empty such arrays takes longer than to ask.
#[derive(Debug)]
pub struct Asking {
    /// The line where each key belongs, or stands, and what stands there.
    lines: [u32; ROOM],
    wanted: [u64; ROOM],
    /// Those that are not where they belong.
    open: [u8; ROOM],
    found: [u32; ROOM],
}

impl Asking {
    /// Nothing yet.
    pub fn new() -> Self {
        Asking { lines: [0; ROOM], wanted: [0; ROOM], open: [0; ROOM], found: [NONE; ROOM] }
    }
}

impl Default for Asking {
    fn default() -> Self {
        Asking::new()
    }
}

/// Keys and indexes.
#[derive(Debug)]
pub struct Indexes<S> {
    lines: Region<S>,
    shape: Shape,
}

/// The slots of a line.
#[inline(always)]
fn slots<S>(line: &[S; LINE]) -> &[S; LANES] {
    line.first_chunk().expect("a line is longer")
}

impl<S: Slot> Indexes<S> {
    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.lines.all())
    }

    /// The indexes of all markings, whose keys are in the set.
    fn new<W: Width>(
        width: W,
        keyed: &Keyed<S>,
        (net, store): (&Net, &Store),
        memory: &Memory,
        watch: &mut Watch<'_>,
    ) -> Result<Self, Stop> {
        let joint = keyed.halves.as_ref().map(|halves| halves.joint(memory)).transpose()?;
        let exact = joint.as_ref().unwrap_or(&keyed.exact);
        let result = Self::of(width, (keyed, exact), (net, store), memory, watch);
        memory.release(joint.as_ref().map_or(0, Exact::claimed));
        result
    }

    fn of<W: Width>(
        width: W,
        (keyed, exact): (&Keyed<S>, &Exact<S>),
        (net, store): (&Net, &Store),
        memory: &Memory,
        watch: &mut Watch<'_>,
    ) -> Result<Self, Stop> {
        let from = exact.all();
        let bytes = 2 * size_of_val(from);
        memory.claim(bytes)?;
        let Some(lines) = Region::zeroed(2 * from.len()) else {
            memory.release(bytes);
            return Err(Stop::Memory);
        };
        let mut indexes = Indexes { lines, shape: exact.shape() };
        let fill = indexes.fill(width, keyed, from, (net, store), watch);
        fill.inspect_err(|_| memory.release(bytes)).map(|()| indexes)
    }

    fn fill<W: Width>(
        &mut self,
        width: W,
        keyed: &Keyed<S>,
        from: &[S],
        (net, store): (&Net, &Store),
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        let lines = self.lines.all_mut().as_chunks_mut::<LINE>().0;
        for (line, bucket) in lines.iter_mut().zip(from.as_chunks::<LANES>().0) {
            line[..LANES].copy_from_slice(bucket);
        }
        let mut batch = Batch::new(net);
        let (mut keys, mut asking) = ([0; ROOM], Asking::new());
        for first in (0..store.len()).step_by(ROOM) {
            let end = store.len().min(first + ROOM);
            for (part, keys) in (first..end).step_by(64).zip(keys.chunks_mut(64)) {
                batch.markings.clear();
                store.copy_range(part, end.min(part + 64), &mut batch.markings);
                batch.cut_by(width, &keyed.span);
                keys.copy_from_slice(&batch.hashes);
            }
            self.seek(&keys[..end - first], &mut asking, |_, lane| lane as u32);
            let lines = self.lines.all_mut().as_chunks_mut::<LINE>().0;
            for (c, index) in (first..end).enumerate() {
                // No key is ever lost. Were one, its marking would be unknown, and take no other index than its own.
                if asking.found[c] != NONE {
                    lines[asking.lines[c] as usize][LANES + asking.found[c] as usize % LANES] = S::new(index as u64);
                }
            }
            watch.tick(end - first)?;
        }
        Ok(())
    }

    /// What `value` makes of the line and the lane of each key; `NONE` where it is not in the set. Loops over numbers, as in
    /// `exact.rs`.
    #[inline(always)]
    fn seek(&self, keys: &[u64], asking: &mut Asking, value: impl Fn(&[S; LINE], usize) -> u32) {
        let (shape, lines) = (self.shape, self.lines.all().as_chunks::<LINE>().0);
        let count = keys.len().min(ROOM);
        for (c, &key) in keys.iter().enumerate().take(ROOM) {
            let (line, wanted) = shape.seat::<S>(shape.mix(key));
            fetch(lines, line);
            asking.lines[c] = line as u32;
            asking.wanted[c] = wanted.get();
        }
        let mut open = 0;
        for c in 0..count {
            let line = &lines[asking.lines[c] as usize];
            let found = S::matches(slots(line), S::new(asking.wanted[c]));
            // Where it is not there, whatever is said is said again below.
            asking.found[c] = value(line, found.trailing_zeros() as usize % LANES);
            asking.open[open % ROOM] = c as u8;
            open += usize::from(found == 0);
        }
        // Most of them stand in the next line (see `exact.rs`).
        let mut left = 0;
        for k in 0..open {
            let c = usize::from(asking.open[k % ROOM]);
            let next = asking.lines[c] as usize + 1;
            let found = S::matches(slots(&lines[next]), S::new(asking.wanted[c] + 1));
            asking.found[c] = value(&lines[next], found.trailing_zeros() as usize % LANES);
            asking.open[left % ROOM] = c as u8;
            left += usize::from(found == 0);
            asking.lines[c] += u32::from(found != 0);
        }
        for k in 0..left {
            let c = usize::from(asking.open[k % ROOM]);
            let (line, lane) = self.search(asking.lines[c] as usize, S::new(asking.wanted[c]));
            asking.lines[c] = line as u32;
            asking.found[c] = if lane < LANES { value(&lines[line], lane) } else { NONE };
        }
    }

    /// Line and lane of one key, in all buckets where it may be; the lane is `LANES` where it is not in the set.
    fn search(&self, home: usize, wanted: S) -> (usize, usize) {
        for (moved, line) in self.lines.all().as_chunks::<LINE>().0[home..home + REACH].iter().enumerate() {
            let found = S::matches(slots(line), S::new(wanted.get() + moved as u64));
            if found != 0 {
                return (home + moved, found.trailing_zeros() as usize);
            }
            if S::matches(slots(line), S::new(0)) != 0 {
                break;
            }
        }
        (home, LANES)
    }

    /// The index of the marking with a key.
    fn find_one(&self, key: u64) -> Option<u32> {
        let (home, wanted) = self.shape.seat(self.shape.mix(key));
        let (line, lane) = self.search(home, wanted);
        (lane < LANES).then(|| self.lines.all()[line * LINE + LANES + lane].get() as u32)
    }

    /// The index of the marking with each of up to `ROOM` keys, `NONE` where there is none.
    #[inline(always)]
    fn find(&self, keys: &[u64], asking: &mut Asking) {
        self.seek(keys, asking, |line, lane| line[LANES + lane].get() as u32);
    }
}

impl<S: Slot> Keyed<S> {
    fn index<W: Width>(
        &self,
        width: W,
        of: (&Net, &Store),
        memory: &Memory,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        if self.indexes.get().is_none() {
            let indexes = Indexes::new(width, self, of, memory, watch)?;
            if let Err(second) = self.indexes.set(indexes) {
                // Somebody has done the same meanwhile.
                memory.release(second.bytes());
            }
        }
        Ok(())
    }

    /// The index of a marking and its key. Without `index` before, which needs memory, the store is searched through.
    fn find_one<W: Width>(&self, width: W, store: &Store, marking: &[u64], key: u64) -> Option<u32> {
        if let Some(indexes) = self.indexes.get() {
            return indexes.find_one(key);
        }
        let known = self.has(key);
        (0..store.len()).find(|&index| known && store.get(width, index) == marking).map(|index| index as u32)
    }

    #[inline(always)]
    fn find(&self, keys: &[u64], asking: &mut Asking) {
        match self.indexes.get() {
            Some(indexes) => indexes.find(keys, asking),
            None => asking.found.fill(NONE),
        }
    }
}

impl Set {
    /// The indexes of up to `ROOM` markings by their keys, after `Space::index`; none where markings are hashed.
    #[inline(always)]
    pub fn find<'a>(&self, keys: &[u64], asking: &'a mut Asking) -> Option<&'a [u32]> {
        match self {
            Set::Hashed => return None,
            Set::Narrow(keyed) => keyed.find(keys, asking),
            Set::Wide(keyed) => keyed.find(keys, asking),
        }
        Some(&asking.found[..keys.len()])
    }
}

impl Space {
    /// Slices a batch, with the hashes that `find_told` asks for.
    #[inline(always)]
    pub fn cut<W: Width>(&self, width: W, batch: &mut Batch) {
        match self.set.span() {
            None => batch.cut(width),
            Some(span) => batch.cut_by(width, span),
        }
    }

    /// What a firing changes in these hashes.
    #[inline(always)]
    pub fn flip_hash(&self, t: usize) -> u64 {
        self.set.span().map_or_else(|| self.net.flip_hashes[t], |span| span.flips[t])
    }

    /// Makes it quick to find the indexes of markings.
    pub fn index(&self, watch: &mut Watch<'_>) -> Result<(), Stop> {
        with_width!(self.net.words, width => match &self.set {
            Set::Hashed => Ok(()),
            Set::Narrow(keyed) => keyed.index(width, (&self.net, &self.table.store), &self.memory, watch),
            Set::Wide(keyed) => keyed.index(width, (&self.net, &self.table.store), &self.memory, watch),
        })
    }

    /// The index of a marking one firing before or after a known one, if it was found, by its hash.
    #[inline(always)]
    pub fn find_told<W: Width>(&self, width: W, marking: &[u64], hash: u64) -> Option<u32> {
        match &self.set {
            Set::Hashed => self.table.find(width, marking, hash),
            Set::Narrow(keyed) => keyed.find_one(width, &self.table.store, marking, hash),
            Set::Wide(keyed) => keyed.find_one(width, &self.table.store, marking, hash),
        }
    }

    /// Whether a marking was found; where markings have keys, another one may stand for one that was not.
    pub fn may_hold<W: Width>(&self, width: W, marking: &[u64]) -> bool {
        match &self.set {
            Set::Hashed => self.table.find(width, marking, linear_hash(width, marking)).is_some(),
            Set::Narrow(keyed) => keyed.has(keyed.span.key(marking)),
            Set::Wide(keyed) => keyed.has(keyed.span.key(marking)),
        }
    }

    /// The index of any marking, if it was found.
    pub fn find(&self, marking: &[u64]) -> Option<u32> {
        with_width!(self.net.words, width => {
            let told = self.set.span().map_or_else(|| linear_hash(width, marking), |span| span.key(marking));
            let found = self.find_told(width, marking, told);
            // A key tells only reachable markings apart.
            found.filter(|&index| self.marking(index as usize) == marking)
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::samples::{explore, machines, random_spaces};

    #[test]
    fn a_marking_out_of_reach_is_not_found_even_where_its_key_is_that_of_another() {
        let space = explore(machines(3, 0), false);
        // Both places of a machine are full: one of them decides the key.
        assert_eq!(space.find(&[0b01_01_11]), None);
        assert_eq!(space.find(&[0b01_01_01]), Some(0));
        for space in random_spaces(200, false) {
            assert!((0..space.len()).all(|index| space.find(space.marking(index)) == Some(index as u32)));
        }
    }
}
