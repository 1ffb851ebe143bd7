//! Every kind that retrieves phase, between played frames and its output.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use asperity_accuracy::phase::{self, Score};
use asperity_dsp::Framing;
use asperity_node::{Descriptor, FrameLayout, FrameRate, ParamKind, ParamValue};

use crate::case::{Stop, not_applicable};
use crate::played::{Frames, Played};
use crate::rig::{CaseGraph, Rig, has_to_be_set};
use crate::subject::Subject;

/// Frames a second.
pub(crate) const FRAMES_HZ: u32 = 500;
/// Bins of a window of 0.1 s at 2500 Hz, with that of Nyquist.
pub(crate) const BINS: u32 = 126;
/// Bins of a window of 0.1 s at 500 Hz: the least number, for runs of millions of frames.
pub(crate) const FEW_BINS: u32 = 26;
/// Largest latency that can be aligned \[s\].
const MOST_LATE_S: f64 = 1.0;

/// A kind that retrieves phase, with one of its settings.
pub(crate) struct Method {
    kind: String,
    set: Option<(String, String)>,
    input: String,
    /// Whether it gives spectra, so that an `overlap_add` follows; else it gives samples.
    pub(crate) spectrum: bool,
}

/// All kinds that retrieve phase. With `settings`, also with each word of a choice, and with 0 for an
/// integer that may be 0.
pub(crate) fn methods(subject: &Subject<'_>, settings: bool) -> Result<Vec<Method>, Stop> {
    let mut all = Vec::new();
    // No case knows a value for a parameter that has to be set.
    for d in subject.registry.iter().map(|k| k.descriptor()).filter(|d| !has_to_be_set(d, &[])) {
        all.extend(Method::of(d, None));
        for p in d.params.iter().filter(|_| settings) {
            match (&p.kind, &p.default) {
                (ParamKind::Choice(words), _) => {
                    all.extend(words.iter().skip(1).filter_map(|w| Method::of(d, Some((&p.name, w)))));
                }
                (ParamKind::Integer(range), Some(ParamValue::Integer(is)))
                    if *is != 0 && range.contains(&0) =>
                {
                    all.extend(Method::of(d, Some((&p.name, "0"))));
                }
                _ => {}
            }
        }
    }
    if all.is_empty() { not_applicable("no kind retrieves phase") } else { Ok(all) }
}

/// The methods that have a parameter with both of these words, set to the one and to the other.
pub(crate) fn methods_with(subject: &Subject<'_>, param: &str, words: [&str; 2]) -> Vec<[Method; 2]> {
    let known = |d: &&Descriptor| match d.params.iter().find(|p| p.name == param).map(|p| &p.kind) {
        Some(ParamKind::Choice(known)) => words.iter().all(|w| known.iter().any(|k| k == w)),
        _ => false,
    };
    let all = subject.registry.iter().map(|k| k.descriptor()).filter(known);
    let [one, other] = words.map(|word| Some((param, word)));
    all.filter_map(|d| Some([Method::of(d, one)?, Method::of(d, other)?])).collect()
}

impl Method {
    /// A kind with a setting, if it retrieves phase.
    fn of(d: &Descriptor, set: Option<(&str, &str)>) -> Option<Self> {
        let how = d.retrieval()?;
        let set = set.map(|(param, value)| (param.to_owned(), value.to_owned()));
        Some(Self { kind: d.kind.to_string(), set, input: how.input.to_owned(), spectrum: how.spectrum })
    }

    /// Its name in texts.
    pub(crate) fn name(&self) -> String {
        match &self.set {
            Some((param, value)) => format!("{} ({param}: {value})", self.kind),
            None => self.kind.clone(),
        }
    }

    /// Its kind.
    pub(crate) fn kind(&self) -> &str {
        &self.kind
    }

