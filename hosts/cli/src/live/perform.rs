//! Graphs that a command makes for itself, played to their end.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use asperity_actuator::{ActuatorProfile, Dynamics};
use asperity_diagnostics::{Diagnostic, Source};
use asperity_engine::Options;
use asperity_graph::{Compiled, GraphFile, Schedule, compile};
use asperity_live::view::View;
use asperity_live::{Ended, Ends, Listener, Session, conduct, mic};

use super::card;
use crate::args::{ActuatorArgs, DeviceArgs};
use crate::failure::{Failure, warn};
use crate::kinds;
use crate::render::stop_flag;

/// How often a run is looked at.
const LOOK: Duration = Duration::from_millis(5);

/// What is behind the samples of a card: the nodes that stand before every device, from amperes on.
pub fn output_nodes(args: &ActuatorArgs) -> Result<String, Failure> {
    let ActuatorArgs { profile, handle_mass_g, volts_at_full_scale, amps_per_volt } = args;
    actuator(("--profile", profile), &[("--handle-mass-g", *handle_mass_g)])?;
    let profile = named(profile)?;
    Ok(format!(
        r#""limiter": (kind: "limiter", params: (profile: {profile:?}, handle_mass_g: {handle_mass_g:?})),
           "out": (kind: "audio_out", params: (volts_at_full_scale: {volts_at_full_scale:?}, amps_per_volt: {amps_per_volt:?})),"#
    ))
}

/// The profile that an option names, which must be of an actuator that can be on handles of these masses \[g\].
pub fn actuator((option, name): (&str, &str), handles: &[(&str, f64)]) -> Result<ActuatorProfile, Failure> {
    let profile = ActuatorProfile::find(name, "".as_ref()).map_err(|d| {
        let inside = d.path().is_some();
        let d = if inside { d } else { d.in_file(option) };
        if inside { Failure::from(d).named_by(option) } else { d.into() }
    })?;
    for (handle, grams) in handles {
        Dynamics::new(&profile, *grams).map_err(|e| {
            let help = format!("the actuator is `{}`, of {option}", profile.name);
            Failure::from(Diagnostic::new(e.to_string()).in_file(handle).help(help))
        })?;
    }
    Ok(profile)
}

/// A profile as a graph names it from anywhere.
pub fn named(profile: &str) -> Result<String, Failure> {
    if !profile.ends_with(".ron") {
        return Ok(profile.to_owned());
    }
    let path = std::path::absolute(Path::new(profile));
    let path = path.map_err(|e| Failure::Machine(format!("cannot read {profile}: {e}")))?;
    Ok(path.display().to_string())
}

/// A graph from its text; `name` is what errors call it. They do not point into it: nobody has seen it.
pub fn graph(name: &str, rate_hz: u32, nodes: &str, wires: &str) -> Result<(GraphFile, Compiled), Failure> {
    let text =
        format!("Graph(version: 1, tick_hz: 500, audio_hz: {rate_hz}, nodes: {{{nodes}}}, wires: [{wires}])");
    let own = |failure: Failure| failure.not_shown(Path::new(name));
    let graph = GraphFile::parse(&Source::new(name, text)).map_err(|d| own(d.into()))?;
    let compiled = compile(&graph, &kinds::registry(&[])?, asperity_graph::Options::default());
    Ok((graph, compiled.map_err(|d| own(d.into()))?))
}

/// What happens while it plays.
pub struct Watching<'w> {
    /// Called some hundred times a second; answers whether to go on.
    pub view: &'w mut dyn FnMut(&View, &Listener) -> bool,
    /// Called with what sinks recorded: id, first sample, samples.
    pub recorded: &'w mut dyn FnMut(&str, u64, &[f32]),
}

/// Plays a graph until `ticks` have run, or until it is told to stop. False where somebody stopped it.
pub fn play(
    (graph, compiled): (GraphFile, Compiled),
    args: &DeviceArgs,
    start_s: f64,
    ends: Ends,
    ticks: u64,
    watching: Watching<'_>,
) -> Result<(Ended, bool), Failure> {
    let schedule: &Schedule = &compiled.schedule;
    let request = card::request(args, schedule)?;
    let coils = card::coils(args, schedule)?;
    let recorded = request.as_ref().map_or(0, |r| r.inputs.len());
    let (writer, reader) = mic(recorded, schedule.audio_hz, schedule.tick_hz);
    let listener = writer.listener();
    let (writer, reader) = if recorded > 0 { (Some(writer), Some(reader)) } else { (None, None) };
    let (conductor, player) = conduct(compiled, &graph, Options::default(), ends, reader, Vec::new());
    let not_had = |e| card::not_had(e, card::OF_COMMAND);
    let stop = stop_flag();
    let options = asperity_live::SessionOptions { start_s, ..card::options(args, request, coils) };
    let mut session = Session::start(conductor, player, writer, options).map_err(not_had)?;
    let mut whole = true;
    loop {
        for notice in session.tend().map_err(not_had)? {
            once(notice);
        }
        if session.conductor().recorded(|r| (watching.recorded)(r.sink, r.start, r.values)) > 0 {
            return Err(Failure::Machine("the machine is too slow to record".into()));
        }
        let view = session.view();
        if !session.goes_on() {
            return Err(Failure::Machine(format!("`{}` is lost before the end", view.device)));
        }
        if view.ticks >= ticks {
            break;
        }
        if stop.load(Relaxed) || !(watching.view)(&view, &listener) {
            whole = false;
            break;
        }
        std::thread::sleep(LOOK);
    }
    let mut ended = session.stop();
    ended.conductor.recorded(|r| (watching.recorded)(r.sink, r.start, r.values));
    Ok((ended, whole))
}

/// Warns, unless it was said in this run: a command may open its device several times.
fn once(notice: String) {
    static SAID: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let mut said = SAID.lock().unwrap_or_else(PoisonError::into_inner);
    if !said.contains(&notice) {
        warn(&notice);
        said.insert(notice);
    }
}
