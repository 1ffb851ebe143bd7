//! The limits on a device's samples, whichever limiters made them.

use asperity_node::{Coil, Guard};

use super::*;

/// Extreme input: 100 A along the mover's motion, squares, noise and DC.
struct Hostile {
    seed: u32,
    n: u64,
}

impl Hostile {
    fn new() -> Self {
        Self { seed: 1, n: 0 }
    }

    fn next(&mut self, speed: f64) -> f32 {
        self.seed = self.seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(self.seed) / f64::from(u32::MAX) * 2.0 - 1.0;
        let at = self.n as f64 / RATE;
        self.n += 1;
        let x = match (at / 0.3) as u64 % 5 {
            0 => 1.0f64.copysign(speed),
            1 => (TAU * 65.0 * at).sin(),
            2 => (TAU * 900.0 * at).sin().signum(),
            3 => noise,
            _ => 1.0,
        };
        (100.0 * x) as f32
    }
}

/// Judges what `device` makes of hostile samples, by their number.
fn judged(drive: Drive, samples: usize, mut device: impl FnMut(usize, f32) -> f32) -> Judge {
    let mut judge = Judge::new(limiter(drive).limits(), hapcoil(100.0), drive, RATE);
    let mut hostile = Hostile::new();
    for n in 0..samples {
        let x = hostile.next(judge.coil.relative_speed());
        judge.see(device(n, x)).unwrap();
    }
    judge
}

#[test]
fn guard_leaves_samples_of_a_limiter_to_the_bit() {
    for drive in [Drive::Current, Drive::Voltage] {
        let mut limiter = limiter(drive);
        // Full scale is 0.75 A or V, as on a card: no power of two.
        let unit = 0.75 * limiter.limits().peak;
        let mut guard = limiter.guard();
        judged(drive, 960_000, |n, x| {
            let mut y = [0.0];
            limiter.set_muted(n / 20_000 % 5 == 4);
            limiter.process(&[x], &mut y);
            let sample = (f64::from(y[0]) / unit) as f32;
            let mut held = [sample];
            guard.hold(&mut held, 1, unit);
            assert_eq!(held[0].to_bits(), sample.to_bits(), "{drive:?} sample {n}: {sample} to {}", held[0]);
            y[0]
        });
        assert!(limiter.report().rms > 0 && limiter.report().stroke > 0);
        let (coil, report) = (guard.coil(), limiter.report());
        assert!((coil.heat.sqrt() / report.rms_current - 1.0).abs() < 1e-4, "{coil:?}");
    }
}

#[test]
fn guard_holds_new_limiters_on_a_warm_coil() {
    for (every, drive) in [(0.05, Drive::Current), (0.3, Drive::Current), (0.3, Drive::Voltage)] {
        let (mut it, every) = (limiter(drive), (every * RATE) as usize);
        let mut guard = it.guard();
        let mut alone = Judge::new(it.limits(), hapcoil(100.0), drive, RATE);
        let judge = judged(drive, 480_000, |n, x| {
            if n % every == 0 {
                it = limiter(drive);
            }
            let mut y = [0.0];
            it.process(&[x], &mut y);
            let _ = alone.see(y[0]);
            guard.hold(&mut y, 1, 1.0);
            y[0]
        });
        judge.verdict(0.01, 5.0).unwrap();
        // Limiters alone exceed the rating or the stroke.
        assert!(alone.verdict(0.01, 5.0).is_err(), "{} {}", alone.worst_rms, alone.worst_stroke);
        assert!(judge.worst_rms > 0.9, "too careful: {}", judge.worst_rms);
    }
}

#[test]
fn guard_holds_whatever_a_device_is_given() {
    for drive in [Drive::Current, Drive::Voltage] {
        let mut guard = limiter(drive).guard();
        let judge = judged(drive, 960_000, |n, x| {
            let gate = if n / 370 % 2 == 0 { 1.0 } else { 0.0 };
            let mut y = [if n % 9973 == 0 { f32::NAN } else { x * gate }];
            guard.hold(&mut y, 1, 1.0);
            y[0]
        });
        judge.verdict(0.01, 5.0).unwrap();
        let (rms, stroke) = (judge.worst_rms, judge.worst_stroke);
        assert!(rms > 0.8 && stroke > 0.2, "{rms} {stroke}");
    }
}

#[test]
fn guard_of_another_profile_goes_on_from_the_coil() {
    let weaker = Dynamics { rated_current: 0.1, stroke: 2e-3, ..hapcoil(100.0) };
    let settings = LimiterSettings::default();
    let other = Limiter::new(&weaker, Drive::Current, RATE, settings).unwrap();
    let (mut first, mut second) = (limiter(Drive::Current).guard(), other.guard());
    let mut judge = Judge::new(other.limits(), weaker, Drive::Current, RATE);
    let mut hostile = Hostile::new();
    let mut warm = 0.0;
    for n in 0..480_000 {
        let mut y = [hostile.next(judge.coil.relative_speed())];
        // The guards alternate every half second.
        if n % 24_000 == 0 {
            let (from, to): (&ChannelGuard, &mut ChannelGuard) =
                if n / 24_000 % 2 == 0 { (&second, &mut first) } else { (&first, &mut second) };
            to.go_on(&from.coil());
        }
        let guard = if n / 24_000 % 2 == 0 { &mut first } else { &mut second };
        guard.hold(&mut y, 1, 1.0);
        let _ = judge.see(y[0]);
        if n % 48_000 > 24_000 {
            // 0.1 A are rated: a coil warmed by the first guard gets nothing.
            let heat = guard.coil().heat;
            warm = f64::max(warm, heat);
            assert!(heat < 0.01 || y[0].abs() < 0.1, "{heat} {}", y[0]);
        }
    }
    assert!(warm > 0.015, "the coil was never warm: {warm}");
}

#[test]
fn guard_that_rests_cools_and_lies_still() {
    let mut guard = limiter(Drive::Current).guard();
    guard.go_on(&Coil { heat: 0.02, place: 1e-3, speed: 0.1, ..Coil::default() });
    guard.rest(2.0);
    let coil = guard.coil();
    assert!((coil.heat - 0.02 * (-1.0f64).exp()).abs() < 1e-12, "{coil:?}");
    assert_eq!((coil.place, coil.speed), (0.0, 0.0));
}

#[test]
fn guard_of_a_weak_profile_forgets_no_heat() {
    let weak = Dynamics { rated_current: 0.005, peak_current: 0.01, ..hapcoil(100.0) };
    let weak = Limiter::new(&weak, Drive::Current, RATE, LimiterSettings::default()).unwrap();
    let (mut first, mut between) = (limiter(Drive::Current).guard(), weak.guard());
    first.go_on(&Coil { heat: 0.0218, ..Coil::default() });
    between.go_on(&first.coil());
    between.hold(&mut [0.0; 480], 1, 1.0);
    first.go_on(&between.coil());
    let cooled = 0.0218 * (-0.01f64 / 2.0).exp();
    assert!((first.coil().heat / cooled - 1.0).abs() < 1e-3, "{:?}", first.coil());
}
