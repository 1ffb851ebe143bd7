//! The report in Markdown.

use super::inference::NOT_SIGNIFICANT;
use super::markdown::{Grid, NONE, digits, escaped, or_none, p_value, paragraph, short};
use super::pictures::{distinct, joined, medians, pictures};
use super::{
    Analysis, Asked, Cell, Figures, Finding, PartFigures, Screening, Share, Summary, Tested, Threshold,
    Thresholds, Told,
};

const READ_NUMBERS: &str = "\
    n counts people. A person's value is the mean of their answers in the cell. Missing people gave no \
    answer there. Quartiles are interpolated (Hyndman and Fan 1996, type 7). Whiskers of the picture end \
    at the last value within 1.5 box lengths (Tukey 1977). The 95 % interval of a mean is that of Student's \
    t. That of a median lies between two of the values (Conover 1999), and needs six people.";
const READ_SKEWNESS: &str = "\
    Z and p are those of the two-sided skewness test (D'Agostino 1970). A small p speaks against a \
    normal distribution. Declared tests use ranks and do not need one.";
const READ_SHARES: &str = "\
    n counts answers. The interval holds the true share with 95 % confidence (Wilson 1927). It takes \
    answers as independent.";
const READ_FRIEDMAN: &str = "\
    n counts people. The statistic is chi-square, corrected for ties (Friedman 1937). W is Kendall's \
    coefficient of concordance: 0 is no agreement, 1 is full agreement. *Left out* counts people without \
    an answer to each kind.";
const READ_WILCOXON: &str = "\
    n counts differences that are not zero (Wilcoxon 1945). *Zeros* counts the others. *Left out* counts \
    people without both answers. The rank sum is the smaller one if two-sided, else that of positive \
    differences. *Exact with ties* takes the midranks of the sample. CLES is the probability that the \
    first kind gets the larger answer: the common language effect size (McGraw and Wong 1992).";
const READ_BINOMIAL: &str = "\
    k of n answers name the stimulus. p comes from the exact binomial test against chance. It takes \
    answers as independent. It is not corrected for the number of cells.";
const READ_ABILITY: &str = "\
    Abilities are on the log scale and sum to 0. With a difference d, a stimulus wins with probability 1 \
    / (1 + exp(-d)) (Bradley and Terry 1952). The intervals have 95 % confidence. They take answers as \
    independent.";
const READ_STAIRCASE: &str = "\
    The threshold is the mean level of the last reversals (Levitt 1971), a geometric mean for steps by \
    ratios. sd is the standard deviation of these reversals. Medians and quartiles are over people.";
const READ_QUEST: &str = "\
    Threshold and slope are means of the posterior (Watson 2017). sd is the posterior's standard deviation \
    of the threshold. With few trials both lie towards the middle of the possible values. Medians and \
    quartiles are over people.";
const READ_FIT: &str = "\
    Functions are fitted by maximum likelihood, with 95 % profile intervals. *Open* is an end that the \
    answers do not fix. A small p of the deviance speaks against the function (Wichmann and Hill 2001). \
    Answers are taken as independent, also those of one person.";
const READ_EQUALITY: &str = "\
    The PSE (point of subjective equality) has 50 % of the function's rise. The JND (just noticeable \
    difference) is half the distance from 25 % to 75 %.";

