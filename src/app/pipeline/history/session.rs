//! One session's published tables → the figures that the history needs.
//!
//! Each file is digested and compared with the row of `runs` before it is used. The model is the full error model where
//! there is one, otherwise the geometry. Figures are those of held-out stations where the session has them.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::rows::Fact;
use crate::files::table::Table;
use crate::fit::TargetId;
use crate::fit::full::FullModel;
use crate::fit::full::saved::SavedFull;
use crate::fit::saved::{self, SavedCalibration, SavedHead};
use crate::grid::notices_mm;
use crate::history::estimate::Estimate;
use crate::history::notice::Noticed;
use crate::history::{AccuracyFigure, Basis, SessionFigures};
use crate::io::lake::{Lake, LakeError, figures_key};
use crate::io::rows::{Row as _, Word as _};
use crate::io::tables::accuracy::{AccuracyRow, FigureKind, FigureName};
use crate::io::tables::calibrations::CalibrationRow;
use crate::io::tables::clocks::ClockRow;
use crate::io::tables::words::Role;
use crate::manifest::{RunKey, Work, Written};
use crate::report::{Angles, BaseRefit, Model, Point, Split};

/// The figures of one session: those that are kept, or of its tables where there are none or `is_fresh`; or, as text, why there are none.
pub(super) fn read(lake: &Lake, fact: &Fact, is_fresh: bool) -> Result<SessionFigures, String> {
    let kept = (!is_fresh).then(|| Kept::read(lake, &fact.key, &fact.tables)).flatten();
    let Kept { model, estimate, accuracy, noticed, .. } =
        kept.map_or_else(|| of_tables(lake, fact), Ok)?;
    Ok(SessionFigures {
        basis: Basis {
            pipeline: fact.pipeline.clone(),
            version: fact.version.clone(),
            robot_file: fact.robot_file.clone(),
            settings: fact.settings.clone(),
            model,
        },
        estimate,
        accuracy,
        noticed,
    })
}

/// The figures in a session's tables, which are kept from then on.
fn of_tables(lake: &Lake, fact: &Fact) -> Result<Kept, String> {
    let [calibrations, accuracy] = [0, 1].map(|place| {
        let table = lake.read_written(OF[place], &fact.key, &fact.tables[place]);
        table.map_err(|error| error.to_string())
    });
    let stamp = fact.measured_at_ns.unwrap_or_default();
    let of = fact.tables.clone();
    let kept = Kept::of([&calibrations?, &accuracy?], of, stamp, &fact.key.session)?;
    // Of a lake that cannot be written the tables are read the next time too.
    let _ = kept.write(lake, &fact.key);
    Ok(kept)
}

/// The best model's estimate, and the name of the model.
pub(in crate::pipeline) fn estimate(calibrations: &Table) -> Result<(Model, Estimate), String> {
    let rows = CalibrationRow::read(calibrations);
    let of = |kind: Model| rows.iter().find(|row| row.model_kind == kind);
    if let Some(row) = of(Model::Full) {
        let saved = SavedFull::read(&row.model).map_err(|error| error.to_string())?;
        let model = FullModel::from_saved(&saved).map_err(|error| error.to_string())?;
        let ranges = ranges(row, &saved.arm.axes_from_joints());
        let estimate = Estimate::of_full(&model, &ranges);
        let estimate = estimate.ok_or("the covariance of model full is none")?;
        return Ok((Model::Full, estimate));
    }
    let row = of(Model::Geometric).ok_or("neither model full nor geometric is there")?;
    let saved = SavedCalibration::read(&row.model).map_err(|error| error.to_string())?;
    let estimate = Estimate::of_geometric(&saved).map_err(|error| error.to_string())?;
    Ok((Model::Geometric, estimate.ok_or("the covariance of model geometric is none")?))
}

/// The size from which a change of a session counts, by its tolerance and U; `None` where its tables do not state them.
pub(super) fn noticed(
    calibrations: &Table,
    accuracy: &Table,
    session: &str,
    estimate: &Estimate,
) -> Option<Noticed> {
    let bounds = AccuracyRow::read(accuracy).into_iter();
    let mut bounds =
        bounds.filter(|row| row.subject.of_session == session && row.point != Point::Tip);
    let least_mm =
        bounds.find_map(|row| Some(notices_mm(row.tolerance?, row.expanded_uncertainty?)));
    let rows = CalibrationRow::read(calibrations);
    let row = rows.first()?;
    let head: SavedHead = saved::read(&row.model).ok()?;
    let frames = head.sessions.first()?.frames().ok()?;
    let target = frames.flange_from_target(TargetId::MAIN).isometry();
    let ranges = row.of_arm.valid_for.joint_ranges();
    let is_whole = ranges.len() == head.arm.joints().len();
    let noticed = |mm| Noticed::new(mm, &estimate.columns, &head.arm, target, &ranges);
    least_mm.filter(|_| is_whole).map(noticed)
}

