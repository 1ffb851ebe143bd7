//! The law on its own, and a simulated device in its loop.

use super::*;
use asperity_node::random::uniform;

const MS: u64 = 1_000_000;

fn floor(stiffness: f64, damping: f64) -> ForceModel {
    ForceModel {
        normal: [0.0, 0.0, 1.0],
        stiffness_n_per_mm: stiffness,
        damping_ns_per_m: damping,
        max_force_n: 100.0,
        valid: true,
        ..ForceModel::default()
    }
}

/// A servo that is called every millisecond.
struct Bench {
    servo: Servo,
    now: u64,
}

impl Bench {
    fn new(force_n: f64) -> Self {
        Self { servo: Servo::new(force_n), now: MS }
    }

    /// One that has held the hand at `z` long enough for all ramps to be over.
    fn held(force_n: f64, stiffness: f64, z: f64) -> Self {
        let mut bench = Self::new(force_n);
        for _ in 0..1200 {
            bench.step(z, floor(stiffness, 0.0));
        }
        bench
    }

    /// The force with the hand at `z`, and a model of this moment.
    fn step(&mut self, z: f64, model: ForceModel) -> [f64; 3] {
        self.step_at([0.0, 0.0, z], ForceModel { time_ns: self.now + MS, ..model })
    }

    fn step_at(&mut self, position: [f64; 3], model: ForceModel) -> [f64; 3] {
        self.now += MS;
        self.servo.step(self.now, position, &model)
    }
}

#[test]
fn force_at_rest_is_stiffness_times_depth() {
    let servo = Bench::held(10.0, 0.5, -3.0).servo;
    assert!((servo.force[2] - 1.5).abs() < 1e-9 && servo.force[0] == 0.0, "{:?}", servo.force);
    assert!((servo.normal_force() - 1.5).abs() < 1e-9);
    assert_eq!(Bench::held(10.0, 0.5, 0.01).servo.force, [0.0; 3]);
    // Clamped by the device.
    assert!((Bench::held(1.0, 0.5, -30.0).servo.force[2] - 1.0).abs() < 1e-9);
}

#[test]
fn force_beside_the_plane_is_smooth_and_may_pull() {
    let mut bench = Bench::held(10.0, 0.5, -3.0);
    // Friction along x, and a magnet that pulls into the plane.
    let model = ForceModel { beside_n: [0.8, 0.0, -2.5], ..floor(0.5, 0.0) };
    for ms in 0..50 {
        let force = bench.step(-3.0, model);
        // Of a first-order lag with 3 ms.
        let part = 1.0 - (-f64::from(ms + 1) / 3.0).exp();
        let want = [0.8 * part, 0.0, 1.5 - 2.5 * part];
        assert!((0..3).all(|i| (force[i] - want[i]).abs() < 1e-9), "{ms}: {force:?} for {want:?}");
    }
    assert!((bench.servo.force()[2] + 1.0).abs() < 1e-6, "it pulls: {:?}", bench.servo.force());
    // Held to the greatest force as a whole.
    let force = bench.step(-3.0, ForceModel { max_force_n: 0.5, ..model });
    assert!(size(force) <= 0.5 + 1e-12, "{force:?}");
    for _ in 0..25 {
        bench.step(f64::NAN, ForceModel::default());
    }
    assert_eq!(bench.servo.force(), [0.0; 3]);
}

#[test]
fn damper_resists_descent_and_never_pulls_back() {
    // 20 mm/s into the plane from 10 mm above, 2 N s/m: 0.04 N beside the spring.
    for (speed, expect) in [(-20.0, 0.04), (20.0, -0.04)] {
        let (mut bench, mut z) = (Bench::new(10.0), -speed);
        for _ in 0..1500 {
            z += speed * 1e-3;
            assert!(bench.step(z, floor(0.5, 2.0))[2] >= 0.0);
        }
        let (force, expect) = (bench.servo.force[2], (-0.5 * z + expect).max(0.0));
        assert!((force - expect).abs() < 1e-6, "{speed}: {force} for {expect}");
    }
}

#[test]
fn force_starts_over_half_a_second() {
    let mut bench = Bench::new(10.0);
    let at: Vec<f64> = (0..=700).map(|_| bench.step(-2.0, floor(1.0, 0.0))[2]).collect();
    let (half, full) = (at[250], at[700]);
    assert!(at[0] == 0.0 && (half - 1.0).abs() < 0.02 && (full - 2.0).abs() < 1e-6, "{half} {full}");
    let steepest = at.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
    assert!(steepest < 0.01, "{steepest} N in a millisecond");
}

