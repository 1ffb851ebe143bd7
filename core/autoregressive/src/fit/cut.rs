//! Finds stretches of nearly constant speed and force, and pieces of them with one spectrum.

use super::super::triangles::range;
use super::blocks::{Blocks, Span};
use super::burg::Lattice;
use super::{Settings, Tolerance, Why};
use asperity_numbers::Elementary as _;

/// Order of the models that compare spectra.
const ORDER: usize = 8;
/// Cost of a cut in logarithms of the number of samples: the parameters of one more model and a place.
const COST: f64 = (ORDER + 2) as f64;
/// Places to try first; then those around the best.
const PLACES: usize = 256;
/// Least residual variance as a part of the mean square. No texture is more predictable.
const NOTHING: f64 = 1e-4;
/// Least blocks to cut off where speed or force change.
const MARGIN: usize = 2;

/// The parts of a run with nearly constant speed and force, in order of time. The rest is dropped.
pub(super) fn steady(
    blocks: &Blocks,
    run: Span,
    settings: &Settings,
    dropped: &mut Vec<(Span, Why)>,
) -> Vec<Span> {
    let shortest = blocks.count(settings.shortest_s);
    if run.len() < shortest {
        dropped.push((run, Why::Short));
        return Vec::new();
    }
    let sums = Sums::new(blocks.smooth_of(&run));
    let mut left = vec![Span { start: 0, end: run.len() }];
    let mut found = Vec::new();
    while let Some(part) = left.pop() {
        let place = run.start + part.start..run.start + part.end;
        let values = blocks.smooth_of(&place);
        if part.len() < shortest {
            dropped.push((place, Why::Unsteady));
        } else if let Some(scale) = leaves(values, &settings.tolerance) {
            let cut = sums.best_cut(&part, scale);
            left.push(cut..part.end);
            left.push(part.start..cut);
        } else {
            found.push(place);
        }
    }
    found
}

/// The tolerances around the middles of the ranges, if either range exceeds twice its own.
fn leaves(values: &[[f64; 2]], tolerance: &Tolerance) -> Option<[f64; 2]> {
    let ranges = [0, 1].map(|axis| range(values.iter().map(|v| v[axis])));
    let scale = tolerance.of(ranges.map(|[low, high]| 0.5 * (low + high)));
    ranges.iter().zip(scale).any(|([low, high], t)| high - low > 2.0 * t).then_some(scale)
}

/// Running sums of values and squares, by block.
struct Sums(Vec<[[f64; 2]; 2]>);

impl Sums {
    fn new(values: &[[f64; 2]]) -> Self {
        let mut sums = vec![[[0.0; 2]; 2]];
        for (i, value) in values.iter().enumerate() {
            let next = |axis: usize| {
                let ([sum, squares], x) = (sums[i][axis], value[axis]);
                [sum + x, squares + x * x]
            };
            sums.push([next(0), next(1)]);
        }
        Self(sums)
    }

    /// Sum of squares around the mean in units of `scale`.
    fn scatter(&self, from: usize, to: usize, scale: [f64; 2]) -> f64 {
        let n = (to - from) as f64;
        (0..2)
            .map(|axis| {
                let [sum, squares] = [0, 1].map(|i| self.0[to][axis][i] - self.0[from][axis][i]);
                (squares - sum * sum / n) / (scale[axis] * scale[axis])
            })
            .sum()
    }

    /// The cut with the least scatter on both sides.
    fn best_cut(&self, part: &Span, scale: [f64; 2]) -> usize {
        let margin = MARGIN.min(part.len() / 2);
        let cost = |cut: usize| self.scatter(part.start, cut, scale) + self.scatter(cut, part.end, scale);
        (part.start + margin..part.end + 1 - margin)
            .map(|cut| (cost(cut), cut))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(part.start + part.len() / 2, |(_, cut)| cut)
    }
}

/// Cuts a stretch where its spectrum changes. Pieces are in order of time.
pub(super) fn stationary(blocks: &Blocks, stretch: Span, settings: &Settings, pieces: &mut Vec<Span>) {
    let products = Products::new(blocks.signal_of(&stretch), blocks.len);
    let shortest = blocks.count(settings.shortest_s);
    let mut left = vec![Span { start: 0, end: stretch.len() }];
    while let Some(part) = left.pop() {
        match products.change(&part, shortest) {
            Some(cut) => {
                left.push(cut..part.end);
                left.push(part.start..cut);
            }
            None => pieces.push(stretch.start + part.start..stretch.start + part.end),
        }
    }
}

/// Running sums by block of products of samples with earlier ones: the autocorrelation of any blocks.
struct Products<'a> {
    signal: &'a [f64],
    len: usize,
    sums: Vec<[f64; ORDER + 1]>,
    floor: f64,
}

impl<'a> Products<'a> {
    fn new(signal: &'a [f64], len: usize) -> Self {
        let mut sum = [0.0; ORDER + 1];
        let mut sums = vec![sum];
        for n in 0..signal.len() {
            for (lag, sum) in sum.iter_mut().enumerate().take(n + 1) {
                *sum += signal[n] * signal[n - lag];
            }
            if (n + 1) % len == 0 {
                sums.push(sum);
            }
        }
        let floor = NOTHING * sum[0] / signal.len().max(1) as f64 + f64::MIN_POSITIVE;
        Self { signal, len, sums, floor }
    }

