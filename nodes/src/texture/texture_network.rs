//! `texture_network`: from forces and velocities to the magnitudes of the vibration they cause.

use asperity_network::{
    Choice, FORCE_LEN, MAGNITUDES_LEN, Model, Precision, Range, RunError, Runner, SPEED_LEN, hold_magnitudes,
};
use asperity_node::{
    Config, Descriptor, Diagnostic, Fact, FrameClock, FrameLayout, FrameRate, Input, LayoutSpec, Node,
    Output, Param, Ports, Setup, ShapeSpec, Status, Tick, Unit,
};
use asperity_world::material::Library;

/// The model's bins are 10 Hz apart: its window is 0.1 s.
const WINDOWS_PER_SECOND: u32 = 10;
/// The model predicts this often.
const MODEL_HZ: u32 = 500;

/// Predicts magnitudes by an ONNX model, for one of several preloaded materials.
pub struct TextureNetwork {
    runner: Runner,
    clock: FrameClock,
    layout: FrameLayout,
    material: usize,
    names: Vec<String>,
    force: [f32; FORCE_LEN],
    velocity: [f32; SPEED_LEN],
    magnitudes: [f32; MAGNITUDES_LEN],
    range: Range,
    held: Held,
}

/// How often something was not as it should be.
#[derive(Clone, Copy, Debug, Default)]
struct Held {
    /// Frames with a force out of range among the last ten.
    force: u64,
    /// Frames with a velocity out of range.
    velocity: u64,
    /// Magnitudes that were negative or not finite.
    magnitudes: u64,
}

/// The frames that follow from the parameters.
fn layout(config: &Config<'_>) -> Result<FrameLayout, Diagnostic> {
    let rate_hz = match config.params.integer("synthesis_hz") as u32 {
        0 => config.audio_hz,
        hz => hz,
    };
    if !rate_hz.is_multiple_of(WINDOWS_PER_SECOND) {
        let message = format!("a window of 0.1 s is not a whole number of samples at {rate_hz} Hz");
        return Err(config
            .params
            .error("synthesis_hz", message)
            .help("a multiple of 10 Hz, such as 2500; a `resample` brings it to the audio rate"));
    }
    let length = rate_hz / WINDOWS_PER_SECOND;
    let wanted = FrameRate::new(MODEL_HZ, 1).unwrap_or_else(|| unreachable!("a constant"));
    let frame_rate = config.frame_clock(wanted).rate();
    let bins = (config.params.integer("bins") as u32).min(length / 2) + 1;
    Ok(FrameLayout { rate_hz, length, bins, frame_rate })
}

impl Node for TextureNetwork {
    fn descriptor() -> Descriptor {
        let frame_rate = FrameRate::new(MODEL_HZ, 1).unwrap_or_else(|| unreachable!("a constant"));
        let shown = FrameLayout { rate_hz: 2500, length: 250, bins: 101, frame_rate };
        Descriptor::new(
            "texture_network",
            "Predicts the vibration of touching a material: an ONNX model's magnitudes of the next 0.1 s.",
        )
        .input(
            Input::new("force", ShapeSpec::Control(FORCE_LEN), Unit::NEWTON)
                .doc("the last forces, oldest first; held to 0 and the largest that the model was trained on"),
        )
        .input(
            Input::new("velocity", ShapeSpec::Control(SPEED_LEN), Unit::MILLIMETRE_PER_SECOND)
                .doc("the last vx, then the last vy, oldest first; made slower where faster than any trained"),
        )
        .input(
            Input::new("material", ShapeSpec::Control(1), Unit::NONE)
                .or(0.0)
                .doc("which of `material` and then `materials`, from 0; rounded, held to the ends"),
        )
        .output(
            Output::new(
                "magnitude",
                ShapeSpec::Magnitude(LayoutSpec::Is(shown)),
                Unit::METRE_PER_SECOND_SQUARED,
            )
            .doc("acceleration of the next 0.1 s; bin 0 is 0"),
        )
        .param(Param::file(
            "model",
            "ONNX: force [1,10], speed [1,20], texture [1,256] to magnitudes [1,100]; metadata `force_max_n`, \
             `speed_max_mm_s`: the range it was trained on.",
        ))
        .param(Param::file("library", "RON: material names and their texture vectors of 256 numbers."))
        .param(Param::text("material", "", "The material's name in the library.").required())
        .param(Param::texts("materials", "More materials, preloaded for the input `material` to pick."))
        .param(
            Param::integer(
                "synthesis_hz",
                2500,
                0..=192_000,
                "Rate of the signal that is synthesised; 0 for the audio rate.",
            )
            .unit("Hz"),
        )
        .param(Param::integer(
            "bins",
            MAGNITUDES_LEN as i64,
            1..=MAGNITUDES_LEN as i64,
            "How many of the bins are used, 10 Hz apart.",
        ))
        .param(Param::choice("precision", &["f32", "f16"], "How the weights are kept; f16 is faster."))
        .param(Param::choice(
            "executor",
            &["auto", "tract"],
            "`auto` takes packed kernels where they agree with tract.",
        ))
        .timing("no latency: a frame describes the 0.1 s that begin with it")
    }

