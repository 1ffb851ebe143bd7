//! The packed network's inner loop, once per instruction set.
//!
//! [`execute`] is written once over [`Simd`] and inlined into one function per instruction set that is
//! compiled for it, so that dispatch happens once per run. Lengths are checked once per block of columns;
//! unsafe are only calls of functions compiled for an instruction set, and loads and stores within slices of
//! checked length. Layers whose weights are whole numbers have a loop of their own.
//!
//! A result has the same bits on every instruction set. Each column is summed up in the order of the inputs,
//! and a product is rounded before it is added: not every CPU has an instruction that rounds once.

/// Functions of one expression for each operation of an instruction set.
macro_rules! operations {
    ($($name:ident($($x:ident: $t:ty),*) -> $r:ty $body:block)*) => {$(
        #[inline(always)]
        #[allow(unused_unsafe, reason = "plain code needs none")]
        unsafe fn $name($($x: $t),*) -> $r {
            // SAFETY: the caller has the instruction set, and the elements at its pointers. No load or
            // store needs more alignment than an element's.
            unsafe { $body }
        }
    )*};
}

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod codes;
mod portable;

use crate::runner::Precision;
use asperity_dsp::{Float as _, Isa};
pub(crate) use codes::{Codes, largest_code};
use std::ops::Range;

/// Whether this machine also has the instructions for sums of whole numbers: with AVX-512 these are BW
/// and VNNI.
pub(crate) fn has_whole_numbers(isa: Isa) -> bool {
    match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => is_x86_feature_detected!("avx512bw") && is_x86_feature_detected!("avx512vnni"),
        _ => true,
    }
}

/// Cells with a 64-byte boundary in front. The heap block does not move with its owner.
pub(crate) struct Aligned<T> {
    cells: Vec<T>,
    start: usize,
}

impl<T: Copy + Default> Clone for Aligned<T> {
    /// Aligned anew.
    fn clone(&self) -> Self {
        Self::new(self.get())
    }
}

impl<T: Copy + Default> Aligned<T> {
    pub(crate) fn new(data: &[T]) -> Self {
        let pad = 64 / size_of::<T>();
        let mut cells = vec![T::default(); data.len() + pad];
        let start = cells.as_ptr().align_offset(64).min(pad);
        cells.truncate(start + data.len());
        cells[start..].copy_from_slice(data);
        Self { cells, start }
    }

    #[inline]
    pub(crate) fn get(&self) -> &[T] {
        &self.cells[self.start..]
    }

    #[inline]
    pub(crate) fn get_mut(&mut self) -> &mut [T] {
        &mut self.cells[self.start..]
    }
}

/// An affine step. It reads `runs` of the arena and writes whole vectors of columns at `to`.
pub(crate) struct Layer {
    pub(crate) to: usize,
    pub(crate) runs: Vec<Range<usize>>,
    /// Number of those inputs.
    pub(crate) inputs: usize,
    /// Storage of the weights.
    pub(crate) precision: Precision,
    pub(crate) blocks: Vec<Block>,
    /// By blocks. In one they lie row by row; a row has one input's weights for the block's columns.
    /// Whole numbers lie by groups of inputs, within them column by column.
    pub(crate) weights: Aligned<u8>,
    /// For each material, or one for all.
    pub(crate) biases: Vec<Vec<f32>>,
    /// Factors of the columns' sums, with f16 and whole numbers.
    pub(crate) unscale: Vec<f32>,
    /// For whole numbers: initial sums of the columns.
    pub(crate) starts: Vec<i32>,
    pub(crate) low: f32,
    pub(crate) high: f32,
}

/// Columns of a layer whose sums fit the registers.
pub(crate) struct Block {
    pub(crate) vectors: usize,
    /// The first of them.
    pub(crate) column: usize,
    /// The first of their weights, in bytes.
    pub(crate) weights: usize,
}

/// `scale * arena[from] + offset`.
pub(crate) struct Pick {
    pub(crate) from: usize,
    pub(crate) scale: f32,
    pub(crate) offset: f32,
}

/// One instruction of a run.
pub(crate) enum Instruction {
    Affine(Layer),
    /// Writes `picks` at `to`, clamped.
    Pick {
        to: usize,
        picks: Vec<Pick>,
        low: f32,
        high: f32,
    },
    /// Turns results into their exponentials.
    Exponential(Range<usize>),
}

