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
    /// Needed steps, in order.
    needed: Vec<usize>,
    /// Place of each step's result.
    at: Vec<usize>,
    arena: Vec<f64>,
    materials: Arc<[Vec<f64>]>,
}

impl Double {
    /// Makes room for all results.
    pub(crate) fn new(net: &Lowered, materials: &[Vec<f64>]) -> Self {
        let needed = net.needed();
        let mut len = 0;
        let place = |step: &crate::lower::Step| {
            len += step.len();
            len - step.len()
        };
        let at = net.steps.iter().map(place).collect();
        Self {
            needed: (0..net.steps.len()).filter(|&i| needed[i]).collect(),
            at,
            arena: vec![0.0; len],
            materials: materials.into(),
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
        let texture = self.materials.get(material)?;
        for &i in &self.needed {
            let (step, start) = (self.net.steps.get(i)?, *self.at.get(i)?);
            // Steps read only earlier results.
            let (before, rest) = self.arena.split_at_mut_checked(start)?;
            let result = rest.get_mut(..step.len())?;
            let read = |r: Ref| before.get(self.at.get(r.step)? + r.index).copied();
            match &step.kind {
                StepKind::Input(Role::Force) => widen(result, force)?,
                StepKind::Input(Role::Speed) => widen(result, speed)?,
                StepKind::Input(Role::Texture) => result.copy_from_slice(texture.get(..result.len())?),
                _ => {}
            }
            step.compute(read, result)?;
        }
        for (i, out) in out.iter_mut().enumerate() {
            let start = *self.at.get(*self.net.outputs.get(i)?)?;
            let result = self.arena.get(start..start + out.len())?;
            out.iter_mut().zip(result).for_each(|(y, x)| *y = *x as f32);
        }
        Some(())
    }

    pub(crate) fn multiply_adds(&self) -> usize {
        self.net.multiply_adds()
    }
}

fn widen(to: &mut [f64], from: &[f32]) -> Option<()> {
    (to.len() == from.len()).then(|| to.iter_mut().zip(from).for_each(|(y, x)| *y = f64::from(*x)))
}
