//! From a path on the command line to a compiled graph.

use asperity_graph::{Compiled, GraphFile, Options, Schedule, ScheduledInput, ScheduledNode, compile};
use std::path::{Path, PathBuf};

use asperity_diagnostics::{Diagnostic, Source, one_of};
use asperity_node::{ParamValue, Registry, Shape};
use asperity_scene::{Finding, Kind, Scene};
use asperity_scene::{Lowering, draft, lower};

use crate::args::{GraphArgs, PluginArgs};
use crate::failure::{Failure, clean, warn};
use crate::kinds::Kinds;
use crate::source;

/// Most findings about a scene that are warned of one by one.
const MOST_FINDINGS: usize = 8;

/// A scene, and which nodes of its graph render which kind of effect.
#[derive(Clone, Debug)]
pub struct OfScene {
    /// It.
    pub scene: Scene,
    /// Kinds in their order, with ids of nodes.
    pub rendered: Vec<(Kind, Vec<String>)>,
}

/// Reads a graph, or lowers a scene to one, and applies `--set` and `--input`.
pub fn read(args: &GraphArgs, kinds: &mut Kinds) -> Result<GraphFile, Failure> {
    Ok(read_all(args, kinds)?.0)
}

/// The same with the scene, where the file is one.
pub fn read_all(args: &GraphArgs, kinds: &mut Kinds) -> Result<(GraphFile, Option<OfScene>), Failure> {
    let source = Source::read(&args.graph)?;
    if !Scene::is_meant(&source) {
        return Ok((changed(GraphFile::parse(&source)?, args)?, None));
    }
    let mut scene = Scene::parse(&source)?;
    // Rates that the command line sets count for what follows from them too.
    let mut rates = draft(&scene)?;
    for assignment in args.set.iter().filter(|set| !set.split('=').next().unwrap_or("").contains('.')) {
        rates.set(assignment, "--set")?;
    }
    (scene.tick_hz, scene.audio_hz, scene.seed) = (rates.tick_hz, rates.audio_hz, rates.seed);
    judge(&scene, args.strict)?;
    let registry = kinds.registry(Some(&draft(&scene)?))?;
    let lowered = lower(&scene, &registry, Lowering { prune: !args.no_prune })?;
    let graph = changed(lowered.graph, args)?;
    Ok((graph, Some(OfScene { scene, rendered: lowered.rendered })))
}

/// A graph that is run without any device.
pub struct Offline {
    pub graph: GraphFile,
    /// The same with what pushes back, as its file has it.
    pub whole: GraphFile,
    /// The kinds that it may use.
    pub registry: Registry,
    /// Files of the plugins that some of them came from.
    pub plugins: Vec<PathBuf>,
}

/// A graph, or what a scene lowers to, to be run without any device: nothing in it pushes back.
pub fn offline(path: &Path, plugins: &PluginArgs) -> Result<Offline, Failure> {
    let args = GraphArgs {
        graph: path.to_owned(),
        set: Vec::new(),
        input: None,
        hand: None,
        no_prune: false,
        strict: false,
        plugins: plugins.clone(),
    };
    let mut kinds = Kinds::new(&plugins.plugin);
    let whole = read(&args, &mut kinds)?;
    let registry = kinds.registry(Some(&whole))?;
    let mut graph = whole.clone();
    graph.nodes.retain(|n| !n.kind.ends_with("_force"));
    let ids: Vec<String> = graph.nodes.iter().map(|n| n.id.clone()).collect();
    graph.wires.retain(|w| ids.contains(&w.to.node));
    Ok(Offline { graph, whole, registry, plugins: kinds.files().to_vec() })
}

/// What a scene asks of its device that it may not bear: warnings, or an error.
fn judge(scene: &Scene, strict: bool) -> Result<(), Failure> {
    let findings = scene.findings();
    if strict && !findings.is_empty() {
        let told = |f: Finding| Diagnostic::new(f.message).at(&f.place.source, f.place.span);
        return Err(findings.into_iter().map(told).collect::<Vec<_>>().into());
    }
    for Finding { message, place } in findings.iter().take(MOST_FINDINGS) {
        let (path, at) = (place.source.path().display().to_string(), place.position());
        warn(&format!("{}:{}:{}: {}", clean(&path), at.line, at.column, clean(message)));
    }
    if let Some(more) = findings.len().checked_sub(MOST_FINDINGS).filter(|more| *more > 0) {
        warn(&format!("and {more} more like these; --strict tells them all"));
    }
    Ok(())
}

/// A graph with what the command line changes in it.
fn changed(mut graph: GraphFile, args: &GraphArgs) -> Result<GraphFile, Failure> {
    if let Some(input) = &args.input {
        source::play(&mut graph, input)?;
    }
    if let Some(hand) = &args.hand {
        source::take_in_hand(&mut graph, hand)?;
    }
    for assignment in &args.set {
        graph.set(assignment, "--set")?;
    }
    Ok(graph)
}

