//! One thread of a pair: it expands its share of a level, files the successors that are its own, and sends the others to
//! their owner, a parcel in each round.
//!
//! A parcel of a round is read after the next one is sent, so that a thread seldom waits for the other. Who has sent his last
//! reads all that is left, and says how many markings he has found. Where the set allows it, both then take up the next
//! level, each with what he found himself: nobody else joins in, and nothing is moved. What is read when depends on the
//! rounds alone, never on the clock, and so does where both end.
//!
//! Both have about the same to do, so who waits looks again and again for a while before he sleeps: to be woken takes
//! longer than most waits. After the first looks he offers his processor each time to whoever wants it: that may be the
//! other thread, for which he waits, where a third program has taken the second processor. Two threads of which one only
//! looked while the other stood in the queue behind it took twice the time of one.

use std::hint::spin_loop;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvError, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::thread::yield_now;
use std::time::Duration;

use super::half::{BLOCK, End, Finds, Half, To};
use crate::batch::Batch;
use crate::budget::{Found, Stop, Watch};
use crate::marking::Width;
use crate::net::Net;
use crate::sleep::{Asleep, Sleeping};
use crate::table::NONE;

/// Edges that are looked up before a round ends.
const ROUND_ASKED: u64 = 1 << 12;
/// Small levels that both go through all the same: they may be the last, and then the set need not be put together.
const SMALL_MOST: usize = 64;
/// Looks for a message before one sleeps, some hundred microseconds; so many of them at once, some microseconds.
const LOOKS: usize = 1 << 9;
const LOOKS_AT_ONCE: usize = 1 << 7;

/// Messages that may be under way; more would be more buffers than are claimed, where one is at something that takes long.
const UNDER_WAY: usize = 4;
/// Empty buffers that are kept: who hands over less than he is sent would have ever more.
const SPARE_MOST: usize = 2;
/// How long one sleeps before he looks whether he is still wanted.
const SLEEP: Duration = Duration::from_millis(20);

/// What both threads know of the work.
pub(crate) struct Work<'a> {
    pub(crate) net: &'a Net,
    /// The markings found before, end to end.
    pub(crate) old: &'a [u64],
    /// Ranges of at most `BLOCK` of them that are to be expanded, dealt out in turn.
    pub(crate) open: &'a [(usize, usize)],
    /// How many markings there are before the first that is found now.
    pub(crate) base: usize,
    /// The fewest markings for which they go on to the next level, but for a few smaller ones; none where they must not.
    pub(crate) go_on: Option<usize>,
    /// What sleeps, and by which transitions the markings found before were found.
    pub(crate) sleeping: &'a Sleeping,
    /// Whether a second processor is free.
    pub(crate) free: &'a AtomicBool,
    /// Whether the first of them must end while the second does not hear it.
    pub(crate) stopped: &'a AtomicBool,
    /// What had been found when the threads began.
    pub(crate) before: Found,
}

/// The markings that a thread has to expand.
#[derive(Clone, Copy)]
enum Share {
    /// Every other range of those that are open.
    Dealt,
    /// What it found in the level before: from which of its finds on, the index of the level, and how many both found.
    Own { from: usize, base: usize, counts: [usize; 2] },
}

impl Share {
    /// The k-th block of a thread: the index of its first marking, how many, and which of the finds is the first if they
    /// are its own.
    fn block(self, work: &Work<'_>, id: usize, k: usize) -> Option<(usize, usize, Option<usize>)> {
        match self {
            Share::Dealt => work.open.get(2 * k + id).map(|&(first, end)| (first, end - first, None)),
            Share::Own { from, base, counts } => {
                let i = k * BLOCK;
                let count = counts[id].checked_sub(i).filter(|&left| left > 0)?.min(BLOCK);
                Some((base + place(counts, id, i), count, Some(from + i)))
            }
        }
    }
}

/// The number in a level of the i-th marking that a thread has found of it: in turn a block of each, then what one and the
/// other have more.
fn place(counts: [usize; 2], id: usize, i: usize) -> usize {
    let even = counts[0].min(counts[1]) / BLOCK * BLOCK;
    if i < even {
        return (i / BLOCK * 2 + id) * BLOCK + i % BLOCK;
    }
    i + even + if id == 1 { counts[0] - even } else { 0 }
}

/// Records end to end.
#[derive(Default)]
struct Records {
    all: Vec<u64>,
    /// How many words are used.
    len: usize,
}

