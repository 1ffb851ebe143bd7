//! Reads an ONNX file and refuses dangerous content: sizes that do not add up, references to other
//! files, graphs that are not in order. The rest is still only data; an executor may refuse it.

use crate::onnx::{AttributeProto, DataType, GraphProto, ModelProto, NodeProto, TensorProto};
use asperity_diagnostics::Diagnostic;
use prost::Message;
use std::collections::HashSet;
use std::path::Path;

/// Largest model file in bytes: thirty times a texture network.
pub const MAX_MODEL_BYTES: u64 = 64 << 20;
/// Largest encoder file in bytes. AlexNet's features with the paper's texture encoder have 166 MB.
pub const MAX_ENCODER_BYTES: u64 = 256 << 20;
/// Largest number of nodes in a graph.
const MAX_NODES: usize = 10_000;
/// `data_location` of a tensor whose numbers are in another file.
const EXTERNAL: i32 = 1;

/// Decodes a model. Its graph is unchecked.
pub(crate) fn decode(bytes: &[u8], path: &Path) -> Result<(ModelProto, GraphProto), Diagnostic> {
    let not_onnx = |what: String| {
        Diagnostic::new(what)
            .in_file(path)
            .help("a network is an ONNX file (.onnx), stored whole and not as text")
    };
    let mut model = ModelProto::decode(bytes)
        .map_err(|e| not_onnx(format!("this is not an ONNX model, or not all of one: {e}")))?;
    let Some(graph) = model.graph.take() else {
        return Err(not_onnx("this file holds no ONNX graph".into()));
    };
    if !model.functions.is_empty() {
        return Err(Diagnostic::new("this model defines functions of its own, which cannot be run")
            .in_file(path)
            .help("export it with functions inlined"));
    }
    Ok((model, graph))
}

/// Checks that every name is defined before it is read, and that all sizes add up.
pub(crate) fn check(graph: &GraphProto, path: &Path) -> Result<(), Diagnostic> {
    check_graph(graph).map_err(|what| Diagnostic::new(what).in_file(path))
}

fn check_graph(graph: &GraphProto) -> Result<(), String> {
    if graph.node.len() > MAX_NODES {
        return Err(format!("this graph has {} nodes; at most {MAX_NODES} are run", graph.node.len()));
    }
    if !graph.sparse_initializer.is_empty() {
        return Err("this model has sparse weights, which cannot be run".into());
    }
    let mut known: HashSet<&str> = HashSet::new();
    for tensor in &graph.initializer {
        check_tensor(tensor)?;
        known.insert(&tensor.name);
    }
    known.extend(graph.input.iter().map(|v| v.name.as_str()));
    let mut produced = HashSet::new();
    for node in &graph.node {
        for input in node.input.iter().filter(|name| !name.is_empty()) {
            if !known.contains(input.as_str()) {
                return Err(format!(
                    "{} reads \"{}\", which nothing before it gives",
                    title(node),
                    brief(input)
                ));
            }
        }
        for attribute in &node.attribute {
            attribute.t.iter().chain(&attribute.tensors).try_for_each(check_tensor)?;
            if attribute.sparse_tensor.is_some() || !attribute.sparse_tensors.is_empty() {
                return Err("this model has sparse weights, which cannot be run".into());
            }
            if attribute.g.is_some() || !attribute.graphs.is_empty() {
                return Err(format!("{} holds a graph of its own, which cannot be run", title(node)));
            }
        }
        for output in node.output.iter().filter(|name| !name.is_empty()) {
            if !produced.insert(output.as_str()) || !known.insert(output) {
                return Err(format!("{} gives \"{}\" a second time", title(node), brief(output)));
            }
        }
    }
    match graph.output.iter().find(|v| !known.contains(v.name.as_str())) {
        Some(v) => Err(format!("nothing gives the output \"{}\"", brief(&v.name))),
        None => Ok(()),
    }
}

