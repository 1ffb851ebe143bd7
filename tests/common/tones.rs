//! Nodes to hear a swap by: a tone, a filter with a memory, a live gain; and one that counts how many of it live.
#![allow(unreachable_pub)] // for the test that includes it

use std::cell::Cell;
use std::f64::consts::TAU;

use asperity_node::{
    Descriptor, Diagnostic, Input, Node, Output, Param, RateSpec, Registry, Resume, Setup, ShapeSpec, State,
    Status, Tick, Unit,
};

const AUDIO: ShapeSpec = ShapeSpec::Audio(RateSpec::Graph);

/// A sine by the sample's number, so that it is the same whenever it began.
struct Tone {
    hz: f64,
    level: f64,
    rate_hz: u32,
}

impl Node for Tone {
    fn descriptor() -> Descriptor {
        Descriptor::new("tone", "A sine.")
            .output(Output::new("out", AUDIO, Unit::NONE))
            .param(Param::number(
                "hz",
                100.0,
                0.0..=20_000.0,
                "Its frequency; a quarter of a turn ahead at 0.",
            ))
            .param(Param::number("level", 1.0, -10.0..=10.0, "Its amplitude."))
            .resumes(Resume::Resume)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        let p = setup.params;
        Ok(Self { hz: p.number("hz"), level: p.number("level"), rate_hz: setup.output_rate(0) })
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let span = tick.samples(self.rate_hz);
        for (y, n) in tick.outputs.audio(0).iter_mut().zip(span) {
            *y = (self.level * (TAU * self.hz * n as f64 / f64::from(self.rate_hz)).cos()) as f32;
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}

/// A one-pole low-pass that hands its memory on; `KEEPS` false forgets to.
struct OnePole<const KEEPS: bool> {
    part: f32,
    memory: f32,
}

impl<const KEEPS: bool> Node for OnePole<KEEPS> {
    fn descriptor() -> Descriptor {
        Descriptor::new(if KEEPS { "one_pole" } else { "forgetful" }, "A low-pass.")
            .input(Input::new("in", AUDIO, Unit::NONE))
            .output(Output::new("out", AUDIO, Unit::NONE))
            .param(Param::number("part", 0.001, 0.0..=1.0, "Part of a new sample."))
            .param(Param::integer("taps", 1, 1..=9, "Only makes the state longer."))
            .resumes(Resume::Never)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        Ok(Self { part: setup.params.number("part") as f32, memory: 0.0 })
    }

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

/// A list of as many numbers as its parameter says: a state that does not fit another's.
struct Taps(Vec<f64>);

impl Node for Taps {
    fn descriptor() -> Descriptor {
        Descriptor::new("taps", "Counts its calls in every tap.")
            .output(Output::new("out", ShapeSpec::Control(1), Unit::NEWTON))
            .param(Param::integer("taps", 1, 1..=9, "How many."))
            .param(Param::integer("other", 1, 1..=9, "Changes nothing."))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        Ok(Self(vec![0.0; setup.params.integer("taps") as usize]))
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        self.0.iter_mut().for_each(|x| *x += 1.0);
        tick.outputs.set(0, self.0[0]);
        Status::Continue
    }

    fn reset(&mut self) {
        self.0.fill(0.0);
    }

    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.0);
    }
}

/// A gain that may not change while it runs.
struct Scale(f32);

impl Node for Scale {
    fn descriptor() -> Descriptor {
        Descriptor::new("scale", "A gain.")
            .input(Input::new("in", AUDIO, Unit::NONE))
            .output(Output::new("out", AUDIO, Unit::NONE))
            .param(Param::number("by", 1.0, -1e6..=1e6, "The factor."))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        Ok(Self(setup.params.number("by") as f32))
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        for (y, x) in tick.outputs.audio(0).iter_mut().zip(tick.inputs.audio(0)) {
            *y = self.0 * x;
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}

/// A gain that may change while it runs.
struct LiveGain(f32);

impl Node for LiveGain {
    fn descriptor() -> Descriptor {
        Descriptor::new("live_gain", "A gain.")
            .input(Input::new("in", AUDIO, Unit::NONE))
            .output(Output::new("out", AUDIO, Unit::NONE))
            .param(Param::integer("fixed", 0, 0..=9, "Changes nothing."))
            .param(Param::number("gain", 1.0, 0.0..=2.0, "The factor.").live())
            .param(Param::choice("sign", &["plus", "minus"], "Its sign.").live())
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        let sign = if setup.params.text("sign") == "minus" { -1.0 } else { 1.0 };
        Ok(Self(sign * setup.params.number("gain") as f32))
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        match index {
            1 => self.0 = self.0.signum() * value as f32,
            2 => self.0 = self.0.abs() * if value == 1.0 { -1.0 } else { 1.0 },
            _ => {}
        }
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        for (y, x) in tick.outputs.audio(0).iter_mut().zip(tick.inputs.audio(0)) {
            *y = self.0 * x;
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}

/// A value that stands in the graph.
struct Level(f64);

impl Node for Level {
    fn descriptor() -> Descriptor {
        Descriptor::new("level", "A control that stays.")
            .output(Output::new("out", ShapeSpec::Control(1), Unit::NEWTON))
            .param(Param::number("value", 0.0, -100.0..=100.0, "The value."))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        Ok(Self(setup.params.number("value")))
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        tick.outputs.set(0, self.0);
        Status::Asleep
    }

    fn reset(&mut self) {}
}

/// Makes an ampere of a number, as if a limiter stood behind it.
struct Amps;

impl Node for Amps {
    fn descriptor() -> Descriptor {
        Descriptor::new("amps", "A limited current.")
            .input(Input::new("in", AUDIO, Unit::NONE))
            .output(Output::new("out", AUDIO, Unit::AMPERE).limited())
    }

    fn prepare(_: &Setup<'_>) -> Result<Self, Diagnostic> {
        Ok(Self)
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        tick.outputs.audio(0).copy_from_slice(tick.inputs.audio(0));
        Status::Continue
    }

    fn reset(&mut self) {}
}

thread_local! {
    static TRACKED: Cell<i64> = const { Cell::new(0) };
}

/// How many `tracked` nodes there are, of this thread's making.
pub fn tracked() -> i64 {
    TRACKED.get()
}

/// Passes audio on, and is counted for as long as it lives.
struct Tracked(Vec<f32>);

impl Drop for Tracked {
    fn drop(&mut self) {
        TRACKED.set(TRACKED.get() - 1);
    }
}

impl Node for Tracked {
    fn descriptor() -> Descriptor {
        Descriptor::new("tracked", "Passes on.")
            .input(Input::new("in", AUDIO, Unit::NONE))
            .output(Output::new("out", AUDIO, Unit::NONE))
            .param(Param::integer("version", 0, 0..=1_000_000, "Changes nothing."))
    }

    fn prepare(_: &Setup<'_>) -> Result<Self, Diagnostic> {
        TRACKED.set(TRACKED.get() + 1);
        Ok(Self(vec![0.0; 1000]))
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let input = tick.inputs.audio(0);
        self.0[..input.len()].copy_from_slice(input);
        tick.outputs.audio(0).copy_from_slice(input);
        Status::Continue
    }

    fn reset(&mut self) {}
}

/// Adds these kinds.
pub fn with_tones(registry: Registry) -> Registry {
    registry
        .with::<Tone>()
        .with::<OnePole<true>>()
        .with::<OnePole<false>>()
        .with::<Taps>()
        .with::<Scale>()
        .with::<LiveGain>()
        .with::<Level>()
        .with::<Amps>()
        .with::<Tracked>()
}
