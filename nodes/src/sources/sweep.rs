//! `sweep`: all frequencies, one after the other.

use crate::prelude::*;
use asperity_actuator::identify::{self, SweepSettings, SweepShape};

/// An exponential sine sweep between two silences; each sample follows from its number alone.
pub struct Sweep {
    sweep: identify::Sweep,
    rate: u32,
}

impl Node for Sweep {
    fn descriptor() -> Descriptor {
        let s = SweepSettings::default();
        let silence = |name, default, doc| number(name, default, 0.0..=60.0, "s").doc(doc);
        Descriptor::new("sweep", "Generates an exponential sine sweep, for example to measure an actuator.")
            .output(super::output().doc("sweep"))
            .param(number("from_hz", s.from_hz, 0.5..=5000.0, "Hz").doc("First frequency."))
            .param(number("to_hz", s.to_hz, 1.0..=20_000.0, "Hz"))
            .doc("Last frequency: at least 1.5 times `from_hz`, at most 0.45 of the audio rate.")
            .param(number("seconds", s.seconds, 0.1..=120.0, "s"))
            .doc("Duration of the sweep without silences. It is rounded so that harmonics are in phase.")
            .param(number("amplitude", s.amplitude, 0.0..=1000.0, ""))
            .doc("Largest amplitude, in the output's unit.")
            .param(choice("shape", &["flat", "displacement"]).doc(
                "Amplitude over frequency. `flat`: constant. `displacement`: smaller below `corner_hz`, \
                 so that the mover stays near its middle.",
            ))
            .param(number("corner_hz", s.corner_hz, 1.0..=20_000.0, "Hz"))
            .doc("With the shape `displacement`, the amplitude falls below this frequency.")
            .param(number("fade_ms", s.fade_s * 1e3, 0.0..=1000.0, "ms"))
            .doc("Duration of each fade (raised cosine).")
            .param(silence("before_s", s.before_s, "Silence before the sweep."))
            .param(silence("after_s", s.after_s, "Silence after the sweep."))
            .param(super::unit_param())
            .resumes(Resume::Continue)
    }

    fn ports(config: &Config<'_>, ports: Ports) -> Result<Ports, Diagnostic> {
        Ok(super::with_unit(config, ports))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let rate = setup.output_rate(0);
        let settings = SweepSettings {
            from_hz: p.number("from_hz"),
            to_hz: p.number("to_hz"),
            seconds: p.number("seconds"),
            amplitude: p.number("amplitude"),
            shape: if p.text("shape") == "flat" { SweepShape::Flat } else { SweepShape::Displacement },
            corner_hz: p.number("corner_hz"),
            fade_s: p.number("fade_ms") * 1e-3,
            before_s: p.number("before_s"),
            after_s: p.number("after_s"),
        };
        // The descriptor checks ranges. Left to check is how frequencies and rate go together.
        let sweep =
            identify::Sweep::new(settings, f64::from(rate)).map_err(|e| p.error("to_hz", e.to_string()))?;
        let duration = i64::try_from(sweep.samples()).ok().map(|samples| Latency::samples(samples, rate));
        Ok(Prepared::new(Self { sweep, rate }).duration(duration))
    }
}

impl Processor for Sweep {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let span = tick.samples(self.rate);
        if self.sweep.is_over(span.start) {
            return Status::Quiet;
        }
        for (y, n) in tick.outputs.audio(0).iter_mut().zip(span) {
            *y = self.sweep.sample(n) as f32;
        }
        Status::Continue
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![
            Fact::number("sweep", self.sweep.seconds(), "s"),
            Fact::number("time_constant", self.sweep.time_constant_s(), "s"),
        ]
    }
}
