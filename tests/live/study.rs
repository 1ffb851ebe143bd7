//! `asperity study run`: sessions with presses over HTTP, a recorded hand and a simulated card.
#![cfg(target_os = "linux")]

use std::io::{Read as _, Write as _};
use std::net::{TcpStream, UdpSocket};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use asperity_study::log::{self, Event};
use harness::alone::beside_others;
use harness::chromium::Chromium;
use harness::live::{Background, Live, rows, told, until};
use harness::servers::{Jack, inside};
use harness::{Room, csv, test_name};
use rosc::{OscMessage, OscPacket, OscType};
use serde_json::{Value, json};

use crate::ear::Ear;
use crate::hands::free_port;
use crate::haply::Service;

/// Kills of a test; `ASPERITY_LONG_KILLS` asks for more.
const KILLS: usize = 12;

/// A tone of a level, as a graph with a stylus.
fn tone(amperes: f64) -> String {
    format!(
        "Graph(version: 1, tick_hz: 500, audio_hz: 48000, nodes: {{
            \"stylus\": (kind: \"stroke\"),
            \"tone\": (kind: \"sine\", params: (amplitude: {amperes:?})),
            \"limiter\": (kind: \"limiter\", params: (profile: \"hapcoil_one\", handle_mass_g: 100.0)),
            \"out\": (kind: \"audio_out\", params: (volts_at_full_scale: 1.0, amps_per_volt: 1.0)),
        }}, wires: [(\"tone\", \"limiter\"), (\"limiter\", \"out\")])"
    )
}

const STUDY: &str = r#"Experiment(version: 1, title: "Two tones", participants: 4,
    factors: {"number": ["one", "two", "three"]},
    stimuli: {
        "weak": graph(file: "weak.ron"),
        "strong": graph(file: "strong.ron"),
        "sample": real(mount: "felt {number}"),
    },
    missed: 1.0,
    parts: [
        (name: "training", instructions: "Feel.", show: ["sample"], sides: right),
        (name: "choice", over: ["number"], show: [("weak", "strong")], repeats: REPEATS,
         ask: [which(name: "stronger", text: "Which is stronger?"),
               scale(name: "sure", text: "How sure?", from: 1, to: 5, low: "no", high: "yes")]),
    ],
    survey: [scale(name: "hard", text: "Hard?", from: 1, to: 5, low: "easy", high: "hard")],
)"#;

/// A folder with two tones, a study and a stroke that touches left and right in turn.
fn folder(repeats: usize) -> Room {
    let dir = Room::new();
    dir.write("weak.ron", tone(0.02));
    dir.write("strong.ron", tone(0.05));
    dir.write("study.ron", STUDY.replace("REPEATS", &repeats.to_string()));
    // A fifth of a second on each side, and as long in the air between.
    let at = |t: f64| {
        let turn = (t / 0.2) as usize % 4;
        let x = if turn < 2 { -20.0 } else { 20.0 };
        [x, 0.0, if turn.is_multiple_of(2) { 5.0 } else { -1.0 }]
    };
    dir.write("stroke.csv", csv(3.2, at));
    dir
}

const LINE: [&str; 11] = [
    "study",
    "run",
    "study.ron",
    "--participant",
    "P02",
    "--out",
    "out",
    "--device",
    "simulated:frames=256",
    "--input",
    "stroke.csv",
];

/// The line of a session on JACK.
fn on_jack<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let jack = |arg: &&'static str| match *arg {
        "--device" => "--host",
        arg if arg.starts_with("simulated") => "jack",
        arg => arg,
    };
    LINE.iter().map(jack).chain(more.iter().copied()).collect()
}

/// A running session, and how its screens are reached.
pub(crate) struct Running {
    pub(crate) live: Live,
    pub(crate) screens: [String; 2],
}

impl Running {
    fn start(dir: &Path) -> Self {
        Self::line(dir, &[&LINE[..], &["--loop"]].concat())
    }

    pub(crate) fn line(dir: &Path, args: &[&str]) -> Self {
        let mut live = Live::command(dir, args);
        let screens = ["the participant's screen:", "the experimenter's screen:"].map(|name| live.says(name));
        Self { live, screens }
    }

