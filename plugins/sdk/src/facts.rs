//! The extension `asperity.facts/1`.

use std::ffi::c_void;

use asperity_abi::{AsperityFactSink, AsperityKind, read_grown};
use asperity_node::{FactValue, Node};

use crate::describe::Record;
use crate::instance::Instance;
use crate::panics;
use crate::text::Texts;

/// Reports the facts of any kind of this plugin.
///
/// # Safety
/// `kind` is one of this plugin's, `instance` one of its instances, `sink` the host's.
pub(crate) unsafe extern "C" fn facts(
    kind: *const AsperityKind,
    instance: *mut c_void,
    sink: *const AsperityFactSink,
) {
    if kind.is_null() || instance.is_null() || sink.is_null() {
        return;
    }
    // SAFETY: every kind of this plugin is the first member of a record; the sink is valid during this call.
    let (record, sink) = unsafe { (&*kind.cast::<Record>(), read_grown(sink)) };
    let Some(sink) = sink else { return };
    // SAFETY: `instance` is one of this kind, as the caller promises.
    panics::caught(|| unsafe { (record.facts)(instance, &sink) });
}

/// Reports the facts of one node.
///
/// # Safety
/// `instance` is an `Instance<N>`.
pub(crate) unsafe fn tell<N: Node>(instance: *mut c_void, sink: &AsperityFactSink) {
    // SAFETY: as the caller promises; nobody else uses it during this call.
    let Some(node) = (unsafe { Instance::<N>::of(instance) }).and_then(|i| i.node()) else { return };
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
