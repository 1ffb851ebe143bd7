//! The last stage before a device: protects the coil from any input.
//!
//! Every sample goes through the same chain. Nothing looks ahead, so nothing is delayed:
//!
//! 1. A sample that is not finite becomes the last good one, fading within milliseconds. Input is cut
//!    at four times the peak, so that no number leaves a long memory.
//! 2. DC is removed: u = x - m, where m follows the mean of the *output*, m' = m + w_dc y / rate.
//!    Without limiting this is the first-order high-pass s / (s + w_dc). As m is bounded, the output's
//!    mean is bounded too, however the later stages skew the wave.
//! 3. One gain of at most 1 falls at once and recovers slowly. It is the least of: peak / |u|; the
//!    power the coil may still take over the power of u; stroke / r of a simulated coil driven by u.
//! 4. Walls catch what the gain did not foresee, as it looks at u. They bound the current by the state
//!    of a second simulated coil that gets exactly the device's samples.
//! 5. Peak and slew are enforced exactly, sample by sample.
//!
//! **Heat.** e is the mean of I^2 over the coil's thermal time constant tau (first order, as a coil
//! warms). The wall allows I^2 <= I_r^2 + (I_r^2 - e) tau / T. Then e approaches the rating I_r^2 with
//! time constant T and never passes it. T is at least four times the time that the current takes to
//! follow the wall. The gain does the same with a longer T and 2 % below, without cutting the wave. No
//! voltage can stop a coil that brakes its own motion; its heat is bounded by that motion, see below.
//!
//! **Stroke.** The bound is on r = sqrt(x^2 + (x' / w_n)^2), the swing that would follow if the drive
//! stopped now; |x| is never larger. A drive that adds energy is cut so that r^2 approaches the stroke
//! with a time constant of a fraction of a millisecond. Added energy is judged at the speed that the
//! present and the wanted current would still bring before they can end; energy lost to damping, at the
//! present speed. A drive that removes energy is not cut unless it would turn the mover around within a
//! sample. Under a voltage r is also bounded by the heat that the coil could bear beside e if it were
//! shorted now: e + (w_n r)^2 mu k_f^2 / (2 R tau (R c + k_f^2)) goes little over I_r^2.

use asperity_diagnostics::Diagnostic;
use asperity_numbers::Elementary as _;
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

use asperity_state::State;

mod guard;
mod run;

use super::{Drive, Dynamics, Plant, check};
pub use guard::ChannelGuard;
use run::{Fixed, Run};

/// Settings of a limiter. None can switch it off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimiterSettings {
    /// Corner of the DC removal, a first-order high-pass \[Hz\], 0.5 to 20. At 5 Hz it costs 0.06 dB at
    /// 40 Hz.
    pub dc_corner_hz: f64,
    /// A sine of peak amplitude up to this frequency passes the slew limit \[Hz\], 500 to 20000.
    pub slew_hz: f64,
    /// Recovery of the gain after limiting: time constant \[s\], 0.01 to 5. A grating's ridges have
    /// high peaks; a gain that stays low between them costs level.
    pub release_s: f64,
    /// Fade-out time of muting \[s\], 0.001 to 0.02.
    pub mute_s: f64,
    /// Fade-in time after muting \[s\], 0.001 to 2.
    pub unmute_s: f64,
}

impl Default for LimiterSettings {
    fn default() -> Self {
        Self { dc_corner_hz: 5.0, slew_hz: 2000.0, release_s: 0.05, mute_s: 0.01, unmute_s: 0.02 }
    }
}

/// Limits that are enforced, in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest |y| \[A or V\].
    pub peak: f64,
    /// Largest |y\[n\] - y\[n-1\]| \[A or V\].
    pub slew_per_sample: f64,
    /// Largest current \[A\].
    pub peak_current: f64,
    /// Largest rms current over the thermal time constant \[A\].
    pub rated_current: f64,
    /// The thermal time constant \[s\].
    pub thermal_time_constant: f64,
    /// Largest |x| \[m\].
    pub stroke: f64,
}

/// Counts and extremes since construction. Reading allocates nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct LimiterReport {
    /// Output samples.
    pub samples: u64,
    /// Input samples that were missing or not finite.
    pub not_finite: u64,
    /// Samples lowered to the peak.
    pub peak: u64,
    /// Samples held back by the slew limit.
    pub slew: u64,
    /// Samples lowered because of the coil's heat.
    pub rms: u64,
    /// Samples lowered because of the stroke.
    pub stroke: u64,
    /// Samples lowered by muting.
    pub muted: u64,
    /// Samples with a gain below 1, recovery included.
    pub reduced: u64,
    /// Least gain, 1 for none.
    pub least_gain: f64,
    /// Largest |y| \[A or V\].
    pub largest: f64,
    /// Rms current over the coil's thermal time constant, now \[A\].
    pub rms_current: f64,
    /// Largest rms current over the coil's thermal time constant \[A\].
    pub largest_rms_current: f64,
    /// Largest |x| of the simulated mover \[m\].
    pub largest_displacement: f64,
    /// DC being removed now \[A or V\].
    pub dc: f64,
}