    /// Begins a run at the first frame.
    pub(crate) fn begin(
        &self,
        subject: &Subject<'_>,
        layout: FrameLayout,
        frames: Frames,
    ) -> Result<Heard, Stop> {
        let params: Vec<(&str, &str)> = self.set.iter().map(|(p, v)| (p.as_str(), v.as_str())).collect();
        let mut graph = CaseGraph::new(layout.frame_rate.num(), 48_000)
            .plays("frames", Played::magnitudes("frames of the case", layout, frames))?
            .node("phase", &self.kind, &params)?
            .wire("frames", &format!("phase.{}", self.input));
        let mut last = "phase";
        if self.spectrum {
            // A window that a method is set to is that of its overlap-add too, where it has one.
            let known = |p: &&(&str, &str)| {
                let kind = subject.registry.get("overlap_add");
                kind.is_some_and(|k| k.descriptor().params.iter().any(|q| q.name == p.0))
            };
            let same: Vec<(&str, &str)> = params.iter().filter(known).copied().collect();
            last = "synthesis";
            graph = graph.node(last, "overlap_add", &same)?.wire("phase", last);
        }
        let rig = graph.node("end", "probe", &[])?.wire(last, "end").rig(subject)?;
        let (num, den) = rig.schedule.latency().as_ratio();
        let late = (num * i64::from(layout.rate_hz)).div_euclid(den);
        let most = (MOST_LATE_S * f64::from(layout.rate_hz)) as i64;
        ensure!(late.abs() <= most, "a latency of {late} samples");
        Ok(Heard { rig, last, layout, late })
    }
}

/// A method that runs.
pub(crate) struct Heard {
    rig: Rig,
    last: &'static str,
    layout: FrameLayout,
    /// Latency from a frame to the output, in samples.
    late: i64,
}

impl Heard {
    /// Runs a tick. Answers its samples.
    fn tick(&mut self) -> Result<&[f32], Stop> {
        let tick = self.rig.engine.next_tick();
        self.rig.engine.tick();
        let heard = self.rig.audio(self.last, 0);
        let sound = heard.iter().all(|x| x.is_finite()) && self.rig.engine.faults() == 0;
        ensure!(sound, "it fails in frame {tick}, or what is heard is not finite");
        Ok(heard)
    }

    /// Runs so many ticks. Answers their samples.
    pub(crate) fn next(&mut self, ticks: u64) -> Result<Vec<f64>, Stop> {
        let mut heard = Vec::new();
        for _ in 0..ticks {
            heard.extend(self.tick()?.iter().map(|x| f64::from(*x)));
        }
        Ok(heard)
    }

    /// Runs so many ticks without keeping the samples.
    pub(crate) fn pass(&mut self, ticks: u64) -> Result<(), Stop> {
        (0..ticks).try_for_each(|_| self.tick().map(|_| ()))
    }

    /// Skips so many ticks.
    pub(crate) fn skip(&mut self, ticks: u64) {
        self.rig.engine.skip(ticks);
    }

    /// Runs so many ticks. Answers their samples without the latency: sample 0 is the first of the first
    /// frame.
    pub(crate) fn aligned(&mut self, ticks: u64) -> Result<Vec<f64>, Stop> {
        let mut heard = vec![0.0; usize::try_from(-self.late).unwrap_or(0)];
        heard.extend(self.next(ticks)?);
        Ok(heard.split_off(usize::try_from(self.late).unwrap_or(0).min(heard.len())))
    }

    /// Ticks until a change of the frames has settled: two windows and the latency.
    pub(crate) fn settles(&self) -> u64 {
        let FrameLayout { rate_hz, length, frame_rate, .. } = self.layout;
        let ticks = |samples: u64| samples * u64::from(frame_rate.num()) / u64::from(rate_hz);
        2 * ticks(u64::from(length)) + ticks(self.late.unsigned_abs())
    }

    /// Runs until a change has settled.
    pub(crate) fn settle(&mut self) -> Result<(), Stop> {
        self.pass(self.settles())
    }
}

/// Windows of 0.1 s, [`FRAMES_HZ`] a second, one per tick.
pub(crate) fn layout(rate_hz: u32, bins: u32) -> FrameLayout {
    layout_at(rate_hz, bins, FRAMES_HZ)
}

