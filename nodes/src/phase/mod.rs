//! Phase retrieval: from magnitudes to spectra, or straight to a signal.

mod oscillator_bank;
mod sample_commit;
mod shaped_noise;
mod spectra;

use crate::prelude::*;
use asperity_dsp::Framing;

pub use oscillator_bank::OscillatorBank;
pub use sample_commit::SampleCommit;
pub use shaped_noise::ShapedNoise;
pub use spectra::{PhaseVocoder, RandomPhase, Spsi};

/// The layout of the first input's frames.
pub(crate) fn framing(setup: &Setup<'_>) -> Result<Framing, Diagnostic> {
    let Some(Shape::Magnitude(l) | Shape::Spectrum(l)) = setup.input(0).map(|p| p.shape) else {
        return Err(setup.params.node_error("the layout of the frames cannot be determined"));
    };
    Ok(Framing {
        rate_hz: l.rate_hz,
        fft_len: l.length as usize,
        bins: l.bins as usize,
        frame_num: l.frame_rate.num(),
        frame_den: l.frame_rate.den(),
    })
}

/// The parameter `seed`, or the node's own where the graph leaves it out.
pub(crate) fn seed_of(setup: &Setup<'_>) -> u64 {
    setup.params.get_integer("seed").map_or(setup.seed, |s| s as u64)
}

/// Error of a kernel's constructor, at the node.
pub(crate) fn kernel_error<E: std::fmt::Display>(setup: &Setup<'_>) -> impl FnOnce(E) -> Diagnostic {
    |e| setup.params.node_error(e.to_string())
}

/// The error of frames that do not overlap.
pub(crate) fn too_rare(setup: &Setup<'_>) -> Diagnostic {
    let error = setup.params.node_error("the frames come too rarely to overlap");
    error.help("at least two frames a window: 20 a second for 0.1 s")
}
