//! A node of the SDK behind the interface is the same node: descriptor, parameters, ports, buffers, statuses,
//! state, errors.

use crate::Plugin;
use asperity_sdk::{
    Buffer, Complex, Config, Descriptor, Diagnostic, Fact, Fault, FrameLayout, FrameRate, Input, InputRef,
    Inputs, Latency, LayoutSpec, Node, NodeKind, Output, Outputs, Param, ParamValue, Params, PortType, Ports,
    Prepared, Processor, RateSpec, Registry, Resume, Setup, Shape, ShapeSpec, State, Status, Tick, Unit,
    Wiring,
};

static VOLT_OR_AMPERE: [Unit; 2] = [Unit::VOLT, Unit::AMPERE];

/// Every kind of port and parameter, and every answer.
struct Everything {
    said: String,
    sum: f64,
    gain: f64,
}

impl Node for Everything {
    fn descriptor() -> Descriptor {
        Descriptor::new("everything", "Has one of each.")
            .input(Input::new("force", ShapeSpec::Control(2), Unit::NEWTON).doc("a pair").wakes().or(0.5))
            .input(
                Input::new("sound", ShapeSpec::Audio(RateSpec::Of('r')), Unit::NONE).unit_of('u').doc("any"),
            )
            .input(
                Input::new("magnitude", ShapeSpec::Magnitude(LayoutSpec::Of('l')), Unit::NONE)
                    .unit_among('v', &VOLT_OR_AMPERE)
                    .doc("frames"),
            )
            .output(Output::new("force", ShapeSpec::Control(2), Unit::NEWTON).doc("twice that"))
            .output(
                Output::new("sound", ShapeSpec::Audio(RateSpec::Of('r')), Unit::NONE)
                    .unit_of('u')
                    .doc("the same"),
            )
            .output(
                Output::new("spectrum", ShapeSpec::Spectrum(LayoutSpec::Of('l')), Unit::NONE)
                    .unit_of('v')
                    .doc("frames"),
            )
            .param(Param::number("gain", 2.0, 0.0..=8.0, "A number.").unit("dB").live())
            .param(Param::integer("count", 3, -5..=i64::MAX, "A whole number.").optional())
            .param(Param::flag("flag", true, "A flag."))
            .param(Param::text("say", "hello", "What to do."))
            .param(Param::choice("word", &["one", "two"], "A choice.").live())
            .param(Param::file("file", "A file.").optional())
            .param(Param::numbers("list", &[1.0, 2.0], 0.0..=9.0, "A list."))
            .param(Param::texts("texts", "Texts."))
            .param(Param::number("needed", 0.0, 0.0..=1.0, "Must be set.").required())
            .resumes(Resume::Elapsed)
            .timing("Latency as it says.")
    }

    fn ports(config: &Config<'_>, mut ports: Ports) -> Result<Ports, Diagnostic> {
        if config.params.text("say") == "bad ports" {
            return Err(config.params.error("say", "no such ports").help("others"));
        }
        let count = config.params.numbers("list").len();
        ports.inputs[0].shape = ShapeSpec::Control(count);
        ports.outputs[0].shape = ShapeSpec::Control(count);
        Ok(ports)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        match setup.params.text("say") {
            "bad word" => return Err(setup.params.error("word", "not this word").help("the other")),
            "bad node" => return Err(setup.params.node_error("this cannot be")),
            "panic early" => panic!("early"),
            _ => {}
        }
        let p = setup.params;
        let ports = setup.inputs.iter().map(|w| (w.port.as_ref().map(ToString::to_string), w.connected));
        let place = (setup.id, setup.tick_hz, setup.every, setup.audio_hz, setup.seed, setup.resolve("say"));
        let plain = (p.get_integer("count"), p.flag("flag"), p.text("word"), p.get("file"));
        let lists = (p.numbers("list"), p.texts("texts"), p.number("needed"));
        let set = (p.is_set("gain"), p.is_set("needed"));
        let said = format!("{place:?} {plain:?} {lists:?} {set:?} {:?}", ports.collect::<Vec<_>>());
        let it = Prepared::new(Self { said, sum: 0.0, gain: p.number("gain") });
        let it = it.latency(Latency::ratio(-7, 3)).duration(Some(Latency::ratio(5, 1)));
        Ok(Prepared { allocation_free: false, ..it })
    }
}

