//! `explore`: the way from a net of Python to a graph.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::graph::Graph;
use super::rows::Rows;
use super::{BudgetExceeded, Patience, but_ctrl_c, detached};
use crate::explore::{Limits, Space};

/// Explores the reachability graph from a marking, breadth first.
#[pyfunction]
#[pyo3(signature = (n_places, transitions, initial, *, step=false, max_markings, max_memory_bytes, max_seconds,
                    threads=1, second_free=None, cancelled=None, progress=None))]
#[allow(clippy::too_many_arguments)]
pub(crate) fn explore(
    py: Python<'_>,
    n_places: usize,
    transitions: Rows,
    initial: Vec<u32>,
    step: bool,
    max_markings: usize,
    max_memory_bytes: usize,
    max_seconds: Option<f64>,
    threads: usize,
    second_free: Option<Py<PyAny>>,
    cancelled: Option<Py<PyAny>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Graph> {
    if !(1..=2).contains(&threads) || (step && threads == 2) {
        let who = if step { "steps are explored by 1 thread" } else { "1 or 2 threads explore" };
        return Err(PyValueError::new_err(format!("{who}, not {threads}")));
    }
    // Until somebody has said so, it is not.
    let free = Arc::new(AtomicBool::new(second_free.is_none()));
    let patience = Patience::new(max_seconds, cancelled)?.telling(progress).noting(second_free, &free);
    let limits = Limits { step, markings: max_markings, memory_bytes: max_memory_bytes, time: patience.time };
    let mut raised = None;
    let space = detached(py, &patience, &mut raised, |poll| {
        let two = (threads == 2).then_some(free);
        transitions.net(n_places, &initial).map(|net| Space::explore_by(two, net, limits, poll))
    })
    .map_err(PyValueError::new_err)?;
    but_ctrl_c(py, raised)?;
    match space {
        Ok(space) => Ok(Graph::new(space)),
        Err(_) => Err(BudgetExceeded::new_err("max_memory_bytes does not hold the net itself")),
    }
}
