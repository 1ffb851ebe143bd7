//! Results as a page to read in two minutes.

use crate::choose::Budget;
use crate::figure::Figure;
use crate::markdown::{code, message, named, plain, reason, table};
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
/// Most settings of a grid, most reasons, and most names of a reason.
const MOST_LINES: usize = 8;

impl Results {
    /// The report, in Markdown. Pictures are named by [`picture_name`](Self::picture_name).
    pub fn report(&self) -> String {
        let sections = [
            self.head(),
            self.budgets(),
            self.steps(),
            self.baselines(),
            self.limits(),
            self.knobs(),
            self.unsound(),
            self.method(),
        ];
        sections.concat()
    }

    fn head(&self) -> String {
        let of = |n: usize, one: &str, more: &str| {
            if n == 1 { format!("one {one}") } else { format!("{n} {more}") }
        };
        let materials = match self.materials.as_slice() {
            [] => "its own surfaces".to_owned(),
            some => of(some.len(), "material", "materials"),
        };
        let mut out = format!(
            "# What accuracy costs in time\n\n{} of {}, each over {} and {materials}. {} of them may be \
             chosen: they ran and {}.\n\n",
            of(self.rows.len(), "setting", "settings"),
            code(&self.tradeoff),
            of(self.strokes.len(), "stroke", "strokes"),
            self.rows.iter().filter(|r| r.sound()).count(),
            if self.cases > 0 { "pass every hard case" } else { "were not put to hard cases" },
        );
        if self.unfinished > 0 {
            let left = of(self.unfinished, "setting is", "settings are");
            out += &format!("**{left} not finished:** the run was stopped.\n\n");
        }
        let missing: Vec<String> = self.missing_shards().iter().map(usize::to_string).collect();
        if !missing.is_empty() {
            let (of, missing) = (self.shards.first().map_or(1, |s| s.1), missing.join(", "));
            out += &format!("**Missing shards: {missing} of {of}**, with their settings.\n\n");
        }
        let first = [Figure::Perceptual, Figure::Spectrum, Figure::Convergence, Figure::Level];
        if let Some(figure) = first.into_iter().find(|f| !self.pareto_front(*f).is_empty()) {
            out += &format!(
                "![{}]({})\n\nAll pictures, over time: {}.\nOver lag: {}.\n\
                 docs/accuracy.md explains the figures.\n\n",
                figure.title(),
                Self::picture_name(figure, "time"),
                self.links("time", Row::load),
                self.links("lag", Row::lag50),
            );
        }
        out
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

    fn budgets(&self) -> String {
        let shown = self.shown();
        let mut lines: Vec<Vec<String>> = Vec::new();
        for (lag_ms, tick_us) in LAGS_MS.into_iter().flat_map(|lag| BUDGETS_US.map(|us| (lag, us))) {
            let choice = self.choose(&Budget { tick_us, lag_ms, ..Budget::default() });
            let Some((row, time)) = choice.and_then(|c| Some((c.row, c.row.time?))) else { continue };
            let limit = |most: Option<f64>| most.map_or("any".to_owned(), |most| most.to_string());
            let mut line = vec![
                limit(tick_us),
                limit(lag_ms),
                named(row),
                format!("{:.2}", time.load_percent),
                format!("{:.1} / {:.1}", time.p50_us, time.p999_us),
                format!("{:.1}", time.stall_us),
                ms(row.lag50()),
            ];
            line.extend(shown.iter().map(|f| f.shown(row.figure(*f))));
            lines.push(line);
        }
        if lines.is_empty() {
            return String::new();
        }
        let by: Vec<&str> = self.usual().into_iter().map(Figure::name).collect();
        let by = match by.as_slice() {
            [] => "No figure is known: the setting with the lowest load.".to_owned(),
            some => format!(
                "The best by {}.\nOf the settings that tie within noise, the one with the lowest load.\n\
                 Settings 6 dB worse than the best in spectrum, bands or level are left out, \
                 and settings 2.7 dB worse in modulation.",
                some.join(", then ")
            ),
        };
        let mut titles = words("us a tick; longest lag, ms; setting; load %; p50 / p99.9 us");
        titles.extend(words("stalls in p99.9, us; lag, ms"));
        titles.extend(shown.iter().map(|f| f.with_unit()));
        format!("## Which setting for which budget\n\n{by}\n\n{}", table(&titles, lines))
    }

    fn steps(&self) -> String {
        let physics = [Figure::Perceptual, Figure::Modulation, Figure::Spectrum];
        let known = |f: &Figure| !self.pareto_front(*f).is_empty();
        let mut figures: Vec<Figure> = physics.into_iter().filter(known).collect();
        if figures.is_empty() {
            figures.extend([Figure::Convergence].into_iter().filter(known));
        }
        let mut out = String::new();
        for figure in figures {
            let digits = figure.decimals();
            let mut before: Option<(f64, f64)> = None;
            let lines = self.pareto_front(figure).into_iter().filter_map(|i| {
                let row = &self.rows[i];
                let (x, load) = (row.figure(figure)?, row.load()?);
                let (gain, cost) = before.map_or(("".into(), "".into()), |(y, before)| {
                    (format!("{:+.digits$}", x - y), format!("x {:.2}", load / before.max(1e-12)))
                });
                before = Some((x, load));
                let load = format!("{load:.2}");
                Some(vec![figure.shown(Some(x)), gain, load, cost, ms(row.lag50()), named(row)])
            });
            let mut titles = vec![figure.with_unit().replace(' ', ", ")];
            titles.extend(words("gain; load %; cost; lag, ms; setting"));
            out += &table(&titles, lines.collect::<Vec<_>>());
        }
        let how = "From the lowest load on. Each step is better by more than noise.";
        titled(&format!("The Pareto front, step by step\n\n{how}"), out)
    }

    fn baselines(&self) -> String {
        if !self.rows.iter().any(|row| row.baseline) {
            return String::new();
        }
        let known = |f: &Figure| self.rows.iter().any(|r| r.baseline && r.figure(*f).is_some());
        let figures: Vec<Figure> = Figure::all().filter(known).collect();
        let mut titles = words("graph; load %; lag, ms");
        titles.extend(figures.iter().map(|f| f.with_unit()));
        let line = |row: &Row| {
            let load = row.load().map_or("-".into(), |load| format!("{load:.2}"));
            let cells = [named(row), load, ms(row.lag50())];
            cells.into_iter().chain(figures.iter().map(|f| f.shown(row.figure(*f)))).collect()
        };
        let rows = self.rows.iter().filter(|row| row.default || row.baseline).map(line);
        titled("Baselines\n\nOther graphs, over the same strokes and materials.", table(&titles, rows))
    }

    fn limits(&self) -> String {
        let Some(default) = self.default_row() else { return String::new() };
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
            let best = format!("{} ({})", figure.shown(Some(value)), named(best));
            let [reference, now] = [reference, now].map(|x| figure.shown(Some(x)));
            Some(vec![figure.name().into(), reference, now, best, left])
        });
        let lines: Vec<Vec<String>> = lines.collect();
        if lines.is_empty() {
            return String::new();
        }
        let titles =
            words("figure; the network's magnitudes; the default; the best setting; left to gain behind it");
        titled(
            "Where the model is the limit\n\n\
             The reference: figures of the network's own magnitudes, under the default.\n\
             Nodes behind the network can pass it, by correcting its errors.\n\
             Where nothing is left to gain, a better network is likely to help; \
             phase retrieval and actuator model are not.",
            table(&titles, lines),
        )
    }

    /// The sound row that is best in a figure.
    fn best(&self, figure: Figure) -> Option<(&Row, f64)> {
        let known = self.rows.iter().filter(|r| r.sound()).filter_map(|r| Some((r, r.figure(figure)?)));
        known.reduce(|a, b| if figure.gain(b.1, a.1) > 0.0 { b } else { a })
    }

    /// Settings by grid, those with a difference first.
    fn knobs(&self) -> String {
        let mut grids: Vec<&String> = Vec::new();
        for grid in self.rows.iter().flat_map(|r| &r.grids) {
            if !grids.contains(&grid) {
                grids.push(grid);
            }
        }
        let mut titles = words("setting; load; lag, ms");
        titles.extend(self.shown().into_iter().map(Figure::with_unit));
        let mut out = String::new();
        for grid in grids {
            let rows = self.rows.iter().filter(|r| !r.default && r.grids.contains(grid));
            let mut lines: Vec<Vec<String>> = rows.map(|row| self.compared(row)).collect();
            lines.sort_by_key(|cells| cells[1..].iter().all(|c| c == "=" || c == "-"));
            if lines.is_empty() {
                continue;
            }
            let more = lines.len().saturating_sub(MOST_LINES);
            lines.truncate(MOST_LINES);
            out += &format!("### {}\n\n{}", plain(grid), table(&titles, lines));
            if more > 0 {
                out += &format!("{more} more are in results.csv.\n\n");
            }
        }
        let default = match self.default_row() {
            Some(row) if self.rows.iter().filter(|r| r.default).count() > 1 => {
                format!("the first graph's default, {}, also for settings of other graphs", named(row))
            }
            _ => "the default".to_owned(),
        };
        let head =
            format!("Knob by knob\n\nCompared with {default}. The load is a ratio. `=`: equal within noise.");
        titled(&head, out)
    }

    /// Name, load, lag and figures of a row, compared with the default's.
    fn compared(&self, row: &Row) -> Vec<String> {
        let default = self.default_row();
        let load = match (row.load(), default.and_then(Row::load)) {
            _ if row.error.is_some() => "does not run".into(),
            (Some(a), Some(b)) => {
                let (ratio, floor) = (a / b.max(1e-12), self.load_noise_floor.unwrap_or(1.0));
                if ratio.max(1.0 / ratio) > floor { format!("{ratio:.2}") } else { "=".into() }
            }
            _ => "-".into(),
        };
        let lag = match (row.lag50(), default.and_then(Row::lag50), self.lag_noise_floor_ms) {
            (Some(a), Some(b), Some(floor)) if (a - b).abs() <= floor => "=".into(),
            (lag, ..) => ms(lag),
        };
        let figures = self.shown().into_iter().map(|figure| {
            match (row.figure(figure), default.and_then(|d| d.figure(figure))) {
                (Some(a), Some(b)) if !self.differ(figure, a, b) => "=".into(),
                (x, _) => figure.shown(x),
            }
        });
        [named(row), load, lag].into_iter().chain(figures).collect()
    }

    fn unsound(&self) -> String {
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
                Some((_, names)) => names.push(named(row)),
                None => lines.push((why, vec![named(row)])),
            }
        }
        if lines.is_empty() {
            return String::new();
        }
        let more = lines.len().saturating_sub(MOST_LINES);
        let mut cells: Vec<Vec<String>> =
            lines.iter().take(MOST_LINES).map(|(why, names)| vec![first_of(names), message(why)]).collect();
        if more > 0 {
            cells.push(vec![format!("{more} more, in results.csv"), String::new()]);
        }
        titled("What cannot be chosen", table(&words("setting; why"), cells))
    }

    fn method(&self) -> String {
        let mut lines: Vec<String> = self.notes.iter().map(|note| message(note)).collect();
        for m in &self.machines {
            let (cpu, system, build) = (plain(&m.cpu), plain(&m.system), plain(&m.build));
            lines.push(format!("{cpu}, {} cores, {system}; {build}", m.cores));
        }
        let materials = match self.materials.as_slice() {
            [] => "the graph's own".into(),
            some => plain(&some.join(", ")),
        };
        let strokes = plain(&self.strokes.join(", "));
        lines.push(format!("seed {}; strokes: {strokes}; materials: {materials}", self.seed));
        lines.extend(self.idle.map(|t| {
            format!(
                "idle ticks, which spin for the default's median of {:.1} us: p99.9 {:.1} us, maximum \
                 {:.0} us. The machine's stalls are in every p99.9 here; a budget leaves them out",
                t.p50_us, t.p999_us, t.max_us
            )
        }));
        let times = || self.rows.iter().filter_map(|r| r.time);
        let (misses, ticks) = (times().map(|t| t.misses).sum::<u64>(), times().map(|t| t.ticks).sum::<u64>());
        lines.push(format!("deadline misses: {misses} of {ticks} timed ticks"));
        if self.shards.len() > 1 {
            lines.push(format!("{} shards; times are scaled by their defaults", self.shards.len()));
        }
        let floor = |(f, x): (&Figure, &f64)| {
            format!("{} {x:.*} {}", f.name(), f.decimals() + 1, f.unit()).trim_end().to_owned()
        };
        let mut floors: Vec<String> = self.noise_floor.iter().map(floor).collect();
        if !floors.is_empty() {
            floors.extend(self.lag_noise_floor_ms.map(|ms| format!("lag {ms:.1} ms")));
            floors.extend(self.load_noise_floor.map(|r| format!("load {:.0} %", (r - 1.0) * 100.0)));
            let what = "noise floor (95 % of the differences between draws of one setting)";
            lines.push(format!("{what}: {}", floors.join(", ")));
        }
        let lines: String = lines.into_iter().map(|line| format!("- {line}\n")).collect();
        titled("How it was measured", lines)
    }
}

/// A section; nothing without a body.
fn titled(title: &str, body: String) -> String {
    if body.is_empty() { body } else { format!("## {title}\n\n{body}") }
}

fn ms(lag: Option<f64>) -> String {
    lag.map_or("-".into(), |ms| format!("{ms:.1}"))
}

/// Titles from one text.
fn words(titles: &str) -> Vec<String> {
    titles.split("; ").map(str::to_owned).collect()
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
