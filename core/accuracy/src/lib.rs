//! Accuracy and timing figures, and NumPy files to exchange them.

pub mod accuracy;
pub mod npy;
pub mod phase;
pub mod response;
pub mod timing;