impl Processor for Everything {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        match tick.index {
            100 => return Status::Quiet,
            101 => return Status::Tail(7),
            102 => return Status::Asleep,
            103 => return Status::Error(42),
            104 => panic!("as told"),
            _ => {}
        }
        self.sum += tick.inputs.control(0).iter().sum::<f64>();
        for i in 0..tick.inputs.control(0).len() {
            let x = tick.inputs.control(0)[i];
            tick.outputs.control(0)[i] = self.gain * x;
        }
        if !tick.inputs.audio(1).is_empty() {
            let input = tick.inputs.audio(1);
            tick.outputs.audio(1).copy_from_slice(input);
        }
        if let Some(frame) = tick.inputs.magnitude(2) {
            let out = tick.outputs.spectrum(2, frame.index, frame.start);
            for (z, m) in out.iter_mut().zip(frame.bins) {
                *z = Complex::new(*m, -m);
            }
        }
        Status::Continue
    }

    fn elapsed(&mut self, ticks: u64) {
        self.sum += 1000.0 * ticks as f64;
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        if index == 0 {
            self.gain = value;
        } else {
            panic!("only the gain");
        }
    }

    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.sum);
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![
            Fact::text("said", self.said.clone()),
            Fact::number("sum", self.sum, "N"),
            Fact::count("answer", 42),
        ]
    }

    fn reset(&mut self) {
        self.sum = 0.0;
    }
}

/// Something beside it.
struct Gate(bool);

impl Node for Gate {
    fn descriptor() -> Descriptor {
        Descriptor::new("a_gate", "Open at even ticks.")
            .input(Input::new("in", ShapeSpec::Audio(RateSpec::Graph), Unit::NONE).doc("what it gates"))
            .output(Output::new("out", ShapeSpec::Audio(RateSpec::Graph), Unit::NONE).doc("that"))
            .param(Param::number("delay_ms", 1.0, 0.0..=9.0, "How long."))
            .gates("in")
            .closes_cycles("delay_ms")
            .passive_sink()
    }
    fn prepare(_: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self(false)))
    }
}

impl Processor for Gate {
    fn process(&mut self, _: &mut Tick<'_>) -> Status {
        if self.0 { Status::Quiet } else { Status::Continue }
    }
    fn wants(&mut self, tick: &mut Tick<'_>) -> bool {
        assert!(tick.index < 100);
        tick.index.is_multiple_of(2)
    }
    fn absorb(&mut self, tick: &mut Tick<'_>) {
        assert!(tick.index < 100);
        self.0 = tick.inputs.audio(0).first() == Some(&1.0);
    }
    fn reset(&mut self) {
        panic!("no way back");
    }
}

asperity_sdk::export!(Everything, Gate);

fn kinds() -> Vec<std::sync::Arc<NodeKind>> {
    Plugin::built_in(&asperity_entry).unwrap().kinds().to_vec()
}

fn direct() -> Registry {
    Registry::new().with::<Everything>().with::<Gate>()
}

fn params(set: &[(&str, ParamValue)]) -> Params {
    let mut params = Params::new(None);
    for p in &Everything::descriptor().params {
        let value = set.iter().find(|(n, _)| *n == p.name).map(|(_, v)| v.clone());
        let source = asperity_sdk::Source::new("some/where/g.ron", "x");
        let place = value.is_some().then(|| asperity_sdk::Place { source, span: Default::default() });
        params.insert(p.name.to_string(), value.or_else(|| p.default.clone()), place);
    }
    params
}

fn wirings() -> (Vec<Wiring>, Vec<Wiring>) {
    let port =
        |shape, unit: Unit| Wiring { port: Some(PortType { shape, unit, limited: false }), connected: true };
    let frame_rate = FrameRate::new(500, 1).unwrap();
    let l = FrameLayout { rate_hz: 2500, length: 250, bins: 5, frame_rate };
    (
        vec![
            port(Shape::Control { count: 3 }, Unit::NEWTON),
            port(Shape::Audio { rate_hz: 2500 }, Unit::VOLT),
            port(Shape::Magnitude(l), Unit::AMPERE),
        ],
        vec![
            port(Shape::Control { count: 3 }, Unit::NEWTON),
            port(Shape::Audio { rate_hz: 2500 }, Unit::VOLT),
            port(Shape::Spectrum(l), Unit::AMPERE),
        ],
    )
}

