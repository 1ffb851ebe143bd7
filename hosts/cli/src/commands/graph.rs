//! `asperity graph`: draws a graph.

use std::path::PathBuf;

use asperity_offline::picture::picture;

use crate::failure::{Failure, print};
use crate::kinds::Kinds;
use crate::load::files::files_read;
use crate::load::{self, GraphArgs, Loaded};
use crate::output::{apart, named, write_text};

/// Draw a graph as a picture
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&["asperity graph graphs/texture.ron --svg texture.svg"]))]
pub struct Args {
    #[command(flatten)]
    pub graph: GraphArgs,
    /// Picture file; - writes to the standard output
    #[arg(long, value_name = "F.svg")]
    pub svg: PathBuf,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let mut kinds = Kinds::new(&args.graph.plugins.plugin).looking();
    let Loaded { graph, compiled, .. } = load::load(&args.graph, &mut kinds)?;
    let schedule = compiled.schedule;
    apart(files_read(&args.graph, &schedule, kinds.files()), named(&[("--svg", Some(&args.svg))]))?;
    write_text(&args.svg, &picture(&graph, &schedule).to_svg())?;
    print(&format!("wrote {}\n", args.svg.display()))
}
