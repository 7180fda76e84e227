//! Interleaving exploration of large levels by two threads, with one numbering whatever the timing, as long as a second
//! processor is free.
//!
//! The markings are cut in two, and each half has its owner, who alone looks up and files what belongs there. Each thread
//! expands its share of a level, files the successors that are its own, and hands the others over in a buffer, once a
//! round (`member.rs`). Rounds are measured in look-ups, not in time, and each thread reads what it gets in the order of the
//! rounds; so what a thread finds, and in which order, is a function of the net and the budget, and nothing is atomic.
//!
//! Where markings have exact keys (`keyed.rs`) they are cut by a parity that few firings change (`parting.rs`). Each thread
//! then has a table of its own, as if it were alone, and goes on with what it has found itself from level to level, until
//! levels get small or uneven; then both tables are put together, unless everything is found: the set stays in halves then
//! as nobody needs it whole but who asks for indexes, which most questions do not. So what it costs to start a thread and to cut a set is not
//! the price of a level. A set of hashes (`hashed.rs`) says indexes, and is cut by the highest bit of the hash, for one
//! level.
//!
//! Indexes stay one numbering by levels: in each level 64 of one thread, 64 of the other, in turn, then what one has found
//! more. Both know the index of whatever they expand from how much both have found. When they end, the markings are laid
//! into the array in that order. So whoever asks the space afterwards sees the array that one thread would leave, in another
//! order within the levels.
//!
//! Small levels, and the last of a budget, are left to one thread: the two share out what memory and markings there are,
//! and the first who has used up his share ends it. Rejected: slots claimed by compare-and-swap, both threads in one
//! table. That saves the buffers but numbers the markings by who came first, so that the witnesses of one net differ from
//! day to day; to sort each level afterwards costs more than the buffers.
//!
//! What is left between this and twice as quick: the levels before the first large one; each thread waits up to a tenth of
//! its time for the other, most of it at the ends of levels, so nets of many small levels gain least; markings are copied
//! once more. Two explorations that share nothing, at once, are 1.8 to 1.95 times as quick as one after
//! the other.

mod half;
mod hashed;
mod keyed;
mod laying;
mod member;
mod parting;

use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use crate::apart::Apart;
use crate::budget::{Found, Stop, Watch};
use crate::explore::Space;
use crate::marking::Width;
use crate::net::Net;
use crate::sleep::Sleeping;
use crate::table::NONE;
pub(crate) use half::Shared;
use half::{BLOCK, End};
pub(crate) use keyed::{Halves, Sides};
use laying::append;
use member::{Member, Port, Work};

/// When two threads are worth it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Worth {
    /// The fewest markings of a level for which they are started, and of one for which they go on, but for a few smaller ones.
    level: usize,
    next_level: usize,
    /// The largest part of their time that may be lost by the way a set is cut.
    loss: f64,
    /// How much larger a set must have become before it is cut again: that is work for each of its keys.
    growth: f64,
}

/// As it is measured.
pub(crate) const MEASURED: Worth = Worth { level: 1 << 11, next_level: 1 << 9, loss: 0.6, growth: 1.25 };

/// Bytes that the array of markings may claim beyond what it holds.
const ROUNDING_BYTES: usize = 1 << 22;

/// The two threads of one exploration, and what they counted so far.
pub(crate) struct Pair {
    members: [Apart<Member>; 2],
    /// Bytes claimed for the members from the memory of the space.
    claimed: usize,
    worth: Worth,
    /// Whether a second processor is free.
    free: Arc<AtomicBool>,
    /// Whether a budget was too small to be shared; then one thread does the rest.
    retired: bool,
    /// How many markings there must be before the set is cut again.
    next: usize,
}

impl Pair {
    /// Two threads for a net, for levels that are worth it and begin while the flag is set.
    pub(crate) fn new(net: &Net, worth: Worth, free: Arc<AtomicBool>) -> Self {
        Pair { members: [0, 1].map(|id| Apart(Member::new(id, net))), claimed: 0, worth, free, retired: false, next: 0 }
    }

    /// Whether a level of so many markings, the last of so many, is worth it.
    pub(crate) fn takes(&self, markings: usize, all: usize) -> bool {
        !self.retired && markings >= self.worth.level && all >= self.next && self.free.load(Ordering::Relaxed)
    }

