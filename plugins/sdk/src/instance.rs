//! The C functions of a kind, for any node type. Each reads the host's data, calls the node, and writes
//! the result.

use std::ffi::c_void;
use std::mem::size_of;

use asperity_abi::*;
use asperity_node::{
    Buffer, InputRef, Inputs, Latency, Node, Outputs, Ports, Prepared, Processor, Status, Tick, Wiring,
};

use crate::buffers::Hosts;
use crate::describe;
use crate::panics::{caught, guarded, heard};
use crate::setup::HostSetup;
use crate::text::{Texts, Theirs};

/// A node and its view of the host's buffers.
pub(crate) struct Instance {
    node: Option<Prepared>,
    /// Inputs, then outputs.
    buffers: Vec<Buffer>,
    map: Vec<InputRef>,
}

impl Instance {
    /// The instance behind the host's pointer.
    ///
    /// # Safety
    /// `instance` is NULL or was made by `create` and not destroyed, and nobody else uses it meanwhile.
    pub(crate) unsafe fn of<'a>(instance: *mut c_void) -> Option<&'a mut Self> {
        // SAFETY: the caller's promise.
        unsafe { instance.cast::<Self>().as_mut() }
    }

    /// The node, after `prepare`.
    pub(crate) fn node(&mut self) -> Option<&mut dyn Processor> {
        Some(&mut *self.node.as_mut()?.processor)
    }

