//! Tactile images: the picture for the image encoder, and its files.

pub(crate) mod plane;
mod quality;
mod read;
#[cfg(test)]
mod read_tests;

pub use quality::Quality;
pub use read::{MAX_BYTES, MAX_PIXELS, MIN_SIDE, Picture, read};

/// Rows and columns of an image.
pub const IMAGE: [usize; 2] = [192, 256];

/// A picture of three channels, row by row, red, green and blue in turn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Rows and columns.
    pub size: [usize; 2],
    /// 8 bits a channel.
    pub pixels: Vec<u8>,
}
