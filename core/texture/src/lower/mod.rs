//! Recognises a multilayer perceptron in an ONNX graph and lowers it to a few steps.
//!
//! A step is an affine map or a rescaling of single elements, then a clamp (ReLU is a clamp to [0,
//! inf)) or an exponential. Constant additions and multiplications between steps are folded into
//! weights and biases in f64. Concatenation and reshaping only select the elements that a step reads.
//! Anything else is named as the reason for not lowering.

mod ops;
mod value;

pub(crate) use value::{Affine, Element, Ref, diagonal};

use crate::onnx::{DataType, GraphProto, TensorProto};
use crate::proto;
use crate::signature::{Role, Signature};
use asperity_numbers::Elementary as _;
use std::collections::HashMap;
use value::{Content, Value, elements_of};

/// Most numbers held while lowering: a dozen texture networks, 64 MiB.
const BUDGET: usize = 1 << 23;
/// Most nodes of a graph: a texture network has about fifty.
const MAX_NODES: usize = 2000;

/// Calculation of a step, before its end.
#[derive(Clone, Debug)]
pub(crate) enum StepKind {
    Input(Role),
    Affine(Affine),
    Elements(Vec<Element>),
}

/// Last thing done with each result of a step.
#[derive(Clone, Copy, Debug)]
pub(crate) enum End {
    /// Clamped to these, from the first to the second.
    Clamp(f64, f64),
    Exponential,
}

impl End {
    pub(crate) const NONE: Self = Self::Clamp(f64::NEG_INFINITY, f64::INFINITY);

    /// The result at the end; NaN stays NaN.
    pub(crate) fn of(self, x: f64) -> f64 {
        match self {
            Self::Clamp(low, _) if x < low => low,
            Self::Clamp(_, high) if x > high => high,
            Self::Clamp(..) => x,
            Self::Exponential => x.exp_e(),
        }
    }
}

/// A step: `kind`, then `end`.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(crate) kind: StepKind,
    pub(crate) end: End,
}

impl Step {
    pub(crate) fn len(&self) -> usize {
        match &self.kind {
            StepKind::Input(role) => role.len(),
            StepKind::Affine(a) => a.bias.len(),
            StepKind::Elements(e) => e.len(),
        }
    }

    /// Computes its result in f64 from earlier ones. An input's result is given already.
    pub(crate) fn compute(&self, read: impl Fn(Ref) -> Option<f64>, result: &mut [f64]) -> Option<()> {
        match &self.kind {
            StepKind::Input(_) => {}
            StepKind::Elements(elements) => {
                for (y, e) in result.iter_mut().zip(elements) {
                    *y = match e.of {
                        Some(of) => e.scale * read(of)? + e.offset,
                        None => e.offset,
                    };
                }
            }
            StepKind::Affine(a) => {
                result.copy_from_slice(a.bias.get(..result.len())?);
                for (row, &of) in a.weights.chunks_exact(a.bias.len().max(1)).zip(&a.inputs) {
                    let x = read(of)?;
                    result.iter_mut().zip(row).for_each(|(sum, w)| *sum += w * x);
                }
            }
        }
        result.iter_mut().for_each(|x| *x = self.end.of(*x));
        Some(())
    }

    /// The results it reads.
    pub(crate) fn reads(&self) -> Box<dyn Iterator<Item = Ref> + '_> {
        match &self.kind {
            StepKind::Input(_) => Box::new(std::iter::empty()),
            StepKind::Affine(a) => Box::new(a.inputs.iter().copied()),
            StepKind::Elements(e) => Box::new(e.iter().filter_map(|e| e.of)),
        }
    }
}

/// A lowered network: steps in order.
#[derive(Clone, Debug)]
pub(crate) struct Lowered {
    pub(crate) steps: Vec<Step>,
    /// Steps whose results are the outputs, in the signature's order.
    pub(crate) outputs: Vec<usize>,
}

impl Lowered {
    /// Lowers a graph, or says why it cannot.
    pub(crate) fn new(graph: &GraphProto, opset: i64, signature: &Signature) -> Result<Self, String> {
        if graph.node.len() > MAX_NODES {
            return Err(format!("it has {} nodes", graph.node.len()));
        }
        let mut b = Builder { steps: Vec::new(), values: HashMap::new(), budget: BUDGET, opset };
        for (name, role) in &signature.inputs {
            let step = b.push(StepKind::Input(*role), End::NONE)?;
            let content = Content::Elements(elements_of(step, role.len()));
            b.values.insert(name.clone(), Value { shape: vec![1, role.len()], content });
        }
        for tensor in &graph.initializer {
            let value = b.constant(tensor)?;
            b.values.insert(tensor.name.clone(), value);
        }
        for node in &graph.node {
            let value = ops::lower(&mut b, node).map_err(|why| format!("{}: {why}", proto::title(node)))?;
            b.charge(value.content.size())?;
            let outputs: Vec<&String> = node.output.iter().filter(|name| !name.is_empty()).collect();
            let [output] = outputs.as_slice() else {
                return Err(format!("{}: {} outputs", proto::title(node), outputs.len()));
            };
            b.values.insert((*output).clone(), value);
        }
        let mut outputs = Vec::new();
        for (name, len) in &signature.outputs {
            let value = b.values.get(name).cloned().ok_or("its output is missing")?;
            if value.shape != [1, *len] {
                return Err(format!("its output {name} has the shape {:?}", value.shape));
            }
            outputs.push(match b.whole_step(&value.content) {
                Some(step) => step,
                None => b.materialise(value.content, End::NONE)?,
            });
        }
        Ok(Self { steps: b.steps, outputs })
    }