    /// Calls `f` with the node's view of a tick. Outputs are written back if `outputs` is set.
    ///
    /// # Safety
    /// `tick` is the host's.
    unsafe fn with_tick(
        &mut self,
        tick: &AsperityTick,
        outputs: bool,
        f: impl FnOnce(&mut dyn Processor, &mut Tick<'_>) -> i32,
    ) -> i32 {
        let Some(node) = &mut self.node else { return ASPERITY_FAILED };
        // A buffer without the members of 1.0 cannot be read.
        if (tick.buffer_size as usize) < size_of::<AsperityBuffer>() {
            return ASPERITY_FAILED;
        }
        let (ins, outs) = self.buffers.split_at_mut(self.map.len());
        // SAFETY: the host's buffers are as many and as long as it says.
        let (theirs, results) = unsafe {
            (
                Hosts::new(tick.inputs.cast_mut(), tick.input_count, tick.buffer_size),
                Hosts::new(tick.outputs, tick.output_count, tick.buffer_size),
            )
        };
        theirs.read(ins, &mut self.map);
        if outputs {
            results.clear(outs);
        }
        let mut view = Tick {
            index: tick.index,
            tick_hz: tick.tick_hz,
            inputs: Inputs::new(ins, &[], ins.len(), &self.map),
            outputs: Outputs::new(if outputs { &mut *outs } else { &mut [] }),
        };
        let answer = f(&mut *node.processor, &mut view);
        if outputs {
            results.write(outs);
        }
        answer
    }
}

/// See [`AsperityKind::create`].
pub(crate) unsafe extern "C" fn create(_kind: *const AsperityKind) -> *mut c_void {
    Box::into_raw(Box::new(Instance { node: None, buffers: Vec::new(), map: Vec::new() })).cast()
}

/// See [`AsperityKind::destroy`].
pub(crate) unsafe extern "C" fn destroy(instance: *mut c_void) {
    if !instance.is_null() {
        // SAFETY: made by `create`, and the host uses it no more.
        caught(|| drop(unsafe { Box::from_raw(instance.cast::<Instance>()) }));
    }
}

/// See [`AsperityKind::ports`].
pub(crate) unsafe extern "C" fn ports<N: Node>(
    setup: *const AsperitySetup,
    sink: *const AsperityPortSink,
    error: *mut AsperityError,
) -> i32 {
    guarded(|| {
        // SAFETY: the host's structs, valid during this call.
        let theirs = unsafe { Theirs::trusted() };
        let d = N::descriptor();
        let (prepared, sink) = (HostSetup::read(theirs, setup, &d)?, theirs.read(sink)?);
        let ports = N::ports(&prepared.config(), Ports { inputs: d.inputs, outputs: d.outputs });
        let Ports { inputs, outputs } = ports.map_err(|d| prepared.tell(theirs, &d, error)).ok()?;
        let mut texts = Texts::default();
        let inputs: Vec<_> = inputs.iter().map(|i| describe::input(i, &mut texts)).collect();
        let outputs: Vec<_> = outputs.iter().map(|o| describe::output(o, &mut texts)).collect();
        for (add, ports) in [(sink.input, &inputs), (sink.output, &outputs)] {
            // SAFETY: the sink's functions take its context and a port.
            add.iter().for_each(|add| ports.iter().for_each(|port| unsafe { add(sink.context, port) }));
        }
        Some(ASPERITY_OK)
    })
}

/// See [`AsperityKind::prepare`].
pub(crate) unsafe extern "C" fn prepare<N: Node>(
    instance: *mut c_void,
    setup: *const AsperitySetup,
    error: *mut AsperityError,
) -> i32 {
    // SAFETY: the host's structs and instance, valid during this call.
    let (theirs, it) = unsafe { (Theirs::trusted(), Instance::of(instance)) };
    let answer = heard(|| {
        let d = N::descriptor();
        let (it, prepared) = (it?, HostSetup::read(theirs, setup, &d)?);
        let node = N::prepare(&prepared.setup()).map_err(|d| prepared.tell(theirs, &d, error)).ok()?;
        it.node = Some(node);
        let buffer = |w: &Wiring| match &w.port {
            Some(port) => Buffer::new(port, prepared.tick_hz()),
            None => Buffer::constant(0, 0.0),
        };
        it.buffers = prepared.inputs.iter().chain(&prepared.outputs).map(buffer).collect();
        let wires = prepared.inputs.iter().enumerate();
        it.map = wires.map(|(i, w)| InputRef { buffer: i as u32, connected: w.connected }).collect();
        Some(ASPERITY_OK)
    });
    let answer = answer.map(|answer| answer.unwrap_or(ASPERITY_FAILED));
    answer.unwrap_or_else(|text| {
        theirs.tell(&format!("the node panicked while it was prepared: {text}"), "", None, error);
        ASPERITY_PANICKED
    })
}

/// See [`AsperityKind::info`].
pub(crate) unsafe extern "C" fn info(instance: *mut c_void, info: *mut AsperityInfo) {
    // SAFETY: the host's instance and struct, valid during this call.
    let (it, told) = unsafe { (Instance::of(instance), read_grown(info)) };
    let (Some(node), Some(mut told)) = (it.and_then(|it| it.node.as_ref()), told) else { return };
    told.allocation_free = u32::from(node.allocation_free);
    (told.latency_num, told.latency_den) = node.latency.as_ratio();
    (told.tail_num, told.tail_den) = node.tail.as_ratio();
    (told.duration_num, told.duration_den) = node.duration.map_or((0, 0), Latency::as_ratio);
    let len = (told.size as usize).min(size_of::<AsperityInfo>());
    // SAFETY: as many bytes as the host says its struct has.
    unsafe { std::ptr::copy_nonoverlapping((&raw const told).cast::<u8>(), info.cast(), len) };
}

/// See [`AsperityKind::process`].
pub(crate) unsafe extern "C" fn process(instance: *mut c_void, tick: *mut AsperityTick) -> i32 {
    let mut detail = 0;
    // SAFETY: the host's instance and tick, valid during this call.
    let answer = unsafe {
        call(instance, tick, true, |node, view| match node.process(view) {
            Status::Continue => ASPERITY_CONTINUE,
            Status::Quiet => ASPERITY_QUIET,
            Status::Asleep => ASPERITY_ASLEEP,
            Status::Tail(ticks) => {
                detail = ticks;
                ASPERITY_TAIL
            }
            Status::Error(code) => {
                detail = u64::from(code);
                ASPERITY_FAILED
            }
        })
    };
    if !tick.is_null() {
        // SAFETY: the member is one of 1.0.
        unsafe { (&raw mut (*tick).detail).write(detail) };
    }
    answer
}

/// See [`AsperityKind::wants`].
pub(crate) unsafe extern "C" fn wants(instance: *mut c_void, tick: *mut AsperityTick) -> i32 {
    // SAFETY: the host's instance and tick, valid during this call.
    unsafe { call(instance, tick, false, |node, view| i32::from(node.wants(view))) }
}

/// See [`AsperityKind::absorb`].
pub(crate) unsafe extern "C" fn absorb(instance: *mut c_void, tick: *mut AsperityTick) -> i32 {
    let take = |node: &mut dyn Processor, view: &mut Tick<'_>| {
        node.absorb(view);
        ASPERITY_OK
    };
    // SAFETY: the host's instance and tick, valid during this call.
    unsafe { call(instance, tick, false, take) }
}

