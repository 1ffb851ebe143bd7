use super::super::testing::{Counter, Reference, call, options};
use super::*;
use asperity_node::random::{bits, uniform};

const SIZES: [usize; 6] = [0, 1, 64, 97, 441, 1024];

/// A device in a time of its own.
struct Device {
    half: CallbackHalf<Counter>,
    rate_hz: u32,
    frames: u64,
    lost_ns: u64,
    calls: u64,
    jitter_ns: f64,
    now_ns: u64,
}

impl Device {
    fn new(half: CallbackHalf<Counter>, rate_hz: u32, jitter_ns: f64) -> Self {
        Self { half, rate_hz, frames: 0, lost_ns: 0, calls: 0, jitter_ns, now_ns: 0 }
    }

    fn call(&mut self, frames: usize, channels: usize) -> Vec<f32> {
        self.calls += 1;
        let exact = 1_000_000_000 + self.lost_ns + self.frames * 1_000_000_000 / u64::from(self.rate_hz);
        self.now_ns = exact + (self.jitter_ns * uniform(2, self.calls)) as u64;
        self.frames += frames as u64;
        call(&mut self.half, self.now_ns, frames, channels)
    }
}

#[test]
fn samples_play_once_in_order_for_any_block_size() {
    for (rate_hz, tick_hz) in [
        (44_100, 500),
        (48_000, 100),
        (48_000, 4_000),
        (96_000, 1_000),
        (44_100, 700),
        (44_100, 4_000),
        (8_000, 3_000),
        (2_500, 4_000),
    ] {
        let options = options(tick_hz);
        let ticker = Counter::new(rate_hz, tick_hz, 2, 77);
        let mut reference = Reference::new(rate_hz, 2, ticker.first_sample());
        let (driver, half) = callback(ticker, &options);
        let mut device = Device::new(half, rate_hz, 0.2e6);
        for i in 0..1_500 {
            let frames = SIZES[bits(4, i) as usize % SIZES.len()];
            let heard = device.call(frames, 2);
            assert_eq!(heard, reference.play(frames), "{rate_hz} at {tick_hz}, callback {i}");
        }
        let ticker = driver.take().expect("the ticker");
        assert_eq!((options.meters.lost_samples.get(), options.meters.xruns.get()), (0, 0));
        assert!(ticker.first_sample() >= reference.next, "no more than the last tick is computed ahead");
        let ahead = ticker.first_sample() - reference.next;
        assert!(ahead <= u64::from(rate_hz.div_ceil(tick_hz)), "{ahead}");
    }
}

#[test]
fn ticks_read_the_hand_evenly_one_period_ago() {
    for (rate_hz, tick_hz, frames) in
        [(48_000, 500, 64), (48_000, 500, 1024), (44_100, 500, 441), (48_000, 4_000, 97), (2_500, 4_000, 5)]
    {
        let options = options(tick_hz);
        let (driver, half) = callback(Counter::new(rate_hz, tick_hz, 1, 0), &options);
        let mut device = Device::new(half, rate_hz, 0.1e6);
        let period_ns = frames as f64 * 1e9 / f64::from(rate_hz);
        for _ in 0..(6e9 / period_ns) as usize {
            device.call(frames, 1);
            let lead = driver.controls().lead_ns() as f64;
            assert!(
                (lead / period_ns - 1.0).abs() < 0.01,
                "{lead} of {period_ns}, from the first callback on"
            );
            let settled = device.now_ns > 4_000_000_000;
            if let Some(Some(ticker)) = device.half.slot.try_lock().as_deref() {
                let newest = ticker.times.last().map_or(0, |t| t.1);
                assert!(!settled || newest <= device.now_ns + 100_000, "read {newest} at {}", device.now_ns);
            }
        }
        let lead = driver.controls().lead_ns() as f64;
        assert!((lead / period_ns - 1.0).abs() < 1e-3, "{lead} of {period_ns}");
        let ticker = driver.take().expect("the ticker");
        let late = ticker.times.iter().filter(|t| t.1 > 4_000_000_000);
        let times: Vec<f64> = late.map(|t| t.1 as f64).collect();
        let tick_ns = 1e9 / f64::from(tick_hz);
        let mut off: Vec<f64> = times.windows(2).map(|w| (w[1] - w[0] - tick_ns).abs()).collect();
        off.sort_by(f64::total_cmp);
        let p99 = off[off.len() * 99 / 100];
        println!("{frames} frames at {rate_hz}, {tick_hz} Hz: p99 {:.2} us off", p99 / 1e3);
        assert!(p99 < 2e3 && off[off.len() - 1] < 10e3, "{p99}");
    }
}

