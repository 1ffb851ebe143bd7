//! A table of dots: a row for each method, a column with its own scale for each figure.

use super::axis::{Axis, Panel};
use super::svg::{COLOURS, Svg, fitting, num, text_width};

/// A figure of every row.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name of the figure.
    pub name: String,
    /// Its unit, smaller, under the name.
    pub unit: String,
    /// Decimals of the values beside the dots.
    pub decimals: usize,
    /// Whether the scale is logarithmic. All values are then above 0.
    pub logarithmic: bool,
    /// For each row nothing, one value, or three: low, middle and high.
    pub values: Vec<Vec<f64>>,
    /// Reference values with their names: ticks in a row of their own below the others.
    pub others: Vec<(String, f64)>,
}

/// A table of dots.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dots {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading, a line each.
    pub subtitles: Vec<String>,
    /// Label of each row.
    pub rows: Vec<String>,
    /// Label of the row of reference values.
    pub others: String,
    /// Groups of columns, one under the other, each with a heading. Wide groups continue below.
    pub groups: Vec<(String, Vec<Column>)>,
    /// Notes at the foot, a line each.
    pub notes: Vec<String>,
}

const WIDTH: f64 = 1200.0;
const MARGIN: f64 = 40.0;
const ROW: f64 = 23.0;
const HEAD: f64 = 64.0;
const FOOT: f64 = 44.0;
const NOTE: f64 = 17.0;
const GAP: f64 = 26.0;
/// Most columns in a band, and greatest width of a label.
const COLUMNS: usize = 8;
const LABEL: f64 = 300.0;
const DOT: &str = COLOURS[0];
const BEST: &str = COLOURS[1];
const OTHER: &str = "#8795a1";

impl Dots {
    /// The table as an SVG document, 1200 pixels wide.
    pub fn to_svg(&self) -> String {
        let bands: Vec<(&str, &[Column], usize)> = self
            .groups
            .iter()
            .flat_map(|(name, all)| {
                let room = columns_per_band(all.len());
                all.chunks(room).map(move |columns| (name.as_str(), columns, room))
            })
            .collect();
        let top = 60.0 + 18.0 * self.subtitles.len() as f64;
        let bottom = top + bands.iter().map(|(_, c, _)| self.band_height(c)).sum::<f64>();
        let height = bottom + NOTE * self.notes.len() as f64 + 12.0;
        let mut svg = Svg::chart([WIDTH, height], MARGIN, &self.title, &self.subtitles);
        let mut at = top;
        for (name, columns, room) in bands {
            self.band(&mut svg, at, name, columns, room);
            at += self.band_height(columns);
        }
        for (note, line) in self.notes.iter().zip(0_u32..) {
            let shown = fitting(note, WIDTH - 2.0 * MARGIN, 11.0);
            svg.text([MARGIN, bottom + NOTE * f64::from(line)], "start", "small", &shown);
        }
        svg.finish()
    }

    /// Rows of a band; one more where a column has reference values.
    fn lines(&self, columns: &[Column]) -> usize {
        self.rows.len() + usize::from(columns.iter().any(|c| !c.others.is_empty()))
    }

    fn band_height(&self, columns: &[Column]) -> f64 {
        HEAD + ROW * self.lines(columns) as f64 + FOOT
    }

