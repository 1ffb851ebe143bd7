//! Patches by their spectrum, and filters over patches.

use asperity_fft::{Real as _, Transform};
use asperity_numbers::Elementary as _;
use std::f64::consts::TAU;

use num_complex::Complex;

use super::HeightField;
use asperity_numbers::Random;

/// Multiplies a patch's spectrum by `gain(fx, fy)`, at frequencies in cycles per millimetre: a filter
/// without phase, around the seam.
pub fn filter(field: &HeightField, gain: impl Fn(f64, f64) -> f64) -> HeightField {
    let (side, length) = (field.side(), field.length_mm());
    let mut out = field.clone();
    let mut spectrum = forward(out.heights_mut(), side);
    let scale = 1.0 / (side * side) as f64;
    // Held transposed: a line for every frequency along x.
    for (i, line) in spectrum.chunks_exact_mut(side).enumerate() {
        let fx = i as f64 / length;
        for (j, bin) in line.iter_mut().enumerate() {
            let signed = if j > side / 2 { j as f64 - side as f64 } else { j as f64 };
            *bin *= (gain(fx, signed / length) * scale) as f32;
        }
    }
    backward(&mut spectrum, out.heights_mut(), side);
    out
}

/// A Gaussian patch of root mean square height `rms_mm` and mean 0. Its power spectral density is
/// proportional to `density(fx, fy)` at frequencies in cycles per millimetre.
pub fn gaussian(
    (side, step_mm): (usize, f64),
    rms_mm: f64,
    random: &mut Random,
    density: impl Fn(f64, f64) -> f64,
) -> HeightField {
    let (length, bins) = (side as f64 * step_mm, side / 2 + 1);
    let mut spectrum = vec![Complex::new(0.0_f32, 0.0); bins * side];
    for (i, line) in spectrum.chunks_exact_mut(side).enumerate() {
        // Self-mirrored lines use only the even half.
        let whole = if i == 0 || 2 * i == side { std::f64::consts::SQRT_2 } else { 1.0 };
        for (j, bin) in line.iter_mut().enumerate() {
            let signed = if j > side / 2 { j as f64 - side as f64 } else { j as f64 };
            let shape = density(i as f64 / length, signed / length).max(0.0).sqrt();
            if (i, j) != (0, 0) && shape > 0.0 {
                let [re, im] = random.normals();
                *bin = Complex::new((whole * shape * re) as f32, (whole * shape * im) as f32);
            }
        }
    }
    let mut field = HeightField::flat(side, step_mm);
    backward(&mut spectrum, field.heights_mut(), side);
    field.with_rms(rms_mm)
}

/// Density of an isotropic self-affine surface: flat below the roll-off `q0` in cycles per millimetre,
/// `q^(-2 - 2 H)` above it with the Hurst exponent H (Persson et al. 2005, "On the nature of surface
/// roughness").
pub fn self_affine(roll_off_per_mm: f64, hurst: f64) -> impl Fn(f64, f64) -> f64 {
    move |fx, fy| {
        let q = fx.hypotenuse(fy) / roll_off_per_mm;
        if q <= 1.0 { 1.0 } else { q.power(-2.0 - 2.0 * hurst) }
    }
}

/// A Gaussian low-pass of gain `exp(-1/2)` at a frequency of `1 / (TAU sigma_mm)`: convolution with a
/// Gaussian of that standard deviation.
pub fn blur(field: &HeightField, sigma_mm: f64) -> HeightField {
    filter(field, |fx, fy| (-0.5 * (TAU * sigma_mm).powi(2) * (fx * fx + fy * fy)).exp_e())
}

/// The two-dimensional transform, transposed: `side / 2 + 1` lines of `side` bins.
fn forward(rows: &[f32], side: usize) -> Vec<Complex<f32>> {
    let bins = side / 2 + 1;
    let mut real = Transform::<f32>::new(side);
    let mut out = vec![Complex::default(); bins * side];
    for (row, values) in rows.chunks_exact(side).enumerate() {
        real.time.copy_from_slice(values);
        real.forward();
        for (bin, value) in real.bins.iter().enumerate() {
            out[bin * side + row] = *value;
        }
    }
    columns(&mut out, side, true);
    out
}

