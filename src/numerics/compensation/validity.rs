//! The conditions that a table is valid for, compared with those that corrected targets will be run with.
//!
//! Each term has one of three results: within, outside, or not checked because one of the two sides does not state it.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Reason, Target};

/// The conditions an arm is run with, without the temperature. `None`: not stated.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Conditions {
    /// The tool, as the pipeline file names it.
    pub tool: Option<String>,
    pub payload_kg: Option<f64>,
    /// The mounting of the base: floor, wall, ceiling or an angle.
    pub mounting: Option<String>,
    /// The base frame, as the pipeline file names it.
    pub base: Option<String>,
    pub controller_model: Option<String>,
    /// Whether the controller's own absolute-accuracy option was on.
    pub absolute_accuracy_option: Option<bool>,
}

/// The conditions that a table was measured with, and is valid for.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Validity {
    /// The conditions stated in the pipeline file.
    pub conditions: Conditions,
    /// Whether no tool of the controller is stated: positions are corrected as those of the measured target.
    pub tool_is_target: bool,
    /// Lowest and highest temperature during the measurement, °C. `None`: the logs do not state it.
    pub temperature_c: Option<[f64; 2]>,
    /// The largest error of the stations before correction, in the error reference frame, mm. `None`: the table does not say.
    pub largest_error_mm: Option<f64>,
}

/// No error is believed that is more than this many times the largest that the stations had: a target may lie where the arm is
/// somewhat worse than at any station, but an error that is far beyond all of them is a mistake of the set-up.
pub const MOST_OF_LARGEST: f64 = 1.5;

/// What targets will be run with.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct UsedWith {
    /// The conditions stated by the caller.
    pub conditions: Conditions,
    /// The temperature, °C. `None`: not stated.
    pub temperature_c: Option<f64>,
}

/// One condition in a table's validity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Term {
    Tool,
    Payload,
    Mounting,
    Base,
    ControllerModel,
    /// The controller's own absolute-accuracy option.
    AbsoluteAccuracy,
    Temperature,
}

/// A condition of the targets that the table is not valid for.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{words}")]
pub struct Outside {
    pub term: Term,
    /// The condition with both values and their difference, as text.
    pub words: String,
}

/// The result of the comparison for each condition.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Held {
    /// Conditions that the table is valid for.
    pub within: Vec<Term>,
    /// Conditions that the table is not valid for.
    pub outside: Vec<Outside>,
    /// Conditions that the table states and the caller does not.
    pub not_said: Vec<Term>,
    /// Conditions that the table does not state.
    pub not_stated: Vec<Term>,
}

/// What a metre of steel and of aluminium grows by per °C, mm.
const GROWTH_MM: [f64; 2] = [0.0115, 0.0235];
/// Payloads are the same up to rounding, kg: a gram.
const ROUNDING_KG: f64 = 1e-3;

impl Term {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tool => "tool",
            Self::Payload => "payload",
            Self::Mounting => "mounting",
            Self::Base => "base",
            Self::ControllerModel => "controller model",
            Self::AbsoluteAccuracy => "absolute-accuracy option",
            Self::Temperature => "temperature",
        }
    }
}

impl Validity {
    /// Refuses a target for another tool.
    pub(super) fn admit(&self, target: &Target) -> Result<(), Reason> {
        match &target.tool {
            Some(wanted) if target.tool != self.conditions.tool => {
                Err(Reason::Tool { wanted: wanted.clone(), table: self.conditions.tool.clone() })
            }
            _ => Ok(()),
        }
    }

    /// Refuses an error that is too large to be one of the arm that was measured.
    pub(super) fn admit_error(&self, error: &Vector3<f64>) -> Result<(), Reason> {
        let error_mm = error.norm();
        match self.largest_error_mm.filter(|largest_mm| error_mm > MOST_OF_LARGEST * largest_mm) {
            Some(largest_mm) => Err(Reason::TooLarge { error_mm, largest_mm }),
            None => Ok(()),
        }
    }

    /// Holds each term against what targets will be run with.
    pub fn hold(&self, used: &UsedWith) -> Held {
        let mut held = Held::default();
        let (own, said) = (&self.conditions, &used.conditions);
        let names = [
            (Term::Tool, &own.tool, &said.tool),
            (Term::Mounting, &own.mounting, &said.mounting),
            (Term::Base, &own.base, &said.base),
            (Term::ControllerModel, &own.controller_model, &said.controller_model),
        ];
        for (term, own, said) in names {
            held.take(term, own.as_deref(), said.as_deref(), |own, said| {
                (own != said).then(|| format!("{said:?}, the table is for {own:?}"))
            });
        }
        held.take(Term::Payload, own.payload_kg, said.payload_kg, other_payload);
        let option = |of: &Conditions| of.absolute_accuracy_option;
        held.take(Term::AbsoluteAccuracy, option(own), option(said), other_option);
        held.take(Term::Temperature, self.temperature_c, used.temperature_c, other_temperature);
        held
    }
}

