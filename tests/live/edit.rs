//! `asperity run` while its graph is edited: nobody waits for that, and what cannot be had changes nothing.

use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::path::Path;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use harness::alone::shared_stage;
use harness::json;
use harness::live::{CARD, Live, graph, npy, rows, until};
use serde_json::json;

use crate::edits::{edit, tone};
use crate::haply::Service;
use crate::socket::{Onlooker, Shown};

/// Samples of a tick at 48 kHz.
const TICK: usize = 96;
/// Samples in which the output must be silent: 20 ms.
const DOWN: usize = 960;
/// Samples of a crossfade.
const FADE: usize = 480;

/// A hand on an Inverse3 whose place is recorded.
fn arm(service: SocketAddr, more: &str) -> [String; 2] {
    [
        format!(
            r#""arm": (kind: "haply_input", params: (service: "ws://{service}", timeout_ms: 2000, {more})),
               "place": (kind: "probe", params: (file: "place.csv")),"#
        ),
        r#"("arm.position", "place"),"#.to_owned(),
    ]
}

/// A run that is watched, and its page.
fn watched(dir: &Path, more: &[&str]) -> (Live, Onlooker) {
    let mut live = Live::start(dir, &[&["g.ron", "--watch", "--page", "--device", CARD], more].concat());
    let onlooker = Onlooker::at(&live.says("the page: "));
    (live, onlooker)
}

/// A run that is watched and plays.
fn plays(dir: &Path, more: &[&str]) -> Live {
    let mut live = Live::start(dir, &[&["g.ron", "--watch", "--device", CARD], more].concat());
    live.says("plays on");
    live
}

/// A tone at full level whose graph was edited, so that a hand is being opened that never answers.
fn opening(dir: &Path) -> (Live, Onlooker, Service) {
    edit(dir, &tone("", ""));
    let (live, mut onlooker) = watched(dir, &["--report", "r.json"]);
    onlooker.until("full level", |s| s.view["seconds"].as_f64() > Some(2.6));
    assert!(onlooker.shown.view["peak"].as_f64() > Some(0.05), "{}", onlooker.shown.view);
    let mute = Service::mute();
    let [nodes, wires] = arm(mute.address, "");
    edit(dir, &tone(&nodes, &wires));
    onlooker.until("that it is being opened", |_| mute.unheard.load(Relaxed) > 0);
    (live, onlooker, mute)
}

/// Samples from the last at full level to silence, before a silence of a tenth of a second that begins
/// behind `from`.
fn fall(heard: &[f32], from: usize) -> usize {
    let zero = (from..heard.len() - 4_800)
        .find(|&i| heard[i - 1] != 0.0 && heard[i..i + 4_800].iter().all(|x| *x == 0.0))
        .expect("a silence");
    let peak = heard[from - 4_800..from].iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    // The tone is at its crest every 300 samples.
    let full = heard[..zero].iter().rposition(|x| x.abs() > 0.99 * peak).expect("a tone");
    zero - full
}

#[test]
fn a_mute_does_not_wait_for_a_graph_whose_hand_does_not_answer() {
    let dir = &*shared_stage();
    let (live, mut onlooker, mute) = opening(dir);
    let before = onlooker.shown.view["ticks"].as_u64().expect("ticks");
    onlooker.ask(&json!({ "mute": true }));
    onlooker.until("that it is muted", |s| s.view["condition"] == "muted" && s.view["muted"] == true);
    onlooker.until("that the card gets nothing", |s| s.view["peak"] == 0.0);
    assert_eq!(mute.given_up.load(Relaxed), 0, "it was muted only when the hand had been given up");
    // It goes on being looked at and recorded for as long as the hand is being opened.
    onlooker.until("that the hand is given up", |_| mute.given_up.load(Relaxed) > 0);
    until("the reason", || live.said().contains("cannot be taken over"));
    onlooker.looks_on(Duration::from_millis(200));
    live.stop().ok();

    let (sent, heard) = (npy(&dir.join("sent.npy")), npy(&dir.join("heard.npy")));
    let report = json(&dir.join("r.json"));
    assert_eq!(sent.len() as u64, report["ticks"].as_u64().expect("ticks") * TICK as u64, "{report}");
    let fall = fall(&heard, before as usize * TICK);
    println!("silent {fall} samples behind a crest");
    // A crest may be half a period old when the fall begins, and the ramp is above 0.99 for a while.
    assert!(fall < DOWN + 300, "it falls in {fall} samples");
}