impl LimiterReport {
    /// Largest reduction of the gain \[dB\], 0 for none.
    pub fn largest_reduction_db(&self) -> f64 {
        -20.0 * self.least_gain.max(1e-20).log_10()
    }

    /// Whether anything but the DC removal changed a sample.
    pub fn acted(&self) -> bool {
        self.not_finite + self.peak + self.slew + self.rms + self.stroke + self.muted + self.reduced > 0
    }
}

const DC_CORNER_HZ: RangeInclusive<f64> = 0.5..=20.0;
const RELEASE_S: RangeInclusive<f64> = 0.01..=5.0;
/// Input is cut at this many peaks.
const CEILING: f64 = 4.0;
/// The gain aims at this part of the rated current and of the stroke. The walls stand at the limits.
const RMS_AIM: f64 = 0.98;
const STROKE_AIM: f64 = 0.95;
const STROKE_WALL: f64 = 0.98;
/// The heat wall gives way no faster than this many times the current's lag.
const WALL_LAGS: f64 = 4.0;
/// Part of the squared rated current up to which a coil may warm by its own motion.
const SHORTED: f64 = 1.015;
/// The slew limit is this part of the stated one, for rounding to f32.
const SLEW_MARGIN: f64 = 0.999;
const TINY: f64 = 1e-30;

/// Protects an actuator. The module describes how.
///
/// Guaranteed for any input, as simulated with its [`Dynamics`]: every output is finite, at most
/// [`Limits::peak`], and no further than [`Limits::slew_per_sample`] from the one before. The rms current
/// over the thermal time constant is at most 1 % over the rating (for a voltage see below), and the mover
/// stays within its stroke. The output's mean over T seconds is at most `8 peak / (2 pi dc_corner_hz T)`. A
/// signal well within the limits is changed by the DC removal only, rounded to f32.
///
/// A random search covered 28 694 actuators like the shipped one, 16 790 of them under a voltage. Its inputs
/// follow the mover to its wall, are squares of 0.5 to 40 times its resonance, or alternate with muting. The
/// farthest reached 0.9996 of its stroke (0.980 under a current), the warmest 1.0002 of its rating. A larger
/// search, of 208 350 under a voltage, found one at 1.024 of its rating. Before the swing was bounded by its
/// heat, coils came up to 10 % over (`tests/past.rs` keeps eight).
///
/// The thermal mean is of first order, as a coil warms. A mean over a window of one time constant can read up
/// to sqrt(2) of the rating just after a cold start.
///
/// 96 samples take 1.1 us (current) or 1.3 us (voltage) without limiting, 1.5 us or 1.8 us at five times the
/// peak: medians on one of 2 cores of a shared server-class x86-64 with AVX-512, by `benches/actuator.rs`.
#[derive(Clone, Debug)]
pub struct Limiter {
    fixed: Fixed,
    drive: Drive,
    rate_hz: f64,
    limits: Limits,
    run: Run,
    muted: bool,
}

