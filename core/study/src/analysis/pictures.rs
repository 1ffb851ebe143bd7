//! Pictures of the figures.

use asperity_plot::{Boxes, Chart, Matrix, Plot, Scale, Spread, Trace};

use super::markdown::digits;
use super::{Analysis, Asked, Cell, Condition, Figures, PartFigures, Share, Summary, Threshold, Thresholds};

/// Most names in a legend: so many colours differ.
const COLOURS: usize = 4;
/// Plots of a chart in a row, and their size.
const COLUMNS: usize = 4;
const SIZE: [f64; 2] = [230.0, 130.0];
/// Points of a curve.
const POINTS: usize = 80;

/// A picture with its file name.
pub(super) struct Picture {
    pub(super) name: String,
    pub(super) title: String,
    drawing: Drawing,
}

enum Drawing {
    Boxes(Boxes),
    Matrix(Matrix),
    Chart(Chart),
}

impl Analysis {
    /// Pictures as file names with SVG documents. The report links to these names.
    pub fn pictures(&self) -> Vec<(String, String)> {
        let parts = self.parts.iter().enumerate();
        let asked =
            parts.flat_map(|(i, part)| part.asked.iter().enumerate().map(move |(j, q)| (i, part, j, q)));
        asked.flat_map(|(i, part, j, asked)| pictures(i, part, j, asked)).map(Picture::svg).collect()
    }
}

impl Picture {
    fn svg(self) -> (String, String) {
        let svg = match self.drawing {
            Drawing::Boxes(it) => it.to_svg(),
            Drawing::Matrix(it) => it.to_svg(),
            Drawing::Chart(it) => it.to_svg(),
        };
        (self.name, svg)
    }
}

/// Pictures of question `j` of part `i`.
pub(super) fn pictures(i: usize, part: &PartFigures, j: usize, asked: &Asked) -> Vec<Picture> {
    let mut out = Vec::new();
    let mut add = |of: &str, head: &str, draw: &dyn Fn(String) -> Drawing| {
        let title = format!("{}, {}: {head}", part.name, asked.name);
        let name = format!("{}-{}-{}-{of}.svg", i + 1, j + 1, slug(&asked.name));
        out.push(Picture { name, drawing: draw(title.clone()), title });
    };
    match &asked.figures {
        Figures::Numbers { range, labels, cells, .. } if cells.iter().any(|cell| cell.summary.is_some()) => {
            let kinds = distinct(cells.iter().map(|cell| cell.kind.as_str()));
            if part.factors.len() != 2 || kinds.len() > 1 {
                let ends = format!("{} ({}) to {} ({}).", range[0], labels[0], range[1], labels[1]);
                add("boxes", "answers", &|title| boxes(title, asked, cells, *range, &ends));
            }
            if let [rows, columns] = part.factors.as_slice() {
                for (k, kind) in kinds.iter().enumerate() {
                    add(&format!("matrix-{}", k + 1), &format!("medians of {kind}"), &|title| {
                        matrix(title, asked, [rows, columns], cells, kind, *range)
                    });
                }
            }
        }
        Figures::Shares(shares) if shares.iter().any(|share| share.n > 0) => {
            add("shares", "shares of the answers", &|title| bars(title, asked, shares));
        }
        Figures::Thresholds(of) => {
            for (k, condition) in of.conditions.iter().enumerate() {
                if condition.pooled.is_none() && condition.people.iter().any(|p| !p.trials.is_empty()) {
                    let head = format!("levels of {}", condition.name());
                    add(&format!("levels-{}", k + 1), &head, &|title| tracks(title, of, condition));
                }
            }
            if of.conditions.iter().filter_map(|c| c.pooled.as_ref()).any(|p| !p.counts.is_empty()) {
                add("functions", "answers of all participants", &|title| functions(title, of));
            }
        }
        _ => (),
    }
    out
}

/// Lower-case letters and digits of a name, joined by dashes.
fn slug(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("-").to_lowercase()
}

/// Each name once, in order.
pub(super) fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut out = Vec::new();
    names.for_each(|name| {
        if !out.contains(&name) {
            out.push(name);
        }
    });
    out
}

/// A label of some names; empty ones are left out.
pub(super) fn joined<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    names.into_iter().filter(|name| !name.is_empty()).collect::<Vec<_>>().join(", ")
}

