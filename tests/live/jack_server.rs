//! `asperity` on a real JACK server: heard sample by sample beside the same graph rendered offline, when the
//! server fails, as a measured latency, and in the list of devices.

use std::time::{Duration, Instant};

use harness::live::{Live, told, until};
use harness::run;
use harness::servers::{Jack, Process, inside};
use harness::test_name;
use jack::{Client, ClientOptions};
use serde_json::Value;

use crate::ear::{Ear, joined};
use crate::played::{START_S, assert_no_clicks, is_as_rendered, play, report, write_graph};

const RATE: usize = 48_000;

/// Plays for some seconds in real time, then for some as fast as the server goes.
fn plays_what_is_rendered(clock: &str, rate: usize, seconds: usize, wheeled: usize) {
    told(|| {
        let dir = tempfile::tempdir().unwrap();
        write_graph(dir.path(), rate as u32);
        let ear = Ear::new((seconds + wheeled + 30) * rate);
        let mut program = play(dir.path(), &["--host", "jack"]);
        ear.hear(program.id());
        ear.wait(seconds * rate);
        if wheeled > 0 {
            ear.freewheel(wheeled * rate);
        }
        program.signal("INT");
        program.end().ok();
        // Silence to the end is heard too.
        ear.wait(rate / 10);
        assert_eq!(report(dir.path())["clock"], clock);
        is_as_rendered(dir.path(), &ear.stop(), rate as u32, (seconds + wheeled) as f64 - 1.0)
    });
}

/// Freewheel is for the callback clock: a paced thread keeps to time.
#[test]
fn callback_on_jack_plays_every_sample_also_in_freewheel() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    plays_what_is_rendered("callback", 48_000, 4, 8);
}

#[test]
fn paced_thread_plays_every_sample_at_44100_hz() {
    let Some(_) = inside(test_name!(), || Jack::start(44_100, 1024)) else { return };
    plays_what_is_rendered("paced", 44_100, 5, 0);
}

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

/// Largest declared latency from input to output at 48 kHz and 128 frames.
const REACH_MS: f64 = 15.0;
/// Longest time in which the recommended chain is half way up.
const HALF_WAY_MS: f64 = 40.0;

/// Measures at a period, and answers the sum of what is declared [ms]. The program itself says by its exit
/// code whether both agree within a tick.
fn agrees(clock: &str, period: u64) -> f64 {
    told(|| measured(clock, period))
}

fn measured(clock: &str, period: u64) -> Result<f64, String> {
    let dir = tempfile::tempdir().unwrap();
    let mut program =
        Live::command(dir.path(), &["latency", "--host", "jack", "--inside", "--trials", "20", "--json"]);
    let (client, _) = Client::new("asperity_cable", ClientOptions::NO_START_SERVER).unwrap();
    let end = |end: &str| format!("cpal_client_{}_{end}", program.id());
    let (from, to) = (end("out:out_0"), end("in:in_0"));
    until("ports", || program.is_over() || joined(&client, &from) && joined(&client, &to));
    if program.is_over() {
        let said = program.end().err;
        assert!(said.contains("no answer"), "{said}");
        return Err(said);
    }
    client.connect_ports_by_name(&from, &to).expect("a cable");
    let ran = program.end();
    println!("{}{}", ran.out, ran.err);
    let ran = ran.ok();
    let figures: Value = serde_json::from_str(&ran.out).unwrap();
    let around = &figures["around"];
    let (declared, median) = (around["declared_ms"].as_f64().unwrap(), around["median_ms"].as_f64().unwrap());
    println!("{clock}, {period} frames: declared {declared:.2} ms, measured {median:.2} ms");
    assert_eq!((around["clock"].as_str(), around["period_frames"].as_u64()), (Some(clock), Some(period)));
    assert!((declared - median).abs() <= 2.0);
    Ok(declared)
}

#[test]
fn the_sum_is_what_is_measured_at_64_frames() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    agrees("callback", 64);
}

