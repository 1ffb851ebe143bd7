//! The command line.

mod calibrate;
mod device;
mod fit_ar;
mod latency;
mod materials;
mod number;
mod scene;
mod selftest;
mod setup;
mod tone;
mod tradeoff;

use std::path::PathBuf;

use clap::{Parser, Subcommand, ValueEnum};

pub use calibrate::{Calibrate, DriveKind};
pub use device::{ActuatorArgs, ClockKind, DeviceArgs, OutputArgs};
pub use fit_ar::{By, FitAr};
pub use latency::LatencyArgs;
pub use materials::{As, Encode, Materials};
pub use scene::{Expand, Explain, SceneCommand};
pub use selftest::{EffortArg, SelfTest};
pub use setup::Setup;
pub use tone::Tone;
pub use tradeoff::{Choose, Merge, Tradeoff, TradeoffCommand};

/// Haptic rendering as a real-time dataflow graph.
#[derive(Debug, Parser)]
#[command(name = "asperity", version, about, max_term_width = 100)]
pub struct Args {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Most memory that files and graphs may take; half of the machine's unless given
    #[arg(long, global = true, value_name = "N MiB|GiB", value_parser = number::memory)]
    pub memory: Option<u64>,
    /// Use no vector instructions that not every CPU has: slower, with the same result to the last bit
    #[arg(long, global = true)]
    pub portable: bool,
    /// Let a graph write over files that Asperity did not make
    #[arg(long, global = true)]
    pub overwrite: bool,
}

/// What the program does.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a graph to a WAV file, as fast as it goes
    Render(Render),
    /// Play a graph in real time: a hand moves, the actuator on the sound card answers
    #[command(mut_args = number::may_be_negative)]
    Run(Run),
    /// Complete recordings that a killed run left
    ///
    /// While it grows, a recording is called take.wav.recording. This corrects its header and calls it
    /// take.wav, or take-1.wav where that is there.
    Recover(Recover),
    /// List audio hosts and devices: rates, formats, channels, buffer sizes
    Devices(Devices),
    /// Write down what stands behind a channel of the sound card: actuator, volts, amplifier
    ///
    /// The file holds for every graph: none can raise its limits, and one that says otherwise is refused.
    /// What the options leave open is asked for.
    Setup(Setup),
    /// Play a sine on one channel of a device, behind the actuator's limiter, to find the actuator
    #[command(mut_args = number::may_be_negative)]
    Tone(Tone),
    /// Tell how late graphs answer a hand, and measure what a device adds, over a loopback from its output to its input
    #[command(mut_args = number::may_be_negative, mut_args = latency::only_with_what_it_is_for)]
    Latency(LatencyArgs),
    /// Measure an actuator with an accelerometer on its handle, and write its profile
    ///
    /// A quiet sweep first, then the measurement, both behind the limiter of the base profile. Exit code 0: the profile is
    /// written; 1: something is wrong with what was measured; 2: with what was asked.
    #[command(mut_args = number::may_be_negative)]
    Calibrate(Box<Calibrate>),
    /// Check a graph: order, buffers, rates, latency per path, what was dropped and why
    Check(Check),
    /// List the kinds of nodes, or describe one: ports, units, parameters
    Nodes(Nodes),
    /// Draw a graph as a picture
    Graph(Graph),
    /// Turn magnitude frames from NumPy into a signal by a phase-retrieval node
    Invert(Invert),
    /// Run every phase-retrieval node over vectors: accuracy, response lag, latency, cost
    Compare(Compare),
    /// Measure many settings of a graph over the same strokes and materials: accuracy, time, response lag
    ///
    /// A stopped run resumes where it was. --shard splits a run between machines, and `tradeoff merge` merges the
    /// results.
    Tradeoff(Tradeoff),
    /// Print the best setting that a budget of time and lag allows, as a fragment to be pasted into a graph
    Choose(Choose),
    /// Find the materials nearest to pictures of a surface, and add one to a library
    ///
    /// A picture is brought to 192 x 256 pixels: its middle of 4 to 3, smaller or larger. What was done to it is said.
    #[command(mut_args = number::may_be_negative)]
    Encode(Encode),
    /// Fit a texture of autoregressive models to a recording of force, speed and acceleration
    ///
    /// RECORDING is a table, whose first line names its columns: t_s; force_n; vx_mm_s and vy_mm_s, or x_mm and y_mm, or speed_mm_s; ax_m_s2, ay_m_s2, az_m_s2, one
    /// at least, or acceleration_m_s2. Or a WAV file, whose channels are named in recording.ron beside it; or a NumPy array of a row for each
    /// sample. At 1 to 10 kHz; hold speed and force for a second at each of some values.
    #[command(mut_args = number::may_be_negative)]
    FitAr(Box<FitAr>),
    /// List the materials of a library: names, families, descriptions, pictures
    Materials(Materials),
    /// Print the graph that a scene lowers to, or say what of it is built, why, and what it costs
    #[command(subcommand)]
    Scene(SceneCommand),
    /// Run hard cases over a graph and its plugins: what must stay finite, bounded, and recover
    ///
    /// Without a graph, cases that look at kinds of nodes alone are run, over all that are found. A plugin that may crash is better
    /// looked at by `plugin check` first: here it runs in this process. Exit code 0: all that apply hold; 1: one fails; 2: the graph does not load.
    #[command(name = "selftest")]
    SelfTest(SelfTest),
    /// Make a plugin, check one, or see which are found
    #[command(subcommand)]
    Plugin(PluginCommand),
    /// Let graphs load plugins from a folder, or list such folders
    ///
    /// A plugin may do whatever you may, from the moment it is loaded. A plugin that a graph names is loaded only
    /// from a folder that is trusted, or where --plugin or ASPERITY_PLUGIN_PATH names it too. ASPERITY_TRUST lists
    /// more folders.
    Trust(Trust),
}

