//! Times of settings, measured in turns.
//!
//! The settings of a batch alternate with the default and with an idle tick, in an order that changes from
//! round to round. So other work on the machine affects all alike. The default is in every batch: its ratio
//! puts batches, and shards from other machines, on one scale.
//!
//! A shared machine stalls for milliseconds now and then, and longer ticks meet more stalls. The idle tick
//! spins for the median tick of the default, at its tick rate. Anything beyond that is a stall.

use std::time::Instant;

use asperity_accuracy::timing::Timing;
use asperity_diagnostics::Diagnostic;
use asperity_engine::Options;
use asperity_graph::GraphFile;
use asperity_node::random;
use serde::{Deserialize, Serialize};

use crate::chain::{Chain, over};
use crate::file::Times;
use crate::noise::median;
use crate::patch;
use crate::results::Time;
use crate::setting::Setting;

/// Shortest block \[ms\] that the load is measured over. A block is longer where nodes run in every n-th
/// tick, so that each runs equally often in every block.
const LOAD_MS: u64 = 8;
/// Most ticks of a block. Where the periods of all nodes have a longer common multiple, blocks differ by at
/// most one call of each node.
const MOST_TICKS: u64 = 8000;
/// Length of the turn that warms up \[ms\].
const WARM_MS: u64 = 400;

/// Watches a run, and can stop it.
pub trait Monitor: Sync {
    /// Allocated bytes on the heap, where they can be counted.
    fn heap_bytes(&self) -> Option<u64> {
        None
    }
    /// Whether the run is to stop.
    fn stopped(&self) -> bool {
        false
    }
    /// Called when parts are finished.
    fn advanced(&self, _parts: u64) {}
    /// Called when a stage begins: `physics`, `accuracy`, `times`.
    fn doing(&self, _what: &str) {}
}

/// Times of a batch.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Batch {
    /// The idle tick.
    pub idle: Time,
    /// The default of the first graph.
    pub anchor: Time,
    /// Keys of settings, each with its time or an error.
    pub rows: Vec<(String, Result<Time, String>)>,
}

/// A member of a batch: a chain, or an idle tick.
struct Entry {
    chain: Option<Box<Chain>>,
    /// Time for which a tick without a chain spins \[ns\].
    spin_ns: u64,
    tick_hz: u32,
    block: u64,
    ticks: Timing,
    blocks: Timing,
    /// Median block of each turn \[ns\].
    turns: Vec<f64>,
    misses: u64,
    /// The first tick of each turn \[us\], after others used the caches.
    cold: Vec<f64>,
    memory: Option<u64>,
}

/// Ticks of a block: [`LOAD_MS`] or more, and a common multiple of the periods of all nodes.
fn block_ticks(graph: &GraphFile) -> u64 {
    let least = (u64::from(graph.tick_hz) * LOAD_MS).div_ceil(1000).max(1);
    let gcd = |mut a: u64, mut b: u64| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let periods = graph.nodes.iter().map(|node| u64::from(node.every.max(1)));
    let all = periods.fold(1, |all: u64, every| (all / gcd(all, every)).saturating_mul(every));
    least.div_ceil(all).saturating_mul(all).min(MOST_TICKS)
}

/// Builds something and counts its bytes, where they can be counted. It is built twice: what the first leaves
/// behind, such as cached models, is shared by all.
fn weighed<T, E>(monitor: &dyn Monitor, make: impl Fn() -> Result<T, E>) -> Result<(T, Option<u64>), E> {
    drop(make()?);
    let before = monitor.heap_bytes();
    let made = make()?;
    let bytes = before.zip(monitor.heap_bytes()).map(|(before, after)| after.saturating_sub(before));
    Ok((made, bytes))
}

impl Entry {
    fn new(setting: &Setting<'_>, material: Option<&str>, monitor: &dyn Monitor) -> Result<Self, Diagnostic> {
        let registry = &setting.base.registry;
        let graph = over(&setting.graph, registry, material, setting.graph.seed);
        let options = Options { check_finite: setting.guards, ..Options::default() };
        let path = patch::circle(&graph, registry)?;
        let (chain, memory) = weighed(monitor, || Chain::new(&graph, registry, vec![path.clone()], options))?;
        let chain = Some(Box::new(chain));
        Ok(Self { chain, memory, ..Self::spins(0, graph.tick_hz, block_ticks(&graph)) })
    }

    fn spins(spin_ns: u64, tick_hz: u32, block: u64) -> Self {
        Self {
            chain: None,
            spin_ns,
            tick_hz,
            block,
            ticks: Timing::new(3),
            blocks: Timing::new(3),
            turns: Vec::new(),
            misses: 0,
            cold: Vec::new(),
            memory: None,
        }
    }

    /// Runs a turn that does not count. Returns the median tick \[ns\].
    fn warm(&mut self) -> u64 {
        self.turn(WARM_MS);
        let fresh = Self::spins(self.spin_ns, self.tick_hz, self.block);
        let warmed = std::mem::replace(self, fresh);
        (self.chain, self.memory) = (warmed.chain, warmed.memory);
        warmed.ticks.summary().p50_ns
    }

