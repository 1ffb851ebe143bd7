//! Nodes that sleep, fail and panic as a test wants.

use std::ops::Range;
use std::sync::Arc;

use asperity_node::{
    Descriptor, FrameLayout, FrameRate, Input, LayoutSpec, NodeKind, Output, Param, Params, Prepared,
    Processor, RateSpec, Registry, Resume, ShapeSpec, Status, Tick, Unit,
};

/// A kind of node as functions of what a node remembers.
struct Kind<M> {
    descriptor: Descriptor,
    fresh: fn(&Params) -> M,
    process: fn(&mut M, &mut Tick<'_>) -> Status,
    wants: fn(&mut M, &mut Tick<'_>) -> bool,
    elapsed: fn(&mut M, u64),
    /// From what it remembered at the start.
    reset: fn(&M) -> M,
}

/// A kind that does nothing more than `process`.
fn kind<M: Clone + Send + 'static>(
    descriptor: Descriptor,
    fresh: fn(&Params) -> M,
    process: fn(&mut M, &mut Tick<'_>) -> Status,
) -> Kind<M> {
    Kind { descriptor, fresh, process, wants: |_, _| true, elapsed: |_, _| {}, reset: M::clone }
}

impl<M: Clone + Send + 'static> Kind<M> {
    fn made(self) -> Arc<NodeKind> {
        let (descriptor, kind) = (self.descriptor.clone(), Arc::new(self));
        Arc::new(NodeKind::new(descriptor, move |setup| {
            let fresh = (kind.fresh)(setup.params);
            Ok(Prepared::new(Made { kind: kind.clone(), now: fresh.clone(), fresh }))
        }))
    }
}

struct Made<M> {
    kind: Arc<Kind<M>>,
    fresh: M,
    now: M,
}

impl<M: Send> Processor for Made<M> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        (self.kind.process)(&mut self.now, tick)
    }

    fn wants(&mut self, tick: &mut Tick<'_>) -> bool {
        (self.kind.wants)(&mut self.now, tick)
    }

    fn elapsed(&mut self, ticks: u64) {
        (self.kind.elapsed)(&mut self.now, ticks);
    }

    fn reset(&mut self) {
        self.now = (self.kind.reset)(&self.fresh);
    }
}

