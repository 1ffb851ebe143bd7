//! The vectors that ship inside the program: all at 2500 Hz, small, and each telling something else.
//!
//! `sine_off`, a sine between two bins; `two25`, two sines 25 Hz apart, which share a window's main lobe; `chirp`;
//! `texture`, a noise through three resonances; `contact`, the same switched on and off; `taps`, decaying sines;
//! `nnsmooth`, the mean magnitudes of the texture, which are those of no signal and what a network answers that
//! was trained on squared errors. Noise and taps are files of the tests, the rest is made here by the formulas that those files
//! were made by, so that the published scores hold for all of them.

use std::f64::consts::{PI, TAU};

use asperity_accuracy::npy;
use asperity_diagnostics::Diagnostic;

use super::published;
use super::vectors::{Set, Vector};
use crate::failure::Failure;
use crate::phase::FRAME_HZ;

const RATE_HZ: u32 = 2500;
const N: usize = RATE_HZ as usize / 10;
const BINS: usize = 101;

const TEXTURE: &[u8] = include_bytes!("../../../../../tests/data/phase/texture_2500.sig.npy");
const CONTACT: &[u8] = include_bytes!("../../../../../tests/data/phase/contact_2500.sig.npy");
const TAPS: &[u8] = include_bytes!("../../../../../tests/data/phase/taps_2500.sig.npy");
const SCORES: &str = include_str!("../../../../../tests/data/phase/sc.json");

/// The built-in vectors with their published scores.
///
/// # Errors
/// None, unless the program was built from broken files.
pub fn set() -> Result<Set, Failure> {
    let broken = |e: &dyn std::fmt::Display| Failure::Machine(format!("a built-in vector is broken: {e}"));
    let kept = |name: &str, bytes: &[u8]| {
        let array = npy::parse(bytes)?;
        Vector::of_signal(name, RATE_HZ, &array.values.into_f64())
    };
    let made = |name: &str, seconds: f64, x: fn(f64) -> f64| {
        let count = (seconds * f64::from(RATE_HZ)) as usize;
        let signal: Vec<f64> = (0..count).map(|i| x(i as f64 / f64::from(RATE_HZ))).collect();
        Vector::of_signal(name, RATE_HZ, &signal)
    };
    let vectors = [
        made("sine_off_2500", 1.0, |t| (TAU * 153.7 * t + 0.3).sin()),
        made("two25_2500", 2.0, |t| (TAU * 150.0 * t + 0.3).sin() + (TAU * 175.0 * t + 1.1).sin()),
        made("chirp_2500", 3.0, |t| (TAU * (20.0 * t + 380.0 / 6.0 * t * t)).sin()),
        kept("texture_2500", TEXTURE),
        kept("contact_2500", CONTACT),
        kept("taps_2500", TAPS),
        smooth("nnsmooth_2500", 2.0),
    ];
    let vectors = vectors.into_iter().collect::<Result<_, _>>().map_err(|e| broken(&e))?;
    let scores = serde_json::from_str(SCORES).map_err(|e| broken(&e))?;
    let published = published::read(&scores).map_err(|e| broken(&e))?;
    Ok(Set { from: "built in".into(), vectors, published })
}

/// Mean magnitudes of a Gaussian noise whose level wavers: the square root of pi/4 of its mean power in every bin.
fn smooth(name: &str, seconds: f64) -> Result<Vector, Diagnostic> {
    let spectrum = mean_magnitudes(&resonances);
    let level = |frame: usize| {
        let t = (frame as f64 / f64::from(FRAME_HZ)) + 0.05;
        1.0 + 0.5 * (TAU * 0.7 * t + 0.4).sin() + 0.25 * (TAU * 2.3 * t).sin()
    };
    let frames = ((seconds - 0.1) * f64::from(FRAME_HZ)).round() as usize + 1;
    let frame_energy: f64 = spectrum.iter().map(|s| s * s).sum();
    let mean_square = (0..frames).map(|n| level(n).powi(2)).sum::<f64>() / frames as f64;
    let norm = 2.0 / N as f64 * (mean_square * frame_energy).sqrt();
    let magnitudes = (0..frames).flat_map(|n| spectrum.iter().map(move |s| (level(n) * s / norm) as f32));
    Vector::new(name, RATE_HZ, magnitudes.collect(), BINS)
}

