//! A study from its settings to its results.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use asperity_checks::{Effort, Subject, Verdict};
use asperity_data::made::Ground;
use asperity_diagnostics::Diagnostic;
use asperity_graph::GraphFile;
use asperity_node::{Registry, random};
use asperity_surfaces::topography::made_surfaces;
use serde::{Deserialize, Serialize};

use crate::accuracy::{Found, Plan, find};
use crate::digest::{self, Names};
use crate::figure::mean;
use crate::file::Study;
use crate::floor;
use crate::keep::Kept;
use crate::order::{Order, Prepared};
use crate::result::{Fragment, Results, Row, VERSION};
use crate::setting::{Base, Setting};
use crate::stroke::{Known, Stroke};
use crate::time::{Batch, Onlooker, batch};
use crate::truth::{Truth, Truths};

/// Pieces of a surface that each draw of the physics is of, and places on each that a stroke begins at.
const PIECES: u64 = 2;
const PLACES: usize = 2;

/// How accurate a setting is, or why it cannot be run.
#[derive(Clone, Debug, Serialize, Deserialize)]
enum Heard {
    Found(Found),
    Error(String),
}

/// Hard cases of a setting: how many it was put to, and those that do not hold.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Cases {
    count: usize,
    fails: BTreeMap<String, String>,
}

/// What is known of a setting but its times.
#[derive(Clone, Debug, Default)]
struct Part {
    heard: Option<Heard>,
    cases: Option<Cases>,
}

impl Part {
    /// Whether there is nothing left to do for it.
    fn is_finished(&self, order: &Order<'_>) -> bool {
        match &self.heard {
            None => false,
            Some(Heard::Error(_)) => true,
            Some(Heard::Found(_)) => self.cases.is_some() || !order.cases,
        }
    }

    fn found(&self) -> Option<&Found> {
        match &self.heard {
            Some(Heard::Found(found)) => Some(found),
            _ => None,
        }
    }
}

impl Prepared<'_> {
    /// Runs the study. Where the user asks to stop, results have all that is finished, now or earlier.
    ///
    /// # Errors
    /// What cannot be written; another run that keeps its parts in the same folder. A setting that cannot
    /// be run is a row that says why.
    pub fn run(&self, onlooker: &dyn Onlooker) -> Result<Results, Diagnostic> {
        let (order, study) = (self.order, self.order.study);
        let kept = Kept::open(order.folder)?;
        let work = Work { prepared: self, onlooker, kept: &kept };
        let parts = work.parts()?;
        onlooker.doing("times");
        let batches = work.times(&parts)?;
        let mut rows = Vec::new();
        let mut models = Vec::new();
        for (s, part) in self.settings.iter().zip(&parts).filter(|(_, part)| part.is_finished(order)) {
            if s.default && models.is_empty() {
                models.extend(part.found().map(|f| f.model.clone()));
            }
            rows.push(row(order, s, part));
        }
        floor::put_times(&mut rows, &batches);
        let finished = rows.iter().filter(|r| r.is_finished()).count();
        if finished == self.settings.len() && order.cases {
            tidy(&kept, &self.names)?;
        }
        let mut results = Results {
            version: VERSION,
            study: study.source.path().display().to_string(),
            digest: self.digest.clone(),
            seed: study.seed,
            strokes: self.strokes.iter().map(|s| format!("{} ({} s)", s.name, s.seconds)).collect(),
            materials: self.materials.iter().flatten().cloned().collect(),
            machines: vec![order.machine.clone()],
            shards: vec![(order.shard.0 + 1, order.shard.1.max(1))],
            unfinished: self.settings.len() - finished,
            cases: self.cases.len(),
            floor: Default::default(),
            lag_floor_ms: None,
            load_floor: None,
            model: mean(models.iter()),
            empty: floor::empty(&batches),
            notes: self.notes.clone(),
            rows,
        };
        floor::find(&mut results);
        Ok(results)
    }
}

/// What all that is done for settings has in common.
#[derive(Clone, Copy)]
struct Work<'a> {
    prepared: &'a Prepared<'a>,
    onlooker: &'a dyn Onlooker,
    kept: &'a Kept,
}

