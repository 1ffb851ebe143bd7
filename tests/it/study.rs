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
    dir.write("s.ron", study("", RATE).replacen("graphs/texture.ron", "gone.ron", 1));
    dir.run("study check s.ron")
        .refused("gone.ron: error: cannot read")
        .says(&["for the stimulus `oak` at s.ron:3:"]);
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

/// A new user wrote such a study from the docs. What misled is here.
#[test]
fn just_noticeable_difference_has_a_right_answer() {
    let dir = Room::new();
    let text = std::fs::read_to_string(graphs("studies/jnd.ron")).unwrap();
    assert!(text.lines().filter(|line| !line.starts_with("//")).count() <= 36);
    let checked = dir.run("study check graphs/studies/jnd.ron").ok().says(&["up to 120 trials", "0.05 to 1"]);
    // The reference is among the stimuli shown, and has one line of each condition.
    assert_eq!(checked.out.lines().filter(|line| line.contains(" noise  ")).count(), 2, "{}", checked.out);
    assert!(!checked.err.contains("level matching takes"), "{}", checked.err);
    let found = dir.run("study simulate graphs/studies/jnd.ron --runs 4 --out out --json").json();
    let thresholds = found["thresholds"].as_array().unwrap();
    assert_eq!(thresholds.len(), 2);
    for one in thresholds {
        let mean = one["mean"].as_f64().unwrap();
        assert!((mean - 0.4).abs() < 0.06 && one["without"] == 0.0, "{one}");
    }
    dir.run("study analyse out").ok();
    let report = std::fs::read_to_string(dir.join("out/REPORT.md")).unwrap();
    assert!(report.contains("The threshold has 80.3 % hits.") && !report.contains("PSE"), "{report}");
    // An error of the varied parameter points at it, not at the stimulus.
    let own = text.replace("\"blend.ron\"", "\"graphs/studies/blend.ron\"");
    for (from, to, says) in [
        ("set: \"blend.gain\"", "set: \"blend.gian\"", "`gain` has no parameter `gian`"),
        ("set: \"blend.gain\"", "set: \"scatter.seed\"", "expected"),
    ] {
        let text = own.replace(from, to);
        dir.write("s.ron", &text);
        let at = text.lines().position(|line| line.contains(to)).unwrap() + 1;
        dir.run("study check s.ron").refused(says).says(&[&format!("s.ron:{at}:")]);
    }
    dir.write("s.ron", own.replace("threshold: 0.4, slope", "threshold: -0.4, slope"));
    dir.run("study simulate s.ron --runs 1").refused("`threshold` is -0.4");
    let other = own.replace("threshold: 0.4, slope: 3, guess: 0.5", "threshold: 4, slope: 3, guess: 0");
    dir.write("s.ron", other);
    dir.run("study simulate s.ron --runs 1")
        .ok()
        .says(&["the threshold of `person` is 4", "guesses with the probability 0,"]);
}

#[test]
fn study_of_the_docs_runs_and_its_pictures_are_fresh() {
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
    // Its picture, and those of the paper's study, are as the docs show them.
    dir.run("study simulate graphs/studies/heravi2024.ron --runs 1 --out paper").ok();
    dir.run("study analyse paper").ok();
    for (drawn, shown) in [
        ("out/pictures/1-1-stronger-functions.svg", "studies_functions.svg"),
        ("paper/pictures/2-1-similarity-boxes.svg", "studies_boxes.svg"),
        ("paper/pictures/3-1-closer-shares.svg", "studies_shares.svg"),
        ("paper/pictures/4-1-rough-boxes.svg", "studies_adjective.svg"),
        ("paper/pictures/5-1-similarity-matrix-1.svg", "studies_matrix.svg"),
    ] {
        std::fs::copy(dir.join(drawn), dir.join(shown)).unwrap();
        crate::pictures::is_fresh(&dir, shown);
    }
}

