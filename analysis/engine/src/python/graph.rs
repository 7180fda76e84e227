//! `Graph`: a reachability graph, its figures, and the questions that are asked of it.

use std::sync::OnceLock;

use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyInt};

use super::{IncompleteGraph, Patience, answered, little_endian, marking_of, mask};
use crate::bottoms::Bottoms;
use crate::budget::{Memory, Stop, Watch};
use crate::csr::Csr;
use crate::edges::Edges;
use crate::explore::Space;
use crate::fairness::Fairness;
use crate::fixpoints::Against;
use crate::table::NONE;
use crate::{fairness, fixpoints, paths};

/// A reachability graph; see the stub `_engine.pyi` for the meaning of each member.
#[pyclass(frozen, module = "firable.analysis._engine")]
pub(crate) struct Graph {
    space: Space,
    bottoms: OnceLock<Bottoms>,
    against: Against,
    /// Bytes held when the exploration ended.
    explored_bytes: usize,
}

/// A set of markings from Python: indexes, or one byte for each marking.
#[derive(FromPyObject)]
enum Markings<'py> {
    Bitmap(Bound<'py, PyBytes>),
    Indexes(Vec<usize>),
}

impl Graph {
    pub(crate) fn new(space: Space) -> Self {
        let explored_bytes = space.memory.used();
        Graph { space, bottoms: OnceLock::new(), against: Against::default(), explored_bytes }
    }

    fn long<T: Send>(
        &self,
        py: Python<'_>,
        patience: &Patience,
        work: impl FnOnce(&Space, &mut Watch<'_>) -> Result<T, Stop> + Send,
    ) -> PyResult<T> {
        let space = &self.space;
        answered(py, patience, |watch| work(space, watch))
    }

    fn whole(&self, what: &str) -> PyResult<()> {
        match self.space.stop {
            None => Ok(()),
            Some(stop) => Err(IncompleteGraph::new_err(format!(
                "{what} needs the whole graph, and the exploration ended early: {}",
                stop.as_str()
            ))),
        }
    }

    fn check(&self, index: usize) -> PyResult<u32> {
        if index < self.space.len() {
            Ok(index as u32)
        } else {
            Err(PyIndexError::new_err(format!("there is no marking {index} of {}", self.space.len())))
        }
    }

    fn check_transition(&self, t: usize) -> PyResult<usize> {
        let count = self.space.net.transitions.len();
        if t < count { Ok(t) } else { Err(PyIndexError::new_err(format!("there is no transition {t} of {count}"))) }
    }

    fn check_transitions(&self, some: Vec<usize>) -> PyResult<Vec<u32>> {
        some.into_iter().map(|t| Ok(self.check_transition(t)? as u32)).collect()
    }

    fn bitmap(&self, markings: Markings<'_>) -> PyResult<Vec<u8>> {
        match markings {
            Markings::Bitmap(bytes) if bytes.as_bytes().len() == self.space.len() => Ok(bytes.as_bytes().to_vec()),
            Markings::Bitmap(bytes) => Err(PyValueError::new_err(format!(
                "a bitmap has one byte for each of the {} markings, not {}",
                self.space.len(),
                bytes.as_bytes().len()
            ))),
            Markings::Indexes(indexes) => {
                let mut bitmap = vec![0; self.space.len()];
                for index in indexes {
                    bitmap[self.check(index)? as usize] = 1;
                }
                Ok(bitmap)
            }
        }
    }

    fn bottoms(&self, py: Python<'_>, patience: &Patience) -> PyResult<&Bottoms> {
        self.whole("what holds of all runs")?;
        if let Some(bottoms) = self.bottoms.get() {
            return Ok(bottoms);
        }
        let bottoms = self.long(py, patience, Bottoms::new)?;
        Ok(self.bottoms.get_or_init(|| bottoms))
    }
}

#[pymethods]
impl Graph {
    #[getter]
    fn complete(&self) -> bool {
        self.space.stop.is_none()
    }

    #[getter]
    fn reason(&self) -> Option<&'static str> {
        self.space.stop.map(Stop::as_str)
    }

    #[getter]
    fn step(&self) -> bool {
        self.space.step
    }

    #[getter]
    fn n_markings(&self) -> usize {
        self.space.len()
    }

    #[getter]
    fn n_edges(&self) -> u64 {
        self.space.edges
    }

    #[getter]
    fn words(&self) -> usize {
        self.space.net.words
    }

    #[getter]
    fn memory_bytes(&self) -> usize {
        self.space.memory.used()
    }

    #[getter]
    fn bytes_per_marking(&self) -> f64 {
        self.explored_bytes as f64 / self.space.len() as f64
    }

    #[getter]
    fn seconds(&self) -> f64 {
        self.space.seconds
    }

    #[getter]
    fn n_levels(&self) -> usize {
        self.space.levels.len()
    }

    fn __len__(&self) -> usize {
        self.space.len()
    }

