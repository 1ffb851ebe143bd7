//! Times of settings, taken in turns.
//!
//! A batch of settings takes turns with the default and with a tick that does nothing, over and over, in an order that changes from round to round: what else
//! the machine does falls on all alike. The default is in every batch; by the ratio to it batches, and shards on other machines, are put together.

use std::time::Instant;

use asperity_engine::Options;
use asperity_graph::GraphFile;
use asperity_measure::timing::Timing;
use asperity_node::{Registry, random};
use asperity_source::Diagnostic;
use serde::{Deserialize, Serialize};

use crate::file::Times;
use crate::floor::median;
use crate::hear::{Chain, over};
use crate::result::Time;
use crate::setting::Setting;

/// Length of signal whose time is what is ranked: whole ticks of 125 Hz and more, and a whole number of any network's.
pub const LOAD_MS: u64 = 8;
/// Turns before those that count.
const WARM_MS: u64 = 400;

/// What is seen of the outside.
pub trait Onlooker: Sync {
    /// Bytes that are taken from the heap and not given back, where they can be counted.
    fn heap_bytes(&self) -> Option<u64> {
        None
    }
    /// Whether the user asks to stop.
    fn stopped(&self) -> bool {
        false
    }
    /// So many parts of what is to be done are done.
    fn advanced(&self, _parts: u64) {}
    /// What is done now.
    fn doing(&self, _what: &str) {}
}

/// Times of a batch.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Batch {
    /// A tick in which nothing is done.
    pub empty: Time,
    /// The default of the first graph.
    pub anchor: Time,
    /// Keys of settings, with their times or why there are none.
    pub rows: Vec<(String, Result<Time, String>)>,
}

/// One that takes turns.
struct Entry {
    chain: Option<Chain>,
    tick_hz: u32,
    timing: Timing,
    groups: Timing,
    turns: Vec<f64>,
    misses: u64,
    /// The first tick of each turn, while the others' had the caches.
    cold: Vec<f64>,
    memory: Option<u64>,
}

/// A stylus that goes round and round at 80 mm/s, pressed to 1 N, so that nothing sleeps.
fn round(t: f64) -> [f64; 3] {
    let (sin, cos) = (t * 80.0 / 20.0).sin_cos();
    [20.0 * cos, 20.0 * sin, -2.0]
}

impl Entry {
    fn new(
        setting: &Setting,
        registry: &Registry,
        material: Option<&str>,
        onlooker: &dyn Onlooker,
    ) -> Result<Self, Diagnostic> {
        let graph: GraphFile = over(&setting.graph, registry, material, setting.graph.seed);
        let before = onlooker.heap_bytes();
        let options = Options { guards: setting.guards, ..Options::default() };
        let chain = Chain::new(&graph, registry, vec![std::sync::Arc::new(round)], options)?;
        let memory = before.zip(onlooker.heap_bytes()).map(|(before, after)| after.saturating_sub(before));
        Ok(Self { memory, ..Self::empty(Some(chain), graph.tick_hz) })
    }

    fn empty(chain: Option<Chain>, tick_hz: u32) -> Self {
        let (timing, groups) = (Timing::new(3), Timing::new(3));
        Self { chain, tick_hz, timing, groups, turns: Vec::new(), misses: 0, cold: Vec::new(), memory: None }
    }

    /// One tick; how many nanoseconds it took.
    fn tick(&mut self) -> u64 {
        let began = Instant::now();
        if let Some(chain) = &mut self.chain {
            chain.engine().tick();
        }
        began.elapsed().as_nanos() as u64
    }

