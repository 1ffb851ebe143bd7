//! Functions that need no graph.

use std::path::PathBuf;

use asperity_autoregressive::TextureFile;
use asperity_autoregressive::fit::{Criterion, Order, Recording, Settings};
use asperity_diagnostics::{Diagnostic, Source, one_of};
use asperity_offline::failure::{Failure, json, wrong};
use asperity_offline::shipped;
use asperity_study::log;
use asperity_texture::Library;
use asperity_tradeoff::{Budget, Figure, Results};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
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

/// A texture of autoregressive models of a recording: the text of its file, seconds used, models, order.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn fit_ar(
    py: Python<'_>,
    force: PyReadonlyArray1<'_, f64>,
    speed: PyReadonlyArray1<'_, f64>,
    acceleration: PyReadonlyArray2<'_, f64>,
    rate: f64,
    description: String,
    order: Option<usize>,
    max_order: usize,
    model_hz: u32,
    high_pass_hz: f64,
) -> PyResult<(String, f64, usize, usize)> {
    let (force, speed) = (force.as_array().to_vec(), speed.as_array().to_vec());
    let axes: Vec<Vec<f64>> = acceleration.as_array().columns().into_iter().map(|a| a.to_vec()).collect();
    py.detach(|| {
        let recording = Recording {
            rate_hz: rate,
            force_n: &force,
            speed_mm_s: &speed,
            acceleration_m_s2: axes.iter().map(Vec::as_slice).collect(),
        };
        let by = Criterion::default();
        let order = order.map_or(Order::Best { most: max_order, by }, Order::Given);
        let settings = Settings { order, model_hz, high_pass_hz, ..Settings::default() };
        let (texture, fitted) = recording.fit(&settings)?;
        let seconds = fitted.segments.iter().map(|s| s.length_s).sum();
        let (models, order) = (texture.models().len(), fitted.order);
        let origin = format!("Fitted by asperity.fit_ar to {seconds:.1} s of a recording.");
        Ok((TextureFile { description, origin, texture }.to_ron()?, seconds, models, order))
    })
    .map_err(|e: Diagnostic| raise(&e.into()))
}

/// Events of a participant's log in a study, as JSON.
#[pyfunction]
pub fn study_log(path: PathBuf) -> PyResult<String> {
    let events = log::read(&path).map_err(Failure::from).and_then(|events| json(&events));
    events.map_err(|e| raise(&e))
}

/// Results of a trade-off: a folder, its results.json, or the shipped ones.
fn results(path: Option<PathBuf>) -> Result<Results, Failure> {
    let Some(path) = path else {
        let shipped = shipped::FILES.get_file("tradeoffs/results.json").and_then(|file| file.contents_utf8());
        return Results::parse(shipped.unwrap_or_default()).map_err(Failure::Machine);
    };
    let path = if path.is_dir() { path.join("results.json") } else { path };
    let text = Source::read(&path)?;
    Ok(Results::parse(text.text()).map_err(|e| Diagnostic::new(e).in_file(&path))?)
}

/// Rows of a trade-off as JSON.
#[pyfunction]
pub fn tradeoff(path: Option<PathBuf>) -> PyResult<String> {
    let found = results(path).and_then(|results| json(&results.rows));
    found.map_err(|e| raise(&e))
}

/// The best setting within a budget as JSON, if there is one.
#[pyfunction]
pub fn choose(
    path: Option<PathBuf>,
    budget_us: Option<f64>,
    max_lag_ms: Option<f64>,
    tick_hz: Option<u32>,
    by: Vec<String>,
    strict: bool,
) -> PyResult<Option<String>> {
    let figure = |name: &String| {
        let help = || one_of(name, Figure::all().map(Figure::name));
        Figure::from_name(name).ok_or_else(|| wrong("by", format!("there is no figure `{name}`"), help()))
    };
    let chosen = || -> Result<_, Failure> {
        let by = by.iter().map(figure).collect::<Result<_, _>>()?;
        let budget = Budget { tick_us: budget_us, lag_ms: max_lag_ms, strict, by, tick_hz };
        results(path)?.choose(&budget).map(|choice| json(&choice.json())).transpose()
    };
    chosen().map_err(|e| raise(&e))
}
