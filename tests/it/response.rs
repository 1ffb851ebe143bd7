//! Response lag: how long the output takes to follow a change of speed. It is another figure than latency.

use harness::Room;

/// Half a period of the steps, in seconds.
const HALF_S: f64 = 0.4;
const PERIODS: usize = 60;

/// A stylus pressed to the surface whose speed along x steps up and down again.
fn steps(slow_mm_s: f64, fast_mm_s: f64) -> String {
    let mut csv = String::from("t_s,x_mm,y_mm,z_mm\n");
    let mut x = 0.0;
    for k in 0..(2.0 * HALF_S * PERIODS as f64 * 500.0) as usize {
        let t = k as f64 / 500.0;
        csv.push_str(&format!("{t},{x},0,-2\n"));
        let fast = (t / HALF_S) as usize % 2 == 1;
        x += if fast { fast_mm_s } else { slow_mm_s } / 500.0;
    }
    csv
}

/// Time in ms after a step up at which the mean level over all steps is half way up, linearly between
/// samples.
fn half_way_ms(signal: &[f32], rate_hz: usize) -> f64 {
    let half = (HALF_S * rate_hz as f64) as usize;
    let mut power = vec![0.0_f64; 2 * half];
    for period in signal.chunks_exact(2 * half).skip(2) {
        for (p, x) in power.iter_mut().zip(period) {
            *p += f64::from(*x).powi(2);
        }
    }
    // Over 20 ms, centred.
    let width = rate_hz / 50;
    let level = |at: usize| (power[at - width / 2..at + width / 2].iter().sum::<f64>() / width as f64).sqrt();
    let low = level(half - width);
    let high = level(2 * half - width);
    assert!(high > 1.5 * low, "the step must show: {low} to {high}");
    let middle = 0.5 * (low + high);
    let at = (half..2 * half - width).find(|&i| level(i) >= middle).expect("it comes up");
    (at - half) as f64 * 1e3 / rate_hz as f64
}

#[test]
fn the_chain_answers_a_step_of_speed_as_late_as_its_parts_say() {
    let dir = Room::new();
    dir.write("t.csv", steps(40.0, 120.0));
    // A material without a line, whose level follows speed smoothly.
    dir.run(
        "render graphs/heravi2024.ron --input t.csv --set 'texture.material=sandpaper P50' \
         --probe synthesis=a.npy --probe 'audio rate=b.npy'",
    )
    .ok();
    let (synthesis, audio) = (half_way_ms(&dir.npy("a.npy"), 2500), half_way_ms(&dir.npy("b.npy"), 48_000));
    println!("response lag: {synthesis:.1} ms at the synthesis, {audio:.1} ms at the audio rate");
    // Half of a 0.1 s window and the 20 Hz filter's 11 ms, and what the history of 20 ms adds or the model's
    // non-linear rise takes away.
    assert!((50.0..80.0).contains(&synthesis), "{synthesis} ms");
    assert!((2.0..10.0).contains(&(audio - synthesis)), "the resampler's 5.6 ms: {synthesis} to {audio} ms");
}

#[test]
fn recommended_chain_is_half_way_in_10_ms_and_there_in_20() {
    let figures = Room::new().run("latency graphs/texture.ron --json").json();
    let lag: Vec<f64> =
        serde_json::from_value(figures["graphs"][0]["latency"]["response_lag_ms"].clone()).unwrap();
    println!("10, 50 and 90 % after {lag:?} ms");
    assert!(lag[1] <= 10.0 && lag[2] <= 20.0, "{lag:?} ms");
}

