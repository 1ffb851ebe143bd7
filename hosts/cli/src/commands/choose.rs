//! `asperity choose`: the best setting within a budget, ready to paste.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use asperity_diagnostics::one_of;
use asperity_tradeoff::{Budget, Choice, Figure, Misfit, Results, Time};

use super::tradeoff::{count, read_results};
use crate::failure::{Failure, complain, print_report, wrong};
use crate::number::{number, whole};

/// Results of the shipped trade-off.
const SHIPPED: &str = include_str!("../../../../graphs/tradeoffs/results.json");

/// Print the best setting within a budget of time and lag, ready to paste into a graph
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&[
    "asperity choose --budget-us 100 --max-lag-ms 40",
    "asperity choose out/mine --by perceptual,level",
]))]
pub struct Args {
    /// Results of `asperity tradeoff`: the folder or its results.json; by default the shipped results
    #[arg(value_name = "RESULTS", value_parser = crate::shipped::path())]
    pub results: Option<PathBuf>,
    /// Longest tick in microseconds: limits the median, and the 99.9th percentile without machine stalls
    #[arg(long, value_name = "US", value_parser = number(1e-3, 1e9, "us"))]
    pub budget_us: Option<f64>,
    /// Longest response lag in milliseconds: until half of the answer to a step of speed
    #[arg(long, value_name = "MS", value_parser = number(0.0, 1e6, "ms"))]
    pub max_lag_ms: Option<f64>,
    /// Include the machine's stalls in the 99.9th percentile
    #[arg(long)]
    pub strict: bool,
    /// Figures to rank by, most important first: perceptual, modulation, spectrum, bands, level,
    /// repetition, kurtosis, steadiness, pitch, convergence, precision. By default all but the last two
    #[arg(long, value_name = "FIGURE,...", value_delimiter = ',')]
    pub by: Vec<String>,
    /// Required tick rate in Hz
    #[arg(long, value_name = "HZ", value_parser = whole(100_u32, 4000, "Hz"))]
    pub tick_hz: Option<u32>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Runs the command. Exit code 1 where no setting is within the budget.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (results, from) = match &args.results {
        Some(path) => (read_results(path)?, path.display().to_string()),
        None => (Results::parse(SHIPPED).map_err(Failure::Machine)?, "the shipped trade-off".to_owned()),
    };
    let budget = Budget {
        tick_us: args.budget_us,
        lag_ms: args.max_lag_ms,
        strict: args.strict,
        by: figures(&args.by)?,
        tick_hz: args.tick_hz,
    };
    known(&results, &budget.by, &from)?;
    let Some(choice) = results.choose(&budget) else {
        complain(&nothing(&results, &budget, &from));
        return Err(Failure::Said(1));
    };
    print_report(args.json, || choice.json(), || text(&results, &choice, &from))
}

fn figures(names: &[String]) -> Result<Vec<Figure>, Failure> {
    let of = |name: &String| {
        let help = || one_of(name, Figure::all().map(Figure::name));
        let figure = Figure::from_name(name.trim());
        figure.ok_or_else(|| wrong("--by", format!("there is no figure `{name}`"), help()))
    };
    names.iter().map(of).collect()
}

/// Refuses figures that no setting has.
fn known(results: &Results, by: &[Figure], from: &str) -> Result<(), Failure> {
    let Some(missing) = by.iter().find(|f| !results.knows(**f)) else { return Ok(()) };
    let there: Vec<&str> = Figure::all().filter(|f| results.knows(*f)).map(Figure::name).collect();
    let there = if there.is_empty() { "none".to_owned() } else { there.join(", ") };
    let what = format!("no setting of {from} has the figure `{}`", missing.name());
    Err(wrong("--by", what, format!("known figures: {there}")))
}

