//! A lowered network packed for one instruction set. Weights lie in reading order, in blocks of columns,
//! 64-byte aligned. Everything that depends on the texture alone is folded into biases, once per material.

use crate::kernel::{Bias, Block, Codes, Data, Entry, Instruction, Pick, Program, Shape, largest_code};
use crate::lower::{Affine, Element, End, Lowered, Ref, StepKind};
use crate::signature::{FORCE_LEN, Role, SPEED_LEN};
use crate::stored::{Samples, Stored};
use asperity_dsp::Isa;
use std::sync::Arc;

/// Cells with a 64-byte boundary in front. The heap block does not move with its owner.
struct Aligned<T> {
    cells: Vec<T>,
    start: usize,
    len: usize,
}

impl<T: Copy + Default> Clone for Aligned<T> {
    /// Aligned anew.
    fn clone(&self) -> Self {
        Self::new(&self.cells[self.start..self.start + self.len])
    }
}

impl<T: Copy + Default> Aligned<T> {
    fn new(data: &[T]) -> Self {
        let pad = 64 / size_of::<T>();
        let mut cells = vec![T::default(); data.len() + pad];
        let start = cells.as_ptr().align_offset(64).min(pad);
        cells[start..start + data.len()].copy_from_slice(data);
        Self { cells, start, len: data.len() }
    }

    #[inline]
    fn get(&self) -> &[T] {
        &self.cells[self.start..self.start + self.len]
    }
}

/// Layers with fewer weights stay f32 in f16 networks. With few inputs rounding does not average out,
/// all later layers build on the first, and nothing follows the last. Largest error of full scale on
/// the shipped model: all layers halved, 5.0e-3; those under 4096 weights kept, 9.2e-4; under 16384 (4
/// % more bytes), 7.3e-4; under 24000 (13 %), 4.6e-4.
const WORTH_HALVING: usize = 16384;

/// A network ready to run. Copies share everything that a run does not change.
#[derive(Clone)]
pub(crate) struct Packed<W> {
    pub(crate) made: Arc<Made<W>>,
    arena: Aligned<f32>,
    codes: Codes,
}

/// A packed network.
pub(crate) struct Made<W> {
    program: Program,
    entry: Entry<W>,
    weights: Aligned<W>,
    wide: Aligned<f32>,
    starts: Aligned<i32>,
    fixed: Aligned<f32>,
    /// Biases of all materials, `material_len` each.
    materials: Aligned<f32>,
    material_len: usize,
    material_count: usize,
    force_at: usize,
    speed_at: usize,
    /// Places of the outputs, in the signature's order.
    outputs: Vec<std::ops::Range<usize>>,
    multiply_adds: usize,
}

