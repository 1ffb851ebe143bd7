//! Every rate, and filters that end or change while they ring.

mod changes;
mod rates;

use std::sync::Arc;

use asperity_graph::ScheduledNode;
use asperity_node::{
    Descriptor, FrameLayout, FrameRate, Latency, RateSpec, Registry, Shape, ShapeSpec, Unit, UnitSpec,
};

use super::phase::{Method, each, frames};
use crate::buffers::denormals;
use crate::case::{Case, Family, Figures, Found, Stop, not_applicable};
use crate::played::{Frames, Motion, Played, Samples, samples};
use crate::rig::{CaseGraph, Rig, has_to_be_set};
use crate::subject::Subject;

const FILTERS: Family = Family("filters_and_rates");

pub(super) const CASES: &[Case] = &[
    FILTERS.graph(
        "rates_of_graph",
        rates::graph,
        "the graph runs at other rates than its own: 100 to 4000 ticks per second, audio from 8 to 192 \
         kHz, including odd rates. With effort `long` every tick rate is run",
        "it runs for 0.25 s, finite, without a fault, with every sample that belongs to a tick. Or it is \
         refused with a place in the file, as where a window of 0.1 s would not be whole. At its own rates \
         it runs",
    ),
    FILTERS.kinds(
        "rates_of_kinds",
        rates::kinds,
        "every kind that retrieves phase runs at such rates, before an overlap-add, a resampler, an \
         inverse and a limiter. Its windows have rate / 10 samples, where that is whole",
        "it runs for 0.25 s, finite, without a fault, with every sample that belongs to a tick. A refusal \
         has a reason and a place",
    ),
    FILTERS.kinds(
        "uneven_hops",
        uneven_hops,
        "frames begin 88 or 89 samples apart (44.1 kHz at 500 frames/s), or ticks have 0 or 1 samples (2.5 \
         kHz synthesis at 4000 ticks/s)",
        "eight tones through every kind that retrieves phase have the level of even hops within 3 dB, most \
         of which random phases take",
    ),
    FILTERS.kinds(
        "any_tick_length",
        any_tick_length,
        "the same signal comes in ticks of 480 samples, of 12, of 44 or 45, of 0 or 1",
        "every kind of filter gives the same samples, within 10^-6 of the largest, where it declares the \
         same latency",
    ),
    FILTERS.kinds(
        "tail_of_filters",
        tails_of_kinds,
        "60 s of silence follow noise through every kind of filter (8 s with effort `quick`)",
        "no sample is ever denormal. From 5 s after its declared tail the output is silent, to the bit",
    ),
    FILTERS.graph(
        "tail_of_graph",
        tail_of_graph,
        "a stylus that stroked for 1 s is lifted and held still for 60 s (10 s with effort `quick`)",
        "no value on any wire is ever denormal. From 6 s on every sample of every sound card is zero",
    ),
    FILTERS.kinds(
        "change_while_ringing",
        changes::run,
        "every number of every kind of filter, and of `velocity`, changes while a signal of 100 Hz runs \
         through: to either end of its range, and back",
        "no step is larger than the steps of both signals and of a crossfade between them in 10 ms. Half a \
         second later the level is that of a run without a change, within 1 dB, if that has settled. \
         Nothing fails",
    ),
];

/// A kind with one signal in and one out.
struct Filter {
    kind: String,
    /// Of its input.
    unit: Unit,
    /// Whether its input takes audio of any rate.
    any_rate: bool,
}

impl Filter {
    /// A graph of it alone, behind a source at a rate of its own or at the graph's.
    fn alone(
        &self,
        (tick_hz, audio_hz): (u32, u32),
        rate_hz: Option<u32>,
        samples: Samples,
    ) -> Result<CaseGraph, Stop> {
        let (name, unit) = ("a signal from memory", self.unit.clone());
        let source = match rate_hz {
            Some(hz) => Played::audio_at(name, hz, unit, samples),
            None => Played::audio(name, unit, samples),
        };
        let graph = CaseGraph::new(tick_hz, audio_hz)
            .plays("source", source)?
            .node("it", &self.kind, &[])?
            .node("out", "probe", &[])?;
        Ok(graph.chain(&["source", "it", "out"]))
    }
}