    /// A request to a screen; `None` where the program is gone.
    fn request(&self, who: usize, method: &str, path: &str, body: &str) -> Option<(u16, String)> {
        let (_, rest) = self.screens[who].split_once("http://")?;
        let (host, token) = rest.split_once("/?")?;
        let mut stream = TcpStream::connect(host).ok()?;
        stream.set_read_timeout(Some(Duration::from_secs(10))).ok()?;
        let mark = if path.contains('?') { '&' } else { '?' };
        let head = format!("{method} {path}{mark}{token} HTTP/1.1\r\nHost: {host}\r\n");
        let length = format!("Content-Type: application/json\r\nContent-Length: {}\r\n\r\n", body.len());
        stream.write_all(format!("{head}{length}{body}").as_bytes()).ok()?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer).ok()?;
        let code = answer.split_whitespace().nth(1)?.parse().ok()?;
        Some((code, answer.split_once("\r\n\r\n")?.1.to_owned()))
    }

    fn screen(&self, who: usize) -> Option<Value> {
        let (code, body) = self.request(who, "GET", "/state?seen=0", "")?;
        let state: Value = (code == 200).then(|| serde_json::from_str(&body).ok()).flatten()?;
        Some(state["screen"].clone())
    }

    fn press(&self, who: usize, press: &Value) -> Option<u16> {
        self.request(who, "POST", "/press", &press.to_string()).map(|(code, _)| code)
    }

    /// Presses what the screens ask for. `None` where the program is gone.
    fn go_on(&self) -> Option<(Value, u16)> {
        let screen = self.screen(0)?;
        let token = screen["token"].clone();
        let press = match screen["state"].as_str()? {
            "wait" => return Some((screen, self.press(1, &json!({ "press": "ready", "token": token }))?)),
            _ => match screen["questions"].as_array()?.as_slice() {
                [] => json!({ "press": "next", "token": token }),
                questions => {
                    let answer = |q: &Value| if q["kind"] == "which" { json!(1) } else { json!(4) };
                    let answers: Vec<Value> = questions.iter().map(answer).collect();
                    json!({ "press": "answer", "token": token, "answers": answers })
                }
            },
        };
        let code = self.press(0, &press)?;
        Some((screen, code))
    }
}

/// A session whose first stimulus is felt.
fn feels(dir: &Path) -> Running {
    let running = Running::start(dir);
    assert_eq!(running.go_on().expect("it runs").1, 204);
    until("a stimulus", || !places(dir).is_empty());
    running
}

fn events(dir: &Path) -> Vec<Event> {
    log::read(&dir.join("out/P02.jsonl")).unwrap_or_else(|e| panic!("{e}"))
}

fn answered(events: &[Event]) -> Vec<usize> {
    let number = |event: &Event| match event {
        Event::Answered { trial, .. } => Some(*trial),
        _ => None,
    };
    events.iter().filter_map(number).collect()
}

#[test]
fn session_logs_every_trial_with_its_stimuli() {
    let _lock = beside_others();
    let dir = folder(1);
    let mut running = Running::start(&dir);
    let begun = Instant::now();
    loop {
        // Each side is felt before the answer, so that both stimuli are swapped in.
        let asks = running.screen(0).is_some_and(|s| s["questions"].as_array().is_some_and(|q| q.len() == 2));
        if asks {
            let both = |trial: usize| {
                let at = |wanted| {
                    events(&dir).iter().any(|event| {
                        let Event::Stimulus { trial: of, place, .. } = event else { return false };
                        (*of, *place) == (trial, Some(wanted))
                    })
                };
                at(0) && at(1)
            };
            let next = answered(&events(&dir)).len();
            until("both sides are felt", || both(next));
        }
        let Some((screen, code)) = running.go_on() else { break };
        if screen["state"] == "end" {
            break;
        }
        assert_eq!(code, 204, "{screen}");
        let text = screen.to_string();
        assert!(
            !["weak", "strong.ron", "felt", "Two tones"].iter().any(|name| text.contains(name)),
            "{text}"
        );
        assert!(begun.elapsed() < Duration::from_secs(120), "it never ends: {screen}");
    }
    let ran = running.live.end();
    assert_eq!(ran.code, 0, "{}", ran.err);
    let events = events(&dir);
    assert_eq!(answered(&events).len(), 4);
    assert!(events.iter().any(|event| matches!(event, Event::Survey { .. })));
    assert!(!events.iter().any(|event| matches!(event, Event::Marked { .. })), "{events:?}");
    // The answer on the right is the stimulus that stood there.
    let chosen = |event: &Event| match event {
        Event::Answered { answers, .. } => answers.first().map(|(_, answer)| format!("{answer:?}")),
        _ => None,
    };
    let chosen: Vec<String> = events.iter().filter_map(chosen).collect();
    assert!(
        chosen.iter().any(|c| c.contains("weak")) && chosen.iter().any(|c| c.contains("strong")),
        "{chosen:?}"
    );
    // The hand's motion is there, tick after tick.
    let mut next = None;
    for event in &events {
        if let Event::Inputs { tick, ticks, output, .. } = event
            && output == "position"
        {
            assert!(next.is_none_or(|next| next == *tick), "from {tick}, not {next:?}");
            next = Some(tick + ticks);
        }
    }
    assert!(next.is_some_and(|ticks| ticks > 500), "{next:?}");
    dir.run("study analyse out").ok().says(&["1 participant"]);
    // The session is over, and a participant keeps the number.
    harness::run(&dir, &LINE).ok().says(&["has answered everything"]);
    harness::run(&dir, &[&LINE[..], &["--number", "3"]].concat()).refused("took part as number 2");
}

