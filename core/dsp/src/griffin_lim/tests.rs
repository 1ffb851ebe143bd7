use super::*;
use std::f64::consts::TAU;

/// Three and a third samples a hop.
const SMALL: Framing = Framing { rate_hz: 1000, fft_len: 16, bins: 7, frame_num: 300, frame_den: 1 };

fn noise(frames: usize, bins: usize) -> Vec<f64> {
    (0..frames * bins).map(|i| random::uniform(3, 7, i as u64)).collect()
}

fn run(mags: &[f64], f: Framing, iterations: usize, alpha: f64, start: Start) -> Vec<f64> {
    griffin_lim(mags, f, Options { iterations, alpha, start }, |_| {}).unwrap().signal
}

/// Distance of a signal's magnitudes from the wanted, relative to them, with all bins above wanted 0.
fn distance(mags: &[f64], f: &Framing, signal: &[f64]) -> f64 {
    let (mut stft, mut error, mut all) = (Stft::new(f.fft_len), 0.0, 0.0);
    for (n, mags) in mags.chunks_exact(f.bins).enumerate() {
        let found = stft.process(&signal[f.start(n as u64) as usize..][..f.fft_len]);
        // A bin that has a mirror image counts twice, as in the transform of the whole.
        for (k, c) in found.iter().enumerate() {
            let twice = if k == 0 || 2 * k == f.fft_len { 1.0 } else { 2.0 };
            let want = mags.get(k).copied().unwrap_or_default();
            error += twice * (c.norm() - want).powi(2);
            all += twice * want * want;
        }
    }
    (error / all).sqrt()
}

/// The same by sums, straight from the two papers.
fn naive(mags: &[f64], f: &Framing, iterations: usize, alpha: f64) -> Vec<f64> {
    let (n, k, frames) = (f.fft_len, f.bins, mags.len() / f.bins);
    let w: Vec<f64> = (0..n).map(|i| 0.5 - 0.5 * (TAU * i as f64 / n as f64).cos()).collect();
    let len = f.start(frames as u64 - 1) as usize + n;
    let signal_of = |c: &[Complex<f64>]| {
        let (mut y, mut sum) = (vec![0.0; len], vec![0.0; len]);
        for m in 0..frames {
            for i in 0..n {
                let mut x = 0.0;
                for b in 0..k {
                    let c = c[m * k + b];
                    let phase = if c.norm() > 0.0 { c.arg() } else { 0.0 };
                    // An unscaled DFT bin is the amplitude times N / 4; those above 0 come in pairs.
                    let bin = mags[m * k + b] * n as f64 / 4.0 * if b == 0 { 1.0 } else { 2.0 };
                    x += bin * (phase + TAU * (b * i) as f64 / n as f64).cos() / n as f64;
                }
                y[f.start(m as u64) as usize + i] += w[i] * x;
                sum[f.start(m as u64) as usize + i] += w[i] * w[i];
            }
        }
        let top = sum.iter().copied().fold(0.0, f64::max);
        y.iter().zip(&sum).map(|(y, s)| y / s.max(1e-3 * top)).collect::<Vec<f64>>()
    };
    let bins_of = |y: &[f64]| {
        let mut all = Vec::new();
        for m in 0..frames {
            for b in 0..k {
                let x = (0..n).map(|i| {
                    let v = w[i] * y[f.start(m as u64) as usize + i] * 4.0 / n as f64;
                    Complex::from_polar(v, -TAU * (b * i) as f64 / n as f64)
                });
                all.push(x.sum::<Complex<f64>>());
            }
        }
        all
    };
    let mut c = vec![Complex::new(1.0, 0.0); mags.len()];
    let mut before: Option<Vec<Complex<f64>>> = None;
    for _ in 0..iterations {
        let t = bins_of(&signal_of(&c));
        let last = before.as_ref().unwrap_or(&t);
        c = t.iter().zip(last).map(|(t, l)| t + (t - l) * alpha).collect();
        before = Some(t);
    }
    signal_of(&c)
}

