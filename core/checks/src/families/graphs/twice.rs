//! A graph beside itself.

use std::sync::Arc;

use crate::buffers::same;
use crate::case::{Found, Not, holds};
use crate::rig::Rig;
use crate::subject::Subject;

/// The first output that differs.
fn differs(a: &Rig, b: &Rig) -> Option<String> {
    let nodes = a.schedule.nodes.iter().enumerate();
    let mut outputs =
        nodes.flat_map(|(i, n)| n.outputs.iter().enumerate().map(move |(o, port)| (i, n, o, port)));
    let differ = |i, o| match (a.engine.output(i, o), b.engine.output(i, o)) {
        (Some(a), Some(b)) => !same(a, b),
        (a, b) => a.is_some() != b.is_some(),
    };
    let (_, node, _, port) = outputs.find(|(i, _, o, _)| differ(*i, *o))?;
    Some(format!("{}.{}", node.id, port.name))
}

pub(super) fn run(subject: &Subject<'_>) -> Found {
    let hz = f64::from(subject.its_graph()?.tick_hz);
    let motion: crate::played::Motion = Arc::new(move |tick| {
        let t = tick as f64 / hz;
        // On and off the surface, slow and fast, here and there.
        [30.0 * (2.0 * t).sin() * t.cos(), 30.0 * t.sin(), 1.0 - 3.0 * (1.3 * t).sin().abs()]
    });
    let rig = || match Rig::new(subject, motion.clone(), &[]) {
        // A graph may play by itself.
        Err(Not::Applicable(_)) => Rig::of(subject, subject.its_graph()?, &[]),
        rig => rig,
    };
    let (mut one, mut other) = (rig()?, rig()?);
    let ticks = one.ticks(subject.by_effort(3.0, 10.0, 120.0));
    one.run(ticks, |one, tick| {
        other.engine.tick();
        match differs(one, &other) {
            Some(output) => Err(Not::Held(format!("`{output}` differs in tick {tick}"))),
            None => Ok(()),
        }
    })?;
    let outputs: usize = one.schedule.nodes.iter().map(|n| n.outputs.len()).sum();
    holds(one.schedule == other.schedule, || "the schedules differ".into())?;
    Ok(format!("{outputs} outputs are the same in each of {ticks} ticks"))
}
