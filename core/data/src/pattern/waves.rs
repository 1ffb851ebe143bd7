//! Waves: ridges whose vibration repeats with place.

use std::f64::consts::{PI, TAU};

use super::figures::spectrum;
use super::kernel;
use super::stroke::{Passage, RATE_HZ, TICK, TICK_S};
use asperity_dsp::shaped_noise::HARMONICS;
use asperity_texture::{Harmonic, MAX_HARMONICS, MAX_WAVES, Wave};
use num_complex::Complex64;

/// Least part of the power of a wave, summed over its pieces. In noise without direction the best wave
/// vector by chance has up to about 0.1.
const LEAST_PART: f64 = 0.25;
/// The same in one piece, if all pieces have the wave and there are at least this many: chance differs
/// from piece to piece.
const LEAST_IN_A_PIECE: f64 = 0.02;
const ENOUGH_PIECES: usize = 3;
/// Waves to find in a piece; some are chance.
const IN_A_PIECE: usize = 4;
/// Largest wave number in 1/mm: the finest weave has threads 0.33 mm apart.
const MOST_PER_MM: f64 = 3.5;
/// Grid of the search in 1/mm.
const STEP_PER_MM: f64 = 0.0125;
/// Way of a segment of the search in mm, and its least and longest time in s.
const WAY_MM: f64 = 40.0;
const SEGMENT_S: (f64, f64) = (0.2, 1.0);
/// Largest turn of a segment as a part of its way.
const STRAIGHT: f64 = 0.01;
/// End of the band in Hz.
const TOP_HZ: f64 = 1000.0;
/// Lines closer than this many bins of a segment are one.
const APART: f64 = 4.0;
/// Harmonics in the first search.
const FIRST: usize = 4;
/// Candidates for a closer look.
const CANDIDATES: usize = 24;
/// A harmonic explains nearly as much as its fundamental. The largest wave number with this part of the
/// best counts.
const NEARLY: f64 = 0.9;
/// Wave vectors of two pieces belong to one wave if they differ by less than this part.
const ALIKE: f64 = 0.12;
/// Pitches in a segment for share and phase.
const PITCHES: f64 = 10.0;
/// Pitches in a segment for the final wave vector: more make it more exact.
const MANY_PITCHES: f64 = 60.0;
/// If every second, third .. harmonic has this part of a wave's power, these are the wave.
const MULTIPLES: f64 = 0.8;
/// Largest weight of a harmonic.
const MOST_WEIGHT: f64 = 10.0;
/// Seconds of strokes to refine a wave vector.
const REFINED_S: f64 = 20.0;

/// Power over frequency of all straight ways of one velocity.
struct Seen {
    velocity: [f64; 2],
    /// Sum over segments of power over their whole power: a sine's power stands at its frequency.
    power: Vec<f64>,
    bin_hz: f64,
    seconds: f64,
    count: f64,
}

impl Seen {
    fn at(&self, hz: f64) -> f64 {
        let place = hz / self.bin_hz;
        let k = place as usize;
        let power = |k: usize| self.power.get(k).copied().unwrap_or(0.0);
        power(k) + place.fract() * (power(k + 1) - power(k))
    }

    /// Frequency of a wave vector. None if its harmonics are too close to separate.
    fn pitch_hz(&self, k: [f64; 2]) -> Option<f64> {
        let hz = (k[0] * self.velocity[0] + k[1] * self.velocity[1]).abs();
        (hz * self.seconds >= APART).then_some(hz)
    }

    /// Part of the power at harmonics of a wave vector, minus the power between them. None if they are
    /// too close to separate, or above the band.
    fn part(&self, k: [f64; 2], harmonics: usize) -> Option<f64> {
        let pitch_hz = self.pitch_hz(k).filter(|hz| *hz <= TOP_HZ)?;
        let count = ((TOP_HZ / pitch_hz) as usize).min(harmonics);
        let mut sum = 0.0;
        for h in 1..=count {
            let h = h as f64;
            sum +=
                self.at(h * pitch_hz) - 0.5 * (self.at((h - 0.5) * pitch_hz) + self.at((h + 0.5) * pitch_hz));
        }
        Some(sum / self.count)
    }

