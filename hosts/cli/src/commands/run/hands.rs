//! Devices that feed nodes of a graph and push back: opened, held, exchanged and closed.

use std::collections::HashMap;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed, Ordering::SeqCst};
use std::time::Duration;

use asperity_diagnostics::Diagnostic;
use asperity_graph::{Schedule, ScheduledNode};
use asperity_hand::{HandDevice, Handle, Open, device_of};
use asperity_live::view::Layout;
use asperity_live::{DeviceQueues, ForceReader, SampleWriter, force_model, samples};
use asperity_node::{Law, Role};
use asperity_scene::bound::{Passivity, Sampling, below, stiffest_n_per_mm};

use crate::failure::Failure;

/// Open devices and sockets, by the ids of their input nodes.
#[derive(Debug, Default)]
pub struct Hands {
    open: HashMap<String, Held>,
    /// Takes the pointer positions of the live page; `None` once the page has it.
    pointer: Option<SampleWriter>,
    warned: Vec<String>,
}

#[derive(Debug)]
pub struct Held {
    pub node: ScheduledNode,
    handle: Handle,
}

/// An open device or socket, as those who open others need to know it.
#[derive(Clone, Debug)]
pub struct Holding {
    node: ScheduledNode,
    address: Option<SocketAddr>,
}

impl Hands {
    /// Opens all devices of a graph. Returns them with the queues of its nodes.
    pub fn of(schedule: &Schedule) -> Result<(Self, DeviceQueues), Failure> {
        let outside = [Role::Hand, Role::Force].into_iter().flat_map(|role| schedule.with_role(role));
        let ids: Vec<String> = outside.map(|(_, node)| node.id.clone()).collect();
        let mut opened = open(schedule, &ids, &[], &AtomicBool::new(false))?;
        let queues = std::mem::take(&mut opened.queues);
        let mut it = Self::default();
        it.go_on_with(opened, schedule);
        Ok((it, queues))
    }

    pub fn holding(&self) -> Vec<Holding> {
        let of = |held: &Held| Holding { node: held.node.clone(), address: held.handle.address() };
        self.open.values().map(of).collect()
    }

    /// Hands out the devices of these nodes, so that others can open them.
    pub fn let_go(&mut self, ids: &[String]) -> Vec<Held> {
        ids.iter().filter_map(|id| self.open.remove(id)).collect()
    }

    /// Holds devices that were opened for a new graph. Closes those that it does not need, without waiting.
    pub fn go_on_with(&mut self, opened: Opened, schedule: &Schedule) {
        let goes = |id: &String, held: &mut Held| {
            schedule.index_of(id).is_none_or(|i| schedule.nodes[i].kind != held.node.kind)
        };
        let mut over: Vec<Held> = self.open.extract_if(goes).map(|(_, held)| held).collect();
        for held in opened.held {
            over.extend(self.open.insert(held.node.id.clone(), held));
        }
        if opened.pointer.is_some() {
            self.pointer = opened.pointer;
        }
        if !over.is_empty() {
            close_elsewhere(move || drop(over));
        }
    }

    /// The pointer's writer for the live page, once after each opening.
    pub fn take_pointer(&mut self) -> Option<SampleWriter> {
        self.pointer.take()
    }

    /// Problems that began or ended since the last call.
    pub fn problems(&self) -> Vec<String> {
        let of = |(id, held): (&String, &Held)| {
            let all = std::iter::from_fn(|| held.handle.problem());
            all.map(|p| format!("`{id}`: {p}")).collect::<Vec<_>>()
        };
        self.open.iter().flat_map(of).collect()
    }

    /// New warnings about walls that are stiffer than their device can render passively.
    pub fn warnings(&mut self, schedule: &Schedule, live: &Layout) -> Vec<String> {
        let walls = schedule.with_role(Role::Force);
        let now: Vec<String> = walls.filter_map(|(_, node)| warning(schedule, live, node, self)).collect();
        let news = now.iter().filter(|w| !self.warned.contains(w)).cloned().collect();
        self.warned = now;
        news
    }
}

