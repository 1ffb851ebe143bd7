//! A graph that runs in real time, in an audio callback of the caller.

use std::ffi::c_char;
use std::sync::Arc;
use std::time::Duration;

use asperity_audio::{Block, Process};
use asperity_engine::{Options, SwapError};
use asperity_graph::{LiveParam, Schedule};
use asperity_hand::servo::Servo;
use asperity_live::driver::{CallbackHalf, Controls, Ticker};
use asperity_live::view::Condition;
use asperity_live::{
    DeviceQueues, ForceReader, Player, Pulled, RunControl, Sample, SampleWriter, force_model, needs_queues,
    now_ns, prepare_live, samples,
};
use asperity_node::{ParamKind, Role};
use asperity_offline::kinds::Kinds;
use asperity_offline::render::channels;
use parking_lot::Mutex;

use crate::engine::{AsperityForce, AsperityHand, NO_FORCE, NO_STYLUS, fault, finite, room};
use crate::graph::{AsperityGraph, Graph, Ready, by_hand, kinds, with};
use crate::handles::{IN_USE, Table};
use crate::status::{
    ASPERITY_BUSY, ASPERITY_FAILED, ASPERITY_INVALID, Answer, AsperityStatus, Refusal, call, given, place,
    text,
};

/// A run in real time. Four threads may use it at once, each for its own functions: one that pulls audio, one
/// that pushes the stylus, one that renders forces, and one that controls the run.
#[derive(Debug)]
pub struct AsperityLive {
    _private: [u8; 0],
}

/// Nothing was pulled so far, or the output fades in.
pub const ASPERITY_STARTING: u32 = 0;
/// The output is at its full level.
pub const ASPERITY_PLAYING: u32 = 1;
/// The output is muted. Ticks go on.
pub const ASPERITY_MUTED: u32 = 2;
/// The engine broke off, and the output is silent. Free the handle.
pub const ASPERITY_BROKEN: u32 = 3;

/// Figures of a run since its start. A frame is a sample of each channel.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AsperityFigures {
    /// ASPERITY_STARTING, ASPERITY_PLAYING, ASPERITY_MUTED or ASPERITY_BROKEN.
    pub state: u32,
    /// 1 if no sample of the stylus came within its timeout, else 0. The position is held meanwhile.
    pub hand_stalled: u32,
    /// Ticks so far.
    pub ticks: u64,
    /// Ticks left out because pulls came too late.
    pub skipped_ticks: u64,
    /// Ticks that ended more than a tick after they were due.
    pub deadline_misses: u64,
    /// Frames that were never played.
    pub lost_frames: u64,
    /// Gaps between pulls: the audio system lost time.
    pub gaps: u64,
    /// Samples that the last limit before the device changed.
    pub limited_samples: u64,
    /// Failures of nodes; `asperity_live_faults` names them.
    pub faults: u64,
    /// Samples of the stylus so far.
    pub hand_samples: u64,
    /// Largest sample since the last call of `asperity_live_figures`, of full scale 1.
    pub peak: f64,
    /// Age of the newest sample of the stylus in the last tick [ms].
    pub hand_age_ms: f64,
    /// Time by which ticks read the stylus in the past [ms].
    pub hand_delay_ms: f64,
    /// Time between a tick's reading of the stylus and the pull of its first sample [ms].
    pub lead_ms: f64,
    /// Time of a tick: the deadline [us].
    pub deadline_us: f64,
    /// Computing time of a tick, 99th percentile [us].
    pub tick_p99_us: f64,
    /// Longest computing time of a tick [us].
    pub tick_max_us: f64,
}

/// Ticks that one call of a node may take, and the least limit [ns]: a busy machine stalls now and then.
const LIMIT: (u64, u64) = (10, 50_000_000);

const OVER: Refusal = Refusal::fixed(ASPERITY_INVALID, c"this run has ended");
const BROKEN: Refusal =
    Refusal::fixed(ASPERITY_FAILED, c"the engine broke off, and the output is silent; free the handle");
const OTHER_CHANNELS: Refusal =
    Refusal::fixed(ASPERITY_INVALID, c"the graph has another number of channels: see asperity_graph_info");
const NOBODY_PULLS: Refusal =
    Refusal::fixed(ASPERITY_BUSY, c"the sample is lost: 4096 wait, since nobody pulls audio");

static LIVES: Table<Live> = Table::new(3);

struct Live {
    control: Mutex<Option<Control>>,
    pull: Mutex<CallbackHalf<Player>>,
    hand: Mutex<Option<SampleWriter>>,
    force: Mutex<Option<Pushes>>,
    controls: Arc<Controls>,
    channels: usize,
}

