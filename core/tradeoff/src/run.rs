//! Runs a trade-off, from its settings to its results.

use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

use asperity_checks::{Case, Stop, Subject};
use asperity_data::made::Ground;
use asperity_diagnostics::{Diagnostic, Place};
use asperity_node::random;
use asperity_surfaces::topography::made_surfaces;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::accuracy::{Truth, Truths};
use crate::chain::{check_materials, is_network};
use crate::digest;
use crate::figure::Figures;
use crate::file::Tradeoff;
use crate::noise;
use crate::patch;
use crate::progress::Progress;
use crate::results::{Machine, Results, Row, VERSION};
use crate::setting::{LoadedGraph, Setting, Settings};
use crate::stroke::{Known, Stroke};
use crate::time::{Batch, Monitor, batch};

/// Pieces of a surface in each draw of the ground truth, and places on each where a stroke begins.
const PIECES: u64 = 2;
const PLACES: usize = 2;

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

/// A job whose graphs, strokes and files were checked.
#[derive(Debug)]
pub struct Prepared<'a> {
    pub(crate) job: &'a Job<'a>,
    /// Settings of this shard.
    settings: Vec<Setting<'a>>,
    /// Digest of the whole trade-off, the same in all shards.
    digest: String,
    pub(crate) strokes: Vec<Stroke>,
    /// Materials; one without a name where graphs have their own.
    pub(crate) materials: Vec<Option<String>>,
    cases: Vec<&'static Case>,
    notes: Vec<String>,
}

/// A finished part.
#[derive(Serialize, Deserialize)]
enum Part {
    Setting(Outcome),
    Batch(Batch),
}

/// A measured setting without its times, and the figures of the network's own magnitudes.
type Outcome = (Box<Row>, Figures);

impl<'a> Prepared<'a> {
    /// Checks a trade-off, its graphs and all files that they read.
    ///
    /// # Errors
    /// A knob that no graph has, a material that no library has, a stroke that cannot be read or does not
    /// fit.
    pub fn new(job: &'a Job<'a>) -> Result<Self, Diagnostic> {
        let tradeoff = job.tradeoff;
        let recorded = tradeoff.strokes.iter().filter_map(|s| s.material.as_ref());
        let named: Vec<&(String, Place)> = tradeoff.materials.iter().chain(recorded).collect();
        let graphs = || job.bases.iter().chain(job.baselines);
        for graph in graphs() {
            check_materials(graph, &named)?;
        }
        let Settings { all, left_out, .. } = Settings::new(tradeoff, job.bases, job.baselines)?;
        let mut notes: Vec<String> =
            left_out.iter().map(|(what, why)| format!("`{what}` is left out: {why}")).collect();
        let strokes = patch::strokes(tradeoff, graphs(), &mut notes)?;
        let mut materials: Vec<Option<String>> = Vec::new();
        for (name, _) in named {
            if !materials.iter().flatten().any(|known| known == name) {
                materials.push(Some(name.clone()));
            }
        }
        let has_network = |b: &LoadedGraph| b.graph.nodes.iter().any(|n| is_network(&b.registry, &n.kind));
        if !materials.is_empty() && !job.bases.iter().any(has_network) {
            let why = "no graph has a node with a `library` and a `material`: each keeps its own textures";
            notes.push(why.into());
            materials.clear();
        }
        if materials.is_empty() {
            materials.push(None);
        }
        let digest = digest::of_all(job, &all, materials[0].as_deref());
        let (shard, of) = job.shard;
        let here = |number: usize| number == 0 || number % of.max(1) == shard;
        let settings = all.into_iter().enumerate().filter(|(number, _)| here(*number));
        let settings = settings.map(|(_, setting)| setting).collect();
        let cases = asperity_checks::cases().into_iter().filter(|c| c.of_graph && job.cases).collect();
        Ok(Self { job, settings, digest, strokes, materials, cases, notes })
    }

    /// Counts of [parts](crate::Monitor::advanced): of accuracy with hard cases, and of times.
    pub fn parts(&self) -> (u64, u64) {
        let settings = self.settings.len() as u64;
        let times = self.job.tradeoff.times;
        (settings * self.parts_of_setting(), settings.div_ceil(times.batch as u64) * times.turns as u64)
    }

