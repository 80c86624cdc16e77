//! `parameters`: the identified parameters of each model, their standard errors, and those that are not identifiable.

use super::PublishContext;
use super::words::Unit;
use crate::fit::full::FullModel;
use crate::fit::full::layout::Block;
use crate::fit::identifiability::{
    confounded, is_identifiable, most_correlated, with_correlations,
};
use crate::fit::{Calibration, Freedom, Identifiability, Unknown};
use crate::judgement::Outcome;
use crate::kinematics::{Arm, Element, GaugePart, Motion, Parameter};
use crate::report::Model;
use crate::rows::{Word as _, row, words};

row! {
    pub struct ParameterRow of "parameters" {
        model: Model,
        parameter_index: usize,
        parameter: String,
        belongs_to: BelongsTo,
        of_session: Option<String>,
        joint: Option<usize>,
        quantity: ParameterQuantity,
        unit: Unit,
        nominal: f64,
        offset: f64,
        identified: f64,
        standard_error: Option<f64>,
        prior_sd: Option<f64>,
        identifiability: Identifiability,
        confounded_with: Vec<String>,
        most_correlated_with: Option<String>,
        correlation: Option<f64>,
    }
}

words! {
    pub enum BelongsTo {
        /// The base in the tracker's frame.
        Base: "base",
        Link: "link",
        Target: "target",
        Session: "session",
        /// An instrument that reads one length.
        Gauge: "gauge",
    }

    pub enum ParameterQuantity {
        Theta: "theta",
        D: "d",
        A: "a",
        Alpha: "alpha",
        Beta: "beta",
        /// The turn γ behind the twist of S-model and CPC.
        Gamma: "gamma",
        /// The shift b behind the twist of S-model and CPC.
        B: "b",
        X: "x",
        Y: "y",
        Z: "z",
        Rx: "rx",
        Ry: "ry",
        Rz: "rz",
        /// Command–feedback weight: the share of the way from reported to commanded angle.
        CommandWeight: "command_weight",
        /// Reading of a distance at its anchor, or a plane's distance from the base's origin.
        Offset: "offset",
        /// Tilt of a plane's normal towards the first axis across it.
        Tilt: "tilt_1",
        /// Tilt of a plane's normal towards the second axis across it.
        OtherTilt: "tilt_2",
    }
}

/// An unknown, or the command–feedback weight of one joint (from 0), in one session or in all.
#[derive(Debug, Clone, Copy)]
enum Subject {
    Chain(Unknown),
    CommandWeight { joint: usize, session: Option<usize> },
}

/// The results for a parameter, other than its place.
struct Found {
    offset: f64,
    standard_error: f64,
    prior_sd: Option<f64>,
    identifiability: Identifiability,
    confounded_with: Vec<usize>,
    most_correlated: Option<(usize, f64)>,
}

/// The parameters of one model, in its order.
struct Parameters<'a> {
    model: Model,
    subjects: Vec<Subject>,
    arm: &'a Arm,
    sessions: &'a [&'a str],
}

pub fn rows(outcome: &Outcome<'_>, context: &PublishContext<'_>) -> Vec<ParameterRow> {
    let sessions: Vec<&str> =
        outcome.training.iter().map(|session| session.name.as_str()).collect();
    let of =
        |model, subjects| Parameters { model, subjects, arm: context.arm, sessions: &sessions };
    let mut rows = Vec::new();
    for (model, calibration) in &outcome.calibrations {
        let subjects = calibration.unknowns.iter().copied().map(Subject::Chain);
        let own = of(*model, subjects.collect());
        rows.extend(own.rows(of_calibration(calibration)));
    }
    if let Some(full) = &outcome.full {
        let (places, subjects): (Vec<usize>, Vec<Subject>) = columns(full).into_iter().unzip();
        let own = of(Model::Full, subjects);
        rows.extend(own.rows(of_full(full, &outcome.calibrations, &places, &own.subjects)));
    }
    rows
}

