//! Every rate there may be, and filters that end, or change while they ring.

mod blocks;
mod changes;
mod hops;
mod rates;
mod tails;

use std::sync::Arc;

use asperity_node::{Descriptor, FrameLayout, FrameRate, RateSpec, Registry, ShapeSpec, Unit, UnitSpec};

use crate::buffers::denormals;
use crate::case::{Case, Family, Not};
use crate::played::{Played, Samples};
use crate::rig::Rig;
use crate::small::{Small, has_to_be_set};

pub(super) const CASES: &[Case] = &[
    Case {
        family: Family::FiltersAndRates,
        name: "rates_of_graph",
        hard: "the graph at other rates than it was made for: ticks from 100 to 4000 a second, every one of them where there is time for it, and audio from 8 to 192 kHz, odd ones among them",
        must: "it runs for 0.25 s, finite, without a fault, with every sample that belongs to a tick; or it is refused with a place in the file, as where a window of 0.1 s would not be whole; at its \
               own rates it runs",
        of_graph: true,
        run: rates::graph,
    },
    Case {
        family: Family::FiltersAndRates,
        name: "rates_of_kinds",
        hard: "every kind that retrieves phase, with overlap-add, resampling, inverse and limiter behind it, at such rates, windows of rate / 10 samples where that is whole",
        must: "it runs for 0.25 s, finite, without a fault, with every sample that belongs to a tick; what is refused says why, at a place",
        of_graph: false,
        run: rates::kinds,
    },
    Case {
        family: Family::FiltersAndRates,
        name: "uneven_hops",
        hard: "frames that begin 88 or 89 samples apart (44.1 kHz at 500 frames/s), and ticks of 0 or 1 samples (2.5 kHz synthesis at 4000 ticks/s)",
        must: "eight tones through every kind that retrieves phase are together as loud as with even hops, within 3 dB, of which the random phases of some take most",
        of_graph: false,
        run: hops::run,
    },
    Case {
        family: Family::FiltersAndRates,
        name: "any_tick_length",
        hard: "the same signal in ticks of 480 samples and of 12, of 44 or 45, of 0 or 1",
        must: "every kind of filter gives the same samples, within 10^-6 of its largest, wherever it says that its latency is the same",
        of_graph: false,
        run: blocks::run,
    },
    Case {
        family: Family::FiltersAndRates,
        name: "tail_of_filters",
        hard: "60 s of silence after noise, through every kind of filter; 8 s in `selftest` unless it is told to take its time",
        must: "no sample is ever denormal, and 5 s behind its declared tail it is silent, to the bit, and stays so",
        of_graph: false,
        run: tails::kinds,
    },
    Case {
        family: Family::FiltersAndRates,
        name: "tail_of_graph",
        hard: "a stylus that stroked for 1 s is lifted and held still for 60 s; for 10 s in `selftest` unless it is told to take its time",
        must: "no value on any wire is ever denormal, and after 6 s nothing is played any more: every sample of every sound card is zero, and stays so",
        of_graph: true,
        run: tails::graph,
    },
    Case {
        family: Family::FiltersAndRates,
        name: "change_while_ringing",
        hard: "every number of every kind of filter, and of `velocity`, changes while a signal of 100 Hz runs through: to either end of its range, and back",
        must: "no step is larger than those of the signals before and after, and of a crossfade between them in 10 ms; half a second later the level is that of a run without a change, within 1 dB, where that has come to one; nothing fails",
        of_graph: false,
        run: changes::run,
    },
];

/// A kind with one signal in and one out.
pub(super) struct Filter {
    pub(super) kind: String,
    /// Of its input.
    unit: Unit,
    /// Whether its input takes audio of any rate, or the graph's alone.
    any_rate: bool,
}

impl Filter {
    /// What plays into it: at a rate of its own, or at the graph's.
    fn source(&self, rate_hz: Option<u32>, samples: Samples) -> Arc<dyn asperity_node::NodeKind> {
        match rate_hz {
            Some(hz) => Played::audio_at("a signal from memory", hz, self.unit.clone(), samples),
            None => Played::audio("a signal from memory", self.unit.clone(), samples),
        }
    }

    /// A graph of it alone.
    fn alone(
        &self,
        (tick_hz, audio_hz): (u32, u32),
        rate_hz: Option<u32>,
        samples: Samples,
        params: &[(&str, &str)],
    ) -> Result<Small, Not> {
        let graph = Small::new(tick_hz, audio_hz)
            .plays("source", self.source(rate_hz, samples))?
            .node("it", &self.kind, params)?
            .node("out", "probe", &[])?;
        Ok(graph.chain(&["source", "it", "out"]))
    }
}

