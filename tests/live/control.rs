//! `asperity run --control`: other programs change a run by WebSocket and by OSC, and its report says so.

use std::net::{TcpStream, UdpSocket};
use std::process::Command;
use std::time::{Duration, Instant};

use harness::alone::beside_others;
use harness::live::{CARD, Live, PATIENCE, graph, until};
use harness::{Room, root};
use rosc::{OscMessage, OscPacket, OscType, decoder, encoder};
use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

use crate::socket::{connect, get};

/// A tone whose strength is a live parameter, and a stylus that strokes.
const TONE: &str = r#"Graph(version: 1, nodes: {
    "s": (kind: "stroke", params: (extent_mm: 40.0, speed_mm_s: 80.0, duration_s: 600.0)),
    "v": (kind: "velocity"), "p": (kind: "probe"),
    "tone": (kind: "sine", params: (frequency_hz: 100, amplitude: 0.05)),
    "strength": (kind: "gain"),
    "limiter": (kind: "limiter", params: (profile: "hapcoil_one", handle_mass_g: 100)),
    "out": (kind: "audio_out")},
    wires: [("s", "v"), ("v.speed", "p"), ("tone", "strength"), ("strength", "limiter"),
        ("limiter", "out")])"#;

/// A run that is controlled.
struct Stage {
    live: Live,
    /// Address of the WebSocket, and port and token of OSC.
    url: String,
    port: u16,
    token: String,
}

impl Stage {
    fn start(room: &Room, text: &str, more: &[&str]) -> Self {
        room.write("g.ron", text);
        let args = ["g.ron", "--control", "--device", CARD, "--report", "r.json"];
        let mut live = Live::start(room, &[&args, more].concat());
        let url = live.says("control by WebSocket: ").replace("ws:", "http:");
        let osc = live.says("control by OSC: UDP port ");
        let (port, token) = osc.split_once(", /asperity/hello ").expect("port and token");
        let (port, token) = (port.parse().expect("a port"), token.to_owned());
        live.says("plays on");
        Self { live, url, port, token }
    }

    fn socket(&self) -> Talk {
        Talk(connect(&self.url, None).expect("it is let in"))
    }

    fn osc(&self) -> Osc {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
        socket.connect(("127.0.0.1", self.port)).expect("an address");
        socket.set_read_timeout(Some(PATIENCE)).expect("a socket");
        Osc(socket)
    }

    /// Stops it. Changes of the report, each as `what` and `by`, in the order of their ticks.
    fn changes(self, room: &Room) -> Vec<(String, String)> {
        self.live.stop().ok();
        let report = room.json("r.json");
        let changes = report["changes"].as_array().expect("a list").clone();
        let tick_hz = report["tick_hz"].as_f64().expect("a rate");
        let tick = |change: &Value| change["tick"].as_u64().expect("a tick");
        assert!(changes.is_sorted_by_key(tick), "{changes:?}");
        for change in &changes {
            assert_eq!(change["at_s"].as_f64(), Some(tick(change) as f64 / tick_hz));
            assert!(tick(change) <= report["ticks"].as_u64().expect("ticks"));
        }
        let text = |value: &Value| value.as_str().expect("a text").to_owned();
        changes.iter().map(|change| (text(&change["what"]), text(&change["by"]))).collect()
    }
}

/// A program with a WebSocket.
struct Talk(WebSocket<TcpStream>);

impl Talk {
    fn say(&mut self, what: &Value) {
        self.0.send(Message::text(what.to_string())).expect("it hears");
    }

    fn next(&mut self) -> Value {
        loop {
            if let Message::Text(text) = self.0.read().expect("it answers") {
                return serde_json::from_str(&text).expect("JSON");
            }
        }
    }

    /// The answer to a command.
    fn ask(&mut self, what: &Value) -> Value {
        self.say(what);
        self.next()
    }
}

/// A program that sends OSC.
struct Osc(UdpSocket);

impl Osc {
    fn say(&self, name: &str, args: Vec<OscType>) {
        let packet = OscPacket::Message(OscMessage { addr: format!("/asperity/{name}"), args });
        self.0.send(&encoder::encode(&packet).expect("OSC")).expect("it is sent");
    }

