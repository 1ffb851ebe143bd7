//! Studies with people: check, simulate, analyse. Nothing here plays.

use harness::{Room, files, graphs};

/// A study of two graphs with a scale and a choice.
fn study(fields: &str, part: &str) -> String {
    format!(
        "Experiment(version: 1, title: \"Oak or felt\", participants: 8, {fields}
            stimuli: {{
                \"oak\": graph(file: \"graphs/texture.ron\", set: {{\"texture.material\": \"oak\"}}),
                \"felt\": graph(file: \"graphs/texture.ron\", set: {{\"texture.material\": \"needle felt\"}}),
            }},
            parts: [(name: \"rating\", show: [(\"oak\", \"felt\")], {part})],
        )"
    )
}

const RATE: &str =
    "ask: [scale(name: \"rough\", text: \"Rough?\", from: 1, to: 7, low: \"no\", high: \"yes\")],";

#[test]
fn paper_study_has_the_papers_trials() {
    let dir = Room::new();
    let told = dir.run("study check graphs/studies/heravi2024.ron --json").json();
    let trials: Vec<u64> =
        told["parts"].as_array().unwrap().iter().map(|part| part["trials"].as_u64().unwrap()).collect();
    // Training with 12 textures, 36 pairs, 12 choices, 6 textures of 3 kinds, 4 novel ones with 6.
    assert_eq!(trials, [12, 36, 12, 18, 24]);
    assert_eq!(told["participants"], 25);
    // 12 real ones, 12 of the network, 12 autoregressive ones, 4 new ones.
    assert_eq!(told["stimuli"], 40);
    let lines = std::fs::read_to_string(graphs("studies/heravi2024.ron")).unwrap().lines().count();
    assert!(lines <= 80, "{lines} lines");
}

#[test]
fn simulated_study_is_analysed_into_a_report() {
    let dir = Room::new();
    dir.run("study simulate graphs/studies/heravi2024.ron --runs 1 --out out").ok();
    let logs = files(&dir.join("out"));
    assert_eq!(logs.len(), 26, "{logs:?}");
    let ran = dir.run("study analyse out").ok();
    ran.says(&["25 participants", "0 trials excluded", "REPORT.md"]);
    let report = std::fs::read_to_string(dir.join("out/REPORT.md")).unwrap();
    for wanted in
        ["# Virtual and real textures", "Part 2: similarity", "Friedman", "Wilcoxon", "binomial", "Survey"]
    {
        assert!(report.contains(wanted), "no {wanted} in the report");
    }
    // Every picture that the report shows is there.
    for picture in report.split("](pictures/").skip(1).filter_map(|rest| rest.split(')').next()) {
        let svg = std::fs::read_to_string(dir.join("out/pictures").join(picture)).unwrap();
        assert!(svg.starts_with("<svg"), "{picture}");
    }
    let csv = std::fs::read_to_string(dir.join("out/answers.csv")).unwrap();
    // 25 people: 36 ratings, 12 choices, 18 trials of 4 ratings, 24 ratings, 5 answers of the survey.
    assert_eq!(csv.lines().count(), 1 + 25 * (36 + 12 + 18 * 4 + 24 + 5));
    let analysis: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.join("out/analysis.json")).unwrap()).unwrap();
    assert_eq!(analysis["parts"].as_array().unwrap().len(), 5);
    // Simulated answers never join others.
    dir.run("study simulate graphs/studies/heravi2024.ron --runs 1 --out out").refused("not empty");
}

#[test]
fn hidden_reference_and_anchors_are_analysed() {
    let dir = Room::new();
    let lines = std::fs::read_to_string(graphs("studies/mushra.ron")).unwrap().lines().count();
    assert!(lines <= 40, "{lines} lines");
    // Four textures with five stimuli; the wrong one is the same for all.
    let told = dir.run("study check graphs/studies/mushra.ron --json").json();
    assert_eq!((&told["parts"][0]["trials"], &told["stimuli"]), (&8.into(), &17.into()));
    dir.run("study simulate graphs/studies/mushra.ron --runs 1 --out out").ok();
    dir.run("study analyse out").ok().says(&["20 participants"]);
    let report = std::fs::read_to_string(dir.join("out/REPORT.md")).unwrap();
    for wanted in ["BS.1534-3", "the hidden reference is fitted", "boxes.svg", "95 %"] {
        assert!(report.contains(wanted), "no {wanted} in {report}");
    }
}

