//! Inputs of layers of whole numbers: weights of 8 bits, inputs of 16, exact sums of 32, the same on every
//! machine.
//!
//! Each run turns the inputs of a step into codes: `x = scale * code`. A code is a signed whole number
//! of up to 16 bits; the largest input gets the largest code. Products are summed as whole numbers,
//! then multiplied by the scales of inputs and column. So only the codes (by half of one) and the
//! result are rounded.

use std::ops::Range;

/// Largest code for this many inputs: sums of products with weights of up to 127 fit 32 bits.
pub(crate) fn largest_code(inputs: usize) -> f32 {
    let most = i64::from(i32::MAX) / (127 * inputs.max(1) as i64);
    most.min(i64::from(i16::MAX)) as f32
}

/// Inputs of a step as whole numbers: plain, and as bytes with 32768 added.
#[derive(Clone, Debug, Default)]
pub(crate) struct Codes {
    pub(super) codes: Vec<i16>,
    pub(super) high: Vec<u8>,
    pub(super) low: Vec<u8>,
    /// Value of a code of 1.
    pub(super) scale: f32,
}

impl Codes {
    /// Room for `most` inputs.
    pub(crate) fn new(most: usize) -> Self {
        // The last group of inputs may be padded.
        let room = most.next_multiple_of(4);
        Self { codes: vec![0; room], high: vec![0; room], low: vec![0; room], scale: 0.0 }
    }

    /// Takes the inputs in `runs`, as bytes with `split`. If one is not finite, the scale and so all results
    /// are NaN. `None` if there are too many.
    #[inline(always)]
    pub(super) fn take(
        &mut self,
        runs: &[Range<usize>],
        most: f32,
        split: bool,
        arena: &[f32],
    ) -> Option<()> {
        // Unsigned numbers sort like their bits; non-finite ones come last.
        let mut largest = 0u32;
        for run in runs {
            let magnitudes = arena.get(run.clone())?.iter().map(|x| x.to_bits() & 0x7fff_ffff);
            largest = magnitudes.fold(largest, u32::max);
        }
        let largest = f32::from_bits(largest);
        // Values far below anything audible count as 0, so that the inverse stays finite.
        let inverse = if largest > 1e-30 { most / largest } else { 0.0 };
        self.scale = if largest.is_finite() { largest / most } else { f32::NAN };
        // Numbers near 1.5 x 2^23 are 1 apart. Adding it rounds, ties to even, and leaves the code in
        // the low bits.
        const WHOLE: f32 = 12_582_912.0;
        let code = |x: f32| (x * inverse + WHOLE).to_bits() as u16;
        let mut first = 0;
        for run in runs {
            let inputs = arena.get(run.clone())?;
            let places = first..first + inputs.len();
            if split {
                let bytes =
                    self.high.get_mut(places.clone())?.iter_mut().zip(self.low.get_mut(places.clone())?);
                for ((high, low), &x) in bytes.zip(inputs) {
                    let code = code(x) ^ 0x8000;
                    (*high, *low) = ((code >> 8) as u8, code as u8);
                }
            } else {
                let codes = self.codes.get_mut(places.clone())?.iter_mut();
                codes.zip(inputs).for_each(|(to, &x)| *to = code(x).cast_signed());
            }
            first = places.end;
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_the_nearest_whole_numbers_and_ties_go_to_even() {
        let arena = [1.0, -4.0, 0.5, -0.125, 0.0, 3.0];
        let mut codes = Codes::new(6);
        codes.take(&[4..5, 0..4], 40.0, false, &arena).unwrap();
        assert_eq!(codes.scale, 0.1);
        // -1.25 and 5 are no ties; 0 is 0.
        assert_eq!(codes.codes[..5], [0, 10, -40, 5, -1]);
        codes.take(&[4..5, 0..4], 40.0, true, &arena).unwrap();
        let joined: Vec<i32> =
            codes.high.iter().zip(&codes.low).map(|(h, l)| i32::from(*h) * 256 + i32::from(*l)).collect();
        assert_eq!(joined[..5], [0, 10, -40, 5, -1].map(|code| code + 32768));
        codes.take(std::slice::from_ref(&(0..4)), 4.0, false, &[4.0, 2.5, 1.5, -0.5]).unwrap();
        assert_eq!(codes.codes[..4], [4, 2, 2, 0]);
    }

    #[test]
    fn codes_of_non_finite_values_have_nan_scale() {
        let mut codes = Codes::new(4);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            codes.take(std::slice::from_ref(&(0..2)), 32767.0, false, &[1.0, bad]).unwrap();
            assert!(codes.scale.is_nan());
        }
        codes.take(std::slice::from_ref(&(0..2)), 32767.0, false, &[1e-40, 0.0]).unwrap();
        assert!(codes.scale.is_finite() && codes.codes[..2] == [0, 0]);
        assert_eq!(codes.take(&[0..2, 0..3], 32767.0, false, &[0.0; 3]), None);
    }

    #[test]
    fn the_largest_codes_fit_the_sum() {
        for inputs in [1, 300, 516, 517, 4000] {
            let most = largest_code(inputs);
            assert!(f64::from(most) * 127.0 * inputs as f64 <= f64::from(i32::MAX));
            assert!(most == 32767.0 || f64::from(most + 1.0) * 127.0 * inputs as f64 > f64::from(i32::MAX));
        }
        assert_eq!((largest_code(516), largest_code(0)), (32767.0, 32767.0));
    }
}
