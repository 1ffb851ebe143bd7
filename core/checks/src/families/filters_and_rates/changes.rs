//! Parameters that change while a signal runs through.

use std::f64::consts::TAU;
use std::sync::Arc;

use asperity_engine::{CROSSFADE_S, Controller, Engine, Options};
use asperity_node::{Buffer, Descriptor, ParamKind, PortType, Unit};

use super::filters;
use crate::case::{Figures, Found, Stop, not_applicable};
use crate::played::{Played, samples};
use crate::rig::CaseGraph;
use crate::subject::Subject;

const TICK_HZ: u32 = 500;
const RATE_HZ: u32 = 48_000;
/// Ticks before each change: a quarter of a second, whole periods.
const TICKS: usize = 125;
/// Level below which a signal counts as silent; the input is 0.1, or 60 mm/s and more.
const SILENT_DB: f64 = -80.0;
/// Ticks from a change to the half second whose level is measured.
const RECOVERS: usize = 2 * TICKS;
/// Largest step of a crossfade by 1, from sample to sample: twice a straight line, since fades may be curved.
const STEEPEST: f64 = 2.0 / (CROSSFADE_S * RATE_HZ as f64);
/// The same of a control, from tick to tick.
const CONTROL_STEEPEST: f64 = 2.0 / (CROSSFADE_S * TICK_HZ as f64);

/// An engine whose graph changes while it runs, and the output of the node `it`.
struct Running {
    controller: Controller,
    engine: Engine,
    heard: Vec<f64>,
}

impl Running {
    fn new(subject: &Subject<'_>, graph: &CaseGraph) -> Result<Self, Stop> {
        let compiled = subject.compiled(&graph.graph, &graph.kinds)?;
        let (controller, engine) = Engine::controlled(compiled, Options::default());
        Ok(Self { controller, engine, heard: Vec::new() })
    }

    /// The type of that output.
    fn port(&self) -> Option<PortType> {
        let schedule = self.engine.schedule();
        schedule.nodes.get(schedule.index_of("out")?)?.inputs.first()?.port.clone()
    }

    fn run(&mut self, ticks: usize) -> Result<(), Stop> {
        for _ in 0..ticks {
            self.engine.tick();
            // Read at the sink, behind a crossfade.
            let out = self.engine.schedule().index_of("out").unwrap_or(0);
            match self.engine.input(out, 0) {
                Some(Buffer::Audio { samples, len, .. }) => {
                    self.heard.extend(samples.iter().take(*len).map(|x| f64::from(*x)));
                }
                Some(Buffer::Control { values, .. }) => self.heard.extend(values.first()),
                _ => {}
            }
        }
        self.controller.collect();
        ensure!(self.engine.faults() == 0, "{} faults", self.engine.faults());
        Ok(())
    }
}

fn largest_step(heard: &[f64]) -> f64 {
    heard.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max)
}

fn peak(heard: &[f64]) -> f64 {
    heard.iter().fold(0.0, |m, x| m.max(x.abs()))
}

/// The level of half a second, in dB: whole periods of the squares.
fn level_db(half: &[f64]) -> f64 {
    10.0 * (half.iter().map(|x| x * x).sum::<f64>() / half.len().max(1) as f64).log10()
}

/// The level of a steady signal; none where it still changes or is silent.
fn settled_db(heard: &[f64]) -> Option<f64> {
    let (before, last) = heard.split_at(heard.len() / 2);
    let (before, last) = (level_db(before), level_db(last));
    (last > SILENT_DB && (last - before).abs() < 0.1).then_some(last)
}

/// Values for each parameter, as RON texts.
fn values(d: &Descriptor) -> Vec<(String, Vec<String>)> {
    let of = |kind: &ParamKind| match kind {
        ParamKind::Number(r) => Some(vec![format!("{:?}", r.end()), format!("{:?}", r.start())]),
        ParamKind::Integer(r) => Some(vec![r.end().to_string(), r.start().to_string()]),
        ParamKind::Choice(words) => Some(words.iter().rev().map(|w| format!("\"{w}\"")).collect()),
        ParamKind::Flag => Some(vec!["true".into(), "false".into()]),
        _ => None,
    };
    d.params.iter().filter_map(|p| Some((p.name.to_string(), of(&p.kind)?))).collect()
}

