//! Every kind that retrieves phase, between played frames and its output.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use asperity_accuracy::phase::{self, Score};
use asperity_dsp::Framing;
use asperity_node::{Descriptor, FrameLayout, FrameRate, NodeKind, ParamKind, ParamValue};

use crate::case::{Stop, holds, not_applicable};
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
///
/// # Errors
/// There is none.
pub(crate) fn methods(subject: &Subject<'_>, settings: bool) -> Result<Vec<Method>, Stop> {
    let mut all = Vec::new();
    for kind in subject.registry().iter() {
        let d = kind.descriptor();
        let Some(how) = d.retrieval() else { continue };
        // No case knows a value for a parameter that has to be set.
        if has_to_be_set(d, &[]) {
            continue;
        }
        let mut sets = vec![None];
        for p in d.params.iter().filter(|_| settings) {
            let set = |value: String| Some((p.name.to_string(), value));
            match (&p.kind, &p.default) {
                (ParamKind::Choice(words), _) => {
                    sets.extend(words.iter().skip(1).map(|w| set(w.to_string())))
                }
                (ParamKind::Integer(range), Some(ParamValue::Integer(is)))
                    if *is != 0 && range.contains(&0) =>
                {
                    sets.push(set("0".to_owned()));
                }
                _ => {}
            }
        }
        all.extend(sets.into_iter().map(|set| Method {
            kind: d.kind.to_string(),
            set,
            input: how.input.to_owned(),
            spectrum: how.spectrum,
        }));
    }
    if all.is_empty() { not_applicable("no kind retrieves phase") } else { Ok(all) }
}

/// The methods that have a parameter with both of these words, set to the one and to the other.
pub(crate) fn methods_with(subject: &Subject<'_>, param: &str, words: [&str; 2]) -> Vec<[Method; 2]> {
    let has = |kind: &NodeKind| {
        let param = kind.descriptor().params.iter().find(|p| p.name == param);
        let known = |known: &[std::borrow::Cow<'_, str>]| words.iter().all(|w| known.iter().any(|k| k == w));
        param.is_some_and(|p| matches!(&p.kind, ParamKind::Choice(all) if known(all)))
    };
    let of = |d: &Descriptor| {
        let how = d.retrieval()?;
        let (kind, input, spectrum) = (d.kind.to_string(), how.input.to_owned(), how.spectrum);
        Some(words.map(|word| Method {
            kind: kind.clone(),
            set: Some((param.to_owned(), word.to_owned())),
            input: input.clone(),
            spectrum,
        }))
    };
    subject.registry().iter().filter(|k| has(k)).filter_map(|k| of(k.descriptor())).collect()
}

impl Method {
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
    ///
    /// # Errors
    /// Errors of the compiler.
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
                let kind = subject.registry().get("overlap_add");
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
        holds(late.abs() <= most, || format!("a latency of {late} samples"))?;
        Ok(Heard { rig, last, late })
    }
}

/// A method that runs.
pub(crate) struct Heard {
    rig: Rig,
    last: &'static str,
    /// Latency from a frame to the output, in samples.
    late: i64,
}

impl Heard {
    /// Runs so many ticks and appends their samples to `to`.
    ///
    /// # Errors
    /// A sample that is not finite, a node that fails.
    pub(crate) fn hear(&mut self, ticks: u64, to: &mut Vec<f64>) -> Result<(), Stop> {
        for _ in 0..ticks {
            let tick = self.rig.engine.next_tick();
            self.rig.engine.tick();
            let heard = self.rig.audio(self.last, 0);
            to.extend(heard.iter().map(|x| f64::from(*x)));
            let finite = heard.iter().all(|x| x.is_finite());
            holds(finite && self.rig.engine.faults() == 0, || {
                format!("it fails in frame {tick}, or what is heard is not finite")
            })?;
        }
        Ok(())
    }

    /// Runs so many ticks. Answers their samples.
    ///
    /// # Errors
    /// As [`hear`](Self::hear).
    pub(crate) fn next(&mut self, ticks: u64) -> Result<Vec<f64>, Stop> {
        let mut heard = Vec::new();
        self.hear(ticks, &mut heard)?;
        Ok(heard)
    }

    /// Runs so many ticks without keeping the samples.
    ///
    /// # Errors
    /// As [`hear`](Self::hear).
    pub(crate) fn pass(&mut self, ticks: u64) -> Result<(), Stop> {
        let mut heard = Vec::new();
        for _ in 0..ticks {
            heard.clear();
            self.hear(1, &mut heard)?;
        }
        Ok(())
    }

    /// Skips so many ticks.
    pub(crate) fn skip(&mut self, ticks: u64) {
        self.rig.engine.skip(ticks);
    }

    /// Runs so many ticks. Answers their samples without the latency: sample 0 is the first of the first
    /// frame.
    ///
    /// # Errors
    /// As [`hear`](Self::hear).
    pub(crate) fn aligned(&mut self, ticks: u64) -> Result<Vec<f64>, Stop> {
        let mut heard = vec![0.0; usize::try_from(-self.late).unwrap_or(0)];
        self.hear(ticks, &mut heard)?;
        Ok(heard.split_off(usize::try_from(self.late).unwrap_or(0).min(heard.len())))
    }

    /// Ticks until a change of the frames has settled: two windows and the latency.
    pub(crate) fn settles(&self, layout: &FrameLayout) -> u64 {
        let frames_hz = u64::from(layout.frame_rate.num());
        let late = self.late.unsigned_abs() * frames_hz / u64::from(layout.rate_hz);
        let window = u64::from(layout.length) * frames_hz / u64::from(layout.rate_hz);
        2 * window + late
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
///
/// # Errors
/// Magnitudes without a score.
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
pub(crate) fn decibels(found: f64, wanted: f64) -> f64 {
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
    let off: Vec<f64> = phases
        .windows(2)
        .map(|p| {
            let turn = (p[1] - p[0]) / TAU;
            (turn - turn.round()) / 0.5
        })
        .collect();
    let mean = off.iter().sum::<f64>() / off.len().max(1) as f64;
    let scatter = off.iter().fold(0.0, |m: f64, x| m.max((x - mean).abs()));
    (mean, scatter)
}
