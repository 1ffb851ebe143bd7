//! Windows, transforms, phase retrieval, overlap-add, resampling and filters: kernels without a graph.
//!
//! Constructors allocate and check; what runs per tick does neither, and does not panic. Samples are
//! counted by absolute index in integers, so nothing drifts.
//!
//! Medians in single precision on a virtual AMD EPYC core (two of them, shared with four times their load
//! in builds, so these are upper bounds), `cargo bench -p asperity-dsp`, frames of noise, back to back:
//!
//! | transform length | bins | `spsi` | `overlap_add` | both |
//! |---|---|---|---|---|
//! | 50 | 26 | 0.45 us | 0.17 us | 0.67 us |
//! | 250 | 101 | 2.2 us | 0.82 us | 3.0 us |
//! | 4410 | 101 | 2.3 us | 10.5 us | 13.8 us |
//! | 4800 | 101 | 2.2 us | 9.5 us | 11.7 us |
//!
//! The plain methods, a frame of 101 bins at transform lengths 250 and 4800: `phase_vocoder` 0.19 us at
//! both, `random_phase` 1.9 us at both, `oscillator_bank` with its 5 or 96 samples 2.9 and 4.7 us tracked,
//! 5.0 and 11.6 us as noise.
//!
//! `resample`, one tick of 2 ms: 2500 to 48000 Hz 0.82 us, to 44100 Hz 0.84 us, 500 to 48000 Hz 0.79 us.
//! The widest table made here, 2500 to 44099 Hz at minimum phase, takes 68 ms to compute.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod filter;
mod float;
pub mod frame;
mod framing;
pub mod griffin_lim;
mod isa;
mod lanes;
pub mod low_pass;
mod magnitude;
pub mod oscillator_bank;
pub mod overlap_add;
pub mod phase_vocoder;
pub mod plans;
mod ramp;
pub mod random;
pub mod random_phase;
pub mod resample;
pub mod sample_commit;
pub mod scatter;
pub mod shaped_noise;
pub mod spsi;
pub mod stft;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod widths_tests;
pub mod window;

pub use float::Float;
pub use framing::{Framing, FramingError, MAX_FFT_LEN, MAX_PERIOD};
pub use isa::Isa;
pub use magnitude::Level;
pub use oscillator_bank::{OscillatorBank, Partials};
pub use overlap_add::OverlapAdd;
pub use phase_vocoder::{PhaseVocoder, StartPhase};
pub use ramp::Ramp;
pub use random_phase::RandomPhase;
pub use realfft::num_complex::Complex;
pub use resample::{Conversion, FilterPhase, Resampler};
pub use sample_commit::SampleCommit;
pub use scatter::Scatter;
pub use shaped_noise::ShapedNoise;
pub use spsi::Spsi;
pub use stft::Stft;
