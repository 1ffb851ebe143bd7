//! The judge integrates the equations of both masses by Runge-Kutta, or uses the exact plant over
//! minutes. It never asks the limiter's own simulations.

use std::f64::consts::TAU;

use asperity_dsp::filter::Biquad;

use super::super::testing::{hapcoil, lock_in};
use super::*;

mod guard;
mod judge;
mod past;
mod promises;

use judge::Judge;

const RATE: f64 = 48_000.0;

fn limiter(drive: Drive) -> Limiter {
    Limiter::new(&hapcoil(100.0), drive, RATE, LimiterSettings::default()).unwrap()
}

fn sine(amplitude: f64, hz: f64, samples: usize) -> Vec<f32> {
    (0..samples).map(|n| (amplitude * (TAU * hz * n as f64 / RATE).sin()) as f32).collect()
}

fn run(limiter: &mut Limiter, input: &[f32]) -> Vec<f32> {
    let mut output = vec![7.0; input.len()];
    for (x, y) in input.chunks(96).zip(output.chunks_mut(96)) {
        limiter.process(x, y);
    }
    output
}

#[test]
fn two_minutes_at_resonance_stay_within_limits() {
    for drive in [Drive::Current, Drive::Voltage] {
        let d = hapcoil(100.0);
        let mut limiter = limiter(drive);
        let peak = limiter.limits().peak;
        let mut plant = Plant::new(&d, drive, RATE);
        let (mut heat, mut worst, mut hottest) = (0.0f64, 0.0f64, 0.0f64);
        let mut last = Vec::new();
        let second = sine(3.0 * peak, 65.0, 48_000);
        for _ in 0..120 {
            last = run(&mut limiter, &second);
            for y in &last {
                let m = plant.step(f64::from(*y));
                heat += (m.current.powi(2) - heat) / RATE / d.thermal_time_constant;
                worst = worst.max(m.displacement.abs());
                hottest = hottest.max(heat);
            }
        }
        let rms = hottest.sqrt() / d.rated_current;
        assert!(worst <= d.stroke && worst > 0.8 * d.stroke, "{drive:?} {worst}");
        assert!(rms <= 1.0 && rms > 0.9, "{drive:?} {rms}");
        // The output is still a sine: the gain acts, not the walls.
        let wave: Vec<f64> = last.iter().map(|y| f64::from(*y)).collect();
        let fundamental = lock_in(&wave, 65.0, RATE).norm_sqr() / 2.0;
        let total = wave.iter().map(|y| y * y).sum::<f64>() / wave.len() as f64;
        assert!((total / fundamental - 1.0).max(0.0).sqrt() < 0.03, "{drive:?} {total} {fundamental}");
        assert!(limiter.report().stroke > 0 && limiter.report().rms > 0);
    }
}

#[test]
fn quiet_signal_passes_with_dc_removal_only() {
    for drive in [Drive::Current, Drive::Voltage] {
        let mut limiter = limiter(drive);
        let peak = limiter.limits().peak;
        let x: Vec<f32> = (0..96_000)
            .map(|n| {
                let at = |hz: f64| (TAU * hz * f64::from(n) / RATE).sin();
                (peak * 0.12 * (at(40.0) * 0.3 + at(65.0) * 0.2 + at(217.0) + at(430.0) + at(999.0) * 0.5))
                    as f32
            })
            .collect();
        let y = run(&mut limiter, &x);
        // (1 - z^-1) / (1 - (1 - p) z^-1), p = 2 pi 5 / 48000.
        let pole = 1.0 - TAU * 5.0 / RATE;
        let mut removal = Biquad::new([1.0, -1.0, 0.0], [-pole, 0.0]).unwrap();
        let worst = x.iter().zip(&y).map(|(x, y)| (removal.step(f64::from(*x)) - f64::from(*y)).abs());
        let worst = worst.fold(0.0, f64::max) / peak;
        assert!(worst < 1e-6, "{drive:?} {worst:e}");
        let report = limiter.report();
        assert!(!report.acted(), "{report:?}");
        assert!(report.samples == 96_000 && report.least_gain == 1.0 && report.largest_reduction_db() == 0.0);
        let fall = 20.0 * removal.response(40.0, RATE).norm().log10();
        assert!((fall + 0.0645).abs() < 0.0001, "{fall}");
    }
}

