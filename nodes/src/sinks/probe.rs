//! `probe`: shows its input to the host.

use crate::prelude::*;

/// A sink for any signal. The host reads its input after every tick and writes it. A probe keeps nothing
/// awake, so looking at a graph does not change what the graph does.
pub struct Probe;

impl Node for Probe {
    fn descriptor() -> Descriptor {
        Descriptor::new("probe", "Records any signal to a file.")
            .role(Role::Probe)
            .input(like("in").doc("signal to record"))
            .param(text("file", ""))
            .doc(
                "File to write: .csv, .npy, or .npz with rate and unit. Relative to the working folder. \
                 Empty: nothing is recorded.",
            )
            .timing(
                "keeps no node awake: while its source sleeps, audio is zero and a control holds its value",
            )
            .passive_sink()
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        if !setup.params.text("file").is_empty() {
            super::check_file(setup, &[".csv", ".npy", ".npz"])?;
        }
        Ok(Prepared::new(Self))
    }
}

impl Processor for Probe {
    fn process(&mut self, _tick: &mut Tick<'_>) -> Status {
        Status::Continue
    }
}
