//! The file of an actuator.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_diagnostics::ron::{Value, parse};
use asperity_diagnostics::{Diagnostic, Source, one_of};

/// A value and its origin.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    /// Value in SI units, whatever the unit in the file.
    pub value: f64,
    /// A document, or how it was estimated.
    pub source: String,
    /// Whether it is an estimate rather than a published or measured figure.
    pub estimate: bool,
}

/// An actuator: the figures that do not depend on its handle.
///
/// In the file each value has a unit and a source, `m_a: (g: 4.4, source: "data sheet")`. With `estimate:
/// true` it is an estimate. All fields are required. [`ActuatorProfile::parse`] lists the ranges.
#[derive(Clone, Debug, PartialEq)]
pub struct ActuatorProfile {
    /// Name of the actuator.
    pub name: String,
    /// Moving mass m_a \[kg\].
    pub moving_mass: Quantity,
    /// Suspension stiffness k \[N/m\].
    pub stiffness: Quantity,
    /// Suspension damping c \[N s/m\], with open coil.
    pub damping: Quantity,
    /// Force factor k_f \[N/A\].
    pub force_factor: Quantity,
    /// Coil resistance \[ohm\].
    pub resistance: Quantity,
    /// Coil inductance \[H\].
    pub inductance: Quantity,
    /// Largest displacement to either side \[m\].
    pub stroke: Quantity,
    /// Thermal time constant of the coil \[s\].
    pub thermal_time_constant: Quantity,
    /// Current that the coil bears continuously \[A rms\].
    pub rated_current: Quantity,
    /// Largest current at any time \[A\].
    pub peak_current: Quantity,
    /// Largest voltage at any time \[V\].
    pub peak_voltage: Quantity,
}

/// The only version of this format.
const VERSION: i64 = 1;

/// Field, unit in the file, unit for people, least, most, SI value of one unit, an example.
pub(super) type Field = (&'static str, &'static str, &'static str, f64, f64, f64, f64);

pub(super) const FIELDS: [Field; 11] = [
    ("m_a", "g", "g", 0.05, 1000.0, 1e-3, 4.4),
    ("k", "n_per_m", "N/m", 1.0, 1e6, 1.0, 700.0),
    ("damping", "n_s_per_m", "N s/m", 1e-4, 100.0, 1.0, 2.0),
    ("k_f", "n_per_a", "N/A", 0.01, 100.0, 1.0, 2.0),
    ("resistance", "ohm", "ohm", 0.1, 100.0, 1.0, 2.0),
    ("inductance", "uh", "uH", 1.0, 5000.0, 1e-6, 128.0),
    ("stroke", "mm", "mm", 0.05, 50.0, 1e-3, 2.0),
    ("thermal_time_constant", "s", "s", 0.1, 600.0, 1.0, 2.0),
    ("rated_current", "ma_rms", "mA", 1.0, 20_000.0, 1e-3, 150.0),
    ("peak_current", "ma", "mA", 1.0, 100_000.0, 1e-3, 600.0),
    ("peak_voltage", "v", "V", 0.05, 200.0, 1.0, 2.0),
];

impl ActuatorProfile {
    /// Reads a profile's file.
    ///
    /// # Errors
    /// As [`ActuatorProfile::parse`], and a file that cannot be read.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        Self::parse(&Source::read(path)?)
    }

    /// Reads a profile's text, `ActuatorProfile(version: 1, name: "...", m_a: (g: 4.4, source: "..."), ...)`.
    ///
    /// | field | unit | range |
    /// |---|---|---|
    /// | `m_a` | `g` | 0.05 to 1000 |
    /// | `k` | `n_per_m` | 1 to 10^6 |
    /// | `damping` | `n_s_per_m` | 0.0001 to 100 |
    /// | `k_f` | `n_per_a` | 0.01 to 100 |
    /// | `resistance` | `ohm` | 0.1 to 100 |
    /// | `inductance` | `uh` | 1 to 5000 |
    /// | `stroke` | `mm` | 0.05 to 50 |
    /// | `thermal_time_constant` | `s` | 0.1 to 600 |
    /// | `rated_current` | `ma_rms` | 1 to 20000 |
    /// | `peak_current` | `ma` | the rated current to 100000 |
    /// | `peak_voltage` | `v` | 0.05 to 200 |
    ///
    /// # Errors
    /// Each with line and column: text that is not RON; an unknown or missing field; another unit; a
    /// value out of range; a missing source; a coil with L/R above 2 ms, which no voice coil has.
    pub fn parse(source: &Arc<Source>) -> Result<Self, Diagnostic> {
        let root = parse(source)?;
        let mut record = root.record("ActuatorProfile")?;
        let version = record.required("version")?;
        if version.i64()? != VERSION {
            return Err(version
                .error("this version is not known")
                .help(format!("write `version: {VERSION}`")));
        }
        let name = record.required("name")?;
        if name.text()?.trim().is_empty() {
            return Err(name.error("an actuator needs a name").help("for example the name printed on it"));
        }
        let name = name.text()?.to_owned();
        let mut all = Vec::with_capacity(FIELDS.len());
        for field in FIELDS {
            let value = record.required(field.0)?;
            all.push((quantity(value, field)?, value));
        }
        record.finish()?;
        check_together(&all)?;
        let mut all = all.into_iter();
        let mut next = || all.next().map(|(quantity, _)| quantity).expect("a quantity for each field");
        Ok(Self {
            name,
            moving_mass: next(),
            stiffness: next(),
            damping: next(),
            force_factor: next(),
            resistance: next(),
            inductance: next(),
            stroke: next(),
            thermal_time_constant: next(),
            rated_current: next(),
            peak_current: next(),
            peak_voltage: next(),
        })
    }

    /// Every quantity with its name in the file, in the file's order.
    pub fn quantities(&self) -> [(&'static str, &Quantity); 11] {
        let all = [
            &self.moving_mass,
            &self.stiffness,
            &self.damping,
            &self.force_factor,
            &self.resistance,
            &self.inductance,
            &self.stroke,
            &self.thermal_time_constant,
            &self.rated_current,
            &self.peak_current,
            &self.peak_voltage,
        ];
        std::array::from_fn(|n| (FIELDS[n].0, all[n]))
    }
}

/// Profiles that a graph names without a file.
const SHIPPED: [(&str, &str); 2] = [
    ("hapcoil_one", include_str!("../../../graphs/actuators/hapcoil_one.ron")),
    ("haptuator_mark_ii", include_str!("../../../graphs/actuators/haptuator_mark_ii.ron")),
];

impl ActuatorProfile {
    /// The shipped profile of this name, such as `hapcoil_one`, if there is one.
    ///
    /// # Errors
    /// None in practice: shipped profiles are valid.
    pub fn shipped(name: &str) -> Option<Result<Self, Diagnostic>> {
        let (name, text) = SHIPPED.iter().find(|(n, _)| *n == name)?;
        Some(Self::parse(&Source::new(format!("actuators/{name}.ron (shipped)"), *text)))
    }

    /// The names of the shipped profiles.
    pub fn shipped_names() -> impl Iterator<Item = &'static str> + Clone {
        SHIPPED.iter().map(|(name, _)| *name)
    }

    /// Path of the file that [`find`](Self::find) reads. None for a shipped profile.
    pub fn file(name: &str, base: &Path) -> Option<PathBuf> {
        Self::shipped_names().all(|shipped| shipped != name).then(|| base.join(name))
    }

    /// A profile as a graph names it: a shipped one by name, or a RON file relative to `base`.
    ///
    /// # Errors
    /// An unknown name; a file that is missing or not a profile.
    pub fn find(name: &str, base: &Path) -> Result<Self, Diagnostic> {
        if let Some(shipped) = Self::shipped(name) {
            return shipped;
        }
        if !name.ends_with(".ron") {
            let help = one_of(name, Self::shipped_names());
            return Err(Diagnostic::new(format!("there is no shipped actuator profile `{name}`"))
                .help(format!("{help}; or name a .ron file")));
        }
        let path = base.join(name);
        if path.is_file() {
            return Self::read(path);
        }
        Err(Diagnostic::new(format!("cannot find the actuator profile {}", path.display())))
    }
}

