//! For any input: no law gives energy, none trembles at rest, and all end with the normal force.

use asperity_state::State;
use proptest::prelude::*;

use super::*;
use crate::effects::bounds::EffectError;

/// A law with a bristle, as these tests see it.
trait Law {
    fn step(&mut self, velocity: [f64; 2], normal: f64, dt: f64) -> [f64; 2];
    fn stored_mj(&self) -> f64;
    fn state(&mut self, state: &mut State<'_>);
    fn reset(&mut self);
    fn turn(&mut self, from: &[[f64; 3]; 2], to: &[[f64; 3]; 2]);
}

macro_rules! laws {
    ($($t:ty),*) => {$(
        impl Law for $t {
            fn step(&mut self, velocity: [f64; 2], normal: f64, dt: f64) -> [f64; 2] {
                <$t>::step(self, velocity, normal, dt)
            }
            fn stored_mj(&self) -> f64 {
                <$t>::stored_mj(self)
            }
            fn state(&mut self, state: &mut State<'_>) {
                <$t>::state(self, state);
            }
            fn reset(&mut self) {
                <$t>::reset(self);
            }
            fn turn(&mut self, from: &[[f64; 3]; 2], to: &[[f64; 3]; 2]) {
                <$t>::turn(self, from, to);
            }
        }
    )*};
}
laws!(Dahl, LuGre);

fn settings() -> impl Strategy<Value = LuGreSettings> {
    (0.0..2.0f64, 0.0..3.0f64, 0.01..200.0f64, -3.0..3.0f64, -2.0..3.0f64, 0.0..0.01f64).prop_map(
        |(kinetic, more, stribeck, stiffness, damping, viscosity)| LuGreSettings {
            static_coefficient: kinetic + more,
            kinetic_coefficient: kinetic,
            stribeck_speed_mm_s: stribeck,
            bristle_stiffness_n_per_mm: 10.0_f64.powf(stiffness),
            bristle_damping_ns_per_m: 10.0_f64.powf(damping),
            viscosity_s_per_mm: viscosity,
        },
    )
}

/// Ticks of any length, of any velocity from creeping to fast, under any normal force.
fn ticks() -> impl Strategy<Value = Vec<([f64; 2], f64, f64)>> {
    let velocity = (-3.0..3.0f64, 0.0..std::f64::consts::TAU);
    let normal = prop_oneof![Just(0.0), 0.0..4.0f64, 0.9..1.1f64];
    let one = (velocity, normal, -5.0..0.0f64).prop_map(|((size, angle), normal, dt)| {
        let speed = 10.0_f64.powf(size);
        ([speed * angle.cos(), speed * angle.sin()], normal, 10.0_f64.powf(dt))
    });
    proptest::collection::vec(one, 1..80)
}

/// Smallest energy of a tick: the energy that the law took, less the increase of the energy that its bristle
/// stores \[mJ\]. Second, the sum of the absolute energies that it took and gave. In every tick for which
/// there are angles, the surface turns to other tangents.
fn taken(law: &mut impl Law, ticks: &[([f64; 2], f64, f64)], turns: &[[f64; 3]]) -> (f64, f64) {
    let (mut least, mut sizes, mut stored) = (f64::INFINITY, 0.0, law.stored_mj());
    let mut before = tangents([0.0; 3]);
    for (tick, (velocity, normal, dt)) in ticks.iter().enumerate() {
        if let Some(angles) = turns.get(tick) {
            let now = tangents(*angles);
            law.turn(&before, &now);
            before = now;
        }
        let force = law.step(*velocity, *normal, *dt);
        let part = -(force[0] * velocity[0] + force[1] * velocity[1]) * dt;
        least = least.min(part - (law.stored_mj() - stored));
        (sizes, stored) = (sizes + part.abs(), law.stored_mj());
    }
    (least, sizes)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn dahl_gives_no_energy(
        coefficient in 0.0..3.0f64, stiffness in -3.0..3.0f64, ticks in ticks(),
    ) {
        let mut law = Dahl::new(coefficient, 10.0_f64.powf(stiffness)).unwrap();
        let (least, sizes) = taken(&mut law, &ticks, &[]);
        prop_assert!(least >= -1e-12 * sizes - 1e-15, "{least} of {sizes}");
    }

    #[test]
    fn lugre_gives_no_energy(settings in settings(), ticks in ticks()) {
        let mut law = LuGre::new(settings).unwrap();
        let (least, sizes) = taken(&mut law, &ticks, &[]);
        prop_assert!(least >= -1e-12 * sizes - 1e-15, "{least} of {sizes}");
    }

    #[test]
    fn viscous_friction_gives_no_energy_in_any_tick(
        coefficient in 0.0..3.0f64, viscosity in 0.0..0.1f64, ticks in ticks(),
    ) {
        let law = ViscousCoulomb::new(coefficient, viscosity).unwrap();
        for (velocity, normal, _) in ticks {
            let force = law.force_n(velocity, normal);
            prop_assert!(force[0] * velocity[0] + force[1] * velocity[1] <= 0.0);
            let most = coefficient.min(viscosity * velocity[0].hypot(velocity[1])) * normal;
            prop_assert!((force[0].hypot(force[1]) - most).abs() <= 1e-12 * most);
        }
    }

    #[test]
    fn rest_is_steady_and_no_normal_force_gives_no_force(
        settings in settings(), ticks in ticks(), normal in 0.0..3.0f64,
    ) {
        let mut lugre = LuGre::new(settings).unwrap();
        let mut dahl =
            Dahl::new(settings.kinetic_coefficient, settings.bristle_stiffness_n_per_mm).unwrap();
        rests(&mut lugre, &ticks, normal)?;
        rests(&mut dahl, &ticks, normal)?;
    }
}

fn rests(law: &mut impl Law, ticks: &[([f64; 2], f64, f64)], normal: f64) -> Result<(), TestCaseError> {
    for (velocity, normal, dt) in ticks {
        law.step(*velocity, *normal, *dt);
    }
    let held = law.step([0.0; 2], normal, 1e-3);
    for _ in 0..100 {
        prop_assert_eq!(law.step([0.0; 2], normal, 1e-3), held);
    }
    // A tremble of the normal force that does not go below what holds changes nothing.
    prop_assert_eq!(law.step([0.0; 2], 2.0 * normal, 1e-3), held);
    prop_assert_eq!(law.step([0.0; 2], normal, 1e-3), held);
    prop_assert_eq!(law.step([70.0, -1.0], 0.0, 1e-3).map(f64::abs), [0.0; 2]);
    prop_assert_eq!(law.step([0.0; 2], normal, 1e-3).map(f64::abs), [0.0; 2]);
    Ok(())
}

// A constant damping gives energy where Barabanov and Ortega say. The damping here falls with
// speed, and gives none.
#[test]
fn constant_damping_gives_energy_and_lugre_here_does_not() {
    let s = LuGreSettings {
        static_coefficient: 1.0,
        kinetic_coefficient: 0.2,
        stribeck_speed_mm_s: 1.0,
        bristle_stiffness_n_per_mm: 1.0,
        bristle_damping_ns_per_m: 30.0,
        viscosity_s_per_mm: 0.0,
    };
    // Bent slowly to the static limit, and then moved on fast, for so short that it stays bent.
    let mut ticks = Vec::new();
    for _ in 0..10 {
        ticks.extend(vec![([0.02, 0.0], 1.0, 1e-3); 500_000]);
        ticks.push(([5000.0, 0.0], 1.0, 1e-7));
    }
    let ours = taken(&mut LuGre::new(s).unwrap(), &ticks, &[]);
    let constant = |viscous: f64| {
        let (mut z, mut worst) = (0.0_f64, f64::INFINITY);
        for (velocity, normal, dt) in &ticks {
            let v = velocity[0];
            let g = normal * (0.2 + 0.8 * (-v * v).exp());
            let end = g / 1.0 * v.signum();
            let before = z;
            z = end + (z - end) * (-v.abs() * dt / g).exp();
            let force = z + 0.030 * (v - v.abs() * z / g) + viscous * v;
            worst = worst.min(force * v * dt - 0.5 * (z * z - before * before));
        }
        worst
    };
    // Enough is s1 (mu_s - mu_k) / mu_k = 120 N s/m.
    assert!(constant(0.0) < -0.1 && constant(0.118) < 0.0, "{} {}", constant(0.0), constant(0.118));
    assert!(constant(0.121) > -1e-12, "{}", constant(0.121));
    assert!(ours.0 >= -1e-12 * ours.1, "{ours:?}");
}

#[test]
fn steady_slip_has_the_stribeck_curve() {
    let s = LuGreSettings { viscosity_s_per_mm: 0.002, ..LuGreSettings::default() };
    for speed in [0.1, 3.0, 10.0, 25.0, 300.0] {
        for (angle, dt) in [(0.3_f64, 1e-4), (2.0, 1e-2)] {
            let mut law = LuGre::new(s).unwrap();
            let way = [speed * angle.cos(), speed * angle.sin()];
            let mut force = [0.0; 2];
            for _ in 0..(60.0 / speed / dt) as u32 + 1000 {
                force = law.step(way, 1.3, dt);
            }
            let want = 1.3 * (0.5 + 0.3 * (-(speed / 30.0_f64).powi(2)).exp() + 0.002 * speed);
            let along = -(force[0] * way[0] + force[1] * way[1]) / speed;
            let across = force[0] * way[1] - force[1] * way[0];
            assert!((along / want - 1.0).abs() < 1e-9 && across.abs() < 1e-9 * speed, "{speed}: {force:?}");
        }
    }
}

#[test]
fn the_laws_at_rest_are_what_a_small_push_meets() {
    let s = LuGreSettings { viscosity_s_per_mm: 0.001, ..LuGreSettings::default() };
    let (mut law, dt) = (LuGre::new(s).unwrap(), 1e-4);
    let stated = law.law(2.0);
    // One tick at 1e-3 mm/s from an unbent bristle: K x + B v.
    let force = -law.step([1e-3, 0.0], 2.0, dt)[0];
    let want = stated.stiffness_n_per_mm * 1e-3 * dt + 1e-3 * stated.damping_ns_per_m * 1e-3;
    assert!((force / want - 1.0).abs() < 1e-3, "{force} {want}");
    assert_eq!(law.law(0.0), asperity_node::Law::default());
    let mut dahl = Dahl::new(0.5, 2.0).unwrap();
    let force = -dahl.step([1e-3, 0.0], 2.0, dt)[0];
    assert!((force / (dahl.law().stiffness_n_per_mm * 1e-3 * dt) - 1.0).abs() < 1e-3);
}

fn goes_on(law: &mut impl Law, other: &mut impl Law) {
    law.step([30.0, -4.0], 1.0, 2e-3);
    let mut bytes = vec![0; State::measure(|s| law.state(s))];
    State::save(&mut bytes, |s| law.state(s)).unwrap();
    assert!(State::restore(&bytes, |s| other.state(s)));
    let (a, b) = (law.step([1.0, 2.0], 0.9, 1e-3), other.step([1.0, 2.0], 0.9, 1e-3));
    assert!(a == b && a[0] != 0.0, "{a:?} {b:?}");
    law.reset();
    assert_eq!(law.step([0.0; 2], 1.0, 1e-3).map(f64::abs), [0.0; 2]);
    // The first number of the state is the bristle's, behind its count.
    bytes[8..16].copy_from_slice(&f64::NAN.to_le_bytes());
    assert!(!State::restore(&bytes, |s| other.state(s)));
    assert_eq!(other.step([0.0; 2], 1.0, 1e-3).map(f64::abs), [0.0; 2]);
}

#[test]
fn a_law_goes_on_from_its_state_and_forgets_on_a_reset() {
    let dahl = Dahl::new(0.5, 2.0).unwrap();
    goes_on(&mut { dahl }, &mut { dahl });
    let lugre = LuGre::new(LuGreSettings::default()).unwrap();
    goes_on(&mut { lugre }, &mut { lugre });
}

#[test]
fn whatever_comes_is_finite_and_what_cannot_be_is_refused() {
    let wild =
        [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, -f64::MAX, 5e-324, 1e-200, 0.0, 3.0, -40.0];
    let mut lugre =
        LuGre::new(LuGreSettings { kinetic_coefficient: 0.0, ..LuGreSettings::default() }).unwrap();
    let mut dahl = Dahl::new(10.0, 1e-3).unwrap();
    let viscous = ViscousCoulomb::new(1.0, 0.004).unwrap();
    for x in wild {
        for y in wild {
            for normal in wild {
                for dt in wild {
                    let forces = [
                        lugre.step([x, y], normal, dt),
                        dahl.step([x, y], normal, dt),
                        viscous.force_n([x, y], normal),
                    ];
                    assert!(
                        forces.iter().flatten().all(|f| f.is_finite()),
                        "{x} {y} {normal} {dt}: {forces:?}"
                    );
                }
            }
        }
    }
    let error = |change: fn(&mut LuGreSettings)| -> EffectError {
        let mut s = LuGreSettings::default();
        change(&mut s);
        LuGre::new(s).unwrap_err()
    };
    assert!(error(|s| s.static_coefficient = 0.4).to_string().contains("from 0.5 to 10"));
    assert!(error(|s| s.kinetic_coefficient = f64::NAN).to_string().contains("kinetic"));
    error(|s| s.stribeck_speed_mm_s = 0.0);
    error(|s| s.bristle_stiffness_n_per_mm = 0.0);
    error(|s| s.bristle_damping_ns_per_m = f64::INFINITY);
    error(|s| s.viscosity_s_per_mm = -1.0);
    assert!(Dahl::new(f64::NAN, 1.0).is_err() && Dahl::new(0.5, 0.0).is_err());
}

/// Two directions of length 1 at right angles, from three angles.
fn tangents([a, b, c]: [f64; 3]) -> [[f64; 3]; 2] {
    // Turned about z by a, about x by b, about z by c.
    let about = |t: [f64; 3]| {
        let [x, y, z] = t;
        let (x, y) = (x * a.cos() - y * a.sin(), x * a.sin() + y * a.cos());
        let (y, z) = (y * b.cos() - z * b.sin(), y * b.sin() + z * b.cos());
        [x * c.cos() - y * c.sin(), x * c.sin() + y * c.cos(), z]
    };
    [about([1.0, 0.0, 0.0]), about([0.0, 1.0, 0.0])]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn where_the_surface_turns_no_energy_is_given_either(
        settings in settings(), ticks in ticks(),
        ways in proptest::collection::vec([-4.0..4.0f64, -4.0..4.0f64, -4.0..4.0f64], 80),
    ) {
        let mut dahl = Dahl::new(settings.kinetic_coefficient, settings.bristle_stiffness_n_per_mm).unwrap();
        let (least, sizes) = taken(&mut dahl, &ticks, &ways);
        prop_assert!(least >= -1e-9 * (1.0 + sizes), "{least} of {sizes}");
        let mut lugre = LuGre::new(settings).unwrap();
        let (least, sizes) = taken(&mut lugre, &ticks, &ways);
        prop_assert!(least >= -1e-9 * (1.0 + sizes), "{least} of {sizes}");
    }

    #[test]
    fn a_bristle_stays_as_it_stands_in_space(
        bend in [-1.0..1.0f64, -1.0..1.0], angle in -4.0..4.0f64, way in [-4.0..4.0f64, -4.0..4.0, -4.0..4.0],
    ) {
        let mut law = Dahl::new(1.0, 1.0).unwrap();
        // Slowly bent, far from giving way: the force is that of a spring.
        law.step(bend, 1e6, 1e-3);
        let from = tangents(way);
        let force = |law: &mut Dahl, t: [[f64; 3]; 2]| -> [f64; 3] {
            let [u, v] = law.step([0.0; 2], 1e6, 1e-3);
            std::array::from_fn(|k| u * t[0][k] + v * t[1][k])
        };
        let before = force(&mut law, from);
        // Other directions along the same plane.
        let to = [
            std::array::from_fn(|k| from[0][k] * angle.cos() + from[1][k] * angle.sin()),
            std::array::from_fn(|k| from[1][k] * angle.cos() - from[0][k] * angle.sin()),
        ];
        law.turn(&from, &to);
        let after = force(&mut law, to);
        for k in 0..3 {
            prop_assert!((after[k] - before[k]).abs() < 1e-15, "{before:?} -> {after:?}");
        }
    }
}
