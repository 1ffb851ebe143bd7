//! Files that the program reads, damaged by seed.

use std::fs;
use std::path::Path;

use harness::{asperity, graphs, root, shipped_graph};

use super::judge::{Seed, Tally, times, two_at_a_time};

/// A reader: the file's name, what is right, the command that reads it (`{}`), what that writes, and how many
/// mutants.
pub struct Reader {
    pub name: &'static str,
    pub right: fn() -> Vec<u8>,
    pub args: fn(&str) -> Vec<String>,
    pub outputs: &'static [&'static str],
    pub mutants: u64,
}

fn words(line: &str) -> Vec<String> {
    line.split(' ').map(str::to_owned).collect()
}

fn shipped(path: &str) -> Vec<u8> {
    fs::read(graphs(path)).expect("a shipped file")
}

fn graph() -> String {
    graphs("heravi2024.ron").display().to_string()
}

/// A scene with whole paths, so that it stands anywhere.
fn scene() -> Vec<u8> {
    let text = String::from_utf8(shipped("scenes/side_by_side.ron")).expect("text");
    text.replace("\"../", &format!("\"{}/", graphs("").display())).into_bytes()
}

/// Force, speed and acceleration of 3 s at 1 kHz.
fn recording() -> Vec<u8> {
    let mut text = String::from("t_s,force_n,speed_mm_s,acceleration_m_s2\n");
    let mut noise = Seed(5);
    for n in 0..3000 {
        let x = (noise.next() >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
        text.push_str(&format!("{},1.0,80,{x:.4}\n", f64::from(n) / 1000.0));
    }
    text.into_bytes()
}

/// The header and some samples of a recording that a killed run left.
fn left_recording() -> Vec<u8> {
    let mut to = std::io::Cursor::new(Vec::new());
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 48_000,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::new(&mut to, spec).expect("a writer");
    (0..2000).for_each(|n| writer.write_sample(n as f32 * 1e-4).expect("room"));
    writer.finalize().expect("room");
    to.into_inner()
}

pub const READERS: [Reader; 13] = [
    Reader {
        name: "g.ron",
        right: || shipped_graph().into_bytes(),
        args: |f| words(&format!("check {f}")),
        outputs: &[],
        mutants: 400,
    },
    Reader {
        name: "g.ron",
        right: || shipped_graph().into_bytes(),
        args: |f| words(&format!("render {f} --seconds 0.05 --out o.wav")),
        outputs: &["o.wav"],
        mutants: 150,
    },
    Reader {
        name: "s.ron",
        right: scene,
        args: |f| words(&format!("check {f}")),
        outputs: &[],
        mutants: 200,
    },
    Reader {
        name: "l.ron",
        right: || shipped("models/surfaces/materials.ron"),
        args: |f| words(&format!("materials --library {f}")),
        outputs: &[],
        mutants: 100,
    },
    Reader {
        name: "p.ron",
        right: || shipped("actuators/hapcoil_one.ron"),
        args: |f| words(&format!("check {} --set limiter.profile={f} --set inverse.profile={f}", graph())),
        outputs: &[],
        mutants: 200,
    },
    Reader {
        name: "t.csv",
        right: || shipped("trajectories/zigzag.csv"),
        args: |f| words(&format!("render {} --input {f} --seconds 0.05 --out o.wav", graph())),
        outputs: &["o.wav"],
        mutants: 100,
    },
    Reader {
        name: "m.npy",
        right: || fs::read(root().join("tests/data/phase/texture_2500.mag.npy")).expect("a vector"),
        args: |f| words(&format!("invert --magnitudes {f} --rate 2500 --out o.npy")),
        outputs: &["o.npy"],
        mutants: 150,
    },
    Reader {
        name: "n.onnx",
        right: || shipped("models/surfaces/texture.onnx"),
        args: |f| words(&format!("check {} --set texture.model={f}", graph())),
        outputs: &[],
        mutants: 80,
    },
    Reader {
        name: "e.onnx",
        right: || shipped("models/surfaces/encoder.onnx"),
        args: |f| {
            let library = graphs("models/surfaces/materials.ron");
            words(&format!("encode --dry-run --library {} --encoder {f} {}", library.display(), picture()))
        },
        outputs: &[],
        mutants: 40,
    },
    Reader {
        name: "i.jpg",
        right: || fs::read(picture()).expect("a picture"),
        args: |f| {
            words(&format!(
                "encode --dry-run --library {} {f}",
                graphs("models/surfaces/materials.ron").display()
            ))
        },
        outputs: &[],
        mutants: 40,
    },
    Reader {
        name: "r.json",
        right: || fs::read(root().join("graphs/tradeoffs/results.json")).expect("results"),
        args: |f| words(&format!("choose {f} --budget-us 100")),
        outputs: &[],
        mutants: 150,
    },
    Reader {
        name: "r.csv",
        right: recording,
        args: |f| words(&format!("fit-ar {f} --out o.ron")),
        outputs: &["o.ron"],
        mutants: 60,
    },
    Reader {
        name: "k.wav.recording",
        right: left_recording,
        args: |f| words(&format!("recover {f}")),
        outputs: &["k.wav.recording", "k.wav"],
        mutants: 150,
    },
];

fn picture() -> String {
    let mut all: Vec<_> = fs::read_dir(graphs("models/surfaces/pictures"))
        .expect("pictures")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == "jpg"))
        .collect();
    all.sort();
    all[0].display().to_string()
}

