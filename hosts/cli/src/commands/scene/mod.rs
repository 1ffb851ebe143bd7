//! `asperity scene`: what a scene lowers to, and why.

mod account;
mod explain;
mod models;

use std::process::ExitCode;

use asperity_diagnostics::Diagnostic;
use asperity_diagnostics::ron::{Kind as Form, Value};
use asperity_graph::{GraphFile, Schedule};
use asperity_node::ParamValue;

use crate::args::{Expand, SceneCommand};
use crate::failure::{Failure, print};
use crate::kinds::Kinds;
use crate::{load, output};

/// Runs the command.
pub fn run(command: &SceneCommand) -> Result<ExitCode, Failure> {
    match command {
        SceneCommand::Expand(args) => expand(args),
        SceneCommand::Explain(args) => explain::run(args),
    }
}

/// Prints the graph that a scene lowers to.
fn expand(args: &Expand) -> Result<ExitCode, Failure> {
    let mut kinds = Kinds::new(&args.scene.plugins.plugin);
    let (mut graph, of_scene) = load::read_all(&args.scene, &mut kinds)?;
    if of_scene.is_none() {
        return Err(no_scene(&args.scene.graph).into());
    }
    // What does not compile is no graph to go on from.
    let registry = kinds.registry(Some(&graph))?;
    let compiled = load::compiled(&graph, &args.scene, &registry)?;
    at_home(&mut graph, &compiled.schedule);
    let scene = args.scene.graph.display();
    let text = format!(
        "// What {scene} lowers to. Paths are relative to its folder, and `contact` reads the surfaces in it.\n// What its device bears is checked of the scene, not of this graph.\n{graph}"
    );
    let Some(out) = &args.out else {
        print(&text)?;
        return Ok(ExitCode::SUCCESS);
    };
    let folder = |path: &std::path::Path| output::resolved(path).parent().map(std::path::Path::to_path_buf);
    if output::resolved(out) == output::resolved(&args.scene.graph) {
        return Err(Diagnostic::new("the scene would be overwritten by its graph")
            .in_file(out)
            .help("name another file in the same folder")
            .into());
    }
    let read = load::files_read(&args.scene, &compiled.schedule).into_iter();
    let plugins = kinds.files().iter().map(|file| (file.clone(), "a plugin".to_owned()));
    if let Some((_, who)) =
        read.chain(plugins).find(|(file, _)| output::resolved(file) == output::resolved(out))
    {
        return Err(Diagnostic::new(format!("{who} reads this file, and it would be overwritten"))
            .in_file(out)
            .help("name another file in the same folder")
            .into());
    }
    if folder(out) != folder(&args.scene.graph) {
        return Err(Diagnostic::new("the graph's paths are relative to the scene's folder")
            .in_file(out)
            .help("name a file in the folder of the scene")
            .into());
    }
    output::write_text(out, &text)?;
    print(&format!("wrote {}\n", out.display()))?;
    Ok(ExitCode::SUCCESS)
}

/// Files that the command line names are relative to where the program runs, those of a graph to its folder.
fn at_home(graph: &mut GraphFile, schedule: &Schedule) {
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

/// A graph, where a scene is wanted.
fn no_scene(file: &std::path::Path) -> Diagnostic {
    Diagnostic::new("this is a graph, not a scene")
        .in_file(file)
        .help("a scene begins with `Scene(`; graphs/scenes has some")
}
