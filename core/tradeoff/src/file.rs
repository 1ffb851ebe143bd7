//! The study file.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_diagnostics::ron::{self, Value};
use asperity_diagnostics::{Diagnostic, Place, Source};

use crate::knob::Knob;
use crate::stroke::StrokeDecl;

/// What is run, as its file has it.
///
/// ```ron
/// Study(
///     version: 1,
///     graph: "../texture.ron",             // the default; graphs on the command line take its place
///     marks: [(name: "paper", graph: "../heravi2024_500hz.ron")],
///     strokes: [(name: "circle", shape: circle, speed_mm_s: 60.0)],
///     materials: ["canvas", "sandpaper P80"],
///     grids: [(name: "phase", knobs: {"phase.frames": [1, 5], "phase.passes": [1, 5]})],
/// )
/// ```
#[derive(Clone, Debug)]
pub struct Study {
    /// The text it was read from.
    pub source: Arc<Source>,
    /// What all random numbers follow from.
    pub seed: u64,
    /// The graph around which settings are varied; none where the command line names it.
    pub graph: Option<Named>,
    /// Graphs that stand beside as they are.
    pub marks: Vec<Mark>,
    /// What is stroked.
    pub strokes: Vec<StrokeDecl>,
    /// Names of materials, of the library that the graph's networks read.
    pub materials: Vec<(String, Place)>,
    /// The part of the physics at which the graph is set to render, where it has a strength: 1 for all of it.
    pub strength: f64,
    /// Combinations of settings.
    pub grids: Vec<Grid>,
    /// Draws of each setting: at least two, whose difference is the noise floor.
    pub draws: u64,
    /// Steps of speed by which the response lag is found.
    pub steps: usize,
    /// How times are taken.
    pub times: Times,
    /// Whether knobs that no graph has are left out, as are values that mean nothing there; else they are errors.
    pub lenient: bool,
}

/// A path and where it stands.
#[derive(Clone, Debug)]
pub struct Named {
    /// The file.
    pub path: PathBuf,
    /// Where the study names it.
    pub place: Place,
}

/// A graph that stands beside those that are varied, under a name of its own.
#[derive(Clone, Debug)]
pub struct Mark {
    /// What it is called; no other one is, and none is called `default`.
    pub name: String,
    /// Where that stands.
    pub place: Place,
    /// Its file.
    pub graph: Named,
    /// The part of the physics at which it is set to render.
    pub strength: f64,
}

/// Some knobs, and all combinations of what each is turned to.
#[derive(Clone, Debug)]
pub struct Grid {
    /// What it is about.
    pub name: String,
    /// Where it stands.
    pub place: Place,
    /// What is turned, and to what.
    pub knobs: Vec<(Knob, Vec<Value>)>,
}

/// How times are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Times {
    /// Turns that each setting has.
    pub turns: usize,
    /// Milliseconds of signal a turn.
    pub turn_ms: u64,
    /// Settings that take turns with each other and with the default.
    pub batch: usize,
}

impl Default for Times {
    fn default() -> Self {
        Self { turns: 12, turn_ms: 1600, batch: 12 }
    }
}

const FIELDS: &[&str] = &[
    "version",
    "seed",
    "graph",
    "marks",
    "strokes",
    "materials",
    "strength",
    "grids",
    "draws",
    "steps",
    "times",
];
/// What a graph as it stands is called.
pub(crate) const DEFAULT: &str = "default";
/// Most settings that a grid may have.
const MOST_COMBINATIONS: usize = 10_000;

impl Study {
    /// Whether a text is meant as a study.
    pub fn is_meant(source: &Source) -> bool {
        ron::first_word(source) == Some("Study")
    }

