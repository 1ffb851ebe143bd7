//! From arguments to a schedule: reads a graph, or lowers a scene to one, and compiles it.
//!
//! [`load`] does all of it. A command that changes the graph in between calls [`read`] and [`compile`].

pub mod files;
mod stylus;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source, file};
use asperity_graph::{Compiled, GraphFile, Options, Schedule, ScheduledInput, ScheduledNode};
use asperity_motion::ColumnMap;
use asperity_node::{Registry, Role, Shape};
use asperity_scene::{Finding, Lowering, Rendered, Scene, draft, lower};

use crate::failure::{Failure, clean, warn, wrong};
use crate::kinds::{self, Kinds};
use crate::output::{ending, is_standard};

/// A graph and changes to it.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct GraphArgs {
    /// Graph file or scene file; - reads the standard input
    #[arg(value_parser = crate::shipped::path())]
    pub graph: PathBuf,
    /// Set a parameter, such as motion.cutoff_hz=30, or tick_hz, audio_hz, seed.
    /// NODE.every=N runs a node in every Nth tick
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    pub set: Vec<String>,
    /// Play this recorded stroke instead of the graph's own; - reads the standard input
    #[arg(long, value_name = "STROKE.csv", value_parser = crate::shipped::path())]
    pub input: Option<PathBuf>,
    /// Repeat the recorded stroke. Between its end and its start, the stylus moves back in the air
    #[arg(long = "loop", conflicts_with = "hand")]
    pub repeat: bool,
    #[command(flatten)]
    pub columns: ColumnArgs,
    #[arg(long, value_name = "KIND[:param=value,...]", conflicts_with = "input", help = hand_help())]
    pub hand: Option<String>,
    /// Keep nodes that no output needs. In a scene, also build effects that no surface has
    #[arg(long)]
    pub no_prune: bool,
    /// Treat passivity violations of a scene as errors
    #[arg(long)]
    pub strict: bool,
    #[command(flatten)]
    pub plugins: PluginArgs,
}

impl GraphArgs {
    pub fn plain(graph: &Path, plugins: &PluginArgs) -> Self {
        Self { graph: graph.to_owned(), plugins: plugins.clone(), ..Self::default() }
    }
}

fn hand_help() -> String {
    let registry = asperity_hand::register(Registry::new());
    let hands: Vec<&str> = registry.with_role(Role::Hand).map(stylus::hand_name).collect();
    format!("Let a hand device move the stylus instead of the graph's own stroke: {}", hands.join(", "))
}

/// Columns of strokes.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct ColumnArgs {
    /// Read a quantity of a stroke from this column: --map force_n=Fz:N. May be repeated
    ///
    /// NAME is a column that Asperity reads, such as t_s, x_mm, speed_mm_s or force_n. COLUMN is its name in
    /// the file, or its number where the file names none; a minus sign before it turns its sign. UNIT is the
    /// unit in the file: s, ms, us; m, cm, mm, um; N, mN, kN, g, gf, kgf; m/s, cm/s, mm/s; m/s^2, g, mg.
    #[arg(long, value_name = "NAME=COLUMN[:UNIT]")]
    pub map: Vec<String>,
}

impl ColumnArgs {
    pub fn parsed(&self) -> Result<ColumnMap, Diagnostic> {
        ColumnMap::parse(&self.map).map_err(|e| e.in_file("--map"))
    }
}

/// Plugins to load.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct PluginArgs {
    /// Plugin to load: a file, or a name to look for in the folders of ASPERITY_PLUGIN_PATH
    #[arg(long = "plugin", value_name = "P")]
    pub plugin: Vec<PathBuf>,
}

pub struct Loaded {
    /// The graph, with the changes of the command line.
    pub graph: GraphFile,
    pub scene: Option<OfScene>,
    pub registry: Registry,
    pub compiled: Compiled,
}

/// A scene, and the nodes of its graph that render each kind of effect.
#[derive(Clone, Debug)]
pub struct OfScene {
    pub scene: Scene,
    pub rendered: Vec<Rendered>,
    /// Files that its effects name, once for each surface.
    pub files: Vec<PathBuf>,
}

/// Most findings about a scene that cause a warning each.
const MOST_FINDINGS: usize = 8;

pub fn load(args: &GraphArgs, kinds: &mut Kinds) -> Result<Loaded, Failure> {
    let (graph, scene) = read(args, kinds)?;
    compile(args, kinds, graph, scene)
}