impl Analysis {
    /// The report in Markdown. `folder` is the path from the report to the pictures, such as `pictures/`.
    pub fn report(&self, folder: &str) -> String {
        let mut out = format!("# {}\n\n", escaped(&self.title));
        self.head(&mut out);
        for (i, part) in self.parts.iter().enumerate() {
            out += &format!("## Part {}: {}\n\n", i + 1, escaped(&part.name));
            let factors = part.factors.iter().map(|(name, levels)| format!("{name} ({})", levels.len()));
            let mut told = format!("Trials for each participant: {}.", part.trials);
            if !part.factors.is_empty() {
                told += &format!(" Factors: {}.", escaped(&factors.collect::<Vec<_>>().join(", ")));
            }
            out += &paragraph(&format!("{told} Kinds of trials: {}.", escaped(&part.kinds.join(", "))));
            if part.asked.is_empty() {
                out += "No questions.\n\n";
            }
            for (j, asked) in part.asked.iter().enumerate() {
                question(&mut out, asked);
                for picture in pictures(i, part, j, asked) {
                    out += &format!("![{}]({folder}{})\n\n", escaped(&picture.title), picture.name);
                }
                figures(&mut out, part, asked);
                for test in part.tests.iter().filter(|test| test.question == asked.name) {
                    tested(&mut out, test);
                }
            }
        }
        if !self.survey.is_empty() {
            out += "## Survey\n\n";
            self.survey(&mut out);
        }
        out.trim_end().to_owned() + "\n"
    }

    fn head(&self, out: &mut String) {
        let sum = |of: fn(&super::Participant) -> usize| self.participants.iter().map(of).sum::<usize>();
        let mut counts = Grid::new(["figure", "value"]);
        counts.row(["Participants", &self.participants.len().to_string()]);
        counts.row(["Planned participants", &self.planned.to_string()]);
        counts.row(["Answered trials", &sum(|p| p.answered).to_string()]);
        counts.row(["Unanswered trials", &sum(|p| p.unanswered).to_string()]);
        counts.row(["Excluded showings of trials", &self.excluded.len().to_string()]);
        counts.row(["Seed", &self.seed.to_string()]);
        *out += &counts.text();
        self.warnings.iter().for_each(|warning| *out += &format!("**Note:** {}\n\n", escaped(warning)));
        let mut people = Grid::new(["participant", "answered", "unanswered", "excluded"]);
        for p in &self.participants {
            let counts = [p.answered, p.unanswered, p.excluded].map(|n| n.to_string());
            people.row([p.code.clone()].into_iter().chain(counts));
        }
        if !self.participants.is_empty() {
            *out += "## Participants\n\n";
            *out += &people.text();
        }
        if !self.excluded.is_empty() {
            *out += "## Excluded trials\n\n";
            let mut grid = Grid::new(["participant", "part", "trial", "reason"]);
            for e in &self.excluded {
                grid.row([&e.participant, &e.part, &e.trial.to_string(), &e.why]);
            }
            *out += &grid.text();
        }
        if !self.notes.is_empty() {
            *out += "## Remarks of the experimenter\n\n";
            let mut grid = Grid::new(["participant", "trial", "remark"]);
            for n in &self.notes {
                grid.row([n.participant.clone(), or_none(n.trial, |t| t.to_string()), n.text.clone()]);
            }
            *out += &grid.text();
        }
    }

    fn survey(&self, out: &mut String) {
        let scales = || {
            self.survey.iter().filter_map(|asked| match &asked.figures {
                Figures::Numbers { cells, counts, labels, .. } => {
                    Some((asked, cells.first()?, counts, labels))
                }
                _ => None,
            })
        };
        let mut grid = Grid::new(["question", "n", "missing", "mean", "sd", "median", "distribution"]);
        for (asked, cell, counts, _) in scales() {
            let each = counts.iter().map(|(number, count)| format!("{number}: {count}"));
            let s = cell.summary.as_ref();
            grid.row([
                asked.name.clone(),
                s.map_or(0, |s| s.n).to_string(),
                cell.missing.to_string(),
                or_none(s, |s| format!("{:.2}", s.mean)),
                or_none(s.and_then(|s| s.sd), |sd| format!("{sd:.2}")),
                or_none(s, |s| short(s.median)),
                each.collect::<Vec<_>>().join(", "),
            ]);
        }
        for (asked, _, counts, [low, high]) in scales() {
            let ends = counts.first().zip(counts.last());
            let ends =
                ends.map_or_else(String::new, |((a, _), (b, _))| format!("{a} ({low}) to {b} ({high})"));
            *out += &format!("- {}: {} {}\n", escaped(&asked.name), escaped(&asked.text), escaped(&ends));
        }
        if scales().next().is_some() {
            *out += &format!("\n{}", grid.text());
            *out += &read("n counts people. The distribution counts the answers of each number.");
        }
        for asked in &self.survey {
            if let Figures::Texts(told) = &asked.figures {
                question(out, asked);
                texts(out, told);
            }
        }
    }
}

