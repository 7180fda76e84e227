//! Nets and graphs that tests of several files share.

use crate::budget::unwatched;
use crate::explore::{Limits, Space};
use crate::net::{Net, Transition};

/// `n` machines of two places each, `pad` unused places before them.
pub(crate) fn machines(n: u32, pad: u32) -> Net {
    let transitions = (0..n)
        .flat_map(|i| {
            let (idle, busy) = (pad + 2 * i, pad + 2 * i + 1);
            [Transition::new(&[idle], &[busy], &[], &[], &[]), Transition::new(&[busy], &[idle], &[], &[], &[])]
        })
        .collect();
    let initial: Vec<u32> = (0..n).map(|i| pad + 2 * i).collect();
    Net::new((pad + 2 * n) as usize, transitions, &initial).expect("well formed")
}

/// The slotted ring of so many nodes: nearly all markings come down to one that is far from M0.
pub(crate) fn slotted_ring(n: u32) -> Net {
    let transitions = (0..n)
        .flat_map(|i| {
            let [used, owned, ready, put, idle, sent, full, get] = [0, 1, 2, 3, 4, 5, 6, 7].map(|k| 8 * i + k);
            let before = 8 * ((i + n - 1) % n);
            [
                (vec![used], vec![put]),
                (vec![used], vec![owned]),
                (vec![owned], vec![put]),
                (vec![owned], vec![get]),
                (vec![sent, get], vec![ready, idle]),
                (vec![put, sent], vec![ready, full]),
                (vec![full, before + 2], vec![sent, before]),
                (vec![idle, before + 2], vec![sent, before + 1]),
            ]
        })
        .map(|(inputs, outputs)| Transition::new(&inputs, &outputs, &[], &[], &[]))
        .collect();
    let initial: Vec<u32> = (0..n).flat_map(|i| [8 * i + 2, 8 * i + 4]).collect();
    Net::new(8 * n as usize, transitions, &initial).expect("well formed")
}

/// Machines of ten steps, each of which may be left for three others, and some together with one of two other machines:
/// most arcs are within a machine. Step `s` of machine `m` is place `s * n + m`.
pub(crate) fn wanderers(n: u32) -> Net {
    let at = |machine: u32, step: u32| step % 10 * n + machine % n;
    let moves = |machine: u32, step: u32| {
        [3 * step + 1, 7 * step + 2, step + 5]
            .map(|to| Transition::new(&[at(machine, step)], &[at(machine, to)], &[], &[], &[]))
    };
    let meets = |machine: u32| {
        [5 * machine + 3, machine + 1].map(|other| {
            let (inputs, outputs) = ([at(machine, 9), at(other, 4)], [at(machine, 0), at(other, 8)]);
            Transition::new(&inputs, &outputs, &[], &[], &[])
        })
    };
    let alone = (0..n).flat_map(|machine| (0..10).flat_map(move |step| moves(machine, step)));
    let transitions = alone.chain((0..n).flat_map(meets)).collect();
    Net::new((10 * n) as usize, transitions, &(0..n).collect::<Vec<u32>>()).expect("well formed")
}

pub(crate) fn explore(net: Net, step: bool) -> Space {
    let limits = Limits { step, markings: 1 << 20, memory_bytes: 1 << 28, time: None };
    Space::explore(net, limits, &mut unwatched).expect("fits")
}

/// Graphs of small random nets.
pub(crate) fn random_spaces(count: u64, step: bool) -> impl Iterator<Item = Space> {
    random_nets(count).map(move |net| explore(net, step))
}

/// How many times as many nets are drawn in a campaign (`make campaign`), else 1.
fn factor() -> u64 {
    std::env::var("FIRABLE_CAMPAIGN").ok().and_then(|text| text.parse().ok()).unwrap_or(1)
}

/// Small random nets: tokens that move, merge and split under gates.
pub(crate) fn random_nets(count: u64) -> impl Iterator<Item = Net> {
    let mut seed = 5_u64;
    let mut below = move |n: u64| {
        seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (crate::marking::mix(seed) % n) as u32
    };
    (0..count * factor()).map(move |round| {
        // Some nets are wider than a word.
        let (places, spread) = (4 + below(9), [1, 1, 7, 40][round as usize % 4]);
        let mut transitions: Vec<Transition> = (0..places + below(6))
            .map(|_| {
                let mut some = |most: u64| -> Vec<u32> {
                    (0..below(most + 1)).map(|_| below(u64::from(places)) * spread).collect()
                };
                let (mut inputs, mut outputs) = (some(2), some(2));
                outputs.retain(|p| !inputs.contains(p));
                if below(4) > 0 {
                    inputs.truncate(1);
                    outputs.truncate(1);
                }
                let mut gate =
                    |n: u64| if below(n) == 0 { vec![below(u64::from(places)) * spread] } else { Vec::new() };
                Transition::new(&inputs, &outputs, &gate(5), &gate(5), &[])
            })
            .collect();
        // Most of these only lose tokens; where many firings can be taken back, runs go on.
        let back = below(4);
        for t in 0..transitions.len() {
            if below(3) < back {
                let Transition { inputs, outputs, .. } = &transitions[t];
                transitions.push(Transition::new(outputs, inputs, &[], &[], &[]));
            }
        }
        let initial: Vec<u32> = (0..places).filter(|_| below(2) == 0).map(|p| p * spread).collect();
        Net::new((places * spread) as usize, transitions, &initial).expect("well formed")
    })
}
