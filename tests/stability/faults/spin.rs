//! A node that does not come back: under the paced driver the output ramps to zero, the fault is counted and
//! named, and the run can be ended.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use asperity_audio::Request;
use asperity_audio::simulated::Simulated;
use asperity_checks::wrap::stateless;
use asperity_engine::Options;
use asperity_live::driver::Clock;
use asperity_live::view::View;
use asperity_live::{DOES_NOT_COME_BACK, DeviceQueues, RunControl, Session, SessionOptions, prepare_live};
use asperity_node::{Descriptor, NodeKind, Output, Param, RateSpec, ShapeSpec, Status, Unit};
use harness::live::{PATIENCE, told};
use harness::stage::{STEP, channel, graph, largest_step, poll, timed, voice};
use harness::{asperity, json, plugins};

/// Samples in which the output is down: 20 ms.
const DOWN: usize = 960;

/// Which of the nodes that spin without end may do so: those of earlier tries are let go, so that they take
/// no core from what comes after.
static TRIES: AtomicU64 = AtomicU64::new(0);

/// A slow wave; in tick `from` and after it calls take this long.
fn spins() -> Arc<NodeKind> {
    let descriptor = Descriptor::new("spins", "A wave, then none.")
        .output(Output::new("out", ShapeSpec::Audio(RateSpec::Graph), Unit::AMPERE))
        .param(Param::integer("from", 400, 0..=1_000_000, "First tick."))
        .param(Param::number("lasts_s", 1e6, 0.0..=1e6, "How long a call takes."));
    stateless(descriptor, |setup| {
        let from = setup.params.integer("from") as u64;
        let lasts = Duration::from_secs_f64(setup.params.number("lasts_s"));
        let tries = TRIES.load(Ordering::Relaxed);
        move |tick| {
            let span = tick.samples(48_000);
            for (y, n) in tick.outputs.audio(0).iter_mut().zip(span) {
                *y = 0.1 * (n as f32 * 0.01).sin();
            }
            let began = Instant::now();
            let over = || lasts > PATIENCE && TRIES.load(Ordering::Relaxed) != tries;
            while tick.index >= from && began.elapsed() < lasts && !over() {
                std::hint::spin_loop();
            }
            Status::Continue
        }
    })
}

/// A run of a node that spins on channel 1, and of a tone on channel 2, by the paced driver.
fn start(card: &Simulated, lasts_s: f64, limit: Duration) -> Session {
    let mut registry = harness::registry();
    registry.add(spins());
    let (tone, wires) = voice("tone", 80.0, 0.1);
    let nodes = format!(
        r#""bad": (kind: "spins", params: (lasts_s: {lasts_s:?})), "limiter": (kind: "limiter",
        params: (profile: "hapcoil_one")),
           "out": (kind: "audio_out"), {tone}"#
    );
    let wires = format!(r#"("bad", "limiter"), ("limiter", "out"), {wires}"#);
    let (file, compiled) = graph(&registry, (500, 48_000), &nodes, &wires);
    let options = Options { limit_ns: Some(limit.as_nanos() as u64), ..Options::default() };
    let (graph_controller, player) =
        prepare_live(compiled, &file, options, DeviceQueues::default(), None, Vec::new());
    let options = SessionOptions {
        device: Some(Request { device: Some(card.id()), channels: vec![1, 2], ..Request::default() }),
        clock: Some(Clock::Paced),
        reconnect: true,
        start_s: 0.0,
        realtime: false,
        run_control: RunControl::default(),
        coil_monitor: None,
    };
    Session::start(graph_controller, player, None, options).expect("it starts")
}

