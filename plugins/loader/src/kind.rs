//! Kinds of a plugin, for the registry.

use std::ffi::c_void;
use std::sync::Arc;

use asperity_abi::*;
use asperity_node::{Config, Descriptor, Diagnostic, Input, NodeKind, Output, Ports, Prepared, Setup};

use crate::checked::{Lie, Theirs};
use crate::describe;
use crate::processor::PluginProcessor;
use crate::said::Said;
use crate::setup;

/// The function of the extension `asperity.facts/1`.
pub(crate) type FactsFn = unsafe extern "C" fn(*const AsperityKind, *mut c_void, *const AsperityFactSink);

/// The functions of a kind, as its instances use them.
#[derive(Clone, Copy)]
pub(crate) struct Functions {
    pub(crate) at: *const AsperityKind,
    pub(crate) abi: AsperityKind,
    pub(crate) facts: Option<FactsFn>,
}

// SAFETY: constant data of a library that is never unloaded; its functions may be called from any thread.
unsafe impl Send for Functions {}
// SAFETY: as above.
unsafe impl Sync for Functions {}

/// A kind of nodes from a plugin.
pub(crate) struct PluginKind {
    pub(crate) functions: Functions,
    pub(crate) descriptor: Descriptor,
}

impl PluginKind {
    fn error(&self, config: &Config<'_>, said: &Said) -> Diagnostic {
        let otherwise = format!("the plugin's kind `{}` cannot be prepared", self.descriptor.kind);
        said.diagnostic(config.params, &self.descriptor.params, &otherwise)
    }

    /// The kind for a registry.
    pub(crate) fn kind(self, origin: Arc<str>, build: u64) -> NodeKind {
        let (descriptor, it) = (self.descriptor.clone(), Arc::new(self));
        let same = it.clone();
        NodeKind::new(descriptor, move |setup| same.prepare(setup))
            .with_ports(move |config, ports| it.ports(config, ports))
            .from_plugin(origin, build)
    }

    fn ports(&self, config: &Config<'_>, declared: Ports) -> Result<Ports, Diagnostic> {
        let d = &self.descriptor;
        let Some(ports) = self.functions.abi.ports else { return Ok(declared) };
        let lent = setup::config(config, d)?;
        let mut told = Told::default();
        let sink = AsperityPortSink {
            context: (&raw mut told).cast(),
            input: Some(add_input),
            output: Some(add_output),
            ..blank()
        };
        let mut said = Said::new();
        // SAFETY: all three live through the call.
        let answer = unsafe { ports(&lent.abi, &sink, &mut said.abi) };
        if answer != ASPERITY_OK {
            return Err(self.error(config, &said));
        }
        if let Some(lie) = told.lie {
            return Err(config.params.node_error(format!("the plugin's kind `{}`: {lie}", d.kind)));
        }
        let told = Descriptor { inputs: told.inputs, outputs: told.outputs, ..d.clone() };
        told.check().map_err(|e| config.params.node_error(e.message))?;
        let ports = Ports { inputs: told.inputs, outputs: told.outputs };
        Ok(ports)
    }

    fn prepare(&self, setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let lent = setup::setup(setup, &self.descriptor)?;
        let mut said = Said::new();
        // SAFETY: the setup lives through the call.
        let made = unsafe { PluginProcessor::prepare(self.functions, &lent.abi, setup, &mut said.abi) };
        match made {
            Ok(prepared) => Ok(prepared),
            Err(lie) if lie.is_empty() => Err(self.error(&setup.config, &said)),
            Err(lie) => {
                Err(setup.params.node_error(format!("the plugin's kind `{}`: {lie}", self.descriptor.kind)))
            }
        }
    }
}

/// Ports reported by a plugin.
#[derive(Default)]
struct Told {
    inputs: Vec<Input>,
    outputs: Vec<Output>,
    lie: Option<Lie>,
}

impl Told {
    /// # Safety
    /// `context` is one that this file handed out, `port` the plugin's.
    unsafe fn add(context: *mut c_void, port: *const AsperityPort, input: bool) {
        // SAFETY: the caller's promise.
        let Some(told) = (unsafe { context.cast::<Self>().as_mut() }) else { return };
        // SAFETY: the port is valid during the call.
        let theirs = unsafe { Theirs::trusted() };
        let added = theirs.read(port, "a port").and_then(|p| {
            if told.inputs.len() + told.outputs.len() >= 512 {
                return Err("it has more than 512 ports".to_owned());
            }
            if input {
                told.inputs.push(describe::input(theirs, &p)?);
            } else {
                told.outputs.push(describe::output(theirs, &p)?);
            }
            Ok(())
        });
        told.lie = told.lie.take().or(added.err());
    }
}

unsafe extern "C" fn add_input(context: *mut c_void, port: *const AsperityPort) {
    // SAFETY: called by the plugin during `ports`, with the context it was given.
    unsafe { Told::add(context, port, true) };
}

unsafe extern "C" fn add_output(context: *mut c_void, port: *const AsperityPort) {
    // SAFETY: as above.
    unsafe { Told::add(context, port, false) };
}
