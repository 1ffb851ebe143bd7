//! Nodes that fail by chance, in every way and at every place where a node is called.

use std::cell::Cell;

use asperity_node::{
    Descriptor, Diagnostic, FrameLayout, FrameRate, Input, LayoutSpec, Node, Output, Param, Prepared,
    Processor, RateSpec, Registry, Resume, Setup, ShapeSpec, Status, Tick, Unit, random,
};

/// Number of injectors in a graph.
pub(super) const INJECTORS: usize = 16;

thread_local! {
    /// Failures of each injector in an engine of this thread.
    static INJECTED: [Cell<u64>; INJECTORS] = const { [const { Cell::new(0) }; INJECTORS] };
}

/// Failures of an injector.
pub(super) fn injected(number: usize) -> u64 {
    INJECTED.with(|all| all[number].get())
}

/// Failures of all injectors.
pub(super) fn injected_all() -> u64 {
    INJECTED.with(|all| all.iter().map(Cell::get).sum())
}

/// Begins to count anew.
pub(super) fn forget() {
    INJECTED.with(|all| all.iter().for_each(|count| count.set(0)));
}

/// Decides when to fail. It counts all calls since it was made, so that a reset is no return to the same
/// fault.
struct Dice {
    number: usize,
    one_in: u64,
    calls: u64,
}

const LAYOUT_HZ: u32 = 2500;

impl Dice {
    fn params(descriptor: Descriptor) -> Descriptor {
        descriptor
            .param(Param::integer("number", 0, 0..=INJECTORS as i64 - 1, "Which it is."))
            .param(Param::integer("one_in", 100, 1..=1_000_000_000, "It fails once in so many calls."))
    }

    fn new(setup: &Setup<'_>) -> Self {
        let p = setup.params;
        Self { number: p.integer("number") as usize, one_in: p.integer("one_in") as u64, calls: 0 }
    }

    /// A number that says how to fail, now and then.
    fn throw(&mut self) -> Option<u64> {
        self.calls += 1;
        let bits = random::bits(self.number as u64 + 100, self.calls);
        let fails = bits.is_multiple_of(self.one_in);
        if fails {
            INJECTED.with(|all| all[self.number].set(all[self.number].get() + 1));
        }
        fails.then(|| random::bits(self.number as u64 + 200, self.calls))
    }

    /// Panics now and then, with a text or with something else.
    fn may_panic(&mut self) {
        match self.throw().map(|how| how % 3) {
            Some(0) => panic!("as told"),
            Some(1) => panic!("as told, for the {}th time", self.calls),
            Some(_) => std::panic::panic_any(vec![self.calls; 8]),
            None => {}
        }
    }
}

/// A wave, a force and frames; sometimes tiny, which is no fault.
struct Chance(Dice);

impl Node for Chance {
    fn descriptor() -> Descriptor {
        let frame_rate = FrameRate::new(500, 1).expect("a rate");
        let layout = FrameLayout { rate_hz: LAYOUT_HZ, length: 250, bins: 101, frame_rate };
        Dice::params(Descriptor::new("chance", "Fails by chance."))
            .output(Output::new("audio", ShapeSpec::Audio(RateSpec::Graph), Unit::AMPERE))
            .output(Output::new("control", ShapeSpec::Control(1), Unit::NEWTON))
            .output(Output::new(
                "frame",
                ShapeSpec::Magnitude(LayoutSpec::Is(layout)),
                Unit::METRE_PER_SECOND_SQUARED,
            ))
            .resumes(Resume::Elapsed)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self(Dice::new(setup))))
    }
}

