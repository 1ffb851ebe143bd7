//! What is known of the types of ports while a graph is drawn: nearly as the compiler will settle them.

use std::collections::BTreeMap;

use asperity_node::{
    Descriptor, FrameLayout, Input, LayoutSpec, Output, RateSpec, ShapeSpec, Unit, UnitSpec, Var,
};

/// A shape as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Known {
    Control(usize),
    Audio(Option<u32>),
    Magnitude(Option<FrameLayout>),
    Spectrum(Option<FrameLayout>),
}

/// What a node's variables stand for.
#[derive(Clone, Debug, Default)]
struct Bound {
    shapes: BTreeMap<Var, Known>,
    rates: BTreeMap<Var, u32>,
    layouts: BTreeMap<Var, FrameLayout>,
    units: BTreeMap<Var, Unit>,
}

impl Bound {
    fn shape(&self, spec: &ShapeSpec, audio_hz: u32) -> Option<Known> {
        let rate = |rate: &RateSpec| match rate {
            RateSpec::Graph => Some(audio_hz),
            RateSpec::Hz(hz) => Some(*hz),
            RateSpec::Of(var) => self.rates.get(var).copied(),
        };
        let layout = |layout: &LayoutSpec| match layout {
            LayoutSpec::Is(layout) => Some(*layout),
            LayoutSpec::Of(var) => self.layouts.get(var).copied(),
        };
        Some(match spec {
            ShapeSpec::Like(var) => return self.shapes.get(var).copied(),
            ShapeSpec::Control(count) => Known::Control(*count),
            ShapeSpec::Audio(hz) => Known::Audio(rate(hz)),
            ShapeSpec::Magnitude(of) => Known::Magnitude(layout(of)),
            ShapeSpec::Spectrum(of) => Known::Spectrum(layout(of)),
        })
    }

    fn unit<'s>(&'s self, spec: &'s UnitSpec) -> Option<&'s Unit> {
        match spec {
            UnitSpec::Is(unit) => Some(unit),
            UnitSpec::Of { var, .. } => self.units.get(var),
        }
    }

    fn bind(&mut self, shape: &ShapeSpec, known: Option<Known>, unit: &UnitSpec, is: Option<&Unit>) {
        match (shape, known) {
            (ShapeSpec::Like(var), Some(known)) => {
                self.shapes.insert(*var, known);
            }
            (ShapeSpec::Audio(RateSpec::Of(var)), Some(Known::Audio(Some(hz)))) => {
                self.rates.insert(*var, hz);
            }
            (
                ShapeSpec::Magnitude(LayoutSpec::Of(var)) | ShapeSpec::Spectrum(LayoutSpec::Of(var)),
                Some(Known::Magnitude(Some(layout)) | Known::Spectrum(Some(layout))),
            ) => {
                self.layouts.insert(*var, layout);
                self.rates.insert(*var, layout.rate_hz);
            }
            _ => {}
        }
        if let (UnitSpec::Of { var, .. }, Some(unit)) = (unit, is) {
            self.units.insert(*var, unit.clone());
        }
    }
}

/// Either, or the one that is known better; none where they differ.
fn both<T: PartialEq>(a: Option<T>, b: Option<T>) -> Result<Option<T>, ()> {
    match (a, b) {
        (Some(a), Some(b)) if a != b => Err(()),
        (a, b) => Ok(a.or(b)),
    }
}

fn same(a: Known, b: Known) -> Result<Known, ()> {
    Ok(match (a, b) {
        (Known::Control(m), Known::Control(n)) if m == n => Known::Control(m),
        (Known::Audio(m), Known::Audio(n)) => Known::Audio(both(m, n)?),
        (Known::Magnitude(m), Known::Magnitude(n)) => Known::Magnitude(both(m, n)?),
        (Known::Spectrum(m), Known::Spectrum(n)) => Known::Spectrum(both(m, n)?),
        _ => return Err(()),
    })
}

/// Nodes, and what is known of their ports.
pub(super) struct Types<'d> {
    pub(super) nodes: Vec<&'d Descriptor>,
    bound: Vec<Bound>,
    audio_hz: u32,
}

impl<'d> Types<'d> {
    pub(super) fn new(audio_hz: u32) -> Self {
        Self { nodes: Vec::new(), bound: Vec::new(), audio_hz }
    }

