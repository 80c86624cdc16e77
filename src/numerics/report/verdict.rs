//! The verdict of a run: made once and shown everywhere.
//!
//! Inputs: what held-out blocks say of the chosen table and of each identified model, and what each test session says of them.
//! Output: a [`RunVerdict`]: a verdict of the table, one of each identified arm, and which of the two a user is told to apply.
//! Tables, page, summary and exit code take verdict, reason and statement from it.
//! - Held-out blocks are of the sessions that were learnt from: whatever is peculiar to that day is in the model too.
//! - A test session has between-session variation. Its base is found from some of its stations, the others judge: the model by commands alone at
//!   all of them, and the table at those it answers for. One that is shown is enough, as a table answers for one orientation;
//!   where neither is, the session shows nothing.
//! - A session at random poses has too few stations of any one orientation for a table, and many for the identified arm: what is
//!   shown of one is not withheld because nothing is shown of the other.

mod judge;

use super::{Accuracy, BaseRefit, Model, Point, Split};
use crate::grid::{Covered, Verdict};
use judge::badness;
pub use judge::{Judge, Judging, Remark, word};

/// Where table and identified arm have one verdict, the table's is the run's, unless it answers for a smaller share of stations.
const ANSWERS: f64 = 0.95;

/// What targets may be corrected by, and what a verdict is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Applied {
    /// The chosen table: `compensation`.
    Table,
    /// The best model that was identified: `calibrations`.
    IdentifiedArm,
    /// Nothing, as neither helps: what is judged is the nominal arm on base and target as fitted.
    Nothing,
}

impl Applied {
    pub const fn words(self) -> &'static str {
        match self {
            Self::Table => "compensation table",
            Self::IdentifiedArm => "identified arm",
            Self::Nothing => "nominal arm on its fitted base, as no correction helps",
        }
    }
}

/// What judges a table or an identified arm, and the worst of what they say.
#[derive(Debug, Clone, PartialEq)]
pub struct ProductVerdict {
    pub judges: Vec<Judge>,
}

impl ProductVerdict {
    /// The worst of `judges`, in the order in which they are told: held-out blocks first.
    pub const fn of(judges: Vec<Judge>) -> Self {
        Self { judges }
    }

    /// The worst verdict: not met before not shown before met.
    pub fn verdict(&self) -> Verdict {
        match self.worst().map(|judge| &judge.verdict).next() {
            Some(Verdict::NotShown(_)) | None => Verdict::NotShown(self.why()),
            Some(worst) => worst.clone(),
        }
    }

    /// Why the tolerance is not met or not shown to be, with who says so; `None` where it is met.
    pub fn reason(&self) -> Option<String> {
        (self.verdict() != Verdict::Meets).then(|| self.why())
    }

    /// The figure of the judge that decides; `None` where it has none.
    pub fn figure(&self) -> Option<&Accuracy> {
        self.decides()?.figure.as_ref()
    }

    /// The judge that decides, of those whose verdict none is worse than: a test session before held-out blocks, as it is of another
    /// day, and of several the one with the largest bound.
    pub fn decides(&self) -> Option<&Judge> {
        let is_session = |judge: &Judge| matches!(judge.stations, Judging::Session(_));
        let bound = |judge: &Judge| judge.figure.as_ref().and_then(|figure| figure.bound);
        self.worst().max_by(|a, b| {
            let sessions = is_session(a).cmp(&is_session(b));
            sessions.then(bound(a).unwrap_or(0.0).total_cmp(&bound(b).unwrap_or(0.0)))
        })
    }

    /// The part of the measured stations and of the box that is answered for; `None` of an identified arm and of no table.
    pub fn covered(&self) -> Option<&Covered> {
        self.judges.iter().find_map(|judge| judge.covered.as_ref())
    }

    /// Whether it harms: a judge finds that it does not help, other than a session that may be of another arm.
    fn harms(&self) -> bool {
        let mut judges = self.judges.iter();
        judges.any(|judge| judge.harms && !judge.may_be_of_another_arm())
    }

