//! The model run by tract: any graph of the signature, about 200 allocations a run.

use crate::plan::{Plan, Wanted};
use crate::proto::MAX_MODEL_BYTES;
use crate::signature::{FORCE_LEN, Role, SPEED_LEN, Signature, TEXTURE_LEN, WANTED};
use asperity_diagnostics::Diagnostic;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use tract_onnx::pb::{GraphProto, ModelProto};
use tract_onnx::prelude::*;

/// A compiled plan. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Reference {
    plan: Plan,
    order: [Role; 3],
}

/// A texture as tract takes it.
pub(crate) type TextureTensor = Arc<Tensor>;

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
        let wanted = Wanted { path, inputs: &inputs, most_bytes: MAX_MODEL_BYTES, help: WANTED };
        let plan = wanted.compile(&ModelProto { graph: Some(graph), ..model.clone() })?;
        for (i, (name, len)) in signature.outputs.iter().enumerate() {
            let fact = plan
                .model()
                .output_fact(i)
                .map_err(|e| refuse(format!("the output {name} has no shape: {e}")))?;
            let fits = fact.datum_type == f32::datum_type()
                && fact.shape.as_concrete().is_some_and(|dims| dims == [1, *len]);
            if !fits {
                let found = format!("{:?} {:?}", fact.shape, fact.datum_type);
                return Err(refuse(format!("output {name} has shape and type {found}, not [1,{len}] float")));
            }
        }
        let roles: Vec<Role> = signature.inputs.iter().map(|(_, role)| *role).collect();
        let order = roles.try_into().map_err(|_| refuse("this model has not 3 inputs".into()))?;
        let reference = Self { plan, order };
        // A graph may compile and still fail on every run.
        let mut out: Vec<Vec<f32>> = signature.outputs.iter().map(|(_, len)| vec![0.0; *len]).collect();
        let mut out: Vec<&mut [f32]> = out.iter_mut().map(Vec::as_mut_slice).collect();
        match reference.run(&texture(&[0.0; TEXTURE_LEN]), &[0.0; FORCE_LEN], &[0.0; SPEED_LEN], &mut out) {
            Some(()) => Ok(reference),
            None => Err(refuse("tract fails to run this model on zeros".into())),
        }
    }

    /// One run, into as many of the outputs as there are in `out`; `None` where tract fails. Allocates.
    pub(crate) fn run(
        &self,
        texture: &TextureTensor,
        force: &[f32],
        speed: &[f32],
        out: &mut [&mut [f32]],
    ) -> Option<()> {
        let inputs: TVec<TValue> = self
            .order
            .iter()
            .map(|role| match role {
                Role::Force => row(force),
                Role::Speed => row(speed),
                Role::Texture => texture.clone().into_tvalue(),
            })
            .collect();
        let results = catch_unwind(AssertUnwindSafe(|| self.plan.run(inputs))).ok()?.ok()?;
        for (i, out) in out.iter_mut().enumerate() {
            let result = results.get(i)?.try_as_plain_ram().ok()?.as_slice::<f32>().ok()?;
            (result.len() == out.len()).then(|| out.copy_from_slice(result))?;
        }
        Some(())
    }
}

/// A texture vector as tract takes it.
pub(crate) fn texture(values: &[f32]) -> TextureTensor {
    row(values).into_arc_tensor()
}

fn row(values: &[f32]) -> TValue {
    let mut tensor = tensor1(values);
    // A vector of n always becomes a row of n; were it not so, the run would fail and say so.
    let _ = tensor.insert_axis(0);
    tensor.into_tvalue()
}
