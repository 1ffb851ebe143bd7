//! Compares tables, read at any speed, with the waves they are made of.

use std::f64::consts::TAU;

use super::*;

const RATE: u32 = 48_000;
const SPACING_MM: f64 = 0.05;

fn flat(reference_speed_mm_s: f64) -> WaveformQuantity {
    WaveformQuantity::Acceleration { reference_speed_mm_s, speed_exponent: 0.0 }
}

/// A loop of `count` values with `waves` waves of amplitude 1.
fn wave(count: usize, waves: f64, quantity: WaveformQuantity) -> Arc<WaveformTable> {
    let values: Vec<f64> = (0..count).map(|n| (TAU * waves * n as f64 / count as f64).sin()).collect();
    Arc::new(WaveformTable::new(&values, SPACING_MM, 0.0, quantity).unwrap())
}

/// All samples of a straight stroke aslant, at a speed that is a function of time.
fn stroke(
    table: &Arc<WaveformTable>,
    tick_hz: u32,
    seconds: f64,
    speed: impl Fn(f64) -> (f64, f64),
) -> Vec<f64> {
    let (mut path, mut waveform) = (Path::new(tick_hz), Reader::new(table.clone(), 1.0));
    let mut all = Vec::new();
    for tick in 0..(seconds * f64::from(tick_hz)) as u64 {
        let (place, v) = speed(tick as f64 / f64::from(tick_hz));
        path.advance([0.6 * place, -0.8 * place], [0.6 * v, -0.8 * v]);
        let first = tick * u64::from(RATE) / u64::from(tick_hz);
        let next = (tick + 1) * u64::from(RATE) / u64::from(tick_hz);
        let mut out = vec![0.0f64; (next - first) as usize];
        waveform.process(&path, &Parts::new(tick, first, RATE, tick_hz), &mut out);
        all.extend(out);
    }
    all
}

fn rms(x: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = x.fold((0.0, 0), |(sum, count), x| (sum + x * x, count + 1));
    (sum / f64::from(count)).sqrt()
}

