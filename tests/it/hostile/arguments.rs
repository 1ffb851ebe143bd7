//! Absurd values of every option of every command.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt;
use std::process::Command;

use harness::{Room, asperity, graphs, root};

use super::judge::{Tally, times, two_at_a_time};

/// Commands with arguments that are right, so that what is wrong is the one that is added.
fn commands() -> Vec<Vec<String>> {
    let root = root();
    let (root, data) = (root.display(), root.join("tests/data"));
    let data = data.display();
    let library = graphs("models/surfaces/materials.ron").display().to_string();
    [
        format!("check {data}/small.ron"),
        format!("render {data}/small.ron --seconds 0.05"),
        format!("graph {data}/small.ron --svg g.svg"),
        format!("run {data}/small.ron --seconds 0.1 --device simulated:frames=256"),
        "tone --seconds 0.1 --device simulated:frames=256".to_owned(),
        format!("invert --magnitudes {data}/phase/texture_2500.mag.npy --rate 2500 --out o.npy"),
        format!("choose {root}/graphs/tradeoffs/results.json"),
        format!("materials --library {library}"),
        format!("scene expand {data}/near.ron"),
        format!("scene explain {data}/near.ron"),
        "nodes".to_owned(),
        "devices".to_owned(),
    ]
    .map(|line| line.split(' ').map(str::to_owned).collect())
    .into()
}

fn values() -> Vec<OsString> {
    let words = "|-1|0|NaN|inf|1e308|-1e308|18446744073709551615|x|a=b|..|/|a\nb|\u{202e}b|=|1:2:3|%s%n|\
                 ../../../../../../etc/passwd";
    let mut all: Vec<OsString> = words.split('|').map(OsString::from).collect();
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
        let dir = Room::new();
        let mut program = asperity(&dir);
        let at = command.iter().position(|word| word == option);
        // An option that is there already gets the other value.
        let rest = at.map_or(command.clone(), |at| [&command[..at], &command[at + 2..]].concat());
        program.args(rest).arg(option).arg(value);
        tally.case(&format!("{} {option} {number}", command[0]), dir, program, &[]);
    });
    tally.done();
}