    /// Reads a study from a text. What its knobs and strokes need is looked at when settings are made of it.
    ///
    /// # Errors
    /// A text that is no RON, an unknown field, a value out of its range.
    pub fn parse(source: &Arc<Source>) -> Result<Self, Diagnostic> {
        let value = ron::parse(source)?;
        let mut study = value.record("Study")?;
        let version = study.required("version")?;
        if version.i64()? != 1 {
            return Err(version
                .error("unknown version of the study format")
                .help("this program reads version 1"));
        }
        let seed = study.optional("seed").map_or(Ok(1), |v| v.i64_in(0..=i64::MAX, ""))? as u64;
        let graph = study.optional("graph").map(named).transpose()?;
        let marks = list(study.optional("marks"), mark)?;
        let strokes = list(study.optional("strokes"), StrokeDecl::read)?;
        let materials = list(study.optional("materials"), |v| Ok((v.text()?.to_owned(), v.place())))?;
        let strength = study.optional("strength").map_or(Ok(1.0), strength)?;
        let grids = list(study.optional("grids"), grid)?;
        let draws = study.optional("draws").map_or(Ok(2), |v| v.i64_in(2..=100, "draws"))? as u64;
        let steps = study.optional("steps").map_or(Ok(60), |v| v.i64_in(10..=1000, "steps"))? as usize;
        let times = study.optional("times").map_or(Ok(Times::default()), times)?;
        let study_value = study.value();
        study.finish(FIELDS)?;
        if strokes.is_empty() {
            return Err(study_value
                .error("this study has no strokes")
                .help("strokes: [(name: \"circle\", shape: circle, speed_mm_s: 60.0)]"));
        }
        if !materials.is_empty()
            && let Some(stroke) = strokes.iter().find(|s| s.is_anywhere())
        {
            return Err(Diagnostic::new(format!(
                "nothing says over which material `{}` was recorded",
                stroke.name
            ))
            .at(&stroke.place.source, stroke.place.span)
            .help("material: \"the name it has in the graph's library\""));
        }
        let names = marks.iter().map(|m| (m.name.as_str(), &m.place)).collect::<Vec<_>>();
        no_twins(&names)?;
        if let Some(mark) = marks.iter().find(|m| m.name == DEFAULT || m.name.trim().is_empty()) {
            return Err(Diagnostic::new(format!("`{}` is no name for a mark", mark.name))
                .at(&mark.place.source, mark.place.span)
                .help("the graph as it stands is the `default`"));
        }
        let names = strokes.iter().map(|s| (s.name.as_str(), &s.place)).collect::<Vec<_>>();
        no_twins(&names)?;
        no_twins(&materials.iter().map(|(n, p)| (n.as_str(), p)).collect::<Vec<_>>())?;
        Ok(Self {
            source: source.clone(),
            seed,
            graph,
            marks,
            strokes,
            materials,
            strength,
            grids,
            draws,
            steps,
            times,
            lenient: false,
        })
    }
}

/// Refuses two of one name.
fn no_twins(names: &[(&str, &Place)]) -> Result<(), Diagnostic> {
    for (i, (name, place)) in names.iter().enumerate() {
        if names[..i].iter().any(|(other, _)| other == name) {
            return Err(Diagnostic::new(format!("`{name}` stands here twice")).at(&place.source, place.span));
        }
    }
    Ok(())
}

fn list<T>(
    value: Option<&Value>,
    read: impl Fn(&Value) -> Result<T, Diagnostic>,
) -> Result<Vec<T>, Diagnostic> {
    value.map_or(Ok(Vec::new()), |v| v.list()?.iter().map(read).collect())
}

fn named(value: &Value) -> Result<Named, Diagnostic> {
    Ok(Named { path: beside(value)?, place: value.place() })
}

/// The path in a text, relative to the file in which it stands.
pub(crate) fn beside(value: &Value) -> Result<PathBuf, Diagnostic> {
    let base = value.source().path().parent().unwrap_or(Path::new(""));
    Ok(base.join(value.text()?))
}

fn strength(value: &Value) -> Result<f64, Diagnostic> {
    value.f64_in(1e-6..=1e6, "")
}

fn mark(value: &Value) -> Result<Mark, Diagnostic> {
    let mut record = value.record("Mark")?;
    let name = record.required("name")?;
    let (name, place) = (name.text()?.to_owned(), name.place());
    let graph = named(record.required("graph")?)?;
    let strength = record.optional("strength").map_or(Ok(1.0), strength)?;
    record.finish(&["name", "graph", "strength"])?;
    Ok(Mark { name, place, graph, strength })
}

fn grid(value: &Value) -> Result<Grid, Diagnostic> {
    let mut record = value.record("Grid")?;
    let name = record.required("name")?.text()?.to_owned();
    let entries = record.required("knobs")?;
    let mut knobs = Vec::new();
    let mut combinations = 1_usize;
    for (key, values) in entries.map()? {
        let place = Place { source: values.source().clone(), span: key.span };
        let list = values.list()?;
        if list.is_empty() {
            return Err(values.error("nothing to turn this to").help("[value, value]"));
        }
        combinations = combinations.saturating_mul(list.len());
        knobs.push((Knob::parse(&key.name, place)?, list.to_vec()));
    }
    record.finish(&["name", "knobs"])?;
    if combinations > MOST_COMBINATIONS {
        return Err(entries
            .error(format!("{combinations} combinations"))
            .help(format!("at most {MOST_COMBINATIONS}; several smaller grids say more")));
    }
    Ok(Grid { name, place: value.place(), knobs })
}

fn times(value: &Value) -> Result<Times, Diagnostic> {
    let mut record = value.record("Times")?;
    let d = Times::default();
    let turns = record.optional("turns").map_or(Ok(d.turns as i64), |v| v.i64_in(2..=1000, "turns"))?;
    let turn_ms = record.optional("turn_ms").map_or(Ok(d.turn_ms as i64), |v| v.i64_in(8..=60_000, "ms"))?;
    let batch = record.optional("batch").map_or(Ok(d.batch as i64), |v| v.i64_in(1..=1000, "settings"))?;
    record.finish(&["turns", "turn_ms", "batch"])?;
    Ok(Times { turns: turns as usize, turn_ms: turn_ms as u64, batch: batch as usize })
}