/// A setting of no graph is refused before anything is measured.
#[test]
fn setting_changes_only_its_graph_and_unknown_is_refused() {
    let dir = Room::new();
    let retrieving = harness::retrieving().display().to_string();
    let latency = |graphs: &str, more: &str| dir.run(&format!("latency {graphs} {retrieving} {more}"));
    let both = latency("graphs/heravi2024.ron", "--set phase.emission=-25 --json");
    assert!(both.err.contains("heravi2024.ron has no such parameter"), "{}", both.err);
    assert_eq!(both.err.matches("note:").count(), 1, "{}", both.err);
    let figures = both.json();
    let half = |n: usize| figures["graphs"][n]["latency"]["response_lag_ms"][1].as_f64().unwrap();
    println!("{:.1} ms with the setting, {:.1} ms where there is none", half(1), half(0));
    assert!(half(1) < 40.0 && half(0) > 55.0, "{figures}");
    // A tone beside a stylus that it does not follow. That is told after it was measured: if it is measured
    // at all.
    dir.write(
        "level.ron",
        r#"Graph(version: 1, nodes: {
        "stylus": (kind: "pointer_input"), "seen": (kind: "probe", params: (file: "seen.csv")),
        "sine": (kind: "sine"), "limiter": (kind: "limiter"), "out": (kind: "audio_out"),
    }, wires: [("stylus.position", "seen"), ("sine", "limiter"), ("limiter", "out")])"#,
    );
    let alone = dir.run("latency level.ron");
    assert!(alone.code != 0 && alone.err.contains("does not rise with speed"), "{}", alone.err);
    for (set, says) in
        [("phase.emision=-25", "emision"), ("fase.emission=-25", "fase"), ("phase.emission=1e9", "emission")]
    {
        let none = latency("level.ron", &format!("--set {set}"));
        assert!(none.code != 0 && !none.err.contains("does not rise"), "{set}: {}", none.err);
        assert!(none.err.contains(says), "{set}: {}", none.err);
    }
}

/// Latency was told three ways: "0.00 ms source to sink", "-39.0 to 0.0" and 7.4 ms.
#[test]
fn latency_is_one_line_in_every_command() {
    let dir = Room::new();
    let graph = harness::graphs("texture.ron").display().to_string();
    let rendered = dir.run(&format!("render {graph} --report render.json")).ok();
    let ran = dir.run(&format!("run {graph} --device simulated:frames=256 --seconds 0.2 --report run.json"));
    let ran = ran.ok();
    let told = dir.run(&format!("latency {graph} --json")).json();
    let checked = dir.run(&format!("check {graph} --json")).json();
    let line = told["graphs"][0]["latency"]["line"].as_str().unwrap().to_owned();
    println!("{line}");
    let lag = told["graphs"][0]["latency"]["response_lag_ms"][1].as_f64().unwrap();
    let declared = "declared latency 1.0 ms on the slowest path, `stylus` to `out` by `audio rate`";
    assert_eq!(line, format!("response lag {lag:.0} ms from the hand; {declared}"));
    for text in [
        rendered.out,
        ran.out,
        dir.run(&format!("check {graph}")).ok().out,
        dir.run(&format!("latency {graph}")).ok().out,
    ] {
        assert_eq!(text.matches(&line).count(), 1, "{text}");
        assert!(!text.contains("source to sink") && !text.contains(" to 0.0000 ms"), "{text}");
    }
    // Reports hold the numbers in one place.
    for report in [dir.json("render.json"), dir.json("run.json"), checked] {
        assert_eq!(report["latency"], told["graphs"][0]["latency"]);
    }
}

#[test]
fn graph_without_a_hand_says_why_it_has_no_lag() {
    let dir = Room::new();
    dir.write(
        "g.ron",
        r#"Graph(version: 1, nodes: {"sine": (kind: "sine"), "late": (kind: "delay", params: (delay_ms: 4.0)),
        "limiter": (kind: "limiter"), "out": (kind: "audio_out")},
        wires: [("sine", "late"), ("late", "limiter"), ("limiter", "out")])"#,
    );
    let says = "response lag not measured (nothing in this graph moves a stylus); declared latency 4.0 ms on \
                the slowest path, `sine` to `out` by `late`";
    dir.run("check g.ron").ok().says(&[says]);
    dir.run("render g.ron --seconds 0.1").ok().says(&[says]);
}
