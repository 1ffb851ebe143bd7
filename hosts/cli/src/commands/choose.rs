//! `asperity choose`: the best setting that a budget allows, ready to be pasted.

use std::fmt::Write as _;
use std::process::ExitCode;

use asperity_source::{Diagnostic, one_of};
use asperity_study::{Budget, Choice, Figure, Reason, Results};
use serde_json::json;

use super::tradeoff::read_results;
use crate::args::Choose;
use crate::failure::{Failure, complain, print};

/// Results of the shipped study.
const SHIPPED: &str = include_str!("../../../../docs/tradeoff/results.json");

/// Runs the command. Exit code 1 where nothing fits.
pub fn run(args: &Choose) -> Result<ExitCode, Failure> {
    let (results, from) = match &args.results {
        Some(path) => (read_results(path)?, path.display().to_string()),
        None => {
            let parsed = Results::parse(SHIPPED).map_err(Failure::Machine)?;
            (parsed, "the shipped study".to_owned())
        }
    };
    let budget = Budget {
        tick_us: args.budget_us,
        lag_ms: args.max_lag_ms,
        strict: args.strict,
        by: figures(&args.by)?,
        tick_hz: args.tick_hz,
    };
    let Some(choice) = results.choose(&budget) else {
        complain(&nothing(&results, &budget, &from));
        return Ok(ExitCode::from(1));
    };
    if args.json {
        let row = choice.row;
        let out = json!({
            "setting": row.name, "graph": row.graph, "tick_hz": row.tick_hz, "time": row.time, "lag_ms": row.lag_ms,
            "figures": row.figures, "fragment": row.fragment, "fit": choice.fit,
        });
        print(&format!("{out:#}\n"))?;
    } else {
        print(&text(&results, &choice, &from))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn figures(names: &[String]) -> Result<Vec<Figure>, Failure> {
    let known = || Figure::ALL.into_iter().map(Figure::name);
    let of = |name: &String| {
        Figure::from_name(name.trim()).ok_or_else(|| {
            let d = Diagnostic::new(format!("there is no figure `{name}`")).in_file("--by");
            Failure::from(d.help(one_of(name, known())))
        })
    };
    names.iter().map(of).collect()
}

/// The setting as a fragment of a graph, with what it costs and is worth as comments.
fn text(results: &Results, choice: &Choice<'_>, from: &str) -> String {
    let row = choice.row;
    let mut out =
        format!("// {}: of {} settings of {from} {} fit.\n", row.name, results.rows.len(), choice.fit);
    if let Some(t) = row.time {
        let _ = writeln!(
            out,
            "// A tick: median {:.1} us, 99.9 % within {:.1} us; {:.2} % of a core; response lag {}.",
            t.p50_us,
            t.p999_us,
            t.load_percent,
            row.lag50().map_or("not known".into(), |ms| format!("{ms:.1} ms"))
        );
    }
    let figure = |f: &Figure| {
        let value = row.figure(*f)?;
        Some(format!("{} {value:.*} {}", f.name(), f.decimals(), f.unit()).trim_end().to_owned())
    };
    let figures: Vec<String> = Figure::ALL.iter().filter_map(figure).collect();
    let _ = writeln!(out, "// {}.", figures.join(", "));
    for (figure, left) in &choice.steps {
        let _ = writeln!(out, "// By {}: {left} not told apart from the best.", figure.name());
    }
    if row.turned.iter().any(|(knob, _)| knob == "guards") {
        out +=
            "// `guards` is no part of a graph: it was turned off to be measured, and cannot be elsewhere.\n";
    }
    if row.fragment.is_empty() {
        let _ = writeln!(out, "// It is {} as it stands.", row.graph);
        return out;
    }
    let _ = write!(out, "// To be put into {}:\n{}", row.graph, row.fragment);
    out
}

/// Why there is none, and what would be nearest.
fn nothing(results: &Results, budget: &Budget, from: &str) -> String {
    let mut counts = [0; 4];
    for row in &results.rows {
        match results.fits(row, budget) {
            Err(Reason::Unsound) => counts[0] += 1,
            Err(Reason::Time) => counts[1] += 1,
            Err(Reason::Lag) => counts[2] += 1,
            Err(Reason::Ticks) => counts[3] += 1,
            Ok(()) => {}
        }
    }
    let mut out = format!(
        "error: no setting of {from} fits: of {} settings {} cannot be chosen, {} take too long, {} answer too late, {} have other ticks\n",
        results.rows.len(),
        counts[0],
        counts[1],
        counts[2],
        counts[3]
    );
    let sound = || results.rows.iter().filter(|r| r.sound());
    let quickest = sound().filter_map(|r| r.time).map(|t| t.p999_us.max(t.p50_us)).reduce(f64::min);
    let soonest = sound().filter_map(|r| r.lag50()).reduce(f64::min);
    if let Some(us) = quickest.filter(|_| counts[1] > 0) {
        let _ = writeln!(out, "  the quickest has ticks of {us:.1} us at the 99.9th percentile");
    }
    if let Some(ms) = soonest.filter(|_| counts[2] > 0) {
        let _ = writeln!(out, "  the soonest answers after {ms:.1} ms");
    }
    out
}
