//! `asperity run` on a PulseAudio server, heard sample by sample beside the same graph rendered offline.

use std::path::Path;

use harness::live::{Live, told, until};
use harness::servers::{Parec, Pulse, inside};
use harness::test_name;

use crate::played::{
    self, START_S, assert_no_clicks, assert_ramps_down, clicks_where_it_should, counted, first_sound, follow,
};

const RATE: usize = 48_000;
/// Message about a device that is back; "when the device is back" is said of one that is lost.
const BACK: &str = "` is back";

/// Plays for a while and stops; answers what was heard, and what the program said.
fn heard(mut program: Live, recorder: Parec, seconds: f64) -> (Vec<[f32; 2]>, String) {
    std::thread::sleep(std::time::Duration::from_secs_f64(seconds));
    program.signal("INT");
    let said = program.end().ok().err;
    // What is on its way.
    std::thread::sleep(std::time::Duration::from_millis(500));
    (recorder.stop(), said)
}

fn play(dir: &Path) -> Live {
    crate::played::write_graph(dir, RATE as u32);
    let mut program = played::play(dir, &["--host", "pulseaudio", "--period", "1024"]);
    program.says("plays on");
    program
}

/// Seconds that are heard, of which the first two are a ramp.
const SECONDS: usize = 10;

#[test]
fn pulseaudio_plays_every_sample_of_10_s_at_1024_frames() {
    let Some(_) = inside(test_name!(), Pulse::start) else { return };
    told(is_heard_as_rendered);
}

fn is_heard_as_rendered() -> Result<(), String> {
    let dir = tempfile::tempdir().unwrap();
    let recorder = Parec::start();
    let program = play(dir.path());
    let (both, said) = heard(program, recorder, SECONDS as f64 + 0.5);
    let count = counted(dir.path());
    // A server that is kept from calling for a second is lost, as it should be.
    if count.losses > 0 || count.lost_samples > RATE as u64 {
        return Err(format!("{count:?} {said}"));
    }
    let rendered = crate::played::offline(dir.path(), count.ticks);
    let [heard, offline] = [&both, &rendered].map(|all| all.iter().map(|frame| frame[0]).collect::<Vec<_>>());
    let begin = first_sound(heard.iter().copied()).expect("a sound");
    let start = begin as i64 - first_sound(offline.iter().copied()).unwrap() as i64;
    let up = begin + (START_S * RATE as f64) as usize;
    let followed = follow(&heard, &offline, up, -start, RATE as u32).expect("the graph is heard");
    println!("{count:?} {:?}, {} samples", followed.breaks, followed.end - up);
    assert_eq!(count.clock, "paced");
    assert!(followed.end - up > (SECONDS - 3) * RATE, "only {} samples", followed.end - up);
    assert!(followed.breaks.len() as u64 <= count.underruns + count.xruns, "{followed:?} {count:?}");
    // Time that was left out before following began is in its shift.
    let left_out = u64::try_from(followed.last_shift() + start).expect("later than it began");
    assert!(left_out <= count.lost_samples, "{left_out} {count:?}");
    if followed.breaks.is_empty() && count.underruns + count.xruns == 0 {
        // The ramp too. Where the server had nothing to play it puts silence in.
        assert_no_clicks(&heard, RATE as u32);
    }
    assert_ramps_down(&heard, &offline, &followed, &count, RATE as u32);
    clicks_where_it_should(&both, &rendered, &followed, RATE as u32);
    Ok(())
}

#[test]
fn a_run_comes_back_when_a_killed_pulseaudio_does() {
    let Some(server) = inside(test_name!(), Pulse::start) else { return };
    let dir = tempfile::tempdir().unwrap();
    let mut program = play(dir.path());
    server.kill();
    program.says("is lost: ");
    let folder = std::env::var("PULSE_RUNTIME_PATH").unwrap();
    let mut next = None;
    until("another server", || {
        next = Pulse::in_folder(Path::new(&folder));
        next.is_some()
    });
    program.says(BACK);
    let recorder = Parec::start();
    let (heard, _) = heard(program, recorder, 1.0);
    let count = counted(dir.path());
    assert!(count.losses >= 1, "{count:?}");
    assert!(heard.iter().any(|x| x[0].abs() > 1e-4), "nothing is heard, {count:?}");
}

/// Asks the server something.
fn pactl(words: &[&str]) -> String {
    let output = std::process::Command::new("pactl").args(words).output().expect("pactl is installed");
    assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
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
    std::thread::sleep(std::time::Duration::from_millis(1200));
    assert!(!program.said().contains(BACK), "{}", program.said());
    assert_eq!(played_on(), [] as [String; 0], "it plays on another device");
    pactl(&sink);
    program.says(BACK);
    let sinks = pactl(&["list", "short", "sinks"]);
    let haptic = sinks.lines().find(|line| line.contains("haptic")).expect("it is loaded");
    let number = haptic.split('\t').next().unwrap_or_default();
    until("a stream", || !played_on().is_empty());
    assert_eq!(played_on(), [number], "{sinks}");
    program.signal("INT");
    program.end().ok();
    assert_eq!(counted(dir.path()).losses, 1);
}
