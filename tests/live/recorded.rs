//! `asperity run` with `--record`, `--out` and `--probe`: a run is played again from its files.

use std::time::Duration;

use harness::alone::beside_others;
use harness::live::{CARD, Live, graph, npy, rows, told};
use harness::{Room, wav};

use crate::socket::Onlooker;

/// Records a run of graphs/live.ron whose pointer touches twice, far apart.
fn recorded(room: &Room) -> Result<(), String> {
    room.write("g.ron", graph("live.ron", "", ""));
    let files = ["--record", "stroke.csv", "--out", "played.wav"];
    let probes = ["--probe", "motion.speed=speed.csv", "--probe", "inverse=drive.npy"];
    // A machine that holds messages back is no stall here.
    let args =
        ["g.ron", "--page", "--device", CARD, "--set", "stylus.timeout_ms=10000", "--report", "r.json"];
    let mut live = Live::start(room, &[&args[..], &files, &probes].concat());
    let mut onlooker = Onlooker::at(&live.says("the page: "));
    onlooker.until("that it plays", |shown| shown.view["condition"] == "playing");
    let mut at_ms = 0.0;
    for (touch, from_mm) in [(1.0, -30.0), (2.0, 20.0)] {
        for step in 0..100 {
            at_ms += 8.0;
            onlooker.touches(at_ms, from_mm + 0.4 * f64::from(step), 0.5, touch);
            onlooker.looks_on(Duration::from_millis(8));
        }
        at_ms += 8.0;
        onlooker.touches(at_ms, from_mm + 40.0, 0.0, touch);
        onlooker.looks_on(Duration::from_millis(300));
        at_ms += 300.0;
    }
    let said = live.stop().ok();
    for file in ["stroke.csv", "played.wav", "speed.csv", "drive.npy"] {
        assert!(said.out.contains(file), "{}", said.out);
    }
    let report = room.json("r.json");
    let lost =
        ["skipped_ticks", "lost_samples", "losses"].map(|name| report[name].as_u64().expect("a count"));
    if lost != [0; 3] { Err(format!("ticks were lost: {lost:?}")) } else { Ok(()) }
}

#[test]
fn recorded_stroke_renders_as_the_run_played() {
    let _alone = beside_others();
    told(|| {
        let room = Room::new();
        recorded(&room)?;
        let strokes = rows(&room.join("stroke.csv"));
        let numbers: Vec<f64> = strokes.iter().map(|row| row[4]).collect();
        assert!(room.text("stroke.csv").starts_with("t_s,x_mm,y_mm,z_mm,force_n,stroke\n0,"));
        assert_eq!(numbers[numbers.len() - 1] - numbers[0], 2.0, "two touches");
        let jump = strokes.windows(2).map(|w| (w[1][0] - w[0][0]).abs()).fold(0.0, f64::max);
        assert!(jump > 10.0, "the stylus was put down elsewhere: {jump} mm");

        let probes = "--probe motion.speed=again.csv --probe inverse=again.npy";
        room.run(&format!("render g.ron --input stroke.csv --out again.wav {probes} --quiet")).ok();
        let (played, rate) = wav(&room.join("played.wav"));
        let (again, again_rate) = wav(&room.join("again.wav"));
        let loudest = played.iter().fold(0.0_f32, |most, x| x.abs().max(most));
        assert!(rate == again_rate && loudest > 1e-3, "{loudest}");
        let (speed, speed_again) = (rows(&room.join("speed.csv")), rows(&room.join("again.csv")));
        assert!(speed.len().abs_diff(speed_again.len()) <= 1, "{} and {}", speed.len(), speed_again.len());
        let fastest = speed.iter().map(|row| row[0]).fold(0.0, f64::max);
        assert!((20.0..200.0).contains(&fastest), "a jump is no motion: {fastest} mm/s");
        let odd = speed.iter().zip(&speed_again).position(|(a, b)| a != b);
        assert_eq!(odd, None, "the speed differs at a tick: {:?}", odd.map(|k| (&speed[k], &speed_again[k])));
        let [drive, drive_again] = ["drive.npy", "again.npy"].map(|file| npy(&room.join(file)));
        let odd = drive.iter().zip(&drive_again).position(|(a, b)| a != b);
        assert_eq!(odd, None, "a sample differs: {:?}", odd.map(|k| (drive[k], drive_again[k])));
        // The limiter of a run knows the heat of the coil as the device had it.
        let apart = played.iter().zip(&again).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(apart < 1e-4, "{apart}");
        assert!(played.len().abs_diff(again.len()) <= 96, "{} and {}", played.len(), again.len());
        Ok(())
    });
}

#[test]
fn recordings_without_a_signal_or_format_are_refused() {
    let room = Room::new();
    let still = r#"Graph(version: 1, nodes: {"t": (kind: "sine", params: (frequency_hz: 100)),
        "p": (kind: "probe")}, wires: [("t", "p")])"#;
    room.write("still.ron", still);
    room.write("g.ron", graph("live.ron", "", ""));
    for (line, why) in [
        ("run still.ron --record s.csv", "no stylus"),
        ("run still.ron --out o.wav", "no `audio_out`"),
        ("run g.ron --record s.wav", "cannot tell the format"),
        ("run g.ron --out o.txt", "cannot tell the format"),
        ("run g.ron --out -", "--out played.wav"),
        ("run g.ron --probe motion.speed", "no `=`"),
        ("run g.ron --probe nobody.speed=s.csv", "no node `nobody`"),
        ("run g.ron --out o.wav --record o.wav", "would write the same file"),
        ("run g.ron --record s.csv --probe motion.speed=s.csv", "would write the same file"),
    ] {
        let ran = room.run(line);
        assert!(ran.code == 2 && ran.err.contains(why), "{line}: {} {}", ran.code, ran.err);
    }
    assert_eq!(harness::files(&room), ["g.ron", "still.ron"], "nothing is left behind");
}
