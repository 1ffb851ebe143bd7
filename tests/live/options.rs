//! Errors about options of the commands that play: they name the option, and what would fit.

use harness::alone::{beside_others, shared_stage};
use harness::live::{graph, until};
use harness::{files, graphs, run};

const CARD: &str = "simulated:frames=64,speed=10,loopback=1";

/// Values that are wrong for every number.
const ABSURD: [&str; 6] = ["-1", "1e9", "nan", "", "nope", "1,1"];

/// A command with all that it needs but the option that is tried.
struct Command {
    words: &'static [&'static str],
    needs: &'static [(&'static str, &'static str)],
    /// Options of a number; of those with a `?` 0 fits.
    numbers: &'static str,
    /// Other options, with what they may not be.
    others: &'static [(&'static str, &'static [&'static str])],
}

const CHANNEL: (&str, &[&str]) = ("--channel", &["3", "1024"]);
const FORMAT: (&str, &[&str]) = ("--device-format", &["", "nope", "f16", "f64"]);
const HOST: (&str, &[&str]) = ("--host", &["", "nope", "simulated:"]);
const DEVICE: (&str, &[&str]) = (
    "--device",
    &["nope", "simulated:nope", "simulated:speed=0", "simulated:speed=1e-300", "simulated:channels=0"],
);
const INPUT: (&str, &[&str]) = ("--input-device", &["nope", "simulated:nope", "simulated:speed=0"]);
const PROFILE: &[&str] = &["", "nope", "nope.ron", "bad.ron", "dir.ron"];

const COMMANDS: [Command; 4] = [
    Command {
        words: &["tone"],
        needs: &[("--device", CARD), ("--seconds", "0.05"), ("--handle-mass-g", "100")],
        numbers: "--channel --period --hz --amps --seconds --rate --handle-mass-g --volts-at-full-scale \
                  --amps-per-volt",
        others: &[
            CHANNEL,
            FORMAT,
            HOST,
            DEVICE,
            ("--profile", PROFILE),
            ("--hz", &["20000.1"]),
            ("--rate", &["8000", "12345"]),
            ("--clock", &["timer", ""]),
        ],
    },
    Command {
        words: &["latency"],
        needs: &[("--device", CARD), ("--trials", "3")],
        numbers: "--channel --period --input-channel --input-latency-ms? --trials --amps --level --rate \
                  --handle-mass-g --volts-at-full-scale --amps-per-volt",
        others: &[
            CHANNEL,
            FORMAT,
            HOST,
            DEVICE,
            INPUT,
            ("--input-channel", &["3", "1024"]),
            ("--profile", PROFILE),
            ("--clock", &["timer"]),
        ],
    },
    Command {
        words: &["calibrate"],
        needs: &[
            ("--device", CARD),
            ("--handle-mass-g", "60"),
            ("--accelerometer-full-scale", "100"),
            ("--out", "o.ron"),
            ("--seconds", "1"),
        ],
        numbers: "--channel --period --input-channel --handle-mass-g --second-mass-g --mass-uncertainty \
                  --accelerometer-full-scale --amps --volts --from-hz --to-hz --seconds --rate \
                  --volts-at-full-scale --amps-per-volt --volts-per-volt",
        others: &[
            CHANNEL,
            FORMAT,
            HOST,
            DEVICE,
            INPUT,
            ("--input-channel", &["3"]),
            ("--base", PROFILE),
            ("--out", &["", "no/such/o.ron", "o.txt", "dir.ron"]),
            ("--plot", &["", "no/such/p.svg", "dir.ron"]),
            ("--amps", &["1.01"]),
            ("--from-hz", &["300"]),
            ("--to-hz", &["39"]),
            ("--drive", &["nope"]),
        ],
    },
    Command {
        words: &["run", "GRAPH"],
        needs: &[("--device", CARD), ("--seconds", "0.05")],
        numbers: "--channel --period --seconds --limit-us --page?",
        others: &[
            CHANNEL,
            ("--channel", &["1,2"]),
            FORMAT,
            HOST,
            DEVICE,
            ("--clock", &["timer", "nope"]),
            ("--set", &["nope", "limiter.nope=1", "tick_hz=50", "limiter.profile=nope", "audio_hz=12345"]),
            ("--hand", &["nope", "osc:arguments=x,y,z", "osc:nope=1"]),
        ],
    },
];

