//! The transitions of a net, as Python gives them: a row for each, or all end to end.
//!
//! A row is a tuple of lists. Half a million of them are three million objects, which take Python longer to make, and to
//! look through for cycles, than the search takes that they are made for. So a net is given *flat*: for inputs, outputs,
//! permissive and inhibitive gates in turn, how many places each transition has and which, as bytes of 32-bit numbers.
//! Rows are for what is written by hand, and for a net with a transition of one's own.

use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;

use crate::net::{Net, Transition};

/// A transition: inputs, outputs, permissive and inhibitive gate places, external literals.
type Row = (Vec<u32>, Vec<u32>, Vec<u32>, Vec<u32>, Vec<(u32, bool)>);
/// How many each transition has, and which, end to end.
type Ends = (PyBackedBytes, PyBackedBytes);

/// All transitions of a net.
#[derive(FromPyObject)]
pub(crate) enum Rows {
    /// One by one.
    Listed(Vec<Row>),
    /// End to end: inputs, outputs, permissive and inhibitive gates, external literals as twice the signal and the value.
    Flat(Vec<Ends>),
}

impl Rows {
    /// The transitions, each of them made from its own part.
    pub(crate) fn transitions(self) -> Result<Vec<Transition>, String> {
        let flat = match self {
            // Each row is freed as it is read: half a million of them take as much as a diagram.
            Rows::Listed(rows) => {
                return Ok(rows.into_iter().map(|(i, o, p, h, x)| Transition::new(&i, &o, &p, &h, &x)).collect());
            }
            Rows::Flat(flat) => flat,
        };
        let [inputs, outputs, permissive, inhibitive, external] = flat.as_slice() else {
            return Err(format!("transitions have 5 parts, not {}", flat.len()));
        };
        let mut places = [inputs, outputs, permissive, inhibitive].map(Sets::new);
        let mut literals = Sets::new(external);
        let count = literals.lengths.len();
        if places.iter().any(|sets| sets.lengths.len() != count) {
            return Err("the parts are of different numbers of transitions".to_owned());
        }
        let mut transitions = Vec::with_capacity(count);
        for t in 0..count {
            let mut sets: [Vec<u32>; 4] = Default::default();
            for (set, of) in sets.iter_mut().zip(&mut places) {
                *set = of.next(t)?;
            }
            let literals: Vec<(u32, bool)> = literals.next(t)?.iter().map(|&x| (x >> 1, x & 1 != 0)).collect();
            let [inputs, outputs, permissive, inhibitive] = &sets;
            transitions.push(Transition::new(inputs, outputs, permissive, inhibitive, &literals));
        }
        if places.iter().chain([&literals]).any(|sets| !sets.left.is_empty()) {
            return Err("the parts are longer than their transitions".to_owned());
        }
        Ok(transitions)
    }

    /// Checks and compiles a net.
    pub(crate) fn net(self, n_places: usize, initial: &[u32]) -> Result<Net, String> {
        Net::new(n_places, self.transitions()?, initial)
    }
}

/// Sets end to end, read from the first to the last.
struct Sets<'a> {
    lengths: &'a [[u8; 4]],
    left: &'a [[u8; 4]],
}

impl<'a> Sets<'a> {
    fn new((lengths, ends): &'a Ends) -> Self {
        Sets { lengths: lengths.as_chunks().0, left: ends.as_chunks().0 }
    }

    fn next(&mut self, t: usize) -> Result<Vec<u32>, String> {
        let length = u32::from_ne_bytes(self.lengths[t]) as usize;
        let Some((set, left)) = self.left.split_at_checked(length) else {
            return Err("the parts are shorter than their transitions".to_owned());
        };
        self.left = left;
        Ok(set.iter().map(|&place| u32::from_ne_bytes(place)).collect())
    }
}
