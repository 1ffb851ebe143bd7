//! A study from its settings to its results.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use asperity_dataset::made::Ground;
use asperity_graph::GraphFile;
use asperity_measure::accuracy::Spectrogram;
use asperity_node::{Registry, random};
use asperity_source::Diagnostic;
use asperity_stability::{Case, Effort, Subject, Verdict};
use asperity_world::topography::made_surfaces;
use serde::{Deserialize, Serialize};

use crate::accuracy::{Found, Plan, find};
use crate::digest::{self, Names};
use crate::figure::mean;
use crate::file::Study;
use crate::floor;
use crate::hear::{is_network, know};
use crate::keep::Kept;
use crate::result::{Fragment, Machine, Results, Row, VERSION};
use crate::setting::{Base, Setting, Settings};
use crate::spot;
use crate::stroke::{Known, Stroke};
use crate::time::{Batch, Onlooker, batch};
use crate::truth::Truths;

/// Pieces of a surface that each draw of the physics is of, and places on each that a stroke begins at.
const PIECES: u64 = 2;
const PLACES: usize = 2;

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

    /// The settings of this shard, all of them where there are no others, and what tells the study from another.
    fn settings(&self) -> Result<(Settings, String), Diagnostic> {
        let recorded = self.study.strokes.iter().filter_map(|s| s.material.as_ref());
        for graph in self.graphs() {
            know(&graph.graph, &graph.registry, self.study.materials.iter().chain(recorded.clone()))?;
        }
        let mut settings = Settings::new(self.study, self.bases, self.marks)?;
        let digest = digest::of_all(self, &settings.all);
        let (shard, of) = self.shard;
        let mut number = 0;
        settings.all.retain(|_| {
            number += 1;
            number == 1 || (number - 1) % of.max(1) == shard
        });
        Ok((settings, digest))
    }

    /// The hard cases that settings are put to.
    fn hard_cases(&self) -> Vec<&'static Case> {
        asperity_stability::cases().into_iter().filter(|c| c.of_graph && self.cases).collect()
    }
}

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

/// What came of a run.
#[derive(Debug)]
pub struct Ran {
    /// Results of what is finished.
    pub results: Results,
}

/// How many [parts](Onlooker::advanced) a run has: of accuracy and hard cases, and of times.
pub fn parts(order: &Order<'_>) -> Result<(u64, u64), Diagnostic> {
    let settings = order.settings()?.0.all.len() as u64;
    let each = renders(order.study, &materials(order, &mut Vec::new())) + order.hard_cases().len() as u64;
    let batches = settings.div_ceil(order.study.times.batch as u64);
    Ok((settings * each, batches * order.study.times.turns as u64))
}

/// What a person should know of how a study is taken, before it is: knobs and kinds of nodes that are left out, strokes that are made smaller.
///
/// # Errors
/// Those of [`run`] that show before anything runs.
pub fn notes(order: &Order<'_>) -> Result<Vec<String>, Diagnostic> {
    let left_out = order.settings()?.0.left_out;
    let mut notes: Vec<String> =
        left_out.iter().map(|(what, why)| format!("`{what}` is left out: {why}")).collect();
    spot::strokes(order.study, order.graphs(), &mut notes)?;
    materials(order, &mut notes);
    Ok(notes)
}

/// How many renders each setting takes, and measurements of its lag.
fn renders(study: &Study, materials: &[Option<String>]) -> u64 {
    let over = |m: &Option<String>| study.strokes.iter().filter(|s| s.goes_over(m.as_deref())).count() as u64;
    study.draws * (materials.iter().map(over).sum::<u64>() + 1)
}

/// Runs a study. Where the user asks to stop, results have all that is finished, now or earlier.
///
/// # Errors
/// What is wrong with the study or its graphs; what cannot be written; another run that keeps its parts in the same folder. A setting that cannot be run is a
/// row that says why.
pub fn run(order: &Order<'_>, onlooker: &dyn Onlooker) -> Result<Ran, Diagnostic> {
    let study = order.study;
    let (settings, digest) = order.settings()?;
    let kept = Kept::open(order.folder)?;
    let notes = notes(order)?;
    let strokes = spot::strokes(study, order.graphs(), &mut Vec::new())?;
    let materials = materials(order, &mut Vec::new());
    let names = digest::names(order, &settings.all, &strokes, &materials);
    let cases = order.hard_cases();
    let work = Work { order, onlooker, kept: &kept, settings: &settings.all, names: &names, cases: &cases };
    let parts = work.parts(&strokes, &materials)?;
    onlooker.doing("times");
    let batches = work.times(&parts, materials.first().and_then(|m| m.as_deref()))?;
    let mut rows = Vec::new();
    let mut models = Vec::new();
    for (s, part) in settings.all.iter().zip(&parts).filter(|(_, part)| part.is_finished(order)) {
        if s.default && models.is_empty() {
            models.extend(part.found().map(|f| f.model.clone()));
        }
        rows.push(row(order, s, part));
    }
    floor::put_times(&mut rows, &batches);
    let finished = rows.iter().filter(|r| r.time.is_some() || r.error.is_some()).count();
    if finished == settings.all.len() && order.cases {
        kept.tidy(names.iter().flat_map(|n| [&n.figures, &n.cases]))?;
    }
    let mut results = Results {
        version: VERSION,
        study: study.source.path().display().to_string(),
        digest,
        seed: study.seed,
        strokes: strokes.iter().map(|s| format!("{} ({} s)", s.name, s.seconds)).collect(),
        materials: materials.iter().flatten().cloned().collect(),
        machines: vec![order.machine.clone()],
        shards: vec![(order.shard.0 + 1, order.shard.1.max(1))],
        unfinished: settings.all.len() - finished,
        cases: cases.len(),
        floor: Default::default(),
        lag_floor_ms: None,
        load_floor: None,
        model: mean(models.iter()),
        empty: floor::empty(&batches),
        notes,
        rows,
    };
    floor::find(&mut results);
    Ok(Ran { results })
}

