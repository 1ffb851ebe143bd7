use super::*;
use crate::random::uniform;
use std::f64::consts::TAU;

/// Something different in every place and lane.
fn work(len: usize) -> Work<f64> {
    let mut work = Work::new(len);
    for (row, part) in [&mut work.re, &mut work.im].into_iter().enumerate() {
        for (n, lanes) in part.iter_mut().enumerate() {
            for (l, x) in lanes.iter_mut().enumerate() {
                *x = uniform(row as u64, n as u64, l as u64) - 0.5;
            }
        }
    }
    work
}

#[test]
fn transform_of_each_lane_matches_its_definition() {
    for len in [1, 2, 3, 4, 5, 6, 7, 8, 12, 20, 25, 36, 49, 105, 125, 128, 441, 500] {
        let fft = Fft::<f64>::new(len).unwrap();
        for inverse in [false, true] {
            let (before, mut after) = (work(len), work(len));
            fft.run(Portable, &mut after, inverse);
            for k in (0..len).step_by(1 + len / 20) {
                for l in 0..LANES {
                    let (mut re, mut im) = (0.0, 0.0);
                    for n in 0..len {
                        let turns = (n * k % len) as f64 / len as f64;
                        let (sin, cos) = (if inverse { TAU * turns } else { -TAU * turns }).sin_cos();
                        let (a, b) = (before.re[n][l], before.im[n][l]);
                        (re, im) = (re + a * cos - b * sin, im + a * sin + b * cos);
                    }
                    let off = (after.re[k][l] - re).abs().max((after.im[k][l] - im).abs());
                    assert!(off < 2e-15 * len as f64, "{len} points, inverse {inverse}, bin {k}: {off}");
                }
            }
        }
    }
}

#[test]
fn forward_and_inverse_scale_by_the_length() {
    for len in [50, 125, 400, 2205, 2400] {
        let fft = Fft::<f64>::new(len).unwrap();
        let (before, mut after) = (work(len), work(len));
        fft.run(Portable, &mut after, false);
        fft.run(Portable, &mut after, true);
        for (a, b) in [(&after.re, &before.re), (&after.im, &before.im)] {
            let off = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a / len as f64 - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-14, "{len}");
        }
    }
}

#[test]
fn length_with_a_large_prime_factor_is_refused() {
    assert!([0, 11, 13 * 4, 26].into_iter().all(|len| Fft::<f32>::new(len).is_none()));
}