    /// Removes the lines of a wave.
    fn without(&mut self, k: [f64; 2]) {
        let Some(pitch_hz) = self.pitch_hz(k) else { return };
        let wide = 2.5 / self.seconds;
        for h in 1..=(TOP_HZ / pitch_hz) as usize {
            let hz = h as f64 * pitch_hz;
            let beside = 0.5 * (self.at(hz - 0.5 * pitch_hz) + self.at(hz + 0.5 * pitch_hz));
            let from = ((hz - wide) / self.bin_hz).max(0.0) as usize;
            let to = ((hz + wide) / self.bin_hz) as usize + 1;
            for power in self.power.iter_mut().take(to + 1).skip(from) {
                *power = power.min(beside);
            }
        }
    }
}

fn window(length: usize) -> Vec<f64> {
    (0..length).map(|n| 0.5 - 0.5 * (TAU * (n as f64 + 0.5) / length as f64).cos()).collect()
}

/// Spectra of the straight ways of a piece.
fn seen(passages: &[Passage]) -> Vec<Seen> {
    let mut all: Vec<Seen> = Vec::new();
    for p in passages {
        // One length for each class of speeds, so that their spectra can be added.
        let class = 1.25f64.powf((p.speed_mm_s.ln() / 1.25f64.ln()).round());
        let seconds = (WAY_MM / class).clamp(SEGMENT_S.0, SEGMENT_S.1);
        let ticks = (seconds / TICK_S).round() as usize;
        let length = ticks * TICK;
        let window = window(length);
        let (sum, squares) = (window.iter().sum::<f64>(), window.iter().map(|w| w * w).sum::<f64>());
        for from in (0..p.places.len().saturating_sub(ticks)).step_by(ticks / 2) {
            let (a, b, middle) = (p.places[from], p.places[from + ticks], p.places[from + ticks / 2]);
            let way: [f64; 2] = std::array::from_fn(|i| b[i] - a[i]);
            let off: [f64; 2] = std::array::from_fn(|i| middle[i] - 0.5 * (a[i] + b[i]));
            if off[0].hypot(off[1]) > STRAIGHT * way[0].hypot(way[1]) {
                continue;
            }
            let velocity = way.map(|w| w / seconds);
            let mut samples: Vec<f64> =
                p.samples[from * TICK..][..length].iter().zip(&window).map(|(x, w)| x * w).collect();
            let whole = samples.iter().map(|x| x * x).sum::<f64>() / squares;
            if whole.is_nan() || whole <= 1e-9 {
                continue;
            }
            samples.resize(4 * length, 0.0);
            let scale = 2.0 / (sum * sum * whole);
            let power = spectrum(&samples).into_iter().map(|c| c.norm_sqr() * scale);
            let near = |s: &Seen| {
                let apart = (s.velocity[0] - velocity[0]).hypot(s.velocity[1] - velocity[1]);
                s.seconds == seconds && apart < 0.002 * velocity[0].hypot(velocity[1])
            };
            match all.iter_mut().find(|s| near(s)) {
                Some(s) => {
                    s.power.iter_mut().zip(power).for_each(|(sum, p)| *sum += p);
                    s.count += 1.0;
                }
                None => {
                    let bin_hz = RATE_HZ / (4 * length) as f64;
                    all.push(Seen { velocity, power: power.collect(), bin_hz, seconds, count: 1.0 });
                }
            }
        }
    }
    all
}

