use asperity_node::{
    Buffer, Config, Fact, FactValue, FrameLayout, FrameRate, InputRef, Inputs, Outputs, ParamValue, Params,
    PortType, Processor, Setup, Shape, Status, Tick, Unit, random,
};
use asperity_texture::{Model, Range};

const MODELS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/models/surfaces/");

/// Forces, velocities and a material.
type Asked = ([f64; 10], [f64; 20], f64);

/// The network with two materials, and its output.
struct Bench {
    node: Box<dyn Processor>,
    out: [Buffer; 4],
    tick: u64,
}

impl Bench {
    fn new(precision: &str, executor: &str) -> Self {
        let kind = crate::registry().get("texture_network").unwrap().clone();
        let mut params = Params::new(None);
        for p in &kind.descriptor().params {
            let value = match p.name.as_ref() {
                "model" => Some(ParamValue::File(format!("{MODELS}texture.onnx").into())),
                "library" => Some(ParamValue::File(format!("{MODELS}materials.ron").into())),
                "material" => Some(ParamValue::Text("canvas".into())),
                "materials" => Some(ParamValue::Texts(vec!["oak".into()])),
                "precision" => Some(ParamValue::Text(precision.into())),
                "executor" => Some(ParamValue::Text(executor.into())),
                _ => p.default.clone(),
            };
            params.insert(p.name.to_string(), value, None);
        }
        let config = Config { id: "it", params: &params, tick_hz: 500, every: 1, audio_hz: 48_000, seed: 1 };
        let node = kind.prepare(&Setup { config, inputs: &[], outputs: &[], closes_cycle: false }).unwrap();
        let frame_rate = FrameRate::new(500, 1).unwrap();
        let layout = FrameLayout { rate_hz: 2500, length: 250, bins: 101, frame_rate };
        let port = PortType {
            shape: Shape::Magnitude(layout),
            unit: Unit::METRE_PER_SECOND_SQUARED,
            limited: false,
        };
        let control = |count| PortType { shape: Shape::Control { count }, unit: Unit::NONE, limited: false };
        let pattern = asperity_dsp::shaped_noise::PATTERN_LEN;
        let out = [port.clone(), port, control(2), control(pattern)].map(|port| Buffer::new(&port, 500));
        Self { node: node.processor, out, tick: 0 }
    }

    /// The bits of the output frame.
    fn ask(&mut self, (force, velocity, material): &Asked) -> Vec<u32> {
        let buffer = |values: &[f64]| Buffer::Control { values: values.into(), changed: true, valid: true };
        let buffers = [buffer(force), buffer(velocity), buffer(&[*material])];
        let map = [0, 1, 2].map(|buffer| InputRef { buffer, connected: true });
        let inputs = Inputs::new(&buffers, &[], 3, &map);
        let outputs = Outputs::new(&mut self.out);
        let mut tick = Tick { index: self.tick, tick_hz: 500, inputs, outputs };
        assert_eq!(self.node.run(&mut tick).unwrap(), Status::Continue);
        self.tick += 1;
        let Buffer::Magnitude { bins, frame, .. } = &self.out[0] else { panic!("a frame") };
        assert_eq!(*frame, Some((self.tick - 1, 5 * (self.tick - 1))));
        bins.iter().map(|x| x.to_bits()).collect()
    }

    fn count(&mut self, name: &str) -> u64 {
        let facts: Vec<Fact> = self.node.facts();
        match facts.iter().find(|f| f.name == name).map(|f| &f.value) {
            Some(FactValue::Count(n)) => *n,
            other => panic!("{name}: {other:?}"),
        }
    }
}

/// Motions that stand still now and then. From one to the next they differ in one bit, in the sign of a zero,
/// or in values that are out of range or not a number.
fn script() -> Vec<Asked> {
    let mut asked: Asked = ([1.0; 10], [0.0; 20], 0.0);
    let unit = |k: u64| random::uniform(7, k);
    let mut script = Vec::new();
    for k in 0..400_u64 {
        let at = (unit(6 * k) * 10.0) as usize;
        match (unit(6 * k + 1) * 12.0) as u32 {
            0 => asked.0[at] = 3.0 * unit(6 * k + 2),
            1 => asked.1[at] = 200.0 * unit(6 * k + 2) - 100.0,
            // The next f32.
            2 => asked.0[9] = f64::from(f32::from_bits((asked.0[9] as f32).to_bits() + 1)),
            3 => asked.1[at + 10] = -asked.1[at + 10],
            4 => asked.2 = 1.0 - asked.2.clamp(0.0, 1.0),
            // No other material, and less than an f32 can say.
            5 => asked.2 += 0.2,
            6 => asked.1[at] *= 1.0 + 1e-12,
            7 => asked.0[at] = [f64::NAN, f64::INFINITY, 35.0, -1.0, 36.0][at / 2],
            8 => asked.1[at] = [f64::NAN, f64::NEG_INFINITY, 1e200, 1e-300, 5000.0][at / 2],
            _ => {}
        }
        script.push(asked);
    }
    script
}

#[test]
fn repeated_input_gives_the_networks_own_output() {
    for (precision, executor) in [("f32", "auto"), ("int8", "auto"), ("f64", "auto"), ("f32", "tract")] {
        let (mut it, mut fresh) = (Bench::new(precision, executor), Bench::new(precision, executor));
        let range = Range::new(Model::load(format!("{MODELS}texture.onnx")).unwrap().trained());
        let mut held: Vec<Vec<u32>> = Vec::new();
        for (k, asked) in script().iter().enumerate() {
            if k == 200 {
                it.node.reset();
                held.push(Vec::new());
            }
            fresh.node.reset();
            assert_eq!(it.ask(asked), fresh.ask(asked), "{precision} {executor}, frame {k}: {asked:?}");
            // What the network is given, and which material.
            let (mut force, mut velocity) = ([0.0; 10], [0.0; 20]);
            range.forces(&asked.0, &mut force);
            range.velocities(&asked.1, &mut velocity);
            let material = [asked.2.round().min(1.0) as f32];
            held.push(force.iter().chain(&velocity).chain(&material).map(|x| x.to_bits()).collect());
        }
        let changes = held.windows(2).filter(|pair| pair[0] != pair[1] && !pair[1].is_empty()).count() as u64;
        assert_eq!(it.count("runs"), 1 + changes, "{precision} {executor}");
        assert_eq!(it.count("runs") + it.count("reused"), 400);
        assert!((80..320).contains(&it.count("reused")), "{}", it.count("reused"));
        assert_eq!((fresh.count("runs"), fresh.count("reused")), (400, 0));
        for count in ["force_out_of_range", "velocity_out_of_range", "bad_magnitudes"] {
            assert_eq!(it.count(count), fresh.count(count), "{count}");
        }
    }
}
