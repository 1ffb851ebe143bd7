use super::super::testing::{Counter, Reference, call, options};
use super::*;
use crate::realtime::{Grant, ask_priority};
use asperity_node::random::bits;
use std::time::Duration;

/// A device in real time. Its output must be the stream at its own position in time, bit for bit, except
/// for samples that the meters count as missing.
struct Device {
    half: PacedHalf,
    options: Options,
    reference: Reference,
    rate_hz: u32,
    first_tick: u64,
    first: u64,
    start_ns: u64,
    frames: u64,
    end: u64,
    played: u64,
}

impl Device {
    fn new(ticker: Counter, options: Options) -> (Driver<Counter>, Self) {
        let (Rates { rate_hz, channels, .. }, first) = (ticker.rates, ticker.first_sample());
        let first_tick = ticker.next;
        let (driver, half) = paced(ticker, &options).expect("a thread");
        let (reference, start_ns) = (Reference::new(rate_hz, channels, first), now_ns());
        let (frames, end, played) = (0, 0, 0);
        (driver, Self { half, options, reference, rate_hz, first_tick, first, start_ns, frames, end, played })
    }

    /// Plays one block when it is due, and returns it.
    fn call(&mut self, frames: usize) -> Vec<f32> {
        sleep_until(self.start_ns + self.frames * 1_000_000_000 / u64::from(self.rate_hz));
        self.frames += frames as u64;
        let (began, before) = (self.half.began, self.options.meters.lost_samples.get());
        let channels = self.half.out.channels;
        let heard = call(&mut self.half, now_ns(), frames, channels);
        if frames == 0 || self.half.out.controls.failed() || self.half.out.controls.stopping() {
            return heard;
        }
        let position = self.half.out.dll.line().end() as u64 - frames as u64;
        let lost = position - self.end;
        self.end = position + frames as u64;
        let begin = self.half.stream.begin.load(Acquire);
        let silent = begin.saturating_sub(position).min(frames as u64);
        let passed = match (began, self.half.began) {
            (true, _) => lost,
            (false, true) => position.saturating_sub(begin),
            _ => 0,
        };
        // Lost samples beyond passed time are missing at the end of this block.
        let missing = self.options.meters.lost_samples.get() - before - passed;
        assert!(missing <= frames as u64 - silent, "{missing} of {frames}");
        if began && lost > 0 {
            self.reference.ramp.broken();
        }
        let mut want = self.reference.starve(silent as usize);
        self.reference.next = self.first + (position + silent).saturating_sub(begin);
        let there = frames - (silent + missing) as usize;
        want.extend(self.reference.play(there));
        want.extend(self.reference.starve(missing as usize));
        assert!(heard == want, "at {position}, {frames} frames, {missing} missing, {lost} lost");
        self.played += there as u64;
        heard
    }

    fn run(&mut self, ms: u64, sizes: &[usize]) {
        let until = now_ns() + ms * 1_000_000;
        let mut i = 0;
        while now_ns() < until {
            i += 1;
            self.call(sizes[bits(8, i) as usize % sizes.len()]);
        }
    }

    /// Runs until 10 ms were played, however slowly the thread begins.
    fn run_until_played(&mut self, sizes: &[usize]) {
        while self.played < u64::from(self.rate_hz / 100) {
            self.run(20, sizes);
        }
    }

    /// Keeps calling, as a device does, while `what` runs.
    fn while_it<R>(mut self, what: impl FnOnce() -> R) -> (R, Self) {
        let over = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            let calling = scope.spawn(|| {
                while !over.load(Acquire) {
                    self.call(64);
                }
                self
            });
            let result = what();
            over.store(true, Release);
            (result, calling.join().expect("the device"))
        })
    }
}

/// Computed samples are those played, those dropped or skipped for missing ones, and some ahead.
fn account(device: &Device, ticker: &Counter, tail_ms: u64) {
    let rate = u64::from(device.rate_hz);
    let passed = device.played + device.options.meters.lost_samples.get();
    let computed = ticker.first_sample() - device.first;
    assert!(computed + rate * tail_ms / 1000 >= passed, "{computed} computed, {passed} passed");
    let left_out = ticker.next - device.first_tick - ticker.times.len() as u64;
    assert_eq!(left_out, device.options.meters.skipped_ticks.get());
    assert!(ticker.times.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 <= w[1].1));
}

#[test]
fn paced_stream_keeps_its_place_in_time() {
    for (rate_hz, tick_hz, sizes) in [
        (48_000, 500, &[1024][..]),
        (44_100, 500, &[0, 1, 64, 97, 441, 1024]),
        (96_000, 4_000, &[480, 33]),
        (48_000, 100, &[256]),
        (8_000, 3_000, &[160]),
    ] {
        let (driver, mut device) = Device::new(Counter::new(rate_hz, tick_hz, 2, 7), options(tick_hz));
        device.run(400, sizes);
        device.run_until_played(sizes);
        let meters = Arc::clone(&device.options.meters);
        println!(
            "{rate_hz} {tick_hz} {sizes:?}: lead {} us, {} underruns, {} lost, late {:?} us",
            driver.controls().lead_ns() / 1000,
            meters.underruns.get(),
            meters.lost_samples.get(),
            meters.late.figures_us()
        );
        let (ticker, device) = device.while_it(|| driver.stop());
        account(&device, &ticker.expect("the ticker"), 100);
    }
}

