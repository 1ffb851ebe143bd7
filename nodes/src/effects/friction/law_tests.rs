//! For any input: no law gives energy, none trembles at rest, and all end with the normal force.

use proptest::prelude::*;

use super::*;

/// Energy in the bristle \[mJ\].
fn stored_mj(law: &Rubbing) -> f64 {
    let stiffness = match law.model {
        Model::ViscousCoulomb { .. } => 0.0,
        Model::Dahl { stiffness_n_per_mm, .. } => stiffness_n_per_mm,
        Model::LuGre(s) => s.bristle_stiffness_n_per_mm,
    };
    0.5 * stiffness * dot(law.bent_mm, law.bent_mm)
}

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
fn taken(mut law: Rubbing, ticks: &[([f64; 2], f64, f64)], turns: &[[f64; 3]]) -> (f64, f64) {
    let (mut least, mut sizes, mut stored) = (f64::INFINITY, 0.0, stored_mj(&law));
    let mut before = tangents([0.0; 3]);
    for (tick, (velocity, normal, dt)) in ticks.iter().enumerate() {
        if let Some(angles) = turns.get(tick) {
            let now = tangents(*angles);
            law.turn(&before, &now);
            before = now;
        }
        let force = law.step(*velocity, *normal, *dt);
        let part = -(force[0] * velocity[0] + force[1] * velocity[1]) * dt;
        least = least.min(part - (stored_mj(&law) - stored));
        (sizes, stored) = (sizes + part.abs(), stored_mj(&law));
    }
    (least, sizes)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    // Along one plane, and where the surface turns.
    #[test]
    fn bristles_give_no_energy(
        settings in settings(), ticks in ticks(),
        turns in proptest::collection::vec([-4.0..4.0f64, -4.0..4.0f64, -4.0..4.0f64], 80),
    ) {
        let dahl = Rubbing::dahl(settings.kinetic_coefficient, settings.bristle_stiffness_n_per_mm);
        for law in [dahl, Rubbing::lugre(settings)] {
            let (least, sizes) = taken(law, &ticks, &[]);
            prop_assert!(least >= -1e-12 * sizes - 1e-15, "{least} of {sizes}");
            let (least, sizes) = taken(law, &ticks, &turns);
            prop_assert!(least >= -1e-9 * (1.0 + sizes), "{least} of {sizes}");
        }
    }

    #[test]
    fn viscous_friction_gives_no_energy_in_any_tick(
        coefficient in 0.0..3.0f64, viscosity in 0.0..0.1f64, ticks in ticks(),
    ) {
        let mut law = Rubbing::viscous_coulomb(coefficient, viscosity);
        for (velocity, normal, _) in ticks {
            let force = law.step(velocity, normal, 0.0);
            prop_assert!(force[0] * velocity[0] + force[1] * velocity[1] <= 0.0);
            let most = coefficient.min(viscosity * velocity[0].hypot(velocity[1])) * normal;
            prop_assert!((force[0].hypot(force[1]) - most).abs() <= 1e-12 * most);
        }
    }

    #[test]
    fn rest_is_steady_and_no_normal_force_gives_no_force(
        settings in settings(), ticks in ticks(), normal in 0.0..3.0f64,
    ) {
        let mut lugre = Rubbing::lugre(settings);
        let mut dahl =
            Rubbing::dahl(settings.kinetic_coefficient, settings.bristle_stiffness_n_per_mm);
        rests(&mut lugre, &ticks, normal)?;
        rests(&mut dahl, &ticks, normal)?;
    }
}

fn rests(law: &mut Rubbing, ticks: &[([f64; 2], f64, f64)], normal: f64) -> Result<(), TestCaseError> {
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
    let ours = taken(Rubbing::lugre(s), &ticks, &[]);
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
            let mut law = Rubbing::lugre(s);
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
    let (mut law, dt) = (Rubbing::lugre(s), 1e-4);
    let stated = law.law(2.0);
    // One tick at 1e-3 mm/s from an unbent bristle: K x + B v.
    let force = -law.step([1e-3, 0.0], 2.0, dt)[0];
    let want = stated.stiffness_n_per_mm * 1e-3 * dt + 1e-3 * stated.damping_ns_per_m * 1e-3;
    assert!((force / want - 1.0).abs() < 1e-3, "{force} {want}");
    assert_eq!(law.law(0.0), asperity_node::Law::default());
    let mut dahl = Rubbing::dahl(0.5, 2.0);
    let force = -dahl.step([1e-3, 0.0], 2.0, dt)[0];
    assert!((force / (dahl.law(2.0).stiffness_n_per_mm * 1e-3 * dt) - 1.0).abs() < 1e-3);
}

