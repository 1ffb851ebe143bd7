//! Reliefs against closed forms, and splines against the waves they go through.

use std::f64::consts::TAU;

use super::*;
use asperity_surfaces::topography::HeightField;

const RATE: u32 = 48_000;
/// Usual cutoff and largest acceleration.
const USUAL: (f64, f64) = (1000.0, 200.0);

/// Path and samples of every tick of a motion.
fn ticks(
    tick_hz: u32,
    seconds: f64,
    place: impl Fn(f64) -> [f64; 2],
) -> impl Iterator<Item = (Path, Parts, usize)> {
    let hz = f64::from(tick_hz);
    let mut path = Path::new(tick_hz);
    (0..(seconds * hz) as u64).map(move |tick| {
        let [here, next] = [tick, tick + 1].map(|tick| place(tick as f64 / hz));
        path.advance(here, [0, 1].map(|i| (next[i] - here[i]) * hz));
        let [first, end] = [tick, tick + 1].map(|tick| tick * u64::from(RATE) / u64::from(tick_hz));
        (path, Parts::new(tick, first, RATE, tick_hz), (end - first) as usize)
    })
}

/// All samples along a motion.
fn felt(
    (jet, spacing_mm): (&dyn Fn(f64, f64) -> Jet, f64),
    (cutoff_hz, max_m_s2): (f64, f64),
    tick_hz: u32,
    seconds: f64,
    place: impl Fn(f64) -> [f64; 2],
) -> Vec<f64> {
    let mut relief = Follower::new(cutoff_hz, max_m_s2, RATE).unwrap();
    let samples = |(path, parts, len)| {
        let mut out = vec![0.0; len];
        relief.process((jet, spacing_mm), &path, &parts, &mut out);
        out
    };
    ticks(tick_hz, seconds, place).flat_map(samples).collect()
}

/// Amplitude and phase of a frequency in whole periods at the end of a signal.
fn lock_in(x: &[f64], hz: f64) -> (f64, f64) {
    let period = f64::from(RATE) / hz;
    let len = ((x.len() as f64 / 2.0 / period).floor() * period).round() as usize;
    let from = x.len() - len;
    let (mut re, mut im) = (0.0, 0.0);
    for (n, x) in x.iter().enumerate().skip(from) {
        let (sin, cos) = (TAU * hz * (n + 1) as f64 / f64::from(RATE)).sin_cos();
        (re, im) = (re + x * cos, im + x * sin);
    }
    (2.0 * re.hypot(im) / len as f64, re.atan2(im))
}