/// Whether the sound ends within 20 ms without a step, and stays silent.
fn falls_silent(heard: &[f64]) -> Result<(), String> {
    let loud = heard.iter().rposition(|y| y.abs() > 0.03).ok_or("nothing is ever heard")?;
    let last = heard.iter().rposition(|y| *y != 0.0).unwrap_or(loud);
    if heard.len() < last + 24_000 {
        return Err(format!("{} of {} samples, and no half second of silence", last, heard.len()));
    }
    if last > loud + DOWN {
        return Err(format!("it falls for {} samples", last - loud));
    }
    // Where a busy machine leaves a break before, it is faded too.
    let steepest = largest_step(&heard[loud.saturating_sub(4800)..]);
    if steepest > STEP { Err(format!("a step of {steepest}")) } else { Ok(()) }
}

/// Whether a node's fault is counted, and named.
fn is_counted(view: &View, node: usize) -> Result<(), String> {
    let (all, seen) = (view.faults, &view.nodes[node]);
    let counted = seen.faults == 1 && all == 1 && seen.last_fault == DOES_NOT_COME_BACK;
    let wrong = || format!("{all} faults of all, of the node {}, last: {}", seen.faults, seen.last_fault);
    if counted { Ok(()) } else { Err(wrong()) }
}

/// The tick thread is in a call that does not end. The ring runs dry, and there is nobody to fill it.
#[test]
fn spinning_node_is_silenced_counted_and_left_behind() {
    let mut attempts = 0..;
    told(|| {
        let name = format!("spin {}", attempts.next().unwrap_or(0));
        let card = Simulated::new(&name, timed(256)).expect("a card");
        let heard = |c| channel(&card.played(), 2, c);
        let mut session = start(&card, 1e6, Duration::from_millis(50));
        poll(&mut session, "the wave", |_| heard(0).iter().any(|y| y.abs() > 0.05));
        let bad = session.graph_controller().schedule().index_of("bad").expect("the node");
        poll(&mut session, "the fault", |s| s.view().nodes[bad].last_fault == DOES_NOT_COME_BACK);
        let frames = heard(0).len();
        poll(&mut session, "silence", |_| heard(0).len() > frames + 36_000);
        let view = session.view();
        let (one, two) = (heard(0), heard(1));
        let began = Instant::now();
        let ended = session.stop();
        TRIES.fetch_add(1, Ordering::Relaxed);
        assert!(began.elapsed() < PATIENCE, "it took {:?} to stop", began.elapsed());
        assert!(ended.player.is_none(), "the thread is still in there");
        if view.nodes.iter().enumerate().any(|(i, node)| i != bad && node.faults > 0) {
            return Err("a busy machine held up another node".into());
        }
        is_counted(&view, bad).unwrap();
        is_counted(&ended.view, bad).unwrap();
        assert!(view.underruns > 0 && view.lost_samples > 20_000, "{} underruns", view.underruns);
        falls_silent(&one).unwrap();
        falls_silent(&two).unwrap();

        // Mutants: a driver that plays what it has again, one that holds the last sample, one that cuts it
        // off; a view that does not count.
        let loud = one.iter().rposition(|y| y.abs() > 0.03).expect("a wave");
        for rest in [&one[loud - 960..loud], &[one[loud - 1]], &[0.0]] {
            let rest = rest.iter().cycle().take(48_000);
            falls_silent(&one[..loud].iter().chain(rest).copied().collect::<Vec<_>>()).unwrap_err();
        }
        is_counted(&View { faults: 0, ..view }, bad).unwrap_err();
        Ok(())
    });
}

/// Tells a program to stop, as by Ctrl-C.
fn ctrl_c(child: &Child) {
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(sent.is_ok_and(|sent| sent.success()), "it is gone already");
}

