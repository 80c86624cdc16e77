//! Starting frames: a closed-form alignment of the nominal arm's flanges, then base and target alone. Sources that read one length
//! have a start of their own (`gauges`).

mod gauges;

use std::collections::BTreeMap;

use nalgebra::{
    DVector, Isometry3, Matrix3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3,
};

use super::frames::Frames;
use super::gauge::Sees;
use super::observation::Observation;
use super::problem::{Freedom, Problem};
use super::{FitError, FitSettings, solve};
use crate::geometry::{Base, Tracker, Transform, align};
use crate::join::placement::{NOMINAL_MM, Placement, ReadingAtFlange};
use crate::join::{ReadingKind, SourceId, TargetId};
use crate::kinematics::{Arm, BatchChain};
use gauges::{Known, SeenAt};

/// The least number of stations: nine numbers of base and target need three positions, and one more gives a residual.
const LEAST_STATIONS: usize = 4;
/// The least number of readings of a source of lengths: seven numbers of anchor and target, and one more gives a residual.
const LEAST_LENGTHS: usize = 8;
/// Positions that spread less than this across their longest direction count as a line, mm.
const LEAST_SPREAD_MM: f64 = 1.0;
/// Passes of base and target alone; the frames are updated after each, so that the turns stay small.
const PASSES: usize = 3;
/// Offsets below this (mm and rad) do not change the frames.
const SETTLED: f64 = 1e-6;

/// The frames of each session with the nominal arm: bases and targets fitted, geometry fixed. A session has the sources and
/// targets that its observations name.
pub fn frames(
    arm: &Arm,
    observations: &[Observation],
    sessions: usize,
    settings: &FitSettings,
) -> Result<Vec<Frames>, FitError> {
    settings.check_targets()?;
    let aligned = (0..sessions).map(|session| aligned(arm, observations, session, settings));
    let frames = aligned.collect::<Result<Vec<_>, _>>()?;
    let (settled, misfit_mm) = settled(arm, observations, frames, settings);
    if misfit_mm <= NOMINAL_MM {
        return Ok(settled);
    }
    // A target far from the flange is not reached from there.
    let far = (0..sessions).map(|session| far(arm, observations, session, &settled[session]));
    let (other, other_mm) = self::settled(arm, observations, far.collect(), settings);
    Ok(if other_mm < misfit_mm { other } else { settled })
}

/// Bases and targets fitted from these frames, and what they leave of the positions, mm.
fn settled(
    arm: &Arm,
    observations: &[Observation],
    mut frames: Vec<Frames>,
    settings: &FitSettings,
) -> (Vec<Frames>, f64) {
    let (mut misfit_mm, prior) = (f64::INFINITY, settings.prior());
    for _ in 0..PASSES {
        let freedom = Freedom::BaseAndTarget;
        let problem = Problem::new(observations, arm.chain(), &frames, freedom, &prior);
        // With one tool orientation base and target are confounded; the solver's damping takes the shortest step there.
        let unknowns = problem.unknowns.len();
        let solution = solve::solve(&problem, DVector::zeros(unknowns), settings.loss, unknowns);
        misfit_mm = problem.misfit_mm(&solution.offsets);
        frames = problem.frames(&solution.offsets);
        // The frames contain the offsets: further passes would change nothing.
        if solution.offsets.amax() < SETTLED {
            break;
        }
    }
    (frames, misfit_mm)
}

/// The frames of a session whose targets may sit far from the flange; those of `near` where nothing is found.
fn far(arm: &Arm, observations: &[Observation], session: usize, near: &Frames) -> Frames {
    let of = |keep: &dyn Fn(&Observation) -> bool| -> Option<Placement> {
        let own = observations.iter().filter(|o| o.session == session && keep(o));
        let own: Vec<&Observation> = own.collect();
        let readings = own.iter().zip(flanges(arm, &own)).filter_map(|(o, flange)| {
            let attained = o.point()?.position.coords;
            Some(ReadingAtFlange { flange, attained })
        });
        Placement::fit_far(&readings.collect::<Vec<_>>())
    };
    let sources = near.sources().iter().enumerate().map(|(source, near)| {
        let found = of(&|o| o.source == SourceId(source) && o.target == TargetId(0));
        found.map_or(*near, |found| Transform::claim(found.tracker_from_base))
    });
    let bases: Vec<Transform<Tracker, Base>> = sources.collect();
    let targets = near.targets().iter().enumerate().map(|(target, near)| {
        let is_own = |o: &&Observation| o.session == session && o.target == TargetId(target);
        let seen: Vec<&Observation> = observations.iter().filter(is_own).collect();
        let found = of(&|o| o.source == SourceId(0) && o.target == TargetId(target));
        let place = found.map_or(near.isometry().translation, |found| found.target_mm.into());
        Transform::claim(Isometry3::from_parts(place, turn(arm, &seen, &bases)))
    });
    let found = Frames::new(bases.clone(), targets.collect());
    found.map_or_else(|| near.clone(), |found| found.seeing(near.sees()))
}