impl Processor for Chance {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let tiny = random::bits(7, tick.index).is_multiple_of(16);
        let size = if tiny { f32::MIN_POSITIVE / 64.0 } else { 0.3 };
        let span = tick.samples(48_000);
        for (y, n) in tick.outputs.audio(0).iter_mut().zip(span) {
            *y = size * (n as f32 * 0.01).sin();
        }
        tick.outputs.set(1, if tiny { f64::MIN_POSITIVE / 64.0 } else { 0.5 });
        let start = tick.samples(LAYOUT_HZ).start;
        tick.outputs.magnitude(2, tick.index, start).fill(size);
        let Some(how) = self.0.throw() else { return Status::Continue };
        let at = (how >> 8) as usize % 80;
        match how % 9 {
            0 => panic!("as told"),
            1 => panic!("as told, in tick {}", tick.index),
            2 => std::panic::panic_any(vec![how; 8]),
            3 => return Status::Error(how as u32),
            4 => tick.outputs.audio(0)[at] = f32::NAN,
            5 => tick.outputs.audio(0)[at] = f32::NEG_INFINITY,
            6 => tick.outputs.set(1, f64::NAN),
            7 => tick.outputs.magnitude(2, tick.index, start)[at] = f32::INFINITY,
            _ => {
                tick.outputs.audio(0).fill(f32::NAN);
                tick.outputs.set(1, f64::INFINITY);
            }
        }
        Status::Continue
    }

    fn reset(&mut self) {
        self.0.may_panic();
    }

    fn elapsed(&mut self, _: u64) {
        self.0.may_panic();
    }
}

/// Passes audio on, open half of the time.
struct ChanceGate(Dice);

impl Node for ChanceGate {
    fn descriptor() -> Descriptor {
        Dice::params(Descriptor::new("chance_gate", "Fails by chance."))
            .input(Input::new("in", ShapeSpec::Audio(RateSpec::Graph), Unit::AMPERE))
            .output(Output::new("out", ShapeSpec::Audio(RateSpec::Graph), Unit::AMPERE))
            .gates("in")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self(Dice::new(setup))))
    }
}

impl Processor for ChanceGate {
    fn wants(&mut self, tick: &mut Tick<'_>) -> bool {
        self.0.may_panic();
        (tick.index / 10).is_multiple_of(2)
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        self.0.may_panic();
        tick.outputs.audio(0).copy_from_slice(tick.inputs.audio(0));
        Status::Continue
    }

    fn reset(&mut self) {
        self.0.may_panic();
    }
}

/// Half of the last tick and a wave, in a cycle.
struct ChanceLoop {
    dice: Dice,
    last: Vec<f32>,
}

impl Node for ChanceLoop {
    fn descriptor() -> Descriptor {
        Dice::params(Descriptor::new("chance_loop", "Fails by chance."))
            .input(Input::new("in", ShapeSpec::Audio(RateSpec::Graph), Unit::AMPERE))
            .output(Output::new("out", ShapeSpec::Audio(RateSpec::Graph), Unit::AMPERE))
            .param(Param::number("delay_ms", 2.0, 2.0..=2.0, "A tick."))
            .closes_cycles("delay_ms")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self { dice: Dice::new(setup), last: vec![0.0; 96] }))
    }
}

impl Processor for ChanceLoop {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        self.dice.may_panic();
        let span = tick.samples(48_000);
        for ((y, x), n) in tick.outputs.audio(0).iter_mut().zip(&self.last).zip(span) {
            *y = x + 0.1 * (n as f32 * 0.01).sin();
        }
        Status::Continue
    }

    fn absorb(&mut self, tick: &mut Tick<'_>) {
        self.dice.may_panic();
        self.last.copy_from_slice(tick.inputs.audio(0));
    }

    fn reset(&mut self) {
        self.last.fill(0.0);
        self.dice.may_panic();
    }
}

/// Panics when it is called, and when it is put back to the start.
struct BreaksTwice;

impl Node for BreaksTwice {
    fn descriptor() -> Descriptor {
        let out = Output::new("out", ShapeSpec::Control(1), Unit::NONE);
        Descriptor::new("breaks_twice", "Panics.").output(out)
    }

    fn prepare(_: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self))
    }
}

impl Processor for BreaksTwice {
    fn process(&mut self, _: &mut Tick<'_>) -> Status {
        panic!("as told")
    }

    fn reset(&mut self) {
        panic!("as told, again")
    }
}

/// The built-in kinds and these.
pub(super) fn registry() -> Registry {
    harness::registry().with::<Chance>().with::<ChanceGate>().with::<ChanceLoop>().with::<BreaksTwice>()
}
