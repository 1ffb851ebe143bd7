//! Phase retrieval outside a graph file: frames in, a signal out.
//!
//! A [`Method`] is a node with settings, or an offline method. A [`Chain`] is the graph of a source that
//! plays [`Frames`], the node, and an `overlap_add` if the node puts out spectra.

mod frames;
mod magnitudes;
#[cfg(test)]
pub mod tests;

use std::sync::Arc;

use asperity_diagnostics::{Source, one_of};
use asperity_dsp::Framing;
use asperity_dsp::griffin_lim::{self, Start, griffin_lim};
use asperity_engine::{Clock, Engine, NoClock, NodeReport, Options};
use asperity_graph::{GraphFile, NodeDecl, compile};
use asperity_node::{Buffer, Descriptor, Diagnostic, Latency, NodeKind, Registry, Shape};

use crate::failure::{Failure, wrong};
use crate::number::{number, whole};

pub use frames::{FRAME_HZ, Frames, Scale, check_rate};
use frames::{MAGNITUDES, magnitudes};

/// Names of methods that need all frames at once: Griffin-Lim and its fast variant.
pub const OFFLINE: [&str; 2] = ["griffin_lim", "fast_griffin_lim"];

/// The graph whose phase-retrieval node is `default`, and its name in errors.
const SHIPPED: (&str, &str) = ("texture.ron (shipped)", include_str!("../../../../graphs/texture.ron"));
/// The option that names methods, for errors.
const OPTION: &str = "--phase";
/// The node's id in a chain.
const ID: &str = "phase";
/// Most latency that a node may declare \[ms\]: the chain runs that much longer.
const MOST_LATENCY_MS: f64 = 10_000.0;

/// Kinds of a registry that retrieve phase, by name.
pub fn retrievers(registry: &Registry) -> Vec<&Descriptor> {
    registry.iter().map(|k| NodeKind::descriptor(k)).filter(|d| d.retrieval().is_some()).collect()
}

/// A way to retrieve phase, with its settings.
#[derive(Clone, Debug)]
pub struct Method {
    /// The text that names it.
    pub label: String,
    /// Kind of the node, or name of the offline method.
    pub kind: String,
    how: How,
}

#[derive(Clone, Debug)]
enum How {
    Node(Box<NodeDecl>),
    /// Griffin-Lim, with a seed of its own if one was set.
    Offline(griffin_lim::Options, Option<u64>),
}

/// Signal of a method.
pub struct Played {
    /// Sample i is sample i of the frames.
    pub signal: Vec<f32>,
    /// Declared latency of a node \[ms\].
    pub latency_ms: Option<f64>,
    /// Failures of a node.
    pub faults: u64,
    /// The engine's report of a node.
    pub report: Option<NodeReport>,
}

impl Method {
    /// Parses `KIND:param=value,...`; KIND may be an offline method, or `default` of the shipped graph.
    ///
    /// # Errors
    /// An unknown kind, settings that do not fit.
    pub fn parse(text: &str, registry: &Registry) -> Result<Self, Failure> {
        let (kind, settings) = text.split_once(':').unwrap_or((text, ""));
        let settings = settings.split(',').map(str::trim).filter(|s| !s.is_empty());
        if OFFLINE.contains(&kind) {
            let how = offline(kind, settings)?;
            return Ok(Self { label: text.to_owned(), kind: kind.to_owned(), how });
        }
        let kinds: Vec<&str> = retrievers(registry).into_iter().map(|d| d.kind.as_ref()).collect();
        let mut graph = GraphFile::empty(OPTION);
        if kind == "default" {
            let shipped = GraphFile::parse(&Source::new(SHIPPED.0, SHIPPED.1))?.nodes;
            let node = shipped.into_iter().find(|n| kinds.contains(&n.kind.as_str()));
            graph.nodes.extend(node.map(|node| NodeDecl { id: ID.into(), ..node }));
        } else if kinds.contains(&kind) {
            graph.add_node(ID, kind, &[], OPTION)?;
        } else {
            let names = kinds.iter().copied().chain(["default"]).chain(OFFLINE);
            return Err(wrong(
                OPTION,
                format!("`{kind}` is not a phase-retrieval node"),
                one_of(kind, names),
            ));
        }
        for setting in settings {
            graph.set(&format!("{ID}.{setting}"), OPTION)?;
        }
        let node = graph.nodes.pop().ok_or_else(|| Failure::Machine("there is no node".into()))?;
        Ok(Self { label: text.to_owned(), kind: node.kind.clone(), how: How::Node(Box::new(node)) })
    }