/// Lowest and highest axis variable of each joint over the stations of a calibration, rad or mm; empty for one that a joint map couples
/// with others.
fn ranges(row: &CalibrationRow, axes_from_joints: &DMatrix<f64>) -> Vec<[f64; 2]> {
    let (joints, measured) = (axes_from_joints.ncols(), row.of_arm.valid_for.joint_ranges());
    let range = |axis: usize| {
        let share = |joint: usize| axes_from_joints[(axis, joint)];
        let is_own = |joint| (share(joint) - f64::from(u8::from(joint == axis))).abs() == 0.0;
        let is_alone = (0..joints).all(is_own);
        let ends = measured.get(axis).filter(|_| is_alone);
        ends.copied().unwrap_or([f64::INFINITY, f64::NEG_INFINITY])
    };
    (0..joints).map(range).collect()
}

/// Figures that are charted: mean and 95th percentile of held-out errors, before and after.
pub(super) fn figures(accuracy: &Table, session: &str) -> Vec<AccuracyFigure> {
    let figure = |row: &AccuracyRow| {
        let words = [row.moment.word(), row.subject.model.word(), row.name.word()];
        Some(AccuracyFigure { name: words.join(" "), value: row.value? })
    };
    let rows = AccuracyRow::read(accuracy);
    let charted = rows.iter().filter(|row| is_charted(row, session));
    let mut figures: Vec<AccuracyFigure> = charted.filter_map(figure).collect();
    figures.sort_by(|a, b| a.name.cmp(&b.name));
    figures.dedup_by(|a, b| a.name == b.name);
    figures
}

fn is_charted(row: &AccuracyRow, session: &str) -> bool {
    row.subject.of_session == session
        && row.role == Role::HeldOut
        && row.subject.split == Split::Blocks
        && row.subject.base_refit == BaseRefit::None
        && row.point != Point::Tip
        && row.quantity == FigureKind::PositionError
        && row.subject.model != Model::Geometric
        && matches!(row.name, FigureName::Mean | FigureName::P95)
        && (row.subject.model, row.subject.angles) != (Model::Full, Angles::Commanded)
}

/// The tables that figures are of.
pub(super) const OF: [&str; 2] = ["calibrations", "accuracy"];

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::pipeline) struct Kept {
    /// Digests of the files that they are of, in the order of [`OF`].
    of: [String; 2],
    /// First stamp of the controller's log.
    pub(super) measured_at_ns: i64,
    pub(super) model: String,
    pub(super) estimate: Estimate,
    pub(super) accuracy: Vec<AccuracyFigure>,
    /// The size from which a change counts.
    pub(super) noticed: Option<Noticed>,
}

impl Kept {
    /// The figures in a session's tables; or, as text, why there are none.
    pub(super) fn of(
        [calibrations, accuracy]: [&Table; 2],
        of: [String; 2],
        measured_at_ns: i64,
        session: &str,
    ) -> Result<Self, String> {
        let (model, estimate) = estimate(calibrations)
            .map_err(|reason| format!("table calibrations of {session}: {reason}"))?;
        Ok(Self {
            of,
            measured_at_ns,
            model: model.word().to_owned(),
            noticed: noticed(calibrations, accuracy, session, &estimate),
            accuracy: figures(accuracy, session),
            estimate,
        })
    }

    /// The figures of a run that writes these tables; `None` of one that learnt from several sessions, or has none.
    pub(in crate::pipeline) fn of_run<'t>(
        work: &Work,
        tables: impl Iterator<Item = &'t Table>,
        written: &[Written],
    ) -> Option<Self> {
        let key = work.key();
        if work.sessions != [key.session.as_str()] {
            return None;
        }
        let own: Vec<&Table> = tables.filter(|table| table.key() == Some(&key)).collect();
        let named = |name: &str| own.iter().copied().find(|table| table.schema().table == name);
        let digest = |name: &str| {
            let is_own = |file: &&Written| file.table == name && file.session == key.session;
            Some(written.iter().find(is_own)?.digest.clone())
        };
        let clock = ClockRow::read(named("clocks")?).into_iter().next()?;
        let tables = [named(OF[0])?, named(OF[1])?];
        let of = [digest(OF[0])?, digest(OF[1])?];
        Self::of(tables, of, clock.origin_ns, &key.session).ok()
    }

    /// Reads the kept figures of a run whose row states these digests of its files; `None` where there are none or they are of others.
    pub(super) fn read(lake: &Lake, key: &RunKey, of: &[String; 2]) -> Option<Self> {
        let kept: Self = serde_json::from_str(&lake.kept(&figures_key(key).ok()?)?).ok()?;
        (kept.of == *of).then_some(kept)
    }

    pub(in crate::pipeline) fn write(&self, lake: &Lake, key: &RunKey) -> Result<(), LakeError> {
        let text = serde_json::to_string(self).expect("texts and numbers");
        lake.keep(&figures_key(key)?, &text)
    }
}
