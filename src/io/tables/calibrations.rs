//! `calibrations`: each identified model, complete, with its determinacy and the conditions that it is valid for.

use nalgebra::Isometry3;

use super::PublishContext;
use super::validity::{ValidFor, configurations, learnt_from};
use super::words::{TableVerdict, xyzw};
use crate::fit::full::FullModel;
use crate::fit::model::PartEvidence;
use crate::fit::saved::VERSION;
use crate::fit::{
    Calibration, Convergence, FramePair, Loss, Observability, PoseModel, Unknown, WEIGHTED_DOWN,
};
use crate::join::{Reading, ReadingKind, Station};
use crate::judgement::Outcome;
use crate::kinematics::{Convention, Motion, Parameter};
use crate::report::{Angles, Model};
use crate::rows::{columns, row, words};

row! {
    pub struct CalibrationRow of "calibrations" {
        model_kind: Model,
        parts: Vec<String>,
        parts_dropped: Vec<String>,
        parts_tried: Vec<String>,
        parts_gain_nat: Vec<f64>,
        angles: Angles,
        stations: usize,
        stations_downweighted: usize,
        parameters: usize,
        fit: FitColumns,
        loss: LossName,
        tracker_from_base as point: Option<[f64; 3]>,
        tracker_from_base_turn as [tracker_from_base: turn]: Option<[f64; 4]>,
        flange_from_target as point: Option<[f64; 3]>,
        flange_from_target_turn as [flange_from_target: turn]: Option<[f64; 4]>,
        verdict: TableVerdict,
        reason: Option<String>,
        model: String,
        of_arm: ArmColumns,
    }
}

columns! {
    /// How a model's fit ended; the full error model, which estimates its noise, has the end and its evidence alone.
    #[derive(Default)]
    pub struct FitColumns {
        rank: Option<usize>,
        condition: Option<f64>,
        o1: Option<f64>,
        o2: Option<f64>,
        o3: Option<f64>,
        o4: Option<f64>,
        o5: Option<f64>,
        variance_factor: Option<f64>,
        misfit_mm: Option<f64>,
        converged: Option<bool>,
        convergence: String,
        iterations: Option<usize>,
        cost_start: Option<f64>,
        cost_end: Option<f64>,
        log_evidence: Option<f64>,
    }
}

columns! {
    /// Columns of the arm and the run, the same in every row.
    pub struct ArmColumns {
        arm_model: String,
        convention: Convention,
        parallel_joints: Vec<String>,
        sessions: Vec<String>,
        observations: usize,
        camera_size: Option<f64>,
        camera_size_se: Option<f64>,
        prior_length_mm: Option<f64>,
        prior_angle_rad: Option<f64>,
        flange_from_tool as placement: Isometry3<f64>,
        error_frame_target as point: [f64; 3],
        configurations: Vec<String>,
        model_version: u32,
        valid_for: ValidFor,
    }
}

words! {
    /// The loss on a station's residual.
    pub enum LossName {
        Squares: "squares",
        Huber: "huber",
        Cauchy: "cauchy",
        StudentT: "student_t",
    }
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
}