    /// Renders, lag measurements and hard cases of a setting.
    fn parts_of_setting(&self) -> u64 {
        let over =
            |m: &Option<String>| self.strokes.iter().filter(|s| s.goes_over(m.as_deref())).count() as u64;
        let renders = self.job.tradeoff.draws * (self.materials.iter().map(over).sum::<u64>() + 1);
        renders + self.cases.len() as u64
    }

    /// Warnings: parts that are left out, and strokes that are shrunk.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Runs the trade-off. After a stop, the results have the settings that are finished.
    ///
    /// # Errors
    /// A file that cannot be written, another run in the same folder. A setting that does not run is a row
    /// with its error.
    pub fn run(&self, monitor: &dyn Monitor) -> Result<Results, Diagnostic> {
        let (job, tradeoff) = (self.job, self.job.tradeoff);
        let depends_on = format!("{} {} {:?} {:?}", self.digest, job.program, job.machine, job.shard);
        let (mut progress, parts) = Progress::open(job.folder, &digest::of_bytes(depends_on.as_bytes()))?;
        let (mut outcomes, mut batches) = (HashMap::new(), Vec::new());
        for part in parts {
            match part {
                Part::Setting(outcome) => drop(outcomes.insert(outcome.0.key.clone(), outcome)),
                Part::Batch(batch) => batches.push(batch),
            }
        }
        self.measure_all(&mut outcomes, &mut progress, monitor)?;
        self.time_all(&outcomes, &mut batches, &mut progress, monitor)?;
        let known = self.settings.iter().filter_map(|s| outcomes.get(&s.row.key));
        let mut rows: Vec<Row> = known.clone().map(|(row, _)| (**row).clone()).collect();
        noise::put_times(&mut rows, &batches);
        let model = known.clone().find(|(row, _)| row.default).map(|(_, model)| model.clone());
        let mut results = Results {
            version: VERSION,
            tradeoff: tradeoff.source.path().display().to_string(),
            digest: self.digest.clone(),
            seed: tradeoff.seed,
            strokes: self.strokes.iter().map(|s| format!("{} ({} s)", s.name, s.seconds)).collect(),
            materials: self.materials.iter().flatten().cloned().collect(),
            machines: vec![job.machine.clone()],
            shards: vec![(job.shard.0 + 1, job.shard.1.max(1))],
            unfinished: self.settings.len() - rows.iter().filter(|r| r.is_finished()).count(),
            cases: self.cases.len(),
            model: model.unwrap_or_default(),
            idle: noise::idle(&batches),
            notes: self.notes.clone(),
            rows,
            ..Results::default()
        };
        noise::find_floors(&mut results);
        Ok(results)
    }

    /// Measures accuracy and hard cases of the settings without an outcome, until the run is to stop.
    fn measure_all(
        &self,
        outcomes: &mut HashMap<String, Outcome>,
        progress: &mut Progress,
        monitor: &dyn Monitor,
    ) -> Result<(), Diagnostic> {
        let left: Vec<_> = self.settings.iter().filter(|s| !outcomes.contains_key(&s.row.key)).collect();
        let mut truths = Truths::new();
        if !left.is_empty() {
            monitor.doing("physics");
            truths = self.truths(monitor)?;
        }
        monitor.doing("accuracy");
        monitor.advanced((self.settings.len() - left.len()) as u64 * self.parts_of_setting());
        let (all, progress) = (Mutex::new(outcomes), Mutex::new(progress));
        on_threads(&left, self.job.jobs, monitor, |setting| {
            // A node may panic during preparation, where the engine does not contain it.
            let measured = catch_unwind(AssertUnwindSafe(|| self.measure(setting, &truths, monitor)))
                .unwrap_or_else(|_| Err(Diagnostic::new("it panicked while it was prepared")));
            let outcome = match measured {
                Ok(None) => return Ok(()),
                // An error is not kept, since its cause may be repaired.
                Err(e) => {
                    (Box::new(Row { error: Some(e.to_string()), ..setting.row.clone() }), Figures::new())
                }
                Ok(Some(outcome)) => match locked(&progress).put(&Part::Setting(outcome))? {
                    Part::Setting(outcome) => outcome,
                    Part::Batch(_) => return Ok(()),
                },
            };
            locked(&all).insert(setting.row.key.clone(), outcome);
            Ok(())
        })
    }

