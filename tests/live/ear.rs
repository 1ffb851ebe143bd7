//! A JACK client that records what the program plays.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::*};
use std::time::{Duration, Instant};

use harness::live::{PATIENCE, until};
use harness::servers::STUCK;
use jack::{AsyncClient, AudioIn, Client, ClientOptions, Control, Port, ProcessHandler, ProcessScope};

/// Longest time between the first port of a program and its second one.
const SOON: Duration = Duration::from_secs(1);

/// Two ports in memory that is there beforehand.
struct Tape {
    ports: [Port<AudioIn>; 2],
    frames: Vec<[f32; 2]>,
    come: Arc<AtomicUsize>,
}

impl ProcessHandler for Tape {
    fn process(&mut self, _: &Client, scope: &ProcessScope) -> Control {
        let room = self.frames.capacity() - self.frames.len();
        let [one, two] = self.ports.each_ref().map(|port| port.as_slice(scope));
        self.frames.extend(one.iter().zip(two).map(|(a, b)| [*a, *b]).take(room));
        self.come.store(self.frames.len(), Release);
        Control::Continue
    }
}

/// Whether the program has joined its port to the card's. A server whose client is joined to another while it
/// becomes active may hang. Looking asks nothing of the server.
pub(crate) fn joined(client: &Client, port: &str) -> bool {
    client.port_by_name(port).is_some_and(|port| port.connected_count().is_ok_and(|count| count > 0))
}

/// Records what a process plays, from its first sample on.
pub(crate) struct Ear {
    client: AsyncClient<(), Tape>,
    come: Arc<AtomicUsize>,
}

impl Ear {
    /// Room for so many frames.
    pub(crate) fn new(frames: usize) -> Self {
        let (client, _) = Client::new("asperity_ear", ClientOptions::NO_START_SERVER).unwrap();
        let ports = ["in_0", "in_1"].map(|name| client.register_port(name, AudioIn::default()).unwrap());
        let come = Arc::new(AtomicUsize::new(0));
        let tape = Tape { ports, frames: Vec::with_capacity(frames), come: Arc::clone(&come) };
        Self { client: client.activate_async((), tape).unwrap(), come }
    }

    /// Joins it to what a process plays, as soon as that has ports.
    pub(crate) fn hear(&self, process: u32) {
        let client = self.client.as_client();
        for n in 0..2 {
            let from = format!("cpal_client_{process}_out:out_{n}");
            let began = Instant::now();
            // Busily: what is played before is not heard. One channel may be all there is.
            while !joined(client, &from) && (n == 0 || began.elapsed() < SOON) {
                assert!(began.elapsed() < PATIENCE, "there is no port {from}");
                std::thread::sleep(Duration::from_micros(500));
            }
            if joined(client, &from) {
                self.connect(&from, n);
            }
        }
    }

    /// Joins one of its ports to a port of this name, as soon as there is one.
    pub(crate) fn connect(&self, from: &str, n: usize) {
        let client = self.client.as_client();
        let to = format!("{}:in_{n}", client.name());
        until("a connection", || client.connect_ports_by_name(from, &to).is_ok());
    }

    /// Frames that have come.
    pub(crate) fn frames(&self) -> usize {
        self.come.load(Acquire)
    }

    /// Waits for so many frames more.
    pub(crate) fn wait(&self, frames: usize) {
        let most = self.frames() + frames;
        until(&format!("{frames} samples more: {STUCK}"), || self.frames() >= most);
    }

    /// Runs the server as fast as it goes until so many frames more have come.
    pub(crate) fn freewheel(&self, frames: usize) {
        let set = |on: i32| {
            // SAFETY: the client is open and stays so during the call, which is made outside of its
            // callbacks.
            let refused = unsafe { jack::jack_sys::jack_set_freewheel(self.client.as_client().raw(), on) };
            assert_eq!(refused, 0, "JACK refuses freewheel {on}");
        };
        set(1);
        self.wait(frames);
        set(0);
    }

    /// The frames that were heard.
    pub(crate) fn stop(self) -> Vec<[f32; 2]> {
        match self.client.deactivate() {
            Ok((_, (), tape)) => tape.frames,
            Err(e) => panic!("what was heard is gone: {e}"),
        }
    }
}
