//! A stand-in of the Haply service.

use std::f64::consts::TAU;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tungstenite::Message;

/// A stand-in of the Haply service with one device, whose hand goes round in the wall.
pub struct Service {
    pub address: SocketAddr,
    stop: Arc<AtomicBool>,
    /// The greatest upward force that was asked for.
    pub pushed: Arc<Mutex<f64>>,
    /// Whether who connects from now on never hears a word.
    pub mute: Arc<AtomicBool>,
    /// Connections of that kind.
    pub unheard: Arc<AtomicUsize>,
    thread: Option<JoinHandle<()>>,
}

impl Service {
    pub fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        listener.set_nonblocking(true).expect("a socket");
        let address = listener.local_addr().expect("a port");
        let (stop, pushed) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(0.0)));
        let (ends, most) = (stop.clone(), pushed.clone());
        let (mute, unheard) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
        let (says_nothing, count) = (mute.clone(), unheard.clone());
        let thread = std::thread::spawn(move || {
            let mut held = Vec::new();
            while !ends.load(Relaxed) {
                match listener.accept() {
                    Ok((stream, _)) if says_nothing.load(Relaxed) => {
                        held.push(stream);
                        count.fetch_add(1, Relaxed);
                    }
                    Ok((stream, _)) => serve(stream, &ends, &most),
                    Err(_) => std::thread::sleep(Duration::from_millis(2)),
                }
            }
        });
        Self { address, stop, pushed, mute, unheard, thread: Some(thread) }
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn serve(stream: TcpStream, stop: &AtomicBool, pushed: &Mutex<f64>) {
    let set = stream.set_nonblocking(false).and(stream.set_nodelay(true));
    set.and(stream.set_read_timeout(Some(Duration::from_millis(100)))).expect("a socket");
    let Ok(mut socket) = tungstenite::accept(stream) else { return };
    let began = Instant::now();
    let report = || {
        let turn = began.elapsed().as_secs_f64() * 1.0 * TAU;
        let (x, y) = (0.016 * turn.cos(), 0.016 * turn.sin());
        let state = format!(r#"{{"cursor_position":{{"x":{x},"y":{y},"z":-0.003}}}}"#);
        format!(r#"{{"inverse3":[{{"device_id":"049D","state":{state},"status":{{}}}}]}}"#)
    };
    let mut sent = socket.send(Message::text(report()));
    while sent.is_ok() && !stop.load(Relaxed) {
        match socket.read() {
            Ok(Message::Text(text)) => {
                let told: serde_json::Value = serde_json::from_str(&text).expect("JSON");
                let up = &told["inverse3"][0]["commands"]["set_cursor_force"]["values"]["z"];
                let mut most = pushed.lock().expect("nobody panicked");
                *most = most.max(up.as_f64().expect("a force"));
                drop(most);
                sent = socket.send(Message::text(report()));
            }
            Ok(Message::Close(_)) => return,
            Err(tungstenite::Error::Io(e)) if e.kind() == std::io::ErrorKind::WouldBlock => {}
            Ok(_) => {}
            Err(_) => return,
        }
    }
}
