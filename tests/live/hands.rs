//! `asperity run` with hands that are no page: over the network, on arms that push back, without sound.

use std::cell::Cell;
use std::net::{SocketAddr, UdpSocket};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use harness::alone::{beside_others, shared_stage};
use harness::json;
use harness::live::{CARD, EARS, Live, graph, npy, rms, rows, told};
use rosc::{OscMessage, OscPacket, OscType};

use crate::edits::edit;
use crate::hand::library;
use crate::haply::Service;

/// Samples of a tick at 48 kHz.
const TICK: usize = 96;

/// A port that nobody has.
pub(crate) fn free_port() -> u16 {
    UdpSocket::bind("127.0.0.1:0").and_then(|s| s.local_addr()).expect("a port").port()
}

/// Something that tracks a stylus: 3 mm deep, 16 mm around a place on the x axis, at 100 mm/s.
struct Tracker {
    socket: UdpSocket,
    to: SocketAddr,
    around_mm: f64,
    /// The longest that this machine kept it from sending, in seconds.
    held_s: Cell<f64>,
}

impl Tracker {
    fn to(port: u16) -> Self {
        Self::around(0.0, port)
    }

    fn around(around_mm: f64, port: u16) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
        Self { socket, to: SocketAddr::from(([127, 0, 0, 1], port)), around_mm, held_s: Cell::default() }
    }

    fn packet(&self, bytes: &[u8]) {
        // A closed port may answer, which the next send reports.
        let _ = self.socket.send_to(bytes, self.to);
    }

    fn message(&self, addr: &str, args: Vec<OscType>) {
        let packet = OscPacket::Message(OscMessage { addr: addr.into(), args });
        self.packet(&rosc::encoder::encode(&packet).expect("a packet"));
    }

    /// Goes round for so long, 500 packets a second.
    fn strokes(&self, seconds: f64) {
        let began = Instant::now();
        self.strokes_while(|| began.elapsed().as_secs_f64() <= seconds);
    }

    /// Goes round while it is told to.
    fn strokes_while(&self, on: impl Fn() -> bool) {
        let (began, mut before) = (Instant::now(), 0.0);
        while on() {
            std::thread::sleep(Duration::from_millis(2));
            let now = began.elapsed().as_secs_f64();
            self.held_s.set(self.held_s.get().max(now - before));
            before = now;
            let turn = 100.0 / 16.0 * now;
            let place = [self.around_mm + 16.0 * turn.cos(), 16.0 * turn.sin(), -3.0];
            self.message("/stylus", place.map(|x| OscType::Float(x as f32)).to_vec());
        }
    }

    /// Sends what is no place of a stylus.
    fn rubbish(&self) {
        self.packet(b"");
        self.packet(b"/stylus");
        self.packet(&[0xff; 1000]);
        self.message("/stylus", [f32::NAN, 0.0, 0.0].map(OscType::Float).to_vec());
        self.message("/stylus", vec![OscType::String("far".into())]);
        self.message("/other", vec![OscType::Float(1.0)]);
    }
}

