//! Phase retrieval: from magnitudes to spectra, or straight to a signal.

mod oscillator_bank;
mod phase_vocoder;
mod random_phase;
mod sample_commit;
mod shaped_noise;
mod spsi;

use crate::precision::Precise;
use asperity_dsp::Framing;
use asperity_node::{Diagnostic, Setup, Shape};

/// `oscillator_bank` in either precision.
pub type OscillatorBank = Precise<oscillator_bank::OscillatorBank<f32>, oscillator_bank::OscillatorBank<f64>>;
/// `phase_vocoder` in either precision.
pub type PhaseVocoder = Precise<phase_vocoder::PhaseVocoder<f32>, phase_vocoder::PhaseVocoder<f64>>;
/// `random_phase` in either precision.
pub type RandomPhase = Precise<random_phase::RandomPhase<f32>, random_phase::RandomPhase<f64>>;
/// `sample_commit` in either precision.
pub type SampleCommit = Precise<sample_commit::SampleCommit<f32>, sample_commit::SampleCommit<f64>>;
/// `shaped_noise` in either precision.
pub type ShapedNoise = Precise<shaped_noise::ShapedNoise<f32>, shaped_noise::ShapedNoise<f64>>;
/// `spsi` in either precision.
pub type Spsi = Precise<spsi::Spsi<f32>, spsi::Spsi<f64>>;

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
