//! `calibrations`: each identified model, complete, with its determinacy and the conditions that it is valid for.

use std::sync::Arc;

use super::PublishContext;
use super::error_frame::ErrorFrameName;
use super::validity::{configurations, joint_ranges, largest_error_mm, learnt_from, temperatures};
use super::words::{TableVerdict, joint_units, placement};
use crate::common::corrects;
use crate::fit::full::FullModel;
use crate::fit::model::PartEvidence;
use crate::fit::saved::VERSION;
use crate::fit::{
    Calibration, Convergence, FramePair, Loss, Observability, PoseModel, Unknown, WEIGHTED_DOWN,
};
use crate::join::{Reading, ReadingKind, Station};
use crate::judgement::Outcome;
use crate::kinematics::Convention;
use crate::kinematics::{Motion, Parameter};
use crate::report::{Angles, Model};
use crate::table::{row, words};

row! {
    /// An identified model, its determinacy, and the conditions that it is valid for.
    pub struct CalibrationRow of "calibrations" {
        arm_model: String,
        convention: Convention,
        parallel_joints: Vec<String>,
        joint_names: Vec<String>,
        joint_units: Option<Arc<[String]>>,
        model_kind: Model,
        parts: Vec<String>,
        parts_dropped: Vec<String>,
        parts_tried: Vec<String>,
        parts_gain_nat: Vec<f64>,
        sessions: Vec<String>,
        angles: Angles,
        stations: usize,
        stations_downweighted: usize,
        observations: usize,
        parameters: usize,
        rank: Option<usize>,
        condition: Option<f64>,
        o1: Option<f64>,
        o2: Option<f64>,
        o3: Option<f64>,
        o4: Option<f64>,
        o5: Option<f64>,
        variance_factor: Option<f64>,
        camera_size: Option<f64>,
        camera_size_se: Option<f64>,
        misfit_mm: Option<f64>,
        loss: LossName,
        prior_length_mm: Option<f64>,
        prior_angle_rad: Option<f64>,
        converged: Option<bool>,
        convergence: String,
        iterations: Option<usize>,
        cost_start: Option<f64>,
        cost_end: Option<f64>,
        log_evidence: Option<f64>,
        tracker_from_base as [
            tracker_from_base_x_mm,
            tracker_from_base_y_mm,
            tracker_from_base_z_mm,
        ]: Option<[f64; 3]>,
        tracker_from_base_turn as [
            tracker_from_base_qx,
            tracker_from_base_qy,
            tracker_from_base_qz,
            tracker_from_base_qw,
        ]: Option<[f64; 4]>,
        flange_from_target as [
            flange_from_target_x_mm,
            flange_from_target_y_mm,
            flange_from_target_z_mm,
        ]: Option<[f64; 3]>,
        flange_from_target_turn as [
            flange_from_target_qx,
            flange_from_target_qy,
            flange_from_target_qz,
            flange_from_target_qw,
        ]: Option<[f64; 4]>,
        command_from_base as [
            command_from_base_x_mm,
            command_from_base_y_mm,
            command_from_base_z_mm,
        ]: [f64; 3],
        command_from_base_turn as [
            command_from_base_qx,
            command_from_base_qy,
            command_from_base_qz,
            command_from_base_qw,
        ]: [f64; 4],
        flange_from_tool as [
            flange_from_tool_x_mm,
            flange_from_tool_y_mm,
            flange_from_tool_z_mm,
        ]: [f64; 3],
        flange_from_tool_turn as [
            flange_from_tool_qx,
            flange_from_tool_qy,
            flange_from_tool_qz,
            flange_from_tool_qw,
        ]: [f64; 4],
        error_frame: ErrorFrameName,
        error_frame_base as [
            error_frame_base_x_mm,
            error_frame_base_y_mm,
            error_frame_base_z_mm,
        ]: [f64; 3],
        error_frame_base_turn as [
            error_frame_base_qx,
            error_frame_base_qy,
            error_frame_base_qz,
            error_frame_base_qw,
        ]: [f64; 4],
        error_frame_target as [
            error_frame_target_x_mm,
            error_frame_target_y_mm,
            error_frame_target_z_mm,
        ]: [f64; 3],
        error_frame_sd_mm: Option<f64>,
        error_frame_sd_deg: Option<f64>,
        error_frame_lever_sd_mm: Option<f64>,
        largest_error_mm: Option<f64>,
        joint_lower_rad: Vec<f64>,
        joint_upper_rad: Vec<f64>,
        configurations: Vec<String>,
        tool: Option<String>,
        payload_kg: Option<f64>,
        mounting: Option<String>,
        base: Option<String>,
        controller_model: Option<String>,
        absolute_accuracy_option: Option<bool>,
        temperature_min_c: Option<f64>,
        temperature_max_c: Option<f64>,
        verdict: TableVerdict,
        reason: Option<String>,
        model_version: u32,
        model: String,
    }
}