/// Changes a parameter of `it` from its default to each value and back. Notes the largest step as a part of
/// its bound. Answers whether there is a change.
fn change(
    subject: &Subject<'_>,
    graph: &CaseGraph,
    (param, values): (&str, &[String]),
    steepest: f64,
    figures: &mut Figures,
) -> Result<bool, Stop> {
    let mut changed = false;
    for value in values {
        let mut other = graph.clone();
        other.graph.set(&format!("it.{param}={value}"), "the case")?;
        // A value that it refuses is no change, and another type of output is another signal.
        let Ok(mut steady) = Running::new(subject, &other) else { continue };
        let mut running = Running::new(subject, graph)?;
        if steady.port() != running.port() {
            continue;
        }
        let (mut steps, mut loudest, mut levels) = (0.0_f64, 0.0_f64, Vec::new());
        for it in [&mut steady, &mut running] {
            it.run(TICKS)?;
            let from = it.heard.len();
            it.run(4 * TICKS)?;
            let tail = &it.heard[from..];
            (steps, loudest) = (steps.max(largest_step(tail)), loudest.max(peak(tail)));
            levels.push(settled_db(tail));
        }
        for (to, level) in [&other, graph].into_iter().zip(levels) {
            let from = running.heard.len();
            let compiled = subject.compiled(&to.graph, &to.kinds)?;
            if let Err(e) = running.controller.swap(compiled, &[]) {
                bail!("`{param}` to {value}: {e}");
            }
            running.run(TICKS)?;
            let step = largest_step(&running.heard[from.saturating_sub(1)..]);
            // At worst the louder of the two fades to or from nothing.
            let bound = 1.01 * steps + 2.0 * loudest * steepest;
            ensure!(
                step <= bound,
                "`{param}` to {value}: a step of {step:.4}; both signals and a crossfade give {bound:.4}"
            );
            changed = true;
            figures.note(step / bound.max(f64::MIN_POSITIVE), "of the largest step that is allowed");
            running.run(RECOVERS - TICKS)?;
            let from = running.heard.len();
            running.run(2 * TICKS)?;
            let now = level_db(&running.heard[from..]);
            let usual = level.unwrap_or(now);
            ensure!(
                (now - usual).abs() < 1.0 || level.is_none(),
                "`{param}` to {value}: half a second later the level is {now:.1} dB, {usual:.1} dB without"
            );
        }
    }
    Ok(changed)
}

pub(super) fn run(subject: &Subject<'_>) -> Found {
    let turn = |n: u64| (100 * n % u64::from(RATE_HZ)) as f64 / f64::from(RATE_HZ);
    let tone = samples(move |n| (0.1 * (TAU * turn(n)).sin()) as f32);
    let mut all: Vec<(String, CaseGraph, f64, &[&str])> = Vec::new();
    for kind in filters(&subject.registry) {
        let graph = kind.alone((TICK_HZ, RATE_HZ), None, tone.clone())?;
        all.push((kind.kind, graph, STEEPEST, &[]));
    }
    if subject.kind("velocity").is_ok() {
        // A stylus that moves to and fro at 3 Hz.
        let place = Arc::new(|tick: u64, at: &mut [f64]| {
            at.fill(0.0);
            at[0] = 10.0 * (TAU * 3.0 * tick as f64 / f64::from(TICK_HZ)).sin();
        });
        let graph = CaseGraph::new(TICK_HZ, RATE_HZ)
            .plays("source", Played::control("a stylus from memory", 3, Unit::MILLIMETRE, place))?
            .node("it", "velocity", &[])?
            .node("out", "probe", &[])?
            .chain(&["source", "it"])
            .wire("it.velocity", "out");
        // The upper end of its corner is above half the tick rate.
        all.push(("velocity".to_owned(), graph, CONTROL_STEEPEST, &["200.0", "5.0"]));
    }
    let (mut changed, mut figures) = (0, Figures::default());
    for (kind, graph, steepest, more) in &all {
        for (param, mut values) in values(subject.kind(kind)?.descriptor()) {
            values.extend(more.iter().map(ToString::to_string));
            figures.about = format!("`{kind}.{param}`");
            let is = change(subject, graph, (&param, &values), *steepest, &mut figures);
            changed += u64::from(is.map_err(|e| e.after(&format!("`{kind}`")))?);
        }
    }
    if changed == 0 {
        return not_applicable("there is no filter");
    }
    Ok(format!("{changed} parameters: {figures}"))
}
