//! Commands of targets → table `corrected_targets`.

use nalgebra::Vector3;

use crate::compensation::{Corrected, Exception, JointCommand, Refused, Target};
use crate::io::schema;
use crate::io::table::{Columns, Table, TableError};
use crate::manifest::RunKey;

/// The origin of a correction, repeated in every row of the result.
#[derive(Debug, Clone, Copy)]
pub struct CorrectedBy<'a> {
    /// Key of the run.
    pub key: &'a RunKey,
    /// The run's name for targets corrected with it.
    pub table_id: &'a str,
    /// Name of the table: `compensation` or `calibrations`.
    pub table: &'static str,
    /// The joints in the order of joint angles; empty where there are no joint angles.
    pub joint_names: &'a [String],
}

/// The rows of targets, with the command or the refusal of each.
pub fn corrected(
    targets: &[Target],
    outcomes: &[Result<Corrected, Refused>],
    by: CorrectedBy<'_>,
) -> Result<Table, TableError> {
    let schema = schema::find("corrected_targets").expect("it is one of the program's own schemas");
    let refused = || outcomes.iter().map(|outcome| outcome.as_ref().err());
    let names = (!by.joint_names.is_empty()).then_some(by.joint_names);
    let columns = Columns::new(schema, targets.len())
        .key(by.key)
        .column("row", 0..targets.len())
        .column("target", targets.iter().map(|target| &target.name))
        .column(
            "configuration",
            targets.iter().map(|target| target.configuration.as_ref()),
        )
        .column("tool", targets.iter().map(|target| target.tool.as_ref()))
        .same("table_id", by.table_id)
        .same("corrected_by", by.table)
        .same("joint_names", names)
        .column(
            "refused",
            refused().map(|refused| refused.map(|refused| refused.reason.name())),
        )
        .column(
            "reason",
            refused().map(|refused| refused.map(Refused::to_string)),
        );
    let columns = commands(columns, targets, outcomes);
    corrections(columns, outcomes).finish()
}

/// The columns of targets and their commands.
fn commands(
    columns: Columns,
    targets: &[Target],
    outcomes: &[Result<Corrected, Refused>],
) -> Columns {
    let done = || outcomes.iter().map(|outcome| outcome.as_ref().ok());
    let joints =
        |of: fn(&JointCommand) -> Vec<f64>| done().map(move |done| done?.joints.as_ref().map(of));
    let pairs = || done().zip(targets);
    let place = |(done, target): (Option<&Corrected>, &Target)| {
        let place = done.map(|done| done.target).or(target.position);
        place.map(|place| place.coords().into())
    };
    let turn = |(done, target): (Option<&Corrected>, &Target)| {
        let turn = done
            .and_then(|done| done.orientation)
            .or(target.orientation);
        turn.map(|turn| turn.coords.into())
    };
    columns
        .group(
            ["x_mm", "y_mm", "z_mm"],
            done().map(|done| done.map(|done| done.command.coords().into())),
        )
        .group::<4, Option<[f64; 4]>>(["qx", "qy", "qz", "qw"], pairs().map(turn))
        .group::<3, Option<[f64; 3]>>(
            ["target_x_mm", "target_y_mm", "target_z_mm"],
            pairs().map(place),
        )
        .column("joints_rad", joints(|joints| joints.command.clone()))
        .column("target_joints_rad", joints(|joints| joints.target.clone()))
        .column("correction_joints_rad", joints(JointCommand::correction))
}

/// The columns of corrections, their covariances and methods.
fn corrections(columns: Columns, outcomes: &[Result<Corrected, Refused>]) -> Columns {
    let done = || outcomes.iter().map(|outcome| outcome.as_ref().ok());
    let vectors = |of: fn(&Corrected) -> Vector3<f64>| {
        done().map(move |done| done.map(|done| of(done).into()))
    };
    let covariance = |done: Option<&Corrected>| {
        let matrix = done?.covariance;
        Some([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|place| matrix[place]))
    };
    let allowed = |done: Option<&Corrected>| done?.allowed.map(Exception::name);
    columns
        .group(
            ["correction_x_mm", "correction_y_mm", "correction_z_mm"],
            vectors(|done| done.correction),
        )
        .group(
            [
                "correction_sd_x_mm",
                "correction_sd_y_mm",
                "correction_sd_z_mm",
            ],
            vectors(Corrected::standard_deviation),
        )
        .column(
            "correction_sd_mm",
            done().map(|done| done.map(Corrected::standard_deviation_norm)),
        )
        .group(
            ["xx", "xy", "xz", "yy", "yz", "zz"]
                .map(|c| format!("correction_cov_{c}_mm2"))
                .each_ref()
                .map(String::as_str),
            done().map(covariance),
        )
        .column(
            "iterations",
            done().map(|done| done.map(|done| done.iterations)),
        )
        .column("allowed", done().map(allowed))
}
