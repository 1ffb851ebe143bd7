//! Everything that reads a file, as functions of its bytes: for the tests of hard cases, and for the fuzz
//! targets.

use std::path::Path;

use asperity_accuracy::npy::{self, Archive, Entry};
use asperity_actuator::ActuatorProfile;
use asperity_autoregressive::{TextureFile, toolkit};
use asperity_data::recordings;
use asperity_data::wav::Wav;
use asperity_diagnostics::Source;
use asperity_graph::{GraphFile, compile};
use asperity_motion::{ColumnMap, Trajectory, TrajectoryOptions};
use asperity_scene::Scene;
use asperity_scene::{Lowering, lower};
use asperity_study::{Conduct, Experiment, Session, Table, log};
use asperity_texture::Library;
use asperity_texture::Model;

/// A reader: its name, what it does with a file's bytes, and what it may hold at most.
pub(crate) struct Reader {
    /// As the fuzz target and the folder of its corpus are called.
    pub(crate) name: &'static str,
    /// Reads a file's bytes as the program would; whether they were taken.
    pub(crate) read: fn(&[u8]) -> bool,
    /// Bytes that it may hold whatever it is given, and bytes more for each byte of the file.
    pub(crate) holds: (i64, i64),
}

impl Reader {
    /// Bytes that it may hold for a file of so many.
    pub(crate) fn most(&self, bytes: usize) -> i64 {
        self.holds.0 + self.holds.1 * bytes as i64
    }
}

/// All of them.
pub(crate) const READERS: [Reader; 11] = [
    Reader { name: "graph", read: graph, holds: (64 << 20, 1000) },
    Reader { name: "scene", read: scene, holds: (64 << 20, 1000) },
    Reader { name: "material", read: material, holds: (1 << 20, 1000) },
    Reader { name: "csv", read: csv, holds: (1 << 20, 1000) },
    Reader { name: "npy", read: numbers, holds: (1 << 20, 4) },
    Reader { name: "npz", read: archive, holds: (4 << 20, 3000) },
    Reader { name: "xml", read: xml, holds: (4 << 20, 1000) },
    Reader { name: "wav", read: wav, holds: (1 << 20, 32) },
    Reader { name: "experiment", read: experiment, holds: (16 << 20, 1000) },
    Reader { name: "log", read: session, holds: (4 << 20, 1000) },
    Reader { name: "onnx", read: onnx, holds: (256 << 20, 1000) },
];

/// A text file's bytes as [`Source::read`] takes them; none for what is no text. Files that it names are
/// looked for beside the shipped graphs.
fn text(bytes: &[u8]) -> Option<std::sync::Arc<Source>> {
    let text = std::str::from_utf8(bytes).ok()?;
    Some(Source::new(format!("{}/it.ron", super::GRAPHS), text.strip_prefix('\u{feff}').unwrap_or(text)))
}

/// A graph, as far as an engine that could run it.
fn graph(bytes: &[u8]) -> bool {
    asperity_texture::run_graphs_by(asperity_tract::compile);
    let Some(Ok(graph)) = text(bytes).map(|source| GraphFile::parse(&source)) else { return false };
    compile(&graph, &super::registry(), Default::default()).is_ok()
}

/// A scene, as far as the graph that it comes to.
fn scene(bytes: &[u8]) -> bool {
    let Some(Ok(scene)) = text(bytes).map(|source| Scene::parse(&source)) else { return false };
    lower(&scene, &super::registry(), Lowering::default()).is_ok()
}

/// A file about a material, a texture or an actuator.
fn material(bytes: &[u8]) -> bool {
    let Some(source) = text(bytes) else { return false };
    Library::parse(&source).is_ok()
        | TextureFile::parse(&source).is_ok()
        | ActuatorProfile::parse(&source).is_ok()
}

/// A trajectory, or a recorded stroke.
fn csv(bytes: &[u8]) -> bool {
    let Some(source) = text(bytes) else { return false };
    Trajectory::parse(&source, &TrajectoryOptions::default()).is_ok()
        | recordings::parse(&source, &ColumnMap::default()).is_ok()
}

fn numbers(bytes: &[u8]) -> bool {
    npy::parse(bytes).is_ok()
}

/// An archive with entries of known types.
fn archive(bytes: &[u8]) -> bool {
    Archive::parse(bytes)
        .is_ok_and(|archive| !archive.0.values().any(|entry| matches!(entry, Entry::Other(_))))
}

fn xml(bytes: &[u8]) -> bool {
    text(bytes).is_some_and(|source| toolkit::parse(&source).is_ok())
}

fn wav(bytes: &[u8]) -> bool {
    Wav::parse(bytes, u32::MAX).is_ok()
}

/// An experiment, as far as a participant's plan.
fn experiment(bytes: &[u8]) -> bool {
    let Some(Ok(study)) = text(bytes).map(|source| Experiment::parse(&source)) else { return false };
    let _ = (study.imbalances(), study.minutes());
    Conduct::new(&study, 3, &[], 1).is_ok()
}

/// An experiment whose logs are read.
const STUDY: &str = r#"Experiment(version: 1, title: "It", participants: 2,
    stimuli: {"a": silence, "b": real(mount: "felt")},
    parts: [(name: "one", show: [("a", "b")], repeats: 3, ask: [which(name: "w", text: "Which?"),
        scale(name: "s", text: "How?", from: 1, to: 7, low: "low", high: "high")])],
    survey: [text(name: "why", text: "Why?")])"#;

/// A participant's log, as far as a session that goes on and a table of answers.
fn session(bytes: &[u8]) -> bool {
    let Ok(events) = std::str::from_utf8(bytes).map_err(drop).and_then(|text| log::parse(text).map_err(drop))
    else {
        return false;
    };
    let study = Experiment::parse(&Source::new("it.ron", STUDY)).expect("a study");
    let goes_on = Conduct::new(&study, 1, &events, 1).is_ok();
    let session = Session { participant: "P01".into(), number: 1, events };
    goes_on && Table::new(&study, &[session]).is_ok()
}

fn onnx(bytes: &[u8]) -> bool {
    asperity_texture::run_graphs_by(asperity_tract::compile);
    Model::from_bytes(bytes, Path::new("it.onnx")).is_ok()
}