    /// Expands a level, and those after it as long as that is worth it; returns what the budgets leave of the last one, as
    /// ranges of indexes, and where it ends.
    pub(crate) fn expand<W: Width, S: Shared<W>>(
        &mut self,
        width: W,
        space: &mut Space,
        (set, sleeping): (&mut S, &mut Sleeping),
        start: usize,
        max: usize,
        watch: &mut Watch<'_>,
    ) -> Result<(Vec<(usize, usize)>, usize), Stop> {
        let mut end = space.table.store.len();
        if S::GOES_ON {
            self.wait(end);
        }
        if !set.cut(width, space, sleeping, self.worth.loss) {
            return Ok((vec![(start, end)], end));
        }
        let mut open: Vec<_> = (start..end).step_by(BLOCK).map(|first| (first, end.min(first + BLOCK))).collect();
        let go_on = S::GOES_ON.then_some(self.worth.next_level);
        loop {
            let worst;
            (open, worst) = self.work(width, space, set, (&open, go_on, sleeping), max, watch);
            end = self.lay_down(width, space, (set, sleeping), max)?.unwrap_or(end);
            if S::GOES_ON {
                self.wait(space.table.store.len());
            }
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
        }
    }

    /// Waits until there are so many more markings than so many that it is worth it to cut them again.
    fn wait(&mut self, markings: usize) {
        self.next = (markings as f64 * self.worth.growth) as usize;
    }

    /// Lets both members work until there is nothing to go on with or one of them cannot; what is left of the last level, and
    /// why they ended.
    fn work<W: Width>(
        &mut self,
        width: W,
        space: &mut Space,
        set: &mut impl Shared<W>,
        (open, go_on, sleeping): (&[(usize, usize)], Option<usize>, &Sleeping),
        max: usize,
        watch: &mut Watch<'_>,
    ) -> (Vec<(usize, usize)>, Option<End>) {
        // What is found is held twice for a moment, by its member and in the array; and so are keys that are put together,
        // in a table that is up to half as large again as both it is made of.
        let free = (space.memory.limit() - space.memory.used()).saturating_sub(ROUNDING_BYTES);
        let base = space.table.store.len();
        for Apart(member) in &mut self.members {
            member.finds.allow(free / 6, max.saturating_sub(base) / 2);
        }
        let (store, [mut low, mut high]) = set.halves(&mut space.table);
        let before = Found { markings: base as u64, edges: space.edges };
        let (free, stopped, deadline) = (&self.free, Apart(AtomicBool::new(false)), watch.deadline());
        let stopped = &stopped.0;
        let net = &space.net;
        let work = Apart(Work { net, old: store.all(), open, base, go_on, sleeping, free, stopped, before });
        let [Apart(here), Apart(there)] = &mut self.members;
        let [port, its_port] = Port::both();
        let worst = thread::scope(|scope| {
            let work = &work.0;
            let all = move || {
                let mut poll = |_| if work.stopped.load(Ordering::Relaxed) { Err(Stop::Cancelled) } else { Ok(()) };
                there.work(width, work, &mut high, &its_port, &mut Watch::new(deadline, &mut poll))
            };
            // Where the system has no thread to give, one does it all.
            let its = thread::Builder::new().spawn_scoped(scope, all).ok()?;
            let end = here.work(width, work, &mut low, &port, watch);
            drop(port);
            Some(end.max(its.join().unwrap_or_else(|panic| resume_unwind(panic))))
        });
        // The second one only hears that it must end; the first knows why.
        let worst = match here.finds.end {
            Some(End::Stopped(stop)) => Some(Some(End::Stopped(stop))),
            _ => worst,
        };
        let Some(worst) = worst else { return (open.to_vec(), Some(End::Short)) };
        let mut left: Vec<_> = self.members.iter().flat_map(|Apart(member)| member.left(&work.0)).collect();
        left.sort_unstable();
        (left, worst)
    }

