//! Textures of autoregressive models: levels against closed forms, and signals that die away.

use std::sync::Arc;

use asperity_autoregressive::{Filter, Texture};
use asperity_graph::NodeDecl;
use asperity_node::{Settings, Unit, random};

use super::phase::decibels;
use crate::case::{Case, Family, Figures, Found, Stop, not_applicable};
use crate::played::{Played, Values};
use crate::rig::{CaseGraph, Rig};
use crate::subject::{Effort, Subject};

const AUTOREGRESSIVE: Family = Family("autoregressive");

pub(super) const CASES: &[Case] = &[AUTOREGRESSIVE.graph(
    "own_models",
    own_models,
    "the graph's own textures at every vertex, driven across all of them in every tick, and let go",
    "levels are those of the closed forms within 1.5 dB and the scatter of a draw, or lower by the \
         part above half the models' rate. Across the vertices they are at most 1.3 times the loudest \
         place. Let go, they are silent within the time of their poles, and no sample is denormal",
)];

fn own_models(subject: &Subject<'_>) -> Found {
    let benches = Bench::of_graph(subject)?;
    if benches.iter().all(|b| b.slots.is_empty()) {
        return not_applicable("no node of this graph renders autoregressive models");
    }
    let seconds = subject.by_effort(4.0, 10.0, 600.0);
    let most = subject.by_effort(2, 8, usize::MAX);
    let (mut figures, mut slots) = (Figures::default(), 0);
    for bench in &benches {
        for (slot, voices) in bench.slots.iter().enumerate().take(most) {
            slots += 1;
            let models = voices.iter().flat_map(|v| v.texture.models());
            let at = models.map(|m| [m.speed_mm_s, m.force_n]).filter(|at| at[0] > 0.0 && at[1] > 0.0);
            let at: Vec<[f64; 2]> = at.collect();
            let step = if subject.effort == Effort::Long { 1 } else { at.len().div_ceil(6).max(1) };
            for at in at.iter().step_by(step) {
                figures.note(at_vertex(bench, slot, voices, *at, seconds)?, "dB off at a vertex");
            }
            let corners = at.clone();
            let way: Way = Arc::new(move |tick| {
                let count = corners.len().max(1);
                corners.get(random::bits(7, tick) as usize % count).copied().unwrap_or([100.0, 1.0])
            });
            let (rms, _) = across(bench, slot, &way, seconds, 1.3, 9.0)
                .map_err(|e| e.after(&format!("slot {slot}, across all models")))?;
            figures.note(rms, "times the loudest place, across all");
            let_go(bench, slot, voices, &at)?;
        }
    }
    Ok(format!("{slots} slots: {figures}"))
}

/// Error of the level at a vertex \[dB\].
fn at_vertex(
    bench: &Bench<'_>,
    slot: usize,
    voices: &[Voice],
    at: [f64; 2],
    seconds: f64,
) -> Result<f64, Stop> {
    let wanted = closed_form(voices, at);
    let mut heard = bench.begin(slot, stay(at))?;
    heard.square(1.0)?;
    let found = heard.square(seconds)?;
    let here = format!("slot {slot} at {:.0} mm/s and {:.2} N", at[0], at[1]);
    if wanted == 0.0 {
        ensure!(found == 0.0, "{here}: it sounds");
        return Ok(0.0);
    }
    // The part below 0.4 of a model's rate must sound, the part above need not.
    let filter = |v: &Voice| v.texture.at(at[0], at[1]);
    let draws = voices.iter().map(|v| draw(&filter(v), v.texture.rate_hz(), seconds)).fold(0.0, f64::max);
    let parts = voices.iter().map(|v| part_below(&filter(v), v.texture.rate_hz(), 0.4 * v.texture.rate_hz()));
    let least = parts.fold(1.0, f64::min).max(1e-6);
    let (off, room) = (decibels(found, wanted), 1.5 + 4.3 * 4.0 * draws);
    let holds = off <= room && off >= decibels(least, 1.0) - room;
    ensure!(holds, "{here}: the level is {off:+.1} dB off");
    Ok(off.abs())
}

