//! The verdict of a run: the worst of all its judges, computed once and shown everywhere.
//!
//! Inputs: the judgement of held-out blocks on the chosen table, and that of each test session on the full error model and
//! on that table. Output: a [`RunVerdict`]. Tables, page, summary and exit code take verdict and reason from it.
//! - Held-out blocks belong to the training sessions: errors peculiar to a session are in the model too.
//! - A test session has between-session variation. Its base is found from its first stations, the others judge: the model
//!   from commands alone at all of them, and the table at those that it covers. One that is shown is enough, as a table
//!   covers one orientation; where neither is, the session shows nothing.

use super::{Accuracy, BaseRefit, Model, Point, Split};
use crate::grid::{Covered, Tolerance, Verdict};

/// The judges of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunVerdict {
    judges: Vec<Judge>,
}

/// One judge of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Judge {
    /// The stations that judge.
    pub stations: Judging,
    /// Their verdict; the reason of one that is not shown is in `words` too.
    pub verdict: Verdict,
    /// Figures or reason, as text.
    pub words: String,
    /// A further remark, as text: a session that the model does not fit. `None` without any.
    pub remark: Option<String>,
}

/// Stations that judge a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Judging {
    /// Held-out blocks of the session that the table is for, by name.
    Blocks(String),
    /// A test session, by name.
    Session(String),
}

impl Judging {
    /// The stations as text.
    pub fn words(&self) -> String {
        match self {
            Self::Blocks(session) => format!("held-out blocks of {session}"),
            Self::Session(session) => format!("test session {session}"),
        }
    }
}

impl Judge {
    /// Held-out blocks of `session`: the figures of its table, the choice of its step in words, and what the table answers for.
    pub fn blocks(
        session: &str,
        table: &Accuracy,
        choice: &str,
        covered: Option<&Covered>,
        tolerance: &Tolerance,
    ) -> Self {
        Self {
            stations: Judging::Blocks(session.to_owned()),
            words: match &table.verdict {
                Verdict::Meets => figure_and_covered(table, covered, tolerance),
                Verdict::DoesNotMeet => choice.to_owned(),
                Verdict::NotShown(reason) => with_covered(reason.clone(), covered),
            },
            verdict: table.verdict.clone(),
            remark: None,
        }
    }

    /// A test session: the figures of the model and of the table at its stations, where there are any, and what the table answers
    /// for.
    pub fn session(
        session: &str,
        model: Option<&Accuracy>,
        table: Option<(&Accuracy, Option<&Covered>)>,
        tolerance: &Tolerance,
        remark: Option<String>,
    ) -> Self {
        let of_both = || model.map(|model| (model, None)).into_iter().chain(table);
        let verdicts = of_both().map(|(own, _)| &own.verdict);
        let shown = verdicts.filter(|verdict| !matches!(verdict, Verdict::NotShown(_)));
        let words: Vec<String> = of_both()
            .map(|(own, covered)| figure_and_covered(own, covered, tolerance))
            .collect();
        let words = if words.is_empty() {
            "its first stations do not span space, so its base cannot be found ([report] refit_first_stations)"
                .to_owned()
        } else {
            words.join("; ")
        };
        Self {
            stations: Judging::Session(session.to_owned()),
            verdict: shown
                .max_by_key(|verdict| badness(verdict))
                .cloned()
                .unwrap_or_else(|| Verdict::NotShown(words.clone())),
            words,
            remark,
        }
    }

    /// The judge and its verdict, in one line for a person.
    pub fn line(&self) -> String {
        format!(
            "{}: {}: {}",
            self.stations.words(),
            word(&self.verdict),
            self.reason()
        )
    }

    fn reason(&self) -> String {
        match &self.remark {
            None => self.words.clone(),
            Some(remark) => format!("{}; {remark}", self.words),
        }
    }
}

impl RunVerdict {
    /// The verdict of `judges`, in the order in which they are shown: held-out blocks first.
    pub const fn of(judges: Vec<Judge>) -> Self {
        Self { judges }
    }

    /// All judges.
    pub fn judges(&self) -> &[Judge] {
        &self.judges
    }

    /// The worst verdict: not met before not shown before met.
    pub fn verdict(&self) -> Verdict {
        let worst = self.worst().map(|judge| &judge.verdict).next();
        match (worst, self.reason()) {
            (Some(Verdict::NotShown(_)), Some(reason)) => Verdict::NotShown(reason),
            (Some(worst), _) => worst.clone(),
            (None, _) => Verdict::NotShown("nothing judges".to_owned()),
        }
    }

    /// Why the tolerance is not met or not shown to be, with the judges that decide; `None` where it is met.
    pub fn reason(&self) -> Option<String> {
        let named = |judge: &Judge| match &self.judges[..] {
            [_] => judge.reason(),
            _ => format!("{}: {}", judge.stations.words(), judge.reason()),
        };
        let bad = self.worst().filter(|judge| judge.verdict != Verdict::Meets);
        let reasons: Vec<String> = bad.map(named).collect();
        (!reasons.is_empty()).then(|| reasons.join("; "))
    }

    /// The judges that decide that the tolerance is not met or not shown to be, where there are several, otherwise the
    /// reason; `None` where it is met.
    pub fn decided_by(&self) -> Option<String> {
        let reason = self.reason()?;
        let names: Vec<String> = self.worst().map(|judge| judge.stations.words()).collect();
        Some(match self.judges.len() {
            1 => reason,
            _ => names.join(", "),
        })
    }

    /// The judges with the worst verdict.
    fn worst(&self) -> impl Iterator<Item = &Judge> {
        let all = || self.judges.iter();
        let worst = all().map(|judge| badness(&judge.verdict)).max();
        all().filter(move |judge| Some(badness(&judge.verdict)) == worst)
    }
}