/// Samples as groups of kinds. Many kinds, or a single group, stand side by side without colours.
fn grouped<'a>(
    samples: impl Iterator<Item = (&'a [String], &'a str, Option<Spread>)>,
) -> (Vec<String>, Vec<(String, Vec<Option<Spread>>)>) {
    let samples: Vec<_> = samples.map(|(l, k, s)| (joined(l.iter().map(String::as_str)), k, s)).collect();
    let kinds = distinct(samples.iter().map(|(_, kind, _)| *kind));
    let labels = distinct(samples.iter().map(|(label, ..)| label.as_str()));
    if kinds.len() > COLOURS || kinds.len() == 1 || labels.len() == 1 {
        let kind = |kind: &'a str| if kinds.len() == 1 && labels.len() > 1 { "" } else { kind };
        let alone = |(l, k, s): &(String, &'a str, Option<Spread>)| (joined([l, kind(k)]), vec![s.clone()]);
        return (vec![String::new()], samples.iter().map(alone).collect());
    }
    let of = |label: &str, kind: &str| {
        samples.iter().find(|(l, k, _)| l == label && *k == kind).and_then(|(_, _, sample)| sample.clone())
    };
    let group = |label: &&str| ((*label).to_owned(), kinds.iter().map(|kind| of(label, kind)).collect());
    let groups = labels.iter().map(group).collect();
    (kinds.iter().map(|kind| (*kind).to_owned()).collect(), groups)
}

fn boxes(title: String, asked: &Asked, cells: &[Cell], [low, high]: [f64; 2], ends: &str) -> Drawing {
    let spread = |s: &Summary| Spread::Box {
        whiskers: s.whiskers,
        quartiles: s.quartiles,
        median: s.median,
        outliers: s.outliers.clone(),
    };
    let sample = |cell| {
        let Cell { levels, kind, summary, .. }: &Cell = cell;
        (levels.as_slice(), kind.as_str(), summary.as_ref().map(spread))
    };
    let (kinds, groups) = grouped(cells.iter().map(sample));
    let most = cells.iter().filter_map(|cell| cell.summary.as_ref()).map(|s| s.n).max().unwrap_or(0);
    let people = format!("{most} people. Boxes span the quartiles, thick lines are medians (Tukey 1977).");
    let room = 0.04 * (high - low);
    Drawing::Boxes(Boxes {
        title,
        subtitles: vec![format!("{} {ends}", asked.text), people],
        y: "answer".into(),
        range: (low - room, high + room),
        reference: None,
        kinds,
        groups,
    })
}

fn bars(title: String, asked: &Asked, shares: &[Share]) -> Drawing {
    let several = distinct(shares.iter().map(|share| share.kind.as_str())).len() > 1;
    let same = shares.iter().all(|share| share.chance.is_none());
    // Kinds of trials are groups, unless there is one answer alone.
    let labels: Vec<Vec<String>> = shares
        .iter()
        .map(|share| match several && !same {
            true => share.levels.iter().chain([&share.kind]).cloned().collect(),
            false => share.levels.clone(),
        })
        .collect();
    let sample = |(share, levels)| {
        let (share, levels): (&Share, &Vec<String>) = (share, levels);
        let bar = |[value, low, high]: [f64; 3]| Spread::Bar {
            value: 100.0 * value,
            interval: [100.0 * low, 100.0 * high],
        };
        let kind = if same { &share.kind } else { &share.of };
        (levels.as_slice(), kind.as_str(), share.share.map(bar))
    };
    let (kinds, groups) = grouped(shares.iter().zip(&labels).map(sample));
    let chances: Vec<f64> = shares.iter().filter_map(|share| share.chance).collect();
    let chance = chances.first().filter(|chance| chances.iter().all(|other| other == *chance));
    let intervals = "Lines are 95 % intervals (Wilson 1927).".to_owned();
    Drawing::Boxes(Boxes {
        title,
        subtitles: vec![asked.text.clone(), intervals],
        y: if same { "answers \"different\" in %".into() } else { "answers in %".into() },
        range: (0.0, 105.0),
        reference: chance.map(|chance| (100.0 * chance, "chance".into())),
        kinds,
        groups,
    })
}

fn matrix(
    title: String,
    asked: &Asked,
    factors: [&(String, Vec<String>); 2],
    cells: &[Cell],
    kind: &str,
    range: [f64; 2],
) -> Drawing {
    let [rows, columns] = factors;
    Drawing::Matrix(Matrix {
        title,
        subtitles: vec![asked.text.clone()],
        rows: rows.clone(),
        columns: columns.clone(),
        range: (range[0], range[1]),
        decimals: 1,
        cells: medians(cells, kind, rows, columns),
    })
}

/// Medians of a kind, by the levels of two factors.
pub(super) fn medians(
    cells: &[Cell],
    kind: &str,
    rows: &(String, Vec<String>),
    columns: &(String, Vec<String>),
) -> Vec<Vec<Option<f64>>> {
    let median = |row: &String, column: &String| {
        let is_it = |cell: &&Cell| cell.kind == kind && cell.levels.iter().eq([row, column]);
        cells.iter().find(is_it).and_then(|cell| cell.summary.as_ref()).map(|s| s.median)
    };
    rows.1.iter().map(|row| columns.1.iter().map(|column| median(row, column)).collect()).collect()
}

impl Condition {
    /// Levels and kind of trial, in words.
    pub(super) fn name(&self) -> String {
        joined(self.levels.iter().chain([&self.kind]).map(String::as_str))
    }
}

fn tracks(title: String, of: &Thresholds, condition: &Condition) -> Drawing {
    // All plots have the same axes.
    let levels = || condition.people.iter().flat_map(|one| one.trials.iter().map(|(level, _)| *level));
    let (low, high) = levels().fold((f64::MAX, f64::MIN), |(l, h), level| (l.min(level), h.max(level)));
    let range = match of.is_logarithmic {
        true => (low / 1.2, high * 1.2),
        false => (low - 0.05 * (high - low), high + 0.05 * (high - low)),
    };
    let most = condition.people.iter().map(|one| one.trials.len()).max().unwrap_or(0) as f64;
    let plot = |one: &Threshold| {
        let points = || one.trials.iter().zip(1..).map(|((level, _), trial)| (f64::from(trial), *level));
        let last = one.trials.len() as f64;
        let line = |level: f64| vec![(1.0, level), (last.max(2.0), level)];
        let path = Trace { lines: vec![points().collect()], ..Trace::default() };
        let dots = one.reversals.iter().filter_map(|at| points().nth(*at)).collect();
        let reversals = Trace { dots, ..Trace::default() };
        let estimate = Trace { lines: one.threshold.map(line).into_iter().collect(), ..Trace::default() };
        let found = one.threshold.map_or_else(String::new, |t| digits(t, 3));
        Plot {
            heading: (one.participant.clone(), found),
            x_name: "trial".into(),
            x: Scale { logarithmic: false, range: Some((0.0, most + 1.0)) },
            y: Scale { logarithmic: of.is_logarithmic, range: (low < high).then_some(range) },
            traces: vec![path, reversals, estimate],
        }
    };
    let [stimulus, set] = &of.varied;
    let reversals = if of.method == "staircase" { ", dots are reversals" } else { "" };
    Drawing::Chart(Chart {
        title,
        subtitle: format!("{set} of {stimulus} by {}. Straight lines are estimates{reversals}.", of.method),
        columns: COLUMNS,
        size: SIZE,
        plots: condition.people.iter().filter(|one| !one.trials.is_empty()).map(plot).collect(),
        aside: Vec::new(),
    })
}

fn functions(title: String, of: &Thresholds) -> Drawing {
    let plot = |condition: &Condition| {
        let pooled = condition.pooled.as_ref()?;
        let counts = &pooled.counts;
        let dots =
            counts.iter().map(|c| (c.level, f64::from(c.correct) / f64::from(c.total.max(1)))).collect();
        let (low, high) = (counts.first()?.level, counts.last()?.level);
        let at = move |i: usize| {
            let part = i as f64 / POINTS as f64;
            if of.is_logarithmic { low * (high / low).powf(part) } else { low + (high - low) * part }
        };
        let curve = pooled.fit.map(|fit| (0..=POINTS).map(move |i| (at(i), fit.function.probability(at(i)))));
        Some(Plot {
            heading: (condition.name(), String::new()),
            x_name: of.varied[1].clone(),
            x: Scale { logarithmic: of.is_logarithmic, range: None },
            y: Scale { logarithmic: false, range: Some((-0.03, 1.03)) },
            traces: vec![Trace {
                dots,
                lines: curve.map(Iterator::collect).into_iter().collect(),
                ..Trace::default()
            }],
        })
    };
    let plots: Vec<Plot> = of.conditions.iter().filter_map(plot).collect();
    Drawing::Chart(Chart {
        title,
        subtitle: format!("Share of hits by {} of {}. Lines are fitted.", of.varied[1], of.varied[0]),
        columns: plots.len().clamp(2, 3),
        size: [300.0, 220.0],
        plots,
        aside: Vec::new(),
    })
}
