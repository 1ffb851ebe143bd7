//! What a wire holds in a tick, number by number.

use std::num::FpCategory;

use asperity_node::Buffer;

/// Shows `each` the kind of every number; a frame that did not come has none.
fn look(buffer: &Buffer, mut each: impl FnMut(FpCategory)) {
    match buffer {
        Buffer::Control { values, .. } => values.iter().for_each(|x| each(x.classify())),
        Buffer::Audio { samples, len, .. } => samples.iter().take(*len).for_each(|x| each(x.classify())),
        Buffer::Magnitude { bins, frame: Some(_), .. } => bins.iter().for_each(|x| each(x.classify())),
        Buffer::Spectrum { bins, frame: Some(_), .. } => {
            bins.iter().flat_map(|z| [z.re, z.im]).for_each(|x| each(x.classify()));
        }
        Buffer::Magnitude { frame: None, .. } | Buffer::Spectrum { frame: None, .. } => {}
    }
}

/// Whether no number is a NaN or an infinity.
pub(crate) fn finite(buffer: &Buffer) -> bool {
    let mut finite = true;
    look(buffer, |class| finite &= !matches!(class, FpCategory::Nan | FpCategory::Infinite));
    finite
}

/// How many numbers are not zero and below the least normal one.
pub(crate) fn denormals(buffer: &Buffer) -> u64 {
    let mut count = 0;
    look(buffer, |class| count += u64::from(class == FpCategory::Subnormal));
    count
}

/// Whether two hold the same to the bit, and are trusted alike.
pub(crate) fn same(a: &Buffer, b: &Buffer) -> bool {
    let alike = |a: &[f32], b: &[f32]| a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits()));
    let holds = match (a, b) {
        (Buffer::Control { values: a, .. }, Buffer::Control { values: b, .. }) => {
            a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits()))
        }
        (Buffer::Audio { samples: a, len: m, .. }, Buffer::Audio { samples: b, len: n, .. }) => {
            m == n && alike(a.get(..*m).unwrap_or(a), b.get(..*n).unwrap_or(b))
        }
        (Buffer::Magnitude { bins: a, frame: f, .. }, Buffer::Magnitude { bins: b, frame: g, .. }) => {
            f == g && (f.is_none() || alike(a, b))
        }
        (Buffer::Spectrum { bins: a, frame: f, .. }, Buffer::Spectrum { bins: b, frame: g, .. }) => {
            let alike = || a.iter().zip(b).all(|(a, b)| alike(&[a.re, a.im], &[b.re, b.im]));
            f == g && (f.is_none() || a.len() == b.len() && alike())
        }
        _ => false,
    };
    holds && a.is_valid() == b.is_valid()
}

#[cfg(test)]
mod tests {
    use super::*;

    use asperity_node::{FrameLayout, FrameRate, PortType, Shape, Unit};

    /// A frame of two bins, the second of which is this.
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
    fn a_spectrum_whose_zero_changes_its_sign_is_another() {
        let one = spectrum(1.0, 0.0, true);
        assert!(same(&one, &one.clone()));
        assert!(!same(&one, &spectrum(1.0, -0.0, true)));
        assert!(!same(&one, &spectrum(1.0, 0.0, false)));
        // Where no frame came, what is left of the last one is nothing.
        assert!(same(&spectrum(1.0, 0.0, false), &spectrum(2.0, f32::NAN, false)));
    }

    #[test]
    fn only_what_is_heard_in_a_tick_counts() {
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
    fn what_is_not_trusted_is_not_the_same() {
        let (one, mut other) = (Buffer::constant(2, 1.0), Buffer::constant(2, 1.0));
        assert!(same(&one, &other));
        other.set_valid(false);
        assert!(!same(&one, &other) && !same(&one, &samples(&[1.0, 1.0], 2)));
    }
}
