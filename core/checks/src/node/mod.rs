//! Cases over one kind of node, built in or from a plugin.
//!
//! The compiler puts the kind into a graph, with a signal at every input and a probe at every output. A case
//! then calls its processor as the engine does, but contains nothing: a value that is not finite is found
//! where it appears. One case runs the same graph in the engine and compares to the bit.
//!
//! The signals are noise, zeros, steps, denormals, values to 1e6 (frames to 1e30), NaN and infinities, and
//! noise with silences of random length and frames that do not come.

mod cost;
mod input;
mod memory;
mod signal;
mod stand;

pub use cost::{TickTime, tick_time};
pub(crate) use signal::{Feed, Signal};
pub(crate) use stand::Place;

use crate::case::{Case, Family, Found, Stop};
use crate::subject::Subject;

/// The place in which most cases put the kind. Only `prepare` fails where there is none.
fn main<'a>(subject: &'a Subject<'_>) -> Result<&'a Place, Stop> {
    subject.its_kind()?;
    subject.main().map_err(|_| Stop::NotApplicable("it cannot be prepared".into()))
}

const NODE: Family = Family("node");
const NO_FAULT: &str = "no fault, and every output is finite";

/// All cases, in the order in which they run: simple ones first.
pub(super) const CASES: &[Case] = &[
    NODE.kinds(
        "descriptor",
        descriptor,
        "names, docs, ranges and defaults of the kind",
        "they are there and agree",
    ),
    NODE.kinds("prepare", prepare, "ordinary rates and types", "it is prepared, and freed again"),
    NODE.kinds("zero", |s| input::on(s, Signal::Zero), "zeros", NO_FAULT),
    NODE.kinds("random", |s| input::on(s, Signal::Random), "noise", NO_FAULT),
    NODE.kinds("steps", |s| input::on(s, Signal::Steps), "steps", NO_FAULT),
    NODE.kinds("denormal", |s| input::on(s, Signal::Denormal), "denormal numbers", NO_FAULT),
    NODE.kinds(
        "huge",
        |s| input::on(s, Signal::Huge).and_then(|_| input::on(s, Signal::Enormous)),
        "values to 1e6, and frames to 1e30",
        NO_FAULT,
    ),
    NODE.kinds(
        "not_finite",
        input::not_finite,
        "NaN, infinities and negative magnitudes",
        "a second later it is finite again, if need be after the engine's reset",
    ),
    NODE.kinds(
        "rates",
        input::rates,
        "tick rates from 100 to 4000 Hz, and audio rates from 8 to 192 kHz",
        "it runs at those that it takes",
    ),
    NODE.kinds("layouts", input::layouts, "every layout of frames", "it runs with those that it takes"),
    NODE.kinds("unconnected", input::unconnected, "optional inputs without a wire", "it runs"),
    NODE.kinds("missing_frames", input::missing_frames, "frames that do not come", NO_FAULT),
    NODE.kinds(
        "outputs",
        input::outputs,
        "the memory of inputs and outputs",
        "it writes whole outputs, says so, and writes nowhere else",
    ),
    NODE.kinds("reset", memory::reset, "a reset after runs of any kind", "it is as a new one"),
    NODE.kinds(
        "determinism",
        memory::determinism,
        "two instances, alone and beside each other",
        "both give the same outputs",
    ),
    NODE.kinds("engine", memory::engine, "the engine, which lets it sleep", "it gives the same outputs"),
    NODE.kinds("sleep", memory::sleep, "120 ticks asleep", "it goes on as its descriptor says"),
    NODE.kinds("cycle", memory::cycle, "a cycle", "it closes the cycle without a fault, and can be reset"),
    NODE.kinds("state", memory::state, "its saved state", "another instance goes on from it"),
    NODE.kinds(
        "garbage_state",
        memory::garbage_state,
        "bytes that are no state",
        "it refuses them, or a reset recovers it",
    ),
    NODE.kinds(
        "live_parameters",
        memory::live_parameters,
        "live parameters that change at any time, within their ranges",
        NO_FAULT,
    ),
    NODE.kinds("random_ticks", input::random_ticks, "many random ticks", NO_FAULT),
    NODE.kinds(
        "allocation",
        cost::allocation,
        "every function that runs in real time",
        "it neither allocates nor frees",
    ),
];

fn descriptor(subject: &Subject<'_>) -> Found {
    let d = subject.its_kind()?.descriptor();
    d.check().map_err(|e| Stop::Failed(e.message))?;
    if !d.sink && d.outputs.is_empty() {
        bail!("it has no outputs and is no sink, so no graph would build it");
    }
    Ok(format!("{} inputs, {} outputs, {} parameters", d.inputs.len(), d.outputs.len(), d.params.len()))
}

fn prepare(subject: &Subject<'_>) -> Found {
    subject.its_kind()?;
    let place = subject.main()?;
    // Twice, and both dropped: each can be freed.
    for _ in 0..2 {
        place.stand(subject, Signal::Random, false)?.node.processor.facts();
    }
    let stand = place.stand(subject, Signal::Random, false)?;
    let (latency, tail) = (stand.node.latency.ms(), stand.node.tail.ms());
    Ok(format!("{}; latency {latency:.3} ms, tail {tail:.1} ms", place.conditions))
}