/// Mean part of the power at a wave vector; 0 if too few ways can tell.
///
/// Roots are averaged: a wave shows in all directions, chance lines in some.
fn part(seen: &[Seen], k: [f64; 2], harmonics: usize) -> f64 {
    let (mut sum, mut told, mut all) = (0.0, 0.0, 0.0);
    for s in seen {
        let weight = s.count.sqrt();
        all += weight;
        if let Some(part) = s.part(k, harmonics) {
            sum += weight * part.max(0.0).sqrt();
            told += weight;
        }
    }
    if told < 0.5 * all || told == 0.0 { 0.0 } else { (sum / told).powi(2) }
}

/// The strongest wave of a piece: its vector and part of the power.
fn strongest(seen: &[Seen]) -> Option<([f64; 2], f64)> {
    let n = (MOST_PER_MM / STEP_PER_MM) as i32;
    let at = |i: i32, j: i32| [f64::from(i) * STEP_PER_MM, f64::from(j) * STEP_PER_MM];
    let height = |k: [f64; 2]| {
        let known = (APART / WAY_MM..=MOST_PER_MM).contains(&k[0].hypot(k[1]));
        if known { part(seen, k, FIRST) } else { 0.0 }
    };
    let map: Vec<Vec<f64>> = (0..=n).map(|j| (-n..=n).map(|i| height(at(i, j))).collect()).collect();
    let mut peaks: Vec<(f64, [f64; 2])> = Vec::new();
    for (j, row) in map.iter().enumerate() {
        let rows = &map[j.saturating_sub(1)..(j + 2).min(map.len())];
        for (i, beside) in row.windows(3).enumerate() {
            let here = beside[1];
            let top = rows.iter().all(|row| row[i..i + 3].iter().all(|power| *power <= here));
            if here > 0.5 * LEAST_IN_A_PIECE && top {
                peaks.push((here, at(i as i32 + 1 - n, j as i32)));
            }
        }
    }
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    peaks.truncate(CANDIDATES);
    let refined = |(_, k)| climb(k, 0.5 * STEP_PER_MM, 8, |k| part(seen, k, MAX_HARMONICS));
    let fine: Vec<([f64; 2], f64)> = peaks.into_iter().map(refined).collect();
    let most = fine.iter().map(|(_, part)| *part).fold(0.0, f64::max);
    let size = |k: [f64; 2]| k[0].hypot(k[1]);
    fine.into_iter()
        .filter(|(_, part)| *part >= LEAST_IN_A_PIECE.max(NEARLY * most))
        .max_by(|a, b| size(a.0).total_cmp(&size(b.0)))
}

/// The loudest harmonic of a weak wave and its part of the power. The others hardly show.
fn loudest(seen: &[Seen], k: [f64; 2]) -> ([f64; 2], f64) {
    let most = (MOST_PER_MM / k[0].hypot(k[1])) as u32;
    let harmonics = (1..=most).map(|h| k.map(|k| k * f64::from(h)));
    let best = harmonics.max_by(|a, b| part(seen, *a, 1).total_cmp(&part(seen, *b, 1)));
    climb(best.unwrap_or(k), 0.25 * STEP_PER_MM, 6, |k| part(seen, k, 1))
}

/// Climbs from a wave vector in ever smaller steps.
fn climb(mut k: [f64; 2], mut step: f64, halvings: u32, height: impl Fn([f64; 2]) -> f64) -> ([f64; 2], f64) {
    let mut here = height(k);
    for _ in 0..halvings {
        for _ in 0..4 {
            let before = here;
            for (dx, dy) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
                let next = [k[0] + dx * step, k[1] + dy * step];
                let found = height(next);
                if found > here {
                    (k, here) = (next, found);
                }
            }
            if here == before {
                break;
            }
        }
        step *= 0.5;
    }
    (k, here)
}

/// A segment of a stroke, demodulated by a wave.
struct Segment {
    /// Length, which is its weight.
    seconds: f64,
    pitch_hz: f64,
    backwards: bool,
    /// Complex amplitudes of harmonics.
    lines: Vec<Complex64>,
    /// Power of each harmonic that repeats, and all power around it, as parts of the segment's power.
    coherent: Vec<f64>,
    around: Vec<f64>,
}

