//! A parameter that varies from trial to trial, and how its levels are chosen.

use asperity_diagnostics::ron::{Kind, Record, Value};
use asperity_diagnostics::{Diagnostic, Place};
use asperity_psychometrics::{
    Axis, FitSettings, Function, Grid, Quest, QuestSettings, Shape, StaircaseSettings, Steps,
};

use crate::file::{Named, StimulusKind, variant, words};

/// A parameter of a stimulus that varies from trial to trial.
#[derive(Clone, Debug)]
pub struct Vary {
    /// Index of the stimulus.
    pub stimulus: usize,
    /// Setting, such as `strength.gain`.
    pub set: String,
    /// Place of the setting in the file.
    pub set_place: Place,
    /// How levels are chosen.
    pub method: Method,
    /// Its place in the file.
    pub place: Place,
}

/// A level of a varied parameter.
#[derive(Clone, Debug)]
pub struct Varied {
    /// Setting, such as `strength.gain`.
    pub set: String,
    /// Its value.
    pub level: f64,
    /// Place of the setting in the file.
    pub place: Place,
}

/// Choice of levels.
#[derive(Clone, Debug)]
pub enum Method {
    /// Up and down with the answers.
    Staircase(StaircaseSettings),
    /// The most informative level.
    Quest(QuestSettings),
    /// Fixed levels, each several times, and a fitted function.
    Constant {
        /// Levels.
        levels: Vec<f64>,
        /// Trials of each.
        each: u32,
        /// Shape of the function.
        fit: FitSettings,
    },
}

impl Method {
    /// The lowest and the highest level.
    pub fn range(&self) -> [f64; 2] {
        let levels = match self {
            Self::Staircase(settings) => vec![settings.floor, settings.ceiling],
            Self::Quest(settings) => settings.levels().unwrap_or_default(),
            Self::Constant { levels, .. } => levels.clone(),
        };
        levels.iter().fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(*x), high.max(*x)])
    }

    /// Probability of a hit by chance, where the analysis takes one as known.
    pub fn guess(&self) -> Option<f64> {
        match self {
            Self::Quest(QuestSettings { guess: Grid::Values { of }, .. }) if of.len() == 1 => Some(of[0]),
            Self::Constant { fit, .. } => Some(fit.guess),
            _ => None,
        }
    }
}

impl Vary {
    /// The parameter at a level.
    pub fn at(&self, level: f64) -> Varied {
        Varied { set: self.set.clone(), level, place: self.set_place.clone() }
    }

    /// Reads the parameter of a part whose question is answered right by chance with the probability
    /// `chance`; 0 for a comparison, which has no right answer.
    pub(crate) fn read(value: &Value, named: Named<'_>, chance: f64) -> Result<Self, Diagnostic> {
        let mut record = value.record("Vary")?;
        let of = record.required("stimulus")?;
        let stimulus = named.stimulus(of)?;
        if !matches!(named.stimuli[stimulus].kind, StimulusKind::Graph { .. }) {
            return Err(of.error("this stimulus has no parameters").help("name one of kind `graph(...)`"));
        }
        let listed = record.required("set")?;
        let (set, set_place) = (words(listed)?, listed.place());
        let by = record.required("by")?;
        let name = variant(by, &["staircase", "quest", "constant"])?;
        let mut fields = by.record(name)?;
        let method = match name {
            "staircase" => Method::Staircase(staircase(&mut fields)?),
            "quest" => Method::Quest(quest(&mut fields, chance)?),
            _ => constant(&mut fields, chance)?,
        };
        fields.finish()?;
        let refused = match &method {
            Method::Staircase(settings) => settings.check().err(),
            Method::Quest(settings) => {
                Quest::new(settings.clone()).err().or_else(|| unreachable_by(settings))
            }
            Method::Constant { .. } => None,
        };
        if let Some(why) = refused {
            return Err(at_its_field(by, why));
        }
        record.finish()?;
        Ok(Self { stimulus, set, set_place, method, place: value.place() })
    }
}