#[test]
fn sine_above_the_rated_current_is_brought_to_it() {
    let rated = hapcoil(100.0).rated_current * 2f64.sqrt();
    let mut quiet = limiter(Drive::Current);
    for _ in 0..20 {
        run(&mut quiet, &sine(0.97 * rated, 250.0, 48_000));
    }
    assert!(!quiet.report().acted(), "{:?}", quiet.report());
    let mut loud = limiter(Drive::Current);
    let mut y = Vec::new();
    for _ in 0..20 {
        y = run(&mut loud, &sine(2.5 * rated, 250.0, 48_000));
    }
    let rms = (y.iter().map(|y| f64::from(*y).powi(2)).sum::<f64>() / y.len() as f64).sqrt();
    assert!((rms / hapcoil(100.0).rated_current - 0.98).abs() < 0.02, "{rms}");
    assert!(loud.report().largest_rms_current <= hapcoil(100.0).rated_current);
    // A cold coil passes the first tenth of a second.
    let mut cold = limiter(Drive::Current);
    run(&mut cold, &sine(2.5 * rated, 250.0, 4800));
    assert_eq!(cold.report().rms, 0);
}

#[test]
fn limiter_recovers_to_the_same_samples() {
    for bad in [f32::NAN, f32::INFINITY, 1e30, -3.0] {
        let (mut hurt, mut whole) = (limiter(Drive::Current), limiter(Drive::Current));
        let fine = sine(0.1, 130.0, 48_000);
        run(&mut whole, &fine);
        let mut spoiled = fine.clone();
        spoiled[10_000..20_000].fill(bad);
        let through = run(&mut hurt, &spoiled);
        assert!(through.iter().all(|y| y.is_finite()));
        assert!(hurt.report().acted());
        let mut worst = 0.0f32;
        for second in 0..5 {
            let (a, b) = (run(&mut hurt, &fine), run(&mut whole, &fine));
            if second == 4 {
                worst = a.iter().zip(&b).fold(0.0, |w, (a, b)| w.max((a - b).abs()));
            }
        }
        assert!(worst < 1e-6, "{bad} {worst:e}");
        let report = hurt.report();
        assert_eq!(report.not_finite, if bad.is_finite() { 0 } else { 10_000 });
        assert_eq!(report.peak > 0, bad.is_finite());
    }
}

#[test]
fn dc_is_removed_from_constant_and_asymmetric_input() {
    let mut constant = limiter(Drive::Current);
    let y = run(&mut constant, &vec![0.2; 96_000]);
    assert!(y[95_999].abs() < 1e-6 && (constant.report().dc - 0.2).abs() < 1e-6);
    // Pulses far over the peak: clipping makes no mean.
    let mut pulses = limiter(Drive::Voltage);
    let x: Vec<f32> = (0..480_000).map(|n| if n % 480 < 24 { 40.0 } else { 0.0 }).collect();
    let y = run(&mut pulses, &x);
    let mean = y[240_000..].iter().map(|y| f64::from(*y)).sum::<f64>() / 240_000.0;
    assert!(mean.abs() < 2e-3, "{mean}");
}

#[test]
fn muting_is_silent_within_20_ms_and_returns_smoothly() {
    for drive in [Drive::Current, Drive::Voltage] {
        let mut limiter = limiter(drive);
        let x = sine(0.4 * limiter.limits().peak, 65.0, 48_000);
        run(&mut limiter, &x);
        limiter.set_muted(true);
        assert!(limiter.is_muted());
        let y = run(&mut limiter, &x);
        assert!(y[960..].iter().all(|y| *y == 0.0));
        assert!(y[..200].iter().any(|y| *y != 0.0), "a fade, not a cut");
        limiter.set_muted(false);
        let y = run(&mut limiter, &x);
        assert_eq!(y[0].abs().max(y[1].abs()), y[1].abs());
        assert!(y[40_000..].iter().any(|y| y.abs() > 0.1 * limiter.limits().peak as f32));
        let muted = limiter.report().muted;
        assert!((48_000 + 950..=48_000 + 960).contains(&muted), "{muted}");
    }
}

