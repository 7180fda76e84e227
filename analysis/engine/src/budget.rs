//! What an exploration may spend: memory, markings, time, and the patience of the person who pressed Ctrl-C.
//!
//! Running out is a value (`Stop`) that travels up by `?`, never an abort: every structure that grows claims its bytes
//! here first, and asks the allocator by `try_reserve`. A budget counted from outside (resident memory) was rejected:
//! it sees the shortage only when it has happened.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Why an exploration or an analysis ended early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// As many markings as allowed are stored, and there are more.
    Markings,
    /// The next structure would not fit into the memory allowed, or the system refused it.
    Memory,
    /// The time allowed is over.
    Time,
    /// The caller's `poll` said so.
    Interrupted,
}

impl Stop {
    /// The reason as the Python side writes it.
    pub fn as_str(self) -> &'static str {
        match self {
            Stop::Markings => "markings",
            Stop::Memory => "memory",
            Stop::Time => "time",
            Stop::Interrupted => "interrupted",
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

    /// Bytes held now.
    pub fn used(&self) -> usize {
        self.used.load(Ordering::Relaxed)
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
const CLOCK_EVERY: usize = 1 << 12;
/// Units of work between two calls of `poll`.
const POLL_EVERY: usize = 1 << 16;

/// Looks at the clock and at the caller's `poll` now and then, counted in work done and not in time.
pub struct Watch<'a> {
    deadline: Option<Instant>,
    poll: &'a mut dyn FnMut() -> bool,
    since_clock: usize,
    since_poll: usize,
}

impl<'a> Watch<'a> {
    /// `poll` is asked about every 2^16 units of work and returns true to stop.
    pub fn new(deadline: Option<Instant>, poll: &'a mut dyn FnMut() -> bool) -> Self {
        Watch { deadline, poll, since_clock: 0, since_poll: 0 }
    }

    /// Reports work done: markings expanded and edges followed.
    #[inline]
    pub fn tick(&mut self, work: usize) -> Result<(), Stop> {
        self.since_clock += work;
        if self.since_clock >= CLOCK_EVERY { self.look() } else { Ok(()) }
    }

    #[cold]
    fn look(&mut self) -> Result<(), Stop> {
        self.since_poll += self.since_clock;
        self.since_clock = 0;
        if self.deadline.is_some_and(|deadline| Instant::now() >= deadline) {
            return Err(Stop::Time);
        }
        if self.since_poll >= POLL_EVERY {
            self.since_poll = 0;
            if (self.poll)() {
                return Err(Stop::Interrupted);
            }
        }
        Ok(())
    }
}
