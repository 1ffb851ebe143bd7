//! Samples as devices want them.
//!
//! Full scale is 1 and 2^(bits - 1): a value is scaled by that, rounded to the nearest step (halves away from zero) and clamped to
//! what the format holds, so that 1.0 is the largest value of the format and -1.0 the smallest. Floats are clamped to +-1.
//! What is not finite becomes 0. Devices of up to 24 bits read back exactly what was played.

use cpal::{I24, SampleFormat, SizedSample, U24};

/// A sample of a device.
pub(crate) trait DeviceSample: SizedSample + Send + 'static {
    /// Silence.
    const ZERO: Self;
    /// From a sample with full scale 1.
    fn from_unit(value: f32) -> Self;
    /// To a sample with full scale 1.
    fn to_unit(self) -> f32;
}

/// What is not finite is silence; the rest is clamped to full scale.
fn bounded(value: f32) -> f32 {
    if value.is_finite() { value.clamp(-1.0, 1.0) } else { 0.0 }
}

macro_rules! float {
    ($type:ty) => {
        impl DeviceSample for $type {
            const ZERO: Self = 0.0;
            fn from_unit(value: f32) -> Self {
                bounded(value) as $type
            }
            fn to_unit(self) -> f32 {
                let value = self as f32;
                if value.is_finite() { value } else { 0.0 }
            }
        }
    };
}

/// `$full` is full scale, `$zero` what stands for 0, `$wrap` and `$unwrap` lead from the number to the type and back.
macro_rules! integer {
    ($type:ty, $number:ty, $full:expr, $zero:expr, $wrap:expr, $unwrap:expr) => {
        impl DeviceSample for $type {
            const ZERO: Self = $wrap($zero as $number);
            fn from_unit(value: f32) -> Self {
                let steps = (f64::from(bounded(value)) * $full).round().min($full - 1.0);
                $wrap((steps as i64 + $zero) as $number)
            }
            fn to_unit(self) -> f32 {
                let steps = i64::from($unwrap(self)) - $zero;
                (steps as f64 / $full) as f32
            }
        }
    };
}

const fn same<T: Copy>(value: T) -> T {
    value
}

const BITS_8: f64 = 128.0;
const BITS_16: f64 = 32_768.0;
const BITS_24: f64 = 8_388_608.0;
const BITS_32: f64 = 2_147_483_648.0;

float!(f32);
float!(f64);
integer!(i8, i8, BITS_8, 0_i64, same, same);
integer!(u8, u8, BITS_8, 128_i64, same, same);
integer!(i16, i16, BITS_16, 0_i64, same, same);
integer!(u16, u16, BITS_16, 32_768_i64, same, same);
integer!(i32, i32, BITS_32, 0_i64, same, same);
integer!(u32, u32, BITS_32, 2_147_483_648_i64, same, same);

// The constructors of these two are not const: their silence is their default.
impl DeviceSample for I24 {
    const ZERO: Self = <I24 as cpal::Sample>::EQUILIBRIUM;
    fn from_unit(value: f32) -> Self {
        I24::new_unchecked((f64::from(bounded(value)) * BITS_24).round().min(BITS_24 - 1.0) as i32)
    }
    fn to_unit(self) -> f32 {
        (f64::from(self.inner()) / BITS_24) as f32
    }
}

impl DeviceSample for U24 {
    const ZERO: Self = <U24 as cpal::Sample>::EQUILIBRIUM;
    fn from_unit(value: f32) -> Self {
        let steps = (f64::from(bounded(value)) * BITS_24).round().min(BITS_24 - 1.0);
        U24::new_unchecked(steps as i32 + 8_388_608)
    }
    fn to_unit(self) -> f32 {
        (f64::from(self.inner() - 8_388_608) / BITS_24) as f32
    }
}

/// Runs the expression with the type of the format's samples in place of `T`.
macro_rules! with_sample {
    ($format:expr, $T:ident => $body:expr) => {
        match $format {
            $crate::Format::F32 => {
                type $T = f32;
                $body
            }
            $crate::Format::F64 => {
                type $T = f64;
                $body
            }
            $crate::Format::I8 => {
                type $T = i8;
                $body
            }
            $crate::Format::I16 => {
                type $T = i16;
                $body
            }
            $crate::Format::I24 => {
                type $T = cpal::I24;
                $body
            }
            $crate::Format::I32 => {
                type $T = i32;
                $body
            }
            $crate::Format::U8 => {
                type $T = u8;
                $body
            }
            $crate::Format::U16 => {
                type $T = u16;
                $body
            }
            $crate::Format::U24 => {
                type $T = cpal::U24;
                $body
            }
            $crate::Format::U32 => {
                type $T = u32;
                $body
            }
        }
    };
}
pub(crate) use with_sample;