/// The figures of the model on a session that took no part, its base from its first stations: from commands alone, which is
/// all that a program has, where they are known. `None` where its base cannot be found.
pub fn figure_of_model<'a>(accuracy: &'a [Accuracy], session: &str) -> Option<&'a Accuracy> {
    Model::judging().find_map(|(model, angles)| {
        accuracy.iter().find(|own| {
            let subject = &own.subject;
            (subject.model, subject.angles, subject.split) == (model, angles, Split::Session)
                && (subject.base_refit, own.point) == (BaseRefit::First, Point::Measured)
                && subject.of_session == session
        })
    })
}

/// The rank of a verdict: one that is shown not to hold is worse than one that is not shown.
const fn badness(verdict: &Verdict) -> u8 {
    match verdict {
        Verdict::Meets => 0,
        Verdict::NotShown(_) => 1,
        Verdict::DoesNotMeet => 2,
    }
}

/// A verdict in two words.
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

/// A text with the coverage of a table.
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
    match (&of.verdict, of.bound) {
        (Verdict::NotShown(reason), _) => format!("{what} not shown: {reason}"),
        (verdict, Some(bound)) => format!(
            "{what}: bound {bound:.3} mm with U {guard_mm:.3} mm is {} {} mm ({})",
            if *verdict == Verdict::Meets {
                "within"
            } else {
                "more than"
            },
            tolerance.mm,
            of.counted
        ),
        (verdict, None) => format!("{what} {}", word(verdict)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::Counted;
    use crate::report::{Angles, Moment, Subject};

    const TOLERANCE: Tolerance = Tolerance {
        mm: 0.5,
        share: 0.95,
        confidence: 0.95,
    };

    /// A figure whose bound counts `poses` poses; too few have none.
    fn of(model: Model, bound: f64, poses: usize) -> Accuracy {
        let bound = (poses >= 59).then_some(bound);
        Accuracy {
            subject: Subject {
                split: Split::Session,
                of_session: "wed".to_owned(),
                model,
                angles: Angles::Commanded,
                base_refit: BaseRefit::First,
            },
            point: Point::Measured,
            moment: Moment::After,
            driven_by: None,
            figures: None,
            bound,
            counted: Counted::once(poses),
            blocks: None,
            coverage: None,
            expanded_uncertainty_mm: 0.03,
            verdict: TOLERANCE.verdict(bound, Counted::once(poses), 0.03),
        }
    }

    fn wed(model: &Accuracy, table: &Accuracy) -> Judge {
        Judge::session("wed", Some(model), Some((table, None)), &TOLERANCE, None)
    }

    fn mon(bound: f64) -> Judge {
        Judge::blocks(
            "mon",
            &of(Model::Table, bound, 100),
            "no step holds",
            None,
            &TOLERANCE,
        )
    }

    #[test]
    fn the_worst_judge_decides_and_is_named_with_its_figures() {
        let good = wed(&of(Model::Full, 0.3, 100), &of(Model::Table, 0.4, 60));
        let met = RunVerdict::of(vec![mon(0.2), good]);
        assert_eq!((met.verdict(), met.reason()), (Verdict::Meets, None));
        let bad = wed(&of(Model::Full, 0.9, 100), &of(Model::Table, 0.4, 60));
        let not_met = RunVerdict::of(vec![mon(0.2), bad]);
        assert_eq!(not_met.verdict(), Verdict::DoesNotMeet);
        assert_eq!(
            not_met.reason().as_deref(),
            Some(
                "test session wed: full error model from commands alone: bound 0.900 mm with U 0.030 mm is more than 0.5 mm \
                 (100 poses); compensation table where it answers: bound 0.400 mm with U 0.030 mm is within 0.5 mm (60 poses)"
            )
        );
        let table = wed(&of(Model::Full, 0.3, 100), &of(Model::Table, 0.6, 60));
        assert_eq!(table.verdict, Verdict::DoesNotMeet);
    }

    #[test]
    fn a_session_with_too_few_stations_shows_nothing_and_neither_does_the_run() {
        let few = wed(&of(Model::Full, 0.1, 40), &of(Model::Table, 0.1, 12));
        let verdict = RunVerdict::of(vec![mon(0.2), few.clone()]).verdict();
        assert!(
            matches!(&verdict, Verdict::NotShown(reason) if reason.contains("wed: full error model") && reason.contains("40 poses")),
            "{verdict:?}"
        );
        // A verdict that is shown not to hold is worse.
        let both = RunVerdict::of(vec![mon(0.6), few]);
        assert_eq!(both.verdict(), Verdict::DoesNotMeet);
        assert_eq!(
            both.reason().as_deref(),
            Some("held-out blocks of mon: no step holds")
        );
        // A table covers few stations of a session on which the model is shown: the session is shown.
        let shown = wed(&of(Model::Full, 0.3, 100), &of(Model::Table, 0.9, 12));
        assert_eq!(shown.verdict, Verdict::Meets);
        let no_base = Judge::session("wed", None, None, &TOLERANCE, None);
        assert!(
            matches!(no_base.verdict, Verdict::NotShown(reason) if reason.contains("span space"))
        );
    }

    #[test]
    fn a_run_without_a_test_session_is_judged_by_its_blocks() {
        let alone = RunVerdict::of(vec![mon(0.6)]);
        assert_eq!(alone.reason().as_deref(), Some("no step holds"));
        assert_eq!(RunVerdict::of(vec![mon(0.2)]).verdict(), Verdict::Meets);
    }
}