/// Side of a device that pushes back.
struct Pushes {
    models: ForceReader,
    servo: Servo,
}

/// Side of the thread that controls the run.
struct Control {
    pulled: Pulled,
    graph: Graph,
    kinds: Kinds,
    hand: bool,
}

/// The caller's ends of the queues of a graph.
#[derive(Default)]
struct Ends {
    hand: Option<SampleWriter>,
    force: Option<Pushes>,
}

/// Queues for these nodes of a graph.
fn queues(schedule: &Schedule, ids: &[String], hand: bool) -> (DeviceQueues, Ends) {
    let (mut queues, mut ends) = (DeviceQueues::default(), Ends::default());
    let wanted = |role| schedule.with_role(role).find(|(_, node)| ids.contains(&node.id));
    if let Some((_, node)) = wanted(Role::Hand).filter(|_| hand) {
        let (writer, reader) = samples();
        queues.hands.insert(node.id.clone(), reader);
        ends.hand = Some(writer);
    }
    if let Some((_, node)) = wanted(Role::Force) {
        let (writer, models) = force_model();
        queues.forces.insert(node.id.clone(), writer);
        ends.force = Some(Pushes { models, servo: Servo::new(node.params.number("max_force_n")) });
    }
    (queues, ends)
}

impl Live {
    fn new(graph: Graph, hand: bool) -> Answer<Self> {
        // Nodes of plugins run on threads of their own: one that hangs does not stop the sound.
        let mut kinds = kinds().apart(true);
        let Ready { graph: file, compiled, .. } = graph.ready(&mut kinds, hand)?;
        let schedule = &compiled.schedule;
        graph.fed(schedule, hand)?;
        kinds.plays();
        let all: Vec<String> = schedule.nodes.iter().map(|node| node.id.clone()).collect();
        let (queues, ends) = queues(schedule, &all, hand);
        let ticks_ns = LIMIT.0 * 1_000_000_000 / u64::from(schedule.tick_hz);
        let options = Options { limit_ns: Some(ticks_ns.max(LIMIT.1)), ..Options::default() };
        let (controller, player) = prepare_live(compiled, &file, options, queues, None, Vec::new());
        let channels = player.rates().channels;
        let (pulled, half) = Pulled::start(controller, player, RunControl::default());
        let controls = pulled.controls().clone();
        Ok(Self {
            control: Mutex::new(Some(Control { pulled, graph, kinds, hand })),
            pull: Mutex::new(half),
            hand: Mutex::new(ends.hand),
            force: Mutex::new(ends.force),
            controls,
            channels,
        })
    }

    fn control<R>(&self, function: impl FnOnce(&mut Control) -> Answer<R>) -> Answer<R> {
        let mut control = self.control.try_lock().ok_or(IN_USE)?;
        let control = control.as_mut().ok_or(OVER)?;
        control.pulled.graph_controller().collect();
        function(control)
    }

    fn pull(&self, out: &mut [f32], channels: usize) -> Answer {
        if channels != self.channels {
            return Err(OTHER_CHANNELS);
        }
        let mut pull = self.pull.try_lock().ok_or(IN_USE)?;
        pull.process(&mut Block { output: out, channels, now_ns: now_ns() });
        if self.controls.failed() { Err(BROKEN) } else { Ok(()) }
    }

    fn push(&self, hand: &AsperityHand, time_ns: u64) -> Answer {
        finite(hand)?;
        let mut writer = self.hand.try_lock().ok_or(IN_USE)?;
        let arrived_ns = now_ns();
        let sample = Sample {
            time_ns: if time_ns == 0 { arrived_ns } else { time_ns },
            arrived_ns,
            position: hand.position_mm,
            force: hand.force_n,
            stroke: hand.stroke,
        };
        if writer.as_mut().ok_or(NO_STYLUS)?.send(sample) { Ok(()) } else { Err(NOBODY_PULLS) }
    }

    fn with_force<R>(&self, function: impl FnOnce(&mut Pushes) -> R) -> Answer<R> {
        let mut force = self.force.try_lock().ok_or(IN_USE)?;
        force.as_mut().map(function).ok_or(NO_FORCE)
    }