/// A tone that a stylus on a surface lets through, as an acceleration.
fn tone(m_s2: f64, hz: f64) -> String {
    format!(
        "Graph(version: 1, tick_hz: 500, audio_hz: 48000, nodes: {{
            \"stylus\": (kind: \"stroke\"),
            \"tone\": (kind: \"sine\", params: (unit: \"m/s^2\", amplitude: {m_s2:?}, frequency_hz: {hz:?})),
            \"inverse\": (kind: \"actuator_inverse\"),
            \"limiter\": (kind: \"limiter\"),
            \"out\": (kind: \"audio_out\"),
        }}, wires: [(\"tone\", \"inverse\"), (\"inverse\", \"limiter\"), (\"limiter\", \"out\")])"
    )
}

/// A study of two tones, `loud.ron` and `soft.ron`.
fn tones(fields: &str, part: &str) -> String {
    study(fields, part)
        .replace(", set: {\"texture.material\": \"oak\"}", "")
        .replace(", set: {\"texture.material\": \"needle felt\"}", "")
        .replacen("graphs/texture.ron", "loud.ron", 1)
        .replacen("graphs/texture.ron", "soft.ron", 1)
}

/// Gains in dB that `study check` tells, in the order of `show`.
fn gains(dir: &Room) -> Vec<Vec<f64>> {
    let told = dir.run("study check s.ron --json").json();
    let all = told["gains"].as_array().unwrap();
    let of = |row: &serde_json::Value| {
        row["gains"].as_array().unwrap().iter().map(|g| g["gain_db"].as_f64().unwrap()).collect()
    };
    all.iter().map(of).collect()
}

/// Root mean square of a graph's acceleration in contact, 0.2 s after its beginning.
fn rms_in_contact(dir: &Room, material: &str, gain: f64) -> f64 {
    let set = [format!("texture.material={material}"), format!("strength.gain={gain}")];
    let probes = ["strength.out=a.npy", "stylus.position=p.npy"];
    let [a, b] = probes.map(|probe| ["--probe", probe]);
    let line = ["render", "graphs/texture.ron", "--out", "o.wav", "--set", &set[0], "--set", &set[1]];
    harness::run(dir, &[&line[..], &a, &b].concat()).ok();
    let read = |file: &str| asperity_accuracy::npy::read(dir.join(file)).unwrap().values.into_f64();
    let (signal, place) = (read("a.npy"), read("p.npy"));
    let mut since = 0;
    let (mut sum, mut count) = (0.0, 0);
    for (tick, samples) in signal.chunks(96).enumerate() {
        since = if place[3 * tick + 2] < 0.0 { since + 1 } else { 0 };
        if since > 100 {
            sum += samples.iter().map(|x| x * x).sum::<f64>();
            count += samples.len();
        }
    }
    (sum / f64::from(count as u32)).sqrt()
}

#[test]
fn matched_textures_have_equal_levels_in_contact() {
    let dir = Room::new();
    dir.write("s.ron", study("", &format!("{RATE} level: rms")));
    let gains = gains(&dir);
    let [oak, felt] = [gains[0][0], gains[1][0]];
    assert!(oak.max(felt).abs() < 1e-9 && oak.min(felt) < -1.0, "the weakest stays: {oak} and {felt} dB");
    let matched = |material, db: f64| rms_in_contact(&dir, material, 0.2 * 10f64.powf(db / 20.0));
    let (oak, felt) = (matched("oak", oak), matched("needle felt", felt));
    let db = 20.0 * (oak / felt).log10();
    assert!(db.abs() < 0.1, "{oak} and {felt} m/s^2 lie {db} dB apart");
    dir.run("study check s.ron").ok().says(&["gains over zigzag.csv", "oak", " dB"]);
}

