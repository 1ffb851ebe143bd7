use super::super::testing::{Counter, Reference, call, options};
use super::super::{callback, paced};
use super::*;
use std::time::Duration;

fn wait_for(options: &Options, tick: u64) {
    while options.meters.next_tick() < tick {
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn timer_ticks_evenly_and_returns_the_ticker() {
    let options = options(1000);
    let timer = timer(Counter::new(48_000, 1000, 1, 5), &options).expect("a thread");
    wait_for(&options, 20);
    assert!(timer.controls().up());
    let ticker = timer.stop().expect("the ticker");
    let start = ticker.times[0].1;
    assert!(ticker.times.iter().all(|(tick, time)| time - start == (tick - 5) * 1_000_000));
    assert_eq!(options.meters.next_tick(), ticker.next);
}

#[test]
fn late_timer_skips_ticks_and_counts_them() {
    let options = options(1000);
    let mut ticker = Counter::new(48_000, 1000, 1, 0);
    ticker.stall = Some((20, Duration::from_millis(60)));
    let timer = timer(ticker, &options).expect("a thread");
    wait_for(&options, 120);
    let ticker = timer.stop().expect("the ticker");
    let skipped = options.meters.skipped_ticks.get();
    assert!(skipped >= 50, "{skipped}");
    assert_eq!(ticker.next - ticker.times.len() as u64, skipped);
    let start = ticker.times[0].1;
    assert!(ticker.times.iter().all(|(tick, time)| time - start == tick * 1_000_000));
    assert!(options.meters.misses.get() >= 1);
}

#[test]
fn panic_under_a_timer_is_told_and_leaves_the_ticker() {
    let mut ticker = Counter::new(48_000, 500, 1, 0);
    ticker.panic_at = Some(10);
    let timer = timer(ticker, &options(500)).expect("a thread");
    while !timer.controls().failed() {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(timer.controls().failed());
    assert_eq!(timer.stop().expect("the ticker").next, 10);
}

#[test]
fn run_moves_from_lost_device_to_timer_and_back() {
    let first = options(500);
    let (driver, mut half) = callback(Counter::new(48_000, 500, 1, 0), &first);
    (0..30).for_each(|i| drop(call(&mut half, 1_000_000_000 + i * 2_000_000, 96, 1)));
    // The device never calls again.
    let ticker = driver.take().expect("the ticker");
    assert_eq!(ticker.next, 30);
    assert_eq!(call(&mut half, 1_060_000_000, 0, 1), [] as [f32; 0]);
    let second = options(500);
    let timer = timer(ticker, &second).expect("a thread");
    wait_for(&second, 40);
    let ticker = timer.stop().expect("the ticker");
    assert!(ticker.next >= 40);
    let mut reference = Reference::new(48_000, 1, ticker.first_sample());
    let (driver, mut half) = callback(ticker, &options(500));
    for i in 0..20 {
        assert_eq!(call(&mut half, 5_000_000_000 + i * 2_000_000, 97, 1), reference.play(97));
    }
    // A thread whose device never called gives it back too.
    let ticker = driver.take().expect("the ticker");
    let next = ticker.next;
    while now_ns() < 250_000_000 {
        std::thread::sleep(Duration::from_millis(5));
    }
    let (paced, _half) = paced(ticker, &options(500)).expect("a thread");
    assert_eq!(paced.stop().expect("the ticker").next, next);
}