fn decibels(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

/// A sine along a way, with what it rises by.
fn grating(amplitude: f64, wavelength: f64, angle: f64) -> impl Fn(f64, f64) -> Jet {
    let (sin, cos) = angle.sin_cos();
    move |x, y| {
        let k = TAU / wavelength;
        let (s, c) = (k * (cos * x + sin * y)).sin_cos();
        let (h, d, dd) = (amplitude * s, amplitude * k * c, -amplitude * k * k * s);
        Jet {
            height_mm: h,
            slope: [d * cos, d * sin],
            curve_per_mm: [dd * cos * cos, dd * cos * sin, dd * sin * sin],
        }
    }
}

#[test]
fn sine_grating_has_its_frequency_and_amplitude() {
    for (wavelength, speed, angle, tick_hz) in [
        (1.0, 100.0, 0.0_f64, 500),
        (0.5, 60.0, 0.4, 100),
        (2.0, 250.0, 2.0, 1000),
        (0.64, 280.0, -1.0, 4000),
        (0.4, 200.0, 0.9, 500),
    ] {
        // As it is, and through a spline of a field that it closes on.
        let amplitude = 0.003;
        let wave = grating(amplitude, wavelength, 0.0);
        let count = 16.0 * 10.0;
        let field = HeightField::from_fn(count as usize, wavelength / 16.0, |x, y| wave(x, y).height_mm);
        let spline = HeightSpline::new(&field);
        let place = |t: f64| [0.3 + speed * angle.cos() * t, 0.3 + speed * angle.sin() * t];
        let hz = speed * angle.cos().abs() / wavelength;
        let want = 1e-3 * amplitude * (TAU * hz).powi(2);
        let all: [&dyn Fn(f64, f64) -> Jet; 2] = [&wave, &|x, y| spline.jet(x, y)];
        for heights in all {
            let x = felt((heights, 0.0), USUAL, tick_hz, 1.0, place);
            let off = decibels(lock_in(&x, hz).0 / want);
            assert!(off.abs() < 0.1, "{wavelength} mm at {speed} mm/s: {off} dB");
            // And nothing else.
            let power: f64 = x[24_000..].iter().map(|x| x * x).sum::<f64>() / 24_000.0;
            assert!(decibels((2.0 * power).sqrt() / want).abs() < 0.15);
        }
    }
}

/// A smooth surface without symmetry.
fn hills(x: f64, y: f64) -> f64 {
    0.01 * ((2.1 * x + 0.7 * y).sin()
        + 0.6 * (1.3 * x * 1.7 - 2.9 * y + 1.0).cos()
        + 0.5 * (4.0 * y).sin() * (3.0 * x).cos())
}

/// The same with its derivatives, differenced in steps of a micrometre or so.
fn hills_jet(x: f64, y: f64) -> Jet {
    let e = 1e-4;
    let h = |i: f64, j: f64| hills(x + i * e, y + j * e);
    let c = h(0.0, 0.0);
    Jet {
        height_mm: c,
        slope: [(h(1.0, 0.0) - h(-1.0, 0.0)) / (2.0 * e), (h(0.0, 1.0) - h(0.0, -1.0)) / (2.0 * e)],
        curve_per_mm: [
            (h(1.0, 0.0) + h(-1.0, 0.0) - 2.0 * c) / (e * e),
            (h(1.0, 1.0) + h(-1.0, -1.0) - h(1.0, -1.0) - h(-1.0, 1.0)) / (4.0 * e * e),
            (h(0.0, 1.0) + h(0.0, -1.0) - 2.0 * c) / (e * e),
        ],
    }
}

#[test]
fn accelerating_path_gives_second_difference_of_height() {
    // A curve whose speed goes from 20 to 230 mm/s.
    let place =
        |t: f64| [70.0 * t + 25.0 * (9.0 * t).sin() / 9.0 * 2.0, 12.0 * (5.0 * t).sin() + 60.0 * t * t];
    for tick_hz in [100, 500, 4000] {
        let x = felt((&hills_jet, 0.0), USUAL, tick_hz, 1.0, place);
        // The truth along the same path, by second differences of 40 us, behind the same low-pass.
        let mut filters = DAMPING.map(|d| Section::low_pass(1000.0, d).bilinear(48_000.0, 1000.0).unwrap());
        let e = 2e-5;
        let truth = ticks(tick_hz, 1.0, place).flat_map(|(path, parts, len)| {
            let height = move |part: f64| {
                let [x, y] = path.at(part).position_mm;
                hills(x, y)
            };
            let by = e * f64::from(tick_hz);
            let curve = move |s: f64| height(s + by) + height(s - by) - 2.0 * height(s);
            (0..len).map(move |n| 1e-3 * curve(parts.at(n)) / (e * e))
        });
        let truth: Vec<f64> = truth.map(|x| filters.iter_mut().fold(x, |x, filter| filter.step(x))).collect();
        let (mut worst, mut power, mut count) = (0.0_f64, 0.0, 0);
        for (x, truth) in x.iter().zip(&truth).skip(3 * (RATE / tick_hz) as usize + 480) {
            worst = worst.max((x - truth).abs());
            (power, count) = (power + truth * truth, count + 1);
        }
        let rms = (power / f64::from(count)).sqrt();
        assert!(worst < 1e-4 * rms && rms > 0.1, "{tick_hz} Hz: {worst} of {rms}");
    }
}

#[test]
fn spline_passes_its_points_with_consistent_derivatives() {
    for side in [1, 2, 3, 7, 64] {
        let mut seed = 1u32;
        let field = HeightField::from_fn(side, 0.05, |_, _| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 8) / 16_777_216.0
        });
        let spline = HeightSpline::new(&field);
        for row in 0..side {
            for column in 0..side {
                let jet = spline.jet(column as f64 * 0.05, row as f64 * 0.05);
                assert!((jet.height_mm - f64::from(field.point(column as i64, row as i64))).abs() < 2e-6);
            }
        }
        for (x, y) in [(0.0123, 0.0456), (-0.021, 3.33), (7.7, -9.99), (0.05, 0.1)] {
            let (e, jet) = (1e-5, spline.jet(x, y));
            let at = |i: f64, j: f64| spline.jet(x + i * e, y + j * e);
            let [right, left, up, down] = [at(1.0, 0.0), at(-1.0, 0.0), at(0.0, 1.0), at(0.0, -1.0)];
            let slope = |of: fn(&Jet) -> f64, a: &Jet, b: &Jet| (of(a) - of(b)) / (2.0 * e);
            for (found, want, most) in [
                (slope(|j| j.height_mm, &right, &left), jet.slope[0], 1e-3),
                (slope(|j| j.height_mm, &up, &down), jet.slope[1], 1e-3),
                (slope(|j| j.slope[0], &right, &left), jet.curve_per_mm[0], 0.05),
                (slope(|j| j.slope[0], &up, &down), jet.curve_per_mm[1], 0.05),
                (slope(|j| j.slope[1], &right, &left), jet.curve_per_mm[1], 0.05),
                (slope(|j| j.slope[1], &up, &down), jet.curve_per_mm[2], 0.05),
            ] {
                assert!((found - want).abs() < most, "{side} at {x} {y}: {found} {want}");
            }
        }
    }
}

