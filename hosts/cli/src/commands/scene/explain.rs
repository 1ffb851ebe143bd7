//! `asperity scene explain`: every effect, node and model of a scene: whether it is built, why, and its
//! cost.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use asperity_accuracy::timing::Recorder;
use asperity_engine::{Engine, Options};
use asperity_graph::{Compiled, Schedule};
use asperity_node::{Buffer, Role};
use asperity_scene::space::Form;
use asperity_scene::{NETWORK, Rendered, Scene, Touchable};
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

/// Runs the command.
pub fn run(args: &Explain) -> Result<ExitCode, Failure> {
    let mut kinds = Kinds::new(&args.scene.plugins.plugin);
    let (Loaded { compiled, .. }, of_scene) = load_scene(&args.scene, &mut kinds)?;
    if let Some((node, _)) = compiled.schedule.host_fed().next() {
        let node = &compiled.schedule.nodes[node];
        let message =
            format!("`{}` ({}) is live, and nothing is measured without a hand", node.id, node.kind);
        return Err(wrong(&args.scene.graph, message, "measure a stroke in its place: --input TRAJ.csv"));
    }
    let schedule = compiled.schedule.clone();
    let tick_hz = f64::from(schedule.tick_hz);
    let whole = schedule.duration_ticks().unwrap_or((MOST_S * tick_hz) as u64);
    let most = (args.seconds.unwrap_or(MOST_S) * tick_hz) as u64;
    let ticks = whole.min(most).max(1);
    let account = Account::of(compiled, !args.no_sleep, ticks, &of_scene);
    let told = Told { schedule: &schedule, of_scene: &of_scene, account: &account };
    if args.json {
        print(&format!("{:#}\n", told.json()))?;
    } else {
        print(&told.text())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// All that the report shows.
struct Told<'a> {
    schedule: &'a Schedule,
    of_scene: &'a OfScene,
    account: &'a Account,
}

/// A kind of effect: whether it is built, why, and its nodes.
struct Effect<'a> {
    name: &'a str,
    built: bool,
    why: String,
    nodes: Vec<&'a Work>,
    /// Ticks in which it was active.
    active: u64,
}

impl Effect<'_> {
    fn tick_us(&self) -> f64 {
        self.nodes.iter().fold(0.0, |sum, work| sum + work.tick_us)
    }
}