    /// What the worst judges say, with who says it where several judge.
    fn why(&self) -> String {
        let named = |judge: &Judge| format!("{}: {}", judge.stations.words(), judge.reason());
        let said: Vec<String> = self.worst().map(named).collect();
        if said.is_empty() { "nothing judges".to_owned() } else { said.join("; ") }
    }

    fn worst(&self) -> impl Iterator<Item = &Judge> {
        let all = || self.judges.iter();
        let worst = all().map(|judge| badness(&judge.verdict)).max();
        all().filter(move |judge| Some(badness(&judge.verdict)) == worst)
    }
}

/// The verdicts of everything that a run publishes to correct targets by, and which of them is the verdict of the run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunVerdict {
    pub applied: Applied,
    /// The verdict of the published table; not shown where no step gives one.
    pub table: ProductVerdict,
    arm: ProductVerdict,
    /// The nominal arm with base and target fitted, which is what there is without a correction.
    nominal: ProductVerdict,
    models: Vec<(Model, ProductVerdict)>,
    /// What limits a result that does not meet the tolerance, and what would change it, in words; `None` of another.
    pub limit: Option<String>,
    /// Mean errors of the geometry at held-out blocks by a quarter, half and all of the other poses, mm; `None` where these are too few.
    pub means_by_poses_mm: Option<[f64; 3]>,
}

impl RunVerdict {
    /// Of the table, and of each identified model, of which `best` serves. The verdict of the run is of what a user can apply best:
    /// what does not harm, of that what is met, else what something is shown of; where both are alike, of the table if it answers for at
    /// least 95 % of the measured stations, and of the identified arm otherwise.
    pub fn of(table: ProductVerdict, models: Vec<(Model, ProductVerdict)>, best: Model) -> Self {
        let of = |model: Model| {
            let own = models.iter().find(|(own, _)| *own == model);
            own.map_or_else(|| ProductVerdict::of(Vec::new()), |(_, own)| own.clone())
        };
        let (arm, nominal) = (of(best), of(Model::BaseTarget));
        let applied = applied(&table, &arm);
        Self { applied, table, arm, nominal, models, limit: None, means_by_poses_mm: None }
    }

    pub const fn headline(&self) -> &ProductVerdict {
        match self.applied {
            Applied::Table => &self.table,
            Applied::IdentifiedArm => &self.arm,
            Applied::Nothing => &self.nominal,
        }
    }

    pub fn of_model(&self, model: Model) -> Option<&ProductVerdict> {
        Some(&self.models.iter().find(|(own, _)| *own == model)?.1)
    }

    /// Everything that judges what the verdict is of.
    pub fn judges(&self) -> &[Judge] {
        &self.headline().judges
    }

    pub fn verdict(&self) -> Verdict {
        self.headline().verdict()
    }

    /// Why the tolerance is not met or not shown to be, with who says so; `None` where it is met.
    pub fn reason(&self) -> Option<String> {
        self.headline().reason()
    }

    /// The verdict, what it is of and why, in a line: what every place shows.
    pub fn statement(&self) -> String {
        statement(self.applied, self.headline())
    }

    /// The same line of what the verdict of the run is not of.
    pub fn other_statement(&self) -> String {
        match self.applied {
            Applied::Table | Applied::Nothing => statement(Applied::IdentifiedArm, &self.arm),
            Applied::IdentifiedArm => statement(Applied::Table, &self.table),
        }
    }
}

fn statement(applied: Applied, of: &ProductVerdict) -> String {
    let word = match of.verdict() {
        Verdict::Meets => "met",
        Verdict::DoesNotMeet => "not met",
        Verdict::NotShown(_) => "not shown to be met",
    };
    format!("{word} by the {}: {}", applied.words(), of.why())
}

