//! Results as a page to read in two minutes.

use std::fmt::Write as _;

use crate::choose::Budget;
use crate::figure::Figure;
use crate::markdown::{code, message, plain, reason, table};
use crate::results::{Results, Row};

/// Budgets of the report, in microseconds a tick; none for any.
const BUDGETS_US: [Option<f64>; 7] =
    [Some(10.0), Some(20.0), Some(50.0), Some(100.0), Some(200.0), Some(500.0), None];
/// Longest response lags of the report \[ms\].
const LAGS_MS: [Option<f64>; 2] = [None, Some(30.0)];
/// Figures in tables, the most telling first. The first [`FIRST`] known ones are shown.
const SHOWN: [Figure; 6] = [
    Figure::Perceptual,
    Figure::Modulation,
    Figure::Spectrum,
    Figure::Convergence,
    Figure::Level,
    Figure::Bands,
];
const FIRST: usize = 4;
/// Most lines of a table.
const MOST_LINES: usize = 8;

impl Results {
    /// The report, in Markdown. Pictures are named by [`picture_name`](Self::picture_name).
    pub fn report(&self) -> String {
        let mut out = String::from("# What accuracy costs in time\n\n");
        self.head(&mut out);
        self.budgets(&mut out);
        self.steps(&mut out);
        self.baselines(&mut out);
        self.limits(&mut out);
        self.knobs(&mut out);
        self.unsound(&mut out);
        self.method(&mut out);
        out
    }

    fn head(&self, out: &mut String) {
        let of = |n: usize, one: &str, more: &str| {
            if n == 1 { format!("one {one}") } else { format!("{n} {more}") }
        };
        let materials = match self.materials.as_slice() {
            [] => "its own surfaces".to_owned(),
            some => of(some.len(), "material", "materials"),
        };
        let sound = self.rows.iter().filter(|r| r.sound()).count();
        let cases = if self.cases > 0 { "pass every hard case" } else { "were not put to hard cases" };
        let _ = writeln!(
            out,
            "{} of {}, each over {} and {materials}. {sound} of them may be chosen: they ran and {cases}.\n",
            of(self.rows.len(), "setting", "settings"),
            code(&self.tradeoff),
            of(self.strokes.len(), "stroke", "strokes"),
        );
        if self.unfinished > 0 {
            let _ = writeln!(
                out,
                "**{} not finished:** the run was stopped.\n",
                of(self.unfinished, "setting is", "settings are")
            );
        }
        let missing: Vec<String> = self.missing_shards().iter().map(usize::to_string).collect();
        if !missing.is_empty() {
            let of = self.shards.first().map_or(1, |s| s.1);
            let _ =
                writeln!(out, "**Missing shards: {} of {of}**, with their settings.\n", missing.join(", "));
        }
        let first = [Figure::Perceptual, Figure::Spectrum, Figure::Convergence, Figure::Level];
        if let Some(figure) = first.into_iter().find(|f| !self.pareto_front(*f).is_empty()) {
            let _ = writeln!(
                out,
                "![{}]({})\n\nAll pictures, over time: {}.\nOver lag: {}.\n\
                 docs/accuracy.md explains the figures.\n",
                figure.title(),
                Self::picture_name(figure, "time"),
                self.links("time", Row::load),
                self.links("lag", Row::lag50),
            );
        }
    }

    /// Links to the pictures that are drawn.
    fn links(&self, over: &str, cost: fn(&Row) -> Option<f64>) -> String {
        let drawn = |f: &Figure| self.rows.iter().any(|r| r.figure(*f).is_some() && cost(r).is_some());
        let link = |f: Figure| format!("[{}]({})", f.name(), Self::picture_name(f, over));
        let links: Vec<String> = Figure::all().filter(drawn).map(link).collect();
        if links.is_empty() { "none".into() } else { links.join(", ") }
    }

    /// Figures in tables.
    fn shown(&self) -> Vec<Figure> {
        SHOWN.into_iter().filter(|f| self.knows(*f)).take(FIRST).collect()
    }

