//! `joint_errors`: the error curve of each joint with its standard deviation, on a grid of whole degrees.

use super::validity::learnt_from;
use super::{PublishContext, PublishError};
use crate::fit::full::FullModel;
use crate::fit::full::curves::JointError;
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::manifest::RunKey;
use crate::pipeline::outcome::Outcome;

/// The curve is given this far beyond what was measured, degrees: there the deviation grows back to the prior's.
const BEYOND_DEG: f64 = 15.0;

/// One row.
struct Row {
    joint: usize,
    error: JointError,
    measured: bool,
}

/// The table of all joints; empty without a full model.
pub fn joint_errors(
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
    key: &RunKey,
) -> Result<Table, PublishError> {
    let joints = context.arm.joints();
    let rows: Vec<Row> = outcome
        .full
        .iter()
        .flat_map(|full| rows(full, outcome, context))
        .collect();
    let table = Columns::new(schema::find("joint_errors")?, rows.len())
        .key(key)
        .column("joint", rows.iter().map(|row| row.joint + 1))
        .column(
            "joint_name",
            rows.iter().map(|row| joints[row.joint].name.as_str()),
        )
        .column("angle_rad", rows.iter().map(|row| row.error.angle))
        .column("error_rad", rows.iter().map(|row| row.error.error()))
        .column("sd_rad", rows.iter().map(|row| row.error.sd))
        .column("curve_rad", rows.iter().map(|row| row.error.curve))
        .column(
            "gear_lines_rad",
            rows.iter().map(|row| row.error.gear_lines),
        )
        .column("measured", rows.iter().map(|row| row.measured));
    Ok(table.finish()?)
}

fn rows(full: &FullModel, outcome: &Outcome<'_>, context: &PublishContext<'_>) -> Vec<Row> {
    let axes: Vec<Vec<f64>> = learnt_from(outcome)
        .map(|s| context.arm.axes(&s.joints))
        .collect();
    let of_joint = |joint: usize| {
        let angles = axes.iter().map(|axes| axes[joint]);
        let (low, high) = angles.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), q| {
            (low.min(q), high.max(q))
        });
        let row = move |error: JointError| Row {
            joint,
            measured: (low..=high).contains(&error.angle),
            error,
        };
        full.joint_errors(joint, &degrees(low, high))
            .into_iter()
            .map(row)
    };
    (0..context.arm.joints().len()).flat_map(of_joint).collect()
}

/// Whole degrees around `low` to `high` (rad), in rad; none where nothing was measured.
fn degrees(low: f64, high: f64) -> Vec<f64> {
    let first = (low.to_degrees() - BEYOND_DEG).floor();
    let last = (high.to_degrees() + BEYOND_DEG).ceil();
    std::iter::successors(Some(first), |degree| Some(degree + 1.0))
        .take_while(|degree| *degree <= last)
        .map(f64::to_radians)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_reach_beyond_what_was_measured() {
        // 9.5° to 10.5°: −6 (9.5 − 15 = −5.5, rounded outward) to 26.
        let found = degrees(9.5_f64.to_radians(), 10.5_f64.to_radians());
        assert_eq!(found.len(), 33);
        assert!((found[0].to_degrees() + 6.0).abs() < 1e-9);
        assert!(degrees(f64::INFINITY, f64::NEG_INFINITY).is_empty());
    }
}