/// What one thread sends another.
enum Message {
    /// The records of a round; the last of a level or not, why the sender must end, and whether he takes more room next.
    Parcel { records: Records, last: bool, end: Option<End>, found: Found, grows: bool },
    /// All parcels are filed: what was found of the next level, why the sender must end, and whether he would go on.
    Filed { count: usize, end: Option<End>, go_on: bool },
}

/// The ends of the channels of one thread, to and from the other.
pub(crate) struct Port {
    to: SyncSender<Message>,
    from: Receiver<Message>,
}

impl Port {
    /// Both.
    pub(crate) fn both() -> [Port; 2] {
        let ((a, to_a), (b, to_b)) = (sync_channel(UNDER_WAY), sync_channel(UNDER_WAY));
        [Port { to: b, from: to_a }, Port { to: a, from: to_b }]
    }

    /// Who has panicked receives nothing more; that comes out where he is joined.
    fn send(&self, message: Message) {
        let _ = self.to.send(message);
    }

    /// What the other has sent; nothing where that takes long.
    fn receive(&self) -> Result<Option<Message>, RecvError> {
        for look in 0..LOOKS {
            match self.from.try_recv() {
                Ok(message) => return Ok(Some(message)),
                Err(TryRecvError::Disconnected) => return Err(RecvError),
                Err(TryRecvError::Empty) if look < LOOKS_AT_ONCE => spin_loop(),
                Err(TryRecvError::Empty) => yield_now(),
            }
        }
        match self.from.recv_timeout(SLEEP) {
            Ok(message) => Ok(Some(message)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(RecvError),
        }
    }
}

/// A thread: what it found in this level, and what it counted in all of them.
pub(crate) struct Member {
    pub(crate) finds: Finds,
    /// What of the last level is its, and how many blocks of that were expanded.
    share: Share,
    blocks: usize,
    pub(crate) edges: u64,
    /// How many of the edges were looked up.
    asked: u64,
    pub(crate) fired: Vec<u64>,
    pub(crate) contacts: Vec<u64>,
    pub(crate) contact_witness: Vec<u32>,
    pub(crate) deadlocks: Vec<u32>,
    /// Records for the other.
    theirs: Records,
    /// Empty buffers, and the words of the largest.
    spare: Vec<Records>,
    room: usize,
    batch: Batch,
    asleep: Asleep,
    /// Of the block: which transitions fire where, and where that is to be looked up; and which are in contact where.
    firing: Vec<(u32, u64, u64)>,
    contact: Vec<(u32, u64)>,
}

impl Member {
    /// Thread 0 or 1.
    pub(crate) fn new(id: usize, net: &Net) -> Self {
        let count = net.transitions.len();
        Member {
            finds: Finds::new(id, net.words),
            share: Share::Dealt,
            blocks: 0,
            edges: 0,
            asked: 0,
            fired: vec![0; count],
            contacts: vec![0; count],
            contact_witness: vec![NONE; count],
            deadlocks: Vec::new(),
            theirs: Records::default(),
            spare: Vec::new(),
            room: 0,
            batch: Batch::new(net),
            asleep: Asleep::nothing(),
            firing: Vec::new(),
            contact: Vec::new(),
        }
    }

    /// Works until there is nothing to go on with or somebody cannot go on; why it ended.
    pub(crate) fn work<W: Width>(
        &mut self,
        width: W,
        work: &Work<'_>,
        half: &mut impl Half<W>,
        port: &Port,
        watch: &mut Watch<'_>,
    ) -> Option<End> {
        (self.share, self.blocks) = (Share::Dealt, 0);
        self.asleep = Asleep::new(&work.sleeping.sleep);
        if let Err(stop) = half.begin(&self.finds.memory, watch) {
            self.finds.close(stop);
        }
        // Who is left alone by a panic ends as if all were done; that comes out where the other is joined.
        let (_, begun, mut go_on) = self.agree(work, port, 0, watch).ok()?;
        if begun.is_some() {
            return begun;
        }
        let (mut from, mut base) = (0, work.base);
        let (mut spent, mut found, mut small) = (0, 0, 0);
        loop {
            self.blocks = 0;
            let ended = self.level(width, work, half, port, watch).ok()?;
            let count = self.finds.fresh.len() - from;
            let (others, end, also);
            (others, end, also) = self.agree(work, port, count, watch).ok()?;
            go_on &= also;
            let ended = ended.max(end);
            self.finds.levels.push(count);
            spent += 2 * count.max(others);
            found += count + others;
            let is_uneven = found > work.base && 4 * spent > 5 * found;
            small += usize::from(work.go_on.is_none_or(|least| count + others < least));
            let is_worth_it = go_on && !is_uneven && work.go_on.is_some() && small <= SMALL_MOST;
            if ended.is_some() || count + others == 0 || !is_worth_it {
                return ended;
            }
            let counts = if self.finds.id == 0 { [count, others] } else { [others, count] };
            self.share = Share::Own { from, base, counts };
            self.finds.trail.forget(from);
            from += count;
            base += count + others;
        }
    }