/// What all that is done for settings has in common.
#[derive(Clone, Copy)]
struct Work<'a> {
    order: &'a Order<'a>,
    onlooker: &'a dyn Onlooker,
    kept: &'a Kept,
    settings: &'a [Setting],
    names: &'a [Names],
    cases: &'a [&'static Case],
}

impl Work<'_> {
    fn base(&self, setting: &Setting) -> Result<&Base, Diagnostic> {
        let base = self.order.base(setting).or(self.order.bases.first());
        base.ok_or_else(|| Diagnostic::new("there is no graph to study"))
    }

    /// Accuracy and hard cases of all settings: what is kept is taken, and what is new is kept.
    fn parts(&self, strokes: &[Stroke], materials: &[Option<String>]) -> Result<Vec<Part>, Diagnostic> {
        let (study, onlooker) = (self.order.study, self.onlooker);
        let kept = |names: &Names| Part {
            heard: self.kept.get(&names.figures).map(Heard::Found),
            cases: self.kept.get(&names.cases).filter(|_| self.order.cases),
        };
        let parts: Vec<Part> = self.names.iter().map(kept).collect();
        let left: Vec<usize> = (0..parts.len()).filter(|&i| !parts[i].is_finished(self.order)).collect();
        let truths = if left.iter().any(|&i| parts[i].heard.is_none()) {
            onlooker.doing("the physics");
            truths(study, strokes, materials, self.order.jobs, onlooker)?
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
        let (each, cases) = (renders(study, materials), self.cases.len() as u64);
        for part in &parts {
            let heard = if part.heard.is_some() { each } else { 0 };
            onlooker.advanced(heard + if part.cases.is_some() { cases } else { 0 });
        }
        let parts = Mutex::new(parts);
        on_several(&left, self.order.jobs, onlooker, |&i| {
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
        let (setting, names) = (&self.settings[number], &self.names[number]);
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
        if part.found().is_none() || part.cases.is_some() || !self.order.cases {
            return Ok(());
        }
        let subject = Subject::new(registry.clone()).graph(&setting.graph).effort(Effort::Quick);
        let mut found = Cases::default();
        for case in self.cases {
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
    fn times(&self, parts: &[Part], material: Option<&str>) -> Result<Vec<Batch>, Diagnostic> {
        let all = || self.settings.iter().zip(self.names);
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
        let Some(anchor) = self.settings.first() else { return Ok(batches) };
        let left: Vec<(&Setting, &Names)> = all()
            .zip(parts)
            .filter(|((_, names), part)| part.found().is_some() && !known.contains(&names.times))
            .map(|(it, _)| it)
            .collect();
        let times = self.order.study.times;
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

/// The study's materials, with those of its recordings, where any graph has a network to give them to.
fn materials(order: &Order<'_>, notes: &mut Vec<String>) -> Vec<Option<String>> {
    let of = |b: &Base| b.graph.nodes.iter().any(|n| is_network(&b.registry, &n.kind));
    let recorded = order.study.strokes.iter().filter_map(|s| s.material.as_ref());
    let mut names: Vec<&String> = Vec::new();
    for (name, _) in order.study.materials.iter().chain(recorded) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    if names.is_empty() || !order.bases.iter().any(of) {
        if !names.is_empty() {
            notes.push(
                "no graph has a node with a `library` and a `material`: each keeps its own textures".into(),
            );
        }
        return vec![None];
    }
    names.into_iter().cloned().map(Some).collect()
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
            let mut all = Vec::new();
            for (number, piece) in (0..).zip(pieces.iter().flat_map(|piece| [piece; PLACES])) {
                let felt = piece.felt(hand, seed(PIECES + number));
                all.extend(Spectrogram::new(&felt.axes(), felt.rate_hz));
            }
            if let Ok(mut truths) = truths.lock() {
                truths.insert(s, &surface.name, draw, all);
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
