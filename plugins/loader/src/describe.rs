//! Checks a plugin's descriptor and converts it.

use std::borrow::Cow;

use asperity_abi::*;
use asperity_node::{
    Descriptor, FrameLayout, FrameRate, Input, LayoutSpec, Output, Param, ParamKind, ParamValue, RateSpec,
    Resume, ShapeSpec, Unit, UnitSpec, Var,
};

use crate::checked::{Lie, Theirs};
use crate::effect::effect;

/// Descriptor of a kind, with its effect if it is one.
pub(crate) fn descriptor(
    theirs: Theirs,
    at: *const AsperityKind,
    kind: &AsperityKind,
    effects: Option<&AsperityEffects>,
) -> Result<Descriptor, Lie> {
    let name = theirs.text(kind.kind, "the name of a kind")?;
    let of = |lie| format!("kind `{name}`: {lie}");
    let mut d = described(theirs, kind, &name).map_err(of)?;
    if let Some(effects) = effects {
        d.effect = effect(theirs, at, effects).map_err(of)?;
    }
    d.check().map_err(|e| e.message)?;
    Ok(d)
}

fn described(theirs: Theirs, kind: &AsperityKind, name: &str) -> Result<Descriptor, Lie> {
    let summary = theirs.text(kind.summary, "its summary")?;
    let timing = theirs.some_text(kind.timing, "its timing")?;
    let gate = theirs.some_text(kind.gate, "the name of the gated input")?;
    let feedback = theirs.some_text(kind.feedback, "the name of the feedback parameter")?;
    let inputs = theirs.read_all(kind.inputs, kind.input_count, "input")?;
    let outputs = theirs.read_all(kind.outputs, kind.output_count, "output")?;
    let params = theirs.read_all(kind.params, kind.param_count, "parameter")?;
    functions(kind, gate.is_some(), feedback.is_some(), &params)?;
    if kind.flags & !(ASPERITY_SINK | ASPERITY_PASSIVE) != 0 {
        return Err(unknown("its flags are", &format!("{:#x}", kind.flags)));
    }
    let mut d = Descriptor::new(name.to_owned(), summary).timing(timing.unwrap_or_default());
    d.sink = kind.flags & ASPERITY_SINK != 0;
    d.passive = kind.flags & ASPERITY_PASSIVE != 0;
    d.resume = match kind.resume {
        ASPERITY_RESTART => Resume::Restart,
        ASPERITY_ELAPSED => Resume::Elapsed,
        ASPERITY_RESUME => Resume::Continue,
        ASPERITY_NEVER => Resume::Never,
        other => return Err(format!("it says {other} of how it wakes")),
    };
    d.gate = gate.map(Cow::Owned);
    d.feedback = feedback.map(Cow::Owned);
    d.inputs = inputs.iter().map(|p| input(theirs, p)).collect::<Result<_, _>>()?;
    d.outputs = outputs.iter().map(|p| output(theirs, p)).collect::<Result<_, _>>()?;
    d.params = params.iter().map(|p| param(theirs, p)).collect::<Result<_, _>>()?;
    Ok(d)
}

/// An error about flags or a number that a later version may have.
fn unknown(what: &str, says: &str) -> Lie {
    format!("{what} {says}, which this version does not know")
}

/// Checks that all required functions are present.
fn functions(k: &AsperityKind, gate: bool, feedback: bool, params: &[AsperityParam]) -> Result<(), Lie> {
    let live = params.iter().any(|p| p.flags & ASPERITY_LIVE != 0);
    let state = [k.state_size.is_some(), k.save.is_some(), k.restore.is_some()];
    let missing = [
        ("create", k.create.is_none()),
        ("prepare", k.prepare.is_none()),
        ("process", k.process.is_none()),
        ("reset", k.reset.is_none()),
        ("destroy", k.destroy.is_none()),
        ("wants (it is a gate)", gate && k.wants.is_none()),
        ("absorb (it closes cycles)", feedback && k.absorb.is_none()),
        ("elapsed (it wakes so)", k.resume == ASPERITY_ELAPSED && k.elapsed.is_none()),
        ("set_parameter (a parameter is live)", live && k.set_parameter.is_none()),
        ("one of state_size, save and restore", state.contains(&true) && state.contains(&false)),
    ];
    match missing.iter().find(|(_, missing)| *missing) {
        Some((name, _)) => Err(format!("it has no function `{name}`")),
        None => Ok(()),
    }
}

