//! Search by playing: how much of the waves repeats, and the bumps with which the kernel is like the strokes.

use super::figures::Figures;
use super::rendered;
use super::stroke::Passage;
use asperity_world::material::{Events, Pattern, Wave};

/// Passages whose speeds differ by less than this factor are taken together.
const CLASS: f64 = 1.5;
/// Seconds of each class that are rendered, at least.
const RENDERED_S: f64 = 24.0;
/// Modulation below which a line is steady.
const STEADY: f64 = 0.08;
/// Errors of ln(modulation), ln(kurtosis) and repetition that count as one.
const SCALES: [f64; 3] = [0.25, 0.15, 0.1];
/// Error of how ln(kurtosis) changes with direction that counts as one.
const GRAIN_SCALE: f64 = 0.25;
/// F ratio from which on the strokes have a grain: chance exceeds it once in 3000 materials without one.
const GRAIN_F: f64 = 8.0;
/// Mean over classes of the sum of fourth powers of their errors, up to which plain noise will do.
const ENOUGH: f64 = 0.25;
/// Bumps must leave less than this part of what plain noise has.
const BETTER: f64 = 0.4;

/// Points of the rough search from which the fine one begins.
const STARTS: usize = 5;

/// Factors of the waves' shares that are tried, as logarithms.
const FACTORS: [f64; 11] = [-0.7, -0.35, -0.175, -0.09, -0.05, 0.0, 0.175, 0.35, 0.7, 1.05, 1.4];
/// How alike the shares of a wave's harmonics are made, from 0, as they are found, to 1, as the fundamental's.
/// A ridge that is met a little early or late keeps its shape, and its high harmonics seem not to repeat.
const ALIKE: [f64; 3] = [0.0, 0.5, 1.0];
/// Rounds of the fine search, and the factor by which each makes the steps smaller.
const ROUNDS: usize = 5;
const FINER: f64 = 0.6;

/// A number that is varied: least and largest, and the first step of the fine search.
#[derive(Clone, Copy)]
struct Varied {
    range: (f64, f64),
    step: f64,
}

const fn varied(least: f64, most: f64, step: f64) -> Varied {
    Varied { range: (least, most), step }
}

/// Of bumps with a spacing: its logarithm in mm, its exponent, its anisotropy, deviations of intervals and
/// heights; and the logarithm of the factor of the waves' shares.
const SPACED: [Varied; 7] = [
    varied(-3.5, 2.1, 0.25),
    varied(-2.0, 1.0, 0.4),
    varied(-2.0, 2.0, 0.4),
    varied(-2.0, 2.0, 0.4),
    varied(0.1, 1.5, 0.25),
    varied(0.0, 1.5, 0.25),
    varied(-1.0, 1.5, 0.2),
];
/// Of bumps at ridges: deviations of places and heights, and the same factor.
const AT_RIDGES: [Varied; 3] = [varied(0.0, 0.3, 0.05), varied(0.0, 1.5, 0.25), varied(-1.0, 1.5, 0.2)];

/// Passages of about one speed: what they have, and which of them are rendered.
#[derive(Clone)]
struct Class<'p> {
    all: Vec<(&'p Passage, [f64; 3])>,
    truth: [f64; 3],
    rendered: Vec<&'p Passage>,
}

/// Logarithms of modulation and kurtosis, and repetition.
fn logs(figures: &Figures, waves: bool) -> [f64; 3] {
    // How narrow the spectrum is decides how alone a wave repeats: bumps do not change that.
    let least = if waves { figures.wave_repetition } else { 0.0 };
    [figures.modulation.max(STEADY).ln(), figures.kurtosis.ln(), figures.repetition.max(least)]
}

/// Medians over passages: what one direction has alone does not count.
fn medians(of: &[(&Passage, [f64; 3])]) -> [f64; 3] {
    std::array::from_fn(|figure| {
        let mut values: Vec<f64> = of.iter().map(|(_, logs)| logs[figure]).collect();
        values.sort_by(f64::total_cmp);
        let n = values.len();
        if n == 0 { 0.0 } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
    })
}

