//! A real PulseAudio server with a null sink.

use std::process::Command;
use std::time::{Duration, Instant};

use asperity_audio::{Capture, Event, OpenError, Request, events, hosts, open};
use harness::live::{told, until};
use harness::servers::{Parec, Pulse, inside};
use harness::test_name;

use super::parts::{Count, Ear, Loop, Recorder, play, wait_for_loss};

fn request() -> Request {
    Request { host: Some("pulseaudio".into()), device: Some("test".into()), ..Request::default() }
}

#[test]
fn every_sample_arrives_at_1024_frames() {
    let Some(_) = inside(test_name!(), Pulse::start) else { return };
    let tape = Parec::start();
    let (process, seen) = Recorder::new();
    let (sender, received) = events();
    let wanted = Request { channels: vec![2], period_frames: Some(1024), ..request() };
    let stream = open(&wanted, Box::new(process), None, sender).unwrap();
    stream.play().unwrap();
    std::thread::sleep(Duration::from_secs(3));
    let frames = tape.stop();
    assert!(frames.iter().all(|frame| frame[0] == 0.0), "channel 1 is not silent");
    // A machine that is too busy makes gaps of silence; what is played is neither lost nor repeated all the
    // same.
    let begin = frames.iter().position(|frame| frame[1] != 0.0).expect("something is played");
    let played: Vec<f32> =
        frames[begin..].iter().map(|frame| frame[1]).filter(|sample| *sample != 0.0).collect();
    assert!(played.len() > 48_000, "only {} frames in 3 s", played.len());
    for (at, sample) in played.iter().enumerate() {
        assert_eq!(f64::from(*sample), Count::value(at), "frame {at}");
    }
    println!("silence within: {} frames of {}", frames.len() - begin - played.len(), frames.len() - begin);
    println!("periods {:?}, median {:?}", stream.period_range(), stream.period());
    // Somewhat more than was asked for, as a rule.
    assert!((900..1300).contains(&stream.period().unwrap()), "{:?}", stream.period_range());
    assert!(received.try_iter().all(|event| !matches!(event, Event::Lost { .. })));
    let mut ahead: Vec<u64> = seen.lock().unwrap().iter().map(|(_, ahead)| *ahead / 1000).collect();
    ahead.sort_unstable();
    println!("ahead p10/p50/p90 {:?} us", [1, 5, 9].map(|tenth| ahead[ahead.len() * tenth / 10]));
}

#[test]
fn an_input_hears_what_an_output_plays_and_the_stamps_add_up() {
    let Some(_) = inside(test_name!(), Pulse::start) else { return };
    for period in [1024, 256] {
        let (tape, process, capture) = Loop::new();
        let (sender, _events) = events();
        let input_device = Some("test.monitor".to_owned());
        let wanted = Request { input_device, inputs: vec![1], period_frames: Some(period), ..request() };
        let stream = open(&wanted, process, Some(capture), sender).unwrap();
        assert_eq!(stream.input_id().as_deref(), Some("pulseaudio:test.monitor"));
        stream.play().unwrap();
        until("two seconds", || tape.frames() > 96_000);
        drop(stream);
        // PulseAudio drops what it recorded, and does not say so, where a busy machine takes it too late.
        let heard = tape.check(48_000);
        println!("period {period}: {heard:.2?}");
        // Within 0.4 ms on a quiet machine; PulseAudio is asked for its latency by a thread that may come
        // late on a busy one.
        assert!((heard.whole - heard.ahead - heard.behind).abs() < 20.0);
    }
}

