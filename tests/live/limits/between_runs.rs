//! Runs that follow each other, and runs at the same time.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use harness::alone::beside_others;
use harness::asperity;
use harness::live::{Live, npy, until};

use crate::coil::Coil;

const CARD: &str = "simulated:frames=96,loopback=1";
const RATE: u32 = 48_000;

/// A tone at the resonance that the limiter must hold down, and what the card's input hears of it.
const TONE: &str = r#"Graph(version: 1, nodes: {
    "tone": (kind: "sine", params: (frequency_hz: 65, amplitude: 1000)), "limiter": (kind: "limiter"),
    "out": (kind: "audio_out"), "card": (kind: "audio_in", params: (unit: "A")),
    "heard": (kind: "file_out", params: (file: "heard.npy")),
}, wires: [("tone", "limiter"), ("limiter", "out"), ("card", "heard")])"#;

fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("tone.ron"), TONE).unwrap();
    dir
}

/// A run that remembers its coils in the folder.
fn start(dir: &Path, more: &[&str]) -> Live {
    start_beside(dir, dir, more)
}

/// A run in a folder that remembers its coils where another one does.
fn start_beside(other: &Path, dir: &Path, more: &[&str]) -> Live {
    let mut command = asperity(dir);
    command.env("ASPERITY_STATE", other.join("state"));
    command.args(["run", "tone.ron", "--device", CARD]).args(more);
    Live::of(command)
}

/// The files of its seats.
fn seats(dir: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(dir.join("state")).into_iter().flatten().map(|e| e.unwrap().path()).collect()
}

fn seat(dir: &Path, number: &str) -> String {
    let file = seats(dir).into_iter().find(|file| file.to_string_lossy().ends_with(number));
    std::fs::read_to_string(file.unwrap()).unwrap()
}

fn heat(dir: &Path) -> f64 {
    let record: serde_json::Value = serde_json::from_str(&seat(dir, ".1.1")).unwrap();
    record["heat_a2"].as_f64().unwrap()
}

#[test]
fn three_runs_in_a_row_heat_the_coil_no_more_than_one() {
    let _alone = beside_others();
    let dir = folder();
    let mut coil = Coil::new(RATE);
    for n in 0..3 {
        let began = Instant::now();
        let ran = start(dir.path(), &["--seconds", "3"]).end().ok();
        assert!(!ran.err.contains("at its rating"), "{}", ran.err);
        let heard = npy(&dir.path().join("heard.npy"));
        let played = heard.len() as f64 / f64::from(RATE);
        // It lay still for no longer than the run took beside playing.
        coil.play(heard.iter().map(|x| f64::from(*x)));
        coil.rest((began.elapsed().as_secs_f64() - played).max(0.0));
        coil.used.assert_within(&format!("run {n}"));
    }
    assert!(coil.used.rms > 0.8, "{:?}", coil.used);
    let kept = heat(dir.path());
    assert!(kept > 0.0 && kept < 0.1478f64.powi(2), "{kept}");
}

#[test]
fn killed_run_leaves_a_coil_at_its_rating() {
    let _alone = beside_others();
    let dir = folder();
    let run = start(dir.path(), &[]);
    until("the run to take down its coil", || !seats(dir.path()).is_empty());
    std::thread::sleep(Duration::from_millis(300));
    run.stop_by("KILL");
    assert!(seat(dir.path(), ".1.1").contains("\"running\":true"));
    let said = || start(dir.path(), &["--seconds", "0.3"]).end().ok().err;
    let first = said();
    assert!(first.contains("channel 1 counts as being at its rating"), "{first}");
    // And it cools: the next run knows how warm it is.
    let next = said();
    assert!(!next.contains("at its rating"), "{next}");
}

#[test]
fn record_that_is_damaged_or_late_leaves_a_coil_at_its_rating() {
    let _alone = beside_others();
    let dir = folder();
    let said = || start(dir.path(), &["--seconds", "0.3"]).end().ok().err;
    said();
    // As after a clock that went back.
    let late = |text: &str| {
        let mut record: serde_json::Value = serde_json::from_str(text).unwrap();
        record["at_s"] = 99_999_999_999_u64.into();
        record.to_string().into_bytes()
    };
    let damaged = |to: &'static [u8]| move |_: &str| to.to_vec();
    type Damage = Box<dyn Fn(&str) -> Vec<u8>>;
    let ways: [(Damage, &str); 4] = [
        (Box::new(late), "clock"),
        (Box::new(damaged(b"")), ""),
        (Box::new(damaged(b"{\"heat_a2\":0.0")), ""),
        (Box::new(damaged(b"\xff\xfe\x00")), ""),
    ];
    for (n, (damage, why)) in ways.iter().enumerate() {
        for path in seats(dir.path()) {
            std::fs::write(&path, damage(&std::fs::read_to_string(&path).unwrap())).unwrap();
        }
        let said = said();
        assert!(said.contains("at its rating") && said.contains(why), "{n}: {said}");
    }
}

#[test]
fn second_run_on_an_actuator_is_refused_by_name() {
    let _alone = beside_others();
    let dir = folder();
    let first = start(dir.path(), &[]);
    until("the first run to take its seats", || seats(dir.path()).len() > 1);
    std::thread::sleep(Duration::from_millis(300));
    let other = folder();
    for more in [&["--seconds", "1"][..], &["--seconds", "1", "--share"]] {
        let ran = start_beside(dir.path(), other.path(), more).end();
        assert_eq!(ran.code, 2, "{}", ran.err);
        let process = format!("process {}", first.id());
        assert!(ran.err.contains(&process) && ran.err.contains("channel 1"), "{}", ran.err);
    }
    // The seat is free when its process is gone, however that ended.
    first.stop_by("KILL");
    start_beside(dir.path(), other.path(), &["--seconds", "0.3"]).end().ok();
}

#[test]
fn two_runs_that_share_have_half_each() {
    let _alone = beside_others();
    let dir = folder();
    let mut first = start(dir.path(), &["--share", "--seconds", "4"]);
    let other = folder();
    start_beside(dir.path(), other.path(), &["--share", "--seconds", "3"]).end().ok();
    first.end().ok();
    let heard = [dir.path(), other.path()].map(|dir| npy(&dir.join("heard.npy")));
    for heard in &heard {
        let used = Coil::new(RATE).play(heard.iter().map(|x| f64::from(*x))).used;
        assert!(used.rms <= 0.505 && used.stroke <= 0.5 && used.peak <= 0.5, "{used:?}");
        assert!(used.rms > 0.3, "{used:?}");
    }
    // The worst that both can do together.
    let sum = heard[0].iter().zip(&heard[1]).map(|(a, b)| f64::from(a + b));
    Coil::new(RATE).play(sum).used.assert_within("both together");
}

#[test]
fn samples_cut_at_full_scale_are_told_by_run() {
    let _alone = beside_others();
    let dir = folder();
    let text = TONE.replace("\"audio_out\"", "\"audio_out\", params: (volts_at_full_scale: 0.01)");
    std::fs::write(dir.path().join("tone.ron"), text).unwrap();
    let said = start(dir.path(), &["--seconds", "0.5"]).end().ok().err;
    assert!(said.contains("samples were cut at the card's full scale"), "{said}");
}