/// A paragraph that says how to read a table.
fn read(text: &str) -> String {
    paragraph(&format!("How to read it: {text}"))
}

fn question(out: &mut String, asked: &Asked) {
    *out += &format!("### Question {}\n\n{}\n\n", escaped(&asked.name), escaped(&asked.text));
}

fn figures(out: &mut String, part: &PartFigures, asked: &Asked) {
    let factors: Vec<&str> = part.factors.iter().map(|(name, _)| name.as_str()).collect();
    match &asked.figures {
        Figures::Numbers { range, labels, of_stimuli, cells, screening, .. } => {
            let [low, high] = labels;
            *out += &format!("From {} ({}) to {} ({}).\n\n", range[0], escaped(low), range[1], escaped(high));
            if let [rows, columns] = part.factors.as_slice() {
                for kind in distinct(cells.iter().map(|cell| cell.kind.as_str())) {
                    let across = format!("Medians of {kind}. Columns: {}.", columns.0);
                    *out += &paragraph(&escaped(&across));
                    let mut grid = Grid::new([&rows.0].into_iter().chain(&columns.1));
                    for (row, values) in rows.1.iter().zip(medians(cells, kind, rows, columns)) {
                        let values = values.into_iter().map(|median| or_none(median, short));
                        grid.row([row.clone()].into_iter().chain(values));
                    }
                    *out += &grid.text();
                }
            }
            numbers(out, &factors, if *of_stimuli { "stimulus" } else { "kind" }, cells);
            screening.iter().for_each(|screening| screened(out, screening));
        }
        Figures::Shares(shares) => self::shares(out, &factors, shares),
        Figures::Thresholds(of) => thresholds(out, of),
        Figures::Texts(told) => texts(out, told),
    }
}

/// Who was left out by the hidden reference.
fn screened(out: &mut String, screening: &Screening) {
    *out += &paragraph(&format!(
        "Screening (ITU-R BS.1534-3): the hidden reference is {}. Who rates it below 90 in more than 15 % of \
         the trials is left out of these figures.",
        escaped(&screening.reference)
    ));
    match screening.left_out.as_slice() {
        [] => *out += "Nobody is left out.\n\n",
        all => {
            let mut grid = Grid::new(["left out", "ratings below 90", "ratings"]);
            all.iter().for_each(|(who, low, of)| grid.row([who.clone(), low.to_string(), of.to_string()]));
            *out += &grid.text();
        }
    }
}

fn numbers(out: &mut String, factors: &[&str], kind: &str, cells: &[Cell]) {
    let columns =
        [kind, "n", "missing", "median", "95 %", "quartiles", "mean", "95 %", "sd", "skew Z", "skew p"];
    let interval = |ends: Option<[f64; 2]>, write: fn(f64) -> String| {
        or_none(ends, |[low, high]| format!("{} to {}", write(low), write(high)))
    };
    let mut grid = Grid::new(factors.iter().copied().chain(columns));
    for cell in cells {
        let s = cell.summary.as_ref();
        let row = [
            cell.kind.clone(),
            s.map_or(0, |s| s.n).to_string(),
            cell.missing.to_string(),
            or_none(s, |s| short(s.median)),
            interval(s.and_then(|s| s.median_95), short),
            or_none(s, quartiles),
            or_none(s, |s| format!("{:.2}", s.mean)),
            interval(s.and_then(|s| s.mean_95), |x| format!("{x:.2}")),
            or_none(s.and_then(|s| s.sd), |sd| format!("{sd:.2}")),
            or_none(cell.skewness, |[z, _]| format!("{z:.2}")),
            p_value(cell.skewness.map(|[_, p]| p)),
        ];
        grid.row(cell.levels.iter().cloned().chain(row));
    }
    *out += &grid.text();
    let tested = cells.iter().filter_map(|cell| cell.skewness).collect::<Vec<_>>();
    let skewed = tested.iter().filter(|[_, p]| *p < 0.05).count();
    let reasons = distinct(cells.iter().filter_map(|cell| cell.why.as_deref()));
    let mut told = format!("Skewness is significant at 0.05 in {skewed} of {} samples.", tested.len());
    if !reasons.is_empty() {
        let count = cells.len() - tested.len();
        told += &format!(" Not tested: {count}, since {}.", escaped(&reasons.join("; ")));
    }
    *out += &paragraph(&told);
    *out += &read(&format!("{READ_NUMBERS} {READ_SKEWNESS}"));
}

