//! The node traits: for authors, and for the engine.

use std::fmt;
use std::ops::{Deref, Range};
use std::path::PathBuf;
use std::sync::Arc;

use asperity_state::State;

use crate::{
    Descriptor, Diagnostic, Fact, FrameClock, FrameRate, Guard, Input, Inputs, Latency, Output, Outputs,
    Params, PortType, time,
};

/// Configuration of a node before its port types are known.
#[derive(Clone, Copy, Debug)]
pub struct Config<'a> {
    /// The node's id in the graph.
    pub id: &'a str,
    /// Parameters, checked against the descriptor.
    pub params: &'a Params,
    /// Ticks a second of the graph.
    pub tick_hz: u32,
    /// The node runs every `every`-th tick.
    pub every: u32,
    /// The graph's audio rate in Hz.
    pub audio_hz: u32,
    /// Seed of this node.
    pub seed: u64,
}

impl Config<'_> {
    /// Makes a clock for `wanted` frames a second, or as many as the node's runs if that is less.
    pub fn frame_clock(&self, wanted: FrameRate) -> FrameClock {
        FrameClock::new(self.tick_hz, self.every, wanted)
    }

    /// The path in a text parameter, relative to the file that sets it.
    pub fn resolve(&self, param: &str) -> PathBuf {
        let base = self.params.place(param).or(self.params.node_place());
        let dir = base.and_then(|p| p.source.path().parent()).map(PathBuf::from).unwrap_or_default();
        dir.join(self.params.text(param))
    }
}

/// Connection of one port.
#[derive(Clone, Debug)]
pub struct Wiring {
    /// Type of the port; `None` for an unconnected port whose type nothing determines.
    pub port: Option<PortType>,
    /// Whether a wire ends (or begins) there.
    pub connected: bool,
}

/// Configuration of a node for `prepare`.
#[derive(Clone, Copy, Debug)]
pub struct Setup<'a> {
    /// Configuration from before the port types were known.
    pub config: Config<'a>,
    /// Inputs in the descriptor's order.
    pub inputs: &'a [Wiring],
    /// Outputs in the descriptor's order.
    pub outputs: &'a [Wiring],
    /// Whether this node closes a cycle: then `process` runs before its inputs are ready, and `absorb`
    /// after.
    pub closes_cycle: bool,
}

impl<'a> Deref for Setup<'a> {
    type Target = Config<'a>;

    fn deref(&self) -> &Config<'a> {
        &self.config
    }
}

impl<'a> Setup<'a> {
    /// Type of an input.
    pub fn input(&self, index: usize) -> Option<&'a PortType> {
        self.inputs.get(index)?.port.as_ref()
    }

    /// Type of an output.
    pub fn output(&self, index: usize) -> Option<&'a PortType> {
        self.outputs.get(index)?.port.as_ref()
    }

    /// Audio rate, or sample rate of the frames, of an input in Hz; the graph's audio rate if it has
    /// none.
    pub fn input_rate(&self, index: usize) -> u32 {
        rate_of(self.input(index)).unwrap_or(self.audio_hz)
    }

    /// The same of an output.
    pub fn output_rate(&self, index: usize) -> u32 {
        rate_of(self.output(index)).unwrap_or(self.audio_hz)
    }
}

fn rate_of(port: Option<&PortType>) -> Option<u32> {
    match port?.shape {
        crate::Shape::Audio { rate_hz } => Some(rate_hz),
        crate::Shape::Magnitude(l) | crate::Shape::Spectrum(l) => Some(l.rate_hz),
        crate::Shape::Control { .. } => None,
    }
}

/// Ports of one node, for its parameters.
#[derive(Clone, Debug)]
#[allow(missing_docs)]
pub struct Ports {
    pub inputs: Vec<Input>,
    pub outputs: Vec<Output>,
}

/// One call of a node.
#[derive(Debug)]
pub struct Tick<'a> {
    /// The tick's number, from 0.
    pub index: u64,
    /// Ticks a second.
    pub tick_hz: u32,
    /// Input buffers.
    pub inputs: Inputs<'a>,
    /// Output buffers. At the start audio is zero, frames are absent, and controls hold their values.
    pub outputs: Outputs<'a>,
}