    /// Measures a setting; none where the run is to stop.
    fn measure(
        &self,
        setting: &Setting<'_>,
        truths: &Truths,
        monitor: &dyn Monitor,
    ) -> Result<Option<Outcome>, Diagnostic> {
        let mut row = Box::new(setting.row.clone());
        let model = self.accuracy(&mut row, setting, truths, monitor)?;
        let Some(model) = model else { return Ok(None) };
        let mut subject = Subject::new(setting.base.registry.clone());
        subject.graph = Some(&setting.graph);
        for case in &self.cases {
            if monitor.stopped() {
                return Ok(None);
            }
            let found = catch_unwind(AssertUnwindSafe(|| case.run(&subject)));
            let found = found.unwrap_or_else(|_| Err(Stop::Failed("it panicked".into())));
            row.cases += usize::from(!matches!(found, Err(Stop::NotApplicable(_))));
            if let Err(Stop::Failed(why)) = found {
                row.fails.insert(case.name.to_owned(), why);
            }
            monitor.advanced(1);
        }
        Ok(Some((row, model)))
    }

    /// Times the settings that run and are in no batch yet, until the run is to stop.
    fn time_all(
        &self,
        outcomes: &HashMap<String, Outcome>,
        batches: &mut Vec<Batch>,
        progress: &mut Progress,
        monitor: &dyn Monitor,
    ) -> Result<(), Diagnostic> {
        monitor.doing("times");
        let timed = |key: &String| batches.iter().any(|b| b.rows.iter().any(|(timed, _)| timed == key));
        let runs = |key: &String| outcomes.get(key).is_some_and(|(row, _)| row.error.is_none());
        let is_left = |s: &&Setting<'_>| runs(&s.row.key) && !timed(&s.row.key);
        let left: Vec<&Setting<'_>> = self.settings.iter().filter(is_left).collect();
        let times = self.job.tradeoff.times;
        for some in left.chunks(times.batch.max(1)) {
            let material = self.materials[0].as_deref();
            let Some(batch) = batch(&self.settings[0], some, material, times, monitor)? else { break };
            if let Part::Batch(batch) = progress.put(&Part::Batch(batch))? {
                batches.push(batch);
            }
        }
        Ok(())
    }

    /// Ground truths of all strokes over the materials that are made surfaces.
    fn truths(&self, monitor: &dyn Monitor) -> Result<Truths, Diagnostic> {
        let tradeoff = self.job.tradeoff;
        let all = made_surfaces();
        let surface = |name: &String| all.iter().find(|s| s.name == *name);
        let known = self.materials.iter().flatten().filter_map(surface);
        let draws = |surface| (0..tradeoff.draws).map(move |draw| (surface, draw));
        let wanted: Vec<_> = known.flat_map(draws).collect();
        let truths = Mutex::new(Truths::new());
        on_threads(&wanted, self.job.jobs, monitor, |&(surface, draw)| {
            let seed = |number: u64| random::bits(tradeoff.seed.wrapping_add(draw), number);
            let pieces: Vec<Ground> = (0..PIECES).map(|piece| Ground::new(surface, seed(piece))).collect();
            for (s, stroke) in self.strokes.iter().enumerate() {
                let Known::Hand(hand) = &stroke.known else { continue };
                let mut truth = Truth::default();
                for (number, piece) in (0..).zip(pieces.iter().flat_map(|piece| [piece; PLACES])) {
                    let felt = piece.felt(hand, seed(PIECES + number));
                    // A stroke too short for a spectrogram has no truth.
                    let _ = truth.add(&felt.axes(), felt.rate_hz);
                }
                locked(&truths).insert((s, surface.name.clone(), draw), truth);
            }
            Ok(())
        })?;
        Ok(truths.into_inner().unwrap_or_default())
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Calls a function for each item, on so many threads, until the first error or until the run is to stop.
fn on_threads<T: Sync>(
    all: &[T],
    threads: usize,
    monitor: &dyn Monitor,
    each: impl Fn(&T) -> Result<(), Diagnostic> + Sync,
) -> Result<(), Diagnostic> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.max(1)).build();
    let pool = pool.map_err(|e| Diagnostic::new(format!("no threads: {e}")))?;
    let each = |item| if monitor.stopped() { Ok(()) } else { each(item) };
    pool.install(|| all.par_iter().with_max_len(1).try_for_each(each))
}
