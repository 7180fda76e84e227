//! Which transitions are firable together: what an effective conflict needs.

use crate::batch::Batch;
use crate::budget::{Stop, Watch};
use crate::explore::Space;
use crate::with_width;

impl Space {
    /// For each pair of transitions, the lowest index of a marking at which both are firable by Eq. (1).
    pub fn firable_together(&self, pairs: &[(usize, usize)], watch: &mut Watch<'_>) -> Result<Vec<Option<u32>>, Stop> {
        let mut found = vec![None; pairs.len()];
        let mut asked = vec![false; self.net.transitions.len()];
        for &(t, u) in pairs {
            asked[t] = true;
            asked[u] = true;
        }
        let mut firable = vec![0; self.net.transitions.len()];
        let mut batch = Batch::new(&self.net);
        let mut missing = pairs.len();
        let mut first = 0;
        while first < self.len() && missing > 0 {
            let stop = self.len().min(first + 64);
            batch.markings.clear();
            self.table.store.copy_range(first, stop, &mut batch.markings);
            with_width!(self.net.words, width => batch.cut(width));
            for t in (0..firable.len()).filter(|&t| asked[t]) {
                let (base, blocked) = self.net.forward.test(t, &batch.slices, batch.valid);
                firable[t] = base & !blocked & self.net.forward.sound(t);
            }
            for (found, &(t, u)) in found.iter_mut().zip(pairs).filter(|(found, _)| found.is_none()) {
                let both = firable[t] & firable[u];
                if both != 0 {
                    *found = Some(first as u32 + both.trailing_zeros());
                    missing -= 1;
                }
            }
            watch.tick(stop - first)?;
            first = stop;
        }
        Ok(found)
    }
}
