//! Dots over two axes: cost and quality of many settings.

use super::axis::{Axis, Panel};
use super::svg::{Svg, escape, fitting, num, polyline, text_width};

/// Style of a dot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mark {
    /// Filled.
    #[default]
    Plain,
    /// Hollow: a setting that is not available.
    Out,
}

/// A dot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dot {
    /// Its x and y.
    pub at: [f64; 2],
    /// Tooltip.
    pub name: String,
    /// Its style.
    pub mark: Mark,
    /// Text beside it; may be empty.
    pub label: String,
}

/// Dots over two axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scatter {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading, a line each.
    pub subtitles: Vec<String>,
    /// Name of the x axis, and whether it is logarithmic. Less is better.
    pub x: (String, bool),
    /// Name of the y axis.
    pub y: String,
    /// Whether a larger y is better.
    pub up_is_better: bool,
    /// All dots.
    pub dots: Vec<Dot>,
    /// Indices of the dots on the Pareto front, from the left on.
    pub line: Vec<usize>,
    /// A level of y to compare with, and its name.
    pub reference: Option<(f64, String)>,
    /// Differences of y below this are within noise.
    pub floor: Option<f64>,
}

const SIZE: [f64; 2] = [820.0, 520.0];
const LEFT: f64 = 76.0;
const RIGHT: f64 = SIZE[0] - 28.0;
const BOTTOM: f64 = SIZE[1] - 58.0;
const DOT: &str = "#7b93a8";
const LINE: &str = "#d9730d";
const REFERENCE: &str = "#6b4fa0";
/// Font size that labels are measured with.
const LETTERS: f64 = 12.0;

impl Scatter {
    /// The picture as an SVG document; without dots where nothing is finite.
    pub fn to_svg(&self) -> String {
        let mut svg = Svg::chart(SIZE, 24.0, &self.title, &self.subtitles);
        let top = 68.0 + 18.0 * self.subtitles.len() as f64;
        let xs = self.dots.iter().map(|d| d.at[0]);
        let ys = self.dots.iter().map(|d| d.at[1]).chain(self.reference.iter().map(|r| r.0));
        let (Some(x), Some(y)) =
            (Axis::around(xs, self.x.1, [LEFT, RIGHT]), Axis::around(ys, false, [BOTTOM, top]))
        else {
            return svg.finish();
        };
        let panel = Panel { x: x.at_least_a_decade(), y };
        panel.x_grid(&mut svg, 80.0);
        panel.x_labels(&mut svg, 80.0, "");
        panel.y_grid(&mut svg, &y.ticks(48.0));
        svg.text([0.5 * (LEFT + RIGHT), BOTTOM + 42.0], "middle", "head", &self.x.0);
        svg.upright_text([22.0, 0.5 * (top + BOTTOM)], "middle", "head", &self.y);
        let at = |dot: &Dot| panel.at((dot.at[0], dot.at[1]));
        let front = self.line.iter().filter_map(|i| self.dots.get(*i)).map(at);
        svg.path(&polyline(front), &format!("stroke=\"{LINE}\" stroke-width=\"2\" fill=\"none\""));
        for (i, dot) in self.dots.iter().enumerate().filter(|(_, dot)| dot.at.iter().all(|v| v.is_finite())) {
            self.draw_dot(&mut svg, at(dot), dot, self.line.contains(&i));
        }
        self.draw_arrow(&mut svg, top);
        if let Some(floor) = self.floor {
            // A bar as high as the noise floor.
            let height = (y.at(0.0) - y.at(floor)).abs().max(1.0);
            let [x, middle] = [LEFT + 23.0, BOTTOM - 14.0 - 0.5 * height];
            let [left, foot, head, base] =
                [x - 9.0, x - 13.0, BOTTOM - 14.0 - height, BOTTOM - 14.0].map(num);
            let bar = format!("M{left} {base}V{head}M{foot} {base}h8M{foot} {head}h8");
            svg.path(&bar, "stroke=\"#52606d\" stroke-width=\"1.2\" fill=\"none\"");
            svg.text([x, middle + 4.0], "start", "wire", "less is within noise");
        }
        if let Some((height, name)) = &self.reference {
            let line = format!("M{} {}H{}", num(LEFT), num(y.at(*height)), num(RIGHT));
            let style = "stroke-width=\"1.3\" stroke-dasharray=\"6 4\" fill=\"none\"";
            svg.path(&line, &format!("stroke=\"{REFERENCE}\" {style}"));
            svg.text([RIGHT - 4.0, y.at(*height) - 5.0], "end", "wire", name);
        }
        // Labels stand on the side with more room, each below those that it would cover.
        let mut taken: Vec<[f64; 2]> = Vec::new();
        for dot in self.dots.iter().filter(|d| !d.label.is_empty()) {
            let [cx, cy] = at(dot);
            if !(cx.is_finite() && cy.is_finite()) {
                continue;
            }
            let text = fitting(&dot.label, 0.5 * (RIGHT - LEFT) - 24.0, LETTERS);
            let width = text_width(&text, LETTERS) + 6.0;
            let on_the_right = cx < 0.5 * (LEFT + RIGHT);
            let (x, anchor) = if on_the_right { (cx + 9.0, "start") } else { (cx - 9.0, "end") };
            let from = if on_the_right { x } else { x - width };
            let mut label = [from, cy + 4.0];
            while taken.iter().any(|[x, y]| (x - label[0]).abs() < width && (y - label[1]).abs() < 13.0) {
                label[1] += 13.0;
            }
            taken.push(label);
            svg.text([x, label[1]], anchor, "wire", &text);
        }
        svg.finish()
    }

