//! A Parquet file of table `calibrations` → an [`IdentifiedArm`] and its run.
//!
//! 1. The file keeps the contract of `schemas/calibrations.toml` ([`read_given`]).
//! 2. The row `base_target` has the nominal arm and the frames that are the gauge of errors: those of the last session.
//! 3. The row `full` has the model that predicts; without one it is the geometry of row `geometric`.
//! 4. Frames of commands and tool, joint ranges, arm configurations and validity stand in every row and have to be the same.

use std::path::{Path, PathBuf};

use arrow::array::Array as _;
use thiserror::Error;

use super::common::{Common, CommonError};
use super::lake::read_given;
use super::schema::{self, SchemaError};
use super::table::{FileError, Table};
use crate::compensation::{ArmModel, IdentifiedArm};
use crate::fit::IdentifiedGeometry;
use crate::fit::full::FullModel;
use crate::fit::full::saved::SavedFull;
use crate::fit::saved::{SavedArm, SavedCalibration, SavedError, SavedSession};
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
    read_model(path, Wanted::Best)
}

/// Reads the arm that a run identified, with the geometry alone.
pub fn read_geometry(path: &Path) -> Result<PublishedArm, CalibrationsTableError> {
    read_model(path, Wanted::Geometry)
}

/// Which model of a run is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wanted {
    Best,
    Geometry,
}

fn read_model(path: &Path, wanted: Wanted) -> Result<PublishedArm, CalibrationsTableError> {
    let table = read_given(path, schema::find("calibrations")?)?;
    let file = CalibrationsFile {
        path,
        table: &table,
    };
    let base = file
        .model("base_target", SavedCalibration::read)?
        .ok_or_else(|| file.absent("base_target"))?;
    let wrong = |source| file.wrong("base_target", source);
    let arm = base.arm.arm().map_err(wrong)?;
    let session = base
        .sessions
        .last()
        .ok_or_else(|| file.absent("base_target"))?;
    let frames = session.frames().map_err(wrong)?;
    let said = file.said();
    let key = said.key()?;
    let arm = IdentifiedArm {
        // A run's table for joint angles goes by the run's name, as its table of nodes does.
        table_id: key.run.clone(),
        frames,
        flange_from_tool: said.placement("flange_from_tool")?,
        command_from_base: said.placement("command_from_base")?,
        model: match wanted {
            Wanted::Best => file.best(&base)?,
            Wanted::Geometry => file.geometric(&base)?,
        },
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

    /// The saved model of a kind, where there is a row of it.
    fn model<T>(
        &self,
        kind: &'static str,
        read: fn(&str) -> Result<T, SavedError>,
    ) -> Result<Option<T>, CalibrationsTableError> {
        let row = self.row(kind);
        let text = row.map(|row| self.table.text("model").value(row));
        let model = text.map(read).transpose();
        model.map_err(|source| self.wrong(kind, source))
    }

    /// The whole error model, or the geometry.
    fn best(&self, base: &SavedCalibration) -> Result<ArmModel, CalibrationsTableError> {
        let Some(saved) = self.model("full", SavedFull::read)? else {
            return self.geometric(base);
        };
        self.same("full", base, &saved.arm, &saved.sessions)?;
        let model = FullModel::from_saved(&saved).map_err(|source| self.wrong("full", source))?;
        Ok(ArmModel::Full {
            session: saved.sessions.len() - 1,
            model: Box::new(model),
        })
    }

    fn geometric(&self, base: &SavedCalibration) -> Result<ArmModel, CalibrationsTableError> {
        const KIND: &str = "geometric";
        let saved = self.model(KIND, SavedCalibration::read)?;
        let (Some(saved), Some(row)) = (saved, self.row(KIND)) else {
            return Err(self.absent(KIND));
        };
        self.same(KIND, base, &saved.arm, &saved.sessions)?;
        let wrong = |source| self.wrong(KIND, source);
        let misfit = self.table.f64("misfit_mm");
        if misfit.is_null(row) {
            let problem = format!("null in row {row}, whose model says no covariance of its own");
            return Err(self.said().value_error("misfit_mm", problem).into());
        }
        Ok(ArmModel::Geometric(IdentifiedGeometry {
            chain: saved.chain().map_err(wrong)?,
            frames: saved.sessions[saved.sessions.len() - 1]
                .frames()
                .map_err(wrong)?,
            misfit_mm: misfit.value(row),
        }))
    }

    /// That a model is of the arm and the sessions of `base`, of which there is at least one.
    fn same(
        &self,
        kind: &'static str,
        base: &SavedCalibration,
        arm: &SavedArm,
        sessions: &[SavedSession],
    ) -> Result<(), CalibrationsTableError> {
        let names = |sessions: &[SavedSession]| -> Vec<String> {
            sessions
                .iter()
                .map(|session| session.session.clone())
                .collect()
        };
        let what = if base.arm != *arm {
            "arm"
        } else if names(&base.sessions) != names(sessions) {
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
