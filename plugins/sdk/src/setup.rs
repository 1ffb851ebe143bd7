//! Converts a setup from the interface's form.

use std::sync::Arc;

use asperity_abi::*;
use asperity_node::{
    Config, Descriptor, Diagnostic, Form, FrameLayout, FrameRate, Param, ParamKind, ParamValue, Params,
    Place, PortType, Settings, Setup, Shape, Source, Span, Unit, Wiring,
};

use crate::text;

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
    ///
    /// # Safety
    /// `settings` is as the host makes it: NULL, or valid with as many values as it says.
    pub(crate) unsafe fn read(settings: *const AsperitySettings, forms: &[Form]) -> Option<Self> {
        // SAFETY: the caller's promise.
        let abi = unsafe { read_grown(settings) }?;
        let form = forms.get(abi.form as usize)?;
        let place = Place { source: Source::new("settings", ""), span: Span::default() };
        let mut params = Params::new(Some(place));
        let fields = form.fields.get(..abi.value_count as usize)?;
        // SAFETY: there are `value_count` values.
        let sources = unsafe { values(abi.values, fields, &mut params) }?;
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
    tick_hz: u32,
    every: u32,
    audio_hz: u32,
    seed: u64,
    pub(crate) inputs: Vec<Wiring>,
    pub(crate) outputs: Vec<Wiring>,
    closes_cycle: bool,
}

impl HostSetup {
    /// Reads the host's setup.
    ///
    /// # Safety
    /// `setup` is as the host makes it: valid, with as many values and wires as it says.
    pub(crate) unsafe fn read(setup: *const AsperitySetup, d: &Descriptor) -> Option<Self> {
        // SAFETY: the caller's promise.
        let setup = unsafe { read_grown(setup) }?;
        let count = setup.param_count as usize;
        let mut params = Params::new(None);
        // SAFETY: there are `param_count` values.
        let mut sources =
            unsafe { values(setup.params, &d.params[..count.min(d.params.len())], &mut params) }?;
        if let Some(effect) = &d.effect {
            let list = d.params.iter().position(|param| param.name == effect.list);
            // SAFETY: there are `slot_count` slots.
            let slots = unsafe { slots(setup.slots, setup.slot_count, &effect.forms) }?;
            // An error in a slot is one of the list.
            for place in slots.iter().flatten().flat_map(SlotSettings::places) {
                sources.extend(list.map(|list| (place, list)));
            }
            params.set_slots(
                slots.into_iter().map(|slot| slot.into_iter().map(|it| it.settings).collect()).collect(),
            );
        }
        // SAFETY: as above, for wires.
        let (inputs, outputs) =
            unsafe { (wires(setup.inputs, setup.input_count)?, wires(setup.outputs, setup.output_count)?) };
        Some(Self {
            // SAFETY: a text of the host.
            id: unsafe { text::read(setup.id) },
            params,
            sources,
            tick_hz: setup.tick_hz.max(1),
            every: setup.every.max(1),
            audio_hz: setup.audio_hz,
            seed: setup.seed,
            inputs,
            outputs,
            closes_cycle: setup.closes_cycle != 0,
        })
    }

    /// Configuration before the port types are known.
    pub(crate) fn config(&self) -> Config<'_> {
        let Self { id, params, tick_hz, every, audio_hz, seed, .. } = self;
        Config { id, params, tick_hz: *tick_hz, every: *every, audio_hz: *audio_hz, seed: *seed }
    }

    /// Complete setup.
    pub(crate) fn setup(&self) -> Setup<'_> {
        Setup {
            config: self.config(),
            inputs: &self.inputs,
            outputs: &self.outputs,
            closes_cycle: self.closes_cycle,
        }
    }

    /// Ticks a second.
    pub(crate) fn tick_hz(&self) -> u32 {
        self.tick_hz
    }

    /// Passes a node's error to the host.
    ///
    /// # Safety
    /// `error` is the host's, or NULL.
    pub(crate) unsafe fn tell(&self, d: &Diagnostic, error: *mut AsperityError) {
        // SAFETY: the caller's promise.
        unsafe { write(d, &self.sources, error) };
    }
}

/// Writes an error of a node, or of settings.
///
/// # Safety
/// `error` is the host's, or NULL.
pub(crate) unsafe fn write(d: &Diagnostic, sources: &Sources, error: *mut AsperityError) {
    let place = d.place.as_ref();
    let found = place.and_then(|p| sources.iter().find(|(source, _)| Arc::ptr_eq(source, &p.source)));
    let param = found.map(|(_, param)| *param);
    let message = match param {
        Some(_) => d.message.clone(),
        // An error in another file includes its position.
        None => Diagnostic { help: None, ..d.clone() }.to_string(),
    };
    // SAFETY: the caller's promise.
    unsafe { tell(&message, d.help.as_deref().unwrap_or(""), param, error) };
}

