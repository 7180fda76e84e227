//! The searches for an until: depth first, with the components on the way.
//!
//! All that is open on the way leads to what is found; a component that is left without it leads to none, so each marking is
//! settled the first time it is met. Which firing is tried first is a round's to say. What is firable at a marking follows
//! from what was firable before the firing that led there; these lists lie on a stack, as long as the way.

use super::formula::Until;
use super::search::{Local, MET, OUTERMOST, Truth, known};
use crate::budget::{Found, Stop, Watch};
use crate::marking::Width;
use crate::stubborn::dependencies::negation;
use crate::table::NONE;

/// A marking on the way: its firable transitions as a range of the stack of those, how many are done, and when it was met.
#[derive(Clone, Copy, Debug)]
struct Frame {
    marking: u32,
    firable: (usize, usize),
    next: usize,
    met: u32,
}

/// A component on the way: when its first marking was met, and whether something that was left open may lead on from it.
#[derive(Clone, Copy, Debug)]
struct Root {
    met: u32,
    open: bool,
}

/// What a search has on its way.
#[derive(Default)]
pub(super) struct Way {
    frames: Vec<Frame>,
    roots: Vec<Root>,
    live: Vec<u32>,
    firable: Vec<u32>,
}

impl Local<'_> {
    /// The value of an until, of some run or of each; a search unless it is known.
    pub(super) fn until<W: Width>(
        &mut self,
        width: W,
        until: &Until,
        marking: u32,
        outermost: bool,
        watch: &mut Watch<'_>,
    ) -> Result<Truth, Stop> {
        if let Some(truth) = known(self.word(until.node, marking)) {
            return Ok(truth);
        }
        let mut way = Way::default();
        let most = if outermost { self.budget.saturating_mul(OUTERMOST) } else { self.budget };
        let truth = self.search(width, until, marking, most, &mut way, watch)?;
        // Only what the search left on its way is still to be settled.
        for marking in way.live.drain(..) {
            self.words[until.node as usize][marking as usize] = truth.word();
        }
        self.memory.drop_vec(way.frames);
        self.memory.drop_vec(way.roots);
        self.memory.drop_vec(way.live);
        self.memory.drop_vec(way.firable);
        Ok(truth)
    }

    /// What a marking says of an until by itself: its value, or nothing where the search goes on from it; and whether it
    /// stays open even if the search meets nothing. A run that fails the until of each is never open on its way.
    fn here<W: Width>(
        &mut self,
        width: W,
        until: &Until,
        marking: u32,
        watch: &mut Watch<'_>,
    ) -> Result<(Option<Truth>, bool), Stop> {
        let end = self.value(width, until.right, marking, false, watch)?;
        if end == Truth::True {
            return Ok((Some(Truth::True), false));
        }
        let through = self.value(width, until.left, marking, false, watch)?;
        Ok(match (end, through) {
            (Truth::False, Truth::False) => (Some(Truth::False), false),
            (Truth::False, Truth::True) => (None, false),
            (Truth::Open, Truth::True) if until.some => (None, true),
            _ => (Some(Truth::Open), false),
        })
    }

    /// Depth first: for a marking that satisfies the until of some run, or for a run that fails the until of each.
    ///
    /// What is left in `way.live` has the value that is returned.
    fn search<W: Width>(
        &mut self,
        width: W,
        until: &Until,
        from: u32,
        most: usize,
        way: &mut Way,
        watch: &mut Watch<'_>,
    ) -> Result<Truth, Stop> {
        let (node, sought) = (until.node, Truth::from(until.some));
        if let Some(truth) = self.met(width, until, from, NONE, way, watch)? {
            return Ok(truth);
        }
        let mut count = 1;
        while let Some(&top) = way.frames.last() {
            let (first, end) = top.firable;
            if first == end && !until.some {
                return Ok(sought); // a deadlock: no run from here goes on
            }
            if top.next == end {
                way.frames.pop();
                way.firable.truncate(first);
                self.leave(node, top, sought, way);
                continue;
            }
            if let Some(frame) = way.frames.last_mut() {
                frame.next += 1;
            }
            let t = way.firable[top.next];
            let mut bits = self.marking(width, top.marking);
            self.flip(&mut bits, t);
            let after = self.number(width, &bits, watch)?;
            self.spare.push(bits);
            self.edges += 1;
            watch.found = Found { markings: self.table.store.len() as u64, edges: self.edges };
            watch.tick(1 + width.words())?;
            let word = self.word(node, after);
            let truth = match known(word) {
                None if word >= MET && !until.some => return Ok(sought), // a cycle
                None if word >= MET => {
                    join(way, word);
                    continue;
                }
                None if count >= most => return Ok(Truth::Open),
                None => {
                    count += 1;
                    self.met(width, until, after, t, way, watch)?
                }
                settled => settled,
            };
            match truth {
                Some(truth) if truth == sought => return Ok(sought),
                Some(Truth::Open) => way.roots.last_mut().into_iter().for_each(|root| root.open = true),
                _ => {}
            }
        }
        Ok(known(self.word(node, from)).unwrap_or(Truth::Open))
    }

    /// Settles a marking that is met for the first time by itself, or puts it on the way.
    fn met<W: Width>(
        &mut self,
        width: W,
        until: &Until,
        marking: u32,
        t: u32,
        way: &mut Way,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Truth>, Stop> {
        let (here, open) = self.here(width, until, marking, watch)?;
        if let Some(truth) = here {
            self.set(until.node, marking, truth.word())?;
            return Ok(here);
        }
        let met = MET + way.live.len() as u32;
        self.set(until.node, marking, met)?;
        let first = way.firable.len();
        self.find_firable(width, marking, t, way)?;
        self.arrange(width, until, marking, &mut way.firable[first..]);
        watch.tick(2 + way.firable.len() - first)?;
        let frame = Frame { marking, firable: (first, way.firable.len()), next: first, met };
        self.memory.push(&mut way.frames, frame)?;
        self.memory.push(&mut way.roots, Root { met, open })?;
        self.memory.push(&mut way.live, marking)?;
        Ok(None)
    }

    /// Settles the component of which a marking was the first, once all that follows it is done.
    fn leave(&mut self, node: u32, top: Frame, sought: Truth, way: &mut Way) {
        let Some(root) = way.roots.pop_if(|root| root.met == top.met) else { return };
        let truth = if root.open { Truth::Open } else { sought.not() };
        for marking in way.live.drain((top.met - MET) as usize..) {
            self.words[node as usize][marking as usize] = truth.word();
        }
        if root.open {
            way.roots.last_mut().into_iter().for_each(|root| root.open = true);
        }
    }

    /// Puts the firings from a marking in the order in which they are tried.
    fn arrange<W: Width>(&mut self, width: W, until: &Until, marking: u32, firable: &mut [u32]) {
        if let Some(random) = &mut self.random {
            for i in (1..firable.len()).rev() {
                firable.swap(i, random.below(i + 1));
            }
        }
        let guided = self.guided && until.some && firable.len() > 1;
        let Some(label) = self.formula.aims[until.right as usize].filter(|_| guided) else { return };
        let mut bits = self.marking(width, marking);
        let mut lacking = Vec::with_capacity(firable.len());
        for &t in firable.iter() {
            self.flip(&mut bits, t);
            lacking.push((self.formula.labels[label as usize].distance(&bits), t));
            self.flip(&mut bits, t);
        }
        self.spare.push(bits);
        lacking.sort_by_key(|&(distance, _)| distance);
        firable.iter_mut().zip(lacking).for_each(|(t, (_, other))| *t = other);
    }

    /// Appends what is firable at a marking, ascending, from what was so at the last one before `t` fired.
    pub(super) fn find_firable<W: Width>(&mut self, width: W, marking: u32, t: u32, way: &mut Way) -> Result<(), Stop> {
        let dependencies = &self.prepared.dependencies;
        let bits = self.table.store.get(width, marking as usize);
        let begin = way.firable.len();
        let Some(&Frame { firable: (first, end), .. }) = way.frames.last() else {
            let mut all = Vec::new();
            dependencies.all_firable(bits, &mut all);
            return all.into_iter().try_for_each(|u| self.memory.push(&mut way.firable, u));
        };
        self.seen.clear();
        for at in first..end {
            let u = way.firable[at];
            self.seen.insert(u);
            if dependencies.firable(u, bits) {
                self.memory.push(&mut way.firable, u)?;
            }
        }
        for &l in dependencies.flipped(t) {
            for &u in dependencies.needers.of(negation(l)) {
                if self.seen.insert(u) && dependencies.firable(u, bits) {
                    self.memory.push(&mut way.firable, u)?;
                }
            }
        }
        way.firable[begin..].sort_unstable();
        Ok(())
    }
}

/// Makes one component of all that a firing back to what was met then goes round.
fn join(way: &mut Way, met: u32) {
    let mut open = false;
    while let Some(root) = way.roots.pop_if(|root| root.met > met) {
        open |= root.open;
    }
    way.roots.last_mut().into_iter().for_each(|root| root.open |= open);
}
