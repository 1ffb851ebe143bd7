//! The compiled half of the Python package: `asperity._asperity`.
//!
//! Python code in `python/asperity` is its only user. It gives texts and arrays, and gets arrays and JSON.
//! A graph is a [`graph::Graph`]; its runs are in [`felt`] (all at once) and [`engine`] (tick by tick).
//! [`node`] lets Python code be a kind of node, and [`phase`] retrieves phase.

// Everything here is the one module; `pub` says what a file offers the others.
#![allow(unreachable_pub)]

mod accuracy;
mod engine;
mod error;
mod felt;
mod functions;
mod graph;
mod node;
mod phase;
mod values;

use asperity_offline::host::{self, Host};
use pyo3::prelude::*;

/// The module.
#[pymodule]
mod _asperity {
    use super::*;

    #[pymodule_export]
    use super::accuracy::{convergence, figures, pitch, precision};
    #[pymodule_export]
    use super::engine::Engine;
    #[pymodule_export]
    use super::error::{AsperityWarning, Error};
    #[pymodule_export]
    use super::felt::Felt;
    #[pymodule_export]
    use super::functions::{choose, fit_ar, materials, study_log, tradeoff, version};
    #[pymodule_export]
    use super::graph::Graph;
    #[pymodule_export]
    use super::node::Kind;
    #[pymodule_export]
    use super::phase::{compare, invert};

    #[pymodule_init]
    fn init(_module: &Bound<'_, PyModule>) -> PyResult<()> {
        #[cfg(feature = "tract")]
        asperity_texture::run_graphs_by(asperity_tract::compile);
        host::set(Host { warn: error::warn, ask: |_, _| false, survives: |_, _| Ok(()) });
        Ok(())
    }
}
