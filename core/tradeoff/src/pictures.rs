//! Results as pictures: SVG files, and a chart in the terminal.

use std::fmt::Write as _;

use asperity_plot::{Dot, Mark, Scatter};

use crate::figure::Figure;
use crate::results::{Results, Row};

/// Columns and lines of a chart.
const SIZE: (usize, usize) = (66, 16);

impl Results {
    /// File name of a picture of a figure over `time` or `lag`.
    pub fn picture_name(figure: Figure, over: &str) -> String {
        format!("{}_{over}.svg", figure.name())
    }

    /// A figure over the load, as SVG; none where no setting has both.
    pub fn over_time(&self, figure: Figure) -> Option<String> {
        let subtitle = "Load: median time of a length of signal, in per cent of that length; one core.";
        self.scatter(figure, ("load, % of a core", true), Row::load, subtitle)
    }

    /// A figure over the response lag, as SVG; none where no setting has both.
    pub fn over_lag(&self, figure: Figure) -> Option<String> {
        let subtitle = "Response lag: from a step of the stylus's speed until half of the change of level.";
        self.scatter(figure, ("response lag, ms", false), Row::lag50, subtitle)
    }

    fn scatter(
        &self,
        figure: Figure,
        x: (&str, bool),
        cost: fn(&Row) -> Option<f64>,
        subtitle: &str,
    ) -> Option<String> {
        let front = self.pareto_front_over(figure, cost);
        let mut dots = Vec::new();
        let mut line = vec![0; front.len()];
        for (i, row) in self.rows.iter().enumerate() {
            let (Some(x), Some(y)) = (cost(row), row.figure(figure)) else { continue };
            if let Some(at) = front.iter().position(|f| *f == i) {
                line[at] = dots.len();
            }
            let label = if row.baseline || row.default { row.name.clone() } else { String::new() };
            let mark = if row.sound() { Mark::Plain } else { Mark::Out };
            dots.push(Dot { at: [x, y], name: row.name.clone(), mark, label });
        }
        if dots.is_empty() {
            return None;
        }
        let mut title = figure.title().to_owned();
        if let Some(first) = title.get_mut(..1) {
            first.make_ascii_uppercase();
        }
        let y = figure.with_unit().replace(' ', ", ");
        let counted = format!("{} settings; orange: Pareto front; hollow: cannot be chosen.", dots.len());
        let reference = self.model.get(&figure).filter(|_| figure.against_physics());
        let scatter = Scatter {
            title,
            subtitles: vec![subtitle.to_owned(), counted],
            x: (x.0.to_owned(), x.1),
            y,
            up_is_better: figure.more_is_better(),
            dots,
            line,
            reference: reference.map(|m| (*m, "for reference: the network's own magnitudes".to_owned())),
            floor: self.noise_floor.get(&figure).copied().filter(|f| *f > 0.0),
        };
        Some(scatter.to_svg())
    }

    /// A figure over the load, as text; empty where no setting has both.
    pub fn chart(&self, figure: Figure) -> String {
        let known = |(i, row): (usize, &Row)| {
            let (x, y) = (row.load().filter(|l| *l > 0.0)?.log10(), row.figure(figure)?);
            (x.is_finite() && y.is_finite()).then_some((i, x, y))
        };
        let mut all: Vec<(usize, f64, f64)> = self.rows.iter().enumerate().filter_map(known).collect();
        if all.is_empty() {
            return String::new();
        }
        let ends = |of: fn(&(usize, f64, f64)) -> f64| {
            let each = || all.iter().map(of);
            (each().fold(f64::INFINITY, f64::min), each().fold(f64::NEG_INFINITY, f64::max))
        };
        let ((left, right), (low, high)) = (ends(|p| p.1), ends(|p| p.2));
        let (width, height) = SIZE;
        let part = |x: f64, from: f64, to: f64| if to > from { (x - from) / (to - from) } else { 0.5 };
        let front = self.pareto_front(figure);
        // Higher ranks are drawn over lower ones.
        let rank = |i: usize| match (&self.rows[i], front.contains(&i)) {
            (Row { default: true, .. }, _) => (4, 'D'),
            (Row { baseline: true, .. }, _) => (3, 'B'),
            (_, true) => (2, 'o'),
            (row, _) if row.sound() => (1, '.'),
            _ => (0, 'x'),
        };
        all.sort_by_key(|(i, ..)| rank(*i).0);
        let mut cells = vec![vec![' '; width]; height];
        for (i, x, y) in all {
            let column = (part(x, left, right) * (width - 1) as f64).round() as usize;
            let line = ((1.0 - part(y, low, high)) * (height - 1) as f64).round() as usize;
            cells[line][column] = rank(i).1;
        }
        let decimals = figure.decimals();
        let better = if figure.more_is_better() { "more is better" } else { "less is better" };
        let unit = if figure.unit().is_empty() { String::new() } else { format!(" [{}]", figure.unit()) };
        let mut out = format!("{}{unit}, {better}\n", figure.title());
        for (n, line) in cells.iter().enumerate() {
            let value = high - (high - low) * n as f64 / (height - 1) as f64;
            let label = if n % 5 == 0 { format!("{value:8.decimals$}") } else { " ".repeat(8) };
            let _ = writeln!(out, "{label} |{}", line.iter().collect::<String>().trim_end());
        }
        let (pad, ends) = (width - 20, [left, right].map(|end| 10f64.powf(end)));
        let _ = writeln!(out, "{:8} +{}", "", "-".repeat(width));
        let _ = writeln!(out, "{:8}  {:<.3} %{:>pad$.3} % of a core", "", ends[0], ends[1]);
        out + "          D the default, B a baseline, o Pareto front, x cannot be chosen\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{default_row, measured, results, row};

    #[test]
    fn chart_marks_default_front_and_failures() {
        let mut broken = measured("broken", 8.0, 2.0, 20.0);
        broken.fails.insert("c".into(), "f".into());
        let all = results(vec![
            default_row(2.0, 1.0, 20.0),
            broken,
            measured("cheap", 0.5, 3.0, 20.0),
            measured("dear", 8.0, 2.5, 20.0),
            row("nothing known"),
        ]);
        let text = all.chart(Figure::Level);
        let marks = |c: char| {
            text.lines().skip(1).take(16).flat_map(|l| l.chars().skip(9)).filter(|x| *x == c).count()
        };
        assert_eq!([marks('D'), marks('o'), marks('x'), marks('.')], [1, 1, 1, 1], "{text}");
        assert_eq!(all.chart(Figure::Bands), "");
    }
}