corrects!(CalibrationRow);

/// The loss on a station's residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LossName {
    Squares,
    /// Huber's.
    Huber,
    /// Cauchy's.
    Cauchy,
    /// Student's t.
    StudentT,
}

words! {
    Convention {
        StandardDh: "standard_dh",
        MdH: "md_h",
        ModifiedDh: "modified_dh",
        SModel: "s_model",
        Cpc: "cpc",
        Poe: "poe",
        MinimalPoe: "minimal_poe",
        Urdf: "urdf",
    }
    LossName { Squares: "squares", Huber: "huber", Cauchy: "cauchy", StudentT: "student_t" }
}

/// A calibration of geometry or frames, or the full error model.
struct Identified<'a> {
    model: Model,
    of: Of<'a>,
}

#[derive(Clone, Copy)]
enum Of<'a> {
    Calibration(&'a Calibration),
    Full(&'a FullModel),
}

/// The rows of all models.
pub fn rows(
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
) -> Result<Vec<CalibrationRow>, serde_json::Error> {
    let identified = identified(outcome);
    let rows = identified.iter().map(|model| model.row(outcome, context));
    rows.collect()
}

fn identified<'a>(outcome: &'a Outcome<'_>) -> Vec<Identified<'a>> {
    let calibration = |(model, calibration): &'a (Model, Calibration)| Identified {
        model: *model,
        of: Of::Calibration(calibration),
    };
    let full =
        outcome.full.as_ref().map(|full| Identified { model: Model::Full, of: Of::Full(full) });
    outcome.calibrations.iter().map(calibration).chain(full).collect()
}

/// Condition number of a calibration's solution; `None` where it is not finite.
fn condition(calibration: &Calibration) -> Option<f64> {
    let condition = calibration.structure.condition();
    condition.is_finite().then_some(condition)
}

/// The names as owned texts.
fn owned<'n>(names: impl IntoIterator<Item = &'n str>) -> Vec<String> {
    names.into_iter().map(str::to_owned).collect()
}

