//! The Pareto front, and the best setting within a budget.

use serde_json::{Value, json};

use crate::figure::Figure;
use crate::results::{Results, Row};

/// Limits on a setting.
#[derive(Clone, Debug, Default)]
pub struct Budget {
    /// Longest tick \[us\]: of the median, and of the 99.9th percentile without the machine's stalls.
    pub tick_us: Option<f64>,
    /// Longest 50 % response lag \[ms\].
    pub lag_ms: Option<f64>,
    /// Keeps the machine's stalls in the 99.9th percentile, instead of subtracting
    /// [`Time::stall_us`](crate::Time::stall_us).
    pub strict: bool,
    /// Figures to rank by, the most important first; empty for [the usual ones](Results::usual).
    pub by: Vec<Figure>,
    /// Required tick rate \[Hz\].
    pub tick_hz: Option<u32>,
}

/// A chosen setting.
#[derive(Clone, Debug)]
pub struct Choice<'r> {
    /// The setting.
    pub row: &'r Row,
    /// Number of settings within the budget.
    pub fit: usize,
    /// The figures that were known, each with the number of settings that remained.
    pub steps: Vec<(Figure, usize)>,
    /// Number of settings that tie for best. The choice has the lowest load of them.
    pub equals: usize,
}

impl Choice<'_> {
    /// The setting with its figures and times, for a program.
    pub fn json(&self) -> Value {
        let row = self.row;
        json!({
            "setting": row.name, "graph": row.graph, "tick_hz": row.tick_hz, "time": row.time,
            "lag_ms": row.lag_ms, "figures": row.figures, "fragment": row.fragment, "fit": self.fit,
        })
    }
}

/// Why a setting is not within a budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Misfit {
    /// It did not run, was not timed, a node failed, or it fails a hard case.
    Unsound,
    /// Its ticks take too long.
    Time,
    /// Its response lag is too long, or unknown.
    Lag,
    /// It has another tick rate.
    TickRate,
}

impl Results {
    /// Indices of the settings on the Pareto front of a figure and the load, by increasing load. Differences
    /// within noise do not count as better.
    pub fn pareto_front(&self, figure: Figure) -> Vec<usize> {
        self.pareto_front_over(figure, Row::load)
    }

    /// As [`pareto_front`](Self::pareto_front), over another cost, such as the lag.
    pub(crate) fn pareto_front_over(&self, figure: Figure, cost: fn(&Row) -> Option<f64>) -> Vec<usize> {
        let known = |(i, row): (usize, &Row)| {
            Some((i, cost(row)?, row.figure(figure)?)).filter(|_| row.sound() && row.time.is_some())
        };
        let mut rows: Vec<(usize, f64, f64)> = self.rows.iter().enumerate().filter_map(known).collect();
        rows.sort_by(|a, b| a.1.total_cmp(&b.1).then(figure.gain(b.2, a.2).total_cmp(&0.0)));
        let mut front: Vec<(usize, f64)> = Vec::new();
        for (i, _, value) in rows {
            if front.last().is_none_or(|(_, best)| self.better(figure, value, *best)) {
                front.push((i, value));
            }
        }
        front.into_iter().map(|(i, _)| i).collect()
    }

    /// Whether `a` is better than `b` by more than the noise floor.
    fn better(&self, figure: Figure, a: f64, b: f64) -> bool {
        figure.gain(a, b) > 0.0 && self.differ(figure, a, b)
    }

    /// Checks whether a setting is within a budget.
    ///
    /// # Errors
    /// Why it is not.
    pub fn fits(&self, row: &Row, budget: &Budget) -> Result<(), Misfit> {
        let Some(time) = row.time.filter(|_| row.sound()) else { return Err(Misfit::Unsound) };
        if budget.tick_hz.is_some_and(|hz| hz != row.tick_hz) {
            return Err(Misfit::TickRate);
        }
        if let Some(most) = budget.tick_us {
            let stalls = if budget.strict { 0.0 } else { time.stall_us };
            if time.p50_us > most || time.p999_us - stalls > most {
                return Err(Misfit::Time);
            }
        }
        if let Some(most) = budget.lag_ms
            && row.lag50().is_none_or(|lag| lag > most)
        {
            return Err(Misfit::Lag);
        }
        Ok(())
    }

    /// Figures to rank by where none are named: the known ones against the physics, perceptual first; without
    /// any of those, the spectral convergence.
    pub fn usual(&self) -> Vec<Figure> {
        let known = |f: &Figure| self.knows(*f);
        let physics: Vec<Figure> = Figure::all().filter(|f| f.against_physics()).filter(known).collect();
        if physics.is_empty() { [Figure::Convergence].into_iter().filter(known).collect() } else { physics }
    }