#[test]
fn griffin_lim_matches_the_papers_at_a_fractional_hop() {
    let mags = noise(20, 7);
    for alpha in [0.0, 0.99] {
        for iterations in [0, 1, 2, 5] {
            let (x, y) =
                (run(&mags, SMALL, iterations, alpha, Start::Zero), naive(&mags, &SMALL, iterations, alpha));
            assert_eq!(x.len(), 79);
            let worst = x.iter().zip(&y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-10, "alpha {alpha}, {iterations} iterations: {worst}");
        }
    }
}

#[test]
fn griffin_lim_never_moves_away_from_the_magnitudes() {
    let mags = noise(60, 7);
    let mut last = f64::INFINITY;
    for iterations in 0..40 {
        let now = distance(&mags, &SMALL, &run(&mags, SMALL, iterations, 0.0, Start::Random(1)));
        // Where hardly any window reaches, the signal is not the least-squares one.
        assert!(now < last + 1e-4, "iteration {iterations}: {now} after {last}");
        last = now;
    }
    assert!(last < 0.6);
}

#[test]
fn griffin_lim_finds_a_signal_that_has_the_magnitudes() {
    // Two beats in a second at 200 Hz, with an odd window of 25 samples.
    let f = Framing { rate_hz: 200, fft_len: 25, bins: 13, frame_num: 50, frame_den: 1 };
    let x: Vec<f64> = (0..425).map(|i| (f64::from(i) * 0.9).sin() * (f64::from(i) * 0.03).cos()).collect();
    let mut stft = Stft::new(25);
    let mags: Vec<f64> = (0..101)
        .flat_map(|n| stft.process(&x[4 * n..][..25]).iter().map(|c| c.norm()).collect::<Vec<_>>())
        .collect();
    let fast = distance(&mags, &f, &run(&mags, f, 200, 0.99, Start::Zero));
    assert!(fast < 0.02, "{fast}");
    let single: Vec<f32> = mags.iter().map(|&m| m as f32).collect();
    let single = griffin_lim(&single, f, Options { iterations: 200, ..Options::default() }, |_| {}).unwrap();
    let single: Vec<f64> = single.signal.into_iter().map(f64::from).collect();
    assert!(distance(&mags, &f, &single) < 0.1);
}

#[test]
fn griffin_lim_counts_bad_magnitudes_as_silence() {
    let mut mags = vec![0.5f32; 20 * 7];
    (mags[3], mags[60], mags[61], mags[90]) = (f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0);
    let mut seen = Vec::new();
    let options = Options { iterations: 3, ..Options::default() };
    let found = griffin_lim(&mags, SMALL, options, |i| seen.push(i)).unwrap();
    assert_eq!((found.bad_magnitudes, seen), (4, vec![1, 2, 3]));
    assert!(found.signal.iter().all(|y| y.is_finite()) && found.signal.iter().any(|&y| y != 0.0));
    let huge = griffin_lim(&[f32::MAX; 140], SMALL, options, |_| {}).unwrap();
    assert!(huge.signal.iter().all(|y| y.is_finite()));
    let silent = griffin_lim(&[0.0f32; 140], SMALL, options, |_| {}).unwrap();
    assert_eq!(silent.signal, vec![0.0; 79]);
    assert_eq!(griffin_lim::<f32>(&[], SMALL, options, |_| {}).unwrap().signal, Vec::<f32>::new());
    assert!(griffin_lim(&mags, Framing { bins: 10, ..SMALL }, options, |_| {}).is_err());
}

#[test]
fn griffin_lim_is_independent_of_the_unit() {
    let mags = noise(20, 7);
    let scaled: Vec<f64> = mags.iter().map(|m| m * 1e-12).collect();
    let [x, y] = [mags, scaled].map(|mags| run(&mags, SMALL, 5, 0.99, Start::Random(1)));
    assert!(x.iter().zip(&y).all(|(x, y)| (x - y / 1e-12).abs() < 1e-9));
}