/// Every kind of filter that needs no parameter.
fn filters(registry: &Registry) -> Vec<Filter> {
    registry.iter().filter_map(|kind| filter(kind.descriptor())).collect()
}

fn filter(d: &Descriptor) -> Option<Filter> {
    let mut required = d.inputs.iter().filter(|i| !i.optional);
    let (Some(input), None, [output]) = (required.next(), required.next(), d.outputs.as_slice()) else {
        return None;
    };
    let sound = |shape: &ShapeSpec| matches!(shape, ShapeSpec::Audio(_) | ShapeSpec::Like(_));
    if !sound(&input.shape) || !sound(&output.shape) || input.limited || has_to_be_set(d, &[]) || d.sink {
        return None;
    }
    let unit = match &input.unit {
        UnitSpec::Is(unit) => unit.clone(),
        UnitSpec::Of { among, .. } => among.first().cloned().unwrap_or(Unit::AMPERE),
    };
    let any_rate = matches!(input.shape, ShapeSpec::Audio(RateSpec::Of(_)) | ShapeSpec::Like(_));
    Some(Filter { kind: d.kind.to_string(), unit, any_rate })
}

/// Windows of 0.1 s, about 500 a second, and the ticks per frame. None where a window is not whole.
fn windows(rate_hz: u32, tick_hz: u32) -> Option<(FrameLayout, u32)> {
    let every = (tick_hz / 500).max(1);
    let length = rate_hz.is_multiple_of(10).then_some(rate_hz / 10)?;
    let frame_rate = FrameRate::new(tick_hz, every)?;
    Some((FrameLayout { rate_hz, length, bins: (length / 2 + 1).min(101), frame_rate }, every))
}

/// A graph from magnitudes through a method to the drive of a coil.
fn chain(
    method: &Method,
    (tick_hz, audio_hz): (u32, u32),
    (layout, every): (FrameLayout, u32),
    frames: Frames,
) -> Result<CaseGraph, Stop> {
    let mut graph = CaseGraph::new(tick_hz, audio_hz)
        .plays("magnitudes", Played::magnitudes("magnitudes from memory", layout, frames))?
        .node("phase", &method.kind, &[])?
        .node("audio rate", "resample", &[])?
        .node("inverse", "actuator_inverse", &[])?
        .node("limiter", "limiter", &[])?
        .node("out", "audio_out", &[])?
        .wire("magnitudes", "phase");
    graph.graph.set(&format!("magnitudes.every={every}"), "the case")?;
    let after = if method.spectrum { "overlap" } else { "phase" };
    if method.spectrum {
        graph = graph.node("overlap", "overlap_add", &[])?.wire("phase", "overlap");
    }
    Ok(graph.chain(&[after, "audio rate", "inverse", "limiter", "out"]))
}

/// Sample `n` of noise between -1 and 1.
fn noise(seed: u64, n: u64) -> f32 {
    (2.0 * asperity_node::random::uniform(seed, n) - 1.0) as f32
}

/// Tick rates: 96 samples at 48 kHz as the reference, then 480, 12, 19 or 20, 144 or 145, 48 or 49.
const TICKS_HZ: [u32; 6] = [500, 100, 4000, 2500, 333, 997];

