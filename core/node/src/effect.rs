//! Effects: kinds of node that a surface of a scene can have.
//!
//! A scene names an effect by its kind, as in `friction: dahl(coefficient: 0.4)`. Scenes, checks and pages
//! of the docs take all that they need from the kind's [`Effect`]. Nothing else lists effects, so that a
//! plugin's effect works like a built-in one.

use std::borrow::Cow;
use std::fmt;
use std::ops::{Add, Deref};
use std::path::PathBuf;
use std::sync::Arc;

use asperity_diagnostics::ron::{Kind, Value};
use asperity_diagnostics::{Diagnostic, Span, one_of};

use crate::{Param, ParamKind, ParamValue, Params};

/// Where on a surface an effect acts. A scene adds effects up in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Acts {
    /// While a wall is touched. A wall is a surface with a stiffness.
    Touching,
    /// While a wall is touched, and inside of a volume, a surface without a stiffness.
    Inside,
    /// From both sides of a surface, as far as the field `reach_mm` of its settings says.
    Near,
    /// While a stylus glides over a wall: a texture. A scene names it behind `texture`, crossfades it from
    /// one surface to the next, and gates it by speed.
    Gliding,
}

impl Acts {
    /// Words for a person.
    pub fn words(self) -> &'static str {
        match self {
            Self::Touching => "while a wall is touched",
            Self::Inside => "while a wall is touched, and inside of a volume",
            Self::Near => "from both sides of a surface, within its reach",
            Self::Gliding => "while a stylus glides over a wall",
        }
    }
}

/// The direction in which a force acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Along the surface's normal.
    Normal,
    /// Along the surface.
    Surface,
    /// Against any motion.
    Any,
}

/// A linear law of force F = K x + B v along one direction, as it is near the place where it is steepest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Law {
    /// Stiffness K \[N/mm\], at least 0.
    pub stiffness_n_per_mm: f64,
    /// Damping B \[N s/m\], of either sign.
    pub damping_ns_per_m: f64,
}

impl Add for Law {
    type Output = Self;

    /// Both laws at once along one direction.
    fn add(self, other: Self) -> Self {
        Self {
            stiffness_n_per_mm: self.stiffness_n_per_mm + other.stiffness_n_per_mm,
            damping_ns_per_m: self.damping_ns_per_m + other.damping_ns_per_m,
        }
    }
}

/// One way to write the settings of an effect: `name(field: value, ...)`.
#[must_use]
#[derive(Clone, Debug)]
pub struct Form {
    /// The word before the parenthesis. Empty for an effect with a single form, which is written without
    /// a word. As a texture it is written with the kind's name.
    pub name: Cow<'static, str>,
    /// Fields with one value.
    pub fields: Vec<Param>,
    /// Fields with a structure of their own, which the node reads. Each may be left out. Built-in kinds
    /// only: the plugin interface has no such fields.
    pub nested: Vec<Cow<'static, str>>,
    /// A text of this form.
    pub example: Cow<'static, str>,
}

impl Form {
    /// A form with no fields yet, and a text of this form.
    pub fn new(name: impl Into<Cow<'static, str>>, example: impl Into<Cow<'static, str>>) -> Self {
        Self { name: name.into(), fields: Vec::new(), nested: Vec::new(), example: example.into() }
    }

    /// Adds a field with one value.
    pub fn field(mut self, field: Param) -> Self {
        self.fields.push(field);
        self
    }

    /// Adds a field with a structure of its own.
    pub fn nested(mut self, name: impl Into<Cow<'static, str>>) -> Self {
        self.nested.push(name.into());
        self
    }
}

type LawOf = dyn Fn(&Settings, f64) -> Law + Send + Sync;
type Check = dyn Fn(&Settings) -> Result<(), Diagnostic> + Send + Sync;

/// All that a scene has to know of an effect.
///
/// The node renders an effect for many surfaces. Surfaces with the same settings share a *slot*, an entry
/// in the node's list. The input `slot` picks one; 0 is the first. A value below 0, beyond the list or not
/// a number picks none.
#[must_use]
#[derive(Clone)]
pub struct Effect {
    /// The node's parameter with the list, a text a slot.
    pub list: Cow<'static, str>,
    /// Where it acts.
    pub acts: Acts,
    /// How its settings are written; the first form is the usual one.
    pub forms: Vec<Form>,
    /// For each input beside `slot` its name, and the quantity of the contact that a scene connects to it.
    pub needs: Vec<(Cow<'static, str>, Cow<'static, str>)>,
    law: Option<(Direction, Arc<LawOf>)>,
    check: Option<Arc<Check>>,
}

impl fmt::Debug for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { list, acts, forms, needs, .. } = self;
        let mut f = f.debug_struct("Effect");
        f.field("list", list).field("acts", acts).field("forms", forms).field("needs", needs).finish()
    }
}

