use asperity_numbers::Elementary as _;
use std::f64::consts::TAU;

use asperity_diagnostics::Diagnostic;
use asperity_dsp::window::hann;

use super::Filter;
use asperity_dsp::frame::{BIN_HZ, BINS, WINDOW_S};

/// Rates of models [Hz].
pub(super) const RATES_HZ: std::ops::RangeInclusive<f64> = 100.0..=100_000.0;

/// Mean magnitudes of frames of a signal, for signals of one rate.
#[derive(Clone, Debug)]
pub struct Frames {
    /// Autocorrelation of the window at lags 0, 1, .., twice beyond 0, scaled to give amplitudes.
    correlation: Vec<f64>,
    /// `cos(w_k m)`: a row of lags for each known bin.
    cosines: Vec<f64>,
}

impl Frames {
    /// Frames of 0.1 s of a signal at `rate_hz`.
    ///
    /// # Errors
    /// A rate outside 100 Hz to 100 kHz.
    pub fn new(rate_hz: f64) -> Result<Self, Diagnostic> {
        if !RATES_HZ.contains(&rate_hz) {
            let help = format!("models run at {} to {} Hz", RATES_HZ.start(), RATES_HZ.end());
            return Err(Diagnostic::new(format!("a rate of {rate_hz} Hz")).help(help));
        }
        let window = hann::<f64>((rate_hz * WINDOW_S).round() as usize);
        let scale = (2.0 / window.iter().sum::<f64>()).powi(2);
        let correlation: Vec<f64> = (0..window.len())
            .map(|lag| {
                let sum: f64 = window.iter().zip(&window[lag..]).map(|(a, b)| a * b).sum();
                if lag == 0 { scale * sum } else { 2.0 * scale * sum }
            })
            .collect();
        // Includes the Nyquist frequency itself, whatever the rounding.
        let known = ((0.5 * rate_hz / BIN_HZ * (1.0 + 1e-12)) as usize).min(BINS);
        let cosines = (1..=known)
            .flat_map(|bin| {
                let w = TAU * bin as f64 * BIN_HZ / rate_hz;
                (0..correlation.len()).map(move |lag| (w * lag as f64).cosine())
            })
            .collect();
        Ok(Self { correlation, cosines })
    }

    /// Number of bins at or below half the rate. A model says nothing about bins above.
    pub fn known_bins(&self) -> usize {
        self.cosines.len() / self.correlation.len().max(1)
    }

    /// Exact `E[A_k^2]` in (m/s^2)^2 of amplitudes `A_k = 2 |sum w x| / sum w` at 10, 20 .. 1000 Hz.
    /// Bins above [`known_bins`](Self::known_bins) are 0.
    pub fn expected_power(&self, filter: &Filter) -> [f64; BINS] {
        let mut power = [0.0; BINS];
        if filter.deviation == 0.0 || filter.gain == 0.0 {
            return power;
        }
        let mut products = vec![0.0; self.correlation.len()];
        filter.autocovariance(&mut products);
        products.iter_mut().zip(&self.correlation).for_each(|(r, c)| *r *= c);
        for (power, cosines) in power.iter_mut().zip(self.cosines.chunks_exact(products.len())) {
            let sum: f64 = products.iter().zip(cosines).map(|(p, c)| p * c).sum();
            // Rounding may go below 0.
            *power = sum.max(0.0);
        }
        power
    }
}
