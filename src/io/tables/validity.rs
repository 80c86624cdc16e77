//! What tables that commands are corrected by hold for, in columns that both have: the frames of commands and errors, the joint angles
//! and temperatures while measuring, and the conditions that the pipeline file states.

use std::collections::BTreeSet;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3};

use super::PublishContext;
use super::error_frame::ErrorFrameColumns;
use super::words::joint_units;
use crate::compensation::{Conditions, Validity};
use crate::figures::extremes;
use crate::fit::WEIGHTED_DOWN;
use crate::fit::commanded::CommandedPose;
use crate::grid::Reach;
use crate::join::Station;
use crate::judgement::Outcome;
use crate::kinematics::Configuration;
use crate::report::{ResidualSet, Split};
use crate::rows::columns;

columns! {
    /// Columns of `calibrations` and `compensation`, the same in every row.
    pub struct ValidFor {
        joint_names: Vec<String>,
        joint_units: Option<Arc<[String]>>,
        command_from_base as placement: Isometry3<f64>,
        error_frame: ErrorFrameColumns,
        largest_error_mm: Option<f64>,
        joint_lower_rad: Vec<f64>,
        joint_upper_rad: Vec<f64>,
        tool_is_target: Option<bool>,
        conditions: Conditions,
        temperature_min_c: Option<f64>,
        temperature_max_c: Option<f64>,
    }
}

columns! {
    of Conditions {
        tool: Option<String>,
        payload_kg: Option<f64>,
        mounting: Option<String>,
        base: Option<String>,
        controller_model: Option<String>,
        absolute_accuracy_option: Option<bool>,
    }
}

impl ValidFor {
    pub(super) fn of(outcome: &Outcome<'_>, context: &PublishContext<'_>) -> Self {
        let joints = context.arm.joints();
        let (joint_lower_rad, joint_upper_rad) =
            joint_ranges(outcome, joints.len()).into_iter().unzip();
        let (temperature_min_c, temperature_max_c) = temperatures(outcome).unzip();
        Self {
            joint_names: joints.iter().map(|joint| joint.name.clone()).collect(),
            joint_units: joint_units(joints),
            command_from_base: *context.command_from_base.isometry(),
            error_frame: (&outcome.frame).into(),
            largest_error_mm: largest_error_mm(outcome),
            joint_lower_rad,
            joint_upper_rad,
            tool_is_target: Some(outcome.tool_is_target()),
            conditions: context.valid_for.clone(),
            temperature_min_c,
            temperature_max_c,
        }
    }

    pub fn validity(&self) -> Validity {
        let temperature_c = self.temperature_min_c.zip(self.temperature_max_c);
        Validity {
            conditions: self.conditions.clone(),
            tool_is_target: self.tool_is_target == Some(true),
            temperature_c: temperature_c.map(<[f64; 2]>::from),
            largest_error_mm: self.largest_error_mm,
        }
    }

    /// Lowest and highest reported angle of each joint over the stations used, rad, of a joint that slides mm.
    pub fn joint_ranges(&self) -> Vec<[f64; 2]> {
        let ends = self.joint_lower_rad.iter().zip(&self.joint_upper_rad);
        ends.map(|(low, high)| [*low, *high]).collect()
    }
}

/// The paired stations that a run learnt from.
pub fn learnt_from<'a>(outcome: &'a Outcome<'_>) -> impl Iterator<Item = &'a Station> {
    let stations = outcome.training.iter().flat_map(|session| &session.joined.stations);
    stations.filter(|station| !station.measured().is_empty())
}

/// Lowest and highest temperature of the stations learnt from, °C.
fn temperatures(outcome: &Outcome<'_>) -> Option<(f64, f64)> {
    let readings = learnt_from(outcome).flat_map(Station::measured);
    let met = readings.filter_map(|reading| reading.temperature_c);
    extremes(met)
}

/// The arm configurations of the stations learnt from, in order; empty for an arm without six axes.
pub(super) fn configurations(outcome: &Outcome<'_>) -> Vec<String> {
    let error_frame = &outcome.error_frame;
    let reach = Reach::new(error_frame.arm, error_frame.flange_from_tool);
    let own = learnt_from(outcome).filter_map(|station| reach.configuration(&station.joints));
    let all: BTreeSet<Configuration> = own.collect();
    all.iter().map(Configuration::to_string).collect()
}

/// The largest error of the stations before correction, mm: of the tool point against its command, and against the nominal arm where
/// there is none, in the error reference frame. Of the session that errors are stated for; stations that the best model hardly
/// counts take no part, as a reading that went wrong is no error of the arm.
fn largest_error_mm(outcome: &Outcome<'_>) -> Option<f64> {
    let session = outcome.training.last()?;
    let hardly_counted = weighted_down(outcome, &session.name);
    let error_frame = &outcome.error_frame;
    let stations = session.joined.stations.iter().zip(&session.commanded.poses);
    let counted = stations.filter(|(station, _)| !hardly_counted.contains(&station.number));
    let error_mm = |(station, pose): (&Station, &Option<CommandedPose>)| {
        let nominal = || Point3::from(error_frame.nominal_tool(&station.joints).translation.vector);
        let wanted = pose.map_or_else(nominal, |pose| pose.position);
        station.one_reading()?;
        Some(error_frame.tool_error(station, &wanted)?.norm())
    };
    counted.filter_map(error_mm).max_by(f64::total_cmp)
}

/// Numbers of the stations of a session that the best model hardly counts.
fn weighted_down(outcome: &Outcome<'_>, session: &str) -> BTreeSet<usize> {
    let is_own = |set: &&ResidualSet| {
        let subject = &set.subject;
        subject.model == outcome.best
            && subject.split == Split::None
            && subject.of_session == session
    };
    let own = outcome.residuals.iter().filter(is_own);
    let down = own
        .flat_map(|set| &set.residuals)
        .filter(|residual| residual.weight.is_some_and(|weight| weight < WEIGHTED_DOWN));
    down.map(|residual| residual.station).collect()
}

/// Lowest and highest reported angle of each joint over the stations learnt from, rad.
pub(super) fn joint_ranges(outcome: &Outcome<'_>, joints: usize) -> Vec<(f64, f64)> {
    let empty = vec![(f64::INFINITY, f64::NEG_INFINITY); joints];
    learnt_from(outcome).fold(empty, |ranges, station| {
        let widened = ranges.iter().zip(&station.joints);
        widened.map(|((low, high), q)| (low.min(*q), high.max(*q))).collect()
    })
}
