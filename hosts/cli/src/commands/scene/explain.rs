//! `asperity scene explain`: every effect, node and model of a scene: whether it is built, why, and its
//! cost.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use asperity_accuracy::timing::Recorder;
use asperity_engine::{Engine, Options};
use asperity_graph::{Compiled, Schedule};
use asperity_node::{Buffer, Role};
use asperity_scene::space::Form;
use asperity_scene::{NETWORK, Rendered, Scene, Touchable};
use serde::Serialize;
use serde_json::{Value, json};

use super::{Explain, load_scene};
use crate::commands::render::ClockTime;
use crate::commands::render::plot::Effects;
use crate::commands::render::report::dropped_json;
use crate::failure::{Failure, clean, print, wrong};
use crate::kinds::Kinds;
use crate::load::files::node_files;
use crate::load::{Loaded, OfScene};

/// Longest part of a stroke to run \[s\].
const MOST_S: f64 = 60.0;
/// Most surfaces that are listed.
const MOST_SURFACES: usize = 40;
/// Most materials that are named.
const MOST_NAMED: usize = 12;

/// Runs the command.
pub fn run(args: &Explain) -> Result<ExitCode, Failure> {
    let mut kinds = Kinds::new(&args.scene.plugins.plugin);
    let (Loaded { compiled, .. }, of_scene) = load_scene(&args.scene, &mut kinds)?;
    let schedule = compiled.schedule.clone();
    if let Some((node, _)) = schedule.host_fed().next() {
        let node = &schedule.nodes[node];
        let what = format!("`{}` ({}) is live, and nothing is measured without a hand", node.id, node.kind);
        return Err(wrong(&args.scene.graph, what, "measure a stroke in its place: --input TRAJ.csv"));
    }
    let tick_hz = f64::from(schedule.tick_hz);
    let whole = schedule.duration_ticks().unwrap_or((MOST_S * tick_hz) as u64);
    let most = (args.seconds.unwrap_or(MOST_S) * tick_hz) as u64;
    let account = Account::of(compiled, !args.no_sleep, whole.min(most).max(1), &of_scene);
    if args.json {
        print(&format!("{:#}\n", json(&account, &of_scene, &schedule)))?;
    } else {
        print(&text(&account, &of_scene, &schedule))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Figures of one node.
#[derive(Serialize)]
struct Work {
    id: String,
    kind: String,
    /// Calls of `process`.
    calls: u64,
    /// Median.
    us_per_call: f64,
    /// Mean.
    us_per_tick: f64,
}

/// Figures of a run.
struct Account {
    /// Ticks that ran.
    ticks: u64,
    /// Median of a tick in which a surface was touched, and of one in the air \[us\].
    tick_us: [f64; 2],
    /// Nodes in the order in which they run.
    nodes: Vec<Work>,
    /// Ticks in which each surface was touched.
    touched: Vec<u64>,
    /// Ticks in which each effect was active: stiffness, damping, then the kinds that nodes render.
    active: Vec<u64>,
}

impl Account {
    /// Runs the graph of a scene with its stroke, and measures.
    fn of(compiled: Compiled, sleep: bool, ticks: u64, of_scene: &OfScene) -> Self {
        let schedule = compiled.schedule.clone();
        let count = schedule.nodes.len();
        // Walls and volumes have an output each.
        let contact = ["surface", "volume"].map(|name| {
            let (node, of) = schedule.with_role(Role::Contact).next()?;
            Some((node, of.outputs.iter().position(|o| o.name == name)?))
        });
        let mut effects = Effects::new(of_scene.clone(), &schedule);
        let mut engine = Engine::new(compiled, Options { sleep, ..Options::default() });
        let clock = ClockTime(Instant::now());
        let (mut spent, mut total, mut calls) = (vec![0; count], vec![0_u64; count], vec![0; count]);
        let mut times = Recorder::new(count);
        let mut ticks_of = [Recorder::new(0), Recorder::new(0)];
        let mut touched = vec![0; of_scene.scene.surfaces.len()];
        for _ in 0..ticks {
            spent.fill(0);
            let began = Instant::now();
            engine.tick_timed(&clock, &mut spent);
            let tick_ns = began.elapsed().as_nanos() as u64;
            effects.take(&engine);
            let now = contact.map(|port| match port.map(|(node, output)| engine.output(node, output))? {
                Some(Buffer::Control { values, .. }) => {
                    values.first().filter(|n| **n >= 0.0).map(|n| *n as usize)
                }
                _ => None,
            });
            for surface in now.into_iter().flatten() {
                touched.get_mut(surface).into_iter().for_each(|count| *count += 1);
            }
            ticks_of[usize::from(now == [None, None])].tick(tick_ns);
            for (node, spent) in spent.iter().enumerate() {
                total[node] += spent;
                let now = engine.report(node).map_or(0, |r| r.calls);
                if now > calls[node] {
                    times.node(node, *spent);
                }
                calls[node] = now;
            }
        }
        let us = |ns: u64| ns as f64 / 1e3;
        let work = |(i, node): (usize, &asperity_graph::ScheduledNode)| Work {
            id: node.id.clone(),
            kind: node.kind.clone(),
            calls: calls[i],
            us_per_call: times.node_summary(i).map_or(0.0, |s| us(s.p50_ns)),
            us_per_tick: us(total[i]) / ticks.max(1) as f64,
        };
        let nodes = schedule.nodes.iter().enumerate().map(work).collect();
        let tick_us = ticks_of.each_ref().map(|of| us(of.tick_summary().p50_ns));
        Self { ticks, tick_us, nodes, touched, active: effects.active() }
    }

    /// Those of these nodes that ran, and their time \[us a tick\].
    fn cost<'a>(&self, nodes: &'a [String]) -> (Vec<&'a str>, f64) {
        let work = |id: &'a String| Some((id.as_str(), self.nodes.iter().find(|w| w.id == *id)?.us_per_tick));
        let works: Vec<(&str, f64)> = nodes.iter().filter_map(work).collect();
        (works.iter().map(|(id, _)| *id).collect(), works.iter().fold(0.0, |sum, (_, us)| sum + us))
    }
}

/// A kind of effect: whether it is built, why, and its nodes.
#[derive(Serialize)]
struct Effect<'a> {
    effect: &'a str,
    built: bool,
    why: String,
    nodes: Vec<&'a str>,
    us_per_tick: f64,
    ticks_active: u64,
}

