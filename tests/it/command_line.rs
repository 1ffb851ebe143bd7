//! The command line itself: help, version, completions, manual pages, the standard input and output, and
//! errors of paths and names.

use std::io::Write as _;
use std::process::Stdio;

use harness::{Ran, Room, asperity, csv, files, graphs};

/// Runs the program with a standard input, and answers its standard output as bytes beside the rest.
fn piped(dir: &Room, line: &str, input: &[u8]) -> (Ran, Vec<u8>) {
    let mut command = asperity(dir);
    command.args(line.split_whitespace()).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program starts");
    let mut to = child.stdin.take().expect("a pipe");
    let input = input.to_owned();
    let writer = std::thread::spawn(move || to.write_all(&input));
    let output = child.wait_with_output().expect("it ends");
    // A program that needs no input may not read all of it.
    let _ = writer.join().expect("no panic");
    (Ran::of(&output), output.stdout)
}

/// A stroke on the surface, which ends where it did not begin.
fn stroke() -> String {
    csv(0.6, |t| [100.0 * t, 0.0, -1.0])
}

#[test]
fn output_in_a_missing_folder_names_the_folder() {
    let dir = Room::new();
    std::fs::create_dir(dir.join("there")).unwrap();
    for (out, missing) in [("nowhere/deep/o.wav", "nowhere"), ("there/not/o.wav", "there/not")] {
        let ran = dir.run(&format!("render graphs/texture.ron --seconds 0.1 --out {out}"));
        let make = out.trim_end_matches("/o.wav");
        ran.refused(&format!("the folder {missing} does not exist")).says(&[&format!("mkdir -p {make}")]);
    }
    assert!(files(&dir.join("there")).is_empty());
}

#[test]
fn csv_in_the_place_of_a_graph_is_recognised() {
    let dir = Room::new();
    dir.write("stroke.csv", stroke());
    dir.write("stroke", stroke());
    for name in ["stroke.csv", "stroke"] {
        dir.run(&format!("render {name} --out o.wav"))
            .refused(&format!("{name}: error: this is a CSV; did you mean `--input`?"))
            .says(&[&format!("--input {name}")]);
    }
    // The command that the error suggests works.
    dir.run("render graphs/texture.ron --input stroke.csv --out o.wav").ok();
}

#[test]
fn part_of_a_material_offers_its_whole_names() {
    let dir = Room::new();
    let ran = dir.run("check graphs/texture.ron --set texture.material=glass");
    ran.refused("no material `glass`").says(&["`float glass`", "asperity materials --library "]);
    let ran = dir.run("check graphs/texture.ron --set texture.material=wood");
    ran.refused("no material `wood`").says(&["`wood` is a family: ", "`oak`", "`beech`"]);
}

#[test]
fn number_with_a_decimal_comma_is_told_of_the_point() {
    let ran = Room::new().run("run graphs/live.ron --seconds 0,5");
    ran.refused("'0,5'").says(&["with a decimal point"]);
}

#[test]
fn render_without_an_output_says_that_nothing_was_written() {
    let dir = Room::new();
    let ran = dir.run("render graphs/texture.ron --seconds 0.1").ok();
    assert!(ran.out.contains("wrote     nothing") && ran.out.contains("--out"), "{}", ran.out);
    let ran = dir.run("render graphs/texture.ron --seconds 0.1 --out o.wav").ok();
    assert!(ran.out.contains("wrote") && !ran.out.contains("wrote     nothing"), "{}", ran.out);
}

#[test]
fn graph_comes_from_stdin_and_wav_goes_to_stdout() {
    let dir = Room::new();
    dir.write("stroke.csv", stroke());
    dir.run("render graphs/voltage_amplifier.ron --input stroke.csv --seconds 0.5 --out o.wav").ok();
    // Paths of such a graph begin where the program runs, or name shipped files.
    let graph = std::fs::read_to_string(graphs("voltage_amplifier.ron")).unwrap();
    let graph = graph.replace("\"models/", "\"graphs/models/");
    let (ran, out) = piped(&dir, "render - --input stroke.csv --seconds 0.5 --out -", graph.as_bytes());
    let ran = ran.ok();
    assert!(out == dir.bytes("o.wav"), "the same bytes as in a file");
    assert!(ran.err.contains("rendered") && ran.err.contains("the standard output"), "{}", ran.err);
    piped(&dir, "check -", graph.as_bytes()).0.ok().says(&["order", "limiter"]);
    assert_eq!(dir.files(), ["o.wav", "stroke.csv"]);
}

