//! Position of a stylus between two ticks.

use asperity_state::State;

use super::bounds::{counted, counted_vector};

/// Curve of a path through the positions that are reported once a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Smoothing {
    /// Through every position, with the velocity reported there: a cubic Hermite curve from one tick to the
    /// next. It is exact for motion of constant acceleration with exact velocities. It shows where the stylus
    /// was one tick less one sample ago.
    #[default]
    Hermite,
    /// Between the positions: along a parabola (a spline of second degree), from the middle of the last two
    /// to the middle of the newest two. So the velocity goes in straight lines between the differences of the
    /// positions. The reported velocity does not count. It takes half a tick more, and is the smoothest path
    /// that positions alone give. Made for devices that report positions in coarse steps.
    Parabola,
}

/// A place on a path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Along the surface, in mm.
    pub position_mm: [f64; 2],
    /// In mm/s.
    pub velocity_mm_s: [f64; 2],
    /// In mm/s^2; it may jump from tick to tick.
    pub acceleration_mm_s2: [f64; 2],
}

/// A path along the surface. It is given a position once a tick, and read once a sample. Position and
/// velocity are continuous.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    smoothing: Smoothing,
    tick_hz: f64,
    /// Position and velocity at the last tick, and position at the one before.
    last: Option<([f64; 2], [f64; 2], [f64; 2])>,
    /// Along each axis, powers of the part of the tick, from the constant on, in mm.
    cubic: [[f64; 4]; 2],
}

impl Path {
    /// A path without any position yet.
    pub fn new(smoothing: Smoothing, tick_hz: u32) -> Self {
        Self { smoothing, tick_hz: f64::from(tick_hz.max(1)), last: None, cubic: [[0.0; 4]; 2] }
    }

    /// Goes on to the position of the stylus now. Call it once a tick; the path goes from the position at the
    /// tick before to this one. A path that begins has a constant velocity. A position that is not finite
    /// counts as the last one, at rest. A velocity that is not finite counts as the difference of the
    /// positions.
    pub fn advance(&mut self, position_mm: [f64; 2], velocity_mm_s: [f64; 2]) {
        let told = position_mm.iter().all(|x| x.is_finite());
        let velocity = if told && velocity_mm_s.iter().all(|v| v.is_finite()) {
            Some(velocity_mm_s.map(counted))
        } else {
            None
        };
        let position = match self.last {
            Some((last, ..)) if !told => last,
            _ => counted_vector(position_mm),
        };
        let (before, from, earlier) = self.last.unwrap_or_else(|| {
            let way = velocity.unwrap_or_default().map(|v| v / self.tick_hz);
            let back = |n: f64| [0, 1].map(|i| position[i] - n * way[i]);
            (back(1.0), velocity.unwrap_or_default(), back(2.0))
        });
        let to = velocity.unwrap_or_else(|| [0, 1].map(|i| (position[i] - before[i]) * self.tick_hz));
        self.cubic = [0, 1].map(|i| match self.smoothing {
            Smoothing::Hermite => {
                let (rise, start, end) =
                    (position[i] - before[i], from[i] / self.tick_hz, to[i] / self.tick_hz);
                [before[i], start, 3.0 * rise - 2.0 * start - end, start + end - 2.0 * rise]
            }
            Smoothing::Parabola => {
                let (start, end) = (before[i] - earlier[i], position[i] - before[i]);
                [0.5 * (earlier[i] + before[i]), start, 0.5 * (end - start), 0.0]
            }
        });
        self.last = Some((position, to, before));
    }

    /// The place at a part of the tick, 0 to 1.
    #[inline]
    pub fn at(&self, part: f64) -> Point {
        let (s, hz) = (part, self.tick_hz);
        let of = |f: fn([f64; 4], f64) -> f64, scale: f64| self.cubic.map(|c| scale * f(c, s));
        Point {
            position_mm: of(|[a, b, c, d], s| a + s * (b + s * (c + s * d)), 1.0),
            velocity_mm_s: of(|[_, b, c, d], s| b + s * (2.0 * c + s * 3.0 * d), hz),
            acceleration_mm_s2: of(|[_, _, c, d], s| 2.0 * c + s * 6.0 * d, hz * hz),
        }
    }

    /// Latency of the path \[s\] at an audio rate: one tick less one sample, or half a tick more.
    pub fn delay_s(&self, rate_hz: u32) -> f64 {
        let ticks = if self.smoothing == Smoothing::Hermite { 1.0 } else { 1.5 };
        ticks / self.tick_hz - 1.0 / f64::from(rate_hz.max(1))
    }

    /// Ticks a second.
    pub fn tick_hz(&self) -> f64 {
        self.tick_hz
    }

    /// Forgets where the stylus was: it was put down elsewhere.
    pub fn reset(&mut self) {
        *self = Self { last: None, cubic: [[0.0; 4]; 2], ..*self };
    }

    /// Last positions of the stylus.
    pub fn state(&mut self, state: &mut State<'_>) {
        let mut known = self.last.is_some();
        let (mut position, mut velocity, mut before) = self.last.unwrap_or_default();
        state
            .keep(&mut known)
            .keep(&mut position)
            .keep(&mut velocity)
            .keep(&mut before)
            .keep(&mut self.cubic);
        if state.restores() {
            self.last = known.then_some((position, velocity, before));
            let all = position.iter().chain(&velocity).chain(&before).chain(self.cubic.iter().flatten());
            let sound = all.into_iter().all(|x| x.abs() < 1e12);
            if !sound {
                self.reset();
            }
            state.require(sound);
        }
    }
}

/// Times of the samples within one tick. Sample `n` of a rate stands at the time `(n + 1) / rate` after the
/// start. So whatever their number (96, 88 or 89, 0), all stand above 0 and at most at 1, a sample apart.
/// They are counted in integers, so that no tick is shorter because it has fewer samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parts {
    /// Of the first sample, and from one to the next: numerators over the rate.
    first: f64,
    step: f64,
    rate: f64,
}

impl Parts {
    /// Samples of tick number `tick`, from number `first` on. The tick's first sample is
    /// floor(`tick` `rate_hz` / `tick_hz`).
    pub fn new(tick: u64, first: u64, rate_hz: u32, tick_hz: u32) -> Self {
        let (rate, hz) = (i128::from(rate_hz.max(1)), i128::from(tick_hz.max(1)));
        let ahead = (i128::from(first) + 1) * hz - i128::from(tick) * rate;
        Self { first: ahead.clamp(0, rate) as f64, step: hz as f64, rate: rate as f64 }
    }

    /// The part of the tick at which its sample `n`, from 0, stands; held at 1 behind the last.
    #[inline]
    pub fn at(&self, n: usize) -> f64 {
        ((self.first + self.step * n as f64) / self.rate).min(1.0)
    }

    /// Samples a second.
    pub fn rate_hz(&self) -> f64 {
        self.rate
    }
}

#[cfg(test)]
#[path = "path_tests.rs"]
mod tests;
