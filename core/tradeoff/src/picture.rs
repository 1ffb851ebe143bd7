//! Results as pictures.

use asperity_plot::{Dot, Mark, Scatter};

use crate::figure::Figure;
use crate::result::{Results, Row};

impl Results {
    /// A picture of a figure against the time it takes; none where no setting has both.
    pub fn against_time(&self, figure: Figure) -> Option<String> {
        let subtitle = "Load: median time that a length of signal takes, in per cent of it; one core.";
        self.scatter(figure, ("load, % of a core", true), Row::load, subtitle)
    }

    /// A picture of a figure against the response lag; none where no setting has both.
    pub fn against_lag(&self, figure: Figure) -> Option<String> {
        let subtitle =
            "Lag: from a step of the stylus's speed until the level is half of the way to its new value.";
        self.scatter(figure, ("response lag, ms", false), Row::lag50, subtitle)
    }

    fn scatter(
        &self,
        figure: Figure,
        x: (&str, bool),
        cost: fn(&Row) -> Option<f64>,
        subtitle: &str,
    ) -> Option<String> {
        let front = self.front(figure, cost);
        let mut dots = Vec::new();
        let mut line = vec![0; front.len()];
        for (i, row) in self.rows.iter().enumerate() {
            let (Some(x), Some(y)) = (cost(row), row.figure(figure)) else { continue };
            if let Some(at) = front.iter().position(|f| *f == i) {
                line[at] = dots.len();
            }
            let label = if row.mark || row.default { row.name.clone() } else { String::new() };
            let mark = if row.sound() { Mark::Plain } else { Mark::Out };
            dots.push(Dot { at: [x, y], name: row.name.clone(), mark, label });
        }
        if dots.is_empty() {
            return None;
        }
        let title = figure.title();
        let mut title = title.to_owned();
        if let Some(first) = title.get_mut(..1) {
            first.make_ascii_uppercase();
        }
        let y = match figure.unit() {
            "" => figure.name().to_owned(),
            unit => format!("{}, {unit}", figure.name()),
        };
        let reference =
            self.model.get(&figure).map(|m| (*m, "for reference: the network's own magnitudes".to_owned()));
        let scatter = Scatter {
            title,
            subtitles: vec![
                subtitle.to_owned(),
                format!(
                    "{} settings; orange: no other is told apart from them at less cost; hollow: cannot be chosen.",
                    dots.len()
                ),
            ],
            x: (x.0.to_owned(), x.1),
            y,
            up_is_better: figure.more_is_better(),
            dots,
            line,
            reference: reference.filter(|_| figure.of_the_whole()),
            floor: self.floor.get(&figure).copied().filter(|f| *f > 0.0),
        };
        Some(scatter.to_svg())
    }
}
