//! The machine's file: what a graph says of itself raises nothing.

use std::path::Path;

use harness::alone::shared_stage;
use harness::live::{Live, npy};
use harness::{Ran, run_line};

use crate::coil::Coil;

const CARD: &str = "simulated:frames=96,loopback=1";

/// A square wave at full scale, as loud as a graph can be that says little of its amplifier.
fn square(out: &str, limiter: &str) -> String {
    format!(
        r#"Graph(version: 1, nodes: {{
    "tone": (kind: "sine", params: (frequency_hz: 65, amplitude: 1000)),
    "limiter": (kind: "limiter", params: ({limiter})),
    "out": (kind: "audio_out", params: ({out})), "card": (kind: "audio_in", params: (unit: "A")),
    "heard": (kind: "file_out", params: (file: "heard.npy")),
}}, wires: [("tone", "limiter"), ("limiter", "out"), ("card", "heard")])"#
    )
}

/// Runs `asperity setup` with these words.
fn setup(dir: &Path, words: &str) -> Ran {
    run_line(dir, &format!("setup --machine machine.ron {words}"))
}

/// The actuator on channel 1 of the card, and more options.
fn known(dir: &Path, more: &str) -> Ran {
    let actuator = "--channel 1 --profile hapcoil_one --handle-mass-g 100";
    setup(dir, &format!("--device {CARD} {actuator} --volts-at-full-scale 1 --amps-per-volt 1 {more}"))
}

fn play(dir: &Path, text: &str) -> Ran {
    std::fs::write(dir.join("g.ron"), text).unwrap();
    run_line(dir, &format!("run g.ron --device {CARD} --machine machine.ron --seconds 2"))
}

#[test]
fn contradicting_graph_is_refused_with_both_places() {
    let dir = &*shared_stage();
    known(dir, "").ok();
    // The same actuator, but for how fast it is said to cool.
    let text = std::fs::read_to_string(harness::graphs("actuators/hapcoil_one.ron")).unwrap();
    let quick = text.replace("thermal_time_constant: (s: 2.0", "thermal_time_constant: (s: 0.1");
    assert_ne!(text, quick);
    std::fs::write(dir.join("quick.ron"), quick).unwrap();
    for (out, limiter, told) in [
        ("", r#"profile: "quick.ron""#, "thermal time constant"),
        ("", "slew_hz: 8000", "`limiter.slew_hz`"),
        ("", "dc_corner_hz: 0.5", "`limiter.dc_corner_hz`"),
        ("volts_at_full_scale: 0.001, amps_per_volt: 0.001", "", "`out.volts_at_full_scale` is 0.001 V"),
        ("amps_per_volt: 0.5", "", "`out.amps_per_volt` is 0.5 A/V"),
        ("", "handle_mass_g: 20", "handle mass"),
        ("", r#"profile: "haptuator_mark_ii""#, "`limiter`'s actuator"),
    ] {
        let ran = play(dir, &square(out, limiter));
        assert_eq!(ran.code, 2, "{}", ran.err);
        for part in [told, "g.ron:", "machine.ron:"] {
            assert!(ran.err.contains(part), "`{part}` is not in {}", ran.err);
        }
        assert!(!dir.join("heard.npy").exists());
    }
    play(dir, &square("", "")).ok();
}

#[test]
fn two_entries_for_one_channel_are_refused() {
    let dir = &*shared_stage();
    known(dir, "").ok();
    let ran = play(dir, &square("", "")).ok();
    let device = ran.out.lines().find_map(|l| l.strip_prefix("device")).unwrap().trim().to_owned();
    let name = device.split(": ").next().unwrap();
    let file = dir.join("machine.ron");
    let text = std::fs::read_to_string(&file).unwrap();
    let entry = text[text.find("        (device").unwrap()..].split("),").next().unwrap().to_owned() + "),";
    let id = entry.replace(&format!("{CARD:?}"), &format!("{name:?}"));
    assert_ne!(entry, id, "{name}");
    std::fs::write(&file, text.replace(&entry, &format!("{entry}\n{id}"))).unwrap();
    let ran = play(dir, &square("", ""));
    assert!(ran.code == 2 && ran.err.contains("two entries are about channel 1"), "{}", ran.err);
}

#[test]
fn most_volts_of_the_machine_hold_for_every_graph() {
    let dir = &*shared_stage();
    known(dir, "--most-volts 0.08").ok();
    let ran = play(dir, &square("", "")).ok();
    assert!(ran.out.contains("samples were limited after the graph"), "{} {}", ran.out, ran.err);
    let heard = npy(&dir.join("heard.npy"));
    let peak = heard.iter().fold(0.0f32, |most, x| most.max(x.abs()));
    assert!(peak <= 0.080_000_1 && peak > 0.07, "{peak}");
    let used = Coil::new(48_000).play(heard.iter().map(|x| f64::from(*x))).used;
    used.assert_within("behind the machine's guard");
}

#[test]
fn edit_that_contradicts_the_machine_is_refused_while_it_plays() {
    let dir = &*shared_stage();
    known(dir, "").ok();
    std::fs::write(dir.join("g.ron"), square("", "")).unwrap();
    let mut live = Live::start(dir, &["g.ron", "--watch", "--device", CARD, "--machine", "machine.ron"]);
    std::thread::sleep(std::time::Duration::from_millis(1500));
    std::fs::write(dir.join("g.ron"), square("amps_per_volt: 0.01", "")).unwrap();
    live.says("the machine's file says 1 A/V");
    live.stop().ok();
}

#[test]
fn setup_keeps_what_else_stands_in_the_file() {
    let dir = &*shared_stage();
    known(dir, "").ok();
    let file = dir.join("machine.ron");
    let first = std::fs::read_to_string(&file).unwrap();
    let noted = first.replace("outputs: [", "outputs: [ // mine");
    std::fs::write(&file, &noted).unwrap();
    let again = known(dir, "");
    assert_eq!(again.code, 2, "{}", again.err);
    assert!(again.err.contains("--overwrite"), "{}", again.err);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), noted);
    let other = "--device PCH --channel 2 --profile haptuator_mark_ii --handle-mass-g 50";
    setup(dir, &format!("{other} --volts-at-full-scale 1.2 --volts-per-volt 3")).ok();
    known(dir, "--overwrite --most-volts 0.5").ok();
    let text = std::fs::read_to_string(&file).unwrap();
    for part in ["// mine", "\"PCH\"", "volts_per_volt: 3.0", "most_volts: 0.5"] {
        assert!(text.contains(part), "{part} is not in {text}");
    }
    assert_eq!(text.matches("channel: 1").count(), 1, "{text}");
    // What is not said is asked for where somebody can answer, and named where nobody can.
    let ran = setup(dir, "");
    assert!(ran.code == 2 && ran.err.contains("--device"), "{}", ran.err);
}

