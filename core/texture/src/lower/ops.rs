//! Lowers single ONNX operators, as the ONNX operator reference defines them, operator sets 7 and later.

use super::{Builder, End, Sum, Value, elements};
use crate::onnx::{DataType, NodeProto, TensorProto};
use crate::proto::{self, attribute};

pub(super) fn lower(b: &mut Builder<'_>, node: &NodeProto) -> Result<Value, String> {
    if !matches!(node.domain.as_str(), "" | "ai.onnx") {
        return Err("its domain is not ONNX's own".into());
    }
    match node.op_type.as_str() {
        "Constant" => constant(b, node),
        "Identity" | "Dropout" => input(b, node, 0),
        "Cast" => cast(b, node),
        "Reshape" => reshape(b, node),
        "Flatten" => flatten(b, node),
        "Squeeze" => squeeze(b, node),
        "Unsqueeze" => unsqueeze(b, node),
        "Transpose" => transpose(b, node),
        "Concat" => concat(b, node),
        "Add" | "Sub" | "Mul" | "Div" => {
            elementwise(b, floats(b, node, 0)?, floats(b, node, 1)?, &node.op_type)
        }
        "Relu" => clamp(b, node, 0.0, f64::INFINITY),
        "Exp" => end(b, floats(b, node, 0)?, End::Exponential),
        "Clip" if b.opset < 11 => clamp(b, node, float(node, "min", f32::MIN), float(node, "max", f32::MAX)),
        "Clip" => {
            let limit = |index, open| if has(node, index) { scalar(b, node, index) } else { Ok(open) };
            let (low, high) = (limit(1, f64::NEG_INFINITY)?, limit(2, f64::INFINITY)?);
            clamp(b, node, low, high)
        }
        "Max" | "Min" if node.input.len() == 2 => max_min(b, node),
        "MatMul" => matmul(b, floats(b, node, 0)?, floats(b, node, 1)?),
        "Gemm" => gemm(b, node),
        _ => Err("not one of a multilayer perceptron's operators".into()),
    }
}

fn has(node: &NodeProto, index: usize) -> bool {
    node.input.get(index).is_some_and(|name| !name.is_empty())
}

fn input(b: &Builder<'_>, node: &NodeProto, index: usize) -> Result<Value, String> {
    let name = node.input.get(index).map_or("", String::as_str);
    match (b.values.get(name), b.tensors.get(name)) {
        (Some(value), _) => Ok(value.clone()),
        (None, Some(tensor)) => of_tensor(b, tensor),
        (None, None) => Err(format!("input {index} is missing")),
    }
}

fn floats(b: &Builder<'_>, node: &NodeProto, index: usize) -> Result<Value, String> {
    input(b, node, index)?.of_floats()
}

fn int(node: &NodeProto, name: &str, default: i64) -> i64 {
    attribute(node, name).map_or(default, |a| a.i)
}

fn float(node: &NodeProto, name: &str, default: f32) -> f64 {
    f64::from(attribute(node, name).map_or(default, |a| a.f))
}

/// An axis; negative ones count from the end.
fn axis(index: i64, rank: usize) -> Result<usize, String> {
    let from_front = if index < 0 { index + rank as i64 } else { index };
    usize::try_from(from_front).ok().filter(|&i| i < rank).ok_or_else(|| format!("axis {index} of {rank}"))
}

fn axes(list: &[i64], rank: usize) -> Result<Vec<usize>, String> {
    list.iter().map(|&i| axis(i, rank)).collect()
}

/// A list from an attribute (older operator sets) or a constant input.
fn list(b: &Builder<'_>, node: &NodeProto, name: &str) -> Result<Option<Vec<i64>>, String> {
    if let Some(a) = attribute(node, name) {
        return Ok(Some(a.ints.clone()));
    }
    if !has(node, 1) {
        return Ok(None);
    }
    match input(b, node, 1)? {
        v if !v.float && v.constant() => Ok(Some(v.sums.iter().map(|x| x.offset as i64).collect())),
        _ => Err(format!("{name} is not a constant list of integers")),
    }
}

