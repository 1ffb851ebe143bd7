//! `asperity calibrate`, as a user runs it: with a simulated card that has an actuator between output and
//! input.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;

use asperity_actuator::ActuatorProfile;
use harness::alone::beside_others;
use harness::live::told;
use harness::{Ran, asperity, files, graphs, json, run, run_line, wav};

/// A card with a Haptuator Mark II on 60 g, and the input's noise.
const CARD: &str =
    "simulated:frames=64,latency=200,speed=10,plant=haptuator_mark_ii,plant_handle_g=60,plant_noise=0.2";

fn calibrate(dir: &Path, device: &str, more: &[&str]) -> Ran {
    let mut args = vec!["calibrate", "--device", device, "--handle-mass-g", "60"];
    let usual = [("--accelerometer-full-scale", "100"), ("--out", "found.ron"), ("--seconds", "4")];
    usual
        .iter()
        .filter(|(name, _)| !more.contains(name))
        .for_each(|(name, value)| args.extend([name, value]));
    run(dir, &[&args, more].concat())
}

fn found(dir: &Path) -> ActuatorProfile {
    ActuatorProfile::read(dir.join("found.ron")).expect("a profile")
}

/// Checks the first figures that were found against those of the shipped profile that was measured.
fn assert_found(dir: &Path, shipped: &str) {
    let truth = ActuatorProfile::read(graphs("actuators").join(shipped)).expect("a shipped profile");
    for ((name, found), (_, truth)) in found(dir).quantities().iter().zip(truth.quantities()).take(4) {
        assert!((found.value / truth.value - 1.0).abs() < 0.05, "{name}: {found:?} {truth:?}");
    }
}

#[test]
fn the_profile_that_it_writes_is_used_by_the_shipped_graph() {
    let _alone = beside_others();
    let dir = tempfile::tempdir().expect("a folder");
    let more = ["--base", "haptuator_mark_ii", "--plot", "found.svg"];
    let ran = calibrate(dir.path(), CARD, &more).ok();
    assert_eq!(files(dir.path()), ["found.ron", "found.svg"]);
    for word in ["stiffness", "95 % interval", "resonance", "trust", "assumed", "found.ron"] {
        assert!(ran.out.contains(word), "{word}: {}", ran.out);
    }
    assert_found(dir.path(), "haptuator_mark_ii.ron");
    let found = found(dir.path());
    assert!(!found.stiffness.estimate && found.moving_mass.estimate);
    let svg = std::fs::read_to_string(dir.path().join("found.svg")).expect("a picture");
    for word in ["Magnitude", "Phase", "Coherence", "on 60 g"] {
        assert!(svg.contains(word), "{word}");
    }
    // No two measurements draw the same picture, but that of the docs has the same words.
    let shown = std::fs::read_to_string(harness::root().join("docs/calibrate.svg")).expect("a picture");
    for text in harness::words_of(&svg).filter(|text| !text.contains(':')) {
        assert!(shown.contains(&format!(">{text}<")), "no {text}: run `make pictures`");
    }
    let graph = graphs("texture.ron").display().to_string();
    let set = ["--set", "limiter.profile=found.ron", "--set", "inverse.profile=found.ron"];
    let to = ["render", &graph, "--seconds", "1.5", "--quiet", "--out"];
    run(dir.path(), &[&to[..], &["found.wav"], &set].concat()).ok();
    run(dir.path(), &[&to[..], &["shipped.wav"]].concat()).ok();
    let (with, without) = (wav(&dir.path().join("found.wav")).0, wav(&dir.path().join("shipped.wav")).0);
    assert!(with != without && with.iter().any(|x| *x != 0.0));
}

