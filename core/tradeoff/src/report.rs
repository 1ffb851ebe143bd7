//! Results as a page that a person reads in two minutes.

use std::fmt::Write as _;

use crate::choose::Budget;
use crate::figure::Figure;
use crate::result::{Results, Row};
use crate::short::{code, message, plain, range, reason};

/// Budgets that the report answers, in microseconds a tick; none for any.
const BUDGETS_US: [Option<f64>; 7] =
    [Some(10.0), Some(20.0), Some(50.0), Some(100.0), Some(200.0), Some(500.0), None];
/// Longest lags that it answers \[ms\].
const LAGS_MS: [Option<f64>; 2] = [None, Some(30.0)];
/// Figures in the order in which tables take them: those that say most.
const SHOWN: [Figure; 6] = [
    Figure::Perceptual,
    Figure::Modulation,
    Figure::Spectrum,
    Figure::Convergence,
    Figure::Level,
    Figure::Bands,
];
/// How many they take: results.csv has all.
const FIRST: usize = 4;
/// Most lines of a table.
const MOST_LINES: usize = 8;

/// A line of the table of budgets.
struct Line {
    budgets: Vec<Option<f64>>,
    lags: Vec<Option<f64>>,
    text: String,
}

impl Results {
    /// The report, in Markdown; pictures are named by [`picture_name`](Self::picture_name).
    pub fn report(&self) -> String {
        let mut out = String::from("# What accuracy costs in time\n\n");
        self.head(&mut out);
        self.budgets(&mut out);
        self.steps(&mut out);
        self.marks(&mut out);
        self.limits(&mut out);
        self.knobs(&mut out);
        self.unsound(&mut out);
        self.taken(&mut out);
        out
    }

    /// The file of a picture: of a figure against `time` or `lag`.
    pub fn picture_name(figure: Figure, against: &str) -> String {
        format!("{}_{against}.svg", figure.name())
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
        let held =
            if self.cases > 0 { ", and every hard case holds" } else { "; nobody looked at hard cases" };
        let _ = writeln!(
            out,
            "{} of {}, each over {} and {materials}. {sound} of them may be chosen: they ran{held}.\n",
            of(self.rows.len(), "setting", "settings"),
            code(&self.study),
            of(self.strokes.len(), "stroke", "strokes"),
        );
        if self.unfinished > 0 {
            let _ =
                writeln!(out, "**Not finished: {}.** The same command goes on with them.\n", self.unfinished);
        }
        let missing = self.missing_shards();
        if !missing.is_empty() {
            let missing: Vec<String> = missing.iter().map(usize::to_string).collect();
            let of = self.shards.first().map_or(1, |s| s.1);
            let _ = writeln!(
                out,
                "**Shards that are not here: {} of {of}**, with all their settings.\n",
                missing.join(", ")
            );
        }
        let first = [Figure::Perceptual, Figure::Spectrum, Figure::Convergence, Figure::Level]
            .into_iter()
            .find(|f| !self.undominated(*f).is_empty());
        if let Some(figure) = first {
            let _ = writeln!(
                out,
                "![{}]({})\n\nOther pictures: against time {}; against lag {}. docs/accuracy.md says what the figures are.\n",
                figure.title(),
                Self::picture_name(figure, "time"),
                self.links("time", Row::load),
                self.links("lag", Row::lag50),
            );
        }
    }

    /// The pictures that there are.
    fn links(&self, against: &str, cost: fn(&Row) -> Option<f64>) -> String {
        let drawn = |f: &Figure| self.rows.iter().any(|r| r.figure(*f).is_some() && cost(r).is_some());
        let links: Vec<String> = Figure::ALL
            .into_iter()
            .filter(drawn)
            .map(|f| format!("[{}]({})", f.name(), Self::picture_name(f, against)))
            .collect();
        if links.is_empty() { "none".into() } else { links.join(", ") }
    }

