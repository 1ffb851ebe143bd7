//! A real JACK server, with its dummy driver.

use std::time::Duration;

use asperity_audio::{Cause, Request, hosts, open};
use harness::live::until;
use harness::servers::{Jack, inside};
use harness::test_name;
use jack::{Client, ClientOptions};

use super::parts::{Count, Ear, around, calls, loss, play, record, refusal};

fn request(rate_hz: u32) -> Request {
    Request { host: Some("jack".into()), rate_hz, ..Request::default() }
}

#[test]
fn jack_input_hears_the_output_and_server_rules_the_period() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 256)) else { return };
    let (count, ear) = (Count::default(), Ear::default());
    let blocks = count.blocks.clone();
    let wanted = Request { inputs: vec![1], period_frames: Some(64), ..request(48_000) };
    let stream = record(&wanted, count, Some(ear.clone()));
    let (client, _) = Client::new("asperity_patch", ClientOptions::NO_START_SERVER).unwrap();
    until("a connection", || {
        let name = |pattern| client.ports(Some(pattern), None, jack::PortFlags::empty()).pop();
        let ends = name("cpal_client_.*_out:out_0").zip(name("cpal_client_.*_in:in_0"));
        ends.is_some_and(|(from, to)| client.connect_ports_by_name(&from, &to).is_ok())
    });
    until("a second and a half", || ear.heard().len() > 72_000);
    let (lost, whole_ms) = around(&blocks.lock().unwrap(), &ear);
    println!("around in {whole_ms:.2} ms");
    // A cable within JACK hands over within the cycle.
    assert!(lost == 0 && whole_ms < 6.0, "{lost} lost, {whole_ms} ms");

    assert_eq!((stream.period(), stream.id()), (Some(256), "jack:output".to_owned()));
    let notes = stream.notes();
    assert!(notes.iter().any(|note| note.contains("256") && note.contains("64")), "{notes:?}");
    let error = refusal(&request(44_100));
    assert!(matches!(error.cause, Cause::Rate(_)) && error.reason.contains("at 48000 Hz"), "{error}");
    let jack = hosts().into_iter().find(|host| host.name == "jack").unwrap();
    let output = jack.devices.iter().find(|device| device.default_output).unwrap().output.clone().unwrap();
    assert_eq!((output.rate_range_hz, output.buffer_frames), ((48_000, 48_000), Some((256, 256))));
}

#[test]
fn stopped_jack_is_a_loss_and_holds_nobody_up() {
    let Some(server) = inside(test_name!(), || Jack::start(48_000, 256)) else { return };
    let stream = play(&request(48_000), Count::default());
    calls(&stream, 20);
    server.stop();
    println!("stopped: {}", loss(&stream));
    drop(stream);
    assert_eq!(refusal(&request(48_000)).cause, Cause::Host);
    server.go_on();
    until("the server to answer again", || {
        let stream = open(&request(48_000), Box::new(Count::default()), None);
        stream.is_ok_and(|stream| {
            stream.play().unwrap();
            std::thread::sleep(Duration::from_millis(200));
            stream.stats().callbacks > 0
        })
    });
}
