//! Phase retrieval without a graph.

use std::path::Path;
use std::sync::Arc;

use asperity_diagnostics::Diagnostic;
use asperity_engine::NoClock;
use asperity_node::Registry;
use asperity_offline::compare::vectors::{self, Set};
use asperity_offline::compare::{contest, report};
use asperity_offline::failure::Failure;
use asperity_offline::host::warn;
use asperity_offline::kinds::Kinds;
use asperity_offline::phase::{Chain, Frames, Method, Scale, check_rate, retrievers};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::error::{Watch, raise};
use crate::node::{Kind, tell};

fn registry(kinds: &[Py<Kind>]) -> Result<Registry, Failure> {
    Kinds::new(&[]).with(kinds.iter().map(|kind| kind.get().kind()).collect()).registry(None)
}

/// A signal from magnitudes \[frames, bins\], and how often the node failed.
#[pyfunction]
pub fn invert<'py>(
    py: Python<'py>,
    magnitudes: PyReadonlyArray2<'py, f32>,
    rate: u32,
    phase: &str,
    scale: &str,
    seed: u64,
    kinds: Vec<Py<Kind>>,
) -> PyResult<(Bound<'py, PyArray1<f32>>, u64)> {
    let bins = magnitudes.as_array().ncols();
    let values: Vec<f32> = magnitudes.as_array().iter().copied().collect();
    let scale = if scale == "dft" { Scale::Dft } else { Scale::Amplitude };
    let mut watch = Watch::new(None);
    let played = py.detach(|| -> Result<_, Failure> {
        check_rate(&format!("rate={rate}"), rate)?;
        let registry = registry(&kinds)?;
        let (frames, bad) = Frames::new(values, bins, rate, scale)?;
        if bad > 0 {
            warn(&format!("{bad} magnitudes are negative or not finite and are taken as 0"));
        }
        Method::parse(phase, &registry)?.play(&registry, &Arc::new(frames), seed, &NoClock, |_| {})
    });
    watch.look(1, 1)?;
    tell(py, &kinds)?;
    let played = played.map_err(|e| raise(&e))?;
    Ok((played.signal.into_pyarray(py), played.faults))
}

/// A comparison as JSON, text, CSV and picture.
#[pyfunction]
pub fn compare(
    py: Python<'_>,
    methods: Vec<String>,
    vectors: &str,
    kinds: Vec<Py<Kind>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, String, String, String)> {
    let texts = py.detach(|| -> PyResult<_> {
        let registry = registry(&kinds).map_err(|e| raise(&e))?;
        let set = match vectors {
            "shipped" => vectors::built_in(),
            folder => vectors::read(Path::new(folder)),
        };
        let set = set.map_err(|e| raise(&e))?;
        let methods = parsed(&methods, &registry, &set).map_err(|e| raise(&e))?;
        let (mut watch, mut done, all) = (Watch::new(progress), 0, contest::steps(&methods, &set));
        let mut ended = Ok(());
        let outcome = contest::run(&registry, &methods, &set, || {
            done += 1;
            ended = watch.look(done, all);
            if ended.is_err() { Err(Failure::Said(0)) } else { Ok(()) }
        });
        ended?;
        let outcome = outcome.map_err(|e| raise(&e))?;
        let published = contest::published(&set);
        Ok((
            report::json(&set, &outcome, &published).to_string(),
            report::text(&set, &outcome, &published),
            report::csv(&set, &outcome, &published),
            report::svg(&set, &outcome, &published),
        ))
    });
    tell(py, &kinds)?;
    texts
}

/// The methods that the caller names; all that there are for none.
fn parsed(names: &[String], registry: &Registry, set: &Set) -> Result<Vec<Method>, Failure> {
    let all: Vec<String> = retrievers(registry).iter().map(|d| d.kind.to_string()).collect();
    let names = if names.is_empty() { &all } else { names };
    let mut methods: Vec<Method> = Vec::new();
    for name in names {
        let method = Method::parse(name, registry)?;
        if methods.iter().any(|m| m.label == method.label) {
            return Err(Diagnostic::new(format!("`{name}` is named twice")).into());
        }
        if !method.is_offline() {
            Chain::new(registry, &method, &set.vectors[0].frames, 1)?;
        }
        methods.push(method);
    }
    Ok(methods)
}