/// Nobody asks for a period here.
#[test]
fn default_period_is_far_below_two_seconds() {
    let Some(_) = inside(test_name!(), Pulse::start) else { return };
    let stream = play(&request(), Count::default());
    until("calls", || stream.stats().callbacks > 60);
    let period = stream.period().unwrap();
    println!("asked for 256: {:?}, median {period}", stream.period_range());
    assert!((128..=512).contains(&period), "{period}");
    let small = play(&Request { period_frames: Some(64), ..request() }, Count::default());
    until("calls", || small.stats().callbacks > 60);
    println!("asked for 64: {:?}, median {:?}", small.period_range(), small.period());
    let slow = play(&Request { rate_hz: 44_100, ..request() }, Count::default());
    assert!(slow.notes().iter().any(|note| note.contains("resamples")), "{:?}", slow.notes());
}

#[test]
fn a_device_or_channel_that_the_server_would_make_up_is_refused() {
    let Some(_) = inside(test_name!(), Pulse::start) else { return };
    let refusal = |request: &Request| {
        let (sender, _events) = events();
        open(request, Box::new(Count::default()), None, sender).err().unwrap()
    };
    let error = refusal(&Request { device: Some("tset".into()), ..request() });
    assert!(
        matches!(error, OpenError::NoDevice { .. }) && error.to_string().contains("pulseaudio:test"),
        "{error}"
    );
    // Without a host all of them are searched, and those that do not answer are named.
    let error = refusal(&Request { host: None, device: Some("tset".into()), ..request() });
    let told = error.to_string();
    assert!(told.contains("pulseaudio:test") && told.contains("jack: "), "{error}");
    let error = refusal(&Request { channels: vec![3], ..request() });
    assert!(matches!(error, OpenError::NoChannel { there: 2, .. }), "{error}");
    let pulse = hosts().into_iter().find(|host| host.name == "pulseaudio").unwrap();
    let output = pulse.devices.iter().find(|device| device.id == "test").unwrap().output.clone().unwrap();
    assert_eq!((output.channels, output.rate_hz, output.rates_hz.len()), (2, Some(48_000), 3));
}

#[test]
fn a_server_that_is_killed_is_a_loss() {
    let Some(server) = inside(test_name!(), Pulse::start) else { return };
    let (sender, received) = events();
    let stream = open(&request(), Box::new(Count::default()), None, sender).unwrap();
    stream.play().unwrap();
    until("calls", || stream.stats().callbacks > 20);
    let killed = Instant::now();
    server.kill();
    let (reason, _) = wait_for_loss(&received);
    println!("killed: lost after {} ms: {reason}", killed.elapsed().as_millis());
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(received.try_iter().count(), 0, "told once");
    drop(stream);
    let (sender, _events) = events();
    let error = open(&request(), Box::new(Count::default()), None, sender).err().unwrap();
    println!("then: {error}");
    assert!(matches!(error, OpenError::HostAway { .. }), "{error}");
}

#[test]
fn stopped_server_is_a_loss_though_it_says_nothing() {
    let Some(server) = inside(test_name!(), Pulse::start) else { return };
    let (sender, received) = events();
    let stream = open(&request(), Box::new(Count::default()), None, sender).unwrap();
    stream.play().unwrap();
    until("calls", || stream.stats().callbacks > 20);
    let stopped = Instant::now();
    server.stop();
    let (reason, _) = wait_for_loss(&received);
    println!("stopped: lost after {} ms: {reason}", stopped.elapsed().as_millis());
    let closing = Instant::now();
    drop(stream);
    println!("closed after {} ms", closing.elapsed().as_millis());
    let (sender, _events) = events();
    let error = open(&request(), Box::new(Count::default()), None, sender).err().unwrap();
    println!("then: {error}");
    assert!(matches!(error, OpenError::HostAway { .. }), "{error}");
    server.go_on();
    until("the server to answer again", || {
        let (sender, _events) = events();
        open(&request(), Box::new(Count::default()), None, sender).is_ok()
    });
}

