//! The transitions of a net, as Python gives them: a row for each, or all end to end.
//!
//! A row is a tuple of lists. Half a million of them are three million objects, which take Python longer to make, and to
//! look through for cycles, than the search takes that they are made for. So a net is given *flat*: for inputs, outputs,
//! permissive and inhibitive gates in turn, how many places each transition has and which, as bytes of 32-bit numbers.
//! Rows are for what is written by hand, and for a net with a transition of one's own.

use std::collections::HashMap;

use pyo3::intern;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyDict, PyTuple};

use crate::net::{Net, Transition};
use crate::symbolic::events::Mixed;

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
                return Ok(rows.into_iter().map(|(i, o, p, h, x)| Transition::of([i, o, p, h], x)).collect());
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
            transitions.push(Transition::of(sets, literals));
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

/// What there is in an object, as a tuple; a program may have made a list or a set where a net has a tuple.
fn tuple_of<'py>(object: Bound<'py, PyAny>) -> PyResult<Bound<'py, PyTuple>> {
    match object.cast_into::<PyTuple>() {
        Ok(tuple) => Ok(tuple),
        Err(other) => {
            let other = other.into_inner();
            Ok(other.py().get_type::<PyTuple>().call1((other,))?.cast_into()?)
        }
    }
}

/// The transitions of a net, flat, read off its objects. See the stub.
///
/// A net has one string for each of its names, whoever it joins, so an index is known by where the string is: to look
/// into the string, the dictionary and the number takes several times as long. Each object is visited once, and the
/// dictionary from its first entry to its last, for most of the time goes by in waiting for memory.
#[pyfunction]
pub(crate) fn flat<'py>(
    places: &Bound<'py, PyAny>,
    signals: &Bound<'py, PyAny>,
    transitions: Bound<'py, PyAny>,
) -> PyResult<[(Bound<'py, PyBytes>, Bound<'py, PyBytes>); 5]> {
    let py = places.py();
    let parts = [intern!(py, "inputs"), intern!(py, "outputs"), intern!(py, "permissive"), intern!(py, "inhibitive")];
    let mut known: HashMap<usize, u32, Mixed> = HashMap::with_capacity_and_hasher(places.len()?, Mixed::default());
    if let Ok(places) = places.cast::<PyDict>() {
        for (name, number) in places {
            known.insert(name.as_ptr() as usize, number.extract()?);
        }
    }
    // A string that is known by where it is must not make room for another one; nor does anybody else run meanwhile.
    let mut held = Vec::new();
    let mut found: [(Vec<u8>, Vec<u8>); 5] = Default::default();
    for transition in tuple_of(transitions)?.iter_borrowed() {
        for ((lengths, ends), part) in found.iter_mut().zip(parts) {
            let set = tuple_of(transition.getattr(part)?)?;
            lengths.extend_from_slice(&(set.len() as u32).to_ne_bytes());
            for name in set.iter_borrowed() {
                let at = name.as_ptr() as usize;
                let number = match known.get(&at) {
                    Some(&number) => number,
                    None => *known.entry(at).or_insert(places.get_item(name)?.extract()?),
                };
                ends.extend_from_slice(&number.to_ne_bytes());
            }
            if !set.is_empty() {
                held.push(set);
            }
        }
        let [.., (lengths, ends)] = &mut found;
        let literals = tuple_of(transition.getattr(intern!(py, "external"))?)?;
        lengths.extend_from_slice(&(literals.len() as u32).to_ne_bytes());
        for literal in literals.iter_borrowed() {
            let signal: u32 = signals.get_item(literal.getattr(intern!(py, "signal"))?)?.extract()?;
            let wanted = literal.getattr(intern!(py, "wanted"))?.is_truthy()?;
            ends.extend_from_slice(&(2 * signal + u32::from(wanted)).to_ne_bytes());
        }
    }
    Ok(found.map(|(lengths, ends)| (PyBytes::new(py, &lengths), PyBytes::new(py, &ends))))
}
