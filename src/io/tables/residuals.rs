//! `residuals`: measured minus predicted target position of every station under every model; and `estimate_residuals`, with the same
//! columns, of the stations of an estimate.

use std::collections::BTreeMap;

use nalgebra::Point3;

use super::words::Role;
use crate::geometry::{symmetric, upper};
use crate::join::TargetId;
use crate::report::{Angles, BaseRefit, Model, Residual, ResidualSet, Split, Subject};
use crate::rows::{columns, row};

row! {
    /// Measured minus predicted at one station under one model, base frame.
    pub struct ResidualRow of "residuals" {
        subject: Subject,
        role: Role,
        fold: Option<usize>,
        station: usize,
        target: Option<String>,
        pose: usize,
        used_for_refit: bool,
        at as [x_mm, y_mm, z_mm]: [f64; 3],
        residual as point: [f64; 3],
        residual_mm: f64,
        turned as [residual_rx_rad, residual_ry_rad, residual_rz_rad]: Option<[f64; 3]>,
        predicted_cov_mm2 as [predicted_cov: covariance]: Option<[f64; 6]>,
        mahalanobis_squared: Option<f64>,
        weight: Option<f64>,
    }
}

row! {
    /// Measured minus predicted at one station of an estimate under one of its models.
    pub struct EstimateResidualRow of "estimate_residuals" {
        residual: ResidualRow,
    }
}

columns! {
    of Subject {
        split: Split,
        of_session: String,
        model: Model,
        angles: Angles,
        base_refit: BaseRefit,
    }
}

/// The rows of all residual sets; `targets` are the names of targets, where there are several.
pub fn rows(sets: &[ResidualSet], targets: &[String]) -> Vec<ResidualRow> {
    let of_set = |set: &ResidualSet| -> Vec<ResidualRow> {
        let residuals = set.residuals.iter();
        residuals.map(|r| of_residual(&set.subject, r, targets)).collect()
    };
    sets.iter().flat_map(of_set).collect()
}

/// The residual sets of rows; `targets` as for [`rows`]. `None` where a row has an orientation, of which a row has the difference alone, or
/// a target of another name.
pub fn sets(rows: Vec<ResidualRow>, targets: &[String]) -> Option<Vec<ResidualSet>> {
    let mut sets: BTreeMap<Subject, Vec<Residual>> = BTreeMap::new();
    for row in rows {
        let residual = residual(&row, targets)?;
        sets.entry(row.subject).or_default().push(residual);
    }
    Some(sets.into_iter().map(|(subject, residuals)| ResidualSet { subject, residuals }).collect())
}

fn residual(row: &ResidualRow, targets: &[String]) -> Option<Residual> {
    let target = |name: &String| target_named(name, targets);
    let is_whole = row.turned.is_none();
    is_whole.then_some(Residual {
        station: row.station,
        target: match &row.target {
            Some(name) => Some(target(name)?),
            None => None,
        },
        pose: row.pose,
        fold: row.fold,
        used_for_refit: row.used_for_refit,
        attained: Point3::from(row.at),
        residual: row.residual.into(),
        covariance: row.predicted_cov_mm2.map(symmetric),
        weight: row.weight,
        turn: None,
    })
}

/// The target of a name that [`TargetId::name`] gives.
fn target_named(name: &str, names: &[String]) -> Option<TargetId> {
    let named = names.iter().position(|own| own == name);
    let numbered = || name.parse::<usize>().ok()?.checked_sub(1);
    named.or_else(numbered).map(TargetId)
}

fn of_residual(subject: &Subject, residual: &Residual, targets: &[String]) -> ResidualRow {
    ResidualRow {
        subject: subject.clone(),
        role: subject.split.into(),
        fold: residual.fold,
        station: residual.station,
        target: residual.target.map(|own| own.name(targets)),
        pose: residual.pose,
        used_for_refit: residual.used_for_refit,
        at: residual.attained.into(),
        residual: residual.residual.into(),
        residual_mm: residual.residual.norm(),
        turned: residual.turn.map(|turn| turn.residual().into()),
        predicted_cov_mm2: residual.covariance.as_ref().map(upper),
        mahalanobis_squared: residual.mahalanobis_squared(),
        weight: residual.weight,
    }
}
