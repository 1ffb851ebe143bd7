//! One node in the engine, with everything the engine remembers about it.

use std::ops::Range;

use asperity_graph::{GateSets, ScheduledNode};
use asperity_node::{Buffer, Fault, InputRef, Inputs, Outputs, Processor, Resume, Shape, Status, Tick, time};

use crate::fade::Fade;
use crate::panics::contain;
use crate::telemetry::{Clock, Watch};

/// Number of faults after which a node is no longer called. One is forgiven every [`FAULT_FORGIVEN_S`].
pub const FAULTS_BEFORE_QUARANTINE: u64 = 8;

/// Seconds after which one fault no longer counts towards quarantine.
pub const FAULT_FORGIVEN_S: u64 = 10;

/// Time in seconds in which the audio of a failing node fades to silence.
pub const FAULT_FADE_S: f32 = 0.01;

/// Calls and faults of a node so far.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NodeReport {
    /// Calls of `process`.
    pub calls: u64,
    /// Ticks slept through.
    pub slept: u64,
    /// Number of faults.
    pub faults: u64,
    /// Last fault.
    pub last_fault: Option<Fault>,
    /// Whether it is no longer called.
    pub quarantined: bool,
}

pub(crate) struct Slot {
    pub(crate) processor: Box<dyn Processor>,
    pub(crate) inputs: Box<[InputRef]>,
    /// Inputs that wake the node after it has said it sleeps.
    wakes: Box<[usize]>,
    pub(crate) outputs: Range<usize>,
    rates: Box<[u32]>,
    /// Last good values of each control output; empty for other outputs.
    held: Box<[Box<[f64]>]>,
    /// Which outputs are `secondary`; see [`asperity_node::Output`].
    secondary: Box<[bool]>,
    fades: Box<[Fade]>,
    pub(crate) every: u64,
    /// When the node is wanted; empty for a node that always runs.
    pub(crate) gate_sets: GateSets,
    resume: Resume,
    closes_cycle: bool,
    /// Last answer of a gate; true for other nodes.
    pub(crate) wants: bool,
    /// Tick since which the gates let it sleep.
    asleep_since: Option<u64>,
    /// The node said it sleeps. It dozes until an audio or frame input carries something.
    dozing: bool,
    /// Ticks until it may doze.
    tail: Option<u64>,
    /// Faults that count towards quarantine, and the tick since which none has been forgiven.
    strikes: u64,
    struck: u64,
    pub(crate) report: NodeReport,
}

/// State of the engine in this tick, for every slot.
#[derive(Clone, Copy)]
pub(crate) struct Now {
    pub(crate) tick: u64,
    pub(crate) tick_hz: u32,
    /// Whether nodes may sleep.
    pub(crate) sleep: bool,
    /// Whether outputs are checked for NaN and infinities.
    pub(crate) check_finite: bool,
}

impl Slot {
    pub(crate) fn new(node: &ScheduledNode, processor: Box<dyn Processor>) -> Self {
        let rate = |s: &Shape| if let Shape::Audio { rate_hz } = s { *rate_hz } else { 0 };
        let count = |s: &Shape| if let Shape::Control { count } = s { *count } else { 0 };
        let shapes: Vec<Shape> = node.outputs.iter().map(|o| o.port.shape).collect();
        Self {
            processor,
            inputs: node.inputs.iter().map(|i| i.reads).collect(),
            wakes: (0..node.inputs.len()).filter(|&i| node.inputs[i].wakes).collect(),
            outputs: node.buffers.clone(),
            rates: shapes.iter().map(rate).collect(),
            held: shapes.iter().map(|s| vec![0.0; count(s)].into()).collect(),
            secondary: node.outputs.iter().map(|o| o.secondary).collect(),
            fades: shapes.iter().map(|s| Fade::new(rate(s) as f32 * FAULT_FADE_S)).collect(),
            every: u64::from(node.every),
            gate_sets: node.gate_sets.clone(),
            resume: node.resume,
            closes_cycle: node.closes_cycle,
            wants: true,
            asleep_since: None,
            dozing: false,
            tail: None,
            strikes: 0,
            struck: 0,
            report: NodeReport::default(),
        }
    }

