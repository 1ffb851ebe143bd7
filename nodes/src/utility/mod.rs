//! Small parts: `gain`, `mix`, `delay`.

mod delay;
mod gain;
mod mix;

pub use delay::Delay;
pub use gain::Gain;
pub use mix::Mix;
