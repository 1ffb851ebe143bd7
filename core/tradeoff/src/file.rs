//! The trade-off file.

use std::path::PathBuf;
use std::sync::Arc;

use asperity_diagnostics::ron::{self, Value};
use asperity_diagnostics::{Diagnostic, Place, Source, Span};
use asperity_motion::ColumnMap;

use crate::knob::Knob;
use crate::stroke::StrokeDecl;

/// A trade-off file: which knobs are set to which values, over which strokes and materials.
///
/// ```ron
/// Tradeoff(
///     version: 1,
///     graph: "../texture.ron",             // the default; graphs on the command line replace it
///     baselines: [(name: "paper", graph: "../heravi2024_500hz.ron")],
///     strokes: [(name: "circle", shape: circle, speed_mm_s: 60.0)],
///     materials: ["canvas", "sandpaper P80"],
///     grids: [(name: "phase", knobs: {"phase.frames": [1, 5], "phase.passes": [1, 5]})],
/// )
/// ```
#[derive(Clone, Debug)]
pub struct Tradeoff {
    /// Text of the file.
    pub source: Arc<Source>,
    /// Seed of the first draw.
    pub seed: u64,
    /// Graph whose settings are varied; none where only the command line names one.
    pub graph: Option<Named>,
    /// Other graphs, measured unchanged for comparison.
    pub baselines: Vec<Baseline>,
    pub(crate) strokes: Vec<StrokeDecl>,
    /// Names of materials in the library that the graph's network reads.
    pub(crate) materials: Vec<(String, Place)>,
    /// Share of the physical acceleration that the graph renders, where it has a gain: 1 for all of it.
    pub strength: f64,
    pub(crate) grids: Vec<Grid>,
    /// Draws of each setting, at least two: their differences give the noise floor.
    pub(crate) draws: u64,
    /// Steps of speed that the response lag is measured with.
    pub(crate) steps: usize,
    pub(crate) times: Times,
    /// Skips knobs and values that a graph does not have; otherwise they are errors.
    pub lenient: bool,
}

/// A path, and its place in the file.
#[derive(Clone, Debug)]
pub struct Named {
    /// Path of the file.
    pub path: PathBuf,
    /// Its place in the trade-off file.
    pub place: Place,
}

/// A graph that is measured unchanged, for comparison.
#[derive(Clone, Debug)]
pub struct Baseline {
    /// Name, unique in the file and not `default`.
    pub name: String,
    place: Place,
    /// File of the graph.
    pub graph: Named,
    /// Share of the physical acceleration that it renders.
    pub strength: f64,
}

/// Some knobs with their values: every combination is a setting.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    pub name: String,
    pub knobs: Vec<(Knob, Vec<Value>)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Times {
    /// Turns of each setting.
    pub turns: usize,
    /// Length of a turn [ms of signal].
    pub turn_ms: u64,
    /// Settings that alternate with each other and with the default.
    pub batch: usize,
}

impl Default for Times {
    fn default() -> Self {
        Self { turns: 12, turn_ms: 1600, batch: 12 }
    }
}

/// Name of an unchanged graph.
pub(crate) const DEFAULT: &str = "default";
/// Most combinations of a grid.
const MOST_COMBINATIONS: usize = 10_000;
/// First word of the file, and the one that it had before.
const WORDS: [&str; 2] = ["Tradeoff", "Study"];

impl Tradeoff {
    /// Whether a text begins as a trade-off file, or as an old one.
    pub fn is_meant(source: &Source) -> bool {
        ron::first_word(source).is_some_and(|word| WORDS.contains(&word))
    }

    /// Names the columns of the strokes whose `map` the file leaves out.
    pub fn map_columns(&mut self, map: &ColumnMap) {
        let strokes = self.strokes.iter_mut().filter(|s| s.file().is_some() && s.columns.is_empty());
        strokes.for_each(|stroke| stroke.columns = map.clone());
    }

