//! A graph that runs tick by tick, as fast as its caller wants.

use std::ffi::c_char;
use std::fmt::Write as _;

use asperity_engine::{Engine, Options};
use asperity_live::{ForceModel, place as input};
use asperity_node::Role;
use asperity_offline::probe::Probe;
use asperity_offline::render::{channels, samples};
use parking_lot::Mutex;

use crate::graph::{AsperityGraph, Ready, by_hand, kinds, with};
use crate::handles::{IN_USE, Table};
use crate::status::{ASPERITY_INVALID, Answer, AsperityStatus, Refusal, call, given, place, text};

/// A graph at a tick. It has no clock and no device. The same graph, stroke and seed give the same samples,
/// as the program `asperity render` gives them. One thread at a time.
#[derive(Debug)]
pub struct AsperityEngine {
    _private: [u8; 0],
}

/// The stylus.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AsperityHand {
    /// x, y, z in mm, finite; z points up.
    pub position_mm: [f64; 3],
    /// Force with which the hand presses [N], finite; 0 if it is not measured.
    pub force_n: f64,
    /// Number of the stroke. A new number means that the stylus was put down elsewhere: the way there is no
    /// motion.
    pub stroke: u32,
}

/// The surface under the stylus: a plane with a spring and a damper, for the loop of a device that pushes
/// back.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AsperityForce {
    /// A point of the plane [mm].
    pub point_mm: [f64; 3],
    /// Outward normal of the plane: a unit vector, or all 0 for no surface.
    pub normal: [f64; 3],
    /// Stiffness [N/mm], at least 0.
    pub stiffness_n_per_mm: f64,
    /// Damping along the normal while in the plane [N s/m], at least 0.
    pub damping_ns_per_m: f64,
    /// Force beside the plane [N]: friction, drag, pull.
    pub beside_n: [f64; 3],
    /// Largest force [N] that the graph allows.
    pub max_force_n: f64,
    /// Time of the tick by `asperity_now_ns` [ns]; 0 in an engine, which has no clock.
    pub time_ns: u64,
    /// 1 if the values count. If it is 0, push with no force.
    pub valid: u32,
}

impl From<&ForceModel> for AsperityForce {
    fn from(model: &ForceModel) -> Self {
        Self {
            point_mm: model.point,
            normal: model.normal,
            stiffness_n_per_mm: model.stiffness_n_per_mm,
            damping_ns_per_m: model.damping_ns_per_m,
            beside_n: model.beside_n,
            max_force_n: model.max_force_n,
            time_ns: model.time_ns,
            valid: model.valid.into(),
        }
    }
}

pub(crate) const NO_STYLUS: Refusal =
    Refusal::fixed(ASPERITY_INVALID, c"the caller moves no stylus here: make it with ASPERITY_HAND");
pub(crate) const NOT_FINITE: Refusal =
    Refusal::fixed(ASPERITY_INVALID, c"position and force must be finite numbers");
pub(crate) const NO_FORCE: Refusal =
    Refusal::fixed(ASPERITY_INVALID, c"no node of this graph pushes back: add one, such as haply_force");
const NO_ROOM: Refusal = Refusal::fixed(
    ASPERITY_INVALID,
    c"there is no room for the samples of a tick: `tick_frames` times `channels` of asperity_graph_info",
);

/// Checks the numbers of a hand.
pub(crate) fn finite(hand: &AsperityHand) -> Answer {
    let finite = hand.position_mm.iter().all(|x| x.is_finite()) && hand.force_n.is_finite();
    if finite { Ok(()) } else { Err(NOT_FINITE) }
}

static ENGINES: Table<Mutex<Steps>> = Table::new(2);

struct Steps {
    engine: Engine,
    hand: Option<usize>,
    /// The node that pushes back, and its largest force \[N\].
    force: Option<(usize, f64)>,
    channels: Vec<usize>,
    probes: Vec<(String, Probe)>,
}

impl Steps {
    fn new(ready: Ready, by_hand: bool) -> Self {
        let Ready { compiled, probes, .. } = ready;
        let schedule = &compiled.schedule;
        let hand = schedule.with_role(Role::Hand).next().map(|(node, _)| node).filter(|_| by_hand);
        let force = schedule.with_role(Role::Force).next();
        let force = force.map(|(node, wall)| (node, wall.params.number("max_force_n")));
        let channels = channels(schedule);
        let mut it =
            Self { engine: Engine::new(compiled, Options::default()), hand, force, channels, probes };
        it.begin();
        it
    }

