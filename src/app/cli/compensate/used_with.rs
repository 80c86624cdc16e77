//! The conditions under which corrected targets will be run, as the caller states them.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};

use crate::compensation::{Conditions, Exception, Term, UsedWith};
use crate::io::rows::Word as _;
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

pub(super) fn correcting_table() -> impl TypedValueParser<Value = CorrectingTable> {
    named(
        [CorrectingTable::Compensation, CorrectingTable::Calibrations]
            .map(|table| (table, PossibleValue::new(table.word()))),
    )
}

pub(super) fn exception() -> impl TypedValueParser<Value = Exception> {
    named(
        EXCEPTIONS.map(|(exception, name, help)| (exception, PossibleValue::new(name).help(help))),
    )
}

pub(super) fn option(exception: Exception) -> String {
    let named = EXCEPTIONS.iter().find(|(own, ..)| *own == exception);
    named.map_or_else(String::new, |(_, name, _)| format!("--allow {name}"))
}

fn named<T, const N: usize>(values: [(T, PossibleValue); N]) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    let names = values.clone().map(|(_, name)| name);
    PossibleValuesParser::new(names).try_map(move |name| {
        let found = values.iter().find(|(_, own)| own.get_name() == name);
        found.map(|(value, _)| *value).ok_or("no such name")
    })
}

/// Reasons for refusal that can be allowed.
const EXCEPTIONS: [(Exception, &str, &str); 11] = [
    (Exception::NotMet, "not-met", "A table whose run does not meet its tolerance"),
    (Exception::NotShown, "not-shown", "A table whose run was not shown to meet its tolerance"),
    (
        Exception::JointRange,
        "joint-range",
        "Joint angles beyond those measured, where the model falls back to its prior",
    ),
    (Exception::Configuration, "configuration", "An arm configuration that no station was in"),
    (Exception::Term(Term::Tool), "tool", "Another tool than the table's"),
    (Exception::Term(Term::Payload), "payload", "Another payload"),
    (Exception::Term(Term::Mounting), "mounting", "Another mounting of the base"),
    (Exception::Term(Term::Base), "base", "Another base frame"),
    (Exception::Term(Term::ControllerModel), "controller-model", "Another controller"),
    (
        Exception::Term(Term::AbsoluteAccuracy),
        "absolute-accuracy",
        "The controller's own absolute-accuracy option in another state",
    ),
    (
        Exception::Term(Term::Temperature),
        "temperature",
        "A temperature that was not met while measuring",
    ),
];
