//! Accuracy of a setting, over every stroke, material and draw.

use std::collections::HashMap;

use asperity_accuracy::accuracy::rhythm::{self, Rhythm};
use asperity_accuracy::accuracy::{
    self, AccuracyError, Agreement, BINS, FIRST_HZ, HOP_S, STEP_HZ, Spectrogram,
};
use asperity_accuracy::phase;
use asperity_data::made;
use asperity_diagnostics::Diagnostic;
use asperity_diagnostics::ron::{Kind, Value};
use asperity_engine::Options;
use asperity_graph::GraphFile;
use asperity_node::{ParamKind, Registry};

use crate::chain::{Chain, Path3, Rendered, STRAIGHT, over, stepped_paths, straight};
use crate::figure::{Figure, Figures, mean};
use crate::knob::{has, set};
use crate::patch::{Patch, place_stroke};
use crate::results::Row;
use crate::run::Prepared;
use crate::setting::Setting;
use crate::stroke::Known;
use crate::time::Monitor;

/// The ground truth of a stroke: accelerations that a pen feels over several places of the same surface, or
/// recorded ones.
#[derive(Clone, Debug, Default)]
pub(crate) struct Truth {
    /// Short-time powers.
    pub spectrograms: Vec<Spectrogram>,
    /// Rhythms along the principal axis; none of a signal shorter than 0.5 s.
    pub rhythms: Vec<Rhythm>,
}

impl Truth {
    /// Adds an acceleration along some axes \[m/s^2\].
    pub(crate) fn add(&mut self, axes: &[&[f64]], rate_hz: f64) -> Result<(), AccuracyError> {
        self.spectrograms.push(Spectrogram::new(axes, rate_hz)?);
        self.rhythms.extend(Rhythm::new(axes, rate_hz));
        Ok(())
    }
}

/// Ground truths by index of the stroke, material and draw.
pub(crate) type Truths = HashMap<(usize, String, u64), Truth>;

impl Prepared<'_> {
    /// Measures accuracy and lag of a setting into its row. Returns figures of the network's own magnitudes;
    /// none where the run is to stop.
    pub(crate) fn accuracy(
        &self,
        row: &mut Row,
        setting: &Setting<'_>,
        truths: &Truths,
        monitor: &dyn Monitor,
    ) -> Result<Option<Figures>, Diagnostic> {
        let (tradeoff, registry) = (self.job.tradeoff, &setting.base.registry);
        let (mut models, mut lags_ms) = (Vec::new(), Vec::new());
        let double = in_double(&setting.graph, registry);
        let patch = Patch::of(&setting.graph, registry)?;
        let strokes: Vec<Path3> = self.strokes.iter().map(|s| place_stroke(patch.as_ref(), s)).collect();
        let mut paths: Vec<Path3> = strokes.iter().cloned().chain(stepped_paths(patch.as_ref())).collect();
        paths.push(straight());
        let options = Options { sleep: false, check_finite: setting.guards, ..Options::default() };
        for draw in 0..tradeoff.draws {
            let seed = tradeoff.seed.wrapping_add(draw);
            let mut all = Vec::new();
            let mut compared = true;
            for (m, material) in self.materials.iter().enumerate() {
                let material = material.as_deref();
                let graph = over(&setting.graph, registry, material, seed);
                let mut chain = Chain::new(&graph, registry, paths.clone(), options)?;
                row.latency_ms.get_or_insert(chain.latency().ms());
                for (s, stroke) in self.strokes.iter().enumerate().filter(|(_, s)| s.goes_over(material)) {
                    if monitor.stopped() {
                        return Ok(None);
                    }
                    chain.play(s);
                    let rendered = chain.render(stroke.seconds);
                    let mut figures = Figures::new();
                    figures.extend(convergence(&rendered).map(|db| (Figure::Convergence, db)));
                    // A recording is the same in every draw.
                    let truth = match &stroke.known {
                        Known::Felt(felt) => Some(felt),
                        Known::Hand(_) => material.and_then(|m| truths.get(&(s, m.to_owned(), draw))),
                    };
                    if let Some(truth) = truth {
                        against_physics(&rendered, truth, setting.base.strength, &mut figures);
                        models.extend(of_model(&rendered, &truth.spectrograms));
                    }
                    // Double precision is slow, so only one stroke over one material is compared.
                    if let Some(double) = double.as_ref().filter(|_| std::mem::take(&mut compared)) {
                        let graph = over(double, registry, material, seed);
                        let mut wide = Chain::new(&graph, registry, strokes.clone(), options)?;
                        wide.play(s);
                        let wide = wide.render(stroke.seconds);
                        let db = accuracy::waveform_db(&wide_of(rendered.last()), &wide_of(wide.last()));
                        figures.extend(db.ok().map(|db| (Figure::Precision, db)));
                    }
                    all.push(figures);
                    monitor.advanced(1);
                }
                // A scene has no room for a straight stroke.
                let pitch = material.and_then(|m| made::pitch_mm(&made::surface(m).ok()?));
                if let Some(pitch_mm) = pitch.filter(|_| patch.is_none()) {
                    chain.play(paths.len() - 1);
                    all.extend(repeats(&mut chain, pitch_mm).map(|ms| Figures::from([(Figure::Pitch, ms)])));
                }
                if m == 0 {
                    lags_ms.extend(chain.lag_ms(strokes.len(), tradeoff.steps));
                    monitor.advanced(1);
                }
                row.faults += chain.faults();
            }
            row.draws.push(mean(all.iter()));
        }
        row.figures = mean(row.draws.iter());
        let mean_lag = |i: usize| lags_ms.iter().map(|l: &[f64; 3]| l[i]).sum::<f64>() / lags_ms.len() as f64;
        row.lag_ms = (!lags_ms.is_empty()).then(|| std::array::from_fn(mean_lag));
        row.lag_draws_ms = lags_ms.iter().map(|l| l[1]).collect();
        Ok(Some(mean(models.iter())))
    }
}

