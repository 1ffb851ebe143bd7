//! The engine.

use std::sync::Arc;

use asperity_graph::{Compiled, Schedule, Step};
use asperity_node::{Buffer, Fact, Shape, time};

use crate::panics::install_silent_hook;
use crate::slot::{NodeReport, Now, Slot, is_finite};
use crate::swap::{self, Controller, Link};
use crate::telemetry::{Clock, NoClock, Watch};
use asperity_numbers::denormals::Flushed;

/// Options of an engine.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Lets nodes sleep that serve only a closed gate.
    pub sleep: bool,
    /// Longest call of a node in nanoseconds, by the clock of [`Engine::tick_timed`]. A longer call is
    /// a fault. `None`, or no clock, for no limit.
    pub limit_ns: Option<u64>,
    /// Checks every output for NaN and infinities. Without it, such values reach their readers unmarked
    /// and uncounted; panics, errors and overruns are still contained. Only for measuring the cost of
    /// the check: a player or writer leaves it on, and no graph file or program option turns it off.
    pub check_finite: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { sleep: true, limit_ns: None, check_finite: true }
    }
}

/// A running graph.
pub struct Engine {
    body: Body,
    tick: u64,
    options: Options,
    /// The engine's end of its controller, if it has one.
    link: Option<Box<Link>>,
}

/// The parts that a swap exchanges.
pub(crate) struct Body {
    pub(crate) schedule: Arc<Schedule>,
    /// Buffers of the schedule. During and after a swap there are more after them.
    pub(crate) buffers: Vec<Buffer>,
    /// Slots of the schedule's nodes. During and after a swap there are more after them.
    pub(crate) slots: Vec<Slot>,
    /// During a swap, a slot after the last one stands for a crossfade.
    pub(crate) steps: Vec<Step>,
    /// Audio buffers that the host fills every tick.
    pub(crate) fed_audio: Vec<usize>,
}

impl Body {
    pub(crate) fn new(compiled: Compiled) -> Self {
        let Compiled { schedule, nodes } = compiled;
        Self {
            buffers: swap::buffers(&schedule),
            slots: schedule.nodes.iter().zip(nodes).map(|(n, p)| Slot::new(n, p.processor)).collect(),
            steps: schedule.steps.clone(),
            fed_audio: swap::fed_audio(&schedule),
            schedule: Arc::new(schedule),
        }
    }
}

impl std::fmt::Debug for Engine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut f = f.debug_struct("Engine");
        f.field("tick", &self.tick).field("nodes", &self.body.schedule.nodes.len()).finish_non_exhaustive()
    }
}

impl Engine {
    /// Makes an engine at tick 0. Panics inside nodes become silent for the whole program, because they
    /// are contained and counted.
    pub fn new(compiled: Compiled, options: Options) -> Self {
        install_silent_hook();
        Self { body: Body::new(compiled), tick: 0, options, link: None }
    }

    /// Makes an engine with a controller, which changes the graph and live parameters from another
    /// thread.
    pub fn controlled(mut compiled: Compiled, options: Options) -> (Controller, Self) {
        let (controller, link) = Controller::new(&compiled.schedule, &mut compiled.nodes);
        (controller, Self { link: Some(Box::new(link)), ..Self::new(compiled, options) })
    }

    /// The running schedule. After a swap it is the new graph, and all indices refer to it; see
    /// [`swaps`](Self::swaps).
    pub fn schedule(&self) -> &Arc<Schedule> {
        &self.body.schedule
    }

    /// Number of swaps taken over.
    pub fn swaps(&self) -> u64 {
        self.link.as_ref().map_or(0, |l| l.taken)
    }

    /// Whether a crossfade is in progress.
    pub fn is_fading(&self) -> bool {
        self.link.as_ref().is_some_and(|l| l.fading.is_some())
    }

    /// Number of the next tick.
    pub fn next_tick(&self) -> u64 {
        self.tick
    }