    /// One turn.
    fn turn(&mut self, ms: u64, counts: bool) {
        let group = (u64::from(self.tick_hz) * LOAD_MS / 1000).max(1);
        let groups = (ms / LOAD_MS).max(1);
        let tick_ns = 1_000_000_000 / u64::from(self.tick_hz);
        let mut turn = Timing::new(3);
        if counts {
            let cold = self.tick();
            self.cold.push(cold as f64 / 1e3);
        }
        for _ in 0..groups {
            let mut sum = 0;
            for _ in 0..group {
                let ns = self.tick();
                sum += ns;
                if counts {
                    self.timing.record(ns);
                    self.misses += u64::from(ns > tick_ns);
                }
            }
            if counts {
                self.groups.record(sum);
                turn.record(sum);
            }
        }
        if counts {
            self.turns.push(turn.summary().p50_ns as f64);
        }
    }

    fn time(&self) -> Time {
        let (t, g) = (self.timing.summary(), self.groups.summary());
        let us = |ns: u64| ns as f64 / 1e3;
        // Ticks of a group are whole; at rates that are no multiple of 125 Hz they last a little less than `LOAD_MS`.
        let group = (u64::from(self.tick_hz) * LOAD_MS / 1000).max(1) as f64;
        let lasts_ns = group * 1e9 / f64::from(self.tick_hz);
        let middle = (g.p50_ns as f64).max(1.0);
        let spread = self.turns.iter().map(|t| (t / middle).max(middle / t.max(1.0))).fold(1.0, f64::max);
        Time {
            p50_us: us(t.p50_ns),
            p99_us: us(t.p99_ns),
            p999_us: us(t.p999_ns),
            max_us: us(t.max_ns),
            misses: self.misses,
            ticks: t.count,
            load_percent: 100.0 * g.p50_ns as f64 / lasts_ns,
            spread,
            cold_us: median(self.cold.clone()),
            memory_kib: self.memory.map(|b| b as f64 / 1024.0),
        }
    }
}

/// Times a batch. Nothing else is to run meanwhile.
///
/// # Errors
/// A default that does not compile; none where the user asks to stop.
pub(crate) fn batch(
    anchor: (&Setting, &Registry),
    settings: &[(&Setting, &Registry)],
    material: Option<&str>,
    times: Times,
    onlooker: &dyn Onlooker,
) -> Result<Option<Batch>, Diagnostic> {
    let first = Entry::new(anchor.0, anchor.1, material, onlooker)?;
    let mut entries = vec![Entry::empty(None, anchor.0.graph.tick_hz), first];
    let mut errors: Vec<Option<String>> = Vec::new();
    for (setting, registry) in settings {
        match Entry::new(setting, registry, material, onlooker) {
            Ok(entry) => {
                entries.push(entry);
                errors.push(None);
            }
            Err(e) => errors.push(Some(e.to_string())),
        }
    }
    for entry in &mut entries {
        entry.turn(WARM_MS, false);
    }
    let mut order: Vec<usize> = (0..entries.len()).collect();
    for turn in 0..times.turns {
        order.sort_by_key(|i| random::bits(turn as u64 + 1, *i as u64));
        for &i in &order {
            if onlooker.stopped() {
                return Ok(None);
            }
            entries[i].turn(times.turn_ms, true);
        }
        onlooker.advanced(1);
    }
    let mut done = entries.iter().map(Entry::time);
    let (Some(empty), Some(anchor)) = (done.next(), done.next()) else { return Ok(None) };
    let rows = settings.iter().zip(errors).map(|((setting, _), error)| {
        let time = match error {
            Some(why) => Err(why),
            None => done.next().ok_or_else(|| "it was not timed".to_owned()),
        };
        (setting.key.clone(), time)
    });
    let rows = rows.collect();
    Ok(Some(Batch { empty, anchor, rows }))
}

impl Time {
    /// What it would have been where everything is so much slower or faster.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            p50_us: self.p50_us * factor,
            p99_us: self.p99_us * factor,
            p999_us: self.p999_us * factor,
            max_us: self.max_us * factor,
            load_percent: self.load_percent * factor,
            cold_us: self.cold_us * factor,
            ..self
        }
    }
}