#[test]
fn untrusted_model_releases_force_within_20_ms() {
    type Spoil = fn(&mut ForceModel);
    let spoil: [(&str, Spoil); 6] = [
        ("invalid", |m| m.valid = false),
        ("old", |m| m.time_ns -= 101 * MS),
        ("stiffness not a number", |m| m.stiffness_n_per_mm = f64::NAN),
        ("point infinite", |m| m.point[1] = f64::INFINITY),
        ("normal not a number", |m| m.normal[2] = f64::NAN),
        ("negative stiffness", |m| m.stiffness_n_per_mm = -1.0),
    ];
    for (what, spoil) in spoil {
        let mut bench = Bench::held(10.0, 1.0, -5.0);
        for k in 1..=21 {
            let mut model = ForceModel { time_ns: bench.now + MS, ..floor(1.0, 0.0) };
            spoil(&mut model);
            let f = bench.step_at([0.0, 0.0, -5.0], model)[2];
            let most = 5.0 * (1.0 - f64::from(k) / 20.0).max(0.0) + 1e-9;
            assert!(f.is_finite() && f <= most, "{what}: {f} after {k} ms");
        }
        assert_eq!(bench.servo.force, [0.0; 3], "{what}");
        assert!(bench.step(-5.0, floor(1.0, 0.0))[2] < 0.02, "{what}: comes back at once");
    }
    // A model of 100 ms is still good.
    let mut bench = Bench::held(10.0, 1.0, -5.0);
    let (old, time_ns) = (bench.servo.force, bench.now - 99 * MS);
    assert_eq!(bench.step_at([0.0, 0.0, -5.0], ForceModel { time_ns, ..floor(1.0, 0.0) }), old);
}

#[test]
fn invalid_position_or_stall_releases_force() {
    let mut bench = Bench::held(10.0, 1.0, -5.0);
    for _ in 0..21 {
        let model = ForceModel { time_ns: bench.now + MS, ..floor(1.0, 0.0) };
        assert!(bench.step_at([0.0, f64::NAN, -5.0], model).iter().all(|x| x.is_finite()));
    }
    assert_eq!(bench.servo.force, [0.0; 3]);
    let mut bench = Bench::held(10.0, 1.0, -5.0);
    bench.now += 59 * MS;
    assert_eq!(bench.step(-5.0, floor(1.0, 0.0)), [0.0; 3]);
}

#[test]
fn plane_appears_and_vanishes_without_a_step() {
    let most = 4.0;
    let mut bench = Bench::held(most, 1.0, 5.0);
    assert_eq!(bench.servo.force, [0.0; 3]);
    let (mut before, mut took) = (0.0, 0);
    // It appears with 10 mm over the hand: the law says 4 N at once.
    for k in 0..200 {
        let f = bench.step(5.0, ForceModel { point: [0.0, 0.0, 15.0], ..floor(1.0, 0.0) })[2];
        assert!(f - before <= most / 50.0 + 1e-9, "{} N in a millisecond", f - before);
        (before, took) = (f, if f < 0.95 * most { k } else { took });
    }
    assert!((before - most).abs() < 1e-3 && (40..120).contains(&took), "{before} after {took}");
    // It goes: nothing left after 20 ms, and no step.
    for _ in 0..20 {
        let f = bench.step(5.0, ForceModel { normal: [0.0; 3], ..floor(1.0, 0.0) })[2];
        assert!((0.0..=before).contains(&f) && before - f <= 1.2, "{before} to {f}");
        before = f;
    }
    assert!(before < 0.02, "{before}");
}

#[test]
fn unchanged_wall_answers_in_the_same_step() {
    let mut bench = Bench::held(10.0, 1.0, -1.0);
    for z in [-1.1, -1.3, -1.2, -1.6] {
        assert!((bench.step(z, floor(1.0, 0.0))[2] + z).abs() < 1e-9);
    }
    // A jump of 9 mm is met at the slew limit: 10 N in 4 ms.
    assert!((bench.step(-10.6, floor(1.0, 0.0))[2] - 4.1).abs() < 1e-6);
}

