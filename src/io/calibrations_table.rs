//! A Parquet file of table `calibrations` → an [`IdentifiedArm`] and its run.
//!
//! 1. The file keeps the contract of `schemas/calibrations.toml` ([`read_given`]).
//! 2. The row `base_target` has the nominal arm and the frames that are the gauge of errors: those of the last session.
//! 3. The best model that there is a row of predicts ([`Model::serving`]): `full`, or without it `geometric`.
//! 4. Frames of commands and tool, joint ranges, arm configurations and validity stand in every row and have to be the same.

use std::path::{Path, PathBuf};

use arrow::array::Array as _;
use thiserror::Error;

use super::common::{Common, CommonError};
use super::lake::read_given;
use super::schema::{self, SchemaError};
use super::table::{FileError, Table};
use crate::compensation::{ArmModel, IdentifiedArm};
use crate::fit::Model;
use crate::fit::saved::{SavedError, SavedHead, SavedSession};
use crate::manifest::RunKey;

/// An identified arm as a run published it.
#[derive(Debug)]
pub struct PublishedArm {
    /// The run that identified it.
    pub key: RunKey,
    /// The arm.
    pub arm: IdentifiedArm,
}

/// Why a file cannot be read as an identified arm.
#[derive(Debug, Error)]
pub enum CalibrationsTableError {
    /// No such table file.
    #[error(transparent)]
    File(#[from] FileError),
    /// The program does not know its own table.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// It does not say one thing of itself.
    #[error(transparent)]
    Common(#[from] CommonError),
    /// A model that every run has.
    #[error("{path} has no row of model {kind:?}; take the file of a whole run")]
    Absent {
        /// The file.
        path: PathBuf,
        /// The model.
        kind: &'static str,
    },
    /// A model that cannot be read.
    #[error("{path}, model {kind:?}: {source}")]
    Model {
        /// The file.
        path: PathBuf,
        /// The model.
        kind: &'static str,
        /// What is wrong with it.
        source: SavedError,
    },
    /// Rows of several arms or sessions.
    #[error(
        "{path}: models \"base_target\" and {kind:?} are not of the same {what}; take the file of a single run"
    )]
    Others {
        /// The file.
        path: PathBuf,
        /// The other model.
        kind: &'static str,
        /// What differs.
        what: &'static str,
    },
}

/// Reads the arm that a run identified, with the best model it has.
pub fn read(path: &Path) -> Result<PublishedArm, CalibrationsTableError> {
    read_model(path, &Model::serving().collect::<Vec<_>>())
}

/// Reads the arm that a run identified, with the geometry alone.
pub fn read_geometry(path: &Path) -> Result<PublishedArm, CalibrationsTableError> {
    read_model(path, &[Model::Geometric])
}

/// Reads the arm with the first of the `wanted` models that there is.
fn read_model(path: &Path, wanted: &[Model]) -> Result<PublishedArm, CalibrationsTableError> {
    let table = read_given(path, schema::find("calibrations")?)?;
    let file = CalibrationsFile {
        path,
        table: &table,
    };
    let base_target = Model::BaseTarget.about().word;
    let base = file
        .head(base_target)?
        .ok_or_else(|| file.absent(base_target))?;
    let wrong = |source| file.wrong(base_target, source);
    let arm = base.arm.arm().map_err(wrong)?;
    let session = base
        .sessions
        .last()
        .ok_or_else(|| file.absent(base_target))?;
    let frames = session.frames().map_err(wrong)?;
    let frames = frames.one().map_err(|several| wrong(several.into()))?;
    let said = file.said();
    let key = said.key()?;
    let arm = IdentifiedArm {
        // A run's table for joint angles goes by the run's name, as its table of nodes does.
        table_id: key.run.clone(),
        frames,
        flange_from_tool: said.placement("flange_from_tool")?,
        command_from_base: said.placement("command_from_base")?,
        model: file.first(wanted, &base)?,
        measured: said.joint_ranges(arm.joints().len())?,
        configurations: said.texts("configurations")?,
        validity: said.validity()?,
        arm,
    };
    Ok(PublishedArm { key, arm })
}

/// A file that keeps the schema.
struct CalibrationsFile<'t> {
    path: &'t Path,
    table: &'t Table,
}

impl CalibrationsFile<'_> {
    const fn said(&self) -> Common<'_> {
        Common {
            path: self.path,
            table: self.table,
        }
    }

    fn row(&self, kind: &str) -> Option<usize> {
        let kinds = self.table.text("model_kind");
        (0..kinds.len()).find(|&row| kinds.value(row) == kind)
    }

    fn absent(&self, kind: &'static str) -> CalibrationsTableError {
        CalibrationsTableError::Absent {
            path: self.path.to_owned(),
            kind,
        }
    }

    fn wrong(&self, kind: &'static str, source: SavedError) -> CalibrationsTableError {
        CalibrationsTableError::Model {
            path: self.path.to_owned(),
            kind,
            source,
        }
    }

    /// The saved text of a kind of model, where there is a row of it.
    fn text(&self, kind: &str) -> Option<&str> {
        Some(self.table.text("model").value(self.row(kind)?))
    }

    /// What the saved model of a kind is of, where there is a row of it.
    fn head(&self, kind: &'static str) -> Result<Option<SavedHead>, CalibrationsTableError> {
        let head = self.text(kind).map(SavedHead::read).transpose();
        head.map_err(|source| self.wrong(kind, source))
    }

    /// The first of the `wanted` models that there is a row of.
    fn first(
        &self,
        wanted: &[Model],
        base: &SavedHead,
    ) -> Result<ArmModel, CalibrationsTableError> {
        for &model in wanted {
            if let Some(found) = self.model(model, base)? {
                return Ok(found);
            }
        }
        let last = wanted.last().map_or("", |model| model.about().word);
        Err(self.absent(last))
    }

    fn model(
        &self,
        model: Model,
        base: &SavedHead,
    ) -> Result<Option<ArmModel>, CalibrationsTableError> {
        let kind = model.about().word;
        let (Some(row), Some(load)) = (self.row(kind), model.about().load) else {
            return Ok(None);
        };
        let misfit = self.table.f64("misfit_mm");
        let misfit = (!misfit.is_null(row)).then(|| misfit.value(row));
        let predicts = load(self.table.text("model").value(row), misfit);
        let predicts = predicts.map_err(|source| self.wrong(kind, source))?;
        let own = self.head(kind)?.ok_or_else(|| self.absent(kind))?;
        self.same(kind, base, &own)?;
        Ok(Some(ArmModel {
            model,
            predicts,
            session: own.sessions.len() - 1,
        }))
    }

    /// That a model is of the arm and the sessions of `base`, of which there is at least one.
    fn same(
        &self,
        kind: &'static str,
        base: &SavedHead,
        own: &SavedHead,
    ) -> Result<(), CalibrationsTableError> {
        let names = |sessions: &[SavedSession]| -> Vec<String> {
            sessions
                .iter()
                .map(|session| session.session.clone())
                .collect()
        };
        let what = if base.arm != own.arm {
            "arm"
        } else if names(&base.sessions) != names(&own.sessions) {
            "sessions"
        } else {
            return Ok(());
        };
        Err(CalibrationsTableError::Others {
            path: self.path.to_owned(),
            kind,
            what,
        })
    }
}
