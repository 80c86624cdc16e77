//! What a published table says of itself: columns that hold the same value in every row, read back.

use std::fmt::Debug;
use std::path::{Path, PathBuf};

use arrow::array::{Array as _, AsArray as _};
use arrow::datatypes::Float64Type;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use thiserror::Error;

use super::table::{Table, Word};
use crate::compensation::{Conditions, Validity};
use crate::geometry::Transform;
use crate::manifest::RunKey;

/// A quaternion further from unit norm than this is none.
const UNIT_NORM: f64 = 1e-6;

/// Why a table does not say one thing of itself.
#[derive(Debug, Error)]
pub enum CommonError {
    /// Rows of several tables.
    #[error(
        "{path}, column {column:?}: row 0 has {first} and row {row} has {other}, and every row has the same there: take \
         the file of a single run"
    )]
    NotOne {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// Row 0's value.
        first: String,
        /// The row that differs.
        row: usize,
        /// Its value.
        other: String,
    },
    /// A value that no such table has.
    #[error("{path}, column {column:?}: {problem}; run the session again")]
    Value {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// What is wrong with it.
        problem: String,
    },
}

/// A table with at least one row, and the file that it was read from.
#[derive(Clone, Copy)]
pub struct Common<'t> {
    /// The file.
    pub path: &'t Path,
    /// The table.
    pub table: &'t Table,
}

impl Common<'_> {
    /// The run that wrote it.
    pub fn key(self) -> Result<RunKey, CommonError> {
        let [robot, session, run] = ["robot", "session", "run"].map(|part| self.text(part));
        Ok(RunKey::new(&robot?, &session?, &run?))
    }

    /// What it is valid for.
    pub fn validity(self) -> Result<Validity, CommonError> {
        let option = "absolute_accuracy_option";
        let flags = self.table.bool(option);
        let low = self.optional_number("temperature_min_c")?;
        let high = self.optional_number("temperature_max_c")?;
        let conditions = Conditions {
            tool: self.optional_text("tool")?,
            payload_kg: self.optional_number("payload_kg")?,
            mounting: self.optional_text("mounting")?,
            base: self.optional_text("base")?,
            controller_model: self.optional_text("controller_model")?,
            absolute_accuracy_option: self
                .one(option, |row| flags.is_valid(row).then(|| flags.value(row)))?,
        };
        Ok(Validity {
            conditions,
            temperature_c: low.zip(high).map(<[f64; 2]>::from),
        })
    }

    /// A placement: the columns `FRAME_x_mm` … `FRAME_qw`.
    pub fn placement<To, From>(self, frame: &str) -> Result<Transform<To, From>, CommonError> {
        let [x, y, z] = ["x", "y", "z"].map(|axis| self.number(&format!("{frame}_{axis}_mm")));
        let rotation = self.rotation(&format!("{frame}_"))?;
        let origin = Translation3::new(x?, y?, z?);
        Ok(Transform::claim(Isometry3::from_parts(origin, rotation)))
    }

    /// A rotation: the columns `qx` … `qw` behind a prefix.
    pub fn rotation(self, prefix: &str) -> Result<UnitQuaternion<f64>, CommonError> {
        let columns = ["x", "y", "z", "w"].map(|part| format!("{prefix}q{part}"));
        let [x, y, z, w] = columns.each_ref().map(|column| self.number(column));
        let quaternion = Quaternion::new(w?, x?, y?, z?);
        let norm = quaternion.norm();
        if (norm - 1.0).abs() > UNIT_NORM {
            let problem = format!("the quaternion has norm {norm}, a rotation has norm 1");
            return Err(self.value_error(&columns[3], problem));
        }
        Ok(UnitQuaternion::from_quaternion(quaternion))
    }

    /// Lowest and highest reported angle of each of so many joints over the stations used, rad.
    pub(super) fn joint_ranges(self, joints: usize) -> Result<Vec<[f64; 2]>, CommonError> {
        let list = |column: &str| -> Result<Vec<f64>, CommonError> {
            let lists = self.table.list(column);
            let row = |row| {
                let list = lists.value(row);
                Some(list.as_primitive::<Float64Type>().values().to_vec())
            };
            let angles = self.one(column, row)?.unwrap_or_default();
            if angles.len() == joints {
                return Ok(angles);
            }
            let problem = format!("{} angles for an arm of {joints} joints", angles.len());
            Err(self.value_error(column, problem))
        };
        let (lower, upper) = (list("joint_lower_rad")?, list("joint_upper_rad")?);
        Ok(lower.into_iter().zip(upper).map(<[f64; 2]>::from).collect())
    }

    /// A list of texts.
    pub fn texts(self, column: &str) -> Result<Vec<String>, CommonError> {
        let lists = self.table.list(column);
        let row = |row| {
            let list = lists.value(row);
            let texts = list.as_string::<i32>().iter().flatten();
            Some(texts.map(str::to_owned).collect::<Vec<_>>())
        };
        Ok(self.one(column, row)?.unwrap_or_default())
    }

    /// A number above zero.
    pub fn positive(self, column: &str) -> Result<f64, CommonError> {
        let value = self.number(column)?;
        if value > 0.0 {
            return Ok(value);
        }
        Err(self.value_error(column, format!("{value} is not positive")))
    }

    /// A number.
    pub fn number(self, column: &str) -> Result<f64, CommonError> {
        let value = self.optional_number(column)?;
        Ok(value.expect("the schema has no nulls in this column"))
    }

    /// A text.
    pub fn text(self, column: &str) -> Result<String, CommonError> {
        let value = self.optional_text(column)?;
        Ok(value.expect("the schema has no nulls in this column"))
    }

    /// The value of an enumeration.
    pub fn word<W: Word>(self, column: &str) -> Result<W, CommonError> {
        let word = W::of_word(&self.text(column)?);
        Ok(word.expect("a test holds the words that the schema allows against the enumeration"))
    }

    /// A number, or null.
    pub fn optional_number(self, column: &str) -> Result<Option<f64>, CommonError> {
        let numbers = self.table.f64(column);
        self.one(column, |row| {
            numbers.is_valid(row).then(|| numbers.value(row))
        })
    }

    /// A text, or null.
    pub fn optional_text(self, column: &str) -> Result<Option<String>, CommonError> {
        let texts = self.table.text(column);
        let text = self.one(column, |row| texts.is_valid(row).then(|| texts.value(row)))?;
        Ok(text.map(str::to_owned))
    }

    /// The value that every row has.
    pub fn one<T: PartialEq + Debug>(
        self,
        column: &str,
        value: impl Fn(usize) -> Option<T>,
    ) -> Result<Option<T>, CommonError> {
        let first = value(0);
        match (1..self.table.rows()).find(|&row| value(row) != first) {
            None => Ok(first),
            Some(row) => Err(CommonError::NotOne {
                path: self.path.to_owned(),
                column: column.to_owned(),
                first: shown(first.as_ref()),
                row,
                other: shown(value(row).as_ref()),
            }),
        }
    }

    /// That a column's value is none such a table has.
    pub(super) fn value_error(self, column: &str, problem: String) -> CommonError {
        CommonError::Value {
            path: self.path.to_owned(),
            column: column.to_owned(),
            problem,
        }
    }
}

fn shown<T: Debug>(value: Option<&T>) -> String {
    value.map_or_else(|| "none".to_owned(), |value| format!("{value:?}"))
}