/// Checks that the texture dies away.
fn let_go(bench: &Bench<'_>, slot: usize, voices: &[Voice], at: &[[f64; 2]]) -> Result<(), Stop> {
    let loudest = at.iter().max_by(|a, b| closed_form(voices, **a).total_cmp(&closed_form(voices, **b)));
    let Some(&loud) = loudest else { return Ok(()) };
    // At speed 0 the nearest point of the hull counts.
    let end = |v: &Voice| {
        let rms = v.gain * square(&v.texture.at(loud[0], loud[1])).sqrt();
        silent_after(radius(v.texture.at(0.0, loud[1]).ar()), v.texture.rate_hz(), rms)
    };
    let silence = voices.iter().map(end).fold(1.0, f64::max);
    let hz = u64::from(bench.hz[0]);
    let mut heard = bench.begin(slot, move |tick| [if tick < hz { loud[0] } else { 0.0 }, loud[1]])?;
    heard.square(1.0 + silence)?;
    let rest = heard.square(0.5)?;
    ensure!(rest == 0.0, "slot {slot}: {:.1e} m/s^2 is left {silence:.1} s after it was let go", rest.sqrt());
    ensure!(heard.denormals == 0, "slot {slot}: {} samples are denormal", heard.denormals);
    Ok(())
}

/// Mean square of all textures of a slot at a speed and a force, in closed form \[(m/s^2)^2\].
fn closed_form(voices: &[Voice], at: [f64; 2]) -> f64 {
    voices.iter().map(|v| v.gain.powi(2) * square(&v.texture.at(at[0], at[1]))).sum()
}

/// Drives a slot along a way. Answers its rms and its largest sample, as multiples of the rms of the loudest
/// place.
///
/// # Errors
/// They are above `most` and `farthest`.
pub fn across(
    bench: &Bench<'_>,
    slot: usize,
    way: &Way,
    seconds: f64,
    most: f64,
    farthest: f64,
) -> Result<(f64, f64), Stop> {
    let Some(voices) = bench.slots.get(slot) else { return not_applicable("no such slot") };
    let ticks = (seconds * f64::from(bench.hz[0])) as u64;
    // The loudest of the first 3000 places has to do for an endless walk.
    let places = (0..ticks.min(3000)).map(|k| closed_form(voices, way(k)));
    let loudest = places.fold(0.0, f64::max).sqrt();
    if loudest == 0.0 {
        return Ok((0.0, 0.0));
    }
    let moved = way.clone();
    let mut heard = bench.begin(slot, move |tick| moved(tick))?;
    let rms = heard.square(seconds)?.sqrt() / loudest;
    let peak = heard.largest / loudest;
    ensure!(rms <= most, "{rms:.3e} times the root mean square of the loudest place");
    ensure!(peak <= farthest, "a sample of {peak:.3e} times the root mean square of the loudest place");
    Ok((rms, peak))
}

/// A constant speed and force.
pub fn stay(at: [f64; 2]) -> impl Fn(u64) -> [f64; 2] + Send + Sync + Clone {
    move |_| at
}

/// The kind under test.
const KIND: &str = "autoregressive";
/// The node in a bench.
const IT: &str = "it";

/// A texture of a slot.
pub struct Voice {
    /// The texture.
    pub texture: Texture,
    /// Its gain.
    pub gain: f64,
}

/// A node that renders textures, moved by speed and force alone.
pub struct Bench<'s> {
    subject: &'s Subject<'s>,
    node: NodeDecl,
    /// Ticks and samples a second.
    pub hz: [u32; 2],
    /// The textures of each slot.
    pub slots: Vec<Vec<Voice>>,
}

impl<'s> Bench<'s> {
    /// A bench of a node of the kind, with the textures that its declaration names.
    pub fn new(subject: &'s Subject<'s>, node: NodeDecl, hz: [u32; 2], slots: Vec<Vec<Voice>>) -> Self {
        Self { subject, node: NodeDecl { id: IT.to_owned(), every: 1, ..node }, hz, slots }
    }

    /// The nodes of a graph that render models.
    ///
    /// # Errors
    /// No graph; a texture that cannot be read.
    pub fn of_graph(subject: &'s Subject<'s>) -> Result<Vec<Self>, Stop> {
        let graph = subject.its_graph()?;
        let schedule = subject.compiled(graph, &[])?.schedule;
        let mut all = Vec::new();
        for node in graph.nodes.iter().filter(|n| n.kind == KIND) {
            let Some(made) = schedule.nodes.iter().find(|n| n.id == node.id) else { continue };
            let slots = made.params.slots().iter();
            let slots = slots.map(|slot| slot.iter().map(voice).collect()).collect::<Result<_, Stop>>()?;
            all.push(Self::new(subject, node.clone(), [graph.tick_hz, graph.audio_hz], slots));
        }
        Ok(all)
    }