fn applied(table: &ProductVerdict, arm: &ProductVerdict) -> Applied {
    let says = |of: &ProductVerdict| match of.verdict() {
        Verdict::Meets => 0,
        Verdict::DoesNotMeet => 1,
        Verdict::NotShown(_) => 2,
    };
    let answers = |covered: &Covered| covered.of_stations() >= ANSWERS;
    let (of_table, of_arm) = (says(table), says(arm));
    let is_short = !table.covered().is_some_and(answers);
    match (table.harms(), arm.harms()) {
        (false, true) if of_table < 2 => Applied::Table,
        (_, true) => Applied::Nothing,
        (true, false) => Applied::IdentifiedArm,
        (false, false) if of_arm < of_table || (of_arm == of_table && is_short) => {
            Applied::IdentifiedArm
        }
        (false, false) => Applied::Table,
    }
}

/// The figure by which a session judges a model: at the angles that say most of a program, which are commanded ones where there are
/// any. Of a session that took no part the base is from some of its stations, which do not judge; `None` where it cannot be found.
pub fn figure_of<'a>(
    accuracy: &'a [Accuracy],
    model: Model,
    split: Split,
    session: &str,
) -> Option<&'a Accuracy> {
    let is_judged = |base_refit: BaseRefit| match split {
        Split::Session => base_refit.judges(),
        Split::None | Split::Blocks => base_refit == BaseRefit::None,
    };
    model.about().angles.iter().rev().find_map(|angles| {
        accuracy.iter().find(|own| {
            let subject = &own.subject;
            (subject.model, subject.angles, subject.split) == (model, *angles, split)
                && is_judged(subject.base_refit)
                && own.point == Point::Measured
                && subject.of_session == session
        })
    })
}

