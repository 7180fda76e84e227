//! The plain way, for benchmarks: the same exploration with a mask scan and a general hash set.
//!
//! The argument names the set: `std`, the standard one, safe against chosen keys, or `hashbrown`, the same table with a
//! quick hash. Reads a net from standard input (first line: places, then the marked ones; then a line for each transition:
//! inputs; outputs; permissive; inhibitive) and prints markings, edges and seconds. It shares no code with the engine, so
//! the counts are a check as well as a yardstick. At most 256 places.

use std::hash::Hash;
use std::io::Read;
use std::time::Instant;

type Mask<const N: usize> = [u64; N];

struct Transition<const N: usize> {
    full: Mask<N>,
    empty: Mask<N>,
    flip: Mask<N>,
}

fn mask<const N: usize>(text: &str) -> Mask<N> {
    let mut mask = [0; N];
    for place in text.split_whitespace() {
        let place: usize = place.parse().expect("a place is a number");
        mask[place / 64] |= 1 << (place % 64);
    }
    mask
}

/// A set that says whether a key is new to it.
trait Seen<K> {
    fn insert(&mut self, key: K) -> bool;
}

impl<K: Eq + Hash> Seen<K> for std::collections::HashSet<K> {
    fn insert(&mut self, key: K) -> bool {
        self.insert(key)
    }
}

impl<K: Eq + Hash> Seen<K> for hashbrown::HashSet<K> {
    fn insert(&mut self, key: K) -> bool {
        self.insert(key)
    }
}

fn explore<const N: usize>(
    mut seen: impl Seen<Mask<N>>,
    initial: Mask<N>,
    transitions: &[Transition<N>],
) -> (usize, u64) {
    seen.insert(initial);
    let mut queue = vec![initial];
    let mut edges = 0;
    let mut next = 0;
    while next < queue.len() {
        let marking = queue[next];
        next += 1;
        for t in transitions {
            if (0..N).all(|k| marking[k] & t.full[k] == t.full[k] && marking[k] & t.empty[k] == 0) {
                edges += 1;
                let after = std::array::from_fn(|k| marking[k] ^ t.flip[k]);
                if seen.insert(after) {
                    queue.push(after);
                }
            }
        }
    }
    (queue.len(), edges)
}

fn run<const N: usize>(text: &str) {
    let mut lines = text.lines();
    let first = lines.next().unwrap_or_default();
    let initial = mask(first.split_once(' ').map_or("", |(_, marked)| marked));
    let transitions: Vec<Transition<N>> = lines
        .map(|line| {
            let mut sets = line.split(';').map(mask::<N>);
            let mut set = || sets.next().expect("four sets a transition");
            let (inputs, outputs, permissive, inhibitive) = (set(), set(), set(), set());
            Transition {
                full: std::array::from_fn(|k| inputs[k] | permissive[k]),
                empty: std::array::from_fn(|k| outputs[k] | inhibitive[k]),
                flip: std::array::from_fn(|k| inputs[k] ^ outputs[k]),
            }
        })
        .collect();
    let start = Instant::now();
    let (markings, edges) = match std::env::args().nth(1).as_deref() {
        Some("std") => explore(std::collections::HashSet::new(), initial, &transitions),
        Some("hashbrown") => explore(hashbrown::HashSet::new(), initial, &transitions),
        _ => panic!("say which set: std or hashbrown"),
    };
    println!("{markings} {edges} {}", start.elapsed().as_secs_f64());
}

fn main() {
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text).expect("a net on standard input");
    let places: usize = text.split_whitespace().next().and_then(|n| n.parse().ok()).expect("the number of places");
    match places.div_ceil(64) {
        0 | 1 => run::<1>(&text),
        2 => run::<2>(&text),
        3 | 4 => run::<4>(&text),
        _ => panic!("at most 256 places"),
    }
}
