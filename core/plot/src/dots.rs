//! Rows of dots: a line for each row, a column for each figure with a scale of its own.

use super::axis::{Axis, padded_range};
use super::svg::{Svg, escape, num, text_width};

/// A figure of every row.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// What it is.
    pub name: String,
    /// Its unit, or what else stands smaller under the name.
    pub unit: String,
    /// Decimals of the values that are written beside the dots.
    pub decimals: usize,
    /// Whether equal ratios are equally long; all values are then above 0.
    pub logarithmic: bool,
    /// For each row nothing, a value, or three: a middle one between its ends.
    pub values: Vec<Vec<f64>>,
    /// Values of others with their names: ticks in a line of their own under the rows.
    pub others: Vec<(String, f64)>,
}

/// A table of dots.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dots {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading, a line each.
    pub subtitles: Vec<String>,
    /// What each row is called.
    pub rows: Vec<String>,
    /// What the line of the others is called.
    pub others: String,
    /// Groups of columns, one under the other, each with a heading; a group that is too wide goes on below.
    pub groups: Vec<(String, Vec<Column>)>,
}

const WIDTH: f64 = 1200.0;
const MARGIN: f64 = 40.0;
const ROW: f64 = 23.0;
const HEAD: f64 = 64.0;
const FOOT: f64 = 44.0;
const GAP: f64 = 26.0;
/// Most columns beside each other, and the widest a label may be.
const COLUMNS: usize = 8;
const LABEL: f64 = 300.0;
const GRID: &str = "stroke=\"#e4e9ee\" stroke-width=\"1\" fill=\"none\" shape-rendering=\"crispEdges\"";
const DOT: &str = "#0a6fb0";
const BEST: &str = "#d1602a";
const OTHER: &str = "#8795a1";

impl Dots {
    /// The table as an SVG document, 1200 pixels wide.
    pub fn to_svg(&self) -> String {
        let bands: Vec<(&str, &[Column])> = self
            .groups
            .iter()
            .flat_map(|(name, columns)| {
                columns.chunks(beside(columns.len())).map(move |c| (name.as_str(), c))
            })
            .collect();
        let top = 60.0 + 18.0 * self.subtitles.len() as f64;
        let height = top + bands.iter().map(|(_, c)| self.band_height(c)).sum::<f64>() + 12.0;
        let mut svg = Svg::new(WIDTH, height, &self.title);
        svg.text([MARGIN, 36.0], "start", "title", &self.title);
        for (i, line) in self.subtitles.iter().enumerate() {
            svg.text([MARGIN, 57.0 + 18.0 * i as f64], "start", "", line);
        }
        let mut at = top;
        for (name, columns) in bands {
            let all = self.groups.iter().find(|(n, _)| n == name).map_or(columns.len(), |(_, c)| c.len());
            self.band(&mut svg, at, name, columns, beside(all));
            at += self.band_height(columns);
        }
        svg.finish()
    }

    /// Rows of a band, with the line of the others where one of its columns has some.
    fn lines(&self, columns: &[Column]) -> usize {
        self.rows.len() + usize::from(columns.iter().any(|c| !c.others.is_empty()))
    }

    fn band_height(&self, columns: &[Column]) -> f64 {
        HEAD + ROW * self.lines(columns) as f64 + FOOT
    }

    /// A band with room for so many columns.
    fn band(&self, svg: &mut Svg, top: f64, name: &str, columns: &[Column], room: usize) {
        let labels = self.rows.iter().chain([&self.others]);
        let label = labels.map(|l| text_width(l, 12.0)).fold(60.0, f64::max).min(LABEL) + 14.0;
        let lines = self.lines(columns);
        let (first, last) = (top + HEAD, top + HEAD + ROW * lines as f64);
        svg.text([MARGIN, top + 20.0], "start", "head", name);
        for line in 0..lines {
            let y = first + ROW * (line as f64 + 0.5);
            svg.path(&format!("M{} {}H{}", num(MARGIN), num(y), num(WIDTH - MARGIN)), GRID);
            let (text, class) = match self.rows.get(line) {
                Some(text) => (text, "ink"),
                None => (&self.others, "small"),
            };
            let shown = cut(text, label - 14.0);
            let (w, h) = (text_width(&shown, 12.0) + 10.0, ROW - 4.0);
            svg.rect([MARGIN, y - h / 2.0], [w, h], "fill=\"#fff\"");
            svg.text([MARGIN, y + 4.0], "start", class, &shown);
        }
        let width = (WIDTH - 2.0 * MARGIN - label) / room as f64;
        for (i, column) in columns.iter().enumerate() {
            let left = MARGIN + label + width * i as f64;
            self.column(svg, column, [left, left + width], [first, last]);
        }
    }

