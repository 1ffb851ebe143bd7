//! Time of each kernel for one frame, back to back.

use asperity_dsp::sample_commit::{SampleCommit, Settings};
use asperity_dsp::shaped_noise::ShapedNoise;
use asperity_dsp::{
    Complex, Conversion, FilterPhase, Framing, Level, OscillatorBank, OverlapAdd, Partials, PhaseVocoder,
    RandomPhase, Resampler, Spsi, StartPhase,
};
use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;

/// Magnitudes of a noise: about as many peaks as a frame can have.
fn frames(bins: usize, count: usize) -> Vec<Vec<f32>> {
    let mut state = 1u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    // Hann-windowed noise is smooth over about three bins; so is a mean over three.
    let all = (0..count).map(|_| (0..bins + 2).map(|_| next()).collect::<Vec<_>>());
    all.map(|x| x.windows(3).map(|w| w[0] + 2.0 * w[1] + w[2]).collect()).collect()
}

fn framing(rate_hz: u32, bins: usize) -> Framing {
    Framing { rate_hz, fft_len: rate_hz as usize / 10, bins, frame_num: 500, frame_den: 1 }
}

/// Times `run`, which takes the number of a frame and its magnitudes.
fn bench<R>(c: &mut Criterion, name: &str, f: Framing, mut run: impl FnMut(u64, &[f32]) -> R) {
    let (frames, mut frame) = (frames(f.bins, 97), 0);
    c.bench_function(&format!("{name}/{}", f.fft_len), |b| {
        b.iter(|| {
            frame += 1;
            run(frame, black_box(&frames[frame as usize % 97]))
        });
    });
}

/// The first sample of a frame's hop, and room for its samples.
fn hop(f: Framing, frame: u64, out: &mut [f32]) -> (u64, &mut [f32]) {
    (f.start(frame), &mut out[..(f.start(frame + 1) - f.start(frame)) as usize])
}

fn phase_retrieval(c: &mut Criterion) {
    for f in [framing(500, 26), framing(2500, 101), framing(44_100, 101), framing(48_000, 101)] {
        let mut spectrum = vec![Complex::default(); f.bins];
        let mut out = vec![0.0f32; f.rate_hz as usize / 500 + 1];
        let mut spsi = Spsi::<f32>::new(f.fft_len, f.bins, 1);
        bench(c, "spsi", f, |_, mags| spsi.process(mags, f.rate_hz / 500, &mut spectrum));
        let mut ola = OverlapAdd::<f32>::new(f).unwrap();
        bench(c, "overlap_add", f, |frame, _| {
            let (start, out) = hop(f, frame, &mut out);
            let _ = ola.add_frame(start, black_box(&spectrum));
            ola.emit(start, out);
        });
        ola.reset(0);
        bench(c, "spsi+overlap_add", f, |frame, mags| {
            let (start, out) = hop(f, frame, &mut out);
            spsi.process(mags, out.len() as u32, &mut spectrum);
            let _ = ola.add_frame(start, &spectrum);
            ola.emit(start, out);
        });
    }
}

fn plain_phase_retrieval(c: &mut Criterion) {
    for f in [framing(2500, 101), framing(48_000, 101)] {
        let mut spectrum = vec![Complex::default(); f.bins];
        let mut out = vec![0.0; f.start(1) as usize];
        let mut vocoder = PhaseVocoder::<f32>::new(f, StartPhase::Quadratic, Level::Keep, 1).unwrap();
        bench(c, "phase_vocoder", f, |frame, mags| vocoder.process(f.start(frame), mags, &mut spectrum));
        let mut random = RandomPhase::<f32>::new(f, Level::Plain, 1).unwrap();
        bench(c, "random_phase", f, |frame, mags| random.process(frame, mags, &mut spectrum));
        for (name, partials) in [("tracked", Partials::Tracked), ("noise", Partials::Noise)] {
            let mut bank = OscillatorBank::<f32>::new(f, partials, 1).unwrap();
            let mut held = Vec::new();
            bench(c, &format!("oscillator_bank {name}"), f, |frame, mags| {
                // Every fourth frame is another, as peaks of noise live for about ten.
                if frame % 4 == 1 {
                    held = mags.to_vec();
                }
                bank.add_frame(frame, f.start(frame), &held);
                bank.emit(f.start(frame), &mut out);
            });
        }
    }
}

fn sample_commit(c: &mut Criterion) {
    for f in [framing(500, 26), framing(2500, 101), framing(48_000, 101)] {
        let mut out = vec![0.0f32; f.start(1) as usize];
        for (frames, passes, emission) in
            [(5, 2, 0), (5, 3, -20), (5, 5, -20), (5, 5, 0), (10, 5, 0), (5, 6, -25)]
        {
            let settings = Settings { frames, passes, emission, ..Settings::default() };
            let mut kernel = SampleCommit::<f32>::new(f, settings, 1).unwrap();
            bench(c, &format!("sample_commit {frames}x{passes} at {emission}"), f, |frame, mags| {
                let _ = kernel.push(frame, mags);
                kernel.emit(f.start(frame), &mut out);
            });
        }
    }
}

/// A tick of noise through a filter: every frame is another.
fn shaped_noise(c: &mut Criterion) {
    for f in [framing(2500, 101), framing(48_000, 101)] {
        let mut noise = ShapedNoise::<f32>::new(f, 0.002, 1).unwrap();
        let mut out = vec![0.0f32; f.rate_hz as usize / 500 + 1];
        bench(c, "shaped_noise", f, |frame, mags| {
            let (start, out) = hop(f, frame, &mut out);
            noise.push(frame, mags, 1.0);
            noise.emit(start, None, out);
        });
    }
}

fn resample(c: &mut Criterion) {
    let conversion = |in_hz, out_hz, phase| Conversion {
        in_hz,
        out_hz,
        tick_num: 500,
        tick_den: 1,
        passband: Conversion::PASSBAND,
        phase,
    };
    for (in_hz, out_hz) in [(2500, 48_000), (2500, 44_100), (500, 48_000), (48_000, 2500)] {
        let mut r = Resampler::<f32>::new(&conversion(in_hz, out_hz, FilterPhase::Linear)).unwrap();
        let input = vec![0.5f32; in_hz as usize / 500];
        let mut out = vec![0.0f32; out_hz as usize / 500 + 1];
        let mut tick = 0;
        c.bench_function(&format!("resample/{in_hz}-{out_hz}/tick"), |b| {
            b.iter(|| {
                let (start, out) = hop(framing(out_hz, 1), tick, &mut out);
                r.process(tick * u64::from(in_hz) / 500, black_box(&input), start, out);
                tick += 1;
            });
        });
    }
    let widest = conversion(2500, 44_099, FilterPhase::Minimum);
    c.bench_function("resample/2500-44099/new", |b| b.iter(|| Resampler::<f32>::new(&widest).unwrap()));
}

criterion_group! {
    name = dsp;
    config = Criterion::default().warm_up_time(std::time::Duration::from_millis(500))
        .measurement_time(std::time::Duration::from_secs(2)).sample_size(50);
    targets = phase_retrieval, shaped_noise, sample_commit, plain_phase_retrieval, resample
}
criterion_main!(dsp);
