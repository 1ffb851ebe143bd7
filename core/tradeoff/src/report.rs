//! Results as a page to read in two minutes, and as comma-separated values.

use crate::choose::Budget;
use crate::figure::Figure;
use crate::results::{Results, Row, Time};

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
/// Most characters of a name and of a reason in a table: results.json has all of it.
const NAME: usize = 72;
const REASON: usize = 200;

/// Cells of a line of a table.
type Line = Vec<String>;

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
            "# The cost of accuracy in time\n\n{} of {}, each over {} and {materials}. {} of them may be \
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
        let missing: Line = self.missing_shards().iter().map(usize::to_string).collect();
        if !missing.is_empty() {
            let (of, missing) = (self.shards.first().map_or(1, |s| s.1), missing.join(", "));
            out += &format!("**Missing shards: {missing} of {of}**, with their settings.\n\n");
        }
        let first = [Figure::Perceptual, Figure::Spectrum, Figure::Convergence, Figure::Level];
        if let Some(figure) = first.into_iter().find(|f| !self.pareto_front(*f).is_empty()) {
            out += &format!(
                "![{}]({})\n\nAll pictures, over time: {}.\nOver lag: {}.\n\
                 docs/explanation/accuracy.md explains the figures.\n\n",
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
        let links: Line = Figure::all().filter(drawn).map(link).collect();
        if links.is_empty() { "none".into() } else { links.join(", ") }
    }

    /// Figures in tables.
    fn shown(&self) -> Vec<Figure> {
        SHOWN.into_iter().filter(|f| self.knows(*f)).take(FIRST).collect()
    }

    fn budgets(&self) -> String {
        let shown = self.shown();
        let line = |(lag_ms, tick_us)| {
            let row = self.choose(&Budget { tick_us, lag_ms, ..Budget::default() })?.row;
            let time = row.time?;
            let limit = |most: Option<f64>| most.map_or("any".to_owned(), |most| most.to_string());
            let cells = [
                limit(tick_us),
                limit(lag_ms),
                named(row),
                format!("{:.2}", time.load_percent),
                format!("{:.1} / {:.1}", time.p50_us, time.p999_us),
                format!("{:.1}", time.stall_us),
                ms(row.lag50()),
            ];
            Some(cells.into_iter().chain(figures(row, &shown)).collect())
        };
        let limits = LAGS_MS.into_iter().flat_map(|lag| BUDGETS_US.map(|us| (lag, us)));
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
        let titles =
            "us a tick; longest lag, ms; setting; load %; p50 / p99.9 us; stalls in p99.9, us; lag, ms";
        section(
            &format!("Which setting for which budget\n\n{by}"),
            table(titles, &shown, limits.filter_map(line).collect()),
        )
    }

    fn steps(&self) -> String {
        let physics = [Figure::Perceptual, Figure::Modulation, Figure::Spectrum];
        let known = |f: &Figure| !self.pareto_front(*f).is_empty();
        let mut figures: Vec<Figure> = physics.into_iter().filter(known).collect();
        if figures.is_empty() {
            figures.extend([Figure::Convergence].into_iter().filter(known));
        }
        let step = |figure: Figure| {
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
            let title = figure.with_unit().replace(' ', ", ");
            table(&format!("{title}; gain; load %; cost; lag, ms; setting"), &[], lines.collect())
        };
        let how = "From the lowest load on. Each step is better by more than noise.";
        let tables: String = figures.into_iter().map(step).collect();
        section(&format!("The Pareto front, step by step\n\n{how}"), tables)
    }

    fn baselines(&self) -> String {
        let known = |f: &Figure| self.rows.iter().any(|r| r.baseline && r.figure(*f).is_some());
        let all: Vec<Figure> = Figure::all().filter(known).collect();
        let line = |row: &Row| {
            let load = row.load().map_or("-".into(), |load| format!("{load:.2}"));
            [named(row), load, ms(row.lag50())].into_iter().chain(figures(row, &all)).collect()
        };
        let any = self.rows.iter().any(|row| row.baseline);
        let rows = self.rows.iter().filter(|row| any && (row.default || row.baseline));
        section(
            "Baselines\n\nOther graphs, over the same strokes and materials.",
            table("graph; load %; lag, ms", &all, rows.map(line).collect()),
        )
    }

    fn limits(&self) -> String {
        let lines = self.model.iter().filter_map(|(&figure, &reference)| {
            let (now, (best, value)) = (self.default_row()?.figure(figure)?, self.best(figure)?);
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
        let titles =
            "figure; the network's magnitudes; the default; the best setting; left to gain behind it";
        section(
            "Where the model is the limit\n\n\
             The reference: figures of the network's own magnitudes, under the default.\n\
             Nodes behind the network can pass it, by correcting its errors.\n\
             Where nothing is left to gain, a better network is likely to help; \
             phase retrieval and actuator model are not.",
            table(titles, &[], lines.collect()),
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
        let mut out = String::new();
        for grid in grids {
            let rows = self.rows.iter().filter(|r| !r.default && r.grids.contains(grid));
            let mut lines: Vec<Line> = rows.map(|row| self.compared(row)).collect();
            lines.sort_by_key(|cells| cells[1..].iter().all(|c| c == "=" || c == "-"));
            let more = lines.len().saturating_sub(MOST_LINES);
            lines.truncate(MOST_LINES);
            if !lines.is_empty() {
                let table = table("setting; load; lag, ms", &self.shown(), lines);
                out += &format!("### {}\n\n{table}", plain(grid));
            }
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
        let how = format!("Compared with {default}. The load is a ratio. `=`: equal within noise.");
        section(&format!("Knob by knob\n\n{how}"), out)
    }

    /// Name, load, lag and figures of a row, compared with the default's.
    fn compared(&self, row: &Row) -> Line {
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
        let mut reasons: Vec<(String, Line)> = Vec::new();
        for row in self.rows.iter().filter(|r| !r.sound()) {
            let fails = row.fails.iter().map(|(case, found)| format!("{case}: {found}"));
            let mut why: Line = row.error.iter().cloned().chain(fails).collect();
            if row.faults > 0 {
                why.push(format!("nodes failed {} times", row.faults));
            }
            if why.is_empty() {
                why.push("it is not finished".into());
            }
            let why = reason(&why.join("; "));
            match reasons.iter_mut().find(|(there, _)| *there == why) {
                Some((_, names)) => names.push(named(row)),
                None => reasons.push((why, vec![named(row)])),
            }
        }
        let line = |(why, names): &(String, Line)| {
            let more = names.len().saturating_sub(MOST_LINES);
            let first = names[..names.len() - more].join(", ");
            let names = if more > 0 { format!("{first} and {more} more") } else { first };
            vec![names, message(why)]
        };
        let mut lines: Vec<Line> = reasons.iter().take(MOST_LINES).map(line).collect();
        if reasons.len() > MOST_LINES {
            let more = reasons.len() - MOST_LINES;
            lines.push(vec![format!("{more} more, in results.csv"), String::new()]);
        }
        section("Settings that cannot be chosen", table("setting; why", &[], lines))
    }

    fn method(&self) -> String {
        let mut lines: Line = self.notes.iter().map(|note| message(note)).collect();
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
        let mut floors: Line = self.noise_floor.iter().map(floor).collect();
        if !floors.is_empty() {
            floors.extend(self.lag_noise_floor_ms.map(|ms| format!("lag {ms:.1} ms")));
            floors.extend(self.load_noise_floor.map(|r| format!("load {:.0} %", (r - 1.0) * 100.0)));
            let what = "noise floor (95 % of the differences between draws of one setting)";
            lines.push(format!("{what}: {}", floors.join(", ")));
        }
        section("How it was measured", lines.into_iter().map(|line| format!("- {line}\n")).collect())
    }

    /// A table of comma-separated values with a line for each setting. Unknown values are empty.
    pub fn csv(&self) -> String {
        let mut out = csv::Writer::from_writer(Vec::new());
        let titles = cells(&Row::default()).into_iter().map(|(title, _)| title).collect();
        let lines = self.rows.iter().map(|row| cells(row).into_iter().map(|(_, value)| value).collect());
        for line in std::iter::once::<Line>(titles).chain(lines) {
            // Into memory, and all lines have as many fields: nothing can fail.
            let _ = out.write_record(line);
        }
        String::from_utf8(out.into_inner().unwrap_or_default()).unwrap_or_default()
    }
}

/// Titles and values of a row of the CSV table.
fn cells(row: &Row) -> Vec<(String, String)> {
    let number = |x: Option<f64>| x.map_or(String::new(), |x| ((x * 1e4).round() / 1e4).to_string());
    let time = |of: fn(&Time) -> f64| row.time.as_ref().map(of);
    let mut all: Vec<(String, String)> = Vec::new();
    let mut put = |title: &str, value: String| all.push((title.to_owned(), value));
    put("setting", row.name.clone());
    put("graph", row.graph.clone());
    put("grids", row.grids.join("; "));
    put("default", row.default.to_string());
    put("baseline", row.baseline.to_string());
    put("tick_hz", row.tick_hz.to_string());
    for figure in Figure::all() {
        put(&figure.with_unit().to_lowercase().replace(' ', "_"), number(row.figure(figure)));
    }
    for (i, part) in [10, 50, 90].into_iter().enumerate() {
        put(&format!("lag_{part}_ms"), number(row.lag_ms.map(|l| l[i])));
    }
    put("latency_ms", number(row.latency_ms));
    put("load_percent", number(time(|t| t.load_percent)));
    let of_tick: [(&str, fn(&Time) -> f64); 4] =
        [("p50", |t| t.p50_us), ("p99", |t| t.p99_us), ("p999", |t| t.p999_us), ("max", |t| t.max_us)];
    for (name, of) in of_tick {
        put(&format!("{name}_us"), number(time(of)));
        put(&format!("{name}_percent"), number(time(of).map(|us| us * f64::from(row.tick_hz) * 1e-4)));
    }
    put("stall_us", number(time(|t| t.stall_us)));
    put("cold_us", number(time(|t| t.cold_us)));
    put("misses", number(time(|t| t.misses as f64)));
    put("ticks", number(time(|t| t.ticks as f64)));
    put("memory_kib", number(row.time.and_then(|t| t.memory_kib)));
    put("faults", row.faults.to_string());
    put("cases", row.cases.to_string());
    put("fails", row.fails.keys().cloned().collect::<Line>().join("; "));
    put("error", row.error.as_deref().map_or(String::new(), reason));
    all
}

/// A section; nothing without a body.
fn section(title: &str, body: String) -> String {
    if body.is_empty() { body } else { format!("## {title}\n\n{body}") }
}

/// A table; nothing without lines. Figures have columns behind those of the titles.
fn table(titles: &str, figures: &[Figure], lines: Vec<Line>) -> String {
    if lines.is_empty() {
        return String::new();
    }
    let titles: Line =
        titles.split("; ").map(str::to_owned).chain(figures.iter().map(|f| f.with_unit())).collect();
    let line = |cells: Line| format!("| {} |\n", cells.join(" | "));
    let rule = format!("|{}\n", "---|".repeat(titles.len()));
    [line(titles), rule].into_iter().chain(lines.into_iter().map(line)).chain(["\n".into()]).collect()
}

/// Cells of some figures.
fn figures<'f>(row: &'f Row, figures: &'f [Figure]) -> impl Iterator<Item = String> + 'f {
    figures.iter().map(|f| f.shown(row.figure(*f)))
}

fn ms(lag: Option<f64>) -> String {
    lag.map_or("-".into(), |ms| format!("{ms:.1}"))
}

/// Name of a setting in a table.
fn named(row: &Row) -> String {
    code(&cut(&row.name, NAME))
}

/// A text of at most so many characters; an ellipsis replaces the rest.
fn cut(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    let short: String = text.chars().take(most.saturating_sub(1)).collect();
    short.trim_end().to_owned() + "…"
}

/// A reason in one line, without the list of names that an error may end with.
fn reason(text: &str) -> String {
    let text = text.replace(['\n', '\r'], " ");
    cut(text.split(" (there are `").next().unwrap_or_default(), REASON)
}

/// A name in backticks, or escaped where backticks cannot hold it.
fn code(name: &str) -> String {
    if name.is_empty() || name.contains(['`', '|', '\n', '\r']) { plain(name) } else { format!("`{name}`") }
}

/// A text in which nothing is markup.
fn plain(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '\n' | '\r' => out.push(' '),
            '\\' | '`' | '*' | '_' | '<' | '>' | '[' | ']' | '|' | '#' | '~' | '&' => out.extend(['\\', c]),
            c => out.push(c),
        }
    }
    out
}

/// A message whose backticks stay backticks.
fn message(text: &str) -> String {
    let parts: Vec<&str> = text.split('`').collect();
    if parts.len().is_multiple_of(2) {
        return plain(text);
    }
    parts.iter().enumerate().map(|(i, part)| if i % 2 == 1 { code(part) } else { plain(part) }).collect()
}

#[cfg(test)]
#[path = "report_tests.rs"]
mod tests;
