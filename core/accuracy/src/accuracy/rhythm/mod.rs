//! Pulses, repetition and steadiness, which a long-term spectrum does not show.
//!
//! A renderer that repeats itself, or that pulses with its frames, can have the right spectrum and still
//! feel like a rattle. [`Rhythm`] has the figures of one signal, [`Rhythm::of_noise_like`] those of Gaussian
//! noise of its spectrum. [`compare`] compares a rendered signal with the truth.
//!
//! All figures are of the wave between [`FIRST_HZ`] and [`END_HZ`], or half the rate where that is less, at
//! 8000 Hz. The band-pass is a mask on the whole signal's Fourier transform.

mod wave;

use super::long_term::mean;
use super::spectrogram::check;
use super::{AccuracyError, LIMIT_DB, SILENCE_M_S2};
use wave::{Band, Wave, likeness, most_alike};

/// First frequency of the wave in Hz.
pub const FIRST_HZ: f64 = 30.0;
/// End of the wave's band in Hz.
pub const END_HZ: f64 = 1000.0;
/// Bands of modulation.
pub const MODULATIONS: usize = 5;
/// Edges of the bands of modulation in Hz; an edge belongs to the band that begins there.
pub const MODULATION_EDGES_HZ: [f64; MODULATIONS + 1] = [2.0, 4.0, 8.0, 15.0, 25.0, 50.0];
/// The band of modulation in which pulses of 50 ms lie.
pub const PULSES: usize = 3;
/// Smallest modulation depth in comparisons.
pub const LEAST_MODULATION: f64 = 0.01;
/// Shortest and longest lag of a repetition \[s\].
pub const LAGS_S: (f64, f64) = (0.02, 0.2);
/// Length of a piece whose level is taken \[s\].
pub const PIECE_S: f64 = 0.05;
/// Range below the loudest piece in which pieces count \[dB\].
pub const PIECE_RANGE_DB: f64 = 40.0;
/// Shortest signal in seconds.
pub const SHORTEST_S: f64 = 0.5;
/// Draws of Gaussian noise whose figures are averaged.
pub const NOISES: u64 = 16;

/// Rhythm of one signal. No figure but `rms` depends on the signal's level.
///
/// Of silence (see the [module above](super)) all figures are 0 but the kurtosis, which is 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rhythm {
    /// Root mean square within the band, in the signal's unit.
    pub rms: f64,
    /// End of the band in Hz.
    pub end_hz: f64,
    /// Modulation depth in each band of [`MODULATION_EDGES_HZ`]: the root mean square of the envelope's part
    /// in the band over the envelope's mean. `1 + m sin` has `m / sqrt 2`.
    pub modulation: [f64; MODULATIONS],
    /// Largest autocorrelation of the envelope over [`LAGS_S`], 0 to 1, without frequencies below 5 Hz, the
    /// inverse of the longest lag. 0 where the rest is below [`LEAST_MODULATION`].
    pub envelope_repetition: f64,
    /// Largest autocorrelation of the wave over the same lags, 0 to 1. A tone has 1, a narrow band of noise
    /// a little less.
    pub wave_repetition: f64,
    /// Kurtosis of the wave: a sine has 1.5, Gaussian noise 3, single pulses much more.
    pub kurtosis: f64,
    /// Standard deviation of the level of pieces of [`PIECE_S`] \[dB\], without pauses: silent pieces, and
    /// those more than [`PIECE_RANGE_DB`] below the loudest.
    pub level_deviation_db: f64,
}

impl Rhythm {
    /// Of a signal of one axis or more in m/s^2, at least 0.5 s. Of several axes the principal one counts:
    /// the direction in which the wave's variance is largest, since one actuator has one axis.
    ///
    /// # Errors
    /// A rate that is not 100 to 1e6 Hz, no axis, a sample that is not finite, less than 0.5 s.
    pub fn new(axes: &[&[f64]], rate_hz: f64) -> Result<Self, AccuracyError> {
        Self::up_to(axes, rate_hz, END_HZ)
    }

