//! `rtpghi`: real-time phase gradient heap integration.
//!
//! For a Gaussian window the phase of a transform follows from its magnitude: along time it turns with a frequency that is read off
//! the slope of the logarithm along frequency, along frequency with a delay that is read off the slope along time. These
//! slopes are summed up from bin to bin and frame to frame, the strongest bins first, so that errors stay where little is
//! heard. After Z. Prusa, P. L. Sondergaard, "Real-time Spectrogram Inversion Using Phase Gradient Heap Integration", DAFx
//! 2016. The Hann window is taken for the Gaussian that is nearest to it.
//!
//! Phases are kept at the window's centre, where the phase of a sinusoid is the same in all bins of its main lobe, and
//! slopes use the true number of samples between frames.
//!
//! Spectral convergence on the vectors in `tests/data/phase` (dB, lower is better; "published" from `sc.json` there), at
//! `look_ahead` 0 and 1:
//!
//! TABLE
//!
//! What limits it is the window, which is no Gaussian. Magnitudes that are no signal's (nnsmooth, a mean over phases) have
//! slopes that say nothing, and collapse.

pub mod kernel;
mod node;

pub use node::Rtpghi;

asperity_sdk::export!(Rtpghi);
