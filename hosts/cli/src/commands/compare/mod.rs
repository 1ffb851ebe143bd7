//! `asperity compare`: compares all phase-retrieval nodes on the same magnitudes.
//!
//! [`contest`] runs all methods over the [`vectors`]; [`report`] shows its rows.

use std::path::PathBuf;

use asperity_node::Registry;
use asperity_offline::compare::contest::{self, Outcome, Row};
use asperity_offline::compare::report;
use asperity_offline::compare::vectors::{self, Set};

use crate::failure::{Failure, print_report, progress, wrong};
use crate::kinds::Kinds;
use crate::load::PluginArgs;
use crate::output::{Pending, apart, keep_all, named, resolved};
use crate::phase::{Chain, Method, retrievers};

/// Compare all phase-retrieval nodes: accuracy, response lag, latency, cost
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&[
    "asperity compare --svg compare.svg",
    "asperity compare --phase sample_commit:emission=0 --csv compare.csv",
]))]
pub struct Args {
    /// Folder of test vectors; by default the built-in set. NAME.npz has magnitudes, and NAME_RATE.mag.npy
    /// those of unscaled DFTs: float32 [frames, bins], 0.1 s under a Hann window, 2 ms apart.
    /// NAME_RATE.sig.npy has a signal, and sc.json published scores
    #[arg(long, value_name = "DIR")]
    pub vectors: Option<PathBuf>,
    /// Add a row for a node with these settings
    #[arg(long, value_name = "KIND[:param=value,...]")]
    pub phase: Vec<String>,
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Picture file of all figures
    #[arg(long, value_name = "F.svg")]
    pub svg: Option<PathBuf>,
    /// Table file of all figures: a line for each method and vector
    #[arg(long, value_name = "F.csv", conflicts_with = "json")]
    pub csv: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Show no progress
    #[arg(long, short)]
    pub quiet: bool,
}

/// Writes the result in one form.
type Text = fn(&Set, &Outcome, &[Row]) -> String;

pub fn run(args: &Args) -> Result<(), Failure> {
    let mut kinds = Kinds::new(&args.plugins.plugin);
    let registry = kinds.registry(None)?;
    let set = match &args.vectors {
        Some(dir) => vectors::read(dir)?,
        None => vectors::built_in()?,
    };
    let methods = methods(&registry, &args.phase, &set)?;
    let files: Vec<(&PathBuf, Text)> = [(&args.svg, report::svg as Text), (&args.csv, report::csv)]
        .into_iter()
        .filter_map(|(path, text)| Some((path.as_ref()?, text)))
        .collect();
    apart(Vec::new(), named(&[("--svg", args.svg.as_ref()), ("--csv", args.csv.as_ref())]))?;
    // Opened before minutes of work, so that a missing folder is an error at once.
    let mut pending = Vec::new();
    for (path, text) in files {
        // A file in the folder of vectors is harmless, unless it overwrites one that is read.
        let at = resolved(path);
        let plugin = kinds.files().iter().any(|f| resolved(f) == at);
        let within = |dir: &PathBuf| at.parent() == Some(&resolved(dir)) && at.exists();
        if plugin || args.vectors.as_ref().is_some_and(within) {
            let what = "this file is there already, and may be one that is compared";
            return Err(wrong(path, what, "name another file"));
        }
        pending.push((Pending::create(path)?, text));
    }

    let steps = contest::steps(&methods, &set);
    let bar = progress(steps, "comparing {wide_bar} {percent:>3} %  {eta} left", args.quiet);
    let outcome = contest::run(&registry, &methods, &set, || {
        bar.inc(1);
        Ok(())
    })?;
    bar.finish_and_clear();
    let published = contest::published(&set);
    let fill = |(file, text): (Pending, Text)| file.fill(&text(&set, &outcome, &published));
    let written = keep_all(pending.into_iter().map(fill).collect::<Result<_, _>>()?)?;
    let wrote: String = written.iter().map(|path| format!("wrote {}\n", path.display())).collect();
    print_report(
        args.json,
        || report::json(&set, &outcome, &published),
        || report::text(&set, &outcome, &published) + &wrote,
    )
}

/// Every kind that retrieves phase, with defaults, and the methods of `--phase`.
fn methods(registry: &Registry, asked: &[String], set: &Set) -> Result<Vec<Method>, Failure> {
    let kinds = retrievers(registry);
    let mut all = kinds.iter().map(|d| Method::parse(&d.kind, registry)).collect::<Result<Vec<_>, _>>()?;
    for text in asked {
        let method = Method::parse(text, registry)?;
        if all.iter().all(|m| m.label != method.label) {
            if !method.is_offline() {
                Chain::new(registry, &method, &set.vectors[0].frames, 1)?;
            }
            all.push(method);
        }
    }
    if all.is_empty() {
        return Err(Failure::Machine("there is no phase-retrieval node".into()));
    }
    Ok(all)
}