impl Effect {
    /// An effect whose node takes its settings in the parameter `list`.
    pub fn new(list: impl Into<Cow<'static, str>>, acts: Acts) -> Self {
        Self { list: list.into(), acts, forms: Vec::new(), needs: Vec::new(), law: None, check: None }
    }

    /// Adds a form.
    pub fn form(mut self, form: Form) -> Self {
        self.forms.push(form);
        self
    }

    /// Connects a quantity of the contact to an input.
    pub fn needs(
        mut self,
        input: impl Into<Cow<'static, str>>,
        quantity: impl Into<Cow<'static, str>>,
    ) -> Self {
        self.needs.push((input.into(), quantity.into()));
        self
    }

    /// Gives the law of its force for some settings and a normal force \[N\]. It tells a scene whether the
    /// device bears the effect.
    pub fn law(
        mut self,
        direction: Direction,
        law: impl Fn(&Settings, f64) -> Law + Send + Sync + 'static,
    ) -> Self {
        self.law = Some((direction, Arc::new(law)));
        self
    }

    /// Adds a check beyond the ranges of the fields.
    pub fn check(
        mut self,
        check: impl Fn(&Settings) -> Result<(), Diagnostic> + Send + Sync + 'static,
    ) -> Self {
        self.check = Some(Arc::new(check));
        self
    }

    /// The direction of its force, and the law for some settings and a normal force \[N\]. `None` for an
    /// effect that gives no law.
    pub fn law_of(&self, settings: &Settings, normal_force_n: f64) -> Option<(Direction, Law)> {
        let (direction, law) = self.law.as_ref()?;
        Some((*direction, law(settings, normal_force_n)))
    }

    /// A form as a scene writes it for the effect of a kind, with the example's settings.
    pub fn written(&self, kind: &str, form: &Form) -> String {
        let key = if self.acts == Acts::Gliding { "texture" } else { kind };
        format!("{key}: {}", form.example)
    }

    /// The direction of its force; `None` for an effect that gives no law.
    pub fn direction(&self) -> Option<Direction> {
        self.law.as_ref().map(|(direction, _)| *direction)
    }

    /// Checks settings beyond the ranges of their fields.
    ///
    /// # Errors
    /// The effect refuses them.
    pub fn checked(&self, settings: &Settings) -> Result<(), Diagnostic> {
        self.check.as_ref().map_or(Ok(()), |check| check(settings))
    }

    /// The field that a path alone stands for: a file, if no other field of a single form must be given.
    pub fn path_field(&self) -> Option<&Param> {
        let [form] = &self.forms[..] else { return None };
        let mut required = form.fields.iter().filter(|field| field.default.is_none() && !field.optional);
        let only = required.next().filter(|field| matches!(field.kind, ParamKind::File));
        only.filter(|_| required.next().is_none())
    }

    /// Reads settings of the effect of a kind. A text is the path of its [`path_field`](Self::path_field).
    ///
    /// # Errors
    /// An unknown form or field, a value of the wrong type or out of its range, settings that the effect's
    /// check refuses. Files are not looked for.
    pub fn read(&self, kind: &str, value: &Value) -> Result<Settings, Diagnostic> {
        let form = self.form_of(kind, value)?;
        let name = if form.name.is_empty() { kind } else { form.name.as_ref() };
        let by_path = self.path_field().filter(|_| matches!(value.kind(), Kind::Text(_)));
        let mut record = match value.kind() {
            Kind::Word(_) => None,
            Kind::Text(_) if by_path.is_some() => None,
            _ => Some(value.record(name)?),
        };
        let mut params = Params::new(Some(value.place()));
        for field in &form.fields {
            let required = field.default.is_none() && !field.optional;
            let given = match &mut record {
                Some(record) if required => record.required(&field.name).map(Some),
                Some(record) => Ok(record.optional(&field.name)),
                None if by_path.is_some_and(|path| path.name == field.name) => Ok(Some(value)),
                None if required => Err(value.error(format!("`{name}` needs the field `{}`", field.name))),
                None => Ok(None),
            };
            let given = given.map_err(|e| e.help(form.example.to_string()))?;
            let read = given.map(|value| field.read(value)).transpose()?;
            params.insert(
                field.name.to_string(),
                read.or_else(|| field.default.clone()),
                given.map(Value::place),
            );
        }
        let mut nested = Vec::new();
        for name in &form.nested {
            if let Some(value) = record.as_mut().and_then(|record| record.optional(name)) {
                nested.push((name.to_string(), value.clone()));
            }
        }
        if let Some(record) = record {
            record.finish()?;
        }
        let settings = Settings { form: form.name.to_string(), params, nested };
        self.checked(&settings)?;
        Ok(settings)
    }