    /// Appends to the array what the members found, and adds what they counted; where the last of the levels that they
    /// expanded ends, if these are many.
    fn lay_down<W: Width>(
        &mut self,
        width: W,
        space: &mut Space,
        (set, sleeping): (&mut impl Shared<W>, &mut Sleeping),
        max: usize,
    ) -> Result<Option<usize>, Stop> {
        let [Apart(a), Apart(b)] = &mut self.members;
        let held = |a: &Member, b: &Member| a.finds.memory.used() + b.finds.memory.used();
        let before = held(a, b);
        let result = match space.memory.claim(before.saturating_sub(self.claimed)) {
            Ok(()) => {
                self.claimed = self.claimed.max(before);
                set.complete(width, space, [&a.finds, &b.finds])
            }
            Err(stop) => Err(stop),
        };
        let after = held(a, b);
        space.memory.release(self.claimed.saturating_sub(after));
        self.claimed = self.claimed.min(after);
        let result = match result {
            Ok(()) => [&*a, &*b].into_iter().try_for_each(|member| Pair::count(member, space)),
            Err(stop) => Err(stop),
        };
        let result = result.and_then(|()| append(space, [&a.finds, &b.finds], &mut sleeping.trail, max));
        match result {
            Ok(_) => set.seal(space),
            // The set says more than the array holds, which is still a prefix.
            Err(_) => set.forget_others(width, space),
        }
        for member in [a, b] {
            member.finds.fresh.clear();
            member.finds.trail.clear();
            member.forget();
        }
        result
    }

    /// Adds what a member counted to the counts of the space.
    fn count(member: &Member, space: &mut Space) -> Result<(), Stop> {
        space.edges += member.edges;
        for t in 0..space.fired.len() {
            space.fired[t] += member.fired[t];
            space.contacts[t] += member.contacts[t];
            space.contact_witness[t] = space.contact_witness[t].min(member.contact_witness[t]);
        }
        const _: () = assert!(NONE == u32::MAX, "`min` takes what is there");
        member.deadlocks.iter().try_for_each(|&index| space.memory.push(&mut space.deadlocks, index))
    }