/// Why no level tells anything about the thresholds; `None` where their ranges meet.
fn unreachable_by(settings: &QuestSettings) -> Option<String> {
    // As people write them: a grid's ends are rounded.
    let ends = |of: Vec<f64>| {
        of.iter().map(|x| *x as f32).fold([f32::MAX, f32::MIN], |[l, h], x| [l.min(x), h.max(x)])
    };
    let [least, most] = ends(settings.levels().ok()?);
    let [low, high] = ends(settings.thresholds().ok()?);
    let why = || format!("`threshold` is {low} to {high}: use values among the levels, {least} to {most}");
    (low > most || high < least).then(why)
}

/// A refusal of settings, at the field that it begins with: `` `start` is 1: ... ``.
fn at_its_field(value: &Value, why: String) -> Diagnostic {
    let path = why.strip_prefix('`').and_then(|rest| rest.split_once('`')).map_or("", |(path, _)| path);
    let within = |value: &Value, name: &str| match value.kind() {
        Kind::Record { fields, .. } => {
            fields.iter().find(|(key, _)| key.name == name).map(|(_, value)| value.clone())
        }
        _ => None,
    };
    let mut at = value.clone();
    for name in path.split('.') {
        let Some(inner) = within(&at, name) else { break };
        at = inner;
    }
    at.error(why)
}

fn staircase(record: &mut Record<'_>) -> Result<StaircaseSettings, Diagnostic> {
    let listed = record.required("steps")?;
    let name = variant(listed, &["add", "multiply"])?;
    let mut sizes = listed.record(name)?;
    let by = numbers(sizes.required("by")?)?;
    sizes.finish()?;
    Ok(StaircaseSettings {
        start: record.required("start")?.f64()?,
        floor: record.required("floor")?.f64()?,
        ceiling: record.required("ceiling")?.f64()?,
        steps: if name == "add" { Steps::Add { by } } else { Steps::Multiply { by } },
        down: count(record.required("down")?)?,
        up: record.optional("up").map_or(Ok(1), count)?,
        up_over_down: record.optional("up_over_down").map_or(Ok(1.0), Value::f64)?,
        trials: count(record.required("trials")?)?,
        reversals: record.optional("reversals").map(count).transpose()?,
        average: record.optional("average").map_or(Ok(10), count)?,
    })
}

/// Settings of a fit that a part uses without others: a Weibull function for a task with a right answer, and
/// a Gaussian one for a comparison.
fn usual(chance: f64) -> FitSettings {
    let shape = if chance > 0.0 { Shape::Weibull } else { Shape::Gaussian };
    FitSettings {
        shape,
        guess: chance,
        lapse: if chance > 0.0 { 0.02 } else { 0.0 },
        ..FitSettings::default()
    }
}

fn quest(record: &mut Record<'_>, chance: f64) -> Result<QuestSettings, Diagnostic> {
    let one = |value: f64| Ok(Grid::Values { of: vec![value] });
    Ok(QuestSettings {
        shape: record.optional("shape").map_or(Ok(usual(chance).shape), shape)?,
        axis: record.optional("unit").map_or(Ok(Axis::Linear), unit)?,
        levels: grid(record.required("levels")?)?,
        threshold: grid(record.required("threshold")?)?,
        slope: grid(record.required("slope")?)?,
        guess: record.optional("guess").map_or_else(|| one(chance), grid)?,
        lapse: record.optional("lapse").map_or_else(|| one(0.02), grid)?,
        trials: count(record.required("trials")?)?,
        threshold_sd: record.optional("threshold_sd").map(Value::f64).transpose()?,
    })
}

fn constant(record: &mut Record<'_>, chance: f64) -> Result<Method, Diagnostic> {
    let listed = record.required("levels")?;
    let levels = numbers(listed)?;
    let each = record.required("each")?.i64_in(1..=1000, "trials")? as u32;
    let fit = record.optional("fit").map_or_else(|| Ok(usual(chance)), |v| fit(v, chance))?;
    if levels.len() < 2 {
        return Err(listed.error("a function needs two levels at least"));
    }
    if let Some(twice) = (1..levels.len()).find(|i| levels[..*i].contains(&levels[*i])) {
        let what = format!("the level {} stands twice", levels[twice]);
        return Err(listed.list()?[twice].error(what).help("`each` says how often a level is shown"));
    }
    Ok(Method::Constant { levels, each, fit })
}

