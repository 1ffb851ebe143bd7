//! Recognises a multilayer perceptron in an ONNX graph and lowers it to a few steps.
//!
//! A step is an affine map or a rescaling of single elements, then a clamp (ReLU is a clamp to [0,
//! inf)) or an exponential. Constant additions and multiplications between steps are folded into
//! weights and biases in f64. Concatenation and reshaping only select the elements that a step reads.
//! Anything else is named as the reason for not lowering.
//!
//! Elements are counted through: first the inputs, each at its [`Role::place`], then the results of steps.

mod ops;

use crate::onnx::GraphProto;
use crate::proto;
use crate::signature::{Role, Signature};
use asperity_numbers::Elementary as _;
use std::collections::{HashMap, HashSet};
use std::ops::Range;

/// Most numbers held while lowering, sums and weights together: about six texture networks, 256 MiB.
const BUDGET: usize = 1 << 23;
/// Most nodes of a graph: a texture network has about fifty.
const MAX_NODES: usize = 2000;

/// The sum of some elements times weights, plus `offset`. Without terms it is a constant.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Sum {
    pub(crate) terms: Vec<(usize, f64)>,
    pub(crate) offset: f64,
}

/// The elements in a range.
fn elements(range: Range<usize>) -> Vec<Sum> {
    range.map(|element| Sum { terms: vec![(element, 1.0)], offset: 0.0 }).collect()
}

/// `sum_k inputs[k] * weights[k * n + j] + bias[j]`, n = `bias.len()`.
#[derive(Clone, Debug)]
pub(crate) struct Affine {
    pub(crate) inputs: Vec<usize>,
    pub(crate) weights: Vec<f64>,
    pub(crate) bias: Vec<f64>,
}

impl Affine {
    /// From a sum for each column. Inputs keep their order.
    pub(crate) fn new(sums: &[Sum]) -> Self {
        let (mut rows, mut inputs) = (HashMap::new(), Vec::new());
        for (element, _) in sums.iter().flat_map(|sum| &sum.terms) {
            rows.entry(*element).or_insert_with(|| {
                inputs.push(*element);
                inputs.len() - 1
            });
        }
        let n = sums.len();
        let mut weights = vec![0.0; inputs.len() * n];
        for (j, sum) in sums.iter().enumerate() {
            sum.terms.iter().for_each(|(element, weight)| weights[rows[element] * n + j] += weight);
        }
        Self { inputs, weights, bias: sums.iter().map(|sum| sum.offset).collect() }
    }
}

/// Calculation of a step, before its end.
#[derive(Clone, Debug)]
pub(crate) enum StepKind {
    Affine(Affine),
    /// Sums of at most one term.
    Elements(Vec<Sum>),
}

/// Last thing done with each result of a step.
#[derive(Clone, Copy, Debug)]
pub(crate) enum End {
    /// Clamped to these, from the first to the second.
    Clamp(f64, f64),
    Exponential,
}

impl End {
    const NONE: Self = Self::Clamp(f64::NEG_INFINITY, f64::INFINITY);

    /// The result at the end; NaN stays NaN.
    fn of(self, x: f64) -> f64 {
        match self {
            Self::Clamp(low, _) if x < low => low,
            Self::Clamp(_, high) if x > high => high,
            Self::Clamp(..) => x,
            Self::Exponential => x.exp_e(),
        }
    }
}

/// A step: `kind`, then `end`, into the elements from `first` on.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(crate) first: usize,
    pub(crate) kind: StepKind,
    pub(crate) end: End,
}

impl Step {
    pub(crate) fn len(&self) -> usize {
        match &self.kind {
            StepKind::Affine(a) => a.bias.len(),
            StepKind::Elements(sums) => sums.len(),
        }
    }

    /// Computes its elements in f64 from earlier ones.
    pub(crate) fn compute(&self, elements: &mut [f64]) {
        let (before, rest) = elements.split_at_mut(self.first);
        let result = &mut rest[..self.len()];
        match &self.kind {
            StepKind::Elements(sums) => {
                for (y, sum) in result.iter_mut().zip(sums) {
                    *y = sum.terms.iter().map(|(k, weight)| weight * before[*k]).sum::<f64>() + sum.offset;
                }
            }
            StepKind::Affine(a) => {
                result.copy_from_slice(&a.bias);
                for (row, k) in a.weights.chunks_exact(a.bias.len().max(1)).zip(&a.inputs) {
                    let x = before[*k];
                    result.iter_mut().zip(row).for_each(|(sum, w)| *sum += w * x);
                }
            }
        }
        result.iter_mut().for_each(|x| *x = self.end.of(*x));
    }
}

/// A lowered network: steps in order.
#[derive(Clone, Debug)]
pub(crate) struct Lowered {
    pub(crate) steps: Vec<Step>,
    /// Elements of the outputs, in the signature's order.
    pub(crate) outputs: Vec<Range<usize>>,
    /// Whether each element depends on the texture alone, or on nothing, and so is constant for a material.
    pub(crate) constant: Vec<bool>,
}

