//! Whether a texture pulses where nothing changes.

use std::sync::Arc;

use asperity_accuracy::accuracy::AccuracyError;
use asperity_accuracy::accuracy::rhythm::{Rhythm, envelope_likeness};
use asperity_texture::{Library, LibraryMaterial};

use super::{motion, networks, sounds};
use crate::case::{Figures, Found, Stop, not_applicable};
use crate::played::Motion;
use crate::rig::Rig;
use crate::subject::Subject;

/// Radius of the circle \[mm\]: so large that a direction lasts longer than a pulse.
const RADIUS_MM: f64 = 30.0;
/// Depth of the stylus \[mm\].
const DEPTH_MM: f64 = 2.0;
/// Time to settle before a measurement \[s\].
const SETTLE_S: f64 = 0.5;
/// Allowed repetition of the envelope beyond that of noise of the same spectrum and length.
const MORE_REPETITION: f64 = 0.25;
/// Allowed modulation from 15 to 25 Hz, as a multiple of that noise's: single grains of a coarse sandpaper
/// make it twice as deep.
const MORE_MODULATION: f64 = 2.5;

/// Rms below which nothing sounds \[m/s^2\].
const SILENT_M_S2: f64 = 1e-6;
/// Bumps whose distances vary by less than this part are regular: their rhythm is the surface's.
const EVEN: f64 = 0.25;
/// Distance from which on bumps are met one by one, as the pores of wood \[mm\]. They may pulse, but not
/// twice after the same time.
const SINGLE_MM: f64 = 0.4;

/// Speeds at which a repetition with place has other lags \[mm/s\]. Their ratios are not simple, so that few
/// lags are multiples at all of them.
const SPEEDS_MM_S: [f64; 3] = [60.0, 82.4, 131.0];

/// A material of the graph.
struct Setting {
    name: String,
    changes: Vec<String>,
    /// Whether its bumps are met one by one.
    single: bool,
    /// Whether it repeats with place.
    periodic: bool,
}

pub(super) fn pulses(subject: &Subject<'_>) -> Found {
    let seconds = subject.by_effort(2.0, 3.0, 8.0);
    let (mut figures, mut count) = (Figures::default(), 0);
    for Setting { name, changes, single, periodic } in &settings(subject)? {
        if *periodic {
            let Some((lag_s, more)) = same_at_all_speeds(subject, changes, seconds)? else { continue };
            let same =
                figures.at_most(more, MORE_REPETITION, "more repetition than of noise at all speeds alike");
            same.map_err(|e| {
                e.after(&format!("{name}, after {:.0} ms at {SPEEDS_MM_S:?} mm/s alike", 1e3 * lag_s))
            })?;
            count += SPEEDS_MM_S.len();
            continue;
        }
        for (speed, motion) in strokes(subject)? {
            let heard = signal(subject, &motion, changes, seconds).and_then(|(signal, rate_hz)| {
                let (ours, noise) = rhythms(&signal, rate_hz).map_err(wrong)?;
                if ours.rms < SILENT_M_S2 {
                    return Ok(0);
                }
                let [repeats, usual] = [&ours, &noise].map(|it| it.envelope_repetition);
                figures.at_most(repeats - usual, MORE_REPETITION, "more repetition than of noise")?;
                let times = if *single { 0.0 } else { ours.pulses() / noise.pulses() };
                figures.at_most(times, MORE_MODULATION, "times the modulation of noise from 15 to 25 Hz")?;
                Ok(1)
            });
            count += heard.map_err(|e| e.after(&format!("{name} at {speed} mm/s")))?;
        }
    }
    if count == 0 {
        return not_applicable("no stroke sounds");
    }
    Ok(format!("{count} strokes of {seconds} s: {figures}"))
}

