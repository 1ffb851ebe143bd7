//! What a graph sends to its own actuator at its wildest.

use std::sync::Arc;

use asperity_actuator::Drive;
use asperity_node::random::uniform;
use asperity_node::{NodeKind, ShapeSpec};

use super::judge::{Judge, Promise};
use super::named;
use crate::case::{Found, Not, holds, not_applicable};
use crate::rig::Rig;
use crate::subject::Subject;
use crate::wrap;

/// Where the stylus is thrown: a second each of strokes at up to 1.5 m/s, jumps to anywhere in every tick, taps at 20 Hz, and a hand that lifts.
fn thrown(hz: f64) -> crate::played::Motion {
    Arc::new(move |tick| {
        let t = tick as f64 / hz;
        let any = |which: u64| 2.0 * uniform(which, tick) - 1.0;
        match tick / hz as u64 % 4 {
            0 => [50.0 * (30.0 * t).sin(), 50.0 * (17.0 * t).cos(), -3.0 + 3.0 * (5.0 * t).sin()],
            1 => [60.0 * any(1), 60.0 * any(2), 10.0 * any(3) - 4.0],
            2 => [20.0 * t, 3.0, 4.0 * (125.7 * t).sin()],
            _ => [40.0 * t.sin(), 40.0 * t.cos(), 20.0 * any(4)],
        }
    })
}

/// A kind whose frames are of numbers that mean nothing.
fn spoiled(kind: Arc<dyn NodeKind>) -> Arc<dyn NodeKind> {
    wrap::after(kind, |tick| {
        let index = tick.index;
        for buffer in tick.outputs.buffers() {
            if let asperity_node::Buffer::Magnitude { bins, frame: Some(_), .. } = buffer {
                // Every seventh is nothing at all, so that the next comes out of silence.
                let level = if index % 7 == 0 { 0.0 } else { 10_f64.powf(9.0 * uniform(5, index) - 3.0) };
                for (i, bin) in bins.iter_mut().enumerate() {
                    *bin = (level * uniform(6, 4096 * index + i as u64)) as f32;
                }
            }
        }
    })
}

pub(super) fn limits(subject: &Subject<'_>) -> Found {
    let graph = subject.its_graph()?;
    let hz = f64::from(graph.tick_hz);
    let asks = |kind: &&Arc<dyn NodeKind>| {
        let d = kind.descriptor();
        let frames = d.outputs.iter().any(|o| matches!(o.shape, ShapeSpec::Magnitude(_)));
        frames && graph.nodes.iter().any(|n| n.kind == d.kind)
    };
    let networks: Vec<Arc<dyn NodeKind>> = subject.registry().iter().filter(asks).cloned().collect();
    let mut worse = subject.clone();
    for kind in &networks {
        worse = worse.with(spoiled(kind.clone()));
    }
    let mut found = Vec::new();
    let runs = if networks.is_empty() {
        vec![("as it is", subject)]
    } else {
        vec![("as it is", subject), ("nonsense", &worse)]
    };
    for (name, subject) in runs {
        let mut rig = match Rig::new(subject, thrown(hz), &[]) {
            // A graph may play by itself.
            Err(Not::Applicable(_)) => Rig::of(subject, graph, &[])?,
            rig => rig?,
        };
        let mut judges = judges(&rig)?;
        let ticks = rig.ticks(subject.by_effort(4.0, 12.0, 300.0));
        rig.run(ticks, |rig, tick| {
            for (judge, samples) in judges.iter_mut().zip(rig.drive()) {
                for y in samples {
                    judge.see(*y).map_err(|wrong| format!("{wrong}, tick {tick}, {name}"))?;
                }
            }
            Ok(())
        })?;
        for judge in &judges {
            judge.verdict().map_err(|wrong| format!("{wrong}, {name}"))?;
        }
        let faults = rig.engine.faults();
        holds(faults == 0, || format!("{faults} faults, {name}"))?;
        let most = |of: fn(&Judge) -> f64| judges.iter().map(of).fold(0.0, f64::max);
        found.push(format!(
            "{name}: {:.3} of the peak, {:.3} of the stroke, {:.3} of the rated current",
            most(|j| j.largest / j.peak()),
            most(Judge::stroke),
            most(Judge::rms)
        ));
    }
    Ok(found.join("; "))
}

/// A judge for each sound card, by what stands before it.
fn judges(rig: &Rig) -> Result<Vec<Judge>, Not> {
    let mut all = Vec::new();
    for out in rig.schedule.nodes.iter().filter(|n| n.kind == "audio_out") {
        let Some(input) = out.inputs.first() else { continue };
        let (Some((from, _)), Some(port)) = (input.from, &input.port) else { continue };
        let limiter = &rig.schedule.nodes[from];
        let Some(dynamics) = named(&limiter.params) else {
            return not_applicable(format!("`{}` does not say of which actuator it is", limiter.id));
        };
        let drive = if port.unit.symbol() == "V" { Drive::Voltage } else { Drive::Current };
        // Where the corner may be changed, and the mean is bounded over a time that is given, is the matter of another case.
        let promise = Promise { slew_hz: limiter.params.get_number("slew_hz"), dc_corner_hz: None };
        all.push(Judge::new(dynamics?, drive, f64::from(rig.schedule.audio_hz), promise));
    }
    if all.is_empty() { not_applicable("nothing in this graph plays on a sound card") } else { Ok(all) }
}