    /// Multiply-adds of all steps.
    pub(crate) fn multiply_adds(&self) -> usize {
        let weights = |step: &Step| match &step.kind {
            StepKind::Affine(a) => a.weights.len(),
            _ => 0,
        };
        self.steps.iter().map(weights).sum()
    }

    /// Whether each step is needed for the outputs.
    pub(crate) fn needed(&self) -> Vec<bool> {
        let mut needed = vec![false; self.steps.len()];
        self.outputs.iter().for_each(|&output| needed[output] = true);
        for (i, step) in self.steps.iter().enumerate().rev() {
            if needed[i] {
                step.reads().for_each(|r| needed[r.step] = true);
            }
        }
        needed
    }

    /// Whether each step depends on the texture alone (or on nothing), and so is constant for a material.
    pub(crate) fn depends_on_texture_alone(&self) -> Vec<bool> {
        let mut fixed = vec![false; self.steps.len()];
        for (i, step) in self.steps.iter().enumerate() {
            fixed[i] = match step.kind {
                StepKind::Input(role) => role == Role::Texture,
                _ => step.reads().all(|r| fixed[r.step]),
            };
        }
        fixed
    }

    /// Results of the `wanted` steps in f64; others stay empty.
    pub(crate) fn evaluate(&self, wanted: &[bool], input: impl Fn(Role) -> Vec<f64>) -> Vec<Vec<f64>> {
        let mut results: Vec<Vec<f64>> = Vec::with_capacity(self.steps.len());
        for (step, wanted) in self.steps.iter().zip(wanted) {
            if !wanted {
                results.push(Vec::new());
                continue;
            }
            let mut result = match step.kind {
                StepKind::Input(role) => input(role),
                _ => vec![0.0; step.len()],
            };
            // Steps read only earlier results.
            let _ = step.compute(|r| results.get(r.step)?.get(r.index).copied(), &mut result);
            results.push(result);
        }
        results
    }
}

/// A half-lowered graph.
struct Builder {
    steps: Vec<Step>,
    values: HashMap<String, Value>,
    budget: usize,
    opset: i64,
}

impl Builder {
    fn charge(&mut self, numbers: usize) -> Result<(), String> {
        self.budget = self.budget.checked_sub(numbers).ok_or("it is too large to lower")?;
        Ok(())
    }

    fn push(&mut self, kind: StepKind, end: End) -> Result<usize, String> {
        let weights = match &kind {
            StepKind::Affine(a) => a.weights.as_slice(),
            _ => &[],
        };
        if !weights.iter().all(|w| w.is_finite()) {
            return Err("weights are not finite".into());
        }
        self.steps.push(Step { kind, end });
        Ok(self.steps.len() - 1)
    }

    fn constant(&mut self, tensor: &TensorProto) -> Result<Value, String> {
        let data = proto::numbers(tensor)?;
        self.charge(data.len())?;
        let shape = tensor.dims.iter().map(|&d| usize::try_from(d).unwrap_or(0)).collect();
        let float = tensor.data_type == DataType::Float as i32;
        Ok(Value { shape, content: Content::Constant { data, float } })
    }

    /// The step whose whole, unchanged result this is.
    fn whole_step(&self, content: &Content) -> Option<usize> {
        let Content::Elements(elements) = content else { return None };
        let step = elements.first()?.of?.step;
        let same = |(i, e): (usize, &Element)| {
            e.of == Some(Ref { step, index: i }) && e.scale == 1.0 && e.offset == 0.0
        };
        let whole = elements.len() == self.steps[step].len() && elements.iter().enumerate().all(same);
        (whole && !matches!(self.steps[step].kind, StepKind::Input(_))).then_some(step)
    }

    /// Makes a step of a value.
    fn materialise(&mut self, content: Content, end: End) -> Result<usize, String> {
        let kind = match content {
            Content::Affine(a) => StepKind::Affine(a),
            Content::Elements(e) => StepKind::Elements(e),
            Content::Constant { .. } => return Err("it is constant".into()),
        };
        self.push(kind, end)
    }

    /// The value as elements. An affine map becomes a step.
    fn elements(&mut self, content: Content) -> Result<Vec<Element>, String> {
        match content {
            Content::Elements(e) => Ok(e),
            Content::Constant { data, float: true } => {
                Ok(data.into_iter().map(|offset| Element { of: None, scale: 0.0, offset }).collect())
            }
            Content::Constant { float: false, .. } => Err("not of 32-bit floats".into()),
            affine @ Content::Affine(_) => {
                let len = affine.len();
                let step = self.materialise(affine, End::NONE)?;
                Ok(elements_of(step, len))
            }
        }
    }
}