    /// As [`new`](Self::new), with a band that ends at `end_hz`, at most [`END_HZ`] and half the rate.
    pub fn up_to(axes: &[&[f64]], rate_hz: f64, end_hz: f64) -> Result<Self, AccuracyError> {
        let (band, end_hz) = band(axes, rate_hz, end_hz)?;
        Ok(Self::of(&Wave::new(&band), end_hz))
    }

    /// Mean of the figures of [`NOISES`] draws of stationary Gaussian noise: of the signal's length, and of
    /// its Welch spectrum (windows of 0.1 s, 10 Hz). The same signal has the same noise. `rms` is the
    /// signal's.
    pub fn of_noise_like(axes: &[&[f64]], rate_hz: f64) -> Result<Self, AccuracyError> {
        let (band, end_hz) = band(axes, rate_hz, END_HZ)?;
        let wave = Wave::new(&band);
        if wave.is_silent() {
            return Ok(Self::of(&wave, end_hz));
        }
        let (powers, step_hz) = wave.spectrum();
        let seconds = wave.samples.len() as f64 / wave.rate_hz;
        Ok(Self { rms: wave.rms(), ..Self::mean_of_noise(&powers, step_hz, seconds, end_hz) })
    }

    /// The same of a spectrum that is known: powers in any unit, `step_hz` apart from 0 Hz on. Between them
    /// they are interpolated, beyond the last there is nothing. `rms` is about 1, or 0 without power.
    ///
    /// # Errors
    /// [`AccuracyError`]: a power that is negative or not finite, by its number; less than 0.5 s or more
    /// than 1000 s; a step that is not 0.01 Hz or more.
    pub fn of_noise(powers: &[f64], step_hz: f64, seconds: f64) -> Result<Self, AccuracyError> {
        if let Some(at) = powers.iter().position(|p| !(0.0..=1e200).contains(p)) {
            return Err(AccuracyError::NotFinite(at));
        }
        if !(SHORTEST_S..=1000.0).contains(&seconds) {
            return Err(AccuracyError::TooShort);
        }
        if !(0.01..=1e6).contains(&step_hz) {
            return Err(AccuracyError::Rate(step_hz));
        }
        let top = powers.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let powers: Vec<f64> = powers.iter().map(|p| p / top).collect();
        Ok(Self::mean_of_noise(&powers, step_hz, seconds, END_HZ))
    }

    fn mean_of_noise(powers: &[f64], step_hz: f64, seconds: f64, end_hz: f64) -> Self {
        let draw = |seed| Band::noise(powers, step_hz, (FIRST_HZ, end_hz), seconds, seed);
        let draws: Vec<Self> = (0..NOISES).map(|seed| Self::of(&Wave::new(&draw(seed)), end_hz)).collect();
        let mean = |f: &dyn Fn(&Self) -> f64| mean(draws.iter().map(f));
        Self {
            rms: mean(&|r| r.rms),
            end_hz,
            modulation: std::array::from_fn(|k| mean(&|r| r.modulation[k])),
            envelope_repetition: mean(&|r| r.envelope_repetition),
            wave_repetition: mean(&|r| r.wave_repetition),
            kurtosis: mean(&|r| r.kurtosis),
            level_deviation_db: mean(&|r| r.level_deviation_db),
        }
    }

    /// Modulation depth from 15 to 25 Hz: that of pulses 40 to 67 ms apart.
    pub fn pulses(&self) -> f64 {
        self.modulation[PULSES]
    }

    /// The larger one of both repetitions, 0 to 1.
    pub fn repetition(&self) -> f64 {
        self.envelope_repetition.max(self.wave_repetition)
    }