#[test]
fn tones_12_db_apart_are_matched_at_every_level() {
    let dir = Room::new();
    dir.write("loud.ron", tone(2.0, 120.0));
    dir.write("soft.ron", tone(0.5, 120.0));
    dir.write("s.ron", tones("", &format!("{RATE} level: rms")));
    let near = |found: &[f64], wanted: &[f64]| {
        assert_eq!(found.len(), wanted.len());
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 0.01), "{found:?}, not {wanted:?}");
    };
    let all = gains(&dir);
    near(&all[0], &[-12.041]);
    near(&all[1], &[0.0]);
    let vary = "ask: [which(name: \"w\", text: \"?\")], level: rms, vary: (stimulus: \"oak\", \
                set: \"tone.amplitude\", by: constant(levels: [1, 0.25, 2], each: 2))";
    dir.write("s.ron", tones("", vary));
    let all = gains(&dir);
    near(&all[0], &[0.0, -12.041, -18.062]);
    near(&all[1], &[-6.021]);
    let ran = dir.run("study check s.ron").ok();
    ran.says(&["level matching takes 18 dB from the varied parameter of `oak`"]);
    // A tone of 250 Hz is felt far more easily than one of 40 Hz of the same acceleration.
    dir.write("loud.ron", tone(1.0, 250.0));
    dir.write("soft.ron", tone(1.0, 40.0));
    dir.write("s.ron", tones("", &format!("{RATE} level: perceptual")));
    let threshold = |hz: f64| {
        let rise = 62.0 * ((hz / 550.0 + 6.0 / 11.0).log10() / (6f64 / 11.0).log10()).powi(2);
        0.03 * 10f64.powf(rise / 20.0) * (std::f64::consts::TAU * hz).powi(2)
    };
    let wanted = -20.0 * (threshold(40.0) / threshold(250.0)).log10();
    let all = gains(&dir);
    println!("{all:?} wanted {wanted}");
    assert!(wanted < -1.0 && (all[0][0] - wanted).abs() < 0.3, "{} dB, not {wanted}", all[0][0]);
}

#[test]
fn levels_that_cannot_be_matched_are_refused() {
    let dir = Room::new();
    dir.write("loud.ron", tone(2.0, 120.0));
    dir.write("soft.ron", tone(0.0, 120.0));
    dir.write("s.ron", tones("", &format!("{RATE} level: rms")));
    dir.run("study check s.ron").refused("a silent stimulus has no level to match").says(&["s.ron:4:"]);
    dir.write(
        "soft.ron",
        tone(1.0, 120.0).replace("m/s^2", "A").replace("(\"tone\", \"inverse\"), (\"inverse\"", "(\"tone\""),
    );
    dir.run("study check s.ron").refused("is a signal in A, and another one in m/s^2").says(&["s.ron:4:"]);
    dir.write("s.ron", tones("", &format!("{RATE} level: perceptual")));
    dir.run("study check s.ron").refused("the perceptual level needs an acceleration").says(&["s.ron:4:"]);
    dir.write("s.ron", tones("stroke: \"none.csv\",", &format!("{RATE} level: rms")));
    dir.run("study check s.ron").refused("there is no file none.csv").says(&["s.ron:1:"]);
    dir.write("air.csv", harness::csv(1.0, |t| [10.0 * t, 0.0, 5.0]));
    dir.write("s.ron", tones("stroke: \"air.csv\",", &format!("{RATE} level: rms")));
    dir.run("study check s.ron").refused("the stylus touches for less than 0.2 s").says(&["air.csv"]);
}

#[test]
fn stimulus_that_records_is_refused() {
    let dir = Room::new();
    let records =
        tone(2.0, 120.0).replace("\"inverse\": (", "\"mic\": (kind: \"audio_in\"),\n\"inverse\": (");
    dir.write("loud.ron", records);
    dir.write("soft.ron", tone(0.5, 120.0));
    dir.write("s.ron", tones("", RATE));
    dir.run("study check s.ron")
        .refused("a stimulus cannot record, as `mic` (audio_in) does")
        .says(&["s.ron:3:"]);
}

