use super::values::errors;
use super::*;
use asperity_diagnostics::Source;

fn judged(tape: &Tape) -> Findings {
    identified(std::slice::from_ref(tape), &hapcoil(), held())
}

fn says(f: &Findings, what: &str) -> bool {
    f.notes.iter().any(|n| n.contains(what))
}

fn noise(len: usize, seed: u64) -> Vec<f32> {
    let mut noise = Noise(seed);
    (0..len).map(|_| noise.next() as f32).collect()
}

#[test]
fn noise_as_strong_as_the_signal_is_poor() {
    for seed in 1..4 {
        let f = judged(&Scene { snr_db: 0.0, seed, ..Scene::new(100.0) }.play(&hapcoil()));
        assert_eq!(f.trust, Trust::Poor, "{f:?}");
        assert!(says(&f, "noisy") && (f.recordings[0].snr_db - 0.0).abs() < 1.0, "{:?}", f.notes);
    }
}

#[test]
fn wrong_channel_is_poor() {
    let mut tape = Scene::new(100.0).play(&hapcoil());
    for seed in 1..6 {
        tape.acceleration = noise(tape.drive.len(), seed);
        let f = judged(&tape);
        assert_eq!(f.trust, Trust::Poor);
        assert!(says(&f, "does not follow the drive"), "{:?}", f.notes);
    }
    // Only hum.
    tape.acceleration = (0..tape.drive.len()).map(|n| (TAU * 50.0 * n as f64 / RATE).sin() as f32).collect();
    assert_eq!(judged(&tape).trust, Trust::Poor);
}

#[test]
fn drive_as_acceleration_is_poor() {
    let mut tape = Scene::new(100.0).play(&hapcoil());
    tape.acceleration = tape.drive.clone();
    let f = judged(&tape);
    assert_eq!(f.trust, Trust::Poor, "{f:?}");
    assert!(says(&f, "is the input connected to the drive itself?"), "{:?}", f.notes);
}

#[test]
fn clipped_input_is_poor() {
    let whole = Scene { snr_db: 40.0, ..Scene::new(100.0) }.play(&hapcoil());
    let peak = whole.acceleration.iter().fold(0.0f32, |m, x| m.max(x.abs()));
    for part in [0.98, 0.9, 0.6, 0.3] {
        let cut = |x: &f32| x.clamp(-part * peak, part * peak);
        let f = judged(&Tape { acceleration: whole.acceleration.iter().map(cut).collect(), ..whole.clone() });
        assert_eq!(f.trust, Trust::Poor, "{part} {f:?}");
        assert!(says(&f, "clips"), "{:?}", f.notes);
    }
    // A noiseless sine has equal peaks, but does not clip.
    let clean = Scene { snr_db: 300.0, ..Scene::new(100.0) }.play(&hapcoil());
    assert!(!says(&judged(&clean), "clips"));
    // A coarse converter of 9 bits does not clip.
    let coarse = |x: &f32| (x / peak * 255.0).round() / 255.0 * peak;
    let f = judged(&Tape { acceleration: whole.acceleration.iter().map(coarse).collect(), ..whole.clone() });
    assert!(!says(&f, "clips") && f.trust == Trust::Good, "{:?}", f.notes);
}

#[test]
fn good_findings_are_right() {
    let truth = hapcoil();
    let mut good = 0;
    for (seed, snr_db) in [-10.0, -3.0, 3.0, 6.0, 10.0, 14.0, 17.0, 25.0, 40.0].into_iter().enumerate() {
        for seconds in [0.5, 2.0] {
            let scene = Scene { snr_db, seconds, seed: seed as u64, ..Scene::new(100.0) };
            let f = judged(&scene.play(&truth));
            if f.trust == Trust::Good {
                good += 1;
                let off = errors(&f, &truth);
                assert!(off.iter().all(|e| e.abs() < 0.05), "{snr_db} dB, {seconds} s: {off:?}");
            }
        }
    }
    assert!(good >= 4);
}

#[test]
fn inversion_and_limiting_are_noted_and_do_not_matter() {
    let truth = hapcoil();
    let mut tape = Scene { amplitude: 0.58, ..Scene::new(100.0) }.play(&truth);
    assert!(tape.limited);
    tape.acceleration.iter_mut().for_each(|x| *x = -*x);
    let f = judged(&tape);
    assert!(f.recordings[0].inverted && f.trust == Trust::Good, "{f:?}");
    assert!(says(&f, "the polarity is inverted") && says(&f, "the limiter acted"), "{:?}", f.notes);
    assert!((f.force_factor.value / truth.force_factor.value - 1.0).abs() < 0.01);
    assert!((f.damping.value / truth.damping.value - 1.0).abs() < 0.01);
}

#[test]
fn distortion_is_measured() {
    let truth = hapcoil();
    let scene = Scene { snr_db: 60.0, delay: 0.0, ..Scene::new(100.0) };
    let clean = scene.play(&truth);
    let linear = judged(&clean).recordings[0].distortion.unwrap();
    assert!(linear < 0.005, "{linear}");
    // The push has a part that grows with the square of the current. A flat sweep of amplitude 1 would
    // turn half of `part` of the push into its second harmonic.
    let settings = SweepSettings { seconds: 4.0, from_hz: 100.0, amplitude: 0.1, ..SweepSettings::default() };
    let sweep = Sweep::new(settings, RATE).unwrap();
    let drive: Vec<f32> = (0..sweep.samples()).map(|n| sweep.sample(n) as f32).collect();
    let mut plant =
        Plant::new(&Dynamics::new(&profile(4.4, 20.0, 0.2, 1.78), 100.0).unwrap(), Drive::Current, RATE);
    let bent = |u: f64| u + 2.0 * u * u;
    let acceleration = drive.iter().map(|u| plant.step(bent(f64::from(*u))).acceleration as f32).collect();
    let tape = Tape { drive, acceleration, limited: false, scene };
    let constant = Some(sweep.time_constant_s());
    let found =
        spectra::distortion(&Recording { sweep_time_constant_s: constant, ..tape.recording() }, 2000.0, 0.0);
    assert!((found.unwrap() / 0.1 - 1.0).abs() < 0.1, "{found:?}");
}

