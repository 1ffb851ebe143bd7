//! Checks of descriptors. A descriptor may come from a plugin, so nothing in it is trusted.

use std::borrow::Cow;
use std::collections::HashSet;

use crate::{
    Acts, Descriptor, Diagnostic, Effect, FrameLayout, Input, LayoutSpec, Param, ParamKind, ParamValue,
    RateSpec, ShapeSpec,
};

/// Most values of a control.
const MOST_VALUES: usize = 1 << 16;
/// Highest rate of a port in Hz.
const MOST_HZ: u32 = 1_000_000;
/// Longest transform of a frame in samples.
const MOST_SAMPLES: u32 = 1 << 20;

impl Descriptor {
    /// Checks the rules of a descriptor: names are lower case and distinct, everything is documented, ranges
    /// are not empty, defaults lie in them. `gate` and `feedback` name an input and a number, only kinds
    /// that can change are live, and shapes have a size.
    ///
    /// # Errors
    /// The first problem, with the kind and the port or parameter. It does not panic on any values.
    pub fn check(&self) -> Result<(), Diagnostic> {
        self.rules().map_err(|what| {
            Diagnostic::new(format!("the descriptor of node kind {:?} is wrong: {what}", self.kind))
        })
    }

    fn rules(&self) -> Check {
        ensure(is_name(&self.kind), || format!("its name must be {NAME}"))?;
        ensure(self.summary.ends_with('.'), || {
            "its summary must be a sentence that ends with a full stop".to_owned()
        })?;
        list("input", &self.inputs, |p| (&p.name, &p.doc), input)?;
        list("output", &self.outputs, |p| (&p.name, &p.doc), |p| shape(&p.shape))?;
        list("parameter", &self.params, |p| (&p.name, &p.doc), param)?;
        if let Some(gate) = &self.gate {
            ensure(self.has_input(gate), || format!("it gates {gate:?}, and no input has that name"))?;
        }
        if let Some(delay) = &self.feedback {
            let has = self.params.iter().any(|p| p.name == *delay && matches!(p.kind, ParamKind::Number(_)));
            ensure(has, || format!("it closes cycles by {delay:?}, and no number parameter has that name"))?;
        }
        ensure(!self.passive || self.sink, || "it is passive, but not a sink".to_owned())?;
        self.effect.as_ref().map_or(Ok(()), |effect| self.effect_rules(effect))
    }

    fn has_input(&self, name: &str) -> bool {
        self.inputs.iter().any(|p| p.name == name)
    }

    fn effect_rules(&self, Effect { list: texts, acts, forms, needs, .. }: &Effect) -> Check {
        let has = self.params.iter().any(|p| p.name == *texts && p.kind == ParamKind::Texts);
        ensure(has, || format!("its effect has the list {texts:?}, and no list of texts has that name"))?;
        ensure(self.has_input("slot"), || "an effect needs an input `slot`".to_owned())?;
        for (name, quantity) in needs {
            ensure(self.has_input(name), || {
                format!("its effect needs {name:?}, and no input has that name")
            })?;
            ensure(is_name(quantity), || format!("quantity {quantity:?}: a name must be {NAME}"))?;
        }
        let gives = self.outputs.first().map(|output| &output.shape);
        ensure(matches!(gives, Some(ShapeSpec::Audio(_) | ShapeSpec::Control(3))), || {
            "an effect first outputs a force of three values or a vibration".to_owned()
        })?;
        ensure(!forms.is_empty(), || "its effect has no form".to_owned())?;
        for form in forms {
            let rules = || {
                ensure(forms.len() == 1 || is_name(&form.name), || {
                    format!("of several forms each has a name, {NAME}")
                })?;
                let same = forms.iter().filter(|other| other.name == form.name).count();
                ensure(same == 1, || "there are two of them".to_owned())?;
                list("field", &form.fields, |p| (&p.name, &p.doc), param)?;
                let reach = form.fields.iter().any(|field| field.name == "reach_mm");
                ensure(*acts != Acts::Near || reach, || {
                    "an effect from both sides has the field `reach_mm`".to_owned()
                })
            };
            rules().map_err(|problem: String| format!("form `{}`: {problem}", form.name))?;
        }
        Ok(())
    }
}

/// The first problem is the error.
type Check = Result<(), String>;

fn ensure(fine: bool, problem: impl FnOnce() -> String) -> Check {
    if fine { Ok(()) } else { Err(problem()) }
}

const NAME: &str = "lower case, of letters, digits and `_`";

fn is_name(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
}

type Text = Cow<'static, str>;

