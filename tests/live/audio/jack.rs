//! A real JACK server, with its dummy driver.

use std::time::{Duration, Instant};

use asperity_audio::{Event, OpenError, Request, events, hosts, open};
use harness::live::until;
use harness::servers::{Jack, inside};
use harness::test_name;
use jack::{AsyncClient, AudioIn, Client, ClientOptions, Control, Port, ProcessHandler, ProcessScope};

use super::parts::{Count, Loop, Recorder, play, wait_for_loss};

fn request(rate_hz: u32) -> Request {
    Request { host: Some("jack".into()), rate_hz, ..Request::default() }
}

/// Records a port of JACK, in memory that is there beforehand.
struct Tape {
    port: Port<AudioIn>,
    samples: Vec<f32>,
    full: std::sync::mpsc::SyncSender<Vec<f32>>,
}

impl ProcessHandler for Tape {
    fn process(&mut self, _: &Client, scope: &ProcessScope) -> Control {
        let room = self.samples.capacity() - self.samples.len();
        let come = self.port.as_slice(scope);
        self.samples.extend(come.iter().take(room));
        // An empty one has been sent. It goes on: the server would wait for a client that does not.
        if !self.samples.is_empty() && self.samples.len() == self.samples.capacity() {
            let _ = self.full.try_send(std::mem::take(&mut self.samples));
        }
        Control::Continue
    }
}

/// Records so many samples of the port that `from` names, from the moment on when it is connected.
fn record(from: &str, length: usize) -> (AsyncClient<(), Tape>, std::sync::mpsc::Receiver<Vec<f32>>) {
    let (client, _) = Client::new("asperity_ear", ClientOptions::NO_START_SERVER).unwrap();
    let port = client.register_port("in", AudioIn::default()).unwrap();
    let to = port.name().unwrap();
    let (full, recorded) = std::sync::mpsc::sync_channel(1);
    let client = client.activate_async((), Tape { port, samples: Vec::with_capacity(length), full }).unwrap();
    // A port is there before it can be connected.
    until("a connection", || {
        let ports = client.as_client().ports(Some(from), None, jack::PortFlags::IS_OUTPUT);
        ports.iter().any(|port| client.as_client().connect_ports_by_name(port, &to).is_ok())
    });
    (client, recorded)
}

/// Two seconds of what port 2 of a stream on channel 2 plays: nothing lost, repeated or reordered.
fn sample_exact(rate_hz: u32, period: u32) {
    let (process, seen) = Recorder::new();
    let (sender, received) = events();
    let stream =
        open(&Request { channels: vec![2], ..request(rate_hz) }, Box::new(process), None, sender).unwrap();
    let (_client, recorded) = record("cpal_client_.*_out:out_1", 2 * rate_hz as usize);
    stream.play().unwrap();
    let samples = recorded.recv_timeout(Duration::from_secs(30)).unwrap();
    let first = samples.iter().position(|sample| *sample != 0.0).expect("something is played");
    assert!(samples.len() - first > rate_hz as usize, "it began late");
    for (at, sample) in samples[first..].iter().enumerate() {
        assert_eq!(
            f64::from(*sample),
            Count::value(at),
            "at {rate_hz} Hz, sample {at} of {}",
            samples.len() - first
        );
    }
    assert_eq!(stream.period_range(), Some((period, period)));
    assert!(received.try_iter().all(|event| !matches!(event, Event::Lost { .. })));
    let mut ahead: Vec<u64> = seen.lock().unwrap().iter().map(|(_, ahead)| *ahead / 1000).collect();
    ahead.sort_unstable();
    println!("{rate_hz} Hz, period {period}: ahead {} to {} us", ahead[0], ahead[ahead.len() - 1]);
}

#[test]
fn every_sample_arrives_at_44100_hz() {
    let Some(_) = inside(test_name!(), || Jack::start(44_100, 128)) else { return };
    sample_exact(44_100, 128);
}

#[test]
fn every_sample_arrives_at_48000_hz() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    sample_exact(48_000, 64);
}

#[test]
fn every_sample_arrives_at_96000_hz() {
    let Some(_) = inside(test_name!(), || Jack::start(96_000, 1024)) else { return };
    sample_exact(96_000, 1024);
}

