//! The stages from motion to the network against closed forms, through the program.

use std::f64::consts::{PI, TAU};

use asperity_data::Spectrometer;
use asperity_dsp::frame::BINS;
use asperity_surfaces::stylus::{Moment, SAMPLE_HZ, Stylus, Tool};
use asperity_surfaces::topography::{Family, MadeSurface};
use harness::{Room, graphs};

/// A trajectory at 1 kHz from a function of time to x, y, z.
fn csv(seconds: f64, at: impl Fn(f64) -> [f64; 3]) -> String {
    harness::csv_at(1000, seconds, at)
}

/// Renders the shipped graph over a trajectory and answers what the probes saw, row by row.
fn probed(trajectory: &str, set: &str, ports: &[&str]) -> Vec<(Vec<f32>, usize)> {
    let dir = Room::new();
    dir.write("t.csv", trajectory);
    let probe = |(i, port): (usize, &&str)| format!(" --probe {port}={i}.npy");
    let probes: String = ports.iter().enumerate().map(probe).collect();
    let set = format!("--set stylus.interpolation=linear --set '{set}'");
    dir.run(&format!("render graphs/heravi2024.ron --input t.csv {set}{probes}")).ok();
    let read = |i| {
        let array = asperity_accuracy::npy::read(dir.join(format!("{i}.npy"))).unwrap();
        let columns = array.shape.get(1).copied().unwrap_or(1);
        (array.values.into_f32(), columns)
    };
    (0..ports.len()).map(read).collect()
}

#[test]
fn history_is_ten_samples_at_500_hz_at_any_tick_rate() {
    // Force rises with depth, 0.5 N/mm; interpolating a straight line between ticks is exact.
    let depth = |t: f64| 1.0 + 0.5 * t;
    let trajectory = csv(2.0, |t| [40.0 * t, -20.0 * t, -depth(t)]);
    for tick_hz in [250_usize, 500, 700, 1000] {
        let set = format!("tick_hz={tick_hz}");
        let out = probed(&trajectory, &set, &["history.force", "history.velocity"]);
        let (force, columns) = &out[0];
        assert_eq!(*columns, 10);
        for (k, row) in force.chunks_exact(10).enumerate() {
            let newest = (k * 500 / tick_hz) as i64;
            for (i, f) in row.iter().enumerate() {
                let j = newest - 9 + i as i64;
                let expected = if j < 0 { 0.0 } else { 0.5 * depth(j as f64 / 500.0) };
                // Before the second tick there is nothing to interpolate from.
                assert!(
                    (f64::from(*f) - expected).abs() < 2e-6 || k < 2,
                    "{tick_hz} Hz, tick {k}, {i}: {f}, not {expected}"
                );
            }
        }
        let (velocity, columns) = &out[1];
        assert_eq!(*columns, 20);
        let last = velocity.chunks_exact(20).last().unwrap();
        assert!(last[..10].iter().all(|v| (v - 40.0).abs() < 0.01), "vx first: {last:?}");
        assert!(last[10..].iter().all(|v| (v + 20.0).abs() < 0.01), "then vy: {last:?}");
    }
}

#[test]
fn the_velocity_filter_is_3_db_down_at_20_hz() {
    let (amplitude, hz) = (0.5, 20.0);
    let trajectory = csv(3.0, |t| [amplitude * (TAU * hz * t).sin(), 0.0, -1.0]);
    for tick_hz in [500.0, 1000.0] {
        let set = format!("tick_hz={tick_hz}");
        let out = probed(&trajectory, &set, &["motion.velocity", "motion.speed"]);
        let vx: Vec<f64> = out[0].0.chunks_exact(2).map(|v| f64::from(v[0])).collect();
        let steady = &vx[vx.len() / 2..];
        let rms = (steady.iter().map(|v| v * v).sum::<f64>() / steady.len() as f64).sqrt();
        // A difference over one tick, then a Butterworth filter at its corner.
        let u = PI * hz / tick_hz;
        let expected = amplitude * TAU * hz * (u.sin() / u) / 2.0_f64.sqrt();
        assert!(
            (rms * 2.0_f64.sqrt() / expected - 1.0).abs() < 2e-3,
            "{tick_hz} Hz: {}",
            rms * 2.0_f64.sqrt() / expected
        );
        for (v, s) in out[0].0.chunks_exact(2).zip(&out[1].0) {
            assert!((v[0].hypot(v[1]) - s).abs() < 1e-4);
        }
    }
}

#[test]
fn the_floor_pushes_by_hooke_up_to_what_the_device_can() {
    let trajectory = csv(2.0, |t| [0.0, 0.0, 2.0 - 6.0 * t]);
    let out = probed(&trajectory, "seed=2024", &["floor.force", "floor.depth"]);
    for (k, (force, depth)) in out[0].0.iter().zip(&out[1].0).enumerate() {
        let expected = (6.0 * k as f64 / 500.0 - 2.0).max(0.0);
        assert!((f64::from(*depth) - expected).abs() < 1e-5, "tick {k}");
        assert!((f64::from(*force) - (0.5 * expected).min(3.3)).abs() < 1e-5, "tick {k}");
    }
    assert_eq!(out[0].0.last(), Some(&3.3));
}

