//! Position of a stylus between two ticks.

use asperity_state::State;

use super::bounds::counted_vector;

/// A place on a path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Point {
    pub position_mm: [f64; 2],
    pub velocity_mm_s: [f64; 2],
    /// It may jump from tick to tick.
    pub acceleration_mm_s2: [f64; 2],
}

/// A path along the surface. It is given a position once a tick, and read once a sample. Position and
/// velocity are continuous.
///
/// Between the positions it runs along a parabola (a spline of second degree), from the middle of the last
/// two to the middle of the newest two. So the velocity goes in straight lines between the differences of the
/// positions, also of a device that reports them in coarse steps. It shows where the stylus was a tick and a
/// half less one sample ago.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Path {
    tick_hz: f64,
    /// Position at the last tick, and at the one before.
    last: Option<[[f64; 2]; 2]>,
    /// Along each axis, powers of the part of the tick, from the constant on, in mm.
    parabola: [[f64; 3]; 2],
}

impl Path {
    /// A path without any position yet.
    pub(crate) fn new(tick_hz: u32) -> Self {
        Self { tick_hz: f64::from(tick_hz.max(1)), last: None, parabola: [[0.0; 3]; 2] }
    }

    /// Goes on to the position of the stylus now. Call it once a tick. A path begins with the constant
    /// velocity that is given; later ones do not count. A position that is not finite counts as the last
    /// one.
    pub(crate) fn advance(&mut self, position_mm: [f64; 2], begins_mm_s: [f64; 2]) {
        let position = match self.last {
            Some([last, _]) if !position_mm.iter().all(|x| x.is_finite()) => last,
            _ => counted_vector(position_mm),
        };
        let [before, earlier] = self.last.unwrap_or_else(|| {
            let way = counted_vector(begins_mm_s).map(|v| v / self.tick_hz);
            [1.0, 2.0].map(|n| [0, 1].map(|i| position[i] - n * way[i]))
        });
        self.parabola = [0, 1].map(|i| {
            let (start, end) = (before[i] - earlier[i], position[i] - before[i]);
            [0.5 * (earlier[i] + before[i]), start, 0.5 * (end - start)]
        });
        self.last = Some([position, before]);
    }

    /// The place at a part of the tick, 0 to 1.
    #[inline]
    pub(crate) fn at(&self, part: f64) -> Point {
        let (s, hz) = (part, self.tick_hz);
        Point {
            position_mm: self.parabola.map(|[a, b, c]| a + s * (b + s * c)),
            velocity_mm_s: self.parabola.map(|[_, b, c]| hz * (b + s * (2.0 * c))),
            acceleration_mm_s2: self.parabola.map(|[_, _, c]| hz * hz * (2.0 * c)),
        }
    }

    /// Forgets where the stylus was: it was put down elsewhere.
    pub(crate) fn reset(&mut self) {
        *self = Self { last: None, parabola: [[0.0; 3]; 2], ..*self };
    }

    /// Last positions of the stylus.
    pub(crate) fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.last).keep(&mut self.parabola);
        let mut all = self.last.iter().flatten().flatten().chain(self.parabola.iter().flatten());
        state.require(all.all(|x| x.abs() < 1e12));
    }
}

/// Times of the samples within one tick. Sample `n` of a rate stands at the time `(n + 1) / rate` after the
/// start. So whatever their number (96, 88 or 89, 0), all stand above 0 and at most at 1, a sample apart.
/// They are counted in integers, so that no tick is shorter because it has fewer samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Parts {
    /// Of the first sample, and from one to the next: numerators over the rate.
    first: f64,
    step: f64,
    rate: f64,
}

impl Parts {
    /// Samples of tick number `tick`, from number `first` on. The tick's first sample is
    /// floor(`tick` `rate_hz` / `tick_hz`).
    pub(crate) fn new(tick: u64, first: u64, rate_hz: u32, tick_hz: u32) -> Self {
        let (rate, hz) = (i128::from(rate_hz.max(1)), i128::from(tick_hz.max(1)));
        let ahead = (i128::from(first) + 1) * hz - i128::from(tick) * rate;
        Self { first: ahead.clamp(0, rate) as f64, step: hz as f64, rate: rate as f64 }
    }

    /// The part of the tick at which its sample `n`, from 0, stands; held at 1 behind the last.
    #[inline]
    pub(crate) fn at(&self, n: usize) -> f64 {
        ((self.first + self.step * n as f64) / self.rate).min(1.0)
    }

    /// Samples a second.
    pub(crate) fn rate_hz(&self) -> f64 {
        self.rate
    }
}

#[cfg(test)]
#[path = "path_tests.rs"]
mod tests;
