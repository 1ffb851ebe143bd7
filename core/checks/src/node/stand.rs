//! A place for a node, settled by the compiler, and an instance there that a case calls itself: as the engine
//! does, but without containing anything.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, OnceLock};

use asperity_engine::{Engine, Flushed};
use asperity_graph::{BufferEntry, Compiled, ScheduledNode, compile};
use asperity_node::{
    Buffer, Complex, Config, Descriptor, Diagnostic, Fault, FrameClock, FrameLayout, FrameRate, Input,
    InputRef, Inputs, LayoutSpec, NodeKind, Output, Outputs, PortType, Ports, Prepared, Processor, RateSpec,
    Registry, Setup, Shape, ShapeSpec, Status, Tick, Unit, UnitSpec, Wiring, random, time,
};

use super::signal::{Feed, Signal};
use crate::buffers::{finite, hash, words};
use crate::case::Stop;
use crate::played::Played;
use crate::rig::CaseGraph;
use crate::subject::Subject;
use crate::wrap::stateless;

/// Rates and types around a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Conditions {
    pub(crate) tick_hz: u32,
    pub(crate) audio_hz: u32,
    pub(crate) every: u32,
    /// Rate of an audio input that takes any rate.
    pub(crate) source_hz: u32,
    /// Rate, length and bins of a frame input that takes any layout. There are 500 frames a second, or one a
    /// tick.
    pub(crate) frames: (u32, u32, u32),
    /// Shape of an input that takes any shape.
    pub(crate) like: ShapeSpec,
    /// Inputs that stay unconnected, one bit each.
    pub(crate) without: u64,
}

/// The usual conditions.
pub(crate) const USUAL: Conditions = Conditions {
    tick_hz: 500,
    audio_hz: 48_000,
    every: 1,
    source_hz: 8000,
    frames: (2500, 250, 101),
    like: ShapeSpec::Audio(RateSpec::Graph),
    without: 0,
};

impl fmt::Display for Conditions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (rate, length, bins) = self.frames;
        write!(f, "{} Hz ticks, {} Hz audio", self.tick_hz, self.audio_hz)?;
        if self.every > 1 {
            write!(f, ", every {}", self.every)?;
        }
        if self.source_hz != USUAL.source_hz {
            write!(f, ", {} Hz in", self.source_hz)?;
        }
        if self.frames != USUAL.frames {
            write!(f, ", {bins} bins of {length} at {rate} Hz")?;
        }
        if let ShapeSpec::Control(n) = self.like {
            write!(f, ", Control x{n} in")?;
        }
        Ok(())
    }
}

impl Conditions {
    /// The shape of a source for an input.
    fn shape(&self, input: &Input, ports: &Ports) -> ShapeSpec {
        let layout = |spec| match spec {
            LayoutSpec::Is(_) => spec,
            LayoutSpec::Of(_) => {
                let (rate_hz, length, bins) = self.frames;
                let wanted = FrameRate::new(500, 1).expect("500 is not 0");
                let frame_rate = FrameClock::new(self.tick_hz, self.every, wanted).rate();
                LayoutSpec::Is(FrameLayout { rate_hz, length, bins, frame_rate })
            }
        };
        let shape = if matches!(input.shape, ShapeSpec::Like(_)) { self.like } else { input.shape };
        match shape {
            ShapeSpec::Audio(RateSpec::Of(var)) => {
                // A rate that frames share is theirs.
                let shares = |layout: LayoutSpec| matches!(layout, LayoutSpec::Of(v) if v == var);
                let framed = ports.inputs.iter().any(|i| match i.shape {
                    ShapeSpec::Magnitude(layout) | ShapeSpec::Spectrum(layout) => shares(layout),
                    _ => false,
                });
                ShapeSpec::Audio(RateSpec::Hz(if framed { self.frames.0 } else { self.source_hz }))
            }
            ShapeSpec::Magnitude(l) => ShapeSpec::Magnitude(layout(l)),
            ShapeSpec::Spectrum(l) => ShapeSpec::Spectrum(layout(l)),
            shape => shape,
        }
    }
}

/// The name of the node under test.
const IT: &str = "it";
/// The seed of every graph here. Those of signals come after it.
const SEED: u64 = 5;
const SIGNALS: u64 = SEED + 100;
/// A sink for any output. No graph file can name it.
const PROBE: &str = "a probe";

/// A kind in its place, from which any number of instances can be prepared.
#[derive(Clone)]
pub(crate) struct Place {
    pub(crate) kind: Arc<NodeKind>,
    pub(crate) conditions: Conditions,
    pub(crate) node: ScheduledNode,
    /// Inputs before the first tick.
    idle: Vec<Buffer>,
}