#[test]
fn blocks_of_any_length_give_the_same_samples() {
    let x: Vec<f32> = (0..5000)
        .map(|n| if n == 777 { f32::NAN } else { ((n as f32 * 0.013).sin() + (n as f32 * 0.21).cos()) * 0.9 })
        .collect();
    let (mut a, mut b) = (limiter(Drive::Current), limiter(Drive::Current));
    let whole = run(&mut a, &x);
    let mut parts = vec![0.0; x.len()];
    let (mut at, mut length) = (0, 0);
    while at < x.len() {
        let end = (at + length).min(x.len());
        b.process(&x[at..end], &mut parts[at..end]);
        at = end;
        length = (length * 7 + 1) % 131;
    }
    assert_eq!(whole, parts);
    assert_eq!(a.report(), b.report());
    b.process(&[], &mut []);
    assert_eq!(a.report(), b.report());
}

#[test]
fn rest_equals_silence_to_the_bit() {
    for drive in [Drive::Current, Drive::Voltage] {
        let mut long = limiter(drive);
        assert!(long.rests());
        // Loud, so that every stage has a state.
        run(&mut long, &sine(20.0, 80.0, 48_000));
        let mut seconds = 0;
        while !long.rests() {
            assert!(!long.rests() && seconds < 60, "it comes to rest");
            run(&mut long, &vec![0.0; 48_000]);
            seconds += 1;
        }
        assert!(long.report().rms_current > 0.0, "the coil is still warm");
        let mut short = long.clone();
        for _ in 0..100 {
            let silence = run(&mut long, &[0.0; 96]);
            assert!(silence.iter().all(|y| y.to_bits() == 0));
            assert!(short.rests());
            short.rest(96);
        }
        assert_eq!(long.report(), short.report());
        let again = sine(20.0, 81.0, 9600);
        assert!(run(&mut long, &again) == run(&mut short, &again));
        short.set_muted(true);
        assert!(!short.rests());
    }
}

#[test]
fn decayed_tail_is_zero_and_never_denormal() {
    let mut limiter = limiter(Drive::Voltage);
    run(&mut limiter, &sine(1.0, 100.0, 4800));
    for _ in 0..20 {
        let y = run(&mut limiter, &vec![0.0; 48_000]);
        assert!(y.iter().all(|y| *y == 0.0 || y.is_normal()));
    }
    assert_eq!(run(&mut limiter, &[0.0; 96]), [0.0; 96]);
}

#[test]
fn actuator_that_cannot_be_guarded_is_refused() {
    let strong = Dynamics { stroke: 2e-5, ..hapcoil(100.0) };
    let quick = Dynamics { force_factor: 15.0, stroke: 50e-3, peak_current: 0.1, ..hapcoil(100.0) };
    let make = |d: Dynamics, drive| Limiter::new(&d, drive, RATE, LimiterSettings::default());
    assert!(make(strong, Drive::Current).unwrap_err().message.contains("at its peak current"));
    assert!(make(quick, Drive::Voltage).unwrap_err().message.contains("back-EMF acts within"));
    for d in [10.0, 100.0, 1000.0].map(hapcoil) {
        let stronger = Dynamics { force_factor: 3.0 * d.force_factor, ..d };
        assert!(make(stronger, Drive::Current).is_ok() && make(stronger, Drive::Voltage).is_ok());
    }
}

#[test]
fn settings_that_do_not_fit_are_refused() {
    let good = LimiterSettings::default();
    for (rate, settings) in [
        (2000.0, good),
        (f64::NAN, good),
        (f64::INFINITY, good),
        (RATE, LimiterSettings { dc_corner_hz: 0.0, ..good }),
        (RATE, LimiterSettings { slew_hz: f64::INFINITY, ..good }),
        (RATE, LimiterSettings { release_s: f64::NAN, ..good }),
        (RATE, LimiterSettings { mute_s: 1.0, ..good }),
        (RATE, LimiterSettings { unmute_s: -1.0, ..good }),
    ] {
        let made = Limiter::new(&hapcoil(100.0), Drive::Current, rate, settings);
        assert!(made.is_err(), "{rate} {settings:?}");
    }
}