/// A single constant.
fn scalar(b: &Builder<'_>, node: &NodeProto, index: usize) -> Result<f64, String> {
    match floats(b, node, index)?.sums.as_slice() {
        [Sum { terms, offset }] if terms.is_empty() => Ok(*offset),
        _ => Err(format!("input {index} is not a single constant")),
    }
}

impl Value {
    fn known(shape: Vec<usize>, data: impl IntoIterator<Item = f64>, float: bool) -> Self {
        let sums = data.into_iter().map(|offset| Sum { terms: Vec::new(), offset }).collect();
        Self { shape, float, sums }
    }

    fn of_floats(self) -> Result<Self, String> {
        if self.float { Ok(self) } else { Err("not of 32-bit floats".into()) }
    }

    fn with_shape(self, shape: Vec<usize>) -> Result<Self, String> {
        if shape.iter().try_fold(1usize, |p, &d| p.checked_mul(d)) != Some(self.sums.len()) {
            return Err(format!("{:?} cannot become {shape:?}", self.shape));
        }
        Ok(Self { shape, ..self })
    }

    /// The axes in another order.
    fn permuted(self, order: &[usize]) -> Self {
        let shape: Vec<usize> = order.iter().map(|&i| self.shape[i]).collect();
        let strides: Vec<usize> = order.iter().map(|&i| count(&self.shape[i + 1..])).collect();
        let sums = indices(&shape, &strides).map(|i| self.sums[i].clone()).collect();
        Self { shape, sums, ..self }
    }
}

/// Number of elements; a number too large only appears beside a length of 0.
fn count(shape: &[usize]) -> usize {
    shape.iter().fold(1, |p, &d| p.wrapping_mul(d))
}

/// For each element of a shape, row by row, its index where the axes have these strides.
fn indices(shape: &[usize], strides: &[usize]) -> impl Iterator<Item = usize> {
    (0..count(shape)).map(move |mut rest| {
        let mut index = 0;
        for (len, stride) in shape.iter().zip(strides).rev() {
            index += rest % len * stride;
            rest /= len;
        }
        index
    })
}

fn of_tensor(b: &Builder<'_>, tensor: &TensorProto) -> Result<Value, String> {
    let shape: Vec<usize> = tensor.dims.iter().map(|&d| usize::try_from(d).unwrap_or(0)).collect();
    b.fits(count(&shape))?;
    Ok(Value::known(shape, proto::numbers(tensor)?, tensor.data_type == DataType::Float as i32))
}

fn constant(b: &Builder<'_>, node: &NodeProto) -> Result<Value, String> {
    let a = node.attribute.first().ok_or("without a value")?;
    match a.name.as_str() {
        "value" => of_tensor(b, a.t.as_ref().ok_or("without a value")?),
        "value_float" => Ok(Value::known(vec![], [f64::from(a.f)], true)),
        "value_floats" => Ok(Value::known(vec![a.floats.len()], a.floats.iter().map(|&x| x.into()), true)),
        "value_int" => Ok(Value::known(vec![], [a.i as f64], false)),
        "value_ints" => Ok(Value::known(vec![a.ints.len()], a.ints.iter().map(|&x| x as f64), false)),
        _ => Err("of an unusual kind".into()),
    }
}

fn cast(b: &Builder<'_>, node: &NodeProto) -> Result<Value, String> {
    if int(node, "to", 0) != DataType::Float as i64 {
        return Err("to something else than 32-bit float".into());
    }
    let mut v = input(b, node, 0)?;
    if v.constant() {
        v.sums.iter_mut().for_each(|x| x.offset = f64::from(x.offset as f32));
    }
    Ok(Value { float: true, ..v })
}

