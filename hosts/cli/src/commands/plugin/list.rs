//! `asperity plugin list`: the plugins that are found, and where.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use asperity_diagnostics::Diagnostic;
use asperity_loader::{Found, Loader, PATH_VARIABLE, Plugin};
use serde_json::{Value, json};

use crate::failure::{Failure, print};
use crate::kinds::{named_plugin, plugins_on_path};
use crate::load::PluginArgs;

/// List the plugins that are found, where, and the kinds they offer
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// A file, the place that names it, and its plugin or why it does not load.
struct Row {
    path: PathBuf,
    by: String,
    plugin: Result<Plugin, Diagnostic>,
}

/// Runs the command. A plugin that does not load is a row like any other.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    let mut loader = Loader::default();
    let mut rows = Vec::new();
    for name in &args.plugins.plugin {
        rows.push((named_plugin(name)?, "--plugin".to_owned()));
    }
    for Found { path, by } in plugins_on_path() {
        rows.push((path, format!("{PATH_VARIABLE}, {}", by.display())));
    }
    let rows: Vec<Row> =
        rows.into_iter().map(|(path, by)| Row { plugin: loader.load(&path), path, by }).collect();
    if args.json {
        print(&format!("{:#}\n", Value::Array(rows.iter().map(as_json).collect())))?;
    } else {
        print(&text_of(&rows))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn text_of(rows: &[Row]) -> String {
    let mut out = String::new();
    for Row { path, by, plugin } in rows {
        match plugin {
            Ok(plugin) => {
                let _ =
                    writeln!(out, "{} {}\n  {}  (by {by})", plugin.name(), plugin.version(), path.display());
                let width = plugin.kinds().iter().map(|k| k.descriptor().kind.len()).max().unwrap_or(0);
                for kind in plugin.kinds() {
                    let d = kind.descriptor();
                    let _ = writeln!(out, "    {:width$}  {}", d.kind, d.summary);
                }
            }
            Err(e) => {
                let help = e.help.as_ref().map(|h| format!("\n    {h}")).unwrap_or_default();
                let _ =
                    writeln!(out, "does not load\n  {}  (by {by})\n    {}{help}", path.display(), e.message);
            }
        }
    }
    if rows.is_empty() {
        let _ = writeln!(
            out,
            "no plugins: {PATH_VARIABLE} names no folder with a shared library in it\n\
             asperity plugin new NAME makes one; a graph file names its own: plugins: [\"libmine.so\"]"
        );
    }
    out
}

fn as_json(row: &Row) -> Value {
    let Row { path, by, plugin } = row;
    match plugin {
        Ok(plugin) => json!({
            "file": path.display().to_string(),
            "by": by,
            "name": plugin.name(),
            "version": plugin.version(),
            "kinds": plugin.kinds().iter().map(|k| k.descriptor().kind.to_string()).collect::<Vec<_>>(),
        }),
        Err(e) => json!({ "file": path.display().to_string(), "by": by, "error": e.message, "help": e.help }),
    }
}
