//! `rtpghi`: real-time phase gradient heap integration.
//!
//! For a Gaussian window the phase of a transform follows from its magnitude. Along time it advances
//! with a frequency given by the slope of the logarithm along frequency. Along frequency it changes
//! with a delay given by the slope along time. These slopes are integrated from bin to bin and frame to
//! frame, the strongest bins first, so that errors stay where little is heard. After Z. Prusa, P. L.
//! Sondergaard, "Real-time Spectrogram Inversion Using Phase Gradient Heap Integration", DAFx 2016. The
//! Hann window is approximated by the nearest Gaussian.
//!
//! Phases are kept at the window's centre, where the phase of a sinusoid is the same in all bins of its
//! main lobe. Slopes use the true number of samples between frames.
//!
//! Spectral convergence in dB (lower is better) on the vectors in `tests/data/phase` ("published" from
//! `graphs/phase/sc.json`), at `look_ahead` 0 and 1:
//!
//! | vector | published 0 | here 0 | published 1 | here 1 |
//! |---|---|---|---|---|
//! | sine_off_2500 | -38.8 | -38.8 | -38.8 | -38.8 |
//! | chirp_2500 | -43.4 | -43.4 | -43.4 | -43.4 |
//! | texture_2500 | -17.9 | -16.8 | -17.3 | -17.3 |
//! | two25_2500 | -16.1 | -16.3 | -16.1 | -16.1 |
//! | taps_2500 | -20.2 | -20.2 | -20.6 | -20.6 |
//! | contact_2500 | -16.7 | -16.7 | -16.4 | -16.4 |
//! | nnsmooth_2500 | -1.5 | -1.5 | -1.5 | -1.5 |
//! | texture_48000 | -17.8 | -17.9 | -18.5 | -18.6 |
//! | amchirp_48000 | -25.4 | -25.4 | -25.4 | -25.4 |
//!
//! A frame of 101 bins takes 8.6 us (median, one core of a shared virtual AMD EPYC), at 2.5 kHz and at
//! 48 kHz.
//!
//! The limit is the window, which is not Gaussian. Magnitudes that belong to no signal (nnsmooth, a
//! mean over phases) have meaningless slopes, and collapse.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod kernel;
mod node;
#[cfg(test)]
mod tests;

pub use node::Rtpghi;

asperity_sdk::export!(Rtpghi);
