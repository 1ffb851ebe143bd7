//! Training curves: the loss of each stage over its steps.

use super::axis::{Axis, Panel};
use super::svg::Svg;

/// One stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Its name.
    pub name: String,
    /// Remark beside the name, such as the last loss.
    pub remark: String,
    /// Step and loss, in the order of steps.
    pub points: Vec<(f64, f64)>,
}

/// Stages side by side, each with its own axes. Losses are logarithmic where all are above 0.
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
const LINE: &str = "stroke=\"#0a6fb0\" stroke-width=\"1.5\" fill=\"none\" stroke-linejoin=\"round\"";

impl Curves {
    /// The curves as an SVG document.
    pub fn to_svg(&self) -> String {
        let width = LEFT + self.curves.len().max(1) as f64 * (PANEL[0] + LEFT);
        let mut svg = Svg::chart([width, TOP + PANEL[1] + BOTTOM], LEFT, &self.title, &[&self.subtitle]);
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
        let finite = self.points.iter().filter(|(step, loss)| step.is_finite() && loss.is_finite());
        let points: Vec<(f64, f64)> = finite.copied().collect();
        let logarithmic = points.iter().all(|(_, loss)| *loss > 0.0);
        let bottom = TOP + PANEL[1];
        let losses = points.iter().map(|(_, loss)| *loss);
        let (Some(y), Some((last, _))) = (Axis::around(losses, logarithmic, [bottom, TOP]), points.last())
        else {
            svg.text([left, TOP + 24.0], "start", "", "no data");
            return;
        };
        let panel = Panel { x: Axis::linear((0.0, last.max(1.0)), [left, left + PANEL[0]]), y };
        panel.y_grid(svg, &y.ticks(40.0));
        panel.x_grid(svg, 80.0);
        panel.x_labels(svg, 80.0, "");
        svg.text([left + PANEL[0] / 2.0, bottom + 38.0], "middle", "ink", "Step");
        svg.path(&panel.line(&points), LINE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::tags;

    #[test]
    fn stages_have_lines_or_say_no_data() {
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
