//! The parts that moved, as text.

use super::Judged;
use super::compare::Shift;
use super::estimate::Column;
use super::hypotheses::{Finding, Hypothesis};
use crate::figures::expanded;
use crate::kinematics::{Motion, Parameter};

impl Judged {
    /// The parts that moved, by how much, and the parts they cannot be distinguished from; `None` when none moved.
    pub fn in_words(&self) -> Option<String> {
        let mut said: Vec<String> =
            self.set_up_anew.iter().map(|part| format!("{part} set up anew")).collect();
        if let Finding::Moved { surely, one_of } = &self.finding {
            said.extend(surely.iter().map(|part| self.with_size(*part)));
            said.extend(one_of.first().map(|first| self.alternatives(*first, one_of)));
        }
        (!said.is_empty()).then(|| said.join(" and "))
    }

    fn alternatives(&self, first: Hypothesis, one_of: &[Hypothesis]) -> String {
        let others: Vec<String> = one_of.iter().skip(1).map(ToString::to_string).collect();
        if others.is_empty() {
            return self.with_size(first);
        }
        format!(
            "{}, or {}: they cannot be distinguished",
            self.with_size(first),
            others.join(" or ")
        )
    }

    fn with_size(&self, part: Hypothesis) -> String {
        let own: Vec<&Shift> = self.moved.iter().filter(|shift| part.has(&shift.column)).collect();
        let size = match part {
            Hypothesis::Base | Hypothesis::Target => Some(motion(&own)),
            Hypothesis::JointOffset(_) => own.first().map(|shift| offset(shift)),
            Hypothesis::JointCurve(_) => Some(curve(&own)),
            Hypothesis::Link(_) => Some("changed".to_owned()),
            Hypothesis::Anything => None,
        };
        size.map_or_else(|| part.to_string(), |size| format!("{part} {size}"))
    }
}

fn offset(shift: &Shift) -> String {
    let (value, sd) = (shift.value, expanded(shift.sd));
    if matches!(shift.column, Column::Slide(_)) {
        return format!("moved by {value:.3} ± {sd:.3} mm");
    }
    format!("moved by {:.0} ± {:.0} µrad", 1e6 * value, 1e6 * sd)
}

fn curve(shifts: &[&Shift]) -> String {
    let at = |shift: &&Shift| match shift.column {
        Column::SlideCurve { at_mm, .. } => Some((at_mm, shift.value, expanded(shift.sd))),
        _ => None,
    };
    let values = shifts.iter().filter_map(at);
    let largest = values.max_by(|(_, one, _), (_, other, _)| one.abs().total_cmp(&other.abs()));
    largest.map_or_else(
        || "changed".to_owned(),
        |(at_mm, value, sd)| format!("changed by up to {value:.3} ± {sd:.3} mm, at {at_mm} mm"),
    )
}

fn motion(shifts: &[&Shift]) -> String {
    let (mut moved, mut turned) = (0.0_f64, 0.0_f64);
    for shift in shifts {
        match shift.column {
            Column::Chain(
                Parameter::Base(Motion::Rotation(_)) | Parameter::Target(Motion::Rotation(_)),
            ) => {
                turned += shift.value.powi(2);
            }
            _ => moved += shift.value.powi(2),
        }
    }
    if turned > 0.0 {
        format!("moved by {:.3} mm and {:.3} mrad", moved.sqrt(), 1e3 * turned.sqrt())
    } else {
        format!("moved by {:.3} mm", moved.sqrt())
    }
}
