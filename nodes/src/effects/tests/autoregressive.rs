//! `autoregressive`.

use std::f64::consts::TAU;
use std::sync::Arc;

use asperity_autoregressive::{Synthesis, Texture};
use asperity_dsp::{Conversion, FilterPhase, Resampler, Stft};
use asperity_node::random;

use crate::bench::{self, Bench, files, largest_step, refused, spans};

const MADE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/models/made_ar/");

fn model(name: &str, gain: &str) -> String {
    format!("autoregressive(model: {:?}, gain: {gain})", format!("{MADE}{name}.ron"))
}

/// Slot, speed, force and level of a tick.
type Told = [f64; 4];

fn bench<T: AsRef<str>>(
    rates: (u32, u32),
    texts: &[T],
    play: impl Fn(u64) -> Told + Send + Sync + 'static,
) -> Bench {
    let play = move |tick| play(tick).map(|x| vec![x]).to_vec();
    Bench::new("autoregressive", "slot speed force level", play).rates(rates).list("models", texts)
}

const USUAL: (u32, u32) = (500, 48_000);

fn texture(name: &str) -> Arc<Texture> {
    Arc::new(Texture::read(format!("{MADE}{name}.ron")).unwrap())
}

/// A model's signal at the audio rate, by its kernels.
struct Direct {
    synthesis: Synthesis,
    resampler: Resampler<f32>,
    rate_hz: u32,
}

impl Direct {
    /// A model of the node `it` of a graph of seed 1, which is the `number`th of its slot.
    fn of(file: &str, number: u64, rate: u32, tick_hz: u32) -> Self {
        let texture = Arc::new(Texture::read(file).unwrap());
        let in_hz = texture.rate_hz() as u32;
        let passband = (450.0 / texture.rate_hz()).clamp(0.4, 0.45);
        let phase = FilterPhase::Minimum;
        let conversion = Conversion { in_hz, out_hz: rate, tick_num: tick_hz, tick_den: 1, passband, phase };
        let seed = random::bits(random::seed_of(1, "it"), number);
        Self {
            synthesis: Synthesis::new(texture, seed),
            resampler: Resampler::new(&conversion).unwrap(),
            rate_hz: in_hz,
        }
    }

    fn tick(
        &mut self,
        tick: u64,
        tick_hz: u32,
        (first, len): (u64, usize),
        speed: f64,
        force: f64,
    ) -> Vec<f32> {
        let own = asperity_node::time::samples(tick, self.rate_hz, tick_hz);
        let mut samples = vec![0.0; (own.end - own.start) as usize];
        self.synthesis.touch(speed, force);
        self.synthesis.process(own.start, &mut samples);
        let mut out = vec![0.0; len];
        self.resampler.process(own.start, &samples, first, &mut out);
        out
    }
}

fn speed(tick: u64) -> f64 {
    120.0 + 60.0 * (tick as f64 * 0.02).sin()
}

fn force(tick: u64) -> f64 {
    1.2 + 0.8 * (tick as f64 * 0.013).cos()
}

#[test]
fn it_is_its_kernels_begun_anew_with_every_slot() {
    for (tick_hz, rate) in [(500, 48_000), (500, 44_100), (4000, 48_000), (333, 44_100)] {
        let play = |tick: u64| {
            let slot = match tick {
                0..100 => 0.0,
                100..200 => 1.0,
                200..230 => -1.0,
                230..300 => 0.0,
                _ => 1.0,
            };
            [slot, speed(tick), force(tick), 1.0]
        };
        let (run, calls) =
            bench((tick_hz, rate), &[model("rough", "1"), model("ringing", "0.5")], play).run("it", 400);
        assert_eq!(calls, 400);
        let mut on: Option<(f64, Direct)> = None;
        for (tick, first, len) in spans(400, rate, tick_hz) {
            let slot = play(tick)[0];
            if on.as_ref().is_none_or(|(s, _)| *s != slot) {
                let name = if slot == 1.0 { "ringing" } else { "rough" };
                on = Some((slot, Direct::of(&format!("{MADE}{name}.ron"), 0, rate, tick_hz)));
            }
            let (_, direct) = on.as_mut().unwrap();
            let gain = if slot == 1.0 { 0.5 } else { 1.0 };
            let out = &run.audio[first as usize..][..len];
            let want = direct.tick(tick, tick_hz, (first, len), speed(tick), force(tick));
            for (y, x) in out.iter().zip(want) {
                // A gain of a half is exact.
                assert_eq!(*y, if slot < 0.0 { 0.0 } else { gain * x }, "tick {tick}");
            }
        }
    }
}

