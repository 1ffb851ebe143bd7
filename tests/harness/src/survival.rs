//! Frames that any phase-retrieval node must put out. Hard cases stand in `asperity_checks`.

use asperity_sdk::{FrameLayout, Latency, Node};

use crate::retrieval::{Rig, layout, noise, tone};

/// Parameters of a node under test.
pub type Settings<'a> = &'a [(&'a str, f64)];

/// Checks that each frame comes out with its magnitudes, as late as the node says: odd ones, and those beside
/// missing ones.
pub fn frames_come_out<N: Node>(all: &[Settings<'_>]) {
    for settings in all {
        println!("{settings:?}");
        odd_frames_come_out::<N>(settings);
        frames_beside_gaps_come_out::<N>(settings);
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
