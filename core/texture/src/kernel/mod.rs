//! The packed network's inner loop, once per instruction set.
//!
//! [`execute`] and [`checksum`] are written once over [`Simd`] and inlined into one function per
//! instruction set that is compiled for it, so that dispatch happens once per run. Lengths are checked once
//! per block of columns; what is unsafe is calling a function compiled for an instruction set, and loads
//! and stores within slices of checked length. Layers whose weights are whole numbers have a loop of their
//! own, in [`whole`].
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

/// Calls a function with a constant number of vectors, 1 to 12.
macro_rules! by_vectors {
    ($vectors:expr, $most:expr, $v:ident => $call:expr) => {
        by_vectors!($vectors, $most, $v => $call; 1 2 3 4 5 6 7 8 9 10 11 12)
    };
    ($vectors:expr, $most:expr, $v:ident => $call:expr; $($n:literal)*) => {
        match $vectors {
            $($n if $n <= $most => {
                const $v: usize = $n;
                $call
            })*
            _ => None,
        }
    };
}

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod portable;
mod weight;
mod whole;

use asperity_dsp::{Float as _, Isa};
use std::ops::Range;
pub(crate) use weight::{Float, Weight};
use whole::Whole;
pub(crate) use whole::{Codes, largest_code};

/// Whether this machine also has the instructions for sums of whole numbers: with AVX-512 these are BW
/// and VNNI.
pub(crate) fn has_whole_numbers(isa: Isa) -> bool {
    match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => is_x86_feature_detected!("avx512bw") && is_x86_feature_detected!("avx512vnni"),
        _ => true,
    }
}

impl Shape {
    /// Shape for an instruction set.
    pub(crate) fn new(isa: Isa) -> Shape {
        fn of<S: Whole>() -> Shape {
            Shape { lanes: S::LANES, most: S::MOST, together: S::TOGETHER, split: S::SPLIT }
        }
        match isa {
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 => of::<avx512::Avx512>(),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 => of::<avx2::Avx2>(),
            _ => of::<portable::Portable>(),
        }
    }
}

/// Layout of a block in registers and memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    /// f32 lanes of a vector.
    pub(crate) lanes: usize,
    /// Most vectors of sums that a block keeps in registers.
    pub(crate) most: usize,
    /// In whole-number layers: number of inputs whose weights lie side by side in a column.
    pub(crate) together: usize,
    /// In whole-number layers: whether 32768 is added to the codes, which the sums must compensate.
    pub(crate) split: bool,
}

/// Start of a block's biases: among the fixed ones, or among the material's.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Bias {
    Fixed(usize),
    Material(usize),
}

/// A block of columns of one affine step. It reads `runs` of the arena and writes `vectors * lanes`
/// floats at `to`.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub(crate) to: usize,
    pub(crate) vectors: usize,
    pub(crate) runs: Range<usize>,
    /// Number of those inputs.
    pub(crate) inputs: usize,
    pub(crate) bias: Bias,
    /// First weight. Weights lie row by row; a row has one input's weights for the block's columns.
    pub(crate) weights: usize,
    /// Whether its weights lie in [`Data::wide`].
    pub(crate) wide: bool,
    /// For scaled weights: start of the factors of each column's sum, among the fixed numbers.
    pub(crate) unscale: usize,
    /// For whole-number weights: start of the initial sums of the columns.
    pub(crate) starts: usize,
    pub(crate) low: f32,
    pub(crate) high: f32,
}

/// `scale * arena[from] + offset`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pick {
    pub(crate) from: usize,
    pub(crate) scale: f32,
    pub(crate) offset: f32,
}

/// One instruction of a run.
#[derive(Clone, Debug)]
pub(crate) enum Instruction {
    Block(Block),
    /// Turns `runs` into codes up to `most`, for the whole-number blocks that follow.
    Codes {
        runs: Range<usize>,
        most: f32,
    },
    /// Writes `picks` at `to`, clamped.
    Pick {
        to: usize,
        picks: Range<usize>,
        low: f32,
        high: f32,
    },
    /// Turns results into their exponentials.
    Exponential(Range<usize>),
}

