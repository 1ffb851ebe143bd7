//! A texture that is recorded or drawn once and read by the distance travelled.
//!
//! # Reading
//!
//! The table holds values at equal distances and repeats. The distance is added up along the [`Path`], in
//! straight lines from sample to sample, forth and back alike. So it moves on smoothly between ticks. A sinc
//! of 16 values in a Kaiser window (beta 11) reads between the table's values. It reads from a copy with
//! twice as many values as are needed. Images and errors together are 99 dB below a wave at the edge of the
//! table's band, and 112 dB up to 0.86 of it.
//!
//! # Speed
//!
//! A faster stylus reads faster. Waves that pass half the audio rate would come back mirrored (aliasing). So
//! there are copies of the table of half, a quarter, .. of the band, each cut in frequency. One copy fades
//! into the next while the band's edge goes from 0.4 to 0.5 of the audio rate. At any speed, waves up to 0.16
//! of the audio rate are as in the table, and waves above half of it are left out. At speeds beyond the
//! coarsest copy, all waves are left out. The tables take four times the memory of the loop.
//!
//! # Level
//!
//! An [acceleration](WaveformQuantity::Acceleration) sounds as it was recorded at its reference speed, and at
//! others as `(v / reference)^exponent`. A [height](WaveformQuantity::Height) becomes the acceleration
//! `v^2 y''` with the second derivative along the path, from the table's spectrum. The part of the hand's own
//! acceleration, `y' v'`, is left out. In the level, speeds above 5 m/s count as 5 m/s.
//!
//! 96 samples take 3.6 us on a virtual AMD EPYC core; a table of 100 000 values is made in 25 ms.

use std::f64::consts::{PI, TAU};
use std::sync::{Arc, LazyLock};

use asperity_dsp::Complex;
use asperity_fft as fft;
use asperity_numbers::Elementary as _;
use asperity_state::State;

use crate::effects::bounds::{check, check_list, length};
use crate::effects::gliding::Kernel;
use crate::effects::path::{Parts, Path};
use crate::effects::voices::Voice;

/// Values that are summed to one.
const TAPS: usize = 16;
/// Values of these before the position.
const BEFORE: usize = TAPS / 2 - 1;
/// Positions between two values for which weights are tabulated. Between these, weights are interpolated.
const PHASES: usize = 256;
/// Shape of the Kaiser window.
const BETA: f64 = 11.0;

/// Weights of a windowed sinc that reads between values, a row a phase. Their band ends at half of the
/// highest possible frequency.
type Weights = [[f32; TAPS]];

/// The weights. Making them takes a millisecond; they take 16 KiB.
static WEIGHTS: LazyLock<Vec<[f32; TAPS]>> = LazyLock::new(|| {
    let row = |phase: usize| {
        let part = phase as f64 / PHASES as f64;
        let weight = |tap: usize| {
            let x = tap as f64 - BEFORE as f64 - part;
            let sinc = if x == 0.0 { 1.0 } else { (PI * x).sine() / (PI * x) };
            let edge = x / (TAPS as f64 / 2.0);
            sinc * bessel(BETA * (1.0 - edge * edge).max(0.0).sqrt()) / bessel(BETA)
        };
        let row: [f64; TAPS] = std::array::from_fn(weight);
        let sum: f64 = row.iter().sum();
        row.map(|w| (w / sum) as f32)
    };
    (0..=PHASES).map(row).collect()
});

/// The value at a part of the way, 0 to below 1, from `values[BEFORE]` to the next.
#[inline]
fn between(weights: &Weights, values: &[f32; TAPS], part: f64) -> f64 {
    let place = part * PHASES as f64;
    let row = (place as usize).min(PHASES - 1);
    let between = (place - row as f64) as f32;
    let Some([low, high]) = weights.get(row..row + 2) else { return 0.0 };
    let (mut a, mut b) = (0.0_f32, 0.0_f32);
    for i in 0..TAPS {
        a += values[i] * low[i];
        b += values[i] * high[i];
    }
    f64::from(a + between * (b - a))
}

