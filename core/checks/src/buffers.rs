//! The numbers that a wire carries in a tick.

use std::iter::{empty, once};
use std::num::FpCategory;

use asperity_node::Buffer;

/// The class of every number. A frame that did not come has none.
fn classes(buffer: &Buffer) -> Box<dyn Iterator<Item = FpCategory> + '_> {
    match buffer {
        Buffer::Control { values, .. } => Box::new(values.iter().map(|x| x.classify())),
        Buffer::Audio { samples, len, .. } => Box::new(samples.iter().take(*len).map(|x| x.classify())),
        Buffer::Magnitude { bins, frame: Some(_), .. } => Box::new(bins.iter().map(|x| x.classify())),
        Buffer::Spectrum { bins, frame: Some(_), .. } => {
            Box::new(bins.iter().flat_map(|z| [z.re, z.im]).map(f32::classify))
        }
        Buffer::Magnitude { frame: None, .. } | Buffer::Spectrum { frame: None, .. } => Box::new(empty()),
    }
}

/// Whether every number is finite.
pub fn finite(buffer: &Buffer) -> bool {
    !classes(buffer).any(|class| matches!(class, FpCategory::Nan | FpCategory::Infinite))
}

/// Number of denormal numbers.
pub(crate) fn denormals(buffer: &Buffer) -> u64 {
    classes(buffer).filter(|class| *class == FpCategory::Subnormal).count() as u64
}

/// A buffer's content in words: its type, the number of its frame, and the bits of each number that is heard.
pub(crate) fn words(buffer: &Buffer) -> Box<dyn Iterator<Item = u64> + '_> {
    let bits = |x: &f32| u64::from(x.to_bits());
    match buffer {
        Buffer::Control { values, .. } => Box::new(once(1).chain(values.iter().map(|x| x.to_bits()))),
        Buffer::Audio { samples, len, .. } => Box::new(once(2).chain(samples.iter().take(*len).map(bits))),
        Buffer::Magnitude { bins, frame: Some((frame, start)), .. } => {
            Box::new([3, *frame, *start].into_iter().chain(bins.iter().map(bits)))
        }
        Buffer::Spectrum { bins, frame: Some((frame, start)), .. } => {
            let bins = bins.iter().map(move |z| bits(&z.re) << 32 | bits(&z.im));
            Box::new([4, *frame, *start].into_iter().chain(bins))
        }
        Buffer::Magnitude { .. } | Buffer::Spectrum { .. } => Box::new(once(5)),
    }
}

/// A hash of some words.
pub(crate) fn hash(words: impl IntoIterator<Item = u64>) -> u64 {
    let add = |hash: u64, word: u64| (hash ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    words.into_iter().fold(0, add)
}

/// Whether two buffers hold the same to the bit, and are both valid or both not.
pub fn same(a: &Buffer, b: &Buffer) -> bool {
    words(a).eq(words(b)) && a.is_valid() == b.is_valid()
}

#[cfg(test)]
mod tests {
    use super::*;

    use asperity_node::{FrameLayout, FrameRate, PortType, Shape, Unit};

    /// A frame of two bins, of which the second has this value.
    fn spectrum(re: f32, im: f32, came: bool) -> Buffer {
        let frame_rate = FrameRate::new(500, 1).unwrap();
        let layout = FrameLayout { rate_hz: 2500, length: 250, bins: 2, frame_rate };
        let port = PortType { shape: Shape::Spectrum(layout), unit: Unit::NONE, limited: false };
        let mut buffer = Buffer::new(&port, 500);
        if let Buffer::Spectrum { bins, frame, .. } = &mut buffer {
            (bins[1].re, bins[1].im) = (re, im);
            *frame = came.then_some((3, 15));
        }
        buffer
    }

    fn samples(of: &[f32], heard: usize) -> Buffer {
        Buffer::Audio { samples: of.into(), len: heard, valid: true, silent: false }
    }

    #[test]
    fn spectrum_with_negative_zero_differs() {
        let one = spectrum(1.0, 0.0, true);
        assert!(same(&one, &one.clone()));
        assert!(!same(&one, &spectrum(1.0, -0.0, true)));
        assert!(!same(&one, &spectrum(1.0, 0.0, false)));
        // Without a frame, the bins of the last one do not count.
        assert!(same(&spectrum(1.0, 0.0, false), &spectrum(2.0, f32::NAN, false)));
    }

    #[test]
    fn samples_past_the_tick_do_not_count() {
        let (a, b) = (samples(&[1.0, 2.0, f32::NAN], 2), samples(&[1.0, 2.0, 1e-40], 2));
        assert!(same(&a, &b) && finite(&a) && denormals(&b) == 0);
        let (a, b) = (samples(&[1.0, 2.0, f32::NAN], 3), samples(&[1.0, 2.0, 1e-40], 3));
        assert!(!same(&a, &b) && !finite(&a) && denormals(&b) == 1);
        assert_eq!(
            (denormals(&spectrum(1e-40, -1e-40, true)), denormals(&spectrum(1e-40, 0.0, false))),
            (2, 0)
        );
    }

    #[test]
    fn invalid_buffer_differs_from_a_valid_one() {
        let (one, mut other) = (Buffer::constant(2, 1.0), Buffer::constant(2, 1.0));
        assert!(same(&one, &other));
        other.set_valid(false);
        assert!(!same(&one, &other) && !same(&one, &samples(&[1.0, 1.0], 2)));
    }
}
