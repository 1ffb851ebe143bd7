use std::f64::consts::TAU;

use asperity_checks::{Stop, Subject, node_cases};
use asperity_dsp::Stft;
use asperity_node::{ParamValue, Shape, Status};

use crate::bench::{Alone, largest_step};

const RATE: u32 = 44_100;
const TICK_HZ: u32 = 500;

/// A source at 44.1 kHz with these parameters, the others at their defaults.
fn source(kind: &str, set: &[(&str, f64)]) -> Alone {
    let set: Vec<_> = set.iter().map(|(name, value)| (*name, ParamValue::Number(*value))).collect();
    Alone::new(kind, &set, (TICK_HZ, 1, RATE), &[], &[Shape::Audio { rate_hz: RATE }]).unwrap()
}

/// The samples of some ticks.
fn play(source: &mut Alone, ticks: std::ops::Range<u64>) -> Vec<f32> {
    let mut out = Vec::new();
    for index in ticks {
        let (status, _) = source.tick(index);
        assert!(status != Status::Quiet || source.audio().iter().all(|x| *x == 0.0));
        out.extend_from_slice(source.audio());
    }
    out
}

#[test]
fn sources_are_as_every_node_must_be() {
    for kind in ["sine", "sweep", "noise"] {
        let mut subject = Subject::one(crate::registry().get(kind).unwrap().clone());
        subject.ticks = 500;
        for case in node_cases() {
            let found = case.run(&subject);
            assert!(!matches!(found, Err(Stop::Failed(_))), "{kind} {}: {found:?}", case.name);
        }
    }
}

#[test]
fn a_sine_has_its_phase_after_a_day() {
    let mut sine = source("sine", &[("frequency_hz", 79.7), ("amplitude", 2.0)]);
    let first = 24 * 3600 * u64::from(TICK_HZ);
    for (i, y) in play(&mut sine, first..first + 10).into_iter().enumerate() {
        // In integers: tenths of a hertz times samples, modulo ten times the rate.
        let n = u128::from(24 * 3600 * u64::from(RATE)) + i as u128;
        let phase = (797 * n % (10 * u128::from(RATE))) as f64 / (10.0 * f64::from(RATE));
        assert!((f64::from(y) - 2.0 * (TAU * phase).sin()).abs() < 1e-6, "{i}: {y}");
    }
}

#[test]
fn a_sine_changes_frequency_and_amplitude_without_a_step() {
    let mut sine = source("sine", &[("frequency_hz", 100.0), ("amplitude", 1.0)]);
    let mut out = play(&mut sine, 0..50);
    let mut before = 100.0;
    for (tick, hz) in [(50, 333.3), (53, 40.0), (56, 250.0)] {
        sine.node().set_parameter(0, hz);
        out.extend(play(&mut sine, tick..tick + 3));
        // From the same phase: no step is greater than the steepest of either frequency.
        let steepest = TAU * hz.max(before) / f64::from(RATE);
        assert!(f64::from(largest_step(&out[out.len() - 3 * 88 - 3..])) < 1.001 * steepest, "{hz}");
        before = hz;
    }
    let mut sine = source("sine", &[("frequency_hz", 1.0), ("amplitude", 0.0)]);
    play(&mut sine, 0..125);
    sine.node().set_parameter(1, 1.0);
    // A quarter of a period in, the sine stands at its top and the ramp shows: 1 in 10 ms.
    let up = play(&mut sine, 125..140);
    assert!(largest_step(&up) < 1.1 / 441.0 && (up[440] - 1.0).abs() < 0.01 && up[220] < 0.6, "{}", up[440]);
}

#[test]
fn a_sine_fades_in_and_out_and_is_over() {
    let mut sine = source("sine", &[("frequency_hz", 500.0), ("seconds", 0.5)]);
    let out = play(&mut sine, 0..500);
    let (fade, end) = (882, 22_050);
    for (n, y) in out.iter().enumerate() {
        let edge = (n.min(end - 1 - n.min(end - 1)) as f64 / fade as f64).min(1.0);
        let most = 0.1 * (0.5 - 0.5 * (TAU / 2.0 * edge).cos());
        assert!(f64::from(y.abs()) <= if n < end { most + 1e-7 } else { 0.0 }, "{n}: {y}");
    }
    assert!(out[2000..20_000].iter().any(|y| *y > 0.0999));
    assert_eq!(sine.prepared.duration.unwrap().ms(), 500.0);
    assert!(source("sine", &[]).prepared.duration.is_none());
}

