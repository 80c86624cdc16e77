//! What is counted in one session: normalised errors of everything the model gives an interval for.
//!
//! What is identifiable needs a word. The base takes any turn of joint 1, the target any of the last joint, a curve's mean
//! trades with θ, and gravity with both: of such directions the data say nothing, and their intervals are the prior's. So
//! a parameter counts where its standard deviation is below half its prior's (`method::identification`), with the truth as
//! an offset from the nominal arm, which is the model's own error reference frame; a curve counts less its mean over the visited angles,
//! where that is identifiable by the same rule. Positions need no error reference frame.

use std::fmt;

use nalgebra::{DMatrix, DVector, Vector3};
use posegrid::fit::Observation;
use posegrid::fit::full::layout::Block;
use posegrid::fit::full::{Known, Query};
use posegrid::kinematics::Parameter;

use super::session::{Attained, Session};
use super::tally::{Count, Tally};

/// Identifiable: a standard deviation below this share of the prior's.
const IDENTIFIABLE_SHARE: f64 = 0.5;
/// A joint's curve is held against the truth at the quantiles 1/20 … 19/20 of its visited angles.
const ANGLES: usize = 20;

/// What an interval is given for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    /// Geometric identifiable parameters.
    Parameters,
    /// Joint curves less their identifiable mean,.
    CurveShapes,
    /// Joint curves as published, their mean and what is not identifiable included.
    CurvesAsPublished,
    /// Where the arm stands on one visit to a fresh pose, per axis of the tracker's frame.
    Attained(Angles),
    /// The same as an ellipsoid.
    AttainedEllipsoid(Angles),
    /// Where it stands on the average of visits; without the width for what no other visit repeats.
    OnAverage(Angles),
    /// A fresh measurement, as an ellipsoid.
    MeasuredEllipsoid,
}

/// What is known of a pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Angles {
    /// Reported angles and command.
    Both,
    /// Reported angles alone.
    Reported,
    /// The command alone.
    Commanded,
}

impl Angles {
    const ALL: [Self; 3] = [Self::Both, Self::Reported, Self::Commanded];
}

impl Quantity {
    /// In the report's order.
    pub fn all() -> Vec<Self> {
        let mut all = vec![
            Self::Parameters,
            Self::CurveShapes,
            Self::CurvesAsPublished,
            Self::MeasuredEllipsoid,
        ];
        for of in [Self::Attained, Self::AttainedEllipsoid, Self::OnAverage] {
            all.extend(Angles::ALL.map(of));
        }
        all
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, angles) = match self {
            Self::Parameters => ("identifiable parameters", None),
            Self::CurveShapes => ("joint curves less their mean", None),
            Self::CurvesAsPublished => ("joint curves as published", None),
            Self::Attained(angles) => ("attained, per axis", Some(angles)),
            Self::AttainedEllipsoid(angles) => ("attained, ellipsoid", Some(angles)),
            Self::OnAverage(angles) => ("attained on average, per axis", Some(angles)),
            Self::MeasuredEllipsoid => ("measured, ellipsoid", Some(&Angles::Both)),
        };
        let angles = match angles {
            None => "",
            Some(Angles::Both) => " (reported and command)",
            Some(Angles::Reported) => " (reported alone)",
            Some(Angles::Commanded) => " (command alone)",
        };
        f.pad(&format!("{what}{angles}"))
    }
}

/// Everything counted in one session.
pub fn of(session: &Session) -> Tally {
    let mut tally = Tally::default();
    tally.add(Quantity::Parameters, Count::intervals(&parameters(session)));
    curves(session, &mut tally);
    for angles in Angles::ALL {
        positions(session, angles, &mut tally);
    }
    let measured: Vec<f64> = session.fresh.iter().map(|o| measured(session, o)).collect();
    tally.add(Quantity::MeasuredEllipsoid, Count::ellipsoids(&measured));
    tally
}

/// Normalised errors of the geometry's parameters that are identifiable.
fn parameters(session: &Session) -> Vec<f64> {
    let model = &session.model;
    let links = session.arm.chain().parameters();
    let truth = |parameter: Parameter| {
        let place = links.iter().position(|own| *own == parameter)?;
        Some(session.truth.arm.offsets[place])
    };
    let found = model.offsets();
    let error = |(place, unknown): (usize, &posegrid::fit::Unknown)| {
        let truth = truth(unknown.parameter)?;
        let sd = model.posterior.covariance_of(&[place])[(0, 0)].sqrt();
        let identifiable = sd < IDENTIFIABLE_SHARE * model.posterior.scale[place];
        identifiable.then_some((found[place] - truth) / sd)
    };
    model.unknowns().iter().enumerate().filter_map(error).collect()
}

fn curves(session: &Session, tally: &mut Tally) {
    let (mut published, mut shapes) = (Vec::new(), Vec::new());
    for joint in 0..session.arm.joints().len() {
        let angles = visited(session, joint);
        let truth = true_curve(session, joint, &angles);
        let found = session.model.joint_curves().errors(joint, &angles);
        let normalised = found.iter().zip(&truth);
        published.extend(normalised.map(|(found, truth)| (found.error() - truth) / found.sd));
        shapes.extend(shape(session, joint, &angles, &truth));
    }
    tally.add(Quantity::CurvesAsPublished, Count::intervals(&published));
    tally.add(Quantity::CurveShapes, Count::intervals(&shapes));
}

