//! The engine.

use std::sync::Arc;

use asperity_graph::{Compiled, Schedule};
use asperity_node::{Buffer, Fact, Shape, time};

use crate::panics::install_silent_hook;
use crate::slot::{NodeReport, Now, Slot};
use crate::swap::{self, Controller, Link, Run};
use crate::telemetry::{Clock, NoClock, Watch};
use crate::view::is_finite;
use asperity_numbers::denormals::Flushed;

/// How to run.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Let nodes sleep that serve nothing but a closed gate.
    pub sleep: bool,
    /// The most nanoseconds that one call of a node may take, by the clock of [`Engine::tick_timed`]; a
    /// call that takes longer is a fault. `None`, or no clock, for no limit.
    pub limit_ns: Option<u64>,
    /// Look for NaN and infinities in every output. Without, what is not finite goes on to whoever reads
    /// it, unmarked and uncounted; panics, errors and overruns are contained all the same. Only for
    /// measuring what looking costs: whatever plays or writes a graph leaves it on, and no graph file or
    /// option of a program turns it off.
    pub guards: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { sleep: true, limit_ns: None, guards: true }
    }
}

/// A running graph.
pub struct Engine {
    body: Body,
    tick: u64,
    options: Options,
    /// The other end of its controller, if it has one.
    link: Option<Box<Link>>,
}

/// What a swap exchanges.
pub(crate) struct Body {
    pub(crate) schedule: Arc<Schedule>,
    /// Those of the schedule; during and after a swap, more behind them.
    pub(crate) buffers: Vec<Buffer>,
    /// Those of the schedule; during and after a swap, more behind them.
    pub(crate) slots: Vec<Slot>,
    pub(crate) steps: Vec<Run>,
    /// Buffers of audio that the host gives, one tick at a time.
    pub(crate) fed_audio: Vec<usize>,
}

impl Body {
    pub(crate) fn new(compiled: Compiled) -> Self {
        let Compiled { schedule, processors } = compiled;
        Self {
            buffers: swap::buffers(&schedule),
            slots: schedule.nodes.iter().zip(processors).map(|(n, p)| Slot::new(n, p)).collect(),
            steps: schedule.steps.iter().map(|s| (*s).into()).collect(),
            fed_audio: swap::fed_audio(&schedule),
            schedule: Arc::new(schedule),
        }
    }
}

impl std::fmt::Debug for Engine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Engine")
            .field("tick", &self.tick)
            .field("nodes", &self.body.schedule.nodes.len())
            .finish_non_exhaustive()
    }
}

impl Engine {
    /// Makes an engine at tick 0. Also makes panics inside nodes silent, for the whole program: they are
    /// contained and counted.
    pub fn new(compiled: Compiled, options: Options) -> Self {
        install_silent_hook();
        Self { body: Body::new(compiled), tick: 0, options, link: None }
    }

    /// The same with a controller, which changes the graph and live parameters from another thread while
    /// this one ticks.
    pub fn controlled(mut compiled: Compiled, options: Options) -> (Controller, Self) {
        let (controller, link) = Controller::new(&compiled.schedule, &mut compiled.processors);
        (controller, Self { link: Some(Box::new(link)), ..Self::new(compiled, options) })
    }

    /// What is being run. After a swap was taken over, that is the new graph, and all indices are of it;
    /// [`swaps`](Self::swaps) tells.
    pub fn schedule(&self) -> &Arc<Schedule> {
        &self.body.schedule
    }

    /// How many swaps have been taken over.
    pub fn swaps(&self) -> u64 {
        self.link.as_ref().map_or(0, |l| l.swaps())
    }

    /// Whether a crossfade is under way.
    pub fn is_fading(&self) -> bool {
        self.link.as_ref().is_some_and(|l| l.is_fading())
    }

    /// The number of the next tick.
    pub fn next_tick(&self) -> u64 {
        self.tick
    }

    /// Runs one tick.
    pub fn tick(&mut self) {
        self.tick_timed(&NoClock, &mut []);
    }

