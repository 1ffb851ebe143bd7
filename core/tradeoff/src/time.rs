//! Times of settings, taken in turns.
//!
//! A batch of settings takes turns with the default and with a tick that does nothing, over and over, in an order that changes from round to round: what else
//! the machine does falls on all alike. The default is in every batch; by the ratio to it batches, and shards on other machines, are put together.
//!
//! A machine stalls by itself now and then, for milliseconds on one that is shared; whoever takes longer meets more of it. The tick that does nothing therefore
//! spins for as long as the median tick of the default, as often as that ticks, and what it takes beyond that is the machine's.

use std::path::Path;
use std::time::Instant;

use asperity_accuracy::timing::Timing;
use asperity_diagnostics::Diagnostic;
use asperity_engine::Options;
use asperity_graph::GraphFile;
use asperity_node::{Registry, random};
use serde::{Deserialize, Serialize};

use crate::file::Times;
use crate::floor::median;
use crate::hear::{Chain, over};
use crate::result::Time;
use crate::setting::Setting;
use crate::spot;

/// Least length of signal whose median time is what is ranked; where nodes run in some ticks only, so much longer that all have run as often in each.
pub const LOAD_MS: u64 = 8;
/// Most ticks that such a length has. Where nodes that run in every n-th tick come to the same again after more, a length has one call of each too many or
/// too few at most.
const MOST_TICKS: u64 = 8000;
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
    /// A kept part was changed after it was written, and is measured again.
    fn spoiled(&self, _file: &Path) {}
}

/// Times of a batch.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Batch {
    /// A tick in which nothing is done, for as long as the median of the default's.
    pub empty: Time,
    /// The default of the first graph.
    pub anchor: Time,
    /// Keys of settings, with their times or why there are none.
    pub rows: Vec<(String, Result<Time, String>)>,
}

/// What is timed.
enum Work {
    Chain(Box<Chain>),
    /// Nothing, for so many nanoseconds.
    Spin(u64),
}

/// One that takes turns.
struct Entry {
    work: Work,
    tick_hz: u32,
    /// Ticks whose sum is timed for the load.
    group: u64,
    timing: Timing,
    groups: Timing,
    turns: Vec<f64>,
    misses: u64,
    /// The first tick of each turn, while the others' had the caches.
    cold: Vec<f64>,
    memory: Option<u64>,
}

/// Ticks of a length of [`LOAD_MS`] and more in which each node runs as often as in any other of that length.
fn group(graph: &GraphFile) -> u64 {
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

/// What is made, and how many bytes it takes, where they can be counted. It is made twice: what is kept of the first, such as models that were read lately, is
/// there for all that are made.
fn weighed<T, E>(onlooker: &dyn Onlooker, make: impl Fn() -> Result<T, E>) -> Result<(T, Option<u64>), E> {
    drop(make()?);
    let before = onlooker.heap_bytes();
    let made = make()?;
    let bytes = before.zip(onlooker.heap_bytes()).map(|(before, after)| after.saturating_sub(before));
    Ok((made, bytes))
}

impl Entry {
    fn new(
        setting: &Setting,
        registry: &Registry,
        material: Option<&str>,
        onlooker: &dyn Onlooker,
    ) -> Result<Self, Diagnostic> {
        let graph: GraphFile = over(&setting.graph, registry, material, setting.graph.seed);
        let options = Options { guards: setting.guards, ..Options::default() };
        let way = spot::round(&graph, registry)?;
        let (chain, memory) = weighed(onlooker, || Chain::new(&graph, registry, vec![way.clone()], options))?;
        Ok(Self { memory, ..Self::of(Work::Chain(Box::new(chain)), graph.tick_hz, group(&graph)) })
    }

    fn of(work: Work, tick_hz: u32, group: u64) -> Self {
        let (timing, groups) = (Timing::new(3), Timing::new(3));
        let (turns, cold) = (Vec::new(), Vec::new());
        Self { work, tick_hz, group, timing, groups, turns, misses: 0, cold, memory: None }
    }

    /// One that does nothing, for as long as this one's median tick, as often.
    fn idle(&mut self) -> Self {
        self.turn(WARM_MS, true);
        let spin = self.timing.summary().p50_ns;
        let (work, tick_hz, group) =
            (std::mem::replace(&mut self.work, Work::Spin(0)), self.tick_hz, self.group);
        *self = Self { memory: self.memory, ..Self::of(work, tick_hz, group) };
        Self::of(Work::Spin(spin), tick_hz, group)
    }

    /// One tick; how many nanoseconds it took.
    fn tick(&mut self) -> u64 {
        let began = Instant::now();
        match &mut self.work {
            Work::Chain(chain) => chain.engine().tick(),
            Work::Spin(ns) => {
                while began.elapsed().as_nanos() < u128::from(*ns) {
                    std::hint::spin_loop();
                }
            }
        }
        began.elapsed().as_nanos() as u64
    }

    /// One turn.
    fn turn(&mut self, ms: u64, counts: bool) {
        let group = self.group.max(1);
        let groups = (u64::from(self.tick_hz) * ms / 1000 / group).max(1);
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
        let lasts_ns = self.group as f64 * 1e9 / f64::from(self.tick_hz);
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
            stall_us: 0.0,
            faults: match &self.work {
                Work::Chain(chain) => chain.faults(),
                Work::Spin(_) => 0,
            },
        }
    }
}

