//! Writes a profile from findings.

use std::fmt::Write;

use super::super::ActuatorProfile;
use super::super::profile::FIELDS;
use super::{Estimate, Findings, Trust};

/// Text of a profile with the measured figures, for [`ActuatorProfile::parse`]. Other values come from
/// `base` with their source and are marked as estimates. `date` is written as given.
///
/// Findings of [`Trust::Poor`] are marked as estimates too. Notes stand at the top.
pub fn write_profile(findings: &Findings, base: &ActuatorProfile, date: Option<&str>) -> String {
    let mut text = String::new();
    let when = date.map(|d| format!(" on {}", one_line(d))).unwrap_or_default();
    let _ = writeln!(text, "// {}, measured{when}. Trust: {}.", one_line(&base.name), findings.trust.word());
    for m in &findings.recordings {
        let _ = writeln!(
            text,
            "// On {:.1} g: resonance {:.2} Hz, damping ratio {:.4}, {:.0} dB signal to noise, \
             coherence {:.3}, misfit {:.1} %.",
            m.handle_mass * 1e3,
            m.natural_hz.value,
            m.damping_ratio.value,
            m.snr_db,
            m.coherence,
            100.0 * m.misfit
        );
    }
    for note in &findings.notes {
        let _ = writeln!(text, "// Note: {}.", one_line(note));
    }
    let _ = writeln!(text, "ActuatorProfile(\n    version: 1,\n    name: {:?},", base.name);
    for ((name, quantity), (_, unit, say, _, _, si)) in base.quantities().into_iter().zip(FIELDS) {
        let (value, source, estimate) = match measured(findings, name) {
            Some(estimate) => {
                let value = estimate.times(1.0 / si);
                (value.value, source(findings, name, value, say, &when), findings.trust == Trust::Poor)
            }
            None => (quantity.value / si, quantity.source.clone(), true),
        };
        let estimate = if estimate { "estimate: true, " } else { "" };
        let _ = writeln!(text, "    {name}: ({unit}: {}, {estimate}source: {source:?}),", digits(value));
    }
    text.push_str(")\n");
    text
}

fn measured(f: &Findings, name: &str) -> Option<Estimate> {
    match name {
        "m_a" => f.moving_mass_measured.then_some(f.moving_mass),
        "k" => Some(f.stiffness),
        "damping" => Some(f.damping),
        "k_f" => Some(f.force_factor),
        _ => None,
    }
}

fn source(f: &Findings, name: &str, value: Estimate, unit: &str, when: &str) -> String {
    let with = match name {
        "k" | "damping" if !f.moving_mass_measured => ", with the moving mass given here",
        _ => "",
    };
    let trust = f.trust.word();
    if !value.is_determined() {
        return format!("measured{when}, but not determined by that{with}, trust {trust}");
    }
    let (low, high) = (digits(value.low), digits(value.high));
    format!("measured{when}: 95 % interval {low} to {high} {unit}{with}, trust {trust}")
}

/// Five significant digits.
fn digits(x: f64) -> String {
    format!("{:.4e}", x).parse::<f64>().map_or_else(|_| x.to_string(), |x| x.to_string())
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
