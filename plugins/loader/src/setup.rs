//! Converts a setup into the interface's form.

use std::ffi::{CString, c_char};
use std::path::Path;
use std::ptr;

use asperity_abi::*;
use asperity_node::{
    Config, Descriptor, Diagnostic, Form, Param, ParamKind, ParamValue, Params, Settings, Setup, Shape,
    Wiring,
};

/// A struct for a plugin, and everything that it points to.
pub(crate) struct Lent<T> {
    pub(crate) abi: T,
    _memory: Memory,
}

/// Settings of one of the forms of an effect.
pub(crate) fn settings(settings: &Settings, forms: &[Form]) -> Result<Lent<AsperitySettings>, String> {
    let mut memory = Memory::default();
    Ok(Lent { abi: memory.settings(settings, forms)?, _memory: memory })
}

/// Lists that pointers lead to. Their items stay in place when more lists come.
#[derive(Default)]
struct Memory {
    texts: Vec<CString>,
    lists: Vec<Vec<*const c_char>>,
    values: Vec<Vec<AsperityValue>>,
    settings: Vec<Vec<AsperitySettings>>,
    slots: Vec<AsperitySlot>,
    wires: [Vec<AsperityWire>; 2],
}

impl Memory {
    /// Values of some parameters. An error comes with the parameter's name.
    fn values(&mut self, params: &Params, of: &[Param]) -> Result<*const AsperityValue, (String, String)> {
        let mut values = Vec::new();
        for p in of {
            let value = value(params, &p.name, &p.kind, self);
            values.push(value.map_err(|message| (p.name.to_string(), message))?);
        }
        self.values.push(values);
        Ok(self.values.last().map_or(ptr::null(), |values| values.as_ptr()))
    }

    fn settings(&mut self, settings: &Settings, forms: &[Form]) -> Result<AsperitySettings, String> {
        let found = forms.iter().enumerate().find(|(_, form)| form.name == settings.form());
        let (index, form) = found.ok_or_else(|| format!("there is no form `{}`", settings.form()))?;
        Ok(AsperitySettings {
            form: index as u32,
            values: self.values(settings, &form.fields).map_err(|(_, message)| message)?,
            value_count: form.fields.len() as u32,
            ..blank()
        })
    }

    fn slot(&mut self, slot: &[Settings], forms: &[Form]) -> Result<(), String> {
        let all =
            slot.iter().map(|settings| self.settings(settings, forms)).collect::<Result<Vec<_>, _>>()?;
        self.slots.push(AsperitySlot { count: all.len() as u32, settings: all.as_ptr(), ..blank() });
        self.settings.push(all);
        Ok(())
    }

    fn text(&mut self, text: &str) -> Result<*const c_char, String> {
        let text = CString::new(text).map_err(|_| "there is a zero character in this text".to_owned())?;
        self.texts.push(text);
        Ok(self.texts.last().map_or(ptr::null(), |t| t.as_ptr()))
    }

    /// A path in UTF-8, as the interface requires.
    fn path(&mut self, path: &Path) -> Result<*const c_char, String> {
        match path.to_str() {
            Some(path) => self.text(path),
            None => {
                Err(format!("a plugin cannot be given this path, which is not UTF-8: {}", path.display()))
            }
        }
    }
}

/// Setup before the port types are known.
pub(crate) fn config(config: &Config<'_>, d: &Descriptor) -> Result<Lent<AsperitySetup>, Diagnostic> {
    setup(&Setup { config: *config, inputs: &[], outputs: &[], closes_cycle: false }, d)
}

