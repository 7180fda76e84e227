//! Interleaving exploration of large levels by two threads, with one numbering whatever the timing.
//!
//! The slots of the table are cut in two by the highest bit of the hash: only its owner reads and writes a half. The
//! markings of a level are dealt out 64 by 64; each thread expands its share, looks up the successors whose hash is its
//! own, and hands the others over in a buffer, once a round (`member.rs`). Rounds are measured in edges, not in time, and
//! each thread reads what it gets in the order of the rounds; so what a thread finds, and in which order, is a function
//! of the net and the budget.
//!
//! The share of the next level is then what a thread has found itself: the threads tell each other how much that is, and go
//! on until the table is full or levels get small. So to start a thread, which takes a tenth of a millisecond, is not the
//! price of a level but of a growth.
//!
//! Indexes stay one numbering by levels: in each level 64 of one thread, 64 of the other, in turn, then what one has found
//! more. Both know the index of whatever they expand from how much both have found. When they end, the markings are laid
//! into the array in that order. So nothing is atomic, and whoever asks the space afterwards sees the array and the slots
//! that one thread would leave, in another order within the levels. The slots of a set of hashes say indexes, so there a
//! thread numbers its i-th find as if both found equally many; that is put right after each level, and the threads are
//! started anew.
//!
//! Small levels, and the last of a budget, are left to one thread: the two share out what memory and markings there are,
//! and the first who has used up his share ends it. Rejected: slots claimed by compare-and-swap, both threads in one
//! table. That saves the buffers but numbers the markings by who came first, so that the witnesses of one net differ from
//! day to day; to sort each level afterwards costs more than the buffers.
//!
//! What is left between this and twice as quick, by profiles of a net with levels of ten thousand markings: two threads
//! take a seventh more instructions than one, each waits a fifteenth of its time for the other, growth starts threads and
//! writes to fresh pages. Other sizes of rounds, more rounds ahead of the other
//! thread, and levels half or a quarter as large made no difference that could be measured. Two explorations that share nothing, at once, are 1.7 to 1.95 times as quick as one
//! after the other, so that is about all there is to be had.

mod half;
mod hashed;
mod keyed;
mod laying;
mod member;

use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use crate::apart::Apart;
use crate::budget::{Found, Stop, Watch};
use crate::explore::Space;
use crate::marking::Width;
use crate::net::Net;
use crate::table::NONE;
pub(crate) use half::Shared;
use half::{BLOCK, End};
use laying::append;
use member::{Member, Port, Work};

/// Markings below which a level is not worth the starting of threads.
pub(crate) const LEVEL_LEAST: usize = 1 << 12;
/// Markings below which threads that are at it go on to a level no more.
const GO_ON_LEAST: usize = 1 << 9;
/// Bytes that the array of markings may claim beyond what it holds.
const ROUNDING_BYTES: usize = 1 << 22;

/// The two threads of one exploration, and what they counted so far.
pub(crate) struct Pair {
    members: [Apart<Member>; 2],
    /// Bytes claimed for the members from the memory of the space.
    claimed: usize,
    level_least: usize,
    /// Whether a second processor is free.
    free: Arc<AtomicBool>,
    /// Whether a budget was too small to be shared; then one thread does the rest.
    retired: bool,
}

impl Pair {
    /// Two threads for a net, for levels of at least so many markings that begin while the flag is set.
    pub(crate) fn new(net: &Net, level_least: usize, free: Arc<AtomicBool>) -> Self {
        Pair { members: [0, 1].map(|id| Apart(Member::new(id, net))), claimed: 0, level_least, free, retired: false }
    }

    /// Whether a level of so many markings is worth it.
    pub(crate) fn takes(&self, markings: usize) -> bool {
        !self.retired && markings >= self.level_least && self.free.load(Ordering::Relaxed)
    }