    /// Whether it needs all frames at once.
    pub fn is_offline(&self) -> bool {
        matches!(self.how, How::Offline(..))
    }

    /// The output for these frames. Calls `took` with each frame's time of node and `overlap_add` \[ns\].
    ///
    /// # Errors
    /// A node that does not prepare or does not answer with samples at the frames' rate.
    pub fn play<C: Clock>(
        &self,
        registry: &Registry,
        frames: &Arc<Frames>,
        seed: u64,
        clock: &C,
        took: impl FnMut(u64),
    ) -> Result<Played, Failure> {
        if let How::Offline(options, own) = &self.how {
            let l = frames.layout();
            let framing = Framing {
                rate_hz: l.rate_hz,
                fft_len: l.length as usize,
                bins: l.bins as usize,
                frame_num: l.frame_rate.num(),
                frame_den: l.frame_rate.den(),
            };
            let options = griffin_lim::Options { start: Start::Random(own.unwrap_or(seed)), ..*options };
            let found = griffin_lim(frames.amplitudes(), framing, options, |_| {});
            let signal = found.map_err(|e| Failure::Machine(e.to_string()))?.signal;
            return Ok(Played { signal, latency_ms: None, faults: 0, report: None });
        }
        let mut chain = Chain::new(registry, self, frames, seed)?;
        let signal = chain.signal(clock, took);
        Ok(Played {
            signal,
            latency_ms: Some(chain.latency.ms()),
            faults: chain.engine.faults(),
            report: chain.engine.report(chain.node).cloned(),
        })
    }
}

/// Griffin-Lim with these settings; only the fast one has `alpha`.
fn offline<'a>(kind: &str, settings: impl Iterator<Item = &'a str>) -> Result<How, Failure> {
    let fast = kind == OFFLINE[1];
    let mut options = griffin_lim::Options::default();
    let mut seed = None;
    if !fast {
        options.alpha = 0.0;
    }
    for setting in settings {
        let Some((key, value)) = setting.split_once('=') else {
            let help = format!("{kind}:iterations=100");
            return Err(wrong(OPTION, format!("there is no `=` in `{setting}`"), help));
        };
        let (key, value) = (key.trim(), value.trim());
        let set = match key {
            "iterations" => whole(1, 100_000, "")(value).map(|n| options.iterations = n),
            "seed" => whole(0, u64::MAX, "")(value).map(|n| seed = Some(n)),
            "alpha" if fast => number(0.0, 1.0, "")(value).map(|x| options.alpha = x),
            _ => {
                let known = ["iterations", "seed", "alpha"].into_iter().take(if fast { 3 } else { 2 });
                return Err(wrong(OPTION, format!("`{kind}` has no parameter `{key}`"), one_of(key, known)));
            }
        };
        set.map_err(|help| wrong(OPTION, format!("`{key}` cannot be `{value}`"), help))?;
    }
    Ok(How::Offline(options, seed))
}

/// Frames, the node, `overlap_add` if it puts out spectra, and a probe. It runs once.
pub struct Chain {
    engine: Engine,
    frames: Arc<Frames>,
    /// Nodes whose time counts: the node, and `overlap_add`.
    timed: Vec<usize>,
    node: usize,
    probe: usize,
    /// Declared latency, with that of `overlap_add`.
    pub latency: Latency,
}