/// Writes an error.
///
/// # Safety
/// `error` is the host's, or NULL.
pub(crate) unsafe fn tell(message: &str, help: &str, param: Option<usize>, error: *mut AsperityError) {
    // SAFETY: the caller's promise.
    let Some(room) = (unsafe { read_grown(error) }) else { return };
    let param = param.and_then(|p| i32::try_from(p).ok()).unwrap_or(-1);
    // SAFETY: the member is one of 1.0, and both texts have the room that the host says.
    unsafe {
        (&raw mut (*error).param).write(param);
        text::write(message, room.message, room.message_capacity);
        text::write(help, room.help, room.help_capacity);
    }
}

/// An element of an array of the host's, whose structs may be longer than ours.
///
/// # Safety
/// `first` is NULL or an array of more than `index` elements, each as far from the next as `size` of the
/// first says.
unsafe fn element<T: Grows>(first: *const T, index: usize) -> Option<T> {
    // SAFETY: the caller's promise.
    unsafe { read_grown(stride(first, index)?) }
}

/// Where it lies.
///
/// # Safety
/// As for [`element`].
unsafe fn stride<T: Grows>(first: *const T, index: usize) -> Option<*const T> {
    if first.is_null() {
        return None;
    }
    // SAFETY: the caller's promise; every such struct begins with its size.
    unsafe { Some(first.byte_add(index * first.cast::<u32>().read() as usize)) }
}

/// Reads values of parameters into `params`.
///
/// # Safety
/// There are as many values as parameters. Each is as far from the next as the first one's size, and
/// filled as the parameter's kind requires.
unsafe fn values(first: *const AsperityValue, of: &[Param], params: &mut Params) -> Option<Sources> {
    let mut sources = Vec::new();
    for (i, param) in of.iter().enumerate() {
        // SAFETY: the caller's promise.
        let value = unsafe { element(first, i) }?;
        // SAFETY: texts of the host end with a zero byte.
        let base = unsafe { text::read(value.base) };
        let source = Source::new(std::path::Path::new(&base).join("graph"), "");
        let place = Place { source: source.clone(), span: Span::default() };
        sources.push((source, i));
        // SAFETY: the caller's promise.
        let set = (value.set > 0).then(|| unsafe { param_value(&value, param) });
        params.insert(param.name.to_string(), set, (value.set == 2).then_some(place));
    }
    Some(sources)
}

/// Reads the slots of an effect.
///
/// # Safety
/// There are `count` slots, each as far from the next as the first one's size.
unsafe fn slots(first: *const AsperitySlot, count: u32, forms: &[Form]) -> Option<Vec<Vec<SlotSettings>>> {
    let slot = |i| {
        // SAFETY: the caller's promise.
        let slot = unsafe { element(first, i) }?;
        // SAFETY: the host lists as many settings, each with as many values as its form has fields.
        (0..slot.count as usize)
            .map(|k| unsafe { SlotSettings::read(stride(slot.settings, k)?, forms) })
            .collect()
    };
    (0..count as usize).map(slot).collect()
}

unsafe fn wires(first: *const AsperityWire, count: u32) -> Option<Vec<Wiring>> {
    // SAFETY: there are `count` wires, each as far apart as the first one's size.
    (0..count as usize).map(|i| unsafe { Some(wiring(&element(first, i)?)) }).collect()
}

/// # Safety
/// `unit` ends with a zero byte.
unsafe fn wiring(w: &AsperityWire) -> Wiring {
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
    // SAFETY: the caller's promise.
    let unit = Unit::from_symbol(unsafe { text::read(w.unit) });
    let limited = w.flags & ASPERITY_LIMITED != 0;
    Wiring { port: shape.map(|shape| PortType { shape, unit, limited }), connected: w.connected != 0 }
}

/// # Safety
/// The members that the parameter's kind uses are filled in.
unsafe fn param_value(v: &AsperityValue, param: &Param) -> ParamValue {
    let count = v.count as usize;
    // SAFETY: the caller's promise.
    unsafe {
        match &param.kind {
            ParamKind::Number(_) => ParamValue::Number(v.number),
            ParamKind::Integer(_) => ParamValue::Integer(v.integer),
            ParamKind::Flag => ParamValue::Flag(v.integer != 0),
            ParamKind::Text | ParamKind::Choice(_) => ParamValue::Text(text::read(v.text)),
            ParamKind::File => ParamValue::File(text::read(v.text).into()),
            ParamKind::Numbers(_) if v.numbers.is_null() => ParamValue::Numbers(Vec::new()),
            ParamKind::Numbers(_) => {
                ParamValue::Numbers(std::slice::from_raw_parts(v.numbers, count).to_vec())
            }
            ParamKind::Texts if v.texts.is_null() => ParamValue::Texts(Vec::new()),
            ParamKind::Texts => {
                let texts = std::slice::from_raw_parts(v.texts, count);
                ParamValue::Texts(texts.iter().map(|t| text::read(*t)).collect())
            }
        }
    }
}
