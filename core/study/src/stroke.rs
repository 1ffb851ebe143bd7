//! What is stroked: made by rule, or recorded.

use std::path::PathBuf;
use std::sync::Arc;

use asperity_dataset::felt::Hand;
use asperity_source::ron::Value;
use asperity_source::{Diagnostic, Place};
use asperity_world::motion::{self, Shape, StrokeParams, TrajectoryOptions};

use crate::file::beside;
use crate::hear::Path3;

/// A stroke as a study declares it.
#[derive(Clone, Debug)]
pub struct StrokeDecl {
    /// What it is called.
    pub name: String,
    /// Where it stands.
    pub place: Place,
    from: From,
}

#[derive(Clone, Debug)]
enum From {
    Made(Box<StrokeParams>),
    /// Positions over time.
    File(PathBuf),
}

/// A stroke that can be sampled.
#[derive(Clone)]
pub struct Stroke {
    /// What it is called.
    pub name: String,
    /// How long it lasts \[s\].
    pub seconds: f64,
    /// What the sensor reads at a time in s: x, y, z in mm, z up; the surface is at 0 and gives way by 0.5 N/mm.
    pub measured: Path3,
    /// What the hand does: the same without the sensor's steps.
    pub hand: Hand,
}

impl std::fmt::Debug for Stroke {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stroke")
            .field("name", &self.name)
            .field("seconds", &self.seconds)
            .finish_non_exhaustive()
    }
}

const FIELDS: &[&str] = &[
    "name",
    "file",
    "shape",
    "extent_mm",
    "speed_mm_s",
    "force_n",
    "force_swing",
    "force_swing_hz",
    "approach_s",
    "seconds",
    "tremor_mm",
    "quantum_mm",
    "seed",
];

impl StrokeDecl {
    /// Reads `(name: "..", file: "..")`, or `(name: "..", shape: circle, ..)` with what the node `stroke` has for parameters.
    ///
    /// # Errors
    /// Another value, an unknown field.
    pub fn read(value: &Value) -> Result<Self, Diagnostic> {
        let mut record = value.record("Stroke")?;
        let name = record.required("name")?.text()?.to_owned();
        if let Some(file) = record.optional("file") {
            let from = From::File(beside(file)?);
            record.finish(&["name", "file"])?;
            return Ok(Self { name, place: value.place(), from });
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
        record.finish(FIELDS)?;
        // What is out of range is said now, and at its place.
        motion::Stroke::new(params.clone()).map_err(|e| e.at(value.source(), value.span()))?;
        Ok(Self { name, place: value.place(), from: From::Made(Box::new(params)) })
    }

    /// The stroke itself; reads its file.
    ///
    /// # Errors
    /// A file that cannot be read or is no trajectory.
    pub fn open(&self) -> Result<Stroke, Diagnostic> {
        let name = self.name.clone();
        match &self.from {
            From::Made(params) => {
                let made = |params| {
                    motion::Stroke::new(params).map_err(|e| e.at(&self.place.source, self.place.span))
                };
                let measured = made((**params).clone())?;
                Ok(Stroke {
                    name,
                    seconds: params.duration_s,
                    hand: Hand::stroke(params)?,
                    measured: Arc::new(move |t| measured.sample(t).position),
                })
            }
            From::File(path) => {
                let read = motion::Trajectory::read(path, &TrajectoryOptions::default());
                let trajectory =
                    read.map_err(|e| e.related(&self.place.source, self.place.span, "named here"))?;
                let seconds = trajectory.duration_s();
                let hand = Hand::trajectory(&trajectory).map_err(|e| {
                    e.in_file(path).related(&self.place.source, self.place.span, "named here")
                })?;
                let measured = Arc::new(move |t| trajectory.sample(t).position);
                Ok(Stroke { name, seconds, hand, measured })
            }
        }
    }
}
