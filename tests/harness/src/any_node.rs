//! Graphs of one node of any kind, by what its descriptor says.

use asperity_engine::{Engine, Options};
use asperity_graph::{Compiled, GraphFile};
use asperity_node::{
    Buffer, Complex, Config, Descriptor, Diagnostic, FrameClock, FrameLayout, FrameRate, Input, LayoutSpec,
    Node, NodeKind, Output, Param, Ports, Prepared, Processor, RateSpec, Registry, Role, Setup, ShapeSpec,
    Status, Tick, Unit, UnitSpec, random,
};

/// Signals of a source.
pub const SIGNALS: [&str; 6] = ["random", "zero", "denormal", "huge", "steps", "waves"];

fn value(signal: &str, seed: u64, index: u64) -> f64 {
    let noise = 2.0 * random::uniform(seed, index) - 1.0;
    match signal {
        "zero" => 0.0,
        "denormal" => 1e-310 * noise + f64::from(f32::MIN_POSITIVE) * 0.3 * noise,
        "huge" => 1e6 * noise,
        // Of 200 ticks as a control, 20000 samples as audio, through all of a threshold's range.
        "waves" => 600.0 * (1.0 - (index as f64 * std::f64::consts::TAU / 20_000.0).cos()),
        "steps" => noise.signum() * ((index / 37) % 3) as f64,
        _ => noise,
    }
}

/// Puts out a signal of any shape and unit.
struct Source {
    signal: String,
    seed: u64,
    clock: Option<(FrameClock, FrameLayout)>,
    rate_hz: u32,
}

fn layout(config: &Config<'_>) -> FrameLayout {
    let wanted = FrameRate::new(500, 1).expect("a rate");
    FrameLayout { rate_hz: 2500, length: 250, bins: 101, frame_rate: config.frame_clock(wanted).rate() }
}

impl Node for Source {
    fn descriptor() -> Descriptor {
        Descriptor::new("test_source", "Any signal.")
            .output(Output::new("out", ShapeSpec::Control(1), Unit::NONE))
            .param(Param::choice("signal", &SIGNALS, "Which."))
            .param(Param::text("shape", "", "Of which shape."))
            .param(Param::text("unit", "", "In which unit."))
            .param(Param::integer("count", 1, 0..=10_000, "Values of a control."))
            .param(Param::integer("rate_hz", 0, 0..=192_000, "Rate of audio; 0 for the graph's."))
    }

    fn ports(config: &Config<'_>, mut ports: Ports) -> Result<Ports, Diagnostic> {
        let p = config.params;
        ports.outputs[0].shape = match p.text("shape") {
            "audio" if p.integer("rate_hz") > 0 => {
                ShapeSpec::Audio(RateSpec::Hz(p.integer("rate_hz") as u32))
            }
            "audio" => ShapeSpec::Audio(RateSpec::Graph),
            "magnitude" => ShapeSpec::Magnitude(LayoutSpec::Is(layout(config))),
            "spectrum" => ShapeSpec::Spectrum(LayoutSpec::Is(layout(config))),
            _ => ShapeSpec::Control(p.integer("count") as usize),
        };
        ports.outputs[0].unit = UnitSpec::Is(Unit::from_symbol(p.text("unit")));
        Ok(ports)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let l = layout(&setup.config);
        let frames = matches!(p.text("shape"), "magnitude" | "spectrum");
        Ok(Prepared::new(Self {
            signal: p.text("signal").to_owned(),
            seed: setup.seed,
            clock: frames.then(|| (setup.frame_clock(l.frame_rate), l)),
            rate_hz: setup.output_rate(0),
        }))
    }
}

