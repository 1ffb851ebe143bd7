//! Nodes that sleep, fail and panic as a test wants.

use std::sync::Arc;

use asperity_node::{
    Descriptor, Diagnostic, FrameLayout, FrameRate, Input, LayoutSpec, Node, NodeKind, Output, Param, Params,
    Prepared, Processor, RateSpec, Registry, Resume, Setup, ShapeSpec, Status, Tick, Unit,
};

/// A node that is a function of what it remembers and of the tick.
struct Made<M> {
    fresh: M,
    now: M,
    process: fn(&mut M, &mut Tick<'_>) -> Status,
}

impl<M: Clone + Send> Processor for Made<M> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        (self.process)(&mut self.now, tick)
    }

    fn reset(&mut self) {
        self.now = self.fresh.clone();
    }
}

/// A kind of node from its memory at the start and its function.
fn kind<M: Clone + Send + 'static>(
    descriptor: Descriptor,
    fresh: fn(&Params) -> M,
    process: fn(&mut M, &mut Tick<'_>) -> Status,
) -> Arc<NodeKind> {
    Arc::new(NodeKind::new(descriptor, move |setup| {
        let fresh = fresh(setup.params);
        Ok(Prepared::new(Made { now: fresh.clone(), fresh, process }))
    }))
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
}

/// Puts out ones on every kind of port, and goes wrong from tick `from` to tick `to`.
fn faulty() -> Arc<NodeKind> {
    const RATE_HZ: u32 = 2500;
    let frame_rate = FrameRate::new(500, 1).expect("a rate");
    let layout = FrameLayout { rate_hz: RATE_HZ, length: 250, bins: 4, frame_rate };
    let ways = &["nan", "panic", "error", "nan control", "inf frame"];
    let it = Descriptor::new("faulty", "Fails when told to.")
        .output(audio("audio"))
        .output(control("control", 2))
        .output(Output::new("frame", ShapeSpec::Magnitude(LayoutSpec::Is(layout)), Unit::NONE))
        .param(Param::integer("from", 0, 0..=1_000_000, "First bad tick."))
        .param(Param::integer("to", 0, 0..=1_000_000, "First good tick after that."))
        .param(Param::choice("how", ways, "How it fails."));
    let told = |p: &Params| (p.integer("from") as u64..p.integer("to") as u64, p.text("how").to_owned());
    kind(it, told, |(bad, how), tick| {
        tick.outputs.audio(0).fill(1.0);
        let k = tick.index as f64;
        tick.outputs.control(1).copy_from_slice(&[k, -k]);
        let start = tick.samples(RATE_HZ).start;
        tick.outputs.magnitude(2, tick.index, start).fill(1.0);
        if bad.contains(&tick.index) {
            match how.as_str() {
                "nan" => tick.outputs.audio(0)[7] = f32::NAN,
                "nan control" => tick.outputs.control(1)[1] = f64::NAN,
                "inf frame" => tick.outputs.magnitude(2, tick.index, start)[3] = f32::INFINITY,
                "panic" => panic!("as told"),
                _ => return Status::Error(42),
            }
        }
        Status::Continue
    })
}

/// Sleeps while its input is silent; doubles what comes in.
fn dozer() -> Arc<NodeKind> {
    let it =
        Descriptor::new("dozer", "Sleeps while its input is silent.").input(audio_in()).output(audio("out"));
    kind(
        it,
        |_| (),
        |_, tick| {
            let input = tick.inputs.audio(0);
            if input.iter().all(|x| *x == 0.0) {
                return Status::Asleep;
            }
            for (y, x) in tick.outputs.audio(0).iter_mut().zip(input) {
                *y = 2.0 * x;
            }
            Status::Continue
        },
    )
}

/// Loud, then failing for three ticks, then asleep.
fn sleeper() -> Arc<NodeKind> {
    let it = Descriptor::new("sleeper", "Loud, failing, asleep.").output(audio("out"));
    kind(
        it,
        |_| (),
        |_, tick| match tick.index {
            0..5 => {
                tick.outputs.audio(0).fill(1.0);
                Status::Continue
            }
            5..8 => Status::Error(1),
            _ => Status::Asleep,
        },
    )
}

/// Rings for three ticks after its input.
fn tail3() -> Arc<NodeKind> {
    let it = Descriptor::new("tail3", "Rings.").input(audio_in()).output(audio("out"));
    kind(
        it,
        |_| (),
        |_, tick| {
            tick.outputs.audio(0).fill(1.0);
            Status::Tail(3)
        },
    )
}

