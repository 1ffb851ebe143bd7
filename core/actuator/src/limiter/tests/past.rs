//! Coils that once exceeded their rated current, and movers that were once driven past their stroke.

use super::*;

/// A coil under a voltage in SI units (moving and handle mass, stiffness, damping, force factor;
/// resistance, inductance, stroke; thermal time constant, rated and peak current, peak voltage), the
/// sample rate and the slew limit \[Hz\].
type Row = [f64; 14];

fn coil(row: Row) -> (Dynamics, f64, f64) {
    let [moving_mass, handle_mass, stiffness, damping, force_factor, resistance, inductance, stroke, ..] =
        row;
    let [.., thermal_time_constant, rated_current, peak_current, peak_voltage, rate, slew_hz] = row;
    let coil = Dynamics {
        moving_mass,
        handle_mass,
        stiffness,
        damping,
        force_factor,
        resistance,
        inductance,
        stroke,
        thermal_time_constant,
        rated_current,
        peak_current,
        peak_voltage,
    };
    (coil, rate, slew_hz)
}

/// Checks that coils stay within their limits, and that the limiter uses this part of the rated current.
/// Input in turns of 0.4 s: along the mover's motion, for most energy; squares of its resonance; squares of
/// 40 times that. With or without muting in every other turn.
fn held(rows: &[Row], mutes: bool, least: f64) {
    for &row in rows {
        let (d, rate, slew_hz) = coil(row);
        let settings = LimiterSettings { slew_hz, ..LimiterSettings::default() };
        let mut limiter = Limiter::new(&d, Drive::Voltage, rate, settings).unwrap();
        let mut judge = Judge::new(limiter.limits(), d, Drive::Voltage, rate);
        let turn = (0.4 * rate) as usize;
        for n in 0..16 * turn {
            let part = n / turn;
            limiter.set_muted(mutes && part % 2 == 1);
            let square = |times: f64| (TAU * times * d.natural_hz() * n as f64 / rate).sin();
            let along = match part / 2 % 3 {
                0 => judge.coil.relative_speed(),
                1 => square(1.0),
                _ => square(40.0),
            };
            let mut output = [0.0];
            limiter.process(&[(300.0_f64.copysign(along) * limiter.limits().peak) as f32], &mut output);
            judge.see(output[0]).unwrap();
        }
        let (rms, stroke) = (judge.worst_rms, judge.worst_stroke);
        assert!(rms <= 1.01 && stroke <= 1.0, "{rms} of the rated current, {stroke} of the stroke: {row:?}");
        assert!(rms > least, "too careful: {rms} of the rated current: {row:?}");
    }
}

const THAT_MOVE: [Row; 4] = [
    [
        0.0044, 0.4527, 1343.17, 0.04783, 2.5113, 4.5, 5.015e-5, 3.49e-3, 0.1022, 0.1478, 0.6, 4.5, 48_000.0,
        15_643.0,
    ],
    [
        0.3065, 0.01605, 69.741, 0.04962, 8.0218, 2.804, 3.083e-5, 13.77e-3, 0.2804, 3.4e-3, 19.37e-3, 23.04,
        96_000.0, 10_741.0,
    ],
    [
        0.004492, 0.7495, 4.7221, 0.06228, 0.5928, 0.4585, 1.038e-4, 1.622e-3, 0.1155, 2.013e-3, 5.995e-3,
        0.557, 48_000.0, 3703.0,
    ],
    [
        0.002468, 0.001682, 1.8417, 0.002351, 3.483, 64.43, 2.148e-3, 25.09e-3, 0.7694, 1.723e-3, 10.68e-3,
        47.25, 8000.0, 722.0,
    ],
];

const THAT_WARM_AT_ONCE: [Row; 4] = [
    [
        0.552, 0.004939, 7156.1, 0.4676, 0.1694, 0.2066, 4.132e-4, 0.233e-3, 0.1056, 2.26e-3, 13.2e-3, 13.02,
        96_000.0, 3829.0,
    ],
    [
        0.06301, 3.7888, 108_271.0, 20.289, 0.4531, 0.6733, 1.3466e-3, 16.48e-3, 0.1096, 10.64e-3, 66.71e-3,
        57.52, 44_100.0, 5939.0,
    ],
    [
        0.00142, 0.006412, 9332.9, 1.2355, 0.01939, 0.3277, 6.554e-4, 0.0659e-3, 0.107, 3.686e-3, 28.5e-3,
        73.43, 48_000.0, 1494.0,
    ],
    [
        0.008921, 0.004205, 5.1844, 0.0173, 0.01616, 0.196, 3.919e-4, 8.765e-3, 0.1098, 0.2935, 2.4784,
        6.735, 96_000.0, 10_724.0,
    ],
];

