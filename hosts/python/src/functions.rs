//! Functions that need no graph.

use std::path::PathBuf;

use asperity_offline::failure::Failure;
use asperity_offline::shipped;
use asperity_texture::Library;
use pyo3::prelude::*;

use crate::error::raise;

/// Version of the package and the engine.
#[pyfunction]
pub fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}

/// Materials of a library: name, family, description, pictures.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn materials(library: PathBuf) -> PyResult<Vec<(String, Option<String>, String, Vec<PathBuf>)>> {
    let path = shipped::found(library).map_err(|e| raise(&Failure::Machine(e.to_string())))?;
    let library = Library::read(&path).map_err(|e| raise(&e.into()))?;
    let material = |m: &asperity_texture::LibraryMaterial| {
        let images = m.images.iter().map(|image| library.beside(image)).collect();
        (m.name.clone(), m.family.clone(), m.description.clone(), images)
    };
    Ok(library.materials().iter().map(material).collect())
}