/// The base in each source's frame from flange origins alone, and each target's mean turn where orientations are measured.
fn aligned(
    arm: &Arm,
    observations: &[Observation],
    session: usize,
    settings: &FitSettings,
) -> Result<Frames, FitError> {
    let own: Vec<&Observation> = observations.iter().filter(|o| o.session == session).collect();
    let count = |id: fn(&Observation) -> usize| own.iter().map(|o| id(o) + 1).max().unwrap_or(1);
    let (sources, targets) = (count(|o| o.source.0), count(|o| o.target.0));
    if settings.target.is_some() && targets > 1 {
        return Err(FitError::KnownTargetOfSeveral { session, targets });
    }
    let starts = (0..sources).map(|source| start(arm, &own, session, SourceId(source), settings));
    let starts = starts.collect::<Result<Vec<Start>, _>>()?;
    let bases: Vec<_> = starts.iter().map(|start| start.base).collect();
    let places = (0..targets).map(|target| {
        let seen = own.iter().filter(|o| o.target == TargetId(target));
        let seen: Vec<&Observation> = seen.copied().collect();
        if seen.is_empty() {
            return Err(FitError::UnseenTarget { session, target });
        }
        let turn = turn(arm, &seen, &bases);
        let by_length = starts.iter().filter_map(|start| start.target);
        let mut by_length = by_length.filter(|(of, _)| *of == TargetId(target));
        let place = by_length.next().filter(|_| seen.iter().all(|o| o.point().is_none()));
        let place = place.map_or_else(Translation3::identity, |(_, place)| place.into());
        Ok(Transform::claim(Isometry3::from_parts(place, turn)))
    });
    let places = places.collect::<Result<Vec<_>, _>>()?;
    let sees: Vec<Sees> = starts.iter().map(|start| start.sees).collect();
    Ok(Frames::new(bases, places).expect("at least one of each is asked for").seeing(&sees))
}

struct Start {
    sees: Sees,
    /// The base in its frame.
    base: Transform<Tracker, Base>,
    /// The target that it read lengths of, with its place on the flange, mm; `None` of a source of places.
    target: Option<(TargetId, Vector3<f64>)>,
}

fn start(
    arm: &Arm,
    own: &[&Observation],
    session: usize,
    source: SourceId,
    settings: &FitSettings,
) -> Result<Start, FitError> {
    let mut readings = own.iter().filter(|o| o.source == source);
    let kinds = readings.clone().map(|o| o.measured.kind());
    if kinds.clone().any(|kind| !kind.is_length()) {
        let base = base(arm, own, session, source)?;
        return Ok(Start { sees: Sees::Places, base, target: None });
    }
    let Some(first) = readings.next() else {
        return Ok(Start { sees: Sees::Nothing, base: Transform::identity(), target: None });
    };
    length(arm, own, session, source, first.measured.kind(), settings)
}

/// The start of a source that reads one length, by the target that it read most often.
fn length(
    arm: &Arm,
    own: &[&Observation],
    session: usize,
    source: SourceId,
    kind: ReadingKind,
    settings: &FitSettings,
) -> Result<Start, FitError> {
    let mut of_targets: BTreeMap<TargetId, Vec<&Observation>> = BTreeMap::new();
    for observation in own.iter().filter(|o| o.source == source) {
        of_targets.entry(observation.target).or_default().push(observation);
    }
    let most = of_targets.into_iter().rev().max_by_key(|(_, own)| own.len());
    let (target, own) = most.unwrap_or((TargetId::MAIN, Vec::new()));
    let (instrument, readings, needed) = (source.0, own.len(), LEAST_LENGTHS);
    let too_few = FitError::TooFewLengths { session, instrument, readings, needed };
    if readings < needed {
        return Err(too_few);
    }
    let seen = own.iter().zip(flanges(arm, &own)).filter_map(|(o, flange)| {
        let mm = o.measured.length()?.mm;
        Some(SeenAt { flange, mm })
    });
    let seen: Vec<SeenAt> = seen.collect();
    let prior = settings.prior();
    let known = Known {
        gauge: prior.gauges.get(source.0).copied().unwrap_or_default(),
        target: prior.targets.get(target.0).copied().flatten(),
    };
    let found = match kind {
        ReadingKind::Height => gauges::height(&seen, &known),
        ReadingKind::Distance | ReadingKind::Point | ReadingKind::Pose => {
            gauges::distance(&seen, &known)
        }
    };
    let (gauge, place) = found.ok_or(too_few)?;
    let target = Some((target, place));
    Ok(Start { sees: Sees::Length(gauge), base: Transform::identity(), target })
}

