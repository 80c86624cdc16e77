//! A session that a table drove: the file of corrected targets, and the comparison with the table's promise.
//!
//! The corrected targets are in the session's folder (`[input] corrected_targets`), as `posegrid compensate` wrote them.
//! The table's promise, and its tool and temperatures, are in the lake under its run.

use std::path::Path;

use super::configuration::SessionFiles;
use super::run::RunError;
use crate::compensation::validity::Outside;
use crate::compensation::{Conditions, UsedWith, Validity};
use crate::figures::extremes;
use crate::files::input::Bound;
use crate::files::table::Table;
use crate::history::estimate::Estimate;
use crate::history::table_state::{NotShown, Shown};
use crate::history::{Judged, between};
use crate::io::common::of_every_row;
use crate::io::lake::{Lake, LakeError};
use crate::io::log::Limits;
use crate::io::rows::Row as _;
use crate::io::tables::accuracy::{AccuracyRow, FigureName};
use crate::io::tables::calibrations::CalibrationRow;
use crate::io::tables::compensation::NodeRow;
use crate::io::tables::validity::ValidFor;
use crate::io::targets::driving;
use crate::join::Station;
use crate::judgement::{Driven, DrivenBy, JoinedSession, Outcome};
use crate::kinematics::Arm;
use crate::manifest::RunKey;
use crate::report::driven::{matched, promise_words};
use crate::report::promise::Promise;
use crate::report::{Angles, Model, Moment, Point, Split};

/// A command further than this from the one in the file is not the file's, mm: controllers round to one to ten micrometres.
const NOT_THE_FILES_MM: f64 = 0.05;

/// The corrected targets that drove a session; `None` where its folder has none.
pub(super) fn driven_by(
    files: &SessionFiles,
    stations: &[Station],
    limits: Limits,
) -> Result<Option<DrivenBy>, RunError> {
    let Some(path) = &files.corrected else { return Ok(None) };
    let file = driving::read(path, Bound::of(limits)).map_err(|source| RunError::Driving {
        session: files.name.clone(),
        source: Box::new(source),
    })?;
    let command = |own: &Station| own.command.as_ref().map(|command| command.position);
    let commands: Vec<_> = stations.iter().map(command).collect();
    let matched = matched(&commands, &file.targets);
    Ok(Some(DrivenBy { file, matched }))
}

/// The findings of the last session about the table that drove it.
#[derive(Debug, Clone, Default)]
pub(super) struct DrivenWords {
    /// Whether the table still holds; `None` where none drove the session.
    pub(super) state: Option<String>,
    /// The state and all other findings, as lines for a person.
    pub(super) lines: Vec<String>,
}

/// The findings of the last session about the table that drove it.
pub(super) fn words(
    outcome: &Outcome<'_>,
    arm: &Arm,
    stated: &Conditions,
    lake: &Lake,
) -> Result<DrivenWords, LakeError> {
    let Some((driven, session)) = outcome.driven.as_ref().zip(outcome.training.last()) else {
        return Ok(DrivenWords::default());
    };
    let made = TableRun::read(driven, lake)?;
    let shown = Shown {
        application: &driven.application,
        promise: made.as_ref().map_err(Clone::clone).and_then(|made| made.promised()),
        after: driven.measured.as_ref().map(|measured| &measured.after),
        outside: made.as_ref().map_or_else(|_| Vec::new(), |made| made.outside(session, stated)),
    };
    let state = shown.state(|| match &made {
        Ok(made) => made.compared(outcome, arm),
        Err(why) => Err(why.to_string()),
    });
    let words = [
        Some(state.to_string()),
        Some(went(driven, session)),
        Some(driven.application.words()),
        shown.kept().ok().and_then(|kept| promise_words(&kept)),
    ];
    let RunKey { session, run, .. } = &driven.key;
    let line = |line| format!("driven by table {run} of session {session}: {line}");
    let lines = words.into_iter().flatten().map(line).collect();
    Ok(DrivenWords { lines, state: Some(state.to_string()) })
}

/// The number of stations at each kind of place, as text.
fn went(driven: &Driven, session: &JoinedSession) -> String {
    let Some(by) = &session.driven_by else { return "no targets".to_owned() };
    // From target plus stated correction.
    let departures_mm =
        driven.stations.iter().map(|own| (own.command - own.target - own.stated).norm());
    let departed = departures_mm.filter(|mm| *mm > NOT_THE_FILES_MM).count();
    let mut words = vec![format!(
        "{} of {} stations measured at one of its {} targets",
        driven.stations.len(),
        session.joined.stations.len(),
        by.file.targets.len()
    )];
    let others = [
        (by.matched.far, "far from every target: in another frame, or of another program"),
        (by.matched.between, "between two targets"),
        (departed, "commanded otherwise than the file states"),
        (by.file.refused, "targets had been refused"),
    ];
    let others = others.into_iter().filter(|(count, _)| *count > 0);
    words.extend(others.map(|(count, what)| format!("{count} {what}")));
    words.join("; ")
}

/// The lake's tables of the run that made a table.
pub(super) struct TableRun {
    valid_for: Validity,
    calibrations: Table,
    promise: Option<Promise>,
}