fn reshape(b: &Builder<'_>, node: &NodeProto) -> Result<Value, String> {
    let v = input(b, node, 0)?;
    let wanted = list(b, node, "shape")?.ok_or("without a shape")?;
    let keep_zero = int(node, "allowzero", 0) != 0;
    let mut shape = Vec::new();
    for (i, &d) in wanted.iter().enumerate() {
        shape.push(match d {
            -1 => None,
            0 if !keep_zero => Some(*v.shape.get(i).ok_or("a 0 past the end of the shape")?),
            d => Some(usize::try_from(d).map_err(|_| "a negative dimension")?),
        });
    }
    let known = shape.iter().flatten().try_fold(1usize, |p, &d| p.checked_mul(d)).ok_or("too large")?;
    if shape.iter().filter(|d| d.is_none()).count() > 1 || known == 0 {
        return Err(format!("to {wanted:?}"));
    }
    let rest = v.sums.len() / known;
    v.with_shape(shape.into_iter().map(|d| d.unwrap_or(rest)).collect())
}

fn flatten(b: &Builder<'_>, node: &NodeProto) -> Result<Value, String> {
    let v = input(b, node, 0)?;
    let rank = v.shape.len();
    let at = match int(node, "axis", 1) {
        i if i == rank as i64 => rank,
        i => axis(i, rank)?,
    };
    let shape = vec![count(&v.shape[..at]), count(&v.shape[at..])];
    v.with_shape(shape)
}

fn squeeze(b: &Builder<'_>, node: &NodeProto) -> Result<Value, String> {
    let v = input(b, node, 0)?;
    let rank = v.shape.len();
    let drop = match list(b, node, "axes")? {
        Some(list) => axes(&list, rank)?,
        None => (0..rank).filter(|&i| v.shape[i] == 1).collect(),
    };
    let shape = (0..rank).filter(|i| !drop.contains(i)).map(|i| v.shape[i]).collect();
    v.with_shape(shape)
}

fn unsqueeze(b: &Builder<'_>, node: &NodeProto) -> Result<Value, String> {
    let v = input(b, node, 0)?;
    let list = list(b, node, "axes")?.ok_or("without axes")?;
    let rank = v.shape.len() + list.len();
    let added = axes(&list, rank)?;
    let mut old = v.shape.iter();
    let shape =
        (0..rank).filter_map(|i| if added.contains(&i) { Some(1) } else { old.next().copied() }).collect();
    v.with_shape(shape)
}

fn transpose(b: &Builder<'_>, node: &NodeProto) -> Result<Value, String> {
    let v = input(b, node, 0)?;
    let rank = v.shape.len();
    let order = match attribute(node, "perm") {
        Some(a) => axes(&a.ints, rank)?,
        None => (0..rank).rev().collect(),
    };
    if order.len() != rank || (0..rank).any(|i| !order.contains(&i)) {
        return Err("its perm is no permutation".into());
    }
    Ok(v.permuted(&order))
}

fn concat(b: &mut Builder<'_>, node: &NodeProto) -> Result<Value, String> {
    let first = input(b, node, 0)?.shape;
    let at = axis(int(node, "axis", 1), first.len())?;
    if first[..at].iter().any(|&d| d != 1) {
        return Err("along an axis that is not the outermost long one".into());
    }
    let (mut shape, mut sums) = (first.clone(), Vec::new());
    shape[at] = 0;
    for i in 0..node.input.len() {
        let v = floats(b, node, i)?;
        let fits =
            v.shape.len() == first.len() && (0..first.len()).all(|i| i == at || v.shape[i] == first[i]);
        if !fits {
            return Err(format!("of {first:?} and {:?}", v.shape));
        }
        shape[at] += v.shape[at];
        sums.extend(b.single(v)?.sums);
        b.charge(sums.len())?;
    }
    Ok(Value { shape, float: true, sums })
}

/// Makes a step of a value.
fn end(b: &mut Builder<'_>, v: Value, end: End) -> Result<Value, String> {
    Ok(Value { sums: elements(b.push(&v.sums, end)?), ..v })
}

fn clamped(b: &mut Builder<'_>, v: Value, low: f64, high: f64) -> Result<Value, String> {
    if low.is_nan() || high.is_nan() || low > high {
        return Err(format!("clamps to {low}..{high}"));
    }
    end(b, v, End::Clamp(low, high))
}

fn clamp(b: &mut Builder<'_>, node: &NodeProto, low: f64, high: f64) -> Result<Value, String> {
    clamped(b, floats(b, node, 0)?, low, high)
}

