//! The orientation of a target, by the form that turns with the arm.

use nalgebra::UnitQuaternion;

use super::{Doubt, Key, Work};
use crate::ingest::{OrientationColumns, OrientationForm};
use crate::inspect::table::choices::Target;
use crate::inspect::table::columns::largest;
use crate::inspect::table::turns::{Form, turned};

const MOST_NAMED: usize = 4;

impl Work<'_> {
    /// The columns of a target's orientation; `None` where it has none, or none that turns with the arm.
    pub(super) fn orientation(
        &self,
        target: &Target,
        doubts: &mut Vec<Doubt>,
    ) -> Option<OrientationColumns> {
        let columns = target.turn.as_ref()?;
        let mut doubt = |words: String| {
            doubts.push(Doubt { key: Key::Orientation, words });
        };
        let Some(placement) = self.placement else {
            let largest = largest(self.columns, columns.columns().iter().copied());
            let form = Form::all(columns, largest).into_iter().next()?;
            doubt("no arm tells the order of axes and the unit: this is the most usual one for such numbers".to_owned());
            return Some(self.columns_of(&form, target.turn_sd));
        };
        let turn = placement.tracker_from_base.rotation;
        let flanges: Vec<(usize, UnitQuaternion<f64>)> =
            self.flanges.iter().map(|(row, flange)| (*row, turn * flange.rotation)).collect();
        let Some(found) = turned(self.table, columns, &flanges) else {
            doubt("it is left out: no order of axes turns with the arm".to_owned());
            return None;
        };
        if !found.as_good.is_empty() {
            let words: Vec<String> =
                found.as_good.iter().take(MOST_NAMED).map(Form::in_words).collect();
            let (deg, words) = (found.median_rad.to_degrees(), words.join(", "));
            doubt(format!("these agree with the arm as well ({deg:.2}°): {words}"));
        }
        Some(self.columns_of(&found.form, target.turn_sd))
    }

    pub(super) fn columns_of(&self, form: &Form, sd: Option<[usize; 3]>) -> OrientationColumns {
        let name = |column: usize| self.names[column].clone();
        let form = match *form {
            Form::Quaternion(own) => OrientationForm::Quaternion(own.map(name)),
            Form::Angles(own, order, unit) => OrientationForm::Angles(own.map(name), order, unit),
            Form::Vector(own, unit) => OrientationForm::Vector(own.map(name), unit),
            Form::Matrix(own) => OrientationForm::Matrix(own.map(name)),
        };
        let sd = sd.map(|sd| sd.map(name).into()).unwrap_or_default();
        OrientationColumns { form, sd, covariance: Vec::new() }
    }
}

impl Form {
    fn in_words(&self) -> String {
        match *self {
            Self::Quaternion(_) => "the quaternion with w in the other place".to_owned(),
            Self::Angles(_, own, unit) => format!("{} in {}", String::from(own), unit.word()),
            Self::Vector(_, unit) => format!("a rotation vector in {}", unit.word()),
            Self::Matrix(_) => "the matrix with rows for columns".to_owned(),
        }
    }
}