    fn budgets(&self, out: &mut String) {
        let shown = self.shown();
        /// The same choice under neighbouring budgets, and under several lags.
        struct Line {
            budgets: Vec<Option<f64>>,
            lags: Vec<Option<f64>>,
            cells: Vec<String>,
        }
        let mut merged: Vec<Line> = Vec::new();
        for lag_ms in LAGS_MS {
            let mut lines: Vec<Line> = Vec::new();
            for tick_us in BUDGETS_US {
                let choice = self.choose(&Budget { tick_us, lag_ms, ..Budget::default() });
                let Some((row, time)) = choice.and_then(|c| Some((c.row, c.row.time?))) else { continue };
                let mut cells = vec![
                    self.named(row),
                    format!("{:.2}", time.load_percent),
                    format!("{:.1} / {:.1}", time.p50_us, time.p999_us),
                    format!("{:.1}", time.stall_us),
                    ms(row.lag50()),
                ];
                cells.extend(shown.iter().map(|f| f.shown(row.figure(*f))));
                match lines.last_mut().filter(|l| l.cells == cells) {
                    Some(there) => there.budgets.push(tick_us),
                    None => lines.push(Line { budgets: vec![tick_us], lags: vec![lag_ms], cells }),
                }
            }
            for line in lines {
                match merged.iter_mut().find(|l| l.budgets == line.budgets && l.cells == line.cells) {
                    Some(there) => there.lags.extend(line.lags),
                    None => merged.push(line),
                }
            }
        }
        if merged.is_empty() {
            return;
        }
        *out += "## Which setting for which budget\n\n";
        *out += &match self.usual().into_iter().map(Figure::name).collect::<Vec<_>>().as_slice() {
            [] => "No figure is known: the setting with the lowest load.\n\n".to_owned(),
            some => format!(
                "The best by {}.\nOf the settings that tie within noise, the one with the lowest load.\n\
                 Settings 6 dB worse than the best in spectrum, bands or level are left out, \
                 and settings 2.7 dB worse in modulation.\n\n",
                some.join(", then ")
            ),
        };
        let mut titles = words("us a tick; longest lag, ms; setting; load %; p50 / p99.9 us");
        titles.extend(words("stalls in p99.9, us; lag, ms"));
        titles.extend(shown.iter().map(|f| f.with_unit()));
        *out += &table(
            &titles,
            merged.into_iter().map(|Line { budgets, lags, cells }| {
                let lag = |lag: &Option<f64>| lag.map_or("any".to_owned(), |ms| format!("{ms}"));
                let lags: Vec<String> = lags.iter().map(lag).collect();
                [range(&budgets), lags.join(", ")].into_iter().chain(cells).collect()
            }),
        );
    }

    fn steps(&self, out: &mut String) {
        let physics = [Figure::Perceptual, Figure::Modulation, Figure::Spectrum];
        let mut figures: Vec<Figure> =
            physics.into_iter().filter(|f| !self.pareto_front(*f).is_empty()).collect();
        if figures.is_empty() {
            figures.push(Figure::Convergence);
        }
        if figures.iter().all(|f| self.pareto_front(*f).is_empty()) {
            return;
        }
        *out += "## The Pareto front, step by step\n\n\
                 From the lowest load on. Each step is better by more than noise.\n\n";
        for figure in figures {
            let digits = figure.decimals();
            let mut before: Option<(f64, f64)> = None;
            let lines = self.front_rows(figure).into_iter().filter_map(|row| {
                let (x, load) = (row.figure(figure)?, row.load()?);
                let (gain, cost) = before.map_or(("".into(), "".into()), |(y, before)| {
                    (format!("{:+.digits$}", x - y), format!("x {:.2}", load / before.max(1e-12)))
                });
                before = Some((x, load));
                let load = format!("{load:.2}");
                Some(vec![figure.shown(Some(x)), gain, load, cost, ms(row.lag50()), self.named(row)])
            });
            let mut titles = vec![figure.with_unit().replace(' ', ", ")];
            titles.extend(words("gain; load %; cost; lag, ms; setting"));
            *out += &table(&titles, lines.collect::<Vec<_>>());
        }
    }