#[test]
fn the_gate_opens_at_5_and_closes_at_2_mm_s() {
    // Speed rises to 10 mm/s and falls again.
    let trajectory = csv(4.0, |t| {
        [if t < 2.0 { 2.5 * t * t } else { 10.0 + 10.0 * (t - 2.0) - 2.5 * (t - 2.0).powi(2) }, 0.0, -2.0]
    });
    let out = probed(&trajectory, "seed=2024", &["motion.speed", "gate.active", "gate.out"]);
    let (speed, active) = (&out[0].0, &out[1].0);
    let opened = active.iter().position(|a| *a > 0.5).expect("it opens");
    assert!(speed[opened] >= 5.0 && speed[opened - 1] < 5.0, "{} {}", speed[opened - 1], speed[opened]);
    let below = (opened..speed.len()).find(|&k| speed[k] < 2.0).expect("it slows down");
    let closed = (opened..active.len()).find(|&k| active[k] < 0.5).expect("it closes");
    // It stays active for the 10 ms of the fade, five ticks.
    assert!((below + 4..=below + 6).contains(&closed), "slow at {below}, closed at {closed}");
    assert!(out[2].0[(closed + 1) * 96..].iter().all(|x| *x == 0.0));
}

/// Root mean square magnitudes of a pen's acceleration at 10, 20, .. 1000 Hz, over pieces of a made surface
/// that no training has seen, along x at 100 mm/s and 1 N.
fn felt_by_a_pen(surface: &MadeSurface) -> [f64; BINS] {
    let mut spectrometer = Spectrometer::new(f64::from(SAMPLE_HZ));
    let (mut power, mut frames) = ([0.0; BINS], 0.0);
    for seed in 70_001..70_004 {
        let track = Tool::PEN.track(&surface.patch((1024, 0.02), seed), &surface.contact);
        let mut stylus = Stylus::new(Tool::PEN, &track, surface.contact, [0.0, 3.0], 1.0);
        let moment = Moment { velocity_mm_s: [100.0, 0.0], force_n: 1.0 };
        let mut axes = [0; 3].map(|_| Vec::new());
        for _ in 0..3 * SAMPLE_HZ {
            let felt = stylus.next(&moment).axes();
            axes.iter_mut().zip(felt).for_each(|(axis, a)| axis.push(a));
        }
        let frame = SAMPLE_HZ as usize / 10;
        for start in (3 * frame..axes[0].len()).step_by(frame) {
            frames += 1.0;
            let magnitudes =
                spectrometer.magnitudes(&axes.each_ref().map(|axis| &axis[start..start + frame]));
            power.iter_mut().zip(magnitudes).for_each(|(sum, m)| *sum += f64::from(m).powi(2));
        }
    }
    power.map(|sum| (sum / frames).sqrt())
}

#[test]
fn the_shipped_network_answers_what_a_pen_feels() {
    // Steady: 100 mm/s and 1 N.
    let trajectory = csv(1.0, |t| [100.0 * t, 0.0, -2.0]);
    let surfaces = asperity_surfaces::topography::made_surfaces();
    // one of each family, and never one that was held apart
    let some: Vec<&MadeSurface> = surfaces.iter().skip(5).step_by(14).collect();
    // power over 50 Hz
    let bands = |power: &dyn Fn(usize) -> f64| -> Vec<f64> {
        (1..=BINS).map(|b| (b.max(3) - 2..=(b + 2).min(BINS)).map(power).sum()).collect()
    };
    let felt: Vec<Vec<f64>> = some
        .iter()
        .map(|surface| {
            let felt = felt_by_a_pen(surface);
            bands(&|bin| felt[bin - 1].powi(2))
        })
        .collect();
    let answered: Vec<Vec<f64>> = some
        .iter()
        .map(|surface| {
            let out = probed(&trajectory, &format!("texture.material={}", surface.name), &["texture"]);
            let predicted = out[0].0.chunks_exact(out[0].1).last().unwrap();
            assert_eq!(predicted[0], 0.0);
            bands(&|bin| f64::from(predicted[bin]).powi(2))
        })
        .collect();
    // mean of |error| in dB where anything is felt
    let error = |answered: &[f64], felt: &[f64]| {
        let loudest = felt.iter().fold(0.0_f64, |m, x| m.max(*x));
        let bins = answered.iter().zip(felt).filter(|(_, felt)| **felt > 1e-3 * loudest);
        let errors: Vec<f64> = bins.map(|(a, f)| (10.0 * (a / f).log10()).abs()).collect();
        errors.iter().sum::<f64>() / errors.len() as f64
    };
    for (surface, (felt, own)) in some.iter().zip(felt.iter().zip(&answered)) {
        let mean = error(own, felt);
        let best = answered.iter().map(|other| error(other, felt)).fold(f64::INFINITY, f64::min);
        println!("{}: {mean:.2} dB, the best of all answers {best:.2} dB", surface.name);
        // a grating's lines are narrower than what the network answers, and between them there is little
        let most = if surface.family == Family::Grating { 11.0 } else { 5.0 };
        assert!(mean < most, "{}: {mean:.2} dB", surface.name);
        // what is answered for another material is no better
        assert!(mean <= best, "{}: {mean:.2} dB, another {best:.2} dB", surface.name);
    }
}

