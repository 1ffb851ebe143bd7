//! The kernels of a tick do not allocate.

use asperity_accuracy::timing::Recorder;
use asperity_dsp::sample_commit::{SampleCommit, Settings};
use asperity_dsp::{Complex, Conversion, FilterPhase, Framing, OverlapAdd, Resampler, Spsi};
use harness::counting::allocations;

#[test]
fn nothing_is_allocated_after_construction() {
    for (rate_hz, bins) in [(500, 26), (2500, 101), (44_100, 101), (48_000, 101)] {
        let f = Framing { rate_hz, fft_len: rate_hz as usize / 10, bins, frame_num: 500, frame_den: 1 };
        let mut spsi = Spsi::<f32>::new(f.fft_len, bins, 1);
        let mut ola = OverlapAdd::<f32>::new(f).unwrap();
        let c = Conversion {
            in_hz: rate_hz,
            out_hz: 48_000,
            tick_num: 500,
            tick_den: 1,
            passband: Conversion::PASSBAND,
            phase: FilterPhase::Linear,
        };
        let mut resampler = Resampler::<f32>::new(&c).unwrap();
        let mut recorder = Recorder::new(3);
        let settings = Settings { frames: 2, passes: 1, ..Settings::default() };
        let mut commit = SampleCommit::<f32>::new(f, settings, 1).unwrap();
        let (mut mags, mut spectrum) = (vec![0.0f32; bins], vec![Complex::default(); bins]);
        let (mut low, mut high) = (vec![0.0f32; rate_hz as usize / 500 + 1], vec![0.0f32; 96]);
        let ((), count) = allocations(|| {
            for n in 0..3000u64 {
                for (k, m) in mags.iter_mut().enumerate() {
                    *m = ((n * 31 + k as u64 * k as u64 * 7) % 97) as f32 - 3.0;
                }
                let (start, next) = (f.start(n), f.start(n + 1));
                let samples = &mut low[..(next - start) as usize];
                if n % 1000 < 900 {
                    assert!(commit.push(n, &mags).is_ok());
                }
                commit.emit(start, samples);
                spsi.process(&mags, samples.len() as u32, &mut spectrum);
                assert!(ola.add_frame(start, &spectrum).is_ok());
                ola.emit(start, samples);
                resampler.process(start, samples, 96 * n, &mut high);
                recorder.tick(n * 1000);
                recorder.node(1, n);
            }
            spsi.reset();
            ola.reset(0);
            commit.reset(0);
            resampler.reset();
            recorder.reset();
        });
        assert_eq!(count, 0, "{rate_hz} Hz, {bins} bins");
        assert!(high.iter().all(|y| y.is_finite()) && high.iter().any(|&y| y != 0.0));
    }
}