    /// Chooses the best setting within a budget; none where no setting is.
    ///
    /// 1. Drops settings that are [clearly](Figure::clearly) worse than the best in any of the figures.
    /// 2. Keeps the settings that tie for best on the first figure, of these on the second, and so on. Takes
    ///    the one with the lowest load.
    /// 3. That one may be best by chance. So of all settings left by 1 that are worse than it in no
    ///    figure, takes the one with the lowest load.
    pub fn choose(&self, budget: &Budget) -> Option<Choice<'_>> {
        let mut fitting: Vec<&Row> = self.rows.iter().filter(|row| self.fits(row, budget).is_ok()).collect();
        let fit = fitting.len();
        let by = if budget.by.is_empty() { self.usual() } else { budget.by.clone() };
        let best = |rows: &[&Row], figure: Figure| {
            let known = rows.iter().filter_map(|row| row.figure(figure));
            known.reduce(|a, b| if figure.gain(b, a) > 0.0 { b } else { a })
        };
        let bounds = by.iter().filter_map(|f| Some((*f, best(&fitting, *f)?, f.clearly()?)));
        for (figure, best, clearly) in bounds.collect::<Vec<_>>() {
            // Where no setting is near the best of two figures, the first figure wins.
            let near = |row: &&Row| row.figure(figure).is_none_or(|x| figure.gain(best, x) < clearly);
            if fitting.iter().any(near) {
                fitting.retain(near);
            }
        }
        let mut left = fitting.clone();
        let mut steps = Vec::new();
        for &figure in &by {
            let Some(best) = best(&left, figure) else { continue };
            left.retain(|row| row.figure(figure).is_some_and(|x| !self.differ(figure, x, best)));
            steps.push((figure, left.len()));
        }
        let best = lowest_load(&left)?;
        let worse = |row: &Row, figure: Figure| match (row.figure(figure), best.figure(figure)) {
            (Some(x), Some(best)) => self.better(figure, best, x),
            (None, Some(_)) => true,
            _ => false,
        };
        fitting.retain(|row| steps.iter().all(|(figure, _)| !worse(row, *figure)));
        let row = lowest_load(&fitting)?;
        Some(Choice { row, fit, steps, equals: fitting.len() })
    }
}

