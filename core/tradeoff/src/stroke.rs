//! Strokes: synthetic, from a trajectory file, or recorded with accelerations.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_data::felt::Hand;
use asperity_data::recordings;
use asperity_diagnostics::ron::Value;
use asperity_diagnostics::{Diagnostic, Place};
use asperity_motion::{self, ColumnMap, Shape, StrokeParams, TrajectoryOptions};

use crate::accuracy::Truth;
use crate::chain::Path3;

/// A stroke as the trade-off file declares it.
#[derive(Clone, Debug)]
pub(crate) struct StrokeDecl {
    pub name: String,
    pub place: Place,
    /// The material of a recording.
    pub material: Option<(String, Place)>,
    /// Columns of its file that do not go by their own names.
    pub columns: ColumnMap,
    from: From,
}

#[derive(Clone, Debug)]
enum From {
    Made(Box<StrokeParams>),
    /// Positions over time.
    File(PathBuf),
    /// Positions, forces and accelerations, measured while a tool was dragged.
    Recording(PathBuf),
}

/// Source of the accelerations that a setting is compared with.
#[derive(Clone, Debug)]
pub(crate) enum Known {
    /// Motion of the hand, without the sensor's quantisation. The acceleration can be simulated over a made
    /// surface.
    Hand(Hand),
    /// Recorded accelerations.
    Felt(Truth),
}

/// A stroke that can be sampled.
#[derive(Clone)]
pub(crate) struct Stroke {
    pub name: String,
    /// Length \[s\].
    pub seconds: f64,
    /// Position that the sensor measures. The surface is at z = 0, with a stiffness of 0.5 N/mm.
    pub measured: Path3,
    pub known: Known,
    /// The material of a recording: it is not played over others.
    pub material: Option<String>,
}

impl Stroke {
    /// Whether it is played over a material; none stands for the graph's own.
    pub(crate) fn goes_over(&self, material: Option<&str>) -> bool {
        let own = self.material.as_deref();
        own.is_none() || material.is_none() || own == material
    }
}

impl std::fmt::Debug for Stroke {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stroke")
            .field("name", &self.name)
            .field("seconds", &self.seconds)
            .finish_non_exhaustive()
    }
}

/// Longest synthetic stroke \[s\].
const LONGEST_S: f64 = 600.0;

/// An error of a stroke, with the names that its parameters have in the trade-off file.
fn renamed(mut e: Diagnostic) -> Diagnostic {
    let named =
        |text: &str| text.replace("`duration_s`", "`seconds`").replace("`mean_speed_mm_s`", "`speed_mm_s`");
    e.message = named(&e.message);
    e.help = e.help.map(|help| named(&help).replace("1000000", &LONGEST_S.to_string()));
    e
}

impl StrokeDecl {
    /// Reads `(name: "..", file: "..")`, `(name: "..", recording: "..", material: "..")`, or
    /// `(name: "..", shape: circle, ..)` with parameters of the node `stroke`. Beside a file may stand
    /// `map: ["force_n=Fz:N"]`.
    pub(crate) fn read(value: &Value) -> Result<Self, Diagnostic> {
        let mut record = value.record("Stroke")?;
        let name = record.required("name")?.text()?.to_owned();
        let map = record.optional("map");
        let texts = map.map_or(Ok(&[][..]), Value::list)?.iter().map(Value::text);
        let texts = texts.collect::<Result<Vec<&str>, _>>()?;
        let columns = ColumnMap::parse(&texts).map_err(|e| e.at_place(&map.unwrap_or(value).place()))?;
        let it = |from, material| Self { name, place: value.place(), material, columns, from };
        if let Some(file) = record.optional("file") {
            let file = From::File(file.path()?);
            return record.finish().map(|()| it(file, None));
        }
        if let Some(file) = record.optional("recording") {
            let material = record.optional("material").map(|m| Ok((m.text()?.to_owned(), m.place())));
            let (file, material) = (From::Recording(file.path()?), material.transpose()?);
            return record.finish().map(|()| it(file, material));
        }
        if let Some(map) = map {
            return Err(map.error("a made stroke has no columns to map").help("leave `map` out"));
        }
        let d = StrokeParams::default();
        let shape = match record.optional("shape") {
            Some(v) => Shape::from_name(v.choice(&Shape::NAMES)?).unwrap_or_default(),
            None => Shape::Circle,
        };
        let mut number = |name: &str, default: f64| record.optional(name).map_or(Ok(default), Value::f64);
        let params = StrokeParams {
            shape,
            extent_mm: number("extent_mm", d.extent_mm)?,
            mean_speed_mm_s: number("speed_mm_s", d.mean_speed_mm_s)?,
            force_n: number("force_n", d.force_n)?,
            force_swing: number("force_swing", d.force_swing)?,
            force_swing_hz: number("force_swing_hz", d.force_swing_hz)?,
            approach_s: number("approach_s", d.approach_s)?,
            duration_s: number("seconds", 5.0)?,
            tremor_mm: number("tremor_mm", d.tremor_mm)?,
            quantum_mm: number("quantum_mm", d.quantum_mm)?,
            seed: record.optional("seed").map_or(Ok(1), |v| v.i64_in(0..=i64::MAX, ""))? as u64,
            ..d
        };
        record.finish()?;
        asperity_motion::Stroke::new(params.clone())
            .map_err(|e| renamed(e).at(value.source(), value.span()))?;
        if params.duration_s > LONGEST_S {
            return Err(value
                .error(format!("`seconds` is {}, out of range", params.duration_s))
                .help(format!("at most {LONGEST_S}: rendered strokes are held in memory")));
        }
        Ok(it(From::Made(Box::new(params)), None))
    }

