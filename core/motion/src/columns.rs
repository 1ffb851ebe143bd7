//! Quantities of strokes, and the map that says which column of a file is which.

use asperity_diagnostics::{Diagnostic, one_of};

/// Largest time in a file, in seconds: room for a Unix time, none for one in milliseconds.
const MAX_ABS_TIME_S: f64 = 1e10;
/// Largest position on an axis, in mm: 100 m.
const MAX_ABS_POSITION_MM: f64 = 1e5;
/// Largest recorded force, in N. Either sign, since a sensor at rest reads a little below zero.
pub const MAX_ABS_FORCE_N: f64 = 1e3;
/// Largest recorded speed, in mm/s; the least is 0.
pub const MAX_SPEED_MM_S: f64 = 1e5;
/// Largest recorded acceleration, in m/s^2, either sign.
pub const MAX_ABS_ACCELERATION_M_S2: f64 = 1e5;

/// A quantity that a table may have as a column.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// Its name.
    pub name: &'static str,
    /// Another name that is understood.
    pub alias: Option<&'static str>,
    /// Least value.
    pub least: f64,
    /// Greatest value.
    pub greatest: f64,
    /// Unit, for errors.
    pub unit: &'static str,
}

impl Column {
    /// Time.
    pub const TIME: Self = Self { alias: Some("time_s"), ..Self::within("t_s", MAX_ABS_TIME_S, "s") };
    /// Place along x.
    pub const X: Self = Self::within("x_mm", MAX_ABS_POSITION_MM, "mm");
    /// Place along y.
    pub const Y: Self = Self::within("y_mm", MAX_ABS_POSITION_MM, "mm");
    /// Place along z.
    pub const Z: Self = Self::within("z_mm", MAX_ABS_POSITION_MM, "mm");
    /// Normal force.
    pub const FORCE: Self = Self::within("force_n", MAX_ABS_FORCE_N, "N");
    /// Speed along the surface.
    pub const SPEED: Self = Self { least: 0.0, ..Self::within("speed_mm_s", MAX_SPEED_MM_S, "mm/s") };
    /// Number of the stroke: where it changes, the stylus was lifted and put down elsewhere.
    pub const STROKE: Self = Self::within("stroke", 1e9, "");
    /// Velocity along x.
    pub const VX: Self = Self::within("vx_mm_s", MAX_SPEED_MM_S, "mm/s");
    /// Velocity along y.
    pub const VY: Self = Self::within("vy_mm_s", MAX_SPEED_MM_S, "mm/s");
    /// Acceleration along x.
    pub const AX: Self = Self::within("ax_m_s2", MAX_ABS_ACCELERATION_M_S2, "m/s^2");
    /// Acceleration along y.
    pub const AY: Self = Self::within("ay_m_s2", MAX_ABS_ACCELERATION_M_S2, "m/s^2");
    /// Acceleration along z.
    pub const AZ: Self = Self::within("az_m_s2", MAX_ABS_ACCELERATION_M_S2, "m/s^2");
    /// Acceleration of a single axis.
    pub const ACCELERATION: Self = Self::within("acceleration_m_s2", MAX_ABS_ACCELERATION_M_S2, "m/s^2");

    const ALL: [Self; 13] = [
        Self::TIME,
        Self::X,
        Self::Y,
        Self::Z,
        Self::FORCE,
        Self::SPEED,
        Self::STROKE,
        Self::VX,
        Self::VY,
        Self::AX,
        Self::AY,
        Self::AZ,
        Self::ACCELERATION,
    ];

    const fn within(name: &'static str, limit: f64, unit: &'static str) -> Self {
        Self { name, alias: None, least: -limit, greatest: limit, unit }
    }

    /// Whether a value is in range. NaN is not.
    pub fn holds(&self, value: f64) -> bool {
        (self.least..=self.greatest).contains(&value)
    }

    /// The help of an error about a value.
    pub fn help(&self) -> String {
        let text =
            format!("`{}` is a number from {} to {} {}", self.name, self.least, self.greatest, self.unit);
        text.trim_end().to_owned()
    }

    /// Whether a file's column of this name is this quantity.
    pub(crate) fn is_named(&self, name: &str) -> bool {
        self.name == name || self.alias == Some(name)
    }

    /// Units that this quantity may have in a file, each with its factor.
    fn units(&self) -> &'static [(&'static str, f64)] {
        UNITS.iter().find(|(unit, _)| *unit == self.unit).map_or(&[], |(_, units)| units)
    }

    pub(crate) fn factor(&self, unit: &str) -> Option<f64> {
        let unit = unit.replace(['\u{b5}', '\u{3bc}'], "u").replace('\u{b2}', "^2").replace("s2", "s^2");
        self.units().iter().find(|(name, _)| *name == unit).map(|(_, factor)| *factor)
    }

    /// The option that would read this quantity from a column of this name. The unit is the name's own, if
    /// the name ends with one.
    pub(crate) fn option(&self, column: &str) -> String {
        let words = column.split(['_', '[', ']', '(', ')', ' ']).skip(1);
        let unit = words.filter(|word| self.factor(word).is_some()).last().unwrap_or(self.unit);
        let map = format!("{}={column}:{unit}", self.name);
        let plain = |c: char| c.is_alphanumeric() || "_-=:./^".contains(c);
        if map.chars().all(plain) { format!("--map {map}") } else { format!("--map \"{map}\"") }
    }

    /// How well a file's column of this name fits, by its letters. 0 is not at all.
    pub(crate) fn likeness(&self, column: &str) -> usize {
        let own = self.name.split('_').next().unwrap_or_default();
        let column = column.to_lowercase();
        let alike = own.chars().zip(column.chars()).take_while(|(a, b)| a == b).count();
        if alike > 0 { 1 + alike } else { usize::from(column.contains(own)) }
    }
}

