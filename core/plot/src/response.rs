//! A frequency response, measured and fitted: magnitude, phase and coherence over one axis of logarithmic frequency.

use std::f64::consts::{PI, TAU};

use asperity_actuator::identify::Point;

use super::axis::{Axis, padded_range};
use super::dots::powers;
use super::svg::{Svg, num};

/// A response and how it is to be called.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// What it is, such as `on 100 g`.
    pub label: String,
    /// In the order of their frequency.
    pub points: Vec<Point>,
    /// What is said of it, a line each.
    pub figures: Vec<String>,
}

/// Responses over one axis, with figures beside them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Response {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading.
    pub subtitle: String,
    /// Unit of the magnitude.
    pub unit: String,
    /// Each response with a colour of its own.
    pub runs: Vec<Measured>,
    /// Beside the panels: name, value, smaller lines.
    pub figures: Vec<(String, String, Vec<String>)>,
}

const WIDTH: f64 = 1200.0;
const LEFT: f64 = 72.0;
const RIGHT: f64 = 920.0;
const ASIDE: f64 = 960.0;
const TOP: f64 = 74.0;
const HEADING: f64 = 34.0;
const BOTTOM: f64 = 52.0;
/// Heights of magnitude, phase and coherence.
const HEIGHTS: [f64; 3] = [250.0, 160.0, 90.0];
const GRID: &str = "stroke=\"#e4e9ee\" stroke-width=\"1\" fill=\"none\" shape-rendering=\"crispEdges\"";
const FRAME: &str = "stroke=\"#b8c2cc\" stroke-width=\"1\" fill=\"none\" shape-rendering=\"crispEdges\"";
/// Blue and vermilion, told apart also by those who do not see red or green.
const COLOURS: [&str; 2] = ["#0a6fb0", "#d1602a"];
/// Degrees beyond those of the fitted line that a phase may stray and still be shown where it is.
const STRAY: f64 = 60.0;
/// Decades beyond the first and last frequency.
const MARGIN: f64 = 0.02;

/// A panel's name, its unit, and what it shows of a response.
type Panel<'a> = (&'a str, &'a str, fn(&Measured) -> Trace);

/// What a panel shows of a response: measured values, and a line where something is fitted.
struct Trace {
    dots: Vec<(f64, f64)>,
    line: Vec<(f64, f64)>,
}

impl Response {
    /// The responses as an SVG document, 1200 pixels wide.
    pub fn to_svg(&self) -> String {
        let height = TOP + HEIGHTS.iter().map(|h| HEADING + h).sum::<f64>() + BOTTOM;
        let mut svg = Svg::new(WIDTH, height, &self.title);
        svg.text([LEFT, 36.0], "start", "title", &self.title);
        svg.text([LEFT, 57.0], "start", "", &self.subtitle);
        let hz = || self.runs.iter().flat_map(|r| &r.points).map(|p| p.hz).filter(|hz| *hz > 0.0);
        let (low, high) = (hz().fold(f64::MAX, f64::min), hz().fold(0.0, f64::max));
        if low >= high {
            svg.text([LEFT, TOP + 24.0], "start", "", "no data");
            return svg.finish();
        }
        // Bands lie a little within the frequencies that were played.
        let x = Axis { low: low.log10() - MARGIN, high: high.log10() + MARGIN, pixels: [LEFT, RIGHT] };
        let panels: [Panel<'_>; 3] = [
            ("Magnitude", &self.unit, magnitude),
            ("Phase", "degrees, latency taken out", phase),
            ("Coherence", "how much of what was heard follows the drive", coherence),
        ];
        let mut top = TOP;
        for (i, ((name, unit, trace), panel)) in panels.into_iter().zip(HEIGHTS).enumerate() {
            top += HEADING;
            svg.heading([LEFT, top - 9.0], name, unit);
            let traces: Vec<Trace> = self.runs.iter().map(trace).collect();
            let values = traces.iter().flat_map(|t| t.dots.iter().chain(&t.line)).map(|(_, v)| *v);
            let range = if i == 2 { Some((0.0, 1.05)) } else { padded_range(values) };
            if let Some((low, high)) = range {
                let y = Axis { low, high, pixels: [top + panel, top] };
                draw(&mut svg, &traces, &x, &y, if i == 1 { Some(90.0) } else { None });
            }
            if i == 0 {
                legend(&mut svg, top - 9.0);
            }
            top += panel;
        }
        for (at, label) in powers(&x) {
            svg.text([x.at(at), top + 18.0], "middle", "", &label);
        }
        svg.text([(LEFT + RIGHT) / 2.0, top + 38.0], "middle", "ink", "Frequency, Hz");
        self.aside(&mut svg);
        svg.finish()
    }

