//! `Compact`: a search of all markings that keeps no graph.

use std::time::Instant;

use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;

use super::rows::Rows;
use super::stubborn::formula;
use super::{BudgetExceeded, Patience, answered, but_ctrl_c, detached};
use crate::budget::Stop;
use crate::compact::{self, Hit, Outcome};

/// A formula from Python: (operator, operands).
type Nodes = Vec<(u8, Vec<u32>)>;

/// What a compact search found; see the stub `_engine.pyi`.
#[pyclass(module = "firable.analysis._engine")]
pub(crate) struct Compact {
    search: compact::Compact,
    outcome: Outcome,
}

impl Compact {
    fn way(
        &mut self,
        py: Python<'_>,
        hit: Option<Hit>,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Option<Vec<u32>>> {
        let patience = Patience::new(max_seconds, cancelled)?;
        let search = &mut self.search;
        hit.map(|hit| answered(py, &patience, |watch| search.way_to(&hit, watch))).transpose()
    }
}

#[pymethods]
impl Compact {
    #[getter]
    fn complete(&self) -> bool {
        self.outcome.stop.is_none() && !self.outcome.met
    }

    #[getter]
    fn reason(&self) -> Option<&'static str> {
        self.outcome.stop.map(Stop::as_str)
    }

    #[getter]
    fn n_markings(&self) -> u64 {
        self.outcome.found.markings
    }

    #[getter]
    fn n_edges(&self) -> u64 {
        self.outcome.found.edges
    }

    #[getter]
    fn n_levels(&self) -> usize {
        self.outcome.levels
    }

    #[getter]
    fn n_deadlocks(&self) -> u64 {
        self.outcome.deadlocks
    }

    #[getter]
    fn memory_bytes(&self) -> usize {
        self.outcome.bytes
    }

    #[getter]
    fn seconds(&self) -> f64 {
        self.outcome.seconds
    }

    fn fired(&self) -> Vec<u64> {
        self.outcome.fired.clone()
    }

    fn contacts(&self) -> Vec<u64> {
        self.outcome.contacts.clone()
    }

    fn goals(&self) -> Vec<bool> {
        self.outcome.goals.iter().map(Option::is_some).collect()
    }

    #[pyo3(signature = (*, max_seconds=None, cancelled=None))]
    fn way_to_contact(
        &mut self,
        py: Python<'_>,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Option<Vec<u32>>> {
        self.way(py, self.outcome.contact, max_seconds, cancelled)
    }

    #[pyo3(signature = (*, max_seconds=None, cancelled=None))]
    fn way_to_deadlock(
        &mut self,
        py: Python<'_>,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Option<Vec<u32>>> {
        self.way(py, self.outcome.deadlock, max_seconds, cancelled)
    }

    #[pyo3(signature = (goal, *, max_seconds=None, cancelled=None))]
    fn way_to_goal(
        &mut self,
        py: Python<'_>,
        goal: usize,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Option<Vec<u32>>> {
        let count = self.outcome.goals.len();
        let hit = self.outcome.goals.get(goal).copied();
        let hit = hit.ok_or_else(|| PyIndexError::new_err(format!("there is no goal {goal} of {count}")))?;
        self.way(py, hit, max_seconds, cancelled)
    }
}

/// Searches all markings, breadth first, and keeps no graph.
#[pyfunction]
#[pyo3(signature = (n_places, transitions, initial, goals, *, until_met=false, max_memory_bytes, max_seconds,
                    cancelled=None, progress=None))]
#[allow(clippy::too_many_arguments)]
pub(crate) fn explore_compactly(
    py: Python<'_>,
    n_places: usize,
    transitions: Rows,
    initial: Vec<u32>,
    goals: Vec<Nodes>,
    until_met: bool,
    max_memory_bytes: usize,
    max_seconds: Option<f64>,
    cancelled: Option<Py<PyAny>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Compact> {
    let begun = Instant::now();
    let patience = Patience::new(max_seconds, cancelled)?.telling(progress);
    let goals = goals.into_iter().map(|nodes| formula(nodes, n_places)).collect::<PyResult<Vec<_>>>()?;
    let net = transitions.net(n_places, &initial).map_err(PyValueError::new_err)?;
    let mut raised = None;
    let left = patience.time.map(|time| time.saturating_sub(begun.elapsed()));
    let found = detached(py, &patience, &mut raised, |poll| {
        let mut search = compact::Compact::new(net, goals, max_memory_bytes)?;
        let outcome = search.search(!until_met, left, poll);
        Some(Compact { search, outcome })
    });
    but_ctrl_c(py, raised)?;
    found.ok_or_else(|| BudgetExceeded::new_err("more than 60 places determine a marking"))
}