/// A kind that remembers nothing.
fn forgetful(descriptor: Descriptor, process: fn(&mut Tick<'_>) -> Status) -> Arc<NodeKind> {
    struct Forgetful(fn(&mut Tick<'_>) -> Status);
    impl Processor for Forgetful {
        fn process(&mut self, tick: &mut Tick<'_>) -> Status {
            (self.0)(tick)
        }
        fn reset(&mut self) {}
    }
    Arc::new(NodeKind::new(descriptor, move |_| Ok(Prepared::new(Forgetful(process)))))
}

fn audio_in() -> Input {
    Input::new("in", ShapeSpec::Audio(RateSpec::Graph), Unit::NONE)
}

fn audio(name: &'static str) -> Output {
    Output::new(name, ShapeSpec::Audio(RateSpec::Graph), Unit::NONE)
}

fn control(name: &'static str, values: usize) -> Output {
    Output::new(name, ShapeSpec::Control(values), Unit::NONE)
}

/// Emits its sample numbers, as audio, its tick and its calls.
fn counter() -> Arc<NodeKind> {
    let it = Descriptor::new("counter", "Counts.")
        .output(audio("samples"))
        .output(control("tick", 1))
        .output(control("calls", 1));
    kind(
        it,
        |_| 0,
        |calls: &mut u64, tick| {
            *calls += 1;
            let span = tick.samples(48_000);
            for (y, n) in tick.outputs.audio(0).iter_mut().zip(span) {
                *y = n as f32;
            }
            tick.outputs.set(1, tick.index as f64);
            tick.outputs.set(2, *calls as f64);
            Status::Continue
        },
    )
    .made()
}

/// Puts out ones on every kind of port, and goes wrong from tick `from` to tick `to`.
fn faulty() -> Arc<NodeKind> {
    const RATE_HZ: u32 = 2500;
    let frame_rate = FrameRate::new(500, 1).expect("a rate");
    let layout = FrameLayout { rate_hz: RATE_HZ, length: 250, bins: 4, frame_rate };
    // A reset takes a copy of what it is told, and must not allocate: no `String`.
    const WAYS: &[&str] = &["nan", "panic", "error", "nan control", "inf frame"];
    let it = Descriptor::new("faulty", "Fails when told to.")
        .output(audio("audio"))
        .output(control("control", 2))
        .output(Output::new("frame", ShapeSpec::Magnitude(LayoutSpec::Is(layout)), Unit::NONE))
        .param(Param::integer("from", 0, 0..=1_000_000, "First bad tick."))
        .param(Param::integer("to", 0, 0..=1_000_000, "First good tick after that."))
        .param(Param::choice("how", WAYS, "How it fails."));
    let told = |p: &Params| {
        let how = WAYS.iter().position(|way| *way == p.text("how"));
        (p.integer("from") as u64..p.integer("to") as u64, how.map_or("", |at| WAYS[at]))
    };
    kind(it, told, |(bad, how), tick| {
        tick.outputs.audio(0).fill(1.0);
        let k = tick.index as f64;
        tick.outputs.control(1).copy_from_slice(&[k, -k]);
        let start = tick.samples(RATE_HZ).start;
        tick.outputs.magnitude(2, tick.index, start).fill(1.0);
        if bad.contains(&tick.index) {
            match *how {
                "nan" => tick.outputs.audio(0)[7] = f32::NAN,
                "nan control" => tick.outputs.control(1)[1] = f64::NAN,
                "inf frame" => tick.outputs.magnitude(2, tick.index, start)[3] = f32::INFINITY,
                "panic" => panic!("as told"),
                _ => return Status::Error(42),
            }
        }
        Status::Continue
    })
    .made()
}

/// Sleeps while its input is silent; doubles what comes in.
fn dozer() -> Arc<NodeKind> {
    let it =
        Descriptor::new("dozer", "Sleeps while its input is silent.").input(audio_in()).output(audio("out"));
    forgetful(it, |tick| {
        let input = tick.inputs.audio(0);
        if input.iter().all(|x| *x == 0.0) {
            return Status::Asleep;
        }
        for (y, x) in tick.outputs.audio(0).iter_mut().zip(input) {
            *y = 2.0 * x;
        }
        Status::Continue
    })
}

/// Loud, then failing for three ticks, then asleep.
fn sleeper() -> Arc<NodeKind> {
    let it = Descriptor::new("sleeper", "Loud, failing, asleep.").output(audio("out"));
    forgetful(it, |tick| match tick.index {
        0..5 => {
            tick.outputs.audio(0).fill(1.0);
            Status::Continue
        }
        5..8 => Status::Error(1),
        _ => Status::Asleep,
    })
}

/// Rings for three ticks after its input.
fn tail3() -> Arc<NodeKind> {
    let it = Descriptor::new("tail3", "Rings.").input(audio_in()).output(audio("out"));
    forgetful(it, |tick| {
        tick.outputs.audio(0).fill(1.0);
        Status::Tail(3)
    })
}

/// A slow wave in A whose trust rests on a control.
fn marked() -> Arc<NodeKind> {
    let it = Descriptor::new("marked", "A wave.")
        .input(audio_in())
        .input(Input::new("control", ShapeSpec::Control(2), Unit::NONE))
        // As if a limiter stood behind it, so that a sink can be looked at alone.
        .output(Output::new("out", ShapeSpec::Audio(RateSpec::Graph), Unit::AMPERE).limited());
    forgetful(it, |tick| {
        let span = tick.samples(48_000);
        for (y, n) in tick.outputs.audio(0).iter_mut().zip(span) {
            *y = 0.05 * (n as f32 * 0.02).sin();
        }
        Status::Continue
    })
}

/// Passes a control on and sleeps until it changes, if it says that this wakes it.
fn copier(name: &'static str, wakes: bool) -> Arc<NodeKind> {
    let input = Input::new("in", ShapeSpec::Control(1), Unit::NEWTON);
    let it = Descriptor::new(name, "Passes a control on.")
        .input(if wakes { input.wakes() } else { input })
        .output(Output::new("out", ShapeSpec::Control(1), Unit::NEWTON));
    forgetful(it, |tick| {
        let x = tick.inputs.value(0);
        tick.outputs.set(0, x);
        Status::Asleep
    })
}

/// Counts its calls, and the ticks that it slept, so that what it remembers can be seen.
fn memory(name: &'static str, resume: Resume) -> Arc<NodeKind> {
    let it = Descriptor::new(name, "Counts its calls into an audio level.")
        .input(audio_in())
        .output(audio("out"))
        .resumes(resume);
    let count = |(calls, elapsed): &mut (f32, u64), tick: &mut Tick<'_>| {
        *calls += 1.0;
        tick.outputs.audio(0).fill(*calls + 1000.0 * *elapsed as f32);
        Status::Continue
    };
    Kind { elapsed: |(_, elapsed), ticks| *elapsed = ticks, ..kind(it, |_| (0.0, 0), count) }.made()
}

/// Closed from tick `close` to tick `open`.
fn test_gate() -> Arc<NodeKind> {
    let it = Descriptor::new("test_gate", "Closed from tick `close` to tick `open`.")
        .input(audio_in())
        .output(audio("out"))
        .param(Param::integer("close", 3, 0..=100, "First closed tick."))
        .param(Param::integer("open", 6, 0..=100, "First open tick after that."))
        .gates("in");
    let pass = |(_, wanted): &mut (Range<u64>, bool), tick: &mut Tick<'_>| {
        if !*wanted {
            return Status::Quiet;
        }
        tick.outputs.audio(0).copy_from_slice(tick.inputs.audio(0));
        Status::Continue
    };
    let wants = |(closed, wanted): &mut (Range<u64>, bool), tick: &mut Tick<'_>| {
        *wanted = !closed.contains(&tick.index);
        *wanted
    };
    let fresh = |p: &Params| (p.integer("close") as u64..p.integer("open") as u64, true);
    Kind { wants, ..kind(it, fresh, pass) }.made()
}

