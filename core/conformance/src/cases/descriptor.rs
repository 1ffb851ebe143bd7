//! What the kind says of itself.

use std::collections::HashSet;

use asperity_node::{Descriptor, Param, ParamKind, ParamValue};

use super::{Found, Not, main};
use crate::subject::Subject;

pub(super) fn descriptor(subject: &Subject<'_>) -> Found {
    let d = subject.kind.descriptor();
    let mut wrong = Vec::new();
    let mut must = |holds: bool, what: String| {
        if !holds {
            wrong.push(what);
        }
    };
    must(named(&d.kind), format!("the kind's name `{}` is not lower case with words joined by `_`", d.kind));
    must(d.summary.ends_with('.'), "its summary is not a sentence that ends with a full stop".into());
    for (names, what) in names(d) {
        let mut seen = HashSet::new();
        for (name, doc) in names {
            must(named(name), format!("the {what} `{name}` is not lower case with words joined by `_`"));
            must(!doc.is_empty(), format!("the {what} `{name}` has no doc"));
            must(seen.insert(name.to_owned()), format!("there are two {what}s `{name}`"));
        }
    }
    for p in &d.params {
        if let Some(what) = parameter(p) {
            must(false, format!("the parameter `{}` {what}", p.name));
        }
    }
    if let Some(gate) = &d.gate {
        must(d.inputs.iter().any(|p| p.name == *gate), format!("it gates `{gate}`, which it has not"));
    }
    if let Some(name) = &d.feedback {
        let number = d.params.iter().any(|p| {
            p.name == *name && matches!(p.kind, ParamKind::Number(_) | ParamKind::Integer(_))
        });
        must(number, format!("its delay is said to be in `{name}`, which is no number of its parameters"));
    }
    must(!d.passive || d.sink, "it is passive but no sink".into());
    must(d.sink || !d.outputs.is_empty(), "it has no outputs and is no sink, so no graph would build it".into());
    match wrong.as_slice() {
        [] => Ok(format!("{} inputs, {} outputs, {} parameters", d.inputs.len(), d.outputs.len(), d.params.len())),
        [first] => Err(Not::Failed(first.clone())),
        [first, rest @ ..] => Err(Not::Failed(format!("{first}; and {} more", rest.len()))),
    }
}

/// Names with docs of inputs, outputs and parameters.
fn names(d: &Descriptor) -> [(Vec<(&str, &str)>, &'static str); 3] {
    [
        (d.inputs.iter().map(|p| (&*p.name, &*p.doc)).collect(), "input"),
        (d.outputs.iter().map(|p| (&*p.name, &*p.doc)).collect(), "output"),
        (d.params.iter().map(|p| (&*p.name, &*p.doc)).collect(), "parameter"),
    ]
}

fn named(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
}

/// What is wrong with a parameter.
fn parameter(p: &Param) -> Option<String> {
    let empty = match &p.kind {
        ParamKind::Number(r) | ParamKind::Numbers(r) => {
            r.start().is_nan() || r.end().is_nan() || r.start() > r.end()
        }
        ParamKind::Integer(r) => r.is_empty(),
        ParamKind::Choice(words) => words.is_empty(),
        ParamKind::Flag | ParamKind::Text | ParamKind::File | ParamKind::Texts => false,
    };
    if empty {
        return Some("has an empty range".into());
    }
    let out = |value: &dyn std::fmt::Display| Some(format!("has the default {value}, which is out of its range"));
    match (&p.kind, &p.default) {
        (ParamKind::Number(r), Some(ParamValue::Number(x))) if !r.contains(x) => out(x),
        (ParamKind::Integer(r), Some(ParamValue::Integer(i))) if !r.contains(i) => out(i),
        (ParamKind::Numbers(r), Some(ParamValue::Numbers(xs))) => xs.iter().find(|x| !r.contains(x)).and_then(|x| out(x)),
        (ParamKind::Choice(words), Some(ParamValue::Text(t))) if !words.iter().any(|w| w == t) => out(t),
        (kind, Some(value)) if !fits(kind, value) => Some(format!("has a default of another type: {value}")),
        _ if p.live && !live(&p.kind) => Some("cannot be live: it is no number, flag or choice".into()),
        _ => None,
    }
}

fn fits(kind: &ParamKind, value: &ParamValue) -> bool {
    matches!(
        (kind, value),
        (ParamKind::Number(_), ParamValue::Number(_))
            | (ParamKind::Integer(_), ParamValue::Integer(_))
            | (ParamKind::Flag, ParamValue::Flag(_))
            | (ParamKind::Text | ParamKind::Choice(_), ParamValue::Text(_))
            | (ParamKind::File, ParamValue::File(_))
            | (ParamKind::Numbers(_), ParamValue::Numbers(_))
            | (ParamKind::Texts, ParamValue::Texts(_))
    )
}

fn live(kind: &ParamKind) -> bool {
    matches!(kind, ParamKind::Number(_) | ParamKind::Integer(_) | ParamKind::Flag | ParamKind::Choice(_))
}

pub(super) fn prepare(subject: &Subject<'_>) -> Found {
    // Twice, and both dropped: what is made can be freed.
    let place = subject.main().map_err(Not::Failed)?;
    for _ in 0..2 {
        let stand = place.stand(subject, crate::signal::Signal::Random, false)?;
        let facts = stand.processor.facts();
        if let Some(fact) = facts.iter().find(|f| !named(&f.name)) {
            return Err(Not::Failed(format!(
                "the fact `{}` is not lower case with words joined by `_`",
                fact.name
            )));
        }
    }
    let place = main(subject)?;
    let stand = place.stand(subject, crate::signal::Signal::Random, false)?;
    let (latency, tail) = (stand.processor.latency().ms(), stand.processor.tail().ms());
    Ok(format!("{}; latency {latency:.3} ms, tail {tail:.1} ms", place.conditions))
}
