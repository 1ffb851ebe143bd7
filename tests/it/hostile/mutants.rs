//! Files that the program reads, damaged by seed.

use std::fs;

use harness::{Room, asperity, graphs, root, shipped_graph};

use super::judge::{Seed, Tally, times, two_at_a_time};

/// A reader of a file.
pub struct Reader {
    pub name: &'static str,
    pub right: fn() -> Vec<u8>,
    mutants: u64,
    /// The command that reads it: `FILE` is the file; `NETWORK`, `LIBRARY` and `PICTURE` are shipped ones,
    /// `GRAPH` one without a network.
    command: &'static str,
}

impl Reader {
    pub fn args(&self) -> Vec<String> {
        let word = |word: &str| match word {
            "GRAPH" => root().join("tests/data/small.ron").display().to_string(),
            "NETWORK" => graphs("heravi2024.ron").display().to_string(),
            "LIBRARY" => graphs("models/surfaces/materials.ron").display().to_string(),
            "PICTURE" => picture(),
            word => word.replace("FILE", self.name),
        };
        self.command.split(' ').map(word).collect()
    }

    /// Files that the command writes.
    pub fn outputs(&self) -> Vec<&str> {
        let out = self.command.split_once("--out ").map(|(_, out)| out);
        let recovered = self.name.strip_suffix(".recording");
        out.into_iter().chain(recovered.map(|_| self.name)).chain(recovered).collect()
    }
}

fn shipped(path: &str) -> Vec<u8> {
    fs::read(graphs(path)).expect("a shipped file")
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

fn vector() -> Vec<u8> {
    fs::read(root().join("tests/data/phase/texture_2500.mag.npy")).expect("a vector")
}

fn archive() -> Vec<u8> {
    fs::read(root().join("tests/data/phase/by_numpy.npz")).expect("an archive")
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

const fn reader(name: &'static str, right: fn() -> Vec<u8>, mutants: u64, command: &'static str) -> Reader {
    Reader { name, right, mutants, command }
}

pub const READERS: [Reader; 14] = [
    reader("g.ron", || shipped_graph().into_bytes(), 400, "check FILE"),
    reader("g.ron", || shipped_graph().into_bytes(), 150, "render FILE --seconds 0.05 --out o.wav"),
    reader("s.ron", scene, 200, "check FILE"),
    reader("l.ron", || shipped("models/surfaces/materials.ron"), 100, "materials --library FILE"),
    reader("p.ron", || shipped("actuators/hapcoil_one.ron"), 200, "check GRAPH --set limiter.profile=FILE"),
    reader(
        "t.csv",
        || shipped("trajectories/zigzag.csv"),
        100,
        "render GRAPH --input FILE --seconds 0.05 --out o.wav",
    ),
    reader("m.npy", vector, 150, "invert --magnitudes FILE --rate 2500 --scale dft --out o.npy"),
    reader("m.npz", archive, 100, "invert --magnitudes FILE --out o.npy"),
    reader(
        "n.onnx",
        || shipped("models/surfaces/texture.onnx"),
        80,
        "check NETWORK --set texture.model=FILE",
    ),
    reader(
        "e.onnx",
        || shipped("models/surfaces/encoder.onnx"),
        40,
        "encode --dry-run --library LIBRARY --encoder FILE PICTURE",
    ),
    reader(
        "i.jpg",
        || fs::read(picture()).expect("a picture"),
        40,
        "encode --dry-run --library LIBRARY FILE",
    ),
    reader("r.json", || shipped("tradeoffs/results.json"), 150, "choose FILE --budget-us 100"),
    reader("r.csv", recording, 60, "fit-ar FILE --out o.ron"),
    reader("k.wav.recording", left_recording, 150, "recover FILE"),
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

/// Texts that replace a number.
const NUMBERS: &str =
    "0 -1 NaN inf -inf 1e308 -1e308 1e-320 18446744073709551616 99999999999999999999999 0x10 --1";
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
            7 | 8 => {
                let all: Vec<&str> = NUMBERS.split(' ').collect();
                number(&mut bytes, at, all[seed.below(all.len())]);
            }
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
        two_at_a_time(reader.mutants * times() / 6, |number| {
            let dir = Room::new();
            let bytes = mutated(&right, &mut Seed(number.wrapping_mul(0x1_0001)));
            dir.write(reader.name, bytes);
            let mut program = asperity(&dir);
            program.args(reader.args());
            tally.case(&format!("{} {number}", reader.name), dir, program, &reader.outputs());
        });
    }
    tally.done();
}

#[test]
fn undamaged_file_is_read() {
    for reader in &READERS {
        let dir = Room::new();
        dir.write(reader.name, (reader.right)());
        harness::run(&dir, &reader.args().iter().map(String::as_str).collect::<Vec<_>>()).ok();
        let written = reader.outputs().iter().all(|o| *o == reader.name || dir.join(o).exists());
        assert!(written, "{}", reader.name);
    }
}

/// Of this program's own lists nothing is believed.
#[test]
fn damaged_list_of_the_person_is_no_harm() {
    let tally = Tally::new("damaged lists");
    two_at_a_time(15 * times(), |number| {
        let dir = Room::new();
        let mut seed = Seed(number);
        let right = format!("{}\n/nowhere\n12 34 {}\n", dir.display(), dir.display());
        for list in ["config/asperity/trusted", "state/asperity/made"] {
            fs::create_dir_all(dir.join(list).parent().expect("a folder")).expect("a folder");
            dir.write(list, mutated(right.as_bytes(), &mut seed));
        }
        dir.write(
            "g.ron",
            r#"Graph(version: 1, plugins: ["x/none.so"], nodes: {"a": (kind: "sine")}, wires: [])"#,
        );
        let mut program = asperity(&dir);
        program.env("XDG_CONFIG_HOME", dir.join("config")).env("XDG_STATE_HOME", dir.join("state"));
        program.args(["check", "g.ron"]);
        tally.case(&format!("{number}"), dir, program, &[]);
    });
    tally.done();
}