/// A calibration of geometry or frames, or the full error model.
#[derive(Clone, Copy)]
enum Of<'a> {
    Calibration(&'a Calibration),
    Full(&'a FullModel),
}

pub fn rows(
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
) -> Result<Vec<CalibrationRow>, serde_json::Error> {
    let of_arm = of_arm(outcome, context);
    let calibrations = outcome.calibrations.iter();
    let calibrations = calibrations.map(|(model, own)| (*model, Of::Calibration(own)));
    let full = outcome.full.iter().map(|own| (Model::Full, Of::Full(own)));
    let row = |(model, of): (Model, Of<'_>)| of.row(model, outcome, context, of_arm.clone());
    calibrations.chain(full).map(row).collect()
}

fn of_arm(outcome: &Outcome<'_>, context: &PublishContext<'_>) -> ArmColumns {
    let arm = context.arm;
    let parallel = arm.parallel_joints();
    let parallel = parallel.iter().filter_map(|joint| arm.joints().get(joint - 1));
    let stated = |value: f64| (value > 0.0).then_some(value);
    let target = outcome.error_frame.frames.flange_from_target.origin();
    ArmColumns {
        arm_model: arm.model().to_owned(),
        convention: arm.convention(),
        parallel_joints: parallel.map(|joint| joint.name.clone()).collect(),
        sessions: outcome.training.iter().map(|session| session.name.clone()).collect(),
        observations: observations(outcome),
        camera_size: outcome.camera_size.map(|found| found.size),
        camera_size_se: outcome.camera_size.map(|found| found.size_se),
        prior_length_mm: stated(context.fit.prior_length_mm),
        prior_angle_rad: stated(context.fit.prior_angle_mrad * 1e-3),
        flange_from_tool: outcome.error_frame.flange_from_tool,
        error_frame_target: target.coords().into(),
        configurations: configurations(outcome),
        model_version: VERSION,
        valid_for: ValidFor::of(outcome, context),
    }
}

impl From<&Calibration> for FitColumns {
    fn from(calibration: &Calibration) -> Self {
        let solution = &calibration.solution;
        let indices = calibration.observability();
        let index = |of: fn(&Observability) -> f64| indices.as_ref().map(of);
        Self {
            rank: Some(calibration.nominal_structure.rank),
            condition: Some(calibration.structure.condition()).filter(|found| found.is_finite()),
            o1: index(|o| o.o1),
            o2: index(|o| o.o2),
            o3: index(|o| o.o3),
            o4: index(|o| o.o4),
            o5: index(|o| o.o5),
            variance_factor: Some(solution.variance_factor),
            misfit_mm: Some(calibration.misfit_mm),
            converged: Some(solution.convergence == Convergence::Converged),
            convergence: in_words(solution.convergence).to_owned(),
            iterations: Some(solution.iterations),
            cost_start: Some(0.5 * solution.cost[0]),
            cost_end: Some(0.5 * solution.cost[1]),
            log_evidence: None,
        }
    }
}

impl From<&FullModel> for FitColumns {
    fn from(full: &FullModel) -> Self {
        Self {
            convergence: "a fixed number of rounds".to_owned(),
            log_evidence: Some(full.posterior.log_evidence),
            ..Self::default()
        }
    }
}

fn owned<'n>(names: impl IntoIterator<Item = &'n str>) -> Vec<String> {
    names.into_iter().map(str::to_owned).collect()
}

impl<'a> Of<'a> {
    fn row(
        self,
        model: Model,
        outcome: &Outcome<'_>,
        context: &PublishContext<'_>,
        of_arm: ArmColumns,
    ) -> Result<CalibrationRow, serde_json::Error> {
        let frames = self.frames();
        let frames = frames.as_ref();
        let base = frames.map(|(frames, _)| frames.tracker_from_base.isometry());
        let target = frames.map(|(frames, _)| frames.flange_from_target.isometry());
        let is_turned = frames.is_some_and(|(_, turned)| *turned);
        let names: Vec<&str> = of_arm.sessions.iter().map(String::as_str).collect();
        let saved = self.model().saved(context.arm, &names);
        let weights = self.model().weights();
        let (verdict, reason) = verdict(model, outcome);
        Ok(CalibrationRow {
            model_kind: model,
            parts: owned(self.parts(true)),
            parts_dropped: owned(self.parts(false)),
            parts_tried: self.tried(|part| part_name(part.name).to_owned()),
            parts_gain_nat: self.tried(|part| part.gain),
            angles: self.angles(),
            stations: weights.len(),
            stations_downweighted: weights.iter().filter(|own| **own < WEIGHTED_DOWN).count(),
            parameters: self.model().parameter_count(),
            fit: match self {
                Of::Calibration(calibration) => calibration.into(),
                Of::Full(full) => full.into(),
            },
            loss: self.loss(context),
            tracker_from_base: base.map(|own| own.translation.vector.into()),
            tracker_from_base_turn: base.map(|own| xyzw(&own.rotation)),
            flange_from_target: target.map(|own| own.translation.vector.into()),
            flange_from_target_turn: target.filter(|_| is_turned).map(|own| xyzw(&own.rotation)),
            verdict,
            reason,
            model: saved.expect("a model that was trained here is saved as text")?,
            of_arm,
        })
    }

    /// The parts common to all models.
    fn model(self) -> &'a dyn PoseModel {
        match self {
            Of::Calibration(calibration) => calibration,
            Of::Full(full) => full,
        }
    }

    fn parts(self, kept: bool) -> Vec<&'static str> {
        let model = self.model();
        let always = model.parts().iter().copied().filter(|_| kept);
        let optional = model.optional_parts().iter();
        let own = optional.filter(|part| part.kept == kept);
        always.chain(own.map(|part| part_name(part.name))).collect()
    }

    /// The value `of` each optional part that was tested by its evidence.
    fn tried<T>(self, of: impl Fn(&PartEvidence) -> T) -> Vec<T> {
        self.model().optional_parts().iter().map(of).collect()
    }

    fn angles(self) -> Angles {
        match self {
            Of::Full(_) if self.parts(true).contains(&"command_weight") => Angles::Weighted,
            Of::Full(_) | Of::Calibration(_) => Angles::Reported,
        }
    }

    /// The frames where there is one session with one source and one target, and whether the target's orientation was fitted.
    fn frames(self) -> Option<(FramePair, bool)> {
        let (frames, unknowns) = match self {
            Of::Calibration(calibration) => (calibration.frames.clone(), &calibration.unknowns[..]),
            Of::Full(full) => (full.fitted_frames(), full.unknowns()),
        };
        match &frames[..] {
            [one] => Some((one.one()?, is_turned(unknowns))),
            _ => None,
        }
    }

    fn loss(self, context: &PublishContext<'_>) -> LossName {
        match (self, context.fit.loss) {
            (Of::Full(_), _) if context.full.student_t > 0.0 => LossName::StudentT,
            (Of::Full(_), _) | (Of::Calibration(_), Loss::Squares) => LossName::Squares,
            (Of::Calibration(_), Loss::Huber { .. }) => LossName::Huber,
            (Of::Calibration(_), Loss::Cauchy { .. }) => LossName::Cauchy,
        }
    }
}

/// What held-out blocks and test sessions say of commands that a model corrects, and why.
fn verdict(model: Model, outcome: &Outcome<'_>) -> (TableVerdict, Option<String>) {
    outcome.verdict.of_model(model).map_or_else(
        || (TableVerdict::NotShown, Some("nothing judges".to_owned())),
        |own| ((&own.verdict()).into(), own.reason()),
    )
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