    /// Runs one tick.
    pub fn tick(&mut self) {
        self.tick_timed(&NoClock, &mut []);
    }

    /// Runs one tick and adds each node's time in nanoseconds to `spent_ns`, by index of the node.
    pub fn tick_timed<C: Clock>(&mut self, clock: &C, spent_ns: &mut [u64]) {
        let _flushed = Flushed::new();
        let now = self.now();
        if let Some(link) = &mut self.link {
            link.listen(&mut self.body, now);
        }
        let Body { slots, buffers, steps, .. } = &mut self.body;
        let watch = &Watch { clock, limit_ns: self.options.limit_ns };
        let mut before = if C::TIMES { clock.now_ns() } else { 0 };
        for step in steps.iter() {
            let (Step::Process(i) | Step::Wants(i) | Step::Absorb(i)) = *step;
            if let Some(point) = i.checked_sub(slots.len()) {
                self.link.iter().for_each(|link| link.fade(point, buffers));
                before = if C::TIMES { clock.now_ns() } else { 0 };
                continue;
            }
            if C::TIMES {
                clock.enters(i);
            }
            let wanted = wanted(slots, i);
            match *step {
                Step::Process(_) => slots[i].run(buffers, now, wanted, watch),
                Step::Wants(_) => slots[i].ask(buffers, now, wanted, watch),
                Step::Absorb(_) => slots[i].absorb(buffers, now, watch),
            }
            if C::TIMES {
                let after = clock.now_ns();
                if let Some(spent) = spent_ns.get_mut(i) {
                    *spent += after.saturating_sub(before);
                }
                before = after;
            }
        }
        let Body { buffers, fed_audio, .. } = &mut self.body;
        for &at in fed_audio.iter() {
            // Audio that is not fed again is silent.
            if let Buffer::Audio { len, silent, .. } = &mut buffers[at] {
                (*len, *silent) = (0, true);
            }
        }
        self.tick += 1;
    }

    /// Sets the values of a [host-fed](asperity_graph::ScheduledInput::host_fed) control input from the
    /// next tick on, until others are set. `valid` marks them as trusted. Values that are not finite are
    /// refused, and the old ones are no longer trusted. Returns false if there is no such input, or the
    /// number of values differs. Tick thread.
    pub fn feed_control(&mut self, node: usize, input: usize, given: &[f64], valid: bool) -> bool {
        let Some(Buffer::Control { values, changed, valid: trusted }) = self.fed(node, input) else {
            return false;
        };
        let fits = values.len() == given.len() && given.iter().all(|x| x.is_finite());
        *trusted = valid && fits;
        if fits {
            *changed = **values != *given;
            values.copy_from_slice(given);
        }
        fits
    }

    /// Sets the samples of a fed audio input for the next tick: `fill` gets a slice of exactly that
    /// length. Without a call the input is silent. Samples that are not finite make it silent and
    /// untrusted. Returns false if there is no such input. Tick thread.
    pub fn feed_audio(
        &mut self,
        node: usize,
        input: usize,
        valid: bool,
        fill: impl FnOnce(&mut [f32]),
    ) -> bool {
        let (tick, tick_hz) = (self.tick, self.body.schedule.tick_hz);
        let shape = self.body.schedule.nodes.get(node).and_then(|n| n.inputs.get(input)?.port.as_ref());
        let Some(Shape::Audio { rate_hz }) = shape.map(|p| p.shape) else { return false };
        let Some(buffer) = self.fed(node, input) else { return false };
        if let Buffer::Audio { samples, len, silent, .. } = buffer {
            let span = time::samples(tick, rate_hz, tick_hz);
            *len = ((span.end - span.start) as usize).min(samples.len());
            samples.fill(0.0);
            fill(&mut samples[..*len]);
            *silent = samples.iter().all(|x| *x == 0.0);
        }
        let finite = is_finite(buffer);
        if let Buffer::Audio { samples, silent, .. } = buffer
            && !finite
        {
            samples.fill(0.0);
            *silent = true;
        }
        buffer.set_valid(valid && finite);
        true
    }