#[test]
fn simulated_and_copied_answers_never_join_others() {
    let dir = Room::new();
    dir.write("s.ron", study("", RATE));
    dir.run("study simulate s.ron --runs 1 --out out").ok();
    let run = "study run s.ron --participant P09 --out out --device simulated --input stroke.csv";
    dir.write("stroke.csv", harness::csv(1.0, |t| [10.0 * t, 0.0, 5.0]));
    dir.run(run).refused("answers of simulated people").says(&["take another folder"]);
    assert!(!dir.join("out/P09.jsonl").exists());
    // A session that never began has an empty log.
    dir.write("out/P77.jsonl", "");
    dir.run("study analyse out").ok().says(&["8 participants"]);
    let log = std::fs::read_to_string(dir.join("out/P03.jsonl")).unwrap();
    dir.write("out/P03 (copy).jsonl", &log);
    dir.run("study analyse out").refused("two logs are of participant P03");
    dir.write("out/P03 (copy).jsonl", log.replace("\"P03\"", "\"Q3\""));
    let ran = dir.run("study analyse out").ok();
    assert!(ran.err.contains("Q3 and P03 have the number 3"), "{}", ran.err);
}

#[test]
fn masking_that_the_limits_hold_back_is_refused() {
    let dir = Room::new();
    dir.write("loud.ron", tone(2.0, 120.0));
    dir.write("soft.ron", tone(0.5, 120.0));
    for colour in ["white", "pink"] {
        for dbfs in [-12.0, -30.0] {
            let masking = format!("masking: {colour}(dbfs: {dbfs}, channels: [2, 3]),");
            dir.write("s.ron", tones(&masking, RATE));
            let ran = dir.run("study check s.ron").ok();
            assert!(!ran.err.contains("masking"), "{}", ran.err);
        }
    }
    // A channel of the stimuli, and one that the card lacks.
    dir.write("s.ron", tones("masking: white(dbfs: -30, channels: [1]),", RATE));
    let run = "study run s.ron --participant P1 --input graphs/trajectories/zigzag.csv";
    dir.run(&format!("{run} --device simulated")).refused("channel 1 plays the stimuli").says(&["s.ron:1:"]);
    dir.write("s.ron", tones("masking: white(dbfs: -30, channels: [3]),", RATE));
    // The file was corrected, and nobody has taken part: the same folder will do.
    dir.run(&format!("{run} --device simulated"))
        .refused("no output channel 3")
        .says(&["s.ron:1:", "1 to 2"]);
    let strong = "\"audio_out\", params: (volts_at_full_scale: 30.0)";
    dir.write("loud.ron", tone(2.0, 120.0).replace("\"audio_out\"", strong));
    dir.write("soft.ron", tone(2.0, 120.0).replace("\"audio_out\"", strong));
    dir.write("s.ron", tones("masking: white(dbfs: -12, channels: [2]),", RATE));
    dir.run("study check s.ron").refused("the actuator's limits hold this noise back").says(&["s.ron:1:"]);
}

#[test]
fn clip_is_checked_like_a_graph() {
    let dir = Room::new();
    let clip = |fields: &str| {
        study("", RATE).replace(
            "graph(file: \"graphs/texture.ron\", set: {\"texture.material\": \"oak\"})",
            &format!("clip(file: \"a.wav\"{fields})"),
        )
    };
    dir.write("s.ron", clip(""));
    dir.run("study check s.ron").refused("a.wav").says(&["s.ron:3:"]);
    dir.write("a.wav", "no sound");
    dir.run("study check s.ron").refused("not a WAV file").says(&["a.wav", "for the stimulus `oak`"]);
    dir.run("render graphs/texture.ron --out a.wav --format i16 --seconds 3").ok();
    dir.run("study check s.ron").refused("does not say its acceleration").says(&["s.ron:3:"]);
    dir.write("s.ron", clip(", full_scale_m_s2: 1e9"));
    dir.run("study check s.ron").refused("out of range").says(&["s.ron:3:"]);
    let matched = |fields: &str| clip(fields).replace("name: \"rating\",", "name: \"rating\", level: rms,");
    dir.write("s.ron", matched(", full_scale_m_s2: 20, loop: true"));
    let told = gains(&dir);
    assert_eq!(told.len(), 2, "a clip has a level, too: {told:?}");
}
