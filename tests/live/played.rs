//! The program as it plays in real time, and what it plays laid beside the same graph rendered offline.

use std::path::Path;

use harness::live::Live;
use harness::{json, run};

/// Seconds from silence to full at the start of a run.
pub(crate) const START_S: f64 = 2.0;
/// When the click is, in ticks.
const CLICK_TICK: u64 = 1_500;

/// Writes the graph: a sweep of two minutes and a sine on channel 1, whose every stretch is like no other,
/// and a click on channel 2.
pub(crate) fn write_graph(dir: &Path, rate_hz: u32) {
    let click_s = CLICK_TICK as f64 / 500.0;
    let rows = format!("0,0,0,0\n{:.3},0,0,0\n{click_s:.3},1,0,0\n1000,1,0,0\n", click_s - 0.002);
    std::fs::write(dir.join("hand.csv"), format!("t_s,x_mm,y_mm,z_mm\n{rows}")).unwrap();
    let graph = format!(
        r#"Graph(
    version: 1, tick_hz: 500, audio_hz: {rate_hz},
    nodes: {{
        "sweep": (kind: "sweep", params: (from_hz: 60, to_hz: 200, seconds: 120, amplitude: 0.05,
        before_s: 0)),
        "sine": (kind: "sine", params: (frequency_hz: 173.20508, amplitude: 0.03)),
        "both": (kind: "mix", params: (inputs: 2)),
        "limiter": (kind: "limiter", params: (profile: "hapcoil_one", handle_mass_g: 100)),
        "out": (kind: "audio_out"),
        "hand": (kind: "trajectory", params: (file: "hand.csv", interpolation: linear, max_gap_s: 2000)),
        "velocity": (kind: "velocity", params: (cutoff_hz: 0)),
        "click": (kind: "impulse", params: (threshold: 100, amplitude: 0.1)),
        "limiter2": (kind: "limiter", params: (profile: "hapcoil_one", handle_mass_g: 100)),
        "out2": (kind: "audio_out"),
    }},
    wires: [
        ("sweep", "both.in1"), ("sine", "both.in2"), ("both", "limiter"), ("limiter", "out"),
        ("hand.position", "velocity.position"), ("velocity.speed", "click"), ("click", "limiter2"),
        ("limiter2", "out2"),
    ],
)
"#
    );
    std::fs::write(dir.join("live.ron"), graph).unwrap();
}

/// That graph, rendered offline.
pub(crate) fn offline(dir: &Path, ticks: u64) -> Vec<[f32; 2]> {
    let seconds = (ticks as f64 / 500.0 + 1.0).to_string();
    run(dir, &["render", "live.ron", "--seconds", &seconds, "--out", "offline.wav", "--quiet"]).ok();
    let (samples, _) = harness::wav(&dir.join("offline.wav"));
    samples.chunks_exact(2).map(|frame| [frame[0], frame[1]]).collect()
}

/// `asperity run` of the graph, with a report. A call may take as long as it likes: a machine that is
/// busy is no fault of a node.
pub(crate) fn play(dir: &Path, args: &[&str]) -> Live {
    let all = ["live.ron", "--report", "report.json", "--limit-us", "10000000"];
    Live::start(dir, &[&all[..], args].concat())
}

/// The report that a run left.
pub(crate) fn report(dir: &Path) -> serde_json::Value {
    json(&dir.join("report.json"))
}

/// Lays what was heard of a run of so many seconds beside the same graph rendered offline. The first two
/// seconds are a ramp; from there on every frame is the rendered one, bit for bit, until the level falls to
/// silence within 20 ms. On a busy machine the server leaves samples out, which the report counts: then only
/// the frames before are compared.
pub(crate) fn is_as_rendered(
    dir: &Path,
    heard: &[[f32; 2]],
    rate_hz: u32,
    least_s: f64,
) -> Result<(), String> {
    let (report, rate) = (report(dir), f64::from(rate_hz));
    let count = |name: &str| report[name].as_u64().expect("a count");
    let rendered = offline(dir, count("ticks"));
    let begin = heard.iter().position(|frame| frame[0] != 0.0).ok_or("nothing is heard")?;
    let early = &heard[begin..begin + rate_hz as usize / 10];
    assert!(early.iter().all(|frame| frame[0].abs() < 1e-2), "it does not begin softly");
    let up = begin + (START_S * rate) as usize;
    let window = &heard[up..up + rate_hz as usize / 100];
    let place = rendered.windows(window.len()).position(|frames| frames == window);
    let same = place
        .map_or(0, |place| heard[up..].iter().zip(&rendered[place..]).take_while(|(a, b)| a == b).count());
    let whole = same as f64 > (least_s - START_S) * rate;
    println!("{same} frames are the rendered ones");
    if ["underruns", "xruns", "losses"].map(count).iter().sum::<u64>() > 0 {
        return if same > rate_hz as usize / 4 { Ok(()) } else { Err(format!("{same} frames, {report}")) };
    }
    assert!(whole, "only {same} frames are the rendered ones: {report}");
    let (end, place) = (up + same, place.unwrap_or(0) + same);
    let clicked = place as u64 > CLICK_TICK * u64::from(rate_hz) / 500;
    assert!(clicked, "the click of channel 2 is not among them");
    let sounds = heard[end..].iter().rposition(|frame| frame[0] != 0.0).map_or(0, |at| at + 1);
    assert!((5.0..20.0).contains(&(sounds as f64 * 1e3 / rate)), "it falls for {sounds} samples");
    let gains =
        heard[end..end + sounds].iter().zip(&rendered[place..]).filter(|(_, full)| full[0].abs() > 0.02);
    let gains: Vec<f32> = gains.map(|(x, full)| x[0] / full[0]).collect();
    assert!(gains.windows(2).all(|w| w[1] > -5e-2 && w[1] < w[0] + 5e-2), "it does not only fall: {gains:?}");
    assert_no_clicks(heard, rate_hz);
    Ok(())
}

/// No sample may be farther from the one before than the graph itself and the fades go: nothing clicks.
pub(crate) fn assert_no_clicks(heard: &[[f32; 2]], rate_hz: u32) {
    let most = 3e-3 * 48_000.0 / rate_hz as f32;
    for (at, pair) in heard.windows(2).enumerate() {
        let (from, to) = (pair[0][0], pair[1][0]);
        assert!((to - from).abs() < most, "a click at sample {at}: {from} to {to}");
    }
}
