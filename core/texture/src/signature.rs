//! Inputs and outputs of a texture network, and how they are found in a file.

use crate::onnx::{DataType, DimensionValue, GraphProto, TensorTypeProto, ValueInfoProto};
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
                                 texture [1,256] and the float output magnitudes [1,100]; it may also \
                                 have the float outputs ratio [1,100] and variance [1,1], both or neither";

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

    pub(crate) fn len(self) -> usize {
        match self {
            Role::Force => FORCE_LEN,
            Role::Speed => SPEED_LEN,
            Role::Texture => TEXTURE_LEN,
        }
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

/// Finds inputs and magnitudes by name, else by shape; ratio and variance by name.
pub(crate) fn match_signature(graph: &GraphProto, path: &Path) -> Result<Signature, Diagnostic> {
    let refuse = |what: String| {
        let found = |values: Vec<&ValueInfoProto>| match values.len() {
            0 => "none".to_owned(),
            n => {
                let mut list = values.iter().take(8).map(|v| describe(v)).collect::<Vec<_>>().join(", ");
                if n > 8 {
                    list.push_str(&format!(" and {} more", n - 8));
                }
                list
            }
        };
        Diagnostic::new(format!(
            "{what}; found inputs: {}; outputs: {}",
            found(fed_inputs(graph).collect()),
            found(graph.output.iter().collect())
        ))
        .in_file(path)
        .help(WANTED)
    };

    let inputs: Vec<&ValueInfoProto> = fed_inputs(graph).collect();
    if inputs.len() != Role::ALL.len() {
        return Err(refuse(format!("this model has {} inputs, not 3", inputs.len())));
    }
    let mut roles: Vec<Option<Role>> = vec![None; inputs.len()];
    for role in Role::ALL {
        let mut named = inputs.iter().position(|v| v.name.eq_ignore_ascii_case(role.name()));
        if named.is_none() {
            // The three widths differ, so at most one input fits unless shapes repeat.
            let mut fits = inputs.iter().enumerate().filter(|(i, v)| {
                let taken_by_name = Role::ALL.iter().any(|r| v.name.eq_ignore_ascii_case(r.name()));
                roles[*i].is_none() && !taken_by_name && row_len(v) == Some(role.len())
            });
            named = fits.next().map(|(i, _)| i);
            if fits.next().is_some() {
                return Err(refuse(format!("two inputs could be {}", role.name())));
            }
        }
        let Some(index) = named else {
            return Err(refuse(format!("no input is named {} or has shape [1,{}]", role.name(), role.len())));
        };
        if row_len(inputs[index]) != Some(role.len()) {
            return Err(refuse(format!("input {} does not fit [1,{}]", describe(inputs[index]), role.len())));
        }
        if !is_float(inputs[index]) {
            return Err(refuse(format!("input {} is not 32-bit float", describe(inputs[index]))));
        }
        roles[index] = Some(role);
    }
    let mut matched = Vec::with_capacity(inputs.len());
    for (input, role) in inputs.iter().zip(roles) {
        match role {
            Some(role) => matched.push((input.name.clone(), role)),
            None => {
                return Err(refuse(format!("input {} is none of force, speed, texture", describe(input))));
            }
        }
    }

    let named = graph.output.iter().find(|v| v.name.eq_ignore_ascii_case("magnitudes"));
    let output = match named {
        Some(v) => v,
        None => {
            let scatter =
                |v: &ValueInfoProto| SCATTER.iter().any(|(name, _)| v.name.eq_ignore_ascii_case(name));
            let mut fits = graph.output.iter().filter(|v| row_len(v) == Some(MAGNITUDES_LEN) && !scatter(v));
            match (fits.next(), fits.next()) {
                (Some(v), None) => v,
                (None, _) => {
                    return Err(refuse(format!(
                        "no output is named magnitudes or has shape [1,{MAGNITUDES_LEN}]"
                    )));
                }
                (Some(_), Some(_)) => return Err(refuse("two outputs could be magnitudes".into())),
            }
        }
    };
    let mut outputs = vec![(output, MAGNITUDES_LEN)];
    let of = |name: &str| graph.output.iter().find(|v| v.name.eq_ignore_ascii_case(name));
    match SCATTER.map(|(name, _)| of(name)) {
        [None, None] => {}
        [Some(ratio), Some(variance)] => {
            outputs.extend([ratio, variance].into_iter().zip(SCATTER.map(|s| s.1)))
        }
        [Some(_), None] => return Err(refuse("this model has the output ratio, but not variance".into())),
        [None, Some(_)] => return Err(refuse("this model has the output variance, but not ratio".into())),
    }
    for &(output, len) in &outputs {
        // A file may leave an output's shape open. The typed graph is checked later.
        if shape(output).is_some() && row_len(output) != Some(len) && !has_open_row(output) {
            return Err(refuse(format!("output {} does not fit [1,{len}]", describe(output))));
        }
    }
    Ok(Signature {
        inputs: matched,
        outputs: outputs.into_iter().map(|(output, len)| (output.name.clone(), len)).collect(),
    })
}

pub(crate) fn shape(v: &ValueInfoProto) -> Option<Vec<Option<i64>>> {
    let dims = &tensor(v)?.shape.as_ref()?.dim;
    Some(
        dims.iter()
            .map(|d| match d.value {
                Some(DimensionValue::Size(n)) => Some(n),
                _ => None,
            })
            .collect(),
    )
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
