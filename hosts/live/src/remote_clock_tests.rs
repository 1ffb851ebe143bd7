use super::*;
use asperity_node::random::uniform;

const MS: f64 = 1e6;
/// The least time under way, in ms.
const WAY_MS: f64 = 1.0;

/// Messages at 250 Hz over a way of 1 ms and more by `delay_ms` (of the message's number and time in s), in
/// order. The error of each message's time in ms, beyond the shortest way, and where it stood.
fn heard(
    clock: &mut RemoteClock,
    seconds: std::ops::Range<u64>,
    theirs: impl Fn(f64) -> f64,
    delay_ms: impl Fn(u64, f64) -> f64,
) -> Vec<(f64, Order)> {
    let mut last = 0.0_f64;
    (seconds.start * 250..seconds.end * 250)
        .map(|i| {
            let sent = i as f64 * 4.0 * MS;
            last = last.max(sent + (WAY_MS + delay_ms(i, sent * 1e-9)) * MS);
            let order = clock.hear(theirs(sent * 1e-9), last as u64);
            let time_ns = clock.time_ns(theirs(sent * 1e-9), last as u64);
            (time_ns as f64 / MS - sent / MS - WAY_MS, order)
        })
        .collect()
}

/// 0 to 8 ms.
fn jitter(i: u64, _: f64) -> f64 {
    8.0 * uniform(1, i)
}

fn rms(heard: &[(f64, Order)]) -> f64 {
    (heard.iter().map(|(e, _)| e * e).sum::<f64>() / heard.len() as f64).sqrt()
}

/// Whether every time is right to half a millisecond and joins on.
fn follow(heard: &[(f64, Order)]) -> bool {
    heard.iter().all(|(e, order)| e.abs() < 0.6 && *order == Order::Next)
}

#[test]
fn clock_of_any_offset_and_drift_is_followed() {
    // An offset as of a browser, of an OSC time tag (seconds since 1900), and a time before the other
    // clock's zero.
    for (offset, ppm) in [(0.0, 0.0), (12.3, 100.0), (3.9e9, -100.0), (-5000.0, 50.0)] {
        let delays: [&dyn Fn(u64, f64) -> f64; 3] = [
            &jitter,
            // Most come at once, few late; and all of 30 ms together.
            &|i, _| 20.0 * uniform(1, i).powi(3),
            &|i, _| 28.0 - (4 * i % 30) as f64 + 0.3 * uniform(1, i),
        ];
        for (which, delay) in delays.iter().enumerate() {
            let mut clock = RemoteClock::new();
            let all = heard(&mut clock, 1..60, |t| offset + t * (1.0 + ppm * 1e-6), delay);
            let rest = &all[4 * 250..];
            assert!(follow(rest) && rms(rest) < 0.3, "{offset} s, {ppm} ppm, delay {which}: {}", rms(rest));
        }
    }
}

#[test]
fn clock_that_is_set_restarts_once_and_is_followed() {
    for (jump, patience) in [(1000.0, 4), (0.3, 4), (-1000.0, 1), (-0.5, 66)] {
        let mut clock = RemoteClock::new();
        heard(&mut clock, 1..20, |t| t, jitter);
        let after = heard(&mut clock, 20..30, |t| t + jump, jitter);
        let anew: Vec<usize> = (0..after.len()).filter(|i| after[*i].1 == Order::Anew).collect();
        assert!(matches!(anew[..], [at] if at < patience), "{jump} s: {anew:?}");
        assert!(follow(&after[250..]), "{jump} s");
    }
    // By so little that it may be a long way as well, when the window is over.
    let mut clock = RemoteClock::new();
    heard(&mut clock, 1..20, |t| t, jitter);
    assert!(follow(&heard(&mut clock, 20..30, |t| t - 0.05, jitter)[5 * 250..]));
}

#[test]
fn future_time_stamp_changes_only_its_own_time() {
    for ahead in [0.2, 5.0, 1e9] {
        let mut clock = RemoteClock::new();
        heard(&mut clock, 1..10, |t| t, jitter);
        assert_eq!(clock.hear(10.0 + ahead, 10_001_000_000), Order::Next);
        assert_eq!(clock.time_ns(10.0 + ahead, 10_001_000_000), 10_001_000_000, "its arrival");
        assert!(follow(&heard(&mut clock, 10..12, |t| t, jitter)), "{ahead} s");
    }
}

#[test]
fn messages_delayed_for_seconds_keep_their_times() {
    let mut clock = RemoteClock::new();
    let held = |i, t: f64| if (10.0..12.0).contains(&t) { (12.0 - t) * 1e3 } else { jitter(i, t) };
    assert!(follow(&heard(&mut clock, 1..20, |t| t, held)[4 * 250..]));
}

#[test]
fn overtaken_message_is_late_and_keeps_its_time() {
    let mut clock = RemoteClock::new();
    assert_eq!(clock.hear(5.0, 1_000_000_000), Order::Next);
    assert_eq!(clock.hear(5.02, 1_020_000_000), Order::Next);
    assert_eq!(clock.hear(5.01, 1_021_000_000), Order::Late);
    assert_eq!(clock.time_ns(5.01, 1_021_000_000), 1_010_000_000);
    assert_eq!(clock.hear(5.03, 1_030_000_000), Order::Next);
}

#[test]
fn invalid_time_counts_as_the_arrival() {
    let mut clock = RemoteClock::new();
    assert_eq!(clock.time_ns(3.0, 7), 7, "nothing is known yet");
    heard(&mut clock, 1..5, |t| t, jitter);
    for nonsense in [f64::NAN, f64::INFINITY, 1e300, -1e300, 9.3e9] {
        assert_eq!(clock.hear(nonsense, 5_000_000_000), Order::Next);
        assert_eq!(clock.time_ns(nonsense, 5_000_000_000), 5_000_000_000);
    }
    assert!(follow(&heard(&mut clock, 5..7, |t| t, jitter)));
    let mut clock = RemoteClock::new();
    for (k, sent) in [9e9, -9e9, 0.0, 1e9, -5.0, 9.2e9].into_iter().cycle().take(100).enumerate() {
        let arrived = 1_000_000 * k as u64;
        clock.hear(sent, arrived);
        assert!(clock.time_ns(sent, arrived) <= arrived);
    }
}
