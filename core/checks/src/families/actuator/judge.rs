//! Holds what goes to a coil against what the coil stands, sample by sample, by a simulated one that belongs to no limiter.

use std::f64::consts::TAU;

use asperity_actuator::{Drive, Dynamics, Plant};

/// By which part the rms current may be over the rating: what the limiter promises.
const RMS_MARGIN: f64 = 0.01;

/// What a limiter says of itself, where it does.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Promise {
    /// A sine of the peak up to this frequency is not held back \[Hz\].
    pub(super) slew_hz: Option<f64>,
    /// Corner of the DC removal \[Hz\].
    pub(super) dc_corner_hz: Option<f64>,
}

/// A coil, and the worst that was done to it.
pub(super) struct Judge {
    dynamics: Dynamics,
    drive: Drive,
    rate_hz: f64,
    promise: Promise,
    coil: Plant,
    last: f32,
    heat: f64,
    hottest: f64,
    sum: f64,
    /// Largest step from sample to sample \[A or V\].
    pub(super) steepest: f64,
    /// Largest sample \[A or V\].
    pub(super) largest: f64,
    /// Farthest from the middle \[m\].
    farthest: f64,
    /// How fast the mover is now \[m/s\].
    pub(super) speed: f64,
}

impl Judge {
    pub(super) fn new(dynamics: Dynamics, drive: Drive, rate_hz: f64, promise: Promise) -> Self {
        Self {
            dynamics,
            drive,
            rate_hz,
            promise,
            coil: Plant::new(&dynamics, drive, rate_hz),
            last: 0.0,
            heat: 0.0,
            hottest: 0.0,
            sum: 0.0,
            steepest: 0.0,
            largest: 0.0,
            farthest: 0.0,
            speed: 0.0,
        }
    }

    /// The largest sample that may be \[A or V\].
    pub(super) fn peak(&self) -> f64 {
        match self.drive {
            Drive::Current => self.dynamics.peak_current,
            Drive::Voltage => self.dynamics.peak_voltage,
        }
    }

    /// The next sample. Its limits are held at once, those of the coil by [`verdict`](Self::verdict).
    ///
    /// # Errors
    /// A limit of the sample that does not hold, in words.
    pub(super) fn see(&mut self, sample: f32) -> Result<(), String> {
        if !sample.is_finite() {
            return Err(format!("a sample is {sample}"));
        }
        let (y, peak, unit) = (f64::from(sample), self.peak(), self.drive.unit());
        let step = (y - f64::from(self.last)).abs();
        self.last = sample;
        (self.largest, self.steepest) = (self.largest.max(y.abs()), self.steepest.max(step));
        if y.abs() > peak {
            return Err(format!("{y} {unit} is over the peak of {peak} {unit}"));
        }
        let slew = self.promise.slew_hz.map(|hz| (TAU * hz * peak / self.rate_hz).min(2.0 * peak));
        if let Some(slew) = slew.filter(|slew| step > *slew) {
            return Err(format!("a step of {step:.4} {unit} is over the slew of {slew:.4} {unit}"));
        }
        let motion = self.coil.step(y);
        self.speed = motion.velocity;
        let part = 1.0 / (self.rate_hz * self.dynamics.thermal_time_constant);
        self.heat += (motion.current * motion.current - self.heat) * part;
        self.hottest = self.hottest.max(self.heat);
        self.farthest = self.farthest.max(motion.displacement.abs());
        self.sum += y;
        Ok(())
    }

    /// Largest rms current over the thermal time constant, as a part of the rated one.
    pub(super) fn rms(&self) -> f64 {
        self.hottest.sqrt() / self.dynamics.rated_current
    }

    /// Farthest place of the mover, as a part of the stroke.
    pub(super) fn stroke(&self) -> f64 {
        self.farthest / self.dynamics.stroke
    }

    /// Whether the coil has stood all of it.
    ///
    /// # Errors
    /// Which limit does not hold, in words.
    pub(super) fn verdict(&self) -> Result<(), String> {
        if self.stroke() > 1.0 {
            return Err(format!("the mover went to {:.3} of its stroke", self.stroke()));
        }
        if self.rms() > 1.0 + RMS_MARGIN {
            return Err(format!("the rms current was {:.3} of the rated one", self.rms()));
        }
        let area = self.sum.abs() / self.rate_hz;
        let bound = self.promise.dc_corner_hz.map(|hz| 8.0 * self.peak() / (TAU * hz));
        if let Some(bound) = bound.filter(|bound| area > *bound) {
            let unit = self.drive.unit();
            return Err(format!(
                "the mean is {area:.3} {unit} s over the time, and at most {bound:.3} {unit} s"
            ));
        }
        Ok(())
    }
}
