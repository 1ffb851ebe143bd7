//! The limits again, on a device's final samples.

use asperity_node::{Coil, Guard};
use asperity_numbers::Elementary as _;

use super::run::{Fixed, Given, Run};
use super::{Drive, Limiter};

/// A sample stays as it is if the walls would move it by less than this part of the peak. Double
/// rounding to f32, with another unit between, stays below.
const ROUNDING: f64 = 1e-5;
/// Largest excess over the peak by rounding to f32 twice.
const TWICE_ROUNDED: f64 = 2e-7;
/// The limiter's DC exceeds its ceiling by at most the slew's delay.
const DC_WALL: f64 = 1.1;

/// Holds the samples of a device's channel to the limits of a [`Limiter`], whichever limiters made them
/// and whatever ramps and crossfades follow. It has the limiter's walls and a simulated coil that gets
/// exactly the device's samples.
///
/// It has no gain: where it must act, it cuts the wave.
#[derive(Clone, Debug)]
pub struct ChannelGuard {
    fixed: Fixed,
    drive: Drive,
    rate_hz: f64,
    cools_in: f64,
    given: Given,
    /// As in the limiter: 2 pi times its corner times the integral of the output \[A or V\].
    dc: f64,
}

impl ChannelGuard {
    pub(super) fn new(limiter: &Limiter) -> Self {
        Self {
            fixed: limiter.fixed.clone(),
            drive: limiter.drive,
            rate_hz: limiter.rate_hz,
            cools_in: limiter.limits.thermal_time_constant,
            given: Run::new(limiter.run.asked.clone()).given,
            dc: 0.0,
        }
    }

    fn block<const VOLTAGE: bool>(&mut self, samples: &mut [f32], step: usize, unit: f64) -> u64 {
        let (f, mut changed) = (&self.fixed, 0);
        for sample in samples.iter_mut().step_by(step.max(1)) {
            let asked = if sample.is_finite() { f64::from(*sample) * unit } else { 0.0 };
            let pushes_on = self.dc.abs() > DC_WALL * f.ceiling && asked * self.dc > 0.0;
            let held = self.given.hold::<VOLTAGE>(f, if pushes_on { 0.0 } else { asked }, false).sample;
            let mut y = asked;
            let over = asked.abs() > f.peak * (1.0 + TWICE_ROUNDED);
            if (held - asked).abs() > ROUNDING * f.peak || over || !sample.is_finite() {
                *sample = (held / unit) as f32;
                if f64::from(*sample).abs() * unit > f.peak {
                    *sample = if held > 0.0 { sample.next_down() } else { sample.next_up() };
                }
                y = f64::from(*sample) * unit;
                changed += 1;
            }
            self.dc += f.dc * y;
            self.given.take::<VOLTAGE>(f, y);
        }
        self.given.settle();
        changed
    }

    /// Corner of the DC removal \[rad/s\].
    fn corner(&self) -> f64 {
        self.fixed.dc * self.rate_hz
    }
}

impl Guard for ChannelGuard {
    fn hold(&mut self, samples: &mut [f32], step: usize, unit: f64) -> u64 {
        match self.drive {
            Drive::Current => self.block::<false>(samples, step, unit),
            Drive::Voltage => self.block::<true>(samples, step, unit),
        }
    }

    fn rest(&mut self, seconds: f64) {
        self.given.heat *= (-seconds.max(0.0) / self.cools_in).exp_e();
        self.given.plant.reset();
        self.given.last = 0.0;
    }

    fn coil(&self) -> Coil {
        let [x, speed, current] = self.given.plant.state;
        Coil {
            heat: self.given.heat,
            place: x / self.fixed.natural,
            speed,
            current,
            volts: self.drive == Drive::Voltage,
            last: self.given.last,
            area: self.dc / self.corner(),
        }
    }

    fn go_on(&mut self, coil: &Coil) {
        let finite = |x: f64| if x.is_finite() { x } else { 0.0 };
        // Heat is kept even if this profile allows less: a coil cools by itself.
        self.given.heat = finite(coil.heat).max(0.0);
        self.given.plant.state =
            [finite(coil.place) * self.fixed.natural, finite(coil.speed), finite(coil.current)];
        (self.given.last, self.dc) = (0.0, 0.0);
        if coil.volts == (self.drive == Drive::Voltage) {
            self.given.last = finite(coil.last);
            self.dc = finite(coil.area) * self.corner();
        }
        self.given.last = self.given.last.clamp(-self.fixed.peak, self.fixed.peak);
        self.given.settle();
    }

    fn rating(&self) -> f64 {
        self.fixed.rated
    }

    fn cools_in(&self) -> f64 {
        self.cools_in
    }

    fn peak(&self) -> f64 {
        self.fixed.peak
    }
}