/// Parts of a passage over enough pitches of a wave: first tick, and turns from tick to tick.
fn pieces_of(passage: &Passage, k: [f64; 2], pitches: f64) -> Vec<(usize, Vec<f64>)> {
    let turns: Vec<f64> = passage.places.iter().map(|p| k[0] * p[0] + k[1] * p[1]).collect();
    let (mut pieces, mut from) = (Vec::new(), 0);
    while let Some(to) = (from..turns.len()).find(|to| (turns[*to] - turns[from]).abs() >= pitches) {
        let ticks = to - from;
        if (10..=4000).contains(&ticks) {
            pieces.push((from, turns[from..=to].to_vec()));
        }
        from += (ticks / 2).max(1);
    }
    pieces
}

/// Removes the phases that the kernel adds to the lines of a passage's segments.
fn without_response(segments: &mut [Segment], passage: &Passage, weights: &[f64; HARMONICS]) {
    let Some(mut kernel) = kernel(0) else { return };
    kernel.push(0, &passage.magnitudes, 1.0);
    for s in segments {
        let mut phases = vec![Complex64::default(); s.lines.len()];
        kernel.ridge_phases(s.pitch_hz, weights, &mut phases);
        // The sign is opposite for a hand that moves backwards.
        let away = |phase: Complex64| if s.backwards { phase } else { phase.conj() };
        s.lines.iter_mut().zip(phases).for_each(|(line, phase)| *line *= away(phase));
    }
}

/// A part of a passage over some turns, under a window.
struct Cut {
    seen: Vec<f64>,
    sum: f64,
    squares: f64,
    whole: f64,
    pitch_hz: f64,
}

impl Cut {
    fn new(passage: &Passage, turns: &[f64], from: usize) -> Option<Self> {
        let length = (turns.len() - 1) * TICK;
        let samples = passage.samples.get(from * TICK..from * TICK + length)?;
        let window = window(length);
        let (sum, squares) = (window.iter().sum::<f64>(), window.iter().map(|w| w * w).sum::<f64>());
        let seen: Vec<f64> = samples.iter().zip(&window).map(|(x, w)| x * w).collect();
        let whole = seen.iter().map(|x| x * x).sum::<f64>() / squares;
        let pitch_hz = (turns[turns.len() - 1] - turns[0]).abs() / (length as f64 / RATE_HZ);
        (whole > 1e-9).then_some(Self { seen, sum, squares, whole, pitch_hz })
    }

    /// Harmonics in the band, at most `most`.
    fn count(&self, most: usize) -> usize {
        ((TOP_HZ / self.pitch_hz - 0.5) as usize).min(most)
    }

    /// Complex amplitudes of orders 1/2, 1, 3/2 and so on, to half an order above the last harmonic,
    /// over the root of the whole power.
    fn orders(&self, turns: &[f64], harmonics: usize) -> Vec<Complex64> {
        let mut amplitudes = vec![Complex64::default(); 2 * harmonics + 1];
        for (n, x) in self.seen.iter().enumerate() {
            let (tick, part) = (n / TICK, (n % TICK) as f64 / TICK as f64);
            let turn = turns[tick] + part * (turns[tick + 1] - turns[tick]);
            let half = Complex64::cis(-PI * turn);
            let mut turned = half * *x;
            for a in &mut amplitudes {
                *a += turned;
                turned *= half;
            }
        }
        let scale = 2.0 / (self.sum * self.whole.sqrt());
        amplitudes.iter_mut().for_each(|a| *a *= scale);
        amplitudes
    }
}

/// Power of harmonics minus the power between them.
fn coherent(orders: &[Complex64]) -> Vec<f64> {
    let power = |order: usize| 0.5 * orders[order - 1].norm_sqr();
    let harmonic = |h: usize| power(2 * h) - 0.5 * (power(2 * h - 1) + power(2 * h + 1));
    (1..=orders.len() / 2).map(harmonic).collect()
}

