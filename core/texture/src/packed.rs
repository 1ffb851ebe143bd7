//! A lowered network packed for one instruction set. Weights lie in reading order, in blocks of columns,
//! 64-byte aligned. Everything that depends on the texture alone is folded into biases, once per material.

use crate::kernel::{Aligned, Block, Codes, Entry, Instruction, Layer, Pick};
use crate::lower::{Affine, End, Lowered, Step, StepKind, Sum};
use crate::round::Samples;
use crate::runner::Precision;
use crate::signature::{FORCE_LEN, Role, SPEED_LEN};
use asperity_dsp::Isa;
use asperity_numbers::Elementary as _;
use std::ops::Range;
use std::sync::Arc;

/// Layers with fewer weights stay f32. With few inputs rounding does not average out, and with folded
/// normalisation their weights differ by powers of ten. Error of full scale of the shipped model with f16,
/// layers under 4096 weights kept, 9.2e-4; under 16384 (4 % more bytes), 7.3e-4; under 24000 (13 %), 4.6e-4.
const WORTH_HALVING: usize = 16384;

/// Places of force and speed in the arena. Each result starts at a multiple of the largest number of lanes.
const FORCE: Range<usize> = 0..FORCE_LEN;
const SPEED: Range<usize> = ALIGNED..ALIGNED + SPEED_LEN;
const ALIGNED: usize = 16;

/// A network ready to run. Copies share everything that a run does not change.
#[derive(Clone)]
pub(crate) struct Packed {
    pub(crate) made: Arc<Made>,
    arena: Aligned<f32>,
    codes: Codes,
}

/// A packed network.
pub(crate) struct Made {
    program: Vec<Instruction>,
    entry: Entry,
    materials: usize,
    /// Places of the outputs, in the signature's order.
    outputs: Vec<Range<usize>>,
    multiply_adds: usize,
}

impl Packed {
    /// Packs for an instruction set, or says why not.
    pub(crate) fn new(
        net: &Lowered,
        materials: &[Vec<f32>],
        isa: Isa,
        precision: Precision,
    ) -> Result<Self, String> {
        let entry = Entry::new(isa, precision).ok_or_else(|| {
            let what = if precision == Precision::Int8 { " for whole numbers" } else { "" };
            format!("this machine has no {}{what}", isa.name())
        })?;
        if net.outputs.iter().any(|output| net.constant[output.start]) {
            return Err("an output does not depend on force or speed".into());
        }
        let last_constant = net.constant.iter().rposition(|constant| *constant).unwrap_or(0);
        let of_material = |texture: &Vec<f32>| {
            let mut elements = vec![0.0; net.constant.len()];
            let inputs = elements[Role::Texture.place()].iter_mut().zip(texture);
            inputs.for_each(|(to, x)| *to = f64::from(*x));
            for step in net.steps.iter().filter(|step| net.constant[step.first]) {
                step.compute(&mut elements);
            }
            elements.truncate(last_constant + 1);
            elements
        };
        let mut p = Packer {
            net,
            entry,
            precision,
            place: FORCE.chain(SPEED).collect(),
            of_material: materials.iter().map(of_material).collect(),
            samples: match precision {
                Precision::F16 | Precision::Int8 => Samples::new(net, materials),
                Precision::F32 | Precision::F64 => Samples::default(),
            },
            program: Vec::new(),
            most_inputs: 0,
            multiply_adds: 0,
        };
        p.place.resize(net.constant.len(), usize::MAX);
        let mut arena_len = SPEED.end.next_multiple_of(ALIGNED);
        for step in net.steps.iter().filter(|step| !net.constant[step.first]) {
            let end = arena_len + step.len();
            (arena_len..end).zip(&mut p.place[step.first..]).for_each(|(at, place)| *place = at);
            p.step(step, arena_len);
            arena_len = end.next_multiple_of(ALIGNED);
        }
        let output = |output: &Range<usize>| p.place[output.start]..p.place[output.start] + output.len();
        let made = Made {
            outputs: net.outputs.iter().map(output).collect(),
            program: p.program,
            entry,
            materials: materials.len(),
            multiply_adds: p.multiply_adds,
        };
        let (arena, codes) = (Aligned::new(&vec![0.0; arena_len]), Codes::new(p.most_inputs));
        Ok(Self { made: Arc::new(made), arena, codes })
    }

    /// One run, into as many outputs as `out` has. `None` if a length or the material does not fit.
    #[inline]
    pub(crate) fn run(
        &mut self,
        material: usize,
        force: &[f32],
        speed: &[f32],
        out: &mut [&mut [f32]],
    ) -> Option<()> {
        let made = &*self.made;
        if out.len() > made.outputs.len() || material >= made.materials {
            return None;
        }
        let arena = self.arena.get_mut();
        copy(arena.get_mut(FORCE)?, force)?;
        copy(arena.get_mut(SPEED)?, speed)?;
        made.entry.run(&made.program, material, &mut self.codes, arena)?;
        out.iter_mut().zip(&made.outputs).try_for_each(|(out, at)| copy(out, arena.get(at.clone())?))
    }

