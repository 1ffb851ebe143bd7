//! Bumps: the constants with which the kernel is as bumpy as the strokes.

use super::figures::Figures;
use super::rendered;
use super::stroke::Passage;
use asperity_world::material::{Events, Pattern, Wave};

/// Passages whose speeds differ by less than this factor are taken together.
const CLASS: f64 = 1.5;
/// Seconds of each class that are rendered, at least.
const RENDERED_S: f64 = 18.0;
/// Errors of ln(modulation), ln(kurtosis) and repetition that count as one.
const SCALES: [f64; 3] = [0.25, 0.15, 0.1];
/// Mean over classes of the sum of fourth powers of their errors, up to which plain noise will do.
const ENOUGH: f64 = 0.25;
/// Bumps must leave less than this part of what plain noise has.
const BETTER: f64 = 0.4;

/// Points of the rough search from which the fine one begins.
const STARTS: usize = 5;

const SPACING_MM: (f64, f64) = (0.03, 8.0);
const INTERVAL_CV: (f64, f64) = (0.1, 1.5);
const HEIGHT_CV: (f64, f64) = (0.0, 1.5);

/// Passages of about one speed: what they have, and which of them are rendered.
struct Class<'p> {
    truth: [f64; 3],
    rendered: Vec<&'p Passage>,
}

/// Logarithms of modulation and kurtosis, and repetition.
fn logs(figures: &Figures) -> [f64; 3] {
    [figures.modulation.max(1e-3).ln(), figures.kurtosis.ln(), figures.repetition]
}

/// Means over passages, weighed by their lengths.
fn mean(of: impl Iterator<Item = ([f64; 3], f64)>) -> [f64; 3] {
    let (mut sum, mut weights) = ([0.0; 3], 0.0);
    for (logs, weight) in of {
        sum.iter_mut().zip(logs).for_each(|(sum, log)| *sum += weight * log);
        weights += weight;
    }
    sum.map(|sum| sum / f64::max(weights, 1e-9))
}

fn classes<'p>(passages: &[&'p Passage]) -> Vec<Class<'p>> {
    let mut sorted = passages.to_vec();
    sorted.sort_by(|a, b| a.speed_mm_s.total_cmp(&b.speed_mm_s));
    let mut classes = Vec::new();
    while let Some(slowest) = sorted.first() {
        let most = CLASS * slowest.speed_mm_s;
        let rest = sorted.split_off(sorted.partition_point(|p| p.speed_mm_s < most));
        let truth = mean(sorted.iter().map(|p| (logs(&p.figures), p.seconds)));
        let mut seconds = 0.0;
        // In the order of the strokes.
        let within = |p: &&&Passage| p.speed_mm_s >= sorted[0].speed_mm_s && p.speed_mm_s < most;
        let few = |p: &&&Passage| {
            seconds += p.seconds;
            seconds - p.seconds < RENDERED_S
        };
        let rendered = passages.iter().filter(within).take_while(few).copied().collect();
        classes.push(Class { truth, rendered });
        sorted = rest;
    }
    classes
}

/// Fits bumps beside waves; none where plain noise does as well.
pub(super) fn find(passages: &[&Passage], waves: &[Wave]) -> Option<Events> {
    let classes = classes(passages);
    if classes.is_empty() {
        return None;
    }
    // Up to a bound: what is worse need not be known exactly.
    let error = |events: Option<Events>, most: usize, bound: f64| {
        let pattern = Pattern { waves: waves.to_vec(), events };
        let mut sum = 0.0;
        for (c, class) in classes.iter().enumerate() {
            let found = class.rendered.iter().take(most).enumerate().filter_map(|(n, p)| {
                let samples = rendered(&pattern, &p.magnitudes, &p.places, (c * 1000 + n) as u64);
                Some((logs(&Figures::of(&samples)?), p.seconds))
            });
            let figures = mean(found).into_iter().zip(class.truth).zip(SCALES);
            let mut off: Vec<f64> = figures.map(|((found, truth), scale)| (found - truth) / scale).collect();
            // Bumps may repeat too much. What they repeat too little is for waves.
            off[2] = off[2].max(0.0);
            // What is far off at one speed counts more than what is a little off at all.
            sum += off.iter().map(|off| off.powi(4)).sum::<f64>() / classes.len() as f64;
            if sum > bound {
                break;
            }
        }
        sum
    };
    let all = usize::MAX;
    let noise = error(None, all, f64::INFINITY);
    if noise < ENOUGH {
        return None;
    }
    // Roughly, by half of what is rendered.
    let half = classes.iter().map(|class| class.rendered.len().div_ceil(2)).max().unwrap_or(1);
    let steps = |(least, most): (f64, f64), n: u32| {
        (0..n).map(move |i| least + (most - least) * f64::from(i) / f64::from(n - 1))
    };
    let mut grid = [(f64::INFINITY, [0.0; 3]); STARTS];
    for spacing in steps((SPACING_MM.0.ln(), SPACING_MM.1.ln()), 12) {
        for interval in [0.15, 0.3, 0.5, 1.0] {
            for height in [0.0, 0.3, 0.6, 1.0] {
                let point = [spacing, interval, height];
                let found = error(Some(at(point)), half, grid[STARTS - 1].0);
                if found < grid[STARTS - 1].0 {
                    grid[STARTS - 1] = (found, point);
                    grid.sort_by(|a, b| a.0.total_cmp(&b.0));
                }
            }
        }
    }
    // Then finely from the best.
    let mut best: Option<(f64, [f64; 3])> = None;
    for (_, point) in grid {
        let mut here = (error(Some(at(point)), all, f64::INFINITY), point);
        let mut sizes = [0.25, 0.25, 0.25];
        for _ in 0..4 {
            for axis in 0..3 {
                for sign in [-1.0, 1.0] {
                    let mut next = here.1;
                    next[axis] += sign * sizes[axis];
                    let next = within(next);
                    if next != here.1 {
                        let found = error(Some(at(next)), all, here.0);
                        if found < here.0 {
                            here = (found, next);
                            break;
                        }
                    }
                }
            }
            sizes = sizes.map(|s| 0.6 * s);
        }
        if best.is_none_or(|best| here.0 < best.0) {
            best = Some(here);
        }
    }
    best.filter(|(found, _)| *found < BETTER * noise).map(|(_, point)| at(point))
}

fn within([spacing, interval, height]: [f64; 3]) -> [f64; 3] {
    [
        spacing.clamp(SPACING_MM.0.ln(), SPACING_MM.1.ln()),
        interval.clamp(INTERVAL_CV.0, INTERVAL_CV.1),
        height.clamp(HEIGHT_CV.0, HEIGHT_CV.1),
    ]
}

/// Constants with as many digits as mean something.
fn at([spacing, interval, height]: [f64; 3]) -> Events {
    let round = |x: f64| (x * 100.0).round() / 100.0;
    let spacing_mm = spacing.exp();
    let unit = 10f64.powf(2.0 - spacing_mm.log10().floor());
    Events {
        spacing_mm: (spacing_mm * unit).round() / unit,
        interval_cv: round(interval),
        height_cv: round(height),
    }
}