impl Work<'_> {
    fn base(&self, setting: &Setting) -> Result<&Base, Diagnostic> {
        let order = self.prepared.order;
        let base = order.base(setting).or(order.bases.first());
        base.ok_or_else(|| Diagnostic::new("there is no graph to study"))
    }

    /// Says which kept parts are not as they were written.
    fn tell_spoiled(&self) {
        for file in self.kept.spoiled() {
            self.onlooker.spoiled(&file);
        }
    }

    /// Accuracy and hard cases of all settings: what is kept is taken, and what is new is kept.
    fn parts(&self) -> Result<Vec<Part>, Diagnostic> {
        let Prepared { order, strokes, materials, names, .. } = self.prepared;
        let (study, onlooker) = (order.study, self.onlooker);
        let kept = |names: &Names| Part {
            heard: self.kept.get(&names.figures).map(Heard::Found),
            cases: self.kept.get(&names.cases).filter(|_| order.cases),
        };
        let parts: Vec<Part> = names.iter().map(kept).collect();
        self.tell_spoiled();
        let left: Vec<usize> = (0..parts.len()).filter(|&i| !parts[i].is_finished(order)).collect();
        let truths = if left.iter().any(|&i| parts[i].heard.is_none()) {
            onlooker.doing("the physics");
            truths(study, strokes, materials, order.jobs, onlooker)?
        } else {
            Truths::default()
        };
        let plan = Plan {
            strokes,
            materials,
            draws: study.draws,
            seed: study.seed,
            steps: study.steps,
            truths: &truths,
        };
        onlooker.doing("accuracy");
        let (each, cases) = (self.prepared.renders(), self.prepared.cases.len() as u64);
        for part in &parts {
            let heard = if part.heard.is_some() { each } else { 0 };
            onlooker.advanced(heard + if part.cases.is_some() { cases } else { 0 });
        }
        let parts = Mutex::new(parts);
        on_several(&left, order.jobs, onlooker, |&i| {
            let mut part = parts.lock().map_or_else(|_| Part::default(), |parts| parts[i].clone());
            self.finish(i, &mut part, &plan)?;
            if let Ok(mut parts) = parts.lock() {
                parts[i] = part;
            }
            Ok(())
        })?;
        Ok(parts.into_inner().unwrap_or_default())
    }

    /// What is left to do for a setting, unless the user asks to stop.
    fn finish(&self, number: usize, part: &mut Part, plan: &Plan<'_>) -> Result<(), Diagnostic> {
        let (setting, names) = (&self.prepared.settings[number], &self.prepared.names[number]);
        let registry = &self.base(setting)?.registry;
        if part.heard.is_none() {
            // A node may panic while it is prepared, where nothing else contains it.
            let found = catch_unwind(AssertUnwindSafe(|| find(setting, registry, plan, self.onlooker)));
            // Errors are not kept: what they are about may be mended.
            part.heard = Some(match found {
                Ok(Ok(Some(found))) => Heard::Found(self.kept.put(&names.figures, &found)?),
                Ok(Ok(None)) => return Ok(()),
                Ok(Err(e)) => Heard::Error(e.to_string()),
                Err(_) => Heard::Error("it panicked while it was prepared".into()),
            });
        }
        if part.found().is_none() || part.cases.is_some() || !self.prepared.order.cases {
            return Ok(());
        }
        let subject = Subject::new(registry.clone()).graph(&setting.graph).effort(Effort::Quick);
        let mut found = Cases::default();
        for case in &self.prepared.cases {
            if self.onlooker.stopped() {
                return Ok(());
            }
            let outcome = catch_unwind(AssertUnwindSafe(|| case.run(&subject)));
            let (verdict, why) = match outcome {
                Ok(outcome) => (outcome.verdict, outcome.found),
                Err(_) => (Verdict::Fails, "it panicked".into()),
            };
            found.count += usize::from(verdict != Verdict::NotApplicable);
            if verdict == Verdict::Fails {
                found.fails.insert(case.name.to_owned(), why);
            }
            self.onlooker.advanced(1);
        }
        part.cases = Some(self.kept.put(&names.cases, &found)?);
        Ok(())
    }

    /// Times of all settings that run, in batches; those that are kept are taken from there.
    fn times(&self, parts: &[Part]) -> Result<Vec<Batch>, Diagnostic> {
        let Prepared { order, settings, names, materials, .. } = self.prepared;
        let material = materials.first().and_then(|m| m.as_deref());
        let all = || settings.iter().zip(names);
        let mut batches: Vec<Batch> = Vec::new();
        let mut known: Vec<String> = Vec::new();
        for mut batch in self.kept.all::<Batch>("batch-") {
            batch.rows.retain_mut(|(name, _)| match all().find(|(_, n)| n.times == *name) {
                Some((setting, _)) => {
                    known.push(std::mem::replace(name, setting.key.clone()));
                    true
                }
                None => false,
            });
            if !batch.rows.is_empty() {
                batches.push(batch);
            }
        }
        self.tell_spoiled();
        let Some(anchor) = settings.first() else { return Ok(batches) };
        let left: Vec<(&Setting, &Names)> = all()
            .zip(parts)
            .filter(|((_, names), part)| part.found().is_some() && !known.contains(&names.times))
            .map(|(it, _)| it)
            .collect();
        let times = order.study.times;
        for some in left.chunks(times.batch.max(1)) {
            let with = some.iter().map(|(s, _)| Ok((*s, &self.base(s)?.registry)));
            let with = with.collect::<Result<Vec<(&Setting, &Registry)>, Diagnostic>>()?;
            let anchor = (anchor, &self.base(anchor)?.registry);
            let Some(timed) = batch(anchor, &with, material, times, self.onlooker)? else { break };
            // Under names that change with what a setting depends on.
            let rows =
                some.iter().zip(&timed.rows).map(|((_, n), (_, time))| (n.times.clone(), time.clone()));
            let named = Batch { rows: rows.collect(), ..timed };
            let all: String = some.iter().map(|(_, n)| n.times.as_str()).collect();
            let name = format!("batch-{}", digest::of_bytes(all.as_bytes()));
            let mut batch = self.kept.put(&name, &named)?;
            for ((name, _), (setting, _)) in batch.rows.iter_mut().zip(some) {
                name.clone_from(&setting.key);
            }
            batches.push(batch);
        }
        Ok(batches)
    }
}