/// A slow wave in A whose trust rests on a control.
fn marked() -> Arc<NodeKind> {
    let it = Descriptor::new("marked", "A wave.")
        .input(audio_in())
        .input(Input::new("control", ShapeSpec::Control(2), Unit::NONE))
        // As if a limiter stood behind it, so that a sink can be looked at alone.
        .output(Output::new("out", ShapeSpec::Audio(RateSpec::Graph), Unit::AMPERE).limited());
    kind(
        it,
        |_| (),
        |_, tick| {
            let span = tick.samples(48_000);
            for (y, n) in tick.outputs.audio(0).iter_mut().zip(span) {
                *y = 0.05 * (n as f32 * 0.02).sin();
            }
            Status::Continue
        },
    )
}

/// Passes a control on and sleeps until it changes, if it says that this wakes it.
fn copier(name: &'static str, wakes: bool) -> Arc<NodeKind> {
    let input = Input::new("in", ShapeSpec::Control(1), Unit::NEWTON);
    let it = Descriptor::new(name, "Passes a control on.")
        .input(if wakes { input.wakes() } else { input })
        .output(Output::new("out", ShapeSpec::Control(1), Unit::NEWTON));
    kind(
        it,
        |_| (),
        |_, tick| {
            let x = tick.inputs.value(0);
            tick.outputs.set(0, x);
            Status::Asleep
        },
    )
}

/// A one-pole smoother, so that what it remembers can be seen.
struct Memory<const RESUME: u8> {
    value: f64,
    elapsed: u64,
}

impl<const RESUME: u8> Node for Memory<RESUME> {
    fn descriptor() -> Descriptor {
        let (kind, resume) = match RESUME {
            0 => ("memory_restart", Resume::Restart),
            1 => ("memory_elapsed", Resume::Elapsed),
            2 => ("memory_resume", Resume::Continue),
            _ => ("memory_never", Resume::Never),
        };
        Descriptor::new(kind, "Counts its calls into an audio level.")
            .input(audio_in())
            .output(audio("out"))
            .resumes(resume)
    }

    fn prepare(_: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self { value: 0.0, elapsed: 0 }))
    }
}

impl<const RESUME: u8> Processor for Memory<RESUME> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        self.value += 1.0;
        tick.outputs.audio(0).fill(self.value as f32 + 1000.0 * self.elapsed as f32);
        Status::Continue
    }

    fn elapsed(&mut self, ticks: u64) {
        self.elapsed = ticks;
    }

    fn reset(&mut self) {
        (self.value, self.elapsed) = (0.0, 0);
    }
}

/// Open in the ticks that `open_to` says.
struct TestGate {
    close: u64,
    open: u64,
    wanted: bool,
}

impl Node for TestGate {
    fn descriptor() -> Descriptor {
        Descriptor::new("test_gate", "Closed from tick `close` to tick `open`.")
            .input(audio_in())
            .output(audio("out"))
            .param(Param::integer("close", 3, 0..=100, "First closed tick."))
            .param(Param::integer("open", 6, 0..=100, "First open tick after that."))
            .gates("in")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        Ok(Prepared::new(Self {
            close: p.integer("close") as u64,
            open: p.integer("open") as u64,
            wanted: true,
        }))
    }
}

impl Processor for TestGate {
    fn wants(&mut self, tick: &mut Tick<'_>) -> bool {
        self.wanted = !(self.close..self.open).contains(&tick.index);
        self.wanted
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        if !self.wanted {
            return Status::Quiet;
        }
        tick.outputs.audio(0).copy_from_slice(tick.inputs.audio(0));
        Status::Continue
    }

    fn reset(&mut self) {}
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
struct Slow {
    from: u64,
    to: u64,
}

impl Node for Slow {
    fn descriptor() -> Descriptor {
        Descriptor::new("slow", "Takes its time.")
            .output(audio("out"))
            .output(control("control", 1))
            .param(Param::integer("from", 0, 0..=1_000_000, "First slow tick."))
            .param(Param::integer("to", 0, 0..=1_000_000, "First quick tick after that."))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self {
            from: setup.params.integer("from") as u64,
            to: setup.params.integer("to") as u64,
        }))
    }
}

impl Processor for Slow {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let slow = (self.from..self.to).contains(&tick.index);
        NOW_NS.set(NOW_NS.get() + if slow { 1_000_000 } else { 1_000 });
        tick.outputs.audio(0).fill(1.0);
        tick.outputs.set(1, tick.index as f64);
        Status::Continue
    }

    /// A slow call is no reason to start over: this would show.
    fn reset(&mut self) {
        self.to = 0;
    }
}

/// The built-in kinds and these.
pub fn registry() -> Registry {
    let registry = crate::registry()
        .with::<Memory<0>>()
        .with::<Memory<1>>()
        .with::<Memory<2>>()
        .with::<Memory<3>>()
        .with::<TestGate>()
        .with::<Slow>();
    let made = [
        counter(),
        faulty(),
        dozer(),
        sleeper(),
        tail3(),
        marked(),
        copier("waker", true),
        copier("deaf", false),
    ];
    made.into_iter().fold(registry, |mut registry, kind| {
        registry.add(kind);
        registry
    })
}
