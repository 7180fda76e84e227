//! The engine's hot loops on nets of a fixed size: what `benchmarks/instructions.py` counts instructions of.
//!
//! `hot_loops NET WORK [ROUNDS]`: a net by its name and size (`philosophers 10`, `interlocked 9 60`, the second number
//! being places that never change) or, as `-`, from standard input in the form of `hash_sets`, and what is done after
//! exploring it: `explore` (nothing), `two` (nothing, after two
//! threads have explored it), `bottoms`, `edges`, `backward`, `endless`. Prints markings, edges, and the CPU seconds of the exploration and of the work, best of the
//! rounds.

use std::io::Read;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use firable_engine::bottoms::Bottoms;
use firable_engine::budget::{Watch, unwatched};
use firable_engine::csr::Csr;
use firable_engine::explore::{Limits, Space};
use firable_engine::fixpoints::{Against, backward, endless};
use firable_engine::net::{Net, Transition};

/// Dining philosophers of four places: fork, thinking, holding the left fork, eating.
fn philosophers(count: u32) -> Net {
    let mut transitions = Vec::new();
    for i in 0..count {
        let [fork, think, left, eat] = [0, 1, 2, 3].map(|k| 4 * i + k);
        let other = 4 * ((i + 1) % count);
        transitions.push(Transition::new(&[think, fork], &[left], &[], &[], &[]));
        transitions.push(Transition::new(&[left, other], &[eat], &[], &[], &[]));
        transitions.push(Transition::new(&[eat], &[think, fork, other], &[], &[], &[]));
    }
    let initial: Vec<u32> = (0..count).flat_map(|i| [4 * i, 4 * i + 1]).collect();
    Net::new(4 * count as usize, transitions, &initial).expect("well formed")
}

/// Machines with internal gates to their neighbours, among places that never change.
fn interlocked(count: u32, spare: u32) -> Net {
    let mut transitions = Vec::new();
    for i in 0..count {
        let [idle, busy, done] = [0, 1, 2].map(|k| 3 * i + k);
        let after = 3 * ((i + 1) % count);
        transitions.push(Transition::new(&[idle], &[busy], &[], &[after + 1], &[]));
        transitions.push(Transition::new(&[busy], &[done], &[], &[], &[]));
        transitions.push(Transition::new(&[done], &[idle], &[], &[after + 2], &[]));
    }
    let initial: Vec<u32> = (0..count).map(|i| 3 * i).collect();
    Net::new((3 * count + spare) as usize, transitions, &initial).expect("well formed")
}

/// A net in words: the number of places and those with a token; then of each transition its inputs, outputs, permissive and
/// inhibitive gates.
fn from_text(text: &str) -> Net {
    let numbers = |part: &str| part.split_whitespace().map(|n| n.parse().expect("a place")).collect::<Vec<u32>>();
    let mut lines = text.lines();
    let first = numbers(lines.next().expect("the number of places"));
    let transitions = lines.map(|line| {
        let sets: Vec<Vec<u32>> = line.split(';').map(numbers).collect();
        let [inputs, outputs, permissive, inhibitive] = sets.as_slice() else { panic!("four sets a transition") };
        Transition::new(inputs, outputs, permissive, inhibitive, &[])
    });
    Net::new(first[0] as usize, transitions.collect(), &first[1..]).expect("well formed")
}

/// CPU seconds of this process.
fn cpu_seconds() -> f64 {
    let schedstat = std::fs::read_to_string("/proc/self/schedstat").expect("Linux");
    let nanoseconds: u64 = schedstat.split(' ').next().and_then(|n| n.parse().ok()).expect("a number");
    Duration::from_nanos(nanoseconds).as_secs_f64()
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, work, rounds @ ..] = arguments.as_slice() else { panic!("hot_loops NET WORK [ROUNDS]") };
    let rounds: usize = rounds.first().map_or(1, |rounds| rounds.parse().expect("a number of rounds"));
    let parts: Vec<&str> = name.split(' ').collect();
    let size = |at: usize| parts.get(at).map_or(0, |size| size.parse().expect("a size"));
    let mut text = String::new();
    if parts == ["-"] {
        std::io::stdin().read_to_string(&mut text).expect("a net on standard input");
    }
    let (mut best, mut best_work) = (f64::MAX, f64::MAX);
    let mut found = (0, 0);
    for _ in 0..rounds {
        let net = match parts[0] {
            "philosophers" => philosophers(size(1)),
            "interlocked" => interlocked(size(1), size(2)),
            "-" => from_text(&text),
            other => panic!("no net {other}"),
        };
        let limits = Limits { step: false, markings: 1 << 31, memory_bytes: 3 << 30, time: None };
        let start = cpu_seconds();
        let two = (work == "two").then(|| Arc::new(AtomicBool::new(true)));
        let space = Space::explore_by(two, net, limits, &mut unwatched).expect("the net fits");
        let explored = cpu_seconds();
        assert!(space.stop.is_none());
        let mut poll = unwatched;
        let mut watch = Watch::new(None, &mut poll);
        let mut initial = vec![0; space.len()];
        initial[0] = 1;
        match work.as_str() {
            "explore" | "two" => {}
            "bottoms" => drop(Bottoms::new(&space, &mut watch).expect("fits")),
            "edges" => drop(Csr::new(&space, None, &space.memory.clone(), &mut watch).expect("fits")),
            "backward" => drop(backward(&space, &initial, None, None, &Against::default(), &mut watch).expect("fits")),
            "endless" => drop(endless(&space, Some(&initial), &Against::default(), &mut watch).expect("fits")),
            other => panic!("no work {other}"),
        }
        found = (space.len(), space.edges);
        best = best.min(explored - start);
        best_work = best_work.min(cpu_seconds() - explored);
    }
    println!("{} {} {best:.6} {best_work:.6}", found.0, found.1);
}
