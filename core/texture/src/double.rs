//! A lowered network in double precision: the reference for rounding errors of weights and sums.
//!
//! Only inputs and outputs are f32. Sums have the order of [`Lowered::evaluate`].

use crate::lower::{Lowered, Ref, StepKind};
use crate::signature::Role;
use std::sync::Arc;

/// A network ready to run; results lie in an arena. Copies share everything that a run does not change.
#[derive(Clone)]
pub(crate) struct Double {
    pub(crate) net: Arc<Lowered>,
    /// Steps of a run, in order.
    moving: Vec<usize>,
    /// Place of each step's result.
    at: Vec<usize>,
    arena: Vec<f64>,
    /// Results of steps that depend on the material alone, by material. [`constant`](Self::constant)
    /// has their places.
    materials: Arc<[Vec<f64>]>,
    constant: Vec<std::ops::Range<usize>>,
    /// Material whose results are in the arena.
    material: Option<usize>,
    multiply_adds: usize,
}

impl Double {
    /// Makes room for all results and computes those of the materials.
    pub(crate) fn new(net: &Lowered, materials: &[Vec<f64>]) -> Self {
        let constant = net.depends_on_texture_alone();
        let needed = net.needed();
        let mut at = Vec::with_capacity(net.steps.len());
        let mut len = 0;
        for step in &net.steps {
            at.push(len);
            len += step.len();
        }
        let of = |wanted: bool| {
            let (constant, needed) = (&constant, &needed);
            (0..net.steps.len()).filter(move |&i| needed[i] && constant[i] == wanted)
        };
        let fixed: Vec<bool> = constant.iter().zip(&needed).map(|(c, n)| *c && *n).collect();
        let materials = materials.iter().map(|texture| {
            let input = |role| if role == Role::Texture { texture.clone() } else { Vec::new() };
            net.evaluate(&fixed, input).concat()
        });
        let affine = |&i: &usize| match &net.steps[i].kind {
            StepKind::Affine(a) => a.weights.len(),
            _ => 0,
        };
        Self {
            materials: materials.collect(),
            constant: of(true).map(|i| at[i]..at[i] + net.steps[i].len()).collect(),
            moving: of(false).collect(),
            multiply_adds: of(false).map(|i| affine(&i)).sum(),
            at,
            arena: vec![0.0; len],
            material: None,
            net: Arc::new(net.clone()),
        }
    }

    /// One run, into as many outputs as `out` has. `None` if a length or the material does not fit.
    /// Neither allocates nor locks.
    pub(crate) fn run(
        &mut self,
        material: usize,
        force: &[f32],
        speed: &[f32],
        out: &mut [&mut [f32]],
    ) -> Option<()> {
        if out.len() > self.net.outputs.len() {
            return None;
        }
        if self.material != Some(material) {
            let mut results = self.materials.get(material)?.as_slice();
            self.material = None;
            for place in &self.constant {
                let (these, rest) = results.split_at_checked(place.len())?;
                self.arena.get_mut(place.clone())?.copy_from_slice(these);
                results = rest;
            }
            self.material = Some(material);
        }
        for &i in &self.moving {
            let (step, start) = (self.net.steps.get(i)?, *self.at.get(i)?);
            // Steps read only earlier results.
            let (before, rest) = self.arena.split_at_mut_checked(start)?;
            let result = rest.get_mut(..step.len())?;
            let read = |r: Ref| before.get(self.at.get(r.step)? + r.index).copied();
            match &step.kind {
                StepKind::Input(Role::Force) => widen(result, force)?,
                StepKind::Input(Role::Speed) => widen(result, speed)?,
                _ => {}
            }
            step.compute(read, result)?;
        }
        for (out, &step) in out.iter_mut().zip(&self.net.outputs) {
            let start = *self.at.get(step)?;
            let result = self.arena.get(start..start + out.len())?;
            out.iter_mut().zip(result).for_each(|(y, x)| *y = *x as f32);
        }
        Some(())
    }

    /// Bytes of the weights, which are f64.
    pub(crate) fn weights_bytes(&self) -> usize {
        self.multiply_adds * size_of::<f64>()
    }

    pub(crate) fn multiply_adds(&self) -> usize {
        self.multiply_adds
    }
}

fn widen(to: &mut [f64], from: &[f32]) -> Option<()> {
    (to.len() == from.len()).then(|| to.iter_mut().zip(from).for_each(|(y, x)| *y = f64::from(*x)))
}
