//! A shortest firing sequence to what a search met, by searching again: divide and conquer (Korf, Zhang, Thayer and
//! Hohwald, "Frontier search", 2005).
//!
//! A search that keeps two levels knows at which level it met a marking and not how it came there. A second search
//! carries with each marking the one that it came through at half the way. That halves the question, and each half is
//! searched for alone, to half the depth; what is so near that all its levels can be kept is read off them backwards.
//! The depth halves each time, and most nets have by far the most markings at the greatest depths; so all of it takes
//! about as long as the first search.

use std::collections::HashMap;

use super::{Compact, Hit, Plan};
use crate::budget::{Stop, Watch};
use crate::marking::holds;

/// Keys that are kept of a search near enough, as a part of the memory.
const KEPT_PART: usize = 8;
/// Keys that are always kept: a way of one firing is read off where it begins.
const LEAST_KEPT: usize = 1;

impl Compact {
    /// The transitions that fire on a shortest way from M0 to what a search has met.
    pub fn way_to(&mut self, hit: &Hit, watch: &mut Watch<'_>) -> Result<Vec<u32>, Stop> {
        let mut way = Vec::new();
        let mut open = vec![(self.span.key(&self.net.initial), hit.key, hit.level)];
        while let Some((from, to, length)) = open.pop() {
            if length == 0 {
                continue;
            }
            let keep = (self.memory_bytes / KEPT_PART / 8).max(LEAST_KEPT);
            let mark = Some(length / 2).filter(|&mark| mark > 0);
            let plan = Plan { from, all: false, target: Some(to), mark, keep };
            let mut swept = self.sweep(plan, watch);
            if swept.target.is_none() && swept.outcome.stop == Some(Stop::Memory) && keep > LEAST_KEPT {
                // The levels that were kept may be what was too much.
                drop(swept);
                swept = self.sweep(Plan { keep: LEAST_KEPT, ..plan }, watch);
            }
            let Some(target) = swept.target else {
                return Err(swept.outcome.stop.expect("what was met is met again"));
            };
            if swept.levels.len() > length {
                way.extend(self.along(&swept.levels[1..=length], to));
            } else {
                // The later half waits below the earlier one.
                open.push((target.origin, to, length - length / 2));
                open.push((from, target.origin, length / 2));
            }
        }
        Ok(way)
    }

    /// The transitions along a way through levels, of which the last has a marking before the one it leads to.
    fn along(&self, levels: &[Vec<u64>], to: u64) -> Vec<u32> {
        let mut way = Vec::new();
        let mut after = to;
        let mut marking = vec![0; self.net.words];
        for level in levels.iter().rev() {
            let mut firings: HashMap<u64, Vec<usize>> = HashMap::new();
            for (t, flip) in self.span.flips.iter().enumerate() {
                firings.entry(after ^ flip).or_default().push(t);
            }
            let before = level.iter().find_map(|&key| {
                let firings = firings.get(&key)?;
                self.spread.marking(key, &mut marking);
                let fires = |&&t: &&usize| self.net.forward.test_one(t, |p| holds(&marking, p));
                firings.iter().find(fires).map(|&t| (t as u32, key))
            });
            let (t, key) = before.expect("a level leads to the next");
            way.push(t);
            after = key;
        }
        way.reverse();
        way
    }
}
