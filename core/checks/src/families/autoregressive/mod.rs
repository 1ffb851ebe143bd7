//! Textures of autoregressive models: what lies between models that are hard to mix, and what becomes of a signal that is driven through them.

mod bench;

use std::sync::Arc;

use asperity_autoregressive::{Filter, Model, is_stable, line_spectrum};
use asperity_node::random;

use crate::case::{Case, Family, Found, Not, holds, not_applicable};
use crate::subject::{Effort, Subject};
use bench::{
    Bench, RATE_HZ, Voice, Way, decibels, draw, model, part_below, poles, radius, silent_after, square,
};

pub(super) const CASES: &[Case] = &[
    Case {
        family: Family::Autoregressive,
        name: "unstable_edges",
        hard: "two models between which a mixture of coefficients is unstable, and all places on the edge that joins them",
        must: "everywhere on it the level is that of the mixture of line spectral frequencies in closed form, within 1.5 dB",
        of_graph: false,
        run: unstable_edges,
    },
    Case {
        family: Family::Autoregressive,
        name: "poles_at_0_999",
        hard: "models of one and of eight pairs of poles of radius 0.999 at 1 kHz, at rest for minutes and then let go",
        must: "the level is that of the closed form within 1.5 dB; let go it falls by 60 dB in 7 s (0.999^n), to exact silence within 80 s, and no sample is denormal",
        of_graph: false,
        run: sharp_poles,
    },
    Case {
        family: Family::Autoregressive,
        name: "zero_variance",
        hard: "models without variance beside one that sounds, and ways between them",
        must: "at the silent ones every sample is 0; on the way the level is that of the mixed variance within 1.5 dB; what sounded dies away to 0 within the time of its poles",
        of_graph: false,
        run: zero_variance,
    },
    Case {
        family: Family::Autoregressive,
        name: "fast_walks",
        hard: "speed and force jump across all triangles in every tick, at 100, 500 and 1000 ticks a second, between 20 models with poles of radius 0.98 to 0.999",
        must: "the root mean square is at most 1.15 times that of the loudest place (rotations keep lengths, so its deviation never is above that), no sample is beyond 7 times it",
        of_graph: false,
        run: fast_walks,
    },
    Case {
        family: Family::Autoregressive,
        name: "every_vertex",
        hard: "ten minutes at every vertex of a triangulation of 12 models; a minute in `cargo test`, and 15 s in `selftest` unless it is told to take its time",
        must: "the level is that of the vertex's own model in closed form within 1 dB, in the first third of the time as in the last",
        of_graph: false,
        run: every_vertex,
    },
    Case {
        family: Family::Autoregressive,
        name: "own_models",
        hard: "the graph's own textures at every vertex, driven across all of them in every tick, and let go",
        must: "levels are those of the closed forms within 1.5 dB and the luck of the draw, or less by what lies above half the models' rate; across them never above 1.3 times \
               the loudest place; let go they are silent within the time of their poles, and no sample is denormal",
        of_graph: true,
        run: own_models,
    },
];

/// A speed and a force that stay.
fn stay(at: [f64; 2]) -> impl Fn(u64) -> [f64; 2] + Send + Sync + Clone {
    move |_| at
}

/// A number from 0 to 1 by a number.
fn unit(of: u64) -> f64 {
    (random::bits(31, of) >> 11) as f64 / (1_u64 << 53) as f64
}