/// The chain is half way within 40 ms.
#[test]
fn sum_at_128_frames_is_measured_and_within_15_ms() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 128)) else { return };
    let declared_ms = agrees("paced", 128);
    let (dir, graph) = (tempfile::tempdir().unwrap(), harness::graphs("texture.ron").display().to_string());
    let asked = run(dir.path(), &["latency", &graph, "--json"]).ok();
    let figures: Value = serde_json::from_str(&asked.out).unwrap();
    let lag_ms = figures["graphs"][0]["latency"]["response_lag_ms"][1].as_f64().unwrap();
    let half_ms = declared_ms + lag_ms;
    println!("48 kHz, 128 frames: {declared_ms:.2} ms from input to output, {half_ms:.2} ms with the chain");
    assert!(declared_ms <= REACH_MS, "{declared_ms} ms are declared from input to output");
    assert!(half_ms <= HALF_WAY_MS, "half way after {half_ms} ms: {lag_ms} and {declared_ms}");
}

#[test]
fn who_has_not_joined_the_ports_is_told_how_and_may_stop() {
    let Some(_server) = inside(test_name!(), || Jack::start(48_000, 256)) else { return };
    let dir = tempfile::tempdir().unwrap();
    let mut program = Live::command(dir.path(), &["latency", "--host", "jack", "--inside"]);
    let end = |end: &str| format!("cpal_client_{}_{end}", program.id());
    let line = format!("jack_connect {} {}", end("out:out_0"), end("in:in_0"));
    program.says(&line);
    program.signal("INT");
    let ran = program.end();
    assert!(ran.code == 1 && ran.err.contains("stopped after 0 of 50 clicks"), "{}: {}", ran.code, ran.err);
}

fn hosts() -> Vec<Value> {
    let dir = std::env::temp_dir();
    let ran = run(&dir, &["devices", "--json"]).ok();
    serde_json::from_str(&ran.out).expect("JSON")
}

fn host<'a>(hosts: &'a [Value], name: &str) -> &'a Value {
    hosts.iter().find(|host| host["name"] == name).expect("a host of this build")
}

#[test]
fn a_server_that_hangs_is_named_and_the_other_hosts_answer() {
    let Some(server) = inside(test_name!(), || Jack::start(48_000, 256)) else { return };
    let there = hosts();
    let jack = &host(&there, "jack")["devices"];
    let output =
        jack.as_array().and_then(|all| all.iter().find(|d| d["id"] == "output")).expect("its output");
    assert_eq!((&output["output"]["channels"], &output["output"]["card_channels"]), (&64.into(), &2.into()));
    assert_eq!(output["output"]["rates_hz"], serde_json::json!([48_000]), "{output}");
    assert_eq!(output["output"]["buffer_frames"], serde_json::json!([256, 256]), "{output}");
    server.stop();
    let began = Instant::now();
    let hung = hosts();
    let took = began.elapsed();
    server.go_on();
    println!("devices with a JACK server that hangs: {took:.1?}");
    assert!(took < Duration::from_secs(60), "it waits for ever");
    let says = |host: &Value| host["note"].as_str().unwrap_or_default().contains("no answer");
    let silent: Vec<_> = hung.iter().filter(|host| says(host)).map(|host| &host["name"]).collect();
    assert_eq!(silent, ["jack"]);
    // ALSA has plugins that lead to JACK; what does not lead there answers as before.
    let answers = |hosts: &[Value], id: &str| {
        let all = host(hosts, "alsa")["devices"].as_array().cloned().unwrap_or_default();
        let said = |d: &Value| d["note"].as_str().is_none_or(|note| !note.contains("answer"));
        all.iter().find(|d| d["id"] == id).map(said)
    };
    for id in ["null", "default", "pulse"] {
        assert_eq!(answers(&hung, id), answers(&there, id), "{id}");
    }
    assert_ne!(answers(&hung, "jack"), Some(true));
}

#[test]
fn missing_channel_of_a_jack_card_is_told() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 256)) else { return };
    let dir = std::env::temp_dir();
    let tone =
        |channel| run(&dir, &["tone", "--host", "jack", "--seconds", "0.2", "--channel", channel]).ok().err;
    let said = tone("3");
    assert_eq!(said.matches("channel 3 leads nowhere").count(), 1, "{said}");
    assert!(said.contains("2 ports"), "{said}");
    assert!(!tone("2").contains("leads nowhere"));
}