impl<'a> Identified<'a> {
    fn row(
        &self,
        outcome: &Outcome<'_>,
        context: &PublishContext<'_>,
    ) -> Result<CalibrationRow, serde_json::Error> {
        let (arm, stated) = (context.arm, &context.valid_for);
        let names: Vec<&str> = arm.joints().iter().map(|joint| joint.name.as_str()).collect();
        let parallel = arm.parallel_joints();
        let parallel = parallel.iter().filter_map(|j| names.get(j - 1).copied());
        let sessions: Vec<&str> = outcome.training.iter().map(|s| s.name.as_str()).collect();
        let (joint_lower_rad, joint_upper_rad) =
            joint_ranges(outcome, names.len()).into_iter().unzip();
        let (temperature_min_c, temperature_max_c) = temperatures(outcome).unzip();
        let calibration = self.calibration();
        let solution = calibration.map(|calibration| &calibration.solution);
        let observability = calibration.and_then(Calibration::observability);
        let observability = |index: fn(&Observability) -> f64| observability.as_ref().map(index);
        let frames = self.frames();
        let base = frames.map(|(frames, _)| placement(frames.tracker_from_base.isometry()));
        let target = frames.map(|(frames, _)| placement(frames.flange_from_target.isometry()));
        let is_turned = frames.is_some_and(|(_, turned)| turned);
        let command_from_base = placement(context.command_from_base.isometry());
        let flange_from_tool = placement(outcome.error_frame.flange_from_tool());
        let error_frame_base = placement(&outcome.frame.tracker_from_base);
        let some = |value: f64| (value > 0.0).then_some(value);
        let (verdict, reason) = self.verdict(outcome);
        Ok(CalibrationRow {
            arm_model: arm.model().to_owned(),
            convention: arm.convention(),
            parallel_joints: owned(parallel),
            joint_names: owned(names.iter().copied()),
            joint_units: joint_units(arm.joints()),
            model_kind: self.model,
            parts: owned(self.parts(true)),
            parts_dropped: owned(self.parts(false)),
            parts_tried: self.tried(|part| part_name(part.name).to_owned()),
            parts_gain_nat: self.tried(|part| part.gain),
            angles: self.angles(),
            stations: self.weights().len(),
            stations_downweighted: self.weighted_down(),
            observations: observations(outcome),
            parameters: self.parameters(),
            rank: calibration.map(|calibration| calibration.nominal_structure.rank),
            condition: calibration.and_then(condition),
            o1: observability(|o| o.o1),
            o2: observability(|o| o.o2),
            o3: observability(|o| o.o3),
            o4: observability(|o| o.o4),
            o5: observability(|o| o.o5),
            variance_factor: solution.map(|solution| solution.variance_factor),
            camera_size: outcome.camera_size.map(|found| found.size),
            camera_size_se: outcome.camera_size.map(|found| found.size_se),
            misfit_mm: calibration.map(|calibration| calibration.misfit_mm),
            loss: self.loss(context),
            prior_length_mm: some(context.fit.prior_length_mm),
            prior_angle_rad: some(context.fit.prior_angle_mrad * 1e-3),
            converged: solution.map(|s| s.convergence == Convergence::Converged),
            convergence: self.convergence().to_owned(),
            iterations: solution.map(|solution| solution.iterations),
            cost_start: solution.map(|solution| 0.5 * solution.cost[0]),
            cost_end: solution.map(|solution| 0.5 * solution.cost[1]),
            log_evidence: self.log_evidence(),
            tracker_from_base: base.map(|(origin, _)| origin),
            tracker_from_base_turn: base.map(|(_, turn)| turn),
            flange_from_target: target.map(|(origin, _)| origin),
            flange_from_target_turn: target.filter(|_| is_turned).map(|(_, turn)| turn),
            command_from_base: command_from_base.0,
            command_from_base_turn: command_from_base.1,
            flange_from_tool: flange_from_tool.0,
            flange_from_tool_turn: flange_from_tool.1,
            error_frame: (&outcome.frame).into(),
            error_frame_base: error_frame_base.0,
            error_frame_base_turn: error_frame_base.1,
            error_frame_target: outcome
                .error_frame
                .frames()
                .flange_from_target
                .origin()
                .coords()
                .into(),
            error_frame_sd_mm: outcome.frame.sd_mm,
            error_frame_sd_deg: outcome.frame.sd_deg,
            error_frame_lever_sd_mm: outcome.frame.lever_sd_mm,
            largest_error_mm: largest_error_mm(outcome),
            joint_lower_rad,
            joint_upper_rad,
            configurations: configurations(outcome),
            tool: stated.tool.clone(),
            payload_kg: stated.payload_kg,
            mounting: stated.mounting.clone(),
            base: stated.base.clone(),
            controller_model: stated.controller_model.clone(),
            absolute_accuracy_option: stated.absolute_accuracy_option,
            temperature_min_c,
            temperature_max_c,
            verdict,
            reason,
            model_version: VERSION,
            model: self.text(context, &sessions)?,
            sessions: owned(sessions),
        })
    }

    /// What held-out blocks and test sessions say of commands that this model corrects, and why.
    fn verdict(&self, outcome: &Outcome<'_>) -> (TableVerdict, Option<String>) {
        outcome.verdict.of_model(self.model).map_or_else(
            || (TableVerdict::NotShown, Some("nothing judges".to_owned())),
            |own| ((&own.verdict()).into(), own.reason()),
        )
    }

