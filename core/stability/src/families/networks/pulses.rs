//! Whether a texture pulses where nothing changes.

use std::sync::Arc;

use asperity_measure::accuracy::rhythm::Rhythm;
use asperity_world::material::{Library, LibraryMaterial};

use super::beside::{motion, networks, sounds};
use crate::case::{Found, Not, holds};
use crate::played::Motion;
use crate::rig::Rig;
use crate::subject::Subject;

/// Radius of the circle in mm: so large that a direction lasts longer than a pulse.
const RADIUS_MM: f64 = 30.0;
/// How deep the stylus is \[mm\].
const DEPTH_MM: f64 = 2.0;
/// What settles before anything is measured \[s\].
const SETTLE_S: f64 = 0.5;
/// How much more of the envelope may repeat than of noise of the same spectrum and length.
const MORE_REPETITION: f64 = 0.25;
/// How many times as deep as that noise's the modulation from 15 to 25 Hz may be: single grains of a coarse
/// sandpaper make it twice as deep.
const MORE_MODULATION: f64 = 2.5;

/// Bumps whose distances vary by less than this part come evenly along the way: their rhythm is the surface's.
const EVEN: f64 = 0.25;
/// Bumps farther apart than this in mm are met one by one, as the pores of wood. They pulse by right, but not
/// twice after the same time.
const SINGLE_MM: f64 = 0.4;

/// A material that is set.
struct Setting {
    name: String,
    changes: Vec<String>,
    /// Whether its bumps are met one by one.
    single: bool,
}

pub(super) fn pulses(subject: &Subject<'_>) -> Found {
    let seconds = subject.by_effort(2.0, 3.0, 8.0);
    let (mut worst, mut count) = ((0.0_f64, 0.0_f64), 0);
    for Setting { name, changes, single } in &settings(subject)? {
        for (speed, motion) in strokes(subject)? {
            let about = format!("{name} at {speed} mm/s");
            let ours = rhythm(subject, &motion, changes, seconds).map_err(|e| e.after(&about))?;
            let Some((ours, noise)) = ours else { continue };
            let more = ours.envelope_repetition - noise.envelope_repetition;
            let times = if *single { 0.0 } else { ours.pulses() / noise.pulses() };
            holds(more <= MORE_REPETITION && times <= MORE_MODULATION, || {
                format!(
                    "{about}: the envelope repeats by {:.2}, that of noise by {:.2}; it is modulated by {:.2} from 15 to 25 Hz, noise by {:.2}",
                    ours.envelope_repetition,
                    noise.envelope_repetition,
                    ours.pulses(),
                    noise.pulses()
                )
            })?;
            worst = (worst.0.max(more), worst.1.max(times));
            count += 1;
        }
    }
    Ok(format!(
        "{count} strokes of {seconds} s: the envelope repeats by at most {:.2} more than that of noise, and is modulated {:.1} times as deep",
        worst.0, worst.1
    ))
}

/// Rhythm of the acceleration, and of noise of its spectrum; none where nothing sounds.
fn rhythm(
    subject: &Subject<'_>,
    motion: &Motion,
    changes: &[String],
    seconds: f64,
) -> Result<Option<(Rhythm, Rhythm)>, Not> {
    let changes: Vec<&str> = changes.iter().map(String::as_str).collect();
    let mut rig = Rig::new(subject, motion.clone(), &changes)?;
    let (settle, ticks) = (rig.ticks(SETTLE_S), rig.ticks(seconds));
    rig.run(settle, |_, _| Ok(()))?;
    let mut signal = Vec::new();
    rig.run(ticks, |rig, _| {
        signal.extend(rig.felt().iter().map(|x| f64::from(*x)));
        Ok(())
    })?;
    let rate_hz = f64::from(rig.schedule.audio_hz);
    let wrong = |e: asperity_measure::accuracy::AccuracyError| Not::Held(e.to_string());
    let ours = Rhythm::new(&[&signal], rate_hz).map_err(wrong)?;
    if ours.rms < 1e-6 {
        return Ok(None);
    }
    Ok(Some((ours, Rhythm::of_noise_like(&[&signal], rate_hz).map_err(wrong)?)))
}

/// Strokes of constant speed, with it in mm/s: wide circles on a floor, else where the network sounds.
fn strokes(subject: &Subject<'_>) -> Result<Vec<(f64, Motion)>, Not> {
    let hz = f64::from(subject.its_graph()?.tick_hz);
    let circle = move |speed: f64| -> Motion {
        Arc::new(move |tick| {
            let (sin, cos) = (speed * tick as f64 / hz / RADIUS_MM).sin_cos();
            [RADIUS_MM * cos, RADIUS_MM * sin, -DEPTH_MM]
        })
    };
    if sounds(&mut Rig::new(subject, circle(80.0), &[])?)? {
        let speeds: &[f64] = subject.by_effort(&[80.0], &[60.0, 160.0], &[40.0, 80.0, 160.0, 280.0]);
        return Ok(speeds.iter().map(|speed| (*speed, circle(*speed))).collect());
    }
    Ok(vec![(60.0, motion(subject)?)])
}

/// The materials to be set: the first ones of the families in the library that repeat with no place. What
/// repeats with place does so by right. Where nothing can be set, the graph as it is.
fn settings(subject: &Subject<'_>) -> Result<Vec<Setting>, Not> {
    let schedule = subject.compiled(subject.its_graph()?, &[])?.schedule;
    let most = subject.by_effort(2, 4, 100);
    let mut all: Vec<Setting> = Vec::new();
    for i in networks(&schedule) {
        let node = &schedule.nodes[i];
        let has = |name: &str| node.params.get(name).is_some();
        if !has("library") || !has("material") || node.params.is_set("materials") {
            continue;
        }
        let library = Library::shared(node.params.file("library"))?;
        let mut families = Vec::new();
        let random = |m: &&LibraryMaterial| {
            m.pattern.waves.is_empty() && m.pattern.events.is_none_or(|e| e.interval_cv >= EVEN)
        };
        for material in library.materials().iter().filter(random) {
            if all.len() < most && !families.contains(&&material.family) {
                families.push(&material.family);
                all.push(Setting {
                    name: material.name.clone(),
                    changes: vec![format!("{}.material={}", node.id, material.name)],
                    single: material.pattern.events.is_some_and(|e| e.spacing_mm > Some(SINGLE_MM)),
                });
            }
        }
    }
    if all.is_empty() {
        all.push(Setting { name: "the graph".into(), changes: Vec::new(), single: false });
    }
    Ok(all)
}