    /// Reads a trade-off from a text. Knobs, materials and files are checked later, by [`Prepared::new`].
    ///
    /// # Errors
    /// Invalid RON, an unknown field, a value out of its range, a file that begins with `Study`.
    ///
    /// [`Prepared::new`]: crate::Prepared::new
    pub fn parse(source: &Arc<Source>) -> Result<Self, Diagnostic> {
        let [word, old] = WORDS;
        if ron::first_word(source) == Some(old) {
            let start = source.text().find(old).unwrap_or_default();
            return Err(Diagnostic::new(format!("`{old}` is the old first word of a trade-off file"))
                .at(source, Span { start, end: start + old.len() })
                .help(format!("write `{word}(...)`, and `baselines` instead of `marks`")));
        }
        let value = ron::parse(source)?;
        let mut record = value.record(word)?;
        let version = record.required("version")?;
        if version.i64()? != 1 {
            return Err(version
                .error("unknown version of the trade-off format")
                .help("this program reads version 1"));
        }
        let it = Self {
            source: source.clone(),
            seed: record.optional("seed").map_or(Ok(1), |v| v.i64_in(0..=i64::MAX, ""))? as u64,
            graph: record.optional("graph").map(named).transpose()?,
            baselines: list(record.optional("baselines"), baseline)?,
            strokes: list(record.optional("strokes"), StrokeDecl::read)?,
            materials: list(record.optional("materials"), |v| Ok((v.text()?.to_owned(), v.place())))?,
            strength: record.optional("strength").map_or(Ok(1.0), strength)?,
            grids: list(record.optional("grids"), grid)?,
            draws: record.optional("draws").map_or(Ok(2), |v| v.i64_in(2..=100, "draws"))? as u64,
            steps: record.optional("steps").map_or(Ok(60), |v| v.i64_in(10..=1000, "steps"))? as usize,
            times: record.optional("times").map_or(Ok(Times::default()), times)?,
            lenient: false,
        };
        let whole = record.value();
        record.finish()?;
        if it.strokes.is_empty() {
            return Err(whole
                .error("this trade-off has no strokes")
                .help("strokes: [(name: \"circle\", shape: circle, speed_mm_s: 60.0)]"));
        }
        if !it.materials.is_empty()
            && let Some(stroke) = it.strokes.iter().find(|s| s.lacks_material())
        {
            let message = format!("the recording `{}` does not say its material", stroke.name);
            let help = "material: \"the name it has in the graph's library\"";
            return Err(Diagnostic::new(message).at_place(&stroke.place).help(help));
        }
        if let Some(b) = it.baselines.iter().find(|b| b.name == DEFAULT || b.name.trim().is_empty()) {
            return Err(Diagnostic::new(format!("a baseline cannot be named `{}`", b.name))
                .at_place(&b.place)
                .help("`default` is the name of the unchanged graph"));
        }
        no_duplicates(it.baselines.iter().map(|b| (&b.name, &b.place)))?;
        no_duplicates(it.strokes.iter().map(|s| (&s.name, &s.place)))?;
        no_duplicates(it.materials.iter().map(|(name, place)| (name, place)))?;
        Ok(it)
    }
}

fn no_duplicates<'a>(names: impl Iterator<Item = (&'a String, &'a Place)>) -> Result<(), Diagnostic> {
    let mut known = std::collections::HashSet::new();
    for (name, place) in names {
        if !known.insert(name) {
            return Err(Diagnostic::new(format!("the name `{name}` is used twice")).at_place(place));
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
    Ok(Named { path: value.path()?, place: value.place() })
}

fn strength(value: &Value) -> Result<f64, Diagnostic> {
    value.f64_in(1e-6..=1e6, "")
}

fn baseline(value: &Value) -> Result<Baseline, Diagnostic> {
    let mut record = value.record("Baseline")?;
    let name = record.required("name")?;
    let (name, place) = (name.text()?.to_owned(), name.place());
    let graph = named(record.required("graph")?)?;
    let strength = record.optional("strength").map_or(Ok(1.0), strength)?;
    record.finish()?;
    Ok(Baseline { name, place, graph, strength })
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
            return Err(values.error("this knob has no values").help("[value, value]"));
        }
        combinations = combinations.saturating_mul(list.len());
        knobs.push((Knob::parse(&key.name, place)?, list.to_vec()));
    }
    record.finish()?;
    if combinations > MOST_COMBINATIONS {
        return Err(entries
            .error(format!("{combinations} combinations"))
            .help(format!("at most {MOST_COMBINATIONS}; use several smaller grids")));
    }
    Ok(Grid { name, knobs })
}

fn times(value: &Value) -> Result<Times, Diagnostic> {
    let mut record = value.record("Times")?;
    let d = Times::default();
    let mut number = |name: &str, default: u64, range, unit: &str| {
        record.optional(name).map_or(Ok(default as i64), |v| v.i64_in(range, unit)).map(|n| n as u64)
    };
    let turns = number("turns", d.turns as u64, 2..=1000, "turns")? as usize;
    let turn_ms = number("turn_ms", d.turn_ms, 8..=60_000, "ms")?;
    let batch = number("batch", d.batch as u64, 1..=1000, "settings")? as usize;
    record.finish()?;
    Ok(Times { turns, turn_ms, batch })
}
