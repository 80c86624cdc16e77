use nalgebra::{Matrix3, Quaternion, UnitQuaternion};

use super::{CommonError, TableFile, common};
use crate::compensation::Terms;
use crate::geometry::symmetric;
use crate::grid::Interpolation;
use crate::tables::words::counted;

impl TableFile<'_> {
    pub(super) fn terms(&self) -> Result<Terms, CommonError> {
        let (own, valid_for) = (&self.own, &self.own.valid_for);
        let [x, y, z, w] = own.turn;
        let turn = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
        Ok(Terms {
            table_id: own.table_id.clone(),
            orientation: common::rotation(self.path, "qw", &turn)?,
            orientation_tolerance_rad: own.orientation_tolerance_deg.to_radians(),
            configuration: own.configuration.clone(),
            interpolation: own.interpolation,
            idw_power: self.idw_power()?,
            interpolation_mm2: self.interpolation_mm2()?,
            validity: valid_for.validity(),
            frame: valid_for.error_frame.stated().uncertainty(),
            counted: counted(valid_for.joint_units.as_deref()),
        })
    }

    /// Zero where the table does not state it.
    fn interpolation_mm2(&self) -> Result<Matrix3<f64>, CommonError> {
        let given = self.own.interpolation_moment_mm2.unwrap_or_default();
        let [xx, _, _, yy, _, zz] = given;
        if xx.min(yy).min(zz) < 0.0 {
            let negative = format!("{xx}, {yy} and {zz} mm² on its diagonal");
            return Err(common::value_error(self.path, "interpolation_moment", negative));
        }
        Ok(symmetric(given))
    }

    fn idw_power(&self) -> Result<f64, CommonError> {
        match (self.own.interpolation, self.own.idw_power) {
            (Interpolation::Trilinear, power) => Ok(power.unwrap_or_default()),
            (Interpolation::Idw, Some(power)) if power > 0.0 => Ok(power),
            (Interpolation::Idw, power) => {
                let problem = format!("{power:?}, and interpolation by idw needs a positive one");
                Err(common::value_error(self.path, "idw_power", problem))
            }
        }
    }
}
