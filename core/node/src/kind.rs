//! The node itself: what an author writes, and what the engine calls.

use std::fmt;
use std::ops::{Deref, Range};
use std::path::PathBuf;

use asperity_state::State;

use crate::{
    Descriptor, Diagnostic, Fact, FrameClock, FrameRate, Guard, Input, Inputs, Latency, Output, Outputs,
    Params, PortType, time,
};

/// What is known of a node before its ports are settled.
#[derive(Clone, Copy, Debug)]
pub struct Config<'a> {
    /// The node's id in the graph.
    pub id: &'a str,
    /// Its parameters, checked against the descriptor.
    pub params: &'a Params,
    /// Ticks a second of the graph.
    pub tick_hz: u32,
    /// The node runs every `every`-th tick.
    pub every: u32,
    /// The graph's audio rate in Hz.
    pub audio_hz: u32,
    /// A seed of the node's own.
    pub seed: u64,
}

impl Config<'_> {
    /// A clock for frames at `wanted` a second, or as often as the node runs where that is less.
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

/// How one port of a node is connected.
#[derive(Clone, Debug)]
pub struct Wiring {
    /// The settled type; `None` for an unconnected port whose type nothing settles.
    pub port: Option<PortType>,
    /// Whether a wire ends (or begins) there.
    pub connected: bool,
}

/// Everything a node may want to know when it is prepared.
#[derive(Clone, Copy, Debug)]
pub struct Setup<'a> {
    /// What was known before.
    pub config: Config<'a>,
    /// Its inputs in the descriptor's order.
    pub inputs: &'a [Wiring],
    /// Its outputs in the descriptor's order.
    pub outputs: &'a [Wiring],
    /// Whether this node closes a cycle: `process` then runs before its inputs are there, and `absorb` when
    /// they are.
    pub closes_cycle: bool,
}

impl<'a> Deref for Setup<'a> {
    type Target = Config<'a>;

    fn deref(&self) -> &Config<'a> {
        &self.config
    }
}

impl<'a> Setup<'a> {
    /// The settled type of an input.
    pub fn input(&self, index: usize) -> Option<&'a PortType> {
        self.inputs.get(index)?.port.as_ref()
    }

    /// The settled type of an output.
    pub fn output(&self, index: usize) -> Option<&'a PortType> {
        self.outputs.get(index)?.port.as_ref()
    }

    /// The audio rate or frame rate base of an input in Hz; the graph's audio rate where it has none.
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

/// The ports of one node, after its parameters have had their say.
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
    /// What comes in.
    pub inputs: Inputs<'a>,
    /// What goes out. Audio arrives zeroed, frames absent, controls as they were.
    pub outputs: Outputs<'a>,
}

impl Tick<'_> {
    /// This tick's samples at a rate, as absolute sample numbers.
    pub fn samples(&self, rate_hz: u32) -> Range<u64> {
        time::samples(self.index, rate_hz, self.tick_hz)
    }

    /// The tick's time in seconds. For readers of a time axis; never to be added up.
    pub fn seconds(&self) -> f64 {
        self.index as f64 / f64::from(self.tick_hz)
    }
}

/// What went wrong in a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Fault {
    /// The node said so; the number is its own.
    Failed(u32),
    /// The node panicked.
    Panicked,
    /// The node wrote a NaN or an infinity.
    NotFinite,
    /// The node took longer than a call may.
    Overrun,
    /// A call did not return, and the node is called no more.
    Stuck,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Fault::Failed(code) => write!(f, "failed with code {code}"),
            Fault::Panicked => f.write_str("panicked"),
            Fault::NotFinite => f.write_str("wrote a value that is not finite"),
            Fault::Overrun => f.write_str("took longer than it may"),
            Fault::Stuck => f.write_str("did not return and is cut out"),
        }
    }
}

/// What a node answers to a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// More to come.
    Continue,
    /// The outputs of this tick are silent; call again.
    Quiet,
    /// So many more ticks until silence, unless an input wakes the node: call that often, then as `Asleep`.
    Tail(u64),
    /// Nothing to come until an input that wakes carries something; see [`Input::wakes`].
    Asleep,
    /// It went wrong, with a number of the node's own; the engine fades or holds what the node put out.
    Error(u32),
}