fn prepare(kind: &NodeKind, params: &Params) -> Result<Prepared, Diagnostic> {
    let (inputs, outputs) = wirings();
    let config = Config { id: "it", params, tick_hz: 500, every: 2, audio_hz: 48_000, seed: u64::MAX };
    kind.prepare(&Setup { config, inputs: &inputs, outputs: &outputs, closes_cycle: false })
}

fn settings() -> Vec<(&'static str, ParamValue)> {
    vec![
        ("gain", ParamValue::Number(3.0)),
        ("count", ParamValue::Integer(i64::MIN + 1)),
        ("word", ParamValue::Text("two".into())),
        ("file", ParamValue::File("a/b.csv".into())),
        ("list", ParamValue::Numbers(vec![1.0, 2.0, 3.0])),
        ("texts", ParamValue::Texts(vec!["ä".into(), String::new()])),
        ("needed", ParamValue::Number(0.5)),
        ("say", ParamValue::Text("x.csv".into())),
    ]
}

/// Runs a few ticks, one of which `panics`, and returns everything that can be seen.
fn run(mut prepared: Prepared, panics: bool) -> String {
    let node = &mut *prepared.processor;
    let (inputs, outputs) = wirings();
    let mut buffers: Vec<Buffer> =
        inputs.iter().chain(&outputs).map(|w| Buffer::new(w.port.as_ref().unwrap(), 500)).collect();
    let map: Vec<InputRef> = (0..3).map(|i| InputRef { buffer: i, connected: true }).collect();
    let mut seen = String::new();
    for index in [0, 1, 2, 3, 100, 101, 102, 103, 104, 5] {
        if let Buffer::Control { values, changed, valid } = &mut buffers[0] {
            values.iter_mut().enumerate().for_each(|(i, x)| *x = index as f64 + 0.1 * i as f64);
            (*changed, *valid) = (index % 2 == 0, index != 2);
        }
        for b in &mut buffers[1..] {
            match b {
                Buffer::Audio { samples, len, silent, .. } => {
                    *len = if index == 3 { 0 } else { 5 };
                    samples.iter_mut().enumerate().for_each(|(i, x)| *x = (index as f32 + i as f32).sin());
                    *silent = false;
                }
                Buffer::Magnitude { bins, frame, .. } => {
                    bins.iter_mut().enumerate().for_each(|(i, x)| *x = index as f32 * i as f32);
                    *frame = (index != 1).then_some((index, 5 * index));
                }
                Buffer::Spectrum { frame, .. } => *frame = None,
                Buffer::Control { .. } => {}
            }
        }
        // What the engine does before a call.
        if let Buffer::Audio { samples, silent, .. } = &mut buffers[4] {
            samples.fill(0.0);
            *silent = true;
        }
        let (ins, outs) = buffers.split_at_mut(3);
        let mut tick =
            Tick { index, tick_hz: 500, inputs: Inputs::new(ins, &[], 3, &map), outputs: Outputs::new(outs) };
        let answer = if panics || index != 104 { node.run(&mut tick) } else { Err(Fault::Panicked) };
        seen += &format!("{index}: {answer:?} {:?}\n", &buffers[3..]);
    }
    node.ask(|n| n.elapsed(5)).unwrap();
    node.ask(|n| n.set_parameter(0, 4.0)).unwrap();
    let mut bytes = vec![0; node.state_size()];
    let saved = node.save(&mut bytes);
    node.ask(|n| n.reset()).unwrap();
    seen += &format!("{saved:?} {bytes:?} {:?}\n", node.facts());
    assert!(node.restore(&bytes));
    assert!(!node.restore(&[1]));
    let facts = node.facts();
    let Prepared { latency, tail, duration, allocation_free, .. } = prepared;
    seen + &format!("{facts:?} {latency:?} {tail:?} {duration:?} {allocation_free}")
}