impl<'a> Told<'a> {
    fn scene(&self) -> &'a Scene {
        &self.of_scene.scene
    }

    fn effects(&self) -> Vec<Effect<'a>> {
        let walls = self.scene().surfaces.iter().filter(|s| s.effects.stiffness.is_some()).count();
        let damped = self.scene().surfaces.iter().filter(|s| s.effects.damping.is_some()).count();
        let contact: Vec<&Work> = self.account.node("contact").into_iter().collect();
        let of_contact = |name, count: usize| Effect {
            name,
            built: count > 0,
            why: if count > 0 {
                format!("{}: by `contact`", plural(count, "surface"))
            } else {
                "no surface has it".into()
            },
            nodes: if count > 0 { contact.clone() } else { Vec::new() },
            active: 0,
        };
        let mut all = vec![of_contact("stiffness", walls)];
        // `contact` is counted once.
        all.push(Effect { nodes: Vec::new(), ..of_contact("damping", damped) });
        for Rendered { kind, nodes: ids, .. } in &self.of_scene.rendered {
            let slots = self.scene().slots(kind);
            let nodes: Vec<&Work> = ids.iter().filter_map(|id| self.account.node(id)).collect();
            let what = if kind == NETWORK { "material" } else { "setting" };
            let why = match (slots.surfaces(), ids.is_empty(), nodes.is_empty()) {
                (0, true, _) => "no surface has it".into(),
                (0, false, _) => "no surface has it; built since nothing is to be left out".into(),
                (_, false, true) => "nothing that it leads to is wanted".into(),
                (n, ..) => format!("{}, {}", plural(n, "surface"), plural(slots.first.len(), what)),
            };
            all.push(Effect { name: kind, built: !nodes.is_empty(), why, nodes, active: 0 });
        }
        for (effect, active) in all.iter_mut().zip(&self.account.active) {
            effect.active = *active;
        }
        all
    }

    fn text(&self) -> String {
        let (scene, account) = (self.scene(), self.account);
        let mut out = String::new();
        let where_to = ["while touching", "in the air"].into_iter().zip(account.tick_us);
        let spent: Vec<String> =
            where_to.filter(|(_, us)| *us > 0.0).map(|(place, us)| format!("{us:.1} us {place}")).collect();
        let _ = writeln!(
            out,
            "{}: {}, {} nodes, {} ticks/s",
            scene.source.path().display(),
            plural(scene.surfaces.len(), "surface"),
            self.schedule.nodes.len(),
            self.schedule.tick_hz
        );
        let _ = writeln!(
            out,
            "run for {:.2} s of its stroke; a tick took {} \
             (medians; a node's `us a tick` is a mean and includes reading the clock)",
            account.ticks as f64 / f64::from(self.schedule.tick_hz),
            spent.join(", ")
        );
        let _ = writeln!(out, "\neffect          built   us a tick  active   why");
        for effect in self.effects() {
            let share = 100.0 * effect.active as f64 / account.ticks.max(1) as f64;
            let cost =
                if effect.nodes.is_empty() { String::new() } else { format!("{:.2}", effect.tick_us()) };
            let share = if effect.built { format!("{share:.0} %") } else { String::new() };
            let figures = format!("{cost:>9}  {share:>6}");
            let built = if effect.built { "yes" } else { "no" };
            let _ = writeln!(out, "{:<15} {built:<7} {figures}   {}", effect.name, clean(&effect.why));
        }
        let _ =
            writeln!(out, "\nnode                    kind                   calls   median us   us a tick");
        for work in &account.nodes {
            let _ = writeln!(
                out,
                "{:<23} {:<20} {:>7}   {:>9.2}   {:>9.2}",
                clean(&work.id),
                clean(&work.kind),
                work.calls,
                work.call_us,
                work.tick_us
            );
        }
        for dropped in &self.schedule.dropped {
            let _ = writeln!(
                out,
                "{:<23} {:<20} dropped: {}",
                clean(&dropped.id),
                clean(&dropped.kind),
                clean(&dropped.why)
            );
        }
        let models = models(self.of_scene, self.schedule, self.account);
        if !models.is_empty() {
            let _ = writeln!(out, "\nmodel");
            for Model { file, tick_us, why } in models {
                let (file, why) = (clean(&file), clean(&why));
                let _ = match tick_us {
                    Some(us) => writeln!(out, "{file}: loaded, {us:.2} us a tick: {why}"),
                    None => writeln!(out, "{file}: not loaded: {why}"),
                };
            }
        }
        self.surfaces(&mut out);
        out
    }

    fn surfaces(&self, out: &mut String) {
        let all = &self.scene().surfaces;
        let _ = writeln!(out, "\nsurface");
        let mut asked = BTreeSet::new();
        for (surface, ticks) in all.iter().zip(&self.account.touched).take(MOST_SURFACES) {
            let seconds = *ticks as f64 / f64::from(self.schedule.tick_hz);
            let effects = names(surface);
            if let Some(passivity) = self.scene().passivity(surface) {
                asked.insert(passivity.to_string());
            }
            let effects = if effects.is_empty() {
                "no effect: it cannot be felt".to_owned()
            } else {
                effects.join(", ")
            };
            let _ = writeln!(
                out,
                "{} ({}): touched for {seconds:.2} s: {}",
                clean(&surface.name),
                form(surface),
                clean(&effects)
            );
        }
        if let Some(more) = all.len().checked_sub(MOST_SURFACES).filter(|n| *n > 0) {
            let touched = self.account.touched.iter().filter(|ticks| **ticks > 0).count();
            let _ = writeln!(out, "and {more} more; {touched} of all were touched");
        }
        let _ = writeln!(out, "\nwall");
        for asked in asked {
            let _ = writeln!(out, "{asked}");
        }
    }

    fn json(&self) -> Value {
        let effects: Vec<Value> = self
            .effects()
            .iter()
            .map(|e| {
                let nodes: Vec<&str> = e.nodes.iter().map(|w| w.id.as_str()).collect();
                json!({
                    "effect": e.name,
                    "built": e.built,
                    "why": e.why,
                    "nodes": nodes,
                    "us_per_tick": e.tick_us(),
                    "ticks_active": e.active,
                })
            })
            .collect();
        let nodes: Vec<Value> = self
            .account
            .nodes
            .iter()
            .map(|w| {
                json!({
                    "id": w.id, "kind": w.kind, "calls": w.calls, "us_per_call": w.call_us,
                    "us_per_tick": w.tick_us,
                })
            })
            .collect();
        let models: Vec<Value> = models(self.of_scene, self.schedule, self.account)
            .into_iter()
            .map(|m| {
                json!({
                    "file": m.file, "loaded": m.tick_us.is_some(),
                    "us_per_tick": m.tick_us.unwrap_or(0.0), "why": m.why,
                })
            })
            .collect();
        let surfaces: Vec<Value> = self
            .scene()
            .surfaces
            .iter()
            .zip(&self.account.touched)
            .map(|(s, ticks)| {
                json!({ "name": s.name, "shape": form(s), "effects": names(s), "ticks_touched": ticks })
            })
            .collect();
        json!({
            "ticks": self.account.ticks,
            "tick_hz": self.schedule.tick_hz,
            "us_per_tick": { "touching": self.account.tick_us[0], "in_the_air": self.account.tick_us[1] },
            "effects": effects,
            "nodes": nodes,
            "dropped": dropped_json(self.schedule),
            "models": models,
            "surfaces": surfaces,
        })
    }
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
    let mut all = Vec::new();
    if effects.stiffness.is_some() {
        all.push("stiffness".to_owned());
    }
    if effects.damping.is_some() {
        all.push("damping".to_owned());
    }
    match (&effects.network, &surface.material) {
        (Some(_), Some(material)) => all.push(format!("network of {}", material.of)),
        (Some(_), None) => all.push(NETWORK.to_owned()),
        (None, _) => {}
    }
    let mut seen = BTreeSet::new();
    for named in &effects.named {
        if seen.insert(&named.kind) {
            match effects.of(&named.kind).count() {
                1 => all.push(named.kind.clone()),
                count => all.push(format!("{count} {}s", named.kind)),
            }
        }
    }
    all
}

