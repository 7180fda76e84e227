//! Firings that are not looked up, because another order of the same firings leads to the same marking.
//!
//! Two transitions are *independent* where neither changes a place that the other tests (tokens, contact, gates). Let a
//! breadth-first search have found x from p by s, and let t be independent of s, enabled at x and later in the list of
//! transitions. Then t is enabled at p too, and p t y s leads where x t does, from a marking y that is no further than x. So t
//! *sleeps* at x: that firing is counted, but nobody asks the table where it leads.
//!
//! No marking is missed, and none is found later. Let m be of the next level; of all firings from this level that lead to m
//! take one of the lowest transition, from x by t. Were it asleep, then x was found by some s before t, and s leads to m from
//! such a y, which is of this level, or m would not be of the next: a lower one. So one firing at least that leads to m is
//! looked up. It does not matter which of the ways to x came first, so two threads may find markings in any order, and of a
//! marking of which no way is known nothing sleeps.
//!
//! These are sleep sets (Godefroid, "Partial-Order Methods for the Verification of Concurrent Systems", LNCS 1032, 1996,
//! chapter 5), cut down to the last firing. Whole ones go along from marking to marking and have to be intersected whenever
//! one is reached again, a write for each look-up that is saved; here a marking says by which transition it was found, in the
//! search's own queue, and that is all. Machines that know nothing of each other are looked up twice for each marking then,
//! however many there are; philosophers 1.3 times in the place of 10.
//!
//! Which transitions sleep after which is laid out once, a row of bits for each. The rows of 64 markings are transposed
//! like the markings themselves, 64 transitions at a time and only where one of them fires; so a word says of each transition
//! at which of them it sleeps.

use crate::budget::Memory;
use crate::marking::transpose;
use crate::net::{Net, Transition};

/// Nets of more transitions do without: the rows are quadratic in their number, and testing so many takes longer than
/// looking up what fires.
const TRANSITIONS_MOST: usize = 1 << 11;
/// Fewer markings at once are not worth a transposition.
const MARKINGS_LEAST: usize = 8;

/// Which transitions sleep at a marking, by the one that it was found by.
#[derive(Debug)]
pub(crate) struct Sleep {
    /// A row that is empty, then for each transition those that sleep where it was the last to fire.
    rows: Vec<u64>,
    /// Words of a row; none where nothing ever sleeps.
    words: usize,
}

/// What a marking says that was found by a transition; 0 says nothing.
#[inline(always)]
pub(crate) fn last(t: usize) -> u16 {
    // Of more transitions than that there are no rows.
    (t as u16).wrapping_add(1)
}

impl Sleep {
    /// The rows of a net; without any where it has too many transitions, or they do not fit.
    pub(crate) fn new(net: &Net, memory: &Memory) -> Self {
        let count = net.transitions.len();
        let words = if (2..=TRANSITIONS_MOST).contains(&count) { count.div_ceil(64) } else { 0 };
        let Ok(mut rows) = memory.filled(0, (count + 1) * words) else { return Sleep { rows: Vec::new(), words: 0 } };
        if words == 0 {
            return Sleep { rows, words };
        }
        for (s, row) in rows.chunks_exact_mut(words).skip(1).enumerate() {
            row[s / 64..].fill(!0);
            row[s / 64] &= !1 << (s % 64);
        }
        let mut changing = vec![Vec::new(); net.places];
        for (t, Transition { inputs, outputs, .. }) in net.transitions.iter().enumerate() {
            inputs.iter().chain(outputs).for_each(|&p| changing[p as usize].push(t));
        }
        for (t, Transition { inputs, outputs, permissive, inhibitive, .. }) in net.transitions.iter().enumerate() {
            for &p in [inputs, outputs, permissive, inhibitive].into_iter().flatten() {
                for &s in &changing[p as usize] {
                    rows[(s + 1) * words + t / 64] &= !(1 << (t % 64));
                    rows[(t + 1) * words + s / 64] &= !(1 << (s % 64));
                }
            }
        }
        Sleep { rows, words }
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        8 * self.rows.len()
    }
}

