//! Finds a material's [`Pattern`] from strokes: how its vibration is spread over place.
//!
//! A network answers expected magnitudes. They do not tell noise, single bumps and ridges apart.
//! [`find`] does:
//!
//! 1. [Waves](waves): ridges whose vibration repeats with place.
//! 2. [By playing](fit): how much of the waves repeats, and the bumps with which the synthesis kernel
//!    ([`ShapedNoise`]) has the strokes' kurtosis, modulation and repetition when played along them.
//!
//! It needs places along the strokes. Speed should be steady for a second or more, and strokes should
//! go in several directions.

mod figures;
mod fit;
mod stroke;
mod waves;

use asperity_dsp::shaped_noise;
use asperity_dsp::{Framing, ShapedNoise};
use asperity_texture::Pattern;

pub use figures::Figures;
pub use stroke::{RATE_HZ, Stroke};

use fit::Effort;
use stroke::{Passage, TICK, TICK_S};

/// Frames of magnitudes for the kernel per second.
const FRAMES_HZ: u32 = 10;
/// Samples in a window of magnitudes.
const WINDOW: usize = (RATE_HZ * 0.1) as usize;
/// Bins of a frame, from 0 to 1000 Hz.
pub const BINS: usize = 101;

/// Pieces to search for waves. More hardly help, and the search over all wave vectors takes longest.
const WAVE_PIECES: usize = 3;
/// If waves have more of the power than this, only bumps at ridges are tried.
const MOST_IN_WAVES: f64 = 0.5;

/// Rms magnitudes of 0, 10, .. 1000 Hz that a network answers at a velocity in mm/s.
pub type Network<'n> = dyn Fn([f64; 2]) -> [f64; BINS] + 'n;

/// The pattern of a material from strokes over pieces of it. All strokes of a piece share one frame of
/// reference.
///
/// With a network it is the pattern for its magnitudes, which differ a little from the strokes': the
/// rendering should be like the strokes all the same. Without a steady passage there is no pattern. The
/// same strokes give the same bits.
pub fn find(pieces: &[Vec<Stroke>], network: Option<&Network<'_>>) -> Pattern {
    found(pieces, network, &Effort::FULL)
}

fn found(pieces: &[Vec<Stroke>], network: Option<&Network<'_>>, effort: &Effort) -> Pattern {
    let mut passages: Vec<Vec<Passage>> =
        pieces.iter().map(|strokes| strokes.iter().flat_map(Stroke::passages).collect()).collect();
    if let Some(network) = network {
        passages.iter_mut().flatten().for_each(|p| p.magnitudes = p.answered(network));
    }
    let (waves, part) = waves::find(&passages[..passages.len().min(WAVE_PIECES)]);
    let all: Vec<&Passage> = passages.iter().flatten().collect();
    fit::find(&all, &waves, part < MOST_IN_WAVES, effort)
}

/// Samples that the kernel makes of a steady stroke: `places` in mm 2 ms apart, and rms magnitudes of 0
/// to 1000 Hz.
pub fn rendered(pattern: &Pattern, magnitudes: &[f64], places: &[[f64; 2]], seed: u64) -> Vec<f64> {
    let Some(mut kernel) = kernel(seed) else { return Vec::new() };
    kernel.set_pattern(shaped_noise::Pattern::read(&pattern.numbers()));
    let ticks_a_frame = (RATE_HZ / f64::from(FRAMES_HZ)) as usize / TICK;
    let mut samples = vec![0.0; places.len() * TICK];
    for (tick, (place, out)) in places.iter().zip(samples.chunks_mut(TICK)).enumerate() {
        if tick % ticks_a_frame == 0 {
            kernel.push((tick / ticks_a_frame) as u64, magnitudes, 1.0);
        }
        kernel.emit((tick * TICK) as u64, Some(*place), out);
    }
    samples
}

/// A kernel as in a graph.
fn kernel(seed: u64) -> Option<ShapedNoise<f32>> {
    let rate_hz = RATE_HZ as u32;
    let framing = Framing { rate_hz, fft_len: WINDOW, bins: BINS, frame_num: FRAMES_HZ, frame_den: 1 };
    // The fixed layout is valid.
    ShapedNoise::new(framing, TICK_S, seed).ok()
}

#[cfg(test)]
mod tests;
