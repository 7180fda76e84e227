//! Whether a smaller net meets contact at once: random runs of it, before anything is spent on its diagram.
//!
//! With contact it stands for nothing (`merging`), and the diagram shows that only when all of it is there, and the
//! search on the net itself begins anew. In nets that count on contact, whose zones have no places for being free, any
//! run meets it after a few firings. A net that passes may have contact all the same: the diagram decides.

use super::merging::Merged;
use crate::budget::{Stop, Watch};
use crate::net::Transition;
use crate::random::Random;

/// The runs, and how many transitions each tests for each transition of the net: much less than a diagram costs.
const RUNS: u64 = 16;
const TESTS: usize = 64;

/// Whether some run came to a marking in which nothing but contact disables a transition.
pub(super) fn meets_contact(net: &Merged, watch: &mut Watch<'_>) -> Result<bool, Stop> {
    let moves = &net.transitions;
    for seed in 0..RUNS {
        let mut marked = vec![false; net.stands.len()];
        net.initial.iter().for_each(|&place| marked[place as usize] = true);
        let mut random = Random::new(seed);
        let mut left = TESTS * moves.len();
        while left > 0 {
            let (before, after) = moves.split_at(random.below(moves.len()));
            let mut tested = after.iter().chain(before);
            let Some(next) = tested.find(|each| is_open(each, &marked)) else { break };
            let tests = moves.len() - tested.count();
            watch.tick(tests)?;
            left = left.saturating_sub(tests);
            if next.outputs.iter().any(|&place| marked[place as usize]) {
                return Ok(true);
            }
            next.inputs.iter().for_each(|&place| marked[place as usize] = false);
            next.outputs.iter().for_each(|&place| marked[place as usize] = true);
        }
    }
    Ok(false)
}

/// Whether inputs and gates let it fire, whatever is on its outputs.
fn is_open(transition: &Transition, marked: &[bool]) -> bool {
    let is_marked = |&place: &u32| marked[place as usize];
    transition.inputs.iter().chain(&transition.permissive).all(is_marked)
        && !transition.inhibitive.iter().any(is_marked)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::symbolic::standing::Stands;

    fn meets(places: u32, initial: &[u32], transitions: Vec<Transition>) -> bool {
        let stands = (0..places).map(Stands::Place).collect();
        let mut poll = unwatched;
        let net = Merged { transitions, initial: initial.to_vec(), stands };
        meets_contact(&net, &mut Watch::new(None, &mut poll)).expect("no deadline")
    }

    /// Zones in a ring, along which tokens go, with or without places for a zone that is free.
    fn ring(zones: u32, with_free: bool) -> Vec<Transition> {
        let moves = |zone: u32| {
            let next = (zone + 1) % zones;
            let (input, output) = ([zone, zones + next], [next, zones + zone]);
            let arcs = if with_free { 2 } else { 1 };
            Transition::new(&input[..arcs], &output[..arcs], &[], &[], &[])
        };
        (0..zones).map(moves).collect()
    }

    #[test]
    fn tokens_that_come_up_with_each_other_meet_contact_unless_they_wait_for_a_free_zone() {
        assert!(meets(20, &[0, 10], ring(20, false)));
        let free = (20..40).filter(|place| ![20, 30].contains(place));
        assert!(!meets(40, &free.chain([0, 10]).collect::<Vec<_>>(), ring(20, true)));
    }

    #[test]
    fn a_token_alone_meets_none_nor_does_a_net_that_cannot_move() {
        assert!(!meets(20, &[0], ring(20, false)));
        assert!(!meets(20, &[], ring(20, false)));
        assert!(!meets(1, &[0], vec![]));
    }

    #[test]
    fn what_a_gate_holds_back_is_no_contact() {
        for (permissive, inhibitive, met) in [(2, 3, false), (1, 1, false), (1, 2, true)] {
            let closed = Transition::new(&[0], &[1], &[permissive], &[inhibitive], &[]);
            assert_eq!(meets(4, &[0, 1], vec![closed]), met, "{permissive} {inhibitive}");
        }
    }
}
