//! The devices that nodes of a graph are fed by, and push back with.

use std::collections::HashMap;
use std::path::PathBuf;

use asperity_graph::{Schedule, ScheduledNode};
use asperity_hand::servo::passivity::{DeviceDamping, passivity};
use asperity_hand::{Frame, HandError, Handle, haply, openhaptics, osc, servo_hz};
use asperity_live::view::Layout;
use asperity_live::{Ends, ForceReader, SampleWriter, force_model, samples};
use asperity_source::Diagnostic;

use crate::failure::Failure;

/// Devices and sockets that are open, by the ids of their input nodes.
#[derive(Debug, Default)]
pub struct Hands {
    open: HashMap<String, Handle>,
    /// What the live page's pointers are sent into; taken by the page.
    pointer: Option<SampleWriter>,
    /// Walls that were warned of.
    warned: Vec<String>,
}

impl Hands {
    /// Opens what these nodes of a graph need, beside what is open. A device or a port that is held already is left for
    /// [`go_on_with`](Self::go_on_with): nothing that is open is closed before the graph is taken over.
    pub fn open(&self, schedule: &Schedule, ids: &[String]) -> Result<Opened, Failure> {
        let mut opened = Opened::default();
        let mut wanted = ids.to_vec();
        let mut models: HashMap<String, ForceReader> = HashMap::new();
        for node in schedule.nodes.iter().filter(|n| n.kind.ends_with("_force")) {
            // Who reads the stylus is who pushes it: both begin anew.
            let input = input_of(schedule, node)?;
            if ids.contains(&node.id) || ids.contains(&input.id) {
                let (writer, reader) = force_model();
                opened.ends.forces.insert(node.id.clone(), writer);
                models.insert(input.id.clone(), reader);
                wanted.push(input.id.clone());
            }
        }
        let nodes = schedule.nodes.iter().filter(|n| n.kind.ends_with("_input") && wanted.contains(&n.id));
        for node in nodes {
            let (writer, reader) = samples();
            opened.ends.hands.insert(node.id.clone(), reader);
            if node.kind == "pointer_input" {
                opened.pointer = Some(writer);
                continue;
            }
            let most = force_of(schedule, node).map_or(f64::INFINITY, |f| f.params.number("max_force_n"));
            let source = Source { node: node.clone(), most, writer, model: models.remove(&node.id) };
            if self.open.get(&node.id).is_some_and(|held| source.excludes(held)) {
                opened.later.push(source);
            } else {
                let handle = source.start().map_err(|e| refused(node, &e))?;
                opened.handles.push((node.id.clone(), handle));
            }
        }
        Ok(opened)
    }

    /// Goes on with what was opened for a graph that is being taken over: closes what it no longer needs, and opens what had to wait
    /// for that.
    pub fn go_on_with(&mut self, opened: Opened, schedule: &Schedule) -> Result<(), Failure> {
        self.open.retain(|id, _| schedule.index_of(id).is_some());
        self.open.extend(opened.handles);
        if opened.pointer.is_some() {
            self.pointer = opened.pointer;
        }
        for source in opened.later {
            let node = source.node.clone();
            drop(self.open.remove(&node.id));
            let handle = source.start().map_err(|e| refused(&node, &e))?;
            self.open.insert(node.id, handle);
        }
        Ok(())
    }

    /// Where the live page's pointers are to be sent, once after it was opened.
    pub fn take_pointer(&mut self) -> Option<SampleWriter> {
        self.pointer.take()
    }

    /// What went wrong, or is right again, since it was last asked.
    pub fn problems(&self) -> Vec<String> {
        let of = |(id, handle): (&String, &Handle)| {
            let all = std::iter::from_fn(|| handle.problem());
            all.map(|p| format!("`{id}`: {p}")).collect::<Vec<_>>()
        };
        self.open.iter().flat_map(of).collect()
    }

    /// Walls that their device may not render without trembling, with the figures: those that were not warned of before.
    pub fn warnings(&mut self, schedule: &Schedule, live: &Layout) -> Vec<String> {
        let walls = schedule.nodes.iter().filter(|n| n.kind.ends_with("_force"));
        let now: Vec<String> = walls.filter_map(|node| warning(schedule, live, node, self)).collect();
        let news = now.iter().filter(|w| !self.warned.contains(w)).cloned().collect();
        self.warned = now;
        news
    }
}

/// The input node of the device that a force node pushes back with.
fn input_of<'s>(schedule: &'s Schedule, force: &ScheduledNode) -> Result<&'s ScheduledNode, Failure> {
    let kind = force.kind.replace("_force", "_input");
    let same = |n: &&ScheduledNode| n.kind == kind && n.params.text("device") == force.params.text("device");
    schedule.nodes.iter().find(same).ok_or_else(|| {
        let message =
            format!("`{}` ({}) pushes back with a device that no {kind} reads", force.id, force.kind);
        let help = format!(
            "add a {kind} with the same `device`: who renders a wall has to know where the stylus is"
        );
        at(force, Diagnostic::new(message).help(help)).into()
    })
}

