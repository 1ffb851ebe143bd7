//! Search by playing: how much of the waves repeats, and the bumps that make the kernel like the strokes.

use std::ops::Range;

use super::figures::Figures;
use super::rendered;
use super::stroke::Passage;
use asperity_texture::{Events, Pattern, Wave};

/// Passages whose speeds differ by less than this factor form a class.
const CLASS: f64 = 1.5;
/// Modulation below which a line is steady.
const STEADY: f64 = 0.03;
/// Errors of ln(modulation), ln(kurtosis) and repetition that count as one.
const SCALES: [f64; 3] = [0.25, 0.15, 0.1];
/// Error of the change of ln(kurtosis) with direction that counts as one.
const GRAIN_SCALE: f64 = 0.25;
/// F ratio from which the strokes have a grain: chance exceeds it once in 3000 materials without one.
const GRAIN_F: f64 = 8.0;
/// Mean over classes of the summed fourth powers of their errors, up to which plain noise will do.
const ENOUGH: f64 = 0.02;
/// Bumps must leave less than this part of plain noise's error.
const BETTER: f64 = 0.4;

/// Factor of the step from round to round of the fine search.
const FINER: f64 = 0.6;
/// Longest anisotropy.
const MOST_ANISOTROPY: f64 = 0.97;

/// Thoroughness of the search. The time it takes grows with each number.
pub(super) struct Effort {
    /// Seconds of each class to render: for the rough search, the fine one, and to judge.
    pub(super) seconds: [f64; 3],
    /// Number of spacings in the rough search.
    pub(super) spacings: usize,
    /// Its exponents, and its deviations of intervals and of heights.
    pub(super) rough: [&'static [f64]; 3],
    /// Logarithms of factors on the waves' shares to try.
    pub(super) factors: &'static [f64],
    /// Equalisation of a wave's harmonic shares: 0 as found, 1 like the fundamental's. A ridge met a little
    /// early or late keeps its shape, but its high harmonics seem not to repeat.
    pub(super) alike: &'static [f64],
    /// Points of the rough search from which the fine one begins, and points for the last one.
    pub(super) starts: [usize; 2],
    /// Rounds of the fine search and of the last one, whose first steps are the fine one's second.
    pub(super) rounds: [i32; 2],
    /// Draws for the judgement.
    pub(super) draws: u64,
}

impl Effort {
    /// As much as a material is worth that ships.
    pub(super) const FULL: Self = Self {
        seconds: [12.0, 24.0, 72.0],
        spacings: 12,
        rough: [&[-1.0, -0.5, 0.0, 0.5], &[0.2, 0.4, 0.8], &[0.0, 0.5, 1.0, 1.4]],
        factors: &[-0.7, -0.35, -0.175, -0.09, -0.05, 0.0, 0.175, 0.35, 0.7, 1.05, 1.4],
        alike: &[0.0, 0.5, 1.0],
        starts: [5, 2],
        rounds: [5, 4],
        draws: 3,
    };
}

/// A number to vary: least, most, and first step of the fine search.
type Varied = (f64, f64, f64);

/// For waves: logarithm of the factor on their shares, and how equal they are made.
const WAVED: [Varied; 2] = [(-1.0, 1.5, 0.2), (0.0, 1.0, 0.25)];
/// For bumps with a spacing: logarithm in mm of the spacing at which equal bumps have the same kurtosis; its
/// exponent; its anisotropy; deviations of intervals and heights; then the numbers for waves.
const SPACED: [Varied; 8] = [
    (-3.5, 4.2, 0.25),
    (-2.0, 1.0, 0.4),
    (-MOST_ANISOTROPY, MOST_ANISOTROPY, 0.2),
    (-MOST_ANISOTROPY, MOST_ANISOTROPY, 0.2),
    (0.1, 1.5, 0.25),
    (0.0, 1.5, 0.25),
    WAVED[0],
    WAVED[1],
];
/// For bumps at ridges: deviations of places and heights; then the numbers for waves.
const AT_RIDGES: [Varied; 4] = [(0.0, 0.3, 0.05), (0.0, 1.5, 0.25), WAVED[0], WAVED[1]];

/// A passage with the [logs] of it or of its rendering.
type Told<'p> = (&'p Passage, [f64; 3]);

/// The passages of the first `most_s` seconds of a class.
fn first<'p>(class: &[Told<'p>], most_s: f64) -> impl Iterator<Item = Told<'p>> {
    let mut seconds = 0.0;
    let few = move |(p, _): &Told<'_>| {
        seconds += p.seconds;
        seconds - p.seconds < most_s
    };
    class.iter().copied().take_while(few)
}