/// Removes parts that no setting of this study needs any more: all but those of these names, and batches in
/// which one of them was timed.
fn tidy(kept: &Kept, names: &[Names]) -> Result<(), Diagnostic> {
    let of = |f: fn(&Names) -> &String| names.iter().map(f).map(String::as_str).collect::<BTreeSet<_>>();
    let (figures, cases, times) = (of(|n| &n.figures), of(|n| &n.cases), of(|n| &n.times));
    kept.tidy(|name| match name.split_once('-') {
        Some(("figures", _)) => figures.contains(name),
        Some(("cases", _)) => cases.contains(name),
        Some(("batch", _)) => {
            let batch = kept.get::<Batch>(name);
            batch.is_some_and(|b| b.rows.iter().any(|(name, _)| times.contains(name.as_str())))
        }
        _ => true,
    })
}

/// The physics of all strokes over all materials that are made surfaces; nothing is known of others.
fn truths(
    study: &Study,
    strokes: &[Stroke],
    materials: &[Option<String>],
    jobs: usize,
    onlooker: &dyn Onlooker,
) -> Result<Truths, Diagnostic> {
    let all = made_surfaces();
    let surface = |name: &String| all.iter().find(|s| s.name == *name);
    let known = materials.iter().flatten().filter_map(surface);
    let wanted: Vec<_> =
        known.flat_map(|surface| (0..study.draws).map(move |draw| (surface, draw))).collect();
    let truths = Mutex::new(Truths::default());
    on_several(&wanted, jobs, onlooker, |&(surface, draw)| {
        let seed = |number: u64| random::bits(study.seed.wrapping_add(draw), number);
        let pieces: Vec<Ground> = (0..PIECES).map(|piece| Ground::new(surface, seed(piece))).collect();
        for (s, stroke) in strokes.iter().enumerate() {
            let Known::Hand(hand) = &stroke.known else { continue };
            let mut truth = Truth::default();
            for (number, piece) in (0..).zip(pieces.iter().flat_map(|piece| [piece; PLACES])) {
                let felt = piece.felt(hand, seed(PIECES + number));
                // A truth that cannot be measured is none.
                let _ = truth.add(&felt.axes(), felt.rate_hz);
            }
            if let Ok(mut truths) = truths.lock() {
                truths.insert(s, &surface.name, draw, truth);
            }
        }
        Ok(())
    })?;
    Ok(truths.into_inner().unwrap_or_default())
}