impl Limiter {
    /// A limiter for an actuator on its handle: at rest, cold and not muted.
    ///
    /// # Errors
    /// A setting out of range; a rate below 4 kHz, above 1 MHz, or below 16 times the resonance; an
    /// actuator too strong for its stroke at this rate and slew.
    pub fn new(
        dynamics: &Dynamics,
        drive: Drive,
        rate_hz: f64,
        settings: LimiterSettings,
    ) -> Result<Self, Diagnostic> {
        let s = settings;
        check("a DC removal's corner", s.dc_corner_hz, *DC_CORNER_HZ.start(), *DC_CORNER_HZ.end(), "Hz")?;
        check("a slew frequency", s.slew_hz, 500.0, 20_000.0, "Hz")?;
        check("a release time", s.release_s, *RELEASE_S.start(), *RELEASE_S.end(), "s")?;
        check("a muting time", s.mute_s, 0.001, 0.02, "s")?;
        check("an unmuting time", s.unmute_s, 0.001, 2.0, "s")?;
        let least = (16.0 * dynamics.natural_hz()).max(4000.0);
        check("a rate", rate_hz, least, 1e6, "Hz")?;

        let exact_peak = match drive {
            Drive::Current => dynamics.peak_current,
            Drive::Voltage => dynamics.peak_voltage,
        };
        // The largest f32 not above the peak.
        let peak = exact_peak as f32;
        let peak = f64::from(if f64::from(peak) > exact_peak { peak.next_down() } else { peak });
        let slew = (TAU * s.slew_hz * peak / rate_hz).min(2.0 * peak);
        let (tau, mu) = (dynamics.thermal_time_constant, dynamics.reduced_mass());
        let natural = dynamics.natural_rad_s();
        // Least time for a current to end, and units of a sample in an ampere.
        let (coil, per_amp) = match drive {
            Drive::Current => (0.0, 1.0),
            Drive::Voltage => (dynamics.inductance / dynamics.resistance, dynamics.resistance),
        };
        let lag = 1.0 / rate_hz + coil;
        // The current must be able to follow the walls from peak to peak, through the coil.
        let swing_time = (8.0 / (TAU * s.slew_hz)).max(5e-4) + 4.0 * coil;
        guard(dynamics, drive, lag, lag + 0.5 * per_amp * dynamics.peak_current / (slew * rate_hz))?;
        let rated = dynamics.rated_current.powi(2);
        let push = dynamics.force_factor / mu;
        let swing = |part: f64| (part * natural * dynamics.stroke).powi(2);
        let fixed = Fixed {
            peak,
            slew: slew * SLEW_MARGIN,
            ceiling: CEILING * peak,
            dc: dc_part(s.dc_corner_hz, rate_hz),
            release: release_part(s.release_s, rate_hz),
            hold: (-1.0 / (0.002 * rate_hz)).exp_e(),
            mute: 1.0 / (s.mute_s * rate_hz).max(1.0),
            unmute: 1.0 / (s.unmute_s * rate_hz).max(1.0),
            peak_current: dynamics.peak_current,
            rated,
            aim: RMS_AIM * RMS_AIM * rated,
            heat: -(-1.0 / (tau * rate_hz)).exp_less_1(),
            short: -(-1.0 / (0.02 * rate_hz)).exp_less_1(),
            wall: tau / (tau / 40.0).min(0.005).max(WALL_LAGS * (lag + 1.0 / (TAU * s.slew_hz))),
            budget: tau / (tau / 4.0).min(0.1),
            swing_aim: swing(STROKE_AIM),
            swing_wall: swing(STROKE_WALL),
            coolness: SHORTED * rated,
            per_warmth: 1.0 / warmth_of_swing(dynamics, drive),
            approach: 0.5 / swing_time / push,
            drag: dynamics.damping / mu / push,
            kick: push * lag,
            creep: push * 0.5 * per_amp / (slew * SLEW_MARGIN * rate_hz),
            natural,
            resistance: dynamics.resistance,
            emf: dynamics.force_factor,
        };
        let limits = Limits {
            peak,
            slew_per_sample: slew,
            peak_current: dynamics.peak_current,
            rated_current: dynamics.rated_current,
            thermal_time_constant: tau,
            stroke: dynamics.stroke,
        };
        let run = Run::new(Plant::new(dynamics, drive, rate_hz));
        Ok(Self { fixed, drive, rate_hz, limits, run, muted: false })
    }

    /// The limits.
    pub fn limits(&self) -> Limits {
        self.limits
    }

    /// The meaning of a sample.
    pub fn drive(&self) -> Drive {
        self.drive
    }

    /// Sets the corner of the DC removal \[Hz\] between blocks; see [`LimiterSettings::dc_corner_hz`].
    /// The DC found so far stays. Outside 0.5 to 20 nothing changes.
    pub fn set_dc_corner(&mut self, hz: f64) {
        if DC_CORNER_HZ.contains(&hz) {
            self.fixed.dc = dc_part(hz, self.rate_hz);
        }
    }

    /// Sets the recovery of the gain \[s\] between blocks; see [`LimiterSettings::release_s`]. The gain
    /// itself does not jump. Outside 0.01 to 5 nothing changes.
    pub fn set_release(&mut self, seconds: f64) {
        if RELEASE_S.contains(&seconds) {
            self.fixed.release = release_part(seconds, self.rate_hz);
        }
    }

    /// Fades to zero or back. Muted input still counts for DC and for the simulated coil, so that the
    /// return is smooth.
    pub fn set_muted(&mut self, muted: bool) {
        self.muted = muted;
    }

    /// Whether it is muted.
    pub fn is_muted(&self) -> bool {
        self.muted
    }

    /// Counts and extremes so far.
    pub fn report(&self) -> LimiterReport {
        let run = &self.run;
        LimiterReport {
            rms_current: run.given.heat.sqrt(),
            largest_rms_current: run.given.hottest.sqrt(),
            largest_displacement: run.given.farthest / self.fixed.natural,
            dc: run.dc,
            ..run.report
        }
    }

    /// Fills `output` \[A or V\] from `input` \[A or V\]. The block length does not matter. Missing
    /// input counts as not finite and fades. No allocation.
    pub fn process(&mut self, input: &[f32], output: &mut [f32]) {
        match self.drive {
            Drive::Current => self.run.block::<false>(&self.fixed, self.muted, input, output),
            Drive::Voltage => self.run.block::<true>(&self.fixed, self.muted, input, output),
        }
        self.run.settle(&self.fixed);
    }