/// Logarithms of modulation and kurtosis, and repetition.
fn logs(figures: &Figures, waves: bool) -> [f64; 3] {
    // The width of the spectrum decides how much a wave repeats by itself. Bumps do not change that.
    let least = if waves { figures.wave_repetition } else { 0.0 };
    [figures.modulation.max(STEADY).ln(), figures.kurtosis.ln(), figures.repetition.max(least)]
}

/// Error of modulation, kurtosis and repetition against the truth of a class.
///
/// Bumps are chance, so means over passages are compared. They may not repeat too much; too little
/// repetition is left to waves.
fn off_by_chance(found: &[Told<'_>], truth: &[Told<'_>]) -> [f64; 3] {
    let means = |of: &[Told<'_>]| -> [f64; 3] {
        std::array::from_fn(|figure| of.iter().map(|(_, x)| x[figure]).sum::<f64>() / of.len().max(1) as f64)
    };
    let (found, truth) = (means(found), means(truth));
    [found[0] - truth[0], found[1] - truth[1], (found[2] - truth[2]).max(0.0)]
}

/// The same beside waves. Waves differ in each direction, so each passage is compared with its own
/// truth. Sizes are averaged, so that no direction counts alone.
fn off_by_direction(found: &[Told<'_>], truth: &[[f64; 3]]) -> [f64; 3] {
    std::array::from_fn(|figure| {
        let off = found.iter().zip(truth).map(|((_, found), truth)| (found[figure] - truth[figure]).abs());
        off.sum::<f64>() / found.len().max(1) as f64
    })
}

/// Mean fourth power of the heights of bumps over the square of their mean square. Bumps this many
/// times closer than equal bumps have the same kurtosis. Heights are lognormal and grow with the root
/// of the way from the last bump.
fn height_kurtosis(interval_cv: f64, height_cv: f64) -> f64 {
    (1.0 + interval_cv * interval_cv) * (1.0 + height_cv * height_cv).powi(4)
}

/// Passages of about one speed each, in the order of the strokes.
fn classes<'p>(passages: &[&'p Passage], waves: bool) -> Vec<Vec<Told<'p>>> {
    let mut sorted = passages.to_vec();
    sorted.sort_by(|a, b| a.speed_mm_s.total_cmp(&b.speed_mm_s));
    let mut classes = Vec::new();
    while let Some(slowest) = sorted.first() {
        let most = CLASS * slowest.speed_mm_s;
        let rest = sorted.split_off(sorted.partition_point(|p| p.speed_mm_s < most));
        let within = |p: &&&Passage| (sorted[0].speed_mm_s..most).contains(&p.speed_mm_s);
        classes.push(passages.iter().filter(within).map(|p| (*p, logs(&p.figures, waves))).collect());
        sorted = rest;
    }
    classes
}

