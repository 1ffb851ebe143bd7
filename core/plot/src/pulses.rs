//! Envelopes of vibrations over time, and how deeply they are modulated over frequency.

use super::axis::Axis;
use super::svg::{Svg, num};

/// A vibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Pulsing {
    /// What made it.
    pub label: String,
    /// Time in s and the envelope over its mean.
    pub envelope: Vec<(f64, f64)>,
    /// Frequency in Hz and modulation depth.
    pub depths: Vec<(f64, f64)>,
}

/// Vibrations of one material, at most four.
#[derive(Clone, Debug, PartialEq)]
pub struct PulsesRow {
    /// Which material.
    pub label: String,
    /// What is said of it.
    pub remark: String,
    /// Its vibrations, each with a strip of its own.
    pub vibrations: Vec<Pulsing>,
}

/// Materials one below the other: envelopes at the left, modulation at the right.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pulses {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading.
    pub subtitle: String,
    /// Materials.
    pub rows: Vec<PulsesRow>,
}

const LEFT: f64 = 64.0;
const TOP: f64 = 104.0;
const STRIP: [f64; 2] = [620.0, 56.0];
/// Room above a strip, for its label.
const STRIPS: f64 = 18.0;
const RIGHT: f64 = LEFT + STRIP[0] + 84.0;
const DEPTHS: f64 = 340.0;
const BETWEEN: f64 = 72.0;
/// Largest envelope that is shown, over its mean.
const MOST: f64 = 3.0;
const COLOURS: [&str; 4] = ["#d1602a", "#0a6fb0", "#6b7785", "#2a8f5a"];
const GRID: &str = "stroke=\"#e4e9ee\" stroke-width=\"1\" fill=\"none\" shape-rendering=\"crispEdges\"";

impl Pulses {
    /// The picture as an SVG document.
    pub fn to_svg(&self) -> String {
        let heights = self.rows.iter().map(|row| row.height() + BETWEEN);
        let mut svg = Svg::new(RIGHT + DEPTHS + 40.0, TOP + heights.sum::<f64>(), &self.title);
        svg.text([LEFT, 36.0], "start", "title", &self.title);
        svg.text([LEFT, 57.0], "start", "", &self.subtitle);
        let mut top = TOP;
        for row in &self.rows {
            row.draw(&mut svg, top);
            top += row.height() + BETWEEN;
        }
        svg.finish()
    }
}

impl PulsesRow {
    fn height(&self) -> f64 {
        self.vibrations.len().max(1) as f64 * (STRIP[1] + STRIPS)
    }

    fn draw(&self, svg: &mut Svg, top: f64) {
        svg.heading([LEFT, top - 12.0], &self.label, &self.remark);
        svg.heading([RIGHT, top - 12.0], "Modulation depth", "over frequency, 2 Hz wide");
        let bottom = top + self.height();
        let times = self.vibrations.iter().flat_map(|v| v.envelope.last()).map(|p| p.0);
        let x = Axis { low: 0.0, high: times.fold(1e-3, f64::max), pixels: [LEFT, LEFT + STRIP[0]] };
        let depths = || self.vibrations.iter().flat_map(|v| &v.depths);
        let hz = Axis {
            low: 0.0,
            high: depths().map(|p| p.0).fold(1.0, f64::max),
            pixels: [RIGHT, RIGHT + DEPTHS],
        };
        let deepest = depths().map(|p| p.1).filter(|d| d.is_finite()).fold(0.01, f64::max);
        let y = Axis { low: 0.0, high: 1.05 * deepest, pixels: [bottom, top] };
        grid(svg, &x, [top, bottom], " s");
        grid(svg, &hz, [top, bottom], " Hz");
        let mut lines = String::new();
        for (at, label) in y.ticks(50.0) {
            lines += &format!("M{} {}h{}", num(RIGHT), num(y.at(at)), num(DEPTHS));
            svg.text([RIGHT - 8.0, y.at(at) + 4.0], "end", "small", &label);
        }
        svg.path(&lines, GRID);
        for ((i, vibration), colour) in self.vibrations.iter().enumerate().zip(COLOURS) {
            let above = top + STRIPS + i as f64 * (STRIP[1] + STRIPS);
            let strip = Axis { low: 0.0, high: MOST, pixels: [above + STRIP[1], above] };
            let stroke =
                format!("stroke=\"{colour}\" stroke-width=\"1.3\" fill=\"none\" stroke-linejoin=\"round\"");
            svg.path(&line(&vibration.envelope, &x, &strip), &stroke);
            svg.path(&line(&vibration.depths, &hz, &y), &stroke);
            svg.text([LEFT + 2.0, above - 4.0], "start", "wire", &vibration.label);
        }
    }
}

/// Lines across an axis, with their labels below.
fn grid(svg: &mut Svg, axis: &Axis, [top, bottom]: [f64; 2], unit: &str) {
    let mut lines = String::new();
    for (at, label) in axis.ticks(80.0) {
        lines += &format!("M{} {}V{}", num(axis.at(at)), num(top), num(bottom));
        svg.text([axis.at(at), bottom + 18.0], "middle", "small", &format!("{label}{unit}"));
    }
    svg.path(&lines, GRID);
}

/// A path through points; what lies outside of the axis is drawn at its end.
fn line(points: &[(f64, f64)], x: &Axis, y: &Axis) -> String {
    let shown = points.iter().filter(|(x, y)| x.is_finite() && y.is_finite());
    let place =
        |(at, value): &(f64, f64)| format!("{} {}", num(x.at(*at)), num(y.at(value.clamp(y.low, y.high))));
    let places: Vec<String> = shown.map(place).collect();
    if places.is_empty() { String::new() } else { format!("M{}", places.join("L")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_vibration_has_its_envelope_and_its_modulation() {
        let vibration = |label: &str| Pulsing {
            label: label.into(),
            envelope: vec![(0.0, 1.0), (0.5, 9.0), (1.0, f64::NAN)],
            depths: vec![(2.0, 0.1), (20.0, 0.4)],
        };
        let vibrations = vec![vibration("before"), vibration("after")];
        let row = PulsesRow { label: "canvas".into(), remark: String::new(), vibrations };
        let picture = Pulses { title: "t".into(), subtitle: "s".into(), rows: vec![row] };
        let svg = picture.to_svg();
        for said in ["before", "after", "canvas", "20 Hz"] {
            assert!(svg.contains(said), "{said}");
        }
        assert!(!svg.contains("NaN") && svg.matches(COLOURS[0]).count() == 2);
        assert!(Pulses::default().to_svg().ends_with("</svg>\n"));
    }
}