    /// The weights, layer by layer, as they are stored.
    pub(crate) fn weights(&self) -> impl Iterator<Item = &[u8]> {
        self.made.program.iter().filter_map(|instruction| match instruction {
            Instruction::Affine(layer) => Some(layer.weights.get()),
            _ => None,
        })
    }

    pub(crate) fn multiply_adds(&self) -> usize {
        self.made.multiply_adds
    }
}

/// `copy_from_slice` that cannot panic.
#[inline]
fn copy(to: &mut [f32], from: &[f32]) -> Option<()> {
    (to.len() == from.len()).then(|| to.copy_from_slice(from))
}

/// Factor of a column from its largest weight.
///
/// f16: brings it to 2^8..2^9. Normal f16 numbers then reach down to 2^-22 of it, and folded normalisation
/// factors cost no precision. Sums stay far from f32's limits. int8: brings it to 127.
fn scale(precision: Precision, largest: f64) -> f64 {
    match precision {
        Precision::F16 if largest > 0.0 => (8.0 - largest.log_2().floor()).clamp(-60.0, 60.0).exp_2(),
        Precision::Int8 if largest > 0.0 => (127.0 / largest).clamp((-60f64).exp_2(), 60f64.exp_2()),
        _ => 1.0,
    }
}

/// A half-packed network.
struct Packer<'a> {
    net: &'a Lowered,
    entry: Entry,
    precision: Precision,
    /// Place of each element in the arena.
    place: Vec<usize>,
    /// Constant elements, by material.
    of_material: Vec<Vec<f64>>,
    samples: Samples,
    program: Vec<Instruction>,
    /// Largest number of inputs of a whole-number layer.
    most_inputs: usize,
    multiply_adds: usize,
}

