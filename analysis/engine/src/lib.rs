//! The engine of `firable`, and what Python sees of it.
//!
//! It explores the reachability graph of a 1-safe net with gates, under interleaving or synchronous steps, and answers
//! what needs the whole graph; it holds markings in decision diagrams, and searches by stubborn sets, for lassos of LTL,
//! for CTL as far as a marking needs, and without a graph (`compact`). It is the fast copy of the firing rule in
//! `firable.semantics` and is held to it by differential tests, never trusted by itself. All files are plain Rust
//! without `unsafe`, but for what the macros of the binding in `python/` write, and one instruction in `ahead.rs`.
//!
//! Nobody can conclude from a part: a method whose answer needs the whole graph raises on an incomplete one.

mod ahead;
#[forbid(unsafe_code)]
mod apart;
#[forbid(unsafe_code)]
pub mod batch;
#[forbid(unsafe_code)]
pub mod bits;
#[forbid(unsafe_code)]
pub mod bottoms;
#[forbid(unsafe_code)]
pub mod budget;
#[forbid(unsafe_code)]
pub mod compact;
#[forbid(unsafe_code)]
pub mod concurrency;
#[forbid(unsafe_code)]
pub mod condensed;
#[forbid(unsafe_code)]
pub mod csr;
#[forbid(unsafe_code)]
pub mod edges;
#[forbid(unsafe_code)]
pub mod exact;
#[forbid(unsafe_code)]
pub mod explore;
#[forbid(unsafe_code)]
pub mod fairness;
#[forbid(unsafe_code)]
pub mod fan;
#[forbid(unsafe_code)]
pub mod fixpoints;
#[forbid(unsafe_code)]
pub mod indexes;
#[forbid(unsafe_code)]
pub mod known;
#[forbid(unsafe_code)]
pub mod lasso;
#[forbid(unsafe_code)]
pub mod local;
#[forbid(unsafe_code)]
pub mod marking;
#[forbid(unsafe_code)]
pub mod net;
#[forbid(unsafe_code)]
mod pair;
#[forbid(unsafe_code)]
pub mod paths;
#[forbid(unsafe_code)]
mod random;
#[forbid(unsafe_code)]
pub mod region;
#[cfg(test)]
pub(crate) mod samples;
#[forbid(unsafe_code)]
pub mod scc;
#[forbid(unsafe_code)]
pub mod seat;
#[forbid(unsafe_code)]
mod sleep;
#[forbid(unsafe_code)]
pub mod span;
#[forbid(unsafe_code)]
mod spread;
#[forbid(unsafe_code)]
pub mod step;
#[forbid(unsafe_code)]
pub mod store;
#[forbid(unsafe_code)]
pub mod stubborn;
#[forbid(unsafe_code)]
pub mod symbolic;
#[forbid(unsafe_code)]
pub mod table;
#[forbid(unsafe_code)]
pub mod together;

#[cfg(feature = "extension-module")]
mod python;

/// The extension module: a line for each function and class that a file exports.
#[cfg(feature = "extension-module")]
#[pyo3::pymodule(name = "_engine")]
mod extension {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::python::compact::{Compact, explore_compactly};
    #[pymodule_export]
    use crate::python::diagram::Diagram;
    #[pymodule_export]
    use crate::python::diagram::MarkingSet;
    #[pymodule_export]
    use crate::python::diagram::explore_symbolically;
    #[pymodule_export]
    use crate::python::explore::explore;
    #[pymodule_export]
    use crate::python::graph::Graph;
    #[pymodule_export]
    use crate::python::lasso::{Lasso, find_lasso};
    #[pymodule_export]
    use crate::python::local::{Local, evaluate_locally};
    #[pymodule_export]
    use crate::python::pairs::pairs_together;
    #[pymodule_export]
    use crate::python::rows::flat;
    #[pymodule_export]
    use crate::python::stubborn::{Search, Stubborn};
    use crate::python::{BudgetExceeded, IncompleteGraph};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("BudgetExceeded", module.py().get_type::<BudgetExceeded>())?;
        module.add("IncompleteGraph", module.py().get_type::<IncompleteGraph>())
    }
}
