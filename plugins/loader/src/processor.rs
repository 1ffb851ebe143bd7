//! Instances of a plugin's kind, for the engine.

use std::ffi::{CStr, c_char, c_void};
use std::mem::size_of;
use std::ptr::{self, NonNull};

use asperity_abi::*;
use asperity_node::{Buffer, Fact, Fault, Inputs, Latency, Prepared, Processor, Setup, State, Status, Tick};

use crate::checked::Lie;
use crate::foreign::foreign;
use crate::kind::Functions;

/// One instance. Its buffers are the engine's own; nothing is copied on this side.
pub(crate) struct PluginProcessor {
    functions: Functions,
    instance: NonNull<c_void>,
    inputs: Box<[AsperityBuffer]>,
    outputs: Box<[AsperityBuffer]>,
    /// Fault of the last call.
    fault: Option<Fault>,
    /// Calls in which it wrote samples without setting the flag, which makes them silence.
    unsaid_writes: u64,
}

// SAFETY: the interface lets another thread call an instance than before, one at a time; what the buffers
// point to is used during a call only.
unsafe impl Send for PluginProcessor {}

/// Longest accepted latency and tail in seconds.
const HOUR_S: i64 = 3600;

const NO_BUFFER: AsperityBuffer = AsperityBuffer {
    carries: 0,
    flags: 0,
    count: 0,
    reserved: 0,
    frame_index: 0,
    frame_start: 0,
    data: ptr::null_mut(),
};

impl PluginProcessor {
    /// Makes and prepares an instance. An empty error means that the plugin itself reported the
    /// problem.
    ///
    /// # Safety
    /// `lent` and `error` are valid, and so is everything they point to.
    pub(crate) unsafe fn prepare(
        functions: Functions,
        lent: &AsperitySetup,
        setup: &Setup<'_>,
        error: &mut AsperityError,
    ) -> Result<Prepared, Lie> {
        let kind = &functions.abi;
        let (Some(create), Some(prepare)) = (kind.create, kind.prepare) else { return Err(Lie::new()) };
        // SAFETY: the kind is the plugin's own.
        let instance = foreign(|| unsafe { create(functions.at) });
        let instance = NonNull::new(instance).ok_or("it cannot make an instance")?;
        let mut info = AsperityInfo { allocation_free: 1, ..blank() };
        // From here on dropping it destroys the instance.
        let it = Self {
            functions,
            instance,
            inputs: vec![NO_BUFFER; setup.inputs.len()].into(),
            outputs: vec![NO_BUFFER; setup.outputs.len()].into(),
            fault: None,
            unsaid_writes: 0,
        };
        // SAFETY: the caller's promise; `prepare` is the first call after `create`.
        if foreign(|| unsafe { prepare(instance.as_ptr(), lent, error) }) != ASPERITY_OK {
            return Err(Lie::new());
        }
        if let Some(tell) = kind.info {
            // SAFETY: the instance is prepared, and the struct lives through the call.
            unsafe { tell(instance.as_ptr(), &mut info) };
        }
        let AsperityInfo { latency_num, latency_den, tail_num, tail_den, duration_num, duration_den, .. } =
            info;
        if latency_den.min(tail_den).min(duration_den) < 0 {
            return Err("it says a latency, tail or duration with a negative denominator".into());
        }
        let hour = |den: i64| HOUR_S.saturating_mul(den);
        let beyond = |num: i64, den: i64, least: i64| den > 0 && (num < least || num > hour(den));
        if beyond(latency_num, latency_den, -hour(latency_den)) || beyond(tail_num, tail_den, 0) {
            return Err("it says a latency or tail of more than an hour, or a negative tail".into());
        }
        if duration_den > 0 && duration_num < 0 {
            return Err("it says a negative duration".into());
        }
        let time = |num: i64, den: i64| (den > 0).then(|| Latency::ratio(num, den));
        Ok(Prepared {
            latency: time(latency_num, latency_den).unwrap_or(Latency::ZERO),
            tail: time(tail_num, tail_den).unwrap_or(Latency::ZERO),
            duration: time(duration_num, duration_den),
            allocation_free: info.allocation_free != 0,
            ..Prepared::new(it)
        })
    }

    fn call_with_tick(
        &mut self,
        tick: &mut Tick<'_>,
        outputs: bool,
        call: Option<unsafe extern "C" fn(*mut c_void, *mut AsperityTick) -> i32>,
    ) -> (i32, u64) {
        let Some(call) = call else { return (ASPERITY_OK, 0) };
        for (i, b) in self.inputs.iter_mut().enumerate() {
            *b = input(tick.inputs, i);
        }
        for (b, buffer) in self.outputs.iter_mut().zip(tick.outputs.buffers()) {
            *b = output(buffer);
        }
        let mut abi = AsperityTick {
            buffer_size: size_of::<AsperityBuffer>() as u32,
            index: tick.index,
            tick_hz: tick.tick_hz,
            input_count: self.inputs.len() as u32,
            output_count: if outputs { self.outputs.len() as u32 } else { 0 },
            inputs: self.inputs.as_ptr(),
            outputs: self.outputs.as_mut_ptr(),
            ..blank()
        };
        // SAFETY: the instance is prepared; the buffers are the engine's for this tick, inputs and
        // outputs apart.
        let answer = foreign(|| unsafe { call(self.instance.as_ptr(), &mut abi) });
        if outputs {
            for (b, buffer) in self.outputs.iter_mut().zip(tick.outputs.buffers()) {
                self.unsaid_writes += u64::from(!take(b, buffer));
                b.data = ptr::null_mut();
            }
        }
        self.inputs.iter_mut().for_each(|b| b.data = ptr::null_mut());
        (answer, abi.detail)
    }

