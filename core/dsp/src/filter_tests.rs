//! Reference values: SciPy 1.17.1, printed with `repr`, from
//!
//! ```text
//! b, a = scipy.signal.butter(2, 20, fs=fs); scipy.signal.group_delay((b, a), w=[0.0], fs=fs)
//! scipy.signal.lfilter(b, a, numpy.ones(12))                                       # fs = 500
//! w = 2*pi*65; c = w / (2*48000*tan(w/(2*48000)))                         # s -> c s: prewarped at 65 Hz
//! wn = w; wc = 2*pi*20
//! num = [c*c, c*2*0.18*wn, wn**2]; den = [c*c, c*2*sqrt(.5)*wc, wc**2]
//! b, a = scipy.signal.bilinear(num, den, 48000)
//! scipy.signal.freqz(b, a, worN=[0, 10, 65, 1000, 10000], fs=48000)
//! ```

use super::*;

fn near(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance, "{a:e} is not within {tolerance:e} of {b:e}");
}

#[test]
fn butterworth_coefficients_and_delay_match_scipy() {
    let expect = [
        (100.0, 0.20657208382614792, -0.3695273773512414, 0.19581571265583306, 0.97324899),
        (500.0, 0.013359200027856505, -1.6474599810769768, 0.7008967811884027, 5.59732653),
        (48000.0, 1.7103058908949044e-06, -1.996297601769122, 0.9963044429926857, 540.18948115),
    ];
    for (fs, b0, a1, a2, delay) in expect {
        let f = Section::butterworth_low_pass(20.0).bilinear(fs, 20.0).unwrap();
        near(f.numerator()[0], b0, 1e-15);
        near(f.numerator()[1], 2.0 * b0, 2e-15);
        near(f.denominator()[0], a1, 1e-14);
        near(f.denominator()[1], a2, 1e-14);
        near(f.dc_group_delay(), delay, 1e-6);
        near(f.response(20.0, fs).norm(), FRAC_1_SQRT_2, 1e-9);
        near(f.dc_gain(), 1.0, 1e-9);
    }
}

#[test]
fn velocity_filter_step_matches_scipy() {
    let expect = [
        0.013359200027856505,
        0.06208634750866554,
        0.14635815270441413,
        0.2510398784717331,
        0.3644329954168294,
        0.4778725330738962,
        0.5852827609600505,
        0.6827274061575092,
        0.7679800764984489,
        0.8401318010021505,
        0.8992455574580092,
        0.9460621940883304,
    ];
    let mut f = Section::butterworth_low_pass(20.0).bilinear(500.0, 20.0).unwrap();
    for y in expect {
        near(f.step(1.0), y, 1e-14);
    }
}

#[test]
fn prewarped_response_is_exact_at_its_frequency() {
    let (wn, wc) = (TAU * 65.0, TAU * 20.0);
    let s = Section { num: [1.0, 2.0 * 0.18 * wn, wn * wn], den: [1.0, 2.0 * FRAC_1_SQRT_2 * wc, wc * wc] };
    let f = s.bilinear(48_000.0, 65.0).unwrap();
    for (got, want) in f.numerator().iter().zip([0.9996972694861641, -1.996264871590536, 0.9966398633168685])
    {
        near(*got, want, 1e-14);
    }
    for (hz, re, im) in [
        (0.0, 10.562499999904658, 0.0),
        (10.0, 7.668773144245265, -6.450125338405471),
        (65.0, 0.1552597134682987, -0.3230218273942401),
        (1000.0, 0.9960496392680526, 0.004767651937706135),
        (10_000.0, 0.9999711662823622, 0.0004165424806012972),
    ] {
        near(f.response(hz, 48_000.0).re, re, 1e-8);
        near(f.response(hz, 48_000.0).im, im, 1e-8);
    }
    assert!((f.response(65.0, 48_000.0) - s.response(65.0)).norm() < 1e-10);
}

