//! One instance that a case calls itself: as the engine does, but without containing anything.

use std::panic::{AssertUnwindSafe, catch_unwind};

use asperity_engine::Flushed;
use asperity_node::{
    Buffer, Complex, Fault, InputRef, Inputs, Outputs, Prepared, Processor, Shape, Status, Tick, time,
};

use crate::buffers::{finite, hash};
use crate::node::place::Place;
use crate::node::signal::{Feed, Signal};
use crate::subject::Subject;

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

impl<'a> Stand<'a> {
    pub(crate) fn new(
        place: &'a Place,
        subject: &'a Subject<'a>,
        node: Prepared,
        signal: Signal,
        seed: u64,
        closes_cycle: bool,
    ) -> Self {
        let tick_hz = place.conditions.tick_hz;
        let mut feeds = Vec::new();
        let mut inputs = Vec::new();
        for (i, (wire, (count, value))) in place.inputs.iter().zip(&place.constants).enumerate() {
            let port = wire.port.as_ref().filter(|_| wire.connected);
            let seed = seed + i as u64;
            feeds.push(port.map(|p| Feed::new(signal, seed, p, tick_hz, place.conditions.every)));
            inputs.push(port.map_or_else(|| Buffer::constant(*count, *value), |p| Buffer::new(p, tick_hz)));
        }
        let connected = place.inputs.iter().map(|w| w.connected);
        let map = connected.enumerate().map(|(i, connected)| InputRef { buffer: i as u32, connected });
        let ports = place.outputs.iter().filter_map(|w| w.port.as_ref());
        let mut outputs: Vec<Buffer> = ports.map(|p| Buffer::new(p, tick_hz)).collect();
        for buffer in &mut outputs {
            if let Buffer::Audio { samples, .. } = buffer {
                *samples = vec![0.0; samples.len() + ROOM].into();
            }
        }
        let map = map.collect();
        Self { node, place, subject, feeds, map, inputs, outputs, closes_cycle, muted: false, calls: 0 }
    }

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
        let hz = self.place.conditions.tick_hz;
        for (buffer, wire) in self.inputs.iter_mut().zip(&self.place.inputs).filter(|(_, w)| w.connected) {
            wire.port.iter().for_each(|p| *buffer = Buffer::new(p, hz));
        }
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
        for (buffer, wire) in self.outputs.iter_mut().zip(&self.place.outputs) {
            match (buffer, wire.port.as_ref().map(|p| p.shape)) {
                (Buffer::Audio { samples, len, silent, .. }, Some(Shape::Audio { rate_hz })) => {
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
        if let Some(gated) = self.place.gate {
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

    /// Silences the outputs that the node says are silent.
    pub(crate) fn conclude(&mut self, answer: Result<Status, Fault>) {
        if matches!(answer, Ok(Status::Quiet | Status::Asleep)) {
            self.outputs.iter_mut().for_each(hush);
        }
    }

    /// The first output that is not finite.
    pub(crate) fn not_finite(&self) -> Option<usize> {
        self.outputs.iter().position(|b| !is_well(b))
    }

    /// Runs one tick.
    pub(crate) fn tick(&mut self, tick: u64, trace: &mut Trace) -> Result<Status, String> {
        self.set_up(tick);
        let answer = self.call(tick);
        self.conclude(answer);
        trace.push(answer, &self.outputs);
        let status = answer.map_err(|fault| format!("{} at tick {tick}", described(fault)))?;
        match self.not_finite() {
            Some(output) => Err(format!("`{}` is not finite at tick {tick}", self.output_name(output))),
            None => Ok(status),
        }
    }

    /// Runs all ticks of a range in which the node is called.
    pub(crate) fn run(&mut self, ticks: std::ops::Range<u64>) -> Run {
        let mut run = Run { trace: Trace::new(self.outputs.len(), ticks.start), wrong: None };
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
        self.place.output_names.get(output).map_or("", String::as_str)
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
pub(crate) fn contained<T>(f: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
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

/// Whether a buffer is finite or silent.
pub(crate) fn is_well(buffer: &Buffer) -> bool {
    matches!(buffer, Buffer::Audio { silent: true, .. }) || finite(buffer)
}

/// Outputs and answers call by call, as hashes, so that two runs can be compared to the bit.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trace {
    /// Number of the first call.
    first: u64,
    /// Number of outputs.
    width: usize,
    outputs: Vec<u64>,
    answers: Vec<u64>,
}

impl Trace {
    pub(crate) fn new(width: usize, first: u64) -> Self {
        Self { first, width, ..Self::default() }
    }

    pub(crate) fn push(&mut self, answer: Result<Status, Fault>, outputs: &[Buffer]) {
        self.push_outputs(outputs.iter());
        let [which, number] = match answer {
            Ok(Status::Continue) => [1, 0],
            Ok(Status::Quiet) => [2, 0],
            Ok(Status::Asleep) => [3, 0],
            Ok(Status::Tail(n)) => [4, n],
            Ok(Status::Error(n)) | Err(Fault::Failed(n)) => [5, u64::from(n)],
            Err(_) => [6, 0],
        };
        self.answers.push(hash([which, number]));
    }

    /// Adds outputs alone, where the answer is unknown.
    pub(crate) fn push_outputs<'b>(&mut self, outputs: impl Iterator<Item = &'b Buffer>) {
        self.outputs.extend(outputs.map(|buffer| hash(crate::buffers::words(buffer))));
    }

    /// One number for all of it.
    pub(crate) fn digest(&self) -> u64 {
        hash(self.outputs.iter().chain(&self.answers).copied())
    }

    /// The first difference of two runs: of the outputs, then of the answers that both know.
    pub(crate) fn first_difference(&self, other: &Self, name: impl Fn(usize) -> String) -> Option<String> {
        let first = |a: &[u64], b: &[u64]| a.iter().zip(b).position(|(a, b)| a != b);
        let (what, at) = match first(&self.outputs, &other.outputs) {
            Some(at) => (format!("`{}`", name(at % self.width)), at / self.width),
            None => ("its answer".to_owned(), first(&self.answers, &other.answers)?),
        };
        Some(format!("{what} differs first at call {}", self.first + at as u64))
    }
}
