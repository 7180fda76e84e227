//! What an exploration may spend: memory, markings, time, and the patience of whoever waits: a person who presses
//! Ctrl-C, or a race that another method has won.
//!
//! Running out is a value (`Stop`) that travels up by `?`, never an abort: every structure that grows claims its bytes
//! here first, and asks the allocator by `try_reserve`. A budget counted from outside (resident memory) was rejected:
//! it sees the shortage only when it has happened.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Why an exploration or an analysis ended early.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stop {
    /// As many markings as allowed are stored, and there are more.
    Markings,
    /// The next structure would not fit into the memory allowed, or the system refused it.
    Memory,
    /// The time allowed is over.
    Time,
    /// A signal handler said so.
    Interrupted,
    /// Nobody needs the answer any more.
    Cancelled,
}

impl Stop {
    /// The reason as the Python side writes it.
    pub fn as_str(self) -> &'static str {
        match self {
            Stop::Markings => "markings",
            Stop::Memory => "memory",
            Stop::Time => "time",
            Stop::Interrupted => "interrupted",
            Stop::Cancelled => "cancelled",
        }
    }
}

/// Bytes held against bytes allowed. Shared by all that grows at once, so it counts behind a shared reference; claims
/// are rare (a vector that doubles), and an atomic counter costs them nothing.
#[derive(Debug)]
pub struct Memory {
    used: AtomicUsize,
    limit: usize,
}

impl Clone for Memory {
    fn clone(&self) -> Self {
        Memory { used: AtomicUsize::new(self.used()), limit: self.limit }
    }
}

impl Memory {
    /// Nothing used yet of so many bytes.
    pub fn new(limit: usize) -> Self {
        Memory { used: AtomicUsize::new(0), limit }
    }

    /// Allows another number of bytes from now on.
    pub fn allow(&mut self, limit: usize) {
        self.limit = limit;
    }

    /// Bytes held now.
    pub fn used(&self) -> usize {
        self.used.load(Ordering::Relaxed)
    }

    /// Bytes allowed.
    pub fn limit(&self) -> usize {
        self.limit
    }

    /// Takes bytes, or says that they are not there.
    pub fn claim(&self, bytes: usize) -> Result<(), Stop> {
        let fits = |used: usize| used.checked_add(bytes).filter(|&used| used <= self.limit);
        match self.used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, fits) {
            Ok(_) => Ok(()),
            Err(_) => Err(Stop::Memory),
        }
    }

    /// Gives bytes back.
    pub fn release(&self, bytes: usize) {
        let before = self.used.fetch_sub(bytes, Ordering::Relaxed);
        debug_assert!(bytes <= before);
    }

    /// A vector of `len` times `value`, claimed; the caller releases `len * size_of::<T>()`.
    pub fn filled<T: Clone>(&self, value: T, len: usize) -> Result<Vec<T>, Stop> {
        let bytes = len.checked_mul(size_of::<T>()).ok_or(Stop::Memory)?;
        self.claim(bytes)?;
        let mut all = Vec::new();
        if all.try_reserve_exact(len).is_err() {
            self.release(bytes);
            return Err(Stop::Memory);
        }
        all.resize(len, value);
        Ok(all)
    }

    /// Appends to a vector whose capacity is claimed as it grows.
    #[inline]
    pub fn push<T>(&self, all: &mut Vec<T>, value: T) -> Result<(), Stop> {
        if all.len() == all.capacity() {
            self.grow(all)?;
        }
        all.push(value);
        Ok(())
    }

    /// Appends so many times a value to a vector that `push` has filled.
    pub fn extend<T: Clone>(&self, all: &mut Vec<T>, value: T, count: usize) -> Result<(), Stop> {
        while all.capacity() - all.len() < count {
            self.grow(all)?;
        }
        all.resize(all.len() + count, value);
        Ok(())
    }

    #[cold]
    fn grow<T>(&self, all: &mut Vec<T>) -> Result<(), Stop> {
        let old = all.capacity();
        let new = (old + old / 2).max(16);
        // While the allocator moves the vector both copies may exist.
        self.claim(new * size_of::<T>())?;
        if all.try_reserve_exact(new - all.len()).is_err() {
            self.release(new * size_of::<T>());
            return Err(Stop::Memory);
        }
        self.release(old * size_of::<T>());
        Ok(())
    }

    /// Releases a vector that `push` has filled.
    pub fn drop_vec<T>(&self, all: Vec<T>) {
        self.release(all.capacity() * size_of::<T>());
    }
}

