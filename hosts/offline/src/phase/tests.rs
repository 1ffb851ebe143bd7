//! Chains of nodes with known output, and these nodes.

use asperity_node::{
    Input, LayoutSpec, Node, Output, Param, Prepared, Processor, RateSpec, Setup, ShapeSpec, Status, Tick,
    Unit,
};

use super::*;

/// A kind with magnitudes in, and samples at the frames' rate out.
pub fn audio_kind(kind: &'static str) -> Descriptor {
    Descriptor::new(kind, "Answers as a test wants.")
        .input(
            Input::new("magnitude", ShapeSpec::Magnitude(LayoutSpec::Of('l')), Unit::NONE)
                .unit_of('u')
                .doc("frames"),
        )
        .output(
            Output::new("signal", ShapeSpec::Audio(RateSpec::Of('l')), Unit::NONE)
                .unit_of('u')
                .doc("samples"),
        )
}

/// Puts out the number of each sample, `late` samples later, which it declares as latency.
pub struct Counter {
    late: i64,
    rate_hz: u32,
}

impl Node for Counter {
    fn descriptor() -> Descriptor {
        audio_kind("counter").param(Param::integer("late", 0, -1_000_000..=1_000_000, "Latency in samples."))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let (late, rate_hz) = (setup.params.integer("late"), setup.input_rate(0));
        Ok(Prepared::new(Self { late, rate_hz }).latency(Latency::samples(late, rate_hz)))
    }
}

