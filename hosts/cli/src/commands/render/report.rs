//! Figures of a render as text, and the parts that `asperity run` reports in the same words.

use std::fmt::Write as _;
use std::path::PathBuf;

use asperity_dsp::Isa;
use asperity_node::{Fact, FactValue, Role};
use asperity_offline::render::{Run, Swapped, us};

pub use asperity_offline::render::{clipped, dropped_json, facts_json, target};

/// A network's inputs outside its training range, and outputs that cannot be magnitudes, in words.
pub fn out_of_range(facts: &[Fact]) -> Vec<String> {
    let find = |name: &str| facts.iter().find(|f| f.name == name);
    let count = |name: &str| match find(name).map(|f| &f.value) {
        Some(FactValue::Count(n)) => *n,
        _ => 0,
    };
    let most = |name: &str| find(name).map_or("the known range".to_owned(), |f| f.value.to_string());
    let mut out = Vec::new();
    if let n @ 1.. = count("force_out_of_range") {
        out.push(format!("{n} frames with a force outside 0 to {}, held there", most("trained_force")));
    }
    if let n @ 1.. = count("velocity_out_of_range") {
        out.push(format!("{n} frames with a speed above {}, held there", most("trained_speed")));
    }
    // Phase retrieval counts its inputs under the same name.
    if let (Some(_), n @ 1..) = (find("velocity_out_of_range"), count("bad_magnitudes")) {
        out.push(format!("{n} magnitudes were negative or not finite, and are taken as 0"));
    }
    out
}

/// Why a node of taps never sounded, if it did not.
pub fn no_tap(facts: &[Fact]) -> Option<String> {
    let count = |name: &str| facts.iter().find(|f| f.name == name).map(|f| &f.value);
    match (count("contacts")?, count("taps")?) {
        (FactValue::Count(0), _) => {
            Some("no tap sounded: the stylus never came from the air to a surface that has one".into())
        }
        (FactValue::Count(n), FactValue::Count(0)) => {
            Some(format!("no tap sounded: the approach was below `min_speed_mm_s` in all of {n} contacts"))
        }
        _ => None,
    }
}

/// Says how many samples were cut, and the remedy.
pub fn cut_at_full_scale(samples: u64) -> String {
    format!("{samples} samples were cut at the card's full scale: raise its volts or amplify more")
}

/// Instructions that were used, and whether other CPUs give the same bits.
fn computed(run: &Run<'_>) -> String {
    let name = Isa::best().name();
    let is_tract =
        |fact: &Fact| fact.name == "executor" && matches!(&fact.value, FactValue::Text(t) if t == "tract");
    let nodes = &run.engine.schedule().nodes;
    match nodes.iter().zip(&run.facts).find(|(_, facts)| facts.iter().any(is_tract)) {
        Some((node, _)) => {
            format!("by {name}; `{}` runs by tract, which other CPUs round otherwise", node.id)
        }
        None => format!("by {name}; every CPU gives the same bits"),
    }
}

pub fn summary(run: &Run<'_>, written: &[PathBuf]) -> String {
    let Run { ticks, engine, level, .. } = *run;
    let schedule = engine.schedule();
    let tick_hz = f64::from(schedule.tick_hz);
    let mut out = String::new();
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "{name:<10}{text}");
    };
    let cut = if ticks < run.asked { ", interrupted" } else { "" };
    let (seconds, factor) = (ticks as f64 / tick_hz, run.realtime_factor());
    line("rendered", format!("{seconds:.2} s ({ticks} ticks at {tick_hz} Hz){cut}, {factor:.0} x real time"));
    let t = run.times.tick_summary();
    let part = |ns: u64| format!("{:.1} us ({:.1} %)", us(ns), 100.0 * us(ns) / (1e6 / tick_hz));
    line("tick", format!("p50 {}  p99 {}", part(t.p50_ns), part(t.p99_ns)));
    line("", format!("p99.9 {}  max {}", part(t.p999_ns), part(t.max_ns)));
    line("computed", computed(run));
    line("latency", run.lag.to_string());
    if !level.unit.is_empty() {
        line("output", format!("peak {:.4} {u}, rms {:.4} {u}", level.peak, level.rms(), u = level.unit));
        if level.peak == 0.0 {
            line("", "silent: no gate opened, or nothing moved".into());
        }
        if let samples @ 1.. = clipped(&run.facts) {
            line("", cut_at_full_scale(samples));
        }
    }
    for (node, facts) in schedule.nodes.iter().zip(&run.facts) {
        for fact in facts.iter().filter(|f| f.name == "executor") {
            line("network", format!("`{}`: {}", node.id, fact.value));
        }
        for text in out_of_range(facts).into_iter().chain(no_tap(facts)) {
            line("", format!("`{}`: {text}", node.id));
        }
        if node.role == Some(Role::Limiter) {
            line("limiter", format!("`{}` {}", node.id, limited(facts)));
        }
    }
    match engine.faults() {
        0 => line("faults", "none".into()),
        n => line("faults", n.to_string()),
    }
    for (i, node) in schedule.nodes.iter().enumerate() {
        if let Some(r) = engine.report(i).filter(|r| r.faults > 0) {
            let last = r.last_fault.map(|f| f.to_string()).unwrap_or_default();
            line("", faulty((&node.id, &node.kind), r.faults, &last, r.quarantined));
        }
    }
    for Swapped { tick, what } in &run.swaps {
        let at = tick.map_or("too late".into(), |t| format!("{:.2} s", t as f64 / tick_hz));
        line("changed", format!("at {at}: {what}"));
    }
    for d in &schedule.dropped {
        line("dropped", format!("`{}` ({}): {}", d.id, d.kind, d.why));
    }
    for path in written {
        line("wrote", path.display().to_string());
    }
    if written.is_empty() {
        line("wrote", "nothing: name a file with --out, --plot, --report or --probe".into());
    }
    out
}

/// A node that failed, in words.
pub fn faulty((id, kind): (&str, &str), times: u64, last: &str, quarantined: bool) -> String {
    let end = if quarantined { "; it was taken out of the graph" } else { "" };
    format!("`{id}` ({kind}) {times} times, last: {last}{end}")
}

/// Samples that a limiter changed, by reason.
fn limited(facts: &[Fact]) -> String {
    let by = |f: &Fact| match f.value {
        FactValue::Count(n) if n > 0 => Some(format!("{} {n}", f.name.strip_prefix("limited_")?)),
        _ => None,
    };
    let acted: Vec<String> = facts.iter().filter_map(by).collect();
    if acted.is_empty() { "removed DC only".into() } else { format!("samples: {}", acted.join(", ")) }
}