#[test]
fn kill_at_any_moment_loses_no_answered_trial() {
    let _lock = beside_others();
    let kills = std::env::var("ASPERITY_LONG_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(KILLS);
    let mut dir = folder(300);
    let mut random = asperity_numbers::Random::new(11);
    let (mut told, mut all) = (0, 0);
    for kill in 0..kills {
        let running = Running::start(&dir);
        let until = Instant::now() + Duration::from_millis(random.below(600) as u64);
        let id = running.live.id().to_string();
        let killer = std::thread::spawn(move || {
            std::thread::sleep(until.saturating_duration_since(Instant::now()));
            std::process::Command::new("kill").args(["-9", &id]).status().expect("kill");
        });
        while let Some((screen, code)) = running.go_on() {
            let answers = screen["questions"].as_array().is_some_and(|q| !q.is_empty());
            told += usize::from(code == 204 && screen["state"] == "explore");
            all += usize::from(code == 204 && answers);
        }
        killer.join().expect("no panic");
        drop(running);
        // The log is readable, and has every answer that a screen was told of, in the order of the plan.
        let events = events(&dir);
        let there = answered(&events);
        assert!(there.len() >= told, "kill {kill}: {} of {told} answers", there.len());
        let mut sorted = there.clone();
        sorted.dedup();
        assert_eq!(sorted, there, "no trial is answered twice");
        told = there.len();
        // A session without more trials would not be killed in one.
        let is_over = |event: &Event| matches!(event, Event::Survey { .. });
        if told > 800 || events.iter().any(is_over) {
            dir.run("study analyse out").ok().says(&["1 participant"]);
            (dir, told) = (folder(300), 0);
        }
    }
    assert!(all > kills, "{all} answers in all: it hardly ran");
    println!("{kills} kills, {all} answers");
}

#[test]
fn full_disk_ends_the_session_and_keeps_the_log() {
    let _lock = beside_others();
    let dir = folder(300);
    let own = harness::asperity(&dir).get_program().to_string_lossy().into_owned();
    let line = [&LINE[..], &["--loop"]].concat().join(" ");
    let mut command = harness::asperity(&dir);
    let mut limited = std::process::Command::new("bash");
    limited.current_dir(&dir).args(["-c", &format!("ulimit -f 16; exec {own} {line}")]);
    limited.envs(command.env("X", "").get_envs().filter_map(|(k, v)| Some((k.to_owned(), v?.to_owned()))));
    let mut live = Live::of(limited);
    let screens = ["the participant's screen:", "the experimenter's screen:"].map(|name| live.says(name));
    let mut running = Running { live, screens };
    let mut told = 0;
    while let Some((screen, code)) = running.go_on() {
        told += usize::from(code == 204 && screen["questions"].as_array().is_some_and(|q| !q.is_empty()));
    }
    let ran = running.live.end();
    assert_eq!(ran.code, 1, "{}", ran.err);
    assert!(ran.err.contains("cannot write"), "{}", ran.err);
    let there = answered(&events(&dir)).len();
    assert!(there >= told && told > 0, "{there} of {told}");
}

#[test]
fn session_of_another_study_is_refused() {
    let dir = folder(1);
    for (change, why) in
        [(["--participant", "P 2"], "is no code"), (["--participant", "Anna"], "does not end with a number")]
    {
        let line: Vec<&str> =
            LINE[..3].iter().copied().chain(change).chain(LINE[5..].iter().copied()).collect();
        harness::run(&dir, &line).refused(why);
    }
    std::fs::create_dir(dir.join("out")).unwrap();
    dir.write("out/experiment.ron", "Experiment(another)");
    harness::run(&dir, &LINE).refused("has changed since people took part");
    // A copy that cannot be read is not overwritten.
    std::fs::write(dir.join("out/experiment.ron"), [0xff, 0xfe]).unwrap();
    harness::run(&dir, &LINE).refused("cannot read the study's copy");
    assert_eq!(std::fs::read(dir.join("out/experiment.ron")).unwrap(), [0xff, 0xfe]);
}

/// Height of the stylus in mm, as the experimenter's screen tells it.
fn height(running: &Running) -> f64 {
    running.screen(1).and_then(|screen| screen["live"]["position_mm"][2].as_f64()).unwrap_or(f64::NAN)
}

#[test]
fn trial_under_a_pressed_stylus_never_plays_the_one_before() {
    let _lock = beside_others();
    let dir = folder(1);
    dir.write(
        "study.ron",
        "Experiment(version: 1, title: \"Pressed\", participants: 2, missed: 1.0,
            stimuli: {\"weak\": graph(file: \"weak.ron\"), \"strong\": graph(file: \"strong.ron\")},
            parts: [(name: \"one\", show: [\"weak\", \"strong\"], sides: left, order: fixed,
                ask: [scale(name: \"r\", text: \"?\", from: 1, to: 5, low: \"a\", high: \"b\")])],
        )",
    );
    // In the air on the left, and down from 6 s on.
    dir.write("stroke.csv", csv(60.0, |t| [-20.0, 0.0, if t < 6.0 { 5.0 } else { -1.0 }]));
    let running = Running::line(&dir, &LINE);
    assert_eq!(running.go_on().expect("it runs").1, 204);
    until("the first stimulus", || places(&dir) == [Some(0)]);
    until("the stylus is down", || height(&running) < 0.0);
    assert_eq!(running.go_on().expect("it runs").1, 204);
    until("silence in the second trial", || places(&dir) == [Some(0), None]);
    std::thread::sleep(Duration::from_millis(300));
    // The second stimulus waits for the stylus to be lifted, which never happens.
    assert_eq!(running.go_on().expect("it runs").1, 204);
    until("the end", || events(&dir).last() == Some(&Event::End));
    assert_eq!(places(&dir), [Some(0), None]);
    drop(running);
    dir.run("study analyse out").ok();
    let report = std::fs::read_to_string(dir.join("out/REPORT.md")).expect("a report");
    assert!(report.contains("In 1 of 2 answered trials, not every stimulus was played."), "{report}");
}

#[test]
fn file_that_changes_in_a_trial_marks_it() {
    let _lock = beside_others();
    let dir = folder(1);
    side_by_side(&dir, "graph(file: \"weak.ron\")", "graph(file: \"strong.ron\")", "");
    let running = feels(&dir);
    dir.write("strong.ron", tone(0.04));
    let before = places(&dir).len();
    until("another one", || places(&dir).len() > before + 1);
    assert_eq!(running.go_on().expect("it runs").1, 204);
    let marked = |event: &Event| matches!(event, Event::Marked { why, .. } if why.contains("has changed"));
    assert!(events(&dir).iter().any(marked), "{:?}", events(&dir));
}

/// Marks the trial that is shown.
fn mark(running: &Running) -> Option<u16> {
    let token = running.screen(1)?["token"].clone();
    running.press(1, &json!({ "press": "mark", "token": token, "why": "it slipped" }))
}

#[test]
fn trial_that_comes_again_at_once_begins_anew() {
    let _lock = beside_others();
    let dir = folder(1);
    side_by_side(&dir, "graph(file: \"weak.ron\")", "graph(file: \"strong.ron\")", "");
    let running = feels(&dir);
    assert_eq!(mark(&running), Some(204));
    let again = |event: &Event| matches!(event, Event::Stimulus { trial: 0, attempt: 1, place: Some(_), .. });
    until("the stimulus of the second attempt", || events(&dir).iter().any(again));
}

#[test]
fn samples_that_were_not_played_mark_their_trial() {
    let _lock = beside_others();
    let dir = folder(1);
    side_by_side(&dir, "graph(file: \"weak.ron\")", "graph(file: \"strong.ron\")", "");
    let study = std::fs::read_to_string(dir.join("study.ron")).unwrap();
    dir.write("study.ron", study.replace("missed: 1.0", "missed: 0.4"));
    let running = feels(&dir);
    // The card goes on while the program stands still: hardly a tick is late, since few are run.
    let id = running.live.id().to_string();
    for (signal, ms) in [("-STOP", 3000), ("-CONT", 300)] {
        assert!(std::process::Command::new("kill").args([signal, &id]).status().expect("kill").success());
        std::thread::sleep(Duration::from_millis(ms));
    }
    assert_eq!(running.go_on().expect("it runs").1, 204);
    let (marked, _) = marks(&dir);
    assert!(marked.len() == 1 && marked[0].1.ends_with("deadlines were missed"), "{:?}", events(&dir));
}

/// Two tones of other levels, which are matched, and noise on the second channel.
const MASKED: &str = r#"Experiment(version: 1, title: "Masked", participants: 2, missed: 1.0,
    stimuli: {"weak": graph(file: "weak.ron"), "strong": graph(file: "strong.ron")},
    masking: white(dbfs: -30, channels: [2]),
    parts: [(name: "one", show: [("weak", "strong")], level: rms,
        ask: [which(name: "stronger", text: "Which is stronger?")])],
)"#;

#[test]
fn masking_goes_on_over_swaps_of_matched_stimuli() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    told(|| {
        let dir = folder(1);
        dir.write("study.ron", MASKED);
        let ear = Ear::new(60 * 48_000);
        let mut running = Running::line(&dir, &on_jack(&["--loop"]));
        ear.hear(running.live.id());
        assert_eq!(running.go_on().expect("it runs").1, 204);
        ear.wait(5 * 48_000);
        assert_eq!(running.go_on().expect("it runs").1, 204);
        assert_eq!(running.live.end().code, 0);
        let felt = |event: &Event| match event {
            Event::Stimulus { place, .. } => *place,
            _ => None,
        };
        let felt: Vec<usize> = events(&dir).iter().filter_map(felt).collect();
        assert!(felt.contains(&0) && felt.contains(&1) && felt.len() > 4, "{felt:?}");
        let heard = ear.stop();
        // Both tones are as strong as the weak one, also while one replaces the other. The limiter's
        // high-pass adds some per cent to a change of phase.
        let most = heard.iter().fold(0.0_f32, |most, [left, _]| most.max(left.abs()));
        assert!((0.018..0.025).contains(&most), "{most} A, of 0.02 and 0.05");
        // From the third second, when the session has faded in, to the last, when it fades out.
        let noise: Vec<f32> = heard.iter().map(|[_, right]| *right).skip_while(|x| *x == 0.0).collect();
        let noise = &noise[100_000..noise.len() - 48_000 * 3 / 2];
        if noise.windows(8).any(|w| w.iter().all(|x| *x == 0.0)) {
            return Err("the machine has a gap".into());
        }
        let rms = (noise.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / noise.len() as f64).sqrt();
        let db = 20.0 * rms.log10();
        println!("noise at {db:.2} dBFS over {} s and {} swaps", noise.len() / 48_000, felt.len());
        assert!((db + 30.0).abs() < 0.2, "{db} dBFS");
        // Uniform noise has no larger step than 2 x 1.73 its level.
        let step = noise.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
        assert!(f64::from(step) < 1.02 * 12f64.sqrt() * 10f64.powf(-1.5), "a click of {step}");
        let mut known = std::collections::HashSet::new();
        let repeats =
            noise.windows(3).filter(|w| !known.insert([w[0], w[1], w[2]].map(f32::to_bits))).count();
        assert_eq!(repeats, 0, "samples that come again");
        Ok(())
    });
}

/// A tone on the left alone: each crossing is an onset or an offset.
const ONSETS: &str = r#"Experiment(version: 1, title: "Onsets", participants: 1, missed: 1.0,
    stimuli: {"tone": graph(file: "strong.ron")},
    parts: [(name: "one", show: ["tone"], sides: left, ask: [scale(name: "r", text: "?", from: 1, to: 5,
        low: "a", high: "b")])],
)"#;

/// Samples of a millisecond.
const MS: i64 = 48;

#[test]
fn onsets_come_within_1_ms_of_the_log_and_without_a_click() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    told(|| {
        let dir = folder(1);
        dir.write("study.ron", ONSETS);
        let ear = Ear::new(60 * 48_000);
        let mut running = Running::line(&dir, &on_jack(&["--loop"]));
        ear.hear(running.live.id());
        // From the welcome on to the trial, and 5 s of it.
        assert_eq!(running.go_on().expect("it runs").1, 204);
        ear.wait(5 * 48_000);
        assert_eq!(running.go_on().expect("it runs").1, 204);
        assert_eq!(running.live.end().code, 0);
        let heard: Vec<f32> = ear.stop().into_iter().map(|[left, _]| left).collect();
        let logged: Vec<i64> = events(&dir)
            .iter()
            .filter_map(|event| match event {
                Event::Stimulus { place: Some(0), sample, .. } => Some(*sample as i64),
                _ => None,
            })
            .collect();
        // The first sample that moves after 20 ms of rest.
        let (mut onsets, mut ends, mut rest) = (Vec::new(), Vec::new(), 0);
        for (n, pair) in heard.windows(2).enumerate() {
            let moves = (pair[1] - pair[0]).abs() > 2e-6;
            if moves && rest > 960 {
                onsets.push(n as i64 + 1);
            }
            rest = if moves { 0 } else { rest + 1 };
            if rest == 961 {
                ends.push(n as i64 - 960);
            }
        }
        println!("logged {logged:?}\nheard {onsets:?}");
        if logged.len() < 5 || onsets.len() != logged.len() {
            return Err(format!("{} onsets were logged and {} heard", logged.len(), onsets.len()));
        }
        // Both clocks count the same samples from different beginnings. Where the machine has a gap, the
        // ticks go on and the ear hears nothing: the distance changes. Between gaps it stays.
        let apart: Vec<i64> = onsets.iter().zip(&logged).map(|(heard, logged)| heard - logged).collect();
        let span =
            |part: &[i64]| part.iter().max().zip(part.iter().min()).map_or(0, |(most, least)| most - least);
        let parts = apart.chunk_by(|a, b| (a - b).abs() <= MS).filter(|part| span(part) <= MS);
        let longest = parts.max_by_key(|part| part.len()).unwrap_or_default();
        if longest.len() < 4 {
            return Err(format!("onsets lie apart from the log by {apart:?}"));
        }
        println!("jitter {} samples over {} onsets", span(longest), longest.len());
        // The tone's own largest step, with a tenth for the fade.
        let own = 0.05 * std::f32::consts::TAU * 80.0 / 48_000.0;
        let step = heard.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f32::max);
        println!("largest step {step}, the tone's own {own}");
        // The program could click where a tone begins or ends. The machine can anywhere.
        let steps = heard.windows(2).map(|pair| (pair[1] - pair[0]).abs()).enumerate();
        let mut clicks = steps.filter(|(_, step)| *step >= 1.1 * own);
        let inside = |n: i64| onsets.iter().chain(&ends).all(|edge| (n - edge).abs() > 10 * MS);
        if step >= 1.1 * own && (longest.len() < apart.len() || clicks.any(|(n, _)| inside(n as i64))) {
            return Err("a gap of the machine clicks".into());
        }
        assert!(step < 1.1 * own, "a click: {step}, and the tone's own steps are {own}");
        Ok(())
    });
}

