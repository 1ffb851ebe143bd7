//! Textures as autoregressive models of the tool's acceleration: one model for each of some speeds and
//! forces, mixed in between.
//!
//! # The model
//!
//! At a constant speed and force the acceleration is white Gaussian noise `e` of variance `var` through
//! a filter,
//!
//! ```text
//! x[n] = - a_1 x[n-1] - .. - a_p x[n-p] + gain (e[n] + b_1 e[n-1] + .. + b_q e[n-q])
//! S(w) = var gain^2 |B(w) / A(w)|^2,    A = 1 + a_1 e^-iw + ..,    B = 1 + b_1 e^-iw + ..
//! ```
//!
//! It is stable when all roots of `A` lie within the unit circle. Models are mixed as in Culbertson, Unwin
//! and Kuchenbecker 2014 ("Modeling and rendering realistic textures from unconstrained tool-surface
//! interactions"): triangles with models as corners cover the plane of speed and force. The three models
//! around a point are mixed by barycentric weights: variance and gain linearly, polynomials by line spectral
//! frequencies, so that every mixture is stable. Outside the triangles the nearest point of their hull
//! counts, in parts of the models' range.
//!
//! A texture comes from a [file](TextureFile), from a recording by a [fit], or from a file of the Penn
//! [toolkit].
//!
//! # Magnitudes in closed form
//!
//! A frame is a Hann window `w` of 0.1 s. The mean square of its transform follows from the model's
//! autocovariance `r`,
//!
//! ```text
//! E|X_k|^2 = sum_m r(m) c(m) cos(w_k m),    c(m) = sum_n w[n] w[n+m]
//! ```
//!
//! This is exact: the spectrum smoothed by the window's kernel. The short form `S(w_k) sum w^2` takes the
//! spectrum at the bin alone and is wrong at resonances: Take a pole of radius 0.998 at 200 Hz and a rate of
//! 1 kHz. It is 11.9 dB too high at the peak and 12.4 dB too low 10 Hz beside it.
//!
//! Times on a virtual AMD EPYC core with 60 models of 16 and 4 coefficients: [`Texture::fill`] takes 0.33
//! us, a sample of [`Synthesis`] 40 ns. [`Frames::expected_power`] takes 14 us at 1 kHz and 90 us at 10 kHz.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod file;
mod filter;
pub mod fit;
mod frames;
mod ladder;
pub mod line_spectrum;
mod synthesis;
mod texture;
pub mod toolkit;
mod triangles;

#[cfg(test)]
mod facts_tests;
#[cfg(test)]
mod made_tests;
#[cfg(test)]
mod testing;

pub use file::{MAX_MODELS, TextureFile};
pub use filter::{Filter, MAX_ORDER, is_stable};
pub use frames::Frames;
pub use synthesis::Synthesis;
pub use texture::{Model, Texture};
pub use triangles::{Blend, Triangles};