    pub(super) fn add(&mut self, node: &'d Descriptor) {
        self.nodes.push(node);
        self.bound.push(Bound::default());
    }

    /// Whether there is something for every input that must be wired.
    pub(super) fn serves(&self, node: &Descriptor) -> bool {
        let new = Bound::default();
        let served =
            |input: &Input| self.outputs().any(|(i, o)| self.is_sure(i, o) && self.joins(i, o, &new, input));
        node.inputs.iter().filter(|input| !input.optional).all(served)
    }

    /// All outputs, with their nodes.
    pub(super) fn outputs(&self) -> impl Iterator<Item = (usize, &'d Output)> + '_ {
        self.nodes.iter().enumerate().flat_map(|(i, d)| d.outputs.iter().map(move |o| (i, o)))
    }

    /// Whether an output is there whatever is: what comes from a file or a message is often its first output alone.
    pub(super) fn is_sure(&self, node: usize, output: &Output) -> bool {
        self.nodes.get(node).is_some_and(|d| {
            d.inputs.iter().any(|i| !i.optional && !i.fed)
                || d.outputs.first().is_some_and(|f| f.name == output.name)
        })
    }

    /// Whether what an output carries may enter an input of a node, as far as is known.
    pub(super) fn fits(&self, from: usize, output: &Output, to: usize, input: &Input) -> bool {
        self.bound.get(to).is_some_and(|bound| self.joins(from, output, bound, input))
    }

    fn joins(&self, from: usize, output: &Output, to: &Bound, input: &Input) -> bool {
        let Some(bound) = self.bound.get(from) else { return false };
        let shapes = match (bound.shape(&output.shape, self.audio_hz), to.shape(&input.shape, self.audio_hz))
        {
            (Some(a), Some(b)) => same(a, b).is_ok(),
            (Some(_), None) => true,
            // What it will be is not known; what closes a loop is wired to what comes later.
            (None, b) => b.is_some() && self.nodes.get(from).is_some_and(|d| d.feedback.is_some()),
        };
        let among = |spec: &UnitSpec, unit: &Unit| match spec {
            UnitSpec::Is(_) => true,
            UnitSpec::Of { among, .. } => among.is_empty() || among.contains(unit),
        };
        let units = match (bound.unit(&output.unit), to.unit(&input.unit)) {
            (Some(a), Some(b)) => a == b,
            (Some(a), None) => among(&input.unit, a),
            (None, Some(b)) => among(&output.unit, b),
            (None, None) => true,
        };
        shapes && units && (!input.limited || output.limited)
    }

    /// Remembers what a wire says of both its ends.
    pub(super) fn join(&mut self, from: usize, output: &Output, to: usize, input: &Input) {
        let (Some(a), Some(b)) = (self.bound.get(from), self.bound.get(to)) else { return };
        let shapes = (a.shape(&output.shape, self.audio_hz), b.shape(&input.shape, self.audio_hz));
        let shape = match shapes {
            (Some(a), Some(b)) => same(a, b).ok(),
            (a, b) => a.or(b),
        };
        let unit = a.unit(&output.unit).or(b.unit(&input.unit)).cloned();
        for (node, shape_spec, unit_spec) in
            [(from, &output.shape, &output.unit), (to, &input.shape, &input.unit)]
        {
            if let Some(bound) = self.bound.get_mut(node) {
                bound.bind(shape_spec, shape, unit_spec, unit.as_ref());
            }
        }
    }

    /// Whether it is known what an output of a node carries.
    pub(super) fn knows(&self, node: usize, output: &Output) -> bool {
        self.bound.get(node).is_some_and(|b| b.shape(&output.shape, self.audio_hz).is_some())
    }

    /// Whether a node has to do with samples, which need it in every tick.
    pub(super) fn hears(&self, node: usize) -> bool {
        let (Some(d), Some(bound)) = (self.nodes.get(node), self.bound.get(node)) else { return false };
        let specs = d.inputs.iter().map(|i| &i.shape).chain(d.outputs.iter().map(|o| &o.shape));
        specs.into_iter().any(|spec| matches!(bound.shape(spec, self.audio_hz), Some(Known::Audio(_))))
    }
}
