//! A surface drawn from a law, over which a stroke can be played.

use std::f64::consts::TAU;

use super::{Law, Random};

/// One realisation of a material's roughness: a Gaussian profile along the path, as a sum of spatial partials with
/// random amplitudes, whose spectrum is the law's `G(q)`.
///
/// Played at constant speed and force it is a Gaussian process with exactly the law's PSD (up to the partials'
/// spacing, half a percent of `q` and at most 0.02 per mm). Where speed and force change, level and transfer
/// follow at once (quasi-stationary); phase follows the path, so pitch glides as it should.
#[derive(Clone, Debug)]
pub struct Surface {
    law: Law,
    partials: Vec<Partial>,
}

#[derive(Clone, Copy, Debug)]
struct Partial {
    per_mm: f64,
    cosine: f64,
    sine: f64,
}

/// Highest acceleration frequency that is played [Hz].
const TOP_HZ: f64 = 1100.0;

impl Surface {
    /// Draws a surface with roughness up to `max_per_mm` [1/mm]; for strokes not slower than `v`, 1100 / `v` is
    /// enough.
    pub fn new(law: &Law, max_per_mm: f64, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut partials = Vec::new();
        let mut low = 0.01;
        let max = max_per_mm.clamp(0.02, 500.0);
        while low < max {
            let width = f64::min(0.005 * low, 0.02);
            let per_mm = low + width * random.unit();
            let amplitude = (law.roughness(per_mm) * width).sqrt();
            let (cosine, sine) = (amplitude * random.normal(), amplitude * random.normal());
            partials.push(Partial { per_mm, cosine, sine });
            low += width;
        }
        Self { law: law.clone(), partials }
    }

    /// Acceleration [m/s^2] after `path_mm` of way, at a speed [mm/s] and a force [N].
    pub fn acceleration(&self, path_mm: f64, speed_mm_s: f64, force_n: f64) -> f64 {
        let strength = self.law.strength(speed_mm_s, force_n);
        if strength == 0.0 {
            return 0.0;
        }
        let sum: f64 = self
            .partials
            .iter()
            .take_while(|p| p.per_mm * speed_mm_s < TOP_HZ)
            .map(|p| {
                let (sin, cos) = (TAU * (p.per_mm * path_mm).fract()).sin_cos();
                self.law.transfer_power(p.per_mm * speed_mm_s).sqrt() * (p.cosine * cos + p.sine * sin)
            })
            .sum();
        strength.sqrt() * sum
    }

    /// Acceleration [m/s^2] of a stroke sampled at `rate_hz`, given as (speed [mm/s], force [N]).
    pub fn play(&self, rate_hz: f64, stroke: impl IntoIterator<Item = (f64, f64)>) -> Vec<f64> {
        let mut path = 0.0;
        stroke
            .into_iter()
            .map(|(speed, force)| {
                path += speed.max(0.0) / rate_hz;
                self.acceleration(path, speed, force)
            })
            .collect()
    }
}
