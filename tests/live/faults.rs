//! `asperity` on a JACK server that fails, on devices that are not there, and on one channel of two.

use std::time::Instant;

use harness::live::Live;
use harness::servers::{Jack, Process, inside};
use harness::test_name;

use crate::ear::Ear;
use crate::played::{START_S, assert_no_clicks, play, report, write_graph};

const RATE: usize = 48_000;

/// Plays the graph on JACK, heard until it is up; then the server dies.
fn loses_its_server(dir: &std::path::Path, args: &[&str], server: &Process) -> Live {
    write_graph(dir, RATE as u32);
    let ear = Ear::new(60 * RATE);
    let mut program = play(dir, &[&["--host", "jack"], args].concat());
    ear.hear(program.id());
    program.says("plays on");
    ear.wait((START_S * RATE as f64) as usize + RATE / 10);
    server.kill();
    // Its server is dead: it cannot be closed in order.
    std::mem::forget(ear);
    program
}

#[test]
fn run_comes_back_with_a_killed_server_and_ticks_went_on() {
    let Some(server) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    let dir = tempfile::tempdir().unwrap();
    let mut program = loses_its_server(dir.path(), &[], &server);
    let lost = Instant::now();
    program.says("is lost: ");
    let name = std::env::var("JACK_DEFAULT_SERVER").unwrap();
    let _next = Jack::named(&name, 48_000, 128).unwrap();
    program.says("` is back");
    let ear = Ear::new(60 * RATE);
    ear.hear(program.id());
    ear.wait(5 * RATE / 2);
    program.signal("INT");
    let went_on_s = START_S + lost.elapsed().as_secs_f64();
    program.end().ok();
    ear.wait(RATE / 10);
    let (heard, report) = (ear.stop(), report(dir.path()));
    assert_eq!(report["losses"], 1, "{report}");
    assert!(report["seconds"].as_f64() > Some(went_on_s - 0.5), "{report} in {went_on_s} s");
    assert!(heard.iter().any(|frame| frame[0].abs() > 0.05), "nothing is heard again");
    assert_no_clicks(&heard, RATE as u32);
    assert_eq!(heard.last().map(|frame| frame[0]), Some(0.0), "it does not end in silence");
}

#[test]
fn without_reconnecting_a_lost_device_ends_the_run() {
    let Some(server) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    let dir = tempfile::tempdir().unwrap();
    let ran = loses_its_server(dir.path(), &["--no-reconnect"], &server).end();
    assert_eq!(ran.code, 1, "{}", ran.err);
    assert!(ran.err.contains("is lost: ") && ran.err.contains("--no-reconnect gives up"), "{}", ran.err);
}

#[test]
fn what_is_not_there_is_an_error_and_nothing_is_played_instead() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    let dir = tempfile::tempdir().unwrap();
    write_graph(dir.path(), 48_000);
    let refused = |args: &[&str]| {
        let ran = play(dir.path(), args).end();
        assert_eq!((ran.code, ran.out.as_str()), (2, ""), "{args:?}: {}", ran.err);
        assert!(!ran.err.contains("plays on"), "{args:?}: {}", ran.err);
        assert_eq!(harness::files(dir.path()), ["hand.csv", "live.ron"], "{args:?}");
        ran.err
    };
    for (args, parts) in [
        (
            &["--host", "jack", "--device", "Haptuator"][..],
            &["no output device `Haptuator`; there are", "jack:output"][..],
        ),
        (&["--host", "jack", "--channel", "1,999"], &["--channel", "999"]),
        (&["--host", "jack", "--channel", "1"], &["--channel", "2 audio_out"]),
        (&["--host", "jack", "--set", "audio_hz=44100"], &["it can at 48000 Hz", "--set audio_hz=48000"]),
        (&["--host", "oss"], &["jack"]),
        (&["--host", "pulseaudio"], &["pulseaudio"]),
    ] {
        let said = refused(args);
        assert!(parts.iter().all(|part| said.contains(part)), "{args:?}: {said}");
    }
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
    let begin = two.iter().position(|x| *x != 0.0).expect("a tone") + 3 * RATE / 4;
    let second = &two[begin..begin + RATE];
    let peak = second.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    assert!((0.0395..0.0405).contains(&peak), "{peak}");
    let rises = second.windows(2).filter(|pair| pair[0] < 0.0 && pair[1] >= 0.0).count();
    assert!((98..=102).contains(&rises), "{rises} periods in a second");
}
