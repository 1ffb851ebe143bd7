//! Arguments that name a graph and its changes. [`asperity_offline::load`] makes a schedule of them.
//!
//! [`load`] does all of it. A command that changes the graph in between calls [`read`] and [`compile`].

pub mod files;

use std::path::{Path, PathBuf};

use asperity_diagnostics::Diagnostic;
use asperity_graph::GraphFile;
use asperity_motion::ColumnMap;
use asperity_node::{Registry, Role};
use asperity_offline::load::{self, Request, stylus};

use crate::failure::Failure;
use crate::kinds::Kinds;

pub use asperity_offline::load::{Loaded, OfScene, inverse_of, ticks, warn_about, warnings, without_force};

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
    pub fn request(&self) -> Request {
        Request {
            graph: self.graph.clone(),
            set: self.set.clone(),
            input: self.input.clone(),
            stroke: None,
            repeat: self.repeat,
            map: self.columns.map.clone(),
            hand: self.hand.clone(),
            no_prune: self.no_prune,
            strict: self.strict,
        }
    }

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

pub fn load(args: &GraphArgs, kinds: &mut Kinds) -> Result<Loaded, Failure> {
    load::load(&args.request(), kinds)
}

/// Reads a graph, or lowers a scene to one, and applies the arguments to it.
pub fn read(args: &GraphArgs, kinds: &mut Kinds) -> Result<(GraphFile, Option<OfScene>), Failure> {
    load::read(&args.request(), kinds)
}

pub fn compile(
    args: &GraphArgs,
    kinds: &mut Kinds,
    graph: GraphFile,
    scene: Option<OfScene>,
) -> Result<Loaded, Failure> {
    load::compile(&args.request(), kinds, graph, scene)
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