impl Packer<'_> {
    fn step(&mut self, step: &Step, to: usize) {
        let (low, high) = match step.end {
            End::Clamp(low, high) => (low as f32, high as f32),
            End::Exponential => (f32::NEG_INFINITY, f32::INFINITY),
        };
        let constant = |sum: &Sum| sum.terms.iter().any(|(element, _)| self.net.constant[*element]);
        let instruction = match &step.kind {
            StepKind::Affine(a) => Instruction::Affine(self.affine(a, to, low, high)),
            // Offsets differ between materials: biases can do that.
            StepKind::Elements(sums) if sums.iter().any(constant) => {
                Instruction::Affine(self.affine(&Affine::new(sums), to, low, high))
            }
            StepKind::Elements(sums) => {
                let pick = |sum: &Sum| {
                    let (from, scale) = sum.terms.first().map_or((0, 0.0), |(e, w)| (self.place[*e], *w));
                    Pick { from, scale: scale as f32, offset: sum.offset as f32 }
                };
                Instruction::Pick { to, picks: sums.iter().map(pick).collect(), low, high }
            }
        };
        self.program.push(instruction);
        if let End::Exponential = step.end {
            self.program.push(Instruction::Exponential(to..to + step.len()));
        }
    }

    fn affine(&mut self, a: &Affine, to: usize, low: f32, high: f32) -> Layer {
        let n = a.bias.len();
        let (constant, moving): (Vec<usize>, Vec<usize>) =
            (0..a.inputs.len()).partition(|&k| self.net.constant[a.inputs[k]]);
        self.multiply_adds += n * moving.len();
        let small = n * moving.len() < WORTH_HALVING;
        let precision = if small { Precision::F32 } else { self.precision };
        if precision == Precision::Int8 {
            self.most_inputs = self.most_inputs.max(moving.len());
        }
        let inputs: Vec<usize> = moving.iter().map(|&k| a.inputs[k]).collect();
        let mut weights: Vec<f64> = moving.iter().flat_map(|&k| &a.weights[k * n..][..n]).copied().collect();
        let (scales, lost) = self.round(precision, &mut weights, n, &inputs);

        let Entry { lanes, split, .. } = self.entry;
        let vectors = n.div_ceil(lanes);
        let padded = |row: &[f64]| {
            let mut row = row.to_vec();
            row.resize(vectors * lanes, 0.0);
            row
        };
        let rows: Vec<Vec<f64>> = weights.chunks_exact(n).map(padded).collect();
        let bias = |of_material: &[f64]| -> Vec<f32> {
            let mut bias = a.bias.clone();
            for &k in &constant {
                let x = of_material[a.inputs[k]];
                bias.iter_mut().zip(&a.weights[k * n..]).for_each(|(b, w)| *b += w * x);
            }
            for ((bias, scale), lost) in bias.iter_mut().zip(&scales).zip(&lost) {
                // Sums of whole numbers are rescaled before the bias is added, others after.
                let whole = precision == Precision::Int8;
                *bias = if whole { *bias + lost / scale } else { *bias * scale + lost };
            }
            padded(&bias).iter().map(|x| *x as f32).collect()
        };
        let different = if constant.is_empty() { 1 } else { self.of_material.len() };
        let start = |column: usize| -> i32 {
            let sum: f64 = rows.iter().map(|row| row[column]).sum();
            if split { (-32768.0 * sum) as i64 as i32 } else { 0 }
        };
        let (blocks, weights) = stored(precision, &rows, vectors, self.entry);
        Layer {
            to,
            runs: self.runs(&inputs),
            inputs: inputs.len(),
            precision,
            blocks,
            weights: Aligned::new(&weights),
            biases: self.of_material[..different].iter().map(|of| bias(of)).collect(),
            unscale: padded(&scales).iter().map(|scale| (1.0 / scale) as f32).collect(),
            starts: (0..vectors * lanes).map(start).collect(),
            low,
            high,
        }
    }

    /// Scales and rounds the weights of these inputs, row by row, `n` a row. Returns the scales of the
    /// columns, and the mean loss of each column's sum by rounding, scaled.
    fn round(&self, to: Precision, weights: &mut [f64], n: usize, inputs: &[usize]) -> (Vec<f64>, Vec<f64>) {
        let (mut scales, mut lost) = (vec![1.0; n], vec![0.0; n]);
        let nearest: fn(f64) -> f64 = match to {
            Precision::F32 | Precision::F64 => return (scales, lost),
            // In plain code: `half` rounds twice where the CPU converts f32.
            Precision::F16 => |w| half::f16::from_f64_const(w).to_f64(),
            Precision::Int8 => |w| w.round_ties_even().clamp(-127.0, 127.0),
        };
        let mut largest = vec![0f64; n];
        for row in weights.chunks_exact(n) {
            largest.iter_mut().zip(row).for_each(|(most, w)| *most = most.max(w.abs()));
        }
        scales.iter_mut().zip(largest).for_each(|(s, most)| *s = scale(to, most));
        for row in weights.chunks_exact_mut(n) {
            row.iter_mut().zip(&scales).for_each(|(w, scale)| *w *= scale);
        }
        let exact = weights.to_vec();
        self.samples.round(weights, n, inputs, nearest);
        let rows = exact.chunks_exact(n).zip(weights.chunks_exact(n));
        for ((exact, rounded), of) in rows.zip(inputs) {
            let x = self.samples.mean(*of);
            let columns = lost.iter_mut().zip(exact.iter().zip(rounded));
            columns.for_each(|(lost, (exact, rounded))| *lost += (exact - rounded) * x);
        }
        (scales, lost)
    }

    /// Joins neighbouring elements into ranges of the arena.
    fn runs(&self, elements: &[usize]) -> Vec<Range<usize>> {
        let mut runs: Vec<Range<usize>> = Vec::new();
        for at in elements.iter().map(|element| self.place[*element]) {
            match runs.last_mut() {
                Some(run) if run.end == at => run.end += 1,
                _ => runs.push(at..at + 1),
            }
        }
        runs
    }
}

/// Cuts columns of rounded weights into blocks, and stores these one after the other.
fn stored(
    precision: Precision,
    rows: &[Vec<f64>],
    vectors: usize,
    Entry { lanes, most, together, .. }: Entry,
) -> (Vec<Block>, Vec<u8>) {
    let count = vectors.div_ceil(most);
    let (mut blocks, mut bytes, mut column) = (Vec::new(), Vec::new(), 0);
    for i in 0..count {
        // As even as possible, so that no block has a single sum that waits for itself.
        let vectors = vectors / count + usize::from(i < vectors % count);
        blocks.push(Block { vectors, column, weights: bytes.len() });
        let columns = column..column + vectors * lanes;
        column = columns.end;
        let weights = rows.iter().flat_map(|row| &row[columns.clone()]);
        match precision {
            Precision::Int8 => {
                for (group, column) in
                    rows.chunks(together).flat_map(|group| columns.clone().map(move |column| (group, column)))
                {
                    let weight = |row: usize| group.get(row).map_or(0, |row| row[column] as i8);
                    bytes.extend((0..together).map(|row| weight(row).cast_unsigned()));
                }
            }
            Precision::F16 => {
                bytes.extend(weights.flat_map(|w| half::f16::from_f64_const(*w).to_bits().to_ne_bytes()));
            }
            Precision::F32 | Precision::F64 => bytes.extend(weights.flat_map(|w| (*w as f32).to_ne_bytes())),
        }
    }
    (blocks, bytes)
}