/// Runs a command in a folder with files that are none, and checks how it fails.
fn refused(command: &Command, option: &str, value: &str) -> String {
    let dir = tempfile::tempdir().expect("a folder");
    std::fs::write(dir.path().join("bad.ron"), "ActuatorProfile(version: 1").expect("a file");
    std::fs::create_dir(dir.path().join("dir.ron")).expect("a folder");
    let before = files(dir.path());
    let graph = graphs("texture.ron").display().to_string();
    let mut args: Vec<&str> = command.words.iter().map(|w| if *w == "GRAPH" { &graph } else { *w }).collect();
    args.extend(command.needs.iter().filter(|(o, _)| *o != option).flat_map(|(o, v)| [*o, *v]));
    args.extend([option, value]);
    let ran = run(dir.path(), &args);
    let said = format!("{args:?}: {} {}", ran.code, ran.err);
    assert_eq!(ran.code, 2, "{said}");
    assert!(ran.err.contains(option), "the option is not named: {said}");
    assert!(!ran.err.contains("panicked"), "{said}");
    // A graph that was named may be shown, one that the command made for itself may not.
    let own = ["the tone", "the measurement", "Graph(", "kind:"];
    let shown = command.words[0] != "run" && own.iter().any(|part| ran.err.contains(part));
    assert!(!shown, "it points into a graph that nobody sees: {said}");
    assert_eq!(files(dir.path()), before, "{said}");
    ran.err
}

#[test]
fn wrong_option_is_named_and_nothing_is_played_or_written() {
    let _alone = beside_others();
    let all = |command: &Command| {
        for option in command.numbers.split_whitespace() {
            let zero = (!option.ends_with('?')).then_some("0");
            let option = option.trim_end_matches('?');
            for value in ABSURD.into_iter().chain(zero) {
                let said = refused(command, option, value);
                let range = ["from", "at most", "supplied", "one channel for each"]
                    .iter()
                    .any(|word| said.contains(word));
                assert!(range, "no range: {:?} {option} {value:?}: {said}", command.words);
            }
        }
        for (option, values) in command.others {
            for value in *values {
                refused(command, option, value);
            }
        }
    };
    std::thread::scope(|scope| COMMANDS.iter().for_each(|command| drop(scope.spawn(move || all(command)))));
}

