//! The words that nodes are written in: traits and types of `asperity_node`, and ports and parameters in the
//! forms that nodes have most often. Each takes its meaning by `doc`.

use std::borrow::Cow;
use std::ops::RangeInclusive;

pub(crate) use asperity_node::{
    Acts, Config, Descriptor, Diagnostic, Direction, Effect, Fact, Form, FrameClock, FrameLayout, FrameRate,
    Input, Inputs, Keep, Latency, Law, LayoutSpec, Node, Output, Param, Params, Ports, Prepared, Processor,
    RateSpec, Resume, Role, Settings, Setup, Shape, ShapeSpec, State, Status, Tick, Unit, UnitSpec, random,
    time,
};

pub(crate) const ONE: Unit = Unit::NONE;
pub(crate) const MM: Unit = Unit::MILLIMETRE;
pub(crate) const MM_S: Unit = Unit::MILLIMETRE_PER_SECOND;
pub(crate) const N: Unit = Unit::NEWTON;

/// Values that are the same for a whole tick.
pub(crate) fn control(name: &'static str, count: usize, unit: Unit) -> Input {
    Input::new(name, ShapeSpec::Control(count), unit)
}

pub(crate) fn control_out(name: &'static str, count: usize, unit: Unit) -> Output {
    Output::new(name, ShapeSpec::Control(count), unit)
}

/// Audio of any rate and unit; that of [`audio_out`] is the same.
pub(crate) fn audio(name: &'static str) -> Input {
    Input::new(name, ShapeSpec::Audio(RateSpec::Of('r')), Unit::NONE).unit_of('u')
}

pub(crate) fn audio_out(name: &'static str) -> Output {
    Output::new(name, ShapeSpec::Audio(RateSpec::Of('r')), Unit::NONE).unit_of('u')
}

/// Audio that drives a coil: a current or a voltage.
pub(crate) fn drive(rate: RateSpec) -> Input {
    const DRIVES: &[Unit] = &[Unit::AMPERE, Unit::VOLT];
    Input::new("in", ShapeSpec::Audio(rate), Unit::NONE).unit_among('u', DRIVES)
}

/// A signal of any type; that of [`like_out`] is the same.
pub(crate) fn like(name: &'static str) -> Input {
    Input::new(name, ShapeSpec::Like('s'), Unit::NONE).unit_of('u')
}

pub(crate) fn like_out(name: &'static str) -> Output {
    Output::new(name, ShapeSpec::Like('s'), Unit::NONE).unit_of('u')
}

/// Frames of any layout; the outputs below have the same.
pub(crate) fn magnitude() -> Input {
    Input::new("magnitude", ShapeSpec::Magnitude(LayoutSpec::Of('l')), Unit::NONE).unit_of('u')
}

pub(crate) fn spectrum_out() -> Output {
    Output::new("spectrum", ShapeSpec::Spectrum(LayoutSpec::Of('l')), Unit::NONE).unit_of('u')
}

/// Audio at the frames' rate.
pub(crate) fn signal_out() -> Output {
    Output::new("signal", ShapeSpec::Audio(RateSpec::Of('l')), Unit::NONE)
        .unit_of('u')
        .doc("signal at the sample rate of the frames")
}

pub(crate) fn number(
    name: &'static str,
    default: f64,
    range: RangeInclusive<f64>,
    unit: &'static str,
) -> Param {
    Param::number(name, default, range, "").unit(unit)
}

pub(crate) fn integer(name: &'static str, default: i64, range: RangeInclusive<i64>) -> Param {
    Param::integer(name, default, range, "")
}

pub(crate) fn choice(name: &'static str, words: &[&'static str]) -> Param {
    Param::choice(name, words, "")
}

pub(crate) fn text(name: &'static str, default: &str) -> Param {
    Param::text(name, default, "")
}

pub(crate) fn texts(name: &'static str) -> Param {
    Param::texts(name, "")
}

pub(crate) fn file(name: &'static str) -> Param {
    Param::file(name, "")
}

/// The seed of a node; the graph's where it is left out.
pub(crate) fn seed() -> Param {
    Param::integer("seed", 1, 0..=i64::MAX, "").optional()
}

/// An error of a library at the parameter that it is about.
pub(crate) fn error_at(params: &Params, name: &str, e: Diagnostic) -> Diagnostic {
    let placed = params.error(name, e.message);
    match e.help {
        Some(help) => placed.help(help),
        None => placed,
    }
}

/// Documents a parameter, or the last addition to a descriptor or a form: all else has its words already.
pub(crate) trait Doc {
    fn doc(self, doc: &'static str) -> Self;
}

/// Gives the only one without words its words.
fn document<'d>(mut all: impl Iterator<Item = &'d mut Cow<'static, str>>, doc: &'static str) {
    if let Some(empty) = all.find(|doc| doc.is_empty()) {
        *empty = doc.into();
    }
}

impl Doc for Param {
    fn doc(mut self, doc: &'static str) -> Self {
        self.doc = doc.into();
        self
    }
}

impl Doc for Descriptor {
    fn doc(mut self, doc: &'static str) -> Self {
        let (inputs, outputs) = (self.inputs.iter_mut(), self.outputs.iter_mut());
        let ports = inputs.map(|i| &mut i.doc).chain(outputs.map(|o| &mut o.doc));
        document(ports.chain(self.params.iter_mut().map(|p| &mut p.doc)), doc);
        self
    }
}

impl Doc for Form {
    fn doc(mut self, doc: &'static str) -> Self {
        document(self.fields.iter_mut().map(|p| &mut p.doc), doc);
        self
    }
}
