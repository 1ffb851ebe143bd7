//! Textures of autoregressive models.

use std::f64::consts::TAU;
use std::sync::Arc;

use asperity_autoregressive::{Filter, Model, Texture, TextureFile, is_stable, line_spectrum};
use asperity_checks::textures::{Bench, Heard, Voice, Way, across, draw, radius, silent_after, square, stay};
use asperity_checks::{Found, Stop, Subject, decibels, ensure};
use asperity_graph::GraphFile;
use asperity_node::{Fault, Setup, Status, random};

use tempfile::TempDir;

use crate::{breaks, called, fails, graph, holds, passes, run, sounding, subject};

const KIND: &str = "autoregressive";

/// The first texture of a node that is prepared.
fn first(setup: &Setup<'_>) -> Arc<Texture> {
    let slot = setup.params.slots().first().expect("a slot");
    let model = slot.first().expect("a texture").file("model");
    Arc::new(Texture::read(model).expect("a texture"))
}

/// The recursion over the signal's own past, as in papers, instead of the kind. Eight samples at 8 kHz hold
/// one at 1 kHz. `filter` answers the filter at a place.
fn recursion(filter: fn(&Texture, f64, f64) -> Filter) -> Subject<'static> {
    called(&subject(None), KIND, move |setup| {
        let texture = first(setup);
        let mut past: Vec<f64> = vec![0.0; 64];
        let mut number = 0_u64;
        Box::new(move |_, tick| {
            let filter = filter(&texture, tick.inputs.value(1), tick.inputs.value(2));
            for samples in tick.outputs.audio(0).chunks_mut(8) {
                // Noise of deviation 1, near enough to normal.
                let unit = |i: u64| random::bits(3, 12 * number + i) as f64 / u64::MAX as f64;
                let noise = (0..12).map(unit).sum::<f64>() - 6.0;
                number += 1;
                let back: f64 = filter.ar().iter().zip(&past).map(|(a, x)| a * x).sum();
                past.rotate_right(1);
                past[0] = filter.deviation * filter.gain * noise - back;
                samples.fill(past[0] as f32);
            }
            if past[0].is_finite() { Ok(Status::Continue) } else { Err(Fault::NotFinite) }
        })
    })
}

/// A mixture of coefficients, of which papers warn.
fn by_coefficients(texture: &Texture, speed: f64, force: f64) -> Filter {
    let blend = texture.triangles().at(speed, force);
    let corners =
        || blend.models.iter().zip(blend.weights).filter_map(|(m, w)| Some((texture.models().get(*m)?, w)));
    let order = texture.models()[0].ar.len();
    let ar: Vec<f64> = (0..order).map(|i| corners().map(|(m, w)| w * m.ar[i]).sum()).collect();
    let variance: f64 = corners().map(|(m, w)| w * m.variance).sum();
    Filter::new(&ar, &[], variance.sqrt())
}

/// Rate of the models \[Hz\].
const RATE_HZ: f64 = 1000.0;
/// Audio rate \[Hz\]: low, so that hours take seconds.
const AUDIO_HZ: u32 = 8000;

/// A bench of the built-in kind with models, and the folder of their file.
fn made<'s>(subject: &'s Subject<'s>, models: Vec<Model>) -> Result<(Bench<'s>, TempDir), Stop> {
    subject.kind(KIND)?;
    let texture = Texture::new(RATE_HZ, models, None)?;
    let (description, origin) = ("Made for a test.".to_owned(), "Made from poles.".to_owned());
    let file = TextureFile { description, origin, texture: texture.clone() };
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("models.ron");
    std::fs::write(&path, file.to_ron()?).expect("a file");
    let mut graph = GraphFile::empty("the test");
    let text = format!("{KIND}(model: {:?}, gain: 1)", path.display().to_string());
    graph.add_node("it", KIND, &[("models", &format!("{:?}", [text]))], "the test")?;
    let node = graph.nodes.pop().expect("the node");
    Ok((Bench::new(subject, node, [500, AUDIO_HZ], vec![vec![Voice { texture, gain: 1.0 }]]), dir))
}

/// Coefficients of poles `radius e^+-i angle`, by radius and frequency \[Hz\].
fn poles(all: &[(f64, f64)]) -> Vec<f64> {
    let mut a = vec![1.0];
    for &(radius, hz) in all {
        let pair = [1.0, -2.0 * radius * (TAU * hz / RATE_HZ).cos(), radius * radius];
        let mut product = vec![0.0; a.len() + 2];
        for (i, x) in a.iter().enumerate() {
            for (j, y) in pair.iter().enumerate() {
                product[i + j] += x * y;
            }
        }
        a = product;
    }
    a.split_off(1)
}