/// Nodes that the live page feeds.
pub fn pointers(schedule: &Schedule) -> impl Iterator<Item = &ScheduledNode> {
    schedule.with_role(Role::Hand).map(|(_, node)| node).filter(|node| device_of(&node.kind).is_none())
}

/// Invitations of devices to their users, each with its node.
pub fn invitations(schedule: &Schedule) -> impl Iterator<Item = String> {
    schedule.with_role(Role::Hand).filter_map(|(_, node)| {
        let invitation = device_of(&node.kind)?.invitation(&node.params)?;
        Some(format!("`{}` {invitation}", node.id))
    })
}

/// The input node of the device that a force node pushes back with.
fn input_of<'s>(schedule: &'s Schedule, force: &ScheduledNode) -> Result<&'s ScheduledNode, Failure> {
    let kind = device_of(&force.kind).map_or("", HandDevice::input);
    let same = |n: &&ScheduledNode| n.kind == kind && n.params.text("device") == force.params.text("device");
    schedule.nodes.iter().find(same).ok_or_else(|| {
        let message =
            format!("`{}` ({}) renders force on a device that no {kind} reads", force.id, force.kind);
        let help = format!("add a {kind} with the same `device`: a wall needs the stylus's position");
        at(force, Diagnostic::new(message).help(help)).into()
    })
}

/// Largest force \[N\] of the force node that pushes back with an input node's device; without one, no limit.
fn max_force_n(schedule: &Schedule, input: &ScheduledNode) -> f64 {
    let with = |force: &ScheduledNode| input_of(schedule, force).is_ok_and(|node| node.id == input.id);
    let mut forces = schedule.with_role(Role::Force).map(|(_, force)| force);
    forces.find(|force| with(force)).map_or(f64::INFINITY, |force| force.params.number("max_force_n"))
}

fn at(node: &ScheduledNode, d: Diagnostic) -> Diagnostic {
    match node.params.node_place() {
        Some(place) => d.at(&place.source, place.span),
        None => d,
    }
}

fn refused(node: &ScheduledNode, error: Diagnostic) -> Failure {
    let message = format!("`{}` ({}): {}", node.id, node.kind, error.message);
    at(node, Diagnostic { message, ..error }).into()
}

/// Devices that were opened for a graph that does not play yet.
#[derive(Default)]
pub struct Opened {
    pub queues: DeviceQueues,
    /// Nodes whose devices must be closed before the rest can be opened.
    pub in_the_way: Vec<String>,
    held: Vec<Held>,
    pointer: Option<SampleWriter>,
    later: Vec<Source>,
}

/// Opens the devices of these nodes of a graph, until `over` is set, and closes none: a device that excludes
/// an open one is left for [`open_the_rest`](Opened::open_the_rest).
pub fn open(
    schedule: &Schedule,
    ids: &[String],
    held: &[Holding],
    over: &AtomicBool,
) -> Result<Opened, Failure> {
    let (mut opened, sources) = plan(schedule, ids)?;
    let anew = |node: &ScheduledNode| sources.iter().any(|s| s.node.id == node.id);
    let stays = |held: &Holding| {
        let there = schedule.index_of(&held.node.id).map(|i| &schedule.nodes[i]);
        there.is_some_and(|n| n.kind == held.node.kind && !anew(n))
    };
    let going: Vec<&Holding> = held.iter().filter(|h| !stays(h)).collect();
    for source in sources {
        if over.load(Relaxed) {
            break;
        }
        // The same device or port must be closed first.
        let excludes = |held: &&&Holding| {
            let (node, before) = (&source.node, &held.node);
            let same = || source.device.excludes(&node.params, &before.params, held.address);
            node.kind == before.kind && same()
        };
        let before: Vec<String> = going.iter().filter(excludes).map(|held| held.node.id.clone()).collect();
        if before.is_empty() {
            opened.held.push(source.start()?);
        } else {
            opened.in_the_way.extend(before);
            opened.later.push(source);
        }
    }
    Ok(opened)
}

