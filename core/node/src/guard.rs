//! Limits on the last samples before a device, whatever nodes made them.

/// Coil and mover of an actuator at an instant, in SI units: what any guard or limiter can go on from,
/// whatever its profile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coil {
    /// Mean of the square of the current over the coil's thermal time constant \[A^2\].
    pub heat: f64,
    /// Place of the mover relative to the handle \[m\].
    pub place: f64,
    /// Speed of the mover relative to the handle \[m/s\].
    pub speed: f64,
    /// Current in the coil \[A\].
    pub current: f64,
    /// Whether the drive is a voltage; else it is a current.
    pub volts: bool,
    /// Last sample of the drive \[A or V\].
    pub last: f64,
    /// Integral of the drive over time \[A s or V s\].
    pub area: f64,
}

/// Holds one channel of a device to the limits of its actuator, for a host. It simulates exactly what the
/// coil gets, and outlives the graphs that play on the channel.
///
/// A signal that comes from a limiter that saw the same samples passes unchanged, to the bit.
pub trait Guard: Send {
    /// Holds every `step`-th of `samples` to the limits, in place; `unit` is the drive that a sample of 1 is
    /// \[A or V\]. Answers how many samples it changed. Tick thread: allocates nothing.
    fn hold(&mut self, samples: &mut [f32], step: usize, unit: f64) -> u64;

    /// Lets the coil lie still and cool for `seconds`.
    fn rest(&mut self, seconds: f64);

    /// The coil now.
    fn coil(&self) -> Coil;

    /// Goes on from a coil, within its own limits. Tick thread.
    fn go_on(&mut self, coil: &Coil);

    /// The square of the current that the coil bears for ever \[A^2\].
    fn rating(&self) -> f64;

    /// Time constant with which the coil cools \[s\].
    fn cools_in(&self) -> f64;

    /// Largest drive \[A or V\].
    fn peak(&self) -> f64;
}
