//! Which settings are worth their time.

use crate::figure::Figure;
use crate::result::{Results, Row};

impl Results {
    /// Numbers of the rows that no other beats: sound, and told apart from everything that takes less time; the cheapest comes first.
    pub fn undominated(&self, figure: Figure) -> Vec<usize> {
        self.front(figure, |row| row.load())
    }

    /// The same where another cost is to be little, such as the lag.
    pub fn front(&self, figure: Figure, cost: impl Fn(&Row) -> Option<f64>) -> Vec<usize> {
        let known = |(i, row): (usize, &Row)| {
            Some((i, cost(row)?, row.figure(figure)?)).filter(|_| row.sound() && row.time.is_some())
        };
        let mut rows: Vec<(usize, f64, f64)> = self.rows.iter().enumerate().filter_map(known).collect();
        rows.sort_by(|a, b| a.1.total_cmp(&b.1).then(figure.gain(b.2, a.2).total_cmp(&0.0)));
        let mut front: Vec<(usize, f64)> = Vec::new();
        for (i, _, value) in rows {
            let better = front
                .last()
                .is_none_or(|(_, best)| figure.gain(value, *best) > 0.0 && self.differ(figure, value, *best));
            if better {
                front.push((i, value));
            }
        }
        front.into_iter().map(|(i, _)| i).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{measured, results};

    #[test]
    fn what_takes_more_time_must_be_told_apart_from_what_takes_less() {
        let mut broken = measured("broken", 0.5, 0.1, 20.0);
        broken.fails.insert("teleport".into(), "it flies".into());
        let all = results(vec![
            measured("dear and good", 5.0, 0.5, 20.0),
            measured("cheap", 1.0, 3.0, 20.0),
            measured("dearer and hardly better", 6.0, 0.45, 20.0),
            measured("dearer than cheap and worse", 2.0, 3.5, 20.0),
            measured("between", 2.5, 2.0, 20.0),
            broken,
        ]);
        let names: Vec<&str> =
            all.undominated(Figure::Level).into_iter().map(|i| all.rows[i].name.as_str()).collect();
        assert_eq!(names, ["cheap", "between", "dear and good"]);
        assert!(all.undominated(Figure::Bands).is_empty());
    }
}
