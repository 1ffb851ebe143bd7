//! Every command that writes files.

use std::path::Path;
use std::process::Command;

use asperity_accuracy::npy;
use asperity_texture::{Library, LibraryMaterial};
use harness::{asperity, graphs};

use crate::files::encoder;

/// A command, and the files that it makes.
pub(super) struct Writer {
    pub(super) name: &'static str,
    /// Puts what it reads into a folder.
    pub(super) prepare: fn(&Path),
    /// Arguments of the program, between which stand spaces; of a mutant a line of the shell.
    line: &'static str,
    pub(super) makes: &'static [Made],
    /// Whether it plays in real time, so that what it writes differs from run to run.
    pub(super) live: bool,
}

impl Writer {
    /// The command, which is run in that folder.
    pub(super) fn command(&self, dir: &Path) -> Command {
        if self.name == MUTANT {
            let mut command = Command::new("sh");
            command.args(["-c", self.line]);
            return command;
        }
        let mut command = asperity(dir);
        // The list of what was made is kept where it can be; here it is not, so that the files alone are
        // counted.
        command.args(self.line.split(' ')).env("XDG_STATE_HOME", "/dev/null");
        command
    }
}

/// A file or folder that a command makes, and how one sees that it is whole.
pub(super) struct Made {
    pub(super) name: &'static str,
    pub(super) whole: fn(&Path) -> bool,
    pub(super) folder: bool,
}

const fn file(name: &'static str, whole: fn(&Path) -> bool) -> Made {
    Made { name, whole, folder: false }
}

/// A command that does not play.
const fn writer(
    name: &'static str,
    prepare: fn(&Path),
    line: &'static str,
    makes: &'static [Made],
) -> Writer {
    Writer { name, prepare, line, makes, live: false }
}

const GRAPH: &str = r#"Graph(
    version: 1,
    nodes: {
        "tone": (kind: "sine", params: (frequency_hz: 80, amplitude: 0.1)),
        "kept": (kind: "file_out", params: (file: "kept.npy")),
        "limiter": (kind: "limiter", params: (profile: "hapcoil_one")),
        "probe": (kind: "probe", params: (file: "seen.csv")),
        "packed": (kind: "probe", params: (file: "packed.npz")),
        "out": (kind: "audio_out"),
    },
    wires: [
        ("tone", "kept"), ("tone", "limiter"), ("limiter", "out"), ("limiter", "probe"),
        ("limiter", "packed"),
    ],
)
"#;

const SCENE: &str = r#"Scene(
    version: 1, input: stroke(duration_s: 1), output: audio_out,
    surfaces: {"wall": (shape: plane, effects: (stiffness: (stiffness_n_per_mm: 0.5),
    vibration: (frequency_hz: 150, amplitude_m_s2: 3)))},
)
"#;

fn write(dir: &Path, name: &str, bytes: impl AsRef<[u8]>) {
    std::fs::write(dir.join(name), bytes).expect("a file");
}

fn graph(dir: &Path) {
    write(dir, "g.ron", GRAPH);
}

fn magnitudes(dir: &Path) {
    let file = std::fs::File::create(dir.join("m.npy")).expect("a file");
    npy::write_f32(file, &[120, 101], &[0.5; 12_120]).expect("a file");
}

/// Two seconds of a stroke at one speed, over what is nearly noise.
fn recording(dir: &Path) {
    let mut text = String::from("t_s,force_n,speed_mm_s,acceleration_m_s2\n");
    let mut last = 0.0;
    for n in 0..2000 {
        last = 0.6 * last + 2.0 * asperity_node::random::uniform(5, n) - 1.0;
        text.push_str(&format!("{:.3},1.0,100.0,{last:.6}\n", n as f64 / 1000.0));
    }
    write(dir, "s.csv", text);
}

/// Two settings of the shipped texture, over a short stroke.
fn tradeoff(dir: &Path) {
    let graph = graphs("texture.ron").canonicalize().expect("the shipped graph");
    let text = format!(
        r#"Tradeoff(
            version: 1, graph: {graph:?},
            strokes: [(name: "circle", shape: circle, speed_mm_s: 80.0, seconds: 0.5, approach_s: 0.1)],
            materials: ["canvas"], strength: 0.25, steps: 10,
            grids: [(name: "frames", knobs: {{"texture.bins": [50]}})],
            times: (turns: 2, turn_ms: 20, batch: 2),
        )"#
    );
    write(dir, "tradeoff.ron", text);
}

