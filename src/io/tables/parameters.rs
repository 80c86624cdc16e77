//! `parameters`: what each model identified, how well, and what it could not tell apart.

use nalgebra::DMatrix;

use super::{PublishContext, PublishError, words};
use crate::fit::full::FullModel;
use crate::fit::full::layout::Block;
use crate::fit::{Calibration, Unknown};
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::kinematics::{Arm, Axis, Element, LinkQuantity, Motion, Parameter};
use crate::manifest::RunKey;
use crate::pipeline::outcome::Outcome;
use crate::report::Model;

/// What a row is of.
#[derive(Debug, Clone, Copy)]
enum Subject {
    /// A parameter of the measurement chain.
    Chain(Unknown),
    /// The share of the way from reported to commanded angle of one joint (from 0), in one session or in all.
    Blend {
        joint: usize,
        session: Option<usize>,
    },
}

/// One row.
#[derive(Debug, Clone)]
struct Row {
    model: Model,
    index: usize,
    subject: Subject,
    nominal: f64,
    offset: f64,
    standard_error: f64,
    prior_sd: Option<f64>,
    identifiability: &'static str,
    confused_with: Vec<String>,
    most_correlated: Option<(String, f64)>,
}

/// The table of all models' free parameters.
pub fn parameters(
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
    key: &RunKey,
) -> Result<Table, PublishError> {
    let names: Vec<&str> = outcome
        .training
        .iter()
        .map(|session| session.name.as_str())
        .collect();
    let mut rows = Vec::new();
    for (model, calibration) in &outcome.calibrations {
        rows.extend(of_calibration(*model, calibration, context.arm, &names));
    }
    if let Some(full) = &outcome.full {
        rows.extend(of_full(full, &outcome.calibrations, context.arm, &names));
    }
    let table = Columns::new(schema::find("parameters")?, rows.len())
        .key(key)
        .column("model", rows.iter().map(|row| words::model(row.model)))
        .column("parameter_index", rows.iter().map(|row| row.index))
        .column("parameter", rows.iter().map(|row| row.subject.name()))
        .column(
            "belongs_to",
            rows.iter().map(|row| row.subject.belongs_to()),
        )
        .column(
            "of_session",
            rows.iter().map(|row| Some(names[row.subject.session()?])),
        )
        .column("joint", rows.iter().map(|row| row.subject.joint()))
        .column("quantity", rows.iter().map(|row| row.subject.quantity()))
        .column("unit", rows.iter().map(|row| row.subject.unit()));
    Ok(values(table, &rows).finish()?)
}

fn values(columns: Columns, rows: &[Row]) -> Columns {
    let partner = |row: &Row| row.most_correlated.as_ref().map(|(name, _)| name.clone());
    let correlation = |row: &Row| {
        row.most_correlated
            .as_ref()
            .map(|(_, correlation)| *correlation)
    };
    columns
        .column("nominal", rows.iter().map(|row| row.nominal))
        .column("offset", rows.iter().map(|row| row.offset))
        .column(
            "identified",
            rows.iter().map(|row| row.nominal + row.offset),
        )
        .column("standard_error", rows.iter().map(|row| row.standard_error))
        .column("prior_sd", rows.iter().map(|row| row.prior_sd))
        .column(
            "identifiability",
            rows.iter().map(|row| row.identifiability),
        )
        .column("confused_with", rows.iter().map(|row| &row.confused_with))
        .column("most_correlated_with", rows.iter().map(partner))
        .column("correlation", rows.iter().map(correlation))
}