fn text(errors: &[Diagnostic]) -> String {
    errors.first().map(|e| e.message.clone()).unwrap_or_default()
}

/// Compiles a graph of the node, with a signal at every input and a probe at the first `probes` outputs.
fn compiled(
    subject: &Subject<'_>,
    conditions: &Conditions,
    signal: Signal,
    probes: usize,
) -> Result<Compiled, String> {
    subject.alive();
    let kind = subject.its_kind().map_err(|_| "no kind was given")?;
    // The ports to which its parameters led.
    let settled = Arc::new(OnceLock::new());
    let (asked, told) = (kind.clone(), settled.clone());
    let watched = NodeKind::clone(kind).with_ports(move |config, _| {
        let ports = asked.ports(config)?;
        Ok(told.get_or_init(|| ports).clone())
    });
    let looks = Input::new("in", ShapeSpec::Like('s'), Unit::NONE).unit_of('u');
    let probe = Descriptor::new(PROBE, "Looks on.").input(looks).sink();
    let mut registry = Registry::new();
    registry.add(stateless(probe, |_| |_| Status::Continue));
    registry.add(Arc::new(watched));
    let settings: Vec<(&str, &str)> =
        subject.settings.iter().map(|(n, v)| (n.as_str(), v.as_str())).collect();
    let CaseGraph { mut graph, .. } = CaseGraph::new(conditions.tick_hz, conditions.audio_hz);
    graph.seed = SEED;
    graph.add_node(IT, &kind.descriptor().kind, &settings, "--set").map_err(|e| e.message)?;
    // The first attempt fails, for nothing is wired, but it settles the ports.
    let first = compile(&graph, &registry, Default::default());
    let Some(ports) = settled.get() else {
        return Err(first.err().map(|e| text(&e)).unwrap_or_default());
    };
    let stays_free = |i: usize| i < 64 && conditions.without >> i & 1 == 1;
    for (i, input) in ports.inputs.iter().enumerate().filter(|(i, _)| !stays_free(*i)) {
        let name = format!("a source {i}");
        let unit = match &input.unit {
            UnitSpec::Is(unit) => unit.clone(),
            UnitSpec::Of { among, .. } => among.first().cloned().unwrap_or(Unit::NEWTON),
        };
        let mut output = Output::new("out", conditions.shape(input, ports), unit);
        output.limited = input.limited;
        registry.add(Played::signal(name.clone(), output, signal, SIGNALS + i as u64));
        graph.add_node(&name, &name, &[], "test").map_err(|e| e.message)?;
        graph.add_wire(&name, &format!("{IT}.{}", input.name), "test");
    }
    for output in ports.outputs.iter().take(probes) {
        let probe = format!("probe {}", output.name);
        graph.add_node(&probe, PROBE, &[], "test").map_err(|e| e.message)?;
        graph.add_wire(&format!("{IT}.{}", output.name), &probe, "test");
    }
    graph.nodes.iter_mut().for_each(|node| node.every = conditions.every);
    compile(&graph, &registry, Default::default()).map_err(|e| text(&e))
}

impl Place {
    /// Compiles with a probe at every output, and finds the node. Some outputs exist with some settings only:
    /// where that is refused, a probe at the first output has to do.
    fn compiled(subject: &Subject<'_>, at: &Conditions, signal: Signal) -> Result<(Compiled, usize), String> {
        let compiled = compiled(subject, at, signal, usize::MAX)
            .or_else(|e| compiled(subject, at, signal, 1).map_err(|_| e))?;
        let it = compiled.schedule.index_of(IT).ok_or("the node was dropped from its graph")?;
        Ok((compiled, it))
    }

    /// Settles the types of a node's ports.
    pub(crate) fn settle(subject: &Subject<'_>, conditions: &Conditions) -> Result<Self, String> {
        let (Compiled { mut schedule, .. }, at) = Self::compiled(subject, conditions, Signal::Random)?;
        let node = schedule.nodes.swap_remove(at);
        let idle = node.inputs.iter().map(|input| match (&input.from, &input.port) {
            (Some(_), Some(port)) => Buffer::new(port, conditions.tick_hz),
            _ => match schedule.buffers.get(input.reads.buffer as usize) {
                Some(BufferEntry::Constant { count, value }) => Buffer::constant(*count, *value),
                // A host has not fed it yet.
                Some(BufferEntry::HostFed(PortType { shape: Shape::Control { count }, .. })) => {
                    Buffer::constant(*count, 0.0)
                }
                _ => Buffer::constant(0, 0.0),
            },
        });
        let (kind, idle) = (subject.its_kind().map_err(|_| "no kind was given")?.clone(), idle.collect());
        Ok(Self { kind, conditions: *conditions, node, idle })
    }

