//! The columns of joint angles in a CSV file: `q1_rad` or `q1_deg`, and `q1_mm` for a joint that slides, in the arm's
//! order.

use super::RowProblem;
use crate::compensation::TargetJoints;
use crate::ingest::AngleUnit;
use crate::kinematics::Arm;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JointUnits {
    angle: AngleUnit,
    /// Whether each joint slides, and so is in mm; empty where all turn.
    slides: Vec<bool>,
}

impl From<AngleUnit> for JointUnits {
    fn from(angle: AngleUnit) -> Self {
        Self { angle, slides: Vec::new() }
    }
}

impl JointUnits {
    /// Units for the joints that slide, and for those that turn; none slides where `slides` ends.
    pub const fn new(angle: AngleUnit, slides: Vec<bool>) -> Self {
        Self { angle, slides }
    }

    /// Units for the joints of `arm`, those that turn in `angle`.
    pub fn of(arm: &Arm, angle: AngleUnit) -> Self {
        Self::new(angle, arm.joints().iter().map(|joint| joint.slides).collect())
    }

    pub const fn angle(&self) -> AngleUnit {
        self.angle
    }

    /// Whether each joint slides; empty where all turn.
    pub fn slides(&self) -> &[bool] {
        &self.slides
    }

    fn slides_at(&self, joint: usize) -> bool {
        self.slides.get(joint).copied().unwrap_or(false)
    }

    /// The ending of the name of a joint's column (from 0), which states its unit.
    pub(super) fn suffix(&self, joint: usize) -> &'static str {
        if self.slides_at(joint) { "mm" } else { suffix(self.angle) }
    }

    /// A joint's value (from 0) in its unit as rad or mm.
    fn inside(&self, joint: usize, value: f64) -> f64 {
        if self.slides_at(joint) { value } else { value * self.angle.to_rad() }
    }

    /// Joints with these values in their units, in the arm's order.
    pub(super) fn joints(&self, values: &[f64]) -> TargetJoints {
        let values = values.iter().enumerate();
        let slides = (0..values.len()).map(|joint| self.slides_at(joint));
        let slides = Some(slides.collect());
        let angles = values.map(|(joint, value)| self.inside(joint, *value)).collect();
        TargetJoints { names: Vec::new(), slides, angles }
    }

    /// The value to the nanometre, or to a ten-millionth of a degree or finer: a micrometre is some 20 millionths of a
    /// degree.
    pub(super) fn shown(&self, joint: usize, value: f64) -> String {
        match self.angle {
            _ if self.slides_at(joint) => format!("{value:.6}"),
            AngleUnit::Rad => format!("{value:.10}"),
            AngleUnit::Deg | AngleUnit::Gon => format!("{:.8}", value / self.angle.to_rad()),
        }
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct AngleColumns {
    pub(super) units: JointUnits,
    pub(super) places: Vec<usize>,
}

impl AngleColumns {
    /// The columns among `names`; `None` where there are none, an error where they do not belong together.
    pub(super) fn of(names: &[String]) -> Result<Option<Self>, String> {
        let named = names.iter().enumerate();
        let named = named.filter_map(|(place, name)| Some((parsed(name)?, place)));
        let mut found: Vec<_> = named.collect();
        found.sort_unstable_by_key(|&((joint, _), place)| (joint, place));
        if found.is_empty() {
            return Ok(None);
        }
        let mut units = found.iter().filter_map(|((_, unit), _)| *unit);
        let angle = units.next().unwrap_or(AngleUnit::Rad);
        if units.any(|other| other != angle) {
            return Err("some are in radians and some in degrees; give all in one unit".to_owned());
        }
        if let Some((joint, _)) = (1..).zip(&found).find(|(joint, ((own, _), _))| own != joint) {
            let unit = suffix(angle);
            return Err(format!("q{joint}_{unit} is not there, and the joints are counted from 1"));
        }
        let slides: Vec<bool> = found.iter().map(|((_, unit), _)| unit.is_none()).collect();
        let places = found.into_iter().map(|(_, place)| place).collect();
        let slides = if slides.contains(&true) { slides } else { Vec::new() };
        Ok(Some(Self { units: JointUnits::new(angle, slides), places }))
    }

    /// The joint angles by the value at each place; `None` where no value is given, an error where only some are.
    pub(super) fn joints(
        &self,
        names: &[String],
        mut value: impl FnMut(usize) -> Result<Option<f64>, RowProblem>,
    ) -> Result<Option<TargetJoints>, RowProblem> {
        let found = self.places.iter().map(|&place| Ok(value(place)?.ok_or(place)));
        let found = found.collect::<Result<Vec<_>, RowProblem>>()?;
        if found.iter().all(Result::is_err) {
            return Ok(None);
        }
        let angles: Result<Vec<f64>, usize> = found.into_iter().collect();
        let angles =
            angles.map_err(|place| RowProblem::PartOfJoints { missing: names[place].clone() })?;
        Ok(Some(self.units.joints(&angles)))
    }
}

const fn suffix(unit: AngleUnit) -> &'static str {
    match unit {
        AngleUnit::Rad => "rad",
        AngleUnit::Deg => "deg",
        AngleUnit::Gon => "gon",
    }
}

pub(super) fn is_angle(name: &str) -> bool {
    parsed(name).is_some()
}

/// Joint (from 1) and unit of a column of this name; no unit of angles for a joint that slides.
fn parsed(name: &str) -> Option<(usize, Option<AngleUnit>)> {
    let (joint, unit) = name.strip_prefix('q')?.split_once('_')?;
    let unit = match unit {
        "rad" => Some(AngleUnit::Rad),
        "deg" => Some(AngleUnit::Deg),
        "mm" => None,
        _ => return None,
    };
    Some((joint.parse().ok()?, unit))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(names: &[&str]) -> Result<Option<AngleColumns>, String> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        AngleColumns::of(&names)
    }

    #[test]
    fn columns_are_found_by_number_wherever_they_stand() {
        let found = of(&["target", "q2_deg", "note", "q1_deg"]).unwrap();
        let expected = AngleColumns { units: AngleUnit::Deg.into(), places: vec![3, 1] };
        assert_eq!(found, Some(expected));
        assert_eq!(of(&["target", "q_rad", "qx", "q1_m"]), Ok(None));
    }

    #[test]
    fn joints_that_slide_are_in_mm_beside_angles() {
        let found = of(&["q1_mm", "q2_deg"]).unwrap().expect("columns");
        assert_eq!(found.units, JointUnits::new(AngleUnit::Deg, vec![true, false]));
        assert!((found.units.inside(0, 90.0) - 90.0).abs() < 1e-12);
        assert!((found.units.inside(1, 90.0) - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert_eq!(found.units.shown(0, 1500.0), "1500.000000");
        assert_eq!([0, 1, 2].map(|joint| found.units.suffix(joint)), ["mm", "deg", "deg"]);
    }

    #[test]
    fn gaps_and_two_units_are_refused() {
        let gap = of(&["q1_rad", "q3_rad"]).unwrap_err();
        assert!(gap.contains("q2_rad is not there"), "{gap}");
        let from_zero = of(&["q0_rad", "q1_rad"]).unwrap_err();
        assert!(from_zero.contains("counted from 1"), "{from_zero}");
        assert!(of(&["q1_rad", "q2_deg"]).is_err());
    }
}