fn effects<'a>(account: &'a Account, of_scene: &'a OfScene, contact: &'a [String]) -> Vec<Effect<'a>> {
    let scene = &of_scene.scene;
    let walls = scene.surfaces.iter().filter(|s| s.effects.stiffness.is_some()).count();
    let damped = scene.surfaces.iter().filter(|s| s.effects.damping.is_some()).count();
    // `contact` is counted once.
    let of_contact = [("stiffness", walls, contact), ("damping", damped, &[])].map(|(name, count, nodes)| {
        let nodes = if count > 0 { nodes } else { &[] };
        let why = match count {
            0 => "no surface has it".to_owned(),
            n => format!("{}: by `contact`", plural(n, "surface")),
        };
        (name, count > 0, why, account.cost(nodes))
    });
    let rendered = of_scene.rendered.iter().map(|Rendered { kind, nodes: ids, .. }| {
        let slots = scene.slots(kind);
        let cost = account.cost(ids);
        let what = if kind == NETWORK { "material" } else { "setting" };
        let why = match (slots.surfaces(), ids.is_empty(), cost.0.is_empty()) {
            (0, true, _) => "no surface has it".into(),
            (0, false, _) => "no surface has it; built since nothing is to be left out".into(),
            (_, false, true) => "nothing that it leads to is wanted".into(),
            (n, ..) => format!("{}, {}", plural(n, "surface"), plural(slots.first.len(), what)),
        };
        (kind.as_str(), !cost.0.is_empty(), why, cost)
    });
    let active = account.active.iter().copied().chain(std::iter::repeat(0));
    let all = of_contact.into_iter().chain(rendered).zip(active);
    all.map(|((effect, built, why, (nodes, us_per_tick)), ticks_active)| Effect {
        effect,
        built,
        why,
        nodes,
        us_per_tick,
        ticks_active,
    })
    .collect()
}

