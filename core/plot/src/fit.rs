//! A texture fitted to a recording: models over speed and force, and their spectra beside the recorded ones.

use super::axis::{Axis, Panel, padded_range};
use super::svg::{COLOURS, Svg, polyline};

/// Spectra of a model: recorded and fitted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spectrum {
    /// Label of the model.
    pub label: String,
    /// Remark beside the label, such as its error.
    pub remark: String,
    /// Recorded: frequency in Hz and level in dB.
    pub measured: Vec<(f64, f64)>,
    /// The same of the model.
    pub model: Vec<(f64, f64)>,
}

/// A fitted texture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fit {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading.
    pub subtitle: String,
    /// Speed in mm/s and force in N of each model.
    pub corners: Vec<[f64; 2]>,
    /// Triangles between them, by index.
    pub triangles: Vec<[usize; 3]>,
    /// Speed and force of each fitted piece of the recording.
    pub pieces: Vec<[f64; 2]>,
    /// Unit of the levels.
    pub unit: String,
    /// Spectra, two in a row.
    pub spectra: Vec<Spectrum>,
}

const LEFT: f64 = 64.0;
const TOP: f64 = 104.0;
const BOTTOM: f64 = 52.0;
/// Size of the plane of speed and force.
const PLANE: [f64; 2] = [480.0, 400.0];
/// Size of a spectrum, and the room between two.
const PANEL: [f64; 2] = [260.0, 110.0];
const GAP: [f64; 2] = [56.0, 46.0];
/// Left edge of the spectra.
const RIGHT: f64 = LEFT + PLANE[0] + 76.0;
/// Levels are shown down to this far below the greatest of all.
const RANGE_DB: f64 = 60.0;
const TRIANGLE: &str =
    "fill=\"#0a6fb0\" fill-opacity=\"0.06\" stroke=\"#0a6fb0\" stroke-width=\"1\" stroke-linejoin=\"round\"";
const LINE: &str = "stroke=\"#d1602a\" stroke-width=\"1.6\" fill=\"none\" stroke-linejoin=\"round\"";

impl Fit {
    /// The texture as an SVG document.
    pub fn to_svg(&self) -> String {
        let rows = self.spectra.len().div_ceil(2);
        let spectra = rows as f64 * (PANEL[1] + GAP[1]);
        let width = if rows == 0 { RIGHT } else { RIGHT + 2.0 * (PANEL[0] + GAP[0]) };
        let height = TOP + PLANE[1].max(spectra - GAP[1]) + BOTTOM;
        let mut svg = Svg::chart([width, height], LEFT, &self.title, &[&self.subtitle]);
        svg.heading([LEFT, TOP - 12.0], "Models", "over speed and force; grey dots are the fitted pieces");
        self.plane(&mut svg);
        if let Some((x, y)) = self.axes() {
            for (i, spectrum) in self.spectra.iter().enumerate() {
                let left = RIGHT + (i % 2) as f64 * (PANEL[0] + GAP[0]);
                let top = TOP + (i / 2) as f64 * (PANEL[1] + GAP[1]);
                let x = Axis { pixels: [left, left + PANEL[0]], ..x };
                let panel = Panel { x, y: Axis { pixels: [top + PANEL[1], top], ..y } };
                spectrum.draw(&mut svg, &panel);
                // The last of a column has the frequencies below it.
                if i + 2 >= self.spectra.len() {
                    panel.x_labels(&mut svg, 0.0, "");
                }
            }
            let (end, below) = (width - GAP[0], TOP + spectra - GAP[1] + 38.0);
            svg.text([0.5 * (RIGHT + end), below], "middle", "ink", "Frequency, Hz");
            svg.text([end, 57.0], "end", "", &format!("recorded (dots) and model (line), {}", self.unit));
        }
        svg.finish()
    }

    /// The axes that all spectra share: logarithmic frequency, and level.
    fn axes(&self) -> Option<(Axis, Axis)> {
        let all = || self.spectra.iter().flat_map(|s| s.measured.iter().chain(&s.model)).filter(shown);
        let least = |of: fn(&(f64, f64)) -> f64| all().map(of).fold(f64::MAX, f64::min);
        let greatest = |of: fn(&(f64, f64)) -> f64| all().map(of).fold(f64::MIN, f64::max);
        let (low, high) = (least(|p| p.0.log10()), greatest(|p| p.0.log10()));
        if low >= high {
            return None;
        }
        let loudest = greatest(|p| p.1);
        let quietest = least(|p| p.1).max(loudest - RANGE_DB);
        let x = Axis { low, high, pixels: [0.0, 1.0], logarithmic: true };
        Some((x, Axis::around([quietest, loudest].into_iter(), false, [1.0, 0.0])?))
    }

