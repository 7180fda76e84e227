//! The physical limit, for benchmarks: keys looked up and inserted at random in a table of a given size, and nothing else.
//!
//! Arguments: words of a key, number of distinct keys, number of operations. Who asks for each edge whether its
//! marking is known pays one such operation for it at least; the engine does not ask for each (`sleep.rs`). Operations come in batches of 64, whose
//! first probes do not wait for each other; keys of one or two words stand in the table itself, longer ones in an array
//! that the table points into. Nothing is computed but the key, from a counter, and its hash. The table is a power of two
//! and at most three quarters full. Prints the keys found and the seconds.

use std::time::Instant;

const BATCH: usize = 64;

/// Steele, Lea and Flood's `SplitMix64`, as a hash of a counter.
fn mixed(counter: u64) -> u64 {
    let mut z = counter.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The number of the key that each operation asks for: each key once, in order, spread evenly over the operations, and
/// between them earlier ones at random. Without a division, which would cost as much as the table.
struct Asked {
    keys: u64,
    operations: u64,
    operation: u64,
    known: u64,
    due: u64,
}

impl Asked {
    fn next(&mut self) -> u64 {
        self.operation += 1;
        self.due += self.keys;
        if self.due >= self.operations || self.known == 0 {
            self.due = self.due.saturating_sub(self.operations);
            self.known += 1;
            return self.known - 1;
        }
        ((u128::from(mixed(self.operation)) * u128::from(self.known)) >> 64) as u64
    }
}

fn key<const W: usize>(number: u64) -> [u64; W] {
    let first = mixed(number) | 1; // no key is zero, which marks an empty slot
    std::array::from_fn(|w| first.rotate_left(w as u32))
}

fn slots(keys: u64) -> usize {
    ((keys + keys / 3 + 1) as usize).next_power_of_two()
}

fn inline<const W: usize>(keys: u64, operations: u64) -> u64 {
    let mut table = vec![[0u64; W]; slots(keys)];
    let mask = table.len() - 1;
    let mut found = 0;
    let mut asked = Asked { keys, operations, operation: 0, known: 0, due: 0 };
    let mut operation = 0;
    while operation < operations {
        let count = BATCH.min((operations - operation) as usize);
        let mut batch = [([0u64; W], 0usize); BATCH];
        for slot in &mut batch[..count] {
            let key = key::<W>(asked.next());
            *slot = (key, mixed(key[0]) as usize & mask);
        }
        for &(key, home) in &batch[..count] {
            let mut at = home;
            while table[at] != key {
                if table[at][0] == 0 {
                    table[at] = key;
                    found += 1;
                    break;
                }
                at = (at + 1) & mask;
            }
        }
        operation += count as u64;
    }
    found
}

fn indexed<const W: usize>(keys: u64, operations: u64) -> u64 {
    let mut table = vec![0u32; slots(keys)];
    let mask = table.len() - 1;
    let mut array: Vec<[u64; W]> = Vec::with_capacity(keys as usize);
    let mut asked = Asked { keys, operations, operation: 0, known: 0, due: 0 };
    let mut operation = 0;
    while operation < operations {
        let count = BATCH.min((operations - operation) as usize);
        let mut batch = [([0u64; W], 0usize); BATCH];
        for slot in &mut batch[..count] {
            let key = key::<W>(asked.next());
            *slot = (key, mixed(key[0]) as usize & mask);
        }
        for &(key, home) in &batch[..count] {
            let mut at = home;
            loop {
                let index = table[at];
                if index == 0 {
                    array.push(key);
                    table[at] = array.len() as u32;
                    break;
                }
                if array[index as usize - 1] == key {
                    break;
                }
                at = (at + 1) & mask;
            }
        }
        operation += count as u64;
    }
    array.len() as u64
}

fn main() {
    let numbers: Vec<u64> =
        std::env::args().skip(1).map(|text| text.parse().expect("words, keys and operations are numbers")).collect();
    let &[words, keys, operations] = numbers.as_slice() else { panic!("say words, keys, operations") };
    let start = Instant::now();
    let found = match words {
        1 => inline::<1>(keys, operations),
        2 => inline::<2>(keys, operations),
        3 | 4 => indexed::<4>(keys, operations),
        _ => indexed::<8>(keys, operations),
    };
    assert_eq!(found, keys.min(operations), "each key is inserted once");
    println!("{found} {}", start.elapsed().as_secs_f64());
}
