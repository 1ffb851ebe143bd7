//! Cases that every phase-retrieval node must survive, built in or from a plugin, in the engine as a graph
//! would have it.

use std::f64::consts::PI;
use std::sync::Arc;

use asperity_accuracy::phase::{self, Score};
use asperity_loader::Plugin;
use asperity_node::{Buffer, FactValue, NodeKind, Registry};
use harness::plugins;
use harness::retrieval::{self, layout};

const BINS: usize = 101;
const FRAMES: u64 = 240;
/// The frame in which some magnitudes are none, and the one at which silence ends.
const BAD: u64 = 120;
const ONSET: u64 = 60;
/// Where the tone lies: between bins, and off the middle between two.
const TONE: f64 = 15.37;

/// A sinusoid at place `at` in a periodic Hann window, of amplitude 1, seen at bin `k`.
fn lobe(at: f64, k: usize) -> f64 {
    let d = k as f64 - at;
    match d.abs() {
        x if x < 1e-9 => 1.0,
        x if (x - 1.0).abs() < 1e-9 => 0.5,
        _ => ((PI * d).sin() / (PI * d * (1.0 - d * d))).abs(),
    }
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
        "onset" if n < ONSET => 0.0,
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

/// All frames of a case.
fn frames(case: &str, scale: f64) -> Vec<f32> {
    (0..FRAMES).flat_map(|n| (0..BINS).map(move |k| (magnitude(case, n, k) * scale) as f32)).collect()
}

/// Runs the frames of a case through a method, as those from frame `from` on.
fn heard(registry: &Registry, method: &str, case: &str, scale: f64, rate_hz: u32, from: u64) -> Vec<f64> {
    retrieval::heard(registry, method, layout(rate_hz, BINS as u32), from, &frames(case, scale))
}

/// Calls the node itself, since the engine lets no NaN through to it. Answers all that it put out, as bits,
/// and how many magnitudes it found to be none.
fn called(registry: &Registry, method: &str, case: &str) -> (Vec<u32>, u64) {
    let mut compiled = retrieval::compiled(registry, method, layout(2500, BINS as u32), 0, &[]);
    let at = compiled.schedule.index_of("phase").expect("a node");
    let node = &compiled.schedule.nodes[at];
    let input = node.inputs[0].port.as_ref().expect("it is wired");
    let mut buffers = [Buffer::new(input, 500), Buffer::new(&node.outputs[0].port, 500)];
    let mut processor = compiled.nodes.swap_remove(at).processor;
    let mut bits = Vec::new();
    for n in 0..FRAMES {
        let [given, out] = &mut buffers;
        if let Buffer::Magnitude { bins, frame, .. } = given {
            *frame = Some((n, 5 * n));
            bins.iter_mut().enumerate().for_each(|(k, m)| *m = magnitude(case, n, k) as f32);
        }
        match out {
            Buffer::Audio { samples, len, .. } => (*len, _) = (5, samples.fill(0.0)),
            Buffer::Spectrum { frame, .. } => *frame = None,
            _ => panic!("neither a signal nor a spectrum"),
        }
        crate::drive::tick(processor.as_mut(), n, std::slice::from_ref(given), std::slice::from_mut(out));
        match out {
            Buffer::Audio { samples, .. } => bits.extend(samples.iter().map(|x| x.to_bits())),
            Buffer::Spectrum { bins, frame: Some(_), .. } => {
                bits.extend(bins.iter().flat_map(|z| [z.re.to_bits(), z.im.to_bits()]));
            }
            _ => {}
        }
    }
    let count = processor.facts().into_iter().find(|f| f.name == "bad_magnitudes").map(|f| f.value);
    let Some(FactValue::Count(bad)) = count else { panic!("{method:?} does not count what is no magnitude") };
    (bits, bad)
}

/// Score of a signal against the magnitudes of a case, from frame `from` on.
fn score(case: &str, scale: f64, rate_hz: u32, heard: &[f64]) -> Score {
    let unscaled = f64::from(rate_hz / 40) * scale;
    // The last window's worth is still to come.
    let frames = FRAMES - 50;
    let all: Vec<f32> =
        (0..frames).flat_map(|n| (0..BINS).map(move |k| (magnitude(case, n, k) * unscaled) as f32)).collect();
    phase::score(&all, &phase::framing(rate_hz, BINS), heard).unwrap_or_else(|e| panic!("{case}: {e}"))
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
        let [bad, zeroed] = ["bad", "zeroed"].map(|case| called(registry, method, case));
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
            let s = score(case, 1.0, 2500, &heard(registry, method, case, 1.0, 2500, 0));
            let (least, most) = loss(method, case);
            assert!((least..most).contains(&s.gain_db), "{method:?}, {case}: {s:?}");
            // Flat amplitudes of 0.1 in phase are 10; nothing else comes near.
            assert!(s.nonfinite == 0 && s.peak < 10.0, "{method:?}, {case}: {s:?}");
        }
    });
}

#[test]
fn magnitudes_of_1e_12_and_1e12_are_as_good_as_others() {
    each(|registry, method| {
        let of = |scale: f64| score("tone", scale, 2500, &heard(registry, method, "tone", scale, 2500, 0));
        let one = of(1.0);
        for scale in [1e-12, 1e12] {
            let s = of(scale);
            let same = (s.gain_db - one.gain_db).abs() < 0.05
                && (s.convergence_db - one.convergence_db).abs() < 0.5
                && (s.peak / scale / one.peak - 1.0).abs() < 0.05;
            assert!(same, "{method:?} times {scale:e}: {s:?}, and {one:?} times 1");
        }
    });
}

#[test]
fn silence_stays_silence_and_a_tone_after_it_is_there_at_once() {
    each(|registry, method| {
        let h = heard(registry, method, "onset", 1.0, 2500, 0);
        let first = 5 * ONSET as usize;
        assert!(h[..first].iter().all(|x| *x == 0.0), "{method:?} is heard before it is asked");
        let peak = |from: usize| h[from..from + 250].iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let (least, most) = match method {
            "random_phase" => (0.05, 0.4),
            // Noise: a quarter of a second of it seldom leaves these.
            "shaped_noise" => (0.4, 4.0),
            _ => (0.5, 1.4),
        };
        for from in [first + 250, first + 400] {
            assert!((least..most).contains(&peak(from)), "{method:?}: {} from sample {from} on", peak(from));
        }
        assert!(peak(first) < most, "{method:?} begins with a click of {}", peak(first));
    });
}

#[test]
fn alternating_hop_and_late_start_are_as_good_as_any() {
    each(|registry, method| {
        let of = |rate, from| {
            let h = heard(registry, method, "tone", 1.0, rate, from);
            score("tone", 1.0, rate, &h).convergence_db
        };
        // 88 samples throughout, 88 and 89 in turn; the numbers say how well such a tone can be met at all.
        let (even, odd) = (of(44_000, 0), of(44_100, 0));
        assert!(odd < (even + 1.5).max(-60.0), "{method:?}: {odd} dB at 44.1 kHz, {even} dB at 44 kHz");
        let (now, later) = (of(2500, 0), of(2500, 500 * 36_000));
        assert!(later < (now + 1.5).max(-40.0), "{method:?}: {later} dB after ten hours, {now} dB at once");
    });
}