    /// A new instance with a signal at every input.
    pub(crate) fn stand<'a>(
        &'a self,
        subject: &'a Subject<'a>,
        signal: Signal,
        closes_cycle: bool,
    ) -> Result<Stand<'a>, String> {
        subject.alive();
        let Conditions { tick_hz, audio_hz, every, .. } = self.conditions;
        let config = Config {
            id: IT,
            params: &self.node.params,
            tick_hz,
            every,
            audio_hz,
            seed: random::seed_of(SEED, IT),
        };
        let inputs = self.node.inputs.iter();
        let inputs = inputs.map(|i| Wiring { port: i.port.clone(), connected: i.from.is_some() });
        let inputs: Vec<Wiring> = inputs.collect();
        let outputs = self.node.outputs.iter();
        let outputs = outputs.map(|o| Wiring { port: Some(o.port.clone()), connected: o.readers > 0 });
        let outputs: Vec<Wiring> = outputs.collect();
        let setup = Setup { config, inputs: &inputs, outputs: &outputs, closes_cycle };
        let node = self.kind.prepare(&setup).map_err(|e| e.message)?;
        let feeds = inputs.iter().zip(SIGNALS..).map(|(wire, seed)| {
            let port = wire.port.as_ref().filter(|_| wire.connected)?;
            Some(Feed::new(signal, seed, port, tick_hz, every))
        });
        let map = inputs.iter().zip(0..);
        let map = map.map(|(wire, buffer)| InputRef { buffer, connected: wire.connected });
        let mut outputs: Vec<Buffer> =
            self.node.outputs.iter().map(|o| Buffer::new(&o.port, tick_hz)).collect();
        for buffer in &mut outputs {
            if let Buffer::Audio { samples, .. } = buffer {
                *samples = vec![0.0; samples.len() + ROOM].into();
            }
        }
        let (feeds, map) = (feeds.collect(), map.collect());
        let (inputs, muted, calls) = (self.idle.clone(), false, 0);
        Ok(Stand { node, place: self, subject, feeds, map, inputs, outputs, closes_cycle, muted, calls })
    }

    /// The same graph in the engine, and the node's index in it.
    pub(crate) fn engine(&self, subject: &Subject<'_>, signal: Signal) -> Result<(Engine, usize), String> {
        let (compiled, at) = Self::compiled(subject, &self.conditions, signal)?;
        Ok((Engine::new(compiled, Default::default()), at))
    }
}

impl<'a> Subject<'a> {
    /// The place in which most cases put the one kind: the first of a few that it takes.
    pub(crate) fn main(&self) -> Result<&Place, String> {
        let find = || {
            let control = Conditions { like: ShapeSpec::Control(2), ..USUAL };
            let whole = Conditions { frames: (2500, 250, 126), ..USUAL };
            let frames = Conditions { like: ShapeSpec::Magnitude(LayoutSpec::Of('l')), ..USUAL };
            let mut others = [control, whole, frames].into_iter();
            // The error of the first place helps most.
            Place::settle(self, &USUAL)
                .or_else(|e| others.find_map(|c| Place::settle(self, &c).ok()).ok_or(e))
        };
        self.main.get_or_init(find).as_ref().map_err(Clone::clone)
    }

    /// A new instance in the main place. A case does not apply where there is none.
    pub(crate) fn stand(&'a self, signal: Signal) -> Result<Stand<'a>, Stop> {
        Ok(super::main(self)?.stand(self, signal, false)?)
    }

    /// The name of an output of the one kind.
    pub(crate) fn output_name(&self, output: usize) -> String {
        let output = self.main().ok().and_then(|place| place.node.outputs.get(output));
        output.map(|o| o.name.clone()).unwrap_or_default()
    }
}

/// Samples behind those of a tick, which a node must leave alone.
const ROOM: usize = 64;

/// An instance with its inputs and outputs.
pub(crate) struct Stand<'a> {
    pub(crate) node: Prepared,
    place: &'a Place,
    subject: &'a Subject<'a>,
    feeds: Vec<Option<Feed>>,
    map: Vec<InputRef>,
    pub(crate) inputs: Vec<Buffer>,
    pub(crate) outputs: Vec<Buffer>,
    closes_cycle: bool,
    /// Whether the inputs are silent.
    pub(crate) muted: bool,
    calls: u64,
}

/// Results of some ticks.
pub(crate) struct Run {
    pub(crate) trace: Trace,
    /// The first fault, or the first output that is not finite.
    pub(crate) wrong: Option<String>,
}

