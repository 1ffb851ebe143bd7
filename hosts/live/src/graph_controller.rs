//! Control side of a running graph: changes the graph and reads its figures.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use asperity_engine::{Controller, Engine, Finished, Options, SwapError, SwapReport};
use asperity_graph::{Compiled, GraphFile, Schedule, ScheduledNode};
use asperity_node::{Params, Role};
use parking_lot::Mutex;
use ringbuf::traits::{Consumer, Observer, Producer, Split};
use ringbuf::{HeapCons, HeapProd, HeapRb};

use crate::layout::{ACCELERATION, layout, scopes};
use crate::output_limits::{LimitsControl, OutputLimits, device_limits, limiter_of};
use crate::player::{
    Hand, HandInput, MicReader, Motion, NodeMeters, Player, Scope, Stylus, TapeReader, Wiring, hand_tape,
    tape,
};
use crate::timeline::Timeline;
use crate::view::{Layout, Materials, SourceView, View};
use crate::{ForceWriter, SampleReader};

opaque_debug!(GraphController);

/// Time that a scope's queue holds [s].
const SCOPE_S: f64 = 0.25;

/// A call that lasts longer is shown as a fault. A busy machine adds far less;
/// [`Session::stop`](crate::Session::stop) waits longer.
const HANGS: Duration = Duration::from_secs(1);

/// [`NodeView::last_fault`](crate::view::NodeView::last_fault) of a node whose call lasts too long. If
/// there is a limit, the engine counts the same fault when the call ends.
pub const DOES_NOT_COME_BACK: &str = "does not come back";

/// Queues between nodes and devices, by node id.
#[derive(Debug, Default)]
pub struct DeviceQueues {
    /// Samples of hands.
    pub hands: HashMap<String, SampleReader>,
    /// Force models for devices.
    pub forces: HashMap<String, ForceWriter>,
    /// Inputs of hands in an earlier run, each with its tick. They take the place of devices.
    pub replayed: HashMap<String, Vec<(u64, HandInput)>>,
    /// Whether inputs of hands are [recorded](GraphController::recorded) from now on, under the names of
    /// their nodes: see [`HandInput::COUNT`].
    pub record_hands: bool,
}

/// A graph that was sent to the tick thread.
struct Sent {
    /// [`Engine::swaps`] from which on it runs.
    swap: u64,
    schedule: Arc<Schedule>,
    meters: Arc<NodeMeters>,
    sources: Vec<Source>,
    forces: HashMap<String, Arc<Mutex<ForceWriter>>>,
    scopes: Vec<HeapCons<f32>>,
    layout: Layout,
    tapes: Vec<Tape>,
    /// `audio_out` nodes by channel, and `audio_in` nodes by recorded channel.
    channels: Vec<String>,
    recorded: Vec<String>,
    records_hands: bool,
}

/// Changes a running graph from a control thread, and reads its figures. The other end of a [`Player`].
pub struct GraphController {
    controller: Controller,
    limits: LimitsControl,
    wirings: HeapProd<Box<Wiring>>,
    retired: HeapCons<Box<Wiring>>,
    /// The newest graph that was sent.
    sent: Sent,
    /// The call in progress at the last look, and for how long it was seen.
    inside: Option<(u64, Duration)>,
    /// Recordings, those of earlier graphs first, until they are read to their end.
    tapes: Vec<Tape>,
    lost: u64,
}

struct Tape {
    sink: String,
    graph: u64,
    reader: TapeReader,
}

/// Values that a sink recorded in a tick.
#[derive(Clone, Copy, Debug)]
pub struct Recorded<'r> {
    /// The node.
    pub sink: &'r str,
    /// Number of the graph, as in [`Layout`].
    pub graph: u64,
    /// Start of the values: a tick for controls, a sample at the signal's rate for audio and frames.
    pub start: u64,
    /// The values.
    pub values: &'r [f32],
}

/// A source of a hand's motion. It goes on through swaps under its node's id.
#[derive(Clone, Default)]
struct Source {
    id: String,
    hand: Arc<Hand>,
    /// Samples and stalls of the devices that it had before.
    earlier: [u64; 2],
    /// Samples when it was last looked at, and samples a second, averaged over about a second.
    samples: u64,
    per_s: f64,
}

impl Source {
    /// Samples and stalls of all its devices.
    fn counts(&self) -> [u64; 2] {
        let [samples, stalls] = self.earlier;
        [samples + self.hand.samples.load(Relaxed), stalls + self.hand.stalls.load(Relaxed)]
    }