fn unstable_edges(subject: &Subject<'_>) -> Found {
    // Sharp resonances that lie apart: their coefficients' mean has roots beyond the unit circle.
    let one = poles(&[(0.98, 50.0), (0.98, 120.0), (0.98, 190.0), (0.98, 260.0)]);
    let other = poles(&[(0.98, 90.0), (0.98, 170.0), (0.98, 330.0), (0.98, 400.0)]);
    let part = |i: u32| f64::from(i) / 8.0;
    let mixed = |x: &[f64], y: &[f64], w: f64| -> Vec<f64> {
        x.iter().zip(y).map(|(x, y)| x + w * (y - x)).collect()
    };
    let unstable = (1..8).filter(|i| !is_stable(&mixed(&one, &other, part(*i)))).count();
    holds(unstable > 0, || "the models of this case are not hard".to_owned())?;
    let lines = |ar: &[f64]| {
        line_spectrum::from_polynomial(ar)
            .ok_or_else(|| Not::Held("a model of this case is unstable".to_owned()))
    };
    let (from, to) = (lines(&one)?, lines(&other)?);
    let models = vec![model(one, 1.0, [50.0, 1.0]), model(other, 1.0, [250.0, 1.0])];
    let variance = |w: f64| models[0].variance + w * (models[1].variance - models[0].variance);
    let bench = Bench::made(subject, models.clone())?;
    let seconds = subject.by_effort(10.0, 30.0, 600.0);
    let (mut worst, mut loudest) = (0.0_f64, 0.0_f64);
    for i in 0..=8 {
        let w = part(i);
        let mut ar = vec![0.0; from.len()];
        line_spectrum::to_polynomial(&mixed(&from, &to, w), &mut ar);
        let wanted = square(&Filter::new(&ar, &[], variance(w).sqrt()));
        let mut heard = bench.begin(0, stay([50.0 + 200.0 * w, 1.0]))?;
        heard.square(1.0)?;
        let off = decibels(heard.square(seconds)?, wanted);
        holds(off.abs() <= 1.5, || format!("at {w} of the edge the level is {off:+.1} dB off"))?;
        (worst, loudest) = (worst.max(off.abs()), loudest.max(wanted.sqrt()));
    }
    Ok(format!(
        "mixtures of coefficients are unstable at {unstable} of 7 places; levels are within {worst:.2} dB; the loudest place has {loudest:.2} m/s^2, the models 1"
    ))
}

fn sharp_poles(subject: &Subject<'_>) -> Found {
    let eight: Vec<(f64, f64)> = (0..8).map(|i| (0.999, 40.0 + 50.0 * f64::from(i))).collect();
    let seconds = subject.by_effort(100.0, 300.0, 3600.0);
    let mut worst = 0.0_f64;
    let mut last = 0.0_f64;
    for of in [&eight[2..3], &eight[..]] {
        let bench = Bench::made(subject, vec![model(poles(of), 1.0, [100.0, 1.0])])?;
        let end = (seconds + 10.0) * f64::from(bench.tick_hz());
        let mut heard = bench.begin(0, move |tick| [if (tick as f64) < end { 100.0 } else { 0.0 }, 1.0])?;
        heard.square(10.0)?;
        let off = decibels(heard.square(seconds)?, 1.0);
        holds(off.abs() <= 1.5, || format!("{} pairs: the level is {off:+.1} dB off", of.len()))?;
        worst = worst.max(off.abs());
        // 0.999^7000 is -60.8 dB; what was there when it was let go may have been 8 dB louder than the mean.
        heard.square(7.0)?;
        let left = decibels(heard.square(0.1)?, 1.0);
        holds(left < -50.0, || {
            format!("{} pairs: 7 s after it was let go there is {left:.0} dB left", of.len())
        })?;
        let silence = silent_after(0.999, RATE_HZ, 1.0);
        heard.square(silence - 7.1)?;
        let rest = heard.square(1.0)?;
        holds(rest == 0.0, || {
            format!(
                "{} pairs: not silent {silence:.0} s after it was let go: {:.1e} m/s^2",
                of.len(),
                rest.sqrt()
            )
        })?;
        holds(heard.denormals == 0, || format!("{} samples are denormal", heard.denormals))?;
        last = silence;
    }
    Ok(format!("levels are within {worst:.2} dB; silent {last:.0} s after they are let go"))
}