    /// Expands a level, and those after it as long as that is worth it; returns what the budgets leave of the last one, as
    /// ranges of indexes, and where it ends.
    pub(crate) fn expand<W: Width, S: Shared<W>>(
        &mut self,
        width: W,
        space: &mut Space,
        set: &mut S,
        start: usize,
        max: usize,
        watch: &mut Watch<'_>,
    ) -> Result<(Vec<(usize, usize)>, usize), Stop> {
        let mut end = space.table.store.len();
        let mut open: Vec<_> = (start..end).step_by(BLOCK).map(|first| (first, end.min(first + BLOCK))).collect();
        // Of a level that is taken up again, what was found before stands in the array, and nobody has it for himself.
        let mut go_on = S::GOES_ON.then_some(self.level_least.min(GO_ON_LEAST));
        loop {
            let worst;
            (open, worst) = self.work(width, space, set, (&open, go_on), max, watch);
            space.edges += self.members.iter_mut().map(|Apart(member)| std::mem::take(&mut member.edges)).sum::<u64>();
            end = self.lay_down(width, space, set, max, watch)?.unwrap_or(end);
            match worst {
                Some(End::Stopped(stop)) => return Err(stop),
                // Whether there is really no memory, one thread will find out.
                Some(End::Full) => self.retired |= !set.grow(width, space, watch)?,
                Some(End::Short) => self.retired = true,
                None => {}
            }
            for Apart(member) in &mut self.members {
                set.insert_left(width, space, &std::mem::take(&mut member.finds.left), max, watch)?;
            }
            if worst.is_none() || self.retired {
                return Ok((open, end));
            }
            go_on = None;
        }
    }

    /// Lets both members work until there is nothing to go on with or one of them cannot; what is left of the last level, and
    /// why they ended.
    fn work<W: Width>(
        &mut self,
        width: W,
        space: &mut Space,
        set: &mut impl Shared<W>,
        (open, go_on): (&[(usize, usize)], Option<usize>),
        max: usize,
        watch: &mut Watch<'_>,
    ) -> (Vec<(usize, usize)>, Option<End>) {
        // What is found is held twice for a moment, by its member and in the array.
        let free = (space.memory.limit() - space.memory.used()).saturating_sub(ROUNDING_BYTES);
        let base = space.table.store.len();
        for Apart(member) in &mut self.members {
            member.finds.allow(free / 4, max.saturating_sub(base) / 2);
        }
        let (store, [mut low, mut high]) = set.halves(&mut space.table);
        let before = Found { markings: base as u64, edges: space.edges };
        let work = Apart(Work { net: &space.net, old: store.all(), open, base, go_on, free: &self.free, before });
        let [Apart(here), Apart(there)] = &mut self.members;
        let [port, its_port] = Port::both();
        let worst = thread::scope(|scope| {
            let work = &work.0;
            let all = move || there.work(width, work, &mut high, &its_port, None);
            // Where the system has no thread to give, one does it all.
            let its = thread::Builder::new().spawn_scoped(scope, all).ok()?;
            let end = here.work(width, work, &mut low, &port, Some(watch));
            drop(port);
            Some(end.max(its.join().unwrap_or_else(|panic| resume_unwind(panic))))
        });
        let Some(worst) = worst else { return (open.to_vec(), Some(End::Short)) };
        let mut left: Vec<_> = self.members.iter().flat_map(|Apart(member)| member.left(&work.0)).collect();
        left.sort_unstable();
        (left, worst)
    }

    /// Appends to the array what the members found; where the last of the levels that they expanded ends, if these are many.
    fn lay_down<W: Width>(
        &mut self,
        width: W,
        space: &mut Space,
        set: &mut impl Shared<W>,
        max: usize,
        watch: &mut Watch<'_>,
    ) -> Result<Option<usize>, Stop> {
        let [Apart(a), Apart(b)] = &mut self.members;
        let held = a.finds.memory.used() + b.finds.memory.used();
        space.memory.claim(held.saturating_sub(self.claimed))?;
        self.claimed = self.claimed.max(held);
        let result = set.complete(width, space, [&a.finds, &b.finds], watch);
        let result = result.and_then(|()| append(space, [&a.finds, &b.finds], max));
        if result.is_err() {
            // The set says more than the array holds, which is still a prefix.
            set.forget_others(width, space);
        }
        a.finds.fresh.clear();
        b.finds.fresh.clear();
        result
    }

