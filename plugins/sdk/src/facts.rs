//! The extension `asperity.facts/1`.

use std::ffi::c_void;

use asperity_abi::{AsperityFactSink, AsperityKind, read_grown};
use asperity_node::{FactValue, Processor};

use crate::instance::Instance;
use crate::panics;
use crate::text::Texts;

/// Reports the facts of an instance.
///
/// # Safety
/// `instance` is one of this plugin's instances, `sink` the host's.
pub(crate) unsafe extern "C" fn facts(
    _kind: *const AsperityKind,
    instance: *mut c_void,
    sink: *const AsperityFactSink,
) {
    if sink.is_null() {
        return;
    }
    // SAFETY: as the caller promises; nobody else uses them during this call.
    let (it, sink) = unsafe { (Instance::of(instance), read_grown(sink)) };
    let (Some(node), Some(sink)) = (it.and_then(Instance::node), sink) else { return };
    panics::caught(|| tell(node, &sink));
}

fn tell(node: &mut dyn Processor, sink: &AsperityFactSink) {
    for fact in node.facts() {
        let mut texts = Texts::default();
        let name = texts.text(&fact.name);
        // SAFETY: the sink's functions take its context and texts that end with a zero byte.
        unsafe {
            match (&fact.value, sink.text, sink.number, sink.count) {
                (FactValue::Text(text), Some(tell), _, _) => tell(sink.context, name, texts.text(text)),
                (FactValue::Number(x, unit), _, Some(tell), _) => {
                    tell(sink.context, name, *x, texts.text(unit));
                }
                (FactValue::Count(n), _, _, Some(tell)) => tell(sink.context, name, *n),
                _ => {}
            }
        }
    }
}
