//! Descriptors in the interface's form, made once when the host opens the plugin.

use std::ffi::{CStr, c_char, c_void};
use std::mem::size_of;
use std::ptr;
use std::sync::OnceLock;

use asperity_abi::*;
use asperity_node::{
    Descriptor, Input, LayoutSpec, Node, Output, Param, ParamKind, ParamValue, RateSpec, Resume, ShapeSpec,
    UnitSpec,
};

use crate::text::Texts;
use crate::{effect, facts, instance, panics};

/// A kind as the host sees it, with the plugin's own data about it.
#[repr(C)]
pub(crate) struct Record {
    pub(crate) abi: AsperityKind,
    pub(crate) effect: *const AsperityEffect,
}

/// The kinds of a plugin.
#[derive(Debug, Default)]
pub struct Kinds(Vec<*const AsperityKind>);

impl Kinds {
    /// Adds a node type.
    pub fn add<N: Node>(&mut self) {
        let texts = Box::leak(Box::<Texts>::default());
        let descriptor = N::descriptor();
        let record =
            Record { abi: kind::<N>(&descriptor, texts), effect: effect::effect::<N>(&descriptor, texts) };
        let record: &'static Record = Box::leak(Box::new(record));
        self.0.push(ptr::from_ref(record).cast());
    }
}

/// Data for the host: only read, and never freed.
struct Shared(AsperityPlugin);
// SAFETY: constant data behind constant pointers.
unsafe impl Send for Shared {}
// SAFETY: as above.
unsafe impl Sync for Shared {}

/// Returns the plugin's description; NULL if describing it panics.
pub fn open(
    name: &'static str,
    version: &'static str,
    add: impl FnOnce(&mut Kinds),
) -> *const AsperityPlugin {
    static PLUGIN: OnceLock<Shared> = OnceLock::new();
    panics::install_silent_hook();
    let made = panics::caught(|| {
        ptr::from_ref(
            &PLUGIN
                .get_or_init(|| {
                    let mut kinds = Kinds::default();
                    add(&mut kinds);
                    let texts = Box::leak(Box::<Texts>::default());
                    Shared(AsperityPlugin {
                        kind_count: kinds.0.len() as u32,
                        kinds: Box::leak(kinds.0.into_boxed_slice()).as_ptr(),
                        name: texts.text(name),
                        version: texts.text(version),
                        extension: Some(extension),
                        ..blank()
                    })
                })
                .0,
        )
    });
    made.unwrap_or(ptr::null())
}

unsafe extern "C" fn extension(name: *const c_char) -> *const c_void {
    static FACTS: AsperityFacts =
        AsperityFacts { size: size_of::<AsperityFacts>() as u32, reserved: 0, facts: Some(facts::facts) };
    static EFFECTS: AsperityEffects = AsperityEffects {
        size: size_of::<AsperityEffects>() as u32,
        reserved: 0,
        effect: Some(effect::of_kind),
    };
    if name.is_null() {
        return ptr::null();
    }
    // SAFETY: a text of the host that ends with a zero byte.
    match unsafe { CStr::from_ptr(name) }.to_str() {
        Ok(ASPERITY_EXTENSION_FACTS) => ptr::from_ref(&FACTS).cast(),
        Ok(ASPERITY_EXTENSION_EFFECT) => ptr::from_ref(&EFFECTS).cast(),
        _ => ptr::null(),
    }
}

/// A list for the host, never freed.
pub(crate) fn leak<T>(items: Vec<T>) -> *const T {
    Box::leak(items.into_boxed_slice()).as_ptr()
}

fn kind<N: Node>(d: &Descriptor, texts: &mut Texts) -> AsperityKind {
    let sink = u32::from(d.sink) * ASPERITY_SINK;
    AsperityKind {
        size: size_of::<AsperityKind>() as u32,
        flags: sink | (u32::from(d.passive) * ASPERITY_PASSIVE),
        resume: match d.resume {
            Resume::Restart => ASPERITY_RESTART,
            Resume::Elapsed => ASPERITY_ELAPSED,
            Resume::Continue => ASPERITY_RESUME,
            Resume::Never => ASPERITY_NEVER,
        },
        input_count: d.inputs.len() as u32,
        output_count: d.outputs.len() as u32,
        param_count: d.params.len() as u32,
        kind: texts.text(&d.kind),
        summary: texts.text(&d.summary),
        timing: texts.some(&d.timing),
        inputs: leak(d.inputs.iter().map(|i| input(i, texts)).collect()),
        outputs: leak(d.outputs.iter().map(|o| output(o, texts)).collect()),
        params: leak(d.params.iter().map(|p| param(p, texts)).collect()),
        gate: d.gate.as_deref().map_or(ptr::null(), |t| texts.text(t)),
        feedback: d.feedback.as_deref().map_or(ptr::null(), |t| texts.text(t)),
        ports: Some(instance::ports::<N>),
        create: Some(instance::create),
        prepare: Some(instance::prepare::<N>),
        info: Some(instance::info),
        process: Some(instance::process),
        reset: Some(instance::reset),
        wants: Some(instance::wants),
        absorb: Some(instance::absorb),
        elapsed: Some(instance::elapsed),
        set_parameter: Some(instance::set_parameter),
        state_size: Some(instance::state_size),
        save: Some(instance::save),
        restore: Some(instance::restore),
        destroy: Some(instance::destroy),
    }
}