fn zero_variance(subject: &Subject<'_>) -> Found {
    let ar = poles(&[(0.95, 80.0), (0.95, 220.0)]);
    let at = |speed: f64, force: f64, rms: f64| model(ar.clone(), rms, [speed, force]);
    let models = vec![at(20.0, 0.2, 0.0), at(220.0, 0.2, 0.0), at(20.0, 2.2, 0.0), at(220.0, 2.2, 1.0)];
    let bench = Bench::made(subject, models.clone())?;
    for m in models.iter().filter(|m| m.variance == 0.0) {
        let mut heard = bench.begin(0, stay([m.speed_mm_s, m.force_n]))?;
        let square = heard.square(2.0)?;
        holds(square == 0.0, || format!("{:.1e} m/s^2 at a model without variance", square.sqrt()))?;
    }
    // On the edge to a silent one the variance is mixed linearly.
    let seconds = subject.by_effort(5.0, 20.0, 600.0);
    let mut worst = 0.0_f64;
    for part in [0.1, 0.5, 0.9] {
        let mut heard = bench.begin(0, stay([20.0 + 200.0 * part, 2.2]))?;
        heard.square(1.0)?;
        let off = decibels(heard.square(seconds)?, part);
        holds(off.abs() <= 1.5, || {
            format!("{part} of the way to the one that sounds the level is {off:+.1} dB off")
        })?;
        worst = worst.max(off.abs());
    }
    let silence = silent_after(radius(&ar), RATE_HZ, 1.0);
    let mut heard = bench.begin(0, |tick| if tick < 1000 { [220.0, 2.2] } else { [20.0, 0.2] })?;
    let sounded = heard.square(2.0)?;
    heard.square(silence)?;
    let rest = heard.square(1.0)?;
    holds(sounded > 0.1 && rest == 0.0, || {
        format!("{:.1e} m/s^2 is left {silence:.1} s after the way to a silent model", rest.sqrt())
    })?;
    holds(heard.denormals == 0, || format!("{} samples are denormal", heard.denormals))?;
    Ok(format!("levels between are within {worst:.2} dB; what sounded is gone within {silence:.1} s"))
}

/// Models all over the plane, with four resonances each that lie anywhere.
fn scattered() -> Vec<Model> {
    let of = |i: u64| {
        let number = |k: u64| unit(100 * i + k);
        let pairs: Vec<(f64, f64)> =
            (0..4).map(|j| ([0.98, 0.99, 0.995, 0.999][j as usize], 30.0 + 380.0 * number(j))).collect();
        let at =
            [20.0 + 60.0 * (i / 4) as f64 + 5.0 * number(8), 0.3 + 0.9 * (i % 4) as f64 + 0.1 * number(9)];
        model(poles(&pairs), 0.2 + number(10), at)
    };
    (0..20).map(of).collect()
}

fn fast_walks(subject: &Subject<'_>) -> Found {
    let models = scattered();
    let seconds = subject.by_effort(10.0, 60.0, 600.0);
    let anywhere: Way = Arc::new(|k| [1.0 + 330.0 * unit(2 * k), 0.1 + 3.2 * unit(2 * k + 1)]);
    let corners: Way = Arc::new(|k| if k % 2 == 0 { [20.0, 0.3] } else { [300.0, 3.0] });
    let forces: Way = Arc::new(|k| if k % 2 == 0 { [200.0, 0.3] } else { [200.0, 3.0] });
    let mut worst = [0.0_f64; 2];
    for tick_hz in [100, 500, 1000] {
        let bench = Bench::made(subject, models.clone())?.at_ticks(tick_hz);
        for (name, way) in
            [("anywhere", &anywhere), ("between two corners", &corners), ("between two forces", &forces)]
        {
            let (rms, peak) = across(&bench, 0, way, seconds, 1.15, 7.0)
                .map_err(|e| e.after(&format!("{name}, {tick_hz} times a second")))?;
            worst = [worst[0].max(rms), worst[1].max(peak)];
        }
    }
    Ok(format!(
        "at most {:.2} times the root mean square of the loudest place, samples of {:.1} times it",
        worst[0], worst[1]
    ))
}