    /// Rows on the Pareto front of a figure. Of very many, those with the smallest gain are left out.
    fn front_rows(&self, figure: Figure) -> Vec<&Row> {
        let mut rows: Vec<&Row> = self.pareto_front(figure).into_iter().map(|i| &self.rows[i]).collect();
        let value = |row: &Row| row.figure(figure).unwrap_or(0.0);
        while rows.len() > MOST_LINES {
            let gains =
                rows.windows(2).enumerate().map(|(i, p)| (i + 1, figure.gain(value(p[1]), value(p[0]))));
            // The last stays: it is the best of all.
            let least = gains.take(rows.len() - 2).min_by(|a, b| a.1.total_cmp(&b.1));
            rows.remove(least.map_or(1, |(i, _)| i));
        }
        rows
    }

    fn baselines(&self, out: &mut String) {
        if !self.rows.iter().any(|row| row.baseline) {
            return;
        }
        let known = |f: &Figure| self.rows.iter().any(|r| r.baseline && r.figure(*f).is_some());
        let figures: Vec<Figure> = Figure::all().filter(known).collect();
        *out += "## Baselines\n\nOther graphs, over the same strokes and materials.\n\n";
        let mut titles = words("graph; load %; lag, ms");
        titles.extend(figures.iter().map(|f| f.with_unit()));
        let rows = self.rows.iter().filter(|row| row.default || row.baseline);
        let line = |row: &Row| {
            let load = row.load().map_or("-".into(), |load| format!("{load:.2}"));
            let cells = [self.named(row), load, ms(row.lag50())];
            cells.into_iter().chain(figures.iter().map(|f| f.shown(row.figure(*f)))).collect()
        };
        *out += &table(&titles, rows.map(line).collect::<Vec<_>>());
    }

    fn limits(&self, out: &mut String) {
        let Some(default) = self.default_row() else { return };
        let lines = self.model.iter().filter_map(|(&figure, &reference)| {
            let (now, (best, value)) = (default.figure(figure)?, self.best(figure)?);
            let left = figure.gain(reference, value);
            let left = if left <= 0.0 {
                "nothing".into()
            } else if self.differ(figure, reference, value) {
                figure.shown(Some(left))
            } else {
                "nothing beyond noise".into()
            };
            let best = format!("{} ({})", figure.shown(Some(value)), self.named(best));
            Some(vec![
                figure.name().into(),
                figure.shown(Some(reference)),
                figure.shown(Some(now)),
                best,
                left,
            ])
        });
        let lines: Vec<Vec<String>> = lines.collect();
        if lines.is_empty() {
            return;
        }
        *out += "## Where the model is the limit\n\n\
                 The reference: figures of the network's own magnitudes, under the default.\n\
                 Nodes behind the network can pass it, by correcting its errors.\n\
                 Where nothing is left to gain, a better network is likely to help; \
                 phase retrieval and actuator model are not.\n\n";
        let titles =
            words("figure; the network's magnitudes; the default; the best setting; left to gain behind it");
        *out += &table(&titles, lines);
    }

    /// The sound row that is best in a figure.
    fn best(&self, figure: Figure) -> Option<(&Row, f64)> {
        let known = self.rows.iter().filter(|r| r.sound()).filter_map(|r| Some((r, r.figure(figure)?)));
        known.reduce(|a, b| if figure.gain(b.1, a.1) > 0.0 { b } else { a })
    }

