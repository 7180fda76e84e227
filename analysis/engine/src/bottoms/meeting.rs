//! Ways from a few markings back to M0, sought from both ends.
//!
//! Backwards from M0, breadth first, some thousands of markings are kept that reach it: about the root of all, times a
//! few. Forwards from a marking, 64 strolls fire at random, all at once in bit slices, until one of them stands on one that
//! is kept. Where strolls come about evenly, they need as many steps as the graph has markings for one that is kept, which
//! is about the root of all again. It is the birthday paradox in the form of Pollard's kangaroos ("Monte Carlo methods for
//! index computation (mod p)", 1978).
//!
//! A stroll that meets nobody shows nothing; only a backward search that ends by itself does. Rejected: breadth first
//! from the marking itself (M0 may be the last that is found), and strolls until M0 itself (it is one marking of all).

use std::collections::HashSet;

use crate::batch::Batch;
use crate::budget::{Memory, Stop, Watch};
use crate::explore::Space;
use crate::marking::{Width, holds, members, mix, unslice};

/// Passes over all transitions between two looks at where strolls have come to.
const PASSES: usize = 4;
/// How many times the root of the number of markings are kept. As many looks as the root at 64 strolls each are 256 times
/// what is enough where they come about evenly: M0 is often a marking that is seldom met.
const KEPT: usize = 4;
/// Fewest looks, and after how many all begin again: what strolls come to in the long run may be far from M0.
const LOOKS_LEAST: usize = 96;
const LOOKS_EACH: usize = 32;
/// Bytes held for a marking beside its words.
const KEPT_BYTES: usize = 64;

/// Markings from which M0 is reached.
struct Returning {
    markings: HashSet<Vec<u64>>,
    /// Whether these are all.
    all: bool,
}

/// Whether M0 is reached from each of some markings, as far as that is found out.
pub(super) fn all_return<W: Width>(
    width: W,
    space: &Space,
    from: &[u32],
    memory: &Memory,
    watch: &mut Watch<'_>,
) -> Result<bool, Stop> {
    let root = space.len().isqrt();
    let bytes = (KEPT * root + 1) * (8 * width.words() + KEPT_BYTES);
    memory.claim(bytes)?;
    let returning = returning(width, space, KEPT * root, watch)?;
    let looks = root.max(LOOKS_LEAST);
    let mut seed = 1;
    for &index in from {
        let marking = space.table.store.get(width, index as usize);
        let meets = returning.markings.contains(marking)
            || !returning.all && meets(width, space, marking, &returning, (looks, &mut seed), watch)?;
        if !meets {
            memory.release(bytes);
            return Ok(false);
        }
    }
    memory.release(bytes);
    Ok(true)
}

/// Searches backwards from M0 until more than so many markings are found.
fn returning<W: Width>(width: W, space: &Space, most: usize, watch: &mut Watch<'_>) -> Result<Returning, Stop> {
    let (net, words) = (&*space.net, width.words());
    let mut batch = Batch::new(net);
    let (mut slices, mut before) = (Vec::new(), vec![0; 64 * words]);
    let mut queue = net.initial.clone();
    let mut markings = HashSet::from([queue.clone()]);
    let mut next = 0;
    while next < queue.len() {
        let end = queue.len().min(next + 64 * words);
        batch.markings.clear();
        batch.markings.extend_from_slice(&queue[next..end]);
        batch.slice(width);
        next = end;
        for t in (0..net.transitions.len()).filter(|&t| space.fired[t] > 0) {
            let fire = net.backward.fire(t, &batch.slices, batch.valid);
            if fire == 0 {
                continue;
            }
            slices.clone_from(&batch.slices);
            net.flip_slices(t, &mut slices, fire);
            unslice(words, &slices, &mut before);
            for j in members(fire) {
                let marking = &before[j * words..(j + 1) * words];
                // Nobody comes from M0 to the others.
                if !markings.contains(marking) && space.may_hold(width, marking) {
                    if markings.len() > most {
                        return Ok(Returning { markings, all: false });
                    }
                    markings.insert(marking.to_vec());
                    queue.extend_from_slice(marking);
                }
            }
        }
        watch.tick(64 * net.transitions.len())?;
    }
    Ok(Returning { markings, all: true })
}

/// Whether one of 64 strolls from a marking meets one of those that return.
fn meets<W: Width>(
    width: W,
    space: &Space,
    marking: &[u64],
    returning: &Returning,
    (looks, seed): (usize, &mut u64),
    watch: &mut Watch<'_>,
) -> Result<bool, Stop> {
    let (net, words) = (&*space.net, width.words());
    let start: Vec<u64> = (0..64 * words as u32).map(|p| if holds(marking, p) { !0 } else { 0 }).collect();
    let (mut slices, mut at) = (start.clone(), vec![0; 64 * words]);
    let mut chance = || {
        *seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(*seed)
    };
    for look in 0..looks {
        if look % LOOKS_EACH == 0 {
            slices.clone_from(&start);
        }
        for _ in 0..PASSES {
            for t in 0..net.transitions.len() {
                // Of what it could fire, a stroll passes by a half, three quarters or seven eighths.
                let some = (0..look / LOOKS_EACH % 3).fold(chance(), |some, _| some & chance());
                let fire = net.forward.fire(t, &slices, some);
                net.flip_slices(t, &mut slices, fire);
            }
        }
        unslice(words, &slices, &mut at);
        if at.chunks_exact(words).any(|marking| returning.markings.contains(marking)) {
            return Ok(true);
        }
        watch.tick(64 + PASSES * net.transitions.len())?;
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::fixpoints::{Against, backward};
    use crate::samples::random_spaces;
    use crate::with_width;

    #[test]
    fn who_is_said_to_return_does_and_a_search_that_ends_by_itself_finds_all() {
        let (mut yes, mut no, mut whole) = (0, 0, 0);
        for space in random_spaces(200, false).filter(|space| space.len() > 8) {
            let (mut poll, memory) = (unwatched, space.memory.clone());
            let mut watch = Watch::new(None, &mut poll);
            let mut initial = vec![0; space.len()];
            initial[0] = 1;
            let expected = backward(&space, &initial, None, None, &Against::default(), &mut watch).expect("fits");
            let last = space.len() as u32 - 1;
            with_width!(space.net.words, width => {
                let found = returning(width, &space, space.len() / 2, &mut watch).expect("in time");
                for (index, &returns) in expected.iter().enumerate() {
                    let kept = found.markings.contains(space.marking(index));
                    assert!(if kept { returns != 0 } else { !found.all || returns == 0 });
                }
                whole += usize::from(found.all);
                let held = memory.used();
                let returns = all_return(width, &space, &[last], &memory, &mut watch).expect("in time");
                assert_eq!(memory.used(), held);
                assert!(!returns || expected[last as usize] != 0);
                *(if returns { &mut yes } else { &mut no }) += 1;
            });
        }
        assert!(yes > 50 && no > 50 && whole > 50, "{yes} {no} {whole}");
    }
}
