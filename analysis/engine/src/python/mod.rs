//! What every file of the binding shares: exceptions, long work, and the forms in which Python gives nets and markings.
//!
//! A file of the binding only converts. Long work releases the interpreter and comes back to it some twenty times a
//! second, at first more often (`Watch`): for signals, so that Ctrl-C ends it; for the caller's `cancelled`, so that a
//! method that lost a race ends; and to tell `progress` how far it is. An exploration that is stopped hands
//! out what it knows; any other work raises, `KeyboardInterrupt` or what a handler raised where a signal came, else
//! `BudgetExceeded`.

pub(crate) mod compact;
pub(crate) mod diagram;
pub(crate) mod explore;
pub(crate) mod graph;
pub(crate) mod lasso;
pub(crate) mod local;
pub(crate) mod pairs;
pub(crate) mod rows;
pub(crate) mod stubborn;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use bytemuck::Pod;
use pyo3::create_exception;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyInt};

use crate::budget::{Found, Stop, Watch};

create_exception!(
    firable.analysis._engine,
    BudgetExceeded,
    PyRuntimeError,
    "The answer needs more memory or time than is allowed, or was cancelled."
);
create_exception!(
    firable.analysis._engine,
    IncompleteGraph,
    PyRuntimeError,
    "The question needs the whole reachability graph, and the exploration ended early."
);

/// What ends long work early, as the arguments of a Python function name it.
pub(crate) struct Patience {
    /// The time that is left; none is no limit.
    pub(crate) time: Option<Duration>,
    deadline: Option<Instant>,
    cancelled: Option<Py<PyAny>>,
    progress: Option<Py<PyAny>>,
    /// Whether a second processor is free, and what is kept of the answer.
    free: Option<(Py<PyAny>, Arc<AtomicBool>)>,
}

impl Patience {
    /// `max_seconds` and `cancelled`, a callable that says whether the answer is no longer needed.
    pub(crate) fn new(max_seconds: Option<f64>, cancelled: Option<Py<PyAny>>) -> PyResult<Self> {
        let time = match max_seconds {
            // Longer than a `Duration` holds is no limit.
            Some(seconds) if seconds >= 0.0 => Duration::try_from_secs_f64(seconds).ok(),
            Some(seconds) => return Err(PyValueError::new_err(format!("max_seconds is {seconds}, not a time"))),
            None => None,
        };
        let deadline = time.and_then(|time| Instant::now().checked_add(time));
        Ok(Patience { time, deadline, cancelled, progress: None, free: None })
    }

    /// The same, and a callable that is told how many markings and edges were found.
    pub(crate) fn telling(self, progress: Option<Py<PyAny>>) -> Self {
        Patience { progress, ..self }
    }

    /// The same, and a callable that is asked whether a second processor is free; the answer is kept.
    pub(crate) fn noting(self, free: Option<Py<PyAny>>, kept: &Arc<AtomicBool>) -> Self {
        Patience { free: free.map(|free| (free, Arc::clone(kept))), ..self }
    }

    fn ask(&self, py: Python<'_>, found: Found) -> PyResult<bool> {
        py.check_signals()?;
        if let Some(progress) = &self.progress {
            progress.call1(py, (found.markings, found.edges))?;
        }
        if let Some((free, kept)) = &self.free {
            kept.store(free.bind(py).call0()?.is_truthy()?, Ordering::Relaxed);
        }
        match &self.cancelled {
            Some(cancelled) => cancelled.bind(py).call0()?.is_truthy(),
            None => Ok(false),
        }
    }
}

/// Runs long work without the interpreter; `raised` keeps what a signal handler or a callable raised meanwhile.
pub(crate) fn detached<T: Send>(
    py: Python<'_>,
    patience: &Patience,
    raised: &mut Option<PyErr>,
    work: impl FnOnce(&mut dyn FnMut(Found) -> Result<(), Stop>) -> T + Send,
) -> T {
    py.detach(|| {
        let mut poll = |found| {
            Python::attach(|py| match patience.ask(py, found) {
                Ok(false) => Ok(()),
                Ok(true) => Err(Stop::Cancelled),
                Err(error) => {
                    *raised = Some(error);
                    Err(Stop::Interrupted)
                }
            })
        };
        work(&mut poll)
    })
}

/// Runs long work that either answers or raises.
pub(crate) fn answered<T: Send>(
    py: Python<'_>,
    patience: &Patience,
    work: impl FnOnce(&mut Watch<'_>) -> Result<T, Stop> + Send,
) -> PyResult<T> {
    answered_by(py, patience, None, work)
}

/// The same for work that a second thread may share while a processor is free for it.
pub(crate) fn answered_by<T: Send>(
    py: Python<'_>,
    patience: &Patience,
    second: Option<&AtomicBool>,
    work: impl FnOnce(&mut Watch<'_>) -> Result<T, Stop> + Send,
) -> PyResult<T> {
    let mut raised = None;
    let result =
        detached(py, patience, &mut raised, |poll| work(&mut Watch::new(patience.deadline, poll).with_second(second)));
    result.map_err(|stop| match (stop, raised) {
        (_, Some(error)) => error,
        (stop, None) => BudgetExceeded::new_err(match stop {
            Stop::Memory => "the budget of memory is used up",
            Stop::Time => "the time was over",
            Stop::Cancelled => "cancelled",
            other => other.as_str(),
        }),
    })
}

/// What a handler raised, unless it is Ctrl-C, which ends an exploration with what is known.
pub(crate) fn but_ctrl_c(py: Python<'_>, raised: Option<PyErr>) -> PyResult<()> {
    raised.filter(|error| !error.is_instance_of::<PyKeyboardInterrupt>(py)).map_or(Ok(()), Err)
}

/// A marking as Python writes it: a mask over the places.
pub(crate) fn mask<'py>(py: Python<'py>, marking: &[u64]) -> PyResult<Bound<'py, PyAny>> {
    let bytes: Vec<u8> = marking.iter().flat_map(|word| word.to_le_bytes()).collect();
    py.get_type::<PyInt>().call_method1("from_bytes", (PyBytes::new(py, &bytes), "little"))
}

/// The marking of a mask; none where it does not fit so many words.
pub(crate) fn marking_of(mask: &Bound<'_, PyInt>, words: usize) -> PyResult<Option<Vec<u64>>> {
    if mask.lt(0)? {
        return Err(PyValueError::new_err("a marking is a mask, not a negative number"));
    }
    if mask.call_method0("bit_length")?.extract::<usize>()? > 64 * words {
        return Ok(None);
    }
    let bytes = mask.call_method1("to_bytes", (8 * words, "little"))?;
    let bytes = bytes.cast::<PyBytes>()?;
    Ok(Some(bytes.as_bytes().as_chunks::<8>().0.iter().map(|&word| u64::from_le_bytes(word)).collect()))
}

/// Numbers end to end, for `numpy.frombuffer`: each as its little-endian bytes.
pub(crate) fn little_endian<'py, T: Pod, const BYTES: usize>(
    py: Python<'py>,
    numbers: &[T],
    to_bytes: impl Fn(T) -> [u8; BYTES],
) -> PyResult<Bound<'py, PyBytes>> {
    // As they stand: `new_with` fills the bytes with zeros first, which for many edges takes longer than to find them.
    if cfg!(target_endian = "little") {
        return Ok(PyBytes::new(py, bytemuck::cast_slice(numbers)));
    }
    PyBytes::new_with(py, BYTES * numbers.len(), |bytes| {
        for (to, &number) in bytes.as_chunks_mut().0.iter_mut().zip(numbers) {
            *to = to_bytes(number);
        }
        Ok(())
    })
}
