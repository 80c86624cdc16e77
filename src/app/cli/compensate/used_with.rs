//! The conditions under which corrected targets will be run, as the caller states them.

use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};

use crate::compensation::{Conditions, Exception, Term, UsedWith};
use crate::io::table::Word as _;
use crate::io::tables::words::CorrectingTable;

/// The conditions that targets will be run with; one that is not given is not checked.
#[derive(Debug, Clone, Default, PartialEq, Args)]
#[command(
    next_help_heading = "Conditions that the targets will be run with; one that is not given is not checked"
)]
pub struct UsedWithArgs {
    /// The tool, by the name in the pipeline file
    #[arg(long, value_name = "NAME")]
    pub tool: Option<String>,
    /// The payload, kg
    #[arg(long, value_name = "KG")]
    pub payload_kg: Option<f64>,
    /// The mounting of the base: floor, wall, ceiling or as the pipeline file states it
    #[arg(long, value_name = "NAME")]
    pub mounting: Option<String>,
    /// The base frame, by the name in the pipeline file
    #[arg(long, value_name = "NAME")]
    pub base: Option<String>,
    /// The controller
    #[arg(long, value_name = "NAME")]
    pub controller_model: Option<String>,
    /// The controller's own absolute-accuracy option
    #[arg(long, value_enum, value_name = "STATE")]
    pub absolute_accuracy: Option<OnOff>,
    /// The temperature, °C
    #[arg(long, value_name = "CELSIUS", allow_negative_numbers = true)]
    pub temperature_c: Option<f64>,
}

/// Whether an option is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum OnOff {
    /// On
    On,
    /// Off
    Off,
}

impl UsedWithArgs {
    pub(super) fn used_with(&self) -> UsedWith {
        let conditions = Conditions {
            tool: self.tool.clone(),
            payload_kg: self.payload_kg,
            mounting: self.mounting.clone(),
            base: self.base.clone(),
            controller_model: self.controller_model.clone(),
            absolute_accuracy_option: self.absolute_accuracy.map(|state| state == OnOff::On),
        };
        UsedWith { conditions, temperature_c: self.temperature_c }
    }
}

impl ValueEnum for CorrectingTable {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Compensation, Self::Calibrations]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.word()))
    }
}

/// The name that an exception is allowed by.
pub(super) fn option(exception: Exception) -> String {
    let value = exception.to_possible_value();
    value.map_or_else(String::new, |value| format!("--allow {}", value.get_name()))
}

/// Reasons for refusal that can be allowed.
impl ValueEnum for Exception {
    fn value_variants<'a>() -> &'a [Self] {
        &[
            Self::NotMet,
            Self::NotShown,
            Self::JointRange,
            Self::Configuration,
            Self::Term(Term::Tool),
            Self::Term(Term::Payload),
            Self::Term(Term::Mounting),
            Self::Term(Term::Base),
            Self::Term(Term::ControllerModel),
            Self::Term(Term::AbsoluteAccuracy),
            Self::Term(Term::Temperature),
        ]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (name, help) = match self {
            Self::NotMet => ("not-met", "A table whose run does not meet its tolerance"),
            Self::NotShown => {
                ("not-shown", "A table whose run was not shown to meet its tolerance")
            }
            Self::JointRange => (
                "joint-range",
                "Joint angles beyond those measured, where the model falls back to its prior",
            ),
            Self::Configuration => ("configuration", "An arm configuration that no station was in"),
            Self::Term(Term::Tool) => ("tool", "Another tool than the table's"),
            Self::Term(Term::Payload) => ("payload", "Another payload"),
            Self::Term(Term::Mounting) => ("mounting", "Another mounting of the base"),
            Self::Term(Term::Base) => ("base", "Another base frame"),
            Self::Term(Term::ControllerModel) => ("controller-model", "Another controller"),
            Self::Term(Term::AbsoluteAccuracy) => (
                "absolute-accuracy",
                "The controller's own absolute-accuracy option in another state",
            ),
            Self::Term(Term::Temperature) => {
                ("temperature", "A temperature that was not met while measuring")
            }
        };
        Some(PossibleValue::new(name).help(help))
    }
}
