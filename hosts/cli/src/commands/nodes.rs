//! `asperity nodes`: lists and describes kinds of nodes.

use std::fmt::Write as _;
use std::process::ExitCode;

use asperity_diagnostics::{Diagnostic, one_of};
use asperity_node::{Descriptor, Param, ParamKind, ParamValue};
use serde_json::{Value, json};

use crate::failure::{Failure, print};
use crate::kinds;
use crate::load::PluginArgs;

/// List the kinds of nodes, or describe one: ports, units, parameters
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Describe this kind
    pub kind: Option<String>,
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    let registry = kinds::registry(&args.plugins.plugin)?;
    match &args.kind {
        Some(name) => {
            let Some(kind) = registry.get(name) else {
                return Err(Diagnostic::new(format!("there is no node kind `{name}`"))
                    .help(one_of(name, registry.names()))
                    .into());
            };
            if args.json {
                print(&format!("{:#}\n", as_json(kind.descriptor())))?;
            } else {
                print(&text_of(kind.descriptor()))?;
            }
        }
        None if args.json => {
            let all: Vec<Value> = registry.iter().map(|k| as_json(k.descriptor())).collect();
            print(&format!("{:#}\n", Value::Array(all)))?;
        }
        None => {
            let width = registry.names().map(str::len).max().unwrap_or(0);
            let mut out = String::new();
            for kind in registry.iter() {
                let d = kind.descriptor();
                let _ = writeln!(out, "{:width$}  {}", d.kind, d.summary);
            }
            out.push_str("\nasperity nodes KIND describes one.\n");
            print(&out)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn text_of(d: &Descriptor) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{}\n  {}", d.kind, d.summary);
    if !d.inputs.is_empty() {
        let _ = writeln!(out, "\ninputs");
    }
    for p in &d.inputs {
        let mut notes = Vec::new();
        if p.host_fed {
            notes.push("from the device, unless wired".into());
        } else if p.optional {
            notes.push(if p.default == 0.0 {
                "optional".into()
            } else {
                format!("optional, else {}", p.default)
            });
        }
        if p.limited {
            notes.push("only behind a limiter".to_owned());
        }
        let notes = if notes.is_empty() { String::new() } else { format!(" ({})", notes.join("; ")) };
        let _ = writeln!(out, "  {}: {} [{}]{notes}\n      {}", p.name, p.shape, p.unit, p.doc);
    }
    if !d.outputs.is_empty() {
        let _ = writeln!(out, "\noutputs");
    }
    for p in &d.outputs {
        let limited = if p.limited { " (limited)" } else { "" };
        let _ = writeln!(out, "  {}: {} [{}]{limited}\n      {}", p.name, p.shape, p.unit, p.doc);
    }
    if !d.params.is_empty() {
        let _ = writeln!(out, "\nparameters");
    }
    for p in &d.params {
        let _ = writeln!(out, "{}", parameter(p, 2));
    }
    if let Some(effect) = &d.effect {
        let _ = writeln!(out, "\nin a scene, {}", effect.acts.words());
        for form in &effect.forms {
            let _ = writeln!(out, "  {}", effect.written(&d.kind, form));
            for field in &form.fields {
                let _ = writeln!(out, "{}", parameter(field, 4));
            }
        }
    }
    let _ = writeln!(out, "\nwhen it wakes: {}", d.resume.word());
    if let Some(gate) = &d.gate {
        let _ = writeln!(out, "gates what serves `{gate}` alone");
    }
    if d.feedback.is_some() {
        let _ = writeln!(out, "can close a cycle");
    }
    if d.sink {
        let _ = writeln!(out, "is a sink: a graph is built for its sinks");
    }
    if !d.timing.is_empty() {
        let _ = writeln!(out, "timing: {}", d.timing);
    }
    out
}

/// A parameter's value as JSON.
pub fn param_json(value: &ParamValue) -> Value {
    match value {
        ParamValue::Number(x) => json!(x),
        ParamValue::Integer(i) => json!(i),
        ParamValue::Flag(b) => json!(b),
        ParamValue::Text(t) => json!(t),
        ParamValue::File(f) => json!(f.display().to_string()),
        ParamValue::Numbers(xs) => json!(xs),
        ParamValue::Texts(ts) => json!(ts),
    }
}

/// A parameter, or a field of an effect, in two lines.
fn parameter(p: &Param, indent: usize) -> String {
    let default = match &p.default {
        Some(ParamValue::Text(t)) if t.is_empty() => "default empty".to_owned(),
        Some(v) => format!("default {v}"),
        None if p.optional => "may be left out".to_owned(),
        None => "required".to_owned(),
    };
    let unit = if p.unit.is_empty() { String::new() } else { format!(" {}", p.unit) };
    let live = if p.live { ", live" } else { "" };
    format!("{:indent$}{}: {}{unit}, {default}{live}\n{:indent$}    {}", "", p.name, p.kind, "", p.doc)
}

fn as_json(d: &Descriptor) -> Value {
    let inputs: Vec<Value> = d
        .inputs
        .iter()
        .map(|p| {
            json!({
                "name": p.name, "doc": p.doc, "type": p.shape.to_string(), "unit": p.unit.to_string(),
                "optional": p.optional, "default": p.optional.then_some(p.default), "limited": p.limited,
                "fed": p.host_fed,
            })
        })
        .collect();
    let outputs: Vec<Value> = d
        .outputs
        .iter()
        .map(|p| {
            json!({
                "name": p.name, "doc": p.doc, "type": p.shape.to_string(), "unit": p.unit.to_string(),
                "limited": p.limited,
            })
        })
        .collect();
    let params: Vec<Value> = d
        .params
        .iter()
        .map(|p| {
            let (least, most) = match &p.kind {
                ParamKind::Number(r) | ParamKind::Numbers(r) => (json!(r.start()), json!(r.end())),
                ParamKind::Integer(r) => (json!(r.start()), json!(r.end())),
                _ => (Value::Null, Value::Null),
            };
            let (kind, choices) = match &p.kind {
                ParamKind::Number(_) => ("number", Value::Null),
                ParamKind::Integer(_) => ("integer", Value::Null),
                ParamKind::Flag => ("flag", Value::Null),
                ParamKind::Text => ("text", Value::Null),
                ParamKind::Choice(words) => ("choice", json!(words)),
                ParamKind::File => ("file", Value::Null),
                ParamKind::Numbers(_) => ("numbers", Value::Null),
                ParamKind::Texts => ("texts", Value::Null),
            };
            let default = p.default.as_ref().map_or(Value::Null, param_json);
            json!({
                "name": p.name, "doc": p.doc, "unit": p.unit, "type": kind, "choices": choices,
                "min": least, "max": most, "default": default, "required": p.default.is_none() && !p.optional,
                "live": p.live,
            })
        })
        .collect();
    json!({
        "kind": d.kind, "summary": d.summary, "inputs": inputs, "outputs": outputs, "params": params,
        "resume": d.resume.word(), "gate": d.gate, "closes_cycles": d.feedback.is_some(), "sink": d.sink,
        "timing": d.timing,
    })
}