    fn hear(&self) -> (String, Vec<OscType>) {
        let mut packet = [0; 65_536];
        let length = self.0.recv(&mut packet).expect("it answers");
        let (_, OscPacket::Message(message)) = decoder::decode_udp(&packet[..length]).expect("OSC") else {
            panic!("a bundle came")
        };
        (message.addr, message.args)
    }

    fn ask(&self, name: &str, args: Vec<OscType>) -> (String, Vec<OscType>) {
        self.say(name, args);
        self.hear()
    }

    /// Whether nothing comes.
    fn is_silent(&self) -> bool {
        self.0.set_read_timeout(Some(Duration::from_millis(300))).expect("a socket");
        let silent = self.0.recv(&mut [0; 64]).is_err();
        self.0.set_read_timeout(Some(PATIENCE)).expect("a socket");
        silent
    }
}

fn text(text: &str) -> OscType {
    OscType::String(text.into())
}

#[test]
fn commands_by_websocket_and_osc_do_the_same() {
    let _alone = beside_others();
    let room = Room::new();
    let stage = Stage::start(&room, TONE, &["--page"]);
    let mut talk = stage.socket();
    let value = |gain: f64| json!({ "value": ["strength.gain", gain] });
    assert_eq!(talk.ask(&json!({ "get": "strength.gain" })), value(1.0));
    assert_eq!(talk.ask(&json!({ "set": ["strength.gain", 0.25] }))["done"][0], "set strength.gain 0.25");
    assert_eq!(talk.ask(&json!({ "get": ["strength.gain"] })), value(0.25));
    assert_eq!(talk.ask(&json!({ "mute": true }))["done"][0], "mute true");
    assert_eq!(talk.ask(&json!({ "get": "mute" })), json!({ "value": ["mute", true] }));
    assert_eq!(talk.ask(&json!({ "gain": 0.5 }))["done"][0], "gain 0.5");
    assert_eq!(talk.ask(&json!({ "marker": "trial 1, left" }))["done"][0], "marker trial 1, left");
    assert_eq!(talk.ask(&json!({ "echo": 7.5 })), json!({ "echo": [7.5] }));

    let osc = stage.osc();
    let done = |what: &str, (name, args): (String, Vec<OscType>)| {
        assert_eq!((&*name, &args[0]), ("/asperity/done", &text(what)), "{args:?}");
    };
    done("hello", osc.ask("hello", vec![text(&stage.token)]));
    done("set strength.gain 0.1", osc.ask("set", vec![text("strength.gain"), OscType::Float(0.1)]));
    let told = ("/asperity/value".into(), vec![text("strength.gain"), OscType::Float(0.1)]);
    assert_eq!(osc.ask("get", vec![text("strength.gain")]), told);
    done("mute false", osc.ask("mute", vec![OscType::Bool(false)]));
    done("gain 0.75", osc.ask("gain", vec![OscType::Float(0.75)]));
    done("marker trial 2", osc.ask("marker", vec![text("trial 2")]));
    assert_eq!(osc.ask("echo", vec![OscType::Int(7)]).1, [OscType::Float(7.0)]);
    let local = osc.0.local_addr().expect("an address");

    // The page is at the same port, with the same token.
    let page = stage.url.replace("/control?", "/?");
    let (host, query) = page["http://".len()..].split_once('/').expect("an address");
    assert!(get(&page, &format!("/{query} HTTP/1.1"), &format!("Host: {host}\r\n")).contains("200 OK"));
    let by_osc = format!("OSC {local}");
    let of = |what: &str, by: &str| (what.to_owned(), by.to_owned());
    assert_eq!(
        stage.changes(&room),
        [
            of("set strength.gain 0.25", "program 1"),
            of("mute true", "program 1"),
            of("gain 0.5", "program 1"),
            of("marker trial 1, left", "program 1"),
            of("set strength.gain 0.1", &by_osc),
            of("mute false", &by_osc),
            of("gain 0.75", &by_osc),
            of("marker trial 2", &by_osc),
        ]
    );
}