    /// Figures now, `seconds` after the last time.
    fn view(&mut self, seconds: f64) -> SourceView {
        let [samples, stalls] = self.counts();
        let fresh = samples.saturating_sub(self.samples) as f64;
        if seconds > 0.0 {
            self.per_s += (fresh / seconds - self.per_s) * (1.0 - (-seconds).exp());
        }
        self.samples = samples;
        SourceView {
            id: self.id.clone(),
            rate_hz: self.per_s,
            age_ms: self.hand.age_ns.load(Relaxed) as f64 * 1e-6,
            delay_ms: self.hand.delay_ns.load(Relaxed) as f64 * 1e-6,
            stalls,
            stalled: self.hand.stalled.load(Relaxed),
            samples,
        }
    }
}

/// Prepares a graph to run in real time: the player for a driver, and its control side. `queues` holds a
/// queue for every node with the role `Hand` or `Force`; a node without one stays silent. `materials`: the
/// textures that a person may choose.
pub fn prepare_live(
    compiled: Compiled,
    graph: &GraphFile,
    options: Options,
    queues: DeviceQueues,
    mic: Option<MicReader>,
    materials: Vec<Materials>,
) -> (GraphController, Player) {
    let schedule = Arc::new(compiled.schedule.clone());
    let outs = channels(graph, &schedule, Role::AudioOutput, None);
    let output_limits = OutputLimits::new(&compiled, places(&schedule, &outs));
    let (controller, engine) = Engine::controlled(compiled, options);
    let (mut sent, wiring) = wire(0, graph, schedule, queues, None, materials);
    sent.layout.peak_drive = output_limits.peak();
    let limits = device_limits(output_limits);
    let (wirings, to_player) = HeapRb::new(8).split();
    let (from_player, retired) = HeapRb::new(8).split();
    let player = Player::new(engine, wiring, mic, limits.seen.clone(), to_player, from_player);
    let graph_controller = GraphController {
        controller,
        limits,
        wirings,
        retired,
        tapes: std::mem::take(&mut sent.tapes),
        lost: 0,
        sent,
        inside: None,
    };
    (graph_controller, player)
}

impl GraphController {
    /// The newest graph that was sent.
    pub fn schedule(&self) -> &Arc<Schedule> {
        self.controller.schedule()
    }

    /// Whether [`swap`](Self::swap) has room now.
    pub fn ready(&mut self) -> bool {
        while self.retired.try_pop().is_some() {}
        self.controller.ready() && self.wirings.vacant_len() > 0
    }

    /// Sends a changed graph; see [`Controller::swap`]. `queues` holds those that [`needs_queues`] names, and
    /// any that replace others.
    ///
    /// # Errors
    /// [`SwapError`] names the remedy. Nothing is sent then.
    pub fn swap(
        &mut self,
        compiled: Compiled,
        graph: &GraphFile,
        changed: &[String],
        queues: DeviceQueues,
        materials: Vec<Materials>,
    ) -> Result<SwapReport, SwapError> {
        if !self.ready() {
            return Err(SwapError::Busy);
        }
        // Everything that can fail is checked before anything is sent.
        let (old, new) = (self.controller.schedule(), &compiled.schedule);
        if old.tick_hz != new.tick_hz {
            return Err(SwapError::TickRate { running: old.tick_hz, asked: new.tick_hz });
        }
        if old.audio_hz != new.audio_hz {
            return Err(SwapError::AudioRate { running: old.audio_hz, asked: new.audio_hz });
        }
        let schedule = Arc::new(compiled.schedule.clone());
        let number = self.sent.swap + 1;
        let (mut sent, wiring) = wire(number, graph, schedule, queues, Some(&self.sent), materials);
        let output_limits = OutputLimits::new(&compiled, places(&compiled.schedule, &sent.channels));
        sent.layout.peak_drive = output_limits.peak();
        // Sent first, so that it is there in the tick that takes the graph over.
        if self.wirings.try_push(wiring).is_err() {
            return Err(SwapError::Busy);
        }
        let report = self.controller.swap(compiled, changed)?;
        self.limits.next.write(output_limits);
        self.tapes.append(&mut sent.tapes);
        self.sent = sent;
        Ok(report)
    }

    /// Sets a live parameter; see [`Controller::set_parameter`].
    ///
    /// # Errors
    /// The text names the remedy; nothing is sent then.
    pub fn set_parameter(&mut self, node: &str, param: &str, value: f64) -> Result<(), String> {
        self.controller.set_parameter(node, param, value)?;
        let nodes = &mut self.sent.layout.nodes;
        let live =
            nodes.iter_mut().find(|n| n.id == node).and_then(|n| n.live.iter_mut().find(|l| l.name == param));
        if let Some(live) = live {
            live.value = value;
        }
        Ok(())
    }

    /// Nodes that play on these channels of a device.
    pub(crate) fn channels_of(&self, device: &[u16]) -> Vec<(u16, String)> {
        device.iter().copied().zip(self.sent.channels.iter().cloned()).collect()
    }

