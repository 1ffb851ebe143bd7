//! Whole-number layers: weights of 8 bits, inputs of 16, exact sums of 32, the same on every machine.
//!
//! Each run turns the inputs of a step into codes: `x = scale * code`. A code is a signed whole number
//! of up to 16 bits; the largest input gets the largest code. Products are summed as whole numbers,
//! then multiplied by the scales of inputs and column. So only the codes (by half of one) and the
//! result are rounded.

use super::{Block, Simd};
use std::ops::Range;

/// Largest code for this many inputs: sums of products with weights of up to 127 fit 32 bits.
pub(crate) fn largest_code(inputs: usize) -> f32 {
    let most = i64::from(i32::MAX) / (127 * inputs.max(1) as i64);
    most.min(i64::from(i16::MAX)) as f32
}

/// Inputs of a step as whole numbers: plain, and as bytes with 32768 added.
#[derive(Clone, Debug, Default)]
pub(crate) struct Codes {
    codes: Vec<i16>,
    high: Vec<u8>,
    low: Vec<u8>,
    /// Value of a code of 1.
    scale: f32,
}

impl Codes {
    /// Room for `most` inputs.
    pub(crate) fn new(most: usize) -> Self {
        // The last group of inputs may be padded.
        let room = most.next_multiple_of(4);
        Self { codes: vec![0; room], high: vec![0; room], low: vec![0; room], scale: 0.0 }
    }

    /// Takes the inputs in `runs`. If one is not finite, the scale and so all results are NaN. `None`
    /// if there are too many.
    ///
    /// `SPLIT` asks for the bytes.
    #[inline(always)]
    pub(super) fn take<const SPLIT: bool>(
        &mut self,
        runs: &[Range<usize>],
        most: f32,
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
            if SPLIT {
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

    pub(super) fn codes(&self) -> &[i16] {
        &self.codes
    }

    /// High and low bytes.
    pub(super) fn bytes(&self) -> (&[u8], &[u8]) {
        (&self.high, &self.low)
    }
}

/// Vectors of sums of whole numbers.
///
/// # Safety
/// As for [`Simd`]; AVX-512 also needs VNNI.
pub(crate) trait Whole: Simd {
    /// Number of inputs whose weights lie side by side in each column.
    const TOGETHER: usize;
    /// Whether inputs are read as bytes with 32768 added.
    const SPLIT: bool;
    /// The codes of a group of inputs.
    type Group: Copy;
    /// [`Simd::LANES`] sums.
    type Sums: Copy;
    unsafe fn nothing() -> Self::Sums;
    /// The groups of the inputs.
    fn groups(codes: &Codes) -> impl Iterator<Item = Self::Group>;
    /// Adds the products with a group's weights, `TOGETHER` for each lane.
    unsafe fn gather(sums: Self::Sums, group: Self::Group, weights: *const i8) -> Self::Sums;
    /// The sums plus their initial values, one for each lane, as floats.
    unsafe fn total(sums: Self::Sums, start: *const i32) -> Self::Vector;
}

/// Data that a whole-number block reads beside the codes.
#[derive(Clone, Copy)]
pub(super) struct Columns<'a> {
    pub(super) bias: &'a [f32],
    pub(super) unscale: &'a [f32],
    pub(super) starts: &'a [i32],
    /// By groups of inputs, within them column by column.
    pub(super) weights: &'a [i8],
}

/// # Safety
/// The CPU has the instruction set of `S`.
#[inline(always)]
pub(super) unsafe fn any_block<S: Whole>(
    b: &Block,
    columns: Columns<'_>,
    codes: &Codes,
    arena: &mut [f32],
) -> Option<()> {
    // SAFETY: passed on to the caller.
    unsafe { by_vectors!(b.vectors, S::MOST, V => block::<S, V>(b, columns, codes, arena)) }
}

/// # Safety
/// The CPU has the instruction set of `S`.
#[inline(always)]
unsafe fn block<S: Whole, const V: usize>(
    b: &Block,
    columns: Columns<'_>,
    codes: &Codes,
    arena: &mut [f32],
) -> Option<()> {
    let width = V * S::LANES;
    let weights = columns.weights.get(..b.inputs.div_ceil(S::TOGETHER) * S::TOGETHER * width)?;
    // SAFETY: the instruction set is the caller's promise.
    let mut sums = unsafe { [S::nothing(); V] };
    for (group, weights) in S::groups(codes).zip(weights.chunks_exact(S::TOGETHER * width)) {
        for (v, sum) in sums.iter_mut().enumerate() {
            // SAFETY: the instruction set is the caller's promise; `weights` has `TOGETHER` for each of
            // V * LANES columns.
            *sum = unsafe { S::gather(*sum, group, weights.as_ptr().add(v * S::TOGETHER * S::LANES)) };
        }
    }
    let bias = columns.bias.get(..width)?.as_ptr();
    let unscale = columns.unscale.get(..width)?.as_ptr();
    let starts = columns.starts.get(..width)?.as_ptr();
    let to = arena.get_mut(b.to..)?.get_mut(..width)?.as_mut_ptr();
    for (v, sums) in sums.into_iter().enumerate() {
        let at = v * S::LANES;
        // SAFETY: the instruction set is the caller's promise; all four have V * LANES numbers.
        unsafe {
            let scale = S::mul(S::load(unscale.add(at)), S::splat(codes.scale));
            let y = S::add(S::mul(S::total(sums, starts.add(at)), scale), S::load(bias.add(at)));
            S::store(S::clamp(y, S::splat(b.low), S::splat(b.high)), to.add(at));
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_the_nearest_whole_numbers_and_ties_go_to_even() {
        let arena = [1.0, -4.0, 0.5, -0.125, 0.0, 3.0];
        let mut codes = Codes::new(6);
        codes.take::<false>(&[4..5, 0..4], 40.0, &arena).unwrap();
        assert_eq!(codes.scale, 0.1);
        // -1.25 and 5 are no ties; 0 is 0.
        assert_eq!(codes.codes()[..5], [0, 10, -40, 5, -1]);
        codes.take::<true>(&[4..5, 0..4], 40.0, &arena).unwrap();
        let (high, low) = codes.bytes();
        let joined: Vec<i32> =
            high.iter().zip(low).map(|(h, l)| i32::from(*h) * 256 + i32::from(*l)).collect();
        assert_eq!(joined[..5], [0, 10, -40, 5, -1].map(|code| code + 32768));
        codes.take::<false>(std::slice::from_ref(&(0..4)), 4.0, &[4.0, 2.5, 1.5, -0.5]).unwrap();
        assert_eq!(codes.codes()[..4], [4, 2, 2, 0]);
    }

    #[test]
    fn codes_of_non_finite_values_have_nan_scale() {
        let mut codes = Codes::new(4);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            codes.take::<false>(std::slice::from_ref(&(0..2)), 32767.0, &[1.0, bad]).unwrap();
            assert!(codes.scale.is_nan());
        }
        codes.take::<false>(std::slice::from_ref(&(0..2)), 32767.0, &[1e-40, 0.0]).unwrap();
        assert!(codes.scale.is_finite() && codes.codes()[..2] == [0, 0]);
        assert_eq!(codes.take::<false>(&[0..2, 0..3], 32767.0, &[0.0; 3]), None);
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
