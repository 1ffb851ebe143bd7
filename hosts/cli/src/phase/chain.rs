//! The graph of one method, running.

use std::sync::Arc;

use asperity_engine::{Clock, Engine, NoClock, NodeReport, Options};
use asperity_graph::{GraphFile, compile};
use asperity_node::{Buffer, Diagnostic, Latency, Registry, Shape};

use super::frames::{FRAME_HZ, Frames, MAGNITUDES, magnitudes};
use super::method::{How, ID, Method};
use crate::failure::Failure;

/// Most latency that a node may declare \[s\]: the chain runs that much longer.
const MOST_LATENCY_S: u32 = 10;

/// Frames, the node, `overlap_add` if it puts out spectra, and a probe. It runs once.
pub struct Chain {
    engine: Engine,
    frames: Arc<Frames>,
    /// Nodes whose time counts: the node, and `overlap_add`.
    timed: Vec<usize>,
    node: usize,
    probe: usize,
    latency: Latency,
}

impl Chain {
    /// Prepares the nodes for these frames.
    ///
    /// # Errors Settings that the kind does not have; frames that it refuses; another output rate than the
    /// frames'; a declared latency of more than 10 s.
    pub fn new(
        registry: &Registry,
        method: &Method,
        frames: &Arc<Frames>,
        seed: u64,
    ) -> Result<Self, Failure> {
        let mut registry = registry.clone();
        registry.add(Arc::new(magnitudes(frames.clone())));
        let graph = graph(method, &registry, frames.layout().rate_hz, seed)?;
        let compiled = compile(&graph, &registry, asperity_graph::Options::default())?;
        let schedule = &compiled.schedule;
        let place = |id: &str| schedule.index_of(id);
        let (Some(node), Some(probe)) = (place(ID), place("out")) else {
            return Err(Failure::Machine("the chain has lost a node".into()));
        };
        let refuse = |message: String| Failure::from(Diagnostic::new(message).in_file(&method.label));
        let wanted = frames.layout().rate_hz;
        match schedule.nodes[probe].inputs.first().and_then(|p| p.port.as_ref()).map(|p| p.shape) {
            Some(Shape::Audio { rate_hz }) if rate_hz == wanted => {}
            Some(Shape::Audio { rate_hz }) => {
                return Err(refuse(format!(
                    "this node answers at {rate_hz} Hz, and its frames are of {wanted} Hz"
                )));
            }
            _ => return Err(refuse("this node does not answer with samples".into())),
        }
        let latency = schedule.latency();
        if latency.ms().abs() > f64::from(MOST_LATENCY_S) * 1e3 {
            return Err(refuse(format!(
                "this node declares a latency of {} ms; at most {MOST_LATENCY_S} s are waited for",
                latency.ms()
            )));
        }
        let timed = [Some(node), place("synthesis")].into_iter().flatten().collect();
        let engine = Engine::new(compiled, Options::default());
        Ok(Self { engine, frames: frames.clone(), timed, node, probe, latency })
    }

    /// Declared latency, with that of `overlap_add`.
    pub fn latency(&self) -> Latency {
        self.latency
    }

    /// Number of failures of all nodes, and the report of the node.
    pub fn faults(&self) -> (u64, Option<&NodeReport>) {
        (self.engine.faults(), self.engine.report(self.node))
    }

    /// Runs all frames and answers their signal without the declared latency: sample i is sample i of the
    /// frames.
    pub fn signal(&mut self) -> Vec<f32> {
        self.timed_signal(&NoClock, |_| {})
    }

    /// Like [`signal`](Self::signal); calls `took` for each frame with the time of node and `overlap_add`
    /// \[ns\].
    pub fn timed_signal<C: Clock>(&mut self, clock: &C, mut took: impl FnMut(u64)) -> Vec<f32> {
        let late = self.late();
        let wanted = (self.frames.samples() as i64 + late.max(0)) as usize;
        let count = self.frames.count() as u64;
        let mut spent = vec![0; self.engine.schedule().nodes.len()];
        let mut signal = vec![0.0; late.min(0).unsigned_abs() as usize];
        while signal.len() < wanted {
            spent.fill(0);
            self.engine.tick_timed(clock, &mut spent);
            signal.extend_from_slice(self.samples());
            if C::TIMES && self.engine.next_tick() <= count {
                took(self.timed.iter().filter_map(|&i| spent.get(i)).sum());
            }
        }
        signal.truncate(wanted);
        signal.split_off(late.max(0) as usize)
    }

    /// Runs all frames and answers the output of these ticks, whatever latency the node declares.
    pub fn live(&mut self) -> Vec<f32> {
        let mut signal = Vec::with_capacity(self.frames.samples() as usize);
        for _ in 0..self.frames.count() {
            self.engine.tick();
            signal.extend_from_slice(self.samples());
        }
        signal
    }

    /// The declared latency in samples, rounded down.
    fn late(&self) -> i64 {
        let (num, den) = self.latency.as_ratio();
        (i128::from(num) * i128::from(self.frames.layout().rate_hz)).div_euclid(i128::from(den)) as i64
    }

    /// Samples of the last tick.
    fn samples(&self) -> &[f32] {
        match self.engine.input(self.probe, 0) {
            Some(Buffer::Audio { samples, len, .. }) => &samples[..*len],
            _ => &[],
        }
    }
}

fn graph(method: &Method, registry: &Registry, rate_hz: u32, seed: u64) -> Result<GraphFile, Failure> {
    const ORIGIN: &str = "asperity";
    let kind = registry.get(method.kind()).map(|k| k.descriptor().clone());
    let Some(ports) = kind.as_ref().and_then(|k| k.retrieval()) else {
        return Err(Failure::Machine(format!("`{}` is gone", method.kind())));
    };
    let mut graph = GraphFile::empty(ORIGIN);
    graph.tick_hz = FRAME_HZ;
    // A node whose output has the graph's rate then has the frames' rate.
    graph.audio_hz = rate_hz;
    graph.seed = seed;
    graph.add_node("frames", MAGNITUDES, &[], ORIGIN)?;
    graph.add_node("out", "probe", &[], ORIGIN)?;
    let How::Node(node) = &method.how else {
        return Err(
            Diagnostic::new(format!("`{}` is no node: it needs all frames at once", method.label)).into()
        );
    };
    graph.nodes.push((**node).clone());
    graph.add_wire("frames.magnitude", &format!("{ID}.{}", ports.input), ORIGIN);
    if ports.spectrum {
        graph.add_node("synthesis", "overlap_add", &[], ORIGIN)?;
        graph.add_wire(&format!("{ID}.{}", ports.output), "synthesis.spectrum", ORIGIN);
        graph.add_wire("synthesis.signal", "out.in", ORIGIN);
    } else {
        graph.add_wire(&format!("{ID}.{}", ports.output), "out.in", ORIGIN);
    }
    Ok(graph)
}
