//! `asperity study run`: sessions with presses over HTTP, a recorded hand and a simulated card.
#![cfg(target_os = "linux")]

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};

use asperity_study::log::{self, Event};
use harness::alone::beside_others;
use harness::live::{Live, told, until};
use harness::servers::{Jack, inside};
use harness::{Room, csv, test_name};
use serde_json::{Value, json};

use crate::ear::Ear;

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

/// A running session, and how its screens are reached.
struct Running {
    live: Live,
    screens: [String; 2],
}

impl Running {
    fn start(dir: &Path) -> Self {
        Self::line(dir, &[&LINE[..], &["--loop"]].concat())
    }

    fn line(dir: &Path, args: &[&str]) -> Self {
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
            "wait" => return Some((screen, self.press(1, &json!({ "press": "ready" }))?)),
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
        assert_eq!(code, 204, "{screen}");
        let text = screen.to_string();
        assert!(
            !["weak", "strong.ron", "felt", "Two tones"].iter().any(|name| text.contains(name)),
            "{text}"
        );
        assert!(begun.elapsed() < Duration::from_secs(120), "it never ends: {screen}");
        if events(&dir).last() == Some(&Event::End) {
            break;
        }
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
        if let Event::Inputs { tick, output, values } = event
            && output == "position"
        {
            use base64::Engine as _;
            let bytes = base64::prelude::BASE64_STANDARD.decode(values).expect("base64");
            let ticks = bytes.len() as u64 / 12;
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
    let dir = folder(300);
    let mut random = asperity_numbers::Random::new(11);
    let mut told = 0;
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
            let trains = screen["state"] == "explore" && !answers;
            told += usize::from(code == 204 && (answers || trains));
        }
        killer.join().expect("no panic");
        drop(running);
        // The log is readable, and has every answer that a screen was told of, in the order of the plan.
        let there = answered(&events(&dir));
        assert!(there.len() >= told, "kill {kill}: {} of {told} answers", there.len());
        let mut sorted = there.clone();
        sorted.dedup();
        assert_eq!(sorted, there, "no trial is answered twice");
        told = there.len();
    }
    assert!(told > kills, "{told} answers in all: it hardly ran");
    dir.run("study analyse out").ok().says(&["1 participant"]);
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
        let jack = |arg: &&'static str| match *arg {
            "--device" => "--host",
            arg if arg.starts_with("simulated") => "jack",
            arg => arg,
        };
        let line: Vec<&str> = LINE.iter().map(jack).chain(["--loop"]).collect();
        let mut running = Running::line(&dir, &line);
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
        // Both tones are as strong as the weak one, but for the 10 ms in which one replaces the other.
        let peak = |part: &[[f32; 2]]| part.iter().fold(0.0_f32, |most, [left, _]| most.max(left.abs()));
        let peaks: Vec<f32> = heard.chunks(960).map(peak).collect();
        let [strong, loud] = [0.0205, 0.019].map(|least| peaks.iter().filter(|peak| **peak > least).count());
        println!("{loud} of {} parts are loud, {strong} louder", peaks.len());
        assert!(strong <= 2 * felt.len() && loud > 4 * strong, "{strong} and {loud} of {}", peaks.len());
        // From the first second, when the session has faded in, to the last, when it fades out.
        let noise: Vec<f32> = heard.iter().map(|[_, right]| *right).skip_while(|x| *x == 0.0).collect();
        let noise = &noise[48_000..noise.len() - 48_000 * 3 / 2];
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
        let line: Vec<&str> =
            LINE.iter().map(|arg| if arg.starts_with("simulated") { "jack" } else { arg }).collect();
        let line: Vec<&str> =
            line.into_iter().map(|arg| if arg == "--device" { "--host" } else { arg }).collect();
        let mut running = Running::line(&dir, &[&line[..], &["--loop"]].concat());
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
        let (mut onsets, mut rest) = (Vec::new(), 0);
        for (n, pair) in heard.windows(2).enumerate() {
            let moves = (pair[1] - pair[0]).abs() > 2e-6;
            if moves && rest > 960 {
                onsets.push(n as i64 + 1);
            }
            rest = if moves { 0 } else { rest + 1 };
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
        if step >= 1.1 * own && longest.len() < apart.len() {
            return Err("a gap of the machine clicks".into());
        }
        assert!(step < 1.1 * own, "a click: {step}, and the tone's own steps are {own}");
        Ok(())
    });
}