    /// Exchanges the graph, unless that is refused.
    fn swap(&self, control: &mut Control, graph: Graph) -> Answer {
        let Control { pulled, kinds, hand, .. } = control;
        let ready = graph.ready(kinds, *hand)?;
        let (controller, next) = (pulled.graph_controller(), &ready.compiled.schedule);
        graph.fed(next, *hand)?;
        if channels(next).len().max(1) != self.channels {
            return Err(Refusal::invalid("the number of channels would change: make another run"));
        }
        let running = controller.schedule().clone();
        let (queues, ends) = queues(next, &needs_queues(&running, next), *hand);
        let swapped = controller.swap(ready.compiled, &ready.graph, &[], queues, Vec::new());
        swapped.map_err(|e| {
            let text = format!("the graph {e}");
            match e {
                SwapError::Busy => Refusal::busy(&text),
                SwapError::Stopped => Refusal::failed(&text),
                _ => Refusal::invalid(&text),
            }
        })?;
        let next = controller.schedule();
        let has = |role| next.with_role(role).next().is_some();
        exchange(&self.hand, ends.hand, has(Role::Hand));
        exchange(&self.force, ends.force, has(Role::Force));
        control.graph = graph;
        Ok(())
    }

    /// Sets a parameter: at once if its node lets it change, else by another graph.
    fn set(&self, control: &mut Control, name: &str, value: &str) -> Answer {
        let graph = control.graph.with(format!("{name}={value}"));
        let controller = control.pulled.graph_controller();
        let schedule = controller.schedule();
        let live = name.rsplit_once('.').and_then(|(node, param)| {
            let at = schedule.index_of(node)?;
            let live = schedule.nodes[at].live.iter().find(|live| live.name == param)?;
            Some((node, param, number(live, value)?))
        });
        // A text that is no value of the parameter is refused by the compiler, with its reason.
        let Some((node, param, value)) = live else { return self.swap(control, graph) };
        controller.set_parameter(node, param, value).map_err(|e| Refusal::invalid(&e))?;
        control.graph = graph;
        Ok(())
    }
}

/// Puts another end of a queue in the place of one, for a graph that `has` such a node.
fn exchange<T>(place: &Mutex<Option<T>>, next: Option<T>, has: bool) {
    if next.is_some() || !has {
        // Waits without a queue, so that the thread of the other end never has to wake this one.
        let mut end = loop {
            match place.try_lock() {
                Some(end) => break end,
                None => std::thread::sleep(Duration::from_micros(50)),
            }
        };
        *end = next;
    }
}

/// The number by which a live parameter is set.
fn number(live: &LiveParam, value: &str) -> Option<f64> {
    let value = value.trim();
    match &live.kind {
        ParamKind::Flag => value.parse::<bool>().ok().map(|flag| f64::from(u8::from(flag))),
        ParamKind::Choice(words) => {
            let word = value.trim_matches('"');
            words.iter().position(|known| *known == word).map(|at| at as f64)
        }
        _ => value.parse().ok(),
    }
}

/// Uses a run from several threads.
fn using<R>(live: *const AsperityLive, function: impl FnOnce(&Live) -> Answer<R>) -> Answer<R> {
    LIVES.with(live as usize, function)
}

/// Time by the clock of this library [ns]: monotonic, from about the start of the program. Times of samples
/// are by this clock.
///
/// Any thread. Never blocks.
#[unsafe(no_mangle)]
pub extern "C" fn asperity_now_ns() -> u64 {
    now_ns()
}

/// Makes a run of a graph. `stylus` says who moves the stylus: ASPERITY_STROKE or ASPERITY_HAND. Set
/// `audio_hz` of the graph to the rate of your device before. `live` gets the handle, or NULL. Time begins
/// with the first pull.
///
/// The heat of the actuator's coil begins cold. Keep one run for a device, and swap its graphs.
///
/// One thread at a time. Blocks: compiles, allocates.
///
/// # Safety
/// `live` is NULL or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_live_new(
    graph: *mut AsperityGraph,
    stylus: u32,
    live: *mut *mut AsperityLive,
) -> AsperityStatus {
    call(|| {
        // SAFETY: the caller's promise.
        let to = unsafe { place(live, "live")? };
        *to = std::ptr::null_mut();
        let graph = with(graph, |graph| Ok(graph.clone()))?;
        *to = LIVES.insert(Live::new(graph, by_hand(stylus)?)?)? as *mut AsperityLive;
        Ok(())
    })
}

/// Ramps the output down within 15 ms and ends the run. Pull meanwhile, until this returns: that plays the
/// ramp. If nobody pulls, it returns within a second. NULL is nothing to free.
///
/// Any thread but the one that pulls. Blocks.
#[unsafe(no_mangle)]
pub extern "C" fn asperity_live_free(live: *mut AsperityLive) -> AsperityStatus {
    call(|| {
        if live.is_null() {
            return Ok(());
        }
        using(live, |it| {
            let control = it.control.try_lock().ok_or(IN_USE)?.take();
            // Waits for the ramp, while the other threads go on.
            drop(control);
            Ok(())
        })?;
        LIVES.free(live as usize)
    })
}

