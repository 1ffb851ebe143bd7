//! From a stimulus to a graph that plays it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use asperity_audio::Cause;
use asperity_diagnostics::ron::{Key, Kind, Value};
use asperity_diagnostics::{Diagnostic, Place, fnv};
use asperity_graph::{GraphFile, NodeDecl, Schedule};
use asperity_hand::device_of;
use asperity_live::SessionError;
use asperity_node::{Registry, Role, random};
use asperity_study::{Experiment, Masking, StimulusKind, Varied, log};

use crate::card::{self, DeviceArgs};
use crate::failure::{Failure, wrong};
use crate::kinds::Kinds;
use crate::load::files::files_read;
use crate::load::{self, GraphArgs, Loaded, PluginArgs};

/// Name that the hand has in every stimulus, so that it goes on when one replaces another.
pub const HAND: &str = "hand of the study";
/// Name of the node that pushes back, in every stimulus: its device goes on, too.
const PUSH: &str = "push of the study";
/// A floor without stiffness.
const NO_PUSH: &str = "no push of the study";
/// Gain before the actuator's own nodes: silence and level matching.
pub const GAIN: &str = "gain of the study";
/// The probe that records the position of the stylus.
pub const POSITION: &str = "position of the study";
/// Origin of added nodes, in errors.
const ORIGIN: &str = "asperity study";
/// The shipped graph that plays a clip by its node `clip`.
const CLIP: &str = "graphs/clip.ron";
/// Prefix of the outputs that play masking noise; their channel follows.
pub const MASK: &str = "masking output ";

/// Where a stimulus is felt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct At {
    /// Number of the trial.
    pub trial: usize,
    /// Times that the trial was shown before.
    pub attempt: u32,
    /// Place in the trial's order.
    pub place: usize,
}

/// Adds which stimulus it is about.
pub fn named(failure: Failure, experiment: &Experiment, stimulus: usize) -> Failure {
    let Failure::Input(all) = failure else { return failure };
    let stimulus = &experiment.stimuli[stimulus];
    let told = |d: Diagnostic| {
        let span = stimulus.place.span;
        d.related(&stimulus.place.source, span, format!("for the stimulus `{}`", stimulus.name))
    };
    Failure::Input(all.into_iter().map(told).collect())
}

/// Loads the stimuli of a study, all of them for one hand and one sound card.
pub struct Loader {
    /// Hand or recorded stroke that moves the stylus, and plugins.
    args: GraphArgs,
    masking: Option<Masking>,
    /// The node that pushes back with the hand's device.
    push: Option<NodeDecl>,
    pub kinds: Kinds,
}

impl Loader {
    /// Without masking noise and push, as a stimulus alone is. A recorded stroke may move the stylus.
    pub fn alone(plugins: &PluginArgs, input: Option<PathBuf>) -> Self {
        let args = GraphArgs { input, plugins: plugins.clone(), ..GraphArgs::default() };
        Self { args, masking: None, push: None, kinds: Kinds::new(&plugins.plugin) }
    }

    /// As in a session with these options. `looks`: nothing is to be played. Returns also the names of
    /// stimuli that push back with another device than the hand's: their forces are left out.
    pub fn session(
        experiment: &Experiment,
        options: &log::Options,
        looks: bool,
    ) -> Result<(Self, BTreeSet<String>), Failure> {
        let plugins = PluginArgs { plugin: options.plugins.clone() };
        let mut it = Self::alone(&plugins, options.input.clone());
        // The pad of a page is the same kind of node as on the live page.
        it.args.hand = options.hand.as_ref().map(|hand| match hand.strip_prefix("page") {
            Some(rest) if rest.is_empty() || rest.starts_with(':') => format!("pointer{rest}"),
            _ => hand.clone(),
        });
        it.args.repeat = options.repeat;
        it.masking.clone_from(&experiment.masking);
        it.kinds = if looks { it.kinds.looking() } else { it.kinds.apart(true) };
        let others = it.find_push(experiment)?;
        Ok((it, others))
    }

