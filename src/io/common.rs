//! What a published table says of itself: columns that hold the same value in every row, read back.

use std::fmt::Debug;
use std::path::Path;

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};
use thiserror::Error;

use super::schema::KEY_COLUMNS;
use super::table::Table;
use crate::at::At;
use crate::compensation::{Conditions, Validity};
use crate::geometry::{Base, Command, Transform};
use crate::manifest::RunKey;
use crate::report::frame::StatedFrame;

/// A quaternion further from unit norm than this is none.
const UNIT_NORM: f64 = 1e-6;

/// Why a table does not say one thing of itself.
#[derive(Debug, Error)]
pub enum CommonError {
    /// Rows of several tables.
    #[error("{0}, and every row has the same there: take the file of a single run")]
    NotOne(At<String>),
    /// A value that no such table has.
    #[error("{0}; run the session again")]
    Value(At<String>),
}

/// A table with at least one row, read as rows, and the file that it was read from.
pub struct Common<'t, R> {
    pub path: &'t Path,
    pub rows: &'t [R],
}

impl<R> Clone for Common<'_, R> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<R> Copy for Common<'_, R> {}

/// What a row states of its table's validity; absent: not stated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stated<'r> {
    pub tool: Option<&'r str>,
    pub payload_kg: Option<f64>,
    pub mounting: Option<&'r str>,
    pub base: Option<&'r str>,
    pub controller_model: Option<&'r str>,
    /// Whether the controller's own compensation is on.
    pub absolute_accuracy_option: Option<bool>,
    /// Lowest and highest temperature met while measuring, °C.
    pub temperature_c: [Option<f64>; 2],
    /// Largest error of the stations before correction, mm.
    pub largest_error_mm: Option<f64>,
}

/// A row of a table that commands are corrected by.
pub trait Corrects {
    /// The terms of validity that the row states.
    fn stated(&self) -> Stated<'_>;

    /// Frame of the base in the frame of commands: origin, mm, and orientation, x y z w.
    fn command_from_base(&self) -> ([f64; 3], [f64; 4]);

    /// The base frame that its errors hold in.
    fn stated_frame(&self) -> StatedFrame;

    /// Lowest and highest reported angle of each joint over the stations used, rad.
    fn joint_ranges(&self) -> [&[f64]; 2];
}

/// Implements [`Corrects`] for rows with the columns of that name.
macro_rules! corrects {
    ($row:ty) => {
        impl $crate::common::Corrects for $row {
            fn stated(&self) -> $crate::common::Stated<'_> {
                $crate::common::Stated {
                    tool: self.tool.as_deref(),
                    payload_kg: self.payload_kg,
                    mounting: self.mounting.as_deref(),
                    base: self.base.as_deref(),
                    controller_model: self.controller_model.as_deref(),
                    absolute_accuracy_option: self.absolute_accuracy_option,
                    temperature_c: [self.temperature_min_c, self.temperature_max_c],
                    largest_error_mm: self.largest_error_mm,
                }
            }

            fn command_from_base(&self) -> ([f64; 3], [f64; 4]) {
                (self.command_from_base, self.command_from_base_turn)
            }

            fn stated_frame(&self) -> $crate::report::frame::StatedFrame {
                $crate::tables::error_frame::stated(
                    self.error_frame,
                    (self.error_frame_base, self.error_frame_base_turn),
                    [self.error_frame_sd_mm, self.error_frame_sd_deg, self.error_frame_lever_sd_mm],
                )
            }

            fn joint_ranges(&self) -> [&[f64]; 2] {
                [&self.joint_lower_rad, &self.joint_upper_rad]
            }
        }
    };
}
pub(crate) use corrects;

impl<R: Corrects> Common<'_, R> {
    /// What the table is valid for.
    pub fn validity(self) -> Result<Validity, CommonError> {
        let text = |column, of: fn(Stated<'_>) -> Option<&str>| {
            let text = self.one(column, |row| of(row.stated()))?;
            Ok::<_, CommonError>(text.map(str::to_owned))
        };
        let number =
            |column, of: fn(Stated<'_>) -> Option<f64>| self.one(column, |row| of(row.stated()));
        let low = number("temperature_min_c", |own| own.temperature_c[0])?;
        let high = number("temperature_max_c", |own| own.temperature_c[1])?;
        let conditions = Conditions {
            tool: text("tool", |own| own.tool)?,
            payload_kg: number("payload_kg", |own| own.payload_kg)?,
            mounting: text("mounting", |own| own.mounting)?,
            base: text("base", |own| own.base)?,
            controller_model: text("controller_model", |own| own.controller_model)?,
            absolute_accuracy_option: self
                .one("absolute_accuracy_option", |row| row.stated().absolute_accuracy_option)?,
        };
        Ok(Validity {
            conditions,
            temperature_c: low.zip(high).map(<[f64; 2]>::from),
            largest_error_mm: number("largest_error_mm", |own| own.largest_error_mm)?,
        })
    }

    /// The frame of the base in the frame of commands.
    pub fn command_from_base(self) -> Result<Transform<Command, Base>, CommonError> {
        self.placement("command_from_base", R::command_from_base)
    }

    /// Lowest and highest reported angle of each of so many joints over the stations used, rad.
    pub(super) fn joint_ranges(self, joints: usize) -> Result<Vec<[f64; 2]>, CommonError> {
        let list = |column: &str, end: usize| -> Result<&[f64], CommonError> {
            let angles = self.one(column, |row| Some(row.joint_ranges()[end]))?;
            let angles = angles.unwrap_or_default();
            if angles.len() == joints {
                return Ok(angles);
            }
            let problem = format!("{} angles for an arm of {joints} joints", angles.len());
            Err(self.value_error(column, problem))
        };
        let (lower, upper) = (list("joint_lower_rad", 0)?, list("joint_upper_rad", 1)?);
        let ranges = lower.iter().copied().zip(upper.iter().copied());
        Ok(ranges.map(<[f64; 2]>::from).collect())
    }
}