/// The queues that these nodes of a graph get, and the devices behind them.
fn plan(schedule: &Schedule, ids: &[String]) -> Result<(Opened, Vec<Source>), Failure> {
    let (mut opened, mut sources) = (Opened::default(), Vec::new());
    let mut wanted = ids.to_vec();
    let mut models: HashMap<String, ForceReader> = HashMap::new();
    for (_, node) in schedule.with_role(Role::Force) {
        // One device reads and pushes the stylus: both queues are made new.
        let input = input_of(schedule, node)?;
        if ids.contains(&node.id) || ids.contains(&input.id) {
            let (writer, reader) = force_model();
            opened.queues.forces.insert(node.id.clone(), writer);
            models.insert(input.id.clone(), reader);
            wanted.push(input.id.clone());
        }
    }
    for (_, node) in schedule.with_role(Role::Hand).filter(|(_, n)| wanted.contains(&n.id)) {
        let (writer, reader) = samples();
        opened.queues.hands.insert(node.id.clone(), reader);
        let Some(device) = device_of(&node.kind) else {
            opened.pointer = Some(writer);
            continue;
        };
        // Wrong parameters are found before any device is closed.
        let open = device.configure(&node.params, max_force_n(schedule, node));
        let open = open.map_err(|e| refused(node, e))?;
        sources.push(Source { node: node.clone(), device, open, writer, model: models.remove(&node.id) });
    }
    Ok((opened, sources))
}

impl Opened {
    /// Closes `old` and opens the devices that waited for that, until `over` is set.
    pub fn open_the_rest(&mut self, old: Vec<Held>, over: &AtomicBool) -> Result<(), Failure> {
        drop(old);
        self.in_the_way.clear();
        for source in std::mem::take(&mut self.later) {
            if over.load(Relaxed) {
                break;
            }
            self.held.push(source.start()?);
        }
        Ok(())
    }
}

/// Input nodes of a graph whose devices are not open: they could not be opened again.
pub fn missing(schedule: &Schedule, held: &[Holding]) -> Vec<String> {
    let device = |n: &&ScheduledNode| device_of(&n.kind).is_some();
    let nobody = |n: &&ScheduledNode| !held.iter().any(|h| h.node.id == n.id);
    let hands = schedule.with_role(Role::Hand).map(|(_, n)| n);
    hands.filter(device).filter(nobody).map(|n| n.id.clone()).collect()
}

struct Source {
    node: ScheduledNode,
    device: &'static dyn HandDevice,
    open: Open,
    writer: SampleWriter,
    model: Option<ForceReader>,
}

impl Source {
    fn start(self) -> Result<Held, Failure> {
        let handle = (self.open)(self.writer, self.model).map_err(|e| refused(&self.node, e))?;
        Ok(Held { handle, node: self.node })
    }
}

/// Assumed damping of an unknown device \[N s/m\]: a guess on the safe side for one built without friction.
/// We found no reliable figure for a Touch or an Inverse3.
const ASSUMED_NS_PER_M: f64 = 0.1;