// The models add whatever their rates are, and each has a noise of its own.
#[test]
fn models_of_one_text_add_with_noise_of_their_own() {
    // One at another rate, between two of the same.
    let dir = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(format!("{MADE}ringing.ron")).unwrap();
    std::fs::write(dir.path().join("fast.ron"), text.replace("rate_hz: 1000.0", "rate_hz: 2750.0")).unwrap();
    let fast = dir.path().join("fast.ron").display().to_string();
    let both = format!(
        "[{}, autoregressive(model: {fast:?}, gain: 0.5), {}]",
        model("rough", "1"),
        model("rough", "2")
    );
    for (tick_hz, rate) in [(500, 48_000), (4000, 44_100)] {
        let play = |tick| [0.0, speed(tick), force(tick), 1.0];
        let (run, _) = bench((tick_hz, rate), std::slice::from_ref(&both), play).run("it", 300);
        let mut all =
            [(format!("{MADE}rough.ron"), 1.0), (fast.clone(), 0.5), (format!("{MADE}rough.ron"), 2.0)]
                .iter()
                .enumerate()
                .map(|(n, (file, gain))| (Direct::of(file, n as u64, rate, tick_hz), *gain))
                .collect::<Vec<(Direct, f32)>>();
        let (mut off, mut most) = (0.0_f32, 0.0_f32);
        for (tick, first, len) in spans(300, rate, tick_hz) {
            let mut want = vec![0.0_f32; len];
            for (direct, gain) in &mut all {
                let part = direct.tick(tick, tick_hz, (first, len), speed(tick), force(tick));
                want.iter_mut().zip(part).for_each(|(sum, x)| *sum += *gain * x);
            }
            for (y, x) in run.audio[first as usize..].iter().zip(want) {
                (off, most) = (off.max((y - x).abs()), most.max(x.abs()));
            }
        }
        assert!(off < 1e-5 * most && most > 0.1, "{off} of {most}");
    }
}

#[test]
fn what_follows_a_wake_does_not_depend_on_what_was_before() {
    // Awake and asleep are compared by the bench; the level's ramps are as long as several ticks.
    let play = |opens: u64| {
        move |tick: u64| {
            let open = tick >= opens && (tick % 150) < 100;
            let level = if open {
                ((tick % 150) as f64 / 10.0).min(1.0).min((100.0 - (tick % 150) as f64) / 10.0)
            } else {
                0.0
            };
            [(tick / 450 % 2) as f64, speed(tick), force(tick), level]
        }
    };
    for (tick_hz, rate) in [(500, 48_000), (500, 44_100), (4000, 48_000)] {
        let texts = [model("rough", "1"), model("ringing", "1")];
        let behind = |opens| bench((tick_hz, rate), &texts, play(opens)).behind_level().run("level", 1000);
        let (all, calls) = behind(0);
        assert!(calls < 750, "{calls}");
        // The same graph that has been silent so far.
        let (late, _) = behind(450);
        let from = (450 * u64::from(rate) / u64::from(tick_hz)) as usize;
        assert!(all.audio[from..] == late.audio[from..]);
        assert!(all.audio[..from].iter().any(|y| *y != 0.0) && late.audio[..from].iter().all(|y| *y == 0.0));
    }
}