impl Parameters<'_> {
    /// A row for each parameter, with the results for its place.
    fn rows(&self, found: impl Fn(usize) -> Found) -> Vec<ParameterRow> {
        let labels: Vec<String> =
            self.subjects.iter().map(|subject| subject.label(self.sessions)).collect();
        let row =
            |(place, subject): (usize, &Subject)| self.row(place, *subject, found(place), &labels);
        self.subjects.iter().enumerate().map(row).collect()
    }

    fn row(&self, place: usize, subject: Subject, found: Found, labels: &[String]) -> ParameterRow {
        let nominal = subject.nominal(self.arm);
        let label = |other: usize| labels[other].clone();
        ParameterRow {
            model: self.model,
            parameter_index: place,
            parameter: subject.name(),
            belongs_to: subject.belongs_to(),
            of_session: subject.session().map(|own| self.sessions[own].to_owned()),
            joint: subject.joint(),
            quantity: subject.quantity(),
            unit: subject.unit(),
            nominal,
            offset: found.offset,
            identified: nominal + found.offset,
            standard_error: Some(found.standard_error),
            prior_sd: found.prior_sd,
            identifiability: found.identifiability,
            confounded_with: found.confounded_with.into_iter().map(label).collect(),
            most_correlated_with: found.most_correlated.map(|(other, _)| label(other)),
            correlation: found.most_correlated.map(|(_, correlation)| correlation),
        }
    }
}

/// Unknowns of a fit of frames or geometry. Frames alone are found with offsets of zero: the fit starts again from what it found.
fn of_calibration(calibration: &Calibration) -> impl Fn(usize) -> Found {
    let identifiability = calibration.identifiability();
    let is_reference = calibration.freedom == Freedom::BaseAndTarget;
    move |place| {
        let own = identifiability[place];
        Found {
            offset: if is_reference { 0.0 } else { calibration.solution.offsets[place] },
            standard_error: calibration.standard_error(place),
            prior_sd: calibration.prior_sd[place],
            identifiability: match own {
                Identifiability::Identifiable if is_reference => Identifiability::ByConvention,
                own => own,
            },
            confounded_with: if own == Identifiability::Identifiable {
                Vec::new()
            } else {
                calibration.confounded_with(place)
            },
            most_correlated: most_correlated(&calibration.covariance, place),
        }
    }
}

/// Unknowns and weights of the full error model; those of the geometry have its priors and its structure.
fn of_full(
    full: &FullModel,
    calibrations: &[(Model, Calibration)],
    places: &[usize],
    subjects: &[Subject],
) -> impl Fn(usize) -> Found {
    let covariance = full.posterior.covariance_of(places);
    let error = |index: usize| covariance[(index, index)].max(0.0).sqrt();
    let errors: Vec<f64> = (0..places.len()).map(error).collect();
    let prior_sd = |index: usize| prior_sd(full, calibrations, subjects[index], places[index]);
    let priors: Vec<Option<f64>> = (0..places.len()).map(prior_sd).collect();
    let alone = |index: usize| match geometric(calibrations, subjects[index]) {
        Some((geometric, place)) => geometric.alone(place, errors[index]),
        None if is_identifiable(errors[index], priors[index]) => Identifiability::Identifiable,
        None => Identifiability::Weak,
    };
    let alone: Vec<Identifiability> = (0..places.len()).map(alone).collect();
    let identifiability = with_correlations(&alone, &covariance);
    let partners: Vec<Vec<usize>> =
        (0..places.len()).map(|index| partners(calibrations, subjects, index)).collect();
    move |index| Found {
        offset: full.column_mean(places[index]),
        standard_error: errors[index],
        prior_sd: priors[index],
        identifiability: identifiability[index],
        confounded_with: match identifiability[index] {
            Identifiability::Identifiable => Vec::new(),
            Identifiability::StructurallyDependent => partners[index].clone(),
            _ => confounded(&covariance, index),
        },
        most_correlated: most_correlated(&covariance, index),
    }
}

/// The geometric fit with the place of a subject among its unknowns; `None` of a subject that is none of them.
fn geometric(fits: &[(Model, Calibration)], subject: Subject) -> Option<(&Calibration, usize)> {
    let Subject::Chain(unknown) = subject else { return None };
    let (_, geometric) = fits.iter().find(|(model, _)| *model == Model::Geometric)?;
    let place = geometric.unknowns.iter().position(|own| *own == unknown)?;
    Some((geometric, place))
}

/// The subjects that share a null direction of the nominal arm's structure with the one at `index`.
fn partners(fits: &[(Model, Calibration)], subjects: &[Subject], index: usize) -> Vec<usize> {
    let Some((fit, place)) = geometric(fits, subjects[index]) else { return Vec::new() };
    let structural = &fit.nominal_structure.indistinguishable[place];
    let is_partner = |subject: &Subject| {
        geometric(fits, *subject).is_some_and(|(_, other)| structural.contains(&other))
    };
    let numbered = subjects.iter().enumerate();
    numbered.filter(|(_, subject)| is_partner(subject)).map(|(other, _)| other).collect()
}