/// Figures of one node.
#[derive(Clone, Debug)]
pub struct Work {
    pub id: String,
    pub kind: String,
    /// Calls of `process`.
    pub calls: u64,
    /// Median of a call \[us\].
    pub call_us: f64,
    /// Mean of its time in a tick \[us\].
    pub tick_us: f64,
}

/// Figures of a run.
#[derive(Clone, Debug)]
pub struct Account {
    /// Ticks that ran.
    pub ticks: u64,
    /// Median of a tick in which a surface was touched, and of one in the air \[us\].
    pub tick_us: [f64; 2],
    /// Nodes in the order in which they run.
    pub nodes: Vec<Work>,
    /// Ticks in which each surface was touched.
    pub touched: Vec<u64>,
    /// Ticks in which each effect was active: stiffness, damping, then the kinds that nodes render.
    pub active: Vec<u64>,
}

impl Account {
    /// Runs the graph of a scene with its stroke, and measures.
    pub fn of(compiled: Compiled, sleep: bool, ticks: u64, of_scene: &OfScene) -> Self {
        let nodes: Vec<(String, String)> =
            compiled.schedule.nodes.iter().map(|n| (n.id.clone(), n.kind.clone())).collect();
        // Walls and volumes have an output each.
        let contact = ["surface", "volume"].map(|name| {
            let (node, of) = compiled.schedule.with_role(Role::Contact).next()?;
            let output = of.outputs.iter().position(|o| o.name == name)?;
            Some((node, output))
        });
        let mut effects = Effects::new(of_scene.clone(), &compiled.schedule);
        let mut engine = Engine::new(compiled, Options { sleep, ..Options::default() });
        let clock = ClockTime(Instant::now());
        let (mut spent, mut total) = (vec![0; nodes.len()], vec![0_u64; nodes.len()]);
        let mut calls = vec![0; nodes.len()];
        let mut times = Recorder::new(nodes.len());
        let mut ticks_of = [Recorder::new(0), Recorder::new(0)];
        let mut touched = vec![0; of_scene.scene.surfaces.len()];
        for _ in 0..ticks {
            spent.fill(0);
            let began = Instant::now();
            engine.tick_timed(&clock, &mut spent);
            let tick_ns = began.elapsed().as_nanos() as u64;
            effects.take(&engine);
            let now = contact.map(|port| {
                let (node, output) = port?;
                match engine.output(node, output) {
                    Some(Buffer::Control { values, .. }) => {
                        values.first().filter(|number| **number >= 0.0).map(|number| *number as usize)
                    }
                    _ => None,
                }
            });
            for surface in now.into_iter().flatten() {
                if let Some(count) = touched.get_mut(surface) {
                    *count += 1;
                }
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
        let nodes = nodes
            .into_iter()
            .enumerate()
            .map(|(i, (id, kind))| Work {
                id,
                kind,
                calls: calls[i],
                call_us: times.node_summary(i).map_or(0.0, |s| us(s.p50_ns)),
                tick_us: us(total[i]) / ticks.max(1) as f64,
            })
            .collect();
        let tick_us = ticks_of.each_ref().map(|of| us(of.tick_summary().p50_ns));
        Self { ticks, tick_us, nodes, touched, active: effects.active() }
    }

    /// A node's figures.
    pub fn node(&self, id: &str) -> Option<&Work> {
        self.nodes.iter().find(|work| work.id == id)
    }
}

/// Most materials that are named.
const MOST_NAMED: usize = 12;

/// A model, library, recording or picture.
struct Model {
    /// The file.
    pub file: String,
    /// Time of the nodes that read it, with all their work \[us a tick\]; `None` if no node does.
    pub tick_us: Option<f64>,
    /// Its use.
    pub why: String,
}

/// Files that the scene names or its nodes read.
fn models(of: &OfScene, schedule: &Schedule, account: &Account) -> Vec<Model> {
    let mut all = of_network(&of.scene, schedule, account);
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
        Model { file: file.display().to_string(), tick_us: cost(account, &nodes), why }
    }));
    all
}

