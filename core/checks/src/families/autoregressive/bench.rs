//! Textures of models, and the node that renders them, moved by speed and force alone.

use std::f64::consts::TAU;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use asperity_autoregressive::{Filter, Model, Texture, TextureFile};
use asperity_diagnostics::ron;
use asperity_graph::{GraphFile, NodeDecl};
use asperity_node::{Source, Unit};

use crate::case::{Not, holds};
use crate::played::Played;
use crate::rig::Rig;
use crate::subject::Subject;

/// The kind that all of this is about.
const KIND: &str = "autoregressive";
/// The node in a bench.
const IT: &str = "it";
/// Samples of models a second.
pub(super) const RATE_HZ: f64 = 1000.0;
/// Audio rate of a bench with made models: low, so that hours take seconds.
const AUDIO_HZ: u32 = 8000;

/// A texture with a gain, as one of a slot.
pub(super) struct Voice {
    pub(super) texture: Texture,
    pub(super) gain: f64,
}

/// What a node renders: a declaration, and what stands in it, slot by slot.
pub(super) struct Bench<'s> {
    subject: &'s Subject<'s>,
    node: NodeDecl,
    hz: [u32; 2],
    pub(super) slots: Vec<Vec<Voice>>,
    /// A file of made models, for as long as anything is made of it.
    _file: Option<Made>,
}

/// A file that is gone when this is.
struct Made(PathBuf);

impl Drop for Made {
    fn drop(&mut self) {
        // What cannot be removed is left to the system.
        let _ = std::fs::remove_file(&self.0);
    }
}

/// Writes models to a file that nothing else has.
fn written(texture: &Texture) -> Result<Made, Not> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let file = TextureFile {
        description: "Made for a hard case.".to_owned(),
        origin: "Made from poles.".to_owned(),
        texture: texture.clone(),
    };
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    let name = format!("asperity-checks-{}-{number}.ron", std::process::id());
    let path = std::env::temp_dir().join(name);
    std::fs::write(&path, file.to_ron()?).map_err(|e| format!("cannot write {}: {e}", path.display()))?;
    Ok(Made(path))
}

impl<'s> Bench<'s> {
    /// The built-in kind with made models.
    ///
    /// # Errors
    /// There is no such kind; models that cannot be; a folder for temporary files that cannot be written.
    pub(super) fn made(subject: &'s Subject<'s>, models: Vec<Model>) -> Result<Self, Not> {
        subject.kind(KIND)?;
        let texture = Texture::new(RATE_HZ, models, None)?;
        let file = written(&texture)?;
        let mut graph = GraphFile::empty("the case");
        let text = format!("{KIND}(model: {:?}, gain: 1)", file.0.display().to_string());
        graph.add_node(IT, KIND, &[("models", &format!("{:?}", [text]))], "the case")?;
        let node = graph.nodes.pop().ok_or_else(|| Not::Held("no node was made".to_owned()))?;
        let slots = vec![vec![Voice { texture, gain: 1.0 }]];
        Ok(Self { subject, node, hz: [500, AUDIO_HZ], slots, _file: Some(file) })
    }

    /// The nodes of a graph that render models, as they stand there.
    ///
    /// # Errors
    /// No graph; what cannot be read.
    pub(super) fn of_graph(subject: &'s Subject<'s>) -> Result<Vec<Self>, Not> {
        let graph = subject.its_graph()?;
        let schedule = subject.compiled(graph, &[])?.schedule;
        let mut all = Vec::new();
        for node in graph.nodes.iter().filter(|n| n.kind == KIND) {
            let Some(made) = schedule.nodes.iter().find(|n| n.id == node.id) else { continue };
            let place = made.params.place("models").or(made.params.node_place());
            let path = place.map(|p| p.source.path().to_owned()).unwrap_or_default();
            let slot = |text: &String| {
                let value = ron::parse(&Source::new(path.clone(), text.as_str()))?;
                match value.kind() {
                    ron::Kind::List(all) => all.iter().map(voice).collect::<Result<_, Not>>(),
                    _ => voice(&value).map(|one| vec![one]),
                }
            };
            let slots = made.params.texts("models").iter().map(slot).collect::<Result<_, Not>>()?;
            let node = NodeDecl { id: IT.to_owned(), every: 1, ..node.clone() };
            all.push(Self { subject, node, hz: [graph.tick_hz, graph.audio_hz], slots, _file: None });
        }
        Ok(all)
    }

