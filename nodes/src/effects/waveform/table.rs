use asperity_dsp::plans;
use asperity_numbers::Elementary as _;
use std::f64::consts::{PI, TAU};

use asperity_dsp::Complex;

use super::kernel::{BEFORE, Kernel, TAPS};
use crate::effects::bounds::{check, check_list};

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
    length_mm: f64,
    quantity: WaveformQuantity,
    /// Waves of the finest copy's band per mm.
    band_per_mm: f64,
    levels: Vec<Level>,
    kernel: &'static Kernel,
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
        let (values, cell) = Self::drawn(pairs, spacing_mm)?;
        Self::new(&values, cell, crossfade_mm, quantity)
    }

    /// The values of straight lines, and their spacing.
    fn drawn(pairs: &[(f64, f64)], spacing_mm: f64) -> Result<(Vec<f64>, f64), String> {
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
        Ok((edges.windows(2).map(|w| (w[1] - w[0]) / cell).collect(), cell))
    }

    /// Length of the loop in mm.
    pub(crate) fn length_mm(&self) -> f64 {
        self.length_mm
    }

    /// Quantity of the values.
    pub(crate) fn quantity(&self) -> WaveformQuantity {
        self.quantity
    }

    fn of_loop(looped: Vec<f64>, spacing_mm: f64, quantity: WaveformQuantity) -> Self {
        let count = looped.len();
        let length_mm = count as f64 * spacing_mm;
        let mut spectrum = plans::spectrum(looped);
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
        let mut levels = Vec::new();
        let mut edge = band;
        while edge >= 1.0 {
            let size = 4 * edge.ceil() as usize;
            let finest = levels.is_empty();
            let tapered = |(k, bin): (usize, &Complex<f64>)| {
                if finest { *bin } else { *bin * taper(k as f64 / edge) }
            };
            let values = plans::signal(spectrum.iter().enumerate().map(tapered), size);
            let around = (0..size + TAPS).map(|i| values[(i + size - BEFORE % size) % size] as f32);
            levels.push(Level { values: around.collect(), per_mm: size as f64 / length_mm });
            edge *= 0.5;
        }
        Self { length_mm, quantity, band_per_mm: band / length_mm, levels, kernel: Kernel::shared() }
    }

    /// The table's value at a distance below its length, for a stylus that moves `way_mm` in a sample: m/s^2,
    /// or 1/mm of a height.
    #[inline]
    pub(super) fn read(&self, distance_mm: f64, way_mm: f64) -> f64 {
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
            Some(Ok(values)) => self.kernel.read(values, place - whole as f64),
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
fn close(values: &mut Vec<f64>, fade: usize) {
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
