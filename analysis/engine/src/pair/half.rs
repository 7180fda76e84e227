//! What the two threads of a pair share out: a set of markings in two halves.
//!
//! A candidate goes from thread to thread as a *record* of a few words, which says what it is and where it belongs. Which
//! words these are is the set's affair: a key (`keyed.rs`), or a hash with a marking (`hashed.rs`); and by which transition it was
//! found.

use crate::batch::Batch;
use crate::budget::{Memory, Stop, Watch};
use crate::explore::Space;
use crate::known::Arrivals;
use crate::marking::Width;
use crate::net::Net;
use crate::sleep::{Sleeping, Trail};
use crate::store::Store;
use crate::table::Table;

/// Markings that are dealt out together, and numbered together.
pub(crate) const BLOCK: usize = 64;
/// Finds past the end of a half that a thread keeps in a level before one thread takes over.
const STRAYS_MAX: usize = 1 << 12;

/// Why a thread ends before the level is done; the last is the most urgent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum End {
    /// Its half is full.
    Full,
    /// Its share of a budget is used up.
    Short,
    /// Time is over, or nobody needs the answer.
    Stopped(Stop),
}

/// What one thread finds until it ends.
pub(crate) struct Finds {
    /// Which thread, 0 or 1.
    pub(crate) id: usize,
    /// What it may hold.
    pub(crate) memory: Memory,
    /// The markings.
    pub(crate) fresh: Store,
    /// By which transitions those of the last two levels were found, by their place among the finds.
    pub(crate) trail: Trail,
    /// How many of them it found in each level.
    pub(crate) levels: Vec<usize>,
    /// How many there may be.
    pub(crate) most: usize,
    /// What found no place, as `Shared::insert_left` takes it, and how much of it for good.
    pub(crate) left: Vec<u64>,
    strays: usize,
    /// Why it must end.
    pub(crate) end: Option<End>,
}

impl Finds {
    /// Nothing yet.
    pub(crate) fn new(id: usize, words: usize) -> Self {
        Finds {
            id,
            memory: Memory::new(0),
            fresh: Store::new(words),
            trail: Trail::default(),
            levels: Vec::new(),
            most: 0,
            left: Vec::new(),
            strays: 0,
            end: None,
        }
    }

    /// Begins to work, with so many bytes more than are held and so many markings.
    pub(crate) fn allow(&mut self, bytes: usize, markings: usize) {
        let held = self.memory.used();
        self.memory.allow(held + bytes);
        (self.most, self.strays, self.end) = (markings, 0, None);
        self.levels.clear();
    }

    /// Ends for a reason, if not for one more urgent.
    #[cold]
    pub(crate) fn end(&mut self, end: End) {
        self.end = self.end.max(Some(end));
    }

    /// Ends because there is no room, or no time, for what is found; it takes nothing more.
    #[cold]
    pub(crate) fn close(&mut self, stop: Stop) {
        self.most = self.fresh.len();
        self.end(match stop {
            Stop::Markings | Stop::Memory => End::Short,
            stop => End::Stopped(stop),
        });
    }

    /// Whether it has found nothing more in the last level, and has expanded its share of that to the end.
    pub(crate) fn is_over(&self) -> bool {
        self.levels.last() == Some(&0) && self.end.is_none() && self.left.is_empty()
    }

    /// Keeps what finds no place in the half.
    #[cold]
    pub(crate) fn leave(&mut self, record: &[u64]) {
        self.left.extend_from_slice(record);
        self.strays += 1;
        if self.strays >= STRAYS_MAX {
            self.end(End::Short);
        }
    }
}

/// Where candidates go: what is new to the finds, what is the other's to the end of his records, of which so many words are
/// used.
pub(crate) struct To<'a, 'b> {
    pub(crate) finds: &'a mut Finds,
    pub(crate) theirs: (&'a mut [u64], &'a mut usize),
    pub(crate) watch: &'a mut Watch<'b>,
}

/// A half of a set, in the hands of its thread.
pub(crate) trait Half<W: Width>: Send {
    /// Makes what the thread works on, of memory of its finds.
    fn begin(&mut self, memory: &Memory, watch: &mut Watch<'_>) -> Result<(), Stop>;

    /// The words of a record.
    fn stride(&self, width: W) -> usize;

    /// Slices a batch, with what its records need.
    fn cut(&mut self, width: W, batch: &mut Batch);

    /// Takes the markings that a transition makes of each of `fire`. Those of this half go into it, or wait; the records of
    /// the others are written to `to.theirs`, which has room for all and one more.
    fn push(&mut self, width: W, net: &Net, batch: &Batch, t: usize, fire: u64, to: To<'_, '_>);

    /// Ends a batch, and with it a round or not: then nothing may wait any more.
    fn end(&mut self, width: W, net: &Net, batch: &Batch, round: bool, to: To<'_, '_>);

    /// Whether it will soon take more room, or could as well take it now, where the other one does.
    fn wants_room(&self, other_does: bool) -> bool;

    /// Takes more room, if there is memory for that.
    fn take_room(&mut self, finds: &mut Finds, watch: &mut Watch<'_>);

    /// Puts records that came from the other half into this one; new markings go to the finds.
    fn insert(&mut self, width: W, records: &[u64], finds: &mut Finds, watch: &mut Watch<'_>);
}

/// A set that can be halved.
pub(crate) trait Shared<W: Width>: Arrivals<W> {
    /// A half.
    type Half<'a>: Half<W>
    where
        Self: 'a;

    /// Whether the threads may go on to the next level with what they found: where the set says no indexes.
    const GOES_ON: bool;

    /// Says how the set is cut for the level that was found last, by what sleeps there; false where more than that part of two
    /// threads' time would be lost.
    fn cut(&mut self, width: W, space: &Space, sleeping: &Sleeping, loss_most: f64) -> bool;

    /// The array of markings, and the two halves.
    fn halves<'a>(&'a mut self, table: &'a mut Table) -> (&'a Store, [Self::Half<'a>; 2]);

    /// Makes the set say all that was found, by the indexes that the markings are about to get in the array: in each level
    /// in turn `BLOCK` of each thread, as long as both have them, then what one and the other have more. Of the memory of
    /// the finds the set holds nothing any more. After an error it holds what it held before, or needs
    /// `forget_others`.
    fn complete(&mut self, width: W, space: &mut Space, finds: [&Finds; 2]) -> Result<(), Stop>;

    /// Takes the set as it was completed for good: the array holds all that it says.
    fn seal(&mut self, space: &Space);

    /// Makes room for more; false where there is no memory for that. After an error the set cannot be used any
    /// more. A set that goes on from level to level is never asked.
    fn grow(&mut self, width: W, space: &mut Space, watch: &mut Watch<'_>) -> Result<bool, Stop>;

    /// Puts what found no place in its half into the whole set: keys, or records of markings.
    fn insert_left(
        &mut self,
        width: W,
        space: &mut Space,
        records: &[u64],
        max: usize,
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop>;

    /// Forgets what is not in the array.
    fn forget_others(&mut self, width: W, space: &mut Space);
}