/// The wall once allowed a swing whose heat, after muting shorted the coil, came on top of a coil at
/// its limit.
#[test]
fn muting_a_moving_coil_stays_within_rated_current() {
    held(&THAT_MOVE, true, 0.3);
}

/// The heat wall once asked for more than a current can follow that lags its voltage by milliseconds,
/// on a coil that warms within a hundred.
#[test]
fn fast_warming_coil_stays_within_rated_current() {
    held(&THAT_WARM_AT_ONCE, false, 0.7);
}

/// Part of the stroke that a mover reaches under a constant input of so many peaks.
fn reached_by_a_step(d: Dynamics, drive: Drive, rate: f64, slew_hz: f64, peaks: f64, samples: usize) -> f64 {
    let settings = LimiterSettings { slew_hz, dc_corner_hz: 0.5, ..LimiterSettings::default() };
    let mut limiter = Limiter::new(&d, drive, rate, settings).unwrap();
    let mut judge = Judge::new(limiter.limits(), d, drive, rate);
    let step = vec![(peaks * limiter.limits().peak) as f32; samples];
    for y in run(&mut limiter, &step) {
        judge.see(y).unwrap();
    }
    judge.worst_stroke
}

/// The wall once took the damping at the foreseen speed, not at the actual one.
#[test]
fn step_keeps_a_damped_mover_within_its_stroke() {
    for (grams, k_f, stiffness, zeta, stroke_mm, rate, slew_hz) in [
        (1963.747, 5.7801, 836.33, 1.8134, 1.4942, 8000.0, 7890.07),
        (777.2, 2.548, 416.8, 1.7561, 1.064, 8000.0, 2901.0),
        (1658.9, 2.544, 5036.7, 1.7988, 0.103, 44_100.0, 2441.0),
    ] {
        for microhenry in [30.0, 1000.0, 5000.0] {
            let mut d = hapcoil(grams);
            (d.force_factor, d.stiffness, d.stroke) = (k_f, stiffness, stroke_mm * 1e-3);
            d.inductance = microhenry * 1e-6;
            d.damping = 2.0 * zeta * d.reduced_mass() * d.natural_rad_s();
            for (peaks, samples) in [(1.0, 400), (661.47, 40), (661.47, 4000)] {
                let worst = reached_by_a_step(d, Drive::Current, rate, slew_hz, peaks, samples);
                assert!(worst <= 1.0, "{worst} of {stroke_mm} mm, {microhenry} uH, {peaks} peaks");
                assert!(
                    samples == 40 || worst > 0.8,
                    "{worst} of {stroke_mm} mm, {microhenry} uH: too careful"
                );
            }
        }
    }
}

/// The wall once allowed any drive against a mover that came back very slowly, as it removes energy.
/// The mover then turned within the same sample.
#[test]
fn turning_a_mover_at_its_wall_keeps_the_stroke() {
    for (k_f, stiffness, stroke_mm) in [(10.0, 120.0, 4.0), (10.0, 200.0, 2.5), (9.0, 120.0, 3.0)] {
        for zeta in [0.02, 0.5, 1.4] {
            let mut d = hapcoil(100.0);
            (d.force_factor, d.stiffness, d.stroke) = (k_f, stiffness, stroke_mm * 1e-3);
            d.inductance = 45e-6;
            d.damping = 2.0 * zeta * d.reduced_mass() * d.natural_rad_s();
            let worst = reached_by_a_step(d, Drive::Voltage, 44_100.0, 12_000.0, 300.0, 10_000);
            assert!(worst <= 1.0, "{worst} of {stroke_mm} mm, {k_f} N/A, damping ratio {zeta}");
            assert!(worst > 0.9, "{worst} of {stroke_mm} mm, {k_f} N/A, damping ratio {zeta}: too careful");
        }
    }
}
