//! Several frames at once, one in each lane of a vector.
//!
//! A transform of one frame of 250 samples has little parallel work: 125 points are five times five
//! times five. Several frames are computed in parallel, without shuffling between lanes. Sums and
//! products have one order and are rounded one by one, so every instruction set gives the same bits.

mod fft;
mod vector;

pub(crate) use fft::{Fft, Work, turned};
pub(crate) use vector::{LANES, Lane, Lanes, Portable, Simd};

#[cfg(test)]
mod tests;
