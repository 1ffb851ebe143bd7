//! A limiter keeps its promises for any input and any actuator that it accepts.

use proptest::prelude::*;

use super::*;

#[derive(Clone, Debug)]
enum Piece {
    Silence,
    Noise(f64),
    Sine(f64, f64),
    Square(f64, f64),
    Step(f64),
    Pulses(f64),
    Constant(f32),
    Bits(u32),
    /// Drives along the motion of the judge's coil, which moves it most.
    Spite(f64),
    Mute(bool),
    Missing,
}

fn logarithmic(from: f64, to: f64) -> impl Strategy<Value = f64> {
    (from.ln()..to.ln()).prop_map(f64::exp)
}

fn piece() -> impl Strategy<Value = (Piece, usize)> {
    let level = (-3.0..3.0f64).prop_map(|d| 10f64.powf(d));
    let hz = (0.0..4.3f64).prop_map(|d| 10f64.powf(d));
    let strange =
        prop::sample::select(vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, f32::MAX, 1e-40]);
    let what = prop_oneof![
        1 => Just(Piece::Silence),
        2 => level.clone().prop_map(Piece::Noise),
        3 => (level.clone(), hz.clone()).prop_map(|(a, f)| Piece::Sine(a, f)),
        2 => (level.clone(), hz).prop_map(|(a, f)| Piece::Square(a, f)),
        3 => (level.clone(), 40.0..120.0f64).prop_map(|(a, f)| Piece::Square(a, f)),
        1 => level.clone().prop_map(Piece::Step),
        1 => level.clone().prop_map(Piece::Pulses),
        1 => strange.prop_map(Piece::Constant),
        1 => any::<u32>().prop_map(Piece::Bits),
        2 => level.prop_map(Piece::Spite),
        1 => any::<bool>().prop_map(Piece::Mute),
        1 => Just(Piece::Missing),
    ];
    (what, 1usize..6000)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 192, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_input_breaks_any_promise(
        pieces in prop::collection::vec(piece(), 1..14),
        voltage in any::<bool>(),
        rate in prop::sample::select(vec![8000.0, 44_100.0, 48_000.0, 96_000.0]),
        grams in 5.0..2000.0f64,
        k_f in logarithmic(0.3, 10.0),
        stiffness in logarithmic(100.0, 10_000.0),
        zeta in logarithmic(0.002, 2.0),
        stroke_mm in logarithmic(0.1, 10.0),
        microhenry in logarithmic(30.0, 5000.0),
        slew_hz in logarithmic(500.0, 20_000.0),
        dc_corner_hz in 0.5..20.0f64,
        tau in logarithmic(0.1, 10.0),
    ) {
        let mut d = hapcoil(grams);
        d.force_factor = k_f;
        d.stiffness = stiffness;
        d.inductance = microhenry * 1e-6;
        d.damping = 2.0 * zeta * d.reduced_mass() * d.natural_rad_s();
        d.stroke = stroke_mm * 1e-3;
        d.thermal_time_constant = tau;
        let drive = if voltage { Drive::Voltage } else { Drive::Current };
        let settings = LimiterSettings { slew_hz, dc_corner_hz, ..LimiterSettings::default() };
        // It must protect every actuator it accepts.
        let made = Limiter::new(&d, drive, rate, settings);
        let Ok(mut limiter) = made else { return Ok(()) };
        let peak = limiter.limits().peak;
        let mut judge = Judge::new(limiter.limits(), d, drive, rate);
        let (mut seed, mut n) = (1u32, 0u64);
        for (piece, length) in pieces {
            if let Piece::Mute(muted) = piece {
                limiter.set_muted(muted);
            }
            let mut left = length;
            while left > 0 {
                let block = left.min(1 + (seed >> 8) as usize % 200);
                left -= block;
                let input: Vec<f32> = (0..block).map(|_| {
                    seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    n += 1;
                    let phase = |hz: f64| (TAU * hz * n as f64 / rate).sin();
                    let random = f64::from(seed >> 8) / 8_388_608.0 - 1.0;
                    (peak * match piece {
                        Piece::Silence | Piece::Mute(_) | Piece::Missing => 0.0,
                        Piece::Noise(a) => a * random,
                        Piece::Sine(a, hz) => a * phase(hz),
                        Piece::Square(a, hz) => a.copysign(phase(hz)),
                        Piece::Step(a) => a,
                        Piece::Pulses(a) => if n % 700 < 35 { a } else { 0.0 },
                        Piece::Constant(x) => return x,
                        Piece::Bits(b) => return f32::from_bits(seed ^ b),
                        Piece::Spite(a) => a.copysign(judge.coil.relative_speed()),
                    }) as f32
                }).collect();
                let mut output = vec![f32::NAN; block];
                let there = if matches!(piece, Piece::Missing) { 0 } else { block };
                limiter.process(&input[..there], &mut output);
                for y in output {
                    judge.see(y).map_err(|e| TestCaseError::fail(format!("{e} in {piece:?}")))?;
                }
            }
        }
        judge.verdict(0.01, dc_corner_hz).map_err(TestCaseError::fail)?;
        prop_assert!(limiter.report().largest <= peak);
    }
}