impl Held {
    /// Adds the result for `term`. `outside` describes how the table's value and the caller's differ; `None` if they agree.
    fn take<T, U>(
        &mut self,
        term: Term,
        own: Option<T>,
        said: Option<U>,
        outside: impl Fn(T, U) -> Option<String>,
    ) {
        let (own, said) = match (own, said) {
            (None, _) => return self.not_stated.push(term),
            (Some(_), None) => return self.not_said.push(term),
            (Some(own), Some(said)) => (own, said),
        };
        match outside(own, said) {
            None => self.within.push(term),
            Some(how) => {
                self.outside.push(Outside { term, words: format!("{} {how}", term.name()) });
            }
        }
    }
}

fn other_payload(own: f64, said: f64) -> Option<String> {
    let more = said - own;
    let how = if more > 0.0 { "more" } else { "less" };
    // A NaN difference counts as different, too.
    let same = more.abs() <= ROUNDING_KG;
    (!same).then(|| format!("{said} kg, {:.3} kg {how} than the table's {own} kg", more.abs()))
}

fn other_option(own: bool, said: bool) -> Option<String> {
    let word = |on| if on { "on" } else { "off" };
    (own != said).then(|| format!("{}, it was {} while measuring", word(said), word(own)))
}

fn other_temperature([low, high]: [f64; 2], said: f64) -> Option<String> {
    let (beyond, how) = if said < low { (low - said, "below") } else { (said - high, "above") };
    let inside = (low..=high).contains(&said);
    (!inside).then(|| {
        format!(
            "{said} °C, {beyond:.2} °C {how} the {low:.2} to {high:.2} °C of the measurement, where an arm of steel or aluminium \
             is {:.3} to {:.3} mm longer or shorter per metre of reach",
            beyond * GROWTH_MM[0],
            beyond * GROWTH_MM[1]
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Validity {
        Validity {
            tool_is_target: false,
            conditions: Conditions {
                tool: Some("drill".to_owned()),
                payload_kg: Some(12.5),
                mounting: Some("floor".to_owned()),
                base: None,
                controller_model: None,
                absolute_accuracy_option: Some(false),
            },
            temperature_c: Some([19.25, 21.5]),
            largest_error_mm: None,
        }
    }

    #[test]
    fn each_term_is_within_outside_or_not_checked() {
        let used = UsedWith {
            conditions: Conditions {
                tool: Some("drill".to_owned()),
                payload_kg: Some(12.500_4),
                base: Some("fixture".to_owned()),
                ..Conditions::default()
            },
            temperature_c: Some(21.5),
        };
        let held = table().hold(&used);
        assert_eq!(held.within, [Term::Tool, Term::Payload, Term::Temperature]);
        assert!(held.outside.is_empty());
        assert_eq!(held.not_said, [Term::Mounting, Term::AbsoluteAccuracy]);
        assert_eq!(held.not_stated, [Term::Base, Term::ControllerModel]);
    }

    #[test]
    fn conditions_outside_are_reported_with_the_difference() {
        let used = UsedWith {
            conditions: Conditions {
                tool: Some("rivet".to_owned()),
                payload_kg: Some(10.0),
                mounting: Some("wall".to_owned()),
                absolute_accuracy_option: Some(true),
                ..Conditions::default()
            },
            temperature_c: Some(18.0),
        };
        let words: Vec<String> =
            table().hold(&used).outside.iter().map(ToString::to_string).collect();
        let expected = [
            "tool \"rivet\", the table is for \"drill\"",
            "mounting \"wall\", the table is for \"floor\"",
            "payload 10 kg, 2.500 kg less than the table's 12.5 kg",
            "absolute-accuracy option on, it was off while measuring",
            "temperature 18 °C, 1.25 °C below the 19.25 to 21.50 °C of the measurement, where an arm of steel or aluminium is 0.014 \
             to 0.029 mm longer or shorter per metre of reach",
        ];
        assert_eq!(words, expected);
        let hot = UsedWith {
            conditions: Conditions { payload_kg: Some(f64::NAN), ..Conditions::default() },
            temperature_c: Some(f64::NAN),
        };
        assert_eq!(table().hold(&hot).outside.len(), 2, "no number is within nothing");
    }
}
