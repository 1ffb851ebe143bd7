//! Ports: in a descriptor, and as the compiler resolves them.

use std::borrow::Cow;
use std::fmt;

use crate::FrameRate;

/// Layout of the bins of a [`Shape::Magnitude`] or [`Shape::Spectrum`].
///
/// The window is the periodic Hann window over all of `length`. Bins are amplitudes, 2 |sum w x| / sum
/// w in the port's unit, so that a sine of amplitude 1 on a bin reads 1 at any length. Bin 0 and the
/// last bin of a whole spectrum follow the same rule and read 2 for a constant of 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FrameLayout {
    /// Sample rate of the analysed signal in Hz.
    pub rate_hz: u32,
    /// Window and DFT length in samples.
    pub length: u32,
    /// Bins in a frame, from bin 0 on; at most length / 2 + 1. Bins above are 0.
    pub bins: u32,
    /// Frames a second; frame n starts at sample floor(n * rate / frame rate).
    pub frame_rate: FrameRate,
}

impl FrameLayout {
    /// Distance of two bins in Hz.
    pub fn bin_hz(&self) -> f64 {
        f64::from(self.rate_hz) / f64::from(self.length)
    }
}

impl fmt::Display for FrameLayout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rate_hz, length, bins, frame_rate } = self;
        write!(f, "{bins} bins of a {length}-point Hann DFT at {rate_hz} Hz, {frame_rate} frames/s")
    }
}

/// Content of one tick, fully known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shape {
    /// `count` values, held between ticks.
    Control {
        /// Number of values.
        count: usize,
    },
    /// Samples of one channel in this tick.
    Audio {
        /// Samples a second.
        rate_hz: u32,
    },
    /// At most one frame of magnitudes.
    Magnitude(FrameLayout),
    /// At most one frame of complex bins.
    Spectrum(FrameLayout),
}

impl Shape {
    /// `Control`, `Audio`, `Magnitude` or `Spectrum`.
    pub fn kind(&self) -> &'static str {
        match self {
            Shape::Control { .. } => "Control",
            Shape::Audio { .. } => "Audio",
            Shape::Magnitude(_) => "Magnitude",
            Shape::Spectrum(_) => "Spectrum",
        }
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Shape::Control { count } => write!(f, "Control x{count}"),
            Shape::Audio { rate_hz } => write!(f, "Audio at {rate_hz} Hz"),
            Shape::Magnitude(l) => write!(f, "Magnitude of {l}"),
            Shape::Spectrum(l) => write!(f, "Spectrum of {l}"),
        }
    }
}

/// Type of a port.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub struct PortType {
    pub shape: Shape,
    pub unit: Unit,
    /// Whether it comes from a limiter; only such a signal may reach a device.
    pub limited: bool,
}

impl fmt::Display for PortType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} [{}]", self.shape, self.unit)
    }
}

/// Type variable of a descriptor, a letter. Ports of a node with the same letter have the same type
/// there.
pub type Var = char;

/// A rate in a descriptor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum RateSpec {
    /// The graph's audio rate.
    Graph,
    Hz(u32),
    /// Rate of every port with this variable; for frames, the rate in their layout.
    Of(Var),
}

/// A frame layout in a descriptor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum LayoutSpec {
    Is(FrameLayout),
    /// Layout of every port with this variable.
    Of(Var),
}

/// A shape in a descriptor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum ShapeSpec {
    /// Any shape, the same for every port with this variable.
    Like(Var),
    Control(usize),
    Audio(RateSpec),
    Magnitude(LayoutSpec),
    Spectrum(LayoutSpec),
}

/// A unit in a descriptor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum UnitSpec {
    /// This unit.
    Is(Unit),
    /// Unit of every port with this variable; one of `among`, or any if that is empty.
    Of {
        /// The variable.
        var: Var,
        /// Allowed units; empty for any.
        among: Cow<'static, [Unit]>,
    },
}

/// An input in a descriptor.
#[must_use]
#[derive(Clone, Debug)]
#[allow(missing_docs)]
pub struct Input {
    pub name: Cow<'static, str>,
    /// Meaning, in a few words.
    pub doc: Cow<'static, str>,
    pub shape: ShapeSpec,
    pub unit: UnitSpec,
    /// Whether it may stay unconnected. A control then reads `default` in every value, audio is silent,
    /// and no frame comes.
    pub optional: bool,
    /// Value of an unconnected control input.
    pub default: f64,
    /// Whether this input wakes a sleeping node: by audio that is not silent, a frame, or a changed
    /// control. By default audio and frames do, controls do not.
    pub wakes: bool,
    /// Whether only a limited signal may enter.
    pub limited: bool,
    /// Whether the host sets the values while no wire ends here, such as data from a device, a network
    /// or a hand. Until then they are not valid.
    pub host_fed: bool,
}

