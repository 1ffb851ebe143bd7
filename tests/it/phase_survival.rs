//! Odd magnitudes, which every phase-retrieval node must survive, built in or from a plugin. What else is
//! hard stands in `asperity_checks`.

use std::sync::Arc;

use asperity_accuracy::phase::{self, Score};
use asperity_dsp::window::hann_lobe;
use asperity_loader::Plugin;
use asperity_node::{Buffer, FactValue, NodeKind, Registry};
use harness::plugins;
use harness::retrieval::{self, layout};

use crate::drive::node;

const BINS: usize = 101;
const FRAMES: u64 = 240;
/// The frame in which some magnitudes are none.
const BAD: u64 = 120;
/// Where the tone lies: between bins, and off the middle between two.
const TONE: f64 = 15.37;

/// A sinusoid of amplitude 1 at place `at`, seen at bin `k`.
fn lobe(at: f64, k: usize) -> f64 {
    hann_lobe(k as f64 - at).abs()
}

/// Bin `k` of frame `n`.
fn magnitude(case: &str, n: u64, k: usize) -> f64 {
    let tone = lobe(TONE, k);
    match case {
        "tie" => lobe(15.5, k),
        "plateau" => [0.2, 0.2, 0.1, 0.1][k % 4],
        "flat" => 0.1,
        "one bin" => f64::from(u8::from(k == 40)),
        // 26.2 dB under the tone.
        "floor" => tone.max(0.049),
        "bad" if n == BAD && k % 25 == 10 => [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0][k / 25],
        "zeroed" if n == BAD && k % 25 == 10 => 0.0,
        _ => tone,
    }
}

fn registry() -> Registry {
    let mut all = harness::registry();
    for package in ["asperity-rtpghi", "asperity-gsrtisi-la", "my_phase"] {
        let plugin = Plugin::load(plugins::rust(package)).unwrap_or_else(|e| panic!("{e}"));
        for kind in plugin.kinds() {
            assert!(all.add(Arc::<NodeKind>::clone(kind)).is_none());
        }
    }
    all
}

/// Every kind that retrieves phase, as it is and as it may be set.
fn methods(registry: &Registry) -> Vec<String> {
    let kinds = registry.iter().map(|k| k.descriptor()).filter(|d| d.retrieval().is_some());
    let mut all: Vec<String> = kinds.map(|d| d.kind.to_string()).collect();
    for kind in ["spsi", "sample_commit", "oscillator_bank", "rtpghi", "gsrtisi_la", "my_phase"] {
        assert!(all.iter().any(|k| k == kind), "{kind} is missing: {all:?}");
    }
    let set = [
        "sample_commit: emission: 0",
        "sample_commit: emission: 4",
        "oscillator_bank: partials: tracked",
        "rtpghi: look_ahead: 0",
        "gsrtisi_la: look_ahead: 0",
    ];
    all.extend(set.map(str::to_owned));
    all
}

/// Frames of a case, times a scale.
fn frames(case: &str, count: u64, scale: f64) -> Vec<f32> {
    (0..count).flat_map(|n| (0..BINS).map(move |k| (magnitude(case, n, k) * scale) as f32)).collect()
}

/// All that the node puts out, as bits, and how many magnitudes it found to be none.
fn put_out(registry: &Registry, method: &str, case: &str) -> (Vec<u32>, u64) {
    let given = frames(case, FRAMES, 1.0).chunks(BINS).map(|frame| Some(frame.to_vec())).collect();
    let (mut engine, ..) = retrieval::engine(registry, method, layout(2500, BINS as u32), given);
    let phase = node(&engine, "phase");
    let mut bits = Vec::new();
    for _ in 0..FRAMES {
        engine.tick();
        match engine.output(phase, 0) {
            Some(Buffer::Audio { samples, .. }) => bits.extend(samples.iter().map(|x| x.to_bits())),
            Some(Buffer::Spectrum { bins, frame: Some(_), .. }) => {
                bits.extend(bins.iter().flat_map(|z| [z.re.to_bits(), z.im.to_bits()]));
            }
            _ => {}
        }
    }
    let count = engine.facts(phase).into_iter().find(|f| f.name == "bad_magnitudes").map(|f| f.value);
    let Some(FactValue::Count(bad)) = count else { panic!("{method:?} does not count what is no magnitude") };
    (bits, bad)
}

/// Score of what a method makes of a case. The last window's worth is still to come.
fn score(registry: &Registry, method: &str, case: &str) -> Score {
    let heard = retrieval::heard(registry, method, layout(2500, BINS as u32), &frames(case, FRAMES, 1.0));
    let wanted = frames(case, FRAMES - 50, 62.5);
    phase::score(&wanted, &phase::framing(2500, BINS), &heard).unwrap_or_else(|e| panic!("{case}: {e}"))
}

/// Level that a method loses in a case \[dB\], and why it is no fault.
fn loss(method: &str, case: &str) -> (f64, f64) {
    match (method.split(':').next().unwrap_or(""), case) {
        // Overlapping frames whose phases do not agree.
        ("random_phase", _) => (-21.0, -14.0),
        // Noise as narrow as a tone's lobe has some ten independent values in this time: its power is known
        // to 1.4 dB.
        ("shaped_noise", "tone" | "tie" | "one bin" | "floor") => (-4.5, 4.5),
        // One peak, if a spectrum is flat.
        ("spsi" | "rtpghi", "flat") => (-16.0, -10.0),
        ("oscillator_bank", "flat") if method.contains("tracked") => (-17.0, -10.0),
        // No signal has these magnitudes: a tone is seen in three bins.
        (_, "one bin") => (-3.0, 0.5),
        _ => (-2.0, 0.5),
    }
}

/// Runs a check over all methods.
fn each(check: impl Fn(&Registry, &str)) {
    let registry = registry();
    methods(&registry).iter().for_each(|method| check(&registry, method));
}

#[test]
fn what_is_no_magnitude_is_taken_for_0_in_its_frame_and_counted() {
    each(|registry, method| {
        let [bad, zeroed] = ["bad", "zeroed"].map(|case| put_out(registry, method, case));
        assert_eq!((bad.1, zeroed.1), (4, 0), "{method:?}");
        assert!(bad.0 == zeroed.0, "{method:?}: what is no magnitude is heard");
        let finite = bad.0.iter().map(|b| f32::from_bits(*b)).all(f32::is_finite);
        assert!(finite && bad.0.iter().any(|b| f32::from_bits(*b).abs() > 0.1), "{method:?}");
    });
}

#[test]
fn ties_flat_spectra_single_bins_and_floors_keep_their_level() {
    each(|registry, method| {
        for case in ["tone", "tie", "plateau", "flat", "one bin", "floor"] {
            let s = score(registry, method, case);
            let (least, most) = loss(method, case);
            assert!((least..most).contains(&s.gain_db), "{method:?}, {case}: {s:?}");
            // Flat amplitudes of 0.1 in phase are 10; nothing else comes near.
            assert!(s.nonfinite == 0 && s.peak < 10.0, "{method:?}, {case}: {s:?}");
        }
    });
}