/// The columns that are parameters, with their subjects.
fn columns(full: &FullModel) -> Vec<(usize, Subject)> {
    let mut columns = Vec::new();
    for (block, own) in full.trained.layout.blocks() {
        let first = own.start;
        let session = match block {
            Block::Unknowns => {
                let unknowns = full.unknowns().iter().copied().map(Subject::Chain);
                columns.extend(own.zip(unknowns));
                continue;
            }
            Block::CommandWeight => None,
            Block::SessionCommandWeight(session) | Block::OwnCommandWeight(session) => {
                Some(session)
            }
            _ => continue,
        };
        let weight = |place| (place, Subject::CommandWeight { joint: place - first, session });
        columns.extend(own.map(weight));
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
        Subject::CommandWeight { .. } => Some(full.posterior.scale[place]),
        Subject::Chain(_) => {
            let (geometric, place) = geometric(calibrations, subject)?;
            geometric.prior_sd[place]
        }
    }
}

/// The nominal value of a link's quantity; 0 for base and target.
pub(crate) fn nominal(arm: &Arm, parameter: Parameter) -> f64 {
    let of_element = |element: &Element| match element {
        Element::Free { nominal, parameter: own, .. } if *own == parameter => Some(*nominal),
        _ => None,
    };
    arm.chain().elements().iter().find_map(of_element).unwrap_or(0.0)
}

impl Subject {
    fn name(self) -> String {
        match self {
            Self::Chain(unknown) => unknown.parameter.to_string(),
            Self::CommandWeight { joint, .. } => format!("command_weight_{}", joint + 1),
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
            Self::CommandWeight { .. } => 0.0,
        }
    }

    const fn session(self) -> Option<usize> {
        match self {
            Self::Chain(unknown) => unknown.session(),
            Self::CommandWeight { session, .. } => session,
        }
    }

    const fn joint(self) -> Option<usize> {
        match self {
            Self::Chain(Unknown { parameter: Parameter::Link { joint, .. }, .. }) => Some(joint),
            Self::Chain(_) => None,
            Self::CommandWeight { joint, .. } => Some(joint + 1),
        }
    }

    fn unit(self) -> Unit {
        match self {
            Self::Chain(unknown) => Unit::named(unknown.parameter.unit()),
            Self::CommandWeight { .. } => Unit::One,
        }
    }

    const fn belongs_to(self) -> BelongsTo {
        match self {
            Self::Chain(unknown) => match unknown.parameter {
                Parameter::Base(_) => BelongsTo::Base,
                Parameter::Link { .. } => BelongsTo::Link,
                Parameter::Target(_) => BelongsTo::Target,
                Parameter::Gauge(_) => BelongsTo::Gauge,
            },
            Self::CommandWeight { session: None, .. } => BelongsTo::Link,
            Self::CommandWeight { .. } => BelongsTo::Session,
        }
    }

    fn quantity(self) -> ParameterQuantity {
        match self {
            Self::CommandWeight { .. } => ParameterQuantity::CommandWeight,
            Self::Chain(unknown) => match unknown.parameter {
                Parameter::Base(motion) | Parameter::Target(motion) => {
                    ParameterQuantity::named(motion.name())
                }
                Parameter::Link { quantity, .. } => ParameterQuantity::named(quantity.name()),
                Parameter::Gauge(part) => match part {
                    GaugePart::Place(axis) => {
                        ParameterQuantity::named(Motion::Translation(axis).name())
                    }
                    GaugePart::Offset | GaugePart::Height => ParameterQuantity::Offset,
                    GaugePart::Tilt => ParameterQuantity::Tilt,
                    GaugePart::OtherTilt => ParameterQuantity::OtherTilt,
                },
            },
        }
    }
}

impl ParameterQuantity {
    /// The quantity with the name of a motion or of a link's quantity.
    fn named(name: &str) -> Self {
        Self::of_word(name)
            .expect("a test holds the names of motions and quantities against the words")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::LinkQuantity;

    #[test]
    fn motions_and_quantities_of_links_are_words() {
        let motions = Motion::ALL.into_iter().map(Motion::name);
        for name in motions.chain(LinkQuantity::ALL.into_iter().map(LinkQuantity::name)) {
            assert_eq!(ParameterQuantity::named(name).word(), name);
        }
    }
}