/// All segments of a passage.
fn segments(passage: &Passage, k: [f64; 2]) -> Vec<Segment> {
    let segment = |(from, turns): (usize, Vec<f64>)| {
        let cut = Cut::new(passage, &turns, from)?;
        let count = Some(cut.count(MAX_HARMONICS)).filter(|count| *count > 0)?;
        let orders = cut.orders(&turns, count);
        let bins = spectrum(&cut.seen);
        let bin_hz = RATE_HZ / cut.seen.len() as f64;
        let around = |h: usize| {
            let edge = |h: f64| ((h * cut.pitch_hz / bin_hz).round() as usize).min(bins.len());
            let bins = &bins[edge(h as f64 - 0.5)..edge(h as f64 + 0.5)];
            let power = 2.0 * bins.iter().map(Complex64::norm_sqr).sum::<f64>();
            power / (cut.seen.len() as f64 * cut.squares * cut.whole)
        };
        Some(Segment {
            seconds: cut.seen.len() as f64 / RATE_HZ,
            pitch_hz: cut.pitch_hz,
            backwards: turns[turns.len() - 1] < turns[0],
            lines: (0..count).map(|h| orders[2 * h + 1]).collect(),
            coherent: coherent(&orders),
            around: (1..=count).map(around).collect(),
        })
    };
    pieces_of(passage, k, PITCHES).into_iter().filter_map(segment).collect()
}

/// Sums the lines of all segments. Each is turned to its best fit, and its sign is free.
fn template(segments: &[Segment]) -> Vec<Complex64> {
    let size = |s: &Segment| s.seconds * s.coherent.iter().sum::<f64>();
    let Some(first) = segments.iter().max_by(|a, b| size(a).total_cmp(&size(b))) else { return Vec::new() };
    let mut template = first.lines.clone();
    template.resize(MAX_HARMONICS, Complex64::default());
    for _ in 0..12 {
        let mut sum = vec![Complex64::default(); MAX_HARMONICS];
        for s in segments {
            let turned = |turn: f64| {
                let step = Complex64::cis(-turn);
                let mut by = Complex64::new(1.0, 0.0);
                s.lines.iter().map(move |line| {
                    by *= step;
                    line * by
                })
            };
            let fit = |turn: f64| turned(turn).zip(&template).map(|(a, b)| (a * b.conj()).re).sum::<f64>();
            let turns = (0..192).map(|n| TAU * f64::from(n) / 192.0).map(|turn| (turn, fit(turn)));
            if let Some((turn, fit)) = turns.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())) {
                let weight = s.seconds * fit.signum();
                sum.iter_mut().zip(turned(turn)).for_each(|(sum, line)| *sum += line * weight);
            }
        }
        template = sum;
    }
    template
}