/// What sleeps at each of up to 64 markings.
#[derive(Debug)]
pub(crate) struct Asleep {
    /// What the markings say, 0 for those that are not there.
    lasts: [u16; 64],
    /// For each transition, at which of them it sleeps.
    slices: Vec<[u64; 64]>,
    /// Which of these blocks are cut for other markings.
    stale: Vec<bool>,
    /// Whether anything sleeps at all.
    any: bool,
}

impl Asleep {
    /// Nothing sleeps.
    pub(crate) fn new(sleep: &Sleep) -> Self {
        Asleep::of_words(sleep.words)
    }

    /// Nothing ever sleeps.
    pub(crate) fn nothing() -> Self {
        Asleep::of_words(0)
    }

    fn of_words(words: usize) -> Self {
        Asleep { lasts: [0; 64], slices: vec![[0; 64]; words], stale: vec![true; words], any: false }
    }

    /// Takes markings by what they say.
    #[inline(always)]
    pub(crate) fn cut(&mut self, lasts: &[u16]) {
        self.any = lasts.len() >= MARKINGS_LEAST && !self.stale.is_empty();
        if self.any {
            let count = lasts.len().min(64);
            self.lasts[..count].copy_from_slice(&lasts[..count]);
            self.lasts[count..].fill(0);
            self.stale.fill(true);
        }
    }

    /// At which of them a transition sleeps.
    #[inline(always)]
    pub(crate) fn of(&mut self, sleep: &Sleep, t: usize) -> u64 {
        if !self.any {
            return 0;
        }
        if self.stale[t / 64] {
            self.cut_block(sleep, t / 64);
        }
        self.slices[t / 64][t % 64]
    }

    #[inline(never)]
    fn cut_block(&mut self, sleep: &Sleep, block: usize) {
        let rows = &mut self.slices[block];
        for (row, &last) in rows.iter_mut().zip(&self.lasts) {
            *row = sleep.rows[usize::from(last) * sleep.words + block];
        }
        transpose(rows);
        self.stale[block] = false;
    }
}

/// By which transitions the markings of the last levels were found, by their index. Of what has no room nothing is known.
#[derive(Debug, Default)]
pub(crate) struct Trail {
    first: usize,
    lasts: Vec<u16>,
}

impl Trail {
    /// Forgets the markings before an index, which never goes back.
    pub(crate) fn forget(&mut self, before: usize) {
        debug_assert!(before >= self.first);
        let gone = before.saturating_sub(self.first).min(self.lasts.len());
        self.lasts.drain(..gone);
        self.first = before;
    }

    /// Takes what the markings from an index on say; of those before it that have said nothing, nothing is known.
    #[inline(always)]
    pub(crate) fn append(&mut self, index: usize, lasts: &[u16], memory: &Memory) {
        let len = index - self.first;
        if self.lasts.len() == len && self.lasts.capacity() - len >= lasts.len() {
            self.lasts.extend_from_slice(lasts);
        } else {
            self.make_room(len, lasts, memory);
        }
    }

    #[cold]
    fn make_room(&mut self, len: usize, lasts: &[u16], memory: &Memory) {
        self.lasts.truncate(len);
        let more = len - self.lasts.len();
        if memory.extend(&mut self.lasts, 0, more + lasts.len()).is_ok() {
            self.lasts[len..].copy_from_slice(lasts);
        }
    }

    /// What the markings of a range say; of some at its end perhaps nothing.
    #[inline(always)]
    pub(crate) fn of(&self, first: usize, end: usize) -> &[u16] {
        let len = self.lasts.len();
        &self.lasts[(first - self.first).min(len)..(end - self.first).min(len)]
    }

    /// Begins anew, and keeps the memory.
    pub(crate) fn clear(&mut self) {
        self.lasts.clear();
        self.first = 0;
    }
}

