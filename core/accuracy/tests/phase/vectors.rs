//! The vectors, and their published scores.

use asperity_accuracy::phase::Score;
use asperity_accuracy::{npy, phase};

/// All vectors, with their sample rates.
pub(crate) const VECTORS: [(&str, u32); 9] = [
    ("sine_off_2500", 2500),
    ("chirp_2500", 2500),
    ("texture_2500", 2500),
    ("two25_2500", 2500),
    ("taps_2500", 2500),
    ("contact_2500", 2500),
    ("nnsmooth_2500", 2500),
    ("texture_48000", 48_000),
    ("amchirp_48000", 48_000),
];

/// A file's values.
pub(crate) fn data(name: &str) -> Vec<f64> {
    let path = format!("{}/../../tests/data/phase/{name}.npy", env!("CARGO_MANIFEST_DIR"));
    npy::read(path).unwrap().values.into_f64()
}

/// Magnitudes of a vector: its file; where only the signal is kept, its transform.
pub(crate) fn vector(name: &str, rate_hz: u32) -> Vec<f32> {
    let framing = phase::framing(rate_hz, 101);
    let from_signal = ["chirp_2500", "taps_2500", "contact_2500"].contains(&name);
    let all = if from_signal {
        let signal = data(&format!("{name}.sig"));
        let frames = (signal.len() - framing.fft_len) / (rate_hz as usize / 500) + 1;
        phase::magnitudes(&signal, &framing, frames)
    } else {
        data(&format!("{name}.mag"))
    };
    all.into_iter().map(|x| x as f32).collect()
}

/// Magnitudes as amplitudes, for kernels.
pub(crate) fn amplitudes(magnitudes: &[f32], rate_hz: u32) -> Vec<f32> {
    let scale = phase::framing(rate_hz, 101).bin_scale();
    magnitudes.iter().map(|&m| (f64::from(m) / scale) as f32).collect()
}

/// Scores a signal whose sample 0 is the first of frame 0.
pub(crate) fn score(magnitudes: &[f32], rate_hz: u32, signal: &[f64]) -> Score {
    phase::score(magnitudes, &phase::framing(rate_hz, 101), signal).unwrap()
}

/// `SC_dB`, `gain_dB` and `LTAS_rms_dB` of a method in `sc.json`.
pub(crate) fn published(name: &str, method: &str) -> Option<[f64; 3]> {
    let path = format!("{}/../../tests/data/phase/sc.json", env!("CARGO_MANIFEST_DIR"));
    let all: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let figure = |key| all["sc"][name][method][key].as_f64();
    Some([figure("SC_dB")?, figure("gain_dB")?, figure("LTAS_rms_dB")?])
}
