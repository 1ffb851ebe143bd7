//! A made-up run: a hand strokes a woven surface, with the figures of a good machine.

use std::f64::consts::TAU;

use asperity_live::view::{
    Condition, Layout, LiveLayout, Materials, NodeLayout, NodeView, ScopeLayout, SourceView, TimingView, View,
};

const TICK_HZ: f64 = 500.0;
/// Id, kind, unit of the output, us of a call, whether it sleeps while the stylus rests, value.
const NODES: [(&str, &str, &str, f64, bool, f32); 12] = [
    ("stylus", "osc_input", "mm", 1.1, false, 57.13),
    ("motion", "velocity", "mm/s", 0.4, false, 98.8),
    ("floor", "virtual_floor", "N", 0.3, false, 1.471),
    ("filter", "low_pass", "mm/s", 0.6, false, 98.8),
    ("gate", "gate", "", 0.2, false, 1.0),
    ("texture", "texture_network", "m/s^2", 212.0, true, 1.255),
    ("phase", "spsi", "m/s^2", 31.0, true, 1.255),
    ("overlap", "overlap_add", "m/s^2", 44.0, true, 1.255),
    ("level", "gain", "m/s^2", 0.5, false, 1.255),
    ("actuator", "actuator_inverse", "A", 3.2, false, 0.11),
    ("guard", "limiter", "A", 5.4, false, 0.11),
    ("card", "audio_out", "", 0.9, false, 0.0),
];
/// Node, name, value, range, unit and words of the live parameters.
type Live = (&'static str, &'static str, f64, [f64; 2], &'static str, &'static [&'static str]);
const LIVE: [Live; 7] = [
    ("floor", "stiffness", 0.5, [0.0, 2.0], "N/mm", &[]),
    ("filter", "cutoff", 20.0, [1.0, 1000.0], "Hz", &[]),
    ("gate", "open_at", 5.0, [0.0, 50.0], "mm/s", &[]),
    ("gate", "fade", 10.0, [1.0, 100.0], "ms", &[]),
    ("phase", "emission", 1.0, [0.0, 2.0], "", &["left", "centre", "right"]),
    ("level", "gain", 1.0, [0.0, 4.0], "", &[]),
    ("guard", "slew", 1.0, [0.0, 1.0], "", &["off", "on"]),
];
const SCOPES: [(&str, &str, u32); 4] = [
    ("speed", "mm/s", 500),
    ("force", "N", 500),
    ("acceleration", "m/s^2", 48_000),
    ("current", "A", 48_000),
];

fn texts(all: &[&str]) -> Vec<String> {
    all.iter().map(|text| (*text).to_owned()).collect()
}

/// Layout of the run.
pub(super) fn layout() -> Layout {
    let live = |&(_, name, value, [least, most], unit, words): &Live| LiveLayout {
        name: name.into(),
        value,
        least,
        most,
        unit: unit.into(),
        words: texts(words),
        ..LiveLayout::default()
    };
    let nodes = NODES.map(|(id, kind, unit, ..)| NodeLayout {
        id: id.into(),
        kind: kind.into(),
        outputs: vec![["out".into(), unit.into()]],
        live: LIVE.iter().filter(|live| live.0 == id).map(live).collect(),
        ..NodeLayout::default()
    });
    let names = texts(&["sandpaper P40", "canvas", "oak", "denim", "felt", "sandpaper 100"]);
    Layout {
        file: "graphs/live.ron".into(),
        tick_hz: TICK_HZ as u32,
        audio_hz: 48_000,
        nodes: nodes.to_vec(),
        scopes: SCOPES
            .map(|(name, unit, rate_hz)| ScopeLayout { name: name.into(), unit: unit.into(), rate_hz })
            .to_vec(),
        materials: vec![Materials { node: "texture".into(), chosen: "canvas".into(), names }],
        ..Layout::default()
    }
}

/// Figures at `seconds`, with the samples of the last `since` seconds.
pub(super) fn view(seconds: f64, since: f64) -> View {
    let ticks = (seconds * TICK_HZ) as u64;
    let nodes = NODES.map(|(id, _, _, us, sleeps, value)| {
        let calls = if sleeps { ticks * 13 / 16 } else { ticks };
        let last_fault = if id == "phase" { "not a number in spectrum".into() } else { String::new() };
        NodeView {
            us,
            max_us: us * 2.7 + 3.0,
            calls,
            slept: ticks - calls,
            faults: u64::from(id == "phase"),
            last_fault,
            values: vec![value],
            ..NodeView::default()
        }
    });
    let scopes = SCOPES.map(|(name, _, rate)| {
        let [from, to] = [seconds - since, seconds].map(|s| (s.max(0.0) * f64::from(rate)) as u64);
        (from..to).map(|k| signal(name, k as f64 / f64::from(rate)) as f32).collect()
    });
    View {
        condition: Condition::Playing,
        clock: "paced".into(),
        device: "USB Audio, channel 3".into(),
        period_frames: 256,
        ticks,
        seconds,
        timing: timing(ticks),
        underruns: 2,
        lost_samples: 431,
        xruns: 1,
        faults: 1,
        nodes: nodes.to_vec(),
        sources: vec![SourceView {
            id: "stylus".into(),
            rate_hz: 997.0,
            age_ms: 1.1,
            delay_ms: 2.1,
            stalls: 1,
            stalled: false,
            samples: ticks * 2,
        }],
        scopes: scopes.to_vec(),
        latency_ms: [("input", 2.1), ("tick", 2.0), ("resampler", 0.7), ("ring", 2.7), ("driver", 5.3)]
            .map(|(what, ms)| (what.into(), ms))
            .to_vec(),
        peak: 0.28,
        ..View::default()
    }
}

/// Lateness about 14 us with a tail, and computing about 300 us.
fn timing(ticks: u64) -> TimingView {
    TimingView {
        deadline_us: 2000.0,
        misses: ticks / 9000,
        woke_late: ticks / 9500,
        late_us: [14.2, 24.8, 231.0, 3120.0],
        compute_us: [301.0, 412.0, 655.0, 1180.0],
        recovery_us: [0.0; 4],
        edges_us: (0..16).map(|k| f64::from(1 << k)).collect(),
        late_counts: vec![0, 0, 20, 400, ticks, 9000, 900, 90, 20, 9, 7, 6, 4, 0, 0, 0],
        compute_counts: vec![0, 0, 0, 0, 0, 0, 30, 2000, ticks, ticks / 2, 100, 9, 0, 0, 0, 0],
    }
}

/// A stroke to and fro, with a rest after it.
fn signal(name: &str, time: f64) -> f64 {
    let t = time % 8.0;
    let stroke = if t < 6.5 { (TAU * t / 2.6).sin().abs() * (1.0 - (t / 6.5).powi(8)) } else { 0.0 };
    let weave = (TAU * 83.0 * time).sin() + 0.6 * (TAU * 211.0 * time).sin();
    match name {
        "speed" => 120.0 * stroke,
        "force" => 1.1 + 0.35 * (time * 1.3).sin(),
        "acceleration" => 4.0 * stroke * weave,
        _ => 0.06 * stroke * weave,
    }
}
