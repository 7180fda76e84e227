//! Exact numbers of markings and of edges: big integers, summed along the diagram.
//!
//! The number of markings of a node is the sum of those of its children. The number of edges is a sum of the same kind:
//! for each node, the markings below it that an event of its level can fire in. So both are written down first as a
//! list of sums of two earlier numbers, then evaluated: in 128 bits, which nearly always suffices, otherwise in words
//! without limit, where each number is freed when nothing needs it any more; a hundred thousand levels with numbers of
//! twenty thousand bytes would not fit in memory otherwise.

use std::collections::HashMap;

use super::algebra::Diagram;
use super::events::{DONE, Mixed, Suffix, Suffixes, Table};
use super::zdd::{EMPTY, Node, TERMINAL, UNIT};
use crate::budget::{Memory, Stop, Watch};

/// A natural number in little-endian words.
pub type Natural = Vec<u64>;

/// What is to be counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Want {
    /// The markings of a node.
    Markings(Node),
    /// Those in which a suffix can fire.
    Firable(Suffix, Node),
    /// The pairs of a marking of the node and an event at or below its level that can fire in it.
    Edges(Node),
}

const ZERO: u32 = 0;
const ONE: u32 = 1;

/// Sums of two earlier numbers; the first two numbers are 0 and 1.
#[derive(Default)]
struct Sums {
    terms: Vec<[u32; 2]>,
    /// By node, the number of its markings; `ZERO` where it is not known, as none but the empty set has no marking.
    markings: Vec<u32>,
    /// The other numbers.
    known: HashMap<Want, u32, Mixed>,
}

impl Want {
    /// Those in which a suffix can fire: all, where nothing is left to fire.
    fn firable(suffix: Suffix, node: Node) -> Want {
        if suffix == DONE { Want::Markings(node) } else { Want::Firable(suffix, node) }
    }
}

impl Sums {
    fn new(nodes: usize) -> Self {
        Sums { terms: vec![[ZERO; 2]; 2], markings: vec![ZERO; nodes], known: HashMap::default() }
    }

    fn add(&mut self, a: u32, b: u32) -> u32 {
        match (a, b) {
            (ZERO, other) | (other, ZERO) => other,
            _ => {
                self.terms.push([a, b]);
                self.terms.len() as u32 - 1
            }
        }
    }

    fn times(&mut self, mut factor: u32, mut number: u32) -> u32 {
        let mut product = ZERO;
        while factor > 0 {
            if factor & 1 != 0 {
                product = self.add(product, number);
            }
            factor >>= 1;
            if factor > 0 {
                number = self.add(number, number);
            }
        }
        product
    }

    fn bytes(&self) -> usize {
        self.terms.capacity() * 8 + self.markings.capacity() * 4 + self.known.capacity() * 24
    }

    /// The value of a number; `memory` is asked for what the large ones take.
    fn value(&self, number: u32, memory: &Memory, watch: &mut Watch<'_>) -> Result<Natural, Stop> {
        let mut small = vec![0_u128, 1];
        let mut fits = true;
        for &[a, b] in &self.terms[2..=(number as usize).max(1)] {
            match small[a as usize].checked_add(small[b as usize]) {
                Some(sum) => small.push(sum),
                None => {
                    fits = false;
                    break;
                }
            }
        }
        if fits {
            let value = small[number as usize];
            return Ok(vec![value as u64, (value >> 64) as u64]);
        }
        drop(small);
        self.large(number, memory, watch)
    }

    fn large(&self, number: u32, memory: &Memory, watch: &mut Watch<'_>) -> Result<Natural, Stop> {
        let mut uses = vec![0_u32; number as usize + 1];
        uses[number as usize] = 1;
        for at in (2..=number as usize).rev().filter(|&at| at > 1) {
            if uses[at] > 0 {
                self.terms[at].iter().for_each(|&term| uses[term as usize] += 1);
            }
        }
        let mut values: Vec<Natural> = vec![Natural::new(); number as usize + 1];
        values[ONE as usize] = vec![1];
        let mut held = 8;
        for at in 2..=number as usize {
            if uses[at] == 0 {
                continue;
            }
            let [a, b] = self.terms[at].map(|term| term as usize);
            let (long, short) = if values[a].len() >= values[b].len() { (a, b) } else { (b, a) };
            uses[long] -= 1;
            uses[short] -= 1;
            // A number that nothing else needs becomes the sum.
            let mut sum = if uses[long] == 0 && long != short {
                std::mem::take(&mut values[long])
            } else {
                held += 8 * values[long].len();
                values[long].clone()
            };
            held += 8 * add(&mut sum, &values[short]);
            watch.tick(1 + sum.len() / 8)?;
            values[at] = sum;
            if uses[short] == 0 && short > 1 {
                held -= 8 * std::mem::take(&mut values[short]).len();
            }
            if memory.claim(held).is_err() {
                return Err(Stop::Memory);
            }
            memory.release(held);
        }
        Ok(std::mem::take(&mut values[number as usize]))
    }
}

