//! Units of the values on a wire.

use std::borrow::Cow;
use std::fmt;

/// A unit, by its symbol. Two ports connect only if their units are equal; nothing is converted.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Unit(Cow<'static, str>);

impl Unit {
    /// A number without a unit.
    pub const NONE: Self = Self::new("1");
    /// Length.
    pub const MILLIMETRE: Self = Self::new("mm");
    /// Speed.
    pub const MILLIMETRE_PER_SECOND: Self = Self::new("mm/s");
    /// Force.
    pub const NEWTON: Self = Self::new("N");
    /// Acceleration, and the magnitudes and spectra of one.
    pub const METRE_PER_SECOND_SQUARED: Self = Self::new("m/s^2");
    /// Stiffness.
    pub const NEWTON_PER_MILLIMETRE: Self = Self::new("N/mm");
    /// Damping.
    pub const NEWTON_SECOND_PER_METRE: Self = Self::new("N s/m");
    /// Current.
    pub const AMPERE: Self = Self::new("A");
    /// Voltage.
    pub const VOLT: Self = Self::new("V");
    /// Samples of a device: 1 is its full scale.
    pub const FULL_SCALE: Self = Self::new("FS");

    /// A unit by its symbol.
    pub const fn new(symbol: &'static str) -> Self {
        Self(Cow::Borrowed(symbol))
    }

    /// A unit whose symbol is read from a file.
    pub fn from_symbol(symbol: impl Into<String>) -> Self {
        Self(Cow::Owned(symbol.into()))
    }

    /// The symbol.
    pub fn symbol(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
