//! One thread of a pair: it expands its share of a level, files the successors whose hash is its own, and sends the others
//! to their owner, a parcel in each round.
//!
//! A parcel of a round is read after the next one is sent, so that a thread seldom waits for the other. Both see the same
//! flags of the same round, and so end in the same round without asking anybody.

use std::sync::mpsc::{Receiver, Sender, channel};

use super::half::{BLOCK, End, Finds, Half};
use crate::batch::Batch;
use crate::budget::{Found, Stop, Watch};
use crate::marking::Width;
use crate::net::Net;
use crate::table::NONE;

/// Edges after which a round ends.
const ROUND_EDGES: u64 = 1 << 14;

/// What both threads know of the level.
pub(crate) struct Level<'a> {
    pub(crate) net: &'a Net,
    /// The markings found before, end to end.
    pub(crate) old: &'a [u64],
    /// The level itself.
    pub(crate) start: usize,
    pub(crate) end: usize,
    /// What had been found when the threads began.
    pub(crate) before: Found,
}

/// Records end to end.
#[derive(Default)]
struct Records {
    all: Vec<u64>,
    /// How many words are used.
    len: usize,
}

/// What one thread sends another once a round.
struct Parcel {
    records: Records,
    /// Whether the sender has expanded all its share.
    done: bool,
    end: Option<End>,
    found: Found,
}

/// The ends of the channels of one thread, to and from the other.
pub(crate) struct Port {
    to: Sender<Parcel>,
    from: Receiver<Parcel>,
}

impl Port {
    /// Both.
    pub(crate) fn both() -> [Port; 2] {
        let ((a, to_a), (b, to_b)) = (channel(), channel());
        [Port { to: b, from: to_a }, Port { to: a, from: to_b }]
    }
}

/// A thread: what it found in this level, and what it counted in all of them.
pub(crate) struct Member {
    pub(crate) finds: Finds,
    /// Blocks of the level that were expanded.
    pub(crate) blocks: usize,
    pub(crate) edges: u64,
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
    /// Of the block: which transitions fire where, and which are in contact where.
    firing: Vec<(u32, u64)>,
    contact: Vec<(u32, u64)>,
}

impl Member {
    /// Thread 0 or 1.
    pub(crate) fn new(id: usize, net: &Net) -> Self {
        let count = net.transitions.len();
        Member {
            finds: Finds::new(id, net.words),
            blocks: 0,
            edges: 0,
            fired: vec![0; count],
            contacts: vec![0; count],
            contact_witness: vec![NONE; count],
            deadlocks: Vec::new(),
            theirs: Records::default(),
            spare: Vec::new(),
            room: 0,
            batch: Batch::new(net.words),
            firing: Vec::new(),
            contact: Vec::new(),
        }
    }

    /// Works on the level until it is done or somebody cannot go on; why it ended.
    pub(crate) fn work<W: Width>(
        &mut self,
        width: W,
        level: &Level<'_>,
        half: &mut impl Half<W>,
        port: &Port,
        mut watch: Option<&mut Watch<'_>>,
    ) -> Option<End> {
        let mut other = Found::default();
        let mut before: Option<(bool, Option<End>)> = None;
        loop {
            if self.finds.end.is_none() {
                self.round(width, level, half, watch.as_deref_mut());
            }
            let found = Found { markings: self.finds.fresh.len() as u64, edges: self.edges };
            let now = (self.is_done(level), self.finds.end);
            let records = std::mem::replace(&mut self.theirs, self.spare.pop().unwrap_or_default());
            // Who has panicked receives nothing more; that comes out where he is joined.
            let _ = port.to.send(Parcel { records, done: now.0, end: now.1, found });
            if let Some((done, end)) = before {
                let parcel = port.from.recv().ok()?;
                let (done, end) = (done && parcel.done, end.max(parcel.end));
                other = parcel.found;
                self.receive(width, half, parcel.records);
                if done || end.is_some() {
                    // What is on its way was counted already.
                    let last = port.from.recv().ok()?;
                    self.receive(width, half, last.records);
                    return end.max(last.end).max(self.finds.end);
                }
            }
            before = Some(now);
            if let Some(watch) = &mut watch {
                watch.found.markings = level.before.markings + found.markings + other.markings;
                watch.found.edges = level.before.edges + found.edges + other.edges;
            }
        }
    }

    fn is_done(&self, level: &Level<'_>) -> bool {
        level.start + (2 * self.blocks + self.finds.id) * BLOCK >= level.end
    }

    /// Files what the other sent, and keeps its buffer.
    fn receive<W: Width>(&mut self, width: W, half: &mut impl Half<W>, mut records: Records) {
        half.insert(width, &records.all[..records.len], &mut self.finds);
        records.len = 0;
        self.spare.push(records);
    }

    /// Expands blocks of its share until a round's edges are followed.
    fn round<W: Width>(
        &mut self,
        width: W,
        level: &Level<'_>,
        half: &mut impl Half<W>,
        mut watch: Option<&mut Watch<'_>>,
    ) {
        let first = self.edges;
        while self.finds.end.is_none() && !self.is_done(level) && self.edges - first < ROUND_EDGES {
            let before = self.edges;
            if let Err(stop) = self.expand(width, level, half) {
                debug_assert_eq!(stop, Stop::Memory);
                self.finds.end(End::Short);
                break;
            }
            if let Some(watch) = &mut watch
                && let Err(stop) = watch.tick(BLOCK + (self.edges - before) as usize + level.net.transitions.len())
            {
                self.finds.end(End::Stopped(stop));
            }
        }
        half.settle(width, true, &mut self.finds);
    }

    /// Expands one block, unless there is no memory for what it gives.
    fn expand<W: Width>(&mut self, width: W, level: &Level<'_>, half: &mut impl Half<W>) -> Result<(), Stop> {
        let (net, words) = (level.net, width.words());
        let first = level.start + (2 * self.blocks + self.finds.id) * BLOCK;
        let end = level.end.min(first + BLOCK);
        self.batch.markings.clear();
        self.batch.markings.extend_from_slice(&level.old[first * words..end * words]);
        half.cut(width, &mut self.batch);
        self.firing.clear();
        self.contact.clear();
        let (mut edges, mut alive) = (0, 0);
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
                edges += fire.count_ones() as usize;
                self.firing.push((t as u32, fire));
            }
        }
        self.make_room((edges + 1) * half.stride(width))?;
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
        self.blocks += 1;
        for &(t, fire) in &self.firing {
            self.fired[t as usize] += u64::from(fire.count_ones());
            half.push(width, net, &self.batch, t as usize, fire, (&mut self.theirs.all, &mut self.theirs.len));
            half.settle(width, false, &mut self.finds);
        }
        Ok(())
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
