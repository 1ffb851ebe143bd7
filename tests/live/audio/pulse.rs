//! A real PulseAudio server with a null sink.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use asperity_audio::{Cause, Request, hosts, open};
use harness::live::{told, until};
use harness::servers::{Process, Pulse, inside};
use harness::test_name;

use super::parts::{Count, Ear, around, calls, loss, play, record, refusal};

fn request() -> Request {
    Request { host: Some("pulseaudio".into()), device: Some("test".into()), ..Request::default() }
}

#[test]
fn pulse_input_hears_the_output_after_the_reported_latency() {
    let Some(_) = inside(test_name!(), Pulse::start) else { return };
    for period in [1024, 256] {
        let (count, ear) = (Count::default(), Ear::default());
        let blocks = count.blocks.clone();
        let input_device = Some("test.monitor".to_owned());
        let wanted = Request { input_device, inputs: vec![1], period_frames: Some(period), ..request() };
        let stream = record(&wanted, count, Some(ear.clone()));
        assert_eq!(stream.input_id().as_deref(), Some("pulseaudio:test.monitor"));
        until("a second and a half", || ear.heard().len() > 72_000);
        let told_ms = stream.stats().latency_ms + stream.input_stats().unwrap().latency_ms;
        drop(stream);
        // PulseAudio drops what it recorded, and does not say so, where a busy machine takes it too late.
        let (lost, whole_ms) = around(&blocks.lock().unwrap(), &ear);
        println!("period {period}: {whole_ms:.2} ms, {told_ms:.2} told, {lost} lost");
        // PulseAudio is asked for its latency by a thread that may come late on a busy machine.
        assert!((whole_ms - told_ms).abs() < 20.0, "{whole_ms} ms, {told_ms} told");
    }
}

/// Nobody asks for a period here.
#[test]
fn default_period_is_far_below_two_seconds() {
    let Some(_) = inside(test_name!(), Pulse::start) else { return };
    let stream = play(&request(), Count::default());
    calls(&stream, 60);
    let period = stream.period().unwrap();
    assert!((128..=512).contains(&period), "{period}");
    let slow = play(&Request { rate_hz: 44_100, ..request() }, Count::default());
    assert!(slow.notes().iter().any(|note| note.contains("resamples")), "{:?}", slow.notes());
    // A stream that goes on takes no more files and threads.
    drop(slow);
    let taken = || ["fd", "task"].map(|of| std::fs::read_dir(format!("/proc/self/{of}")).unwrap().count());
    calls(&stream, 100);
    let before = taken();
    std::thread::sleep(Duration::from_secs(1));
    assert!(taken().iter().zip(before).all(|(now, before)| *now <= before + 1), "{before:?} {:?}", taken());
}

#[test]
fn device_or_channel_that_pulse_would_make_up_is_refused() {
    let Some(_) = inside(test_name!(), Pulse::start) else { return };
    let error = refusal(&Request { device: Some("tset".into()), ..request() });
    assert!(error.cause == Cause::Device && error.reason.contains("pulseaudio:test"), "{error}");
    // Without a host all of them are searched, and those that do not answer are named.
    let error = refusal(&Request { host: None, device: Some("tset".into()), ..request() });
    assert!(error.reason.contains("pulseaudio:test") && error.reason.contains("jack: "), "{error}");
    let error = refusal(&Request { channels: vec![3], ..request() });
    assert_eq!(error.cause, Cause::Channel(2), "{error}");
    let pulse = hosts().into_iter().find(|host| host.name == "pulseaudio").unwrap();
    let output = pulse.devices.iter().find(|device| device.id == "test").unwrap().output.clone().unwrap();
    assert_eq!((output.channels, output.rate_hz, output.rates_hz.len()), (2, Some(48_000), 3));
}

#[test]
fn stopped_or_killed_pulse_is_a_loss_and_the_next_one_opens() {
    let Some(server) = inside(test_name!(), Pulse::start) else { return };
    let lost = |harm: fn(&Process)| {
        let stream = play(&request(), Count::default());
        calls(&stream, 20);
        harm(&server);
        println!("{}", loss(&stream));
        drop(stream);
        assert_eq!(refusal(&request()).cause, Cause::Host);
    };
    // A server that is stopped says nothing.
    lost(Process::stop);
    server.go_on();
    until("the server to answer again", || open(&request(), Box::new(Count::default()), None).is_ok());
    lost(Process::kill);
    let folder = std::env::var("PULSE_RUNTIME_PATH").unwrap();
    let _next = Pulse::in_folder(Path::new(&folder)).expect("another server");
    calls(&play(&request(), Count::default()), 20);
}

#[test]
fn alsa_over_a_killed_server_is_a_loss_and_its_flood_ends() {
    let Some(server) = inside(test_name!(), Pulse::start) else { return };
    let wanted = Request { host: Some("alsa".into()), device: Some("pulse".into()), ..Request::default() };
    let wanted = Request { period_frames: Some(1024), ..wanted };
    // On a machine that is too busy the plugin may fall silent after an underrun: that is a loss too, and
    // another try.
    let stream = told(|| {
        let stream = match open(&wanted, Box::new(Count::default()), None) {
            Err(e) if e.reason.contains("there is no output device") => return Ok(None),
            opened => opened.unwrap(),
        };
        stream.play().unwrap();
        until("calls or a loss", || stream.stats().callbacks > 20 || stream.lost().is_some());
        stream.lost().map_or(Ok(()), |why| Err(why.to_owned())).map(|()| Some(stream))
    });
    let Some(stream) = stream else {
        return harness::servers::skipped("ALSA has no Pulse plugin: apt-get install libasound2-plugins");
    };
    server.kill();
    println!("killed: {}", loss(&stream));
    let errors = stream.stats().errors;
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(stream.stats().errors, errors, "errors still come");
}

/// Asks the server something.
pub(crate) fn pactl(words: &[&str]) -> String {
    let output = Command::new("pactl").args(words).output().expect("pactl is installed");
    assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
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
            let stream = record(&wanted, Count::default(), input.map(|_| Ear::default()));
            assert!(input.is_some() || stream.id() == "pulseaudio:haptic", "{}", stream.id());
            until("calls", || stream.lost().is_some() || stream.stats().callbacks > 60);
            let before = stream.lost().map(str::to_owned);
            pactl(&["unload-module", &sink]);
            if let Some(reason) = before {
                return Err(format!("{what}: lost before the device is gone: {reason}"));
            }
            let reason = loss(&stream);
            assert!(reason.contains("the device is gone: pulseaudio:haptic"), "{what}: {reason}");
            Ok(())
        });
    }
}
