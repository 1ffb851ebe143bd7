//! Inputs and outputs of a texture network, and how they are found in a file.

use crate::onnx::{DataType, Dimension, DimensionValue, GraphProto, TensorTypeProto, ValueInfoProto};
use asperity_diagnostics::Diagnostic;
use std::path::Path;

/// Length of the force history: normal forces in N, oldest first.
pub const FORCE_LEN: usize = 10;
/// Length of the velocity history: 10 x-velocities, then 10 y-velocities, in mm/s, oldest first.
pub const SPEED_LEN: usize = 20;
/// Length of a texture's latent vector.
pub const TEXTURE_LEN: usize = 256;
/// Number of predicted magnitudes: bin 1 (10 Hz) to bin 100 (1000 Hz).
pub const MAGNITUDES_LEN: usize = 100;

/// Description of a valid network, for errors.
pub(crate) const WANTED: &str = "a texture network has the float inputs force [1,10], speed [1,20] and \
                                 texture [1,256], and the float output magnitudes [1,100]. Optional, \
                                 together: the float outputs ratio [1,100] and variance [1,1]";

/// Outputs for the scatter of magnitudes, with their lengths.
const SCATTER: [(&str, usize); 2] = [("ratio", MAGNITUDES_LEN), ("variance", 1)];

/// One of the three inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Role {
    Force,
    Speed,
    Texture,
}

impl Role {
    pub(crate) const ALL: [Role; 3] = [Role::Force, Role::Speed, Role::Texture];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Role::Force => "force",
            Role::Speed => "speed",
            Role::Texture => "texture",
        }
    }

    /// Its place among all inputs, one after the other.
    pub(crate) fn place(self) -> std::ops::Range<usize> {
        match self {
            Role::Force => 0..FORCE_LEN,
            Role::Speed => FORCE_LEN..FORCE_LEN + SPEED_LEN,
            Role::Texture => FORCE_LEN + SPEED_LEN..FORCE_LEN + SPEED_LEN + TEXTURE_LEN,
        }
    }

    pub(crate) fn len(self) -> usize {
        self.place().len()
    }
}

/// Roles of the graph's inputs and outputs.
#[derive(Clone, Debug)]
pub(crate) struct Signature {
    /// Names of the graph's inputs in the file's order, with their roles.
    pub(crate) inputs: Vec<(String, Role)>,
    /// Names of the magnitudes and, if present, of ratio and variance, with their lengths.
    pub(crate) outputs: Vec<(String, usize)>,
}

/// The inputs that are fed, without those that only declare an initializer (IR version 3).
pub(crate) fn fed_inputs(graph: &GraphProto) -> impl Iterator<Item = &ValueInfoProto> {
    let constants: std::collections::HashSet<&str> =
        graph.initializer.iter().map(|t| t.name.as_str()).collect();
    graph.input.iter().filter(move |input| !constants.contains(input.name.as_str()))
}

/// An error over a graph, with the inputs and outputs found.
pub(crate) fn refused(what: &str, graph: &GraphProto, path: &Path, wanted: &str) -> Diagnostic {
    let list = |values: Vec<&ValueInfoProto>| match values.len() {
        0 => "none".to_owned(),
        n => {
            let more = if n > 8 { format!(" and {} more", n - 8) } else { String::new() };
            values.iter().take(8).map(|v| describe(v)).collect::<Vec<_>>().join(", ") + &more
        }
    };
    let (inputs, outputs) = (list(fed_inputs(graph).collect()), list(graph.output.iter().collect()));
    Diagnostic::new(format!("{what}; found inputs: {inputs}; outputs: {outputs}")).in_file(path).help(wanted)
}

/// Finds inputs and magnitudes by name, else by shape; ratio and variance by name.
pub(crate) fn match_signature(graph: &GraphProto, path: &Path) -> Result<Signature, Diagnostic> {
    signature(graph).map_err(|what| refused(&what, graph, path, WANTED))
}

