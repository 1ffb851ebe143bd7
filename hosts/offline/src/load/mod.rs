//! From arguments to a schedule: reads a graph, or lowers a scene to one, and compiles it.
//!
//! [`load`] does all of it. Who changes the graph in between calls [`read`] and [`compile`].

pub mod stylus;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source, file};
use asperity_graph::{Compiled, GraphFile, Options, Schedule, ScheduledInput, ScheduledNode};
use asperity_motion::ColumnMap;
use asperity_node::{Registry, Role, Shape};
use asperity_nodes::motion::Trajectory;
use asperity_scene::{Finding, Lowering, Rendered, Scene, draft, lower};

use crate::failure::{Failure, clean, wrong};
use crate::host::warn;
use crate::kinds::{self, Kinds};

/// A graph and changes to it, as a person or a program asks for them.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Graph file or scene file; `-` is the standard input.
    pub graph: PathBuf,
    /// Settings, such as `motion.cutoff_hz=30`, or `tick_hz=250`.
    pub set: Vec<String>,
    /// A recorded stroke in place of the graph's own; `-` is the standard input.
    pub input: Option<PathBuf>,
    /// The same in memory: the text of a CSV file.
    pub stroke: Option<Arc<Source>>,
    /// Whether the recorded stroke begins again at its end.
    pub repeat: bool,
    /// Columns of the stroke, such as `force_n=Fz:N`.
    pub map: Vec<String>,
    /// A hand device in place of the graph's own stroke, with its settings.
    pub hand: Option<String>,
    /// Whether nodes that no output needs stay.
    pub no_prune: bool,
    /// Whether passivity violations of a scene are errors.
    pub strict: bool,
}

/// A graph that was read and compiled.
pub struct Loaded {
    /// The graph with its changes.
    pub graph: GraphFile,
    /// The scene from which it was lowered.
    pub scene: Option<OfScene>,
    /// All kinds that it may use.
    pub registry: Registry,
    /// Its schedule and processors.
    pub compiled: Compiled,
}

/// A scene, and the nodes of its graph that render each kind of effect.
#[derive(Clone, Debug)]
pub struct OfScene {
    /// The scene.
    pub scene: Scene,
    /// Nodes of each kind of effect.
    pub rendered: Vec<Rendered>,
    /// Files that its effects name, once for each surface.
    pub files: Vec<PathBuf>,
}

/// Most findings about a scene that cause a warning each.
const MOST_FINDINGS: usize = 8;

/// Reads and compiles a graph.
///
/// # Errors
/// See [`read`] and [`compile`].
pub fn load(request: &Request, kinds: &mut Kinds) -> Result<Loaded, Failure> {
    let (graph, scene) = read(request, kinds)?;
    compile(request, kinds, graph, scene)
}

/// Reads a graph, or lowers a scene to one, and applies the changes to it.
///
/// # Errors
/// A file that cannot be read or has an error, a change that does not fit.
pub fn read(request: &Request, kinds: &mut Kinds) -> Result<(GraphFile, Option<OfScene>), Failure> {
    read_text(&source_of(request)?, request, kinds)
}

/// Like [`read`], for a text that its author has already.
///
/// # Errors
/// See [`read`].
pub fn read_text(
    source: &Arc<Source>,
    request: &Request,
    kinds: &mut Kinds,
) -> Result<(GraphFile, Option<OfScene>), Failure> {
    if !Scene::is_meant(source) {
        return Ok((changed(GraphFile::parse(source)?, request)?, None));
    }
    let mut scene = Scene::parse(source)?;
    // The scene is lowered with the rates that the command line sets.
    let mut rates = draft(&scene)?;
    for assignment in request.set.iter().filter(|set| !set.split('=').next().unwrap_or("").contains('.')) {
        rates.set(assignment, "--set")?;
    }
    (scene.tick_hz, scene.audio_hz, scene.seed) = (rates.tick_hz, rates.audio_hz, rates.seed);
    let registry = kinds.registry(Some(&draft(&scene)?))?;
    scene.check(&registry)?;
    check_passivity(&scene, &registry, request.strict)?;
    let lowered = lower(&scene, &registry, Lowering { prune: !request.no_prune })?;
    let graph = changed(lowered.graph, request)?;
    // A stroke from a file feels nothing.
    if graph.nodes.iter().any(|node| registry.role(&node.kind) == Some(Role::Hand)) {
        scene.unfelt(&registry).iter().for_each(warn_of);
    }
    let files = scene.files(&registry);
    Ok((graph, Some(OfScene { scene, rendered: lowered.rendered, files })))
}