    fn of(wave: &Wave, end_hz: f64) -> Self {
        let none = Self {
            rms: wave.rms(),
            end_hz,
            modulation: [0.0; MODULATIONS],
            envelope_repetition: 0.0,
            wave_repetition: 0.0,
            kurtosis: 3.0,
            level_deviation_db: 0.0,
        };
        if wave.is_silent() {
            return none;
        }
        let edges = MODULATION_EDGES_HZ;
        let depths = wave.ripple(edges[0]);
        let lags = wave.lags(LAGS_S.0..=LAGS_S.1);
        let repetition = |samples: &[f64]| most_alike(samples, lags.clone()).map_or(0.0, |(_, r)| r.max(0.0));
        let ripple = wave.ripple(1.0 / LAGS_S.1).samples(wave.samples.len());
        Self {
            modulation: std::array::from_fn(|k| depths.rms(edges[k], edges[k + 1])),
            envelope_repetition: if rms(&ripple) < LEAST_MODULATION { 0.0 } else { repetition(&ripple) },
            wave_repetition: repetition(&wave.samples),
            kurtosis: mean(wave.samples.iter().map(|x| (x / none.rms).powi(4))),
            level_deviation_db: deviation_db(wave),
            ..none
        }
    }
}

/// An envelope, for plots.
#[derive(Clone, Debug, PartialEq)]
pub struct Envelope {
    /// Samples a second.
    pub rate_hz: f64,
    /// The Hilbert envelope over its mean.
    pub over_mean: Vec<f64>,
    /// Frequency in Hz, and the modulation depth from 1 Hz below it to 1 Hz above it.
    pub depths: Vec<(f64, f64)>,
}

/// The envelope from which [`Rhythm::new`] takes its figures, and its modulation from 2 to 50 Hz. Of silence
/// all is 0.
pub fn envelope(axes: &[&[f64]], rate_hz: f64) -> Result<Envelope, AccuracyError> {
    let (band, _) = band(axes, rate_hz, END_HZ)?;
    let wave = Wave::new(&band);
    let silent = wave.is_silent();
    let (ripple, middle) = (wave.ripple(1.0), mean(wave.envelope.iter().copied()));
    let of = |depth: f64| if silent { 0.0 } else { depth };
    let depths = (2..=50).map(f64::from).map(|f| (f, of(ripple.rms(f - 1.0, f + 1.0))));
    let over_mean = wave.envelope.iter().map(|e| of(e / middle));
    Ok(Envelope { rate_hz: wave.rate_hz, over_mean: over_mean.collect(), depths: depths.collect() })
}

/// The envelope's autocorrelation at each lag of [`LAGS_S`] in s, 0.125 ms apart: that of which
/// [`Rhythm::envelope_repetition`] is the largest. Of silence it is 0.
pub fn envelope_likeness(axes: &[&[f64]], rate_hz: f64) -> Result<Vec<(f64, f64)>, AccuracyError> {
    let wave = Wave::new(&band(axes, rate_hz, END_HZ)?.0);
    let ripple = wave.ripple(1.0 / LAGS_S.1).samples(wave.samples.len());
    let quiet = wave.is_silent() || rms(&ripple) < LEAST_MODULATION;
    let found = likeness(&ripple, wave.lags(LAGS_S.0..=LAGS_S.1)).into_iter();
    Ok(found.map(|(lag, r)| (lag as f64 / wave.rate_hz, if quiet { 0.0 } else { r })).collect())
}

/// Checks a signal and takes its band.
fn band(axes: &[&[f64]], rate_hz: f64, end_hz: f64) -> Result<(Band, f64), AccuracyError> {
    let samples = check(axes, rate_hz)?;
    if (samples as f64) < SHORTEST_S * rate_hz - 1e-6 {
        return Err(AccuracyError::TooShort);
    }
    let end_hz = end_hz.min(END_HZ).min(0.5 * rate_hz);
    Ok((Band::new(axes, rate_hz, FIRST_HZ, end_hz), end_hz))
}

fn rms(samples: &[f64]) -> f64 {
    mean(samples.iter().map(|x| x * x)).sqrt()
}

/// Standard deviation of the level of pieces in dB.
fn deviation_db(wave: &Wave) -> f64 {
    let place = |number: usize| (number as f64 * PIECE_S * wave.rate_hz).round() as usize;
    let piece = |number: usize| wave.samples.get(place(number)..place(number + 1));
    let powers: Vec<f64> = (0..).map_while(piece).map(|piece| rms(piece).powi(2)).collect();
    let loudest = powers.iter().copied().fold(0.0, f64::max);
    let least = (loudest * 10f64.powf(-0.1 * PIECE_RANGE_DB)).max(SILENCE_M_S2.powi(2));
    let levels: Vec<f64> = powers.into_iter().filter(|p| *p >= least).map(|p| 10.0 * p.log10()).collect();
    let middle = mean(levels.iter().copied());
    mean(levels.iter().map(|db| (db - middle).powi(2))).sqrt()
}

