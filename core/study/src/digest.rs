//! Names of finished parts: a name says all that a part depends on, so that after a change only what it touches is run again.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use asperity_graph::{GraphFile, compile, text_of};
use asperity_node::{ParamKind, ParamValue, Registry};

use crate::file::beside;
use crate::hear::over;
use crate::knob::has;
use crate::run::Order;
use crate::setting::{Base, Setting, fnv};
use crate::stroke::{Stroke, StrokeDecl};

/// Names of a setting's parts.
#[derive(Clone, Debug)]
pub(crate) struct Names {
    /// Accuracy and lag.
    pub figures: String,
    /// Hard cases.
    pub cases: String,
    /// Times, by the ratio to this default.
    pub times: String,
}

/// Names of the parts of all settings, the first of which is the default that all others are timed with.
pub(crate) fn names(
    order: &Order<'_>,
    settings: &[Setting],
    played: &[Stroke],
    materials: &[Option<String>],
) -> Vec<Names> {
    let study = order.study;
    let program = format!("{} {}", order.program, order.machine.cpu);
    let strokes: Vec<String> = study.strokes.iter().map(stroke).collect();
    // How large they are made hangs on all graphs.
    let made: Vec<Option<f64>> = played.iter().map(|s| s.made_mm).collect();
    let plan = format!("{} {} {} {strokes:?} {made:?} {materials:?}", study.seed, study.draws, study.steps);
    let timed = format!("{:?} {:?} {:?}", study.times, materials.first(), order.machine);
    let mut files = Files::default();
    let mut default = None;
    let each = settings.iter().map(|setting| {
        let base = order.base(setting);
        let read = base.map_or_else(String::new, |b| files.of(setting, b, materials));
        let own = format!("{program} {} {read}", setting.key);
        let default = default.get_or_insert_with(|| own.clone());
        let name = |kind: &str, of: &str| format!("{kind}-{:016x}", fnv(&format!("{own} {of}")));
        Names {
            figures: name("figures", &plan),
            cases: name("cases", ""),
            times: name("times", &format!("{timed} {default}")),
        }
    });
    each.collect()
}

/// What tells the settings of this study, as its shards share it, from those of another.
pub(crate) fn of_all(order: &Order<'_>, settings: &[Setting]) -> String {
    let study = order.study;
    let strokes: Vec<String> = study.strokes.iter().map(stroke).collect();
    let materials: Vec<&String> = study.materials.iter().map(|(name, _)| name).collect();
    let keys: Vec<&str> = settings.iter().map(|s| s.key.as_str()).collect();
    let (seed, draws, steps, times) = (study.seed, study.draws, study.steps, study.times);
    let text = format!("{seed} {draws} {steps} {times:?} {strokes:?} {materials:?} {keys:?} {}", order.cases);
    format!("{:016x}", fnv(&text))
}

/// A stroke as the study declares it, with what is in its file.
fn stroke(decl: &StrokeDecl) -> String {
    let declared = decl.place.source.text().get(decl.place.span.start..decl.place.span.end);
    format!("{} {}", declared.unwrap_or_default(), decl.file().map(content).unwrap_or_default())
}

/// What is in a file, as a number that tells it from another; `none` of one that cannot be read.
pub fn content(path: &Path) -> String {
    std::fs::read(path).map_or_else(|_| "none".to_owned(), |bytes| of_bytes(&bytes))
}

/// FNV-1a, as [`fnv`].
pub(crate) fn of_bytes(bytes: &[u8]) -> String {
    let hash = bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3));
    format!("{hash:016x}")
}

/// What graphs read. Those whose nodes name the same files are asked once.
#[derive(Default)]
struct Files {
    read: HashMap<String, String>,
    contents: HashMap<PathBuf, String>,
}

impl Files {
    fn of(&mut self, setting: &Setting, base: &Base, materials: &[Option<String>]) -> String {
        let (named, mut all) = named(&setting.graph, &base.registry);
        if let Some(known) = self.read.get(&named) {
            return known.clone();
        }
        all.extend(base.plugins.iter().cloned());
        let material = materials.first().and_then(|m| m.as_deref());
        let graph = over(&setting.graph, &base.registry, material, setting.graph.seed);
        // One that does not compile is tried again anyway: errors are not kept.
        if let Ok(compiled) = compile(&graph, &base.registry, Default::default()) {
            for node in &compiled.schedule.nodes {
                all.extend(node.params.iter().filter_map(|(_, value)| match value {
                    ParamValue::File(path) => Some(path.clone()),
                    _ => None,
                }));
                all.extend(node.files.iter().cloned());
            }
        }
        all.sort();
        all.dedup();
        let mut contents = String::new();
        for path in all {
            let known = self.contents.entry(path).or_insert_with_key(|path| content(path));
            contents += known;
            contents.push(' ');
        }
        self.read.insert(named, contents.clone());
        contents
    }
}

/// What nodes name that may be files, and from where; and those that are.
fn named(graph: &GraphFile, registry: &Registry) -> (String, Vec<PathBuf>) {
    let (mut text, mut files) = (String::new(), Vec::new());
    for node in &graph.nodes {
        for param in &node.params {
            if matches!(has(registry, &node.kind, &param.name), Some(ParamKind::File | ParamKind::Text)) {
                let from = param.value.place();
                text += &format!("{} {} {};", node.kind, text_of(&param.value), from.source.path().display());
                files.extend(beside(&param.value).ok().filter(|path| path.is_file()));
            }
        }
    }
    (text, files)
}
