//! The model run by tract: any graph of the signature, about 200 allocations a run.

use crate::onnx::{GraphProto, ModelProto};
use crate::plan::Plan;
use crate::proto::MAX_MODEL_BYTES;
use crate::signature::{FORCE_LEN, Role, SPEED_LEN, Signature, TEXTURE_LEN, WANTED};
use asperity_diagnostics::Diagnostic;
use std::path::Path;

/// A compiled plan. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Reference {
    plan: Plan,
    order: [Role; 3],
}

impl Reference {
    /// Compiles the graph for one row of each input.
    pub(crate) fn new(
        model: &ModelProto,
        graph: &GraphProto,
        signature: &Signature,
        path: &Path,
    ) -> Result<Self, Diagnostic> {
        let refuse = |what: String| Diagnostic::new(what).in_file(path).help(WANTED);
        let mut graph = graph.clone();
        let of = |name: &String| graph.output.iter().find(|v| v.name == *name).cloned();
        graph.output = signature.outputs.iter().filter_map(|(name, _)| of(name)).collect();
        let inputs: Vec<Vec<usize>> = signature.inputs.iter().map(|(_, role)| vec![1, role.len()]).collect();
        let model = ModelProto { graph: Some(graph), ..model.clone() };
        let plan = Plan::compile(&model, path, &inputs, MAX_MODEL_BYTES, WANTED)?;
        for (i, (name, len)) in signature.outputs.iter().enumerate() {
            plan.answers(i, &[1, *len]).map_err(|found| {
                refuse(format!("output {name} has shape and type {found}, not [1,{len}] float"))
            })?;
        }
        let roles: Vec<Role> = signature.inputs.iter().map(|(_, role)| *role).collect();
        let order = roles.try_into().map_err(|_| refuse("this model has not 3 inputs".into()))?;
        let reference = Self { plan, order };
        // A graph may compile and still fail on every run.
        let mut out: Vec<Vec<f32>> = signature.outputs.iter().map(|(_, len)| vec![0.0; *len]).collect();
        let mut out: Vec<&mut [f32]> = out.iter_mut().map(Vec::as_mut_slice).collect();
        match reference.run(&[0.0; TEXTURE_LEN], &[0.0; FORCE_LEN], &[0.0; SPEED_LEN], &mut out) {
            Some(()) => Ok(reference),
            None => Err(refuse("tract fails to run this model on zeros".into())),
        }
    }

    /// One run, into as many of the outputs as there are in `out`; `None` where tract fails. Allocates.
    pub(crate) fn run(
        &self,
        texture: &[f32],
        force: &[f32],
        speed: &[f32],
        out: &mut [&mut [f32]],
    ) -> Option<()> {
        let row = |values: &[f32]| [1, values.len()];
        let shapes = [row(force), row(speed), row(texture)];
        let input = |role: &Role| match role {
            Role::Force => (shapes[0].as_slice(), force),
            Role::Speed => (shapes[1].as_slice(), speed),
            Role::Texture => (shapes[2].as_slice(), texture),
        };
        let results = self.plan.run(&self.order.each_ref().map(input))?;
        for (i, out) in out.iter_mut().enumerate() {
            let result = results.get(i)?;
            (result.len() == out.len()).then(|| out.copy_from_slice(result))?;
        }
        Some(())
    }
}