/// Mean magnitude in each bin of a Gaussian noise of this amplitude density over frequency in Hz, up to a factor.
pub fn mean_magnitudes(density: &dyn Fn(f64) -> f64) -> Vec<f64> {
    const STEPS_A_HZ: i32 = 2;
    const REACH: i32 = 60 * STEPS_A_HZ;
    let hz = |i: i32| f64::from(i) / f64::from(STEPS_A_HZ);
    let window = |i: usize| 0.5 - 0.5 * (TAU * i as f64 / N as f64).cos();
    // The window's power response around a bin.
    let response: Vec<f64> = (-REACH..=REACH)
        .map(|d| {
            let turn = |i: usize| TAU * hz(d) * i as f64 / f64::from(RATE_HZ);
            let part = |f: fn(f64) -> f64| (0..N).map(|i| window(i) * f(turn(i))).sum::<f64>();
            part(f64::cos).powi(2) + part(f64::sin).powi(2)
        })
        .collect();
    let power = |bin: usize| -> f64 {
        let centre = bin as i32 * 10 * STEPS_A_HZ;
        let near = response.iter().zip(centre - REACH..=centre + REACH).filter(|(_, f)| *f >= 0);
        near.map(|(r, f)| r * density(hz(f)).powi(2)).sum()
    };
    (0..BINS).map(|bin| (power(bin) * PI / 4.0).sqrt()).collect()
}

/// 1 in the band, falling as half a cosine to 0 at 950 Hz.
pub fn band(hz: f64) -> f64 {
    const EDGE_HZ: f64 = 950.0;
    0.5 - 0.5 * (PI * ((EDGE_HZ - hz) / (0.08 * EDGE_HZ)).clamp(0.0, 1.0)).cos()
}

/// Amplitude density of the texture: resonances at 70, 190 and 420 Hz.
fn resonances(hz: f64) -> f64 {
    let one = |(at, width, gain): (f64, f64, f64)| gain * width / (2.0 * (hz - at)).hypot(width);
    let sum: f64 = [(70.0, 30.0, 1.0), (190.0, 60.0, 0.7), (420.0, 140.0, 0.45)].map(one).iter().sum();
    sum * (hz / 20.0).clamp(0.0, 1.0) * band(hz)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The vectors' own files, which were made elsewhere.
    #[test]
    fn built_in_vectors_are_those_of_the_published_scores() {
        let set = set().unwrap();
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/phase");
        for name in ["sine_off_2500", "two25_2500", "texture_2500", "nnsmooth_2500"] {
            let want = npy::read(format!("{folder}/{name}.mag.npy")).unwrap();
            let have = set.vectors.iter().find(|v| v.name == name).unwrap();
            assert_eq!(want.shape, [have.frames.count(), BINS], "{name}");
            let want = want.values.into_f32();
            let top = want.iter().copied().fold(0.0, f32::max);
            let off = have.unscaled.iter().zip(&want).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 2e-5 * top, "{name}: {off} of {top}");
        }
        let chirp = npy::read(format!("{folder}/chirp_2500.sig.npy")).unwrap().values.into_f64();
        let want = Vector::of_signal("chirp_2500", RATE_HZ, &chirp).unwrap().unscaled;
        let have = &set.vectors.iter().find(|v| v.name == "chirp_2500").unwrap().unscaled;
        let off = have.iter().zip(&want).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(have.len() == want.len() && off < 1e-3, "{off}");
        assert!(set.vectors.iter().all(|v| set.published.iter().any(|p| p.score(v).is_some())));
        assert_eq!(set.vectors[set.smoothest().unwrap()].name, "nnsmooth_2500");
    }
}
