//! The model run by tract: any graph of the signature, about 200 allocations a run.

use crate::onnx::{GraphProto, ModelProto};
use crate::plan::{self, Run};
use crate::proto::MAX_MODEL_BYTES;
use crate::signature::{FORCE_LEN, Role, SPEED_LEN, Signature, TEXTURE_LEN, WANTED};
use asperity_diagnostics::Diagnostic;
use std::path::Path;
use std::sync::Arc;

/// A compiled plan. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Reference {
    plan: Arc<Run>,
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
        let plan = plan::compile(&model, path, &inputs, MAX_MODEL_BYTES, WANTED)?;
        let roles: Vec<Role> = signature.inputs.iter().map(|(_, role)| *role).collect();
        let order = roles.try_into().map_err(|_| refuse("this model has not 3 inputs".into()))?;
        let reference = Self { plan, order };
        // A graph may compile and still fail, or answer something unexpected.
        let results = reference.results(&[0.0; TEXTURE_LEN], &[0.0; FORCE_LEN], &[0.0; SPEED_LEN]);
        let results = results.ok_or_else(|| refuse("tract fails to run this model on zeros".into()))?;
        for (result, (name, len)) in results.iter().zip(&signature.outputs) {
            if result.len() != *len {
                let found = result.len();
                return Err(refuse(format!("output {name} has shape [1,{found}], not [1,{len}] float")));
            }
        }
        Ok(reference)
    }

    fn results(&self, texture: &[f32], force: &[f32], speed: &[f32]) -> Option<Vec<Vec<f32>>> {
        (self.plan)(&self.order.map(|role| match role {
            Role::Force => force,
            Role::Speed => speed,
            Role::Texture => texture,
        }))
    }

    /// One run, into as many of the outputs as there are in `out`; `None` where tract fails. Allocates.
    pub(crate) fn run(
        &self,
        texture: &[f32],
        force: &[f32],
        speed: &[f32],
        out: &mut [&mut [f32]],
    ) -> Option<()> {
        let results = self.results(texture, force, speed)?;
        for (i, out) in out.iter_mut().enumerate() {
            let result = results.get(i)?;
            (result.len() == out.len()).then(|| out.copy_from_slice(result))?;
        }
        Some(())
    }
}
