//! Audio devices by the library's own interface: the simulated card, JACK, PulseAudio, and no server at all.

mod absent;
mod faults;
mod jack;
mod parts;
mod pulse;
mod simulated;

pub(crate) use pulse::pactl;
pub(crate) use simulated::quantized;