fn fit(value: &Value, chance: f64) -> Result<FitSettings, Diagnostic> {
    let mut record = value.record("Fit")?;
    let usual = usual(chance);
    let lapse = record.optional("lapse").map_or(Ok(usual.lapse), |v| v.f64_in(0.0..=0.99, ""))?;
    let settings = FitSettings {
        shape: record.optional("shape").map_or(Ok(usual.shape), shape)?,
        axis: record.optional("unit").map_or(Ok(usual.axis), unit)?,
        guess: record.optional("guess").map_or(Ok(usual.guess), |v| v.f64_in(0.0..=0.99, ""))?,
        lapse,
        lapse_up_to: record.optional("lapse_up_to").map(|v| v.f64_in(lapse..=0.99, "")).transpose()?,
        confidence: record
            .optional("confidence")
            .map_or(Ok(usual.confidence), |v| v.f64_in(0.5..=0.999, ""))?,
    };
    record.finish()?;
    Ok(settings)
}

/// The psychometric function of a simulated person.
pub(crate) fn function(value: &Value) -> Result<Function, Diagnostic> {
    let mut record = value.record("Function")?;
    let function = Function {
        shape: shape(record.required("shape")?)?,
        axis: record.optional("unit").map_or(Ok(Axis::Linear), unit)?,
        threshold: record.required("threshold")?.f64()?,
        slope: record.required("slope")?.f64()?,
        guess: record.required("guess")?.f64()?,
        lapse: record.required("lapse")?.f64()?,
    };
    record.finish()?;
    function.check().map_err(|why| at_its_field(value, why))?;
    Ok(function)
}

fn shape(value: &Value) -> Result<Shape, Diagnostic> {
    Ok(match value.choice(&["weibull", "logistic", "gaussian"])? {
        "logistic" => Shape::Logistic,
        "gaussian" => Shape::Gaussian,
        _ => Shape::Weibull,
    })
}

/// Unit of the varied parameter.
fn unit(value: &Value) -> Result<Axis, Diagnostic> {
    Ok(match value.choice(&["linear", "log10", "decibel"])? {
        "log10" => Axis::Log10,
        "decibel" => Axis::Decibel,
        _ => Axis::Linear,
    })
}

/// Values of a parameter: a number alone, or a grid.
fn grid(value: &Value) -> Result<Grid, Diagnostic> {
    if matches!(value.kind(), Kind::Int(_) | Kind::Float(_)) {
        return Ok(Grid::Values { of: vec![value.f64()?] });
    }
    let name = variant(value, &["values", "linear", "logarithmic"])?;
    let mut record = value.record(name)?;
    let grid = if name == "values" {
        Grid::Values { of: numbers(record.required("of")?)? }
    } else {
        let (from, to) = (record.required("from")?.f64()?, record.required("to")?.f64()?);
        let count = count(record.required("count")?)?;
        if name == "linear" {
            Grid::Linear { from, to, count }
        } else {
            Grid::Logarithmic { from, to, count }
        }
    };
    record.finish()?;
    Ok(grid)
}

fn numbers(value: &Value) -> Result<Vec<f64>, Diagnostic> {
    value.list()?.iter().map(Value::f64).collect()
}

