//! A graph with its settings, ready to be rendered, run and drawn.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source, one_of};
use asperity_graph::{Compiled, GraphFile, Schedule};
use asperity_hand::{HOST_INPUT, host_input};
use asperity_node::{NodeKind, Registry, Role};
use asperity_offline::failure::{Failure, wrong};
use asperity_offline::host::warn;
use asperity_offline::kinds::Kinds;
use asperity_offline::lag::{self, Lag};
use asperity_offline::load::{self, Loaded, Request, stylus, ticks, warnings};
use asperity_offline::picture::picture;
use asperity_offline::{probe, shipped};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;

use crate::engine::Engine;
use crate::error::{Watch, raise};
use crate::felt::{Felt, Run};
use crate::node::{Kind, tell};
use crate::values::Values;

/// Name of a graph that is a text, in errors.
const TEXT: &str = "<text>";
/// Name of a stroke that is an array, in errors.
const STROKE: &str = "<stroke>";

/// A graph that was read, with its picture.
#[pyclass(module = "asperity._asperity", frozen)]
pub struct Graph {
    plan: Plan,
    python: Vec<Py<Kind>>,
    #[pyo3(get)]
    svg: String,
    schedule: Schedule,
}

/// A graph file or text, with settings and kinds of Python.
struct Plan {
    request: Request,
    /// The graph itself, if it is no file.
    text: Option<Arc<Source>>,
    /// Parameters that name no node, and their values.
    keywords: Vec<(String, String)>,
    kinds: Vec<Arc<NodeKind>>,
}

/// A graph that is ready to run, and its probes.
pub struct Ready {
    pub request: Request,
    pub graph: GraphFile,
    pub registry: Registry,
    pub compiled: Compiled,
    pub probes: Vec<Values>,
}

#[pymethods]
impl Graph {
    /// Reads and compiles a graph, so that its errors come now.
    #[new]
    fn new(
        py: Python<'_>,
        graph: String,
        is_text: bool,
        set: Vec<String>,
        keywords: Vec<(String, String)>,
        kinds: Vec<Py<Kind>>,
    ) -> PyResult<Self> {
        let text = is_text.then(|| Source::new(TEXT, graph.as_str()));
        let path = PathBuf::from(if is_text { TEXT } else { &graph });
        let path = shipped::found(path).map_err(|e| raise(&Failure::Machine(e.to_string())))?;
        let request = Request { graph: path, set, ..Request::default() };
        let own = kinds.iter().map(|kind| kind.get().kind()).collect();
        let plan = Plan { request, text, keywords, kinds: own };
        let ready = py.detach(|| plan.ready(plan.request.clone(), &[], false)).map_err(|e| raise(&e))?;
        let svg = picture(&ready.graph, &ready.compiled.schedule).to_svg();
        Ok(Self { plan, python: kinds, svg, schedule: ready.compiled.schedule })
    }

    #[getter]
    fn tick_hz(&self) -> u32 {
        self.schedule.tick_hz
    }

    #[getter]
    fn audio_hz(&self) -> u32 {
        self.schedule.audio_hz
    }

    #[getter]
    fn seed(&self) -> u64 {
        self.schedule.seed
    }

    /// Ids and kinds of the nodes that are built, in the order in which they run.
    #[getter]
    fn nodes(&self) -> Vec<(String, String)> {
        self.schedule.nodes.iter().map(|n| (n.id.clone(), n.kind.clone())).collect()
    }

