//! Converts a setup from the interface's form.

use std::path::Path;
use std::sync::Arc;

use asperity_abi::*;
use asperity_node::{
    Config, Descriptor, Diagnostic, Form, FrameLayout, FrameRate, Param, ParamKind, ParamValue, Params,
    Place, PortType, Settings, Setup, Shape, Source, Span, Unit, Wiring,
};

use crate::text::Theirs;

/// A placeholder for the position of each parameter, by which an error finds the index of its parameter.
pub(crate) type Sources = Vec<(Arc<Source>, usize)>;

/// Settings of an effect that own a copy of the host's data.
pub(crate) struct SlotSettings {
    pub(crate) settings: Settings,
    /// The fields.
    pub(crate) sources: Sources,
}

impl SlotSettings {
    /// Reads settings of one of the forms.
    pub(crate) fn read(theirs: Theirs, settings: *const AsperitySettings, forms: &[Form]) -> Option<Self> {
        let abi = theirs.read(settings)?;
        let form = forms.get(abi.form as usize)?;
        let place = Place { source: Source::new("settings", ""), span: Span::default() };
        let mut params = Params::new(Some(place));
        let fields = form.fields.get(..abi.value_count as usize)?;
        let sources = values(theirs, abi.values, fields, &mut params)?;
        Some(Self { settings: Settings::new(form.name.to_string(), params), sources })
    }

    /// Where its errors point: itself, and its fields.
    fn places(&self) -> Vec<Arc<Source>> {
        let itself = self.settings.node_place().map(|place| place.source.clone());
        itself.into_iter().chain(self.sources.iter().map(|(source, _)| source.clone())).collect()
    }
}

/// A setup that owns a copy of the host's data.
#[derive(Debug)]
pub(crate) struct HostSetup {
    id: String,
    params: Params,
    sources: Sources,
    abi: AsperitySetup,
    pub(crate) inputs: Vec<Wiring>,
    pub(crate) outputs: Vec<Wiring>,
}

impl HostSetup {
    /// Reads the host's setup.
    pub(crate) fn read(theirs: Theirs, setup: *const AsperitySetup, d: &Descriptor) -> Option<Self> {
        let abi = theirs.read(setup)?;
        let mut params = Params::new(None);
        let of = &d.params[..d.params.len().min(abi.param_count as usize)];
        let mut sources = values(theirs, abi.params, of, &mut params)?;
        if let Some(effect) = &d.effect {
            let list = d.params.iter().position(|param| param.name == effect.list);
            let slot = |slot: AsperitySlot| {
                let all = 0..slot.count as usize;
                let one = |k| SlotSettings::read(theirs, theirs.element(slot.settings, k)?, &effect.forms);
                all.map(one).collect::<Option<Vec<_>>>()
            };
            let slots = theirs.all(abi.slots, abi.slot_count)?.into_iter().map(slot);
            let slots = slots.collect::<Option<Vec<_>>>()?;
            // An error in a slot is one of the list.
            for place in slots.iter().flatten().flat_map(SlotSettings::places) {
                sources.extend(list.map(|list| (place, list)));
            }
            let settings = |slot: Vec<SlotSettings>| slot.into_iter().map(|it| it.settings).collect();
            params.set_slots(slots.into_iter().map(settings).collect());
        }
        let wires = |first, count| -> Option<Vec<Wiring>> {
            Some(theirs.all(first, count)?.iter().map(|w| wiring(theirs, w)).collect())
        };
        Some(Self {
            id: theirs.text(abi.id),
            params,
            sources,
            inputs: wires(abi.inputs, abi.input_count)?,
            outputs: wires(abi.outputs, abi.output_count)?,
            abi,
        })
    }

