//! Figures of a run, as text and as JSON.

use std::fmt::Write as _;
use std::path::PathBuf;

use asperity_dsp::Isa;
use asperity_live::Ended;
use asperity_live::realtime::Grants;
use asperity_live::view::{Change, TimingView};
use serde_json::{Map, Value, json};

use super::Args;
use crate::commands::render::report::{
    clipped, cut_at_full_scale, facts_json, faulty, no_tap, out_of_range, target,
};
use crate::lag::{self, Lag};

pub struct Run<'a> {
    pub args: &'a Args,
    pub ended: &'a Ended,
    pub grants: Option<Grants>,
    /// Changes and markers, oldest first.
    pub changes: Vec<Change>,
    pub lag: Lag,
}

fn figures_json(f: &[f64; 4]) -> Value {
    json!({ "p50": f[0], "p99": f[1], "p999": f[2], "max": f[3] })
}

fn figures_text(f: &[f64; 4]) -> String {
    format!("p50 {:.1}  p99 {:.1}  p99.9 {:.1}  max {:.1} us", f[0], f[1], f[2], f[3])
}

impl Run<'_> {
    fn clipped(&self) -> u64 {
        clipped(&self.ended.facts)
    }

    pub fn json(&self) -> String {
        let (view, layout) = (&self.ended.view, self.ended.graph_controller.layout());
        let facts =
            |i: usize| -> Map<String, Value> { self.ended.facts.get(i).map_or_else(Map::new, facts_json) };
        let nodes = layout.nodes.iter().zip(&view.nodes).enumerate().map(|(i, (node, v))| {
            json!({
                "id": node.id, "kind": node.kind, "calls": v.calls, "slept": v.slept, "us_max": v.max_us,
                "faults": v.faults, "last_fault": v.last_fault, "quarantined": v.quarantined,
                "facts": facts(i),
            })
        });
        let sources = view
            .sources
            .iter()
            .map(|s| json!({ "id": s.id, "samples": s.samples, "stalls": s.stalls, "delay_ms": s.delay_ms }));
        let latency = view.latency_ms.iter().map(|(what, ms)| (what.clone(), json!(ms)));
        let TimingView { deadline_us, misses, woke_late, late_us, compute_us, recovery_us, .. } =
            &view.timing;
        let report = json!({
            "asperity": env!("CARGO_PKG_VERSION"),
            "target": target(),
            "instructions": Isa::best().name(),
            "graph": self.args.graph.graph.display().to_string(),
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
            "late_us": figures_json(late_us),
            "tick_us": figures_json(compute_us),
            "recovery_us": figures_json(recovery_us),
            "underruns": view.underruns,
            "lost_samples": view.lost_samples,
            "guarded_samples": view.guarded,
            "clipped_samples": self.clipped(),
            "xruns": view.xruns,
            "losses": view.losses,
            "skipped_ticks": view.skipped_ticks,
            "recording_gaps": view.recording_gaps,
            "faults": view.faults,
            "changes": self.changes,
            "latency": lag::json(&self.lag),
            "hand_to_actuator_ms": latency.collect::<Map<_, _>>(),
            "not_granted": self.grants.map(|g| g.refused()).unwrap_or_default(),
            "sources": sources.collect::<Vec<_>>(),
            "nodes": nodes.collect::<Vec<_>>(),
        });
        format!("{report:#}\n")
    }

    pub fn summary(&self, written: &[PathBuf]) -> String {
        let (view, layout, t) =
            (&self.ended.view, self.ended.graph_controller.layout(), &self.ended.view.timing);
        let mut out = String::new();
        let mut line = |name: &str, text: String| {
            let _ = writeln!(out, "{name:<10}{text}");
        };
        let (seconds, ticks) = (view.seconds, view.ticks);
        line("ran", format!("{seconds:.2} s ({ticks} ticks at {} Hz), {} clock", layout.tick_hz, view.clock));
        line("woke late", figures_text(&t.late_us));
        line("tick", format!("{} of {:.0} us", figures_text(&t.compute_us), t.deadline_us));
        line(
            "misses",
            format!(
                "{} ({:.3} %): {} woke too late, {} took too long; {} more were left out",
                t.misses,
                100.0 * t.misses as f64 / ticks.max(1) as f64,
                t.woke_late,
                t.misses - t.woke_late.min(t.misses),
                view.skipped_ticks
            ),
        );
        if t.recovery_us[3] > 0.0 {
            line("in time", format!("again after {}", figures_text(&t.recovery_us)));
        }
        line("latency", self.lag.to_string());
        if !view.device.is_empty() {
            if !view.latency_ms.is_empty() {
                let sum: f64 = view.latency_ms.iter().map(|(_, ms)| ms).sum();
                line("", format!("{sum:.1} ms declared from the hand to the actuator, with the device:"));
                for (what, ms) in &view.latency_ms {
                    line("", format!("{ms:6.2} ms  {what}"));
                }
            }
            let (device, underruns, lost) = (&view.device, view.underruns, view.lost_samples);
            line(
                "device",
                format!(
                    "{device}: {underruns} underruns, {lost} samples lost, {} xruns, {} times lost",
                    view.xruns, view.losses
                ),
            );
        }
        if view.guarded > 0 {
            let text =
                format!("{} samples were limited after the graph, to protect the actuator", view.guarded);
            line("guard", text);
        }
        if let samples @ 1.. = self.clipped() {
            line("output", cut_at_full_scale(samples));
        }
        if view.recording_gaps > 0 {
            line("recorded", format!("{} samples are missing", view.recording_gaps));
        }
        for s in &view.sources {
            let (id, samples, stalls) = (&s.id, s.samples, s.stalls);
            line(
                "source",
                format!("`{id}`: {samples} samples, {stalls} stalls, read {:.1} ms behind", s.delay_ms),
            );
        }
        line("faults", if view.faults == 0 { "none".into() } else { view.faults.to_string() });
        for (node, v) in layout.nodes.iter().zip(&view.nodes).filter(|(_, v)| v.faults > 0) {
            line("", faulty((&node.id, &node.kind), v.faults, &v.last_fault, v.quarantined));
        }
        for (node, facts) in layout.nodes.iter().zip(&self.ended.facts) {
            for text in out_of_range(facts) {
                line("network", format!("`{}`: {text}", node.id));
            }
            if let Some(text) = no_tap(facts) {
                line("", format!("`{}`: {text}", node.id));
            }
        }
        for path in written {
            line("wrote", path.display().to_string());
        }
        out
    }
}