#[test]
fn force_stays_finite_bounded_and_never_pulls() {
    let mut count = 0;
    let mut random = || {
        count += 1;
        2.0 * uniform(7, count) - 1.0
    };
    let wild = [f64::NAN, f64::INFINITY, -1e300, 1e300, 0.0];
    let (mut servo, mut model, mut now) = (Servo::new(3.0), floor(1.0, 1.0), MS);
    for k in 0..200_000 {
        now += (random().abs() * 2e6) as u64;
        if random() > 0.95 {
            let n = [random(), random(), random()];
            let len = size(n);
            model = ForceModel { normal: n.map(|x| x / len), point: [random(), random(), random()], ..model };
            model.stiffness_n_per_mm = random().abs() * 50.0;
            model.max_force_n = random().abs() * 5.0;
            model.damping_ns_per_m = if random() > 0.9 { wild[k % 5] } else { random().abs() * 20.0 };
        }
        model.time_ns = now;
        let mut p = [random() * 3.0, random() * 3.0, random() * 3.0];
        if random() > 0.99 {
            p[k % 3] = wild[k % 5];
        }
        let f = servo.step(now, p, &model);
        assert!(f.iter().all(|x| x.is_finite()), "step {k}: {f:?}");
        assert!(size(f) <= 3.0 + 1e-9 && dot(f, servo.plane.normal) >= -1e-9, "step {k}: {f:?}");
    }
}

/// A mass with a damper, pushed into the wall by a constant force and driven by the servo's through a hold:
/// solved exactly between servo ticks. Answers the largest deviation from rest in the last half second, in
/// mm.
fn ring(mass_kg: f64, device_ns_per_m: f64, stiffness: f64, damping: f64) -> f64 {
    let (period, push) = (1e-3, 1.0);
    let rest = -push / stiffness;
    let decay = (-device_ns_per_m * period / mass_kg).exp();
    let mut bench = Bench { servo: Servo { slew_n_per_s: 1e12, ..Servo::new(1e6) }, now: MS };
    let model = ForceModel { max_force_n: 1e6, ..floor(stiffness, damping) };
    let (mut z, mut v, mut worst) = (rest, 0.0, 0.0f64);
    for k in 0..10_000 {
        let knock = if (1000..1010).contains(&k) { -0.5 } else { 0.0 };
        let f = bench.step(z, model)[2];
        // Held until the ramps are over. Then, in m, s, kg: m v' = f - push - b v.
        if k < 1000 {
            continue;
        }
        let end = (f - push + knock) / device_ns_per_m;
        let v0 = v;
        v = end + (v0 - end) * decay;
        z += 1e3 * (end * period + (v0 - end) * (1.0 - decay) * mass_kg / device_ns_per_m);
        if k >= 9500 {
            worst = worst.max((z - rest).abs());
        }
    }
    worst
}

/// Largest eigenvalue of the same loop without the damper, worked out apart: (x, v) through the hold with f
/// = -k x.
fn growth(mass_kg: f64, device: f64, stiffness: f64) -> f64 {
    let t = 1e-3;
    let e = (-device * t / mass_kg).exp();
    let g = (1.0 - e) * mass_kg / device;
    let k = stiffness * 1e3;
    let [[a, b], [c, d]] = [[1.0 - k * (t - g) / device, g], [-k * (1.0 - e) / device, e]];
    let (trace, det) = (a + d, a * d - b * c);
    let root = trace * trace / 4.0 - det;
    if root < 0.0 { det.sqrt() } else { (trace / 2.0).abs() + root.sqrt() }
}

#[test]
fn knock_decays_below_colgate_bound_and_rings_above() {
    for (mass, device) in [(0.1, 0.5), (0.05, 0.3), (0.3, 1.0)] {
        // Colgate's bound at 1 kHz, 2 b / T, in N/mm.
        let limit = 2.0 * device;
        let (below, above) = (0.6 * limit, 1.6 * limit);
        assert!(growth(mass, device, below) < 1.0 && growth(mass, device, above) > 1.0, "the check itself");
        let (quiet, loud) = (ring(mass, device, below, 0.0), ring(mass, device, above, 0.0));
        assert!(quiet < 1e-2, "{mass} kg, {below} N/mm: still {quiet} mm");
        assert!(loud > 0.1, "{mass} kg, {above} N/mm: only {loud} mm");
    }
}

#[test]
fn damped_wall_within_the_bound_comes_to_rest() {
    // K T / 2 + B is 0.9 N s/m, and the device has 1.
    for mass in [0.005, 0.02, 0.1, 0.5] {
        let left = ring(mass, 1.0, 1.0, 0.4);
        assert!(left < 2e-2, "{mass} kg: still {left} mm");
    }
    // Far beyond it a light device on a strong damper rings: the damper's own delay drives it.
    assert!(ring(0.005, 1.0, 1.0, 15.0) > 1e-2);
}
