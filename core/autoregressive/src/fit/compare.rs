//! Compares a texture with the recording that it was fitted to.

use std::ops::Range;
use std::sync::Arc;

use asperity_diagnostics::Diagnostic;
use asperity_dsp::filter::Section;
use asperity_dsp::window::hann;
use asperity_fft as fft;
use asperity_numbers::Elementary as _;

use super::super::{Synthesis, Texture};
use super::blocks::Blocks;
use super::signal::{PASSBAND, filter};
use super::{Recording, Report, Segment, Settings};

/// Third-octave bands by number: 25 Hz to 4 kHz.
const BANDS: std::ops::RangeInclusive<i32> = 14..=36;
/// A band counts if it holds at least this part of the power.
const HELD: f64 = 1e-3;
/// Length of the rendering in all, in s: chance in it is then less than in the recording.
const RENDERED_S: f64 = 240.0;
/// Most passes of the rendering.
const MOST_PASSES: usize = 64;
/// Seed of the noise.
const SEED: u64 = 1;

/// A third-octave band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Centre in Hz: a tenth of a power of ten.
    pub centre_hz: f64,
    /// Root mean square of the recording in m/s^2.
    pub recorded_m_s2: f64,
    /// Root mean square of the rendering in m/s^2.
    pub rendered_m_s2: f64,
}

impl Band {
    /// Level of the rendering over the recording in dB.
    pub fn off_db(&self) -> f64 {
        decibels(self.rendered_m_s2.powi(2), self.recorded_m_s2.powi(2))
    }

    /// Standard deviation in dB of the band's level in noise of this length.
    pub fn chance_db(&self, seconds: f64) -> f64 {
        // Relative to the power it is one over the root of the number of independent samples: bandwidth
        // times time.
        let width_hz = self.centre_hz * (10f64.power(0.05) - 10f64.power(-0.05));
        10.0 / std::f64::consts::LN_10 / (width_hz * seconds).sqrt()
    }
}

fn decibels(rendered: f64, recorded: f64) -> f64 {
    if rendered == recorded { 0.0 } else { 10.0 * (rendered / recorded).log_10() }
}

/// Some segments as recorded and as rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// Length of the segments in s.
    pub seconds: f64,
    /// Bands from 25 Hz to 4 kHz, as far as the models' rate allows: to 400 Hz at 1 kHz.
    pub bands: Vec<Band>,
    /// Power density of the recording in (m/s^2)^2 / Hz, at 0 Hz, [`DENSITY_STEP_HZ`](Self::DENSITY_STEP_HZ),
    /// .., as a mean over frames of 0.2 s. Empty where all segments are shorter.
    pub density: Vec<f64>,
}

impl Compared {
    /// Step between densities in Hz.
    pub const DENSITY_STEP_HZ: f64 = 5.0;

    /// Level of all bands rendered over recorded, in dB.
    pub fn level_off_db(&self) -> f64 {
        let sum = |of: fn(&Band) -> f64| self.bands.iter().map(|b| of(b).powi(2)).sum::<f64>();
        decibels(sum(|b| b.rendered_m_s2), sum(|b| b.recorded_m_s2))
    }

    /// The band that is off most, of those with at least a thousandth of the recorded power.
    pub fn worst(&self) -> Option<&Band> {
        let whole: f64 = self.bands.iter().map(|b| b.recorded_m_s2.powi(2)).sum();
        let held = self.bands.iter().filter(|b| b.recorded_m_s2.powi(2) > HELD * whole);
        held.max_by(|a, b| a.off_db().abs().total_cmp(&b.off_db().abs()))
    }
}

/// A recording compared with a texture's rendering at the same speeds and forces.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// All segments.
    pub all: Compared,
    /// The segments of each model.
    pub models: Vec<Compared>,
}