    /// Runs one tick in which the gates want this node (`wanted`) or not. Where nodes may not sleep it
    /// runs in any case, and wakes in the same tick as it would otherwise.
    pub(crate) fn run<C: Clock>(
        &mut self,
        buffers: &mut [Buffer],
        now: Now,
        wanted: bool,
        watch: &Watch<'_, C>,
    ) {
        if !now.tick.is_multiple_of(self.every) {
            // A change between two of its ticks wakes it too.
            if self.dozing {
                let (inputs, _) = split(buffers, &self.outputs, &self.inputs);
                self.dozing = !wakened(inputs, &self.wakes);
            }
            return self.clear(buffers, now);
        }
        if !wanted {
            self.asleep_since.get_or_insert(now.tick);
            if now.sleep {
                self.report.slept += 1;
                self.fades.iter_mut().for_each(Fade::sleep);
                self.clear(buffers, now);
                return self.trust_silence(buffers);
            }
        } else {
            self.wake(now);
        }
        self.clear(buffers, now);
        if self.report.quarantined {
            return self.contain_outputs(buffers);
        }
        if self.dozing && now.sleep {
            let (inputs, _) = split(buffers, &self.outputs, &self.inputs);
            if !wakened(inputs, &self.wakes) {
                self.report.slept += 1;
                return self.trust_silence(buffers);
            }
            self.dozing = false;
        }
        self.call(buffers, now, watch);
    }

    /// Wakes from the sleep that the gates allowed. A node with `Elapsed` learns only of ticks in which it
    /// was not called.
    fn wake(&mut self, now: Now) {
        let Some(since) = self.asleep_since.take() else { return };
        self.rouse();
        match self.resume {
            Resume::Restart => self.tell(now, |p| p.reset()),
            Resume::Elapsed if now.sleep => self.tell(now, |p| p.elapsed(now.tick - since)),
            Resume::Elapsed | Resume::Continue | Resume::Never => {}
        }
    }

    /// Makes a call to the node, and counts its fault.
    fn tell(&mut self, now: Now, call: impl FnOnce(&mut dyn Processor)) {
        let processor = &mut self.processor;
        if let Err(fault) = contain(|| processor.ask(|p| call(p))) {
            self.fault(fault, now);
        }
    }

    /// Skips time without a tick. A sleeping node learns it when it wakes.
    pub(crate) fn skip(&mut self, ticks: u64, now: Now) {
        let asleep = self.asleep_since.is_some();
        self.rouse();
        match self.resume {
            Resume::Restart if !asleep => self.tell(now, |p| p.reset()),
            // Where nodes may not sleep, it was called in any case.
            Resume::Elapsed if !asleep || !now.sleep => self.tell(now, |p| p.elapsed(ticks)),
            _ => {}
        }
    }

    /// Marks the silence of a sleeping node as valid. Controls keep their mark.
    fn trust_silence(&self, buffers: &mut [Buffer]) {
        for buffer in &mut buffers[self.outputs.clone()] {
            if !matches!(buffer, Buffer::Control { .. }) {
                buffer.set_valid(true);
            }
        }
    }

    /// Prepares outputs for a call: audio of this tick's length and zero, no frame, controls unchanged.
    fn clear(&mut self, buffers: &mut [Buffer], now: Now) {
        for (buffer, rate) in buffers[self.outputs.clone()].iter_mut().zip(&self.rates) {
            match buffer {
                Buffer::Control { changed, .. } => *changed = false,
                Buffer::Audio { samples, len, silent, .. } => {
                    let span = time::samples(now.tick, *rate, now.tick_hz);
                    let before = *len;
                    *len = ((span.end - span.start) as usize).min(samples.len());
                    if !*silent || before < *len {
                        samples.fill(0.0);
                    }
                    *silent = true;
                }
                Buffer::Magnitude { frame, .. } | Buffer::Spectrum { frame, .. } => *frame = None,
            }
        }
    }

    fn call<C: Clock>(&mut self, buffers: &mut [Buffer], now: Now, watch: &Watch<'_, C>) {
        let (inputs, outputs) = split(buffers, &self.outputs, &self.inputs);
        // A node that closes a cycle emits earlier inputs. A mark that went round the cycle would never
        // end.
        let trusted = self.closes_cycle || (0..inputs.len()).all(|i| inputs.valid(i));
        let loud = wakened(inputs, &self.wakes);
        let mut tick =
            Tick { index: now.tick, tick_hz: now.tick_hz, inputs, outputs: Outputs::new(&mut *outputs) };
        let processor = &mut self.processor;
        let answer = watch.call(|| processor.run(&mut tick)).and_then(|status| match status {
            _ if now.check_finite && !outputs.iter().all(is_finite) => Err(Fault::NotFinite),
            status => Ok(status),
        });
        self.report.calls += 1;
        let status = match answer {
            Ok(status) => status,
            Err(fault) => {
                self.fault(fault, now);
                return self.contain_outputs(buffers);
            }
        };
        let quiet = matches!(status, Status::Quiet | Status::Asleep);
        for ((buffer, held), fade) in outputs.iter_mut().zip(&mut self.held).zip(&mut self.fades) {
            match buffer {
                Buffer::Control { values, changed, .. } => {
                    *changed = held != values;
                    held.copy_from_slice(values);
                }
                Buffer::Audio { samples, len, silent, .. } => {
                    if quiet && !*silent {
                        samples.fill(0.0);
                    }
                    *silent = (*silent || quiet) && !fade.active();
                    fade.pass(&mut samples[..*len]);
                }
                Buffer::Magnitude { frame, .. } | Buffer::Spectrum { frame, .. } if quiet => *frame = None,
                Buffer::Magnitude { .. } | Buffer::Spectrum { .. } => {}
            }
            buffer.set_valid(trusted);
        }
        let fading = self.fades.iter().any(Fade::active);
        self.tail = match (status, self.tail) {
            (Status::Asleep, _) => Some(0),
            (Status::Tail(n), Some(left)) if !loud => Some(n.min(left.saturating_sub(self.every))),
            (Status::Tail(n), _) => Some(n),
            _ => None,
        };
        if self.tail == Some(0) && !fading {
            self.dozing = true;
            self.tail = None;
        }
    }