/// Fills `out` with the next `frames` frames: interleaved, full scale 1. Any number of frames. `channels` is
/// that of `asperity_graph_info`. Unless the result is ASPERITY_OK, `out` is silent.
///
/// Call it as an audio device does, at its rate: the pulls are the clock of the run. A late pull counts as a
/// gap. For blocks that are longer than a tick, the stylus is read one block ago.
///
/// The audio thread: one at a time, with 128 KiB of stack. Never waits, locks, allocates or calls the system,
/// except for reading the clock.
///
/// # Safety
/// `out` is NULL or has room for `frames` times `channels` samples.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_live_pull(
    live: *mut AsperityLive,
    out: *mut f32,
    frames: usize,
    channels: u32,
) -> AsperityStatus {
    call(|| {
        // SAFETY: the caller's promise.
        let out = unsafe { room(out, frames, channels as usize)? };
        // A run that another thread just freed writes nothing.
        out.fill(0.0);
        using(live, |live| live.pull(out, channels as usize))
    })
}

/// Gives a sample of the stylus. `time_ns` is when it was measured, by `asperity_now_ns`; 0 for now. Samples
/// come in the order of their times. ASPERITY_BUSY means that this sample is lost: give the next one.
///
/// The thread of the stylus: one at a time. Never waits, locks or allocates.
///
/// # Safety
/// `hand` is NULL or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_live_push(
    live: *mut AsperityLive,
    hand: *const AsperityHand,
    time_ns: u64,
) -> AsperityStatus {
    const NULL: Refusal = Refusal::fixed(ASPERITY_INVALID, c"`hand` is NULL");
    call(|| {
        // SAFETY: the caller's promise.
        let hand = unsafe { hand.as_ref() }.ok_or(NULL)?;
        using(live, |live| live.push(hand, time_ns))
    })
}

/// Writes the newest surface, for a device with a loop of its own. One that is older than 100 ms should not
/// push any more.
///
/// The thread of forces: one at a time. Never waits, locks or allocates.
///
/// # Safety
/// `force` is NULL or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_live_force(
    live: *mut AsperityLive,
    force: *mut AsperityForce,
) -> AsperityStatus {
    const NULL: Refusal = Refusal::fixed(ASPERITY_INVALID, c"`force` is NULL");
    call(|| {
        // SAFETY: the caller's promise.
        let to = unsafe { force.as_mut() }.ok_or(NULL)?;
        *to = using(live, |live| live.with_force(|it| it.models.read().into()))?;
        Ok(())
    })
}

/// Writes the force [N] on a stylus at `position_mm`, x, y and z of both. Call it about 1000 times a second.
/// It evaluates the newest surface at this place and time, limits force and slew, and lets go within 20 ms
/// when the surface is older than 100 ms. After an error, `force_n` is 0.
///
/// The thread of forces: one at a time. Never waits, locks or allocates.
///
/// # Safety
/// `position_mm` is NULL or has 3 numbers, and `force_n` is NULL or has room for 3.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_live_servo(
    live: *mut AsperityLive,
    position_mm: *const f64,
    force_n: *mut f64,
) -> AsperityStatus {
    const NULL: Refusal = Refusal::fixed(ASPERITY_INVALID, c"`position_mm` or `force_n` is NULL");
    call(|| {
        // SAFETY: the caller's promise. Both may be the same place, so this one is copied first.
        let position = unsafe { position_mm.cast::<[f64; 3]>().as_ref() }.copied();
        // SAFETY: as above.
        let to = unsafe { force_n.cast::<[f64; 3]>().as_mut() }.ok_or(NULL)?;
        *to = [0.0; 3];
        let position = position.ok_or(NULL)?;
        // A place that is no number makes the servo let go.
        *to = using(live, |live| {
            live.with_force(|Pushes { models, servo }| servo.step(now_ns(), position, models.read()))
        })?;
        Ok(())
    })
}

/// Sets a parameter while it runs, such as `strength.gain` to `0.1`, or `texture.material` to `oak`. One that
/// its node can change goes to the next tick. Any other makes another graph, which takes over as in
/// `asperity_live_swap`.
///
/// The thread of control: one at a time. Blocks: may compile, allocates.
///
/// # Safety
/// `name` and `value` are NULL or end with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_live_set(
    live: *mut AsperityLive,
    name: *const c_char,
    value: *const c_char,
) -> AsperityStatus {
    call(|| {
        // SAFETY: the caller's promise.
        let (name, value) = unsafe { (given(name, "name")?, given(value, "value")?) };
        using(live, |it| it.control(|control| it.set(control, name, value)))
    })
}