#[test]
fn it_starts_and_stops_behind_a_level_without_a_click() {
    let level = |tick: u64| {
        (((tick % 200) as f64 - 50.0) / 10.0)
            .clamp(0.0, 1.0)
            .min(((150.0 - (tick % 200) as f64) / 10.0).clamp(0.0, 1.0))
    };
    for name in ["rough", "smooth", "ringing"] {
        let texts = [model(name, "1")];
        let steady = bench(USUAL, &texts, |_| [0.0, 120.0, 1.0, 1.0]).run("it", 4000).0;
        let gated = bench(USUAL, &texts, move |tick| [0.0, 120.0, 1.0, level(tick)])
            .behind_level()
            .run("level", 4000)
            .0;
        let (own, most) = (largest_step(&steady.audio), largest_step(&gated.audio));
        assert!(most <= own, "{name}: a step of {most}, where {own} is the largest of the steady signal");
    }
}

/// Edges of thirds of an octave around 25 to 400 Hz.
fn thirds() -> impl Iterator<Item = (f64, f64)> {
    (-16..=-4)
        .map(|n| 1000.0 * 2f64.powf(f64::from(n) / 3.0))
        .map(|f| (f / 2f64.powf(1.0 / 6.0), f * 2f64.powf(1.0 / 6.0)))
}

#[test]
fn spectrum_at_audio_rate_is_model_within_half_a_db() {
    for (name, tick_hz, rate) in [("rough", 500, 48_000), ("ringing", 500, 44_100)] {
        let (v, f) = (130.0, 1.3);
        let mut engine = bench((tick_hz, rate), &[model(name, "1")], move |_| [0.0, v, f, 1.0])
            .engine("it", true)
            .unwrap();
        let out = bench::run(&mut engine, "it", 120 * u64::from(tick_hz)).audio;
        // Frames of a second, half over each other. Bins are amplitudes, 2 |sum w x| / sum w. For a Hann
        // window, sum w^2 = 3/8 length and sum w = length / 2.
        let length = rate as usize;
        let mut stft = Stft::<f64>::new(length);
        let mut power = vec![0.0; 500];
        let mut count = 0.0;
        for start in (length..out.len() - length).step_by(length / 2) {
            let x: Vec<f64> = out[start..start + length].iter().map(|x| f64::from(*x)).collect();
            stft.process(&x).iter().zip(&mut power).for_each(|(bin, sum)| *sum += bin.norm_sqr());
            count += 1.0;
        }
        let density =
            |bin: usize| power[bin] / count * 0.25 / (3.0 / 8.0) * 0.25 * length as f64 / f64::from(rate);
        let filter = texture(name).at(v, f);
        let own = texture(name).rate_hz();
        for (low, high) in thirds() {
            let bins = (low.ceil() as usize)..=(high.floor() as usize);
            let found: f64 = bins.clone().map(density).sum();
            let want: f64 = bins.map(|hz| filter.power(TAU * hz as f64 / own) / own).sum();
            let off = 10.0 * (found / want).log10();
            assert!(off.abs() < 0.5, "{name}: {off:.2} dB from {low:.1} to {high:.1} Hz");
        }
    }
}

#[test]
fn the_toolkits_files_are_read_as_well_and_bad_ones_are_told() {
    let dir = tempfile::tempdir().unwrap();
    let xml = "<modelSet><SampleRate>1000</SampleRate><model><ARcoeff>-1.2 0.81</ARcoeff>\
               <var>0.04</var><gain>1.5</gain>\
               <speedMod>50</speedMod><forceMod>1</forceMod></model></modelSet>";
    std::fs::write(dir.path().join("m.XML"), xml).unwrap();
    let graph = dir.path().join("g.ron");
    let play = |tick: u64| [0.0, speed(tick), force(tick), 1.0];
    let bench = bench(USUAL, &["autoregressive(model: \"m.XML\")"], play).file(graph.to_str().unwrap());
    let (out, _) = bench.run("it", 100);
    assert!(out.audio.iter().any(|y| y.abs() > 0.1));
    assert_eq!(files(&bench), [dir.path().join("m.XML")]);
    std::fs::write(dir.path().join("half.xml"), xml.replace("1000", "1000.5")).unwrap();
    let text = format!("autoregressive(model: {:?})", dir.path().join("half.xml"));
    let e = refused("autoregressive", &[("models", &format!("[{text:?}]"))]);
    assert!(e.contains("models of 1000.5 Hz"), "{e}");
}
