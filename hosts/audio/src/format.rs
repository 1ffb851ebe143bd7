//! Sample formats of devices.
//!
//! Full scale is 1 and 2^(bits - 1). A value is scaled by that, rounded to the nearest step (halves away
//! from zero) and clipped to the range of the format: 1.0 is its largest value, -1.0 its smallest. Floats
//! are clipped to +-1. A value that is not finite becomes 0. Formats of up to 24 bits read back exactly as
//! they were played.
//!
//! dasp converts between the number types, but truncates and does not clip. So values are rounded to the
//! grid of the format first; from there dasp's conversion is exact.

use cpal::{SampleFormat, SizedSample};
use dasp_sample::{FromSample, ToSample};

/// Sample type of a device.
pub(crate) trait DeviceSample:
    SizedSample + FromSample<f64> + ToSample<f32> + ToSample<f64> + Send + 'static
{
    /// Converts a sample with full scale 1: clips, rounds to the nearest step, and silences values that are
    /// not finite.
    fn from_unit(value: f32) -> Self {
        let value = if value.is_finite() { f64::from(value.clamp(-1.0, 1.0)) } else { 0.0 };
        if Self::FORMAT.is_float() {
            return Self::from_sample(value);
        }
        let full = (1_u64 << (Self::FORMAT.bits_per_sample() - 1)) as f64;
        Self::from_sample((value * full).round().min(full - 1.0) / full)
    }

    /// Converts to a sample with full scale 1. A value that is not finite becomes 0.
    fn to_unit(self) -> f32 {
        let value: f32 = self.to_sample();
        if value.is_finite() { value } else { 0.0 }
    }
}

impl<T: SizedSample + FromSample<f64> + ToSample<f32> + ToSample<f64> + Send + 'static> DeviceSample for T {}

/// Evaluates an expression with `T` as the sample type of a format.
macro_rules! with_sample {
    ($format:expr, $T:ident => $body:expr) => {
        $crate::format::with_sample!($format, $T => $body; F32 f32, F64 f64, I8 i8, I16 i16, I24 cpal::I24,
            I32 i32, U8 u8, U16 u16, U24 cpal::U24, U32 u32)
    };
    ($format:expr, $T:ident => $body:expr; $($variant:ident $type:ty),*) => {
        match $format {
            $($crate::Format::$variant => {
                type $T = $type;
                $body
            })*
        }
    };
}
pub(crate) use with_sample;

/// Sample format of a device: floats, signed and unsigned integers. 24 bits stand in four bytes.
#[allow(missing_docs, reason = "the names say all")]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    F32,
    F64,
    I8,
    I16,
    I24,
    I32,
    U8,
    U16,
    U24,
    U32,
}

impl Format {
    /// All formats, preferred ones first: floats need no rounding, wide integers little.
    pub const ALL: [Self; 10] = [
        Self::F32,
        Self::I32,
        Self::I24,
        Self::F64,
        Self::I16,
        Self::U32,
        Self::U24,
        Self::U16,
        Self::I8,
        Self::U8,
    ];

    /// Name as a user types it: `f32`, `i16`.
    pub fn name(self) -> String {
        self.to_cpal().to_string()
    }

    pub(crate) fn to_cpal(self) -> SampleFormat {
        with_sample!(self, T => T::FORMAT)
    }

    /// Format from cpal's; `None` for unsupported ones (64 bits, DSD).
    pub(crate) fn from_cpal(format: SampleFormat) -> Option<Self> {
        Self::ALL.into_iter().find(|one| one.to_cpal() == format)
    }
}

impl std::fmt::Display for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.to_cpal().fmt(f)
    }
}

impl std::str::FromStr for Format {
    type Err = String;

    /// Reads `f32`, `i16` and so on; the error lists them all.
    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|one| one.name() == text).ok_or_else(|| {
            let all: Vec<_> = Self::ALL.iter().map(|one| one.name()).collect();
            format!("there is no sample format `{text}`; there are {}", all.join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cpal::I24;

    #[test]
    fn value_not_finite_is_silence() {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(f32::from_unit(value), 0.0);
            assert_eq!(i16::from_unit(value), 0);
            assert_eq!(I24::from_unit(value).inner(), 0);
            assert_eq!(u16::from_unit(value), 32_768);
        }
        assert_eq!(f32::NAN.to_unit(), 0.0);
    }

    #[test]
    fn samples_of_16_and_24_bits_read_back_unchanged() {
        for value in i16::MIN..=i16::MAX {
            assert_eq!(i16::from_unit(value.to_unit()), value);
            assert_eq!(u16::from_unit((value as u16).to_unit()), value as u16);
        }
        for value in (-8_388_608..=8_388_607).step_by(97) {
            assert_eq!(I24::from_unit(I24::new_unchecked(value).to_unit()).inner(), value);
        }
    }

    #[test]
    fn format_name_reads_back() {
        for format in Format::ALL {
            assert_eq!(format.name().parse(), Ok(format));
            assert_eq!(Format::from_cpal(format.to_cpal()), Some(format));
        }
        assert!("i25".parse::<Format>().unwrap_err().contains("i24"));
    }
}