fn max_min(b: &mut Builder<'_>, node: &NodeProto) -> Result<Value, String> {
    let constant = if floats(b, node, 0)?.constant() { 0 } else { 1 };
    let (v, limit) = (floats(b, node, 1 - constant)?, scalar(b, node, constant)?);
    let open = f64::INFINITY;
    if node.op_type == "Max" { clamped(b, v, limit, open) } else { clamped(b, v, -open, limit) }
}

/// Applies an operator element by element, with NumPy's broadcasting.
fn elementwise(b: &Builder<'_>, x: Value, y: Value, op: &str) -> Result<Value, String> {
    let misfit = || format!("of {:?} and {:?}", x.shape, y.shape);
    let rank = x.shape.len().max(y.shape.len());
    // With axes of length 1 in front, and strides of 0 where a length of 1 is spread.
    let padded = |v: &Value| [vec![1; rank - v.shape.len()], v.shape.clone()].concat();
    let strides = |of: &[usize]| -> Vec<usize> {
        (0..rank).map(|i| if of[i] == 1 { 0 } else { count(&of[i + 1..]) }).collect()
    };
    let (from_x, from_y) = (padded(&x), padded(&y));
    let common = |(x, y): (&usize, &usize)| match (*x, *y) {
        (x, y) if x == y || y == 1 => Some(x),
        (1, y) => Some(y),
        _ => None,
    };
    let shape: Option<Vec<usize>> = from_x.iter().zip(&from_y).map(common).collect();
    let shape = shape.ok_or_else(misfit)?;
    let terms = |v: &Value| v.sums.iter().map(|sum| sum.terms.len()).max().unwrap_or(0);
    let most = shape.iter().try_fold(1 + terms(&x) + terms(&y), |p: usize, &d| p.checked_mul(d));
    b.fits(most.unwrap_or(usize::MAX))?;
    let (strides_x, strides_y) = (strides(&from_x), strides(&from_y));
    let pairs = indices(&shape, &strides_x).zip(indices(&shape, &strides_y));
    let sums = pairs.map(|(i, j)| match (op, &x.sums[i], &y.sums[j]) {
        ("Add", x, y) => Ok(x.plus(1.0, y)),
        ("Sub", x, y) => Ok(x.plus(-1.0, y)),
        ("Mul", x, y) => x.times(y),
        (_, x, y) if !y.terms.is_empty() => Err(format!("divides {} by a value", x.offset)),
        (_, x, y) if x.terms.is_empty() => Ok(Sum { terms: Vec::new(), offset: x.offset / y.offset }),
        (_, x, y) => Ok(x.scaled(1.0 / y.offset)),
    });
    let sums = sums.collect::<Result<_, String>>()?;
    Ok(Value { shape, float: true, sums })
}

impl Sum {
    fn plus(&self, factor: f64, other: &Sum) -> Sum {
        let more = other.terms.iter().map(|(element, weight)| (*element, factor * weight));
        let terms = self.terms.iter().copied().chain(more).collect();
        Sum { terms, offset: self.offset + factor * other.offset }
    }

    fn scaled(&self, factor: f64) -> Sum {
        let terms = self.terms.iter().map(|(element, weight)| (*element, weight * factor)).collect();
        Sum { terms, offset: self.offset * factor }
    }

    fn times(&self, other: &Sum) -> Result<Sum, String> {
        match (self.terms.as_slice(), other.terms.as_slice()) {
            (_, []) => Ok(self.scaled(other.offset)),
            ([], _) => Ok(other.scaled(self.offset)),
            _ => Err("multiplies two values".into()),
        }
    }
}