#[test]
fn resonance_outside_the_sweep_is_poor() {
    // 9 Hz on 100 g.
    let settings = IdentifySettings { band_hz: (20.0, 2000.0), ..held() };
    let tape = Scene::new(100.0).play(&profile(30.0, 75.0, 0.3, 1.0));
    let f = identified(&[tape], &hapcoil(), settings);
    assert_eq!(f.trust, Trust::Poor, "{f:?}");
    assert!(says(&f, "outside of the frequencies"), "{:?}", f.notes);
}

#[test]
fn similar_handles_fall_back_to_the_base() {
    let truth = hapcoil();
    let tapes = [100.0, 106.0].map(|g| Scene::new(g).play(&truth));
    let f = identified(&tapes, &truth, IdentifySettings { held: true, ..Default::default() });
    assert!(!f.moving_mass_measured && says(&f, "too much alike"), "{:?}", f.notes);
    assert!((f.stiffness.value / truth.stiffness.value - 1.0).abs() < 0.05);
}

#[test]
fn long_latency_is_found() {
    let mut tape = Scene { delay: 0.25, ..Scene::new(100.0) }.play(&hapcoil());
    tape.acceleration.rotate_right(19_200);
    let f = judged(&tape);
    assert!((f.recordings[0].latency_s * RATE - 19_200.25).abs() < 0.05, "{:?}", f.recordings[0]);
}

#[test]
fn unusable_recordings_are_refused() {
    let tape = Scene { seconds: 1.0, ..Scene::new(100.0) }.play(&hapcoil());
    let whole = tape.recording();
    let silent = vec![0.0; tape.drive.len()];
    let mut bad = tape.acceleration.clone();
    bad[100] = f32::NAN;
    let sine: Vec<f32> = (0..tape.drive.len()).map(|n| (n as f32 * 0.01).sin() * 0.1).collect();
    for (r, why) in [
        (Recording { drive: &silent, ..whole }, "the drive is silent"),
        (Recording { acceleration: &silent, ..whole }, "the accelerometer is silent"),
        (Recording { acceleration: &bad, ..whole }, "not finite"),
        (Recording { drive: &whole.drive[..1000], ..whole }, "too short"),
        (Recording { handle_mass_g: 0.0, ..whole }, "a handle's mass of 0"),
        (Recording { rate_hz: f64::NAN, ..whole }, "a rate"),
        (Recording { drive: &sine, ..whole }, "excites only"),
    ] {
        let said = identify(&[r], &hapcoil(), held()).unwrap_err().to_string();
        assert!(said.contains(why), "{why}: {said}");
    }
    assert!(identify(&[], &hapcoil(), held()).unwrap_err().message.contains("there is no recording"));
}

#[test]
fn written_profile_reads_back_with_measured_figures() {
    let truth = hapcoil();
    let mut base = profile(5.0, 900.0, 1.0, 1.0);
    base.name = "a \"quoted\"\nname \\ with \u{e4}".into();
    let tapes = [20.0, 200.0].map(|g| Scene::new(g).play(&truth));
    let both = identified(&tapes, &base, held());
    let read = |text: String| ActuatorProfile::parse(&Source::new("p.ron", text)).unwrap();
    let p = read(write_profile(&both, &base, Some("2026-11-20")));
    assert_eq!(p.name, base.name);
    for (name, q) in p.quantities() {
        let measured = ["m_a", "k", "damping", "k_f"].contains(&name);
        assert_eq!(q.estimate, !measured, "{name}");
        assert_eq!(q.source.starts_with("measured on 2026-11-20: 95 % interval "), measured, "{}", q.source);
    }
    assert!((p.stiffness.value / both.stiffness.value - 1.0).abs() < 1e-4);
    assert!((p.moving_mass.value / both.moving_mass.value - 1.0).abs() < 1e-4);
    assert_eq!(p.inductance.value, base.inductance.value);
    // With one recording the moving mass is the base's.
    let one = identified(&tapes[..1], &base, held());
    let p = read(write_profile(&one, &base, None));
    assert!(p.moving_mass.estimate && p.moving_mass.value == base.moving_mass.value);
    assert!(p.stiffness.source.contains("with the moving mass given here"), "{}", p.stiffness.source);
    // Poor findings are never marked as measured.
    let mut wrong = Scene::new(100.0).play(&truth);
    wrong.acceleration = noise(wrong.drive.len(), 3);
    let poor = identified(&[wrong], &base, held());
    let text = write_profile(&poor, &base, None);
    assert!(text.contains("Trust: poor") && read(text).quantities().iter().all(|(_, q)| q.estimate));
}

#[test]
fn unchanged_handle_mass_is_poor() {
    let tape = Scene::new(100.0).play(&hapcoil());
    let recorded = tape.recording();
    for (other, uncertainty) in [(50.0, 0.01), (200.0, 0.002), (107.0, 0.01)] {
        let second = Recording { handle_mass_g: other, ..recorded };
        let settings = IdentifySettings { handle_mass_uncertainty: uncertainty, ..held() };
        let f = identify(&[recorded, second], &hapcoil(), settings).unwrap();
        assert_eq!(f.trust, Trust::Poor, "{other} {:?}", f.notes);
        assert!(says(&f, "moves as if it weighed"), "{:?}", f.notes);
    }
}
