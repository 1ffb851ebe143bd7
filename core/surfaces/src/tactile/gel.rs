use crate::topography::HeightField;
use crate::topography::spectrum::blur;
use asperity_numbers::Elementary as _;

/// Placement of the gel on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Press {
    /// Middle of the camera's field on the surface, in millimetres.
    pub place_mm: [f64; 2],
    /// Turn of the surface in radians.
    pub turn: f64,
    /// Depth of the gel below the highest points in millimetres.
    pub depth_mm: f64,
}

/// Part of the highest points taken as dust or stray fibres; the gel closes over them.
const STRAY: f64 = 0.002;
/// Widths of the blurs in millimetres, from wide to narrow.
const WIDTHS_MM: [f64; 4] = [0.8, 0.3, 0.12, 0.05];
/// Sag of the gel into a valley as a part of its span; it fills shallower valleys. A half-space of
/// modulus `E` under the pressure `p` fills waves of slope up to about `2 p / E`; this is for a tenth
/// of the modulus.
const SAG: f64 = 0.09;
/// Last blur in millimetres, by the skin's own thickness.
const SKIN_MM: f64 = 0.025;

/// Skin of a gel pressed onto a surface, in millimetres over the surface's zero. The grid has `side`
/// points `step_mm` apart around the press. Its rim is invalid, as the patch is taken to repeat.
pub fn indentation(surface: &HeightField, press: &Press, (side, step_mm): (usize, f64)) -> HeightField {
    let touching = pressed(&relief(surface, press, (side, step_mm)), press.depth_mm);
    let mut skin = touching.clone();
    for width in WIDTHS_MM {
        skin = blur(&skin, width);
        let sag = (SAG * width) as f32;
        // The gel stays outside the surface and rests on its tops.
        for (skin, relief) in skin.heights_mut().iter_mut().zip(touching.heights()) {
            *skin = (*skin - sag).max(*relief);
        }
    }
    blur(&skin, SKIN_MM)
}

/// Surface under the gel on its turned grid: means of four places a point, so detail finer than the
/// grid fades.
fn relief(surface: &HeightField, press: &Press, (side, step_mm): (usize, f64)) -> HeightField {
    let (sin, cos) = press.turn.sine_cosine();
    let middle = 0.5 * side as f64 * step_mm;
    let [px, py] = press.place_mm;
    let quarter = 0.25 * step_mm;
    let corners = [(-quarter, -quarter), (quarter, -quarter), (-quarter, quarter), (quarter, quarter)];
    HeightField::from_fn(side, step_mm, |x, y| {
        let at = |(dx, dy): (f64, f64)| {
            let (u, v) = (x - middle + dx, y - middle + dy);
            surface.level(px + u * cos - v * sin, py + u * sin + v * cos)
        };
        0.25 * corners.into_iter().map(at).sum::<f64>()
    })
}

/// Cuts off everything deeper than the press.
fn pressed(relief: &HeightField, depth_mm: f64) -> HeightField {
    let mut sorted: Vec<f32> = relief.heights().to_vec();
    let top = ((1.0 - STRAY) * sorted.len() as f64) as usize;
    let last = sorted.len() - 1;
    let (_, top, _) = sorted.select_nth_unstable_by(top.min(last), f32::total_cmp);
    let floor = *top - depth_mm as f32;
    let mut touching = relief.clone();
    touching.heights_mut().iter_mut().for_each(|h| *h = h.max(floor));
    touching
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gel_follows_wide_waves_and_spans_narrow_grooves() {
        let press = Press { place_mm: [10.0, 10.0], turn: 0.0, depth_mm: 0.6 };
        let hang = |period: f64| {
            let surface =
                HeightField::from_fn(1024, 0.02, |x, _| if (x / period).fract() < 0.5 { 0.0 } else { -0.5 });
            let skin = indentation(&surface, &press, (256, 0.06));
            let line: Vec<f32> = (64..192).map(|x| skin.point(x, 128)).collect();
            let (low, high) = line.iter().fold((f32::MAX, f32::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
            f64::from(high - low)
        };
        let [wide, narrow] = [hang(5.12), hang(0.256)];
        assert!(wide > 0.4, "{wide}");
        assert!(narrow < 0.25, "{narrow}");
    }

    #[test]
    fn a_light_press_touches_less_than_a_firm_one() {
        let surface = HeightField::from_fn(512, 0.04, |x, y| 0.2 * (x * 3.0).sin() * (y * 2.5).cos());
        let hollow = |depth_mm: f64| {
            let skin =
                indentation(&surface, &Press { place_mm: [8.0, 9.0], turn: 0.3, depth_mm }, (256, 0.06));
            skin.rms_mm()
        };
        assert!(hollow(0.05) < 0.8 * hollow(0.3));
    }
}
