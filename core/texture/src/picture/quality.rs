//! A picture's own quality, before an encoder sees it: blank, saturated or out of focus.
//!
//! Limits are those that 1,792 made tactile images, the shipped pictures (JPEG) and 24 real GelSight
//! images of two sensors keep, with a margin:
//!
//! | figure | limit | made | shipped | real |
//! |---|---|---|---|---|
//! | contrast | at least 2 | 3.9 or more | 5.6 or more | 21 or more |
//! | saturated | at most 0.15 | 0.078 or less | 0.032 or less | 0.001 or less |
//! | sharpness | at least 0.37 | 0.38 or more | 0.47 or more | 0.63 or more |
//! | detail, without sharpness | at least 0.35 | 0.64 or more | 0.50 or more | |
//!
//! A picture's sharpness is that of its sharpest parts, a ratio of two octaves, as focus measures use
//! them (Pertuz, Puig, Garcia 2013, "Analysis of focus measure operators for shape-from-focus"). It tells
//! a blur of the picture. It does not tell a lens out of focus behind a noisy camera: that looks like a
//! smoother surface.

use super::{Image, plane::Plane};

/// Least [contrast](Quality::contrast).
const LEAST_CONTRAST: f64 = 2.0;
/// Largest [saturated](Quality::saturated) part.
const MOST_SATURATED: f64 = 0.15;
/// Least [sharpness](Quality::sharpness).
const LEAST_SHARPNESS: f64 = 0.37;
/// Least [detail](Quality::detail) of a picture without sharpness.
const LEAST_DETAIL: f64 = 0.35;

/// Side of a part of a picture in pixels.
const PART: usize = 16;
/// A part has a sharpness if its coarser octave has so many levels.
const LEAST_COARSE: f64 = 2.0;
/// A picture has a sharpness if so many parts have one.
const LEAST_PARTS: usize = 8;
/// The picture's sharpness is this quantile of theirs.
const SHARPEST: f64 = 0.95;

/// Figures of a picture's quality.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Largest standard deviation of a channel, in levels of 255.
    pub contrast: f64,
    /// Share of the values that are black or white: at most 1, or at least 254.
    pub saturated: f64,
    /// Standard deviation of the finest octave in the channel that has most of it, in levels.
    pub detail: f64,
    /// Finest octave over the next one, in the sharpest parts. `None` if too few parts have a next one.
    pub sharpness: Option<f64>,
}

impl Quality {
    /// Measures a picture.
    pub fn of(image: &Image) -> Self {
        let (mut contrast, mut detail, mut ratios) = (0.0_f64, 0.0_f64, Vec::new());
        for channel in 0..3 {
            let values = image.pixels.iter().skip(channel).step_by(3).map(|x| f64::from(*x)).collect();
            let plane = Plane { width: image.size[1], values };
            let blurred = plane.blurred(1);
            let fine = plane.without(&blurred, 1);
            let coarse = blurred.without(&blurred.blurred(2), 2);
            contrast = contrast.max(plane.deviation());
            detail = detail.max(fine.deviation());
            let parts = fine.inner(2).blocks(PART).into_iter().zip(coarse.blocks(PART));
            ratios.extend(
                parts.filter(|(_, coarse)| *coarse > LEAST_COARSE).map(|(fine, coarse)| fine / coarse),
            );
        }
        ratios.sort_by(f64::total_cmp);
        let at = (SHARPEST * ratios.len().saturating_sub(1) as f64) as usize;
        let sharpness = ratios.get(at).copied().filter(|_| ratios.len() >= LEAST_PARTS);
        let ends = image.pixels.iter().filter(|x| **x <= 1 || **x >= 254).count();
        let saturated = ends as f64 / image.pixels.len().max(1) as f64;
        Self { contrast, saturated, detail, sharpness }
    }

    /// The fault that makes the picture useless, with figure and limit, and a remedy.
    pub fn fault(&self) -> Option<(String, &'static str)> {
        let Self { contrast, saturated, detail, sharpness } = *self;
        let focus = "focus the camera; do not blur, denoise or enlarge the picture";
        if contrast < LEAST_CONTRAST {
            let what = format!("this picture is blank: its contrast is {contrast:.1} levels of 255");
            let help = "is the light on, the lens free, and the gel pressed onto the surface?";
            return Some((format!("{what}, and {LEAST_CONTRAST} is the least"), help));
        }
        if saturated > MOST_SATURATED {
            let part = 100.0 * saturated;
            let what = format!("this picture is saturated: {part:.0} % of its values are black or white");
            let help = "change the exposure or the light until few values are 0 or 255";
            return Some((format!("{what}, and {:.0} % is the most", 100.0 * MOST_SATURATED), help));
        }
        match sharpness {
            Some(sharpness) if sharpness < LEAST_SHARPNESS => {
                let what = format!("this picture is out of focus: its sharpness is {sharpness:.2}");
                Some((format!("{what}, and {LEAST_SHARPNESS} is the least"), focus))
            }
            None if detail < LEAST_DETAIL => {
                let what =
                    format!("this picture is out of focus: its finest detail has {detail:.2} levels of 255");
                Some((format!("{what}, and {LEAST_DETAIL} is the least"), focus))
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::IMAGE;

    /// A picture from levels by row and column.
    fn picture(level: impl Fn(usize, usize) -> f64) -> Image {
        let [rows, columns] = IMAGE;
        let all = (0..rows * columns).map(|at| level(at / columns, at % columns).clamp(0.0, 255.0) as u8);
        Image { size: IMAGE, pixels: all.flat_map(|x| [x; 3]).collect() }
    }

    fn fault(level: impl Fn(usize, usize) -> f64) -> String {
        Quality::of(&picture(level)).fault().map(|(what, _)| what).unwrap_or_default()
    }

    #[test]
    fn each_fault_is_told_with_its_figure() {
        assert!(fault(|_, _| 128.0).contains("blank: its contrast is 0.0"));
        assert!(fault(|_, x| if x % 4 < 2 { 0.0 } else { 100.0 }).contains("saturated: 50 %"));
        assert!(fault(|_, x| if x % 4 < 2 { 40.0 } else { 100.0 }).is_empty());
        assert!(fault(|_, x| 128.0 + 60.0 * (x as f64 * 0.5).sin()).contains("sharpness is 0.2"));
        assert!(fault(|_, x| 40.0 + 0.5 * x as f64).contains("finest detail"));
    }

    #[test]
    fn sharpness_of_a_wave_is_that_of_its_two_octaves() {
        // The blurs leave (cos^2(w / 2), cos^2(w)) of a wave of w radians a pixel.
        let w = 0.9_f64;
        let (near, far) = ((0.5 * w).cos().powi(2), w.cos().powi(2));
        let quality = Quality::of(&picture(|_, x| 128.5 + 100.0 * (w * x as f64).sin()));
        let found = quality.sharpness.unwrap();
        let expected = (1.0 - near) / (near * (1.0 - far));
        assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
    }
}
