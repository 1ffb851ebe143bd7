//! `texture_network`: from forces and velocities to the magnitudes of the vibration they cause.

use crate::prelude::*;
use asperity_dsp::shaped_noise::PATTERN_LEN;
use asperity_texture::{
    Answer, Choice, FORCE_LEN, Library, MAGNITUDES_LEN, Model, Precision, Range, RunError, Runner, SPEED_LEN,
    Target, hold_magnitudes,
};

/// The model's bins are 10 Hz apart: its window is 0.1 s.
const WINDOWS_PER_SECOND: u32 = 10;
/// Predictions of the model a second.
const MODEL_HZ: u32 = 500;

/// Predicts magnitudes by an ONNX model, for one of several preloaded materials.
///
/// The output depends on the inputs alone. So inputs that are the same to the bit give the last output again,
/// without running the network. While the hand is still, it does not run.
pub struct TextureNetwork {
    runner: Runner,
    clock: FrameClock,
    layout: FrameLayout,
    material: usize,
    names: Vec<String>,
    patterns: Vec<[f64; PATTERN_LEN]>,
    force: [f32; FORCE_LEN],
    velocity: [f32; SPEED_LEN],
    answer: Box<Answer>,
    /// 1 where the model's magnitudes are means, else 0: for the port `statistics`.
    means: f64,
    /// Whether `answer` is the answer to `force`, `velocity` and `material`.
    answered: bool,
    range: Range,
    /// Frames with a force out of range among the last ten, frames with a velocity out of range, and
    /// magnitudes that were negative or not finite.
    held: [u64; 3],
    /// Number of frames for which the network was run, and of those for which it was not.
    runs: u64,
    reused: u64,
}

/// Whether all are the same numbers, to the bit: signs of zeros and NaN count.
fn same_bits(a: &[f32], b: &[f32]) -> bool {
    a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits()))
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
            "Predicts the vibration of a touched material by an ONNX model: magnitudes of the next 0.1 s.",
        )
        .role(Role::TextureNetwork)
        .input(control("force", FORCE_LEN, N))
        .doc("last forces, oldest first; clamped to the model's trained range")
        .input(control("velocity", SPEED_LEN, MM_S))
        .doc("last vx, then last vy, oldest first; scaled down to the model's trained speed")
        .input(control("material", 1, ONE).or(0.0))
        .doc("index into `material` and then `materials`, from 0; rounded and clamped")
        .output(Output::new(
            "magnitude",
            ShapeSpec::Magnitude(LayoutSpec::Is(shown)),
            Unit::METRE_PER_SECOND_SQUARED,
        ))
        .doc("expected acceleration of the next 0.1 s; bin 0 is 0")
        .output(Output::new("ratio", ShapeSpec::Magnitude(LayoutSpec::Is(shown)), Unit::NONE).secondary())
        .doc("mean divided by rms of each bin: 0.886 noise, 1 a steady line; noise if the model lacks it")
        .output(control_out("statistics", 2, ONE).secondary().doc(
            "variance of a frame's power over its squared mean, -1 if unknown; then 1 for means, 0 for \
             rms values",
        ))
        .output(
            control_out("pattern", PATTERN_LEN, ONE)
                .secondary()
                .doc("ridges and bumps of the material, from the library; all 0 if it has none"),
        )
        .param(file("model").doc(
            "ONNX model. Inputs: force [1,10], speed [1,20], texture [1,256]. Output: magnitudes [1,100]. \
             The metadata `force_max_n` and `speed_max_mm_s` give the trained range.",
        ))
        .param(file("library").doc("Material library, a RON file: names and texture vectors of 256 numbers."))
        .param(text("material", "").required().doc("Name of the material in the library."))
        .param(texts("materials").doc("Further materials that the input `material` can select."))
        .param(integer("synthesis_hz", 2500, 0..=192_000).unit("Hz"))
        .doc("Sample rate of the synthesised signal; 0: the graph's audio rate.")
        .param(integer("bins", MAGNITUDES_LEN as i64, 1..=MAGNITUDES_LEN as i64))
        .doc("Number of bins that are used, 10 Hz apart.")
        .param(choice("precision", &Precision::ALL.map(Precision::name)).doc(
            "Number format of the weights. f16 and int8 are faster, with errors up to 0.02 % and 0.5 % of \
             the largest magnitude. f64 is slow, and the reference for the others.",
        ))
        .param(choice("executor", &["auto", "tract"]))
        .doc("Program that runs the model. `auto` uses packed kernels if their results agree with tract.")
        .timing("no latency: a frame describes the 0.1 s after its start")
    }

    fn ports(config: &Config<'_>, mut ports: Ports) -> Result<Ports, Diagnostic> {
        let frames = ShapeSpec::Magnitude(LayoutSpec::Is(layout(config)?));
        (ports.outputs[0].shape, ports.outputs[1].shape) = (frames, frames);
        Ok(ports)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let layout = layout(&setup.config)?;
        let library = Library::shared(p.file("library"))?;
        let (mut vectors, mut names, mut patterns) = (Vec::new(), Vec::new(), Vec::new());
        let wanted = std::iter::once(("material", p.text("material")))
            .chain(p.texts("materials").iter().map(|name| ("materials", name.as_str())));
        for (param, name) in wanted {
            let material = library.material(name).map_err(|e| error_at(p, param, e))?;
            vectors.push(material.vector.to_vec());
            patterns.push(material.pattern.numbers());
            names.push(name.to_owned());
        }
        let model = Model::shared(p.file("model"))?;
        let named = |precision: &Precision| precision.name() == p.text("precision");
        let precision = Precision::ALL.into_iter().find(named).unwrap_or_default();
        let choice = if p.text("executor") == "tract" { Choice::Tract } else { Choice::Auto };
        let runner = model.runner(&vectors, precision, choice)?;
        let allocation_free = runner.is_allocation_free();
        let it = Self {
            runner,
            clock: FrameClock::new(setup.tick_hz, setup.every, layout.frame_rate),
            layout,
            material: 0,
            names,
            patterns,
            force: [0.0; FORCE_LEN],
            velocity: [0.0; SPEED_LEN],
            answer: Box::default(),
            means: f64::from(u8::from(model.target() == Target::Mean)),
            answered: false,
            range: Range::new(model.trained()),
            held: [0; 3],
            runs: 0,
            reused: 0,
        };
        Ok(Prepared { allocation_free, ..Prepared::new(it) })
    }
}