#[test]
fn a_sine_that_does_not_fit_the_rate_is_refused() {
    let set = [("frequency_hz", ParamValue::Number(19_900.0))];
    let error =
        Alone::new("sine", &set, (TICK_HZ, 1, RATE), &[], &[Shape::Audio { rate_hz: RATE }]).err().unwrap();
    assert!(error.message.contains("does not fit an audio rate of 44100 Hz"), "{}", error.message);
}

#[test]
fn sweep_is_exponential_between_silences() {
    let set = [("from_hz", 20.0), ("to_hz", 1280.0), ("seconds", 3.0), ("amplitude", 0.5)];
    let mut sweep = source("sweep", &set);
    let ms = sweep.prepared.duration.unwrap().ms();
    // f0 L = 20 x 3 / ln 64 = 14.4, of which 14 remain.
    assert!((ms - 1500.0 - 14.0 / 20.0 * 64f64.ln() * 1e3).abs() < 0.1, "{ms}");
    let out = play(&mut sweep, 0..(ms / 2.0) as u64 + 100);
    let rate = f64::from(RATE);
    let (before, active) = ((0.5 * rate) as usize, ((ms * 1e-3 - 1.5) * rate).round() as usize);
    assert!(out[..before].iter().chain(&out[before + active..]).all(|y| *y == 0.0));
    // A quarter, a half and three quarters in: an octave and a half further each.
    for part in [0.25, 0.5, 0.75] {
        let at = before + (part * active as f64) as usize;
        let near = &out[at - 2205..at + 2205];
        let ups: Vec<f64> = near
            .windows(2)
            .enumerate()
            .filter(|(_, w)| w[0] < 0.0 && w[1] >= 0.0)
            .map(|(i, w)| i as f64 + f64::from(w[0] / (w[0] - w[1])))
            .collect();
        let hz = (ups.len() - 1) as f64 / (ups[ups.len() - 1] - ups[0]) * rate;
        let want = 20.0 * 64f64.powf(part);
        assert!((hz / want - 1.0).abs() < 0.02, "{part}: {hz} {want}");
    }
    assert!(out.iter().all(|y| y.abs() <= 0.5) && out.iter().any(|y| *y > 0.499));
}

#[test]
fn a_sweep_of_shape_displacement_is_small_where_it_is_slow() {
    let number = ParamValue::Number;
    let set = [
        ("from_hz", number(10.0)),
        ("to_hz", number(1000.0)),
        ("seconds", number(4.0)),
        ("before_s", number(0.0)),
        ("shape", ParamValue::Text("displacement".into())),
    ];
    let rates = (TICK_HZ, 1, RATE);
    let mut sweep = Alone::new("sweep", &set, rates, &[], &[Shape::Audio { rate_hz: RATE }]).unwrap();
    let out = play(&mut sweep, 0..2000);
    let peak = |from: f64, to: f64| {
        let range = (from * f64::from(RATE)) as usize..(to * f64::from(RATE)) as usize;
        out[range].iter().fold(0.0f32, |m, y| m.max(y.abs()))
    };
    // 100 Hz are reached after half the time: from there on flat, 31.6 Hz a quarter in.
    assert!((peak(2.1, 3.9) - 0.1).abs() < 1e-4);
    assert!((peak(0.9, 1.01) - 0.0316).abs() < 0.002, "{}", peak(0.9, 1.01));
}

fn noise(colour: &str) -> Alone {
    let set = [("rms", ParamValue::Number(0.25)), ("colour", ParamValue::Text(colour.into()))];
    Alone::new("noise", &set, (TICK_HZ, 1, RATE), &[], &[Shape::Audio { rate_hz: RATE }]).unwrap()
}

fn rms(x: &[f32]) -> f64 {
    (x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / x.len() as f64).sqrt()
}

