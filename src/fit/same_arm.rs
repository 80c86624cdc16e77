//! Whether sessions that were pooled, or that judge, are of one arm.
//!
//! Inputs: the full error model of a pool, the base + target fit and the observations of the same pool. Output: per session, what
//! the shared arm leaves of its stations beside what the nominal arm leaves, and a verdict.
//!
//! 1. Shared arm: the model's prediction without the session's own changes, its base aligned anew with each source; the median distance left.
//! 2. Nominal arm: base and target fitted; the median distance left.
//! 3. What one arm may leave: the instrument's noise, and a change of every joint [`CHANGES`] times as large as expected
//!    between sessions. The model's own noise is not asked: in a pool of two arms it has grown to hide them.
//!
//! Why a half: two arms of one make have the nominal arm in common and nothing else. Their errors `e`, `e'` are unrelated
//! and of one size, the shared arm's are at best their mean, and it leaves `|e − e'|/2`, on average 1/√2 of what the nominal
//! arm leaves, and more where the pool holds more sessions of the other arm. One arm leaves its changes: tenths of a
//! milliradian at the very most, where its errors are milliradians. Half the variance of the former is [`LIMIT`] squared.
//!
//! A session that only judges is asked the same ([`unseen`]); it is named, as nothing was learnt from it.

use nalgebra::{Point3, Vector3};
use thiserror::Error;

use super::Calibration;
use super::full::layout::Block;
use super::full::{FullModel, Query};
use super::observation::Observation;
use crate::figures::median;
use crate::geometry::align;
use crate::join::SourceId;
use crate::kinematics::Arm;

/// A shared arm that leaves more than this share of what the nominal arm leaves is not the session's arm.
pub const LIMIT: f64 = 0.5;
/// One arm changes between sessions by less than this many times the expected change, in every joint at once.
pub const CHANGES: f64 = 2.0;

/// How the arm that a pool shares fits one of its sessions; median distances, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SharedFit {
    /// The session's place in the pool, from 0.
    pub session: usize,
    /// What the shared arm leaves.
    pub shared_mm: f64,
    /// What the nominal arm leaves.
    pub nominal_mm: f64,
    /// What noise and changes of one arm may leave at the most.
    pub allowed_mm: f64,
}

/// A pool with a session of another arm.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "session {session} does not fit the arm that it is pooled with: the shared arm leaves {shared_mm:.3} mm at its stations \
     where the nominal arm leaves {nominal_mm:.3} mm; one arm would leave {allowed_mm:.3} mm by noise and changes, or at most \
     half of what the nominal one does; sessions of different arms (or of one before and after a repair) cannot be pooled: name \
     those of one arm only"
)]
pub struct NotOneArm {
    /// The session that fits worst, by name.
    pub session: String,
    /// What the shared arm leaves, mm.
    pub shared_mm: f64,
    /// What the nominal arm leaves, mm.
    pub nominal_mm: f64,
    /// What one arm may leave by noise and changes, mm.
    pub allowed_mm: f64,
}

impl SharedFit {
    /// Whether the session is of the arm that the pool shares.
    pub fn is_same_arm(&self) -> bool {
        self.shared_mm <= self.allowed_mm || self.ratio() <= LIMIT
    }

    /// What the shared arm leaves over what the nominal arm leaves.
    pub fn ratio(&self) -> f64 {
        self.shared_mm / self.nominal_mm.max(f64::MIN_POSITIVE)
    }
}

/// Refuses a pool of `names` sessions with one that does not share the arm of the others.
///
/// A single session always fits. `change_rad` is the expected change of a joint between sessions.
pub fn check(
    arm: &Arm,
    full: &FullModel,
    nominal: &Calibration,
    observations: &[Observation],
    names: &[&str],
    change_rad: f64,
) -> Result<(), NotOneArm> {
    let fits = fits(arm, full, nominal, observations, change_rad);
    let foreign = fits.iter().filter(|fit| !fit.is_same_arm());
    match foreign.max_by(|a, b| a.ratio().total_cmp(&b.ratio())) {
        None => Ok(()),
        Some(fit) => Err(NotOneArm {
            session: names[fit.session].to_owned(),
            shared_mm: fit.shared_mm,
            nominal_mm: fit.nominal_mm,
            allowed_mm: fit.allowed_mm,
        }),
    }
}