fn signature(graph: &GraphProto) -> Result<Signature, String> {
    let is = |v: &ValueInfoProto, name: &str| v.name.eq_ignore_ascii_case(name);
    let inputs: Vec<&ValueInfoProto> = fed_inputs(graph).collect();
    if inputs.len() != Role::ALL.len() {
        return Err(format!("this model has {} inputs, not 3", inputs.len()));
    }
    let matched = |input: &ValueInfoProto| {
        let named = Role::ALL.into_iter().find(|role| is(input, role.name()));
        let fitting = || Role::ALL.into_iter().find(|role| row_len(input) == Some(role.len()));
        let found = describe(input);
        match named.or_else(fitting) {
            None => Err(format!("input {found} is not force, speed or texture")),
            Some(role) if row_len(input) != Some(role.len()) => {
                Err(format!("input {found} does not fit [1,{}]", role.len()))
            }
            Some(_) if !is_float(input) => Err(format!("input {found} is not 32-bit float")),
            Some(role) => Ok((input.name.clone(), role)),
        }
    };
    let matched = inputs.into_iter().map(matched).collect::<Result<Vec<_>, String>>()?;
    let twice = |role: &Role| matched.iter().filter(|(_, r)| r == role).count() > 1;
    if let Some(role) = Role::ALL.into_iter().find(twice) {
        return Err(format!("two inputs could be {}", role.name()));
    }

    let of = |name: &str| graph.output.iter().find(|v| is(v, name));
    let magnitudes = of("magnitudes");
    let scatter = |v: &ValueInfoProto| SCATTER.iter().any(|(name, _)| is(v, name));
    let fits =
        |v: &&ValueInfoProto| magnitudes.is_none() && row_len(v) == Some(MAGNITUDES_LEN) && !scatter(v);
    let mut found = magnitudes.into_iter().chain(graph.output.iter().filter(fits));
    let none = || format!("no output is named magnitudes or has shape [1,{MAGNITUDES_LEN}]");
    let mut outputs = vec![(found.next().ok_or_else(none)?, MAGNITUDES_LEN)];
    if found.next().is_some() {
        return Err("two outputs could be magnitudes".into());
    }
    match SCATTER.map(|(name, len)| (of(name), len)) {
        [(None, _), (None, _)] => {}
        [(Some(ratio), r), (Some(variance), v)] => outputs.extend([(ratio, r), (variance, v)]),
        [(Some(_), _), _] => return Err("this model has the output ratio, but not variance".into()),
        _ => return Err("this model has the output variance, but not ratio".into()),
    }
    // A file may leave an output's shape open. The typed graph is checked later.
    let misfit = |(v, len): &&(&ValueInfoProto, usize)| {
        shape(v).is_some() && row_len(v) != Some(*len) && !has_open_row(v)
    };
    if let Some((output, len)) = outputs.iter().find(misfit) {
        return Err(format!("output {} does not fit [1,{len}]", describe(output)));
    }
    let outputs = outputs.into_iter().map(|(output, len)| (output.name.clone(), len)).collect();
    Ok(Signature { inputs: matched, outputs })
}

pub(crate) fn shape(v: &ValueInfoProto) -> Option<Vec<Option<i64>>> {
    let size = |d: &Dimension| match d.value {
        Some(DimensionValue::Size(n)) => Some(n),
        _ => None,
    };
    Some(tensor(v)?.shape.as_ref()?.dim.iter().map(size).collect())
}

/// n of `[1,n]`, where the 1 may be a free batch size.
fn row_len(v: &ValueInfoProto) -> Option<usize> {
    match shape(v)?.as_slice() {
        [None | Some(1), Some(n)] => usize::try_from(*n).ok(),
        _ => None,
    }
}

fn has_open_row(v: &ValueInfoProto) -> bool {
    matches!(shape(v).as_deref(), Some([None | Some(1), None]))
}

pub(crate) fn is_float(v: &ValueInfoProto) -> bool {
    tensor(v).is_some_and(|t| t.elem_type == DataType::Float as i32)
}

fn tensor(v: &ValueInfoProto) -> Option<&TensorTypeProto> {
    v.r#type.as_ref()?.tensor_type.as_ref()
}

/// `name [1,10]`, with `?` for a free dimension. A very long name is cut.
pub(crate) fn describe(v: &ValueInfoProto) -> String {
    let name: String = v.name.chars().take(40).flat_map(char::escape_default).collect();
    match shape(v) {
        None => format!("{name} [shape not given]"),
        Some(dims) => {
            let mut text: Vec<String> =
                dims.iter().take(8).map(|d| d.map_or("?".to_owned(), |n| n.to_string())).collect();
            if dims.len() > 8 {
                text.push("...".to_owned());
            }
            format!("{name} [{}]", text.join(","))
        }
    }
}