/// A model, library, recording or picture.
#[derive(Serialize)]
struct Model {
    file: String,
    /// Whether a node reads it.
    loaded: bool,
    /// Time of the nodes that read it, with all their work.
    us_per_tick: f64,
    why: String,
}

/// Files that the scene names or its nodes read.
fn models(account: &Account, of: &OfScene, schedule: &Schedule) -> Vec<Model> {
    let mut all = of_network(account, &of.scene, schedule);
    let mut files: BTreeMap<PathBuf, (usize, Vec<String>)> = BTreeMap::new();
    for file in &of.files {
        files.entry(file.clone()).or_default().0 += 1;
    }
    for file in node_files(schedule).into_iter().filter(|file| file.param.is_empty()) {
        files.entry(file.path).or_default().1.push(file.node);
    }
    all.extend(files.into_iter().map(|(file, (surfaces, nodes))| {
        let names: Vec<String> = nodes.iter().map(|node| format!("`{node}`")).collect();
        let by = match names.is_empty() {
            true => "nothing that it leads to is wanted".to_owned(),
            false => format!("by {}", names.join(", ")),
        };
        let why = if surfaces > 0 { format!("{}, {by}", plural(surfaces, "surface")) } else { by };
        let (loaded, us_per_tick) = (!nodes.is_empty(), account.cost(&nodes).1);
        Model { file: file.display().to_string(), loaded, us_per_tick, why }
    }));
    all
}

/// Model and library of the network, if the scene has one.
fn of_network(account: &Account, scene: &Scene, schedule: &Schedule) -> Vec<Model> {
    let Some(part) = &scene.network else { return Vec::new() };
    let slots = scene.slots(NETWORK);
    let why = match slots.first.len() {
        0 => "no surface has a network texture".to_owned(),
        n => {
            let all = scene.slot_texts(NETWORK, &slots).into_iter().map(|(name, _)| name);
            let names: Vec<String> = all.take(MOST_NAMED).collect();
            let more = if n > MOST_NAMED { format!(" and {} more", n - MOST_NAMED) } else { String::new() };
            format!("{}: {}{more}", plural(n, "material"), names.join(", "))
        }
    };
    let networks = schedule.with_role(Role::TextureNetwork);
    let nodes: Vec<String> = networks.map(|(_, node)| node.id.clone()).collect();
    // The library is read only when the model is loaded.
    let of = |(name, us_per_tick)| {
        let value = part.settings.iter().find(|(key, _)| key.name == name);
        let file = value.and_then(|(_, v)| v.text().ok()).unwrap_or_default().to_owned();
        Model { file, loaded: !nodes.is_empty(), us_per_tick, why: why.clone() }
    };
    [("model", account.cost(&nodes).1), ("library", 0.0)].map(of).into()
}