    fn column(&self, svg: &mut Svg, column: &Column, [left, right]: [f64; 2], [top, bottom]: [f64; 2]) {
        // What is written stands right of the last dot at the latest.
        let texts = column.values.iter().filter_map(|v| v.get(v.len() / 2));
        let room = texts.map(|v| text_width(&written(*v, column.decimals), 11.0)).fold(0.0, f64::max);
        let pixels = [left, (right - GAP - room).max(left + 20.0)];
        let middle = (left + right - GAP) / 2.0;
        svg.text([middle, top - 22.0], "middle", "ink", &cut(&column.name, right - left));
        svg.text([middle, top - 8.0], "middle", "small", &cut(&column.unit, right - left));
        let place = |v: f64| if column.logarithmic { v.max(1e-9).log10() } else { v };
        let all = column.values.iter().flatten().chain(column.others.iter().map(|(_, v)| v));
        let zero = (!column.logarithmic).then_some(0.0);
        let Some((low, high)) = padded_range(all.map(|v| place(*v)).chain(zero)) else { return };
        // A decade at the least, so that what hardly differs does not seem to.
        let more = if column.logarithmic { (1.0 - (high - low)).max(0.0) / 2.0 } else { 0.0 };
        let x = Axis { low: low - more, high: high + more, pixels };
        let ticks = if column.logarithmic { powers(&x) } else { x.ticks(45.0) };
        let mut grid = String::new();
        for (value, label) in &ticks {
            grid += &format!("M{} {}V{}", num(x.at(*value)), num(top), num(bottom));
            svg.text([x.at(*value), bottom + 15.0], "middle", "small", label);
        }
        svg.path(&grid, GRID);
        let least = column.values.iter().filter_map(|v| v.get(v.len() / 2)).copied().fold(f64::MAX, f64::min);
        for (row, values) in column.values.iter().enumerate() {
            let y = top + ROW * (row as f64 + 0.5);
            let Some(&value) = values.get(values.len() / 2).filter(|v| v.is_finite()) else { continue };
            let at = |v: f64| x.at(place(v));
            let (from, to) = match *values.as_slice() {
                [a, _, b] => (at(a), at(b)),
                _ => (at(value), at(value)),
            };
            let text = written(value, column.decimals);
            // What is written alike is alike.
            let best = self.rows.len() > 1 && text == written(least, column.decimals);
            let colour = if best { BEST } else { DOT };
            svg.path(
                &format!("M{} {}H{}", num(from), num(y), num(to)),
                &format!("stroke=\"{colour}\" stroke-width=\"2.5\""),
            );
            svg.raw(format_args!(
                "<circle cx=\"{}\" cy=\"{}\" r=\"4.5\" fill=\"{colour}\"/>\n",
                num(at(value)),
                num(y)
            ));
            svg.text([to.max(at(value) + 2.0) + 6.0, y + 4.0], "start", "wire", &text);
        }
        let y = top + ROW * (self.rows.len() as f64 + 0.5);
        for (name, value) in column.others.iter().filter(|(_, v)| v.is_finite()) {
            svg.raw(format_args!(
                "<path d=\"M{} {}v12\" stroke=\"{OTHER}\" stroke-width=\"1.5\"><title>{} {}</title></path>\n",
                num(x.at(place(*value))),
                num(y - 6.0),
                escape(name),
                written(*value, column.decimals)
            ));
        }
    }
}