#[test]
fn callback_gap_skips_whole_ticks_and_counts_lost_samples() {
    for (rate_hz, tick_hz, frames, gap_ms) in
        [(48_000, 500, 64, 14), (48_000, 500, 1024, 150), (44_100, 1_000, 97, 33), (48_000, 100, 64, 7)]
    {
        let options = options(tick_hz);
        let mut reference = Reference::new(rate_hz, 1, 0);
        let (driver, half) = callback(Counter::new(rate_hz, tick_hz, 1, 0), &options);
        let mut device = Device::new(half, rate_hz, 0.0);
        let mut gaps = 0;
        for i in 0..6_000_000 / frames {
            let in_gap = i % (3 * rate_hz as usize / frames) == 3 * rate_hz as usize / frames - 1;
            device.lost_ns += u64::from(in_gap) * gap_ms * 1_000_000;
            let before = (options.meters.lost_samples.get(), options.meters.xruns.get());
            let heard = device.call(frames, 1);
            if options.meters.xruns.get() > before.1 {
                gaps += 1;
                reference.ramp.broken();
                reference.next += options.meters.lost_samples.get() - before.0;
            }
            assert_eq!(heard, reference.play(frames), "callback {i}");
            if let Some(Some(ticker)) = device.half.slot.try_lock().as_deref() {
                // A tick reads the hand a period before the callback's time at its first sample, also after
                // gaps.
                let (tick, read_ns) = *ticker.times.last().unwrap();
                let played = frames as f64 + asperity_node::time::first_sample(tick, rate_hz, tick_hz) as f64
                    - reference.next as f64;
                let want = device.now_ns as f64 + (played - frames as f64) * 1e9 / f64::from(rate_hz);
                assert!((read_ns as f64 - want).abs() < 0.1e6, "callback {i}: {read_ns} of {want}");
            }
            if gaps == 4 {
                break;
            }
        }
        assert_eq!(gaps, 4);
        let passed = 4 * gap_ms * u64::from(rate_hz) / 1000;
        let lost = options.meters.lost_samples.get();
        assert!(lost <= passed + 4 && passed < lost + u64::from(rate_hz / tick_hz) + 4, "{lost} of {passed}");
        let ticker = driver.take().expect("the ticker");
        let tick_ns = 1e9 / f64::from(tick_hz);
        let drift = |t: &(u64, u64)| t.1 as f64 - t.0 as f64 * tick_ns;
        let (first, last) = (drift(&ticker.times[2 * tick_hz as usize]), drift(ticker.times.last().unwrap()));
        assert!((last - first).abs() < tick_ns + 0.2e6, "virtual time follows real time: {}", last - first);
        assert_eq!(ticker.next - ticker.times.len() as u64, options.meters.skipped_ticks.get());
    }
}

#[test]
fn mute_stop_and_panic_are_silent_within_20_ms() {
    for how in ["mute", "stop", "panic"] {
        let options = options(500);
        let mut ticker = Counter::new(48_000, 500, 1, 500);
        ticker.panic_at = (how == "panic").then_some(600);
        let (driver, half) = callback(ticker, &options);
        let mut device = Device::new(half, 48_000, 0.0);
        (0..150).for_each(|_| drop(device.call(64, 1)));
        assert!(driver.controls().up());
        match how {
            "mute" => driver.controls().run_control().mute(true),
            "stop" => driver.controls().stopping.store(true, std::sync::atomic::Ordering::Relaxed),
            _ => {}
        }
        let heard = device.call(64, 1);
        assert!(heard[0] > 40_000.0 && (how == "panic" || heard[63] < heard[0]));
        (0..15).for_each(|_| drop(device.call(64, 1)));
        assert_eq!(device.call(64, 1), [0.0; 64], "{how}");
        assert!(!driver.controls().up() && driver.controls().failed() == (how == "panic"));
        assert_eq!(driver.controls().down(), how != "mute");
        if how == "mute" {
            driver.controls().run_control().mute(false);
            let heard: Vec<f32> = (0..160).flat_map(|_| device.call(64, 1)).collect();
            assert!(heard[9] < 1.0 && heard[heard.len() - 1] > 50_000.0);
        }
        let ran = driver.take().expect("the ticker").times.len();
        assert_eq!(ran, if how == "panic" { 100 } else { ran });
        assert_eq!(device.call(64, 1).len(), 64);
    }
}

#[test]
fn device_with_other_channels_fails_in_silence() {
    let (driver, mut half) = callback(Counter::new(48_000, 500, 2, 9), &options(500));
    assert_eq!(call(&mut half, 1, 64, 3), [0.0; 192]);
    assert!(driver.controls().failed());
}