impl Recording<'_> {
    /// Renders a texture with the recording's speeds and forces and compares the fitted segments, after
    /// the same high-pass and at the models' rate.
    pub fn compare(
        &self,
        settings: &Settings,
        texture: &Arc<Texture>,
        report: &Report,
    ) -> Result<Comparison, Diagnostic> {
        settings.check()?;
        self.check(settings)?;
        let blocks = Blocks::new(self, settings)?;
        let passes = ((RENDERED_S / blocks.duration_s().max(1e-3)).ceil() as usize).clamp(1, MOST_PASSES);
        let mut synthesis = Synthesis::new(texture.clone(), SEED);
        let meter = Meter::new(blocks.rate_hz);
        let samples = blocks.signal.len();
        // Of each model, then of all.
        let count = texture.models().len();
        let mut sums = vec![Sums::new(&meter); count + 1];
        let part = |segment: &Segment| {
            let Range { start, end } = blocks.span(segment);
            (start * blocks.len).min(samples)..(end * blocks.len).min(samples)
        };
        let known = report.segments.iter().filter(|segment| segment.model < count);
        let parts: Vec<(usize, Range<usize>)> = known.map(|s| (s.model, part(s))).collect();
        for (model, part) in &parts {
            let signal = &blocks.signal[part.clone()];
            let (bands, (density, frames)) = (meter.bands(signal), meter.densities(signal));
            for i in [*model, count] {
                sums[i].seconds += part.len() as f64 / blocks.rate_hz;
                add(&mut sums[i].recorded, &bands, 1.0);
                add(&mut sums[i].density, &density, 1.0);
                sums[i].frames += frames;
            }
        }
        let mut signal = vec![0.0f32; samples];
        for pass in 0..passes {
            for (b, (at, out)) in blocks.smooth.iter().zip(signal.chunks_exact_mut(blocks.len)).enumerate() {
                synthesis.touch(at[0], at[1]);
                synthesis.process((pass * samples + b * blocks.len) as u64, out);
            }
            let mut rendered: Vec<f64> = signal.iter().map(|x| f64::from(*x)).collect();
            if settings.high_pass_hz > 0.0 {
                filter(&mut rendered, Section::high_pass, blocks.rate_hz, settings.high_pass_hz)?;
            }
            for (model, part) in &parts {
                let bands = meter.bands(&rendered[part.clone()]);
                for i in [*model, count] {
                    add(&mut sums[i].rendered, &bands, 1.0 / passes as f64);
                }
            }
        }
        let mut models: Vec<Compared> = sums.iter().map(|s| s.compared(&meter)).collect();
        let all = models.swap_remove(count);
        Ok(Comparison { all, models })
    }
}

fn add(to: &mut [f64], from: &[f64], weight: f64) {
    to.iter_mut().zip(from).for_each(|(sum, x)| *sum += weight * x);
}

/// Power by bands and by frequency.
struct Meter {
    rate_hz: f64,
    centres_hz: Vec<f64>,
}

impl Meter {
    fn new(rate_hz: f64) -> Self {
        let centres = BANDS.map(|band| 10f64.power(f64::from(band) / 10.0));
        let centres_hz = centres.filter(|hz| hz * 10f64.power(0.05) <= PASSBAND * rate_hz).collect();
        Self { rate_hz, centres_hz }
    }

    /// Power of a signal by bins of its transform, and the distance of bins in Hz.
    fn squares(&self, signal: &[f64]) -> (Vec<f64>, f64) {
        let len = signal.len();
        let window = hann::<f64>(len);
        let windowed = signal.iter().zip(&window).map(|(x, w)| x * w);
        let spectrum = fft::spectrum(windowed.collect::<Vec<f64>>());
        let scale = 2.0 / (len as f64 * window.iter().map(|w| w * w).sum::<f64>());
        (spectrum.iter().map(|x| scale * x.norm_sqr()).collect(), self.rate_hz / len as f64)
    }

    /// Power of a part by bands, times its length: a mean over frames of a second. They overlap by half or
    /// more, so that every sample counts.
    fn bands(&self, signal: &[f64]) -> Vec<f64> {
        let mut bands = vec![0.0; self.centres_hz.len()];
        let len = signal.len().min(self.rate_hz.round() as usize);
        if len < 2 {
            return bands;
        }
        let (rest, hop) = (signal.len() - len, (len / 2).max(1));
        let steps = rest.div_ceil(hop);
        let weight = signal.len() as f64 / (steps + 1) as f64;
        for step in 0..=steps {
            // From the first sample to the last.
            let start = rest * step / steps.max(1);
            let (squares, step_hz) = self.squares(&signal[start..start + len]);
            for (centre, sum) in self.centres_hz.iter().zip(&mut bands) {
                let edge = |by: f64| centre * 10f64.power(by) / step_hz;
                // A bin reaches half a step to either side.
                let (low, high) = (edge(-0.05), edge(0.05));
                for bin in (low - 0.5).max(0.0) as usize..=(high + 0.5) as usize {
                    let (from, to) = (low.max(bin as f64 - 0.5), high.min(bin as f64 + 0.5));
                    *sum += weight * (to - from).max(0.0) * squares.get(bin).copied().unwrap_or(0.0);
                }
            }
        }
        bands
    }