/// What the machine by itself adds to the 99.9th percentile of a tick of this median \[us\], from ticks in which nothing was done.
///
/// One that takes k times as long meets k times as many stalls: of its ticks as many are that late at 99.9 % as of those at `1 - 0.001 / k`.
fn stall_us(idle: &Timing, p50_us: f64) -> f64 {
    let middle = idle.summary().p50_ns as f64;
    if p50_us <= 0.0 || middle <= 0.0 {
        return 0.0;
    }
    let late = 0.001 * middle / (1e3 * p50_us);
    (idle.quantile_ns(1.0 - late.min(0.5)) as f64 - middle).max(0.0) / 1e3
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
    let mut first = Entry::new(anchor.0, anchor.1, material, onlooker)?;
    first.turn(WARM_MS, false);
    let idle = first.idle();
    let mut entries = vec![idle, first];
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
    for entry in entries.iter_mut().skip(2) {
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
    let idle = &entries[0].timing;
    let mut done = entries.iter().map(|entry| {
        let time = entry.time();
        Time { stall_us: stall_us(idle, time.p50_us), ..time }
    });
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
    /// What it would have been where everything is so much slower or faster. Only medians are: a stall takes as long on a fast machine, and one that was met
    /// is not one that another machine has. No percentile is below the median.
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
    use asperity_diagnostics::Source;

    fn graph(tick_hz: u32, every: &[u32]) -> GraphFile {
        let nodes: Vec<String> =
            every.iter().enumerate().map(|(i, e)| format!("\"{i}\": (kind: \"mix\", every: {e})")).collect();
        let text = format!("Graph(version: 1, tick_hz: {tick_hz}, nodes: {{{}}})", nodes.join(", "));
        GraphFile::parse(&Source::new("g.ron", text)).unwrap()
    }

    #[test]
    fn what_a_process_keeps_of_a_graph_is_not_counted_as_its_memory() {
        use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

        #[derive(Default)]
        struct Heap(AtomicU64);
        impl Onlooker for Heap {
            fn heap_bytes(&self) -> Option<u64> {
                Some(self.0.load(Relaxed))
            }
        }
        struct Made<'h>(&'h Heap);
        impl Drop for Made<'_> {
            fn drop(&mut self) {
                self.0.0.fetch_sub(100, Relaxed);
            }
        }
        let heap = Heap::default();
        let kept = std::cell::Cell::new(false);
        // 100 bytes, and a model of 1000 that whichever comes first reads.
        let make = || {
            heap.0.fetch_add(if kept.replace(true) { 100 } else { 1100 }, Relaxed);
            Ok::<_, ()>(Made(&heap))
        };
        let (first, bytes) = weighed(&heap, make).unwrap();
        assert_eq!((bytes, heap.heap_bytes()), (Some(100), Some(1100)));
        let (_second, bytes) = weighed(&heap, make).unwrap();
        assert_eq!(bytes, Some(100));
        drop(first);
        struct Blind;
        impl Onlooker for Blind {}
        assert_eq!(weighed(&Blind, || Ok::<_, ()>(())).unwrap().1, None);
    }

    #[test]
    fn the_load_is_of_as_many_calls_of_every_node_whatever_ticks_they_run_in() {
        // 8 ms, and so many more that all periods are whole.
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
            assert_eq!(group(&graph(tick_hz, every)), ticks, "{tick_hz} Hz, every {every:?}");
        }
    }

    #[test]
    fn a_turn_is_whole_groups_and_the_load_is_over_what_they_last() {
        let mut entry = Entry::of(Work::Spin(0), 500, 16);
        entry.turn(100, false);
        assert_eq!(entry.time().ticks, 0);
        entry.turn(100, true);
        // 50 ticks are three groups; one that is longer than a turn is had all the same.
        assert_eq!(entry.time().ticks, 48);
        entry.turn(8, true);
        assert_eq!(entry.time().ticks, 64);
        entry.groups = Timing::new(3);
        entry.groups.record(320_000);
        // 320 us of 32 ms.
        assert!((entry.time().load_percent - 1.0).abs() < 1e-3);
    }

    #[test]
    fn the_tick_that_does_nothing_lasts_as_long_as_what_it_is_beside() {
        let mut beside = Entry::of(Work::Spin(30_000), 500, 4);
        let mut idle = beside.idle();
        assert_eq!(beside.time().ticks, 0);
        assert!(matches!(beside.work, Work::Spin(30_000)));
        for entry in [&mut beside, &mut idle] {
            entry.turn(40, true);
        }
        let (beside, idle) = (beside.time(), idle.time());
        assert_eq!(beside.ticks, idle.ticks);
        // It ends no sooner than what it is beside, however slow the machine is.
        assert!(idle.p50_us >= 29.9, "{idle:?}");
    }

    #[test]
    fn what_takes_longer_meets_more_stalls() {
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
        near(stall_us(&idle, 20.0), 0.0);
        near(stall_us(&idle, 5.0), 0.0);
        near(stall_us(&idle, 50.0), 4000.0);
        near(stall_us(&idle, 1000.0), 1e6);
        near(stall_us(&idle, 0.0), 0.0);
        assert_eq!(stall_us(&Timing::new(3), 20.0), 0.0);
    }

    #[test]
    fn only_medians_are_another_machines() {
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