/// `asperity recover`
#[derive(Debug, clap::Args)]
pub struct Recover {
    /// A recording, or a folder of recordings
    #[arg(value_name = "FILE|FOLDER", default_value = ".")]
    pub path: PathBuf,
}

/// `asperity trust`
#[derive(Debug, clap::Args)]
pub struct Trust {
    /// The folder; without one, the trusted folders are listed
    pub folder: Option<PathBuf>,
    /// Trust it no more
    #[arg(long, requires = "folder")]
    pub remove: bool,
}

/// `asperity plugin`
#[derive(Debug, Subcommand)]
pub enum PluginCommand {
    /// Make a folder with a plugin that builds, to be changed
    New(PluginNew),
    /// List the plugins that are found, where, and the kinds they offer
    List(PluginList),
    /// Run a plugin's conformance cases in a process of its own
    ///
    /// A crash, an abort or an endless loop is named with the case it happened in, and the cases behind it still run. So is
    /// what it changes about the process: rounding, signal handlers, working directory, threads left behind. Exit
    /// code 0: all that apply pass; 1: one fails; 2: the plugin does not load.
    ///
    /// Allocations are counted on Linux with glibc, by way of the C library's malloc and free. What cannot be seen: locks
    /// and system calls; what its threads do; memory from mmap or from an allocator that is linked into the plugin; writing where it has no
    /// business to, unless that crashes it.
    Check(CheckPlugin),
    /// That process
    #[command(hide = true)]
    Cases(CasesOfPlugin),
}

/// Languages of a plugin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Lang {
    /// Rust, with the SDK
    Rust,
    /// C, with the header
    C,
    /// C++, with the header
    Cpp,
}

/// What a new plugin begins as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Like {
    /// A phase-retrieval node: magnitudes in, spectra out
    Phase,
    /// A filter: audio in, audio out
    Audio,
}

/// `asperity plugin new`
#[derive(Debug, clap::Args)]
pub struct PluginNew {
    /// Folder to make; its last part is the name of the plugin and of its kind
    pub name: String,
    /// Language
    #[arg(long, value_enum, default_value = "rust")]
    pub lang: Lang,
    /// What it begins as
    #[arg(long, value_enum, default_value = "phase")]
    pub like: Like,
}