/// Finds the waves of a material from passages over pieces of it, and their part of the power.
pub(super) fn find(pieces: &[Vec<Passage>]) -> (Vec<Wave>, f64) {
    let mut found: Vec<Vec<([f64; 2], f64)>> = Vec::new();
    for passages in pieces {
        let mut seen = seen(passages);
        let mut here = Vec::new();
        while here.len() < IN_A_PIECE {
            let Some((k, part)) = strongest(&seen) else { break };
            let (k, part) = if part < LEAST_PART {
                loudest(&seen, k)
            } else {
                (refined(passages, fundamental(passages, refined(passages, k))), part)
            };
            seen.iter_mut().for_each(|s| s.without(k));
            here.push((k, part));
        }
        found.push(here);
    }
    let (mut waves, mut part) = (Vec::new(), 0.0);
    while waves.len() < MAX_WAVES {
        let strongest = found.iter().flatten().max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((like, _)) = strongest.copied() else { break };
        // A vector and its opposite are one wave. The longer component becomes positive.
        let longer = if like[0].abs() >= like[1].abs() { like[0] } else { like[1] };
        let like = like.map(|k| k * longer.signum());
        // The same wave in each piece.
        let turned = |k: [f64; 2]| k.map(|x| x * (k[0] * like[0] + k[1] * like[1]).signum());
        let apart = |k: [f64; 2]| (k[0] - like[0]).hypot(k[1] - like[1]);
        let near = |k: [f64; 2]| apart(turned(k)) < ALIKE * like[0].hypot(like[1]);
        let take = |here: &mut Vec<([f64; 2], f64)>| {
            let (k, part) = here.remove(here.iter().position(|(k, _)| near(*k))?);
            Some((turned(k), part))
        };
        let vectors: Vec<Option<([f64; 2], f64)>> = found.iter_mut().map(take).collect();
        let parts: f64 = vectors.iter().flatten().map(|(_, part)| part).sum();
        let pieces = pieces.iter().zip(&vectors).filter_map(|(passages, of)| of.map(|of| (passages, of.0)));
        let pieces: Vec<(&Vec<Passage>, [f64; 2])> = pieces.collect();
        let all = pieces.len() == vectors.len() && pieces.len() >= ENOUGH_PIECES;
        if all || (2 * pieces.len() > vectors.len() && parts >= LEAST_PART) {
            let (wave, of) = wave(&pieces);
            if !wave.harmonics.is_empty() {
                waves.push(wave);
                part += of;
            }
        }
    }
    (waves, part)
}

/// Passages of a few seconds in all, the short ones first: they go in many directions.
fn shortest(passages: &[Passage]) -> Vec<&Passage> {
    let mut sorted: Vec<&Passage> = passages.iter().collect();
    sorted.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    let mut left = REFINED_S;
    sorted.retain(|p| {
        left -= p.seconds;
        left > -p.seconds
    });
    sorted
}

/// The fundamental of a wave vector if nearly all power is in multiples of a harmonic: threads count,
/// not the weave's repeat.
fn fundamental(passages: &[Passage], k: [f64; 2]) -> [f64; 2] {
    let mut powers = [0.0; MAX_HARMONICS];
    for p in shortest(passages) {
        for (from, turns) in pieces_of(p, k, PITCHES) {
            let Some(cut) = Cut::new(p, &turns, from) else { continue };
            let found = coherent(&cut.orders(&turns, cut.count(MAX_HARMONICS)));
            powers.iter_mut().zip(found).for_each(|(sum, power)| *sum += power);
        }
    }
    let all: f64 = powers.iter().map(|p| p.max(0.0)).sum();
    let of = |m: &usize| powers.iter().skip(m - 1).step_by(*m).map(|p| p.max(0.0)).sum::<f64>();
    let m = (2..=6).rev().find(|m| all > 0.0 && of(m) >= MULTIPLES * all).unwrap_or(1) as f64;
    k.map(|k| m * k)
}

/// The wave vector with which segments at their true places have most power: first short ones, then
/// long ones. The segments stay fixed, else their number would decide.
fn refined(passages: &[Passage], k: [f64; 2]) -> [f64; 2] {
    let passages = shortest(passages);
    let best = |from: [f64; 2], step: f64, pitches: f64| {
        let of = |p| pieces_of(p, from, pitches).into_iter().map(move |(at, turns)| (p, at, turns.len()));
        let pieces: Vec<(&Passage, usize, usize)> = passages.iter().copied().flat_map(of).collect();
        let power = |k: [f64; 2]| {
            let of = |&(p, at, len): &(&Passage, usize, usize)| {
                let places = p.places.get(at..at + len)?;
                let turns: Vec<f64> = places.iter().map(|p| k[0] * p[0] + k[1] * p[1]).collect();
                let cut = Cut::new(p, &turns, at)?;
                Some(coherent(&cut.orders(&turns, cut.count(FIRST))).iter().sum::<f64>())
            };
            pieces.iter().filter_map(of).sum::<f64>()
        };
        climb(from, step, 4, power).0
    };
    best(best(k, 0.002, PITCHES), 0.0005, MANY_PITCHES)
}

