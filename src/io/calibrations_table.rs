//! A Parquet file of table `calibrations` → an [`IdentifiedArm`] and its run. The row `base_target` has the nominal
//! arm; the best model that there is a row of predicts ([`Model::serving`]). Frames, joint ranges, configurations and
//! validity have to be the same in every row.

use std::path::{Path, PathBuf};

use nalgebra::Translation3;
use thiserror::Error;

use super::common::{self, CommonError};
use super::lake::read_given;
use super::tables::calibrations::{ArmColumns, CalibrationRow};
use super::tables::words::TableVerdict;
use crate::at::At;
use crate::compensation::{ArmModel, IdentifiedArm};
use crate::fit::conversion::Errors;
use crate::fit::flange::turn_behind;
use crate::fit::saved::{self, SavedCalibration, SavedError, SavedHead, SavedSession};
use crate::fit::{FramePair, Model};
use crate::geometry::Transform;
use crate::manifest::RunKey;
use crate::report::frame::StatedFrame;
use crate::rows::{Row as _, Word as _};
use crate::table::{FileError, Table};

#[derive(Debug)]
pub struct PublishedArm {
    pub key: RunKey,
    pub verdict: TableVerdict,
    pub arm: IdentifiedArm,
    pub error_frame: StatedFrame,
}

type Result<T, E = CalibrationsTableError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum CalibrationsTableError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Common(#[from] CommonError),
    #[error("{path} has no row of model {kind:?}; take the file of a whole run")]
    Absent { path: PathBuf, kind: &'static str },
    #[error(transparent)]
    Model(#[from] At<SavedError>),
    #[error(
        "{path}: models \"base_target\" and {kind:?} are not of the same {what}; take the file of a single run"
    )]
    Others { path: PathBuf, kind: &'static str, what: &'static str },
}

pub fn read(path: &Path) -> Result<PublishedArm> {
    CalibrationsFile::read(path)?.arm(&Model::serving().collect::<Vec<_>>())
}

pub fn read_geometry(path: &Path) -> Result<PublishedArm> {
    CalibrationsFile::read(path)?.arm(&[Model::Geometric])
}

pub fn read_geometry_errors(path: &Path) -> Result<(PublishedArm, Errors)> {
    let file = CalibrationsFile::read(path)?;
    let model = Model::Geometric;
    let arm = file.arm(&[model])?;
    let row = file.row(model).ok_or_else(|| file.absent(model))?;
    let saved = SavedCalibration::read(&row.model).map(|saved| saved.errors());
    Ok((arm, saved.map_err(|source| file.wrong(model, source))?))
}

struct CalibrationsFile<'t> {
    path: &'t Path,
    table: Table,
    rows: Vec<CalibrationRow>,
}

impl<'t> CalibrationsFile<'t> {
    fn read(path: &'t Path) -> Result<Self> {
        let table = read_given(path, CalibrationRow::schema())?;
        Ok(Self { path, rows: CalibrationRow::read(&table), table })
    }

    fn arm(&self, wanted: &[Model]) -> Result<PublishedArm> {
        let base_target = Model::BaseTarget;
        let base = self.head(base_target)?.ok_or_else(|| self.absent(base_target))?;
        let own =
            common::of_every_row(self.path, &self.table, self.rows.iter().map(|row| &row.of_arm))?;
        let key = common::key(self.path, &self.table)?;
        let model = self.first(wanted, &base)?;
        let verdict = self.row(model.model).map(|row| row.verdict);
        let valid_for = &own.valid_for;
        let error_frame = valid_for.error_frame.stated();
        let (path, joints) = (self.path, base.arm.joints().len());
        let arm = IdentifiedArm {
            // A run's table for joint angles goes by the run's name, as its table of nodes does.
            table_id: key.run.clone(),
            frames: self.frames(own)?,
            flange_from_tool: common::placement(path, "flange_from_tool", &own.flange_from_tool)?,
            command_from_base: common::placement(
                path,
                "command_from_base",
                &valid_for.command_from_base,
            )?,
            model,
            measured: common::joint_ranges(path, valid_for, joints)?,
            configurations: own.configurations.clone(),
            validity: valid_for.validity(),
            frame_uncertainty: error_frame.uncertainty(),
            arm: base.arm,
        };
        Ok(PublishedArm { key, verdict: verdict.unwrap_or_default(), arm, error_frame })
    }

    fn row(&self, model: Model) -> Option<&CalibrationRow> {
        self.rows.iter().find(|row| row.model_kind == model)
    }

    fn frames(&self, own: &ArmColumns) -> Result<FramePair> {
        let base = &own.valid_for.error_frame.error_frame_base;
        let base = common::placement(self.path, "error_frame_base", base)?;
        let target = Translation3::from(own.error_frame_target);
        Ok(FramePair::only(base, Transform::claim(target.into())))
    }

    fn absent(&self, model: Model) -> CalibrationsTableError {
        CalibrationsTableError::Absent { path: self.path.to_owned(), kind: model.word() }
    }

    fn wrong(&self, model: Model, source: SavedError) -> CalibrationsTableError {
        At::new(format!("{}, model {:?}", self.path.display(), model.word()), source).into()
    }

    /// The arm and the sessions of a saved model, where there is a row of it.
    fn head(&self, model: Model) -> Result<Option<SavedHead>> {
        let text = self.row(model).map(|row| row.model.as_str());
        let head = text.map(saved::read).transpose();
        head.map_err(|source| self.wrong(model, source))
    }

    fn first(&self, wanted: &[Model], base: &SavedHead) -> Result<ArmModel> {
        for &model in wanted {
            if let Some(found) = self.model(model, base)? {
                return Ok(found);
            }
        }
        Err(self.absent(*wanted.last().unwrap_or(&Model::Geometric)))
    }

    fn model(&self, model: Model, base: &SavedHead) -> Result<Option<ArmModel>> {
        let (Some(row), Some(load)) = (self.row(model), model.about().load) else {
            return Ok(None);
        };
        let loaded = load(&row.model, row.fit.misfit_mm);
        let loaded = loaded.map_err(|source| self.wrong(model, source))?;
        self.same(model, base, &loaded.head)?;
        let session = loaded.head.sessions.len() - 1;
        let frames = |of: &SavedSession| of.frames().map_err(|source| self.wrong(model, source));
        let (reference, own) = (&base.sessions[session], &loaded.head.sessions[session]);
        let (shown, predicts) = (turn_behind(&frames(reference)?, &frames(own)?), loaded.model);
        Ok(Some(ArmModel { model, shown, predicts, session }))
    }

    /// That a model is of the arm and the sessions of `base`, of which there is at least one.
    fn same(&self, model: Model, base: &SavedHead, own: &SavedHead) -> Result<()> {
        let names = |sessions: &[SavedSession]| -> Vec<String> {
            sessions.iter().map(|session| session.session.clone()).collect()
        };
        let what = if base.arm != own.arm {
            "arm"
        } else if names(&base.sessions) != names(&own.sessions) {
            "sessions"
        } else {
            return Ok(());
        };
        Err(CalibrationsTableError::Others { path: self.path.to_owned(), kind: model.word(), what })
    }
}
