//! The acceleration as one signal at the models' rate.

use std::f64::consts::PI;

use asperity_diagnostics::Diagnostic;
use asperity_dsp::filter::Section;
use asperity_dsp::resample::{Conversion, FilterPhase, Resampler};
use asperity_fft::Transform;
use asperity_numbers::Elementary as _;

use super::Settings;

/// Passband of the resampler as a part of the models' rate: the most it can.
pub(super) const PASSBAND: f64 = 0.48;

/// Frames a second, not counting their overlap by half.
const FRAMES_HZ: f64 = 10.0;
/// Least power to divide by.
const NOTHING: f64 = 1e-200;

/// A Butterworth filter of fourth order from two second-order sections.
pub(super) fn filter(
    signal: &mut [f64],
    section: fn(f64, f64) -> Section,
    rate_hz: f64,
    corner_hz: f64,
) -> Result<(), Diagnostic> {
    for angle in [PI / 8.0, 3.0 * PI / 8.0] {
        section(corner_hz, angle.cosine())
            .bilinear(rate_hz, corner_hz)
            .map_err(|e| Diagnostic::new(e.to_string()))?
            .process_in_place(signal);
    }
    Ok(())
}

/// Removes slow motion, from rest.
fn high_passed(mut signal: Vec<f64>, rate_hz: f64, settings: &Settings) -> Result<Vec<f64>, Diagnostic> {
    if settings.high_pass_hz > 0.0 {
        let first = signal.first().copied().unwrap_or(0.0);
        signal.iter_mut().for_each(|x| *x -= first);
        filter(&mut signal, Section::high_pass, rate_hz, settings.high_pass_hz)?;
    }
    Ok(signal)
}

/// The acceleration as one signal at the models' rate without slow motion, and the part of its power that
/// this rate leaves out, 0 to 1. `rate` is a whole number.
pub(super) fn prepared(
    axes: Vec<Vec<f64>>,
    rate: f64,
    settings: &Settings,
) -> Result<(Vec<f64>, f64), Diagnostic> {
    let axes = axes.into_iter().map(|axis| high_passed(axis, rate, settings)).collect::<Result<_, _>>()?;
    let mut signal = joined(axes, rate);
    // In range: checked before.
    let (in_hz, out_hz) = (rate as u32, settings.model_hz);
    if in_hz == out_hz {
        return Ok((signal, 0.0));
    }
    let square = |signal: &[f64]| signal.iter().map(|x| x * x).sum::<f64>() / signal.len().max(1) as f64;
    let whole = square(&signal).max(NOTHING);
    let phase = FilterPhase::Linear;
    let conversion = Conversion { in_hz, out_hz, tick_num: 1, tick_den: 1, passband: PASSBAND, phase };
    let mut resampler = Resampler::<f64>::new(&conversion).map_err(|e| Diagnostic::new(e.to_string()))?;
    let (num, den) = resampler.latency();
    let late = num as f64 / den as f64;
    let len = (signal.len() as f64 / rate * f64::from(out_hz)) as usize;
    // The output is late. Silence behind the recording pushes the last of it out.
    let skip = (late * f64::from(out_hz)).round() as usize;
    signal.resize(signal.len() + ((late + 1.0) * rate).ceil() as usize, 0.0);
    let mut out = vec![0.0; skip + len];
    resampler.process(0, &signal, 0, &mut out);
    out.drain(..skip);
    let above = (1.0 - square(&out) / whole).clamp(0.0, 1.0);
    Ok((out, above))
}

