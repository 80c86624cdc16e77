//! The lake's tables of the run that made a table, for comparison with the session that the table drove.

use std::path::Path;

use super::super::history;
use crate::compensation::validity::Outside;
use crate::compensation::{Conditions, UsedWith, Validity};
use crate::figures::extremes;
use crate::history::estimate::Estimate;
use crate::history::table_state::NotShown;
use crate::history::{Judged, between};
use crate::io::common::of_every_row;
use crate::io::lake::{Lake, LakeError};
use crate::io::table::{Row as _, Table};
use crate::io::tables::accuracy::{AccuracyRow, FigureName};
use crate::io::tables::calibrations::CalibrationRow;
use crate::io::tables::compensation::NodeRow;
use crate::io::tables::validity::ValidFor;
use crate::judgement::{Driven, JoinedSession, Outcome};
use crate::kinematics::Arm;
use crate::report::promise::Promise;
use crate::report::{Angles, Model, Moment, Point, Split};

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

    /// The promise of the run.
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
        match history::session::estimate(&self.calibrations)? {
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
    let sessions = outcome.training.iter();
    let stations = sessions.flat_map(|session| &session.joined.stations);
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
    Some(Promise {
        mean_mm: Some(named(FigureName::Mean)?.value?),
        bound_mm: Some(bound.value?),
        share: bound.share?,
        confidence: bound.confidence?,
    })
}