fn quartiles(s: &Summary) -> String {
    format!("{} to {}", short(s.quartiles[0]), short(s.quartiles[1]))
}

fn shares(out: &mut String, factors: &[&str], shares: &[Share]) {
    let mut grid = Grid::new(factors.iter().copied().chain(["kind", "answer", "k", "n", "share", "95 %"]));
    for s in shares {
        let row = [
            s.kind.clone(),
            s.of.clone(),
            s.count.to_string(),
            s.n.to_string(),
            or_none(s.share, |[share, ..]| format!("{share:.3}")),
            or_none(s.share, |[_, low, high]| format!("{low:.3} to {high:.3}")),
        ];
        grid.row(s.levels.iter().cloned().chain(row));
    }
    *out += &grid.text();
    let chances = distinct_numbers(shares.iter().filter_map(|share| share.chance));
    if !chances.is_empty() {
        *out += &format!("Chance is {}.\n\n", chances.join(" or "));
    }
    *out += &read(READ_SHARES);
}

fn distinct_numbers(numbers: impl Iterator<Item = f64>) -> Vec<String> {
    let all: Vec<String> = numbers.map(|x| digits(x, 3)).collect();
    distinct(all.iter().map(String::as_str)).into_iter().map(str::to_owned).collect()
}

fn tested(out: &mut String, test: &Tested) {
    let each = if test.each.is_empty() {
        String::new()
    } else {
        format!(" for each {}", escaped(&test.each.join(" and ")))
    };
    *out += &format!("#### {} test of {}{each}\n\n", test.test, escaped(&test.question));
    *out += &format!("Level of significance: {}.\n\n", test.alpha);
    match test.test {
        "Friedman" => {
            let head = ["n", "left out", "chi-square", "W", "p", "significant"];
            findings(out, test, &test.findings, head, |f| {
                [
                    f.n.to_string(),
                    f.left_out.to_string(),
                    or_none(f.statistic, |x| format!("{x:.2}")),
                    or_none(f.effect, |w| format!("{w:.3}")),
                    p_value(f.p),
                    yes(f),
                ]
            });
            *out += &read(READ_FRIEDMAN);
            let not_made = |f: &&Finding| f.why.as_deref() == Some(NOT_SIGNIFICANT);
            let made: Vec<Finding> = test.post_hoc.iter().filter(|f| !not_made(f)).cloned().collect();
            if made.is_empty() {
                *out += "No post-hoc pair was tested, since no Friedman test is significant.\n\n";
                return;
            }
            *out += "**Post-hoc pairs where Friedman's test is significant**\n\n";
            pairs(out, test, &made);
        }
        "Wilcoxon" => pairs(out, test, &test.findings),
        "Binomial" => {
            let head = ["stimulus", "k", "n", "people", "left out", "share", "p", "significant"];
            findings(out, test, &test.findings, head, |f| {
                [
                    f.of.clone(),
                    or_none(f.statistic, |k| k.to_string()),
                    f.n.to_string(),
                    f.people.to_string(),
                    f.left_out.to_string(),
                    or_none(f.effect, |x| format!("{x:.3}")),
                    p_value(f.p),
                    yes(f),
                ]
            });
            *out += &read(READ_BINOMIAL);
        }
        _ => {
            let head = ["comparisons", "people", "left out", "chi-square", "p", "significant"];
            findings(out, test, &test.findings, head, |f| {
                [
                    f.n.to_string(),
                    f.people.to_string(),
                    f.left_out.to_string(),
                    or_none(f.statistic, |x| format!("{x:.2}")),
                    p_value(f.p),
                    yes(f),
                ]
            });
            let columns = ["stimulus", "won", "comparisons", "ability", "95 %"];
            let mut grid = Grid::new(test.each.iter().map(String::as_str).chain(columns));
            for a in &test.abilities {
                let [ability, low, high] = a.ability.map(|x| format!("{x:.2}"));
                let (won, all) = (short(a.wins), short(a.comparisons));
                let row = [a.stimulus.clone(), won, all, ability, format!("{low} to {high}")];
                grid.row(a.levels.iter().cloned().chain(row));
            }
            *out += &grid.text();
            *out += &read(READ_ABILITY);
        }
    }
}

