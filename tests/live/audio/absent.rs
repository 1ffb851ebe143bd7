//! No server runs. A process of its own, since the environment belongs to the whole process.

use asperity_audio::{Cause, Request, hosts};
use harness::{alone::apart, test_name};

use super::parts::refusal;

/// An environment in which no server is found.
const NO_SERVER: [(&str, &str); 5] = [
    ("JACK_DEFAULT_SERVER", "asperity-none"),
    ("PULSE_SERVER", "unix:/nonexistent/asperity"),
    ("PULSE_RUNTIME_PATH", "/nonexistent"),
    ("XDG_RUNTIME_DIR", "/nonexistent"),
    ("RUST_BACKTRACE", "0"),
];

#[test]
fn without_servers_hosts_say_so_and_nothing_is_printed() {
    let Some(printed) = apart(test_name!(), &NO_SERVER) else {
        let hosts = hosts();
        let note = |name: &str| hosts.iter().find(|host| host.name == name).unwrap().note.clone();
        assert!(note("jack").unwrap().contains("no JACK server"), "{:?}", note("jack"));
        assert!(note("pulseaudio").is_some());
        assert_eq!((note("alsa"), note("simulated")), (None, None));
        // No other host is opened in place of one that is named.
        for host in ["jack", "pulseaudio"] {
            let error = refusal(&Request { host: Some(host.into()), ..Request::default() });
            assert!(error.cause == Cause::Host && error.reason.contains(host), "{error}");
        }
        return;
    };
    assert!(!printed.contains("ALSA") && !printed.to_lowercase().contains("jack server"), "{printed}");
}
