//! `asperity scene explain`: every effect, node and model of a scene: whether it is built, why, and its
//! cost.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use asperity_accuracy::timing::Timing;
use asperity_engine::{Engine, Options};
use asperity_graph::{Compiled, Schedule};
use asperity_node::Role;
use asperity_scene::space::Form;
use asperity_scene::{NETWORK, Rendered, Scene, Touchable};
use serde::Serialize;
use serde_json::Value;

use super::{Explain, load_scene};
use crate::commands::render::Timed;
use crate::commands::render::plot::Effects;
use crate::commands::render::report::dropped_json;
use crate::failure::{Failure, clean, plural, print_report, wrong};
use crate::kinds::Kinds;
use crate::load::files::node_files;
use crate::load::{Loaded, OfScene};

/// Longest part of a stroke to run \[s\].
const MOST_S: f64 = 60.0;

pub fn run(args: &Explain) -> Result<(), Failure> {
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
    let told = explained(compiled, !args.no_sleep, whole.min(most).max(1), &of_scene);
    print_report(args.json, || &told, || text(&told, &of_scene.scene, &schedule))
}

/// A scene along its stroke.
#[derive(Serialize)]
struct Explained<'a> {
    ticks: u64,
    tick_hz: u32,
    us_per_tick: Spent,
    effects: Vec<Effect<'a>>,
    nodes: Vec<Work>,
    dropped: Vec<Value>,
    models: Vec<Model>,
    surfaces: Vec<Surface<'a>>,
}

/// Medians.
#[derive(Serialize)]
struct Spent {
    touching: f64,
    in_the_air: f64,
}

#[derive(Serialize)]
struct Surface<'a> {
    name: &'a str,
    shape: &'static str,
    effects: Vec<String>,
    ticks_touched: u64,
}

#[derive(Serialize)]
struct Work {
    id: String,
    kind: String,
    calls: u64,
    /// Median.
    us_per_call: f64,
    /// Mean.
    us_per_tick: f64,
}

/// Runs the graph of a scene with its stroke, and measures.
fn explained(compiled: Compiled, sleep: bool, ticks: u64, of_scene: &OfScene) -> Explained<'_> {
    let mut seen = Effects::new(of_scene.clone(), &compiled.schedule);
    let mut engine = Engine::new(compiled, Options { sleep, ..Options::default() });
    let mut timed = Timed::new(&engine);
    let [mut touching, mut air] = [Timing::new(3), Timing::new(3)];
    for _ in 0..ticks {
        let took = timed.tick(&mut engine);
        seen.take(&engine);
        if seen.touches() { &mut touching } else { &mut air }.record(took);
    }
    let us = |ns: u64| ns as f64 / 1e3;
    let work = |(i, node): (usize, &asperity_graph::ScheduledNode)| {
        let time = timed.times.node_summary(i).unwrap_or_default();
        Work {
            id: node.id.clone(),
            kind: node.kind.clone(),
            calls: engine.report(i).map_or(0, |report| report.calls),
            us_per_call: us(time.p50_ns),
            us_per_tick: time.mean_ns * time.count as f64 / 1e3 / ticks.max(1) as f64,
        }
    };
    let schedule = engine.schedule();
    let nodes: Vec<Work> = schedule.nodes.iter().enumerate().map(work).collect();
    let surfaces = of_scene.scene.surfaces.iter().zip(&seen.touched);
    let surfaces = surfaces.map(|(s, &ticks_touched)| Surface {
        name: &s.name,
        shape: form(s),
        effects: names(s),
        ticks_touched,
    });
    Explained {
        ticks,
        tick_hz: schedule.tick_hz,
        us_per_tick: Spent { touching: us(touching.summary().p50_ns), in_the_air: us(air.summary().p50_ns) },
        effects: effects(&nodes, &seen.active(), of_scene),
        dropped: dropped_json(schedule),
        models: models(&nodes, of_scene, schedule),
        surfaces: surfaces.collect(),
        nodes,
    }
}

/// Those of the nodes with these ids that ran, and their time \[us a tick\].
fn cost<'a>(nodes: &[Work], ids: impl IntoIterator<Item = &'a str>) -> (Vec<&'a str>, f64) {
    let work = |id| Some((id, nodes.iter().find(|work| work.id == id)?.us_per_tick));
    let works: Vec<(&str, f64)> = ids.into_iter().filter_map(work).collect();
    (works.iter().map(|(id, _)| *id).collect(), works.iter().fold(0.0, |sum, (_, us)| sum + us))
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

fn effects<'a>(works: &[Work], active: &[u64], of_scene: &'a OfScene) -> Vec<Effect<'a>> {
    let scene = &of_scene.scene;
    let count = |has: fn(&Touchable) -> bool| scene.surfaces.iter().filter(|s| has(s)).count();
    // `contact` renders both, and is counted once.
    let stiff = ("stiffness", count(|s| s.effects.stiffness.is_some()), Some("contact"));
    let damped = ("damping", count(|s| s.effects.damping.is_some()), None);
    let of_contact = [stiff, damped].map(|(name, count, node)| {
        let why = match count {
            0 => "no surface has it".to_owned(),
            n => format!("{}: by `contact`", plural(n, "surface")),
        };
        (name, count > 0, why, cost(works, node.filter(|_| count > 0)))
    });
    let rendered = of_scene.rendered.iter().map(|Rendered { kind, nodes: ids, .. }| {
        let slots = scene.slots(kind);
        let cost = cost(works, ids.iter().map(String::as_str));
        let what = if kind == NETWORK { "material" } else { "setting" };
        let why = match (slots.surfaces(), ids.is_empty(), cost.0.is_empty()) {
            (0, true, _) => "no surface has it".into(),
            (0, false, _) => "no surface has it; built since nothing is to be left out".into(),
            (_, false, true) => "nothing that it leads to is wanted".into(),
            (n, ..) => format!("{}, {}", plural(n, "surface"), plural(slots.first.len(), what)),
        };
        (kind.as_str(), !cost.0.is_empty(), why, cost)
    });
    let active = active.iter().copied().chain(std::iter::repeat(0));
    let effect = |((effect, built, why, (nodes, us_per_tick)), ticks_active)| Effect {
        effect,
        built,
        why,
        nodes,
        us_per_tick,
        ticks_active,
    };
    of_contact.into_iter().chain(rendered).zip(active).map(effect).collect()
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
fn models(works: &[Work], of: &OfScene, schedule: &Schedule) -> Vec<Model> {
    let mut all = of_network(works, &of.scene, schedule);
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
        let (loaded, us_per_tick) = (!nodes.is_empty(), cost(works, nodes.iter().map(String::as_str)).1);
        Model { file: file.display().to_string(), loaded, us_per_tick, why }
    }));
    all
}

