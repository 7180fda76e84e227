//! The explicit engine of `firable`: what Python sees of it.
//!
//! The engine explores the reachability graph of a 1-safe net with gates, under interleaving or synchronous steps, and
//! answers what needs the whole graph. It is the fast copy of the firing rule in `firable.semantics` and is held to it by
//! differential tests, never trusted by itself. All files but this one are plain Rust without `unsafe`; this one only
//! converts. Long work releases the interpreter and asks it for signals every 2^16 units of work, so Ctrl-C ends an
//! exploration with what is known so far, and a graph method with `KeyboardInterrupt`.
//!
//! Nobody can conclude from a part: a method whose answer needs the whole graph raises on an incomplete one.

#[forbid(unsafe_code)]
pub mod budget;
#[forbid(unsafe_code)]
pub mod csr;
#[forbid(unsafe_code)]
pub mod edges;
#[forbid(unsafe_code)]
pub mod explore;
#[forbid(unsafe_code)]
pub mod marking;
#[forbid(unsafe_code)]
pub mod net;
#[forbid(unsafe_code)]
pub mod paths;
#[forbid(unsafe_code)]
pub mod scc;
#[forbid(unsafe_code)]
pub mod step;
#[forbid(unsafe_code)]
pub mod table;

#[cfg(feature = "extension-module")]
#[pyo3::pymodule(name = "_engine")]
mod python {
    use std::sync::{Arc, OnceLock};
    use std::time::Duration;

    use pyo3::create_exception;
    use pyo3::exceptions::{PyIndexError, PyKeyboardInterrupt, PyRuntimeError, PyValueError};
    use pyo3::prelude::*;
    use pyo3::types::{PyBytes, PyInt};

    use crate::budget::{Memory, Stop, Watch};
    use crate::csr::Csr;
    use crate::edges::Edges;
    use crate::explore::{Limits, NONE, Space};
    use crate::net::{Net, Transition};
    use crate::scc::Scc;
    use crate::{paths, scc};

