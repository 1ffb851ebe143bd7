//! How accurate a setting is: over every stroke, material and draw.

use std::collections::BTreeMap;

use asperity_engine::Options;
use asperity_measure::accuracy::{self, Spectrogram};
use asperity_measure::phase;
use asperity_node::{NodeKind, Registry};
use asperity_source::Diagnostic;
use asperity_source::ron::{Kind, Value};

use crate::figure::{Figure, Figures, mean};
use crate::hear::{Chain, Heard, chain, motion, over};
use crate::knob::{has, set};
use crate::lag;
use crate::setting::Setting;
use crate::stroke::Stroke;
use crate::time::Onlooker;
use crate::truth::Truths;

/// What is rendered, and how often.
pub struct Plan<'a> {
    /// Strokes.
    pub strokes: &'a [Stroke],
    /// Materials; one of no name where the graph has its own.
    pub materials: &'a [Option<String>],
    /// Draws.
    pub draws: u64,
    /// Seed of the first; the others follow.
    pub seed: u64,
    /// Steps of speed for the response lag.
    pub steps: usize,
    /// The physics.
    pub truths: &'a Truths,
    /// The part of it at which the graph is set to render.
    pub strength: f64,
}

/// What was found.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Found {
    /// Figures of every draw.
    pub draws: Vec<Figures>,
    /// Of the network's own magnitudes.
    pub model: Figures,
    /// Response lag of every draw \[ms\].
    pub lags_ms: Vec<[f64; 3]>,
    /// Declared latency \[ms\].
    pub latency_ms: Option<f64>,
    /// How often nodes failed.
    pub faults: u64,
}

/// Finds all there is to find about a setting; none where the user asks to stop.
///
/// # Errors
/// A graph that does not compile over one of the materials.
pub fn find(
    setting: &Setting,
    registry: &Registry,
    plan: &Plan<'_>,
    onlooker: &dyn Onlooker,
) -> Result<Option<Found>, Diagnostic> {
    let mut found = Found::default();
    let mut models = Vec::new();
    let double = in_double(setting, registry);
    for draw in 0..plan.draws {
        let seed = plan.seed.wrapping_add(draw);
        let mut all = Vec::new();
        for (s, stroke) in plan.strokes.iter().enumerate() {
            for material in plan.materials {
                if onlooker.stopped() {
                    return Ok(None);
                }
                let material = material.as_deref();
                let chain = chain(setting, registry, stroke, material, seed)?;
                found.latency_ms.get_or_insert(chain.schedule().latency().ms());
                let heard = chain.hear(stroke.seconds);
                found.faults += heard.faults;
                let mut figures = Figures::new();
                if let Some(db) = convergence(&heard) {
                    figures.insert(Figure::Convergence, db);
                }
                if let Some(truth) = material.and_then(|m| plan.truths.get(s, m, draw)) {
                    whole(&heard, truth, plan.strength, &mut figures);
                    models.extend(of_model(&heard, truth));
                }
                // The wave itself is compared on one stroke of each draw: in double precision everything takes twice as long and more.
                if let Some(double) = double.as_ref().filter(|_| s == 0) {
                    let wide = self::chain(double, registry, stroke, material, seed)?.hear(stroke.seconds);
                    if let Some(db) = accuracy::waveform_error_db(&wide_of(heard.last()), &wide_of(wide.last())) {
                        figures.insert(Figure::Precision, db);
                    }
                }
                all.push(figures);
                onlooker.advanced(1);
            }
        }
        found.draws.push(mean(all.iter()));
        let material = plan.materials.first().and_then(|m| m.as_deref());
        let graph = over(&setting.graph, registry, material, seed);
        found.lags_ms.extend(lag::response(&graph, registry, plan.steps)?);
        onlooker.advanced(1);
    }
    found.model = mean(models.iter());
    Ok(Some(found))
}

fn wide_of(x: &[f32]) -> Vec<f64> {
    x.iter().map(|x| f64::from(*x)).collect()
}

