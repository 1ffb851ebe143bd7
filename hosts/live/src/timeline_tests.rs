use super::*;
use crate::sample::{SampleWriter, samples};
use asperity_node::random::uniform;

const MS: u64 = 1_000_000;

fn timeline(delay_ns: Option<u64>) -> (SampleWriter, Timeline) {
    let (to, from) = samples();
    (to, Timeline::new(from, delay_ns, 50 * MS))
}

fn sample(time_ns: u64, arrived_ns: u64, x: f64) -> Sample {
    Sample { time_ns, arrived_ns, position: [x, 0.0, 0.0], force: x / 10.0, stroke: 0 }
}

/// Ticks every ms from `from_ms`, samples sent when they arrive; what was read, by tick.
fn run(
    to: &mut SampleWriter,
    line: &mut Timeline,
    samples: &[Sample],
    ticks_ms: std::ops::Range<u64>,
) -> Vec<(u64, Reading)> {
    let mut sent = samples.iter().peekable();
    ticks_ms
        .map(|ms| {
            while let Some(s) = sent.next_if(|s| s.arrived_ns <= ms * MS) {
                assert!(to.send(*s));
            }
            (ms * MS, line.at(ms * MS))
        })
        .collect()
}

#[test]
fn steady_motion_is_read_one_delay_ago() {
    let (mut to, mut line) = timeline(Some(10 * MS));
    // 250 Hz, 3 ms late, 100 mm/s.
    let all: Vec<_> = (0..250).map(|i| sample(i * 4 * MS, i * 4 * MS + 3 * MS, i as f64 * 0.4)).collect();
    for (t, reading) in run(&mut to, &mut line, &all, 15..1000) {
        let want = (t - 10 * MS) as f64 * 1e-7;
        assert!((reading.position[0] - want).abs() < 1e-9, "at {t}: {} of {want}", reading.position[0]);
        assert!((reading.force - want / 10.0).abs() < 1e-9 && !reading.stalled);
        assert!(reading.age_ns >= 3 * MS && reading.age_ns < 8 * MS);
    }
    assert_eq!(line.seen(), Seen { samples: 250, delay_ns: 10 * MS, ..Seen::default() });
}

#[test]
fn auto_delay_changes_speed_by_at_most_2_percent() {
    let (mut to, mut line) = timeline(None);
    // 250 Hz, 1 ms late, then 6 to 9 ms late for 2 s, then 1 ms again; 100 mm/s.
    let late = |i: u64| if (500..1000).contains(&i) { 6 * MS + (uniform(1, i) * 3e6) as u64 } else { MS };
    let mut all: Vec<_> =
        (0..5000).map(|i| sample((i + 1) * 4 * MS, (i + 1) * 4 * MS + late(i), i as f64 * 0.4)).collect();
    (1..all.len()).for_each(|i| all[i].arrived_ns = all[i].arrived_ns.max(all[i - 1].arrived_ns));
    let read = run(&mut to, &mut line, &all, 1..20_000);
    assert!((read[1_900].1.age_ns) < 6 * MS);
    for (i, w) in read.windows(2).enumerate().skip(100) {
        // Half a second after the change, the delay has come up.
        if !(1_990..2_600).contains(&i) {
            let speed = (w[1].1.position[0] - w[0].1.position[0]) / 1e-3;
            assert!((97.9..102.1).contains(&speed), "at {i} ms: {speed} mm/s");
        }
    }
    let delay = |i: usize| read[i].0 as f64 - read[i].1.position[0] * 1e7 - 4e6;
    assert!((delay(1_900) - 5e6).abs() < 0.3e6, "{}", delay(1_900));
    assert!((12.0e6..13.2e6).contains(&delay(3_500)), "{}", delay(3_500));
    assert!(delay(19_900) < 5.4e6, "it comes back down: {}", delay(19_900));
}