    /// Tells the other how much was found of a level, and hears it of him; why one of them must end, and whether both would
    /// go on. Both conclude the same: what one notices while he waits he says in the next level.
    fn agree(
        &mut self,
        work: &Work<'_>,
        port: &Port,
        count: usize,
        watch: &mut Watch<'_>,
    ) -> Result<(usize, Option<End>, bool), RecvError> {
        let (go_on, said) = (work.free.load(Ordering::Relaxed), self.finds.end);
        port.send(Message::Filed { count, end: said, go_on });
        let Message::Filed { count, end, go_on: also } = self.next(work, port, watch)? else {
            unreachable!("a thread says last that all is filed")
        };
        Ok((count, end.max(said), go_on && also))
    }

    /// The next message of the other.
    fn next(&mut self, work: &Work<'_>, port: &Port, watch: &mut Watch<'_>) -> Result<Message, RecvError> {
        loop {
            if let Some(message) = port.receive()? {
                return Ok(message);
            }
            // He is at something that takes long, such as a larger table.
            if let Err(stop) = watch.tick(ROUND_ASKED as usize) {
                self.stop(work, stop);
            }
        }
    }

    /// Ends because time is over, or nobody needs the answer; who does not hear it in time looks himself.
    #[cold]
    fn stop(&mut self, work: &Work<'_>, stop: Stop) {
        work.stopped.store(true, Ordering::Relaxed);
        self.finds.end(End::Stopped(stop));
    }

    /// Expands its share of a level, as long as nobody must end, and files all that is its; why the other must end.
    fn level<W: Width>(
        &mut self,
        width: W,
        work: &Work<'_>,
        half: &mut impl Half<W>,
        port: &Port,
        watch: &mut Watch<'_>,
    ) -> Result<Option<End>, RecvError> {
        let (mut sent, mut read) = (0, 0);
        let (mut is_last, mut was_last, mut its_end) = (false, false, None);
        while !is_last || !was_last {
            if !is_last {
                if self.finds.end.is_none() && its_end.is_none() {
                    self.round(width, work, half, watch);
                }
                let done = self.share.block(work, self.finds.id, self.blocks).is_none();
                is_last = done || self.finds.end.is_some() || its_end.is_some();
                let found = Found { markings: self.finds.fresh.len() as u64, edges: self.edges };
                let records = std::mem::replace(&mut self.theirs, self.spare.pop().unwrap_or_default());
                let grows = half.wants_room(false);
                port.send(Message::Parcel { records, last: is_last, end: self.finds.end, found, grows });
                sent += 1;
                if grows {
                    half.take_room(&mut self.finds, watch);
                }
            }
            while !was_last && (is_last || read + 1 < sent) {
                let Message::Parcel { records, last, end, found: other, grows } = self.next(work, port, watch)? else {
                    unreachable!("a thread says that all is filed after its last parcel")
                };
                self.receive(width, half, records, watch);
                if grows && half.wants_room(true) {
                    half.take_room(&mut self.finds, watch);
                }
                (was_last, its_end) = (last, its_end.max(end));
                read += 1;
                watch.found.markings = work.before.markings + self.finds.fresh.len() as u64 + other.markings;
                watch.found.edges = work.before.edges + self.edges + other.edges;
                if let Err(stop) = watch.tick(ROUND_ASKED as usize) {
                    self.stop(work, stop);
                }
            }
        }
        Ok(its_end)
    }

