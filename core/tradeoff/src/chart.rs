//! Results in a terminal.

use std::fmt::Write as _;

use crate::figure::Figure;
use crate::result::{Results, Row};

/// Columns and lines of a chart.
const SIZE: (usize, usize) = (66, 16);

impl Results {
    /// A figure over the load, as text; empty where no setting has both.
    pub fn chart(&self, figure: Figure) -> String {
        let known = |row: &Row| Some((row.load().filter(|l| *l > 0.0)?.log10(), row.figure(figure)?));
        let all: Vec<(usize, (f64, f64))> =
            self.rows.iter().enumerate().filter_map(|(i, row)| Some((i, known(row)?))).collect();
        let range = |of: fn(&(f64, f64)) -> f64| {
            let each = || all.iter().map(|(_, at)| of(at)).filter(|x| x.is_finite());
            (each().fold(f64::INFINITY, f64::min), each().fold(f64::NEG_INFINITY, f64::max))
        };
        let ((left, right), (low, high)) = (range(|p| p.0), range(|p| p.1));
        if all.is_empty() || !(low.is_finite() && left.is_finite()) {
            return String::new();
        }
        let (width, height) = SIZE;
        let part = |x: f64, from: f64, to: f64| if to > from { (x - from) / (to - from) } else { 0.5 };
        let mut cells = vec![vec![' '; width]; height];
        let front = self.undominated(figure);
        // What is to be seen last covers the rest.
        let rank = |i: usize| {
            let row = &self.rows[i];
            match (row.default, row.mark, front.contains(&i), row.sound()) {
                (true, ..) => (4, 'D'),
                (_, true, ..) => (3, 'M'),
                (_, _, true, _) => (2, 'o'),
                (_, _, _, true) => (1, '.'),
                _ => (0, 'x'),
            }
        };
        let mut order = all.clone();
        order.sort_by_key(|(i, _)| rank(*i).0);
        for (i, (x, y)) in order {
            let column = (part(x, left, right) * (width - 1) as f64).round() as usize;
            let line = ((1.0 - part(y, low, high)) * (height - 1) as f64).round() as usize;
            if let Some(cell) = cells.get_mut(line).and_then(|l| l.get_mut(column)) {
                *cell = rank(i).1;
            }
        }
        let decimals = figure.decimals();
        let better = if figure.more_is_better() { "more is better" } else { "less is better" };
        let unit = if figure.unit().is_empty() { String::new() } else { format!(" [{}]", figure.unit()) };
        let mut out = format!("{}{unit}, {better}\n", figure.title());
        for (n, line) in cells.iter().enumerate() {
            let value = high - (high - low) * n as f64 / (height - 1) as f64;
            let label = if n % 5 == 0 { format!("{value:8.decimals$}") } else { " ".repeat(8) };
            let text: String = line.iter().collect();
            let _ = writeln!(out, "{label} |{}", text.trim_end());
        }
        let _ = writeln!(out, "{:8} +{}", "", "-".repeat(width));
        let ends = (10f64.powf(left), 10f64.powf(right));
        let _ = writeln!(
            out,
            "{:8}  {:<.3} %{:>pad$.3} % of a core",
            "",
            ends.0,
            ends.1,
            pad = width.saturating_sub(20)
        );
        out += "          D the default, M a mark, o not told apart from anything at less cost, x a hard case fails\n";
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{measured, results, row};

    #[test]
    fn the_default_the_best_and_what_fails_are_told_apart() {
        let mut default = measured("default", 2.0, 1.0, 20.0);
        default.default = true;
        let mut broken = measured("broken", 8.0, 2.0, 20.0);
        broken.fails.insert("c".into(), "f".into());
        let cheap = measured("cheap", 0.5, 3.0, 20.0);
        let all =
            results(vec![default, broken, cheap, measured("dear", 8.0, 2.5, 20.0), row("nothing known")]);
        let text = all.chart(Figure::Level);
        let marks = |c: char| {
            text.lines().skip(1).take(16).flat_map(|l| l.chars().skip(9)).filter(|x| *x == c).count()
        };
        assert_eq!([marks('D'), marks('o'), marks('x'), marks('.')], [1, 1, 1, 1], "{text}");
        assert_eq!(all.chart(Figure::Bands), "");
    }
}
