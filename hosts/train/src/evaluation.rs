//! How far the written file's answers are from the law, on strokes that were not trained.

use asperity_world::material::{BINS, Law, LawTable, Library, MadeMaterial, Random};
use asperity_world::motion::{Shape, Stroke, StrokeParams};
use tract_onnx::prelude::*;

use crate::Failure;
use asperity_dataset::{HISTORY, History, MAX_FORCE_N, MAX_SPEED_MM_S, of_stroke};

/// Bins are judged where the expected magnitude is at least this [m/s^2] ..
pub(crate) const AUDIBLE_M_S2: f64 = 0.01;
/// .. and at most this far below the frame's largest [dB].
pub(crate) const RANGE_DB: f64 = 40.0;
/// Frames are judged above the speed gate [mm/s].
pub(crate) const GATE_MM_S: f64 = 5.0;
/// Ticks between two judged frames.
const EVERY: usize = 10;

/// A network file, loaded by tract.
pub(crate) struct Model(std::sync::Arc<TypedRunnableModel>);

impl Model {
    /// Loads the bytes of an ONNX file.
    ///
    /// # Errors
    /// What tract answers.
    pub(crate) fn load(bytes: &[u8]) -> Result<Self, Failure> {
        let model = tract_onnx::onnx()
            .model_for_read(&mut std::io::Cursor::new(bytes))
            .and_then(|m| m.into_optimized())
            .and_then(|m| m.into_runnable())
            .map_err(|e| Failure::model(&e))?;
        Ok(Self(model))
    }

    /// Magnitudes \[100\] m/s^2 from forces \[10\] N, velocities \[20\] mm/s and a vector \[256\].
    ///
    /// # Errors
    /// What tract answers.
    pub(crate) fn run(&self, force: &[f32], speed: &[f32], texture: &[f32]) -> Result<Vec<f32>, Failure> {
        let row = |x: &[f32]| -> TractResult<TValue> { Ok(Tensor::from_shape(&[1, x.len()], x)?.into()) };
        let answer = || -> TractResult<Vec<f32>> {
            let outputs = self.0.run(tvec![row(force)?, row(speed)?, row(texture)?])?;
            Ok(outputs[0].to_plain_array_view::<f32>()?.iter().copied().collect())
        };
        answer().map_err(|e| Failure::model(&e))
    }
}

/// Error over the judged bins of one material.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Score {
    /// Name of the material.
    pub material: String,
    /// Judged bins.
    pub bins: usize,
    /// Mean of |error| [dB].
    pub mean_db: f64,
    /// |error| that nine of ten bins stay within [dB].
    pub p90_db: f64,
    /// Mean of the error with its sign [dB].
    pub bias_db: f64,
    /// Mean of |error| [dB] of a baseline: always the material's mean spectrum over the same frames (mean in dB, which
    /// is the best it could be).
    pub baseline_db: f64,
}

/// The whole evaluation.
#[derive(Clone, Debug, Default)]
pub(crate) struct Evaluation {
    /// By material.
    pub scores: Vec<Score>,
    /// Judged frames of each material.
    pub frames: usize,
    /// Largest magnitude answered to no force, or to no speed [m/s^2].
    pub silence_m_s2: f64,
}

/// Held-out strokes: the shipped kind of stroke, which no training history is made by.
fn strokes() -> Result<Vec<Vec<History>>, Failure> {
    let cases = [
        (Shape::Zigzag, 80.0, 100.0, 1.0, 0.05),
        (Shape::Zigzag, 60.0, 40.0, 0.6, 0.05),
        (Shape::Zigzag, 100.0, 150.0, 1.6, 0.0),
        (Shape::Circle, 50.0, 60.0, 0.4, 0.1),
        (Shape::Circle, 80.0, 120.0, 2.5, 0.05),
        (Shape::Circle, 40.0, 220.0, 1.2, 0.02),
        (Shape::Line, 30.0, 20.0, 1.0, 0.1),
        (Shape::Line, 120.0, 140.0, 3.0, 0.05),
    ];
    let mut all = Vec::with_capacity(cases.len());
    for (seed, (shape, extent_mm, mean_speed_mm_s, force_n, tremor_mm)) in (1000..).zip(cases) {
        let params = StrokeParams {
            shape,
            extent_mm,
            mean_speed_mm_s,
            force_n,
            tremor_mm,
            force_swing: 0.4,
            duration_s: 6.0,
            seed,
            ..StrokeParams::default()
        };
        let truth = Stroke::new(StrokeParams { quantum_mm: 0.0, ..params.clone() })?;
        all.push(of_stroke(&Stroke::new(params)?, &truth, EVERY)?);
    }
    Ok(all)
}

