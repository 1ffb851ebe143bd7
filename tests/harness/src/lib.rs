//! Helpers of the test programs: the program driven as a user drives it, and graphs run in this process.
//!
//! `live`, `servers` and `chromium` are for real time; [`alone`] keeps such tests from running at once.
#![allow(missing_docs, reason = "most helpers say it all by their name")]

pub mod alone;
pub mod any_node;
pub mod chromium;
pub mod counting;
pub mod graph;
pub mod live;
#[path = "../../../core/texture/src/tests/networks.rs"]
pub mod networks;
pub mod nodes;
pub mod plugins;
pub mod retrieval;
mod room;
pub mod servers;
pub mod stage;
pub mod survival;

pub use asperity_texture::onnx;
pub use room::Room;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// All built-in kinds.
pub fn registry() -> asperity_node::Registry {
    asperity_hand::register(asperity_nodes::registry())
}

/// Ends a program by a signal after so much processor time \[s\]. A clock would measure the machine's other
/// work, too.
pub fn most_cpu_s(command: &mut Command, seconds: u64) {
    #[cfg(unix)]
    {
        use std::os::unix::process::CommandExt;
        let limit = move || {
            let limit = libc::rlimit { rlim_cur: seconds, rlim_max: seconds };
            // SAFETY: a limit on the stack, for this process alone. Nothing is allocated.
            match unsafe { libc::setrlimit(libc::RLIMIT_CPU, &limit) } {
                0 => Ok(()),
                _ => Err(std::io::Error::last_os_error()),
            }
        };
        // SAFETY: the closure calls one function, which is safe to call between fork and exec.
        unsafe { command.pre_exec(limit) };
    }
    #[cfg(not(unix))]
    let _ = (command, seconds);
}

/// The repository's root.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A shipped file.
pub fn graphs(path: &str) -> PathBuf {
    root().join("graphs").join(path)
}

/// The learned texture with phase retrieval, which has settings to turn.
pub fn retrieving() -> PathBuf {
    root().join("tests/data/sample_commit.ron")
}

/// The program under test. Cargo puts it two folders above the test programs.
pub fn program() -> PathBuf {
    let this = std::env::current_exe().expect("the path of this test program");
    let folder = this.ancestors().nth(2).expect("cargo's folder of a profile");
    folder.join(format!("asperity{}", std::env::consts::EXE_SUFFIX))
}

/// A folder in cargo's target folder for files of tests.
pub fn scratch() -> PathBuf {
    program().ancestors().nth(2).expect("cargo's target folder").join("tmp")
}

/// The program, in a folder.
pub fn asperity(dir: &Path) -> Command {
    let mut command = Command::new(program());
    // Coils are remembered only where a test asks for it. What is made is, and plugins of the tests may be
    // loaded.
    command.current_dir(dir).env("ASPERITY_STATE", "").env("ASPERITY_TRUST", trusted());
    command.env("XDG_STATE_HOME", scratch().join("state")).env("XDG_DATA_HOME", scratch().join("data"));
    command
}

/// Where tests build plugins.
fn trusted() -> std::ffi::OsString {
    let program = program();
    std::env::join_paths([&std::env::temp_dir(), program.parent().expect("a folder"), &root()])
        .expect("a list")
}

