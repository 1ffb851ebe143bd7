//! Calibrations of a simulated actuator whose figures are known.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use asperity_actuator::identify::{Sweep, SweepSettings};
use asperity_actuator::{ActuatorProfile, Quantity};
use asperity_audio::simulated::{Params, Response, Simulated};
use clap::Parser;

use super::{Args, calibrate};
use crate::failure::Failure;
use crate::simulated::Actuator;
use crate::{Cli, Command};

const RATE: f64 = 48_000.0;

/// m_a \[g\], k, c, k_f, and the rest of a HapCoil-One's.
fn actuator([m_a, k, c, k_f]: [f64; 4]) -> Actuator {
    let mut profile = ActuatorProfile::shipped("hapcoil_one").unwrap().unwrap();
    let q = |value| Quantity { value, source: "made up".into(), estimate: false };
    (profile.moving_mass, profile.stiffness) = (q(m_a * 1e-3), q(k));
    (profile.damping, profile.force_factor) = (q(c), q(k_f));
    Actuator::new(profile)
}

/// Noise for a signal-to-noise ratio of 20 dB.
fn noise(quiet: &Actuator, seconds: f64) -> f64 {
    let settings = SweepSettings { to_hz: 1000.0, seconds, ..SweepSettings::default() };
    let sweep = Sweep::new(settings, RATE).unwrap();
    let mut respond = quiet.at(RATE).unwrap();
    let heard = |n| f64::from(respond((sweep.sample(n) / quiet.at_full_scale) as f32)) * quiet.full_scale;
    let power = (0..sweep.samples()).map(heard).map(|x| x * x).sum::<f64>() / sweep.samples() as f64;
    0.1 * power.sqrt()
}

/// A card, ten times as fast as real time, with a response from its first output to its first input.
fn card(name: &str, respond: Response) -> (Simulated, Arc<Mutex<Response>>) {
    let params = Params { frames: vec![64], speed: 10.0, latency_frames: 200, ..Params::default() };
    let card = Simulated::new(name, params).unwrap();
    let plant = Arc::new(Mutex::new(respond));
    let inside = plant.clone();
    card.plant(1, 1, move |x| inside.lock().unwrap()(x));
    (card, plant)
}

fn args(card: &Simulated, dir: &Path, more: &str) -> Args {
    let (id, out) = (card.id(), dir.join("found.ron").display().to_string());
    let fixed =
        ["asperity", "calibrate", "--device", &id, "--out", &out, "--accelerometer-full-scale", "100"];
    let parsed = Cli::try_parse_from(fixed.into_iter().chain(more.split(' '))).unwrap();
    let Command::Calibrate(args) = parsed.command else { panic!("another command") };
    *args
}

/// Why a calibration failed. It has written nothing.
fn reason(outcome: Result<(), Failure>, dir: &Path) -> String {
    assert!(std::fs::read_dir(dir).unwrap().next().is_none());
    outcome.unwrap_err().reason()
}

/// Values of a written profile, and those of the actuator, in the same order.
fn errors(found: &ActuatorProfile, truth: &ActuatorProfile) -> Vec<f64> {
    let values = |p: &ActuatorProfile| p.quantities().map(|(_, q)| q.value);
    values(found).iter().zip(values(truth)).take(4).map(|(a, b)| a / b - 1.0).collect()
}

const ACTUATORS: [([f64; 4], [f64; 2]); 4] = [
    ([4.4, 702.97, 0.629, 1.78], [50.0, 200.0]),
    ([1.0, 400.0, 0.1, 0.5], [50.0, 150.0]),
    ([10.0, 700.0, 0.2, 3.0], [80.0, 160.0]),
    ([20.0, 40_000.0, 2.0, 5.0], [50.0, 200.0]),
];

#[test]
fn two_handles_give_all_four_figures_within_5_percent() {
    for (i, (figures, [first, second])) in ACTUATORS.into_iter().enumerate() {
        let dir = tempfile::tempdir().unwrap();
        let on = |handle_g: f64| {
            let quiet = Actuator { handle_g, seed: 7 + handle_g as u64, ..actuator(figures) };
            Actuator { noise: noise(&quiet, 4.0), ..quiet }
        };
        let (card, plant) = card(&format!("two handles {i}"), on(first).at(RATE).unwrap());
        // The limits of the base are wide enough for all. Its moving mass is another one.
        let masses = format!("--handle-mass-g {first} --second-mass-g {second} --mass-uncertainty 0.2");
        let args = args(&card, dir.path(), &format!("{masses} --seconds 4"));
        let mut change = |grams: f64| {
            *plant.lock().unwrap() = on(grams).at(RATE).unwrap();
            Ok(())
        };
        calibrate(&args, &mut change).unwrap();
        let found = ActuatorProfile::read(&args.out).unwrap();
        let errors = errors(&found, &actuator(figures).profile);
        assert!(errors.iter().all(|e| e.abs() < 0.05), "{figures:?} {errors:?}");
        assert!(!found.moving_mass.estimate && found.moving_mass.source.starts_with("measured"));
    }
}

#[test]
fn unchanged_handle_mass_writes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let (card, _) = card("not changed", actuator(ACTUATORS[0].0).at(RATE).unwrap());
    let args = args(&card, dir.path(), "--handle-mass-g 100 --second-mass-g 50 --seconds 4");
    assert_eq!(reason(calibrate(&args, &mut |_| Ok(())), dir.path()), "exit code 1");
    let stop = || Err(Failure::Machine("Ctrl-C".into()));
    assert_eq!(reason(calibrate(&args, &mut |_| stop()), dir.path()), "Ctrl-C");
}

#[test]
fn clipping_input_stops_sweep_and_writes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let mut respond = actuator(ACTUATORS[0].0).at(RATE).unwrap();
    let heard = Arc::new(AtomicU64::new(0));
    let count = heard.clone();
    // The quiet sweep takes 4 s with its silences. Some seconds into the measurement a wire comes loose.
    let loose = 8 * RATE as u64;
    let plant = move |x| respond(x) + f32::from(u8::from(count.fetch_add(1, Relaxed) > loose));
    let (card, _) = card("clips while measuring", Box::new(plant));
    let args = args(&card, dir.path(), "--handle-mass-g 100 --seconds 100");
    let said = reason(calibrate(&args, &mut |_| Ok(())), dir.path());
    assert!(said.contains("clipped at") && said.contains("was stopped"), "{said}");
    assert!(heard.load(Relaxed) < 50 * RATE as u64, "{}", heard.load(Relaxed));
}

#[test]
fn device_lost_in_sweep_writes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let (card, _) = card("lost", actuator(ACTUATORS[0].0).at(RATE).unwrap());
    let args = args(&card, dir.path(), "--handle-mass-g 100 --seconds 100");
    let card = Arc::new(card);
    let held = card.clone();
    let pull = std::thread::spawn(move || {
        while !held.in_use() {
            std::thread::sleep(Duration::from_millis(5));
        }
        std::thread::sleep(Duration::from_millis(300));
        held.unplug();
    });
    let said = reason(calibrate(&args, &mut |_| Ok(())), dir.path());
    pull.join().unwrap();
    assert!(said.contains("lost before the end") || said.contains("simulated:lost"), "{said}");
}
