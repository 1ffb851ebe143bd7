//! Facts about rendered textures, on the shipped ones.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use asperity_dsp::Stft;

use super::fit::{Recording, Settings, Why};
use super::made_tests::{level, shipped};
use super::testing::{bands, off_db};
use super::{Model, Synthesis, Texture, line_spectrum};
use asperity_numbers::Random;

/// Speed and force.
type Place = [f64; 2];

/// A point in a triangle by weights.
fn within(texture: &Texture, triangle: [usize; 3], weights: [f64; 3]) -> Place {
    std::array::from_fn(|axis| {
        triangle.iter().zip(weights).map(|(i, w)| w * texture.models()[*i].place()[axis]).sum()
    })
}

/// Random weights that are not near an edge.
fn weights(random: &mut Random) -> [f64; 3] {
    let parts = [0; 3].map(|_| random.range(0.1, 1.0));
    parts.map(|p| p / parts.iter().sum::<f64>())
}

#[test]
fn mixture_has_barycentric_weights() {
    let mut random = Random::new(3);
    for (name, file) in shipped() {
        let texture = &file.texture;
        for (triangle, weights) in texture
            .triangles()
            .corners()
            .iter()
            .flat_map(|triangle| [(*triangle, weights(&mut random)), (*triangle, [0.0, 1.0, 0.0])])
        {
            let [speed, force] = within(texture, triangle, weights);
            if speed == 0.0 || force == 0.0 {
                continue;
            }
            let found = texture.at(speed, force);
            let mean = |of: &dyn Fn(&Model) -> f64| -> f64 {
                triangle.iter().zip(weights).map(|(i, w)| w * of(&texture.models()[*i])).sum()
            };
            for (found, want) in
                [(found.deviation.powi(2), mean(&|m| m.variance)), (found.gain, mean(&|m| m.gain))]
            {
                assert!((found - want).abs() < 1e-9 * want.max(1e-9), "{name}: {found}, not {want}");
            }
            for autoregressive in [true, false] {
                let found = if autoregressive { found.ar() } else { found.ma() };
                let of = |m: &Model| if autoregressive { m.ar.clone() } else { m.ma.clone() };
                let lines = line_spectrum::from_polynomial(found).unwrap();
                for (i, w) in lines.iter().enumerate() {
                    let want = mean(&|m| line_spectrum::from_polynomial(&of(m)).unwrap()[i]);
                    assert!((w - want).abs() < 1e-8, "{name}: {w}, not {want}");
                }
            }
        }
    }
}

/// Largest steps between samples of two signals: one that moves from one place to another and back in
/// this many ticks of 2 ms, and steady ones at places on the way.
fn largest_steps(texture: &Arc<Texture>, [from, to]: [Place; 2], ticks: u64) -> [f32; 2] {
    let run = |way: &dyn Fn(u64) -> f64| {
        let mut synthesis = Synthesis::new(texture.clone(), 21);
        let mut out = vec![0.0; 20_000];
        for (tick, out) in out.chunks_mut(2).enumerate() {
            let part = way(tick as u64);
            let [speed, force] = [0, 1].map(|k| from[k] + part * (to[k] - from[k]));
            synthesis.touch(speed, force);
            synthesis.process(2 * tick as u64, out);
        }
        out.windows(2).map(|p| (p[1] - p[0]).abs()).fold(0.0, f32::max)
    };
    let steady = (0..=8).map(|i| run(&|_| f64::from(i) / 8.0)).fold(0.0, f32::max);
    let changing = run(&|tick| {
        let (turn, since) = (tick / 75, tick % 75);
        let part = (since as f64 / ticks.max(1) as f64).min(1.0);
        let part = if ticks == 0 { 1.0 } else { part };
        if turn % 2 == 0 { part } else { 1.0 - part }
    });
    [changing, steady]
}

