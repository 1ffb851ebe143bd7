//! Tests of the graph of a scene, against a table of the nodes that each effect needs.

use std::collections::BTreeSet;
use std::path::Path;

use crate::Scene;
use asperity_diagnostics::Source;
use asperity_graph::GraphFile;
use asperity_node::{Descriptor, Diagnostic, Node, Prepared, Processor, Registry, Role, Setup, Status, Tick};

use crate::{Lowering, Rendered, lower};

/// An effect as a file names it, and the kinds of nodes that it needs beyond those of touching.
const NEEDS: [(&str, &[&str]); 9] = [
    ("friction: dahl", &["friction"]),
    (
        "texture: network",
        &["action_history", "texture_network", "shaped_noise", "resample", "level", "speed_gate"],
    ),
    (
        "texture: autoregressive(model: \"models/made_ar/rough.ron\")",
        &["autoregressive", "level", "speed_gate"],
    ),
    ("texture: waveform(segments: [(0, 0), (1, 2), (2, 0)])", &["waveform", "level", "speed_gate"]),
    (
        "texture: relief(heights: made(surface: \"hessian\", side: 16, step_mm: 0.1))",
        &["relief", "level", "speed_gate"],
    ),
    ("tap: (sinusoids: [(frequency_hz: 200, decay_ms: 10, gain: 30)])", &["tap"]),
    ("vibration: (frequency_hz: 120, amplitude_m_s2: 2)", &["vibration"]),
    ("viscosity: (viscosity_ns_per_m: 1)", &["viscosity"]),
    ("magnet: (stiffness_n_per_mm: 0.2, max_force_n: 0.5, reach_mm: 3)", &["magnet"]),
];

/// Effects of [`NEEDS`] that push, if only by the wall that they need, and effects that vibrate.
const FORCES: [usize; 8] = [0, 1, 2, 3, 4, 5, 7, 8];
const SOUNDS: [usize; 6] = [1, 2, 3, 4, 5, 6];

/// Makes a scene in the folder of the shipped graphs. Each effect has a surface of its own.
fn scene(shape: &str, effects: &[String]) -> Result<Scene, asperity_diagnostics::Diagnostic> {
    let surfaces: Vec<String> = effects
        .iter()
        .enumerate()
        .map(|(i, effects)| {
            let x = 30 * i;
            let walled = ["friction", "texture", "tap"].iter().any(|word| effects.starts_with(word));
            let effects = if walled { format!("{WALL}{effects}") } else { effects.clone() };
            let material = if effects.contains("network") { "material: \"oak\", " } else { "" };
            format!("\"{i}\": (shape: {shape}, place_mm: ({x}, 0, 0), {material}effects: ({effects}))")
        })
        .collect();
    let text = format!(
        "Scene(version: 1, input: stroke(duration_s: 2), device: (damping_ns_per_m: 2),
         network: (model: \"models/surfaces/texture.onnx\", library: \"models/surfaces/materials.ron\"),
         output: audio_out(), surfaces: {{{}}})",
        surfaces.join(", ")
    );
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../graphs/made.ron");
    Scene::parse(&Source::new(path.display().to_string(), text))
}

const WALL: &str = "stiffness: (stiffness_n_per_mm: 0.5), ";
const TILE: &str = "rectangle(size_mm: (20, 20))";

fn graph(scene: &Scene, registry: &Registry, prune: bool) -> GraphFile {
    lower(scene, registry, Lowering { prune }).unwrap_or_else(|e| panic!("{e:?}")).graph
}

fn kinds(graph: &GraphFile) -> BTreeSet<&str> {
    graph.nodes.iter().map(|node| node.kind.as_str()).collect()
}

fn effects(which: impl Fn(usize) -> bool) -> Vec<String> {
    (0..NEEDS.len()).filter(|i| which(*i)).map(|i| NEEDS[i].0.to_owned()).collect()
}

#[test]
fn every_subset_of_effects_builds_exactly_its_nodes() {
    let registry = asperity_nodes::registry();
    for subset in 1..1_u32 << NEEDS.len() {
        let has = |i: usize| subset >> i & 1 == 1;
        // Reading the library takes longest.
        if has(1) && subset % 7 != 0 {
            continue;
        }
        let scene = scene(TILE, &effects(has)).unwrap();
        let graph = graph(&scene, &registry, true);
        let mut wanted = BTreeSet::from(["stroke", "velocity", "contact"]);
        for (_, needs) in NEEDS.iter().enumerate().filter(|(i, _)| has(*i)).map(|(_, needs)| needs) {
            wanted.extend(needs.iter());
        }
        if FORCES.iter().any(|i| has(*i)) {
            wanted.extend(["mix", "force_limiter", "probe"]);
        }
        if SOUNDS.iter().any(|i| has(*i)) {
            wanted.extend(["mix", "actuator_inverse", "limiter", "audio_out"]);
        }
        assert_eq!(kinds(&graph), wanted, "{subset:09b}");
        // Each kind has one node, or one for each of two voices.
        for kind in ["contact", "texture_network", "friction", "tap", "vibration", "viscosity", "magnet"] {
            assert!(graph.nodes.iter().filter(|n| n.kind == kind).count() <= 1, "{subset:09b}: {kind}");
        }
        for kind in ["autoregressive", "waveform", "relief"] {
            assert!(graph.nodes.iter().filter(|n| n.kind == kind).count() <= 2, "{subset:09b}: {kind}");
        }
    }
}