impl Processor for TextureNetwork {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let Some(frame) = self.clock.frame(tick.index) else { return Status::Quiet };
        let (mut force, mut velocity) = ([0.0; FORCE_LEN], [0.0; SPEED_LEN]);
        self.held[0] += u64::from(self.range.forces(tick.inputs.control(0), &mut force));
        self.held[1] += u64::from(self.range.velocities(tick.inputs.control(1), &mut velocity));
        // A float to an integer saturates, and NaN is 0.
        let material = (tick.inputs.value(2).round() as usize).min(self.runner.materials() - 1);
        let same = self.answered
            && material == self.material
            && same_bits(&force, &self.force)
            && same_bits(&velocity, &self.velocity);
        if same {
            self.reused += 1;
        } else {
            (self.force, self.velocity, self.material, self.answered) = (force, velocity, material, false);
            match self.runner.answer(material, &force, &velocity, &mut self.answer) {
                Ok(()) => self.answered = true,
                Err(RunError::Executor) => return Status::Error(1),
                Err(_) => return Status::Error(2),
            }
            self.runs += 1;
        }
        let start = self.layout.frame_rate.first_sample(frame, self.layout.rate_hz);
        let bins = tick.outputs.magnitude(0, frame, start);
        bins[0] = 0.0;
        self.held[2] += hold_magnitudes(&self.answer.magnitudes, &mut bins[1..]);
        let ratios = tick.outputs.magnitude(1, frame, start);
        ratios[0] = self.answer.ratio[0];
        ratios[1..].iter_mut().zip(&self.answer.ratio).for_each(|(to, ratio)| *to = *ratio);
        let known = self.runner.answers_scatter();
        let variance = if known { f64::from(self.answer.variance) } else { -1.0 };
        tick.outputs.control(2).copy_from_slice(&[variance, self.means]);
        if let Some(pattern) = self.patterns.get(material) {
            tick.outputs.control(3).copy_from_slice(pattern);
        }
        Status::Continue
    }

    fn reset(&mut self) {
        self.material = 0;
        self.answered = false;
    }

    fn facts(&mut self) -> Vec<Fact> {
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
        let [force, velocity, magnitudes] = self.held;
        facts.extend([
            Fact::count("runs", self.runs),
            Fact::count("reused", self.reused),
            Fact::count("force_out_of_range", force),
            Fact::count("velocity_out_of_range", velocity),
            Fact::count("bad_magnitudes", magnitudes),
        ]);
        facts
    }
}