/// The modified Bessel function of order 0, by its series.
fn bessel(x: f64) -> f64 {
    let quarter = 0.25 * x * x;
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..60 {
        term *= quarter / f64::from(k * k);
        sum += term;
    }
    sum
}

/// Fewest and most values of a table.
const COUNT: (usize, usize) = (4, 1 << 22);
/// Largest value.
const MOST: f64 = 1e6;
/// Range over which one copy fades into the next: the edge of its band in parts of the audio rate.
const OVER: (f64, f64) = (0.4, 0.5);
/// Part of its band from which on a copy is cut.
const CUT: f64 = 0.8;

/// Quantity of a table's values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum WaveformQuantity {
    /// An acceleration \[m/s^2\].
    Acceleration {
        /// The speed at which it was recorded \[mm/s\], 0.1 to 5000.
        reference_speed_mm_s: f64,
        /// The level's power of the speed, 0 to 2; 1 is usual. Below 1, the level falls to nothing under
        /// 1 mm/s.
        speed_exponent: f64,
    },
    /// A height \[mm\].
    Height,
}

/// A loop of a texture, ready to be read at any speed.
#[derive(Clone, Debug)]
pub(crate) struct WaveformTable {
    pub(super) length_mm: f64,
    quantity: WaveformQuantity,
    /// Waves of the finest copy's band per mm.
    band_per_mm: f64,
    levels: Vec<Level>,
    weights: &'static Weights,
}

/// A copy of the loop with a part of its band.
#[derive(Clone, Debug)]
struct Level {
    /// The loop, with copies of its values before its beginning and after its end.
    values: Vec<f32>,
    per_mm: f64,
}

impl WaveformTable {
    /// A loop from values `spacing_mm` apart. The last `crossfade_mm` are faded into the first. So the loop
    /// is shorter by them and has no seam; with 0 the values are a loop as they are. Over the fade the level
    /// is kept, however much the two are correlated. The mean is removed.
    pub(crate) fn new(
        values: &[f64],
        spacing_mm: f64,
        crossfade_mm: f64,
        quantity: WaveformQuantity,
    ) -> Result<Self, String> {
        check_list("values of a waveform", values.iter().copied(), COUNT)?;
        let largest = values.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        check("a waveform's value", largest, (0.0, MOST), "")?;
        let spacing = check("a waveform's spacing", spacing_mm, (1e-4, 100.0), "mm")?;
        let half = 0.5 * values.len() as f64 * spacing;
        let crossfade = check("a crossfade", crossfade_mm, (0.0, half), "mm")?;
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let mut looped: Vec<f64> = values.iter().map(|x| x - mean).collect();
        close(&mut looped, ((crossfade / spacing).round() as usize).min(values.len() / 2));
        Ok(Self::of_loop(looped, spacing, quantity))
    }

    /// The same from pairs of a distance in mm and a value, joined by straight lines. Each value of the table
    /// is the mean over `spacing_mm`.
    pub(crate) fn from_segments(
        pairs: &[(f64, f64)],
        spacing_mm: f64,
        crossfade_mm: f64,
        quantity: WaveformQuantity,
    ) -> Result<Self, String> {
        check_list("distances", pairs.iter().map(|p| p.0), (2, COUNT.1))?;
        check_list("values of a waveform", pairs.iter().map(|p| p.1), (2, COUNT.1))?;
        if let Some(index) = pairs.windows(2).position(|w| w[1].0 <= w[0].0) {
            return Err(format!("distance {} is not above the one before it", index + 2));
        }
        let spacing = check("a waveform's spacing", spacing_mm, (1e-4, 100.0), "mm")?;
        let (from, to) = (pairs[0].0, pairs[pairs.len() - 1].0);
        let most = COUNT.1 as f64 * spacing;
        let length = check("a waveform's length", to - from, (COUNT.0 as f64 * spacing, most), "mm")?;
        let count = (length / spacing).round().min(COUNT.1 as f64) as usize;
        // So that the whole is filled by cells of one size.
        let cell = length / count as f64;
        let mut areas = vec![0.0];
        areas.extend(pairs.windows(2).scan(0.0, |sum, w| {
            *sum += 0.5 * (w[1].0 - w[0].0) * (w[0].1 + w[1].1);
            Some(*sum)
        }));
        let area = |x: f64| {
            let i = pairs.partition_point(|p| p.0 <= x).clamp(1, pairs.len() - 1);
            let (a, b) = (pairs[i - 1], pairs[i]);
            let t = ((x - a.0) / (b.0 - a.0)).clamp(0.0, 1.0);
            areas[i - 1] + t * (b.0 - a.0) * (a.1 + 0.5 * t * (b.1 - a.1))
        };
        let edges: Vec<f64> = (0..=count).map(|n| area(from + n as f64 * cell)).collect();
        let values: Vec<f64> = edges.windows(2).map(|w| (w[1] - w[0]) / cell).collect();
        Self::new(&values, cell, crossfade_mm, quantity)
    }

