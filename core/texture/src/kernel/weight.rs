//! Storage types of weights, and how a block of each runs.

use super::whole::{self, Columns, Whole};
use super::{Block, Codes, Data, Simd, any_block};
use std::ops::Range;

/// A stored weight: f32, f16 as its bits, or i8.
pub(crate) trait Weight: Copy {
    /// Whether columns are stored scaled.
    const SCALED: bool;
    /// Whether weights are whole numbers; their inputs then become whole numbers too.
    const WHOLE: bool;
    /// Sum of a checksum: no wider than a weight, so that only reading takes time.
    type Sum: Copy + Default + Into<u32>;
    /// `sum` and this weight's bits.
    fn add_to(self, sum: Self::Sum) -> Self::Sum;
    /// Computes a block.
    ///
    /// # Safety
    /// The CPU has the instruction set of `S`, including that for whole numbers if needed.
    unsafe fn block<S: Whole>(
        b: &Block,
        runs: &[Range<usize>],
        bias: &[f32],
        data: Data<'_, Self>,
        codes: &Codes,
        arena: &mut [f32],
    ) -> Option<()>;
}

/// A weight that becomes f32 when it is read.
pub(crate) trait Float: Weight {
    /// # Safety
    /// The CPU has the instruction set of `S`, and `S::LANES` elements can be read from `from`.
    unsafe fn load<S: Simd>(from: *const Self) -> S::Vector;
}

impl Float for f32 {
    #[inline(always)]
    unsafe fn load<S: Simd>(from: *const f32) -> S::Vector {
        // SAFETY: passed on to the caller.
        unsafe { S::load(from) }
    }
}

impl Float for u16 {
    #[inline(always)]
    unsafe fn load<S: Simd>(from: *const u16) -> S::Vector {
        // SAFETY: passed on to the caller.
        unsafe { S::load_f16(from) }
    }
}

impl Weight for f32 {
    const SCALED: bool = false;
    const WHOLE: bool = false;
    type Sum = u32;
    #[inline(always)]
    fn add_to(self, sum: u32) -> u32 {
        sum.wrapping_add(self.to_bits())
    }
    #[inline(always)]
    unsafe fn block<S: Whole>(
        b: &Block,
        runs: &[Range<usize>],
        bias: &[f32],
        data: Data<'_, f32>,
        _: &Codes,
        arena: &mut [f32],
    ) -> Option<()> {
        // SAFETY: passed on to the caller.
        unsafe { any_block::<S, f32>(b, runs, bias, &[], data.weights.get(b.weights..)?, arena) }
    }
}

impl Weight for u16 {
    const SCALED: bool = true;
    const WHOLE: bool = false;
    type Sum = u16;
    #[inline(always)]
    fn add_to(self, sum: u16) -> u16 {
        sum.wrapping_add(self)
    }
    #[inline(always)]
    unsafe fn block<S: Whole>(
        b: &Block,
        runs: &[Range<usize>],
        bias: &[f32],
        data: Data<'_, u16>,
        _: &Codes,
        arena: &mut [f32],
    ) -> Option<()> {
        let (weights, unscale) = (data.weights.get(b.weights..)?, data.fixed.get(b.unscale..)?);
        // SAFETY: passed on to the caller.
        unsafe { any_block::<S, u16>(b, runs, bias, unscale, weights, arena) }
    }
}

impl Weight for i8 {
    const SCALED: bool = true;
    const WHOLE: bool = true;
    type Sum = u8;
    #[inline(always)]
    fn add_to(self, sum: u8) -> u8 {
        sum.wrapping_add(self.cast_unsigned())
    }
    #[inline(always)]
    unsafe fn block<S: Whole>(
        b: &Block,
        _: &[Range<usize>],
        bias: &[f32],
        data: Data<'_, i8>,
        codes: &Codes,
        arena: &mut [f32],
    ) -> Option<()> {
        let (weights, unscale) = (data.weights.get(b.weights..)?, data.fixed.get(b.unscale..)?);
        let columns = Columns { bias, unscale, starts: data.starts.get(b.starts..)?, weights };
        // SAFETY: passed on to the caller.
        unsafe { whole::any_block::<S>(b, columns, codes, arena) }
    }
}
