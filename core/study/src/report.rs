//! Results as a page that a person reads in two minutes.

use std::fmt::Write as _;

use crate::choose::Budget;
use crate::figure::Figure;
use crate::result::{Results, Row};

/// Budgets that the report answers, in microseconds a tick; none for any.
const BUDGETS_US: [Option<f64>; 7] =
    [Some(10.0), Some(20.0), Some(50.0), Some(100.0), Some(200.0), Some(500.0), None];
/// Longest lags that it answers \[ms\].
const LAGS_MS: [Option<f64>; 2] = [None, Some(30.0)];
/// Figures in the tables.
const SHOWN: [Figure; 5] =
    [Figure::Perceptual, Figure::Spectrum, Figure::Bands, Figure::Level, Figure::Convergence];
/// Most lines of a grid of several knobs.
const MOST_LINES: usize = 12;

impl Results {
    /// The report, in Markdown; pictures are named by [`picture_name`](Self::picture_name).
    pub fn report(&self) -> String {
        let mut out = String::from("# What accuracy costs in time\n\n");
        self.head(&mut out);
        self.budgets(&mut out);
        self.steps(&mut out);
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
            "{} of `{}`, each over {} and {materials}. {sound} of them may be chosen: they ran{held}.\n",
            of(self.rows.len(), "setting", "settings"),
            self.study,
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
                "![{}]({})\n\nEach figure is by itself in a picture: against time {}; against lag {}. What they are says docs/accuracy.md.\n",
                figure.title(),
                Self::picture_name(figure, "time"),
                self.links("time"),
                self.links("lag"),
            );
        }
    }

    fn links(&self, against: &str) -> String {
        let known = Figure::ALL.into_iter().filter(|f| self.rows.iter().any(|r| r.figure(*f).is_some()));
        let links: Vec<String> =
            known.map(|f| format!("[{}]({})", f.name(), Self::picture_name(f, against))).collect();
        links.join(", ")
    }

    /// Columns of figures that any row has.
    fn shown(&self) -> Vec<Figure> {
        SHOWN.into_iter().filter(|f| self.rows.iter().any(|r| r.figure(*f).is_some())).collect()
    }

    fn figures_head(&self, out: &mut String, before: &str) {
        let shown = self.shown();
        let titles: Vec<String> = shown
            .iter()
            .map(|f| if f.unit().is_empty() { f.name().into() } else { format!("{} {}", f.name(), f.unit()) })
            .collect();
        let _ = writeln!(out, "{before} {} |", titles.join(" | "));
        let columns = before.matches('|').count() - 1 + shown.len();
        let _ = writeln!(out, "|{}", "---|".repeat(columns));
    }

    fn figures(&self, row: &Row) -> String {
        let cell = |f: Figure| row.figure(f).map_or("-".into(), |x| format!("{x:.*}", f.decimals()));
        self.shown().into_iter().map(cell).collect::<Vec<_>>().join(" | ")
    }

    fn budgets(&self, out: &mut String) {
        let mut lines: Vec<(String, String)> = Vec::new();
        for lag_ms in LAGS_MS {
            for tick_us in BUDGETS_US {
                let Some(choice) = self.choose(&Budget { tick_us, lag_ms, ..Budget::default() }) else {
                    continue;
                };
                let row = choice.row;
                let (Some(time), lag) = (row.time, ms(row.lag50())) else { continue };
                let budget = tick_us.map_or("any".to_owned(), |us| format!("{us}"));
                let line = format!(
                    "{} | {} | {:.2} | {:.1} / {:.1} | {lag} | {} |",
                    lag_ms.map_or("any".to_owned(), |ms| format!("{ms}")),
                    name(row),
                    time.load_percent,
                    time.p50_us,
                    time.p999_us,
                    self.figures(row)
                );
                // More to spend that buys nothing is one line.
                match lines.iter_mut().find(|(_, there)| *there == line) {
                    Some((budgets, _)) => {
                        let first = budgets.split(' ').next().unwrap_or_default().to_owned();
                        *budgets = format!("{first} and more");
                    }
                    None => lines.push((budget, line)),
                }
            }
        }
        if lines.is_empty() {
            return;
        }
        *out += "## Which setting for which budget\n\nBy perceptual similarity first, then spectrum, bands, level; of what is not told apart, the cheapest.\n\n";
        self.figures_head(
            out,
            "| us a tick | lag at most, ms | setting | load % | p50 / p99.9 us | lag, ms |",
        );
        for (budget, line) in lines {
            let _ = writeln!(out, "| {budget} | {line}");
        }
        out.push('\n');
    }

    fn steps(&self, out: &mut String) {
        let mut any = false;
        for figure in [Figure::Perceptual, Figure::Spectrum, Figure::Convergence] {
            let front = self.undominated(figure);
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
            for row in front.into_iter().filter_map(|i| self.rows.get(i)) {
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
                    name(row)
                );
                before = Some(row);
            }
            out.push('\n');
        }
    }

    fn limits(&self, out: &mut String) {
        let Some(default) = self.default_row().filter(|_| !self.model.is_empty()) else { return };
        *out += "## Where the model is the limit\n\n\
                 What the network's own magnitudes would come to, were all behind them perfect, beside what was reached. Where both are not told apart, no phase retrieval and \
                 no actuator model would make it better: a better network would.\n\n\
                 | figure | the network's magnitudes | the default | the best setting | left to win behind the network |\n|---|---|---|---|---|\n";
        for (&figure, &limit) in &self.model {
            let (Some(now), Some(best)) = (default.figure(figure), self.best(figure)) else { continue };
            let digits = figure.decimals();
            let left = figure.gain(limit, best.1);
            let left = if left > 0.0 && self.differ(figure, limit, best.1) {
                format!("{left:.digits$}")
            } else {
                "nothing that is told apart".into()
            };
            let _ = writeln!(
                out,
                "| {} | {limit:.digits$} | {now:.digits$} | {:.digits$} ({}) | {left} |",
                figure.name(),
                best.1,
                name(best.0)
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
        *out +=
            "## Knob by knob\n\nLoad as a ratio to the default's; `=`: not told apart from the default.\n\n";
        for grid in grids {
            let mut rows: Vec<&Row> =
                self.rows.iter().filter(|r| r.grids.iter().any(|g| g == grid)).collect();
            let all = rows.len();
            let _ = writeln!(out, "### {grid}\n");
            if all > MOST_LINES {
                let worth: Vec<usize> = [Figure::Perceptual, Figure::Spectrum]
                    .iter()
                    .flat_map(|f| self.undominated(*f))
                    .collect();
                let keys: Vec<&str> = worth.iter().map(|i| self.rows[*i].key.as_str()).collect();
                rows.retain(|r| r.default || keys.contains(&r.key.as_str()));
                let _ = writeln!(
                    out,
                    "Of {all} settings those that are undominated in `perceptual` or `spectrum`; all are in results.csv.\n"
                );
            }
            self.figures_head(out, "| setting | load | lag, ms |");
            for row in rows {
                let _ = writeln!(
                    out,
                    "| {} | {} | {} | {} |",
                    name(row),
                    self.ratio(row),
                    self.lag(row),
                    self.against_default(row)
                );
            }
            out.push('\n');
        }
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

    fn against_default(&self, row: &Row) -> String {
        let default = self.default_row();
        let cell = |f: Figure| match (row.figure(f), default.and_then(|d| d.figure(f))) {
            (Some(a), Some(b)) if !row.default && !self.differ(f, a, b) => "=".into(),
            (Some(a), _) => format!("{a:.*}", f.decimals()),
            _ => "-".into(),
        };
        self.shown().into_iter().map(cell).collect::<Vec<_>>().join(" | ")
    }

    fn unsound(&self, out: &mut String) {
        let rows: Vec<&Row> = self.rows.iter().filter(|r| !r.sound()).collect();
        if rows.is_empty() {
            return;
        }
        *out += "## What cannot be chosen\n\n| setting | why |\n|---|---|\n";
        for row in rows {
            let fails = row.fails.iter().map(|(case, found)| format!("{case}: {found}"));
            let mut why: Vec<String> = row.error.iter().cloned().chain(fails).collect();
            if row.faults > 0 {
                why.push(format!("nodes failed {} times", row.faults));
            }
            let _ = writeln!(
                out,
                "| {} | {} |",
                name(row),
                why.join("; ").replace('|', "\\|").replace('\n', " ")
            );
        }
        out.push('\n');
    }

    fn taken(&self, out: &mut String) {
        *out += "## How it was taken\n\n";
        for m in &self.machines {
            let _ = writeln!(out, "- {}, {} cores, {}; {}", m.cpu, m.cores, m.system, m.build);
        }
        let _ = writeln!(
            out,
            "- seed {}; strokes: {}; materials: {}",
            self.seed,
            self.strokes.join(", "),
            if self.materials.is_empty() { "the graph's own".into() } else { self.materials.join(", ") }
        );
        if let Some(t) = self.empty {
            let _ = writeln!(
                out,
                "- a tick in which nothing is done, timed in turns with the others: p99.9 {:.1} us, at most {:.0} us. What the machine does by itself is in every p99.9 here",
                t.p999_us, t.max_us
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

/// A setting's name in a table.
fn name(row: &Row) -> String {
    format!("`{}`", row.name.replace('|', "\\|"))
}

#[cfg(test)]
mod tests {
    use crate::testing::{measured, results, row};

    #[test]
    fn the_report_says_what_to_take_and_what_cannot_be_told_apart() {
        let mut default = measured("default", 4.0, 1.0, 20.0);
        default.default = true;
        default.grids = vec!["g".into()];
        let mut near = measured("near", 4.04, 1.05, 20.5);
        near.grids = vec!["g".into()];
        let mut better = measured("better", 8.0, 0.5, 60.0);
        better.grids = vec!["g".into()];
        let mut broken = row("broken");
        broken.error = Some("no such thing | as this".into());
        let report = results(vec![default, near, better, broken]).report();
        let line = |start: &str| report.lines().find(|l| l.starts_with(start)).unwrap_or("").to_owned();
        assert_eq!(line("| `near`"), "| `near` | = | = | = |");
        assert_eq!(line("| `better`"), "| `better` | 2.00 | 60.0 | 0.50 |");
        assert!(line("| `broken`").contains("no such thing \\| as this"), "{report}");
        // 80 us and 120 us at the 99.9th percentile for the default, 160 and 240 for the better one.
        assert!(line("| 200 | any").contains("`default`"), "{report}");
        assert!(line("| 500 and more | any").contains("`better`"), "{report}");
        assert!(line("| 200 and more | 30").contains("`default`"), "{report}");
        assert!(line("| level").contains("0.30 | 1.00 | 0.50 (`better`) | 0.20"), "{report}");
    }
}
