//! Time of each kernel for one frame, back to back.

use asperity_dsp::sample_commit::{SampleCommit, Settings};
use asperity_dsp::shaped_noise::ShapedNoise;
use asperity_dsp::{
    Complex, Conversion, FilterPhase, Framing, Level, OscillatorBank, OverlapAdd, Partials, PhaseVocoder,
    RandomPhase, Resampler, Spsi, StartPhase,
};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
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

fn phase_retrieval(c: &mut Criterion) {
    for f in [framing(500, 26), framing(2500, 101), framing(44_100, 101), framing(48_000, 101)] {
        let n = f.fft_len;
        let frames = frames(f.bins, 97);
        let mut spectrum = vec![Complex::default(); f.bins];
        let mut out = vec![0.0f32; f.rate_hz as usize / 500 + 1];
        let mut spsi = Spsi::<f32>::new(n, f.bins, 1);
        let mut i = 0;
        c.bench_function(&format!("spsi/{n}"), |b| {
            b.iter(|| {
                i = (i + 1) % frames.len();
                spsi.process(black_box(&frames[i]), f.rate_hz / 500, &mut spectrum)
            });
        });
        let mut ola = OverlapAdd::<f32>::new(f).unwrap();
        let mut frame = 0;
        c.bench_function(&format!("overlap_add/{n}"), |b| {
            b.iter(|| {
                let start = f.start(frame);
                frame += 1;
                let hop = (f.start(frame) - start) as usize;
                let _ = ola.add_frame(start, black_box(&spectrum));
                ola.emit(start, &mut out[..hop]);
                out[0]
            });
        });
        c.bench_function(&format!("spsi+overlap_add/{n}"), |b| {
            b.iter(|| {
                let start = f.start(frame);
                frame += 1;
                let hop = (f.start(frame) - start) as usize;
                i = (i + 1) % frames.len();
                spsi.process(black_box(&frames[i]), hop as u32, &mut spectrum);
                let _ = ola.add_frame(start, &spectrum);
                ola.emit(start, &mut out[..hop]);
                out[0]
            });
        });
    }
}

fn plain_phase_retrieval(c: &mut Criterion) {
    for f in [framing(2500, 101), framing(48_000, 101)] {
        let n = f.fft_len;
        let frames = frames(f.bins, 97);
        let mut spectrum = vec![Complex::default(); f.bins];
        let mut frame = 0;
        let mut vocoder = PhaseVocoder::<f32>::new(f, StartPhase::Quadratic, Level::Keep, 1).unwrap();
        c.bench_function(&format!("phase_vocoder/{n}"), |b| {
            b.iter(|| {
                frame += 1;
                vocoder.process(f.start(frame), black_box(&frames[frame as usize % 97]), &mut spectrum)
            });
        });
        let mut random = RandomPhase::<f32>::new(f, Level::Plain, 1).unwrap();
        c.bench_function(&format!("random_phase/{n}"), |b| {
            b.iter(|| {
                frame += 1;
                random.process(frame, black_box(&frames[frame as usize % 97]), &mut spectrum)
            });
        });
        let mut out = vec![0.0; f.start(1) as usize];
        for (name, partials) in [("tracked", Partials::Tracked), ("noise", Partials::Noise)] {
            let mut bank = OscillatorBank::<f32>::new(f, partials, 1).unwrap();
            c.bench_function(&format!("oscillator_bank {name}/{n}"), |b| {
                b.iter(|| {
                    frame += 1;
                    // Every fourth frame is another, as peaks of noise live for about ten.
                    let mags = &frames[frame as usize / 4 % 97];
                    bank.add_frame(frame, f.start(frame), black_box(mags));
                    bank.emit(f.start(frame), &mut out);
                    out[0]
                });
            });
        }
    }
}

fn sample_commit(c: &mut Criterion) {
    for f in [framing(500, 26), framing(2500, 101), framing(48_000, 101)] {
        let all = frames(f.bins, 97);
        let mut out = vec![0.0; f.start(1) as usize];
        for (frames, passes, emission) in
            [(5, 2, 0), (5, 3, -20), (5, 5, -20), (5, 5, 0), (10, 5, 0), (5, 6, -25)]
        {
            let settings = Settings { frames, passes, emission, ..Settings::default() };
            let mut kernel = SampleCommit::<f32>::new(f, settings, 1).unwrap();
            let mut frame = 0;
            c.bench_function(&format!("sample_commit {frames}x{passes} at {emission}/{}", f.fft_len), |b| {
                b.iter(|| {
                    let _ = kernel.push(frame, black_box(&all[frame as usize % 97]));
                    kernel.emit(f.start(frame), &mut out);
                    frame += 1;
                    out[0]
                });
            });
        }
    }
}

/// A tick of noise through a filter: every frame is another.
fn shaped_noise(c: &mut Criterion) {
    for f in [framing(2500, 101), framing(48_000, 101)] {
        let frames = frames(f.bins, 97);
        let mut noise = ShapedNoise::<f32>::new(f, 0.002, 1).unwrap();
        let mut out = vec![0.0f32; f.rate_hz as usize / 500 + 1];
        let mut frame = 0;
        c.bench_function(&format!("shaped_noise/{}", f.fft_len), |b| {
            b.iter(|| {
                let (start, end) = (f.start(frame), f.start(frame + 1));
                noise.push(frame, black_box(&frames[frame as usize % frames.len()]), 1.0);
                noise.emit(start, None, &mut out[..(end - start) as usize]);
                frame += 1;
                out[0]
            });
        });
    }
}

fn resample(c: &mut Criterion) {
    for (in_hz, out_hz) in [(2500, 48_000), (2500, 44_100), (500, 48_000), (48_000, 2500)] {
        let conversion = Conversion {
            in_hz,
            out_hz,
            tick_num: 500,
            tick_den: 1,
            passband: Conversion::PASSBAND,
            phase: FilterPhase::Linear,
        };
        let mut r = Resampler::<f32>::new(&conversion).unwrap();
        let input = vec![0.5f32; in_hz as usize / 500];
        let mut out = vec![0.0f32; out_hz as usize / 500 + 1];
        let mut k = 0u64;
        c.bench_function(&format!("resample/{in_hz}-{out_hz}/tick"), |b| {
            b.iter(|| {
                let (a, e) = (k * u64::from(out_hz) / 500, (k + 1) * u64::from(out_hz) / 500);
                r.process(k * u64::from(in_hz) / 500, black_box(&input), a, &mut out[..(e - a) as usize]);
                k += 1;
                out[0]
            });
        });
    }
    let widest = Conversion {
        in_hz: 2500,
        out_hz: 44_099,
        tick_num: 500,
        tick_den: 1,
        passband: Conversion::PASSBAND,
        phase: FilterPhase::Minimum,
    };
    c.bench_function("resample/2500-44099/new", |b| {
        b.iter_batched(|| widest, |w| Resampler::<f32>::new(&w).unwrap(), BatchSize::PerIteration);
    });
}

criterion_group! {
    name = dsp;
    config = Criterion::default().warm_up_time(std::time::Duration::from_millis(500))
        .measurement_time(std::time::Duration::from_secs(2)).sample_size(50);
    targets = phase_retrieval, shaped_noise, sample_commit, plain_phase_retrieval, resample
}
criterion_main!(dsp);