/// An input.
pub(crate) fn input(theirs: Theirs, p: &AsperityPort) -> Result<Input, Lie> {
    let (name, doc, shape, unit) = port(theirs, p)?;
    Ok(Input {
        name: name.into(),
        doc: doc.into(),
        shape,
        unit,
        optional: p.flags & ASPERITY_OPTIONAL != 0,
        default: p.default_value,
        wakes: p.flags & ASPERITY_WAKES != 0 || !matches!(shape, ShapeSpec::Control(_)),
        limited: p.flags & ASPERITY_LIMITED != 0,
        host_fed: false,
    })
}

/// An output.
pub(crate) fn output(theirs: Theirs, p: &AsperityPort) -> Result<Output, Lie> {
    let (name, doc, shape, unit) = port(theirs, p)?;
    // A limiter protects the device, so only this program provides it.
    if p.flags & ASPERITY_LIMITED != 0 {
        return Err(format!(
            "output `{name}` promises a limited signal, which only the built-in limiter may"
        ));
    }
    Ok(Output { name: name.into(), doc: doc.into(), shape, unit, limited: false, secondary: false })
}

fn port(theirs: Theirs, p: &AsperityPort) -> Result<(String, String, ShapeSpec, UnitSpec), Lie> {
    let name = theirs.text(p.name, "the name of a port")?;
    let of = |what: &str| format!("the {what} of port `{name}`");
    let doc = theirs.some_text(p.doc, &of("doc"))?.unwrap_or_default();
    let unit = theirs.some_text(p.unit, &of("unit"))?;
    let units = theirs.texts(p.units, &of("list of units"))?;
    if p.flags & !(ASPERITY_OPTIONAL | ASPERITY_WAKES | ASPERITY_LIMITED) != 0 {
        return Err(unknown(&of("flags"), &format!("are {:#x}", p.flags)));
    }
    if !p.default_value.is_finite() {
        return Err(format!("the default of port `{name}` is not finite"));
    }
    let unit = match (variable(p.unit_var, &name)?, unit) {
        (Some(var), _) => UnitSpec::Of { var, among: units.into_iter().map(Unit::from_symbol).collect() },
        (None, Some(symbol)) if !symbol.is_empty() => UnitSpec::Is(Unit::from_symbol(symbol)),
        _ => return Err(format!("port `{name}` has no unit; `1` stands for none")),
    };
    Ok((name.clone(), doc, shape(p, &name)?, unit))
}

fn variable(letter: u32, port: &str) -> Result<Option<Var>, Lie> {
    match char::from_u32(letter) {
        Some('\0') => Ok(None),
        Some(c) if c.is_ascii_alphabetic() => Ok(Some(c)),
        _ => Err(format!("port `{port}` has the variable {letter:#x}; a letter would fit")),
    }
}

