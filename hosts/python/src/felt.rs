//! A render: its loop and its result.

use std::sync::Mutex;

use asperity_engine::{Engine, Options};
use asperity_graph::GraphFile;
use asperity_node::{Fact, Registry};
use asperity_offline::lag::Lag;
use asperity_offline::load::Request;
use asperity_offline::render::{self, Level, Timed, channels, interleaved};
use numpy::{IntoPyArray, PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use serde_json::{Value, json};

use crate::engine::find;
use crate::graph::Ready;
use crate::values::Values;

/// A render that runs.
pub struct Run {
    ended: Ended,
    channels: Vec<usize>,
    audio: Vec<f32>,
    probes: Vec<Values>,
}

/// All that a report needs.
struct Ended {
    request: Request,
    graph: GraphFile,
    registry: Registry,
    engine: Engine,
    timed: Timed,
    level: Level,
    facts: Vec<Vec<Fact>>,
    options: Value,
    asked: u64,
    elapsed_s: f64,
    /// The report, once it is made: the response lag takes longer than the render.
    report: Option<String>,
}

impl Run {
    pub fn new(ready: Ready, asked: u64, sleep: bool, seconds: Option<f64>, names: &[String]) -> Self {
        let Ready { request, graph, registry, compiled, probes } = ready;
        let options = json!({
            "seconds": seconds, "probes": names, "no_sleep": !sleep, "limit_us": null, "watch": false,
            "no_prune": request.no_prune, "format": "f32",
        });
        let (channels, level) = (channels(&compiled.schedule), Level::new(&compiled.schedule));
        let engine = Engine::new(compiled, Options { sleep, ..Options::default() });
        let timed = Timed::new(&engine);
        let ended = Ended {
            request,
            graph,
            registry,
            engine,
            timed,
            level,
            facts: Vec::new(),
            options,
            asked,
            elapsed_s: 0.0,
            report: None,
        };
        Self { ended, channels, audio: Vec::new(), probes }
    }

    /// Ticks that have run.
    pub fn done(&self) -> u64 {
        self.ended.engine.next_tick()
    }

    pub fn tick(&mut self) {
        let Ended { engine, timed, level, .. } = &mut self.ended;
        let tick = engine.next_tick();
        timed.tick(engine);
        level.take(engine);
        self.audio.extend(interleaved(engine, &self.channels));
        self.probes.iter_mut().for_each(|probe| probe.take(engine, tick));
    }

    pub fn end(self) -> Felt {
        let Self { mut ended, channels, audio, probes } = self;
        ended.elapsed_s = ended.timed.clock.0.elapsed().as_secs_f64();
        ended.facts = (0..ended.engine.schedule().nodes.len()).map(|i| ended.engine.facts(i)).collect();
        let rate = ended.engine.schedule().audio_hz;
        let faults = ended.engine.faults();
        Felt { rate, channels: channels.len(), audio: Some(audio), probes, faults, ended: Mutex::new(ended) }
    }
}

/// A render that has ended.
#[pyclass(module = "asperity._asperity")]
pub struct Felt {
    #[pyo3(get)]
    rate: u32,
    channels: usize,
    /// Samples, until Python has them.
    audio: Option<Vec<f32>>,
    probes: Vec<Values>,
    /// Failures of nodes.
    #[pyo3(get)]
    faults: u64,
    ended: Mutex<Ended>,
}

#[pymethods]
impl Felt {
    /// Hands the samples over, once: \[n\], or \[n, channels\].
    fn take_audio<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let audio = self.audio.take().unwrap_or_default();
        let rows = audio.len() / self.channels.max(1);
        let array: Bound<'py, PyArray1<f32>> = audio.into_pyarray(py);
        match self.channels {
            0 | 1 => Ok(array.into_any()),
            channels => Ok(array.reshape([rows, channels])?.into_any()),
        }
    }

    /// A probe by its name: values, rate \[Hz\], unit, times of frames \[s\], distance of bins \[Hz\].
    #[allow(clippy::type_complexity)]
    fn probe<'py>(
        &self,
        py: Python<'py>,
        name: &str,
    ) -> PyResult<(Bound<'py, PyAny>, f64, String, Bound<'py, PyArray1<f64>>, f64)> {
        let probe = find(&self.probes, name)?;
        let times = probe.times().into_pyarray(py);
        Ok((probe.array(py)?, probe.rate(), probe.unit(), times, probe.bin_hz()))
    }

    #[getter]
    fn probes(&self) -> Vec<String> {
        self.probes.iter().map(|probe| probe.name.clone()).collect()
    }

    /// The report as JSON. The first call measures the response lag.
    fn report(&self, py: Python<'_>) -> String {
        py.detach(|| match self.ended.lock() {
            Ok(mut ended) => ended.report(),
            Err(broken) => broken.into_inner().report(),
        })
    }
}

impl Ended {
    fn report(&mut self) -> String {
        if let Some(report) = &self.report {
            return report.clone();
        }
        let lag = match self.engine.faults() {
            0 => Lag::of(&self.graph, &self.registry, self.engine.schedule()),
            _ => Lag::new(Err("see `asperity latency`".into()), self.engine.schedule()),
        };
        let run = render::Run {
            request: &self.request,
            options: self.options.clone(),
            ticks: self.engine.next_tick(),
            asked: self.asked,
            elapsed_s: self.elapsed_s,
            swaps: Vec::new(),
            engine: &self.engine,
            facts: self.facts.clone(),
            times: &self.timed.times,
            level: &self.level,
            lag,
        };
        self.report.insert(run.json().to_string()).clone()
    }
}
