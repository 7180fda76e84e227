//! The tables of keys, tried on keys that crowd one place and on budgets that end.

use super::*;
use crate::budget::unwatched;

fn insert<S: Slot>(table: &mut Exact<S>, key: u64, memory: &Memory) -> Result<bool, Stop> {
    let (mut asked, mut poll) = (Asked::new(), unwatched);
    let mut watch = Watch::new(None, &mut poll);
    table.ask(&mut asked, 1, |_| key, |_, _| ());
    let open = table.first_look(&mut asked);
    let mut new = false;
    table.insert_open(&mut asked, &mut 0, open, (memory, &mut watch), |_| {
        new = true;
        Ok(())
    })?;
    table.answered(&mut asked, memory, &mut watch)?;
    Ok(new)
}

fn keeps_apart<S: Slot>(bits: u32, keys: &[u64]) {
    let memory = Memory::new(1 << 30);
    let mut table = Exact::<S>::new(bits, &memory).expect("fits");
    for &key in keys {
        assert_eq!(insert(&mut table, key, &memory), Ok(true));
        assert_eq!(insert(&mut table, key, &memory), Ok(false));
    }
    assert_eq!(table.len, keys.len());
    assert!(keys.iter().all(|&key| table.has(key)));
    let all: std::collections::HashSet<u64> = keys.iter().copied().collect();
    assert!((0..1_u64 << bits.min(17)).all(|key: u64| table.has(key) == all.contains(&key)));
    let mut missed = 0;
    for part in keys.chunks(ROOM - 1) {
        let mut asked = Asked::new();
        part.iter().for_each(|&key| table.ask(&mut asked, 1, |_| key, |_, _| ()));
        missed += table.first_look(&mut asked);
    }
    assert!(missed * 3 < keys.len(), "{missed} of {} are not where they belong", keys.len());
    assert_eq!(memory.used(), Exact::<S>::bytes(table.shape));
}

#[test]
fn every_key_is_found_again_and_no_other_after_any_growth() {
    // All keys of sixteen bits: a tag too short would take two for one.
    let all: Vec<u64> = (0..1 << 16).collect();
    keeps_apart::<u32>(16, &all);
    keeps_apart::<u64>(16, &all);
    for bits in [17, 25, 36, 41, 60] {
        // Neighbours, and keys that differ in their high bits alone.
        let keys: Vec<u64> = (0..6_000).chain((1..600).map(|i| i << (bits - 16 + 5))).collect();
        let mut keys: Vec<u64> = keys.into_iter().filter(|&key| key >> bits == 0).collect();
        keys.sort_unstable();
        keys.dedup();
        if bits <= 41 {
            keeps_apart::<u32>(bits, &keys);
        }
        keeps_apart::<u64>(bits, &keys);
    }
}

#[test]
fn keys_that_crowd_one_place_make_the_table_grow_until_they_fit() {
    // All belong into one bucket of the first tables.
    let memory = Memory::new(1 << 26);
    let mut table = Exact::<u32>::new(20, &memory).expect("fits");
    let shape = Shape::new(20, 2, 5);
    let one = (0..1 << 20).find(|&key| shape.mix(key) >> 44 == 1).expect("the factor is odd");
    let keys: Vec<u64> = (0..1000).map(|i: u64| i * one % (1 << 20)).collect();
    assert!(keys.iter().all(|&key| shape.seat::<u32>(shape.mix(key)).0 == 0));
    for &key in &keys {
        assert_eq!(insert(&mut table, key, &memory), Ok(true));
    }
    assert!(keys.iter().all(|&key| table.has(key)));
}

#[test]
fn keys_too_long_for_narrow_slots_of_buckets_with_numbers_have_no_narrow_table() {
    let memory = Memory::new(usize::MAX);
    assert_eq!(Exact::<u32>::least_bytes(60), usize::MAX);
    assert_eq!(Exact::<u32>::new(60, &memory).err(), Some(Stop::Memory));
    assert_eq!(Exact::<u32>::reserving(60, &memory).err(), Some(Stop::Memory));
    assert_eq!(memory.used(), 0);
}

#[test]
fn the_end_of_time_ends_growth_and_loses_nothing() {
    let memory = Memory::new(1 << 28);
    let mut table = Exact::<u32>::new(24, &memory).expect("fits");
    for key in 0..200_000 {
        assert_eq!(insert(&mut table, key, &memory), Ok(true));
    }
    let (shape, used) = (table.shape, memory.used());
    let mut poll = |_| Err(Stop::Cancelled);
    for (deadline, expected) in [(Some(std::time::Instant::now()), Stop::Time), (None, Stop::Cancelled)] {
        assert_eq!(table.grow(&memory, &mut Watch::new(deadline, &mut poll)), Err(expected));
        let cut = table.side(|key| key % 2 == 0, &memory, &mut Watch::new(deadline, &mut poll));
        assert_eq!(cut.err(), Some(expected));
        assert_eq!((table.shape.buckets, memory.used()), (shape.buckets, used));
        assert!((0..200_000).all(|key| table.has(key)) && !table.has(200_000));
    }
}

#[test]
fn memory_that_is_not_there_is_a_return_value_and_loses_nothing() {
    let memory = Memory::new(40_000);
    let mut table = Exact::<u32>::new(20, &memory).expect("fits");
    let count = (0..100_000).find(|&key| insert(&mut table, key, &memory) == Err(Stop::Memory)).expect("too many");
    assert!(memory.used() <= 40_000 && count > 200);
    assert!((0..=count).all(|key| table.has(key)));
}
