//! `asperity latency`: how long it takes from a hand to the actuator.
//!
//! Two things add up. [`chain`]: a graph answers a change of speed late, whatever runs it; this is found offline. [`around`]: what
//! runs it in real time reads the hand a little behind and plays a little ahead; this is declared item by item, and
//! measured over a loopback from the output to an input.

mod around;
mod chain;

use std::fmt::Write as _;
use std::process::ExitCode;

use asperity_diagnostics::Diagnostic;
use serde_json::{Value, json};

use crate::args::LatencyArgs;
use crate::failure::{Failure, print};
use around::Around;
use chain::Chain;

/// Runs the command.
pub fn run(args: &LatencyArgs) -> Result<ExitCode, Failure> {
    let wanted = args.output.card.device.is_some() || args.output.card.host.is_some();
    if args.graphs.is_empty() && !wanted {
        return Err(Diagnostic::new("there is nothing to measure")
            .in_file("asperity latency")
            .help("name graphs to see how late they answer, and a device whose output is looped back to its input: --device D")
            .into());
    }
    let clicks = wanted.then(|| around::prepare(args)).transpose()?;
    let ready = chain::prepare(args)?;
    let chains: Vec<Chain> = ready.into_iter().map(chain::measure).collect::<Result<_, _>>()?;
    let around = clicks.map(|made| around::measure(args, made)).transpose()?;
    if args.json {
        print(&format!("{:#}\n", as_json(&chains, around.as_ref())))?;
    } else {
        print(&text(&chains, around.as_ref()))?;
    }
    Ok(if around.is_some_and(|a| !a.agrees()) { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn text(chains: &[Chain], around: Option<&Around>) -> String {
    let mut out = String::new();
    if let Some(a) = around {
        let _ = writeln!(
            out,
            "from a hand to the output, on {}, {} clock, {} frames",
            a.device, a.clock, a.period_frames
        );
        for (what, ms) in &a.items {
            let _ = writeln!(out, "  {ms:8.2} ms  {what}");
        }
        let _ = writeln!(out, "  {:8.2} ms  declared in all", a.declared_ms());
        let _ = writeln!(
            out,
            "  {:8.2} ms  measured over the loopback: median of {}, from {:.2} to {:.2} ms",
            a.median_ms(),
            a.measured_ms.len(),
            a.least_ms(),
            a.most_ms()
        );
        let verdict = if a.agrees() { "they agree within a tick" } else { "THEY DO NOT AGREE within a tick" };
        let _ = writeln!(
            out,
            "  {:8.2} ms  between them: {verdict} ({:.2} ms)\n",
            a.median_ms() - a.declared_ms(),
            a.tick_ms
        );
    }
    if !chains.is_empty() {
        let _ = writeln!(
            out,
            "answer to a step of speed, of the acceleration that goes to the actuator's inverse"
        );
        let width = chains.iter().map(|c| c.graph.chars().count()).max().unwrap_or(0).max(5);
        let total = if around.is_some() { "   50 % with the above" } else { "" };
        let _ = writeln!(out, "  {:width$}      10 %      50 %      90 %{total}", "graph");
        for c in chains {
            let [a, b, d] = c.lag_ms;
            let total = around.map_or(String::new(), |a| format!("   {:8.1} ms", a.declared_ms() + b));
            let _ = writeln!(out, "  {:width$}  {a:5.1} ms  {b:5.1} ms  {d:5.1} ms{total}", c.graph);
        }
        for c in chains {
            let _ = writeln!(out, "\nof these {:.1} ms, in {}", c.lag_ms[1], c.graph);
            for (what, ms) in &c.items {
                let _ = writeln!(out, "  {ms:8.2} ms  {what}");
            }
        }
    }
    out
}

fn as_json(chains: &[Chain], around: Option<&Around>) -> Value {
    let items = |items: &[(String, f64)]| -> Vec<Value> {
        items.iter().map(|(what, ms)| json!({ "what": what, "ms": ms })).collect()
    };
    let chains: Vec<Value> = chains
        .iter()
        .map(|c| json!({ "graph": c.graph, "lag_ms": c.lag_ms, "items": items(&c.items) }))
        .collect();
    let around = around.map(|a| {
        json!({
            "device": a.device, "clock": a.clock, "period_frames": a.period_frames, "tick_ms": a.tick_ms,
            "items": items(&a.items), "declared_ms": a.declared_ms(), "measured_ms": a.measured_ms,
            "median_ms": a.median_ms(), "agrees": a.agrees(),
        })
    });
    json!({ "graphs": chains, "around": around })
}
