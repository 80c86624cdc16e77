//! `residuals`: measured minus predicted target position of every station under every model.

use super::{PublishError, words};
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::manifest::RunKey;
use crate::report::{Residual, ResidualSet};

/// The table of all residual sets.
pub fn residuals(sets: &[ResidualSet], key: &RunKey) -> Result<Table, PublishError> {
    let rows: Vec<_> = sets
        .iter()
        .flat_map(|set| {
            set.residuals
                .iter()
                .map(move |residual| (&set.subject, residual))
        })
        .collect();
    let subjects = || rows.iter().map(|(subject, _)| *subject);
    let table = Columns::new(schema::find("residuals")?, rows.len()).key(key);
    let table = words::subjects(table, subjects);
    let residuals: Vec<&Residual> = rows.iter().map(|(_, residual)| *residual).collect();
    Ok(columns(table, &residuals).finish()?)
}

fn columns(columns: Columns, residuals: &[&Residual]) -> Columns {
    let all = || residuals.iter();
    columns
        .column("fold", all().map(|r| r.fold))
        .column("station", all().map(|r| r.station))
        .column("pose", all().map(|r| r.pose))
        .column("used_for_refit", all().map(|r| r.used_for_refit))
        .group(
            ["x_mm", "y_mm", "z_mm"],
            all().map(|r| -> [f64; 3] { (r.predicted.coords + r.residual).into() }),
        )
        .group(
            ["residual_x_mm", "residual_y_mm", "residual_z_mm"],
            all().map(|r| -> [f64; 3] { r.residual.into() }),
        )
        .column("residual_mm", all().map(|r| r.residual.norm()))
        .absent(["residual_rx_rad", "residual_ry_rad", "residual_rz_rad"])
        .group(
            ["xx", "xy", "xz", "yy", "yz", "zz"]
                .map(|c| format!("predicted_cov_{c}_mm2"))
                .each_ref()
                .map(String::as_str),
            all().map(|r| r.covariance.as_ref().map(words::upper)),
        )
        .column("mahalanobis_squared", all().map(|r| distance_squared(r)))
        .column("weight", all().map(|r| r.weight))
}

/// `rᵀ Σ⁻¹ r`; `None` without a covariance, or one that is not positive definite.
fn distance_squared(residual: &Residual) -> Option<f64> {
    let factor = residual.covariance?.cholesky()?;
    Some(residual.residual.dot(&factor.solve(&residual.residual)))
}
