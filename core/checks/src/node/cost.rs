//! Allocations and time of a node.

use std::time::Instant;

use super::input::somewhere;
use super::main;
use super::signal::Signal;
use crate::case::{Found, not_applicable};
use crate::subject::{Heap, Subject, Touched};

/// Ticks on each signal while the heap is watched.
const TICKS: u64 = 1000;

/// Allocations of one function.
#[derive(Default)]
struct Counted {
    calls: u64,
    touching: u64,
    first: u64,
    sum: Touched,
}

impl Counted {
    fn watch<T>(&mut self, heap: &dyn Heap, tick: u64, f: impl FnOnce() -> T) -> T {
        heap.begin();
        let answer = f();
        let Touched { taken, freed } = heap.end();
        self.calls += 1;
        if taken + freed > 0 {
            self.first = if self.touching == 0 { tick } else { self.first };
            self.touching += 1;
            (self.sum.taken, self.sum.freed) = (self.sum.taken + taken, self.sum.freed + freed);
        }
        answer
    }
}

pub(super) fn allocation(subject: &Subject<'_>) -> Found {
    let place = main(subject)?;
    let Some(heap) = subject.heap else { return not_applicable("not counted on this system") };
    let mut stand = place.stand(subject, Signal::Random, false)?;
    let names = ["process", "reset", "set_parameter", "save", "restore", "elapsed"];
    let mut counted = names.map(|_| Counted::default());
    let [process, reset, set, save, restore, elapsed] = &mut counted;
    let mut bytes = vec![0; stand.node.processor.state_size()];
    let params = &place.kind.descriptor().params;
    let mut tick = 0;
    for signal in [Signal::Random, Signal::Scattered, Signal::Zero, Signal::Huge, Signal::Bad, Signal::Random]
    {
        subject.doing(&format!("{} input", signal.word()));
        stand.play(signal);
        for _ in 0..TICKS {
            stand.set_up(tick);
            let answer = process.watch(heap, tick, || stand.call(tick));
            stand.conclude(answer);
            tick += 1;
        }
        // Other cases look at the answers.
        let it = &mut stand.node.processor;
        for (i, p) in params.iter().enumerate() {
            if let Some(value) = somewhere(p, 0.3) {
                set.watch(heap, tick, || it.set_parameter(i, value));
            }
        }
        let len = save.watch(heap, tick, || it.save(&mut bytes)).unwrap_or(0);
        let _ = restore.watch(heap, tick, || it.restore(&bytes[..len]));
        elapsed.watch(heap, tick, || it.elapsed(10));
        reset.watch(heap, tick, || it.reset());
    }
    let touching = names.iter().zip(&counted).filter(|(_, it)| it.touching > 0).map(|(what, it)| {
        let Counted { calls, touching, first, sum: Touched { taken, freed } } = it;
        format!(
            "{what} allocated {taken} and freed {freed} times in {touching} of {calls} calls, first at tick \
             {first}"
        )
    });
    let found: Vec<String> = touching.collect();
    match found.first() {
        Some(what) if !stand.node.allocation_free => {
            not_applicable(format!("it says that it allocates: {what}"))
        }
        None if !stand.node.allocation_free => {
            not_applicable(format!("it says that it allocates, and did not in {tick} ticks"))
        }
        Some(_) => bail!("{}", found.join("; ")),
        None => Ok(format!("none in {tick} ticks")),
    }
}

/// Time of a call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TickTime {
    /// Median \[us\].
    pub median_us: f64,
    /// 99th percentile \[us\].
    pub p99_us: f64,
    /// Longest \[us\].
    pub max_us: f64,
    /// Number of calls.
    pub calls: u64,
}

/// Measures how long a call of the kind takes, for information: no case asks for a bound.
///
/// # Errors
/// The kind cannot be prepared, or it fails.
pub fn tick_time(subject: &Subject<'_>) -> Result<TickTime, String> {
    subject.doing("time per tick");
    let mut stand = subject.main()?.stand(subject, Signal::Random, false)?;
    let calls = subject.ticks.clamp(100, 20_000);
    let mut spent = Vec::with_capacity(calls as usize);
    for tick in 0..calls {
        stand.set_up(tick);
        let start = Instant::now();
        let answer = stand.call(tick);
        spent.push(start.elapsed().as_nanos() as u64);
        stand.conclude(answer);
        answer.map_err(|f| f.to_string())?;
    }
    spent.sort_unstable();
    let at = |part: f64| spent[((spent.len() - 1) as f64 * part) as usize] as f64 * 1e-3;
    Ok(TickTime { median_us: at(0.5), p99_us: at(0.99), max_us: at(1.0), calls })
}