/// Adds a number that is not longer; how many words the sum is longer.
fn add(sum: &mut Natural, short: &[u64]) -> usize {
    let (same, rest) = sum.split_at_mut(short.len());
    let mut carry = false;
    for (word, &more) in same.iter_mut().zip(short) {
        let (once, first) = word.overflowing_add(more);
        let (twice, second) = once.overflowing_add(u64::from(carry));
        *word = twice;
        carry = first | second;
    }
    for word in rest {
        if !carry {
            return 0;
        }
        (*word, carry) = word.overflowing_add(1);
    }
    if carry {
        sum.push(1);
    }
    usize::from(carry)
}

/// How many markings a set holds.
pub fn markings(diagram: &Diagram, set: Node, watch: &mut Watch<'_>) -> Result<Natural, Stop> {
    let mut counting = Counting { diagram, suffixes: None, table: None, sums: Sums::new(diagram.store.len()) };
    counting.value(Want::Markings(set), watch)
}

/// For each suffix, in how many markings of a set it can fire.
///
/// Of the sums only those of markings are kept from one to the next: the others are as many as nodes above its literals.
pub fn firable(
    diagram: &Diagram,
    suffixes: &Suffixes,
    events: &[Suffix],
    set: Node,
    watch: &mut Watch<'_>,
) -> Result<Vec<Natural>, Stop> {
    let mut counting =
        Counting { diagram, suffixes: Some(suffixes), table: None, sums: Sums::new(diagram.store.len()) };
    counting.find(Want::Markings(set), watch)?;
    let kept = counting.sums.terms.len();
    let mut counts = Vec::with_capacity(events.len());
    for &event in events {
        counts.push(counting.value(Want::firable(event, set), watch)?);
        counting.sums.terms.truncate(kept);
        counting.sums.known.clear();
    }
    Ok(counts)
}

/// How many pairs there are of a marking of a set and an event of a table (of tests) that can fire in it.
pub fn edges(
    diagram: &Diagram,
    suffixes: &Suffixes,
    table: &Table,
    set: Node,
    levels: u32,
    watch: &mut Watch<'_>,
) -> Result<Natural, Stop> {
    let mut counting =
        Counting { diagram, suffixes: Some(suffixes), table: Some(table), sums: Sums::new(diagram.store.len()) };
    counting.find(Want::Edges(set), watch)?;
    counting.find(Want::Markings(set), watch)?;
    let mut wanted = Vec::new();
    counting.awake(set, levels, &mut wanted);
    for want in wanted {
        counting.find(want, watch)?;
    }
    let awake = counting.summed_awake(set, levels);
    let idle = counting.known(Want::Markings(set)).unwrap_or(ZERO);
    let idle = counting.sums.times(table.idle, idle);
    let below = counting.known(Want::Edges(set)).unwrap_or(ZERO);
    let all = counting.sums.add(below, awake);
    let all = counting.sums.add(all, idle);
    counting.evaluated(all, watch)
}

struct Counting<'a> {
    diagram: &'a Diagram,
    suffixes: Option<&'a Suffixes>,
    table: Option<&'a Table>,
    sums: Sums,
}