    create_exception!(
        firable.analysis._engine,
        BudgetExceeded,
        PyRuntimeError,
        "A graph method needs more memory than the graph's budget leaves."
    );
    create_exception!(
        firable.analysis._engine,
        IncompleteGraph,
        PyRuntimeError,
        "The question needs the whole reachability graph, and the exploration ended early."
    );

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("BudgetExceeded", module.py().get_type::<BudgetExceeded>())?;
        module.add("IncompleteGraph", module.py().get_type::<IncompleteGraph>())
    }

    /// Runs long work without the interpreter; `pending` keeps what a signal handler raised meanwhile.
    fn detached<T: Send>(
        py: Python<'_>,
        pending: &mut Option<PyErr>,
        work: impl FnOnce(&mut dyn FnMut() -> bool) -> T + Send,
    ) -> T {
        py.detach(|| {
            let mut poll = || {
                Python::attach(|py| match py.check_signals() {
                    Ok(()) => false,
                    Err(error) => {
                        *pending = Some(error);
                        true
                    }
                })
            };
            work(&mut poll)
        })
    }

    type Row = (Vec<u32>, Vec<u32>, Vec<u32>, Vec<u32>, Vec<(u32, bool)>);

    /// Explores the reachability graph from a marking, breadth first.
    #[pyfunction]
    #[pyo3(signature = (n_places, transitions, initial, *, step=false, max_markings, max_memory_bytes, max_seconds))]
    #[allow(clippy::too_many_arguments)]
    fn explore(
        py: Python<'_>,
        n_places: usize,
        transitions: Vec<Row>,
        initial: Vec<u32>,
        step: bool,
        max_markings: usize,
        max_memory_bytes: usize,
        max_seconds: Option<f64>,
    ) -> PyResult<Graph> {
        let time = match max_seconds {
            // Longer than a `Duration` holds is no limit.
            Some(seconds) if seconds >= 0.0 => Duration::try_from_secs_f64(seconds).ok(),
            Some(seconds) => return Err(PyValueError::new_err(format!("max_seconds is {seconds}, not a time"))),
            None => None,
        };
        let limits = Limits { step, markings: max_markings, memory_bytes: max_memory_bytes, time };
        let mut pending = None;
        let space = detached(py, &mut pending, |poll| {
            let transitions = transitions.iter().map(|(i, o, p, h, x)| Transition::new(i, o, p, h, x)).collect();
            Net::new(n_places, transitions, &initial).map(|net| Space::explore(net, limits, poll))
        })
        .map_err(PyValueError::new_err)?;
        // Ctrl-C ends the exploration with what is known; whatever else a handler raised is the caller's.
        if let Some(error) = pending.filter(|error| !error.is_instance_of::<PyKeyboardInterrupt>(py)) {
            return Err(error);
        }
        match space {
            Ok(space) => Ok(Graph { space, scc: OnceLock::new() }),
            Err(_) => Err(BudgetExceeded::new_err("max_memory_bytes does not hold the net itself")),
        }
    }

    /// A reachability graph; see the stub `_engine.pyi` for the meaning of each member.
    #[pyclass(frozen, module = "firable.analysis._engine")]
    struct Graph {
        space: Space,
        scc: OnceLock<Arc<Scc>>,
    }

    /// Strongly connected components; see the stub.
    #[pyclass(frozen, module = "firable.analysis._engine")]
    struct Components {
        scc: Arc<Scc>,
    }

    /// A set of markings from Python: indexes, or one byte for each marking.
    #[derive(FromPyObject)]
    enum Markings<'py> {
        Bitmap(Bound<'py, PyBytes>),
        Indexes(Vec<usize>),
    }

    impl Graph {
        fn long<T: Send>(
            &self,
            py: Python<'_>,
            work: impl FnOnce(&Space, &mut Watch<'_>) -> Result<T, Stop> + Send,
        ) -> PyResult<T> {
            let mut pending = None;
            let space = &self.space;
            let result = detached(py, &mut pending, |poll| work(space, &mut Watch::new(None, poll)));
            result.map_err(|stop| match (stop, pending) {
                (_, Some(error)) => error,
                (Stop::Memory, None) => BudgetExceeded::new_err("max_memory_bytes is used up"),
                (stop, None) => PyRuntimeError::new_err(stop.as_str()),
            })
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

        fn scc(&self, py: Python<'_>) -> PyResult<Arc<Scc>> {
            self.whole("strongly connected components")?;
            if let Some(scc) = self.scc.get() {
                return Ok(Arc::clone(scc));
            }
            let scc = Arc::new(self.long(py, |space, watch| Scc::new(space, None, watch))?);
            Ok(Arc::clone(self.scc.get_or_init(|| scc)))
        }
    }

    fn little_endian<'py>(py: Python<'py>, words: &[u32]) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>())
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
            self.space.memory.used() as f64 / self.space.len() as f64
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
            let bytes: Vec<u8> =
                self.space.marking(index as usize).iter().flat_map(|word| word.to_le_bytes()).collect();
            py.get_type::<PyInt>().call_method1("from_bytes", (PyBytes::new(py, &bytes), "little"))
        }

        fn markings_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
            let words = self.space.net.words;
            PyBytes::new_with(py, self.space.len() * words * 8, |bytes| {
                for (index, place) in bytes.chunks_exact_mut(words * 8).enumerate() {
                    for (to, word) in place.chunks_exact_mut(8).zip(self.space.marking(index)) {
                        to.copy_from_slice(&word.to_le_bytes());
                    }
                }
                Ok(())
            })
        }

        fn find(&self, mask: &Bound<'_, PyInt>) -> PyResult<Option<u32>> {
            if mask.lt(0)? {
                return Err(PyValueError::new_err("a marking is a mask, not a negative number"));
            }
            let words = self.space.net.words;
            if mask.call_method0("bit_length")?.extract::<usize>()? > 64 * words {
                return Ok(None);
            }
            let bytes = mask.call_method1("to_bytes", (8 * words, "little"))?;
            let bytes = bytes.cast::<PyBytes>()?;
            let marking: Vec<u64> =
                bytes.as_bytes().as_chunks::<8>().0.iter().map(|&word| u64::from_le_bytes(word)).collect();
            Ok(self.space.find(&marking))
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

        fn successors(&self, py: Python<'_>, index: usize) -> PyResult<Vec<(Vec<u32>, u32)>> {
            let index = self.check(index)?;
            self.long(py, |space, watch| {
                let memory = Memory::new(paths::WITNESS_BYTES);
                let mut all = Vec::new();
                Edges::new(space).visit(&[index], &memory, watch, &mut |_, fired, target| {
                    memory.push(&mut all, (fired.transitions(), target))
                })?;
                Ok(all)
            })
        }

        fn path_to(&self, py: Python<'_>, index: usize) -> PyResult<Vec<Vec<u32>>> {
            let index = self.check(index)?;
            self.long(py, |space, watch| paths::path_to(space, index, watch))
        }

        #[pyo3(signature = (index, targets, within=None))]
        fn path_between(
            &self,
            py: Python<'_>,
            index: usize,
            targets: Markings<'_>,
            within: Option<Markings<'_>>,
        ) -> PyResult<Option<(Vec<Vec<u32>>, u32)>> {
            let index = self.check(index)?;
            let targets = self.bitmap(targets)?;
            let within = within.map(|within| self.bitmap(within)).transpose()?;
            let found =
                self.long(py, |space, watch| paths::path_between(space, index, &targets, within.as_deref(), watch))?;
            if found.is_none() {
                self.whole("that there is no path")?;
            }
            Ok(found)
        }

        #[pyo3(signature = (targets, within=None))]
        fn backward<'py>(
            &self,
            py: Python<'py>,
            targets: Markings<'_>,
            within: Option<Markings<'_>>,
        ) -> PyResult<Bound<'py, PyBytes>> {
            self.whole("backward reach")?;
            let targets = self.bitmap(targets)?;
            let within = within.map(|within| self.bitmap(within)).transpose()?;
            let reach = self.long(py, |space, watch| paths::backward(space, &targets, within.as_deref(), watch))?;
            Ok(PyBytes::new(py, &reach))
        }

        #[pyo3(signature = (within=None))]
        fn components(&self, py: Python<'_>, within: Option<Markings<'_>>) -> PyResult<Components> {
            let Some(within) = within else { return Ok(Components { scc: self.scc(py)? }) };
            self.whole("strongly connected components")?;
            let within = self.bitmap(within)?;
            let scc = self.long(py, |space, watch| Scc::new(space, Some(&within), watch))?;
            Ok(Components { scc: Arc::new(scc) })
        }

        fn edges<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyBytes>, Bound<'py, PyBytes>)> {
            self.whole("the list of edges")?;
            let csr = self.long(py, |space, watch| Csr::new(space, None, &space.memory.clone(), watch))?;
            let offsets: Vec<u8> = csr.offsets.iter().flat_map(|offset| offset.to_le_bytes()).collect();
            Ok((PyBytes::new(py, &offsets), little_endian(py, &csr.targets)))
        }

        fn live(&self, py: Python<'_>) -> PyResult<Vec<bool>> {
            let components = self.scc(py)?;
            self.long(py, |space, watch| scc::live(space, &components, watch))
        }

        fn reversible(&self, py: Python<'_>) -> PyResult<bool> {
            Ok(self.scc(py)?.sizes.len() == 1)
        }

        fn home_markings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
            let components = self.scc(py)?;
            let home = components.bottom.iter().filter(|&&bottom| bottom != 0).count() == 1;
            let markings: Vec<u8> =
                components.of.iter().map(|&of| if home { components.bottom[of as usize] } else { 0 }).collect();
            Ok(PyBytes::new(py, &markings))
        }

        fn effective_conflicts(&self, py: Python<'_>, pairs: Vec<(usize, usize)>) -> PyResult<Vec<Option<u32>>> {
            for &(t, u) in &pairs {
                self.check_transition(t)?;
                self.check_transition(u)?;
            }
            let found = self.long(py, |space, watch| space.firable_together(&pairs, watch))?;
            if found.contains(&None) {
                self.whole("that two transitions are never firable together")?;
            }
            Ok(found)
        }
    }

    #[pymethods]
    impl Components {
        fn __len__(&self) -> usize {
            self.scc.sizes.len()
        }

        fn of<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
            little_endian(py, &self.scc.of)
        }

        fn sizes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
            little_endian(py, &self.scc.sizes)
        }

        fn bottom<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
            PyBytes::new(py, &self.scc.bottom)
        }

        fn trivial<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
            PyBytes::new(py, &self.scc.trivial)
        }
    }
}