#[test]
fn an_input_hears_what_an_output_plays_and_the_stamps_add_up() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 256)) else { return };
    let (tape, process, capture) = Loop::new();
    let (sender, _events) = events();
    let stream =
        open(&Request { inputs: vec![1], ..request(48_000) }, process, Some(capture), sender).unwrap();
    let (client, _) = Client::new("asperity_patch", ClientOptions::NO_START_SERVER).unwrap();
    until("a connection", || {
        let name = |pattern| client.ports(Some(pattern), None, jack::PortFlags::empty()).pop();
        let ends = name("cpal_client_.*_out:out_0").zip(name("cpal_client_.*_in:in_0"));
        ends.is_some_and(|(from, to)| client.connect_ports_by_name(&from, &to).is_ok())
    });
    stream.play().unwrap();
    until("two seconds", || tape.frames() > 96_000);
    let heard = tape.check(48_000);
    println!("{heard:.2?}");
    assert_eq!(heard.lost, 0);
    // A cable within JACK hands over within the cycle. The stamps speak of the card's converters, which it
    // does not pass.
    assert!(heard.whole < 6.0);
}

#[test]
fn the_server_sets_rate_and_period_and_the_user_hears_of_it() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 256)) else {
        return;
    };
    let stream = play(&Request { period_frames: Some(64), ..request(48_000) }, Count::default());
    until("a call", || stream.stats().callbacks > 0);
    assert_eq!((stream.period(), stream.id()), (Some(256), "jack:output".to_owned()));
    assert!(
        stream.notes().iter().any(|note| note.contains("256") && note.contains("64")),
        "{:?}",
        stream.notes()
    );
    let (sender, _events) = events();
    let error = open(&request(44_100), Box::new(Count::default()), None, sender).err().unwrap();
    assert!(
        matches!(error, OpenError::NoRate { .. }) && error.to_string().contains("at 48000 Hz"),
        "{error}"
    );
    let jack = hosts().into_iter().find(|host| host.name == "jack").unwrap();
    let output = jack.devices.iter().find(|device| device.default_output).unwrap().output.clone().unwrap();
    assert_eq!((output.rate_range_hz, output.buffer_frames), ((48_000, 48_000), Some((256, 256))));
}

#[test]
fn killed_server_is_a_loss_and_the_next_one_opens() {
    let Some(server) = inside(test_name!(), || Jack::start(48_000, 256)) else { return };
    let (sender, received) = events();
    let stream = open(&request(48_000), Box::new(Count::default()), None, sender).unwrap();
    stream.play().unwrap();
    until("a call", || stream.stats().callbacks > 20);
    let killed = Instant::now();
    server.kill();
    let (reason, _) = wait_for_loss(&received);
    println!("killed: lost after {} ms: {reason}", killed.elapsed().as_millis());
    drop(stream);
    let (sender, _events) = events();
    let error = open(&request(48_000), Box::new(Count::default()), None, sender).err().unwrap();
    println!("then: {error}");
    assert!(matches!(error, OpenError::HostAway { .. }), "{error}");
    let name = std::env::var("JACK_DEFAULT_SERVER").unwrap();
    let _next = Jack::named(&name, 48_000, 128).unwrap();
    let again = play(&request(48_000), Count::default());
    until("a call", || again.stats().callbacks > 20);
    assert_eq!(again.period(), Some(128));
}

#[test]
fn a_server_that_is_stopped_is_a_loss_and_holds_nobody_up() {
    let Some(server) = inside(test_name!(), || Jack::start(48_000, 256)) else { return };
    let (sender, received) = events();
    let stream = open(&request(48_000), Box::new(Count::default()), None, sender).unwrap();
    stream.play().unwrap();
    until("a call", || stream.stats().callbacks > 20);
    let stopped = Instant::now();
    server.stop();
    let (reason, _) = wait_for_loss(&received);
    println!("stopped: lost after {} ms: {reason}", stopped.elapsed().as_millis());
    let closing = Instant::now();
    drop(stream);
    println!("closed after {} ms", closing.elapsed().as_millis());
    let (sender, _events) = events();
    let error = open(&request(48_000), Box::new(Count::default()), None, sender).err().unwrap();
    println!("then: {error}");
    assert!(matches!(error, OpenError::HostAway { .. }), "{error}");
    server.go_on();
    until("the server to answer again", || {
        let (sender, _events) = events();
        let stream = open(&request(48_000), Box::new(Count::default()), None, sender);
        stream.is_ok_and(|stream| {
            stream.play().unwrap();
            std::thread::sleep(Duration::from_millis(200));
            stream.stats().callbacks > 0
        })
    });
}
