//! Nodes to hear a swap by: a tone, a filter with a memory, a live gain; and one that counts how many of it
//! live.

use std::cell::Cell;
use std::f64::consts::TAU;

use asperity_checks::wrap::stateless;
use asperity_node::{
    Descriptor, Diagnostic, Input, Latency, Node, Output, Param, Prepared, Processor, RateSpec, Registry,
    Resume, Setup, ShapeSpec, State, Status, Tick, Unit,
};

const AUDIO: ShapeSpec = ShapeSpec::Audio(RateSpec::Graph);

/// A node that passes audio on.
fn passes(kind: &'static str, docs: &'static str) -> Descriptor {
    Descriptor::new(kind, docs).input(Input::new("in", AUDIO, Unit::NONE)).output(Output::new(
        "out",
        AUDIO,
        Unit::NONE,
    ))
}

/// A parameter that changes nothing.
fn version(name: &'static str, most: i64) -> Param {
    Param::integer(name, 0, 0..=most, "Changes nothing.")
}

/// Multiplies this tick's audio.
fn scaled(tick: &mut Tick<'_>, by: f32) -> Status {
    let pairs = tick.outputs.audio(0).iter_mut().zip(tick.inputs.audio(0));
    pairs.for_each(|(y, x)| *y = by * x);
    Status::Continue
}

/// A one-pole low-pass that hands its memory on; `KEEPS` false forgets to.
struct OnePole<const KEEPS: bool> {
    part: f32,
    memory: f32,
}

impl<const KEEPS: bool> Node for OnePole<KEEPS> {
    fn descriptor() -> Descriptor {
        passes(if KEEPS { "one_pole" } else { "forgetful" }, "A low-pass.")
            .param(Param::number("part", 0.001, 0.0..=1.0, "Part of a new sample."))
            .param(Param::integer("taps", 1, 1..=9, "Only makes the state longer."))
            .resumes(Resume::Never)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self { part: setup.params.number("part") as f32, memory: 0.0 }))
    }
}

impl<const KEEPS: bool> Processor for OnePole<KEEPS> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        for (y, x) in tick.outputs.audio(0).iter_mut().zip(tick.inputs.audio(0)) {
            self.memory += self.part * (x - self.memory);
            *y = self.memory;
        }
        Status::Continue
    }

    fn reset(&mut self) {
        self.memory = 0.0;
    }

    fn state(&mut self, state: &mut State<'_>) {
        if KEEPS {
            state.keep(&mut self.memory);
        }
    }
}

/// Counts its calls, and fails from a tick on; it has a list besides, of a length that may not fit another's.
struct Taps {
    calls: f64,
    taps: Vec<f64>,
    fails_from: u64,
}

impl Node for Taps {
    fn descriptor() -> Descriptor {
        Descriptor::new("taps", "Counts its calls.")
            .output(Output::new("out", ShapeSpec::Control(1), Unit::NEWTON))
            .param(Param::integer("taps", 1, 1..=9, "How many."))
            .param(Param::integer("fails_from", 1_000_000, 0..=1_000_000, "Its first bad tick."))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let taps = vec![0.0; p.integer("taps") as usize];
        Ok(Prepared::new(Self { calls: 0.0, taps, fails_from: p.integer("fails_from") as u64 }))
    }
}

impl Processor for Taps {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        self.calls += 1.0;
        tick.outputs.set(0, self.calls);
        if tick.index >= self.fails_from { Status::Error(1) } else { Status::Continue }
    }

    fn reset(&mut self) {
        self.calls = 0.0;
        self.taps.fill(0.0);
    }

    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.calls).keep(&mut self.taps);
    }
}

/// Puts out 15 ms later what comes in, and hands nothing on.
struct Late(Vec<f32>);

impl Node for Late {
    fn descriptor() -> Descriptor {
        passes("late", "A delay that forgets.").param(version("version", 9))
    }

    fn prepare(_: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self(vec![0.0; 720])).latency(Latency::ratio(15, 1000)))
    }
}

impl Processor for Late {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let input = tick.inputs.audio(0);
        tick.outputs.audio(0).copy_from_slice(&self.0[..input.len()]);
        self.0.rotate_left(input.len());
        let end = self.0.len() - input.len();
        self.0[end..].copy_from_slice(input);
        Status::Continue
    }

    fn reset(&mut self) {
        self.0.fill(0.0);
    }
}

/// Lets its upstream sleep for good, asked every third tick.
struct Shut;

impl Node for Shut {
    fn descriptor() -> Descriptor {
        Descriptor::new("shut", "A gate that stays closed.")
            .input(Input::new("in", ShapeSpec::Control(1), Unit::NEWTON))
            .output(Output::new("out", ShapeSpec::Control(1), Unit::NEWTON))
            .gates("in")
    }

    fn prepare(_: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self))
    }
}

impl Processor for Shut {
    fn wants(&mut self, _: &mut Tick<'_>) -> bool {
        false
    }

    fn process(&mut self, _: &mut Tick<'_>) -> Status {
        Status::Continue
    }

    fn reset(&mut self) {}
}

