//! A matrix of numbers in colours of rising darkness, each number written in its cell.

use super::spectrogram::colour;
use super::svg::{Svg, fitting, text_width, wrapped};

/// A matrix of numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matrix {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading, a line each.
    pub subtitles: Vec<String>,
    /// Name of the rows, and their labels.
    pub rows: (String, Vec<String>),
    /// Name of the columns, and their labels.
    pub columns: (String, Vec<String>),
    /// Numbers of the lightest and the darkest colour.
    pub range: (f64, f64),
    /// Decimals of the numbers.
    pub decimals: usize,
    /// Numbers by row; `None` leaves a cell empty.
    pub cells: Vec<Vec<Option<f64>>>,
}

const CELL: [f64; 2] = [92.0, 34.0];
const MARGIN: f64 = 24.0;
const LINE: f64 = 14.0;
const LINES: usize = 3;
/// Room between the labels of two columns.
const GAP: f64 = 14.0;
const LABEL: f64 = 260.0;
/// Darkest colour, as a part of the scale: its hue is still seen.
const DARKEST: f64 = 0.8;

impl Matrix {
    /// The matrix as an SVG document. Its width follows from the number of columns.
    pub fn to_svg(&self) -> String {
        let label = self.rows.1.iter().chain([&self.rows.0]).map(|l| text_width(l, 12.0));
        let label = label.fold(40.0, f64::max).min(LABEL);
        let (left, across) = (MARGIN + label + 12.0, CELL[0] * self.columns.1.len() as f64);
        let width = (left + across + MARGIN).max(2.0 * MARGIN + text_width(&self.title, 19.0)).max(420.0);
        let head = 66.0 + 18.0 * self.subtitles.len() as f64;
        let names = || self.columns.1.iter().map(|name| wrapped(name, CELL[0] - GAP, 11.0, LINES));
        let most = names().map(|lines| lines.len()).max().unwrap_or(1);
        let top = head + 26.0 + LINE * most as f64;
        let height = top + CELL[1] * self.rows.1.len() as f64 + MARGIN;
        let room = width - 2.0 * MARGIN;
        let subtitles: Vec<String> = self.subtitles.iter().map(|s| fitting(s, room, 12.0)).collect();
        let mut svg = Svg::chart([width, height], MARGIN, &self.title, &subtitles);
        svg.text([left, head + 4.0], "start", "head", &self.columns.0);
        svg.text([MARGIN, top - 10.0], "start", "head", &fitting(&self.rows.0, label, 13.0));
        for (i, lines) in names().enumerate() {
            for (line, text) in lines.iter().enumerate() {
                // Labels end at the cells.
                let up = LINE * (lines.len() - 1 - line) as f64;
                svg.text([left + CELL[0] * (i as f64 + 0.5), top - 10.0 - up], "middle", "ink small", text);
            }
        }
        let (low, high) = self.range;
        for (i, name) in self.rows.1.iter().enumerate() {
            let y = top + CELL[1] * i as f64;
            svg.text([MARGIN, y + CELL[1] / 2.0 + 4.0], "start", "ink", &fitting(name, label, 12.0));
            let values = self.cells.get(i).into_iter().flatten().enumerate();
            for (j, value) in values.take(self.columns.1.len()) {
                let x = left + CELL[0] * j as f64;
                let value = value.filter(|v| v.is_finite());
                let part = value.map_or(0.0, |v| ((v - low) / (high - low)).clamp(0.0, 1.0) * DARKEST);
                let rgb = colour(if part.is_finite() { part } else { 0.0 });
                let [r, g, b] = rgb.map(|v| v.round() as u8);
                let fill = format!("fill=\"#{r:02x}{g:02x}{b:02x}\" stroke=\"#fff\" stroke-width=\"2\"");
                svg.rect([x, y], CELL, &fill);
                let text = value.map_or("–".to_owned(), |v| format!("{v:.*}", self.decimals));
                let is_dark = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2] < 140.0;
                let ink = if is_dark { "light" } else { "ink" };
                svg.text([x + CELL[0] / 2.0, y + CELL[1] / 2.0 + 4.0], "middle", ink, &text);
            }
        }
        svg.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::tags;

    #[test]
    fn every_cell_has_its_number() {
        let matrix = Matrix {
            title: "T".into(),
            rows: ("novel".into(), vec!["Felt & co".into(), "Oak".into()]),
            columns: ("base".into(), vec!["Carpet 2".into(), "Rough plastic".into()]),
            range: (1.0, 7.0),
            decimals: 1,
            cells: vec![vec![Some(1.0), None], vec![Some(7.0), Some(f64::NAN)]],
            ..Matrix::default()
        };
        let svg = matrix.to_svg();
        assert_eq!(tags(&svg)["rect"], 1 + 4);
        assert_eq!(svg.matches(">–<").count(), 2);
        for text in ["\"ink\">1.0<", "\"light\">7.0<", "Felt &amp; co", ">base<", ">novel<"] {
            assert!(svg.contains(text), "{text}: {svg}");
        }
        tags(&Matrix::default().to_svg());
    }
}
