use super::*;
use crate::topography::{Family, envelope, made_surfaces};
use std::f64::consts::TAU;

const GRID: (usize, f64) = (1024, 0.04);

fn surface(name: &str) -> (HeightField, Contact) {
    let made = made_surfaces().into_iter().find(|s| s.name == name).expect("a surface");
    (envelope(&made.patch(GRID, 1), Tool::PEN.tip_mm), made.contact)
}

/// Accelerations of a steady stroke along a way, after half a second of coming to it.
fn stroke(
    (envelope, contact): &(HeightField, Contact),
    (speed, angle): (f64, f64),
    force_n: f64,
    seconds: f64,
    steps: u32,
) -> Vec<Acceleration> {
    let mut stylus = Stylus::new(Tool::PEN, envelope, *contact, [1.0, 2.0], force_n).with_steps(steps);
    let moment = Moment { velocity_mm_s: [speed * angle.cos(), speed * angle.sin()], force_n };
    let samples = |seconds: f64| (seconds * f64::from(SAMPLE_HZ)) as usize;
    (0..samples(0.5)).for_each(|_| {
        stylus.next(&moment);
    });
    (0..samples(seconds)).map(|_| stylus.next(&moment)).collect()
}

/// Power of a frequency in a signal, by a plain sum under a Hann window.
fn power(x: &[f64], hz: f64) -> f64 {
    let (mut re, mut im) = (0.0, 0.0);
    for (i, x) in x.iter().enumerate() {
        let window = 0.5 - 0.5 * (TAU * i as f64 / 1_000.0).cos();
        let (sin, cos) = (TAU * hz * i as f64 / f64::from(SAMPLE_HZ)).sin_cos();
        re += window * x * cos;
        im += window * x * sin;
    }
    re * re + im * im
}

/// Mean power of bins of 10 Hz from 10 to 1000 Hz, over windows of 0.1 s half a window apart.
fn spectrum(x: &[f64]) -> Vec<f64> {
    let frames: Vec<&[f64]> = x.windows(1_000).step_by(500).collect();
    let mean =
        |bin: usize| frames.iter().map(|f| power(f, 10.0 * bin as f64)).sum::<f64>() / frames.len() as f64;
    (1..=100).map(mean).collect()
}

fn rms(x: impl Iterator<Item = f64> + Clone) -> f64 {
    (x.clone().map(|x| x * x).sum::<f64>() / x.count() as f64).sqrt()
}

#[test]
fn a_grating_sounds_at_speed_over_wavelength() {
    for (name, speed, force) in [("sine grating 1 mm", 100.0, 0.5), ("square grating 2 mm", 150.0, 1.0)] {
        let surface = surface(name);
        let period = GRID.0 as f64 * GRID.1
            / (GRID.0 as f64 * GRID.1 / name.split(' ').nth(2).unwrap_or("1").parse::<f64>().unwrap_or(1.0))
                .round();
        let x: Vec<f64> =
            stroke(&surface, (speed, 0.0), force, 1.0, STEPS).iter().map(|a| a.normal).collect();
        let spectrum = spectrum(&x);
        let want = speed / period;
        // The pitch or a multiple of it: sharp ridges have many.
        let peak = (0..100).max_by(|a, b| spectrum[*a].total_cmp(&spectrum[*b])).expect("bins");
        let hz = 10.0 * (peak + 1) as f64;
        let multiple = (hz / want).round().max(1.0);
        assert!((hz - multiple * want).abs() <= 10.0, "{name}: {hz} Hz, not {want}");
        let (at, beside) = (power(&x[..1_000], want), power(&x[..1_000], 1.5 * want));
        assert!(at > 10.0 * beside, "{name}: {at} {beside}");
    }
}

