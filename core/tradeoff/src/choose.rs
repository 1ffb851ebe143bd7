//! The best setting that a budget allows.

use crate::figure::Figure;
use crate::result::{Results, Row};

/// What may be spent.
#[derive(Clone, Debug, Default)]
pub struct Budget {
    /// Most microseconds a tick: of the median, and of the 99.9th percentile without what the machine
    /// stalls by itself.
    pub tick_us: Option<f64>,
    /// Longest response lag: ms until half of a step of speed is felt.
    pub lag_ms: Option<f64>,
    /// Counts what the machine stalls by itself: the 99.9th percentile as it was measured. Else
    /// [`Time::stall_us`](crate::Time::stall_us) is taken off.
    pub strict: bool,
    /// Figures in the order in which they count; none for [the usual ones](Results::usual).
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
    /// Figures that were known, in their order, with how many settings were left after each.
    pub steps: Vec<(Figure, usize)>,
    /// How many settings are as good as the best of all by these: it is the cheapest of them.
    pub equals: usize,
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
            let stalls = if budget.strict { 0.0 } else { time.stall_us };
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

    /// Whether any setting has a figure.
    pub fn knows(&self, figure: Figure) -> bool {
        self.rows.iter().any(|row| row.figure(figure).is_some())
    }

    /// Figures by which a setting is best where none are asked for: those against the physics, perceptual
    /// first, then modulation; where none of them is known, the spectral convergence.
    pub fn usual(&self) -> Vec<Figure> {
        let known = |f: &Figure| self.knows(*f);
        let physics: Vec<Figure> =
            Figure::ALL.into_iter().filter(|f| f.of_the_whole()).filter(known).collect();
        if physics.is_empty() { [Figure::Convergence].into_iter().filter(known).collect() } else { physics }
    }

    /// The best setting that fits; none where nothing does.
    ///
    /// Settings that are [clearly](Figure::clearly) worse than the best in any of the figures are left out:
    /// a little more of one figure is not worth it. Then by the first figure the best and what is not told
    /// apart from it, of these by the second, and so on; of what is left the one that takes least time. Of many that are equal the best is so by chance, and
    /// others that are no worse may be told apart from it. So at last the cheapest is taken of all that fit
    /// and that are better than that one in each of the figures, or not told apart from it.
    pub fn choose(&self, budget: &Budget) -> Option<Choice<'_>> {
        let mut fitting: Vec<&Row> = self.rows.iter().filter(|row| self.fits(row, budget).is_ok()).collect();
        let fit = fitting.len();
        let usual = if budget.by.is_empty() { self.usual() } else { Vec::new() };
        let by = if budget.by.is_empty() { &usual } else { &budget.by };
        let best = |rows: &[&Row], figure: Figure| {
            let known = rows.iter().filter_map(|row| row.figure(figure));
            known.reduce(|a, b| if figure.gain(b, a) > 0.0 { b } else { a })
        };
        let bounds = by.iter().filter_map(|f| Some((*f, best(&fitting, *f)?, f.clearly()?)));
        for (figure, best, clearly) in bounds.collect::<Vec<_>>() {
            // Where two figures exclude each other's best, the first one's stays.
            let near = |row: &&Row| row.figure(figure).is_none_or(|x| figure.gain(best, x) < clearly);
            if fitting.iter().any(near) {
                fitting.retain(near);
            }
        }
        let mut left = fitting.clone();
        let mut steps = Vec::new();
        for &figure in by {
            let Some(best) = best(&left, figure) else { continue };
            left.retain(|row| row.figure(figure).is_some_and(|x| !self.differ(figure, x, best)));
            steps.push((figure, left.len()));
        }
        let best = cheapest(&left)?;
        let worse = |row: &Row, figure: Figure| match (row.figure(figure), best.figure(figure)) {
            (Some(x), Some(best)) => figure.gain(best, x) > 0.0 && self.differ(figure, x, best),
            (None, Some(_)) => true,
            _ => false,
        };
        let mut equals = fitting.clone();
        equals.retain(|row| steps.iter().all(|(figure, _)| !worse(row, *figure)));
        let row = cheapest(&equals)?;
        Some(Choice { row, fit, steps, equals: equals.len() })
    }
}

