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
        // A dot with a label lies on top, so that nobody takes another for it.
        for labelled in [false, true] {
            let shown = |(_, dot): &(usize, &Dot)| {
                dot.at.iter().all(|v| v.is_finite()) && dot.label.is_empty() != labelled
            };
            for (i, dot) in self.dots.iter().enumerate().filter(shown) {
                self.draw_dot(&mut svg, at(dot), dot, self.line.contains(&i));
            }
        }
        self.draw_arrow(&mut svg, top);
        let mut taken: Vec<Around> = Vec::new();
        if let Some((height, name)) = &self.reference {
            let line = format!("M{} {}H{}", num(LEFT), num(y.at(*height)), num(RIGHT));
            let style = "stroke-width=\"1.3\" stroke-dasharray=\"6 4\" fill=\"none\"";
            svg.path(&line, &format!("stroke=\"{REFERENCE}\" {style}"));
            svg.text([RIGHT - 4.0, y.at(*height) - 5.0], "end", "wire", name);
            let (left, line) = (RIGHT - 4.0 - text_width(name, LETTERS), y.at(*height));
            taken.push(Around { left, right: RIGHT, top: line - 16.0, bottom: line });
        }
        if let Some(floor) = self.floor {
            // A bar as high as the noise floor, in the corner with the fewest dots.
            let height = (y.at(0.0) - y.at(floor)).abs().max(1.0);
            let room = |left: f64, bottom: f64| Around {
                left,
                right: left + 150.0,
                top: bottom - height.max(14.0),
                bottom,
            };
            let [low, high, right] = [BOTTOM - 10.0, top + 6.0 + height.max(14.0), RIGHT - 154.0];
            let corners = [(LEFT + 8.0, low), (right, low), (LEFT + 8.0, high), (right, high)];
            let dots = |corner: &Around| {
                let texts = taken.iter().filter(|other| corner.covers(other)).count();
                self.dots.iter().filter(|dot| corner.has(at(dot))).count() + 100 * texts
            };
            let corner = corners.map(|(left, bottom)| room(left, bottom)).into_iter().min_by_key(dots);
            if let Some(around @ Around { left, top, bottom, .. }) = corner {
                let (middle, x) = (0.5 * (top + bottom), left + 16.0);
                let [post, foot, head, base] =
                    [left + 6.0, left + 2.0, middle - 0.5 * height, middle + 0.5 * height].map(num);
                let bar = format!("M{post} {base}V{head}M{foot} {base}h8M{foot} {head}h8");
                svg.path(&bar, "stroke=\"#52606d\" stroke-width=\"1.2\" fill=\"none\"");
                svg.text([x, middle + 4.0], "start", "wire", "less is within noise");
                taken.push(around);
            }
        }
        let dots: Vec<[f64; 2]> = self.dots.iter().map(at).collect();
        for (dot, at) in self.dots.iter().zip(&dots).filter(|(dot, _)| !dot.label.is_empty()) {
            if at.iter().all(|v| v.is_finite()) {
                draw_label(&mut svg, &dot.label, *at, top, &dots, &mut taken);
            }
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

/// The room that a text takes.
#[derive(Clone, Copy)]
struct Around {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl Around {
    fn covers(&self, other: &Self) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    fn has(&self, [x, y]: [f64; 2]) -> bool {
        (self.left..=self.right).contains(&x) && (self.top..=self.bottom).contains(&y)
    }
}

/// Writes the label of a dot where it covers the fewest dots and no other text. A line leads to it unless it
/// stands right beside its dot.
fn draw_label(
    svg: &mut Svg,
    label: &str,
    [cx, cy]: [f64; 2],
    top: f64,
    dots: &[[f64; 2]],
    taken: &mut Vec<Around>,
) {
    let text = fitting(label, 0.5 * (RIGHT - LEFT) - 24.0, LETTERS);
    let width = text_width(&text, LETTERS);
    let mut best: Option<(usize, Around, [f64; 2])> = None;
    for dy in [0.0, -16.0, 16.0, -32.0, 32.0, -48.0, 48.0, -64.0, 64.0, -96.0, 96.0] {
        for dx in [9.0, 24.0, 48.0, 96.0] {
            for left in [cx + dx, cx - dx - width] {
                let around = Around { left, right: left + width, top: cy + dy - 7.0, bottom: cy + dy + 7.0 };
                let inside =
                    left >= LEFT && around.right <= RIGHT && around.top >= top && around.bottom <= BOTTOM;
                // Far from its dot is as bad as a dot that it covers.
                let covered = dots.iter().filter(|dot| around.has(**dot)).count();
                let texts = taken.iter().filter(|other| around.covers(other)).count();
                let far = (dx / 24.0) as usize + (f64::abs(dy) / 32.0) as usize;
                let cost = 2 * covered + far + 100 * texts + if inside { 0 } else { 1000 };
                if best.as_ref().is_none_or(|(least, ..)| cost < *least) {
                    best = Some((cost, around, [dx, dy]));
                }
            }
        }
    }
    let Some((_, around, [dx, dy])) = best else { return };
    let (on_the_right, middle) = (around.left > cx, cy + dy);
    if dx > 9.0 || dy != 0.0 {
        let near = if on_the_right { around.left - 3.0 } else { around.right + 3.0 };
        let line = format!("M{} {}L{} {}", num(cx), num(cy), num(near), num(middle));
        svg.path(&line, "stroke=\"#1f2933\" stroke-width=\"0.8\" fill=\"none\"");
    }
    let (x, anchor) = if on_the_right { (around.left, "start") } else { (around.right, "end") };
    svg.text([x, middle + 4.0], anchor, "wire", &text);
    taken.push(around);
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

    /// "default" stood beside a hollow dot, and its own lay under others.
    #[test]
    fn label_leads_to_its_own_dot_which_lies_on_top() {
        // A crowd around the dot with the label, some of it hollow.
        let crowd = (0..30).map(|i| Dot {
            mark: if i % 2 == 0 { Mark::Out } else { Mark::Plain },
            ..dot(4.7 + 0.14 * f64::from(i % 6), 2.8 + 0.13 * f64::from(i / 6), "")
        });
        let mut dots = vec![dot(5.05, 3.06, "default"), dot(0.0, 0.0, ""), dot(10.0, 6.0, "")];
        dots.extend(crowd);
        let svg = Scatter { dots, ..Scatter::default() }.to_svg();
        let places = |what: &str| svg.match_indices(what).map(|(at, _)| at).collect::<Vec<_>>();
        let own = svg.find("<title>&lt;5.05&gt;").unwrap();
        assert!(places("<circle").into_iter().all(|circle| circle < own), "its dot is the last");
        let label = svg.find(">default</text>").unwrap();
        let line = svg[own..label].rfind("<path d=\"M").expect("a line leads to the label");
        let circle = svg[..own].rfind("cx=\"").unwrap();
        let cx = svg[circle + 4..own].split('"').next().unwrap();
        assert!(svg[own + line..].starts_with(&format!("<path d=\"M{cx} ")), "from its dot");
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