#[test]
fn without_pruning_every_scene_has_the_same_nodes() {
    let registry = asperity_nodes::registry();
    let all = scene(TILE, &effects(|_| true)).unwrap();
    let wanted: Vec<String> = graph(&all, &registry, false).nodes.into_iter().map(|n| n.id).collect();
    for some in [vec![String::new()], effects(|i| i == 3), effects(|i| i % 2 == 0)] {
        let scene = scene(TILE, &some).unwrap();
        let graph = graph(&scene, &registry, false);
        let ids: Vec<String> = graph.nodes.iter().map(|n| n.id.clone()).collect();
        assert_eq!(ids, wanted, "{some:?}");
    }
}

#[test]
fn the_graph_does_not_grow_with_the_number_of_surfaces() {
    let registry = asperity_nodes::registry();
    let nodes = |copies: usize| {
        let all = effects(|_| true);
        let many: Vec<String> = (0..copies).flat_map(|_| all.clone()).collect();
        let graph = graph(&scene(TILE, &many).unwrap(), &registry, true);
        (graph.nodes.len(), graph.wires.len(), graph.to_string())
    };
    assert_eq!(nodes(1), nodes(40));
}

#[test]
fn one_face_needs_one_voice_and_a_ball_or_a_second_surface_two() {
    let registry = asperity_nodes::registry();
    let voices = |shape: &str, surfaces: usize| {
        let texture = NEEDS[3].0.to_owned();
        let scene = scene(shape, &vec![texture; surfaces]).unwrap();
        graph(&scene, &registry, true).nodes.iter().filter(|n| n.kind == "waveform").count()
    };
    assert_eq!(voices("plane", 1), 1);
    assert_eq!(voices(TILE, 1), 1);
    assert_eq!(voices("sphere(radius_mm: 5)", 1), 2);
    assert_eq!(voices("box(size_mm: (5, 5, 5))", 1), 2);
    assert_eq!(voices(TILE, 2), 2);
}

#[test]
fn nodes_that_render_each_kind_are_in_the_graph() {
    let registry = asperity_nodes::registry();
    let scene = scene(TILE, &effects(|_| true)).unwrap();
    let lowered = lower(&scene, &registry, Lowering::default()).unwrap();
    let kinds: Vec<&str> = lowered.rendered.iter().map(|of| of.kind.as_str()).collect();
    let all = "network friction tap viscosity vibration magnet autoregressive waveform relief";
    assert_eq!(kinds.join(" "), all);
    let mut seen = BTreeSet::new();
    for Rendered { kind, nodes: ids, .. } in &lowered.rendered {
        assert!(!ids.is_empty(), "{kind:?}");
        for id in ids {
            assert!(lowered.graph.node(id).is_some(), "{kind:?}: {id}");
            assert!(seen.insert(id), "{id} renders two kinds");
        }
    }
}

/// A node that pushes back, like those that device hosts add.
struct Push;

impl Node for Push {
    fn descriptor() -> Descriptor {
        Descriptor::new("push_force", "Pushes.").role(Role::Force)
    }

    fn prepare(_setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self))
    }
}

impl Processor for Push {
    fn process(&mut self, _tick: &mut Tick<'_>) -> Status {
        Status::Continue
    }

    fn reset(&mut self) {}
}

/// Replaces something in a scene and answers the error: message, text at its place, help.
fn wrong(effects: &str, (from, to): (&str, &str)) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../graphs/made.ron").display().to_string();
    let text = scene(TILE, &[effects.to_owned()]).unwrap().source.text().replacen(from, to, 1);
    assert!(text.contains(to));
    let source = Source::new(path, text);
    let registry = asperity_nodes::registry().with::<Push>();
    let found = Scene::parse(&source).and_then(|s| lower(&s, &registry, Lowering::default())).unwrap_err();
    let place = found.place.expect("a place");
    let at = &source.text()[place.span.start..place.span.end];
    format!("{} | {at} | {}", found.message, found.help.unwrap_or_default())
}

#[test]
fn scene_that_cannot_be_lowered_is_refused_with_place() {
    let network = NEEDS[1].0;
    let cases = [
        (network, ("\"oak\"", "\"oka\""), "`oka`", "\"oka\"", "oak"),
        (network, ("stroke(", "sine("), "has no position of a stylus", "", "trajectory"),
        (network, ("stroke(", "strok("), "no node of the kind `strok`", "strok", "stroke"),
        (network, ("audio_out()", "audio_uot()"), "`audio_uot`", "audio_uot", "audio_out"),
        (
            network,
            ("texture.onnx\"", "texture.onnx\", material: \"oak\""),
            "materials are those of its surfaces",
            "material",
            "beside `shape`",
        ),
        (
            network,
            ("output:", "actuator: (profil: \"hapcoil_one\"), output:"),
            "no field `profil`",
            "profil",
            "profile",
        ),
        (
            NEEDS[0].0,
            ("(damping_ns_per_m: 2)", "(damping_ns_per_m: 2, output: audio_out())"),
            "not a node of force feedback",
            "audio_out",
            "push_force",
        ),
    ];
    for (effects, replace, message, at, help) in cases {
        let said = wrong(effects, replace);
        let parts: Vec<&str> = said.splitn(3, " | ").collect();
        assert!(
            parts[0].contains(message) && parts[1].contains(at) && parts[2].contains(help),
            "{replace:?}: {said}"
        );
    }
}