fn wide_of(x: &[f32]) -> Vec<f64> {
    x.iter().map(|x| f64::from(*x)).collect()
}

/// The same setting in double precision; none where no node can change to it.
fn in_double(graph: &GraphFile, registry: &Registry) -> Option<GraphFile> {
    let mut double = graph.clone();
    let mut any = false;
    for node in &mut double.nodes {
        if !can_be_double(registry, &node.kind) {
            continue;
        }
        let is = node.params.iter().find(|p| p.name == "precision").map(|p| p.value.to_string());
        any |= is.as_deref().map(|word| word.trim_matches('"')) != Some("f64");
        let value = Value::made(Kind::Text("f64".into()), &node.place);
        set(node, "precision", &value);
    }
    any.then_some(double)
}

/// Whether a kind has a parameter `precision` that may be `f64`.
fn can_be_double(registry: &Registry, kind: &str) -> bool {
    let f64s =
        |kind: &ParamKind| matches!(kind, ParamKind::Choice(words) if words.iter().any(|w| w == "f64"));
    has(registry, kind, "precision").is_some_and(f64s)
}

/// Spectral convergence of the signal retrieved from frames.
fn convergence(rendered: &Rendered) -> Option<f64> {
    let framing = rendered.framing?;
    phase::score(&rendered.frames, &framing, &rendered.signal).ok().map(|s| s.convergence_db)
}

/// Error of the lag at which a straight stroke over a grating repeats, against the pitch over the speed
/// \[ms\]. None of silence.
fn repeats(chain: &mut Chain, pitch_mm: f64) -> Option<f64> {
    let (speed_mm_s, [settles_s, seconds]) = STRAIGHT;
    let (felt, rate_hz) = chain.render_output(settles_s + seconds);
    let felt = wide_of(felt.get((settles_s * f64::from(rate_hz)) as usize..)?);
    let after_s = pitch_mm / speed_mm_s;
    let sounds = felt.iter().any(|x| x.abs() > 1e-6);
    let repeat = rhythm::repeats_at(&felt, f64::from(rate_hz), after_s).ok().filter(|_| sounds)?;
    Some(1e3 * (repeat.lag_s - after_s).abs())
}

/// Adds the figures against the physics.
fn against_physics(rendered: &Rendered, truth: &Truth, strength: f64, figures: &mut Figures) {
    let signal: Vec<f64> = rendered.acceleration().iter().map(|a| a / strength).collect();
    let rate_hz = f64::from(rendered.rate_hz);
    let Ok(spectrogram) = Spectrogram::new(&[&signal], rate_hz) else { return };
    let Ok(agreement) = accuracy::compare(&spectrogram, &truth.spectrograms) else { return };
    figures.extend(of_agreement(&agreement));
    // A truth of a low rate has nothing above half of it.
    let end_hz = truth.rhythms.iter().map(|r| r.end_hz).fold(rhythm::END_HZ, f64::min);
    let Ok(rhythm) = Rhythm::up_to(&[&signal], rate_hz, end_hz) else { return };
    let Ok(agreement) = rhythm::compare(&rhythm, &truth.rhythms) else { return };
    figures.extend([
        (Figure::Modulation, agreement.modulation_db),
        (Figure::Repetition, agreement.repetition),
        (Figure::Kurtosis, agreement.kurtosis_db),
        (Figure::Steadiness, agreement.steadiness_db),
    ]);
}