    /// Figures that tables take, of those that any row has.
    fn shown(&self) -> Vec<Figure> {
        let known = |f: &Figure| self.rows.iter().any(|r| r.figure(*f).is_some());
        SHOWN.into_iter().filter(known).take(FIRST).collect()
    }

    fn budgets(&self, out: &mut String) {
        let shown = self.shown();
        let mut lines: Vec<Line> = Vec::new();
        for lag_ms in LAGS_MS {
            for tick_us in BUDGETS_US {
                let Some(choice) = self.choose(&Budget { tick_us, lag_ms, ..Budget::default() }) else {
                    continue;
                };
                let row = choice.row;
                let (Some(time), lag) = (row.time, ms(row.lag50())) else { continue };
                let figures = shown.iter().map(|f| value(*f, row.figure(*f)));
                let cells = [
                    self.named(row),
                    format!("{:.2}", time.load_percent),
                    format!("{:.1} / {:.1}", time.p50_us, time.p999_us),
                    format!("{:.1}", time.stall_us),
                    lag,
                ];
                let line = cells.into_iter().chain(figures).collect::<Vec<_>>().join(" | ");
                // More to spend that buys nothing is one line.
                match lines.last_mut().filter(|l| l.lags == [lag_ms] && l.text == line) {
                    Some(there) => there.budgets.push(tick_us),
                    None => lines.push(Line { budgets: vec![tick_us], lags: vec![lag_ms], text: line }),
                }
            }
        }
        // So is what is soon enough anyway.
        let mut merged: Vec<Line> = Vec::new();
        for line in lines {
            match merged.iter_mut().find(|l| l.budgets == line.budgets && l.text == line.text) {
                Some(there) => there.lags.extend(line.lags),
                None => merged.push(line),
            }
        }
        let lines = merged;
        if lines.is_empty() {
            return;
        }
        let order: Vec<&str> = self.usual().into_iter().map(Figure::name).collect();
        let by = match order.as_slice() {
            [] => "No figure is known: the cheapest.".to_owned(),
            some => format!(
                "The best by {}; of all that are not told apart from it in any of them, the cheapest. \
                 Never one that is 6 dB worse than the best in spectrum, bands or level, \
                 or 2.7 dB in modulation.",
                some.join(", then ")
            ),
        };
        let _ = writeln!(
            out,
            "## Which setting for which budget

{by}
"
        );
        let before = [
            "us a tick",
            "lag at most, ms",
            "setting",
            "load %",
            "p50 / p99.9 us",
            "of that p99.9 stalls, us",
            "lag, ms",
        ];
        head(out, &before, &shown);
        for Line { budgets, lags, text } in lines {
            let lags: Vec<String> =
                lags.iter().map(|lag| lag.map_or("any".to_owned(), |ms| format!("{ms}"))).collect();
            let _ = writeln!(out, "| {} | {} | {text} |", range(&budgets), lags.join(", "));
        }
        out.push('\n');
    }

    fn steps(&self, out: &mut String) {
        let mut any = false;
        let whole = [Figure::Perceptual, Figure::Modulation, Figure::Spectrum];
        let whole = whole.into_iter().filter(|f| !self.undominated(*f).is_empty()).collect::<Vec<_>>();
        for figure in if whole.is_empty() { vec![Figure::Convergence] } else { whole } {
            let front = self.steps_of(figure);
            if front.is_empty() {
                continue;
            }
            if !any {
                *out += "## What the next step costs and buys\n\nFrom the cheapest setting on; each step is one that is told apart.\n\n";
                any = true;
            }
            let unit = if figure.unit().is_empty() { String::new() } else { format!(", {}", figure.unit()) };
            let _ = writeln!(
                out,
                "| {}{unit} | buys | load % | costs | lag, ms | setting |\n|---|---|---|---|---|---|",
                figure.name()
            );
            let mut before: Option<&Row> = None;
            for row in front {
                let (Some(x), Some(load)) = (row.figure(figure), row.load()) else { continue };
                let digits = figure.decimals();
                let step = before.and_then(|b| Some((b.figure(figure)?, b.load()?)));
                let (buys, costs) = step.map_or(("".into(), "".into()), |(y, before)| {
                    (format!("{:+.digits$}", x - y), format!("x {:.2}", load / before.max(1e-12)))
                });
                let _ = writeln!(
                    out,
                    "| {x:.digits$} | {buys} | {load:.2} | {costs} | {} | {} |",
                    ms(row.lag50()),
                    self.named(row)
                );
                before = Some(row);
            }
            out.push('\n');
        }
    }