    /// `n ln s^2` of a model over some blocks.
    fn cost(&self, from: usize, to: usize) -> f64 {
        let n = ((to - from) * self.len) as f64;
        let first = from * self.len;
        let r: [f64; ORDER + 1] = std::array::from_fn(|lag| {
            // Without the products that reach back across the border.
            let across: f64 = (first..first + lag)
                .filter_map(|n| Some(self.signal.get(n)? * self.signal.get(n.checked_sub(lag)?)?))
                .sum();
            (self.sums[to][lag] - self.sums[from][lag] - across) / n
        });
        n * residual(&r).max(self.floor).log_e()
    }

    /// The place where some blocks change most, if they change. Autocorrelations find it. Burg's method
    /// decides whether it is a change: the autocorrelation of a near tone depends on where in a period it
    /// ends.
    fn change(&self, part: &Span, shortest: usize) -> Option<usize> {
        let places = part.start + shortest..(part.end + 1).saturating_sub(shortest);
        let cost = |cut: usize| self.cost(part.start, cut) + self.cost(cut, part.end);
        let best = |of: &mut dyn Iterator<Item = usize>| {
            of.map(|cut| (cost(cut), cut)).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, cut)| cut)
        };
        let step = places.len().div_ceil(PLACES).max(1);
        let near = best(&mut places.clone().step_by(step))?;
        let around = near.saturating_sub(step).max(places.start)..(near + step).min(places.end);
        let cut = best(&mut around.into_iter())?;
        let judged = |from: usize, to: usize| {
            let signal = self.signal.get(from * self.len..to * self.len).unwrap_or_default();
            let lattice = Lattice::new(signal, ORDER);
            let variance = lattice.residual(ORDER).max(NOTHING * lattice.residual(0));
            signal.len() as f64 * variance.max(self.floor).log_e()
        };
        let ratio = judged(part.start, part.end) - judged(part.start, cut) - judged(cut, part.end);
        let samples = (part.len() * self.len) as f64;
        (ratio > COST * samples.log_e()).then_some(cut)
    }
}

/// Residual variance of the predictor of an autocorrelation (Levinson-Durbin recursion).
fn residual(r: &[f64; ORDER + 1]) -> f64 {
    let mut a = [0.0; ORDER];
    let mut variance = r[0];
    for order in 0..ORDER {
        if variance <= NOTHING * r[0] {
            return NOTHING * r[0];
        }
        let ahead: f64 = (0..order).map(|i| a[i] * r[order - i]).sum();
        let k = -(r[order + 1] + ahead) / variance;
        let lower = a;
        for i in 0..order {
            a[i] = lower[i] + k * lower[order - 1 - i];
        }
        a[order] = k;
        variance *= 1.0 - k * k;
    }
    variance
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_numbers::Random;

    /// `n ln s^2` from the samples alone: normal equations, solved by elimination.
    fn brute(signal: &[f64]) -> f64 {
        let n = signal.len();
        let r = |lag: usize| (lag..n).map(|i| signal[i] * signal[i - lag]).sum::<f64>() / n as f64;
        let mut rows: Vec<Vec<f64>> =
            (1..=ORDER).map(|i| (1..=ORDER).map(|j| r(i.abs_diff(j))).chain([-r(i)]).collect()).collect();
        for i in 0..ORDER {
            for j in 0..ORDER {
                if j != i {
                    let factor = rows[j][i] / rows[i][i];
                    let pivot = rows[i].clone();
                    rows[j].iter_mut().zip(&pivot).for_each(|(x, p)| *x -= factor * p);
                }
            }
        }
        let explained: f64 = (0..ORDER).map(|i| rows[i][ORDER] / rows[i][i] * r(i + 1)).sum();
        n as f64 * (r(0) + explained).ln()
    }

    #[test]
    fn cost_of_blocks_depends_on_their_samples_alone() {
        let mut random = Random::new(6);
        let mut signal = vec![0.0; 300];
        for n in 2..300 {
            signal[n] = 1.4 * signal[n - 1] - 0.8 * signal[n - 2] + random.normal();
        }
        // A loud sample right before a border must not count behind it.
        signal[49] = 500.0;
        for len in [5, 10] {
            let products = Products::new(&signal, len);
            for (from, to) in [(0, 300), (0, 50), (50, 300), (50, 100), (100, 250)] {
                let (found, want) = (products.cost(from / len, to / len), brute(&signal[from..to]));
                assert!((found - want).abs() < 1e-6 * want.abs(), "{from} to {to}: {found}, not {want}");
            }
        }
    }

    /// 4 s of either power are separated where `8000 (ln (1 + r) / 2 - ln(r) / 2)` is above `10 ln 8000 =
    /// 90`: it is 163 for a ratio of 1.5, 9 for 1.1.
    #[test]
    fn least_change_is_that_of_the_criterion() {
        for (ratio, told) in [(1.5f64, true), (1.1, false)] {
            for seed in 0..5 {
                let mut random = Random::new(seed);
                let mut signal = vec![0.0; 8000];
                for n in 2..8000 {
                    let level = if n < 4000 { 1.0 } else { ratio.sqrt() };
                    signal[n] = 1.4 * signal[n - 1] - 0.8 * signal[n - 2] + level * random.normal();
                }
                let found = Products::new(&signal, 10).change(&(0..800), 20);
                assert_eq!(found.is_some(), told, "{ratio}, seed {seed}: {found:?}");
                assert!(found.is_none_or(|cut| cut.abs_diff(400) < 60), "{found:?}");
            }
        }
    }
}