fn decibels(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

// A wave comes out unchanged up to the edge of the band. Images and errors are 95 dB below it.
#[test]
fn waves_in_band_are_exact_with_images_95_db_below() {
    let count = 1000;
    let mut worst = f64::NEG_INFINITY;
    for waves in [1.0, 37.0, 250.0, 430.0, 495.0] {
        for (speed, tick_hz) in [(3.0, 500), (20.0, 100), (73.3, 500), (150.0, 4000)] {
            let table = wave(count, waves, flat(100.0));
            let x = stroke(&table, tick_hz, 0.5, |t| (speed * t, speed));
            // The n-th sample stands after n + 1 ways; its place in the loop, its phase.
            let want = |n: usize| {
                let distance = speed * (n + 1) as f64 / f64::from(RATE);
                (TAU * waves * distance / table.length_mm).sin()
            };
            let off = rms(x.iter().enumerate().map(|(n, x)| x - want(n)));
            worst = worst.max(decibels(off / 0.5_f64.sqrt()));
        }
    }
    assert!(worst < -95.0, "{worst} dB");
}

// At any speed, waves up to a sixth of the rate stay. Waves beyond half of it are left out.
#[test]
fn waves_to_a_sixth_of_rate_stay_beyond_half_vanish() {
    let (count, waves) = (4000, 1900.0);
    let table = wave(count, waves, flat(100.0));
    let per_mm = waves / table.length_mm;
    for step in 0..60 {
        let waves_per_sample = 0.05 * 1.1_f64.powi(step);
        let speed = waves_per_sample * f64::from(RATE) / per_mm;
        let x = stroke(&table, 1000, 0.05, |t| (speed * t, speed));
        let level = decibels(rms(x.iter().copied()) * 2.0_f64.sqrt());
        if waves_per_sample < 0.16 {
            assert!(level.abs() < 0.1, "{waves_per_sample}: {level} dB");
        } else if waves_per_sample > 0.5 {
            assert!(level < -80.0, "{waves_per_sample}: {level} dB");
        } else {
            assert!(level < 0.1, "{waves_per_sample}: {level} dB");
        }
    }
    // A low wave in a fine table stays when the finest copies are long left.
    let low = wave(count, 10.0, flat(100.0));
    for waves_per_sample in [0.01, 0.05, 0.1, 0.15] {
        let speed = waves_per_sample * f64::from(RATE) * low.length_mm / 10.0;
        let x = stroke(&low, 1000, 0.05, |t| (speed * t, speed));
        let want = |n: usize| (TAU * waves_per_sample * (n + 1) as f64).sin();
        let off = rms(x.iter().enumerate().map(|(n, x)| x - want(n)));
        assert!(off < 1e-4, "{waves_per_sample}: {off}");
    }
}

#[test]
fn it_is_read_by_distance_whatever_the_speed_does_between_ticks() {
    let table = wave(2000, 100.0, flat(100.0));
    // 10 mm/s to 190 mm/s and back; a wave is 1 mm.
    let motion = |t: f64| (100.0 * t - 90.0 / 8.0 * (8.0 * t).sin(), 100.0 - 90.0 * (8.0 * t).cos());
    for tick_hz in [100, 500, 4000] {
        let x = stroke(&table, tick_hz, 1.0, motion);
        let tick_s = 1.0 / f64::from(tick_hz);
        let delay = 1.5 * tick_s - 1.0 / f64::from(RATE);
        let from = motion(-delay).0;
        let worst = x.iter().enumerate().skip(2 * (RATE / tick_hz) as usize).map(|(n, x)| {
            let distance = motion(n as f64 / f64::from(RATE) - delay).0 - from;
            // The path's own beginning is at constant velocity: a little off.
            (x - (TAU * distance).sin()).abs()
        });
        let worst = worst.fold(0.0, f64::max);
        // The path is off by an eighth of a tick's acceleration, of at most 720 mm/s^2, at both ends.
        let most = 0.002 + TAU * 2.0 * 0.125 * 720.0 * tick_s * tick_s;
        assert!(worst < most, "{tick_hz} Hz: {worst}");
    }
}

// A recording has its own level at its reference speed; at others, the level follows a power of the speed.
#[test]
fn recording_level_follows_power_of_speed() {
    let at = |exponent: f64, speed: f64| {
        let quantity =
            WaveformQuantity::Acceleration { reference_speed_mm_s: 80.0, speed_exponent: exponent };
        rms(stroke(&wave(1000, 50.0, quantity), 500, 0.5, |t| (speed * t, speed)).into_iter())
    };
    for exponent in [0.0, 0.5, 1.0, 1.7, 2.0] {
        assert!(decibels(at(exponent, 80.0) * 2.0_f64.sqrt()).abs() < 0.01, "{exponent}");
        let rise = decibels(at(exponent, 160.0) / at(exponent, 80.0));
        assert!((rise - 6.0206 * exponent).abs() < 0.01, "{exponent}: {rise} dB");
        assert_eq!(at(exponent, 0.0), 0.0);
    }
    // Under 1 mm/s even a level that does not depend on the speed falls.
    assert!(decibels(at(0.0, 0.5) / at(0.0, 2.0)) < -5.0);
}

#[test]
fn heights_become_the_acceleration_of_their_curve() {
    // 2 um over 1 mm, at 120 mm/s: 120 Hz, A (2 pi f)^2 = 1.137 m/s^2.
    let values: Vec<f64> = (0..2000).map(|n| 7.0 + 0.002 * (TAU * n as f64 / 20.0).sin()).collect();
    let table = Arc::new(WaveformTable::new(&values, SPACING_MM, 0.0, WaveformQuantity::Height).unwrap());
    let x = stroke(&table, 500, 0.5, |t| (120.0 * t, 120.0));
    let peak = 0.002e-3 * (TAU * 120.0).powi(2);
    for (n, x) in x.iter().enumerate() {
        let want = -peak * (TAU * 120.0 * (n + 1) as f64 / f64::from(RATE)).sin();
        assert!((x - want).abs() < 1e-3 * peak, "{n}: {x} {want}");
    }
    let fast = stroke(&table, 500, 0.5, |t| (240.0 * t, 240.0));
    assert!((rms(fast.into_iter()) / rms(x.into_iter()) - 4.0).abs() < 1e-3);
}

#[test]
fn a_crossfaded_seam_has_the_level_of_the_rest_and_no_step() {
    use asperity_numbers::Random;
    // Smooth noise, of which beginning and end have nothing in common, and a wave, of which they are alike.
    let mut random = Random::new(3);
    let mut noise = vec![0.0; 40_000];
    let mut state = [0.0; 2];
    for x in &mut noise {
        state[0] += 0.2 * (random.normal() - state[0]);
        state[1] += 0.2 * (state[0] - state[1]);
        *x = state[1];
    }
    let wave: Vec<f64> = (0..40_000).map(|n| (TAU * n as f64 / 40.0).sin()).collect();
    for (name, values) in [("noise", noise), ("wave", wave)] {
        let table = Arc::new(WaveformTable::new(&values, SPACING_MM, 250.0, flat(100.0)).unwrap());
        assert!((table.length_mm - 1750.0).abs() < 1e-9, "{name}");
        let x = stroke(&table, 500, 40.0, |t| (100.0 * t, 100.0));
        // The faded 250 mm are the first 2.5 s of each round of 17.5 s.
        let part = |from: f64, to: f64| {
            rms(x[(from * f64::from(RATE)) as usize..(to * f64::from(RATE)) as usize].iter().copied())
        };
        let level = decibels(part(17.5, 20.0) / part(20.0, 35.0));
        assert!(level.abs() < 0.6, "{name}: {level} dB");
        let step = |from: f64, to: f64| {
            let x = &x[(from * f64::from(RATE)) as usize..(to * f64::from(RATE)) as usize];
            x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max)
        };
        assert!(step(17.4, 17.6) < 1.2 * step(5.0, 17.0), "{name}");
    }
}

