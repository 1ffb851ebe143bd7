//! Helpers of the stylus tests.

use asperity_dsp::Stft;

use super::{Acceleration, Moment, SAMPLE_HZ, Stylus, Tool};
use crate::topography::{Contact, HeightField, MadeSurface};

/// Grid of the strokes' patches.
pub(super) const GRID: (usize, f64) = (1024, 0.04);

/// Height field under the pen of a surface with its stated figures.
pub(super) fn met(made: &MadeSurface, grid: (usize, f64)) -> (HeightField, Contact) {
    (Tool::PEN.track(&made.as_stated(grid, 1), &made.contact), made.contact)
}

/// Accelerations of a steady stroke along a direction, after half a second of run-up.
pub(super) fn stroke(
    (envelope, contact): &(HeightField, Contact),
    (speed, angle): (f64, f64),
    force_n: f64,
    seconds: f64,
    steps: u32,
) -> Vec<Acceleration> {
    let mut stylus = Stylus::new(Tool::PEN, envelope, *contact, [1.0, 2.0], force_n);
    stylus.steps = steps;
    let moment = Moment { velocity_mm_s: [speed * angle.cos(), speed * angle.sin()], force_n };
    let samples = |seconds: f64| (seconds * f64::from(SAMPLE_HZ)) as usize;
    (0..samples(0.5)).for_each(|_| {
        stylus.next(&moment);
    });
    (0..samples(seconds)).map(|_| stylus.next(&moment)).collect()
}

/// Mean square of one axis in bins of 2 Hz, from 2 to 1000 Hz, in (m/s^2)^2: windows of 0.5 s.
pub(super) fn fine_spectrum(x: &[f64]) -> Vec<f64> {
    windowed(x, 5_000)
}

/// Mean square of the bins from the first to 1000 Hz, with Hann windows of this length at half overlap.
fn windowed(x: &[f64], samples: usize) -> Vec<f64> {
    let mut stft = Stft::new(samples);
    let mut sums = vec![0.0; samples / 10];
    let frames = x.windows(samples).step_by(samples / 2);
    let count = frames.len() as f64;
    for frame in frames {
        sums.iter_mut().zip(&stft.process(frame)[1..]).for_each(|(sum, bin)| *sum += bin.norm_sqr());
    }
    // A Hann window spreads a line's power over bins, 1.5 times as much in all.
    sums.iter().map(|sum| sum / (3.0 * count)).collect()
}

/// The same of all axes together in bins of 10 Hz, from 10 to 1000 Hz: windows of 0.1 s.
pub(super) fn spectrum_of_all(x: &[Acceleration]) -> Vec<f64> {
    let axis = |axis: usize| windowed(&x.iter().map(|a| a.axes()[axis]).collect::<Vec<_>>(), 1_000);
    let [a, b, c] = [axis(0), axis(1), axis(2)];
    a.iter().zip(b).zip(c).map(|((a, b), c)| a + b + c).collect()
}

/// Root mean square of a stroke from 10 to 1000 Hz, all axes together, in m/s^2.
pub(super) fn level(x: &[Acceleration]) -> f64 {
    spectrum_of_all(x).iter().sum::<f64>().sqrt()
}
