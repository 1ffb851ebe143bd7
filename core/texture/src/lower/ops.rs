//! Lowers single ONNX operators, as the ONNX operator reference defines them, operator sets 7 and later.

use super::value::{self, Affine, Content, Element, Value};
use super::{Builder, End, elements_of};
use crate::onnx::{DataType, NodeProto};
use crate::proto::attribute;

pub(super) fn lower(b: &mut Builder, node: &NodeProto) -> Result<Value, String> {
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
        "Add" | "Sub" | "Mul" | "Div" => elementwise(b, node),
        "Relu" => {
            let v = input(b, node, 0)?;
            clamp(b, v, 0.0, f64::INFINITY)
        }
        "Exp" => {
            let v = input(b, node, 0)?;
            end(b, v, End::Exponential)
        }
        "Clip" => clip(b, node),
        "Max" | "Min" => max_min(b, node),
        "MatMul" => {
            let (x, y) = (input(b, node, 0)?, input(b, node, 1)?);
            matmul(b, x, y)
        }
        "Gemm" => gemm(b, node),
        _ => Err("not one of a multilayer perceptron's operators".into()),
    }
}

fn optional(b: &Builder, node: &NodeProto, index: usize) -> Option<Value> {
    node.input.get(index).filter(|name| !name.is_empty()).and_then(|name| b.values.get(name)).cloned()
}