/// As most sound cards are: long blocks, of integers, in real time, so that the paced clock keeps it.
#[test]
fn the_paced_clock_of_a_card_with_long_blocks_measures_as_well() {
    let _alone = beside_others();
    let dir = tempfile::tempdir().expect("a folder");
    let card = CARD.replace("frames=64", "format=i16").replace(",speed=10", "");
    let more = ["--base", "haptuator_mark_ii", "--period", "4096", "--json", "--seconds", "1"];
    // Real time is not to be had at every moment; that nothing was written all the same is.
    told(|| {
        let ran = calibrate(dir.path(), &card, &more);
        if ran.code == 1 && ran.err.contains("times in a row") {
            assert!(files(dir.path()).is_empty());
            return Err(ran.err);
        }
        ran.ok();
        Ok(())
    });
    assert_found(dir.path(), "haptuator_mark_ii.ron");
}

#[test]
fn json_tells_what_was_found_and_how_far_to_trust_it() {
    let _alone = beside_others();
    let dir = tempfile::tempdir().expect("a folder");
    let ran = calibrate(dir.path(), CARD, &["--base", "haptuator_mark_ii", "--json"]).ok();
    std::fs::write(dir.path().join("found.json"), &ran.out).expect("a file");
    let found = json(&dir.path().join("found.json"));
    let k = &found["figures"]["stiffness_n_per_m"];
    let value = |name: &str| k[name].as_f64().expect("a number");
    assert!(value("low") < 1081.0 && 1081.0 < value("high") && value("base") == 1081.0, "{k}");
    // The moving mass of the base is an estimate, and all that hangs on it.
    assert_eq!(found["trust"], "fair");
    assert_eq!(found["figures"]["moving_mass_g"]["measured"], false);
    assert!(found["recordings"][0]["points"].as_array().is_some_and(|p| p.len() > 50));
}

/// The accelerometer is behind a voltage amplifier.
#[test]
fn inverted_accelerometer_gives_the_same_figures() {
    let _alone = beside_others();
    let dir = tempfile::tempdir().expect("a folder");
    let card = CARD
        .replace("haptuator_mark_ii", "hapcoil_one")
        .replace("=0.2", "=0.05,plant_volts=5,plant_invert=1");
    let more = ["--drive", "voltage", "--volts-per-volt", "5", "--volts", "0.5"];
    calibrate(dir.path(), &card, &more).ok().says(&["polarity is inverted"]);
    let found = found(dir.path());
    let truth = ActuatorProfile::read(graphs("actuators/hapcoil_one.ron")).expect("a shipped profile");
    for (found, truth) in [
        (&found.stiffness, &truth.stiffness),
        (&found.damping, &truth.damping),
        (&found.force_factor, &truth.force_factor),
    ] {
        assert!((found.value / truth.value - 1.0).abs() < 0.05, "{found:?} {truth:?}");
    }
}

#[test]
fn failed_measurement_says_why_and_keeps_the_old_profile() {
    let _alone = beside_others();
    let dir = tempfile::tempdir().expect("a folder");
    let old = "an older profile";
    std::fs::write(dir.path().join("found.ron"), old).expect("a file");
    let noisy = "simulated:frames=64,speed=10,plant=hapcoil_one,plant_noise=2";
    let hot = CARD.replace("plant_noise", "plant_full_scale=0.1,plant_noise");
    let wire = "simulated:frames=64,speed=10,loopback=1";
    let cases: [(&str, &[&str], &[&str]); 5] = [
        ("simulated:frames=64,speed=10", &[], &["input channel 1", "silent", "--input-channel"]),
        (CARD, &["--input-channel", "2"], &["input channel 2", "silent"]),
        (noisy, &["--channel", "2"], &["does not follow", "channel 2", "asperity tone --channel 2"]),
        (
            &hot,
            &["--accelerometer-full-scale", "0.1"],
            &["clips in the quiet sweep", "lower the input's gain"],
        ),
        (wire, &["--plot", "wire.svg"], &["poor", "connected to the drive itself", "not written"]),
    ];
    for (device, more, words) in cases {
        let ran = calibrate(dir.path(), device, more);
        assert_eq!(ran.code, 1, "{device}: {} {}", ran.out, ran.err);
        let said = format!("{}{}", ran.out, ran.err);
        assert!(words.iter().all(|word| said.contains(word)), "{device}: {said}");
        assert_eq!(std::fs::read_to_string(dir.path().join("found.ron")).expect("a file"), old);
    }
    // The picture shows why; the profile is there for who insists.
    assert_eq!(files(dir.path()), ["found.ron", "wire.svg"]);
    calibrate(dir.path(), wire, &["--anyway"]).ok();
    let text = std::fs::read_to_string(dir.path().join("found.ron")).expect("a file");
    assert!(text.contains("Trust: poor"), "{text}");
}