/// A network's texture on the left and a tone on the right, in two trials.
const REPLAYED: &str = r#"Experiment(version: 1, title: "Replayed", participants: 1, missed: 1.0,
    stimuli: {
        "texture": graph(file: "graphs/live.ron", set: {"texture.material": "canvas"}),
        "tone": graph(file: "strong.ron"),
    },
    parts: [(name: "one", show: [("texture", "tone")], sides: fixed,
        ask: [which(name: "stronger", text: "?")],
        vary: (stimulus: "texture", set: "strength.gain",
            by: constant(levels: [0.9831877173096739, 0.99], each: 1)))],
)"#;

/// Samples that are compared at a time.
const PIECE: usize = 960;

/// Strokes of both sides in turn, with the stylus in the air between, until it is told to stop.
fn strokes(port: u16, over: &AtomicBool) {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    let began = Instant::now();
    while !over.load(Relaxed) {
        let t = began.elapsed().as_secs_f64();
        let side = if t % 1.6 < 0.8 { -1.0 } else { 1.0 };
        let place =
            [side * 20.0 + 10.0 * (12.0 * t).sin(), 5.0 * t.cos(), if t % 0.8 < 0.5 { -2.0 } else { 3.0 }];
        let args = place.map(|x| OscType::Float(x as f32)).to_vec();
        let packet = OscPacket::Message(OscMessage { addr: "/stylus".into(), args });
        // A closed port may answer, which the next send reports.
        let _ = socket.send_to(&rosc::encoder::encode(&packet).expect("a packet"), ("127.0.0.1", port));
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn replay_has_the_samples_that_the_card_played() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    told(|| {
        let dir = folder(1);
        dir.write("study.ron", REPLAYED);
        let port = free_port();
        let hand = format!("osc:listen=127.0.0.1:{port},timeout_ms=60");
        let ear = Ear::new(60 * 48_000);
        let moves = Background::new(move |over| strokes(port, over));
        let line = [&LINE[..7], &["--host", "jack", "--hand", &hand]].concat();
        let mut running = Running::line(&dir, &line);
        ear.hear(running.live.id());
        // The output rises for two seconds first.
        for seconds in [0, 6, 4] {
            ear.wait(seconds * 48_000);
            if seconds == 6 {
                until("live figures", || {
                    let live = running.screen(1).expect("it runs")["live"].clone();
                    live["speed_mm_s"].as_f64() > Some(5.0) && live["force_n"].is_number()
                });
            }
            assert_eq!(running.go_on().expect("it runs").1, 204);
        }
        drop(moves);
        let ran = running.live.end();
        assert_eq!(ran.code, 0, "{}", ran.err);
        let heard: Vec<u32> = ear.stop().into_iter().map(|[left, _]| left.to_bits()).collect();
        for trial in ["0", "1"] {
            let args = ["study", "replay", "out", "--participant", "P02", "--trial", trial];
            let ran =
                harness::run(&dir, &[&args[..], &["--out", "felt.wav", "--stroke", "felt.csv"]].concat())
                    .ok();
            print!("{}", ran.out);
            for felt in ["`texture` at place 1", "`tone` at place 2", "nothing"] {
                assert!(ran.out.contains(felt) || trial == "1", "it lacks {felt}: {}", ran.out);
            }
            let felt: Vec<u32> = dir.wav("felt.wav").0.into_iter().map(f32::to_bits).collect();
            assert!(felt.len() > 3 * 48_000, "{} samples", felt.len());
            // Pieces that sound are in what was heard, one after the other, bit for bit. A busy machine has
            // gaps, after which the signal goes on as the replay has it.
            let (mut from, mut same, mut pieces) = (0, 0, 0);
            for piece in felt.chunks_exact(PIECE).filter(|piece| !piece.contains(&0)) {
                pieces += 1;
                if let Some(at) = heard[from..].windows(PIECE).position(|there| there == piece) {
                    same += 1;
                    from += at + PIECE;
                }
            }
            println!("{same} of {pieces} pieces are the same");
            assert!(pieces > 20, "it hardly sounds");
            let is_whole = ran.out.contains("no deadline was missed");
            assert!(
                !is_whole || same == pieces,
                "no deadline was missed, and {same} of {pieces} are the same"
            );
            if 2 * same < pieces {
                return Err("the machine missed too many deadlines".into());
            }
            // The stroke of a trial can be played again.
            harness::run(
                &dir,
                &["render", "graphs/texture.ron", "--input", "felt.csv", "--out", "again.wav"],
            )
            .ok();
        }
        dir.write("strong.ron", tone(0.01));
        let args = ["study", "replay", "out", "--participant", "P02", "--trial"];
        let replay = |rest: &[&str]| harness::run(&dir, &[&args[..], rest, &["--out", "felt.wav"]].concat());
        replay(&["0"]).refused("changed since the session");
        replay(&["7"]).refused("trials 0 to 1 were shown");
        replay(&["0", "--attempt", "1"]).refused("was not shown in attempt 1");
        Ok(())
    });
}

/// A study of two stimuli side by side, with one question.
fn side_by_side(dir: &Room, left: &str, right: &str, more: &str) {
    dir.write(
        "study.ron",
        format!(
            "Experiment(version: 1, title: \"Sides\", participants: 1, missed: 1.0,
                stimuli: {{\"left\": {left}, \"right\": {right}}},
                parts: [(name: \"one\", show: [(\"left\", \"right\")], sides: fixed, {more}
                    ask: [which(name: \"stronger\", text: \"?\")])],
            )"
        ),
    );
}

/// Places that were felt, in order.
fn places(dir: &Path) -> Vec<Option<usize>> {
    let place = |event: &Event| match event {
        Event::Stimulus { place, .. } => Some(*place),
        _ => None,
    };
    events(dir).iter().filter_map(place).collect()
}

/// The line of a session with another hand than a recorded stroke.
fn by(hand: &str) -> Vec<&str> {
    [&LINE[..LINE.len() - 2], &["--hand", hand]].concat()
}

/// A tone over a wall that pushes back with 0.5 N/mm.
fn wall(params: &str) -> String {
    let nodes = format!(
        "\"stylus\": (kind: \"haply_input\"), \"wall\": (kind: \"haply_force\", params: ({params})),
        \"floor\": (kind: \"virtual_floor\", params: (stiffness_n_per_mm: 0.5)),"
    );
    let wires = "wires: [(\"stylus.position\", \"floor\"), (\"floor.plane\", \"wall.plane\"),
        (\"floor.normal\", \"wall.normal\"), (\"floor.stiffness\", \"wall.stiffness\"),";
    tone(0.05).replace("\"stylus\": (kind: \"stroke\"),", &nodes).replace("wires: [", wires)
}

#[test]
fn stimulus_with_other_limits_of_the_device_is_refused() {
    let dir = folder(1);
    dir.write("wall.ron", wall(""));
    dir.write("soft.ron", wall("max_force_n: 1.0"));
    side_by_side(&dir, "graph(file: \"wall.ron\")", "graph(file: \"soft.ron\")", "");
    let ran = harness::run(&dir, &by("haply:service=ws://127.0.0.1:1")).refused("`right` cannot follow");
    ran.says(&["push of the study has another kind or other parameters", "study.ron:2:"]);
}

#[test]
fn device_pushes_back_on_its_side_and_never_in_silence() {
    let _lock = beside_others();
    let dir = folder(1);
    dir.write("wall.ron", wall(""));
    side_by_side(&dir, "graph(file: \"wall.ron\")", "graph(file: \"weak.ron\")", "");
    let service = Service::start();
    let put = |x_mm: f64, z_mm: f64| service.put([1e-3 * x_mm, 0.0, 1e-3 * z_mm]);
    put(-20.0, 5.0);
    let hand = format!("haply:service=ws://{}", service.address);
    let running = Running::line(&dir, &by(&hand));
    assert_eq!(running.go_on().expect("it runs").1, 204);
    let press = |word: &str| assert_eq!(running.press(1, &json!({ "press": word })), Some(204), "{word}");
    let pushes = || (service.last()[2] - 1.5).abs() < 0.05;
    let lets_go = || service.last() == [0.0; 3];
    // Lifts the stylus, waits for what is felt there, and lowers it by 3 mm: 1.5 N on the wall.
    let lower = |x_mm: f64, place: Option<usize>| {
        put(x_mm, 5.0);
        until("the stimulus", || places(&dir).last() == Some(&place));
        put(x_mm, -3.0);
    };
    let stays_free = || {
        let from = service.forces.lock().expect("nobody panicked").len();
        until("forces", || service.forces.lock().expect("nobody panicked").len() > from + 400);
        let forces = service.forces.lock().expect("nobody panicked");
        assert!(forces[from + 100..].iter().all(|force| *force == [0.0; 3]), "it pushes");
    };
    lower(-20.0, Some(0));
    until("a push", pushes);
    lower(20.0, Some(1));
    stays_free();
    lower(-20.0, Some(0));
    until("a push after the other side", pushes);
    for [silent, back] in [["pause", "resume"], ["mute", "unmute"]] {
        press(silent);
        until("silence", lets_go);
        stays_free();
        press(back);
        stays_free();
        lower(-20.0, Some(0));
        until("a push after silence", pushes);
    }
    // A trial in which the output was muted comes again. The answer ends it, and with it the force.
    assert_eq!(running.go_on().expect("it runs").1, 204);
    let muted = |event: &Event| matches!(event, Event::Marked { why, .. } if why == "the output was muted");
    assert!(events(&dir).iter().any(muted));
    until("a push in the trial that comes again", pushes);
    assert_eq!(running.go_on().expect("it runs").1, 204);
    until("no push", lets_go);
}

#[test]
fn stroke_on_the_pad_is_the_hand() {
    let _lock = harness::alone::real_time();
    let Some(mut page) = Chromium::start() else { return };
    let dir = folder(1);
    side_by_side(&dir, "graph(file: \"weak.ron\")", "graph(file: \"strong.ron\")", "");
    let running = Running::line(&dir, &by("page:timeout_ms=2000"));
    let (_, url) = running.screens[0].split_once("http").expect("an address");
    page.open(&format!("http{}", url.trim()));
    page.until("document.body.dataset.state === 'welcome'");
    assert_eq!(page.eval("document.querySelector('#pad').hidden"), true);
    assert_eq!(running.go_on().expect("it runs").1, 204);
    page.until("document.querySelector('#pad.sides')?.hidden === false");
    let [x, y] = page.middle("#pad");
    // 50 mm to the right and back to the left, with half of the pressure.
    let mut strokes = |from: f64, to: f64| {
        page.pen("mousePressed", [x + from, y], 0.5);
        for i in 0..=50 {
            page.pen("mouseMoved", [x + from + (to - from) * f64::from(i) / 50.0, y], 0.5);
            std::thread::sleep(Duration::from_millis(4));
        }
        page.pen("mouseReleased", [x + to, y], 0.0);
    };
    strokes(-100.0, 90.0);
    until("the right side", || places(&dir).last() == Some(&Some(1)));
    strokes(90.0, -100.0);
    until("the left side", || places(&dir).last() == Some(&Some(0)));
    assert_eq!(page.complaints(), Vec::<String>::new());
    // The pad goes with the trial, and lets the hand go.
    assert_eq!(running.go_on().expect("it runs").1, 204);
    assert_eq!(running.live.stop().code, 0);
    dir.run("study replay out --participant P02 --trial 0 --out felt.wav --stroke felt.csv").ok();
    let stroke = std::fs::read_to_string(dir.join("felt.csv")).expect("a stroke");
    assert!(stroke.starts_with("t_s,x_mm,y_mm,z_mm\n"), "{}", &stroke[..60]);
    let stroke = rows(&dir.join("felt.csv"));
    let pressed: Vec<f64> = stroke.iter().filter(|row| row[2] < -3.0).map(|row| row[0]).collect();
    let (least, most) = pressed.iter().fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
    assert!(least < -20.0 && most > 20.0, "it went from {least} to {most} mm in {} ticks", pressed.len());
}

/// A session on JACK in which the server dies while the only trial is felt.
fn loses_its_server(dir: &Room, more: &[&str], server: &harness::servers::Process) -> Running {
    side_by_side(dir, "graph(file: \"weak.ron\")", "graph(file: \"strong.ron\")", "");
    let mut running = Running::line(dir, &on_jack(&[&["--loop"], more].concat()));
    assert_eq!(running.go_on().expect("it runs").1, 204);
    until("a stimulus", || !places(dir).is_empty());
    server.kill();
    running.live.says("is lost: ");
    running
}

/// Marks of the log, each with its trial and reason, and the number of answers.
fn marks(dir: &Path) -> (Vec<(usize, String)>, usize) {
    let events = events(dir);
    let mark = |event: &Event| match event {
        Event::Marked { trial, why, .. } => Some((*trial, why.clone())),
        _ => None,
    };
    (events.iter().filter_map(mark).collect(), answered(&events).len())
}

#[test]
fn trial_with_a_lost_device_comes_again_and_counts() {
    let Some(server) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    let dir = folder(1);
    let mut running = loses_its_server(&dir, &[], &server);
    let problem = |running: &Running| running.screen(1).map(|screen| screen["live"]["problem"].clone());
    until("the experimenter is told", || problem(&running) == Some("the device is lost".into()));
    assert_eq!(running.go_on().expect("it runs").1, 204);
    // The only trial comes again at once. While the device is lost, it does not count either.
    let lost = (0, "the device was lost".to_owned());
    assert_eq!(marks(&dir), (vec![lost.clone()], 0));
    let name = std::env::var("JACK_DEFAULT_SERVER").unwrap();
    let _next = Jack::named(&name, 48_000, 64).unwrap();
    running.live.says("` is back");
    until("the experimenter is told again", || problem(&running) == Some(Value::Null));
    assert_eq!(running.go_on().expect("it runs").1, 204);
    assert_eq!(marks(&dir), (vec![lost.clone(), lost.clone()], 0));
    assert_eq!(running.go_on().expect("it runs").1, 204);
    assert_eq!(running.live.end().code, 0);
    assert_eq!(marks(&dir), (vec![lost.clone(), lost], 1));
}

#[test]
fn session_without_its_device_ends_and_resumes_there() {
    let Some(server) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    let dir = folder(1);
    let mut running = loses_its_server(&dir, &["--no-reconnect"], &server);
    let ran = running.live.end();
    assert_eq!(ran.code, 1, "{}", ran.err);
    assert!(ran.err.contains("the device is lost; the same command goes on with this trial"), "{}", ran.err);
    let noted =
        |event: &Event| matches!(event, Event::Note { trial: Some(0), text } if text == "the device is lost");
    assert!(events(&dir).iter().any(noted), "no note of it");
    // It goes on elsewhere, with the trial that was not answered.
    let mut running = Running::start(&dir);
    while running.go_on().is_some_and(|(_, code)| code == 204) {}
    assert_eq!(running.live.end().code, 0);
    assert_eq!(marks(&dir), (Vec::new(), 1));
}

#[test]
fn second_ready_is_told_why_and_a_note_is_logged_once() {
    let _lock = beside_others();
    let dir = folder(1);
    let running = Running::start(&dir);
    // Welcome and instructions.
    for _ in 0..2 {
        assert_eq!(running.go_on().expect("it runs").1, 204);
    }
    let token = running.screen(1).expect("it runs")["token"].clone();
    let ready = json!({ "press": "ready", "token": token }).to_string();
    let pressed: Vec<(u16, String)> = std::thread::scope(|scope| {
        let both: Vec<_> =
            (0..2).map(|_| scope.spawn(|| running.request(1, "POST", "/press", &ready))).collect();
        both.into_iter().map(|one| one.join().expect("no panic").expect("it runs")).collect()
    });
    let mut codes: Vec<u16> = pressed.iter().map(|(code, _)| *code).collect();
    codes.sort_unstable();
    assert_eq!(codes, [204, 409]);
    assert!(pressed.iter().any(|(_, why)| why.contains("has changed")), "{pressed:?}");
    assert_eq!(running.press(1, &json!({ "press": "note", "text": "loud" })), Some(204));
    let events = events(&dir);
    assert_eq!(events.iter().filter(|event| matches!(event, Event::Note { .. })).count(), 1);
    assert_eq!(events.iter().filter(|event| matches!(event, Event::Shown { .. })).count(), 1);
}