    /// Counts a fault, and resets or quarantines the node.
    fn fault(&mut self, fault: Fault, now: Now) {
        let period = FAULT_FORGIVEN_S * u64::from(now.tick_hz);
        let forgiven = now.tick.saturating_sub(self.struck) / period;
        // Time too short to forgive a fault counts towards the next.
        (self.strikes, self.struck) = match self.strikes.checked_sub(forgiven) {
            Some(left @ 1..) => (left + 1, self.struck + forgiven * period),
            _ => (1, now.tick),
        };
        self.report.faults += 1;
        self.report.last_fault = Some(fault);
        self.report.quarantined |= self.strikes >= FAULTS_BEFORE_QUARANTINE || fault == Fault::Stuck;
        if matches!(fault, Fault::Failed(_) | Fault::Overrun) || self.report.quarantined {
            return;
        }
        // After a panic or a NaN the node's state may be anything, so it starts over. It is quarantined
        // if that fails too.
        self.begin_anew();
    }

    /// Resets the node. A node that fails in `reset` is quarantined, and that fault is counted too.
    fn begin_anew(&mut self) {
        let processor = &mut self.processor;
        if let Err(fault) = contain(|| processor.ask(|p| p.reset())) {
            self.report.faults += 1;
            self.report.last_fault = Some(fault);
            self.report.quarantined = true;
        }
    }

    /// Writes the outputs of a node that failed: controls hold and are marked, frames are zero, audio
    /// fades. Faded or zeroed output counts as valid, so that a mix goes on. A control `secondary` counts
    /// as valid too, because it only describes those outputs.
    fn contain_outputs(&mut self, buffers: &mut [Buffer]) {
        let outputs = buffers[self.outputs.clone()].iter_mut().zip(&self.held).zip(&mut self.fades);
        for (((buffer, held), fade), secondary) in outputs.zip(&self.secondary) {
            let control = matches!(buffer, Buffer::Control { .. });
            match buffer {
                Buffer::Control { values, .. } => values.copy_from_slice(held),
                Buffer::Audio { samples, len, silent, .. } => {
                    *silent = fade.fault(&mut samples[..*len]);
                }
                Buffer::Magnitude { bins, .. } => bins.fill(0.0),
                Buffer::Spectrum { bins, .. } => bins.fill(asperity_node::Complex::default()),
            }
            buffer.set_valid(!control || *secondary);
        }
    }

    /// Asks a gate. A gate that is not wanted itself wants nothing.
    pub(crate) fn ask<C: Clock>(
        &mut self,
        buffers: &mut [Buffer],
        now: Now,
        wanted: bool,
        watch: &Watch<'_, C>,
    ) {
        if !now.tick.is_multiple_of(self.every) {
            return;
        }
        if !wanted || self.report.quarantined {
            self.wants = false;
            return;
        }
        // Before the question, because waking may reset the state that the answer depends on.
        self.wake(now);
        let (inputs, _) = split(buffers, &self.outputs, &self.inputs);
        let mut tick = Tick { index: now.tick, tick_hz: now.tick_hz, inputs, outputs: Outputs::new(&mut []) };
        let processor = &mut self.processor;
        match watch.call(|| processor.ask(|p| p.wants(&mut tick))) {
            Ok(wants) => self.wants = wants,
            Err(fault) => {
                self.wants = false;
                self.fault(fault, now);
            }
        }
    }