    fn of_loop(looped: Vec<f64>, spacing_mm: f64, quantity: WaveformQuantity) -> Self {
        let count = looped.len();
        let length_mm = count as f64 * spacing_mm;
        let mut spectrum = fft::spectrum(looped);
        let band = count as f64 / 2.0;
        for (k, bin) in spectrum.iter_mut().enumerate() {
            *bin /= count as f64;
            if k == 0 {
                *bin = Complex::<f64>::default();
            } else if 2 * k == count {
                // The Nyquist wave is its own mirror image here, but not in the copies: it counts half.
                *bin *= 0.5;
            }
            if quantity == WaveformQuantity::Height {
                let per_mm = TAU * k as f64 / length_mm;
                *bin *= -per_mm * per_mm * taper(k as f64 / band);
            }
        }
        let (mut levels, mut edge) = (Vec::new(), band);
        while edge >= 1.0 {
            let size = 4 * edge.ceil() as usize;
            let finest = levels.is_empty();
            let tapered = |(k, bin): (usize, &Complex<f64>)| {
                if finest { *bin } else { *bin * taper(k as f64 / edge) }
            };
            let values = fft::signal(spectrum.iter().enumerate().map(tapered), size);
            let around = (0..size + TAPS).map(|i| values[(i + size - BEFORE % size) % size] as f32);
            levels.push(Level { values: around.collect(), per_mm: size as f64 / length_mm });
            edge *= 0.5;
        }
        Self { length_mm, quantity, band_per_mm: band / length_mm, levels, weights: &WEIGHTS }
    }

    /// The table's value at a distance below its length, for a stylus that moves `way_mm` in a sample: m/s^2,
    /// or 1/mm of a height.
    #[inline]
    fn read(&self, distance_mm: f64, way_mm: f64) -> f64 {
        // The edge of the band in waves per sample; halved until it fits.
        let mut edge = self.band_per_mm * way_mm;
        let mut level = 0;
        while edge > OVER.1 && level < self.levels.len() {
            (edge, level) = (0.5 * edge, level + 1);
        }
        let over = ((edge - OVER.0) / (OVER.1 - OVER.0)).max(0.0);
        let fine = self.at(level, distance_mm);
        if over > 0.0 { fine + over * (self.at(level + 1, distance_mm) - fine) } else { fine }
    }

    #[inline]
    fn at(&self, level: usize, distance_mm: f64) -> f64 {
        let Some(level) = self.levels.get(level) else { return 0.0 };
        let place = distance_mm * level.per_mm;
        let whole = place as usize;
        match level.values.get(whole..whole + TAPS).map(TryInto::try_into) {
            Some(Ok(values)) => between(self.weights, values, place - whole as f64),
            _ => 0.0,
        }
    }
}

/// 1 up to [`CUT`] of a band and 0 at its edge.
fn taper(part: f64) -> f64 {
    let t = ((part - CUT) / (1.0 - CUT)).clamp(0.0, 1.0);
    0.5 + 0.5 * (PI * t).cosine()
}