/// Complete setup.
pub(crate) fn setup(setup: &Setup<'_>, d: &Descriptor) -> Result<Lent<AsperitySetup>, Diagnostic> {
    let mut memory = Memory::default();
    let node = |message| setup.params.node_error(message);
    let id = memory.text(setup.id).map_err(node)?;
    let params = memory
        .values(setup.params, &d.params)
        .map_err(|(name, message)| setup.params.error(&name, message))?;
    if let Some(effect) = &d.effect {
        for slot in setup.params.slots() {
            memory.slot(slot, &effect.forms).map_err(|e| setup.params.error(&effect.list, e))?;
        }
    }
    for (i, ports) in [setup.inputs, setup.outputs].into_iter().enumerate() {
        let wires = ports.iter().map(|w| wire(w, &mut memory)).collect::<Result<_, _>>();
        memory.wires[i] = wires.map_err(node)?;
    }
    let [inputs, outputs] = &memory.wires;
    let abi = AsperitySetup {
        tick_hz: setup.tick_hz,
        every: setup.every,
        audio_hz: setup.audio_hz,
        seed: setup.seed,
        id,
        params,
        inputs: inputs.as_ptr(),
        outputs: outputs.as_ptr(),
        param_count: d.params.len() as u32,
        input_count: inputs.len() as u32,
        output_count: outputs.len() as u32,
        closes_cycle: u32::from(setup.closes_cycle),
        slots: memory.slots.as_ptr(),
        slot_count: memory.slots.len() as u32,
        ..blank()
    };
    Ok(Lent { abi, _memory: memory })
}

fn value(params: &Params, name: &str, kind: &ParamKind, texts: &mut Memory) -> Result<AsperityValue, String> {
    let empty = c"".as_ptr();
    let mut v = AsperityValue { text: empty, base: empty, ..blank() };
    let Some(value) = params.get(name) else { return Ok(v) };
    v.set = 1 + u32::from(params.is_set(name));
    let place = params.place(name).or(params.node_place());
    if let Some(base) = place.and_then(|p| p.source.path().parent()) {
        v.base = texts.path(base)?;
    }
    match value {
        ParamValue::Number(x) => v.number = *x,
        ParamValue::Integer(i) => (v.integer, v.number) = (*i, *i as f64),
        ParamValue::Flag(b) => v.integer = i64::from(*b),
        ParamValue::Text(t) => {
            v.text = texts.text(t)?;
            if let ParamKind::Choice(words) = kind {
                v.integer = words.iter().position(|w| w == t).map_or(0, |i| i as i64);
            }
        }
        ParamValue::File(path) => v.text = texts.path(path)?,
        ParamValue::Numbers(xs) => (v.numbers, v.count) = (xs.as_ptr(), xs.len() as u32),
        ParamValue::Texts(all) => {
            let list = all.iter().map(|t| texts.text(t)).collect::<Result<Vec<_>, _>>()?;
            (v.texts, v.count) = (list.as_ptr(), list.len() as u32);
            texts.lists.push(list);
        }
    }
    Ok(v)
}

fn wire(w: &Wiring, texts: &mut Memory) -> Result<AsperityWire, String> {
    let mut abi = AsperityWire {
        connected: u32::from(w.connected),
        unit: texts.text(w.port.as_ref().map_or("1", |p| p.unit.symbol()))?,
        ..blank()
    };
    let Some(port) = &w.port else { return Ok(abi) };
    abi.flags = u32::from(port.limited) * ASPERITY_LIMITED;
    abi.carries = carries(&port.shape);
    match port.shape {
        Shape::Control { count } => abi.count = count as u32,
        Shape::Audio { rate_hz } => abi.rate_hz = rate_hz,
        Shape::Magnitude(l) | Shape::Spectrum(l) => {
            (abi.rate_hz, abi.length, abi.bins) = (l.rate_hz, l.length, l.bins);
            (abi.frame_num, abi.frame_den) = (l.frame_rate.num(), l.frame_rate.den());
        }
    }
    Ok(abi)
}

fn carries(shape: &Shape) -> u32 {
    match shape {
        Shape::Control { .. } => ASPERITY_CONTROL,
        Shape::Audio { .. } => ASPERITY_AUDIO,
        Shape::Magnitude(_) => ASPERITY_MAGNITUDE,
        Shape::Spectrum(_) => ASPERITY_SPECTRUM,
    }
}
