//! What a published table says of itself: columns that hold the same value in every row, read back.

use std::path::Path;

use arrow_array::Array as _;
use nalgebra::{Isometry3, UnitQuaternion};
use thiserror::Error;

use super::tables::validity::ValidFor;
use crate::at::At;
use crate::geometry::Transform;
use crate::manifest::RunKey;
use crate::rows::{Field, columns};
use crate::table::{Table, values};

/// A quaternion further from unit norm than this is none.
const UNIT_NORM: f64 = 1e-6;

#[derive(Debug, Error)]
pub enum CommonError {
    #[error("{0}, and every row has the same there: take the file of a single run")]
    NotOne(At<String>),
    #[error("{0}; run the session again")]
    Value(At<String>),
}

/// The columns that each of a table's rows states, which all of them state alike.
pub fn of_every_row<'r, C: Field + PartialEq>(
    path: &Path,
    table: &Table,
    rows: impl IntoIterator<Item = &'r C>,
) -> Result<&'r C, CommonError> {
    let mut rows = rows.into_iter();
    let none = || CommonError::Value(At::new(path.display(), "it has no row".to_owned()));
    let first = rows.next().ok_or_else(none)?;
    match rows.position(|own| own != first) {
        None => Ok(first),
        Some(other) => Err(CommonError::NotOne(first_difference::<C>(path, table, other + 1))),
    }
}

/// Names the first column of `C` whose cell in `row` is not that of row 0.
fn first_difference<C: Field>(path: &Path, table: &Table, row: usize) -> At<String> {
    let batch = table.batch();
    let shown = |name: &str, row: usize| {
        let array = batch.column_by_name(name)?;
        array.is_valid(row).then(|| values::text(array, row))?
    };
    let mut names = C::columns(&[]).into_iter().map(|column| column.name);
    let name = names.find(|name| shown(name, 0) != shown(name, row)).unwrap_or_default();
    let [one, another] = [0, row].map(|row| match shown(name, row).as_deref() {
        None | Some("") => "none".to_owned(),
        Some(text) => text.to_owned(),
    });
    let problem = format!("row 0 has {one} and row {row} has {another}");
    in_column(path, name, problem)
}

columns! {
    of RunKey {
        robot: String,
        session: String,
        run: String,
    }
}

/// The run that wrote every row of the table at `path`, which has at least one.
pub fn key(path: &Path, table: &Table) -> Result<RunKey, CommonError> {
    let keys: Vec<RunKey> = RunKey::all(table, &[]).collect();
    of_every_row(path, table, &keys).cloned()
}

pub fn placement<To, From>(
    path: &Path,
    frame: &str,
    stated: &Isometry3<f64>,
) -> Result<Transform<To, From>, CommonError> {
    let rotation = rotation(path, &format!("{frame}_qw"), &stated.rotation)?;
    Ok(Transform::claim(Isometry3::from_parts(stated.translation, rotation)))
}

pub fn rotation(
    path: &Path,
    column: &str,
    stated: &UnitQuaternion<f64>,
) -> Result<UnitQuaternion<f64>, CommonError> {
    let norm = stated.quaternion().norm();
    if (norm - 1.0).abs() > UNIT_NORM {
        let problem = format!("the quaternion has norm {norm}, a rotation has norm 1");
        return Err(value_error(path, column, problem));
    }
    Ok(UnitQuaternion::from_quaternion(stated.into_inner()))
}

/// Lowest and highest reported angle of each of so many joints over the stations used, rad.
pub(super) fn joint_ranges(
    path: &Path,
    valid_for: &ValidFor,
    joints: usize,
) -> Result<Vec<[f64; 2]>, CommonError> {
    for (column, angles) in [
        ("joint_lower_rad", &valid_for.joint_lower_rad),
        ("joint_upper_rad", &valid_for.joint_upper_rad),
    ] {
        if angles.len() != joints {
            let problem = format!("{} angles for an arm of {joints} joints", angles.len());
            return Err(value_error(path, column, problem));
        }
    }
    Ok(valid_for.joint_ranges())
}

/// That a column's value is none such a table has.
pub(super) fn value_error(path: &Path, column: &str, problem: String) -> CommonError {
    CommonError::Value(in_column(path, column, problem))
}

fn in_column(path: &Path, column: &str, problem: String) -> At<String> {
    At::new(format!("{}, column {column:?}", path.display()), problem)
}
