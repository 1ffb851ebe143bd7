//! `file_out`: audio of any kind and rate to a file.

use crate::prelude::*;

/// A sink for audio of any unit and rate; the host writes its output to a WAV file, or a .npy file.
pub struct FileOut {
    scale: f32,
}

impl Node for FileOut {
    fn descriptor() -> Descriptor {
        Descriptor::new("file_out", "Records audio of any unit and rate to its own file.")
            .role(Role::Recorder)
            .input(audio("in").doc("audio to record"))
            .output(Output::new("samples", ShapeSpec::Audio(RateSpec::Of('r')), Unit::FULL_SCALE))
            .doc("samples that are written")
            .param(text("file", "").required())
            .doc("File to write: .wav (32-bit float) or .npy, relative to the working folder.")
            .param(number("full_scale", 1.0, 1e-9..=1e9, ""))
            .doc("Input value that is written as 1, in the input's unit.")
            .sink()
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        super::check_file(setup, &[".wav", ".npy"])?;
        Ok(Prepared::new(Self { scale: (1.0 / setup.params.number("full_scale")) as f32 }))
    }
}

impl Processor for FileOut {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        for (y, x) in tick.outputs.audio(0).iter_mut().zip(tick.inputs.audio(0)) {
            *y = self.scale * x;
        }
        Status::Continue
    }
}
