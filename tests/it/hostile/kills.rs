//! Runs that are killed, and disks and tables that are full.

use std::fs;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use harness::{Room, asperity, graphs, root};

use super::judge::{Ended, Seed, Tally, ends, times, two_at_a_time};

const LONGEST: Duration = Duration::from_secs(900);

fn graph() -> String {
    graphs("heravi2024.ron").display().to_string()
}

/// A render with three files of one run.
fn render(dir: &Room, seed: u32) -> Command {
    let mut program = asperity(dir);
    program.args(["render", &graph(), "--seconds", "1", "--set", &format!("seed={seed}"), "--out", "o.wav"]);
    program.args(["--probe", "texture=t.npy", "--probe", "limiter=v.npy"]);
    program
}

fn outputs(dir: &Room) -> Vec<Option<Vec<u8>>> {
    ["o.wav", "t.npy", "v.npy"].map(|name| fs::read(dir.join(name)).ok()).into()
}

fn quietly(command: &mut Command) -> Child {
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("it starts")
}

#[test]
fn killed_render_leaves_all_old_files_or_all_new_ones() {
    let tally = Tally::new("killed renders");
    let made = |seed: u32| {
        let dir = Room::new();
        assert!(ends(render(&dir, seed), LONGEST).expect("an end").status.success());
        outputs(&dir)
    };
    let (old, new) = (made(1), made(2));
    assert!(old != new && old.iter().all(Option::is_some), "the seed is heard");
    let began = std::time::Instant::now();
    drop(made(3));
    let lasts = began.elapsed();
    two_at_a_time(12 * times(), |number| {
        let dir = Room::new();
        for (name, bytes) in ["o.wav", "t.npy", "v.npy"].iter().zip(&old) {
            dir.write(name, bytes.as_ref().expect("bytes"));
        }
        let mut command = render(&dir, 2);
        let mut child = quietly(&mut command);
        // Most of them near the end, where files get their names.
        let part = 0.5 + 0.7 * (Seed(number).next() % 1000) as f64 / 1000.0;
        std::thread::sleep(lasts.mul_f64(part));
        let _ = child.kill();
        let _ = child.wait();
        // Whoever writes next into the folder completes renames that were begun.
        let mut next = asperity(&dir);
        next.args(["graph", &graph(), "--svg", "g.svg"]);
        let found = ends(next, LONGEST).and_then(|ended| {
            let found = outputs(&dir);
            if found != old && found != new {
                return Err(format!("old and new are mixed: {:?}", dir.files()));
            }
            // Whoever writes the same files next removes what a kill before the renames left of them.
            ends(render(&dir, 2), LONGEST)?;
            if dir.files().len() == 4 {
                Ok((0, ended))
            } else {
                Err(format!("more is left: {:?}", dir.files()))
            }
        });
        tally.count(&format!("{number}"), dir, &command, found);
    });
    tally.done();
}

#[test]
fn killed_recording_is_recovered() {
    let tally = Tally::new("killed recordings");
    let text = r#"Graph(version: 1, nodes: {"wave": (kind: "sine"), "guard": (kind: "limiter"),
       "out": (kind: "audio_out"),
            "ear": (kind: "file_out", params: (file: "ear.wav"))},
        wires: [("wave", "guard"), ("guard", "out"), ("guard", "ear")])"#;
    two_at_a_time(2 * times(), |number| {
        let dir = Room::new();
        dir.write("g.ron", text);
        let mut command = asperity(&dir);
        command.args(["run", "g.ron", "--device", "simulated:frames=256"]);
        let mut child = quietly(&mut command);
        let growing = dir.join("ear.wav.recording");
        let long = || fs::metadata(&growing).is_ok_and(|m| m.len() > 100_000);
        harness::live::until("a recording", long);
        std::thread::sleep(Duration::from_millis(Seed(number).next() % 1500));
        let _ = child.kill();
        let _ = child.wait();
        let mut next = asperity(&dir);
        next.arg("recover");
        let found = ends(next, LONGEST).and_then(|ended| {
            let samples = if dir.join("ear.wav").exists() { dir.wav("ear.wav").0.len() } else { 0 };
            if samples > 20_000 && dir.files() == ["ear.wav", "g.ron"] {
                Ok((0, ended))
            } else {
                Err(format!("{samples} samples: {} {:?}", ended.said, dir.files()))
            }
        });
        tally.count(&format!("{number}"), dir, &command, found);
    });
    tally.done();
}

#[test]
fn render_that_is_told_to_stop_keeps_whole_files() {
    let tally = Tally::new("stopped renders");
    two_at_a_time(8 * times(), |number| {
        let dir = Room::new();
        let mut command = asperity(&dir);
        command.args(["render", &graph(), "--seconds", "500", "--out", "o.wav"]);
        let signal = ["-INT", "-TERM"][number as usize % 2];
        let child = quietly(&mut command);
        std::thread::sleep(Duration::from_millis(50 + Seed(number).next() % 900));
        let id = child.id().to_string();
        let _ = Command::new("kill").args([signal, &id]).status();
        let found = waited(child).and_then(|code| {
            let left = dir.files();
            // Before it listens a signal ends it, and nothing is there.
            let whole = left.is_empty() || (left == ["o.wav"] && !dir.wav("o.wav").0.is_empty());
            if whole { Ok((0, code)) } else { Err(format!("{signal}: it left {left:?}")) }
        });
        tally.count(&format!("{number}"), dir, &command, found);
    });
    tally.done();
}

fn waited(mut child: Child) -> Result<Ended, String> {
    let began = std::time::Instant::now();
    while began.elapsed() < LONGEST {
        if let Ok(Some(status)) = child.try_wait() {
            return Ok(Ended { status, said: String::new(), took: began.elapsed(), peak_mib: 0 });
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let _ = child.kill();
    let _ = child.wait();
    Err("it does not stop".into())
}

#[test]
fn program_short_of_files_or_disk_says_so_and_leaves_nothing() {
    let tally = Tally::new("short of files or disk");
    let limits: Vec<String> = (4..=16)
        .map(|n| format!("ulimit -n {n}"))
        .chain((0..8).map(|n| format!("ulimit -f {}", n * 8)))
        .collect();
    let jobs = ["--out o.wav --report r.json", "--probe motion.speed=t.npy --plot p.svg"];
    for limit in &limits {
        for job in jobs {
            let dir = Room::new();
            let (program, graph) = (env!("CARGO_BIN_EXE_asperity"), root().join("tests/data/small.ron"));
            let line = format!("render {} --seconds 0.5 {job}", graph.display());
            let mut command = Command::new("bash");
            command.args(["-c", &format!("{limit}; exec {program} {line} \"$@\""), "bash"]);
            command.env("ASPERITY_STATE", "").env("XDG_STATE_HOME", dir.join("state")).current_dir(&dir);
            // Whether the list of what was made can be written is no matter.
            fs::create_dir_all(dir.join("state/asperity")).expect("a folder");
            dir.write("state/asperity/made", "");
            tally.case(limit, dir, command, &["state/asperity/made"]);
        }
    }
    tally.done();
}
