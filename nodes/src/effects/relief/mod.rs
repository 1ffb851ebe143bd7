//! `relief`: a texture straight from heights under the tip.
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
//! [`HeightSpline`] gives a [`HeightField`] the derivatives that it takes. The effect of the tip's own size
//! on the heights belongs to the field ([`envelope`]).
//!
//! [`HeightField`]: asperity_surfaces::topography::HeightField
//! [`envelope`]: asperity_surfaces::topography::envelope

mod spline;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use crate::prelude::*;
use asperity_dsp::filter::{Biquad, FilterError, Section};
use asperity_numbers::Elementary as _;
use asperity_scene::Heights;

use super::bounds::check;
use super::gliding;
use super::path::{Parts, Path, Point};
use super::voices::Voice;
use super::{Made, each, gain, made, shared};
pub(super) use spline::HeightSpline;

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

/// The acceleration of a tip that follows heights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Follower {
    max_m_s2: f64,
    filters: [Biquad; 2],
}

impl Follower {
    /// A relief at `rate_hz` samples a second, with a cutoff of 20 Hz to 0.45 of that, and a largest
    /// acceleration.
    pub(crate) fn new(cutoff_hz: f64, max_m_s2: f64, rate_hz: u32) -> Result<Self, String> {
        let rate = f64::from(rate_hz);
        let cutoff = check("a cutoff", cutoff_hz, (20.0, 0.45 * rate), "Hz")?;
        // Cannot fail within the range above.
        let error = |e: FilterError| e.to_string();
        let section = |damping: f64| Section::low_pass(cutoff, damping).bilinear(rate, cutoff).map_err(error);
        Ok(Self { max_m_s2, filters: [section(DAMPING[0])?, section(DAMPING[1])?] })
    }

    /// Writes the samples of a tick in m/s^2, along the path that was [advanced](Path::advance) to it.
    ///
    /// `spacing_mm` is half of the shortest wavelength of the heights; 0 where it is not known. A stylus that
    /// passes one of these lengths in a sample begins to fade. From one and a half on it feels nothing, since
    /// that would come back mirrored (aliasing). Heights that are not finite count as flat.
    pub(crate) fn process(
        &mut self,
        (jet, spacing_mm): (impl Fn(f64, f64) -> Jet, f64),
        path: &Path,
        parts: &Parts,
        out: &mut [f64],
    ) {
        let most = self.max_m_s2;
        let per_sample = parts.rate_hz() * spacing_mm;
        let [mut first, mut second] = self.filters;
        for (n, out) in out.iter_mut().enumerate() {
            let here = path.at(parts.at(n));
            let x = acceleration(&jet(here.position_mm[0], here.position_mm[1]), &here);
            let x = if x.is_finite() { x.clamp(-most, most) } else { 0.0 };
            let y = second.step(first.step(x * not_too_fast(&here, per_sample)));
            *out = y.clamp(-most, most);
        }
        self.filters = [first, second];
        for filter in &mut self.filters {
            filter.settle();
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

/// Heights with the state of their reading.
#[derive(Clone)]
struct Field {
    relief: Follower,
    heights: Arc<HeightSpline>,
    gain: f64,
}

impl Voice for Field {
    fn reset(&mut self) {
        self.relief.filters.iter_mut().for_each(Biquad::reset);
    }

    /// Memory of the low-pass.
    fn state(&mut self, state: &mut State<'_>) {
        self.relief.filters.iter_mut().for_each(|filter| filter.state(state));
    }
}

impl gliding::Kernel for Field {
    fn process(&mut self, path: &Path, parts: &Parts, out: &mut [f64]) {
        let heights = &*self.heights;
        self.relief.process((|x, y| heights.jet(x, y), heights.step_mm()), path, parts, out);
        out.iter_mut().for_each(|x| *x *= self.gain);
    }
}

/// The acceleration of a tip that rises and falls with the heights under it. Slots with the same heights
/// share one copy of them.
pub struct Relief;

fn effect() -> Effect {
    Effect::new("reliefs", Acts::Gliding)
        .form(
            Form::new("", "relief(heights: made(surface: \"hessian\"))")
                .nested("heights")
                .field(number("cutoff_hz", 1000.0, 20.0..=20_000.0, "Hz").doc("corner of the low-pass"))
                .field(number("max_m_s2", 200.0, 0.1..=1e4, "m/s^2").doc("largest acceleration"))
                .field(gain()),
        )
        .check(|settings| heights(settings).map(drop))
}

fn heights(settings: &Settings) -> Result<Heights, Diagnostic> {
    let missing = || settings.node_error("a relief needs `heights`");
    let help = "relief(heights: made(surface: \"hessian\"))";
    Heights::parse(settings.nested("heights").ok_or_else(|| missing().help(help))?)
}

impl Node for Relief {
    fn descriptor() -> Descriptor {
        gliding::descriptor(
            (
                "relief",
                "Renders a texture from a height map: the acceleration of a tip that follows the heights.",
            ),
            "index into `reliefs`, from 0; below 0: silent",
            effect(),
        )
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let mut fields = Made::default();
        let reliefs = each(setup, |settings| {
            let [cutoff_hz, max_m_s2, gain] =
                ["cutoff_hz", "max_m_s2", "gain"].map(|name| settings.number(name));
            let relief = made(settings, Follower::new(cutoff_hz, max_m_s2, setup.audio_hz))?;
            let heights = heights(settings)?;
            let field = || heights.field().map(|field| HeightSpline::new(&field));
            let heights = shared(&mut fields, format!("{heights:?}"), field)?;
            Ok(Field { relief, heights, gain })
        })?;
        gliding::prepare(setup, reliefs, ("height_fields", fields.len() as u64))
    }
}