#[test]
fn segments_are_the_means_of_their_lines() {
    // A saw of 1 mm and a ridge at 3.3 mm.
    let pairs = [(10.0, 0.0), (11.0, 2.0), (11.5, -2.0), (13.3, 0.0), (13.3001, 5.0), (14.0, 0.0)];
    let table = Arc::new(WaveformTable::from_segments(&pairs, 0.01, 0.0, flat(100.0)).unwrap());
    assert!((table.length_mm - 4.0).abs() < 1e-9);
    let line = |x: f64| {
        let i = pairs.windows(2).position(|w| x <= w[1].0).unwrap();
        let (a, b) = (pairs[i], pairs[i + 1]);
        a.1 + (b.1 - a.1) * (x - a.0) / (b.0 - a.0)
    };
    let mean = (0..400_000).map(|n| line(10.0 + (f64::from(n) + 0.5) * 1e-5)).sum::<f64>() / 400_000.0;
    // Away from its corners the table is the lines; its values stand for the middles of their cells.
    for x in [10.4, 10.8, 11.25, 12.5, 13.6] {
        let read = table.read(x - 10.0 - 0.005, 1e-4);
        assert!((read - (line(x) - mean)).abs() < 0.05, "{x}: {read} {}", line(x) - mean);
    }
    let refused = |pairs: &[(f64, f64)]| {
        WaveformTable::from_segments(pairs, 0.01, 0.0, flat(100.0)).unwrap_err().to_string()
    };
    assert!(refused(&[(0.0, 1.0), (2.0, 1.0), (2.0, 0.0)]).contains("distance 3 is not above"));
    assert!(refused(&[(0.0, 1.0)]).contains("1 distances"));
    assert!(refused(&[(0.0, 1.0), (f64::NAN, 1.0)]).contains("number 2 of the distances"));
    assert!(refused(&[(0.0, 1.0), (0.03, 1.0)]).contains("length"));
    assert!(refused(&[(0.0, 1.0), (1e9, 1.0)]).contains("length"));
}

#[test]
fn whatever_comes_is_finite_and_what_cannot_be_is_refused() {
    let quantity = WaveformQuantity::Acceleration { reference_speed_mm_s: 0.1, speed_exponent: 2.0 };
    for table in [wave(4, 1.0, quantity), wave(5, 1.0, WaveformQuantity::Height), wave(1000, 499.0, quantity)]
    {
        let mut waveform = Reader::new(table, 1.0);
        let mut path = Path::new(500);
        for (tick, x) in [f64::NAN, 1e300, -1e300, f64::INFINITY, 3.0, 3.1].into_iter().enumerate() {
            path.advance([x, 0.0], [-x, x]);
            let mut out = [0.0f64; 96];
            waveform.process(&path, &Parts::new(tick as u64, 96 * tick as u64, RATE, 500), &mut out);
            assert!(out.iter().all(|x| x.is_finite()) && waveform.distance_mm < waveform.table.length_mm);
            waveform.process(&path, &Parts::new(tick as u64, 0, RATE, 500), &mut [0.0f64; 0]);
        }
    }
    let refused = |values: &[f64], spacing: f64, fade: f64, quantity| -> String {
        WaveformTable::new(values, spacing, fade, quantity).unwrap_err()
    };
    let good = [0.0, 1.0, 0.0, -1.0];
    assert!(refused(&good[..3], 0.1, 0.0, flat(1.0)).to_string().contains("3 values"));
    assert!(refused(&[0.0, 1.0, f64::NAN, 0.0], 0.1, 0.0, flat(1.0)).to_string().contains("number 3"));
    refused(&[0.0, 1e7, 0.0, 0.0], 0.1, 0.0, flat(1.0));
    refused(&good, 0.0, 0.0, flat(1.0));
    refused(&good, f64::NAN, 0.0, flat(1.0));
    refused(&good, 0.1, 0.21, flat(1.0));
    let silent = Arc::new(WaveformTable::new(&[3.0; 100], 0.1, 5.0, WaveformQuantity::Height).unwrap());
    assert!(stroke(&silent, 500, 0.1, |t| (50.0 * t, 50.0)).iter().all(|x| *x == 0.0));
}