/// Vectors of f32, and of sums of whole numbers.
///
/// # Safety
/// Every function needs a CPU with the instruction set, and [`Simd::LANES`] elements at its pointers,
/// aligned like one element. Those for whole numbers need [`has_whole_numbers`].
pub(crate) trait Simd {
    const LANES: usize;
    /// Most vectors of sums in registers, beside an input and a weight.
    const MOST: usize;
    /// Number of inputs whose whole-number weights lie side by side in each column.
    const TOGETHER: usize;
    /// Whether codes are read as bytes with 32768 added, which the initial sums compensate.
    const SPLIT: bool;
    type Vector: Copy;
    /// The codes of a group of inputs.
    type Group: Copy;
    /// [`Simd::LANES`] sums of whole numbers.
    type Sums: Copy;
    unsafe fn splat(x: f32) -> Self::Vector;
    unsafe fn load(from: *const f32) -> Self::Vector;
    unsafe fn load_f16(from: *const u16) -> Self::Vector;
    unsafe fn store(v: Self::Vector, to: *mut f32);
    unsafe fn add(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    unsafe fn mul(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// Clamps to `low..=high` and passes NaN on.
    unsafe fn clamp(x: Self::Vector, low: Self::Vector, high: Self::Vector) -> Self::Vector;
    unsafe fn nothing() -> Self::Sums;
    /// The groups of the inputs.
    fn groups(codes: &Codes) -> impl Iterator<Item = Self::Group>;
    /// Adds the products with a group's weights, `TOGETHER` for each lane.
    unsafe fn gather(sums: Self::Sums, group: Self::Group, weights: *const i8) -> Self::Sums;
    /// The sums plus their initial values, one for each lane, as floats.
    unsafe fn total(sums: Self::Sums, start: *const i32) -> Self::Vector;
}

/// Runs a program for a material. `None` if it does not fit the arena, which packing rules out.
///
/// # Safety
/// The CPU has the instruction set of `S`.
#[inline(always)]
unsafe fn execute<S: Simd>(
    program: &[Instruction],
    material: usize,
    codes: &mut Codes,
    arena: &mut [f32],
) -> Option<()> {
    for instruction in program {
        match instruction {
            Instruction::Affine(layer) => {
                let bias = layer.biases.get(material).or(layer.biases.first())?;
                if layer.precision == Precision::Int8 {
                    codes.take(&layer.runs, largest_code(layer.inputs), S::SPLIT, arena)?;
                }
                for b in &layer.blocks {
                    macro_rules! block {
                        ($($vectors:literal)*) => {
                            match b.vectors {
                                // SAFETY: passed on to the caller.
                                $($vectors if $vectors <= S::MOST => unsafe {
                                    block::<S, $vectors>(layer, b, bias, codes, arena)?
                                },)*
                                _ => return None,
                            }
                        };
                    }
                    block!(1 2 3 4 5 6 7 8 9 10 11 12);
                }
            }
            Instruction::Pick { to, picks, low, high } => {
                for (i, p) in picks.iter().enumerate() {
                    let x = p.scale * *arena.get(p.from)? + p.offset;
                    // f32::clamp panics on bad bounds.
                    let x = if x < *low { *low } else { x };
                    *arena.get_mut(to + i)? = if x > *high { *high } else { x };
                }
            }
            Instruction::Exponential(of) => {
                for x in arena.get_mut(of.clone())? {
                    *x = if x.is_nan() { *x } else { x.exponential() };
                }
            }
        }
    }
    Some(())
}

/// # Safety
/// The CPU has the instruction set of `S`.
#[inline(always)]
unsafe fn block<S: Simd, const V: usize>(
    layer: &Layer,
    b: &Block,
    bias: &[f32],
    codes: &Codes,
    arena: &mut [f32],
) -> Option<()> {
    let columns = b.column..b.column + V * S::LANES;
    let weights = layer.weights.get().get(b.weights..)?;
    let bias = bias.get(columns.clone())?;
    let unscale = layer.unscale.get(columns.clone())?;
    // SAFETY: the instruction set is the caller's promise. All slices are of V * LANES columns, also below.
    unsafe {
        match layer.precision {
            Precision::Int8 => {
                let starts = layer.starts.get(columns.clone())?;
                let sums = whole::<S, V>(layer.inputs, weights, starts, unscale, bias, codes)?;
                store::<S, V>(layer, arena.get_mut(layer.to..)?.get_mut(columns)?, |v| sums[v]);
            }
            Precision::F16 => {
                let sums = floats::<S, V, true>(&layer.runs, weights, bias, arena)?;
                let scaled = |v| S::mul(sums[v], S::load(unscale.as_ptr().add(v * S::LANES)));
                store::<S, V>(layer, arena.get_mut(layer.to..)?.get_mut(columns)?, scaled);
            }
            Precision::F32 | Precision::F64 => {
                let sums = floats::<S, V, false>(&layer.runs, weights, bias, arena)?;
                store::<S, V>(layer, arena.get_mut(layer.to..)?.get_mut(columns)?, |v| sums[v]);
            }
        }
    }
    Some(())
}

/// Writes clamped results.
///
/// # Safety
/// The CPU has the instruction set of `S`; `to` has room for V vectors.
#[inline(always)]
unsafe fn store<S: Simd, const V: usize>(layer: &Layer, to: &mut [f32], result: impl Fn(usize) -> S::Vector) {
    for v in 0..V {
        // SAFETY: the caller's promise.
        unsafe {
            let y = S::clamp(result(v), S::splat(layer.low), S::splat(layer.high));
            S::store(y, to.as_mut_ptr().add(v * S::LANES));
        }
    }
}

/// Sums over f32 weights, or over f16 weights with `HALF`.
///
/// # Safety
/// The CPU has the instruction set of `S`. `bias` has V * LANES floats.
#[inline(always)]
unsafe fn floats<S: Simd, const V: usize, const HALF: bool>(
    runs: &[Range<usize>],
    mut weights: &[u8],
    bias: &[f32],
    arena: &[f32],
) -> Option<[S::Vector; V]> {
    let bytes = if HALF { 2 } else { 4 };
    // SAFETY: the caller's promise.
    let mut sums = unsafe { [S::splat(0.0); V] };
    for (v, sum) in sums.iter_mut().enumerate() {
        // SAFETY: as above.
        *sum = unsafe { S::load(bias.as_ptr().add(v * S::LANES)) };
    }
    for run in runs {
        let inputs = arena.get(run.clone())?;
        let (rows, rest) = weights.split_at_checked(inputs.len() * (V * S::LANES) * bytes)?;
        weights = rest;
        let mut row = rows.as_ptr();
        for &x in inputs {
            // SAFETY: the instruction set is the caller's promise; `rows` has a row of V * LANES weights
            // for each input.
            unsafe {
                let x = S::splat(x);
                for (v, sum) in sums.iter_mut().enumerate() {
                    let from = row.add(v * S::LANES * bytes);
                    let weights = if HALF { S::load_f16(from.cast()) } else { S::load(from.cast()) };
                    *sum = S::add(*sum, S::mul(weights, x));
                }
                row = row.add(V * S::LANES * bytes);
            }
        }
    }
    Some(sums)
}

/// Sums over whole-number weights and codes of the inputs.
///
/// # Safety
/// The CPU has the instruction set of `S`. `starts`, `unscale` and `bias` have V * LANES numbers.
#[inline(always)]
unsafe fn whole<S: Simd, const V: usize>(
    inputs: usize,
    weights: &[u8],
    starts: &[i32],
    unscale: &[f32],
    bias: &[f32],
    codes: &Codes,
) -> Option<[S::Vector; V]> {
    let row = S::TOGETHER * V * S::LANES;
    let weights = weights.get(..inputs.div_ceil(S::TOGETHER) * row)?;
    // SAFETY: the caller's promise.
    let mut sums = unsafe { [S::nothing(); V] };
    for (group, weights) in S::groups(codes).zip(weights.chunks_exact(row)) {
        for (v, sum) in sums.iter_mut().enumerate() {
            // SAFETY: `weights` has `TOGETHER` for each of V * LANES columns.
            *sum = unsafe { S::gather(*sum, group, weights.as_ptr().add(v * S::TOGETHER * S::LANES).cast()) };
        }
    }
    // SAFETY: the caller's promise.
    let mut floats = unsafe { [S::splat(codes.scale); V] };
    for (v, (y, sums)) in floats.iter_mut().zip(sums).enumerate() {
        let at = v * S::LANES;
        // SAFETY: the caller's promise.
        unsafe {
            let scale = S::mul(S::load(unscale.as_ptr().add(at)), *y);
            *y = S::add(
                S::mul(S::total(sums, starts.as_ptr().add(at)), scale),
                S::load(bias.as_ptr().add(at)),
            );
        }
    }
    Some(floats)
}

/// A function compiled for one instruction set, and its layout of weights and results.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    run: unsafe fn(&[Instruction], usize, &mut Codes, &mut [f32]) -> Option<()>,
    /// f32 lanes of a vector.
    pub(crate) lanes: usize,
    /// Most vectors of sums that a block keeps in registers.
    pub(crate) most: usize,
    /// See [`Simd::TOGETHER`].
    pub(crate) together: usize,
    /// See [`Simd::SPLIT`].
    pub(crate) split: bool,
}

/// The entry of an instruction set, compiled with CPU features.
macro_rules! entry {
    ($simd:ty $(, $features:literal)?) => {{
        $(#[target_feature(enable = $features)])?
        unsafe fn run(p: &[Instruction], material: usize, c: &mut Codes, a: &mut [f32]) -> Option<()> {
            // SAFETY: passed on to the caller.
            unsafe { execute::<$simd>(p, material, c, a) }
        }
        fn of<S: Simd>() -> Entry {
            Entry { run, lanes: S::LANES, most: S::MOST, together: S::TOGETHER, split: S::SPLIT }
        }
        of::<$simd>()
    }};
}

impl Entry {
    /// `None` if this machine cannot run it.
    pub(crate) fn new(isa: Isa, precision: Precision) -> Option<Self> {
        let whole = has_whole_numbers(isa);
        if !isa.is_available() || (precision == Precision::Int8 && !whole) {
            return None;
        }
        Some(match isa {
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 if whole => entry!(avx512::Avx512, "avx512f,avx512bw,avx512vnni"),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 => entry!(avx512::Avx512, "avx512f"),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 => entry!(avx2::Avx2, "avx2,fma,f16c"),
            _ => entry!(portable::Portable),
        })
    }

    /// Runs a program over the arena. `None` if it does not fit, which packing rules out.
    #[inline]
    pub(crate) fn run(
        &self,
        program: &[Instruction],
        material: usize,
        codes: &mut Codes,
        arena: &mut [f32],
    ) -> Option<()> {
        // SAFETY: `new` found the instruction set on this machine.
        unsafe { (self.run)(program, material, codes, arena) }
    }
}