    /// Sum of a part's densities over frames, and how many frames there are.
    fn densities(&self, signal: &[f64]) -> (Vec<f64>, usize) {
        let len = self.density_len();
        let mut sum = vec![0.0; len / 2 + 1];
        let frames = signal.windows(len).step_by((len / 2).max(1));
        let count = frames.clone().count();
        for frame in frames {
            let (squares, step_hz) = self.squares(frame);
            add(&mut sum, &squares, 1.0 / step_hz);
        }
        (sum, count)
    }

    fn density_len(&self) -> usize {
        (self.rate_hz / Compared::DENSITY_STEP_HZ).round() as usize
    }
}

/// Power by bands of all parts, each times its length, and densities of all frames.
#[derive(Clone)]
struct Sums {
    seconds: f64,
    recorded: Vec<f64>,
    rendered: Vec<f64>,
    density: Vec<f64>,
    frames: usize,
}

impl Sums {
    fn new(meter: &Meter) -> Self {
        let none = vec![0.0; meter.centres_hz.len()];
        let density = vec![0.0; meter.density_len() / 2 + 1];
        Self { seconds: 0.0, recorded: none.clone(), rendered: none, density, frames: 0 }
    }

    fn compared(&self, meter: &Meter) -> Compared {
        let samples = (self.seconds * meter.rate_hz).max(1.0);
        let powers = self.recorded.iter().zip(&self.rendered);
        let band = |(centre_hz, (recorded, rendered)): (&f64, (&f64, &f64))| Band {
            centre_hz: *centre_hz,
            recorded_m_s2: (recorded / samples).sqrt(),
            rendered_m_s2: (rendered / samples).sqrt(),
        };
        let known = if self.frames > 0 { &self.density[..] } else { &[] };
        Compared {
            seconds: self.seconds,
            bands: meter.centres_hz.iter().zip(powers).map(band).collect(),
            density: known.iter().map(|x| x / self.frames as f64).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_numbers::Random;

    /// One window over all six seconds would leave 1.03 dB to chance in the band of 25 Hz.
    #[test]
    fn level_deviates_as_time_and_width_say() {
        let mut random = Random::new(3);
        let meter = Meter::new(1000.0);
        let (seconds, draws) = (6, 300);
        let all: Vec<Vec<f64>> = (0..draws)
            .map(|_| {
                let signal: Vec<f64> = (0..1000 * seconds).map(|_| random.normal()).collect();
                meter.bands(&signal).iter().map(|b| b / signal.len() as f64).collect()
            })
            .collect();
        for (number, centre_hz) in meter.centres_hz.iter().enumerate() {
            // White noise of power 1: twice the density of 1 / rate, times the width.
            let want = 0.002 * centre_hz * (10f64.powf(0.05) - 10f64.powf(-0.05));
            let of = || all.iter().map(|bands| bands[number]);
            let mean = of().sum::<f64>() / draws as f64;
            let deviation = (of().map(|b| (b - mean).powi(2)).sum::<f64>() / draws as f64).sqrt();
            assert!((mean / want - 1.0).abs() < 0.05, "{centre_hz} Hz: {mean}, not {want}");
            let db = 10.0 / std::f64::consts::LN_10 * deviation / mean;
            let band = Band { centre_hz: *centre_hz, recorded_m_s2: 1.0, rendered_m_s2: 1.0 };
            let chance = band.chance_db(f64::from(seconds));
            assert!((0.85..1.2).contains(&(db / chance)), "{centre_hz} Hz: {db} dB, not {chance}");
        }
    }

    #[test]
    fn meter_counts_every_sample_and_measures_a_tone() {
        let meter = Meter::new(1000.0);
        for len in [2, 150, 999, 1000, 1001, 1499, 2750] {
            let tone: Vec<f64> =
                (0..len).map(|n| (0.2 * std::f64::consts::PI * f64::from(n)).sin()).collect();
            let bands = meter.bands(&tone);
            assert!(bands.iter().all(|b| b.is_finite()));
            if len > 500 {
                // 100 Hz; a sine has a mean square of a half.
                let off = 2.0 * bands[6] / f64::from(len) - 1.0;
                assert!(off.abs() < 0.01, "{len}: {off}");
            }
        }
        // The very end counts.
        for at in [40, 1500, 2700] {
            let mut click = vec![0.0; 2750];
            click[at] = 1.0;
            assert!(meter.bands(&click).iter().all(|b| *b > 0.0), "{at}");
        }
    }
}