/// Exit code and messages of a run.
pub struct Ran {
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl Ran {
    pub fn of(output: &Output) -> Self {
        let [out, err] =
            [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
        Self { code: output.status.code().unwrap_or(-1), out, err }
    }

    pub fn ok(self) -> Self {
        assert_eq!(self.code, 0, "stdout: {}\nstderr: {}", self.out, self.err);
        self
    }

    /// Checks that output and messages contain these texts.
    #[track_caller]
    pub fn says(self, texts: &[&str]) -> Self {
        let said = format!("{}{}", self.out, self.err);
        let missing = texts.iter().find(|text| !said.contains(**text));
        assert!(missing.is_none(), "no {missing:?} in: {said}");
        self
    }

    /// Checks its exit code, and that output and messages contain these texts.
    #[track_caller]
    pub fn ends(self, code: i32, texts: &[&str]) -> Self {
        assert_eq!(self.code, code, "stdout: {}\nstderr: {}", self.out, self.err);
        self.says(texts)
    }

    /// The JSON that it printed.
    #[track_caller]
    pub fn json(self) -> serde_json::Value {
        let ran = self.ok();
        serde_json::from_str(&ran.out).unwrap_or_else(|e| panic!("{e}: {}", ran.out))
    }

    /// Checks that the program refused its input for this reason.
    #[track_caller]
    pub fn refused(self, why: &str) -> Self {
        let (code, out, err) = (self.code, &self.out, &self.err);
        let meant = code == 2 && err.contains(why) && !err.contains("panicked at");
        assert!(meant, "exit code {code}; wanted 2 and `{why}`: {err}\nstdout: {out}");
        self
    }
}

/// Runs the program to its end, with arguments separated by spaces.
pub fn run_line(dir: &Path, line: &str) -> Ran {
    run(dir, &line.split_whitespace().collect::<Vec<_>>())
}

/// Runs the program to its end.
pub fn run(dir: &Path, args: &[&str]) -> Ran {
    Ran::of(&asperity(dir).args(args).output().expect("the program starts"))
}

/// Runs the program to its end under limits of the shell, such as `ulimit -n 5`.
pub fn run_under(dir: &Path, limits: &str, args: &[&str]) -> Ran {
    let program = asperity(dir);
    let mut command = Command::new("bash");
    command.current_dir(dir).env("ASPERITY_STATE", "").args(["-c", &format!("{limits}; exec \"$0\" \"$@\"")]);
    command.arg(program.get_program()).args(args).stdin(Stdio::null());
    Ran::of(&command.output().expect("bash"))
}

/// A trajectory at 500 Hz from a function of time to x, y, z.
pub fn csv(seconds: f64, at: impl Fn(f64) -> [f64; 3]) -> String {
    csv_at(500, seconds, at)
}

/// The same at another rate.
pub fn csv_at(rate_hz: u32, seconds: f64, at: impl Fn(f64) -> [f64; 3]) -> String {
    let mut text = String::from("t_s,x_mm,y_mm,z_mm\n");
    for k in 0..=(seconds * f64::from(rate_hz)) as usize {
        let t = k as f64 / f64::from(rate_hz);
        let [x, y, z] = at(t);
        text.push_str(&format!("{t},{x},{y},{z}\n"));
    }
    text
}

/// Texts of an SVG picture that say something without a number.
pub fn words_of(svg: &str) -> impl Iterator<Item = &str> {
    let texts = svg.split("</text>").map(|text| text.rsplit('>').next().unwrap_or_default());
    texts.filter(|text| {
        text.chars().filter(|c| c.is_alphabetic()).count() > 1 && !text.contains(|c: char| c.is_ascii_digit())
    })
}

/// Files in a folder, hidden ones too, sorted.
pub fn files(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(dir)
        .expect("a folder")
        .map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Parameters with which the nodes of effects have something to do, as a graph file says them; none of
/// other kinds.
pub fn effects(kind: &str) -> Vec<(&'static str, String)> {
    let ar = |name: &str, gain: &str| {
        let file = graphs("models/made_ar").join(name).display().to_string();
        format!("autoregressive(model: {file:?}, gain: {gain})")
    };
    let relief = |gain: f64| {
        format!("relief(heights: made(surface: \"hessian\", side: 32, step_mm: 0.1), gain: {gain:?})")
    };
    let tap =
        |hz: f64| format!("(sinusoids: [(frequency_hz: {hz:?}, decay_ms: 30, gain: 40)], min_speed_mm_s: 0)");
    let sine = |hz: f64| format!("(frequency_hz: {hz:?}, amplitude_m_s2: 2)");
    let lap = "waveform(segments: [(0, 0), (0.3, 1), (1, 0)])".to_owned();
    let laps = format!("[{lap}, waveform(segments: [(0, 0), (1, 1), (2, 0)], gain: 2)]");
    let two = format!("[{}, {}]", ar("smooth.ron", "1"), ar("ringing.ron", "0.5"));
    let owned = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect();
    let (name, texts): (_, Vec<String>) = match kind {
        "friction" => ("laws", owned(&["lugre(static_coefficient: 0.6)", "dahl", "viscous_coulomb"])),
        "viscosity" => ("drags", owned(&["(viscosity_ns_per_m: 2)", "(viscosity_ns_per_m: 900)"])),
        "magnet" => ("magnets", owned(&["(stiffness_n_per_mm: 0.5, max_force_n: 0.4, reach_mm: 3)"])),
        "tap" => ("taps", [200.0, 340.0, 90.0].map(tap).into()),
        "vibration" => ("sources", [120.0, 80.5].map(sine).into()),
        "autoregressive" => ("models", vec![ar("rough.ron", "1"), two]),
        "waveform" => ("loops", vec![lap, laps]),
        "relief" => ("reliefs", [1.0, 2.0].map(relief).into()),
        "clip" => return vec![("file", graphs("clips/canvas.wav").display().to_string())],
        "force_limiter" => return vec![("slew_n_per_s", "10".into())],
        _ => return Vec::new(),
    };
    vec![(name, format!("{texts:?}"))]
}

/// The shipped graph with absolute paths, so that it can be edited anywhere.
pub fn shipped_graph() -> String {
    shipped("heravi2024.ron")
}

/// A shipped graph by its file, with absolute paths.
pub fn shipped(file: &str) -> String {
    let text = std::fs::read_to_string(graphs(file)).expect("a shipped graph");
    let dir = graphs("").display().to_string();
    ["trajectories/", "models/", "materials/"]
        .iter()
        .fold(text, |t, p| t.replace(&format!("\"{p}"), &format!("\"{dir}{p}")))
}

/// Samples of a float WAV file, and its rate.
pub fn wav(path: &Path) -> (Vec<f32>, u32) {
    let mut reader = hound::WavReader::open(path).expect("a WAV file");
    let rate = reader.spec().sample_rate;
    (reader.samples::<f32>().map(|s| s.expect("a sample")).collect(), rate)
}

/// A JSON file.
pub fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).expect("a file")).expect("JSON")
}

/// A node of a report, by its id or kind.
pub fn node<'a>(report: &'a serde_json::Value, name: &str) -> &'a serde_json::Value {
    let nodes = report["nodes"].as_array().expect("nodes");
    nodes.iter().find(|n| n["id"] == name || n["kind"] == name).unwrap_or_else(|| panic!("no {name}"))
}