/// Change of ln(kurtosis) with direction: its parts with cos 2t and sin 2t of the angle t to x, by
/// least squares beside a mean for each class. And their F ratio: explained over remaining variance,
/// each by its degrees of freedom. None if there are too few directions.
fn grain(classes: &[Vec<Told<'_>>]) -> Option<([f64; 2], f64)> {
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

/// The waves with shares that repeat like the strokes, and bumps beside them. Without bumps if plain
/// noise is as good. Without `spaced` only bumps at ridges are tried.
pub(super) fn find(passages: &[&Passage], waves: &[Wave], spaced: bool, effort: &Effort) -> Pattern {
    let classes = classes(passages, !waves.is_empty());
    // Beside waves only the waves have a direction.
    let grain = grain(&classes).filter(|(_, f)| waves.is_empty() && *f > GRAIN_F).map(|(grain, _)| grain);
    let fit = Fit { waves, classes, grain, effort };
    if fit.classes.is_empty() {
        return fit.pattern(0.0, 0.0, None);
    }
    let (noise, shares) = fit.plain();
    let mut found = Vec::new();
    if noise >= ENOUGH {
        found.extend(if spaced { fit.spaced(shares) } else { None });
        found.extend(fit.at_ridges());
    }
    let best = found.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let best = best.filter(|best| best.0 < BETTER * noise);
    best.map_or_else(|| fit.pattern(shares[0], shares[1], None), |best| best.1)
}

/// Waves and classes of passages for a search.
struct Fit<'p> {
    waves: &'p [Wave],
    classes: Vec<Vec<Told<'p>>>,
    /// Change of the strokes' kurtosis with direction, if certain.
    grain: Option<[f64; 2]>,
    effort: &'p Effort,
}

impl Fit<'_> {
    /// Waves whose shares are more equal, by 0 to 1, then multiplied by `exp(factor)`; and bumps.
    fn pattern(&self, factor: f64, alike: f64, events: Option<Events>) -> Pattern {
        let mut waves = self.waves.to_vec();
        for wave in &mut waves {
            let first = wave.harmonics.first().map_or(0.0, |h| h.share);
            for h in &mut wave.harmonics {
                h.share += alike * (first - h.share);
                h.share = (1e3 * (h.share * factor.exp()).min(1.0)).round() / 1e3;
            }
        }
        Pattern { waves, events }
    }

    /// Mean over classes of the summed fourth powers of errors, from rendering the first seconds of
    /// each, plus the error of the change with direction. `draw` seeds all that is random. Above
    /// `bound` the error need not be exact.
    fn error(&self, pattern: &Pattern, draw: u64, seconds: f64, bound: f64) -> f64 {
        let waves = !self.waves.is_empty();
        let mut sum = 0.0;
        let mut all = Vec::new();
        for (c, class) in self.classes.iter().enumerate() {
            let (found, truth): (Vec<_>, Vec<_>) = first(class, seconds)
                .enumerate()
                .filter_map(|(n, (p, truth))| {
                    let seed = 1_000_000 * draw + (c * 1000 + n) as u64;
                    let samples = rendered(pattern, &p.magnitudes, &p.places, seed);
                    Some(((p, logs(&Figures::of(&samples)?, waves)), truth))
                })
                .unzip();
            let off = if waves { off_by_direction(&found, &truth) } else { off_by_chance(&found, class) };
            let off = off.into_iter().zip(SCALES).map(|(off, scale)| off / scale);
            // A large error at one speed counts more than small ones at all.
            sum += off.map(|off| off.powi(4)).sum::<f64>() / self.classes.len() as f64;
            if sum > bound {
                return sum;
            }
            all.push(found);
        }
        // Few strokes have too few directions.
        let enough = seconds >= self.effort.seconds[1];
        let found = enough.then(|| grain(&all)).flatten();
        let off = self.grain.zip(found).map_or([0.0; 2], |(a, (b, _))| [a[0] - b[0], a[1] - b[1]]);
        sum + off.iter().map(|off| (off / GRAIN_SCALE).powi(4)).sum::<f64>()
    }

    /// Error of plain noise beside the waves, and the best factor and equality of their shares.
    fn plain(&self) -> (f64, [f64; 2]) {
        if self.waves.is_empty() {
            let plain = self.pattern(0.0, 0.0, None);
            return (self.error(&plain, 0, self.effort.seconds[2], f64::INFINITY), [0.0; 2]);
        }
        let rough = all_of([self.effort.factors.to_vec(), self.effort.alike.to_vec()]);
        let found = self.search(rough, &WAVED, &|p| self.pattern(p[0], p[1], None));
        found.map_or((f64::INFINITY, [0.0; 2]), |(error, p)| (error, [p[0], p[1]]))
    }

    /// The best bumps with a spacing.
    fn spaced(&self, shares: [f64; 2]) -> Option<(f64, Pattern)> {
        let (least, most, _) = SPACED[0];
        // Beside waves the grain is fixed; without them the shares are.
        let varied: [Varied; 8] = std::array::from_fn(|axis| match (axis, self.grain, self.waves) {
            (2 | 3, None, _) | (6 | 7, _, []) => (SPACED[axis].0, SPACED[axis].1, 0.0),
            _ => SPACED[axis],
        });
        let [a, b] = ellipse(self.grain.unwrap_or_default());
        let (spacings, [exponents, intervals, heights]) = (self.effort.spacings, self.effort.rough);
        let rough = all_of([
            (0..spacings).map(|i| least + (most - least) * i as f64 / (spacings - 1) as f64).collect(),
            exponents.to_vec(),
            vec![a],
            vec![b],
            intervals.to_vec(),
            heights.to_vec(),
            vec![shares[0]],
            vec![shares[1]],
        ]);
        let make = |p: &[f64]| {
            let spacing = (p[0].exp() / height_kurtosis(p[4], p[5])).max(0.01);
            let unit = 10f64.powf(2.0 - spacing.log10().floor());
            let events = Events {
                spacing_mm: Some((spacing * unit).round() / unit),
                spacing_exponent: rounded(p[1]),
                anisotropy: within([p[2], p[3]]).map(rounded),
                interval_cv: rounded(p[4]),
                height_cv: rounded(p[5]),
            };
            self.pattern(p[6], p[7], Some(events))
        };
        self.search(rough, &varied, &make).map(|(error, point)| (error, make(&point)))
    }

    /// The best bumps at ridges; none without waves.
    fn at_ridges(&self) -> Option<(f64, Pattern)> {
        if self.waves.is_empty() {
            return None;
        }
        let rough = all_of([
            vec![0.0, 0.05, 0.15],
            vec![0.0, 0.6],
            self.effort.factors.to_vec(),
            self.effort.alike.to_vec(),
        ]);
        let make = |p: &[f64]| {
            let events = Events {
                spacing_mm: None,
                spacing_exponent: 0.0,
                anisotropy: [0.0; 2],
                interval_cv: rounded(p[0]),
                height_cv: rounded(p[1]),
            };
            self.pattern(p[2], p[3], Some(events))
        };
        self.search(rough, &AT_RIDGES, &make).map(|(error, point)| (error, make(&point)))
    }

    /// The best point near one of `rough`, and the error of its pattern.
    fn search(
        &self,
        rough: Vec<Vec<f64>>,
        varied: &[Varied],
        make: &dyn Fn(&[f64]) -> Pattern,
    ) -> Option<(f64, Vec<f64>)> {
        // Rough: the best for each value on the first axis; otherwise all would be near one.
        let &Effort { seconds: [rough_s, fine_s, judged_s], starts: [few, last], rounds, draws, .. } =
            self.effort;
        let mut starts: Vec<(f64, Vec<f64>)> = Vec::new();
        for point in rough {
            let same = starts.iter().position(|(_, other)| other[0] == point[0]);
            let bound = same.map_or(f64::INFINITY, |at| starts[at].0);
            let found = self.error(&make(&point), 0, rough_s, bound);
            if found < bound {
                same.map(|at| starts.remove(at));
                starts.push((found, point));
            }
        }
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        starts.truncate(few);
        // Fine, from the best of these.
        let first = |pattern: &Pattern, bound: f64| self.error(pattern, 0, fine_s, bound);
        let fine = starts.into_iter().map(|(_, point)| descend(point, varied, 0..rounds[0], make, &first).1);
        // A fit to one draw may be chance, more so for rare high bumps. Other draws judge.
        let judge = |pattern: &Pattern, bound: f64| {
            let most = bound * draws as f64;
            let add = |sum: f64, draw: u64| {
                if sum > most { sum } else { sum + self.error(pattern, draw, judged_s, most - sum) }
            };
            (1..=draws).fold(0.0, add) / draws as f64
        };
        let judged = |point: Vec<f64>| (judge(&make(&point), f64::INFINITY), point);
        let mut found: Vec<(f64, Vec<f64>)> = fine.map(judged).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.truncate(last);
        let again = 1..1 + rounds[1];
        let last = found.into_iter().map(|(_, point)| descend(point, varied, again.clone(), make, &judge));
        last.min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

/// The best point that steps along the axes reach, and its error. Later rounds have smaller steps.
fn descend(
    point: Vec<f64>,
    varied: &[Varied],
    rounds: Range<i32>,
    make: &dyn Fn(&[f64]) -> Pattern,
    error: &dyn Fn(&Pattern, f64) -> f64,
) -> (f64, Vec<f64>) {
    let mut here = (error(&make(&point), f64::INFINITY), point);
    for round in rounds {
        for (axis, (least, most, step)) in varied.iter().enumerate() {
            for sign in [-1.0, 1.0] {
                let mut next = here.1.clone();
                next[axis] = (next[axis] + sign * FINER.powi(round) * step).clamp(*least, *most);
                if next == here.1 {
                    continue;
                }
                let found = error(&make(&next), here.0);
                if found < here.0 {
                    here = (found, next);
                    break;
                }
            }
        }
    }
    here
}

/// All combinations of one value from each axis.
fn all_of<const N: usize>(axes: [Vec<f64>; N]) -> Vec<Vec<f64>> {
    axes.iter().fold(vec![Vec::new()], |points, axis| {
        let with =
            |point: Vec<f64>| axis.iter().map(move |value| point.iter().copied().chain([*value]).collect());
        points.into_iter().flat_map(with).collect()
    })
}

/// Anisotropy of bumps whose log spacing changes with direction like a kurtosis. The length `e` has the
/// first harmonic `(1 - sqrt(1 - e^2)) / e`.
fn ellipse(grain: [f64; 2]) -> [f64; 2] {
    let h = grain[0].hypot(grain[1]).min(1.0);
    if h == 0.0 {
        return grain;
    }
    within(grain.map(|x| -2.0 * x / grain[0].hypot(grain[1]) * h / (1.0 + h * h)))
}

/// Limits an anisotropy's length.
fn within(anisotropy: [f64; 2]) -> [f64; 2] {
    let shorter = (MOST_ANISOTROPY / anisotropy[0].hypot(anisotropy[1])).min(1.0);
    anisotropy.map(|x| x * shorter)
}

/// Rounds to significant digits.
fn rounded(x: f64) -> f64 {
    (x * 100.0).round() / 100.0
}