impl Processor for Counter {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let span = tick.samples(self.rate_hz);
        for (y, n) in tick.outputs.audio(0).iter_mut().zip(span) {
            *y = (n as i64 - self.late) as f32;
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}

/// A sine of 250 Hz with the largest amplitude of the frame `delay` ticks ago. `how` chooses a failure.
pub struct Tone {
    levels: Vec<f32>,
    rate_hz: u32,
    how: String,
    calls: u64,
}

impl Node for Tone {
    fn descriptor() -> Descriptor {
        audio_kind("tone").param(Param::integer("delay", 0, 0..=100, "Delay in ticks.")).param(Param::choice(
            "how",
            &["well", "nan", "error", "panic", "prepare", "clock"],
            "What goes wrong.",
        ))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let how = setup.params.text("how").to_owned();
        assert!(how != "prepare", "as told");
        let levels = vec![0.0; setup.params.integer("delay") as usize + 1];
        Ok(Prepared::new(Self { levels, rate_hz: setup.input_rate(0), how, calls: 0 }))
    }
}

impl Processor for Tone {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        self.levels.rotate_right(1);
        self.levels[0] = tick.inputs.magnitude(0).map_or(0.0, |f| f.bins.iter().copied().fold(0.0, f32::max));
        let level = self.levels[self.levels.len() - 1];
        let (span, rate) = (tick.samples(self.rate_hz), f64::from(self.rate_hz));
        let out = tick.outputs.audio(0);
        for (y, n) in out.iter_mut().zip(span) {
            *y = level * (std::f64::consts::TAU * 250.0 * n as f64 / rate).sin() as f32;
        }
        self.calls += 1;
        match self.how.as_str() {
            "nan" if self.calls == 7 => out[0] = f32::NAN,
            "error" => return Status::Error(42),
            "panic" if self.calls == 7 => panic!("as told"),
            "clock" => {
                static ALL: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
                out[0] += ALL.fetch_add(1, std::sync::atomic::Ordering::Relaxed) as f32 * 1e-6;
            }
            _ => {}
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}

fn registry() -> Registry {
    asperity_nodes::registry().with::<Counter>().with::<Tone>()
}

fn frames(count: usize, rate_hz: u32) -> Arc<Frames> {
    Arc::new(Frames::from_amplitudes(vec![1.0; count * 51], 51, rate_hz).unwrap())
}

fn chain(text: &str, frames: &Arc<Frames>) -> Result<Chain, String> {
    let registry = registry();
    let method = Method::parse(text, &registry).unwrap_or_else(|e| panic!("{}", e.reason()));
    Chain::new(&registry, &method, frames, 1).map_err(|e| e.reason())
}

/// Also for early samples, as from a node that emits the middle of its windows.
#[test]
fn declared_latency_is_taken_out_whatever_its_sign() {
    for rate_hz in [2500, 44_100] {
        let frames = frames(40, rate_hz);
        for late in [0, 7, -7, i64::from(rate_hz) / 10, -i64::from(rate_hz) / 20] {
            let mut chain = chain(&format!("counter:late={late}"), &frames).unwrap();
            assert!((chain.latency.ms() - late as f64 * 1e3 / f64::from(rate_hz)).abs() < 1e-9);
            let signal = chain.signal(&NoClock, |_| {});
            assert_eq!(signal.len() as u64, frames.samples(), "{rate_hz} Hz, {late}");
            let missing = late.min(0).unsigned_abs() as usize;
            for (i, &y) in signal.iter().enumerate() {
                let want = if i < missing { 0.0 } else { i as f32 };
                assert_eq!(y, want, "{rate_hz} Hz, {late}, sample {i}");
            }
        }
    }
}

#[test]
fn live_output_keeps_its_latency() {
    let heard = chain("counter:late=30", &frames(40, 2500)).unwrap().live();
    assert_eq!((heard.len(), heard[0], heard[199]), (200, -30.0, 169.0));
}

#[test]
fn long_latency_and_unknown_parameter_are_refused() {
    for (text, says) in [
        ("counter:late=1000000", "declares a latency of 400000 ms"),
        ("counter:late=-1000000", "declares a latency of -400000 ms"),
        ("counter:lat=1", "no parameter `lat`"),
    ] {
        let why = chain(text, &frames(40, 2500)).err().unwrap();
        assert!(why.contains(says), "{why}");
    }
}

#[test]
fn retrieval_needs_one_magnitude_input_and_one_output() {
    let kind = audio_kind("a");
    let found = kind.retrieval().map(|r| (r.input, r.output, r.spectrum));
    assert_eq!(found, Some(("magnitude", "signal", false)));
    let control = || Input::new("more", ShapeSpec::Control(1), Unit::NONE);
    let (mut two_outputs, mut of_audio) = (audio_kind("a"), audio_kind("a"));
    two_outputs.outputs.push(two_outputs.outputs[0].clone());
    of_audio.inputs[0].shape = ShapeSpec::Audio(RateSpec::Graph);
    let another_input = audio_kind("a").input(control());
    assert!(audio_kind("a").input(control().or(1.0)).retrieval().is_some());
    assert!([two_outputs, of_audio, another_input].iter().all(|d| d.retrieval().is_none()));
    let registry = registry();
    let has = |kind: &str| retrievers(&registry).iter().any(|d| d.kind == kind);
    assert!(has("spsi") && has("tone") && !has("overlap_add"));
}

#[test]
fn default_is_the_node_of_the_shipped_graph() {
    let method = Method::parse("default:seed=3", &registry()).unwrap();
    assert_eq!((method.kind.as_str(), method.label.as_str()), ("shaped_noise", "default:seed=3"));
}

#[test]
fn offline_settings_are_parsed_and_wrong_ones_refused() {
    let parse = |text: &str| Method::parse(text, &registry()).map(|m| m.how).map_err(|e| e.reason());
    assert!(matches!(parse("griffin_lim"), Ok(How::Offline(options, None)) if options.alpha == 0.0));
    let set = parse("fast_griffin_lim:iterations=7, alpha=0.5,seed=3");
    let Ok(How::Offline(options, Some(3))) = set else { panic!("{set:?}") };
    assert_eq!((options.iterations, options.alpha), (7, 0.5));
    for wrong in ["alpha=NaN", "alpha=2", "iterations=0", "iterations", "iteration=5"] {
        assert!(parse(&format!("fast_griffin_lim:{wrong}")).is_err(), "{wrong}");
    }
    assert!(parse("griffin_lim:alpha=0.5").is_err());
}
