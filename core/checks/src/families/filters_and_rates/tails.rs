//! What is left of a sound when it has ended.

use std::sync::Arc;

use asperity_node::Latency;

use super::{filters, first_denormal, noise};
use crate::case::{Found, Not, holds, not_applicable};
use crate::played::{Motion, Samples};
use crate::rig::Rig;
use crate::subject::Subject;

/// Silence that is listened to \[s\].
const SILENCE_S: f64 = 60.0;
/// Silence that a filter may take beyond its declared tail \[s\]: a first-order high-pass at 2.3 Hz is down to 10^-30 in 5 s.
const FILTER_S: f64 = 5.0;
/// The same of a graph \[s\], with the time its stylus takes to be still by a low-pass of 20 Hz.
const GRAPH_S: f64 = 6.0;
/// How long there is sound before \[s\].
const SOUND_S: f64 = 1.0;

pub(super) fn kinds(subject: &Subject<'_>) -> Found {
    let kinds = filters(subject.registry());
    if kinds.is_empty() {
        return not_applicable("there is no filter");
    }
    let silence = subject.by_effort(8.0, SILENCE_S, SILENCE_S);
    let mut longest = (0.0_f64, String::new());
    for kind in &kinds {
        for rate_hz in [None, Some(2500)] {
            if rate_hz.is_some() && !kind.any_rate {
                continue;
            }
            let end = (SOUND_S * f64::from(rate_hz.unwrap_or(48_000))) as u64;
            let sound: Samples = Arc::new(move |first, out| {
                for (x, n) in out.iter_mut().zip(first..) {
                    *x = if n < end { noise(4, n) } else { 0.0 };
                }
            });
            let mut rig = match kind.alone((500, 48_000), rate_hz, sound, &[])?.rig(subject) {
                Ok(rig) => rig,
                // Any rate that it takes need not be this one.
                Err(_) if rate_hz.is_some() => continue,
                Err(e) => return Err(e.after(&format!("`{}`", kind.kind))),
            };
            let tails = rig.schedule.nodes.iter().map(|n| n.tail);
            let tail = tails.fold(Latency::ZERO, |all, one| all + one).ms().max(0.0) * 1e-3;
            let last =
                last_sound(&mut rig, SOUND_S + silence, |rig| rig.audio("it", 0).iter().any(|x| *x != 0.0))
                    .map_err(|e| e.after(&format!("`{}`", kind.kind)))?;
            let after = last - SOUND_S - tail;
            holds(after <= FILTER_S, || {
                format!(
                    "`{}` is not silent until {after:.2} s after the end and its tail of {tail:.3} s",
                    kind.kind
                )
            })?;
            if after > longest.0 {
                longest = (after, kind.kind.clone());
            }
        }
    }
    Ok(format!("{} kinds; the last, `{}`, is silent after {:.2} s", kinds.len(), longest.1, longest.0))
}

/// When something was heard last \[s\].
fn last_sound(rig: &mut Rig, seconds: f64, mut sounds: impl FnMut(&Rig) -> bool) -> Result<f64, Not> {
    let (mut last, mut wrong) = (0, None);
    let ticks = rig.ticks(seconds);
    let ran = rig.run(ticks, |rig, tick| {
        if let Some(output) = first_denormal(rig) {
            wrong.get_or_insert(format!("`{output}` is denormal in tick {tick}"));
        }
        if sounds(rig) {
            last = tick + 1;
        }
        Ok(())
    });
    let faults = rig.engine.faults();
    match (wrong, ran.is_ok() && faults == 0) {
        (Some(wrong), _) => Err(wrong.into()),
        (None, false) => Err(format!("{faults} faults").into()),
        (None, true) => Ok(last as f64 / f64::from(rig.schedule.tick_hz)),
    }
}

pub(super) fn graph(subject: &Subject<'_>) -> Found {
    let hz = f64::from(subject.its_graph()?.tick_hz);
    let until = (SOUND_S * hz) as u64;
    let stroke = |touches: bool| -> Motion {
        Arc::new(move |tick| {
            let turn = 3.0 * tick.min(until) as f64 / hz;
            let z = if touches && tick < until { -1.0 } else { 100.0 };
            [20.0 * turn.cos(), 20.0 * turn.sin(), z]
        })
    };
    let played = |rig: &Rig| rig.drive().flatten().any(|x| *x != 0.0);
    let mut never = Rig::new(subject, stroke(false), &[])?;
    if !never.drives() {
        return not_applicable("nothing in this graph plays on a sound card");
    }
    if last_sound(&mut never, 2.0, played)? > 0.0 {
        return not_applicable("this graph plays without being touched");
    }
    let mut rig = Rig::new(subject, stroke(true), &[])?;
    let silence = subject.by_effort(10.0, SILENCE_S, SILENCE_S);
    let last = last_sound(&mut rig, SOUND_S + silence, played)?;
    holds(last - SOUND_S <= GRAPH_S, || format!("something is played until {:.2} s after", last - SOUND_S))?;
    if last == 0.0 {
        return not_applicable("nothing was played while the stylus stroked");
    }
    Ok(format!(
        "silent {:.2} s after the stylus is lifted, for the rest of {silence} s; nothing denormal",
        last - SOUND_S
    ))
}