fn of_calibration(model: Model, calibration: &Calibration, arm: &Arm, names: &[&str]) -> Vec<Row> {
    let subjects: Vec<Subject> = calibration
        .unknowns
        .iter()
        .copied()
        .map(Subject::Chain)
        .collect();
    let labels: Vec<String> = subjects
        .iter()
        .map(|subject| subject.label(names))
        .collect();
    let row = |index: usize| Row {
        model,
        index,
        subject: subjects[index],
        nominal: nominal(arm, calibration.unknowns[index].parameter),
        offset: calibration.solution.offsets[index],
        standard_error: calibration.standard_error(index),
        prior_sd: calibration.prior_sd[index],
        identifiability: identifiability(calibration, index),
        confused_with: calibration
            .confounded_with(index)
            .iter()
            .map(|&other| labels[other].clone())
            .collect(),
        most_correlated: most_correlated(&calibration.covariance, index, &labels),
    };
    (0..subjects.len()).map(row).collect()
}

fn identifiability(calibration: &Calibration, index: usize) -> &'static str {
    if calibration.nominal_structure.zero_columns.contains(&index) {
        "moves_nothing"
    } else if calibration.told_apart(index) {
        "told_apart"
    } else if calibration.nominal_structure.indistinguishable[index].is_empty() {
        "weak"
    } else {
        "structurally_dependent"
    }
}

/// Unknowns and blends of the full model; what has a prior of its own is that of the geometric fit.
fn of_full(
    full: &FullModel,
    calibrations: &[(Model, Calibration)],
    arm: &Arm,
    names: &[&str],
) -> Vec<Row> {
    let (places, subjects): (Vec<usize>, Vec<Subject>) = columns(full).into_iter().unzip();
    let covariance = full.covariance_of(&places);
    let labels: Vec<String> = subjects
        .iter()
        .map(|subject| subject.label(names))
        .collect();
    let row = |index: usize| {
        let (subject, standard_error) =
            (subjects[index], covariance[(index, index)].max(0.0).sqrt());
        let prior_sd = prior_sd(full, calibrations, subject, places[index]);
        // A base or a target has no prior but the poses: it is told apart wherever it stands.
        let told_apart = prior_sd.is_none_or(|sd| standard_error < 0.5 * sd);
        Row {
            model: Model::Full,
            index,
            subject,
            nominal: subject.nominal(arm),
            offset: full.column_mean(places[index]),
            standard_error,
            prior_sd,
            identifiability: if told_apart { "told_apart" } else { "weak" },
            confused_with: if told_apart {
                Vec::new()
            } else {
                confused(&covariance, index, &labels)
            },
            most_correlated: most_correlated(&covariance, index, &labels),
        }
    };
    (0..subjects.len()).map(row).collect()
}

/// The columns that are parameters, with what they are.
fn columns(full: &FullModel) -> Vec<(usize, Subject)> {
    let mut columns = Vec::new();
    for (block, own) in full.layout().blocks() {
        let first = own.start;
        match block {
            Block::Unknowns => {
                let unknowns = full.unknowns().iter().copied().map(Subject::Chain);
                columns.extend(own.zip(unknowns));
            }
            Block::Blend => {
                columns.extend(own.map(|place| {
                    (
                        place,
                        Subject::Blend {
                            joint: place - first,
                            session: None,
                        },
                    )
                }));
            }
            Block::SessionBlend(session) | Block::OwnBlend(session) => {
                let session = Some(session);
                columns.extend(own.map(|place| {
                    (
                        place,
                        Subject::Blend {
                            joint: place - first,
                            session,
                        },
                    )
                }));
            }
            _ => {}
        }
    }
    columns
}

fn prior_sd(
    full: &FullModel,
    calibrations: &[(Model, Calibration)],
    subject: Subject,
    place: usize,
) -> Option<f64> {
    match subject {
        Subject::Blend { .. } => Some(full.prior_sd()[place]),
        Subject::Chain(unknown) => {
            let (_, geometric) = calibrations
                .iter()
                .find(|(model, _)| *model == Model::Geometric)?;
            let place = geometric.unknowns.iter().position(|own| *own == unknown)?;
            geometric.prior_sd[place]
        }
    }
}

/// Correlations from which two parameters are called confused.
const CONFUSED: f64 = 0.9;

fn confused(covariance: &DMatrix<f64>, index: usize, labels: &[String]) -> Vec<String> {
    let others = (0..labels.len()).filter(|&other| other != index);
    others
        .filter(|&other| correlation(covariance, index, other).abs() > CONFUSED)
        .map(|other| labels[other].clone())
        .collect()
}

