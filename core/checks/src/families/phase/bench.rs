//! Every kind that retrieves phase, between frames that a case plays and what is heard of them.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use asperity_accuracy::phase::{self, Score};
use asperity_dsp::Framing;
use asperity_graph::GraphFile;
use asperity_node::{Descriptor, FrameLayout, FrameRate, NodeKind, ParamKind, ParamValue};

use crate::case::{Not, holds, not_applicable};
use crate::played::{Frames, Played};
use crate::rig::Rig;
use crate::small::has_to_be_set;
use crate::subject::Subject;

/// Frames a second.
pub(super) const FRAMES_HZ: u32 = 500;
/// Bins of a window of 0.1 s at 2500 Hz, with Nyquist's.
pub(super) const BINS: u32 = 126;
/// Bins of a window of 0.1 s at 500 Hz, with Nyquist's: as few as there can be, for runs of millions of frames.
pub(super) const FEW_BINS: u32 = 26;
/// The most samples by which a method may be early or late and still be followed \[s\].
const MOST_LATE_S: f64 = 1.0;

/// A kind that retrieves phase, in one of the ways in which it can be set.
pub(super) struct Method {
    kind: String,
    set: Option<(String, String)>,
    input: String,
    /// Whether it answers spectra, so that an `overlap_add` has to follow; else it answers samples.
    spectrum: bool,
}

