//! What a table says of itself: columns that hold the same value in every row.

use std::fmt::Debug;

use arrow::array::Array as _;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use super::{CompensationTableError, TableFile, TableVerdict};
use crate::compensation::{Terms, Validity};
use crate::geometry::{Base, Command, Transform};
use crate::grid::Interpolation;
use crate::manifest::RunKey;

/// A quaternion further from unit norm than this is none.
const UNIT_NORM: f64 = 1e-6;

impl TableFile<'_> {
    pub(super) fn terms(&self) -> Result<Terms, CompensationTableError> {
        // The schema allows the two words only.
        let interpolation = match self.text("interpolation")?.as_str() {
            "idw" => Interpolation::Idw,
            _ => Interpolation::Trilinear,
        };
        Ok(Terms {
            table_id: self.text("table_id")?,
            orientation: self.orientation()?,
            orientation_tolerance_rad: self.number("orientation_tolerance_deg")?.to_radians(),
            configuration: self.optional_text("configuration")?,
            interpolation,
            idw_power: self.idw_power(interpolation)?,
            validity: self.validity()?,
        })
    }

    pub(super) fn key(&self) -> Result<RunKey, CompensationTableError> {
        let [robot, session, run] = ["robot", "session", "run"].map(|part| self.text(part));
        Ok(RunKey::new(&robot?, &session?, &run?))
    }

    pub(super) fn verdict(&self) -> Result<TableVerdict, CompensationTableError> {
        Ok(match self.text("verdict")?.as_str() {
            "met" => TableVerdict::Met,
            "not_met" => TableVerdict::NotMet,
            _ => TableVerdict::NotShown,
        })
    }

    fn orientation(&self) -> Result<UnitQuaternion<f64>, CompensationTableError> {
        self.one("orientation", |row| {
            Some(self.table.i64("orientation").value(row))
        })?;
        self.rotation(["qx", "qy", "qz", "qw"])
    }

    /// Where the base frame lies in the frame of commands.
    pub(super) fn command_from_base(
        &self,
    ) -> Result<Transform<Command, Base>, CompensationTableError> {
        let [x, y, z] =
            ["x", "y", "z"].map(|axis| self.number(&format!("command_from_base_{axis}_mm")));
        let turn = ["x", "y", "z", "w"].map(|part| format!("command_from_base_q{part}"));
        let rotation = self.rotation(turn.each_ref().map(String::as_str))?;
        let origin = Translation3::new(x?, y?, z?);
        Ok(Transform::claim(Isometry3::from_parts(origin, rotation)))
    }

    fn rotation(&self, columns: [&str; 4]) -> Result<UnitQuaternion<f64>, CompensationTableError> {
        let [x, y, z, w] = columns.map(|part| self.number(part));
        let quaternion = Quaternion::new(w?, x?, y?, z?);
        let norm = quaternion.norm();
        if (norm - 1.0).abs() > UNIT_NORM {
            let problem = format!("the quaternion has norm {norm}, a rotation has norm 1");
            return Err(self.value_error(columns[3], problem));
        }
        Ok(UnitQuaternion::from_quaternion(quaternion))
    }

    fn idw_power(&self, interpolation: Interpolation) -> Result<f64, CompensationTableError> {
        let power = self.optional_number("idw_power")?;
        match (interpolation, power) {
            (Interpolation::Trilinear, _) => Ok(power.unwrap_or_default()),
            (Interpolation::Idw, Some(power)) if power > 0.0 => Ok(power),
            (Interpolation::Idw, _) => Err(self.value_error(
                "idw_power",
                format!("{power:?}, and interpolation by idw needs a positive one"),
            )),
        }
    }

    fn validity(&self) -> Result<Validity, CompensationTableError> {
        let option = "absolute_accuracy_option";
        let flags = self.table.bool(option);
        let low = self.optional_number("temperature_min_c")?;
        let high = self.optional_number("temperature_max_c")?;
        Ok(Validity {
            tool: self.optional_text("tool")?,
            payload_kg: self.optional_number("payload_kg")?,
            mounting: self.optional_text("mounting")?,
            base: self.optional_text("base")?,
            controller_model: self.optional_text("controller_model")?,
            absolute_accuracy_option: self
                .one(option, |row| flags.is_valid(row).then(|| flags.value(row)))?,
            temperature_c: low.zip(high).map(<[f64; 2]>::from),
        })
    }

    pub(super) fn positive(&self, column: &str) -> Result<f64, CompensationTableError> {
        let value = self.number(column)?;
        if value > 0.0 {
            return Ok(value);
        }
        Err(self.value_error(column, format!("{value} is not positive")))
    }

    fn number(&self, column: &str) -> Result<f64, CompensationTableError> {
        let value = self.optional_number(column)?;
        Ok(value.expect("the schema has no nulls in this column"))
    }

    fn text(&self, column: &str) -> Result<String, CompensationTableError> {
        let value = self.optional_text(column)?;
        Ok(value.expect("the schema has no nulls in this column"))
    }

    fn optional_number(&self, column: &str) -> Result<Option<f64>, CompensationTableError> {
        let numbers = self.table.f64(column);
        self.one(column, |row| {
            numbers.is_valid(row).then(|| numbers.value(row))
        })
    }

    fn optional_text(&self, column: &str) -> Result<Option<String>, CompensationTableError> {
        let texts = self.table.text(column);
        let text = self.one(column, |row| texts.is_valid(row).then(|| texts.value(row)))?;
        Ok(text.map(str::to_owned))
    }

    /// The value that every row has.
    fn one<T: PartialEq + Debug>(
        &self,
        column: &str,
        value: impl Fn(usize) -> Option<T>,
    ) -> Result<Option<T>, CompensationTableError> {
        let first = value(0);
        match (1..self.table.rows()).find(|&row| value(row) != first) {
            None => Ok(first),
            Some(node) => Err(CompensationTableError::NotOne {
                path: self.path.to_owned(),
                column: column.to_owned(),
                first: shown(first.as_ref()),
                node,
                other: shown(value(node).as_ref()),
            }),
        }
    }
}

fn shown<T: Debug>(value: Option<&T>) -> String {
    value.map_or_else(|| "none".to_owned(), |value| format!("{value:?}"))
}
