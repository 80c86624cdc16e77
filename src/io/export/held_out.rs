//! Errors that a geometry alone leaves on held-out stations, and that the full error model leaves: the cost of the
//! parts that an export drops.

use std::path::Path;

use crate::lake::read_given;
use crate::report::{Angles, Model, Split};
use crate::rows::Row;
use crate::tables::accuracy::{AccuracyRow, BeforeAfter, FigureKind, FigureName};
use crate::tables::words::Role;

struct HeldOut {
    geometric: f64,
    full: f64,
    n: usize,
}

/// The parts dropped and their cost, by table `accuracy` of the same run.
pub fn dropped(calibrations: &Path) -> String {
    let parts = "Not in it: joint curves, gear lines, gravity, drift and the difference of command and reported angle.";
    match figures(calibrations) {
        Some(HeldOut { geometric, full, n }) => format!(
            "{parts} On {n} held-out stations the geometry alone leaves a mean error of {geometric:.3} mm, the full error model {full:.3} mm."
        ),
        None => format!(
            "{parts} What that costs is in table accuracy of the run, which is not beside this file."
        ),
    }
}

fn figures(calibrations: &Path) -> Option<HeldOut> {
    let rows = rows_beside::<AccuracyRow>(calibrations)?;
    let mean = |model: Model, angles: Angles| {
        let is_wanted = |row: &&AccuracyRow| {
            (row.subject.split, row.role, row.subject.model, row.subject.angles)
                == (Split::Blocks, Role::HeldOut, model, angles)
                && (row.moment, row.quantity, row.name)
                    == (BeforeAfter::After, FigureKind::PositionError, FigureName::Mean)
        };
        let row = rows.iter().find(is_wanted)?;
        Some((row.value?, row.n))
    };
    let (geometric, n) = mean(Model::Geometric, Angles::Reported)?;
    // With commands in the logs, the full error model takes the angles between command and report.
    let full = mean(Model::Full, Angles::Weighted).or_else(|| mean(Model::Full, Angles::Reported));
    let (full, _) = full?;
    Some(HeldOut { geometric, full, n })
}

/// The rows of another table of the same run, of which a lake has TABLE/robot/session/run; `None` where that is not there.
pub(super) fn rows_beside<R: Row>(calibrations: &Path) -> Option<Vec<R>> {
    let session = calibrations.parent()?;
    let robot = session.parent()?;
    let lake = robot.parent()?.parent()?;
    let same =
        Path::new(robot.file_name()?).join(session.file_name()?).join(calibrations.file_name()?);
    Some(R::read(&read_given(&lake.join(R::TABLE).join(same), R::schema()).ok()?))
}