    fn ports(config: &Config<'_>, mut ports: Ports) -> Result<Ports, Diagnostic> {
        ports.outputs[0].shape = ShapeSpec::Magnitude(LayoutSpec::Is(layout(config)?));
        Ok(ports)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        let p = setup.params;
        let layout = layout(&setup.config)?;
        let library = Library::read(p.file("library"))?;
        let mut vectors = Vec::new();
        let mut names = Vec::new();
        let wanted = std::iter::once(("material", p.text("material")))
            .chain(p.texts("materials").iter().map(|name| ("materials", name.as_str())));
        for (param, name) in wanted {
            let material = library.material(name).map_err(|e| {
                let d = p.error(param, e.message);
                if let Some(help) = e.help { d.help(help) } else { d }
            })?;
            vectors.push(material.vector.to_vec());
            names.push(name.to_owned());
        }
        let model = Model::load(p.file("model"))?;
        let precision = if p.text("precision") == "f16" { Precision::F16 } else { Precision::F32 };
        let choice = if p.text("executor") == "tract" { Choice::Tract } else { Choice::Auto };
        Ok(Self {
            runner: model.runner(&vectors, precision, choice)?,
            clock: FrameClock::new(setup.tick_hz, setup.every, layout.frame_rate),
            layout,
            material: 0,
            names,
            force: [0.0; FORCE_LEN],
            velocity: [0.0; SPEED_LEN],
            magnitudes: [0.0; MAGNITUDES_LEN],
            range: Range::new(model.trained()),
            held: Held::default(),
        })
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let Some(frame) = self.clock.frame(tick.index) else { return Status::Quiet };
        let (force, velocity) = (tick.inputs.control(0), tick.inputs.control(1));
        self.held.force += u64::from(self.range.forces(force, &mut self.force));
        self.held.velocity += u64::from(self.range.velocities(velocity, &mut self.velocity));
        // A float to an integer saturates, and NaN is 0.
        self.material = (tick.inputs.value(2).round() as usize).min(self.runner.materials() - 1);
        match self.runner.run(self.material, &self.force, &self.velocity, &mut self.magnitudes) {
            Ok(()) => {}
            Err(RunError::Executor) => return Status::Error(1),
            Err(_) => return Status::Error(2),
        }
        let start = self.layout.frame_rate.first_sample(frame, self.layout.rate_hz);
        let bins = tick.outputs.magnitude(0, frame, start);
        bins[0] = 0.0;
        self.held.magnitudes += hold_magnitudes(&self.magnitudes, &mut bins[1..]);
        Status::Continue
    }

    fn reset(&mut self) {
        self.material = 0;
    }

    fn allocation_free(&self) -> bool {
        self.runner.is_allocation_free()
    }

    fn facts(&self) -> Vec<Fact> {
        let info = self.runner.describe();
        let mut facts = vec![
            Fact::text("executor", info.executor.to_string()),
            Fact::text("choice", info.report.clone()),
            Fact::count("multiply_adds", info.multiply_adds as u64),
            Fact::number("weights", info.weights_bytes as f64 / 1024.0, "KiB"),
            Fact::text("materials", self.names.join(", ")),
        ];
        if let Some(error) = info.max_error_vs_tract {
            facts.push(Fact::number("error_against_tract", error, "of full scale"));
        }
        let trained = self.range.trained();
        if let Some(most) = trained.force_max_n {
            facts.push(Fact::number("trained_force", most, "N"));
        }
        if let Some(most) = trained.speed_max_mm_s {
            facts.push(Fact::number("trained_speed", most, "mm/s"));
        }
        facts.push(Fact::count("force_out_of_range", self.held.force));
        facts.push(Fact::count("velocity_out_of_range", self.held.velocity));
        facts.push(Fact::count("bad_magnitudes", self.held.magnitudes));
        facts
    }
}