fn any_tick_length(subject: &Subject<'_>) -> Found {
    let kinds = filters(&subject.registry);
    let (mut compared, mut figures) = (0, Figures::default());
    let seconds = subject.by_effort(0.4, 1.0, 10.0);
    // Loud, then silent, then quiet: so that nodes limit and sleep.
    let sound = samples(|n| noise(3, n) * [2.0, 0.0, 0.1][(n / 7001 % 3) as usize]);
    let places = [(None, 48_000), (None, 44_100), (Some(2500), 48_000), (Some(4410), 44_100)];
    let all = kinds.iter().flat_map(|kind| places.map(|place| (kind, place)));
    for (kind, (rate_hz, audio_hz)) in all.filter(|(kind, place)| kind.any_rate || place.0.is_none()) {
        // A filter that has to wait longer for short ticks declares another latency.
        let mut known: Vec<(Latency, Vec<f32>)> = Vec::new();
        for tick_hz in TICKS_HZ {
            let graph = kind.alone((tick_hz, audio_hz), rate_hz, sound.clone())?;
            let place = || format!("`{}`, {tick_hz} ticks/s, {:?} Hz of {audio_hz}", kind.kind, rate_hz);
            let mut rig = match graph.rig(subject) {
                Ok(rig) => rig,
                // Another case looks at refusals.
                Err(_) if rate_hz.is_some() || tick_hz != TICKS_HZ[0] => continue,
                Err(e) => return Err(e.after(&place())),
            };
            let node = rig.schedule.index_of("it").unwrap_or(0);
            let ScheduledNode { outputs, latency, .. } = &rig.schedule.clone().nodes[node];
            let Some(Shape::Audio { rate_hz: out_hz }) = outputs.first().map(|o| o.port.shape) else {
                continue;
            };
            let mut now = rig.heard(rig.ticks(seconds) + 1, "it").map_err(|e| e.after(&place()))?;
            now.truncate((seconds * f64::from(out_hz)) as usize);
            ensure!(!now.is_empty(), "{}: it gives no output", place());
            let Some((_, first)) = known.iter().find(|(l, _)| l == latency) else {
                known.push((*latency, now));
                continue;
            };
            let largest = first.iter().fold(0.0_f32, |m, x| m.max(x.abs())).max(1e-12);
            let off = first.iter().zip(&now).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / largest;
            let off = figures.at_most(f64::from(off), 1e-6, "of its largest sample off");
            off.map_err(|e| e.after(&place()))?;
            compared += 1;
        }
    }
    if compared == 0 {
        return not_applicable("there is no filter");
    }
    Ok(format!("{} kinds, compared {compared} times: {figures}", kinds.len()))
}

/// Bins of eight tones, 100 to 800 Hz at windows of 0.1 s. With so many, random phases even out.
const BINS: [usize; 8] = [10, 20, 30, 40, 50, 60, 70, 80];
/// Allowed difference of levels \[dB\].
const WITHIN_DB: f64 = 3.0;

/// Rates of synthesis, ticks and audio: uneven, then even.
const PLACES: [[(u32, u32, u32); 2]; 3] = [
    [(44_100, 500, 44_100), (48_000, 500, 48_000)],
    [(2500, 4000, 48_000), (2500, 500, 48_000)],
    [(4410, 997, 44_100), (4410, 882, 44_100)],
];

/// Rms of tones of amplitude 1 through a method \[m/s^2\].
fn level(
    subject: &Subject<'_>,
    method: &Method,
    (rate_hz, tick_hz, audio_hz): (u32, u32, u32),
    seconds: f64,
) -> Result<f64, Stop> {
    let Some(windows) = windows(rate_hz, tick_hz) else { return not_applicable("no windows are whole") };
    // A periodic Hann window's transform of a sine on a bin.
    let near = |k: usize, at: usize| [1.0, 0.5].get(k.abs_diff(at)).copied().unwrap_or(0.0);
    let tones = frames(move |_, k| BINS.iter().map(|at| near(k, *at)).fold(0.0, f64::max));
    let mut rig = chain(method, (tick_hz, audio_hz), windows, tones)?.rig(subject)?;
    rig.heard(rig.ticks(0.4), "audio rate")?;
    let heard = rig.heard(rig.ticks(seconds), "audio rate")?;
    Ok((heard.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / heard.len().max(1) as f64).sqrt())
}

fn uneven_hops(subject: &Subject<'_>) -> Found {
    let places = subject.by_effort(&PLACES[..2], &PLACES[..], &PLACES[..]);
    let seconds = subject.by_effort(0.5, 1.0, 10.0);
    each(subject, false, |method, figures| {
        for [uneven, even] in places {
            let [a, b] = [level(subject, method, *uneven, seconds)?, level(subject, method, *even, seconds)?];
            let db = (20.0 * (a.max(1e-9) / b.max(1e-9)).log10()).abs();
            let off = figures.at_most(db, WITHIN_DB, "dB off the level with even hops");
            off.map_err(|e| e.after(&format!("at {} Hz, {} ticks/s", uneven.0, uneven.1)))?;
        }
        Ok(())
    })
}

