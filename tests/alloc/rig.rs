//! An engine that is changed while it runs, and what is heard of it. No tick of it may allocate or free.

use asperity_engine::{Change, Controller, Engine, NodeReport, Options, SwapReport};
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

/// Output of a fresh engine in so many ticks.
pub fn fresh(lines: &str, ticks: usize) -> Vec<f32> {
    Rig::new(lines).run(ticks).heard.clone()
}

/// Largest difference of two signals.
pub fn apart(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

pub fn change<'a>(report: &'a SwapReport, id: &str) -> &'a Change {
    &report.nodes.iter().find(|n| n.0 == id).unwrap_or_else(|| panic!("no {id}: {report}")).1
}

/// Why a node is rebuilt; nothing where it is not.
pub fn why<'a>(report: &'a SwapReport, id: &str) -> Option<&'a str> {
    if let Change::Rebuilt { why, .. } = change(report, id) { Some(why) } else { None }
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
        self.swap_to(compiled(lines), &[])
    }

    /// Sends a graph of which these nodes are said to have changed.
    pub fn swap_to(&mut self, compiled: Compiled, changed: &[&str]) -> SwapReport {
        let changed: Vec<String> = changed.iter().map(ToString::to_string).collect();
        self.controller.swap(compiled, &changed).expect("it is sent")
    }

    /// Nodes that began anew, for each swap that is over.
    pub fn anew(&mut self) -> Vec<Vec<String>> {
        self.controller.collect().into_iter().map(|swap| swap.anew).collect()
    }

    pub fn node(&self, id: &str) -> usize {
        self.engine.schedule().index_of(id).unwrap_or_else(|| panic!("no node {id}"))
    }

    pub fn report(&self, id: &str) -> &NodeReport {
        self.engine.report(self.node(id)).expect("a report")
    }

    pub fn calls(&self, id: &str) -> u64 {
        self.report(id).calls
    }

    /// The value that a node puts out, or that a sink reads.
    pub fn control(&self, id: &str) -> f64 {
        let node = self.node(id);
        match self.engine.output(node, 0).or_else(|| self.engine.input(node, 0)) {
            Some(Buffer::Control { values, .. }) => values[0],
            other => panic!("no control: {other:?}"),
        }
    }

    /// The last tick as `out` heard it.
    pub fn last(&self) -> &[f32] {
        &self.heard[self.heard.len() - TICK..]
    }
}