impl Stand<'_> {
    /// Plays another signal from now on.
    pub(crate) fn play(&mut self, signal: Signal) {
        self.feeds.iter_mut().flatten().for_each(|f| f.signal = signal);
    }

    /// Calls a function of the node. `what` begins the text of a fault.
    pub(crate) fn ask(&mut self, what: &str, call: impl FnOnce(&mut dyn Processor)) -> Result<(), String> {
        let processor = &mut self.node.processor;
        contained(|| processor.ask(|it| call(it))).map_err(|fault| format!("{what} {}", described(fault)))
    }

    /// Resets the node, its inputs and its controls.
    pub(crate) fn reset(&mut self) -> Result<(), String> {
        self.ask("reset", |it| it.reset())?;
        self.inputs.clone_from(&self.place.idle);
        for buffer in &mut self.outputs {
            if let Buffer::Control { values, .. } = buffer {
                values.fill(0.0);
            }
        }
        Ok(())
    }

    /// Fills the inputs for a tick and clears the outputs.
    pub(crate) fn set_up(&mut self, tick: u64) {
        self.calls += 1;
        if self.calls.is_multiple_of(32) {
            self.subject.alive();
        }
        // A node that closes a cycle runs before its inputs are there.
        if !self.closes_cycle {
            self.fill(tick);
        }
        let hz = self.place.conditions.tick_hz;
        for (buffer, output) in self.outputs.iter_mut().zip(&self.place.node.outputs) {
            match (buffer, output.port.shape) {
                (Buffer::Audio { samples, len, silent, .. }, Shape::Audio { rate_hz }) => {
                    let span = time::samples(tick, rate_hz, hz);
                    *len = (span.end - span.start) as usize;
                    *silent = true;
                    samples.fill(0.0);
                }
                (Buffer::Magnitude { frame, .. } | Buffer::Spectrum { frame, .. }, _) => *frame = None,
                _ => {}
            }
        }
    }

    fn fill(&mut self, tick: u64) {
        let hz = self.place.conditions.tick_hz;
        for (feed, buffer) in self.feeds.iter().zip(&mut self.inputs) {
            feed.iter().for_each(|f| f.fill(buffer, tick, hz, self.muted));
        }
    }

    /// Makes the calls of the engine in a tick, and nothing else, so that it can be measured.
    pub(crate) fn call(&mut self, tick: u64) -> Result<Status, Fault> {
        let _flushed = Flushed::new();
        let hz = self.place.conditions.tick_hz;
        let (inputs, outputs, map) = (&mut self.inputs, &mut self.outputs, &self.map);
        let processor = &mut self.node.processor;
        if let Some(gated) = self.place.node.gate {
            let mut view = view(tick, hz, inputs, &mut [], map);
            if !contained(|| processor.ask(|p| p.wants(&mut view)))?
                && let Some(buffer) = inputs.get_mut(gated)
            {
                hush(buffer);
            }
        }
        let mut all = view(tick, hz, inputs, outputs, map);
        let answer = contained(|| processor.run(&mut all))?;
        if self.closes_cycle {
            self.fill(tick);
            let mut view = view(tick, hz, &self.inputs, &mut [], &self.map);
            let processor = &mut self.node.processor;
            contained(|| processor.ask(|p| p.absorb(&mut view)))?;
        }
        Ok(answer)
    }

    /// Fills the inputs, calls the node, and silences the outputs that it says are silent.
    pub(crate) fn run_tick(&mut self, tick: u64) -> Result<Status, Fault> {
        self.set_up(tick);
        let answer = self.call(tick);
        self.conclude(answer);
        answer
    }

    /// Silences the outputs that the node says are silent.
    pub(crate) fn conclude(&mut self, answer: Result<Status, Fault>) {
        if matches!(answer, Ok(Status::Quiet | Status::Asleep)) {
            self.outputs.iter_mut().for_each(hush);
        }
    }

    /// The first output that is neither finite nor silent.
    pub(crate) fn not_finite(&self) -> Option<usize> {
        let well = |buffer: &Buffer| matches!(buffer, Buffer::Audio { silent: true, .. }) || finite(buffer);
        self.outputs.iter().position(|b| !well(b))
    }

    /// Runs one tick.
    pub(crate) fn tick(&mut self, tick: u64, trace: &mut Trace) -> Result<Status, String> {
        let answer = self.run_tick(tick);
        trace.push(Some(answer), &self.outputs);
        let status = answer.map_err(|fault| format!("{} at tick {tick}", described(fault)))?;
        match self.not_finite() {
            Some(output) => Err(format!("`{}` is not finite at tick {tick}", self.output_name(output))),
            None => Ok(status),
        }
    }

    /// Runs all ticks of a range in which the node is called.
    pub(crate) fn run(&mut self, ticks: std::ops::Range<u64>) -> Run {
        let mut run = Run { trace: Trace { first: ticks.start, ..Trace::default() }, wrong: None };
        for tick in ticks.filter(|t| t.is_multiple_of(u64::from(self.place.conditions.every))) {
            if let Err(wrong) = self.tick(tick, &mut run.trace) {
                run.wrong.get_or_insert(wrong);
            }
        }
        run
    }

    /// Writes the mark into every bin of the outputs.
    pub(crate) fn mark(&mut self) {
        let mark = f32::from_bits(UNWRITTEN);
        for buffer in &mut self.outputs {
            match buffer {
                Buffer::Magnitude { bins, .. } => bins.fill(mark),
                Buffer::Spectrum { bins, .. } => bins.fill(Complex::new(mark, mark)),
                Buffer::Control { .. } | Buffer::Audio { .. } => {}
            }
        }
    }

    pub(crate) fn output_name(&self, output: usize) -> &str {
        self.place.node.outputs.get(output).map_or("", |o| o.name.as_str())
    }
}

