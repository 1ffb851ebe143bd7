//! A study from its settings to its results.

use std::collections::{BTreeMap, HashMap};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use asperity_dataset::made::Ground;
use asperity_graph::{GraphFile, compile};
use asperity_measure::accuracy::Spectrogram;
use asperity_node::{ParamValue, Registry, random};
use asperity_source::Diagnostic;
use asperity_stability::{Case, Effort, Subject, Verdict};
use asperity_world::topography::made_surfaces;
use serde::{Deserialize, Serialize};

use crate::accuracy::{Found, Plan, find};
use crate::figure::mean;
use crate::file::Study;
use crate::floor;
use crate::hear::is_network;
use crate::keep::Kept;
use crate::result::{Fragment, Machine, Results, Row, VERSION};
use crate::setting::{Base, Setting, Settings, fnv};
use crate::stroke::{Known, Stroke, StrokeDecl};
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

/// What is known of a setting but its times.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Part {
    found: Option<Found>,
    error: Option<String>,
    cases: usize,
    fails: BTreeMap<String, String>,
}

/// What came of a run.
#[derive(Debug)]
pub struct Ran {
    /// Results of what is finished.
    pub results: Results,
    /// Settings that are not finished, since the user asked to stop.
    pub unfinished: usize,
    /// What a person should know of how the study was taken.
    pub notes: Vec<String>,
}

/// How many [parts](Onlooker::advanced) a run has: of accuracy for each setting, and of times.
pub fn parts(order: &Order<'_>) -> Result<(u64, u64), Diagnostic> {
    let settings = mine(order)?.all.len() as u64;
    let each = renders(order.study, &materials(order, &mut Vec::new()));
    let batches = settings.div_ceil(order.study.times.batch as u64);
    Ok((settings * each, batches * order.study.times.turns as u64))
}

/// How many renders each setting takes, and measurements of its lag.
fn renders(study: &Study, materials: &[Option<String>]) -> u64 {
    let over = |m: &Option<String>| study.strokes.iter().filter(|s| s.goes_over(m.as_deref())).count() as u64;
    study.draws * (materials.iter().map(over).sum::<u64>() + 1)
}

/// The settings of this shard.
fn mine(order: &Order<'_>) -> Result<Settings, Diagnostic> {
    let mut settings = Settings::new(order.study, order.bases, order.marks)?;
    let (shard, of) = order.shard;
    let mut number = 0;
    settings.all.retain(|_| {
        number += 1;
        number == 1 || (number - 1) % of.max(1) == shard
    });
    Ok(settings)
}

