//! Limits on the last samples before a device, for any graph.

/// State of an actuator's coil and mover, in SI units. Any guard or limiter can continue from it, with
/// any profile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coil {
    /// Mean square current over the coil's thermal time constant \[A^2\].
    pub heat: f64,
    /// Position of the mover relative to the handle \[m\].
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

/// Keeps one channel of a device within the limits of its actuator, for a host. It simulates exactly
/// the signal in the coil, and outlives the graphs that play on the channel.
///
/// A signal from a limiter that saw the same samples passes unchanged, to the bit.
pub trait Guard: Send {
    /// Limits every `step`-th of `samples`, in place; `unit` is the drive of a sample of 1 \[A or V\].
    /// Returns the number of changed samples. Tick thread: does not allocate.
    fn hold(&mut self, samples: &mut [f32], step: usize, unit: f64) -> u64;

    /// Lets the coil rest and cool for `seconds`.
    fn rest(&mut self, seconds: f64);

    /// State of the coil now.
    fn coil(&self) -> Coil;

    /// Continues from a coil, within its own limits. Tick thread.
    fn go_on(&mut self, coil: &Coil);

    /// Square of the continuous current rating \[A^2\].
    fn rating(&self) -> f64;

    /// Thermal time constant of the coil \[s\].
    fn cools_in(&self) -> f64;

    /// Largest drive \[A or V\].
    fn peak(&self) -> f64;
}