/// Checks a list: its names, which are well formed, documented and distinct, and its items.
fn list<T>(
    what: &str,
    list: &[T],
    name_and_doc: impl Fn(&T) -> (&Text, &Text),
    item: impl Fn(&T) -> Check,
) -> Check {
    let mut seen = HashSet::new();
    for it in list {
        let (name, doc) = name_and_doc(it);
        ensure(is_name(name), || format!("{what} {name:?}: a name must be {NAME}"))?;
        ensure(!doc.trim().is_empty(), || format!("{what} `{name}` has no description"))?;
        ensure(seen.insert(name), || format!("there are two of {what} `{name}`"))?;
    }
    let of = |it| item(it).map_err(|why| format!("{what} `{}`: {why}", name_and_doc(it).0));
    list.iter().try_for_each(of)
}

fn input(port: &Input) -> Check {
    ensure(port.default.is_finite(), || format!("its default of {} is not finite", port.default))?;
    shape(&port.shape)
}

fn shape(shape: &ShapeSpec) -> Check {
    match shape {
        ShapeSpec::Control(n) => ensure((1..=MOST_VALUES).contains(n), || {
            format!("a control of {n} values; 1 to {MOST_VALUES} fit")
        }),
        ShapeSpec::Audio(RateSpec::Hz(hz)) => rate(*hz),
        ShapeSpec::Magnitude(LayoutSpec::Is(l)) | ShapeSpec::Spectrum(LayoutSpec::Is(l)) => layout(l),
        _ => Ok(()),
    }
}

fn rate(hz: u32) -> Check {
    ensure((1..=MOST_HZ).contains(&hz), || format!("a rate of {hz} Hz; 1 to {MOST_HZ} Hz fit"))
}

fn layout(&FrameLayout { rate_hz, length, bins, .. }: &FrameLayout) -> Check {
    rate(rate_hz)?;
    ensure((1..=MOST_SAMPLES).contains(&length), || {
        format!("a window of {length} samples; 1 to {MOST_SAMPLES} fit")
    })?;
    let most = length / 2 + 1;
    ensure((1..=most).contains(&bins), || {
        format!("{bins} bins; 1 to {most} fit a window of {length} samples")
    })
}

