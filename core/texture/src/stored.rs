//! Stored weights, and the samples to round them.

use crate::check::{self, Probe};
use crate::kernel::Weight;
use crate::lower::{Lowered, Ref};
use crate::round::Rounder;
use crate::signature::Role;
use asperity_numbers::Elementary as _;

/// Samples of a layer's inputs: a quarter of a second's work. Four times as many change the error no
/// more than another seed.
const MOST_SAMPLES: usize = 256;
const MOST_MATERIALS: usize = 8;
/// Most numbers in all samples: 32 MiB.
const MOST_NUMBERS: usize = 1 << 22;
/// Most multiply-adds for the samples.
const MOST_WORK: usize = 1 << 28;
/// Layers with more inputs are rounded weight by weight: the work grows with the third power.
const MOST_INPUTS: usize = 1024;

/// A stored weight that can be made from an f64.
pub(crate) trait Stored: Weight + Default {
    /// Stores a scaled and rounded weight.
    fn store(x: f64) -> Self;
    /// Factor of a column, from its largest magnitude.
    fn scale(largest: f64) -> f64;
    /// Rounds the scaled weights of `inputs` to storable values, row by row, `n` a row.
    fn round(weights: &mut [f64], n: usize, samples: &Samples, inputs: &[Ref]);
}

impl Stored for f32 {
    fn store(x: f64) -> f32 {
        x as f32
    }
    fn scale(_: f64) -> f64 {
        1.0
    }
    fn round(_: &mut [f64], _: usize, _: &Samples, _: &[Ref]) {}
}

impl Stored for u16 {
    /// In plain code: `half` rounds twice where the CPU converts f32.
    fn store(x: f64) -> u16 {
        half::f16::from_f64_const(x).to_bits()
    }
    /// Brings the largest weight to 2^8..2^9. Normal f16 numbers then reach down to 2^-22 of it, and
    /// folded normalisation factors cost no precision. Sums stay far from f32's limits.
    fn scale(largest: f64) -> f64 {
        if largest > 0.0 { (8.0 - largest.log_2().floor()).clamp(-60.0, 60.0).exp_2() } else { 1.0 }
    }
    fn round(weights: &mut [f64], n: usize, samples: &Samples, inputs: &[Ref]) {
        together(weights, n, samples, inputs, |w| half::f16::from_f64_const(w).to_f64());
    }
}

impl Stored for i8 {
    fn store(x: f64) -> i8 {
        // Saturates, and NaN is 0.
        x as i8
    }
    /// Brings the largest weight to 127.
    fn scale(largest: f64) -> f64 {
        if largest > 0.0 { (127.0 / largest).clamp((-60f64).exp_2(), 60f64.exp_2()) } else { 1.0 }
    }
    fn round(weights: &mut [f64], n: usize, samples: &Samples, inputs: &[Ref]) {
        together(weights, n, samples, inputs, |w| w.round_ties_even().clamp(-127.0, 127.0));
    }
}

/// Results of the needed steps for ordinary motions and some materials. Without samples, weights are
/// rounded one by one.
#[derive(Default)]
pub(crate) struct Samples {
    /// Sample by sample, step by step.
    results: Vec<Vec<Vec<f64>>>,
}

impl Samples {
    /// As many motions over up to 8 materials as make `MOST_SAMPLES`; fewer for a large network.
    pub(crate) fn new(net: &Lowered, needed: &[bool], materials: &[Vec<f64>]) -> Self {
        let some: Vec<&Vec<f64>> =
            materials.iter().step_by(materials.len().div_ceil(MOST_MATERIALS).max(1)).collect();
        let numbers: usize = net.steps.iter().map(|step| step.len()).sum();
        let count =
            MOST_SAMPLES.min(MOST_NUMBERS / numbers.max(1)).min(MOST_WORK / net.multiply_adds().max(1));
        let motions = check::motions((count / some.len().max(1)).max(1));
        let mut results = Vec::new();
        for texture in some {
            for Probe { force, speed } in &motions {
                results.push(net.evaluate(needed, |role| match role {
                    Role::Texture => texture.clone(),
                    Role::Force => force.iter().map(|&x| f64::from(x)).collect(),
                    Role::Speed => speed.iter().map(|&x| f64::from(x)).collect(),
                }));
            }
        }
        Self { results }
    }

    /// Mean of one result.
    pub(crate) fn mean(&self, of: Ref) -> f64 {
        let sum: f64 = self.results.iter().map(|steps| steps[of.step][of.index]).sum();
        sum / self.results.len().max(1) as f64
    }

    /// Some results, sample by sample.
    fn of(&self, inputs: &[Ref]) -> Vec<f64> {
        self.results.iter().flat_map(|steps| inputs.iter().map(|r| steps[r.step][r.index])).collect()
    }
}

/// Rounds the weights of `inputs` by `nearest`: all together if the samples tell their correlation.
fn together(weights: &mut [f64], n: usize, samples: &Samples, inputs: &[Ref], nearest: impl Fn(f64) -> f64) {
    let few = inputs.len() <= MOST_INPUTS;
    match few.then(|| Rounder::new(&samples.of(inputs), inputs.len())).flatten() {
        Some(rounder) => rounder.round(weights, n, nearest),
        None => weights.iter_mut().for_each(|w| *w = nearest(*w)),
    }
}