/// One signal. In each frame its spectrum has the power of all axes together and the phases of the axis
/// that is loudest overall. A single axis stays as it is. Axes have one length.
fn joined(mut axes: Vec<Vec<f64>>, rate_hz: f64) -> Vec<f64> {
    let power = |axis: &[f64]| axis.iter().map(|x| x * x).sum::<f64>();
    let loudest = (0..axes.len()).max_by(|a, b| power(&axes[*a]).total_cmp(&power(&axes[*b])));
    let Some(loudest) = loudest else { return Vec::new() };
    axes.swap(0, loudest);
    if axes.len() == 1 {
        return axes.swap_remove(0);
    }
    let hop = ((0.5 * rate_hz / FRAMES_HZ).round() as usize).max(1);
    let len = 2 * hop;
    // Applied twice, it sums to 1 over frames that overlap by half.
    let window: Vec<f64> =
        (0..len).map(|i| (PI * i as f64 / len as f64).sine() / (len as f64).sqrt()).collect();
    let mut transform = Transform::<f64>::new(len);
    let samples = axes.iter().map(Vec::len).min().unwrap_or(0);
    let mut out = vec![0.0; samples];
    let mut spectra = vec![transform.bins.clone(); axes.len()];
    // The first frame begins half a frame before the first sample.
    for start in (0..samples + hop).step_by(hop) {
        for (axis, spectrum) in axes.iter().zip(&mut spectra) {
            for (i, (to, w)) in transform.time.iter_mut().zip(&window).enumerate() {
                let at = (start + i).checked_sub(hop).and_then(|n| axis.get(n));
                *to = at.map_or(0.0, |x| w * x);
            }
            transform.forward();
            spectrum.copy_from_slice(&transform.bins);
        }
        let Some((first, others)) = spectra.split_first_mut() else { break };
        for (bin, x) in first.iter_mut().enumerate() {
            let (own, more) = (x.norm_sqr(), others.iter().map(|o| o[bin].norm_sqr()).sum::<f64>());
            // Without a phase any will do.
            if own > NOTHING { *x *= (1.0 + more / own).sqrt() } else { *x = more.sqrt().into() }
        }
        transform.bins.copy_from_slice(first);
        transform.inverse();
        for (i, (x, w)) in transform.time.iter().zip(&window).enumerate() {
            if let Some(to) = (start + i).checked_sub(hop).and_then(|n| out.get_mut(n)) {
                *to += w * x;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_numbers::Random;

    fn noise(seed: u64, count: usize, level: f64) -> Vec<f64> {
        let mut random = Random::new(seed);
        (0..count).map(|_| level * random.normal()).collect()
    }

    fn power(x: &[f64]) -> f64 {
        x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64
    }

    #[test]
    fn axes_that_move_together_join_in_any_direction() {
        for rate_hz in [1000.0, 1024.0, 9999.0] {
            let one = noise(1, 5432, 1.0);
            let along = |by: f64| one.iter().map(|x| by * x).collect::<Vec<f64>>();
            // 2-3-6-7. Axes of opposite sign do not cancel.
            for factors in [[2.0, 3.0, 6.0], [6.0, -3.0, 2.0], [-6.0, 2.0, 3.0]] {
                let found = joined(factors.map(along).to_vec(), rate_hz);
                let loudest = if factors[0].abs() > 5.0 { factors[0] } else { factors[2] };
                let want = 7.0 * loudest.signum();
                let off = found.iter().zip(&one).map(|(x, y)| (x - want * y).abs()).fold(0.0, f64::max);
                assert!(found.len() == one.len() && off < 1e-9, "{rate_hz}: {off}");
            }
        }
        let one = noise(3, 700, 1.0);
        assert_eq!(joined(vec![one.clone()], 1000.0), one);
        let silent = joined(vec![one.clone(), vec![0.0; 700], vec![0.0; 700]], 1000.0);
        assert!(silent.iter().zip(&one).all(|(x, y)| (x - y).abs() < 1e-12));
        assert!(joined(vec![], 1000.0).is_empty());
        assert_eq!(joined(vec![vec![], vec![]], 1000.0), []);
        assert_eq!(joined(vec![vec![0.0; 99], vec![0.0; 99]], 1000.0), vec![0.0; 99]);
    }

    /// Each axis has its own noise. A tenth of the power falls out of step between frames, which takes
    /// at most 0.2 dB.
    #[test]
    fn powers_of_different_axes_add_up_in_place() {
        let mut axes: Vec<Vec<f64>> =
            (0..3).map(|seed| noise(seed, 40_000, f64::from(seed as u32 + 1))).collect();
        for axis in &mut axes {
            axis[20_000..].iter_mut().for_each(|x| *x *= 1e-2);
        }
        let found = joined(axes, 1000.0);
        // 1 + 4 + 9; 40 dB less in the second half, except for a frame after the step.
        for (part, want) in [(100..19_900, 14.0), (20_100..39_900, 14e-4)] {
            let db = 10.0 * (power(&found[part]) / want).log10();
            assert!(db.abs() < 0.3, "{db} dB of {want}");
        }
    }
}