/// Model and library of the network, if the scene has one.
fn of_network(scene: &Scene, schedule: &Schedule, account: &Account) -> Vec<Model> {
    let Some(part) = &scene.network else { return Vec::new() };
    let slots = scene.slots(NETWORK);
    let why = match slots.first.len() {
        0 => "no surface has a network texture".to_owned(),
        n => {
            let all = scene.slot_texts(NETWORK, &slots);
            let names: Vec<String> = all.into_iter().take(MOST_NAMED).map(|(name, _)| name).collect();
            let more = if n > MOST_NAMED { format!(" and {} more", n - MOST_NAMED) } else { String::new() };
            format!("{}: {}{more}", plural(n, "material"), names.join(", "))
        }
    };
    let networks = schedule.with_role(Role::TextureNetwork);
    let nodes: Vec<String> = networks.map(|(_, node)| node.id.clone()).collect();
    let runs = cost(account, &nodes);
    // The library is read only when the model is loaded.
    [("model", runs), ("library", runs.map(|_| 0.0))]
        .into_iter()
        .map(|(name, tick_us)| {
            let value = part.settings.iter().find(|(key, _)| key.name == name);
            let file = value.and_then(|(_, v)| v.text().ok()).unwrap_or_default().to_owned();
            Model { file, tick_us, why: why.clone() }
        })
        .collect()
}

fn cost(account: &Account, nodes: &[String]) -> Option<f64> {
    let works = nodes.iter().filter_map(|node| account.node(node));
    (!nodes.is_empty()).then(|| works.fold(0.0, |sum, work| sum + work.tick_us))
}
