//! What a case is, and what becomes of it.

use std::fmt;

use crate::subject::Subject;

/// What cases have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[allow(missing_docs)]
pub enum Family {
    StiffWalls,
    Motion,
    Networks,
    Autoregressive,
    Phase,
    Actuator,
    Friction,
    FiltersAndRates,
    Graphs,
}

impl Family {
    /// Its name: lower case, words joined by `_`.
    pub fn name(self) -> &'static str {
        match self {
            Self::StiffWalls => "stiff_walls",
            Self::Motion => "motion",
            Self::Networks => "networks",
            Self::Autoregressive => "autoregressive",
            Self::Phase => "phase",
            Self::Actuator => "actuator",
            Self::Friction => "friction",
            Self::FiltersAndRates => "filters_and_rates",
            Self::Graphs => "graphs",
        }
    }

    /// A case of this family, with what is hard and what must hold.
    pub(crate) const fn case(
        self,
        name: &'static str,
        of_graph: bool,
        run: fn(&Subject<'_>) -> Found,
        [hard, must]: [&'static str; 2],
    ) -> Case {
        Case { family: self, name, hard, must, of_graph, run }
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What became of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// What must hold holds.
    Holds,
    /// It does not.
    Fails,
    /// There is nothing here that the case is about.
    NotApplicable,
}

/// A verdict and what was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// The verdict.
    pub verdict: Verdict,
    /// What was found, with figures.
    pub found: String,
}

/// Why a case does not hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Not {
    /// What went wrong.
    Held(String),
    /// Why the case says nothing here.
    Applicable(String),
}

impl Not {
    /// The same, with what it is about before it.
    #[must_use]
    pub fn after(self, about: &str) -> Self {
        match self {
            Self::Held(why) => Self::Held(format!("{about}: {why}")),
            Self::Applicable(why) => Self::Applicable(why),
        }
    }
}

impl From<String> for Not {
    fn from(wrong: String) -> Self {
        Self::Held(wrong)
    }
}

impl From<asperity_diagnostics::Diagnostic> for Not {
    fn from(wrong: asperity_diagnostics::Diagnostic) -> Self {
        Self::Held(wrong.to_string())
    }
}

/// What was found where all is well.
pub type Found = Result<String, Not>;

/// There is nothing here that a case is about.
///
/// # Errors
/// Always, with the reason.
pub fn not_applicable<T>(why: impl Into<String>) -> Result<T, Not> {
    Err(Not::Applicable(why.into()))
}

/// What came of those to which a case applies; `none` says what there would have to be.
///
/// # Errors
/// The first that does not hold; where it applies to none, why not to the first, or that there is `none`.
pub(crate) fn applicable<T>(
    all: impl IntoIterator<Item = Result<T, Not>>,
    none: &str,
) -> Result<Vec<T>, Not> {
    let (mut found, mut why_not) = (Vec::new(), None);
    for one in all {
        match one {
            Ok(one) => found.push(one),
            Err(Not::Applicable(why)) => {
                why_not.get_or_insert(why);
            }
            Err(wrong) => return Err(wrong),
        }
    }
    if found.is_empty() { not_applicable(why_not.unwrap_or_else(|| none.to_owned())) } else { Ok(found) }
}

/// Goes on where something holds.
///
/// # Errors
/// What to say where it does not.
pub fn holds(it: bool, else_say: impl FnOnce() -> String) -> Result<(), Not> {
    if it { Ok(()) } else { Err(Not::Held(else_say())) }
}

/// Something hard, and what must hold in it.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Its family.
    pub family: Family,
    /// Its name: lower case, words joined by `_`; no other case has it.
    pub name: &'static str,
    /// What is hard, in a sentence.
    pub hard: &'static str,
    /// What must hold, with its bound, in a sentence.
    pub must: &'static str,
    /// Whether it looks at the subject's graph; else only at kinds of nodes.
    pub of_graph: bool,
    pub(crate) run: fn(&Subject<'_>) -> Found,
}

impl Case {
    /// Finds out whether it holds.
    pub fn run(&self, subject: &Subject<'_>) -> Outcome {
        let (verdict, found) = match (self.run)(subject) {
            Ok(found) => (Verdict::Holds, found),
            Err(Not::Held(found)) => (Verdict::Fails, found),
            Err(Not::Applicable(found)) => (Verdict::NotApplicable, found),
        };
        Outcome { verdict, found }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_to_which_a_case_does_not_apply_leaves_the_others_to_it() {
        let no = |why: &str| not_applicable::<i32>(why);
        assert_eq!(applicable([no("a"), Ok(1), no("b"), Ok(2)], "c"), Ok(vec![1, 2]));
        assert_eq!(applicable([no("a"), no("b")], "c"), Err(Not::Applicable("a".into())));
        assert_eq!(applicable([], "c"), no("c").map(|_| vec![0]));
        let wrong = Not::Held("it falls".into());
        assert_eq!(applicable([Ok(1), no("a"), Err(wrong.clone()), Ok(2)], "c"), Err(wrong));
    }
}