/// All of that for a search over markings with indexes.
#[derive(Debug)]
pub(crate) struct Sleeping {
    pub(crate) sleep: Sleep,
    pub(crate) trail: Trail,
    /// Of the batch that is expanded.
    asleep: Asleep,
}

impl Sleeping {
    /// Nothing is known of any marking of a net.
    pub(crate) fn new(net: &Net, memory: &Memory) -> Self {
        let sleep = Sleep::new(net, memory);
        Sleeping { asleep: Asleep::new(&sleep), sleep, trail: Trail::default() }
    }

    /// Takes the markings of a range, at most 64.
    #[inline(always)]
    pub(crate) fn cut(&mut self, first: usize, end: usize) {
        self.asleep.cut(self.trail.of(first, end));
    }

    /// Those firings of a transition, at the markings taken, that are to be looked up.
    #[inline(always)]
    pub(crate) fn awake(&mut self, t: usize, fire: u64) -> u64 {
        fire & !self.asleep.of(&self.sleep, t)
    }

    /// Gives the memory back.
    pub(crate) fn leave(self, memory: &Memory) {
        memory.drop_vec(self.trail.lasts);
        memory.release(self.sleep.bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::{machines, random_nets, random_spaces};
    use std::collections::HashMap;

    fn sleep_of(net: &Net) -> Sleep {
        Sleep::new(net, &Memory::new(1 << 20))
    }

    fn sleeps(sleep: &Sleep, s: usize, t: usize) -> bool {
        sleep.rows[usize::from(last(s)) * sleep.words + t / 64] >> (t % 64) & 1 == 1
    }

    #[test]
    fn later_transitions_sleep_that_share_no_place_that_either_changes() {
        for net in random_nets(150) {
            let sleep = sleep_of(&net);
            for (s, a) in net.transitions.iter().enumerate() {
                for (t, b) in net.transitions.iter().enumerate() {
                    let changed = |of: &Transition| [of.inputs.clone(), of.outputs.clone()].concat();
                    let tested = |of: &Transition| [changed(of), of.permissive.clone(), of.inhibitive.clone()].concat();
                    let meets = |one: &[u32], other: &[u32]| one.iter().any(|p| other.contains(p));
                    let apart = !meets(&changed(a), &tested(b)) && !meets(&changed(b), &tested(a));
                    assert_eq!(sleeps(&sleep, s, t), s < t && apart);
                }
            }
        }
    }

    #[test]
    fn whatever_sleeps_leads_where_another_marking_of_the_level_leads_that_is_awake() {
        let mut slept = 0;
        for space in random_spaces(150, false) {
            let (net, sleep) = (&space.net, sleep_of(&space.net));
            let level = |index: usize| space.levels.partition_point(|&first| first as usize <= index);
            let after = |index: usize, t: u32| -> usize {
                let flip = net.flip(t as usize, net.words);
                let after: Vec<u64> = space.marking(index).iter().zip(flip).map(|(a, b)| a ^ b).collect();
                space.find(&after).expect("all are found") as usize
            };
            let enabled: Vec<Vec<u32>> =
                (0..space.len()).map(|index| space.enabled_by(&net.forward, space.marking(index))).collect();
            // Of each marking, every transition that it may have been found by; and all that leads to it from the level before.
            let mut found_by = vec![Vec::new(); space.len()];
            let mut into = vec![Vec::new(); space.len()];
            for (index, firing) in enabled.iter().enumerate() {
                for &t in firing {
                    let to = after(index, t);
                    if level(to) == level(index) + 1 {
                        found_by[to].push(t as usize);
                        into[to].push((index, t as usize));
                    }
                }
            }
            for into in into.iter().filter(|into| !into.is_empty()) {
                // Whichever they are found by, one that leads there is awake.
                let worst = |&&(from, t): &&(usize, usize)| found_by[from].iter().any(|&s| sleeps(&sleep, s, t));
                slept += into.iter().filter(worst).count();
                assert!(into.iter().any(|edge| !worst(&edge)));
            }
        }
        assert!(slept > 500, "{slept}");
    }

    #[test]
    fn every_marking_is_found_at_its_level() {
        for space in random_spaces(150, false) {
            let mut levels = HashMap::from([(space.net.initial.clone(), 0)]);
            let mut now = vec![space.net.initial.clone()];
            for level in 1.. {
                let mut next = Vec::new();
                for marking in &now {
                    for t in space.enabled_by(&space.net.forward, marking) {
                        let flip = space.net.flip(t as usize, space.net.words);
                        let after: Vec<u64> = marking.iter().zip(flip).map(|(a, b)| a ^ b).collect();
                        levels.entry(after.clone()).or_insert_with(|| {
                            next.push(after);
                            level
                        });
                    }
                }
                if next.is_empty() {
                    break;
                }
                now = next;
            }
            assert_eq!(space.len(), levels.len());
            for index in 0..space.len() {
                let level = space.levels.partition_point(|&first| first as usize <= index) - 1;
                assert_eq!(levels.get(space.marking(index)), Some(&level));
            }
        }
    }

    #[test]
    fn a_batch_says_of_each_transition_where_it_sleeps() {
        // More transitions than a word has bits.
        let net = machines(70, 0);
        let (sleep, mut poll) = (sleep_of(&net), 1_usize);
        let mut asleep = Asleep::new(&sleep);
        for count in [64, 9, MARKINGS_LEAST, MARKINGS_LEAST - 1, 0, 33] {
            let lasts: Vec<u16> = (0..count)
                .map(|_| {
                    poll = poll * 37 % 141;
                    poll as u16
                })
                .collect();
            asleep.cut(&lasts);
            for t in (0..net.transitions.len()).rev() {
                let word = asleep.of(&sleep, t);
                for j in 0..64 {
                    let known = lasts.get(j).filter(|&&last| last > 0 && count >= MARKINGS_LEAST);
                    let expected = known.is_some_and(|&last| sleeps(&sleep, usize::from(last) - 1, t));
                    assert_eq!(word >> j & 1 == 1, expected);
                }
            }
        }
    }

    #[test]
    fn without_rows_nothing_sleeps() {
        let large = machines(TRANSITIONS_MOST as u32 / 2 + 1, 0);
        for sleep in [sleep_of(&large), Sleep::new(&machines(70, 0), &Memory::new(100)), sleep_of(&machines(0, 0))] {
            let mut asleep = Asleep::new(&sleep);
            asleep.cut(&[1; 64]);
            assert_eq!((asleep.of(&sleep, 3), sleep.bytes()), (0, 0));
        }
    }

    #[test]
    fn a_trail_says_of_each_index_what_was_said_or_nothing() {
        let memory = Memory::new(1 << 12);
        let mut trail = Trail::default();
        trail.append(0, &[7, 8], &memory);
        trail.append(4, &[9], &memory);
        assert_eq!(trail.of(0, 9), [7, 8, 0, 0, 9]);
        trail.forget(1);
        assert_eq!((trail.of(1, 4), trail.of(4, 6)), ([8, 0, 0].as_slice(), [9].as_slice()));
        trail.forget(10);
        trail.append(12, &[3; 40], &memory);
        assert_eq!(trail.of(10, 14), [0, 0, 3, 3]);
        // For want of memory it says nothing, and of what comes after that nothing wrong.
        trail.append(52, &[5; 4000], &memory);
        trail.append(4052, &[6], &memory);
        assert!(trail.of(52, 5000).iter().all(|&last| last == 0) && trail.of(12, 52) == [3; 40]);
        trail.forget(4050);
        trail.append(4053, &[4], &memory);
        assert_eq!(trail.of(4050, 5000), [0, 0, 0, 4]);
        trail.clear();
        trail.append(1, &[2], &memory);
        assert_eq!(trail.of(0, 2), [0, 2]);
        memory.drop_vec(trail.lasts);
        assert_eq!(memory.used(), 0);
    }
}