fn classes<'p>(passages: &[&'p Passage], waves: bool) -> Vec<Class<'p>> {
    let mut sorted = passages.to_vec();
    sorted.sort_by(|a, b| a.speed_mm_s.total_cmp(&b.speed_mm_s));
    let mut classes = Vec::new();
    while let Some(slowest) = sorted.first() {
        let most = CLASS * slowest.speed_mm_s;
        let rest = sorted.split_off(sorted.partition_point(|p| p.speed_mm_s < most));
        let all: Vec<_> = sorted.iter().map(|p| (*p, logs(&p.figures, waves))).collect();
        let truth = medians(&all);
        let mut seconds = 0.0;
        // In the order of the strokes.
        let within = |p: &&&Passage| p.speed_mm_s >= sorted[0].speed_mm_s && p.speed_mm_s < most;
        let few = |p: &&&Passage| {
            seconds += p.seconds;
            seconds - p.seconds < RENDERED_S
        };
        let rendered = passages.iter().filter(within).take_while(few).copied().collect();
        classes.push(Class { all, truth, rendered });
        sorted = rest;
    }
    classes
}

/// How ln(kurtosis) changes with direction: its parts with cos 2t and sin 2t of the angle t to x, by least
/// squares beside a mean for each class, and their F ratio: the variance that they explain over what is left,
/// each by its degrees of freedom. None where directions are too few.
fn grain<'a>(classes: impl Iterator<Item = &'a [(&'a Passage, [f64; 3])]>) -> Option<([f64; 2], f64)> {
    let (mut cc, mut cs, mut ss, mut ck, mut sk, mut kk) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    let mut free = -2.0;
    for class in classes {
        let n = class.len() as f64;
        free += n - 1.0;
        let rows = class.iter().map(|(passage, logs)| [passage.direction[0], passage.direction[1], logs[1]]);
        let mean = rows.clone().fold([0.0; 3], |sum, row| std::array::from_fn(|i| sum[i] + row[i] / n));
        for row in rows {
            let [c, s, k]: [f64; 3] = std::array::from_fn(|i| row[i] - mean[i]);
            (cc, cs, ss) = (cc + c * c, cs + c * s, ss + s * s);
            (ck, sk, kk) = (ck + c * k, sk + s * k, kk + k * k);
        }
    }
    let det = cc * ss - cs * cs;
    if free < 1.0 || det <= 1e-2 * (cc + ss).powi(2) {
        return None;
    }
    let [a, b] = [(ss * ck - cs * sk) / det, (cc * sk - cs * ck) / det];
    let explained = a * ck + b * sk;
    let left = (kk - explained).max(f64::MIN_POSITIVE);
    Some(([a, b], 0.5 * explained * free / left))
}

/// The waves with shares that repeat as the strokes do, and bumps beside them; none where plain noise does
/// as well. Without `spaced` bumps are at ridges alone.
pub(super) fn find(passages: &[&Passage], waves: &[Wave], spaced: bool) -> Pattern {
    let classes = classes(passages, !waves.is_empty());
    // Beside waves it is they that have a direction.
    let grain = grain(classes.iter().map(|class| &class.all[..]));
    let grain = grain.filter(|(_, f)| waves.is_empty() && *f > GRAIN_F).map(|(grain, _)| grain);
    let fit = Fit { waves, classes, grain };
    if fit.classes.is_empty() {
        return fit.without_bumps(0.0);
    }
    let mut best = (fit.factor(f64::INFINITY), waves.to_vec());
    for alike in ALIKE.into_iter().filter(|alike| *alike > 0.0 && !waves.is_empty()) {
        let waves = evened(waves, alike);
        let found = Fit { waves: &waves, ..fit.clone() }.factor(best.0.0);
        if found.0 < best.0.0 {
            best = (found, waves);
        }
    }
    let ((noise, factor), waves) = best;
    let fit = Fit { waves: &waves, ..fit };
    let mut found = Vec::new();
    if noise >= ENOUGH {
        found.extend(if spaced { fit.spaced(factor) } else { None });
        found.extend(fit.at_ridges());
    }
    let best = found.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|best| best.0 < BETTER * noise).map_or_else(|| fit.without_bumps(factor), |best| best.1)
}