/// The product of two matrices, one of them constant. Further axes in front have the length 1.
fn matmul(b: &mut Builder<'_>, x: Value, y: Value) -> Result<Value, String> {
    let misfit = || format!("of {:?} and {:?}", x.shape, y.shape);
    let ([batch @ .., m, k], &[k_too, n]) = (x.shape.as_slice(), y.shape.as_slice()) else {
        return Err(misfit());
    };
    let (m, k) = (*m, *k);
    if k != k_too || batch.iter().any(|&d| d != 1) {
        return Err(misfit());
    }
    let work = m.saturating_mul(n).saturating_mul(k + 1);
    b.fits(work)?;
    let shape = [batch, &[m, n]].concat();
    let (x, y) = (b.single(x)?.sums, b.single(y)?.sums);
    let mut sums = Vec::with_capacity(m * n);
    for (row, column) in (0..m).flat_map(|row| (0..n).map(move |column| (row, column))) {
        let mut sum = Sum { terms: Vec::with_capacity(k), offset: 0.0 };
        for (x, y) in x[row * k..][..k].iter().zip(y.iter().skip(column).step_by(n)) {
            let product = x.times(y)?;
            sum.offset += product.offset;
            sum.terms.extend(product.terms);
        }
        sums.push(sum);
    }
    let product = Value { shape, float: true, sums };
    // What the product holds is counted with its node. The rest is work on constants, which counts too.
    b.charge(work - product.size())?;
    Ok(product)
}

fn gemm(b: &mut Builder<'_>, node: &NodeProto) -> Result<Value, String> {
    let matrix = |index, turn| match floats(b, node, index)? {
        v if v.shape.len() != 2 => Err(format!("of {:?}", v.shape)),
        v if int(node, turn, 0) != 0 => Ok(v.permuted(&[1, 0])),
        v => Ok(v),
    };
    let (x, y) = (matrix(0, "transA")?, matrix(1, "transB")?);
    let (alpha, beta) = (float(node, "alpha", 1.0), float(node, "beta", 1.0));
    let mut product = matmul(b, x, y)?;
    product.sums.iter_mut().for_each(|sum| *sum = sum.scaled(alpha));
    if !has(node, 2) {
        return Ok(product);
    }
    let mut c = floats(b, node, 2)?;
    c.sums.iter_mut().for_each(|sum| *sum = sum.scaled(beta));
    let shape = product.shape.clone();
    let sum = elementwise(b, product, c, "Add")?;
    if sum.shape == shape { Ok(sum) } else { Err(format!("its C makes the shape {:?}", sum.shape)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broadcasting_follows_numpy() {
        let b = Builder {
            tensors: Default::default(),
            steps: Vec::new(),
            constant: Vec::new(),
            values: Default::default(),
            budget: 100,
            opset: 17,
        };
        let known = |shape: &[usize]| {
            let len = shape.iter().product::<usize>();
            Value::known(shape.to_vec(), (0..len).map(|x| x as f64), true)
        };
        for (x, y, shape, sums) in [
            (&[1, 3][..], &[3][..], &[1, 3][..], &[0.0, 2.0, 4.0][..]),
            (&[2, 1], &[1, 3], &[2, 3], &[0.0, 1.0, 2.0, 1.0, 2.0, 3.0]),
            (&[2, 3], &[3], &[2, 3], &[0.0, 2.0, 4.0, 3.0, 5.0, 7.0]),
            (&[], &[1, 2], &[1, 2], &[0.0, 1.0]),
        ] {
            let found = elementwise(&b, known(x), known(y), "Add").unwrap();
            let offsets: Vec<f64> = found.sums.iter().map(|sum| sum.offset).collect();
            assert_eq!((found.shape.as_slice(), offsets.as_slice()), (shape, sums), "{x:?} {y:?}");
        }
        assert!(elementwise(&b, known(&[2]), known(&[3]), "Add").is_err());
        assert!(elementwise(&b, known(&[20, 1]), known(&[20]), "Add").is_err());
    }

    #[test]
    fn adding_shares_common_inputs() {
        let sum = |terms: &[(usize, f64)], offset| Sum { terms: terms.to_vec(), offset };
        let (a, b) = (sum(&[(0, 1.0), (1, 2.0)], 3.0), sum(&[(1, 10.0), (2, 20.0)], 30.0));
        let c = super::super::Affine::new(&[a.plus(-1.0, &b)]);
        assert_eq!((c.inputs, c.weights, c.bias), (vec![0, 1, 2], vec![1.0, -8.0, -20.0], vec![-27.0]));
    }
}
