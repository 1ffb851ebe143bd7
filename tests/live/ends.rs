//! Runs that nobody looks at any more: their terminal is closed, or nobody reads what they say.
#![cfg(target_os = "linux")]

use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use harness::alone::{beside_others, shared_stage};
use harness::live::{CARD, Live, npy, told, until};
use harness::servers::{signal, skipped};
use harness::{asperity, json, run, wav};

use crate::edits::{edit, tone};
use crate::socket::{Onlooker, Shown};

/// First bytes to a terminal.
const ENTER: &str = "\x1b[?1049h";

/// A run with `--tui` in a pseudo-terminal that `script` (util-linux) makes, up for some seconds.
struct InTerminal {
    script: Child,
    run: u32,
}

impl InTerminal {
    /// `prefix` is what starts it in the shell of the terminal. None, and a line that says so, where there
    /// is no `script`.
    fn start(dir: &Path, prefix: &str) -> Option<Self> {
        if Command::new("script").arg("--version").output().is_err() {
            skipped("there is no `script` here to make a pseudo-terminal");
            return None;
        }
        edit(dir, tone("", ""));
        let own = asperity(dir).get_program().to_string_lossy().into_owned();
        let run = format!("echo $$ > pid; exec {own} run g.ron --tui --device {CARD} --report r.json");
        let command = format!("stty rows 40 cols 120; {prefix} sh -c '{run}'");
        let script = Command::new("script")
            .args(["-qefc", &command, "screen"])
            .current_dir(dir)
            .env("TERM", "xterm-256color")
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("script starts");
        let screen = || std::fs::read(dir.join("screen")).unwrap_or_default();
        until("it draws", || String::from_utf8_lossy(&screen()).contains(ENTER));
        let said = std::fs::read_to_string(dir.join("pid")).expect("its number");
        let run: u32 = said.trim().parse().expect("a number");
        until("the first tick", || threads(run).iter().any(|name| name == "asperity-tick"));
        // The output is up after two seconds.
        std::thread::sleep(Duration::from_millis(2500));
        Some(Self { script, run })
    }

    /// Closes the terminal: its other end is gone.
    fn hang_up(&mut self) {
        self.script.kill().expect("script runs");
        self.script.wait().expect("it ends");
    }

    /// Whether the run is still there.
    fn runs(&self) -> bool {
        stat(self.run).is_some_and(|fields| fields[0] != "Z")
    }

    /// The part of a processor that it takes in a second.
    fn share(&self) -> f64 {
        let worked_s = || {
            let fields = stat(self.run).expect("it runs");
            (11..13).map(|n| fields[n].parse::<f64>().expect("a number") / 100.0).sum::<f64>()
        };
        let (began, before) = (Instant::now(), worked_s());
        std::thread::sleep(Duration::from_secs(1));
        (worked_s() - before) / began.elapsed().as_secs_f64()
    }
}

impl Drop for InTerminal {
    fn drop(&mut self) {
        let _ = self.script.kill();
        let _ = self.script.wait();
        if self.runs() {
            signal(self.run, "KILL");
        }
    }
}

/// The names of a process's threads.
fn threads(process: u32) -> Vec<String> {
    let all = std::fs::read_dir(format!("/proc/{process}/task")).into_iter().flatten().flatten();
    let name = |thread: std::fs::DirEntry| std::fs::read_to_string(thread.path().join("comm")).ok();
    all.filter_map(name).map(|name| name.trim_end().to_owned()).collect()
}

/// Fields of `/proc/PID/stat`, from the state on.
fn stat(process: u32) -> Option<Vec<String>> {
    let text = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    Some(text.rsplit_once(')')?.1.split_whitespace().map(str::to_owned).collect())
}