#[test]
fn a_level_that_would_clip_is_lowered_and_said() {
    let _alone = beside_others();
    let dir = tempfile::tempdir().expect("a folder");
    let card = "simulated:frames=64,speed=10,plant=hapcoil_one,plant_handle_g=60,\
                plant_full_scale=2,plant_noise=0.001";
    calibrate(dir.path(), card, &["--accelerometer-full-scale", "2"])
        .ok()
        .says(&["the level is lowered to 0.0"]);
    let found = found(dir.path());
    assert!((found.force_factor.value / 1.78 - 1.0).abs() < 0.05, "{:?}", found.force_factor);
}

#[test]
fn what_makes_no_sense_is_refused_before_anything_is_played() {
    let _alone = beside_others();
    let dir = tempfile::tempdir().expect("a folder");
    std::fs::copy(graphs("actuators/hapcoil_one.ron"), dir.path().join("mine.ron")).expect("a copy");
    let cases: [(&[&str], &str); 8] = [
        (&["--out", "mine.ron", "--base", "./mine.ron"], "would be overwritten"),
        (&["--plot", "found.ron"], "would write the same file"),
        (&["--second-mass-g", "200"], "no terminal"),
        (&["--second-mass-g", "61", "--yes"], "too much alike"),
        (&["--amps", "1.5"], "out of range"),
        (&["--volts", "1"], "--drive voltage"),
        (&["--base", "hapcoil_two"], "hapcoil_one"),
        (&["--out", "no/such/folder.ron"], "the folder no does not exist"),
    ];
    for (more, says) in cases {
        let out = if more.contains(&"--out") { "" } else { "--out found.ron" };
        let fixed = format!("--handle-mass-g 60 --accelerometer-full-scale 100 {out}");
        let more = more.join(" ");
        let ran = run_line(dir.path(), &format!("calibrate --device {CARD} {fixed} {more}")).refused(says);
        assert!(!ran.err.contains("sweep"), "{more}: {}", ran.err);
        assert_eq!(files(dir.path()), ["mine.ron"], "{more:?}");
    }
    calibrate(dir.path(), "simulated:plant=hapcoil_two", &[]).refused("hapcoil_one");
    calibrate(dir.path(), "simulated:plant=hapcoil_one,plant_colour=red", &[]).refused("no `plant_colour`");
}

#[cfg(unix)]
#[test]
fn ctrl_c_in_the_middle_leaves_nothing_behind() {
    let _alone = beside_others();
    let dir = tempfile::tempdir().expect("a folder");
    let device = CARD.replace("speed=10", "speed=4");
    let mut child = asperity(dir.path())
        .args(["calibrate", "--device", &device, "--handle-mass-g", "60"])
        .args(["--accelerometer-full-scale", "100", "--out", "found.ron", "--plot", "found.svg"])
        .args(["--seconds", "120"])
        .stderr(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut lines = BufReader::new(child.stderr.take().expect("its messages")).lines();
    assert!(lines.any(|line| line.is_ok_and(|line| line.contains("measuring"))));
    let status = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(status.is_ok_and(|s| s.success()));
    let rest: Vec<String> = lines.map_while(Result::ok).collect();
    assert_eq!(child.wait().expect("an end").code(), Some(1));
    assert!(rest.iter().any(|line| line.contains("nothing was written")), "{rest:?}");
    assert!(files(dir.path()).is_empty());
}