#[test]
fn alsa_over_a_killed_server_is_a_loss_and_its_flood_ends() {
    let Some(server) = inside(test_name!(), Pulse::start) else { return };
    let wanted = Request { host: Some("alsa".into()), device: Some("pulse".into()), ..Request::default() };
    let wanted = Request { period_frames: Some(1024), ..wanted };
    // On a machine that is too busy the plugin may fall silent after an underrun: that is a loss too, and
    // another try.
    let mut tries = 0;
    let (stream, received) = loop {
        let (sender, received) = events();
        let stream = match open(&wanted, Box::new(Count::default()), None, sender) {
            Err(OpenError::NoDevice { .. }) => {
                return harness::servers::skipped(
                    "ALSA has no Pulse plugin: apt-get install libasound2-plugins",
                );
            }
            opened => opened.unwrap(),
        };
        stream.play().unwrap();
        until("calls or a loss", || stream.stats().callbacks > 20 || stream.lost().is_some());
        if stream.lost().is_none() {
            break (stream, received);
        }
        println!("before: {:?}", stream.lost());
        tries += 1;
        assert!(tries < 10, "it never goes on");
    };
    println!("asked for 1024: {:?}, median {:?}", stream.period_range(), stream.period());
    println!("ahead {:.1} ms", stream.stats().latency_ms);
    let killed = Instant::now();
    server.kill();
    let (reason, _) = wait_for_loss(&received);
    println!(
        "killed: lost after {} ms, {} errors: {reason}",
        killed.elapsed().as_millis(),
        stream.stats().errors
    );
    let errors = stream.stats().errors;
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(stream.stats().errors, errors, "errors still come");
}

/// Asks the server something.
fn pactl(words: &[&str]) -> String {
    let output = Command::new("pactl").args(words).output().expect("pactl is installed");
    assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
}

#[test]
fn a_stream_that_goes_on_takes_no_more_files_and_threads() {
    let Some(_) = inside(test_name!(), Pulse::start) else { return };
    let taken = || ["fd", "task"].map(|of| std::fs::read_dir(format!("/proc/self/{of}")).unwrap().count());
    let stream = play(&request(), Count::default());
    until("calls", || stream.stats().callbacks > 200);
    let before = taken();
    std::thread::sleep(Duration::from_secs(4));
    println!("files and threads: {before:?}, 4 s later {:?}", taken());
    assert!(taken().iter().zip(before).all(|(now, before)| *now <= before + 1));
}

#[test]
fn vanished_device_is_a_loss_and_not_replaced() {
    let Some(_) = inside(test_name!(), Pulse::start) else { return };
    for (what, device, input) in [
        ("by name", Some("haptic"), None),
        ("default", None, None),
        ("input", Some("test"), Some("haptic.monitor")),
    ] {
        told(|| {
            let sink = pactl(&["load-module", "module-null-sink", "sink_name=haptic", "rate=48000"]);
            pactl(&["set-default-sink", "haptic"]);
            let wanted = Request { device: device.map(str::to_owned), ..request() };
            let inputs = if input.is_some() { vec![1] } else { Vec::new() };
            let wanted = Request { input_device: input.map(str::to_owned), inputs, ..wanted };
            let capture = input.map(|_| Box::new(Ear::new().0) as Box<dyn Capture>);
            let (sender, received) = events();
            let stream = open(&wanted, Box::new(Count::default()), capture, sender).unwrap();
            assert!(input.is_some() || stream.id() == "pulseaudio:haptic", "{}", stream.id());
            stream.play().unwrap();
            until("calls", || stream.lost().is_some() || stream.stats().callbacks > 200);
            if let Some(reason) = stream.lost() {
                pactl(&["unload-module", &sink]);
                return Err(format!("{what}: lost before the device is gone: {reason}"));
            }
            let unloaded = Instant::now();
            pactl(&["unload-module", &sink]);
            let (reason, _) = wait_for_loss(&received);
            println!("{what}: lost after {} ms: {reason}", unloaded.elapsed().as_millis());
            assert!(reason.contains("the device is gone: pulseaudio:haptic"), "{what}: {reason}");
            Ok(())
        });
    }
}