fn most_correlated(
    covariance: &DMatrix<f64>,
    index: usize,
    labels: &[String],
) -> Option<(String, f64)> {
    let others = (0..labels.len()).filter(|&other| other != index);
    let correlations = others.map(|other| (other, correlation(covariance, index, other)));
    let (other, found) = correlations
        .filter(|(_, found)| found.abs() > 0.0)
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    Some((labels[other].clone(), found))
}

/// Zero where one of the two does not vary.
fn correlation(covariance: &DMatrix<f64>, a: usize, b: usize) -> f64 {
    let scale = (covariance[(a, a)] * covariance[(b, b)]).sqrt();
    if scale > 0.0 {
        covariance[(a, b)] / scale
    } else {
        0.0
    }
}

/// The nominal value of a link's quantity; 0 for base and target.
fn nominal(arm: &Arm, parameter: Parameter) -> f64 {
    let of_element = |element: &Element| match element {
        Element::Free {
            nominal,
            parameter: own,
            ..
        } if *own == parameter => Some(*nominal),
        _ => None,
    };
    arm.chain()
        .elements()
        .iter()
        .find_map(of_element)
        .unwrap_or(0.0)
}

impl Subject {
    fn name(self) -> String {
        match self {
            Self::Chain(unknown) => unknown.parameter.to_string(),
            Self::Blend { joint, .. } => format!("blend_{}", joint + 1),
        }
    }

    /// The name, with its session where there are several.
    fn label(self, names: &[&str]) -> String {
        match self.session().filter(|_| names.len() > 1) {
            Some(session) => format!("{} of {}", self.name(), names[session]),
            None => self.name(),
        }
    }

    fn nominal(self, arm: &Arm) -> f64 {
        match self {
            Self::Chain(unknown) => nominal(arm, unknown.parameter),
            Self::Blend { .. } => 0.0,
        }
    }

    const fn session(self) -> Option<usize> {
        match self {
            Self::Chain(unknown) => unknown.session,
            Self::Blend { session, .. } => session,
        }
    }

    const fn joint(self) -> Option<usize> {
        match self {
            Self::Chain(Unknown {
                parameter: Parameter::Link { joint, .. },
                ..
            }) => Some(joint),
            Self::Chain(_) => None,
            Self::Blend { joint, .. } => Some(joint + 1),
        }
    }

    const fn unit(self) -> &'static str {
        match self {
            Self::Chain(unknown) => unknown.parameter.unit(),
            Self::Blend { .. } => "1",
        }
    }

    const fn belongs_to(self) -> &'static str {
        match self {
            Self::Chain(unknown) => match unknown.parameter {
                Parameter::Base(_) => "base",
                Parameter::Link { .. } => "link",
                Parameter::Target(_) => "target",
            },
            Self::Blend { session: None, .. } => "link",
            Self::Blend { .. } => "session",
        }
    }

    const fn quantity(self) -> &'static str {
        match self {
            Self::Blend { .. } => "blend",
            Self::Chain(unknown) => match unknown.parameter {
                Parameter::Base(motion) | Parameter::Target(motion) => direction(motion),
                Parameter::Link { quantity, .. } => match quantity {
                    LinkQuantity::Theta => "theta",
                    LinkQuantity::D => "d",
                    LinkQuantity::A => "a",
                    LinkQuantity::Alpha => "alpha",
                    LinkQuantity::Beta => "beta",
                },
            },
        }
    }
}

const fn direction(motion: Motion) -> &'static str {
    match motion {
        Motion::Translation(Axis::X) => "x",
        Motion::Translation(Axis::Y) => "y",
        Motion::Translation(Axis::Z) => "z",
        Motion::Rotation(Axis::X) => "rx",
        Motion::Rotation(Axis::Y) => "ry",
        Motion::Rotation(Axis::Z) => "rz",
    }
}