/// How the shared arm fits every session of a pool; empty for a single session.
pub fn fits(
    arm: &Arm,
    full: &FullModel,
    nominal: &Calibration,
    observations: &[Observation],
    change_rad: f64,
) -> Vec<SharedFit> {
    let sessions = full.starts().len();
    let fit = |session: usize| {
        let weighted = observations.iter().zip(&full.weights);
        let (own, weights): (Vec<&Observation>, Vec<f64>) =
            weighted.filter(|(o, _)| o.session == session).unzip();
        let stations = own.iter().map(|o| Shared::of(full, o, change_rad));
        let stations: Vec<Shared> = stations.collect::<Option<_>>()?;
        let allowed: Vec<f64> = stations.iter().map(|s| s.allowed_mm).collect();
        let frames = &nominal.frames[session];
        let left_by_nominal = |o: &&Observation| {
            let own = frames.pair(o.source, o.target);
            let target = arm.chain().nominal(&o.axes) * own.flange_from_target.origin().point();
            Some((o.point()?.position - own.tracker_from_base.isometry() * target).norm())
        };
        let nominal: Option<Vec<f64>> = own.iter().map(left_by_nominal).collect();
        let sources = (0..frames.sources().len()).map(SourceId);
        let shared = sources.map(|source| {
            let own = stations.iter().zip(&weights);
            let own = own.filter(|(station, _)| station.source == source);
            let (own, weights): (Vec<&Shared>, Vec<f64>) = own.unzip();
            aligned_distances(&own, &weights)
        });
        let shared: Option<Vec<Vec<f64>>> = shared.collect();
        Some(SharedFit {
            session,
            shared_mm: median(&shared?.concat())?,
            nominal_mm: median(&nominal?)?,
            allowed_mm: median(&allowed)?,
        })
    };
    (0..sessions)
        .filter(|_| sessions > 1)
        .filter_map(fit)
        .collect()
}

/// How the arm identified from other sessions fits one that took no part, its base found anew: what it leaves and what the nominal
/// arm leaves at the middle, mm. Nothing is known of the session's own changes: each joint's moves the target, which sits at
/// `target_mm` along the flange's axes, by what its twist does. `None` without stations.
pub fn unseen(
    arm: &Arm,
    observations: &[Observation],
    target_mm: &Vector3<f64>,
    left_mm: &LeftBy,
    change_rad: f64,
) -> Option<SharedFit> {
    let nominal = vec![0.0; arm.chain().parameters().len()];
    let allowed = |o: &Observation| {
        let differential = arm.chain().differential(&o.axes, &nominal);
        let lever = differential.end.rotation * target_mm;
        let moved = differential.joints.iter();
        let moved = moved.map(|twist| (twist.linear + twist.angular.cross(&lever)).norm_squared());
        let change = (CHANGES * change_rad).powi(2) * moved.sum::<f64>();
        Some((o.point()?.instrument.trace() + change).sqrt())
    };
    let allowed: Vec<f64> = observations.iter().map(allowed).collect::<Option<_>>()?;
    Some(SharedFit {
        session: 0,
        shared_mm: left_mm.identified,
        nominal_mm: left_mm.nominal,
        allowed_mm: median(&allowed)?,
    })
}

/// Median distances that are left at the stations of a session, base refitted on all of them, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftBy {
    /// By the identified arm.
    pub identified: f64,
    /// By the nominal arm.
    pub nominal: f64,
}

impl LeftBy {
    /// Whether the identified arm leaves less than [`LIMIT`] of what the nominal one does.
    pub fn improves(&self) -> bool {
        self.identified <= LIMIT * self.nominal
    }
}

/// One station as the shared arm has it.
struct Shared {
    source: SourceId,
    measured: Point3<f64>,
    predicted: Point3<f64>,
    allowed_mm: f64,
}

impl Shared {
    /// `None` of an observation without a position.
    fn of(full: &FullModel, o: &Observation, change_rad: f64) -> Option<Self> {
        let point = o.point()?;
        let predicted = full.predict(&Query::of(o));
        let mut position = predicted.position;
        let mut changed = 0.0;
        for (block, columns) in full.layout().blocks() {
            match block {
                Block::SessionCurve { session, .. } if session == o.session => {
                    // The first column is the joint's constant: how the joint moves the target.
                    changed += predicted.rows.column(columns.start).norm_squared();
                }
                Block::SessionCommandWeight(session) if session == o.session => {}
                _ => continue,
            }
            for column in columns {
                let moved = predicted.rows.column(column) * full.column_mean(column);
                position -= Vector3::new(moved[0], moved[1], moved[2]);
            }
        }
        let change = (CHANGES * change_rad).powi(2) * changed;
        Some(Self {
            source: o.source,
            measured: point.position,
            predicted: position,
            allowed_mm: (point.instrument.trace() + change).sqrt(),
        })
    }
}

/// Distances that are left once one source's measured positions are aligned with predicted ones; `None` where they are too few.
fn aligned_distances(stations: &[&Shared], weights: &[f64]) -> Option<Vec<f64>> {
    let measured: Vec<Point3<f64>> = stations.iter().map(|s| s.measured).collect();
    let predicted: Vec<Point3<f64>> = stations.iter().map(|s| s.predicted).collect();
    let base = align(&predicted, &measured, weights)?;
    let distances = measured.iter().zip(&predicted);
    Some(distances.map(|(m, p)| (base * m - p).norm()).collect())
}
