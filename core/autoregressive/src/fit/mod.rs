//! Fits a texture to a recording of force, speed and acceleration, as in Culbertson, Unwin and Kuchenbecker
//! 2014 ("Modeling and rendering realistic textures from unconstrained tool-surface interactions"): cut where
//! it changes, fit each piece, merge pieces at one speed and force into a model, join the models by
//! triangles.
//!
//! `docs/explanation/textures.md` lists the steps. In detail:
//!
//! - Blocks of 10 ms are dropped in this order. Still: no axis changes for 20 ms. Clipped: one axis stays at
//!   its highest or lowest value for 1 ms; three blocks before and behind go too. No contact, then slow: the
//!   mean of five blocks is too low. Clicks: at most 50 ms within a second in which the power of the signal's
//!   differences is 20 dB above that second's median; a block before and behind goes too. Dead: for 100 ms or
//!   more, the power of 50 ms is 20 dB below its expected value. That is the median of the rest of the
//!   recording at similar speeds and forces, or at no higher ones, whichever is larger. A block before and
//!   behind goes too. A straight line replaces all these blocks, so that no filter rings.
//! - Several axes become one signal after DFT321 (Landin, Romano, McMahan and Kuchenbecker 2010,
//!   "Dimensional reduction of high-frequency accelerations for haptic rendering"). The phase is that of the
//!   loudest axis, since axes may cancel in the sum.
//! - Stretches are cut by binary segmentation (Vostrikova 1981): by speed and force where the sum of squares
//!   gets least, then by spectrum where `n ln s0^2 - n1 ln s1^2 - n2 ln s2^2 > (8 + 2) ln n` (Appel and
//!   Brandt 1983, with Schwarz's criterion). `s^2` is the residual variance of a model of order 8 over all
//!   samples and over those on either side. A residual more than 40 dB below the signal counts as that.
//! - The power that the high-pass took is put back as noise through a low-pass of the same corner, as if the
//!   spectrum were level below twice the corner. Otherwise the high-pass would be fitted too.
//! - Resonances narrower than 0.3 Hz are widened to that, so that a pure tone has a model too.
//! - Border triangles thinner than a hundredth of their length are left out: beyond three models of nearly
//!   equal force the nearest counts.
//!
//! Fitted models have no moving-average part (q = 0). [`Recording::compare`] tells how good a fit is.
//!
//! On a virtual AMD EPYC core a minute of recording takes 25 ms at 1 kHz and 60 ms at 10 kHz.

mod blocks;
mod burg;
mod compare;
mod corners;
mod cut;
mod signal;

use std::fmt;

use asperity_diagnostics::Diagnostic;
use asperity_motion::{MAX_ABS_ACCELERATION_M_S2, MAX_ABS_FORCE_N, MAX_SPEED_MM_S};

use super::{MAX_ORDER, Texture};
use blocks::Blocks;

pub use compare::{Band, Compared, Comparison};

/// Rates of recordings in Hz.
const RATES_HZ: std::ops::RangeInclusive<f64> = 1000.0..=10_000.0;
/// Least samples of a piece for each coefficient.
const SAMPLES_A_COEFFICIENT: f64 = 4.0;

/// A recording: channels of one length and one rate.
#[derive(Clone, Debug)]
pub struct Recording<'a> {
    /// Samples a second, 1 to 10 kHz, rounded to a whole number.
    pub rate_hz: f64,
    /// Normal force in N; negative is no contact.
    pub force_n: &'a [f64],
    /// Speed along the surface in mm/s; the sign does not count.
    pub speed_mm_s: &'a [f64],
    /// Acceleration of the tool in m/s^2: one signal, or two or three axes.
    pub acceleration_m_s2: Vec<&'a [f64]>,
}

/// Criterion to compare orders, summed over all pieces. `s^2` is the residual variance of a piece of
/// `n` samples, `k = p + 1` the number of parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Criterion {
    /// `n ln s^2 + 2 k n / (n - k - 1)` (Hurvich and Tsai 1989): best for prediction. It prefers too
    /// high an order over one too low.
    #[default]
    Aicc,
    /// `n ln s^2 + k ln n` (Schwarz 1978): finds the right order, if there is one.
    Bic,
}