/// Off and image in dB of the second derivative of a wave of so many points.
fn of_points(points: f64) -> (f64, f64) {
    let waves = 48.0;
    let side = (waves * points) as usize;
    let k = TAU / points;
    let field = HeightField::from_fn(side, 1.0, |x, _| (k * x).sin());
    let spline = HeightSpline::new(&field);
    // Fine samples of whole points, over all of the field: the wave, and its mirror image about half a wave a
    // point.
    let (fine, mut own, mut image) = (16, 0.0, 0.0);
    for n in 0..side * fine {
        let x = n as f64 / fine as f64;
        let y = -spline.jet(x, 0.4).curve_per_mm[0] / (k * k);
        own += y * (k * x).sin();
        image += y * ((TAU - k) * x).sin();
    }
    let count = (side * fine) as f64 / 2.0;
    (decibels(own / count), decibels((image / count).abs()))
}

#[test]
fn the_second_derivative_of_a_spline_is_off_by_what_is_said() {
    for (points, off, image) in [
        (16.0, -0.0001, -90.0),
        (8.0, -0.0001, -67.0),
        (5.0, -0.0025, -48.0),
        (4.0, -0.013, -38.0),
        (3.0, -0.14, -24.0),
    ] {
        let found = of_points(points);
        assert!(found.0 > off && found.0 < 1e-4 && found.1 < image, "{points}: {found:?}");
        assert!(points > 10.0 || found.1 > image - 1.0, "{points}: {found:?}");
    }
}

