//! The same signal in ticks of other lengths.

use std::sync::Arc;

use asperity_node::Latency;

use super::{filters, noise};
use crate::case::{Found, Not, holds, not_applicable};
use crate::played::Samples;
use crate::rig::Rig;
use crate::subject::Subject;

/// Ticks a second: of 96 samples at 48 kHz, which all others are held against; of 480, 12, 19 or 20, 144 or 145, 48 or 49.
const TICKS_HZ: [u32; 6] = [500, 100, 4000, 2500, 333, 997];

/// What a graph makes of so many samples.
fn heard(rig: &mut Rig, samples: usize) -> Result<Vec<f32>, Not> {
    let mut out = Vec::with_capacity(samples + 2000);
    while out.len() < samples {
        let before = rig.engine.next_tick();
        rig.run(1, |rig, _| {
            out.extend_from_slice(rig.audio("it", 0));
            Ok(())
        })?;
        holds(before < 1_000_000, || "it puts nothing out".into())?;
    }
    holds(rig.engine.faults() == 0, || format!("{} faults", rig.engine.faults()))?;
    out.truncate(samples);
    Ok(out)
}

pub(super) fn run(subject: &Subject<'_>) -> Found {
    let kinds = filters(subject.registry());
    let (mut compared, mut worst) = (0, 0.0_f64);
    // Loud, then a pause, then quiet: what limits and what sleeps have something to do.
    let sound: Samples = Arc::new(|first, out| {
        for (x, n) in out.iter_mut().zip(first..) {
            *x = noise(3, n) * [2.0, 0.0, 0.1][(n / 7001 % 3) as usize];
        }
    });
    for kind in &kinds {
        for (rate_hz, audio_hz) in
            [(None, 48_000), (None, 44_100), (Some(2500), 48_000), (Some(4410), 44_100)]
        {
            if rate_hz.is_some() && !kind.any_rate {
                continue;
            }
            // One that must wait longer where a tick does not hold all it needs says so by its latency.
            let mut known: Vec<(Latency, Vec<f32>)> = Vec::new();
            for tick_hz in TICKS_HZ {
                let graph = kind.alone((tick_hz, audio_hz), rate_hz, sound.clone(), &[])?;
                // What is refused at a rate is the matter of another case.
                let place = || format!("`{}`, {tick_hz} ticks/s, {:?} Hz of {audio_hz}", kind.kind, rate_hz);
                let mut rig = match graph.rig(subject) {
                    Ok(rig) => rig,
                    Err(_) if rate_hz.is_some() || tick_hz != TICKS_HZ[0] => continue,
                    Err(e) => return Err(e.after(&place())),
                };
                // At the rate of what comes out.
                let node = rig.schedule.index_of("it").unwrap_or(0);
                let port = rig.schedule.nodes[node].outputs.first().map(|o| o.port.shape);
                let Some(asperity_node::Shape::Audio { rate_hz: out_hz }) = port else { continue };
                let samples = (subject.by_effort(0.4, 1.0, 10.0) * f64::from(out_hz)) as usize;
                let now = heard(&mut rig, samples).map_err(|e| e.after(&place()))?;
                let latency = rig.schedule.nodes[node].latency;
                let Some((_, first)) = known.iter().find(|(l, _)| *l == latency) else {
                    known.push((latency, now));
                    continue;
                };
                let largest = first.iter().fold(0.0_f32, |m, x| m.max(x.abs())).max(1e-12);
                let off = first.iter().zip(&now).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / largest;
                holds(off <= 1e-6, || format!("{}: {off:.1e} of its largest sample off", place()))?;
                (compared, worst) = (compared + 1, worst.max(f64::from(off)));
            }
        }
    }
    if compared == 0 {
        return not_applicable("there is no filter");
    }
    Ok(format!(
        "{} kinds, compared {compared} times: at most {worst:.0e} of the largest sample off",
        kinds.len()
    ))
}