/// All kinds that retrieve phase, as they are; and with `settings` also with each word of a choice, and with 0 where a whole number may be 0 and is not.
///
/// # Errors
/// There is none.
pub(super) fn methods(subject: &Subject<'_>, settings: bool) -> Result<Vec<Method>, Not> {
    let mut all = Vec::new();
    for kind in subject.registry().iter() {
        let d = kind.descriptor();
        let Some(how) = d.retrieval() else { continue };
        // What has to be set is nothing that a case could know.
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

/// The methods that have this parameter with both of these words, set to the one and to the other.
pub(super) fn methods_with(subject: &Subject<'_>, param: &str, words: [&str; 2]) -> Vec<[Method; 2]> {
    let has = |kind: &dyn NodeKind| {
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
    subject.registry().iter().filter(|k| has(&***k)).filter_map(|k| of(k.descriptor())).collect()
}

impl Method {
    /// What a person calls it.
    pub(super) fn name(&self) -> String {
        match &self.set {
            Some((param, value)) => format!("{} ({param}: {value})", self.kind),
            None => self.kind.clone(),
        }
    }

    /// Its kind.
    pub(super) fn kind(&self) -> &str {
        &self.kind
    }

    /// A run from the first frame on.
    ///
    /// # Errors
    /// What the compiler says.
    pub(super) fn begin(
        &self,
        subject: &Subject<'_>,
        layout: FrameLayout,
        frames: Frames,
    ) -> Result<Heard, Not> {
        let mut graph = GraphFile::empty("the case");
        graph.tick_hz = layout.frame_rate.num();
        let (origin, played) = ("the case", "frames of the case");
        let params: Vec<(&str, &str)> = self.set.iter().map(|(p, v)| (p.as_str(), v.as_str())).collect();
        graph.add_node(played, played, &[], origin)?;
        graph.add_node("phase", &self.kind, &params, origin)?;
        graph.add_wire(played, &format!("phase.{}", self.input), origin);
        let mut last = "phase";
        if self.spectrum {
            // A width that a method is set to is that of its overlap-add too, where it has one.
            let known = |p: &&(&str, &str)| {
                let kind = subject.registry().get("overlap_add");
                kind.is_some_and(|k| k.descriptor().params.iter().any(|q| q.name == p.0))
            };
            let same: Vec<(&str, &str)> = params.iter().filter(known).copied().collect();
            last = "synthesis";
            graph.add_node(last, "overlap_add", &same, origin)?;
            graph.add_wire("phase", last, origin);
        }
        graph.add_node("end", "probe", &[], origin)?;
        graph.add_wire(last, "end", origin);
        let rig = Rig::of(subject, &graph, &[Played::magnitudes(played, layout, frames)])?;
        let (num, den) = rig.schedule.latency().as_ratio();
        let late = (num * i64::from(layout.rate_hz)).div_euclid(den);
        let most = (MOST_LATE_S * f64::from(layout.rate_hz)) as i64;
        holds(late.abs() <= most, || format!("a latency of {late} samples"))?;
        Ok(Heard { rig, last, late })
    }
}

/// A method that runs.
pub(super) struct Heard {
    rig: Rig,
    last: &'static str,
    /// Samples from a frame's time to that of what comes out.
    late: i64,
}

impl Heard {
    /// What comes out in so many ticks, added to `to`.
    ///
    /// # Errors
    /// A sample that is not finite, a node that fails.
    pub(super) fn hear(&mut self, ticks: u64, to: &mut Vec<f64>) -> Result<(), Not> {
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

    /// The same, alone.
    ///
    /// # Errors
    /// As [`hear`](Self::hear).
    pub(super) fn next(&mut self, ticks: u64) -> Result<Vec<f64>, Not> {
        let mut heard = Vec::new();
        self.hear(ticks, &mut heard)?;
        Ok(heard)
    }

    /// So many ticks of which nothing is kept, but that they are finite.
    ///
    /// # Errors
    /// As [`hear`](Self::hear).
    pub(super) fn pass(&mut self, ticks: u64) -> Result<(), Not> {
        let mut heard = Vec::new();
        for _ in 0..ticks {
            heard.clear();
            self.hear(1, &mut heard)?;
        }
        Ok(())
    }

    /// Goes on later without running what lies between.
    pub(super) fn skip(&mut self, ticks: u64) {
        self.rig.engine.skip(ticks);
    }

    /// What is heard of the next so many frames, with sample 0 as the first of the first of them.
    ///
    /// # Errors
    /// As [`hear`](Self::hear).
    pub(super) fn aligned(&mut self, ticks: u64) -> Result<Vec<f64>, Not> {
        let mut heard = vec![0.0; usize::try_from(-self.late).unwrap_or(0)];
        self.hear(ticks, &mut heard)?;
        Ok(heard.split_off(usize::try_from(self.late).unwrap_or(0).min(heard.len())))
    }

    /// Ticks after which a change of the frames has shown in full: two windows, and what it is late.
    pub(super) fn settles(&self, layout: &FrameLayout) -> u64 {
        let frames_hz = u64::from(layout.frame_rate.num());
        let late = self.late.unsigned_abs() * frames_hz / u64::from(layout.rate_hz);
        let window = u64::from(layout.length) * frames_hz / u64::from(layout.rate_hz);
        2 * window + late
    }
}

/// Windows of 0.1 s, [`FRAMES_HZ`] a second, a frame each tick.
pub(super) fn layout(rate_hz: u32, bins: u32) -> FrameLayout {
    layout_at(rate_hz, bins, FRAMES_HZ)
}

/// Windows of 0.1 s, so many a second, a frame each tick.
pub(super) fn layout_at(rate_hz: u32, bins: u32, frames_hz: u32) -> FrameLayout {
    // More than none a second is a rate.
    let frame_rate = FrameRate::new(frames_hz, 1).unwrap_or_else(|| unreachable!("a constant"));
    FrameLayout { rate_hz, length: rate_hz / 10, bins, frame_rate }
}

/// The amplitude in bin `k` of a sinusoid of amplitude 1 at place `at`, in a periodic Hann window: `sin(pi d) / (pi d (1 - d^2))`.
pub(super) fn lobe(at: f64, k: usize) -> f64 {
    let d = k as f64 - at;
    match d.abs() {
        x if x < 1e-9 => 1.0,
        x if (x - 1.0).abs() < 1e-9 => 0.5,
        _ => ((PI * d).sin() / (PI * d * (1.0 - d * d))).abs(),
    }
}

/// Frames whose bins are a function of the frame's number and the bin.
pub(super) fn frames(of: impl Fn(u64, usize) -> f64 + Send + Sync + 'static) -> Frames {
    Arc::new(move |n, bins| {
        bins.iter_mut().enumerate().for_each(|(k, m)| *m = of(n, k) as f32);
        true
    })
}

/// How well what is heard has the magnitudes that it was given, of frames that all are `bins`.
///
/// # Errors
/// Magnitudes of which there is no score.
pub(super) fn score(layout: &FrameLayout, bins: impl Fn(usize) -> f64, heard: &[f64]) -> Result<Score, Not> {
    let framing = framing(layout);
    // The last window's worth is still to come.
    let frames_hz = u64::from(layout.frame_rate.num());
    let frames = (heard.len() as u64 * frames_hz / u64::from(layout.rate_hz)).saturating_sub(frames_hz / 10);
    let frame: Vec<f32> = (0..framing.bins).map(|k| (bins(k) * framing.bin_scale()) as f32).collect();
    let all = frame.repeat(usize::try_from(frames).unwrap_or(0));
    phase::score(&all, &framing, heard).map_err(|e| Not::Held(e.to_string()))
}

/// The layout as the figures' crate has it.
pub(super) fn framing(layout: &FrameLayout) -> Framing {
    Framing {
        rate_hz: layout.rate_hz,
        fft_len: layout.length as usize,
        bins: layout.bins as usize,
        frame_num: layout.frame_rate.num(),
        frame_den: layout.frame_rate.den(),
    }
}

/// The mean square.
pub(super) fn power(heard: &[f64]) -> f64 {
    heard.iter().map(|x| x * x).sum::<f64>() / heard.len().max(1) as f64
}

/// Decibels between two mean squares.
pub(super) fn decibels(found: f64, wanted: f64) -> f64 {
    10.0 * (found.max(f64::MIN_POSITIVE) / wanted).log10()
}

/// By how much a tone's frequency differs from `hz`, in Hz, and by how much that scatters: by its phase in windows (Hann) of half a second, half a second apart.
pub(super) fn detuned(heard: &[f64], rate_hz: f64, hz: f64) -> (f64, f64) {
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