    /// Gives back what the members held.
    pub(crate) fn finish(self, space: &mut Space) {
        space.memory.release(self.claimed);
        space.deadlocks.sort_unstable();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::Batch;
    use crate::budget::unwatched;
    use crate::explore::Limits;
    use crate::known::Set;
    use crate::marking::Dynamic;
    use crate::net::Transition;
    use crate::paths::path_to;
    use crate::samples::{machines, random_nets};

    const ALL: Limits = Limits { step: false, markings: 1 << 20, memory_bytes: 1 << 28, time: None };

    fn alone(net: &Net, limits: Limits) -> Space {
        Space::explore(net.clone(), limits, &mut unwatched).expect("fits")
    }

    /// Whatever that costs.
    const ALWAYS: Worth = Worth { level: 1, next_level: 1, loss: f64::INFINITY, growth: 1.0 };

    fn pair(net: &Net) -> Pair {
        Pair::new(net, ALWAYS, Arc::new(AtomicBool::new(true)))
    }

    fn by_two(net: &Net, limits: Limits) -> Space {
        Space::explore_with(Some(pair(net)), net.clone(), limits, &mut unwatched).expect("fits")
    }

    fn words(space: &Space) -> &[u64] {
        &space.table.store.all()[..space.len() * space.net.words]
    }

    /// Whether the space is in itself what a space has to be.
    fn is_sound(space: &Space) {
        let mut poll = unwatched;
        let mut watch = Watch::new(None, &mut poll);
        // Without memory for that, finding them takes longer.
        assert!(matches!(space.index(&mut watch), Ok(()) | Err(Stop::Memory)));
        assert!((0..space.len()).all(|index| space.find(space.marking(index)) == Some(index as u32)));
        assert!(space.deadlocks.is_sorted() && space.levels.is_sorted());
        for index in [0, space.len() / 2, space.len() - 1] {
            let path = path_to(space, index as u32, &mut watch).expect("in time");
            let level = space.levels.partition_point(|&first| first as usize <= index) - 1;
            // What was found last may belong to a level that has not begun.
            let late = usize::from(space.stop.is_some() && path.len() > level);
            assert_eq!(path.len(), level + late, "a path is as long as its level is far");
        }
    }

    /// Whether of the markings that were certainly expanded none before the witness is in contact.
    fn witnesses_are_first(space: &Space) {
        let mut batch = Batch::new(&space.net);
        for index in 0..*space.levels.last().expect("there is M0") as usize {
            batch.markings.clear();
            batch.markings.extend_from_slice(space.marking(index));
            batch.slice(Dynamic(space.net.words));
            for (t, &witness) in space.contact_witness.iter().enumerate() {
                let (base, blocked) = space.net.forward.test(t, &batch.slices, batch.valid);
                assert!(base & blocked == 0 || witness as usize <= index, "{witness} and {index}");
                assert!(base & blocked != 0 || witness as usize != index);
            }
        }
    }

    fn agree(one: &Space, many: &Space) {
        is_sound(many);
        witnesses_are_first(many);
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
        for net in random_nets(150) {
            agree(&alone(&net, ALL), &by_two(&net, ALL));
        }
    }

    #[test]
    fn two_threads_find_what_one_finds_where_keys_leave_no_room_or_are_too_long() {
        // A chain makes keys long; where it makes them too long, markings are hashed, of one word and of two.
        for (beside, length, hashed) in [(4, 50, false), (5, 55, false), (0, 61, true), (0, 64, true), (5, 64, true)] {
            let (mut transitions, first) = (machines(beside, 0).transitions, 2 * beside);
            transitions.extend((first..first + length).map(|p| Transition::new(&[p], &[p + 1], &[], &[], &[])));
            let marked: Vec<u32> = (0..=beside).map(|i| 2 * i).collect();
            let net = Net::new((first + length) as usize + 1, transitions, &marked).expect("well formed");
            let (one, two) = (alone(&net, ALL), by_two(&net, ALL));
            assert_eq!((matches!(two.set, Set::Hashed), two.len()), (hashed, (length as usize + 1) << beside));
            agree(&one, &two);
        }
    }

    #[test]
    fn what_both_have_found_is_found_again_in_halves_and_with_indexes() {
        let mut in_halves = 0;
        for net in random_nets(100).chain([machines(12, 0), machines(10, 100)]) {
            let space = by_two(&net, ALL);
            let known = |space: &Space| {
                for index in 0..space.len() {
                    assert_eq!(space.find(space.marking(index)), Some(index as u32));
                    assert!(space.may_hold(Dynamic(net.words), space.marking(index)));
                }
                let stranger = vec![!0; net.words];
                assert_eq!(space.find(&stranger), None);
            };
            known(&space);
            in_halves += usize::from(matches!(&space.set, Set::Narrow(keyed) if keyed.halves.is_some()));
            let (held, mut poll) = (space.memory.used(), unwatched);
            space.index(&mut Watch::new(None, &mut poll)).expect("fits");
            known(&space);
            let Set::Narrow(keyed) = &space.set else { continue };
            // What was put together for that is given back.
            assert_eq!(space.memory.used() - held, keyed.indexes.get().expect("just made").bytes());
        }
        assert!(in_halves > 50, "{in_halves}");
    }

    #[test]
    fn the_numbering_is_a_function_of_the_net() {
        let net = machines(14, 0);
        for worth in [ALWAYS, MEASURED] {
            let by_two = || {
                let pair = Pair::new(&net, worth, Arc::new(AtomicBool::new(true)));
                Space::explore_with(Some(pair), net.clone(), ALL, &mut unwatched).expect("fits")
            };
            let first = by_two();
            assert!(words(&first) != words(&alone(&net, ALL)), "both have found something");
            for _ in 0..5 {
                assert!(words(&by_two()) == words(&first));
            }
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
    fn what_finds_no_room_is_put_where_it_belongs() {
        for net in random_nets(80) {
            let all = alone(&net, ALL);
            for markings in [all.len() / 3, all.len() / 2, all.len() - 1] {
                let limits = Limits { markings: markings.max(1), ..ALL };
                let part = by_two(&net, limits);
                is_sound(&part);
                assert_eq!(part.len(), limits.markings);
                witnesses_are_first(&part);
                let level = |of: &Space, index: usize| of.levels.partition_point(|&first| first as usize <= index);
                for index in 0..part.len() {
                    let there = all.find(part.marking(index)).expect("reachable") as usize;
                    // What was found last may belong to a level that has not begun.
                    assert!((0..2).contains(&(level(&all, there) - level(&part, index))));
                }
            }
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
        let table = |space: &Space| {
            let Set::Narrow(keyed) = &space.set else { panic!("few bits") };
            keyed.halves.as_ref().map_or(keyed.exact.claimed(), |halves| halves.claimed())
        };
        assert_eq!(one.memory.used() - table(&one), two.memory.used() - table(&two));
    }
}
