//! What a table says of itself: columns that hold the same value in every row.

use super::{CommonError, TableFile, TableVerdict};
use crate::compensation::Terms;
use crate::grid::Interpolation;

impl TableFile<'_> {
    pub(super) fn terms(&self) -> Result<Terms, CommonError> {
        let said = self.said();
        said.one("orientation", |row| {
            Some(self.table.i64("orientation").value(row))
        })?;
        let interpolation: Interpolation = said.word("interpolation")?;
        Ok(Terms {
            table_id: said.text("table_id")?,
            orientation: said.rotation("")?,
            orientation_tolerance_rad: said.number("orientation_tolerance_deg")?.to_radians(),
            configuration: said.optional_text("configuration")?,
            interpolation,
            idw_power: self.idw_power(interpolation)?,
            validity: said.validity()?,
        })
    }

    pub(super) fn verdict(&self) -> Result<TableVerdict, CommonError> {
        self.said().word("verdict")
    }

    fn idw_power(&self, interpolation: Interpolation) -> Result<f64, CommonError> {
        let power = self.said().optional_number("idw_power")?;
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