/// The setting as a fragment of a graph, with its cost and figures as comments.
fn text(results: &Results, choice: &Choice<'_>, from: &str) -> String {
    let (row, all) = (choice.row, count(results));
    let fit = if choice.fit == 1 { "one is".to_owned() } else { format!("{} are", choice.fit) };
    let mut out = format!("// {}: of {all} of {from} {fit} within the budget.\n", row.name);
    if let Some(Time { p50_us, p999_us, load_percent, .. }) = row.time {
        let lag = row.lag50().map_or("unknown".into(), |ms| format!("{ms:.1} ms"));
        out += &format!(
            "// A tick: median {p50_us:.1} us, 99.9 % within {p999_us:.1} us; \
             {load_percent:.2} % of a core; response lag {lag}.\n"
        );
    }
    let figure = |f: Figure| {
        let value = row.figure(f)?;
        Some(format!("{} {value:.*} {}", f.name(), f.decimals(), f.unit()).trim_end().to_owned())
    };
    let figures: Vec<String> = Figure::all().filter_map(figure).collect();
    if !figures.is_empty() {
        out += &format!("// {}.\n", figures.join(", "));
    }
    // The figures that decided, each with the number of settings left.
    let decided = choice.steps.iter().position(|(_, left)| *left == 1).map_or(choice.steps.len(), |i| i + 1);
    let steps = choice.steps[..decided].iter().map(|(figure, left)| format!("{} ({left})", figure.name()));
    let steps = steps.collect::<Vec<_>>().join(", then ");
    if choice.fit >= 2 && !steps.is_empty() {
        let rest = match choice.equals {
            1 => String::new(),
            n => format!("; the lowest load of {n} that are as good in all of them"),
        };
        out += &format!("// The best by {steps} (settings that tie within noise){rest}.\n");
    }
    if row.turned.iter().any(|(knob, _)| knob == "guards") {
        out += "// `guards` is not part of a graph: it can only be turned off to be measured.\n";
    }
    let (graph, fragment) = (&row.graph, &row.fragment);
    if fragment.is_empty() {
        out += &format!("// It is {graph}, unchanged.\n");
    } else if fragment.scene {
        let to = Path::new(graph).with_extension("graph.ron");
        out += &format!(
            "// {graph} is a scene. This command writes the graph that it lowers to:\n\
             //     asperity scene expand {graph} --out {}\n\
             // Put this into that graph:\n{fragment}",
            to.display()
        );
    } else {
        out += &format!("// Put this into {graph}:\n{fragment}");
    }
    out
}

/// Why no setting is within the budget, and the nearest ones.
fn nothing(results: &Results, budget: &Budget, from: &str) -> String {
    let misfits: Vec<Misfit> = results.rows.iter().filter_map(|r| results.fits(r, budget).err()).collect();
    let [unsound, slow, late, other] = [Misfit::Unsound, Misfit::Time, Misfit::Lag, Misfit::TickRate]
        .map(|why| misfits.iter().filter(|misfit| **misfit == why).count());
    let mut out = format!(
        "error: no setting of {from} is within the budget: of {}, {unsound} cannot be chosen, \
         {slow} take too long, {late} have a longer lag, {other} have another tick rate\n",
        count(results)
    );
    // Settings that only miss one of the limits.
    let but_for = |budget: Budget| results.rows.iter().filter(move |row| results.fits(row, &budget).is_ok());
    let stalls = |stall_us: f64| if budget.strict { 0.0 } else { stall_us };
    let late = |t: Time| (t.p999_us - stalls(t.stall_us)).max(t.p50_us);
    let in_any_time = but_for(Budget { tick_us: None, ..budget.clone() });
    let quickest = in_any_time.filter_map(|r| r.time).map(late).reduce(f64::min);
    let however_late = but_for(Budget { lag_ms: None, ..budget.clone() });
    let soonest = however_late.filter_map(|r| r.lag50()).reduce(f64::min);
    let other = but_for(Budget { tick_hz: None, ..budget.clone() });
    let rates: BTreeSet<u32> = other.map(|r| r.tick_hz).collect();
    let given = [budget.tick_us.is_some(), budget.lag_ms.is_some(), budget.tick_hz.is_some()];
    let several = given.iter().filter(|given| **given).count() > 1;
    let (rest, which) =
        if several { (" of those within the other limits", " within the other limits") } else { ("", "") };
    let without = if budget.strict { "" } else { ", without the machine's stalls" };
    let shortest = |us| format!("the shortest tick{rest}: {us:.1} us at the 99.9th percentile{without}");
    let lag = |ms| format!("the shortest response lag{rest}: {ms:.1} ms");
    let mut nearest = Vec::from_iter(quickest.map(shortest).into_iter().chain(soonest.map(lag)));
    if !rates.is_empty() {
        let rates: Vec<String> = rates.iter().map(u32::to_string).collect();
        nearest.push(format!("tick rates of settings{which}: {} Hz", rates.join(", ")));
    }
    if nearest.is_empty() && several {
        nearest.push("each setting misses several of the limits".into());
    }
    nearest.iter().for_each(|line| out += &format!("  {line}\n"));
    out
}

#[cfg(test)]
mod tests {
    use asperity_tradeoff::{Figures, Fragment, Row};

    use super::*;

