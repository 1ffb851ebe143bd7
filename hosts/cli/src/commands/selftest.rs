//! `asperity selftest`: runs the hard cases over a user's graph and all kinds of nodes.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;

use asperity_checks::{Case, Effort, Stop, Subject, cases};
use asperity_diagnostics::{Diagnostic, one_of};
use asperity_graph::GraphFile;
use asperity_node::Registry;
use clap::ValueEnum;
use serde_json::{Value, json};

use crate::failure::{Failure, clean, print, progress};
use crate::kinds::Kinds;
use crate::load::{self, GraphArgs, PluginArgs};

/// Effort of each case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum EffortOf {
    /// A second or less per case
    Quick,
    /// Some seconds per case
    Full,
    /// Minutes per case and more
    Long,
}

/// Run hard cases over a graph and its plugins: the output must stay finite and bounded, and recover
///
/// Without a graph, runs the cases that check kinds of nodes, over all kinds. Plugins run in this process:
/// check a plugin that may crash with `plugin check` first.
/// Exit code 0: all cases that apply hold; 1: one fails; 2: the graph does not load.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&[
    "asperity selftest graphs/texture.ron",
    "asperity selftest graphs/texture.ron --family motion --verbose",
]))]
pub struct Args {
    /// A graph or scene file; without one, only kinds of nodes are checked
    #[arg(value_parser = crate::shipped::path())]
    pub graph: Option<PathBuf>,
    /// Set a parameter of the graph, such as motion.cutoff_hz=30, or tick_hz, audio_hz, seed
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE", requires = "graph")]
    pub set: Vec<String>,
    /// Run the cases of this family only
    #[arg(long = "family", value_name = "FAMILY")]
    pub family: Vec<String>,
    /// Run this case only
    #[arg(long = "case", value_name = "CASE")]
    pub case: Vec<String>,
    /// Effort of each case
    #[arg(long, value_enum, default_value = "quick")]
    pub effort: EffortOf,
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Print the difficulty and the requirement of each case
    #[arg(long, short)]
    pub verbose: bool,
    /// Print JSON
    #[arg(long, conflicts_with = "verbose")]
    pub json: bool,
    /// Show no progress
    #[arg(long, short)]
    pub quiet: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let chosen = chosen(args)?;
    let (graph, registry) = subject(args)?;
    let mut subject = Subject::new(registry).effort(match args.effort {
        EffortOf::Quick => Effort::Quick,
        EffortOf::Full => Effort::Full,
        EffortOf::Long => Effort::Long,
    });
    subject.graph = graph.as_ref();
    // A case that is named reports itself that it needs a graph.
    let needless = |case: &&Case| graph.is_none() && case.of_graph && args.case.is_empty();
    let (left, run): (Vec<&Case>, Vec<&Case>) = chosen.into_iter().partition(needless);
    let bar = progress(run.len() as u64, "testing {wide_bar} {pos}/{len}  {msg}", args.quiet);
    let line = table(&run);
    if !args.json && !run.is_empty() {
        print(&line("family", "case", "verdict", "found"))?;
    }
    let mut rows = Vec::new();
    for case in run {
        bar.set_message(case.name);
        let (verdict, found) = outcome(case, &subject);
        bar.inc(1);
        if !args.json {
            let found = found.lines().map(clean).collect::<Vec<_>>().join("; ");
            let mut row = line(case.family, case.name, verdict, &found);
            if args.verbose {
                row += &format!("    hard: {}\n    must: {}\n", case.hard, case.must);
            }
            bar.suspend(|| print(&row))?;
        }
        rows.push((case, verdict, found));
    }
    bar.finish_and_clear();
    let count = |word| rows.iter().filter(|(_, verdict, _)| *verdict == word).count();
    let failed = count("fails");
    if args.json {
        print(&format!("{:#}\n", as_json(args, &rows, failed)))?;
    } else {
        let (held, other) = (count("holds"), count("not applicable"));
        let more = match left.len() {
            0 => String::new(),
            n => format!("; {n} more look at a graph"),
        };
        print(&format!("\n{held} hold, {failed} failed, {other} not applicable{more}\n"))?;
    }
    Failure::said(failed > 0)
}

fn chosen(args: &Args) -> Result<Vec<&'static Case>, Failure> {
    let all = cases();
    let (named, families) = (|case: &&Case| case.name, |case: &&Case| case.family);
    let mut known = [
        ("case", &args.case, all.iter().map(named).collect::<Vec<_>>()),
        ("family", &args.family, all.iter().map(families).collect()),
    ];
    for (what, wanted, names) in &mut known {
        // Families stand one after another.
        names.dedup();
        if let Some(name) = wanted.iter().find(|name| !names.contains(&name.as_str())) {
            let message = format!("there is no {what} `{}`", clean(name));
            return Err(Diagnostic::new(message).help(one_of(name, names.iter().copied())).into());
        }
    }
    let asked = |names: &[String], name: &str| names.is_empty() || names.iter().any(|n| n == name);
    Ok(all.into_iter().filter(|c| asked(&args.case, c.name) && asked(&args.family, c.family)).collect())
}

/// The graph, if there is one, and all kinds. Errors of loading and compiling come before any case.
fn subject(args: &Args) -> Result<(Option<GraphFile>, Registry), Failure> {
    let mut kinds = Kinds::new(&args.plugins.plugin);
    let Some(path) = &args.graph else { return Ok((None, kinds.registry(None)?)) };
    let of = GraphArgs { set: args.set.clone(), ..GraphArgs::plain(path, &args.plugins) };
    let loaded = load::load(&of, &mut kinds)?;
    Ok((Some(loaded.graph), loaded.registry))
}

/// Runs a case. Answers the verdict and the findings.
fn outcome(case: &Case, subject: &Subject<'_>) -> (&'static str, String) {
    // Nothing else catches a panic of a plugin that is prepared.
    match catch_unwind(AssertUnwindSafe(|| case.run(subject))) {
        Ok(Ok(found)) => ("holds", found),
        Ok(Err(Stop::Failed(why))) => ("fails", why),
        Ok(Err(Stop::NotApplicable(why))) => ("not applicable", why),
        Err(_) => ("fails", "it panicked outside a tick".into()),
    }
}

/// Writes rows of a table over these cases: family, case, verdict and findings.
fn table(cases: &[&Case]) -> impl Fn(&str, &str, &str, &str) -> String + use<> {
    let widest = |name: fn(&Case) -> &str, head: &str| {
        cases.iter().map(|c| name(c).len()).max().unwrap_or(0).max(head.len())
    };
    let (f, c) = (widest(|c| c.family, "family"), widest(|c| c.name, "case"));
    move |family, case, verdict, found| {
        format!("{family:f$}  {case:c$}  {verdict:14}  {found}").trim_end().to_owned() + "\n"
    }
}

fn as_json(args: &Args, rows: &[(&Case, &str, String)], failed: usize) -> Value {
    let row = |(case, verdict, found): &(&Case, &str, String)| {
        json!({
            "family": case.family, "case": case.name, "verdict": verdict,
            "found": found, "hard": case.hard, "must": case.must, "of_graph": case.of_graph,
        })
    };
    json!({
        "graph": args.graph.as_ref().map(|p| p.display().to_string()),
        "effort": args.effort.to_possible_value().map(|value| value.get_name().to_owned()),
        "verdict": if failed == 0 { "holds" } else { "fails" },
        "cases": rows.iter().map(row).collect::<Vec<_>>(),
    })
}