/// Figures of the frames themselves: a reference for the nodes behind them. None without frames.
///
/// A magnitude A in a bin stands for the power A^2 / 3, which a spectrogram has of a sine of amplitude A.
fn of_model(rendered: &Rendered, truth: &[Spectrogram]) -> Option<Figures> {
    let framing = rendered.framing?;
    let bin_hz = f64::from(framing.rate_hz) / framing.fft_len as f64;
    let bins: Vec<&[f32]> = rendered.frames.chunks_exact(framing.bins).collect();
    let frame_hz = f64::from(framing.frame_num) / f64::from(framing.frame_den);
    let mut powers = Vec::new();
    for number in 0..truth.iter().map(Spectrogram::frames).min()? {
        // The frame with the nearest start.
        let frame = bins.get((number as f64 * HOP_S * frame_hz).round() as usize)?;
        powers.push(std::array::from_fn(|bin| {
            let hz = FIRST_HZ + STEP_HZ * bin as f64;
            let x = f64::from(frame.get((hz / bin_hz).round() as usize).copied().unwrap_or(0.0));
            (x / framing.bin_scale()).powi(2) / 3.0
        }));
    }
    let agreement = accuracy::compare(&Spectrogram::from_powers(BINS, powers), truth).ok()?;
    Some(of_agreement(&agreement))
}