/// Text that replaces a number.
const NUMBERS: [&str; 12] = [
    "0",
    "-1",
    "NaN",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e-320",
    "18446744073709551616",
    "99999999999999999999999",
    "0x10",
    "--1",
];
/// Text inserted between two characters.
const WORDS: [&str; 10] = ["(", ")", "[", "{", "\"", "\u{202e}", "\0", "\u{feff}", "//", ","];

/// Damages a file.
pub fn mutated(right: &[u8], seed: &mut Seed) -> Vec<u8> {
    let mut bytes = right.to_vec();
    for _ in 0..1 + seed.below(3) {
        if bytes.is_empty() {
            break;
        }
        let at = seed.below(bytes.len());
        let some = (1 + seed.below(64)).min(bytes.len() - at);
        match seed.below(10) {
            0 => bytes[at] ^= 1 << seed.below(8),
            1 => bytes[at] = seed.next() as u8,
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at..at + some)),
            4 => {
                let chunk = bytes[at..at + some].to_vec();
                let many = 1 + seed.below(200);
                bytes.splice(at..at, chunk.repeat(many));
            }
            5 => {
                let nesting = seed.of(&WORDS).repeat(1 + seed.below(5000));
                bytes.splice(at..at, nesting.into_bytes());
            }
            6 => drop(bytes.splice(at..at, seed.of(&WORDS).bytes())),
            7 | 8 => number(&mut bytes, at, NUMBERS[seed.below(NUMBERS.len())]),
            _ => {
                let end = bytes.len();
                bytes[..end].rotate_left(some);
            }
        }
    }
    bytes
}

/// Puts something in the place of the next number.
fn number(bytes: &mut Vec<u8>, at: usize, with: &str) {
    let is = |b: &u8| b.is_ascii_digit() || b".-".contains(b);
    let Some(start) = bytes[at..].iter().position(u8::is_ascii_digit).map(|i| at + i) else { return };
    let end = bytes[start..].iter().position(|b| !is(b)).map_or(bytes.len(), |i| start + i);
    bytes.splice(start..end, with.bytes());
}

#[test]
fn damaged_file_is_refused_or_read_and_nothing_else() {
    let tally = Tally::new("damaged files");
    for reader in &READERS {
        let right = (reader.right)();
        two_at_a_time(reader.mutants * times(), |number| {
            let dir = tempfile::tempdir().expect("a folder");
            let bytes = mutated(&right, &mut Seed(number.wrapping_mul(0x1_0001)));
            fs::write(dir.path().join(reader.name), bytes).expect("a file");
            let mut program = asperity(dir.path());
            program.args((reader.args)(reader.name));
            tally.case(&format!("{} {number}", reader.name), dir, program, reader.outputs);
        });
    }
    tally.done();
}

#[test]
fn undamaged_file_is_read() {
    for reader in &READERS {
        let dir = tempfile::tempdir().expect("a folder");
        fs::write(dir.path().join(reader.name), (reader.right)()).expect("a file");
        let out = asperity(dir.path()).args((reader.args)(reader.name)).output().expect("it starts");
        assert!(out.status.success(), "{}: {}", reader.name, String::from_utf8_lossy(&out.stderr));
        assert!(
            reader.outputs.iter().all(|o| *o == reader.name || dir.path().join(o).exists()),
            "{}",
            reader.name
        );
    }
}

/// Of this program's own lists nothing is believed.
#[test]
fn damaged_list_of_the_person_is_no_harm() {
    let tally = Tally::new("damaged lists");
    two_at_a_time(40 * times(), |number| {
        let dir = tempfile::tempdir().expect("a folder");
        let mut seed = Seed(number);
        let right = format!("{}\n/nowhere\n12 34 {}\n", dir.path().display(), dir.path().display());
        for list in ["config/asperity/trusted", "state/asperity/made"] {
            let list = dir.path().join(list);
            fs::create_dir_all(list.parent().unwrap_or(Path::new("."))).expect("a folder");
            fs::write(list, mutated(right.as_bytes(), &mut seed)).expect("a list");
        }
        fs::write(
            dir.path().join("g.ron"),
            r#"Graph(version: 1, plugins: ["x/none.so"], nodes: {"a": (kind: "sine")}, wires: [])"#,
        )
        .expect("a graph");
        let mut program = asperity(dir.path());
        program
            .env("XDG_CONFIG_HOME", dir.path().join("config"))
            .env("XDG_STATE_HOME", dir.path().join("state"));
        program.args(["check", "g.ron"]);
        tally.case(&format!("{number}"), dir, program, &[]);
    });
    tally.done();
}
