//! Dots over two axes: what each of many settings costs and is worth.

use super::axis::{Axis, padded_range};
use super::dots::powers;
use super::svg::{Svg, escape, num, text_width};

/// How a dot is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mark {
    /// One of many.
    #[default]
    Plain,
    /// One of many that cannot be had: hollow.
    Out,
}

/// A dot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dot {
    /// Where it lies.
    pub at: [f64; 2],
    /// What it is called where a pointer rests on it.
    pub name: String,
    /// How it is drawn.
    pub mark: Mark,
    /// What stands beside it; empty for nothing.
    pub label: String,
}

/// Dots over two axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scatter {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading, a line each.
    pub subtitles: Vec<String>,
    /// What goes to the right, and whether equal ratios are equally long.
    pub x: (String, bool),
    /// What goes up.
    pub y: String,
    /// Whether more of it is better; less of what goes to the right always is.
    pub up_is_better: bool,
    /// All dots.
    pub dots: Vec<Dot>,
    /// Those that no other beats, from the left on.
    pub line: Vec<usize>,
    /// A height to compare with, and what it is.
    pub reference: Option<(f64, String)>,
    /// What differs by less than this in height is not told apart.
    pub floor: Option<f64>,
}

const SIZE: [f64; 2] = [820.0, 520.0];
const LEFT: f64 = 76.0;
const RIGHT: f64 = 28.0;
const BOTTOM: f64 = 58.0;
const GRID: &str = "stroke=\"#e4e9ee\" stroke-width=\"1\" fill=\"none\"";
const DOT: &str = "#7b93a8";
const LINE: &str = "#d9730d";
const REFERENCE: &str = "#6b4fa0";
/// Room that a label's text takes up.
const LETTERS: f64 = 12.0;

/// A rectangle: left, top, right, bottom.
type Room = [f64; 4];

