//! Fair runs: the components of a part of the graph in which a fair run can go on for ever.
//!
//! Within a set of markings,
//!
//! - without fairness any cycle will do;
//! - *weak*: no transition stays enabled for ever without firing. A strongly connected component holds such a run iff for
//!   each transition it has a marking in which the transition is disabled or an edge that fires it: these are Büchi
//!   conditions, so the maximal components suffice;
//! - *strong*: a transition that is enabled again and again fires again and again. That is a Streett condition: where a
//!   component enables a transition that it never fires, no fair run stays among the markings that enable it, so they are
//!   taken out and the rest is decomposed again, until a component is left in which each enabled transition also fires, or
//!   nothing is (Emerson and Lei, "Modalities for model checking", 1987).
//!
//! Enabled means firable and openable, external gates free; under steps a transition fires when the step holds it. One
//! component is judged after the other, 64 of its markings at a time, so that what is known of each transition is kept
//! for one component alone. Rejected: a table of all transitions for all components, which has more entries than the
//! graph has edges where most components are single markings.

use crate::budget::{Memory, Stop, Watch};
use crate::csr::Csr;
use crate::edges::Edges;
use crate::explore::Space;
use crate::scc::Scc;
use crate::table::NONE;

/// What a run owes to transitions that are enabled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fairness {
    /// Nothing.
    None,
    /// What stays enabled fires.
    Weak,
    /// What is enabled again and again fires again and again.
    Strong,
}

impl Fairness {
    /// The fairness that the Python side calls so.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "none" => Some(Fairness::None),
            "weak" => Some(Fairness::Weak),
            "strong" => Some(Fairness::Strong),
            _ => None,
        }
    }
}

/// For each marking the number of the component in which a fair run can go on for ever inside a set (one byte each) by
/// meeting all its markings again and again; `NONE` where there is none.
pub fn fair(space: &Space, mut within: Vec<u8>, fairness: Fairness, watch: &mut Watch<'_>) -> Result<Vec<u32>, Stop> {
    let memory = space.memory.clone();
    let mut fair = memory.filled(NONE, space.len())?;
    let mut judge = Judge::new(space, watch)?;
    let mut components = 0;
    loop {
        let scc = {
            let round = memory.clone();
            let edges = Csr::new(space, Some(&within), &round, watch)?;
            Scc::of_edges(&edges, Some(&within), &round, watch)?
        };
        let round = memory.clone();
        round.claim(scc.bytes())?;
        let (order, starts) = by_component(&scc, &round, watch)?;
        let mut again = false;
        for (component, row) in starts.windows(2).enumerate() {
            let members = &order[row[0] as usize..row[1] as usize];
            if scc.trivial[component] != 0 {
                members.iter().for_each(|&member| within[member as usize] = 0);
                watch.tick(members.len())?;
                continue;
            }
            let is_fair = fairness == Fairness::None || judge.is_fair(members, &scc.of, fairness, &memory, watch)?;
            if is_fair {
                members.iter().for_each(|&member| fair[member as usize] = components);
                components += 1;
            }
            if !is_fair && fairness == Fairness::Strong {
                judge.take_out(members, &mut within, watch)?;
                again = true;
            } else {
                members.iter().for_each(|&member| within[member as usize] = 0);
            }
        }
        if !again {
            judge.edges.finish(&memory);
            return Ok(fair);
        }
    }
}

/// The markings that are in a component, component by component, and where each begins.
fn by_component(scc: &Scc, memory: &Memory, watch: &mut Watch<'_>) -> Result<(Vec<u32>, Vec<u32>), Stop> {
    let mut starts = memory.filled(0u32, scc.sizes.len() + 1)?;
    for (component, &size) in scc.sizes.iter().enumerate() {
        starts[component + 1] = starts[component] + size;
    }
    let mut order = memory.filled(0u32, starts[scc.sizes.len()] as usize)?;
    let mut next = memory.filled(0u32, scc.sizes.len())?;
    next.copy_from_slice(&starts[..scc.sizes.len()]);
    for (index, &component) in scc.of.iter().enumerate().filter(|&(_, &component)| component != NONE) {
        let at = &mut next[component as usize];
        order[*at as usize] = index as u32;
        *at += 1;
        watch.tick(1)?;
    }
    memory.release(size_of_val(next.as_slice()));
    Ok((order, starts))
}

/// What one component after the other enables and fires.
struct Judge<'a> {
    edges: Edges<'a>,
    /// For each transition, in how many markings of the component it is enabled.
    enabled: Vec<u32>,
    /// Whether it fires on an edge that stays in the component.
    fires: Vec<bool>,
    /// Whether the component owes it.
    owed: Vec<bool>,
}

impl<'a> Judge<'a> {
    fn new(space: &'a Space, watch: &mut Watch<'_>) -> Result<Self, Stop> {
        space.index(watch)?;
        let count = space.net.transitions.len();
        Ok(Judge {
            edges: Edges::new(space),
            enabled: vec![0; count],
            fires: vec![false; count],
            owed: vec![false; count],
        })
    }

    /// Whether a run through all markings of a component, again and again, owes nothing.
    fn is_fair(
        &mut self,
        members: &[u32],
        of: &[u32],
        fairness: Fairness,
        memory: &Memory,
        watch: &mut Watch<'_>,
    ) -> Result<bool, Stop> {
        let component = of[members[0] as usize];
        let Judge { edges, enabled, fires, owed } = self;
        enabled.fill(0);
        fires.fill(false);
        for batch in members.chunks(64) {
            edges.visit(batch, memory, watch, &mut |_, fired, target| {
                if of[target as usize] == component {
                    fired.each(&mut |t| fires[t as usize] = true);
                }
                Ok(())
            })?;
            for j in 0..batch.len() {
                edges.firable(j).iter().for_each(|&t| enabled[t as usize] += 1);
            }
            watch.tick(enabled.len())?;
        }
        let least = if fairness == Fairness::Weak { members.len() as u32 } else { 1 };
        for (owed, (&enabled, &fires)) in owed.iter_mut().zip(enabled.iter().zip(fires.iter())) {
            *owed = enabled >= least && !fires;
        }
        Ok(!owed.contains(&true))
    }

    /// Takes the markings out of a set that enable what the component owes that was judged last.
    fn take_out(&mut self, members: &[u32], within: &mut [u8], watch: &mut Watch<'_>) -> Result<(), Stop> {
        for batch in members.chunks(64) {
            self.edges.load(batch);
            for (j, &member) in batch.iter().enumerate() {
                if self.edges.firable(j).iter().any(|&t| self.owed[t as usize]) {
                    within[member as usize] = 0;
                }
            }
            watch.tick(self.owed.len())?;
        }
        Ok(())
    }
}
