use super::*;
use crate::random::uniform;

fn framing(fft_len: usize, bins: usize) -> Framing {
    Framing { rate_hz: 10 * fft_len as u32, fft_len, bins, frame_num: 500, frame_den: 1 }
}

/// Samples of which one window long is silent, and the magnitudes of some frames of it.
fn scene<T: Float>(f: &Framing) -> (Vec<T>, Vec<(usize, Vec<T>)>) {
    let n = f.fft_len;
    let z = (0..3 * n).map(|i| if i < n { 0.0 } else { uniform(1, 0, i as u64) - 0.5 });
    let frames = [0, n / 5 + 1, n / 2, n, n + 7, 3 * n / 2, 2 * n - 1, 2 * n];
    let mags = |l: usize| {
        (0..f.bins).map(move |k| T::of(if k % 9 == 4 { 0.0 } else { uniform(2, l as u64, k as u64) }))
    };
    (z.map(T::of).collect(), frames.into_iter().enumerate().map(|(l, at)| (at, mags(l).collect())).collect())
}

/// Sum of some frames from sample `from` on, `many` at a time.
fn sum<T: Float>(f: &Framing, from: usize, many: usize) -> Vec<T> {
    let (z, frames) = scene::<T>(f);
    let mut projector = Projector::new(f, 3);
    let turn = Complex::new(T::of(0.8), T::of(0.6));
    let mut sum = vec![T::zero(); z.len()];
    for some in frames.chunks(many) {
        let some: Vec<_> = some.iter().map(|(at, mags)| (*at, mags.as_slice())).collect();
        projector.project(Call { z: &z, frames: &some, from, sum: &mut sum, turn });
    }
    sum
}

fn apart<T: Float>(a: &[T], b: &[T]) -> f64 {
    let top = a.iter().map(|y| y.f64().abs()).fold(0.0, f64::max);
    assert!(top > 0.0);
    a.iter().zip(b).map(|(a, b)| (a.f64() - b.f64()).abs()).fold(0.0, f64::max) / top
}

#[test]
fn batch_projects_as_single_frames_do() {
    // Where few bins are carried, all but a few, and all; lengths whose half is odd and even.
    for (fft_len, bins) in [(50, 26), (250, 101), (250, 126), (250, 20), (800, 401), (882, 101), (4800, 101)]
    {
        let f = framing(fft_len, bins);
        for from in [0, fft_len / 2 + 1, fft_len - 3] {
            for many in [3, 8] {
                let off = apart(&sum::<f64>(&f, from, many), &sum::<f64>(&f, from, 1));
                assert!(off < 1e-13, "{fft_len} samples, {bins} bins from {from}, {many} at once: {off}");
                let off = apart(&sum::<f32>(&f, from, many), &sum::<f32>(&f, from, 1));
                assert!(off < 1e-5, "{fft_len} samples, {bins} bins from {from}, {many} at once, f32: {off}");
            }
        }
    }
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    fn check<T: Float>(f: &Framing) {
        let (z, frames) = scene::<T>(f);
        let frames: Vec<_> = frames.iter().map(|(at, mags)| (*at, mags.as_slice())).collect();
        let window: Vec<T> = hann(f.fft_len);
        let hint: Vec<_> = (0..f.bins).map(|k| Complex::new(T::of(1e-5 * k as f64), T::of(2e-5))).collect();
        let all = Isa::available().map(|isa| {
            let mut batch = Batch { run: compiled(isa), ..Batch::new(&window, f.bins, &hint).unwrap() };
            let mut sum = vec![T::zero(); z.len()];
            let turn = Complex::new(T::of(0.8), T::of(0.6));
            let from = f.fft_len / 2 + 3;
            batch.project(Call { z: &z, frames: &frames, from, sum: &mut sum, turn });
            sum.into_iter().map(|y| y.f64().to_bits()).collect::<Vec<_>>()
        });
        let all: Vec<_> = all.collect();
        assert!(all.iter().all(|one| *one == all[0]), "{f:?}");
        assert!(all[0].iter().any(|&y| y != 0));
    }
    for (fft_len, bins) in [(250, 101), (84, 43), (4800, 101)] {
        check::<f32>(&framing(fft_len, bins));
        check::<f64>(&framing(fft_len, bins));
    }
}

#[test]
fn odd_or_large_prime_length_has_no_batch() {
    for (fft_len, bins) in [(125, 60), (2 * 31, 20)] {
        let f = framing(fft_len, bins);
        assert!(Batch::<f32>::new(&hann(fft_len), bins, &[]).is_none());
        assert!(sum::<f64>(&f, 0, 8) == sum::<f64>(&f, 0, 1), "{fft_len}");
    }
}