/// `asperity plugin list`
#[derive(Debug, clap::Args)]
pub struct PluginList {
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// A graph and what to change in it.
#[derive(Clone, Debug, clap::Args)]
pub struct GraphArgs {
    /// The graph file, or a scene file
    pub graph: PathBuf,
    /// Set a parameter: NODE.PARAM=VALUE, NODE.every=N, or tick_hz, audio_hz, seed
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    pub set: Vec<String>,
    /// Play this CSV in place of the graph's trajectory, stroke or hand
    #[arg(long, value_name = "TRAJ.csv")]
    pub input: Option<PathBuf>,
    /// Let a hand move the stylus in place of the graph's trajectory or stroke: osc, pointer, openhaptics, haply
    #[arg(long, value_name = "KIND[:param=value,...]", conflicts_with = "input")]
    pub hand: Option<String>,
    /// Keep nodes from which no sink is reached; build the nodes of effects that no surface of a scene has
    #[arg(long)]
    pub no_prune: bool,
    /// Take what a scene asks of its device beyond what is passive for an error
    #[arg(long)]
    pub strict: bool,
    #[command(flatten)]
    pub plugins: PluginArgs,
}

/// Plugins to load.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct PluginArgs {
    /// Load a plugin: its file, or its name to be found along ASPERITY_PLUGIN_PATH
    #[arg(long = "plugin", value_name = "P")]
    pub plugin: Vec<PathBuf>,
}

/// Sample formats of a WAV file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// 32-bit float
    F32,
    /// 24-bit integer
    I24,
    /// 16-bit integer
    I16,
}

/// `asperity render`
#[derive(Clone, Debug, clap::Args)]
pub struct Render {
    #[command(flatten)]
    pub graph: GraphArgs,
    /// Where the samples of `audio_out` go: a .wav, or a .npy file
    #[arg(long, value_name = "OUT.wav")]
    pub out: Option<PathBuf>,
    /// Sample format of the WAV file
    #[arg(long, value_enum, default_value = "f32")]
    pub format: Format,
    /// How long to render; as long as the stroke lasts, unless given
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub seconds: Option<f64>,
    /// Write figures of the run as JSON
    #[arg(long, value_name = "R.json")]
    pub report: Option<PathBuf>,
    /// Record an output of a node
    #[arg(long, value_name = "NODE.PORT=FILE.csv|.npy")]
    pub probe: Vec<String>,
    /// Draw position, speed, force, acceleration, current and a spectrogram
    #[arg(long, value_name = "P.svg")]
    pub plot: Option<PathBuf>,
    /// Run every node in every tick, also those behind a closed gate
    #[arg(long)]
    pub no_sleep: bool,
    /// Longest that one call of a node may take; a longer one is a fault of the node, which is faded out. Without it there is no
    /// limit, with --watch one of 10 ticks
    #[arg(long, value_name = "US", value_parser = number::whole(1_u64, 10_000_000, "us"))]
    pub limit_us: Option<u64>,
    /// Run in real time, and take changes of the graph, its plugins and the files it reads over as they come
    #[arg(long)]
    pub watch: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
}

