//! A trade-off with its graphs, checked before anything is measured.

use std::path::Path;

use asperity_checks::Case;
use asperity_diagnostics::{Diagnostic, Place};

use crate::chain::{check_materials, is_network};
use crate::digest;
use crate::file::Tradeoff;
use crate::patch;
use crate::results::Machine;
use crate::setting::{LoadedGraph, Setting, Settings};
use crate::stroke::Stroke;

/// A run of a trade-off, as it is asked for.
#[derive(Debug)]
pub struct Job<'a> {
    /// The trade-off.
    pub tradeoff: &'a Tradeoff,
    /// Graphs whose settings are varied; at least one.
    pub bases: &'a [LoadedGraph],
    /// Graphs that are measured unchanged.
    pub baselines: &'a [LoadedGraph],
    /// Threads for everything but times.
    pub jobs: usize,
    /// Number of this shard, from 0, and count of shards. Settings are dealt out in turn; the first default
    /// is in every shard.
    pub shard: (usize, usize),
    /// Folder of finished parts.
    pub folder: &'a Path,
    /// The machine.
    pub machine: Machine,
    /// Digest of this program: parts of another build are measured again.
    pub program: &'a str,
    /// Whether settings are put to the hard cases.
    pub cases: bool,
}

impl Job<'_> {
    pub(crate) fn graphs(&self) -> impl Iterator<Item = &LoadedGraph> {
        self.bases.iter().chain(self.baselines)
    }

    /// The graph of a setting.
    pub(crate) fn base(&self, setting: &Setting) -> Option<&LoadedGraph> {
        self.bases.get(setting.base).or_else(|| self.baselines.iter().find(|b| b.name == setting.name))
    }

    /// Materials that the trade-off and its recordings name.
    fn named(&self) -> impl Iterator<Item = &(String, Place)> + Clone {
        let recorded = self.tradeoff.strokes.iter().filter_map(|s| s.material.as_ref());
        self.tradeoff.materials.iter().chain(recorded)
    }

    /// Materials, each once; none where no graph has a network.
    fn materials(&self, notes: &mut Vec<String>) -> Vec<Option<String>> {
        let mut names: Vec<Option<String>> = Vec::new();
        for name in self.named().map(|(name, _)| Some(name.clone())) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        let has_network = |b: &LoadedGraph| b.graph.nodes.iter().any(|n| is_network(&b.registry, &n.kind));
        if names.is_empty() {
            return vec![None];
        }
        if !self.bases.iter().any(has_network) {
            notes.push(
                "no graph has a node with a `library` and a `material`: each keeps its own textures".into(),
            );
            return vec![None];
        }
        names
    }
}

/// A job whose graphs, strokes and files were checked.
#[derive(Debug)]
pub struct Prepared<'a> {
    pub(crate) job: &'a Job<'a>,
    /// Settings of this shard.
    pub(crate) settings: Vec<Setting>,
    /// Digest of the whole trade-off, the same in all shards.
    pub(crate) digest: String,
    pub(crate) strokes: Vec<Stroke>,
    /// Materials; one without a name where graphs have their own.
    pub(crate) materials: Vec<Option<String>>,
    pub(crate) cases: Vec<&'static Case>,
    pub(crate) notes: Vec<String>,
}

impl<'a> Prepared<'a> {
    /// Checks a trade-off, its graphs and all files that they read.
    ///
    /// # Errors
    /// A knob that no graph has, a material that no library has, a stroke that cannot be read or does not
    /// fit.
    pub fn new(job: &'a Job<'a>) -> Result<Self, Diagnostic> {
        let tradeoff = job.tradeoff;
        for graph in job.graphs() {
            check_materials(&graph.graph, &graph.registry, job.named())?;
        }
        let Settings { all, left_out, .. } = Settings::new(tradeoff, job.bases, job.baselines)?;
        let mut notes: Vec<String> =
            left_out.iter().map(|(what, why)| format!("`{what}` is left out: {why}")).collect();
        let strokes = patch::strokes(tradeoff, job.graphs(), &mut notes)?;
        let materials = job.materials(&mut notes);
        let digest = digest::of_all(job, &all, materials.first().and_then(|m| m.as_deref()));
        let (shard, of) = job.shard;
        let here = |number: usize| number == 0 || number % of.max(1) == shard;
        let settings =
            all.into_iter().enumerate().filter(|(number, _)| here(*number)).map(|(_, s)| s).collect();
        let cases = asperity_checks::cases().into_iter().filter(|c| c.of_graph && job.cases).collect();
        Ok(Self { job, settings, digest, strokes, materials, cases, notes })
    }

    /// Counts of [parts](crate::Monitor::advanced): of accuracy with hard cases, and of times.
    pub fn parts(&self) -> (u64, u64) {
        let settings = self.settings.len() as u64;
        let times = self.job.tradeoff.times;
        let batches = settings.div_ceil(times.batch as u64);
        (settings * self.parts_of_setting(), batches * times.turns as u64)
    }

    /// Renders, lag measurements and hard cases of a setting.
    pub(crate) fn parts_of_setting(&self) -> u64 {
        let over =
            |m: &Option<String>| self.strokes.iter().filter(|s| s.goes_over(m.as_deref())).count() as u64;
        let renders = self.job.tradeoff.draws * (self.materials.iter().map(over).sum::<u64>() + 1);
        renders + self.cases.len() as u64
    }

    /// Warnings: what is left out, and which strokes are shrunk.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
}
