//! Which pairs of literals are true together, by the arcs alone: the binding.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::concurrency::Concurrency;
use crate::marking::words_for;
use crate::python::rows::Rows;
use crate::python::{Patience, answered, little_endian};

/// The pairs of places that may be marked together. See the stub.
#[pyfunction]
#[pyo3(signature = (n_places, transitions, initial, bound, *, max_words, max_seconds, cancelled=None))]
#[allow(clippy::too_many_arguments)]
pub(crate) fn pairs_together<'py>(
    py: Python<'py>,
    n_places: usize,
    transitions: Rows,
    initial: Vec<u32>,
    bound: Option<&[u8]>,
    max_words: usize,
    max_seconds: Option<f64>,
    cancelled: Option<Py<PyAny>>,
) -> PyResult<Option<Bound<'py, PyBytes>>> {
    let patience = Patience::new(max_seconds, cancelled)?;
    let (words, chunks) = (words_for(n_places), bound.map(<[u8]>::as_chunks));
    if chunks.is_some_and(|(chunks, rest)| chunks.len() != words * n_places || !rest.is_empty()) {
        return Err(PyValueError::new_err(format!("the bound is not {n_places} rows of {words} words")));
    }
    let bound = chunks.map(|(chunks, _)| chunks.iter().map(|&word| u64::from_le_bytes(word)).collect());
    let transitions = transitions.transitions().map_err(PyValueError::new_err)?;
    let named =
        transitions.iter().flat_map(|t| t.inputs.iter().chain(&t.outputs).chain(&t.permissive).chain(&t.inhibitive));
    if let Some(place) = named.chain(&initial).find(|&&place| place as usize >= n_places) {
        return Err(PyValueError::new_err(format!("place {place} is not one of the {n_places} places")));
    }
    let found = answered(py, &patience, |watch| {
        Concurrency::within(max_words, n_places, &transitions, &initial, bound, watch)
    })?;
    found.map(|found| little_endian(py, &found.into_rows(), u64::to_le_bytes)).transpose()
}