#[test]
fn level_rises_with_speed_and_with_force() {
    for name in ["sandpaper P80", "canvas", "dashboard grain", "oak", "watercolour paper"] {
        let surface = surface(name);
        let level = |speed: f64, force: f64| {
            let x = stroke(&surface, (speed, 0.3), force, 1.0, STEPS);
            (rms(x.iter().map(|a| a.normal)).powi(2) + rms(x.iter().map(|a| a.along)).powi(2)).sqrt()
        };
        let slow_fast = [40.0, 80.0, 160.0].map(|v| level(v, 0.7));
        let light_firm = [0.3, 0.8, 2.0].map(|f| level(80.0, f));
        println!("{name}: by speed {slow_fast:.2?}, by force {light_firm:.2?}");
        assert!(slow_fast.windows(2).all(|w| w[1] > 1.1 * w[0]), "{name}: {slow_fast:?}");
        assert!(light_firm[2] > light_firm[0], "{name}: {light_firm:?}");
    }
}

#[test]
fn what_the_hand_puts_in_is_stored_or_lost() {
    for name in ["sandpaper P60", "square grating 2 mm", "upholstery foam", "float glass"] {
        let (envelope, contact) = surface(name);
        let mut stylus =
            Stylus::new(Tool::PEN, &envelope, contact, [1.0, 2.0], 1.0).with_still_hand().with_steps(16);
        let moment = Moment { velocity_mm_s: [70.0, 20.0], force_n: 1.0 };
        let began = stylus.energy(1.0);
        for _ in 0..SAMPLE_HZ {
            stylus.next(&moment);
        }
        let ended = stylus.energy(1.0);
        let (put_in, lost) = (ended.drag, ended.lost);
        let off = put_in - lost - (ended.stored - began.stored);
        println!("{name}: {put_in:.5} J in, {lost:.5} J lost, {off:.6} J off");
        assert!(put_in > 0.0 && lost > 0.0 && off.abs() < 0.02 * put_in, "{name}: {off} of {put_in} J");
    }
}

#[test]
fn halving_the_step_changes_no_band_of_the_spectrum_by_half_a_decibel() {
    for name in ["sandpaper P120", "sine grating 1 mm", "brushed aluminium", "loop pile"] {
        let surface = surface(name);
        let bands = |steps: u32| -> Vec<f64> {
            let x = stroke(&surface, (90.0, 0.2), 0.8, 2.0, steps);
            let (normal, along): (Vec<f64>, Vec<f64>) = x.iter().map(|a| (a.normal, a.along)).unzip();
            let both: Vec<f64> = spectrum(&normal).iter().zip(spectrum(&along)).map(|(a, b)| a + b).collect();
            both.chunks(10).map(|b| b.iter().sum()).collect()
        };
        let (coarse, fine) = (bands(STEPS), bands(2 * STEPS));
        let loudest = coarse.iter().copied().fold(0.0, f64::max);
        let off: Vec<f64> = coarse.iter().zip(&fine).map(|(a, b)| 10.0 * (a / b).log10()).collect();
        println!("{name}: {off:.2?} dB");
        let heard = coarse.iter().map(|b| *b > 1e-3 * loudest);
        assert!(off.iter().zip(heard).all(|(db, heard)| !heard || db.abs() < 0.5), "{name}: {off:?}");
    }
}

#[test]
fn every_surface_stays_finite_under_hard_strokes_and_none() {
    for (n, made) in made_surfaces().iter().enumerate() {
        if n % 3 > 0 && made.family != Family::Sheet {
            continue;
        }
        let surface = (envelope(&made.patch((256, 0.04), 1), Tool::PEN.tip_mm), made.contact);
        for (speed, force) in [(0.0, 0.0), (0.0, 3.0), (400.0, 5.0), (300.0, 0.05)] {
            let x = stroke(&surface, (speed, 0.7), force, 0.2, STEPS);
            let most = x.iter().map(|a| a.normal.abs().max(a.along.abs())).fold(0.0, f64::max);
            assert!(most.is_finite() && most < 1e5, "{}: {most} m/s^2 at {speed} mm/s, {force} N", made.name);
            if speed == 0.0 && force > 0.0 {
                // On a slope it settles sideways; strokes make some 20 m/s^2.
                assert!(most < 0.1, "{} at rest: {most}", made.name);
            }
        }
    }
}
