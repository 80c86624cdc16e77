//! The columns of joint angles in a CSV file: `q1_rad`, `q2_rad`, … or `q1_deg`, `q2_deg`, … in the arm's order.

use crate::ingest::AngleUnit;

/// The columns of joint angles that a first line names, in the joints' order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct AngleColumns {
    /// Unit of the angles.
    pub(super) unit: AngleUnit,
    /// Their places in a line, in the joints' order.
    pub(super) places: Vec<usize>,
}

impl AngleColumns {
    /// The columns among `names`; `None` where there are none, an error where they do not belong together.
    pub(super) fn of(names: &[String]) -> Result<Option<Self>, String> {
        let named = names.iter().enumerate();
        let mut found: Vec<(usize, AngleUnit, usize)> = named
            .filter_map(|(place, name)| parsed(name).map(|(joint, unit)| (joint, unit, place)))
            .collect();
        found.sort_unstable_by_key(|&(joint, _, place)| (joint, place));
        let Some(&(_, unit, _)) = found.first() else {
            return Ok(None);
        };
        if found.iter().any(|(_, other, _)| *other != unit) {
            return Err("some are in radians and some in degrees; give all in one unit".to_owned());
        }
        let missing = (1..).zip(&found).find(|(joint, own)| own.0 != *joint);
        if let Some((joint, _)) = missing {
            return Err(format!(
                "q{joint}_{} is not there, and the joints are counted from 1",
                suffix(unit)
            ));
        }
        let places = found.into_iter().map(|(_, _, place)| place).collect();
        Ok(Some(Self { unit, places }))
    }
}

/// The ending of a column's name that states its unit.
pub(super) const fn suffix(unit: AngleUnit) -> &'static str {
    match unit {
        AngleUnit::Rad => "rad",
        AngleUnit::Deg => "deg",
    }
}

/// An angle in a unit as radians.
pub(super) fn radians(angle: f64, unit: AngleUnit) -> f64 {
    match unit {
        AngleUnit::Rad => angle,
        AngleUnit::Deg => angle.to_radians(),
    }
}

/// Radians in a unit, as text, to a ten-millionth of a degree or finer; a micrometre is some 20 millionths of a degree.
pub(super) fn shown(angle_rad: f64, unit: AngleUnit) -> String {
    match unit {
        AngleUnit::Rad => format!("{angle_rad:.10}"),
        AngleUnit::Deg => format!("{:.8}", angle_rad.to_degrees()),
    }
}

/// Whether a column of this name holds joint angles.
pub(super) fn is_angle(name: &str) -> bool {
    parsed(name).is_some()
}

/// Joint (from 1) and unit of a column of this name.
fn parsed(name: &str) -> Option<(usize, AngleUnit)> {
    let (joint, unit) = name.strip_prefix('q')?.split_once('_')?;
    let unit = match unit {
        "rad" => AngleUnit::Rad,
        "deg" => AngleUnit::Deg,
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
        let expected = AngleColumns {
            unit: AngleUnit::Deg,
            places: vec![3, 1],
        };
        assert_eq!(found, Some(expected));
        assert_eq!(of(&["target", "q_rad", "qx", "q1_mm"]), Ok(None));
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
