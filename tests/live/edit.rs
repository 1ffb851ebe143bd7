//! `asperity run` while its graph is edited: nobody waits for that, and what cannot be had changes nothing.

use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::path::Path;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use harness::alone::shared_stage;
use harness::json;
use harness::live::{CARD, Live, graph, npy, rows, until};
use serde_json::{Value, json};

use crate::edits::{edit, tone};
use crate::haply::Service;
use crate::socket::{Onlooker, Shown};

/// Samples of a tick at 48 kHz.
const TICK: usize = 96;
/// Samples in which the output must be silent: 20 ms.
const DOWN: usize = 960;
/// Samples of a crossfade.
const FADE: usize = 480;

/// A tone beside a hand on an Inverse3 whose place is recorded.
fn arm(service: SocketAddr, params: &str) -> String {
    let nodes = format!(
        r#""arm": (kind: "haply_input", params: (service: "ws://{service}", timeout_ms: 2000, {params})),
           "place": (kind: "probe", params: (file: "place.csv")),"#
    );
    tone(&nodes, r#"("arm.position", "place"),"#)
}

/// A run that is watched, and its page.
fn watched(dir: &Path, text: &str, more: &[&str]) -> (Live, Onlooker) {
    edit(dir, text);
    let mut live = Live::start(dir, &[&["g.ron", "--watch", "--page", "--device", CARD], more].concat());
    let onlooker = Onlooker::at(&live.says("the page: "));
    (live, onlooker)
}

/// A run that is watched and plays.
fn plays(dir: &Path, text: &str, more: &[&str]) -> Live {
    edit(dir, text);
    let mut live = Live::start(dir, &[&["g.ron", "--watch", "--device", CARD], more].concat());
    live.says("plays on");
    live
}

fn ticks(shown: &Shown) -> u64 {
    shown.view["ticks"].as_u64().unwrap_or(0)
}

/// Samples and stalls of the hand.
fn hand(shown: &Shown) -> [u64; 2] {
    ["samples", "stalls"].map(|name| shown.view["sources"][0][name].as_u64().unwrap_or(0))
}

/// The material of the texture.
fn chosen(shown: &Shown) -> &Value {
    &shown.layout["materials"][0]["chosen"]
}

/// A tone at full level whose graph was edited, so that a hand is being opened that never answers.
fn opening(dir: &Path) -> (Live, Onlooker, Service) {
    let (live, mut onlooker) = watched(dir, &tone("", ""), &["--report", "r.json"]);
    onlooker.until("full level", |s| s.view["seconds"].as_f64() > Some(2.6));
    assert!(onlooker.shown.view["peak"].as_f64() > Some(0.05), "{}", onlooker.shown.view);
    let mute = Service::mute();
    edit(dir, arm(mute.address, ""));
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
    let before = ticks(&onlooker.shown);
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
    assert_eq!(Some((sent.len() / TICK) as u64), report["ticks"].as_u64(), "{report}");
    let fall = fall(&heard, before as usize * TICK);
    println!("silent {fall} samples behind a crest");
    // A crest may be half a period old when the fall begins, and the ramp is above 0.99 for a while.
    assert!(fall < DOWN + 300, "it falls in {fall} samples");
}

#[test]
fn sigterm_does_not_wait_for_a_hand_that_does_not_answer() {
    let dir = &*shared_stage();
    let (live, onlooker, mute) = opening(dir);
    let before = ticks(&onlooker.shown);
    assert_eq!(mute.given_up.load(Relaxed), 0);
    let ran = live.stop_by("TERM").ok();
    assert!(!ran.err.contains("cannot be taken over"), "it waited: {}", ran.err);
    let report = json(&dir.join("r.json"));
    assert!(report["ticks"].as_u64() >= Some(before), "{report}");
    // Nothing is left of the edit.
    assert_eq!(harness::files(dir), ["g.ron", "heard.npy", "r.json", "sent.npy"]);

    // A hand whose settings were edited, and more recorded of it: it was closed and is being opened again,
    // which never answers.
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    let service = Service::start();
    let (live, mut onlooker) = watched(dir, &arm(service.address, ""), &["--report", "r.json"]);
    onlooker.until("the hand", |s| hand(s)[0] > 200);
    service.mute.store(true, Relaxed);
    let text = arm(service.address, r#"device: "049D""#);
    let more = r#""q": (kind: "probe", params: (file: "q.csv")), "place":"#;
    edit(dir, text.replace(r#""place":"#, more).replace("wires: [", r#"wires: [("arm.position", "q"), "#));
    onlooker.until("that it is being opened", |_| service.unheard.load(Relaxed) > 0);
    live.stop_by("TERM").ok();
    assert_eq!(harness::files(dir), ["g.ron", "heard.npy", "place.csv", "r.json", "sent.npy"]);
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
    let mut live = plays(dir, &here(""), &[]);
    let before = socket(port);
    for (wrong, named) in [(r#", arguments: "foo""#, "foo"), (r#", address: "no slash""#, "no slash")] {
        edit(dir, here(wrong));
        let said = live.says("cannot be taken over");
        assert!(live.said().contains(named), "{said}");
        assert_eq!(socket(port), before, "it was closed for {wrong}");
    }
    // It may start to listen on all addresses.
    for text in [stylus("0.0.0.0", ", anywhere: true"), here("")] {
        edit(dir, text);
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
        let params = format!(r#", params: (service: "ws://{}", timeout_ms: {timeout_ms}))"#, service.address);
        let (text, stylus) = (graph("haply.ron", "", ""), r#"(kind: "haply_input""#);
        assert!(text.contains(stylus));
        text.replace(&format!("{stylus})"), &format!("{stylus}{params}"))
    };
    let (with, other) = (text(2000), text(1000));
    let (live, mut onlooker) = watched(dir, &with, &[]);
    onlooker.until("the hand", |s| hand(s)[0] > 200);
    drop(service);
    edit(dir, other);
    onlooker.until("that it is gone", |_| live.said().contains("cannot be restored"));
    assert_ne!(chosen(&onlooker.shown), "sandpaper P40");
    onlooker.ask(&json!({ "material": ["sandpaper P40", "texture"] }));
    onlooker.until("the texture", |s| chosen(s) == "sandpaper P40");
    live.stop().ok();
}

#[test]
fn an_edit_that_is_refused_keeps_the_hand() {
    let dir = &*shared_stage();
    let service = Service::start();
    let (live, mut onlooker) = watched(dir, &arm(service.address, ""), &[]);
    onlooker.until("the hand", |s| hand(s)[0] > 200);
    let refusals = || live.said().matches("cannot be taken over").count();

    // A service that is not there.
    let nobody = TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr()).expect("a port");
    edit(dir, arm(nobody, ""));
    onlooker.until("the reason", |_| refusals() > 0);
    let [before, stalls] = hand(&onlooker.shown);
    onlooker.until("that the hand goes on", |s| hand(s)[0] > before + 500);
    assert_eq!(hand(&onlooker.shown)[1], stalls);
    assert_eq!(onlooker.shown.layout["number"], 0, "the graph is the one of before");

    // The same service, of which another device is wanted that it does not have: only when the first is let
    // go is that known.
    let [counted, _] = hand(&onlooker.shown);
    edit(dir, arm(service.address, r#"device: "ABCD""#));
    onlooker.until("the reason", |_| refusals() > 1);
    let [before, _] = hand(&onlooker.shown);
    onlooker.until("that the hand is back", |s| hand(s)[0] > before + 500);
    let [after, _] = hand(&onlooker.shown);
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
    let text = |[one, other]: [String; 2]| {
        edit(dir, format!("Graph(version: 1, nodes: {{{one}{other}{ears}}}, wires: [{wires}])"));
    };
    text([voice("a", 80.0), voice("b", 250.0)]);
    let card = "simulated:frames=256,channels=2,inputs=2,loopback=1";
    let mut live = Live::start(dir, &["g.ron", "--watch", "--device", card, "--channel", "1,2"]);
    live.says("plays on");
    std::thread::sleep(Duration::from_millis(500));
    text([voice("b", 250.0), voice("a", 80.0)]);
    live.says("changed:");
    // And another change, which begins where that one left off.
    text([voice("b", 250.0), voice("a", 81.0)]);
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
    const BURST: usize = 60;
    let dir = &*shared_stage();
    let (live, mut onlooker) = watched(dir, &graph("live.ron", "", ""), &[]);
    onlooker.until("a view", |s| ticks(s) > 100);
    let names = onlooker.shown.layout["materials"][0]["names"].as_array().expect("materials").clone();
    let choose = |onlooker: &mut Onlooker, name: &Value| {
        onlooker.ask(&json!({ "material": [name] }));
    };
    for i in 0..BURST {
        choose(&mut onlooker, &names[i % names.len()]);
        onlooker.looks_on(Duration::from_millis(5));
    }
    let newest = names.iter().find(|name| *name == "sandpaper P40").expect("sandpaper P40");
    choose(&mut onlooker, newest);
    onlooker.until("the newest", |s| chosen(s) == newest);
    onlooker.looks_on(Duration::from_millis(1_500));
    let swaps = onlooker.shown.layout["number"].as_u64().expect("a number");
    println!("{swaps} of {} textures were taken over", BURST + 1);
    assert_eq!(chosen(&onlooker.shown), newest);
    assert!((1..BURST as u64).contains(&swaps), "{swaps} of {} were taken over", BURST + 1);

    // A parameter that is moved while a texture is being made stays where it was put.
    let last = names.iter().find(|name| *name != newest).expect("another");
    choose(&mut onlooker, last);
    onlooker.looks_on(Duration::from_millis(40));
    onlooker.ask(&json!({ "set": ["strength.gain", 0.125] }));
    // The page hears of either change first: on a quick machine the texture is made before the parameter is
    // moved.
    let holds = |s: &Shown| {
        let nodes = s.layout["nodes"].as_array().expect("nodes");
        let strength = nodes.iter().find(|n| n["id"] == "strength").expect("a node");
        chosen(s) == last && strength["live"][0]["value"] == 0.125
    };
    onlooker.until("the last, and the parameter where it was put", holds);
    onlooker.looks_on(Duration::from_millis(500));
    assert!(holds(&onlooker.shown), "{}", onlooker.shown.layout);
    live.stop().ok();
}

#[test]
fn files_added_by_an_edit_hold_the_time_they_were_there() {
    let dir = &*shared_stage();
    let early = [r#""early": (kind: "file_out", params: (file: "early.npy")),"#, r#"("limiter", "early"),"#];
    let late = |file: &str| format!(r#""late": (kind: "file_out", params: (file: "{file}")),"#);
    let wire = r#"("limiter", "late"),"#;
    let pause = || std::thread::sleep(Duration::from_millis(300));
    let mut live = plays(dir, &tone(early[0], early[1]), &["--report", "r.json"]);
    pause();
    let refused = |live: &mut Live, text: String| {
        edit(dir, text);
        live.says("cannot be taken over");
        live.says("the running graph goes on");
    };
    // What another sink writes, or wrote, is not written over.
    for file in ["sent.npy", "r.json", "g.ron"] {
        refused(&mut live, tone(&(early[0].to_owned() + &late(file)), &[early[1], wire].concat()));
    }
    edit(dir, tone(&late("late.npy"), wire));
    live.says("changed:");
    pause();
    refused(&mut live, tone(&late("early.npy"), wire));
    // The same sink into another file.
    edit(dir, tone(&late("later.wav"), wire));
    live.says("changed:");
    pause();
    let ran = live.stop().ok();
    let [sent, early, late] = ["sent.npy", "early.npy", "late.npy"].map(|file| npy(&dir.join(file)));
    let later = harness::wav(&dir.join("later.wav")).0;
    println!("{} samples: {} early, {} late, {} later", sent.len(), early.len(), late.len(), later.len());
    // What was left out on a busy machine is missing in all of them; else nothing is.
    let left_out = json(&dir.join("r.json"))["skipped_ticks"].as_u64();
    assert!(left_out > Some(0) || !ran.err.contains("rows of ticks"), "{}", ran.err);
    assert!([&early, &late, &later].iter().all(|part| part.len() > 9_600));
    // One takes up where the other ended; what a new sink hears is faded in.
    let all = [&early[..], &late, &later].concat();
    assert_eq!(all.len(), sent.len());
    let fades = [early.len(), early.len() + late.len()].map(|at| at..at + FADE);
    for (i, (a, b)) in all.iter().zip(&sent).enumerate().filter(|(_, (a, b))| a != b) {
        assert!(fades.iter().any(|fade| fade.contains(&i)), "{a} in place of {b} at {i}: {fades:?}");
    }
}

#[test]
fn pointer_added_by_an_edit_moves_on_the_open_page() {
    let dir = &*shared_stage();
    let (live, mut onlooker) = watched(dir, &tone("", ""), &[]);
    onlooker.until("the graph", |s| s.layout["nodes"].is_array() && ticks(s) > 10);
    assert!(!onlooker.shown.hand);
    let nodes = r#""hand": (kind: "pointer_input", params: (timeout_ms: 2000)),
           "place": (kind: "probe", params: (file: "place.csv")),"#;
    edit(dir, tone(nodes, r#"("hand.position", "place"),"#));
    onlooker.until("something to stroke", |s| s.hand);
    onlooker.until("the graph with it", |s| s.view["layout"] == 1);
    let mut at = 0;
    while hand(&onlooker.shown)[0] < 50 {
        at += 1;
        assert!(at < 2_000, "the hand is not heard of: {}", onlooker.shown.view);
        onlooker.touches(f64::from(at) * 8.0, 0.1 * f64::from(at), 0.5, 1.0);
        onlooker.looks_on(Duration::from_millis(5));
    }
    edit(dir, tone("", ""));
    onlooker.until("nothing to stroke", |s| !s.hand);
    onlooker.touches(1e6, 3.0, 0.5, 2.0);
    onlooker.looks_on(Duration::from_millis(100));
    live.stop().ok();
    let places = rows(&dir.join("place.csv"));
    assert!(places.iter().any(|p| p[0] > 1.0), "the stylus did not move");
}