/// From corner to corner, however fast, a step is at most a quarter larger than those of steady signals
/// on the way.
#[test]
fn change_of_speed_and_force_does_not_click() {
    let mut random = Random::new(5);
    for (name, file) in shipped() {
        let texture = Arc::new(file.texture);
        let sounding: Vec<Place> =
            texture.models().iter().filter(|m| m.variance > 0.0).map(Model::place).collect();
        let mut worst = [0.0f32; 3];
        for _ in 0..10 {
            let pair = [0; 2].map(|_| sounding[random.below(sounding.len())]);
            for (worst, ticks) in worst.iter_mut().zip([50, 10, 0]) {
                let [changing, steady] = largest_steps(&texture, pair, ticks);
                *worst = worst.max(changing / steady);
            }
        }
        println!("{name}: within 100 ms {:.2}, 20 ms {:.2}, at once {:.2}", worst[0], worst[1], worst[2]);
        assert!(worst.iter().all(|w| *w < 1.25), "{name}: {worst:?}");
    }
}

/// Power by bins: a mean over windows of 4 s that overlap by half.
fn power(signal: &[f32]) -> Vec<f64> {
    const LEN: usize = 4000;
    let mut stft = Stft::<f64>::new(LEN);
    let signal: Vec<f64> = signal.iter().map(|x| f64::from(*x)).collect();
    let (mut power, mut count) = (vec![0.0; LEN / 2 + 1], 0.0);
    for part in signal.windows(LEN).step_by(LEN / 2) {
        // An amplitude is 4 / N of a bin, and squares of the window add up to 3 N / 8.
        power.iter_mut().zip(stft.process(part)).for_each(|(p, x)| *p += x.norm_sqr() * LEN as f64 / 6.0);
        count += 1.0;
    }
    power.into_iter().map(|p| p / count).collect()
}

/// At every corner and at a place in every triangle, over 120 s. No sample reaches 6.5 deviations. In the
/// band of 25 Hz, 5.8 Hz wide, the power of 120 s of noise has a deviation of 0.16 dB. All places have the
/// same noise, so that it is one draw for all of them.
#[test]
fn rendered_third_octaves_match_the_closed_form() {
    const SECONDS: usize = 120;
    let mut random = Random::new(1);
    let mut worst: f64 = 0.0;
    let mut places = 0;
    for (name, file) in shipped() {
        let texture = Arc::new(file.texture);
        let mut all: Vec<Place> =
            texture.models().iter().filter(|m| m.variance > 0.0).map(Model::place).collect();
        for &triangle in texture.triangles().corners() {
            let at = within(&texture, triangle, weights(&mut random));
            if texture.at(at[0], at[1]).deviation > 0.0 {
                all.push(at);
            }
        }
        for [speed, force] in all {
            let mut synthesis = Synthesis::new(texture.clone(), 1);
            synthesis.touch(speed, force);
            let mut out = vec![0.0; 1000 * (SECONDS + 1)];
            synthesis.process(0, &mut out);
            // The first second settles.
            let found = power(&out[1000..]);
            let filter = texture.at(speed, force);
            let peak = out.iter().fold(0.0f32, |m, x| m.max(x.abs()));
            assert!(f64::from(peak) < 6.5 * level(&filter), "{name}: {peak}");
            for band in 14..=26 {
                let centre = 10f64.powf(f64::from(band) / 10.0);
                let near = |k: &usize| (0.25 * *k as f64 / centre).log10().abs() < 0.05;
                let bins: Vec<usize> = (0..found.len()).filter(near).collect();
                let found: f64 = bins.iter().map(|k| found[*k]).sum();
                let want: f64 = bins.iter().map(|k| filter.power(TAU * *k as f64 / 4000.0)).sum();
                let off = 10.0 * (found / want).log10();
                worst = worst.max(off.abs());
                assert!(off.abs() < 0.5, "{name} at {speed} mm/s, {force} N, {centre:.0} Hz: {off} dB");
            }
            places += 1;
        }
    }
    println!("{places} places, at most {worst:.3} dB");
    assert!(places > 110);
}

