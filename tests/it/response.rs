//! Response lag: how long the output takes to follow a change of speed. It is another figure than latency.

use harness::{graphs, run};

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
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("t.csv"), steps(40.0, 120.0)).unwrap();
    let graph = graphs("heravi2024.ron").display().to_string();
    // A material without a line, whose level follows speed smoothly.
    let material = "texture.material=sandpaper P50";
    let args = [
        "render",
        &graph,
        "--input",
        "t.csv",
        "--set",
        material,
        "--probe",
        "synthesis=a.npy",
        "--probe",
        "audio rate=b.npy",
    ];
    run(dir.path(), &args).ok();
    let read = |n: &str| asperity_accuracy::npy::read(dir.path().join(n)).unwrap().values.into_f32();
    let synthesis = half_way_ms(&read("a.npy"), 2500);
    let audio = half_way_ms(&read("b.npy"), 48_000);
    println!("response lag: {synthesis:.1} ms at the synthesis, {audio:.1} ms at the audio rate");
    // Half of a 0.1 s window and the 20 Hz filter's 11 ms, and what the history of 20 ms adds or the model's
    // non-linear rise takes away.
    assert!((50.0..80.0).contains(&synthesis), "{synthesis} ms");
    assert!((2.0..10.0).contains(&(audio - synthesis)), "the resampler's 5.6 ms: {synthesis} to {audio} ms");
}

#[test]
fn recommended_chain_is_half_way_in_10_ms_and_there_in_20() {
    let dir = tempfile::tempdir().unwrap();
    let graph = graphs("texture.ron").display().to_string();
    let asked = run(dir.path(), &["latency", &graph, "--json"]);
    let figures: serde_json::Value = serde_json::from_str(&asked.ok().out).unwrap();
    let lag: Vec<f64> = serde_json::from_value(figures["graphs"][0]["lag_ms"].clone()).unwrap();
    println!("10, 50 and 90 % after {lag:?} ms");
    assert!(lag[1] <= 10.0 && lag[2] <= 20.0, "{lag:?} ms");
}

/// A setting of no graph is refused before anything is measured.
#[test]
fn setting_changes_only_its_graph_and_unknown_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let [texture, seed] =
        [harness::retrieving(), graphs("heravi2024.ron")].map(|path| path.display().to_string());
    let both = run(dir.path(), &["latency", &texture, &seed, "--set", "phase.emission=-25", "--json"]).ok();
    assert!(both.err.contains("heravi2024.ron has no such parameter"), "{}", both.err);
    assert_eq!(both.err.matches("note:").count(), 1, "{}", both.err);
    let figures: serde_json::Value = serde_json::from_str(&both.out).unwrap();
    let half = |n: usize| figures["graphs"][n]["lag_ms"][1].as_f64().unwrap();
    println!("{:.1} ms with the setting, {:.1} ms where there is none", half(0), half(1));
    assert!(half(0) < 40.0 && half(1) > 55.0, "{figures}");
    // A graph that has no rise of level with speed is told after it was measured: it is, if it is measured
    // at all.
    let level = graph_without_a_rise(dir.path());
    let alone = run(dir.path(), &["latency", &level]);
    assert!(alone.code != 0 && alone.err.contains("does not rise with speed"), "{}", alone.err);
    for set in ["phase.emision=-25", "fase.emission=-25", "phase.emission=1e9"] {
        let none = run(dir.path(), &["latency", &level, &texture, "--set", set]);
        assert!(none.code != 0 && !none.err.contains("does not rise"), "{set}: {}", none.err);
        assert!(none.err.contains("emision") || none.err.contains("fase") || none.err.contains("emission"));
    }
}

/// A tone beside a stylus that it does not follow.
fn graph_without_a_rise(dir: &std::path::Path) -> String {
    let text = r#"Graph(version: 1, nodes: {
        "stylus": (kind: "pointer_input"), "seen": (kind: "probe", params: (file: "seen.csv")),
        "sine": (kind: "sine"), "limiter": (kind: "limiter"), "out": (kind: "audio_out"),
    }, wires: [("stylus.position", "seen"), ("sine", "limiter"), ("limiter", "out")])"#;
    std::fs::write(dir.join("level.ron"), text).unwrap();
    "level.ron".to_owned()
}