#[test]
fn descriptor_is_unchanged_by_the_interface() {
    for kind in kinds() {
        let name = kind.descriptor().kind.to_string();
        let registry = direct();
        let here = registry.get(&name).unwrap().descriptor();
        assert_eq!(format!("{:?}", kind.descriptor()), format!("{here:?}"));
    }
}

#[test]
fn every_answer_crosses_the_interface() {
    let seen = run(prepare(kinds()[0].as_ref(), &params(&settings())).unwrap(), true);
    for answer in [
        "100: Ok(Quiet)",
        "101: Ok(Tail(7))",
        "102: Ok(Asleep)",
        "103: Err(Failed(42))",
        "104: Err(Panicked)",
        "\n5: Ok(Continue)",
    ] {
        assert!(seen.contains(answer), "{answer} is not in {seen}");
    }
}

#[test]
fn node_output_is_unchanged_by_the_interface() {
    let params = params(&settings());
    // Past the tick that panics, which only one side catches itself.
    let seen = |kind: &NodeKind| run(prepare(kind, &params).unwrap(), false);
    let (there, here) = (seen(kinds()[0].as_ref()), seen(direct().get("everything").unwrap().as_ref()));
    assert_eq!(there, here);
    assert!(there.contains("some/where/x.csv"), "{there}");
}

#[test]
fn errors_point_at_the_parameter() {
    for (say, message, help) in [
        ("bad word", "not this word", Some("the other")),
        ("bad node", "this cannot be", None),
        ("panic early", "the node panicked while it was prepared: early", None),
    ] {
        let mut set = settings();
        set.retain(|s| s.0 != "say");
        set.push(("say", ParamValue::Text(say.into())));
        let Err(e) = prepare(kinds()[0].as_ref(), &params(&set)) else { panic!("{say} prepares") };
        assert_eq!((e.message.as_str(), e.help.as_deref()), (message, help));
        assert_eq!(e.place.is_some(), say == "bad word");
    }
}

#[test]
fn ports_follow_parameters() {
    let all = params(&settings());
    let config = Config { id: "it", params: &all, tick_hz: 500, every: 1, audio_hz: 48_000, seed: 1 };
    let ports = kinds()[0].ports(&config).unwrap();
    assert_eq!(ports.inputs[0].shape, ShapeSpec::Control(3));
    let bad = params(&[("say", ParamValue::Text("bad ports".into()))]);
    let e = kinds()[0].ports(&Config { params: &bad, ..config }).unwrap_err();
    assert_eq!(
        (e.message.as_str(), e.help.as_deref(), e.place.is_some()),
        ("no such ports", Some("others"), true)
    );
}

#[test]
fn gate_is_asked_and_a_panic_is_a_fault() {
    let params = Params::new(None);
    let config = Config { id: "it", params: &params, tick_hz: 500, every: 1, audio_hz: 48_000, seed: 1 };
    let port = Some(PortType { shape: Shape::Audio { rate_hz: 48_000 }, unit: Unit::NONE, limited: false });
    let wires = [Wiring { port: port.clone(), connected: true }];
    let setup = Setup { config, inputs: &wires, outputs: &wires, closes_cycle: true };
    let mut gate = kinds()[1].prepare(&setup).unwrap().processor;
    let buffers = [Buffer::new(port.as_ref().unwrap(), 500)];
    let map = [InputRef { buffer: 0, connected: true }];
    let tick = |index| Tick {
        index,
        tick_hz: 500,
        inputs: Inputs::new(&buffers, &[], 1, &map),
        outputs: Outputs::new(&mut []),
    };
    assert_eq!(gate.ask(|g| g.wants(&mut tick(2))), Ok(true));
    assert_eq!(gate.ask(|g| g.wants(&mut tick(3))), Ok(false));
    assert_eq!(gate.ask(|g| g.wants(&mut tick(100))), Err(Fault::Panicked));
    assert_eq!(gate.ask(|g| g.absorb(&mut tick(3))), Ok(()));
    assert_eq!(gate.ask(|g| g.absorb(&mut tick(100))), Err(Fault::Panicked));
    assert_eq!(gate.ask(|g| g.reset()), Err(Fault::Panicked));
    assert_eq!(gate.ask(|g| g.set_parameter(5, 0.0)), Ok(()));
}
