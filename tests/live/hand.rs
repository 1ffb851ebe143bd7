//! Haptic devices and OSC by the library's own interface, with stand-ins of the devices.

mod haply;
mod held;
mod openhaptics;
mod osc;