/// A node's view of a tick.
fn view<'b>(
    index: u64,
    tick_hz: u32,
    inputs: &'b [Buffer],
    outputs: &'b mut [Buffer],
    map: &'b [InputRef],
) -> Tick<'b> {
    let inputs = Inputs::new(inputs, &[], inputs.len(), map);
    Tick { index, tick_hz, inputs, outputs: Outputs::new(outputs) }
}

/// Runs a node's code and turns a panic into a fault.
fn contained<T>(f: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    catch_unwind(AssertUnwindSafe(f)).unwrap_or(Err(Fault::Panicked))
}

/// A fault in words. The loader has one code for an unknown status.
pub(crate) fn described(fault: Fault) -> String {
    match fault {
        Fault::Failed(u32::MAX) => format!("{fault} (or answered a status that does not exist)"),
        fault => fault.to_string(),
    }
}

/// Makes a buffer silent.
fn hush(buffer: &mut Buffer) {
    match buffer {
        Buffer::Control { changed, .. } => *changed = false,
        Buffer::Audio { samples, silent, .. } => {
            samples.fill(0.0);
            *silent = true;
        }
        Buffer::Magnitude { frame, .. } | Buffer::Spectrum { frame, .. } => *frame = None,
    }
}

/// Mark in the bins of an output before a call: a NaN that no node writes.
pub(crate) const UNWRITTEN: u32 = 0x7fc0_a5a5;

/// Outputs and answers call by call, as hashes, so that two runs can be compared to the bit.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trace {
    /// Number of the first call.
    first: u64,
    outputs: Vec<Vec<u64>>,
    /// Of those calls of which it is known.
    answers: Vec<u64>,
}

impl Trace {
    /// Adds a call.
    pub(crate) fn push<'b>(
        &mut self,
        answer: Option<Result<Status, Fault>>,
        outputs: impl IntoIterator<Item = &'b Buffer>,
    ) {
        self.outputs.push(outputs.into_iter().map(|buffer| hash(words(buffer))).collect());
        let answer = answer.map(|answer| match answer {
            Ok(Status::Continue) => [1, 0],
            Ok(Status::Quiet) => [2, 0],
            Ok(Status::Asleep) => [3, 0],
            Ok(Status::Tail(n)) => [4, n],
            Ok(Status::Error(n)) | Err(Fault::Failed(n)) => [5, u64::from(n)],
            Err(_) => [6, 0],
        });
        self.answers.extend(answer.map(hash));
    }

    /// One number for all of it.
    pub(crate) fn digest(&self) -> u64 {
        hash(self.outputs.iter().flatten().chain(&self.answers).copied())
    }

    /// The first difference of two runs: of the outputs, then of the answers that both know.
    pub(crate) fn first_difference(&self, other: &Self, name: impl Fn(usize) -> String) -> Option<String> {
        let first = |a: &[u64], b: &[u64]| a.iter().zip(b).position(|(a, b)| a != b);
        let mut outputs = self.outputs.iter().zip(&other.outputs).enumerate();
        let (what, at) = match outputs.find_map(|(at, (a, b))| Some((first(a, b)?, at))) {
            Some((output, at)) => (format!("`{}`", name(output)), at),
            None => ("its answer".to_owned(), first(&self.answers, &other.answers)?),
        };
        Some(format!("{what} differs first at call {}", self.first + at as u64))
    }
}
