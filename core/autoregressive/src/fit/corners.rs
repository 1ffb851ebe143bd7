//! Pieces at one speed and force become one model, and triangles join the models.

use asperity_numbers::Elementary as _;
use std::f64::consts::PI;

use super::super::triangles::range;
use super::super::{Filter, Model, Triangles, is_stable, line_spectrum};
use super::Settings;
use super::blocks::{Blocks, Span};
use super::burg::Lattice;

/// Least bandwidth of a resonance in Hz.
const BANDWIDTH_HZ: f64 = 0.3;
/// A piece with less than this part of the samples of a neighbour's longest piece is a way to or from it.
const WAY: f64 = 0.1;
/// Largest distance of a way, in tolerances.
const WAY_TOLERANCES: f64 = 3.0;
/// Factor on the tolerances while there are too many models.
const WIDER: f64 = 1.25;
/// Border triangles thinner than this are removed: height over longest side.
const THIN: f64 = 0.01;
/// Largest part of the hull's area to remove.
const AREA: f64 = 0.005;

/// A piece, or several merged ones with the means of place, mean square and lines.
#[derive(Clone)]
struct Corner {
    samples: f64,
    /// Samples of its longest piece.
    longest: f64,
    /// Speed in mm/s and force in N.
    place: [f64; 2],
    mean_square: f64,
    lines: Vec<f64>,
    pieces: Vec<usize>,
}

impl Corner {
    /// Whether it is so short beside another that the other tells its spectrum better.
    fn is_way_to(&self, other: &Self) -> bool {
        self.samples < WAY * other.longest
    }

    /// Merges another. A way does not count.
    fn absorb(&mut self, other: &Self) {
        self.pieces.extend(&other.pieces);
        if other.is_way_to(self) {
            return;
        }
        self.longest = self.longest.max(other.longest);
        self.samples += other.samples;
        let part = other.samples / self.samples;
        let mean = |x: &mut f64, y: f64| *x += part * (y - *x);
        mean(&mut self.mean_square, other.mean_square);
        self.place.iter_mut().zip(other.place).for_each(|(x, y)| mean(x, y));
        self.lines.iter_mut().zip(&other.lines).for_each(|(x, y)| mean(x, *y));
    }

    fn model(&self) -> Model {
        let mut ar = vec![0.0; self.lines.len()];
        line_spectrum::to_polynomial(&self.lines, &mut ar);
        let variance = self.mean_square / Filter::new(&ar, &[], 1.0).variance();
        let [speed_mm_s, force_n] = self.place;
        Model { ar, ma: Vec::new(), variance, gain: 1.0, speed_mm_s, force_n }
    }
}

/// The models by speed, then force, and the number of each piece's model.
pub(super) fn merge(
    blocks: &Blocks,
    pieces: &[Span],
    lattices: &[Lattice],
    order: usize,
    settings: &Settings,
) -> (Vec<Model>, Vec<usize>) {
    let mut corners: Vec<Corner> = pieces
        .iter()
        .zip(lattices)
        .enumerate()
        .map(|(i, (piece, lattice))| Corner {
            samples: (piece.len() * blocks.len) as f64,
            longest: (piece.len() * blocks.len) as f64,
            place: blocks.mean(piece),
            mean_square: lattice.residual(0),
            lines: lines(&lattice.coefficients(order), blocks.rate_hz),
            pieces: vec![i],
        })
        .collect();
    let mut wider = 1.0;
    loop {
        let before = corners.len();
        corners = joined(corners, settings, wider);
        if corners.len() < before {
            continue;
        }
        if corners.len() <= settings.most_models {
            break;
        }
        wider *= WIDER;
    }
    corners.sort_by(|a, b| a.place[0].total_cmp(&b.place[0]).then(a.place[1].total_cmp(&b.place[1])));
    let mut owners = vec![0; pieces.len()];
    for (number, corner) in corners.iter().enumerate() {
        for &piece in &corner.pieces {
            owners[piece] = number;
        }
    }
    (corners.iter().map(Corner::model).collect(), owners)
}

/// Merges each corner, the longest first, into the nearest earlier one within tolerance, or keeps it.
fn joined(mut corners: Vec<Corner>, settings: &Settings, wider: f64) -> Vec<Corner> {
    corners.sort_by(|a, b| b.samples.total_cmp(&a.samples));
    // Places to compare with stay fixed during a round.
    let mut kept: Vec<([f64; 2], Corner)> = Vec::new();
    for corner in corners {
        let away = |place: [f64; 2]| {
            let tolerance = settings.tolerance.of(place);
            let off = |axis: usize| (corner.place[axis] - place[axis]).abs() / (wider * tolerance[axis]);
            off(0).max(off(1))
        };
        let nearest = kept
            .iter_mut()
            .map(|(place, kept)| (away(*place), kept))
            .filter(|(away, kept)| *away < if corner.is_way_to(kept) { WAY_TOLERANCES } else { 1.0 })
            .min_by(|a, b| a.0.total_cmp(&b.0));
        match nearest {
            Some((_, kept)) => kept.absorb(&corner),
            None => kept.push((corner.place, corner)),
        }
    }
    kept.into_iter().map(|(_, corner)| corner).collect()
}

