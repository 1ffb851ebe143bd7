//! Inputs while a graph plays: a channel of the card, a hand.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::Duration;

use asperity_audio::Request;
use asperity_audio::simulated::{Params, Simulated};
use asperity_live::driver::Clock;
use asperity_live::{DeviceQueues, Sample, SampleWriter, Session, SessionOptions, mic, now_ns, samples};
use harness::alone::beside_others;
use harness::stage::{by_hand, channel, graph, offline, options, poll, start_with, timed, voice};

/// A tone, and what is recorded of it.
fn recording() -> (asperity_graph::GraphFile, asperity_graph::Compiled) {
    let (nodes, wires) = voice("out", 80.0, 0.1);
    let nodes = format!(
        r#"{nodes} "in": (kind: "audio_in", params: (channel: 1)),
           "file": (kind: "file_out", params: (file: "in.wav")),"#
    );
    graph(&harness::registry(), (500, 48_000), &nodes, &format!(r#"{wires} ("in", "file")"#))
}

/// All that a sink recorded, with nothing left out.
fn taped(session: &mut Session, all: &mut Vec<f32>) {
    let lost = session.graph_controller().recorded(|r| {
        assert_eq!(r.start, all.len() as u64);
        all.extend_from_slice(r.values);
    });
    assert_eq!(lost, 0);
}

#[test]
fn recorded_samples_reach_the_graph_after_a_constant_delay() {
    let _alone = beside_others();
    for (case, sizes) in
        [&[64_usize][..], &[1], &[1024], &[97, 441], &[64, 1, 1024, 97, 441]].into_iter().enumerate()
    {
        let params = Params { inputs: 1, loopback: true, latency_frames: 100, ..by_hand() };
        let card = Simulated::new(&format!("loop {case}"), params).expect("a card");
        let device = options(&card, Clock::Callback).device;
        let device = Some(Request { inputs: vec![1], ..device.expect("a device") });
        let options = SessionOptions { device, ..options(&card, Clock::Callback) };
        let mut session =
            start_with(recording(), DeviceQueues::default(), Some(mic(1, 48_000, 500)), options);
        let (mut frames, mut heard) = (0, Vec::new());
        for size in sizes.iter().cycle() {
            card.step(*size);
            frames += size;
            taped(&mut session, &mut heard);
            if frames > 24_000 {
                break;
            }
        }
        assert_eq!(session.view().recording_gaps, 0, "{sizes:?}");
        let wanted = offline(recording().1, heard.len()).swap_remove(0);
        let first = |x: &[f32]| x.iter().position(|x| *x != 0.0).expect("a tone");
        let delay = first(&heard) - first(&wanted);
        let longest = sizes.iter().max().expect("a size");
        assert!(delay <= 100 + 2 * (longest + 96) + 96, "{sizes:?}: {delay} frames behind");
        for (n, y) in heard.iter().enumerate().skip(delay) {
            assert_eq!(*y, wanted[n - delay], "{sizes:?}: frame {n}");
        }
    }
}

/// Where the hand is at a time [ms]: along x, at 100 mm/s.
const SPEED_MM_MS: f64 = 0.1;

/// A device that says a thousand times a second where the hand is.
struct Hand {
    on: Arc<AtomicBool>,
    last_ns: Arc<AtomicU64>,
    thread: Option<JoinHandle<()>>,
}

impl Hand {
    fn new(mut to: SampleWriter) -> Self {
        let (on, last_ns) = (Arc::new(AtomicBool::new(true)), Arc::new(AtomicU64::new(0)));
        let (goes_on, last) = (on.clone(), last_ns.clone());
        let send = move || {
            while goes_on.load(Relaxed) {
                let now = now_ns();
                let position = [now as f64 * 1e-6 * SPEED_MM_MS, 0.0, 0.0];
                to.send(Sample { time_ns: now, arrived_ns: now, position, force: 0.5, stroke: 1 });
                last.store(now, Relaxed);
                std::thread::sleep(Duration::from_millis(1));
            }
        };
        Self { on, last_ns, thread: Some(std::thread::spawn(send)) }
    }

    /// Says no more; answers when it last did.
    fn rest(&mut self) -> u64 {
        self.on.store(false, Relaxed);
        self.thread.take().map(JoinHandle::join);
        self.last_ns.load(Relaxed)
    }
}

impl Drop for Hand {
    fn drop(&mut self) {
        self.rest();
    }
}

/// A tone that a hand's motion lets through, until nobody knows where the hand is, and where the hand was in
/// every tick.
fn touched(card: &Simulated) -> (Session, Hand) {
    let (nodes, _) = voice("out", 80.0, 0.1);
    let nodes = format!(
        r#"{nodes} "hand": (kind: "pointer_input"), "motion": (kind: "velocity"),
           "gate": (kind: "speed_gate", params: (hysteresis: 0.0)),
           "where": (kind: "probe", params: (file: "where.csv")),"#
    );
    let wires = r#"("hand.position", "motion.position"), ("hand.position", "where"), ("out tone", "gate.in"),
        ("motion.speed", "gate.speed"), ("hand.force", "gate.force"), ("gate.out", "out limiter"),
        ("out limiter", "out"),"#;
    let (to, reader) = samples();
    let queues = DeviceQueues { hands: [("hand".to_owned(), reader)].into(), ..DeviceQueues::default() };
    let graph = graph(&harness::registry(), (500, 48_000), &nodes, wires);
    (start_with(graph, queues, None, options(card, Clock::Callback)), Hand::new(to))
}

/// The hand's x in every tick [mm].
fn places(session: &mut Session, all: &mut Vec<f64>) {
    session.graph_controller().recorded(|r| all.push(f64::from(r.values[0])));
}

/// The stroke is held, and the stall is counted.
#[test]
fn silent_hand_is_held_silent_after_70_ms_and_counted() {
    let _alone = beside_others();
    // In time as the card plays it; on a machine that stalls, the best of some.
    let mut best = f64::INFINITY;
    for attempt in 0..4 {
        let card = Simulated::new(&format!("stall {attempt}"), timed(64)).expect("a card");
        let (mut session, mut hand) = touched(&card);
        let mut x = Vec::new();
        let heard = || channel(&card.played(), 2, 0);
        poll(&mut session, "the tone", |_| heard().iter().filter(|y| y.abs() > 0.09).count() > 4800);
        let before = session.view().sources[0].stalls;
        let last_ns = hand.rest();
        let (at, now) = (heard().len() as f64, now_ns());
        poll(&mut session, "the stall", |s| s.view().sources[0].stalled);
        let stalls = session.view().sources[0].stalls;
        assert!(stalls > before);
        let frames = heard().len() + 24_000;
        poll(&mut session, "half a second", |s| {
            places(s, &mut x);
            heard().len() > frames
        });
        assert_eq!(session.view().sources[0].stalls, stalls, "it is one stall");
        assert!(x[x.len() - 100..].windows(2).all(|w| w[0] == w[1]), "it is held");
        let all = heard();
        assert!(all[all.len() - 4800..].iter().all(|y| y.abs() < 1e-3));
        let loud = all.iter().rposition(|y| y.abs() > 0.01).expect("a tone") as f64;
        let after_ms = (loud - at) / 48.0 + (now - last_ns) as f64 * 1e-6;
        best = best.min(after_ms);
        if after_ms < 70.0 {
            break;
        }
    }
    assert!((50.0..70.0).contains(&best), "silent {best} ms after the last sample");
}