fn shape(p: &AsperityPort, name: &str) -> Result<ShapeSpec, Lie> {
    let var = variable(p.shape_var, name)?;
    let layout = || match (var, FrameRate::new(p.frame_num, p.frame_den)) {
        (Some(var), _) => Ok(LayoutSpec::Of(var)),
        (None, Some(frame_rate)) => {
            let l = FrameLayout { rate_hz: p.rate_hz, length: p.length, bins: p.bins, frame_rate };
            if l.rate_hz == 0 || l.length == 0 || l.bins == 0 || l.bins > l.length / 2 + 1 {
                return Err(format!("the layout of port `{name}` cannot be: {l}"));
            }
            Ok(LayoutSpec::Is(l))
        }
        (None, None) => Err(format!("port `{name}` has neither a layout nor a variable for one")),
    };
    Ok(match p.carries {
        ASPERITY_LIKE => match var {
            Some(var) => ShapeSpec::Like(var),
            None => return Err(format!("port `{name}` is like no other: it has no variable")),
        },
        ASPERITY_CONTROL if (1..=65_536).contains(&p.count) => ShapeSpec::Control(p.count as usize),
        ASPERITY_CONTROL => return Err(format!("port `{name}` carries {} values", p.count)),
        ASPERITY_AUDIO => ShapeSpec::Audio(match (var, p.rate_hz) {
            (Some(var), _) => RateSpec::Of(var),
            (None, 0) => RateSpec::Graph,
            (None, hz) if hz <= 1_000_000 => RateSpec::Hz(hz),
            (None, hz) => return Err(format!("port `{name}` has a rate of {hz} Hz")),
        }),
        ASPERITY_MAGNITUDE => ShapeSpec::Magnitude(layout()?),
        ASPERITY_SPECTRUM => ShapeSpec::Spectrum(layout()?),
        other => return Err(unknown(&format!("port `{name}`"), &format!("carries {other}"))),
    })
}

/// A parameter, or a field of an effect's form.
pub(crate) fn param(theirs: Theirs, p: &AsperityParam) -> Result<Param, Lie> {
    let name = theirs.text(p.name, "the name of a parameter")?;
    let it = format!("parameter `{name}`");
    let of = |what: &str| format!("the {what} of {it}");
    let doc = theirs.text(p.doc, &of("doc"))?;
    let unit = theirs.some_text(p.unit, &of("unit"))?.unwrap_or_default();
    let text = theirs.some_text(p.default_text, &of("default"))?;
    let words = theirs.texts(p.words, &of("words"))?;
    if p.flags & !(ASPERITY_REQUIRED | ASPERITY_MAY_BE_LEFT_OUT | ASPERITY_LIVE) != 0 {
        return Err(unknown(&of("flags"), &format!("are {:#x}", p.flags)));
    }
    let whole = |x: i64| match x {
        0 | 1 => Ok(x == 1),
        _ => Err(format!("the default of the flag `{name}` is {x}; 0 or 1 would fit")),
    };
    let (kind, default) = match p.holds {
        ASPERITY_NUMBER => (ParamKind::Number(p.min..=p.max), Some(ParamValue::Number(p.default_number))),
        ASPERITY_INTEGER => {
            (ParamKind::Integer(p.integer_min..=p.integer_max), Some(ParamValue::Integer(p.default_integer)))
        }
        ASPERITY_FLAG => (ParamKind::Flag, Some(ParamValue::Flag(whole(p.default_integer)?))),
        ASPERITY_TEXT => (ParamKind::Text, Some(ParamValue::Text(text.unwrap_or_default()))),
        ASPERITY_CHOICE => {
            let first = words.first().ok_or_else(|| format!("{it} has no words to choose from"))?;
            let default = text.unwrap_or_else(|| first.clone());
            let words: Vec<Cow<'static, str>> = words.into_iter().map(Cow::Owned).collect();
            (ParamKind::Choice(words.into()), Some(ParamValue::Text(default)))
        }
        ASPERITY_FILE => (ParamKind::File, None),
        ASPERITY_NUMBERS => {
            let default = theirs.numbers(p.default_numbers, p.default_count, &it)?;
            (ParamKind::Numbers(p.min..=p.max), Some(ParamValue::Numbers(default)))
        }
        ASPERITY_TEXTS => (ParamKind::Texts, Some(ParamValue::Texts(Vec::new()))),
        other => return Err(unknown(&it, &format!("holds {other}"))),
    };
    let left_out = p.flags & ASPERITY_MAY_BE_LEFT_OUT != 0;
    let has_default = p.flags & (ASPERITY_REQUIRED | ASPERITY_MAY_BE_LEFT_OUT) == 0;
    Ok(Param {
        name: name.into(),
        doc: doc.into(),
        unit: unit.into(),
        kind,
        default: default.filter(|_| has_default),
        optional: left_out,
        live: p.flags & ASPERITY_LIVE != 0,
    })
}