fn of_agreement(agreement: &Agreement) -> Figures {
    Figures::from([
        (Figure::Perceptual, agreement.perceptual),
        (Figure::Spectrum, agreement.spectrum_db),
        (Figure::Bands, agreement.bands_db),
        (Figure::Level, agreement.level_db.abs()),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// Frames of a sine at 100 Hz under a Hann window of 0.1 s: its amplitude in its bin, half of it beside.
    fn sine_frames(amplitude: f32) -> Rendered {
        let framing =
            asperity_dsp::Framing { rate_hz: 2500, fft_len: 250, bins: 126, frame_num: 100, frame_den: 1 };
        let scale = framing.bin_scale() as f32;
        let mut frame = vec![0.0; framing.bins];
        frame[9..12].copy_from_slice(&[0.5, 1.0, 0.5].map(|part: f32| part * amplitude * scale));
        Rendered { frames: frame.repeat(300), framing: Some(framing), ..Rendered::default() }
    }

    fn sine(amplitude: f64, rate_hz: f64) -> Spectrogram {
        let wave = |n: u32| amplitude * (std::f64::consts::TAU * 100.0 * f64::from(n) / rate_hz).sin();
        let signal: Vec<f64> = (0..(2.0 * rate_hz) as u32).map(wave).collect();
        Spectrogram::new(&[&signal], rate_hz).unwrap()
    }

    #[test]
    fn double_precision_is_recognised_however_written() {
        let registry = asperity_nodes::registry();
        let double = |precision: &str| {
            let node = format!(r#""r": (kind: "resample", params: ({precision}))"#);
            in_double(&crate::testing::graph_of("g.ron", &node, ""), &registry).is_some()
        };
        assert!(double("") && double("precision: f32") && double("precision: \"f32\""));
        assert!(!double("precision: \"f64\"") && !double("precision: f64"));
    }

    #[test]
    fn faults_in_the_steps_of_speed_are_counted() {
        let mut registry = asperity_nodes::registry();
        // Later than the stroke ends, and earlier than the steps end.
        let late = std::sync::Arc::new(|tick: u64, out: &mut [f64]| {
            out.fill(if tick == 2000 { f64::NAN } else { 0.0 });
        });
        let late = asperity_checks::played::Played::control("fails late", 1, asperity_node::Unit::NONE, late);
        registry.add(late);
        let nodes = r#""stylus": (kind: "stroke"), "late": (kind: "fails late")"#;
        let mut graph = crate::testing::graph_of("g.ron", nodes, "");
        for from in ["stylus.position", "late.out"] {
            let to = format!("{from} probe").replace('.', " ");
            graph.add_node(&to, "probe", &[], "test").unwrap();
            graph.add_wire(from, &to, "test");
        }
        let bases = [crate::LoadedGraph { registry, ..crate::testing::loaded("g", graph) }];
        let strokes = r#"strokes: [(name: "c", seconds: 1.5)], steps: 10"#;
        let tradeoff = crate::testing::tradeoff("g.ron", strokes);
        let settings = crate::setting::Settings::new(&tradeoff, &bases, &[]).unwrap();
        struct Nobody;
        impl Monitor for Nobody {}
        let job = crate::testing::job(&tradeoff, &[], Path::new(""));
        let prepared = Prepared::new(&job).unwrap();
        let mut row = Row::default();
        prepared.accuracy(&mut row, &settings.all[0], &Truths::default(), &Nobody).unwrap().unwrap();
        // Once with steps and once at constant speed, in each of two draws.
        assert_eq!(row.faults, 4);
    }

    #[test]
    fn rhythm_figures_tell_pulses_from_noise() {
        let noise = |seed: u64, pulses: bool| -> Vec<f64> {
            let number =
                |n: u64| (0..12).map(|k| asperity_node::random::uniform(seed, 12 * n + k)).sum::<f64>() - 6.0;
            let level = |n: u64| if pulses && n % 500 < 250 { 0.3 } else { 1.0 };
            (0..30_000).map(|n| level(n) * number(n)).collect()
        };
        let mut truth = Truth::default();
        (1..5).for_each(|seed| truth.add(&[&noise(seed, false)], 10_000.0).unwrap());
        let figures = |pulses| {
            let felt: Vec<f32> = noise(9, pulses).into_iter().map(|x| x as f32).collect();
            let mut figures = Figures::new();
            against_physics(
                &Rendered { felt, rate_hz: 10_000, ..Rendered::default() },
                &truth,
                1.0,
                &mut figures,
            );
            figures
        };
        let (fair, pulsed) = (figures(false), figures(true));
        assert!(fair[&Figure::Modulation] < 1.5 && fair[&Figure::Repetition] < 0.1, "{fair:?}");
        assert!(fair[&Figure::Kurtosis] < 0.2 && fair[&Figure::Steadiness] < 0.3, "{fair:?}");
        assert!(pulsed[&Figure::Modulation] > 6.0 && pulsed[&Figure::Repetition] > 0.3, "{pulsed:?}");
        // The perceptual figure does not see it: 50 ms are within one segment.
        assert!(pulsed[&Figure::Perceptual] > 0.7 && fair.len() == 8, "{pulsed:?}");
    }

    #[test]
    fn grating_repeats_at_its_pitch_and_sandpaper_does_not() {
        let registry = asperity_nodes::registry();
        let graph = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs/texture.ron");
        let graph = GraphFile::read(graph).unwrap();
        let pitch_mm = made::pitch_mm(&made::surface("sine grating 1.6 mm").unwrap()).unwrap();
        let off = |material: &str| {
            let graph = over(&graph, &registry, Some(material), 3);
            let mut chain = Chain::new(&graph, &registry, vec![straight()], Options::default()).unwrap();
            repeats(&mut chain, pitch_mm).unwrap()
        };
        let (grating, sandpaper) = (off("sine grating 1.6 mm"), off("sandpaper P80"));
        assert!(grating < 0.3 && sandpaper > 1.0, "{grating} {sandpaper}");
        assert_eq!(made::pitch_mm(&made::surface("sandpaper P80").unwrap()), None);
    }

    #[test]
    fn magnitudes_of_a_sine_match_its_spectrum() {
        let truth = [sine(3.0, 10_000.0)];
        let same = of_model(&sine_frames(3.0), &truth).unwrap();
        assert!((same[&Figure::Perceptual] - 1.0).abs() < 1e-3, "{same:?}");
        for figure in [Figure::Level, Figure::Spectrum, Figure::Bands] {
            assert!(same[&figure].abs() < 0.05, "{same:?}");
        }
        // Twice the amplitude: 6.02 dB, in whatever unit of the DFT.
        let twice = of_model(&sine_frames(6.0), &truth).unwrap();
        assert!((twice[&Figure::Level] - 20.0 * 2_f64.log10()).abs() < 0.05, "{twice:?}");
        assert!(twice[&Figure::Perceptual] < 0.9, "{twice:?}");
        assert!(of_model(&Rendered::default(), &truth).is_none());
    }
}