/// Model and library of the network, if the scene has one.
fn of_network(works: &[Work], scene: &Scene, schedule: &Schedule) -> Vec<Model> {
    let Some(part) = &scene.network else { return Vec::new() };
    let slots = scene.slots(NETWORK);
    let names: Vec<String> = scene.slot_texts(NETWORK, &slots).into_iter().map(|(name, _)| name).collect();
    let why = match slots.first.len() {
        0 => "no surface has a network texture".to_owned(),
        n => format!("{}: {}", plural(n, "material"), names.join(", ")),
    };
    let networks = schedule.with_role(Role::TextureNetwork);
    let nodes: Vec<&str> = networks.map(|(_, node)| node.id.as_str()).collect();
    // The library is read only when the model is loaded.
    let of = |(name, us_per_tick)| {
        let value = part.settings.iter().find(|(key, _)| key.name == name);
        let file = value.and_then(|(_, v)| v.text().ok()).unwrap_or_default().to_owned();
        Model { file, loaded: !nodes.is_empty(), us_per_tick, why: why.clone() }
    };
    [("model", cost(works, nodes.iter().copied()).1), ("library", 0.0)].map(of).into()
}

fn text(told: &Explained<'_>, scene: &Scene, schedule: &Schedule) -> String {
    let (tick_hz, spent) = (f64::from(told.tick_hz), &told.us_per_tick);
    let spent = [("while touching", spent.touching), ("in the air", spent.in_the_air)];
    let spent = spent.into_iter().filter(|(_, us)| *us > 0.0);
    let spent: Vec<String> = spent.map(|(place, us)| format!("{us:.1} us {place}")).collect();
    let (path, surfaces) = (scene.source.path().display(), plural(scene.surfaces.len(), "surface"));
    let mut out = format!(
        "{path}: {surfaces}, {} nodes, {tick_hz} ticks/s\n\
         run for {:.2} s of its stroke; a tick took {} \
         (medians; a node's `us a tick` is a mean and includes reading the clock)\n\
         \neffect          built   us a tick  active   why\n",
        told.nodes.len(),
        told.ticks as f64 / tick_hz,
        spent.join(", ")
    );
    for Effect { effect, built, why, nodes, us_per_tick, ticks_active } in &told.effects {
        let share = 100.0 * *ticks_active as f64 / told.ticks.max(1) as f64;
        let cost = if nodes.is_empty() { String::new() } else { format!("{us_per_tick:.2}") };
        let (built, share) = if *built { ("yes", format!("{share:.0} %")) } else { ("no", String::new()) };
        out += &format!("{effect:<15} {built:<7} {cost:>9}  {share:>6}   {}\n", clean(why));
    }
    out += "\nnode                    kind                   calls   median us   us a tick\n";
    for Work { id, kind, calls, us_per_call, us_per_tick } in &told.nodes {
        let (id, kind) = (clean(id), clean(kind));
        out += &format!("{id:<23} {kind:<20} {calls:>7}   {us_per_call:>9.2}   {us_per_tick:>9.2}\n");
    }
    for dropped in &schedule.dropped {
        let (id, kind, why) = (clean(&dropped.id), clean(&dropped.kind), clean(&dropped.why));
        out += &format!("{id:<23} {kind:<20} dropped: {why}\n");
    }
    out += if told.models.is_empty() { "" } else { "\nmodel\n" };
    for Model { file, loaded, us_per_tick, why } in &told.models {
        let loaded =
            if *loaded { format!("loaded, {us_per_tick:.2} us a tick") } else { "not loaded".into() };
        out += &format!("{}: {loaded}: {}\n", clean(file), clean(why));
    }
    out += "\nsurface\n";
    for Surface { name, shape, effects, ticks_touched } in &told.surfaces {
        let (name, seconds) = (clean(name), *ticks_touched as f64 / tick_hz);
        let none = "no effect: it cannot be felt".to_owned();
        let effects = if effects.is_empty() { none } else { effects.join(", ") };
        out += &format!("{name} ({shape}): touched for {seconds:.2} s: {}\n", clean(&effects));
    }
    out += "\nwall\n";
    let asked = scene.surfaces.iter().filter_map(|surface| Some(scene.passivity(surface)?.to_string()));
    asked.collect::<BTreeSet<_>>().iter().for_each(|asked| out += &format!("{asked}\n"));
    out
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