    /// The same at another tick rate.
    pub(super) fn at_ticks(mut self, tick_hz: u32) -> Self {
        self.hz[0] = tick_hz;
        self
    }

    /// Ticks a second.
    pub(super) fn tick_hz(&self) -> u32 {
        self.hz[0]
    }

    /// Begins with speed \[mm/s\] and force \[N\] by the number of the tick.
    ///
    /// # Errors
    /// What the compiler says.
    pub(super) fn begin(
        &self,
        slot: usize,
        at: impl Fn(u64) -> [f64; 2] + Send + Sync + Clone + 'static,
    ) -> Result<Heard, Not> {
        let mut graph = GraphFile::empty("the case");
        [graph.tick_hz, graph.audio_hz] = self.hz;
        graph.nodes.push(self.node.clone());
        let slot = slot as f64;
        let (speed, force) = (at.clone(), at);
        let kinds = [
            Played::control("a slot", 1, Unit::NONE, std::sync::Arc::new(move |_, to| to.fill(slot))),
            Played::control(
                "a speed",
                1,
                Unit::MILLIMETRE_PER_SECOND,
                std::sync::Arc::new(move |tick, to| to.fill(speed(tick)[0])),
            ),
            Played::control(
                "a force",
                1,
                Unit::NEWTON,
                std::sync::Arc::new(move |tick, to| to.fill(force(tick)[1])),
            ),
        ];
        for (kind, input) in [("a slot", "slot"), ("a speed", "speed"), ("a force", "force")] {
            graph.add_node(kind, kind, &[], "the case")?;
            graph.add_wire(kind, &format!("{IT}.{input}"), "the case");
        }
        graph.add_node("end", "probe", &[], "the case")?;
        graph.add_wire(IT, "end", "the case");
        Ok(Heard { rig: Rig::of(self.subject, &graph, &kinds)?, largest: 0.0, denormals: 0 })
    }
}

/// A texture of a slot, from its text.
fn voice(value: &ron::Value) -> Result<Voice, Not> {
    match asperity_scene::Texture::parse(value)? {
        asperity_scene::Texture::Autoregressive { model, gain } => {
            Ok(Voice { texture: Texture::read(model)?, gain })
        }
        _ => Err(value.error("a texture of another kind").into()),
    }
}

/// A bench that runs.
pub(super) struct Heard {
    rig: Rig,
    /// Largest sample so far \[m/s^2\].
    pub(super) largest: f64,
    /// Samples that are denormal numbers.
    pub(super) denormals: u64,
}

impl Heard {
    /// The number of the next tick.
    pub(super) fn next_tick(&self) -> u64 {
        self.rig.engine.next_tick()
    }

    /// Runs for some seconds: the mean square of what is heard \[(m/s^2)^2\].
    ///
    /// # Errors
    /// A sample that is not finite, a node that fails.
    pub(super) fn square(&mut self, seconds: f64) -> Result<f64, Not> {
        let (mut sum, mut count) = (0.0, 0_u64);
        let ticks = self.rig.ticks(seconds);
        for _ in 0..ticks {
            let tick = self.next_tick();
            self.rig.engine.tick();
            for &x in self.rig.audio(IT, 0) {
                let value = f64::from(x);
                sum += value * value;
                self.largest = self.largest.max(value.abs());
                self.denormals += u64::from(x.is_subnormal());
                count += 1;
            }
            holds(self.rig.engine.faults() == 0 && sum.is_finite(), || {
                format!("tick {tick}: what is heard is not finite")
            })?;
        }
        Ok(sum / count.max(1) as f64)
    }
}