    /// A hand that does not press, in its first stroke. Until it has a position, the output is silent.
    fn begin(&mut self) {
        if let Some(hand) = self.hand {
            self.engine.feed_control(hand, input::FORCE, &[0.0], true);
            self.engine.feed_control(hand, input::STROKE, &[0.0], true);
        }
    }

    fn take(&mut self, hand: &AsperityHand) -> Answer {
        let node = self.hand.ok_or(NO_STYLUS)?;
        finite(hand)?;
        self.engine.feed_control(node, input::POSITION, &hand.position_mm, true);
        self.engine.feed_control(node, input::FORCE, &[hand.force_n], true);
        self.engine.feed_control(node, input::STROKE, &[hand.stroke.into()], true);
        Ok(())
    }

    /// Runs a tick, and answers its frames.
    fn tick(&mut self, hand: Option<&AsperityHand>, out: &mut [f32]) -> Answer<usize> {
        let schedule = self.engine.schedule();
        let span = asperity_node::time::samples(self.engine.next_tick(), schedule.audio_hz, schedule.tick_hz);
        let (frames, step) = ((span.end - span.start) as usize, self.channels.len().max(1));
        let out = out.get_mut(..frames * step).ok_or(NO_ROOM)?;
        hand.map_or(Ok(()), |hand| self.take(hand))?;
        self.engine.tick();
        out.fill(0.0);
        for (channel, node) in self.channels.iter().enumerate() {
            for (frame, x) in out.chunks_exact_mut(step).zip(samples(self.engine.output(*node, 0))) {
                frame[channel] = *x;
            }
        }
        Ok(frames)
    }

    fn force(&self) -> Answer<AsperityForce> {
        let (node, max_force_n) = self.force.ok_or(NO_FORCE)?;
        let model = ForceModel::of(&self.engine, node, max_force_n);
        Ok((&model).into())
    }

    fn read(&self, port: &str) -> Answer<Vec<f32>> {
        let Some((_, probe)) = self.probes.iter().find(|(name, _)| name == port) else {
            let what = format!("`{port}` is not read in this engine: asperity_graph_probe comes first");
            return Err(Refusal::invalid(&what));
        };
        // Before the first tick there is nothing.
        let last = self.engine.next_tick().checked_sub(1);
        Ok(last.and_then(|tick| probe.take(&self.engine, tick)).map(|(_, values)| values).unwrap_or_default())
    }

    fn faults(&mut self) -> String {
        let mut text = String::new();
        for (i, node) in self.engine.schedule().nodes.iter().enumerate() {
            let Some(report) = self.engine.report(i).filter(|report| report.faults > 0) else { continue };
            let last = report.last_fault.as_ref().map(ToString::to_string).unwrap_or_default();
            fault(&mut text, (&node.id, &node.kind), report.faults, &last);
        }
        text
    }
}

/// Adds a line about a node that failed.
pub(crate) fn fault(text: &mut String, (id, kind): (&str, &str), count: u64, last: &str) {
    let end = if text.is_empty() { "" } else { "\n" };
    let times = if count == 1 { "once" } else { &format!("{count} times") };
    let _ = write!(text, "{end}`{id}` ({kind}) failed {times}; last: {last}");
}

fn using<R>(engine: *const AsperityEngine, function: impl FnOnce(&mut Steps) -> Answer<R>) -> Answer<R> {
    ENGINES.with(engine as usize, |steps| function(&mut *steps.try_lock().ok_or(IN_USE)?))
}

/// Samples that C gives room for.
///
/// # Safety
/// `out` is NULL or has room for `frames` times `channels` samples, which nobody else uses meanwhile.
pub(crate) unsafe fn room<'a>(out: *mut f32, frames: usize, channels: usize) -> Answer<&'a mut [f32]> {
    const NULL: Refusal = Refusal::fixed(ASPERITY_INVALID, c"`out` is NULL");
    const MUCH: Refusal = Refusal::fixed(ASPERITY_INVALID, c"there is no memory of so many samples");
    let len = frames.checked_mul(channels).filter(|len| *len <= isize::MAX as usize / size_of::<f32>());
    match len {
        Some(0) => Ok(&mut []),
        Some(_) if out.is_null() => Err(NULL),
        // SAFETY: the caller's promise; the size was checked.
        Some(len) => Ok(unsafe { std::slice::from_raw_parts_mut(out, len) }),
        None => Err(MUCH),
    }
}