    /// Runs a tick, and returns its time \[ns\].
    fn tick(&mut self) -> u64 {
        let began = Instant::now();
        match &mut self.chain {
            Some(chain) => chain.engine().tick(),
            None => {
                while began.elapsed().as_nanos() < u128::from(self.spin_ns) {
                    std::hint::spin_loop();
                }
            }
        }
        began.elapsed().as_nanos() as u64
    }

    /// Runs a turn: a whole number of blocks, at least one.
    fn turn(&mut self, ms: u64) {
        let block = self.block.max(1);
        let blocks = (u64::from(self.tick_hz) * ms / 1000 / block).max(1);
        let tick_ns = 1_000_000_000 / u64::from(self.tick_hz);
        let mut turn = Timing::new(3);
        let cold = self.tick();
        self.cold.push(cold as f64 / 1e3);
        for _ in 0..blocks {
            let mut sum = 0;
            for _ in 0..block {
                let ns = self.tick();
                sum += ns;
                self.ticks.record(ns);
                self.misses += u64::from(ns > tick_ns);
            }
            self.blocks.record(sum);
            turn.record(sum);
        }
        self.turns.push(turn.summary().p50_ns as f64);
    }

    fn time(&self) -> Time {
        let (t, b) = (self.ticks.summary(), self.blocks.summary());
        let us = |ns: u64| ns as f64 / 1e3;
        let lasts_ns = self.block as f64 * 1e9 / f64::from(self.tick_hz);
        let middle = (b.p50_ns as f64).max(1.0);
        let spread = self.turns.iter().map(|t| (t / middle).max(middle / t.max(1.0))).fold(1.0, f64::max);
        Time {
            p50_us: us(t.p50_ns),
            p99_us: us(t.p99_ns),
            p999_us: us(t.p999_ns),
            max_us: us(t.max_ns),
            misses: self.misses,
            ticks: t.count,
            load_percent: 100.0 * b.p50_ns as f64 / lasts_ns,
            spread,
            cold_us: median(self.cold.clone()),
            memory_kib: self.memory.map(|b| b as f64 / 1024.0),
            stall_us: 0.0,
            faults: self.chain.as_ref().map_or(0, |chain| chain.faults()),
        }
    }
}

/// Share of the machine's stalls in the 99.9th percentile of a tick with this median \[us\], from idle ticks.
///
/// A tick that takes k times as long meets k times as many stalls. So its 99.9th percentile corresponds to
/// the quantile `1 - 0.001 / k` of the idle tick.
fn stall_us(idle: &Timing, p50_us: f64) -> f64 {
    let middle = idle.summary().p50_ns as f64;
    if p50_us <= 0.0 || middle <= 0.0 {
        return 0.0;
    }
    let late = 0.001 * middle / (1e3 * p50_us);
    (idle.quantile_ns(1.0 - late.min(0.5)) as f64 - middle).max(0.0) / 1e3
}