impl TableRun {
    /// Reads them; an error states that they are missing, or of another version.
    pub(super) fn read(driven: &Driven, lake: &Lake) -> Result<Result<Self, NotShown>, LakeError> {
        // For a run that another replaced, only the row may have been kept.
        for table in ["runs", driven.table.as_str(), "calibrations", "accuracy"] {
            if !lake.has(table, &driven.key)? {
                return Ok(Err(NotShown::NoRun));
            }
        }
        match Self::of_tables(driven, lake) {
            Err(
                wrong @ (LakeError::File(_)
                | LakeError::NotAsWritten { .. }
                | LakeError::NotOfRun { .. }),
            ) => Ok(Err(NotShown::Unreadable(wrong.to_string()))),
            read => read,
        }
    }

    fn of_tables(driven: &Driven, lake: &Lake) -> Result<Result<Self, NotShown>, LakeError> {
        let calibrations = lake.read("calibrations", &driven.key)?;
        let accuracy = AccuracyRow::read(&lake.read("accuracy", &driven.key)?);
        let path = Path::new(&driven.key.run);
        let (valid_for, model) = if driven.table == "compensation" {
            let table = lake.read("compensation", &driven.key)?;
            let nodes = NodeRow::read(&table);
            let rows = nodes.iter().map(|row| &row.of_table.valid_for);
            (of_every_row(path, &table, rows).map(ValidFor::validity), Model::Table)
        } else {
            let models = CalibrationRow::read(&calibrations);
            let rows = models.iter().map(|row| &row.of_arm.valid_for);
            (of_every_row(path, &calibrations, rows).map(ValidFor::validity), Model::Full)
        };
        let promise = promise(model, &accuracy);
        let of = |valid_for| Self { valid_for, calibrations, promise };
        Ok(valid_for.map(of).map_err(|wrong| NotShown::Unreadable(wrong.to_string())))
    }

    pub(super) fn promised(&self) -> Result<&Promise, NotShown> {
        self.promise.as_ref().ok_or(NotShown::NoPromise)
    }

    /// The arm as the session identified it, compared with the arm of the table's run.
    pub(super) fn compared(&self, outcome: &Outcome<'_>, arm: &Arm) -> Result<Judged, String> {
        let model = self.calibrations.text("arm_model").value(0);
        if model != arm.model() {
            let own = arm.model();
            return Err(format!("the table's arm is {model:?}, this one {own:?}"));
        }
        if outcome.training.len() > 1 {
            return Err("the arm was identified from several sessions".to_owned());
        }
        let full = outcome.full.as_ref();
        let full = full.ok_or("there is no full error model of the session")?;
        let ranges = ranges(outcome, arm);
        let own = Estimate::of_full(full, &ranges);
        let own = own.ok_or("the covariance of the full error model is none")?;
        match super::history::session::estimate(&self.calibrations)? {
            (Model::Full, earlier) => Ok(between(&earlier, &own)),
            _ => Err("the table's run has no full error model".to_owned()),
        }
    }

    /// The conditions of the session that the table is not valid for, by the rules of `compensate`; at the lowest and the
    /// highest measured temperature.
    pub(super) fn outside(&self, session: &JoinedSession, stated: &Conditions) -> Vec<Outside> {
        let stations = session.joined.stations.iter();
        let met = stations.filter_map(|station| station.one_reading()?.temperature_c);
        let (low, high) = extremes(met).unzip();
        let outside = |temperature_c| {
            let used = UsedWith { conditions: stated.clone(), temperature_c };
            self.valid_for.hold(&used).outside
        };
        let mut outside: Vec<Outside> = [low, high].into_iter().flat_map(outside).collect();
        outside.sort_by(|a, b| a.words.cmp(&b.words));
        outside.dedup();
        outside
    }
}

/// Lowest and highest axis variable of each joint over the stations that a run learnt from, rad or mm; none without a station.
fn ranges(outcome: &Outcome<'_>, arm: &Arm) -> Vec<[f64; 2]> {
    let stations = outcome.training.iter().flat_map(|session| &session.joined.stations);
    let measured = stations.filter(|station| !station.measured().is_empty());
    let axes: Vec<Vec<f64>> = measured.map(|own| arm.axes(&own.joints)).collect();
    let joints = axes.first().map_or(0, Vec::len);
    let range = |joint: usize| {
        let ends = extremes(axes.iter().map(|own| own[joint]))?;
        Some([ends.0, ends.1])
    };
    (0..joints).filter_map(range).collect()
}

/// The accuracy that a run predicted for commands corrected by this model, from stations that took no part.
fn promise(model: Model, figures: &[AccuracyRow]) -> Option<Promise> {
    let own: Vec<&AccuracyRow> = figures
        .iter()
        .filter(|row| {
            row.point != Point::Tip
                && row.subject.model == model
                && (row.subject.angles, row.subject.split) == (Angles::Commanded, Split::Blocks)
                && row.evidence == Moment::After
        })
        .collect();
    let named = |name: FigureName| own.iter().find(|row| row.name == name);
    let bound = named(FigureName::Bound)?;
    let (mean_mm, bound_mm) = (Some(named(FigureName::Mean)?.value?), Some(bound.value?));
    Some(Promise { mean_mm, bound_mm, share: bound.share?, confidence: bound.confidence? })
}