    fn now(&self) -> Now {
        let Options { sleep, check_finite, .. } = self.options;
        Now { tick: self.tick, tick_hz: self.body.schedule.tick_hz, sleep, check_finite }
    }

    /// Buffer of an input that the host feeds.
    fn fed(&mut self, node: usize, input: usize) -> Option<&mut Buffer> {
        let port = self.body.schedule.nodes.get(node)?.inputs.get(input)?;
        self.body.buffers.get_mut(port.reads.buffer as usize).filter(|_| port.host_fed)
    }

    /// Continues `ticks` later without running the ticks between, when they can no longer be heard.
    /// Nodes treat it as sleep: each continues as its [`Resume`] says. Tick thread.
    pub fn skip(&mut self, ticks: u64) {
        if ticks == 0 {
            return;
        }
        let _flushed = Flushed::new();
        let now = self.now();
        self.body.slots.iter_mut().for_each(|slot| slot.skip(ticks, now));
        self.tick += ticks;
    }

    /// Buffer of an output after the last tick.
    pub fn output(&self, node: usize, output: usize) -> Option<&Buffer> {
        let range = self.body.schedule.nodes.get(node)?.buffers.clone();
        self.body.buffers[range].get(output)
    }

    /// Buffer that an input read in the last tick; during a crossfade, the mix.
    pub fn input(&self, node: usize, input: usize) -> Option<&Buffer> {
        let reads = self.nodes().get(node)?.inputs.get(input)?;
        self.body.buffers.get(reads.buffer as usize)
    }

    /// Tells a limiter the least heat of its coil; see
    /// [`Processor::warm`](asperity_node::Processor::warm). Tick thread.
    pub fn warm(&mut self, node: usize, heat: f64) {
        if node < self.body.schedule.nodes.len() {
            self.body.slots[node].processor.warm(heat);
        }
    }

    /// Tells a limiter how strong its output is to be; see
    /// [`Processor::attenuate`](asperity_node::Processor::attenuate). Tick thread.
    pub fn attenuate(&mut self, node: usize, strength: f32) {
        if node < self.body.schedule.nodes.len() {
            self.body.slots[node].processor.attenuate(strength);
        }
    }

    /// Report of a node so far.
    pub fn report(&self, node: usize) -> Option<&NodeReport> {
        Some(&self.nodes().get(node)?.report)
    }

    /// Facts of a node now. Not for the tick thread.
    pub fn facts(&mut self, node: usize) -> Vec<Fact> {
        let nodes = self.body.schedule.nodes.len();
        self.body.slots[..nodes].get_mut(node).map(|s| s.processor.facts()).unwrap_or_default()
    }

    /// Faults of all nodes so far, including nodes that a swap removed.
    pub fn faults(&self) -> u64 {
        let now: u64 = self.nodes().iter().map(|s| s.report.faults).sum();
        now + self.link.as_ref().map_or(0, |l| l.faults)
    }

    /// Goes back to tick 0 with every node as after `prepare`, also quarantined ones. A crossfade ends
    /// at once. Counters stay. Control thread.
    pub fn reset(&mut self) {
        if let Some(link) = &mut self.link {
            link.settle(&mut self.body);
        }
        let nodes = self.body.schedule.nodes.len();
        self.body.slots[..nodes].iter_mut().for_each(Slot::reset);
        let fresh = swap::buffers(&self.body.schedule);
        self.body.buffers.splice(..fresh.len(), fresh);
        self.tick = 0;
    }

    /// Slots of the schedule's nodes.
    fn nodes(&self) -> &[Slot] {
        &self.body.slots[..self.body.schedule.nodes.len()]
    }
}

fn wanted(slots: &[Slot], node: usize) -> bool {
    let gate_sets = &slots[node].gate_sets;
    gate_sets.is_empty() || gate_sets.iter().any(|way| way.iter().all(|&g| slots[g].wants))
}
