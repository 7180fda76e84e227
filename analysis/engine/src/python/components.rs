//! `Components`: strongly connected components as columns.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::little_endian;
use crate::scc::Scc;

/// Strongly connected components; see the stub.
#[pyclass(frozen, module = "firable.analysis._engine")]
pub(crate) struct Components {
    pub(crate) scc: Arc<Scc>,
}

#[pymethods]
impl Components {
    fn __len__(&self) -> usize {
        self.scc.sizes.len()
    }

    fn of<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        little_endian(py, &self.scc.of, u32::to_le_bytes)
    }

    fn sizes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        little_endian(py, &self.scc.sizes, u32::to_le_bytes)
    }

    fn bottom<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.scc.bottom)
    }

    fn trivial<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.scc.trivial)
    }
}