/// A gain that may change while it runs.
struct LiveGain(f32);

impl Node for LiveGain {
    fn descriptor() -> Descriptor {
        passes("live_gain", "A gain.")
            .param(version("fixed", 9))
            .param(Param::number("gain", 1.0, 0.0..=2.0, "The factor.").live())
            .param(Param::choice("sign", &["plus", "minus"], "Its sign.").live())
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let sign = if setup.params.text("sign") == "minus" { -1.0 } else { 1.0 };
        Ok(Prepared::new(Self(sign * setup.params.number("gain") as f32)))
    }
}

impl Processor for LiveGain {
    fn set_parameter(&mut self, index: usize, value: f64) {
        match index {
            1 => self.0 = self.0.signum() * value as f32,
            2 => self.0 = self.0.abs() * if value == 1.0 { -1.0 } else { 1.0 },
            _ => {}
        }
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        scaled(tick, self.0)
    }

    fn reset(&mut self) {}
}

/// A value that stands in the graph; `LIVE` or not.
struct Level<const LIVE: bool>(f64);

impl<const LIVE: bool> Node for Level<LIVE> {
    fn descriptor() -> Descriptor {
        let value = Param::number("value", 0.0, -100.0..=100.0, "The value.");
        Descriptor::new(if LIVE { "live_level" } else { "level" }, "A control that stays.")
            .output(Output::new("out", ShapeSpec::Control(1), Unit::NEWTON))
            .param(if LIVE { value.live() } else { value })
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self(setup.params.number("value"))))
    }
}

impl<const LIVE: bool> Processor for Level<LIVE> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        tick.outputs.set(0, self.0);
        Status::Asleep
    }

    fn set_parameter(&mut self, _: usize, value: f64) {
        self.0 = value;
    }

    fn reset(&mut self) {}
}

thread_local! {
    static TRACKED: Cell<i64> = const { Cell::new(0) };
    static TRACKED_CALLS: Cell<u64> = const { Cell::new(0) };
}

/// Calls of all of them.
pub fn tracked_calls() -> u64 {
    TRACKED_CALLS.get()
}

/// Number of `tracked` nodes that this thread made and that live.
pub fn tracked() -> i64 {
    TRACKED.get()
}

/// The memory of a node that is counted for as long as it lives.
struct Tracked(Vec<f32>);

impl Tracked {
    fn new() -> Self {
        TRACKED.set(TRACKED.get() + 1);
        Self(vec![0.0; 1000])
    }
}

impl Drop for Tracked {
    fn drop(&mut self) {
        TRACKED.set(TRACKED.get() - 1);
    }
}

/// Adds these kinds.
pub fn with_tones(registry: Registry) -> Registry {
    // A sine by the sample's number, so that it is the same whenever it began.
    let hz = Param::number("hz", 100.0, 0.0..=20_000.0, "Its frequency; a quarter of a turn ahead at 0.");
    let tone = Descriptor::new("tone", "A sine.")
        .output(Output::new("out", AUDIO, Unit::NONE))
        .param(hz)
        .param(Param::number("level", 1.0, -10.0..=10.0, "Its amplitude."))
        .resumes(Resume::Continue);
    let tone = stateless(tone, |setup| {
        let (hz, level) = (setup.params.number("hz"), setup.params.number("level"));
        let rate_hz = setup.output_rate(0);
        move |tick| {
            let span = tick.samples(rate_hz);
            for (y, n) in tick.outputs.audio(0).iter_mut().zip(span) {
                *y = (level * (TAU * hz * n as f64 / f64::from(rate_hz)).cos()) as f32;
            }
            Status::Continue
        }
    });
    // A gain that may not change while it runs.
    let scale = passes("scale", "A gain.").param(Param::number("by", 1.0, -1e6..=1e6, "The factor."));
    let scale = stateless(scale, |setup| {
        let by = setup.params.number("by") as f32;
        move |tick| scaled(tick, by)
    });
    // Makes an ampere of a number, as if a limiter stood behind it.
    let amps = Descriptor::new("amps", "A limited current.")
        .input(Input::new("in", AUDIO, Unit::NONE))
        .output(Output::new("out", AUDIO, Unit::AMPERE).limited());
    let amps = stateless(amps, |_| |tick| scaled(tick, 1.0));
    // Passes audio on, and is counted for as long as it lives.
    let counted = passes("tracked", "Passes on.").param(version("version", 1_000_000));
    let counted = stateless(counted, |_| {
        let mut memory = Tracked::new();
        move |tick| {
            TRACKED_CALLS.set(TRACKED_CALLS.get() + 1);
            let input = tick.inputs.audio(0);
            memory.0[..input.len()].copy_from_slice(input);
            scaled(tick, 1.0)
        }
    });
    let mut registry = registry
        .with::<OnePole<true>>()
        .with::<OnePole<false>>()
        .with::<Taps>()
        .with::<LiveGain>()
        .with::<Late>()
        .with::<Shut>()
        .with::<Level<false>>()
        .with::<Level<true>>();
    for kind in [tone, scale, amps, counted] {
        registry.add(kind);
    }
    registry
}