fn backward(spectrum: &mut [Complex<f32>], rows: &mut [f32], side: usize) {
    columns(spectrum, side, false);
    let mut real = Transform::<f32>::new(side);
    for (row, values) in rows.chunks_exact_mut(side).enumerate() {
        for (bin, value) in real.bins.iter_mut().enumerate() {
            *value = spectrum[bin * side + row];
        }
        real.inverse();
        values.copy_from_slice(&real.time);
    }
}

fn columns(lines: &mut [Complex<f32>], side: usize, forward: bool) {
    let plan = f32::complex(side, forward);
    let mut scratch = vec![Complex::default(); plan.get_inplace_scratch_len()];
    lines.chunks_exact_mut(side).for_each(|line| plan.process_with_scratch(line, &mut scratch));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filter_scales_each_wave_by_its_gain_on_any_side() {
        for side in [64, 75] {
            let step = 0.1;
            let length = side as f64 * step;
            let wave = |kx: f64, ky: f64, a: f64| {
                HeightField::from_fn(side, step, |x, y| a * (TAU * (kx * x + ky * y) / length + 0.4).sin())
            };
            let mut both = wave(5.0, -3.0, 1.0);
            both.add(&wave(0.0, 7.0, 0.5));
            let out = filter(&both, |fx, fy| if fx > 0.0 && fy < 0.0 { 0.25 } else { 2.0 });
            let mut want = wave(5.0, -3.0, 0.25);
            want.add(&wave(0.0, 7.0, 1.0));
            let off =
                out.heights().iter().zip(want.heights()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 1e-5, "{off}");
        }
    }

    #[test]
    fn gaussian_patch_has_height_slope_distribution_of_its_density() {
        let (side, step) = (512, 0.05);
        // A narrow ring of frequencies: slope = TAU q rms.
        let ring = |fx: f64, fy: f64| f64::from(u8::from((fx.hypot(fy) - 0.5).abs() < 0.05));
        let field = gaussian((side, step), 0.02, &mut Random::new(1), ring);
        assert!((field.rms_mm() - 0.02).abs() < 1e-6 && field.mean_mm().abs() < 1e-7);
        let slope = field.rms_slope() / (TAU * 0.5 * 0.02);
        assert!((slope - 1.0).abs() < 0.03, "{slope}");
        let kurtosis = field.heights().iter().map(|h| (f64::from(*h) / 0.02).powi(4)).sum::<f64>()
            / (side * side) as f64;
        assert!((kurtosis - 3.0).abs() < 0.3, "{kurtosis}");
        // Self-affine: slope of the density between two octaves is -2 - 2 H.
        let density = self_affine(0.3, 0.8);
        assert!((density(1.2, 0.0) / density(0.0, 0.6) - 2_f64.powf(-3.6)).abs() < 1e-12);
        assert_eq!(density(0.1, 0.2), 1.0);
    }

    #[test]
    fn waves_along_x_are_as_strong_as_waves_along_y() {
        let cross = |fx: f64, fy: f64| {
            f64::from(u8::from((fx == 4.0 && fy == 0.0) || (fx == 0.0 && fy.abs() == 4.0)))
        };
        let (mut x, mut y) = (0.0, 0.0);
        for seed in 0..300 {
            let field = gaussian((16, 1.0 / 16.0), 1.0, &mut Random::new(seed), cross);
            for i in 0..16 {
                x += f64::from(field.point(i + 1, i) - field.point(i, i)).powi(2);
                y += f64::from(field.point(i, i + 1) - field.point(i, i)).powi(2);
            }
        }
        assert!((0.8..1.25).contains(&(x / y)), "{x} {y}");
    }

    #[test]
    fn a_blur_is_a_convolution_with_its_gaussian() {
        let mut field = HeightField::flat(64, 0.1);
        field.heights_mut()[32 * 64 + 32] = 1.0;
        let out = blur(&field, 0.3);
        let want = |r: f64| 0.01 / (TAU * 0.09) * (-r * r / 0.18).exp();
        for (dx, dy) in [(0, 0), (3, 0), (-4, 5)] {
            let r = f64::hypot(f64::from(dx) * 0.1, f64::from(dy) * 0.1);
            let found = f64::from(out.point(32 + i64::from(dx), 32 + i64::from(dy)));
            assert!((found - want(r)).abs() < 1e-5, "{found} {}", want(r));
        }
    }
}