/// The mean turn of a target at the flange; none where no orientation was measured.
fn turn(
    arm: &Arm,
    seen: &[&Observation],
    bases: &[Transform<Tracker, Base>],
) -> UnitQuaternion<f64> {
    let flanges = flanges(arm, seen);
    let turns = seen.iter().zip(&flanges).filter_map(|(o, flange)| {
        let base = bases[o.source.0].isometry();
        Some((base.rotation * flange.rotation).inverse() * o.measured.turn()?.orientation)
    });
    mean_rotation(turns).unwrap_or_else(UnitQuaternion::identity)
}

/// The base in the frame of a source, from the target that the source saw most often: the others sit elsewhere at the flange.
fn base(
    arm: &Arm,
    observations: &[&Observation],
    session: usize,
    source: SourceId,
) -> Result<Transform<Tracker, Base>, FitError> {
    let mut of_targets: BTreeMap<TargetId, Vec<(&Observation, Point3<f64>)>> = BTreeMap::new();
    for observation in observations.iter().filter(|o| o.source == source) {
        if let Some(point) = observation.point() {
            of_targets.entry(observation.target).or_default().push((observation, point.position));
        }
    }
    // Of equally many the first target, so that the order of observations does not matter.
    let most = of_targets.into_values().rev().max_by_key(Vec::len);
    let (own, measured): (Vec<&Observation>, Vec<Point3<f64>>) =
        most.unwrap_or_default().into_iter().unzip();
    let (stations, needed) = (own.len(), LEAST_STATIONS);
    if stations < needed {
        return Err(FitError::TooFewStations { session, stations, needed });
    }
    let origins: Vec<Point3<f64>> =
        flanges(arm, &own).iter().map(|f| Point3::from(f.translation.vector)).collect();
    let spread_mm = spread(&measured).min(spread(&origins));
    if spread_mm < LEAST_SPREAD_MM {
        return Err(FitError::Degenerate { session, spread_mm });
    }
    let base = align(&measured, &origins, &vec![1.0; own.len()]);
    base.map(Transform::claim).ok_or(FitError::Degenerate { session, spread_mm })
}

fn flanges(arm: &Arm, observations: &[&Observation]) -> Vec<Isometry3<f64>> {
    let chain = arm.chain();
    let axis = |axis: usize| observations.iter().map(|o| o.axes[axis]).collect();
    let axes: Vec<Vec<f64>> = (0..chain.joint_count()).map(axis).collect();
    let nominal = vec![0.0; chain.parameters().len()];
    let poses = BatchChain::new(chain, &nominal).poses(&axes);
    (0..poses.count()).map(|i| poses.isometry(i)).collect()
}

/// Root mean square distance from the line through the points' barycentre along their longest direction, mm.
fn spread(points: &[Point3<f64>]) -> f64 {
    let n = points.len() as f64;
    let centre = points.iter().fold(Vector3::zeros(), |sum, p| sum + p.coords) / n;
    let scatter = points.iter().fold(Matrix3::zeros(), |sum, p| {
        sum + (p.coords - centre) * (p.coords - centre).transpose()
    });
    let eigenvalues = scatter.symmetric_eigenvalues();
    ((eigenvalues.sum() - eigenvalues.max()).max(0.0) / n).sqrt()
}

/// The rotation whose quaternion has the largest summed squared projection on all (Markley et al. 2007).
pub fn mean_rotation(
    rotations: impl Iterator<Item = UnitQuaternion<f64>>,
) -> Option<UnitQuaternion<f64>> {
    let mut count = 0;
    let sum = rotations.fold(nalgebra::Matrix4::zeros(), |sum, rotation| {
        count += 1;
        sum + rotation.coords * rotation.coords.transpose()
    });
    let eigen = sum.symmetric_eigen();
    let largest = eigen.eigenvalues.imax();
    let coords = eigen.eigenvectors.column(largest).into_owned();
    (count > 0).then(|| UnitQuaternion::from_quaternion(Quaternion::from_vector(coords)))
}