fn lowest_load<'r>(rows: &[&'r Row]) -> Option<&'r Row> {
    let load = |row: &Row| row.load().unwrap_or(f64::INFINITY);
    rows.iter().copied().min_by(|a, b| load(a).total_cmp(&load(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::Time;
    use crate::testing::{measured, results};

    fn name<'r>(all: &'r Results, budget: &Budget) -> Option<&'r str> {
        all.choose(budget).map(|c| c.row.name.as_str())
    }

    /// A row with other figures than the level.
    fn with(name: &str, load: f64, level: Option<f64>, figures: &[(Figure, f64)]) -> Row {
        let mut row = measured(name, load, 0.0, 20.0);
        row.figures = level.map(|x| (Figure::Level, x)).into_iter().chain(figures.iter().copied()).collect();
        row
    }

    fn broken(name: &str, load: f64, level: f64) -> Row {
        let mut broken = measured(name, load, level, 10.0);
        broken.fails.insert("teleport".into(), "it flies".into());
        broken
    }

    #[test]
    fn pareto_front_needs_more_than_noise_for_more_load() {
        let all = results(vec![
            measured("dear and good", 5.0, 0.5, 20.0),
            measured("cheap", 1.0, 3.0, 20.0),
            measured("dearer and hardly better", 6.0, 0.45, 20.0),
            measured("dearer than cheap and worse", 2.0, 3.5, 20.0),
            measured("between", 2.5, 2.0, 20.0),
            broken("broken", 0.5, 0.1),
        ]);
        let names: Vec<&str> =
            all.pareto_front(Figure::Level).into_iter().map(|i| all.rows[i].name.as_str()).collect();
        assert_eq!(names, ["cheap", "between", "dear and good"]);
        assert!(all.pareto_front(Figure::Bands).is_empty());
    }

    #[test]
    fn best_within_the_budget_is_chosen_at_the_lowest_load() {
        let all = results(vec![
            measured("good", 5.0, 0.5, 50.0),
            measured("as good and cheaper", 4.0, 0.55, 50.0),
            measured("quick to answer", 4.5, 0.9, 15.0),
            measured("cheap", 1.0, 3.0, 50.0),
            broken("broken", 1.0, 0.0),
        ]);
        let budget = |tick_us, lag_ms| Budget { tick_us, lag_ms, ..Budget::default() };
        for (tick_us, lag_ms, want) in [
            (None, None, Some("as good and cheaper")),
            (None, Some(40.0), Some("quick to answer")),
            (Some(40.0), None, Some("cheap")),
            (Some(10.0), None, None),
        ] {
            assert_eq!(name(&all, &budget(tick_us, lag_ms)), want);
        }
        let ticks = Budget { tick_hz: Some(1000), ..Budget::default() };
        // 5 % of 2 ms are 100 us, its 99.9th percentile 150.
        for (row, budget, want) in [
            (0, budget(Some(150.0), None), Ok(())),
            (0, budget(Some(149.0), None), Err(Misfit::Time)),
            (4, budget(None, None), Err(Misfit::Unsound)),
            (0, ticks, Err(Misfit::TickRate)),
        ] {
            assert_eq!(all.fits(&all.rows[row], &budget), want);
        }
    }

    /// Once, a little more perceptual similarity was chosen at a clearly worse spectrum or modulation.
    #[test]
    fn clearly_worse_figure_outweighs_a_little_similarity() {
        use Figure::{Modulation, Perceptual, Spectrum};
        // 50 bins of 100: 0.916 for 0.905, with a spectrum 20 dB off. The bank of oscillators: 0.924 for
        // 0.901, with a modulation 4 dB further off.
        for (figure, floor, fair, other) in
            [(Spectrum, 0.1, [0.905, 1.7], [0.916, 20.3]), (Modulation, 0.3, [0.901, 3.2], [0.924, 7.4])]
        {
            let row =
                |name: &str, [p, x]: [f64; 2]| with(name, 1.0, Some(1.0), &[(Perceptual, p), (figure, x)]);
            let mut all = results(vec![row("fair", fair), row("other", other)]);
            all.noise_floor.extend([(Perceptual, 0.005), (figure, floor)]);
            assert_eq!(name(&all, &Budget::default()), Some("fair"));
            let by = Budget { by: vec![Perceptual], ..Budget::default() };
            assert_eq!(name(&all, &by), Some("other"));
        }
    }

    #[test]
    fn stalls_of_the_machine_count_only_when_strict() {
        let mut row = measured("stalled", 1.0, 1.0, 20.0);
        // A tick of 20 us that met a time slice of 4 ms.
        row.time = row.time.map(|t| Time { p999_us: 4030.0, stall_us: 4000.0, max_us: 8000.0, ..t });
        let all = results(vec![row]);
        for (us, strict, want) in [
            (30.0, false, Ok(())),
            (29.0, false, Err(Misfit::Time)),
            (4029.0, true, Err(Misfit::Time)),
            (4030.0, true, Ok(())),
        ] {
            let budget = Budget { tick_us: Some(us), strict, ..Budget::default() };
            assert_eq!(all.fits(&all.rows[0], &budget), want, "{us} {strict}");
        }
    }

    #[test]
    fn tie_goes_to_the_lowest_load_not_to_the_lucky_best() {
        let row = |name: &str, load, level, bands, convergence| {
            with(name, load, Some(level), &[(Figure::Bands, bands), (Figure::Convergence, convergence)])
        };
        // Noise floors: 0.1 dB.
        let mut all = results(vec![
            row("dear, best by chance", 4.0, 0.40, 1.00, -20.0),
            row("between", 2.0, 0.48, 1.02, -16.0),
            row("as good as that", 1.0, 0.55, 1.08, -15.0),
            row("worse in bands", 0.9, 0.51, 1.20, -15.0),
            row("better, but for bands", 0.8, 0.35, 1.30, -15.0),
        ]);
        all.noise_floor.insert(Figure::Bands, 0.1);
        let choice = all.choose(&Budget::default()).unwrap();
        assert_eq!((choice.row.name.as_str(), choice.equals), ("as good as that", 3));
        assert_eq!(choice.steps, [(Figure::Bands, 3), (Figure::Level, 2)]);
        let by = |figures: &[Figure]| Budget { by: figures.to_vec(), ..Budget::default() };
        assert_eq!(name(&all, &by(&[Figure::Level])), Some("better, but for bands"));
        assert_eq!(name(&all, &by(&[Figure::Bands, Figure::Convergence])), Some("dear, best by chance"));
    }

    #[test]
    fn convergence_counts_only_when_nothing_else_is_known() {
        let row = |name: &str, load, level, convergence| {
            with(name, load, level, &[(Figure::Convergence, convergence)])
        };
        for (level, want, usual) in [(Some(1.0), "cheap", Figure::Level), (None, "dear", Figure::Convergence)]
        {
            let all = results(vec![row("cheap", 1.0, level, -5.0), row("dear", 9.0, level, -25.0)]);
            assert_eq!((name(&all, &Budget::default()), all.usual()), (Some(want), vec![usual]));
        }
        let all = results(vec![measured("quick", 1.0, 1.0, 20.0)]);
        assert_eq!(all.usual(), [Figure::Level]);
    }
}