/// The models' order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// A fixed order, 1 to [`MAX_ORDER`].
    Given(usize),
    /// The best of 1 to `most`, at most [`MAX_ORDER`].
    Best {
        /// Highest order to try.
        most: usize,
        /// Criterion for the best.
        by: Criterion,
    },
}

impl Order {
    /// Highest order to fit.
    fn most(self) -> usize {
        match self {
            Self::Given(order) | Self::Best { most: order, .. } => order,
        }
    }
}

/// Largest distance from the middle of the range for a constant speed or force, and largest difference
/// between equal ones: the larger of an absolute and a relative limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Speed in mm/s.
    pub speed_mm_s: f64,
    /// Force in N.
    pub force_n: f64,
    /// Relative limit for both, 0 to 1.
    pub part: f64,
}

impl Tolerance {
    /// Limits at a speed in mm/s and a force in N.
    fn of(&self, [speed, force]: [f64; 2]) -> [f64; 2] {
        [self.speed_mm_s.max(self.part * speed), self.force_n.max(self.part * force)]
    }
}

/// Settings of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Rate of the models in Hz, from 500 Hz to the recording's rate.
    pub model_hz: u32,
    /// Corner of the high-pass in Hz, at most a tenth of the models' rate. 0 is none, for recordings
    /// without slow motion.
    pub high_pass_hz: f64,
    /// The order.
    pub order: Order,
    /// Shortest piece to fit in s, 0.05 to 10.
    pub shortest_s: f64,
    /// Least speed of a stroke in mm/s.
    pub least_speed_mm_s: f64,
    /// Least force of a contact in N.
    pub least_force_n: f64,
    /// Tolerance for constant and for equal speeds and forces.
    pub tolerance: Tolerance,
    /// Most models, 1 to [`MAX_MODELS`](super::MAX_MODELS). If there are more, the tolerance of the
    /// merge grows.
    pub most_models: usize,
}

impl Default for Settings {
    /// Models at 1 kHz, of the best order from 1 to 24 by AICc. Pieces last 0.2 s or more, at 5 mm/s and
    /// 0.05 N or more. Tolerances are 10 mm/s, 0.1 N or a fifth, whichever is more. At most 64 models.
    fn default() -> Self {
        Self {
            model_hz: 1000,
            high_pass_hz: 10.0,
            order: Order::Best { most: 24, by: Criterion::Aicc },
            shortest_s: 0.2,
            least_speed_mm_s: 5.0,
            least_force_n: 0.05,
            tolerance: Tolerance { speed_mm_s: 10.0, force_n: 0.1, part: 0.2 },
            most_models: 64,
        }
    }
}

/// A fitted piece.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Start in s from the recording's beginning.
    pub start_s: f64,
    /// Length in s.
    pub length_s: f64,
    /// Its mean speed in mm/s.
    pub speed_mm_s: f64,
    /// Its mean force in N.
    pub force_n: f64,
    /// Variance in (m/s^2)^2 that its own model of the chosen order leaves unexplained.
    pub residual_variance: f64,
    /// Mean square in (m/s^2)^2, with the power that the high-pass took.
    pub mean_square: f64,
    /// Number of its model, from 0.
    pub model: usize,
}

/// Reason for dropping a stretch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// The acceleration does not change.
    Still,
    /// The acceleration stays at its highest or lowest value.
    Clipped,
    /// Too little force.
    NoContact,
    /// Too slow.
    Slow,
    /// A click.
    Click,
    /// Far quieter than elsewhere at this speed and force: a dead sensor.
    Dead,
    /// Speed or force change too fast.
    Unsteady,
    /// Shorter than the shortest piece.
    Short,
}

impl Why {
    /// All reasons.
    pub const ALL: [Self; 8] = [
        Self::Still,
        Self::Clipped,
        Self::NoContact,
        Self::Slow,
        Self::Click,
        Self::Dead,
        Self::Unsteady,
        Self::Short,
    ];
}

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Still => "without a change of acceleration",
            Self::Clipped => "with the acceleration at its limit",
            Self::NoContact => "without contact",
            Self::Slow => "too slow",
            Self::Click => "around clicks",
            Self::Dead => "silent at a speed and force that sound elsewhere",
            Self::Unsteady => "with speed or force changing",
            Self::Short => "too short between others",
        })
    }
}