/// Times a batch; none where the run is to stop. Nothing else should run meanwhile.
pub(crate) fn batch(
    anchor: &Setting<'_>,
    settings: &[&Setting<'_>],
    material: Option<&str>,
    times: Times,
    monitor: &dyn Monitor,
) -> Result<Option<Batch>, Diagnostic> {
    let mut first = Entry::new(anchor, material, monitor)?;
    first.warm();
    let idle = Entry::spins(first.warm(), first.tick_hz, first.block);
    let mut entries = vec![idle, first];
    let mut made: Vec<Result<(), String>> = Vec::new();
    for setting in settings {
        let entry = Entry::new(setting, material, monitor);
        made.push(entry.map(|entry| entries.push(entry)).map_err(|e| e.to_string()));
    }
    for entry in entries.iter_mut().skip(2) {
        entry.warm();
    }
    let mut order: Vec<usize> = (0..entries.len()).collect();
    for turn in 0..times.turns {
        order.sort_by_key(|i| random::bits(turn as u64 + 1, *i as u64));
        for &i in &order {
            if monitor.stopped() {
                return Ok(None);
            }
            entries[i].turn(times.turn_ms);
        }
        monitor.advanced(1);
    }
    let idle = &entries[0].ticks;
    let mut done = entries.iter().map(|entry| {
        let time = entry.time();
        Time { stall_us: stall_us(idle, time.p50_us), ..time }
    });
    let (Some(idle), Some(anchor)) = (done.next(), done.next()) else { return Ok(None) };
    let mut time =
        |made: Result<(), String>| made.and_then(|()| done.next().ok_or("it was not timed".into()));
    let rows = settings.iter().zip(made).map(|(s, made)| (s.row.key.clone(), time(made))).collect();
    Ok(Some(Batch { idle, anchor, rows }))
}

impl Time {
    /// The time on a machine that is slower by this factor. Only medians and load are scaled: stalls last as
    /// long on any machine. No percentile is below the median.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        let p50_us = self.p50_us * factor;
        Self {
            p50_us,
            p99_us: self.p99_us.max(p50_us),
            p999_us: self.p999_us.max(p50_us),
            max_us: self.max_us.max(p50_us),
            load_percent: self.load_percent * factor,
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::graph_of;

    fn graph(tick_hz: u32, every: &[u32]) -> GraphFile {
        let nodes: Vec<String> =
            every.iter().enumerate().map(|(i, e)| format!("\"{i}\": (kind: \"mix\", every: {e})")).collect();
        GraphFile { tick_hz, ..graph_of("g.ron", &nodes.join(", "), "") }
    }

    #[test]
    fn memory_excludes_what_the_process_shares() {
        use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

        struct Heap(Option<AtomicU64>);
        impl Monitor for Heap {
            fn heap_bytes(&self) -> Option<u64> {
                self.0.as_ref().map(|bytes| bytes.load(Relaxed))
            }
        }
        let heap = Heap(Some(AtomicU64::new(0)));
        let bytes = heap.0.as_ref().unwrap();
        struct Made<'h>(&'h AtomicU64);
        impl Drop for Made<'_> {
            fn drop(&mut self) {
                self.0.fetch_sub(100, Relaxed);
            }
        }
        // 100 bytes, and a model of 1000 that the first one reads.
        let make = || {
            bytes.fetch_add(if bytes.load(Relaxed) == 0 { 1100 } else { 100 }, Relaxed);
            Ok::<_, ()>(Made(bytes))
        };
        let (_first, first) = weighed(&heap, make).unwrap();
        assert_eq!((first, heap.heap_bytes()), (Some(100), Some(1100)));
        assert_eq!(weighed(&heap, make).unwrap().1, Some(100));
        assert_eq!(weighed(&Heap(None), || Ok::<_, ()>(())).unwrap().1, None);
    }

    #[test]
    fn block_is_a_multiple_of_all_periods() {
        // 8 ms, extended to a multiple of all periods.
        for (tick_hz, every, ticks) in [
            (500, &[1, 1][..], 4),
            (500, &[2], 4),
            (500, &[8], 8),
            (500, &[16, 1], 16),
            (250, &[4], 4),
            (1000, &[3], 9),
            (500, &[4, 6, 1], 12),
            (100, &[], 1),
            (700, &[1], 6),
            (500, &[1000, 999], MOST_TICKS),
        ] {
            assert_eq!(block_ticks(&graph(tick_hz, every)), ticks, "{tick_hz} Hz, every {every:?}");
        }
    }

    #[test]
    fn turn_is_whole_blocks() {
        let mut entry = Entry::spins(0, 500, 16);
        entry.warm();
        assert_eq!(entry.time().ticks, 0);
        entry.turn(100);
        // 50 ticks are three blocks. A turn has at least one.
        assert_eq!(entry.time().ticks, 48);
        entry.turn(8);
        assert_eq!(entry.time().ticks, 64);
        entry.blocks = Timing::new(3);
        entry.blocks.record(320_000);
        // 320 us of 32 ms.
        assert!((entry.time().load_percent - 1.0).abs() < 1e-3);
    }

    #[test]
    fn idle_tick_lasts_as_long_as_the_default() {
        let mut beside = Entry::spins(30_000, 500, 4);
        let mut idle = Entry::spins(beside.warm(), 500, 4);
        assert_eq!((beside.time().ticks, beside.spin_ns), (0, 30_000));
        for entry in [&mut beside, &mut idle] {
            entry.turn(40);
        }
        let (beside, idle) = (beside.time(), idle.time());
        assert_eq!(beside.ticks, idle.ticks);
        // It never ends early, however slow the machine is.
        assert!(idle.p50_us >= 29.9, "{idle:?}");
    }

    #[test]
    fn longer_ticks_meet_more_stalls() {
        // 20 us, of which one in 2000 is 4 ms late, and one in 20000 a second.
        let mut idle = Timing::new(3);
        for n in 0..40_000 {
            idle.record(match n {
                0 | 1 => 1_000_020_000,
                n if n % 2000 == 0 => 4_020_000,
                _ => 20_000,
            });
        }
        let near = |us: f64, want: f64| assert!((us - want).abs() <= 0.002 * want + 0.05, "{us} {want}");
        for (p50_us, want) in [(20.0, 0.0), (5.0, 0.0), (50.0, 4000.0), (1000.0, 1e6), (0.0, 0.0)] {
            near(stall_us(&idle, p50_us), want);
        }
        assert_eq!(stall_us(&Timing::new(3), 20.0), 0.0);
    }

    #[test]
    fn scaling_leaves_stalls_unchanged() {
        let time = Time {
            p50_us: 10.0,
            p99_us: 12.0,
            p999_us: 4000.0,
            max_us: 5000.0,
            load_percent: 0.5,
            cold_us: 30.0,
            stall_us: 3990.0,
            ..Time::default()
        };
        let want = Time { p50_us: 5.0, load_percent: 0.25, ..time };
        assert_eq!(time.scaled(0.5), want);
        let want = Time { p50_us: 20.0, load_percent: 1.0, p99_us: 20.0, ..time };
        assert_eq!(time.scaled(2.0), want);
    }
}
