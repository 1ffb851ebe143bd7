//! `asperity scene`: the graph that a scene lowers to, and why.

mod explain;

use std::path::{Path, PathBuf};

use asperity_diagnostics::ron::{Kind as Form, Value};
use asperity_graph::{GraphFile, Schedule};
use asperity_node::ParamValue;
use clap::Subcommand;

use crate::failure::{Failure, print, wrong};
use crate::kinds::Kinds;
use crate::load::files::files_read;
use crate::load::{self, GraphArgs, Loaded, OfScene};
use crate::number::number;
use crate::output::{apart, named, resolved, write_text};

/// Print the graph of a scene, or explain its parts, their reasons and their cost
#[derive(Debug, Subcommand)]
pub enum Command {
    Expand(Expand),
    Explain(Explain),
}

/// Print the graph that a scene lowers to, ready to edit
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&["asperity scene expand graphs/scenes/side_by_side.ron"]))]
pub struct Expand {
    #[command(flatten)]
    pub scene: GraphArgs,
    /// Output file in the scene's folder: the paths in the graph are relative to it
    #[arg(long, value_name = "G.ron")]
    pub out: Option<PathBuf>,
}

/// Explain which effects, nodes and models are built, why, and their cost per tick
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&[
    "asperity scene explain graphs/scenes/every_effect.ron",
]))]
pub struct Explain {
    #[command(flatten)]
    pub scene: GraphArgs,
    /// Duration of the stroke to run; by default all of it, at most 60 s
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = number(0.002, 3600.0, "s"))]
    pub seconds: Option<f64>,
    /// Run every node in every tick
    #[arg(long)]
    pub no_sleep: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

pub fn run(command: &Command) -> Result<(), Failure> {
    match command {
        Command::Expand(args) => expand(args),
        Command::Explain(args) => explain::run(args),
    }
}

fn expand(args: &Expand) -> Result<(), Failure> {
    let mut kinds = Kinds::new(&args.scene.plugins.plugin);
    let (Loaded { mut graph, compiled, .. }, _) = load_scene(&args.scene, &mut kinds)?;
    make_absolute(&mut graph, &compiled.schedule);
    let scene = args.scene.graph.display();
    let text = format!(
        "// What {scene} lowers to. Paths are relative to its folder, \
         and `contact` reads the surfaces in it.\n\
         // Passivity is checked of the scene, not of this graph.\n{graph}"
    );
    let Some(out) = &args.out else {
        return print(&text);
    };
    apart(files_read(&args.scene, &compiled.schedule, kinds.files()), named(&[("--out", Some(out))]))?;
    let folder = |path: &Path| resolved(path).parent().map(Path::to_path_buf);
    if folder(out) != folder(&args.scene.graph) {
        return Err(wrong(
            out,
            "the graph's paths are relative to the scene's folder",
            "name a file in the folder of the scene",
        ));
    }
    write_text(out, &text)?;
    print(&format!("wrote {}\n", out.display()))
}

/// Makes paths of the command line absolute: those in a graph are relative to its folder.
fn make_absolute(graph: &mut GraphFile, schedule: &Schedule) {
    for decl in &mut graph.nodes {
        let Some(node) = schedule.index_of(&decl.id).map(|i| &schedule.nodes[i]) else { continue };
        for setting in decl.params.iter_mut().filter(|setting| setting.typed.is_some()) {
            let Some(ParamValue::File(path)) = node.params.get(&setting.name) else { continue };
            if let Ok(path) = std::path::absolute(path) {
                setting.value = Value::made(Form::Text(path.display().to_string()), &setting.place);
            }
        }
    }
}

fn load_scene(args: &GraphArgs, kinds: &mut Kinds) -> Result<(Loaded, OfScene), Failure> {
    let (graph, scene) = load::read(args, kinds)?;
    let Some(scene) = scene else {
        return Err(wrong(
            &args.graph,
            "this is a graph, not a scene",
            "a scene begins with `Scene(`; graphs/scenes has some",
        ));
    };
    Ok((load::compile(args, kinds, graph, None)?, scene))
}