    fn draw_dot(&self, svg: &mut Svg, at: [f64; 2], dot: &Dot, best: bool) {
        let (colour, opacity) = if best { (LINE, "1") } else { (DOT, "0.55") };
        let fill = match dot.mark {
            Mark::Out => format!("fill=\"#fff\" stroke=\"{colour}\" stroke-width=\"1.4\""),
            Mark::Plain if dot.label.is_empty() => format!("fill=\"{colour}\" fill-opacity=\"{opacity}\""),
            Mark::Plain => format!(
                "fill=\"{colour}\" fill-opacity=\"{opacity}\" stroke=\"#1f2933\" stroke-width=\"1.8\""
            ),
        };
        let ([x, y], r) = (at.map(num), if best { 5 } else { 4 });
        let name = escape(&dot.name);
        svg.raw(format_args!(
            "<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" {fill}><title>{name}</title></circle>\n"
        ));
    }

    /// An arrow above the dots, toward the better corner.
    fn draw_arrow(&self, svg: &mut Svg, top: f64) {
        let (y, dy) = if self.up_is_better { (top - 10.0, -18.0) } else { (top - 28.0, 18.0) };
        let x = RIGHT - 54.0;
        let arrow =
            format!("M{} {}l-22 {}m0 {}v{}h10", num(x), num(y), num(dy), num(-0.5 * dy), num(0.5 * dy));
        svg.path(&arrow, "stroke=\"#2f855a\" stroke-width=\"2\" fill=\"none\"");
        svg.raw(format_args!(
            "<text x=\"{}\" y=\"{}\" class=\"wire\" style=\"fill:#2f855a;font-weight:600\">better</text>\n",
            num(x + 8.0),
            num(top - 15.0)
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::tags;

    fn dot(x: f64, y: f64, label: &str) -> Dot {
        Dot { at: [x, y], name: format!("<{x}>"), label: label.into(), ..Dot::default() }
    }

    #[test]
    fn finite_dots_are_drawn_with_labels() {
        let mut dots = vec![
            dot(1.0, 3.0, "default"),
            dot(10.0, 1.0, "a & b"),
            dot(5.0, 4.0, ""),
            dot(f64::NAN, 1.0, ""),
        ];
        dots[2].mark = Mark::Out;
        let scatter = Scatter {
            title: "cost <and> worth".into(),
            subtitles: vec!["a line".into()],
            x: ("load, %".into(), true),
            y: "error, dB".into(),
            dots,
            line: vec![0, 1],
            reference: Some((0.5, "the model".into())),
            floor: Some(0.2),
            ..Scatter::default()
        };
        let svg = scatter.to_svg();
        let count = tags(&svg);
        assert_eq!(count["circle"], 3);
        for text in ["cost &lt;and&gt; worth", "default", "a &amp; b", "the model", "better", "&lt;10&gt;"] {
            assert!(svg.contains(text), "{text}");
        }
        tags(&Scatter::default().to_svg());
    }

    #[test]
    fn long_label_is_cut_within_the_picture() {
        let long = "a setting of a very long name ".repeat(20);
        for x in [0.0, 0.5, 1.0] {
            let dots = vec![dot(0.0, 0.0, ""), dot(1.0, 1.0, ""), dot(x, 0.5, &long)];
            let svg = Scatter { dots, ..Scatter::default() }.to_svg();
            let line = svg.lines().find(|l| l.contains('…')).unwrap();
            let number = |name: &str| -> f64 {
                line.split(&format!(" {name}=\"")).nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
            };
            let text = line.split('>').nth(1).unwrap().split('<').next().unwrap();
            let (at, width) = (number("x"), text_width(text, LETTERS));
            let left = match () {
                () if line.contains("\"end\"") => at - width,
                () if line.contains("\"middle\"") => at - 0.5 * width,
                () => at,
            };
            assert!(left >= 0.0 && left + width <= SIZE[0] && width > 200.0, "{x}: {line}");
            assert!(!svg.contains(&format!(">{long}</text>")));
        }
    }
}