/// An output in a descriptor.
#[must_use]
#[derive(Clone, Debug)]
#[allow(missing_docs)]
pub struct Output {
    pub name: Cow<'static, str>,
    /// Meaning, in a few words.
    pub doc: Cow<'static, str>,
    pub shape: ShapeSpec,
    pub unit: UnitSpec,
    /// Whether the node limits the signal (finite, and within a device's limits).
    pub limited: bool,
    /// Whether it is secondary: a wire without a port name does not mean it.
    pub secondary: bool,
}

impl Input {
    /// Makes a required input.
    pub fn new(name: impl Into<Cow<'static, str>>, shape: ShapeSpec, unit: Unit) -> Self {
        Self {
            name: name.into(),
            doc: Cow::Borrowed(""),
            shape,
            unit: UnitSpec::Is(unit),
            optional: false,
            default: 0.0,
            wakes: !matches!(shape, ShapeSpec::Control(_)),
            limited: false,
            host_fed: false,
        }
    }

    /// Sets its meaning, in a few words.
    pub fn doc(mut self, doc: impl Into<Cow<'static, str>>) -> Self {
        self.doc = doc.into();
        self
    }

    /// Allows any unit, the same for every port with this variable.
    pub fn unit_of(mut self, var: Var) -> Self {
        self.unit = UnitSpec::Of { var, among: Cow::Borrowed(&[]) };
        self
    }

    /// Allows some units, the same for every port with this variable.
    pub fn unit_among(mut self, var: Var, among: &'static [Unit]) -> Self {
        self.unit = UnitSpec::Of { var, among: Cow::Borrowed(among) };
        self
    }

    /// Makes it optional; an unconnected control then reads `default`.
    pub fn or(mut self, default: f64) -> Self {
        self.optional = true;
        self.default = default;
        self
    }

    /// Lets a change here wake a sleeping node.
    pub fn wakes(mut self) -> Self {
        self.wakes = true;
        self
    }

    /// Accepts only a limited signal.
    pub fn limited(mut self) -> Self {
        self.limited = true;
        self
    }

    /// Makes it optional; an unconnected input is set by the host, tick by tick. Built-in nodes only: a
    /// host knows the values by their kind.
    pub fn host_fed(mut self) -> Self {
        (self.optional, self.host_fed) = (true, true);
        self
    }
}

impl Output {
    /// Makes an output.
    pub fn new(name: impl Into<Cow<'static, str>>, shape: ShapeSpec, unit: Unit) -> Self {
        let doc = Cow::Borrowed("");
        Self { name: name.into(), doc, shape, unit: UnitSpec::Is(unit), limited: false, secondary: false }
    }

    /// Sets its meaning, in a few words.
    pub fn doc(mut self, doc: impl Into<Cow<'static, str>>) -> Self {
        self.doc = doc.into();
        self
    }

    /// Allows any unit, the same for every port with this variable.
    pub fn unit_of(mut self, var: Var) -> Self {
        self.unit = UnitSpec::Of { var, among: Cow::Borrowed(&[]) };
        self
    }

    /// Makes it secondary: a wire without a port name does not mean it. If the node fails and it holds
    /// its values, these stay valid, because they only describe the other outputs.
    pub fn secondary(mut self) -> Self {
        self.secondary = true;
        self
    }

    /// Promises a limited signal.
    pub fn limited(mut self) -> Self {
        self.limited = true;
        self
    }
}

impl fmt::Display for UnitSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            UnitSpec::Is(u) => write!(f, "{u}"),
            UnitSpec::Of { among, .. } if among.is_empty() => f.write_str("any unit"),
            UnitSpec::Of { among, .. } => {
                let names: Vec<_> = among.iter().map(Unit::symbol).collect();
                f.write_str(&names.join(" or "))
            }
        }
    }
}

impl fmt::Display for ShapeSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rate = |r: &RateSpec| match r {
            RateSpec::Graph => "the audio rate".to_owned(),
            RateSpec::Hz(hz) => format!("{hz} Hz"),
            RateSpec::Of(_) => "any rate".to_owned(),
        };
        let layout = |l: &LayoutSpec| match l {
            LayoutSpec::Is(l) => l.to_string(),
            LayoutSpec::Of(_) => "any layout".to_owned(),
        };
        match self {
            ShapeSpec::Like(_) => f.write_str("any kind"),
            ShapeSpec::Control(n) => write!(f, "Control x{n}"),
            ShapeSpec::Audio(r) => write!(f, "Audio at {}", rate(r)),
            ShapeSpec::Magnitude(l) => write!(f, "Magnitude of {}", layout(l)),
            ShapeSpec::Spectrum(l) => write!(f, "Spectrum of {}", layout(l)),
        }
    }
}

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
