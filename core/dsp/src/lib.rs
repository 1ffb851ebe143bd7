//! Windows, transforms, phase retrieval, overlap-add, resampling and filters: kernels without a graph.
//!
//! Constructors allocate and check; what runs per tick does neither, and does not panic. Samples are counted by absolute
//! index in integers, so nothing drifts.

pub mod filter;
mod float;
mod framing;
pub mod overlap_add;
pub mod resample;
pub mod spsi;
pub mod stft;
pub mod window;

pub use float::Float;
pub use framing::{Framing, FramingError, MAX_FFT_LEN, MAX_PERIOD};
pub use overlap_add::OverlapAdd;
pub use realfft::num_complex::Complex;
pub use resample::{Conversion, FilterPhase, Resampler};
pub use spsi::Spsi;
pub use stft::Stft;