    fn call(&mut self, f: Option<impl FnOnce(*mut c_void) -> i32>) {
        if let Some(f) = f {
            let answer = foreign(|| f(self.instance.as_ptr()));
            self.outcome(answer, 0);
        }
    }

    /// Result of a status code. A fault is kept for [`Processor::fault`].
    fn outcome(&mut self, answer: i32, detail: u64) -> i32 {
        self.fault = match answer {
            ASPERITY_PANICKED => Some(Fault::Panicked),
            n if n < 0 => Some(Fault::Failed(u32::try_from(detail).unwrap_or(u32::MAX))),
            _ => None,
        };
        answer
    }
}

/// A buffer for a plugin, without its flags.
fn view(buffer: &Buffer) -> AsperityBuffer {
    let (carries, data, count): (u32, *const c_void, usize) = match buffer {
        Buffer::Control { values, .. } => (ASPERITY_CONTROL, values.as_ptr().cast(), values.len()),
        Buffer::Audio { samples, len, .. } => (ASPERITY_AUDIO, samples.as_ptr().cast(), *len),
        Buffer::Magnitude { bins, .. } => (ASPERITY_MAGNITUDE, bins.as_ptr().cast(), bins.len()),
        Buffer::Spectrum { bins, .. } => (ASPERITY_SPECTRUM, bins.as_ptr().cast(), bins.len()),
    };
    let data = if count > 0 { data.cast_mut() } else { ptr::null_mut() };
    AsperityBuffer { carries, count: count as u32, data, ..NO_BUFFER }
}

/// An input, which is only read: the interface forbids writing to it.
fn input(inputs: Inputs<'_>, i: usize) -> AsperityBuffer {
    let Some(buffer) = inputs.buffer(i) else { return NO_BUFFER };
    let flag = |is: bool, flag: u32| if is { flag } else { 0 };
    let mut b = view(buffer);
    b.flags = flag(buffer.is_valid(), ASPERITY_VALID) | flag(inputs.connected(i), ASPERITY_CONNECTED);
    match buffer {
        // Placeholder of an input without a type.
        Buffer::Control { values, .. } if values.is_empty() => b.carries = 0,
        Buffer::Control { changed, .. } => b.flags |= flag(*changed, ASPERITY_CHANGED),
        Buffer::Audio { silent, .. } => b.flags |= flag(*silent, ASPERITY_SILENT),
        Buffer::Magnitude { frame, .. } | Buffer::Spectrum { frame, .. } => {
            b.flags |= flag(frame.is_some(), ASPERITY_FRAME);
            (b.frame_index, b.frame_start) = frame.unwrap_or_default();
        }
    }
    b
}

/// An output before a call.
fn output(buffer: &mut Buffer) -> AsperityBuffer {
    let b = AsperityBuffer { flags: ASPERITY_CONNECTED | ASPERITY_VALID, ..view(buffer) };
    let data: *mut c_void = match buffer {
        _ if b.count == 0 => b.data,
        Buffer::Control { values, .. } => values.as_mut_ptr().cast(),
        Buffer::Audio { samples, .. } => samples.as_mut_ptr().cast(),
        Buffer::Magnitude { bins, .. } => bins.as_mut_ptr().cast(),
        Buffer::Spectrum { bins, .. } => bins.as_mut_ptr().cast(),
    };
    AsperityBuffer { data, ..b }
}

/// Reads the flags of an output that the node wrote. Returns false if it wrote samples without the
/// flag.
fn take(b: &AsperityBuffer, buffer: &mut Buffer) -> bool {
    let mut said = true;
    match buffer {
        Buffer::Control { .. } => {}
        Buffer::Audio { samples, silent, .. } => {
            *silent = b.flags & ASPERITY_WRITTEN == 0;
            if *silent {
                said = samples.iter().all(|x| *x == 0.0);
                samples.fill(0.0);
            }
        }
        Buffer::Magnitude { frame, .. } | Buffer::Spectrum { frame, .. } => {
            *frame = (b.flags & ASPERITY_FRAME != 0).then_some((b.frame_index, b.frame_start));
        }
    }
    said
}