    /// Figures at the right.
    fn aside(&self, svg: &mut Svg) {
        let mut y = TOP + HEADING + 4.0;
        for (name, value, more) in &self.figures {
            svg.heading([ASIDE, y], value, name);
            for line in more {
                y += 16.0;
                svg.text([ASIDE, y], "start", "small", line);
            }
            y += 30.0;
        }
        for (run, colour) in self.runs.iter().zip(COLOURS.iter().cycle()) {
            svg.rect([ASIDE, y - 10.0], [10.0, 10.0], &format!("rx=\"5\" fill=\"{colour}\""));
            svg.text([ASIDE + 17.0, y], "start", "head", &run.label);
            for line in &run.figures {
                y += 17.0;
                svg.text([ASIDE + 17.0, y], "start", "", line);
            }
            y += 30.0;
        }
    }
}

fn magnitude(run: &Measured) -> Trace {
    Trace {
        dots: run.points.iter().map(|p| (p.hz, p.measured_db)).collect(),
        line: run.points.iter().map(|p| (p.hz, p.fitted_db)).collect(),
    }
}

/// The fitted phase without jumps, and the measured one within half a turn of it, both in degrees.
fn phase(run: &Measured) -> Trace {
    let near = |phase: f64, to: f64| phase - ((phase - to) / TAU).round() * TAU;
    let mut trace = Trace { dots: Vec::new(), line: Vec::new() };
    let mut last = 0.0;
    for p in &run.points {
        last = near(p.fitted_phase, last);
        trace.line.push((p.hz, last * 180.0 / PI));
        trace.dots.push((p.hz, near(p.measured_phase, last) * 180.0 / PI));
    }
    // Phases of what is all noise would only squeeze the others together.
    let within =
        trace.line.iter().fold((f64::MAX, f64::MIN), |(low, high), (_, v)| (low.min(*v), high.max(*v)));
    trace.dots.retain(|(_, v)| (within.0 - STRAY..=within.1 + STRAY).contains(v));
    trace
}

fn coherence(run: &Measured) -> Trace {
    let line: Vec<_> = run.points.iter().map(|p| (p.hz, p.coherence)).collect();
    Trace { dots: Vec::new(), line }
}

