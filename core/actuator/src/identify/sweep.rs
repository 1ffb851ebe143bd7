//! The measuring signal: an exponential sine sweep.

use asperity_diagnostics::Diagnostic;
use asperity_numbers::Elementary as _;
use std::f64::consts::{PI, TAU};

use super::super::check;

/// Amplitude of a [`Sweep`] over frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SweepShape {
    /// Constant.
    #[default]
    Flat,
    /// Proportional to frequency below [`SweepSettings::corner_hz`], constant above. So a low-frequency
    /// current does not move the mover far.
    Displacement,
}

/// Settings of a [`Sweep`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepSettings {
    /// First frequency \[Hz\], 0.5 to 5000.
    pub from_hz: f64,
    /// Last frequency \[Hz\], at least 1.5 times the first and at most 0.45 of the rate.
    pub to_hz: f64,
    /// Wanted length \[s\], 0.1 to 120; [`Sweep::seconds`] is the actual one.
    pub seconds: f64,
    /// Largest amplitude in the drive's unit.
    pub amplitude: f64,
    /// Amplitude over frequency.
    pub shape: SweepShape,
    /// Corner of [`SweepShape::Displacement`] \[Hz\], 1 to 20000.
    pub corner_hz: f64,
    /// Length of each raised-cosine fade \[s\], 0 to 1, at most half the sweep.
    pub fade_s: f64,
    /// Silence before \[s\], 0 to 60.
    pub before_s: f64,
    /// Silence after \[s\], 0 to 60. The latency and the ringing must end in it.
    pub after_s: f64,
}

impl Default for SweepSettings {
    fn default() -> Self {
        Self {
            from_hz: 10.0,
            to_hz: 2000.0,
            seconds: 10.0,
            amplitude: 0.1,
            shape: SweepShape::Flat,
            corner_hz: 100.0,
            fade_s: 0.02,
            before_s: 0.5,
            after_s: 1.0,
        }
    }
}

/// An exponential sine sweep. Each sample depends on its number only.
///
/// sin(2 pi f0 L (e^(t/L) - 1)) with L = T / ln(f1 / f0) (A. Farina, "Simultaneous measurement of
/// impulse response and distortion with a swept-sine technique", AES 108, 2000). L is rounded so that
/// f0 L is whole. Then the sweep's harmonics are in phase with sweeps of their own (A. Novak et al.,
/// "Synchronized swept-sine", J. Audio Eng. Soc. 63, 2015).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    settings: SweepSettings,
    rate_hz: f64,
    /// f0 L, whole.
    cycles: f64,
    before: u64,
    active: u64,
    after: u64,
}

impl Sweep {
    /// A sweep at `rate_hz` samples a second.
    ///
    /// # Errors
    /// A setting out of its range; a rate below 1 kHz or above 1 MHz.
    pub fn new(settings: SweepSettings, rate_hz: f64) -> Result<Self, Diagnostic> {
        let s = settings;
        check("a rate", rate_hz, 1000.0, 1e6, "Hz")?;
        check("a sweep's first frequency", s.from_hz, 0.5, 5000.0, "Hz")?;
        check("a sweep's last frequency", s.to_hz, 1.5 * s.from_hz, 0.45 * rate_hz, "Hz")?;
        check("a sweep's time", s.seconds, 0.1, 120.0, "s")?;
        check("a sweep's amplitude", s.amplitude, 0.0, 1e6, "")?;
        check("a sweep's corner", s.corner_hz, 1.0, 20_000.0, "Hz")?;
        check("a sweep's fade", s.fade_s, 0.0, 1.0, "s")?;
        check("a silence before a sweep", s.before_s, 0.0, 60.0, "s")?;
        check("a silence after a sweep", s.after_s, 0.0, 60.0, "s")?;
        let octaves = (s.to_hz / s.from_hz).log_e();
        let cycles = (s.from_hz * s.seconds / octaves).round().max(1.0);
        let count = |seconds: f64| (seconds * rate_hz).round() as u64;
        Ok(Self {
            settings,
            rate_hz,
            cycles,
            before: count(s.before_s),
            active: count(cycles / s.from_hz * octaves).max(2),
            after: count(s.after_s),
        })
    }

    /// L \[s\]: the time in which the frequency grows by the factor e. The k-th harmonic arrives L
    /// ln(k) before the sweep reaches the harmonic's frequency.
    pub fn time_constant_s(&self) -> f64 {
        self.cycles / self.settings.from_hz
    }

    /// Length of the sweep \[s\] without the silence: the set one, adjusted so that f0 L is whole.
    pub fn seconds(&self) -> f64 {
        self.active as f64 / self.rate_hz
    }

    /// Number of samples, silence included.
    pub fn samples(&self) -> u64 {
        self.before + self.active + self.after
    }

    /// Whether sample `n` and all that follow are silent.
    pub fn is_over(&self, n: u64) -> bool {
        n >= self.before + self.active
    }

    /// Sample `n`, counted from the beginning of the silence; 0 outside.
    pub fn sample(&self, n: u64) -> f64 {
        let Some(i) = n.checked_sub(self.before).filter(|i| *i < self.active) else { return 0.0 };
        let s = &self.settings;
        let growth = (i as f64 / (self.rate_hz * self.time_constant_s())).exp_e();
        let shape = match s.shape {
            SweepShape::Flat => 1.0,
            SweepShape::Displacement => (s.from_hz * growth / s.corner_hz).min(1.0),
        };
        let phase = (self.cycles * (growth - 1.0)).fract();
        s.amplitude * shape * self.fade(i) * (TAU * phase).sine()
    }

    /// Raised cosines at both ends.
    fn fade(&self, i: u64) -> f64 {
        let edge = (self.settings.fade_s * self.rate_hz).min(self.active as f64 / 2.0);
        raised_cosine(i.min(self.active - 1 - i) as f64, edge)
    }
}

/// Rises from 0 at 0 to 1 at `length` along half a cosine. It is 1 after that, or if `length` is 0.
pub fn raised_cosine(at: f64, length: f64) -> f64 {
    if at < length { 0.5 - 0.5 * (PI * at / length).cosine() } else { 1.0 }
}
