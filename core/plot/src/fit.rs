//! A texture that was fitted to a recording: where its models are, the triangles between them, and their spectra beside those recorded.

use super::axis::{Axis, padded_range};
use super::dots::powers;
use super::svg::{Svg, num};

/// A model's spectrum, measured and fitted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spectrum {
    /// Which model it is.
    pub label: String,
    /// What is said of it, such as how far it is off.
    pub remark: String,
    /// Frequency in Hz and level in dB of what was recorded.
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
    /// Triangles between them, by number from 0.
    pub triangles: Vec<[usize; 3]>,
    /// Speed and force of each piece of the recording that was fitted.
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
/// Where spectra begin.
const RIGHT: f64 = LEFT + PLANE[0] + 76.0;
/// Levels that are shown, below the greatest of all.
const RANGE_DB: f64 = 60.0;
const GRID: &str = "stroke=\"#e4e9ee\" stroke-width=\"1\" fill=\"none\" shape-rendering=\"crispEdges\"";
const FRAME: &str = "stroke=\"#b8c2cc\" stroke-width=\"1\" fill=\"none\" shape-rendering=\"crispEdges\"";
const TRIANGLE: &str =
    "fill=\"#0a6fb0\" fill-opacity=\"0.06\" stroke=\"#0a6fb0\" stroke-width=\"1\" stroke-linejoin=\"round\"";
const LINE: &str = "stroke=\"#d1602a\" stroke-width=\"1.6\" fill=\"none\" stroke-linejoin=\"round\"";
const MEASURED: &str = "#0a6fb0";

impl Fit {
    /// The texture as an SVG document.
    pub fn to_svg(&self) -> String {
        let rows = self.spectra.len().div_ceil(2);
        let spectra = rows as f64 * (PANEL[1] + GAP[1]);
        let width = if rows == 0 { RIGHT } else { RIGHT + 2.0 * (PANEL[0] + GAP[0]) };
        let mut svg = Svg::new(width, TOP + PLANE[1].max(spectra - GAP[1]) + BOTTOM, &self.title);
        svg.text([LEFT, 36.0], "start", "title", &self.title);
        svg.text([LEFT, 57.0], "start", "", &self.subtitle);
        svg.heading([LEFT, TOP - 12.0], "Models", "over speed and force; dots are the pieces they are of");
        self.plane(&mut svg);
        if let Some((x, y)) = self.axes() {
            for (i, spectrum) in self.spectra.iter().enumerate() {
                let left = RIGHT + (i % 2) as f64 * (PANEL[0] + GAP[0]);
                let top = TOP + (i / 2) as f64 * (PANEL[1] + GAP[1]);
                // The last of a column has the frequencies below it.
                let last = i + 2 >= self.spectra.len();
                let x = Axis { pixels: [left, left + PANEL[0]], ..x };
                spectrum.draw(&mut svg, &x, &Axis { pixels: [top + PANEL[1], top], ..y }, last);
            }
            let (end, below) = (width - GAP[0], TOP + spectra - GAP[1] + 38.0);
            svg.text([0.5 * (RIGHT + end), below], "middle", "ink", "Frequency, Hz");
            svg.text([end, 57.0], "end", "", &format!("recorded (dots) and model (line), {}", self.unit));
        }
        svg.finish()
    }

    /// Frequencies, by their logarithm, and levels that all spectra are shown over.
    fn axes(&self) -> Option<(Axis, Axis)> {
        let all = || self.spectra.iter().flat_map(|s| s.measured.iter().chain(&s.model)).filter(shown);
        let hz = |p: &(f64, f64)| p.0.log10();
        let low = all().map(hz).fold(f64::MAX, f64::min);
        let high = all().map(hz).fold(f64::MIN, f64::max);
        let loudest = all().map(|p| p.1).fold(f64::MIN, f64::max);
        if low >= high {
            return None;
        }
        let quietest = all().map(|p| p.1).fold(f64::MAX, f64::min).max(loudest - RANGE_DB);
        let (bottom, top) = padded_range([quietest, loudest].into_iter())?;
        Some((Axis { low, high, pixels: [0.0, 1.0] }, Axis { low: bottom, high: top, pixels: [1.0, 0.0] }))
    }

