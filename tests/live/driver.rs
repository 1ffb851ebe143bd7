//! Drivers by the library's own interface: no thread that ticks, and no audio callback, allocates or frees,
//! and memory that the system says it locked is locked.

use std::sync::Arc;
use std::time::Duration;

use asperity_audio::{Block, Process};
use asperity_live::driver::{Options, Rates, Ticker, callback, paced, timer};
use asperity_live::realtime::{Grant, Machine};
use asperity_live::{Meters, RemoteClock, Sample, SampleWriter, Timeline, now_ns, samples};
use harness::alone::apart;
use harness::counting::{self, Who, assert_it_counts};
use harness::test_name;

/// Allocations and frees of the program during something.
fn counted(what: impl FnOnce()) -> u64 {
    counting::counted(Who::Everyone, what)
}

/// A run that reads a hand.
struct Hand {
    line: Timeline,
    to: SampleWriter,
    clock: RemoteClock,
    next: u64,
}

impl Hand {
    fn new() -> Self {
        let (to, from) = samples();
        Self { line: Timeline::new(from, None, 50_000_000), to, clock: RemoteClock::new(), next: 0 }
    }
}

impl Ticker for Hand {
    fn rates(&self) -> Rates {
        Rates { tick_hz: 500, rate_hz: 48_000, channels: 2 }
    }
    fn next_tick(&self) -> u64 {
        self.next
    }
    fn tick(&mut self, time_ns: u64, out: &mut [f32]) {
        let sent_s = time_ns as f64 * 1e-9 - 3.0;
        self.clock.hear(sent_s, time_ns);
        let sent = self.clock.time_ns(sent_s, time_ns);
        let x = self.next as f64;
        // Longer pauses between, so that it stalls.
        if self.next % 200 < 150 {
            self.to.send(Sample {
                time_ns: sent,
                arrived_ns: time_ns,
                position: [x; 3],
                ..Sample::default()
            });
        }
        out.fill(self.line.at(time_ns).position[0] as f32 * 1e-6);
        self.next += 1;
    }
    fn skip(&mut self, n: u64) {
        self.next += n;
    }
}

fn options() -> Options {
    Options { priority: None, start_s: 0.5, ..Options::new(Arc::new(Meters::new(500))) }
}

fn call(half: &mut impl Process, room: &mut [f32], now_ns: u64, frames: usize) {
    half.process(&mut Block { output: &mut room[..frames * 2], channels: 2, now_ns });
}

#[test]
fn no_driver_allocates_while_it_runs() {
    // Every thread is counted, so no other may run.
    if apart(test_name!(), &[]).is_some() {
        return;
    }
    assert_it_counts(Who::Everyone);
    let mut room = vec![0.0; 4096];
    let sizes = [64, 0, 1, 1024, 97, 441];

    let (driver, mut half) = callback(Hand::new(), &options());
    let mut now = 1_000_000_000;
    let allocated = counted(|| {
        for i in 0..10_000 {
            let frames = sizes[i % sizes.len()];
            call(&mut half, &mut room, now, frames);
            now += frames as u64 * 1_000_000_000 / 48_000 + if i % 900 == 0 { 70_000_000 } else { 0 };
            driver.controls().run_control().mute(i % 1000 > 900);
        }
    });
    assert_eq!(allocated, 0, "callback");
    assert!(driver.controls().meters().skipped_ticks.get() > 0, "gaps were among it");
    assert!(driver.take().expect("the ticker").line.seen().stalls > 0, "stalls too");

    let (driver, mut half) = paced(Hand::new(), &options()).expect("a thread");
    let began = now_ns();
    let mut frames = 0;
    let mut play = |ms: u64| {
        while now_ns() - began < ms * 1_000_000 {
            let due = began + frames * 1_000_000_000 / 48_000;
            std::thread::sleep(Duration::from_nanos(due.saturating_sub(now_ns())));
            call(&mut half, &mut room, now_ns(), 256);
            frames += 256;
        }
    };
    play(200);
    assert_eq!(counted(|| play(700)), 0, "paced");
    assert!(driver.controls().meters().next_tick() > 100);
    drop(driver.stop());

    let timer = timer(Hand::new(), &options()).expect("a thread");
    std::thread::sleep(Duration::from_millis(20));
    assert_eq!(counted(|| std::thread::sleep(Duration::from_millis(100))), 0, "timer");
    drop(timer.stop());
}

#[cfg(target_os = "linux")]
#[test]
fn memory_that_is_called_locked_is_locked() {
    // The memory of the whole process is locked.
    if apart(test_name!(), &[]).is_some() {
        return;
    }
    let machine = Machine::ask();
    let grants = machine.grants(Grant::NotAsked);
    let status = std::fs::read_to_string("/proc/self/status").expect("the process's own figures");
    let locked = status.lines().find_map(|l| l.strip_prefix("VmLck:")).expect("a figure for locked memory");
    let kb: u64 = locked.trim().trim_end_matches(" kB").parse().expect("a number");
    assert_eq!(grants.memory == Grant::Granted, kb > 0, "{grants:?}, {kb} kB");
    let missing = [grants.memory, grants.latency].iter().filter(|g| g.missing()).count();
    assert_eq!(grants.refused().len(), missing);
}
