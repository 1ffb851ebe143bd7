//! Frames that any phase-retrieval node must put out. Hard cases stand in `asperity_checks`.

use asperity_dsp::window::hann_lobe;
use asperity_node::{Buffer, FrameLayout, Node, random};

use crate::retrieval::{engine, layout, method};

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

/// Feeds frames, and checks that each comes out with its magnitudes, as late as the node says.
fn all_come_out<N: Node>(layout: FrameLayout, params: Settings<'_>, frames: &[Option<Vec<f32>>]) {
    let registry = crate::registry().with::<N>();
    let (mut engine, latency, _) = engine(&registry, &method::<N>(params), layout, frames.to_vec());
    let (num, den) = latency.as_ratio();
    assert_eq!(num * 500 % den, 0, "whole frames");
    let late = (num * 500 / den) as usize;
    let phase = engine.schedule().index_of("phase").expect("a node");
    for slot in 0..frames.len() + late {
        engine.tick();
        let Some(Buffer::Spectrum { bins, frame, .. }) = engine.output(phase, 0) else { panic!("frames") };
        let place = (slot as u64, layout.frame_rate.first_sample(slot as u64, layout.rate_hz));
        assert!(frame.is_none_or(|frame| frame == place), "frames stand in their slots");
        let due = slot.checked_sub(late).and_then(|s| frames[s].as_deref());
        assert!(due.is_none() || frame.is_some(), "the frame of slot {} did not come out", slot - late);
        let silence = vec![0.0; bins.len()];
        let due = if frame.is_some() { due.unwrap_or(&silence) } else { &[] };
        for (k, (c, &m)) in bins.iter().zip(due).enumerate() {
            let m = if (0.0..=f32::MAX).contains(&m) { f64::from(m) } else { 0.0 };
            let have = f64::from(c.re).hypot(f64::from(c.im));
            // A tick flushes parts that are no normal numbers to 0.
            let flushed = 2.0 * f64::from(f32::MIN_POSITIVE);
            assert!((have - m).abs() <= 1e-5 * m + flushed, "slot {slot}, bin {k}: {have:e} is not {m:e}");
        }
    }
    assert_eq!(engine.report(phase).expect("it").faults, 0);
}

/// Magnitudes of a unit sinusoid at `freq` bins: the lobe of a Hann window.
fn tone(freq: f64, bins: usize) -> Vec<f32> {
    (0..bins).map(|k| hann_lobe(k as f64 - freq).abs() as f32).collect()
}

/// A pseudo-random number in [0, 1) for two indices.
fn noise(n: u64, k: u64) -> f32 {
    random::uniform(n, k) as f32
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