/// Waits for the end of a program that is told to stop; its exit code and what it said.
fn ends_on_ctrl_c(mut child: Child, patience: Duration) -> Result<(Option<i32>, String), String> {
    ctrl_c(&child);
    let began = Instant::now();
    while child.try_wait().expect("a program").is_none() {
        if began.elapsed() > patience {
            let _ = child.kill();
            let _ = child.wait();
            return Err(format!("it goes on after {patience:?}"));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    Ok((child.wait().expect("a program").code(), said(&mut child)))
}

/// Error output of a program that has ended.
fn said(child: &mut Child) -> String {
    let mut said = String::new();
    std::io::Read::read_to_string(&mut child.stderr.take().expect("a pipe"), &mut said).expect("words");
    said
}

fn quietly(command: &mut Command) -> Child {
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("it starts")
}

/// A graph of a plugin that spins from a tick on, and of other nodes.
fn write_spinning(dir: &Path, from: u32, nodes: &str, wires: &str) {
    let graph = format!(
        r#"Graph(version: 1, plugins: [{:?}],
            nodes: {{"bad": (kind: "told", params: (from: {from}, to: 1000000, what: endless)),
            "guard": (kind: "limiter"), "out": (kind: "audio_out"), {nodes}}},
            wires: [("guard", "out"), {wires}])"#,
        plugins::c("told").display().to_string()
    );
    std::fs::write(dir.join("g.ron"), graph).expect("a graph");
}

/// A tone, whose sum with the plugin is recorded.
const TONE: &str = r#""tone": (kind: "sine", params: (frequency_hz: 200, amplitude: 0.05)),
    "sum": (kind: "mix"), "ear": (kind: "file_out", params: (file: "heard.npy"))"#;
const BESIDE: &str = r#"("bad", "sum.in1"), ("tone", "sum.in2"), ("sum", "guard"), ("guard", "ear")"#;

/// The node of the plugin in the report.
fn bad_node(dir: &Path) -> serde_json::Value {
    let report = json(&dir.join("r.json"));
    let nodes = report["nodes"].as_array().expect("nodes");
    nodes.iter().find(|node| node["id"] == "bad").expect("the node").clone()
}

/// The program with a plugin in an endless loop: the node is cut out, the rest goes on, and the run ends
/// when it is to.
#[test]
fn plugin_that_never_returns_is_cut_out_and_the_graph_goes_on() {
    for (clock, ends) in [("paced", "--seconds"), ("callback", "ctrl-c")] {
        let dir = tempfile::tempdir().expect("a folder");
        // The plugin spins after 0.8 s.
        write_spinning(dir.path(), 400, TONE, BESIDE);
        let seconds = if ends == "ctrl-c" { "1000" } else { "5" };
        let args =
            ["run", "g.ron", "--device", "simulated:frames=256", "--clock", clock, "--report", "r.json"];
        let mut child = quietly(asperity(dir.path()).args(args).args(["--seconds", seconds]));
        let (code, said) = if ends == "ctrl-c" {
            std::thread::sleep(Duration::from_secs(5));
            ends_on_ctrl_c(child, PATIENCE).unwrap()
        } else {
            (Some(harness::live::end(&mut child)), said(&mut child))
        };
        assert_eq!(code, Some(0), "{clock}: {said}");
        let line = "warning: `bad` (told) did not return and is cut out: the graph goes on without it";
        assert_eq!(said.matches(line).count(), 1, "{clock}: {said}");
        let bad = bad_node(dir.path());
        assert!(bad["quarantined"] == true && bad["last_fault"] == "did not return and is cut out", "{bad}");
        let heard = harness::live::npy(&dir.path().join("heard.npy"));
        assert!(heard.len() > 3 * 48_000, "{clock}: {} samples", heard.len());
        // With the plugin's wave first, then the tone alone.
        let rms = harness::live::rms;
        let (before, after) = (rms(&heard[24_000..33_600]), rms(&heard[heard.len() - 48_000..]));
        assert!(before > 0.06, "{clock}: rms {before} with both");
        assert!((after / (0.05 / 2f32.sqrt()) as f64 - 1.0).abs() < 0.05, "{clock}: rms {after} of the tone");
    }
}

/// Called in place, it keeps the tick for ever; time goes on all the same, and the run ends when it is to.
#[test]
fn run_in_place_with_a_stuck_plugin_ends_in_time() {
    let dir = tempfile::tempdir().expect("a folder");
    write_spinning(dir.path(), 200, "", r#"("bad", "guard")"#);
    let args = ["run", "g.ron", "--device", "simulated:frames=1024", "--clock", "paced", "--in-place"];
    let mut child = quietly(asperity(dir.path()).args(args).args(["--report", "r.json", "--seconds", "3"]));
    let code = harness::live::end(&mut child);
    let said = said(&mut child);
    assert_eq!(code, 1, "{said}");
    for line in ["warning: `bad` (told) does not come back", "error: a tick did not end: `bad` (told)"] {
        assert_eq!(said.matches(line).count(), 1, "{line}: {said}");
    }
    let bad = bad_node(dir.path());
    assert!(bad["faults"] == 1 && bad["last_fault"] == DOES_NOT_COME_BACK, "{bad}");
}

/// Offline there is nobody else to look after it: the third Ctrl-C ends the program, and no half file is
/// left under the name that was asked for.
#[test]
fn a_render_with_a_plugin_that_spins_ends_on_the_third_ctrl_c() {
    let dir = tempfile::tempdir().expect("a folder");
    write_spinning(dir.path(), 200, "", r#"("bad", "guard")"#);
    let args = ["render", "g.ron", "--seconds", "10", "--out", "o.wav", "--quiet"];
    let child = quietly(asperity(dir.path()).args(args));
    std::thread::sleep(Duration::from_secs(2));
    for _ in 0..2 {
        ctrl_c(&child);
        std::thread::sleep(Duration::from_millis(500));
    }
    let (code, said) = ends_on_ctrl_c(child, PATIENCE).unwrap();
    assert_eq!((code, said.matches("once more").count()), (Some(130), 1), "{said}");
    assert!(!dir.path().join("o.wav").exists());
}

/// Mutant: a program that waits for what does not come.
#[test]
fn a_program_that_does_not_end_is_found_out() {
    let child = quietly(Command::new("sh").args(["-c", "trap '' INT; while :; do sleep 0.05; done"]));
    std::thread::sleep(Duration::from_millis(300));
    ends_on_ctrl_c(child, Duration::from_secs(1)).unwrap_err();
}

/// Calls of 30 ms where 15 may be taken: each is counted, after eight the node is taken out, and what it
/// held up is heard again.
#[test]
fn slow_node_is_counted_and_cut_out_and_the_rest_plays() {
    let mut attempts = 0..;
    told(|| {
        let card =
            Simulated::new(&format!("slow {}", attempts.next().unwrap_or(0)), timed(256)).expect("a card");
        let heard = |c| channel(&card.played(), 2, c);
        let mut session = start(&card, 0.03, Duration::from_millis(15));
        let bad = session.graph_controller().schedule().index_of("bad").expect("the node");
        poll(&mut session, "the end of the node", |s| s.view().nodes[bad].quarantined);
        let frames = heard(0).len();
        poll(&mut session, "more", |_| heard(0).len() > frames + 48_000);
        let view = session.view();
        let (one, two) = (heard(0), heard(1));
        assert!(session.stop().player.is_some());
        if view.nodes[bad].calls != 400 + 8
            || view.nodes.iter().enumerate().any(|(i, n)| i != bad && n.quarantined)
        {
            return Err("a busy machine held up nodes before".into());
        }
        assert_eq!((view.nodes[bad].faults, &*view.nodes[bad].last_fault), (8, "took longer than it may"));
        // What is left is the DC that the limiter takes out, at its corner of 5 Hz.
        assert!(one[one.len() - 9600..].iter().all(|y| y.abs() < 1e-4), "it is silent");
        assert!(two[two.len() - 9600..].iter().any(|y| y.abs() > 0.05), "the tone goes on");
        Ok(())
    });
}