fn count(value: &Value) -> Result<u32, Diagnostic> {
    value.i64_in(0..=1_000_000, "").map(|n| n as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{parse, text};

    /// A part that varies a parameter by a method.
    fn varied(by: &str) -> Result<Method, Diagnostic> {
        let part = format!(
            "show: [(\"x\", \"z\")], ask: [which(name: \"w\", text: \"?\")],
             vary: (stimulus: \"z\", set: \"a.b\", by: {by})"
        );
        parse(&text("", &part)).map(|study| study.parts[0].vary.clone().expect("it varies").method)
    }

    const QUEST: &str = "quest(levels: logarithmic(from: 0.1, to: 1, count: 9),
        threshold: linear(from: 0.2, to: 0.9, count: 9), slope: 3.5, trials: 60)";
    const STAIRS: &str =
        "staircase(start: 2, floor: 1, ceiling: 3, steps: multiply(by: [2, 1.5]), down: 2, trials: 30)";

    /// Each mistake, a part of its message, and the text that it points at.
    #[test]
    fn mistakes_in_methods_are_refused_where_they_stand() {
        for (good, from, to, message, at) in [
            (QUEST, "slope: 3.5", "slope: \"a\"", "has no kind", "\"a\""),
            (QUEST, "slope: 3.5", "slope: 0", "`slope` is 0", "0"),
            (QUEST, "from: 0.2", "from: 2", "`threshold.to` is 0.9", "0.9"),
            (
                QUEST,
                "linear(from: 0.2, to: 0.9, count: 9)",
                "7",
                "use values among the levels, 0.1 to 1",
                "7",
            ),
            (QUEST, "trials: 60", "trials: 0", "`trials` is 0", "0"),
            (QUEST, "trials: 60", "trials: 60, gues: 0", "unknown field `gues`", "gues"),
            (QUEST, "trials: 60", "trials: 60, guess: 1.5", "`guess` is 1.5", "1.5"),
            (QUEST, "trials: 60", "trials: 60, unit: dB", "unknown choice `dB`", "dB"),
            (QUEST, "trials: 60", "trials: 60, shape: normal", "unknown choice `normal`", "normal"),
            (STAIRS, "floor", "flor", "the field `floor` is missing", "flor"),
            (STAIRS, "[2, 1.5]", "[]", "`steps` is empty", "multiply(by: [])"),
            (STAIRS, "trials: 30", "trials: 15", "use 16 or more", "15"),
            (STAIRS, "down: 2", "down: -1", "-1 is out of range", "-1"),
            ("constant(levels: [1, 2], each: 3)", "2]", "2, 1]", "the level 1 stands twice", "1"),
            ("constant(levels: [1, 2], each: 3)", ", 2]", "]", "two levels at least", "[1]"),
        ] {
            assert!(good.contains(from) && varied(good).is_ok(), "{good}");
            let error = varied(&good.replacen(from, to, 1)).unwrap_err();
            assert!(error.to_string().contains(message), "{error}\nwanted {message}");
            let place = error.place.expect("a place");
            assert_eq!(&place.source.text()[place.span.start..place.span.end], at, "{message}");
        }
    }

    /// A new user fitted a function that starts at 0 % to a task in which one of two answers is right.
    #[test]
    fn guess_and_shape_follow_the_question() {
        let method = |reference: &str, by: &str| {
            let part = format!(
                "show: [(\"x\", \"z\")], {reference} ask: [which(name: \"w\", text: \"?\")],
                 vary: (stimulus: \"z\", set: \"a.b\", by: {by})"
            );
            parse(&text("", &part)).unwrap().parts[0].vary.clone().expect("it varies").method
        };
        let constant = "constant(levels: [1, 2], each: 3)";
        for by in [constant, QUEST] {
            assert_eq!(method("", by).guess(), Some(0.0), "{by}");
            assert_eq!(method("reference: \"x\",", by).guess(), Some(0.5), "{by}");
        }
        let stated = constant.replace("each: 3", "each: 3, fit: (guess: 0.25)");
        let Method::Constant { fit, .. } = method("reference: \"x\",", &stated) else { panic!() };
        assert_eq!((fit.guess, fit.lapse, fit.shape), (0.25, 0.02, Shape::Weibull));
    }

    #[test]
    fn number_alone_is_a_grid_of_one() {
        let with = QUEST.replace("trials: 60", "trials: 60, guess: 0, lapse: 0.05");
        let Method::Quest(settings) = varied(&with).unwrap() else { panic!("QUEST+") };
        let one = |x| Grid::Values { of: vec![x] };
        assert_eq!((settings.guess, settings.lapse, settings.slope), (one(0.0), one(0.05), one(3.5)));
    }
}