/// The mean square at a place, of all voices of a slot.
fn closed_form(voices: &[Voice], at: [f64; 2]) -> f64 {
    voices.iter().map(|v| v.gain.powi(2) * square(&v.texture.at(at[0], at[1]))).sum()
}

/// Drives a slot along a way: how often the root mean square of the loudest place on it is reached in the mean, and by a sample.
fn across(
    bench: &Bench<'_>,
    slot: usize,
    way: &Way,
    seconds: f64,
    most: f64,
    farthest: f64,
) -> Result<(f64, f64), Not> {
    let Some(voices) = bench.slots.get(slot) else { return not_applicable("no such slot") };
    let ticks = (seconds * f64::from(bench.tick_hz())) as u64;
    // The loudest of the first places: those of a walk without an end come as near to it as one likes.
    let places = (0..ticks.min(3000)).map(|k| closed_form(voices, way(k)));
    let loudest = places.fold(0.0, f64::max).sqrt();
    if loudest == 0.0 {
        return Ok((0.0, 0.0));
    }
    let moved = way.clone();
    let mut heard = bench.begin(slot, move |tick| moved(tick))?;
    let rms = heard.square(seconds)?.sqrt() / loudest;
    let peak = heard.largest / loudest;
    holds(rms <= most, || format!("{rms:.3e} times the root mean square of the loudest place"))?;
    holds(peak <= farthest, || {
        format!("a sample of {peak:.3e} times the root mean square of the loudest place")
    })?;
    Ok((rms, peak))
}

fn every_vertex(subject: &Subject<'_>) -> Found {
    let of = |i: u64| {
        let pairs: Vec<(f64, f64)> = (0..3).map(|j| (0.97, 30.0 + 380.0 * unit(100 * i + j + 50))).collect();
        model(
            poles(&pairs),
            0.1 + unit(i),
            [30.0 + 80.0 * (i / 3) as f64 + 3.0 * unit(i), 0.4 + (i % 3) as f64],
        )
    };
    let models: Vec<Model> = (0..12).map(of).collect();
    let bench = Bench::made(subject, models.clone())?;
    let third = subject.by_effort(5.0, 20.0, 200.0);
    let mut worst = 0.0_f64;
    for (i, m) in models.iter().enumerate() {
        let mut heard = bench.begin(0, stay([m.speed_mm_s, m.force_n]))?;
        heard.square(0.5)?;
        for when in ["first", "second", "last"] {
            let off = decibels(heard.square(third)?, square(&m.filter()));
            // Four deviations of the draw, where there is little time.
            let limit = (4.3 * 4.0 * draw(&m.filter(), RATE_HZ, third)).max(1.0);
            holds(off.abs() <= limit, || {
                format!("vertex {i}: the level is {off:+.1} dB off in the {when} third")
            })?;
            worst = worst.max(off.abs());
        }
    }
    Ok(format!("levels at {} vertices for {:.0} s each are within {worst:.2} dB", models.len(), 3.0 * third))
}