#[test]
fn noise_has_its_level_and_colour() {
    const LENGTH: usize = 32_768;
    for (colour, db_an_octave) in [("white", 10.0 * 2f64.log10()), ("pink", 0.0)] {
        let out = play(&mut noise(colour), 0..40 * u64::from(TICK_HZ));
        let db = 20.0 * (rms(&out) / 0.25).log10();
        assert!(db.abs() < 0.2, "{colour}: {db} dB");
        let most = out.iter().fold(0.0f32, |m, x| m.max(x.abs()));
        assert!(colour == "pink" || most <= 0.25 * 3f32.sqrt(), "{most}");
        let mut stft = Stft::<f64>::new(LENGTH);
        let mut powers = vec![0.0; LENGTH / 2 + 1];
        for part in out.chunks_exact(LENGTH) {
            let part: Vec<f64> = part.iter().map(|x| f64::from(*x)).collect();
            powers.iter_mut().zip(stft.process(&part)).for_each(|(sum, bin)| *sum += bin.norm_sqr());
        }
        // Octaves from 20 Hz to a fifth of the rate.
        let bin = |hz: f64| (hz * LENGTH as f64 / f64::from(RATE)).round() as usize;
        let octaves: Vec<f64> = (0..8)
            .map(|n| 20.0 * 2f64.powi(n))
            .map(|hz| 10.0 * powers[bin(hz)..bin(2.0 * hz)].iter().sum::<f64>().log10())
            .enumerate()
            .map(|(n, db)| db - n as f64 * db_an_octave)
            .collect();
        let mean = octaves.iter().sum::<f64>() / octaves.len() as f64;
        println!("{colour}: {db:.2} dB, peak {most}; octaves {octaves:.1?}, mean {mean:.2}");
        assert!(octaves.iter().all(|db| (db - mean).abs() < 0.6), "{colour}: {octaves:.2?}");
    }
}

#[test]
fn noise_goes_on_in_another_node_of_its_seed() {
    for colour in ["white", "pink"] {
        let (mut old, mut new) = (noise(colour), noise(colour));
        let whole = play(&mut old, 0..200);
        let mut bytes = vec![0; old.node().state_size()];
        let len = old.node().save(&mut bytes).unwrap();
        assert!(new.node().restore(&bytes[..len]));
        assert_eq!(play(&mut old, 200..300), play(&mut new, 200..300), "{colour}");
        // Nothing repeats.
        let mut known = std::collections::HashSet::new();
        assert!(whole.windows(2).all(|w| known.insert([w[0].to_bits(), w[1].to_bits()])), "{colour}");
    }
}

/// A WAV file of floats, or of whole numbers with full scale 1.
fn wav(dir: &std::path::Path, rate_hz: u32, floats: bool, samples: &[f32]) -> ParamValue {
    let path = dir.join("a.wav");
    let sample_format = if floats { hound::SampleFormat::Float } else { hound::SampleFormat::Int };
    let bits_per_sample = if floats { 32 } else { 16 };
    let spec = hound::WavSpec { channels: 1, sample_rate: rate_hz, bits_per_sample, sample_format };
    let mut writer = hound::WavWriter::create(&path, spec).unwrap();
    for x in samples {
        match floats {
            true => writer.write_sample(*x).unwrap(),
            false => writer.write_sample((x * 32_768.0) as i16).unwrap(),
        }
    }
    writer.finalize().unwrap();
    ParamValue::File(path)
}

fn clip(file: ParamValue, set: &[(&str, ParamValue)]) -> Result<Alone, asperity_node::Diagnostic> {
    let set = [&[("file", file)], set].concat();
    let shapes = [Shape::Control { count: 1 }];
    Alone::new("clip", &set, (TICK_HZ, 1, 48_000), &shapes, &[Shape::Audio { rate_hz: 48_000 }])
}

/// Samples of ticks, in each of which the stylus touches or not.
fn touch(clip: &mut Alone, first: u64, touches: &[bool]) -> Vec<f32> {
    let mut out = Vec::new();
    for (tick, touches) in (first..).zip(touches) {
        clip.give(0, &[if *touches { 0.5 } else { 0.0 }], true);
        clip.tick(tick);
        out.extend_from_slice(clip.audio());
    }
    out
}

/// Checks that samples are alike, and says where they are not.
fn alike(found: &[f32], wanted: &[f32]) {
    let other = found.iter().zip(wanted).position(|(a, b)| (a - b).abs() > 1e-4);
    assert!(other.is_none() && found.len() == wanted.len(), "sample {other:?} of {}", found.len());
}