    /// The undominated in a figure; of very many those that buy least are left out.
    fn steps_of(&self, figure: Figure) -> Vec<&Row> {
        let mut rows: Vec<&Row> =
            self.undominated(figure).into_iter().filter_map(|i| self.rows.get(i)).collect();
        let gain =
            |a: &Row, b: &Row| figure.gain(b.figure(figure).unwrap_or(0.0), a.figure(figure).unwrap_or(0.0));
        while rows.len() > MOST_LINES {
            let gains = rows.windows(2).enumerate().map(|(i, pair)| (i + 1, gain(pair[0], pair[1])));
            // The last is the best there is.
            let least = gains.take(rows.len() - 2).min_by(|a, b| a.1.total_cmp(&b.1));
            rows.remove(least.map_or(1, |(i, _)| i));
        }
        rows
    }

    /// The graphs that stand beside, and the default.
    fn marks(&self, out: &mut String) {
        if !self.rows.iter().any(|row| row.mark) {
            return;
        }
        let known = |f: &Figure| self.rows.iter().any(|r| r.mark && r.figure(*f).is_some());
        let figures: Vec<Figure> = Figure::ALL.into_iter().filter(known).collect();
        *out += "## Other graphs\n\nOver the same strokes and materials.\n\n";
        head(out, &["graph", "load %", "lag, ms"], &figures);
        for row in self.rows.iter().filter(|row| row.default || row.mark) {
            let load = row.time.map_or("-".into(), |t| format!("{:.2}", t.load_percent));
            let cells = [self.named(row), load, ms(row.lag50())];
            let figures = figures.iter().map(|f| value(*f, row.figure(*f)));
            let _ = writeln!(out, "| {} |", cells.into_iter().chain(figures).collect::<Vec<_>>().join(" | "));
        }
        out.push('\n');
    }

