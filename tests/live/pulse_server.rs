//! `asperity run` on a PulseAudio server, heard sample by sample beside the same graph rendered offline.

use std::time::Duration;

use harness::live::{Live, told, until};
use harness::servers::{Parec, Pulse, inside};
use harness::test_name;

use crate::audio::pactl;
use crate::played::{self, is_as_rendered, report};

const RATE: u32 = 48_000;
/// Message about a device that is back; "when the device is back" is said of one that is lost.
const BACK: &str = "` is back";

fn play(dir: &std::path::Path) -> Live {
    played::write_graph(dir, RATE);
    let mut program = played::play(dir, &["--host", "pulseaudio", "--period", "1024"]);
    program.says("plays on");
    program
}

#[test]
fn pulseaudio_plays_every_sample_at_1024_frames() {
    let Some(_) = inside(test_name!(), Pulse::start) else { return };
    told(|| {
        let dir = tempfile::tempdir().unwrap();
        let recorder = Parec::start();
        let program = play(dir.path());
        std::thread::sleep(Duration::from_millis(5500));
        program.stop().ok();
        // What is on its way.
        std::thread::sleep(Duration::from_millis(500));
        assert_eq!(report(dir.path())["clock"], "paced");
        is_as_rendered(dir.path(), &recorder.stop(), RATE, 4.0)
    });
}

/// The sinks that somebody plays on, by their numbers.
fn played_on() -> Vec<String> {
    let list = pactl(&["list", "short", "sink-inputs"]);
    list.lines().filter_map(|line| line.split('\t').nth(1).map(str::to_owned)).collect()
}

/// Another device is the default by then.
#[test]
fn lost_default_device_is_waited_for() {
    let Some(_) = inside(test_name!(), Pulse::start) else { return };
    let dir = tempfile::tempdir().unwrap();
    let sink = ["load-module", "module-null-sink", "sink_name=haptic", "rate=48000"];
    let module = pactl(&sink);
    pactl(&["set-default-sink", "haptic"]);
    let mut program = play(dir.path());
    pactl(&["unload-module", &module]);
    program.says("is lost: ");
    program.says("is not back: ");
    assert_eq!(pactl(&["get-default-sink"]), "test");
    // It is looked for every half second.
    std::thread::sleep(Duration::from_millis(1200));
    assert!(!program.said().contains(BACK), "{}", program.said());
    assert_eq!(played_on(), [] as [String; 0], "it plays on another device");
    pactl(&sink);
    program.says(BACK);
    let sinks = pactl(&["list", "short", "sinks"]);
    let haptic = sinks.lines().find(|line| line.contains("haptic")).expect("it is loaded");
    let number = haptic.split('\t').next().unwrap_or_default();
    until("a stream", || !played_on().is_empty());
    assert_eq!(played_on(), [number], "{sinks}");
    program.stop().ok();
    assert_eq!(report(dir.path())["losses"], 1);
}