/// The turn of the fundamental with which phases differ least between harmonics. Harmonics above the
/// last count as the last.
fn origin(lines: &[Complex64]) -> f64 {
    let pairs = lines.windows(2).map(|pair| {
        let product = pair[1] * pair[0].conj();
        if product.norm() > 0.0 { product / product.norm().sqrt() } else { product }
    });
    pairs.sum::<Complex64>().arg()
}

/// Power around each harmonic over the kernel's power for the passage's magnitudes without weights. For
/// each segment both are parts of all its harmonics.
fn weights(found: &[(&Passage, Vec<Segment>)]) -> [f64; HARMONICS] {
    let (mut power, mut plain) = ([0.0; HARMONICS], [0.0; HARMONICS]);
    let Some(mut kernel) = kernel(0) else { return [1.0; HARMONICS] };
    for (passage, segments) in found {
        kernel.push(0, &passage.magnitudes, 1.0);
        for s in segments {
            let mut without = vec![0.0; s.around.len()];
            kernel.ridge_powers(s.pitch_hz, &mut without);
            if [&without, &s.around].iter().any(|powers| powers.iter().sum::<f64>() <= 0.0) {
                continue;
            }
            let add = |to: &mut [f64; HARMONICS], powers: &[f64]| {
                let all = powers.iter().sum::<f64>();
                to.iter_mut().zip(powers).for_each(|(to, power)| *to += s.seconds * power / all);
            };
            add(&mut power, &s.around);
            add(&mut plain, &without);
        }
    }
    std::array::from_fn(|h| {
        let weight = if plain[h] > 0.0 { power[h] / plain[h] } else { 1.0 };
        (weight.min(MOST_WEIGHT) * 1e3).round() / 1e3
    })
}

fn wave(pieces: &[(&Vec<Passage>, [f64; 2])]) -> (Wave, f64) {
    let passages = pieces.iter().flat_map(|(passages, k)| passages.iter().map(|p| (p, *k)));
    let mut found: Vec<(&Passage, Vec<Segment>)> = passages.map(|(p, k)| (p, segments(p, k))).collect();
    let weights = weights(&found);
    found.iter_mut().for_each(|(passage, segments)| without_response(segments, passage, &weights));
    let all: Vec<Segment> = found.into_iter().flat_map(|(_, segments)| segments).collect();
    let lines = template(&all);
    let origin = origin(&lines);
    let share = |h: usize| {
        let sum = |of: &dyn Fn(&Segment) -> Option<f64>| {
            all.iter().filter_map(|s| Some(s.seconds * of(s)?)).sum::<f64>()
        };
        let around = sum(&|s| s.around.get(h).copied());
        (around > 0.0).then(|| (sum(&|s| s.coherent.get(h).copied()) / around).clamp(0.0, 1.0))
    };
    let round = |x: f64, unit: f64| (x * unit).round() / unit;
    let harmonic = |(h, line): (usize, &Complex64)| {
        let phase = (line.arg() - (h + 1) as f64 * origin + PI).rem_euclid(TAU) - PI;
        Some(Harmonic { weight: weights[h], share: round(share(h)?, 1e3), phase: round(phase, 1e3) })
    };
    let harmonics = lines.iter().enumerate().map_while(harmonic).collect();
    let median = |axis: usize| {
        let mut values: Vec<f64> = pieces.iter().map(|(_, k)| k[axis]).collect();
        values.sort_by(f64::total_cmp);
        let n = values.len();
        0.5 * (values[(n - 1) / 2] + values[n / 2])
    };
    let seconds: f64 = all.iter().map(|s| s.seconds).sum();
    let part = all.iter().map(|s| s.seconds * s.coherent.iter().sum::<f64>()).sum::<f64>();
    let part = part / seconds.max(1e-9);
    (Wave { per_mm: [round(median(0), 1e4), round(median(1), 1e4)], harmonics }, part)
}