    /// Configuration before the port types are known.
    pub(crate) fn config(&self) -> Config<'_> {
        let AsperitySetup { every, audio_hz, seed, .. } = self.abi;
        let (id, params) = (&self.id, &self.params);
        Config { id, params, tick_hz: self.tick_hz(), every: every.max(1), audio_hz, seed }
    }

    /// Complete setup.
    pub(crate) fn setup(&self) -> Setup<'_> {
        let closes_cycle = self.abi.closes_cycle != 0;
        Setup { config: self.config(), inputs: &self.inputs, outputs: &self.outputs, closes_cycle }
    }

    /// Ticks a second.
    pub(crate) fn tick_hz(&self) -> u32 {
        self.abi.tick_hz.max(1)
    }

    /// Passes a node's error to the host.
    pub(crate) fn tell(&self, theirs: Theirs, d: &Diagnostic, error: *mut AsperityError) {
        tell(theirs, d, &self.sources, error);
    }
}

/// Passes an error of a node, or of settings, to the host.
pub(crate) fn tell(theirs: Theirs, d: &Diagnostic, sources: &Sources, error: *mut AsperityError) {
    let place = d.place.as_ref();
    let found = place.and_then(|p| sources.iter().find(|(source, _)| Arc::ptr_eq(source, &p.source)));
    let param = found.map(|(_, param)| *param);
    let message = match param {
        Some(_) => d.message.clone(),
        // An error in another file includes its position.
        None => Diagnostic { help: None, ..d.clone() }.to_string(),
    };
    theirs.tell(&message, d.help.as_deref().unwrap_or(""), param, error);
}

/// Reads values of parameters into `params`.
fn values(theirs: Theirs, first: *const AsperityValue, of: &[Param], params: &mut Params) -> Option<Sources> {
    let mut sources = Vec::new();
    for (i, param) in of.iter().enumerate() {
        let value = theirs.read(theirs.element(first, i)?)?;
        let source = Source::new(Path::new(&theirs.text(value.base)).join("graph"), "");
        let place = Place { source: source.clone(), span: Span::default() };
        sources.push((source, i));
        let set = (value.set > 0).then(|| param_value(theirs, &value, param));
        params.insert(param.name.to_string(), set, (value.set == 2).then_some(place));
    }
    Some(sources)
}

fn wiring(theirs: Theirs, w: &AsperityWire) -> Wiring {
    let layout = || {
        let frame_rate = FrameRate::new(w.frame_num, w.frame_den)?;
        Some(FrameLayout { rate_hz: w.rate_hz, length: w.length, bins: w.bins, frame_rate })
    };
    let shape = match w.carries {
        ASPERITY_CONTROL => Some(Shape::Control { count: w.count as usize }),
        ASPERITY_AUDIO => Some(Shape::Audio { rate_hz: w.rate_hz }),
        ASPERITY_MAGNITUDE => layout().map(Shape::Magnitude),
        ASPERITY_SPECTRUM => layout().map(Shape::Spectrum),
        _ => None,
    };
    let unit = Unit::from_symbol(theirs.text(w.unit));
    let limited = w.flags & ASPERITY_LIMITED != 0;
    Wiring { port: shape.map(|shape| PortType { shape, unit, limited }), connected: w.connected != 0 }
}

fn param_value(theirs: Theirs, v: &AsperityValue, param: &Param) -> ParamValue {
    match &param.kind {
        ParamKind::Number(_) => ParamValue::Number(v.number),
        ParamKind::Integer(_) => ParamValue::Integer(v.integer),
        ParamKind::Flag => ParamValue::Flag(v.integer != 0),
        ParamKind::Text | ParamKind::Choice(_) => ParamValue::Text(theirs.text(v.text)),
        ParamKind::File => ParamValue::File(theirs.text(v.text).into()),
        ParamKind::Numbers(_) => ParamValue::Numbers(theirs.list(v.numbers, v.count)),
        ParamKind::Texts => {
            let texts = theirs.list(v.texts, v.count);
            ParamValue::Texts(texts.into_iter().map(|t| theirs.text(t)).collect())
        }
    }
}