thread_local! {
    /// Time that [`TestClock`] reads; [`Slow`] moves it on.
    static NOW_NS: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

/// A clock that stands still but for what slow nodes take.
pub struct TestClock;

impl asperity_engine::Clock for TestClock {
    fn now_ns(&self) -> u64 {
        NOW_NS.get()
    }
}

/// Puts out ones and takes a microsecond, but a millisecond from tick `from` to tick `to`.
fn slow() -> Arc<NodeKind> {
    let it = Descriptor::new("slow", "Takes its time.")
        .output(audio("out"))
        .output(control("control", 1))
        .param(Param::integer("from", 0, 0..=1_000_000, "First slow tick."))
        .param(Param::integer("to", 0, 0..=1_000_000, "First quick tick after that."));
    let fresh = |p: &Params| p.integer("from") as u64..p.integer("to") as u64;
    let take = |slow: &mut Range<u64>, tick: &mut Tick<'_>| {
        NOW_NS.set(NOW_NS.get() + if slow.contains(&tick.index) { 1_000_000 } else { 1_000 });
        tick.outputs.audio(0).fill(1.0);
        tick.outputs.set(1, tick.index as f64);
        Status::Continue
    };
    // A slow call is no reason to start over: this would show.
    Kind { reset: |_| 0..0, ..kind(it, fresh, take) }.made()
}

/// The built-in kinds and these.
pub fn registry() -> Registry {
    let made = [
        counter(),
        faulty(),
        memory("memory_restart", Resume::Restart),
        memory("memory_elapsed", Resume::Elapsed),
        memory("memory_resume", Resume::Continue),
        memory("memory_never", Resume::Never),
        test_gate(),
        dozer(),
        sleeper(),
        tail3(),
        marked(),
        copier("waker", true),
        copier("deaf", false),
        slow(),
    ];
    made.into_iter().fold(crate::registry(), |mut registry, kind| {
        registry.add(kind);
        registry
    })
}