    /// Finds the node that pushes back with the device which moves the stylus, in the first stimulus that has
    /// one. Returns the names of stimuli that push back with another device.
    fn find_push(&mut self, experiment: &Experiment) -> Result<BTreeSet<String>, Failure> {
        let (mut others, mut done) = (BTreeSet::new(), BTreeSet::new());
        for (stimulus, kind) in shown(experiment) {
            let Ok((graph, ..)) = graph_of(&kind) else { continue };
            if !done.insert(graph.clone()) {
                continue;
            }
            let read = load::read(&GraphArgs { graph, ..self.args.clone() }, &mut self.kinds);
            let (graph, _) = read.map_err(|failure| named(failure, experiment, stimulus))?;
            let registry = self.kinds.registry(Some(&graph))?;
            let forces = |node: &&NodeDecl| registry.role(&node.kind) == Some(Role::Force);
            match graph.nodes.iter().find(|node| forces(node) && moves(&graph, node)) {
                Some(node) if self.push.is_none() => {
                    self.push = Some(NodeDecl { id: PUSH.into(), ..node.clone() });
                }
                None if graph.nodes.iter().any(|node| forces(&node)) => {
                    others.insert(experiment.stimuli[stimulus].name.clone());
                }
                _ => (),
            }
        }
        Ok(others)
    }

    /// Loads a graph, a scene or a clip with a stimulus's settings. `vary`: the varied parameter with its
    /// level. A gain of 0 is silence, also of forces, and not of the masking noise. At each place of each
    /// showing it begins anew, with noise of its own.
    pub fn load(
        &mut self,
        kind: &StimulusKind,
        vary: Option<&Varied>,
        gain: f64,
        at: Option<At>,
    ) -> Result<Loaded, Failure> {
        let (path, file, set) = graph_of(kind)?;
        let args = GraphArgs { graph: path, ..self.args.clone() };
        let (mut graph, scene) = load::read(&args, &mut self.kinds)?;
        for (key, value) in &set {
            let place = Place { source: value.source().clone(), span: key.span };
            graph.set_value(&key.name, value.clone(), place, None)?;
        }
        if let Some(Varied { set, level, place }) = vary {
            graph.set_value(set, Value::made(Kind::Float(*level), place), place.clone(), None)?;
        }
        let registry = self.kinds.registry(Some(&graph))?;
        let records = |node: &&NodeDecl| registry.role(&node.kind) == Some(Role::AudioInput);
        if let Some(node) = graph.nodes.iter().find(records) {
            let what = format!("a stimulus cannot record, as `{}` ({}) does", node.id, node.kind);
            return Err(file.error(what).into());
        }
        name_hand(&mut graph, &registry, file)?;
        push_back(&mut graph, &registry, gain > 0.0, self.push.as_ref())?;
        let kept = scale(&mut graph, &registry, gain)?;
        let vary = vary.map(|varied| (&varied.set, varied.level));
        let tag = fnv(format!("{} {vary:?} {gain} {at:?}", described(kind)).as_bytes());
        set_apart(&mut graph, &kept, tag, at);
        self.masking.as_ref().map_or(Ok(()), |masking| mask(&mut graph, &registry, masking))?;
        load::compile(&args, &mut self.kinds, graph, scene)
    }

    /// Silence, through the outputs of the first stimulus that plays.
    pub fn quiet(&mut self, experiment: &Experiment) -> Result<Loaded, Failure> {
        let nothing = || {
            let what = "no stimulus is a graph or a clip: there is nothing to play";
            Diagnostic::new(what).in_file(experiment.source.path())
        };
        let first = shown(experiment).find(|(_, kind)| file_of(kind).is_some());
        self.load(&first.ok_or_else(nothing)?.1, None, 0.0, None)
    }

    /// Files that a loaded stimulus is made of.
    pub fn files(&self, kind: &StimulusKind, schedule: &Schedule) -> Result<Vec<PathBuf>, Failure> {
        let args = GraphArgs { graph: graph_of(kind)?.0, ..self.args.clone() };
        Ok(files_read(&args, schedule, self.kinds.files()).into_iter().map(|(path, _)| path).collect())
    }
}