/// Exchanges the graph of a run. The next ticks take it over: parts that are new fade in, and the rest goes
/// on. Rates and channels must be the same. ASPERITY_BUSY means that the exchange before is not over: pull,
/// and try again.
///
/// The thread of control: one at a time. Blocks: compiles, allocates.
#[unsafe(no_mangle)]
pub extern "C" fn asperity_live_swap(live: *mut AsperityLive, graph: *mut AsperityGraph) -> AsperityStatus {
    call(|| {
        let graph = with(graph, |graph| Ok(graph.clone()))?;
        using(live, |it| it.control(|control| it.swap(control, graph)))
    })
}

/// Mutes the output within 15 ms (1), or unmutes it (0). Ticks go on.
///
/// Any thread. Never blocks.
#[unsafe(no_mangle)]
pub extern "C" fn asperity_live_mute(live: *mut AsperityLive, mute: u32) -> AsperityStatus {
    call(|| {
        using(live, |live| {
            live.controls.run_control().mute(mute != 0);
            Ok(())
        })
    })
}

/// Sets the strength of the output: a factor from 0 to 1 before every limiter, which it reaches within 20 ms.
///
/// Any thread. Never blocks.
#[unsafe(no_mangle)]
pub extern "C" fn asperity_live_strength(live: *mut AsperityLive, strength: f64) -> AsperityStatus {
    const RANGE: Refusal = Refusal::fixed(ASPERITY_INVALID, c"`strength` is not from 0 to 1");
    call(|| {
        if !(0.0..=1.0).contains(&strength) {
            return Err(RANGE);
        }
        using(live, |live| {
            live.controls.run_control().set_strength(strength as f32);
            Ok(())
        })
    })
}

/// Writes the figures of a run.
///
/// The thread of control: one at a time. Allocates.
///
/// # Safety
/// `figures` is NULL or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_live_figures(
    live: *mut AsperityLive,
    figures: *mut AsperityFigures,
) -> AsperityStatus {
    call(|| {
        // SAFETY: the caller's promise.
        let to = unsafe { place(figures, "figures")? };
        *to = using(live, |it| {
            it.control(|control| {
                let (lead_ns, view) = (it.controls.lead_ns(), control.pulled.view());
                let hand = view.sources.first().cloned().unwrap_or_default();
                Ok(AsperityFigures {
                    state: match view.condition {
                        Condition::Playing => ASPERITY_PLAYING,
                        Condition::Muted => ASPERITY_MUTED,
                        Condition::Failed => ASPERITY_BROKEN,
                        Condition::Starting | Condition::Stopping | Condition::Lost => ASPERITY_STARTING,
                    },
                    hand_stalled: hand.stalled.into(),
                    ticks: view.ticks,
                    skipped_ticks: view.skipped_ticks,
                    deadline_misses: view.timing.misses,
                    lost_frames: view.lost_samples,
                    gaps: view.xruns,
                    limited_samples: view.guarded,
                    faults: view.faults,
                    hand_samples: hand.samples,
                    peak: view.peak.into(),
                    hand_age_ms: hand.age_ms,
                    hand_delay_ms: hand.delay_ms,
                    lead_ms: lead_ns as f64 * 1e-6,
                    deadline_us: view.timing.deadline_us,
                    tick_p99_us: view.timing.compute_us[1],
                    tick_max_us: view.timing.compute_us[3],
                })
            })
        })?;
        Ok(())
    })
}

/// Nodes that failed so far, one a line: how often, and how at last. Empty for none. NULL after an error. The
/// text is valid until this thread asks for another text.
///
/// The thread of control: one at a time. Allocates.
#[unsafe(no_mangle)]
pub extern "C" fn asperity_live_faults(live: *mut AsperityLive) -> *const c_char {
    text(|| {
        using(live, |it| {
            it.control(|control| {
                let view = control.pulled.view();
                let layout = control.pulled.graph_controller().layout();
                let mut text = String::new();
                for (node, seen) in layout.nodes.iter().zip(&view.nodes).filter(|(_, seen)| seen.faults > 0) {
                    fault(&mut text, (&node.id, &node.kind), seen.faults, &seen.last_fault);
                }
                Ok(text)
            })
        })
    })
}
