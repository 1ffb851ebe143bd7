//! Hard cases that stay stable: one file a family. A case lives in `core/stability`, where `asperity selftest` runs it too; here it must hold for
//! what is shipped, and fail for a mutant that is broken on purpose. What has no graph stands here alone.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/counting.rs"]
mod counting;
#[path = "../common/stage.rs"]
mod stage;

mod actuator;
mod autoregressive;
mod faults;
mod files;
mod filters_and_rates;
mod friction;
mod graphs;
mod motion;
mod networks;
mod phase;
mod stiff_walls;

use asperity_graph::GraphFile;
use asperity_scene::{Lowering, lower};
use asperity_stability::{Case, Effort, Outcome, Subject, Verdict, cases};
use asperity_world::scene::Scene;

/// How long cases may take here; `ASPERITY_STABILITY=long` asks for all there is.
fn effort() -> Effort {
    match std::env::var("ASPERITY_STABILITY").as_deref() {
        Ok("long") => Effort::Long,
        Ok("quick") => Effort::Quick,
        _ => Effort::Full,
    }
}

/// A case by its name.
fn case(name: &str) -> &'static Case {
    cases().into_iter().find(|case| case.name == name).unwrap_or_else(|| panic!("there is no case `{name}`"))
}

/// A shipped graph.
fn graph(name: &str) -> GraphFile {
    GraphFile::read(common::graphs(name)).expect("a shipped graph")
}

/// The graph of a scene.
fn lowered(path: &std::path::Path) -> GraphFile {
    let scene = Scene::read(path).expect("a scene");
    lower(&scene, &asperity_nodes::registry(), Lowering::default()).expect("a graph").graph
}

/// The graph of a shipped scene.
fn scene(name: &str) -> GraphFile {
    lowered(&common::graphs("scenes").join(name))
}

/// The built-in kinds, with a graph or without.
fn subject(graph: Option<&GraphFile>) -> Subject<'_> {
    let subject = Subject::new(asperity_nodes::registry()).effort(effort());
    if let Some(graph) = graph { subject.graph(graph) } else { subject }
}

/// A case holds; answers what it found.
fn holds(name: &str, subject: &Subject<'_>) -> String {
    let Outcome { verdict, found } = case(name).run(subject);
    assert_eq!(verdict, Verdict::Holds, "{name}: {found}");
    println!("{name}: {found}");
    found
}

/// A case fails for a mutant, for a reason in which these words stand.
fn fails(name: &str, mutant: &Subject<'_>, why: &str) {
    let Outcome { verdict, found } = case(name).run(mutant);
    assert_eq!(verdict, Verdict::Fails, "{name} does not see the mutant: {found}");
    assert!(found.contains(why), "{name} fails for another reason: {found}");
}