fn yes(finding: &Finding) -> String {
    if finding.p.is_none() { NONE.into() } else { if finding.is_significant { "yes" } else { "no" }.into() }
}

/// A table of findings, with their variants and the reasons for missing ones below.
fn findings<const N: usize>(
    out: &mut String,
    test: &Tested,
    all: &[Finding],
    head: [&str; N],
    row: impl Fn(&Finding) -> [String; N],
) {
    let mut grid = Grid::new(test.each.iter().map(String::as_str).chain(head));
    for finding in all {
        grid.row(finding.levels.iter().cloned().chain(row(finding)));
    }
    *out += &grid.text();
    let variants = distinct(all.iter().map(|f| f.variant.as_str()).filter(|v| !v.is_empty()));
    if !variants.is_empty() {
        *out += &format!("Variant: {}.\n\n", escaped(&variants.join("; ")));
    }
    for finding in all {
        if let Some(why) = &finding.why {
            let about = joined(finding.levels.iter().chain([&finding.of]).map(String::as_str));
            let about = if about.is_empty() { "All answers".to_owned() } else { about };
            *out += &format!("- {}: not tested, {}\n", escaped(&about), escaped(why));
        }
    }
    if all.iter().any(|f| f.why.is_some()) {
        *out += "\n";
    }
}

fn pairs(out: &mut String, test: &Tested, all: &[Finding]) {
    let head = ["pair", "n", "zeros", "left out", "rank sum", "p", "adjusted p", "CLES", "significant"];
    findings(out, test, all, head, |f| {
        [
            f.of.clone(),
            f.n.to_string(),
            f.zeros.to_string(),
            f.left_out.to_string(),
            or_none(f.statistic, short),
            p_value(f.p),
            p_value(f.adjusted),
            or_none(f.effect, |x| format!("{x:.3}")),
            yes(f),
        ]
    });
    let correction = test.correction.unwrap_or_default();
    let cut_off = test.cut_off.map_or_else(String::new, |c| format!(" Cut-off: {}.", p_value(Some(c))));
    *out += &format!("Tested pairs: {}. Correction: {correction}.{cut_off}\n\n", test.made);
    *out += &read(READ_WILCOXON);
}

