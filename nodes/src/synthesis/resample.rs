//! `resample`: a signal at another rate.

use crate::prelude::*;
use asperity_dsp::{Conversion, FilterPhase, Float, Resampler};

use crate::precision::{in_precision, precision};

/// Brings a signal to the audio rate, or any other, by a polyphase filter.
pub struct Resample<T = f32> {
    /// None where both rates are the same.
    kernel: Option<Resampler<T>>,
    in_hz: u32,
    out_hz: u32,
}

/// Highest frequency that is kept whatever the rates, in Hz.
const PASSBAND_HZ: f64 = 1000.0;

impl Node for Resample {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "resample",
            "Resamples a signal to the audio rate or any other rate (polyphase filter, any ratio).",
        )
        .input(Input::new("in", ShapeSpec::Audio(RateSpec::Of('i')), Unit::NONE).unit_of('u'))
        .doc("signal at its own rate")
        .output(Output::new("out", ShapeSpec::Audio(RateSpec::Graph), Unit::NONE).unit_of('u'))
        .doc("resampled signal")
        .param(integer("rate_hz", 0, 0..=192_000).unit("Hz"))
        .doc("Sample rate of the output; 0: the graph's audio rate.")
        .param(choice("phase", &["linear", "minimum"]).doc(
            "Phase of the filter. `linear` delays all frequencies equally. `minimum` has the least delay; \
             high frequencies are delayed more.",
        ))
        .param(number("passband", 0.4, 0.05..=0.48, "").doc(
            "End of the flat band (0.1 dB), as a fraction of the lower rate. 0.4 of 2500 Hz is 1000 Hz. A \
             value nearer 0.5 needs a longer filter.",
        ))
        .param(precision())
        .timing("latency of the filter; `asperity check` prints it")
    }

    fn ports(config: &Config<'_>, mut ports: Ports) -> Result<Ports, Diagnostic> {
        match config.params.integer("rate_hz") {
            0 => {}
            hz if hz >= 100 => ports.outputs[0].shape = ShapeSpec::Audio(RateSpec::Hz(hz as u32)),
            _ => {
                return Err(config
                    .params
                    .error("rate_hz", "a rate below 100 Hz carries no texture")
                    .help("0, or 100 to 192000 Hz"));
            }
        }
        Ok(ports)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        in_precision(setup, prepare::<f32>, prepare::<f64>)
    }
}

fn prepare<T: Float>(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
    let p = setup.params;
    let (in_hz, out_hz) = (setup.input_rate(0), setup.output_rate(0));
    let phase = if p.text("phase") == "minimum" { FilterPhase::Minimum } else { FilterPhase::Linear };
    if in_hz == out_hz {
        return Ok(Prepared::new(Resample::<T> { kernel: None, in_hz, out_hz }));
    }
    // Above the predicted band there is nothing to keep, so a shorter filter is enough.
    let mut passband = p.number("passband");
    if !p.is_set("passband") {
        passband = passband.min(PASSBAND_HZ / f64::from(in_hz.min(out_hz))).max(0.05);
    }
    let conversion = Conversion { in_hz, out_hz, tick_num: setup.tick_hz, tick_den: 1, phase, passband };
    let kernel = Resampler::<T>::new(&conversion)
        .map_err(|e| p.node_error(format!("cannot go from {in_hz} to {out_hz} Hz: {e}")))?;
    let (num, den) = kernel.latency();
    let latency = Latency::ratio(num as i64, den as i64);
    let it = Resample { kernel: Some(kernel), in_hz, out_hz };
    Ok(Prepared::new(it).latency(latency).tail(latency + latency))
}

impl<T: Float> Processor for Resample<T> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let (first_in, first_out) = (tick.samples(self.in_hz).start, tick.samples(self.out_hz).start);
        let (input, output) = (tick.inputs.audio(0), tick.outputs.audio(0));
        match &mut self.kernel {
            Some(kernel) => kernel.process(first_in, input, first_out, output),
            None => output.copy_from_slice(input),
        }
        Status::Continue
    }

    fn reset(&mut self) {
        if let Some(kernel) = &mut self.kernel {
            kernel.reset();
        }
    }

    /// The newest inputs; a filter of another length, and so with another `passband`, starts anew.
    fn state(&mut self, state: &mut State<'_>) {
        if let Some(kernel) = &mut self.kernel {
            kernel.state(state);
        }
    }
}
