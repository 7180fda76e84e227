//! `Diagram` and `MarkingSet`: the symbolic state space, and its sets as values of Python.
//!
//! A set is a number of a node, and a node lives as long as a set of Python names it. The diagram is behind a lock, which is
//! taken only without the interpreter: whoever works in it comes back to the interpreter now and then, and would wait for
//! ever for one who holds that and waits for the lock. So a set that dies, which happens while the interpreter is held,
//! writes itself off in a list of its own.

use std::collections::HashMap;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use pyo3::exceptions::{PyIndexError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::pyclass::CompareOp;
use pyo3::types::{PyBytes, PyInt};

use super::rows::Rows;
use super::{Patience, answered, answered_by};
use crate::budget::{Stop, Watch};
use crate::net::Transition;
use crate::symbolic::algebra::Binary;
use crate::symbolic::cache::ANY;
use crate::symbolic::count::Natural;
use crate::symbolic::listing::Listing;
use crate::symbolic::space::{By, Events, Symbolic};
use crate::symbolic::zdd::{EMPTY, Node};

struct Shared {
    space: Mutex<Symbolic>,
    /// How many sets name each node.
    named: Mutex<HashMap<Node, usize>>,
    /// What ends the work in the diagram now; set anew where the same diagram is asked under other limits.
    patience: Mutex<Arc<Patience>>,
}

/// A panic elsewhere is reported there; the lock is good for as long as the process lives.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// Works in the diagram without the interpreter; the nodes in use come with it.
    fn work<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Symbolic, &[Node], &mut Watch<'_>) -> Result<T, Stop> + Send,
    ) -> PyResult<T> {
        let patience = Arc::clone(&locked(&self.patience));
        answered(py, &patience, |watch| {
            let mut space = locked(&self.space);
            let roots: Vec<Node> = locked(&self.named).keys().copied().collect();
            work(&mut space, &roots, watch)
        })
    }

    /// The same, where the work makes a set.
    fn set(
        self: &Arc<Self>,
        py: Python<'_>,
        work: impl FnOnce(&mut Symbolic, &[Node], &mut Watch<'_>) -> Result<Node, Stop> + Send,
    ) -> PyResult<MarkingSet> {
        // Named before the lock is given back: after that anybody may collect.
        let named = |node: Node| {
            *locked(&self.named).entry(node).or_insert(0) += 1;
            node
        };
        let node = self.work(py, |space, roots, watch| work(space, roots, watch).map(named))?;
        Ok(MarkingSet { shared: Arc::clone(self), node })
    }
}

/// The reachable markings of a net as a decision diagram; see the stub `_engine.pyi` for the meaning of each member.
#[pyclass(frozen, module = "firable.analysis._engine")]
pub(crate) struct Diagram {
    shared: Arc<Shared>,
    places: usize,
    transitions: usize,
    #[pyo3(get)]
    seconds: f64,
    #[pyo3(get)]
    n_nodes: usize,
}

/// A set of reachable markings; see the stub.
#[pyclass(frozen, module = "firable.analysis._engine")]
pub(crate) struct MarkingSet {
    shared: Arc<Shared>,
    node: Node,
}

impl Drop for MarkingSet {
    fn drop(&mut self) {
        let mut named = locked(&self.shared.named);
        if let Some(count) = named.get_mut(&self.node) {
            *count -= 1;
            if *count == 0 {
                named.remove(&self.node);
            }
        }
    }
}

impl MarkingSet {
    fn binary(&self, py: Python<'_>, other: &MarkingSet, binary: Binary) -> PyResult<MarkingSet> {
        if !Arc::ptr_eq(&self.shared, &other.shared) {
            return Err(PyTypeError::new_err("the two sets are of different diagrams"));
        }
        let (a, b) = (self.node, other.node);
        self.shared.set(py, |space, roots, watch| space.binary(roots, binary, a, b, watch))
    }
}

fn int<'py>(py: Python<'py>, natural: &Natural) -> PyResult<Bound<'py, PyAny>> {
    let bytes: Vec<u8> = natural.iter().flat_map(|word| word.to_le_bytes()).collect();
    py.get_type::<PyInt>().call_method1("from_bytes", (PyBytes::new(py, &bytes), "little"))
}