#[test]
fn wrong_commands_are_answered_with_help() {
    let _alone = beside_others();
    let room = Room::new();
    let stage = Stage::start(&room, TONE, &[]);
    let (mut talk, osc) = (stage.socket(), stage.osc());
    osc.ask("hello", vec![text(&stage.token)]);
    for (what, command, why, help) in [
        (json!({ "mut": true }), "mut", "no command `mut`", "did you mean `mute`?"),
        (json!({ "set": ["strength.gian", 1] }), "set", "no parameter gian", "`strength.gain`"),
        (json!({ "set": ["strength.gain", "loud"] }), "set", "cannot be loud", "it takes"),
        (json!({ "material": "oak" }), "material", "no materials", ""),
        (json!({ "subscribe": "sped" }), "subscribe", "no topic `sped`", "did you mean `speed`?"),
        (json!({ "marker": "x".repeat(300) }), "marker", "too long", "256"),
    ] {
        let answer = talk.ask(&what);
        let said = |at: usize| answer["error"][at].as_str().expect("a text");
        assert!(said(0) == command && said(1).contains(why) && said(2).contains(help), "{answer}");
        let (name, values) = what.as_object().expect("an object").iter().next().expect("one");
        let values = if values.is_array() { values.clone() } else { json!([values]) };
        let args = values.as_array().expect("a list").iter().map(|value| match value {
            Value::Bool(on) => OscType::Bool(*on),
            Value::String(word) => text(word),
            number => OscType::Float(number.as_f64().expect("a number") as f32),
        });
        let (address, by_osc) = osc.ask(name, args.collect());
        assert_eq!(address, "/asperity/error");
        assert_eq!(by_osc, [0, 1, 2].map(|at| text(said(at))), "the same by OSC");
    }
    assert_eq!(stage.changes(&room), []);
}

#[test]
fn osc_address_without_the_token_is_ignored() {
    let _alone = beside_others();
    let room = Room::new();
    let stage = Stage::start(&room, TONE, &[]);
    let stranger = stage.osc();
    stranger.say("mute", vec![OscType::Bool(true)]);
    stranger.say("hello", vec![text(&stage.token[1..])]);
    stranger.say("marker", vec![text("stranger")]);
    stranger.0.send(b"garbage").expect("it is sent");
    assert!(stranger.is_silent());
    // A friend at another port of the same machine lets nobody else in.
    let friend = stage.osc();
    friend.ask("hello", vec![text(&stage.token)]);
    stranger.say("stop", vec![]);
    assert!(stranger.is_silent());
    assert_eq!(friend.ask("get", vec![text("mute")]).1[1], OscType::Bool(false));
    friend.0.send(b"garbage").expect("it is sent");
    assert_eq!(friend.hear().0, "/asperity/error");
    // Too much is left out, and said once; the system may leave out more.
    (0..1000).for_each(|_| friend.say("echo", vec![OscType::Int(1)]));
    let (mut echoes, mut errors) = (0, 0);
    while !friend.is_silent_after(&mut echoes, &mut errors) {}
    assert!((50..1000).contains(&echoes) && errors < 5, "{echoes} echoes, {errors} errors");
    assert_eq!(stage.changes(&room), []);
}

impl Osc {
    /// Counts the next message; true where none comes.
    fn is_silent_after(&self, echoes: &mut usize, errors: &mut usize) -> bool {
        self.0.set_read_timeout(Some(Duration::from_millis(500))).expect("a socket");
        let mut packet = [0; 1024];
        let Ok(length) = self.0.recv(&mut packet) else { return true };
        let counter = if packet[..length].starts_with(b"/asperity/echo") { echoes } else { errors };
        *counter += 1;
        false
    }
}