/// Fades the last `fade` values into the first and takes them off.
pub(crate) fn close(values: &mut Vec<f64>, fade: usize) {
    let count = values.len() - fade;
    let (into, out) = values.split_at_mut(count);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let sizes = (product(&into[..fade], &into[..fade]) * product(out, out)).sqrt();
    let common = if sizes > 0.0 { (product(&into[..fade], out) / sizes).clamp(0.0, 1.0) } else { 1.0 };
    for (n, (a, b)) in into.iter_mut().zip(out).enumerate() {
        let w = 0.5 - 0.5 * (PI * (n as f64 + 0.5) / fade as f64).cosine();
        let level = (w * w + (1.0 - w) * (1.0 - w) + 2.0 * common * w * (1.0 - w)).sqrt();
        *a = (w * *a + (1.0 - w) * *b) / level;
    }
    values.truncate(count);
}

/// Highest speed that counts for the level \[mm/s\].
const FASTEST_MM_S: f64 = 5000.0;
/// Speed below which the level of an exponent below 1 falls to nothing \[mm/s\].
const STILL_MM_S: f64 = 1.0;

/// A table that is read along a path.
#[derive(Clone, Debug)]
pub(crate) struct Reader {
    table: Arc<WaveformTable>,
    /// Factor of the samples.
    gain: f64,
    /// Position in the loop, in mm.
    distance_mm: f64,
    last: Option<[f64; 2]>,
}

impl Reader {
    /// A reader at the table's beginning.
    pub(crate) fn new(table: Arc<WaveformTable>, gain: f64) -> Self {
        Self { table, gain, distance_mm: 0.0, last: None }
    }

    /// Factor of the table's values at a speed.
    #[inline]
    fn level(&self, speed_mm_s: f64) -> f64 {
        let speed = speed_mm_s.min(FASTEST_MM_S);
        match self.table.quantity {
            // mm/s^2 to m/s^2
            WaveformQuantity::Height => 1e-3 * speed * speed,
            WaveformQuantity::Acceleration { reference_speed_mm_s, speed_exponent } => {
                let ratio = speed / reference_speed_mm_s;
                if speed_exponent == 1.0 {
                    ratio
                } else if speed_exponent == 2.0 {
                    ratio * ratio
                } else {
                    let still = if speed_exponent < 1.0 { (speed / STILL_MM_S).min(1.0) } else { 1.0 };
                    still * ratio.power(speed_exponent)
                }
            }
        }
    }
}

impl Kernel for Reader {
    fn process(&mut self, path: &Path, parts: &Parts, out: &mut [f64]) {
        let rate = parts.rate_hz();
        for (n, out) in out.iter_mut().enumerate() {
            let here = path.at(parts.at(n));
            let way_mm = match self.last {
                Some(last) => length(std::array::from_fn::<_, 2, _>(|i| here.position_mm[i] - last[i])),
                None => length(here.velocity_mm_s) / rate,
            };
            self.last = Some(here.position_mm);
            self.distance_mm += way_mm;
            let loop_mm = self.table.length_mm;
            if self.distance_mm >= loop_mm {
                self.distance_mm %= loop_mm;
            }
            *out = self.gain * (self.level(way_mm * rate) * self.table.read(self.distance_mm, way_mm));
        }
    }

    /// Forgets where the stylus was and goes on at the present position in the table. The stylus was put down
    /// elsewhere, so the distance between does not count.
    fn lift(&mut self) {
        self.last = None;
    }
}

impl Voice for Reader {
    /// Goes back to the table's beginning.
    fn reset(&mut self) {
        (self.distance_mm, self.last) = (0.0, None);
    }

    /// Position in the table. Another table continues at the same distance.
    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.distance_mm).keep(&mut self.last);
        state.require(
            (0.0..1e9).contains(&self.distance_mm)
                && self.last.is_none_or(|p| p.iter().all(|x| x.abs() < 1e12)),
        );
        self.distance_mm %= self.table.length_mm;
    }
}

#[cfg(test)]
#[path = "table_tests.rs"]
mod tests;