/// Grid, dots and lines of a panel; `step` is the distance of its marks where it is not free.
fn draw(svg: &mut Svg, traces: &[Trace], x: &Axis, y: &Axis, step: Option<f64>) {
    let [bottom, top] = y.pixels;
    let mut grid = String::new();
    for (at, _) in powers(x) {
        grid += &format!("M{} {}V{}", num(x.at(at)), num(bottom), num(top));
    }
    let marks = match step {
        Some(step) => (((y.low / step).ceil() as i32)..=((y.high / step).floor() as i32))
            .map(|i| (f64::from(i) * step, format!("{}", f64::from(i) * step).replace('-', "\u{2212}")))
            .collect(),
        None => y.ticks(34.0),
    };
    for (v, label) in marks {
        grid += &format!("M{} {}H{}", num(LEFT), num(y.at(v)), num(RIGHT));
        svg.text([LEFT - 8.0, y.at(v) + 4.0], "end", "small", &label);
    }
    svg.path(&grid, GRID);
    for (trace, colour) in traces.iter().zip(COLOURS.iter().cycle()) {
        let place = |(hz, v): &(f64, f64)| [x.at(hz.log10()), y.at(*v)];
        let finite = |p: &&(f64, f64)| p.0 > 0.0 && p.1.is_finite();
        for [cx, cy] in trace.dots.iter().filter(finite).map(place) {
            svg.raw(format_args!(
                "<circle cx=\"{}\" cy=\"{}\" r=\"2.6\" fill=\"{colour}\" fill-opacity=\"0.5\"/>\n",
                num(cx),
                num(cy)
            ));
        }
        let points: Vec<String> = trace
            .line
            .iter()
            .filter(finite)
            .map(place)
            .map(|[a, b]| format!("{} {}", num(a), num(b)))
            .collect();
        if !points.is_empty() {
            let d = format!("M{}", points.join("L"));
            svg.path(
                &d,
                &format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.8\" stroke-linejoin=\"round\""),
            );
        }
    }
    svg.path(&format!("M{} {}V{}H{}", num(LEFT), num(top), num(bottom), num(RIGHT)), FRAME);
}

/// Dots are measured, lines fitted.
fn legend(svg: &mut Svg, y: f64) {
    svg.text([RIGHT, y], "end", "ink", "fitted");
    svg.path(
        &format!("M{} {}h-22", num(RIGHT - 40.0), num(y - 4.0)),
        "stroke=\"#52606d\" stroke-width=\"1.8\"",
    );
    svg.text([RIGHT - 78.0, y], "end", "ink", "measured");
    for dx in [0.0, 8.0, 16.0] {
        svg.raw(format_args!(
            "<circle cx=\"{}\" cy=\"{}\" r=\"2.6\" fill=\"#52606d\" fill-opacity=\"0.5\"/>\n",
            num(RIGHT - 158.0 + dx),
            num(y - 4.0)
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::tags;

    fn points(shift: f64) -> Vec<Point> {
        let at = |i: i32| {
            let hz = 10.0 * f64::from(i).exp2();
            let fitted_phase = -0.6 * f64::from(i);
            Point {
                hz,
                measured_db: 20.0 * hz.log10(),
                measured_phase: (fitted_phase + 0.1 + shift + PI).rem_euclid(TAU) - PI,
                fitted_db: 20.0 * hz.log10(),
                fitted_phase: (fitted_phase + PI).rem_euclid(TAU) - PI,
                coherence: 0.9,
            }
        };
        (0..8).map(at).collect()
    }

    fn measured(points: Vec<Point>) -> Measured {
        Measured { label: "on <100> g".into(), points, figures: vec!["resonance".into()] }
    }

    #[test]
    fn phases_are_shown_without_jumps_and_noise_is_left_out() {
        let trace = phase(&measured(points(0.0)));
        assert_eq!(trace.dots.len(), 8);
        for (pair, dot) in trace.line.windows(2).zip(&trace.dots) {
            assert!((pair[1].1 - pair[0].1 + 0.6f64.to_degrees()).abs() < 1e-9, "{pair:?}");
            assert!((dot.1 - pair[0].1 - 0.1f64.to_degrees()).abs() < 1e-9);
        }
        assert!(phase(&measured(points(PI))).dots.len() < 8);
    }

    #[test]
    fn every_measured_band_has_a_dot_and_nothing_at_all_is_said() {
        let runs = vec![measured(points(0.0)), measured(points(0.2))];
        let figures = vec![("mass".into(), "4.4 g".into(), vec!["a & b".into()])];
        let svg = Response { title: "t".into(), runs, figures, ..Response::default() }.to_svg();
        // Magnitude and phase of both, and three in the legend.
        assert_eq!(tags(&svg)["circle"], 2 * 2 * 8 + 3);
        assert!(svg.contains("on &lt;100&gt; g") && svg.contains("a &amp; b"));
        assert!(Response::default().to_svg().contains("no data"));
    }
}
