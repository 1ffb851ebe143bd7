//! Scores that others reached, from the `sc.json` beside the vectors.

use asperity_diagnostics::Diagnostic;
use serde_json::Value;

use super::vectors::Vector;
use crate::phase::FRAME_HZ;

/// Where a method's samples lie in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Delay {
    /// So many milliseconds late; early where it is negative.
    Ms(f64),
    /// It needs the whole signal.
    Offline,
    /// Nobody says.
    Unknown,
}

/// Agreement of one signal with one vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Spectral convergence in dB.
    pub convergence_db: f64,
    /// Energy over that of the magnitudes in dB.
    pub level_db: f64,
    /// Root mean square of the error in dB of the long-term spectrum.
    pub ltas_rms_db: f64,
}

impl Score {
    /// Whether the signal has no energy to speak of; its level and long-term spectrum then say nothing.
    pub fn is_silent(&self) -> bool {
        self.level_db < -200.0
    }
}

/// A published method.
#[derive(Clone, Debug, PartialEq)]
pub struct Published {
    /// What it is called there.
    pub name: String,
    /// Its latency.
    pub delay: Delay,
    scores: Vec<(String, Score)>,
}

impl Published {
    /// What it reached on a vector.
    pub fn score(&self, vector: &Vector) -> Option<Score> {
        self.scores.iter().find(|(name, _)| *name == vector.name).map(|(_, score)| *score)
    }
}

/// Reads `{"sc": {VECTOR: {METHOD: {"SC_dB", "gain_dB", "LTAS_rms_dB"}}}, "latency_frames": {METHOD: frames or "offline"}}`.
///
/// # Errors
/// Another structure.
pub fn read(json: &Value) -> Result<Vec<Published>, Diagnostic> {
    let fail = |what: &str| Diagnostic::new(format!("these are no published scores: {what}"));
    let vectors = json.get("sc").and_then(Value::as_object).ok_or_else(|| fail("no object `sc`"))?;
    let mut all: Vec<Published> = Vec::new();
    for (vector, methods) in vectors {
        let methods = methods.as_object().ok_or_else(|| fail(&format!("`{vector}` is no object")))?;
        for (name, figures) in methods {
            let number = |key: &str| {
                let missing = || fail(&format!("`{vector}`, `{name}` has no number `{key}`"));
                figures.get(key).and_then(Value::as_f64).ok_or_else(missing)
            };
            let score = Score {
                convergence_db: number("SC_dB")?,
                level_db: number("gain_dB")?,
                ltas_rms_db: number("LTAS_rms_dB")?,
            };
            let at = all.iter().position(|p| p.name == *name).unwrap_or_else(|| {
                all.push(Published { name: name.clone(), delay: delay(json, name), scores: Vec::new() });
                all.len() - 1
            });
            all[at].scores.push((vector.clone(), score));
        }
    }
    Ok(all)
}

fn delay(json: &Value, name: &str) -> Delay {
    match json.get("latency_frames").and_then(|l| l.get(name)) {
        Some(Value::String(word)) if word == "offline" => Delay::Offline,
        Some(frames) => frames.as_f64().map_or(Delay::Unknown, |f| Delay::Ms(f * 1e3 / f64::from(FRAME_HZ))),
        None => Delay::Unknown,
    }
}
