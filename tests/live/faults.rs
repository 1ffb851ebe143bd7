//! `asperity` on a JACK server that fails, on devices that are not there, and on one channel of two.

use std::path::Path;

use harness::live::Live;
use harness::servers::{Jack, inside};
use harness::test_name;

use crate::ear::Ear;
use crate::played::{START_S, assert_no_clicks, assert_ramps_down, counted, first_sound, follow, play};

const RATE: usize = 48_000;

/// Plays the graph on JACK, heard until it is up.
fn up(dir: &Path, args: &[&str]) -> (Live, Ear) {
    crate::played::write_graph(dir, RATE as u32);
    let ear = Ear::new(60 * RATE);
    let mut program = play(dir, &[&["--host", "jack"], args].concat());
    ear.hear(program.id());
    program.says("plays on");
    ear.wait((START_S * RATE as f64) as usize + RATE / 10);
    (program, ear)
}

/// Hears a program that has come back: it begins softly, is where it would be if nothing had happened or
/// later, and stops well.
fn is_back(dir: &Path, mut program: Live, least_s: f64) {
    let ear = Ear::new(60 * RATE);
    ear.hear(program.id());
    ear.wait(3 * RATE);
    program.signal("INT");
    program.end().ok();
    ear.wait(RATE / 10);
    let heard: Vec<f32> = ear.stop().iter().map(|frame| frame[0]).collect();
    let count = counted(dir);
    let rendered: Vec<f32> = crate::played::offline(dir, count.ticks).iter().map(|frame| frame[0]).collect();
    assert_eq!(count.losses, 1, "{count:?}");
    let begin = first_sound(heard.iter().copied()).expect("a sound");
    let from = begin + (START_S * RATE as f64) as usize;
    // Time went by: it is not unbroken.
    let followed = follow(&heard, &rendered, from, i64::MIN, RATE as u32).expect("the graph is heard again");
    let at_s = (begin as i64 + followed.shift) as f64 / RATE as f64;
    println!("back at {at_s:.3} s of the graph, {count:?}");
    assert!(at_s > least_s, "back at {at_s} s of the graph");
    assert_no_clicks(&heard, RATE as u32);
    assert_ramps_down(&heard, &rendered, &followed, &count, RATE as u32);
}

#[test]
fn run_comes_back_with_a_killed_server_and_ticks_went_on() {
    let Some(server) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    let dir = tempfile::tempdir().unwrap();
    let (mut program, ear) = up(dir.path(), &[]);
    server.kill();
    // Its server is dead: it cannot be closed in order.
    std::mem::forget(ear);
    program.says("is lost: ");
    let name = std::env::var("JACK_DEFAULT_SERVER").unwrap();
    let _next = Jack::named(&name, 48_000, 128).unwrap();
    program.says("` is back");
    // The graph was up for two seconds, and a lost device is looked for after half of one.
    is_back(dir.path(), program, START_S + 0.4);
}

#[test]
fn a_run_comes_back_when_a_stopped_server_goes_on() {
    let Some(server) = inside(test_name!(), || Jack::start(48_000, 256)) else { return };
    let dir = tempfile::tempdir().unwrap();
    let (mut program, ear) = up(dir.path(), &[]);
    server.stop();
    program.says("is lost: ");
    server.go_on();
    program.says("` is back");
    drop(ear);
    is_back(dir.path(), program, START_S + 0.4);
}

#[test]
fn without_reconnecting_a_lost_device_ends_the_run() {
    let Some(server) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    let dir = tempfile::tempdir().unwrap();
    let (mut program, ear) = up(dir.path(), &["--no-reconnect"]);
    server.kill();
    // Its server is dead: it cannot be closed in order.
    std::mem::forget(ear);
    let ran = program.end();
    assert_eq!(ran.code, 1, "{}", ran.err);
    assert!(ran.err.contains("is lost: ") && ran.err.contains("--no-reconnect gives up"), "{}", ran.err);
}

#[test]
fn what_is_not_there_is_an_error_and_nothing_is_played_instead() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    let dir = tempfile::tempdir().unwrap();
    crate::played::write_graph(dir.path(), 48_000);
    let refused = |args: &[&str]| {
        let ran = play(dir.path(), args).end();
        assert_eq!((ran.code, ran.out.as_str()), (2, ""), "{args:?}: {}", ran.err);
        assert!(!ran.err.contains("plays on"), "{args:?}: {}", ran.err);
        assert_eq!(harness::files(dir.path()), ["hand.csv", "live.ron"], "{args:?}");
        ran.err
    };
    let said = refused(&["--host", "jack", "--device", "Haptuator"]);
    assert!(said.contains("no output device `Haptuator`; there are"), "{said}");
    assert!(said.contains("jack:output"), "{said}");
    let said = refused(&["--host", "jack", "--channel", "1,999"]);
    assert!(said.contains("--channel") && said.contains("999"), "{said}");
    let said = refused(&["--host", "jack", "--channel", "1"]);
    assert!(said.contains("--channel") && said.contains("2 audio_out"), "{said}");
    let said = refused(&["--host", "jack", "--set", "audio_hz=44100"]);
    assert!(said.contains("it can at 48000 Hz") && said.contains("--set audio_hz=48000"), "{said}");
    let said = refused(&["--host", "oss"]);
    assert!(said.contains("jack"), "{said}");
    let said = refused(&["--host", "pulseaudio"]);
    assert!(said.contains("pulseaudio"), "{said}");
}

#[test]
fn devices_lists_what_the_server_has() {
    let Some(_) = inside(test_name!(), || Jack::start(44_100, 256)) else { return };
    let dir = tempfile::tempdir().unwrap();
    let ran = harness::run(dir.path(), &["devices", "--json"]).ok();
    let hosts: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
    let jack = hosts.as_array().unwrap().iter().find(|host| host["name"] == "jack").unwrap();
    let devices = jack["devices"].as_array().unwrap();
    let output = devices.iter().find(|device| device["default_output"] == true).unwrap();
    assert_eq!(output["output"]["rates_hz"], serde_json::json!([44_100]), "{output}");
    assert_eq!(output["output"]["buffer_frames"], serde_json::json!([256, 256]), "{output}");
}

#[test]
fn a_tone_is_on_the_channel_that_is_named_and_on_no_other() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 128)) else { return };
    let dir = tempfile::tempdir().unwrap();
    let ear = Ear::new(60 * RATE);
    let tone =
        ["tone", "--host", "jack", "--channel", "2", "--hz", "100", "--amps", "0.04", "--seconds", "2"];
    let mut program = Live::command(dir.path(), &tone);
    ear.hear(program.id());
    let ran = program.end().ok();
    assert!(ran.err.contains("on channel 2"), "{}", ran.err);
    let heard = ear.stop();
    assert!(heard.iter().all(|frame| frame[0] == 0.0), "channel 1 is not silent");
    let two: Vec<f32> = heard.iter().map(|frame| frame[1]).collect();
    // Behind the ramp of half a second.
    let begin = first_sound(two.iter().copied()).expect("a tone") + 3 * RATE / 4;
    let second = &two[begin..begin + RATE];
    let peak = second.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    assert!((0.0395..0.0405).contains(&peak), "{peak}");
    let rises = second.windows(2).filter(|pair| pair[0] < 0.0 && pair[1] >= 0.0).count();
    assert!((98..=102).contains(&rises), "{rises} periods in a second");
}