impl Scatter {
    /// As an SVG document; empty of dots where nothing is finite.
    pub fn to_svg(&self) -> String {
        let mut svg = Svg::new(SIZE[0], SIZE[1], &self.title);
        svg.text([24.0, 34.0], "start", "title", &self.title);
        for (i, line) in self.subtitles.iter().enumerate() {
            svg.text([24.0, 54.0 + 16.0 * i as f64], "start", "small", line);
        }
        let top = 66.0 + 16.0 * self.subtitles.len() as f64;
        let bottom = SIZE[1] - BOTTOM;
        let place_x = |x: f64| if self.x.1 { x.max(1e-12).log10() } else { x };
        let xs = self.dots.iter().map(|d| place_x(d.at[0]));
        let ys = self.dots.iter().map(|d| d.at[1]).chain(self.reference.iter().map(|r| r.0));
        let (Some(across), Some(up)) = (padded_range(xs), padded_range(ys)) else { return svg.finish() };
        // A decade at the least, so that what hardly differs does not seem to.
        let more = if self.x.1 { (1.0 - (across.1 - across.0)).max(0.0) / 2.0 } else { 0.0 };
        let x = Axis { low: across.0 - more, high: across.1 + more, pixels: [LEFT, SIZE[0] - RIGHT] };
        let y = Axis { low: up.0, high: up.1, pixels: [bottom, top] };
        self.axes(&mut svg, &x, &y, [top, bottom]);
        let at = |d: &Dot| [x.at(place_x(d.at[0])), y.at(d.at[1])];
        let mut taken: Vec<Room> = Vec::new();
        if let Some((height, _)) = &self.reference {
            let h = y.at(*height);
            let style =
                format!("stroke=\"{REFERENCE}\" stroke-width=\"1.3\" stroke-dasharray=\"6 4\" fill=\"none\"");
            svg.path(&format!("M{} {}H{}", num(LEFT), num(h), num(SIZE[0] - RIGHT)), &style);
        }
        let line: Vec<[f64; 2]> = self.line.iter().filter_map(|i| self.dots.get(*i)).map(at).collect();
        let path: String = line
            .iter()
            .enumerate()
            .map(|(i, p)| format!("{}{} {}", if i == 0 { "M" } else { "L" }, num(p[0]), num(p[1])))
            .collect();
        svg.path(&path, &format!("stroke=\"{LINE}\" stroke-width=\"2\" fill=\"none\""));
        for (i, dot) in self.dots.iter().enumerate() {
            let [cx, cy] = at(dot);
            if !(dot.at[0].is_finite() && dot.at[1].is_finite()) {
                continue;
            }
            let best = self.line.contains(&i);
            let colour = if best { LINE } else { DOT };
            let fill = match dot.mark {
                Mark::Plain => {
                    format!("fill=\"{colour}\" fill-opacity=\"{}\"", if best { "1" } else { "0.55" })
                }
                Mark::Out => format!("fill=\"#fff\" stroke=\"{colour}\" stroke-width=\"1.4\""),
            };
            let ring = if dot.label.is_empty() { "" } else { " stroke=\"#1f2933\" stroke-width=\"1.8\"" };
            let fill = if dot.mark == Mark::Plain { fill + ring } else { fill };
            svg.raw(format_args!(
                "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" {fill}><title>{}</title></circle>\n",
                num(cx),
                num(cy),
                if best { "5" } else { "4" },
                escape(&dot.name)
            ));
            taken.push([cx - 4.0, cy - 4.0, cx + 4.0, cy + 4.0]);
        }
        self.better(&mut svg, top);
        for dot in self.dots.iter().filter(|d| !d.label.is_empty()) {
            let [cx, cy] = at(dot);
            let places = AROUND.map(|(dx, dy, anchor)| ([cx + dx, cy + dy], anchor));
            put(&mut svg, &dot.label, &places, [top, bottom], &mut taken);
        }
        if let Some((height, why)) = &self.reference {
            let h = y.at(*height);
            let right = SIZE[0] - RIGHT - 4.0;
            let places = [right, LEFT + 4.0].map(|x| {
                let anchor = if x == right { "end" } else { "start" };
                [([x, h - 5.0], anchor), ([x, h + 14.0], anchor)]
            });
            put(&mut svg, why, places.as_flattened(), [top, bottom], &mut taken);
        }
        if let Some(floor) = self.floor {
            // How high a difference has to be.
            let high = (y.at(0.0) - y.at(floor)).abs().max(1.0);
            let lefts = [LEFT + 23.0, LEFT + 190.0, 0.5 * (LEFT + SIZE[0]), SIZE[0] - RIGHT - 130.0];
            let places: Vec<([f64; 2], &str)> = [14.0, 60.0, 110.0, 160.0]
                .iter()
                .flat_map(|up| lefts.map(|x| ([x, bottom - up - 0.5 * high + 4.0], "start")))
                .collect();
            if let Some([x, y]) = put(&mut svg, "less is not told apart", &places, [top, bottom], &mut taken)
            {
                let base = y - 4.0 + 0.5 * high;
                let (left, foot, head) = (num(x - 9.0), num(x - 13.0), num(base - high));
                let base = num(base);
                let d = format!("M{left} {base}V{head}M{foot} {base}h8M{foot} {head}h8");
                svg.path(&d, "stroke=\"#52606d\" stroke-width=\"1.2\" fill=\"none\"");
            }
        }
        svg.finish()
    }

    fn axes(&self, svg: &mut Svg, x: &Axis, y: &Axis, [top, bottom]: [f64; 2]) {
        let mut grid = String::new();
        let across = if self.x.1 { powers(x) } else { x.ticks(80.0) };
        for (value, label) in &across {
            grid += &format!("M{} {}V{}", num(x.at(*value)), num(top), num(bottom));
            svg.text([x.at(*value), bottom + 18.0], "middle", "small", label);
        }
        for (value, label) in &y.ticks(48.0) {
            grid += &format!("M{} {}H{}", num(LEFT), num(y.at(*value)), num(SIZE[0] - RIGHT));
            svg.text([LEFT - 8.0, y.at(*value) + 4.0], "end", "small", label);
        }
        svg.path(&grid, GRID);
        svg.text([0.5 * (LEFT + SIZE[0] - RIGHT), bottom + 42.0], "middle", "head", &self.x.0);
        svg.raw(format_args!(
            "<text x=\"22\" y=\"{y}\" text-anchor=\"middle\" class=\"head\" transform=\"rotate(-90 22 {y})\">{}</text>\n",
            escape(&self.y),
            y = num(0.5 * (top + bottom)),
        ));
    }