    /// The ranges of indexes that it has to expand and has not.
    pub(crate) fn left<'a>(&'a self, work: &'a Work<'_>) -> impl Iterator<Item = (usize, usize)> + 'a {
        (self.blocks..)
            .map_while(|k| self.share.block(work, self.finds.id, k))
            .map(|(first, count, _)| (first, first + count))
    }

    /// Files what the other sent, and keeps its buffer.
    fn receive<W: Width>(&mut self, width: W, half: &mut impl Half<W>, mut records: Records, watch: &mut Watch<'_>) {
        half.insert(width, &records.all[..records.len], &mut self.finds, watch);
        records.len = 0;
        if self.spare.len() < SPARE_MOST {
            self.spare.push(records);
        }
    }

    /// Expands blocks of its share until a round's edges are looked up.
    fn round<W: Width>(&mut self, width: W, work: &Work<'_>, half: &mut impl Half<W>, watch: &mut Watch<'_>) {
        let first = self.asked;
        while self.finds.end.is_none() && self.asked - first < ROUND_ASKED {
            let Some(block) = self.share.block(work, self.finds.id, self.blocks) else { break };
            let before = self.edges;
            if let Err(stop) = self.expand(width, work, half, block, watch) {
                debug_assert_eq!(stop, Stop::Memory);
                self.finds.end(End::Short);
                break;
            }
            if let Err(stop) = watch.tick(BLOCK + (self.edges - before) as usize + work.net.transitions.len()) {
                self.stop(work, stop);
            }
        }
        let theirs = (self.theirs.all.as_mut_slice(), &mut self.theirs.len);
        half.end(width, work.net, &self.batch, true, To { finds: &mut self.finds, theirs, watch });
    }

    /// Expands one block, unless there is no memory for what it gives.
    fn expand<W: Width>(
        &mut self,
        width: W,
        work: &Work<'_>,
        half: &mut impl Half<W>,
        (first, count, own): (usize, usize, Option<usize>),
        watch: &mut Watch<'_>,
    ) -> Result<(), Stop> {
        let (net, words) = (work.net, width.words());
        let (all, at) = own.map_or((work.old, first), |own| (self.finds.fresh.all(), own));
        self.batch.markings.clear();
        self.batch.markings.extend_from_slice(&all[at * words..(at + count) * words]);
        half.cut(width, &mut self.batch);
        let trail = if own.is_some() { &self.finds.trail } else { &work.sleeping.trail };
        self.asleep.cut(trail.of(at, at + count));
        self.firing.clear();
        self.contact.clear();
        let (mut edges, mut asked, mut alive) = (0, 0, 0);
        for t in 0..net.transitions.len() {
            let (base, blocked) = net.forward.test(t, &self.batch.slices, self.batch.valid);
            if base == 0 {
                continue;
            }
            if base & blocked != 0 {
                self.contact.push((t as u32, base & blocked));
            }
            let fire = base & !blocked & net.forward.edge(t);
            if fire != 0 {
                alive |= fire;
                let awake = fire & !self.asleep.of(&work.sleeping.sleep, t);
                edges += fire.count_ones() as usize;
                asked += awake.count_ones() as usize;
                self.firing.push((t as u32, fire, awake));
            }
        }
        self.make_room((asked + 1) * half.stride(width))?;
        let mut dead = self.batch.valid & !alive;
        if dead != 0 {
            // All or none of them: what has no memory is expanded again.
            let known = self.deadlocks.len();
            self.finds.memory.extend(&mut self.deadlocks, 0, dead.count_ones() as usize)?;
            for index in &mut self.deadlocks[known..] {
                *index = first as u32 + dead.trailing_zeros();
                dead &= dead - 1;
            }
        }
        for &(t, contact) in &self.contact {
            let (t, index) = (t as usize, first as u32 + contact.trailing_zeros());
            self.contacts[t] += u64::from(contact.count_ones());
            self.contact_witness[t] = self.contact_witness[t].min(index);
        }
        self.edges += edges as u64;
        self.asked += asked as u64;
        self.blocks += 1;
        for &(t, fire, awake) in &self.firing {
            self.fired[t as usize] += u64::from(fire.count_ones());
            let theirs = (self.theirs.all.as_mut_slice(), &mut self.theirs.len);
            let to = To { finds: &mut self.finds, theirs, watch };
            half.push(width, net, &self.batch, t as usize, awake, to);
        }
        let theirs = (self.theirs.all.as_mut_slice(), &mut self.theirs.len);
        half.end(width, net, &self.batch, false, To { finds: &mut self.finds, theirs, watch });
        Ok(())
    }

    /// Forgets what it counted.
    pub(crate) fn forget(&mut self) {
        self.edges = 0;
        self.fired.fill(0);
        self.contacts.fill(0);
        self.contact_witness.fill(NONE);
        self.deadlocks.clear();
    }

    /// Room for so many words more in the buffer.
    #[inline(always)]
    fn make_room(&mut self, words: usize) -> Result<(), Stop> {
        let records = &mut self.theirs;
        if records.len + words > records.all.len() {
            let len = (records.len + words).max(self.room).next_power_of_two();
            // One that is filled, one on its way, one that is read, and what of it is left over.
            self.finds.memory.claim(4 * 8 * (len - self.room))?;
            self.room = len;
            records.all.resize(len, 0);
        }
        Ok(())
    }
}
