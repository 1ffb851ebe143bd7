//! Runs any ONNX graph by tract, once the sizes of all its tensors are known.
//!
//! Nothing else of Asperity depends on tract, which takes as long to build as all the rest. A program that
//! has this crate gives [`compile`] to `asperity_texture::run_graphs_by`.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, budget};
use prost::Message;
use tract_onnx::prelude::*;
use tract_onnx::tract_hir::internal::*;
use tract_onnx::tract_hir::tract_core::model::order::eval_order_for_nodes;

/// A compiled graph: from its inputs to its outputs. `None` where tract fails or an output is not of f32.
/// Allocates.
pub type Run = dyn Fn(&[&[f32]]) -> Option<Vec<Vec<f32>>> + Send + Sync;

/// Compiles the bytes of an ONNX model for f32 `inputs` of these shapes; `path` is its name in errors.
///
/// `most_bytes` is the largest file of this kind of model. Its tensors have at most twice as many
/// numbers. `help` describes such a model.
///
/// # Errors
/// A graph that tract cannot run; tensors that are too large, all together.
pub fn compile(
    model: &[u8],
    path: &Path,
    inputs: &[Vec<usize>],
    most_bytes: u64,
    help: &str,
) -> Result<Arc<Run>, Diagnostic> {
    let wanted = Wanted { path, inputs, most_bytes, help };
    // tract panics on some malformed graphs that pass all earlier checks.
    let plan = catch_unwind(AssertUnwindSafe(|| wanted.plan(model)))
        .unwrap_or_else(|_| Err(wanted.refuse("tract panicked over this model".into())))?;
    let shapes = inputs.to_vec();
    Ok(Arc::new(move |inputs| run(&plan, &shapes, inputs)))
}

fn run(plan: &Arc<TypedRunnableModel>, shapes: &[Vec<usize>], inputs: &[&[f32]]) -> Option<Vec<Vec<f32>>> {
    let inputs = inputs.iter().zip(shapes).map(|(data, shape)| Tensor::from_shape(shape, data));
    let inputs: Option<TVec<TValue>> = inputs.map(|tensor| Some(tensor.ok()?.into_tvalue())).collect();
    let inputs = inputs?;
    let results = catch_unwind(AssertUnwindSafe(|| plan.run(inputs))).ok()?.ok()?;
    results.iter().map(|r| Some(r.try_as_plain_ram().ok()?.as_slice::<f32>().ok()?.to_vec())).collect()
}

/// A model to compile, as [`compile`] takes it.
struct Wanted<'a> {
    path: &'a Path,
    inputs: &'a [Vec<usize>],
    most_bytes: u64,
    help: &'a str,
}

impl Wanted<'_> {
    fn plan(&self, model: &[u8]) -> Result<Arc<TypedRunnableModel>, Diagnostic> {
        let told = |e: TractError| {
            let cause: String = format!("{e:#}").chars().take(400).collect();
            self.refuse(format!("tract cannot run this model: {cause}"))
        };
        let mut model = self.parse(model).map_err(told)?;
        self.count(&mut model).map_err(told)??;
        model.into_optimized().and_then(|model| model.into_runnable()).map_err(told)
    }

    fn refuse(&self, what: String) -> Diagnostic {
        Diagnostic::new(what).in_file(self.path).help(self.help)
    }

    fn parse(&self, model: &[u8]) -> TractResult<InferenceModel> {
        let model = tract_onnx::pb::ModelProto::decode(model)?;
        // Shapes inside the graph are computed anew: those in the file may be for another batch size.
        let parsed = tract_onnx::onnx().with_ignore_value_info(true).parse(&model, None)?;
        if let Some(name) = parsed.unresolved_inputs.first() {
            return Err(TractError::msg(format!("nothing gives \"{name}\"")));
        }
        let mut model = parsed.model;
        for (i, shape) in self.inputs.iter().enumerate() {
            model = model.with_input_fact(i, f32::fact(shape).into())?;
        }
        Ok(model)
    }

    /// Counts the numbers in all tensors, node by node. A constant is computed only after it was
    /// counted: sizes of later ones may follow from it.
    fn count(&self, model: &mut InferenceModel) -> TractResult<Result<(), Diagnostic>> {
        let most = self.most_bytes / 2;
        let (mut numbers, mut bytes) = (0_u64, 0_u64);
        // tract computes constants that no output needs, too.
        let all: Vec<usize> = model.nodes().iter().map(|node| node.id).collect();
        for id in eval_order_for_nodes(model.nodes(), &[], &all, &[])? {
            let node = model.node(id);
            let (inputs, outputs) = model.node_facts(id)?;
            let observed = node.op.observe_outlets(model, node)?;
            let observed: TVec<&InferenceFact> =
                observed.iter().map(|outlet| model.outlet_fact(*outlet)).collect::<TractResult<_>>()?;
            let mut op: Box<dyn InferenceOp> = node.op.clone();
            let shapes = op.infer_facts(inputs.clone(), outputs.clone(), observed.clone())?.1;
            for fact in &shapes {
                let size = fact.datum_type.concretize().map_or(8, |kind| kind.size_of() as u64);
                let len = elements(&fact.shape);
                numbers = numbers.saturating_add(len);
                bytes = bytes.saturating_add(len.saturating_mul(size));
            }
            let title = || format!("node \"{:.60}\" ({:.60})", node.name, node.op.name());
            if numbers > most {
                let what = format!("{} brings the tensors to {numbers} elements", title());
                return Ok(Err(self.refuse(format!("{what}; at most {most} are made"))));
            }
            // tract holds constants as read, as transposed and as packed.
            if let Err(e) = budget::needs(bytes.saturating_mul(3)) {
                let what = format!("{}: {}", title(), e.message);
                return Ok(Err(Diagnostic { message: what, ..e }.in_file(self.path)));
            }
            let known = op.infer(inputs, outputs, observed)?.1;
            for (slot, fact) in known.into_iter().enumerate() {
                model.set_outlet_fact(OutletId::new(id, slot), fact)?;
            }
        }
        Ok(Ok(()))
    }
}

/// Number of elements of a shape; 0 while it is unknown.
fn elements(shape: &ShapeFactoid) -> u64 {
    let sizes = shape.concretize().unwrap_or_default();
    let sizes = sizes.iter().map(|size| size.to_i64().ok().and_then(|size| u64::try_from(size).ok()));
    sizes
        .collect::<Option<Vec<u64>>>()
        .map_or(0, |sizes| sizes.iter().fold(1, |n, size| n.saturating_mul(*size)))
}
