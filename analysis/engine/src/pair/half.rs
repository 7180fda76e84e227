//! What the two threads of a pair share out: a set of markings in two halves, by the highest bit of the mixed key or hash.
//!
//! A candidate goes from thread to thread as a *record* of a few words, which says where it belongs and what it is. Which
//! words these are is the set's affair: the place of a key (`keyed.rs`), or a hash with a marking (`hashed.rs`).

use crate::batch::Batch;
use crate::budget::{Memory, Stop, Watch};
use crate::explore::Space;
use crate::known::Arrivals;
use crate::marking::Width;
use crate::net::Net;
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

/// What one thread finds in a level.
pub(crate) struct Finds {
    /// Which thread, 0 or 1.
    pub(crate) id: usize,
    /// What it may hold.
    pub(crate) memory: Memory,
    /// The markings.
    pub(crate) fresh: Store,
    /// How many of them it found in each level.
    pub(crate) levels: Vec<usize>,
    /// How many there may be.
    pub(crate) most: usize,
    /// What found no place, as `Shared::insert_left` takes it, and how much of it for good.
    pub(crate) left: Vec<u64>,
    strays: usize,
    /// Keys of the markings that stand past the end of its half of a set of keys.
    pub(crate) past: Vec<u64>,
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
            levels: Vec::new(),
            most: 0,
            left: Vec::new(),
            strays: 0,
            past: Vec::new(),
            end: None,
        }
    }

    /// Begins to work, with so many bytes more than are held and so many markings.
    pub(crate) fn allow(&mut self, bytes: usize, markings: usize) {
        let held = self.memory.used();
        self.memory.allow(held + bytes);
        (self.most, self.strays, self.end) = (markings, 0, None);
        self.levels.clear();
        self.past.clear();
    }

    /// Ends for a reason, if not for one more urgent.
    #[cold]
    pub(crate) fn end(&mut self, end: End) {
        self.end = self.end.max(Some(end));
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

/// A half of a set, in the hands of its thread.
pub(crate) trait Half<W: Width>: Send {
    /// The words of a record.
    fn stride(&self, width: W) -> usize;

    /// Slices a batch, with what its records need.
    fn cut(&self, width: W, batch: &mut Batch);

    /// Takes the markings that a transition makes of each of `fire`. Those of this half wait in it, the records of the
    /// others stand in `theirs` up to `len`: written to both places and counted in one, because which, no processor guesses.
    fn push(&mut self, width: W, net: &Net, batch: &Batch, t: usize, fire: u64, theirs: (&mut [u64], &mut usize));

    /// Puts into the half what waits in it, if it is much or if `all` is to be there; new markings go to the finds.
    fn settle(&mut self, width: W, all: bool, finds: &mut Finds);

    /// The same with records that came from the other half.
    fn insert(&mut self, width: W, records: &[u64], finds: &mut Finds);
}

/// A set that can be halved.
pub(crate) trait Shared<W: Width>: Arrivals<W> {
    /// A half.
    type Half<'a>: Half<W>
    where
        Self: 'a;

    /// Whether the threads may go on to the next level with what they found: where the set says no indexes.
    const GOES_ON: bool;

    /// The array of markings, and the two halves.
    fn halves<'a>(&'a mut self, table: &'a mut Table) -> (&'a Store, [Self::Half<'a>; 2]);

    /// Makes the set say all that was found, by the indexes that the markings are about to get in the array: in each level
    /// in turn `BLOCK` of each thread, as long as both have them, then what one and the other have more.
    fn complete(&mut self, width: W, space: &mut Space, finds: [&Finds; 2], watch: &mut Watch<'_>) -> Result<(), Stop>;

    /// Makes room for more; false where there is no memory for that. After an error a set of hashes cannot be used any
    /// more; one of keys has lost none.
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
