//! `Stubborn`: searches of one net by stubborn sets; and `Search`: what such a search found.

use std::sync::Arc;
use std::time::Instant;

use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;

use super::rows::Rows;
use super::{BudgetExceeded, Patience, but_ctrl_c, detached, mask};
use crate::budget::{Stop, Watch};
use crate::stubborn::cover;
use crate::stubborn::dependencies::literal;
use crate::stubborn::formula::{Formula, Node};
use crate::stubborn::search::{self, Goal, Limits, Prepared};
use crate::stubborn::walk;
use crate::stubborn::walker::Target;
use crate::table::NONE;

/// A formula from Python: (operator, operands), 0 empty, 1 full, 2 all, 3 any.
type Nodes = Vec<(u8, Vec<u32>)>;

/// Where each way goes on from, what it fires, and which transitions are firable after how many of its firings.
type Ways = Vec<(Option<(u32, u32)>, Vec<u32>, Vec<(u32, u32)>)>;

/// A net that is ready for searches; see the stub `_engine.pyi`.
#[pyclass(frozen, module = "firable.analysis._engine")]
pub(crate) struct Stubborn {
    prepared: Arc<Prepared>,
}

/// What a search found; see the stub.
#[pyclass(frozen, module = "firable.analysis._engine")]
pub(crate) struct Search {
    search: search::Search,
}

/// Reads a formula over so many places.
pub(crate) fn formula(nodes: Nodes, places: usize) -> PyResult<Formula> {
    let node = |(operator, operands): (u8, Vec<u32>)| match (operator, operands.as_slice()) {
        (0 | 1, &[place]) if (place as usize) < places => Ok(Node::Literal(literal(place, operator == 1))),
        (2, _) => Ok(Node::All(operands)),
        (3, _) => Ok(Node::Any(operands)),
        _ => Err(PyValueError::new_err(format!("({operator}, {operands:?}) is no node of a formula"))),
    };
    let nodes = nodes.into_iter().map(node).collect::<PyResult<_>>()?;
    Formula::new(nodes, places).map_err(PyValueError::new_err)
}

impl Stubborn {
    /// Refuses transitions that do not exist.
    fn existing(&self, transitions: &[u32]) -> PyResult<()> {
        let count = self.prepared.net.transitions.len();
        match transitions.iter().find(|&&t| t as usize >= count) {
            Some(t) => Err(PyIndexError::new_err(format!("there is no transition {t} of {count}"))),
            None => Ok(()),
        }
    }

    fn search(
        &self,
        py: Python<'_>,
        goal: Goal,
        limits: (bool, bool, usize, usize),
        patience: &Patience,
    ) -> PyResult<Search> {
        let (thorough, keep_sets, markings, memory_bytes) = limits;
        let limits = Limits { thorough, markings, memory_bytes, time: patience.time, keep_sets };
        let mut raised = None;
        let found = detached(py, patience, &mut raised, |poll| {
            search::Search::run(Arc::clone(&self.prepared), goal, limits, poll)
        });
        but_ctrl_c(py, raised)?;
        match found {
            Ok(search) => Ok(Search { search }),
            Err(_) => Err(BudgetExceeded::new_err("max_memory_bytes does not hold the net itself")),
        }
    }
}

#[pymethods]
impl Stubborn {
    #[new]
    fn new(py: Python<'_>, n_places: usize, transitions: Rows, initial: Vec<u32>) -> PyResult<Self> {
        let net = py.detach(|| transitions.net(n_places, &initial)).map_err(PyValueError::new_err)?;
        Ok(Stubborn { prepared: Arc::new(Prepared::new(net)) })
    }