    fn knobs(&self, out: &mut String) {
        let mut grids: Vec<&str> = Vec::new();
        for grid in self.rows.iter().flat_map(|r| &r.grids) {
            if !grids.contains(&grid.as_str()) {
                grids.push(grid);
            }
        }
        if grids.is_empty() {
            return;
        }
        let default = match self.default_row() {
            Some(row) if self.rows.iter().filter(|r| r.default).count() > 1 => {
                format!("the first graph's default, {}, also for settings of other graphs", self.named(row))
            }
            _ => "the default".to_owned(),
        };
        let _ = writeln!(
            out,
            "## Knob by knob\n\nCompared with {default}. The load is a ratio. `=`: equal within noise.\n\
             Columns without a difference are left out; results.csv has all figures.\n"
        );
        let unchanged = |cells: &[String]| cells.iter().all(|c| c == "=" || c == "-");
        let mut alike = Vec::new();
        for grid in grids {
            let of = self.rows.iter().filter(|r| !r.default && r.grids.iter().any(|g| g == grid));
            let lines: Vec<(&Row, Vec<String>)> = of.map(|r| (r, self.cells(r))).collect();
            let (same, mut differing): (Vec<_>, Vec<_>) =
                lines.into_iter().partition(|(_, cells)| unchanged(cells));
            let same: Vec<String> = same.iter().map(|(r, _)| self.named(r)).collect();
            if differing.is_empty() {
                if !same.is_empty() {
                    alike.push(format!("{} ({})", plain(grid), first_of(&same)));
                }
                continue;
            }
            let all = differing.len();
            if all > MOST_LINES {
                let front: Vec<usize> = self.shown().into_iter().flat_map(|f| self.pareto_front(f)).collect();
                let keys: Vec<&str> = front.iter().map(|i| self.rows[*i].key.as_str()).collect();
                differing.sort_by_key(|(r, _)| !keys.contains(&r.key.as_str()));
                differing.truncate(MOST_LINES);
            }
            let mut titles = words("load; lag, ms");
            titles.extend(self.shown().into_iter().map(Figure::with_unit));
            let columns: Vec<usize> = (0..titles.len())
                .filter(|c| differing.iter().any(|(_, cells)| cells[*c] != "=" && cells[*c] != "-"))
                .collect();
            let line = |name: String, cells: &[String]| -> Vec<String> {
                std::iter::once(name).chain(columns.iter().map(|c| cells[*c].clone())).collect()
            };
            let lines = differing.iter().map(|(row, cells)| line(self.named(row), cells));
            let _ = writeln!(out, "### {}\n", plain(grid));
            *out += &table(&line("setting".into(), &titles), lines.collect::<Vec<_>>());
            if all > differing.len() {
                let _ = writeln!(out, "{} more are in results.csv.\n", all - differing.len());
            }
            if !same.is_empty() {
                let _ = writeln!(out, "Equal within noise: {}.\n", first_of(&same));
            }
        }
        if !alike.is_empty() {
            let _ = writeln!(out, "All equal within noise: {}.\n", alike.join("; "));
        }
    }

    /// Load, lag and figures of a row, compared with the default's.
    fn cells(&self, row: &Row) -> Vec<String> {
        let mut cells = vec![self.load_ratio(row), self.lag_difference(row)];
        let default = self.default_row();
        cells.extend(self.shown().into_iter().map(|f| {
            match (row.figure(f), default.and_then(|d| d.figure(f))) {
                (Some(a), Some(b)) if !self.differ(f, a, b) => "=".into(),
                (a, _) => f.shown(a),
            }
        }));
        cells
    }

    fn load_ratio(&self, row: &Row) -> String {
        let default = self.default_row().and_then(Row::load);
        match (row.load(), default.filter(|d| *d > 0.0)) {
            _ if row.error.is_some() => "does not run".into(),
            (Some(load), Some(default)) => {
                let (ratio, floor) = (load / default, self.load_noise_floor.unwrap_or(1.0));
                if row.default || ratio.max(1.0 / ratio) > floor { format!("{ratio:.2}") } else { "=".into() }
            }
            _ => "-".into(),
        }
    }

    fn lag_difference(&self, row: &Row) -> String {
        let default = self.default_row().and_then(Row::lag50);
        match (row.lag50(), default, self.lag_noise_floor_ms) {
            (Some(a), Some(b), Some(floor)) if !row.default && (a - b).abs() <= floor => "=".into(),
            (lag, ..) => ms(lag),
        }
    }

