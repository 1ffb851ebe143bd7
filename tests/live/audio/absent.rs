//! No server runs: what is asked about devices then. A file of its own, since the environment belongs to the
//! whole process.

use asperity_audio::{OpenError, Request, events, hosts, open};
use harness::{alone::apart, test_name};

use super::parts::Count;

/// An environment in which no server is found.
const NO_SERVER: [(&str, &str); 5] = [
    ("JACK_DEFAULT_SERVER", "asperity-none"),
    ("PULSE_SERVER", "unix:/nonexistent/asperity"),
    ("PULSE_RUNTIME_PATH", "/nonexistent"),
    ("XDG_RUNTIME_DIR", "/nonexistent"),
    ("RUST_BACKTRACE", "0"),
];

#[test]
fn asking_what_there_is_never_fails_and_prints_nothing() {
    let Some(printed) = apart(test_name!(), &NO_SERVER) else {
        let hosts = hosts();
        let note = |name: &str| hosts.iter().find(|host| host.name == name).unwrap().note.clone();
        assert!(note("jack").unwrap().contains("no JACK server"), "{:?}", note("jack"));
        assert!(note("pulseaudio").is_some());
        assert_eq!((note("alsa"), note("simulated")), (None, None));
        return;
    };
    assert!(!printed.contains("ALSA") && !printed.to_lowercase().contains("jack server"), "{printed}");
}

#[test]
fn named_host_that_is_away_is_an_error_without_fallback() {
    if apart(test_name!(), &NO_SERVER).is_none() {
        for host in ["jack", "pulseaudio"] {
            let (sender, _events) = events();
            let request = Request { host: Some(host.into()), ..Request::default() };
            let error = open(&request, Box::new(Count::default()), None, sender).err().unwrap();
            assert!(matches!(&error, OpenError::HostAway { host: away, .. } if away == host), "{error}");
        }
    }
}
