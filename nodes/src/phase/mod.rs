//! Phase retrieval: from magnitudes to spectra, or straight to a signal.

mod oscillator_bank;
mod phase_vocoder;
mod random_phase;
mod sample_commit;
mod shaped_noise;
mod spsi;

use asperity_dsp::Framing;
use asperity_node::{Diagnostic, Setup, Shape};

pub use oscillator_bank::OscillatorBank;
pub use phase_vocoder::PhaseVocoder;
pub use random_phase::RandomPhase;
pub use sample_commit::SampleCommit;
pub use shaped_noise::ShapedNoise;
pub use spsi::Spsi;

/// The layout of the first input's magnitudes.
pub(crate) fn framing(setup: &Setup<'_>) -> Result<Framing, Diagnostic> {
    let Some(Shape::Magnitude(l)) = setup.input(0).map(|p| p.shape) else {
        return Err(setup.params.node_error("nothing settles the layout of the frames"));
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
pub(crate) fn seed(setup: &Setup<'_>) -> u64 {
    setup.params.get_integer("seed").map_or(setup.seed, |s| s as u64)
}