/// Every kind of filter that needs no parameter: one signal in, one out.
pub(super) fn filters(registry: &Registry) -> Vec<Filter> {
    registry.iter().filter_map(|kind| filter(kind.descriptor())).collect()
}

fn filter(d: &Descriptor) -> Option<Filter> {
    let mut required = d.inputs.iter().filter(|i| !i.optional);
    let (Some(input), None, [output]) = (required.next(), required.next(), d.outputs.as_slice()) else {
        return None;
    };
    let sound = |shape: &ShapeSpec| matches!(shape, ShapeSpec::Audio(_) | ShapeSpec::Like(_));
    if !sound(&input.shape) || !sound(&output.shape) || input.limited || has_to_be_set(d, &[]) || d.sink {
        return None;
    }
    let unit = match &input.unit {
        UnitSpec::Is(unit) => unit.clone(),
        UnitSpec::Of { among, .. } => among.first().cloned().unwrap_or(Unit::AMPERE),
    };
    let any_rate = matches!(input.shape, ShapeSpec::Audio(RateSpec::Of(_)) | ShapeSpec::Like(_));
    Some(Filter { kind: d.kind.to_string(), unit, any_rate })
}

/// A kind that retrieves phase.
pub(super) struct Retriever {
    kind: String,
    /// Whether it answers spectra, and an overlap-add follows.
    spectrum: bool,
}

/// Every kind that retrieves phase and needs no parameter.
pub(super) fn retrievers(registry: &Registry) -> Vec<Retriever> {
    let retriever = |d: &Descriptor| {
        let how = d.retrieval().filter(|_| !has_to_be_set(d, &[]))?;
        Some(Retriever { kind: d.kind.to_string(), spectrum: how.spectrum })
    };
    registry.iter().filter_map(|kind| retriever(kind.descriptor())).collect()
}

/// Windows of 0.1 s at a rate that can be parted so, 500 times a second or as often as there are ticks; with how many ticks a frame.
fn windows(rate_hz: u32, tick_hz: u32) -> Option<(FrameLayout, u32)> {
    let every = (tick_hz / 500).max(1);
    let length = rate_hz.is_multiple_of(10).then_some(rate_hz / 10)?;
    let frame_rate = FrameRate::new(tick_hz, every)?;
    Some((FrameLayout { rate_hz, length, bins: (length / 2 + 1).min(101), frame_rate }, every))
}

impl Retriever {
    /// A graph from magnitudes to what drives a coil.
    fn chain(
        &self,
        (tick_hz, audio_hz): (u32, u32),
        (layout, every): (FrameLayout, u32),
        frames: crate::played::Frames,
    ) -> Result<Small, Not> {
        let mut graph = Small::new(tick_hz, audio_hz)
            .plays("magnitudes", Played::magnitudes("magnitudes from memory", layout, frames))?
            .node("phase", &self.kind, &[])?
            .node("audio rate", "resample", &[])?
            .node("inverse", "actuator_inverse", &[])?
            .node("limiter", "limiter", &[])?
            .node("out", "audio_out", &[])?
            .wire("magnitudes", "phase");
        graph.graph.set(&format!("magnitudes.every={every}"), "the case")?;
        let after = if self.spectrum { "overlap" } else { "phase" };
        if self.spectrum {
            graph = graph.node("overlap", "overlap_add", &[])?.wire("phase", "overlap");
        }
        Ok(graph.chain(&[after, "audio rate", "inverse", "limiter", "out"]))
    }
}

/// The first output that holds a denormal number: node and output.
fn first_denormal(rig: &Rig) -> Option<String> {
    let nodes = rig.schedule.nodes.iter().enumerate();
    let mut outputs =
        nodes.flat_map(|(i, n)| n.outputs.iter().enumerate().map(move |(o, port)| (i, n, o, port)));
    let (_, node, _, port) =
        outputs.find(|(i, _, o, _)| rig.engine.output(*i, *o).is_some_and(|b| denormals(b) > 0))?;
    Some(format!("{}.{}", node.id, port.name))
}

/// Noise between -1 and 1, of which every sample follows from its number.
fn noise(seed: u64, n: u64) -> f32 {
    (2.0 * asperity_node::random::uniform(seed, n) - 1.0) as f32
}