    /// The form in which a value is written.
    fn form_of(&self, kind: &str, value: &Value) -> Result<&Form, Diagnostic> {
        let [first, ..] = &self.forms[..] else {
            return Err(value.error(format!("`{kind}` has no settings")));
        };
        if first.name.is_empty() {
            return match value.kind() {
                Kind::Word(word) if word != kind => {
                    Err(value.error(format!("expected `{kind}(...)`, found {}", value.describe())))
                }
                _ => Ok(first),
            };
        }
        let names = || self.forms.iter().map(|form| form.name.as_ref());
        let (Kind::Word(name) | Kind::Record { name: Some(name), .. }) = value.kind() else {
            let message = format!("expected a {kind}, found {}", value.describe());
            return Err(value.error(message).help(one_of("", names())));
        };
        self.forms.iter().find(|form| form.name == *name).ok_or_else(|| {
            let span = Span { start: value.span().start, end: value.span().start + name.len() };
            let message = format!("unknown {kind} `{name}`");
            Diagnostic::new(message).at(value.source(), span).help(one_of(name, names()))
        })
    }
}

/// The settings of an effect of a surface, as [`Effect::read`] read them. Its fields are [`Params`].
#[derive(Clone, Debug)]
pub struct Settings {
    form: String,
    params: Params,
    nested: Vec<(String, Value)>,
}

impl Deref for Settings {
    type Target = Params;

    fn deref(&self) -> &Params {
        &self.params
    }
}

impl PartialEq for Settings {
    /// Whether both say the same, wherever they stand.
    fn eq(&self, other: &Self) -> bool {
        self.form == other.form && self.nested == other.nested && self.params.iter().eq(other.params.iter())
    }
}

impl Settings {
    /// Settings of the form of this name. The place of the node of `params` is where errors point.
    pub fn new(form: impl Into<String>, params: Params) -> Self {
        Self { form: form.into(), params, nested: Vec::new() }
    }

    /// The form's name; empty for a single form.
    pub fn form(&self) -> &str {
        &self.form
    }

    /// Sets a field with a number to another one.
    pub fn set_number(&mut self, field: &str, value: f64) {
        self.params.set_number(field, value);
    }

    /// A field with a structure of its own.
    pub fn nested(&self, name: &str) -> Option<&Value> {
        self.nested.iter().find(|(n, _)| n == name).map(|(_, value)| value)
    }

    /// All that they say but for one field, as a text: the same for the same settings.
    pub fn text_without(&self, field: &str) -> String {
        let fields = self.params.iter().filter(|(name, _)| *name != field);
        let fields = fields.map(|(name, value)| format!(" {name}: {value}"));
        let nested = self.nested.iter().map(|(name, value)| format!(" {name}: {value}"));
        std::iter::once(self.form.clone()).chain(fields).chain(nested).collect()
    }

    /// The files that they name: fields of the kind [`ParamKind::File`], and fields `file` of nested ones.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files = Vec::new();
        for (_, value) in self.params.iter() {
            if let ParamValue::File(path) = value {
                files.push(path.clone());
            }
        }
        self.nested.iter().for_each(|(_, value)| named_files(value, &mut files));
        files
    }
}

fn named_files(value: &Value, files: &mut Vec<PathBuf>) {
    if let Kind::Record { fields, .. } = value.kind() {
        for (key, value) in fields {
            match value.path() {
                Ok(path) if key.name == "file" => files.push(path),
                _ => named_files(value, files),
            }
        }
    }
}

impl Param {
    /// Reads the value of a parameter as a file writes it. A file's path is relative to the text that names
    /// it. Whether that file exists is not checked.
    ///
    /// # Errors
    /// A value of the wrong type or out of the range.
    pub fn read(&self, value: &Value) -> Result<ParamValue, Diagnostic> {
        let unit = self.unit.as_ref();
        match &self.kind {
            ParamKind::Number(range) => value.f64_in(range.clone(), unit).map(ParamValue::Number),
            ParamKind::Integer(range) => value.i64_in(range.clone(), unit).map(ParamValue::Integer),
            ParamKind::Flag => value.bool().map(ParamValue::Flag),
            ParamKind::Text => value.text().map(|t| ParamValue::Text(t.to_owned())),
            ParamKind::Choice(words) => {
                let words: Vec<&str> = words.iter().map(|w| w.as_ref()).collect();
                value.choice(&words).map(|w| ParamValue::Text(w.to_owned()))
            }
            ParamKind::File => value.path().map(ParamValue::File),
            ParamKind::Numbers(range) => {
                let items = value.list()?.iter().map(|v| v.f64_in(range.clone(), unit));
                items.collect::<Result<_, _>>().map(ParamValue::Numbers)
            }
            ParamKind::Texts => {
                let items = value.list()?.iter().map(|v| v.text().map(str::to_owned));
                items.collect::<Result<_, _>>().map(ParamValue::Texts)
            }
        }
    }
}