fn input(b: &Builder, node: &NodeProto, index: usize) -> Result<Value, String> {
    optional(b, node, index).ok_or_else(|| format!("input {index} is missing"))
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

/// A list from an attribute (older operator sets) or a constant input.
fn list(b: &Builder, node: &NodeProto, name: &str, index: usize) -> Result<Option<Vec<i64>>, String> {
    if let Some(a) = attribute(node, name) {
        return Ok(Some(a.ints.clone()));
    }
    match optional(b, node, index).map(|v| v.content) {
        None => Ok(None),
        Some(Content::Constant { data, float: false }) => Ok(Some(data.iter().map(|&x| x as i64).collect())),
        Some(_) => Err(format!("{name} is not a constant list of integers")),
    }
}

/// A single constant, or the default.
fn scalar(b: &Builder, node: &NodeProto, index: usize, default: f64) -> Result<f64, String> {
    match optional(b, node, index).map(|v| v.content) {
        None => Ok(default),
        Some(Content::Constant { data, float: true }) if data.len() == 1 => Ok(data[0]),
        Some(_) => Err(format!("input {index} is not a single constant")),
    }
}

fn constant(b: &mut Builder, node: &NodeProto) -> Result<Value, String> {
    let Some(a) = node.attribute.first() else { return Err("without a value".into()) };
    let (shape, data, float) = match a.name.as_str() {
        "value" => {
            let t = a.t.as_ref().ok_or("without a value")?;
            return b.constant(t);
        }
        "value_float" => (vec![], vec![f64::from(a.f)], true),
        "value_floats" => (vec![a.floats.len()], a.floats.iter().map(|&x| f64::from(x)).collect(), true),
        "value_int" => (vec![], vec![a.i as f64], false),
        "value_ints" => (vec![a.ints.len()], a.ints.iter().map(|&x| x as f64).collect(), false),
        _ => return Err("of an unusual kind".into()),
    };
    Ok(Value { shape, content: Content::Constant { data, float } })
}

fn cast(b: &Builder, node: &NodeProto) -> Result<Value, String> {
    let v = input(b, node, 0)?;
    if int(node, "to", 0) != DataType::Float as i64 {
        return Err("to something else than 32-bit float".into());
    }
    let content = match v.content {
        Content::Constant { data, .. } => {
            Content::Constant { data: data.iter().map(|&x| f64::from(x as f32)).collect(), float: true }
        }
        other => other,
    };
    Ok(Value { shape: v.shape, content })
}

fn with_shape(v: Value, shape: Vec<usize>) -> Result<Value, String> {
    if shape.iter().try_fold(1usize, |p, &d| p.checked_mul(d)) != Some(v.content.len()) {
        return Err(format!("{:?} cannot become {shape:?}", v.shape));
    }
    Ok(Value { shape, content: v.content })
}

fn reshape(b: &Builder, node: &NodeProto) -> Result<Value, String> {
    let v = input(b, node, 0)?;
    let wanted = list(b, node, "shape", 1)?.ok_or("without a shape")?;
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
    let rest = v.content.len() / known;
    with_shape(v, shape.into_iter().map(|d| d.unwrap_or(rest)).collect())
}

fn flatten(b: &Builder, node: &NodeProto) -> Result<Value, String> {
    let v = input(b, node, 0)?;
    let rank = v.shape.len();
    let at = match int(node, "axis", 1) {
        i if i == rank as i64 => rank,
        i => axis(i, rank)?,
    };
    let shape = vec![v.shape[..at].iter().product(), v.shape[at..].iter().product()];
    with_shape(v, shape)
}

fn squeeze(b: &Builder, node: &NodeProto) -> Result<Value, String> {
    let v = input(b, node, 0)?;
    let rank = v.shape.len();
    let drop: Vec<usize> = match list(b, node, "axes", 1)? {
        Some(axes) => axes.iter().map(|&i| axis(i, rank)).collect::<Result<_, _>>()?,
        None => (0..rank).filter(|&i| v.shape[i] == 1).collect(),
    };
    let shape = (0..rank).filter(|i| !drop.contains(i)).map(|i| v.shape[i]).collect();
    with_shape(v, shape)
}

fn unsqueeze(b: &Builder, node: &NodeProto) -> Result<Value, String> {
    let v = input(b, node, 0)?;
    let axes = list(b, node, "axes", 1)?.ok_or("without axes")?;
    let rank = v.shape.len() + axes.len();
    let added: Vec<usize> = axes.iter().map(|&i| axis(i, rank)).collect::<Result<_, _>>()?;
    let mut old = v.shape.iter();
    let shape =
        (0..rank).filter_map(|i| if added.contains(&i) { Some(1) } else { old.next().copied() }).collect();
    with_shape(v, shape)
}

fn transpose(b: &Builder, node: &NodeProto) -> Result<Value, String> {
    let v = input(b, node, 0)?;
    let rank = v.shape.len();
    let order: Vec<usize> = match attribute(node, "perm") {
        Some(a) => a.ints.iter().map(|&i| axis(i, rank)).collect::<Result<_, _>>()?,
        None => (0..rank).rev().collect(),
    };
    if order.len() != rank || (0..rank).any(|i| !order.contains(&i)) {
        return Err("its perm is no permutation".into());
    }
    let shape: Vec<usize> = order.iter().map(|&i| v.shape[i]).collect();
    // Moving axes of length 1 leaves the elements in place.
    let long: Vec<usize> = order.iter().copied().filter(|&i| v.shape[i] != 1).collect();
    if long.is_sorted() {
        return with_shape(v, shape);
    }
    match (v.content, order.as_slice(), v.shape.as_slice()) {
        (Content::Constant { data, float }, [1, 0], &[rows, columns]) => {
            let data =
                (0..columns).flat_map(|c| (0..rows).map(move |r| (r, c))).map(|(r, c)| data[r * columns + c]);
            Ok(Value { shape, content: Content::Constant { data: data.collect(), float } })
        }
        _ => Err("of more than a constant matrix".into()),
    }
}

fn concat(b: &mut Builder, node: &NodeProto) -> Result<Value, String> {
    let first = input(b, node, 0)?.shape;
    let at = axis(int(node, "axis", 1), first.len())?;
    if first[..at].iter().any(|&d| d != 1) {
        return Err("along an axis that is not the outermost long one".into());
    }
    let mut shape = first.clone();
    shape[at] = 0;
    let mut elements = Vec::new();
    for i in 0..node.input.len() {
        let v = input(b, node, i)?;
        let fits =
            v.shape.len() == first.len() && (0..first.len()).all(|i| i == at || v.shape[i] == first[i]);
        if !fits {
            return Err(format!("of {first:?} and {:?}", v.shape));
        }
        shape[at] += v.shape[at];
        elements.extend(b.elements(v.content)?);
        b.charge(elements.len())?;
    }
    Ok(Value { shape, content: Content::Elements(elements) })
}

fn clamp(b: &mut Builder, v: Value, low: f64, high: f64) -> Result<Value, String> {
    if low.is_nan() || high.is_nan() || low > high {
        return Err(format!("clamps to {low}..{high}"));
    }
    end(b, v, End::Clamp(low, high))
}

/// Makes a step of a value.
fn end(b: &mut Builder, v: Value, end: End) -> Result<Value, String> {
    let len = v.content.len();
    let step = b.materialise(v.content, end)?;
    Ok(Value { shape: v.shape, content: Content::Elements(elements_of(step, len)) })
}

fn clip(b: &mut Builder, node: &NodeProto) -> Result<Value, String> {
    let v = input(b, node, 0)?;
    let (low, high) = if b.opset < 11 {
        (float(node, "min", f32::MIN), float(node, "max", f32::MAX))
    } else {
        (scalar(b, node, 1, f64::NEG_INFINITY)?, scalar(b, node, 2, f64::INFINITY)?)
    };
    clamp(b, v, low, high)
}

fn max_min(b: &mut Builder, node: &NodeProto) -> Result<Value, String> {
    let (x, y) = (input(b, node, 0)?, input(b, node, 1)?);
    let (v, c) = match (x, y) {
        (Value { content: Content::Constant { data, float: true }, .. }, v)
        | (v, Value { content: Content::Constant { data, float: true }, .. })
            if node.input.len() == 2 && data.len() == 1 =>
        {
            (v, data[0])
        }
        _ => return Err("of other than a value and a single constant".into()),
    };
    if node.op_type == "Max" { clamp(b, v, c, f64::INFINITY) } else { clamp(b, v, f64::NEG_INFINITY, c) }
}

fn elementwise(b: &mut Builder, node: &NodeProto) -> Result<Value, String> {
    let (x, y) = (input(b, node, 0)?, input(b, node, 1)?);
    let shape =
        value::broadcast(&x.shape, &y.shape).ok_or_else(|| format!("of {:?} and {:?}", x.shape, y.shape))?;
    let len = shape.iter().try_fold(1usize, |p, &d| p.checked_mul(d)).ok_or("too large")?;
    b.charge(len)?;
    let op = node.op_type.as_str();
    let spread = |data: &[f64], from: &[usize]| -> Vec<f64> {
        value::broadcast_indices(from, &shape).into_iter().map(|i| data[i]).collect()
    };
    let content = match (x.content, y.content) {
        (Content::Constant { data: p, float: true }, Content::Constant { data: q, float: true }) => {
            let data = spread(&p, &x.shape)
                .iter()
                .zip(spread(&q, &y.shape))
                .map(|(&p, q)| apply(op, p, q))
                .collect();
            Content::Constant { data, float: true }
        }
        (v, Content::Constant { data, float: true }) if v.len() == len => {
            let c = spread(&data, &y.shape);
            match op {
                "Add" => rescale(v, |_| 1.0, |j| c[j]),
                "Sub" => rescale(v, |_| 1.0, |j| -c[j]),
                "Mul" => rescale(v, |j| c[j], |_| 0.0),
                _ => rescale(v, |j| 1.0 / c[j], |_| 0.0),
            }
        }
        (Content::Constant { data, float: true }, v) if v.len() == len => {
            let c = spread(&data, &x.shape);
            match op {
                "Add" => rescale(v, |_| 1.0, |j| c[j]),
                "Sub" => rescale(v, |_| -1.0, |j| c[j]),
                "Mul" => rescale(v, |j| c[j], |_| 0.0),
                _ => return Err("divides a constant by a value".into()),
            }
        }
        (Content::Constant { .. }, _) | (_, Content::Constant { .. }) => {
            return Err("spreads a value, or uses integers".into());
        }
        (v, w) if v.len() == len && w.len() == len && matches!(op, "Add" | "Sub") => {
            let (v, w) = (affine(b, v)?, affine(b, w)?);
            b.charge(v.weights.len() + w.weights.len())?;
            Content::Affine(value::add(v, &w, if op == "Add" { 1.0 } else { -1.0 }))
        }
        _ => return Err("combines two values".into()),
    };
    Ok(Value { shape, content })
}

fn apply(op: &str, p: f64, q: f64) -> f64 {
    match op {
        "Add" => p + q,
        "Sub" => p - q,
        "Mul" => p * q,
        _ => p / q,
    }
}

/// Multiplies each element by its scale, then adds its offset. Not for constants.
fn rescale(content: Content, scale: impl Fn(usize) -> f64, offset: impl Fn(usize) -> f64) -> Content {
    match content {
        Content::Affine(mut a) => {
            value::scale_columns(&mut a, scale, offset);
            Content::Affine(a)
        }
        Content::Elements(mut elements) => {
            for (j, e) in elements.iter_mut().enumerate() {
                *e = Element { of: e.of, scale: e.scale * scale(j), offset: e.offset * scale(j) + offset(j) };
            }
            Content::Elements(elements)
        }
        constant => constant,
    }
}

fn affine(b: &mut Builder, content: Content) -> Result<Affine, String> {
    match content {
        Content::Affine(a) => Ok(a),
        other => {
            let elements = b.elements(other)?;
            b.charge(elements.len().saturating_mul(elements.len()))?;
            Ok(value::diagonal(&elements))
        }
    }
}

/// A row times a constant matrix, or a constant matrix times a column.
fn matmul(b: &mut Builder, x: Value, y: Value) -> Result<Value, String> {
    let misfit = || format!("of {:?} and {:?}", x.shape, y.shape);
    let row = x.shape.split_last().filter(|(_, batch)| batch.iter().all(|&d| d == 1)).map(|(&k, _)| k);
    match (x.content, y.content) {
        (Content::Constant { data, float: true }, v) if !matches!(v, Content::Constant { .. }) => {
            let (&[n, k], [k_too, 1]) = (x.shape.as_slice(), y.shape.as_slice()) else {
                return Err(misfit());
            };
            if k != *k_too {
                return Err(misfit());
            }
            let a = product(b, v, n, |k_at, j| data[j * k + k_at])?;
            Ok(Value { shape: vec![n, 1], content: Content::Affine(a) })
        }
        (v, Content::Constant { data, float: true }) if !matches!(v, Content::Constant { .. }) => {
            let (Some(k), &[k_too, n]) = (row, y.shape.as_slice()) else { return Err(misfit()) };
            if k != k_too || x.shape.len() < 2 {
                return Err(misfit());
            }
            let a = product(b, v, n, |k_at, j| data[k_at * n + j])?;
            let mut shape = x.shape.clone();
            shape.pop();
            shape.push(n);
            Ok(Value { shape, content: Content::Affine(a) })
        }
        _ => Err("of other than one value and one constant matrix".into()),
    }
}

fn product(
    b: &mut Builder,
    v: Content,
    n: usize,
    at: impl Fn(usize, usize) -> f64,
) -> Result<Affine, String> {
    let elements = b.elements(v)?;
    b.charge(elements.len().saturating_mul(n))?;
    Ok(value::multiply(&elements, n, at))
}

fn gemm(b: &mut Builder, node: &NodeProto) -> Result<Value, String> {
    let (x, y, c) = (input(b, node, 0)?, input(b, node, 1)?, optional(b, node, 2));
    let (alpha, beta) = (float(node, "alpha", 1.0), float(node, "beta", 1.0));
    let [rows, columns] = x.shape[..] else { return Err(format!("of {:?}", x.shape)) };
    let k = if int(node, "transA", 0) == 0 {
        (rows == 1).then_some(columns)
    } else {
        (columns == 1).then_some(rows)
    };
    let (Some(k), &[y0, y1]) = (k, y.shape.as_slice()) else {
        return Err(format!("of {:?} and {:?}", x.shape, y.shape));
    };
    let turned = int(node, "transB", 0) != 0;
    let (k_too, n) = if turned { (y1, y0) } else { (y0, y1) };
    let Content::Constant { data, float: true } = &y.content else {
        return Err("its B is not constant".into());
    };
    if matches!(x.content, Content::Constant { .. }) || k != k_too {
        return Err(format!("of {:?} and {:?}", x.shape, y.shape));
    }
    let mut a = product(b, x.content, n, |k_at, j| {
        alpha * if turned { data[j * k + k_at] } else { data[k_at * n + j] }
    })?;
    if let Some(c) = c {
        let Content::Constant { data, float: true } = &c.content else {
            return Err("its C is not constant".into());
        };
        if value::broadcast(&c.shape, &[1, n]).as_deref() != Some(&[1, n]) {
            return Err(format!("its C has the shape {:?}", c.shape));
        }
        for (bias, i) in a.bias.iter_mut().zip(value::broadcast_indices(&c.shape, &[1, n])) {
            *bias += beta * data[i];
        }
    }
    Ok(Value { shape: vec![1, n], content: Content::Affine(a) })
}