/// Waves and classes of passages that a search is for.
#[derive(Clone)]
struct Fit<'p> {
    waves: &'p [Wave],
    classes: Vec<Class<'p>>,
    /// How the strokes' kurtosis changes with direction, where it is sure that it does.
    grain: Option<[f64; 2]>,
}

impl Fit<'_> {
    fn without_bumps(&self, factor: f64) -> Pattern {
        Pattern { waves: louder(self.waves, factor), events: None }
    }

    /// Mean over classes of the sum of fourth powers of errors, if so many passages of each are rendered,
    /// and the error of how they change with direction. Beyond the bound it need not be known exactly.
    fn error(&self, pattern: &Pattern, most: usize, bound: f64) -> f64 {
        let waves = !self.waves.is_empty();
        let mut sum = 0.0;
        let mut all = Vec::new();
        for (c, class) in self.classes.iter().enumerate() {
            let found = class.rendered.iter().take(most).enumerate().filter_map(|(n, p)| {
                let samples = rendered(pattern, &p.magnitudes, &p.places, (c * 1000 + n) as u64);
                Some((*p, logs(&Figures::of(&samples)?, waves)))
            });
            let found: Vec<_> = found.collect();
            let figures = medians(&found).into_iter().zip(class.truth).zip(SCALES);
            let mut off: Vec<f64> = figures.map(|((found, truth), scale)| (found - truth) / scale).collect();
            if !waves {
                // Bumps may repeat too much. What they repeat too little is for waves.
                off[2] = off[2].max(0.0);
            }
            // A large error at one speed counts more than small ones at all.
            sum += off.iter().map(|off| off.powi(4)).sum::<f64>() / self.classes.len() as f64;
            if sum > bound {
                return sum;
            }
            all.push(found);
        }
        // A part of the strokes has too few directions.
        let whole = self.classes.iter().all(|class| class.rendered.len() <= most);
        let found = whole.then(|| grain(all.iter().map(Vec::as_slice))).flatten();
        let off = self.grain.zip(found).map_or([0.0; 2], |(a, (b, _))| [a[0] - b[0], a[1] - b[1]]);
        sum + off.iter().map(|off| (off / GRAIN_SCALE).powi(4)).sum::<f64>()
    }

    /// The factor of the waves' shares, as a logarithm, with which plain noise beside them does best, and
    /// its error; beyond the bound it need not be known exactly.
    fn factor(&self, bound: f64) -> (f64, f64) {
        let mut best = (self.error(&self.without_bumps(0.0), usize::MAX, bound), 0.0);
        for factor in FACTORS.into_iter().filter(|_| !self.waves.is_empty()) {
            let found = self.error(&self.without_bumps(factor), usize::MAX, best.0);
            if found < best.0 {
                best = (found, factor);
            }
        }
        best
    }

    /// The best bumps that have a spacing.
    fn spaced(&self, factor: f64) -> Option<(f64, Pattern)> {
        let (least, most) = SPACED[0].range;
        // Beside waves the grain is not varied, without them the factor is not.
        let varied: [Varied; 7] = std::array::from_fn(|axis| match (axis, self.grain, self.waves) {
            (2 | 3, None, _) | (6, _, []) => varied(SPACED[axis].range.0, SPACED[axis].range.1, 0.0),
            _ => SPACED[axis],
        });
        let (least_grain, most_grain) = SPACED[2].range;
        let [a, b] = self.grain.unwrap_or_default().map(|x| x.clamp(least_grain, most_grain));
        let rough = all_of([
            (0..10).map(|i| least + (most - least) * f64::from(i) / 9.0).collect(),
            vec![-1.0, -0.5, 0.0, 0.5],
            vec![a],
            vec![b],
            vec![0.2, 0.4, 0.8],
            vec![0.0, 0.5, 1.0],
            vec![factor],
        ]);
        self.search(rough, &varied, &|p| {
            let unit = 10f64.powf(2.0 - p[0].exp().log10().floor());
            let events = Events {
                spacing_mm: Some((p[0].exp() * unit).round() / unit),
                spacing_exponent: rounded(p[1]),
                anisotropy: [rounded(p[2]), rounded(p[3])],
                interval_cv: rounded(p[4]),
                height_cv: rounded(p[5]),
            };
            Pattern { waves: louder(self.waves, p[6]), events: Some(events) }
        })
    }

    /// The best bumps at ridges; none without waves.
    fn at_ridges(&self) -> Option<(f64, Pattern)> {
        if self.waves.is_empty() {
            return None;
        }
        let rough = all_of([vec![0.0, 0.05, 0.15], vec![0.0, 0.6], FACTORS.to_vec()]);
        self.search(rough, &AT_RIDGES, &|p| {
            let events = Events {
                spacing_mm: None,
                spacing_exponent: 0.0,
                anisotropy: [0.0; 2],
                interval_cv: rounded(p[0]),
                height_cv: rounded(p[1]),
            };
            Pattern { waves: louder(self.waves, p[2]), events: Some(events) }
        })
    }

    /// The best pattern near one of some points, and its error.
    fn search(
        &self,
        rough: Vec<Vec<f64>>,
        varied: &[Varied],
        make: &dyn Fn(&[f64]) -> Pattern,
    ) -> Option<(f64, Pattern)> {
        // Roughly, by half of what is rendered.
        let half = self.classes.iter().map(|class| class.rendered.len().div_ceil(2)).max().unwrap_or(1);
        let mut starts: Vec<(f64, Vec<f64>)> = Vec::new();
        for point in rough {
            let bound = starts.get(STARTS - 1).map_or(f64::INFINITY, |worst| worst.0);
            let found = self.error(&make(&point), half, bound);
            if found < bound {
                starts.push((found, point));
                starts.sort_by(|a, b| a.0.total_cmp(&b.0));
                starts.truncate(STARTS);
            }
        }
        // Then finely from the best.
        let fine = |(_, point): (f64, Vec<f64>)| {
            let mut here = (self.error(&make(&point), usize::MAX, f64::INFINITY), point);
            let mut part = 1.0;
            for _ in 0..ROUNDS {
                for (axis, Varied { range: (least, most), step }) in varied.iter().enumerate() {
                    for sign in [-1.0, 1.0] {
                        let mut next = here.1.clone();
                        next[axis] = (next[axis] + sign * part * step).clamp(*least, *most);
                        if next == here.1 {
                            continue;
                        }
                        let found = self.error(&make(&next), usize::MAX, here.0);
                        if found < here.0 {
                            here = (found, next);
                            break;
                        }
                    }
                }
                part *= FINER;
            }
            (here.0, make(&here.1))
        };
        starts.into_iter().map(fine).min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

/// Each of the first with each of the second and so on.
fn all_of<const N: usize>(axes: [Vec<f64>; N]) -> Vec<Vec<f64>> {
    axes.iter().fold(vec![Vec::new()], |points, axis| {
        let with =
            |point: Vec<f64>| axis.iter().map(move |value| point.iter().copied().chain([*value]).collect());
        points.into_iter().flat_map(with).collect()
    })
}

/// Waves whose shares are more alike, by 0 to 1.
fn evened(waves: &[Wave], alike: f64) -> Vec<Wave> {
    let mut waves = waves.to_vec();
    for wave in &mut waves {
        let first = wave.harmonics.first().map_or(0.0, |h| h.share);
        wave.harmonics.iter_mut().for_each(|h| h.share += alike * (first - h.share));
    }
    waves
}

/// Waves whose shares are so many times as large, as a logarithm.
fn louder(waves: &[Wave], factor: f64) -> Vec<Wave> {
    let mut waves = waves.to_vec();
    for harmonic in waves.iter_mut().flat_map(|wave| &mut wave.harmonics) {
        harmonic.share = (1e3 * (harmonic.share * factor.exp()).min(1.0)).round() / 1e3;
    }
    waves
}

/// With as many digits as mean something.
fn rounded(x: f64) -> f64 {
    (x * 100.0).round() / 100.0
}
