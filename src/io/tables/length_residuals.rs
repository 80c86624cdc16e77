//! `length_residuals`: measured minus predicted reading of every instrument of one length, by every model.

use super::outcome::LengthResidual;
use super::residuals::target_name;
use super::sources::SourceReads;
use super::words::Role;
use crate::report::Model;
use crate::table::row;

row! {
    /// Measured minus predicted length of one reading by one model.
    pub struct LengthResidualRow of "length_residuals" {
        /// The model that predicts.
        model: Model,
        /// The part of the reading in the fit.
        role: Role,
        /// The fold that held it out; `None` where it trained.
        fold: Option<usize>,
        /// The session of the station.
        of_session: String,
        /// Its number.
        station: usize,
        /// Index of the instrument among the sources, from 0.
        source_index: usize,
        /// The instrument's name.
        source: String,
        /// Kind of its readings.
        reads: SourceReads,
        /// Name of the target that was read; `None` where the session has one target.
        target: Option<String>,
        /// The number of the station that names its pose.
        pose: usize,
        /// The reading, mm.
        measured_mm: f64,
        /// The predicted reading, mm.
        predicted_mm: f64,
        /// Measured minus predicted, mm.
        residual_mm: f64,
        /// Its standard deviation, mm; `None` of a model without one, and in training.
        predicted_sd_mm: Option<f64>,
        /// The reading's robust weight, in training.
        weight: Option<f64>,
    }
}

/// The rows of all readings; `targets` are the names of targets, where there are several.
pub fn rows(residuals: &[LengthResidual], targets: &[String]) -> Vec<LengthResidualRow> {
    residuals.iter().map(|own| row(own, targets)).collect()
}

fn row(own: &LengthResidual, targets: &[String]) -> LengthResidualRow {
    LengthResidualRow {
        model: own.model,
        role: if own.fold.is_some() { Role::HeldOut } else { Role::Training },
        fold: own.fold,
        of_session: own.session.clone(),
        station: own.station,
        source_index: own.source.0,
        source: own.name.clone(),
        reads: own.kind.into(),
        target: own.target.map(|target| target_name(target, targets)),
        pose: own.pose,
        measured_mm: own.measured_mm,
        predicted_mm: own.predicted_mm,
        residual_mm: own.residual_mm(),
        predicted_sd_mm: own.sd_mm,
        weight: own.weight,
    }
}
