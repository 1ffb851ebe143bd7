//! A frequency response, measured and fitted: magnitude, phase and coherence over logarithmic frequency.

use std::f64::consts::{PI, TAU};

use asperity_actuator::identify::Point;

use super::axis::{Axis, Panel};
use super::svg::{COLOURS, Svg, num};

/// A response with its label.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Its label, such as `on 100 g`.
    pub label: String,
    /// Measured and fitted values, in the order of frequency.
    pub points: Vec<Point>,
    /// Remarks, a line each.
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
/// Measured phases further than this outside the fitted ones are noise and left out, degrees.
const STRAY: f64 = 60.0;
/// Room beyond the first and last frequency, decades.
const MARGIN: f64 = 0.02;

/// Name and unit of a panel, and its values of a response.
type Row<'a> = (&'a str, &'a str, fn(&Measured) -> Trace);

/// Values of a panel: measured dots, and a fitted line.
#[derive(Default)]
struct Trace {
    dots: Vec<(f64, f64)>,
    line: Vec<(f64, f64)>,
}

impl Response {
    /// The responses as an SVG document, 1200 pixels wide.
    pub fn to_svg(&self) -> String {
        let height = TOP + HEIGHTS.iter().map(|h| HEADING + h).sum::<f64>() + BOTTOM;
        let mut svg = Svg::chart([WIDTH, height], LEFT, &self.title, &[&self.subtitle]);
        let hz = || self.runs.iter().flat_map(|r| &r.points).map(|p| p.hz).filter(|hz| *hz > 0.0);
        let (low, high) = (hz().fold(f64::MAX, f64::min), hz().fold(0.0, f64::max));
        if low >= high {
            svg.text([LEFT, TOP + 24.0], "start", "", "no data");
            return svg.finish();
        }
        let (low, high) = (low.log10() - MARGIN, high.log10() + MARGIN);
        let x = Axis { low, high, pixels: [LEFT, RIGHT], logarithmic: true };
        let panels: [Row<'_>; 3] = [
            ("Magnitude", &self.unit, magnitude),
            ("Phase", "degrees, latency taken out", phase),
            ("Coherence", "share of the response that follows the drive", coherence),
        ];
        legend(&mut svg, TOP + HEADING - 9.0);
        let mut top = TOP;
        for ((name, unit, trace), height) in panels.into_iter().zip(HEIGHTS) {
            top += HEADING;
            svg.heading([LEFT, top - 9.0], name, unit);
            let traces: Vec<Trace> = self.runs.iter().map(trace).collect();
            let values = traces.iter().flat_map(|t| t.dots.iter().chain(&t.line)).map(|(_, v)| *v);
            let pixels = [top + height, top];
            let y = match name {
                "Coherence" => Some(Axis::linear((0.0, 1.05), pixels)),
                _ => Axis::around(values, false, pixels),
            };
            if let Some(y) = y {
                let ticks = if name == "Phase" { right_angles(&y) } else { y.ticks(34.0) };
                draw(&mut svg, &traces, &Panel { x, y }, &ticks);
            }
            top += height;
        }
        for (hz, label) in x.ticks(0.0) {
            svg.text([x.at(hz), top + 18.0], "middle", "", &label);
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

/// Unwrapped fitted phase, and the measured phase within half a turn of it, degrees.
fn phase(run: &Measured) -> Trace {
    let near = |phase: f64, to: f64| phase - ((phase - to) / TAU).round() * TAU;
    let mut trace = Trace { dots: Vec::new(), line: Vec::new() };
    let mut last = 0.0;
    for p in &run.points {
        last = near(p.fitted_phase, last);
        trace.line.push((p.hz, last * 180.0 / PI));
        trace.dots.push((p.hz, near(p.measured_phase, last) * 180.0 / PI));
    }
    let within =
        trace.line.iter().fold((f64::MAX, f64::MIN), |(low, high), (_, v)| (low.min(*v), high.max(*v)));
    trace.dots.retain(|(_, v)| (within.0 - STRAY..=within.1 + STRAY).contains(v));
    trace
}

fn coherence(run: &Measured) -> Trace {
    let line: Vec<_> = run.points.iter().map(|p| (p.hz, p.coherence)).collect();
    Trace { line, ..Trace::default() }
}

/// Multiples of 90 degrees on an axis.
fn right_angles(y: &Axis) -> Vec<(f64, String)> {
    let (first, last) = ((y.low / 90.0).ceil() as i32, (y.high / 90.0).floor() as i32);
    (first..=last).map(|i| (90.0 * f64::from(i), format!("{}", 90 * i).replace('-', "\u{2212}"))).collect()
}

/// Draws grid, dots and lines of a panel.
fn draw(svg: &mut Svg, traces: &[Trace], panel: &Panel, ticks: &[(f64, String)]) {
    panel.x_grid(svg, 0.0);
    panel.y_grid(svg, ticks);
    for (trace, colour) in traces.iter().zip(COLOURS.iter().cycle()) {
        for dot in trace.dots.iter().filter(|(hz, v)| *hz > 0.0 && v.is_finite()) {
            svg.circle(panel.at(*dot), 2.6, &format!("fill=\"{colour}\" fill-opacity=\"0.5\""));
        }
        let line: Vec<(f64, f64)> = trace.line.iter().filter(|(hz, _)| *hz > 0.0).copied().collect();
        let stroke = format!("stroke=\"{colour}\" stroke-width=\"1.8\" stroke-linejoin=\"round\"");
        svg.path(&panel.line(&line), &format!("fill=\"none\" {stroke}"));
    }
    panel.frame(svg);
}

/// Legend: dots are measured, lines are fitted.
fn legend(svg: &mut Svg, y: f64) {
    svg.text([RIGHT, y], "end", "ink", "fitted");
    let line = format!("M{} {}h-22", num(RIGHT - 40.0), num(y - 4.0));
    svg.path(&line, "stroke=\"#52606d\" stroke-width=\"1.8\"");
    svg.text([RIGHT - 78.0, y], "end", "ink", "measured");
    for dx in [0.0, 8.0, 16.0] {
        svg.circle([RIGHT - 158.0 + dx, y - 4.0], 2.6, "fill=\"#52606d\" fill-opacity=\"0.5\"");
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
    fn phase_is_unwrapped_and_noise_left_out() {
        let trace = phase(&measured(points(0.0)));
        assert_eq!(trace.dots.len(), 8);
        for (pair, dot) in trace.line.windows(2).zip(&trace.dots) {
            assert!((pair[1].1 - pair[0].1 + 0.6f64.to_degrees()).abs() < 1e-9, "{pair:?}");
            assert!((dot.1 - pair[0].1 - 0.1f64.to_degrees()).abs() < 1e-9);
        }
        assert!(phase(&measured(points(PI))).dots.len() < 8);
    }

    #[test]
    fn measured_bands_have_dots_or_no_data_is_said() {
        let runs = vec![measured(points(0.0)), measured(points(0.2))];
        let figures = vec![("mass".into(), "4.4 g".into(), vec!["a & b".into()])];
        let svg = Response { title: "t".into(), runs, figures, ..Response::default() }.to_svg();
        // Magnitude and phase of both, and three in the legend.
        assert_eq!(tags(&svg)["circle"], 2 * 2 * 8 + 3);
        assert!(svg.contains("on &lt;100&gt; g") && svg.contains("a &amp; b"));
        assert!(Response::default().to_svg().contains("no data"));
    }
}