#[test]
fn a_control_picks_among_preloaded_materials() {
    let dir = Room::new();
    // The depth picks: 0.2 mm rounds to the first, 1.2 mm to the second, and 9 mm is held to the last.
    let graph = harness::shipped_graph()
        .replace("material: \"canvas\",", "material: \"canvas\", materials: [\"oak\"],")
        .replace(
            "\"phase\": (kind: \"spsi\"),",
            "\"phase\": (kind: \"spsi\"), \"pick\": (kind: \"gain\", params: (unit: \"1\")),",
        )
        .replace(
            "(\"texture\", \"phase\"),",
            "(\"texture\", \"phase\"), (\"floor.depth\", \"pick\"), (\"pick\", \"texture.material\"),",
        );
    dir.write("pick.ron", graph);
    dir.write("plain.ron", harness::shipped_graph());
    for (depth, material) in [(0.2, "canvas"), (1.2, "oak"), (9.0, "oak")] {
        let trajectory = csv(0.5, |t| [100.0 * t, 0.0, -depth]);
        dir.write("t.csv", trajectory);
        dir.run("render pick.ron --input t.csv --out a.wav").ok();
        let set = format!("texture.material={material}");
        dir.run(&format!("render plain.ron --input t.csv --out b.wav --set {set}")).ok();
        let read = |n: &str| dir.bytes(n);
        assert!(read("a.wav") == read("b.wav"), "{depth} mm");
    }
}

#[test]
fn the_drive_makes_a_simulated_handle_do_what_was_wanted() {
    use asperity_actuator::{ActuatorProfile, Drive, Dynamics, Plant};
    let profile = ActuatorProfile::read(graphs("actuators/hapcoil_one.ron")).expect("the profile");
    let dynamics = Dynamics::new(&profile, 100.0).expect("the actuator");
    let trajectory = csv(2.0, |t| [100.0 * t, 0.0, -1.0]);
    for (name, drive) in [("current", Drive::Current), ("voltage", Drive::Voltage)] {
        let set = format!("inverse.drive={name}");
        let out = probed(&trajectory, &set, &["gate.out", "inverse"]);
        // Inverse and actuator together are the stated high-pass, and nothing else.
        let pair = asperity_dsp::filter::Section::high_pass(20.0, std::f64::consts::FRAC_1_SQRT_2);
        let mut pair = pair.bilinear(48_000.0, 20.0).expect("a filter");
        let mut plant = Plant::new(&dynamics, drive, 48_000.0);
        let (mut error, mut wanted) = (0.0, 0.0);
        for (a, d) in out[0].0.iter().zip(&out[1].0) {
            let expected = pair.step(f64::from(*a));
            error += (plant.step(f64::from(*d)).acceleration - expected).powi(2);
            wanted += expected.powi(2);
        }
        assert!(wanted > 0.0 && error < 1e-2 * wanted, "{name}: {:.5} of the power is error", error / wanted);
    }
}

/// An inverse and a limiter of two different chains were taken for a mistake.
#[test]
fn two_actuators_of_different_profiles_cause_no_warning() {
    let dir = Room::new();
    dir.write(
        "g.ron",
        r#"Graph(version: 1, nodes: {
            "sine": (kind: "sine", params: (unit: "m/s^2")),
            "inverse": (kind: "actuator_inverse", params: (profile: "hapcoil_one", handle_mass_g: 100)),
            "near": (kind: "limiter", params: (profile: "hapcoil_one", handle_mass_g: 100)),
            "other": (kind: "actuator_inverse", params: (profile: "haptuator_mark_ii", handle_mass_g: 60)),
            "far": (kind: "limiter", params: (profile: "haptuator_mark_ii", handle_mass_g: 60)),
            "left": (kind: "audio_out"),
            "right": (kind: "audio_out"),
        }, wires: [("sine", "inverse"), ("inverse", "near"), ("near", "left"),
                   ("sine", "other"), ("other", "far"), ("far", "right")])"#,
    );
    for line in ["check g.ron", "render g.ron --seconds 0.1 --out o.wav"] {
        let ran = dir.run(line).ok();
        assert!(!ran.err.contains("warning"), "{}", ran.err);
    }
}