/// A warning where a wall breaks Colgate's bound.
fn warning(schedule: &Schedule, live: &Layout, node: &ScheduledNode, hands: &Hands) -> Option<String> {
    let [tick_hz, delay_s] = device_of(&node.kind)?.servo();
    let input = input_of(schedule, node).ok()?;
    // The figures are known where they come from a node that has them as parameters. A user may have moved
    // these since.
    let number = |input: &str, param: &str| {
        let port = node.inputs.iter().find(|i| i.name == input)?;
        let from = &schedule.nodes[port.from?.0];
        let moved = live.nodes.iter().find(|n| n.id == from.id)?.live.iter().find(|l| l.name == param);
        Some((from.id.as_str(), moved.map(|l| l.value).or(from.params.get_number(param))?))
    };
    let (floor, stiffness_n_per_mm) = number("stiffness", "stiffness_n_per_mm")?;
    let damping_ns_per_m = number("damping", "damping_ns_per_m").map_or(0.0, |(_, value)| value);
    let own = node.params.number("device_damping_ns_per_m");
    let recommended = hands.open.get(&input.id).and_then(|h| h.handle.max_stiffness_n_per_mm());
    let (device, known) = match recommended {
        _ if own > 0.0 => (own, String::new()),
        Some(most) => {
            let from = format!("; its damping follows from the {most:.3} N/mm that its maker recommends");
            (of_recommended(most), from)
        }
        None => {
            let set = format!("--set {}.device_damping_ns_per_m=", node.id);
            (ASSUMED_NS_PER_M, format!("; its damping is assumed; if you know it: {set}"))
        }
    };
    let law = Law { stiffness_n_per_mm, damping_ns_per_m };
    let sampling = Sampling { tick_hz, delay_s };
    let bound = Passivity::of(law, sampling, device);
    let advice = || match damping_ns_per_m.abs() < device {
        true => format!("{floor}.stiffness_n_per_mm={}", below(bound.stiffest_n_per_mm)),
        false => {
            // Half of what the device bears goes to the damping.
            let softest = below(stiffest_n_per_mm(0.5 * device, sampling, device));
            let damper = number("damping", "damping_ns_per_m").map_or(floor, |(id, _)| id);
            format!(
                "{damper}.damping_ns_per_m={} --set {floor}.stiffness_n_per_mm={softest}",
                below(0.5 * device)
            )
        }
    };
    (!bound.holds())
        .then(|| format!("`{}`: walls of {bound}; passive with --set {}{known}", node.id, advice()))
}

/// Least damping \[N s/m\] of a passive device whose maker recommends walls of at most so many N/mm at 1 kHz:
/// K T / 2, and a little more, since that stiffness itself counts as passive.
fn of_recommended(n_per_mm: f64) -> f64 {
    0.5 * n_per_mm + 1e-9
}

/// Closings under way. A device takes a while to close: it ramps its force down first. Only the opening of
/// other devices and the end of the run wait for it.
static UNDER_WAY: AtomicUsize = AtomicUsize::new(0);

struct Closing;

impl Drop for Closing {
    fn drop(&mut self) {
        UNDER_WAY.fetch_sub(1, SeqCst);
    }
}

/// Closes something on a thread of its own.
pub fn close_elsewhere(close: impl FnOnce() + Send + 'static) {
    UNDER_WAY.fetch_add(1, SeqCst);
    let closing = Closing;
    // If no thread starts, `close` is dropped here, with what it would close.
    let _ = std::thread::Builder::new().name("asperity-close".into()).spawn(move || {
        close();
        drop(closing);
    });
}

/// Waits until nothing is being closed, or `over`. Answers whether it is not over.
pub fn wait(over: impl Fn() -> bool) -> bool {
    while UNDER_WAY.load(SeqCst) > 0 && !over() {
        std::thread::sleep(Duration::from_millis(2));
    }
    !over()
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, mpsc};

    use super::*;

    #[test]
    fn recommended_stiffness_is_passive_and_no_stiffer_one() {
        for most in [0.3, 0.5, 0.8, 2.31] {
            let of = |stiffness_n_per_mm, damping_ns_per_m| {
                let law = Law { stiffness_n_per_mm, damping_ns_per_m };
                let sampling = Sampling { tick_hz: 1000.0, delay_s: 0.0 };
                Passivity::of(law, sampling, of_recommended(most)).holds()
            };
            assert!(of(most, 0.0) && !of(1.01 * most, 0.0) && !of(most, 0.01), "{most}");
        }
    }

    #[test]
    fn opening_waits_for_closings_unless_over() {
        let (go, told) = mpsc::channel::<()>();
        let closed = Arc::new(AtomicBool::new(false));
        let done = closed.clone();
        close_elsewhere(move || {
            let _ = told.recv();
            std::thread::sleep(Duration::from_millis(20));
            done.store(true, Relaxed);
        });
        assert!(!wait(|| true));
        assert!(!closed.load(Relaxed));
        go.send(()).expect("it waits");
        assert!(wait(|| false) && closed.load(Relaxed));
    }
}
