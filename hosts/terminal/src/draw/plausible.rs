//! A made-up run: a hand strokes a woven surface, with the figures of a good machine.

use std::f64::consts::TAU;

use asperity_live::view::{
    Condition, Layout, LiveLayout, Materials, NodeLayout, NodeView, ScopeLayout, SourceView, TimingView, View,
};

const TICK_HZ: f64 = 500.0;
/// Id, kind, first output and its unit, us of a call, whether it sleeps while the stylus rests.
type Made = (&'static str, &'static str, &'static str, &'static str, f64, bool);
const NODES: [Made; 12] = [
    ("stylus", "osc_input", "position", "mm", 1.1, false),
    ("motion", "velocity", "speed", "mm/s", 0.4, false),
    ("floor", "virtual_floor", "force", "N", 0.3, false),
    ("filter", "low_pass", "speed", "mm/s", 0.6, false),
    ("gate", "gate", "active", "", 0.2, false),
    ("texture", "texture_network", "magnitudes", "m/s^2", 212.0, true),
    ("phase", "spsi", "spectrum", "m/s^2", 31.0, true),
    ("overlap", "overlap_add", "audio", "m/s^2", 44.0, true),
    ("level", "gain", "audio", "m/s^2", 0.5, false),
    ("actuator", "actuator_inverse", "current", "A", 3.2, false),
    ("guard", "limiter", "current", "A", 5.4, false),
    ("card", "audio_out", "", "", 0.9, false),
];

/// Layout of the run.
pub(super) fn layout() -> Layout {
    let text = String::from;
    let nodes = NODES.map(|(id, kind, out, unit, _, _)| NodeLayout {
        id: text(id),
        kind: text(kind),
        outputs: if out.is_empty() { vec![] } else { vec![[text(out), text(unit)]] },
        live: parameters(id),
        ..NodeLayout::default()
    });
    let scope = |name, unit, rate_hz| ScopeLayout { name: text(name), unit: text(unit), rate_hz };
    Layout {
        file: text("graphs/live.ron"),
        tick_hz: TICK_HZ as u32,
        audio_hz: 48_000,
        nodes: nodes.to_vec(),
        scopes: vec![
            scope("speed", "mm/s", 500),
            scope("force", "N", 500),
            scope("acceleration", "m/s^2", 48_000),
            scope("current", "A", 48_000),
        ],
        materials: vec![Materials {
            node: text("texture"),
            chosen: text("canvas"),
            names: ["sandpaper P40", "canvas", "oak", "denim", "felt", "sandpaper 100"].map(text).to_vec(),
        }],
        ..Layout::default()
    }
}

fn parameters(id: &str) -> Vec<LiveLayout> {
    let number = |name: &str, value, least, most, unit: &str| LiveLayout {
        name: name.into(),
        value,
        least,
        most,
        unit: unit.into(),
        ..LiveLayout::default()
    };
    match id {
        "floor" => vec![number("stiffness", 0.5, 0.0, 2.0, "N/mm")],
        "filter" => vec![number("cutoff", 20.0, 1.0, 1000.0, "Hz")],
        "gate" => vec![number("open_at", 5.0, 0.0, 50.0, "mm/s"), number("fade", 10.0, 1.0, 100.0, "ms")],
        "phase" => vec![LiveLayout {
            words: ["left", "centre", "right"].map(String::from).to_vec(),
            ..number("emission", 1.0, 0.0, 2.0, "")
        }],
        "level" => vec![number("gain", 1.0, 0.0, 4.0, "")],
        "guard" => {
            vec![LiveLayout {
                words: ["off", "on"].map(String::from).to_vec(),
                ..number("slew", 1.0, 0.0, 1.0, "")
            }]
        }
        _ => vec![],
    }
}