/// Quantiles of the angles that one joint visited.
fn visited(session: &Session, joint: usize) -> Vec<f64> {
    let mut angles: Vec<f64> = session.training.iter().map(|o| o.axes[joint]).collect();
    angles.sort_by(f64::total_cmp);
    (1..ANGLES).map(|i| angles[i * angles.len() / ANGLES]).collect()
}

/// What curve and gear line really add to a joint, in the sense of its axis, at axis angles.
fn true_curve(session: &Session, joint: usize, angles: &[f64]) -> Vec<f64> {
    let mut turned = vec![0.0; session.arm.joints().len()];
    turned[joint] = 1.0;
    // The arms here have a sign per joint and no coupling.
    let sign = session.arm.axes(&turned)[joint];
    let arm = &session.truth.arm;
    let error = |q: f64| arm.curves[joint].at(q) + arm.gear_lines[joint].at(q);
    angles.iter().map(|q| sign * error(sign * q)).collect()
}

/// Normalised errors of the curve less its mean over `angles`, where identifiable.
fn shape(session: &Session, joint: usize, angles: &[f64], truth: &[f64]) -> Vec<f64> {
    let model = &session.model;
    let columns = curve_columns(session, joint);
    let mut rows = DMatrix::from_fn(angles.len(), columns.len(), |row, column| {
        let (_, cycles, phase) = columns[column];
        (cycles * angles[row] - phase).cos()
    });
    let mean = rows.row_mean();
    rows.row_iter_mut().for_each(|mut row| row -= &mean);
    let places: Vec<usize> = columns.iter().map(|(place, ..)| *place).collect();
    let column = |of: &dyn Fn(usize) -> f64| {
        DVector::from_iterator(places.len(), places.iter().map(|&place| of(place)))
    };
    let found = &rows * column(&|place| model.column_mean(place));
    let prior = column(&|place| model.posterior.scale[place].powi(2));
    let covariance = &rows * model.posterior.covariance_of(&places) * rows.transpose();
    let mean = truth.iter().sum::<f64>() / truth.len() as f64;
    let error = |i: usize| {
        let expected = rows.row(i).map(|x| x * x).transpose().dot(&prior);
        let variance = covariance[(i, i)];
        let identifiable = variance < IDENTIFIABLE_SHARE.powi(2) * expected;
        identifiable.then_some((found[i] - (truth[i] - mean)) / variance.sqrt())
    };
    (0..angles.len()).filter_map(error).collect()
}

/// Columns of one joint's curve and gear lines: place, cycles per turn, phase.
fn curve_columns(session: &Session, joint: usize) -> Vec<(usize, f64, f64)> {
    let pair = |first: usize, cycles: f64| {
        [(first, cycles, 0.0), (first + 1, cycles, std::f64::consts::FRAC_PI_2)]
    };
    let period = f64::from(session.model.trained.layout.period_turns);
    let mut columns = Vec::new();
    for (block, own) in session.model.trained.layout.blocks() {
        match block {
            Block::Curve(of) if of == joint => columns.extend(
                (0..own.len() / 2).flat_map(|k| pair(own.start + 2 * k, (k + 1) as f64 / period)),
            ),
            Block::Line { joint: of, cycles } if of == joint => {
                columns.extend(pair(own.start, cycles));
            }
            _ => {}
        }
    }
    columns
}

fn positions(session: &Session, angles: Angles, tally: &mut Tally) {
    let model = &session.model;
    let (mut average, mut visit, mut ellipsoids) = (Vec::new(), Vec::new(), Vec::new());
    for o in &session.fresh {
        let commanded = session.arm.axes(&session.true_station(o).commanded);
        let query = query(o, angles, &commanded);
        let predicted = model.predict(&query);
        let covariance = model.covariances(&predicted.rows)[0] + predicted.approach;
        let off = predicted.position.coords - session.attained(o, Attained::OnAverage);
        average.extend((0..3).map(|axis| off[axis] / covariance[(axis, axis)].sqrt()));
        let covariance = covariance + model.visit_covariance(&query);
        let off = predicted.position.coords - session.attained(o, Attained::OnThisVisit);
        visit.extend((0..3).map(|axis| off[axis] / covariance[(axis, axis)].sqrt()));
        let factor = covariance.cholesky().expect("positive definite");
        ellipsoids.push(off.dot(&factor.solve(&off)));
    }
    tally.add(Quantity::OnAverage(angles), Count::intervals(&average));
    tally.add(Quantity::Attained(angles), Count::intervals(&visit));
    tally.add(Quantity::AttainedEllipsoid(angles), Count::ellipsoids(&ellipsoids));
}

/// Squared Mahalanobis distance of a fresh measurement.
fn measured(session: &Session, o: &Observation) -> f64 {
    let model = &session.model;
    let predicted = model.predict(&query(o, Angles::Both, &[]));
    let covariance = model.covariances(&predicted.rows)[0] + model.noise(o, o.session);
    let off = predicted.position - o.point().expect("a position").position;
    let factor = covariance.cholesky().expect("positive definite");
    off.dot(&factor.solve(&off))
}

fn query<'q>(o: &'q Observation, angles: Angles, commanded: &'q [f64]) -> Query<'q> {
    let short = o.settling_error.as_ref().expect("commands have orientations");
    let (axes, known) = match angles {
        Angles::Both => (o.axes.as_slice(), Known::Both(short)),
        Angles::Reported => (o.axes.as_slice(), Known::Reported),
        Angles::Commanded => (commanded, Known::Commanded),
    };
    Query {
        axes,
        known,
        lever: Vector3::zeros(),
        session: 0,
        source: o.source,
        target: o.target,
        own: true,
        station: Some(o.station),
    }
}
