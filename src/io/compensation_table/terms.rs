//! What a table says of itself: columns that hold the same value in every row.

use nalgebra::Matrix3;

use super::{CommonError, TableFile, TableVerdict};
use crate::common::Corrects as _;
use crate::compensation::Terms;
use crate::geometry::symmetric;
use crate::grid::Interpolation;
use crate::tables::words::counted;

impl TableFile<'_> {
    pub(super) fn terms(&self) -> Result<Terms, CommonError> {
        let said = self.said();
        said.one("orientation", |row| Some(row.orientation))?;
        said.one("table_id", |row| Some(&row.table_id))?;
        said.one("orientation_tolerance_deg", |row| Some(row.orientation_tolerance_deg))?;
        said.one("interpolation", |row| Some(row.interpolation))?;
        let configuration = said.one("configuration", |row| row.configuration.as_deref())?;
        let first = &self.rows[0];
        Ok(Terms {
            table_id: first.table_id.to_string(),
            orientation: said.rotation("", |row| row.turn)?,
            orientation_tolerance_rad: first.orientation_tolerance_deg.to_radians(),
            configuration: configuration.map(str::to_owned),
            interpolation: first.interpolation,
            idw_power: self.idw_power(first.interpolation)?,
            interpolation_mm2: self.interpolation_mm2()?,
            validity: said.validity()?,
            frame: first.stated_frame().uncertainty(),
            counted: counted(first.joint_units.as_deref()),
        })
    }

    pub(super) fn verdict(&self) -> Result<TableVerdict, CommonError> {
        self.said().one("verdict", |row| Some(row.verdict))?;
        Ok(self.rows[0].verdict)
    }

    /// Zero where the table does not state it.
    fn interpolation_mm2(&self) -> Result<Matrix3<f64>, CommonError> {
        let said = self.said();
        let given = said.one("interpolation_moment", |row| row.interpolation_moment_mm2)?;
        let [xx, _, _, yy, _, zz] = given.unwrap_or_default();
        if xx.min(yy).min(zz) < 0.0 {
            let negative =
                format!("{xx}, {yy} and {zz} mm² on its diagonal; run the session again");
            return Err(said.value_error("interpolation_moment", negative));
        }
        Ok(symmetric(given.unwrap_or_default()))
    }

    fn idw_power(&self, interpolation: Interpolation) -> Result<f64, CommonError> {
        let power = self.said().one("idw_power", |row| row.idw_power)?;
        match (interpolation, power) {
            (Interpolation::Trilinear, _) => Ok(power.unwrap_or_default()),
            (Interpolation::Idw, Some(power)) if power > 0.0 => Ok(power),
            (Interpolation::Idw, _) => Err(self.said().value_error(
                "idw_power",
                format!("{power:?}, and interpolation by idw needs a positive one"),
            )),
        }
    }
}
