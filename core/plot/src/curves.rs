//! Training curves: the loss of each stage over its steps.

use super::axis::{Axis, padded_range};
use super::dots::powers;
use super::svg::{Svg, num};

/// One stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Its name.
    pub name: String,
    /// What is said of it, such as its last loss.
    pub remark: String,
    /// Step and loss, in the order of steps.
    pub points: Vec<(f64, f64)>,
}

/// Stages side by side, each with its own axes; losses are logarithmic where all are above 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curves {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading.
    pub subtitle: String,
    /// The stages.
    pub curves: Vec<Curve>,
}

const PANEL: [f64; 2] = [300.0, 240.0];
const LEFT: f64 = 64.0;
const TOP: f64 = 104.0;
const BOTTOM: f64 = 52.0;
const GRID: &str = "stroke=\"#e4e9ee\" stroke-width=\"1\" fill=\"none\" shape-rendering=\"crispEdges\"";
const LINE: &str = "stroke=\"#0a6fb0\" stroke-width=\"1.5\" fill=\"none\" stroke-linejoin=\"round\"";

impl Curves {
    /// The curves as an SVG document.
    pub fn to_svg(&self) -> String {
        let width = LEFT + self.curves.len().max(1) as f64 * (PANEL[0] + LEFT);
        let mut svg = Svg::new(width, TOP + PANEL[1] + BOTTOM, &self.title);
        svg.text([LEFT, 36.0], "start", "title", &self.title);
        svg.text([LEFT, 57.0], "start", "", &self.subtitle);
        for (i, curve) in self.curves.iter().enumerate() {
            let left = LEFT + i as f64 * (PANEL[0] + LEFT);
            svg.heading([left, TOP - 12.0], &curve.name, &curve.remark);
            curve.draw(&mut svg, left);
        }
        svg.finish()
    }
}

impl Curve {
    fn draw(&self, svg: &mut Svg, left: f64) {
        let known = || self.points.iter().filter(|(step, loss)| step.is_finite() && loss.is_finite());
        let logarithmic = known().all(|(_, loss)| *loss > 0.0);
        let points: Vec<(f64, f64)> =
            known().map(|(step, loss)| (*step, if logarithmic { loss.log10() } else { *loss })).collect();
        let (Some((low, high)), Some((last, _))) = (padded_range(points.iter().map(|p| p.1)), points.last())
        else {
            svg.text([left, TOP + 24.0], "start", "", "no data");
            return;
        };
        let x = Axis { low: 0.0, high: last.max(1.0), pixels: [left, left + PANEL[0]] };
        let y = Axis { low, high, pixels: [TOP + PANEL[1], TOP] };
        // `powers` goes from left to right
        let marks = if logarithmic { powers(&Axis { pixels: [0.0, PANEL[1]], ..y }) } else { y.ticks(40.0) };
        for (at, label) in marks {
            svg.path(&format!("M{} {}h{}", num(left), num(y.at(at)), num(PANEL[0])), GRID);
            svg.text([left - 8.0, y.at(at) + 4.0], "end", "small", &label);
        }
        for (at, label) in x.ticks(80.0) {
            svg.path(&format!("M{} {}v{}", num(x.at(at)), num(TOP), num(PANEL[1])), GRID);
            svg.text([x.at(at), TOP + PANEL[1] + 18.0], "middle", "small", &label);
        }
        svg.text([left + PANEL[0] / 2.0, TOP + PANEL[1] + 38.0], "middle", "ink", "Step");
        let line: Vec<String> =
            points.iter().map(|(step, loss)| format!("{} {}", num(x.at(*step)), num(y.at(*loss)))).collect();
        svg.path(&format!("M{}", line.join("L")), LINE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::tags;

    #[test]
    fn each_stage_has_its_line_and_one_without_losses_says_so() {
        let curve = |points: Vec<(f64, f64)>| Curve { name: "a & b".into(), remark: "0.1".into(), points };
        let curves = Curves {
            title: "T".into(),
            subtitle: String::new(),
            curves: vec![
                curve(vec![(1.0, 2.0), (50.0, 0.5), (100.0, 0.1)]),
                curve(vec![(1.0, 2.0), (50.0, -0.5)]),
                curve(vec![(1.0, f64::NAN)]),
            ],
        };
        let svg = curves.to_svg();
        assert_eq!(svg.matches(LINE).count(), 2);
        assert!(svg.contains("a &amp; b") && svg.contains("no data"));
        // a logarithmic mark, and one below 0
        assert!(svg.contains(">0.2<") && svg.contains(">\u{2212}0.5<"), "{svg}");
        assert!(tags(&svg)["text"] > 10);
    }
}