/// How a device holds a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// 32-bit float.
    F32,
    /// 64-bit float.
    F64,
    /// 8-bit signed.
    I8,
    /// 16-bit signed.
    I16,
    /// 24-bit signed in four bytes.
    I24,
    /// 32-bit signed.
    I32,
    /// 8-bit unsigned.
    U8,
    /// 16-bit unsigned.
    U16,
    /// 24-bit unsigned in four bytes.
    U24,
    /// 32-bit unsigned.
    U32,
}

impl Format {
    /// All of them, the one to prefer first: floats need no rounding, wide integers little of it.
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

    /// Its name, as a user types it: `f32`, `i16`.
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
            Self::I8 => "i8",
            Self::I16 => "i16",
            Self::I24 => "i24",
            Self::I32 => "i32",
            Self::U8 => "u8",
            Self::U16 => "u16",
            Self::U24 => "u24",
            Self::U32 => "u32",
        }
    }

    /// Bytes a sample takes in the device's memory.
    pub fn bytes(self) -> usize {
        self.to_cpal().sample_size()
    }

    pub(crate) fn to_cpal(self) -> SampleFormat {
        match self {
            Self::F32 => SampleFormat::F32,
            Self::F64 => SampleFormat::F64,
            Self::I8 => SampleFormat::I8,
            Self::I16 => SampleFormat::I16,
            Self::I24 => SampleFormat::I24,
            Self::I32 => SampleFormat::I32,
            Self::U8 => SampleFormat::U8,
            Self::U16 => SampleFormat::U16,
            Self::U24 => SampleFormat::U24,
            Self::U32 => SampleFormat::U32,
        }
    }

    /// The format cpal means; none for those nobody here plays (64 bits, DSD).
    pub(crate) fn from_cpal(format: SampleFormat) -> Option<Self> {
        Self::ALL.into_iter().find(|one| one.to_cpal() == format)
    }
}

impl std::fmt::Display for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
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

    #[test]
    fn full_scale_is_the_largest_value_and_nothing_wraps() {
        assert_eq!((i16::from_unit(1.0), i16::from_unit(-1.0)), (32_767, -32_768));
        assert_eq!((i16::from_unit(7.0), i16::from_unit(-7.0)), (32_767, -32_768));
        assert_eq!((i32::from_unit(1.0), i32::from_unit(-1.0)), (i32::MAX, i32::MIN));
        assert_eq!((I24::from_unit(1.0).inner(), I24::from_unit(-1.0).inner()), (8_388_607, -8_388_608));
        assert_eq!((U24::from_unit(1.0).inner(), U24::from_unit(-1.0).inner()), (16_777_215, 0));
        assert_eq!((u8::from_unit(1.0), u8::from_unit(0.0), u8::from_unit(-1.0)), (255, 128, 0));
        assert_eq!((u16::from_unit(0.0), u32::from_unit(0.0)), (32_768, 2_147_483_648));
        assert_eq!((f32::from_unit(3.0), f64::from_unit(-3.0)), (1.0, -1.0));
    }

    #[test]
    fn what_is_not_finite_is_silence() {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(f32::from_unit(value), 0.0);
            assert_eq!(i16::from_unit(value), 0);
            assert_eq!(I24::from_unit(value).inner(), 0);
            assert_eq!(u16::from_unit(value), 32_768);
        }
        assert_eq!(f32::NAN.to_unit(), 0.0);
    }

    #[test]
    fn a_step_is_rounded_to_the_nearest() {
        let step = 1.0 / 32_768.0;
        assert_eq!(i16::from_unit(0.49 * step), 0);
        assert_eq!(i16::from_unit(0.51 * step), 1);
        assert_eq!(i16::from_unit(-0.51 * step), -1);
        assert_eq!(i16::from_unit(1000.4 * step), 1000);
    }

    #[test]
    fn sixteen_and_twenty_four_bits_come_back_as_they_went() {
        for value in i16::MIN..=i16::MAX {
            assert_eq!(i16::from_unit(value.to_unit()), value);
            assert_eq!(u16::from_unit((value as u16).to_unit()), value as u16);
        }
        for value in (-8_388_608..=8_388_607).step_by(97) {
            assert_eq!(I24::from_unit(I24::new_unchecked(value).to_unit()).inner(), value);
        }
    }

    #[test]
    fn every_name_reads_back() {
        for format in Format::ALL {
            assert_eq!(format.name().parse(), Ok(format));
            assert_eq!(Format::from_cpal(format.to_cpal()), Some(format));
        }
        assert!("i25".parse::<Format>().unwrap_err().contains("i24"));
    }
}