/// Figures at `seconds`, with the samples of the last `since` seconds.
pub(super) fn view(seconds: f64, since: f64) -> View {
    let ticks = (seconds * TICK_HZ) as u64;
    let awake = (seconds / 8.0 * 6.5 * TICK_HZ) as u64;
    let nodes = NODES.map(|(id, _, _, _, us, sleeps)| {
        let calls = if sleeps { awake.min(ticks) } else { ticks };
        let value = match id {
            "motion" | "filter" => speed(seconds),
            "floor" => force(seconds),
            "stylus" => 40.0 + 30.0 * (seconds / 3.0).sin(),
            "gate" => f64::from(speed(seconds) > 5.0),
            "actuator" | "guard" => 0.11,
            _ => 1.4 + 0.2 * (seconds * 3.0).sin(),
        };
        NodeView {
            us: us * (1.0 + 0.05 * (seconds * 7.0 + us).sin()),
            max_us: us * 2.7 + 3.0,
            calls,
            slept: ticks - calls,
            faults: u64::from(id == "phase"),
            last_fault: String::from(if id == "phase" { "not a number in spectrum" } else { "" }),
            values: if id == "card" { vec![] } else { vec![value as f32] },
            ..NodeView::default()
        }
    });
    let sample = |rate: f64, signal: fn(f64) -> f64| -> Vec<f32> {
        let first = ((seconds - since).max(0.0) * rate) as u64;
        (first..(seconds * rate) as u64).map(|k| signal(k as f64 / rate) as f32).collect()
    };
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
            rate_hz: 997.0 + 3.0 * (seconds * 2.0).sin(),
            age_ms: 0.9 + 0.4 * (seconds * 5.0).sin().abs(),
            delay_ms: 2.1,
            stalls: 1,
            stalled: false,
            samples: ticks * 2,
        }],
        scopes: vec![
            sample(500.0, speed),
            sample(500.0, force),
            sample(48e3, acceleration),
            sample(48e3, current),
        ],
        latency_ms: [("input", 2.1), ("tick", 2.0), ("resampler", 0.7), ("ring", 2.7), ("driver", 5.3)]
            .map(|(what, ms)| (what.into(), ms))
            .to_vec(),
        peak: (0.28 + 0.1 * (seconds * 9.0).sin()).abs() as f32,
        ..View::default()
    }
}

/// Lateness about 14 us and computing about 300 us, each with a tail.
fn timing(ticks: u64) -> TimingView {
    let edges: Vec<f64> = (0..64).map(|k| 10f64.powf(f64::from(k) / 12.0)).collect();
    let spread = |median: f64, width: f64, tail: f64| -> Vec<u64> {
        let count = |us: &f64| {
            let z = (us / median).log10() / width;
            let far = if *us > median { tail * (median / us).powf(1.2) } else { 0.0 };
            let misses = if tail > 0.0 && (3000.0..3500.0).contains(us) { ticks / 9500 } else { 0 };
            (ticks as f64 * 0.3 * ((-0.5 * z * z).exp() + far)) as u64 + misses
        };
        edges.iter().map(count).collect()
    };
    TimingView {
        deadline_us: 2000.0,
        misses: ticks / 9000,
        woke_late: ticks / 9500,
        late_us: [14.2, 24.8, 231.0, 3120.0],
        compute_us: [301.0, 412.0, 655.0, 1180.0],
        recovery_us: [0.0; 4],
        late_counts: spread(14.0, 0.09, 0.002),
        compute_counts: spread(301.0, 0.06, 0.0),
        edges_us: edges,
    }
}

/// A stroke to and fro, with a rest after it.
fn stroke(t: f64) -> f64 {
    let t = t % 8.0;
    if t < 6.5 { (TAU * t / 2.6).sin().abs() * (1.0 - (t / 6.5).powi(8)) } else { 0.0 }
}

fn speed(t: f64) -> f64 {
    120.0 * stroke(t) + 0.4 * (t * 40.0).sin().abs()
}

fn force(t: f64) -> f64 {
    1.1 + 0.35 * (t * 1.3).sin() + 0.08 * (t * 11.0).sin() * stroke(t)
}

fn acceleration(t: f64) -> f64 {
    let weave = (TAU * 83.0 * t).sin()
        + 0.6 * (TAU * 211.0 * t).sin()
        + 0.4 * (TAU * 347.0 * t + (t * 17.0).sin()).sin();
    4.0 * stroke(t) * (0.6 + 0.4 * (t * 9.0).sin()) * weave
}

fn current(t: f64) -> f64 {
    0.06 * stroke(t)
        * (0.6 + 0.4 * (t * 9.0).sin())
        * ((TAU * 83.0 * t).sin() + 0.4 * (TAU * 211.0 * t).sin())
}