/// `asperity check`
#[derive(Debug, clap::Args)]
pub struct Check {
    #[command(flatten)]
    pub graph: GraphArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `asperity nodes`
#[derive(Debug, clap::Args)]
pub struct Nodes {
    /// Describe this kind
    pub kind: Option<String>,
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `asperity graph`
#[derive(Debug, clap::Args)]
pub struct Graph {
    #[command(flatten)]
    pub graph: GraphArgs,
    /// Where the picture goes
    #[arg(long, value_name = "F.svg")]
    pub svg: PathBuf,
}

/// `asperity invert`
#[derive(Debug, clap::Args)]
pub struct Invert {
    /// The node: KIND, or KIND:param=value,... ; `default` is that of graphs/texture.ron; offline griffin_lim, fast_griffin_lim
    #[arg(long, value_name = "KIND[:param=value,...]", default_value = "default")]
    pub phase: String,
    /// Magnitudes, float32 [frames, bins], 2 ms apart, bin 0 first, of an unscaled Hann-windowed DFT of 0.1 s
    #[arg(long, value_name = "S.npy")]
    pub magnitudes: PathBuf,
    /// Sample rate of the signal
    #[arg(long, value_name = "HZ")]
    pub rate: u32,
    /// Where the signal goes: a .wav (float) or .npy file; frame n covers samples [floor(n rate/500), + N)
    #[arg(long, value_name = "Y.wav|.npy")]
    pub out: PathBuf,
    /// Seed of random numbers
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    #[command(flatten)]
    pub plugins: PluginArgs,
}

/// `asperity compare`
#[derive(Debug, clap::Args)]
pub struct Compare {
    /// Folder of vectors, NAME_RATE.mag.npy (float32 [frames, bins], unscaled Hann-windowed DFTs of 0.1 s, 2 ms apart) or
    /// NAME_RATE.sig.npy (a signal), and sc.json with published scores; a small set is built in
    #[arg(long, value_name = "DIR")]
    pub vectors: Option<PathBuf>,
    /// A node with settings, as a row of its own beside those with all defaults
    #[arg(long, value_name = "KIND[:param=value,...]")]
    pub phase: Vec<String>,
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Draw all figures
    #[arg(long, value_name = "F.svg")]
    pub svg: Option<PathBuf>,
    /// Write all figures, a line for each method and vector
    #[arg(long, value_name = "F.csv", conflicts_with = "json")]
    pub csv: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Show no progress
    #[arg(long, short)]
    pub quiet: bool,
}

/// What is checked of a plugin.
#[derive(Clone, Debug, clap::Args)]
pub struct Cases {
    /// The plugin: its file, or its name
    #[arg(value_name = "FILE")]
    pub plugin: String,
    /// Check this kind of node only
    #[arg(long, value_name = "KIND")]
    pub kind: Option<String>,
    /// Run this case only; may be given more than once
    #[arg(long = "case", value_name = "CASE")]
    pub case: Vec<String>,
    /// Set a parameter of the kinds that have it, such as one that must be set
    #[arg(long = "set", value_name = "PARAM=VALUE")]
    pub set: Vec<String>,
    /// How many random ticks there are
    #[arg(long, value_name = "N", default_value_t = 100_000)]
    pub ticks: u64,
}

/// `asperity plugin check`
#[derive(Debug, clap::Args)]
pub struct CheckPlugin {
    #[command(flatten)]
    pub cases: Cases,
    /// How long the plugin may take to answer a call, or a few, before it is given up
    #[arg(long, value_name = "S", default_value_t = 10)]
    pub patience: u64,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// The process in which the cases run.
#[derive(Debug, clap::Args)]
pub struct CasesOfPlugin {
    #[command(flatten)]
    pub cases: Cases,
    /// So many of the cases have been run
    #[arg(long, default_value_t = 0)]
    pub skip: usize,
}

/// `asperity run`
#[derive(Clone, Debug, clap::Args)]
pub struct Run {
    #[command(flatten)]
    pub graph: GraphArgs,
    #[command(flatten)]
    pub device: DeviceArgs,
    /// How long to run; as long as the stroke lasts or until Ctrl-C, unless given
    #[arg(long, value_name = "S", value_parser = number::number(1e-3, 31_536_000.0, "s"))]
    pub seconds: Option<f64>,
    /// Serve the live page, at a port of the computer's choice unless one is given
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0",
        value_parser = number::whole(0, u16::MAX, ""))]
    pub page: Option<u16>,
    /// Show the run in the terminal
    #[arg(long)]
    pub tui: bool,
    /// Take changes of the graph, its plugins and the files it reads over as they come
    #[arg(long)]
    pub watch: bool,
    /// Write figures of the run as JSON
    #[arg(long, value_name = "R.json")]
    pub report: Option<PathBuf>,
    /// Run every node in every tick, also those behind a closed gate
    #[arg(long)]
    pub no_sleep: bool,
    /// Longest that one call of a node may take; a longer one is a fault of the node, which is faded out. 10 ticks, unless given
    #[arg(long, value_name = "US", value_parser = number::whole(1_u64, 10_000_000, "us"))]
    pub limit_us: Option<u64>,
    /// Call nodes of plugins on the thread that ticks: some 50 us less for each, but one that never returns ends the sound
    #[arg(long)]
    pub in_place: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
}

/// `asperity devices`
#[derive(Debug, clap::Args)]
pub struct Devices {
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}