/// Path of the graph or scene of a stimulus, its file, and its settings.
fn graph_of(kind: &StimulusKind) -> Result<(PathBuf, &Value, Vec<(Key, Value)>), Failure> {
    match kind {
        StimulusKind::Graph { file, set } => Ok((found(file)?, file, set.clone())),
        StimulusKind::Clip { file, set } => {
            let no_graph = || Failure::Machine(format!("{CLIP} is missing"));
            let key = Key { name: "clip.file".into(), span: file.span() };
            let path = crate::shipped::file(Path::new(CLIP)).ok_or_else(no_graph)?;
            Ok((path, file, [&[(key, file.clone())], &set[..]].concat()))
        }
        _ => Err(Failure::Machine("this stimulus plays nothing".into())),
    }
}

/// Path of a stimulus's file: beside the experiment, or a shipped one.
pub fn found(file: &Value) -> Result<PathBuf, Failure> {
    let named = std::path::Path::new(file.text()?);
    match crate::shipped::file(named).filter(|_| !named.exists()) {
        Some(shipped) => Ok(shipped),
        None => Ok(file.path()?),
    }
}

/// File of a stimulus; `None` where nothing plays.
pub fn file_of(kind: &StimulusKind) -> Option<&Value> {
    match kind {
        StimulusKind::Graph { file, .. } | StimulusKind::Clip { file, .. } => Some(file),
        _ => None,
    }
}

/// All stimuli of all trials, as indices and with their levels filled in.
pub fn shown(experiment: &Experiment) -> impl Iterator<Item = (usize, StimulusKind)> {
    let trials = (0..experiment.parts.len()).flat_map(|part| experiment.trials_of(part, 1));
    trials.flat_map(|trial| {
        let all = trial.places.iter().copied().chain(experiment.parts[trial.part].reference);
        all.map(|stimulus| (stimulus, experiment.shown(&trial, stimulus))).collect::<Vec<_>>()
    })
}

/// A stimulus in words, without its place.
pub fn described(kind: &StimulusKind) -> String {
    let set = |set: &[(Key, Value)]| {
        let all: Vec<String> = set.iter().map(|(key, v)| format!("{}={:?}", key.name, v.kind())).collect();
        all.join(" ")
    };
    match kind {
        StimulusKind::Graph { file, set: all } => format!("graph {:?} {}", file.kind(), set(all)),
        StimulusKind::Clip { file, set: all } => format!("clip {:?} {}", file.kind(), set(all)),
        StimulusKind::Real { mount } => format!("real {:?}", mount.kind()),
        StimulusKind::Silence => "silence".into(),
    }
}

/// The device with the channels of the masking noise behind those of the stimuli.
pub fn device(
    args: &DeviceArgs,
    schedule: &Schedule,
    masking: Option<&Masking>,
) -> Result<DeviceArgs, Failure> {
    let Some(masking) = masking else { return Ok(args.clone()) };
    let outs = schedule.with_role(Role::AudioOutput).filter(|(_, node)| !node.id.starts_with(MASK)).count();
    let mut channel = args.channel.clone();
    if channel.is_empty() {
        channel.extend((1..=u16::MAX).take(outs));
    }
    if channel.len() != outs {
        let what = format!("{} channels are named, and a stimulus has {outs} audio_out", channel.len());
        return Err(wrong("--channel", what, "the study file names the channels of the masking noise"));
    }
    if let Some(both) = masking.channels.iter().find(|both| channel.contains(both)) {
        let what = format!("channel {both} plays the stimuli: it cannot play masking noise");
        let help = "name another one here, or move the stimuli: --channel";
        return Err(Diagnostic::new(what).at_place(&masking.place).help(help).into());
    }
    channel.extend(&masking.channels);
    Ok(DeviceArgs { channel, ..args.clone() })
}

/// The error for a device that cannot be opened. It may lack a channel for the masking noise.
pub fn not_opened(error: SessionError, masking: Option<&Masking>) -> Failure {
    if let (SessionError::Device(device), Some(masking)) = (&error, masking)
        && let Cause::Channel(there) = device.cause
        && masking.channels.iter().any(|channel| *channel > there)
    {
        let help = format!("1 to {there}");
        return Diagnostic::new(device.to_string()).at_place(&masking.place).help(help).into();
    }
    card::not_opened(error, true)
}

