//! Effects from what stands behind their fields, for those that are read without a scene.

use asperity_diagnostics::Diagnostic;
use asperity_diagnostics::ron::Value;

use super::{Drag, Friction, Hum, Knock, Loop, Pull, Sound, Texture, effects};
use crate::effect::{Recording, Transient, WaveformTable};
use asperity_data::wav::Wav;

/// Longest recording of a tap in samples: a minute and a half at 48 kHz.
const MAX_RECORDED: u32 = 1 << 22;
/// The loudest of a tap.
const MOST_M_S2: f32 = 1e6;

impl Friction {
    /// Reads what stands behind `friction` in a scene, such as `dahl(coefficient: 0.4)`.
    ///
    /// # Errors
    /// An unknown law or field, a number out of its range.
    pub fn parse(value: &Value) -> Result<Self, Diagnostic> {
        effects::friction(value)
    }
}

impl Texture {
    /// Reads one texture of those behind `texture` in a scene, such as `autoregressive(model: "a.ron")`.
    ///
    /// # Errors
    /// An unknown kind or field, a number out of its range. Files that it names are not looked at.
    pub fn parse(value: &Value) -> Result<Self, Diagnostic> {
        effects::texture(value)
    }

    /// Reads all that stands behind `texture` in a scene: one texture, or a list of them.
    ///
    /// # Errors
    /// As [`parse`](Self::parse).
    pub fn parse_all(value: &Value) -> Result<Vec<Self>, Diagnostic> {
        effects::one_or_more(value).iter().map(Self::parse).collect()
    }

    /// The loop of a waveform, ready to be read; none of another texture. A recording is read from its file.
    ///
    /// # Errors
    /// A file that is no WAV file or is longer than 2^22 samples; values that no loop can have (see [`WaveformTable::new`]).
    pub fn table(&self) -> Result<Option<WaveformTable>, Diagnostic> {
        let Self::Waveform { values, crossfade_mm, quantity, .. } = self else { return Ok(None) };
        match values {
            Loop::Segments { segments, spacing_mm } => {
                WaveformTable::from_segments(segments, *spacing_mm, *crossfade_mm, *quantity)
                    .map_err(|e| Diagnostic::new(e.to_string()))
            }
            Loop::Recorded { file, speed_mm_s, full_scale_m_s2 } => {
                let wav = Wav::read(file, MAX_RECORDED)?;
                let values: Vec<f64> = wav.channel(0).map(|x| full_scale_m_s2 * x).collect();
                let spacing_mm = speed_mm_s / f64::from(wav.rate_hz);
                WaveformTable::new(&values, spacing_mm, *crossfade_mm, *quantity)
                    .map_err(|e| Diagnostic::new(e.to_string()).in_file(file))
            }
        }
        .map(Some)
    }

    /// How a scene calls its kind.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Network => "network",
            Self::Autoregressive { .. } => "autoregressive",
            Self::Waveform { .. } => "waveform",
            Self::Relief { .. } => "relief",
        }
    }
}

impl Knock {
    /// Reads what stands behind `tap` in a scene, such as `(sinusoids: [(frequency_hz: 200, decay_ms: 10, gain: 30)])`.
    ///
    /// # Errors
    /// Neither sinusoids nor a recording or both, an unknown field, a number out of its range. A recording's file is not looked at.
    pub fn parse(value: &Value) -> Result<Self, Diagnostic> {
        effects::tap(value)
    }

    /// What it sounds like. A recording is read from its file: of several channels the first.
    ///
    /// # Errors
    /// A file that is no WAV file, is longer than 2^22 samples, or is louder than 10^6 m/s^2.
    pub fn transient(&self) -> Result<Transient, Diagnostic> {
        match &self.sound {
            Sound::Sinusoids(sinusoids) => Ok(Transient::Sinusoids(sinusoids.clone())),
            Sound::Recorded { file, speed_mm_s, full_scale_m_s2, gain } => {
                let wav = Wav::read(file, MAX_RECORDED)?;
                let samples: Vec<f32> = wav.channel(0).map(|x| (gain * full_scale_m_s2 * x) as f32).collect();
                if let Some(x) = samples.iter().find(|x| !x.is_finite() || x.abs() > MOST_M_S2) {
                    let message = format!("a tap of {x:e} m/s^2 is out of range");
                    return Err(Diagnostic::new(message)
                        .in_file(file)
                        .help(format!("up to {MOST_M_S2:e} m/s^2")));
                }
                let rate_hz = f64::from(wav.rate_hz);
                Ok(Transient::Recorded(Recording { samples, rate_hz, speed_mm_s: *speed_mm_s }))
            }
        }
    }
}

impl Hum {
    /// Reads what stands behind `vibration` in a scene: `(frequency_hz: 120, amplitude_m_s2: 2)`.
    ///
    /// # Errors
    /// An unknown field, a number out of its range.
    pub fn parse(value: &Value) -> Result<Self, Diagnostic> {
        effects::vibration(value)
    }
}

impl Drag {
    /// Reads what stands behind `viscosity` in a scene: `(viscosity_ns_per_m: 2, max_force_n: 1.5)`.
    ///
    /// # Errors
    /// An unknown field, a number out of its range.
    pub fn parse(value: &Value) -> Result<Self, Diagnostic> {
        effects::viscosity(value)
    }
}

impl Pull {
    /// Reads what stands behind `magnet` in a scene: `(stiffness_n_per_mm: 0.2, max_force_n: 0.5, reach_mm: 4)`.
    ///
    /// # Errors
    /// An unknown field, a number out of its range.
    pub fn parse(value: &Value) -> Result<Self, Diagnostic> {
        effects::magnet(value)
    }
}