    /// Whether it is a recording that does not say its material.
    pub(crate) fn lacks_material(&self) -> bool {
        matches!(self.from, From::Recording(_)) && self.material.is_none()
    }

    /// The file that it is read from; none for a synthetic stroke.
    pub(crate) fn file(&self) -> Option<&Path> {
        match &self.from {
            From::Made(_) => None,
            From::File(path) | From::Recording(path) => Some(path),
        }
    }

    /// A synthetic stroke that fits into this room \[mm\], and its extent; none where it comes from a file.
    pub(crate) fn shrunk(&self, room_mm: f64) -> Option<Result<(Stroke, f64), Diagnostic>> {
        let From::Made(params) = &self.from else { return None };
        // Tremor and quantisation add to the extent.
        let most = room_mm - 2.0 * params.tremor_mm - 2.0 * params.quantum_mm - 0.5;
        let extent_mm = params.extent_mm.min(most.max(1.0));
        let from = From::Made(Box::new(StrokeParams { extent_mm, ..(**params).clone() }));
        Some(Self { from, ..self.clone() }.open().map(|stroke| (stroke, extent_mm)))
    }

    /// Opens the stroke, and reads its file.
    pub(crate) fn open(&self) -> Result<Stroke, Diagnostic> {
        let name = self.name.clone();
        let material = self.material.as_ref().map(|(name, _)| name.clone());
        let here = |e: Diagnostic| e.related(&self.place.source, self.place.span, "named here");
        let (seconds, measured, known): (f64, Path3, Known) = match &self.from {
            From::Made(params) => {
                let made = asperity_motion::Stroke::new((**params).clone());
                let made = made.map_err(|e| e.at_place(&self.place))?;
                let hand = Hand::stroke(params)?;
                (params.duration_s, Arc::new(move |t| made.sample(t).position), Known::Hand(hand))
            }
            From::File(path) => {
                let options = TrajectoryOptions { columns: self.columns.clone(), ..Default::default() };
                let trajectory = asperity_motion::Trajectory::read(path, &options).map_err(here)?;
                let hand = Hand::trajectory(&trajectory).map_err(|e| here(e.in_file(path)))?;
                let seconds = trajectory.duration_s();
                (seconds, Arc::new(move |t| trajectory.sample(t).position), Known::Hand(hand))
            }
            From::Recording(path) => {
                let recording = recordings::recording(path, &self.columns).map_err(here)?;
                let mut felt = Truth::default();
                felt.add(&recording.felt.axes(), recording.felt.rate_hz)
                    .map_err(|e| here(Diagnostic::new(e.to_string()).in_file(path)))?;
                let seconds = recording.felt.duration_s();
                (seconds, Arc::new(move |t| recording.place_mm(t)), Known::Felt(felt))
            }
        };
        Ok(Stroke { name, seconds, measured, known, material })
    }
}
