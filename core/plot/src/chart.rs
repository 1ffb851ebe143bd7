//! Plots of dots and lines over two axes, in rows.

use super::axis::{Axis, Panel};
use super::svg::{COLOURS, Svg, legend};

/// Dots and lines of one colour.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Named in the legend, unless empty.
    pub name: String,
    /// Dots.
    pub dots: Vec<(f64, f64)>,
    /// Whether dots have their number beside them, from 0.
    pub numbered: bool,
    /// Lines through points.
    pub lines: Vec<Vec<(f64, f64)>>,
}

/// Values of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scale {
    /// Whether it is logarithmic; it then shows values above 0 alone.
    pub logarithmic: bool,
    /// Its ends; left out, around all values.
    pub range: Option<(f64, f64)>,
}

/// Traces over two axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plot {
    /// Heading, and a remark beside it, such as the unit of y.
    pub heading: (String, String),
    /// Name of the x axis.
    pub x_name: String,
    /// The x axis.
    pub x: Scale,
    /// The y axis.
    pub y: Scale,
    /// Traces, each in a colour of its own.
    pub traces: Vec<Trace>,
}

/// Plots in rows, and figures beside them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading.
    pub subtitle: String,
    /// Plots in a row.
    pub columns: usize,
    /// Width and height of a plot in pixels.
    pub size: [f64; 2],
    /// The plots.
    pub plots: Vec<Plot>,
    /// Beside the plots: heading, remark, smaller lines.
    pub aside: Vec<(String, String, Vec<String>)>,
}

const LEFT: f64 = 64.0;
const TOP: f64 = 104.0;
/// Room right of a plot and below it, and for the figures beside all.
const GAP: [f64; 2] = [64.0, 84.0];
const ASIDE: f64 = 260.0;

impl Chart {
    /// The plots as an SVG document.
    pub fn to_svg(&self) -> String {
        let columns = self.columns.max(1);
        let pitch = [self.size[0] + GAP[0], self.size[1] + GAP[1]];
        let aside = LEFT + columns as f64 * pitch[0];
        let width = if self.aside.is_empty() { aside } else { aside + ASIDE };
        let height = TOP + self.plots.len().div_ceil(columns).max(1) as f64 * pitch[1];
        let mut svg = Svg::chart([width, height], LEFT, &self.title, &[&self.subtitle]);
        for (i, plot) in self.plots.iter().enumerate() {
            let left = LEFT + (i % columns) as f64 * pitch[0];
            let top = TOP + (i / columns) as f64 * pitch[1];
            plot.draw(&mut svg, [left, left + self.size[0]], [top + self.size[1], top]);
        }
        let mut y = TOP - 12.0;
        for (heading, remark, lines) in &self.aside {
            svg.heading([aside, y], heading, remark);
            for line in lines {
                y += 17.0;
                svg.text([aside, y], "start", "small", line);
            }
            y += 30.0;
        }
        svg.finish()
    }
}

impl Scale {
    fn shows(&self, value: f64) -> bool {
        value.is_finite() && (value > 0.0 || !self.logarithmic)
    }

    /// The axis for some values that it shows.
    fn axis(&self, values: impl Iterator<Item = f64>, pixels: [f64; 2]) -> Option<Axis> {
        let around = Axis::around(values, self.logarithmic, pixels)?;
        let scaled = |v: f64| if self.logarithmic { v.log10() } else { v };
        let (low, high) = self.range.map_or((around.low, around.high), |(a, b)| (scaled(a), scaled(b)));
        (low < high).then_some(Axis { low, high, ..around })
    }
}

impl Plot {
    fn draw(&self, svg: &mut Svg, across: [f64; 2], upward: [f64; 2]) {
        let ([left, right], [bottom, top]) = (across, upward);
        svg.heading([left, top - 12.0], &self.heading.0, &self.heading.1);
        let shown = |p: &&(f64, f64)| self.x.shows(p.0) && self.y.shows(p.1);
        let points =
            || self.traces.iter().flat_map(|t| t.dots.iter().chain(t.lines.iter().flatten())).filter(shown);
        let axes = self.x.axis(points().map(|p| p.0), across).zip(self.y.axis(points().map(|p| p.1), upward));
        let Some((x, y)) = axes else {
            svg.text([left, top + 24.0], "start", "", "no data");
            return;
        };
        let panel = Panel { x, y };
        panel.x_grid(svg, 80.0);
        panel.x_labels(svg, 80.0, "");
        panel.y_grid(svg, &y.ticks(36.0));
        svg.text([0.5 * (left + right), bottom + 38.0], "middle", "ink", &self.x_name);
        for (trace, colour) in self.traces.iter().zip(COLOURS.iter().cycle()) {
            for (i, dot) in trace.dots.iter().enumerate().filter(|(_, dot)| shown(dot)) {
                let [cx, cy] = panel.at(*dot);
                if (top..=bottom).contains(&cy) {
                    svg.circle([cx, cy], 2.4, &format!("fill=\"{colour}\" fill-opacity=\"0.6\""));
                    let number = if trace.numbered { i.to_string() } else { String::new() };
                    svg.text([cx + 6.0, cy - 5.0], "start", "wire", &number);
                }
            }
            for line in &trace.lines {
                let points: Vec<_> = line.iter().filter(shown).copied().collect();
                let stroke = format!("stroke=\"{colour}\" stroke-width=\"1.6\" stroke-linejoin=\"round\"");
                svg.path(&panel.line(&points), &format!("fill=\"none\" {stroke}"));
            }
        }
        panel.frame(svg);
        legend(svg, [right, top - 12.0], self.traces.iter().map(|t| t.name.as_str()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::tags;

    fn plot(points: &[(f64, f64)], logarithmic: bool, range: Option<(f64, f64)>) -> Plot {
        let trace = Trace {
            name: "a & b".into(),
            dots: points.to_vec(),
            numbered: true,
            lines: vec![points.to_vec(), Vec::new()],
        };
        let y = Scale { logarithmic, range };
        Plot { heading: ("<head>".into(), "N".into()), y, traces: vec![trace], ..Plot::default() }
    }

    #[test]
    fn plots_have_their_points_or_say_no_data() {
        let bad = [(1.0, f64::NAN), (f64::INFINITY, 1.0)];
        let chart = Chart {
            title: "T".into(),
            columns: 2,
            size: [300.0, 200.0],
            plots: vec![
                plot(&[(1.0, 2.0), (50.0, 0.5), (99.0, 0.1), (100.0, -7.0)], true, None),
                plot(&[(1.0, 2.0), (50.0, -0.5), bad[0], bad[1]], false, None),
                plot(&[(1.0, 50.0), (2.0, -90.0)], false, Some((-10.0, 50.0))),
                plot(&bad, false, None),
            ],
            aside: vec![("mass".into(), "4.4 g".into(), vec!["c & d".into()])],
            ..Chart::default()
        };
        let svg = chart.to_svg();
        // Dots out of a range are left out, lines are held within it.
        assert_eq!((tags(&svg)["circle"], svg.matches("stroke-linejoin=\"round\"").count()), (3 + 2 + 1, 3));
        assert!(svg.contains(" 588\" fill=\"none\""), "{svg}");
        // A logarithmic mark, and one below 0.
        for text in
            [">0.2<", ">\u{2212}0.5<", "no data", "&lt;head&gt;", "a &amp; b", "c &amp; d", ">2</text>"]
        {
            assert!(svg.contains(text), "{text}: {svg}");
        }
        tags(&Chart::default().to_svg());
    }
}