/// Noise beside a wave of 2 mm in dB over it, of a device that reports positions in steps. They may come from
/// behind a low-pass of 20 Hz.
fn beside_the_wave(step: f64, speed: f64, tick_hz: u32, filtered: bool) -> f64 {
    let hz = f64::from(tick_hz);
    let mut filter = Section::butterworth_low_pass(20.0).bilinear(hz, 20.0).unwrap();
    let seen = (0..=2 * tick_hz).map(|k| {
        let x = speed * f64::from(k) / hz + 0.123;
        let x = (x / step).round() * step;
        if filtered { filter.step(x) } else { x }
    });
    let seen: Vec<f64> = seen.collect();
    let place = |t: f64| [seen[(t * hz).round() as usize], 0.0];
    let x = felt((&grating(0.01, 2.0, 0.0), 0.0), USUAL, tick_hz, 2.0, place);
    // Whole periods near the end.
    let wave = 0.5 * speed;
    let (amplitude, _) = lock_in(&x, wave);
    let len = ((0.5 * x.len() as f64 * wave / 48e3).floor() * 48e3 / wave).round() as usize;
    let power = x[x.len() - len..].iter().map(|x| x * x).sum::<f64>() / len as f64;
    let rest = (power - 0.5 * amplitude * amplitude).max(1e-30).sqrt();
    decibels(rest / (amplitude / 2.0_f64.sqrt()))
}

// A device that reports positions in steps makes the relief rattle; a low-pass on the positions prevents it.
#[test]
fn stepped_positions_rattle_and_filtered_ones_do_not() {
    for (step, speed, tick_hz) in [(0.055, 61.7, 500), (0.055, 157.1, 1000), (0.005, 19.3, 1000)] {
        let [plain, filtered] = [false, true].map(|f| beside_the_wave(step, speed, tick_hz, f));
        assert!(filtered < plain - 15.0, "{plain} {filtered}");
    }
}

#[test]
fn what_would_come_back_mirrored_is_left_out() {
    let field = HeightField::from_fn(64, 0.05, |x, _| 0.01 * (TAU * x / 0.2).sin());
    let spline = HeightSpline::new(&field);
    let level = |speed: f64| {
        let heights = |x, y| spline.jet(x, y);
        let x = felt((&heights, 0.05), (20_000.0, 1e4), 1000, 0.1, |t| [speed * t, 0.0]);
        (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt() / speed.powi(2)
    };
    // 0.05 mm at 48 kHz: 2400 mm/s.
    let slow = level(100.0);
    assert!((level(300.0) / slow - 1.0).abs() < 0.02 && level(3601.0) == 0.0, "{} {slow}", level(300.0));
}

#[test]
fn any_input_is_finite_and_bounded_bad_settings_refused() {
    let mut relief = Follower::new(1000.0, 5.0, RATE).unwrap();
    let mut path = Path::new(500);
    let steep = grating(1.0, 1.0, 0.3);
    let bad = |_: f64, _: f64| Jet { height_mm: 0.0, slope: [f64::NAN; 2], curve_per_mm: [f64::INFINITY; 3] };
    let mut field = HeightField::from_fn(8, 0.1, |x, y| x * y);
    field.heights_mut()[5] = f32::NAN;
    let spline = HeightSpline::new(&field);
    let all: [(&dyn Fn(f64, f64) -> Jet, f64); 3] =
        [(&steep, 0.0), (&bad, 0.0), (&|x, y| spline.jet(x, y), 0.1)];
    for (tick, x) in [0.0, f64::NAN, 1e300, -1e300, 3.0, 3.5, f64::INFINITY, 4.0, 4.1].into_iter().enumerate()
    {
        path.advance([x, -x], [x, 1.0]);
        for heights in all {
            let mut out = [0.0f64; 96];
            relief.process(heights, &path, &Parts::new(tick as u64, 96 * tick as u64, RATE, 500), &mut out);
            assert!(out.iter().all(|x| x.abs() <= 5.0), "{tick}");
        }
    }
    for degenerate in [HeightField::flat(0, 0.1), HeightField::flat(3, 0.0), HeightField::flat(3, f64::NAN)] {
        assert_eq!(HeightSpline::new(&degenerate).jet(0.3, -7.0), Jet::default());
    }
    let refused = |cutoff_hz: f64, most: f64, rate: u32| Follower::new(cutoff_hz, most, rate).is_err();
    assert!(refused(19.0, 5.0, RATE) && refused(21_601.0, 5.0, RATE) && refused(1000.0, 5.0, 0));
    assert!(!refused(21_600.0, 5.0, RATE) && !refused(1000.0, 1e4, 2500));
}