fn own_models(subject: &Subject<'_>) -> Found {
    let benches = Bench::of_graph(subject)?;
    if benches.iter().all(|b| b.slots.is_empty()) {
        return not_applicable("no node of this graph renders autoregressive models");
    }
    let seconds = subject.by_effort(4.0, 10.0, 600.0);
    let most = subject.by_effort(2, 8, usize::MAX);
    let (mut worst, mut across_all, mut vertices, mut slots) = (0.0_f64, 0.0_f64, 0, 0);
    for bench in &benches {
        for (slot, voices) in bench.slots.iter().enumerate().take(most) {
            slots += 1;
            let at: Vec<[f64; 2]> = voices
                .iter()
                .flat_map(|v| v.texture.models().iter().map(|m| [m.speed_mm_s, m.force_n]))
                .filter(|at| at[0] > 0.0 && at[1] > 0.0)
                .collect();
            let step = if subject.allowed() == Effort::Long { 1 } else { at.len().div_ceil(6).max(1) };
            for at in at.iter().step_by(step) {
                worst = worst.max(at_vertex(bench, slot, voices, *at, seconds)?);
                vertices += 1;
            }
            let corners = at.clone();
            let way: Way = Arc::new(move |tick| {
                let count = corners.len().max(1);
                corners.get(random::bits(7, tick) as usize % count).copied().unwrap_or([100.0, 1.0])
            });
            let (rms, _) = across(bench, slot, &way, seconds, 1.3, 9.0)
                .map_err(|e| e.after(&format!("slot {slot}, across all models")))?;
            across_all = across_all.max(rms);
            let_go(bench, slot, voices, &at)?;
        }
    }
    Ok(format!(
        "{slots} slots: levels at {vertices} vertices are within {worst:.2} dB, across them {across_all:.2} times the loudest place at most"
    ))
}

/// How far off the level at a vertex is, in dB.
fn at_vertex(
    bench: &Bench<'_>,
    slot: usize,
    voices: &[Voice],
    at: [f64; 2],
    seconds: f64,
) -> Result<f64, Not> {
    let wanted = closed_form(voices, at);
    let mut heard = bench.begin(slot, stay(at))?;
    heard.square(1.0)?;
    let found = heard.square(seconds)?;
    let say = |off: f64| {
        format!("slot {slot} at {:.0} mm/s and {:.2} N: the level is {off:+.1} dB off", at[0], at[1])
    };
    if wanted == 0.0 {
        holds(found == 0.0, || say(f64::INFINITY))?;
        return Ok(0.0);
    }
    // Below 0.4 of a model's rate all of it is heard, above nothing has to be.
    let filter = |v: &Voice| v.texture.at(at[0], at[1]);
    let draws = voices.iter().map(|v| draw(&filter(v), v.texture.rate_hz(), seconds)).fold(0.0, f64::max);
    let parts = voices.iter().map(|v| part_below(&filter(v), v.texture.rate_hz(), 0.4 * v.texture.rate_hz()));
    let least = parts.fold(1.0, f64::min).max(1e-6);
    let (off, room) = (decibels(found, wanted), 1.5 + 4.3 * 4.0 * draws);
    holds(off <= room && off >= decibels(least, 1.0) - room, || say(off))?;
    Ok(off.abs())
}

/// What sounded dies away.
fn let_go(bench: &Bench<'_>, slot: usize, voices: &[Voice], at: &[[f64; 2]]) -> Result<(), Not> {
    let loudest = at.iter().max_by(|a, b| closed_form(voices, **a).total_cmp(&closed_form(voices, **b)));
    let Some(&loud) = loudest else { return Ok(()) };
    // At no speed the nearest point of the hull answers.
    let end = |v: &Voice| {
        let rms = v.gain * square(&v.texture.at(loud[0], loud[1])).sqrt();
        silent_after(radius(v.texture.at(0.0, loud[1]).ar()), v.texture.rate_hz(), rms)
    };
    let silence = voices.iter().map(end).fold(1.0, f64::max);
    let hz = u64::from(bench.tick_hz());
    let mut heard = bench.begin(slot, move |tick| [if tick < hz { loud[0] } else { 0.0 }, loud[1]])?;
    heard.square(1.0 + silence)?;
    let rest = heard.square(0.5)?;
    holds(rest == 0.0, || {
        format!("slot {slot}: {:.1e} m/s^2 is left {silence:.1} s after it was let go", rest.sqrt())
    })?;
    holds(heard.denormals == 0, || format!("slot {slot}: {} samples are denormal", heard.denormals))
}