/// A dropped stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dropped {
    /// Start in s from the recording's beginning.
    pub start_s: f64,
    /// Length in s.
    pub length_s: f64,
    /// Reason.
    pub why: Why,
}

/// Report of a fit. Each 10 ms of the recording belong to a segment or a dropped stretch.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Length of the recording in whole blocks of 10 ms, in s.
    pub duration_s: f64,
    /// Rate of the models in Hz.
    pub model_hz: f64,
    /// Corner of the high-pass in Hz.
    pub high_pass_hz: f64,
    /// The models' order.
    pub order: usize,
    /// Orders and their criterion, shifted so that the least is 0. Empty where the order was given.
    pub criterion: Vec<(usize, f64)>,
    /// Fitted pieces, in order of time.
    pub segments: Vec<Segment>,
    /// Dropped stretches, in order of time.
    pub dropped: Vec<Dropped>,
    /// Part of the recording's power above half the models' rate, 0 to 1. No model has it.
    pub above: f64,
}

impl Report {
    /// Time dropped for a reason, in s.
    pub fn dropped_s(&self, why: Why) -> f64 {
        self.dropped.iter().filter(|d| d.why == why).map(|d| d.length_s).sum()
    }
}

impl Recording<'_> {
    /// Fits a texture. The same recording and settings give the same bits.
    ///
    /// # Errors
    /// Settings out of range; channels of different lengths; a rate outside 1 to 10 kHz; a sample that is
    /// not finite or out of range, with channel and number; a recording shorter than the shortest piece; no
    /// piece left, with the reasons for which pieces were dropped.
    pub fn fit(&self, settings: &Settings) -> Result<(Texture, Report), Diagnostic> {
        settings.check()?;
        self.check(settings)?;
        let blocks = Blocks::new(self, settings)?;
        let (mut dropped, mut pieces) = (Vec::new(), Vec::new());
        for run in blocks.runs() {
            for steady in cut::steady(&blocks, run, settings, &mut dropped) {
                cut::stationary(&blocks, steady, settings, &mut pieces);
            }
        }
        let mut report = Report {
            duration_s: blocks.duration_s(),
            model_hz: blocks.rate_hz,
            high_pass_hz: settings.high_pass_hz,
            order: 0,
            criterion: Vec::new(),
            segments: Vec::new(),
            dropped: blocks.dropped(dropped),
            above: blocks.above,
        };
        if pieces.is_empty() {
            return Err(nothing(&blocks, &report, settings));
        }
        let lattices = burg::lattices(&blocks, &pieces, settings)?;
        (report.order, report.criterion) = burg::order(&lattices, settings.order);
        let (models, owners) = corners::merge(&blocks, &pieces, &lattices, report.order, settings);
        let owned = pieces.iter().zip(&lattices).zip(owners);
        report.segments = owned
            .map(|((piece, lattice), model)| {
                let [speed_mm_s, force_n] = blocks.mean(piece);
                Segment {
                    start_s: blocks.seconds(piece.start),
                    length_s: blocks.seconds(piece.len()),
                    speed_mm_s,
                    force_n,
                    residual_variance: lattice.residual(report.order),
                    mean_square: lattice.residual(0),
                    model,
                }
            })
            .collect();
        let triangles = corners::triangles(&models);
        Ok((Texture::new(blocks.rate_hz, models, Some(&triangles))?, report))
    }

    fn check(&self, settings: &Settings) -> Result<(), Diagnostic> {
        let refuse = |what: String, help: String| Err(Diagnostic::new(what).help(help));
        if !RATES_HZ.contains(&self.rate_hz) {
            let help = format!("{} to {} Hz; bring it to such a rate", RATES_HZ.start(), RATES_HZ.end());
            return refuse(format!("a recording at {} Hz", self.rate_hz), help);
        }
        if f64::from(settings.model_hz) > self.rate_hz.round() {
            let what = format!("models at {} Hz of a recording at {} Hz", settings.model_hz, self.rate_hz);
            return refuse(what, "models run at the recording's rate at most".into());
        }
        let axes = self.acceleration_m_s2.len();
        if !(1..=3).contains(&axes) {
            return refuse(format!("{axes} axes of acceleration"), "one, two or three".into());
        }
        let (len, limit) = (self.force_n.len(), MAX_ABS_ACCELERATION_M_S2);
        let mut channels = vec![
            ("force", self.force_n, MAX_ABS_FORCE_N, "N"),
            ("speed", self.speed_mm_s, MAX_SPEED_MM_S, "mm/s"),
        ];
        channels.extend(self.acceleration_m_s2.iter().map(|axis| ("acceleration", *axis, limit, "m/s^2")));
        if let Some((name, other, ..)) = channels.iter().find(|(_, samples, ..)| samples.len() != len) {
            let what = format!("{len} samples of force, and {} of {name}", other.len());
            return refuse(what, "channels of one rate and one length".into());
        }
        for (name, samples, limit, unit) in channels {
            // NaN is in no range.
            let bad = samples.iter().enumerate().find(|(_, x)| !(-limit..=limit).contains(*x));
            if let Some((at, x)) = bad {
                let what = format!("the {name} is {x} at sample {at}, at {:.4} s", at as f64 / self.rate_hz);
                return refuse(what, format!("a finite number between -{limit} and {limit} {unit}"));
            }
        }
        let seconds = len as f64 / self.rate_hz;
        if seconds < settings.shortest_s {
            let help = format!("{} s at least, some seconds at each speed and force", settings.shortest_s);
            return refuse(format!("a recording of {seconds:.3} s"), help);
        }
        Ok(())
    }
}