    /// An arrow to where one would like to be, above the dots.
    fn better(&self, svg: &mut Svg, top: f64) {
        let (y, dy) = if self.up_is_better { (top - 10.0, -18.0) } else { (top - 28.0, 18.0) };
        let x = SIZE[0] - RIGHT - 54.0;
        let style = "stroke=\"#2f855a\" stroke-width=\"2\" fill=\"none\"";
        svg.path(
            &format!("M{} {}l-22 {}m0 {}v{}h10", num(x), num(y), num(dy), num(-0.5 * dy), num(0.5 * dy)),
            style,
        );
        svg.raw(format_args!(
            "<text x=\"{}\" y=\"{}\" class=\"wire\" style=\"fill:#2f855a;font-weight:600\">better</text>\n",
            num(x + 8.0),
            num(top - 15.0)
        ));
    }
}

/// Where a label may stand beside its dot, and how it is anchored.
const AROUND: [(f64, f64, &str); 8] = [
    (9.0, 4.0, "start"),
    (-9.0, 4.0, "end"),
    (0.0, -10.0, "middle"),
    (0.0, 19.0, "middle"),
    (8.0, -9.0, "start"),
    (8.0, 18.0, "start"),
    (-8.0, -9.0, "end"),
    (-8.0, 18.0, "end"),
];

/// Puts a text where it covers as little as can be; answers where.
fn put(
    svg: &mut Svg,
    text: &str,
    places: &[([f64; 2], &str)],
    [top, bottom]: [f64; 2],
    taken: &mut Vec<Room>,
) -> Option<[f64; 2]> {
    let text = &fitting(text, 0.5 * (SIZE[0] - LEFT - RIGHT) - 2.0 * LETTERS);
    let width = text_width(text, LETTERS);
    // A little more on the side that is away from the dot.
    let room = |([x, y], anchor): ([f64; 2], &str)| -> Room {
        let (left, right) = match anchor {
            "start" => (x, x + width + 6.0),
            "end" => (x - width - 6.0, x),
            _ => (x - 0.5 * width - 6.0, x + 0.5 * width + 6.0),
        };
        [left, y - 10.0, right, y + 3.0]
    };
    let covers = |r: &Room| -> f64 {
        let shared = |o: &Room| {
            (r[2].min(o[2]) - r[0].max(o[0])).max(0.0) * (r[3].min(o[3]) - r[1].max(o[1])).max(0.0)
        };
        let outside = (LEFT - r[0]).max(0.0) + (r[2] - SIZE[0] + 6.0).max(0.0) + (top - r[1]).max(0.0);
        taken.iter().map(shared).sum::<f64>() + 100.0 * (outside + (r[3] - bottom).max(0.0))
    };
    let place = places.iter().copied().min_by(|a, b| covers(&room(*a)).total_cmp(&covers(&room(*b))))?;
    svg.text(place.0, place.1, "wire", text);
    taken.push(room(place));
    Some(place.0)
}

/// A text that is no wider than this: what is longer ends in an ellipsis.
fn fitting(text: &str, most: f64) -> String {
    if text_width(text, LETTERS) <= most {
        return text.to_owned();
    }
    let (mut short, mut width) = (String::new(), text_width("…", LETTERS));
    for c in text.chars() {
        width += text_width(c.encode_utf8(&mut [0; 4]), LETTERS);
        if width > most {
            break;
        }
        short.push(c);
    }
    short.truncate(short.trim_end().len());
    short + "…"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::tags;

    fn dot(x: f64, y: f64, label: &str) -> Dot {
        Dot { at: [x, y], name: format!("<{x}>"), label: label.into(), ..Dot::default() }
    }

    #[test]
    fn every_finite_dot_is_drawn_and_the_line_joins_the_best() {
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
    fn a_long_label_ends_in_an_ellipsis_within_the_picture() {
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
