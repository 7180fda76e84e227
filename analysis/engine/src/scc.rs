//! Strongly connected components of the reachability graph, or of its part within a set of markings.
//!
//! Edges are stored as compressed rows (4 bytes each, 8 a marking) within the memory budget, and components are found by
//! Pearce's one-array form of Tarjan's algorithm ("A space-efficient algorithm for finding strongly connected
//! components", 2016), with its own stack. Forward-backward splitting without edges was rejected: its cost grows with
//! the number of components, and an acyclic graph has as many as markings. Where only the bottom components matter,
//! and where all markings are one component, no edges are stored at all: `bottoms.rs`.

use crate::budget::{Memory, Stop, Watch};
use crate::csr::Csr;
use crate::edges::Edges;
use crate::explore::Space;

/// The strongly connected components, numbered so that edges lead from higher to lower numbers or stay.
#[derive(Debug)]
pub struct Scc {
    /// The component of each marking; `NONE` outside the set asked for.
    pub of: Vec<u32>,
    /// How many markings each component has.
    pub sizes: Vec<u32>,
    /// One for each component that no edge (within the set) leaves.
    pub bottom: Vec<u8>,
    /// One for each component without an edge inside: a single marking without an edge to itself.
    pub trivial: Vec<u8>,
}

impl Scc {
    /// Bytes that they take.
    pub fn bytes(&self) -> usize {
        4 * (self.of.len() + self.sizes.len()) + self.bottom.len() + self.trivial.len()
    }

    /// The components of stored edges, which stay within a set of markings.
    pub fn of_edges(edges: &Csr, within: Option<&[u8]>, memory: &Memory, watch: &mut Watch<'_>) -> Result<Self, Stop> {
        let (of, count) = pearce(edges, within, memory, watch)?;
        let mut sizes = memory.filled(0u32, count)?;
        let mut bottom = memory.filled(1u8, count)?;
        let mut trivial = memory.filled(1u8, count)?;
        for (index, &component) in of.iter().enumerate().filter(|&(_, &component)| component != crate::table::NONE) {
            let component = component as usize;
            sizes[component] += 1;
            for &target in edges.targets(index as u32) {
                if of[target as usize] as usize == component {
                    trivial[component] = 0;
                } else {
                    bottom[component] = 0;
                }
            }
        }
        Ok(Scc { of, sizes, bottom, trivial })
    }
}

/// Pearce's algorithm: one array is at once the order of discovery, the low link and the component.
///
/// Components are numbered downwards from the number of markings and never meet the orders, which are renumbered from
/// the bottom as components are completed; at the end they are turned round, so the first completed is 0.
fn pearce(
    edges: &Csr,
    within: Option<&[u8]>,
    memory: &Memory,
    watch: &mut Watch<'_>,
) -> Result<(Vec<u32>, usize), Stop> {
    let (count, targets) = (edges.offsets.len() - 1, edges.targets.all());
    let top = count as u32 + 1;
    let mut rank = memory.filled(0u32, count)?;
    let mut order = 1;
    let mut component = top;
    // Markings whose component is still open, and the markings on the way from the root with the edge to follow next.
    let mut open: Vec<u32> = Vec::new();
    let mut way: Vec<(u32, bool, u64)> = Vec::new();
    for root in 0..count as u32 {
        if rank[root as usize] != 0 || within.is_some_and(|within| within[root as usize] == 0) {
            continue;
        }
        rank[root as usize] = order;
        order += 1;
        memory.push(&mut way, (root, true, edges.offsets[root as usize]))?;
        while let Some(&mut (at, ref mut is_root, ref mut edge)) = way.last_mut() {
            if *edge < edges.offsets[at as usize + 1] {
                let target = targets[*edge as usize];
                if rank[target as usize] == 0 {
                    // The edge is followed once more when the target is done: then its rank is compared.
                    rank[target as usize] = order;
                    order += 1;
                    memory.push(&mut way, (target, true, edges.offsets[target as usize]))?;
                    continue;
                }
                if rank[target as usize] < rank[at as usize] {
                    rank[at as usize] = rank[target as usize];
                    *is_root = false;
                }
                *edge += 1;
                continue;
            }
            let complete = *is_root;
            way.pop();
            watch.tick(1)?;
            if complete {
                order -= 1;
                while let Some(&last) = open.last() {
                    if rank[at as usize] > rank[last as usize] {
                        break;
                    }
                    open.pop();
                    rank[last as usize] = component;
                    order -= 1;
                }
                rank[at as usize] = component;
                component -= 1;
            } else {
                memory.push(&mut open, at)?;
            }
        }
    }
    for rank in &mut rank {
        *rank = if *rank == 0 { crate::table::NONE } else { top - *rank };
    }
    memory.drop_vec(open);
    memory.drop_vec(way);
    Ok((rank, (top - component) as usize))
}