/// The force node that pushes back with an input node's device.
fn force_of<'s>(schedule: &'s Schedule, input: &ScheduledNode) -> Option<&'s ScheduledNode> {
    let kind = input.kind.replace("_input", "_force");
    schedule.nodes.iter().find(|n| n.kind == kind && n.params.text("device") == input.params.text("device"))
}

/// An error at the place of a node in its file.
fn at(node: &ScheduledNode, d: Diagnostic) -> Diagnostic {
    match node.params.node_place() {
        Some(place) => d.at(&place.source, place.span),
        None => d,
    }
}

fn refused(node: &ScheduledNode, error: &HandError) -> Failure {
    let message = format!("`{}` ({}): {}", node.id, node.kind, error.message);
    at(node, Diagnostic::new(message).help(error.help.clone())).into()
}

/// What was opened for a graph, and is not yet gone on with.
#[derive(Default)]
pub struct Opened {
    /// The ends of nodes.
    pub ends: Ends,
    handles: Vec<(String, Handle)>,
    pointer: Option<SampleWriter>,
    /// Sources whose device or port is held by the one before.
    later: Vec<Source>,
}

/// A source that is to be started.
struct Source {
    node: ScheduledNode,
    /// Largest force \[N\].
    most: f64,
    writer: SampleWriter,
    model: Option<ForceReader>,
}

impl Source {
    /// Whether the one that this node has now has to be closed first: it holds the device or the port.
    fn excludes(&self, held: &Handle) -> bool {
        let listens = || osc::parse_listen(self.node.params.text("listen")).ok();
        self.node.kind != "osc_input" || (held.address().is_some() && held.address() == listens())
    }

    fn start(self) -> Result<Handle, HandError> {
        let p = &self.node.params;
        let text = |name: &str| Some(p.text(name).trim().to_owned()).filter(|t| !t.is_empty());
        match self.node.kind.as_str() {
            "osc_input" => {
                let mut options =
                    osc::OscOptions::new(p.text("address"), osc::parse_arguments(p.text("arguments"))?);
                options.listen = osc::parse_listen(p.text("listen"))?;
                options.anywhere = p.flag("anywhere");
                osc::start(options, self.writer)
            }
            "openhaptics_input" => {
                let mut options = openhaptics::OpenHapticsOptions::new();
                options.device = text("device");
                options.library = text("library").map(PathBuf::from);
                options.frame = Frame::new(p.text("axes"), [0.0; 3])?;
                options.max_force_n = self.most;
                openhaptics::start(options, self.writer, self.model)
            }
            _ => {
                let mut options = haply::HaplyOptions::new();
                options.device = text("device");
                options.service = p.text("service").to_owned();
                options.frame = Frame::new(p.text("axes"), [0.0; 3])?;
                options.max_force_n = self.most;
                haply::start(options, self.writer, self.model)
            }
        }
    }
}

/// Colgate's bound for one wall, where it does not hold.
fn warning(schedule: &Schedule, live: &Layout, node: &ScheduledNode, hands: &Hands) -> Option<String> {
    let input = input_of(schedule, node).ok()?;
    let handle = hands.open.get(&input.id);
    // The plane's figures are known beforehand where they come from a node that has them as parameters, which a person may have
    // moved since.
    let number = |input: &str, param: &str| {
        let port = node.inputs.iter().find(|i| i.name == input)?;
        let from = &schedule.nodes[port.from?.0];
        let moved = live.nodes.iter().find(|n| n.id == from.id)?.live.iter().find(|l| l.name == param);
        moved.map(|l| l.value).or(from.params.get_number(param))
    };
    let stiffness = number("stiffness", "stiffness_n_per_mm")?;
    let damping = number("damping", "damping_ns_per_m").unwrap_or(0.0);
    let own = node.params.number("device_damping_ns_per_m");
    let recommended = handle.and_then(|h| h.device().max_stiffness_n_per_mm);
    let device = match recommended {
        _ if own > 0.0 => DeviceDamping::Known(own),
        Some(stiffness) => DeviceDamping::Recommended(stiffness),
        None => DeviceDamping::Unknown,
    };
    let bound = passivity(stiffness, damping, servo_hz(&node.kind), device);
    let known = match device {
        DeviceDamping::Unknown => {
            format!("; if you know its damping: --set {}.device_damping_ns_per_m=", node.id)
        }
        _ => String::new(),
    };
    (!bound.holds()).then(|| format!("`{}`: {}{known}", node.id, bound.sentence))
}
