//! What the caller says of the program that corrected targets will run in.

use clap::{Args, ValueEnum};

use crate::compensation::{Conditions, Exception, UsedWith};

/// What targets will be run with.
#[derive(Debug, Clone, Default, PartialEq, Args)]
#[command(next_help_heading = "What the targets will be run with; what is not said is not checked")]
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
        UsedWith {
            conditions,
            temperature_c: self.temperature_c,
        }
    }
}

/// Reasons for refusal that can be allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Allow {
    /// Joint angles beyond those measured, where the model falls back to its prior
    JointRange,
    /// An arm configuration that no station was in
    Configuration,
    /// Another tool than the table's
    Tool,
    /// Another payload
    Payload,
    /// Another mounting of the base
    Mounting,
    /// Another base frame
    Base,
    /// Another controller
    ControllerModel,
    /// The controller's own absolute-accuracy option in another state
    AbsoluteAccuracy,
    /// A temperature that was not met while measuring
    Temperature,
}

impl Allow {
    pub(super) const fn exception(self) -> Exception {
        match self {
            Self::JointRange => Exception::JointRange,
            Self::Configuration => Exception::Configuration,
            Self::Tool => Exception::Tool,
            Self::Payload => Exception::Payload,
            Self::Mounting => Exception::Mounting,
            Self::Base => Exception::Base,
            Self::ControllerModel => Exception::ControllerModel,
            Self::AbsoluteAccuracy => Exception::AbsoluteAccuracy,
            Self::Temperature => Exception::Temperature,
        }
    }
}
