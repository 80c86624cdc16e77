//! `calibrations`: each model that was identified, whole, with how well it is determined and what it is valid for.

use nalgebra::Isometry3;

use super::validity::{self, configurations, joint_ranges, learnt_from};
use super::{PublishContext, PublishError, words};
use crate::fit::full::{FullModel, PartEvidence};
use crate::fit::saved::VERSION;
use crate::fit::{Calibration, Convergence, Frames, Loss, Observability, PoseModel, Unknown};
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::kinematics::{Motion, Parameter};
use crate::manifest::RunKey;
use crate::pipeline::outcome::Outcome;
use crate::report::{Angles, Model};

/// The only convention that robot files may be written in.
const CONVENTION: &str = "standard_dh";
/// A station below this weight counts as weighted down.
const DOWN: f64 = 0.5;

/// One row: a calibration of geometry or frames, the full model, or one made on top of these.
struct Row<'a> {
    model: Model,
    of: Of<'a>,
}

#[derive(Clone, Copy)]
enum Of<'a> {
    Calibration(&'a Calibration),
    Full(&'a FullModel),
    OnTop(&'a dyn PoseModel),
}

/// The table of all models.
pub fn calibrations(
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
    key: &RunKey,
) -> Result<Table, PublishError> {
    let rows = rows(outcome);
    let arm = context.arm;
    let joints = || arm.joints().iter().map(|joint| joint.name.as_str());
    let names: Vec<&str> = outcome
        .training
        .iter()
        .map(|session| session.name.as_str())
        .collect();
    let parallel: Vec<&str> = arm
        .parallel_joints()
        .iter()
        .filter_map(|j| joints().nth(j - 1))
        .collect();
    let (lower, upper): (Vec<f64>, Vec<f64>) = joint_ranges(outcome, arm.joints().len())
        .into_iter()
        .unzip();
    let texts = rows
        .iter()
        .map(|row| row.text(context, &names))
        .collect::<Result<Vec<_>, _>>()?;
    let table = Columns::new(schema::find("calibrations")?, rows.len())
        .key(key)
        .same("arm_model", arm.model())
        .same("convention", CONVENTION)
        .same("parallel_joints", parallel)
        .same("joint_names", joints().collect::<Vec<_>>())
        .column("model_kind", rows.iter().map(|row| words::model(row.model)))
        .column("parts", rows.iter().map(|row| row.parts(true)))
        .column("parts_dropped", rows.iter().map(|row| row.parts(false)))
        .column(
            "parts_tried",
            rows.iter()
                .map(|row| row.tried(|part| part_name(part.name))),
        )
        .column(
            "parts_gain_nat",
            rows.iter().map(|row| row.tried(|part| part.gain)),
        )
        .same("sessions", names)
        .column("angles", rows.iter().map(|row| words::angles(row.angles())))
        .same("joint_lower_rad", lower)
        .same("joint_upper_rad", upper)
        .same("configurations", configurations(outcome))
        .same("model_version", VERSION)
        .column("model", texts);
    let table = solution(structure(table, &rows, outcome), &rows, context);
    let table = controller_frames(frames(table, &rows), outcome, context);
    Ok(validity::columns(table, &context.valid_for, outcome).finish()?)
}

fn rows<'a>(outcome: &'a Outcome<'_>) -> Vec<Row<'a>> {
    let calibration = |(model, calibration): &'a (Model, Calibration)| Row {
        model: *model,
        of: Of::Calibration(calibration),
    };
    let full = outcome.full.as_ref().map(|full| Row {
        model: Model::Full,
        of: Of::Full(full),
    });
    outcome
        .calibrations
        .iter()
        .map(calibration)
        .chain(full)
        .chain(outcome.on_top.iter().map(|(model, of)| Row {
            model: *model,
            of: Of::OnTop(&**of),
        }))
        .collect()
}

impl<'a> Row<'a> {
    const fn calibration(&self) -> Option<&'a Calibration> {
        match self.of {
            Of::Calibration(calibration) => Some(calibration),
            Of::Full(_) | Of::OnTop(_) => None,
        }
    }

    /// What every model can be asked.
    fn model(&self) -> &'a dyn PoseModel {
        match self.of {
            Of::Calibration(calibration) => calibration,
            Of::Full(full) => full,
            Of::OnTop(model) => model,
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

    /// `of` each optional part that the evidence was asked about.
    fn tried<T>(&self, of: impl Fn(&PartEvidence) -> T) -> Vec<T> {
        self.model().optional_parts().iter().map(of).collect()
    }

    fn angles(&self) -> Angles {
        match self.of {
            Of::Full(_) if self.blends() => Angles::Blended,
            Of::Full(_) | Of::Calibration(_) | Of::OnTop(_) => Angles::Reported,
        }
    }

    fn blends(&self) -> bool {
        self.parts(true).contains(&"command_blend")
    }

    fn weights(&self) -> &'a [f64] {
        self.model().weights()
    }

    /// The frames where there is one session, and whether the target's orientation was fitted.
    fn frames(&self) -> Option<(Frames, bool)> {
        let (frames, unknowns) = match self.of {
            Of::Calibration(calibration) => (calibration.frames.clone(), &calibration.unknowns[..]),
            Of::Full(full) => (full.fitted_frames(), full.unknowns()),
            Of::OnTop(model) => (model.frames().to_vec(), &[][..]),
        };
        (frames.len() == 1).then(|| (frames[0], is_turned(unknowns)))
    }

    fn parameters(&self) -> usize {
        self.model().parameter_count()
    }

    fn loss(&self, context: &PublishContext<'_>) -> &'static str {
        match (self.of, context.fit.loss) {
            (Of::Full(_), _) if context.full.student_t > 0.0 => "student_t",
            (Of::Full(_) | Of::OnTop(_), _) | (Of::Calibration(_), Loss::Squares) => "squares",
            (Of::Calibration(_), Loss::Huber { .. }) => "huber",
            (Of::Calibration(_), Loss::Cauchy { .. }) => "cauchy",
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
        "blend" => "command_blend",
        "drift" => "base_drift",
        "session_changes" => "session_change",
        other => other,
    }
}

fn structure(columns: Columns, rows: &[Row<'_>], outcome: &Outcome<'_>) -> Columns {
    let of = || rows.iter().map(Row::calibration);
    let observability = |index: fn(&Observability) -> f64| {
        let value = move |row: &Row<'_>| Some(index(&row.calibration()?.observability()?));
        rows.iter().map(value)
    };
    let down = |row: &Row<'_>| {
        row.weights()
            .iter()
            .filter(|weight| **weight < DOWN)
            .count()
    };
    let condition = |calibration: Option<&Calibration>| {
        Some(calibration?.structure.condition()).filter(|condition| condition.is_finite())
    };
    columns
        .column("stations", rows.iter().map(|row| row.weights().len()))
        .column("stations_downweighted", rows.iter().map(down))
        .same("observations", observations(outcome))
        .column("parameters", rows.iter().map(Row::parameters))
        .column("rank", of().map(|c| c.map(|c| c.nominal_structure.rank)))
        .column("condition", of().map(condition))
        .column("o1", observability(|o| o.o1))
        .column("o2", observability(|o| o.o2))
        .column("o3", observability(|o| o.o3))
        .column("o4", observability(|o| o.o4))
        .column("o5", observability(|o| o.o5))
}

/// Three rows for each position, three more where an orientation was fitted.
fn observations(outcome: &Outcome<'_>) -> usize {
    let turned = outcome
        .calibrations
        .iter()
        .any(|(_, calibration)| is_turned(&calibration.unknowns));
    let oriented = |station: &&crate::join::Station| {
        turned
            && station
                .attained
                .as_ref()
                .is_some_and(|attained| attained.orientation.is_some())
    };
    3 * learnt_from(outcome).count() + 3 * learnt_from(outcome).filter(oriented).count()
}

fn solution(columns: Columns, rows: &[Row<'_>], context: &PublishContext<'_>) -> Columns {
    let of = || {
        rows.iter()
            .map(|row| row.calibration().map(|calibration| &calibration.solution))
    };
    let some = |value: f64| (value > 0.0).then_some(value);
    let convergence = |row: &Row<'_>| match row.of {
        Of::Calibration(own) => in_words(own.solution.convergence),
        Of::Full(_) => "a fixed number of rounds",
        Of::OnTop(_) => "made on top of the others",
    };
    let evidence = |row: &Row<'_>| match row.of {
        Of::Calibration(_) | Of::OnTop(_) => None,
        Of::Full(full) => Some(full.log_evidence()),
    };
    columns
        .column(
            "variance_factor",
            of().map(|s| s.map(|s| s.variance_factor)),
        )
        .column(
            "misfit_mm",
            rows.iter()
                .map(|row| row.calibration().map(|calibration| calibration.misfit_mm)),
        )
        .column("loss", rows.iter().map(|row| row.loss(context)))
        .same("prior_length_mm", some(context.fit.prior_length_mm))
        .same("prior_angle_rad", some(context.fit.prior_angle_mrad * 1e-3))
        .column(
            "converged",
            of().map(|s| s.map(|s| s.convergence == Convergence::Converged)),
        )
        .column("convergence", rows.iter().map(convergence))
        .column("iterations", of().map(|s| s.map(|s| s.iterations)))
        .column("cost_start", of().map(|s| s.map(|s| 0.5 * s.cost[0])))
        .column("cost_end", of().map(|s| s.map(|s| 0.5 * s.cost[1])))
        .column("log_evidence", rows.iter().map(evidence))
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

/// How the controller states its commands: in which frame, and for which point.
fn controller_frames(
    columns: Columns,
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
) -> Columns {
    let placements = [
        ("command_from_base", context.command_from_base.isometry()),
        ("flange_from_tool", outcome.gauge.flange_from_tool()),
    ];
    let placed = |columns, (frame, placed): (&str, &Isometry3<f64>)| {
        let (origin, rotation) = words::placement(placed);
        let names = place(frame).into_iter().chain(turn(frame));
        let parts = origin.into_iter().chain(rotation);
        names
            .zip(parts)
            .fold(columns, |columns: Columns, (name, part)| {
                columns.same(&name, part)
            })
    };
    placements.into_iter().fold(columns, placed)
}

/// The columns of a frame's origin.
fn place(frame: &str) -> [String; 3] {
    ["x", "y", "z"].map(|axis| format!("{frame}_{axis}_mm"))
}

/// The columns of a frame's orientation.
fn turn(frame: &str) -> [String; 4] {
    ["x", "y", "z", "w"].map(|axis| format!("{frame}_q{axis}"))
}

fn frames(columns: Columns, rows: &[Row<'_>]) -> Columns {
    let bases: Vec<_> = rows
        .iter()
        .map(|row| {
            row.frames()
                .map(|(frames, _)| words::placement(frames.tracker_from_base.isometry()))
        })
        .collect();
    let targets: Vec<_> = rows
        .iter()
        .map(|row| {
            row.frames().map(|(frames, turned)| {
                (
                    words::placement(frames.flange_from_target.isometry()),
                    turned,
                )
            })
        })
        .collect();
    columns
        .group(
            place("tracker_from_base").each_ref().map(String::as_str),
            bases.iter().map(|base| base.map(|(origin, _)| origin)),
        )
        .group(
            turn("tracker_from_base").each_ref().map(String::as_str),
            bases.iter().map(|base| base.map(|(_, rotation)| rotation)),
        )
        .group(
            place("flange_from_target").each_ref().map(String::as_str),
            targets
                .iter()
                .map(|target| target.map(|((origin, _), _)| origin)),
        )
        .group(
            turn("flange_from_target").each_ref().map(String::as_str),
            targets.iter().map(|target| {
                let turned = target.filter(|(_, turned)| *turned);
                turned.map(|((_, rotation), _)| rotation)
            }),
        )
}