#[pymethods]
impl MarkingSet {
    fn __and__(&self, py: Python<'_>, other: &MarkingSet) -> PyResult<MarkingSet> {
        self.binary(py, other, Binary::Intersection)
    }

    fn __or__(&self, py: Python<'_>, other: &MarkingSet) -> PyResult<MarkingSet> {
        self.binary(py, other, Binary::Union)
    }

    fn __xor__(&self, py: Python<'_>, other: &MarkingSet) -> PyResult<MarkingSet> {
        self.binary(py, other, Binary::Symmetric)
    }

    fn __sub__(&self, py: Python<'_>, other: &MarkingSet) -> PyResult<MarkingSet> {
        self.binary(py, other, Binary::Difference)
    }

    fn __richcmp__(&self, other: &MarkingSet, op: CompareOp) -> PyResult<bool> {
        let equal = Arc::ptr_eq(&self.shared, &other.shared) && self.node == other.node;
        match op {
            CompareOp::Eq => Ok(equal),
            CompareOp::Ne => Ok(!equal),
            _ => Err(PyTypeError::new_err("sets of markings are not ordered")),
        }
    }

    fn __hash__(&self) -> u64 {
        u64::from(self.node)
    }

    fn __bool__(&self) -> bool {
        self.node != EMPTY
    }

    fn count<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let node = self.node;
        int(py, &self.shared.work(py, |space, _, watch| space.count(node, watch))?)
    }

    fn edges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let node = self.node;
        int(py, &self.shared.work(py, |space, _, watch| space.edges(node, watch))?)
    }

    fn contains(&self, py: Python<'_>, marked: Vec<u32>) -> PyResult<bool> {
        let node = self.node;
        self.shared.work(py, |space, _, _| Ok(space.contains(node, &marked)))
    }

    fn any(&self, py: Python<'_>) -> PyResult<Option<Vec<u32>>> {
        let node = self.node;
        self.shared.work(py, |space, _, _| Ok(space.any(node)))
    }
}

/// What fires in turn, the places marked after it, and whether no way is shorter.
type Path = (Vec<u32>, Vec<u32>, bool);

impl Diagram {
    fn place(&self, place: u32) -> PyResult<u32> {
        if (place as usize) < self.places {
            Ok(place)
        } else {
            Err(PyIndexError::new_err(format!("there is no place {place} of {}", self.places)))
        }
    }

    fn places(&self, places: &[u32]) -> PyResult<()> {
        places.iter().try_for_each(|&place| self.place(place).map(|_| ()))
    }

    fn tested(&self, tests: &[(Vec<u32>, Vec<u32>)]) -> PyResult<()> {
        tests.iter().try_for_each(|(full, empty)| self.places(full).and_then(|()| self.places(empty)))
    }

    fn fired<'a>(&self, mut some: impl Iterator<Item = &'a usize>) -> PyResult<()> {
        match some.find(|&&t| t >= self.transitions) {
            Some(t) => Err(PyIndexError::new_err(format!("there is no transition {t} of {}", self.transitions))),
            None => Ok(()),
        }
    }

    fn mine(&self, set: &MarkingSet) -> PyResult<Node> {
        if Arc::ptr_eq(&self.shared, &set.shared) {
            Ok(set.node)
        } else {
            Err(PyTypeError::new_err("the set is of another diagram"))
        }
    }
}

#[pymethods]
impl Diagram {
    #[getter]
    fn memory_bytes(&self, py: Python<'_>) -> PyResult<usize> {
        self.shared.work(py, |space, _, _| Ok(space.bytes()))
    }

    #[getter]
    fn order(&self, py: Python<'_>) -> PyResult<Vec<u32>> {
        self.shared.work(py, |space, _, _| Ok(space.place_at()[1..].to_vec()))
    }