/// Runs a study.
///
/// # Errors
/// What is wrong with the study or its graphs; what cannot be written. A setting that cannot be run is a row that says why.
pub fn run(order: &Order<'_>, onlooker: &dyn Onlooker) -> Result<Ran, Diagnostic> {
    let study = order.study;
    let settings = mine(order)?;
    let kept = Kept::open(order.folder)?;
    let salt = salt(order)?;
    let key = |s: &Setting| format!("{:016x}", fnv(&format!("{salt} {}", s.key)));
    let registry = |s: &Setting| -> &Registry {
        let bases = order.bases.get(s.base).or_else(|| order.marks.iter().find(|m| m.name == s.name));
        bases.or(order.bases.first()).map_or_else(|| unreachable!("there is a graph"), |b| &b.registry)
    };
    let mut notes: Vec<String> =
        settings.left_out.iter().map(|(what, why)| format!("`{what}` is left out: {why}")).collect();
    let strokes = study.strokes.iter().map(|s| s.open()).collect::<Result<Vec<_>, _>>()?;
    let materials = materials(order, &mut notes);
    onlooker.doing("the physics");
    let truths = truths(study, &strokes, &materials, order.jobs, onlooker)?;
    let plan = Plan {
        strokes: &strokes,
        materials: &materials,
        draws: study.draws,
        seed: study.seed,
        steps: study.steps,
        truths: &truths,
    };
    let cases: Vec<&Case> =
        asperity_stability::cases().into_iter().filter(|c| c.of_graph && order.cases).collect();
    onlooker.doing("accuracy");
    let parts = Mutex::new(HashMap::new());
    let each = |s: &Setting| -> Result<(), Diagnostic> {
        let name = format!("part-{}", key(s));
        let part = match kept.get::<Part>(&name) {
            Some(part) => {
                onlooker.advanced(renders(study, &materials));
                Some(part)
            }
            None => {
                let base = order.bases.get(s.base).map(|b| &b.graph);
                let part = part(s, base, registry(s), &plan, &cases, onlooker);
                part.map(|part| kept.put(&name, &part)).transpose()?
            }
        };
        if let (Some(part), Ok(mut parts)) = (part, parts.lock()) {
            parts.insert(s.key.clone(), part);
        }
        Ok(())
    };
    on_several(&settings.all, order.jobs, onlooker, each)?;
    let parts = parts.into_inner().unwrap_or_default();
    onlooker.doing("times");
    let batches = times(order, &settings, &parts, &kept, &key, &registry, materials.first(), onlooker)?;
    let mut rows = Vec::new();
    let mut models = Vec::new();
    for s in &settings.all {
        if let Some(part) = parts.get(&s.key) {
            if s.default {
                models.extend(part.found.as_ref().map(|f| f.model.clone()));
            }
            rows.push(row(order, s, part));
        }
    }
    floor::put_times(&mut rows, &batches);
    let unfinished =
        settings.all.len() - rows.iter().filter(|r| r.time.is_some() || r.error.is_some()).count();
    let mut results = Results {
        version: VERSION,
        study: study.source.path().display().to_string(),
        seed: study.seed,
        strokes: strokes.iter().map(|s| format!("{} ({} s)", s.name, s.seconds)).collect(),
        materials: materials.iter().flatten().cloned().collect(),
        machines: vec![order.machine.clone()],
        shards: 1,
        floor: Default::default(),
        lag_floor_ms: None,
        load_floor: None,
        model: mean(models.iter()),
        empty: floor::empty(&batches),
        rows,
    };
    floor::find(&mut results);
    Ok(Ran { results, unfinished, notes })
}

/// What else a finished part depends on: the study's text, this program, and all files that strokes and graphs read.
fn salt(order: &Order<'_>) -> Result<String, Diagnostic> {
    let mut text =
        format!("{} {:?} {} {}", order.study.source.text(), order.machine, order.program, order.cases);
    let add = |text: &mut String, path: &Path| {
        let bytes = std::fs::read(path).unwrap_or_default();
        *text += &format!(" {} {:016x}", path.display(), bytes_fnv(&bytes));
    };
    order.study.strokes.iter().filter_map(StrokeDecl::file).for_each(|path| add(&mut text, path));
    for base in order.bases.iter().chain(order.marks) {
        // What does not compile over its own material may do so over those of the study.
        let Ok(compiled) = compile(&base.graph, &base.registry, Default::default()) else { continue };
        for node in &compiled.schedule.nodes {
            let named = node.params.iter().filter_map(|(_, value)| match value {
                ParamValue::File(path) => Some(path.clone()),
                _ => None,
            });
            for path in named.chain(node.files.iter().cloned()) {
                add(&mut text, &path);
            }
        }
    }
    Ok(text)
}

fn bytes_fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3))
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

/// Accuracy and hard cases of a setting; none where the user asks to stop.
fn part(
    s: &Setting,
    base: Option<&GraphFile>,
    registry: &Registry,
    plan: &Plan<'_>,
    cases: &[&Case],
    onlooker: &dyn Onlooker,
) -> Option<Part> {
    let mut part = Part { found: None, error: None, cases: 0, fails: BTreeMap::new() };
    // A node may panic while it is prepared, where nothing else contains it.
    let found = catch_unwind(AssertUnwindSafe(|| find(s, registry, plan, onlooker)));
    match found {
        Ok(Ok(Some(found))) => part.found = Some(found),
        Ok(Ok(None)) => return None,
        Ok(Err(e)) => part.error = Some(e.to_string()),
        Err(_) => part.error = Some("it panicked while it was prepared".into()),
    }
    if !s.guards {
        let why = "they are off, which is only measured: no graph and no command can have it so";
        part.fails.insert("guards".into(), why.into());
    }
    let cards = |g: &GraphFile| g.nodes.iter().filter(|n| n.kind == "audio_out").count();
    if base.is_some_and(|base| cards(base) > cards(&s.graph)) {
        let why =
            "what drove the coil through a limiter goes nowhere any more: nothing is played without one";
        part.fails.insert("limiter".into(), why.into());
    }
    if part.error.is_none() {
        let subject = Subject::new(registry.clone()).graph(&s.graph).effort(Effort::Quick);
        for case in cases {
            if onlooker.stopped() {
                return None;
            }
            let outcome = catch_unwind(AssertUnwindSafe(|| case.run(&subject)));
            let (verdict, why) = match outcome {
                Ok(outcome) => (outcome.verdict, outcome.found),
                Err(_) => (Verdict::Fails, "it panicked".into()),
            };
            match verdict {
                Verdict::Holds => part.cases += 1,
                Verdict::Fails => {
                    part.cases += 1;
                    part.fails.insert(case.name.to_owned(), why);
                }
                Verdict::NotApplicable => {}
            }
        }
    }
    Some(part)
}