    /// Runs the graph from its start, as fast as possible.
    #[allow(clippy::too_many_arguments)]
    fn render(
        &self,
        py: Python<'_>,
        file: Option<PathBuf>,
        table: Option<(Vec<String>, PyReadonlyArray2<'_, f64>)>,
        map: Vec<String>,
        repeat: bool,
        probes: Vec<String>,
        seconds: Option<f64>,
        seed: Option<u64>,
        sleep: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Felt> {
        let mut request = self.plan.request.clone();
        request.set.extend(seed.map(|seed| format!("seed={seed}")));
        request.stroke = table.map(|(names, rows)| Source::new(STROKE, csv(&names, &rows)));
        (request.input, request.map, request.repeat) = (file, map, repeat);
        let felt = py.detach(|| -> PyResult<Felt> {
            let mut watch = Watch::new(progress);
            let ready = self.plan.ready(request, &probes, false).map_err(|e| raise(&e))?;
            let all = self.plan.check(&ready.compiled.schedule, seconds).map_err(|e| raise(&e))?;
            // That a Python node allocates matters to a live run only.
            warnings(&ready.compiled.schedule).iter().for_each(|text| warn(text));
            let mut run = Run::new(ready, all, sleep, seconds, &probes);
            while run.done() < all {
                run.tick();
                if run.done().is_multiple_of(64) {
                    watch.look(run.done(), all)?;
                }
            }
            watch.look(all, all)?;
            Ok(run.end())
        });
        tell(py, &self.python)?;
        felt
    }

    /// How late the graph answers the hand, as JSON.
    fn lag(&self, py: Python<'_>) -> PyResult<String> {
        py.detach(|| -> Result<_, Failure> {
            let Ready { graph, registry, compiled, .. } =
                self.plan.ready(self.plan.request.clone(), &[], false)?;
            Ok(lag::json(&Lag::of(&graph, &registry, &compiled.schedule)).to_string())
        })
        .map_err(|e| raise(&e))
    }

    /// An engine at tick 0, whose stylus the caller moves.
    fn engine(&self, py: Python<'_>, probes: Vec<String>) -> PyResult<Engine> {
        let ready =
            py.detach(|| self.plan.ready(self.plan.request.clone(), &probes, true)).map_err(|e| raise(&e))?;
        Ok(Engine::new(ready, self.python.iter().map(|kind| kind.clone_ref(py)).collect()))
    }
}

impl Plan {
    /// Reads and compiles the graph. With `hand`, the caller moves its stylus.
    fn ready(&self, request: Request, probes: &[String], hand: bool) -> Result<Ready, Failure> {
        let mut kinds = Kinds::new(&[]).with(self.kinds.clone());
        let (mut graph, scene) = match &self.text {
            Some(text) => load::read_text(text, &request, &mut kinds)?,
            None => load::read(&request, &mut kinds)?,
        };
        let registry = kinds.registry(Some(&graph))?;
        for (name, value) in &self.keywords {
            set_only(&mut graph, &registry, name, value)?;
        }
        if hand && graph.nodes.iter().any(|node| moves(&registry, &node.kind)) {
            let own = self.kinds.iter().cloned().chain([Arc::new(host_input())]).collect();
            kinds = kinds.with(own);
            let registry = kinds.registry(Some(&graph))?;
            stylus::take_in_hand(&mut graph, &registry, HOST_INPUT)?;
        }
        let mut ids = Vec::new();
        for port in probes {
            // A probe of the graph itself is read where it is.
            let own = graph.node(port).is_some_and(|n| registry.role(&n.kind) == Some(Role::Probe));
            ids.push(if own { port.clone() } else { probe::add(&mut graph, port, &[], "probes")? });
        }
        let Loaded { graph, registry, compiled, .. } = load::compile(&request, &mut kinds, graph, scene)?;
        let values = |(name, id): (&String, &String)| {
            let node = compiled.schedule.index_of(id)?;
            Values::new(name, node, &compiled.schedule)
        };
        let probes = probes.iter().zip(&ids).filter_map(values).collect();
        Ok(Ready { request, graph, registry, compiled, probes })
    }

    /// Ticks to run. Refuses a graph that needs input from a device.
    fn check(&self, schedule: &Schedule, seconds: Option<f64>) -> Result<u64, Failure> {
        if let Some((node, _)) = schedule.host_fed().next() {
            let node = &schedule.nodes[node];
            return Err(wrong(
                &self.request.graph,
                format!("`{}` ({}) needs a live device, and a render has none", node.id, node.kind),
                "give a stroke: graph.render(stroke); or move the hand yourself: graph.engine()",
            ));
        }
        ticks(seconds, schedule)?.ok_or_else(|| {
            let what = "no source of this graph has a duration";
            wrong(&self.request.graph, what, "give the duration: seconds=5.0")
        })
    }
}

/// A table as the text of a CSV file. Numbers keep all their digits.
fn csv(names: &[String], rows: &PyReadonlyArray2<'_, f64>) -> String {
    let mut text = names.join(",") + "\n";
    for row in rows.as_array().rows() {
        for (i, x) in row.iter().enumerate() {
            let _ = write!(text, "{}{x}", if i > 0 { "," } else { "" });
        }
        text.push('\n');
    }
    text
}

fn moves(registry: &Registry, kind: &str) -> bool {
    matches!(registry.role(kind), Some(Role::Stroke | Role::Hand))
}

/// Sets a parameter of the only node that has it.
fn set_only(graph: &mut GraphFile, registry: &Registry, name: &str, value: &str) -> Result<(), Failure> {
    let has = |kind: &str| {
        let params = registry.get(kind).map(|kind| kind.descriptor().params.as_slice()).unwrap_or_default();
        params.iter().map(|p| p.name.to_string()).collect::<Vec<_>>()
    };
    let found = graph.nodes.iter().filter(|n| has(&n.kind).iter().any(|param| param == name));
    let found: Vec<String> = found.map(|n| n.id.clone()).collect();
    let error = |what: String, help: String| Diagnostic::new(what).in_file(graph.source.path()).help(help);
    match found.as_slice() {
        [id] => {
            let id = id.clone();
            graph.set(&format!("{id}.{name}={value}"), &format!("{name}="))?;
            Ok(())
        }
        [] => {
            let all: std::collections::BTreeSet<String> =
                graph.nodes.iter().flat_map(|n| has(&n.kind)).collect();
            let help = one_of(name, all.iter().map(String::as_str));
            Err(error(format!("no node of this graph has a parameter `{name}`"), help).into())
        }
        [first, ..] => {
            let what = format!("several nodes have a parameter `{name}`: `{}`", found.join("`, `"));
            Err(error(what, format!("name the node: set={{\"{first}.{name}\": ...}}")).into())
        }
    }
}