// What the interface has no call for stands here too, so that a new call is not forgotten.
#[warn(clippy::missing_trait_methods)]
impl Processor for PluginProcessor {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let (answer, detail) = self.call_with_tick(tick, true, self.functions.abi.process);
        match self.outcome(answer, detail) {
            ASPERITY_CONTINUE => Status::Continue,
            ASPERITY_QUIET => Status::Quiet,
            ASPERITY_TAIL => Status::Tail(detail),
            ASPERITY_ASLEEP => Status::Asleep,
            _ => Status::Error(u32::MAX),
        }
    }

    fn reset(&mut self) {
        // SAFETY: the instance is prepared, here and in all calls below.
        self.call(self.functions.abi.reset.map(|f| move |it| unsafe { f(it) }));
    }

    fn wants(&mut self, tick: &mut Tick<'_>) -> bool {
        let Some(wants) = self.functions.abi.wants else { return true };
        let (answer, detail) = self.call_with_tick(tick, false, Some(wants));
        self.outcome(answer, detail) > 0
    }

    fn absorb(&mut self, tick: &mut Tick<'_>) {
        let (answer, detail) = self.call_with_tick(tick, false, self.functions.abi.absorb);
        self.outcome(answer, detail);
    }

    fn elapsed(&mut self, ticks: u64) {
        // SAFETY: see `reset`.
        self.call(self.functions.abi.elapsed.map(|f| move |it| unsafe { f(it, ticks) }));
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        // SAFETY: see `reset`.
        self.call(self.functions.abi.set_parameter.map(|f| move |it| unsafe { f(it, index as u32, value) }));
    }

    fn state(&mut self, state: &mut State<'_>) {
        /// No node has more: a larger size is a lie, and the state is not handed over.
        const MOST: u64 = 1 << 28;
        let (abi, it) = (&self.functions.abi, self.instance.as_ptr());
        let size = || {
            // SAFETY: see `reset`.
            let size = abi.state_size.map_or(0, |f| unsafe { f(it) });
            if size <= MOST { size as usize } else { 0 }
        };
        let save = |bytes: &mut [u8]| {
            let Some(save) = abi.save else { return Some(0) };
            // SAFETY: see `reset`; the memory has that size.
            usize::try_from(unsafe { save(it, bytes.as_mut_ptr(), bytes.len() as u64) }).ok()
        };
        let restore = |bytes: &[u8]| {
            let Some(restore) = abi.restore else { return bytes.is_empty() };
            // SAFETY: see `reset`; the memory has that size.
            unsafe { restore(it, bytes.as_ptr(), bytes.len() as u64) == ASPERITY_OK }
        };
        state.opaque(size, save, restore);
    }

    fn fault(&mut self) -> Option<Fault> {
        self.fault.take()
    }

    fn warm(&mut self, _heat: f64) {}

    fn attenuate(&mut self, _strength: f32) {}

    fn inner(&mut self, _call: &mut dyn FnMut(&mut dyn Processor)) {}

    fn facts(&mut self) -> Vec<Fact> {
        let mut facts: Vec<Fact> = Vec::new();
        if self.unsaid_writes > 0 {
            facts.push(Fact::count("unsaid_writes", self.unsaid_writes));
        }
        let Some(tell) = self.functions.facts else { return facts };
        let sink = AsperityFactSink {
            context: (&raw mut facts).cast(),
            text: Some(fact_text),
            number: Some(fact_number),
            count: Some(fact_count),
            ..blank()
        };
        // SAFETY: the instance is one of this kind, and the sink lives through the call.
        unsafe { tell(self.functions.at, self.instance.as_ptr(), &sink) };
        facts
    }
}

impl Drop for PluginProcessor {
    fn drop(&mut self) {
        if let Some(destroy) = self.functions.abi.destroy {
            // SAFETY: made by `create`, and this is the last call.
            unsafe { destroy(self.instance.as_ptr()) };
        }
    }
}

/// Adds a fact whose name and text are readable.
///
/// # Safety
/// `context` was handed out by `facts`; texts end with a zero byte.
unsafe fn add(context: *mut c_void, name: *const c_char, fact: impl FnOnce(String) -> Option<Fact>) {
    // SAFETY: the caller's promise.
    unsafe {
        if let (Some(facts), Some(name)) = (context.cast::<Vec<Fact>>().as_mut(), text(name))
            && facts.len() < 256
        {
            facts.extend(fact(name));
        }
    }
}

/// # Safety
/// NULL, or ends with a zero byte.
unsafe fn text(text: *const c_char) -> Option<String> {
    // SAFETY: the caller's promise.
    (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned())
}

unsafe extern "C" fn fact_text(context: *mut c_void, name: *const c_char, value: *const c_char) {
    // SAFETY: called by the plugin during `facts`, with the context it was given, here and below.
    unsafe { add(context, name, |name| Some(Fact::text(name, text(value)?))) };
}

unsafe extern "C" fn fact_number(context: *mut c_void, name: *const c_char, x: f64, unit: *const c_char) {
    // SAFETY: as above.
    unsafe { add(context, name, |name| Some(Fact::number(name, x, text(unit).unwrap_or_default()))) };
}

unsafe extern "C" fn fact_count(context: *mut c_void, name: *const c_char, n: u64) {
    // SAFETY: as above.
    unsafe { add(context, name, |name| Some(Fact::count(name, n))) };
}
