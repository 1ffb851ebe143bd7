//! Several frames at once, one in each lane of a vector.
//!
//! A transform of one frame of 250 samples has little that can be done side by side: 125 points are five
//! times five times five. Of several frames all is done side by side, with no shuffling between lanes.
//! Sums and products are taken in one order and rounded one by one, so that every instruction set gives
//! the same bits.

mod fft;
mod vector;

pub(crate) use fft::{Fft, Work, turned};
pub(crate) use vector::{LANES, Lane, Lanes, Portable, Simd};

#[cfg(test)]
mod tests;
