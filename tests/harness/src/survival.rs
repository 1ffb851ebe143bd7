//! Cases that any phase-retrieval node must survive.

use asperity_sdk::{FrameLayout, Latency, Node};

use crate::counting::allocations;
use crate::retrieval::{Rig, apart, layout, noise, tone, turns};

/// Parameters of a node under test.
pub type Settings<'a> = &'a [(&'a str, f64)];

/// Runs a node through every case that lasts no longer than a few seconds, with each of its settings. What is
/// printed last before a panic names the case.
pub fn survives<N: Node>(all: &[Settings<'_>]) {
    let cases: [(&str, fn(Settings<'_>)); 5] = [
        ("every magnitude of odd frames comes out", odd_frames_come_out::<N>),
        ("each frame beside missing ones comes out", frames_beside_gaps_come_out::<N>),
        ("no magnitude is counted", bad_magnitudes_are_counted::<N>),
        ("a tone runs on by the true number of samples", a_tone_runs_on::<N>),
        ("a reset node is a fresh one", a_reset_node_is_a_fresh_one::<N>),
    ];
    for (case, check) in cases {
        for settings in all {
            println!("{case}: {settings:?}");
            check(settings);
        }
    }
}

/// Frames of latency at 500 frames a second.
fn frames_late(rig: &Rig) -> u64 {
    let (num, den) = rig.latency().as_ratio();
    (num * 500 / den) as u64
}

/// Feeds frames, and checks that each comes out with its magnitudes, as late as the node says.
fn all_come_out<N: Node>(layout: FrameLayout, params: Settings<'_>, frames: &[Option<Vec<f32>>]) {
    let mut rig = Rig::new::<N>(layout, params);
    let late = frames_late(&rig) as usize;
    assert_eq!(rig.latency(), Latency::ratio(late as i64, 500));
    for slot in 0..frames.len() + late {
        let given = frames.get(slot).and_then(Option::as_deref);
        let out = rig.frame(given);
        let due = slot.checked_sub(late).and_then(|s| frames[s].as_deref());
        match (due, out) {
            (Some(due), Some(out)) => {
                for (k, (c, &m)) in out.bins.iter().zip(due).enumerate() {
                    let m = if (0.0..=f32::MAX).contains(&m) { f64::from(m) } else { 0.0 };
                    let have = f64::from(c.re).hypot(f64::from(c.im));
                    assert!(
                        (have - m).abs() <= 1e-5 * m + 1e-38,
                        "slot {slot}, bin {k}: {have:e} is not {m:e}"
                    );
                }
            }
            (Some(_), None) => panic!("the frame of slot {} did not come out", slot - late),
            (None, Some(out)) => {
                assert!(out.bins.iter().all(|c| c.norm() == 0.0), "slot {slot} was to be silent")
            }
            (None, None) => {}
        }
    }
}

/// Flat spectra, ties, lone bins, silence, extremes of the unit, and what is no magnitude.
fn odd_frames_come_out<N: Node>(params: Settings<'_>) {
    let bins = 101;
    let mut frames = Vec::new();
    for n in 0..240_u64 {
        let scale = [1.0, 1e-12, 1e12][(n / 80) as usize];
        let mut frame: Vec<f32> = match n / 8 % 10 {
            0 => vec![0.0; bins],
            1 => vec![1.0; bins],
            2 => (0..bins).map(|k| if k == 17 { 1.0 } else { 0.0 }).collect(),
            3 => (0..bins).map(|k| if k % 2 == 0 { 1.0 } else { 0.5 }).collect(),
            4 => (0..bins).map(|k| if k == 0 || k == 100 { 1.0 } else { 0.0 }).collect(),
            5 => (0..bins).map(|k| noise(n, k as u64)).collect(),
            6 => tone(40.5, bins),
            7 => tone(30.3, bins).iter().map(|m| m.max(0.049)).collect(),
            8 => (0..bins).map(|k| 10_f32.powi(-((k % 30) as i32))).collect(),
            _ => (0..bins).map(|k| [f32::NAN, f32::INFINITY, -1.0, 1.0][k % 4]).collect(),
        };
        frame.iter_mut().for_each(|m| *m *= scale);
        frames.push(Some(frame));
    }
    frames.push(Some(vec![f32::MAX; bins]));
    frames.push(Some(vec![f32::MIN_POSITIVE; bins]));
    frames.push(Some(tone(12.2, bins)));
    all_come_out::<N>(layout(2500, 101), params, &frames);
    all_come_out::<N>(layout(48_000, 101), params, &frames);
    let whole: Vec<_> = (0..100).map(|n| Some((0..26).map(|k| noise(n, k)).collect())).collect();
    all_come_out::<N>(layout(500, 26), params, &whole);
}

/// Frames that are missing, alone and in long rows, take nothing else with them.
fn frames_beside_gaps_come_out<N: Node>(params: Settings<'_>) {
    let there = |n: u64| noise(1, n) < 0.7 && !(150..250).contains(&n) && !(300..305).contains(&n);
    let frames: Vec<_> =
        (0..400).map(|n| there(n).then(|| (0..101).map(|k| noise(n + 2, k)).collect::<Vec<_>>())).collect();
    all_come_out::<N>(layout(2500, 101), params, &frames);
    all_come_out::<N>(layout(44_100, 101), params, &frames);
}

/// Bins that are no magnitudes are counted.
fn bad_magnitudes_are_counted<N: Node>(params: Settings<'_>) {
    let mut rig = Rig::new::<N>(layout(2500, 101), params);
    let mut frame = tone(30.3, 101);
    rig.frame(Some(&frame));
    assert_eq!(rig.count("bad_magnitudes"), 0);
    (frame[3], frame[60], frame[61], frame[90]) = (f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0);
    rig.frame(Some(&frame));
    rig.frame(None);
    assert_eq!(rig.count("bad_magnitudes"), 4);
}

/// Checks that the strongest bin of a tone turns by the tone's frequency from frame to frame.
fn runs_on(rig: &mut Rig, freq: f64, length: f64, frame: &[f32], count: usize, tolerance: f64) {
    let bin = freq.round() as usize;
    let mut before: Option<(u64, f64)> = None;
    for _ in 0..count {
        let Some(out) = rig.frame(Some(frame)) else { continue };
        let now = turns(out.bins[bin]);
        if let Some((start, turns)) = before {
            let hop = (out.start - start) as f64;
            let off = apart(now, turns + freq * hop / length);
            assert!(off < tolerance, "frame {}: off by {off} turns after {hop} samples", out.index);
        }
        before = Some((out.start, now));
    }
}

/// A tone runs on at its frequency: at a hop of 88 and 89 samples, over a floor, after silence, and with lost
/// frames.
fn a_tone_runs_on<N: Node>(params: Settings<'_>) {
    let tolerance = 2e-3;
    for (rate_hz, freq) in [(2500, 15.37), (44_100, 33.4), (48_000, 60.5)] {
        let length = f64::from(rate_hz / 10);
        let frame = tone(freq, 101);
        let mut rig = Rig::new::<N>(layout(rate_hz, 101), params);
        (0..100).for_each(|_| _ = rig.frame(Some(&[0.0; 101])));
        (0..200).for_each(|_| _ = rig.frame(Some(&frame)));
        runs_on(&mut rig, freq, length, &frame, 300, tolerance);
        let floor: Vec<f32> = frame.iter().map(|m| m.max(0.049)).collect();
        (0..100).for_each(|_| _ = rig.frame(Some(&floor)));
        runs_on(&mut rig, freq, length, &floor, 100, 10.0 * tolerance);
    }
}

/// A million frames, an absolute start far out, a hop of 88 and 89 samples: the phase is as good as at the
/// start.
pub fn hours_do_not_wear_the_phase<N: Node>(params: Settings<'_>, tolerance: f64) {
    let layout = layout(44_100, 8);
    let on_a_bin = [0.0, 0.0, 0.5, 1.0, 0.5, 0.0, 0.0, 0.0];
    let mut rig = Rig::new::<N>(layout, params);
    rig.tick = 1_000_000_000_000;
    for _ in 0..1_000_000 {
        rig.step(Some(&on_a_bin));
    }
    runs_on(&mut rig, 3.0, 4410.0, &on_a_bin, 1000, tolerance);
}

/// After a reset, and in another run, all is as it was.
fn a_reset_node_is_a_fresh_one<N: Node>(params: Settings<'_>) {
    let layout = layout(2500, 101);
    let frame = |n: u64| (0..101).map(|k| noise(n / 3, k)).collect::<Vec<_>>();
    let run = |rig: &mut Rig| {
        (0..60).map(|n| rig.frame((n != 30).then(|| frame(n)).as_deref())).collect::<Vec<_>>()
    };
    let fresh = run(&mut Rig::new::<N>(layout, params));
    assert_eq!(fresh, run(&mut Rig::new::<N>(layout, params)), "two runs give the same bytes");
    let mut used = Rig::new::<N>(layout, params);
    for n in 0..47 {
        used.frame(Some(&frame(n + 5)));
    }
    used.node.reset();
    used.tick = 0;
    assert_eq!(fresh, run(&mut used));
}

/// Another instance goes on from what one remembers, and refuses what another setting or a liar remembers.
pub fn what_is_remembered_goes_on<N: Node>(params: Settings<'_>, other: Settings<'_>) {
    let layout = layout(44_100, 101);
    let frame = |n: u64| (0..101).map(|k| noise(n / 3, k)).collect::<Vec<_>>();
    let (mut old, mut new) = (Rig::new::<N>(layout, params), Rig::new::<N>(layout, params));
    (0..40).for_each(|n| _ = old.frame(Some(&frame(n))));
    let mut bytes = vec![0; old.node.state_size()];
    let len = old.node.save(&mut bytes).expect("room");
    bytes.truncate(len);
    assert!(new.node.restore(&bytes));
    new.tick = old.tick;
    for n in 40..80 {
        let given = (n != 60).then(|| frame(n));
        assert_eq!(old.frame(given.as_deref()), new.frame(given.as_deref()), "frame {n}");
    }
    assert!(!Rig::new::<N>(layout, other).node.restore(&bytes));
    assert!(!Rig::new::<N>(crate::retrieval::layout(48_000, 101), params).node.restore(&bytes));
    // Bytes that say anything else: refused or taken, and never a panic or what is not finite.
    for at in 0..len.min(4000) {
        let mut lies = bytes.clone();
        lies[at] = !lies[at];
        let mut rig = Rig::new::<N>(layout, params);
        rig.tick = 40;
        if rig.node.restore(&lies) {
            (40..44).for_each(|n| _ = rig.frame(Some(&frame(n))));
        }
    }
}

/// No tick allocates: with frames that are odd or missing, a state handed over, a reset.
pub fn no_tick_allocates<N: Node>(look_aheads: [f64; 2]) {
    for (rate_hz, bins) in [(500, 26), (2500, 101), (44_100, 101), (4800, 241)] {
        for look_ahead in look_aheads {
            let mut rig = Rig::new::<N>(layout(rate_hz, bins), &[("look_ahead", look_ahead)]);
            let mut frame = vec![0.0; bins as usize];
            let mut bytes = vec![0; rig.node.state_size()];
            let ((), count) = allocations(|| {
                for n in 0..2000 {
                    let odd = n % 7 == 0;
                    for (k, m) in frame.iter_mut().enumerate() {
                        *m = if odd && k % 3 == 0 { f32::NAN } else { noise(n / 3, k as u64) };
                    }
                    rig.step((n % 11 != 0).then_some(&frame));
                    if n == 1000 {
                        let len = rig.node.save(&mut bytes).expect("room");
                        assert!(rig.node.restore(&bytes[..len]));
                    }
                    if n == 1500 {
                        rig.node.reset();
                    }
                }
            });
            assert_eq!(count, 0, "{rate_hz} Hz, {bins} bins, look ahead {look_ahead}");
            assert!(rig.out().is_some(), "the last frame came out");
        }
    }
}