/// Errors of a rendered signal's rhythm against the truth; 0 is right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RhythmAgreement {
    /// Root mean square over the bands of modulation of `20 log10 (m_r / m_t)` in dB, 0 to [`LIMIT_DB`].
    pub modulation_db: f64,
    /// The same of 15 to 25 Hz alone, with its sign: above 0 the rendered signal pulses more than the truth.
    pub pulses_db: f64,
    /// Difference of the largest autocorrelations, 0 to 1: of envelopes or of waves, whichever differ more.
    pub repetition: f64,
    /// Size of `10 log10 (k_r / k_t)` of kurtoses in dB, 0 to [`LIMIT_DB`].
    pub kurtosis_db: f64,
    /// Size of the difference of the deviations of level in dB, 0 to [`LIMIT_DB`].
    pub steadiness_db: f64,
}

/// Compares a rendered signal with several draws of the truth. Signed errors are averaged over the draws, so
/// that chance averages out. Bands should be the same: see [`Rhythm::up_to`].
///
/// Two silent signals agree. Where one alone is silent, repetition is off by 1, all else by [`LIMIT_DB`].
///
/// # Errors
/// [`AccuracyError::NoAxes`] without a truth.
pub fn compare(rendered: &Rhythm, truths: &[Rhythm]) -> Result<RhythmAgreement, AccuracyError> {
    if truths.is_empty() {
        return Err(AccuracyError::NoAxes);
    }
    let silent = |r: &Rhythm| r.rms < SILENCE_M_S2;
    let over = |f: &dyn Fn(&Rhythm) -> f64, most: f64| {
        let error = |truth: &Rhythm| match (silent(rendered), silent(truth)) {
            (true, true) => 0.0,
            (true, false) => -most,
            (false, true) => most,
            (false, false) => (f(rendered) - f(truth)).clamp(-most, most),
        };
        mean(truths.iter().map(error))
    };
    let modulation: [f64; MODULATIONS] =
        std::array::from_fn(|k| over(&|r| 20.0 * r.modulation[k].max(LEAST_MODULATION).log10(), LIMIT_DB));
    let [envelope, wave] = [over(&|r| r.envelope_repetition, 1.0), over(&|r| r.wave_repetition, 1.0)];
    Ok(RhythmAgreement {
        modulation_db: rms(&modulation),
        pulses_db: modulation[PULSES],
        repetition: envelope.abs().max(wave.abs()),
        kurtosis_db: over(&|r| 10.0 * r.kurtosis.log10(), LIMIT_DB).abs(),
        steadiness_db: over(&|r| r.level_deviation_db, LIMIT_DB).abs(),
    })
}

/// At which lag a wave repeats itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repeat {
    /// Lag in seconds, in steps of 1/8000.
    pub lag_s: f64,
    /// Autocorrelation of the wave there, -1 to 1.
    pub correlation: f64,
}

/// The lag of the wave's largest autocorrelation between 0.5 and 1.5 times `about_s`. A stroke over a
/// periodic surface repeats itself after its pitch over its speed. The wave begins at half the frequency 1 /
/// `about_s` here.
pub fn repeats_at(signal: &[f64], rate_hz: f64, about_s: f64) -> Result<Repeat, AccuracyError> {
    band(&[signal], rate_hz, END_HZ)?;
    if !(about_s > 1e-3 && 3.0 * about_s * rate_hz <= signal.len() as f64) {
        return Err(AccuracyError::TooShort);
    }
    let wave = Wave::new(&Band::new(&[signal], rate_hz, 0.5 / about_s, END_HZ));
    let found = most_alike(&wave.samples, wave.lags(0.5 * about_s..=1.5 * about_s));
    let (lag, correlation) = found.ok_or(AccuracyError::TooShort)?;
    Ok(Repeat { lag_s: lag as f64 / wave.rate_hz, correlation })
}

#[cfg(test)]
mod tests;
