//! The paper's study, answered by simulated people in a browser, with a recorded stroke as the hand and a
//! simulated card.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::time::{Duration, Instant};

use asperity_diagnostics::Source;
use asperity_study::log::{self, Event};
use asperity_study::{Answer, Experiment};
use harness::alone::real_time;
use harness::chromium::Chromium;
use harness::{Room, csv};
use serde_json::Value;

use crate::study::Running;
use crate::study_screens::{settled, state, types};

/// The file of the study.
const STUDY: &str = "graphs/studies/heravi2024.ron";
/// Longest time of a session.
const PATIENCE: Duration = Duration::from_secs(600);

/// Names that a participant's browser must not have.
fn hidden(experiment: &Experiment) -> Vec<String> {
    let stimuli = experiment.stimuli.iter().map(|stimulus| stimulus.name.clone());
    let levels = experiment.factors.iter().flat_map(|factor| factor.levels.clone());
    let files = [".ron", "live", "fitted", "materials"].map(str::to_owned);
    // "New" is a word of the language, too.
    stimuli.chain(levels).chain(files).filter(|name| name.len() > 3 || name == "AR").collect()
}

/// All that a page shows, asked for and keeps.
const ALL: &str = "fetch('/state?seen=0' + location.search.replace('?', '&')) \
    .then((all) => all.text()).then((text) => \
    [document.documentElement.outerHTML, text, document.title, JSON.stringify({ ...localStorage }), \
     JSON.stringify({ ...sessionStorage }), \
     ...performance.getEntries().map(({ name }) => name)].join('\\n'))";

/// Answers of a simulated person: of each trial by its number, and of the survey.
fn answers_of(events: &[Event], trial: Option<usize>) -> Vec<(String, Answer)> {
    let of = |event: &Event| match (event, trial) {
        (Event::Answered { trial: of, answers, .. }, Some(trial)) if *of == trial => Some(answers.clone()),
        (Event::Survey { answers }, None) => Some(answers.clone()),
        _ => None,
    };
    events.iter().find_map(of).unwrap_or_default()
}

/// Keys of the left hand that give these answers.
fn keys(answers: &[(String, Answer)], places: &[&str]) -> String {
    let key = |(_, answer): &(String, Answer)| match answer {
        Answer::Number(n) => n.to_string(),
        Answer::Stimulus(name) => {
            (1 + places.iter().position(|there| there == name).expect("it was shown")).to_string()
        }
        Answer::Text(_) => "felt".to_owned(),
        other => panic!("no question asks for {other:?}"),
    };
    answers.iter().map(|one| format!("{}\t", key(one))).collect()
}