/// Refuses a tensor with data elsewhere, or with a size that does not match its shape.
fn check_tensor(t: &TensorProto) -> Result<(), String> {
    let name = brief(&t.name);
    if t.data_location == Some(EXTERNAL) {
        return Err(format!("the weights \"{name}\" are in another file; store them inside this one"));
    }
    if t.dims.len() > 8 {
        return Err(format!("the weights \"{name}\" have {} dimensions", t.dims.len()));
    }
    let mut elements = 1u64;
    for &d in &t.dims {
        let next =
            u64::try_from(d).ok().and_then(|d| elements.checked_mul(d)).filter(|&n| n <= MAX_MODEL_BYTES);
        elements = next.ok_or_else(|| format!("the weights \"{name}\" have the shape {:?}", t.dims))?;
    }
    let unsupported = || format!("the weights \"{name}\" have an element type that cannot be run");
    let kind = DataType::try_from(t.data_type).map_err(|_| unsupported())?;
    let (width, typed) = match kind {
        DataType::Float => (4, t.float_data.len()),
        DataType::Double => (8, t.double_data.len()),
        DataType::Int64 => (8, t.int64_data.len()),
        DataType::Int32 => (4, t.int32_data.len()),
        DataType::Float16 | DataType::Int16 | DataType::Uint16 => (2, t.int32_data.len()),
        DataType::Int8 | DataType::Uint8 | DataType::Bool => (1, t.int32_data.len()),
        _ => return Err(unsupported()),
    };
    let found = if t.raw_data.is_empty() { typed as u64 } else { t.raw_data.len() as u64 / width };
    if found != elements || (!t.raw_data.is_empty() && t.raw_data.len() as u64 != elements * width) {
        return Err(format!("the weights \"{name}\" have the shape {:?} but {found} elements", t.dims));
    }
    // A single infinity may be the open end of a Clip.
    let bad = |x: &f64| x.is_nan() || (elements > 1 && x.is_infinite());
    if let Some(at) = values(t, kind).iter().position(bad) {
        return Err(format!("the weights \"{name}\" are not finite at element {at}"));
    }
    Ok(())
}

/// All elements of a tensor as f64, row by row.
pub(crate) fn numbers(t: &TensorProto) -> Result<Vec<f64>, String> {
    check_tensor(t)?;
    let kind = DataType::try_from(t.data_type).map_err(|_| "unknown element type".to_owned())?;
    Ok(values(t, kind))
}

fn values(t: &TensorProto, kind: DataType) -> Vec<f64> {
    if t.raw_data.is_empty() {
        return match kind {
            DataType::Float => t.float_data.iter().map(|&x| f64::from(x)).collect(),
            DataType::Double => t.double_data.clone(),
            DataType::Int64 => t.int64_data.iter().map(|&x| x as f64).collect(),
            DataType::Float16 => {
                t.int32_data.iter().map(|&x| half::f16::from_bits(x as u16).to_f64()).collect()
            }
            _ => t.int32_data.iter().map(|&x| f64::from(x)).collect(),
        };
    }
    fn each<const N: usize>(raw: &[u8], f: impl Fn([u8; N]) -> f64) -> Vec<f64> {
        raw.as_chunks::<N>().0.iter().map(|&b| f(b)).collect()
    }
    let raw = &t.raw_data;
    match kind {
        DataType::Float => each(raw, |b| f64::from(f32::from_le_bytes(b))),
        DataType::Double => each(raw, f64::from_le_bytes),
        DataType::Int64 => each(raw, |b| i64::from_le_bytes(b) as f64),
        DataType::Int32 => each(raw, |b| f64::from(i32::from_le_bytes(b))),
        DataType::Float16 => each(raw, |b| half::f16::from_le_bytes(b).to_f64()),
        DataType::Int16 => each(raw, |b| f64::from(i16::from_le_bytes(b))),
        DataType::Uint16 => each(raw, |b| f64::from(u16::from_le_bytes(b))),
        DataType::Int8 => each(raw, |b: [u8; 1]| f64::from(b[0] as i8)),
        _ => each(raw, |b: [u8; 1]| f64::from(b[0])),
    }
}

/// An attribute by name.
pub(crate) fn attribute<'a>(node: &'a NodeProto, name: &str) -> Option<&'a AttributeProto> {
    node.attribute.iter().find(|a| a.name == name)
}

/// A node in messages: its operator and name.
pub(crate) fn title(node: &NodeProto) -> String {
    match node.name.as_str() {
        "" => format!("a node {}", brief(&node.op_type)),
        name => format!("node \"{}\" ({})", brief(name), brief(&node.op_type)),
    }
}

fn brief(name: &str) -> String {
    name.chars().take(60).flat_map(char::escape_default).collect()
}