/// Times of all settings that run, in batches; those that are kept are taken from there.
#[allow(clippy::too_many_arguments)]
fn times<'r>(
    order: &Order<'_>,
    settings: &Settings,
    parts: &HashMap<String, Part>,
    kept: &Kept,
    key: &impl Fn(&Setting) -> String,
    registry: &impl Fn(&Setting) -> &'r Registry,
    material: Option<&Option<String>>,
    onlooker: &dyn Onlooker,
) -> Result<Vec<Batch>, Diagnostic> {
    let runs = |s: &&Setting| parts.get(&s.key).is_some_and(|p| p.error.is_none());
    let Some(anchor) = settings.all.first() else { return Ok(Vec::new()) };
    let keys: HashMap<String, &str> = settings.all.iter().map(|s| (key(s), s.key.as_str())).collect();
    let mut batches: Vec<Batch> = Vec::new();
    let mut known = Vec::new();
    for mut batch in kept.all::<Batch>("times-") {
        batch.rows.retain_mut(|(k, _)| match keys.get(k) {
            Some(plain) => {
                *k = (*plain).to_owned();
                true
            }
            None => false,
        });
        if !batch.rows.is_empty() {
            known.extend(batch.rows.iter().map(|(k, _)| k.clone()));
            batches.push(batch);
        }
    }
    let left: Vec<&Setting> = settings.all.iter().filter(runs).filter(|s| !known.contains(&s.key)).collect();
    let material = material.and_then(|m| m.as_deref());
    for some in left.chunks(order.study.times.batch.max(1)) {
        let with: Vec<(&Setting, &Registry)> = some.iter().map(|s| (*s, registry(s))).collect();
        let timed = batch((anchor, registry(anchor)), &with, material, order.study.times, onlooker)?;
        let Some(batch) = timed else { break };
        // Under keys that change with what a setting depends on.
        let full = some.iter().map(|s| key(s));
        let rows = full.zip(&batch.rows).map(|(key, (_, time))| (key, time.clone())).collect();
        let name: String = some.iter().map(|s| key(s)).collect();
        let mut batch = kept.put(&format!("times-{:016x}", fnv(&name)), &Batch { rows, ..batch })?;
        for ((key, _), s) in batch.rows.iter_mut().zip(some) {
            key.clone_from(&s.key);
        }
        batches.push(batch);
    }
    Ok(batches)
}

fn row(order: &Order<'_>, s: &Setting, part: &Part) -> Row {
    let found = part.found.clone().unwrap_or_default();
    let lag_ms = (!found.lags_ms.is_empty()).then(|| {
        let count = found.lags_ms.len() as f64;
        let of = |i: usize| found.lags_ms.iter().map(|l| l[i]).sum::<f64>() / count;
        [of(0), of(1), of(2)]
    });
    let base = order.bases.get(s.base);
    Row {
        name: s.name.clone(),
        key: s.key.clone(),
        graph: base.map_or_else(|| s.graph.source.path().display().to_string(), |b| b.name.clone()),
        turned: s.turned.clone(),
        grids: s.grids.clone(),
        default: s.default,
        mark: s.mark,
        tick_hz: s.graph.tick_hz,
        fragment: base.map_or_else(Fragment::default, |b| Fragment::between(&b.graph, &s.graph)),
        error: part.error.clone(),
        figures: mean(found.draws.iter()),
        lag_ms,
        lag_draws_ms: found.lags_ms.iter().map(|l| l[1]).collect(),
        draws: found.draws,
        latency_ms: found.latency_ms,
        faults: found.faults,
        cases: part.cases,
        fails: part.fails.clone(),
        time: None,
    }
}
