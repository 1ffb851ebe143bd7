//! Runs a trade-off, from its settings to its results.

use std::collections::{BTreeMap, HashMap};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard, PoisonError};

use asperity_checks::{Stop, Subject};
use asperity_data::made::Ground;
use asperity_diagnostics::Diagnostic;
use asperity_graph::{GraphFile, NodeDecl};
use asperity_node::{Registry, Role, random};
use asperity_surfaces::topography::made_surfaces;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::accuracy::{Truth, Truths};
use crate::digest;
use crate::figure::Figures;
use crate::noise;
use crate::prepare::Prepared;
use crate::progress::Progress;
use crate::results::{Fragment, Results, Row, VERSION};
use crate::setting::{LoadedGraph, Setting};
use crate::stroke::Known;
use crate::time::{Batch, Monitor, batch};

/// Pieces of a surface in each draw of the ground truth, and places on each where a stroke begins.
const PIECES: u64 = 2;
const PLACES: usize = 2;

/// A finished part.
#[derive(Serialize, Deserialize)]
enum Part {
    Setting(Outcome),
    Batch(Batch),
}

/// A measured setting without its times, and the figures of the network's own magnitudes.
type Outcome = (Box<Row>, Figures);

impl Prepared<'_> {
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
        let known = self.settings.iter().filter_map(|s| outcomes.get(&s.key));
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

    fn base(&self, setting: &Setting) -> Result<&LoadedGraph, Diagnostic> {
        let base = self.job.base(setting).or(self.job.bases.first());
        base.ok_or_else(|| Diagnostic::new("no graph is given"))
    }

    /// Measures accuracy and hard cases of the settings without an outcome, until the run is to stop.
    fn measure_all(
        &self,
        outcomes: &mut HashMap<String, Outcome>,
        progress: &mut Progress,
        monitor: &dyn Monitor,
    ) -> Result<(), Diagnostic> {
        let left: Vec<&Setting> = self.settings.iter().filter(|s| !outcomes.contains_key(&s.key)).collect();
        let truths = if left.is_empty() {
            Truths::new()
        } else {
            monitor.doing("physics");
            self.truths(monitor)?
        };
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
                Err(e) => (Box::new(Row { error: Some(e.to_string()), ..self.row(setting) }), Figures::new()),
                Ok(Some(outcome)) => match locked(&progress).put(&Part::Setting(outcome))? {
                    Part::Setting(outcome) => outcome,
                    Part::Batch(_) => return Ok(()),
                },
            };
            locked(&all).insert(setting.key.clone(), outcome);
            Ok(())
        })
    }

    /// A row before anything is measured.
    fn row(&self, s: &Setting) -> Row {
        let base = self.job.bases.get(s.base);
        let mut fails = BTreeMap::new();
        if !s.guards {
            let why =
                "guards are off: this can only be measured, since no graph or command can turn them off";
            fails.insert("guards".into(), why.into());
        }
        let fewer_cards = |base: &LoadedGraph| {
            let plays = |n: &&NodeDecl| base.registry.role(&n.kind) == Some(Role::AudioOutput);
            let cards = |g: &GraphFile| g.nodes.iter().filter(plays).count();
            cards(&base.graph) > cards(&s.graph)
        };
        if base.is_some_and(fewer_cards) {
            let why = "the limiter before the coil is gone: nothing is played without one";
            fails.insert("limiter".into(), why.into());
        }
        Row {
            name: s.name.clone(),
            key: s.key.clone(),
            graph: base.map_or_else(|| s.graph.source.path().display().to_string(), |b| b.name.clone()),
            turned: s.turned.clone(),
            grids: s.grids.clone(),
            default: s.default,
            baseline: s.baseline,
            tick_hz: s.graph.tick_hz,
            fragment: base.map_or_else(Fragment::default, |b| Fragment::between(b, &s.graph)),
            fails,
            ..Row::default()
        }
    }

    /// Measures a setting; none where the run is to stop.
    fn measure(
        &self,
        setting: &Setting,
        truths: &Truths,
        monitor: &dyn Monitor,
    ) -> Result<Option<Outcome>, Diagnostic> {
        let registry = &self.base(setting)?.registry;
        let mut row = Box::new(self.row(setting));
        let model = self.accuracy(&mut row, setting, registry, truths, monitor)?;
        let Some(model) = model else { return Ok(None) };
        let mut subject = Subject::new(registry.clone());
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
        let Some(anchor) = self.settings.first() else { return Ok(()) };
        let timed = |key: &String| batches.iter().any(|b| b.rows.iter().any(|(timed, _)| timed == key));
        let runs = |key: &String| outcomes.get(key).is_some_and(|(row, _)| row.error.is_none());
        let left: Vec<&Setting> = self.settings.iter().filter(|s| runs(&s.key) && !timed(&s.key)).collect();
        let material = self.materials.first().and_then(|m| m.as_deref());
        let times = self.job.tradeoff.times;
        for some in left.chunks(times.batch.max(1)) {
            let with = some.iter().map(|s| Ok((*s, &self.base(s)?.registry)));
            let with = with.collect::<Result<Vec<(&Setting, &Registry)>, Diagnostic>>()?;
            let anchor = (anchor, &self.base(anchor)?.registry);
            let Some(batch) = batch(anchor, &with, material, times, monitor)? else { break };
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