/// Standard gravity in m/s^2: the weight of a gram in mN.
const G: f64 = 9.80665;

/// Units of files by the unit that they are converted to, with their factors.
const UNITS: [(&str, &[(&str, f64)]); 6] = [
    ("s", &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)]),
    ("mm", &[("mm", 1.0), ("m", 1e3), ("cm", 10.0), ("um", 1e-3)]),
    ("N", &[("N", 1.0), ("mN", 1e-3), ("kN", 1e3), ("g", 1e-3 * G), ("gf", 1e-3 * G), ("kgf", G)]),
    ("mm/s", &[("mm/s", 1.0), ("m/s", 1e3), ("cm/s", 10.0), ("um/s", 1e-3)]),
    ("", &[("", 1.0)]),
    ("m/s^2", &[("m/s^2", 1.0), ("mm/s^2", 1e-3), ("g", G), ("mg", 1e-3 * G)]),
];

/// Columns of a file by the quantities that they hold, where their names do not tell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ColumnMap(Vec<(&'static str, String)>);

impl ColumnMap {
    /// Parses texts such as `force_n=Fz:mN`: a quantity, then the name of its column, then its unit there.
    /// Without a unit it is the quantity's own. A column of a file without names goes by its number, from 1.
    /// A minus sign before the column turns its sign.
    ///
    /// # Errors
    /// No `=`; no column; a quantity that is unknown or there twice. They have no place.
    pub fn parse<S: AsRef<str>>(texts: &[S]) -> Result<Self, Diagnostic> {
        let mut map = Self::default();
        for text in texts.iter().map(AsRef::as_ref) {
            let parts = text.split_once('=').map(|(name, column)| (name.trim(), column.trim()));
            let Some((name, column)) = parts.filter(|(_, column)| !column.is_empty()) else {
                return Err(Diagnostic::new(format!("`{text}` names no column")).help("force_n=Fz:N"));
            };
            let Some(known) = Column::ALL.iter().find(|c| c.is_named(name)) else {
                let help = one_of(name, Column::ALL.iter().map(|c| c.name));
                return Err(Diagnostic::new(format!("no column is called `{name}` here")).help(help));
            };
            if map.of(known).is_some() {
                return Err(Diagnostic::new(format!("`{name}` is mapped twice")).help("map it once"));
            }
            map.0.push((known.name, column.to_owned()));
        }
        Ok(map)
    }

    /// Whether all columns go by their own names.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn of(&self, column: &Column) -> Option<&str> {
        self.0.iter().find(|(name, _)| *name == column.name).map(|(_, text)| text.as_str())
    }

    /// Whether a quantity is mapped to a file's column of this name.
    pub(crate) fn names(&self, column: &Column, name: &str) -> bool {
        self.find(column, std::iter::once(name)).is_some_and(|found| found.is_ok())
    }

    /// Finds the column that a quantity is mapped to among the names of a file, and the factor of its values.
    pub(crate) fn find<'n>(
        &self,
        column: &Column,
        names: impl Iterator<Item = &'n str> + Clone,
    ) -> Option<Result<(usize, f64), Diagnostic>> {
        let text = self.of(column)?;
        let cell = |wanted: &str| {
            let same = |(cell, name)| (name == wanted).then_some((cell, 1.0));
            let turned = |(cell, name)| (Some(name) == wanted.strip_prefix('-')).then_some((cell, -1.0));
            let mut all = names.clone().enumerate();
            all.clone().find_map(same).or_else(|| all.find_map(turned))
        };
        if let Some(found) = cell(text) {
            return Some(Ok(found));
        }
        let (name, unit) = text.rsplit_once(':').unwrap_or((text, column.unit));
        let Some((cell, sign)) = cell(name.trim()) else {
            let what = format!("`{}` is mapped to `{name}`, and the file has no such column", column.name);
            return Some(Err(Diagnostic::new(what).help(one_of(name, names))));
        };
        Some(column.factor(unit.trim()).map(|factor| (cell, sign * factor)).ok_or_else(|| {
            let units: Vec<&str> = column.units().iter().map(|(unit, _)| *unit).collect();
            let what = format!("`{}` cannot be in `{unit}`", column.name);
            Diagnostic::new(what).help(format!("its units are {}", units.join(", ")))
        }))
    }
}