/// The one that takes least time.
fn cheapest<'r>(rows: &[&'r Row]) -> Option<&'r Row> {
    let load = |row: &Row| row.load().unwrap_or(f64::INFINITY);
    rows.iter().copied().min_by(|a, b| load(a).total_cmp(&load(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result::Time;
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
        // 5 % of 2 ms are 100 us, its 99.9th percentile 150.
        assert_eq!(all.fits(&all.rows[0], &budget(Some(150.0), None)), Ok(()));
        assert_eq!(all.fits(&all.rows[0], &budget(Some(149.0), None)), Err(Reason::Time));
        assert_eq!(all.fits(&all.rows[4], &budget(None, None)), Err(Reason::Unsound));
        let ticks = Budget { tick_hz: Some(1000), ..Budget::default() };
        assert_eq!(all.fits(&all.rows[0], &ticks), Err(Reason::Ticks));
    }

    #[test]
    fn a_little_more_similarity_is_not_worth_a_spectrum_that_is_clearly_another() {
        // 50 bins of 100 were chosen: 0.916 for 0.905, with a spectrum 20 dB off.
        let row = |name: &str, perceptual, spectrum| {
            let mut row = measured(name, 1.0, 1.0, 20.0);
            row.figures.extend([(Figure::Perceptual, perceptual), (Figure::Spectrum, spectrum)]);
            row
        };
        let mut all = results(vec![row("whole", 0.905, 1.7), row("half of the bins", 0.916, 20.3)]);
        all.floor.extend([(Figure::Perceptual, 0.005), (Figure::Spectrum, 0.1)]);
        assert_eq!(name(&all, &Budget::default()), Some("whole"));
        let by = Budget { by: vec![Figure::Perceptual], ..Budget::default() };
        assert_eq!(name(&all, &by), Some("half of the bins"));
    }

    #[test]
    fn setting_that_pulses_is_not_chosen_for_its_similarity() {
        // The bank of oscillators was chosen: perceptual 0.924 for 0.901, with a modulation 4 dB further off.
        let row = |name: &str, perceptual, modulation| {
            let mut row = measured(name, 1.0, 1.0, 20.0);
            row.figures.extend([(Figure::Perceptual, perceptual), (Figure::Modulation, modulation)]);
            row
        };
        let mut all = results(vec![row("fair", 0.901, 3.2), row("pulsing", 0.924, 7.4)]);
        all.floor.extend([(Figure::Perceptual, 0.005), (Figure::Modulation, 0.3)]);
        assert_eq!(name(&all, &Budget::default()), Some("fair"));
    }

    #[test]
    fn a_budget_is_held_against_what_is_left_without_the_stalls_of_the_machine() {
        let mut row = measured("stalled", 1.0, 1.0, 20.0);
        // A tick of 20 us that met a time slice of 4 ms.
        row.time = row.time.map(|t| Time { p999_us: 4030.0, stall_us: 4000.0, max_us: 8000.0, ..t });
        let all = results(vec![row]);
        let budget = |us, strict| Budget { tick_us: Some(us), strict, ..Budget::default() };
        let fits = |us, strict| all.fits(&all.rows[0], &budget(us, strict));
        assert_eq!(fits(30.0, false), Ok(()));
        assert_eq!(fits(29.0, false), Err(Reason::Time));
        assert_eq!(fits(4029.0, true), Err(Reason::Time));
        assert_eq!(fits(4030.0, true), Ok(()));
    }

    #[test]
    fn of_equals_the_cheapest_is_chosen_though_another_is_best_by_chance() {
        let row = |name: &str, load, level, bands, convergence| {
            let mut row = measured(name, load, level, 20.0);
            row.figures.insert(Figure::Bands, bands);
            row.figures.insert(Figure::Convergence, convergence);
            row
        };
        // Told apart: 0.1 dB.
        let mut all = results(vec![
            row("dear, best by chance", 4.0, 0.40, 1.00, -20.0),
            row("between", 2.0, 0.48, 1.02, -16.0),
            row("as good as that", 1.0, 0.55, 1.08, -15.0),
            row("worse in bands", 0.9, 0.51, 1.20, -15.0),
            row("better, but for bands", 0.8, 0.35, 1.30, -15.0),
        ]);
        all.floor.insert(Figure::Bands, 0.1);
        let choice = all.choose(&Budget::default()).unwrap();
        assert_eq!((choice.row.name.as_str(), choice.equals), ("as good as that", 3));
        assert_eq!(choice.steps, [(Figure::Bands, 3), (Figure::Level, 2)]);
        let by = |figures: &[Figure]| Budget { by: figures.to_vec(), ..Budget::default() };
        assert_eq!(name(&all, &by(&[Figure::Level])), Some("better, but for bands"));
        assert_eq!(name(&all, &by(&[Figure::Bands, Figure::Convergence])), Some("dear, best by chance"));
    }

    #[test]
    fn convergence_counts_where_it_is_asked_for_or_nothing_else_is_known() {
        let row = |name: &str, load, level: Option<f64>, convergence| {
            let mut row = measured(name, load, 0.0, 20.0);
            row.figures = [(Figure::Convergence, convergence)].into();
            row.figures.extend(level.map(|x| (Figure::Level, x)));
            row
        };
        let budget = Budget::default();
        let all = results(vec![row("cheap", 1.0, Some(1.0), -5.0), row("dear", 9.0, Some(1.0), -25.0)]);
        assert_eq!((name(&all, &budget), all.usual()), (Some("cheap"), vec![Figure::Level]));
        let all = results(vec![row("cheap", 1.0, None, -5.0), row("dear", 9.0, None, -25.0)]);
        assert_eq!((name(&all, &budget), all.usual()), (Some("dear"), vec![Figure::Convergence]));
        let all = results(vec![measured("quick", 1.0, 1.0, 20.0)]);
        assert_eq!(all.usual(), [Figure::Level]);
    }
}
