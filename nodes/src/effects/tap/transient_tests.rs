//! Compares taps with their closed form while they overlap, end and make room.

use std::f64::consts::TAU;

use super::*;

const RATE: u32 = 48_000;

fn sinusoid(frequency_hz: f64, decay_ms: f64, gain: f64) -> DecayingSinusoid {
    DecayingSinusoid { frequency_hz, decay_ms, gain }
}

fn of(transient: &Transient, settings: TapSettings) -> Taps {
    Taps::new(vec![Sound::new(transient, settings, RATE).unwrap()], RATE)
}

fn tap(all: &[DecayingSinusoid], settings: TapSettings) -> Taps {
    of(&Transient::Sinusoids(all.to_vec()), settings)
}

/// A tap of 1 m/s, `age` samples old.
fn closed(all: &[DecayingSinusoid], age: f64) -> f64 {
    let t = age / f64::from(RATE);
    all.iter().map(|s| s.gain * (-1e3 * t / s.decay_ms).exp() * (TAU * s.frequency_hz * t).sin()).sum()
}

#[test]
fn tap_is_closed_form_within_1e_9_over_ten_seconds() {
    let all = [sinusoid(300.0, 1e5, 1.0), sinusoid(61.7, 1e4, 0.5), sinusoid(20_000.0, 1e5, -0.3)];
    let mut tap = tap(&all, TapSettings::default());
    assert!(tap.strike(0, 7, 0.375, 1000.0));
    let mut out = vec![0.0f64; 480_096];
    // A tick at a time, of lengths that change.
    let (mut first, mut tick) = (0, 0);
    while first < out.len() {
        let len = [96, 88, 0, 1, 89, 700][tick % 6].min(out.len() - first);
        tap.process(first as u64, &mut out[first..first + len]);
        (first, tick) = (first + len, tick + 1);
    }
    assert!(out[..8].iter().all(|x| *x == 0.0));
    let off = |n: usize| (out[n] - closed(&all, n as f64 - 7.375)).abs();
    let worst = (8..out.len()).map(off).fold(0.0, f64::max);
    assert!(worst < 1e-9, "{worst}");
}

#[test]
fn the_level_is_that_of_the_speed_and_begins_at_nought() {
    let all = [sinusoid(250.0, 8.0, 300.0), sinusoid(120.0, 15.0, 100.0)];
    for (speed, counts) in [(200.0, 0.2), (50.0, 0.05), (4000.0, 1.0)] {
        let mut tap = tap(&all, TapSettings::default());
        assert!(tap.strike(0, 100, 0.0, speed));
        let mut out = [0.0f32; 4000];
        assert!(tap.process(0, &mut out));
        assert_eq!(out[100], 0.0);
        assert!((0..4000).all(|n| {
            let want = if n < 100 { 0.0 } else { counts * closed(&all, f64::from(n) - 100.0) };
            (f64::from(out[n as usize]) - want).abs() < 1e-5 * (1.0 + want.abs())
        }));
    }
}

#[test]
fn it_ends_exactly_where_the_envelope_passes_the_floor() {
    let mut tap = tap(&[sinusoid(180.0, 10.0, 200.0)], TapSettings::default());
    assert!(!tap.sounds() && tap.strike(0, 0, 0.0, 500.0) && tap.sounds());
    // 100 e^(-t / 10 ms) = 0.001 at 115.13 ms, sample 5526.2.
    let mut out = [0.0f64; 6000];
    assert!(tap.process(0, &mut out[..5526]));
    assert!(!tap.process(5526, &mut out[5526..]));
    assert!(out[5527..].iter().all(|x| *x == 0.0) && out[5500..5527].iter().any(|x| *x != 0.0));
    assert!(out[5526].abs() < 1e-3);
    // What could not be felt does not sound at all.
    let mut quiet = super::tests::tap(&[sinusoid(180.0, 10.0, 0.01)], TapSettings::default());
    assert!(!quiet.strike(0, 0, 0.0, 50.0) && !quiet.sounds());
}