    /// Gives a node that closes a cycle its inputs.
    pub(crate) fn absorb<C: Clock>(&mut self, buffers: &mut [Buffer], now: Now, watch: &Watch<'_, C>) {
        if self.report.quarantined || !now.tick.is_multiple_of(self.every) {
            return;
        }
        let (inputs, _) = split(buffers, &self.outputs, &self.inputs);
        let mut tick = Tick { index: now.tick, tick_hz: now.tick_hz, inputs, outputs: Outputs::new(&mut []) };
        let processor = &mut self.processor;
        if let Err(fault) = watch.call(|| processor.ask(|p| p.absorb(&mut tick))) {
            self.fault(fault, now);
        }
    }

    /// Sets a live parameter.
    pub(crate) fn set_parameter(&mut self, index: usize, value: f64, now: Now) {
        if self.report.quarantined {
            return;
        }
        self.tell(now, |p| p.set_parameter(index, value));
        // A sleeping node may have a new output now.
        self.rouse();
    }

    /// Ends a sleep that the node chose itself, so that it is called at least once more.
    pub(crate) fn rouse(&mut self) {
        (self.dozing, self.tail) = (false, None);
    }

    /// Exchanges two nodes with all their state. Each takes the other's inputs, outputs and gate sets.
    pub(crate) fn trade(&mut self, other: &mut Self) {
        std::mem::swap(self, other);
        std::mem::swap(&mut self.inputs, &mut other.inputs);
        std::mem::swap(&mut self.outputs, &mut other.outputs);
        std::mem::swap(&mut self.gate_sets, &mut other.gate_sets);
    }

    /// Continues from another node: with its state, copied through `room`, if there is room. Returns
    /// whether that worked; otherwise the node starts anew.
    pub(crate) fn adopt(&mut self, old: &mut Self, room: Option<&mut [u8]>) -> bool {
        for (held, before) in self.held.iter_mut().zip(&old.held).filter(|(a, b)| a.len() == b.len()) {
            held.copy_from_slice(before);
        }
        self.wants = old.wants;
        let Some(room) = room.filter(|_| !old.report.quarantined) else { return false };
        let (from, to) = (&mut old.processor, &mut self.processor);
        let saved = contain(|| Ok(from.save(room))).ok().flatten();
        // After a panic the state may be anything.
        let restored = |state: &[u8]| contain(|| Ok(to.restore(state))).unwrap_or(false);
        let adopted = saved.and_then(|len| room.get(..len)).is_some_and(restored);
        if adopted {
            self.asleep_since = old.asleep_since;
        } else {
            self.report.quarantined = false;
            self.begin_anew();
        }
        adopted
    }

    /// Resets everything but the counters of the report. Control thread.
    pub(crate) fn reset(&mut self) {
        (self.asleep_since, self.dozing, self.tail, self.wants) = (None, false, None, true);
        (self.strikes, self.struck) = (0, 0);
        self.report.quarantined = false;
        self.begin_anew();
        self.fades.iter_mut().for_each(Fade::reset);
        self.held.iter_mut().for_each(|held| held.fill(0.0));
    }
}

/// Splits the buffers into a node's inputs and its own outputs.
fn split<'b>(
    buffers: &'b mut [Buffer],
    outputs: &Range<usize>,
    inputs: &'b [InputRef],
) -> (Inputs<'b>, &'b mut [Buffer]) {
    let (before, rest) = buffers.split_at_mut(outputs.start);
    let (own, after) = rest.split_at_mut(outputs.len());
    (Inputs::new(before, after, outputs.end, inputs), own)
}

/// Whether an input that wakes carries something.
fn wakened(inputs: Inputs<'_>, wakes: &[usize]) -> bool {
    wakes.iter().any(|&i| inputs.buffer(i).is_some_and(|b| !b.is_silent()))
}

/// Whether a buffer holds no NaN or infinity in this tick.
pub(crate) fn is_finite(buffer: &Buffer) -> bool {
    const EXPONENT: u32 = 0x7f80_0000;
    // On bits, and without an early exit, so that it vectorises.
    fn all(xs: impl Iterator<Item = f32>) -> bool {
        !xs.fold(false, |bad, x| bad | (x.to_bits() & EXPONENT == EXPONENT))
    }
    match buffer {
        Buffer::Control { values, .. } => values.iter().all(|x| x.is_finite()),
        Buffer::Audio { samples, len, silent, .. } => *silent || all(samples[..*len].iter().copied()),
        Buffer::Magnitude { bins, frame, .. } => frame.is_none() || all(bins.iter().copied()),
        Buffer::Spectrum { bins, frame, .. } => {
            frame.is_none() || all(bins.iter().flat_map(|z| [z.re, z.im]))
        }
    }
}