/// Instructions of a run, with the arena ranges and picks they refer to.
#[derive(Clone, Debug, Default)]
pub(crate) struct Program {
    pub(crate) instructions: Vec<Instruction>,
    pub(crate) runs: Vec<Range<usize>>,
    pub(crate) picks: Vec<Pick>,
}

/// Data that a program reads beside the arena.
#[derive(Clone, Copy)]
pub(crate) struct Data<'a, W> {
    pub(crate) weights: &'a [W],
    /// f32 weights of layers not worth rounding; empty if all are f32.
    pub(crate) wide: &'a [f32],
    pub(crate) starts: &'a [i32],
    pub(crate) fixed: &'a [f32],
    /// Biases of the material.
    pub(crate) material: &'a [f32],
}

/// A vector of f32.
///
/// # Safety
/// Every function needs a CPU with the instruction set, and [`Simd::LANES`] elements at its pointers,
/// aligned like one element.
pub(crate) trait Simd {
    const LANES: usize;
    /// Most vectors of sums in registers, beside an input and a weight.
    const MOST: usize;
    type Vector: Copy;
    unsafe fn splat(x: f32) -> Self::Vector;
    unsafe fn load(from: *const f32) -> Self::Vector;
    unsafe fn load_f16(from: *const u16) -> Self::Vector;
    unsafe fn store(v: Self::Vector, to: *mut f32);
    unsafe fn add(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    unsafe fn mul(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// Clamps to `low..=high` and passes NaN on.
    unsafe fn clamp(x: Self::Vector, low: Self::Vector, high: Self::Vector) -> Self::Vector;
}

/// Runs a program. `None` if it does not fit its data, which packing rules out.
///
/// # Safety
/// The CPU has the instruction set of `S`.
#[inline(always)]
unsafe fn execute<S: Whole, W: Weight>(
    program: &Program,
    data: Data<'_, W>,
    codes: &mut Codes,
    arena: &mut [f32],
) -> Option<()> {
    for instruction in &program.instructions {
        match instruction {
            Instruction::Block(b) => {
                let runs = program.runs.get(b.runs.clone())?;
                let bias = match b.bias {
                    Bias::Fixed(at) => data.fixed.get(at..)?,
                    Bias::Material(at) => data.material.get(at..)?,
                };
                // SAFETY: passed on to the caller.
                unsafe {
                    if W::SCALED && b.wide {
                        any_block::<S, f32>(b, runs, bias, &[], data.wide.get(b.weights..)?, arena)?;
                    } else {
                        W::block::<S>(b, runs, bias, data, codes, arena)?;
                    }
                }
            }
            Instruction::Codes { runs, most } => {
                let runs = program.runs.get(runs.clone())?;
                if S::SPLIT {
                    codes.take::<true>(runs, *most, arena)?;
                } else {
                    codes.take::<false>(runs, *most, arena)?;
                }
            }
            Instruction::Pick { to, picks, low, high } => {
                for (i, p) in program.picks.get(picks.clone())?.iter().enumerate() {
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
unsafe fn any_block<S: Simd, W: Float>(
    b: &Block,
    runs: &[Range<usize>],
    bias: &[f32],
    unscale: &[f32],
    weights: &[W],
    arena: &mut [f32],
) -> Option<()> {
    // SAFETY: passed on to the caller.
    unsafe { by_vectors!(b.vectors, S::MOST, V => block::<S, W, V>(b, runs, bias, unscale, weights, arena)) }
}

/// # Safety
/// The CPU has the instruction set of `S`.
#[inline(always)]
unsafe fn block<S: Simd, W: Float, const V: usize>(
    b: &Block,
    runs: &[Range<usize>],
    bias: &[f32],
    unscale: &[f32],
    mut weights: &[W],
    arena: &mut [f32],
) -> Option<()> {
    let bias = bias.get(..V * S::LANES)?.as_ptr();
    // SAFETY: the instruction set is the caller's promise; bias has V * LANES floats.
    let mut sums = unsafe { [S::splat(0.0); V] };
    for (v, sum) in sums.iter_mut().enumerate() {
        // SAFETY: as above.
        *sum = unsafe { S::load(bias.add(v * S::LANES)) };
    }
    for run in runs {
        let inputs = arena.get(run.clone())?;
        let (rows, rest) = weights.split_at_checked(inputs.len() * (V * S::LANES))?;
        weights = rest;
        let mut row = rows.as_ptr();
        for &x in inputs {
            // SAFETY: the instruction set is the caller's promise; `rows` has a row of V * LANES weights
            // for each input.
            unsafe {
                let x = S::splat(x);
                for (v, sum) in sums.iter_mut().enumerate() {
                    *sum = S::add(*sum, S::mul(W::load::<S>(row.add(v * S::LANES)), x));
                }
                row = row.add(V * S::LANES);
            }
        }
    }
    let to = arena.get_mut(b.to..)?.get_mut(..V * S::LANES)?.as_mut_ptr();
    let unscale = if W::SCALED { unscale.get(..V * S::LANES)?.as_ptr() } else { unscale.as_ptr() };
    for (v, sum) in sums.into_iter().enumerate() {
        // SAFETY: the instruction set is the caller's promise; `to` has room for V * LANES floats and
        // `unscale` has them where it is read.
        unsafe {
            let y = if W::SCALED { S::mul(sum, S::load(unscale.add(v * S::LANES))) } else { sum };
            S::store(S::clamp(y, S::splat(b.low), S::splat(b.high)), to.add(v * S::LANES));
        }
    }
    Some(())
}

/// Reads all weights once, in order, as cheaply as possible: the lower bound of a run's time.
#[inline(always)]
fn checksum<W: Weight>(data: Data<'_, W>) -> u32 {
    sum(data.wide).wrapping_add(sum(data.weights))
}

#[inline(always)]
fn sum<W: Weight>(weights: &[W]) -> u32 {
    let mut sums = [W::Sum::default(); 512];
    let (chunks, rest) = weights.as_chunks::<512>();
    for chunk in chunks {
        for (sum, w) in sums.iter_mut().zip(chunk) {
            *sum = w.add_to(*sum);
        }
    }
    let rest = rest.iter().map(|w| w.add_to(W::Sum::default()));
    rest.chain(sums).fold(0, |all, sum| all.wrapping_add(sum.into()))
}

type Run<W> = unsafe fn(&Program, Data<'_, W>, &mut Codes, &mut [f32]) -> Option<()>;

/// The functions compiled for one instruction set.
#[derive(Clone, Copy)]
pub(crate) struct Entry<W> {
    run: Run<W>,
    read: unsafe fn(Data<'_, W>) -> u32,
}

/// The entry of an instruction set, compiled with CPU features.
macro_rules! entry {
    ($simd:ty, $weight:ident $(, $features:literal)?) => {{
        $(#[target_feature(enable = $features)])?
        unsafe fn run<W: Weight>(p: &Program, d: Data<'_, W>, c: &mut Codes, a: &mut [f32]) -> Option<()> {
            // SAFETY: passed on to the caller.
            unsafe { execute::<$simd, W>(p, d, c, a) }
        }
        $(#[target_feature(enable = $features)])?
        unsafe fn read<W: Weight>(data: Data<'_, W>) -> u32 {
            checksum(data)
        }
        Self { run: run::<$weight>, read: read::<$weight> }
    }};
}

impl<W: Weight> Entry<W> {
    /// `None` if this machine cannot run it.
    pub(crate) fn new(isa: Isa) -> Option<Self> {
        if !isa.is_available() || (W::WHOLE && !has_whole_numbers(isa)) {
            return None;
        }
        Some(match isa {
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 if W::WHOLE => entry!(avx512::Avx512, W, "avx512f,avx512bw,avx512vnni"),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 => entry!(avx512::Avx512, W, "avx512f"),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 => entry!(avx2::Avx2, W, "avx2,fma,f16c"),
            _ => entry!(portable::Portable, W),
        })
    }

    /// Runs a program over the arena. `None` if it does not fit its data, which packing rules out.
    #[inline]
    pub(crate) fn run(
        &self,
        program: &Program,
        data: Data<'_, W>,
        codes: &mut Codes,
        arena: &mut [f32],
    ) -> Option<()> {
        // SAFETY: `new` found the instruction set on this machine.
        unsafe { (self.run)(program, data, codes, arena) }
    }

    /// See [`checksum`].
    pub(crate) fn read(&self, data: Data<'_, W>) -> u32 {
        // SAFETY: `new` found the instruction set on this machine.
        unsafe { (self.read)(data) }
    }
}
