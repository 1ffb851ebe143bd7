//! The best setting that a budget allows.

use crate::figure::Figure;
use crate::result::{Results, Row};

/// What may be spent.
#[derive(Clone, Debug, Default)]
pub struct Budget {
    /// Most microseconds a tick: of the median and of the 99.9th percentile.
    pub tick_us: Option<f64>,
    /// Longest response lag: ms until half of a step of speed is felt.
    pub lag_ms: Option<f64>,
    /// Counts what the machine stalls by itself: the 99.9th percentile as it was measured. Else that of a tick in which nothing is done is
    /// taken off.
    pub strict: bool,
    /// Figures in the order in which they count; by default those against the physics, perceptual first.
    pub by: Vec<Figure>,
    /// Ticks a second that the setting must have.
    pub tick_hz: Option<u32>,
}

/// A setting that was chosen, and how.
#[derive(Clone, Debug)]
pub struct Choice<'r> {
    /// It.
    pub row: &'r Row,
    /// How many settings fit the budget.
    pub fit: usize,
    /// Figures that decided, with how many settings were left after each.
    pub steps: Vec<(Figure, usize)>,
}

/// Why a setting cannot be had.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reason {
    /// It did not run, was not timed, a node failed or a hard case does not hold.
    Unsound,
    /// It takes too long.
    Time,
    /// It answers too late, or whether it does is not known.
    Lag,
    /// It has other ticks.
    Ticks,
}

impl Results {
    /// Whether a setting fits.
    ///
    /// # Errors
    /// Why not.
    pub fn fits(&self, row: &Row, budget: &Budget) -> Result<(), Reason> {
        let Some(time) = row.time.filter(|_| row.sound()) else { return Err(Reason::Unsound) };
        if budget.tick_hz.is_some_and(|hz| hz != row.tick_hz) {
            return Err(Reason::Ticks);
        }
        if let Some(most) = budget.tick_us {
            let stalls = self.empty.filter(|_| !budget.strict).map_or(0.0, |t| t.p999_us);
            if time.p50_us > most || time.p999_us - stalls > most {
                return Err(Reason::Time);
            }
        }
        if let Some(most) = budget.lag_ms
            && row.lag50().is_none_or(|lag| lag > most)
        {
            return Err(Reason::Lag);
        }
        Ok(())
    }

    /// The best setting that fits: by the first figure, of those that are not told apart by the second, and so on; of those that are left the one
    /// that takes least time. None where nothing fits.
    pub fn choose(&self, budget: &Budget) -> Option<Choice<'_>> {
        let mut left: Vec<&Row> = self.rows.iter().filter(|row| self.fits(row, budget).is_ok()).collect();
        let fit = left.len();
        let usual = [Figure::Perceptual, Figure::Spectrum, Figure::Bands, Figure::Level, Figure::Convergence];
        let by = if budget.by.is_empty() { &usual[..] } else { &budget.by };
        let mut steps = Vec::new();
        for &figure in by {
            let known = left.iter().filter_map(|row| row.figure(figure));
            let Some(best) = known.reduce(|a, b| if figure.gain(b, a) > 0.0 { b } else { a }) else {
                continue;
            };
            left.retain(|row| row.figure(figure).is_some_and(|x| !self.differ(figure, x, best)));
            steps.push((figure, left.len()));
        }
        let load = |row: &&&Row| row.load().unwrap_or(f64::INFINITY);
        let row = left.iter().min_by(|a, b| load(a).total_cmp(&load(b)))?;
        Some(Choice { row, fit, steps })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{measured, results};

    fn name<'r>(all: &'r Results, budget: &Budget) -> Option<&'r str> {
        all.choose(budget).map(|c| c.row.name.as_str())
    }

    #[test]
    fn the_best_that_fits_and_of_equals_the_cheapest() {
        let mut broken = measured("broken", 1.0, 0.0, 10.0);
        broken.fails.insert("teleport".into(), "it flies".into());
        let all = results(vec![
            measured("good", 5.0, 0.5, 50.0),
            measured("as good and cheaper", 4.0, 0.55, 50.0),
            measured("quick to answer", 4.5, 0.9, 15.0),
            measured("cheap", 1.0, 3.0, 50.0),
            broken,
        ]);
        let budget = |tick_us, lag_ms| Budget { tick_us, lag_ms, ..Budget::default() };
        assert_eq!(name(&all, &budget(None, None)), Some("as good and cheaper"));
        assert_eq!(name(&all, &budget(None, Some(40.0))), Some("quick to answer"));
        assert_eq!(name(&all, &budget(Some(40.0), None)), Some("cheap"));
        assert_eq!(name(&all, &budget(Some(10.0), None)), None);
        // 5 % of 2 ms are 100 us, its 99.9th percentile 150; 2 us of them are the machine's own.
        assert_eq!(all.fits(&all.rows[0], &budget(Some(149.0), None)), Ok(()));
        let strict = Budget { strict: true, ..budget(Some(149.0), None) };
        assert_eq!(all.fits(&all.rows[0], &strict), Err(Reason::Time));
        assert_eq!(all.fits(&all.rows[4], &budget(None, None)), Err(Reason::Unsound));
        let ticks = Budget { tick_hz: Some(1000), ..Budget::default() };
        assert_eq!(all.fits(&all.rows[0], &ticks), Err(Reason::Ticks));
    }
}