#[test]
fn forces_are_finite_whatever_comes() {
    let wild =
        [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, -f64::MAX, 5e-324, 1e-200, 0.0, 3.0, -40.0];
    let mut lugre = Rubbing::lugre(LuGreSettings { kinetic_coefficient: 0.0, ..LuGreSettings::default() });
    let mut dahl = Rubbing::dahl(10.0, 1e-3);
    let mut viscous = Rubbing::viscous_coulomb(1.0, 0.004);
    for x in wild {
        for y in wild {
            for normal in wild {
                for dt in wild {
                    let forces = [
                        lugre.step([x, y], normal, dt),
                        dahl.step([x, y], normal, dt),
                        viscous.step([x, y], normal, dt),
                    ];
                    assert!(
                        forces.iter().flatten().all(|f| f.is_finite()),
                        "{x} {y} {normal} {dt}: {forces:?}"
                    );
                }
            }
        }
    }
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
    fn a_bristle_stays_as_it_stands_in_space(
        bend in [-1.0..1.0f64, -1.0..1.0], angle in -4.0..4.0f64, way in [-4.0..4.0f64, -4.0..4.0, -4.0..4.0],
    ) {
        let mut law = Rubbing::dahl(1.0, 1.0);
        // Slowly bent, far from giving way: the force is that of a spring.
        law.step(bend, 1e6, 1e-3);
        let from = tangents(way);
        let force = |law: &mut Rubbing, t: [[f64; 3]; 2]| -> [f64; 3] {
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

#[test]
fn force_along_a_line_follows_closed_form_at_any_tick() {
    // From rest F = F_c (1 - e^(-s0 x / F_c)); turning at F: F -> -F_c + (F_0 + F_c) e^(-s0 x / F_c).
    for (dt, speed) in [(1e-4, 7.0), (2e-3, 30.0), (1e-2, 3.0)] {
        let mut f = Rubbing::dahl(0.4, 2.0);
        let (most, mut x, mut force) = (0.4 * 1.5, 0.0, 0.0);
        while x < 0.5 {
            force = f.step([0.0, speed], 1.5, dt)[1];
            x += speed * dt;
            let want = -most * (1.0 - (-2.0 * x / most).exp());
            assert!((force - want).abs() < 1e-12, "{force}, not {want} after {x} mm");
        }
        let (turned, mut back) = (force, 0.0);
        while back < 0.5 {
            force = f.step([0.0, -speed], 1.5, dt)[1];
            back += speed * dt;
            let want = most + (turned - most) * (-2.0 * back / most).exp();
            assert!((force - want).abs() < 1e-12, "{force}, not {want} after {back} mm back");
        }
    }
}

#[test]
fn on_a_plane_it_follows_a_fine_integration_of_its_equation() {
    let mut f = Rubbing::dahl(0.5, 3.0);
    let (dt, mut z) = (1e-3, [0.0_f64; 2]);
    for k in 0..600 {
        let t = f64::from(k) * dt;
        // A velocity that turns round and never rests, a normal force that swells.
        let velocity = [40.0 * (9.0 * t).cos(), 25.0 * (14.0 * t).sin() + 5.0];
        let normal = 1.0 + 0.5 * (7.0 * t).sin();
        let force = f.step(velocity, normal, dt);
        let most = 0.5 * normal / 3.0;
        let size = z[0].hypot(z[1]);
        if size > most {
            z = z.map(|z| z * most / size);
        }
        for _ in 0..1000 {
            let speed = velocity[0].hypot(velocity[1]);
            // Heun's method, steps of a microsecond.
            let slope = |z: [f64; 2]| [0, 1].map(|i| velocity[i] - speed * z[i] / most);
            let first = slope(z);
            let second = slope([0, 1].map(|i| z[i] + 1e-6 * first[i]));
            z = [0, 1].map(|i| z[i] + 0.5e-6 * (first[i] + second[i]));
        }
        assert!((0..2).all(|i| (force[i] + 3.0 * z[i]).abs() < 1e-7), "{k}: {force:?} {z:?}");
    }
}

#[test]
fn falling_normal_force_releases_bristle_none_gives_zero() {
    let mut f = Rubbing::dahl(0.5, 1.0);
    for _ in 0..1000 {
        f.step([30.0, 40.0], 2.0, 1e-3);
    }
    let held = f.step([0.0; 2], 2.0, 1e-3);
    assert!((held[0] + 0.6).abs() < 1e-12 && (held[1] + 0.8).abs() < 1e-12, "{held:?}");
    let less = f.step([0.0; 2], 1.0, 1e-3);
    assert!((less[0] + 0.3).abs() < 1e-12 && (less[1] + 0.4).abs() < 1e-12, "{less:?}");
    // It does not come back.
    assert_eq!(f.step([0.0; 2], 2.0, 1e-3), less);
    assert_eq!(f.step([30.0, 40.0], 0.0, 1e-3).map(f64::abs), [0.0; 2]);
    assert_eq!((f.step([0.0; 2], 2.0, 1e-3).map(f64::abs), stored_mj(&f)), ([0.0; 2], 0.0));
}

#[test]
fn it_is_drag_in_proportion_to_the_normal_force_up_to_coulombs() {
    let mut f = Rubbing::viscous_coulomb(0.5, 0.004);
    // 2 N at 60 and 80 mm/s: 2 * 0.004 * 100 = 0.8 N against it.
    let force = f.step([60.0, -80.0], 2.0, 0.0);
    assert!((force[0] + 0.48).abs() < 1e-15 && (force[1] - 0.64).abs() < 1e-15, "{force:?}");
    // Coulomb's from 125 mm/s on, and no step there.
    let (below, above) = (f.step([124.999_999, 0.0], 2.0, 0.0)[0], f.step([125.000_001, 0.0], 2.0, 0.0)[0]);
    assert!((below + 1.0).abs() < 1e-7 && (above + 1.0).abs() < 1e-15);
    let fast = f.step([-6e4, 8e4], 2.0, 0.0);
    assert!((fast[0] - 0.6).abs() < 1e-12 && (fast[1] + 0.8).abs() < 1e-12);
    for still in [f.step([0.0; 2], 2.0, 0.0), f.step([50.0, 1.0], 0.0, 0.0), f.step([500.0, 1.0], -1.0, 0.0)]
    {
        assert_eq!(still.map(f64::abs), [0.0; 2]);
    }
}

#[test]
fn the_law_is_the_slope_at_rest() {
    let mut f = Rubbing::viscous_coulomb(0.5, 0.004);
    assert!((f.law(1.0).damping_ns_per_m - 4.0).abs() < 1e-12 && f.law(1.0).stiffness_n_per_mm == 0.0);
    let slope = (f.step([-1e-6, 0.0], 1.7, 0.0)[0] - f.step([1e-6, 0.0], 1.7, 0.0)[0]) / 2e-9;
    assert!((f.law(1.7).damping_ns_per_m - slope).abs() < 1e-9);
    assert_eq!(Rubbing::viscous_coulomb(0.0, 0.004).law(1.0).damping_ns_per_m, 0.0);
}

#[test]
fn what_is_not_finite_gives_no_friction() {
    let mut f = Rubbing::viscous_coulomb(10.0, 10.0);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for force in [f.step([bad, 1.0], 1.0, 0.0), f.step([1.0, 1.0], bad, 0.0)] {
            assert_eq!(force.map(f64::abs), [0.0; 2]);
        }
    }
    for v in [f64::MAX, f64::MIN_POSITIVE, 5e-324] {
        assert!(f.step([v, -v], f64::MAX, 0.0).iter().all(|x| x.is_finite()));
    }
}