impl Tick<'_> {
    /// Samples of this tick at a rate, as absolute sample numbers.
    pub fn samples(&self, rate_hz: u32) -> Range<u64> {
        time::samples(self.index, rate_hz, self.tick_hz)
    }

    /// Time of the tick in seconds, for a time axis only. Never sum it up.
    pub fn seconds(&self) -> f64 {
        self.index as f64 / f64::from(self.tick_hz)
    }
}

/// Failure of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Fault {
    /// The node returned [`Status::Error`] with this number.
    Failed(u32),
    /// The node panicked.
    Panicked,
    /// The node wrote a NaN or an infinity.
    NotFinite,
    /// The call took longer than its limit.
    Overrun,
    /// A call did not return. The node is not called again.
    Stuck,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Failed(code) => write!(f, "failed with code {code}"),
            Self::Panicked => f.write_str("panicked"),
            Self::NotFinite => f.write_str("wrote a value that is not finite"),
            Self::Overrun => f.write_str("took longer than it may"),
            Self::Stuck => f.write_str("did not return and is cut out"),
        }
    }
}

impl std::error::Error for Fault {}

/// A node's answer to a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The node has more output.
    Continue,
    /// The outputs of this tick are silent; call again.
    Quiet,
    /// So many more ticks until silence, unless an input wakes the node. It is called that often, then
    /// treated as `Asleep`.
    Tail(u64),
    /// No output until an input that wakes carries something; see [`Input::wakes`].
    Asleep,
    /// Failure, with a number of the node's own. The engine fades or holds the node's outputs.
    Error(u32),
}

/// A kind of node, as its author declares it.
///
/// The life of a node:
/// 1. [`descriptor`](Self::descriptor) declares the kind; [`ports`](Self::ports) may refine that from
///    parameters. Control thread.
/// 2. [`prepare`](Self::prepare) makes a [`Processor`]: it allocates, reads files and may fail. Control
///    thread.
/// 3. [`Processor::process`] is called once a tick, or every k-th. Tick thread: no allocation, lock, log,
///    system call, panic or drop of memory, nor in 4.
/// 4. On the tick thread too: `reset` restores the state after `prepare`; `elapsed` tells how long it slept;
///    `set_parameter` changes a live parameter; `state` hands its state to a changed graph.
/// 5. The processor is dropped on the control thread.
pub trait Node: 'static {
    /// Kind, ports and parameters.
    fn descriptor() -> Descriptor;

    /// Ports for these parameters; those of the descriptor by default.
    ///
    /// # Errors
    /// Parameters that fit no ports.
    fn ports(_config: &Config<'_>, ports: Ports) -> Result<Ports, Diagnostic> {
        Ok(ports)
    }

    /// Makes a processor for a place in a graph.
    ///
    /// # Errors
    /// Problems that a parameter's range cannot express: a wrong file, values that contradict each
    /// other.
    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic>;
}

/// Makes guards for a device's channel; see [`Prepared::guard`].
type MakeGuard = Box<dyn Fn() -> Box<dyn Guard> + Send + Sync>;

/// A processor, with facts that stay as they are while it lives.
#[must_use]
pub struct Prepared {
    /// The processor.
    pub processor: Box<dyn Processor>,
    /// Latency from inputs to outputs, exact and signed.
    pub latency: Latency,
    /// Duration of the outputs after the inputs become silent.
    pub tail: Latency,
    /// Sources only: duration of the output.
    pub duration: Option<Latency>,
    /// Whether `process` does not allocate. A node that allocates must say so.
    pub allocation_free: bool,
    /// Files that it reads and that no parameter of kind [`File`](crate::ParamKind::File) names, so that a
    /// host can watch them.
    pub files: Vec<PathBuf>,
    /// Limiters only: makes a guard that keeps the device's channel within the same limits, starting at
    /// rest and cold.
    pub guard: Option<MakeGuard>,
}

impl Prepared {
    /// A processor without latency, tail, duration, files or guard, which does not allocate.
    pub fn new(processor: impl Processor + 'static) -> Self {
        Self {
            processor: Box::new(processor),
            latency: Latency::ZERO,
            tail: Latency::ZERO,
            duration: None,
            allocation_free: true,
            files: Vec::new(),
            guard: None,
        }
    }

    /// Sets the [latency](Self::latency).
    pub fn latency(self, latency: Latency) -> Self {
        Self { latency, ..self }
    }

