//! Movers that were once driven past their stroke.

use super::*;

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
