//! A tensor's content while a graph is lowered, and its arithmetic (in f64).

/// Element `index` of the result of step `step`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Ref {
    pub(crate) step: usize,
    pub(crate) index: usize,
}

/// `scale * of + offset`; a constant without `of`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element {
    pub(crate) of: Option<Ref>,
    pub(crate) scale: f64,
    pub(crate) offset: f64,
}

/// `sum_k inputs[k] * weights[k * n + j] + bias[j]`, n = `bias.len()`.
#[derive(Clone, Debug, Default)]
pub(crate) struct Affine {
    pub(crate) inputs: Vec<Ref>,
    pub(crate) weights: Vec<f64>,
    pub(crate) bias: Vec<f64>,
}

/// A tensor: known, or a function of earlier results, in row-major order.
#[derive(Clone, Debug)]
pub(super) enum Content {
    Constant {
        data: Vec<f64>,
        float: bool,
    },
    /// Each element depends on one earlier element.
    Elements(Vec<Element>),
    /// Each element depends on all inputs.
    Affine(Affine),
}

#[derive(Clone, Debug)]
pub(super) struct Value {
    pub(super) shape: Vec<usize>,
    pub(super) content: Content,
}

impl Content {
    pub(super) fn len(&self) -> usize {
        match self {
            Content::Constant { data, .. } => data.len(),
            Content::Elements(e) => e.len(),
            Content::Affine(a) => a.bias.len(),
        }
    }

    /// Numbers held, to count memory.
    pub(super) fn size(&self) -> usize {
        match self {
            Content::Affine(a) => a.weights.len() + a.bias.len(),
            other => other.len(),
        }
    }
}

/// The elements of a result.
pub(super) fn elements_of(step: usize, len: usize) -> Vec<Element> {
    (0..len).map(|index| Element { of: Some(Ref { step, index }), scale: 1.0, offset: 0.0 }).collect()
}

/// `elements` times a matrix given by `at(row, column)`.
pub(super) fn multiply(elements: &[Element], n: usize, at: impl Fn(usize, usize) -> f64) -> Affine {
    let mut out = Affine { bias: vec![0.0; n], ..Affine::default() };
    for (k, e) in elements.iter().enumerate() {
        if e.offset != 0.0 {
            for (j, b) in out.bias.iter_mut().enumerate() {
                *b += e.offset * at(k, j);
            }
        }
        if let Some(of) = e.of {
            out.inputs.push(of);
            out.weights.extend((0..n).map(|j| e.scale * at(k, j)));
        }
    }
    out
}

/// Multiplies column j by `scale(j)` and adds `offset(j)`.
pub(super) fn scale_columns(a: &mut Affine, scale: impl Fn(usize) -> f64, offset: impl Fn(usize) -> f64) {
    let n = a.bias.len();
    for (i, w) in a.weights.iter_mut().enumerate() {
        *w *= scale(i % n);
    }
    for (j, b) in a.bias.iter_mut().enumerate() {
        *b = *b * scale(j) + offset(j);
    }
}

/// Elements with a column each, to add to an affine map.
pub(crate) fn diagonal(elements: &[Element]) -> Affine {
    multiply(elements, elements.len(), |k, j| if k == j { 1.0 } else { 0.0 })
}

/// `a + sign * b`, sharing common inputs.
pub(super) fn add(mut a: Affine, b: &Affine, sign: f64) -> Affine {
    let n = a.bias.len();
    let mut rows: std::collections::BTreeMap<Ref, usize> = a.inputs.iter().copied().zip(0..).collect();
    for (k, &input) in b.inputs.iter().enumerate() {
        let row = *rows.entry(input).or_insert_with(|| {
            a.inputs.push(input);
            a.weights.extend(std::iter::repeat_n(0.0, n));
            a.inputs.len() - 1
        });
        for (to, from) in a.weights[row * n..(row + 1) * n].iter_mut().zip(&b.weights[k * n..(k + 1) * n]) {
            *to += sign * from;
        }
    }
    for (to, from) in a.bias.iter_mut().zip(&b.bias) {
        *to += sign * from;
    }
    a
}

/// Common shape by NumPy broadcasting.
pub(super) fn broadcast(a: &[usize], b: &[usize]) -> Option<Vec<usize>> {
    let rank = a.len().max(b.len());
    let at = |s: &[usize], i: usize| (i + s.len()).checked_sub(rank).map_or(1, |k| s[k]);
    (0..rank)
        .map(|i| match (at(a, i), at(b, i)) {
            (x, y) if x == y => Some(x),
            (1, y) => Some(y),
            (x, 1) => Some(x),
            _ => None,
        })
        .collect()
}

/// For each element of `to`, row by row, the element it reads of a tensor of shape `from`.
pub(super) fn broadcast_indices(from: &[usize], to: &[usize]) -> Vec<usize> {
    let len: usize = to.iter().product();
    (0..len)
        .map(|linear| {
            let (mut rest, mut index, mut stride) = (linear, 0, 1);
            for i in (0..to.len()).rev() {
                let position = rest % to[i];
                rest /= to[i];
                if let Some(k) = (i + from.len()).checked_sub(to.len()) {
                    if from[k] != 1 {
                        index += position * stride;
                    }
                    stride *= from[k];
                }
            }
            index
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broadcasting_follows_numpy() {
        assert_eq!(broadcast(&[1, 3], &[3]), Some(vec![1, 3]));
        assert_eq!(broadcast(&[2, 1], &[1, 3]), Some(vec![2, 3]));
        assert_eq!(broadcast(&[2], &[3]), None);
        assert_eq!(broadcast_indices(&[2, 1], &[2, 3]), [0, 0, 0, 1, 1, 1]);
        assert_eq!(broadcast_indices(&[3], &[2, 3]), [0, 1, 2, 0, 1, 2]);
        assert_eq!(broadcast_indices(&[], &[1, 2]), [0, 0]);
    }

    #[test]
    fn adding_shares_common_inputs() {
        let r = |index| Ref { step: 0, index };
        let a = Affine { inputs: vec![r(0), r(1)], weights: vec![1.0, 2.0], bias: vec![3.0] };
        let b = Affine { inputs: vec![r(1), r(2)], weights: vec![10.0, 20.0], bias: vec![30.0] };
        let c = add(a, &b, -1.0);
        assert_eq!(c.inputs, [r(0), r(1), r(2)]);
        assert_eq!(c.weights, [1.0, -8.0, -20.0]);
        assert_eq!(c.bias, [-27.0]);
    }
}
