//! What is to be run: a study and its graphs, looked at once before anything is.

use std::path::Path;

use asperity_checks::Case;
use asperity_diagnostics::Diagnostic;

use crate::digest::{self, Names};
use crate::file::Study;
use crate::hear::{is_network, know};
use crate::result::Machine;
use crate::setting::{Base, Setting, Settings};
use crate::spot;
use crate::stroke::Stroke;

/// What is to be run, and how.
#[derive(Debug)]
pub struct Order<'a> {
    /// The study.
    pub study: &'a Study,
    /// Graphs whose knobs are turned; at least one.
    pub bases: &'a [Base],
    /// Graphs that stand beside.
    pub marks: &'a [Base],
    /// Threads for everything but times.
    pub jobs: usize,
    /// Which part of how many, from 0: a setting is in the part of its number. The first default is in all.
    pub shard: (usize, usize),
    /// Where finished parts are kept.
    pub folder: &'a Path,
    /// What runs it.
    pub machine: Machine,
    /// What tells this program from another build of it: parts that another one kept are not taken.
    pub program: &'a str,
    /// Whether settings are put to the hard cases.
    pub cases: bool,
}

impl Order<'_> {
    /// All graphs.
    fn graphs(&self) -> impl Iterator<Item = &Base> {
        self.bases.iter().chain(self.marks)
    }

    /// What a setting was made of.
    pub(crate) fn base(&self, setting: &Setting) -> Option<&Base> {
        self.bases.get(setting.base).or_else(|| self.marks.iter().find(|m| m.name == setting.name))
    }

    /// The study's materials, with those of its recordings, where any graph has a network to give them to.
    fn materials(&self, notes: &mut Vec<String>) -> Vec<Option<String>> {
        let of = |b: &Base| b.graph.nodes.iter().any(|n| is_network(&b.registry, &n.kind));
        let recorded = self.study.strokes.iter().filter_map(|s| s.material.as_ref());
        let mut names: Vec<&String> = Vec::new();
        for (name, _) in self.study.materials.iter().chain(recorded) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        if names.is_empty() || !self.bases.iter().any(of) {
            if !names.is_empty() {
                notes.push(
                    "no graph has a node with a `library` and a `material`: each keeps its own textures"
                        .into(),
                );
            }
            return vec![None];
        }
        names.into_iter().cloned().map(Some).collect()
    }
}

/// An order whose graphs, strokes and files were looked at.
#[derive(Debug)]
pub struct Prepared<'a> {
    pub(crate) order: &'a Order<'a>,
    /// Settings of this shard; all of them where there are no others.
    pub(crate) settings: Vec<Setting>,
    /// Names of their parts.
    pub(crate) names: Vec<Names>,
    /// What tells the study from another; the same in all of its shards.
    pub(crate) digest: String,
    pub(crate) strokes: Vec<Stroke>,
    /// Materials; one of no name where graphs have their own.
    pub(crate) materials: Vec<Option<String>>,
    /// The hard cases that settings are put to.
    pub(crate) cases: Vec<&'static Case>,
    pub(crate) notes: Vec<String>,
}

impl<'a> Prepared<'a> {
    /// Looks at a study, its graphs and all files that they read.
    ///
    /// # Errors
    /// What is wrong with the study or its graphs and shows before anything runs: a knob that no graph has, a material that no library has, a stroke that
    /// cannot be read or has no room.
    pub fn new(order: &'a Order<'a>) -> Result<Self, Diagnostic> {
        let study = order.study;
        let recorded = study.strokes.iter().filter_map(|s| s.material.as_ref());
        for graph in order.graphs() {
            know(&graph.graph, &graph.registry, study.materials.iter().chain(recorded.clone()))?;
        }
        let Settings { all, left_out } = Settings::new(study, order.bases, order.marks)?;
        let mut notes: Vec<String> =
            left_out.iter().map(|(what, why)| format!("`{what}` is left out: {why}")).collect();
        let strokes = spot::strokes(study, order.graphs(), &mut notes)?;
        let materials = order.materials(&mut notes);
        let read = digest::read(order, &all, &materials);
        let digest = digest::of_all(order, &all, &read);
        let (shard, of) = order.shard;
        let here = |number: usize| number == 0 || number % of.max(1) == shard;
        let (settings, read): (Vec<Setting>, Vec<_>) = all
            .into_iter()
            .zip(read)
            .enumerate()
            .filter(|(number, _)| here(*number))
            .map(|(_, setting)| setting)
            .unzip();
        let names = digest::names(order, &settings, &read, &strokes, &materials);
        let cases = asperity_checks::cases().into_iter().filter(|c| c.of_graph && order.cases).collect();
        Ok(Self { order, settings, names, digest, strokes, materials, cases, notes })
    }

    /// How many [parts](crate::Onlooker::advanced) a run has: of accuracy and hard cases, and of times.
    pub fn parts(&self) -> (u64, u64) {
        let settings = self.settings.len() as u64;
        let times = self.order.study.times;
        let batches = settings.div_ceil(times.batch as u64);
        (settings * (self.renders() + self.cases.len() as u64), batches * times.turns as u64)
    }

    /// What a person should know of how the study is taken, before it is: knobs and kinds of nodes that are left out, strokes that are made smaller.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// How many renders each setting takes, and measurements of its lag.
    pub(crate) fn renders(&self) -> u64 {
        let study = self.order.study;
        let over =
            |m: &Option<String>| study.strokes.iter().filter(|s| s.goes_over(m.as_deref())).count() as u64;
        study.draws * (self.materials.iter().map(over).sum::<u64>() + 1)
    }
}