/// Windows of 0.1 s, so many a second, one per tick.
pub(crate) fn layout_at(rate_hz: u32, bins: u32, frames_hz: u32) -> FrameLayout {
    let frame_rate = FrameRate::new(frames_hz, 1).expect("a rate above 0");
    FrameLayout { rate_hz, length: rate_hz / 10, bins, frame_rate }
}

/// Amplitude in bin `k` of a sinusoid of amplitude 1 at bin `at`, in a periodic Hann window:
/// `sin(pi d) / (pi d (1 - d^2))`.
pub(crate) fn lobe(at: f64, k: usize) -> f64 {
    let d = k as f64 - at;
    match d.abs() {
        x if x < 1e-9 => 1.0,
        x if (x - 1.0).abs() < 1e-9 => 0.5,
        _ => ((PI * d).sin() / (PI * d * (1.0 - d * d))).abs(),
    }
}

/// Frames whose bins are a function of the frame and the bin.
pub(crate) fn frames(of: impl Fn(u64, usize) -> f64 + Send + Sync + 'static) -> Frames {
    Arc::new(move |n, bins| {
        bins.iter_mut().enumerate().for_each(|(k, m)| *m = of(n, k) as f32);
        true
    })
}

/// Compares the magnitudes of the output with constant frames of `bins`.
pub(crate) fn score(layout: &FrameLayout, bins: impl Fn(usize) -> f64, heard: &[f64]) -> Result<Score, Stop> {
    let framing = framing(layout);
    // The last window's worth is still to come.
    let frames_hz = u64::from(layout.frame_rate.num());
    let frames = (heard.len() as u64 * frames_hz / u64::from(layout.rate_hz)).saturating_sub(frames_hz / 10);
    let frame: Vec<f32> = (0..framing.bins).map(|k| (bins(k) * framing.bin_scale()) as f32).collect();
    let all = frame.repeat(usize::try_from(frames).unwrap_or(0));
    phase::score(&all, &framing, heard).map_err(|e| Stop::Failed(e.to_string()))
}

/// The layout as the figures take it.
pub(crate) fn framing(layout: &FrameLayout) -> Framing {
    Framing {
        rate_hz: layout.rate_hz,
        fft_len: layout.length as usize,
        bins: layout.bins as usize,
        frame_num: layout.frame_rate.num(),
        frame_den: layout.frame_rate.den(),
    }
}

/// The mean square.
pub(crate) fn power(heard: &[f64]) -> f64 {
    heard.iter().map(|x| x * x).sum::<f64>() / heard.len().max(1) as f64
}

/// Decibels between two mean squares.
pub fn decibels(found: f64, wanted: f64) -> f64 {
    10.0 * (found.max(f64::MIN_POSITIVE) / wanted).log10()
}

/// Error of a tone's frequency against `hz`, and its scatter \[Hz\]: from its phase in Hann windows of half
/// a second.
pub(crate) fn detuned(heard: &[f64], rate_hz: f64, hz: f64) -> (f64, f64) {
    let len = (0.5 * rate_hz) as usize;
    let phases: Vec<f64> = heard
        .chunks_exact(len)
        .enumerate()
        .map(|(part, samples)| {
            let (mut re, mut im) = (0.0, 0.0);
            for (i, x) in samples.iter().enumerate() {
                let window = 0.5 - 0.5 * (TAU * i as f64 / len as f64).cos();
                let (sin, cos) = (TAU * hz * ((part * len + i) as f64 / rate_hz)).sin_cos();
                re += window * x * cos;
                im -= window * x * sin;
            }
            im.atan2(re)
        })
        .collect();
    let turns = phases.windows(2).map(|p| (p[1] - p[0]) / TAU);
    let off: Vec<f64> = turns.map(|turn| (turn - turn.round()) / 0.5).collect();
    let mean = off.iter().sum::<f64>() / off.len().max(1) as f64;
    let scatter = off.iter().fold(0.0, |m: f64, x| m.max((x - mean).abs()));
    (mean, scatter)
}