fn library(dir: &Path) {
    write(dir, "e.onnx", encoder());
    let vector = Box::new(std::array::from_fn(|n| n as f32 / 256.0));
    let material = LibraryMaterial {
        name: "middle".into(),
        description: "Made for a test.".into(),
        family: None,
        images: Vec::new(),
        image_mm: None,
        pattern: Default::default(),
        vector,
    };
    write(dir, "l.ron", Library::new(dir.join("l.ron"), Some("e.onnx".into()), vec![material]).to_ron());
    let stripes = |x: u32, _| image::Rgb([if x % 4 < 2 { 80 } else { 100 }; 3]);
    image::RgbImage::from_fn(256, 192, stripes).save(dir.join("felt.png")).expect("a picture");
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_default()
}

/// Ends as a file of lines does, and its last line is no shorter than the first.
fn is_table(path: &Path) -> bool {
    let text = text(path);
    // What is quoted may have commas.
    let commas = |line: &str| line.split('"').step_by(2).map(|part| part.matches(',').count()).sum::<usize>();
    let [first, last] = [text.lines().next(), text.lines().last()].map(|line| line.map_or(0, commas));
    text.ends_with('\n') && first > 0 && last == first
}

fn is_picture(path: &Path) -> bool {
    text(path).trim_start().starts_with("<svg") && text(path).trim_end().ends_with("</svg>")
}

fn is_json(path: &Path) -> bool {
    serde_json::from_str::<serde_json::Value>(&text(path)).is_ok()
}

fn is_array(path: &Path) -> bool {
    npy::read(path).is_ok_and(|array| !array.values.is_empty())
}

fn is_archive(path: &Path) -> bool {
    npy::Archive::read(path).is_ok_and(|archive| matches!(archive.array("signal"), Ok(Some(_))))
}

/// Its header says as many bytes as there are.
fn is_sound(path: &Path) -> bool {
    let bytes = std::fs::read(path).unwrap_or_default();
    let size = bytes.get(4..8).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    size == Some(bytes.len().wrapping_sub(8)) && hound::WavReader::new(&*bytes).is_ok_and(|wav| wav.len() > 0)
}

fn is_ron(path: &Path) -> bool {
    let source = asperity_diagnostics::Source::read(path);
    source.is_ok_and(|source| asperity_diagnostics::ron::parse(&source).is_ok())
}

fn is_library(path: &Path) -> bool {
    Library::read(path).is_ok_and(|library| library.material("felt").is_ok())
}

/// Its last section is the last there is to say, and its last line is whole.
fn is_report(path: &Path) -> bool {
    let text = text(path);
    text.ends_with("\n") && text.lines().last().is_some_and(|line| line.starts_with("- noise floor"))
}

/// A digest, then finished parts. The last line of a killed run may be unfinished, and is ignored.
fn is_progress(path: &Path) -> bool {
    let text = text(path);
    let whole = text.rsplit_once('\n').map_or("", |(whole, _)| whole);
    let json = |line: &str| serde_json::from_str::<serde_json::Value>(line).is_ok();
    path.is_file() && whole.lines().skip(1).all(json)
}

/// A crate that has all that cargo wants.
fn is_plugin(path: &Path) -> bool {
    text(&path.join("Cargo.toml")).ends_with('\n') && !text(&path.join("src/lib.rs")).is_empty()
}

/// Files of a trade-off: two pictures of each figure, its results, and the file that it resumes from.
macro_rules! tradeoff {
    ($($figure:literal)*) => {
        [
            $(
                file(concat!($figure, "_time.svg"), is_picture),
                file(concat!($figure, "_lag.svg"), is_picture),
            )*
            file("results.csv", is_table),
            file("results.json", is_json),
            file("REPORT.md", is_report),
            file("progress.jsonl", is_progress),
        ]
    };
}

/// Only gratings have a pitch.
static TRADEOFF: [Made; 26] = tradeoff!("pitch" "spectrum" "perceptual" "modulation" "repetition" "kurtosis"
    "steadiness" "bands" "level" "convergence" "precision");

/// Files of mutants: `out` is a copy of `new`, by the shell.
const MUTANT_MAKES: &[Made] =
    &[file("out", |path| std::fs::read(path).is_ok_and(|bytes| bytes == [b'n'; 1000]))];

const MUTANT: &str = "mutant";

/// A mutant that a line of the shell makes of `new`.
pub(super) fn mutant(line: &'static str) -> Writer {
    writer(MUTANT, |dir| write(dir, "new", [b'n'; 1000]), line, MUTANT_MAKES)
}