impl Processor for Source {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let (signal, seed) = (&self.signal, self.seed);
        if let Some((clock, l)) = &self.clock {
            let Some(frame) = clock.frame(tick.index) else { return Status::Quiet };
            let start = l.frame_rate.first_sample(frame, l.rate_hz);
            for (i, x) in tick.outputs.magnitude(0, frame, start).iter_mut().enumerate() {
                *x = value(signal, seed, frame * 1000 + i as u64).abs() as f32;
            }
            for (i, z) in tick.outputs.spectrum(0, frame, start).iter_mut().enumerate() {
                let i = frame * 1000 + 2 * i as u64;
                *z = Complex::new(value(signal, seed, i) as f32, value(signal, seed, i + 1) as f32);
            }
            return Status::Continue;
        }
        for (i, x) in tick.outputs.control(0).iter_mut().enumerate() {
            *x = value(signal, seed, tick.index * 100 + i as u64);
        }
        let span = tick.samples(self.rate_hz);
        for (x, n) in tick.outputs.audio(0).iter_mut().zip(span) {
            *x = value(signal, seed, n) as f32;
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}

pub fn registry() -> Registry {
    crate::registry().with::<Source>()
}

/// Parameters that a kind must be given.
fn required(kind: &str) -> Vec<(&'static str, String)> {
    let file = |p: &str| crate::graphs(p).display().to_string();
    match kind {
        "texture_network" => vec![
            ("model", file("models/surfaces/texture.onnx")),
            ("library", file("models/surfaces/materials.ron")),
            ("material", "canvas".to_owned()),
        ],
        "contact" => vec![("scene", file("../tests/data/near.ron"))],
        "file_out" => vec![("file", "unused.wav".to_owned())],
        "osc_input" => vec![("arguments", "x_mm, y_mm, z_mm, force_n".to_owned())],
        kind => crate::effects(kind),
    }
}

/// A graph of one node, each input fed by a source and each output read by a probe.
pub fn graph(kind: &NodeKind, signal: &str, tick_hz: u32, audio_hz: u32) -> GraphFile {
    let mut graph = GraphFile::empty("conformance");
    (graph.tick_hz, graph.audio_hz, graph.seed) = (tick_hz, audio_hz, 5);
    let d = kind.descriptor();
    let params = required(&d.kind);
    let params: Vec<(&str, &str)> = params.iter().map(|(n, v)| (*n, v.as_str())).collect();
    graph.add_node("it", &d.kind, &params, "test").unwrap();
    for Input { name, shape, unit, limited, .. } in &d.inputs {
        // A stroke that begins anew in every tick leaves nothing to remember.
        if name == "stroke" {
            continue;
        }
        // Nor does an effect that is another in every tick.
        let signal = if name == "slot" { "zero" } else { signal };
        let unit = match unit {
            UnitSpec::Is(u) => u.clone(),
            UnitSpec::Of { among, .. } => among.first().cloned().unwrap_or(Unit::NEWTON),
        };
        let count = if let ShapeSpec::Control(n) = shape { n.to_string() } else { "1".into() };
        // A rate of its own where the node takes any, so that it is not always the graph's.
        let (word, rate) = match shape {
            ShapeSpec::Like(_) | ShapeSpec::Audio(RateSpec::Graph) => ("audio", "0"),
            ShapeSpec::Audio(_) => ("audio", "8000"),
            ShapeSpec::Control(_) => ("control", "0"),
            ShapeSpec::Magnitude(_) => ("magnitude", "0"),
            ShapeSpec::Spectrum(_) => ("spectrum", "0"),
        };
        let source = format!("source {name}");
        let quoted = format!("{:?}", unit.symbol());
        let settings =
            [("signal", signal), ("shape", word), ("unit", &quoted), ("count", &count), ("rate_hz", rate)];
        graph.add_node(&source, "test_source", &settings, "test").unwrap();
        if *limited {
            graph.add_node("guard", "limiter", &[], "test").unwrap();
            graph.add_wire(&source, "guard", "test");
            graph.add_wire("guard", &format!("it.{name}"), "test");
        } else {
            graph.add_wire(&source, &format!("it.{name}"), "test");
        }
    }
    for output in &d.outputs {
        // A recorded force or speed is there only where the file has it.
        if d.role == Some(Role::Stroke) && output.name != "position" {
            continue;
        }
        let probe = format!("probe {}", output.name);
        graph.add_node(&probe, "probe", &[], "test").unwrap();
        graph.add_wire(&format!("it.{}", output.name), &probe, "test");
    }
    graph
}

/// The graph and its nodes.
pub fn compiled(graph: &GraphFile) -> Compiled {
    crate::graph::compiled(graph, &registry())
}

pub fn engine(graph: &GraphFile) -> Engine {
    Engine::new(compiled(graph), Options::default())
}

/// All that the node puts out over some ticks, as bits.
pub fn run(engine: &mut Engine, ticks: u64) -> Vec<u64> {
    let it = engine.schedule().index_of("it").expect("the node");
    let outputs = engine.schedule().nodes[it].outputs.len();
    let mut out = Vec::new();
    for _ in 0..ticks {
        engine.tick();
        for o in 0..outputs {
            match engine.output(it, o).expect("an output") {
                Buffer::Control { values, .. } => out.extend(values.iter().map(|x| x.to_bits())),
                Buffer::Audio { samples, len, .. } => {
                    out.extend(samples[..*len].iter().map(|x| u64::from(x.to_bits())));
                }
                Buffer::Magnitude { bins, frame: Some(f), .. } => {
                    out.push(f.0);
                    out.extend(bins.iter().map(|x| u64::from(x.to_bits())));
                }
                Buffer::Spectrum { bins, frame: Some(f), .. } => {
                    out.push(f.0);
                    out.extend(
                        bins.iter().map(|z| u64::from(z.re.to_bits()) << 32 | u64::from(z.im.to_bits())),
                    );
                }
                _ => out.push(u64::MAX),
            }
        }
    }
    out
}