/// Calls a node with its view of a tick.
///
/// # Safety
/// `instance` and `tick` are the host's, valid during this call.
unsafe fn call(
    instance: *mut c_void,
    tick: *const AsperityTick,
    outputs: bool,
    f: impl FnOnce(&mut dyn Processor, &mut Tick<'_>) -> i32,
) -> i32 {
    // SAFETY: the caller's promise.
    let (it, tick) = unsafe { (Instance::of(instance), read_grown(tick)) };
    // SAFETY: as above.
    guarded(|| Some(unsafe { it?.with_tick(&tick?, outputs, f) }))
}

/// Calls a prepared node.
///
/// # Safety
/// `instance` is the host's.
unsafe fn with_node(instance: *mut c_void, f: impl FnOnce(&mut dyn Processor)) -> i32 {
    // SAFETY: the caller's promise.
    let node = unsafe { Instance::of(instance) }.and_then(Instance::node);
    guarded(|| {
        f(node?);
        Some(ASPERITY_OK)
    })
}

/// See [`AsperityKind::reset`].
pub(crate) unsafe extern "C" fn reset(instance: *mut c_void) -> i32 {
    // SAFETY: the host's instance.
    unsafe { with_node(instance, |node| node.reset()) }
}

/// See [`AsperityKind::elapsed`].
pub(crate) unsafe extern "C" fn elapsed(instance: *mut c_void, ticks: u64) -> i32 {
    // SAFETY: the host's instance.
    unsafe { with_node(instance, |node| node.elapsed(ticks)) }
}

/// See [`AsperityKind::set_parameter`].
pub(crate) unsafe extern "C" fn set_parameter(instance: *mut c_void, index: u32, value: f64) -> i32 {
    // SAFETY: the host's instance.
    unsafe { with_node(instance, |node| node.set_parameter(index as usize, value)) }
}

/// See [`AsperityKind::state_size`].
pub(crate) unsafe extern "C" fn state_size(instance: *mut c_void) -> u64 {
    let mut size = 0;
    // SAFETY: the host's instance.
    unsafe { with_node(instance, |node| size = node.state_size() as u64) };
    size
}

/// See [`AsperityKind::save`].
pub(crate) unsafe extern "C" fn save(instance: *mut c_void, bytes: *mut u8, capacity: u64) -> i64 {
    let bytes = match capacity {
        0 => &mut [][..],
        // SAFETY: the host's memory of that size.
        n if !bytes.is_null() => unsafe { std::slice::from_raw_parts_mut(bytes, n as usize) },
        _ => return -1,
    };
    let mut saved = None;
    // SAFETY: the host's instance.
    unsafe { with_node(instance, |node| saved = node.save(bytes)) };
    saved.map_or(-1, |n| n as i64)
}

/// See [`AsperityKind::restore`].
pub(crate) unsafe extern "C" fn restore(instance: *mut c_void, bytes: *const u8, len: u64) -> i32 {
    let bytes = match len {
        0 => &[][..],
        // SAFETY: the host's memory of that size.
        n if !bytes.is_null() => unsafe { std::slice::from_raw_parts(bytes, n as usize) },
        _ => return ASPERITY_FAILED,
    };
    let mut restored = false;
    // SAFETY: the host's instance.
    match unsafe { with_node(instance, |node| restored = node.restore(bytes)) } {
        ASPERITY_OK if !restored => ASPERITY_FAILED,
        answer => answer,
    }
}