fn param(p: &Param) -> Check {
    use ParamKind::{Choice, File, Flag, Integer, Number, Numbers, Text, Texts};
    let changes = matches!(p.kind, Number(_) | Integer(_) | Flag | Choice(_));
    ensure(!p.live || changes, || {
        "only a number, a whole number, a flag or a choice can be live".to_owned()
    })?;
    match &p.kind {
        Number(r) | Numbers(r) => {
            let fine = r.start().is_finite() && r.end().is_finite() && r.start() <= r.end();
            ensure(fine, || format!("no finite number is from {} to {}", r.start(), r.end()))?;
        }
        Integer(r) => {
            ensure(!r.is_empty(), || format!("no whole number is from {} to {}", r.start(), r.end()))?;
        }
        Choice(words) => {
            ensure(!words.is_empty(), || "a choice without words".to_owned())?;
            let mut seen = HashSet::new();
            let bad = words.iter().find(|w| w.is_empty() || !seen.insert(*w));
            bad.map_or(Ok(()), |w| Err(format!("its choices are empty or not distinct: {w:?}")))?;
        }
        Flag | Text | File | Texts => {}
    }
    let Some(value) = &p.default else { return Ok(()) };
    let fits = match (&p.kind, value) {
        (Number(r), ParamValue::Number(x)) => r.contains(x),
        (Numbers(r), ParamValue::Numbers(xs)) => xs.iter().all(|x| r.contains(x)),
        (Integer(r), ParamValue::Integer(i)) => r.contains(i),
        (Choice(words), ParamValue::Text(word)) => words.iter().any(|w| w == word),
        (Flag, ParamValue::Flag(_)) | (Text, ParamValue::Text(_)) => true,
        (File, ParamValue::File(_)) | (Texts, ParamValue::Texts(_)) => true,
        _ => false,
    };
    ensure(fits, || format!("its default {value} is not one of its values"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameRate, Output, Unit};

    fn good() -> Descriptor {
        let frame_rate = FrameRate::new(500, 1).unwrap();
        let layout = FrameLayout { rate_hz: 2500, length: 250, bins: 101, frame_rate };
        Descriptor::new("a_kind2", "Does a thing.")
            .input(Input::new("in", ShapeSpec::Audio(RateSpec::Hz(8000)), Unit::NEWTON).doc("a force"))
            .input(Input::new("other", ShapeSpec::Control(3), Unit::NONE).or(0.5).doc("another"))
            .output(Output::new("in", ShapeSpec::Magnitude(LayoutSpec::Is(layout)), Unit::NONE).doc("frames"))
            .param(Param::number("delay_ms", 1.0, 0.0..=2.0, "How long.").live())
            .param(Param::integer("count", 3, 3..=3, "How many."))
            .param(Param::choice("word", &["one", "two"], "Which."))
            .param(Param::numbers("list", &[1.0, 2.0], 0.0..=2.0, "Some."))
            .param(Param::file("file", "Where from."))
            .gates("in")
            .closes_cycles("delay_ms")
    }

    /// The message for the descriptor after `spoil`; it must name the kind and `about`.
    #[track_caller]
    fn wrong(about: &str, spoil: impl FnOnce(&mut Descriptor)) {
        let mut d = good();
        spoil(&mut d);
        let message = d.check().expect_err(about).message;
        assert!(message.contains(&format!("{:?}", d.kind)) && message.contains(about), "{message}");
    }

    #[test]
    fn valid_descriptor_passes() {
        good().check().unwrap();
        Descriptor::new("bare", "Nothing.").check().unwrap();
    }

    #[test]
    fn bad_names_and_missing_docs_are_refused() {
        for name in ["", "Upper", "a b", "gr\u{fc}n", "x\n"] {
            wrong("name", |d| d.kind = name.into());
            wrong("parameter", |d| d.params[0].name = name.into());
            wrong("input", |d| d.inputs[0].name = name.into());
            wrong("output", |d| d.outputs[0].name = name.into());
        }
        wrong("summary", |d| d.summary = "".into());
        wrong("two of input `in`", |d| d.inputs[1].name = "in".into());
        wrong("two of parameter `word`", |d| d.params[4].name = "word".into());
        wrong("output `in`", |d| d.outputs[0].doc = " ".into());
        wrong("parameter `count`", |d| d.params[1].doc = "".into());
    }

    #[test]
    fn empty_range_or_default_outside_is_refused() {
        for (from, to) in [(f64::NAN, 1.0), (0.0, f64::NAN), (1.0, 0.0), (0.0, f64::INFINITY)] {
            wrong("parameter `delay_ms`", |d| d.params[0].kind = ParamKind::Number(from..=to));
            wrong("parameter `list`", |d| d.params[3].kind = ParamKind::Numbers(from..=to));
        }
        #[expect(clippy::reversed_empty_ranges, reason = "that is what is wrong with it")]
        let empty = 3..=2;
        wrong("parameter `count`", |d| d.params[1].kind = ParamKind::Integer(empty));
        for value in [f64::NAN, f64::INFINITY, 2.1] {
            wrong("parameter `delay_ms`", |d| d.params[0].default = Some(ParamValue::Number(value)));
            wrong("parameter `list`", |d| d.params[3].default = Some(ParamValue::Numbers(vec![0.0, value])));
        }
        wrong("parameter `delay_ms`", |d| d.params[0].default = Some(ParamValue::Integer(1)));
        wrong("parameter `count`", |d| d.params[1].default = Some(ParamValue::Integer(4)));
        wrong("parameter `word`", |d| d.params[2].default = Some(ParamValue::Text("three".into())));
        wrong("parameter `word`", |d| d.params[2].kind = ParamKind::Choice(Cow::Borrowed(&[])));
        let twice = vec![Cow::Borrowed("one"), Cow::Borrowed("one")];
        wrong("parameter `word`", |d| d.params[2].kind = ParamKind::Choice(twice.into()));
        wrong("input `other`", |d| d.inputs[1].default = f64::NAN);
    }

    #[test]
    fn live_parameters_and_roles_are_checked() {
        for i in [3, 4] {
            wrong("live", |d| d.params[i].live = true);
        }
        wrong("gates \"out\"", |d| d.gate = Some("out".into()));
        wrong("cycles by \"other\"", |d| d.feedback = Some("other".into()));
        wrong("cycles by \"count\"", |d| d.feedback = Some("count".into()));
        wrong("sink", |d| d.passive = true);
    }

    #[test]
    fn empty_shape_is_refused() {
        for n in [0, usize::MAX] {
            wrong("input `in`", |d| d.inputs[0].shape = ShapeSpec::Control(n));
        }
        for hz in [0, u32::MAX] {
            wrong("input `in`", |d| d.inputs[0].shape = ShapeSpec::Audio(RateSpec::Hz(hz)));
        }
        let frame_rate = FrameRate::new(500, 1).unwrap();
        for (rate_hz, length, bins) in
            [(0, 250, 101), (2500, 0, 1), (2500, 250, 0), (2500, 250, 127), (2500, u32::MAX, 1)]
        {
            let layout = FrameLayout { rate_hz, length, bins, frame_rate };
            wrong("output `in`", |d| d.outputs[0].shape = ShapeSpec::Spectrum(LayoutSpec::Is(layout)));
        }
    }
}