/// The live graph with a stylus that listens at a port, and places and recordings in files.
fn osc_graph(port: u16) -> String {
    let nodes = r#""place": (kind: "probe", params: (file: "place.csv")),
       "sent": (kind: "file_out", params: (file: "sent.npy")),"#;
    let text = graph("live.ron", nodes, r#"("stylus.position", "place"), ("limiter", "sent"),"#);
    let stylus = r#"(kind: "pointer_input", params: (depth_mm: 6.6))"#;
    assert!(text.contains(stylus));
    // On a busy machine a sender may be held back for longer than a source may be silent.
    text.replace(
        stylus,
        &format!(r#"(kind: "osc_input", params: (listen: "127.0.0.1:{port}", timeout_ms: 400))"#),
    )
}

#[test]
fn osc_stylus_is_heard_beside_garbage_and_after_an_edit() {
    let _alone = beside_others();
    told(a_stylus_goes_on_while_its_graph_changes);
}

fn a_stylus_goes_on_while_its_graph_changes() -> Result<(), String> {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    let (old, new) = (free_port(), free_port());
    edit(dir, osc_graph(old));
    let mut live = Live::start(dir, &["g.ron", "--watch", "--device", CARD, "--report", "r.json"]);
    live.says("plays on");

    // The port is taken now: another run says so, and plays nothing.
    let elsewhere = tempfile::tempdir().expect("a folder");
    edit(elsewhere.path(), osc_graph(old));
    let other = harness::run(elsewhere.path(), &["run", "g.ron", "--device", CARD, "--seconds", "1"]);
    assert_eq!(other.code, 2, "{}", other.err);
    assert!(other.err.contains(&format!("127.0.0.1:{old}")) && other.err.contains("stylus"), "{}", other.err);

    let tracker = Tracker::to(old);
    // Gain and material change within one stroke, which goes on.
    let text = osc_graph(old).replace("(gain: 0.2)", "(gain: 0.15)").replace("canvas", "sandpaper P40");
    let going = Arc::new(AtomicBool::new(true));
    let on = going.clone();
    let sender = std::thread::spawn(move || {
        tracker.strokes(0.4);
        tracker.rubbish();
        tracker.strokes_while(|| on.load(Relaxed));
        tracker
    });
    std::thread::sleep(Duration::from_millis(800));
    edit(dir, &text);
    let said = live.says("changed:");
    assert!(said.contains("strength.gain") && said.contains("texture"), "{said}");
    std::thread::sleep(Duration::from_millis(500));
    going.store(false, Relaxed);
    let held_s = sender.join().expect("it sends").held_s.get();
    // Nobody sends any more; then it listens elsewhere.
    edit(dir, text.replace(&old.to_string(), &new.to_string()));
    let said = live.says("changed:");
    assert!(said.contains("stylus"), "{said}");
    Tracker::around(200.0, old).strokes(0.2);
    assert!(UdpSocket::bind(("127.0.0.1", old)).is_ok(), "the old port is still held");
    Tracker::around(100.0, new).strokes(0.8);
    live.stop().ok();

    let report = json(&dir.join("r.json"));
    println!("{}; the tracker was held for {held_s:.3} s at most", report["sources"]);
    // Of the graph that runs at the end: what came to the new port, and its end.
    assert!(report["sources"][0]["samples"].as_u64() > Some(20), "{}", report["sources"]);
    assert_eq!(report["faults"], 0);
    let (sent, places) = (npy(&dir.join("sent.npy")), rows(&dir.join("place.csv")));
    let near = |at: usize, x: f64| (places[at][0] - x).abs() < 20.0 && places[at][1] != 0.0;
    assert!((0..places.len()).all(|at| !near(at, 200.0)), "what came to the old port is still heard");
    // Stretches of 50 ms: whether the stylus goes on moving about a place, and how loud it is.
    const LONG: usize = 25;
    let moves = |i: usize, x: f64| {
        let all = i * LONG..(i + 1) * LONG;
        all.clone().all(|at| near(at, x))
            && all.skip(1).filter(|&at| places[at] != places[at - 1]).count() > 20
    };
    let level = |i: usize| rms(&sent[i * LONG * TICK..(i + 1) * LONG * TICK]);
    let count = places.len() / LONG;
    for x in [0.0, 100.0] {
        // It is heard 150 ms after it began to move: behind the network's history.
        let on: Vec<usize> = (3..count).filter(|&i| (i - 3..=i).all(|k| moves(k, x))).collect();
        let heard = on.iter().filter(|&&i| level(i) > 1e-3).count();
        println!("about x = {x} mm: heard in {heard} of {} stretches", on.len());
        if on.len() < 8 {
            return Err(format!("about x = {x} mm it hardly moved"));
        }
        assert!(
            heard + 2 >= on.len(),
            "there are holes: {:.4?}",
            on.iter().map(|&i| level(i)).collect::<Vec<_>>()
        );
    }
    // Neither rubbish nor the changes break the stroke.
    let first = (0..count).find(|&i| moves(i, 0.0)).expect("it moves");
    let last = (0..count).rfind(|&i| moves(i, 0.0)).expect("it moves");
    let still = (first..=last).map(|i| !moves(i, 0.0)).collect::<Vec<_>>();
    let longest = still.split(|still| !still).map(<[bool]>::len).max().unwrap_or(0);
    if longest >= 4 && held_s > 0.05 {
        return Err(format!("the tracker was held for {held_s:.3} s"));
    }
    assert!(longest < 4, "the stroke stops for {longest} stretches");
    Ok(())
}

#[test]
fn a_source_that_falls_silent_is_counted_and_no_longer_heard() {
    let _alone = beside_others();
    told(|| {
        let dir = tempfile::tempdir().expect("a folder");
        let dir = dir.path();
        let port = free_port();
        edit(dir, osc_graph(port).replace("timeout_ms: 400", "timeout_ms: 50"));
        let mut live = Live::start(dir, &["g.ron", "--device", CARD, "--report", "r.json"]);
        live.says("plays on");
        let tracker = Tracker::to(port);
        tracker.strokes(0.8);
        std::thread::sleep(Duration::from_millis(700));
        live.stop().ok();
        let report = json(&dir.join("r.json"));
        assert!(report["sources"][0]["stalls"].as_u64() > Some(0), "{report}");
        let (sent, places) = (npy(&dir.join("sent.npy")), rows(&dir.join("place.csv")));
        let last = (1..places.len()).rev().find(|&i| places[i] != places[i - 1]).expect("it moved");
        let before = rms(&sent[last.saturating_sub(100) * TICK..last * TICK]);
        let held_s = tracker.held_s.get();
        if before < 0.01 && held_s > 0.02 {
            return Err(format!("the tracker was held for {held_s:.3} s"));
        }
        assert!(before > 0.01, "the stroke is not heard");
        let after = sent.get((last + 35) * TICK..).unwrap_or(&[]);
        let peak = after.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
        println!("peak {peak:.7} from 70 ms after the last place on");
        if after.len() < 100 * TICK {
            return Err(format!("only {} samples are left after the stroke", after.len()));
        }
        assert!(peak < 1e-3, "it sounds on at {peak}");
        Ok(())
    });
}

#[test]
fn a_hand_takes_the_place_of_a_trajectory() {
    let dir = &*shared_stage();
    edit(dir, graph("texture.ron", "", ""));
    let port = free_port();
    let hand = format!("osc:listen=127.0.0.1:{port}");
    let args = ["g.ron", "--hand", &hand, "--device", CARD, "--report", "r.json"];
    let mut live = Live::start(dir, &args);
    live.says("plays on");
    Tracker::to(port).strokes(0.5);
    live.stop().ok();
    let report = json(&dir.join("r.json"));
    assert!(report["sources"][0]["samples"].as_u64() > Some(100), "{}", report["sources"]);

    let pointer =
        ["run", "g.ron", "--hand", "pointer", "--device", CARD, "--seconds", "0.5", "--report", "p.json"];
    harness::run(dir, &pointer).ok();
    let report = json(&dir.join("p.json"));
    assert_eq!(
        report["nodes"].as_array().map(|n| n.iter().any(|n| n["kind"] == "pointer_input")),
        Some(true)
    );
    let none = harness::run(dir, &["run", "g.ron", "--hand", "mouse", "--seconds", "1"]);
    assert!(none.code == 2 && none.err.contains("pointer"), "{}", none.err);
}

/// The forces that a probe saw.
fn forces(dir: &Path) -> Vec<f64> {
    rows(&dir.join("force.csv")).iter().map(|row| row[0]).collect()
}

#[test]
fn arm_pushes_back_and_too_stiff_a_wall_is_warned_of() {
    let dir = &*shared_stage();
    let nodes = format!(r#"{}"pushes": (kind: "probe", params: (file: "force.csv")),"#, EARS[0]);
    let wires = format!(r#"{}("stylus.force", "pushes"),"#, EARS[1]);
    edit(dir, graph("openhaptics.ron", &nodes, &wires));
    let library = format!("stylus.library={}", library(dir, "moving.c", "-DMOVES").display());
    let run = |more: &[&str]| harness::run(dir, &[&["run", "g.ron", "--device", CARD], more].concat());
    let ran = run(&["--set", &library, "--seconds", "2.6", "--report", "r.json"]).ok();
    assert!(!ran.err.contains("`wall`"), "{}", ran.err);
    let report = json(&dir.join("r.json"));
    println!("{}", report["sources"]);
    assert!(report["sources"][0]["samples"].as_u64() > Some(1000), "{}", report["sources"]);
    // 3 mm deep at 0.5 N/mm.
    let mut forces = forces(dir);
    forces.sort_by(f64::total_cmp);
    let median = forces[forces.len() / 2];
    assert!((median - 1.5).abs() < 0.05, "it pushes with {median} N");
    let heard = npy(&dir.join("heard.npy"));
    assert!(rms(&heard[heard.len() - 24_000..]) > 0.01, "the texture is not heard");

    let stiff = ["--set", &library, "--set", "floor.stiffness_n_per_mm=5", "--seconds", "0.3"];
    let ran = run(&stiff).ok();
    println!("{}", ran.err);
    let warned = ran.err.lines().find(|line| line.contains("`wall`")).expect("a warning");
    assert!(warned.contains("warning") && warned.contains("N/mm"), "{warned}");
    // What the warning names holds.
    let (_, advice) = warned.split_once("passive with --set ").unwrap_or_else(|| panic!("{warned}"));
    let advice = advice.split([';', ' ']).next().unwrap_or_default();
    let ran = run(&["--set", &library, "--set", advice, "--seconds", "0.3"]).ok();
    assert!(!ran.err.contains("`wall`"), "{advice}: {}", ran.err);
}

#[test]
fn a_graph_that_only_pushes_back_runs_by_the_timer() {
    let dir = &*shared_stage();
    let text = r#"Graph(version: 1, tick_hz: 1000, nodes: {
        "stylus": (kind: "openhaptics_input"),
        "floor": (kind: "virtual_floor", params: (stiffness_n_per_mm: 0.5)),
        "wall": (kind: "openhaptics_force"), "pushes": (kind: "probe", params: (file: "force.csv")),
    }, wires: [("stylus.position", "floor"), ("floor.plane", "wall.plane"), ("floor.normal", "wall.normal"),
        ("floor.stiffness", "wall.stiffness"), ("floor.damping", "wall.damping"),
        ("stylus.force", "pushes")])"#;
    edit(dir, text);
    let library = format!("stylus.library={}", library(dir, "moving.c", "-DMOVES").display());
    // A servo that was not called for 50 ms lets go, and takes hold again within half a second.
    told(|| {
        let args = ["run", "g.ron", "--set", &library, "--seconds", "1.5", "--report", "r.json"];
        let ran = harness::run(dir, &args).ok();
        assert!(ran.err.contains("without audio"), "{}", ran.err);
        let report = json(&dir.join("r.json"));
        assert_eq!((report["clock"].as_str(), report["device"].as_str()), (Some("timer"), Some("")));
        let forces = forces(dir);
        assert!(forces.iter().all(|force| *force < 1.55), "{forces:?}");
        match forces.iter().filter(|force| (*force - 1.5).abs() < 0.05).count() {
            401.. => Ok(()),
            pushed => Err(format!("it pushed in {pushed} ticks, with {:?} N at the end", forces.last())),
        }
    });
}

#[test]
fn inverse3_pushes_back_while_it_is_heard() {
    let dir = &*shared_stage();
    edit(dir, graph("haply.ron", EARS[0], EARS[1]));
    let service = Service::start();
    let stylus = format!("stylus.service=ws://{}", service.address);
    let args = ["run", "g.ron", "--seconds", "2.6", "--report", "r.json", "--device", CARD, "--set", &stylus];
    harness::run(dir, &args).ok();
    let pushed = service.pushed();
    assert!((pushed - 1.5).abs() < 0.05, "it pushed with {pushed} N");
    let report = json(&dir.join("r.json"));
    assert!(report["sources"][0]["samples"].as_u64() > Some(500), "{}", report["sources"]);
    let heard = npy(&dir.join("heard.npy"));
    assert!(rms(&heard[heard.len() - 24_000..]) > 0.01, "the texture is not heard");
}