/// Whether the device of a force node also moves the stylus.
fn moves(graph: &GraphFile, force: &NodeDecl) -> bool {
    device_of(&force.kind).is_some_and(|device| graph.nodes.iter().any(|node| node.kind == device.input()))
}

/// Gives the node that pushes back its common name. Without one, or in silence, `push` pushes with nothing,
/// so that the device goes on.
fn push_back(
    graph: &mut GraphFile,
    registry: &Registry,
    sounds: bool,
    push: Option<&NodeDecl>,
) -> Result<(), Failure> {
    let forces = |node: &NodeDecl| registry.role(&node.kind) == Some(Role::Force);
    let own = graph.nodes.iter().position(|node| sounds && forces(node) && moves(graph, node));
    if let Some(at) = own {
        rename(graph, at, PUSH);
    }
    graph.nodes.retain(|node| node.id == PUSH || !forces(node));
    let ids: BTreeSet<String> = graph.nodes.iter().map(|node| node.id.clone()).collect();
    graph.wires.retain(|wire| ids.contains(&wire.to.node));
    if let (None, Some(push)) = (own, push) {
        graph.nodes.push(push.clone());
        graph.add_node(NO_PUSH, "virtual_floor", &[("stiffness_n_per_mm", "0.0")], ORIGIN)?;
        graph.add_wire(&format!("{HAND}.position"), NO_PUSH, ORIGIN);
        for port in ["plane", "normal", "stiffness"] {
            graph.add_wire(&format!("{NO_PUSH}.{port}"), &format!("{PUSH}.{port}"), ORIGIN);
        }
    }
    Ok(())
}

/// Gives a node another name, also in its wires.
fn rename(graph: &mut GraphFile, at: usize, name: &str) {
    let id = std::mem::replace(&mut graph.nodes[at].id, name.to_owned());
    for wire in &mut graph.wires {
        for end in [&mut wire.from, &mut wire.to] {
            if end.node == id {
                name.clone_into(&mut end.node);
            }
        }
    }
}

/// Gives the node that moves the stylus its common name, and records its outputs.
fn name_hand(graph: &mut GraphFile, registry: &Registry, file: &Value) -> Result<(), Failure> {
    let moves = |kind: &str| matches!(registry.role(kind), Some(Role::Stroke | Role::Hand));
    let found: Vec<usize> = (0..graph.nodes.len()).filter(|i| moves(&graph.nodes[*i].kind)).collect();
    let &[at] = found.as_slice() else {
        let what = format!("one node moves the stylus of a stimulus; here are {}", found.len());
        return Err(file.error(what).into());
    };
    rename(graph, at, HAND);
    // The host reads it; no file of this name is written.
    graph.add_node(POSITION, "probe", &[("file", "\"log.npy\"")], ORIGIN)?;
    graph.add_wire(&format!("{HAND}.position"), POSITION, ORIGIN);
    Ok(())
}

/// Inserts a gain before the inverse and limiter of each output. Returns the nodes behind it.
fn scale(graph: &mut GraphFile, registry: &Registry, gain: f64) -> Result<BTreeSet<String>, Failure> {
    let role = |graph: &GraphFile, id: &str| graph.node(id).and_then(|node| registry.role(&node.kind));
    let outs = graph.nodes.iter().filter(|node| registry.role(&node.kind) == Some(Role::AudioOutput));
    let outs: Vec<String> = outs.map(|node| node.id.clone()).collect();
    let mut behind = BTreeSet::new();
    'outs: for (number, out) in outs.iter().enumerate() {
        let mut first = out.clone();
        let wire = loop {
            let Some(at) = graph.wires.iter().position(|wire| wire.to.node == first) else {
                return Err(wrong(graph.source.path(), format!("`{first}` has no input"), "wire it"));
            };
            behind.insert(first.clone());
            let from = &graph.wires[at].from.node;
            match role(graph, from) {
                Some(Role::ActuatorInverse | Role::Limiter) => first = from.clone(),
                // Two outputs of one chain have one gain.
                _ if from.starts_with(GAIN) => continue 'outs,
                _ => break at,
            }
        };
        let id = format!("{GAIN} {number}");
        graph.add_node(&id, "gain", &[("gain", &format!("{gain:?}"))], ORIGIN)?;
        let port = graph.wires[wire].to.port.clone();
        graph.wires[wire].to.node.clone_from(&id);
        graph.wires[wire].to.port = None;
        let to = port.map_or(first.clone(), |port| format!("{first}.{port}"));
        graph.add_wire(&id, &to, ORIGIN);
    }
    Ok(behind)
}