// Contacts that are too slow do not sound. Nor do contacts too soon after one that sounded.
#[test]
fn slow_or_too_early_contacts_do_not_sound() {
    let mut tap = tap(&[sinusoid(180.0, 10.0, 200.0)], TapSettings::default());
    for speed in [1.99, 0.0, -50.0, f64::NAN, f64::INFINITY] {
        assert!(!tap.strike(0, 0, 0.0, speed), "{speed}");
    }
    assert!(tap.strike(0, 1000, 0.5, 2.0));
    // 20 ms are 960 samples.
    assert!(
        !tap.strike(0, 1960, 0.49, 100.0)
            && !tap.strike(0, 900, 0.0, 100.0)
            && tap.strike(0, 1960, 0.5, 100.0)
    );
    tap.reset();
    assert!(!tap.sounds() && tap.strike(0, 0, 0.0, 100.0));
}

#[test]
fn taps_overlap_and_the_quietest_makes_room_without_a_step() {
    let all = [sinusoid(100.0, 200.0, 100.0)];
    let settings = TapSettings { debounce_ms: 3.0, ..TapSettings::default() };
    let mut tap = tap(&all, settings);
    let speeds = [400.0, 100.0, 50.0, 300.0, 200.0, 600.0, 250.0, 350.0, 150.0, 500.0];
    let strikes: Vec<(u64, f64)> = (0..).step_by(200).zip(speeds).collect();
    let mut out = vec![0.0f64; 2400];
    for (n, chunk) in out.chunks_mut(50).enumerate() {
        for (at, speed) in &strikes {
            if at / 50 == n as u64 {
                assert!(tap.strike(0, *at, 0.0, *speed));
            }
        }
        tap.process(50 * n as u64, chunk);
    }
    let want = |n: usize| -> f64 {
        strikes
            .iter()
            .filter(|(at, _)| n as u64 >= *at)
            .map(|(at, speed)| {
                // The ninth takes the third's place, the tenth the second's: gone in 48 samples, in a
                // straight line.
                let gone =
                    [(50.0, 1600.0), (100.0, 1800.0)].iter().find(|g| g.0 == *speed).map_or(1e9, |g| g.1);
                let level = (1.0 - (n as f64 - gone) / 48.0).clamp(0.0, 1.0);
                1e-3 * speed * level * closed(&all, n as f64 - *at as f64)
            })
            .sum()
    };
    let worst = (0..2400).map(|n| (out[n] - want(n)).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-9, "{worst}");
    // The largest step is that of the sinusoids: 2 pi f A / rate.
    let step = out.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
    let level: f64 = strikes.iter().map(|s| 0.1 * s.1).sum();
    assert!(step < level * (TAU * 100.0 + 1000.0) / f64::from(RATE), "{step}");
}

#[test]
fn strikes_within_one_tick_leave_no_voice_fading_twice() {
    let settings = TapSettings { debounce_ms: 2.0, ..TapSettings::default() };
    let mut tap = tap(&[sinusoid(100.0, 2000.0, 100.0)], settings);
    let sounding = (0..16u64).filter(|n| tap.strike(0, 100 * n, 0.0, 100.0)).count();
    // Eight, four more for which others fade, and no more before anything was made.
    assert_eq!(sounding, 12);
    tap.process(0, &mut [0.0f32; 100]);
    assert!(tap.strike(0, 2000, 0.0, 100.0));
}

#[test]
fn skipped_samples_change_nothing_late_tap_begins_late() {
    let all = [sinusoid(100.0, 50.0, 100.0), sinusoid(333.0, 20.0, 70.0)];
    let mut whole = tap(&all, TapSettings::default());
    let mut late = whole.clone();
    for tap in [&mut whole, &mut late] {
        tap.strike(0, 3, 0.25, 500.0);
        tap.process(0, &mut [0.0f64; 10]);
    }
    let (mut a, mut b) = ([0.0f64; 2000], [0.0f64; 500]);
    whole.process(10, &mut a);
    late.process(1510, &mut b);
    assert!(a[1500..].iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-10 && b != 0.0));
    let mut missed = tap(&all, TapSettings::default());
    missed.strike(0, 3, 0.25, 500.0);
    missed.process(700, &mut b);
    assert!(b[0] == 0.0 && (b[333] - 0.5 * closed(&all, 333.0)).abs() < 1e-10);
}