#[test]
fn an_option_that_would_mean_nothing_is_refused() {
    let _alone = beside_others();
    let texture = graphs("texture.ron").display().to_string();
    let dir = tempfile::tempdir().expect("a folder");
    let calibrate =
        ["calibrate", "--device", CARD, "--handle-mass-g", "60", "--accelerometer-full-scale", "100"];
    let calibrate = [&calibrate[..], &["--out", "o.ron"]].concat();
    let calibrate = |more: &[&'static str]| [&calibrate[..], more].concat();
    for (args, names) in [
        (vec!["tone", "--device", CARD, "--no-reconnect"], "--no-reconnect"),
        (vec!["tone", "--device", CARD, "--input-device", CARD], "--input-device"),
        (vec!["latency", "--device", CARD, "--no-reconnect"], "--no-reconnect"),
        (vec!["latency", "--device", CARD, "--set", "limiter.profile=x"], "--set"),
        (vec!["latency", "--device", CARD, "--inside", "--input-latency-ms", "1"], "--input-latency-ms"),
        (vec!["latency", &texture, "--amps", "0.1"], "--amps"),
        (vec!["latency", &texture, "--profile", "hapcoil_one"], "--profile"),
        (vec!["latency", &texture, "--period", "64"], "--period"),
        (calibrate(&["--no-reconnect"]), "--no-reconnect"),
        (calibrate(&["--yes"]), "--second-mass-g"),
        (calibrate(&["--drive", "voltage", "--amps-per-volt", "2"]), "--amps-per-volt"),
        (calibrate(&["--drive", "voltage", "--amps", "0.1"]), "--amps"),
        (calibrate(&["--volts-per-volt", "2"]), "--volts-per-volt"),
        (calibrate(&["--volts", "2"]), "--volts"),
    ] {
        let ran = run(dir.path(), &args);
        assert!(ran.code == 2 && ran.err.contains(names), "{args:?}: {} {}", ran.code, ran.err);
        assert!(files(dir.path()).is_empty());
    }
}

#[test]
fn a_value_with_commas_in_a_hand_is_told_how_it_goes() {
    let dir = &*shared_stage();
    let live = graphs("live.ron").display().to_string();
    let ran = run(dir, &["run", &live, "--device", CARD, "--hand", "osc:address=/a,arguments=x,y,z"]);
    assert!(ran.code == 2 && ran.err.contains("--set stylus.arguments=VALUE"), "{}", ran.err);
}

#[test]
fn a_tone_is_announced_as_loud_as_it_is_played() {
    let dir = &*shared_stage();
    let tone = |amps: &str| run(dir, &["tone", "--device", CARD, "--seconds", "1", "--amps", amps]).ok().err;
    assert!(tone("0.05").starts_with("80 Hz, 0.05 A peak on channel 1 of"));
    let said = tone("50");
    let played = said.split("80 Hz, ").nth(1).and_then(|rest| rest.split(' ').next()).expect("a line");
    // The shipped HapCoil-One bears 0.6 A at any time.
    let played: f64 = played.parse().expect("a number");
    assert!(played > 0.05 && played <= 0.6 && said.contains("50 A are asked for"), "{said}");
}

#[test]
fn device_opened_twice_tells_its_limits_once() {
    let dir = &*shared_stage();
    let card = "simulated:frames=64,speed=10,plant=hapcoil_one,plant_handle_g=60,plant_noise=0.05";
    let args =
        ["--device", card, "--handle-mass-g", "60", "--accelerometer-full-scale", "100", "--seconds", "2"];
    let ran = run(dir, &[&["calibrate", "--out", "o.ron"], &args[..]].concat()).ok();
    assert_eq!(ran.err.matches("64 to 64 frames a period").count(), 1, "{}", ran.err);
}

/// A wire in place of an actuator: nothing about a mass on a spring can be found.
#[test]
fn what_was_not_found_is_said_in_words_and_not_in_percent() {
    let dir = &*shared_stage();
    let args =
        ["--device", CARD, "--handle-mass-g", "60", "--accelerometer-full-scale", "100", "--seconds", "2"];
    let ran = run(dir, &[&["calibrate", "--out", "o.ron", "--anyway"], &args[..]].concat()).ok();
    let profile = std::fs::read_to_string(dir.join("o.ron")).expect("a profile");
    assert!(ran.out.contains("not determined by this measurement"), "{}", ran.out);
    for text in [&ran.out, &profile] {
        let percents = text.split(" % only").filter_map(|t| t.rsplit(' ').next()?.parse::<f64>().ok());
        assert!(percents.clone().all(|percent| percent <= 200.0), "{text}");
    }
}

#[cfg(unix)]
#[test]
fn a_disk_that_is_full_ends_a_recording_and_not_the_run() {
    let _alone = beside_others();
    let nodes = r#""a": (kind: "file_out", params: (file: "a.npy")),
       "b": (kind: "file_out", params: (file: "b.wav")),
        "c": (kind: "probe", params: (file: "c.csv")),"#;
    let text = graph("texture.ron", nodes, r#"("limiter", "a"), ("limiter", "b"), ("limiter", "c"),"#);
    let dir = tempfile::tempdir().expect("a folder");
    std::fs::write(dir.path().join("g.ron"), text).expect("a graph");
    let args = ["run", "g.ron", "--device", "simulated:frames=64", "--seconds", "3", "--report", "r.json"];
    // Every file is limited to 200 KiB, which writes run into as into the end of a disk.
    let ran = harness::run_under(dir.path(), "trap '' XFSZ; ulimit -f 200", &args);
    // It goes on to its end, and then says that not all was recorded.
    assert_eq!(ran.code, 1, "{}", ran.err);
    let last = ran.err.lines().last().unwrap_or_default();
    for name in ["a.npy", "b.wav", "c.csv"] {
        let said =
            ran.err.lines().filter(|l| l.contains(name) && l.contains("no more of it is recorded")).count();
        assert_eq!(said, 1, "{name}: {}", ran.err);
        assert!(last.starts_with("error: ") && last.contains(&format!("{name} is not whole")), "{}", ran.err);
    }
    let report = harness::json(&dir.path().join("r.json"));
    assert!(report["ticks"].as_u64().is_some_and(|ticks| ticks >= 1500), "{report}");
    // Each holds what fitted, and is whole.
    let array = asperity_accuracy::npy::read(dir.path().join("a.npy")).expect("an array");
    assert!(array.shape[0] > 40_000 && array.shape[0] == array.values.into_f32().len());
    assert!(harness::wav(&dir.path().join("b.wav")).0.len() > 40_000);
    let text = std::fs::read_to_string(dir.path().join("c.csv")).expect("a file");
    assert!(text.ends_with('\n') && text.len() > 150_000);
    assert!(text.lines().skip(1).all(|line| line.split(',').count() == 2));
    until("nothing hidden is left", || files(dir.path()).len() == 5);
}