#[test]
fn power_follows_the_models_difference() {
    let dir = Room::new();
    let test = format!("{RATE} tests: [wilcoxon(of: \"rough\")]");
    let text = study("person: (ratings: {\"rough\": {\"oak\": 5.5, \"felt\": 2.5}}),", &test);
    dir.write(
        "clear.ron",
        text.replace("show: [(\"oak\", \"felt\")]", "show: [\"oak\", \"felt\"], sides: right"),
    );
    dir.write(
        "none.ron",
        study("", &test).replace("show: [(\"oak\", \"felt\")]", "show: [\"oak\", \"felt\"], sides: right"),
    );
    let power = |file: &str| {
        let told = dir.run(&format!("study simulate {file} --runs 200 --json")).json();
        told["tests"][0]["power"].as_f64().unwrap()
    };
    let (clear, none) = (power("clear.ron"), power("none.ron"));
    assert!(clear > 0.85, "{clear}");
    // At most the level of significance, and three standard errors of 200 runs.
    assert!(none < 0.05 + 0.047, "{none}");
}

#[test]
fn torn_log_is_analysed_without_its_last_line() {
    let dir = Room::new();
    dir.write("s.ron", study("", &format!("{RATE} repeats: 5,")));
    dir.run("study simulate s.ron --runs 1 --out out").ok();
    let log = dir.join("out/P03.jsonl");
    let text = std::fs::read(&log).unwrap();
    std::fs::write(&log, &text[..text.len() - 30]).unwrap();
    let ran = dir.run("study analyse out").ok();
    ran.says(&["8 participants", "39 answers"]);
    std::fs::write(&log, [&text[..200], b"\n", &text[200..]].concat()).unwrap();
    dir.run("study analyse out").refused("is no event");
}

#[test]
fn bad_study_files_are_refused_with_places() {
    let dir = Room::new();
    for (fields, part, why, place) in [
        ("", "ask: [which(name: \"w\", txt: \"?\")]", "`text` is missing", "s.ron:6:"),
        ("", "order: sorted", "unknown kind `sorted`", "s.ron:6:"),
        ("participants_: 3,", RATE, "unknown field `participants_`", "s.ron:1:"),
    ] {
        dir.write("s.ron", study(fields, part));
        dir.run("study check s.ron").refused(why).says(&[place]);
    }
    dir.write("s.ron", study("", RATE).replace("texture.material\": \"oak", "texture.material\": \"oakk"));
    dir.run("study check s.ron").refused("no material `oakk`").says(&["for the stimulus `oak`", "`oak`"]);
    dir.write(
        "s.ron",
        study("", RATE).replace("\"texture.material\": \"oak\"", "\"textur.material\": \"oak\""),
    );
    dir.run("study check s.ron").refused("no node `textur`").says(&["s.ron:3:"]);
    dir.write("s.ron", study("", RATE).replace("\"texture.material\": \"oak\"", "\"tick_hz\": 1000"));
    dir.run("study check s.ron")
        .refused("`oak` runs at 1000 ticks a second")
        .says(&["at 500 ticks a second", "s.ron:3:"]);
    dir.run("study check graphs/texture.ron").refused("this is no experiment");
}

#[test]
fn unbalanced_study_says_so() {
    let dir = Room::new();
    let three = study("", &format!("{RATE} order: latin_square, repeats: 1,"));
    let three =
        three.replace("show: [(\"oak\", \"felt\")]", "show: [\"oak\", \"felt\", (\"oak\", \"felt\")]");
    dir.write("s.ron", three);
    let ran = dir.run("study check s.ron").ok();
    ran.says(&["8 participants do not fill a Latin square of 6 rows; take 6 or 12"]);
}

#[test]
fn study_of_the_docs_runs() {
    let dir = Room::new();
    let page = std::fs::read_to_string(harness::root().join("docs/studies.md")).unwrap();
    let (_, rest) = page.split_once("```ron\n").expect("a study");
    let (text, _) = rest.split_once("```").expect("its end");
    assert!(text.lines().count() <= 30, "{}", text.lines().count());
    dir.write("jnd.ron", text);
    dir.run("study check jnd.ron").ok().says(&["up to 100 trials"]);
    dir.run("study simulate jnd.ron --runs 1 --out out").ok();
    dir.run("study analyse out").ok();
    let report = std::fs::read_to_string(dir.join("out/REPORT.md")).unwrap();
    assert!(report.contains("PSE") && report.contains("JND"), "{report}");
}
