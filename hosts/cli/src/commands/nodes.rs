//! `asperity nodes`: lists and describes kinds of nodes.

use asperity_diagnostics::{Diagnostic, one_of};
use asperity_node::{Descriptor, Input, Output, Param, ParamKind, ParamValue};
use serde_json::{Value, json};

use crate::failure::{Failure, print_report};
use crate::kinds;
use crate::load::PluginArgs;

/// List the kinds of nodes, or describe one: ports, units, parameters
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&[
    "asperity nodes",
    "asperity nodes texture_network",
]))]
pub struct Args {
    /// Kind to describe; without one, all kinds are listed
    pub kind: Option<String>,
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let registry = kinds::registry(&args.plugins.plugin)?;
    if let Some(name) = &args.kind {
        let unknown = Diagnostic::new(format!("there is no node kind `{name}`"));
        let kind = registry.get(name).ok_or_else(|| unknown.help(one_of(name, registry.names())))?;
        return print_report(args.json, || as_json(kind.descriptor()), || text_of(kind.descriptor()));
    }
    let width = registry.names().map(str::len).max().unwrap_or(0);
    let line = |d: &Descriptor| format!("{:width$}  {}\n", d.kind, d.summary);
    print_report(
        args.json,
        || Value::from_iter(registry.iter().map(|kind| as_json(kind.descriptor()))),
        || {
            let lines: String = registry.iter().map(|kind| line(kind.descriptor())).collect();
            lines + "\nasperity nodes KIND describes one.\n"
        },
    )
}

fn text_of(d: &Descriptor) -> String {
    let mut out = format!("{}\n  {}\n", d.kind, d.summary);
    let mut section = |title: &str, lines: &mut dyn Iterator<Item = String>| {
        let lines: String = lines.map(|line| line + "\n").collect();
        out += &if lines.is_empty() { lines } else { format!("\n{title}{lines}") };
    };
    let input = |p: &Input| {
        let note = match (p.host_fed, p.optional, p.default) {
            (true, ..) => Some("from the device, unless wired".into()),
            (_, true, 0.0) => Some("optional".into()),
            (_, true, default) => Some(format!("optional, else {default}")),
            _ => None,
        };
        let limited = p.limited.then(|| "only behind a limiter".to_owned());
        let notes: Vec<String> = note.into_iter().chain(limited).collect();
        let notes = if notes.is_empty() { String::new() } else { format!(" ({})", notes.join("; ")) };
        format!("  {}: {} [{}]{notes}\n      {}", p.name, p.shape, p.unit, p.doc)
    };
    let output = |p: &Output| {
        let limited = if p.limited { " (limited)" } else { "" };
        format!("  {}: {} [{}]{limited}\n      {}", p.name, p.shape, p.unit, p.doc)
    };
    section("inputs\n", &mut d.inputs.iter().map(input));
    section("outputs\n", &mut d.outputs.iter().map(output));
    section("parameters\n", &mut d.params.iter().map(|p| parameter(p, 2)));
    if let Some(effect) = &d.effect {
        let mut forms = effect.forms.iter().flat_map(|form| {
            let fields = form.fields.iter().map(|field| parameter(field, 4));
            std::iter::once(format!("  {}", effect.written(&d.kind, form))).chain(fields)
        });
        section(&format!("in a scene, {}\n", effect.acts.words()), &mut forms);
    }
    let facts = [
        Some(format!("when it wakes: {}", d.resume.word())),
        d.gate.as_ref().map(|gate| format!("gates what serves `{gate}` alone")),
        d.feedback.is_some().then(|| "can close a cycle".into()),
        d.sink.then(|| "is a sink: a graph is built for its sinks".into()),
        (!d.timing.is_empty()).then(|| format!("timing: {}", d.timing)),
    ];
    section("", &mut facts.into_iter().flatten());
    out
}

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
    let input = |p: &Input| {
        json!({
            "name": p.name, "doc": p.doc, "type": p.shape.to_string(), "unit": p.unit.to_string(),
            "optional": p.optional, "default": p.optional.then_some(p.default), "limited": p.limited,
            "fed": p.host_fed,
        })
    };
    let output = |p: &Output| {
        json!({
            "name": p.name, "doc": p.doc, "type": p.shape.to_string(), "unit": p.unit.to_string(),
            "limited": p.limited,
        })
    };
    let param = |p: &Param| {
        let range = |least: Value, most: Value| [least, most, Value::Null];
        let [least, most, choices] = match &p.kind {
            ParamKind::Number(r) | ParamKind::Numbers(r) => range(json!(r.start()), json!(r.end())),
            ParamKind::Integer(r) => range(json!(r.start()), json!(r.end())),
            ParamKind::Choice(words) => [Value::Null, Value::Null, json!(words)],
            _ => Default::default(),
        };
        let kind = match &p.kind {
            ParamKind::Number(_) => "number",
            ParamKind::Integer(_) => "integer",
            ParamKind::Flag => "flag",
            ParamKind::Text => "text",
            ParamKind::Choice(_) => "choice",
            ParamKind::File => "file",
            ParamKind::Numbers(_) => "numbers",
            ParamKind::Texts => "texts",
        };
        json!({
            "name": p.name, "doc": p.doc, "unit": p.unit, "type": kind, "choices": choices,
            "min": least, "max": most, "default": p.default.as_ref().map(param_json),
            "required": p.default.is_none() && !p.optional, "live": p.live,
        })
    };
    json!({
        "kind": d.kind, "summary": d.summary,
        "inputs": d.inputs.iter().map(input).collect::<Vec<_>>(),
        "outputs": d.outputs.iter().map(output).collect::<Vec<_>>(),
        "params": d.params.iter().map(param).collect::<Vec<_>>(),
        "resume": d.resume.word(), "gate": d.gate, "closes_cycles": d.feedback.is_some(), "sink": d.sink,
        "timing": d.timing,
    })
}
