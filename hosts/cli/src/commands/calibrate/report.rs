//! The result as text, JSON and picture.

use std::path::PathBuf;

use asperity_actuator::identify::{Estimate, Findings};
use asperity_actuator::{ActuatorProfile, Drive};
use asperity_plot::{Measured, Response};
use serde_json::{Map, Value, json};

use super::sweeps::Tape;
use super::{Amplifier, Args};

pub(super) struct Report<'a> {
    pub args: &'a Args,
    pub amplifier: Amplifier,
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
            let (base, estimate) = (base.value * factor, base.estimate);
            // The fit may have moved it within its uncertainty; the profile has the base's.
            let value = if measured { found.value } else { base };
            Figure { name, key, unit, found: Estimate { value, ..found }, base, estimate, measured }
        })
    }

    pub fn text(&self, trusted: bool) -> String {
        let f = self.findings;
        let mut out = format!("{:<14}{:>18}   {:<24}{}\n", "", "measured", "95 % interval", self.base.name);
        for f in self.figures() {
            let value = format!("{} {}", digits(f.found.value), f.unit);
            let within = if f.measured { interval(&f.found) } else { "the base's".into() };
            let estimate = if f.estimate { " (an estimate)" } else { "" };
            out += &format!("{:<14}{value:>18}   {within:<24}{}{estimate}\n", f.name, digits(f.base));
        }
        for (m, tape) in f.recordings.iter().zip(self.tapes) {
            let (grams, level, unit) = (tape.handle_mass_g, tape.amplitude, self.amplifier.unit);
            out += &format!("\non {grams} g, {level:.3} {unit} peak\n");
            let mut line = |name, value: String, within: String| {
                out += &format!("  {name:<12}{value:>18}   {within}\n");
            };
            let ratio = &m.damping_ratio;
            line("resonance", format!("{} Hz", digits(m.natural_hz.value)), interval(&m.natural_hz));
            line("damping", format!("{} ratio", digits(ratio.value)), interval(ratio));
            line("gain", format!("{} m/s^2/A", digits(m.gain.value)), interval(&m.gain));
            let polarity = if m.inverted { ", polarity inverted" } else { "" };
            let within = format!("within {:.1} us{polarity}", 1e6 * m.latency_within_s);
            line("latency", format!("{:.3} ms", 1e3 * m.latency_s), within);
            let (snr_db, coherence, misfit) = (m.snr_db, m.coherence, 100.0 * m.misfit);
            let distortion = m.distortion.map(|d| format!(", distortion {:.1} %", 100.0 * d));
            out += &format!(
                "  {snr_db:.0} dB signal to noise, coherence {coherence:.3}, {misfit:.1} % unexplained{}\n",
                distortion.unwrap_or_default()
            );
        }
        out += &format!("\ntrust         {}\n", f.trust.word());
        f.notes.iter().for_each(|note| out += &format!("              - {note}\n"));
        out += "assumed\n";
        self.assumed().iter().for_each(|what| out += &format!("              - {what}\n"));
        self.written.iter().for_each(|path| out += &format!("wrote         {}\n", path.display()));
        if !trusted {
            out += "the profile is not written: the measurement is poor (--anyway writes it all the same)\n";
        }
        out
    }

    fn assumed(&self) -> Vec<String> {
        let Args { mass_uncertainty, accelerometer_full_scale, volts_at_full_scale, .. } = self.args;
        let masses: Vec<String> = self.tapes.iter().map(|t| format!("{} g", t.handle_mass_g)).collect();
        let gain = self.amplifier.gain;
        let mut all = vec![
            format!("the handle weighs {} within {mass_uncertainty} %", masses.join(" and ")),
            format!("the input is at full scale at {accelerometer_full_scale} m/s^2"),
        ];
        all.push(match self.amplifier.drive {
            Drive::Current => format!(
                "full scale of the output is {volts_at_full_scale} V, and the amplifier gives {gain} A/V: \
                 an error of either is one of the force factor"
            ),
            Drive::Voltage => format!(
                "full scale of the output is {volts_at_full_scale} V, the amplifier gives {gain} V/V, \
                 and the coil has {} ohm, known within 3 %, and {} uH",
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

    pub fn json(&self, trusted: bool) -> Value {
        let found = self.findings;
        let estimate = |e: &Estimate| json!({ "value": e.value, "low": e.low, "high": e.high });
        let figures = self.figures().map(|f| {
            let value = json!({
                "value": f.found.value, "low": f.found.low, "high": f.found.high, "measured": f.measured,
                "base": f.base, "base_is_estimate": f.estimate,
            });
            (f.key.to_owned(), value)
        });
        let of = found.recordings.iter().zip(self.tapes).zip(&found.curves);
        let recordings = of.map(|((m, tape), curve)| {
            let points = curve.iter().map(|p| {
                json!({
                    "hz": p.hz, "measured_db": p.measured_db, "measured_rad": p.measured_phase,
                    "fitted_db": p.fitted_db, "fitted_rad": p.fitted_phase, "coherence": p.coherence,
                })
            });
            json!({
                "handle_mass_g": tape.handle_mass_g, "level": tape.amplitude, "limited": tape.limited,
                "resonance_hz": estimate(&m.natural_hz), "damping_ratio": estimate(&m.damping_ratio),
                "gain_m_s2_per_a": estimate(&m.gain), "latency_ms": 1e3 * m.latency_s,
                "inverted": m.inverted, "snr_db": m.snr_db, "coherence": m.coherence,
                "misfit": m.misfit, "distortion": m.distortion,
                "band_hz": [m.band_hz.0, m.band_hz.1], "points": points.collect::<Vec<Value>>(),
            })
        });
        json!({
            "asperity": env!("CARGO_PKG_VERSION"), "base": self.base.name, "drive": self.amplifier.unit,
            "figures": Map::from_iter(figures), "moving_mass_measured": found.moving_mass_measured,
            "recordings": recordings.collect::<Vec<Value>>(),
            "trust": found.trust.word(), "notes": found.notes, "assumed": self.assumed(),
            "profile_written": trusted, "written": self.written,
        })
    }

    pub fn picture(&self) -> String {
        let (f, unit) = (self.findings, self.amplifier.unit);
        let (device, level) = self.tapes.first().map_or(("", 0.0), |t| (t.device.as_str(), t.amplitude));
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
            subtitle: format!("Sweep of {level:.3} {unit} on {device}. Trust: {}.", f.trust.word()),
            unit: format!("dB re 1 m/s\u{b2} per {unit}"),
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

fn digits(x: f64) -> String {
    let decimals = (3 - x.abs().max(1e-9).log10().floor() as i32).clamp(0, 8);
    format!("{x:.*}", decimals as usize)
}