/// Asserts that the card heard what was sent up to the stop, and a falling level from there on.
fn ends_softly(dir: &Path) -> Result<(), String> {
    const MARK: usize = 960;
    let (sent, heard) = (npy(&dir.join("sent.npy")), npy(&dir.join("heard.npy")));
    let Some(from) = heard.len().checked_sub(10 * MARK) else { return Err("it was short".into()) };
    let mark = &heard[from..from + MARK];
    assert!(mark.iter().any(|x| x.abs() > 0.09), "it was not up");
    let lag = (0..from.min(24_000)).find(|lag| sent.get(from - lag..from - lag + MARK) == Some(mark));
    let Some(lag) = lag else { return Err("samples were lost before the end".into()) };
    let same = (from..heard.len()).take_while(|&i| heard[i] == sent[i - lag]).count();
    let falls = from + same..heard.len();
    println!("{} samples of a ramp, to {:.4}", falls.len(), heard[heard.len() - 1]);
    // The last of it is on its way to the recording when the run ends.
    if falls.len() < MARK / 10 || falls.len() > 2 * MARK {
        return Err(format!("{} samples of a ramp were recorded", falls.len()));
    }
    if falls.clone().all(|i| heard[i].abs() <= sent[i - lag].abs() + 1e-6) {
        return Ok(());
    }
    // A period that the server lost puts what follows beside what was sent.
    Err("samples were lost in the ramp".into())
}

#[test]
fn closed_terminal_ends_the_run_with_a_ramp_and_its_files() {
    let _alone = beside_others();
    told(|| {
        let dir = tempfile::tempdir().expect("a folder");
        let Some(mut it) = InTerminal::start(dir.path(), "exec") else { return Ok(()) };
        it.hang_up();
        until("the run to end", || !it.runs());
        let report = json(&dir.path().join("r.json"));
        assert!(report["ticks"].as_u64() > Some(500), "{report}");
        ends_softly(dir.path())
    });
}

/// It neither ends the run nor keeps a processor busy.
#[test]
fn terminal_gone_without_a_signal_costs_nothing() {
    let _alone = beside_others();
    told(|| {
        let dir = tempfile::tempdir().expect("a folder");
        // In a session of its own nobody tells it.
        let Some(mut it) = InTerminal::start(dir.path(), "exec setsid -w") else { return Ok(()) };
        let before = it.share();
        it.hang_up();
        let began = Instant::now();
        let after = it.share();
        println!("{before:.2} of a processor before, {after:.2} after");
        assert!(it.runs(), "it ended");
        assert!(after < before + 0.15, "{before:.2} of a processor before, {after:.2} after");
        let went_on_s = began.elapsed().as_secs_f64();
        signal(it.run, "INT");
        until("the run to end", || !it.runs());
        let report = json(&dir.path().join("r.json"));
        assert!(report["seconds"].as_f64() > Some(2.5 + went_on_s), "{report}");
        ends_softly(dir.path())
    });
}

/// Bytes that a pipe holds.
const PIPE: usize = 65_536;

#[test]
fn unread_messages_delay_neither_mute_ticks_nor_end() {
    let dir = &*shared_stage();
    edit(dir, tone("", ""));
    let mut child = asperity(dir)
        .args(["run", "g.ron", "--page", "--watch", "--device", CARD])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut said = BufReader::new(child.stderr.take().expect("a pipe"));
    let mut line = String::new();
    let mut says = |text: &str| loop {
        line.clear();
        assert!(said.read_line(&mut line).expect("text") > 0, "it never said `{text}`");
        if let Some((_, rest)) = line.split_once(text) {
            return rest.trim().to_owned();
        }
    };
    let url = says("the page: ");
    says("plays on");
    let mut onlooker = Onlooker::at(&url);
    // From here on nobody reads. Of each of these files a thousand nodes are refused, and fifty are told.
    for number in 0..3 {
        let node = |n: usize| format!("\"{n}\": (kind: \"nothing {number} {n}\"),\n");
        let nodes: String = (0..1000).map(node).collect();
        edit(dir, format!("Graph(version: 1, nodes: {{{nodes}}}, wires: [])"));
        std::thread::sleep(Duration::from_millis(700));
    }
    let ticks = |shown: &Shown| shown.view["ticks"].as_u64().unwrap_or(0);
    onlooker.until("a view", |shown| ticks(shown) > 0);
    let from = ticks(&onlooker.shown);
    onlooker.ask(&serde_json::json!({ "mute": true }));
    onlooker.until("that it is muted", |shown| shown.view["condition"] == "muted");
    let to = ticks(&onlooker.shown);
    onlooker.until("more ticks", |shown| ticks(shown) > to + 100);
    println!("muted {} ticks after", to - from);
    signal(child.id(), "INT");
    let code = harness::live::end(&mut child);
    assert_eq!(code, 0);
    let mut rest = Vec::new();
    said.read_to_end(&mut rest).expect("what it said");
    // A pipe is full when no page of it is free; the last page but one may have room.
    assert!(rest.len() + 4096 > PIPE, "only {} bytes stood in the pipe: it was never full", rest.len());
}