#[test]
fn position_is_held_between_strokes_and_at_the_end() {
    let (mut to, mut line) = timeline(Some(5 * MS));
    let mut all: Vec<_> = (1..=10).map(|i| sample(i * 2 * MS, i * 2 * MS, i as f64)).collect();
    // The hand is put down elsewhere 40 ms later.
    all.push(Sample { stroke: 1, ..sample(60 * MS, 60 * MS, 500.0) });
    all.push(Sample { stroke: 1, ..sample(64 * MS, 64 * MS, 504.0) });
    for (t, reading) in run(&mut to, &mut line, &all, 30..90) {
        let at = (t - 5 * MS) / MS;
        let want = match at {
            ..60 => (10.0, 0),
            60..=64 => (500.0 + (at - 60) as f64, 1),
            _ => (504.0, 1),
        };
        assert_eq!((reading.position[0], reading.stroke), want, "at {at} ms");
    }
    assert_eq!(line.seen().stalls, 0);
}

#[test]
fn sample_after_a_pause_does_not_jump() {
    let (mut to, mut line) = timeline(Some(8 * MS));
    // At rest without a word for 40 ms, then 100 mm/s at 250 Hz.
    let mut all = vec![sample(10 * MS, 10 * MS, 0.0)];
    all.extend((1..20).map(|i| sample((46 + i * 4) * MS, (46 + i * 4) * MS, i as f64 * 0.4)));
    let read = run(&mut to, &mut line, &all, 20..100);
    for w in read.windows(2) {
        let step = w[1].1.position[0] - w[0].1.position[0];
        assert!((0.0..0.101).contains(&step), "{step} mm in a tick at {}", w[0].0);
    }
}

#[test]
fn stall_counts_once_and_ends_with_a_new_stroke() {
    let (mut to, mut line) = timeline(None);
    assert!(line.at(0).stalled);
    let mut all: Vec<_> = (1..=50).map(|i| sample(i * 4 * MS, i * 4 * MS + MS, i as f64)).collect();
    all.extend((0..10).map(|i| sample((500 + i * 4) * MS, (501 + i * 4) * MS, 900.0 + i as f64)));
    let read = run(&mut to, &mut line, &all, 5..540);
    for (t, reading) in &read {
        // The last sample came at 201 ms.
        assert_eq!(reading.stalled, (252 * MS..501 * MS).contains(t), "at {t}");
        let alone = (210 * MS..500 * MS).contains(t);
        assert!(!alone || reading.position[0] == 50.0);
        // Nothing of the way between is made up.
        assert!(reading.position[0] <= 50.0 || reading.position[0] >= 900.0);
        assert_eq!(reading.stroke, u32::from(reading.position[0] >= 900.0));
    }
    assert_eq!((line.seen().stalls, read.last().unwrap().1.stroke), (1, 1));
}

#[test]
fn hand_at_rest_neither_stalls_nor_adds_delay() {
    let (mut to, mut line) = timeline(None);
    let mut all: Vec<_> = (1..=100).map(|i| sample(i * 4 * MS, i * 4 * MS, i as f64)).collect();
    all.extend((1..=40).map(|i| sample((400 + i * 25) * MS, (400 + i * 25) * MS, 100.0)));
    run(&mut to, &mut line, &all, 1..1_400);
    assert_eq!(line.seen().stalls, 0);
    assert!(line.seen().delay_ns < 5 * MS, "{}", line.seen().delay_ns);
}

#[test]
fn disordered_and_future_samples_are_clamped() {
    let (mut to, mut line) = timeline(Some(10 * MS));
    let all = [
        sample(10 * MS, 12 * MS, 1.0),
        sample(14 * MS, 14 * MS, 2.0),
        sample(12 * MS, 15 * MS, 3.0),
        sample(90 * MS, 18 * MS, 4.0),
        sample(22 * MS, 22 * MS, 5.0),
    ];
    let read = run(&mut to, &mut line, &all, 12..60);
    assert!(read.windows(2).all(|w| w[0].1.position[0] <= w[1].1.position[0]));
    assert_eq!(read.last().unwrap().1.position[0], 5.0);
    // More samples than are kept, all at once and too late: the newest counts, and nothing breaks.
    for i in 0..2_000 {
        assert!(to.send(sample((30 + i / 100) * MS, 60 * MS, i as f64)));
    }
    assert_eq!(line.at(61 * MS).position[0], 1_999.0);
    assert_eq!(line.at(50 * MS).position[0], 1_999.0, "time does not go back");
}