/// The lag at which the envelope repeats most at all speeds alike, and by how much more than that of noise. A
/// repetition with place has another lag at each speed. None where nothing sounds.
fn same_at_all_speeds(
    subject: &Subject<'_>,
    changes: &[String],
    seconds: f64,
) -> Result<Option<(f64, f64)>, Stop> {
    let mut least: Vec<(f64, f64)> = Vec::new();
    for speed in SPEEDS_MM_S {
        let (signal, rate_hz) = signal(subject, &circle(subject, speed)?, changes, seconds)?;
        let (ours, noise) = rhythms(&signal, rate_hz).map_err(wrong)?;
        if ours.rms < SILENT_M_S2 {
            return Ok(None);
        }
        let found = envelope_likeness(&[&signal], rate_hz).map_err(wrong)?;
        let more = found.into_iter().map(|(lag, r)| (lag, r - noise.envelope_repetition));
        if least.is_empty() {
            least.extend(more);
        } else {
            least.iter_mut().zip(more).for_each(|(least, (_, more))| least.1 = least.1.min(more));
        }
    }
    Ok(least.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)))
}

fn wrong(e: AccuracyError) -> Stop {
    Stop::Failed(e.to_string())
}

/// Rhythm of a signal, and of noise of its spectrum.
fn rhythms(signal: &[f64], rate_hz: f64) -> Result<(Rhythm, Rhythm), AccuracyError> {
    Ok((Rhythm::new(&[signal], rate_hz)?, Rhythm::of_noise_like(&[signal], rate_hz)?))
}

/// The acceleration of a motion that has settled, and its rate \[Hz\].
fn signal(
    subject: &Subject<'_>,
    motion: &Motion,
    changes: &[String],
    seconds: f64,
) -> Result<(Vec<f64>, f64), Stop> {
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
    Ok((signal, rate_hz))
}

/// Strokes of constant speed \[mm/s\]: wide circles on a floor, else a circle at which the network sounds.
fn strokes(subject: &Subject<'_>) -> Result<Vec<(f64, Motion)>, Stop> {
    if sounds(&mut Rig::new(subject, circle(subject, 80.0)?, &[])?)? {
        let speeds: &[f64] = subject.by_effort(&[80.0], &[60.0, 160.0], &[40.0, 80.0, 160.0, 280.0]);
        return speeds.iter().map(|speed| Ok((*speed, circle(subject, *speed)?))).collect();
    }
    Ok(vec![(60.0, motion(subject)?)])
}

/// A wide circle on a floor at a speed \[mm/s\].
fn circle(subject: &Subject<'_>, speed: f64) -> Result<Motion, Stop> {
    let hz = f64::from(subject.its_graph()?.tick_hz);
    Ok(Arc::new(move |tick| {
        let (sin, cos) = (speed * tick as f64 / hz / RADIUS_MM).sin_cos();
        [RADIUS_MM * cos, RADIUS_MM * sin, -DEPTH_MM]
    }))
}

/// The first material of each family in the library, both of those that repeat with place and of the others.
/// The graph as it is where it has no library.
fn settings(subject: &Subject<'_>) -> Result<Vec<Setting>, Stop> {
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
        let periodic = |m: &LibraryMaterial| {
            !m.pattern.waves.is_empty() || m.pattern.events.is_some_and(|e| e.interval_cv < EVEN)
        };
        for kind in [false, true] {
            let mut families = Vec::new();
            for material in library.materials().iter().filter(|m| periodic(m) == kind) {
                if families.len() < most && !families.contains(&&material.family) {
                    families.push(&material.family);
                    all.push(Setting {
                        name: material.name.clone(),
                        changes: vec![format!("{}.material={}", node.id, material.name)],
                        single: material.pattern.events.is_some_and(|e| e.spacing_mm > Some(SINGLE_MM)),
                        periodic: kind,
                    });
                }
            }
        }
    }
    if all.is_empty() {
        all.push(Setting { name: "the graph".into(), changes: Vec::new(), single: false, periodic: false });
    }
    Ok(all)
}