    /// A setting with a changed node and ticks of 10 us.
    fn row(name: &str, tick_hz: u32) -> Row {
        Row {
            name: name.into(),
            key: name.into(),
            graph: "s/mine.ron".into(),
            tick_hz,
            fragment: Fragment { nodes: vec!["\"a\": (kind: \"mix\"),".into()], ..Fragment::default() },
            figures: Figures::from([(Figure::Bands, 1.0), (Figure::Level, 1.0)]),
            time: Some(Time { p50_us: 10.0, p999_us: 4020.0, stall_us: 4000.0, ..Time::default() }),
            ..Row::default()
        }
    }

    fn results(rows: Vec<Row>) -> Results {
        Results { shards: vec![(1, 1)], rows, ..Results::default() }
    }

    #[test]
    fn nearest_settings_are_named_where_none_fits() {
        let mut broken = row("c", 250);
        broken.faults = 1;
        let all = results(vec![row("a", 1000), row("b", 500), broken]);
        let of_rate = Budget { tick_hz: Some(4000), ..Budget::default() };
        assert!(all.choose(&of_rate).is_none());
        let of_time = |strict| Budget { tick_us: Some(1.0), strict, ..Budget::default() };
        for (budget, says, not) in [
            (of_rate, "tick rates of settings: 500, 1000 Hz", "shortest"),
            (of_time(false), "the shortest tick: 20.0 us", "tick rates"),
            (of_time(true), "the shortest tick: 4020.0 us", "tick rates"),
        ] {
            let said = nothing(&all, &budget, "it");
            assert!(said.contains("of 3 settings") && said.contains(says) && !said.contains(not), "{said}");
        }
    }

    #[test]
    fn nearest_settings_are_within_the_other_limits() {
        let timed = |name: &str, tick_hz, p50_us, lag: f64| Row {
            lag_ms: Some([lag; 3]),
            time: Some(Time { p50_us, p999_us: p50_us, ..Time::default() }),
            ..row(name, tick_hz)
        };
        let all = results(vec![
            timed("quick and late, of other ticks", 500, 10.0, 60.0),
            timed("slow", 1000, 300.0, 20.0),
            timed("slower and soon", 1000, 400.0, 5.0),
            timed("not so slow, and late", 1000, 200.0, 90.0),
        ]);
        for (tick_us, lag_ms, tick_hz, says) in [
            (100.0, None, Some(1000), "the shortest tick of those within the other limits: 200.0 us"),
            (100.0, None, Some(1000), "tick rates of settings within the other limits: 500 Hz"),
            (100.0, Some(30.0), Some(1000), "limits: 300.0 us"),
            (250.0, Some(10.0), Some(1000), "limits: 400.0 us"),
            (250.0, Some(10.0), Some(1000), "limits: 90.0 ms"),
            (1.0, Some(1.0), None, "misses several of the limits"),
        ] {
            let budget = Budget { tick_us: Some(tick_us), lag_ms, tick_hz, ..Budget::default() };
            let said = nothing(&all, &budget, "it");
            assert!(said.contains(says), "{says}: {said}");
            assert_eq!(said.contains("tick rates"), tick_hz.is_some() && lag_ms.is_none(), "{said}");
        }
    }

    #[test]
    fn unknown_figure_is_refused() {
        let all = results(vec![row("a", 500)]);
        assert!(known(&all, &[Figure::Level, Figure::Bands], "it").is_ok());
        let e = known(&all, &[Figure::Level, Figure::Convergence], "it").unwrap_err();
        let Failure::Input(e) = e else { panic!("{e:?}") };
        let said = e[0].to_string();
        assert!(said.contains("`convergence`") && said.contains("bands, level"), "{said}");
    }

    #[test]
    fn scene_fragment_goes_into_the_lowered_graph() {
        let mut all = results(vec![row("a", 500)]);
        let said = |all: &Results| text(all, &all.choose(&Budget::default()).unwrap(), "it");
        assert!(said(&all).contains("Put this into s/mine.ron:\n"), "{}", said(&all));
        all.rows[0].fragment.scene = true;
        let said = said(&all);
        assert!(said.contains("asperity scene expand s/mine.ron --out s/mine.graph.ron\n"), "{said}");
        assert!(!said.contains("into s/mine.ron"), "{said}");
    }

    #[test]
    fn figures_are_listed_until_one_decides() {
        let said = |rows| {
            let all = results(rows);
            text(&all, &all.choose(&Budget::default()).unwrap(), "it")
        };
        let one = said(vec![row("a", 500)]);
        assert!(one.contains("of one setting of it one is within") && !one.contains("The best by"), "{one}");
        let mut other = row("b", 500);
        other.figures.insert(Figure::Bands, 2.0);
        let two = said(vec![row("a", 500), other]);
        assert!(two.contains("of 2 settings of it 2 are within the budget."), "{two}");
        assert!(two.contains("by bands (1) (settings") && !two.contains("level ("), "{two}");
    }
}
