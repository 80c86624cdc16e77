//! `length_residuals`: measured minus predicted reading of every instrument of one length, by every model.

use super::words::Role;
use crate::join::ReadingKind;
use crate::judgement::LengthResidual;
use crate::report::Model;
use crate::rows::row;

row! {
    pub struct LengthResidualRow of "length_residuals" {
        model: Model,
        role: Role,
        fold: Option<usize>,
        of_session: String,
        station: usize,
        source_index: usize,
        source: String,
        reads: ReadingKind,
        target: Option<String>,
        pose: usize,
        measured_mm: f64,
        predicted_mm: f64,
        residual_mm: f64,
        predicted_sd_mm: Option<f64>,
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
        reads: own.kind,
        target: own.target.map(|target| target.name(targets)),
        pose: own.pose,
        measured_mm: own.measured_mm,
        predicted_mm: own.predicted_mm,
        residual_mm: own.residual_mm(),
        predicted_sd_mm: own.sd_mm,
        weight: own.weight,
    }
}