#[test]
fn stroke_comes_from_stdin_and_texts_go_to_stdout() {
    let dir = Room::new();
    dir.write("stroke.csv", stroke());
    let line = "render graphs/texture.ron --input";
    dir.run(&format!("{line} stroke.csv --plot p.svg --out o.wav")).ok();
    let (ran, _) = piped(&dir, &format!("{line} - --out o2.wav --report -"), stroke().as_bytes());
    assert!(ran.json()["graph"].as_str().unwrap().ends_with("texture.ron"));
    assert!(dir.bytes("o.wav") == dir.bytes("o2.wav"), "the stroke is the same");
    let (ran, out) = piped(&dir, &format!("{line} - --plot -"), stroke().as_bytes());
    assert!(ran.ok().out.contains("<svg") && out == dir.bytes("p.svg"));
    // Both at once cannot be, and an error leaves the standard output empty.
    for (line, why) in [
        ("render - --input - --out -", "cannot both be the standard input"),
        ("render graphs/texture.ron --out - --report -", "would write the same file"),
        ("render - --seconds 1 --out -", "-:1:1: error: "),
    ] {
        let (ran, out) = piped(&dir, line, b"nothing\n");
        ran.refused(why);
        assert!(out.is_empty(), "{line}");
    }
}

#[test]
fn loop_repeats_a_stroke_without_a_jump() {
    let dir = Room::new();
    dir.write("stroke.csv", stroke());
    let line = "render graphs/texture.ron --input stroke.csv --loop";
    dir.run(&format!("{line} --out o.wav")).refused("--seconds");
    dir.run(&format!("{line} --seconds 4 --probe stylus.position=p.csv --out o.wav")).ok();
    let text = dir.text("p.csv");
    let rows = text.lines().skip(1);
    let rows: Vec<Vec<f64>> = rows.map(|row| row.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 2000);
    // A lap takes 0.6 s on the surface, and 0.9 s back in the air.
    let lap = 750;
    for (i, row) in rows.iter().enumerate().skip(lap) {
        let same = row[1..].iter().zip(&rows[i - lap][1..]).all(|(a, b)| (a - b).abs() < 1e-3);
        assert!(same, "{row:?} is not {:?}", rows[i - lap]);
    }
    let step = |pair: &[Vec<f64>]| (1..4).map(|k| (pair[1][k] - pair[0][k]).abs()).fold(0.0, f64::max);
    assert!(rows.windows(2).map(step).fold(0.0, f64::max) < 0.5, "no jump at the join");
    let (samples, rate) = dir.wav("o.wav");
    let loud = |from: f64, to: f64| {
        samples[(from * f64::from(rate)) as usize..(to * f64::from(rate)) as usize].iter().any(|x| *x != 0.0)
    };
    assert!(loud(0.1, 0.6) && loud(1.6, 2.1) && loud(3.1, 3.6));
    // A stroke by rule has no end to join.
    let ran = dir.run("render graphs/voltage_amplifier.ron --loop --seconds 9");
    ran.refused("repeats a recorded stroke").says(&["duration_s"]);
}

#[test]
fn completions_are_printed_for_each_shell() {
    let dir = Room::new();
    for (shell, says) in [
        ("bash", "complete -F _asperity"),
        ("zsh", "#compdef asperity"),
        ("fish", "complete -c asperity"),
        ("powershell", "Register-ArgumentCompleter"),
        ("elvish", "edit:completion"),
    ] {
        dir.run(&format!("completions {shell}")).ok().says(&[says, "render", "overwrite"]);
    }
    dir.run("completions tcsh").refused("zsh");
}

#[test]
fn manual_pages_are_written_for_each_command() {
    let dir = Room::new();
    dir.run("man --out man/man1").ok();
    let pages = files(&dir.join("man/man1"));
    for page in ["asperity.1", "asperity-render.1", "asperity-scene-explain.1", "asperity-man.1"] {
        assert!(pages.iter().any(|name| name == page), "{page}: {pages:?}");
    }
    assert!(!pages.iter().any(|name| name.contains("cases")), "hidden commands have none: {pages:?}");
    let one = dir.run("man scene explain").ok().out;
    assert!(one.contains(".TH") && one.contains("asperity scene explain graphs/scenes/"), "{one}");
    dir.run("man rendr").refused("did you mean `render`?");
}

