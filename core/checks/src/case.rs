//! A case, and its result.

use crate::subject::Subject;

/// Why a case does not hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stop {
    /// It failed, for this reason.
    Failed(String),
    /// It says nothing here, for this reason.
    NotApplicable(String),
}

impl Stop {
    /// Puts a subject before the reason of a failure.
    #[must_use]
    pub fn after(self, about: &str) -> Self {
        match self {
            Self::Failed(why) => Self::Failed(format!("{about}: {why}")),
            other => other,
        }
    }
}

impl From<String> for Stop {
    fn from(wrong: String) -> Self {
        Self::Failed(wrong)
    }
}

impl From<asperity_diagnostics::Diagnostic> for Stop {
    fn from(wrong: asperity_diagnostics::Diagnostic) -> Self {
        Self::Failed(wrong.to_string())
    }
}

/// Figures of a case that holds, or why it does not.
pub type Found = Result<String, Stop>;

/// Ends a case that says nothing here.
///
/// # Errors
/// Always, with the reason.
pub fn not_applicable<T>(why: impl Into<String>) -> Result<T, Stop> {
    Err(Stop::NotApplicable(why.into()))
}

/// Results of those items to which a case applies. `none` is the reason where there is no item at all.
pub(crate) fn applicable<T>(
    all: impl IntoIterator<Item = Result<T, Stop>>,
    none: &str,
) -> Result<Vec<T>, Stop> {
    let (mut found, mut why_not) = (Vec::new(), None);
    for one in all {
        match one {
            Ok(one) => found.push(one),
            Err(Stop::NotApplicable(why)) => {
                why_not.get_or_insert(why);
            }
            Err(wrong) => return Err(wrong),
        }
    }
    if found.is_empty() { not_applicable(why_not.unwrap_or_else(|| none.to_owned())) } else { Ok(found) }
}

/// Fails a case, with a formatted reason.
#[macro_export]
macro_rules! bail {
    ($($why:tt)+) => {
        return Err($crate::Stop::Failed(format!($($why)+)))
    };
}

/// Fails a case where a condition does not hold, with a formatted reason.
#[macro_export]
macro_rules! ensure {
    ($holds:expr, $($why:tt)+) => {
        let holds: bool = $holds;
        if !holds {
            $crate::bail!($($why)+);
        }
    };
}

/// Largest values of the figures of a case.
#[derive(Debug, Default)]
pub(crate) struct Figures {
    /// Where the figures are from now on, if that is to be told.
    pub about: String,
    all: Vec<(&'static str, f64, String)>,
}

impl Figures {
    /// Notes a figure. `what` stands behind it in texts.
    pub(crate) fn note(&mut self, value: f64, what: &'static str) {
        match self.all.iter_mut().find(|it| it.0 == what) {
            Some(it) if it.1 >= value => {}
            Some(it) => (it.1, it.2) = (value, self.about.clone()),
            None => self.all.push((what, value, self.about.clone())),
        }
    }

    /// Notes a figure, which must be at most `bound`.
    pub(crate) fn at_most(&mut self, value: f64, bound: f64, what: &'static str) -> Result<(), Stop> {
        self.note(value, what);
        ensure!(value <= bound, "{} {what}; the bound is {}", short(value), short(bound));
        Ok(())
    }
}

impl std::fmt::Display for Figures {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (i, (what, value, about)) in self.all.iter().enumerate() {
            let about = if about.is_empty() { String::new() } else { format!(" ({about})") };
            write!(f, "{}{} {what}{about}", if i == 0 { "at most " } else { ", " }, short(*value))?;
        }
        Ok(())
    }
}

/// A number with about four digits.
fn short(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        0.01..1e5 => format!("{x:.3}"),
        _ => format!("{x:.2e}"),
    }
}

/// A difficulty, and the bounds that must hold in it.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// The group of cases to which it belongs: lower case, words joined by `_`.
    pub family: &'static str,
    /// Unique name: lower case, words joined by `_`.
    pub name: &'static str,
    /// The difficulty.
    pub hard: &'static str,
    /// The requirement, with its bounds.
    pub must: &'static str,
    /// Whether it looks at the subject's graph; else it looks at kinds of nodes only.
    pub of_graph: bool,
    run: fn(&Subject<'_>) -> Found,
}

/// Makes the cases of one family.
#[derive(Clone, Copy)]
pub(crate) struct Family(pub &'static str);

impl Family {
    /// A case over kinds of nodes.
    pub(crate) const fn kinds(
        self,
        name: &'static str,
        run: fn(&Subject<'_>) -> Found,
        hard: &'static str,
        must: &'static str,
    ) -> Case {
        Case { family: self.0, name, hard, must, of_graph: false, run }
    }

    /// A case over the subject's graph.
    pub(crate) const fn graph(
        self,
        name: &'static str,
        run: fn(&Subject<'_>) -> Found,
        hard: &'static str,
        must: &'static str,
    ) -> Case {
        Case { of_graph: true, ..self.kinds(name, run, hard, must) }
    }
}

impl Case {
    /// Runs the case.
    ///
    /// # Errors
    /// It does not hold, or says nothing here.
    pub fn run(&self, subject: &Subject<'_>) -> Found {
        (self.run)(subject)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_tell_the_largest_and_where_it_is() {
        let mut figures = Figures::default();
        figures.at_most(0.5, 1.0, "N").unwrap();
        figures.about = "there".into();
        let wrong = figures.at_most(2e-7, 1e-7, "mm").unwrap_err();
        assert_eq!(wrong, Stop::Failed("2.00e-7 mm; the bound is 1.00e-7".into()));
        figures.at_most(0.25, 1.0, "N").unwrap();
        assert_eq!(figures.to_string(), "at most 0.500 N, 2.00e-7 mm (there)");
        assert!(figures.at_most(f64::NAN, 1.0, "N").is_err());
    }

    #[test]
    fn items_without_the_case_leave_it_to_the_others() {
        let no = |why: &str| not_applicable::<i32>(why);
        assert_eq!(applicable([no("a"), Ok(1), no("b"), Ok(2)], "c"), Ok(vec![1, 2]));
        assert_eq!(applicable([no("a"), no("b")], "c"), Err(Stop::NotApplicable("a".into())));
        assert_eq!(applicable([], "c"), no("c").map(|_| vec![0]));
        let wrong = Stop::Failed("it falls".into());
        assert_eq!(applicable([Ok(1), no("a"), Err(wrong.clone()), Ok(2)], "c"), Err(wrong));
    }
}