/// Reads a graph, or lowers a scene to one, and applies the arguments to it.
pub fn read(args: &GraphArgs, kinds: &mut Kinds) -> Result<(GraphFile, Option<OfScene>), Failure> {
    let source = source_of(args)?;
    if !Scene::is_meant(&source) {
        return Ok((changed(GraphFile::parse(&source)?, args)?, None));
    }
    let mut scene = Scene::parse(&source)?;
    // The scene is lowered with the rates that the command line sets.
    let mut rates = draft(&scene)?;
    for assignment in args.set.iter().filter(|set| !set.split('=').next().unwrap_or("").contains('.')) {
        rates.set(assignment, "--set")?;
    }
    (scene.tick_hz, scene.audio_hz, scene.seed) = (rates.tick_hz, rates.audio_hz, rates.seed);
    let registry = kinds.registry(Some(&draft(&scene)?))?;
    scene.check(&registry)?;
    check_passivity(&scene, &registry, args.strict)?;
    let lowered = lower(&scene, &registry, Lowering { prune: !args.no_prune })?;
    let graph = changed(lowered.graph, args)?;
    // A stroke from a file feels nothing.
    if graph.nodes.iter().any(|node| registry.role(&node.kind) == Some(Role::Hand)) {
        scene.unfelt(&registry).iter().for_each(warn_of);
    }
    let files = scene.files(&registry);
    Ok((graph, Some(OfScene { scene, rendered: lowered.rendered, files })))
}

/// Reads the graph or scene, and the standard input where the arguments name it.
fn source_of(args: &GraphArgs) -> Result<Arc<Source>, Failure> {
    let stdin = [Some(&args.graph), args.input.as_ref()].into_iter().flatten().filter(|p| is_standard(p));
    match stdin.count() {
        0 => {}
        1 => file::take_stdin()?,
        _ => {
            let what = "the graph and --input cannot both be the standard input";
            return Err(wrong("-", what, "give one of the two as a file"));
        }
    }
    let source = Source::read(&args.graph)?;
    if is_table(&source) {
        let path = args.graph.display();
        return Err(wrong(
            &args.graph,
            "this is a CSV; did you mean `--input`?",
            format!(
                "to play it as a stroke: asperity render graphs/texture.ron --input {path} --out out.wav"
            ),
        ));
    }
    Ok(source)
}

/// Whether a text is a CSV table, not a graph or scene.
fn is_table(source: &Source) -> bool {
    let names_columns = |line: &str| {
        line.split([',', ';', '\t', ' ']).any(|name| name.trim_matches(['#', ' ', '"']) == "t_s")
    };
    ending(source.path()) == "csv" || source.text().lines().next().is_some_and(names_columns)
}

pub fn compile(
    args: &GraphArgs,
    kinds: &mut Kinds,
    graph: GraphFile,
    scene: Option<OfScene>,
) -> Result<Loaded, Failure> {
    let registry = kinds.registry(Some(&graph))?;
    let options = Options { prune: !args.no_prune };
    let compiled = asperity_graph::compile(&graph, &registry, options).map_err(Failure::from);
    let compiled = kinds.judge(compiled)?;
    Ok(Loaded { graph, scene, registry, compiled })
}

/// Longest time to run that may be asked for \[s\]: a year.
const MAX_SECONDS: f64 = 365.0 * 86_400.0;

/// Ticks to run: those of `--seconds`, else those of the graph's sources; `None` if nothing says how many.
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

pub struct Offline {
    /// The graph without nodes that push back.
    pub graph: GraphFile,
    /// The graph as its file has it.
    pub whole: GraphFile,
    pub registry: Registry,
    pub plugins: Vec<PathBuf>,
}

/// Reads a graph or scene to be run without any device: nodes that push back are removed.
pub fn offline(path: &Path, plugins: &PluginArgs) -> Result<Offline, Failure> {
    let args = GraphArgs::plain(path, plugins);
    let mut kinds = Kinds::new(&plugins.plugin);
    let (whole, _) = read(&args, &mut kinds)?;
    let registry = kinds.registry(Some(&whole))?;
    let graph = without_force(&whole, &registry);
    Ok(Offline { graph, whole, registry, plugins: kinds.files().to_vec() })
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

fn changed(mut graph: GraphFile, args: &GraphArgs) -> Result<GraphFile, Failure> {
    if let Some(input) = &args.input {
        stylus::play(&mut graph, &kinds::built_in(), input)?;
    }
    if let Some(hand) = &args.hand {
        stylus::take_in_hand(&mut graph, &kinds::built_in(), hand)?;
    }
    if args.repeat {
        stylus::repeat(&mut graph, &kinds::built_in())?;
    }
    if !args.columns.map.is_empty() {
        args.columns.parsed()?;
        stylus::map(&mut graph, &kinds::built_in(), &args.columns.map)?;
    }
    for assignment in &args.set {
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