    /// Begins a run of a slot, with speed \[mm/s\] and force \[N\] by the number of the tick.
    ///
    /// # Errors
    /// Those of the compiler.
    pub fn begin(
        &self,
        slot: usize,
        at: impl Fn(u64) -> [f64; 2] + Send + Sync + Clone + 'static,
    ) -> Result<Heard, Stop> {
        let number = slot as f64;
        let (speed, force) = (at.clone(), at);
        let mut graph = CaseGraph::new(self.hz[0], self.hz[1]);
        graph.graph.nodes.push(self.node.clone());
        for (input, unit, values) in [
            ("slot", Unit::NONE, Arc::new(move |_, to: &mut [f64]| to.fill(number)) as Values),
            ("speed", Unit::MILLIMETRE_PER_SECOND, Arc::new(move |tick, to| to.fill(speed(tick)[0]))),
            ("force", Unit::NEWTON, Arc::new(move |tick, to| to.fill(force(tick)[1]))),
        ] {
            let kind = Played::control(&format!("a {input}"), 1, unit, values);
            graph = graph.plays(input, kind)?.wire(input, &format!("{IT}.{input}"));
        }
        let rig = graph.node("end", "probe", &[])?.wire(IT, "end").rig(self.subject)?;
        Ok(Heard { rig, largest: 0.0, denormals: 0 })
    }
}

/// A texture of a slot.
fn voice(settings: &Settings) -> Result<Voice, Stop> {
    Ok(Voice { texture: Texture::read(settings.file("model"))?, gain: settings.number("gain") })
}

/// A bench that runs.
pub struct Heard {
    rig: Rig,
    /// Largest sample so far \[m/s^2\].
    pub largest: f64,
    /// Number of denormal samples.
    pub denormals: u64,
}

impl Heard {
    /// Runs for some seconds. Answers the mean square of the output \[(m/s^2)^2\].
    ///
    /// # Errors
    /// A sample that is not finite, a node that fails.
    pub fn square(&mut self, seconds: f64) -> Result<f64, Stop> {
        let heard = self.rig.heard(self.rig.ticks(seconds), IT)?;
        let largest = heard.iter().fold(0.0, |most: f32, x| most.max(x.abs()));
        self.largest = self.largest.max(f64::from(largest));
        self.denormals += heard.iter().filter(|x| x.is_subnormal()).count() as u64;
        let square = heard.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / heard.len().max(1) as f64;
        ensure!(square.is_finite(), "the output is not finite");
        Ok(square)
    }
}

/// The variance of a filter's signal in closed form \[(m/s^2)^2\].
pub fn square(filter: &Filter) -> f64 {
    let mut square = [0.0];
    filter.autocovariance(&mut square);
    square[0]
}

/// Standard deviation of the mean square over some seconds, as a part of it. For a normal signal the
/// variance of that mean over N samples is `2 sum_m r(m)^2 / N` (Isserlis 1918).
pub fn draw(filter: &Filter, rate_hz: f64, seconds: f64) -> f64 {
    let mut r = vec![0.0; (2.0 * rate_hz) as usize];
    filter.autocovariance(&mut r);
    let first = r.first().copied().unwrap_or(0.0);
    let sum: f64 = first * first + 2.0 * r.iter().skip(1).map(|r| r * r).sum::<f64>();
    (2.0 * sum / (seconds * rate_hz)).sqrt() / first.max(f64::MIN_POSITIVE)
}

/// The part of a filter's power below `hz`, by a sum over 4096 frequencies.
fn part_below(filter: &Filter, rate_hz: f64, hz: f64) -> f64 {
    let n = 4096;
    let power = |i: i32| filter.power(std::f64::consts::PI * (f64::from(i) + 0.5) / f64::from(n));
    let whole: f64 = (0..n).map(power).sum();
    let below = (f64::from(n) * 2.0 * hz / rate_hz) as i32;
    (0..below.min(n)).map(power).sum::<f64>() / whole
}

/// Largest radius of a pole: all roots of `A` lie within `r` where those of `A(z r)` lie within 1.
pub fn radius(ar: &[f64]) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..50 {
        let middle: f64 = 0.5 * (low + high);
        let scaled: Vec<f64> = ar.iter().zip(1..).map(|(a, i)| a / middle.powi(i)).collect();
        *if asperity_autoregressive::is_stable(&scaled) { &mut high } else { &mut low } = middle;
    }
    high
}

/// Time after which nothing is left of a signal \[s\]: `r^n` of ten times its level is below 1e-30, and the
/// resampler is empty within another second.
pub fn silent_after(radius: f64, rate_hz: f64, rms: f64) -> f64 {
    1.0 + (10.0 * rms.max(1e-20) / 1e-30).ln() / -radius.max(1e-3).ln() / rate_hz
}

/// Speed \[mm/s\] and force \[N\] by the number of the tick.
pub type Way = Arc<dyn Fn(u64) -> [f64; 2] + Send + Sync>;
