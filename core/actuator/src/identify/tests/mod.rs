//! Simulated measurements: the real limiter, the simulated plant, a latency and noise.

mod trust;
mod values;

use std::f64::consts::{PI, TAU};

use asperity_fft as fft;
use num_complex::Complex64;

use super::super::{Dynamics, Limiter, LimiterSettings, Plant, Quantity};
use super::*;

const RATE: f64 = 48_000.0;

/// A profile with these figures: m_a \[g\], k, c, k_f. The rest is a HapCoil-One's, with limits wide
/// enough for a sweep.
fn profile(m_a: f64, k: f64, c: f64, k_f: f64) -> ActuatorProfile {
    let q = |value| Quantity { value, source: "made up".into(), estimate: false };
    ActuatorProfile {
        name: "made".into(),
        moving_mass: q(m_a * 1e-3),
        stiffness: q(k),
        damping: q(c),
        force_factor: q(k_f),
        stroke: q(5e-3),
        rated_current: q(0.15),
        ..ActuatorProfile::shipped("hapcoil_one").unwrap().unwrap()
    }
}

fn hapcoil() -> ActuatorProfile {
    profile(4.4, 702.97, 0.629, 1.78)
}

/// A simulated measurement.
#[derive(Clone, Copy, Debug)]
struct Scene {
    drive: Drive,
    handle_g: f64,
    /// Samples between drive and acceleration.
    delay: f64,
    /// Signal to noise \[dB\]. The noise is half white, half a hum of 50 Hz.
    snr_db: f64,
    amplitude: f64,
    seconds: f64,
    hum: bool,
    seed: u64,
}

/// Settings for a simulated plant.
fn held() -> IdentifySettings {
    IdentifySettings { held: true, handle_mass_uncertainty: 0.002, ..IdentifySettings::default() }
}

impl Scene {
    fn new(handle_g: f64) -> Self {
        let (drive, delay, amplitude) = (Drive::Current, 431.37, 0.1);
        Self { drive, handle_g, delay, snr_db: 20.0, amplitude, seconds: 4.0, hum: true, seed: 1 }
    }

    fn sweep(&self) -> Sweep {
        let settings = SweepSettings {
            seconds: self.seconds,
            amplitude: self.amplitude,
            before_s: 0.3,
            after_s: 0.7,
            shape: SweepShape::Displacement,
            ..SweepSettings::default()
        };
        Sweep::new(settings, RATE).unwrap()
    }

    /// Plays the sweep through limiter and plant.
    fn play(&self, actuator: &ActuatorProfile) -> Tape {
        let dynamics = Dynamics::new(actuator, self.handle_g).unwrap();
        let mut limiter = Limiter::new(&dynamics, self.drive, RATE, LimiterSettings::default()).unwrap();
        let sweep = self.sweep();
        let asked: Vec<f32> = (0..sweep.samples()).map(|n| sweep.sample(n) as f32).collect();
        let mut drive = vec![0.0; asked.len()];
        limiter.process(&asked, &mut drive);
        let mut plant = Plant::new(&dynamics, self.drive, RATE);
        let heard: Vec<f64> = drive.iter().map(|u| plant.step(f64::from(*u)).acceleration).collect();
        let mut heard = delayed(&heard, self.delay);
        add_noise(&mut heard, self);
        let acceleration = heard.iter().map(|x| *x as f32).collect();
        Tape { drive, acceleration, limited: limiter.report().acted(), scene: *self }
    }
}

#[derive(Clone)]
struct Tape {
    drive: Vec<f32>,
    acceleration: Vec<f32>,
    limited: bool,
    scene: Scene,
}

impl Tape {
    fn recording(&self) -> Recording<'_> {
        Recording {
            drive: &self.drive,
            acceleration: &self.acceleration,
            rate_hz: RATE,
            handle_mass_g: self.scene.handle_g,
            limited: self.limited,
            sweep_time_constant_s: Some(self.scene.sweep().time_constant_s()),
        }
    }
}

/// Findings of one recording or more.
fn identified(tapes: &[Tape], base: &ActuatorProfile, settings: IdentifySettings) -> Findings {
    let recordings: Vec<Recording<'_>> = tapes.iter().map(Tape::recording).collect();
    identify(&recordings, base, settings).unwrap()
}

/// Delays `x` by any number of samples, by the phase of its spectrum.
fn delayed(x: &[f64], samples: f64) -> Vec<f64> {
    let len = (x.len() + 4096).next_multiple_of(2048);
    let mut padded = x.to_vec();
    padded.resize(len, 0.0);
    let turn = |n: usize| Complex64::from_polar(1.0 / len as f64, -TAU * n as f64 / len as f64 * samples);
    let spectrum = fft::spectrum(padded).into_iter().enumerate().map(|(n, z)| z * turn(n));
    let mut late = fft::signal(spectrum, len);
    late.truncate(x.len());
    late
}

/// Uniform numbers from -1 to 1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Adds white noise and a hum of 50 Hz of the same power, or white noise alone.
fn add_noise(x: &mut [f64], scene: &Scene) {
    let power = x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64;
    let all = power / 10f64.powf(scene.snr_db / 10.0);
    let (white, hum) = if scene.hum { ((0.5 * all).sqrt(), all.sqrt()) } else { (all.sqrt(), 0.0) };
    let mut noise = Noise(scene.seed);
    for (n, x) in x.iter_mut().enumerate() {
        // The sum of twelve uniform numbers is nearly normal.
        *x += white * 0.5 * (0..12).map(|_| noise.next()).sum::<f64>()
            + hum * (TAU * 50.0 * n as f64 / RATE + scene.seed as f64).sin();
    }
}