/// A recording of a decaying sinusoid that was made at 10 kHz.
fn recording(phase: f64) -> Recording {
    let samples = (0..600)
        .map(|n| (-f64::from(n) / 100.0).exp() * (TAU * 200.0 * f64::from(n) / 1e4 + phase).sin() * 8.0);
    Recording { samples: samples.map(|x| x as f32).collect(), rate_hz: 1e4, speed_mm_s: 80.0 }
}

// At its own speed, a recording sounds as it was; at other speeds, in proportion.
#[test]
fn recording_scales_in_proportion_to_speed() {
    let mut tap = of(&Transient::Recorded(recording(0.0)), TapSettings::default());
    for (begin, part, speed) in [(0, 0.0, 80.0), (10_000, 0.5, 20.0)] {
        assert!(tap.strike(0, begin, part, speed));
        let mut out = [0.0f64; 4000];
        tap.process(begin, &mut out);
        for (n, x) in out.iter().enumerate().skip(1).take(2700) {
            let t = (n as f64 - part) / f64::from(RATE);
            let want = speed / 80.0 * 8.0 * (-t / 0.01).exp() * (TAU * 200.0 * t).sin();
            assert!((x - want).abs() < 2e-3 * speed / 80.0 * 8.0, "{n}: {x} {want}");
        }
        assert!(out[0] == 0.0 && out[2880..].iter().all(|x| *x == 0.0) && !tap.sounds());
    }
}

#[test]
fn a_recording_that_begins_and_ends_with_a_step_is_faded() {
    let flat = Recording { samples: vec![1.0; 480], rate_hz: 48_000.0, speed_mm_s: 100.0 };
    let mut tap = of(&Transient::Recorded(flat), TapSettings::default());
    tap.strike(0, 0, 0.0, 100.0);
    let mut out = [0.0f64; 600];
    tap.process(0, &mut out);
    assert!(
        out[0] == 0.0 && (out[12] - 0.5).abs() < 1e-6 && (out[100] - 1.0).abs() < 1e-6 && out[480] == 0.0
    );
    assert!(out.windows(2).all(|w| (w[1] - w[0]).abs() < 0.05));
}

#[test]
fn whatever_comes_is_finite_and_what_cannot_be_is_refused() {
    let mut tap =
        tap(&[sinusoid(100.0, 1e5, 1e5)], TapSettings { max_speed_mm_s: 1e4, ..TapSettings::default() });
    for (n, part) in [f64::NAN, f64::INFINITY, -3.0, 1.0, 7.0, 0.5].into_iter().enumerate() {
        tap.strike(0, 1000 * n as u64, part, f64::MAX);
        let mut out = [0.0f32; 1000];
        tap.process(1000 * n as u64, &mut out);
        assert!(out.iter().all(|x| x.is_finite()) && out.iter().any(|x| *x != 0.0));
    }
    assert!(tap.strike(0, u64::MAX - 3, 0.5, 100.0));
    tap.process(u64::MAX - 100, &mut [0.0f32; 200]);
    tap.process(0, &mut [0.0f32; 200]);

    let new = |t: &Transient| Sound::new(t, TapSettings::default(), RATE).unwrap_err().to_string();
    assert!(new(&Transient::Sinusoids(vec![])).contains("0 sinusoids"));
    assert!(new(&Transient::Sinusoids(vec![sinusoid(50.0, 1.0, 1.0); 9])).contains("from 1 to 8"));
    assert!(new(&Transient::Sinusoids(vec![sinusoid(21_601.0, 1.0, 1.0)])).contains("out of range"));
    assert!(
        new(&Transient::Sinusoids(vec![sinusoid(50.0, 1.0, f64::NAN)])).contains("number 1 of the sinusoids")
    );
    let with = |change: fn(&mut Recording)| {
        let mut r = recording(0.0);
        change(&mut r);
        new(&Transient::Recorded(r))
    };
    assert!(with(|r| r.samples.truncate(1)).contains("1 samples"));
    assert!(with(|r| r.samples[4] = f32::NAN).contains("number 5"));
    with(|r| r.rate_hz = 0.0);
    // 300 m/s^2 fall to 1e-3 in 12.6 times 10 s.
    let long = Transient::Sinusoids(vec![sinusoid(250.0, 1e4, 300.0)]);
    assert_eq!(Sound::new(&long, TapSettings::default(), RATE).unwrap().longest(), 60 * u64::from(RATE));
}