#[test]
fn slow_filter_keeps_its_passband_for_minutes() {
    // A sine at the cutoff after ten million samples: phase and level as in closed form.
    let (rate, hz) = (48_000.0, 20.0);
    let mut f = Section::butterworth_low_pass(hz).bilinear(rate, hz).unwrap();
    let h = f.response(hz, rate);
    let mut worst = 0.0f64;
    for n in 0..10_000_000u32 {
        let phase = TAU * f64::from(n % 2400) / 2400.0;
        let y = f.step(phase.sin());
        if n > 9_900_000 {
            worst = worst.max((y - (h * Complex64::from_polar(1.0, phase)).im).abs());
        }
    }
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn first_order_sections_follow_the_closed_form() {
    let w = TAU * 100.0;
    let f = Section { num: [0.0, 0.0, w], den: [0.0, 1.0, w] }.bilinear(8000.0, 100.0).unwrap();
    near(f.response(100.0, 8000.0).norm(), FRAC_1_SQRT_2, 1e-12);
    // Its impulse response is a decaying power of the pole, with no part that alternates at half the rate.
    let mut g = f;
    g.step(1.0);
    let tail: Vec<f64> = (0..50).map(|_| g.step(0.0)).collect();
    for pair in tail.windows(2) {
        near(pair[1], -f.denominator()[0] * pair[0], 1e-17);
    }
}

#[test]
fn block_length_changes_no_sample() {
    let x: Vec<f32> = (0..1000).map(|n| ((n * n) as f32 * 0.37).sin()).collect();
    let mut whole = vec![0.0; x.len()];
    let made = Section::high_pass(30.0, 0.6).bilinear(2500.0, 30.0).unwrap();
    let mut f = made;
    f.process(&x, &mut whole);
    let mut parts = Vec::new();
    let mut f = made;
    let mut rest = &x[..];
    for n in [0, 1, 5, 96, 0, 333, 1000] {
        let (now, later) = rest.split_at(n.min(rest.len()));
        let mut y = now.to_vec();
        f.process_in_place(&mut y);
        parts.extend(y);
        rest = later;
    }
    assert_eq!(whole, parts);
}

#[test]
fn sample_that_is_not_finite_leaves_no_trace() {
    let mut f = Section::butterworth_low_pass(20.0).bilinear(500.0, 20.0).unwrap();
    let mut y = [0.0f32; 5];
    f.process(&[1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e38], &mut y);
    assert!(y.iter().all(|y| y.is_finite()), "{y:?}");
    f.step(f64::NAN);
    assert!(!f.settle());
    assert_eq!(f.step(0.0), 0.0);
}

#[test]
fn tail_ends_in_zero_without_denormals() {
    let mut f = Section::butterworth_low_pass(20.0).bilinear(48_000.0, 20.0).unwrap();
    let mut block = [1.0f32; 96];
    f.process_in_place(&mut block);
    for _ in 0..1000 {
        block = [0.0; 96];
        f.process_in_place(&mut block);
        assert!(block.iter().all(|y| *y == 0.0 || y.is_normal()), "{block:?}");
    }
    assert!(block.iter().all(|y| *y == 0.0));
}

#[test]
fn reset_to_constant_leaves_no_transient() {
    let mut f = Section::butterworth_low_pass(20.0).bilinear(48_000.0, 20.0).unwrap();
    f.reset_to(3.5);
    for _ in 0..100 {
        near(f.step(3.5), 3.5, 1e-9);
    }
}

#[test]
fn impossible_filter_is_refused() {
    let low = Section::butterworth_low_pass(20.0);
    let improper = Section { num: [1.0, 0.0, 0.0], den: [0.0, 1.0, 1.0] };
    for (refused, why) in [
        (low.bilinear(40.0, 20.0), "20 Hz is not between 0 and half the rate of 40 Hz"),
        (low.bilinear(f64::NAN, 20.0), "finite coefficients"),
        (low.bilinear(0.0, 0.0), "positive rate"),
        (improper.bilinear(500.0, 0.0), "the numerator's order"),
        (Section::low_pass(20.0, -0.1).bilinear(500.0, 20.0), "left half plane"),
        (Biquad::new([1.0, 0.0, 0.0], [0.0, 1.0]), "unit circle"),
    ] {
        assert!(refused.unwrap_err().0.contains(why), "{why}");
    }
}
