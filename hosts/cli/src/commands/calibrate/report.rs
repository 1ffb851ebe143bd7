//! The result as text, JSON and picture.

use std::fmt::Write as _;
use std::path::PathBuf;

use asperity_actuator::ActuatorProfile;
use asperity_actuator::identify::{Estimate, Findings, Measurement};
use asperity_plot::{Measured, Response};
use serde_json::{Map, Value, json};

use super::sweeps::Tape;
use super::{Args, DriveKind, amps_per_volt, unit, volts_per_volt};

/// A calibration that is over.
pub struct Report<'a> {
    pub args: &'a Args,
    pub base: &'a ActuatorProfile,
    pub findings: &'a Findings,
    pub tapes: &'a [Tape],
    pub written: Vec<PathBuf>,
}

/// A figure of the profile beside the base's.
struct Figure {
    name: &'static str,
    key: &'static str,
    unit: &'static str,
    found: Estimate,
    base: f64,
    /// Whether the base's figure is an estimate.
    estimate: bool,
    /// Whether it was measured; else it is the base's.
    measured: bool,
}

impl Report<'_> {
    fn figures(&self) -> [Figure; 4] {
        let (f, b) = (self.findings, self.base);
        let all = [
            ("moving mass", "moving_mass_g", "g", f.moving_mass.times(1e3), &b.moving_mass, 1e3),
            ("stiffness", "stiffness_n_per_m", "N/m", f.stiffness, &b.stiffness, 1.0),
            ("damping", "damping_n_s_per_m", "N s/m", f.damping, &b.damping, 1.0),
            ("force factor", "force_factor_n_per_a", "N/A", f.force_factor, &b.force_factor, 1.0),
        ];
        all.map(|(name, key, unit, found, base, factor)| {
            let measured = f.moving_mass_measured || name != "moving mass";
            // The fit may have moved it within its uncertainty; the profile has the base's.
            let value = if measured { found.value } else { base.value * factor };
            Figure {
                name,
                key,
                unit,
                found: Estimate { value, ..found },
                base: base.value * factor,
                estimate: base.estimate,
                measured,
            }
        })
    }

    /// The result as text.
    pub fn text(&self, trusted: bool) -> String {
        let mut out = String::new();
        let _ = writeln!(out, "{:<14}{:>18}   {:<24}{}", "", "measured", "95 % interval", self.base.name);
        for f in self.figures() {
            let value = format!("{} {}", digits(f.found.value), f.unit);
            let within = if f.measured { interval(&f.found) } else { "the base's".into() };
            let base = format!("{}{}", digits(f.base), if f.estimate { " (an estimate)" } else { "" });
            let _ = writeln!(out, "{:<14}{value:>18}   {within:<24}{base}", f.name);
        }
        for (m, tape) in self.findings.recordings.iter().zip(self.tapes) {
            let _ = writeln!(
                out,
                "\non {} g, {:.3} {} peak",
                tape.handle_mass_g,
                tape.amplitude,
                unit(self.args)
            );
            for (name, value, within) in self.measurement(m) {
                let _ = writeln!(out, "  {name:<12}{value:>18}   {within}");
            }
            let distortion =
                m.distortion.map_or(String::new(), |d| format!(", distortion {:.1} %", 100.0 * d));
            let _ = writeln!(
                out,
                "  {:.0} dB signal to noise, coherence {:.3}, {:.1} % unexplained{distortion}",
                m.snr_db,
                m.coherence,
                100.0 * m.misfit
            );
        }
        let _ = writeln!(out, "\ntrust         {}", self.findings.trust.word());
        for note in &self.findings.notes {
            let _ = writeln!(out, "              - {note}");
        }
        let _ = writeln!(out, "assumed");
        for what in self.assumed() {
            let _ = writeln!(out, "              - {what}");
        }
        for path in &self.written {
            let _ = writeln!(out, "wrote         {}", path.display());
        }
        if !trusted {
            let _ = writeln!(
                out,
                "the profile is not written, since it is not to be trusted (--anyway writes it all the same)"
            );
        }
        out
    }

    /// Figures of one recording: name, value, interval.
    fn measurement(&self, m: &Measurement) -> [(&'static str, String, String); 4] {
        let gain = format!("{} m/s^2/A", digits(m.gain.value));
        let polarity = if m.inverted { ", polarity inverted" } else { "" };
        let latency = format!("{:.3} ms", 1e3 * m.latency_s);
        [
            ("resonance", format!("{} Hz", digits(m.natural_hz.value)), interval(&m.natural_hz)),
            ("damping", format!("{} ratio", digits(m.damping_ratio.value)), interval(&m.damping_ratio)),
            ("gain", gain, interval(&m.gain)),
            ("latency", latency, format!("within {:.1} us{polarity}", 1e6 * m.latency_within_s)),
        ]
    }

    /// Assumptions behind the figures.
    fn assumed(&self) -> Vec<String> {
        let a = self.args;
        let masses: Vec<String> = self.tapes.iter().map(|t| format!("{} g", t.handle_mass_g)).collect();
        let mut all = vec![
            format!("the handle weighs {} within {} %", masses.join(" and "), a.mass_uncertainty),
            format!("the input is at full scale at {} m/s^2", a.accelerometer_full_scale),
        ];
        all.push(match a.drive {
            DriveKind::Current => format!(
                "full scale of the output is {} V, and the amplifier gives {} A/V: \
                 an error of either is one of the force factor",
                a.volts_at_full_scale,
                amps_per_volt(a)
            ),
            DriveKind::Voltage => format!(
                "full scale of the output is {} V, the amplifier gives {} V/V, \
                 and the coil has {} ohm, known within 3 %, and {} uH",
                a.volts_at_full_scale,
                volts_per_volt(a),
                digits(self.base.resistance.value),
                digits(self.base.inductance.value * 1e6)
            ),
        });
        if !self.findings.moving_mass_measured {
            let from = if self.base.moving_mass.estimate { "an estimate" } else { "a published figure" };
            all.push(format!("the moving mass is the base's, {from}"));
        }
        all.push("limits of current, stroke and heat are the base's".into());
        all
    }

    /// The result as JSON.
    pub fn json(&self, trusted: bool) -> String {
        let estimate = |e: &Estimate| json!({ "value": e.value, "low": e.low, "high": e.high });
        let figures: Map<String, Value> = self
            .figures()
            .iter()
            .map(|f| {
                let value = json!({
                    "value": f.found.value, "low": f.found.low, "high": f.found.high, "measured": f.measured,
                    "base": f.base, "base_is_estimate": f.estimate,
                });
                (f.key.to_owned(), value)
            })
            .collect();
        let recordings: Vec<Value> = self
            .findings
            .recordings
            .iter()
            .zip(self.tapes)
            .zip(&self.findings.curves)
            .map(|((m, tape), curve)| {
                let points: Vec<Value> = curve
                    .iter()
                    .map(|p| {
                        json!({
                            "hz": p.hz, "measured_db": p.measured_db, "measured_rad": p.measured_phase,
                            "fitted_db": p.fitted_db, "fitted_rad": p.fitted_phase, "coherence": p.coherence,
                        })
                    })
                    .collect();
                json!({
                    "handle_mass_g": tape.handle_mass_g, "level": tape.amplitude, "limited": tape.limited,
                    "resonance_hz": estimate(&m.natural_hz), "damping_ratio": estimate(&m.damping_ratio),
                    "gain_m_s2_per_a": estimate(&m.gain), "latency_ms": 1e3 * m.latency_s,
                    "inverted": m.inverted, "snr_db": m.snr_db, "coherence": m.coherence,
                    "misfit": m.misfit, "distortion": m.distortion,
                    "band_hz": [m.band_hz.0, m.band_hz.1], "points": points,
                })
            })
            .collect();
        let report = json!({
            "asperity": env!("CARGO_PKG_VERSION"), "base": self.base.name, "drive": unit(self.args),
            "figures": figures, "moving_mass_measured": self.findings.moving_mass_measured,
            "recordings": recordings,
            "trust": self.findings.trust.word(), "notes": self.findings.notes, "assumed": self.assumed(),
            "profile_written": trusted, "written": self.written,
        });
        format!("{report:#}\n")
    }

    /// Measured and fitted response as SVG.
    pub fn picture(&self) -> String {
        let f = self.findings;
        let device = self.tapes.first().map_or("", |t| &t.device);
        let level = self.tapes.first().map_or(0.0, |t| t.amplitude);
        let figures = self.figures().map(|f| {
            let within =
                if f.measured { format!("95 %: {}", interval(&f.found)) } else { "not measured".into() };
            let base = format!("base: {}{}", digits(f.base), if f.estimate { ", an estimate" } else { "" });
            (f.name.to_owned(), format!("{} {}", digits(f.found.value), f.unit), vec![within, base])
        });
        let runs = f.recordings.iter().zip(self.tapes).zip(&f.curves).map(|((m, tape), curve)| Measured {
            label: format!("on {} g", tape.handle_mass_g),
            points: curve.clone(),
            figures: vec![
                format!("resonance {} Hz", digits(m.natural_hz.value)),
                format!("damping ratio {}", digits(m.damping_ratio.value)),
                format!("{:.0} dB signal to noise", m.snr_db),
                format!("{:.1} % unexplained", 100.0 * m.misfit),
            ],
        });
        Response {
            title: format!("{}: acceleration of the handle", self.base.name),
            subtitle: format!(
                "Sweep of {level:.3} {} on {device}. Trust: {}.",
                unit(self.args),
                f.trust.word()
            ),
            unit: format!("dB re 1 m/s\u{b2} per {}", unit(self.args)),
            runs: runs.collect(),
            figures: figures.into(),
        }
        .to_svg()
    }
}

/// Both ends of an interval, if it is determined.
fn interval(e: &Estimate) -> String {
    if !e.is_determined() {
        return "not determined".into();
    }
    format!("{} to {}", digits(e.low), digits(e.high))
}

/// Four significant digits.
fn digits(x: f64) -> String {
    let decimals = (3 - x.abs().max(1e-9).log10().floor() as i32).clamp(0, 8);
    format!("{x:.*}", decimals as usize)
}
