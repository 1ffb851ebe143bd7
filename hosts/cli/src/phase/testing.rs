//! Nodes for tests with the ports of phase retrieval.

use asperity_node::{
    Descriptor, Diagnostic, Input, Latency, LayoutSpec, Node, Output, Param, Prepared, Processor, RateSpec,
    Setup, ShapeSpec, Status, Tick, Unit,
};

/// A kind with magnitudes in, and samples at the frames' rate out.
pub fn audio_kind(kind: &'static str) -> Descriptor {
    Descriptor::new(kind, "Answers as a test wants.")
        .input(
            Input::new("magnitude", ShapeSpec::Magnitude(LayoutSpec::Of('l')), Unit::NONE)
                .unit_of('u')
                .doc("frames"),
        )
        .output(
            Output::new("signal", ShapeSpec::Audio(RateSpec::Of('l')), Unit::NONE)
                .unit_of('u')
                .doc("samples"),
        )
}

/// Puts out the number of each sample, `late` samples later (earlier if negative), which it declares as
/// latency.
pub struct Counter {
    late: i64,
    rate_hz: u32,
}

impl Node for Counter {
    fn descriptor() -> Descriptor {
        audio_kind("counter").param(Param::integer("late", 0, -1_000_000..=1_000_000, "Latency in samples."))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let (late, rate_hz) = (setup.params.integer("late"), setup.input_rate(0));
        Ok(Prepared::new(Self { late, rate_hz }).latency(Latency::samples(late, rate_hz)))
    }
}

impl Processor for Counter {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let span = tick.samples(self.rate_hz);
        for (y, n) in tick.outputs.audio(0).iter_mut().zip(span) {
            *y = (n as i64 - self.late) as f32;
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}

/// Plays a sine of 250 Hz with the largest amplitude of the frame `delay` ticks ago. `how` chooses a
/// failure.
pub struct Tone {
    levels: Vec<f32>,
    rate_hz: u32,
    how: String,
    calls: u64,
}

impl Node for Tone {
    fn descriptor() -> Descriptor {
        audio_kind("tone").param(Param::integer("delay", 0, 0..=100, "Delay in ticks.")).param(Param::choice(
            "how",
            &["well", "nan", "error", "panic", "prepare", "clock"],
            "What goes wrong.",
        ))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let how = setup.params.text("how").to_owned();
        assert!(how != "prepare", "as told");
        let levels = vec![0.0; setup.params.integer("delay") as usize + 1];
        Ok(Prepared::new(Self { levels, rate_hz: setup.input_rate(0), how, calls: 0 }))
    }
}

impl Processor for Tone {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        self.levels.rotate_right(1);
        self.levels[0] = tick.inputs.magnitude(0).map_or(0.0, |f| f.bins.iter().copied().fold(0.0, f32::max));
        let level = self.levels[self.levels.len() - 1];
        let (span, rate) = (tick.samples(self.rate_hz), f64::from(self.rate_hz));
        let out = tick.outputs.audio(0);
        for (y, n) in out.iter_mut().zip(span) {
            *y = level * (std::f64::consts::TAU * 250.0 * n as f64 / rate).sin() as f32;
        }
        self.calls += 1;
        match self.how.as_str() {
            "nan" if self.calls == 7 => out[0] = f32::NAN,
            "error" => return Status::Error(42),
            "panic" if self.calls == 7 => panic!("as told"),
            "clock" => {
                static ALL: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
                out[0] += ALL.fetch_add(1, std::sync::atomic::Ordering::Relaxed) as f32 * 1e-6;
            }
            _ => {}
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}
