//! Checks a limiter's output on an actuator of its own, integrated by Runge-Kutta.

use super::*;
use crate::testing::RungeKutta;

/// Checks an output against every promise, sample by sample.
pub(super) struct Judge {
    limits: Limits,
    pub(super) coil: RungeKutta,
    seconds: f64,
    last: f64,
    heat: f64,
    sum: f64,
    samples: f64,
    pub(super) worst_stroke: f64,
    pub(super) worst_rms: f64,
}

impl Judge {
    pub(super) fn new(limits: Limits, dynamics: Dynamics, drive: Drive, rate: f64) -> Self {
        // Runge-Kutta is stable and accurate for substeps below the coil's time constant.
        let substeps = (dynamics.resistance / dynamics.inductance / rate).ceil().max(4.0) as u32;
        let coil = RungeKutta::new(dynamics, drive, rate, substeps);
        Self {
            limits,
            coil,
            seconds: 1.0 / rate,
            last: 0.0,
            heat: 0.0,
            sum: 0.0,
            samples: 0.0,
            worst_stroke: 0.0,
            worst_rms: 0.0,
        }
    }

    pub(super) fn see(&mut self, y: f32) -> Result<(), String> {
        let (l, y) = (self.limits, f64::from(y));
        // NaN is in no range.
        if !(-l.peak..=l.peak).contains(&y) {
            return Err(format!("{y} is over the peak {}", l.peak));
        }
        if (y - self.last).abs() > l.slew_per_sample {
            return Err(format!("{} to {y} is over the slew {}", self.last, l.slew_per_sample));
        }
        self.last = y;
        let motion = self.coil.step(y);
        self.heat += (motion.current.powi(2) - self.heat) * self.seconds / l.thermal_time_constant;
        self.worst_rms = self.worst_rms.max(self.heat.sqrt() / l.rated_current);
        self.worst_stroke = self.worst_stroke.max(motion.displacement.abs() / l.stroke);
        self.sum += y;
        self.samples += 1.0;
        Ok(())
    }

    pub(super) fn verdict(&self, rms_tolerance: f64, dc_corner_hz: f64) -> Result<(), String> {
        if self.worst_stroke > 1.0 {
            return Err(format!("{} of the stroke", self.worst_stroke));
        }
        if self.worst_rms > 1.0 + rms_tolerance {
            return Err(format!("{} of the rated current", self.worst_rms));
        }
        let bound = 8.0 * self.limits.peak / (TAU * dc_corner_hz);
        let area = self.sum.abs() * self.seconds;
        if area > bound { Err(format!("a mean of {area} A s or V s, over {bound}")) } else { Ok(()) }
    }
}