fn thresholds(out: &mut String, of: &Thresholds) {
    let [stimulus, set] = of.varied.each_ref().map(|text| escaped(text));
    *out += &format!("{set} of {stimulus} varies. Method: {}.", of.method);
    *out += &of.target.map_or_else(String::new, |p| format!(" The threshold has {:.1} % hits.", 100.0 * p));
    *out += "\n\n";
    let mut over = Grid::new(["condition", "n", "missing", "median", "quartiles"]);
    for condition in &of.conditions {
        let s = condition.summary.as_ref();
        let n = s.map_or(0, |s| s.n);
        over.row([
            condition.name(),
            n.to_string(),
            (condition.people.len() - n).to_string(),
            or_none(s, |s| digits(s.median, 4)),
            or_none(s, |s| format!("{} to {}", digits(s.quartiles[0], 4), digits(s.quartiles[1], 4))),
        ]);
    }
    *out += &over.text();
    let every = || {
        of.conditions.iter().flat_map(|condition| {
            condition.pooled.iter().chain(&condition.people).map(|one| (condition.name(), one))
        })
    };
    let who =
        |one: &Threshold| if one.participant.is_empty() { "all".into() } else { one.participant.clone() };
    let constant = of.conditions.iter().any(|condition| condition.pooled.is_some());
    let head: &[&str] = if constant {
        &[
            "condition",
            "people",
            "n",
            "threshold",
            "95 %",
            "slope",
            "95 %",
            "PSE",
            "JND",
            "deviance",
            "df",
            "p",
        ]
    } else {
        &["condition", "participant", "n", "reversals", "threshold", "sd", "slope"]
    };
    let turns = of.method == "staircase";
    let is_left_out = |name: &str| match name {
        "reversals" => !turns,
        "slope" => turns,
        "PSE" | "JND" => of.has_right_answer,
        _ => false,
    };
    let head: Vec<&str> = head.iter().copied().filter(|name| !is_left_out(name)).collect();
    let mut grid = Grid::new(head);
    for (condition, one) in every() {
        let start = [condition, who(one), one.trials.len().to_string()];
        if !constant {
            let rest = [or_none(one.threshold, |x| digits(x, 4)), or_none(one.sd, |x| digits(x, 3))];
            let reversals = turns.then(|| one.reversals.len().to_string());
            let slope = one.posterior.map(|found| digits(found.slope.mean, 3));
            grid.row(
                start.into_iter().chain(reversals).chain(rest).chain((!turns).then(|| or_none(slope, |s| s))),
            );
            continue;
        }
        let interval = |i: asperity_psychometrics::Interval| {
            let end = |end: Option<f64>| end.map_or_else(|| "open".to_owned(), |x| digits(x, 4));
            format!("{} to {}", end(i.low), end(i.high))
        };
        let fit = one.fit.as_ref();
        let rest = [
            or_none(fit, |f| digits(f.function.threshold, 4)),
            or_none(fit, |f| interval(f.threshold)),
            or_none(fit, |f| digits(f.function.slope, 3)),
            or_none(fit, |f| interval(f.slope)),
        ];
        let equality =
            [or_none(fit, |f| digits(f.function.pse(), 4)), or_none(fit, |f| digits(f.function.jnd(), 3))];
        let deviance = [
            or_none(fit, |f| format!("{:.2}", f.deviance)),
            or_none(fit, |f| f.degrees.to_string()),
            p_value(fit.and_then(|f| f.p_value)),
        ];
        let equality = equality.into_iter().filter(|_| !of.has_right_answer);
        grid.row(start.into_iter().chain(rest).chain(equality).chain(deviance));
    }
    *out += &grid.text();
    for (condition, one) in every() {
        if let Some(why) = &one.why {
            let (condition, who, why) = (escaped(&condition), escaped(&who(one)), escaped(why));
            *out += &format!("- {condition}, {who}: no threshold, {why}\n");
        }
    }
    if every().any(|(_, one)| one.why.is_some()) {
        *out += "\n";
    }
    let read = match of.method {
        "staircase" => READ_STAIRCASE,
        "QUEST+" => READ_QUEST,
        _ => READ_FIT,
    };
    let equality = if constant && !of.has_right_answer { format!(" {READ_EQUALITY}") } else { String::new() };
    *out += &self::read(&format!("n counts trials. {read}{equality}"));
}

fn texts(out: &mut String, told: &[Told]) {
    if told.is_empty() {
        *out += "No answers.\n\n";
        return;
    }
    for told in told {
        let about =
            joined([told.participant.as_str()].into_iter().chain(told.about.iter().map(String::as_str)));
        *out += &format!("- **{}**: {}\n", escaped(&about), escaped(&told.text));
    }
    *out += "\n";
}
