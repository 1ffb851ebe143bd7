//! Accuracy and timing figures, and NumPy files to exchange them.

pub mod npy;
pub mod phase;
pub mod response;
pub mod timing;