/// The same setting with every node in double precision that can be; none where none can, or all are.
fn in_double(setting: &Setting, registry: &Registry) -> Option<Setting> {
    let mut double = setting.clone();
    let mut any = false;
    for node in &mut double.graph.nodes {
        let words = has(registry, &node.kind, "precision").map(ToString::to_string);
        let Some(words) = words.filter(|_| can_be_double(registry, &node.kind)) else { continue };
        let _ = words;
        let is = node.params.iter().find(|p| p.name == "precision").map(|p| asperity_graph::text_of(&p.value));
        any |= is.as_deref() != Some("\"f64\"");
        let value = Value::made(Kind::Text("f64".into()), &node.place);
        set(node, "precision", &value);
    }
    any.then_some(double)
}

/// Whether a kind has a parameter `precision` that may be `f64`.
fn can_be_double(registry: &Registry, kind: &str) -> bool {
    let Some(kind) = registry.get(kind) else { return false };
    let precision = NodeKind::descriptor(&**kind).params.iter().find(|p| p.name == "precision");
    precision.is_some_and(|p| match &p.kind {
        asperity_node::ParamKind::Choice(words) => words.iter().any(|w| w == "f64"),
        _ => false,
    })
}

/// Spectral convergence of the signal that was made of frames.
fn convergence(heard: &Heard) -> Option<f64> {
    let framing = heard.framing?;
    phase::score(&heard.frames, &framing, &heard.signal).ok().map(|s| s.convergence_db)
}

/// Figures against the physics.
fn whole(heard: &Heard, truth: &Spectrogram, strength: f64, figures: &mut Figures) {
    let rendered: Vec<f64> = heard.acceleration().iter().map(|a| a / strength).collect();
    let Ok(rendered) = Spectrogram::new(&[&rendered], f64::from(heard.rate_hz)) else { return };
    let Ok(agreement) = accuracy::compare(&rendered, truth) else { return };
    figures.insert(Figure::Perceptual, agreement.perceptual);
    figures.insert(Figure::Spectrum, agreement.spectrum_db);
    figures.insert(Figure::Bands, agreement.bands_db);
    figures.insert(Figure::Level, agreement.level_db.abs());
}

/// Figures of the frames themselves, as if all that comes behind were perfect: where the network is the limit. None where there are none.
fn of_model(heard: &Heard, truth: &Spectrogram) -> Option<Figures> {
    let framing = heard.framing?;
    let bin_hz = f64::from(framing.rate_hz) / framing.fft_len as f64;
    let frames = heard.frames.chunks_exact(framing.bins);
    let count = frames.len().min(truth_frames(truth, &framing)).max(1);
    let mut powers = vec![0.0; truth.bins()];
    for frame in frames.take(count) {
        for (bin, power) in powers.iter_mut().enumerate() {
            let at = (accuracy::bin_hz(bin) / bin_hz).round() as usize;
            // An unscaled magnitude of a bin to the power of that bin.
            let x = f64::from(frame.get(at).copied().unwrap_or(0.0)) / framing.bin_scale();
            *power += 0.5 * x * x * accuracy::BIN_POWER / count as f64;
        }
    }
    let want = truth.mean(0..truth.frames());
    let bands = accuracy::band_rms_db(&accuracy::bands_db(&powers, &want));
    Some(BTreeMap::from([
        (Figure::Spectrum, accuracy::spectrum_db(&powers, &want)),
        (Figure::Bands, bands),
        (Figure::Level, accuracy::level_db(&powers, &want).abs()),
    ]))
}

/// Frames of a layout that fit into the time of a truth.
fn truth_frames(truth: &Spectrogram, framing: &asperity_dsp::Framing) -> usize {
    let seconds = truth.frames() as f64 * accuracy::HOP_S;
    (seconds * f64::from(framing.frame_num) / f64::from(framing.frame_den)) as usize
}

/// Whether a setting can be heard at all: it compiles over the first stroke.
///
/// # Errors
/// Why not.
pub fn compiles(setting: &Setting, registry: &Registry, plan: &Plan<'_>) -> Result<(), Diagnostic> {
    let Some(stroke) = plan.strokes.first() else { return Ok(()) };
    let material = plan.materials.first().and_then(|m| m.as_deref());
    let graph = over(&setting.graph, registry, material, plan.seed);
    Chain::new(&graph, registry, motion(stroke.measured.clone(), graph.tick_hz), Options::default()).map(|_| ())
}
