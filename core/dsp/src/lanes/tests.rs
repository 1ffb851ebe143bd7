use super::*;
use crate::random::uniform;
use std::f64::consts::TAU;

/// A transform of something different in every place and lane.
fn filled(len: usize) -> Fft<f64> {
    let mut fft = Fft::new(len).unwrap();
    for (n, x) in fft.points.iter_mut().enumerate() {
        x.re = each(|l| uniform(0, n as u64, l as u64) - 0.5);
        x.im = each(|l| uniform(1, n as u64, l as u64) - 0.5);
    }
    fft
}

#[test]
fn transform_of_each_lane_matches_its_definition() {
    for len in [1, 2, 3, 4, 5, 6, 7, 8, 12, 20, 25, 36, 49, 105, 125, 128, 441, 500] {
        let mut fft = filled(len);
        let before = fft.points.clone();
        fft.run();
        for k in (0..len).step_by(1 + len / 20) {
            for l in 0..LANES {
                let (mut re, mut im) = (0.0, 0.0);
                for (n, x) in before.iter().enumerate() {
                    let (sin, cos) = (-TAU * (n * k % len) as f64 / len as f64).sin_cos();
                    let (a, b) = (x.re.0[l], x.im.0[l]);
                    (re, im) = (re + a * cos - b * sin, im + a * sin + b * cos);
                }
                let off = (fft.points[k].re.0[l] - re).abs().max((fft.points[k].im.0[l] - im).abs());
                assert!(off < 2e-15 * len as f64, "{len} points, bin {k}: {off}");
            }
        }
    }
}

#[test]
fn length_with_a_large_prime_factor_is_refused() {
    assert!([0, 11, 13 * 4, 26].into_iter().all(|len| Fft::<f32>::new(len).is_none()));
}
