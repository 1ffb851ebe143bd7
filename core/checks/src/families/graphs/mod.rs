//! Graphs of any shape, and a graph beside itself.

mod drawn;

pub use drawn::{Became, Drawn, drawn};

use std::sync::Arc;

use crate::buffers::same;
use crate::case::{Case, Family, Found};
use crate::played::Motion;
use crate::rig::Rig;
use crate::subject::Subject;

const GRAPHS: Family = Family("graphs");

pub(super) const CASES: &[Case] = &[
    GRAPHS.kinds(
        "random_graphs",
        drawn::run,
        "random graphs of up to 40 nodes of any kinds. Most parameters and wires fit, some do not",
        "a graph that loads runs for 60 ticks, finite and without a fault, except numbers beyond all \
         bounds in a loop, which are contained. A graph that does not load is refused with a reason and a \
         place in its file",
    ),
    GRAPHS.graph(
        "same_bytes",
        same_bytes,
        "the graph is compiled and run twice, tick by tick side by side",
        "every output of every node is the same in every tick, to the bit",
    ),
];

/// The first output that differs.
fn differs(a: &Rig, b: &Rig) -> Option<String> {
    let differ = |i, o| match (a.engine.output(i, o), b.engine.output(i, o)) {
        (Some(a), Some(b)) => !same(a, b),
        (a, b) => a.is_some() != b.is_some(),
    };
    a.outputs().find(|(i, o)| differ(*i, *o)).map(|(i, o)| a.name(i, o))
}

fn same_bytes(subject: &Subject<'_>) -> Found {
    let hz = f64::from(subject.its_graph()?.tick_hz);
    let motion: Motion = Arc::new(move |tick| {
        let t = tick as f64 / hz;
        // On and off the surface, slow and fast, here and there.
        [30.0 * (2.0 * t).sin() * t.cos(), 30.0 * t.sin(), 1.0 - 3.0 * (1.3 * t).sin().abs()]
    });
    let rig = || Rig::moved_if_possible(subject, motion.clone());
    let (mut one, mut other) = (rig()?, rig()?);
    let ticks = one.ticks(subject.by_effort(3.0, 10.0, 120.0));
    one.run(ticks, |one, tick| {
        other.engine.tick();
        match differs(one, &other) {
            Some(output) => bail!("`{output}` differs in tick {tick}"),
            None => Ok(()),
        }
    })?;
    let outputs: usize = one.schedule.nodes.iter().map(|n| n.outputs.len()).sum();
    ensure!(one.schedule == other.schedule, "the schedules differ");
    Ok(format!("{outputs} outputs are the same in each of {ticks} ticks"))
}