    fn unsound(&self, out: &mut String) {
        // Settings with the same reason share a line.
        let mut lines: Vec<(String, Vec<String>)> = Vec::new();
        for row in self.rows.iter().filter(|r| !r.sound()) {
            let fails = row.fails.iter().map(|(case, found)| format!("{case}: {found}"));
            let mut why: Vec<String> = row.error.iter().cloned().chain(fails).collect();
            if row.faults > 0 {
                why.push(format!("nodes failed {} times", row.faults));
            }
            if why.is_empty() {
                why.push("it is not finished".into());
            }
            let why = reason(&why.join("; "));
            match lines.iter_mut().find(|(there, _)| *there == why) {
                Some((_, names)) => names.push(self.named(row)),
                None => lines.push((why, vec![self.named(row)])),
            }
        }
        if lines.is_empty() {
            return;
        }
        *out += "## What cannot be chosen\n\n";
        let more = lines.len().saturating_sub(MOST_LINES);
        let mut cells: Vec<Vec<String>> =
            lines.iter().take(MOST_LINES).map(|(why, names)| vec![first_of(names), message(why)]).collect();
        if more > 0 {
            cells.push(vec![format!("{more} more, in results.csv"), String::new()]);
        }
        *out += &table(&words("setting; why"), cells);
    }

    fn method(&self, out: &mut String) {
        *out += "## How it was measured\n\n";
        for note in &self.notes {
            let _ = writeln!(out, "- {}", message(note));
        }
        for m in &self.machines {
            let (cpu, system, build) = (plain(&m.cpu), plain(&m.system), plain(&m.build));
            let _ = writeln!(out, "- {cpu}, {} cores, {system}; {build}", m.cores);
        }
        let materials = match self.materials.as_slice() {
            [] => "the graph's own".into(),
            some => plain(&some.join(", ")),
        };
        let strokes = plain(&self.strokes.join(", "));
        let _ = writeln!(out, "- seed {}; strokes: {strokes}; materials: {materials}", self.seed);
        if let Some(t) = self.idle {
            let _ = writeln!(
                out,
                "- idle ticks, which spin for the default's median of {:.1} us: p99.9 {:.1} us, \
                 maximum {:.0} us. \
                 The machine's stalls are in every p99.9 here; a budget leaves them out",
                t.p50_us, t.p999_us, t.max_us
            );
        }
        let times = || self.rows.iter().filter_map(|r| r.time);
        let (misses, ticks) = (times().map(|t| t.misses).sum::<u64>(), times().map(|t| t.ticks).sum::<u64>());
        let _ = writeln!(out, "- deadline misses: {misses} of {ticks} timed ticks");
        if self.shards.len() > 1 {
            let _ = writeln!(out, "- {} shards; times are scaled by their defaults", self.shards.len());
        }
        let floor = |(f, x): (&Figure, &f64)| {
            format!("{} {x:.*} {}", f.name(), f.decimals() + 1, f.unit()).trim_end().to_owned()
        };
        let mut floors: Vec<String> = self.noise_floor.iter().map(floor).collect();
        if !floors.is_empty() {
            floors.extend(self.lag_noise_floor_ms.map(|ms| format!("lag {ms:.1} ms")));
            floors.extend(self.load_noise_floor.map(|r| format!("load {:.0} %", (r - 1.0) * 100.0)));
            let _ = writeln!(
                out,
                "- noise floor (95 % of the differences between draws of one setting): {}",
                floors.join(", ")
            );
        }
    }
}

fn ms(lag: Option<f64>) -> String {
    lag.map_or("-".into(), |ms| format!("{ms:.1}"))
}

/// Titles from one text.
fn words(titles: &str) -> Vec<String> {
    titles.split("; ").map(str::to_owned).collect()
}

/// Neighbouring budgets as a range.
fn range(budgets: &[Option<f64>]) -> String {
    match (budgets.first().copied().flatten(), budgets.last().copied().flatten()) {
        (None, _) => "any".into(),
        (Some(first), None) => format!("{first} and more"),
        (Some(first), Some(last)) if first == last => format!("{first}"),
        (Some(first), Some(last)) => format!("{first} to {last}"),
    }
}

/// Names, of very many only the first.
fn first_of(names: &[String]) -> String {
    let more = names.len().saturating_sub(MOST_LINES);
    let first = names[..names.len() - more].join(", ");
    if more > 0 { format!("{first} and {more} more") } else { first }
}

#[cfg(test)]
#[path = "report_tests.rs"]
mod tests;