/// Reads the graph or scene, and the standard input where the arguments name it.
fn source_of(request: &Request) -> Result<Arc<Source>, Failure> {
    let stdin =
        [Some(&request.graph), request.input.as_ref()].into_iter().flatten().filter(|p| is_standard(p));
    match stdin.count() {
        0 => {}
        1 => file::take_stdin()?,
        _ => {
            let what = "the graph and --input cannot both be the standard input";
            return Err(wrong("-", what, "give one of the two as a file"));
        }
    }
    let source = Source::read(&request.graph)?;
    if is_table(&source) {
        let path = request.graph.display();
        return Err(wrong(
            &request.graph,
            "this is a CSV; did you mean `--input`?",
            format!(
                "to play it as a stroke: asperity render graphs/texture.ron --input {path} --out out.wav"
            ),
        ));
    }
    Ok(source)
}

/// Whether a path is the standard input or output.
pub fn is_standard(path: &Path) -> bool {
    path == Path::new("-")
}

/// The extension of a file's name, in lower case.
pub fn ending(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// Whether a text is a CSV table, not a graph or scene.
fn is_table(source: &Source) -> bool {
    let names_columns = |line: &str| {
        line.split([',', ';', '\t', ' ']).any(|name| name.trim_matches(['#', ' ', '"']) == "t_s")
    };
    ending(source.path()) == "csv" || source.text().lines().next().is_some_and(names_columns)
}

/// Compiles a graph that was read.
///
/// # Errors
/// Errors of the graph, and plugins that do not load.
pub fn compile(
    request: &Request,
    kinds: &mut Kinds,
    graph: GraphFile,
    scene: Option<OfScene>,
) -> Result<Loaded, Failure> {
    let mut registry = kinds.registry(Some(&graph))?;
    if let Some(stroke) = &request.stroke {
        registry.add(Arc::new(Trajectory::playing(stroke.clone())));
    }
    let options = Options { prune: !request.no_prune };
    let compiled = asperity_graph::compile(&graph, &registry, options).map_err(Failure::from);
    let compiled = kinds.judge(compiled)?;
    Ok(Loaded { graph, scene, registry, compiled })
}

/// Longest time to run that may be asked for \[s\]: a year.
const MAX_SECONDS: f64 = 365.0 * 86_400.0;

/// Ticks to run: those of `--seconds`, else those of the graph's sources; `None` if nothing says how many.
///
/// # Errors
/// A duration out of range.
pub fn ticks(seconds: Option<f64>, schedule: &Schedule) -> Result<Option<u64>, Diagnostic> {
    match seconds {
        Some(s) if s > 0.0 && s <= MAX_SECONDS => {
            Ok(Some((s * f64::from(schedule.tick_hz)).round().max(1.0) as u64))
        }
        Some(s) => Err(Diagnostic::new(format!("{s} s is out of range"))
            .in_file("--seconds")
            .help(format!("above 0, at most {MAX_SECONDS} s"))),
        None => Ok(schedule.duration_ticks().filter(|&t| t > 0)),
    }
}

/// A graph without the nodes that push back.
pub fn without_force(graph: &GraphFile, registry: &Registry) -> GraphFile {
    let mut graph = graph.clone();
    graph.nodes.retain(|n| registry.role(&n.kind) != Some(Role::Force));
    let ids: std::collections::HashSet<String> = graph.nodes.iter().map(|n| n.id.clone()).collect();
    graph.wires.retain(|w| ids.contains(&w.to.node));
    graph
}

/// Warns of passivity violations of a scene, or makes them errors.
fn check_passivity(scene: &Scene, registry: &Registry, strict: bool) -> Result<(), Failure> {
    let findings = scene.findings(registry);
    if strict && !findings.is_empty() {
        let error = |f: Finding| Diagnostic::new(f.message).at(&f.place.source, f.place.span);
        return Err(findings.into_iter().map(error).collect::<Vec<_>>().into());
    }
    findings.iter().take(MOST_FINDINGS).for_each(warn_of);
    if let Some(more) = findings.len().checked_sub(MOST_FINDINGS).filter(|more| *more > 0) {
        warn(&format!("and {more} more like these; --strict lists all"));
    }
    Ok(())
}

fn warn_of(Finding { message, place }: &Finding) {
    let (path, at) = (place.source.path().display().to_string(), place.position());
    warn(&format!("{}:{}:{}: {}", clean(&path), at.line, at.column, clean(message)));
}

fn changed(mut graph: GraphFile, request: &Request) -> Result<GraphFile, Failure> {
    if let Some(input) = &request.input {
        stylus::play(&mut graph, &kinds::built_in(), Some(input))?;
    } else if request.stroke.is_some() {
        stylus::play(&mut graph, &kinds::built_in(), None)?;
    }
    if let Some(hand) = &request.hand {
        stylus::take_in_hand(&mut graph, &kinds::built_in(), hand)?;
    }
    if request.repeat {
        stylus::repeat(&mut graph, &kinds::built_in())?;
    }
    if !request.map.is_empty() {
        ColumnMap::parse(&request.map).map_err(|e| e.in_file("--map"))?;
        stylus::map(&mut graph, &kinds::built_in(), &request.map)?;
    }
    for assignment in &request.set {
        graph.set(assignment, "--set")?;
    }
    Ok(graph)
}

/// Warns of settings that compile and are probably mistakes, and of nodes that are not fit for real time.
pub fn warn_about(schedule: &Schedule) {
    warnings(schedule).iter().for_each(|w| warn(w));
    for id in schedule.allocating() {
        warn(&format!("`{id}` allocates in every tick and is not fit for real time"));
    }
}

/// Settings that compile and are probably mistakes, in words.
pub fn warnings(schedule: &Schedule) -> Vec<String> {
    let mut out = Vec::new();
    for node in &schedule.nodes {
        if let Some(ignored) = node.facts.iter().find(|fact| fact.name == "ignored_columns") {
            out.push(format!("`{}` ignores these columns of its file: {}", node.id, ignored.value));
        }
        let emission = node.params.get_number("emission");
        let frames = node.inputs.first().and_then(frames_a_window);
        // Measured with the shipped model: right up to 0.57 of a window, 1.16 times as loud at 0.67,
        // 2 times at 0.8, 9 times at 0.95.
        if let (Some(emission), Some(frames)) = (emission, frames)
            && -emission > 0.6 * frames
        {
            out.push(format!(
                "`{}` emits samples that lie {:.0} % into a window of {frames:.0} frames, \
                 where they are inaccurate and too loud. \
                 Set `emission` to -{:.0} or nearer to 0, or leave it out",
                node.id,
                -100.0 * emission / frames,
                0.5 * frames
            ));
        }
        if let Some(inverse) = inverse_of(node, schedule) {
            for name in ["profile", "handle_mass_g"] {
                if inverse.params.get(name) != node.params.get(name) {
                    let (a, b) = (&inverse.id, &node.id);
                    out.push(format!("`{a}` and `{b}` are set to different actuators: `{name}` differs"));
                }
            }
        }
    }
    out
}

/// The actuator's inverse that drives a limiter.
pub fn inverse_of<'a>(limiter: &ScheduledNode, schedule: &'a Schedule) -> Option<&'a ScheduledNode> {
    let before = |node: &ScheduledNode| Some(&schedule.nodes[node.inputs.first()?.from?.0]);
    let first = before(limiter).filter(|_| limiter.role == Some(Role::Limiter));
    let mut chain = std::iter::successors(first, |node| before(node)).take(schedule.nodes.len());
    chain.find(|node| node.role == Some(Role::ActuatorInverse))
}

fn frames_a_window(input: &ScheduledInput) -> Option<f64> {
    match input.port.as_ref()?.shape {
        Shape::Magnitude(layout) => {
            let seconds = f64::from(layout.length) / f64::from(layout.rate_hz);
            Some(seconds * layout.frame_rate.hz())
        }
        _ => None,
    }
}
