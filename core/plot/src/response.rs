//! A frequency response, measured and fitted: magnitude, phase and coherence over logarithmic frequency.

use std::f64::consts::TAU;

use asperity_actuator::identify::Point;

use super::chart::{Chart, Plot, Scale, Trace};

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

/// Measured phases further than this outside the fitted ones are noise and left out, degrees.
const STRAY: f64 = 60.0;

impl Response {
    /// The responses as an SVG document: dots are measured, lines are fitted.
    pub fn to_svg(&self) -> String {
        let plot = |name: &str, remark: &str, range, trace: fn(&Measured) -> Trace| Plot {
            heading: (name.into(), remark.into()),
            x_name: "Frequency, Hz".into(),
            x: Scale { logarithmic: true, range: None },
            y: Scale { logarithmic: false, range },
            traces: self.runs.iter().map(|run| Trace { name: run.label.clone(), ..trace(run) }).collect(),
        };
        let (unit, coherence_is) = (&self.unit, "share of the response that follows the drive");
        let runs = self.runs.iter().map(|run| (run.label.clone(), String::new(), run.figures.clone()));
        let figures =
            self.figures.iter().map(|(name, value, more)| (value.clone(), name.clone(), more.clone()));
        Chart {
            title: self.title.clone(),
            subtitle: self.subtitle.clone(),
            columns: 1,
            size: [850.0, 160.0],
            plots: vec![
                plot("Magnitude", &format!("{unit}; dots measured, lines fitted"), None, magnitude),
                plot("Phase", "degrees, latency taken out", None, phase),
                plot("Coherence", coherence_is, Some((0.0, 1.05)), coherence),
            ],
            aside: figures.chain(runs).collect(),
        }
        .to_svg()
    }
}

fn magnitude(run: &Measured) -> Trace {
    let dots = run.points.iter().map(|p| (p.hz, p.measured_db)).collect();
    let line = run.points.iter().map(|p| (p.hz, p.fitted_db)).collect();
    Trace { dots, lines: vec![line], ..Trace::default() }
}

/// Unwrapped fitted phase, and the measured phase within half a turn of it, degrees.
fn phase(run: &Measured) -> Trace {
    let near = |phase: f64, to: f64| phase - ((phase - to) / TAU).round() * TAU;
    let (mut dots, mut line, mut last) = (Vec::new(), Vec::new(), 0.0);
    for p in &run.points {
        last = near(p.fitted_phase, last);
        line.push((p.hz, last.to_degrees()));
        dots.push((p.hz, near(p.measured_phase, last).to_degrees()));
    }
    let (low, high) =
        line.iter().fold((f64::MAX, f64::MIN), |(low, high), (_, v)| (low.min(*v), high.max(*v)));
    dots.retain(|(_, v)| (low - STRAY..=high + STRAY).contains(v));
    Trace { dots, lines: vec![line], ..Trace::default() }
}

fn coherence(run: &Measured) -> Trace {
    Trace { lines: vec![run.points.iter().map(|p| (p.hz, p.coherence)).collect()], ..Trace::default() }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

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
        for (pair, dot) in trace.lines[0].windows(2).zip(&trace.dots) {
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
        // Magnitude and phase of both.
        assert_eq!(tags(&svg)["circle"], 2 * 2 * 8);
        assert!(svg.contains("on &lt;100&gt; g") && svg.contains("a &amp; b"));
        assert!(Response::default().to_svg().contains("no data"));
    }
}