/// A model with these coefficients and an rms of `rms` m/s^2.
fn model(ar: Vec<f64>, rms: f64, [speed_mm_s, force_n]: [f64; 2]) -> Model {
    let unit = square(&Filter::new(&ar, &[], 1.0));
    Model { ar, ma: Vec::new(), variance: rms * rms / unit, gain: 1.0, speed_mm_s, force_n }
}

/// Random number from 0 to 1.
fn unit(of: u64) -> f64 {
    (random::bits(31, of) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Runs a bench at a place. Answers by how much its level is off \[dB\].
///
/// # Errors
/// It is off by more than `most`.
fn level(heard: &mut Heard, seconds: f64, wanted: f64, most: f64, place: &str) -> Result<f64, Stop> {
    let off = decibels(heard.square(seconds)?, wanted);
    ensure!(off.abs() <= most, "{place} the level is {off:+.1} dB off");
    Ok(off.abs())
}

/// Checks that a bench is silent, and that no sample was denormal.
fn silent(heard: &mut Heard, when: &str) -> Result<(), Stop> {
    let rest = heard.square(1.0)?;
    ensure!(rest == 0.0, "not silent {when}: {:.1e} m/s^2", rest.sqrt());
    ensure!(heard.denormals == 0, "{} samples are denormal", heard.denormals);
    Ok(())
}

/// Two models between which mixtures of coefficients are unstable. Everywhere on the edge that joins them
/// the level is that of the mixture of line spectral frequencies in closed form, within 1.5 dB.
fn unstable_edges_hold(subject: &Subject<'_>) -> Found {
    // Sharp resonances that lie apart: their coefficients' mean has roots beyond the unit circle.
    let one = poles(&[50.0, 120.0, 190.0, 260.0].map(|hz| (0.98, hz)));
    let other = poles(&[90.0, 170.0, 330.0, 400.0].map(|hz| (0.98, hz)));
    let part = |i: u32| f64::from(i) / 8.0;
    let mixed = |x: &[f64], y: &[f64], w: f64| -> Vec<f64> {
        x.iter().zip(y).map(|(x, y)| x + w * (y - x)).collect()
    };
    let unstable = (1..8).filter(|i| !is_stable(&mixed(&one, &other, part(*i)))).count();
    ensure!(unstable > 0, "the models of this case are not hard");
    let [from, to] = [&one, &other].map(|ar| line_spectrum::from_polynomial(ar).expect("a stable model"));
    let models = vec![model(one, 1.0, [50.0, 1.0]), model(other, 1.0, [250.0, 1.0])];
    let variance = |w: f64| models[0].variance + w * (models[1].variance - models[0].variance);
    let (bench, _file) = made(subject, models.clone())?;
    let seconds = subject.by_effort(10.0, 20.0, 600.0);
    let (mut worst, mut loudest) = (0.0_f64, 0.0_f64);
    for w in (0..=8).map(part) {
        let mut ar = vec![0.0; from.len()];
        line_spectrum::to_polynomial(&mixed(&from, &to, w), &mut ar);
        let wanted = square(&Filter::new(&ar, &[], variance(w).sqrt()));
        let mut heard = bench.begin(0, stay([50.0 + 200.0 * w, 1.0]))?;
        heard.square(1.0)?;
        worst = worst.max(level(&mut heard, seconds, wanted, 1.5, &format!("at {w} of the edge"))?);
        loudest = loudest.max(wanted.sqrt());
    }
    Ok(format!(
        "mixtures of coefficients are unstable at {unstable} of 7 places; levels are within {worst:.2} \
         dB; the loudest place has {loudest:.2} m/s^2, the models 1"
    ))
}

/// One and eight pairs of poles of radius 0.999 at 1 kHz, at rest for minutes and then let go. The level is
/// that of the closed form within 1.5 dB. Let go, it falls by 60 dB in 7 s (0.999^n) and to exact silence
/// within 80 s, without a denormal sample.
fn poles_at_0_999_hold(subject: &Subject<'_>) -> Found {
    let eight: Vec<(f64, f64)> = (0..8).map(|i| (0.999, 40.0 + 50.0 * f64::from(i))).collect();
    let seconds = subject.by_effort(100.0, 300.0, 3600.0);
    let silence = silent_after(0.999, RATE_HZ, 1.0);
    let mut worst = 0.0_f64;
    for of in [&eight[2..3], &eight[..]] {
        let (bench, _file) = made(subject, vec![model(poles(of), 1.0, [100.0, 1.0])])?;
        let end = (seconds + 10.0) * f64::from(bench.hz[0]);
        let mut heard = bench.begin(0, move |tick| [if (tick as f64) < end { 100.0 } else { 0.0 }, 1.0])?;
        heard.square(10.0)?;
        let pairs = format!("{} pairs:", of.len());
        worst = worst.max(level(&mut heard, seconds, 1.0, 1.5, &pairs)?);
        // 0.999^7000 is -60.8 dB; what was there when it was let go may have been 8 dB louder than the mean.
        heard.square(7.0)?;
        let left = decibels(heard.square(0.1)?, 1.0);
        ensure!(left < -50.0, "{pairs} 7 s after it was let go there is {left:.0} dB left");
        heard.square(silence - 7.1)?;
        silent(&mut heard, &format!("{silence:.0} s after it was let go, {pairs}"))?;
    }
    Ok(format!("levels are within {worst:.2} dB; silent {silence:.0} s after they are let go"))
}

/// Models without variance beside one that sounds, and ways between them. The silent ones give zeros. On the
/// way the level is that of the mixed variance within 1.5 dB. The signal dies away to 0 within the time of
/// its poles.
fn zero_variance_hold(subject: &Subject<'_>) -> Found {
    let ar = poles(&[(0.95, 80.0), (0.95, 220.0)]);
    let at = |speed: f64, force: f64, rms: f64| model(ar.clone(), rms, [speed, force]);
    let models = vec![at(20.0, 0.2, 0.0), at(220.0, 0.2, 0.0), at(20.0, 2.2, 0.0), at(220.0, 2.2, 1.0)];
    let (bench, _file) = made(subject, models.clone())?;
    for m in models.iter().filter(|m| m.variance == 0.0) {
        silent(&mut bench.begin(0, stay([m.speed_mm_s, m.force_n]))?, "at a model without variance")?;
    }
    // On the edge to a silent one the variance is mixed linearly.
    let seconds = subject.by_effort(5.0, 20.0, 600.0);
    let mut worst = 0.0_f64;
    for part in [0.1, 0.5, 0.9] {
        let mut heard = bench.begin(0, stay([20.0 + 200.0 * part, 2.2]))?;
        heard.square(1.0)?;
        let place = format!("{part} of the way to the one that sounds");
        worst = worst.max(level(&mut heard, seconds, part, 1.5, &place)?);
    }
    let silence = silent_after(radius(&ar), RATE_HZ, 1.0);
    let mut heard = bench.begin(0, |tick| if tick < 1000 { [220.0, 2.2] } else { [20.0, 0.2] })?;
    ensure!(heard.square(2.0)? > 0.1, "nothing sounds on the way to a silent model");
    heard.square(silence)?;
    silent(&mut heard, &format!("{silence:.1} s after the way to a silent model"))?;
    Ok(format!("levels between are within {worst:.2} dB; what sounded is gone within {silence:.1} s"))
}

/// Speed and force jump across all triangles in every tick, at 100, 500 and 1000 Hz, between 20 models all
/// over the plane with poles of radius 0.98 to 0.999. The rms is at most 1.15 times that of the loudest
/// place, since rotations keep lengths. No sample is beyond 7 times it.
fn fast_walks_hold(subject: &Subject<'_>) -> Found {
    let scattered = |i: u64| {
        let number = |k: u64| unit(100 * i + k);
        let pairs: Vec<(f64, f64)> =
            (0..4).zip([0.98, 0.99, 0.995, 0.999]).map(|(j, r)| (r, 30.0 + 380.0 * number(j))).collect();
        let at =
            [20.0 + 60.0 * (i / 4) as f64 + 5.0 * number(8), 0.3 + 0.9 * (i % 4) as f64 + 0.1 * number(9)];
        model(poles(&pairs), 0.2 + number(10), at)
    };
    let models: Vec<Model> = (0..20).map(scattered).collect();
    let seconds = subject.by_effort(10.0, 30.0, 600.0);
    let turns =
        |one: [f64; 2], other: [f64; 2]| -> Way { Arc::new(move |k| if k % 2 == 0 { one } else { other }) };
    let anywhere: Way = Arc::new(|k| [1.0 + 330.0 * unit(2 * k), 0.1 + 3.2 * unit(2 * k + 1)]);
    let ways = [
        ("anywhere", anywhere),
        ("between two corners", turns([20.0, 0.3], [300.0, 3.0])),
        ("between two forces", turns([200.0, 0.3], [200.0, 3.0])),
    ];
    let mut worst = [0.0_f64; 2];
    for tick_hz in [100, 500, 1000] {
        let (mut bench, _file) = made(subject, models.clone())?;
        bench.hz[0] = tick_hz;
        for (name, way) in &ways {
            let (rms, peak) = across(&bench, 0, way, seconds, 1.15, 7.0)
                .map_err(|e| e.after(&format!("{name}, {tick_hz} times a second")))?;
            worst = [worst[0].max(rms), worst[1].max(peak)];
        }
    }
    let [rms, peak] = worst;
    Ok(format!(
        "at most {rms:.2} times the root mean square of the loudest place, samples of {peak:.1} times it"
    ))
}

/// Ten minutes at every vertex of 12 models (a minute with effort `Full`). The level is that of the vertex's
/// own model within 1 dB, in each third of the time.
fn every_vertex_hold(subject: &Subject<'_>) -> Found {
    let of = |i: u64| {
        let pairs: Vec<(f64, f64)> = (0..3).map(|j| (0.97, 30.0 + 380.0 * unit(100 * i + j + 50))).collect();
        let at = [30.0 + 80.0 * (i / 3) as f64 + 3.0 * unit(i), 0.4 + (i % 3) as f64];
        model(poles(&pairs), 0.1 + unit(i), at)
    };
    let models: Vec<Model> = (0..12).map(of).collect();
    let (bench, _file) = made(subject, models.clone())?;
    let third = subject.by_effort(5.0, 20.0, 200.0);
    let mut worst = 0.0_f64;
    for (i, m) in models.iter().enumerate() {
        let mut heard = bench.begin(0, stay([m.speed_mm_s, m.force_n]))?;
        heard.square(0.5)?;
        for when in ["first", "second", "last"] {
            // Four deviations of the draw, where there is little time.
            let limit = (4.3 * 4.0 * draw(&m.filter(), RATE_HZ, third)).max(1.0);
            let place = format!("vertex {i} in the {when} third:");
            worst = worst.max(level(&mut heard, third, square(&m.filter()), limit, &place)?);
        }
    }
    Ok(format!("levels at {} vertices for {:.0} s each are within {worst:.2} dB", models.len(), 3.0 * third))
}

#[test]
fn unstable_edges() {
    passes("unstable_edges", unstable_edges_hold, &subject(None));
    breaks("unstable_edges", unstable_edges_hold, &recursion(by_coefficients), "of the edge the level is");
}

/// A case holds, and fails for textures whose samples are changed by the number of the tick.
fn holds_but_for(name: &str, case: fn(&Subject<'_>) -> Found, mutants: &[(fn(f32, u64) -> f32, &str)]) {
    let subject = subject(None);
    passes(name, case, &subject);
    for &(change, why) in mutants {
        let mutant =
            sounding(&subject, KIND, move |out, tick| out.iter_mut().for_each(|x| *x = change(*x, tick)));
        breaks(name, case, &mutant, why);
    }
}

/// Something of the signal stays for ever; and it is too loud.
#[test]
fn poles_at_0_999() {
    let case = poles_at_0_999_hold;
    holds_but_for("poles", case, &[(|x, _| x + 1e-12, "not silent"), (|x, _| 1.3 * x, "the level is")]);
}

#[test]
fn zero_variance() {
    let hum = |x, tick| x + 1e-9 * (tick % 2) as f32;
    holds_but_for("zero variance", zero_variance_hold, &[(hum, "at a model without variance")]);
}

/// As the kind did before: each filter on the way is stable, and the walk is not.
#[test]
fn fast_walks() {
    passes("fast_walks", fast_walks_hold, &subject(None));
    let walks = recursion(|texture, speed, force| texture.at(speed, force));
    breaks("fast_walks", fast_walks_hold, &walks, "times a second: ");
}

/// A level that creeps: 2 dB in a quarter of a minute.
#[test]
fn every_vertex() {
    let creeps = |x, tick| x * (1.0 + (tick as f32 / 30_000.0).min(1.0));
    holds_but_for("every vertex", every_vertex_hold, &[(creeps, "third")]);
}

#[test]
fn own_models() {
    let every = graph("scenes/every_effect.ron");
    let with_models = subject(Some(&every));
    holds("own_models", &with_models);
    let loud = sounding(&with_models, KIND, |out, _| out.iter_mut().for_each(|x| *x *= 2.0));
    fails("own_models", &loud, "the level is");
    let without = graph("texture.ron");
    assert!(matches!(run("own_models", &subject(Some(&without))), Err(Stop::NotApplicable(_))));
}
