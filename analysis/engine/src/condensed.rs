//! The components of a graph as a graph of their own, which has no cycle.
//!
//! Components are numbered so that edges lead down (`Scc`). So from which of them a target can be reached is one pass from
//! the first to the last: no agenda, no marking met twice, and of a component that reaches the target no further edge is
//! looked at. Of a graph with many small components, as that of a cell in which something has failed, such a pass takes a
//! tenth of a search along stored edges. Where each bottom component holds a target, not even that is needed.

use crate::budget::{Memory, Stop, Watch};
use crate::csr::Csr;
use crate::explore::Space;
use crate::region::Region;
use crate::scc::Scc;

/// Components, and the edges from one to another.
#[derive(Debug)]
pub struct Condensed {
    scc: Scc,
    edges: Csr,
}

impl Condensed {
    /// Those of a whole graph.
    pub fn new(space: &Space, memory: &Memory, watch: &mut Watch<'_>) -> Result<Self, Stop> {
        let all = Csr::new(space, None, memory, watch)?;
        let scc = Scc::of_edges(&all, None, memory, watch)?;
        let mut offsets = memory.filled(0u64, scc.sizes.len() + 2)?;
        for (index, &from) in scc.of.iter().enumerate() {
            let row = all.targets(index as u32);
            let leaving = row.iter().filter(|&&target| scc.of[target as usize] != from);
            offsets[from as usize + 2] += leaving.count() as u64;
            watch.tick(1 + row.len())?;
        }
        for component in 0..=scc.sizes.len() {
            offsets[component + 1] += offsets[component];
        }
        let mut targets = memory.filled(0u32, offsets[scc.sizes.len() + 1] as usize)?;
        for (index, &from) in scc.of.iter().enumerate() {
            let row = all.targets(index as u32);
            let at = &mut offsets[from as usize + 1];
            for other in row.iter().map(|&target| scc.of[target as usize]).filter(|&other| other != from) {
                targets[*at as usize] = other;
                *at += 1;
            }
            watch.tick(1 + row.len())?;
        }
        offsets.pop();
        Ok(Condensed { scc, edges: Csr { offsets, targets: Region::Heap(targets) } })
    }

    /// Bytes that they take.
    pub fn bytes(&self) -> usize {
        self.scc.bytes() + self.edges.bytes()
    }

    /// The markings from which a target can be reached, one byte each, targets included.
    pub fn backward(&self, targets: &[u8], memory: &Memory, watch: &mut Watch<'_>) -> Result<Vec<u8>, Stop> {
        let mut reach = memory.filled(0u8, self.scc.sizes.len())?;
        for (&component, _) in self.scc.of.iter().zip(targets).filter(|&(_, &target)| target != 0) {
            reach[component as usize] = 1;
        }
        watch.tick(targets.len())?;
        if self.scc.bottom.iter().zip(&reach).all(|(&bottom, &reach)| bottom <= reach) {
            return Ok(vec![1; targets.len()]);
        }
        for component in 0..reach.len() {
            let others = self.edges.targets(component as u32);
            if reach[component] == 0 && others.iter().any(|&other| reach[other as usize] != 0) {
                reach[component] = 1;
            }
            watch.tick(1 + others.len())?;
        }
        Ok(self.scc.of.iter().map(|&component| reach[component as usize]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::fixpoints::{Against, backward};
    use crate::samples::random_spaces;

    #[test]
    fn what_reaches_a_target_by_components_is_what_reaches_it_by_markings() {
        let (mut all, mut some, mut none) = (0, 0, 0);
        for step in [false, true] {
            for space in random_spaces(200, step) {
                let mut poll = unwatched;
                let mut watch = Watch::new(None, &mut poll);
                let memory = Memory::new(1 << 24);
                let condensed = Condensed::new(&space, &memory, &mut watch).expect("fits");
                assert!(condensed.bytes() <= memory.used());
                for nth in [1, 3, 7, space.len(), space.len() + 1] {
                    let targets: Vec<u8> = (1..=space.len()).map(|index| u8::from(index % nth == 0)).collect();
                    let found = condensed.backward(&targets, &memory.clone(), &mut watch);
                    let within = vec![1; space.len()]; // with which no components are looked at
                    let against = Against::default();
                    let expected = backward(&space, &targets, Some(&within), None, &against, &mut watch).expect("fits");
                    *(match (expected.contains(&1), expected.contains(&0)) {
                        (true, true) => &mut some,
                        (true, false) => &mut all,
                        _ => &mut none,
                    }) += 1;
                    assert_eq!(found, Ok(expected));
                }
            }
        }
        assert!(all > 200 && some > 200 && none > 200, "{all} {some} {none}");
    }
}