#[test]
fn version_says_build_and_features() {
    let said = Room::new().run("--version").ok().out;
    let is = format!("asperity {} (development build, features: ", env!("CARGO_PKG_VERSION"));
    assert!(said.starts_with(&is) && said.contains("tract"), "{said}");
}

#[test]
fn option_that_may_be_repeated_says_so() {
    let dir = Room::new();
    for (command, option) in [("render", "--set "), ("render", "--probe "), ("selftest", "--case ")] {
        let help = dir.run(&format!("{command} --help")).ok().out;
        let lines: Vec<&str> =
            help.lines().skip_while(|line| !line.trim_start().starts_with(option)).collect();
        let own: Vec<&str> =
            lines[1..].iter().take_while(|l| !l.trim_start().starts_with('-')).copied().collect();
        assert!([&lines[..1], &own[..]].concat().join(" ").contains("May be repeated"), "{option}: {help}");
    }
}

#[test]
fn nothing_to_play_on_says_what_to_do() {
    let dir = Room::new();
    dir.write("alsa.conf", "");
    let nowhere = dir.join("nowhere");
    let mut command = asperity(&dir);
    for name in ["XDG_RUNTIME_DIR", "PULSE_SERVER", "PULSE_RUNTIME_PATH", "PIPEWIRE_REMOTE"] {
        command.env(name, &nowhere);
    }
    command.env("JACK_DEFAULT_SERVER", "asperity-none").env("ALSA_CONFIG_PATH", dir.join("alsa.conf"));
    let ran = Ran::of(&command.arg("devices").output().expect("the program starts")).ok();
    ran.says(&["There is nothing to play on", "Plug in a sound card", "JACK", "--device simulated"]);
}

/// Full names of the commands that do something, each with its help.
fn commands(dir: &Room, name: &str) -> Vec<(String, String)> {
    let help = dir.run(&format!("{name} --help")).ok().out;
    let list = help.split("Commands:\n").nth(1).unwrap_or_default();
    let words = list.lines().take_while(|line| !line.is_empty()).filter(|line| !line.starts_with("   "));
    let names = words.filter_map(|line| line.split_whitespace().next()).filter(|word| *word != "help");
    let names: Vec<String> = names.map(|word| format!("{name} {word}")).collect();
    let runs = help.contains("[OPTIONS]") && (names.is_empty() || help.contains("Examples:"));
    let below = names.iter().flat_map(|name| commands(dir, name));
    below.chain(runs.then(|| (name.to_owned(), help.clone()))).collect()
}

#[test]
fn every_command_has_examples_that_it_understands() {
    let dir = Room::new();
    let all = commands(&dir, "");
    assert!(all.len() > 25, "{all:?}");
    for (name, help) in all.iter().filter(|(name, _)| !name.is_empty()) {
        let lines = help.split("Example").nth(1).unwrap_or_default().lines();
        let examples: Vec<&str> = lines.filter_map(|line| line.strip_prefix("  asperity ")).collect();
        assert!(!examples.is_empty(), "`{name}` has no example: {help}");
        for example in examples {
            let (line, _) = example.split_once(['|', '>']).unwrap_or((example, ""));
            assert!(line.starts_with(name.trim()), "{line}");
            // Options are read before the help is printed.
            dir.run(&format!("{} --help", line.replace('"', "'"))).ok();
        }
    }
}

#[test]
fn help_has_no_sentence_of_more_than_30_words() {
    let dir = Room::new();
    for (name, help) in commands(&dir, "") {
        let mut texts = vec![String::new()];
        for line in help.split("Example").next().unwrap_or_default().lines().map(str::trim) {
            if line.is_empty() || line.starts_with(['-', '<', '[']) {
                texts.push(String::new());
            }
            let last = texts.last_mut().expect("one");
            *last += " ";
            *last += line;
        }
        for sentence in texts.iter().flat_map(|text| text.split(". ")) {
            let words = sentence.split_whitespace().count();
            assert!(words <= 30, "`{name}`: {words} words: {sentence}");
        }
    }
}