    fn limits(&self, out: &mut String) {
        let Some(default) = self.default_row() else { return };
        if !self.model.keys().any(|f| default.figure(*f).is_some() && self.best(*f).is_some()) {
            return;
        }
        *out += "## Where the model is the limit\n\n\
                 A reference: what the network's own magnitudes, under the default, come to as they are. It can be passed, since what is behind the network may make up for its errors. \
                 Where nothing is left to win, no phase retrieval and no actuator model is likely to help: a better network would.\n\n\
                 | figure | the network's magnitudes | the default | the best setting | left to win behind the network |\n|---|---|---|---|---|\n";
        for (&figure, &reference) in &self.model {
            let (Some(now), Some(best)) = (default.figure(figure), self.best(figure)) else { continue };
            let digits = figure.decimals();
            let left = figure.gain(reference, best.1);
            let left = if left <= 0.0 {
                "nothing left to win".into()
            } else if self.differ(figure, reference, best.1) {
                format!("{left:.digits$}")
            } else {
                "nothing that is told apart".into()
            };
            let _ = writeln!(
                out,
                "| {} | {reference:.digits$} | {now:.digits$} | {:.digits$} ({}) | {left} |",
                figure.name(),
                best.1,
                self.named(best.0)
            );
        }
        out.push('\n');
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
            "## Knob by knob\n\nAgainst {default}: load as a ratio to its; `=`: not told apart from it. What no line of a table differs in is no column of it; results.csv has all figures.\n"
        );
        let mut alike = Vec::new();
        for grid in grids {
            let of = self.rows.iter().filter(|r| !r.default && r.grids.iter().any(|g| g == grid));
            let lines: Vec<(&Row, Vec<String>)> = of.map(|r| (r, self.cells(r))).collect();
            let (same, mut told): (Vec<_>, Vec<_>) =
                lines.into_iter().partition(|(_, cells)| cells.iter().all(|c| c == "=" || c == "-"));
            if told.is_empty() {
                let names: Vec<String> = same.iter().map(|(r, _)| self.named(r)).collect();
                if !names.is_empty() {
                    alike.push(format!("{} ({})", plain(grid), some(&names)));
                }
                continue;
            }
            let _ = writeln!(out, "### {}\n", plain(grid));
            let all = told.len();
            if all > MOST_LINES {
                let worth: Vec<usize> = self.shown().into_iter().flat_map(|f| self.undominated(f)).collect();
                let keys: Vec<&str> = worth.iter().map(|i| self.rows[*i].key.as_str()).collect();
                // Those that are worth their time first.
                told.sort_by_key(|(r, _)| !keys.contains(&r.key.as_str()));
                told.truncate(MOST_LINES);
            }
            let mut titles = vec!["load".to_owned(), "lag, ms".to_owned()];
            titles.extend(self.shown().into_iter().map(title));
            let columns: Vec<usize> = (0..titles.len())
                .filter(|c| told.iter().any(|(_, cells)| cells[*c] != "=" && cells[*c] != "-"))
                .collect();
            let of =
                |cells: &[String]| columns.iter().map(|c| cells[*c].clone()).collect::<Vec<_>>().join(" | ");
            let _ = writeln!(out, "| setting | {} |\n|{}", of(&titles), "---|".repeat(columns.len() + 1));
            for (row, cells) in &told {
                let _ = writeln!(out, "| {} | {} |", self.named(row), of(cells));
            }
            out.push('\n');
            if all > told.len() {
                let _ = writeln!(
                    out,
                    "{} more, of which none is undominated before these, are in results.csv.\n",
                    all - told.len()
                );
            }
            if !same.is_empty() {
                let names: Vec<String> = same.iter().map(|(r, _)| self.named(r)).collect();
                let _ = writeln!(out, "Not told apart from it: {}.\n", some(&names));
            }
        }
        if !alike.is_empty() {
            let _ = writeln!(out, "Nothing is told apart in: {}.\n", alike.join("; "));
        }
    }

    /// Load, lag and figures of a row against the default's.
    fn cells(&self, row: &Row) -> Vec<String> {
        let mut cells = vec![self.ratio(row), self.lag(row)];
        let default = self.default_row();
        cells.extend(self.shown().into_iter().map(|f| {
            match (row.figure(f), default.and_then(|d| d.figure(f))) {
                (Some(a), Some(b)) if !self.differ(f, a, b) => "=".into(),
                (a, _) => value(f, a),
            }
        }));
        cells
    }

    fn ratio(&self, row: &Row) -> String {
        let default = self.default_row().and_then(Row::load);
        match (row.load(), default.filter(|d| *d > 0.0)) {
            _ if row.error.is_some() => "does not run".into(),
            (Some(load), Some(default)) => {
                let (ratio, floor) = (load / default, self.load_floor.unwrap_or(1.0));
                if row.default || ratio.max(1.0 / ratio) > floor { format!("{ratio:.2}") } else { "=".into() }
            }
            _ => "-".into(),
        }
    }

    fn lag(&self, row: &Row) -> String {
        let default = self.default_row().and_then(Row::lag50);
        match (row.lag50(), default, self.lag_floor_ms) {
            (Some(a), Some(b), Some(floor)) if !row.default && (a - b).abs() <= floor => "=".into(),
            (lag, ..) => ms(lag),
        }
    }

    fn unsound(&self, out: &mut String) {
        let rows: Vec<&Row> = self.rows.iter().filter(|r| !r.sound()).collect();
        if rows.is_empty() {
            return;
        }
        *out += "## What cannot be chosen\n\n| setting | why |\n|---|---|\n";
        // What several have in common is said once.
        let mut lines: Vec<(String, Vec<String>)> = Vec::new();
        for row in rows {
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
        let more = lines.len().saturating_sub(MOST_LINES);
        for (why, names) in lines.iter().take(MOST_LINES) {
            let _ = writeln!(out, "| {} | {} |", some(names), message(why));
        }
        if more > 0 {
            let _ = writeln!(out, "| {more} more, in results.csv | |");
        }
        out.push('\n');
    }

    fn taken(&self, out: &mut String) {
        *out += "## How it was taken\n\n";
        for note in &self.notes {
            let _ = writeln!(out, "- {}", message(note));
        }
        for m in &self.machines {
            let (cpu, system, build) = (plain(&m.cpu), plain(&m.system), plain(&m.build));
            let _ = writeln!(out, "- {cpu}, {} cores, {system}; {build}", m.cores);
        }
        let _ = writeln!(
            out,
            "- seed {}; strokes: {}; materials: {}",
            self.seed,
            plain(&self.strokes.join(", ")),
            if self.materials.is_empty() {
                "the graph's own".into()
            } else {
                plain(&self.materials.join(", "))
            }
        );
        if let Some(t) = self.empty {
            let _ = writeln!(
                out,
                "- a tick that does nothing for {:.1} us, as long as the default's median, timed in turns with the others: p99.9 {:.1} us, at most {:.0} us. What the machine stalls by itself is in every p99.9 here; a budget is held against what is left without it",
                t.p50_us, t.p999_us, t.max_us
            );
        }
        let misses: u64 = self.rows.iter().filter_map(|r| r.time).map(|t| t.misses).sum();
        let ticks: u64 = self.rows.iter().filter_map(|r| r.time).map(|t| t.ticks).sum();
        let _ = writeln!(out, "- {misses} of {ticks} timed ticks took longer than a tick lasts");
        let floors: Vec<String> = self
            .floor
            .iter()
            .map(|(f, x)| format!("{} {x:.*} {}", f.name(), f.decimals() + 1, f.unit()).trim_end().to_owned())
            .collect();
        if !floors.is_empty() {
            let lag = self.lag_floor_ms.map_or(String::new(), |ms| format!(", lag {ms:.1} ms"));
            let load =
                self.load_floor.map_or(String::new(), |r| format!(", load {:.0} %", (r - 1.0) * 100.0));
            let _ = writeln!(
                out,
                "- less than this is not told apart (95 % of the differences between draws of one setting): {}{lag}{load}",
                floors.join(", ")
            );
        }
        if self.shards.len() > 1 {
            let _ = writeln!(
                out,
                "- {} shards, whose times are by their ratio to the default, which each of them timed",
                self.shards.len()
            );
        }
    }
}

fn ms(lag: Option<f64>) -> String {
    lag.map_or("-".into(), |ms| format!("{ms:.1}"))
}

/// A figure in a table.
fn value(figure: Figure, x: Option<f64>) -> String {
    x.map_or("-".into(), |x| format!("{x:.*}", figure.decimals()))
}

/// A figure's column.
fn title(figure: Figure) -> String {
    format!("{} {}", figure.name(), figure.unit()).trim_end().to_owned()
}

/// The head of a table whose last columns are figures.
fn head(out: &mut String, before: &[&str], figures: &[Figure]) {
    let titles: Vec<String> =
        before.iter().map(|t| (*t).to_owned()).chain(figures.iter().map(|f| title(*f))).collect();
    let _ = writeln!(out, "| {} |\n|{}", titles.join(" | "), "---|".repeat(titles.len()));
}

/// Some names, the first of very many.
fn some(names: &[String]) -> String {
    let more = names.len().saturating_sub(MOST_LINES);
    let first = names[..names.len() - more].join(", ");
    if more > 0 { format!("{first} and {more} more") } else { first }
}

#[cfg(test)]
#[path = "report_tests.rs"]
mod tests;