#[test]
fn ring_has_room_for_callbacks_of_any_length() {
    for (rate_hz, tick_hz, channels, frames, seen) in [
        (48_000, 500, 2, 16_384, false),
        (44_100, 500, 1, 65_536, false),
        (48_000, 500, 8, 65_536, true),
        (8_000, 100, 2, 65_536, true),
    ] {
        let rates = Rates { tick_hz, rate_hz, channels };
        let options = Options { seen_frames: if seen { frames } else { 0 }, ..options(tick_hz) };
        let ahead = (MARGIN_NS * 2e-9 * f64::from(rate_hz)) as usize + 1;
        let holds = (frames as usize + ahead) * channels + rates.most();
        assert!(room(&rates, &options) >= holds, "{frames} frames at {rate_hz} Hz");
    }
}

#[test]
fn callback_of_a_third_of_a_second_is_filled() {
    for (rate_hz, frames) in [(48_000, 16_384), (96_000, 65_536)] {
        let (driver, mut device) = Device::new(Counter::new(rate_hz, 500, 1, 0), options(500));
        // However busy the machine: without room for them, none would be.
        let filled = (0..40).any(|_| {
            let lost = device.options.meters.lost_samples.get();
            device.call(frames);
            device.played >= frames as u64 && device.options.meters.lost_samples.get() == lost
        });
        assert!(filled, "{frames} frames at {rate_hz} Hz");
        let (ticker, _) = device.while_it(|| driver.stop());
        assert!(ticker.is_some());
    }
}

#[test]
fn device_thread_requests_priority_too() {
    let options = Options { priority: Some(5), ..options(500) };
    let (driver, mut half) = paced(Counter::new(48_000, 500, 1, 0), &options).expect("a thread");
    let controls = Arc::clone(driver.controls());
    let asked = move || controls.device_asked.as_ref().map(Asked::get);
    assert_eq!(asked(), Some(Grant::NotAsked));
    // Not on the test's own thread, which would keep it.
    let device = std::thread::spawn(move || {
        call(&mut half, now_ns(), 64, 1);
        ask_priority(5)
    });
    let granted = device.join().expect("the device");
    assert_eq!(asked(), Some(granted), "what the thread gets when it asks");
}

#[test]
fn stalled_tick_costs_counted_samples_and_no_latency() {
    for (stall_ms, frames) in [(30, 256), (120, 64), (400, 1024)] {
        let mut ticker = Counter::new(48_000, 500, 1, 0);
        ticker.stall = Some((100, Duration::from_millis(stall_ms)));
        let (driver, mut device) = Device::new(ticker, options(500));
        device.run(1_200, &[frames]);
        let meters = Arc::clone(&device.options.meters);
        let (underruns, lost) = (meters.underruns.get(), meters.lost_samples.get());
        assert!(underruns > 0 && lost >= (stall_ms - 28) * 48 / 2, "{lost}");
        assert!(meters.misses.get() > 0 && meters.caught_up_ticks.get() + meters.skipped_ticks.get() > 0);
        assert!(stall_ms < 100 || meters.skipped_ticks.get() > 0);
        // In the end nothing is owed: the ring holds the stream at its place in time.
        let owed = |device: &Device| device.half.owed - device.half.stream.skipped.load(Acquire);
        for _ in 0..2_000 {
            if owed(&device) > 0 {
                device.call(frames);
            }
        }
        assert_eq!(owed(&device), 0, "after {stall_ms} ms, {frames} frames");
        println!("{stall_ms} ms: {underruns} underruns, {lost} lost, {} skipped", meters.skipped_ticks.get());
        let (ticker, device) = device.while_it(|| driver.stop());
        account(&device, &ticker.expect("the ticker"), 100);
    }
}

#[test]
fn device_after_a_standstill_plays_nothing_stale() {
    let (driver, mut device) = Device::new(Counter::new(48_000, 1_000, 1, 0), options(1_000));
    device.run(900, &[128]);
    while !device.half.out.dll.settled() {
        device.run(100, &[128]);
    }
    let before = device.options.meters.lost_samples.get();
    // The device's own time goes on; its callback does not come for longer than the ring has room for.
    let ms = (ROOM_S * 1e3) as u64 + 400;
    std::thread::sleep(Duration::from_millis(ms));
    device.start_ns += ms * 1_000_000;
    device.run(500, &[128]);
    let meters = Arc::clone(&device.options.meters);
    assert!(meters.xruns.get() >= 1);
    let lost = meters.lost_samples.get() - before;
    assert!(lost >= (ms - 10) * 48, "{lost}");
    assert!(meters.skipped_ticks.get() > 0);
    let (ticker, device) = device.while_it(|| driver.stop());
    account(&device, &ticker.expect("the ticker"), 100);
}

#[test]
fn panic_ends_in_silence_and_the_device_goes_on() {
    let mut ticker = Counter::new(48_000, 500, 1, 0);
    ticker.panic_at = Some(60);
    let (driver, mut device) = Device::new(ticker, options(500));
    while !driver.controls().failed() {
        device.call(128);
    }
    let heard: Vec<f32> = (0..12).flat_map(|_| device.call(128)).collect();
    assert!(heard[960..].iter().all(|x| *x == 0.0), "silent within 20 ms");
    assert!(driver.controls().failed());
    assert_eq!(driver.stop().expect("the ticker").times.len(), 60);
    assert_eq!(device.call(128), [0.0; 128]);
}

#[test]
fn stop_ramps_down_and_does_not_wait_for_a_dead_device() {
    let (driver, mut device) = Device::new(Counter::new(48_000, 500, 1, 50), options(500));
    device.run_until_played(&[256]);
    device.run(20, &[256]);
    assert!(driver.controls().up());
    let controls = Arc::clone(driver.controls());
    let (ticker, mut device) = device.while_it(|| driver.stop());
    assert!(ticker.is_some() && controls.down());
    assert_eq!(device.call(64), [0.0; 64]);

    let (driver, mut device) = Device::new(Counter::new(48_000, 500, 1, 50), options(500));
    device.run_until_played(&[256]);
    assert!(driver.stop().expect("the ticker").times.len() >= 5);
}
