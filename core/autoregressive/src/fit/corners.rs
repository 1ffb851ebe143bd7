//! Pieces at one speed and force become one model.

use asperity_numbers::Elementary as _;
use std::f64::consts::PI;

use super::super::{Filter, Model, is_stable, line_spectrum};
use super::Settings;
use super::blocks::{Blocks, Span};
use super::burg::Fitted;

/// Least bandwidth of a resonance in Hz.
const BANDWIDTH_HZ: f64 = 0.3;
/// A piece with less than this part of the samples of a neighbour's longest piece is a way to or from it.
const WAY: f64 = 0.1;
/// Largest distance of a way, in tolerances.
const WAY_TOLERANCES: f64 = 3.0;
const WIDER: f64 = 1.25;

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
    fitted: &[Fitted],
    settings: &Settings,
) -> (Vec<Model>, Vec<usize>) {
    let mut corners: Vec<Corner> = pieces
        .iter()
        .zip(fitted)
        .enumerate()
        .map(|(i, (piece, fitted))| Corner {
            samples: (piece.len() * blocks.len) as f64,
            longest: (piece.len() * blocks.len) as f64,
            place: blocks.mean(piece),
            mean_square: fitted.mean_square,
            lines: lines(&fitted.ar, blocks.rate_hz),
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
    for _ in 0..MOST_WIDENINGS {
        if let Some(lines) = line_spectrum::from_polynomial(&a) {
            return lines;
        }
        a = moved(&a, radius);
    }
    // A polynomial without resonances.
    let order = ar.len();
    (1..=order).map(|k| k as f64 * PI / (order + 1) as f64).collect()
}

/// Limits the width of resonances to 30 Hz.
const MOST_WIDENINGS: usize = 100;
