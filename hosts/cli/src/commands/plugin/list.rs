//! `asperity plugin list`: the plugins that are found, and where.

use asperity_loader::{Found, Loader, PATH_VARIABLE};
use serde_json::json;

use crate::failure::{Failure, print_report};
use crate::kinds::{named_plugin, plugins_on_path};
use crate::load::PluginArgs;

/// List the plugins that are found, their files and their kinds of nodes
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&["asperity plugin list"]))]
pub struct Args {
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Runs the command. A plugin that does not load is a row like any other.
pub fn run(args: &Args) -> Result<(), Failure> {
    let mut loader = Loader::default();
    let mut files = Vec::new();
    for name in &args.plugins.plugin {
        files.push((named_plugin(name)?, "--plugin".to_owned()));
    }
    for Found { path, by } in plugins_on_path() {
        files.push((path, format!("{PATH_VARIABLE}, {}", by.display())));
    }
    let (mut out, mut all) = (String::new(), Vec::new());
    for (path, by) in files {
        let file = path.display().to_string();
        match loader.load(&path) {
            Ok(plugin) => {
                let (name, version) = (plugin.name(), plugin.version());
                out += &format!("{name} {version}\n  {file}  (by {by})\n");
                let kinds: Vec<_> = plugin.kinds().iter().map(|k| k.descriptor()).collect();
                let width = kinds.iter().map(|d| d.kind.len()).max().unwrap_or(0);
                kinds.iter().for_each(|d| out += &format!("    {:width$}  {}\n", d.kind, d.summary));
                let kinds: Vec<String> = kinds.iter().map(|d| d.kind.to_string()).collect();
                all.push(json!({ "file": file, "by": by, "name": name, "version": version, "kinds": kinds }));
            }
            Err(e) => {
                let help = e.help.as_ref().map(|h| format!("\n    {h}")).unwrap_or_default();
                out += &format!("does not load\n  {file}  (by {by})\n    {}{help}\n", e.message);
                all.push(json!({ "file": file, "by": by, "error": e.message, "help": e.help }));
            }
        }
    }
    if all.is_empty() {
        out = format!(
            "no plugins: {PATH_VARIABLE} names no folder with a shared library in it\n\
             asperity plugin new NAME makes one; a graph file names its own: plugins: [\"libmine.so\"]\n"
        );
    }
    print_report(args.json, || all, || out)
}