/// Line spectral frequencies. Resonances are widened where they are too narrow or cannot be separated.
fn lines(ar: &[f64], rate_hz: f64) -> Vec<f64> {
    let radius = (-PI * BANDWIDTH_HZ / rate_hz).exp_e();
    // The polynomial with the roots of `a` times `by`.
    let moved = |a: &[f64], by: f64| -> Vec<f64> {
        let powers = std::iter::successors(Some(by), |power| Some(power * by));
        a.iter().zip(powers).map(|(c, power)| c * power).collect()
    };
    let mut a = ar.to_vec();
    if !is_stable(&moved(&a, 1.0 / radius)) {
        a = moved(&a, radius);
    }
    // No resonance gets wider than 30 Hz.
    for _ in 0..100 {
        if let Some(lines) = line_spectrum::from_polynomial(&a) {
            return lines;
        }
        a = moved(&a, radius);
    }
    // A polynomial without resonances.
    let order = ar.len();
    (1..=order).map(|k| k as f64 * PI / (order + 1) as f64).collect()
}

/// Delaunay's triangles, corners by number, without those on the border that are nearly a line.
pub(super) fn triangles(models: &[Model]) -> Vec<[usize; 3]> {
    let points: Vec<[f64; 2]> = models.iter().map(Model::place).collect();
    let extent = [0, 1].map(|axis| {
        let [low, high] = range(points.iter().map(|p| p[axis]));
        if high > low { high - low } else { 1.0 }
    });
    let between = |a: usize, b: usize| [0, 1].map(|axis| (points[b][axis] - points[a][axis]) / extent[axis]);
    let area = |&[a, b, c]: &[usize; 3]| {
        let (u, v) = (between(a, b), between(a, c));
        0.5 * (u[0] * v[1] - u[1] * v[0]).abs()
    };
    let mut kept = Triangles::delaunay(&points).corners().to_vec();
    let mut may_go = AREA * kept.iter().map(area).sum::<f64>();
    // Thinness of a triangle whose longest side is on the border.
    let thin = |kept: &[[usize; 3]], triangle: &[usize; 3]| {
        let [a, b, c] = *triangle;
        let length = |&(i, j): &(usize, usize)| between(i, j).into_iter().map(|x| x * x).sum::<f64>().sqrt();
        let longest = [(a, b), (b, c), (c, a)].into_iter().max_by(|x, y| length(x).total_cmp(&length(y)))?;
        let with = kept.iter().filter(|t| t.contains(&longest.0) && t.contains(&longest.1)).count();
        let thinness = 2.0 * area(triangle) / length(&longest).powi(2);
        (with == 1 && thinness < THIN).then_some(thinness)
    };
    // Each removal opens the border to the triangle behind.
    loop {
        let small = (0..kept.len()).filter(|i| area(&kept[*i]) <= may_go);
        let thinnest =
            small.filter_map(|i| Some((thin(&kept, &kept[i])?, i))).min_by(|a, b| a.0.total_cmp(&b.0));
        match thinnest {
            Some((_, i)) if kept.len() > 1 => may_go -= area(&kept.swap_remove(i)),
            _ => return kept,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::Texture;
    use super::*;

    fn model(speed_mm_s: f64, force_n: f64) -> Model {
        Model { ar: vec![], ma: vec![], variance: speed_mm_s, gain: 1.0, speed_mm_s, force_n }
    }

    #[test]
    fn model_just_within_the_border_counts_beyond_it() {
        let places = [[50.0, 0.6], [120.0, 0.603], [250.0, 0.601], [50.0, 2.0], [250.0, 2.0]];
        let models = places.map(|[v, f]| model(v, f)).to_vec();
        let variance = |triangles: Option<&[[usize; 3]]>| {
            let texture = Texture::new(1000.0, models.clone(), triangles).unwrap();
            texture.at(120.0, 0.5).deviation.powi(2)
        };
        let kept = triangles(&models);
        assert_eq!(kept.len(), 3);
        // The neighbours' weights are 180 and 70 parts of 250; variances are the speeds.
        assert!((variance(Some(&kept)) - 120.0).abs() < 1.0);
        let other = Texture::new(1000.0, models.clone(), None).unwrap();
        assert_eq!(other.triangles().corners().len(), 4);
    }

    #[test]
    fn triangle_not_thin_or_not_on_the_border_stays() {
        let square = [(0.0, 0.0), (100.0, 0.0), (100.0, 1.0), (0.0, 1.0)].map(|(v, f)| model(v, f));
        assert_eq!(triangles(&square).len(), 2);
        assert_eq!(triangles(&square[..3]).len(), 1);
        // Nearly on a line: one triangle is left.
        let line = [(0.0, 0.0), (50.0, 0.5001), (100.0, 1.0)].map(|(v, f)| model(v, f));
        assert_eq!(triangles(&line).len(), 1);
        assert!(triangles(&line[..2]).is_empty() && triangles(&line[..1]).is_empty());
        // Thin, but within.
        let mut within = square.to_vec();
        within.extend([model(45.0, 0.5), model(55.0, 0.5), model(50.0, 0.50001)]);
        let points: Vec<[f64; 2]> = within.iter().map(Model::place).collect();
        assert_eq!(triangles(&within).len(), Triangles::delaunay(&points).corners().len());
    }
}