    /// Draws the models over speed and force.
    fn plane(&self, svg: &mut Svg) {
        let range = |axis: usize| padded_range(self.corners.iter().chain(&self.pieces).map(|p| p[axis]));
        let (Some(speeds), Some(forces)) = (range(0), range(1)) else {
            svg.text([LEFT, TOP + 24.0], "start", "", "no data");
            return;
        };
        let bottom = TOP + PLANE[1];
        let panel = Panel {
            x: Axis::linear((speeds.0.max(0.0), speeds.1), [LEFT, LEFT + PLANE[0]]),
            y: Axis::linear((forces.0.max(0.0), forces.1), [bottom, TOP]),
        };
        panel.x_grid(svg, 80.0);
        panel.x_labels(svg, 80.0, "");
        panel.y_grid(svg, &panel.y.ticks(50.0));
        let place = |[speed, force]: [f64; 2]| panel.at((speed, force));
        for triangle in &self.triangles {
            let corners = triangle.iter().filter_map(|i| self.corners.get(*i)).map(|c| place(*c));
            svg.path(&(polyline(corners) + "Z"), TRIANGLE);
        }
        for piece in &self.pieces {
            circle(svg, place(*piece), 2.2, "#8a97a5");
        }
        for (i, corner) in self.corners.iter().enumerate() {
            let [cx, cy] = place(*corner);
            circle(svg, [cx, cy], 4.5, COLOURS[0]);
            svg.text([cx + 7.0, cy - 5.0], "start", "wire", &i.to_string());
        }
        panel.frame(svg);
        svg.text([LEFT + 0.5 * PLANE[0], bottom + 38.0], "middle", "ink", "Speed, mm/s");
        svg.text([LEFT - 44.0, TOP - 12.0], "start", "ink", "N");
    }
}

impl Spectrum {
    fn draw(&self, svg: &mut Svg, panel: &Panel) {
        svg.heading([panel.x.pixels[0], panel.y.pixels[1] - 9.0], &self.label, &self.remark);
        panel.x_grid(svg, 0.0);
        panel.y_grid(svg, &panel.y.ticks(34.0));
        for point in self.measured.iter().filter(|p| shown(p) && p.1 >= panel.y.low) {
            circle(svg, panel.at(*point), 1.7, COLOURS[0]);
        }
        let model: Vec<(f64, f64)> = self.model.iter().filter(shown).copied().collect();
        svg.path(&panel.line(&model), LINE);
        panel.frame(svg);
    }
}

/// Whether a point has a place over logarithmic frequency.
fn shown((hz, db): &&(f64, f64)) -> bool {
    *hz > 0.0 && hz.is_finite() && db.is_finite()
}

fn circle(svg: &mut Svg, at: [f64; 2], radius: f64, colour: &str) {
    svg.circle(at, radius, &format!("fill=\"{colour}\" fill-opacity=\"0.75\""));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::tags;

    fn spectrum(level: f64) -> Spectrum {
        let at = |i: i32| (10.0 * f64::from(i), level - f64::from(i));
        Spectrum {
            label: "1 <one>".into(),
            remark: "0.3 dB & less".into(),
            measured: (0..=40).map(at).collect(),
            model: (1..=40).map(at).collect(),
        }
    }

    #[test]
    fn models_pieces_and_spectra_are_drawn() {
        let fit = Fit {
            title: "A <title>".into(),
            corners: vec![[50.0, 0.5], [250.0, 0.5], [250.0, 2.5], [50.0, 2.5]],
            triangles: vec![[0, 1, 2], [0, 2, 3], [0, 9, 1]],
            pieces: vec![[48.0, 0.5], [251.0, 2.4]],
            spectra: vec![spectrum(-10.0), spectrum(f64::NAN), spectrum(-20.0)],
            ..Fit::default()
        };
        let svg = fit.to_svg();
        // Without 0 Hz, which has no logarithm.
        assert_eq!(tags(&svg)["circle"], 4 + 2 + 2 * 40);
        assert_eq!((svg.matches(TRIANGLE).count(), svg.matches(LINE).count()), (3, 2));
        assert!(
            svg.contains("1 &lt;one&gt;") && svg.contains("0.3 dB &amp; less") && svg.contains(">3</text>")
        );
    }

    #[test]
    fn far_levels_are_left_out_and_lines_stay_inside() {
        let loud = Spectrum {
            measured: vec![(10.0, 50.0), (20.0, -90.0)],
            model: vec![(10.0, 50.0), (20.0, -90.0)],
            ..Spectrum::default()
        };
        let svg = Fit { spectra: vec![loud], ..Fit::default() }.to_svg();
        assert_eq!(tags(&svg)["circle"], 1);
        assert!(svg.contains(&format!("L{} {}\" {LINE}", RIGHT + PANEL[0], TOP + PANEL[1])));
    }

    #[test]
    fn empty_single_and_odd_models_are_drawn() {
        assert!(Fit::default().to_svg().contains("no data"));
        let one = Fit { corners: vec![[50.0, 1.0]], spectra: vec![Spectrum::default()], ..Fit::default() };
        assert_eq!(tags(&one.to_svg())["circle"], 1);
        let odd = Fit { corners: vec![[f64::NAN, 1.0], [f64::INFINITY, 1.0]], ..Fit::default() };
        tags(&odd.to_svg());
    }
}
