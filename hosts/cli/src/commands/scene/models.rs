//! Models, recordings and pictures of a scene: which are loaded, for whom, and what they cost.

use std::collections::BTreeMap;
use std::path::PathBuf;

use asperity_graph::Schedule;
use asperity_scene::{Kind, Scene};

use super::account::Account;
use super::explain::plural;
use crate::load;

/// Most materials that are named.
const MOST_NAMED: usize = 12;

/// A file of which something is made.
pub(super) struct Model {
    /// The file.
    pub file: String,
    /// What the nodes take that read it, all their other work included; none where nobody does \[us a tick\].
    pub tick_us: Option<f64>,
    /// For what.
    pub why: String,
}

/// All that the scene names, and all that its nodes read besides.
pub(super) fn models(scene: &Scene, schedule: &Schedule, account: &Account) -> Vec<Model> {
    let mut all = of_network(scene, schedule, account);
    let mut files: BTreeMap<PathBuf, (usize, Vec<String>)> = BTreeMap::new();
    for file in scene.surfaces.iter().flat_map(|surface| surface.effects.files()) {
        files.entry(file.clone()).or_default().0 += 1;
    }
    for file in load::node_files(schedule).into_iter().filter(|file| file.param.is_empty()) {
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

/// Model and library of the network, where the scene has one.
fn of_network(scene: &Scene, schedule: &Schedule, account: &Account) -> Vec<Model> {
    let Some(part) = &scene.network else { return Vec::new() };
    let slots = scene.slots(Kind::Network);
    let why = match slots.first.len() {
        0 => "no surface has a network texture".to_owned(),
        n => {
            let name = |slot| scene.slot_text(Kind::Network, &slots, slot);
            let names: Vec<String> = (0..n.min(MOST_NAMED)).map(name).collect();
            let more = if n > MOST_NAMED { format!(" and {} more", n - MOST_NAMED) } else { String::new() };
            format!("{}: {}{more}", plural(n, "material"), names.join(", "))
        }
    };
    let networks = schedule.nodes.iter().filter(|node| node.kind == "texture_network");
    let nodes: Vec<String> = networks.map(|node| node.id.clone()).collect();
    let runs = cost(account, &nodes);
    // The library is looked up once, when the model is loaded.
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