fn judged(h: &History) -> bool {
    let (speed, force) = h.newest();
    speed >= GATE_MM_S && force > 0.0
}

fn decibels(x: f64) -> f64 {
    20.0 * x.max(1e-5).log10()
}

/// Evaluates the bytes of an ONNX file with a library's vectors.
///
/// # Errors
/// A file tract cannot run, a material that the library has not.
pub(crate) fn evaluate(
    onnx: &[u8],
    library: &Library,
    materials: &[MadeMaterial],
) -> Result<Evaluation, Failure> {
    let model = Model::load(onnx)?;
    let histories: Vec<History> = strokes()?.into_iter().flatten().filter(judged).collect();
    let mut evaluation = Evaluation { frames: histories.len(), ..Evaluation::default() };
    for material in materials {
        let vector = &library.material(material.name)?.vector;
        let mut score = score(&model, &material.law, vector.as_slice(), &histories)?;
        score.material = material.name.to_owned();
        evaluation.scores.push(score);
    }
    for material in library.materials() {
        let loudest = loudest_silence(&model, material.vector.as_slice())?;
        evaluation.silence_m_s2 = evaluation.silence_m_s2.max(loudest);
    }
    Ok(evaluation)
}

fn score(model: &Model, law: &Law, vector: &[f32], histories: &[History]) -> Result<Score, Failure> {
    let table = LawTable::new(law, MAX_SPEED_MM_S + 10.0);
    let mut frames = Vec::with_capacity(histories.len());
    let (mut sums, mut counts) = ([0.0; BINS], [0usize; BINS]);
    for h in histories {
        let mut expected = [0.0f32; BINS];
        table.expected_after(&h.clean, &mut expected);
        let expected = expected.map(f64::from);
        let loudest = expected.iter().copied().fold(0.0, f64::max);
        let least = AUDIBLE_M_S2.max(loudest * 10f64.powf(-RANGE_DB / 20.0));
        let frame = expected.map(|x| (x >= least).then(|| decibels(x)));
        for ((sum, count), x) in sums.iter_mut().zip(&mut counts).zip(frame) {
            if let Some(x) = x {
                *sum += x;
                *count += 1;
            }
        }
        frames.push(frame);
    }
    let mean: Vec<f64> = sums.iter().zip(counts).map(|(s, n)| s / n.max(1) as f64).collect();
    let mut errors = Vec::new();
    let mut baseline = 0.0;
    for (h, frame) in histories.iter().zip(&frames) {
        let answer = model.run(&h.force, &h.velocity, vector)?;
        for ((answer, want), mean) in answer.iter().zip(frame).zip(&mean) {
            if let Some(want) = want {
                errors.push(decibels(f64::from(*answer)) - want);
                baseline += (mean - want).abs();
            }
        }
    }
    let n = errors.len().max(1) as f64;
    let bias_db = errors.iter().sum::<f64>() / n;
    let mut sizes: Vec<f64> = errors.iter().map(|e| e.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    Ok(Score {
        material: String::new(),
        bins: errors.len(),
        mean_db: sizes.iter().sum::<f64>() / n,
        p90_db: sizes.get(sizes.len() * 9 / 10).copied().unwrap_or(0.0),
        bias_db,
        baseline_db: baseline / n,
    })
}

/// The largest answer to strokes without force and to forces without speed.
fn loudest_silence(model: &Model, vector: &[f32]) -> Result<f64, Failure> {
    let mut random = Random::new(77);
    let mut loudest = 0.0f32;
    for case in 0..100 {
        let (mut force, mut speed) = ([0.0; HISTORY], [0.0; 2 * HISTORY]);
        if case % 2 == 0 {
            force = [random.range(0.0, MAX_FORCE_N) as f32; HISTORY];
        } else {
            let (size, angle) = (random.range(0.0, MAX_SPEED_MM_S), random.range(0.0, 6.3));
            speed[..HISTORY].fill((size * angle.cos()) as f32);
            speed[HISTORY..].fill((size * angle.sin()) as f32);
        }
        loudest = model.run(&force, &speed, vector)?.into_iter().fold(loudest, f32::max);
    }
    Ok(f64::from(loudest))
}

/// The figures over all materials: (mean |error|, baseline's), weighted by judged bins [dB].
pub(crate) fn overall(evaluation: &Evaluation) -> (f64, f64) {
    let bins: usize = evaluation.scores.iter().map(|s| s.bins).sum();
    let mean = |figure: fn(&Score) -> f64| {
        evaluation.scores.iter().map(|s| figure(s) * s.bins as f64).sum::<f64>() / bins.max(1) as f64
    };
    (mean(|s| s.mean_db), mean(|s| s.baseline_db))
}