    /// Nodes that would play, by channel, if `graph` replaced the running one.
    pub fn channels_after(&self, graph: &GraphFile, schedule: &Schedule) -> Vec<String> {
        channels(graph, schedule, Role::AudioOutput, Some(&self.sent.channels))
    }

    /// Limits of the device's channels.
    pub(crate) fn limits(&self) -> &LimitsControl {
        &self.limits
    }

    /// Drops what the tick thread returned, and reports finished swaps.
    pub fn collect(&mut self) -> Vec<Finished> {
        while self.retired.try_pop().is_some() {}
        self.controller.collect()
    }

    /// Passes on the recordings of sinks since the last call, earlier graphs first. Returns how many ticks
    /// were lost so far because nobody read them for 4 s.
    pub fn recorded(&mut self, mut take: impl FnMut(Recorded<'_>)) -> u64 {
        let mut values = Vec::new();
        for Tape { sink, graph, reader } in &mut self.tapes {
            while let Some(start) = reader.next(&mut values) {
                take(Recorded { sink, graph: *graph, start, values: &values });
            }
        }
        let ended: Vec<_> = self.tapes.extract_if(.., |tape| tape.reader.ended()).collect();
        self.lost += ended.iter().map(|tape| tape.reader.lost()).sum::<u64>();
        self.lost + self.tapes.iter().map(|tape| tape.reader.lost()).sum::<u64>()
    }

    /// The graph for a person, with the current values of its live parameters.
    pub fn layout(&self) -> &Layout {
        &self.sent.layout
    }

    /// Adds figures of nodes, sources and scopes. `since`: time since the last call.
    pub fn look(&mut self, view: &mut View, since: Duration) {
        let sent = &mut self.sent;
        view.layout = sent.swap;
        view.nodes = sent.meters.view(&sent.schedule);
        view.faults = sent.meters.faults();
        view.stylus_mm = sent.meters.stylus_mm();
        let call = sent.meters.inside();
        match (&mut self.inside, call) {
            (Some((seen, lasts)), Some((call, node))) if *seen == call => {
                *lasts += since;
                if let Some(node) = view.nodes.get_mut(node).filter(|_| *lasts > HANGS) {
                    // The engine counts it when the call ends, if it does.
                    node.faults += 1;
                    node.last_fault = DOES_NOT_COME_BACK.into();
                    view.faults += 1;
                }
            }
            (inside, call) => *inside = call.map(|(call, _)| (call, Duration::ZERO)),
        }
        view.scopes = sent.scopes.iter_mut().map(|s| s.pop_iter().collect()).collect();
        view.sources = sent.sources.iter_mut().map(|source| source.view(since.as_secs_f64())).collect();
    }
}

/// Nodes that need a new queue when `next` replaces `running`: their name is new, or their parameters differ.
pub fn needs_queues(running: &Schedule, next: &Schedule) -> Vec<String> {
    let outside = |n: &&ScheduledNode| matches!(n.role, Some(Role::Hand | Role::Force));
    let anew = |n: &&ScheduledNode| !goes_on(running, n);
    next.nodes.iter().filter(outside).filter(anew).map(|n| n.id.clone()).collect()
}

/// Whether a node continues one of the graph before, with its queue.
fn goes_on(before: &Schedule, node: &ScheduledNode) -> bool {
    let same = |a: &Params, b: &Params| a.iter().eq(b.iter());
    before.nodes.iter().any(|n| n.id == node.id && n.kind == node.kind && same(&n.params, &node.params))
}

/// Connects the nodes of a graph with devices, recordings and meters.
fn wire(
    swap: u64,
    graph: &GraphFile,
    schedule: Arc<Schedule>,
    mut queues: DeviceQueues,
    before: Option<&Sent>,
    materials: Vec<Materials>,
) -> (Sent, Box<Wiring>) {
    // A node whose queue goes on.
    let same = |node: &ScheduledNode| before.is_some_and(|b| goes_on(&b.schedule, node));
    let (mut sources, mut hands) = (Vec::new(), Vec::new());
    let (mut tapes_out, mut tapes_in) = (Vec::new(), Vec::new());
    let records_hands = queues.record_hands || before.is_some_and(|b| b.records_hands);
    for (at, node) in schedule.with_role(Role::Hand) {
        let was = before.and_then(|b| b.sources.iter().find(|source| source.id == node.id));
        let queue = queues.hands.remove(&node.id);
        let replayed = queues.replayed.remove(&node.id);
        let source = match was {
            Some(was) if queue.is_none() && replayed.is_none() && same(node) => was.clone(),
            _ => {
                let ns = |ms: f64| (ms * 1e6) as u64;
                let delay_ns = node.params.get_number("delay_ms").map(ns);
                let timeout_ns = ns(node.params.number("timeout_ms"));
                let device = |reader| Motion::Device(Timeline::new(reader, delay_ns, timeout_ns));
                let replayed = replayed.map(|inputs| Motion::Recorded(inputs.into()));
                let motion = queue.map(device).or(replayed).map(Mutex::new);
                let earlier = was.map(Source::counts).unwrap_or_default();
                let hand = Arc::new(Hand { motion, ..Hand::default() });
                Source { id: node.id.clone(), hand, earlier, samples: earlier[0], per_s: 0.0 }
            }
        };
        let tape = records_hands.then(|| hand_tape(at, schedule.tick_hz)).map(|(to, reader)| {
            tapes_in.push(Tape { sink: node.id.clone(), graph: swap, reader });
            to
        });
        hands.push((at, source.hand.clone(), tape));
        sources.push(source);
    }
    let mut forces = HashMap::new();
    let mut force_sinks = Vec::new();
    for (at, node) in schedule.with_role(Role::Force) {
        let new = queues.forces.remove(&node.id).map(|writer| Arc::new(Mutex::new(writer)));
        let old = || before.filter(|_| same(node))?.forces.get(&node.id).cloned();
        if let Some(writer) = new.or_else(old) {
            force_sinks.push((at, node.params.number("max_force_n"), writer.clone()));
            forces.insert(node.id.clone(), writer);
        }
    }
    let (mut scopes_out, mut scopes_in) = (Vec::new(), Vec::new());
    for ((node, output), scope) in scopes(&schedule) {
        let (to, from) = HeapRb::new((f64::from(scope.rate_hz) * SCOPE_S) as usize + 1).split();
        scopes_out.push(Scope { node, output, attenuated: scope.name == ACCELERATION, to });
        scopes_in.push(from);
    }
    let recorders = schedule.nodes.iter().enumerate().filter(|(_, node)| {
        matches!(node.role, Some(Role::Recorder | Role::Probe)) && !node.params.text("file").is_empty()
    });
    for (at, node) in recorders {
        if let Some((to, from)) = tape(at, node, schedule.tick_hz) {
            tapes_out.push(to);
            tapes_in.push(Tape { sink: node.id.clone(), graph: swap, reader: from });
        }
    }
    let channels = channels(graph, &schedule, Role::AudioOutput, before.map(|b| &b.channels));
    let recorded = self::channels(graph, &schedule, Role::AudioInput, before.map(|b| &b.recorded));
    let outs = places(&schedule, &channels);
    let meters = NodeMeters::new(&schedule, before.map(|b| (&*b.schedule, &*b.meters)));
    let meters = Arc::new(meters);
    let wiring = Wiring {
        swap,
        limiters: outs.iter().map(|&out| limiter_of(&schedule, out)).collect(),
        outs,
        hands,
        mics: places(&schedule, &recorded).into_iter().enumerate().map(|(channel, i)| (i, channel)).collect(),
        forces: force_sinks,
        scopes: scopes_out,
        tapes: tapes_out,
        stylus: Stylus::of(&schedule),
        meters: meters.clone(),
        spent: vec![0; schedule.nodes.len()],
    };
    let layout = layout(swap, graph, &schedule, materials);
    (
        Sent {
            swap,
            schedule,
            meters,
            sources,
            forces,
            scopes: scopes_in,
            layout,
            tapes: tapes_in,
            channels,
            recorded,
            records_hands,
        },
        Box::new(wiring),
    )
}

/// Nodes of a role by channel of the device: in the file's order at first; later each keeps its channel.
fn channels(graph: &GraphFile, schedule: &Schedule, role: Role, was: Option<&Vec<String>>) -> Vec<String> {
    let there = |id: &str| schedule.with_role(role).any(|(_, n)| n.id == id);
    let declared = graph.nodes.iter().map(|n| n.id.as_str());
    let ids: Vec<String> = declared.filter(|id| there(id)).map(str::to_owned).collect();
    was.map_or(ids.clone(), |was| kept_in_place(was, &ids))
}

fn places(schedule: &Schedule, ids: &[String]) -> Vec<usize> {
    ids.iter().map(|id| schedule.index_of(id).unwrap_or(usize::MAX)).collect()
}

/// Nodes by channel after a swap: a node that stays keeps its channel, a new one takes that of a node that
/// is gone.
fn kept_in_place(was: &[String], are: &[String]) -> Vec<String> {
    let mut new = are.iter().filter(|id| !was.contains(id));
    let keep = |id: &String| if are.contains(id) { Some(id.clone()) } else { new.next().cloned() };
    was.iter().filter_map(keep).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_moved_in_the_file_keep_their_channels() {
        let ids = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(kept_in_place(&ids("left right"), &ids("right left")), ids("left right"));
        assert_eq!(kept_in_place(&ids("left right"), &ids("right other")), ids("other right"));
        assert_eq!(kept_in_place(&ids("out"), &ids("renamed")), ids("renamed"));
    }
}
