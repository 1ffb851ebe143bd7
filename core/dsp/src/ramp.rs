//! A value that changes linearly instead of jumping.

use asperity_state::State;

/// A value that moves to each new target linearly, in a fixed number of steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    now: f64,
    target: f64,
    /// Change per step.
    by: f64,
    /// Remaining steps.
    left: u32,
    steps: u32,
}

impl Ramp {
    /// Starts at rest at the finite `value`. A new target is reached in `steps`, at least one.
    pub fn new(value: f64, steps: u32) -> Self {
        Self { now: value, target: value, by: 0.0, left: 0, steps: steps.max(1) }
    }

    /// Sets a new finite target. The same target again changes nothing.
    pub fn set(&mut self, target: f64) {
        if target != self.target {
            self.target = target;
            self.head();
        }
    }

    fn head(&mut self) {
        self.by = (self.target - self.now) / f64::from(self.steps);
        self.left = self.steps;
    }

    /// The value, if it is at its target.
    pub fn at_rest(&self) -> Option<f64> {
        (self.left == 0).then_some(self.now)
    }

    /// Moves one step and returns the value. The last step returns exactly the target.
    pub fn step(&mut self) -> f64 {
        match self.left {
            0 => {}
            1 => (self.left, self.now) = (0, self.target),
            _ => (self.left, self.now) = (self.left - 1, self.now + self.by),
        }
        self.now
    }

    /// Jumps to the target.
    pub fn reset(&mut self) {
        (self.left, self.now) = (0, self.target);
    }

    /// Saves or restores the position. A ramp with another target or length starts from there.
    pub fn state(&mut self, state: &mut State<'_>) {
        let mut that = *self;
        state.keep(&mut that.now).keep(&mut that.target).keep(&mut that.by).keep(&mut that.left);
        if !state.restores() {
            return;
        }
        state.require(that.now.is_finite() && that.by.is_finite());
        if state.failed() {
            return;
        }
        if that.target == self.target && that.left <= self.steps {
            *self = that;
        } else {
            self.now = that.now;
            self.head();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pass(from: &mut Ramp, to: &mut Ramp) -> bool {
        let bytes = crate::testing::saved(|s| from.state(s));
        State::restore(&bytes, |s| to.state(s))
    }

    #[test]
    fn ramp_is_linear_and_ends_at_its_target() {
        let mut ramp = Ramp::new(1.0, 4);
        ramp.set(3.0);
        assert_eq!([ramp.step(), ramp.step()], [1.5, 2.0]);
        ramp.set(3.0);
        assert_eq!((ramp.step(), ramp.at_rest()), (2.5, None));
        ramp.set(0.5);
        assert_eq!([0; 5].map(|_| ramp.step()), [2.0, 1.5, 1.0, 0.5, 0.5]);
        assert_eq!(ramp.at_rest(), Some(0.5));
        let mut odd = Ramp::new(0.0, 7);
        odd.set(0.1);
        assert_eq!((0..7).map(|_| odd.step()).last(), Some(0.1));
        odd.set(0.7);
        odd.reset();
        assert_eq!(odd.at_rest(), Some(0.7));
    }

    #[test]
    fn restored_ramp_continues() {
        let mut old = Ramp::new(1.0, 10);
        old.set(2.0);
        old.step();
        let mut same = Ramp::new(2.0, 10);
        assert!(pass(&mut old, &mut same));
        assert_eq!(same, old);
        let mut other = Ramp::new(-1.0, 2);
        assert!(pass(&mut old, &mut other));
        assert!((other.step() - 0.05).abs() < 1e-12 && other.step() == -1.0);
        for now in [f64::NAN, f64::INFINITY] {
            assert!(!pass(&mut Ramp { now, ..old }, &mut same));
            assert_eq!(same, old);
        }
    }
}