    /// Speed and force.
    fn plane(&self, svg: &mut Svg) {
        let range = |axis: usize| padded_range(self.corners.iter().chain(&self.pieces).map(|p| p[axis]));
        let (Some(speeds), Some(forces)) = (range(0), range(1)) else {
            svg.text([LEFT, TOP + 24.0], "start", "", "no data");
            return;
        };
        let x = Axis { low: speeds.0.max(0.0), high: speeds.1, pixels: [LEFT, LEFT + PLANE[0]] };
        let y = Axis { low: forces.0.max(0.0), high: forces.1, pixels: [TOP + PLANE[1], TOP] };
        let mut grid = String::new();
        for (at, label) in x.ticks(80.0) {
            grid += &format!("M{} {}v{}", num(x.at(at)), num(TOP), num(PLANE[1]));
            svg.text([x.at(at), TOP + PLANE[1] + 18.0], "middle", "small", &label);
        }
        for (at, label) in y.ticks(50.0) {
            grid += &format!("M{} {}h{}", num(LEFT), num(y.at(at)), num(PLANE[0]));
            svg.text([LEFT - 8.0, y.at(at) + 4.0], "end", "small", &label);
        }
        svg.path(&grid, GRID);
        let place = |[speed, force]: [f64; 2]| [x.at(speed), y.at(force)];
        for triangle in &self.triangles {
            let corners = triangle.iter().filter_map(|i| self.corners.get(*i)).map(|c| place(*c));
            let points: Vec<String> = corners.map(|[a, b]| format!("{} {}", num(a), num(b))).collect();
            svg.path(&format!("M{}Z", points.join("L")), TRIANGLE);
        }
        for [cx, cy] in self.pieces.iter().map(|p| place(*p)) {
            circle(svg, [cx, cy], 2.2, "#8a97a5");
        }
        for (i, corner) in self.corners.iter().enumerate() {
            let [cx, cy] = place(*corner);
            circle(svg, [cx, cy], 4.5, MEASURED);
            svg.text([cx + 7.0, cy - 5.0], "start", "wire", &i.to_string());
        }
        let [left, bottom] = [num(LEFT), num(TOP + PLANE[1])];
        svg.path(&format!("M{left} {}V{bottom}H{}", num(TOP), num(LEFT + PLANE[0])), FRAME);
        svg.text([LEFT + 0.5 * PLANE[0], TOP + PLANE[1] + 38.0], "middle", "ink", "Speed, mm/s");
        svg.text([LEFT - 44.0, TOP - 12.0], "start", "ink", "N");
    }
}

impl Spectrum {
    fn draw(&self, svg: &mut Svg, x: &Axis, y: &Axis, last: bool) {
        let ([left, right], [bottom, top]) = (x.pixels, y.pixels);
        svg.heading([left, top - 9.0], &self.label, &self.remark);
        let mut grid = String::new();
        for (at, label) in powers(x) {
            grid += &format!("M{} {}V{}", num(x.at(at)), num(bottom), num(top));
            if last {
                svg.text([x.at(at), bottom + 18.0], "middle", "small", &label);
            }
        }
        for (at, label) in y.ticks(34.0) {
            grid += &format!("M{} {}H{}", num(left), num(y.at(at)), num(right));
            svg.text([left - 8.0, y.at(at) + 4.0], "end", "small", &label);
        }
        svg.path(&grid, GRID);
        let place = |(hz, db): &(f64, f64)| [x.at(hz.log10()), y.at(db.max(y.low))];
        for [cx, cy] in self.measured.iter().filter(|p| shown(p) && p.1 >= y.low).map(place) {
            circle(svg, [cx, cy], 1.7, MEASURED);
        }
        let line = self.model.iter().filter(shown).map(place);
        let points: Vec<String> = line.map(|[a, b]| format!("{} {}", num(a), num(b))).collect();
        if !points.is_empty() {
            svg.path(&format!("M{}", points.join("L")), LINE);
        }
        svg.path(&format!("M{} {}V{}H{}", num(left), num(top), num(bottom), num(right)), FRAME);
    }
}

/// Whether a place has a logarithm and a level.
fn shown((hz, db): &&(f64, f64)) -> bool {
    *hz > 0.0 && hz.is_finite() && db.is_finite()
}

fn circle(svg: &mut Svg, [cx, cy]: [f64; 2], r: f64, colour: &str) {
    svg.raw(format_args!(
        "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{colour}\" fill-opacity=\"0.75\"/>\n",
        num(cx),
        num(cy),
        num(r)
    ));
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
    fn models_pieces_triangles_and_spectra_are_drawn() {
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
    fn what_is_far_below_the_rest_is_left_out_and_its_line_stays_in_the_frame() {
        let loud = Spectrum {
            measured: vec![(10.0, 50.0), (20.0, -90.0)],
            model: vec![(10.0, 50.0), (20.0, -90.0)],
            ..Spectrum::default()
        };
        let svg = Fit { spectra: vec![loud], ..Fit::default() }.to_svg();
        assert_eq!(tags(&svg)["circle"], 1);
        assert!(svg.contains(&format!("L{} {}\" {LINE}", num(RIGHT + PANEL[0]), num(TOP + PANEL[1]))));
    }

    #[test]
    fn nothing_at_all_is_said_and_one_model_is_drawn() {
        assert!(Fit::default().to_svg().contains("no data"));
        let one = Fit { corners: vec![[50.0, 1.0]], spectra: vec![Spectrum::default()], ..Fit::default() };
        assert_eq!(tags(&one.to_svg())["circle"], 1);
        let odd = Fit { corners: vec![[f64::NAN, 1.0], [f64::INFINITY, 1.0]], ..Fit::default() };
        tags(&odd.to_svg());
    }
}