/// Compiles a graph with the kinds this program has.
pub fn compiled(graph: &GraphFile, args: &GraphArgs, registry: &Registry) -> Result<Compiled, Failure> {
    Ok(compile(graph, registry, Options { prune: !args.no_prune })?)
}

/// Every file that a graph was made from, and who reads it.
pub fn files_read(args: &GraphArgs, schedule: &Schedule) -> Vec<(PathBuf, String)> {
    let mut files = vec![(args.graph.clone(), "the graph".to_owned())];
    files.extend(node_files(schedule).into_iter().map(|f| {
        let reader = if f.param.is_empty() { f.node } else { format!("{}.{}", f.node, f.param) };
        (f.path, format!("`{reader}`"))
    }));
    files
}

/// A file that a node reads.
pub struct NodeFile {
    /// The file.
    pub path: PathBuf,
    /// The node's id.
    pub node: String,
    /// The parameter that names it; empty where it stands within one.
    pub param: String,
}

/// Every file that the nodes of a graph read.
pub fn node_files(schedule: &Schedule) -> Vec<NodeFile> {
    let mut files = Vec::new();
    for node in &schedule.nodes {
        for (name, value) in node.params.iter() {
            let path = match value {
                ParamValue::File(path) => path.clone(),
                // A profile is a name or a file, relative to where it stands.
                ParamValue::Text(text) if name == "profile" && text.ends_with(".ron") => {
                    let place = node.params.place(name).and_then(|p| p.source.path().parent());
                    place.unwrap_or(Path::new("")).join(text)
                }
                _ => continue,
            };
            files.push(NodeFile { path, node: node.id.clone(), param: name.to_owned() });
        }
        let within = node.files.iter().map(|path| NodeFile {
            path: path.clone(),
            node: node.id.clone(),
            param: String::new(),
        });
        files.extend(within);
    }
    files
}

/// What compiles and is probably not meant.
pub fn warnings(schedule: &Schedule) -> Vec<String> {
    let stages: Vec<&ScheduledNode> =
        schedule.nodes.iter().filter(|n| matches!(n.kind.as_str(), "actuator_inverse" | "limiter")).collect();
    let mut out = Vec::new();
    for node in &schedule.nodes {
        let emission = node.params.get_number("emission").filter(|_| node.kind == "sample_commit");
        if let (Some(emission), Some(frames)) = (emission, node.inputs.first().and_then(frames_a_window)) {
            // Measured with the shipped model: 1.16 times as loud at 0.67 of a window, 2 times at 0.8, 9 times at 0.95; right up to 0.57.
            if -emission > 0.6 * frames {
                out.push(format!(
                    "`{}` emits samples that lie {:.0} % into a window of {frames:.0} frames, where little is known of them, and they are too loud: \
                     `emission` of -{:.0} or nearer to 0; left out, it follows the frames",
                    node.id,
                    -100.0 * emission / frames,
                    0.5 * frames
                ));
            }
        }
    }
    for pair in stages.windows(2) {
        for name in ["profile", "handle_mass_g"] {
            if pair[0].params.get(name) != pair[1].params.get(name) {
                out.push(format!(
                    "`{}` and `{}` are set to different actuators: `{name}` differs",
                    pair[0].id, pair[1].id
                ));
            }
        }
    }
    out
}

/// Frames that begin within a window.
fn frames_a_window(input: &ScheduledInput) -> Option<f64> {
    match input.port.as_ref()?.shape {
        Shape::Magnitude(layout) => {
            let seconds = f64::from(layout.length) / f64::from(layout.rate_hz);
            Some(seconds * layout.frame_rate.hz())
        }
        _ => None,
    }
}

/// Splits `NODE.PORT=FILE` of a probe.
pub fn probe(text: &str, graph: &GraphFile) -> Result<(String, String), Diagnostic> {
    let fail = |m: String| Diagnostic::new(m).in_file("--probe");
    let Some((port, file)) = text.split_once('=') else {
        return Err(fail(format!("there is no `=` in `{text}`")).help("NODE.PORT=FILE.csv or .npy"));
    };
    if file.trim().is_empty() {
        return Err(
            fail(format!("there is no file after the `=` in `{text}`")).help("NODE.PORT=FILE.csv or .npy")
        );
    }
    let node = port.split('.').next().unwrap_or(port);
    if graph.node(node).is_none() {
        let ids = graph.nodes.iter().map(|n| n.id.as_str());
        return Err(fail(format!("the graph has no node `{node}`")).help(one_of(node, ids)));
    }
    Ok((port.to_owned(), file.to_owned()))
}