/// Does something for each of several, on so many threads; stops at the first error, or where the user asks to.
fn on_several<T: Sync>(
    all: &[T],
    jobs: usize,
    onlooker: &dyn Onlooker,
    each: impl Fn(&T) -> Result<(), Diagnostic> + Sync,
) -> Result<(), Diagnostic> {
    let next = AtomicUsize::new(0);
    let wrong: Mutex<Option<Diagnostic>> = Mutex::new(None);
    let work = || {
        while let Some(it) = all.get(next.fetch_add(1, Ordering::Relaxed)) {
            if onlooker.stopped() {
                return;
            }
            if let Err(e) = each(it) {
                next.store(all.len(), Ordering::Relaxed);
                if let Ok(mut wrong) = wrong.lock() {
                    wrong.get_or_insert(e);
                }
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..jobs.max(1) {
            scope.spawn(work);
        }
        work();
    });
    match wrong.into_inner() {
        Ok(Some(e)) => Err(e),
        _ => Ok(()),
    }
}

fn row(order: &Order<'_>, s: &Setting, part: &Part) -> Row {
    let found = part.found().cloned().unwrap_or_default();
    let error = match &part.heard {
        Some(Heard::Error(why)) => Some(why.clone()),
        _ => None,
    };
    let base = order.bases.get(s.base);
    let Cases { count, mut fails } = part.cases.clone().unwrap_or_default();
    if !s.guards {
        let why = "they are off, which is only measured: no graph and no command can have it so";
        fails.insert("guards".into(), why.into());
    }
    let cards = |g: &GraphFile| g.nodes.iter().filter(|n| n.kind == "audio_out").count();
    if base.is_some_and(|base| cards(&base.graph) > cards(&s.graph)) {
        let why =
            "what drove the coil through a limiter goes nowhere any more: nothing is played without one";
        fails.insert("limiter".into(), why.into());
    }
    let lag_ms = (!found.lags_ms.is_empty()).then(|| {
        let count = found.lags_ms.len() as f64;
        let of = |i: usize| found.lags_ms.iter().map(|l| l[i]).sum::<f64>() / count;
        [of(0), of(1), of(2)]
    });
    Row {
        name: s.name.clone(),
        key: s.key.clone(),
        graph: base.map_or_else(|| s.graph.source.path().display().to_string(), |b| b.name.clone()),
        turned: s.turned.clone(),
        grids: s.grids.clone(),
        default: s.default,
        mark: s.mark,
        tick_hz: s.graph.tick_hz,
        fragment: base.map_or_else(Fragment::default, |b| Fragment::between(b, &s.graph)),
        error,
        figures: mean(found.draws.iter()),
        lag_ms,
        lag_draws_ms: found.lags_ms.iter().map(|l| l[1]).collect(),
        draws: found.draws,
        latency_ms: found.latency_ms,
        faults: found.faults,
        cases: count,
        fails,
        time: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result::Time;

    #[test]
    fn batches_in_which_no_setting_of_the_study_was_timed_are_removed() {
        let dir = tempfile::tempdir().unwrap();
        let kept = Kept::open(dir.path()).unwrap();
        for (name, rows) in [("batch-1", &["times-1", "times-2"][..]), ("batch-2", &["times-3"])] {
            let rows = rows.iter().map(|row| ((*row).to_owned(), Ok(Time::default()))).collect();
            kept.put(name, &Batch { empty: Time::default(), anchor: Time::default(), rows }).unwrap();
        }
        kept.put("batch-3", &vec![1]).unwrap();
        let names = |n: u32| Names {
            figures: format!("figures-{n}"),
            cases: format!("cases-{n}"),
            times: format!("times-{n}"),
        };
        for name in ["figures-2", "figures-3", "cases-2", "cases-3", "other-3"] {
            kept.put(name, &1).unwrap();
        }
        tidy(&kept, &[names(2)]).unwrap();
        let there = |name: &str| dir.path().join(format!("{name}.json")).exists();
        assert!(["batch-1", "figures-2", "cases-2", "other-3"].into_iter().all(there));
        assert!(!["batch-2", "batch-3", "figures-3", "cases-3"].into_iter().any(there));
    }
}