/// Coefficients of poles `radius e^+-i angle`, by radius and frequency \[Hz\].
pub(super) fn poles(all: &[(f64, f64)]) -> Vec<f64> {
    let mut a = vec![1.0];
    for &(radius, hz) in all {
        let pair = [1.0, -2.0 * radius * (TAU * hz / RATE_HZ).cos(), radius * radius];
        let mut product = vec![0.0; a.len() + 2];
        for (i, x) in a.iter().enumerate() {
            for (j, y) in pair.iter().enumerate() {
                product[i + j] += x * y;
            }
        }
        a = product;
    }
    a.split_off(1)
}

/// A model of these coefficients whose signal has a root mean square of `rms` m/s^2.
pub(super) fn model(ar: Vec<f64>, rms: f64, [speed_mm_s, force_n]: [f64; 2]) -> Model {
    let unit = square(&Filter::new(&ar, &[], 1.0));
    Model { ar, ma: Vec::new(), variance: rms * rms / unit, gain: 1.0, speed_mm_s, force_n }
}

/// The variance of a filter's signal in closed form \[(m/s^2)^2\].
pub(super) fn square(filter: &Filter) -> f64 {
    let mut square = [0.0];
    filter.autocovariance(&mut square);
    square[0]
}

/// The standard deviation of the mean square over some seconds, in parts of it: of a normal signal the variance of that mean over N samples is
/// `2 sum_m r(m)^2 / N` (Isserlis 1918).
pub(super) fn draw(filter: &Filter, rate_hz: f64, seconds: f64) -> f64 {
    let mut r = vec![0.0; (2.0 * rate_hz) as usize];
    filter.autocovariance(&mut r);
    let first = r.first().copied().unwrap_or(0.0);
    let sum: f64 = first * first + 2.0 * r.iter().skip(1).map(|r| r * r).sum::<f64>();
    (2.0 * sum / (seconds * rate_hz)).sqrt() / first.max(f64::MIN_POSITIVE)
}

/// The part of a filter's power that lies below `hz`, by a sum over 4096 frequencies.
pub(super) fn part_below(filter: &Filter, rate_hz: f64, hz: f64) -> f64 {
    let n = 4096;
    let power = |i: i32| filter.power(std::f64::consts::PI * (f64::from(i) + 0.5) / f64::from(n));
    let whole: f64 = (0..n).map(power).sum();
    let below = (f64::from(n) * 2.0 * hz / rate_hz) as i32;
    (0..below.min(n)).map(power).sum::<f64>() / whole
}

/// The largest radius of a pole: all roots of `A` lie within `r` where those of `A(z r)` lie within 1.
pub(super) fn radius(ar: &[f64]) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..50 {
        let middle: f64 = 0.5 * (low + high);
        let scaled: Vec<f64> = ar.iter().zip(1..).map(|(a, i)| a / middle.powi(i)).collect();
        if asperity_autoregressive::is_stable(&scaled) {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// After how long nothing is left of a signal of this size \[s\]: `r^n` of ten times as much is below 1e-30, and what brings it to the audio rate is empty
/// within another second.
pub(super) fn silent_after(radius: f64, rate_hz: f64, rms: f64) -> f64 {
    1.0 + (10.0 * rms.max(1e-20) / 1e-30).ln() / -radius.max(1e-3).ln() / rate_hz
}

/// Decibels between two mean squares.
pub(super) fn decibels(found: f64, wanted: f64) -> f64 {
    10.0 * (found / wanted).log10()
}

/// What stands for a shared function of the tick.
pub(super) type Way = Arc<dyn Fn(u64) -> [f64; 2] + Send + Sync>;