pub(crate) fn input(i: &Input, texts: &mut Texts) -> AsperityPort {
    let flag = |is: bool, flag: u32| if is { flag } else { 0 };
    let flags = flag(i.optional, ASPERITY_OPTIONAL)
        | flag(i.wakes, ASPERITY_WAKES)
        | flag(i.limited, ASPERITY_LIMITED);
    AsperityPort { default_value: i.default, ..port(&i.name, &i.doc, &i.shape, &i.unit, flags, texts) }
}

pub(crate) fn output(o: &Output, texts: &mut Texts) -> AsperityPort {
    port(&o.name, &o.doc, &o.shape, &o.unit, u32::from(o.limited) * ASPERITY_LIMITED, texts)
}

fn port(
    name: &str,
    doc: &str,
    shape: &ShapeSpec,
    unit: &UnitSpec,
    flags: u32,
    texts: &mut Texts,
) -> AsperityPort {
    let mut port = AsperityPort { name: texts.text(name), doc: texts.text(doc), flags, ..blank() };
    match unit {
        UnitSpec::Is(unit) => port.unit = texts.text(unit.symbol()),
        UnitSpec::Of { var, among } => {
            port.unit_var = u32::from(*var);
            if !among.is_empty() {
                port.units = texts.list(among.iter().map(asperity_node::Unit::symbol));
            }
        }
    }
    let mut layout = |spec: &LayoutSpec| match spec {
        LayoutSpec::Of(var) => port.shape_var = u32::from(*var),
        LayoutSpec::Is(l) => {
            (port.rate_hz, port.length, port.bins) = (l.rate_hz, l.length, l.bins);
            (port.frame_num, port.frame_den) = (l.frame_rate.num(), l.frame_rate.den());
        }
    };
    match shape {
        ShapeSpec::Like(var) => (port.carries, port.shape_var) = (ASPERITY_LIKE, u32::from(*var)),
        ShapeSpec::Control(count) => (port.carries, port.count) = (ASPERITY_CONTROL, *count as u32),
        ShapeSpec::Audio(rate) => {
            port.carries = ASPERITY_AUDIO;
            match rate {
                RateSpec::Graph => {}
                RateSpec::Hz(hz) => port.rate_hz = *hz,
                RateSpec::Of(var) => port.shape_var = u32::from(*var),
            }
        }
        ShapeSpec::Magnitude(spec) => {
            layout(spec);
            port.carries = ASPERITY_MAGNITUDE;
        }
        ShapeSpec::Spectrum(spec) => {
            layout(spec);
            port.carries = ASPERITY_SPECTRUM;
        }
    }
    port
}

pub(crate) fn param(p: &Param, texts: &mut Texts) -> AsperityParam {
    let mut flags = u32::from(p.live) * ASPERITY_LIVE;
    if p.default.is_none() && p.kind != ParamKind::File {
        flags |= if p.optional { ASPERITY_MAY_BE_LEFT_OUT } else { ASPERITY_REQUIRED };
    } else if p.optional {
        flags |= ASPERITY_MAY_BE_LEFT_OUT;
    }
    let mut abi = AsperityParam {
        name: texts.text(&p.name),
        doc: texts.text(&p.doc),
        unit: texts.some(&p.unit),
        flags,
        ..blank()
    };
    abi.holds = match &p.kind {
        ParamKind::Number(range) => {
            (abi.min, abi.max) = (*range.start(), *range.end());
            ASPERITY_NUMBER
        }
        ParamKind::Integer(range) => {
            (abi.integer_min, abi.integer_max) = (*range.start(), *range.end());
            ASPERITY_INTEGER
        }
        ParamKind::Flag => ASPERITY_FLAG,
        ParamKind::Text => ASPERITY_TEXT,
        ParamKind::Choice(words) => {
            abi.words = texts.list(words.iter().map(|w| w.as_ref()));
            ASPERITY_CHOICE
        }
        ParamKind::File => ASPERITY_FILE,
        ParamKind::Numbers(range) => {
            (abi.min, abi.max) = (*range.start(), *range.end());
            ASPERITY_NUMBERS
        }
        ParamKind::Texts => ASPERITY_TEXTS,
    };
    match &p.default {
        Some(ParamValue::Number(x)) => abi.default_number = *x,
        Some(ParamValue::Integer(i)) => abi.default_integer = *i,
        Some(ParamValue::Flag(b)) => abi.default_integer = i64::from(*b),
        Some(ParamValue::Text(t)) => abi.default_text = texts.text(t),
        Some(ParamValue::Numbers(xs)) => {
            abi.default_count = xs.len() as u32;
            abi.default_numbers = leak(xs.clone());
        }
        Some(ParamValue::File(_) | ParamValue::Texts(_)) | None => {}
    }
    abi
}
