//! The result for programs: JSON and CSV.

use std::fmt::Write as _;

use asperity_accuracy::accuracy::Rhythm;
use serde_json::{Map, Value, json};

use super::contest::{Outcome, Row};
use super::published::Delay;
use super::vectors::Set;

/// Everything as JSON.
pub fn json(set: &Set, outcome: &Outcome, published: &[Row]) -> Value {
    let vectors: Vec<Value> = set
        .vectors
        .iter()
        .map(|v| {
            let layout = v.frames.layout();
            json!({
                "name": v.name, "rate_hz": v.rate_hz, "window": layout.length, "bins": layout.bins,
                "frames": v.frames.count(), "roughness": v.roughness(),
            })
        })
        .collect();
    let all = |rows: &[Row]| rows.iter().map(|row| row_json(set, row)).collect::<Vec<_>>();
    json!({
        "vectors": vectors, "smoothest": set.smoothest().map(|v| set.vectors[v].name.clone()),
        "noise": outcome.noise.map(rhythm), "methods": all(&outcome.rows), "published": all(published),
    })
}

fn row_json(set: &Set, row: &Row) -> Value {
    let mut scores = Map::new();
    for (v, vector) in set.vectors.iter().enumerate() {
        let score = row.scores[v].map(|s| {
            json!({
                "convergence_db": s.convergence_db, "level_db": s.level_db, "ltas_rms_db": s.ltas_rms_db,
                "faults": row.faults[v],
            })
        });
        scores.insert(vector.name.clone(), score.unwrap_or_default());
    }
    let us: Map<String, Value> =
        row.frame_us.iter().map(|(rate, us)| (rate.to_string(), json!(us))).collect();
    let (latency, offline) = delay(row.delay);
    json!({
        "label": row.label, "kind": row.kind, "scores": scores, "latency_ms": latency, "offline": offline,
        "lag_ms": {"texture": row.texture_lag_ms, "tone": row.tone_lag_ms}, "us_a_frame": us, "rhythm": row.rhythm.map(rhythm), "notes": row.notes,
    })
}

fn rhythm(r: Rhythm) -> Value {
    json!({
        "modulation": r.modulation, "pulses": r.pulses(), "envelope_repetition": r.envelope_repetition,
        "wave_repetition": r.wave_repetition, "repetition": r.repetition(), "kurtosis": r.kurtosis,
        "level_deviation_db": r.level_deviation_db,
    })
}

/// Pulses, repetition and kurtosis.
fn rhythm_cells(r: Option<Rhythm>) -> [String; 3] {
    [cell(r.map(|r| r.pulses())), cell(r.map(|r| r.repetition())), cell(r.map(|r| r.kurtosis))]
}

fn delay(delay: Delay) -> (Option<f64>, bool) {
    match delay {
        Delay::Ms(ms) => (Some(ms), false),
        Delay::Offline => (None, true),
        Delay::Unknown => (None, false),
    }
}

/// A line for each method and vector; figures that do not depend on the vector are repeated.
pub fn csv(set: &Set, outcome: &Outcome, published: &[Row]) -> String {
    let mut out = String::from(
        "method,kind,published,vector,rate_hz,convergence_db,level_db,ltas_rms_db,faults,latency_ms,offline,\
         lag_texture_10_ms,lag_texture_50_ms,lag_texture_90_ms,lag_tone_10_ms,lag_tone_50_ms,lag_tone_90_ms,\
         us_a_frame,pulses,repetition,kurtosis,noise_pulses,noise_repetition,noise_kurtosis,notes\n",
    );
    for (row, published) in outcome.rows.iter().map(|r| (r, false)).chain(published.iter().map(|r| (r, true)))
    {
        for (v, vector) in set.vectors.iter().enumerate() {
            let score = row.scores[v];
            let mut cells = vec![
                quoted(&row.label),
                quoted(row.kind.as_deref().unwrap_or("")),
                published.to_string(),
                quoted(&vector.name),
                vector.rate_hz.to_string(),
                cell(score.map(|s| s.convergence_db)),
                cell(score.map(|s| s.level_db)),
                cell(score.map(|s| s.ltas_rms_db)),
                row.faults[v].to_string(),
                cell(delay(row.delay).0),
                delay(row.delay).1.to_string(),
            ];
            for lag in [row.texture_lag_ms, row.tone_lag_ms] {
                cells.extend((0..3).map(|i| cell(lag.map(|l| l[i]))));
            }
            cells.push(cell(row.frame_us.get(&vector.rate_hz).copied()));
            cells.extend(rhythm_cells(row.rhythm));
            cells.extend(rhythm_cells(outcome.noise));
            cells.push(quoted(&row.notes.join("; ")));
            let _ = writeln!(out, "{}", cells.join(","));
        }
    }
    out
}

/// A number to a ten-thousandth; nothing where there is none.
fn cell(x: Option<f64>) -> String {
    x.map_or(String::new(), |x| format!("{x:.4}"))
}

/// A text as a field (RFC 4180).
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