/// Samples do not depend on how they are asked for. A signal that sleeps and starts anew equals one that
/// went on and was reset there.
#[test]
fn noise_depends_on_the_sample_number_only() {
    let (_, file) = shipped().remove(2);
    let mut random = Random::new(9);
    let [mut whole, mut parts, mut awake, mut asleep] =
        [0; 4].map(|_| Synthesis::new(Arc::new(file.texture.clone()), 4));
    // Ticks of two samples. Some are asked for one sample at a time.
    let tick = |synthesis: &mut Synthesis, n: u64, step: usize| {
        synthesis.touch(20.0 + 0.02 * n as f64, 1.0 + 0.0002 * n as f64);
        let mut out = [0.0; 2];
        for (i, out) in out.chunks_mut(step).enumerate() {
            synthesis.process(2 * n + i as u64, out);
        }
        out
    };
    let (mut sleeps, mut compared) = (true, 0);
    for n in 0..4000 {
        assert_eq!(tick(&mut whole, n, 2), tick(&mut parts, n, 1 + random.below(2)), "tick {n}");
        let slept = sleeps;
        sleeps = if n % 50 == 0 { random.chance(0.5) } else { sleeps };
        if slept && !sleeps {
            awake.reset();
            asleep.reset();
        }
        let out = tick(&mut awake, n, 2);
        if !sleeps {
            assert!(out[0] != 0.0 && tick(&mut asleep, n, 2) == out, "tick {n}");
            compared += 1;
        }
    }
    assert!((1000..3000).contains(&compared));
}

/// The rendered signal is fitted. The fit sounds as the texture does.
#[test]
fn fit_of_a_rendering_is_its_texture() {
    let limits = [("rough", 1.5), ("smooth", 1.5), ("ringing", 2.5)];
    for ((name, file), (_, limit)) in shipped().into_iter().zip(limits) {
        let texture = Arc::new(file.texture);
        let mut synthesis = Synthesis::new(texture.clone(), 6);
        let (mut force, mut speed, mut acceleration) = (vec![], vec![], vec![]);
        let corners: Vec<Place> =
            [50.0, 120.0, 250.0].into_iter().flat_map(|v| [0.6, 1.5, 2.6].map(|f| [v, f])).collect();
        let mut from = corners[0];
        for &to in &corners {
            for n in 0..7000 {
                // A second on the way, six at the place.
                let part = 0.5 - 0.5 * (PI * f64::from(n.min(1000)) / 1000.0).cos();
                let [v, f] = [0, 1].map(|k| from[k] + part * (to[k] - from[k]));
                speed.push(v);
                force.push(f);
                synthesis.touch(v, f);
                let mut out = [0.0];
                synthesis.process(acceleration.len() as u64, &mut out);
                acceleration.push(f64::from(out[0]));
            }
            from = to;
        }
        let recording = Recording {
            rate_hz: 1000.0,
            force_n: &force,
            speed_mm_s: &speed,
            acceleration_m_s2: vec![&acceleration],
        };
        let (fitted, report) = recording.fit(&Settings::default()).unwrap();
        let found = (fitted.models().len(), fitted.triangles().corners().len());
        assert!(name != "rough" || found == (9, 8), "{found:?}, {report:#?}");
        // Some of each second on the way is neither place.
        let unsteady = report.dropped_s(Why::Unsteady);
        assert!((0.2..4.0).contains(&unsteady), "{name}: {unsteady} s");
        for [v, f] in corners {
            let (found, want) = (fitted.at(v, f), texture.at(v, f));
            let off = 20.0 * (level(&found) / level(&want)).log10();
            assert!(off.abs() < 1.0, "{name} at {v} mm/s, {f} N: {off} dB");
            let worst = off_db(&bands(&found, 1000.0), &bands(&want, 1000.0), 1e-3);
            println!("{name} {v} {f}: level {off:.2}, band {worst:.2}, order {}", report.order);
            assert!(worst < limit, "{name} at {v} mm/s, {f} N: {worst} dB");
        }
    }
}
