//! `evaluate_locally`: does a formula of CTL hold in M0; and `Local`: what was found.

use std::time::Instant;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::rows::Rows;
use super::stubborn::formula;
use super::{Patience, but_ctrl_c, detached};
use crate::budget::Stop;
use crate::local::formula::{Formula, Node};
use crate::local::search::{Limits, Outcome, evaluate};
use crate::stubborn::search::Prepared;

/// A state formula from Python: (operator, operands).
type Nodes = Vec<(u8, Vec<u32>)>;

/// What an evaluation found; see the stub `_engine.pyi`.
#[pyclass(frozen, module = "firable.analysis._engine")]
pub(crate) struct Local {
    outcome: Outcome,
}

#[pymethods]
impl Local {
    #[getter]
    fn holds(&self) -> Option<bool> {
        self.outcome.holds
    }

    #[getter]
    fn reason(&self) -> Option<&'static str> {
        self.outcome.stop.map(Stop::as_str)
    }

    #[getter]
    fn n_markings(&self) -> usize {
        self.outcome.markings
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

fn node((operator, operands): (String, Vec<u32>)) -> PyResult<Node> {
    match (operator.as_str(), operands.as_slice()) {
        ("label", &[label]) => Ok(Node::Label(label)),
        ("not", &[one]) => Ok(Node::Not(one)),
        ("EX", &[one]) => Ok(Node::Next(one)),
        ("EU", &[left, right]) => Ok(Node::SomeUntil(left, right)),
        ("AU", &[left, right]) => Ok(Node::EachUntil(left, right)),
        ("and", _) => Ok(Node::All(operands)),
        ("or", _) => Ok(Node::Any(operands)),
        _ => Err(PyValueError::new_err(format!("({operator:?}, {operands:?}) is no node of a formula"))),
    }
}

/// Evaluates a formula of CTL in M0, at the markings that it asks about.
#[pyfunction]
#[pyo3(signature = (n_places, transitions, initial, labels, nodes, *, first, max_markings, max_memory_bytes,
                    max_seconds, cancelled=None))]
#[allow(clippy::too_many_arguments)]
pub(crate) fn evaluate_locally(
    py: Python<'_>,
    n_places: usize,
    transitions: Rows,
    initial: Vec<u32>,
    labels: Vec<Nodes>,
    nodes: Vec<(String, Vec<u32>)>,
    first: usize,
    max_markings: usize,
    max_memory_bytes: usize,
    max_seconds: Option<f64>,
    cancelled: Option<Py<PyAny>>,
) -> PyResult<Local> {
    let begun = Instant::now();
    let patience = Patience::new(max_seconds, cancelled)?;
    let labels = labels.into_iter().map(|nodes| formula(nodes, n_places)).collect::<PyResult<Vec<_>>>()?;
    let nodes = nodes.into_iter().map(node).collect::<PyResult<Vec<_>>>()?;
    let mut formula = Formula::new(nodes, labels).map_err(PyValueError::new_err)?;
    let prepared =
        py.detach(|| transitions.net(n_places, &initial).map(Prepared::new)).map_err(PyValueError::new_err)?;
    let time = patience.time.map(|time| time.saturating_sub(begun.elapsed()));
    let limits = Limits { markings: max_markings, memory_bytes: max_memory_bytes, time, first };
    let mut raised = None;
    let outcome = detached(py, &patience, &mut raised, |poll| evaluate(&prepared, &mut formula, limits, poll));
    but_ctrl_c(py, raised)?;
    Ok(Local { outcome })
}
