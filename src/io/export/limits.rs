//! Limits of an exported geometry, as sentences for the file's comment and standard error: the parts of the error that
//! it leaves out, and the frames and lengths that no station determined. From `accuracy` and `parameters`, beside the
//! file of `calibrations`.

use std::path::Path;

use crate::figures::expanded;
use crate::fit::Identifiability;
use crate::lake::read_given;
use crate::report::{Angles, Model, Split};
use crate::rows::Row;
use crate::tables::accuracy::{AccuracyRow, BeforeAfter, FigureKind, FigureName};
use crate::tables::parameters::{BelongsTo, ParameterRow};
use crate::tables::words::{Role, Unit};

pub(super) struct Limits {
    pub dropped: String,
    pub not_identified: String,
}

impl Limits {
    pub(super) fn of(calibrations: &Path) -> Self {
        let rows = rows_beside::<ParameterRow>(calibrations);
        Self {
            dropped: dropped(calibrations),
            not_identified: rows.map_or_else(
                || {
                    "Which of base, flange and lengths are identified is in table parameters of the run, which is not beside this file."
                        .to_owned()
                },
                |rows| not_identified(&rows),
            ),
        }
    }

    pub(super) fn words(&self) -> String {
        format!("{} {}", self.not_identified, self.dropped)
    }
}

const BODIES: [(&str, BelongsTo, Option<Unit>); 3] = [
    ("base", BelongsTo::Base, None),
    ("flange", BelongsTo::Target, Some(Unit::Mm)),
    ("lengths", BelongsTo::Link, Some(Unit::Mm)),
];

/// A sentence that names the frames and lengths of the geometric model that are not identified, with their standard
/// errors.
fn not_identified(rows: &[ParameterRow]) -> String {
    let own = |row: &&ParameterRow| {
        row.model == Model::Geometric && row.identifiability != Identifiability::Identifiable
    };
    let found = BODIES.into_iter().filter_map(|(name, body, unit)| {
        let is_of = |row: &&ParameterRow| {
            row.belongs_to == body && unit.is_none_or(|unit| row.unit == unit)
        };
        let named: Vec<String> = rows.iter().filter(own).filter(is_of).map(value).collect();
        (!named.is_empty()).then(|| format!("{name} ({})", named.join(", ")))
    });
    let found: Vec<String> = found.collect();
    if found.is_empty() {
        return "Base, flange and lengths are identified.".to_owned();
    }
    format!(
        "Not identified by the stations are {}: each of these numbers is its prior's, or right only together with others of them (± two \
         standard errors). The arm's tool point is right where it was measured; its base, its flange or a length alone need not be.",
        found.join("; ")
    )
}

/// A parameter by its name, with twice its standard error.
fn value(row: &ParameterRow) -> String {
    let (unit, scale) = match row.unit {
        Unit::Mm => (" mm", 1.0),
        Unit::Rad => (" mrad", 1e3),
        Unit::One => ("", 1.0),
    };
    let session = row.of_session.as_ref();
    let session = session.map_or_else(String::new, |session| format!(" of {session}"));
    let error = row.standard_error;
    let error =
        error.map_or_else(String::new, |error| format!(" ± {:.3}{unit}", scale * expanded(error)));
    format!("{}{session}{error}", row.parameter)
}

/// The parts dropped and their cost, by table `accuracy` of the same run.
fn dropped(calibrations: &Path) -> String {
    let parts = "Not in it: joint curves, gear lines, gravity, drift and the difference of command and reported angle.";
    match figures(calibrations) {
        Some((geometric, full, n)) => format!(
            "{parts} On {n} held-out stations the geometry alone leaves a mean error of {geometric:.3} mm, the full error model {full:.3} mm."
        ),
        None => format!(
            "{parts} What that costs is in table accuracy of the run, which is not beside this file."
        ),
    }
}

/// The mean errors that the geometry alone and the full error model leave on held-out stations, and their number.
fn figures(calibrations: &Path) -> Option<(f64, f64, usize)> {
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
    Some((geometric, full?.0, n))
}

/// The rows of another table of the same run, of which a lake has TABLE/robot/session/run; `None` where that is not there.
fn rows_beside<R: Row>(calibrations: &Path) -> Option<Vec<R>> {
    let session = calibrations.parent()?;
    let robot = session.parent()?;
    let lake = robot.parent()?.parent()?;
    let same =
        Path::new(robot.file_name()?).join(session.file_name()?).join(calibrations.file_name()?);
    Some(R::read(&read_given(&lake.join(R::TABLE).join(same), R::schema()).ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tables::parameters::ParameterQuantity;

    fn row(parameter: &str, belongs_to: BelongsTo, unit: Unit, is_found: bool) -> ParameterRow {
        ParameterRow {
            model: Model::Geometric,
            parameter_index: 0,
            parameter: parameter.to_owned(),
            belongs_to,
            of_session: (belongs_to != BelongsTo::Link).then(|| "mon".to_owned()),
            joint: None,
            quantity: ParameterQuantity::X,
            unit,
            nominal: 0.0,
            offset: 0.0,
            identified: 0.0,
            standard_error: Some(0.0048),
            prior_sd: Some(0.005),
            identifiability: if is_found {
                Identifiability::Identifiable
            } else {
                Identifiability::Weak
            },
            confounded_with: Vec::new(),
            most_correlated_with: None,
            correlation: None,
        }
    }

    #[test]
    fn frames_and_lengths_that_are_not_identified_are_named() {
        let (mm, rad) = (Unit::Mm, Unit::Rad);
        let rows = [
            row("base_rz", BelongsTo::Base, rad, false),
            row("base_x", BelongsTo::Base, mm, true),
            row("target_z", BelongsTo::Target, mm, false),
            row("target_rx", BelongsTo::Target, rad, false),
            row("d_1", BelongsTo::Link, mm, false),
            row("theta_1", BelongsTo::Link, rad, false),
        ];
        let words = not_identified(&rows);
        let named = "Not identified by the stations are base (base_rz of mon ± 9.600 mrad); flange (target_z of mon ± 0.010 mm); \
                     lengths (d_1 ± 0.010 mm): ";
        assert!(words.starts_with(named), "{words}");
        assert_eq!(not_identified(&rows[1..2]), "Base, flange and lengths are identified.");
    }
}