/// How many of so many columns stand beside each other, so that bands are about equally full.
fn beside(columns: usize) -> usize {
    columns.div_ceil(columns.div_ceil(COLUMNS).max(1)).max(1)
}

/// A value with a proper minus sign, and no negative zero.
fn written(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let zero = !text.contains(|c: char| c.is_ascii_digit() && c != '0');
    let text = if zero { text.trim_start_matches('-').to_owned() } else { text };
    text.replace('-', "\u{2212}")
}

/// 1, 2 and 5 of every power of ten within an axis of logarithms; fewer where they would be too near each other.
pub(super) fn powers(axis: &Axis) -> Vec<(f64, String)> {
    let decades = axis.high - axis.low;
    let wanted = (axis.pixels[1] - axis.pixels[0]) / 40.0;
    let factors: &[f64] = if decades * 3.0 <= wanted { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let exponents = axis.low.floor() as i32..=axis.high.ceil() as i32;
    let all = exponents.flat_map(|e| factors.iter().map(move |f| (f.log10() + f64::from(e), f, e)));
    all.filter(|(at, ..)| (axis.low..=axis.high).contains(at))
        .map(|(at, f, e)| (at, format!("{:.*}", (-e).max(0) as usize, f * 10f64.powi(e))))
        .collect()
}

/// A text that is no wider than this in pixels at 12 to the em.
fn cut(text: &str, width: f64) -> String {
    if text_width(text, 12.0) <= width {
        return text.to_owned();
    }
    let mut shown = String::new();
    for c in text.chars() {
        shown.push(c);
        if text_width(&shown, 12.0) > width - 12.0 {
            break;
        }
    }
    shown + "…"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::tags;

    fn column(values: Vec<Vec<f64>>, logarithmic: bool) -> Column {
        let (name, unit) = ("f".to_owned(), "ms".to_owned());
        Column { name, unit, decimals: 1, logarithmic, values, others: vec![("old <one>".into(), 3.0)] }
    }

    #[test]
    fn every_value_has_a_dot_and_what_is_not_there_has_none() {
        let dots = Dots {
            title: "A <title>".into(),
            rows: vec!["spsi".into(), "a & b".into(), "gone".into()],
            others: "published".into(),
            groups: vec![(
                "g".into(),
                vec![
                    column(vec![vec![1.0], vec![1.0, 2.0, 3.0], vec![]], false),
                    column(vec![vec![0.5], vec![f64::NAN], vec![20.0]], true),
                    column(vec![vec![], vec![], vec![]], false),
                ],
            )],
            ..Dots::default()
        };
        let svg = dots.to_svg();
        let count = tags(&svg);
        assert_eq!(count["circle"], 4);
        for text in ["spsi", "a &amp; b", "gone", "published", "old &lt;one&gt;", "A &lt;title&gt;"] {
            assert!(svg.contains(text), "{text}");
        }
        tags(&Dots::default().to_svg());
    }

    #[test]
    fn columns_go_on_below_in_bands_of_about_the_same_width() {
        assert_eq!([0, 1, 8, 9, 16, 17].map(beside), [1, 1, 8, 5, 8, 6]);
    }

    #[test]
    fn a_long_label_is_cut_to_its_place() {
        assert_eq!(cut("spsi", 100.0), "spsi");
        let shown = cut(&"sample_commit:frames=10,".repeat(4), 200.0);
        assert!(shown.ends_with('…') && text_width(&shown, 12.0) <= 215.0, "{shown}");
    }

    #[test]
    fn logarithms_are_marked_at_round_values() {
        let axis = Axis { low: -0.2, high: 1.4, pixels: [0.0, 120.0] };
        let labels: Vec<String> = powers(&axis).into_iter().map(|t| t.1).collect();
        assert_eq!(labels, ["1", "10"]);
        let wide = Axis { pixels: [0.0, 400.0], ..axis };
        let labels: Vec<String> = powers(&wide).into_iter().map(|t| t.1).collect();
        assert_eq!(labels, ["1", "2", "5", "10", "20"]);
    }
}
