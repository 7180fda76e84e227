//! `find_lasso`: is there a run that an automaton accepts; and `Lasso`: what was found.

use std::time::Instant;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::rows::Rows;
use super::stubborn::formula;
use super::{Patience, but_ctrl_c, detached};
use crate::budget::Stop;
use crate::lasso::automaton::{Admits, Automaton, Edge};
use crate::lasso::search::{Limits, Outcome, search};
use crate::stubborn::search::Prepared;

/// A formula from Python: (operator, operands).
type Nodes = Vec<(u8, Vec<u32>)>;
/// An edge: label, whether only the transitions listed are admitted or all but these, they, stutters, target, marks.
type Row = (u32, bool, Vec<u32>, bool, u32, Vec<u32>);

/// What a search for a lasso found; see the stub `_engine.pyi`.
#[pyclass(frozen, module = "firable.analysis._engine")]
pub(crate) struct Lasso {
    outcome: Outcome,
}

#[pymethods]
impl Lasso {
    #[getter]
    fn complete(&self) -> bool {
        self.outcome.stop.is_none()
    }

    #[getter]
    fn reason(&self) -> Option<&'static str> {
        self.outcome.stop.map(Stop::as_str)
    }

    #[getter]
    fn run(&self) -> Option<(Vec<u32>, Vec<u32>)> {
        self.outcome.lasso.as_ref().map(|lasso| (lasso.prefix.clone(), lasso.cycle.clone()))
    }

    #[getter]
    fn n_vertices(&self) -> usize {
        self.outcome.vertices
    }

    #[getter]
    fn n_edges(&self) -> u64 {
        self.outcome.edges
    }

    #[getter]
    fn seconds(&self) -> f64 {
        self.outcome.seconds
    }
}

fn edge((label, only, transitions, stutters, target, marks): Row) -> PyResult<Edge> {
    let bit = |mark: u32| 1_u64.checked_shl(mark).ok_or_else(|| PyValueError::new_err("more than 64 marks"));
    let marks = marks.into_iter().map(bit).try_fold(0, |all, bit| bit.map(|bit| all | bit))?;
    let admits = if only { Admits::Only(transitions) } else { Admits::AllBut(transitions) };
    Ok(Edge { label, admits, stutters, target, marks })
}

/// Looks for a run that an automaton accepts, depth first.
#[pyfunction]
#[pyo3(signature = (n_places, transitions, initial, labels, rows, n_marks, *, seed=None, sparing=false,
                    max_vertices, max_memory_bytes, max_seconds, cancelled=None))]
#[allow(clippy::too_many_arguments)]
pub(crate) fn find_lasso(
    py: Python<'_>,
    n_places: usize,
    transitions: Rows,
    initial: Vec<u32>,
    labels: Vec<Nodes>,
    rows: Vec<Vec<Row>>,
    n_marks: u32,
    seed: Option<u64>,
    sparing: bool,
    max_vertices: usize,
    max_memory_bytes: usize,
    max_seconds: Option<f64>,
    cancelled: Option<Py<PyAny>>,
) -> PyResult<Lasso> {
    let begun = Instant::now();
    let patience = Patience::new(max_seconds, cancelled)?;
    let labels = labels.into_iter().map(|nodes| formula(nodes, n_places)).collect::<PyResult<Vec<_>>>()?;
    let rows = { rows.into_iter() }
        .map(|row| row.into_iter().map(edge).collect::<PyResult<Vec<_>>>())
        .collect::<PyResult<Vec<_>>>()?;
    let prepared =
        py.detach(|| transitions.net(n_places, &initial).map(Prepared::new)).map_err(PyValueError::new_err)?;
    let count = prepared.net.transitions.len();
    let mut automaton = Automaton::new(labels, rows, n_marks, count).map_err(PyValueError::new_err)?;
    let time = patience.time.map(|time| time.saturating_sub(begun.elapsed()));
    let limits = Limits { vertices: max_vertices, memory_bytes: max_memory_bytes, time, seed, sparing };
    let mut raised = None;
    let outcome = detached(py, &patience, &mut raised, |poll| search(&prepared, &mut automaton, limits, poll));
    but_ctrl_c(py, raised)?;
    Ok(Lasso { outcome })
}