/// For each transition, whether it fires in every bottom component.
///
/// A transition that is firable and openable fires on some edge under steps too: some valuation opens it, and any
/// single transition extends to a maximal set.
pub fn live(space: &Space, scc: &Scc, watch: &mut Watch<'_>) -> Result<Vec<bool>, Stop> {
    let transitions = space.net.transitions.len();
    if scc.bottom.iter().zip(&scc.trivial).any(|(&bottom, &trivial)| bottom != 0 && trivial != 0) {
        return Ok(vec![false; transitions]);
    }
    let memory = space.memory.clone();
    let words = transitions.div_ceil(64);
    let mut number = memory.filled(0u32, scc.bottom.len())?;
    let mut bottoms = 0;
    for (number, _) in number.iter_mut().zip(&scc.bottom).filter(|&(_, &bottom)| bottom != 0) {
        *number = bottoms;
        bottoms += 1;
    }
    let mut fires = memory.filled(0u64, bottoms as usize * words)?;
    let mut edges = Edges::new(space);
    let mut members = Vec::with_capacity(64);
    for first in (0..space.len()).step_by(64) {
        members.clear();
        let batch = first..space.len().min(first + 64);
        members.extend(batch.filter(|&index| scc.bottom[scc.of[index] as usize] != 0).map(|index| index as u32));
        edges.load(&members);
        for (j, &member) in members.iter().enumerate() {
            let row = number[scc.of[member as usize] as usize] as usize * words;
            for &t in edges.firable(j) {
                fires[row + t as usize / 64] |= 1 << (t % 64);
            }
        }
        watch.tick(64)?;
    }
    Ok((0..transitions)
        .map(|t| (0..bottoms as usize).all(|row| fires[row * words + t / 64] >> (t % 64) & 1 == 1))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::region::Region;

    fn components(edges: &[&[u32]]) -> Scc {
        let memory = Memory::new(1 << 20);
        let mut poll = unwatched;
        let mut watch = Watch::new(None, &mut poll);
        let (mut offsets, mut targets) = (vec![0], Vec::new());
        for row in edges {
            targets.extend_from_slice(row);
            offsets.push(targets.len() as u64);
        }
        let csr = Csr { offsets, targets: Region::Heap(targets) };
        Scc::of_edges(&csr, None, &memory, &mut watch).expect("fits")
    }

    #[test]
    fn two_cycles_joined_by_an_edge_are_two_components() {
        let scc = components(&[&[1], &[0, 2], &[3], &[2]]);
        assert_eq!(scc.of, [1, 1, 0, 0]);
        assert_eq!((scc.sizes, scc.bottom, scc.trivial), (vec![2, 2], vec![1, 0], vec![0, 0]));
    }

    #[test]
    fn a_loop_makes_a_single_marking_nontrivial() {
        let scc = components(&[&[0, 1], &[]]);
        assert_eq!((scc.of, scc.bottom, scc.trivial), (vec![1, 0], vec![1, 0], vec![1, 0]));
    }

    #[test]
    fn components_agree_with_mutual_reachability_on_all_graphs_of_four_markings() {
        for bits in 0..1u32 << 16 {
            let rows: Vec<Vec<u32>> =
                (0..4).map(|i| (0..4).filter(|j| bits >> (4 * i + j) & 1 == 1).collect()).collect();
            let mut reach = [[false; 4]; 4];
            for i in 0..4 {
                reach[i][i] = true;
                for &j in &rows[i] {
                    reach[i][j as usize] = true;
                }
            }
            for k in 0..4 {
                let middle = reach[k];
                for row in reach.iter_mut().filter(|row| row[k]) {
                    for (to, &from) in row.iter_mut().zip(&middle) {
                        *to |= from;
                    }
                }
            }
            let scc = components(&rows.iter().map(Vec::as_slice).collect::<Vec<_>>());
            let forth = reach;
            for (i, row) in forth.iter().enumerate() {
                for (j, back) in forth.iter().enumerate() {
                    assert_eq!(scc.of[i] == scc.of[j], row[j] && back[i], "{rows:?}");
                }
                let leaves = (0..4).any(|j| row[j] && !forth[j][i]);
                assert_eq!(scc.bottom[scc.of[i] as usize] == 0, leaves, "{rows:?}");
            }
        }
    }
}