    fn __repr__(&self) -> String {
        let Space { edges, step, stop, .. } = &self.space;
        let discipline = if *step { "step" } else { "interleaving" };
        let end = stop.map_or(String::new(), |stop| format!(", incomplete: {}", stop.as_str()));
        format!("<Graph {discipline}, {} markings, {edges} edges{end}>", self.space.len())
    }

    fn marking<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyAny>> {
        let index = self.check(index)?;
        mask(py, self.space.marking(index as usize))
    }

    fn markings_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let words = self.space.net.words;
        little_endian(py, &self.space.table.store.all()[..self.space.len() * words], u64::to_le_bytes)
    }

    fn find(&self, mask: &Bound<'_, PyInt>) -> PyResult<Option<u32>> {
        Ok(marking_of(mask, self.space.net.words)?.and_then(|marking| self.space.find(&marking)))
    }

    fn fired(&self) -> Vec<u64> {
        self.space.fired.clone()
    }

    fn deadlocks(&self) -> Vec<u32> {
        self.space.deadlocks.clone()
    }

    fn contacts(&self) -> Vec<u64> {
        self.space.contacts.clone()
    }

    fn contact_witness(&self, t: usize) -> PyResult<Option<u32>> {
        Ok(Some(self.space.contact_witness[self.check_transition(t)?]).filter(|&index| index != NONE))
    }

    #[pyo3(signature = (index, *, max_seconds=None, cancelled=None))]
    fn successors(
        &self,
        py: Python<'_>,
        index: usize,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Vec<(Vec<u32>, u32)>> {
        let patience = Patience::new(max_seconds, cancelled)?;
        let index = self.check(index)?;
        self.long(py, &patience, |space, watch| {
            let memory = Memory::new(paths::WITNESS_BYTES);
            let mut all = Vec::new();
            Edges::new(space).visit(&[index], &memory, watch, &mut |_, fired, target| {
                memory.push(&mut all, (fired.transitions(), target))
            })?;
            Ok(all)
        })
    }

    #[pyo3(signature = (index, *, max_seconds=None, cancelled=None))]
    fn path_to(
        &self,
        py: Python<'_>,
        index: usize,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Vec<Vec<u32>>> {
        let patience = Patience::new(max_seconds, cancelled)?;
        let index = self.check(index)?;
        self.long(py, &patience, |space, watch| paths::path_to(space, index, watch))
    }

    #[pyo3(signature = (index, targets, within=None, *, max_seconds=None, cancelled=None))]
    fn path_between(
        &self,
        py: Python<'_>,
        index: usize,
        targets: Markings<'_>,
        within: Option<Markings<'_>>,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Option<(Vec<Vec<u32>>, u32)>> {
        let patience = Patience::new(max_seconds, cancelled)?;
        let index = self.check(index)?;
        let targets = self.bitmap(targets)?;
        let within = within.map(|within| self.bitmap(within)).transpose()?;
        let found = self.long(py, &patience, |space, watch| {
            paths::path_between(space, index, &targets, within.as_deref(), watch)
        })?;
        if found.is_none() {
            self.whole("that there is no path")?;
        }
        Ok(found)
    }

    #[pyo3(signature = (questions, *, max_seconds=None, cancelled=None))]
    fn expect(
        &self,
        py: Python<'_>,
        questions: u64,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<()> {
        let patience = Patience::new(max_seconds, cancelled)?;
        self.whole("to get ready for questions")?;
        self.long(py, &patience, |space, watch| self.against.expect(questions, space, watch))
    }

    #[pyo3(signature = (targets, within=None, by=None, *, max_seconds=None, cancelled=None))]
    fn backward<'py>(
        &self,
        py: Python<'py>,
        targets: Markings<'_>,
        within: Option<Markings<'_>>,
        by: Option<Vec<usize>>,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let patience = Patience::new(max_seconds, cancelled)?;
        self.whole("backward reach")?;
        let targets = self.bitmap(targets)?;
        let within = within.map(|within| self.bitmap(within)).transpose()?;
        let by = by.map(|by| self.check_transitions(by)).transpose()?;
        let is_one = self.bottoms.get().is_some_and(|bottoms| bottoms.reversible);
        if is_one && within.is_none() && by.is_none() && targets.iter().any(|&target| target != 0) {
            return Ok(PyBytes::new(py, &vec![1; targets.len()]));
        }
        let reach = self.long(py, &patience, |space, watch| {
            fixpoints::backward(space, &targets, within.as_deref(), by.as_deref(), &self.against, watch)
        })?;
        Ok(PyBytes::new(py, &reach))
    }

    #[pyo3(signature = (sources, *, max_seconds=None, cancelled=None))]
    fn forward<'py>(
        &self,
        py: Python<'py>,
        sources: Markings<'_>,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let patience = Patience::new(max_seconds, cancelled)?;
        self.whole("forward reach")?;
        let sources = self.bitmap(sources)?;
        let reach = self.long(py, &patience, |space, watch| fixpoints::forward(space, &sources, watch))?;
        Ok(PyBytes::new(py, &reach))
    }

    #[pyo3(signature = (within, fairness, *, max_seconds=None, cancelled=None))]
    fn fair<'py>(
        &self,
        py: Python<'py>,
        within: Markings<'_>,
        fairness: &str,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let patience = Patience::new(max_seconds, cancelled)?;
        let fairness = Fairness::named(fairness)
            .ok_or_else(|| PyValueError::new_err(format!("fairness is none, weak or strong, not '{fairness}'")))?;
        self.whole("that a fair run can go on for ever")?;
        let within = self.bitmap(within)?;
        let of = self.long(py, &patience, |space, watch| fairness::fair(space, within, fairness, watch))?;
        little_endian(py, &of, u32::to_le_bytes)
    }

    #[pyo3(signature = (*, max_seconds=None, cancelled=None))]
    fn edges<'py>(
        &self,
        py: Python<'py>,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<(Bound<'py, PyBytes>, Bound<'py, PyBytes>)> {
        let patience = Patience::new(max_seconds, cancelled)?;
        self.whole("the list of edges")?;
        let csr = self.long(py, &patience, |space, watch| Csr::new(space, None, &space.memory.clone(), watch))?;
        Ok((
            little_endian(py, &csr.offsets, u64::to_le_bytes)?,
            little_endian(py, csr.targets.all(), u32::to_le_bytes)?,
        ))
    }

    #[pyo3(signature = (*, max_seconds=None, cancelled=None))]
    fn live(&self, py: Python<'_>, max_seconds: Option<f64>, cancelled: Option<Py<PyAny>>) -> PyResult<Vec<bool>> {
        Ok(self.bottoms(py, &Patience::new(max_seconds, cancelled)?)?.live.clone())
    }

    #[pyo3(signature = (*, max_seconds=None, cancelled=None))]
    fn reversible(&self, py: Python<'_>, max_seconds: Option<f64>, cancelled: Option<Py<PyAny>>) -> PyResult<bool> {
        Ok(self.bottoms(py, &Patience::new(max_seconds, cancelled)?)?.reversible)
    }

    #[pyo3(signature = (*, max_seconds=None, cancelled=None))]
    fn home_markings<'py>(
        &self,
        py: Python<'py>,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let bottoms = self.bottoms(py, &Patience::new(max_seconds, cancelled)?)?;
        if bottoms.reversible || !bottoms.only {
            return Ok(PyBytes::new(py, &vec![u8::from(bottoms.only); self.space.len()]));
        }
        Ok(PyBytes::new(py, &bottoms.nearest))
    }

    #[pyo3(signature = (*, max_seconds=None, cancelled=None))]
    fn bottom<'py>(
        &self,
        py: Python<'py>,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let bottoms = self.bottoms(py, &Patience::new(max_seconds, cancelled)?)?;
        if bottoms.reversible {
            return Ok(PyBytes::new(py, &vec![1; self.space.len()]));
        }
        Ok(PyBytes::new(py, &bottoms.nearest))
    }

    #[pyo3(signature = (targets, by=None, *, max_seconds=None, cancelled=None))]
    fn before<'py>(
        &self,
        py: Python<'py>,
        targets: Markings<'_>,
        by: Option<Vec<usize>>,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let patience = Patience::new(max_seconds, cancelled)?;
        self.whole("what leads to a set of markings")?;
        let targets = self.bitmap(targets)?;
        let by = by.map(|by| self.check_transitions(by)).transpose()?;
        let found = self.long(py, &patience, |space, watch| {
            fixpoints::before(space, &targets, by.as_deref(), &self.against, watch)
        })?;
        Ok(PyBytes::new(py, &found))
    }

    #[pyo3(signature = (within=None, *, max_seconds=None, cancelled=None))]
    fn endless<'py>(
        &self,
        py: Python<'py>,
        within: Option<Markings<'_>>,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let patience = Patience::new(max_seconds, cancelled)?;
        self.whole("that a run can go on for ever")?;
        let within = within.map(|within| self.bitmap(within)).transpose()?;
        let found = self
            .long(py, &patience, |space, watch| fixpoints::endless(space, within.as_deref(), &self.against, watch))?;
        Ok(PyBytes::new(py, &found))
    }

    #[pyo3(signature = (pairs, *, max_seconds=None, cancelled=None))]
    fn effective_conflicts(
        &self,
        py: Python<'_>,
        pairs: Vec<(usize, usize)>,
        max_seconds: Option<f64>,
        cancelled: Option<Py<PyAny>>,
    ) -> PyResult<Vec<Option<u32>>> {
        let patience = Patience::new(max_seconds, cancelled)?;
        for &(t, u) in &pairs {
            self.check_transition(t)?;
            self.check_transition(u)?;
        }
        self.long(py, &patience, |space, watch| space.firable_together(&pairs, watch))
    }
}