/// Duration of the silence \[s\].
const SILENCE_S: f64 = 60.0;
/// Time beyond its declared tail in which a filter falls silent \[s\]: a first-order high-pass at 2.3 Hz
/// falls to 10^-30 in 5 s.
const FILTER_S: f64 = 5.0;
/// The same of a graph \[s\], with the time of a 20 Hz low-pass until the stylus is still.
const GRAPH_S: f64 = 6.0;
/// Duration of the sound before \[s\].
const SOUND_S: f64 = 1.0;

fn tails_of_kinds(subject: &Subject<'_>) -> Found {
    let kinds = filters(&subject.registry);
    if kinds.is_empty() {
        return not_applicable("there is no filter");
    }
    let (silence, mut figures) = (subject.by_effort(8.0, SILENCE_S, SILENCE_S), Figures::default());
    let all = kinds.iter().flat_map(|kind| [(kind, None), (kind, Some(2500))]);
    for (kind, rate_hz) in all.filter(|(kind, rate)| kind.any_rate || rate.is_none()) {
        let end = (SOUND_S * f64::from(rate_hz.unwrap_or(48_000))) as u64;
        let sound = samples(move |n| if n < end { noise(4, n) } else { 0.0 });
        figures.about = format!("`{}`", kind.kind);
        let mut rig = match kind.alone((500, 48_000), rate_hz, sound)?.rig(subject) {
            Ok(rig) => rig,
            // It may take other rates than this one.
            Err(_) if rate_hz.is_some() => continue,
            Err(e) => return Err(e.after(&figures.about)),
        };
        let tails = rig.schedule.nodes.iter().map(|n| n.tail);
        let tail = tails.fold(Latency::ZERO, |all, one| all + one).ms().max(0.0) * 1e-3;
        let sounds = |rig: &Rig| rig.audio("it", 0).iter().any(|x| *x != 0.0);
        let silent = last_sound(&mut rig, SOUND_S + silence, sounds).and_then(|last| {
            figures.at_most(last - SOUND_S - tail, FILTER_S, "s after the end and its tail it sounds")
        });
        silent.map_err(|e| e.after(&format!("`{}`", kind.kind)))?;
    }
    Ok(format!("{} kinds: {figures}", kinds.len()))
}

/// Time of the last sound \[s\].
fn last_sound(rig: &mut Rig, seconds: f64, sounds: impl Fn(&Rig) -> bool) -> Result<f64, Stop> {
    let mut last = 0;
    rig.run(rig.ticks(seconds), |rig, tick| {
        if let Some(output) = rig.first_output(|b| denormals(b) > 0) {
            bail!("`{output}` is denormal in tick {tick}");
        }
        if sounds(rig) {
            last = tick + 1;
        }
        Ok(())
    })?;
    rig.sound()?;
    Ok(last as f64 / f64::from(rig.schedule.tick_hz))
}

fn tail_of_graph(subject: &Subject<'_>) -> Found {
    let hz = f64::from(subject.its_graph()?.tick_hz);
    let until = (SOUND_S * hz) as u64;
    let stroke = |touches: bool| -> Motion {
        Arc::new(move |tick| {
            let turn = 3.0 * tick.min(until) as f64 / hz;
            let z = if touches && tick < until { -1.0 } else { 100.0 };
            [20.0 * turn.cos(), 20.0 * turn.sin(), z]
        })
    };
    let played = |rig: &Rig| rig.drive().flatten().any(|x| *x != 0.0);
    let mut never = Rig::new(subject, stroke(false), &[])?;
    if !never.drives() {
        return not_applicable("nothing in this graph plays on a sound card");
    }
    if last_sound(&mut never, 2.0, played)? > 0.0 {
        return not_applicable("this graph plays without being touched");
    }
    let mut rig = Rig::new(subject, stroke(true), &[])?;
    let silence = subject.by_effort(10.0, SILENCE_S, SILENCE_S);
    let after = last_sound(&mut rig, SOUND_S + silence, played)? - SOUND_S;
    ensure!(after <= GRAPH_S, "something is played until {after:.2} s after");
    if after == -SOUND_S {
        return not_applicable("nothing was played while the stylus stroked");
    }
    Ok(format!(
        "silent {after:.2} s after the stylus is lifted, for the rest of {silence} s; nothing denormal"
    ))
}
