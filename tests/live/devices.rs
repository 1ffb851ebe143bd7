//! `asperity devices`, and what is said of a device's channels, beside a JACK server.
#![cfg(unix)]

use std::time::{Duration, Instant};

use harness::run;
use harness::servers::{Jack, inside};
use harness::test_name;
use serde_json::Value;

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
