//! The network as a whole: against tract and plain f64, and with files that are damaged or unusual.

mod agreement;
mod bad_input;
mod encoder;
mod fallback;
mod networks;
mod whole;