/// Runs the command that stands behind a word in the output of `setup`, for a moment.
fn suggested(dir: &Path, said: &str, word: &str) -> Ran {
    let line = said.lines().find_map(|line| line.trim_start().strip_prefix(word));
    let line = line.unwrap_or_else(|| panic!("no {word} in {said}"));
    let line = line.trim().trim_start_matches("asperity ").replace('"', "").replace("--page ", "");
    run_line(dir, &format!("{line} --seconds 1"))
}

/// `tone` and `run` had to be told the gain again that `setup` had just written down.
#[test]
fn commands_that_setup_prints_play_at_once() {
    let dir = &*shared_stage();
    std::fs::copy(harness::graphs("actuators/hapcoil_one.ron"), dir.join("mine.ron")).unwrap();
    for (n, (actuator, amplifier)) in [
        ("hapcoil_one --handle-mass-g 100", "--volts-at-full-scale 1 --amps-per-volt 1"),
        ("haptuator_mark_ii --handle-mass-g 60", "--volts-at-full-scale 1.4 --amps-per-volt 0.5"),
        ("mine.ron --handle-mass-g 90", "--volts-at-full-scale 2 --volts-per-volt 3"),
    ]
    .into_iter()
    .enumerate()
    {
        let more = if n == 0 { "" } else { "--overwrite" };
        let ran = setup(dir, &format!("--device {CARD} --channel 1 --profile {actuator} {amplifier} {more}"));
        let said = ran.ok().out;
        suggested(dir, &said, "play:").ok();
        // A voltage amplifier needs another graph than that of a tone, which is in A.
        if amplifier.contains("amps") {
            suggested(dir, &said, "find it:").ok().says(&["A peak on channel 1"]);
        }
    }
    // The error of a graph that says otherwise has every option that is needed.
    let live = format!("run graphs/live.ron --device {CARD} --machine machine.ron --seconds 1");
    let refused = run_line(dir, &live);
    let options = refused.err.lines().find(|line| line.contains("to follow ")).expect("the options");
    let options = &options[options.find(" --set").expect("an option")..];
    assert_eq!(options.matches("--set").count(), 7, "{options}");
    run_line(dir, &format!("{live}{options}")).ok();
}

#[test]
fn machine_file_that_is_wrong_stops_everything() {
    let dir = &*shared_stage();
    let entry =
        r#"(device: "x", channel: 1, profile: "hapcoil_one", handle_mass_g: 100, volts_at_full_scale: 1"#;
    for (text, told) in [
        ("Machine(version: 2, outputs: [])".to_owned(), "version"),
        (format!("Machine(version: 1, outputs: [{entry})])"), "amplifier"),
        (format!("Machine(version: 1, outputs: [{entry}, amps_per_volt: 1, gain: 2)])"), "gain"),
        (
            format!("Machine(version: 1, outputs: [{entry}, amps_per_volt: 1), {entry}, amps_per_volt: 2)])"),
            "twice",
        ),
    ] {
        std::fs::write(dir.join("machine.ron"), text).unwrap();
        let ran = play(dir, &square("", ""));
        assert!(
            ran.code == 2 && ran.err.contains(told) && ran.err.contains("machine.ron"),
            "{told}: {}",
            ran.err
        );
    }
}
