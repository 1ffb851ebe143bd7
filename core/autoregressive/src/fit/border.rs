//! The triangles between models, without slivers along the border.

use super::super::triangles::range;
use super::super::{Model, Triangles};

/// Border triangles thinner than this are removed: height over longest side.
const THIN: f64 = 0.01;
/// Largest part of the hull's area to remove.
const AREA: f64 = 0.005;

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
        let thinnest = (0..kept.len())
            .filter_map(|i| Some((thin(&kept, &kept[i])?, i)))
            .filter(|(_, i)| area(&kept[*i]) <= may_go)
            .min_by(|a, b| a.0.total_cmp(&b.0));
        match thinnest {
            Some((_, i)) if kept.len() > 1 => may_go -= area(&kept.swap_remove(i)),
            _ => return kept,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Texture;

    fn model(speed_mm_s: f64, force_n: f64) -> Model {
        Model { ar: vec![], ma: vec![], variance: speed_mm_s, gain: 1.0, speed_mm_s, force_n }
    }

    #[test]
    fn model_just_within_the_border_counts_beyond_it() {
        let models = vec![
            model(50.0, 0.6),
            model(120.0, 0.603),
            model(250.0, 0.601),
            model(50.0, 2.0),
            model(250.0, 2.0),
        ];
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
