use super::*;
use asperity_diagnostics::Source;
use asperity_engine::Options;
use asperity_graph::{Compiled, GraphFile, compile};
use asperity_node::{
    Descriptor, Input, NodeKind, Output, Param, Prepared, Processor, Registry, Resume, Setup, ShapeSpec,
    Status, Tick, Unit,
};
use ringbuf::HeapRb;
use ringbuf::traits::Split;

/// A surface of some stiffness, or a wall that takes one.
struct Surface(Option<f64>);

impl Processor for Surface {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        if let Some(stiffness) = self.0 {
            tick.outputs.control(0).fill(1.0);
            tick.outputs.set(1, stiffness);
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}

fn registry() -> Registry {
    let input = |name, values| Input::new(name, ShapeSpec::Control(values), Unit::NONE);
    let surface = Descriptor::new("surface", "A surface.")
        .output(Output::new("plane", ShapeSpec::Control(3), Unit::NONE))
        .output(Output::new("stiffness", ShapeSpec::Control(1), Unit::NONE))
        .param(Param::number("stiffness", 1.0, 0.0..=10.0, "Stiffness."));
    let wall = Descriptor::new("wall", "Takes a surface.").resumes(Resume::Never).sink();
    let wall = wall.input(input("plane", 3)).input(input("normal", 3));
    let wall = wall.input(input("stiffness", 1)).input(input("damping", 1));
    let stiff = |setup: &Setup<'_>| Ok(Prepared::new(Surface(Some(setup.params.number("stiffness")))));
    let mut registry = Registry::new();
    registry.add(Arc::new(NodeKind::new(surface, stiff)));
    registry.add(Arc::new(NodeKind::new(wall, |_| Ok(Prepared::new(Surface(None))))));
    registry
}

fn compiled(stiffness: f64) -> Compiled {
    let text = format!(
        r#"Graph(version: 1, tick_hz: 500, audio_hz: 48000, seed: 1, nodes: {{
            "it": (kind: "surface", params: (stiffness: {stiffness:.1})), "wall": (kind: "wall") }},
        wires: [("it.plane", "wall.plane"), ("it.plane", "wall.normal"), ("it.stiffness", "wall.stiffness"),
            ("it.stiffness", "wall.damping")])"#
    );
    let graph = GraphFile::parse(&Source::new("test.ron", &text)).expect("a graph");
    compile(&graph, &registry(), Default::default()).expect("it compiles")
}

/// A wiring that looks at its stiffness and pushes back with it.
fn wiring(
    swap: u64,
    compiled: &Compiled,
    writer: crate::ForceWriter,
) -> (Box<Wiring>, ringbuf::HeapCons<f32>) {
    let at = |id: &str| compiled.schedule.index_of(id).expect("the node");
    let (to, seen) = HeapRb::new(100).split();
    let wiring = Wiring {
        swap,
        limiters: Vec::new(),
        outs: Vec::new(),
        hands: Vec::new(),
        mics: Vec::new(),
        forces: vec![(at("wall"), 3.0, Arc::new(parking_lot::Mutex::new(writer)))],
        scopes: vec![Scope { node: at("it"), output: 1, attenuated: false, to }],
        tapes: Vec::new(),
        stylus: None,
        meters: Arc::new(NodeMeters::new(&compiled.schedule, None)),
        spent: vec![0; compiled.schedule.nodes.len()],
    };
    (Box::new(wiring), seen)
}

#[test]
fn graph_without_its_wiring_releases_forces_and_scopes() {
    let first = compiled(2.0);
    let (writer, mut model) = crate::force_model();
    let (begin, mut seen) = wiring(0, &first, writer);
    let (mut controller, engine) = Engine::controlled(first, Options::default());
    let (mut wirings, to_player) = HeapRb::new(2).split();
    let (from_player, _retired) = HeapRb::new(2).split();
    let mut player = Player::new(engine, begin, None, Default::default(), to_player, from_player);
    let mut tick = |player: &mut Player| {
        let now = *{
            player.tick(0, &mut [0.0; 96]);
            model.read()
        };
        (now.valid, now.stiffness_n_per_mm, seen.pop_iter().count())
    };
    assert_eq!(tick(&mut player), (true, 2.0, 1));

    let second = compiled(5.0);
    let (writer, mut next_model) = crate::force_model();
    let (next, mut next_seen) = wiring(1, &second, writer);
    controller.swap(second, &[]).expect("it is sent");
    for _ in 0..20 {
        assert_eq!(tick(&mut player), (false, 0.0, 0), "no wiring was sent");
    }
    assert!(wirings.try_push(next).is_ok());
    let _ = tick(&mut player);
    let _ = tick(&mut player);
    assert_eq!((next_model.read().valid, next_model.read().stiffness_n_per_mm), (true, 5.0));
    assert!(next_seen.pop_iter().count() > 0);
}