fn text(account: &Account, of_scene: &OfScene, schedule: &Schedule) -> String {
    let (scene, tick_hz) = (&of_scene.scene, f64::from(schedule.tick_hz));
    let spent = ["while touching", "in the air"].into_iter().zip(account.tick_us).filter(|(_, us)| *us > 0.0);
    let spent: Vec<String> = spent.map(|(place, us)| format!("{us:.1} us {place}")).collect();
    let (path, surfaces) = (scene.source.path().display(), plural(scene.surfaces.len(), "surface"));
    let mut out = format!(
        "{path}: {surfaces}, {} nodes, {tick_hz} ticks/s\n\
         run for {:.2} s of its stroke; a tick took {} \
         (medians; a node's `us a tick` is a mean and includes reading the clock)\n\
         \neffect          built   us a tick  active   why\n",
        schedule.nodes.len(),
        account.ticks as f64 / tick_hz,
        spent.join(", ")
    );
    for Effect { effect, built, why, nodes, us_per_tick, ticks_active } in
        effects(account, of_scene, &["contact".to_owned()])
    {
        let share = 100.0 * ticks_active as f64 / account.ticks.max(1) as f64;
        let cost = if nodes.is_empty() { String::new() } else { format!("{us_per_tick:.2}") };
        let (built, share) = if built { ("yes", format!("{share:.0} %")) } else { ("no", String::new()) };
        out += &format!("{effect:<15} {built:<7} {cost:>9}  {share:>6}   {}\n", clean(&why));
    }
    out += "\nnode                    kind                   calls   median us   us a tick\n";
    for Work { id, kind, calls, us_per_call, us_per_tick } in &account.nodes {
        let (id, kind) = (clean(id), clean(kind));
        out += &format!("{id:<23} {kind:<20} {calls:>7}   {us_per_call:>9.2}   {us_per_tick:>9.2}\n");
    }
    for dropped in &schedule.dropped {
        let (id, kind, why) = (clean(&dropped.id), clean(&dropped.kind), clean(&dropped.why));
        out += &format!("{id:<23} {kind:<20} dropped: {why}\n");
    }
    let models = models(account, of_scene, schedule);
    out += if models.is_empty() { "" } else { "\nmodel\n" };
    for Model { file, loaded, us_per_tick, why } in models {
        let loaded = if loaded { format!("loaded, {us_per_tick:.2} us a tick") } else { "not loaded".into() };
        out += &format!("{}: {loaded}: {}\n", clean(&file), clean(&why));
    }
    out += "\nsurface\n";
    let mut asked = BTreeSet::new();
    for (surface, ticks) in scene.surfaces.iter().zip(&account.touched).take(MOST_SURFACES) {
        asked.extend(scene.passivity(surface).map(|passivity| passivity.to_string()));
        let (name, form, seconds) = (clean(&surface.name), form(surface), *ticks as f64 / tick_hz);
        let effects = match names(surface) {
            none if none.is_empty() => "no effect: it cannot be felt".to_owned(),
            names => names.join(", "),
        };
        out += &format!("{name} ({form}): touched for {seconds:.2} s: {}\n", clean(&effects));
    }
    if let Some(more @ 1..) = scene.surfaces.len().checked_sub(MOST_SURFACES) {
        let touched = account.touched.iter().filter(|ticks| **ticks > 0).count();
        out += &format!("and {more} more; {touched} of all were touched\n");
    }
    out += "\nwall\n";
    asked.iter().for_each(|asked| out += &format!("{asked}\n"));
    out
}

fn json(account: &Account, of_scene: &OfScene, schedule: &Schedule) -> Value {
    let surfaces: Vec<Value> = (of_scene.scene.surfaces.iter().zip(&account.touched))
        .map(|(s, ticks)| {
            json!({ "name": s.name, "shape": form(s), "effects": names(s), "ticks_touched": ticks })
        })
        .collect();
    json!({
        "ticks": account.ticks, "tick_hz": schedule.tick_hz,
        "us_per_tick": { "touching": account.tick_us[0], "in_the_air": account.tick_us[1] },
        "effects": effects(account, of_scene, &["contact".to_owned()]), "nodes": account.nodes,
        "dropped": dropped_json(schedule), "models": models(account, of_scene, schedule),
        "surfaces": surfaces,
    })
}

fn plural(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

fn form(surface: &Touchable) -> &'static str {
    match surface.surface.shape.form() {
        Form::Plane => "plane",
        Form::Rectangle { .. } => "rectangle",
        Form::Sphere { .. } => "sphere",
        Form::Box { .. } => "box",
        Form::Relief(_) => "relief",
    }
}

/// Names of a surface's effects, with the material of a network.
fn names(surface: &Touchable) -> Vec<String> {
    let effects = &surface.effects;
    let walls = [("stiffness", effects.stiffness.is_some()), ("damping", effects.damping.is_some())];
    let mut all: Vec<String> = walls.iter().filter(|(_, is)| *is).map(|(name, _)| (*name).into()).collect();
    if effects.place(NETWORK).is_some() {
        let material = surface.material.as_ref();
        all.push(material.map_or(NETWORK.to_owned(), |material| format!("network of {}", material.of)));
    }
    let mut seen = BTreeSet::new();
    for named in effects.named.iter().filter(|named| named.kind != NETWORK && seen.insert(&named.kind)) {
        all.push(match effects.of(&named.kind).count() {
            1 => named.kind.clone(),
            count => format!("{count} {}s", named.kind),
        });
    }
    all
}