    #[pyo3(signature = (*, max_seconds=None, cancelled=None))]
    fn limit(&self, max_seconds: Option<f64>, cancelled: Option<Py<PyAny>>) -> PyResult<()> {
        *locked(&self.shared.patience) = Arc::new(Patience::new(max_seconds, cancelled)?);
        Ok(())
    }

    fn reach(&self, py: Python<'_>) -> PyResult<MarkingSet> {
        self.shared.set(py, |space, _, _| Ok(space.reach))
    }

    fn initial(&self, py: Python<'_>) -> PyResult<MarkingSet> {
        self.shared.set(py, |space, _, _| Ok(space.start))
    }

    fn empty(&self, py: Python<'_>) -> PyResult<MarkingSet> {
        self.shared.set(py, |_, _, _| Ok(EMPTY))
    }

    fn single(&self, py: Python<'_>, marked: Vec<u32>) -> PyResult<MarkingSet> {
        self.places(&marked)?;
        self.shared.set(py, |space, roots, watch| {
            let one = space.single(roots, &marked)?;
            let reach = space.reach;
            space.binary(roots, Binary::Intersection, one, reach, watch)
        })
    }

    fn having(&self, py: Python<'_>, markings: &MarkingSet, full: Vec<u32>, empty: Vec<u32>) -> PyResult<MarkingSet> {
        let set = self.mine(markings)?;
        self.places(&full)?;
        self.places(&empty)?;
        self.shared.set(py, |space, roots, watch| space.having(roots, set, &full, &empty, watch))
    }

    fn greatest(&self, py: Python<'_>, markings: &MarkingSet, places: Vec<u32>) -> PyResult<Option<Vec<u32>>> {
        let set = self.mine(markings)?;
        self.places(&places)?;
        self.shared.work(py, |space, _, watch| space.greatest(set, &places, watch))
    }

    fn which(&self, py: Python<'_>, markings: &MarkingSet, tests: Vec<(Vec<u32>, Vec<u32>)>) -> PyResult<Vec<bool>> {
        let set = self.mine(markings)?;
        self.tested(&tests)?;
        self.shared.work(py, |space, roots, watch| space.which(roots, set, &tests, watch))
    }

    fn counts<'py>(
        &self,
        py: Python<'py>,
        markings: &MarkingSet,
        tests: Vec<(Vec<u32>, Vec<u32>)>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let set = self.mine(markings)?;
        self.tested(&tests)?;
        let counts = self.shared.work(py, |space, roots, watch| space.counts(roots, set, &tests, watch))?;
        counts.iter().map(|count| int(py, count)).collect()
    }

    fn firable(&self, py: Python<'_>, markings: &MarkingSet) -> PyResult<MarkingSet> {
        let set = self.mine(markings)?;
        self.shared.set(py, |space, roots, watch| space.all(roots, set, Events::Tests, watch))
    }

    fn in_contact(&self, py: Python<'_>, markings: &MarkingSet) -> PyResult<MarkingSet> {
        let set = self.mine(markings)?;
        self.shared.set(py, |space, roots, watch| space.all(roots, set, Events::Contacts, watch))
    }

    #[pyo3(signature = (targets, by=None))]
    fn before(&self, py: Python<'_>, targets: &MarkingSet, by: Option<Vec<usize>>) -> PyResult<MarkingSet> {
        let set = self.mine(targets)?;
        self.fired(by.iter().flatten())?;
        self.shared.set(py, |space, roots, watch| match by {
            None => space.before(roots, set, watch),
            Some(by) => space.before_by(roots, set, &by, watch),
        })
    }

    #[pyo3(signature = (targets, within=None, by=None))]
    fn backward(
        &self,
        py: Python<'_>,
        targets: &MarkingSet,
        within: Option<&MarkingSet>,
        by: Option<Vec<usize>>,
    ) -> PyResult<MarkingSet> {
        let set = self.mine(targets)?;
        self.fired(by.iter().flatten())?;
        let within = within.map(|within| self.mine(within)).transpose()?;
        self.shared.set(py, |space, roots, watch| {
            let within = within.unwrap_or(space.reach);
            space.backward(roots, set, within, by.as_deref(), watch)
        })
    }

    fn forward(&self, py: Python<'_>, sources: &MarkingSet) -> PyResult<MarkingSet> {
        let set = self.mine(sources)?;
        self.shared.set(py, |space, roots, watch| space.closure(roots, set, ANY, By::Forward, watch))
    }

    fn endless(&self, py: Python<'_>, within: &MarkingSet) -> PyResult<MarkingSet> {
        let set = self.mine(within)?;
        self.shared.set(py, |space, roots, watch| space.endless(roots, set, watch))
    }

    fn nodes(&self, py: Python<'_>, sets: Vec<PyRef<'_, MarkingSet>>, most: usize) -> PyResult<Option<Listing>> {
        let sets = sets.iter().map(|set| self.mine(set)).collect::<PyResult<Vec<Node>>>()?;
        self.shared.work(py, |space, _, watch| space.listed(&sets, most, watch))
    }

    fn path_to(&self, py: Python<'_>, targets: &MarkingSet) -> PyResult<Option<Path>> {
        let set = self.mine(targets)?;
        let walk = self.shared.work(py, |space, roots, watch| space.walk_to(roots, set, watch))?;
        Ok(walk.map(|walk| (walk.firings, walk.reached, walk.shortest)))
    }

    fn __repr__(&self) -> String {
        format!("<Diagram of {} places, {} nodes>", self.places, self.n_nodes)
    }
}