fn quantity(
    value: &Value,
    (field, unit, say, least, most, si, example): Field,
) -> Result<Quantity, Diagnostic> {
    let shape = || format!("such as `{field}: ({unit}: {example}, source: \"...\")`");
    let mut record = value.record(field).map_err(|e| if e.help.is_none() { e.help(shape()) } else { e })?;
    let number = record.required(unit).map_err(|_| {
        value.error(format!("`{field}` needs a value in {say}, called `{unit}`")).help(shape())
    })?;
    let x = number.f64_in(least..=most, say)?;
    let from = record.required("source").map_err(|e| e.help("a document, or how it was estimated"))?;
    if from.text()?.trim().is_empty() {
        return Err(from.error("a source is not empty").help("a document, or how it was estimated"));
    }
    let estimate = record.optional("estimate").map_or(Ok(false), Value::bool)?;
    record.finish()?;
    Ok(Quantity { value: x * si, source: from.text()?.to_owned(), estimate })
}

fn check_together(all: &[(Quantity, &Value)]) -> Result<(), Diagnostic> {
    let [.., resistance, inductance, _, _, rated, peak, _] = all else { return Ok(()) };
    if peak.0.value < rated.0.value {
        let wrong = peak.1.error("the peak current is below the rated current").label("too small");
        let wrong = wrong.related(rated.1.source(), rated.1.span(), "the rated current");
        return Err(wrong.help(format!("at least {} mA", rated.0.value * 1e3)));
    }
    if inductance.0.value > 2e-3 * resistance.0.value {
        let wrong = "a coil of this inductance and resistance would take over 2 ms to follow its voltage";
        let wrong = inductance.1.error(wrong);
        let wrong = wrong.related(resistance.1.source(), resistance.1.span(), "the resistance");
        return Err(wrong.help(format!("at most {} uH", 2e3 * resistance.0.value)));
    }
    Ok(())
}

#[cfg(test)]
#[path = "profile_tests.rs"]
mod tests;