    const fn calibration(&self) -> Option<&'a Calibration> {
        match self.of {
            Of::Calibration(calibration) => Some(calibration),
            Of::Full(_) => None,
        }
    }

    /// The parts common to all models.
    fn model(&self) -> &'a dyn PoseModel {
        match self.of {
            Of::Calibration(calibration) => calibration,
            Of::Full(full) => full,
        }
    }

    fn text(
        &self,
        context: &PublishContext<'_>,
        names: &[&str],
    ) -> Result<String, serde_json::Error> {
        let saved = self.model().saved(context.arm, names);
        saved.expect("a model that was trained here is saved as text")
    }

    /// Parts that were kept, or those that were dropped.
    fn parts(&self, kept: bool) -> Vec<&'static str> {
        let model = self.model();
        let always = model.parts().iter().copied().filter(|_| kept);
        let optional = model.optional_parts().iter();
        let own = optional.filter(|part| part.kept == kept);
        always.chain(own.map(|part| part_name(part.name))).collect()
    }

    /// The value `of` each optional part that was tested by its evidence.
    fn tried<T>(&self, of: impl Fn(&PartEvidence) -> T) -> Vec<T> {
        self.model().optional_parts().iter().map(of).collect()
    }

    fn angles(&self) -> Angles {
        match self.of {
            Of::Full(_) if self.has_command_weight() => Angles::Weighted,
            Of::Full(_) | Of::Calibration(_) => Angles::Reported,
        }
    }

    fn has_command_weight(&self) -> bool {
        self.parts(true).contains(&"command_weight")
    }

    fn weights(&self) -> &'a [f64] {
        self.model().weights()
    }

    /// The frames where there is one session with one source and one target, and whether the target's orientation was fitted.
    fn frames(&self) -> Option<(FramePair, bool)> {
        let (frames, unknowns) = match self.of {
            Of::Calibration(calibration) => (calibration.frames.clone(), &calibration.unknowns[..]),
            Of::Full(full) => (full.fitted_frames(), full.unknowns()),
        };
        match &frames[..] {
            [one] => Some((one.one()?, is_turned(unknowns))),
            _ => None,
        }
    }

    fn parameters(&self) -> usize {
        self.model().parameter_count()
    }

    /// Number of stations with a reduced weight.
    fn weighted_down(&self) -> usize {
        let weights = self.weights().iter();
        weights.filter(|weight| **weight < WEIGHTED_DOWN).count()
    }

    /// The reason why the iterations ended, as text.
    const fn convergence(&self) -> &'static str {
        match self.of {
            Of::Calibration(own) => in_words(own.solution.convergence),
            Of::Full(_) => "a fixed number of rounds",
        }
    }

    fn log_evidence(&self) -> Option<f64> {
        match self.of {
            Of::Calibration(_) => None,
            Of::Full(full) => Some(full.log_evidence()),
        }
    }

    fn loss(&self, context: &PublishContext<'_>) -> LossName {
        match (self.of, context.fit.loss) {
            (Of::Full(_), _) if context.full.student_t > 0.0 => LossName::StudentT,
            (Of::Full(_), _) | (Of::Calibration(_), Loss::Squares) => LossName::Squares,
            (Of::Calibration(_), Loss::Huber { .. }) => LossName::Huber,
            (Of::Calibration(_), Loss::Cauchy { .. }) => LossName::Cauchy,
        }
    }
}

/// Whether the target's orientation is among the unknowns.
fn is_turned(unknowns: &[Unknown]) -> bool {
    let turn =
        |unknown: &Unknown| matches!(unknown.parameter, Parameter::Target(Motion::Rotation(_)));
    unknowns.iter().any(turn)
}

fn part_name(name: &'static str) -> &'static str {
    match name {
        "drift" => "base_drift",
        "session_changes" => "session_change",
        other => other,
    }
}

/// Number of measured numbers: three for each position, three more where an orientation was fitted.
fn observations(outcome: &Outcome<'_>) -> usize {
    let turned =
        outcome.calibrations.iter().any(|(_, calibration)| is_turned(&calibration.unknowns));
    let rows = |reading: &Reading| match reading.value.kind() {
        ReadingKind::Pose if !turned => ReadingKind::Point.rows(),
        kind => kind.rows(),
    };
    let readings = learnt_from(outcome).flat_map(Station::measured);
    readings.map(rows).sum()
}

const fn in_words(convergence: Convergence) -> &'static str {
    match convergence {
        Convergence::Converged => {
            "the last step changed no unknown by a millionth of its standard error"
        }
        Convergence::IterationLimit => "the limit of iterations was reached",
        Convergence::Stalled => "no step lowered the cost any more",
    }
}
