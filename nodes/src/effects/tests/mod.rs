//! Effects in an engine, against their kernels driven directly and against closed forms.

mod autoregressive;
mod bench;
mod forces;
mod gliding;
mod level;
mod limiter;
mod settings;
mod tap;
mod vibration;
