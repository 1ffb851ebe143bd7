//! The node traits: for authors, and for the engine.

use std::ops::{Deref, Range};
use std::path::PathBuf;

use asperity_state::State;
use thiserror::Error;

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
pub struct Ports {
    /// Inputs.
    pub inputs: Vec<Input>,
    /// Outputs.
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
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq, Hash)]
pub enum Fault {
    /// The node returned [`Status::Error`] with this number.
    #[error("failed with code {0}")]
    Failed(u32),
    /// The node panicked.
    #[error("panicked")]
    Panicked,
    /// The node wrote a NaN or an infinity.
    #[error("wrote a value that is not finite")]
    NotFinite,
    /// The call took longer than its limit.
    #[error("took longer than it may")]
    Overrun,
    /// A call did not return. The node is not called again.
    #[error("did not return and is cut out")]
    Stuck,
}

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

/// A node, as its author writes it.
///
/// The life of a node:
/// 1. `descriptor` declares it; `ports` may refine that from parameters. Control thread.
/// 2. `prepare` makes it: here it allocates, reads files and may fail. Control thread.
/// 3. `process` is called once a tick, or every k-th. Tick thread: no allocation, lock, log, system call,
///    panic or drop of memory, nor in 4.
/// 4. On the tick thread too: `reset` restores the state after `prepare`; `elapsed` tells how long it slept;
///    `set_parameter` changes a live parameter; `state` hands its state to a changed graph.
/// 5. It is dropped on the control thread.
// A new method must be added to `Precise` in nodes/src/precision.rs too, which passes each on: one with a
// body would be dropped there without a word.
pub trait Node: Send + Sized + 'static {
    /// Kind, ports and parameters.
    fn descriptor() -> Descriptor;

    /// Ports for these parameters; those of the descriptor by default.
    ///
    /// # Errors
    /// Parameters that fit no ports.
    fn ports(_config: &Config<'_>, ports: Ports) -> Result<Ports, Diagnostic> {
        Ok(ports)
    }

    /// Makes a node for its place in a graph.
    ///
    /// # Errors
    /// Problems that a parameter's range cannot express: a wrong file, values that contradict each
    /// other.
    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic>;

    /// Runs one tick.
    fn process(&mut self, tick: &mut Tick<'_>) -> Status;

    /// Restores the state after `prepare`, with the current parameters.
    fn reset(&mut self);

    /// Gates only: whether the gated input is wanted this tick. Called once a tick, before `process`,
    /// when all inputs but the gated one are ready.
    fn wants(&mut self, _tick: &mut Tick<'_>) -> bool {
        true
    }

    /// Nodes that close a cycle only: takes this tick's inputs, after `process` has run without them.
    fn absorb(&mut self, _tick: &mut Tick<'_>) {}

    /// Tells a node of [`Resume::Elapsed`](crate::Resume) how many ticks it slept. Its state must
    /// become that of as many calls.
    fn elapsed(&mut self, _ticks: u64) {}

    /// Sets a [live](crate::Param::live) parameter, by its index in the descriptor, to a value in its
    /// range. A flag is 0 or 1, a choice the index of its word.
    fn set_parameter(&mut self, _index: usize, _value: f64) {}

    /// Saves or restores its state from tick to tick, without parameters and their consequences: see
    /// [`State`]. Another instance, prepared for the same place but perhaps with other parameters,
    /// continues from it. A node without state, or one that starts anew, leaves it out.
    fn state(&mut self, _state: &mut State<'_>) {}

    /// Latency from inputs to outputs, exact and signed.
    fn latency(&self) -> Latency {
        Latency::ZERO
    }

    /// Duration of the outputs after the inputs become silent.
    fn tail(&self) -> Latency {
        Latency::ZERO
    }

    /// Sources only: duration of the output.
    fn duration(&self) -> Option<Latency> {
        None
    }

    /// Whether `process` does not allocate. A node that allocates must return false.
    fn allocation_free(&self) -> bool {
        true
    }

    /// Facts about this node, for reports. Control thread.
    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }

    /// Files that it reads and that no parameter of kind [`File`](crate::ParamKind::File) names, so
    /// that a host can watch them. Control thread.
    fn files(&self) -> Vec<PathBuf> {
        Vec::new()
    }

    /// Limiters only: a guard that keeps the device's channel within the same limits, starting at rest
    /// and cold. Control thread.
    fn guard(&self) -> Option<Box<dyn Guard>> {
        None
    }

    /// Limiters only: least heat of the coil, as a mean of squares \[A^2\]. Tick thread.
    fn warm(&mut self, _heat: f64) {}
}

/// A node as the engine calls it: [`Node`] without the parts that need no instance. Methods that run the
/// node's code return a [`Fault`] if it failed. Every [`Node`] is a `Processor`; a kind that makes its nodes
/// in another way implements this.
pub trait Processor: Send {
    /// See [`Node::process`]. Tick thread.
    fn process(&mut self, tick: &mut Tick<'_>) -> Result<Status, Fault>;

    /// See [`Node::reset`]. Tick thread.
    fn reset(&mut self) -> Result<(), Fault>;

    /// See [`Node::wants`]. Tick thread.
    fn wants(&mut self, _tick: &mut Tick<'_>) -> Result<bool, Fault> {
        Ok(true)
    }

    /// See [`Node::absorb`]. Tick thread.
    fn absorb(&mut self, _tick: &mut Tick<'_>) -> Result<(), Fault> {
        Ok(())
    }

    /// See [`Node::elapsed`]. Tick thread.
    fn elapsed(&mut self, _ticks: u64) -> Result<(), Fault> {
        Ok(())
    }

    /// See [`Node::set_parameter`]. Tick thread.
    fn set_parameter(&mut self, _index: usize, _value: f64) -> Result<(), Fault> {
        Ok(())
    }

    /// Most bytes that [`save`](Self::save) writes. Control thread.
    fn state_size(&mut self) -> usize {
        0
    }

    /// Writes the state to the front of `bytes` and returns its length; see [`Node::state`]. Tick
    /// thread.
    fn save(&mut self, _bytes: &mut [u8]) -> Option<usize> {
        Some(0)
    }

    /// Continues from the state of another instance. Returns false on failure; then the caller resets
    /// it. Tick thread.
    fn restore(&mut self, bytes: &[u8]) -> bool {
        bytes.is_empty()
    }

    /// See [`Node::latency`]. Control thread.
    fn latency(&self) -> Latency {
        Latency::ZERO
    }

    /// See [`Node::tail`]. Control thread.
    fn tail(&self) -> Latency {
        Latency::ZERO
    }

    /// See [`Node::duration`]. Control thread.
    fn duration(&self) -> Option<Latency> {
        None
    }

    /// See [`Node::allocation_free`]. Control thread.
    fn allocation_free(&self) -> bool {
        true
    }

    /// See [`Node::facts`]. Control thread.
    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }

    /// See [`Node::files`]. Control thread.
    fn files(&self) -> Vec<PathBuf> {
        Vec::new()
    }

    /// See [`Node::guard`]. Control thread.
    fn guard(&self) -> Option<Box<dyn Guard>> {
        None
    }

    /// See [`Node::warm`]. Tick thread.
    fn warm(&mut self, _heat: f64) {}
}

impl<N: Node> Processor for N {
    fn process(&mut self, tick: &mut Tick<'_>) -> Result<Status, Fault> {
        match Node::process(self, tick) {
            Status::Error(code) => Err(Fault::Failed(code)),
            status => Ok(status),
        }
    }
    fn reset(&mut self) -> Result<(), Fault> {
        Node::reset(self);
        Ok(())
    }
    fn wants(&mut self, tick: &mut Tick<'_>) -> Result<bool, Fault> {
        Ok(Node::wants(self, tick))
    }
    fn absorb(&mut self, tick: &mut Tick<'_>) -> Result<(), Fault> {
        Node::absorb(self, tick);
        Ok(())
    }
    fn elapsed(&mut self, ticks: u64) -> Result<(), Fault> {
        Node::elapsed(self, ticks);
        Ok(())
    }
    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), Fault> {
        Node::set_parameter(self, index, value);
        Ok(())
    }
    fn state_size(&mut self) -> usize {
        State::measure(|s| Node::state(self, s))
    }
    fn save(&mut self, bytes: &mut [u8]) -> Option<usize> {
        State::save(bytes, |s| Node::state(self, s))
    }
    fn restore(&mut self, bytes: &[u8]) -> bool {
        State::restore(bytes, |s| Node::state(self, s))
    }
    fn latency(&self) -> Latency {
        Node::latency(self)
    }
    fn tail(&self) -> Latency {
        Node::tail(self)
    }
    fn duration(&self) -> Option<Latency> {
        Node::duration(self)
    }
    fn allocation_free(&self) -> bool {
        Node::allocation_free(self)
    }
    fn facts(&self) -> Vec<Fact> {
        Node::facts(self)
    }
    fn files(&self) -> Vec<PathBuf> {
        Node::files(self)
    }
    fn guard(&self) -> Option<Box<dyn Guard>> {
        Node::guard(self)
    }
    fn warm(&mut self, heat: f64) {
        Node::warm(self, heat);
    }
}

/// A kind of node, built in or from a plugin.
pub trait NodeKind: Send + Sync {
    /// Kind, ports and parameters.
    fn descriptor(&self) -> &Descriptor;

    /// Origin for a person: `built in`, or a plugin's file.
    fn origin(&self) -> &str {
        "built in"
    }

    /// Number of the build of a kind's code, so that a recompiled graph uses the newer one. 0 for a
    /// built-in kind.
    fn build(&self) -> u64 {
        0
    }

    /// Ports for these parameters.
    ///
    /// # Errors
    /// Parameters that fit no ports.
    fn ports(&self, config: &Config<'_>) -> Result<Ports, Diagnostic>;

    /// Makes a node.
    ///
    /// # Errors
    /// See [`Node::prepare`].
    fn prepare(&self, setup: &Setup<'_>) -> Result<Box<dyn Processor>, Diagnostic>;
}
