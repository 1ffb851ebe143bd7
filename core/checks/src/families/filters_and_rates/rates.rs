//! Rates at which a graph and its kinds run.

use std::collections::BTreeMap;
use std::sync::Arc;

use asperity_graph::GraphFile;
use asperity_node::random::bits;
use asperity_node::{NodeKind, time};

use super::{chain, noise, windows};
use crate::case::{Found, Stop};
use crate::families::often;
use crate::families::phase::{frames, methods};
use crate::played::Motion;
use crate::rig::Rig;
use crate::subject::Subject;

/// 14 tick rates: the ends, usual ones, and ones that divide no audio rate.
const TICKS_HZ: [u32; 14] = [500, 4000, 100, 441, 1000, 101, 250, 499, 2500, 333, 2000, 997, 3999, 3001];
/// 15 audio rates, so that each meets each tick rate within 210 runs.
const AUDIO_HZ: [u32; 15] = [
    48_000, 44_100, 8000, 192_000, 8001, 96_000, 11_025, 47_999, 16_000, 88_200, 191_999, 22_050, 44_101,
    32_000, 176_400,
];
/// Duration of each run: more than two windows \[s\].
const SECONDS: f64 = 0.25;

/// Number of pairs of the lists.
const LISTED: u64 = 210;
/// The same, and then every tick rate.
const EVERY: u64 = LISTED + 3901;

/// Pairs of a tick rate and an audio rate: all of the lists, then every tick rate with a random audio rate.
fn pairs(count: u64) -> impl Iterator<Item = (u32, u32)> {
    (0..count).map(|i| {
        let at = |n: usize| (i % n as u64) as usize;
        if i < LISTED {
            return (TICKS_HZ[at(14)], AUDIO_HZ[at(15)]);
        }
        // Each once, in steps that are far apart.
        (100 + ((i - LISTED) * 1000 % 3901) as u32, 8000 + (bits(2, i) % 184_001) as u32)
    })
}

/// Results of all rates.
#[derive(Default)]
struct Tally {
    ran: u64,
    /// Reasons of refusals, and their numbers.
    refused: BTreeMap<String, u64>,
}

impl Tally {
    /// Runs a graph, or counts its refusal.
    fn run(&mut self, subject: &Subject<'_>, graph: &GraphFile, kinds: &[Arc<NodeKind>]) -> Result<(), Stop> {
        let at = format!("{} ticks/s, {} Hz", graph.tick_hz, graph.audio_hz);
        let compiled = match subject.compile(graph, kinds) {
            Ok(compiled) => compiled,
            Err(errors) => {
                for e in &errors {
                    let told = !e.message.trim().is_empty() && (e.place.is_some() || e.path().is_some());
                    ensure!(told, "at {at} it is refused without a place: {e}");
                }
                let why = errors.first().map(|e| e.message.clone()).unwrap_or_default();
                *self.refused.entry(why).or_default() += 1;
                return Ok(());
            }
        };
        let mut rig = Rig::from(compiled);
        let mut heard = vec![0_u64; rig.drive().count()];
        rig.run(rig.ticks(SECONDS), |rig, tick| {
            let due = time::samples(tick, graph.audio_hz, graph.tick_hz);
            let due = due.end - due.start;
            for (heard, samples) in heard.iter_mut().zip(rig.drive()) {
                let count = samples.len() as u64;
                ensure!(count == due, "{count} samples in tick {tick} and not {due}, at {at}");
                ensure!(samples.iter().all(|x| x.is_finite()), "not finite in tick {tick} at {at}");
                *heard += count;
            }
            Ok(())
        })?;
        ensure!(rig.engine.faults() == 0, "{} faults at {at}", rig.engine.faults());
        let all = time::first_sample(rig.engine.next_tick(), graph.audio_hz, graph.tick_hz);
        ensure!(heard.iter().all(|n| *n == all), "{heard:?} samples and not {all} at {at}");
        self.ran += 1;
        Ok(())
    }

    fn told(&self) -> String {
        match self.refused.values().sum() {
            0_u64 => format!("ran at all {} rates", self.ran),
            all => format!("ran at {} rates, refused at {all}, such as {}", self.ran, often(&self.refused)),
        }
    }
}

pub(super) fn graph(subject: &Subject<'_>) -> Found {
    let own = subject.its_graph()?;
    let circle = |hz: f64| -> Motion {
        Arc::new(move |tick| {
            let turn = 3.0 * tick as f64 / hz;
            [20.0 * turn.cos(), 20.0 * turn.sin(), -1.0]
        })
    };
    let mut tally = Tally::default();
    let rates = [(own.tick_hz, own.audio_hz)].into_iter().chain(pairs(subject.by_effort(5, 60, EVERY)));
    for (k, (tick_hz, audio_hz)) in rates.enumerate() {
        // A graph without a stylus plays by itself.
        let moved = Rig::with_stylus(own, &subject.registry, Some(&circle(f64::from(tick_hz))));
        let (mut graph, kinds) = moved.unwrap_or_else(|_| (own.clone(), Vec::new()));
        (graph.tick_hz, graph.audio_hz) = (tick_hz, audio_hz);
        tally.run(subject, &graph, &kinds)?;
        ensure!(k > 0 || tally.ran == 1, "at its own rates it is refused: {}", tally.told());
    }
    Ok(tally.told())
}

pub(super) fn kinds(subject: &Subject<'_>) -> Found {
    let all = methods(subject, false)?;
    let mut tally = Tally::default();
    let texture = frames(|frame, bin| f64::from(noise(frame, bin as u64).abs()));
    let count = subject.by_effort(14, 100, 1000);
    for (i, (tick_hz, audio_hz)) in pairs(count).enumerate() {
        // Mostly at a synthesis rate below the audio rate, now and then at the audio rate itself.
        let rate_hz = if i % 8 == 3 { audio_hz } else { [2500, 2000, 8000, 4410][i % 4] };
        let Some(windows) = windows(rate_hz, tick_hz) else { continue };
        for kind in &all {
            let chain = chain(kind, (tick_hz, audio_hz), windows, texture.clone())?;
            tally.run(subject, &chain.graph, &chain.kinds)?;
        }
    }
    ensure!(tally.ran > 0, "it is refused everywhere: {}", tally.told());
    Ok(format!("{} kinds: {}", all.len(), tally.told()))
}