/// Gives the nodes of a stimulus names of its own. So none goes on in another stimulus with other parameters:
/// one is faded out whole while the other is faded in.
fn set_apart(graph: &mut GraphFile, kept: &BTreeSet<String>, tag: u64, at: Option<At>) {
    let shared = |id: &String| kept.contains(id) || [HAND, PUSH, POSITION].contains(&id.as_str());
    for node in 0..graph.nodes.len() {
        let id = graph.nodes[node].id.clone();
        if !shared(&id) {
            rename(graph, node, &format!("{id} ({tag:016x})"));
            // Its noise does not depend on level and gain.
            let seeded_as = at
                .map_or(id.clone(), |At { trial, attempt, place }| format!("{id} {trial} {attempt} {place}"));
            graph.nodes[node].seeded_as = Some(seeded_as);
        }
    }
}

/// Adds masking noise with a limiter and an output for each of its channels. The noise depends on seed and
/// channel alone, so that it goes on from one stimulus to the next. It counts as a voltage of the card, with
/// the actuator of the stimulus at its output.
fn mask(graph: &mut GraphFile, registry: &Registry, masking: &Masking) -> Result<(), Failure> {
    let settings = |role: Role| {
        let node = graph.nodes.iter().find(|node| registry.role(&node.kind) == Some(role));
        node.map(|node| node.params.clone()).unwrap_or_default()
    };
    let [mut limiter, mut out] = [settings(Role::Limiter), settings(Role::AudioOutput)];
    limiter.retain(|setting| matches!(setting.name.as_str(), "profile" | "handle_mass_g"));
    out.retain(|setting| setting.name == "volts_at_full_scale");
    let volts = out.first().map_or(Ok(1.0), |setting| setting.value.f64())?;
    let rms = format!("{:?}", volts * 10f64.powf(masking.dbfs / 20.0));
    let colour = if masking.is_pink { "pink" } else { "white" };
    for channel in &masking.channels {
        // A seed is a whole number from 0 to 2^63 - 1.
        let seed = (random::bits(masking.seed, u64::from(*channel)) >> 1).to_string();
        let [noise, limit, output] = [
            format!("masking noise {channel}"),
            format!("masking limiter {channel}"),
            format!("{MASK}{channel}"),
        ];
        let params = [("unit", "V"), ("colour", colour), ("rms", &rms), ("seed", &seed)];
        graph.add_node(&noise, "noise", &params, ORIGIN)?;
        for (id, kind, params) in [(&limit, "limiter", &limiter), (&output, "audio_out", &out)] {
            graph.add_node(id, kind, &[], ORIGIN)?;
            graph.nodes.last_mut().into_iter().for_each(|node| node.params.clone_from(params));
        }
        graph.add_wire(&noise, &limit, ORIGIN);
        graph.add_wire(&limit, &output, ORIGIN);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use asperity_diagnostics::Source;

    use super::*;
    use crate::kinds::built_in;

    #[test]
    fn two_outputs_of_one_limiter_have_one_gain() {
        let text = r#"Graph(version: 1,
            nodes: {"tone": (kind: "sine"), "limiter": (kind: "limiter"), "a": (kind: "audio_out"),
                "b": (kind: "audio_out")},
            wires: [("tone", "limiter"), ("limiter", "a"), ("limiter", "b")])"#;
        let mut graph = GraphFile::parse(&Source::new("test.ron", text)).expect("a graph");
        let behind = scale(&mut graph, &built_in(), 0.5).expect("it has outputs");
        assert_eq!(behind.into_iter().collect::<Vec<_>>(), ["a", "b", "limiter"]);
        assert_eq!(graph.nodes.iter().filter(|node| node.kind == "gain").count(), 1);
    }
}
