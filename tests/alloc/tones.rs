//! Nodes to hear a swap by: a tone, a filter with a memory, a live gain; and one that counts how many of it
//! live.

use std::cell::Cell;
use std::f64::consts::TAU;
use std::sync::Arc;

use asperity_checks::wrap::stateless;
use asperity_node::{
    Descriptor, Input, Latency, NodeKind, Output, Param, Params, Prepared, Processor, RateSpec, Registry,
    Resume, ShapeSpec, State, Status, Tick, Unit,
};

const AUDIO: ShapeSpec = ShapeSpec::Audio(RateSpec::Graph);
const CONTROL: ShapeSpec = ShapeSpec::Control(1);

/// A kind as functions of its memory.
struct Toy<M> {
    fresh: fn(&Params) -> M,
    process: fn(&mut M, &mut Tick<'_>) -> Status,
    clear: fn(&mut M),
    keep: fn(&mut M, &mut State<'_>),
    set: fn(&mut M, usize, f64),
    wants: bool,
    latency: Latency,
}

impl<M: Send + 'static> Toy<M> {
    fn new(fresh: fn(&Params) -> M, process: fn(&mut M, &mut Tick<'_>) -> Status) -> Self {
        let (clear, keep, set): (fn(&mut M), fn(&mut M, &mut State<'_>), fn(&mut M, usize, f64)) =
            (|_| {}, |_, _| {}, |_, _, _| {});
        Self { fresh, process, clear, keep, set, wants: true, latency: Latency::ZERO }
    }

    fn made(self, descriptor: Descriptor) -> Arc<NodeKind> {
        let toy = Arc::new(self);
        Arc::new(NodeKind::new(descriptor, move |setup| {
            let made = Made { now: (toy.fresh)(setup.params), toy: toy.clone() };
            Ok(Prepared::new(made).latency(toy.latency))
        }))
    }
}

struct Made<M> {
    toy: Arc<Toy<M>>,
    now: M,
}

impl<M: Send> Processor for Made<M> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        (self.toy.process)(&mut self.now, tick)
    }

    fn reset(&mut self) {
        (self.toy.clear)(&mut self.now);
    }

    fn wants(&mut self, _: &mut Tick<'_>) -> bool {
        self.toy.wants
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        (self.toy.set)(&mut self.now, index, value);
    }

    fn state(&mut self, state: &mut State<'_>) {
        (self.toy.keep)(&mut self.now, state);
    }
}

/// A node that passes audio on.
fn passes(kind: &'static str) -> Descriptor {
    let out = Output::new("out", AUDIO, Unit::NONE);
    Descriptor::new(kind, "Passes on.").input(Input::new("in", AUDIO, Unit::NONE)).output(out)
}

/// A node that gives a force.
fn control(kind: &'static str) -> Descriptor {
    Descriptor::new(kind, "A force.").output(Output::new("out", CONTROL, Unit::NEWTON))
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

/// A one-pole low-pass that hands its memory on, or forgets to.
fn one_pole(kind: &'static str, keeps: bool) -> Arc<NodeKind> {
    let toy = Toy::<(f32, f32)>::new(
        |p| (p.number("part") as f32, 0.0),
        |(part, memory), tick| {
            for (y, x) in tick.outputs.audio(0).iter_mut().zip(tick.inputs.audio(0)) {
                *memory += *part * (x - *memory);
                *y = *memory;
            }
            Status::Continue
        },
    );
    let kept = Toy {
        keep: |it: &mut (f32, f32), state| _ = state.keep(&mut it.1),
        ..Toy::new(toy.fresh, toy.process)
    };
    let toy = Toy { clear: |it: &mut (f32, f32)| it.1 = 0.0, ..if keeps { kept } else { toy } };
    let part = Param::number("part", 0.001, 0.0..=1.0, "Part of a new sample.");
    toy.made(passes(kind).param(part).resumes(Resume::Never))
}

/// Calls, a list, and the first bad tick.
type TapsMemory = (f64, Vec<f64>, u64);

/// Counts its calls, and fails from a tick on; it has a list besides, of a length that may not fit another's.
fn taps() -> Arc<NodeKind> {
    let toy = Toy::<TapsMemory>::new(
        |p| (0.0, vec![0.0; p.integer("taps") as usize], p.integer("fails_from") as u64),
        |(calls, _, fails_from), tick| {
            *calls += 1.0;
            tick.outputs.set(0, *calls);
            if tick.index >= *fails_from { Status::Error(1) } else { Status::Continue }
        },
    );
    let descriptor = control("taps")
        .param(Param::integer("taps", 1, 1..=9, "How many."))
        .param(Param::integer("fails_from", 1_000_000, 0..=1_000_000, "Its first bad tick."));
    let toy = Toy { keep: |it: &mut TapsMemory, state| _ = state.keep(&mut it.0).keep(&mut it.1), ..toy };
    Toy { clear: |it: &mut TapsMemory| it.0 = 0.0, ..toy }.made(descriptor)
}

/// Puts out 15 ms later what comes in, and hands nothing on.
fn late() -> Arc<NodeKind> {
    let toy = Toy::<Vec<f32>>::new(
        |_| vec![0.0; 720],
        |line, tick| {
            let input = tick.inputs.audio(0);
            tick.outputs.audio(0).copy_from_slice(&line[..input.len()]);
            line.rotate_left(input.len());
            let end = line.len() - input.len();
            line[end..].copy_from_slice(input);
            Status::Continue
        },
    );
    let latency = Latency::ratio(15, 1000);
    Toy { latency, clear: |line: &mut Vec<f32>| line.fill(0.0), ..toy }
        .made(passes("late").param(version("version", 9)))
}

/// Lets its upstream sleep for good.
fn shut() -> Arc<NodeKind> {
    let descriptor = control("shut").input(Input::new("in", CONTROL, Unit::NEWTON)).gates("in");
    Toy { wants: false, ..Toy::<()>::new(|_| (), |(), _| Status::Continue) }.made(descriptor)
}

/// A gain that may change while it runs.
fn live_gain() -> Arc<NodeKind> {
    let toy = Toy::<f32>::new(
        |p| p.number("gain") as f32 * if p.text("sign") == "minus" { -1.0 } else { 1.0 },
        |gain, tick| scaled(tick, *gain),
    );
    let set: fn(&mut f32, usize, f64) = |gain, index, value| match index {
        1 => *gain = gain.signum() * value as f32,
        2 => *gain = gain.abs() * if value == 1.0 { -1.0 } else { 1.0 },
        _ => {}
    };
    let descriptor = passes("live_gain")
        .param(version("fixed", 9))
        .param(Param::number("gain", 1.0, 0.0..=2.0, "The factor.").live())
        .param(Param::choice("sign", &["plus", "minus"], "Its sign.").live());
    Toy { set, ..toy }.made(descriptor)
}

/// A value that stands in the graph; live or not.
fn level(kind: &'static str, live: bool) -> Arc<NodeKind> {
    let toy = Toy::<f64>::new(
        |p| p.number("value"),
        |level, tick| {
            tick.outputs.set(0, *level);
            Status::Asleep
        },
    );
    let value = Param::number("value", 0.0, -100.0..=100.0, "The value.");
    Toy { set: |level, _, value| *level = value, ..toy }.made(control(kind).param(if live {
        value.live()
    } else {
        value
    }))
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
pub fn with_tones(mut registry: Registry) -> Registry {
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
    let scale = passes("scale").param(Param::number("by", 1.0, -1e6..=1e6, "The factor."));
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
    let counted = stateless(passes("tracked").param(version("version", 1_000_000)), |_| {
        let mut memory = Tracked::new();
        move |tick| {
            TRACKED_CALLS.set(TRACKED_CALLS.get() + 1);
            let input = tick.inputs.audio(0);
            memory.0[..input.len()].copy_from_slice(input);
            scaled(tick, 1.0)
        }
    });
    let levels = [level("level", false), level("live_level", true)];
    let poles = [one_pole("one_pole", true), one_pole("forgetful", false)];
    let others = [taps(), late(), shut(), live_gain(), tone, scale, amps, counted];
    for kind in levels.into_iter().chain(poles).chain(others) {
        registry.add(kind);
    }
    registry
}
