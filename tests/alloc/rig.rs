//! An engine that is changed while it runs, and what is heard of it. No tick of it may allocate or free.

use asperity_engine::{Controller, Engine, Options, SwapReport};
use asperity_graph::{Compiled, GraphFile};
use asperity_node::Buffer;
use harness::counting::allocations;
use harness::graph::of_lines;
use harness::live::largest_step;
use harness::nodes;

/// Samples of a tick, and of a crossfade.
pub const TICK: usize = 96;
pub const FADE: usize = 480;

/// Largest step of a sine of 100 Hz at 48 kHz, and of a crossfade by 1.
pub const SINE: f32 = 0.013_09;
pub const STEEPEST: f32 = 1.5 / FADE as f32;

pub fn compiled_file(graph: &GraphFile) -> Compiled {
    harness::graph::compiled(graph, &crate::tones::with_tones(nodes::registry()))
}

pub fn compiled(lines: &str) -> Compiled {
    compiled_file(&of_lines(lines))
}

/// The same with changes as for `--set`.
pub fn compiled_with(lines: &str, changes: &[&str]) -> Compiled {
    let mut graph = of_lines(lines);
    changes.iter().for_each(|change| graph.set(change, "test").expect("a change"));
    compiled_file(&graph)
}

/// An engine with its controller, and what can be heard of it.
pub struct Rig {
    pub controller: Controller,
    pub engine: Engine,
    /// Samples that reached the sink `out`.
    pub heard: Vec<f32>,
}

impl Rig {
    pub fn new(lines: &str) -> Self {
        Self::of(compiled(lines))
    }

    pub fn of(compiled: Compiled) -> Self {
        let (controller, engine) = Engine::controlled(compiled, Options::default());
        Self { controller, engine, heard: Vec::new() }
    }

    /// An engine that has run for so many ticks when another graph is sent, and the report of that.
    pub fn swapped(from: &str, ticks: usize, to: &str) -> (Self, SwapReport) {
        let mut rig = Self::new(from);
        let report = rig.run(ticks).swap(to);
        (rig, report)
    }

    /// Checks that no step from this sample on is as large as the bound.
    pub fn is_smooth(&self, from: usize, bound: f32) {
        let step = largest_step(&self.heard[from..]);
        assert!(step < bound, "a step of {step}, {bound} is the bound");
    }

    /// The output audio of a node in the last tick.
    pub fn samples(&self, id: &str) -> &[f32] {
        match self.engine.output(self.node(id), 0) {
            Some(Buffer::Audio { samples, .. }) => samples,
            other => panic!("no audio: {other:?}"),
        }
    }

    pub fn tick(&mut self) {
        let ((), count) = allocations(|| self.engine.tick());
        assert_eq!(count, 0, "tick {} allocates or frees", self.engine.next_tick() - 1);
        if let Some(out) = self.engine.schedule().index_of("out") {
            let signal = match self.engine.schedule().nodes[out].outputs.is_empty() {
                true => self.engine.input(out, 0),
                false => self.engine.output(out, 0),
            };
            if let Some(Buffer::Audio { samples, len, silent, .. }) = signal {
                assert!(!silent || samples[..*len].iter().all(|x| *x == 0.0), "it says it is silent");
                self.heard.extend(&samples[..*len]);
            }
        }
    }

    pub fn run(&mut self, ticks: usize) -> &mut Self {
        (0..ticks).for_each(|_| self.tick());
        self
    }

    pub fn swap(&mut self, lines: &str) -> SwapReport {
        self.controller.swap(compiled(lines), &[]).expect("it is sent")
    }

    pub fn node(&self, id: &str) -> usize {
        self.engine.schedule().index_of(id).unwrap_or_else(|| panic!("no node {id}"))
    }

    pub fn calls(&self, id: &str) -> u64 {
        self.engine.report(self.node(id)).expect("a report").calls
    }

    pub fn control(&self, id: &str) -> f64 {
        match self.engine.output(self.node(id), 0) {
            Some(Buffer::Control { values, .. }) => values[0],
            other => panic!("no control: {other:?}"),
        }
    }

    /// The last tick as `out` heard it.
    pub fn last(&self) -> &[f32] {
        &self.heard[self.heard.len() - TICK..]
    }
}
