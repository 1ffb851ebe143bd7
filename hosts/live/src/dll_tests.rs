use super::*;
use asperity_node::random::uniform;

/// A device that asks at exact times and is heard late, by up to `jitter_ns`.
struct Device {
    dll: Dll,
    frame_ns: f64,
    time_ns: f64,
    calls: u64,
    jitter_ns: f64,
}

impl Device {
    fn new(rate_hz: u32, off: f64, jitter_ns: f64) -> Self {
        let frame_ns = 1e9 / (f64::from(rate_hz) * off);
        Self { dll: Dll::new(rate_hz), frame_ns, time_ns: 1e9, calls: 0, jitter_ns }
    }

    fn call(&mut self, frames: u64) -> Heard {
        self.calls += 1;
        let late = self.jitter_ns * uniform(5, self.calls);
        let heard = self.dll.callback((self.time_ns + late) as u64, frames);
        self.time_ns += frames as f64 * self.frame_ns;
        heard
    }

    /// Error of the line at its end [ns].
    fn off_ns(&self) -> f64 {
        let line = self.dll.line();
        line.time_ns(line.end()) - self.time_ns
    }

    fn run(&mut self, frames: u64, seconds: f64) {
        let until = self.time_ns + seconds * 1e9;
        while self.time_ns < until {
            assert_eq!(self.call(frames).lost, 0);
        }
    }
}

/// Distances in time of points every 2 ms of frames, over the blocks of some seconds.
fn spacings(device: &mut Device, blocks: impl Iterator<Item = u64>) -> Vec<f64> {
    let step = 2e6 / device.frame_ns;
    let mut next = device.dll.line().end();
    let mut times = Vec::new();
    for frames in blocks {
        device.call(frames);
        while next < device.dll.line().end() {
            times.push(device.dll.line().time_ns(next));
            next += step;
        }
    }
    times.windows(2).map(|w| w[1] - w[0]).collect()
}

fn p99_us_off_2ms(mut spacings: Vec<f64>) -> f64 {
    spacings.iter_mut().for_each(|s| *s = (*s - 2e6).abs() / 1e3);
    spacings.sort_by(f64::total_cmp);
    spacings[spacings.len() * 99 / 100]
}

#[test]
fn ticks_are_evenly_spaced_in_time_under_jitter() {
    for (frames, rate_hz, off) in [(1024, 48_000, 1.005), (1024, 44_100, 0.9997), (64, 48_000, 1.0)] {
        let mut device = Device::new(rate_hz, off, 0.5e6);
        device.run(frames, 5.0);
        let found = device.frame_ns / device.dll.line().frame_ns();
        assert!((found - 1.0).abs() < 3e-4, "{found}");
        let p99 = p99_us_off_2ms(spacings(&mut device, (0..10_000).map(|_| frames)));
        println!("{frames} at {rate_hz}: p99 {p99:.2} us");
        assert!(p99 < 3.0, "{frames} frames at {rate_hz}: {p99} us");
    }
}

#[test]
fn blocks_of_any_length_give_the_same_line() {
    let mut device = Device::new(48_000, 0.998, 0.2e6);
    let sizes = [64, 1, 1024, 97, 441, 0, 256];
    let mut asked = 0;
    for i in 0..8_000 {
        let frames = sizes[(uniform(3, i) * 7.0) as usize];
        assert_eq!(device.call(frames), Heard { position: asked, lost: 0 });
        asked += frames;
    }
    let p99 = p99_us_off_2ms(spacings(&mut device, (0..3_000).map(|i| sizes[i % 7])));
    assert!(p99 < 3.0, "{p99} us");
    // Half the jitter is what a filter of lateness ends at.
    let end = device.off_ns();
    assert!((0.0..0.2e6).contains(&end), "{end}");
    let line = *device.dll.line();
    for p in [line.end() - 100.0, line.end() - 0.5, line.end() + 3_000.0] {
        assert!((line.position(line.time_ns(p)) - p).abs() < 1e-4);
    }
}

#[test]
fn gap_is_counted_in_frames_and_time_is_right_at_once() {
    for (frames, gap_ms) in [(64, 14.0), (1024, 100.0), (441, 2_000.0)] {
        let mut device = Device::new(48_000, 1.0, 0.1e6);
        device.run(frames, 4.0);
        device.time_ns += gap_ms * 1e6;
        let before = device.dll.line().end() as u64;
        let heard = device.call(frames);
        let want = gap_ms * 48.0;
        assert!((heard.lost as f64 - want).abs() < 8.0, "{} of {want}", heard.lost);
        assert_eq!(heard.position, before + heard.lost);
        // The time is right at once.
        device.run(frames, 0.1);
        let off = device.off_ns();
        assert!(off.abs() < 0.2e6, "{off}");
    }
}

#[test]
fn late_callback_made_up_for_leaves_loop_settled() {
    let mut device = Device::new(48_000, 1.0, 0.1e6);
    device.run(64, 4.0);
    // 20 ms late, then all that were missed at once.
    let late = device.time_ns + 20e6;
    let mut lost = 0;
    while device.time_ns < late {
        lost += device.dll.callback(late as u64, 64).lost;
        device.time_ns += 64.0 * device.frame_ns;
    }
    assert!((950..=970).contains(&lost), "{lost} of 960");
    device.run(64, 0.05);
    let off = device.off_ns();
    assert!(off.abs() < 0.3e6 && device.dll.settled(), "{off}");
    let before = device.dll.line().end();
    device.time_ns += 20e6;
    assert!(device.call(64).lost > 940 && device.dll.line().end() > before);
}

