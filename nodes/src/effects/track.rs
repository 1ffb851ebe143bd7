//! Path of the stylus along a surface, from positions alone.

use super::path::Path;
use crate::prelude::*;
use asperity_dsp::filter::{Biquad, Section};

/// A path through the positions that are reported once a tick.
///
/// The first position of a stroke is known after one tick, and the speed after two. So a path begins in the
/// second tick, with that velocity.
pub(super) struct Track {
    path: Path,
    tick_hz: f64,
    stroke: f64,
    /// Position of the tick before, once there was one.
    before: Option<[f64; 2]>,
    begun: bool,
    /// Whether it began in the last tick.
    begins: bool,
    smooth: Option<[Biquad; 2]>,
}

impl Track {
    /// A track whose positions go through a low-pass of second order (Butterworth), unless its cutoff is 0.
    pub(super) fn new(setup: &Setup<'_>, smooth_hz: f64) -> Result<Self, Diagnostic> {
        let tick_hz = f64::from(setup.tick_hz);
        let low_pass = || Section::butterworth_low_pass(smooth_hz).bilinear(tick_hz, smooth_hz);
        let smooth = (smooth_hz > 0.0).then(low_pass).transpose().map_err(|e| {
            let help = format!("below {} Hz, half of the tick rate; or 0 for none", tick_hz / 2.0);
            setup.params.error("smooth_hz", e.to_string()).help(help)
        })?;
        let path = Path::new(setup.tick_hz);
        let smooth = smooth.map(|filter| [filter; 2]);
        Ok(Self { path, tick_hz, stroke: 0.0, before: None, begun: false, begins: false, smooth })
    }

    /// Goes on to the position of the stylus in this tick. `stroke` changes where the stylus was put down
    /// anew. Returns the path of the tick, once it is known. A position that is not finite counts as the one
    /// before.
    pub(super) fn advance(&mut self, place_mm: [f64; 2], stroke: f64) -> Option<&Path> {
        // A stroke that is NaN does not count as another one.
        if stroke != self.stroke && !stroke.is_nan() {
            self.reset();
            self.stroke = stroke;
        }
        self.begins = false;
        let told = place_mm.iter().all(|x| x.is_finite());
        let place = match (self.before, told) {
            (_, true) => self.smoothed(place_mm),
            (Some(before), false) => before,
            (None, false) => return None,
        };
        let before = self.before.replace(place)?;
        if self.begun {
            self.path.advance(place, [f64::NAN; 2]);
        } else {
            (self.begun, self.begins) = (true, true);
            self.path.advance(place, [0, 1].map(|i| (place[i] - before[i]) * self.tick_hz));
        }
        Some(&self.path)
    }

    /// Whether the path of this tick is new, and does not continue one of the tick before.
    pub(super) fn begins(&self) -> bool {
        self.begins
    }

    fn smoothed(&mut self, place: [f64; 2]) -> [f64; 2] {
        let begins = self.before.is_none();
        let Some(filters) = &mut self.smooth else { return place };
        let mut out = place;
        for (x, filter) in out.iter_mut().zip(filters) {
            if begins {
                filter.reset_to(*x);
            }
            *x = filter.step(*x);
            filter.settle();
        }
        out
    }

    /// Forgets where the stylus was.
    pub(super) fn reset(&mut self) {
        self.path.reset();
        (self.stroke, self.before, self.begun) = (0.0, None, false);
        self.smooth.iter_mut().flatten().for_each(Biquad::reset);
    }

    /// Last positions of the stylus. Positions that were smoothed otherwise stay as they were.
    pub(super) fn state(&mut self, state: &mut State<'_>) {
        let mut made_for = self.smooth.map_or([0.0; 5], |[f, _]| {
            let ([b0, b1, b2], [a1, a2]) = (f.numerator(), f.denominator());
            [b0, b1, b2, a1, a2]
        });
        let own = made_for;
        state.keep(&mut made_for).keep(&mut self.stroke).keep(&mut self.before).keep(&mut self.begun);
        self.path.state(state);
        let mut none = Biquad::new([1.0, 0.0, 0.0], [0.0; 2]).ok().map(|f| [f; 2]);
        for filter in self.smooth.as_mut().or(none.as_mut()).into_iter().flatten() {
            filter.state(state);
        }
        state.require(self.before.is_none_or(|p| p.iter().all(|x| x.abs() < 1e12)));
        if made_for != own
            && let (Some(filters), Some(place)) = (&mut self.smooth, self.before)
        {
            filters.iter_mut().zip(place).for_each(|(f, x)| f.reset_to(x));
        }
    }

    /// Latency of the path.
    pub(super) fn latency(&self, setup: &Setup<'_>) -> Latency {
        Latency::ratio(3, 2 * i64::from(setup.tick_hz)) + Latency::samples(-1, setup.audio_hz)
    }

    /// Further latency of slow motion by smoothing, in s.
    pub(super) fn lag_s(&self) -> f64 {
        self.smooth.map_or(0.0, |[filter, _]| filter.dc_group_delay() / self.tick_hz)
    }
}