/// Finds the reachable markings of a net as a decision diagram.
#[pyfunction]
#[pyo3(signature = (n_places, transitions, initial, *, max_memory_bytes, max_seconds=None, threads=1, second_free=None,
                    cancelled=None, orders=None))]
#[allow(clippy::too_many_arguments)]
pub(crate) fn explore_symbolically(
    py: Python<'_>,
    n_places: usize,
    transitions: Rows,
    initial: Vec<u32>,
    max_memory_bytes: usize,
    max_seconds: Option<f64>,
    threads: usize,
    second_free: Option<Py<PyAny>>,
    cancelled: Option<Py<PyAny>>,
    orders: Option<Vec<Vec<u32>>>,
) -> PyResult<Diagram> {
    let begun = Instant::now();
    if !(1..=2).contains(&threads) {
        return Err(PyValueError::new_err(format!("1 or 2 threads search, not {threads}")));
    }
    // Until somebody has said so, it is not.
    let free = Arc::new(AtomicBool::new(second_free.is_none()));
    let patience = Patience::new(max_seconds, cancelled)?.noting(second_free, &free);
    for order in orders.iter().flatten() {
        let mut sorted = order.clone();
        sorted.sort_unstable();
        if sorted.len() != n_places || sorted.iter().enumerate().any(|(at, &place)| at != place as usize) {
            return Err(PyValueError::new_err("an order names each place once"));
        }
    }
    if orders.as_ref().is_some_and(Vec::is_empty) {
        return Err(PyValueError::new_err("there is no order to search in"));
    }
    let transitions = py.detach(|| transitions.transitions()).map_err(PyValueError::new_err)?;
    let sets = |t: &Transition| [&t.inputs, &t.outputs, &t.permissive, &t.inhibitive].map(|set| set.last().copied());
    let named = transitions.iter().flat_map(sets).flatten().chain(initial.iter().copied());
    if let Some(place) = { named }.find(|&place| place as usize >= n_places) {
        return Err(PyValueError::new_err(format!("place {place} is not one of the {n_places} places")));
    }
    let n_transitions = transitions.len();
    let second = (threads == 2).then_some(&*free);
    let space = answered_by(py, &patience, second, |watch| {
        Symbolic::explore(n_places, transitions, initial, max_memory_bytes, orders, watch)
    })?;
    let n_nodes = space.nodes;
    let shared = Arc::new(Shared {
        space: Mutex::new(space),
        named: Mutex::default(),
        patience: Mutex::new(Arc::new(patience.noting(None, &free))),
    });
    let seconds = begun.elapsed().as_secs_f64();
    Ok(Diagram { shared, places: n_places, transitions: n_transitions, seconds, n_nodes })
}
