//! Without any server. A test program of its own, since the environment belongs to the whole process.

mod parts;

use std::process::Command;

use asperity_audio::{OpenError, Request, hosts};
use parts::refusal;

const INSIDE: &str = "ASPERITY_TEST_INSIDE";

/// Runs a test again in a child process that finds no server. `None` in the child.
fn alone(test: &str) -> Option<std::process::Output> {
    if std::env::var(INSIDE).is_ok() {
        return None;
    }
    let mut child = Command::new(std::env::current_exe().unwrap());
    child.args(["--exact", test, "--nocapture"]).env(INSIDE, "1");
    child.env("JACK_DEFAULT_SERVER", "asperity-none").env("PULSE_SERVER", "unix:/nonexistent/asperity");
    child.env("PULSE_RUNTIME_PATH", "/nonexistent").env("XDG_RUNTIME_DIR", "/nonexistent");
    child.env("RUST_BACKTRACE", "0");
    Some(child.output().unwrap())
}

#[test]
fn hosts_without_servers_lists_reasons_and_prints_nothing() {
    let Some(output) = alone("hosts_without_servers_lists_reasons_and_prints_nothing") else {
        let hosts = hosts();
        let note = |name: &str| hosts.iter().find(|host| host.name == name).unwrap().note.clone();
        assert!(note("jack").unwrap().contains("no JACK server"), "{:?}", note("jack"));
        assert!(note("pulseaudio").is_some());
        assert_eq!((note("alsa"), note("simulated")), (None, None));
        return;
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    let printed = String::from_utf8_lossy(&output.stderr);
    assert!(!printed.contains("ALSA") && !printed.to_lowercase().contains("jack server"), "{printed}");
}

#[test]
fn absent_host_is_an_error_without_fallback() {
    let Some(output) = alone("absent_host_is_an_error_without_fallback") else {
        for host in ["jack", "pulseaudio"] {
            let error = refusal(&Request { host: Some(host.into()), ..Request::default() });
            assert!(matches!(&error, OpenError::HostAway { host: away, .. } if away == host), "{error}");
        }
        return;
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