impl Counting<'_> {
    fn value(&mut self, want: Want, watch: &mut Watch<'_>) -> Result<Natural, Stop> {
        self.find(want, watch)?;
        self.evaluated(self.known(want).unwrap_or(ZERO), watch)
    }

    fn evaluated(&self, number: u32, watch: &mut Watch<'_>) -> Result<Natural, Stop> {
        let memory = &self.diagram.store.memory;
        let bytes = self.sums.bytes() + 16 * self.sums.terms.len();
        memory.claim(bytes)?;
        let value = self.sums.value(number, memory, watch);
        memory.release(bytes);
        value
    }

    fn known(&self, want: Want) -> Option<u32> {
        match want {
            Want::Markings(EMPTY) | Want::Firable(_, EMPTY) | Want::Edges(EMPTY | UNIT) => Some(ZERO),
            Want::Markings(UNIT) => Some(ONE),
            Want::Firable(suffix, node) if self.needs(suffix) > self.diagram.store.level(node) => Some(ZERO),
            Want::Markings(node) => Some(self.sums.markings[node as usize]).filter(|&number| number != ZERO),
            want => self.sums.known.get(&want).copied(),
        }
    }

    fn needs(&self, suffix: Suffix) -> u32 {
        self.suffixes.map_or(0, |suffixes| suffixes.get(suffix).needs)
    }

    /// What a number is the sum of.
    fn parts(&self, want: Want, parts: &mut Vec<Want>) {
        let store = &self.diagram.store;
        match want {
            Want::Markings(node) => {
                parts.extend([Want::Markings(store.lo(node)), Want::Markings(store.hi(node))]);
            }
            Want::Firable(suffix, node) => {
                let Some(suffixes) = self.suffixes else { return };
                let literal = suffixes.get(suffix);
                if store.level(node) > literal.level {
                    parts.extend([Want::Firable(suffix, store.lo(node)), Want::Firable(suffix, store.hi(node))]);
                } else {
                    let (lo, hi) = store.split(node, literal.level);
                    parts.push(Want::firable(literal.next, if literal.kind.wants() { hi } else { lo }));
                }
            }
            Want::Edges(node) => {
                let level = store.level(node);
                for child in [store.lo(node), store.hi(node)] {
                    parts.push(Want::Edges(child));
                    self.awake(child, level - 1, parts);
                }
                if let Some(table) = self.table {
                    parts.extend(table.at(level).iter().map(|&event| Want::Firable(event, node)));
                }
            }
        }
    }

    /// The events above a node, up to a level, that may fire on it.
    fn awake(&self, node: Node, to: u32, parts: &mut Vec<Want>) {
        let Some(table) = self.table else { return };
        let own = self.diagram.store.level(node);
        let mut from = own;
        while let Some(level) = table.wake(from, to, own).filter(|_| node != EMPTY) {
            parts.extend(table.at(level).iter().map(|&event| Want::Firable(event, node)));
            from = level;
        }
    }

    fn summed_awake(&mut self, node: Node, to: u32) -> u32 {
        let mut parts = Vec::new();
        self.awake(node, to, &mut parts);
        self.sum(&parts)
    }

    /// The sum of numbers that are known.
    fn sum(&mut self, parts: &[Want]) -> u32 {
        let mut total = ZERO;
        for &part in parts {
            let number = self.known(part).unwrap_or(ZERO);
            total = self.sums.add(total, number);
        }
        total
    }

    fn find(&mut self, want: Want, watch: &mut Watch<'_>) -> Result<(), Stop> {
        let mut todo = vec![want];
        let mut parts = Vec::new();
        while let Some(&want) = todo.last() {
            if self.known(want).is_some() {
                todo.pop();
                continue;
            }
            watch.tick(1)?;
            parts.clear();
            self.parts(want, &mut parts);
            let before = todo.len();
            todo.extend(parts.iter().copied().filter(|&part| self.known(part).is_none()));
            if todo.len() == before {
                let number = self.sum(&parts);
                match want {
                    Want::Markings(node) => self.sums.markings[node as usize] = number,
                    _ => _ = self.sums.known.insert(want, number),
                }
                todo.pop();
            }
        }
        Ok(())
    }
}

const _: () = assert!(TERMINAL == 0);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;

    #[test]
    fn a_carry_goes_through_all_words() {
        for (sum, short, wanted) in [
            (vec![u64::MAX, u64::MAX], vec![1], vec![0, 0, 1]),
            (vec![u64::MAX, 5, 7], vec![1], vec![0, 6, 7]),
            (vec![u64::MAX, u64::MAX], vec![u64::MAX, u64::MAX], vec![u64::MAX - 1, u64::MAX, 1]),
            (vec![0, u64::MAX], vec![u64::MAX, 0], vec![u64::MAX, u64::MAX]),
        ] {
            let mut found = sum.clone();
            let more = add(&mut found, &short);
            assert_eq!((found.len(), &found), (sum.len() + more, &wanted));
        }
    }

    #[test]
    fn numbers_without_limit_are_powers_of_two_where_each_is_doubled() {
        // 2^n by doubling, and 2^n - 1 by adding up all smaller powers, each of which is needed twice.
        let mut sums = Sums::new(0);
        let (mut power, mut all) = (ONE, ONE);
        for _ in 0..300 {
            power = sums.add(power, power);
            all = sums.add(power, all);
        }
        let (memory, mut poll) = (Memory::new(1 << 20), unwatched);
        let value = sums.value(all, &memory, &mut Watch::new(None, &mut poll));
        let mut wanted = vec![u64::MAX; 4];
        wanted.push((1 << (301 - 4 * 64)) - 1);
        assert_eq!((value, memory.used()), (Ok(wanted), 0));
    }
}