    /// Runs one tick and adds to `spent_ns`, by index of the node, what each node took in nanoseconds.
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
            if let (true, Run::Process(i) | Run::Wants(i) | Run::Absorb(i)) = (C::TIMES, *step) {
                clock.enters(i);
            }
            let node = match *step {
                Run::Process(i) => {
                    let wanted = wanted(slots, i);
                    slots[i].run(buffers, now, wanted, watch);
                    Some(i)
                }
                Run::Wants(i) => {
                    let wanted = wanted(slots, i);
                    slots[i].ask(buffers, now, wanted, watch);
                    Some(i)
                }
                Run::Absorb(i) => {
                    slots[i].absorb(buffers, now, watch);
                    Some(i)
                }
                Run::Fade(point) => {
                    if let Some(link) = &self.link {
                        link.fade(point, buffers);
                    }
                    None
                }
            };
            if C::TIMES {
                let after = clock.now_ns();
                if let Some(spent) = node.and_then(|i| spent_ns.get_mut(i)) {
                    *spent += after.saturating_sub(before);
                }
                before = after;
            }
        }
        let Body { buffers, fed_audio, .. } = &mut self.body;
        for &at in fed_audio.iter() {
            // What is not given anew is silent.
            if let Buffer::Audio { len, silent, .. } = &mut buffers[at] {
                (*len, *silent) = (0, true);
            }
        }
        self.tick += 1;
    }

    /// Gives a control input that is [fed](asperity_graph::ScheduledInput::fed) its values for the next
    /// tick and those after it, until others are given; `valid` says whether they are to be trusted.
    /// Values that are not finite are not taken, and what was there is no longer trusted. False where
    /// there is no such input or as many values. Tick thread.
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

    /// Gives an audio input that is fed the samples of the next tick: `fill` gets room for exactly these.
    /// Not called, the input is silent. Samples that are not finite make it silent and not to be trusted.
    /// False where there is no such input. Tick thread.
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
        let Options { sleep, guards, .. } = self.options;
        Now { tick: self.tick, tick_hz: self.body.schedule.tick_hz, sleep, guards }
    }

    /// The buffer of an input that the host feeds.
    fn fed(&mut self, node: usize, input: usize) -> Option<&mut Buffer> {
        let port = self.body.schedule.nodes.get(node)?.inputs.get(input)?;
        self.body.buffers.get_mut(port.reads.buffer as usize).filter(|_| port.fed)
    }

    /// Goes on `ticks` later without running those between, when they can no longer be heard. Nodes take
    /// it as a sleep: each goes on as its [`Resume`] says. Tick thread.
    pub fn skip(&mut self, ticks: u64) {
        if ticks == 0 {
            return;
        }
        let _flushed = Flushed::new();
        let now = self.now();
        self.body.slots.iter_mut().for_each(|slot| slot.skip(ticks, now));
        self.tick += ticks;
    }

    /// What an output of a node holds after the last tick.
    pub fn output(&self, node: usize, output: usize) -> Option<&Buffer> {
        let range = self.body.schedule.nodes.get(node)?.buffers.clone();
        self.body.buffers[range].get(output)
    }

    /// What an input of a node read in the last tick: while it fades, the crossfade.
    pub fn input(&self, node: usize, input: usize) -> Option<&Buffer> {
        let reads = self.nodes().get(node)?.inputs.get(input)?;
        self.body.buffers.get(reads.buffer as usize)
    }

    /// Tells a limiter how warm its coil is at least; see
    /// [`Processor::warm`](asperity_node::Processor::warm). Tick thread.
    pub fn warm(&mut self, node: usize, heat: f64) {
        if node < self.body.schedule.nodes.len() {
            self.body.slots[node].processor.warm(heat);
        }
    }

    /// What became of a node so far.
    pub fn report(&self, node: usize) -> Option<&NodeReport> {
        Some(&self.nodes().get(node)?.report)
    }

    /// What a node tells about itself now. Not for the tick thread.
    pub fn facts(&self, node: usize) -> Vec<Fact> {
        self.nodes().get(node).map(|s| s.processor.facts()).unwrap_or_default()
    }

    /// Faults of all nodes so far, also of those that a swap removed.
    pub fn faults(&self) -> u64 {
        let now: u64 = self.nodes().iter().map(|s| s.report.faults).sum();
        now + self.link.as_ref().map_or(0, |l| l.faults())
    }

    /// Back to tick 0, every node as after `prepare`, out of quarantine too; a crossfade ends at once.
    /// Counters stay. Control thread.
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

    /// The slots of the schedule's nodes.
    fn nodes(&self) -> &[Slot] {
        &self.body.slots[..self.body.schedule.nodes.len()]
    }
}

fn wanted(slots: &[Slot], node: usize) -> bool {
    let guards = &slots[node].guards;
    guards.is_empty() || guards.iter().any(|way| way.iter().all(|&g| slots[g].wants))
}