#[test]
fn shared_error_below_a_period_counts_as_lost_time() {
    let mut device = Device::new(48_000, 1.0, 0.1e6);
    device.run(1024, 4.0);
    device.time_ns += 5e6;
    let lost: u64 = (0..50).map(|_| device.call(1024).lost).sum();
    assert!((200..=300).contains(&lost), "{lost} of 240");
    let off = device.off_ns();
    assert!(off.abs() < 0.5e6, "{off}");
}

#[test]
fn bunched_calls_have_the_period_of_the_bunch() {
    let mut device = Device::new(48_000, 1.0, 0.0);
    let mut late = Vec::new();
    for i in 0..1_000 {
        let at = device.time_ns + 0.3e6 * uniform(1, i);
        for k in 0..4 {
            assert_eq!(device.dll.callback((at + f64::from(k) * 20e3) as u64, 256).lost, 0);
        }
        late.push(device.dll.line().time_ns(1024.0 * i as f64) - device.time_ns);
        device.time_ns += 1024.0 * device.frame_ns;
    }
    // 60 us pass within the bunch.
    assert!((1_020..=1_024).contains(&device.dll.line().period_frames));
    assert!(late[300..].iter().all(|l| (0.0..0.3e6).contains(l)));
    // The same, but a buffer of two seconds is filled at the start.
    let mut device = Device::new(48_000, 1.0, 0.0);
    for _ in 0..96 {
        assert_eq!(device.dll.callback(1_000_000_000, 1000).lost, 0);
    }
    device.time_ns += 20e6;
    device.run(1000, 3.0);
    let off = device.off_ns();
    assert!(off.abs() < 0.1e6 && device.dll.line().period_frames == 1000, "{off}");
}

#[test]
fn server_faster_than_real_time_loses_nothing() {
    let mut dll = Dll::new(48_000);
    for i in 0..50_000_u64 {
        let stall = if i % 1000 == 0 { 8_000_000 } else { 0 };
        let heard = dll.callback(1_000_000_000 + i * 9_000 + (i / 1000) * 8_000_000 + stall, 64);
        assert_eq!(heard, Heard { position: i * 64, lost: 0 });
    }
}

/// Lead of a paced thread after each callback, in milliseconds. Callbacks of `frames` come `late(due)`
/// seconds after they are due.
fn leads_ms(frames: u64, seconds: f64, mut late: impl FnMut(f64) -> f64) -> Vec<f64> {
    let mut dll = Dll::new(48_000);
    let period_s = frames as f64 / 48_000.0;
    let lead = |i: u64| {
        let due = i as f64 * period_s;
        let jitter = 0.1e-3 * uniform(5, i);
        dll.callback(((1.0 + due + late(due) + jitter) * 1e9) as u64, frames);
        let line = dll.line();
        (line.period_frames as f64 * line.frame_ns() + line.early_ns) * 1e-6
    };
    (0..(seconds / period_s) as u64).map(lead).collect()
}

/// Lateness by stalls of a machine: after a stall, everything due is asked for at once. A stall of up to
/// `longest_s` begins about every `every_s`.
fn stalls(every_s: f64, longest_s: f64) -> impl FnMut(f64) -> f64 {
    let (mut stall, mut next, mut count) = ((0.0, 0.0), 2.0 * every_s, 0);
    move |due| {
        if due > next {
            count += 1;
            stall = (next, next + longest_s * uniform(9, count));
            next += 2.0 * every_s * uniform(10, count);
        }
        if due < stall.1 { stall.1 - due.max(stall.0) } else { 0.0 }
    }
}

#[test]
fn stalls_of_the_machine_do_not_lengthen_the_period() {
    for (frames, every_s, longest_s) in
        [(256, 1.0, 0.014), (256, 5.0, 0.03), (1024, 1.0, 0.014), (1024, 1.0, 0.03), (1024, 5.0, 0.1)]
    {
        let leads = leads_ms(frames, 120.0, stalls(every_s, longest_s));
        let most = leads.iter().copied().fold(0.0, f64::max);
        let period_ms = frames as f64 / 48.0;
        assert!(most < period_ms + 0.3, "{frames} frames, {longest_s} s every {every_s} s: {most} ms");
        assert!(*leads.last().expect("callbacks") > period_ms - 0.1);
    }
}

#[test]
fn callbacks_after_late_ones_are_not_early() {
    // 6 ms late for 110 ms, which counts as time lost; then all is as before.
    let late = |due: f64| if due % 10.0 > 9.89 { 6e-3 } else { 0.0 };
    let leads = leads_ms(1024, 60.0, late);
    let most = leads.iter().copied().fold(0.0, f64::max);
    assert!(most < 1024.0 / 48.0 + 1.0, "{most} ms");
}

#[test]
fn uneven_wake_ups_stay_early() {
    // Every other callback comes half a period before its time.
    let mut odd = false;
    let leads = leads_ms(1024, 10.0, |_| {
        odd = !odd;
        if odd { -10e-3 } else { 0.0 }
    });
    // The line may lie anywhere between the two; what comes before it is what counts.
    assert!(leads[leads.len() / 2..].iter().all(|ms| (23.0..43.0).contains(ms)), "{leads:?}");
}