    #[allow(clippy::too_many_arguments)]
    #[pyo3(signature = (*, all=true, thorough=false, keep_sets=false, max_markings, max_memory_bytes, max_seconds, cancelled=None))]
    fn deadlocks(
        &self,
        py: Python<'_>,
        all: bool,
        thorough: bool,
        keep_sets: bool,
        max_markings: usize,
        max_memory_bytes: usize,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Search> {
        let patience = Patience::new(max_seconds, cancelled)?;
        self.search(py, Goal::Deadlock { all }, (thorough, keep_sets, max_markings, max_memory_bytes), &patience)
    }

    #[allow(clippy::too_many_arguments)]
    #[pyo3(signature = (nodes, *, thorough=false, keep_sets=false, max_markings, max_memory_bytes, max_seconds, cancelled=None))]
    fn reach(
        &self,
        py: Python<'_>,
        nodes: Nodes,
        thorough: bool,
        keep_sets: bool,
        max_markings: usize,
        max_memory_bytes: usize,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Search> {
        let formula = formula(nodes, self.prepared.net.places)?;
        let patience = Patience::new(max_seconds, cancelled)?;
        self.search(py, Goal::Formula(formula), (thorough, keep_sets, max_markings, max_memory_bytes), &patience)
    }

    #[allow(clippy::too_many_arguments)]
    #[pyo3(signature = (transitions, *, thorough=false, max_markings, max_memory_bytes, max_seconds, cancelled=None))]
    fn fire(
        &self,
        py: Python<'_>,
        transitions: Vec<u32>,
        thorough: bool,
        max_markings: usize,
        max_memory_bytes: usize,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Search> {
        self.existing(&transitions)?;
        let patience = Patience::new(max_seconds, cancelled)?;
        self.search(py, Goal::Firing(transitions), (thorough, false, max_markings, max_memory_bytes), &patience)
    }

    #[pyo3(signature = (nodes, *, seed, max_steps, max_seconds, cancelled=None))]
    fn walk(
        &self,
        py: Python<'_>,
        nodes: Option<Nodes>,
        seed: u64,
        max_steps: u64,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<(Option<Vec<u32>>, u64)> {
        let mut target = match nodes {
            Some(nodes) => Target::Formula(formula(nodes, self.prepared.net.places)?),
            None => Target::Deadlock,
        };
        let patience = Patience::new(max_seconds, cancelled)?;
        let deadline = patience.time.and_then(|time| Instant::now().checked_add(time));
        let mut raised = None;
        let Prepared { net, dependencies } = &*self.prepared;
        let (found, steps) = detached(py, &patience, &mut raised, |poll| {
            walk::walk(net, dependencies, &mut target, seed, max_steps, &mut Watch::new(deadline, poll))
        });
        but_ctrl_c(py, raised)?;
        Ok((found.unwrap_or(None), steps))
    }

    #[pyo3(signature = (transitions, *, seed, max_vain, max_seconds, cancelled=None))]
    fn cover(
        &self,
        py: Python<'_>,
        transitions: Vec<u32>,
        seed: u64,
        max_vain: u64,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<(Ways, Option<Vec<u32>>, u64)> {
        self.existing(&transitions)?;
        let patience = Patience::new(max_seconds, cancelled)?;
        let deadline = patience.time.and_then(|time| Instant::now().checked_add(time));
        let mut raised = None;
        let Prepared { net, dependencies } = &*self.prepared;
        let (found, _) = detached(py, &patience, &mut raised, |poll| {
            cover::cover(net, dependencies, &transitions, seed, max_vain, &mut Watch::new(deadline, poll))
        });
        but_ctrl_c(py, raised)?;
        let ways = found.ways.into_iter().map(|way| (way.from, way.firings, way.firable)).collect();
        Ok((ways, found.deadlock, found.steps))
    }
}

#[pymethods]
impl Search {
    #[getter]
    fn complete(&self) -> bool {
        self.search.stop.is_none()
    }

    #[getter]
    fn reason(&self) -> Option<&'static str> {
        self.search.stop.map(Stop::as_str)
    }

    #[getter]
    fn n_markings(&self) -> usize {
        self.search.len()
    }

    #[getter]
    fn n_edges(&self) -> u64 {
        self.search.edges
    }

    #[getter]
    fn memory_bytes(&self) -> usize {
        self.search.memory.used()
    }

    #[getter]
    fn seconds(&self) -> f64 {
        self.search.seconds
    }

    #[getter]
    fn found(&self) -> Option<u32> {
        self.search.found
    }

    fn deadlocks(&self) -> Vec<u32> {
        self.search.deadlocks.clone()
    }

    fn firable(&self) -> Vec<Option<u32>> {
        self.search.firable.iter().map(|&index| Some(index).filter(|&index| index != NONE)).collect()
    }

    fn sets(&self) -> (Vec<Vec<u32>>, Vec<u32>) {
        match &self.search.sets {
            Some(kept) => (kept.sets.iter().map(|set| set.to_vec()).collect(), kept.chosen.clone()),
            None => (Vec::new(), Vec::new()),
        }
    }

    fn marking<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyAny>> {
        mask(py, self.search.marking(self.check(index)? as usize))
    }

    fn path_to(&self, py: Python<'_>, index: usize) -> PyResult<Vec<u32>> {
        let index = self.check(index)?;
        Ok(py.detach(|| self.search.path_to(index)))
    }
}

impl Search {
    fn check(&self, index: usize) -> PyResult<u32> {
        if index < self.search.len() {
            Ok(index as u32)
        } else {
            Err(PyIndexError::new_err(format!("there is no marking {index} of {}", self.search.len())))
        }
    }
}