impl<'t, R> Common<'t, R> {
    /// A placement that every row has in the columns `FRAME_x_mm` … `FRAME_qw`.
    pub fn placement<To, From>(
        self,
        frame: &str,
        of: impl Fn(&R) -> ([f64; 3], [f64; 4]),
    ) -> Result<Transform<To, From>, CommonError> {
        let origin = self.position(frame, |row| of(row).0)?;
        let rotation = self.rotation(&format!("{frame}_"), |row| of(row).1)?;
        let origin = Translation3::from(origin.coords);
        Ok(Transform::claim(Isometry3::from_parts(origin, rotation)))
    }

    /// A position that every row has in the columns `FRAME_x_mm` … `FRAME_z_mm`, mm.
    pub fn position(
        self,
        frame: &str,
        of: impl Fn(&R) -> [f64; 3],
    ) -> Result<Point3<f64>, CommonError> {
        let columns = ["x", "y", "z"].map(|axis| format!("{frame}_{axis}_mm"));
        Ok(Point3::from(self.numbers(&columns, of)?))
    }

    /// A rotation that every row has in the columns `qx` … `qw` behind a prefix.
    pub fn rotation(
        self,
        prefix: &str,
        of: impl Fn(&R) -> [f64; 4],
    ) -> Result<UnitQuaternion<f64>, CommonError> {
        let columns = ["x", "y", "z", "w"].map(|part| format!("{prefix}q{part}"));
        let [x, y, z, w] = self.numbers(&columns, of)?;
        let quaternion = Quaternion::new(w, x, y, z);
        let norm = quaternion.norm();
        if (norm - 1.0).abs() > UNIT_NORM {
            let problem = format!("the quaternion has norm {norm}, a rotation has norm 1");
            return Err(self.value_error(&columns[3], problem));
        }
        Ok(UnitQuaternion::from_quaternion(quaternion))
    }

    /// Numbers that every row has in these columns; each above zero.
    pub fn positive<const N: usize>(
        self,
        columns: &[String; N],
        of: impl Fn(&R) -> [f64; N],
    ) -> Result<[f64; N], CommonError> {
        let values = self.numbers(columns, of)?;
        match columns.iter().zip(values).find(|(_, value)| *value <= 0.0) {
            None => Ok(values),
            Some((column, value)) => {
                Err(self.value_error(column, format!("{value} is not positive")))
            }
        }
    }

    /// Numbers that every row has in these columns.
    fn numbers<const N: usize>(
        self,
        columns: &[String; N],
        of: impl Fn(&R) -> [f64; N],
    ) -> Result<[f64; N], CommonError> {
        for (place, column) in columns.iter().enumerate() {
            self.one(column, |row| Some(of(row)[place]))?;
        }
        Ok(of(&self.rows[0]))
    }

    /// The value that every row has in a column.
    pub fn one<T: PartialEq + Debug>(
        self,
        column: &str,
        value: impl Fn(&'t R) -> Option<T>,
    ) -> Result<Option<T>, CommonError> {
        one(self.path, column, self.rows.len(), |row| value(&self.rows[row]))
    }

    /// That a column's value is none such a table has.
    pub(super) fn value_error(self, column: &str, problem: String) -> CommonError {
        CommonError::Value(in_column(self.path, column, problem))
    }
}

/// The run that wrote every row of the table at `path`, which has at least one.
pub fn key(path: &Path, table: &Table) -> Result<RunKey, CommonError> {
    let part = |column: &'static str| {
        let texts = table.text(column);
        let text = one(path, column, table.rows(), |row| Some(texts.value(row)))?;
        Ok::<_, CommonError>(text.unwrap_or_default())
    };
    let [robot, session, run] = KEY_COLUMNS.map(part);
    Ok(RunKey::new(robot?, session?, run?))
}

/// The value that every row has, of a column of so many; `None` without a row too.
fn one<T: PartialEq + Debug>(
    path: &Path,
    column: &str,
    rows: usize,
    value: impl Fn(usize) -> Option<T>,
) -> Result<Option<T>, CommonError> {
    if rows == 0 {
        return Ok(None);
    }
    let first = value(0);
    match (1..rows).find(|&row| value(row) != first) {
        None => Ok(first),
        Some(row) => {
            let (first, other) = (shown(first.as_ref()), shown(value(row).as_ref()));
            let problem = format!("row 0 has {first} and row {row} has {other}");
            Err(CommonError::NotOne(in_column(path, column, problem)))
        }
    }
}

fn in_column(path: &Path, column: &str, problem: String) -> At<String> {
    At::new(format!("{}, column {column:?}", path.display()), problem)
}

fn shown<T: Debug>(value: Option<&T>) -> String {
    value.map_or_else(|| "none".to_owned(), |value| format!("{value:?}"))
}