impl Settings {
    fn check(&self) -> Result<(), Diagnostic> {
        let rate = f64::from(self.model_hz);
        let most = self.order.most();
        let t = &self.tolerance;
        let limits = [
            ("a rate of models", rate, 500.0, *RATES_HZ.end(), "Hz"),
            ("a corner of the high-pass", self.high_pass_hz, 0.0, rate / 10.0, "Hz"),
            ("an order", most as f64, 1.0, MAX_ORDER as f64, ""),
            ("a shortest piece", self.shortest_s, 0.05, 10.0, "s"),
            ("a least speed", self.least_speed_mm_s, 0.0, MAX_SPEED_MM_S, "mm/s"),
            ("a least force", self.least_force_n, 0.0, MAX_ABS_FORCE_N, "N"),
            ("a tolerance of speed", t.speed_mm_s, 0.01, MAX_SPEED_MM_S, "mm/s"),
            ("a tolerance of force", t.force_n, 1e-4, MAX_ABS_FORCE_N, "N"),
            ("a tolerance as a part", t.part, 0.0, 1.0, ""),
            ("a number of models", self.most_models as f64, 1.0, super::MAX_MODELS as f64, ""),
        ];
        for (name, value, least, most, unit) in limits {
            if !(least..=most).contains(&value) {
                return Err(Diagnostic::new(format!("{name} of {value} {unit}").trim_end().to_owned())
                    .help(format!("{least} to {most} {unit}").trim_end().to_owned()));
            }
        }
        let (needed, shortest) = (SAMPLES_A_COEFFICIENT * most as f64 / rate, self.shortest_s);
        if shortest < needed {
            return Err(Diagnostic::new(format!("models of order {most} of pieces of {shortest} s"))
                .help(format!("pieces of {needed} s at least, or a lower order")));
        }
        Ok(())
    }
}

/// The error where no piece is left.
fn nothing(blocks: &Blocks, report: &Report, settings: &Settings) -> Diagnostic {
    let dropped = Why::ALL.iter().map(|&why| (why, report.dropped_s(why)));
    let dropped = dropped.filter(|(_, seconds)| *seconds > 0.0);
    let parts: Vec<String> = dropped.map(|(why, seconds)| format!("{seconds:.2} s {why}")).collect();
    let [speed, force] = blocks.greatest();
    let help = if report.dropped_s(Why::Still) > 0.9 * report.duration_s {
        "the acceleration never changes: is it the right channel?".to_owned()
    } else if force < settings.least_force_n {
        format!("the force is {force:.4} N at most: is it in N, and counted positive into the surface?")
    } else if speed < settings.least_speed_mm_s {
        format!("the tool never moves: its speed is {speed:.3} mm/s at most; is it in mm/s?")
    } else {
        "hold speed and force for a second at each of some values".to_owned()
    };
    Diagnostic::new(format!("no stretch of {} s to fit: {}", settings.shortest_s, parts.join(", ")))
        .help(help)
}

#[cfg(test)]
mod tests;