    /// Whether silence gives silence: the signal has ended, the coil lies still and the gain is back.
    /// The coil may still be warm.
    pub fn rests(&self) -> bool {
        !self.muted && self.run.rests()
    }

    /// The same to the bit as [`process`](Self::process) of so many samples of silence, while it
    /// [rests](Self::rests).
    pub fn rest(&mut self, samples: usize) {
        self.run.rest(&self.fixed, samples);
        self.run.settle(&self.fixed);
    }

    /// State: the signal, the gain, and the coil's motion and heat. The report is not part of it.
    ///
    /// A limiter with other settings or for another actuator goes on from it within its own limits: a
    /// last sample above its peak counts as at the peak, and a coil too warm for it gets nothing until
    /// it has cooled. For another kind of drive only the coil's motion and heat are taken over. A state
    /// that no limiter can reach is refused and changes nothing.
    pub fn state(&mut self, state: &mut State<'_>) {
        let mut voltage = self.drive == Drive::Voltage;
        let mut run = self.run.clone();
        state.keep(&mut voltage);
        run.state(state);
        if !state.restores() {
            return;
        }
        state.require(run.hold(&self.fixed));
        if state.failed() {
            return;
        }
        if voltage == (self.drive == Drive::Voltage) {
            self.run = run;
        } else {
            (self.run.given.plant, self.run.given.heat) = (run.given.plant, run.given.heat);
        }
    }

    /// Raises the coil's heat to at least this \[A^2\], as known elsewhere. Differences below 1 % are
    /// ignored: they arise between two threads that look at the same coil.
    pub fn warm(&mut self, heat: f64) {
        let given = &mut self.run.given;
        if heat.is_finite() && heat > 1.01 * given.heat && heat > 1e-6 * self.fixed.rated {
            given.heat = heat;
        }
    }

    /// A guard that holds a device's channel to the same limits: at rest and cold.
    pub fn guard(&self) -> ChannelGuard {
        ChannelGuard::new(self)
    }

    /// Starts a new signal at rest. The coil's heat and the report stay.
    ///
    /// The next output may differ from the last by up to the slew.
    pub fn reset(&mut self) {
        let Run { report, given, mute, asked, .. } = self.run.clone();
        self.run = Run { report, given, mute, ..Run::new(asked) };
    }
}

/// Part of a sample that the removed DC follows.
fn dc_part(corner_hz: f64, rate_hz: f64) -> f64 {
    TAU * corner_hz / rate_hz
}

/// Part of its way back that the gain goes in a sample.
fn release_part(release_s: f64, rate_hz: f64) -> f64 {
    -(-1.0 / (release_s * rate_hz)).exp_less_1()
}

/// Largest rise of the mean of I^2 per square of w_n r (r is the swing) when only its own motion drives
/// a coil: shorted by muting, or with a back-EMF beyond the peak voltage. Of the energy mu (w_n r)^2 /
/// 2 the part `(k_f^2 / R) / (c + k_f^2 / R)` heats the coil. R tau warms it by 1 A^2. It is 0 for a
/// current drive, which no motion drives.
fn warmth_of_swing(d: &Dynamics, drive: Drive) -> f64 {
    let braked = d.force_factor.powi(2) / d.resistance;
    let part = braked / (d.damping + braked);
    let warms = 0.5 * d.reduced_mass() * part / (d.resistance * d.thermal_time_constant);
    if drive == Drive::Current { 0.0 } else { warms }
}

/// Refuses actuators that no limiter without foresight keeps within their stroke: the current still
/// pushes too far while it ends, or the back-EMF acts within a sample. Well beyond these bounds random
/// search finds inputs that pass the stroke.
fn guard(d: &Dynamics, drive: Drive, lag: f64, end: f64) -> Result<(), Diagnostic> {
    let push = d.force_factor * d.peak_current / d.reduced_mass();
    let share = push * end / (d.natural_rad_s() * d.stroke);
    let most = if drive == Drive::Current { 0.2 } else { 0.1 };
    if share.is_nan() || share > most {
        return Err(Diagnostic::new(format!(
            "at its peak current this actuator reaches {share:.2} of the speed that its stroke allows; \
             the limiter needs at most {most}. Use a higher rate or slew, or a lower peak current"
        )));
    }
    let emf = d.reduced_mass() * d.resistance / d.force_factor.powi(2);
    if drive == Drive::Voltage && emf < 4.0 * lag {
        return Err(Diagnostic::new(format!(
            "this actuator's back-EMF acts within {:.0} us, and at least {:.0} us can be limited: use a \
             higher rate, or a current drive",
            emf * 1e6,
            4.0 * lag * 1e6
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