impl Chain {
    /// Prepares a chain.
    ///
    /// # Errors
    /// See [`Method::play`].
    pub fn new(
        registry: &Registry,
        method: &Method,
        frames: &Arc<Frames>,
        seed: u64,
    ) -> Result<Self, Failure> {
        let refuse = |what: String| Failure::from(Diagnostic::new(what).in_file(&method.label));
        let mut registry = registry.clone();
        registry.add(Arc::new(magnitudes(frames.clone())));
        let rate_hz = frames.layout().rate_hz;
        let graph = graph(method, &registry, rate_hz, seed)?;
        let compiled = compile(&graph, &registry, asperity_graph::Options::default())?;
        let schedule = &compiled.schedule;
        let place = |id: &str| schedule.index_of(id);
        let (Some(node), Some(probe)) = (place(ID), place("out")) else {
            return Err(Failure::Machine("the chain has lost a node".into()));
        };
        match schedule.nodes[probe].inputs.first().and_then(|p| p.port.as_ref()).map(|p| p.shape) {
            Some(Shape::Audio { rate_hz: at }) if at == rate_hz => {}
            Some(Shape::Audio { rate_hz: at }) => {
                return Err(refuse(format!(
                    "this node answers at {at} Hz, and its frames are of {rate_hz} Hz"
                )));
            }
            _ => return Err(refuse("this node does not answer with samples".into())),
        }
        let latency = schedule.latency();
        if latency.ms().abs() > MOST_LATENCY_MS {
            let ms = latency.ms();
            return Err(refuse(format!(
                "this node declares a latency of {ms} ms; at most 10 s are waited for"
            )));
        }
        let timed = [Some(node), place("synthesis")].into_iter().flatten().collect();
        let engine = Engine::new(compiled, Options::default());
        Ok(Self { engine, frames: frames.clone(), timed, node, probe, latency })
    }

    /// The signal of all frames without the declared latency: sample i is sample i of the frames.
    pub fn signal<C: Clock>(&mut self, clock: &C, took: impl FnMut(u64)) -> Vec<f32> {
        let (num, den) = self.latency.as_ratio();
        let rate_hz = i128::from(self.frames.layout().rate_hz);
        let late = (i128::from(num) * rate_hz).div_euclid(i128::from(den)) as i64;
        let early = vec![0.0; late.min(0).unsigned_abs() as usize];
        let mut signal = self.run(early, self.frames.samples() as usize + late.max(0) as usize, clock, took);
        signal.split_off(late.max(0) as usize)
    }

    /// Runs all frames and answers the output of these ticks, whatever latency the node declares.
    pub fn live(&mut self) -> Vec<f32> {
        let count = self.frames.start(self.frames.count() as u64) as usize;
        self.run(Vec::new(), count, &NoClock, |_| {})
    }

    /// Appends samples to a signal until it has this length.
    fn run<C: Clock>(
        &mut self,
        mut signal: Vec<f32>,
        wanted: usize,
        clock: &C,
        mut took: impl FnMut(u64),
    ) -> Vec<f32> {
        let mut spent = vec![0; self.engine.schedule().nodes.len()];
        while signal.len() < wanted {
            spent.fill(0);
            self.engine.tick_timed(clock, &mut spent);
            if let Some(Buffer::Audio { samples, len, .. }) = self.engine.input(self.probe, 0) {
                signal.extend_from_slice(&samples[..*len]);
            }
            if C::TIMES && self.engine.next_tick() <= self.frames.count() as u64 {
                took(self.timed.iter().filter_map(|&i| spent.get(i)).sum());
            }
        }
        signal.truncate(wanted);
        signal
    }
}

fn graph(method: &Method, registry: &Registry, rate_hz: u32, seed: u64) -> Result<GraphFile, Failure> {
    const ORIGIN: &str = "asperity";
    let How::Node(node) = &method.how else {
        let what = format!("`{}` is no node: it needs all frames at once", method.label);
        return Err(Diagnostic::new(what).into());
    };
    let kind = registry.get(&method.kind).map(|k| k.descriptor().clone());
    let Some(ports) = kind.as_ref().and_then(|k| k.retrieval()) else {
        return Err(Failure::Machine(format!("`{}` is gone", method.kind)));
    };
    let mut graph = GraphFile::empty(ORIGIN);
    graph.tick_hz = FRAME_HZ;
    // A node whose output has the graph's rate then has the frames' rate.
    graph.audio_hz = rate_hz;
    graph.seed = seed;
    graph.add_node("frames", MAGNITUDES, &[], ORIGIN)?;
    graph.add_node("out", "probe", &[], ORIGIN)?;
    graph.nodes.push((**node).clone());
    graph.add_wire("frames.magnitude", &format!("{ID}.{}", ports.input), ORIGIN);
    let mut last = format!("{ID}.{}", ports.output);
    if ports.spectrum {
        graph.add_node("synthesis", "overlap_add", &[], ORIGIN)?;
        graph.add_wire(&last, "synthesis.spectrum", ORIGIN);
        last = "synthesis.signal".into();
    }
    graph.add_wire(&last, "out.in", ORIGIN);
    Ok(graph)
}