    /// Sets the [tail](Self::tail).
    pub fn tail(self, tail: Latency) -> Self {
        Self { tail, ..self }
    }

    /// Sets the [duration](Self::duration).
    pub fn duration(self, duration: Option<Latency>) -> Self {
        Self { duration, ..self }
    }

    /// Sets the [files](Self::files).
    pub fn files(self, files: Vec<PathBuf>) -> Self {
        Self { files, ..self }
    }

    /// Sets the [guard](Self::guard).
    pub fn guard(self, make: impl Fn() -> Box<dyn Guard> + Send + Sync + 'static) -> Self {
        Self { guard: Some(Box::new(make)), ..self }
    }
}

impl fmt::Debug for Prepared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut f = f.debug_struct("Prepared");
        f.field("latency", &self.latency).field("tail", &self.tail).finish_non_exhaustive()
    }
}

/// A node that runs; [`Node::prepare`] makes it.
///
/// A wrapper implements `process` and [`inner`](Self::inner): every other call reaches the node inside by its
/// default.
pub trait Processor: Send {
    /// Runs one tick. Tick thread.
    fn process(&mut self, tick: &mut Tick<'_>) -> Status;

    /// Restores the state after `prepare`, with the current parameters. A node without state leaves it out.
    /// Tick thread.
    fn reset(&mut self) {
        self.inner(&mut |node| node.reset());
    }

    /// Gates only: whether the gated input is wanted this tick. Called once a tick, before `process`,
    /// when all inputs but the gated one are ready. Tick thread.
    fn wants(&mut self, tick: &mut Tick<'_>) -> bool {
        let mut wants = true;
        self.inner(&mut |node| wants = node.wants(tick));
        wants
    }

    /// Nodes that close a cycle only: takes this tick's inputs, after `process` has run without them. Tick
    /// thread.
    fn absorb(&mut self, tick: &mut Tick<'_>) {
        self.inner(&mut |node| node.absorb(tick));
    }

    /// Tells a node of [`Resume::Elapsed`](crate::Resume) how many ticks it slept. Its state must
    /// become that of as many calls. Tick thread.
    fn elapsed(&mut self, ticks: u64) {
        self.inner(&mut |node| node.elapsed(ticks));
    }

    /// Sets a [live](crate::Param::live) parameter, by its index in the descriptor, to a value in its
    /// range. A flag is 0 or 1, a choice the index of its word. Tick thread.
    fn set_parameter(&mut self, index: usize, value: f64) {
        self.inner(&mut |node| node.set_parameter(index, value));
    }

    /// Measures, saves or restores its state from tick to tick, without parameters and their consequences:
    /// see [`State`]. Another instance, prepared for the same place but perhaps with other parameters,
    /// continues from it. A node without state, or one that starts anew, leaves it out. Tick thread.
    fn state(&mut self, state: &mut State<'_>) {
        self.inner(&mut |node| node.state(state));
    }

    /// Facts about this node now, for reports. Control thread.
    fn facts(&mut self) -> Vec<Fact> {
        let mut facts = Vec::new();
        self.inner(&mut |node| facts = node.facts());
        facts
    }

    /// Limiters only: least heat of the coil, as a mean of squares \[A^2\]. Tick thread.
    fn warm(&mut self, heat: f64) {
        self.inner(&mut |node| node.warm(heat));
    }

    /// Limiters only: the part of its input that the limits are applied to, 0 to 1. It is reached at the end
    /// of the next call. Tick thread.
    fn attenuate(&mut self, strength: f32) {
        self.inner(&mut |node| node.attenuate(strength));
    }

    /// Nodes that run elsewhere only, in a plugin or on a thread of their own: takes the fault of the last
    /// call. `ask` reads it. Tick thread.
    fn fault(&mut self) -> Option<Fault> {
        let mut fault = None;
        self.inner(&mut |node| fault = node.fault());
        fault
    }

    /// Wrappers only: runs `call` with the node inside.
    fn inner(&mut self, _call: &mut dyn FnMut(&mut dyn Processor)) {}
}

impl<'p> dyn Processor + 'p {
    /// Makes a call, and answers its fault if it has one.
    ///
    /// # Errors
    /// The call failed where the node runs.
    pub fn ask<T>(&mut self, call: impl FnOnce(&mut (dyn Processor + 'p)) -> T) -> Result<T, Fault> {
        let answer = call(self);
        self.fault().map_or(Ok(answer), Err)
    }

    /// Runs one tick, and answers a failure as a fault. Tick thread.
    ///
    /// # Errors
    /// The node failed, itself or where it runs.
    pub fn run(&mut self, tick: &mut Tick<'_>) -> Result<Status, Fault> {
        match self.ask(|node| node.process(tick))? {
            Status::Error(code) => Err(Fault::Failed(code)),
            status => Ok(status),
        }
    }

    /// Most bytes that [`save`](Self::save) writes. Control thread.
    pub fn state_size(&mut self) -> usize {
        State::measure(|s| self.state(s))
    }

    /// Writes the state to the front of `bytes` and returns its length. Tick thread.
    pub fn save(&mut self, bytes: &mut [u8]) -> Option<usize> {
        State::save(bytes, |s| self.state(s))
    }

    /// Continues from the state of another instance. Returns false on failure, and begins anew. Tick thread.
    pub fn restore(&mut self, bytes: &[u8]) -> bool {
        let restored = State::restore(bytes, |s| self.state(s));
        if !restored {
            self.reset();
        }
        restored
    }
}

type RefinePorts = dyn Fn(&Config<'_>, Ports) -> Result<Ports, Diagnostic> + Send + Sync;
type Prepare = dyn Fn(&Setup<'_>) -> Result<Prepared, Diagnostic> + Send + Sync;

/// A kind of node, built in or from a plugin. Whoever wraps a kind changes a copy of it, so that the rest
/// stays as it is.
#[must_use]
#[derive(Clone)]
pub struct NodeKind {
    descriptor: Descriptor,
    origin: Arc<str>,
    build: u64,
    ports: Arc<RefinePorts>,
    prepare: Arc<Prepare>,
}

impl NodeKind {
    /// The kind of a node type of this program.
    pub fn of<N: Node>() -> Self {
        Self::new(N::descriptor(), N::prepare).with_ports(N::ports)
    }

    /// A built-in kind with the ports of its descriptor.
    pub fn new(
        descriptor: Descriptor,
        prepare: impl Fn(&Setup<'_>) -> Result<Prepared, Diagnostic> + Send + Sync + 'static,
    ) -> Self {
        let ports: Arc<RefinePorts> = Arc::new(|_, ports| Ok(ports));
        Self { descriptor, origin: "built in".into(), build: 0, ports, prepare: Arc::new(prepare) }
    }

    /// The same kind, whose ports are the answer of `ports` to those of the descriptor.
    pub fn with_ports(
        self,
        ports: impl Fn(&Config<'_>, Ports) -> Result<Ports, Diagnostic> + Send + Sync + 'static,
    ) -> Self {
        Self { ports: Arc::new(ports), ..self }
    }

    /// The same kind from a plugin's file, with the number of its [build](Self::build).
    pub fn from_plugin(self, origin: Arc<str>, build: u64) -> Self {
        Self { origin, build, ..self }
    }

    /// The same kind, of whose nodes `wrap` makes others.
    pub fn wrapped(
        self,
        wrap: impl Fn(&Setup<'_>, Prepared) -> Result<Prepared, Diagnostic> + Send + Sync + 'static,
    ) -> Self {
        let prepare = self.prepare;
        Self { prepare: Arc::new(move |setup| wrap(setup, prepare(setup)?)), ..self }
    }

    /// Kind, ports and parameters.
    pub fn descriptor(&self) -> &Descriptor {
        &self.descriptor
    }

    /// Origin for a person: `built in`, or a plugin's file.
    pub fn origin(&self) -> &str {
        &self.origin
    }

    /// Number of the build of a kind's code, so that a recompiled graph uses the newer one. 0 for a
    /// built-in kind.
    pub fn build(&self) -> u64 {
        self.build
    }

    /// Ports for these parameters.
    ///
    /// # Errors
    /// Parameters that fit no ports.
    pub fn ports(&self, config: &Config<'_>) -> Result<Ports, Diagnostic> {
        let Descriptor { inputs, outputs, .. } = &self.descriptor;
        (self.ports)(config, Ports { inputs: inputs.clone(), outputs: outputs.clone() })
    }

    /// Makes a processor.
    ///
    /// # Errors
    /// See [`Node::prepare`].
    pub fn prepare(&self, setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        (self.prepare)(setup)
    }
}