impl<W: Stored> Packed<W> {
    /// Packs for an instruction set, or says why not.
    pub(crate) fn new(net: &Lowered, materials: &[Vec<f64>], isa: Isa) -> Result<Self, String> {
        let entry = Entry::new(isa).ok_or_else(|| {
            let what = if W::WHOLE { " for whole numbers" } else { "" };
            format!("this machine has no {}{what}", isa.name())
        })?;
        let constant = net.depends_on_texture_alone();
        let needed = net.needed();
        if net.outputs.iter().any(|&output| constant[output]) {
            return Err("an output does not depend on force or speed".into());
        }
        let wanted: Vec<bool> = constant.iter().zip(&needed).map(|(c, n)| *c && *n).collect();
        let of_material: Vec<Vec<Vec<f64>>> = materials
            .iter()
            .map(|texture| {
                // Wanted steps read only the texture.
                net.evaluate(&wanted, |role| if role == Role::Texture { texture.clone() } else { Vec::new() })
            })
            .collect();

        let shape = Shape::new(isa);
        let mut at = vec![0; net.steps.len()];
        let mut arena_len = 0;
        for (i, step) in net.steps.iter().enumerate() {
            // Inputs are written even if nobody reads them.
            let input = matches!(step.kind, StepKind::Input(Role::Force | Role::Speed));
            if input || (needed[i] && !constant[i]) {
                at[i] = arena_len;
                arena_len += step.len().next_multiple_of(shape.lanes.max(16));
            }
        }
        let find = |role| {
            let at_role = |s: &crate::lower::Step| matches!(s.kind, StepKind::Input(r) if r == role);
            net.steps.iter().position(at_role).map(|i| at[i]).ok_or("an input is missing")
        };
        let (force_at, speed_at) = (find(Role::Force)?, find(Role::Speed)?);

        let mut p = Packer {
            shape,
            at,
            constant,
            of_material,
            samples: if W::SCALED { Samples::new(net, &needed, materials) } else { Samples::default() },
            program: Program::default(),
            weights: Vec::new(),
            wide: Vec::new(),
            starts: Vec::new(),
            most_inputs: 0,
            fixed: Vec::new(),
            materials: vec![Vec::new(); materials.len()],
            multiply_adds: 0,
        };
        for (i, step) in net.steps.iter().enumerate() {
            if !needed[i] || p.constant[i] {
                continue;
            }
            let clamp = match step.end {
                End::Clamp(low, high) => (low as f32, high as f32),
                End::Exponential => (f32::NEG_INFINITY, f32::INFINITY),
            };
            match &step.kind {
                StepKind::Input(_) => {}
                StepKind::Affine(a) => p.affine(i, a, clamp),
                StepKind::Elements(e) => p.elements(i, e, clamp),
            }
            if let End::Exponential = step.end {
                let of = p.at[i]..p.at[i] + step.len();
                p.program.instructions.push(Instruction::Exponential(of));
            }
        }
        let made = Made {
            program: p.program,
            entry,
            weights: Aligned::new(&p.weights),
            wide: Aligned::new(&p.wide),
            starts: Aligned::new(&p.starts),
            fixed: Aligned::new(&p.fixed),
            materials: Aligned::new(&p.materials.concat()),
            material_len: p.materials.first().map_or(0, Vec::len),
            material_count: materials.len(),
            force_at,
            speed_at,
            outputs: net.outputs.iter().map(|&i| p.at[i]..p.at[i] + net.steps[i].len()).collect(),
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
        if out.len() > made.outputs.len() || material >= made.material_count {
            return None;
        }
        let biases = made.materials.get().get(material * made.material_len..)?.get(..made.material_len)?;
        let arena = &mut self.arena.cells[self.arena.start..];
        copy(arena.get_mut(made.force_at..made.force_at + FORCE_LEN)?, force)?;
        copy(arena.get_mut(made.speed_at..made.speed_at + SPEED_LEN)?, speed)?;
        let data = Data {
            weights: made.weights.get(),
            wide: made.wide.get(),
            starts: made.starts.get(),
            fixed: made.fixed.get(),
            material: biases,
        };
        made.entry.run(&made.program, data, &mut self.codes, arena)?;
        out.iter_mut().zip(&made.outputs).try_for_each(|(out, at)| copy(out, arena.get(at.clone())?))
    }

    pub(crate) fn read(&self) -> u32 {
        let made = &*self.made;
        made.entry.read(Data {
            weights: made.weights.get(),
            wide: made.wide.get(),
            starts: &[],
            fixed: &[],
            material: &[],
        })
    }

    pub(crate) fn weights_bytes(&self) -> usize {
        self.made.weights.len * size_of::<W>() + self.made.wide.len * size_of::<f32>()
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

/// Stored weights of an affine step: column by column multiplied by `scales` and rounded.
struct Layer {
    /// Row by row; a row belongs to one input.
    weights: Vec<f64>,
    scales: Vec<f64>,
    /// Mean loss of each column's sum by rounding, scaled.
    lost: Vec<f64>,
}

/// A half-packed network.
struct Packer<W> {
    shape: Shape,
    /// Place of each step's result in the arena.
    at: Vec<usize>,
    constant: Vec<bool>,
    /// Results of constant steps, by material.
    of_material: Vec<Vec<Vec<f64>>>,
    /// Results of the steps where weights are rounded.
    samples: Samples,
    program: Program,
    weights: Vec<W>,
    wide: Vec<f32>,
    starts: Vec<i32>,
    /// Largest number of inputs of a whole-number layer.
    most_inputs: usize,
    fixed: Vec<f32>,
    materials: Vec<Vec<f32>>,
    multiply_adds: usize,
}

impl<W: Stored> Packer<W> {
    fn affine(&mut self, step: usize, a: &Affine, (low, high): (f32, f32)) {
        let n = a.bias.len();
        let (constant, moving): (Vec<usize>, Vec<usize>) =
            (0..a.inputs.len()).partition(|&k| self.constant[a.inputs[k].step]);
        let folded: Vec<Vec<f64>> = if constant.is_empty() {
            vec![a.bias.clone()]
        } else {
            self.of_material.iter().map(|results| fold(a, &constant, results)).collect()
        };
        self.multiply_adds += n * moving.len();
        let wide = W::SCALED && n * moving.len() < WORTH_HALVING;
        let layer = self.layer(a, &moving, W::SCALED && !wide);
        let runs = self.runs(moving.iter().map(|&k| a.inputs[k]));
        let whole = W::WHOLE && !wide;
        if whole {
            self.most_inputs = self.most_inputs.max(moving.len());
            let codes = Instruction::Codes { runs: runs.clone(), most: largest_code(moving.len()) };
            self.program.instructions.push(codes);
        }

        let Shape { lanes, most, together, split } = self.shape;
        let vectors = n.div_ceil(lanes);
        let blocks = vectors.div_ceil(most);
        let mut first = 0;
        for i in 0..blocks {
            // As even as possible, so that no block has a single sum that waits for itself.
            let vectors = vectors / blocks + usize::from(i < vectors % blocks);
            let columns = first..(first + vectors * lanes);
            let real = columns.start.min(n)..columns.end.min(n);
            let padded = |row: &[f64]| -> Vec<f64> {
                let pad = std::iter::repeat_n(0.0, columns.len() - real.len());
                row[real.clone()].iter().copied().chain(pad).collect()
            };
            let biases = |bias: &[f64]| -> Vec<f32> {
                let scaled = bias.iter().zip(&layer.scales).zip(&layer.lost);
                // Sums of whole numbers are rescaled before the bias is added, others after.
                let scaled = scaled.map(
                    |((bias, scale), lost)| {
                        if whole { bias + lost / scale } else { bias * scale + lost }
                    },
                );
                padded(&scaled.collect::<Vec<f64>>()).iter().map(|x| *x as f32).collect()
            };
            let bias = if constant.is_empty() {
                self.fixed.extend(biases(&a.bias));
                Bias::Fixed(self.fixed.len() - columns.len())
            } else {
                for (to, bias) in self.materials.iter_mut().zip(&folded) {
                    to.extend(biases(bias));
                }
                Bias::Material(self.materials.first().map_or(0, |m| m.len() - columns.len()))
            };
            let unscale = self.fixed.len();
            if W::SCALED && !wide {
                self.fixed.extend(padded(&layer.scales).iter().map(|scale| (1.0 / scale) as f32));
            }
            let starts = self.starts.len();
            let weights = if wide { self.wide.len() } else { self.weights.len() };
            let rows: Vec<Vec<f64>> = layer.weights.chunks_exact(n).map(padded).collect();
            if wide {
                self.wide.extend(rows.concat().iter().map(|w| *w as f32));
            } else if whole {
                for group in rows.chunks(together) {
                    for column in 0..columns.len() {
                        let weight =
                            |row: usize| group.get(row).map_or(W::default(), |row| W::store(row[column]));
                        self.weights.extend((0..together).map(weight));
                    }
                }
                self.starts.extend((0..columns.len()).map(|column| {
                    let sum: f64 = rows.iter().map(|row| row[column]).sum();
                    if split { (-32768.0 * sum) as i64 as i32 } else { 0 }
                }));
            } else {
                self.weights.extend(rows.concat().iter().map(|w| W::store(*w)));
            }
            self.program.instructions.push(Instruction::Block(Block {
                to: self.at[step] + columns.start,
                vectors,
                runs: runs.clone(),
                inputs: moving.len(),
                bias,
                weights,
                wide,
                unscale,
                starts,
                low,
                high,
            }));
            first = columns.end;
        }
    }

    /// Stored weights of the inputs that vary.
    fn layer(&self, a: &Affine, moving: &[usize], scaled: bool) -> Layer {
        let n = a.bias.len();
        let mut weights: Vec<f64> = moving.iter().flat_map(|&k| &a.weights[k * n..][..n]).copied().collect();
        let (mut scales, mut lost) = (vec![1.0; n], vec![0.0; n]);
        if !scaled {
            return Layer { weights, scales, lost };
        }
        let mut largest = vec![0f64; n];
        for row in weights.chunks_exact(n) {
            largest.iter_mut().zip(row).for_each(|(most, w)| *most = most.max(w.abs()));
        }
        scales.iter_mut().zip(largest).for_each(|(scale, most)| *scale = W::scale(most));
        for row in weights.chunks_exact_mut(n) {
            row.iter_mut().zip(&scales).for_each(|(w, scale)| *w *= scale);
        }
        let exact = weights.clone();
        let inputs: Vec<Ref> = moving.iter().map(|&k| a.inputs[k]).collect();
        W::round(&mut weights, n, &self.samples, &inputs);
        let rows = exact.chunks_exact(n).zip(weights.chunks_exact(n));
        for ((exact, rounded), of) in rows.zip(&inputs) {
            let x = self.samples.mean(*of);
            let columns = lost.iter_mut().zip(exact.iter().zip(rounded));
            columns.for_each(|(lost, (exact, rounded))| *lost += (exact - rounded) * x);
        }
        Layer { weights, scales, lost }
    }

    fn elements(&mut self, step: usize, elements: &[Element], (low, high): (f32, f32)) {
        if elements.iter().any(|e| e.of.is_some_and(|of| self.constant[of.step])) {
            // Offsets differ between materials: biases can do that.
            return self.affine(step, &crate::lower::diagonal(elements), (low, high));
        }
        let first = self.program.picks.len();
        for e in elements {
            let from = e.of.map_or(0, |of| self.at[of.step] + of.index);
            let scale = if e.of.is_some() { e.scale as f32 } else { 0.0 };
            self.program.picks.push(Pick { from, scale, offset: e.offset as f32 });
        }
        let picks = first..self.program.picks.len();
        self.program.instructions.push(Instruction::Pick { to: self.at[step], picks, low, high });
    }

    /// Joins neighbouring elements into ranges of the arena.
    fn runs(&mut self, refs: impl Iterator<Item = Ref>) -> std::ops::Range<usize> {
        let first = self.program.runs.len();
        for r in refs {
            let at = self.at[r.step] + r.index;
            match self.program.runs[first..].last_mut() {
                Some(run) if run.end == at => run.end += 1,
                _ => self.program.runs.push(at..at + 1),
            }
        }
        first..self.program.runs.len()
    }
}

/// Bias of an affine step with its constant inputs added.
fn fold(a: &Affine, constant: &[usize], results: &[Vec<f64>]) -> Vec<f64> {
    let n = a.bias.len();
    let mut bias = a.bias.clone();
    for &k in constant {
        let Ref { step, index } = a.inputs[k];
        let x = results[step][index];
        bias.iter_mut().zip(&a.weights[k * n..]).for_each(|(b, w)| *b += w * x);
    }
    bias
}
