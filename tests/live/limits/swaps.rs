//! Graphs that change while they play.

use std::path::Path;
use std::time::Duration;

use asperity_audio::simulated::Simulated;
use asperity_graph::{Compiled, GraphFile};
use asperity_live::driver::Clock;
use asperity_live::view::Condition;
use harness::alone::{beside_others, shared_stage};
use harness::live::{Live, npy, until};
use harness::stage::{by_hand, channel, graph, options, poll, start, swap, timed};
use harness::{self, json};

use crate::coil::{Coil, RATED, Used};
use crate::edits::edit;
use crate::simulated::on_channels;

const RATE: u32 = 48_000;

/// Seconds of every attack: some, or a minute where much time is given.
fn seconds() -> f64 {
    if std::env::var_os("ASPERITY_LONG_TICKS").is_some() { 60.0 } else { 8.0 }
}

/// A sine of 1000 A at the resonance, behind a limiter of this name.
fn attack(limiter: &str, params: &str) -> (String, String) {
    let nodes = format!(
        r#""tone": (kind: "sine", params: (frequency_hz: 65, amplitude: 1000)),
           "{limiter}": (kind: "limiter", params: ({params})), "out": (kind: "audio_out"),"#
    );
    (nodes, format!(r#"("tone", "{limiter}"), ("{limiter}", "out"),"#))
}

fn attacking(limiter: &str, params: &str) -> (GraphFile, Compiled) {
    let (nodes, wires) = attack(limiter, params);
    graph(&harness::registry(), (500, RATE), &nodes, &wires)
}

/// Plays on a card with another graph every so often, and judges that.
fn attacked(
    what: &str,
    every: &[f64],
    graph: impl Fn(usize) -> (GraphFile, Compiled),
    mut judge: impl FnMut(f64, Vec<f64>, Used),
) {
    for &every_s in every {
        let card = Simulated::new(what, by_hand()).expect("a card");
        let mut session = start(attacking("limiter", ""), options(&card, Clock::Callback));
        let mut number = 0;
        for block in 0..(seconds() * f64::from(RATE) / 96.0) as usize {
            card.step(96);
            if (block * 96) as f64 >= (number + 1) as f64 * every_s * f64::from(RATE) {
                number += 1;
                swap(&mut session, graph(number));
            }
        }
        let _ = session.poll();
        let played = channel(&card.played(), 2, 0);
        let used = Coil::new(RATE).play(played.iter().copied()).used;
        println!("{what}, {every_s} s: {used:?}");
        used.assert_within(&format!("{what} every {every_s} s"));
        judge(every_s, played, used);
    }
}

#[test]
fn renaming_the_limiter_lifts_no_limit_at_any_interval() {
    let _alone = beside_others();
    let renamed = |n| attacking(&format!("limiter {n}"), "");
    attacked("renamed", &[0.05, 0.1, 0.3, 0.7, 1.5, 5.0], renamed, |every_s, played, used| {
        assert!(used.rms > 0.9, "too careful: {used:?}");
        // What is heard is a sine still, not one that is cut by walls.
        let last = &played[played.len() - 24_000..];
        let peak = last.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        let rms = (last.iter().map(|x| x * x).sum::<f64>() / last.len() as f64).sqrt();
        assert!(peak / rms < 1.6, "{every_s} s: a peak of {peak} at {rms} rms");
    });
}

#[test]
fn limiter_set_otherwise_or_gone_for_a_while_lifts_no_limit() {
    let _alone = beside_others();
    let otherwise = |n: usize| {
        let release = if n.is_multiple_of(2) { "release_ms: 10" } else { "release_ms: 5000, slew_hz: 1000" };
        attacking(&format!("limiter {}", n % 3), release)
    };
    attacked("set otherwise", &[0.05, 0.3, 1.5], otherwise, |_, _, _| {});
    let gone = |n: usize| {
        let nodes = r#""hush": (kind: "sine", params: (frequency_hz: 20, amplitude: 0)),
                       "other": (kind: "limiter"), "out": (kind: "audio_out"),"#;
        let wires = r#"("hush", "other"), ("other", "out")"#;
        let silent = || graph(&harness::registry(), (500, RATE), nodes, wires);
        if n.is_multiple_of(2) { attacking("limiter", "") } else { silent() }
    };
    attacked("gone", &[0.05, 0.3, 1.0], gone, |_, _, _| {});
}

#[test]
fn change_of_profile_leaves_the_coil_as_warm_as_it_is() {
    let dir = &*shared_stage();
    // Half the rated current, for the same coil: what warmed it before counts.
    let text = std::fs::read_to_string(harness::graphs("actuators/hapcoil_one.ron")).unwrap();
    let weak = text.replace("ma_rms: 147.8", "ma_rms: 74").replace("HapCoil-One", "weak");
    assert_ne!(text, weak);
    let file = dir.join("weak.ron");
    std::fs::write(&file, weak).unwrap();
    let profile = format!("profile: {:?}", file.display().to_string());
    let changed =
        |n: usize| attacking(&format!("limiter {n}"), if n.is_multiple_of(2) { "" } else { &profile });
    attacked("profile", &[0.05, 0.3, 1.5], changed, |every_s, played, _| {
        let mut coil = Coil::new(RATE);
        for (n, part) in played.chunks((every_s * f64::from(RATE)) as usize).enumerate() {
            let before = coil.heat;
            coil.play(part.iter().copied());
            // Under the weaker profile a coil that is warmer than it may be only cools, but for the change
            // itself.
            let weak = n % 2 == 1 && before.sqrt() > 0.080 && every_s >= 0.3;
            assert!(!weak || coil.heat < before, "{every_s} s, part {n}: {before} to {}", coil.heat);
        }
    });
}

#[test]
fn two_outputs_that_change_names_stay_within_their_limits() {
    let _alone = beside_others();
    let both = |n: usize| {
        let voice = |id: &str, hz: f64| {
            let nodes = format!(
                r#""{id} tone {n}": (kind: "sine", params: (frequency_hz: {hz:?}, amplitude: 1000)),
                   "{id} limiter {n}": (kind: "limiter"), "{id}": (kind: "audio_out"),"#
            );
            (nodes, format!(r#"("{id} tone {n}", "{id} limiter {n}"), ("{id} limiter {n}", "{id}"),"#))
        };
        let (mut a, mut b) = (voice("a", 65.0), voice("b", 300.0));
        if n % 2 == 1 {
            std::mem::swap(&mut a, &mut b);
        }
        graph(&harness::registry(), (500, RATE), &(a.0 + &b.0), &(a.1 + &b.1))
    };
    let card = Simulated::new("both", by_hand()).expect("a card");
    let mut session = start(both(0), on_channels(&card, &[1, 2], RATE));
    for n in 1..40 {
        (0..100).for_each(|_| card.step(96));
        swap(&mut session, both(n));
    }
    let played = card.played();
    for n in 0..2 {
        let used = Coil::new(RATE).play(channel(&played, 2, n)).used;
        used.assert_within(&format!("output {n}"));
        assert!(used.rms > 0.8, "output {n}: {used:?}");
    }
}

#[test]
fn lost_device_that_is_back_finds_its_coil_as_warm_as_it_was() {
    let _alone = beside_others();
    let card = Simulated::new("lost and back", timed(96)).expect("a card");
    let mut session = start(attacking("limiter", ""), options(&card, Clock::Callback));
    let mut coil = Coil::new(RATE);
    let mut heard = 0;
    for _ in 0..3 {
        let until = heard + 2 * RATE as usize;
        poll(&mut session, "the attack", |_| card.played().len() >= 2 * until);
        card.unplug();
        poll(&mut session, "the loss", |s| s.view().condition == Condition::Lost);
        let played = channel(&card.played(), 2, 0);
        coil.play(played[heard..].iter().copied());
        heard = played.len();
        let away = std::time::Instant::now();
        std::thread::sleep(Duration::from_millis(50));
        card.plug();
        poll(&mut session, "the card", |s| s.view().condition == Condition::Playing);
        // It lay still for no longer than this.
        coil.rest(away.elapsed().as_secs_f64());
    }
    coil.used.assert_within("lost and back");
    assert!(coil.used.rms > 0.9, "{:?}", coil.used);
}

/// The attack as a file, heard by the card's own input.
fn write(dir: &Path, n: usize) {
    let (nodes, wires) = attack(&format!("limiter {n}"), "");
    let ear = r#""card": (kind: "audio_in", params: (unit: "A")),
        "heard": (kind: "file_out", params: (file: "heard.npy")),"#;
    let text = format!(r#"Graph(version: 1, nodes: {{{nodes}{ear}}}, wires: [{wires}("card", "heard")])"#);
    edit(dir, text);
}

#[test]
fn renamed_limiter_lifts_no_limit_of_run_watch_on_any_clock() {
    let _alone = beside_others();
    let runs = ["callback", "paced"].map(|clock| {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), 0);
        let card = ["--device", "simulated:frames=96,loopback=1", "--clock", clock, "--report", "r.json"];
        let run = Live::start(dir.path(), &[&["g.ron", "--watch"], &card[..]].concat());
        (dir, run)
    });
    for n in 1..=28 {
        runs.iter().for_each(|(dir, _)| write(dir.path(), n));
        std::thread::sleep(Duration::from_millis(if n % 2 == 0 { 300 } else { 50 }));
    }
    for (dir, run) in runs {
        let swaps = run.stop().ok().err.matches("changed:").count();
        let report = json(&dir.path().join("r.json"));
        let heard = npy(&dir.path().join("heard.npy"));
        let used = Coil::new(RATE).play(heard.iter().map(|x| f64::from(*x))).used;
        // Samples that a busy machine leaves out make steps of their own, and the mover swings otherwise.
        let gaps = ["underruns", "xruns", "recording_gaps"].map(|name| report[name].as_u64().unwrap());
        let whole = gaps == [0; 3];
        let judged = if whole { used } else { Used { slew: 0.0, stroke: used.stroke / 1.1, ..used } };
        judged.assert_within(&format!("run --watch, {gaps:?} gaps"));
        assert!(used.rms > 0.8 && swaps > 4, "{swaps} swaps, {used:?}");
    }
}

#[test]
fn renamed_limiter_does_not_lift_the_limits_of_render_watch() {
    let dir = &*shared_stage();
    let write = |n: usize| {
        let (nodes, wires) = attack(&format!("limiter {n}"), "");
        let text = format!("Graph(version: 1, nodes: {{{nodes}}}, wires: [{wires}])");
        edit(dir, text);
    };
    write(0);
    let seconds = (seconds() - 3.0).to_string();
    let args = ["render", "g.ron", "--watch", "--seconds", &seconds, "--out", "o.wav", "--report", "o.json"];
    let mut child = harness::asperity(dir).args(args).arg("--quiet").spawn().unwrap();
    let mut n = 0;
    while child.try_wait().unwrap().is_none() {
        n += 1;
        write(n);
        std::thread::sleep(Duration::from_millis(if n % 2 == 0 { 300 } else { 50 }));
    }
    assert!(child.wait().unwrap().success());
    let swaps = json(&dir.join("o.json"))["swaps"].as_array().map_or(0, Vec::len);
    assert!(swaps > 8, "{swaps} swaps");
    let (samples, _) = harness::wav(&dir.join("o.wav"));
    let used = Coil::new(RATE).play(samples.iter().map(|x| f64::from(*x))).used;
    used.assert_within("render --watch");
    assert!(used.rms > 0.9, "too careful: {used:?}");
    // 0.319 A were driven before, where 0.1478 are rated.
    assert!(used.rms * RATED < 0.15);
}

#[test]
fn file_that_is_written_all_the_time_is_taken_each_second() {
    let dir = &*shared_stage();
    write(dir, 0);
    let run = Live::start(dir, &["g.ron", "--watch", "--device", "simulated:frames=96"]);
    let mut n = 0;
    until("two changes", || {
        n += 1;
        write(dir, n);
        run.said().matches("changed:").count() >= 2
    });
    run.stop().ok();
}