/// Makes an engine at tick 0. `stylus` says who moves the stylus: ASPERITY_STROKE or ASPERITY_HAND. `engine`
/// gets the handle, or NULL.
///
/// One thread at a time. Blocks: compiles, allocates.
///
/// # Safety
/// `engine` is NULL or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_engine_new(
    graph: *mut AsperityGraph,
    stylus: u32,
    engine: *mut *mut AsperityEngine,
) -> AsperityStatus {
    call(|| {
        // SAFETY: the caller's promise.
        let to = unsafe { place(engine, "engine")? };
        *to = std::ptr::null_mut();
        let steps = with(graph, |graph| {
            let hand = by_hand(stylus)?;
            let ready = graph.ready(&mut kinds(), hand)?;
            graph.fed(&ready.compiled.schedule, hand)?;
            Ok(Steps::new(ready, hand))
        })?;
        *to = ENGINES.insert(Mutex::new(steps))? as *mut AsperityEngine;
        Ok(())
    })
}

/// Frees an engine. NULL is nothing to free.
///
/// Any thread. Waits up to 2 s for a call of another thread with this handle.
#[unsafe(no_mangle)]
pub extern "C" fn asperity_engine_free(engine: *mut AsperityEngine) -> AsperityStatus {
    call(|| ENGINES.free(engine as usize))
}

/// Moves the stylus, runs one tick, and writes its samples: interleaved, full scale 1. NULL for `hand` leaves
/// the stylus where it is, or to its stroke. `room` is the number of samples that `out` has room for, at
/// least `tick_frames` times `channels` of `asperity_graph_info`. `frames` gets the frames of the tick; it
/// may be NULL.
///
/// One thread at a time. Never waits or allocates, if no node does.
///
/// # Safety
/// `hand` and `frames` are NULL or valid, and `out` has room for that many samples.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_engine_tick(
    engine: *mut AsperityEngine,
    hand: *const AsperityHand,
    out: *mut f32,
    room: usize,
    frames: *mut usize,
) -> AsperityStatus {
    call(|| {
        // SAFETY: the caller's promise.
        let (hand, out) = unsafe { (hand.as_ref(), self::room(out, room, 1)?) };
        let ran = using(engine, |steps| steps.tick(hand, out))?;
        // SAFETY: as above.
        if let Some(frames) = unsafe { frames.as_mut() } {
            *frames = ran;
        }
        Ok(())
    })
}

/// Writes the surface of the last tick.
///
/// One thread at a time. Never waits or allocates.
///
/// # Safety
/// `force` is NULL or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_engine_force(
    engine: *mut AsperityEngine,
    force: *mut AsperityForce,
) -> AsperityStatus {
    call(|| {
        // SAFETY: the caller's promise.
        let force = unsafe { place(force, "force")? };
        *force = using(engine, |steps| steps.force())?;
        Ok(())
    })
}

/// Writes the values of a port in the last tick: those of a control, the samples of a signal, the bins of a
/// frame (real and imaginary part of complex ones). `count` gets their number, also if that is more than
/// `room`; then the first ones are written. It is 0 in a tick without a frame. The port was named by
/// `asperity_graph_probe`.
///
/// One thread at a time. Allocates.
///
/// # Safety
/// `port` is NULL or ends with a zero byte, `values` has room for so many, and `count` may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_engine_read(
    engine: *mut AsperityEngine,
    port: *const c_char,
    values: *mut f32,
    room: usize,
    count: *mut usize,
) -> AsperityStatus {
    call(|| {
        // SAFETY: the caller's promise.
        let (port, to) = unsafe { (given(port, "port")?, self::room(values, room, 1)?) };
        // SAFETY: as above.
        let count = unsafe { place(count, "count")? };
        let read = using(engine, |steps| steps.read(port))?;
        let fits = read.len().min(to.len());
        to[..fits].copy_from_slice(&read[..fits]);
        *count = read.len();
        Ok(())
    })
}

/// Goes back to tick 0, as after `asperity_engine_new`.
///
/// One thread at a time. Allocates.
#[unsafe(no_mangle)]
pub extern "C" fn asperity_engine_reset(engine: *mut AsperityEngine) -> AsperityStatus {
    call(|| {
        using(engine, |steps| {
            steps.engine.reset();
            steps.begin();
            Ok(())
        })
    })
}

/// Nodes that failed so far, one a line: how often, and how at last. Empty for none. NULL after an error. The
/// text is valid until this thread asks for another text.
///
/// One thread at a time. Allocates.
#[unsafe(no_mangle)]
pub extern "C" fn asperity_engine_faults(engine: *mut AsperityEngine) -> *const c_char {
    text(|| using(engine, |steps| Ok(steps.faults())))
}