#[test]
fn unwritable_report_keeps_recordings_and_summary() {
    let dir = &*shared_stage();
    edit(dir, tone("", ""));
    std::fs::create_dir(dir.join("gone")).expect("a folder");
    let mut live =
        Live::start(dir, &["g.ron", "--device", CARD, "--report", "gone/r.json", "--seconds", "2.5"]);
    live.says("plays on");
    std::fs::remove_dir_all(dir.join("gone")).expect("it was there");
    let ran = live.end();
    assert!(ran.code != 0, "{}", ran.err);
    assert!(ran.err.contains("r.json") && ran.err.contains("misses"), "{}", ran.err);
    assert!(npy(&dir.join("sent.npy")).iter().any(|x| *x != 0.0));
}

/// Once, a recording whose run was killed lay in a hidden file whose header said 0 samples.
#[test]
fn recording_of_a_killed_run_is_recovered() {
    let dir = &*shared_stage();
    let text = r#"Graph(version: 1, nodes: {"sine": (kind: "sine", params: (frequency_hz: 80.0)),
        "limiter": (kind: "limiter"), "out": (kind: "audio_out"),
        "take": (kind: "file_out", params: (file: "take.wav"))}, wires: [("sine", "limiter"),
        ("limiter", "out"), ("limiter", "take")])"#;
    std::fs::write(dir.join("g.ron"), text).expect("a graph");
    let [growing, take, other] = ["take.wav.recording", "take.wav", "take-1.wav"].map(|f| dir.join(f));
    let args = ["g.ron", "--device", CARD];
    let live = Live::start(dir, &args);
    until("it records", || std::fs::metadata(&growing).is_ok_and(|meta| meta.len() > 0));
    let recover = |what: &str| run(dir, &["recover", what]);
    assert!(recover(".").ok().err.contains("still records"));
    std::thread::sleep(Duration::from_millis(2500));
    live.stop_by("KILL");
    // A program that reads it as it is finds what its header says.
    std::fs::copy(&growing, dir.join("as_it_is.wav")).expect("a recording");
    assert!(wav(&dir.join("as_it_is.wav")).0.len() > 72_000);
    assert!(!take.exists());
    assert!(recover("take.wav.recording").ok().out.contains("take.wav"));
    let kept = wav(&take).0;
    assert!(kept.len() > 72_000 && kept.iter().any(|x| *x != 0.0), "{} samples", kept.len());
    assert!(!growing.exists());

    // The next run to that name completes what was left there, too.
    std::fs::copy(dir.join("as_it_is.wav"), &growing).expect("a recording");
    let mut next = Live::start(dir, &[&args[..], &["--seconds", "0.2"]].concat());
    let ended = next.end();
    assert!(ended.code == 0 && ended.err.contains("take-1.wav"), "{}", ended.err);
    assert!(wav(&other).0.len() > 72_000 && wav(&take).0.len() < 48_000);
    assert!(recover(".").ok().out.contains("there is no recording"));
}