/// All of them, but for the training of models, which is another program.
pub(super) static WRITERS: [Writer; 12] = [
    writer(
        "render",
        graph,
        "render --overwrite g.ron --seconds 0.3 --out o.wav --plot p.svg --report r.json --quiet",
        &[
            file("o.wav", is_sound),
            file("p.svg", is_picture),
            file("r.json", is_json),
            file("kept.npy", is_array),
            file("seen.csv", is_table),
            file("packed.npz", is_archive),
        ],
    ),
    writer(
        "invert",
        magnitudes,
        "invert --phase spsi --magnitudes m.npy --rate 5000 --scale dft --out y.npy",
        &[file("y.npy", is_array)],
    ),
    writer(
        "compare",
        |dir| {
            std::fs::create_dir(dir.join("v")).expect("a folder");
            magnitudes(dir);
            std::fs::rename(dir.join("m.npy"), dir.join("v/flat_5000.mag.npy")).expect("a file");
        },
        "compare --vectors v --svg c.svg --csv c.csv --quiet",
        &[file("c.svg", is_picture), file("c.csv", is_table)],
    ),
    writer("graph", graph, "graph g.ron --svg g.svg", &[file("g.svg", is_picture)]),
    writer(
        "scene expand",
        |dir| write(dir, "s.ron", SCENE),
        "scene expand s.ron --out x.ron",
        &[file("x.ron", is_ron)],
    ),
    writer(
        "fit-ar",
        recording,
        "fit-ar s.csv --order 4 --out t.ron --plot t.svg",
        &[file("t.ron", is_ron), file("t.svg", is_picture)],
    ),
    writer(
        "encode",
        library,
        "encode --library l.ron felt.png --description Felt.",
        &[file("l.ron", is_library)],
    ),
    writer("plugin new", |_| (), "plugin new mine", &[Made { name: "mine", whole: is_plugin, folder: true }]),
    Writer {
        live: true,
        ..writer(
            "calibrate",
            |_| (),
            "calibrate --device simulated:frames=64,latency=200,speed=10,plant=haptuator_mark_ii,\
             plant_handle_g=60 --accelerometer-full-scale 100 --base haptuator_mark_ii --out a.ron \
             --plot a.svg --handle-mass-g 60 --seconds 2",
            &[file("a.ron", is_ron), file("a.svg", is_picture)],
        )
    },
    Writer {
        live: true,
        ..writer(
            "run",
            graph,
            "run g.ron --overwrite --device simulated:frames=64 --seconds 1 --quiet --report r.json",
            &[
                file("r.json", is_json),
                file("kept.npy", is_array),
                file("seen.csv", is_table),
                file("packed.npz", is_archive),
            ],
        )
    },
    Writer {
        live: true,
        ..writer(
            "tradeoff",
            tradeoff,
            "tradeoff tradeoff.ron --out . --no-cases --quiet",
            TRADEOFF.split_at(2).1,
        )
    },
    writer(
        "tradeoff merge",
        |dir| {
            std::fs::create_dir(dir.join("shard")).expect("a folder");
            let results = graphs("tradeoffs/results.json");
            std::fs::copy(results, dir.join("shard/results.json")).expect("the shipped results");
        },
        "tradeoff merge shard --out .",
        TRADEOFF.split_at(TRADEOFF.len() - 1).0,
    ),
];

/// A file that is cut anywhere is not taken for a whole one.
#[test]
fn a_file_that_is_cut_is_not_taken_for_whole() {
    let dir = tempfile::tempdir().expect("a folder");
    for writer in WRITERS.iter().filter(|writer| !writer.live && writer.name != "plugin new") {
        let place = super::disk::Place::new(writer, false);
        place.run(writer, super::disk::Fails::Never);
        for made in writer.makes {
            let bytes = std::fs::read(place.dir.path().join(made.name))
                .unwrap_or_else(|e| panic!("{}: {e}", made.name));
            let cut = dir.path().join(made.name);
            for part in 0..8 {
                let bytes = &bytes[..bytes.len() * part / 8];
                // A table that is cut behind a row is whole, for all that it says.
                std::fs::write(&cut, bytes.strip_suffix(b"\n").unwrap_or(bytes)).expect("a file");
                assert!(!(made.whole)(&cut), "{}: {part} eighths of {}", writer.name, made.name);
            }
            std::fs::write(&cut, &bytes).expect("a file");
            assert!((made.whole)(&cut), "{}: all of {}", writer.name, made.name);
        }
    }
}