/// A node, as its author writes it.
///
/// The life of a node:
/// 1. `descriptor` says what it is; `ports` may refine that from parameters. Control thread.
/// 2. `prepare` makes it, and is where it allocates, reads files and fails. Control thread.
/// 3. `process` is called once a tick, or every k-th. Tick thread: no allocation, lock, log, system call,
///    panic or drop of memory in there, nor in 4.
/// 4. `reset` puts it back to the state after `prepare`; `elapsed` tells it what it slept through; `set_parameter` changes
///    a parameter that is live; `state` hands over what it remembers when the graph is changed under it. Tick thread.
/// 5. It is dropped on the control thread.
// Whoever adds a method adds it to `Precise` in nodes/src/precision.rs, which passes each on: one with a
// body would be dropped there without a word.
pub trait Node: Send + Sized + 'static {
    /// Kind, ports and parameters.
    fn descriptor() -> Descriptor;

    /// The ports for these parameters; those of the descriptor unless a node says otherwise.
    ///
    /// # Errors
    /// Parameters that fit no ports.
    fn ports(_config: &Config<'_>, ports: Ports) -> Result<Ports, Diagnostic> {
        Ok(ports)
    }

    /// Makes a node for its place in a graph.
    ///
    /// # Errors
    /// What a parameter's range could not say: a file of another shape, values that do not go together.
    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic>;

    /// One tick.
    fn process(&mut self, tick: &mut Tick<'_>) -> Status;

    /// Back to the state after `prepare`, with the parameters as they are now.
    fn reset(&mut self);

    /// Gates only: whether the gated input is wanted this tick. Called once a tick, before `process`, with
    /// every input there but the gated one.
    fn wants(&mut self, _tick: &mut Tick<'_>) -> bool {
        true
    }

    /// Nodes that close a cycle only: takes this tick's inputs, after `process` has put out without them.
    fn absorb(&mut self, _tick: &mut Tick<'_>) {}

    /// Tells a node of [`Resume::Elapsed`](crate::Resume) how many ticks it slept through. It leaves the
    /// state that as many calls would have left.
    fn elapsed(&mut self, _ticks: u64) {}

    /// Takes a new value of a parameter that is [live](crate::Param::live), by its place in the
    /// descriptor; it lies in its range. A flag is 0 or 1, a choice the place of its word.
    fn set_parameter(&mut self, _index: usize, _value: f64) {}

    /// What it remembers from tick to tick, apart from its parameters and what they settle: see
    /// [`State`]. An instance that was prepared for the same place, perhaps with other parameters, goes
    /// on from it. A node that remembers nothing, or would rather start anew, leaves it out.
    fn state(&mut self, _state: &mut State<'_>) {}

    /// Latency from inputs to outputs, exact and signed.
    fn latency(&self) -> Latency {
        Latency::ZERO
    }

    /// How long the outputs go on once the inputs are silent.
    fn tail(&self) -> Latency {
        Latency::ZERO
    }

    /// Sources only: how long there is something to play.
    fn duration(&self) -> Option<Latency> {
        None
    }

    /// Whether `process` keeps the rule against allocation. A node that cannot must say so here.
    fn allocation_free(&self) -> bool {
        true
    }

    /// What there is to tell about this node. Control thread.
    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }

    /// Files that it read and that no parameter of kind [`File`](crate::ParamKind::File) names, so that a
    /// host can see when they change. Control thread.
    fn files(&self) -> Vec<PathBuf> {
        Vec::new()
    }

    /// Limiters only: what holds the device's channel to the same limits, at rest and cold. Control thread.
    fn guard(&self) -> Option<Box<dyn Guard>> {
        None
    }

    /// Limiters only: the coil is at least as warm as this, as a mean of squares \[A^2\]. Tick thread.
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

    /// The most bytes that [`save`](Self::save) writes. Control thread.
    fn state_size(&mut self) -> usize {
        0
    }

    /// Writes what it remembers to the front of `bytes` and answers how many bytes; see [`Node::state`].
    /// Tick thread.
    fn save(&mut self, _bytes: &mut [u8]) -> Option<usize> {
        Some(0)
    }

    /// Goes on from what another instance saved. False where it cannot: then it is to be reset. Tick thread.
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

    /// Where it comes from, for a person: `built in`, or a plugin's file.
    fn origin(&self) -> &str {
        "built in"
    }

    /// Tells two builds of a kind's code apart, so that a graph that is compiled again takes the newer
    /// one. 0 for what is built in.
    fn build(&self) -> u64 {
        0
    }

    /// The ports for these parameters.
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
