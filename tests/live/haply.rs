//! A stand-in of the Haply service.

use std::f64::consts::TAU;
use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::ops::Deref;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use harness::live::Background;
use tungstenite::{Error, Message};

/// Behaviour of the stand-in, and the forces it received.
#[derive(Default)]
pub struct State {
    /// Devices by id.
    pub devices: Mutex<Vec<&'static str>>,
    /// Where each is, in m; without it the hand goes round in the wall.
    pub at: Mutex<Option<[f64; 3]>>,
    /// Answer instead of a report.
    pub instead: Mutex<Option<String>>,
    /// Whether it answers nothing.
    pub silent: AtomicBool,
    /// Whether it sends reports that nobody asked for.
    pub chatty: AtomicBool,
    /// Whether it sends as fast as it can, and hears nothing.
    pub flood: AtomicBool,
    pub forces: Mutex<Vec<[f64; 3]>>,
    pub asked: AtomicU64,
    pub closed: AtomicBool,
    /// Whether who connects from now on never hears a word.
    pub mute: AtomicBool,
    /// Connections of that kind, and those that were given up.
    pub unheard: AtomicUsize,
    pub given_up: AtomicUsize,
}

/// A running stand-in; dropping it kills it, connections and all.
pub struct Service {
    state: Arc<State>,
    pub address: SocketAddr,
    _thread: Background,
}

impl Deref for Service {
    type Target = State;

    fn deref(&self) -> &State {
        &self.state
    }
}

impl Service {
    /// A service with one device.
    pub fn start() -> Self {
        Self::at("127.0.0.1:0".parse().expect("an address"), &["049D"])
    }

    /// A service that takes every connection and never says a word. Opening a hand on it takes seconds, and
    /// comes to nothing.
    pub fn mute() -> Self {
        let service = Self::start();
        service.mute.store(true, Relaxed);
        service
    }

    pub fn at(address: SocketAddr, devices: &[&'static str]) -> Self {
        let state = Arc::new(State { devices: Mutex::new(devices.to_vec()), ..State::default() });
        let listener = TcpListener::bind(address).expect("a port");
        let address = listener.local_addr().expect("a port");
        listener.set_nonblocking(true).expect("a socket");
        let own = state.clone();
        let thread = Background::new(move |stop| {
            let mut held: Vec<TcpStream> = Vec::new();
            while !stop.load(Relaxed) {
                held.retain_mut(|stream| {
                    let left = match stream.read(&mut [0; 4096]) {
                        Ok(n) => n == 0,
                        Err(e) => e.kind() != ErrorKind::WouldBlock,
                    };
                    own.given_up.fetch_add(usize::from(left), Relaxed);
                    !left
                });
                match listener.accept() {
                    Ok((stream, _)) if own.mute.load(Relaxed) => {
                        stream.set_nonblocking(true).expect("a socket");
                        held.push(stream);
                        own.unheard.fetch_add(1, Relaxed);
                    }
                    Ok((stream, _)) => own.talk(stream, stop),
                    Err(_) => std::thread::sleep(Duration::from_millis(2)),
                }
            }
        });
        Self { state, address, _thread: thread }
    }
}

impl State {
    pub fn put(&self, at: [f64; 3]) {
        *self.at.lock().expect("nobody panicked") = Some(at);
    }

    /// The last force that it was told.
    pub fn last(&self) -> [f64; 3] {
        self.forces.lock().expect("nobody panicked").last().copied().unwrap_or_default()
    }

    /// The greatest upward force that was asked for.
    pub fn pushed(&self) -> f64 {
        self.forces.lock().expect("nobody panicked").iter().map(|force| force[2]).fold(0.0, f64::max)
    }

    fn report(&self, began: Instant) -> String {
        let turn = began.elapsed().as_secs_f64() * TAU;
        let round = [0.016 * turn.cos(), 0.016 * turn.sin(), -0.003];
        let [x, y, z] = self.at.lock().expect("nobody panicked").unwrap_or(round);
        let state = format!(r#"{{"cursor_position":{{"x":{x},"y":{y},"z":{z}}},"control_mode":"force"}}"#);
        let device = |id: &&str| format!(r#"{{"device_id":"{id}","state":{state},"status":{{}}}}"#);
        let list: Vec<_> = self.devices.lock().expect("nobody panicked").iter().map(device).collect();
        format!(r#"{{"session_id":7,"inverse3":[{}]}}"#, list.join(","))
    }

    fn talk(&self, stream: TcpStream, stop: &AtomicBool) {
        let set = stream.set_nonblocking(false).and(stream.set_nodelay(true));
        set.and(stream.set_read_timeout(Some(Duration::from_millis(20)))).expect("a socket");
        let Ok(mut socket) = tungstenite::accept(stream) else { return };
        let began = Instant::now();
        let mut sent = socket.send(Message::text(self.report(began)));
        while sent.is_ok() && !stop.load(Relaxed) {
            if self.flood.load(Relaxed) {
                let many = [0x81, 2, b'{', b'}'].repeat(16_384);
                while !stop.load(Relaxed) && socket.get_mut().write_all(&many).is_ok() {}
                return;
            }
            let text = match socket.read() {
                Ok(Message::Text(text)) => text,
                Ok(Message::Close(_)) => return self.closed.store(true, Relaxed),
                Ok(_) => continue,
                Err(Error::Io(e)) if e.kind() == ErrorKind::WouldBlock => continue,
                Err(_) => return,
            };
            let told: serde_json::Value = serde_json::from_str(&text).expect("JSON");
            let device = &told["inverse3"][0];
            assert!(device["device_id"].is_string());
            let values = &device["commands"]["set_cursor_force"]["values"];
            let force = ["x", "y", "z"].map(|axis| values[axis].as_f64().expect("a force"));
            self.forces.lock().expect("nobody panicked").push(force);
            self.asked.fetch_add(1, Relaxed);
            if self.silent.load(Relaxed) {
                continue;
            }
            let instead = self.instead.lock().expect("nobody panicked").clone();
            let answer = instead.unwrap_or_else(|| self.report(began));
            if self.chatty.load(Relaxed) {
                let _ = socket.send(Message::text(answer.clone()));
                let _ = socket.send(Message::text(answer.replace(r#""z":"#, r#""z":1000"#)));
            } else {
                sent = socket.send(Message::text(answer));
            }
        }
    }
}