/// Lets a person answer a whole session by keys, and the experimenter mount samples. Answers how many trials.
fn session(dir: &Path, experiment: &Experiment, number: u32, pages: &mut [Chromium; 2]) -> usize {
    let person = experiment.person.session(experiment, number, 5);
    let trials = experiment.trials(number);
    let code = format!("P{number:02}");
    let line =
        ["study", "run", STUDY, "--participant", &code, "--out", "out", "--device", "simulated:frames=256"];
    let mut running = Running::line(dir, &[&line[..], &["--input", "stroke.csv", "--loop"]].concat());
    let path = dir.join(format!("out/{code}.jsonl"));
    let hidden = hidden(experiment);
    let [page, desk] = pages;
    page.open(running.screens[0].rsplit(' ').next().expect("an address"));
    desk.open(running.screens[1].rsplit(' ').next().expect("an address"));
    let (began, mut states) = (Instant::now(), Vec::new());
    loop {
        assert!(began.elapsed() < PATIENCE, "it never ends: {states:?}");
        settled(page);
        let now = state(page);
        let all = page.eval(ALL);
        let shown = all.as_str().expect("a text");
        let name = hidden.iter().find(|name| shown.contains(name.as_str()));
        assert_eq!(name, None, "in the participant's browser: {shown}");
        states.push(now.clone());
        match now.as_str() {
            "end" => break,
            "wait" => {
                desk.until("!document.querySelector('#ready').disabled");
                types(desk, "r");
                page.until("document.body.dataset.state !== 'wait'");
                continue;
            }
            _ => {}
        }
        let events = log::read(&path).expect("a log");
        let trial = events.iter().rev().find_map(|event| match event {
            Event::Shown { trial, .. } => Some(*trial),
            _ => None,
        });
        let answers = match (now.as_str(), trial) {
            ("survey", _) => answers_of(&person.events, None),
            ("explore", Some(trial)) => answers_of(&person.events, Some(trial)),
            _ => Vec::new(),
        };
        let places = trial.map(|trial| trials[trial].places.clone()).unwrap_or_default();
        let places: Vec<&str> = places.iter().map(|at| experiment.stimuli[*at].name.as_str()).collect();
        types(page, &format!("{} ", keys(&answers, &places)));
    }
    assert_eq!(running.live.end().code, 0);
    for state in ["welcome", "instructions", "break", "wait", "reference", "explore", "survey"] {
        assert!(states.iter().any(|shown| shown == state), "no {state}: {states:?}");
    }
    // The log has what the person answered: nothing is turned, lost or asked twice.
    let events = log::read(&path).expect("a log");
    for trial in 0..trials.len() {
        assert_eq!(
            answers_of(&events, Some(trial)),
            answers_of(&person.events, Some(trial)),
            "trial {trial}"
        );
    }
    assert_eq!(answers_of(&events, None).len(), experiment.survey.len());
    assert_eq!(events.last(), Some(&Event::End));
    assert_eq!((page.complaints(), desk.complaints()), (Vec::new(), Vec::new()));
    trials.len()
}

#[test]
fn papers_study_is_answered_in_a_browser() {
    let _alone = real_time();
    let people = std::env::var("ASPERITY_LONG_STUDY").ok().and_then(|n| n.parse().ok()).unwrap_or(1);
    let (Some(page), Some(desk)) = (Chromium::start(), Chromium::start()) else { return };
    let mut pages = [page, desk];
    let dir = Room::new();
    // Two seconds on each side; the stylus is in the air between.
    let at = |t: f64| {
        let side = if t % 4.0 < 2.0 { -1.0 } else { 1.0 };
        [side * 20.0 + 8.0 * (9.0 * t).sin(), 0.0, if t % 2.0 < 1.6 { -1.0 } else { 4.0 }]
    };
    dir.write("stroke.csv", csv(8.0, at));
    let text = std::fs::read_to_string(harness::root().join(STUDY)).expect("the study");
    let experiment = Experiment::parse(&Source::new(STUDY, &text)).expect("a study");
    for number in 1..=people {
        let began = Instant::now();
        let trials = session(&dir, &experiment, number, &mut pages);
        println!("participant {number}: {trials} trials in {:.0} s", began.elapsed().as_secs_f64());
    }
    dir.run("study analyse out").ok();
    let report = std::fs::read_to_string(dir.join("out/REPORT.md")).expect("a report");
    for part in &experiment.parts {
        assert!(report.contains(&part.name), "{}: {report}", part.name);
    }
    let analysis = dir.json("out/analysis.json");
    assert_eq!(analysis["participants"].as_array().map(Vec::len), Some(people as usize), "{analysis}");
    // A busy machine spoils trials, which come again.
    let spoilt = analysis["excluded"].as_array().expect("trials");
    let late =
        |trial: &Value| trial["why"].as_str().is_some_and(|why| why.ends_with("deadlines were missed"));
    assert!(spoilt.iter().all(late), "{spoilt:?}");
    if let Ok(kept) = std::env::var("ASPERITY_KEEP_STUDY") {
        let copied = std::process::Command::new("cp").arg("-r").arg(dir.join("out")).arg(kept).status();
        assert!(copied.is_ok_and(|status| status.success()));
    }
}