/// Units of work between two looks at the clock.
pub(crate) const CLOCK_EVERY: usize = 1 << 12;
/// Units of work before the first call of `poll`.
const FIRST_POLL: usize = 1 << 16;
/// The longest time between two calls of `poll`. By the clock and not by work: a caller may have to wait for its turn
/// (the interpreter lock) at each call, and what a unit of work takes differs by a factor of a thousand.
const POLL_EVERY: Duration = Duration::from_millis(40);
/// The shortest time between two calls of `poll`.
const POLL_EVERY_MIN: Duration = Duration::from_millis(1);
/// The part of the time since the start that passes until the next call, up to the longest: work whose answer is no
/// longer needed, as another technique has it, then goes on for no more than that part of what it has taken already.
const POLL_PART: u32 = 4;

/// How long work that has gone on for so long does without a call of `poll`.
fn until_next_poll(elapsed: Duration) -> Duration {
    (elapsed / POLL_PART).clamp(POLL_EVERY_MIN, POLL_EVERY)
}

/// What was found so far: what `poll` is told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// Markings.
    pub markings: u64,
    /// Edges counted.
    pub edges: u64,
}

/// A `poll` that always lets the work go on.
pub fn unwatched(_: Found) -> Result<(), Stop> {
    Ok(())
}

/// Looks at the clock and calls the caller's `poll` now and then.
pub struct Watch<'a> {
    deadline: Option<Instant>,
    poll: &'a mut dyn FnMut(Found) -> Result<(), Stop>,
    since_clock: usize,
    /// Work left before the first call of `poll`, which soon follows the start.
    before_first: Option<usize>,
    started: Instant,
    polled: Instant,
    poll_every: Duration,
    poll_every_max: Duration,
    second: Option<&'a AtomicBool>,
    /// What was found so far; the work that knows it keeps it up to date.
    pub found: Found,
}

impl<'a> Watch<'a> {
    /// `poll` is called after 2^16 units of work, then more and more seldom, and at last some twenty times a second; it
    /// says whether to stop and why.
    pub fn new(deadline: Option<Instant>, poll: &'a mut dyn FnMut(Found) -> Result<(), Stop>) -> Self {
        let now = Instant::now();
        Watch {
            deadline,
            poll,
            since_clock: 0,
            before_first: Some(FIRST_POLL),
            started: now,
            polled: now,
            poll_every: POLL_EVERY,
            poll_every_max: POLL_EVERY,
            second: None,
            found: Found::default(),
        }
    }

    /// The same with a `poll` that costs nothing and is called at each look at the clock.
    pub(crate) fn often(deadline: Option<Instant>, poll: &'a mut dyn FnMut(Found) -> Result<(), Stop>) -> Self {
        let none = Duration::ZERO;
        Watch { before_first: None, poll_every: none, poll_every_max: none, ..Watch::new(deadline, poll) }
    }

    /// The same for work that a second thread may share while this says that a processor is free for it.
    pub fn with_second(self, free: Option<&'a AtomicBool>) -> Self {
        Watch { second: free, ..self }
    }

    /// Whether a second thread may share the work now.
    pub(crate) fn second_is_free(&self) -> bool {
        self.second.is_some_and(|free| free.load(Ordering::Relaxed))
    }

    /// When time is over.
    pub(crate) fn deadline(&self) -> Option<Instant> {
        self.deadline
    }

    /// Reports work done: markings expanded and edges followed, some nanoseconds each.
    #[inline]
    pub fn tick(&mut self, work: usize) -> Result<(), Stop> {
        self.since_clock += work;
        if self.since_clock >= CLOCK_EVERY { self.look() } else { Ok(()) }
    }

    #[cold]
    fn look(&mut self) -> Result<(), Stop> {
        let now = Instant::now();
        if self.deadline.is_some_and(|deadline| now >= deadline) {
            return Err(Stop::Time);
        }
        self.before_first = self.before_first.map(|left| left.saturating_sub(self.since_clock));
        let due = self.before_first == Some(0) || now.duration_since(self.polled) >= self.poll_every;
        self.since_clock = 0;
        if due {
            self.before_first = None;
            (self.poll)(self.found)?;
            self.polled = Instant::now();
            self.poll_every = until_next_poll(self.polled.duration_since(self.started)).min(self.poll_every_max);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_longer_needed_goes_on_for_a_part_of_what_it_took() {
        let after = |millis| until_next_poll(Duration::from_millis(millis));
        assert_eq!(after(0), POLL_EVERY_MIN);
        assert_eq!(after(20), Duration::from_millis(5));
        assert_eq!(after(100_000), POLL_EVERY);
    }
}
