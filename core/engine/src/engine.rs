//! The engine.

use std::sync::Arc;

use asperity_graph::{BufferEntry, Compiled, Schedule, Step};
use asperity_node::{Buffer, Fact};

use crate::denormals::Flushed;
use crate::panics::install_silent_hook;
use crate::slot::{NodeReport, Now, Slot};
use crate::telemetry::{Clock, NoClock, Watch};

/// How to run.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Let nodes sleep that serve nothing but a closed gate.
    pub sleep: bool,
    /// The most nanoseconds that one call of a node may take, by the clock of [`Engine::tick_timed`]; a call that takes
    /// longer is a fault. `None`, or no clock, for no limit.
    pub limit_ns: Option<u64>,
}

impl Default for Options {
    fn default() -> Self {
        Self { sleep: true, limit_ns: None }
    }
}

/// A running graph.
pub struct Engine {
    schedule: Arc<Schedule>,
    buffers: Vec<Buffer>,
    slots: Vec<Slot>,
    steps: Vec<Step>,
    tick: u64,
    options: Options,
}

impl std::fmt::Debug for Engine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Engine")
            .field("tick", &self.tick)
            .field("nodes", &self.slots.len())
            .finish_non_exhaustive()
    }
}

impl Engine {
    /// Makes an engine at tick 0. Also makes panics inside nodes silent, for the whole program: they are
    /// contained and counted.
    pub fn new(compiled: Compiled, options: Options) -> Self {
        install_silent_hook();
        let Compiled { schedule, processors } = compiled;
        let buffers = schedule.buffers.iter().map(|b| match b {
            BufferEntry::Constant { count, value } => Buffer::constant(*count, *value),
            BufferEntry::Output(port) => Buffer::new(port, schedule.tick_hz),
        });
        Self {
            buffers: buffers.collect(),
            slots: schedule.nodes.iter().zip(processors).map(|(n, p)| Slot::new(n, p)).collect(),
            steps: schedule.steps.clone(),
            schedule: Arc::new(schedule),
            tick: 0,
            options,
        }
    }

    /// What is being run.
    pub fn schedule(&self) -> &Arc<Schedule> {
        &self.schedule
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
        let now = Now { tick: self.tick, tick_hz: self.schedule.tick_hz, sleep: self.options.sleep };
        let watch = Watch { clock, limit_ns: self.options.limit_ns };
        let mut before = if C::TIMES { clock.now_ns() } else { 0 };
        for step in &self.steps {
            let node = match *step {
                Step::Process(i) => {
                    let wanted = wanted(&self.slots, i);
                    self.slots[i].run(&mut self.buffers, now, wanted, watch);
                    i
                }
                Step::Wants(i) => {
                    let wanted = wanted(&self.slots, i);
                    self.slots[i].ask(&mut self.buffers, now, wanted, watch);
                    i
                }
                Step::Absorb(i) => {
                    self.slots[i].absorb(&mut self.buffers, now, watch);
                    i
                }
            };
            if C::TIMES {
                let after = clock.now_ns();
                if let Some(spent) = spent_ns.get_mut(node) {
                    *spent += after.saturating_sub(before);
                }
                before = after;
            }
        }
        self.tick += 1;
    }

    /// What an output of a node holds after the last tick.
    pub fn output(&self, node: usize, output: usize) -> Option<&Buffer> {
        let range = self.schedule.nodes.get(node)?.buffers.clone();
        self.buffers[range].get(output)
    }

    /// What an input of a node read in the last tick.
    pub fn input(&self, node: usize, input: usize) -> Option<&Buffer> {
        let reads = self.schedule.nodes.get(node)?.inputs.get(input)?.reads;
        self.buffers.get(reads.buffer as usize)
    }

    /// What became of a node so far.
    pub fn report(&self, node: usize) -> Option<&NodeReport> {
        Some(&self.slots.get(node)?.report)
    }

    /// What a node tells about itself now. Not for the tick thread.
    pub fn facts(&self, node: usize) -> Vec<Fact> {
        self.slots.get(node).map(|s| s.processor.facts()).unwrap_or_default()
    }

    /// Faults of all nodes so far.
    pub fn faults(&self) -> u64 {
        self.slots.iter().map(|s| s.report.faults).sum()
    }

    /// Back to tick 0, every node as after `prepare`, out of quarantine too. Counters stay. Control thread.
    pub fn reset(&mut self) {
        self.slots.iter_mut().for_each(Slot::reset);
        for (buffer, entry) in self.buffers.iter_mut().zip(&self.schedule.buffers) {
            if let BufferEntry::Output(port) = entry {
                *buffer = Buffer::new(port, self.schedule.tick_hz);
            }
        }
        self.tick = 0;
    }
}

fn wanted(slots: &[Slot], node: usize) -> bool {
    let guards = &slots[node].guards;
    guards.is_empty() || guards.iter().any(|way| way.iter().all(|&g| slots[g].wants))
}
