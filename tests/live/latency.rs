//! `asperity latency` over a cable inside a JACK server.

use harness::live::{Live, told, until};
use harness::servers::{Jack, inside};
use harness::test_name;
use jack::{Client, ClientOptions};

use crate::ear::joined;

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
    let figures: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
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
    let asked = harness::run(dir.path(), &["latency", &graph, "--json"]).ok();
    let figures: serde_json::Value = serde_json::from_str(&asked.out).unwrap();
    let lag_ms = figures["graphs"][0]["lag_ms"][1].as_f64().unwrap();
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
