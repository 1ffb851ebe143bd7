//! Figures of accuracy: those of the trade-off.

use asperity_accuracy::accuracy::rhythm::{self, Rhythm};
use asperity_accuracy::accuracy::{self, Spectrogram};
use asperity_accuracy::phase;
use asperity_offline::failure::Failure;
use asperity_offline::phase::check_rate;
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::error::{Error, raise};

fn fail(e: impl ToString) -> PyErr {
    Error::new_err(e.to_string())
}

/// Axes of a signal \[n, axes\].
fn axes(signal: &PyReadonlyArray2<'_, f64>) -> Vec<Vec<f64>> {
    signal.as_array().columns().into_iter().map(|axis| axis.to_vec()).collect()
}

fn slices(axes: &[Vec<f64>]) -> Vec<&[f64]> {
    axes.iter().map(Vec::as_slice).collect()
}

/// Errors of a signal against draws of the truth, by the names that the trade-off has.
#[pyfunction]
pub fn figures(
    py: Python<'_>,
    rendered: PyReadonlyArray2<'_, f64>,
    truths: Vec<PyReadonlyArray2<'_, f64>>,
    rate: f64,
    truth_rate: f64,
) -> PyResult<Vec<(&'static str, f64)>> {
    let rendered = axes(&rendered);
    let truths: Vec<_> = truths.iter().map(axes).collect();
    py.detach(|| {
        let spectrograms = truths.iter().map(|truth| Spectrogram::new(&slices(truth), truth_rate));
        let spectrograms = spectrograms.collect::<Result<Vec<_>, _>>()?;
        let a = accuracy::compare(&Spectrogram::new(&slices(&rendered), rate)?, &spectrograms)?;
        let rhythms = truths.iter().map(|truth| Rhythm::new(&slices(truth), truth_rate));
        let rhythms = rhythms.collect::<Result<Vec<_>, _>>()?;
        // A truth of a low rate has nothing above half of it.
        let end_hz = rhythms.iter().map(|r| r.end_hz).fold(rhythm::END_HZ, f64::min);
        let r = rhythm::compare(&Rhythm::up_to(&slices(&rendered), rate, end_hz)?, &rhythms)?;
        Ok(vec![
            ("perceptual", a.perceptual),
            ("modulation", r.modulation_db),
            ("spectrum", a.spectrum_db),
            ("bands", a.bands_db),
            ("level", a.level_db.abs()),
            ("repetition", r.repetition),
            ("kurtosis", r.kurtosis_db),
            ("steadiness", r.steadiness_db),
        ])
    })
    .map_err(|e: accuracy::AccuracyError| fail(e))
}

/// Spectral convergence, level and long-term spectrum of a signal against unscaled magnitudes \[dB\].
#[pyfunction]
pub fn convergence(
    py: Python<'_>,
    signal: PyReadonlyArray1<'_, f64>,
    magnitudes: PyReadonlyArray2<'_, f32>,
    rate: u32,
) -> PyResult<[f64; 3]> {
    let signal = signal.as_array().to_vec();
    let bins = magnitudes.as_array().ncols();
    let magnitudes: Vec<f32> = magnitudes.as_array().iter().copied().collect();
    py.detach(|| {
        check_rate(&format!("rate={rate}"), rate).map_err(|e| raise(&Failure::from(e)))?;
        let score = phase::score(&magnitudes, &phase::framing(rate, bins), &signal).map_err(fail)?;
        Ok([score.convergence_db, score.gain_db, score.ltas_rms_db])
    })
}

/// Error of a wave against another run of the same setting \[dB\].
#[pyfunction]
pub fn precision(rendered: PyReadonlyArray1<'_, f64>, reference: PyReadonlyArray1<'_, f64>) -> PyResult<f64> {
    let (rendered, reference) = (rendered.as_array().to_vec(), reference.as_array().to_vec());
    accuracy::waveform_db(&rendered, &reference).map_err(fail)
}

/// Lag at which a wave repeats \[s\], near an expected one, and its autocorrelation there.
#[pyfunction]
pub fn pitch(signal: PyReadonlyArray1<'_, f64>, rate: f64, about_s: f64) -> PyResult<(f64, f64)> {
    let found = rhythm::repeats_at(&signal.as_array().to_vec(), rate, about_s).map_err(fail)?;
    Ok((found.lag_s, found.correlation))
}