impl Lowered {
    /// Lowers a graph, or says why it cannot.
    pub(crate) fn new(graph: &GraphProto, opset: i64, signature: &Signature) -> Result<Self, String> {
        if graph.node.len() > MAX_NODES {
            return Err(format!("it has {} nodes", graph.node.len()));
        }
        let mut b = Builder {
            tensors: graph.initializer.iter().map(|tensor| (tensor.name.as_str(), tensor)).collect(),
            steps: Vec::new(),
            constant: Role::ALL.iter().flat_map(|r| vec![*r == Role::Texture; r.place().len()]).collect(),
            values: HashMap::new(),
            budget: BUDGET,
            opset,
        };
        for (name, role) in &signature.inputs {
            let shape = vec![1, role.place().len()];
            b.values.insert(name, Value { shape, float: true, sums: elements(role.place()) });
        }
        for node in &graph.node {
            let refuse = |why| format!("{}: {why}", proto::title(node));
            let value = ops::lower(&mut b, node).map_err(refuse)?;
            b.charge(value.size())?;
            let outputs: Vec<&String> = node.output.iter().filter(|name| !name.is_empty()).collect();
            let [output] = outputs.as_slice() else {
                return Err(refuse(format!("{} outputs", outputs.len())));
            };
            b.values.insert(output, value);
        }
        let mut outputs = Vec::new();
        for (name, len) in &signature.outputs {
            let value = b.values.remove(name.as_str()).ok_or("its output is missing")?;
            if value.shape != [1, *len] {
                return Err(format!("its output {name} has the shape {:?}", value.shape));
            }
            // An output may be the results of a step as they are.
            let first = value.sums[0].terms.first().map_or(0, |(element, _)| *element);
            let whole = b.steps.iter().any(|s| (s.first, s.len()) == (first, *len))
                && value.sums == elements(first..first + len);
            outputs.push(if whole { first..first + len } else { b.push(&value.sums, End::NONE)? });
        }
        let mut net = Self { steps: b.steps, outputs, constant: b.constant };
        net.drop_unread();
        Ok(net)
    }

    /// Drops steps that no output needs. Elements keep their numbers; those of dropped steps are never read.
    fn drop_unread(&mut self) {
        let mut read = vec![false; self.constant.len()];
        self.outputs.iter().for_each(|output| read[output.clone()].fill(true));
        let mut kept = Vec::new();
        // From the last step to the first: a step is read only by later ones.
        for step in std::mem::take(&mut self.steps).into_iter().rev() {
            if read[step.first..][..step.len()].contains(&true) {
                match &step.kind {
                    StepKind::Affine(a) => a.inputs.iter().for_each(|k| read[*k] = true),
                    StepKind::Elements(sums) => {
                        sums.iter().flat_map(|sum| &sum.terms).for_each(|(k, _)| read[*k] = true);
                    }
                }
                kept.push(step);
            }
        }
        kept.reverse();
        self.steps = kept;
    }

    /// Multiply-adds of all steps.
    pub(crate) fn multiply_adds(&self) -> usize {
        let weights = |step: &Step| match &step.kind {
            StepKind::Affine(a) => a.weights.len(),
            StepKind::Elements(_) => 0,
        };
        self.steps.iter().map(weights).sum()
    }
}

/// A tensor: known, or a function of earlier results, in row-major order.
#[derive(Clone, Debug)]
struct Value {
    shape: Vec<usize>,
    /// Whether of 32-bit floats, not of whole numbers.
    float: bool,
    sums: Vec<Sum>,
}

impl Value {
    fn constant(&self) -> bool {
        self.sums.iter().all(|sum| sum.terms.is_empty())
    }

    /// Numbers held, to count memory.
    fn size(&self) -> usize {
        self.sums.iter().map(|sum| 1 + sum.terms.len()).sum()
    }
}

/// A half-lowered graph.
struct Builder<'g> {
    tensors: HashMap<&'g str, &'g crate::onnx::TensorProto>,
    steps: Vec<Step>,
    constant: Vec<bool>,
    values: HashMap<&'g str, Value>,
    budget: usize,
    opset: i64,
}

impl Builder<'_> {
    fn fits(&self, numbers: usize) -> Result<(), String> {
        if numbers > self.budget { Err("it is too large to lower".into()) } else { Ok(()) }
    }

    /// Counts numbers that are held from now on.
    fn charge(&mut self, numbers: usize) -> Result<(), String> {
        self.fits(numbers)?;
        self.budget -= numbers;
        Ok(())
    }

    /// Adds a step; returns its elements.
    fn push(&mut self, sums: &[Sum], end: End) -> Result<Range<usize>, String> {
        let terms = || sums.iter().flat_map(|sum| &sum.terms);
        if terms().next().is_none() {
            return Err("it is constant".into());
        }
        if terms().any(|(_, weight)| !weight.is_finite()) {
            return Err("weights are not finite".into());
        }
        let single = sums.iter().all(|sum| sum.terms.len() <= 1);
        let constant = terms().all(|(element, _)| self.constant[*element]);
        // Weights are a full matrix, here or, for elements of which some are constant, when they are packed.
        if !single || (!constant && terms().any(|(element, _)| self.constant[*element])) {
            let inputs = terms().map(|(element, _)| *element).collect::<HashSet<_>>().len();
            self.charge(inputs.saturating_mul(sums.len()))?;
        }
        let kind =
            if single { StepKind::Elements(sums.to_vec()) } else { StepKind::Affine(Affine::new(sums)) };
        let first = self.constant.len();
        self.constant.extend(std::iter::repeat_n(constant, sums.len()));
        self.steps.push(Step { first, kind, end });
        Ok(first..first + sums.len())
    }

    /// The value as sums of at most one term each. Longer ones become a step.
    fn single(&mut self, value: Value) -> Result<Value, String> {
        if value.sums.iter().all(|sum| sum.terms.len() <= 1) {
            return Ok(value);
        }
        let sums = elements(self.push(&value.sums, End::NONE)?);
        self.charge(sums.len())?;
        Ok(Value { sums, ..value })
    }
}
