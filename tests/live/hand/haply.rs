//! An Inverse3, played by a stand-in of the service.

use std::io::Write;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use asperity_hand::haply::{HaplyOptions, start};
use asperity_hand::{Frame, HandError, Next};
use asperity_live::{force_model, samples};
use harness::alone::real_time;
use harness::live::until;
use tungstenite::{Message, WebSocket};

use super::held::{Floor, newest, problem};

/// Behaviour of the stand-in, and the forces it received.
#[derive(Default)]
struct Service {
    stop: AtomicBool,
    /// Devices by id.
    devices: Mutex<Vec<&'static str>>,
    /// Where each is, in m.
    at: Mutex<[f64; 3]>,
    /// Answer instead of a report.
    instead: Mutex<Option<String>>,
    /// Whether it answers at all.
    mute: AtomicBool,
    /// Whether it sends reports that nobody asked for.
    chatty: AtomicBool,
    /// Whether it sends as fast as it can, and hears nothing.
    flood: AtomicBool,
    forces: Mutex<Vec<[f64; 3]>>,
    asked: AtomicU64,
    closed: AtomicBool,
}

impl Service {
    fn report(&self) -> String {
        let [x, y, z] = *self.at.lock().unwrap();
        let state = format!(r#"{{"cursor_position":{{"x":{x},"y":{y},"z":{z}}},"control_mode":"force"}}"#);
        let devices = self.devices.lock().unwrap();
        let list: Vec<_> = devices
            .iter()
            .map(|id| format!(r#"{{"device_id":"{id}","state":{state},"status":{{}}}}"#))
            .collect();
        format!(r#"{{"session_id":7,"inverse3":[{}]}}"#, list.join(","))
    }

    fn last(&self) -> [f64; 3] {
        self.forces.lock().unwrap().last().copied().unwrap_or_default()
    }

    fn pour(&self, socket: &mut WebSocket<TcpStream>) {
        let many = [0x81, 2, b'{', b'}'].repeat(16_384);
        let mut goes = true;
        while goes && !self.stop.load(Relaxed) {
            goes = socket.get_mut().write_all(&many).is_ok();
        }
    }

    fn talk(&self, mut socket: WebSocket<TcpStream>) {
        let report = self.report();
        if socket.send(Message::text(report)).is_err() {
            return;
        }
        while !self.stop.load(Relaxed) {
            if self.flood.load(Relaxed) {
                return self.pour(&mut socket);
            }
            let text = match socket.read() {
                Ok(Message::Text(text)) => text,
                Ok(Message::Close(_)) => return self.closed.store(true, Relaxed),
                Ok(_) => continue,
                Err(tungstenite::Error::Io(e)) if e.kind() == std::io::ErrorKind::WouldBlock => continue,
                Err(_) => return,
            };
            let told: serde_json::Value = serde_json::from_str(&text).unwrap();
            let device = &told["inverse3"][0];
            assert!(device["device_id"].is_string());
            let values = &device["commands"]["set_cursor_force"]["values"];
            self.forces.lock().unwrap().push(["x", "y", "z"].map(|k| values[k].as_f64().unwrap()));
            self.asked.fetch_add(1, Relaxed);
            if self.mute.load(Relaxed) {
                continue;
            }
            let answer = self.instead.lock().unwrap().clone().unwrap_or_else(|| self.report());
            if self.chatty.load(Relaxed) {
                let old = answer.replace(r#""z":"#, r#""z":1000"#);
                let _ = socket.send(Message::text(answer));
                let _ = socket.send(Message::text(old));
            } else if socket.send(Message::text(answer)).is_err() {
                return;
            }
        }
    }
}

/// A running stand-in; dropping it kills it, connections and all.
struct Running {
    service: Arc<Service>,
    address: SocketAddr,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    fn new(devices: &[&'static str]) -> Self {
        Self::at("127.0.0.1:0".parse().unwrap(), devices)
    }

    fn at(address: SocketAddr, devices: &[&'static str]) -> Self {
        let service = Arc::new(Service { devices: Mutex::new(devices.to_vec()), ..Service::default() });
        let listener = TcpListener::bind(address).unwrap();
        let address = listener.local_addr().unwrap();
        listener.set_nonblocking(true).unwrap();
        let own = service.clone();
        let thread = std::thread::spawn(move || {
            while !own.stop.load(Relaxed) {
                let Ok((stream, _)) = listener.accept() else {
                    std::thread::sleep(Duration::from_millis(2));
                    continue;
                };
                stream.set_nonblocking(false).unwrap();
                stream.set_nodelay(true).unwrap();
                stream.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
                if let Ok(socket) = tungstenite::accept(stream) {
                    own.talk(socket);
                }
            }
        });
        Self { service, address, thread: Some(thread) }
    }

    fn options(&self) -> HaplyOptions {
        HaplyOptions { service: self.address.to_string(), ..HaplyOptions::new() }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.service.stop.store(true, Relaxed);
        self.thread.take().unwrap().join().unwrap();
    }
}

fn refused(options: HaplyOptions) -> HandError {
    start(options, samples().0, None).unwrap_err()
}

#[test]
fn haply_hand_is_in_mm_and_floor_pushes_along_its_axis() {
    let _alone = real_time();
    let running = Running::new(&["049D"]);
    *running.service.at.lock().unwrap() = [0.01, 0.02, 0.116];
    let (to, mut from) = samples();
    let (models, reader) = force_model();
    let _floor = Floor::tell(models, 0.5);
    let frame = Frame::new("y,-x,z", [0.0, 0.0, 120.0]).unwrap();
    let handle = start(HaplyOptions { frame, ..running.options() }, to, Some(reader)).unwrap();
    assert_eq!((handle.device().name.as_str(), handle.device().max_force_n), ("049D", 3.0));
    let near = |f: f64, g: f64| (f - g).abs() < 1e-5;
    until("the force", || near(running.service.last()[2], 2.0));
    assert_eq!(running.service.last()[..2], [0.0, 0.0]);
    until("a sample", || {
        newest(&mut from).is_some_and(|s| {
            let off =
                s.position.iter().zip([20.0, -10.0, -4.0]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-9 && s.stroke == 0, "{s:?}");
            near(s.force, 2.0)
        })
    });
    *running.service.at.lock().unwrap() = [0.01, 0.02, 0.0];
    until("the greatest force", || near(running.service.last()[2], 3.0));
    *running.service.at.lock().unwrap() = [0.01, 0.02, 0.13];
    until("no force", || running.service.last() == [0.0; 3]);
    // In contact a dropped source lets go first, and says goodbye.
    *running.service.at.lock().unwrap() = [0.01, 0.02, 0.116];
    until("the force", || near(running.service.last()[2], 2.0));
    drop(handle);
    until("goodbye", || running.service.closed.load(Relaxed));
    let forces = running.service.forces.lock().unwrap();
    let last: Vec<_> = forces.iter().rev().take(12).map(|f| f[2]).collect();
    assert!(last[0] == 0.0 && last.windows(2).all(|w| w[1] >= w[0]), "{last:?}");
    assert!(last.iter().any(|f| *f > 0.05 && *f < 1.95), "it stepped: {last:?}");
}

#[test]
fn the_service_may_be_named_as_a_websocket_is() {
    let _alone = real_time();
    let running = Running::new(&["049D"]);
    for service in [format!("ws://{}", running.address), format!(" ws://{}/", running.address)] {
        let handle = start(HaplyOptions { service, ..running.options() }, samples().0, None).unwrap();
        until("samples", || handle.samples() > 0);
        drop(handle);
    }
}

#[test]
fn killed_service_is_told_once_and_resumed_in_a_new_stroke() {
    let _alone = real_time();
    let running = Running::new(&["049D"]);
    let address = running.address;
    let (to, mut from) = samples();
    let handle = start(running.options(), to, None).unwrap();
    until("samples", || newest(&mut from).is_some_and(|s| s.stroke == 0));
    drop(running);
    assert!(problem(&handle).contains("is lost"));
    assert!(!handle.connected() && handle.losses() == 1);
    std::thread::sleep(Duration::from_millis(600));
    assert_eq!(handle.problem(), None);
    newest(&mut from);
    let running = Running::at(address, &["049D", "AAAA"]);
    until("samples of a new stroke", || newest(&mut from).is_some_and(|s| s.stroke == 1));
    assert!(problem(&handle).contains("works again") && handle.connected());
    assert!(running.service.asked.load(Relaxed) > 0);
}

#[test]
fn unplugged_device_lets_go_and_goes_on_when_back() {
    let _alone = real_time();
    let running = Running::new(&["049D"]);
    *running.service.at.lock().unwrap() = [0.0, 0.0, -0.004];
    let (to, mut from) = samples();
    let (models, reader) = force_model();
    let _floor = Floor::tell(models, 0.5);
    let handle = start(running.options(), to, Some(reader)).unwrap();
    until("the force", || running.service.last()[2] > 1.9);
    running.service.devices.lock().unwrap().clear();
    assert!(problem(&handle).contains("`049D` is no longer there"));
    until("no force", || running.service.last() == [0.0; 3]);
    assert!(!handle.connected());
    newest(&mut from);
    running.service.devices.lock().unwrap().push("049D");
    until("samples of a new stroke", || newest(&mut from).is_some_and(|s| s.stroke == 1));
    assert!(handle.connected() && problem(&handle).contains("works again"));
}

#[test]
fn garbage_is_counted_and_lets_go() {
    let _alone = real_time();
    let running = Running::new(&["049D"]);
    *running.service.at.lock().unwrap() = [0.0, 0.0, -0.004];
    let (to, mut from) = samples();
    let (models, reader) = force_model();
    let _floor = Floor::tell(models, 0.5);
    let handle = start(running.options(), to, Some(reader)).unwrap();
    until("the force", || running.service.last()[2] > 1.9);
    *running.service.instead.lock().unwrap() = Some(r#"{"inverse3":"#.to_owned());
    until("bad messages", || handle.bad() > 10);
    assert!(handle.last_bad().unwrap().contains("is no report"));
    until("no force", || running.service.last() == [0.0; 3]);
    newest(&mut from);
    *running.service.instead.lock().unwrap() = None;
    until("the force again", || running.service.last()[2] > 1.9);
    assert!(newest(&mut from).is_some() && handle.connected() && handle.losses() == 0);
}

#[test]
fn a_service_that_falls_silent_is_told_and_connected_to_anew() {
    let _alone = real_time();
    let running = Running::new(&["049D"]);
    let (to, mut from) = samples();
    let handle = start(running.options(), to, None).unwrap();
    until("samples", || newest(&mut from).is_some());
    running.service.mute.store(true, Relaxed);
    assert!(problem(&handle).contains("does not answer"));
    assert!(problem(&handle).contains("no answer for 1 s"));
    running.service.mute.store(false, Relaxed);
    until("samples of a new stroke", || newest(&mut from).is_some_and(|s| s.stroke >= 1));
}

#[test]
fn reports_that_nobody_asked_for_do_not_make_the_hand_lag() {
    let _alone = real_time();
    let running = Running::new(&["049D"]);
    let (to, mut from) = samples();
    running.service.chatty.store(true, Relaxed);
    let handle = start(running.options(), to, None).unwrap();
    until("some", || handle.samples() > 300);
    // Each time it would lag; a machine that stalls lags now and then.
    let least = (1..=5).map(|n| {
        let place = 0.1 * f64::from(n);
        *running.service.at.lock().unwrap() = [place, 0.0, 0.0];
        let asked = running.service.asked.load(Relaxed);
        until("the new place", || {
            newest(&mut from).is_some_and(|s| (s.position[0] - 1000.0 * place).abs() < 1e-6)
        });
        running.service.asked.load(Relaxed) - asked
    });
    let least = least.min().unwrap();
    assert!(least < 100, "it took {least} questions");
}

#[test]
fn a_service_that_floods_does_not_hold_the_servo() {
    let _alone = real_time();
    let running = Running::new(&["049D"]);
    let handle = start(running.options(), samples().0, None).unwrap();
    until("samples", || handle.samples() > 0);
    running.service.flood.store(true, Relaxed);
    until("it is told", || handle.problem().is_some_and(|p| p.contains("sends more than can be read")));
    drop(handle);
}

#[test]
fn what_is_missing_or_ambiguous_is_told_with_what_to_do() {
    let _alone = real_time();
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let e = refused(HaplyOptions { service: free.to_string(), ..HaplyOptions::new() });
    assert!(e.next == Next::Provide && e.message.contains("no Haply Inverse Service answers at"), "{e}");
    assert!(e.help.contains("Haply Hub"));
    let e = refused(HaplyOptions { service: "nowhere".into(), ..HaplyOptions::new() });
    assert!(e.message.contains("answers at nowhere"), "{e}");

    // Something else listens there.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let other = listener.local_addr().unwrap();
    let web = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        stream.write_all(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nhi").unwrap();
        std::thread::sleep(Duration::from_millis(50));
    });
    let e = refused(HaplyOptions { service: other.to_string(), ..HaplyOptions::new() });
    assert!(e.message.contains("does not speak WebSocket"), "{e}");
    web.join().unwrap();

    let none = Running::new(&[]);
    assert!(refused(none.options()).message.contains("knows no Inverse3"));
    let two = Running::new(&["049D", "12AB"]);
    let e = refused(two.options());
    assert!(e.next == Next::Option && e.message.contains("`049D`, `12AB`"), "{e}");
    let e = refused(HaplyOptions { device: Some("FFFF".into()), ..two.options() });
    assert!(e.message.contains("`FFFF`") && e.help.contains("`049D`, `12AB`"), "{e}");
    let chosen = HaplyOptions { device: Some("12AB".into()), ..two.options() };
    assert_eq!(start(chosen, samples().0, None).unwrap().device().name, "12AB");
    assert_eq!(refused(HaplyOptions { rate_hz: 0, ..two.options() }).next, Next::Option);
    assert_eq!(refused(HaplyOptions { max_force_n: -1.0, ..two.options() }).next, Next::Option);
}
