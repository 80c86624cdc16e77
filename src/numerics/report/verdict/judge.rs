//! One judge of a run: stations that took no part, and what they say of what is applied.

use crate::grid::{Covered, Tolerance, Verdict};
use crate::report::{Accuracy, Model};

#[derive(Debug, Clone, PartialEq)]
pub struct Judge {
    pub stations: Judging,
    /// What they say; a reason that is not shown is in `words` too.
    pub verdict: Verdict,
    pub words: String,
    /// What else has to be known of it, in words: a session that the model does not fit.
    pub remark: Option<Remark>,
    /// Whether the correction harms here: on average its errors are no smaller than without it.
    pub harms: bool,
    /// The figure that its verdict is read from; `None` where there is none.
    pub figure: Option<Accuracy>,
    /// The part of measured stations and box that what is judged answers for; `None` of an identified arm and of no table.
    pub covered: Option<Covered>,
}

/// What else has to be known of a test session, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Remark {
    /// The identified arm does not fit it, so it may be of another.
    OtherArm(String),
    /// Its target is not where the model knows it.
    OtherTarget(String),
}

impl Remark {
    pub fn words(&self) -> &str {
        match self {
            Self::OtherArm(words) | Self::OtherTarget(words) => words,
        }
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Judging {
    Blocks(String),
    Session(String),
}

impl Judging {
    pub fn words(&self) -> String {
        match self {
            Self::Blocks(session) => format!("held-out blocks of {session}"),
            Self::Session(session) => format!("test session {session}"),
        }
    }
}

impl Judge {
    /// Held-out blocks of `session`: the figure of a table with what it answers for, or that of an identified arm.
    pub fn blocks(
        session: &str,
        figure: &Accuracy,
        covered: Option<&Covered>,
        tolerance: &Tolerance,
    ) -> Self {
        let words = match &figure.verdict {
            Verdict::NotShown(reason) => with_covered(reason.clone(), covered),
            Verdict::Meets | Verdict::DoesNotMeet => figure_and_covered(figure, covered, tolerance),
        };
        Self {
            stations: Judging::Blocks(session.to_owned()),
            verdict: figure.verdict.clone(),
            words,
            remark: None,
            harms: false,
            figure: Some(figure.clone()),
            covered: covered.copied(),
        }
    }

    /// A test session: figures of the model and the table at its stations, where there are any, and what the table answers for.
    pub fn session(
        session: &str,
        model: Option<&Accuracy>,
        table: Option<(&Accuracy, Option<&Covered>)>,
        tolerance: &Tolerance,
        remark: Option<Remark>,
    ) -> Self {
        let of_both = || model.map(|model| (model, None)).into_iter().chain(table);
        let is_shown = |(own, _): &(&Accuracy, _)| !matches!(own.verdict, Verdict::NotShown(_));
        let worst = of_both().filter(is_shown).max_by_key(|(own, _)| badness(&own.verdict));
        let words: Vec<String> =
            of_both().map(|(own, covered)| figure_and_covered(own, covered, tolerance)).collect();
        let words = if words.is_empty() {
            "the stations that find its base do not span space, so there is none ([report] locate)"
                .to_owned()
        } else {
            words.join("; ")
        };
        let decides = worst.or_else(|| of_both().next()).map(|(own, _)| own);
        Self {
            stations: Judging::Session(session.to_owned()),
            verdict: worst
                .map_or_else(|| Verdict::NotShown(words.clone()), |(own, _)| own.verdict.clone()),
            words,
            remark,
            harms: false,
            figure: decides.cloned(),
            covered: table.and_then(|(_, covered)| covered.copied()),
        }
    }

    /// This judge of a correction that `harms`, which does not meet the tolerance, however small its errors are.
    #[must_use]
    pub fn harmed(mut self, harms: bool) -> Self {
        if harms {
            self.words += "; it does not help: here the errors are no smaller with it";
        }
        if harms && self.verdict == Verdict::Meets {
            self.verdict = Verdict::NotShown(self.words.clone());
        }
        Self { harms, ..self }
    }

    /// Whether its stations may be of another arm.
    pub const fn may_be_of_another_arm(&self) -> bool {
        matches!(self.remark, Some(Remark::OtherArm(_)))
    }

    /// Who judges, and what they say, in a line that a person reads.
    pub fn line(&self) -> String {
        format!("{}: {}: {}", self.stations.words(), word(&self.verdict), self.reason())
    }

    /// What the stations say, with what else has to be known of them.
    pub(super) fn reason(&self) -> String {
        match &self.remark {
            None => self.words.clone(),
            Some(remark) => format!("{}; {}", self.words, remark.words()),
        }
    }
}

/// How bad a verdict is: what is shown not to hold is worse than what is not shown.
pub(super) const fn badness(verdict: &Verdict) -> u8 {
    match verdict {
        Verdict::Meets => 0,
        Verdict::NotShown(_) => 1,
        Verdict::DoesNotMeet => 2,
    }
}

pub const fn word(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::Meets => "met",
        Verdict::DoesNotMeet => "not met",
        Verdict::NotShown(_) => "not shown",
    }
}

/// [`figure`] with what a table answers for.
fn figure_and_covered(of: &Accuracy, covered: Option<&Covered>, tolerance: &Tolerance) -> String {
    with_covered(figure(of, tolerance), covered)
}

fn with_covered(words: String, covered: Option<&Covered>) -> String {
    match covered {
        Some(covered) => format!("{words}; {}", covered.words()),
        None => words,
    }
}

/// What a figure is of, its bound against the tolerance, and what the bound counts.
fn figure(of: &Accuracy, tolerance: &Tolerance) -> String {
    let mut what = of.subject.model.name_at(of.subject.angles);
    if of.subject.model == Model::Table {
        what.push_str(" where it answers");
    }
    let guard_mm = of.expanded_uncertainty_mm;
    let found = of.finders.as_ref().map_or_else(String::new, |own| format!("; {}", own.words()));
    match (&of.verdict, of.bound) {
        (Verdict::NotShown(reason), _) => format!("{what} not shown: {reason}"),
        (verdict, Some(bound)) => format!(
            "{what}: bound {bound:.3} mm with U {guard_mm:.3} mm is {} {} mm ({}{found})",
            if *verdict == Verdict::Meets { "within" } else { "more than" },
            tolerance.mm,
            of.counted
        ),
        (verdict, None) => format!("{what} {}", word(verdict)),
    }
}