fn hand_over(from: &mut Limiter, to: &mut Limiter) -> bool {
    let mut bytes = vec![0; State::measure(|s| from.state(s))];
    State::save(&mut bytes, |s| from.state(s)).unwrap();
    State::restore(&bytes, |s| to.state(s))
}

/// A very loud resonant square with silences, handed every 50 ms to a new limiter.
#[test]
fn handed_on_coil_stays_within_limits() {
    for drive in [Drive::Current, Drive::Voltage] {
        let d = hapcoil(100.0);
        let mut guard = limiter(drive);
        let mut judge = Judge::new(guard.limits(), d, drive, RATE);
        for part in 0..120 {
            let corner = if part % 3 == 0 { 0.0 } else { 1e3 };
            let input: Vec<f32> = (part * 2400..part * 2400 + 2400)
                .map(|n| (corner * (TAU * 65.0 * f64::from(n) / RATE).sin().signum()) as f32)
                .collect();
            for y in run(&mut guard, &input) {
                judge.see(y).unwrap();
            }
            let settings = LimiterSettings {
                dc_corner_hz: if part % 2 == 0 { 5.0 } else { 1.0 },
                release_s: if part % 5 == 0 { 0.01 } else { 0.2 },
                ..LimiterSettings::default()
            };
            let mut next = Limiter::new(&d, drive, RATE, settings).unwrap();
            assert!(hand_over(&mut guard, &mut next));
            guard = next;
            guard.set_dc_corner(if part % 7 == 0 { 20.0 } else { 1.0 });
            guard.set_release(0.02);
        }
        judge.verdict(0.01, 1.0).unwrap();
        assert!(judge.worst_rms > 0.9, "the coil is to be driven to its limit: {}", judge.worst_rms);
    }
}

#[test]
fn handed_on_coil_stays_warm_and_new_peak_holds() {
    let mut old = limiter(Drive::Current);
    let loud = sine(100.0, 200.0, 240_000);
    let last = run(&mut old, &loud)[239_970];
    let warm = old.report().rms_current;
    assert!(warm > 0.14 && last.abs() > 0.1, "{warm} {last}");

    let weak = Dynamics { peak_current: 0.2, rated_current: 0.05, peak_voltage: 1.0, ..hapcoil(100.0) };
    let mut new = Limiter::new(&weak, Drive::Current, RATE, LimiterSettings::default()).unwrap();
    assert!(hand_over(&mut old, &mut new));
    assert_eq!(new.report().rms_current, warm);
    let out = run(&mut new, &loud);
    assert!(out.iter().all(|y| y.abs() <= new.limits().peak as f32));
    assert!(out[480..9600].iter().all(|y| *y == 0.0), "a coil this warm is to rest");

    let mut volts = limiter(Drive::Voltage);
    assert!(hand_over(&mut old, &mut volts));
    assert_eq!(volts.report().rms_current, warm);
    assert_eq!(run(&mut volts, &[0.0; 96]), [0.0; 96], "nothing of the signal in amperes is left");
}

#[test]
fn impossible_state_is_refused_and_changes_nothing() {
    let mut guard = limiter(Drive::Current);
    let input = sine(1.0, 65.0, 4800);
    run(&mut guard, &input);
    let mut same = guard.clone();
    let mut bytes = vec![0; State::measure(|s| guard.state(s))];
    let spoils: [fn(&mut Vec<u8>); 4] =
        [|b| b.truncate(60), |b| b[1..].fill(0xff), |b| b[9..17].fill(0x7f), |b| b.push(0)];
    for spoil in spoils {
        State::save(&mut bytes, |s| guard.state(s)).unwrap();
        let mut spoilt = bytes.clone();
        spoil(&mut spoilt);
        assert!(!State::restore(&spoilt, |s| guard.state(s)));
    }
    assert_eq!(run(&mut guard, &input), run(&mut same, &input));
}