#[test]
fn clip_begins_anew_at_each_contact_without_a_click() {
    let dir = tempfile::tempdir().unwrap();
    let tone: Vec<f32> = (0..9600).map(|n| 3.0 * (TAU * 100.0 * n as f64 / 48_000.0).cos() as f32).collect();
    let mut it = clip(wav(dir.path(), 48_000, true, &tone), &[]).unwrap();
    let out = touch(&mut it, 0, &[&[false; 5][..], &[true; 20], &[false; 5], &[true; 200]].concat());
    // In the air it is silent; from contact on it is the file's beginning, after a fade of 5 ms.
    assert!(out[..480].iter().all(|x| *x == 0.0));
    alike(&out[480 + 240..480 + 20 * 96], &tone[240..20 * 96]);
    let again = 480 + 25 * 96;
    assert!(out[again - 96..again].iter().all(|x| *x == 0.0), "it fades out within 5 ms");
    alike(&out[again + 240..again + 9600 - 240], &tone[240..9600 - 240]);
    // It ends with the file, while contact lasts.
    assert!(out[again + 9600..].iter().all(|x| *x == 0.0));
    let steepest = 3.0 * (TAU * 100.0 / 48_000.0) as f32 + 3.0 * 1.5 / 240.0;
    assert!(crate::bench::largest_step(&out) < steepest, "{}", crate::bench::largest_step(&out));
    // A contact during the fade out waits for its end.
    let mut it = clip(wav(dir.path(), 48_000, true, &tone), &[]).unwrap();
    let out = touch(&mut it, 0, &[&[true; 20][..], &[false], &[true; 50]].concat());
    assert!(crate::bench::largest_step(&out) < steepest, "{}", crate::bench::largest_step(&out));
    let again = 20 * 96 + 240;
    alike(&out[again + 240..again + 2000], &tone[240..2000]);
}

#[test]
fn clip_is_resampled_and_loops_without_a_seam() {
    let dir = tempfile::tempdir().unwrap();
    // A quarter of a period too many: a loop without a crossfade would jump.
    let tone: Vec<f32> = (0..2525).map(|n| (TAU * 25.0 * n as f64 / 2500.0).cos() as f32).collect();
    let file = wav(dir.path(), 2500, true, &tone);
    let set = [("loop", ParamValue::Flag(true)), ("crossfade_ms", ParamValue::Number(100.0))];
    let mut it = clip(file, &set).unwrap();
    let out = touch(&mut it, 0, &[true; 2000]);
    let steepest = (TAU * 25.0 / 48_000.0) as f32;
    assert!(crate::bench::largest_step(&out[480..]) < 1.5 * steepest);
    assert!((rms(&out[480..]) - 0.5f64.sqrt()).abs() < 0.02, "{}", rms(&out[480..]));
    // Far from the file's ends, it is the tone at its own time.
    for n in (9600..24_000).step_by(997) {
        let want = (TAU * 25.0 * n as f64 / 48_000.0).cos();
        assert!((f64::from(out[n]) - want).abs() < 0.01, "{n}: {} {want}", out[n]);
    }
}

#[test]
fn clip_that_cannot_be_played_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let tone = [0.5_f32, -0.5, 0.25];
    let why = |file: ParamValue, set: &[(&str, ParamValue)]| clip(file, set).err().unwrap().to_string();
    let whole = wav(dir.path(), 48_000, false, &tone);
    assert!(why(whole.clone(), &[]).contains("does not say its acceleration"));
    let set = [("full_scale_m_s2", ParamValue::Number(40.0)), ("fade_ms", ParamValue::Number(0.1))];
    let mut it = clip(whole.clone(), &set).unwrap();
    let out = touch(&mut it, 0, &[true]);
    assert!(out[1] < -0.1 && out[1] > -20.0, "full scale is 40 m/s^2: {}", out[1]);
    let channel = [set[0].clone(), ("channel", ParamValue::Integer(2))];
    assert!(why(whole, &channel).contains("channel 2 of a file that has 1"));
    for (samples, message) in [
        (&[0.0, f32::NAN][..], "sample 1 of a clip is NaN"),
        (&[2e6, 0.0], "2e6 m/s^2"),
        (&[], "a clip of 0 samples"),
    ] {
        assert!(why(wav(dir.path(), 48_000, true, samples), &[]).contains(message), "{message}");
    }
    let slow = wav(dir.path(), 50, true, &tone);
    assert!(why(slow, &[]).contains("a clip of 50 Hz"));
    let long = wav(dir.path(), 100, true, &vec![0.0; 40_000]);
    assert!(why(long, &[]).contains("too long"), "at 48 kHz it takes more than 64 MiB");
    let path = dir.path().join("a.wav");
    for bytes in [&b""[..], b"RIFF....WAVE", b"OggS"] {
        std::fs::write(&path, bytes).unwrap();
        assert!(why(ParamValue::File(path.clone()), &[]).contains("a.wav: not a WAV file"));
    }
}
