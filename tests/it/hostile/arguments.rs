//! Absurd values of every option of every command.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt;
use std::process::Command;

use harness::{asperity, graphs, root};

use super::judge::{Tally, times, two_at_a_time};

/// Commands with arguments that are right, so that what is wrong is the one that is added.
fn commands() -> Vec<Vec<String>> {
    let graph = graphs("heravi2024.ron").display().to_string();
    let scene = graphs("scenes/side_by_side.ron").display().to_string();
    let vector = root().join("tests/data/phase/texture_2500.mag.npy").display().to_string();
    let library = graphs("models/surfaces/materials.ron").display().to_string();
    let results = root().join("graphs/tradeoffs/results.json").display().to_string();
    let card = "simulated:frames=256";
    let all: [&[&str]; 12] = [
        &["check", &graph],
        &["render", &graph, "--seconds", "0.05"],
        &["graph", &graph, "--svg", "g.svg"],
        &["run", &graph, "--seconds", "0.1", "--device", card],
        &["tone", "--seconds", "0.1", "--device", card],
        &["invert", "--magnitudes", &vector, "--rate", "2500", "--out", "o.npy"],
        &["choose", &results],
        &["materials", "--library", &library],
        &["scene", "expand", &scene],
        &["scene", "explain", &scene],
        &["nodes"],
        &["devices"],
    ];
    all.iter().map(|words| words.iter().map(|w| (*w).to_owned()).collect()).collect()
}

fn values() -> Vec<OsString> {
    let mut all: Vec<OsString> = [
        "",
        "-1",
        "0",
        "NaN",
        "inf",
        "1e308",
        "-1e308",
        "18446744073709551615",
        "x",
        "a=b",
        "..",
        "/",
        "a\nb",
        "\u{202e}b",
        "=",
        "1:2:3",
        "%s%n",
        "../../../../../../etc/passwd",
    ]
    .map(OsString::from)
    .into();
    all.push("9".repeat(60_000).into());
    all.push(OsStr::from_bytes(b"\xff\xfe").to_owned());
    all
}

/// Options of a command that take a value, as its help says.
fn options(command: &[String]) -> Vec<String> {
    let words: Vec<&String> =
        command.iter().take_while(|w| w.chars().all(|c| c.is_ascii_lowercase())).collect();
    let out =
        Command::new(env!("CARGO_BIN_EXE_asperity")).args(words).arg("--help").output().expect("it starts");
    let text = String::from_utf8(out.stdout).expect("text");
    let mut all: Vec<String> = text
        .lines()
        .filter_map(|line| {
            let at = line.find("--")?;
            let (name, value) = line[at..].split_once([' ', '['])?;
            (line[..at].trim().trim_end_matches(',').len() <= 2 && value.contains('<'))
                .then(|| name.to_owned())
        })
        .collect();
    all.dedup();
    all
}

#[test]
fn absurd_option_is_refused_or_taken_and_does_no_harm() {
    let tally = Tally::new("absurd arguments");
    let mut cases = Vec::new();
    for command in commands() {
        let options = options(&command);
        assert!(!options.is_empty(), "{command:?} has no options?");
        for option in options.iter().filter(|o| *o != "--memory") {
            // A run that does not end by itself is no case of this.
            let timed = ["run", "tone", "render"].contains(&command[0].as_str()) && option == "--seconds";
            let fits = |v: &OsString| !timed || v != "18446744073709551615";
            cases.extend(
                values().into_iter().filter(fits).map(|value| (command.clone(), option.clone(), value)),
            );
        }
    }
    // Every third: an option meets some values, and its neighbour the others.
    let cases: Vec<_> = cases.into_iter().step_by(if times() > 1 { 1 } else { 3 }).collect();
    two_at_a_time(cases.len() as u64, |number| {
        let (command, option, value) = &cases[number as usize];
        let dir = tempfile::tempdir().expect("a folder");
        let mut program = asperity(dir.path());
        let at = command.iter().position(|word| word == option);
        // An option that is there already gets the other value.
        let rest = at.map_or(command.clone(), |at| [&command[..at], &command[at + 2..]].concat());
        program.args(rest).arg(option).arg(value);
        tally.case(&format!("{} {option} {number}", command[0]), dir, program, &[]);
    });
    tally.done();
}