#[test]
fn topics_come_at_the_rate_that_was_asked_for() {
    let _alone = beside_others();
    let room = Room::new();
    let stage = Stage::start(&room, TONE, &[]);
    let (mut talk, osc) = (stage.socket(), stage.osc());
    osc.ask("hello", vec![text(&stage.token)]);
    until("the first figures", || talk.ask(&json!({ "subscribe": ["speed", 20] })).get("done").is_some());
    let (mut times, mut speeds) = (Vec::new(), Vec::new());
    while times.len() < 40 {
        let message = talk.next();
        let (at, speed) = (message["speed"][0].as_f64(), message["speed"][1].as_f64());
        times.push(at.expect("a time"));
        speeds.push(speed.expect("a speed"));
    }
    let (first, last) = (times[0], times[39]);
    // A busy machine leaves some out, and sends none too many.
    assert!(times.is_sorted() && last - first > 39.0 / 20.0 * 0.9, "{first} to {last} s");
    // A stroke of least jerk is 15/8 times as fast in its middle as on average.
    let fastest = speeds.iter().copied().fold(0.0, f64::max);
    assert!((120.0..151.0).contains(&fastest), "{fastest} mm/s");

    let position = osc.ask("subscribe", vec![text("position"), OscType::Int(60)]);
    assert_eq!(position.0, "/asperity/done");
    let (name, args) = osc.hear();
    assert_eq!((&*name, args.len()), ("/asperity/position", 4));
    osc.say("subscribe", vec![text("position"), OscType::Int(0)]);
    while osc.hear().0 != "/asperity/done" {}
    assert!(osc.is_silent());
    // What others change comes as a topic.
    assert_eq!(osc.ask("subscribe", vec![text("changes")]).0, "/asperity/done");
    talk.say(&json!({ "marker": "here" }));
    let (name, args) = osc.hear();
    assert_eq!((&*name, &args[1..]), ("/asperity/changes", &[text("marker here"), text("program 1")][..]));
    osc.say("subscribe", vec![text("meters"), OscType::Float(5.0)]);
    while osc.hear().0 != "/asperity/meters" {}
    stage.live.stop().ok();
    // It says that it has ended.
    let begun = Instant::now();
    while osc.hear().0 != "/asperity/ended" {
        assert!(begun.elapsed() < PATIENCE);
    }
}

#[test]
fn chosen_material_plays_and_is_listed() {
    let _alone = beside_others();
    let room = Room::new();
    let stage = Stage::start(&room, &graph("live.ron", "", ""), &[]);
    let mut talk = stage.socket();
    let done = talk.ask(&json!({ "set": ["texture.material", "oak"] }));
    assert_eq!(done["done"][0], "set texture.material oak", "{done}");
    assert_eq!(
        talk.ask(&json!({ "get": "texture.material" })),
        json!({ "value": ["texture.material", "oak"] })
    );
    assert_eq!(talk.ask(&json!({ "material": "velour" }))["done"][0], "set texture.material velour");
    let listed: Vec<String> = stage.changes(&room).into_iter().map(|(what, _)| what).collect();
    assert_eq!(listed, ["set texture.material oak", "set texture.material velour"]);
}

/// The client of docs/control.md, as it stands there.
#[test]
fn python_client_of_the_docs_controls_a_run() {
    let _alone = beside_others();
    let docs = std::fs::read_to_string(root().join("docs/control.md")).expect("the page");
    let client =
        docs.split("```python\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a client");
    let room = Room::new();
    room.write("client.py", client);
    let stage = Stage::start(&room, TONE, &[]);
    let mut talk = stage.socket();
    until("the first figures", || talk.ask(&json!({ "subscribe": "speed" })).get("done").is_some());
    let port = stage.port.to_string();
    let ran = Command::new("python3").args(["client.py", &port, &stage.token]).current_dir(&*room).output();
    let ran = match ran {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return println!("SKIPPED: no python3"),
        ran => ran.expect("it runs"),
    };
    let (out, err) = (String::from_utf8_lossy(&ran.stdout), String::from_utf8_lossy(&ran.stderr));
    assert!(ran.status.success(), "{err}");
    for line in ["done ['hello', ", "done ['set strength.gain 0.5', ", "done ['marker trial 1', ", "speed ["]
    {
        assert!(out.lines().any(|said| said.starts_with(line)), "no {line} in\n{out}");
    }
    assert_eq!(out.lines().count(), 25);
    let listed: Vec<String> = stage.changes(&room).into_iter().map(|(what, _)| what).collect();
    assert!(["set strength.gain 0.5", "marker trial 1"].iter().all(|what| listed.iter().any(|l| l == what)));
}

#[test]
fn two_ports_for_one_server_are_refused() {
    let room = Room::new();
    room.write("g.ron", TONE);
    room.run("run g.ron --page 8081 --control 8082").ends(2, &["--control", "one server is for both"]);
    room.run("run g.ron --control 70000").ends(2, &["--control"]);
}