/// A hand whose settings were edited, and more recorded of it, so that it was closed and is being opened
/// again, which never answers.
fn exchanging(dir: &Path) -> (Live, Onlooker, Service) {
    let service = Service::start();
    let [nodes, wires] = arm(service.address, "");
    edit(dir, &tone(&nodes, &wires));
    let (live, mut onlooker) = watched(dir, &["--report", "r.json"]);
    onlooker.until("the hand", |s| s.view["sources"][0]["samples"].as_u64() > Some(200));
    service.mute.store(true, Relaxed);
    let [nodes, wires] = arm(service.address, r#"device: "049D""#);
    let more = [r#""q": (kind: "probe", params: (file: "q.csv")),"#, r#"("arm.position", "q"),"#];
    edit(dir, &tone(&(nodes + more[0]), &(wires + more[1])));
    onlooker.until("that it is being opened", |_| service.unheard.load(Relaxed) > 0);
    (live, onlooker, service)
}

#[test]
fn sigterm_does_not_wait_for_a_hand_that_does_not_answer() {
    let dir = &*shared_stage();
    let (live, onlooker, mute) = opening(dir);
    let before = onlooker.shown.view["ticks"].as_u64().expect("ticks");
    assert_eq!(mute.given_up.load(Relaxed), 0);
    let ran = live.stop_by("TERM").ok();
    assert!(!ran.err.contains("cannot be taken over"), "it waited: {}", ran.err);
    let report = json(&dir.join("r.json"));
    assert!(report["ticks"].as_u64() >= Some(before), "{report}");
    // Nothing is left of the edit.
    assert_eq!(harness::files(dir), ["g.ron", "heard.npy", "r.json", "sent.npy"]);

    let dir = tempfile::tempdir().expect("a folder");
    let (live, _onlooker, service) = exchanging(dir.path());
    live.stop_by("TERM").ok();
    assert_eq!(harness::files(dir.path()), ["g.ron", "heard.npy", "place.csv", "r.json", "sent.npy"]);
    assert_eq!(service.unheard.load(Relaxed), 1, "it was opened as it was before, though nobody wants it");
}

/// The number by which the system knows the socket at a UDP port of this machine.
#[cfg(target_os = "linux")]
fn socket(port: u16) -> String {
    let all = std::fs::read_to_string("/proc/net/udp").expect("a list");
    let ours = |line: &&str| line.contains(&format!("0100007F:{port:04X} "));
    let line = all.lines().find(ours).unwrap_or_else(|| panic!("nobody listens at {port}: {all}"));
    line.split_whitespace().nth(9).expect("an inode").to_owned()
}

#[cfg(target_os = "linux")]
#[test]
fn osc_hand_is_let_go_only_for_settings_that_can_be() {
    let dir = &*shared_stage();
    let port = UdpSocket::bind("127.0.0.1:0").and_then(|s| s.local_addr()).expect("a port").port();
    let stylus = |address: &str, more: &str| {
        let node = format!(r#""stylus": (kind: "osc_input", params: (listen: "{address}:{port}"{more})),"#);
        let place = r#""place": (kind: "probe", params: (file: "place.csv")),"#;
        tone(&(node + place), r#"("stylus.position", "place"),"#)
    };
    let here = |more: &str| stylus("127.0.0.1", more);
    edit(dir, &here(""));
    let mut live = plays(dir, &[]);
    let before = socket(port);
    for (wrong, named) in [(r#", arguments: "foo""#, "foo"), (r#", address: "no slash""#, "no slash")] {
        edit(dir, &here(wrong));
        let said = live.says("cannot be taken over");
        assert!(live.said().contains(named), "{said}");
        assert_eq!(socket(port), before, "it was closed for {wrong}");
    }
    // It may start to listen on all addresses.
    for text in [stylus("0.0.0.0", ", anywhere: true"), here("")] {
        edit(dir, &text);
        let said = live.says("g.ron changed");
        assert!(said.contains("stylus"), "{said}: {}", live.said());
    }
    live.stop().ok();
}

#[test]
fn a_texture_is_chosen_also_where_a_hand_could_not_be_had_again() {
    let dir = &*shared_stage();
    let service = Service::start();
    let text = |timeout_ms: u32| {
        let params = format!(r#"(service: "ws://{}", timeout_ms: {timeout_ms})"#, service.address);
        let stylus = r#"(kind: "haply_input")"#;
        let text = graph("haply.ron", "", "");
        assert!(text.contains(stylus));
        text.replace(stylus, &format!(r#"(kind: "haply_input", params: {params})"#))
    };
    let (with, other) = (text(2000), text(1000));
    edit(dir, &with);
    let (live, mut onlooker) = watched(dir, &[]);
    onlooker.until("the hand", |s| s.view["sources"][0]["samples"].as_u64() > Some(200));
    drop(service);
    edit(dir, &other);
    onlooker.until("that it is gone", |_| live.said().contains("cannot be had again"));
    let chosen = |layout: &serde_json::Value| layout["materials"][0]["chosen"].clone();
    assert_ne!(chosen(&onlooker.shown.layout), "sandpaper P40");
    onlooker.ask(&json!({ "material": { "node": "texture", "name": "sandpaper P40" } }));
    onlooker.until("the texture", |s| chosen(&s.layout) == "sandpaper P40");
    live.stop().ok();
}

#[test]
fn an_edit_that_is_refused_keeps_the_hand() {
    let dir = &*shared_stage();
    let service = Service::start();
    let with = |address: SocketAddr, more: &str| {
        let [nodes, wires] = arm(address, more);
        tone(&nodes, &wires)
    };
    edit(dir, &with(service.address, ""));
    let (live, mut onlooker) = watched(dir, &[]);
    let samples = |o: &Onlooker| o.shown.view["sources"][0]["samples"].as_u64().unwrap_or(0);
    onlooker.until("the hand", |s| s.view["sources"][0]["samples"].as_u64() > Some(200));

    let refusals = || live.said().matches("cannot be taken over").count();
    let stalls = |o: &Onlooker| o.shown.view["sources"][0]["stalls"].as_u64();

    // A service that is not there.
    let nobody = TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr()).expect("a port");
    edit(dir, &with(nobody, ""));
    onlooker.until("the reason", |_| refusals() > 0);
    let (stalled, before) = (stalls(&onlooker), samples(&onlooker));
    let goes_on = |s: &Shown, n: u64| s.view["sources"][0]["samples"].as_u64() > Some(n + 500);
    onlooker.until("that the hand goes on", |s| goes_on(s, before));
    assert_eq!(stalls(&onlooker), stalled);
    assert_eq!(onlooker.shown.layout["number"], 0, "the graph is the one of before");

    // The same service, of which another device is wanted that it does not have: only when the first is let
    // go is that known.
    let counted = samples(&onlooker);
    edit(dir, &with(service.address, r#"device: "ABCD""#));
    onlooker.until("the reason", |_| refusals() > 1);
    let before = samples(&onlooker);
    onlooker.until("that the hand is back", |s| goes_on(s, before));
    let after = samples(&onlooker);
    assert!(after > counted + 500, "what was counted before is forgotten: {counted}, then {after}");
    let said = live.stop().ok().err;
    assert!(said.contains("ABCD") && said.contains("the running graph goes on"), "{said}");
    let places = rows(&dir.join("place.csv"));
    let last = &places[places.len() - 50..];
    assert!(last.windows(2).any(|p| p[0] != p[1]), "the hand stands still at the end");
}

#[test]
fn outputs_that_change_places_in_the_file_keep_their_channels() {
    let dir = &*shared_stage();
    let voice = |id: &str, hz: f64| {
        format!(
            r#""{id} tone": (kind: "sine", params: (frequency_hz: {hz:?})),
               "{id} limiter": (kind: "limiter"), "{id}": (kind: "audio_out"),"#
        )
    };
    let ears = r#""in 1": (kind: "audio_in", params: (unit: "A", channel: 1)),
       "in 2": (kind: "audio_in", params: (unit: "A", channel: 2)),
        "one": (kind: "file_out", params: (file: "one.npy")),
        "two": (kind: "file_out", params: (file: "two.npy")),"#;
    let wires = r#"("a tone", "a limiter"), ("a limiter", "a"), ("b tone", "b limiter"), ("b limiter", "b"),
       ("in 1", "one"), ("in 2", "two")"#;
    let text = |voices: [String; 2]| {
        format!("Graph(version: 1, nodes: {{{}{}{ears}}}, wires: [{wires}])", voices[0], voices[1])
    };
    edit(dir, &text([voice("a", 80.0), voice("b", 250.0)]));
    let card = "simulated:frames=256,channels=2,inputs=2,loopback=1";
    let mut live = Live::start(dir, &["g.ron", "--watch", "--device", card, "--channel", "1,2"]);
    live.says("plays on");
    std::thread::sleep(Duration::from_millis(500));
    edit(dir, &text([voice("b", 250.0), voice("a", 80.0)]));
    live.says("changed:");
    // And another change, which begins where that one left off.
    edit(dir, &text([voice("b", 250.0), voice("a", 81.0)]));
    let said = live.says("changed:");
    assert!(said.contains("a tone"), "{said}");
    std::thread::sleep(Duration::from_millis(800));
    live.stop().ok();
    for (file, hz) in [("one.npy", 81.0), ("two.npy", 250.0)] {
        let heard = npy(&dir.join(file));
        let end = &heard[heard.len() - 28_800..heard.len() - 4_800];
        let rises: Vec<usize> = (1..end.len()).filter(|&i| end[i - 1] < 0.0 && end[i] >= 0.0).collect();
        let mut periods: Vec<usize> = rises.windows(2).map(|w| w[1] - w[0]).collect();
        periods.sort_unstable();
        let period = periods[periods.len() / 2] as f64;
        assert!((period - 48_000.0 / hz).abs() < 2.0, "{file}: a period is {period} samples");
    }
}

#[test]
fn of_textures_chosen_in_a_burst_the_newest_plays() {
    let dir = &*shared_stage();
    std::fs::write(dir.join("g.ron"), graph("live.ron", "", "")).expect("a graph");
    let mut live = Live::start(dir, &["g.ron", "--page", "--device", CARD]);
    let mut onlooker = Onlooker::at(&live.says("the page: "));
    onlooker.until("a view", |s| s.view["ticks"].as_u64() > Some(100));
    let names: Vec<String> = onlooker.shown.layout["materials"][0]["names"]
        .as_array()
        .expect("materials")
        .iter()
        .map(|name| name.as_str().expect("a name").to_owned())
        .collect();
    const BURST: usize = 60;
    let choose = |onlooker: &mut Onlooker, name: &str| {
        onlooker.ask(&json!({ "material": { "node": "texture", "name": name } }));
    };
    for i in 0..BURST {
        choose(&mut onlooker, &names[i % names.len()]);
        onlooker.looks_on(Duration::from_millis(5));
    }
    let newest = names.iter().find(|name| *name == "sandpaper P40").expect("sandpaper P40");
    choose(&mut onlooker, newest);
    let chosen = |layout: &serde_json::Value| layout["materials"][0]["chosen"].clone();
    onlooker.until("the newest", |s| chosen(&s.layout) == newest.as_str());
    onlooker.looks_on(Duration::from_millis(1_500));
    let swaps = onlooker.shown.layout["number"].as_u64().expect("a number");
    println!("{swaps} of {} textures were taken over", BURST + 1);
    assert_eq!(chosen(&onlooker.shown.layout), newest.as_str());
    assert!((1..BURST as u64).contains(&swaps), "{swaps} of {} were taken over", BURST + 1);

    // A parameter that is moved while a texture is being made stays where it was put.
    let last = names.iter().find(|name| *name != newest).expect("another");
    choose(&mut onlooker, last);
    onlooker.looks_on(Duration::from_millis(40));
    onlooker.ask(&json!({ "set": { "node": "strength", "param": "gain", "value": 0.125 } }));
    // The page hears of either change first: on a quick machine the texture is made before the parameter is
    // moved.
    let strength = |layout: &serde_json::Value| {
        let nodes = layout["nodes"].as_array().expect("nodes");
        nodes.iter().find(|n| n["id"] == "strength").expect("a node")["live"][0]["value"].clone()
    };
    let holds = |s: &Shown| chosen(&s.layout) == last.as_str() && strength(&s.layout) == 0.125;
    onlooker.until("the last, and the parameter where it was put", holds);
    onlooker.looks_on(Duration::from_millis(500));
    assert!(holds(&onlooker.shown), "{}", onlooker.shown.layout);
    live.stop().ok();
}

#[test]
fn files_added_by_an_edit_hold_the_time_they_were_there() {
    let dir = &*shared_stage();
    let early = [r#""early": (kind: "file_out", params: (file: "early.npy")),"#, r#"("limiter", "early"),"#];
    let late = [r#""late": (kind: "file_out", params: (file: "late.npy")),"#, r#"("limiter", "late"),"#];
    edit(dir, &tone(early[0], early[1]));
    let mut live = plays(dir, &["--report", "r.json"]);
    std::thread::sleep(Duration::from_millis(300));
    // What another sink writes, or wrote, is not written over.
    for file in ["sent.npy", "r.json", "g.ron"] {
        edit(
            dir,
            &tone(
                &format!("{}{}", early[0], late[0].replace("late.npy", file)),
                &[early[1], late[1]].concat(),
            ),
        );
        live.says("cannot be taken over");
        live.says("the running graph goes on");
    }
    edit(dir, &tone(late[0], late[1]));
    live.says("changed:");
    std::thread::sleep(Duration::from_millis(300));
    edit(dir, &tone(&late[0].replace("late.npy", "early.npy"), late[1]));
    live.says("cannot be taken over");
    live.says("the running graph goes on");
    // The same sink into another file.
    edit(dir, &tone(&late[0].replace("late.npy", "later.wav"), late[1]));
    live.says("changed:");
    std::thread::sleep(Duration::from_millis(300));
    let ran = live.stop().ok();
    let name = |file: &str| dir.join(file);
    let (sent, early, late) = (npy(&name("sent.npy")), npy(&name("early.npy")), npy(&name("late.npy")));
    let later: Vec<f32> = hound::WavReader::open(name("later.wav"))
        .expect("a recording")
        .into_samples()
        .map(|x| x.expect("a sample"))
        .collect();
    println!("{} samples: {} early, {} late, {} later", sent.len(), early.len(), late.len(), later.len());
    // What was left out on a busy machine is missing in all of them; else nothing is.
    let left_out = json(&name("r.json"))["skipped_ticks"].as_u64();
    assert!(left_out > Some(0) || !ran.err.contains("rows of ticks"), "{}", ran.err);
    assert!(early.len() > 9_600 && late.len() > 9_600 && later.len() > 9_600);
    // One takes up where the other ended; what a new sink hears is faded in.
    let all = [&early[..], &late, &later].concat();
    assert_eq!(all.len(), sent.len());
    let other = all.iter().zip(&sent).enumerate().filter(|(_, (a, b))| a != b);
    let fades = [early.len(), early.len() + late.len()].map(|at| at..at + FADE);
    for (i, (a, b)) in other {
        assert!(fades.iter().any(|fade| fade.contains(&i)), "{a} in place of {b} at {i}: {fades:?}");
    }
}

#[test]
fn pointer_added_by_an_edit_moves_on_the_open_page() {
    let dir = &*shared_stage();
    edit(dir, &tone("", ""));
    let (live, mut onlooker) = watched(dir, &[]);
    onlooker.until("the graph", |s| s.layout["nodes"].is_array() && s.view["ticks"].as_u64() > Some(10));
    assert!(!onlooker.shown.hand);
    let pointer = [
        r#""hand": (kind: "pointer_input", params: (timeout_ms: 2000)),
           "place": (kind: "probe", params: (file: "place.csv")),"#,
        r#"("hand.position", "place"),"#,
    ];
    edit(dir, &tone(pointer[0], pointer[1]));
    onlooker.until("something to stroke", |s| s.hand);
    let mut at = 0;
    onlooker.until("the graph with it", |s| s.view["layout"] == 1);
    while onlooker.shown.view["sources"][0]["samples"].as_u64() < Some(50) {
        at += 1;
        assert!(at < 2_000, "the hand is not heard of: {}", onlooker.shown.view);
        onlooker.touches(f64::from(at) * 8.0, 0.1 * f64::from(at), 0.5, 1.0);
        onlooker.looks_on(Duration::from_millis(5));
    }
    edit(dir, &tone("", ""));
    onlooker.until("nothing to stroke", |s| !s.hand);
    onlooker.touches(1e6, 3.0, 0.5, 2.0);
    onlooker.looks_on(Duration::from_millis(100));
    live.stop().ok();
    let places = rows(&dir.join("place.csv"));
    assert!(places.iter().any(|p| p[0] > 1.0), "the stylus did not move");
}
