//! Figures of a run in real time: for a person, and as JSON.

use std::fmt::Write as _;
use std::path::PathBuf;

use asperity_dsp::Isa;
use asperity_live::Ended;
use asperity_live::realtime::Grants;
use asperity_live::view::TimingView;
use serde_json::{Map, Value, json};

use crate::args;
use crate::render::report::{clipped, cut_at_full_scale, fact_json, out_of_range};

/// What was run.
pub struct Run<'a> {
    pub args: &'a args::Run,
    pub ended: &'a Ended,
    pub grants: Option<Grants>,
}

/// The report as JSON.
pub fn json(run: &Run<'_>) -> String {
    let (view, layout) = (&run.ended.view, run.ended.conductor.layout());
    let facts = |i: usize| -> Map<String, Value> {
        let engine = run.ended.player.as_ref().map(|p| p.engine());
        engine.map_or_else(Map::new, |e| {
            e.facts(i).iter().map(|f| (f.name.to_string(), fact_json(f))).collect()
        })
    };
    let nodes: Vec<Value> = layout
        .nodes
        .iter()
        .zip(&view.nodes)
        .enumerate()
        .map(|(i, (node, v))| {
            json!({
                "id": node.id, "kind": node.kind, "calls": v.calls, "slept": v.slept, "us_max": v.max_us,
                "faults": v.faults, "last_fault": v.last_fault, "quarantined": v.quarantined, "facts": facts(i),
            })
        })
        .collect();
    let sources: Vec<Value> = view
        .sources
        .iter()
        .map(|s| json!({ "id": s.id, "samples": s.samples, "stalls": s.stalls, "delay_ms": s.delay_ms }))
        .collect();
    let latency: Map<String, Value> =
        view.latency_ms.iter().map(|(what, ms)| (what.clone(), json!(ms))).collect();
    let TimingView { deadline_us, misses, woke_late, late_us, compute_us, recovery_us, .. } = &view.timing;
    let figures = |f: &[f64; 4]| json!({ "p50": f[0], "p99": f[1], "p999": f[2], "max": f[3] });
    let refused = run.grants.map(|g| g.refused()).unwrap_or_default();
    let report = json!({
        "asperity": env!("CARGO_PKG_VERSION"),
        "target": format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
        "instructions": Isa::best().name(),
        "graph": run.args.graph.graph.display().to_string(),
        "tick_hz": layout.tick_hz,
        "audio_hz": layout.audio_hz,
        "device": view.device,
        "clock": view.clock,
        "period_frames": view.period_frames,
        "ticks": view.ticks,
        "seconds": view.seconds,
        "deadline_us": deadline_us,
        "misses": misses,
        "misses_woke_late": woke_late,
        "late_us": figures(late_us),
        "tick_us": figures(compute_us),
        "recovery_us": figures(recovery_us),
        "underruns": view.underruns,
        "lost_samples": view.lost_samples,
        "guarded_samples": view.guarded,
        "clipped_samples": run.ended.player.as_ref().map_or(0, |p| clipped(p.engine())),
        "xruns": view.xruns,
        "losses": view.losses,
        "skipped_ticks": view.skipped_ticks,
        "recording_gaps": view.recording_gaps,
        "faults": view.faults,
        "latency_ms": latency,
        "not_granted": refused,
        "sources": sources,
        "nodes": nodes,
    });
    format!("{report:#}\n")
}

/// The summary a person reads.
pub fn summary(run: &Run<'_>, written: &[PathBuf]) -> String {
    let (view, layout) = (&run.ended.view, run.ended.conductor.layout());
    let mut out = String::new();
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "{name:<10}{text}");
    };
    line(
        "ran",
        format!(
            "{:.2} s ({} ticks at {} Hz), {} clock",
            view.seconds, view.ticks, layout.tick_hz, view.clock
        ),
    );
    let t = &view.timing;
    let figures =
        |f: &[f64; 4]| format!("p50 {:.1}  p99 {:.1}  p99.9 {:.1}  max {:.1} us", f[0], f[1], f[2], f[3]);
    line("woke late", figures(&t.late_us));
    line("tick", format!("{} of {:.0} us", figures(&t.compute_us), t.deadline_us));
    let part = 100.0 * t.misses as f64 / view.ticks.max(1) as f64;
    line(
        "misses",
        format!(
            "{} ({part:.3} %): {} woke too late, {} took too long; {} more were left out",
            t.misses,
            t.woke_late,
            t.misses - t.woke_late.min(t.misses),
            view.skipped_ticks
        ),
    );
    if t.recovery_us[3] > 0.0 {
        line("in time", format!("again after {}", figures(&t.recovery_us)));
    }
    if !view.device.is_empty() {
        if !view.latency_ms.is_empty() {
            let sum: f64 = view.latency_ms.iter().map(|(_, ms)| ms).sum();
            line("latency", format!("{sum:.1} ms from hand to actuator"));
            for (what, ms) in &view.latency_ms {
                line("", format!("{ms:6.2} ms  {what}"));
            }
        }
        line(
            "device",
            format!(
                "{}: {} underruns, {} samples lost, {} xruns, {} times lost",
                view.device, view.underruns, view.lost_samples, view.xruns, view.losses
            ),
        );
    }
    if view.guarded > 0 {
        let text = format!("{} samples were held to the actuator's limits behind the graph", view.guarded);
        line("guard", text);
    }
    let clipped = run.ended.player.as_ref().map_or(0, |p| clipped(p.engine()));
    if clipped > 0 {
        line("output", cut_at_full_scale(clipped));
    }
    if view.recording_gaps > 0 {
        line("recorded", format!("{} samples are missing", view.recording_gaps));
    }
    for s in &view.sources {
        line(
            "source",
            format!(
                "`{}`: {} samples, {} stalls, read {:.1} ms behind",
                s.id, s.samples, s.stalls, s.delay_ms
            ),
        );
    }
    if view.faults == 0 {
        line("faults", "none".into());
    } else {
        line("faults", view.faults.to_string());
        for (node, v) in layout.nodes.iter().zip(&view.nodes).filter(|(_, v)| v.faults > 0) {
            let end = if v.quarantined { "; it was taken out of the graph" } else { "" };
            line(
                "",
                format!("`{}` ({}) {} times, last: {}{end}", node.id, node.kind, v.faults, v.last_fault),
            );
        }
    }
    if let Some(player) = &run.ended.player {
        for (i, node) in layout.nodes.iter().enumerate() {
            for text in out_of_range(&player.engine().facts(i)) {
                line("network", format!("`{}`: {text}", node.id));
            }
        }
    }
    for path in written {
        line("wrote", path.display().to_string());
    }
    out
}