    /// Adds what the members counted to the counts of the space.
    pub(crate) fn finish(self, space: &mut Space) -> Result<(), Stop> {
        let mut dead = Vec::new();
        for Apart(member) in self.members {
            for t in 0..space.fired.len() {
                space.fired[t] += member.fired[t];
                space.contacts[t] += member.contacts[t];
                space.contact_witness[t] = space.contact_witness[t].min(member.contact_witness[t]);
            }
            dead.push(member.deadlocks);
        }
        space.memory.release(self.claimed);
        const _: () = assert!(NONE == u32::MAX, "`min` takes what is there");
        for index in dead.into_iter().flatten() {
            space.memory.push(&mut space.deadlocks, index)?;
        }
        space.deadlocks.sort_unstable();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::explore::Limits;
    use crate::paths::path_to;
    use crate::samples::{machines, random_nets};

    const ALL: Limits = Limits { step: false, markings: 1 << 20, memory_bytes: 1 << 28, time: None };

    fn alone(net: &Net, limits: Limits) -> Space {
        Space::explore(net.clone(), limits, &mut unwatched).expect("fits")
    }

    fn pair(net: &Net) -> Pair {
        Pair::new(net, 1, Arc::new(AtomicBool::new(true)))
    }

    fn by_two(net: &Net, limits: Limits) -> Space {
        Space::explore_with(Some(pair(net)), net.clone(), limits, &mut unwatched).expect("fits")
    }

    fn words(space: &Space) -> &[u64] {
        &space.table.store.all()[..space.len() * space.net.words]
    }

    /// Whether the space is in itself what a space has to be.
    fn is_sound(space: &Space) {
        assert!((0..space.len()).all(|index| space.find(space.marking(index)) == Some(index as u32)));
        assert!(space.deadlocks.is_sorted() && space.levels.is_sorted());
        let mut poll = unwatched;
        let mut watch = Watch::new(None, &mut poll);
        for index in [0, space.len() / 2, space.len() - 1] {
            let path = path_to(space, index as u32, &mut watch).expect("in time");
            let level = space.levels.partition_point(|&first| first as usize <= index) - 1;
            // What was found last may belong to a level that has not begun.
            let late = usize::from(space.stop.is_some() && path.len() > level);
            assert_eq!(path.len(), level + late, "a path is as long as its level is far");
        }
    }

    fn agree(one: &Space, many: &Space) {
        is_sound(many);
        assert_eq!((one.len(), one.edges, one.stop), (many.len(), many.edges, many.stop));
        assert_eq!((&one.fired, &one.contacts, &one.levels), (&many.fired, &many.contacts, &many.levels));
        assert!((0..one.len()).all(|index| many.find(one.marking(index)).is_some()));
        let level = |space: &Space, index: u32| space.levels.partition_point(|&first| first <= index);
        assert_eq!(one.deadlocks.len(), many.deadlocks.len());
        for &index in &one.deadlocks {
            let there = many.find(one.marking(index as usize)).expect("found");
            assert!(many.deadlocks.binary_search(&there).is_ok());
        }
        for (&first, &other) in one.contact_witness.iter().zip(&many.contact_witness) {
            assert!((first == NONE) == (other == NONE));
            assert!(first == NONE || level(one, first) == level(many, other));
        }
    }

    #[test]
    fn two_threads_find_what_one_finds_at_every_width() {
        for pad in [0, 60, 200, 500] {
            let net = machines(13, pad);
            agree(&alone(&net, ALL), &by_two(&net, ALL));
        }
    }

    #[test]
    fn two_threads_find_what_one_finds_of_random_nets() {
        for net in random_nets(300) {
            agree(&alone(&net, ALL), &by_two(&net, ALL));
        }
    }

    #[test]
    fn the_numbering_is_a_function_of_the_net() {
        let net = machines(14, 0);
        let first = by_two(&net, ALL);
        for _ in 0..5 {
            assert!(words(&by_two(&net, ALL)) == words(&first));
        }
    }

    #[test]
    fn every_budget_leaves_a_prefix_by_levels() {
        let net = machines(13, 0);
        let all = by_two(&net, ALL);
        for markings in [1, 100, 1000, 5000, 8000] {
            let part = by_two(&net, Limits { markings, ..ALL });
            is_sound(&part);
            assert_eq!((part.len(), part.stop), (markings, Some(Stop::Markings)));
        }
        for memory_bytes in [20_000, 60_000, 100_000, 150_000] {
            let part = by_two(&net, Limits { memory_bytes, ..ALL });
            is_sound(&part);
            assert_eq!(part.stop, Some(Stop::Memory));
            assert!(part.memory.used() <= memory_bytes && part.len() < all.len());
            let again = by_two(&net, Limits { memory_bytes, ..ALL });
            assert_eq!((words(&part), part.edges), (words(&again), again.edges));
        }
    }

    #[test]
    fn a_level_ends_where_nobody_needs_it() {
        let net = machines(16, 0);
        let pair = pair(&net);
        let space = Space::explore_with(Some(pair), net, ALL, &mut |_| Err(Stop::Cancelled)).expect("begins");
        is_sound(&space);
        assert_eq!(space.stop, Some(Stop::Cancelled));
        assert!(space.len() < 1 << 16);
    }

    #[test]
    fn what_members_held_is_released() {
        let net = machines(13, 0);
        let (one, two) = (alone(&net, ALL), by_two(&net, ALL));
        assert_eq!(one.memory.used(), two.memory.used());
    }
}
