//! Nodes that fail by chance, in every way and at every place where a node is called.

use std::cell::Cell;
use std::sync::Arc;

use asperity_node::{
    Descriptor, FrameLayout, FrameRate, Input, LayoutSpec, NodeKind, Output, Param, Prepared, Processor,
    RateSpec, Registry, Resume, ShapeSpec, Status, Tick, Unit, random,
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
    (0..INJECTORS).map(injected).sum()
}

/// Begins to count anew.
pub(super) fn forget() {
    INJECTED.with(|all| all.iter().for_each(|count| count.set(0)));
}

const LAYOUT_HZ: u32 = 2500;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// A wave, a force and frames; sometimes tiny, which is no fault.
    Source,
    /// Passes audio on, open half of the time.
    Gate,
    /// Half of the last tick and a wave, in a cycle.
    Loop,
    /// Panics when it is called, and when it is put back to the start.
    BreaksTwice,
}

/// A node that decides when to fail. It counts all calls since it was made, so that a reset is no return to
/// the same fault.
struct Chance {
    kind: Kind,
    number: usize,
    one_in: u64,
    calls: u64,
    last: Vec<f32>,
}

impl Chance {
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

    fn source(&mut self, tick: &mut Tick<'_>) -> Status {
        let tiny = random::bits(7, tick.index).is_multiple_of(16);
        let size = if tiny { f32::MIN_POSITIVE / 64.0 } else { 0.3 };
        let span = tick.samples(48_000);
        for (y, n) in tick.outputs.audio(0).iter_mut().zip(span) {
            *y = size * (n as f32 * 0.01).sin();
        }
        tick.outputs.set(1, if tiny { f64::MIN_POSITIVE / 64.0 } else { 0.5 });
        let start = tick.samples(LAYOUT_HZ).start;
        tick.outputs.magnitude(2, tick.index, start).fill(size);
        let Some(how) = self.throw() else { return Status::Continue };
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
}

impl Processor for Chance {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        if self.kind == Kind::Source {
            return self.source(tick);
        }
        assert!(self.kind != Kind::BreaksTwice, "as told");
        self.may_panic();
        if self.kind == Kind::Gate {
            tick.outputs.audio(0).copy_from_slice(tick.inputs.audio(0));
            return Status::Continue;
        }
        let span = tick.samples(48_000);
        for ((y, x), n) in tick.outputs.audio(0).iter_mut().zip(&self.last).zip(span) {
            *y = x + 0.1 * (n as f32 * 0.01).sin();
        }
        Status::Continue
    }

    fn wants(&mut self, tick: &mut Tick<'_>) -> bool {
        self.may_panic();
        (tick.index / 10).is_multiple_of(2)
    }

    fn absorb(&mut self, tick: &mut Tick<'_>) {
        self.may_panic();
        self.last.copy_from_slice(tick.inputs.audio(0));
    }

    fn reset(&mut self) {
        assert!(self.kind != Kind::BreaksTwice, "as told, again");
        self.last.fill(0.0);
        self.may_panic();
    }

    fn elapsed(&mut self, _: u64) {
        self.may_panic();
    }
}

/// The built-in kinds and these.
pub(super) fn registry() -> Registry {
    let described = |name: &'static str| {
        Descriptor::new(name, "Fails by chance.")
            .param(Param::integer("number", 0, 0..=INJECTORS as i64 - 1, "Which it is."))
            .param(Param::integer("one_in", 100, 1..=1_000_000_000, "It fails once in so many calls."))
    };
    let audio = ShapeSpec::Audio(RateSpec::Graph);
    let passes = |name: &'static str| {
        let (input, output) =
            (Input::new("in", audio, Unit::AMPERE), Output::new("out", audio, Unit::AMPERE));
        described(name).input(input).output(output)
    };
    let frame_rate = FrameRate::new(500, 1).expect("a rate");
    let layout = FrameLayout { rate_hz: LAYOUT_HZ, length: 250, bins: 101, frame_rate };
    let frames = ShapeSpec::Magnitude(LayoutSpec::Is(layout));
    let force = |name: &'static str| Output::new(name, ShapeSpec::Control(1), Unit::NEWTON);
    let source = described("chance")
        .output(Output::new("audio", audio, Unit::AMPERE))
        .output(force("control"))
        .output(Output::new("frame", frames, Unit::METRE_PER_SECOND_SQUARED))
        .resumes(Resume::Elapsed);
    let tick = Param::number("delay_ms", 2.0, 2.0..=2.0, "A tick.");
    let mut all = harness::registry();
    for (kind, descriptor) in [
        (Kind::Source, source),
        (Kind::Gate, passes("chance_gate").gates("in")),
        (Kind::Loop, passes("chance_loop").param(tick).closes_cycles("delay_ms")),
        (Kind::BreaksTwice, described("breaks_twice").output(force("out"))),
    ] {
        all.add(Arc::new(NodeKind::new(descriptor, move |setup| {
            let [number, one_in] = ["number", "one_in"].map(|name| setup.params.integer(name) as u64);
            let (number, last) = (number as usize, vec![0.0; 96]);
            Ok(Prepared::new(Chance { kind, number, one_in, calls: 0, last }))
        })));
    }
    all
}
