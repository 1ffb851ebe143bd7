//! `mix`: a weighted sum.

use crate::prelude::*;

/// Adds signals of one type.
pub struct Mix {
    gains: Vec<f64>,
    audio: bool,
}

/// The most inputs a mix can have.
const MAX_INPUTS: i64 = 64;

fn input(i: i64) -> Input {
    Input::new(format!("in{i}"), ShapeSpec::Like('s'), Unit::NONE).unit_of('u').or(0.0).doc("signal to add")
}

impl Node for Mix {
    fn descriptor() -> Descriptor {
        Descriptor::new("mix", "Adds signals of one type, each with its own gain.")
            .input(input(1))
            .input(input(2))
            .output(like_out("out").doc("sum"))
            .param(integer("inputs", 2, 1..=MAX_INPUTS).doc("Number of inputs: in1, in2, ..."))
            .param(Param::numbers("gains", &[], -1e6..=1e6, "Factor of each input; 1 for missing ones."))
    }

    fn ports(config: &Config<'_>, mut ports: Ports) -> Result<Ports, Diagnostic> {
        ports.inputs = (1..=config.params.integer("inputs")).map(input).collect();
        Ok(ports)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let audio = match setup.output(0).map(|p| p.shape) {
            Some(Shape::Audio { .. }) => true,
            Some(Shape::Control { .. }) => false,
            _ => return Err(setup.params.node_error("`mix` adds audio or controls, not frames")),
        };
        let mut gains = setup.params.numbers("gains").to_vec();
        if gains.len() > setup.inputs.len() {
            let message = format!("{} gains for {} inputs", gains.len(), setup.inputs.len());
            return Err(setup.params.error("gains", message));
        }
        gains.resize(setup.inputs.len(), 1.0);
        Ok(Prepared::new(Self { gains, audio }))
    }
}

impl Processor for Mix {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        if self.audio {
            let sounds = |i: usize| !tick.inputs.is_zero(i);
            if !(0..self.gains.len()).any(sounds) {
                return Status::Quiet;
            }
            let out = tick.outputs.audio(0);
            for (i, gain) in self.gains.iter().enumerate().filter(|(i, _)| sounds(*i)) {
                let gain = *gain as f32;
                for (y, x) in out.iter_mut().zip(tick.inputs.audio(i)) {
                    *y += gain * x;
                }
            }
        } else {
            let out = tick.outputs.control(0);
            out.fill(0.0);
            for (i, gain) in self.gains.iter().enumerate() {
                for (y, x) in out.iter_mut().zip(tick.inputs.control(i)) {
                    *y += gain * x;
                }
            }
        }
        Status::Continue
    }
}
