//! Vibration straight from a height field under the tip.
//!
//! The tip goes along the [`Path`] and rises and falls with the heights `h(x, y)` under it. With the path's
//! position, velocity `v` and acceleration `a` at a sample, the chain rule gives, without any differencing:
//!
//! ```text
//! d^2 h / dt^2 = v H v + grad h . a,      H = [[h_xx, h_xy], [h_xy, h_yy]]
//! ```
//!
//! The result then passes a Butterworth low-pass of fourth order: -3 dB at the cutoff, within 0.1 dB up to
//! 0.62 of it, 0.42 ms late at 1000 Hz. It is bounded before and behind that. So a sine of amplitude `A` and
//! wavelength `l` becomes one of `v / l` Hz and `A (2 pi v / l)^2`.
//!
//! A device that reports positions in steps makes the relief rattle, since it is made of differences of
//! positions: steps of 55 um at 62 mm/s and 500 Hz are as loud as a wave of 2 mm. So positions that come in
//! steps go through a low-pass first (Butterworth of second order at 20 Hz, 11 ms late); the rattle is then
//! 30 dB lower.
//!
//! [`HeightSpline`](super::HeightSpline) gives a [`HeightField`] the derivatives that it takes. The effect of
//! the tip's own size on the heights belongs to the field ([`envelope`]).
//!
//! [`HeightField`]: asperity_surfaces::topography::HeightField
//! [`envelope`]: asperity_surfaces::topography::envelope

use asperity_dsp::filter::{Biquad, Section};
use asperity_numbers::Elementary as _;
use asperity_state::State;

use crate::effects::bounds::check;
use crate::effects::path::{Parts, Path, Point};

/// Damping of the two sections of a Butterworth low-pass of fourth order: cos(pi / 8) and cos(3 pi / 8).
const DAMPING: [f64; 2] = [0.923_879_532_511_286_7, 0.382_683_432_365_089_8];
/// Range of speeds over which the acceleration fades out, in spacings per sample.
const TOO_FAST: (f64, f64) = (1.0, 1.5);

/// Height and derivatives of a surface at a position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Jet {
    pub height_mm: f64,
    /// Along x and y.
    pub slope: [f64; 2],
    /// Second derivatives xx, xy, yy.
    pub curve_per_mm: [f64; 3],
}

/// A surface with its derivatives at any position.
pub(crate) trait Surface {
    /// Height and derivatives at a position in mm. Values that are not finite count as flat.
    fn jet(&self, x_mm: f64, y_mm: f64) -> Jet;

    /// Half of the shortest wavelength in mm; 0 where it is not known. A stylus that passes one of these
    /// lengths in a sample begins to fade. From one and a half on it feels nothing, since that would come
    /// back mirrored (aliasing).
    fn spacing_mm(&self) -> f64 {
        0.0
    }
}

impl<F: Fn(f64, f64) -> Jet> Surface for F {
    fn jet(&self, x_mm: f64, y_mm: f64) -> Jet {
        self(x_mm, y_mm)
    }
}

/// Settings of a relief.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ReliefSettings {
    /// Cutoff of the low-pass.
    pub cutoff_hz: f64,
    /// Largest acceleration.
    pub max_m_s2: f64,
}

impl Default for ReliefSettings {
    fn default() -> Self {
        Self { cutoff_hz: 1000.0, max_m_s2: 200.0 }
    }
}

/// The acceleration of a tip that follows heights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Follower {
    settings: ReliefSettings,
    filters: [Biquad; 2],
}

impl Follower {
    /// A relief at `rate_hz` samples a second, with a cutoff of 20 Hz to 0.45 of that.
    pub(crate) fn new(settings: ReliefSettings, rate_hz: u32) -> Result<Self, String> {
        let rate = f64::from(rate_hz);
        let cutoff = check("a cutoff", settings.cutoff_hz, (20.0, 0.45 * rate), "Hz")?;
        // Cannot fail within the range above.
        let error = |e: asperity_dsp::filter::FilterError| e.to_string();
        let section = |damping: f64| Section::low_pass(cutoff, damping).bilinear(rate, cutoff).map_err(error);
        Ok(Self { settings, filters: [section(DAMPING[0])?, section(DAMPING[1])?] })
    }

    /// Writes the samples of a tick in m/s^2, along the path that was [advanced](Path::advance) to it.
    pub(crate) fn process(
        &mut self,
        heights: &(impl Surface + ?Sized),
        path: &Path,
        parts: &Parts,
        out: &mut [f64],
    ) {
        let most = self.settings.max_m_s2;
        let per_sample = parts.rate_hz() * heights.spacing_mm();
        let [mut first, mut second] = self.filters;
        for (n, out) in out.iter_mut().enumerate() {
            let here = path.at(parts.at(n));
            let x = acceleration(&heights.jet(here.position_mm[0], here.position_mm[1]), &here);
            let x = if x.is_finite() { x.clamp(-most, most) } else { 0.0 };
            let y = second.step(first.step(x * not_too_fast(&here, per_sample)));
            *out = y.clamp(-most, most);
        }
        self.filters = [first, second];
        for filter in &mut self.filters {
            filter.settle();
        }
    }

    /// Clears the low-pass.
    pub(crate) fn reset(&mut self) {
        self.filters.iter_mut().for_each(Biquad::reset);
    }

    /// Memory of the low-pass.
    pub(crate) fn state(&mut self, state: &mut State<'_>) {
        for filter in &mut self.filters {
            filter.state(state);
        }
    }
}

/// The second derivative of the height along the path, in m/s^2.
#[inline]
fn acceleration(jet: &Jet, here: &Point) -> f64 {
    let ([vx, vy], [ax, ay]) = (here.velocity_mm_s, here.acceleration_mm_s2);
    let [xx, xy, yy] = jet.curve_per_mm;
    1e-3 * (vx * vx * xx + 2.0 * vx * vy * xy + vy * vy * yy + jet.slope[0] * ax + jet.slope[1] * ay)
}

/// Factor of the acceleration: 1, falling to 0 for a stylus that passes the spacing too fast for the rate.
#[inline]
fn not_too_fast(here: &Point, per_sample: f64) -> f64 {
    let [vx, vy] = here.velocity_mm_s;
    let square = vx * vx + vy * vy;
    if square <= (TOO_FAST.0 * per_sample).powi(2) || per_sample <= 0.0 {
        return 1.0;
    }
    let t = (square.sqrt() / per_sample - TOO_FAST.0) / (TOO_FAST.1 - TOO_FAST.0);
    if t < 1.0 { 0.5 + 0.5 * (std::f64::consts::PI * t).cosine() } else { 0.0 }
}

#[cfg(test)]
#[path = "follow_tests.rs"]
mod tests;