    /// Draws a band that is divided into `room` columns.
    fn band(&self, svg: &mut Svg, top: f64, name: &str, columns: &[Column], room: usize) {
        let labels = self.rows.iter().chain([&self.others]);
        let label = labels.map(|l| text_width(l, 12.0)).fold(60.0, f64::max).min(LABEL) + 14.0;
        let lines = self.lines(columns);
        let (first, last) = (top + HEAD, top + HEAD + ROW * lines as f64);
        svg.text([MARGIN, top + 20.0], "start", "head", name);
        let middles: Vec<(f64, String)> =
            (0..lines).map(|line| (first + ROW * (line as f64 + 0.5), String::new())).collect();
        // Values of this axis are pixels.
        let pixels = Axis::linear((first, last), [first, last]);
        Panel { x: Axis::linear((0.0, 1.0), [MARGIN, WIDTH - MARGIN]), y: pixels }.y_grid(svg, &middles);
        for (line, (y, _)) in middles.into_iter().enumerate() {
            let (text, class) = self.rows.get(line).map_or((&self.others, "small"), |text| (text, "ink"));
            let shown = fitting(text, label - 14.0, 12.0);
            let (w, h) = (1.05 * text_width(&shown, 12.0) + 10.0, ROW - 4.0);
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
        // Right of the last dot there is room for its value.
        let middles = || column.values.iter().filter_map(|v| v.get(v.len() / 2)).copied();
        let room = middles().map(|v| text_width(&written(v, column.decimals), 11.0)).fold(0.0, f64::max);
        let pixels = [left, (right - GAP - room).max(left + 20.0)];
        let middle = (left + right - GAP) / 2.0;
        svg.text([middle, top - 22.0], "middle", "ink", &fitting(&column.name, right - left, 12.0));
        svg.text([middle, top - 8.0], "middle", "small", &fitting(&column.unit, right - left, 12.0));
        let all = column.values.iter().flatten().chain(column.others.iter().map(|(_, v)| v)).copied();
        let zero = (!column.logarithmic).then_some(0.0);
        let Some(x) = Axis::around(all.chain(zero), column.logarithmic, pixels) else { return };
        let x = x.at_least_a_decade();
        let panel = Panel { x, y: Axis::linear((0.0, 1.0), [bottom, top]) };
        panel.x_grid(svg, 45.0);
        panel.x_labels(svg, 45.0, "");
        let least = middles().fold(f64::MAX, f64::min);
        for (row, values) in column.values.iter().enumerate() {
            let y = top + ROW * (row as f64 + 0.5);
            let Some(&value) = values.get(values.len() / 2).filter(|v| v.is_finite()) else { continue };
            let (from, to) = match *values.as_slice() {
                [a, _, b] => (x.at(a), x.at(b)),
                _ => (x.at(value), x.at(value)),
            };
            let text = written(value, column.decimals);
            // Values that are written alike count as equal.
            let best = self.rows.len() > 1 && text == written(least, column.decimals);
            let colour = if best { BEST } else { DOT };
            let stroke = format!("stroke=\"{colour}\" stroke-width=\"2.5\"");
            svg.path(&format!("M{} {}H{}", num(from), num(y), num(to)), &stroke);
            svg.circle([x.at(value), y], 4.5, &format!("fill=\"{colour}\""));
            svg.text([to.max(x.at(value) + 2.0) + 6.0, y + 4.0], "start", "wire", &text);
        }
        let y = top + ROW * (self.rows.len() as f64 + 0.5);
        for (name, value) in column.others.iter().filter(|(_, v)| v.is_finite()) {
            let title = format!("{name} {}", written(*value, column.decimals));
            let line = format!("M{} {}v12", num(x.at(*value)), num(y - 6.0));
            svg.titled_path(&line, &format!("stroke=\"{OTHER}\" stroke-width=\"1.5\""), &title);
        }
    }
}

/// Columns in a band, so that the bands of a group are about equally full.
fn columns_per_band(columns: usize) -> usize {
    columns.div_ceil(columns.div_ceil(COLUMNS).max(1)).max(1)
}

/// A value with a true minus sign, and no negative zero.
fn written(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let zero = !text.contains(|c: char| c.is_ascii_digit() && c != '0');
    let text = if zero { text.trim_start_matches('-').to_owned() } else { text };
    text.replace('-', "\u{2212}")
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
    fn only_finite_values_have_dots() {
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
    fn wide_groups_are_split_into_equal_bands() {
        assert_eq!([0, 1, 8, 9, 16, 17].map(columns_per_band), [1, 1, 8, 5, 8, 6]);
    }
}