/// [`figure_of`] the best model that there is, by a session that took no part.
pub fn figure_of_model<'a>(accuracy: &'a [Accuracy], session: &str) -> Option<&'a Accuracy> {
    Model::serving().find_map(|model| figure_of(accuracy, model, Split::Session, session))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::Counted;
    use crate::grid::Tolerance;
    use crate::report::{Angles, Moment, Subject};

    const TOLERANCE: Tolerance = Tolerance { mm: 0.5, share: 0.95, confidence: 0.95 };

    /// A figure whose bound is that of as many poses; too few have none.
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
            finders: None,
            blocks: None,
            coverage: None,
            expanded_uncertainty_mm: 0.03,
            verdict: TOLERANCE.verdict(bound, Counted::once(poses), 0.03),
        }
    }

    fn wed(model: &Accuracy, table: &Accuracy) -> Judge {
        Judge::session("wed", Some(model), Some((table, None)), &TOLERANCE, None)
    }

    /// Held-out blocks of Monday that judge a table.
    fn mon(bound: f64) -> Judge {
        blocks(Model::Table, bound, 100)
    }

    /// Held-out blocks of Monday, of which a table answers for all stations.
    fn blocks(model: Model, bound: f64, poses: usize) -> Judge {
        let all = (model == Model::Table).then(|| covered(100));
        Judge::blocks("mon", &of(model, bound, poses), all.as_ref(), &TOLERANCE)
    }

    /// So many of 100 measured stations.
    const fn covered(stations: usize) -> Covered {
        Covered { stations, like: stations, measured: 100, of_box: 1.0 }
    }

    /// A run with these judges of its table, and one of the identified arm.
    fn run(table: Vec<Judge>, arm: Judge) -> RunVerdict {
        let models = vec![
            (Model::Geometric, ProductVerdict::of(Vec::new())),
            (Model::Full, ProductVerdict::of(vec![arm])),
        ];
        RunVerdict::of(ProductVerdict::of(table), models, Model::Full)
    }

    #[test]
    fn the_worst_judge_decides_and_is_named_with_its_figures() {
        let good = wed(&of(Model::Full, 0.3, 100), &of(Model::Table, 0.4, 60));
        let met = ProductVerdict::of(vec![mon(0.2), good]);
        assert_eq!((met.verdict(), met.reason()), (Verdict::Meets, None));
        // The test session decides, and of its two figures the table's.
        assert_eq!(met.figure().and_then(|figure| figure.bound), Some(0.4));
        let bad = wed(&of(Model::Full, 0.9, 100), &of(Model::Table, 0.4, 60));
        let not_met = ProductVerdict::of(vec![mon(0.2), bad]);
        assert_eq!(not_met.verdict(), Verdict::DoesNotMeet);
        assert_eq!(
            not_met.reason().as_deref(),
            Some(
                "test session wed: full error model from commands alone: bound 0.900 mm with U 0.030 mm is more than 0.5 mm \
                 (100 poses); compensation table where it answers: bound 0.400 mm with U 0.030 mm is within 0.5 mm (60 poses)"
            )
        );
        // The figure is that of the model, which decides.
        assert_eq!(not_met.figure().and_then(|figure| figure.bound), Some(0.9));
        let table = wed(&of(Model::Full, 0.3, 100), &of(Model::Table, 0.6, 60));
        assert_eq!(table.verdict, Verdict::DoesNotMeet);
        assert_eq!(table.figure.and_then(|figure| figure.bound), Some(0.6));
    }

    #[test]
    fn a_session_with_too_few_stations_shows_nothing_and_neither_does_the_run() {
        let few = wed(&of(Model::Full, 0.1, 40), &of(Model::Table, 0.1, 12));
        let verdict = ProductVerdict::of(vec![mon(0.2), few.clone()]).verdict();
        assert!(
            matches!(&verdict, Verdict::NotShown(reason) if reason.contains("wed: full error model") && reason.contains("40 poses")),
            "{verdict:?}"
        );
        // What is shown not to hold is worse.
        let both = ProductVerdict::of(vec![mon(0.6), few]);
        assert_eq!(both.verdict(), Verdict::DoesNotMeet);
        let reason = both.reason().expect("a reason");
        assert!(
            reason.starts_with("held-out blocks of mon: ") && reason.contains("0.600 mm"),
            "{reason}"
        );
        // A table answers for few stations of a session that the model is shown on: the session is shown.
        let shown = wed(&of(Model::Full, 0.3, 100), &of(Model::Table, 0.9, 12));
        assert_eq!(shown.verdict, Verdict::Meets);
        let no_base = Judge::session("wed", None, None, &TOLERANCE, None);
        assert!(
            matches!(no_base.verdict, Verdict::NotShown(reason) if reason.contains("span space"))
        );
    }

    #[test]
    fn the_verdict_is_of_what_can_be_applied_best() {
        let of_arm = |bound, poses| blocks(Model::Full, bound, poses);
        // Nine stations near the table's orientation, and 645 that judge the arm.
        let random = run(vec![blocks(Model::Table, 0.1, 9)], of_arm(0.116, 645));
        assert_eq!(random.applied, Applied::IdentifiedArm);
        assert_eq!((random.verdict(), random.reason()), (Verdict::Meets, None));
        assert_eq!(
            random.statement(),
            "met by the identified arm: held-out blocks of mon: full error model from commands alone: bound 0.116 mm with U 0.030 mm \
             is within 0.5 mm (645 poses)"
        );
        assert_eq!(
            random.other_statement(),
            "not shown to be met by the compensation table: held-out blocks of mon: 9 poses held out; 59 poses are needed for 95 % with \
             95 % confidence; it answers for 100 of 100 measured stations and 100.0 % of the box"
        );
        assert!(matches!(random.table.verdict(), Verdict::NotShown(_)));
        let applied = |table: f64, arm: f64| run(vec![mon(table)], of_arm(arm, 100)).applied;
        assert_eq!(applied(0.2, 0.1), Applied::Table);
        assert_eq!(applied(0.6, 0.1), Applied::IdentifiedArm);
        assert_eq!(applied(0.2, 0.6), Applied::Table);
        assert_eq!(applied(0.6, 0.7), Applied::Table);
        // Of two that do not help, the one of which something is shown.
        let shown = run(vec![blocks(Model::Table, 0.1, 9)], of_arm(0.9, 100));
        assert_eq!(shown.applied, Applied::IdentifiedArm);
        assert_eq!(shown.verdict(), Verdict::DoesNotMeet);
        let neither = run(vec![blocks(Model::Table, 0.1, 9)], of_arm(0.1, 9));
        assert_eq!(neither.applied, Applied::Table);
    }

    #[test]
    fn a_correction_that_harms_is_not_what_the_verdict_is_of() {
        // Mean error 0.218 mm before, 0.278 mm with the table, 0.048 mm by the arm.
        let table = |harms| mon(0.45).harmed(harms);
        let of_arm = |bound, harms| blocks(Model::Full, bound, 100).harmed(harms);
        assert_eq!(run(vec![table(false)], of_arm(0.126, false)).applied, Applied::Table);
        let arm = run(vec![table(true)], of_arm(0.126, false));
        assert_eq!((arm.applied, arm.verdict()), (Applied::IdentifiedArm, Verdict::Meets));
        assert!(arm.other_statement().ends_with("here the errors are no smaller with it"));
        // Its bound of 0.45 mm is within the tolerance of 0.5 mm, and it does not meet it.
        assert!(matches!(arm.table.verdict(), Verdict::NotShown(_)));
        // An arm that is not within the tolerance is still more than a table that harms.
        let far = run(vec![table(true)], of_arm(0.9, false));
        assert_eq!((far.applied, far.verdict()), (Applied::IdentifiedArm, Verdict::DoesNotMeet));
        assert_eq!(run(vec![table(false)], of_arm(0.9, true)).applied, Applied::Table);
        let models = vec![
            (Model::BaseTarget, ProductVerdict::of(vec![blocks(Model::BaseTarget, 0.4, 100)])),
            (Model::Full, ProductVerdict::of(vec![of_arm(0.42, true)])),
        ];
        let neither = RunVerdict::of(ProductVerdict::of(vec![table(true)]), models, Model::Full);
        assert_eq!((neither.applied, neither.verdict()), (Applied::Nothing, Verdict::Meets));
        // A session that may be of another arm is no judge of whether the correction helps.
        let mut stranger = wed(&of(Model::Full, 0.9, 100), &of(Model::Table, 0.9, 60)).harmed(true);
        stranger.remark = Some(Remark::OtherArm("hardly improved".to_owned()));
        // One whose reflector moved is of this arm.
        let mut moved = stranger.clone();
        moved.remark = Some(Remark::OtherTarget("put on again".to_owned()));
        let harmed = run(vec![mon(0.2), moved.clone()], moved);
        assert_eq!(harmed.applied, Applied::Nothing);
        let asked = run(vec![mon(0.2), stranger.clone()], stranger);
        assert_eq!((asked.applied, asked.verdict()), (Applied::Table, Verdict::DoesNotMeet));
    }

    #[test]
    fn a_table_that_answers_for_few_of_the_measured_stations_is_told_after_the_arm() {
        let table = |stations| {
            let figure = of(Model::Table, 0.2, 60);
            Judge::blocks("mon", &figure, Some(&covered(stations)), &TOLERANCE)
        };
        let of_arm = || blocks(Model::Full, 0.1, 100);
        assert_eq!(run(vec![table(95)], of_arm()).applied, Applied::Table);
        let few = run(vec![table(60)], of_arm());
        assert_eq!(few.applied, Applied::IdentifiedArm);
        assert_eq!(few.table.verdict(), Verdict::Meets);
        // Where no step gives a table, the arm is all there is.
        let no_table = Judge::blocks("mon", &of(Model::Table, 0.2, 0), None, &TOLERANCE);
        let none = run(vec![no_table], blocks(Model::Full, 0.1, 9));
        assert_eq!(none.applied, Applied::IdentifiedArm);
    }
}
